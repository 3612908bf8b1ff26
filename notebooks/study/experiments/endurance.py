"""Does a dance hold for a minute, and for ten? Speed and variety of the poses, shaking, bones, jumps, the floor.

A network that dances from its own last frame may come to rest in one pose, begin to shake, or fly apart. A still pose
that glides or trembles is not frozen by the speed of its joints in the room; so speed is taken inside the body, and
smoothed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from harmolab.body.kinematics import in_body, joint_speed, smooth_positions
from harmolab.metrics.quality import bone_error, freezing, jerk, largest_step
from harmolab.types import FloatArray, Motion

SMOOTHING = 0.1  # seconds
SLOW = 0.1  # metres per second inside the body: a second that is slower throughout is still
PART = 10.0  # seconds, of which each must be as lively as dancers are
# Measure -> (lower, upper limit) and what they are multiples of, or added to: the recorded dancers' number.
LIMITS: Mapping[str, tuple[float, float, str]] = MappingProxyType(
    {
        "slowest 10 s": (0.5, np.inf, "times pose speed"),
        "fastest 10 s": (0.0, 1.5, "times pose speed"),
        "pose variance": (0.5, np.inf, "times"),
        "still": (0.0, 0.05, "more than"),
        "freezing": (0.0, 0.05, "more than"),
        "jerk": (0.0, 2.0, "times"),
        "bones": (0.0, 0.001, "at most"),
        "fastest step": (0.0, 3.0, "times 99.9th percentile"),
        "lowest joint": (-0.001, np.inf, "at least"),
    }
)


def pose_speed(motion: Motion) -> FloatArray:
    """(T,) mean speed of the joints inside the body, m/s, of positions smoothed over 0.1 s; NaN in filler."""
    body = in_body(motion)
    smoothed = smooth_positions(body.positions, SMOOTHING, body.fps)
    return np.where(body.valid, joint_speed(smoothed, body.fps) / body.positions.shape[1], np.nan)


def pose_variance(motion: Motion) -> float:
    """Variance of the joints' places inside the body, summed over joints and axes, square metres."""
    body = in_body(motion)
    return float(body.positions[body.valid].var(axis=0).sum())


def endurance(motion: Motion, lengths: FloatArray | None = None) -> dict[str, float]:
    """The measures of `LIMITS`, of one dance; "pose speed" and "99.9th percentile" beside them.

    Parameters
    ----------
    motion : Motion, three-dimensional, ten seconds or more
    lengths : (J,) metres that bones should have; their own means when left out
    """
    speed = pose_speed(motion)
    parts = [np.nanmean(part) for part in np.array_split(speed, max(1, int(motion.duration / PART)))]
    second = round(motion.fps)
    seconds = speed[: len(speed) // second * second].reshape(-1, second)
    steps = largest_step(motion)
    return {
        "pose speed": float(np.nanmean(speed)),
        "slowest 10 s": float(np.nanmin(parts)),
        "fastest 10 s": float(np.nanmax(parts)),
        "pose variance": pose_variance(motion),
        "still": float((seconds[~np.isnan(seconds).any(axis=1)].mean(axis=1) < SLOW).mean()),
        "freezing": freezing(motion),
        "jerk": jerk(motion),
        "bones": bone_error(motion, lengths),
        "fastest step": steps.largest,
        "99.9th percentile": steps.percentile_999,
        "lowest joint": float(motion.positions[..., 1].min()),
    }


def limits_of(recorded: Sequence[Mapping[str, float]]) -> dict[str, tuple[float, float]]:
    """Measure -> (least, most) for a dance, from the measures of the dancers who were recorded in its style."""
    means = {name: float(np.mean([row[name] for row in recorded])) for name in recorded[0]}
    limits = {}
    for name, (low, high, kind) in LIMITS.items():
        if kind == "more than":
            limits[name] = (low, means[name] + high)
        elif kind.startswith("at"):
            limits[name] = (low, high)
        else:
            base = means[kind.removeprefix("times ") if kind != "times" else name]
            limits[name] = (low * base, high * base)
    return limits


def passed(measures: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> dict[str, bool]:
    """Measure -> whether it lies within its limits."""
    return {name: low <= measures[name] <= high for name, (low, high) in limits.items()}
