"""Recordings cut into clips, and every score of a clip at a grid of shifts of its music: what `corpus` ranks.

Each clip is scored against its own music moved in tenths of a beat over one cycle of its bar pattern; all else is
arithmetic on that grid. Whatever a score fits (bar patterns, lags) is fitted on another corpus, or inside the corpus
on clips of other recordings that share no figure with the judged clip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.bar_pattern import PatternSums, beat_positions, fit_of_speed, fit_pattern, normalised_speed, pattern_sums
from harmolab.beats.meter import cycle_of_meter
from harmolab.beats.visual import visual_beats
from harmolab.corpora import folders
from harmolab.corpora.files import corpus_recordings
from harmolab.corpora.folders import recording_beats
from harmolab.harmony import above_chance
from harmolab.io.files import PathLike, Progress, silent
from harmolab.lab.compare.batch import BeatBatch, rescore
from harmolab.metrics.beats import beat_align, beat_hit_rate, kinematic_params, mir_eval_scores
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.types import BeatTrack, FloatArray, Motion

CLIP_SECONDS = 6.0
N_OTHERS = 5  # stretches of other music for the "other" null


@dataclass(frozen=True, eq=False)
class BeatClip:
    """A clip of a recording as scores need it: beats and speed, nothing that depends on the music it is scored with.

    Parameters
    ----------
    sequence : str, folder of the recording
    window : int, which window of the recording it belongs to
    dance : str
    figures : frozenset of str, figures danced in it (empty where none are annotated)
    unit : str, the annotated unit that fills most of it, else the recording: what a rotation moves as one
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
    sums: PatternSums | None

    @property
    def period(self) -> float:
        """Median beat interval in seconds around the clip; of one second when there are no beats."""
        near = self.track.times[(self.track.times > self.start - 5) & (self.track.times < self.start + 15)]
        return float(np.median(np.diff(near))) if near.size > 1 else 1.0

    def music(self, shift: float = 0.0) -> BeatTrack:
        """The music's beats on the clip's time line, the music coming `shift` seconds late."""
        return self.track.span(self.start - shift, self.duration)


