"""The movement of the dancer in a video: by the body where that can be found, else by the flow of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from harmolab.io.files import PathLike, Progress, silent
from harmolab.io.pose import UNREAD, read_pose
from harmolab.io.pose_environment import pose_environment
from harmolab.io.video import is_video, video_frames
from harmolab.lab.timing.movement import PICTURE, picture_motion
from harmolab.lab.timing.picture_quality import PictureWatch, check_rate
from harmolab.types import Motion

NO_SIGN = (
    "the flow of the picture shows no sign of the beat, and flow misses some who are on it; `harmolab pose --install` "
    "fetches what finds the body itself"
)
POOR = (
    "the limbs of the body that was found change their length by {spread:.0%}, so it was followed poorly, and it shows "
    "no sign of the beat; film all of the body from nearer, in more light"
)
# `limb_spread` of a body that is followed poorly. In 32 planted videos that have the levels of the true movement it is
# .06 to .10, in one of a person .06; in 7 of the drawn figure of `harmolab render` .13 to .19, and 4 of them show no
# sign of the beat.
LOOSE_LIMBS = 0.12
HEIGHT = 160  # pixels of the video that flow is measured on


@dataclass(frozen=True, eq=False)
class FilmedMotion:
    """The movement in a video.

    Parameters
    ----------
    motion : Motion of a body, or `picture_motion`
    notes : sentences about how it was read, for people
    """

    motion: Motion
    notes: tuple[str, ...] = ()


def filmed_motion(path: PathLike, *, by_flow: bool = False, progress: Progress = silent) -> FilmedMotion:
    """The movement of the dancer in a video.

    Parameters
    ----------
    path : str or path of a video
    by_flow : bool; True reads the flow of the picture even where the body can be found
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError also where the movement cannot be read well enough to be judged, with the reason.
    """
    path = Path(path)
    if pose_environment() is not None and not by_flow:
        reading = read_pose(path, progress=progress)
        return FilmedMotion(reading.motion, reading.notes)
    frames, watch = video_frames(path, height=HEIGHT), PictureWatch()
    try:
        check_rate(frames.fps)
        motion = picture_motion(frames, frames.fps, watch=watch, progress=progress)
        watch.check()
        return FilmedMotion(motion)
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


def check_sign(path: PathLike, motion: Motion, level: int) -> None:
    """ValueError where a video that was read poorly shows no sign of the beat (level 1): the reading may be at fault.

    Of planted dancers whose true movement is in time, clearly filmed, a sixth show none in the flow of the picture: it
    follows all that moves, and fast hands most. A body whose limbs change their length was followed poorly. A sign that
    is seen counts; one that is not seen is no verdict on a dancer.
    """
    if level != 1 or not is_video(path):
        return
    if not has_body(motion):
        raise ValueError(f"{path}: {UNREAD}{NO_SIGN}")
    if (spread := limb_spread(motion)) > LOOSE_LIMBS:
        raise ValueError(f"{path}: {UNREAD}{POOR.format(spread=spread)}")


def limb_spread(motion: Motion) -> float:
    """Median over the limbs (a joint and its parent) of the SD of their length over its mean; 0 without limbs."""
    limbs = [(joint, parent) for joint, parent in enumerate(motion.skeleton.parents) if parent >= 0]
    if not limbs:
        return 0.0
    ends, starts = (motion.positions[motion.valid][:, list(joints)] for joints in zip(*limbs, strict=True))
    lengths = np.linalg.norm(ends - starts, axis=-1)
    return float(np.median(lengths.std(axis=0) / np.maximum(lengths.mean(axis=0), 1e-9)))


def points_in_video(path: PathLike) -> Motion | None:
    """The points of the dancer as shares of the picture, (T, J, 2), once `filmed_motion` has read her; None by flow."""
    return None if pose_environment() is None else read_pose(path).points


def has_body(motion: Motion) -> bool:
    """False for the movement of a whole picture, of which no body is known."""
    return motion.skeleton != PICTURE
