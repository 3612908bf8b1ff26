"""`harmolab render`: a motion and its music as a video that plays anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import check_out, plain_errors, progress, track_beats

if TYPE_CHECKING:
    from harmolab.types import Audio, BeatTrack, Motion

__all__ = ["music_of", "render", "sound_of", "write_dance"]


def render(
    audio: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3.")],
    motion: Annotated[Path, typer.Argument(help="The motion: npz, npy, bvh, AIST++ pkl, keypoints.")],
    out: Annotated[Path, typer.Option(help="The video to write, .mp4.")],
    offset: Annotated[float, typer.Option(help="Audio time in seconds of the motion's first frame.")] = 0.0,
    seconds: Annotated[float | None, typer.Option(help="Show only so many seconds from there.")] = None,
    marks: Annotated[bool, typer.Option(help="A disc that lights up on the music's beats.")] = True,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo (waltz, ...).")] = "",
    height: Annotated[int, typer.Option(help="Pixels; the width is 4/3 of it.", min=120, max=2160)] = 480,
    rate: Annotated[float, typer.Option(help="Pictures a second.", min=10, max=120)] = 30.0,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, keypoints).")
    ] = None,
) -> None:
    """Write a video of a motion with its music.

    Example: `harmolab render song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.mp4`
    """
    from harmolab.data.folders import load_any_motion

    with plain_errors():
        _check(out, seconds)
        moves = load_any_motion(motion, fps=fps)
        shown = moves if seconds is None else moves.span(0.0, min(seconds, moves.duration))
        music = music_of(audio, offset, shown.duration, dance) if marks else None
        write_dance(out, shown, audio, offset, music, rate=rate, height=height)
    typer.echo(f"wrote {out}")


def _check(out: Path, seconds: float | None) -> None:
    """ValueError unless the video can be written, before any work is done."""
    check_out(out, "a video", (".mp4",))
    if seconds is not None and not 0 < seconds < float("inf"):
        raise ValueError(f"seconds must be positive, got {seconds:g}")


def write_dance(
    path: Path,
    motion: Motion,
    song: Path,
    offset: float,
    music: BeatTrack | None,
    *,
    rate: float = 30.0,
    height: int = 480,
) -> None:
    """The motion as mp4 with its part of the song; with a disc that lights up at each beat of `music`."""
    from harmolab.data.dance_floor import render_dance
    from harmolab.io.video import write_video

    frames = progress(render_dance(motion, fps=rate, height=height, beats=music), "drawing")
    write_video(path, frames, rate, audio=sound_of(song, offset, motion.duration))


def music_of(song: Path, offset: float, duration: float, dance: str) -> BeatTrack:
    """The song's beats on the motion's time line."""
    from harmolab.io.audio import load_audio

    audio = load_audio(song)
    if not -duration < offset < audio.duration:
        raise ValueError(f"{song}: motion from {offset:g} s does not meet audio of {audio.duration:.2f} s")
    return track_beats(audio, dance).span(offset, duration)


def sound_of(song: Path, offset: float, duration: float) -> Audio:
    """The music from the motion's first frame to its last; silence where there is none yet."""
    import numpy as np

    from harmolab.io.audio import load_audio
    from harmolab.types import Audio

    silence = max(0.0, -offset)
    sound = load_audio(song, start=max(0.0, offset), duration=duration - silence, sample_rate=None)
    return Audio(np.pad(sound.samples, (round(silence * sound.sample_rate), 0)), sound.sample_rate)
