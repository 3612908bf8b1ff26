"""`harmolab data`: what files hold, a synthetic corpus, a motion file of another kind, the body in a video."""

import json
import os
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

import harmolab
from harmolab.cli import common
from harmolab.cli.common import AsJson, CheckedCommand, FileOptions, print_table, show, with_options
from harmolab.cli.screen import LEVEL, QUIET, detail, note, progress, say, waiting, wrote

data_app = typer.Typer(no_args_is_help=True, help="Check, convert and make files of movement; ask people about dances.")


@data_app.command("check", cls=CheckedCommand)
def data_check(path: Path, as_json: AsJson = False) -> None:
    """Say what a file or a corpus holds, and what is odd about it.

    The exit code is 1 where something cannot be read, or has a fault for which `harmolab evaluate` leaves it out:
    units other than metres, an axis other than y that points up, fewer than 10 frames a second, several joints of one
    name, or joints whose parents lead round in a circle.

    Example: `harmolab data check dance.bvh`

    Parameters
    ----------
    path : A file, the folder of a recording, or a corpus: a folder that holds recordings.
    """
    from rich.table import Column

    from harmolab.cli.data_check import check

    findings = check(path)
    is_faulty = any(finding.is_faulty for finding in findings)
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
        raise typer.Exit(int(is_faulty))
    headings = (Column("what", overflow="fold"), "kind", "frames", "rate", "joints", "seconds", "offset", "note")
    rows, notes = [], []
    for finding in findings:
        name = path.name if finding.path == str(path) else os.path.relpath(finding.path, path)
        numbers = (finding.frames, finding.rate, finding.joints, finding.seconds, finding.offset)
        rows.append((name, finding.kind, *map(show, numbers), finding.note))
        parts = (("read", finding.how), ("odd", finding.odd))
        notes += [f"{word}: {name}: {sentence}" for word, sentences in parts for sentence in sentences]
    print_table(headings, rows, str(path), *notes)
    raise typer.Exit(int(is_faulty))


@data_app.command("synth", cls=CheckedCommand)
def data_synth(
    out: Path,
    clips: Annotated[int, typer.Option(min=1)] = 200,
    seconds: float = 6.0,
    fps: float = 60.0,
    noise: float = 0.0,
    jitter: float = 0.0,
    lateness: float = 0.0,
    omission: float = 0.0,
    redundancy: float = 0.0,
    drift: float = 0.0,
    seed: int = 1,
) -> None:
    """Make synthetic music and dances whose beats are known, as ordinary files (wav, npz, beats.json).

    Where a run was cut off, the same command goes on.

    Example: `harmolab data synth demo --clips 14 --seconds 20`

    Parameters
    ----------
    out : New folder for the corpus.
    clips : Number of clips; the seven dances take turns.
    seconds : Length of a clip.
    fps : Frame rate of the motion.
    noise : Sensor noise on every joint and axis, metres.
    jitter : Standard deviation of the times at which movements end, seconds.
    lateness : How late every movement ends, seconds.
    omission : Share of beats on which no movement ends.
    redundancy : Share of beats after which one more movement ends.
    drift : Tempo change over the clip, as a share.
    seed : Same seed, same corpus.
    """
    harmolab.write_corpus(
        out, clips=clips, seconds=seconds, fps=fps, noise=noise, jitter=jitter, lateness=lateness,
        omission=omission, redundancy=redundancy, drift=drift, seed=seed,
        progress=progress,
    )  # fmt: skip
    typer.echo(f"{clips} clips in {out}")


# `harmolab data convert`: a motion file of any kind to one of ours, or to BVH


@with_options
def convert(
    motion: Annotated[Path, typer.Argument(metavar="A")],
    out: Annotated[Path, typer.Argument(metavar="B")],
    *,
    options: FileOptions,
    force: Annotated[bool, typer.Option("--force")] = False,
) -> None:
    """Turn a motion file of any kind into npz or BVH, in metres with y up, and say what it is and how it was read.

    Example: `harmolab data convert EDGE_dance.pkl dance.npz --fps 30`

    Parameters
    ----------
    motion : The motion: SMPL parameters (AMASS npz, AIST++ or EDGE pkl, FACT or LODGE npy), joints (npy, json, pkl,
        Bailando's jsons_original), HumanML3D npy, c3d, bvh, npz, key points of a pose estimator, or a Tang 2018 folder.
    out : The file to write, npz or bvh.
    force : Write over B where it is there already.
    """
    from harmolab.data.recordings import read_any_motion, recorded_offset

    common.check_out(out, "a motion", (".npz", ".bvh"))
    if out.exists() and not force:
        raise ValueError(f"{out}: is there already; --force writes over it")
    read = read_any_motion(motion, **options.keywords)
    about = f"converted from {motion.name}: {'; '.join((read.kind, *read.notes))}"
    begin = recorded_offset(motion)
    harmolab.save_motion(out, read.motion, offset=begin, about=about)
    say(f"{motion}: {read.kind}, {common.frames_text(read.motion)}", *(f"read: {sentence}" for sentence in read.notes))
    wrote(out)
    common.say_begin(begin, out)


# `harmolab data pose`: the body in a video as a motion file; may what finds it be fetched?

