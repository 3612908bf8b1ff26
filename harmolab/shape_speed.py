"""Shape speed, the signal that the recommended score reads: how fast the shape of the body changes.

A body that is carried, turned, tilted or bobbed as one piece keeps its shape, so its shape speed is 0. Limbs that
swing, bends and twists change the shape. Fingers are left out where they are many (`without_fingers`). This table says
what is taken out of the movement of the joints:

==================  ==================================================================================================
positions           taken out of the movement
==================  ==================================================================================================
3-D, 3 joints up    where the body stands, how it turns about the vertical, and every other rotation of the whole body
2-D, 3 joints up    what a camera does to a picture: pan, roll, zoom, shear. A statue that turns still moves in it.
fewer joints        nothing: two points have no shape, so their speed in the room (head and hand of a game) is read
==================  ==================================================================================================

It is read by the verdict and its words, the learnt bar patterns and the choreographer; `harmonise` raises the score of
its soft form. The hits of the paper, and those of HarmoGAN's loss, read the joint speed in the room instead, and the
guard (`harmolab.metrics.likeness`) measures joints.
"""

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from scipy.ndimage import gaussian_filter1d

from harmolab.body.kinematics import ROUNDING, smooth_positions, upsample_motion
from harmolab.body.skeletons import skeleton_part
from harmolab.types import BoolArray, FloatArray, Motion, Record

RATE = 100.0  # hertz: slower motion is interpolated first, so that its frame rate does not show
SMOOTHING = 0.06  # seconds, Gaussian over the positions: sensors tremble faster than people move
DRIFT = 1.0  # seconds: slower changes of speed belong to the choreography, not to the beat
RIDGE = 1e-6  # share of the trace added to the inertia, so that joints in one line can be solved for
FEWEST = 3  # joints; fewer have no shape
FINGERS = ("thumb", "index", "middle", "ring", "pink", "little", "finger", "digit")  # in the names of their joints
BODY = 10  # joints that a body has without its fingers; a player of an instrument, of whom there are fewer, keeps them
# A joint that is out of place in one frame was read wrong: sizes of the body by which it lies off both its neighbours,
# and sizes a second squared, beyond which no limb turns back.
GLITCH, FASTEST_TURN = 0.25, 60.0

