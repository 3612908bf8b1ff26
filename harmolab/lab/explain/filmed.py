"""The movement of the dancer in a video: by the body where that can be found, else by the flow of the picture.

Flow follows everything that moves; where it is not the dancer's movement, no dancer is judged by it. A dancer is
surrounded by what should rest: at the left, right and upper edge of the picture. The share of that edge which moves
tells a shaking camera and a moving background. Where most of that edge moves at once, the light changes, the film is
cut or the camera jumps: that is often on the beat, and none of it is the dancer's.

The limits were chosen on 92 planted videos (`tests/phone_videos.py`) of ten dancers, and tried on 67 of ten others.
Where at most .27 of the edge moved, the correlation of the flow with the true movement of the body was about that of a
clean film of the same dance; where .33 or more did, it was .31 at most. A sensor's noise of up to 20 grey levels,
compression (CRF 23 to 35) and 8 to 60 pictures a second made no such difference.
"""

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from harmolab.beats.flow import STILL
from harmolab.files import Counted, PathLike, Progress, named_faults, silent
from harmolab.lab.explain.offset import PICTURE, picture_motion
from harmolab.readers.motion_file import MotionFile
from harmolab.readers.pose import UNREAD, pose_environment, read_pose
from harmolab.readers.video import frame_count, is_video, video_frames
from harmolab.types import BoolArray, FloatArray, Motion, SingleArray

# Is the flow of a picture the dancer's movement?

ROWS, COLUMNS = 6, 8  # of the grid that is looked at
EDGE_MOVES = 0.3  # share of the edge, over all pictures
ALL_MOVES = 0.75  # share of the picture that moves in one picture of ten: the camera, and not a part of the background
JUMPS = 0.25  # share of the movement: lights, cuts, zooms on the beat .30 to 1, a hand that shakes a little .02 at most
LEAST_RATE = 8.0  # hertz, the slowest that was tried
SHAKES = "the camera moves; put it on something that stands still (or the light changes or the film is cut: avoid both)"
MOVES = "the background moves, or others do; film with only yourself in the picture"
HANDLED = (
    "the camera moves as the film begins or ends, as where it is put down or picked up; cut these moments off the film"
)
NOTHING = "nothing moves in the picture"


@dataclass(eq=False)
class PictureWatch:
    """Which cells of a video's picture move, picture by picture; to be called by `flow_directograms`."""

    cells: list[NDArray[np.number]] = field(default_factory=list)

    def __call__(self, speed: SingleArray) -> None:
        """Look at the speed of every pixel (H, W), picture heights per second."""
        moving = np.where(speed > STILL, speed, np.float32(0.0))
        self.cells.append(cv2.resize(moving, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA))

    @property
    def _moving(self) -> BoolArray:
        """(T, ROWS, COLUMNS) whether each cell moves in each picture."""
        return np.stack(self.cells) > STILL / 2

    @property
    def edges(self) -> FloatArray:
        """(T,) share of the left, right and upper edge that moves in each picture."""
        cells = self._moving
        return np.concatenate([cells[:, :, 0], cells[:, :, -1], cells[:, 0, 1:-1]], axis=1).mean(axis=1)

    @property
    def jumps(self) -> float:
        """Share of all movement that falls into pictures in which most of the edge moves."""
        amounts = np.stack(self.cells).sum(axis=(1, 2))
        return float(amounts[self.edges > 0.5].sum() / amounts.sum())

    @property
    def most(self) -> float:
        """Share of the picture that moves in the liveliest tenth of the pictures, at least."""
        return float(np.percentile(self._moving.mean(axis=(1, 2)), 90))

    @property
    def fault(self) -> str:
        """The reason why the flow is not that of a dancer; "" where it may be."""
        if not self.cells or not self.most:
            return NOTHING
        is_restless = self.edges.mean() > EDGE_MOVES
        if not is_restless and self.jumps <= JUMPS:
            return ""
        return MOVES if is_restless and self.most <= ALL_MOVES else SHAKES

    @property
    def between(self) -> "PictureWatch":
        """The pictures between the jumps in the first and those in the last quarter of the film."""
        quarter, jumps = len(self.cells) // 4, self.edges > 0.5
        begin = max(np.flatnonzero(jumps[:quarter]), default=-1) + 1
        end = min(np.flatnonzero(jumps[-quarter:]), default=quarter) if quarter else 0
        return PictureWatch(self.cells[begin : len(self.cells) - quarter + end])

    def check(self) -> None:
        """ValueError, with the reason, where the flow is not that of a dancer."""
        if fault := self.fault:
            raise ValueError(UNREAD + (HANDLED if fault == SHAKES and not self.between.fault else fault))


# The movement in a video, by body or by flow

NO_SIGN = (
    "the flow of the picture shows no sign of the beat, and flow misses some who are on it; `harmolab data pose "
    "--install` fetches what finds the body itself"
)
POOR = (
    "the limbs of the body that was found change their length by {spread:.0%}, so it was followed poorly, and it shows "
    "no sign of the beat; film all of the body from nearer, in more light"
)
# `limb_spread` of a body that is followed poorly. In 32 planted videos that have the levels of the true movement it is
# .06 to .10, in one of a person .06; in 7 of the drawn figure of `harmolab play` .13 to .19, and 4 of them show no
# sign of the beat.
LOOSE_LIMBS = 0.12
HEIGHT = 160  # pixels of the video that flow is measured on


def filmed_motion(path: PathLike, *, by_flow: bool = False, progress: Progress = silent) -> MotionFile:
    """The movement of the dancer in a video, of a body or `picture_motion`, with notes for people on how it was read.

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
        return MotionFile(reading.motion, "video", reading.notes)
    frames, watch = video_frames(path, height=HEIGHT), PictureWatch()
    with named_faults(path):
        if frames.fps < LEAST_RATE:
            raise ValueError(f"{UNREAD}{frames.fps:g} pictures a second are too few; film with {LEAST_RATE:g} or more")
        pictures = Counted(frames, frame_count(frames))
        motion = picture_motion(pictures, frames.fps, watch=watch, progress=progress)
        watch.check()
        return MotionFile(motion, "video")


def check_sign(path: PathLike, motion: Motion) -> None:
    """ValueError where a video that shows no sign of the beat (level 1) was read poorly: the reading may be at fault.

    Of planted dancers whose true movement is in time, clearly filmed, a sixth show none in the flow of the picture: it
    follows all that moves, and fast hands most. A body whose limbs change their length was followed poorly. A sign that
    is seen counts; one that is not seen is no verdict on a dancer.
    """
    if not is_video(path):
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
