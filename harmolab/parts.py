"""Sequences cut into parts, and every score of a part at a grid of shifts of its music: what `corpus` ranks.

Each part is scored against its own music moved in tenths of a beat over one cycle of its bar pattern; all else is
arithmetic on that grid. Whatever a score fits (bar patterns, lags) is fitted on another corpus, or inside the corpus
on parts of other sequences that share no figure with the judged part.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.beats.meter import cycle_of_meter
from harmolab.beats.visual import visual_beats
from harmolab.data import folders
from harmolab.data.beats import music_beats
from harmolab.harmony import above_chance
from harmolab.io.files import Progress, silent
from harmolab.metrics.beats import beat_align, beat_hit_rate, kinematic_params, mir_eval_scores
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.pattern import (
    PatternSums,
    beat_positions,
    fit_of_speed,
    fit_pattern,
    normalised_speed,
    pattern_sums,
)
from harmolab.rescoring import BeatBatch, rescore
from harmolab.types import BeatTrack, FloatArray, Motion

PART_SECONDS = 6.0
N_OTHERS = 5  # pieces of other music for the "other" null


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of one sequence, with everything that does not depend on which music it is scored against.

    Parameters
    ----------
    sequence : str, folder of the sequence
    window : int, which window of the sequence it belongs to
    dance : str
    figures : frozenset of str, figures danced in it (empty when nobody wrote them down)
    unit : str, the unit that fills most of it, the sequence when units have no names: what a rotation moves as one
    start, duration : float, seconds on the audio time line
    track : BeatTrack, all music beats of the recording
    cycle : int, beats in a bar pattern's cycle
    visual : dict from "turns", "valleys", "peaks", "kinematic" to that kind of visual beats
    times, speed : (T,) arrays, the normalised joint speed
    sums : PatternSums or None, what it adds to a bar pattern; None when it has no tempo
    """

    sequence: str
    window: int
    dance: str
    figures: frozenset[str]
    unit: str
    start: float
    duration: float
    track: BeatTrack
    cycle: int
    visual: Mapping[str, BeatTrack]
    times: FloatArray
    speed: FloatArray
    sums: PatternSums | None = None

    @property
    def period(self) -> float:
        """Median beat interval in seconds around the part; of one second when there are no beats."""
        near = self.track.times[(self.track.times > self.start - 5) & (self.track.times < self.start + 15)]
        return float(np.median(np.diff(near))) if near.size > 1 else 1.0

    def music(self, shift: float = 0.0, track: BeatTrack | None = None) -> BeatTrack:
        """The music's beats on the part's time line, the music coming `shift` seconds late."""
        return (track or self.track).span(self.start - shift, self.duration)


