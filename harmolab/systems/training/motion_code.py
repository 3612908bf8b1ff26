"""Motion code of the models: root-relative poses in a canonical heading, and the root's own path as channels.

A code has C = 3 J + 3 channels, frame by frame:

=============  =======================================================================================================
0 ... 3 J - 1  joints x, y, z in metres: x and z from the root, y from the floor, turned so that the dancer faces +z
3 J, 3 J + 1   velocity of the root to the dancer's left and forward, metres per second, in the heading of that frame
3 J + 2        yaw rate, radians per second; positive turns to the dancer's left (from +z towards +x)
=============  =======================================================================================================

Rates at frame t describe the step from t - 1 to t; those of frame 0 repeat frame 1. Heading 0 faces +z, heading
pi / 2 faces +x: a pose that faces heading a is the canonical one turned by a about the y axis.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton, heading, root_position, tree_order, turned
from harmolab.types import FloatArray, Motion, SingleArray


def n_channels(skeleton: Skeleton) -> int:
    """Channels C of a motion code: three a joint and three of the root's path."""
    return 3 * len(skeleton.joints) + 3


def encode_motion(positions: FloatArray, fps: float, skeleton: Skeleton) -> SingleArray:
    """The motion code of joint positions: poses in a canonical heading, and the root's path as rates.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up
    fps : float, hertz
    skeleton : Skeleton
        The heading comes from the left and right joints of hips and shoulders, by their names; without such names
        it is 0 throughout. The root is the first joint without parent; without bones, the mean of all joints.

    Returns
    -------
    (T, 3 J + 3) array, single precision; see the table above

    Raises
    ------
    ValueError
        If the shape does not fit the skeleton, or fps is not positive.
    """
    check_fps(fps)
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 3 or positions.shape[1:] != (len(skeleton.joints), 3) or not len(positions):
        expected = f"(frames, {len(skeleton.joints)}, 3)"
        raise ValueError(f"positions must be {expected} for this skeleton, got shape {positions.shape}")
    path = np.insert(root_path(positions, fps, skeleton), 1, 0.0, axis=1)  # x, 0, z, heading
    facing = path[:, 3]
    local = turned(positions - path[:, None, :3], -facing[:, None])
    steps = np.diff(path, axis=0)
    steps[:, :3] = turned(steps[:, :3], -facing[1:])
    rates = np.concatenate([steps[:1], steps])[:, [0, 2, 3]] * fps if len(steps) else np.zeros((1, 3))
    return np.concatenate([local.reshape(len(local), -1), rates], axis=1).astype(np.float32)


def coded(motion: Motion, fps: float) -> SingleArray:
    """The motion code of a whole motion, at another frame rate."""
    motion = resample_motion(motion, fps)
    return encode_motion(motion.positions, motion.fps, motion.skeleton)


