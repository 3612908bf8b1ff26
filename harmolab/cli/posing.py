"""`harmolab data pose`: the body in a video as a motion file; and the question whether what finds it may be fetched."""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.screen import LEVEL, QUIET, detail, note, plain_errors, printable, progress, waiting, wrote

HOW = "`harmolab data pose --install` fetches what finds it, once"
DECLINED = "poses_declined"  # file in the cache, once a question has been answered with no


def pose(
    video: Annotated[Path | None, typer.Argument(metavar="VIDEO", show_default=False)] = None,
    out: Path | None = None,
    install: Annotated[bool, typer.Option("--install")] = False,
    remove: Annotated[bool, typer.Option("--remove")] = False,
    yes: Annotated[bool, typer.Option("--yes")] = False,
) -> None:
    """Find the dancer's body in a video and write its movement, in metres with y up.

    The body is found by MediaPipe, which is fetched once, after a question, into a folder of the cache; after that no
    network is needed. Then `score`, `play` and `retime` find the body of a video by themselves.
    What was found is kept, so that they need not look twice. HARMOLAB_POSE=off turns all of this off.

    Of several people the one who moves most is taken. The points are those of the body as it moves in itself: its way
    over the floor is not known.

    Example: `harmolab data pose phone_video.mp4 --out dance.npz`

    Example: `harmolab data pose --install --yes`

    Parameters
    ----------
    video : The video: one dancer, all of the body.
    out : The motion to write, .npz or .bvh (default: the video's name, .npz, here).
    install : Fetch what finds bodies, if it is not there.
    remove : Remove it again.
    yes : Fetch without a question.
    """
    from harmolab.readers.pose import pose_environment, remove_pose_environment

    with plain_errors():
        if remove:
            typer.echo("removed" if remove_pose_environment() else "there is nothing to remove")
            return
        if video is None and not (install or yes):
            raise ValueError("pose takes a VIDEO, --install or --remove")
        if video is not None:
            out = out or Path(f"{video.stem}.npz")
            _check(video, out)
        if pose_environment() is None:
            install_poses(is_agreed=yes)
        elif video is None:
            typer.echo(f"is there already: {pose_environment()}")
        if video is not None and out is not None:
            _write(video, out)


def _check(video: Path, out: Path) -> None:
    """The errors that can be told before any work."""
    from harmolab.readers.video import average_rate, is_video

    common.check_out(out, "a motion", (".npz", ".bvh"))
    if not video.exists():
        raise FileNotFoundError(f"{video}: no such file")
    if not is_video(video):
        raise ValueError(f"{video}: is no video by its name; `harmolab data convert` reads files of movement")
    average_rate(video)


def _write(video: Path, out: Path) -> None:
    from harmolab.readers.motion import save_motion
    from harmolab.readers.pose import read_pose

    reading = read_pose(video, progress=progress)
    frames, joints, _ = reading.motion.positions.shape
    save_motion(out, reading.motion, about=f"found in {video.name} by MediaPipe: {'; '.join(reading.notes)}")
    typer.echo(printable(f"{video}: {frames} frames of {joints} joints at {reading.motion.fps:g} a second"))
    for sentence in reading.notes:
        typer.echo(printable(sentence))
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
    note(f"{video.name} is read by the flow of its picture; its dancer's body would be surer: {HOW}")


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
    typer.echo(printable(_offer()), err=True)
    return typer.confirm("Fetch it now? (With no, the flow of the picture is used.)", default=False, err=True)


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()
