"""Paths of beats through a piece whose tempo moves, on the accents of its onset strength, and how well beats fit them.

Both paths are the best of all by dynamic programming (Viterbi): a stiff one beside a constant grid, for music that
wanders about one tempo, and a free one, for music that changes it. The freer a path, the more accents it finds where
there is no beat at all; so a fit is judged on the path's smooth course, and a free path has to fit better.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from harmolab.types import FloatArray, IntArray

SHARPNESS = 0.02  # seconds, standard deviation of the Gaussian under which beats read the accents
STEPS = 64  # places in the beat that a stiff path may take
REACH = 3  # places by which a stiff path may move from one beat to the next: 5 % of the tempo
STIFFNESS = 0.1  # of a stiff path; mean accents a squared place
FREE_STEPS = 48  # steps of a beat that a free path takes
RANGE = 1.4  # times faster or slower that a free path may become; an octave is out of reach
DRIFT = 400.0  # what a free path pays for a change of tempo; mean accents a squared part of the tempo
JUMP = 2.0  # most that it pays at once, so that a tempo may change suddenly; mean accents
WINDOW = 8.0  # seconds over which a fit is judged, every half of it
SILENT = 0.05  # mean accents below which a window is silent and has no fit
# Weights of the beats around one by which a parabola through the nine has its middle (Savitzky and Golay 1964).
PARABOLA = np.array([-21, 14, 39, 54, 59, 54, 39, 14, -21]) / 231


def stiff_path(curve: FloatArray, rate: float, base: FloatArray, span: tuple[float, float]) -> FloatArray:
    """Beats in `span` whose phase on a constant grid changes little from beat to beat and follows the accents.

    Parameters
    ----------
    curve : (F,) array, accents of `rate` hertz; see `harmolab.beats.steady.accents`
    base : (B,) array, seconds, beats of the grid over the span and one more at either end; at least two
    span : (start, end), seconds
    """
    period = float(base[1] - base[0])
    places = np.arange(STEPS) * period / STEPS
    times = np.arange(curve.size) / rate
    rows = np.interp(base[:, None] + places, times, _smooth(curve, rate), left=0.0, right=0.0)
    path = base + _unwrapped_path(rows) * period / STEPS
    return path[(path >= span[0]) & (path <= span[1])]


def _smooth(curve: FloatArray, rate: float) -> FloatArray:
    """(F,) array: the accents as beats read them, within `SHARPNESS`."""
    return np.asarray(gaussian_filter1d(curve, SHARPNESS * rate), np.float64)


def _unwrapped_path(rows: FloatArray) -> IntArray:
    """(B,) place of each beat on the best path through (B, STEPS) accents; a path may wind through whole beats."""
    moves = np.arange(-REACH, REACH + 1)
    total, arrivals = rows[0], []
    for row in rows[1:]:
        candidates = np.stack([np.roll(total, move) - STIFFNESS * move**2 for move in moves])
        best = candidates.argmax(axis=0)
        arrivals.append(moves[best])
        total = row + candidates.max(axis=0)
    places = [int(total.argmax())]
    for arrival in reversed(arrivals):
        places.append(places[-1] - int(arrival[places[-1] % STEPS]))
    path = np.array(places[::-1])
    # As near to the grid as whole beats allow, so that the span is covered.
    return path - STEPS * int(np.round(np.median(path) / STEPS))


def free_path(curve: FloatArray, rate: float, period: float, span: tuple[float, float]) -> FloatArray:
    """Beats in `span` that follow the accents through any change of tempo within a factor of `RANGE`.

    Of all rows of beats it is the one with the largest sum of accents, each times the interval before it over
    `period`, less ``min(DRIFT ln(new / old interval)^2, JUMP)`` for each change of interval. The factor makes it a mean
    over time, so that more beats are not better.

    Parameters
    ----------
    curve : (F,) array, accents of `rate` hertz
    period : float, seconds, about that of the beats
    span : (start, end), seconds
    """
    times = np.arange(span[0], span[1], period / FREE_STEPS)
    heights = np.interp(times, np.arange(curve.size) / rate, _smooth(curve, rate))
    intervals = np.arange(round(FREE_STEPS / RANGE), round(FREE_STEPS * RANGE) + 1)
    return times[_best_row(heights, intervals)]


def _best_row(heights: FloatArray, intervals: IntArray) -> IntArray:
    """(B,) places in (N,) heights of the best row of beats; `intervals` are those allowed, (J,), in steps.

    A beat is at least `intervals[0]` steps after the one before, so as many steps are computed at once.
    """
    each, block = np.arange(intervals.size), int(intervals[0])
    changes = np.minimum(DRIFT * np.log(intervals[:, None] / intervals) ** 2, JUMP)  # (J, J): to, from
    best = np.zeros((heights.size, intervals.size))  # score of the best row that ends here and goes on by each interval
    origin = np.zeros(best.shape, np.int8)  # the interval by which that row came here
    for first in range(0, heights.size, block):
        steps = np.arange(first, min(first + block, heights.size))
        past = steps[:, None] - intervals
        before = np.where(past >= 0, best[np.maximum(past, 0), each], 0.0)
        score = before + heights[steps, None] * intervals / FREE_STEPS
        candidates = score[:, None, :] - changes
        origin[steps], best[steps] = candidates.argmax(axis=2), candidates.max(axis=2)
    last = max(0, heights.size - int(intervals[-1]))
    step, to = divmod(int(best[last:].argmax()), intervals.size)
    row = [last + step]
    while (previous := row[-1] - int(intervals[to := int(origin[row[-1], to])])) >= 0:
        row.append(previous)
    return np.array(row[::-1])


def window_accents(curve: FloatArray, rate: float, beats: FloatArray, span: tuple[float, float]) -> FloatArray:
    """(W,) mean accents at the beats in each sounding window of `WINDOW` seconds, over the mean of all accents there.

    1 is what beats at random moments have; a window without a beat has 0.
    """
    smooth, times = _smooth(curve, rate), np.arange(curve.size) / rate
    count = max(1, round(2 * (span[1] - span[0]) / WINDOW) - 1)
    starts = np.array([span[0] + WINDOW / 2 * number for number in range(count)])
    level = _window_means(times, smooth, starts)
    own = _window_means(beats, np.interp(beats, times, smooth), starts)
    sounding = level > SILENT
    return own[sounding] / level[sounding]


def _window_means(times: FloatArray, values: FloatArray, starts: FloatArray) -> FloatArray:
    """(W,) mean of the values whose times lie in each window; 0 where there are none."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    low, high = np.searchsorted(times, starts), np.searchsorted(times, starts + WINDOW)
    return (total[high] - total[low]) / np.maximum(high - low, 1)


def smooth_course(beats: FloatArray) -> FloatArray:
    """(B,) each beat on a parabola through the nine around it; the first and last four stay as they are.

    Beats that music has keep their accents, for its tempo moves smoothly; beats picked out of noise lose theirs.
    """
    if beats.size < PARABOLA.size:
        return beats
    ends = PARABOLA.size // 2
    return np.concatenate([beats[:ends], np.convolve(beats, PARABOLA, "valid"), beats[-ends:]])
