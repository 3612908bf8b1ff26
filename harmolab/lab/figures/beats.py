"""Pictures of beats and scores: the curves beats are read from, hits and misses, the level of chance, and timing.

Functions named ``draw_...`` draw on the axes that they are given and return them; those named ``..._figure`` return a
figure of their own. Music is blue and points up, the dance is orange and points down. A hit is a green circle, a miss a
red cross.
"""

import base64
import io
from collections.abc import Mapping, Sequence
from textwrap import fill
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator
from numpy.typing import ArrayLike

from harmolab.beats.visual import curve_delay, motion_curve
from harmolab.lab.figures.style import COLOURS, MARKERS, styled_axes
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.types import BeatTrack, FloatArray, Motion, check_kind

SIDES = MappingProxyType({"audio": 1.0, "visual": -1.0})
NAMES = MappingProxyType({"audio": "music beat", "visual": "visual beat"})
MARK_LOOKS: Mapping[str, dict[str, Any]] = {
    name: {
        "linestyle": "none", "marker": MARKERS[name], "markersize": size, "markerfacecolor": "none",
        "markeredgecolor": COLOURS[name], "markeredgewidth": width,
    }
    for name, size, width in (("hit", 9, 2.0), ("miss", 8, 2.2))
}  # fmt: skip
SPARE_LOOK: Mapping[str, Any] = {  # of visual beats that no music beat claims
    "linestyle": "none", "marker": "o", "markersize": 3.5, "color": COLOURS["chance"], "zorder": 4,
}  # fmt: skip
ROW_SECONDS = 15.0  # of a row of the picture of a score
ROOM = 1.3  # a unit stem ends at 1; the marks need some space beyond


def draw_curve(
    ax: Axes, times: ArrayLike, curve: ArrayLike, track: BeatTrack | None = None, *, kind: str = "visual"
) -> Axes:
    """Draw a curve over time, and a line with a mark at each beat that was read from it.

    Parameters
    ----------
    ax : Axes
    times : (T,) array, seconds
    curve : (T,) array, such as of `onset_envelope` or `motion_curve`
    track : BeatTrack, optional
        The beats to mark.
    kind : "audio" or "visual"
        Gives colour and mark: music is blue, movement orange.

    Returns
    -------
    The Axes
    """
    colour = COLOURS[kind]
    seconds, values = np.asarray(times, np.float64), np.asarray(curve, np.float64)
    ax.plot(seconds, values, color=colour, linewidth=1.2, zorder=2)
    top = 1.08 * max(float(values.max(initial=0.0)), 1e-12)
    if track is not None:
        check_kind(track, BeatTrack, "track")
        _draw_lines(ax, track.times, 0.0, top, color=colour, alpha=0.45, linewidth=1.2, zorder=1)
        heights = np.interp(track.times, seconds, values) if track.times.size else track.times
        mark = "o" if kind == "audio" else MARKERS[kind]
        ax.plot(
            track.times, heights, linestyle="none", marker=mark, color=colour, markersize=6, zorder=3,
            markeredgecolor="white", markeredgewidth=0.6, label=f"{NAMES[kind]} ({track.times.size})",
        )  # fmt: skip
        ax.set_xlim(0.0, track.duration)
    ax.set_ylim(min(0.0, 1.08 * float(values.min(initial=0.0))), top)
    ax.set_xlabel("time (s)")
    return ax


def timed_curve(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, FloatArray]:
    """Seconds and values of the curve that visual beats are read from."""
    curve, fps = motion_curve(motion, params)
    return (np.arange(curve.size, dtype=np.float64) - curve_delay(params)) / fps, curve


def _draw_lines(ax: Axes, times: FloatArray, bottom: ArrayLike, top: ArrayLike, **look: Any) -> None:
    """A vertical line at each time. `Axes.vlines` takes four times as long, most of it to find limits."""
    low, high = np.broadcast_to(bottom, times.shape), np.broadcast_to(top, times.shape)
    ends = [[(time, start), (time, end)] for time, start, end in zip(times, low, high, strict=True)]
    ax.add_collection(LineCollection(ends, **look))


def draw_tolerance(ax: Axes, times: ArrayLike, delay: float, *, reach: float = ROOM) -> Axes:
    """The tolerance field around each music beat: `delay` seconds to either side, a pale blue band."""
    spans = [(time - delay, time + delay) for time in np.asarray(times, np.float64)]
    if spans and delay > 0:
        corners = [[(left, -reach), (left, reach), (right, reach), (right, -reach)] for left, right in spans]
        look: dict[str, Any] = {"facecolor": COLOURS["audio"], "alpha": 0.13, "linewidth": 0, "zorder": 0}
        ax.add_collection(PolyCollection(corners, label="tolerance field", **look))
    return ax


