"""Pictures of a dance for people to watch: perspective, a floor with a grid and a shadow, a camera that follows.

The camera stands in front of the dancer (on the positive z side) and walks along; the grid stands still, so that
travelling is seen. Near limbs are darker and drawn over far ones. Needs OpenCV and numpy only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from harmolab.data.stage import FRACTION_BITS
from harmolab.features.poses import skull_and_limbs
from harmolab.kinematics import resample_motion, smooth, upsample_motion
from harmolab.types import BeatTrack, Motion

__all__ = ["render_dance"]

Frame = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

WALL, FLOOR, LINE, SHADOW = (246, 246, 246), (232, 232, 228), (196, 196, 192), (205, 205, 200)
NEAR, FAR = np.array([30.0, 34.0, 42.0]), np.array([140.0, 146.0, 156.0])  # of limbs
BEAT = (0, 114, 178)  # the project's blue for music
GRID = 0.5  # metres between lines of the floor
REACH = 9  # lines on either side of the dancer
FADES = 5  # shades of a line
NEAREST = 0.05  # metres from the camera; what is nearer is not drawn
FARTHEST = 2.0**20  # pixels that OpenCV's fixed-point coordinates can hold
FOLLOW = 0.8  # seconds over which the camera's way is smoothed
FLASH = 0.15  # seconds for which a beat is shown
# In heights of the dancer: how far away the camera stands, how high, and how high it looks.
DISTANCE, EYE, TARGET = 3.4, 0.85, 0.47
FILL = 0.58  # share of the picture's height that a standing dancer fills
LIMB, JOINT, HEAD = 0.036, 0.02, 0.072  # thickness and radii in heights of the dancer


@dataclass(frozen=True, eq=False)
class _Camera:
    """Where the camera stands and looks for each frame; everything in metres, one picture size.

    Parameters
    ----------
    eye, target : (T, 3)
    focal : float, pixels
    height, width : int, pixels
    """

    eye: FloatArray
    target: FloatArray
    focal: float
    height: int
    width: int

    def pictured(self, points: FloatArray, frame: int) -> FloatArray:
        """(..., 3) pixel x, pixel y (down) and distance from the camera's plane (metres) of points (..., 3)."""
        forward = self.target[frame] - self.eye[frame]
        forward = forward / np.linalg.norm(forward)
        right = np.array([-forward[2], 0.0, forward[0]])
        right = right / np.linalg.norm(right)
        seen = points - self.eye[frame]
        distance = np.maximum(seen @ forward, 1e-3)
        across, up = seen @ right, seen @ np.cross(right, forward)
        return np.stack(
            [
                self.width / 2 + self.focal * across / distance,
                self.height / 2 - self.focal * up / distance,
                distance,
            ],
            axis=-1,
        )


def render_dance(
    motion: Motion, *, height: int = 480, width: int | None = None, fps: float = 30.0, beats: BeatTrack | None = None
) -> Iterator[Frame]:
    """Frames of a dancer on a floor, seen from the front by a camera that walks along.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres, y up, floor at y = 0
    height, width : int, pixels
        `width` defaults to 4/3 of the height.
    fps : float, hertz
        Rate of the pictures; a slower motion is interpolated by cubic splines.
    beats : BeatTrack, optional
        Beats on the motion's time line; a disc in the corner lights up at each.

    Yields
    ------
    (H, W, 3) uint8 RGB arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        For a motion in image coordinates, a picture under 64 pixels, or an fps that is not positive.
    """
    width = round(height * 4 / 3) if width is None else width
    if motion.positions.shape[2] != 3:
        raise ValueError("a floor needs movement in space; draw image coordinates with render_skeleton")
    if min(height, width) < 64:
        raise ValueError(f"a picture needs at least 64 x 64 pixels, got {width} x {height}")
    if not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be positive and finite, got {fps}")
    danced = resample_motion(upsample_motion(motion, fps), fps)
    return _frames(danced, height, width, beats)


def _frames(motion: Motion, height: int, width: int, beats: BeatTrack | None) -> Iterator[Frame]:
    size = _standing_height(motion.positions)
    camera = _following(motion, size, height, width)
    skull, limbs = skull_and_limbs(motion.skeleton)
    flashes = np.zeros(0) if beats is None else beats.times
    for index, joints in enumerate(motion.positions):
        frame = np.full((height, width, 3), WALL, np.uint8)
        _draw_floor(frame, camera, index)
        _draw_shadow(frame, camera, index, joints, limbs, size)
        _draw_dancer(frame, camera, index, joints, limbs, skull, size)
        since = index / motion.fps - flashes
        _draw_beat(frame, bool(((since >= 0) & (since < FLASH)).any()), beats is not None)
        yield frame


def _standing_height(positions: FloatArray) -> float:
    """How tall the dancer is, metres: the upper end of what the body spans in a frame."""
    return max(float(np.percentile(np.ptp(positions[..., 1], axis=1), 90)), 0.1)


def _following(motion: Motion, size: float, height: int, width: int) -> _Camera:
    """The camera in front of the dancer, its way smoothed so that it never jerks."""
    way = smooth(motion.positions.mean(axis=1), FOLLOW, motion.fps)
    way[:, 1] = TARGET * size
    eye = way + size * np.array([0.0, EYE - TARGET, DISTANCE])
    return _Camera(eye, way, FILL * height * DISTANCE, height, width)


