"""Speed of Audio to Body Dynamics: cleaning and placing an hour of points, against one copy of the same points.

A tenth of the frames is bad, in bursts of up to six. Only the ratio means something on another machine.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import best_of
from harmolab.corpora.instruments import Performance
from harmolab.io.player_points import PLAYER_50
from harmolab.systems.audio2body.cleaning import cleaned
from harmolab.systems.audio2body.placing import placed, reference_configuration
from harmolab.types import Motion

SECONDS, FPS = 3600.0, 24.0


def hour_of_points(seed: int = 0) -> Performance:
    """An hour of 50 slowly moving points; a tenth of the frames are somewhere else, in bursts."""
    rng = np.random.default_rng(seed)
    n_frames = round(SECONDS * FPS)
    place = rng.uniform([150, 100], [450, 400], (50, 2))
    phase = np.arange(n_frames)[:, None] / FPS + rng.uniform(0, 6, 50)
    points = place + 20 * np.stack([np.sin(phase), np.cos(phase)], axis=-1) + rng.normal(0, 1, (n_frames, 50, 2))
    for first in np.flatnonzero(rng.random(n_frames) < 0.03):
        points[first : first + rng.integers(1, 7)] += rng.uniform(100, 300, 2)
    return Performance("an hour", "piano", None, Motion(points, FPS, PLAYER_50))


def aligned(performance: Performance) -> Motion:
    """The performance cleaned, and placed where its own medians are."""
    result = cleaned(performance)
    return placed(result, reference_configuration(result))


def measure(rounds: int = 3) -> dict[str, float]:
    """Milliseconds of cleaning, of cleaning and placing, and of a copy; share of frames rejected."""
    performance = hour_of_points()
    works: dict[str, Callable[[], object]] = {
        "cleaning (ms)": lambda: cleaned(performance),
        "cleaning and placing (ms)": lambda: aligned(performance),
        "a copy (ms)": performance.motion.positions.copy,
    }
    times = {name: best_of(work, rounds) for name, work in works.items()}
    times["times a copy"] = times["cleaning and placing (ms)"] / times["a copy (ms)"]
    return times | {"share rejected": 1 - cleaned(performance).accepted.mean()}


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:32s}{value:12.3f}" if value < 1 else f"{name:32s}{value:12.1f}")
