"""Every score of every clip of a corpus, with its own and with wrong music, and whatever the scores fit.

Each clip is scored with its own music moved in tenths of a beat over one cycle of its bar pattern. In a null corpus the
music of each clip begins somewhere else: patterns and lags are learnt on it anew, as they would have been.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.lab.compare.batch import BeatBatch, rescore
from harmolab.lab.compare.fits import TENTHS, FitBatch, Lessons, Teacher, coefficients, cycle_curve
from harmolab.lab.compare.windows import FITTED, BeatClip
from harmolab.metrics.beats import beat_align, beat_hit_rate, mir_eval_scores
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray

LAGS = (3, 4, 5, 6, 7)  # tenths of a beat: what "lagged music" means
N_OTHERS = 5  # stretches of other music for the "other" null
Scores = tuple[FloatArray, FloatArray]  # (n,) with true and (n, K) with wrong music


@dataclass(frozen=True, eq=False)
class ScoredClip(BeatClip):
    """A clip with all that follows from it and its own music.

    Parameters
    ----------
    hits : dict from score name to (10 cycle,) array, at lags of 0, .1, .2 ... beat
    curves : dict from the names of `FITTED` and "bounce" to its `cycle_curve`
    """

    hits: Mapping[str, FloatArray]
    curves: Mapping[str, FloatArray]


def scored_clip(clip: BeatClip, *, other_music: bool) -> ScoredClip:
    """The clip scored with its own music; without what only other music needs, its movement, where there is none."""
    own = clip.music()
    curves = {name: cycle_curve(*signal, own, clip.cycle) for name, signal in clip.speeds.items()}
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
    fitted : dict from the names of `FITTED` and "discriminant" to FittedScore
    lags : PeakLags, for the row "peaks_lagged"
    """

    sizes: IntArray
    hits: dict[str, FloatArray]
    other_hits: dict[str, FloatArray]
    fitted: dict[str, FittedScore]
    lags: PeakLags

    def at(self, origins: IntArray) -> dict[str, Scores]:
        """Every score with true and with wrong music where the music of each clip begins so many tenths of a beat late.

        Whatever is fitted inside the corpus is fitted anew.
        """
        rows = {}
        for name, fitted in self.fitted.items():
            grid, others = fitted.at(origins / TENTHS)
            true, lagged = self._lagged(grid, origins)
            rows[name] = true, lagged if others is None else others
        rows |= {name: self._lookup(name, grid, origins) for name, grid in self.hits.items()}
        late = origins + self.lags.at(origins)
        return rows | {"peaks_lagged": self._lookup("peaks", self.hits["peaks"], late)}

    def _lookup(self, name: str, grid: FloatArray, origins: IntArray) -> Scores:
        true, lagged = self._lagged(grid, origins)
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
        steps = np.broadcast_to((start + np.arange(TENTHS)) % TENTHS, self.peaks.shape)
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

    parts: tuple[PatternScores, ...]
    sequences: IntArray
    is_placed: BoolArray

    @classmethod
    def of(cls, parts: Sequence[PatternScores], clips: Sequence[BeatClip]) -> FittedScore:
        """The score of clips whose parts are made."""
        _, sequences = np.unique([clip.sequence for clip in clips], return_inverse=True)
        return cls(tuple(parts), sequences, np.array([clip.is_placed for clip in clips]))

    def at(self, origins: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """H at lags of 0, .1, .2 ... beat, (n, S), and with other music, (n, K).

        The music of each clip begins `origins` beats late.
        """
        grid = np.zeros((origins.size, max(TENTHS * part.batch.cycle for part in self.parts)))
        others = None
        for part in self.parts:
            weights = part.weights(origins)
            rows = part.batch.harmony(weights)
            free = ~self.is_placed[part.clips]
            rows[free] = with_one_place(rows[free], self.sequences[part.clips][free])
            grid[part.clips, : rows.shape[1]] = rows
            if part.others is not None:
                others = np.zeros((origins.size, N_OTHERS)) if others is None else others
                others[part.clips] = part.others.harmony(np.repeat(weights, N_OTHERS, axis=0))[:, 0].reshape(
                    -1, N_OTHERS
                )
        return grid, others


@dataclass(frozen=True, eq=False)
class PatternScores:
    """The clips of one cycle: their numbers (p,), their fits, those of other music (p K rows), and their patterns.

    `fixed` holds the coefficients (p, F) of patterns that come from another corpus, else `lessons` teaches them.
    """

    clips: IntArray
    batch: FitBatch
    others: FitBatch | None
    fixed: FloatArray
    lessons: Teacher | None

    def weights(self, origins: FloatArray) -> FloatArray:
        """Coefficients of each clip's pattern where the music of the clips begins so many beats late."""
        return self.fixed if self.lessons is None else self.lessons.weights(origins[self.clips])


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
    places = grid.reshape(len(grid), grid.shape[1] // TENTHS, TENTHS)
    values = np.empty((len(grid), TENTHS))
    for sequence in np.unique(sequences):
        own = places[sequences == sequence]
        best = (own.sum(axis=0) - own).argmax(axis=1)[:, None]
        rows = np.take_along_axis(own, best, axis=1)[:, 0] if len(own) > 1 else own.mean(axis=1)
        values[sequences == sequence] = rows
    return np.tile(values, places.shape[1])


def hit_scores(clip: BeatClip, tracks: Sequence[BeatTrack]) -> dict[str, FloatArray]:
    """Every score by hits of one clip against each music (on the clip's time line): name -> (len(tracks),) array."""
    paper = rescore(BeatBatch.of([(music, clip.visual["turns"]) for music in tracks]), HarmonyParams.paper())
    table = {
        "paper": paper.harmony,
        "paper_above_chance": paper.harmony_above_chance,
        "hit_rate": paper.hit_rate,
    }
    for kind in ("valleys", "peaks"):
        batch = BeatBatch.of([(music, clip.visual[kind]) for music in tracks])
        table[kind] = rescore(batch, HarmonyParams.valleys()).harmony_above_chance
    moves = clip.visual["kinematic"].times
    rows = [
        {
            "beat_align_motion": beat_align(moves, music.times),
            "beat_align_music": beat_align(music.times, moves),
            "beat_hit_rate": beat_hit_rate(moves, music.times),
            **mir_eval_scores(music.times, moves, only=("f",)),
        }
        for music in tracks
    ]
    return table | {name: np.array([row[name] for row in rows]) for name in rows[0]}


def shifted_music(clip: BeatClip) -> list[BeatTrack]:
    """The clip's music 0, .1, .2 ... beat late, over one cycle."""
    return [clip.music(step * clip.period / TENTHS) for step in range(TENTHS * clip.cycle)]


def other_music(clips: Sequence[BeatClip], seed: int) -> list[list[BeatTrack]]:
    """`N_OTHERS` random stretches of other recordings' music for each clip, as long as it.

    Raises
    ------
    ValueError
        With fewer than two recordings.
    """
    rng = np.random.default_rng(seed)
    tracks = {clip.sequence: clip.track for clip in clips}
    if len(tracks) < 2:
        raise ValueError("other music needs at least two sequences")

    def stretches(clip: BeatClip) -> list[BeatTrack]:
        names = rng.choice([name for name in tracks if name != clip.sequence], N_OTHERS)
        music = [tracks[str(name)] for name in names]
        return [track.span(rng.uniform(0, max(track.duration - clip.duration, 0.01)), clip.duration) for track in music]

    return [stretches(clip) for clip in clips]


def hit_table(rows: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    """Every score by hits of n clips, each against up to K tracks: name -> (n, K) array, 0 behind a shorter row."""
    longest = max(row["paper"].size for row in rows)
    return {name: np.array([np.pad(row[name], (0, longest - row[name].size)) for row in rows]) for name in rows[0]}


def fitted_score(
    name: str,
    clips: Sequence[ScoredClip],
    patterns: Sequence[BarPattern],
    usable: BoolArray | None,
    others: Sequence[Sequence[BeatTrack]] | None,
) -> FittedScore:
    """The score of this name in `FITTED`.

    Parameters
    ----------
    patterns : n patterns
    usable : (n, n) bool array of `usable_clips`; None where the patterns come from another corpus
    others : n lists of other music, None for lagged music
    """
    cycles = np.array([clip.cycle for clip in clips])

    def with_others(numbers: list[int], music: Sequence[Sequence[BeatTrack]], cycle: int) -> FitBatch:
        rows = [(clips[i].speeds[name], track) for i in numbers for track in music[i]]
        return FitBatch.of([cycle_curve(times, speed, track, cycle) for (times, speed), track in rows], cycle)

    parts = []
    for cycle in np.unique(cycles).tolist():
        numbers = np.flatnonzero(cycles == cycle)
        parts.append(
            PatternScores(
                numbers,
                FitBatch.of([clips[i].curves[name] for i in numbers.tolist()], cycle),
                None if others is None else with_others(numbers.tolist(), others, cycle),
                np.array([coefficients(patterns[i], cycle) for i in numbers.tolist()]),
                None if usable is None else _lessons(name, clips, numbers, usable, cycle),
            )
        )
    return FittedScore.of(parts, clips)


def _lessons(name: str, clips: Sequence[BeatClip], numbers: IntArray, usable: BoolArray, cycle: int) -> Lessons:
    sums = [clips[i].sums.get(name) for i in numbers.tolist()]
    return Lessons.of(sums, usable[np.ix_(numbers, numbers)], cycle)


def score_table(
    clips: Sequence[ScoredClip],
    patterns: dict[str, list[BarPattern]],
    usable: BoolArray,
    fit_clips: Sequence[ScoredClip] | None,
    others: Sequence[Sequence[BeatTrack]] | None,
) -> ScoreTable:
    """The scores of all clips.

    Parameters
    ----------
    clips : n ScoredClips
    patterns : dict from the names of `FITTED` to n patterns
    usable : (n, m) bool array of `usable_clips`
    fit_clips : m ScoredClips of another corpus to fit on, None for the corpus itself
    others : n lists of `other_music`, None for lagged music
    """
    hits = hit_table([clip.hits for clip in clips])
    source = clips if fit_clips is None else fit_clips
    peaks = hit_table([clip.hits for clip in source])["peaks"]
    folded = peaks.reshape(len(peaks), -1, TENTHS).sum(axis=1) / np.array([[clip.cycle] for clip in source])
    inside = usable if fit_clips is None else None
    return ScoreTable(
        np.array([TENTHS * clip.cycle for clip in clips]),
        hits,
        {} if others is None else hit_table([hit_scores(*pair) for pair in zip(clips, others, strict=True)]),
        {name: fitted_score(name, clips, patterns[name], inside, others) for name in FITTED},
        PeakLags(folded, usable, fit_clips is None),
    )
