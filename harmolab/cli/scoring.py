"""`harmolab score`: one motion against its music."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab import __version__
from harmolab.cli.common import finding_beats, plain_errors, show

if TYPE_CHECKING:
    from harmolab.params import BarPattern, HarmonyParams
    from harmolab.types import Clip, HarmonyScore


class Mode(StrEnum):
    """Which settings to score with."""

    paper = "paper"
    recommended = "recommended"
    both = "both"


def score(
    audio: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3, or a video with sound.")],
    motion: Annotated[
        Path,
        typer.Argument(help="The motion: npz, npy, bvh, AIST++ pkl, keypoints, or a Tang 2018 folder."),
    ],
    start: Annotated[
        float | None,
        typer.Option(help="Audio time in seconds at which the motion begins (default: what its folder says, else 0)."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Score only so many seconds from there.")] = None,
    mode: Annotated[Mode, typer.Option(help="The paper's settings, ours, or both.")] = Mode.both,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, keypoints).")
    ] = None,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo, and the pattern to use.")] = "",
    beats: Annotated[
        Path | None, typer.Option(help="Beat annotation (.beats, csv, beats.json) in place of beat tracking.")
    ] = None,
    pattern: Annotated[Path | None, typer.Option(help="Bar patterns learnt by `harmolab learn`.")] = None,
    lag: Annotated[float, typer.Option(help="Seconds by which this dancer is expected after the beat.")] = 0.0,
    clock: Annotated[float, typer.Option(help="Time stretch of the motion; 1.013 fits most Tang 2018 data.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Save a picture of beats, hits and misses as PNG.")] = None,
    others: Annotated[
        bool, typer.Option("--others", help="Print the field's other measures too: beat alignment, mir_eval.")
    ] = False,
) -> None:
    """Score a motion against its music.

    `harmony_above_chance` is the number to read: 0 is what a random moment reaches, 1 is every beat met. Look at its
    `p_value` (share of rotations in time that score as high) and `interval` before you believe it. The paper's
    `harmony` and `hit_rate` mean little without `chance`: at T_delay = 0.25 s most of the time lies near a beat anyway.

    Example: `harmolab score song.mp3 dance.bvh --start 12.4 --dance waltz --plot score.png`
    """
    from harmolab.data.files import load_clip
    from harmolab.harmony import score_clip

    with plain_errors():
        modes = settings(mode, pattern, dance, lag, clock)
        with finding_beats():
            clip = load_clip(audio, motion, offset=start, seconds=duration, dance=dance, beats=beats, fps=fps)
        scores = {name: score_clip(clip, params) for name, params in modes.items()}
        measures = other_measures(clip, clock) if others else {}
        if plot:
            from harmolab.viz.scores import score_figure
            from harmolab.viz.style import write_figure

            write_figure(score_figure(scores, title=clip.name), plot)
    if as_json:
        about = {"audio": str(audio), "motion": str(motion), "start": clip.offset, "version": __version__}
        content = {"clip": about, **{name: result.to_dict() for name, result in scores.items()}}
        typer.echo(json.dumps(content | ({"others": measures} if others else {}), indent=2))
    else:
        print_scores(scores, measures)


def other_measures(clip: Clip, clock: float) -> dict[str, float]:
    """The field's other measures of a clip by name."""
    from dataclasses import replace

    from harmolab.beats.visual import visual_beats
    from harmolab.harmony import music_and_motion
    from harmolab.metrics.beats import kinematic_params, other_scores

    beats, motion = music_and_motion(clip, clock=clock)
    timed = replace(motion, fps=motion.fps / clock)
    return other_scores(beats, visual_beats(timed, params=kinematic_params()))


def settings(mode: Mode, pattern: Path | None, dance: str, lag: float, clock: float) -> dict[str, HarmonyParams]:
    """The parameters of each mode."""
    from dataclasses import replace

    from harmolab.params import HarmonyParams

    learnt = read_pattern(pattern, dance) if pattern else None
    both = {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(learnt)}
    wanted = [mode.value] if mode is not Mode.both else list(both)
    return {name: replace(both[name], lag=lag, clock=clock) for name in wanted}


def read_pattern(path: Path, dance: str) -> BarPattern:
    """The pattern of a dance out of a file written by `learn`; the only one when there is one only."""
    from harmolab.io.files import read_json, reading
    from harmolab.params import BarPattern

    with reading(path, "bar patterns written by `harmolab learn`"):
        patterns = read_json(path)
        if not isinstance(patterns, dict) or not patterns:
            raise ValueError("holds no bar patterns; write one with `harmolab learn`")
        name = dance if dance or len(patterns) > 1 else next(iter(patterns))
        if name not in patterns:
            raise ValueError(f"holds no pattern for --dance {name!r}; it has {', '.join(patterns)}")
        given = patterns[name]
        if not isinstance(given, dict) or set(given) != {"beats", "cosines", "sines", "source"}:
            raise ValueError(f"pattern {name!r} must have beats, cosines, sines and source")
        return BarPattern(int(given["beats"]), tuple(given["cosines"]), tuple(given["sines"]), str(given["source"]))


def print_scores(scores: dict[str, HarmonyScore], measures: dict[str, float]) -> None:
    """A table: one row a number, one column a mode; below them the other measures, if any."""
    from rich.console import Console
    from rich.table import Table

    table = Table("", *scores, title="harmony of motion and music")
    names = ("harmony_above_chance", "interval", "p_value", "harmony", "hit_rate", "chance", "n_audio", "n_visual")
    for name in names:
        table.add_row(name.replace("_", " "), *(show(getattr(score, name)) for score in scores.values()))
    table.add_section()
    for name, value in measures.items():
        table.add_row(name, show(value), *([""] * (len(scores) - 1)))
    Console().print(table)