# Several questions are asked about one motion: its shape speed is computed once while the motion is alive.
_speeds: WeakKeyDictionary[Motion, dict[float, "ShapeSpeed"]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class ShapeSpeed(Record):
    """The speed of a body's shape at every moment, and the numbers that it comes from. Arrays are read-only.

    Units are those of the positions, metres in space.

    Parameters
    ----------
    fps : float, hertz
        Sample i belongs to second i / fps of the motion.
    speed : (T,) array, units per second
        The shape speed: root mean square over the joints.
    energy : (T, J) array
        Squared speed of each joint inside the body; `speed` is the root of its mean over the joints.
    room : (T,) array
        Mean over the joints of their squared speed in the room, nothing taken out.
    extent : (T,) array
        Size of the body: root mean square distance of the joints from their mean.
    valid : (T,) bool array
        False on filler frames.
    dimensions : int
        3 or 2 as the positions; 0 where there are fewer than three joints, which have no shape.
    axes : int
        3 or 2, of the positions.
    """

    fps: float
    speed: FloatArray
    energy: FloatArray
    room: FloatArray
    extent: FloatArray
    valid: BoolArray
    dimensions: int
    axes: int = 3

    @property
    def times(self) -> FloatArray:
        """(T,) seconds from the motion's first frame."""
        return np.arange(self.speed.size) / self.fps


@dataclass(frozen=True, eq=False)
class ShapeSignal:
    """Shape speed over one stretch of time, brought to mean 0 and SD 1, and three numbers that say how much it was.

    Its slow drift, over 1 s and more, is taken off: it belongs to the choreography, not to the beat.

    Parameters
    ----------
    times : (T,) array, seconds
    values : (T,) array
        The signal: mean 0 and SD 1 over the valid samples; 0 throughout where nothing moves.
    valid : (T,) bool array
        False on filler frames.
    pulse : float, per second
        How strongly the movement swells and fades: `swing` over the size of the body. NaN for one point that moves,
        which has no size.
    share : float
        Movement inside the body over movement in the room, both as root mean square: 0 for a statue on a turntable.
        NaN where nothing moves.
    joints : float
        Share of the joints that do the work: 1 where all move alike, 1 / J where one of J joints does everything.
    dimensions, axes : int
        As in `ShapeSpeed`.
    swing : float, units per second
        SD of the shape speed without its drift.
    """

    times: FloatArray
    values: FloatArray
    valid: BoolArray
    pulse: float
    share: float
    joints: float
    dimensions: int
    axes: int = 3
    swing: float = np.nan


def shape_speed(motion: Motion, *, smoothing: float = SMOOTHING) -> ShapeSpeed:
    """Speed of the shape of a body, at 100 hertz, or at the motion's own rate if that is higher.

    In space it is computed in four steps:

    1. X: the joints of each frame, less their mean, are turned back about the vertical. The turn from one frame to the
       next is ``atan2(sum cross(X(t-1), X(t)), sum dot(X(t-1), X(t)))``, sums over the joints seen from above. This is
       done at the motion's own rate, before anything is interpolated.
    2. X is interpolated by cubic splines and smoothed. W is its velocity.
    3. Of the velocity the rotation w of the whole body that fits it best is taken off: ``Z = W - w x X``.
    4. The shape speed is ``sqrt(mean |Z|^2)``, mean over the joints.

    In a picture (2-D) nothing is turned back, and the 2 x 2 matrix A that fits best takes the place of the rotation:
    ``Z = W - A X``. Of fewer than three joints the speed in the room is taken.

    Parameters
    ----------
    motion : Motion
        A joint that jumps away for a single frame is put back first (`without_glitches`). J is less than the motion's
        where fingers are left out (`without_fingers`).
    smoothing : float, seconds
        Standard deviation of the Gaussian over the positions.

    Returns
    -------
    ShapeSpeed

    Examples
    --------
    >>> from harmolab.types import Skeleton
    >>> body = np.array([[0.0, 0.0, 0.2], [0.3, 1.0, 0.0], [-0.3, 1.0, 0.0], [0.0, 1.7, 0.1]])
    >>> angle = np.linspace(0, 9, 200)[:, None]
    >>> x, y, z = body[:, 0], np.broadcast_to(body[:, 1], (200, 4)), body[:, 2]
    >>> turned = np.stack([x * np.cos(angle) + z * np.sin(angle), y, z * np.cos(angle) - x * np.sin(angle)], axis=-1)
    >>> statue = shape_speed(Motion(turned, 30.0, Skeleton.unnamed(4)))
    >>> bool(statue.speed.max() < 1e-9 * np.sqrt(statue.room.max()))
    True
    """
    speeds = _speeds.setdefault(motion, {})
    if smoothing not in speeds:
        speeds[smoothing] = _shape_speed(motion, smoothing)
    return speeds[smoothing]


def _shape_speed(motion: Motion, smoothing: float) -> ShapeSpeed:
    """The `shape_speed` of a motion, computed; its arrays are read-only, since they are shared."""
    motion = without_glitches(without_fingers(motion))
    fine = upsample_motion(motion, RATE)
    dimensions = motion.positions.shape[2] if motion.positions.shape[1] >= FEWEST else 0
    step = 1 / fine.fps  # velocities are central differences, one-sided at the ends
    room = inner = np.gradient(smooth_positions(fine.positions, smoothing, fine.fps), step, axis=0)
    shape = _centred(fine.positions)
    if dimensions == 3:
        unturned = replace(motion, positions=unturn(motion.positions))
        shape = smooth_positions(upsample_motion(unturned, RATE).positions, smoothing, fine.fps)
        inner = _without_rotation(_centred(shape), _centred(np.gradient(shape, step, axis=0)))
    elif dimensions == 2:
        shape = smooth_positions(shape, smoothing, fine.fps)
        inner = _without_affine(shape, _centred(room))
    energy = np.einsum("tjd,tjd->tj", inner, inner)
    arrays = {
        "speed": np.sqrt(energy.mean(axis=1)),
        "energy": energy,
        "room": np.einsum("tjd,tjd->tj", room, room).mean(axis=1),
        "extent": np.sqrt(np.einsum("tjd,tjd->tj", shape, shape).mean(axis=1)),
        "valid": fine.valid,
    }
    for array in arrays.values():
        array.setflags(write=False)
    return ShapeSpeed(fps=fine.fps, dimensions=dimensions, axes=motion.positions.shape[2], **arrays)


def without_fingers(motion: Motion) -> Motion:
    """The motion without the joints of fingers, told by their names, where these are more than a third of all.

    Rigs have 15 to 20 of them on each hand. All joints count alike, so the hands would outvote the body.
    """
    names = [name.lower() for name in motion.skeleton.joints]
    body = [joint for joint, name in enumerate(names) if "foot" in name or not any(word in name for word in FINGERS)]
    if not BODY <= len(body) < 2 / 3 * len(names):
        return motion
    return replace(motion, positions=motion.positions[:, body], skeleton=skeleton_part(motion.skeleton, body))


def without_glitches(motion: Motion) -> Motion:
    """The motion with each joint that jumps away for a single frame at the median of its three frames.

    Left and right swapped for a frame, or a joint taken for another one, are steps that no body makes: further than a
    quarter of the body's size from the frames beside it, which lie close together, and faster than a limb turns back.
    Bodies of three joints up.
    """
    if motion.positions.shape[1] < FEWEST or len(motion.positions) < 3:
        return motion
    positions = _centred(motion.positions)
    before, after = positions[:-2], positions[2:]
    middle = np.clip(positions[1:-1], np.minimum(before, after), np.maximum(before, after))
    middle = np.concatenate([middle[:1], middle, middle[-1:]])
    away = np.linalg.norm(positions - middle, axis=-1)
    ends = np.linalg.norm(np.diff(positions[[1, 2, -3, -2]], axis=0)[[0, 2]], axis=-1)
    beside = np.concatenate([ends[:1], np.linalg.norm(after - before, axis=-1), ends[1:]])
    size = np.median(np.sqrt(np.square(positions).sum(axis=-1).mean(axis=-1)))
    wrong = (away > max(GLITCH, FASTEST_TURN / motion.fps**2) * size) & (beside < away / 2)
    wrong &= ~_is_turn(positions)[:, None]
    if not wrong.any():
        return motion
    return replace(motion, positions=motion.positions + np.where(wrong[..., None], middle - positions, 0.0))


def _is_turn(positions: FloatArray) -> BoolArray:
    """(T,) True for frames that are the frame beside them turned as one piece, to a tenth: a turn is no glitch."""
    if positions.shape[2] != 3:
        return np.zeros(len(positions), bool)
    before = np.concatenate([positions[1:2], positions[:-1]])
    cross, dot = _turn_sums(before, positions)
    moved = np.square(positions - before).sum(axis=(1, 2))
    # Least squares: what the best turn about the vertical leaves of the squared distances.
    return np.asarray(moved + 2 * (dot - np.hypot(cross, dot)) <= 0.01 * moved)


def _turn_sums(before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(T,) sums of cross and dot products of (T, J, 3) joints seen from above: the turn from one to the other."""
    (x0, z0), (x1, z1) = ((each[..., 0], each[..., 2]) for each in (before, after))
    return (z0 * x1 - x0 * z1).sum(axis=1), (x0 * x1 + z0 * z1).sum(axis=1)


def unturn(positions: FloatArray) -> FloatArray:
    """Joints (T, J, 3) around their mean, turned back about the vertical: constant for a rigid body that only turns.

    Frame by frame the turn is the one that brings the joints closest to where they were (least squares).
    """
    centred = _centred(positions)
    x, z = centred[..., 0], centred[..., 2]
    angle = np.concatenate([[0.0], np.cumsum(np.arctan2(*_turn_sums(centred[:-1], centred[1:])))])[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * x - sin * z, centred[..., 1], sin * x + cos * z], axis=-1)


def _centred(positions: FloatArray) -> FloatArray:
    return positions - np.einsum("tjd->td", positions)[:, None] / positions.shape[1]


def _without_rotation(shape: FloatArray, velocity: FloatArray) -> FloatArray:
    """Velocities (T, J, 3) less those of the rotation w that fits best: ``(sum |X|^2 I - X X^T) w = sum X x W``."""
    outer = np.einsum("tja,tjb->tab", shape, shape)
    trace = np.trace(outer, axis1=1, axis2=2)
    inertia = trace[:, None, None] * np.eye(3) - outer
    inertia += np.maximum(2 * RIDGE * trace, np.finfo(float).tiny)[:, None, None] * np.eye(3)
    rotation = np.linalg.solve(inertia, _cross(shape, velocity).sum(axis=1)[..., None])[..., 0]
    return velocity - _cross(rotation[:, None], shape)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (..., 3), in half the time of `numpy.cross`."""
    (x0, y0, z0), (x1, y1, z1) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1], axis=-1)


