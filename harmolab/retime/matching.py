"""Matching of visual to music beats: dynamic programming under bounds on the local speed.

A state is a candidate match: one visual beat, one music beat, and how far from it the visual beat comes to lie. A path
of matches from the start to the end of the clip is a warp that is linear in between; every step keeps the bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.types import FloatArray, IntArray

REACH = 0.75  # of the local beat period: a visual beat further away is not brought to this music beat
RESIDUALS = np.linspace(-0.8, 0.8, 17)  # of the tolerance: where around its target a visual beat may come to lie
MUSIC_SKIP = 1.0  # cost of a music beat without a match; a match costs (residual / tolerance)^2
VISUAL_SKIP = 0.1  # cost of a visual beat without a match
BEND = 0.5  # cost of a second at e times the speed
MEMORY = 1500  # candidates that a step looks back on: ten seconds of busy dancing to fast music


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate matches in order of target time; the first and the last are the ends of the clip.

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


def candidate_matches(
    visual: FloatArray, targets: FloatArray, periods: FloatArray, duration: float, tolerance: float
) -> Candidates:
    """Matches of every visual beat with the music beats within reach, at 17 distances from each.

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
    return Candidates(
        np.concatenate([[0.0], visual[beats[order]], [duration]]),
        np.concatenate([[0.0], target[order], [duration]]),
        np.concatenate([[-1], beats[order], [visual.size]]),
        np.concatenate([[-1], music[order], [targets.size]]),
        np.concatenate([[0.0], place[order] ** 2, [0.0]]),
    )


def best_path(candidates: Candidates, slowest: float, fastest: float) -> IntArray:
    """Indices of the cheapest path from the first candidate to the last, both included.

    Both ends are always joined: at speed 1, if no match is worth more.
    """
    count = candidates.target.size
    total, back = np.full(count, np.inf), np.zeros(count, dtype=np.int64)
    total[0] = 0.0
    for here in range(1, count):
        first = max(0, here - MEMORY)
        before = np.arange(first, here) if first == 0 else np.append(0, np.arange(first, here))
        sums = total[before] + _step_costs(candidates, before, here, slowest, fastest)
        best = int(np.argmin(sums))
        total[here], back[here] = sums[best] + candidates.costs[here], before[best]
    path = [count - 1]
    while path[-1] > 0:
        path.append(int(back[path[-1]]))
    return np.array(path[::-1])


def _step_costs(candidates: Candidates, before: IntArray, here: int, slowest: float, fastest: float) -> FloatArray:
    """Cost of going from each earlier candidate straight to this one; infinite where a bound would break."""
    seconds = candidates.target[here] - candidates.target[before]
    source = candidates.source[here] - candidates.source[before]
    visual, music = (
        candidates.visual[here] - candidates.visual[before],
        candidates.music[here] - candidates.music[before],
    )
    allowed = (visual > 0) & (music > 0) & (source >= slowest * seconds) & (source <= fastest * seconds) & (seconds > 0)
    speed = np.divide(source, seconds, out=np.ones_like(seconds), where=allowed)
    costs = MUSIC_SKIP * (music - 1) + VISUAL_SKIP * (visual - 1) + BEND * seconds * np.log(speed) ** 2
    return np.where(allowed, costs, np.inf)


def capped_costs(visual: FloatArray, targets: FloatArray, tolerance: float) -> FloatArray:
    """min(distance / tolerance, 1)^2 from each target to its nearest visual beat, (N,)."""
    distances = np.abs(visual[None] - targets[:, None]).min(axis=1, initial=np.inf)
    return np.minimum(distances / tolerance, 1.0) ** 2
