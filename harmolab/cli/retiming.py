"""`harmolab retime`: a motion or a video whose time is bent until its beats meet the music's."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import check_out, plain_errors, progress, show
from harmolab.cli.rendering import VIDEOS_OUT, music_of, sound_of, write_dance

if TYPE_CHECKING:
    from harmolab.timewarp.retime import Retimed
    from harmolab.types import BeatTrack, Motion


MOTION_SUFFIXES = (".npz", ".bvh", *VIDEOS_OUT)
MEANINGS = (
    "Above chance: speed valleys (in a video: of all that moves) within 0.1 s of the beats; 0 is a random moment, 1 "
    "every beat met. Speed: source seconds a second."
)


class Method(StrEnum):
    """How the warp is found."""

    dp = "dp"
    lee2019 = "lee2019"


def retime(
    motion: Annotated[Path, typer.Argument(help="The motion (npz, npy, bvh, AIST++ pkl, ...), or a video.")],
    audio: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3, or a video with sound.")],
    out: Annotated[Path, typer.Option(help="npz, bvh, or mp4 or webm (with sound); mp4 or webm for a video.")],
    strength: Annotated[float, typer.Option(help="Share of every shift that is made, 0 to 1.")] = 1.0,
    phase: Annotated[float, typer.Option(help="Where in the beat to land: 0 on it, 0.5 half way to the next.")] = 0.0,
    offset: Annotated[float, typer.Option(help="Audio time in seconds at which the motion begins.")] = 0.0,
    slowest: Annotated[float, typer.Option(help="Lowest local speed, above 0 to 1.")] = 0.7,
    fastest: Annotated[float, typer.Option(help="Highest local speed, 1 or more.")] = 1.4,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo (waltz, ...).")] = "",
    method: Annotated[
        Method, typer.Option(help="dp: bounded; lee2019: Lee et al. 2019, for comparison, no bounds.")
    ] = Method.dp,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, keypoints).")
    ] = None,
) -> None:
    """Bend a motion's time until it is in time with the music, and say how much was bent.

    A motion that is in time already is left alone.

    Example: `harmolab retime dance.bvh song.mp3 --out mended.mp4 --dance waltz`
    """
    from harmolab.io.video import is_video
    from harmolab.timewarp.retime import retime as bend
    from harmolab.timewarp.retime import warp_video

    with plain_errors():
        is_film = is_video(motion)
        check_out(out, "this", VIDEOS_OUT if is_film else MOTION_SUFFIXES)
        moves = _moves(motion, fps)
        music = music_of(audio, offset, moves.duration, dance)
        retimed = bend(
            moves, music, phase=phase, strength=strength, slowest=slowest, fastest=fastest, method=method.value
        )
        if is_film:
            warp_video(motion, out, retimed.warp, sound_of(audio, offset, moves.duration))
        else:
            _write(out, retimed.motion, music, audio, offset)
    _print(retimed)
    typer.echo(f"wrote {out}")


def _moves(path: Path, fps: float | None) -> Motion:
    """The motion in a file; of a video that of its pictures as a whole, whose rests are those of the dancer."""
    from harmolab.alignment.pictures import picture_motion
    from harmolab.data.folders import load_any_motion
    from harmolab.io.video import is_video, video_frames

    if not is_video(path):
        return load_any_motion(path, fps=fps)
    video = video_frames(path)
    return picture_motion(progress(video, "looking for movement"), video.fps)


def _write(path: Path, motion: Motion, music: BeatTrack, song: Path, offset: float) -> None:
    """The motion in the form that the name asks for."""
    if path.suffix.lower() not in VIDEOS_OUT:
        from harmolab.io.motion import save_motion

        save_motion(path, motion)
        return
    write_dance(path, motion, song, offset, music)


def _print(retimed: Retimed) -> None:
    """What was won, and what it took."""
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    before, after, warp = retimed.before, retimed.after, retimed.warp
    table = Table("", "before", "after", title="the motion and its music")
    table.add_row("harmony above chance", show(before.harmony_above_chance), show(after.harmony_above_chance))
    table.add_row("hit rate", show(before.hit_rate), show(after.hit_rate))
    table.add_row("time bent, mean, ms", "0", f"{1000 * warp.bent:.0f}")
    table.add_row("time bent, largest, ms", "0", f"{1000 * np.abs(warp.shifts()).max():.0f}")
    table.add_row("local speed", "1", show(warp.speed_range()))
    console = Console()
    console.print(table)
    console.print("Nothing was worth bending." if warp.is_identity else MEANINGS, highlight=False)