def draw_stems(ax: Axes, track: BeatTrack, *, kind: str, heights: ArrayLike | None = None) -> Axes:
    """One stem for each beat: upwards for the music, downwards for the dance.

    Parameters
    ----------
    ax : Axes
    track : BeatTrack
    kind : "audio" or "visual"
    heights : (B,) array, optional
        Lengths of the stems, not negative; all 1 when left out.
    """
    lengths = np.ones(track.times.size) if heights is None else np.asarray(heights, np.float64)
    if track.times.size:
        tips = SIDES[kind] * lengths
        _draw_lines(ax, track.times, 0.0, tips, zorder=2, label=NAMES[kind], color=COLOURS[kind], linewidth=2.2)
    return ax


def draw_hits(
    ax: Axes, audio_track: BeatTrack, visual_track: BeatTrack, pairs: ArrayLike, *, delay: float, lag: float = 0.0
) -> Axes:
    """Draw the beats of both sides with hits and misses: music upwards, movement downwards (Figs. 1, 3b, 5b).

    Around each music beat lies its tolerance field, the time within which a visual beat hits it. A green circle is a
    hit, a red cross a miss.

    Parameters
    ----------
    ax : Axes
    audio_track, visual_track : BeatTrack
        The N beats of the music and the M of the movement that are compared.
    pairs : (N,) array of int
        Number of the visual beat that hits each music beat, -1 for none: `HarmonyScore.pairs`, or of `hit_pairs`.
        Visual beats that hit nothing are no error, and drawn as small grey dots.
    delay : float, seconds
        T_delay, half the width of a field.
    lag : float, seconds
        Time by which movements are expected later than the music's beats; the fields are drawn so much later.

    Returns
    -------
    The Axes

    Raises
    ------
    ValueError
        Unless BeatTracks are passed, and in `pairs` a number for each music beat (True and False, as the hits of a
        score, are none).

    Examples
    --------
    >>> draw_hits(ax, score.music, score.visual, score.pairs, delay=score.params.reaction_delay)  # doctest: +SKIP
    """
    check_kind(audio_track, BeatTrack)
    check_kind(visual_track, BeatTrack)
    partners = np.asarray(pairs)
    if partners.shape != audio_track.times.shape or partners.dtype == bool:
        raise ValueError("pairs must be the number of a visual beat for each music beat, -1 for none: a score's pairs")
    used = np.isin(np.arange(visual_track.times.size), partners[partners >= 0])
    draw_tolerance(ax, audio_track.times + lag, delay)
    draw_stems(ax, audio_track, kind="audio")
    draw_stems(ax, visual_track, kind="visual")
    times = np.concatenate([audio_track.times, visual_track.times[used]])
    tips = np.repeat([1.0, -1.0], [partners.size, used.sum()])
    good = np.concatenate([partners >= 0, np.ones(int(used.sum()), bool)])
    draw_marks(ax, times, tips, good)
    ax.plot(visual_track.times[~used], -np.ones((~used).sum()), **SPARE_LOOK, label="visual beat left over")
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8, zorder=1)
    ax.set(xlim=(0.0, audio_track.duration), ylim=(-ROOM, ROOM), xlabel="time (s)")
    return name_heights(ax, {-0.65: "dance", 0.65: "music"})


def name_heights(ax: Axes, names: Mapping[float, str], *, length: float = 0) -> Axes:
    """Ticks of that length (points) at some heights, with their names."""
    ax.yaxis.set_major_locator(FixedLocator(list(names)))
    ax.yaxis.set_major_formatter(FixedFormatter(list(names.values())))
    ax.tick_params(axis="y", length=length)
    return ax


def draw_marks(
    ax: Axes, times: ArrayLike, heights: ArrayLike, good: ArrayLike, *, labels: tuple[str, str] = ("hit", "missed")
) -> Axes:
    """Draw green circles for hits and red crosses for misses.

    Parameters
    ----------
    ax : Axes
    times, heights : (B,) arrays
        Places of the marks on the x and the y axis.
    good : (B,) bool array
        True for a circle, False for a cross.
    labels : (str, str)
        Names of circles and crosses in the legend.

    Returns
    -------
    The Axes
    """
    x, y, mask = np.asarray(times, np.float64), np.asarray(heights, np.float64), np.asarray(good, bool)
    for members, kind, label in zip((mask, ~mask), ("hit", "miss"), labels, strict=True):
        ax.plot(x[members], y[members], **MARK_LOOKS[kind], zorder=4, label=label)
    return ax


