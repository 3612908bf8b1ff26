"""`harmolab score`: one motion against its music."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.common import Beats, Dance, DanceName, Fps, Offset, PatternFile, Scale, Seconds, Song, show

if TYPE_CHECKING:
    from harmolab.params import HarmonyParams
    from harmolab.types import HarmonyScore

ROWS = ("harmony_above_chance", "interval", "p_value", "harmony", "hit_rate", "chance", "n_audio", "n_visual")


class Mode(StrEnum):
    """Which settings to score with."""

    paper = "paper"
    recommended = "recommended"
    both = "both"


def score(
    song: Song,
    motion: Dance,
    offset: Offset = None,
    seconds: Seconds = None,
    mode: Annotated[Mode, typer.Option(help="The paper's settings, ours, or both.")] = Mode.both,
    fps: Fps = None,
    scale: Scale = None,
    dance: DanceName = "",
    beats: Beats = None,
    pattern: PatternFile = None,
    lag: Annotated[float, typer.Option(help="Seconds by which this dancer is expected after the beat.")] = 0.0,
    clock: Annotated[float, typer.Option(help="Time stretch of the motion; 1.013 fits most Tang 2018 data.")] = 1.0,
    as_json: common.AsJson = False,
    plot: Annotated[Path | None, typer.Option(help="Save a picture of beats, hits and misses as PNG.")] = None,
    others: Annotated[
        bool, typer.Option("--others", help="Print the field's other measures too: beat alignment, mir_eval.")
    ] = False,
    _start: Annotated[str | None, common.renamed("--start", "--offset")] = None,
    _duration: Annotated[str | None, common.renamed("--duration", "--seconds")] = None,
) -> None:
    """Score a motion against its music.

    `harmony_above_chance` is the number to read: 0 is what a random moment reaches, 1 is every beat met. Look at its
    `p_value` (share of rotations in time that score as high) and `interval` before you believe it. The paper's
    `harmony` and `hit_rate` mean little without `chance`: at T_delay = 0.25 s most of the time lies near a beat anyway.

    Example: `harmolab score song.mp3 dance.bvh --offset 12.4 --dance waltz --plot score.png`
    """
    from harmolab.corpora.files import load_clip
    from harmolab.harmony import music_and_motion, other_measures, score_motion

    with common.plain_errors():
        if plot:
            common.check_place(plot)
        modes = settings(mode, pattern, dance, lag, clock)
        with common.finding_beats():
            clip = load_clip(
                song, motion, offset=offset, seconds=seconds, dance=dance, beats=beats, fps=fps, scale=scale
            )
        music, movement = music_and_motion(clip, clock=clock)
        scores = {name: score_motion(music, movement, params=params) for name, params in modes.items()}
        measures = other_measures(clip, clock=clock) if others else {}
        if plot:
            from harmolab.lab.figures.beats import score_figure
            from harmolab.lab.figures.style import write_figure

            write_figure(score_figure(scores, title=clip.name), plot)
    if as_json:
        about = {"audio": str(song), "motion": str(motion), "offset": clip.offset, "version": __version__}
        content = {"clip": about, **{name: result.to_dict() for name, result in scores.items()}}
        typer.echo(json.dumps(content | ({"others": measures} if others else {}), indent=2))
    else:
        print_scores(scores, measures)


def settings(mode: Mode, pattern: Path | None, dance: str, lag: float, clock: float) -> dict[str, HarmonyParams]:
    """The parameters of each mode."""
    from dataclasses import replace

    from harmolab.bar_pattern import load_pattern
    from harmolab.params import HarmonyParams

    learnt = load_pattern(pattern, dance) if pattern else None
    both = {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(learnt)}
    names = both if mode is Mode.both else (mode.value,)
    return {name: replace(both[name], lag=lag, clock=clock) for name in names}


def print_scores(scores: dict[str, HarmonyScore], measures: dict[str, float]) -> None:
    """A table: one row a number, one column a mode; below them the other measures, if any."""
    from rich.console import Console
    from rich.table import Table

    table = Table("", *scores, title="harmony of motion and music")
    columns = [score.to_dict() for score in scores.values()]
    for name in ROWS:
        table.add_row(name.replace("_", " "), *(show(column[name]) for column in columns))
    table.add_section()
    for name, value in measures.items():
        table.add_row(name, show(value), *([""] * (len(scores) - 1)))
    Console().print(table)