HOW = "`harmolab data pose --install` fetches what finds it, once"
DECLINED = "poses_declined"  # file in the cache, once a question has been answered with no


def pose(
    context: typer.Context,
    video: Annotated[Path | None, typer.Argument(metavar="VIDEO", show_default=False)] = None,
    out: Path | None = None,
    install: Annotated[bool, typer.Option("--install")] = False,
    yes: Annotated[bool, typer.Option("--yes")] = False,
) -> None:
    """Find the dancer's body in a video and write its movement, in metres with y up.

    MediaPipe finds the body. It is fetched once, after a question, into a folder of the cache; after that no network is
    needed. From then on `score`, `play` and `retime` find the body of a video by themselves. What was found is kept, so
    that they need not look twice. HARMOLAB_POSE=off turns all of this off.

    Of several people the one who moves most is taken. The points tell how the body moves in itself; its way over the
    floor is not known.

    Example: `harmolab data pose phone_video.mp4 --out dance.npz`

    Example: `harmolab data pose --install --yes`

    Parameters
    ----------
    video : The video: one dancer, all of the body.
    out : The motion to write, .npz or .bvh (default: the video's name, .npz, here).
    install : Fetch what finds bodies, if it is not there, into a folder that is printed; deleting it removes it.
    yes : Fetch without a question.
    """
    from harmolab.readers.pose import pose_environment

    common.check_untold(context, ("out",), "goes with a VIDEO only", when=video is None)
    if video is None and not (install or yes):
        raise ValueError("pose takes a VIDEO or --install")
    if video is not None:
        out = out or Path(f"{video.stem}.npz")
        _check_video(video, out)
    if pose_environment() is None:
        install_poses(is_agreed=yes)
    elif video is None:
        typer.echo(f"is there already: {pose_environment()}")
    if video is not None and out is not None:
        _write_pose(video, out)


def _check_video(video: Path, out: Path) -> None:
    """The errors that can be told before any work."""
    from harmolab.readers.video import average_rate, is_video

    common.check_out(out, "a motion", (".npz", ".bvh"))
    if not is_video(video):
        raise ValueError(f"{video}: is no video by its name; `harmolab data convert` reads files of movement")
    average_rate(video)


def _write_pose(video: Path, out: Path) -> None:
    from harmolab.readers.pose import read_pose

    reading = read_pose(video, progress=progress)
    harmolab.save_motion(out, reading.motion, about=f"found in {video.name} by MediaPipe: {'; '.join(reading.notes)}")
    say(f"{video}: {common.frames_text(reading.motion)}", *reading.notes)
    wrote(out)


def install_poses(*, is_agreed: bool) -> None:
    """Fetches the environment, after a yes.

    Raises
    ------
    ValueError
        The answer is no, there is no terminal to ask at, or it cannot be made.
    """
    from harmolab.readers import pose as environment

    if reason := environment.hindrance():
        raise ValueError(f"{reason}; the movement of a video can be read from the flow of its picture only")
    if not is_agreed and not _is_terminal():
        raise ValueError(f"{_offer()} To agree: harmolab data pose --install --yes")
    if not is_agreed and not _is_agreed():
        raise ValueError("nothing was fetched")
    with waiting("fetching MediaPipe (about half a minute)"):
        folder = environment.make_pose_environment()
    _declined().unlink(missing_ok=True)
    note(f"MediaPipe lies in {folder}")


def offer_poses(video: Path) -> None:
    """Ask once whether to fetch what finds the body in a video; else a line that says how it would be surer."""
    from harmolab.readers import pose as environment

    if environment.pose_environment() is not None or LEVEL.get() <= QUIET:
        return
    if reason := environment.hindrance():
        detail(f"{video.name}: no body is looked for: {reason}")
        return
    if _is_terminal() and not _declined().exists():
        if _is_agreed():
            try:
                install_poses(is_agreed=True)
            except (ValueError, OSError) as error:
                note(f"{error}; going on without")
            return
        with suppress(OSError):
            _declined().parent.mkdir(parents=True, exist_ok=True)
            _declined().touch()
    flow = "is read by the flow of its picture, in which other people, text or light on the beat count as dance"
    note(f"{video.name} {flow}. It is surer to read the dancer's body: {HOW}")


def is_body_found(video: Path) -> bool:
    """True where what finds bodies in videos is there, perhaps after a question."""
    from harmolab.readers.pose import pose_environment

    offer_poses(video)
    return pose_environment() is not None


def _declined() -> Path:
    from harmolab.readers.pose import pose_folder

    return pose_folder().with_name(DECLINED)


def _offer() -> str:
    from harmolab.readers.pose import DOWNLOADED, MEDIAPIPE, ON_DISK, pose_folder

    return (
        f"To find bodies in videos, MediaPipe {MEDIAPIPE} is fetched from the Python package index, once: about "
        f"{DOWNLOADED} MB, {ON_DISK} MB on disk, in {pose_folder()}. After that no network is needed."
    )


def _is_agreed() -> bool:
    say(_offer(), err=True)
    return typer.confirm("Fetch it now? (With no, the flow of the picture is used.)", default=False, err=True)


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()