def _draw_floor(frame: Frame, camera: _Camera, index: int) -> None:
    """The floor up to the horizon, and its grid, which fades with the distance."""
    here = camera.target[index, [0, 2]]
    far = camera.pictured(np.array([here[0], 0.0, here[1] - 1000.0]), index)
    frame[int(np.clip(far[1], 0, len(frame))) :] = FLOOR
    pieces, middles = _grid(np.round(here / GRID) * GRID)
    places = camera.pictured(pieces, index)
    visible = np.clip(1.15 - np.linalg.norm(middles - here, axis=1) / (REACH * GRID), 0.0, 1.0)
    levels = np.where((places[..., 2] > NEAREST).all(axis=1), np.ceil(visible * FADES), 0)
    points = np.clip(places[..., :2] * 2**FRACTION_BITS, -FARTHEST, FARTHEST).round().astype(np.int32)
    # One call for each shade: a call for each piece would take longer than the rest of the picture.
    for level in range(1, FADES + 1):
        colour = _mixed(FLOOR, LINE, level / FADES)
        cv2.polylines(frame, list(points[levels == level]), False, colour, 1, cv2.LINE_AA, FRACTION_BITS)


def _grid(middle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The pieces of the floor's lines around a crossing: ends (P, 2, 3), and middles (P, 2: x, z)."""
    steps = GRID * np.arange(-REACH, REACH + 1)
    fixed, start = (values.ravel() for values in np.meshgrid(steps, steps[:-1], indexing="ij"))
    along = np.stack([np.stack([fixed, start], axis=1), np.stack([fixed, start + GRID], axis=1)], axis=1)
    flat = middle + np.concatenate([along, along[..., ::-1]])
    return np.stack([flat[..., 0], np.zeros(flat.shape[:2]), flat[..., 1]], axis=-1), flat.mean(axis=1)


def _draw_shadow(
    frame: Frame, camera: _Camera, index: int, joints: FloatArray, limbs: list[tuple[int, int]], size: float
) -> None:
    """Every limb once more, flat on the floor."""
    flat = camera.pictured(joints * np.array([1.0, 0.0, 1.0]), index)
    for parent, child in limbs:
        thickness = _pixels(1.3 * LIMB * size, flat[[parent, child], 2].mean(), camera)
        _line(frame, flat[parent], flat[child], SHADOW, thickness)


def _draw_dancer(
    frame: Frame,
    camera: _Camera,
    index: int,
    joints: FloatArray,
    limbs: list[tuple[int, int]],
    skull: list[int],
    size: float,
) -> None:
    """Limbs, joints and head from far to near; limbs with a light rim that sets them off from what lies behind."""
    places = camera.pictured(joints, index)
    nearest, depth = places[:, 2].min(), max(float(np.ptp(places[:, 2])), 0.3 * size)
    parts = [
        *limbs,
        *((joint,) for joint in range(len(joints)) if joint not in skull),
        *([tuple(skull)] if skull else []),
    ]
    for part in sorted(parts, key=lambda part: -_distance(places, part, skull)):
        members = list(part)
        distance = places[members, 2].mean()
        colour = _mixed(NEAR, FAR, (distance - nearest) / depth)
        if part in limbs:
            thickness = _pixels(LIMB * size, distance, camera)
            _line(frame, places[part[0]], places[part[1]], WALL, thickness + 2)
            _line(frame, places[part[0]], places[part[1]], colour, thickness)
        else:
            radius = (HEAD if members == skull else JOINT) * size
            scaled = camera.focal * radius / distance * 2**FRACTION_BITS
            centre = _fixed(places[members].mean(axis=0))
            cv2.circle(frame, centre, max(1, round(scaled)), colour, -1, cv2.LINE_AA, FRACTION_BITS)


def _distance(places: FloatArray, part: tuple[int, ...], skull: list[int]) -> float:
    """How far away a part counts as lying: the head in front of the neck, whatever the neck does."""
    distance = float(places[list(part), 2].mean())
    if part == tuple(skull):
        return distance - 0.1
    return distance + 0.1 if len(part) == 2 and not set(part).isdisjoint(skull) else distance


def _draw_beat(frame: Frame, lit: bool, shown: bool) -> None:
    """The disc in the upper left corner: a ring, filled at a beat."""
    if not shown:
        return
    radius = max(4.0, 0.02 * len(frame))
    centre = _fixed(np.array([2.2 * radius, 2.2 * radius]))
    cv2.circle(frame, centre, round(radius * 2**FRACTION_BITS), BEAT, -1 if lit else 1, cv2.LINE_AA, FRACTION_BITS)


def _mixed(one: object, other: object, share: float) -> tuple[float, ...]:
    """The colour that lies `share` of the way from one to another."""
    start, end = np.asarray(one, float), np.asarray(other, float)
    return tuple((start + (end - start) * float(np.clip(share, 0.0, 1.0))).tolist())


def _pixels(metres: float, distance: float, camera: _Camera) -> int:
    """How many pixels a length takes at a distance; one at least."""
    return max(1, round(camera.focal * metres / max(distance, 0.1)))


def _line(frame: Frame, start: FloatArray, end: FloatArray, colour: tuple[float, ...], thickness: int) -> None:
    cv2.line(frame, _fixed(start), _fixed(end), colour, thickness, cv2.LINE_AA, FRACTION_BITS)


def _fixed(point: FloatArray) -> tuple[int, int]:
    """A pixel position in OpenCV's fixed-point coordinates, kept within what they can hold."""
    x, y = np.clip(np.asarray(point[:2], float) * 2**FRACTION_BITS, -FARTHEST, FARTHEST)
    return round(float(x)), round(float(y))
