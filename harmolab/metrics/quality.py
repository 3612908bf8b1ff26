"""Naturalness of a motion, music aside: jerk, freezing, sliding feet, contact with the floor, bones, jumps.

All is measured over *steps* of a fixed time, 1/15 s unless another is passed, and not from one frame to the next. So
the numbers hardly depend on the frame rate. (At 15 frames per second nearly a fifth of the jerk of a movement at 3 Hz
is gone that is there at 60.) A motion without a whole number of frames a step is brought to the next rate that has one
by cubic splines. Nothing depends on where in the room the dancer is. Steps over frames that are not `Motion.valid` do
not count.

A single number says little: compare it with that of recorded dancers.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from harmolab.body.kinematics import upsample_motion
from harmolab.body.skeletons import foot_joints, root_position
from harmolab.types import BoolArray, FloatArray, Motion, check_kind

STEP = 1 / 15  # seconds: the rate of the generated motion, the slowest that is compared
STILL, WINDOW = 0.1, 1.0  # metres per second below which a body stands still, seconds that this lasts
ON_FLOOR = 0.02  # metres above its own lowest height at which a joint of a foot still stands
FOOT_FPS = 60.0  # hertz; at fewer instants a foot's coming and going is missed
FLOOR_PERCENTILE = 5.0  # a foot joint is on the floor for more than this share of a dance, in percent
SHORTEST_BONE = 1e-6  # metres; joints nearer than this are one point, not a bone
NO_PUSH = 1e-6  # metres per second squared; what rounding leaves of a root that does not accelerate
PEAK_PERCENTILE = 99.9


@dataclass(frozen=True)
class StepSpeeds:
    """Speeds of the fastest joint, metres per second.

    Parameters
    ----------
    largest : float
        The fastest step of any joint.
    percentile_999 : float
        The speed that one step of a joint in a thousand exceeds.
    """

    largest: float
    percentile_999: float


def jerk(motion: Motion, *, step: float = STEP) -> float:
    """Jerk of a body: the mean rate at which the acceleration of its joints changes, m/s³.

    It is ``|p(t + 3s) - 3 p(t + 2s) + 3 p(t + s) - p(t)| / s^3``, mean over time and joints; p are the positions, and s
    is the step.

    Parameters
    ----------
    motion : Motion, three-dimensional, metres
    step : float, seconds
        Shorter steps find faster trembling, but need the frames for it: below 1 / fps the interpolation is measured.

    Returns
    -------
    float; 0 where every joint moves with constant acceleration

    Raises
    ------
    ValueError
        If the motion is two-dimensional, shorter than three steps or nowhere valid for as long, or if step is not
        positive.
    """
    positions, valid, stride = sampled(motion, step, steps=3)
    first, second, third, fourth = (positions[i * stride : len(positions) + (i - 3) * stride] for i in range(4))
    change = fourth - 3 * third + 3 * second - first
    return float(vector_lengths(change)[spans(valid, 3 * stride)].mean()) / step**3


def relative_jerk(motion: Motion, *, step: float = STEP) -> float:
    """`jerk` per mean joint speed, 1 / seconds squared: trembling is large here, mere liveliness is not.

    A joint that swings at f hertz has (2 pi f)^2, however wide it swings.

    Returns
    -------
    float; 0 when nothing moves

    Raises
    ------
    ValueError
        As `jerk`.
    """
    speed = float(_speeds(motion, step).mean())
    return jerk(motion, step=step) / speed if speed else 0.0


def freezing(motion: Motion, *, step: float = STEP) -> float:
    """Share of all windows of one second throughout which the dancer stands still.

    Still is when the mean speed of the joints is below 0.1 metres per second. A pose that glides through the room is
    not still: `foot_skating` finds it. Windows of which less than half is valid do not count.

    Parameters
    ----------
    motion : Motion, three-dimensional; a motion shorter than a second is one window
    step : float, seconds

    Returns
    -------
    float in [0, 1]

    Raises
    ------
    ValueError
        If the motion is two-dimensional, shorter than a step or nowhere valid for half a window, or if the step is not
        positive.
    """
    positions, valid, stride = sampled(motion, step, steps=1)
    moving = vector_lengths(positions[stride:] - positions[:-stride]).mean(axis=1) / step >= STILL
    length = min(max(round(WINDOW / step * stride) - stride + 1, 1), len(moving))
    complete = spans(valid, stride)
    # A recording that is spliced every second would have no window left if a window had to be valid throughout.
    usable = np.convolve(complete, np.ones(length), "valid") >= length / 2
    if not usable.any():
        raise ValueError(f"no window of {WINDOW:g} s is valid for half of its time")
    return float(runs(~moving | ~complete, length)[usable].mean())


def foot_skating(motion: Motion, *, step: float = STEP) -> float:
    """Sliding of the feet: their mean speed along the floor while they are on it, metres per second.

    A joint of a foot is on the floor where it is at most 2 cm above its own resting height (the 5th percentile of
    its heights) at both ends of a step. Of these joints of a foot the slowest counts: a turn on the ball of the
    foot is no sliding, nor is rolling over the toes. Dancers do slide, in ballroom dances all the time: compare the
    number with that of recordings.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        On a level floor; feet are found by the names of joints (toe, heel, ankle, foot).
    step : float, seconds
        Time over which the speed is measured.

    Returns
    -------
    float; mean over all steps of all feet on the floor, 0 where there are none

    Raises
    ------
    ValueError
        If no joint is called toe, heel, ankle or foot; else as `freezing`.
    """
    positions, valid, stride = sampled(motion, step, steps=1, fps=FOOT_FPS)
    feet = foot_joints(motion.skeleton)
    low = positions[..., 1] <= np.percentile(positions[valid, :, 1], FLOOR_PERCENTILE, axis=0) + ON_FLOOR
    steps = positions[stride:] - positions[:-stride]
    slide = np.hypot(steps[..., 0], steps[..., 2]) / step
    slide = np.where(low[stride:] & low[:-stride], slide, np.inf)[spans(valid, stride)]
    speeds = np.stack([slide[:, joints].min(axis=1) for joints in feet])
    on_floor = np.isfinite(speeds)
    return float(speeds[on_floor].mean()) if on_floor.any() else 0.0


def pfc(motion: Motion, *, step: float = STEP) -> float:
    """Physical foot contact score (Tseng et al. 2023, EDGE), square metres per second squared; lower is better.

    The mean over time of (slowest joint of the left foot) * (slowest joint of the right foot) * (acceleration of the
    root) / (its largest): a body that accelerates must push with a foot that stands. Foot speeds are horizontal; of the
    root's vertical acceleration only the upward part counts.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        The root is the first joint without parent; without any bone, the mean of all joints.
    step : float, seconds
        EDGE's own code takes frames at 30 per second, leaves foot speeds in metres per frame and multiplies by 10^4:
        its scores are 10^4 / 30^2 times those of ``step=1 / 30``.

    Returns
    -------
    float; 0 when the root does not accelerate

    Raises
    ------
    ValueError
        If no joint of a left and of a right foot is found by name, or as `jerk` (two steps).
    """
    feet = foot_joints(motion.skeleton)
    if len(feet) != 2:
        raise ValueError(f"two feet are needed, named left and right; joints are {motion.skeleton.joints}")
    positions, valid, stride = sampled(motion, step, steps=2)
    root = root_position(positions, motion.skeleton)
    push = (root[2 * stride :] - 2 * root[stride:-stride] + root[: -2 * stride]) / step**2
    push[:, 1] = np.maximum(push[:, 1], 0.0)
    strength = np.linalg.norm(push, axis=1)
    steps = positions[2 * stride :] - positions[stride:-stride]
    slide = np.hypot(steps[..., 0], steps[..., 2]) / step
    left, right = (slide[:, joints].min(axis=1) for joints in feet)
    usable = spans(valid, 2 * stride)
    peak = strength[usable].max()
    return float((left * right * strength)[usable].mean() / peak) if peak > NO_PUSH else 0.0


def bone_error(motion: Motion, lengths: ArrayLike | None = None) -> float:
    """Largest relative deviation of any bone in any valid frame from its reference length: 0.05 is 5 %.

    Parameters
    ----------
    motion : Motion
        Joints with a parent have a bone.
    lengths : (J,) array, metres, optional
        Reference length of the bone from each joint to its parent; 0 leaves a bone out. The motion's own means when
        not given.

    Raises
    ------
    ValueError
        If the skeleton has no bones, or `lengths` does not fit it, is negative, not finite or 0 throughout, or if no
        frame is valid.
    """
    if not motion.skeleton.bones:
        raise ValueError("bone_error needs a skeleton with bones, this one has no parents")
    if not motion.valid.any():
        raise ValueError("no frame of the motion is valid")
    parents, joints = np.array(motion.skeleton.bones).T
    positions = motion.positions[motion.valid]
    measured = vector_lengths(positions[:, joints] - positions[:, parents])
    reference = measured.mean(axis=0) if lengths is None else _reference_lengths(lengths, motion)[joints]
    bones = reference > SHORTEST_BONE
    if not bones.any():
        raise ValueError("no bone has a reference length above zero")
    return float(np.abs(measured[:, bones] / reference[bones] - 1).max())


def largest_step(motion: Motion, *, step: float = STEP) -> StepSpeeds:
    """The fastest step of any joint, and the speed that one in a thousand exceeds: a jump is far above the latter.

    Raises
    ------
    ValueError
        As `freezing`.
    """
    speeds = _speeds(motion, step)
    return StepSpeeds(float(speeds.max()), float(np.percentile(speeds, PEAK_PERCENTILE)))


def or_nan(measure: Callable[[Motion], float], motion: Motion) -> float:
    """A measure of a motion; NaN where it raises ValueError: the motion does not have what the measure needs."""
    try:
        return measure(motion)
    except ValueError:
        return math.nan


def _speeds(motion: Motion, step: float) -> FloatArray:
    """Speed of every joint over every valid step, (S, J), metres per second."""
    positions, valid, stride = sampled(motion, step, steps=1)
    return vector_lengths(positions[stride:] - positions[:-stride])[spans(valid, stride)] / step


def _reference_lengths(lengths: ArrayLike, motion: Motion) -> FloatArray:
    reference = np.asarray(lengths, dtype=np.float64)
    if reference.shape != (len(motion.skeleton.joints),):
        raise ValueError(f"lengths must be one per joint ({len(motion.skeleton.joints)}), got shape {reference.shape}")
    if not (np.isfinite(reference) & (reference >= 0)).all():
        raise ValueError(f"lengths must be finite and not negative, got {reference.min()}")
    return reference


class Sampled(NamedTuple):
    """A motion with a whole number of frames a step: (T, J, 3) positions, (T,) validity, frames a step."""

    positions: FloatArray
    valid: BoolArray
    stride: int


def sampled(motion: Motion, step: float, *, steps: int, fps: float = 0.0) -> Sampled:
    """`motion` at the lowest rate that loses no frames and has a whole number of them a step, by cubic splines.

    Parameters
    ----------
    motion : Motion
    step : float, seconds
    steps : int
        Number of steps in a row that are needed.
    fps : float, hertz
        The rate is at least this.

    Raises
    ------
    ValueError
        If the motion is two-dimensional, `steps` steps of `step` seconds fit nowhere into its valid frames, or step is
        not positive.
    """
    check_kind(motion, Motion)
    if motion.positions.shape[2] != 3:
        raise ValueError("a three-dimensional motion is needed: metres, y up")
    if not 0 < step < math.inf:
        raise ValueError(f"step must be positive, got {step}")
    stride = max(1, math.ceil(max(motion.fps, fps) * step - 1e-6))
    if (motion.n_frames - 1) / motion.fps < steps * step - 1e-9:
        raise ValueError(f"the motion lasts {motion.duration:.3f} s, too short for {steps} steps of {step:.3f} s")
    dense = upsample_motion(motion, stride / step)
    if not spans(dense.valid, steps * stride).any():
        raise ValueError(f"the motion is nowhere valid for {steps} steps of {step:.3f} s")
    return Sampled(dense.positions, dense.valid, stride)


def vector_lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of (T, J, 3) vectors, (T, J)."""
    return np.sqrt(np.einsum("tjd,tjd->tj", vectors, vectors))


def spans(valid: BoolArray, steps: int) -> BoolArray:
    """True for spans of `steps` frame steps that hold valid frames only, by the frame they start at."""
    return runs(valid, steps + 1)


def runs(flags: BoolArray, length: int) -> BoolArray:
    """True at places where `length` flags in a row are set, (len(flags) - length + 1,); empty if there are too few."""
    total = np.concatenate([[0], np.cumsum(flags)])
    return total[length:] - total[: max(len(total) - length, 0)] == length
