"""Which visual beat meets which music beat: dynamic programming under bounds on the local speed.

A state is a meeting: one visual beat, one music beat, and how far from it they meet. A path of meetings from the start
to the end of the clip is a warp that is linear in between; every step of a path keeps the bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Meetings", "best_path", "capped_costs", "meetings"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

REACH = 0.75  # of the local beat period: a visual beat further away is not brought to this music beat
RESIDUALS = np.linspace(-0.8, 0.8, 17)  # of the tolerance: where around its target a visual beat may come to lie
MUSIC_SKIP = 1.0  # cost of a music beat that nothing meets; a meeting costs (residual / tolerance)^2
VISUAL_SKIP = 0.1  # cost of a visual beat that meets nothing
BEND = 0.5  # cost of a second at e times the speed
MEMORY = 1500  # meetings that a step looks back on: ten seconds of busy dancing to fast music


@dataclass(frozen=True, eq=False)
class Meetings:
    """Candidate meetings in order of target time; the first and the last are the ends of the clip.

    Parameters
    ----------
    source, target : (K,) arrays, seconds
    visual, music : (K,) int arrays, which beats; the ends have -1 and the number of beats
    costs : (K,) array
    """

    source: FloatArray
    target: FloatArray
    visual: IntArray
    music: IntArray
    costs: FloatArray


def meetings(
    visual: FloatArray, targets: FloatArray, periods: FloatArray, duration: float, tolerance: float
) -> Meetings:
    """Every meeting that is worth a thought.

    Parameters
    ----------
    visual : (M,) array, seconds, inside (0, duration)
    targets, periods : (N,) arrays, seconds: where visual beats should come to lie, and the beat period there
    duration, tolerance : float, seconds
    """
    near = np.abs(visual[None] - targets[:, None]) <= REACH * periods[:, None]
    music, beats = np.nonzero(near)
    place = np.tile(RESIDUALS, music.size)
    music, beats = np.repeat(music, RESIDUALS.size), np.repeat(beats, RESIDUALS.size)
    target = targets[music] + place * tolerance
    order = np.argsort(target, kind="stable")
    order = order[(target[order] > 0) & (target[order] < duration)]
    return Meetings(
        np.concatenate([[0.0], visual[beats[order]], [duration]]),
        np.concatenate([[0.0], target[order], [duration]]),
        np.concatenate([[-1], beats[order], [visual.size]]),
        np.concatenate([[-1], music[order], [targets.size]]),
        np.concatenate([[0.0], place[order] ** 2, [0.0]]),
    )


def best_path(found: Meetings, slowest: float, fastest: float) -> IntArray:
    """Indices of the cheapest path from the first meeting to the last, both included.

    Both ends are always joined: at speed 1, if no meeting is worth more.
    """
    count = found.target.size
    total, back = np.full(count, np.inf), np.zeros(count, dtype=np.int64)
    total[0] = 0.0
    for here in range(1, count):
        first = max(0, here - MEMORY)
        before = np.arange(first, here) if first == 0 else np.append(0, np.arange(first, here))
        sums = total[before] + _step_costs(found, before, here, slowest, fastest)
        best = int(np.argmin(sums))
        total[here], back[here] = sums[best] + found.costs[here], before[best]
    path = [count - 1]
    while path[-1] > 0:
        path.append(int(back[path[-1]]))
    return np.array(path[::-1])


def _step_costs(found: Meetings, before: IntArray, here: int, slowest: float, fastest: float) -> FloatArray:
    """Cost of going from each earlier meeting straight to this one; infinite where a bound would break."""
    lasts = found.target[here] - found.target[before]
    source = found.source[here] - found.source[before]
    visual, music = found.visual[here] - found.visual[before], found.music[here] - found.music[before]
    allowed = (visual > 0) & (music > 0) & (source >= slowest * lasts) & (source <= fastest * lasts) & (lasts > 0)
    speed = np.divide(source, lasts, out=np.ones_like(lasts), where=allowed)
    costs = MUSIC_SKIP * (music - 1) + VISUAL_SKIP * (visual - 1) + BEND * lasts * np.log(speed) ** 2
    return np.where(allowed, costs, np.inf)


def capped_costs(visual: FloatArray, targets: FloatArray, tolerance: float) -> FloatArray:
    """min(distance / tolerance, 1)^2 from each target to its nearest visual beat, (N,)."""
    distances = np.abs(visual[None] - targets[:, None]).min(axis=1, initial=np.inf)
    return np.minimum(distances / tolerance, 1.0) ** 2