def cut_parts(folder: folders.Recording, beats: str, window: float | None, params: HarmonyParams) -> list[Part]:
    """The parts of one sequence; `window` in seconds, None for the whole sequence. Short sequences are one window."""
    clip = folder.clip
    if clip.motion is None:
        raise ValueError(f"{folder.folder}: no motion")
    track = music_beats(folder, beats)
    meter = _meter(folder, beats) if track.bar_places is not None else None
    length = clip.motion.duration if window is None else window
    n_windows = max(1, int(clip.motion.duration / length + 1e-6))
    parts: list[Part] = []
    length = min(length, clip.motion.duration)
    per_window = max(1, int(length / PART_SECONDS + 1e-6))
    for index in range(n_windows * per_window):
        # On a frame, or the music would be up to half a frame off.
        start = round(index * length / per_window * clip.motion.fps) / clip.motion.fps
        parts.append(_part(folder, clip.motion.span(start, length / per_window), start, track, meter, params))
        parts[-1] = replace(parts[-1], window=index // per_window)
    return parts


def _meter(folder: folders.Recording, beats: str) -> int | None:
    """Beats in a bar: as annotated, or as the dance has it."""
    if beats == "annotated" and folder.annotation is not None:
        return folder.annotation.meter
    return DANCES[folder.clip.dance].meter if folder.clip.dance in DANCES else None


def _part(
    folder: folders.Recording, motion: Motion, start: float, track: BeatTrack, meter: int | None, params: HarmonyParams
) -> Part:
    """One stretch of a sequence; the motion itself is not kept, so a large corpus stays small in memory."""
    clip = folder.clip
    units = _units_in(folder, clip.offset + start, motion.duration)
    longest = max(units, key=units.__getitem__)[1] if units else str(folder.folder)
    times, speed = normalised_speed(motion, params)
    part = Part(
        str(folder.folder), 0, clip.dance, frozenset(figure for figure, _ in units), longest, clip.offset + start,
        motion.duration, track, cycle_of_meter(meter), _visual_tracks(motion), times, speed,
    )  # fmt: skip
    music = part.music()
    if len(music) < 2:
        return part
    return replace(part, sums=pattern_sums(beat_positions(times, music), speed, part.cycle))


def _visual_tracks(motion: Motion) -> dict[str, BeatTrack]:
    """Visual beats of every kind that a score reads."""
    valleys = HarmonyParams.valleys()
    kinds = {
        "turns": HarmonyParams.paper(),
        "valleys": valleys,
        "peaks": replace(valleys, detector="peaks"),
        "kinematic": kinematic_params(),
    }
    return {kind: visual_beats(motion, params=params) for kind, params in kinds.items()}


def _units_in(folder: folders.Recording, start: float, length: float) -> dict[tuple[str, str], float]:
    """Seconds that each (figure, unit) fills of a stretch of the audio time line."""
    found: dict[tuple[str, str], float] = {}
    for unit in folder.annotation.units if folder.annotation else ():
        overlap = min(unit.end, start + length) - max(unit.start, start)
        if overlap > 0:
            key = (unit.figure or unit.name, unit.name)
            found[key] = found.get(key, 0.0) + overlap
    return found


def usable(part: Part, judged: Part, *, same_corpus: bool) -> bool:
    """May `part` be fitted on when `judged` is scored? Same dance and cycle, no shared figure, another sequence."""
    if part.dance != judged.dance or part.cycle != judged.cycle:
        return False
    if same_corpus and part.sequence == judged.sequence:
        return False
    return not (part.figures & judged.figures)


def learn_patterns(parts: Sequence[Part], fit_parts: Sequence[Part] | None = None) -> list[BarPattern]:
    """A bar pattern for each part, learnt on what `usable` admits; movements that stop on the beat where nothing is.

    Where the place in the bar is unknown nothing is learnt: over one beat the figures of a dance cancel out, and what
    is left points the other way for a figure that was left out.
    """
    source = parts if fit_parts is None else fit_parts
    patterns = []
    for judged in parts:
        pieces = [
            part.sums
            for part in source
            if part.sums and judged.cycle > 1 and usable(part, judged, same_corpus=fit_parts is None)
        ]
        label = f"{len(pieces)} parts of {judged.dance or 'the corpus'}"
        patterns.append(fit_pattern(pieces, source=label) if pieces else BarPattern.stop_on_the_beat())
    return patterns


def dance_patterns(sequences: Iterable[folders.Recording]) -> dict[str, BarPattern]:
    """The bar pattern of each dance in a corpus with annotated beats: what `harmolab learn` writes.

    Raises
    ------
    ValueError
        If there is nothing to learn from.
    """
    parts = all_parts(sequences, "annotated", None, HarmonyParams.recommended())
    pieces: dict[str, list[PatternSums]] = {}
    for part in parts:
        if part.sums is not None:
            pieces.setdefault(part.dance, []).append(part.sums)
    if not pieces:
        raise ValueError("no sequence with annotated beats to learn from")
    return {
        dance: fit_pattern(rows, source=f"{len(rows)} parts of {dance or 'unknown dance'}")
        for dance, rows in pieces.items()
    }


def score_against(
    part: Part, pattern: BarPattern, params: HarmonyParams, pieces: Sequence[BeatTrack]
) -> dict[str, FloatArray]:
    """Every score of one part against each piece of music (on the part's time line): name -> (len(pieces),) array."""
    paper = rescore(BeatBatch.of([(music, part.visual["turns"]) for music in pieces]), HarmonyParams.paper())
    table = {
        "paper": paper.harmony,
        "recommended": np.array([_pattern_score(part, pattern, params, music) for music in pieces]),
        "paper_above_chance": paper.harmony_above_chance,
        "hit_rate": paper.hit_rate,
    }
    for kind in ("valleys", "peaks"):
        batch = BeatBatch.of([(music, part.visual[kind]) for music in pieces])
        table[kind] = rescore(batch, HarmonyParams.valleys()).harmony_above_chance
    moves = part.visual["kinematic"].times
    rows = [
        {
            "beat_align_motion": beat_align(moves, music.times),
            "beat_align_music": beat_align(music.times, moves),
            "beat_hit_rate": beat_hit_rate(moves, music.times),
            **mir_eval_scores(music.times, moves, only=("f",)),
        }
        for music in pieces
    ]
    return table | {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _pattern_score(part: Part, pattern: BarPattern, params: HarmonyParams, music: BeatTrack) -> float:
    """The recommended score of one part with one piece of music."""
    fit = fit_of_speed(music, part.times, part.speed, replace(params, pattern=pattern), n_rotations=60)
    return above_chance(fit.mean, fit.chance) if fit.shares.size else 0.0


def score_parts(
    parts: Sequence[Part], patterns: Sequence[BarPattern], params: HarmonyParams, progress: Progress = silent
) -> dict[str, list[FloatArray]]:
    """Every score of every part at shifts of 0, 0.1, 0.2 ... beat over its cycle: name -> one array a part."""
    table: dict[str, list[FloatArray]] = {}
    for part, pattern in progress(list(zip(parts, patterns, strict=True)), "scoring"):
        pieces = [part.music(step * part.period / 10) for step in range(10 * part.cycle)]
        for name, values in score_against(part, pattern, params, pieces).items():
            table.setdefault(name, []).append(values)
    return table


def score_others(
    parts: Sequence[Part], patterns: Sequence[BarPattern], params: HarmonyParams, seed: int, progress: Progress
) -> dict[str, list[FloatArray]]:
    """Every score of every part against `N_OTHERS` stretches of other sequences' music."""
    rng = np.random.default_rng(seed)
    tracks = {part.sequence: part.track for part in parts}
    if len(tracks) < 2:
        raise ValueError("other music needs at least two sequences")
    table: dict[str, list[FloatArray]] = {}
    for part, pattern in progress(list(zip(parts, patterns, strict=True)), "scoring other music"):
        names = rng.choice([name for name in tracks if name != part.sequence], N_OTHERS)
        pieces = [_stretch(tracks[str(name)], part.duration, rng) for name in names]
        for name, values in score_against(part, pattern, params, pieces).items():
            table.setdefault(name, []).append(values)
    return table


def _stretch(track: BeatTrack, duration: float, rng: np.random.Generator) -> BeatTrack:
    """A random stretch of a recording's beats."""
    return track.span(rng.uniform(0, max(track.duration - duration, 0.01)), duration)


def constant_lags(
    parts: Sequence[Part],
    grids: Sequence[FloatArray],
    fit_parts: Sequence[Part] | None = None,
    fit_grids: Sequence[FloatArray] | None = None,
) -> list[int]:
    """For each part the shift (tenths of a beat, within a beat) that scores best on the parts it may be fitted on."""
    source, table = (parts, grids) if fit_parts is None or fit_grids is None else (fit_parts, fit_grids)
    lags = []
    for judged in parts:
        rows = [
            grid.reshape(-1, 10).mean(axis=0)
            for part, grid in zip(source, table, strict=True)
            if usable(part, judged, same_corpus=fit_parts is None)
        ]
        lags.append(int(np.argmax(np.mean(rows, axis=0))) if rows else 0)
    return lags


def all_parts(
    sequences: Iterable[folders.Recording], beats: str, window: float | None, params: HarmonyParams
) -> list[Part]:
    """The parts of every sequence."""
    return [part for item in sequences for part in cut_parts(item, beats, window, params)]
