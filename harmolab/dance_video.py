"""From a song and a dance to a video: drawn on a floor, laid over the dancer's own video, or bent in time before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from harmolab.alignment import picture_motion
from harmolab.data.dance_floor import render_dance
from harmolab.data.files import TRACKED_AT, load_clip
from harmolab.data.overlay import load_points, overlay_skeleton, points_in_picture
from harmolab.harmony import score_motion
from harmolab.io.errors import PathLike, Progress, silent
from harmolab.io.motion import save_motion
from harmolab.io.video import CODINGS, is_video, video_frames, write_video
from harmolab.params import HarmonyParams
from harmolab.timewarp import Retimed, retime, warp_video
from harmolab.timewarp.beats import Method
from harmolab.types import Audio, BeatTrack, Clip, HarmonyScore, Motion

RATE = 30.0  # pictures a second where nothing else is asked for
NOTE = "finding the beats (the first time on a machine: half a minute)"


def render_files(
    song: PathLike,
    motion: PathLike,
    out: PathLike,
    *,
    over: PathLike | None = None,
    offset: float | None = None,
    seconds: float | None = None,
    marks: bool = True,
    dance: str = "",
    beats: PathLike | None = None,
    height: int = 480,
    rate: float | None = None,
    fps: float | None = None,
    joints: tuple[str, ...] | None = None,
    progress: Progress = silent,
) -> None:
    """Write a motion file with its song as a video: a stick figure on a floor, or a skeleton over a video.

    Parameters
    ----------
    song, motion, offset, seconds, dance, beats, fps, joints : as in `load_clip`
    out : str or path that ends in .mp4 or .webm
    over : str or path of the video in which the points of `motion` were found, to draw them over it
    marks : bool, whether marks light up on beats and hits
    height : int, pixels
    rate : float, pictures a second, 30 when left out; a video keeps its own
    progress : Progress over beat tracking and drawing

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    if over is not None and rate is not None:
        raise ValueError(f"{over}: is drawn at its own frame rate; leave out --rate")
    if over is not None and Path(out).exists() and Path(out).samefile(over):
        raise ValueError(f"{out}: is the video to draw over; choose another name")
    movement = motion if over is None else load_points(motion, fps=fps, joints=joints)
    for path in progress([song], NOTE):
        clip = load_clip(
            path, movement, offset=offset, seconds=seconds, dance=dance, beats=beats if marks else None,
            track=marks, fps=fps, joints=joints, sample_rate=None,
        )  # fmt: skip
    if over is not None:
        write_overlay(out, clip, over, height=height, progress=progress)
    elif _motion(clip).positions.shape[2] == 2:
        raise ValueError(f"{motion}: holds points of a picture; name the video to draw them over with --over")
    else:
        write_dance(out, clip, rate=rate or RATE, height=height, progress=progress)


def retime_files(
    song: PathLike,
    motion: PathLike,
    out: PathLike,
    *,
    offset: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    fps: float | None = None,
    strength: float = 1.0,
    phase: float = 0.0,
    slowest: float = 0.7,
    fastest: float = 1.4,
    method: Method = "dp",
    progress: Progress = silent,
) -> Retimed:
    """Write a motion, or a video, whose time is bent until its beats meet those of the song; the `Retimed` motion.

    Parameters
    ----------
    song, motion, offset, dance, beats, fps : as in `load_clip`; `motion` may also be a video
        A video moves as its pictures do as a whole, whose rests are those of the dancer.
    out : str or path that ends in .npz, .bvh, .mp4 or .webm; of a video .mp4 or .webm
    strength, phase, slowest, fastest, method : as in `harmolab.timewarp.retime`
    progress : Progress over reading, beat tracking and drawing

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError also for a setting out of range.
    """
    video = video_frames(motion) if is_video(motion) else None
    movement = picture_motion(progress(video, "looking for movement"), video.fps) if video else motion
    has_sound = Path(out).suffix.lower() in CODINGS
    for path in progress([song], NOTE):
        rate = None if has_sound else TRACKED_AT
        clip = load_clip(path, movement, offset=offset, dance=dance, beats=beats, fps=fps, sample_rate=rate)
    retimed = retime(
        _motion(clip), _music(clip), phase=phase, strength=strength, slowest=slowest, fastest=fastest, method=method
    )
    if video:
        warp_video(video.path, out, retimed.warp, sound_of(clip))
    elif has_sound:
        write_dance(out, replace(clip, motion=retimed.motion), progress=progress)
    else:
        save_motion(out, retimed.motion)
    return retimed


def write_dance(
    out: PathLike, clip: Clip, *, rate: float = RATE, height: int = 480, progress: Progress = silent
) -> None:
    """Write the motion of a clip as a video with its part of the sound, and with marks of the beats if it has any."""
    frames = render_dance(_motion(clip), fps=rate, height=height, score=_score(clip))
    write_video(out, progress(frames, "drawing"), rate, audio=sound_of(clip))


def write_overlay(out: PathLike, clip: Clip, over: PathLike, *, height: int = 480, progress: Progress = silent) -> None:
    """Write the video `over`, from its beginning, with the points of a clip's motion and its part of the sound."""
    video = video_frames(over, height=height, colour=True)
    placed = replace(clip, motion=points_in_picture(_motion(clip), video))
    frames = overlay_skeleton(video, video.fps, _motion(placed), score=_score(placed))
    write_video(out, progress(frames, "drawing"), video.fps, audio=sound_of(clip))


def sound_of(clip: Clip) -> Audio:
    """The sound from the motion's first frame to its last; silence where there is none yet."""
    silence = max(0.0, -clip.offset)
    sound = clip.audio.span(max(0.0, clip.offset), _motion(clip).duration - silence)
    return Audio(np.pad(sound.samples, (round(silence * sound.sample_rate), 0)), sound.sample_rate)


def _motion(clip: Clip) -> Motion:
    return cast(Motion, clip.motion)


def _music(clip: Clip) -> BeatTrack:
    """The beats of a clip on its motion's time line."""
    return cast(BeatTrack, clip.beats).span(clip.offset, _motion(clip).duration)


def _score(clip: Clip) -> HarmonyScore | None:
    """What the marks of a video show: speed valleys on the clip's beats; None where it has no beats."""
    if clip.beats is None:
        return None
    return score_motion(_music(clip), _motion(clip), params=HarmonyParams.valleys(), n_rotations=0)