def _without_affine(shape: FloatArray, velocity: FloatArray) -> FloatArray:
    """Velocities (T, J, 2) less those of the 2 x 2 matrix A that fits them best, ``W = A X``."""
    outer = np.einsum("tja,tjb->tab", shape, shape)
    ridge = np.maximum(RIDGE * np.trace(outer, axis1=1, axis2=2), np.finfo(float).tiny)
    matrix = np.linalg.solve(outer + ridge[:, None, None] * np.eye(2), np.einsum("tja,tjb->tab", shape, velocity))
    return velocity - np.einsum("tja,tab->tjb", shape, matrix)


def shape_signal(shape: ShapeSpeed, start: float = 0.0, end: float = np.inf) -> ShapeSignal:
    """The signal from second `start` to second `end`: nothing before or after has any part in it.

    All is 0, and the share NaN, where nothing moves or fewer than two valid samples lie between.
    """
    inside = slice(*np.searchsorted(shape.times, [start - ROUNDING, end + ROUNDING]))
    speed, valid, times = shape.speed[inside], shape.valid[inside], shape.times[inside]
    room = float(shape.room[inside][valid].mean()) if valid.sum() > 1 else 0.0
    if room == 0:
        return ShapeSignal(times, np.zeros_like(speed), valid, 0.0, np.nan, 0.0, shape.dimensions, shape.axes, 0.0)
    rest = speed - gaussian_filter1d(speed, DRIFT * shape.fps, mode="nearest")
    spread, by_joint = float(rest[valid].std()), shape.energy[inside][valid].mean(axis=0)
    is_still = spread <= 1e-9 * np.sqrt(room)
    values = np.zeros_like(rest) if is_still else (rest - rest[valid].mean()) / spread
    size = float(np.median(shape.extent[inside][valid]))
    of_a_point = 0.0 if is_still else np.nan  # which has no size: its pulse is not known, unless it rests
    pulse = spread / size if size > 0 else of_a_point
    share, squares = float(np.sqrt(by_joint.mean() / room)), by_joint.size * np.square(by_joint).sum()
    joints = float(by_joint.sum() ** 2 / squares) if squares else 0.0
    return ShapeSignal(times, values, valid, pulse, share, joints, shape.dimensions, shape.axes, spread)
