"""`harmolab render`: a motion and its music as a video that plays anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import plain_errors, progress

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
    if out.suffix.lower() != ".mp4":
        raise ValueError(f"{out}: a video is written as .mp4; choose a name that ends so")
    if not out.resolve().parent.is_dir():
        raise ValueError(f"{out.parent}: no such folder")
    if seconds is not None and not 0 < seconds < float("inf"):
        raise ValueError(f"seconds must be positive, got {seconds:g}")


def write_dance(
    path: Path,
    motion: Motion,
    song: Path,
    offset: float,
    music: BeatTrack | None,
    *,
    rate: float,
    height: int = 480,
) -> None:
    """The motion as mp4 with its part of the song; with a disc that lights up at each beat of `music`."""
    from harmolab.data.dance_floor import render_dance
    from harmolab.io.video import write_video

    frames = render_dance(motion, fps=rate, height=2 * (height // 2), width=2 * round(height * 2 / 3), beats=music)
    write_video(path, progress(frames, "drawing"), rate, audio=sound_of(song, offset, motion.duration))


def music_of(song: Path, offset: float, duration: float, dance: str) -> BeatTrack:
    """The song's beats on the motion's time line."""
    from rich.console import Console

    from harmolab.beats.audio import audio_beats
    from harmolab.io.audio import load_audio
    from harmolab.params import DANCES

    audio = load_audio(song)
    if not -duration < offset < audio.duration:
        raise ValueError(f"{song}: motion from {offset:g} s does not meet audio of {audio.duration:.2f} s")
    with Console(stderr=True).status("finding the beats (the first time on a machine: half a minute)"):
        return audio_beats(audio, tempo=dance if dance in DANCES else None).span(offset, duration)


def sound_of(song: Path, offset: float, duration: float) -> Audio:
    """The music from the motion's first frame to its last; silence where there is none yet."""
    import numpy as np

    from harmolab.io.audio import load_audio
    from harmolab.types import Audio

    silence = max(0.0, -offset)
    sound = load_audio(song, start=max(0.0, offset), duration=duration - silence, sample_rate=None)
    return Audio(np.pad(sound.samples, (round(silence * sound.sample_rate), 0)), sound.sample_rate)
