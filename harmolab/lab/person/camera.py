"""The one camera of all pictures: a little beside the dancer's front, a little above, along with the dancer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harmolab.io.player_points import playing_box
from harmolab.lab.person.plan import BodyPlan, body_plan
from harmolab.skeletons import camera_way, mean_heading, standing_height, turned
from harmolab.types import FloatArray, Motion

DISTANCE = 3.4  # from the camera to the dancer, in heights of the dancer
ANGLE, LIFT = 0.35, 0.11  # radians from the dancer's front to the left, and above the horizon
AIM = 0.47  # height that the camera looks at, in heights of the dancer
MIDDLE = 0.52  # of the picture's height: where that point lies
FILL, FILL_ACROSS = 0.66, 0.726  # share of the picture's height and width that a dancer's height fills at most
# A musician with an instrument: radians that the camera stands higher, the size in heights and widths of the box, and
# the share of the picture that the box fills.
PLAYER_LIFT, PLAYER_UP, PLAYER_ACROSS, PLAYER_FILL = 0.22, 0.9, 0.62, 0.84
FLAT_FILL = 0.84  # share of the picture that points of a picture fill
OUTLIERS = (0.5, 99.5)  # percentiles between which a picture's points count for its size
FLESH = 0.05  # statures of room around them


@dataclass(frozen=True, eq=False)
class Camera:
    """The place of a camera in each frame; it looks the same way in all.

    Parameters
    ----------
    eye : (T, 3) metres
    axes : (3, 3), rows: right, up and forward
    focal : float, pixels
    height, width : int, pixels
    size : float, metres, height of the dancer
    """

    eye: FloatArray
    axes: FloatArray
    focal: float
    height: float
    width: float
    size: float

    @property
    def ahead(self) -> float:
        """Metres along the floor from the camera to where it looks."""
        return float(-DISTANCE * self.size * self.axes[2, 2])

    def to_view(self, points: FloatArray, frames: slice) -> FloatArray:
        """Points (F, N, 3) of some frames as the camera has them: to its right, above it, in front of it."""
        return (points - self.eye[frames, None]) @ self.axes.T

    def to_pixels(self, view: FloatArray) -> FloatArray:
        """(..., 2) pixel x and pixel y (down) of points (..., 3) of `to_view`."""
        plane = self.focal * view[..., :2] / np.maximum(view[..., 2:], 0.01 * self.size)
        return np.array([self.width / 2, MIDDLE * self.height]) + plane * np.array([1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Stage:
    """A motion as it stands before the camera.

    Parameters
    ----------
    positions : (T, J, 3) metres, y up, floor at y = 0; points of a picture hang upright at z = 0
    plan : BodyPlan
    way : (T, 2), place on the floor that the camera goes along with
    aim : float, height that it looks at
    front : float, radians, heading that it faces
    angle, lift : float, radians, beside that heading and above the horizon
    size : float, height of the dancer
    room : (across, up), what fits the picture, in the unit of positions
    flat : bool, True for points of a picture
    """

    positions: FloatArray
    plan: BodyPlan
    way: FloatArray
    aim: float
    front: float
    angle: float
    lift: float
    size: float
    room: tuple[float, float]
    flat: bool

    def camera(self, height: float, width: float) -> Camera:
        """The camera for a picture of that size, of positions that are `turned` to it."""
        towards = np.array([0.0, np.sin(self.lift), np.cos(self.lift)])
        up = np.array([0.0, np.cos(self.lift), -np.sin(self.lift)])
        target = self.turned(np.insert(self.way, 1, self.aim, axis=1))
        focal = DISTANCE * self.size * min(width / self.room[0], height / self.room[1])
        axes = np.stack([np.array([1.0, 0.0, 0.0]), up, -towards])
        return Camera(target + DISTANCE * self.size * towards, axes, focal, height, width, self.size)

    def turned(self, points: FloatArray) -> FloatArray:
        """Points (..., 3) turned so that the camera stands at +z."""
        return turned(points, -self.front - self.angle)


def stage_of(motion: Motion, *, wall: FloatArray | None = None, follow: bool = False, angle: float = ANGLE) -> Stage:
    """The stage of a motion.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres or (T, J, 2) image coordinates
    wall : (2, 2), low and high corner of the picture, in image coordinates; the motion's own when left out
    follow : bool
        True to keep the middle of the hips in the middle of the picture, in place of the dancer's smoothed way.
    angle : float, radians from the dancer's mean heading to where the camera stands, towards her left
    """
    plan = body_plan(motion.positions, motion.skeleton)
    if motion.positions.shape[2] == 2:
        return _flat_stage(motion.positions, plan, wall, follow)
    low = float(np.percentile(motion.positions[..., 1].min(axis=1), 2))
    positions = motion.positions - np.array([0.0, low, 0.0])
    front = mean_heading(positions, motion.fps, motion.skeleton)
    box = playing_box(Motion(positions, motion.fps, motion.skeleton, motion.valid))
    if box is not None:
        return _player_stage(positions, plan, box, front, angle)
    size = max(standing_height(positions), 0.5 * float(np.ptp(positions, axis=1).max()), 1e-6)
    followed = np.einsum("j,tjd->td", plan.hips, positions) if follow else camera_way(positions, motion.fps)
    room = (size / FILL_ACROSS, size / FILL)
    return Stage(positions, plan, followed[:, [0, 2]], AIM * size, front, angle, LIFT, size, room, False)


def _player_stage(positions: FloatArray, plan: BodyPlan, box: FloatArray, front: float, angle: float) -> Stage:
    """A player with an instrument, who stays in the box (2, 3), which a camera at rest shows from higher up."""
    middle, extent = box.mean(axis=0), np.ptp(box, axis=0)
    lift, across = LIFT + PLAYER_LIFT, float(np.hypot(extent[0], extent[2]))
    size = max(PLAYER_UP * float(extent[1]), PLAYER_ACROSS * across)
    room = (across / PLAYER_FILL, float(extent[1] * np.cos(lift) + across * np.sin(lift)) / PLAYER_FILL)
    way = np.broadcast_to(middle[[0, 2]], (len(positions), 2))
    return Stage(positions, plan, way, float(middle[1]), front, angle, lift, size, room, False)


def _flat_stage(points: FloatArray, plan: BodyPlan, wall: FloatArray | None, follow: bool) -> Stage:
    """Image coordinates hung up in space, y up, before a camera that rests or goes along with the hips."""
    low, high = picture_corners(points, plan) if wall is None else wall
    upright = np.stack([points[..., 0] - (low[0] + high[0]) / 2, high[1] - points[..., 1]], axis=-1)
    positions = np.concatenate([upright, np.zeros_like(upright[..., :1])], axis=-1)
    across, up = np.maximum(high - low, 1e-6).tolist()
    way = np.zeros((len(points), 2))
    if follow:
        way[:, 0] = positions[..., 0] @ plan.hips
    room = (across / FLAT_FILL, up / FLAT_FILL)
    return Stage(positions, plan, way, up / 2, 0.0, 0.0, 0.0, max(across, up), room, True)


def picture_corners(points: FloatArray, plan: BodyPlan) -> FloatArray:
    """(2, 2): low and high corner of a picture in which the figure of points (T, J, 2) has room, but for outliers."""
    lows, highs = np.percentile(np.einsum("qj,tjd->tqd", plan.weights, points), OUTLIERS, axis=0)
    return np.stack([lows.min(axis=0) - FLESH * plan.stature, highs.max(axis=0) + FLESH * plan.stature])


def shared_wall(motions: Sequence[Motion]) -> FloatArray:
    """(2, 2): low and high corner of one picture with two motions in image coordinates; ValueError for any others."""
    if len(motions) != 2 or any(motion.positions.shape[2] != 2 for motion in motions):
        raise ValueError("two motions in image coordinates can lie over each other: a truth, and a prediction of it")
    corners = [picture_corners(motion.positions, body_plan(motion.positions, motion.skeleton)) for motion in motions]
    return np.stack([np.min(corners, axis=(0, 1)), np.max(corners, axis=(0, 1))])
