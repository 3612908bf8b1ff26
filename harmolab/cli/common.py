"""Shared by several commands: arguments and options, checks of outputs, numbers for tables."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Callable
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harmolab.cli.screen import detail, is_verbose, note, refuse

if TYPE_CHECKING:
    from harmolab.corpora.folders import Problem
    from harmolab.io.files import PathLike
    from harmolab.io.motion_file import MotionFile
    from harmolab.lab.listening.local_page import LocalPage
    from harmolab.params import HarmonyParams
    from harmolab.types import BeatTrack
    from harmolab.verdict.judge import Judgement

PAGES = (".html", ".htm")
VIDEOS_OUT = (".mp4", ".webm")
SOUNDS = (".wav", ".flac", ".ogg", ".mp3")
MOTIONS = (".npz", ".npy", ".bvh", ".pkl", ".json", ".c3d")


def _not(suffixes: tuple[str, ...], path: Path | None) -> Path | None:
    """The path of a song or a dance; an end of the command where its name is that of the other."""
    if path is not None and path.suffix.lower() in suffixes:
        refuse(f"{path}: the order is SONG DANCE, the music first and then the movement")
    return path


def renamed(old: str, new: str) -> Any:
    """A hidden option that ends the command with the name the option has now."""

    def hint(value: str | None) -> None:
        if value is not None:
            refuse(f"{old} is called {new} now")

    return typer.Option(old, hidden=True, callback=hint)


Song = Annotated[
    Path,
    typer.Argument(
        metavar="SONG",
        callback=lambda path: _not(MOTIONS, path),
        help="The music: wav, flac, ogg or mp3, or a video with sound.",
    ),
]
_DANCE: Any = typer.Argument(
    metavar="DANCE",
    callback=lambda path: _not(SOUNDS, path),
    help="The motion: npz, npy, bvh, c3d, SMPL parameters (AMASS, AIST++, EDGE, FACT, LODGE), key points, a Tang 2018 "
    "folder, or a video. Left out where SONG is the folder of a recording, or a video with its music.",
    show_default=False,
)
Dance = Annotated[Path | None, _DANCE]
Offset = Annotated[
    float | None,
    typer.Option(
        help="Audio time in seconds at which the motion begins (default: what its file or folder says, else 0)."
    ),
]
Start = Annotated[float | None, typer.Option(help="Audio time in seconds to begin at (default: with the motion).")]
Seconds = Annotated[float | None, typer.Option(help="Only so many seconds from there.")]


def dance_names(incomplete: str) -> list[str]:
    """The dances that begin so, for the shell to complete."""
    from harmolab.params import DANCES

    return [name for name in DANCES if name.startswith(incomplete)]


def completed(*names: str) -> Callable[[str], list[str]]:
    """A function that completes names in the shell."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


DanceName = Annotated[
    str,
    typer.Option(
        "--dance",
        autocompletion=dance_names,
        help="Dance of the music (waltz, ...): what its dancers do in the bar, and its usual tempo.",
    ),
]
Beats = Annotated[
    Path | None, typer.Option(help="Beat annotation (.beats, csv, beats.json) in place of beat tracking.")
]
One = Annotated[
    float | None,
    typer.Option(
        "--one",
        metavar="SECONDS",
        help="Audio time of a beat on which a bar begins, any one of them: play the song, count, and note the time on "
        "a clear ONE. The sound does not tell it: the strongest beat of a bar is as often another. Needs --dance for "
        "the beats in a bar. `harmolab tap` finds it by ear.",
    ),
]
Fps = Annotated[float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, key points).")]
Scale = Annotated[
    float | None, typer.Option(help="Metres in one unit of a 3-D file: 0.001 for millimetres, 0.056444 for CMU's BVH.")
]
Joints = Annotated[
    str, typer.Option(help="Keep these joints only, as in: left_wrist,right_wrist (a camera that sees no legs).")
]
Smpl = Annotated[
    Path | None, typer.Option(help="Your own SMPL body, npz, for SMPL parameters (default: a neutral skeleton).")
]


class How(StrEnum):
    """Movements on the beat, by their names in `harmolab.params.HOW_PATTERNS`."""

    rest = "rest"
    hit = "hit"
    half = "half time"


HowDanced = Annotated[
    How | None,
    typer.Option(
        "--how",
        help="What you mean to do on the beat: rest on it, hit it (be fastest), or rest on every second one. Left out, "
        "a rest or a waltz counts as on the beat, and anything else is said as it is seen.",
        show_default=False,
    ),
]


class Axis(StrEnum):
    """Axis of a motion file that points up."""

    y = "y"
    z = "z"


