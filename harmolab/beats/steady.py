"""The steady grid of a piece of music: one tempo and one phase that its onset envelope agrees with as a whole.

Dance music is made to a click. A tracker follows each hesitation of the sound: its beats scatter by tens of
milliseconds and sometimes slip by one. A grid fitted to the whole piece does not. Where the tempo moves, the beats
follow it; see `harmolab.beats.paths`. Where neither explains the sound, the beats are unsure.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from harmolab.beats.paths import SHARPNESS, free_path, smooth_course, stiff_path, window_accents
from harmolab.types import FloatArray

NEAR = 0.07  # seconds within which a tracked beat lies on a grid; mir_eval's tolerance
STEADY = 0.9  # share of the tracked beats on the grid from which on music has one tempo throughout
KEPT = 0.5  # part of a free path's accents that a stiff one has where it does not slip
# Accents at the beats, over the mean, from which on they fit a window. Music without a beat has 2.3 on a grid that the
# tracker agrees with; the freer the path, the more it finds.
FITS_GRID, FITS_STIFF, FITS_FREE = 2.25, 2.5, 4.25
FEWEST = 8  # tracked beats: less of them fit many a grid
SEARCH = 0.04  # part of the tempo by which a grid may differ from the tracked beats
HARMONICS = 4  # of the tempo
PHASES = 96  # steps of a beat at which a phase is tried
REFINEMENT = 40  # times finer in frequency than the Fourier transform of the piece
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
    """Beats in seconds, (B,) array, the share of the tracked beats within `NEAR` of one constant grid, and the share of
    the sounding windows that the beats fit.
    """

    times: FloatArray
    quality: float
    fit: float


def steady_beats(envelope: FloatArray, rate: float, tracked: FloatArray, span: tuple[float, float]) -> SteadyBeats:
    """The beats of a piece of music over the whole of `span`: on a steady grid where it keeps one.

    The constant grid where 90 % of the tracked beats lie within 70 ms of it. Else a stiff path of the phase, where
    it has half of the accents of a free path in 90 % of the windows of 8 s; else the free path. On 23 beat-locked
    recordings the F-measure at 70 ms rises from .94 to .98, and the tempo is within .3 % in all.

    Parameters
    ----------
    envelope : (F,) array, onset strength
    rate : float, hertz, of the envelope
    tracked : (K,) array, seconds, beats of a tracker
    span : (start, end) of the sounding music, seconds; a pause within is counted through, as a dancer does

    Returns
    -------
    SteadyBeats; with fewer than `FEWEST` tracked beats these, of quality and fit 0.
    """
    if tracked.size < FEWEST:
        return SteadyBeats(tracked, 0.0, 0.0)
    curve = accents(envelope, rate)
    steps = np.diff(tracked)
    step = float(steps[np.abs(steps / np.median(steps) - 1) < 0.25].mean())
    grid = best_grid(curve, rate, 60.0 / step, SEARCH)
    quality = float((np.abs(grid.deviations(tracked)) <= NEAR).mean())
    if quality >= STEADY:
        times, least = grid.beats(*span), FITS_GRID
    else:
        times, least = _moving_beats(curve, rate, grid, span)
    values = window_accents(curve, rate, smooth_course(times), span)
    return SteadyBeats(times, quality, float((values >= least).mean()) if values.size else 0.0)


def _moving_beats(curve: FloatArray, rate: float, grid: Grid, span: tuple[float, float]) -> tuple[FloatArray, float]:
    """Beats of music that leaves a grid, and the accents that they need to fit."""
    stiff = stiff_path(curve, rate, grid.beats(span[0] - grid.period, span[1] + grid.period), span)
    free = free_path(curve, rate, grid.period, span)
    kept = window_accents(curve, rate, stiff, span) >= KEPT * window_accents(curve, rate, free, span)
    return (stiff, FITS_STIFF) if kept.size and kept.mean() >= STEADY else (free, FITS_FREE)


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


def octave_remark(tempo: float) -> str:
    """A sentence that says that the tempo might be counted at half or twice as much."""
    return f"The sound alone does not tell this tempo from {tempo / 2:.0f} or {2 * tempo:.0f}: --dance decides."
