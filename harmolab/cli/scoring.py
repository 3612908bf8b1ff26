"""`harmolab score`: one motion against its music."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab import __version__
from harmolab.cli.common import plain_errors, show, track_beats

if TYPE_CHECKING:
    from harmolab.params import BarPattern, HarmonyParams
    from harmolab.types import Clip, HarmonyScore

__all__ = ["Mode", "score"]


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
) -> None:
    """Score a motion against its music.

    `harmony_above_chance` is the number to read: 0 is what a random moment reaches, 1 is every beat met. Look at its
    `p_value` (share of rotations in time that score as high) and `interval` before you believe it. The paper's
    `harmony` and `hit_rate` mean little without `chance`: at T_delay = 0.25 s most of the time lies near a beat anyway.

    Example: `harmolab score song.mp3 dance.bvh --start 12.4 --dance waltz --plot score.png`
    """
    with plain_errors():
        clip = read_clip(audio, motion, start, duration, fps, beats)
        chosen = settings(mode, pattern, dance, lag, clock)
        results = {name: score_one(clip, params, dance) for name, params in chosen.items()}
        if plot:
            save_plot(plot, clip, chosen, results, dance)
    if as_json:
        about = {"audio": str(audio), "motion": str(motion), "start": clip.offset, "version": __version__}
        typer.echo(
            json.dumps({"clip": about, **{name: result.to_dict() for name, result in results.items()}}, indent=2)
        )
    else:
        print_scores(results)


def read_clip(
    audio: Path, motion: Path, start: float | None, duration: float | None, fps: float | None, beats: Path | None
) -> Clip:
    """The clip that the arguments of `score` describe."""
    from harmolab.data.folders import load_any_motion, told_start
    from harmolab.io.beats import load_annotation
    from harmolab.io.video_sound import load_sound
    from harmolab.types import Clip

    sound, moves = load_sound(audio), load_any_motion(motion, fps=fps)
    start = told_start(motion) if start is None else start
    if duration is not None:
        moves = moves.span(0.0, duration)
    track = None
    if beats is not None:
        track = load_annotation(beats).track(sound.duration)
    try:
        return Clip(motion.stem or motion.name, sound, moves, start or 0.0, beats=track)
    except ValueError as error:
        raise ValueError(f"{audio} and {motion}: {error}") from None


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


def score_one(clip: Clip, params: HarmonyParams, dance: str) -> HarmonyScore:
    """One score, of the beats that are annotated or else tracked."""
    from functools import partial

    from harmolab.harmony import score_clip

    return score_clip(clip, params, tracker=partial(track_beats, dance=dance))


def print_scores(results: dict[str, HarmonyScore]) -> None:
    """A table: one row a number, one column a mode."""
    from rich.console import Console
    from rich.table import Table

    table = Table("", *results, title="harmony of motion and music")
    names = ("harmony_above_chance", "interval", "p_value", "harmony", "hit_rate", "chance", "n_audio", "n_visual")
    for name in names:
        table.add_row(name.replace("_", " "), *(show(getattr(result, name)) for result in results.values()))
    table.add_section()
    first = next(iter(results.values()))
    for name, value in first.others.items():
        table.add_row(name, show(value), *([""] * (len(results) - 1)))
    Console().print(table)


def save_plot(
    path: Path, clip: Clip, chosen: dict[str, HarmonyParams], results: dict[str, HarmonyScore], dance: str
) -> None:
    """One row a mode: beats, tolerance fields, hits and misses."""
    from harmolab.beats.audio import audio_beats
    from harmolab.harmony import overlap
    from harmolab.viz.scores import score_figure
    from harmolab.viz.style import write_figure

    track = clip.beats if clip.beats is not None else audio_beats(clip.audio, tempo=dance or None)
    clock = next(iter(chosen.values())).clock
    write_figure(score_figure(*overlap(clip, track, clock=clock), chosen, results, title=clip.name), path)
