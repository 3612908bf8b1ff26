"""Recordings cut into clips, and the bar patterns that are learnt on them.

Whatever a score fits (bar patterns, lags) is fitted on another corpus, or inside the corpus on clips of other
recordings that share no figure with the judged clip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from harmolab.bar_pattern import PatternSums, beat_positions, fit_pattern, normalised_speed, pattern_sums
from harmolab.beats.meter import cycle_of_meter
from harmolab.beats.visual import visual_beats
from harmolab.corpora import folders
from harmolab.corpora.files import corpus_recordings
from harmolab.corpora.folders import recording_beats
from harmolab.io.files import PathLike, Progress, silent
from harmolab.kinematics import smooth_positions, upsample_motion
from harmolab.lab.compare.fits import cycle_curve
from harmolab.metrics.beats import kinematic_params
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.shape_speed import RATE, SMOOTHING, shape_signal, shape_speed
from harmolab.types import BeatTrack, BoolArray, FloatArray, Motion
from harmolab.verdict.evidence import floor

CLIP_SECONDS = 6.0
# Scores with a pattern to learn: the movement signal of each.
FITTED = MappingProxyType({"recommended": HarmonyParams.recommended(), "room_speed": HarmonyParams.room_speed()})
SIGNALS = ("recommended", "bounce")  # what a discriminant reads: shape speed, and how fast the body's centre rises


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
    is_placed : bool; False where beats are counted from the recording's first, since "one" is not known
    visual : dict from "turns", "valleys", "peaks", "kinematic" to that kind of visual beats
    speeds : dict from the names of `FITTED` and "bounce" to (times, speed), the normalised movement signal
    sums : dict from the names of `FITTED` to what it adds to a bar pattern; empty when it has no tempo
    lessons : dict from `SIGNALS` to its `cycle_curve` on the beats that it teaches by: what a discriminant learns from
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
    is_placed: bool
    visual: Mapping[str, BeatTrack]
    speeds: Mapping[str, tuple[FloatArray, FloatArray]]
    sums: Mapping[str, PatternSums]
    lessons: Mapping[str, FloatArray]

    @property
    def period(self) -> float:
        """Median beat interval in seconds around the clip; of one second when there are no beats."""
        near = self.track.times[(self.track.times > self.start - 5) & (self.track.times < self.start + 15)]
        return float(np.median(np.diff(near))) if near.size > 1 else 1.0

    def music(self, shift: float = 0.0) -> BeatTrack:
        """The music's beats on the clip's time line, the music coming `shift` seconds late."""
        return self.track.span(self.start - shift, self.duration)


def cut_clips(recording: folders.Recording, beats: str, window: float | None) -> list[BeatClip]:
    """The clips of one recording, each of `CLIP_SECONDS` or more, as many as fit into its windows.

    `window` is in seconds, None for the whole recording; a shorter recording is one window.
    """
    motion = recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    track = recording_beats(recording, beats)
    annotated = recording.clip.beats
    teacher = annotated if beats == "tracked" and annotated is not None and len(annotated) else track
    cycle = cycle_of_meter(None if teacher.bar_places is None else _meter(recording))
    judged = track if track.bar_places is not None else replace(track, bar_places=np.arange(len(track)) % cycle)
    n_windows = 1 if window is None else max(1, int(motion.duration / window + 1e-6))
    length = motion.duration if window is None else min(window, motion.duration)
    per_window = max(1, int(length / CLIP_SECONDS + 1e-6))
    clips = []
    is_placed = cycle == 1 or track.bar_places is not None
    for index in range(n_windows * per_window):
        # On a frame, or the music would be up to half a frame off.
        start = round(index * length / per_window * motion.fps) / motion.fps
        movement = motion.span(start, length / per_window)
        clips.append(_beat_clip(recording, index // per_window, start, movement, judged, teacher, cycle, is_placed))
    return clips


def _meter(recording: folders.Recording) -> int | None:
    """Beats in a bar: as annotated, or as the dance has it."""
    if recording.annotation is not None and recording.annotation.meter is not None:
        return recording.annotation.meter
    return DANCES[recording.clip.dance].meter if recording.clip.dance in DANCES else None


def _beat_clip(
    recording: folders.Recording,
    window: int,
    start: float,
    motion: Motion,
    track: BeatTrack,
    teacher: BeatTrack,
    cycle: int,
    is_placed: bool,
) -> BeatClip:
    """The clip of a span of the motion; the motion itself is not kept, so a large corpus stays small in memory.

    It is judged by the beats of `track`, and teaches by those of `teacher`: annotated ones, where there are any.
    """
    folder, begins = str(recording.folder), recording.clip.offset + start
    units = _units_in(recording, begins, motion.duration)
    longest = max(units, key=units.__getitem__)[1] if units else folder
    speeds = {name: _speed(motion, params) for name, params in FITTED.items()}
    beats = teacher.span(begins, motion.duration)
    is_timed = len(beats) > 1
    sums = {
        name: pattern_sums(beat_positions(row[0], beats), row[1], cycle) for name, row in speeds.items() if is_timed
    }
    speeds["bounce"] = bounce(motion)
    lessons = {name: cycle_curve(*speeds[name], beats, cycle) for name in SIGNALS}
    return BeatClip(
        folder, window, recording.clip.dance, frozenset(figure for figure, _ in units), longest, begins,
        motion.duration, track, cycle, is_placed, _visual_tracks(motion), speeds, sums, lessons,
    )  # fmt: skip


def _speed(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, FloatArray]:
    """`normalised_speed` of a clip; all 0 where too little moves inside the body to judge its shape."""
    times, speed = normalised_speed(motion, params)
    is_judged = params.measure != "shape" or not floor(shape_signal(shape_speed(motion)))
    return times, speed * is_judged


def bounce(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Seconds and vertical velocity of the mean of all joints, upwards, in its standard deviations over the clip.

    Both are (T',) arrays on the time line of the shape speed; the velocity is 0 where the body keeps its height.
    """
    fine = upsample_motion(motion, RATE)
    centre = smooth_positions(fine.positions, SMOOTHING, fine.fps).mean(axis=1)
    speeds = np.gradient(centre, 1 / fine.fps, axis=0)
    upwards = speeds[:, 1] * (-1 if centre.shape[1] == 2 else 1)  # a picture's y points down
    spread = upwards.std()
    is_level = spread <= 1e-9 * max(np.abs(speeds).max(), 1e-300)
    return np.arange(upwards.size) / fine.fps, 0 * upwards if is_level else (upwards - upwards.mean()) / spread


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


