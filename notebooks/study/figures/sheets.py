"""Contact sheets: whole dances as rows of people, for people who want to see what numbers cannot say."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from harmolab.files import PathLike, atomic_write
from harmolab.lab.figures.people import draw_film, figure_stage, middles_of, person_polygons, posed, stage_shapes
from harmolab.lab.figures.style import COLOURS, figure_style, styled_axes, write_figure
from harmolab.lab.person import Stage
from harmolab.types import FloatArray, IntArray, Motion

WIDTH = 1600 / 150  # inches: 1600 pixels at the resolution that figures are saved in
CELL = (0.74, 1.42)  # room of a figure across and up, in heights of the dancer
TITLE = 0.22  # the same, of a dance's name
GHOSTS = (0.2, 0.1)  # seconds before a beat
STRIP, PAIRS = 0.3, 6  # seconds between the figures of a blind strip, and pairs of strips on a sheet


def contact_sheet(motions: Mapping[str, Motion], *, every: float = 0.5, columns: int = 20, turn: float = 0.0) -> Figure:
    """Dances one below the other, each as rows of people at even intervals.

    Every dancer is seen from where she faces on average, by a camera that stands still in its direction but goes along
    with the dancer: turns show, travel does not. All figures of a dance stand on one floor and are drawn in one scale,
    heights of the dancer. Left limbs are indigo, right ones orange; what is pale is far away. Seconds stand below.

    Parameters
    ----------
    motions : label -> Motion; of 2-D motion the picture itself is drawn
    every : float, seconds from one figure to the next
    columns : int, figures in a row
    turn : float, degrees that the camera stands farther to the dancer's left than in all other pictures

    Raises
    ------
    ValueError
        If there is no motion, or `every` or `columns` is not positive.
    """
    if not motions:
        raise ValueError("a contact sheet needs at least one motion")
    if not 0 < every < math.inf or columns < 1:
        raise ValueError(f"every and columns must be positive, got {every} and {columns}")
    times = [np.arange(0.0, motion.duration - 0.5 / motion.fps, every) for motion in motions.values()]
    tops = np.cumsum([0.0, *(math.ceil(len(moments) / columns) * CELL[1] + TITLE for moments in times)])
    width = columns * CELL[0]
    with figure_style():
        figure = Figure(figsize=(WIDTH, WIDTH * tops[-1] / width))
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width), ylim=(-tops[-1], 0.0))
        ax.set_axis_off()
        for (label, motion), moments, top in zip(motions.items(), times, -tops[:-1], strict=True):
            ax.text(0.1, top - 0.04, label, va="top", fontweight="bold", color=COLOURS["ink"])
            _draw_dance(ax, motion, moments, columns, turn, top - TITLE)
    return figure


def beat_sheet(dances: Mapping[str, tuple[Motion, FloatArray]], *, count: int = 10) -> Figure:
    """Dances one below the other: a person at each of the first beats of the music, and in grey where she just was.

    Who rests on a beat covers her ghosts, who is on the move is smeared by them.

    Parameters
    ----------
    dances : label -> (motion, times of the music's beats in seconds of the motion)
    count : int, beats shown

    Raises
    ------
    ValueError
        If there is no dance, or one without two beats that have `GHOSTS` seconds of movement before them.
    """
    shown = {label: _beats_within(motion, beats)[:count] for label, (motion, beats) in dances.items()}
    if not shown or min(map(len, shown.values())) < 2:
        raise ValueError("a sheet of beats needs dances with two beats each")
    with styled_axes((9.2, 1.38 * len(shown) + 0.5), len(shown)) as (figure, axes):
        for ax, (label, beats) in zip(axes, shown.items(), strict=True):
            margin = (beats[-1] - beats[0]) / (len(beats) - 1) / 2
            span = (float(beats[0] - margin), float(beats[-1] + margin))
            for beat in beats:
                ax.axvline(beat, color=COLOURS["audio"], linewidth=3.5, alpha=0.35, zorder=0, gid="beat")
            draw_film(ax, dances[label][0], beats, span, height=80.0, trail=GHOSTS)
            ax.set_title(label, fontsize=10)
            ax.set_xticks([])
        words = " and ".join(f"{seconds:g}" for seconds in GHOSTS)
        figure.suptitle(f"Who rests on the beat? Each beat of the music, in grey {words} s before", x=0.01, ha="left")
    return figure


def _beats_within(motion: Motion, beats: FloatArray) -> FloatArray:
    """The beats that have movement before them."""
    times = np.asarray(beats, np.float64)
    return times[(times >= GHOSTS[0]) & (times < motion.duration)]


def blind_strips(
    pairs: Sequence[tuple[Motion, Motion]], rng: np.random.Generator
) -> tuple[dict[str, Motion], pd.DataFrame]:
    """Strips of pairs (recorded, made) in a new order, "1 A", "1 B", "2 A" and so on, and which of each pair is made.

    Returns
    -------
    (label -> Motion, DataFrame with the columns pair, made ("A" or "B") and place, that of the pair among `pairs`)
    """
    strips: dict[str, Motion] = {}
    answers: list[dict[str, int | str]] = []
    for number, place in enumerate(rng.permutation(len(pairs)).tolist(), 1):
        made = int(rng.integers(2))
        strips |= {f"{number} A": pairs[place][made], f"{number} B": pairs[place][1 - made]}
        answers.append({"pair": number, "made": "BA"[made], "place": place})
    return strips, pd.DataFrame(answers)


def save_blind_sheets(pairs: Sequence[tuple[Motion, Motion]], out: PathLike, rng: np.random.Generator) -> list[Path]:
    """Contact sheets of `blind_strips` in a folder, six pairs on each, and answers.csv, to be opened afterwards.

    What the sheets show of recordings that may not be passed on may not be passed on either.

    Returns
    -------
    Paths of the sheets.
    """
    strips, answers = blind_strips(pairs, rng)
    folder, labels = Path(out), list(strips)
    folder.mkdir(parents=True, exist_ok=True)
    parts = [labels[first : first + 2 * PAIRS] for first in range(0, len(labels), 2 * PAIRS)]
    sheets = [folder / f"sheet_{number}.png" for number in range(1, len(parts) + 1)]
    for path, part in zip(sheets, parts, strict=True):
        write_figure(contact_sheet({label: strips[label] for label in part}, every=STRIP), path)
    with atomic_write(folder / "answers.csv") as part_file:
        answers.to_csv(part_file, index=False)
    return sheets


def _draw_dance(ax: Axes, motion: Motion, moments: FloatArray, columns: int, turn: float, top: float) -> None:
    """The figures of one dance, row by row from the top; one unit of the axes is the dancer's height."""
    number = np.arange(len(moments))
    feet = np.stack([(number % columns + 0.5) * CELL[0], top - (number // columns + 0.88) * CELL[1]], axis=1)
    frames = np.clip(np.rint(moments * motion.fps).astype(np.int64), 0, motion.n_frames - 1)
    floors = np.unique(feet[:, 1])
    ax.hlines(floors, 0.1, columns * CELL[0] - 0.1, color=COLOURS["faint"], linewidth=0.8, zorder=0)
    _draw_people(ax, figure_stage(motion, turn), frames, feet)
    for moment, (x, y) in zip(moments, feet, strict=True):
        ax.text(x, y - 0.03, f"{round(moment, 2):g}", ha="center", va="top", fontsize=8, color=COLOURS["chance"])


def _draw_people(ax: Axes, stage: Stage, frames: IntArray, feet: FloatArray) -> None:
    """All people as one collection, each on its place (P, 2), and their shadows as another."""
    middles = middles_of(stage.positions[frames])
    middles[:, 1] = np.percentile(stage.positions[..., 1].min(axis=1), 5)
    people, shadows = [], []
    for (person, shadow), foot in zip(stage_shapes(posed(stage, frames, middles), 1.0), feet, strict=True):
        people += [shape._replace(outline=shape.outline + foot) for shape in person]
        shadows.append(shadow + foot)
    if not stage.flat:
        ax.add_collection(PolyCollection(shadows, facecolors=COLOURS["faint"], edgecolors="none", zorder=0))
    ax.add_collection(person_polygons(stage, people))