Up = Annotated[Axis | None, typer.Option(help="Axis of a 3-D file that points up (default: as its kind or body says).")]
PatternFile = Annotated[Path | None, typer.Option("--pattern", help="Bar patterns learnt by `harmolab learn`.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Jobs = Annotated[
    int | None,
    typer.Option(help="Processes; 0 measures in this one (default: one a core; 0 without the extra `cluster`).", min=0),
]
Scheduler = Annotated[str, typer.Option(help="Address of a Dask scheduler.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with what was measured before.")]
Force = Annotated[
    bool, typer.Option("--force", help="Write into a folder that holds other files; begin anew what was cut off.")
]


def processes(jobs: int | None) -> int:
    """The number of processes of `Jobs`."""
    if jobs is None:
        jobs = (os.cpu_count() or 1) if find_spec("distributed") and find_spec("pyarrow") else 0
    return jobs


def reading(
    fps: float | None, scale: float | None, smpl: Path | None, up: str | None, joints: str | None = None
) -> dict[str, Any]:
    """The options that say how a motion file is read, as readers take them; `joints` where a command has names."""
    options = {"fps": fps, "scale": scale, "smpl": smpl, "up": up or ""}
    return options if joints is None else options | {"joints": names_in(joints) or None}


def recommended(pattern: Path | None, dance: str, how: How | None = None) -> HarmonyParams:
    """The recommended settings, with what was told: a file's pattern, how it is danced, or the dance, if it is known.

    Raises
    ------
    ValueError
        `how` is told beside a pattern.
    """
    from harmolab.bar_pattern import load_pattern
    from harmolab.params import DANCE_PATTERNS, DANCES, HOW_PATTERNS, HarmonyParams

    if how is not None:
        if pattern is not None:
            raise ValueError("--how and --pattern exclude each other: each says what to expect on the beat")
        return HarmonyParams.recommended(HOW_PATTERNS[how.value])
    if pattern is not None:
        return HarmonyParams.recommended(load_pattern(pattern, dance))
    if dance in DANCES and dance not in DANCE_PATTERNS:
        note(f"{dance}: no usual course of its movement is known, so it is judged as a dance that is not named")
    return HarmonyParams.recommended(DANCE_PATTERNS.get(dance))


def print_verdict(judgement: Judgement | None, name: str = "") -> None:
    """The verdict in words and its remarks, a line each, or all in one after a name; nothing without a judgement.

    With --verbose its details too.
    """
    if judgement is not None:
        lines = [judgement.verdict, *judgement.remarks, *(judgement.details if is_verbose() else ())]
        typer.echo(f"{name}: {' '.join(lines)}" if name else "\n".join(lines))


def print_music(beats: BeatTrack) -> None:
    """With --verbose a line about the beats that a dance was judged by: tempo, steadiness, "one"."""
    from harmolab.beats.meter import describe_beats

    if is_verbose():
        typer.echo(f"music: {describe_beats(beats)}")


def note_assumptions(path: PathLike, file: MotionFile) -> None:
    """A line on what was guessed or assumed when a motion file was read; with --verbose on all of it."""
    frames, joints, _ = file.motion.positions.shape
    detail(f"{Path(path).name}: {file.kind}, {frames} frames of {joints} joints at {file.motion.fps:g} a second")
    for sentence in file.notes:
        detail(f"{Path(path).name}: read: {sentence}")
    if file.assumptions:
        note(f"{Path(path).name}: read as {'; '.join(file.assumptions)}")


def names_in(text: str) -> tuple[str, ...]:
    """The names in a list with commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def left_out(problem: Problem) -> None:
    """A line about a recording that cannot be read."""
    note(f"left out: {problem.message}")


def check_out(out: Path, what: str, suffixes: tuple[str, ...]) -> None:
    """ValueError unless `out` ends in one of the suffixes and can be written; to be asked before any work."""
    if out.suffix.lower() not in suffixes:
        raise ValueError(f"{out}: {what} is written as {', '.join(suffixes)}; choose a name that ends so")
    check_place(out)
    if out.suffix.lower() in PAGES:
        check_pages(str(out))


def check_pages(name: str) -> None:
    """ValueError that begins with `name` unless the library that fills pages is installed."""
    if find_spec("jinja2") is None:
        raise ValueError(f"{name}: pages need jinja2; install it with: pip install jinja2")


def check_place(out: Path) -> None:
    """ValueError unless the folder of a file to be written is there, and no folder has its name."""
    if not out.resolve().parent.is_dir():
        raise ValueError(f"{out.parent}: no such folder")
    if out.is_dir():
        raise ValueError(f"{out}: is a folder; name a file in it")


def serve(page: LocalPage, no_open: bool, comfort: str) -> None:
    """A local page served until it is finished, or Ctrl-C, of which `comfort` says what it does no harm to."""
    with page.running() as address:
        typer.echo(f"open {address}\nCtrl-C stops; {comfort}")
        if not no_open:
            webbrowser.open(address)
        try:
            while not page.finished.wait(0.5):
                pass
        except KeyboardInterrupt:
            typer.echo("")


def show(value: Any) -> str:
    """A number or an interval for a table; "-" for what does not exist."""
    if isinstance(value, tuple | list):
        return " to ".join(map(show, value))
    if value is None or value != value:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def write_text(path: Path, text: str) -> None:
    """Write a line or more of text, whole or not at all."""
    from harmolab.io import files

    files.write_text(path, text + "\n")