def draw_shares(ax: Axes, track: BeatTrack, shares: ArrayLike, *, chance: float) -> Axes:
    """Percentile rank of each music beat among all moments of the clip (measure "shape" with a pattern).

    Parameters
    ----------
    ax : Axes
    track : BeatTrack, the N attentional music beats; stronger ones get wider stems
    shares : (N,) array in [0, 1], percentile ranks as in a `HarmonyScore` by a bar pattern
    chance : float
    """
    ranks = np.asarray(shares, np.float64)
    weights = track.strengths / max(float(track.strengths.max(initial=0.0)), 1e-12)
    if track.times.size:
        _draw_lines(
            ax, track.times, chance, ranks, color=COLOURS["audio"], linewidth=1.0 + 5.0 * weights, zorder=2,
            label="music beat, wider if stronger",
        )  # fmt: skip
    ax.axhline(chance, color=COLOURS["chance"], linestyle="--", linewidth=1.2, zorder=1, label="chance")
    draw_marks(ax, track.times, ranks, ranks > 0.5, labels=("above the median moment", "below it"))
    ax.set(xlim=(0.0, track.duration), ylim=(-0.08, 1.08), xlabel="time (s)")
    return name_heights(ax, {0.0: "0", 0.5: "0.5", 1.0: "1"}, length=3)


def beat_strip(track: BeatTrack, *, longest: float = np.inf) -> Figure:
    """A stem at each beat, its height the strength as a share of the strongest, and a triangle at each downbeat.

    The first `longest` seconds at most are drawn.
    """
    with styled_axes((9.0, 0.9)) as (figure, [ax]):
        part = track.span(0.0, min(track.duration, longest))
        draw_stems(ax, part, kind="audio", heights=part.strengths / max(part.strengths.max(initial=0.0), 1e-12))
        if part.bar_places is not None:
            downbeats = part.times[part.bar_places == 0]
            ax.plot(downbeats, np.full(downbeats.size, 1.15), "v", color=COLOURS["ink"], markersize=4, gid="downbeat")
        ax.set(xlim=(0.0, part.duration), ylim=(0.0, 1.3), yticks=[], xlabel="time (s)")
        ax.spines["left"].set_visible(False)
    return figure


