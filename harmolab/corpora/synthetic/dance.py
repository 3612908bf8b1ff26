"""A dancer whose movement units end on planted beats, as a recorder of any frame rate would see it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from harmolab.corpora.synthetic.beats import ClipSettings, grid_through
from harmolab.corpora.synthetic.body import CHEST, DANCER, FEET, HEAD, HEADING, POSE_SIZE, RISE, joint_positions
from harmolab.corpora.synthetic.steps import Choreography, choreography
from harmolab.params import DANCES
from harmolab.types import FloatArray, Motion

MUSICAL = {"tempo", "drift", "sample_rate"}  # settings of the music alone
CARRY = 0.4  # share of travel that flows through the beats rather than stopping on them


def dance_motion(dance: Choreography, settings: ClipSettings) -> Motion:
    """A choreography as a recorder with the settings' frame rate and noise would see it."""
    seconds, fps = settings.seconds, settings.fps
    times = np.arange(round(seconds * fps)) / fps
    poses, lifts = _poses_at(dance, times)
    positions = joint_positions(poses, lifts, dance.stature)
    if settings.noise:
        positions += settings.noise * np.random.default_rng([settings.seed, 5]).standard_normal(positions.shape)
    return Motion(positions, fps, DANCER)


def _poses_at(dance: Choreography, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(T, POSE_SIZE) poses and (T, 2) heights of the feet at any times.

    Each unit goes from key pose to key pose with minimum jerk, so its speed is zero at both ends. Part of the travel
    flows on through the keys, and a slow swing never rests, as in people.
    """
    keys = dance.ends.times
    if keys.size < 2:
        still = dance.poses[0] if keys.size else np.zeros(POSE_SIZE)
        return _with_swing(np.tile(still, (times.size, 1)), dance, times), np.zeros((times.size, 2))
    unit = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, keys.size - 2)
    share = np.clip((times - keys[unit]) / (keys[unit + 1] - keys[unit]), 0, 1)
    course = (share**3 * (10 - 15 * share + 6 * share**2))[:, None]
    poses = dance.poses[unit] + course * (dance.poses[unit + 1] - dance.poses[unit])
    flowing = [0, 1, HEADING]
    flow = PchipInterpolator(keys, dance.poses[:, flowing])(np.clip(times, keys[0], keys[-1]))
    poses[:, flowing] += CARRY * (flow - poses[:, flowing])
    return _with_swing(poses, dance, times), 4 * course * (1 - course) * _swing_heights(dance.poses)[unit]


def _swing_heights(poses: FloatArray) -> FloatArray:
    """(M - 1, 2) metres that each foot is lifted in each unit: the further it goes the higher, up to 8 cm."""
    paths = [np.diff(poses[:, where][:, :2], axis=0) for where in FEET]
    far = np.stack([np.hypot(*path.T) for path in paths], axis=1)
    return np.minimum(0.2 * far, 0.08)


def _with_swing(poses: FloatArray, dance: Choreography, times: FloatArray) -> FloatArray:
    """The poses with breath in the chest, weight shifting in the waist and a wandering gaze."""
    breath, weight, gaze = (np.sin(2 * np.pi * rate * times + phase) for rate, phase in dance.swing)
    swung = poses.copy()
    swung[:, CHEST] += np.stack([0.02 * weight, 0.015 * breath, 0.015 * weight], axis=-1)
    swung[:, RISE] += 0.004 * breath
    swung[:, HEAD] += 0.06 * gaze
    return swung


def synthetic_motion(beat_times: ArrayLike, downbeat_times: ArrayLike = (), **settings: Any) -> Motion:
    """A dancer whose movement units end on the given beats, but for the liberties that the settings name.

    The movement is a function of continuous time: the same seed at another frame rate is the same dance.

    Parameters
    ----------
    beat_times : (B,) array, seconds, at least two; continued at the same pace to fill the clip
    downbeat_times : array, seconds
    **settings
        dance, seconds, fps, lateness, jitter, omission, redundancy, noise, figures and seed, as in `ClipSettings`.

    Raises
    ------
    ValueError
        For a setting out of range, or one that the beats decide; the message names it.
    """
    if musical := MUSICAL & settings.keys():
        raise ValueError(f"{min(musical)} is no setting of a motion to given beats")
    clip = ClipSettings(**settings)
    grid = grid_through(beat_times, downbeat_times, DANCES[clip.dance].meter, clip.seconds)
    return dance_motion(choreography(grid, clip), clip)
