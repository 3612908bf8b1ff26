"""Functions on arrays of joint positions: joint speed (Eq. 7), turning points (Eq. 8-9), resampling.

They take and return plain arrays. Times are numbers of frames only here, in names that end in ``_frames``.

Symbols of the paper: v_s(t, i) is the velocity of joint i at frame t, J_v(t) the sum over the joints (Eq. 7), d~(t) the
sign of the change of J_v (Eq. 8), and B~_v(t) is 1 at the frames where that sign turns (Eq. 9).
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import body_frame
from harmolab.types import FloatArray, IntArray, Motion

# A step smaller than this share of the curve's maximum counts as a tie (docs/readings.md, Eq. 8-9).
TIE_TOLERANCE = 1e-6
MAX_VALUES = 200_000_000  # of a motion at a higher rate: 1.6 GB, four hours of 38 joints at 120 hertz
NANOMETRE = 9  # decimals of a metre
ROUNDING = 1e-12  # 1 - cos below this is a straight line


def joint_speed(positions: FloatArray, fps: float = 1.0, *, reading: str = "norm") -> FloatArray:
    """Joint speed J_v(t): the sum of the velocities of all joints, frame by frame (paper Eq. 7).

    Parameters
    ----------
    positions : (T, J, D) array
    fps : float, hertz
        With 1.0 the result is in units per frame, else in units per second.
    reading : "norm", "signed" or "norm_of_sum"
        Sum of the lengths (L2 norms) of the joints' velocities (paper mode), sum over joints and axes with its sign, or
        length of the summed velocity.

    Returns
    -------
    (T,) array; the first frame repeats the second, since Eq. 7 does not define it.
    """
    steps = np.diff(positions, axis=0)
    if reading == "norm":
        speed = np.sqrt(np.einsum("tjd,tjd->tj", steps, steps)).sum(axis=1)
    elif reading == "signed":
        speed = steps.sum(axis=(1, 2))
    elif reading == "norm_of_sum":
        speed = np.linalg.norm(steps.sum(axis=1), axis=1)
    else:
        raise ValueError(f"reading must be norm, signed or norm_of_sum, got {reading!r}")
    return np.concatenate([speed[:1], speed]) * fps


def direction_spread(positions: FloatArray) -> FloatArray:
    """Motion SD: how much the joints' directions of movement differ from one frame to the next (Yalta et al. 2019).

    For each joint the unit vector of its movement is compared with the one before; the result is the standard
    deviation over joints of that change of direction. Joints at rest count as not turning.

    Returns
    -------
    (T,) array; the first two frames repeat the third.
    """
    steps = np.diff(positions, axis=0)
    length = np.linalg.norm(steps, axis=2, keepdims=True)
    still = length <= TIE_TOLERANCE * length.max(initial=0.0)
    unit = np.where(still, 0.0, steps / np.where(still, 1.0, length))
    turn = np.where((still[1:] | still[:-1])[..., 0], 0.0, 1.0 - np.einsum("tjd,tjd->tj", unit[1:], unit[:-1]))
    turn = np.where(turn < ROUNDING, 0.0, turn)
    spread = turn.std(axis=1) if len(turn) else np.zeros(1)
    return np.concatenate([spread[:1], spread[:1], spread])[: len(positions)]


def smooth(curve: FloatArray, sigma: float, fps: float) -> FloatArray:
    """`curve` (T, ...) smoothed along time by a Gaussian of `sigma` seconds; unchanged when `sigma` is 0."""
    if sigma == 0:
        return curve
    return gaussian_filter1d(curve, sigma * fps, axis=0, mode="nearest")


def smooth_positions(positions: FloatArray, sigma: float, fps: float) -> FloatArray:
    """Joint positions (T, J, D) smoothed along time by a Gaussian of `sigma` seconds; unchanged when `sigma` is 0.

    Beyond its ends the motion is taken to go on as it came (a point reflection), so that there is no stop.
    """
    if sigma == 0:
        return positions
    reach = min(int(4 * sigma * fps) + 1, len(positions) - 1)
    padded = np.pad(positions, ((reach, reach), (0, 0), (0, 0)), mode="reflect", reflect_type="odd")
    return smooth(padded, sigma, fps)[reach : reach + len(positions)]


def step_signs(curve: FloatArray, *, carry: bool = True) -> IntArray:
    """Signs d~(t) of the steps of a curve (T,) from each sample to the next: (T - 1,) of -1, 0 and 1 (Eq. 8).

    A step of a millionth of the largest value or less is a tie, of sign 0; with `carry` it takes the sign before it.
    """
    steps = np.diff(curve)
    signs = np.sign(np.where(np.abs(steps) <= TIE_TOLERANCE * np.abs(curve).max(initial=0.0), 0.0, steps))
    if carry and signs.size:
        last_frames = np.maximum.accumulate(np.where(signs != 0, np.arange(signs.size), 0))
        signs = signs[last_frames]
    return signs.astype(np.int64)


def turning_points(curve: FloatArray, *, plateau: str = "last") -> IntArray:
    """Frames at which the curve turns from rising to falling or back (Eq. 8-9).

    Parameters
    ----------
    curve : (T,) array
    plateau : "last", "middle" or "literal"
        A flat top is one turning point, at its last or middle sample; "literal" follows Eq. 9 and misses it.

    Examples
    --------
    >>> turning_points(np.array([0.0, 1.0, 0.0, 2.0]))
    array([1, 2])
    """
    signs = step_signs(curve, carry=plateau != "literal")
    turns = np.flatnonzero(signs[:-1] * signs[1:] < 0) + 1
    if plateau == "middle":
        steps = np.arange(signs.size)
        # The last step up to each that is no tie: at its end a flat top starts.
        slopes = np.maximum.accumulate(np.where(step_signs(curve, carry=False) == 0, -1, steps))
        return (slopes[turns - 1] + 1 + turns) // 2
    if plateau not in ("last", "literal"):
        raise ValueError(f"plateau must be last, middle or literal, got {plateau!r}")
    return turns


def valley_frames(curve: FloatArray, *, plateau: str = "last") -> IntArray:
    """The turning points at which the curve stops falling.

    >>> valley_frames(np.array([2.0, 0.0, 0.0, 0.0, 2.0]), plateau="middle")
    array([2])
    """
    return _turns_into(1, curve, plateau)


def peak_frames(curve: FloatArray, *, plateau: str = "last") -> IntArray:
    """The turning points at which the curve stops rising."""
    return _turns_into(-1, curve, plateau)


def _turns_into(sign: int, curve: FloatArray, plateau: str) -> IntArray:
    """The turning points after which the steps have this sign."""
    turns = turning_points(curve, plateau=plateau)
    # After the middle of a flat top comes a tie: where the curve goes is known at the top's last sample.
    return turns[step_signs(curve)[turning_points(curve) if plateau == "middle" else turns] == sign]


def refine_extrema(curve: FloatArray, frames: IntArray) -> FloatArray:
    """Places of extrema between samples: the top of the parabola through each frame and its two neighbours.

    Returns
    -------
    (B,) array of fractional frames, at most half a frame from `frames`.
    """
    before, top, after = curve[frames - 1], curve[frames], curve[frames + 1]
    bend = before - 2 * top + after
    shift = np.divide(0.5 * (before - after), bend, out=np.zeros(len(frames)), where=bend != 0)
    return frames + np.clip(shift, -0.5, 0.5)


def resample_motion(motion: Motion, fps: float) -> Motion:
    """`motion` at another rate, by `resample_positions`. A new frame is valid where both frames around it are."""
    if fps == motion.fps:
        return motion
    return _at_rate(motion, resample_positions(motion.positions, motion.fps, fps), fps)


def upsample_motion(motion: Motion, fps: float) -> Motion:
    """`motion` at `fps` at least, by `upsample_positions`; itself when it is fast enough already."""
    if motion.fps >= fps:
        return motion
    return _at_rate(motion, upsample_positions(motion.positions, motion.fps, fps), fps)


def _at_rate(motion: Motion, positions: FloatArray, fps: float) -> Motion:
    """`motion` with its positions at another rate."""
    _, left = _old_frames(len(motion.positions), motion.fps, fps)
    return replace(motion, positions=positions, fps=fps, valid=motion.valid[left] & motion.valid[left + 1])


def resample_positions(positions: FloatArray, old_fps: float, fps: float) -> FloatArray:
    """Positions (T, J, D) at another rate, by linear interpolation; nearest frames would invent beats.

    ValueError if there are no two frames at that rate, or more than `MAX_VALUES` numbers.
    """
    if fps == old_fps:
        return positions
    _check_room(positions, old_fps, fps)
    at, left = _old_frames(len(positions), old_fps, fps)
    # In this form a joint that rests stays exactly where it is.
    return positions[left] + (at - left)[:, None, None] * (positions[left + 1] - positions[left])


def upsample_positions(positions: FloatArray, old_fps: float, fps: float) -> FloatArray:
    """Positions (T, J, D) at `fps` at least, by cubic splines; the same when they are fast enough already.

    Dance holds little above 3 Hz, so a cubic through 15 frames per second finds what lies between them, and the speed
    no longer shows the frame rate. Straight lines between frames would make steps of it.

    ValueError if that would be more than `MAX_VALUES` numbers.
    """
    if old_fps >= fps:
        return positions
    _check_room(positions, old_fps, fps)
    at, _ = _old_frames(len(positions), old_fps, fps)
    # From the first pose on: a joint that rests stays at exactly 0.
    spline = make_interp_spline(np.arange(len(positions)), positions - positions[:1], k=3 if len(positions) > 3 else 1)
    return positions[:1] + spline(at)


def _check_room(positions: FloatArray, old_fps: float, fps: float) -> None:
    """ValueError where positions at `fps` would be more than `MAX_VALUES` numbers."""
    frames, joints, axes = positions.shape
    if (count := frames * fps / old_fps) * joints * axes > MAX_VALUES:
        raise ValueError(
            f"{frames} frames of {joints} joints at {old_fps:g} fps would be {count:.0f} frames at {fps:g} fps, too "
            "many; cut the motion (seconds), keep fewer joints (joints), or give its true frame rate (fps)"
        )


def _old_frames(n_frames: int, old_fps: float, fps: float) -> tuple[FloatArray, IntArray]:
    """For each frame at a new rate its place among the old frames, a fraction, and the old frame at or before it."""
    count = int(np.floor((n_frames - 1) * fps / old_fps + 1e-9)) + 1
    if count < 2:
        raise ValueError(f"a motion of {n_frames / old_fps:.3f} s has no two frames at {fps:g} fps")
    at = np.minimum(np.arange(count) * (old_fps / fps), n_frames - 1)
    return at, np.minimum(at.astype(np.int64), n_frames - 2)


def in_body(motion: Motion) -> Motion:
    """The motion as the body has it (`body_frame`): travel, jumps and turns of the whole body are taken out.

    Positions are rounded to the nanometre. Else a body that does not move would have errors of rounding, whose valleys
    would be taken for beats.
    """
    return replace(motion, positions=body_frame(motion.positions, motion.fps, motion.skeleton).round(NANOMETRE))