def score_figure(
    scores: Mapping[str, HarmonyScore], *, title: str = "", longest: float = np.inf, begin: float = 0.0
) -> Figure:
    """The picture of a score, or of several scores of one dance: every music beat, and whether it was met.

    A score by hits shows hits and misses with their tolerance fields, the recommended score the rank of each beat's
    moment among all moments of the take. Time runs in rows of 15 s. Above the rows of each score stands its verdict in
    words, with its number.

    Parameters
    ----------
    scores : dict
        Name of the settings, such as "recommended" -> the HarmonyScore of the dance by them.
    title : str
        Words above the first row.
    longest : float, seconds
        Time that is drawn at most.
    begin : float, seconds
        Moment of the music at which the scores begin: where the dance does.

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        If there are no scores, or one is passed without its name.

    Examples
    --------
    >>> score_figure({"recommended": score}).savefig("score.png")  # doctest: +SKIP
    """
    if not isinstance(scores, Mapping) or {type(score) for score in scores.values()} != {HarmonyScore}:
        raise ValueError(f'scores by their modes are needed, such as {{"recommended": score}}, got {scores!r:.80}')
    duration = min(max(score.music.duration for score in scores.values()), longest)
    rows, across = max(int(np.ceil(duration / ROW_SECONDS)), 1), min(duration, ROW_SECONDS)
    with styled_axes((9.0, (1.25 * rows + 1.0) * len(scores) + 0.3), rows * len(scores)) as (figure, axes):
        for mode, (name, score) in enumerate(scores.items()):
            panels = axes[mode * rows : (mode + 1) * rows]
            for row, ax in enumerate(panels):
                draw_score(ax, score).set(xlim=(row * across, (row + 1) * across), xlabel="")
                ax.xaxis.set_major_formatter(lambda time, _: f"{round(begin + time, 2):g}")
                if is_ranked(score):
                    ax.set_ylabel("fit (rank)")
            panels[0].set_title(f"{name}: {fill(claim(score), 95)}\n{headline(score)}", fontsize=10)
            panels[-1].set_xlabel("time in the music (s)")
        entries: dict[str, Any] = {}
        for ax in axes[::rows]:
            handles, labels = ax.get_legend_handles_labels()
            entries |= dict(zip(labels, handles, strict=True))
        ncols = len(entries) if len(entries) <= 6 else -(-len(entries) // 2)
        figure.legend(entries.values(), entries, loc="outside lower center", ncols=ncols, fontsize=9, columnspacing=1.2)
        if title:
            figure.suptitle(title, x=0.01, ha="left")
    return figure


def claim(score: HarmonyScore) -> str:
    """A score in a sentence: the verdict, or how many beats were met beside what chance meets."""
    if score.judgement is not None:
        return score.judgement.verdict
    met, chance = int(score.hits.sum()), score.chance * score.n_audio
    words = f"chance alone meets {chance:.0f}" if met > chance else f"no more than chance ({chance:.0f})"
    return f"{met} of {score.n_audio} music beats met, {words}"


def draw_score(ax: Axes, score: HarmonyScore) -> Axes:
    """The beats of one score: hit or missed, or ranked where they are compared with a pattern."""
    params = score.params
    if is_ranked(score):
        return draw_shares(ax, score.music, score.shares, chance=score.chance)
    return draw_hits(ax, score.music, score.visual, score.pairs, delay=params.reaction_delay, lag=params.lag)


def is_ranked(score: HarmonyScore) -> bool:
    """True where the shares of a score are ranks of its beats by the fit to a pattern, at a place that is known."""
    judgement = score.judgement
    return judgement is not None and judgement.is_placed and judgement.pattern is not None


def headline(score: HarmonyScore) -> str:
    """The number in one line, "-" where there is none, with its level or with the paper's numbers."""
    judgement, (low, high) = score.judgement, score.interval
    number = f"{score.above_chance:+.2f}" if np.isfinite(score.above_chance) else "-"
    # Of a verdict the p that decides: whether it is in time.
    p = f"p = {score.p_value:.3f}" if judgement is None else f"p in time = {judgement.p_time:.3f}"
    if np.isfinite([score.above_chance, score.p_value]).all():
        unit = "beat" if judgement is None else "bar"
        number += f" ({low:+.2f} to {high:+.2f} from {unit} to {unit}, {p})"
    if judgement is None:
        return f"above chance {number};  h = {score.harmony:.2f}"
    return f"level {judgement.level} of 4, above chance {number}"


# Timing: the distance from each music beat to the dancer's nearest rest or hit, along time

Mean = tuple[float, float, float, tuple[float, float]]  # start, end, mean, interval: all in seconds

DPI = 150
LEAST_ROOM = 1.6  # tolerances that the y axis shows at least
FAR = "none within half a beat"


def offset_figure(lags: FloatArray, curve: FloatArray, *, best: float, others: Sequence[float] = ()) -> Figure:
    """The picture of `find_offset`: how well a dance fits its music by the moment at which it begins.

    Parameters
    ----------
    lags, curve : (L,) arrays
        Moments of the music (seconds) and the evidence for each: `Offset.lags` and `Offset.curve`.
    best : float, seconds
        The moment that fits best: `Offset.seconds`.
    others : sequence of float, seconds
        Those that fit nearly as well: `Offset.alternatives`.

    Returns
    -------
    Figure
    """
    with styled_axes((9.0, 3.2)) as (figure, (ax,)):
        ax.plot(lags, curve, color=COLOURS["visual"])
        ax.axvline(best, color=COLOURS["ink"], linestyle="--", label=f"found: {best:.2f} s")
        for number, other in enumerate(others):
            label = "or some beats earlier or later" if number == 0 else None
            ax.axvline(other, color=COLOURS["chance"], linestyle=":", label=label)
        title = f"The dance fits best when it begins {best:.2f} s into the song"
        ax.set_title(f"{title}; {len(others)} other places fit nearly as well" if others else title)
        ax.set(xlabel="song time of the first frame (s)", ylabel="slowness on beats (SD)")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def signed_offsets(audio_times: FloatArray, visual_times: FloatArray) -> FloatArray:
    """Offset of the visual beat nearest to each music beat: (N,) seconds, early is negative; NaN without any.

    >>> signed_offsets(np.array([1.0, 2.0]), np.array([1.1, 1.75]))
    array([ 0.1 , -0.25])
    """
    if visual_times.size == 0:
        return np.full(audio_times.size, np.nan)
    differences = visual_times[None, :] - audio_times[:, None]
    offsets: FloatArray = differences[np.arange(audio_times.size), np.abs(differences).argmin(axis=1)]
    return offsets


def event_name(score: HarmonyScore) -> str:
    """Name of the events that a score's visual beats are: "rest", "hit", or "visual beat" where they are both."""
    if score.judgement is not None and score.judgement.reading == "hit":
        return "hit"
    return {"valleys": "rest", "peaks": "hit"}.get(score.params.detector, "visual beat")


def draw_timing(ax: Axes, score: HarmonyScore, *, event: str = "") -> Axes:
    """Each music beat's distance to the visual beat that hits it, in milliseconds; below zero before it, above after.

    A green circle is a hit of the score; a red cross a miss, at its nearest visual beat; a diamond at the edge a beat
    that has none within half the time between beats. Without visual beats only the band of the tolerance is drawn. An
    event before the beat is not yet a dancer who is early: that is for the verdict. `event` names the visual beats,
    `event_name` where it is left out. ValueError unless a HarmonyScore is passed.
    """
    check_kind(score, HarmonyScore)
    music, times = score.music, score.visual.times - score.params.lag
    hits = score.pairs >= 0
    offsets = 1000 * signed_offsets(music.times, times)
    offsets[hits] = 1000 * (times[score.pairs[hits]] - music.times[hits])
    delay = 1000 * score.params.reaction_delay
    ax.axhspan(-delay, delay, color=COLOURS["audio"], alpha=0.13, linewidth=0, zorder=0, label="tolerance field")
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8, zorder=1)
    half = 500 * float(np.median(np.diff(music.times))) if len(music.times) > 1 else np.inf
    near = hits | (np.abs(offsets) <= max(half, LEAST_ROOM * delay))
    draw_marks(ax, music.times[near], offsets[near], hits[near], labels=("hit", "missed"))
    room = 1.15 * max(float(np.abs(offsets[near]).max(initial=0.0)), LEAST_ROOM * delay, 1.0)
    if (far := np.isfinite(offsets) & ~near).any():
        edges = 0.95 * room * np.sign(offsets[far])
        ax.plot(music.times[far], edges, linestyle="none", marker="d", color=COLOURS["miss"], label=FAR)
    label = f"{event or event_name(score)} before  |  after (ms)"
    ax.set(xlim=(0.0, music.duration), ylim=(-room, room), xlabel="time (s)", ylabel=label)
    return ax


