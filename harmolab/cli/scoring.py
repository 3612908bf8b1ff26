"""`harmolab score`: one motion against its music."""

from __future__ import annotations

import json
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.common import (
    Beats,
    Dance,
    DanceName,
    Fps,
    HowDanced,
    Joints,
    Offset,
    One,
    PatternFile,
    Scale,
    Seconds,
    Smpl,
    Song,
    Up,
    show,
)
from harmolab.cli.corpus_scores import is_corpus, score_corpus
from harmolab.cli.screen import is_verbose, plain_errors, wrote
from harmolab.cli.sources import Sources, check_signs, clip_of, note_lengths, sources

if TYPE_CHECKING:
    from harmolab.cli.common import How
    from harmolab.params import HarmonyParams
    from harmolab.types import BeatTrack, Clip
    from harmolab.verdict.score import HarmonyScore


# Names in the table, and of the fields behind them.
NUMBER_ROWS = {
    "harmony above chance": "harmony_above_chance", "its spread from bar to bar": "interval", "p value": "p_value",
}  # fmt: skip
JUDGEMENT_ROWS = {
    "level, 0 to 4": "level", "p in time": "p_time", "p in place": "p_place", "lag, s": "lag_s",
    "tempo of the music, bpm": "tempo", "own tempo, bpm": "own_tempo", "pulse, 1/s": "pulse",
    "share inside the body": "share", "share of the joints": "joints",
}  # fmt: skip
PAPER_ROWS = {"harmony": "harmony", "hit rate": "hit_rate"}
COUNT_ROWS = {"chance": "chance", "n audio": "n_audio", "n visual": "n_visual"}


class Mode(StrEnum):
    """Which settings to score with."""

    paper = "paper"
    recommended = "recommended"
    room = "room"
    both = "both"


def score(
    context: typer.Context,
    song: Song,
    motion: Dance = None,
    offset: Offset = None,
    seconds: Seconds = None,
    mode: Annotated[
        Mode, typer.Option(help="The paper's settings, ours, or both; room: what we advised before, for comparison.")
    ] = Mode.both,
    fps: Fps = None,
    scale: Scale = None,
    dance: DanceName = "",
    beats: Beats = None,
    one: One = None,
    pattern: PatternFile = None,
    how: HowDanced = None,
    joints: Joints = "",
    smpl: Smpl = None,
    up: Up = None,
    lag: Annotated[float, typer.Option(help="Seconds by which this dancer is expected after the beat.")] = 0.0,
    clock: Annotated[
        float, typer.Option(help="Time stretch of the motion; 1.013 fits most Tang 2018 data.", min=0.1, max=10.0)
    ] = 1.0,
    as_json: common.AsJson = False,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Write a table, .csv, of a folder of recordings, a row each.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Save a picture of beats, hits and misses as PNG.")] = None,
    others: Annotated[
        bool, typer.Option("--others", help="Print the field's other measures too: beat alignment, mir_eval.")
    ] = False,
    _start: Annotated[str | None, common.renamed("--start", "--offset")] = None,
    _duration: Annotated[str | None, common.renamed("--duration", "--seconds")] = None,
) -> None:
    """Score a motion against its music.

    First the verdict in words: is it in time, and on the beat. Below it how sure that is, how steady, and what would
    help. Sixteen beats are needed. All numbers, those of the paper too, come with --verbose and --json: `harmony above
    chance` is 0 for a random phase, 1 where every beat is the best moment of the take, -1 the worst; its p value is the
    larger of two: in time (against other tempi) and in place (against other lags). The paper's `harmony` and `hit rate`
    mean little without `chance`: at T_delay = 0.25 s most of the time lies near a beat anyway.

    With --dance the place is that of its dancers, with --how what you say. With nothing told you are on the beat where
    you rest on it or dance a waltz; a hit, or an arrival, is said as it is seen, and not called late.

    Examples:

    `harmolab score song.mp3 dance.bvh --offset 12.4 --dance waltz --plot score.png`

    `harmolab score recordings/DANCE_W_3` reads song, motion, dance and annotated beats from one folder.

    `harmolab score recordings --csv table.csv` scores all recordings in a folder.

    `harmolab score phone_video.mp4` scores a video with its music in it.
    """
    from harmolab.beats.meter import describe_beats
    from harmolab.harmony import other_measures

    reading = common.reading(fps, scale, smpl, up, joints)

    def scored(files: Sources) -> Scored:
        modes = settings(mode, pattern, dance or files.dance, how, lag, clock)
        clip = clip_of(files, offset=offset, seconds=seconds, one=one, **reading)
        note_lengths(clip, files.song)
        result = scored_clip(clip, modes, clock)
        check_signs(files, clip, result.scores.values())
        return result

    with plain_errors():
        if motion is None and is_corpus(song):
            score_corpus(context, song, lambda files: scored(files).scores, table=csv, as_json=as_json)
            return
        if csv is not None:
            raise ValueError(f"{song}: --csv is for a folder of recordings; --json has all numbers of one")
        if plot:
            common.check_place(plot)
        files = sources(context, song, motion, beats=beats, one=one, dance=dance)
        clip, music, scores = scored(files)
        measures = other_measures(clip, clock=clock) if others else {}
        if plot:
            from harmolab.lab.figures.beats import score_figure
            from harmolab.lab.figures.style import write_figure

            write_figure(score_figure(scores, title=clip.name), plot)
    if as_json:
        about = {"audio": str(files.song), "motion": str(files.motion), "offset": clip.offset, "version": __version__}
        about |= {"beats": str(files.beats or "tracked"), "dance": files.dance, "music": describe_beats(music)}
        content = {"clip": about, **{name: result.to_dict() for name, result in scores.items()}}
        typer.echo(json.dumps(content | ({"others": measures} if others else {}), indent=2))
        return
    judgement = next((score.judgement for score in scores.values() if score.judgement), None)
    common.print_verdict(judgement)
    common.print_music(music)
    if judgement is None or measures or is_verbose():
        print_scores(scores, measures)
    if plot:
        wrote(plot)