def cut_clips(recording: folders.Recording, beats: str, window: float | None, params: HarmonyParams) -> list[BeatClip]:
    """The clips of one recording, each of `CLIP_SECONDS` or more, as many as fit into its windows.

    `window` is in seconds, None for the whole recording; a shorter recording is one window.
    """
    motion = recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    track = recording_beats(recording, beats)
    cycle = cycle_of_meter(_meter(recording, beats) if track.bar_places is not None else None)
    n_windows = 1 if window is None else max(1, int(motion.duration / window + 1e-6))
    length = motion.duration if window is None else min(window, motion.duration)
    per_window = max(1, int(length / CLIP_SECONDS + 1e-6))
    clips = []
    for index in range(n_windows * per_window):
        # On a frame, or the music would be up to half a frame off.
        start = round(index * length / per_window * motion.fps) / motion.fps
        movement = motion.span(start, length / per_window)
        clips.append(_beat_clip(recording, index // per_window, start, movement, track, cycle, params))
    return clips


def _meter(recording: folders.Recording, beats: str) -> int | None:
    """Beats in a bar: as annotated, or as the dance has it."""
    if beats == "annotated" and recording.annotation is not None:
        return recording.annotation.meter
    return DANCES[recording.clip.dance].meter if recording.clip.dance in DANCES else None


def _beat_clip(
    recording: folders.Recording,
    window: int,
    start: float,
    motion: Motion,
    track: BeatTrack,
    cycle: int,
    params: HarmonyParams,
) -> BeatClip:
    """The clip of a span of the motion; the motion itself is not kept, so a large corpus stays small in memory."""
    folder, begins = str(recording.folder), recording.clip.offset + start
    units = _units_in(recording, begins, motion.duration)
    longest = max(units, key=units.__getitem__)[1] if units else folder
    times, speed = normalised_speed(motion, params)
    music = track.span(begins, motion.duration)
    sums = pattern_sums(beat_positions(times, music), speed, cycle) if len(music) > 1 else None
    return BeatClip(
        folder, window, recording.clip.dance, frozenset(figure for figure, _ in units), longest, begins,
        motion.duration, track, cycle, _visual_tracks(motion), times, speed, sums,
    )  # fmt: skip


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


def _units_in(recording: folders.Recording, start: float, length: float) -> dict[tuple[str, str], float]:
    """Seconds that each (figure, unit) fills of a stretch of the audio time line."""
    seconds: dict[tuple[str, str], float] = {}
    for unit in recording.annotation.units if recording.annotation else ():
        overlap = min(unit.end, start + length) - max(unit.start, start)
        if overlap > 0:
            key = (unit.figure or unit.name, unit.name)
            seconds[key] = seconds.get(key, 0.0) + overlap
    return seconds


def usable(clip: BeatClip, judged: BeatClip, *, same_corpus: bool) -> bool:
    """May `clip` be fitted on when `judged` is scored? Same dance and cycle, no shared figure, another recording."""
    if (clip.dance, clip.cycle) != (judged.dance, judged.cycle) or clip.figures & judged.figures:
        return False
    return not (same_corpus and clip.sequence == judged.sequence)


def learn_patterns(clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None = None) -> list[BarPattern]:
    """A bar pattern for each clip, learnt on what `usable` admits; movements that stop on the beat where nothing is.

    Where the place in the bar is unknown nothing is learnt: over one beat the figures of a dance cancel out, and what
    is left points the other way for a figure that was left out.
    """
    source = clips if fit_clips is None else fit_clips
    patterns = []
    for judged in clips:
        rows = [
            clip.sums
            for clip in source
            if clip.sums and judged.cycle > 1 and usable(clip, judged, same_corpus=fit_clips is None)
        ]
        label = f"{len(rows)} clips of {judged.dance or 'the corpus'}"
        patterns.append(fit_pattern(rows, source=label) if rows else BarPattern.stop_on_the_beat())
    return patterns


def dance_patterns(
    corpus: PathLike | Iterable[folders.Recording],
    *,
    progress: Progress = silent,
    report: Callable[[folders.Problem], object] = lambda problem: None,
) -> dict[str, BarPattern]:
    """The bar pattern of each dance in a corpus with annotated beats: what `harmolab learn` writes.

    `corpus` is a folder or its recordings; the other parameters and errors are those of `corpus_recordings`.

    Raises
    ------
    ValueError
        If there is nothing to learn from.
    """
    recordings = corpus_recordings(corpus, progress=progress, report=report)
    rows: dict[str, list[PatternSums]] = {}
    for clip in all_clips(recordings, "annotated", None, HarmonyParams.recommended()):
        if clip.sums is not None:
            rows.setdefault(clip.dance, []).append(clip.sums)
    if not rows:
        raise ValueError("no sequence with annotated beats to learn from")
    return {
        dance: replace(fit_pattern(sums, source=f"{len(sums)} clips of {dance or 'unknown dance'}"), dance=dance)
        for dance, sums in rows.items()
    }


def score_against(
    clip: BeatClip, pattern: BarPattern, params: HarmonyParams, tracks: Sequence[BeatTrack]
) -> dict[str, FloatArray]:
    """Every score of one clip against each music (on the clip's time line): name -> (len(tracks),) array."""
    paper = rescore(BeatBatch.of([(music, clip.visual["turns"]) for music in tracks]), HarmonyParams.paper())
    table = {
        "paper": paper.harmony,
        "recommended": np.array([_pattern_score(clip, pattern, params, music) for music in tracks]),
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


def _pattern_score(clip: BeatClip, pattern: BarPattern, params: HarmonyParams, music: BeatTrack) -> float:
    """The recommended score of one clip with one music."""
    fit = fit_of_speed(music, clip.times, clip.speed, replace(params, pattern=pattern), n_rotations=60)
    return above_chance(fit.mean, fit.chance) if fit.shares.size else 0.0


def score_shifts(
    clips: Sequence[BeatClip], patterns: Sequence[BarPattern], params: HarmonyParams, progress: Progress = silent
) -> dict[str, list[FloatArray]]:
    """Every score of every clip at shifts of 0, 0.1, 0.2 ... beat over its cycle: name -> one array a clip."""

    def shifted(clip: BeatClip) -> list[BeatTrack]:
        return [clip.music(step * clip.period / 10) for step in range(10 * clip.cycle)]

    return _score_table(progress(clips, "scoring"), patterns, params, shifted)


def score_others(
    clips: Sequence[BeatClip], patterns: Sequence[BarPattern], params: HarmonyParams, seed: int, progress: Progress
) -> dict[str, list[FloatArray]]:
    """Every score of every clip against `N_OTHERS` random stretches of other recordings' music."""
    rng = np.random.default_rng(seed)
    tracks = {clip.sequence: clip.track for clip in clips}
    if len(tracks) < 2:
        raise ValueError("other music needs at least two sequences")

    def others(clip: BeatClip) -> list[BeatTrack]:
        names = rng.choice([name for name in tracks if name != clip.sequence], N_OTHERS)
        music = [tracks[str(name)] for name in names]
        return [track.span(rng.uniform(0, max(track.duration - clip.duration, 0.01)), clip.duration) for track in music]

    return _score_table(progress(clips, "scoring other music"), patterns, params, others)


def _score_table(
    clips: Iterable[BeatClip],
    patterns: Sequence[BarPattern],
    params: HarmonyParams,
    music_of: Callable[[BeatClip], list[BeatTrack]],
) -> dict[str, list[FloatArray]]:
    """Every score of every clip against its music: name -> one array a clip."""
    table: dict[str, list[FloatArray]] = {}
    for clip, pattern in zip(clips, patterns, strict=True):
        for name, values in score_against(clip, pattern, params, music_of(clip)).items():
            table.setdefault(name, []).append(values)
    return table


def constant_lags(
    clips: Sequence[BeatClip],
    grids: Sequence[FloatArray],
    fit_clips: Sequence[BeatClip] | None = None,
    fit_grids: Sequence[FloatArray] | None = None,
) -> list[int]:
    """For each clip the shift (tenths of a beat, within a beat) that scores best on the clips it may be fitted on."""
    source, table = (clips, grids) if fit_clips is None or fit_grids is None else (fit_clips, fit_grids)
    lags = []
    for judged in clips:
        rows = [
            grid.reshape(-1, 10).mean(axis=0)
            for clip, grid in zip(source, table, strict=True)
            if usable(clip, judged, same_corpus=fit_clips is None)
        ]
        lags.append(int(np.argmax(np.mean(rows, axis=0))) if rows else 0)
    return lags


def all_clips(
    recordings: Iterable[folders.Recording], beats: str, window: float | None, params: HarmonyParams
) -> list[BeatClip]:
    """The clips of every recording."""
    return [clip for recording in recordings for clip in cut_clips(recording, beats, window, params)]
