"""Shared by several commands: arguments and options, checks of options and outputs, numbers for tables, titles."""

from __future__ import annotations

import math
import os
import re
import shlex
import webbrowser
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cache, wraps
from inspect import Parameter, Signature, cleandoc, signature
from pathlib import Path
from tempfile import gettempprefix
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperCommand

import harmolab
from harmolab import files
from harmolab.cli import screen

if TYPE_CHECKING:
    from rich.table import Column

    from harmolab.data.recordings import Problem
    from harmolab.files import PathLike
    from harmolab.lab.listening.local_page import LocalPage
    from harmolab.readers.motion_file import MotionFile
    from harmolab.verdict.judge import Judgement

PAGES = (".html", ".htm")
OF_LAB = 60.0  # seconds of a dance unless asked for more: the picture of a minute can still be read
VIDEOS_OUT = (".mp4", ".webm")
HEIGHT = 480  # of a video, pixels, unless asked for otherwise
MOTIONS = (".npz", ".npy", ".bvh", ".pkl", ".json", ".c3d")


def _not(suffixes: tuple[str, ...], path: Path | None) -> Path | None:
    """The path of a song or a dance; an end of the command where its name is that of the other."""
    if path is not None and path.suffix.lower() in suffixes:
        screen.refuse(f"{path}: the order is SONG DANCE, the music first and then the movement")
    return path


def renamed(old: str, new: str) -> Any:
    """A hidden option that ends the command with the name the option has now."""

    def hint(value: str | None) -> None:
        if value is not None:
            screen.refuse(f"{old} is called {new} now")

    return typer.Option(old, hidden=True, callback=hint)


