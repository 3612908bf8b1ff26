"""Every score of every clip of a corpus, with its own and with wrong music: hits, patterns, discriminant, verdict.

Each clip is scored with its own music moved in tenths of a beat over one cycle of its bar pattern. In a null corpus the
music of each clip begins somewhere else: all that a score fits, patterns and lags, is learnt on it anew, as it would
have been.

The second score of `compare` is a discriminant that is trained on the very null that judges it, and never in the
verdict. The features f of a beat are the harmonics of shape speed and of the vertical velocity of the body's centre
around it, turned to where a cycle begins. On other figures, and on all dances of one cycle together, it learns

    w = (S + tr(S) / n I)^-1 (mean of f at the beats - mean of f 0.3 to 0.7 beat later),

S the mean covariance of f within the two classes, n the number of features (a linear discriminant, shrunk half-way to a
sphere). A clip's score is how high its beats rank among all its moments by w f: as for a learnt curve, whose w is the
mean of f at the beats alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from harmolab.data.recordings import Recording, recording_beats
from harmolab.files import plain
from harmolab.lab.compare import windows
from harmolab.lab.compare.batch import BeatBatch, rescore
from harmolab.lab.compare.windows import usable
from harmolab.metrics.beat_alignment import other_scores
from harmolab.params import DANCE_PATTERNS, BarPattern, HarmonyParams
from harmolab.shape_speed import ShapeSpeed, shape_speed
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray
from harmolab.verdict.bar_pattern import fit_pattern
from harmolab.verdict.judge import judge, music_and_motion

LAGS = (3, 4, 5, 6, 7)  # tenths of a beat: what "lagged music" means
N_OTHERS = 5  # stretches of other music for the "other" null
Scores = tuple[FloatArray, FloatArray]  # (n,) with true and (n, K) with wrong music
# Beats by which the music of the teaching clips begins late -> (n, F) coefficients of the pattern of each judged clip.
Weights = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class ScoredClip(windows.BeatClip):
    """A clip with all that follows from it and its own music.

    Parameters
    ----------
    hits : dict from score name to (10 cycle,) array, at lags of 0, .1, .2 ... beat
    curves : dict from `SIGNALS` to its `cycle_curve`
    """

    hits: Mapping[str, FloatArray]
    curves: Mapping[str, FloatArray]


Clips = Sequence[ScoredClip]
Others = Sequence[Sequence[BeatTrack]] | None  # stretches of other music for each clip, where there are any


def scored_clip(clip: windows.BeatClip, *, other_music: bool) -> ScoredClip:
    """The clip scored with its own music; without what only other music needs, its movement, where there is none."""
    curves = windows.cycle_curves(clip.speeds, clip.music(), clip.cycle)
    hits = hit_scores(clip, shifted_music(clip))
    kept = clip if other_music else replace(clip, visual={}, speeds={})
    return ScoredClip(**vars(kept), hits=hits, curves=curves)


@dataclass(frozen=True, eq=False)
class ScoreTable:
    """The scores of n clips wherever their music begins.

    Parameters
    ----------
    sizes : (n,) array of int, tenths of a beat in the cycle of each clip
    hits : dict from score name to (n, S) array, at lags of 0, .1, .2 ... beat; 0 behind a clip's cycle
    other_hits : dict from score name to (n, K) array, with other recordings' music; empty for lagged music
    fitted : dict from "recommended" and "discriminant" to FittedScore
    lags : PeakLags, for the row "peaks_lagged"
    """

    sizes: IntArray
    hits: dict[str, FloatArray]
    other_hits: dict[str, FloatArray]
    fitted: dict[str, "FittedScore"]
    lags: "PeakLags"

    def at(self, origins: IntArray) -> dict[str, Scores]:
        """Every score with true and with wrong music where the music of each clip begins so many tenths of a beat late.

        Whatever is fitted inside the corpus is fitted anew.
        """
        rows = {}
        for name, fitted in self.fitted.items():
            grid, others = fitted.at(origins / windows.TENTHS)
            true, lagged = self._lagged(grid, origins)
            rows[name] = true, lagged if others is None else others
        rows |= {name: self._lookup(name, origins) for name in self.hits}
        return rows | {"peaks_lagged": self._lookup("peaks", origins + self.lags.at(origins))}

    def _lookup(self, name: str, origins: IntArray) -> Scores:
        true, lagged = self._lagged(self.hits[name], origins)
        return true, self.other_hits.get(name, lagged)

    def _lagged(self, grid: FloatArray, origins: IntArray) -> Scores:
        """Scores at the origins, (n,), and later by `LAGS`, (n, 5)."""
        steps = (origins[:, None] + np.array([0, *LAGS])) % self.sizes[:, None]
        values = np.take_along_axis(grid, steps, axis=1)
        return values[:, 0], values[:, 1:]


@dataclass(frozen=True, eq=False)
class PeakLags:
    """The constant lag, in tenths of a beat within a beat, at which speed peaks hit best.

    Parameters
    ----------
    peaks : (m, 10) array, score of each clip to fit on at every lag
    usable : (n, m) bool array
    is_inside : bool; False where they are clips of another corpus, which stay as they are
    """

    peaks: FloatArray
    usable: BoolArray
    is_inside: bool

    def at(self, origins: IntArray) -> IntArray:
        """The lag of each judged clip, (n,), 0 where there is nothing to fit on."""
        start = origins[:, None] if self.is_inside else 0
        steps = np.broadcast_to((start + np.arange(windows.TENTHS)) % windows.TENTHS, self.peaks.shape)
        sums = self.usable.astype(np.float64) @ np.take_along_axis(self.peaks, steps, axis=1)
        return sums.argmax(axis=1).astype(np.int64)


@dataclass(frozen=True, eq=False)
class FittedScore:
    """A score with learnt patterns, of n clips.

    Parameters
    ----------
    parts : PatternScores of the clips of each cycle
    sequences : (n,) array of int, the recording of each clip
    is_placed : (n,) bool array: the place of "one" is known
    """

    parts: tuple["PatternScores", ...]
    sequences: IntArray
    is_placed: BoolArray

    def at(self, origins: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """H at lags of 0, .1, .2 ... beat, (n, S), and with other music, (n, K).

        The music of each clip begins `origins` beats late.
        """
        grid = np.zeros((origins.size, max(windows.TENTHS * part.batch.cycle for part in self.parts)))
        others = None
        for part in self.parts:
            weights = part.weights(origins[part.clips])
            rows = part.batch.harmony(weights)
            free = ~self.is_placed[part.clips]
            rows[free] = with_one_place(rows[free], self.sequences[part.clips][free])
            grid[part.clips, : rows.shape[1]] = rows
            if part.others is not None:
                others = np.zeros((origins.size, N_OTHERS)) if others is None else others
                wrong = part.others.harmony(np.repeat(weights, N_OTHERS, axis=0))
                others[part.clips] = wrong[:, 0].reshape(-1, N_OTHERS)
        return grid, others


class PatternScores(NamedTuple):
    """The clips of one cycle: their numbers (p,), their fits, those of other music (p K rows), and their patterns."""

    clips: IntArray
    batch: windows.FitBatch
    others: windows.FitBatch | None
    weights: Weights


def with_one_place(grid: FloatArray, sequences: IntArray) -> FloatArray:
    """Scores at every lag with one place of "one" a recording, for clips that are not placed.

    Parameters
    ----------
    grid : (p, 10 cycle) array
    sequences : (p,) array of int

    Returns
    -------
    (p, 10 cycle) array. The place is the best of the *other* clips of a recording, and chosen at every lag as it is at
    0: no clip has a say in its own. A clip alone has the mean over the places.
    """
    places = grid.reshape(len(grid), grid.shape[1] // windows.TENTHS, windows.TENTHS)
    values = np.empty((len(grid), windows.TENTHS))
    for sequence in np.unique(sequences):
        own = places[sequences == sequence]
        best = (own.sum(axis=0) - own).argmax(axis=1)[:, None]
        rows = np.take_along_axis(own, best, axis=1)[:, 0] if len(own) > 1 else own.mean(axis=1)
        values[sequences == sequence] = rows
    return np.tile(values, places.shape[1])


def hit_scores(clip: windows.BeatClip, tracks: Sequence[BeatTrack]) -> dict[str, FloatArray]:
    """Every score by hits of one clip against each music (on the clip's time line): name -> (len(tracks),) array."""
    paper = rescore(BeatBatch.of([(music, clip.visual["turns"]) for music in tracks]), HarmonyParams.paper())
    table = {"paper": paper.harmony, "paper_above_chance": paper.harmony_above_chance, "hit_rate": paper.hit_rate}
    for kind in ("valleys", "peaks"):
        batch = BeatBatch.of([(music, clip.visual[kind]) for music in tracks])
        table[kind] = rescore(batch, HarmonyParams.valleys()).harmony_above_chance
    rows = [other_scores(music, clip.visual["kinematic"], only=("f",)) for music in tracks]
    return table | {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "beat_coverage"}


def shifted_music(clip: windows.BeatClip) -> list[BeatTrack]:
    """The clip's music 0, .1, .2 ... beat late, over one cycle."""
    return [clip.music(step * clip.period / windows.TENTHS) for step in range(windows.TENTHS * clip.cycle)]


def other_music(clips: Sequence[windows.BeatClip], seed: int) -> list[list[BeatTrack]]:
    """`N_OTHERS` random stretches of other recordings' music for each clip, as long as it.

    Raises
    ------
    ValueError
        With fewer than two recordings.
    """
    rng = np.random.default_rng(seed)
    tracks = {clip.sequence: clip.track for clip in clips}
    if len(tracks) < 2:
        raise ValueError("other music needs at least two recordings")

    def stretches(clip: windows.BeatClip) -> list[BeatTrack]:
        names = rng.choice([name for name in tracks if name != clip.sequence], N_OTHERS)
        music = [tracks[str(name)] for name in names]
        return [track.span(rng.uniform(0, max(track.duration - clip.duration, 0.01)), clip.duration) for track in music]

    return [stretches(clip) for clip in clips]


def hit_table(rows: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    """Every score by hits of n clips, each against up to K tracks: name -> (n, K) array, 0 behind a shorter row."""
    longest = max(row["paper"].size for row in rows)
    return {name: np.array([np.pad(row[name], (0, longest - row[name].size)) for row in rows]) for name in rows[0]}


def fitted_score(
    signals: Sequence[str], clips: Clips, others: Others, taught: Callable[[IntArray, int], Weights]
) -> FittedScore:
    """The score that reads some signals of n clips, by the patterns that were taught.

    Parameters
    ----------
    signals : names in `BeatClip.speeds`
    others : n lists of other music, None for lagged music
    taught : function of the numbers of clips, and of the cycle that they have, to `PatternScores.weights`
    """
    cycles, parts = np.array([clip.cycle for clip in clips]), []
    for cycle in np.unique(cycles).tolist():
        numbers = np.flatnonzero(cycles == cycle)
        own = [clips[i] for i in numbers.tolist()]
        wrong = None
        if others is not None:
            pairs = [(clips[i].speeds, track) for i in numbers.tolist() for track in others[i]]
            curves = [windows.cycle_curves(speeds, track, cycle) for speeds, track in pairs]
            wrong = windows.signal_batch(curves, cycle, signals)
        batch = windows.signal_batch([clip.curves for clip in own], cycle, signals)
        parts.append(PatternScores(numbers, batch, wrong, taught(numbers, cycle)))
    _, sequences = np.unique([clip.sequence for clip in clips], return_inverse=True)
    return FittedScore(tuple(parts), sequences, np.array([clip.is_placed for clip in clips]))


def pattern_score(
    clips: Clips, patterns: Sequence[BarPattern], usable: BoolArray | None, others: Others
) -> FittedScore:
    """The recommended score of clips, by n patterns.

    `usable` is the (n, n) bool array of `usable_clips`; None where the patterns come from another corpus.
    """

    def taught(numbers: IntArray, cycle: int) -> Weights:
        if usable is None:
            return lambda _: np.array([windows.coefficients(patterns[i], cycle) for i in numbers.tolist()])
        sums = [clips[i].sums for i in numbers.tolist()]
        return windows.Lessons.of(sums, usable[np.ix_(numbers, numbers)], cycle).weights

    return fitted_score((windows.OURS,), clips, others, taught)


def score_table(
    clips: Clips, patterns: Sequence[BarPattern], usable: BoolArray, fit_clips: Clips | None, others: Others
) -> ScoreTable:
    """The scores of all clips.

    Parameters
    ----------
    clips : n ScoredClips
    patterns : n patterns
    usable : (n, m) bool array of `usable_clips`
    fit_clips : m ScoredClips of another corpus to fit on, None for the corpus itself
    others : n lists of `other_music`, None for lagged music
    """
    hits = hit_table([clip.hits for clip in clips])
    source = clips if fit_clips is None else fit_clips
    peaks = hit_table([clip.hits for clip in source])["peaks"]
    folded = peaks.reshape(len(peaks), -1, windows.TENTHS).sum(axis=1) / np.array([[clip.cycle] for clip in source])
    return ScoreTable(
        np.array([windows.TENTHS * clip.cycle for clip in clips]),
        hits,
        {} if others is None else hit_table([hit_scores(*pair) for pair in zip(clips, others, strict=True)]),
        {windows.OURS: pattern_score(clips, patterns, usable if fit_clips is None else None, others)},
        PeakLags(folded, usable, fit_clips is None),
    )


DISCRIMINANT = "discriminant"
NEAR = 1 / 8  # beat: as near as "on the beat" is in the verdict


def beat_features(fits: FloatArray, cycle: int) -> FloatArray:
    """(L, B, F) features of B beats at L lags of 0, .1, .2 ... beat over a cycle, turned to where a cycle begins.

    `fits` is an (F, G) array over the moments of whole cycles of beats, one or more, which go round in a circle.
    """
    beats = np.arange(fits.shape[1] // windows.MOMENTS)
    lags = np.arange(windows.TENTHS * cycle)[:, None] * (windows.MOMENTS // windows.TENTHS)
    harmonics = np.moveaxis(fits[:, (beats * windows.MOMENTS + lags) % fits.shape[1]], 0, -1)
    return windows.turned_signals(harmonics, cycle, -(beats % cycle)[:, None, None])


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
    def of(cls, batch: windows.FitBatch, usable: BoolArray) -> "DiscriminantLessons":
        """The lessons of the m clips of a batch; one without moments teaches nothing."""
        lags, features = windows.TENTHS * batch.cycle, batch.fits.shape[1]
        sums = np.zeros((batch.sizes.size, lags, features))
        squares = np.zeros((batch.sizes.size, lags, features, features))
        for number in np.flatnonzero(batch.sizes).tolist():
            rows = beat_features(batch.fits[number, :, : batch.sizes[number]], batch.cycle)
            sums[number] = rows.sum(axis=1)
            squares[number] = rows.transpose(0, 2, 1) @ rows
        counts = batch.sizes / windows.MOMENTS
        return cls(batch.cycle, counts, sums, squares, usable & (counts > 0))

    def weights(self, origins: FloatArray | float = 0.0) -> FloatArray:
        """(n, F) coefficients of each judged clip; movements that stop on the beat without a teacher.

        Parameters
        ----------
        origins : (m,) array, beats in whole tenths by which the music of each clip is moved
        """
        steps = np.round(np.broadcast_to(origins, self.counts.shape) * windows.TENTHS).astype(np.int64)
        at_beats, true = self._class(steps[:, None])
        later, wrong = self._class(steps[:, None] + np.array(LAGS))
        within = (true + wrong) / 2
        size = at_beats.shape[1]
        shrunk = within + np.trace(within, axis1=1, axis2=2)[:, None, None] / size * np.eye(size)
        is_taught = self.usable.any(axis=1) & shrunk.any(axis=(1, 2))
        shrunk[~is_taught] = np.eye(size)
        weights: FloatArray = np.linalg.solve(shrunk, (at_beats - later)[..., None])[..., 0]
        rest = windows.coefficients(BarPattern.stop_on_the_beat(), self.cycle)
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


def discriminant_score(clips: Clips, fit_clips: Clips | None = None, others: Others = None) -> FittedScore:
    """The discriminant of n clips, learnt on clips of other recordings without their figures.

    Parameters
    ----------
    fit_clips : m clips of another corpus to learn on, None for the corpus itself
    others : n lists of `other_music`, None for lagged music. It learns from lagged music all the same.
    """
    source = clips if fit_clips is None else fit_clips
    usable = windows.usable_clips(clips, fit_clips, any_dance=True)
    cycles = np.array([clip.cycle for clip in source])

    def taught(numbers: IntArray, cycle: int) -> Weights:
        teachers = np.flatnonzero(cycles == cycle)
        batch = windows.signal_batch([source[j].lessons for j in teachers.tolist()], cycle, windows.SIGNALS)
        lessons = DiscriminantLessons.of(batch, usable[np.ix_(numbers, teachers)])
        fixed = lessons.weights()
        return lessons.weights if fit_clips is None else lambda _: fixed

    return fitted_score(windows.SIGNALS, clips, others, taught)


def recording_lags(score: FittedScore, clips: Sequence[windows.BeatClip]) -> FloatArray:
    """The lag in beats, in tenths and late positive, at which each recording scores highest; NaN where all are alike.

    The mean of its clips' scores is looked at over the cycle of its pattern.
    """
    grid, _ = score.at(np.zeros(len(clips)))
    lags = []
    for recording in np.unique(score.sequences):
        members = score.sequences == recording
        cycle = clips[int(np.flatnonzero(members)[0])].cycle
        curve = grid[members, : windows.TENTHS * cycle].mean(axis=0)
        lag = (curve.argmax() / windows.TENTHS + cycle / 2) % cycle - cycle / 2
        lags.append(lag if np.ptp(curve) > 0 else np.nan)
    return np.array(lags)


# Verdicts on the recordings of a corpus, with true and with lagged music

N_LEVELS = 5


@dataclass(frozen=True, eq=False)
class RecordingVerdict:
    """A recording as `harmolab score` judges it, and what it takes to judge it again.

    Parameters
    ----------
    clip : BeatClip, the first clip of the recording, with the figures of all and no movement
    row : dict, the verdict with true music for JSON
    shape : ShapeSpeed of the motion; its energy is that of all joints together
    music : BeatTrack, the true beats
    """

    clip: windows.BeatClip
    row: dict[str, Any]
    shape: ShapeSpeed
    music: BeatTrack

    def lagged(self, seed: int) -> BeatTrack:
        """The music one random lag of 0.3-0.7 beat later."""
        lag = int(np.random.default_rng(seed).choice(LAGS)) / windows.TENTHS
        return self.music.span(-lag * self.clip.period, self.music.duration)


def recording_verdict(recording: Recording, beats: str, clips: Sequence[windows.BeatClip]) -> RecordingVerdict:
    """The verdict on a whole recording as `score_clip` judges it.

    Parameters
    ----------
    recording : Recording with a motion
    beats : "annotated" or "tracked"
    clips : its clips
    """
    clip = recording.clip
    if beats == "tracked" or clip.beats is None:
        clip = replace(clip, beats=recording_beats(recording, beats))
    music, motion = music_and_motion(clip)
    shape = shape_speed(motion)
    judgement = judge(shape, music, pattern=DANCE_PATTERNS.get(clip.dance))
    numbers = {"harmony_above_chance": judgement.harmony_above_chance, "p_value": judgement.p_value}
    row = {"name": clip.name, "dance": clip.dance, **judgement.to_dict(), **numbers}
    figures = frozenset[str]().union(*(one.figures for one in clips))
    first = replace(clips[0], figures=figures, visual={}, speeds={}, sums=None, lessons={})
    slim = replace(shape, energy=shape.energy.mean(axis=1, keepdims=True))
    return RecordingVerdict(first, plain(row), slim, music)


def verdict_summary(
    verdicts: Sequence[RecordingVerdict], fit_clips: Sequence[windows.BeatClip], is_inside: bool, seed: int
) -> dict[str, Any]:
    """ "recordings", one row each, and "levels": how many recordings reach each level.

    The levels "true" and "lagged" are by the patterns that ship, as in `harmolab score`. Those with "learnt" are by a
    pattern learnt on other figures of `fit_clips`, in other recordings if these are the corpus; recordings for which
    there is none are left out. Recording i has the lag that `seed` + i draws.
    """
    levels: dict[str, list[int]] = {name: [] for name in ("true", "lagged", "true, learnt", "lagged, learnt")}
    for number, verdict in enumerate(verdicts):
        lagged = verdict.lagged(seed + number)
        levels["true"].append(verdict.row["level"])
        levels["lagged"].append(judge(verdict.shape, lagged, pattern=DANCE_PATTERNS.get(verdict.clip.dance)).level)
        teachers = [clip for clip in fit_clips if usable(clip, verdict.clip, same_corpus=is_inside)]
        sums = [clip.sums for clip in teachers if clip.sums is not None]
        if sums:
            pattern = replace(fit_pattern(sums), dance=verdict.clip.dance)
            for name, track in (("true, learnt", verdict.music), ("lagged, learnt", lagged)):
                levels[name].append(judge(verdict.shape, track, pattern=pattern).level)
    counts = {name: np.bincount(np.array(row, np.int64), minlength=N_LEVELS).tolist() for name, row in levels.items()}
    return {"recordings": [verdict.row for verdict in verdicts], "levels": counts}
