"""The second score of `compare`: a discriminant that is trained on the very null that judges it, never in the verdict.

The features f of a beat are the harmonics of shape speed and of the vertical velocity of the body's centre around it,
turned to where a cycle begins. On other figures, and on all dances of one cycle together, it learns

    w = (S + tr(S) / n I)^-1 (mean of f at the beats - mean of f 0.3 to 0.7 beat later),

S the mean covariance of f within the two classes, n the number of features (a linear discriminant, shrunk half-way to a
sphere). A clip's score is how high its beats rank among all its moments by w f: as for a learnt curve, whose w is the
mean of f at the beats alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harmolab.lab.compare.fits import MOMENTS, TENTHS, FitBatch, coefficients, cycle_curve, turned_signals
from harmolab.lab.compare.scores import LAGS, FittedScore, PatternScores, ScoredClip
from harmolab.lab.compare.windows import SIGNALS, BeatClip, usable_clips
from harmolab.params import BarPattern
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray

DISCRIMINANT = "discriminant"
NEAR = 1 / 8  # beat: as near as "on the beat" is in the verdict


def signal_batch(curves: Sequence[Mapping[str, FloatArray]], cycle: int) -> FitBatch:
    """Fits of n clips to the harmonics of both signals: F = 4 cycle features.

    Parameters
    ----------
    curves : n dicts from `SIGNALS` to the `cycle_curve` of a clip; one without the first has no moments, and one that
        stays level has no second
    cycle : int, beats
    """
    first = [row[SIGNALS[0]] for row in curves]
    second = [
        row[SIGNALS[1]] if row[SIGNALS[1]].size == own.size else 0 * own for row, own in zip(curves, first, strict=True)
    ]
    batches = [FitBatch.of(signal, cycle) for signal in (first, second)]
    return FitBatch(cycle, np.concatenate([batch.fits for batch in batches], axis=1), batches[0].sizes)


def beat_features(fits: FloatArray, cycle: int) -> FloatArray:
    """(L, B, F) features of B beats at L lags of 0, .1, .2 ... beat over a cycle, turned to where a cycle begins.

    `fits` is an (F, G) array over the moments of whole cycles of beats, one or more, which go round in a circle.
    """
    beats = np.arange(fits.shape[1] // MOMENTS)
    lags = np.arange(TENTHS * cycle)[:, None] * (MOMENTS // TENTHS)
    harmonics = np.moveaxis(fits[:, (beats * MOMENTS + lags) % fits.shape[1]], 0, -1)
    return turned_signals(harmonics, cycle, -(beats % cycle)[:, None, None])


@dataclass(frozen=True, eq=False)
class DiscriminantLessons:
    """Sums over the beats of m clips at the L lags of a cycle, and who may learn from whom.

    Parameters
    ----------
    cycle : int, beats
    counts : (m,) array, beats of each clip
    sums : (m, L, F) array, features
    squares : (m, L, F, F) array, their products
    usable : (n, m) bool array: clip j may be learnt on when clip i is judged
    """

    cycle: int
    counts: FloatArray
    sums: FloatArray
    squares: FloatArray
    usable: BoolArray

    @classmethod
    def of(cls, batch: FitBatch, usable: BoolArray) -> DiscriminantLessons:
        """The lessons of the m clips of a batch; one without moments teaches nothing."""
        lags, features = TENTHS * batch.cycle, batch.fits.shape[1]
        sums = np.zeros((batch.sizes.size, lags, features))
        squares = np.zeros((batch.sizes.size, lags, features, features))
        for number in np.flatnonzero(batch.sizes).tolist():
            rows = beat_features(batch.fits[number, :, : batch.sizes[number]], batch.cycle)
            sums[number] = rows.sum(axis=1)
            squares[number] = rows.transpose(0, 2, 1) @ rows
        counts = batch.sizes / MOMENTS
        return cls(batch.cycle, counts, sums, squares, usable & (counts > 0))

    def weights(self, origins: FloatArray | float = 0.0) -> FloatArray:
        """(n, F) coefficients of each judged clip; movements that stop on the beat without a teacher.

        Parameters
        ----------
        origins : (m,) array, beats in whole tenths by which the music of each clip is moved
        """
        steps = np.round(np.broadcast_to(origins, self.counts.shape) * TENTHS).astype(np.int64)
        at_beats, true = self._class(steps[:, None])
        later, wrong = self._class(steps[:, None] + np.array(LAGS))
        within = (true + wrong) / 2
        size = at_beats.shape[1]
        shrunk = within + np.trace(within, axis1=1, axis2=2)[:, None, None] / size * np.eye(size)
        is_taught = self.usable.any(axis=1) & shrunk.any(axis=(1, 2))
        shrunk[~is_taught] = np.eye(size)
        weights: FloatArray = np.linalg.solve(shrunk, (at_beats - later)[..., None])[..., 0]
        rest = coefficients(BarPattern.stop_on_the_beat(), self.cycle)
        weights[~is_taught] = np.pad(rest, (0, size - rest.size))
        return weights

    def _class(self, steps: IntArray) -> tuple[FloatArray, FloatArray]:
        """Mean (n, F) and covariance (n, F, F) of the features of a class, for each judged clip.

        `steps` (m, K) are the tenths of a beat at which each clip is seen.
        """
        clips, lags = np.arange(len(steps))[:, None], steps % self.sums.shape[1]
        usable = self.usable.astype(np.float64)
        count = np.maximum(usable @ self.counts * steps.shape[1], 1)[:, None]
        mean = usable @ self.sums[clips, lags].sum(axis=1) / count
        squares = self.squares[clips, lags].sum(axis=1)
        products = (usable @ squares.reshape(len(squares), -1) / count).reshape(-1, *squares.shape[1:])
        return mean, products - mean[:, :, None] * mean[:, None]


def discriminant_score(
    clips: Sequence[ScoredClip],
    fit_clips: Sequence[ScoredClip] | None = None,
    others: Sequence[Sequence[BeatTrack]] | None = None,
) -> FittedScore:
    """The discriminant of n clips, learnt on clips of other recordings without their figures.

    Parameters
    ----------
    fit_clips : m clips of another corpus to learn on, None for the corpus itself
    others : n lists of `other_music`, None for lagged music. It learns from lagged music all the same.
    """
    source = clips if fit_clips is None else fit_clips
    usable = usable_clips(clips, fit_clips, any_dance=True)
    cycles, taught = (np.array([clip.cycle for clip in row]) for row in (clips, source))
    parts = []
    for cycle in np.unique(cycles).tolist():
        numbers, teachers = np.flatnonzero(cycles == cycle), np.flatnonzero(taught == cycle)
        batch = signal_batch([source[j].lessons for j in teachers.tolist()], cycle)
        lessons = DiscriminantLessons.of(batch, usable[np.ix_(numbers, teachers)])
        own = [clips[i] for i in numbers.tolist()]
        music = None if others is None else [others[i] for i in numbers.tolist()]
        parts.append(
            PatternScores(
                numbers,
                signal_batch([clip.curves for clip in own], cycle),
                None if music is None else _other_batch(own, music, cycle),
                lessons.weights(),
                lessons if fit_clips is None else None,
            )
        )
    return FittedScore.of(parts, clips)


def _other_batch(clips: Sequence[BeatClip], music: Sequence[Sequence[BeatTrack]], cycle: int) -> FitBatch:
    """Fits of each clip with each of its other music."""
    rows = [(clip.speeds, track) for clip, tracks in zip(clips, music, strict=True) for track in tracks]
    return signal_batch(
        [{name: cycle_curve(*speeds[name], track, cycle) for name in SIGNALS} for speeds, track in rows], cycle
    )


def recording_lags(score: FittedScore, clips: Sequence[BeatClip]) -> FloatArray:
    """The lag in beats, in tenths and late positive, at which each recording scores highest; NaN where all are alike.

    The mean of its clips' scores is looked at over the cycle of its pattern.
    """
    grid, _ = score.at(np.zeros(len(clips)))
    lags = []
    for recording in np.unique(score.sequences):
        members = score.sequences == recording
        cycle = clips[int(np.flatnonzero(members)[0])].cycle
        curve = grid[members, : TENTHS * cycle].mean(axis=0)
        lag = (curve.argmax() / TENTHS + cycle / 2) % cycle - cycle / 2
        lags.append(lag if np.ptp(curve) > 0 else np.nan)
    return np.array(lags)