def draw_means(ax: Axes, means: Sequence[Mean]) -> Axes:
    """The lag of each segment as an orange line, with a pale field for its spread.

    Parameters
    ----------
    ax : Axes with milliseconds on the y axis
    means : (start, end, mean, (low, high)) for each segment, seconds
    """
    for place, (start, end, mean, (low, high)) in enumerate(means):
        field = "lag and spread from bar to bar" if place == 0 else None
        ax.plot([start, end], [1000 * mean] * 2, color=COLOURS["visual"], linewidth=2.2, zorder=4, label=field)
        if np.isfinite([low, high]).all():
            ax.fill_between([start, end], 1000 * low, 1000 * high, color=COLOURS["visual"], alpha=0.35, lw=0, zorder=3)
    return ax


def ranks_figure(score: HarmonyScore, *, size: tuple[float, float] = (9.0, 3.6)) -> Figure:
    """The rank of each music beat by the fit to a dance's pattern (`is_ranked`), with a legend; `size` in inches."""
    with styled_axes(size) as (figure, (ax,)):
        draw_shares(ax, score.music, score.shares, chance=score.chance).set_ylabel("rank of the fit")
        _add_legend(ax, size)
    return figure


def timing_figure(
    score: HarmonyScore,
    *,
    means: Sequence[Mean] = (),
    title: str = "The rest or hit nearest to each music beat",
    event: str = "",
    size: tuple[float, float] = (9.0, 3.6),
) -> Figure:
    """The picture of the timing of a dance: how many milliseconds before or after each music beat a movement comes.

    A green circle is a visual beat that hits the music beat, a red cross the nearest one of a miss. A diamond at the
    edge stands for a music beat that has none within half the time between beats. A movement before the beat is not yet
    a dancer who is early: that is for the verdict.

    Parameters
    ----------
    score : HarmonyScore
    means : sequence of (start, end, mean, (low, high)), seconds
        Lags of stretches of the dance, drawn as lines with a field for their interval.
    title : str
    event : str
        Name of the visual beats, such as "rest"; that of the score when left out.
    size : (float, float), inches

    Returns
    -------
    Figure
    """
    with styled_axes(size) as (figure, (ax,)):
        draw_means(draw_timing(ax, score, event=event), means)
        ax.set_title(title)
        _add_legend(ax, size)
    return figure


def png_text(figure: Figure) -> str:
    """A figure as base64 of PNG, to stand in a page."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, bbox_inches="tight")
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _add_legend(ax: Axes, size: tuple[float, float]) -> None:
    """A legend below the axes, folded in a narrow figure."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.72 / size[1]), ncols=4 if size[0] > 6 else 2)