Song = Annotated[
    Path,
    typer.Argument(
        metavar="SONG",
        callback=lambda path: _not(MOTIONS, path),
        help="The music: wav, flac, ogg, mp3 or m4a, or a video with sound.",
    ),
]
_DANCE: Any = typer.Argument(
    metavar="DANCE",
    callback=lambda path: _not(files.SOUNDS, path),
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
Seconds = Annotated[float | None, typer.Option(help="Take only so many seconds, from where it begins.")]


def dance_names(incomplete: str) -> list[str]:
    """The dances that begin so, for the shell to complete."""
    return [name for name in harmolab.DANCES if name.startswith(incomplete)]


def completed(*names: str) -> Callable[[str], list[str]]:
    """A function that completes names in the shell."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


DanceName = Annotated[
    str,
    typer.Option(
        "--dance",
        autocompletion=dance_names,
        help="Dance of the music (waltz, ...). It tells what dancers do in the bar, and the usual tempo.",
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
        help="Audio time of a beat on which a bar begins, any one of them: play the song, count, and note the time of "
        "a clear ONE. The sound does not tell it: the strongest beat of a bar is as often another one. Needs --dance, "
        "which tells the beats in a bar. With `harmolab beats --tap` you tell it by ear.",
    ),
]
Fps = Annotated[float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, key points).")]
Scale = Annotated[
    float | None, typer.Option(help="Metres in one unit of a 3-D file: 0.001 for millimetres, 0.056444 for CMU's BVH.")
]
Smpl = Annotated[
    Path | None, typer.Option(help="Your own SMPL body, npz, for SMPL parameters (default: a neutral skeleton).")
]


How = Literal["rest", "hit", "half time"]  # names in `harmolab.params.HOW_PATTERNS`
Up = Annotated[
    Literal["y", "z"] | None,
    typer.Option(help="Axis of a 3-D file that points up (default: as its kind or body says)."),
]
PatternFile = Annotated[Path | None, typer.Option("--pattern", help="Bar patterns learnt by `harmolab data learn`.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Jobs = Annotated[
    int | None,
    typer.Option(help="Processes; 0: this one alone (default: one a core; 0 for few dances or without Dask).", min=0),
]
Scheduler = Annotated[str, typer.Option(help="Address of a Dask scheduler.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with what was measured before.")]
Force = Annotated[
    bool, typer.Option("--force", help="Write into a folder that holds other files; begin anew what was cut off.")
]


@dataclass(frozen=True)
class PartOptions:
    """Options on where the motion lies in the music, and on the part of both that is shown.

    Parameters
    ----------
    start : Audio time in seconds at which to begin (default: where the motion begins).
    """

    offset: Offset = None
    start: float | None = None
    seconds: Seconds = None


@dataclass(frozen=True)
class FileOptions:
    """Options that say how a motion file is read.

    Parameters
    ----------
    joints : Keep only these joints, such as neck,left_wrist where the camera sees no legs.
    """

    fps: Fps = None
    scale: Scale = None
    joints: str = ""
    smpl: Smpl = None
    up: Up = None

    @property
    def keywords(self) -> dict[str, Any]:
        """The options as readers take them."""
        return vars(self) | {"joints": names_in(self.joints) or None, "up": self.up or ""}


@dataclass(frozen=True)
class JudgeOptions:
    """Options on the music's beats, and on what to expect of a dance to them.

    Parameters
    ----------
    how : What you mean to do on the beat: rest on it, hit it (be fastest), or rest on every second one (1 and
        3 where "one" is known). It takes the place of what is usual in a --dance. With neither, a rest or a waltz
        counts as on the beat; of anything else you read when you are fastest and stillest.
    """

    dance: DanceName = ""
    beats: Beats = None
    one: One = None
    pattern: PatternFile = None
    how: Annotated[How | None, typer.Option(show_default=False)] = None

    def params(self, dance: str) -> harmolab.HarmonyParams:
        """The `recommended` settings; `dance` is that of the files."""
        return recommended(self.pattern, dance, self.how)


UNUSUAL = "{}: how it is usually danced is not known, so it is judged as if no dance was named"
SECTION = "\n\nParameters\n----------\n"  # of a docstring; behind it stand lines "name : help"


def described(docstring: str | None) -> tuple[str, dict[str, str]]:
    """The words on a command in its docstring, and parameter -> help, of the section on its parameters.

    >>> described("Do it.\\n\\nParameters\\n----------\\nout : The file\\n    to write.\\nseed : Luck.")
    ('Do it.', {'out': 'The file to write.', 'seed': 'Luck.'})
    """
    words, _, section = cleandoc(docstring or "").partition(SECTION)
    parts = re.split(r"^(\w+) : ", section, flags=re.MULTILINE)
    return words, {name: " ".join(text.split()) for name, text in zip(parts[1::2], parts[2::2], strict=True)}


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with one option for each field of the records of options that it takes."""
    parameters = signature(command, eval_str=True).parameters.values()
    records: dict[str, Any] = {one.name: one.annotation for one in parameters if is_dataclass(one.annotation)}
    fields = {name: signature(record, eval_str=True).parameters for name, record in records.items()}

    @wraps(command)
    def called(**values: Any) -> None:
        for name, record in records.items():
            values[name] = record(**{one: values.pop(one) for one in fields[name]})
        command(**values)

    docstrings = [cleandoc(one.__doc__ or "").partition(SECTION) for one in (command, *records.values())]
    called.__doc__ = docstrings[0][0] + SECTION + "\n".join(section for _, _, section in docstrings)
    options: list[Parameter] = []
    for one in parameters:
        options += fields[one.name].values() if one.name in fields else [one]
    called.__signature__ = Signature([one.replace(kind=one.KEYWORD_ONLY) for one in options])  # type: ignore[attr-defined]
    return called


def recommended(pattern: Path | None, dance: str, how: str | None = None) -> harmolab.HarmonyParams:
    """The recommended settings, with what was told: a file's pattern, how it is danced, or the dance, if it is known.

    Raises
    ------
    ValueError
        `how` is told beside a pattern.
    """
    from harmolab.params import DANCE_PATTERNS, DANCES, HOW_PATTERNS
    from harmolab.verdict.bar_pattern import load_pattern

    if how:
        if pattern is not None:
            raise ValueError("--how and --pattern exclude each other: each says what to expect on the beat")
        return harmolab.HarmonyParams.recommended(HOW_PATTERNS[how])
    if pattern is not None:
        return harmolab.HarmonyParams.recommended(load_pattern(pattern, dance))
    if dance in DANCES and dance not in DANCE_PATTERNS:
        screen.note(UNUSUAL.format(dance))
    return harmolab.HarmonyParams.recommended(DANCE_PATTERNS.get(dance))


def print_verdict(judgement: Judgement | None, name: str = "") -> None:
    """The verdict in words and its remarks, a line each, or all in one after a name; nothing without a judgement.

    With --verbose its details too.
    """
    if judgement is not None:
        lines = [judgement.verdict, *judgement.remarks, *(judgement.details if screen.is_verbose() else ())]
        typer.echo(f"{name}: {' '.join(lines)}" if name else "\n".join(lines))


UNSURE = "no verdict, since it is laid on beats that a program found, which are unsure"  # of a movement made to fit


def print_music(beats: harmolab.BeatTrack) -> None:
    """With --verbose a line about the beats that a dance was judged by: tempo, steadiness, "one"."""
    if screen.is_verbose():
        typer.echo(f"music: {harmolab.describe_beats(beats)}")


def frames_text(motion: harmolab.Motion) -> str:
    """Frames, joints and rate of a motion in words."""
    frames, joints, _ = motion.positions.shape
    return f"{frames} frames of {joints} joints at {motion.fps:g} a second"


HIDDEN = (
    "{} of {} frames do not count: most of the body is hidden, or they are filler. Keep the joints that are mostly "
    "seen (--joints, a part of {})"
)
JUMPS = (
    "joints jump, {}, as where left and right are swapped or another person is followed. This counts as movement, "
    "so a verdict may be wrong"
)


def note_assumptions(path: PathLike, file: MotionFile) -> None:
    """A line on what was guessed or assumed when a motion file was read, with --verbose on all; others on faults."""
    from harmolab.readers.motion_file import Assumption

    screen.detail(f"{Path(path).name}: {file.kind}, {frames_text(file.motion)}")
    for sentence in file.notes:
        screen.detail(f"{Path(path).name}: read: {sentence}")
    if assumptions := [note for note in file.notes if isinstance(note, Assumption)]:
        screen.note(f"{Path(path).name}: read as {'; '.join(assumptions)}")
    for fault in faults_in(file.motion):
        screen.note(f"{Path(path).name}: {fault}")


def faults_in(motion: harmolab.Motion) -> Iterator[str]:
    """Words on frames that do not count, where they are many, and on joints that jump."""
    from harmolab.data.oddities import jumps_inside

    valid, joints = motion.valid, ",".join(motion.skeleton.joints)
    if 3 * (hidden := int((~valid).sum())) > len(valid):
        yield HIDDEN.format(hidden, len(valid), joints)
    for jumps in jumps_inside(motion):
        yield JUMPS.format(jumps)


def names_in(text: str) -> tuple[str, ...]:
    """The names in a list with commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def left_out(problem: Problem) -> None:
    """A line about a recording that cannot be read."""
    screen.note(f"left out: {problem.message}")


def check_out(out: Path | None, what: str, suffixes: tuple[str, ...]) -> None:
    """ValueError unless `out`, if any, ends in one of the suffixes and can be written; to be asked before any work."""
    if out is None:
        return
    if out.suffix.lower() not in suffixes:
        raise ValueError(f"{out}: {what} is written as {', '.join(suffixes)}; choose a name that ends so")
    check_place(out)


def check_place(out: Path) -> None:
    """ValueError unless the folder of a file to be written is there and may be written, and no folder has its name."""
    if not (folder := out.resolve().parent).is_dir():
        raise ValueError(f"{out.parent}: no such folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ValueError(f"{out}: nothing may be written into its folder; name a file in another one")
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


def say_begin(begin: float | None, *paths: Path, err: bool = False) -> None:
    """Say where in its song a dance begins, if one of its files does not keep that; of 0 for a BVH alone.

    A page and a video of a dance from the song's begin have their sound.
    """
    lost = {path.suffix.lower() for path in paths} - {".npz"}
    if begin is not None and (".bvh" in lost or (begin and lost)):
        typer.echo(f"the movement begins at {begin:g} s of the song: pass --offset {begin:g} with it", err=err)


def print_table(
    headings: Sequence[str | Column], rows: Iterable[Sequence[str]], title: str = "", *notes: str, **look: Any
) -> None:
    """Print a table, as wide as the terminal, and sentences below it; `look` are options of `rich.table.Table`.

    All that it shows may be names of files: brackets stay as they are, control codes are escaped.
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console, table = Console(), Table(*headings, title=escape(screen.printable(title)) or None, **look)
    for column in table.columns:
        column.header = escape(screen.printable(str(column.header)))
    for row in rows:
        table.add_row(*(escape(screen.printable(cell)) for cell in row))
    console.print(table)
    for sentence in notes:
        console.print(screen.printable(sentence), markup=False, highlight=False)


# Checks of options before a command runs: finite numbers, and files that stay as they are

# Parameters that name what a command writes; all others are read.
OUTPUTS = ("out", "why", "plot", "clicks", "csv", "save_reference")
WORDS = {"reference": "synthetic"}  # parameters that may be a word in place of a file
STEMS = ("weights",)  # parameters that may name two files by what their names begin with
FOLDERS = ("train",)  # commands whose output is a folder that they look into themselves
FORCE = "--force"


class CheckedCommand(TyperCommand):
    """A command that ends with one line for a number that is not finite, or for an output that is worth keeping.

    The help of its parameters stands in the docstring of its function. An output is worth keeping where it is an input
    or, without `FORCE`, a file that harmolab did not write.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        words, helps = described(keywords.get("help"))
        super().__init__(*arguments, **keywords | {"help": words})
        for one in self.params:
            one.help = helps.get(one.name, one.help)  # type: ignore[attr-defined]
        writes = any(one.name in OUTPUTS and one.param_type_name == "option" for one in self.params)
        is_forced = writes and self.name not in FOLDERS and not any(FORCE in one.opts for one in self.params)
        quiet, verbose, force = options_of(_all_take)
        self.params += [quiet, verbose, force] if is_forced else [quiet, verbose]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The remaining arguments; ends with one line for a value that an option does not take."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            if type(error) is not typer.BadParameter:  # an argument is missing: the usage says more
                raise
            screen.refuse(error.format_message().replace("Value error, ", ""))

    def invoke(self, ctx: Any) -> Any:
        """Result of the command; bad input ends it with one line."""
        with screen.said_level(ctx), screen.quiet_decoders(), screen.plain_errors():
            screen.detail(f"{ctx.command_path}: {_settings(ctx)}")
            check_numbers(ctx)
            for name in OUTPUTS:
                for out in _paths(ctx.params.get(name)):
                    check_output(ctx, out)
            check_inputs(ctx)
            return super().invoke(ctx)


class CommandWithParts(CheckedCommand):
    """A command whose first word may name one of its `parts` instead: "harmolab evaluate compare CORPUS"."""

    parts: Mapping[str, Callable[..., None]] = {}

    @classmethod
    def of(cls, **parts: Callable[..., None]) -> type[CommandWithParts]:
        """The class of a command that has these parts."""
        return type(cls.__name__, (cls,), {"parts": parts})

    @classmethod
    def part(cls, name: str) -> Any:
        """A part as a command."""
        app = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        app.command(name, cls=CheckedCommand)(cls.parts[name])
        return typer.main.get_command(app)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """The context of the command, or of the part that is named."""
        if args and args[0] in self.parts:
            return self.part(args[0]).make_context(f"{info_name} {args[0]}", args[1:], parent=parent, **extra)
        return super().make_context(info_name, args, parent=parent, **extra)


RENAMED = {
    "explain": "harmolab score SONG DANCE --why page.html",
    "render": "harmolab play SONG DANCE --out dance.mp4",
    "tap": "harmolab beats SONG --tap --out song.beats",
    "compare": "harmolab evaluate compare CORPUS",
    "pose": "harmolab data pose VIDEO",
    "convert": "harmolab data convert A B",
    "learn": "harmolab data learn CORPUS --out patterns.json",
    "study": "harmolab data study",
    "report": "make report",
}  # name that a command had -> what does its work now


def moved(context: typer.Context) -> None:
    """End the call of an old name with the command that does its work now."""
    screen.refuse(f"{context.info_name} is now: {RENAMED[context.info_name or '']}")


def _keep(context: typer.Context, value: bool) -> None:
    """Keeps the option with the call, since the function of a command does not get it."""
    context.meta[FORCE] = value


_Force = Annotated[
    bool, typer.Option(FORCE, help="Write over files that harmolab did not write.", callback=_keep, expose_value=False)
]


def _all_take(quiet: screen.Quiet = False, verbose: screen.Verbose = False, force: _Force = False) -> None:
    """A command that has these options alone, from which others take them."""


@cache
def options_of(function: Callable[..., None]) -> list[Any]:
    """The options of a command, the same objects each time: building them takes milliseconds, and all commands ask."""
    app = typer.Typer(add_completion=False)
    app.command()(function)
    return [one for one in typer.main.get_command(app).params if one.name != "help"]


def _settings(context: typer.Context) -> str:
    """Names and values of all parameters of a call, those that were told apart from the others."""
    texts = {name: f"{name} {value}" for name, value in context.params.items() if value not in (None, "", [], ())}
    explicit = ", ".join(text for name, text in texts.items() if is_told(context, name))
    usual = ", ".join(text for name, text in texts.items() if not is_told(context, name))
    return f"{explicit or 'no options'}; by default {usual or 'nothing'}"


def check_numbers(context: typer.Context) -> None:
    """ValueError for the first option that is NaN or infinite; it names the option."""
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{parameter.opts[0]} must be a finite number, got {value}")


def check_inputs(context: typer.Context) -> None:
    """FileNotFoundError for the first file or folder that is told and not there, before any slow import."""
    for name, value in context.params.items():
        if name in (*OUTPUTS, *STEMS) or not is_told(context, name):
            continue
        for path in _paths(value):
            is_word = str(path) == WORDS.get(name)
            if not (is_word or path.exists() or path.is_symlink()):
                raise FileNotFoundError(f"{path}: no such file{'' if path.suffix else ' or folder'}")


def check_output(context: typer.Context, out: Path) -> None:
    """ValueError where writing `out` would replace what the command reads or, without `FORCE`, a file of others."""
    read = [path for name, value in context.params.items() if name not in OUTPUTS for path in _paths(value)]
    files.check_output(out, read)
    is_there = out.exists() and not out.is_dir()  # a named pipe, too
    if context.meta.get(FORCE) is False and is_there and not files.is_own_file(out):
        raise ValueError(
            f"{out}: is there already, and harmolab did not write it; choose another name, or write over it: {FORCE}"
        )


def check_folder(context: typer.Context, folder: Path, names: Container[str]) -> None:
    """ValueError where a folder to be filled holds more than `names`; with `FORCE` it may."""
    held = sorted(path.name for path in folder.iterdir() if path.name not in names) if folder.is_dir() else []
    if held and not context.meta.get(FORCE):
        raise ValueError(f"{folder}: holds {held[0]}, which harmolab did not write; name an empty or a new folder")


def check_untold(context: typer.Context, names: Iterable[str], reason: str, *, when: bool = True) -> None:
    """ValueError, of option and reason, for the first of these options that stands on the command line."""
    spelling = {one.name: one.opts[0] for one in context.command.params}
    for name in names:
        if when and is_told(context, name):
            raise ValueError(f"{spelling[name]} {reason}")


def is_told(context: typer.Context, name: str) -> bool:
    """True where a parameter stands on the command line."""
    return getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"


def _paths(value: Any) -> list[Path]:
    """The paths that a parameter holds: one, several or none."""
    values = value if isinstance(value, list | tuple) else [value]
    return [path for path in values if isinstance(path, Path)]


# Titles of pages, and the line of the shell that writes a page's dance as a video

FOLDER_NAMES = ("audio", "skeletons")  # files of a corpus, which the name of their folder tells apart


def plain_name(path: Path) -> str:
    """The name of a file, or of its folder where all files of a kind are called the same; no temporary folder's.

    >>> [plain_name(Path(path)) for path in ("song.mp3", "corpus/DANCE_W_1/audio.mp3", "tmpx1/audio.wav")]
    ['song', 'DANCE_W_1', 'audio']
    """
    folder = path.resolve().parent.name
    is_named = path.stem in FOLDER_NAMES and not folder.startswith(gettempprefix())
    name = folder if is_named else path.stem
    return screen.printable(name or path.name)


def dance_title(motion: Path, song: Path) -> str:
    """The title of a page: the dance to the song, or one name for both."""
    return " to ".join(dict.fromkeys((plain_name(motion), plain_name(song))))


def of_lab(clip: harmolab.Clip) -> str:
    """Words for the title where a lab shows the first `OF_LAB` seconds of what music and motion share; else ""."""
    return ", first minute" if clip.audio.duration > OF_LAB else ""


def video_command(song: Path, motion: Path, out: Path, **options: object) -> str:
    """The line that writes the same as a video beside the page `out`; options that are None or "" are left out.

    >>> video_command(Path("a song.mp3"), Path("x.bvh"), Path("x.html"), offset=12.4, start=None, dance="waltz")
    "harmolab play 'a song.mp3' x.bvh --offset 12.4 --dance waltz --out x.mp4"
    """
    texts = {name: f"{value:.9g}" if isinstance(value, float) else str(value or "") for name, value in options.items()}
    words = [word for name, text in texts.items() if text for word in (f"--{name}", text)]
    return shlex.join(["harmolab", "play", str(song), str(motion), *words, "--out", str(out.with_suffix(".mp4"))])
