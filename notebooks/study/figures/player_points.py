"""Pictures of musicians' points: sound to avatar, tracked and rejected frames, components, delay (Figs. 1 to 4).

Numbered as in "Audio to Body Dynamics" (Shlizerman et al. 2018). Left hand and arm are blue, right ones red.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.container import BarContainer
from matplotlib.figure import Figure

from harmolab.body.skeletons import Skeleton, joint_side
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.musician.cleaning import RULES, Cleaned
from harmolab.musician.performances import Performance
from harmolab.readers.player_points import limb_widths
from harmolab.types import Audio, BoolArray, FloatArray, Motion, Notes
from study.figures.player_overlays import frame_picture, with_margin

SIDES: Mapping[str, str] = MappingProxyType({"left": COLOURS["audio"], "right": COLOURS["miss"], "": COLOURS["ink"]})
NAMES = ("C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B")


def draw_player(
    ax: Axes, points: FloatArray, skeleton: Skeleton, *, detected: BoolArray | None = None, colour: str = ""
) -> Axes:
    """The points (P, 2) of a musician in a picture, y down, and lines along the skeleton.

    Parameters
    ----------
    detected : (P,) mask; a point that was not detected is not drawn
    colour : one for all; that of each side when left out
    """
    drawn = np.ones(len(points), bool) if detected is None else detected
    bones = [bone for bone in skeleton.bones if drawn[list(bone)].all()]
    widths = [1.0 + 2.0 * width for width in limb_widths(skeleton, bones)]
    dots = np.array([colour or SIDES[joint_side(name)] for name in skeleton.joints])
    looks = [dots[one] if dots[one] == dots[other] else SIDES[""] for one, other in bones]
    lines = [points[list(bone)] for bone in bones]
    ax.add_collection(LineCollection(lines, colors=looks, linewidths=widths, capstyle="round", gid="limbs"))
    ax.scatter(points[drawn, 0], points[drawn, 1], s=5, c=dots[drawn], zorder=3)
    ax.set_aspect("equal")
    return ax


def framed(ax: Axes, points: FloatArray) -> Axes:
    """Axes around points (..., 2), y down, without ticks."""
    frame_picture(ax, with_margin(points.reshape(-1, 2))).set_anchor("N")
    return ax


def frames_figure(results: Mapping[str, Cleaned], *, columns: int = 4) -> Figure:
    """Fig. 2: accepted frames at even intervals, their points, and the notes that sound: a row for each musician.

    Parameters
    ----------
    results : label -> Cleaned
    columns : int, moments of each; the next accepted frame is drawn
    """
    with styled_axes((10.0, 2.4 * len(results)), len(results), columns) as (figure, axes):
        for row, (label, result) in enumerate(results.items()):
            motion, kept = result.performance.motion, np.flatnonzero(result.accepted)
            moments = (np.arange(columns) + 0.5) * motion.n_frames / columns
            frames = kept[np.minimum(np.searchsorted(kept, moments), len(kept) - 1)].tolist()
            for ax, frame in zip(axes[row * columns : (row + 1) * columns], frames, strict=True):
                draw_player(ax, motion.positions[frame], motion.skeleton)
                framed(ax, motion.positions[frames])
                ax.set_xlabel(_moment(result.performance, frame / motion.fps), fontsize=9)
            axes[row * columns].set_title(label, fontsize=10)
    return figure


def _moment(performance: Performance, seconds: float) -> str:
    """The time, and what sounds then."""
    text = f"{seconds:.1f} s"
    if performance.notes is None:
        return f"{text}, notes not known"
    notes, now = performance.notes, seconds + performance.offset
    pitches = notes.pitches[(notes.onsets <= now) & (notes.offsets > now)]
    return f"{text}: {' '.join(map(note_name, np.unique(pitches).tolist()[:5])) or 'no note'}"


def note_name(pitch: int) -> str:
    """Name of a MIDI number.

    >>> note_name(60), note_name(70)
    ('C4', 'A#4')
    """
    return f"{NAMES[pitch % 12]}{pitch // 12 - 1}"


def faults_figure(examples: Sequence[Any], *, columns: int = 4) -> Figure:
    """Fig. 3: rejected frames, the last accepted one faint behind each, and the rule that caught it.

    Parameters
    ----------
    examples : records as of `rejected_frame` of notebook 18
    columns : int, frames in a row
    """
    rows = -(-len(examples) // columns)
    with styled_axes((10.0, 2.75 * rows), rows, columns) as (figure, axes):
        for ax, example in zip(axes, examples, strict=False):
            draw_player(ax, example.before, example.skeleton, colour=COLOURS["faint"])
            draw_player(ax, example.points, example.skeleton, detected=example.detected)
            framed(ax, np.concatenate([example.before, example.points]))
            caught = f"rejected by: {example.rule}" if example.rule else "not rejected"
            ax.set_title(f"{example.fault or example.recording}\n{caught}", fontsize=10)
            ax.set_xlabel(f"{example.recording}, {example.seconds:.1f} s" if example.fault else
                          f"{example.seconds:.1f} s", fontsize=8)  # fmt: skip
        for ax in axes[len(examples) :]:
            ax.set_axis_off()
    return figure


def cleaning_figure(summary: pd.DataFrame, planted: pd.DataFrame) -> Figure:
    """Share of frames rejected: by rule in each recording, and of each planted fault.

    Parameters
    ----------
    summary : means of each recording, with the columns recording and `RULES`
    planted : columns instrument, fault, rejected (share), of one or more instruments
    """
    shares = 100 * summary.set_index("recording")[[rule for rule in RULES if summary[rule].max() > 0]]
    grid = 100 * planted.pivot_table(index="fault", columns="instrument", values="rejected", sort=False)
    below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "fontsize": 8}
    with styled_axes((10.4, 0.35 * len(summary) + 2.6), 1, 2) as (figure, (ax, other)):
        shares.plot.barh(ax=ax, stacked=True, width=0.7).set(xlabel="% of the frames", ylabel="")
        for row, share in enumerate(sums := shares.sum(axis=1)):
            ax.text(share, row, f" {share:.1f}", va="center", fontsize=8)
        grid.add_prefix("planted ").plot.barh(ax=other, width=0.8).set_ylabel("")
        for bars in other.containers:
            other.bar_label(cast(BarContainer, bars), fmt="%.1f", padding=2, fontsize=8)
        ax.set(title="rejected in each recording", xlim=(0, 1.15 * sums.max()))
        other.set(xlabel="% of the frames with this fault", title="rejected of what was planted", xlim=(0, 115))
        ax.legend(title="rejected by", ncols=4, **below)
        other.legend(ncols=2, **below)
        for panel in (ax, other):
            panel.invert_yaxis()
    return figure


def features_figure(clip: Any) -> Figure:
    """The 28 numbers of each frame below the wave, note onsets as lines; `clip` as of `played_clip` of notebook 18."""
    sizes = {"height_ratios": (1, 3)}
    with styled_axes((9.6, 5.4), 2, 1, sharex=True, gridspec_kw=sizes) as (figure, (top, ax)):
        draw_wave(top, clip.audio, clip.notes)
        picture = draw_features(ax, clip)
        half = len(clip.feature_names) // 2
        places = [0, half // 2, half - 1, half + half // 2, len(clip.feature_names) - 1]
        ax.set_yticks(places, [clip.feature_names[place] for place in places])
        ax.axhline(half - 0.5, color="white", linewidth=1.5)
        ax.set_xlabel("time (s)")
        figure.colorbar(picture, ax=ax, label="standard deviations", shrink=0.8)
    return figure


def draw_wave(ax: Axes, audio: Audio, notes: Notes) -> Axes:
    """The wave of a sound, and its note onsets as lines."""
    step = max(1, audio.samples.size // 6000)
    ax.plot(np.arange(0, audio.samples.size, step) / audio.sample_rate, audio.samples[::step],
            color=COLOURS["audio"], linewidth=0.5)  # fmt: skip
    for onset in notes.onsets:
        ax.axvline(onset, color=COLOURS["chance"], linewidth=0.7, linestyle=":", zorder=0)
    ax.set(yticks=[], title="sound, and the onsets of its notes (dotted)")
    return ax


def draw_features(ax: Axes, clip: Any) -> Any:
    """The features of a clip as an image over time; returns it."""
    count, seconds = clip.features.shape[1], clip.features.shape[0] / clip.points.fps
    picture = ax.imshow(
        clip.features.T, aspect="auto", origin="upper", cmap="RdBu_r", vmin=-2.5, vmax=2.5,
        extent=(0.0, seconds, count - 0.5, -0.5), interpolation="nearest",
    )  # fmt: skip
    ax.set_title(f"{count} numbers a frame: 13 MFCC and log energy, below them their slopes")
    return picture


def overview_figure(clip: Any, *, at: float = 3.0) -> Figure:
    """Fig. 1: sound, features, points and avatar of a clip of notebook 18 (`played_clip`), `at` seconds of it."""
    with styled_axes((11.0, 3.1), 1, 4, gridspec_kw={"width_ratios": (1.1, 1.1, 1, 1)}) as (figure, axes):
        draw_wave(axes[0], clip.audio, clip.notes)
        draw_features(axes[1], clip)
        axes[1].set_yticks([])
        frame = round(at * clip.points.fps)
        draw_player(axes[2], clip.points.positions[frame], clip.points.skeleton)
        framed(axes[2], clip.points.positions[frame])
        draw_avatar(axes[3], clip.avatar, frame)
        words = ("1 the sound", "2 28 numbers a frame", "3 50 points (planted)", "4 an avatar")
        for ax, text in zip(axes, words, strict=True):
            ax.set_title(text)
        for ax in axes[:2]:
            ax.axvline(at, color=COLOURS["ink"], linewidth=1.2)
            ax.set_xlabel("time (s)")
        for ax in axes[2:]:
            ax.set_xlabel(f"at {at:g} s")
    return figure


def draw_avatar(ax: Axes, avatar: Motion, frame: int, *, turn: float = 25.0, tilt: float = 12.0) -> Axes:
    """One frame of an avatar (T, J, 3) seen from a little to the side and above: degrees that the camera is turned."""
    side, up = np.radians(turn), np.radians(tilt)
    x, y, z = avatar.positions[frame].T
    across, depth = x * np.cos(side) - z * np.sin(side), x * np.sin(side) + z * np.cos(side)
    places = np.column_stack([across, -(y * np.cos(up) - depth * np.sin(up))])
    return framed(draw_player(ax, places, avatar.skeleton), places)
