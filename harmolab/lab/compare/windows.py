"""Recordings cut into clips, bar patterns learnt on them, and clips ranked against patterns, many at once.

A clip's H is that of `harmolab.verdict.evidence` with one reading: how high the music's beats rank among all moments
of the clip by their fit to a pattern. Two facts make thousands of null corpora cheap. The fit is linear in the
pattern's coefficients, so the correlations with each harmonic are kept and a new pattern is one product; and music that
begins elsewhere multiplies a clip's Fourier sums by a phase, so patterns are learnt anew by addition.

Whatever a score fits (bar patterns, lags) is fitted on another corpus, or inside the corpus on clips of other
recordings that share no figure with the judged clip.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.beats.meter import cycle_of_meter
from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import smooth_positions, upsample_motion
from harmolab.clips import corpus_recordings
from harmolab.data import recordings as folders
from harmolab.data.recordings import recording_beats
from harmolab.files import PathLike, Progress, silent
from harmolab.metrics.beat_alignment import kinematic_params
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.shape_speed import RATE, SMOOTHING, shape_signal, shape_speed
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray, Motion
from harmolab.verdict import bar_pattern
from harmolab.verdict.evidence import floor

Corpus = PathLike | Iterable[folders.Recording]
Signal = tuple[FloatArray, FloatArray]  # (T,) seconds and values
MOMENTS = 20  # a beat
TENTHS = 10  # of a beat: the lags at which a clip is scored


def cycle_curve(times: FloatArray, speed: FloatArray, track: BeatTrack, cycle: int) -> FloatArray:
    """The speed over whole cycles of beats, (G,) with `MOMENTS` samples a beat, turned to begin where a cycle does.

    Empty without two beats, a whole cycle, or any movement.

    Parameters
    ----------
    times, speed : (T,) arrays, seconds and normalised speed
    track : BeatTrack on the same time line
    cycle : int, beats
    """
    if len(track) < 2 or not speed.any():
        return np.zeros(0)
    curve, first = bar_pattern.beat_curve(times, speed, track, moments=MOMENTS)
    whole = curve.size // (cycle * MOMENTS) * cycle * MOMENTS
    return np.roll(curve[:whole], first % max(whole, 1))


def cycle_curves(signals: Mapping[str, Signal], track: BeatTrack, cycle: int) -> dict[str, FloatArray]:
    """The `cycle_curve` of each signal."""
    return {name: cycle_curve(*signal, track, cycle) for name, signal in signals.items()}


def coefficients(pattern: BarPattern, cycle: int) -> FloatArray:
    """(2 H,) cosines and sines in turn of a pattern over a cycle of its own beats, or of a multiple of them."""
    weights = np.zeros((cycle, 2))
    step = cycle // pattern.beats
    weights[step - 1 : step * len(pattern.cosines) : step] = np.array([pattern.cosines, pattern.sines]).T
    return weights.ravel()


def turned_signals(weights: FloatArray, cycle: int, place: float | FloatArray) -> FloatArray:
    """`turned` coefficients (..., F) of several signals, one after another; a `place` array has the shape (..., 1, 1).

    The harmonics of moments turned by -place are those that the coefficients turned by place see.
    """
    signals = weights.reshape(*weights.shape[:-1], -1, 2 * cycle)
    return bar_pattern.turned(signals, cycle, place).reshape(weights.shape)


@dataclass(frozen=True, eq=False)
class FitBatch:
    """Fits of n clips with one cycle to each harmonic of it.

    Parameters
    ----------
    cycle : int, beats
    fits : (n, F, G) array of `harmonic_fits`, zeros behind the end of a shorter clip: F = 2 cycle for each signal
    sizes : (n,) array of int, moments of each clip: whole cycles, or 0
    """

    cycle: int
    fits: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, curves: Sequence[FloatArray], cycle: int) -> "FitBatch":
        """The batch of n curves of `cycle_curve`, of one signal."""
        sizes = np.array([curve.size for curve in curves], np.int64)
        fits = np.zeros((sizes.size, 2 * cycle, max(sizes.max(initial=0), cycle * MOMENTS)))
        for row, curve in zip(fits, curves, strict=True):
            if curve.size:
                row[:, : curve.size] = bar_pattern.harmonic_fits(curve, cycle, cycle, moments=MOMENTS)
        return cls(cycle, fits, sizes)

    def harmony(self, weights: FloatArray) -> FloatArray:
        """H of every clip at lags of 0, .1, .2 ... beat over its cycle, (n, 10 cycle); 0 for one without moments.

        Parameters
        ----------
        weights : (n, F) array, the coefficients of each clip's pattern
        """
        outside = np.arange(self.fits.shape[2]) >= self.sizes[:, None]
        below = np.where(outside, np.inf, 0.0)
        ranks = np.zeros((self.sizes.size, TENTHS * self.cycle))
        for place in range(self.cycle):
            row = turned_signals(weights, self.cycle, place)[:, None] @ self.fits
            folded = self._cycle_means(_ranks(row[:, 0] + below) * ~outside)
            ranks += np.roll(folded, -MOMENTS * place, axis=1)[:, :: MOMENTS // TENTHS]
        sizes = self.sizes[:, None]
        return np.where(sizes > 0, 2 * (ranks / self.cycle + 0.5) / np.maximum(sizes, 1) - 1, 0.0)

    def _cycle_means(self, values: FloatArray) -> FloatArray:
        """Mean over the cycles of each clip: (n, G) to (n, moments of a cycle)."""
        length = self.cycle * MOMENTS
        folded = values.reshape(self.sizes.size, -1, length).sum(axis=1)
        return np.asarray(folded / np.maximum(self.sizes[:, None] // length, 1))


def signal_batch(curves: Sequence[Mapping[str, FloatArray]], cycle: int, signals: Sequence[str]) -> FitBatch:
    """Fits of n clips to the harmonics of one signal or several: F = 2 cycle features for each of them.

    Parameters
    ----------
    curves : n dicts from `signals` to the `cycle_curve` of a clip; one without the first has no moments, and one that
        stays level has none of the others
    cycle : int, beats
    """
    first = [row[signals[0]] for row in curves]

    def batch(name: str) -> FitBatch:
        pairs = ((row[name], own) for row, own in zip(curves, first, strict=True))
        return FitBatch.of([curve if curve.size == own.size else 0 * own for curve, own in pairs], cycle)

    batches = [batch(name) for name in signals]
    return FitBatch(cycle, np.concatenate([batch.fits for batch in batches], axis=1), batches[0].sizes)


def _ranks(values: FloatArray) -> FloatArray:
    """(n, G) number of values in the row that lie below each one."""
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, values.argsort(axis=1), np.arange(values.shape[1])[None], axis=1)
    return ranks


@dataclass(frozen=True, eq=False)
class Lessons:
    """Fourier sums of the clips that patterns are learnt on, and who may learn from whom.

    Parameters
    ----------
    cycle : int, beats
    sums : (m, 2 cycle) array, cosine and sine sums in turn
    usable : (n, m) bool array: clip j may be learnt on when clip i is judged
    """

    cycle: int
    sums: FloatArray
    usable: BoolArray

    @classmethod
    def of(cls, sums: Sequence[bar_pattern.PatternSums | None], usable: BoolArray, cycle: int) -> "Lessons":
        """The lessons of m clips; one without sums teaches nothing."""
        rows = [np.zeros(cycle, complex) if one is None else one.sums for one in sums]
        both = np.stack([np.real(rows), -np.imag(rows)], axis=-1)
        return cls(cycle, both.reshape(len(rows), -1), usable & np.array([one is not None for one in sums], bool))

    def weights(self, origins: FloatArray | float = 0.0) -> FloatArray:
        """(n, 2 cycle) coefficients learnt for each judged clip, but for their scale, on which no rank depends.

        Where there is nothing to learn from they are those of movements that stop on the beat.

        Parameters
        ----------
        origins : (m,) array, beats by which the music of each clip is moved
        """
        moved = bar_pattern.turned(self.sums, self.cycle, np.broadcast_to(origins, len(self.sums))[:, None])
        rest = coefficients(BarPattern.stop_on_the_beat(), self.cycle)
        weights: FloatArray = self.usable.astype(np.float64) @ moved
        weights[~self.usable.any(axis=1)] = rest
        return weights


CLIP_SECONDS = 6.0
OURS = "recommended"  # shape speed, and the score that learns a pattern of it
SIGNALS = (OURS, "bounce")  # what a discriminant reads: shape speed, and how fast the body's centre rises


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
    speeds : dict from `SIGNALS` to (times, speed), the normalised movement signal
    sums : what its shape speed adds to a bar pattern; None when it has no tempo
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
    speeds: Mapping[str, Signal]
    sums: bar_pattern.PatternSums | None
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
    is_placed = cycle == 1 or track.bar_places is not None
    # On a frame, or the music would be up to half a frame off.
    frames = [round(index * length / per_window * motion.fps) for index in range(n_windows * per_window)]
    spans = [(frame / motion.fps, motion.span(frame / motion.fps, length / per_window)) for frame in frames]
    return [
        _beat_clip(
            recording, *span, teacher, window=index // per_window, track=judged, cycle=cycle, is_placed=is_placed
        )
        for index, span in enumerate(spans)
    ]


def _meter(recording: folders.Recording) -> int | None:
    """Beats in a bar: as annotated, or as the dance has it."""
    if recording.annotation is not None and recording.annotation.meter is not None:
        return recording.annotation.meter
    return DANCES[recording.clip.dance].meter if recording.clip.dance in DANCES else None


def _beat_clip(
    recording: folders.Recording, start: float, motion: Motion, teacher: BeatTrack, *, window: int, track: BeatTrack,
    cycle: int, is_placed: bool,
) -> BeatClip:  # fmt: skip
    """The clip of a span of the motion; the motion itself is not kept, so a large corpus stays small in memory.

    It is judged by the beats of `track`, and teaches by those of `teacher`: annotated ones, where there are any.
    """
    folder, begins = str(recording.folder), recording.clip.offset + start
    units = _units_in(recording, begins, motion.duration)
    longest = max(units, key=units.__getitem__)[1] if units else folder
    times, speed = _shape(motion)
    beats = teacher.span(begins, motion.duration)
    sums = bar_pattern.pattern_sums(bar_pattern.beat_positions(times, beats), speed, cycle) if len(beats) > 1 else None
    speeds = dict(zip(SIGNALS, ((times, speed), bounce(motion)), strict=True))
    return BeatClip(
        sequence=folder, dance=recording.clip.dance, figures=frozenset(figure for figure, _ in units), unit=longest,
        start=begins, duration=motion.duration, cycle=cycle, visual=_visual_tracks(motion), speeds=speeds, sums=sums,
        lessons=cycle_curves(speeds, beats, cycle), window=window, track=track, is_placed=is_placed,
    )  # fmt: skip


def _shape(motion: Motion) -> Signal:
    """Seconds and normalised shape speed of a clip; all 0 where too little moves inside the body to judge its shape."""
    signal = shape_signal(shape_speed(motion))
    return signal.times, np.zeros(signal.values.shape) if floor(signal) else signal.values


def bounce(motion: Motion) -> Signal:
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
    kinds = {"valleys": valleys, "peaks": replace(valleys, detector="peaks")}
    kinds |= {"turns": HarmonyParams.paper(), "kinematic": kinematic_params()}
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
    is_same = same_corpus and clip.sequence == judged.sequence
    if clip.cycle != judged.cycle or clip.figures & judged.figures or is_same:
        return False
    return any_dance or clip.dance == judged.dance


def usable_clips(
    clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None = None, *, any_dance: bool = False
) -> BoolArray:
    """(n, m) bools: clip j of `fit_clips` (of the corpus itself when left out) may be fitted on when i is judged."""
    source, same = (clips, True) if fit_clips is None else (fit_clips, False)
    rows = [[usable(clip, judged, same_corpus=same, any_dance=any_dance) for clip in source] for judged in clips]
    return np.array(rows, bool).reshape(len(clips), len(source))


def learn_patterns(clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None = None) -> list[BarPattern]:
    """A bar pattern for each clip, learnt on what `usable` admits; movements that stop on the beat where nothing is.

    Where the place in the bar is unknown to all, that is the curve over one beat.
    """
    source = clips if fit_clips is None else fit_clips
    patterns = []
    for judged, row in zip(clips, usable_clips(clips, fit_clips), strict=True):
        rows = [sums for index in np.flatnonzero(row).tolist() if (sums := source[index].sums) is not None]
        label = f"{len(rows)} clips of {judged.dance or 'the corpus'}"
        patterns.append(bar_pattern.fit_pattern(rows, source=label) if rows else BarPattern.stop_on_the_beat())
    return patterns


def dance_patterns(
    corpus: Corpus, *, progress: Progress = silent, report: folders.ProblemReport = lambda problem: None
) -> dict[str, BarPattern]:
    """The bar pattern of each dance in a corpus with annotated beats: what `harmolab data learn` writes.

    `corpus` is a folder or its recordings; the other parameters and errors are those of `corpus_recordings`.

    Raises
    ------
    ValueError
        If there is nothing to learn from.
    """
    recordings = corpus_recordings(corpus, progress=progress, report=report)
    rows: dict[str, list[bar_pattern.PatternSums]] = {}
    for recording in recordings:
        for clip in cut_clips(recording, "annotated", None):
            if clip.sums is not None:
                rows.setdefault(clip.dance, []).append(clip.sums)
    if not rows:
        raise ValueError("no recording has annotated beats (beats.json) to learn from")
    labels = {dance: f"{len(sums)} clips of {dance or 'unknown dance'}" for dance, sums in rows.items()}
    fits = {dance: bar_pattern.fit_pattern(sums, source=labels[dance]) for dance, sums in rows.items()}
    return {dance: replace(pattern, dance=dance) for dance, pattern in fits.items()}
