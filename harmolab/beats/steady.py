"""The steady grid of a piece of music: one tempo and one phase that its onset envelope agrees with as a whole.

Dance music is made to a click. A tracker follows each hesitation of the sound: its beats scatter by tens of
milliseconds and sometimes slip by one. A grid fitted to the whole piece does not. Music that keeps no tempo keeps its
tracked beats.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from harmolab.types import FloatArray, IntArray

NEAR = 0.07  # seconds within which a tracked beat lies on a grid; mir_eval's tolerance
STEADY = 0.9  # share of the tracked beats on the grid from which on music has one tempo throughout
FOLLOWED = 2 / 3  # share of the tracked beats on a path below which the tracked beats stay
FEWEST = 8  # tracked beats: less of them fit many a grid
SEARCH = 0.04  # part of the tempo by which a grid may differ from the tracked beats
HARMONICS = 4  # of the tempo
PHASES = 96  # steps of a beat at which a phase is tried
REFINEMENT = 40  # times finer in frequency than the Fourier transform of the piece
STEPS = 64  # places in the beat that a path may take
REACH = 3  # places by which a path may move from one beat to the next: 5 % of the tempo
STIFFNESS = 0.1  # of a path; mean accents a squared place
SHARPNESS = 0.02  # seconds, standard deviation of the Gaussian under which a path reads the accents
SLOWEST = 60.0  # beats per minute below which no tempo is halved
RELATED = (1.0, 3 / 4, 4 / 3)  # tempi that trackers take for one another, octaves aside


class Grid(NamedTuple):
    """Beats at first + k period seconds, and the sum of the envelope's Fourier parts in phase with them."""

    first: float
    period: float
    support: float

    def beats(self, start: float, end: float) -> FloatArray:
        """The beats in [start, end], in seconds."""
        low, high = np.ceil((start - self.first) / self.period), np.floor((end - self.first) / self.period)
        return self.first + self.period * np.arange(low, high + 1)

    def deviations(self, times: FloatArray) -> FloatArray:
        """Seconds from the nearest beat of the grid to each time, in [-period / 2, period / 2]."""
        steps = (times - self.first) / self.period
        return (steps - np.round(steps)) * self.period


class SteadyBeats(NamedTuple):
    """Beats in seconds, (B,) array, and the share of the tracked beats within `NEAR` of one constant grid."""

    times: FloatArray
    quality: float


def steady_beats(envelope: FloatArray, rate: float, tracked: FloatArray, span: tuple[float, float]) -> SteadyBeats:
    """The beats of a piece of music on a steady grid, over the whole of `span`.

    The constant grid where 90 % of the tracked beats lie within 70 ms of it; else a stiff path of the phase, where
    that stays near two thirds of them; else the tracked beats. On 23 beat-locked recordings the F-measure at 70 ms
    rises from .94 to .98, and the tempo is within .3 % in all.

    Parameters
    ----------
    envelope : (F,) array, onset strength
    rate : float, hertz, of the envelope
    tracked : (K,) array, seconds, beats of a tracker
    span : (start, end) of the sounding music, seconds; a pause within is counted through, as a dancer does

    Returns
    -------
    SteadyBeats; with fewer than `FEWEST` tracked beats these, of quality 0.
    """
    if tracked.size < FEWEST:
        return SteadyBeats(tracked, 0.0)
    curve = accents(envelope, rate)
    steps = np.diff(tracked)
    step = float(steps[np.abs(steps / np.median(steps) - 1) < 0.25].mean())
    grid = best_grid(curve, rate, 60.0 / step, SEARCH)
    quality = float((np.abs(grid.deviations(tracked)) <= NEAR).mean())
    if quality >= STEADY:
        return SteadyBeats(grid.beats(*span), quality)
    path = _path(curve, rate, grid, span)
    return SteadyBeats(path if _share_near(tracked, path) >= FOLLOWED else tracked, quality)


