"""`harmolab render`: a motion and its music as a video that plays anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import check_out, plain_errors, progress, track_beats

if TYPE_CHECKING:
    from harmolab.types import Audio, BeatTrack, Motion


VIDEOS_OUT = (".mp4", ".webm")
RATE = 30.0  # pictures a second where nothing else is asked for


def render(
    audio: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3, or a video with sound.")],
    motion: Annotated[
        Path, typer.Argument(help="The motion: npz, npy, bvh, AIST++ pkl; with --over key points or landmarks.")
    ],
    out: Annotated[Path, typer.Option(help="The video to write: .mp4 (plays everywhere) or .webm.")],
    over: Annotated[
        Path | None, typer.Option(help="Draw the skeleton over this video, in which the points were found.")
    ] = None,
    offset: Annotated[float, typer.Option(help="Audio time in seconds of the motion's first frame.")] = 0.0,
    seconds: Annotated[float | None, typer.Option(help="Show only so many seconds from there.")] = None,
    marks: Annotated[
        bool, typer.Option(help="Marks that light up on beats: of the music, of the dancer, hits.")
    ] = True,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo (waltz, ...).")] = "",
    height: Annotated[
        int, typer.Option(help="Pixels; the width is 4/3 of it, or the video's (never enlarged).", min=120, max=2160)
    ] = 480,
    rate: Annotated[
        float | None, typer.Option(help="Pictures a second: 30, or those of the video.", min=10, max=120)
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, keypoints).")
    ] = None,
    joints: Annotated[
        str, typer.Option(help="Keep these joints only, as in: left_wrist,right_wrist (a camera that sees no legs).")
    ] = "",
) -> None:
    """Write a video of a motion with its music: a stick figure on a floor, or a skeleton over the dancer's own video.

    Examples:

    `harmolab render song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.mp4`

    `harmolab render take.mp4 keypoints/ --fps 25 --over take.mp4 --out checked.webm`
    """
    with plain_errors():
        _check(out, seconds, over, rate)
        moves = _motion(motion, fps, joints, over)
        shown = moves if seconds is None else moves.span(0.0, min(seconds, moves.duration))
        music = music_of(audio, offset, shown.duration, dance) if marks else None
        if over is None:
            write_dance(out, shown, audio, offset, music, rate=rate or RATE, height=height)
        else:
            _write_overlay(out, shown, over, audio, offset, music, height)
    typer.echo(f"wrote {out}")


def _check(out: Path, seconds: float | None, over: Path | None, rate: float | None) -> None:
    """ValueError unless the video can be written, before any work is done."""
    check_out(out, "a video", VIDEOS_OUT)
    if seconds is not None and not 0 < seconds < float("inf"):
        raise ValueError(f"seconds must be positive, got {seconds:g}")
    if over is not None and rate is not None:
        raise ValueError(f"{over}: is drawn at its own frame rate; leave out --rate")
    if over is not None and out.exists() and out.samefile(over):
        raise ValueError(f"{out}: is the video to draw over; choose another name")


def _motion(path: Path, fps: float | None, joints: str, over: Path | None) -> Motion:
    """The motion in space, or the points of a picture when they go over a video."""
    names = tuple(name.strip() for name in joints.split(",") if name.strip()) or None
    if over is None:
        from harmolab.data.folders import load_any_motion

        motion = load_any_motion(path, fps=fps, joints=names)
        if motion.positions.shape[2] == 2:
            raise ValueError(f"{path}: holds points of a picture; name the video to draw them over with --over")
        return motion
    from harmolab.data.overlay import load_points

    return load_points(path, fps=fps, joints=names)


def write_dance(
    path: Path,
    motion: Motion,
    song: Path,
    offset: float,
    music: BeatTrack | None,
    *,
    rate: float = RATE,
    height: int = 480,
) -> None:
    """The motion as a video with its part of the song; with marks of the beats when those of the `music` are given."""
    from harmolab.data.dance_floor import render_dance
    from harmolab.io.video import write_video

    frames = render_dance(motion, fps=rate, height=height, beats=music, dancer_beats=_dancer_beats(motion, music))
    write_video(path, progress(frames, "drawing"), rate, audio=sound_of(song, offset, motion.duration))


def _write_overlay(
    path: Path, motion: Motion, over: Path, song: Path, offset: float, music: BeatTrack | None, height: int
) -> None:
    """The video with the skeleton over it, from its beginning, and the song."""
    from harmolab.data.overlay import overlay_skeleton, points_in_picture
    from harmolab.io.video import video_frames, write_video

    video = video_frames(over, height=height, colour=True)
    placed = points_in_picture(motion, video)
    dancer_beats = _dancer_beats(placed, music)
    frames = overlay_skeleton(video, video.fps, placed, beats=music, dancer_beats=dancer_beats)
    write_video(path, progress(frames, "drawing"), video.fps, audio=sound_of(song, offset, motion.duration))


def _dancer_beats(motion: Motion, music: BeatTrack | None) -> BeatTrack | None:
    """The speed valleys of the motion, to be marked beside the music's beats."""
    from harmolab.beats.visual import visual_beats
    from harmolab.params import HarmonyParams

    return None if music is None else visual_beats(motion, params=HarmonyParams.valleys())


def music_of(song: Path, offset: float, duration: float, dance: str) -> BeatTrack:
    """The song's beats on the motion's time line."""
    from harmolab.io.video_sound import load_sound

    audio = load_sound(song)
    if not -duration < offset < audio.duration:
        raise ValueError(f"{song}: motion from {offset:g} s does not meet audio of {audio.duration:.2f} s")
    return track_beats(audio, dance).span(offset, duration)


def sound_of(song: Path, offset: float, duration: float) -> Audio:
    """The music from the motion's first frame to its last; silence where there is none yet."""
    import numpy as np

    from harmolab.io.video_sound import load_sound
    from harmolab.types import Audio

    silence = max(0.0, -offset)
    sound = load_sound(song, start=max(0.0, offset), duration=duration - silence, sample_rate=None)
    return Audio(np.pad(sound.samples, (round(silence * sound.sample_rate), 0)), sound.sample_rate)