def decode_motion(
    code: ArrayLike, fps: float, skeleton: Skeleton, *, start: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> FloatArray:
    """The joint positions that a motion code stands for; `encode_motion` backwards.

    Parameters
    ----------
    code : (T, 3 J + 3) array
    fps : float, hertz
    skeleton : Skeleton
    start : (x, z, heading) of the root at frame 0: metres, metres, radians; a row of `root_path`

    Returns
    -------
    (T, J, 3) array, metres

    Raises
    ------
    ValueError
        If the shape does not fit the skeleton, or fps is not positive.
    """
    code = np.asarray(code, dtype=np.float64)
    if code.ndim != 2 or code.shape[1] != n_channels(skeleton):
        raise ValueError(f"code must be (frames, {n_channels(skeleton)}) for this skeleton, got shape {code.shape}")
    check_fps(fps)
    steps = code[:, -3:] / fps
    steps[:1] = 0.0
    facing = start[2] + np.cumsum(steps[:, 2])
    path = np.array([start[0], 0.0, start[1]]) + np.cumsum(turned(np.insert(steps[:, :2], 1, 0.0, axis=1), facing), 0)
    return turned(code[:, :-3].reshape(len(code), -1, 3), facing[:, None]) + path[:, None]


def root_path(positions: FloatArray, fps: float, skeleton: Skeleton) -> FloatArray:
    """Root x, root z (metres) and heading (radians, without jumps) of every frame, as `encode_motion` takes them.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up
    fps : float, hertz
    skeleton : Skeleton

    Returns
    -------
    (T, 3) array; a row is a `start` of `decode_motion`
    """
    return np.column_stack([root_position(positions, skeleton)[:, [0, 2]], heading(positions, fps, skeleton)])


def bone_lengths(positions: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Mean length of the bone from each joint to its parent, (J,) array in metres; 0 where there is no parent.

    Parameters
    ----------
    positions : (T, J, 3) array, metres
    """
    parents = np.array(skeleton.parents)
    lengths = np.linalg.norm(positions - positions[:, np.where(parents < 0, 0, parents)], axis=2).mean(axis=0)
    return np.where(parents < 0, 0.0, lengths)


def fixed_bones(positions: FloatArray, parents: Sequence[int], lengths: FloatArray) -> FloatArray:
    """Positions (T, J, 3) with every joint moved along its bone until that has its length (J,); directions stay.

    Roots stay, and lengths of roots are not read. The same as `harmolab.systems.training.layers.fix_bones`, but for
    bones of no length, which stay as they are.
    """
    fixed = np.array(positions, dtype=np.float64)
    for joint in tree_order(parents):
        parent = parents[joint]
        if parent >= 0:
            bone = positions[:, joint] - positions[:, parent]
            length = np.linalg.norm(bone, axis=1, keepdims=True)
            fixed[:, joint] = fixed[:, parent] + bone * (lengths[joint] / np.where(length > 0, length, np.inf))
    return fixed


def frames_at(values: NDArray[Any], places: FloatArray) -> FloatArray:
    """Values (T, C) at frame numbers (K,) that may lie between frames, linearly interpolated: (K, C) array."""
    before = np.minimum(places.astype(np.int64), max(len(values) - 2, 0))
    after = np.minimum(before + 1, len(values) - 1)
    return values[before] + (places - before)[:, None] * (values[after] - values[before])


def check_fps(fps: float) -> None:
    """ValueError for a rate that is none."""
    if not 0 < fps < np.inf:
        raise ValueError(f"fps must be positive and finite, got {fps}")


# Borders between generated pieces: the end of one fades into the next, nothing jumps.

FADE = 0.25  # seconds after which a tenth of a difference is left
# Solution of (1 + a) exp(-a) = 0.1: a critically damped fade has then come down to a tenth.
_TENTH = 3.8897


def continued(past: FloatArray, new: FloatArray, fps: float, *, fade: float = FADE) -> FloatArray:
    """The piece `new` changed so that it goes on from the end of `past` without a jump in place or velocity.

    The difference in place and velocity at the border is carried into the new piece and fades like a critically damped
    spring ("inertialisation", Bollo 2018). A cross-fade would need both pieces at the same time, and slows or speeds
    the movement up at the border, which lies on a beat.

    Parameters
    ----------
    past : (P, C) array, at least one frame
    new : (T, C) array, the frames that follow
    fps : float, hertz
    fade : float, seconds
        After this a tenth of the difference in place is left.

    Returns
    -------
    (T, C) array
    """
    before = 2 * new[0] - new[1] if len(new) > 1 else new[0]  # where the new piece would have come from
    off = past[-1] - before
    faster = (past[-1] - past[-2]) - (new[0] - before) if len(past) > 1 else np.zeros_like(off)
    rate = _TENTH / (fade * fps)
    steps = np.arange(1, len(new) + 1)[:, None]
    return new + (off + (faster + rate * off) * steps) * np.exp(-rate * steps)