def accents(envelope: FloatArray, rate: float) -> FloatArray:
    """(F,) array: what an onset envelope has above its mean over 1 s, in units of the mean of that over 4 s."""
    rise = np.maximum(envelope - uniform_filter1d(envelope, max(1, round(rate))), 0.0)
    level = uniform_filter1d(rise, max(1, round(4 * rate)))
    return rise / np.maximum(level, 1e-6 * max(rise.max(initial=0.0), 1e-300))


def best_grid(curve: FloatArray, rate: float, tempo: float, search: float) -> Grid:
    """The grid within `search` (a part of it) of a tempo (beats per minute) that the accents support best.

    A grid of frequency f and phase p has the support sum_h Re(E(h f) exp(2 pi i h p)), h = 1 to 4, where E is the
    Fourier transform of the accents.
    """
    size = 1 << int(np.ceil(np.log2(REFINEMENT * curve.size)))
    spectrum, unit = np.fft.rfft(curve, size), rate / size  # E at whole multiples of `unit` hertz
    low, high = (max(1, round(tempo / 60 * (1 + part) / unit)) for part in (-search, search))
    frequencies = np.arange(low, max(low, high) + 1)
    phases = np.arange(PHASES) / PHASES
    support = np.zeros((frequencies.size, PHASES))
    for harmonic in range(1, HARMONICS + 1):
        part = spectrum[np.minimum(harmonic * frequencies, spectrum.size - 1)]
        support += (part[:, None] * np.exp(2j * np.pi * harmonic * phases)).real
    best, phase = np.unravel_index(support.argmax(), support.shape)
    period = 1.0 / (frequencies[best] * unit)
    return Grid(float(phases[phase] * period), float(period), float(support[best, phase]))


def likelier_tempo(envelope: FloatArray, rate: float, tempo: float) -> float:
    """The tempo in beats per minute, or one related to it that the whole envelope agrees with better.

    Of the tempo, three quarters and four thirds of it, the one with the largest support of its grid. Octaves have much
    of their support in common, so there is one rule only: the beat is every second one where the others are less than
    half as strong. Whether a tempo should be doubled cannot be decided from the envelope.
    """
    curve = accents(envelope, rate)
    grids = [best_grid(curve, rate, tempo * ratio, SEARCH) for ratio in RELATED]
    best = max(grids, key=lambda grid: grid.support)
    if 30.0 / best.period < SLOWEST:
        return 60.0 / best.period
    half = best_grid(curve, rate, 30.0 / best.period, SEARCH / 4)
    end = curve.size / rate - half.period
    smooth, times = gaussian_filter1d(curve, SHARPNESS * rate), np.arange(curve.size) / rate
    strong, weak = (np.interp(half.beats(0.0, end) + late, times, smooth).mean() for late in (0.0, half.period / 2))
    return (60.0 if weak < strong / 2 else 120.0) / half.period


def _share_near(times: FloatArray, beats: FloatArray) -> float:
    """Share of the times within `NEAR` of their nearest beat; 0 without beats."""
    if beats.size == 0:
        return 0.0
    nearest = np.round(np.interp(times, beats, np.arange(beats.size))).astype(np.int64)
    return float((np.abs(times - beats[nearest]) <= NEAR).mean())


def octave_remark(tempo: float) -> str:
    """A sentence that says that the tempo might be counted at half or twice as much."""
    return f"The sound alone does not tell this tempo from {tempo / 2:.0f} or {2 * tempo:.0f}: --dance decides."


def _path(curve: FloatArray, rate: float, grid: Grid, span: tuple[float, float]) -> FloatArray:
    """Beats in `span` whose phase on the grid changes little from beat to beat and follows the accents (Viterbi)."""
    base = grid.beats(span[0] - grid.period, span[1] + grid.period)
    places = np.arange(STEPS) * grid.period / STEPS
    times = np.arange(curve.size) / rate
    rows = np.interp(base[:, None] + places, times, gaussian_filter1d(curve, SHARPNESS * rate), left=0.0, right=0.0)
    path = base + _unwrapped_path(rows) * grid.period / STEPS
    return path[(path >= span[0]) & (path <= span[1])]


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