def usable(clip: BeatClip, judged: BeatClip, *, same_corpus: bool, any_dance: bool = False) -> bool:
    """May `clip` be fitted on when `judged` is scored? Same dance and cycle, no shared figure, another recording.

    With `any_dance` the dances of one cycle share what they teach.
    """
    if clip.cycle != judged.cycle or clip.figures & judged.figures:
        return False
    if clip.dance != judged.dance and not any_dance:
        return False
    return not (same_corpus and clip.sequence == judged.sequence)


def usable_clips(
    clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None = None, *, any_dance: bool = False
) -> BoolArray:
    """(n, m) bools: clip j of `fit_clips` (of the corpus itself when left out) may be fitted on when i is judged."""
    source, same = (clips, True) if fit_clips is None else (fit_clips, False)
    rows = [[usable(clip, judged, same_corpus=same, any_dance=any_dance) for clip in source] for judged in clips]
    return np.array(rows, bool).reshape(len(clips), len(source))


def learn_patterns(
    clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None = None, *, score: str = "recommended"
) -> list[BarPattern]:
    """A bar pattern for each clip, learnt on what `usable` admits; movements that stop on the beat where nothing is.

    `score` is the name in `FITTED` whose movement signal is learnt. Where the place in the bar is unknown to all, that
    is the curve over one beat.
    """
    source = clips if fit_clips is None else fit_clips
    patterns = []
    for judged, row in zip(clips, usable_clips(clips, fit_clips), strict=True):
        rows = [source[index].sums[score] for index in np.flatnonzero(row).tolist() if source[index].sums]
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
    for recording in recordings:
        for clip in cut_clips(recording, "annotated", None):
            if clip.sums:
                rows.setdefault(clip.dance, []).append(clip.sums["recommended"])
    if not rows:
        raise ValueError("no sequence with annotated beats to learn from")
    return {
        dance: replace(fit_pattern(sums, source=f"{len(sums)} clips of {dance or 'unknown dance'}"), dance=dance)
        for dance, sums in rows.items()
    }