class Scored(NamedTuple):
    """A clip, its music's beats on the motion's time line, and mode -> score."""

    clip: Clip
    music: BeatTrack
    scores: dict[str, HarmonyScore]


def scored_clip(clip: Clip, modes: dict[str, HarmonyParams], clock: float) -> Scored:
    """The scores of a clip with the settings of each mode."""
    from harmolab.harmony import music_and_motion, score_motion

    music, movement = music_and_motion(clip, clock=clock)
    return Scored(clip, music, {name: score_motion(music, movement, params=params) for name, params in modes.items()})


def settings(
    mode: Mode, pattern: Path | None, dance: str, how: How | None, lag: float, clock: float
) -> dict[str, HarmonyParams]:
    """The parameters of each mode."""
    from dataclasses import replace

    from harmolab.params import HarmonyParams

    recommended = common.recommended(pattern, dance, how)
    # The patterns that are shipped are of shape speed.
    room = HarmonyParams.room_speed(recommended.pattern if pattern else None)
    params = {"paper": HarmonyParams.paper(), "recommended": recommended, "room": room}
    names = ("paper", "recommended") if mode is Mode.both else (mode.value,)
    return {name: replace(params[name], lag=lag, clock=clock) for name in names}


def print_scores(scores: dict[str, HarmonyScore], measures: dict[str, float]) -> None:
    """A table with a row a number and a column a mode, and the other measures, if any."""
    from rich.console import Console
    from rich.table import Table

    table = Table("", *scores, title="harmony of motion and music")
    for cells in zip(*map(score_rows, scores.values()), strict=True):
        texts = [text for _, text in cells]
        if any(texts):
            table.add_row(cells[0][0], *texts)
    Console().print(table)
    if measures:
        table = Table("", "", title="other measures of the field", show_header=False)
        for name, value in measures.items():
            table.add_row(name, show(value))
        Console().print(table)


def score_rows(score: HarmonyScore) -> Iterator[tuple[str, str]]:
    """Name and text of each number of a score: "-" where it does not exist, "" where it is no number of this mode."""
    from harmolab.verdict.time_test import FEWEST_BEATS

    values, above_chance = score.to_dict(), score.above_chance
    has_number = values["n_audio"] >= FEWEST_BEATS and above_chance == above_chance
    for name, key in NUMBER_ROWS.items():
        yield name, show(values[key] if has_number else None)
    is_judged = "level" in values
    for name, key in JUDGEMENT_ROWS.items():
        is_silent = key == "lag_s" and values.get("level", 0) < 3
        yield name, show(None if is_silent else values[key]) if is_judged else ""
    for name, key in PAPER_ROWS.items():
        yield name, "" if is_judged else show(values[key])
    for name, key in COUNT_ROWS.items():
        yield name, show(values[key])
