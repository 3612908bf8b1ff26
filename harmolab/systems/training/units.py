"""Training units of a generator: initial poses, units and padded batches, recordings cut into meters (Sec. 4.1).

A unit is a meter of 4 to 6 beats (Eq. 22) preceded by as many beats as fill up the unified length (paper Sec. 4.1,
Fig. 6); its motion is coded as in `harmolab.systems.training.motion_code`. Everything is numpy, at the rate of
`FeatureParams.fps`. A set of units is of one body. A song is cut into meters likewise, to be danced one after the
other.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from harmolab.beats.meter import meter_units
from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton
from harmolab.data.oddities import Oddity, faults_of, motion_oddities, sound_oddities, training_lines
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.files import PathLike, Progress, silent
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.groups import Outline, Segment, group_outlines, motion_in_space, outline, sequence_name
from harmolab.systems.training.motion_code import bone_lengths, decode_motion, encode_motion
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray, IntArray, Motion, SingleArray

# Temporal index TI and initial poses V_f, from the meter before (paper Sec. 4.1, Eq. 23)


def temporal_index(n_frames: int, n_prior: int) -> SingleArray:
    """TI: 1 where a frame belongs to the meter before, 0 where it belongs to this one; (T,) array.

    Parameters
    ----------
    n_frames : int, frames T of the unit
    n_prior : int, number of them, at its start, that belong to the meter before

    Raises
    ------
    ValueError
        Unless 0 <= n_prior <= n_frames.

    Examples
    --------
    >>> temporal_index(5, 2)
    array([1., 1., 0., 0., 0.], dtype=float32)
    """
    if not 0 <= n_prior <= n_frames:
        raise ValueError(f"n_prior must lie between 0 and n_frames ({n_frames}), got {n_prior}")
    return (np.arange(n_frames) < n_prior).astype(np.float32)


def initial_poses(motion_code: SingleArray, index: SingleArray) -> SingleArray:
    """V_f: the motion where TI is 1, and its mean over those frames everywhere else (paper Eq. 23).

    Parameters
    ----------
    motion_code : (T, C) array, V
        Frames with TI 0 are not read; they may hold any finite numbers.
    index : (T,) array of 0 and 1, TI

    Returns
    -------
    (T, C) array, single precision

    Raises
    ------
    ValueError
        If no frame belongs to the meter before, or the lengths differ.
    """
    prior = np.asarray(index) > 0.5
    if prior.shape != (len(motion_code),):
        raise ValueError(f"index must have one entry per frame ({len(motion_code)}), got shape {prior.shape}")
    if not prior.any():
        raise ValueError("index is 0 everywhere: without a frame of the last meter there is no initial pose (Eq. 23)")
    mean = motion_code[prior].mean(axis=0, dtype=np.float64)
    return np.where(prior[:, None], motion_code, mean).astype(np.float32)


# A unit, a set of units of one body, a padded batch

A = TypeVar("A")  # array or tensor


@dataclass(frozen=True, eq=False)
class DanceUnit:
    """A meter with the beats before it, and the motion danced to both. Frame 0 is the first of the beats before.

    Parameters
    ----------
    name : str, of the unit: recording, number of its first beat, beats before + beats of the meter
    sequence : str, corpus folder and folder of the recording
    dance : str, "" when unknown
    groups, meter_groups : frozenset of str
        Motion groups (figures) that the whole unit touches, and those that the meter itself touches.
    start : float, seconds, audio time of frame 0
    audio : (T, F) array, A_f
    motion : (T, C) array, the motion code, not normalised
    index : (T,) array, TI: 1 in the beats before, 0 in the meter
    beats : (B,) array, seconds from frame 0
    strengths : (B,) array
    fps : float, hertz
    extra : bool
        True for an additional training unit, which overlaps others; a test never uses two that overlap.
    sketch : (T, C) array, the code of a movement to correct, which then is V_f; None for that of Eq. 23
    bar : number of a bar pattern and place in the bar of the first beat; -1 where unknown
    """

    name: str
    sequence: str
    dance: str
    groups: frozenset[str]
    meter_groups: frozenset[str]
    start: float
    audio: SingleArray
    motion: SingleArray
    index: SingleArray
    beats: FloatArray
    strengths: FloatArray
    fps: float
    extra: bool = False
    sketch: SingleArray | None = None
    bar: tuple[int, int] = (-1, -1)

    def __post_init__(self) -> None:
        if not len(self.audio) == len(self.motion) == len(self.index):
            lengths = f"{len(self.audio)}, {len(self.motion)} and {len(self.index)}"
            raise ValueError(f"{self.name}: audio, motion and index must be equally long, got {lengths} frames")
        if self.beats.shape != self.strengths.shape:
            raise ValueError(f"{self.name}: {self.beats.size} beats have {self.strengths.size} strengths")
        if not 0 < self.n_prior < self.n_frames:
            raise ValueError(f"{self.name}: {self.n_prior} of {self.n_frames} frames come before the meter; needs both")

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.motion)

    @property
    def n_prior(self) -> int:
        """Number of frames of the beats before the meter (TI = 1)."""
        return int(self.index.sum())

    @property
    def meter_start(self) -> float:
        """Audio time of the meter's first frame, seconds."""
        return self.start + self.n_prior / self.fps

    @property
    def end(self) -> float:
        """Audio time at which the last frame ends, seconds."""
        return self.start + self.n_frames / self.fps


@dataclass(frozen=True, eq=False)
class UnitSet:
    """Units of one body, to train or test a generator.

    Parameters
    ----------
    units : tuple of DanceUnit, names all different
    skeleton : Skeleton
    bone_lengths : (J,) array, metres, mean over the recordings; 0 where a joint has no parent
    features : FeatureParams of their features
    source : str, names of the corpora
    notes : tuple of str, one for each recording left out, with the reason
    remarks : tuple of str, one for each kind of oddity that spoils what is learnt from recordings that are not left out
    """

    units: tuple[DanceUnit, ...]
    skeleton: Skeleton
    bone_lengths: FloatArray
    features: FeatureParams
    source: str = ""
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [unit.name for unit in self.units]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"two units are called {twice!r}; corpora of the same name need different folders")

    def __len__(self) -> int:
        return len(self.units)

    def decoded(self, code: FloatArray) -> Motion:
        """The motion that a code (T, C) of these units stands for."""
        fps = self.features.fps
        return Motion(decode_motion(code, fps, self.skeleton), fps, self.skeleton)

    def select(self, names: Collection[str] | BoolArray) -> "UnitSet":
        """The units with these names, or those where a (len,) mask is True, in the order they have here.

        Raises
        ------
        ValueError
            For a name that no unit has, or a mask of another length.
        """
        if isinstance(names, np.ndarray) and names.dtype == bool:
            if names.shape != (len(self),):
                raise ValueError(f"the mask must have one entry per unit ({len(self)}), got shape {names.shape}")
            return replace(self, units=tuple(unit for unit, keep in zip(self.units, names, strict=True) if keep))
        selected = {str(name) for name in names}
        if missing := sorted(selected - {unit.name for unit in self.units}):
            raise ValueError(f"no unit is called {missing[0]!r}")
        return replace(self, units=tuple(unit for unit in self.units if unit.name in selected))


@dataclass(frozen=True, eq=False)
class Batch(Generic[A]):
    """Units padded to the longest of them, arrays or tensors of single precision.

    Padding repeats the last frame; its mask is 0.

    Parameters
    ----------
    audio : (N, T, F); motion, initial : (N, T, C); index, mask : (N, T)
        `initial` holds V_f: the units' sketches, or that of Eq. 23; `index` is 0 in the padding.
    beats, strengths, beat_mask : (N, B), seconds from frame 0, strengths, 1 where there is a beat
    bars : (N, 2), number of a bar pattern and place in the bar of the first beat
    """

    audio: A
    motion: A
    initial: A
    index: A
    mask: A
    beats: A
    strengths: A
    beat_mask: A
    bars: A


def collate(units: Sequence[DanceUnit]) -> Batch[SingleArray]:
    """One batch of several training units, padded to the longest, for training a network.

    Parameters
    ----------
    units : sequence of DanceUnit
        A unit is a meter of 4 to 6 beats, with the beats before it that fill it up (Sec. 4.1).

    Returns
    -------
    Batch of arrays, the units first: `audio` (A_f), `motion`, `initial` (V_f, Eq. 23) and `index` (TI) by frame;
    `beats` and `strengths`; `mask` and `beat_mask`, 1 where a frame or beat is no padding; and `bars`

    Raises
    ------
    ValueError
        Without units.
    """
    if not units:
        raise ValueError("a batch needs at least one unit")
    sketches = [initial_poses(unit.motion, unit.index) if unit.sketch is None else unit.sketch for unit in units]
    return Batch(
        audio=_stacked([unit.audio for unit in units]),
        motion=_stacked([unit.motion for unit in units]),
        initial=_stacked(sketches),
        index=_stacked([unit.index for unit in units], fill=0.0),
        mask=_stacked([np.ones(unit.n_frames) for unit in units], fill=0.0),
        beats=_stacked([unit.beats for unit in units], fill=0.0),
        strengths=_stacked([unit.strengths for unit in units], fill=0.0),
        beat_mask=_stacked([np.ones(unit.beats.size) for unit in units], fill=0.0),
        bars=_stacked([np.array(unit.bar) for unit in units]),
    )


def _stacked(arrays: Sequence[NDArray[Any]], fill: float | None = None) -> SingleArray:
    """Arrays (L, ...) of different lengths as one, (N, longest, ...); filled up with `fill` or the last entry."""
    table = np.zeros((len(arrays), max(len(array) for array in arrays), *arrays[0].shape[1:]), dtype=np.float32)
    for row, array in zip(table, arrays, strict=True):
        row[: len(array)] = array
        if len(array):
            row[len(array) :] = array[-1] if fill is None else fill
    return table


# Recordings cut into meters with the beats before them (paper Sec. 4.1, Fig. 6)

METERS = (4, 5, 6)  # beats in the categories of Eq. 22
EXTRA_METER = 4  # beats in the meter of an additional training unit
VALID_SHARE = 0.9  # of a unit's frames must be recorded movement
LONGEST_UNIT = 30.0  # seconds; where beats lie further apart, they are not counted
TOO_FAST = "DANCE_T_5"  # of Tang's recordings: 2.2 times too fast
R = TypeVar("R")


def meter_spans(track: BeatTrack, params: FeatureParams) -> list[tuple[int, int]]:
    """A whole beat track cut into meters, without gaps: (first beat, number of beats) of each, in order.

    Meter units of Eq. 22 stay where they are; what lies between is cut into pieces of 4 to 6 beats. Where that cannot
    be done (3 or 7 beats are left), as few beats of meter units as possible are cut anew. A span of n beats ends with
    the beat first + n, so the spans of B beats cover B - 1 intervals, and the last beat only ends the last span.

    Fewer than two beats make no span. One to three intervals make one short span; seven, which cannot be cut into 4 to
    6, make one span where `params.unit_beats` leaves a beat before it, else 4 and 3.
    """
    total = track.times.size - 1
    if total < 1:
        return []
    if total < min(METERS) or total == 7 < params.unit_beats:
        return [(0, total)]
    if total == 7:
        return [(0, 4), (4, 3)]
    units = meter_units(track)
    firsts = np.searchsorted(track.times, [unit.start for unit in units])
    return _tiling(total, {(int(first), unit.strong.size) for first, unit in zip(firsts, units, strict=True)})


def _tiling(total: int, meters: set[tuple[int, int]]) -> list[tuple[int, int]]:
    """`total` beats cut into pieces of 4 to 6 so that as few beats as possible lie outside the given `meters`."""
    least = [0.0] + [np.inf] * total  # beats outside the meters up to each beat
    piece = [0] * (total + 1)  # length of the piece that ends there
    for end in range(min(METERS), total + 1):
        for length in METERS:
            start = end - length
            cost = least[start] + length * ((start, length) not in meters) if start >= 0 else np.inf
            if cost < least[end]:
                least[end], piece[end] = cost, length
    spans: list[tuple[int, int]] = []
    end = total
    while end > 0:
        spans.append((end - piece[end], piece[end]))
        end -= piece[end]
    return spans[::-1]


@dataclass(frozen=True, eq=False)
class CutRecording:
    """A recording cut into units, without its sound.

    Parameters
    ----------
    folder : Path
    units : list of DanceUnit, not yet grouped
    outline : Outline, of all its motion
    motion : at the rate of the features
    track : its beats, of the whole song
    odd : what is odd about its sound and its motion
    """

    folder: Path
    units: list[DanceUnit]
    outline: Outline
    motion: Motion
    track: BeatTrack
    odd: tuple[Oddity, ...]


class _Coded(NamedTuple):
    """A recording ready to be cut: its clip, its beats within the motion, features and motion code of all frames."""

    name: str
    clip: Clip
    movement: Motion  # at the rate of the features
    track: BeatTrack
    audio: SingleArray
    code: SingleArray

    def frame(self, time: float) -> int:
        """The last frame at or before a moment of audio time."""
        return int(np.clip(np.floor((time - self.clip.offset) * self.movement.fps + 1e-6), 0, len(self.code)))


def cut_recording(
    recording: Recording, params: FeatureParams, *, step: int | None = None, bare: bool = False
) -> CutRecording:
    """A recording and its units, one for each meter that has motion and enough beats before it.

    Groups are found later, over all recordings.

    Parameters
    ----------
    recording : Recording
        Annotated beats are used where there are any, else beats tracked with the dance's tempo as prior.
    params : FeatureParams
    step : int or None
        Additional training units of `unit_beats` beats, with a meter of four, from every `step`-th beat on.
    bare : bool
        Units without features and motion, which say what spans of time a split deals out.

    Returns
    -------
    CutRecording with units in order of time, additional ones last. Units of which more than a tenth is no recorded
    movement, or whose beats before the meter lie outside the motion, are left out.

    Raises
    ------
    ValueError
        If the recording has no motion in three dimensions, or `step` is not positive.
    """
    if step is not None and step < 1:
        raise ValueError(f"step must be a positive number of beats, got {step}")
    annotation, danced = recording.annotation, motion_in_space(recording)
    motion = resample_motion(danced, params.fps)
    track = recording_beats(recording, "annotated" if annotation is not None and annotation.times.size else "tracked")
    coded = _coded(recording, motion, track, params, bare=bare)
    spans = meter_spans(coded.track, params)
    starts = range(0, len(coded.track) - params.unit_beats, step) if step else ()
    extras = {(start + params.unit_beats - EXTRA_METER, EXTRA_METER) for start in starts} - set(spans)
    units = [_unit(coded, span, params, extra=span in extras) for span in (*spans, *sorted(extras))]
    cut = [unit for unit in units if unit is not None]
    odd = (*sound_oddities(recording.clip.audio), *motion_oddities(danced))
    return CutRecording(recording.folder, cut, outline(recording), motion, track, odd)


def _coded(recording: Recording, motion: Motion, track: BeatTrack, params: FeatureParams, *, bare: bool) -> _Coded:
    """Features and motion code of every frame of a recording (none where `bare`), and its beats during the motion."""
    clip, nothing = recording.clip, np.zeros((motion.n_frames, 0), np.float32)
    # Half a frame of grace: recordings start on a frame, not on the beat.
    start, end = clip.offset - 0.5 / motion.fps, clip.offset + (motion.n_frames + 0.5) / motion.fps
    times = clip.offset + np.arange(motion.n_frames) / motion.fps
    inside = track.select((track.times >= start) & (track.times <= end))
    audio = nothing if bare else audio_features(clip.audio, track, times, params)
    code = nothing if bare else encode_motion(motion.positions, motion.fps, motion.skeleton)
    return _Coded(sequence_name(recording.folder), clip, motion, inside, audio, code)


def _unit(coded: _Coded, span: tuple[int, int], params: FeatureParams, *, extra: bool) -> DanceUnit | None:
    """The unit of one meter; None where it lacks motion or beats before it."""
    first, count = span
    start = first - (params.unit_beats - count)
    if start < 0 or count >= params.unit_beats:
        return None
    times, motion = coded.track.times, coded.movement
    begin, meter, end = (coded.frame(times[beat]) for beat in (start, first, first + count))
    if not begin < meter < end or end - begin > LONGEST_UNIT * motion.fps:
        return None
    if motion.valid[begin:end].mean() < VALID_SHARE:
        return None
    at = coded.clip.offset + begin / motion.fps
    return DanceUnit(
        name=f"{coded.name}:{start}+{first - start}+{count}", sequence=coded.name, dance=coded.clip.dance,
        groups=frozenset(), meter_groups=frozenset(), start=at,
        audio=coded.audio[begin:end], motion=coded.code[begin:end], index=temporal_index(end - begin, meter - begin),
        # A beat up to half a frame before the first frame counts as on it.
        beats=np.maximum(times[start : first + count] - at, 0.0),
        strengths=coded.track.strengths[start : first + count], fps=motion.fps, extra=extra,
    )  # fmt: skip


def _grouped(unit: DanceUnit, segments: Sequence[Segment]) -> DanceUnit:
    """`unit` with the motion groups that it and its meter touch; a frame's overlap is rounding, not touching."""
    rounding = 1.0 / unit.fps + 1e-6

    def touched(start: float) -> frozenset[str]:
        return frozenset(
            segment.group for segment in segments if min(unit.end, segment.end) - max(start, segment.start) > rounding
        )

    return replace(unit, groups=touched(unit.start), meter_groups=touched(unit.meter_start))


def load_units(
    roots: PathLike | list[PathLike] | tuple[PathLike, ...],
    params: FeatureParams,
    *,
    step: int | None = None,
    progress: Progress = silent,
) -> UnitSet:
    """The units of one corpus or several.

    Parameters
    ----------
    roots : folder, or list of folders, of recordings
        Recordings are read one at a time. Left out are those that cannot be read or have a fault, as another unit of
        length (`harmolab.data.oddities`), and Tang's T_5, which is 2.2 times too fast: `UnitSet.notes` says why.
    params : FeatureParams
    step : as in `cut_recording`
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, two recordings have different skeletons, or there is no unit at all; both name the folder.
    """
    roots = list(roots) if isinstance(roots, list | tuple) else [roots]
    contents, notes = read_recordings(roots, lambda recording: cut_recording(recording, params, step=step), progress)
    notes += [f"{item.folder}: {NO_UNIT}" for item in contents if not item.units]
    return grouped_units(contents, params, roots, notes)[0]


def read_recordings(
    roots: Iterable[PathLike], read: Callable[[Recording], R], progress: Progress = silent
) -> tuple[list[R], list[str]]:
    """All that `read` makes of the recordings below some roots, one at a time; and a note on each that is left out."""
    folders, notes = recording_folders(roots)
    contents = []
    for folder in progress(folders, "reading sequences"):
        try:
            recording = load_recording(folder)
            if recording.clip.motion is not None and (faults := faults_of(recording.clip.motion)):
                raise ValueError(f"{folder}: {faults[0]}; harmolab data convert writes a whole one")
            contents.append(read(recording))
        except (ValueError, FileNotFoundError) as error:
            notes.append(str(error))
    return contents, notes


def grouped_units(
    contents: Sequence[CutRecording], params: FeatureParams, roots: Iterable[PathLike], notes: Sequence[str]
) -> tuple[UnitSet, list[list[Segment]]]:
    """The units of all recordings with their motion groups, and the segments of each recording.

    Raises
    ------
    ValueError
        If two recordings have different skeletons, or there is no unit at all.
    """
    for item in contents[1:]:
        body, first = item.motion.skeleton, contents[0].motion.skeleton
        if body != first:
            raise ValueError(
                f"{item.folder}: has another skeleton ({len(body.joints)} joints) than {contents[0].folder} "
                f"({len(first.joints)} joints); train on one body"
            )
    segments = group_outlines([item.outline for item in contents])
    units = [_grouped(unit, spans) for item, spans in zip(contents, segments, strict=True) for unit in item.units]
    if not units:
        reason = "every recording is too short" if contents else "there is no recording (see `harmolab data check`)"
        raise ValueError(f"no unit to train on below {', '.join(map(str, roots))}: {notes[0] if notes else reason}")
    motions = [item.motion for item in contents]
    bones = [bone_lengths(motion.positions[motion.valid], motion.skeleton) for motion in motions]
    lengths = np.average(bones, axis=0, weights=[motion.n_frames for motion in motions])
    source = ", ".join(dict.fromkeys(item.outline.name.rpartition("/")[0] for item in contents))
    remarks = tuple(training_lines({item.folder: item.odd for item in contents if item.units}))
    return UnitSet(tuple(units), motions[0].skeleton, lengths, params, source, tuple(notes), remarks), segments


NO_UNIT = "no unit to learn from: no beats were found, or too few in a row that lie inside recorded movement"


def recording_folders(roots: Iterable[PathLike]) -> tuple[list[Path], list[str]]:
    """Folders of recordings below all roots, each once, and notes on those that are left out.

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, or two recordings have one name (`sequence_name`); both name the folder.
    """
    folders: dict[str, Path] = {}
    notes = []
    for root in roots:
        paths, problems = find_recordings(root)
        notes += [problem.message for problem in problems]
        for path in paths:
            name = sequence_name(path)
            first = folders.setdefault(name, path)
            if not first.samefile(path):
                raise ValueError(f"{path}: is called {name}, as {first} is; rename a folder, so that names differ")
    fast = [name for name in folders if Path(name).name == TOO_FAST and not (folders[name] / "beats.json").is_file()]
    notes += [f"{folders.pop(name)}: left out, its motion is 2.2 times too fast" for name in fast]
    return list(folders.values()), notes


# Meters of a song that are danced one after the other, and the frames of each

DEFAULT_PERIOD = 0.5  # seconds between beats where the music has none
LONGEST_INTERVAL = 2.5  # in usual intervals; beats are put into longer ones
# A beat that lies this share of a frame before a frame counts as on it.
EDGE = 1e-6


@dataclass(frozen=True)
class MeterFrames:
    """One meter and the beats before it, in frames of a dance whose frame 0 is its first.

    Parameters
    ----------
    begin, meter, end : int
        First frame of the beats before, first frame of the meter, frame after its last. `begin` may be negative.
    share : float
        Length of the beats before, as a share of the longest possible prior (before a meter of four beats).
    """

    begin: int
    meter: int
    end: int
    share: float


def filled_beats(track: BeatTrack, start: float, end: float, *, before: int) -> tuple[FloatArray, FloatArray]:
    """Times and strengths of a track's beats, with beats added where it has none between `start` and `end`.

    Parameters
    ----------
    track : BeatTrack
    start, end : float, seconds
        The beats reach from `before` beats before `start` to `end` at least.
    before : int

    Returns
    -------
    (B,) times, which may be negative, and (B,) strengths; added beats go on by the median interval, with the median
    strength, so that they are never accents. Without two beats to go by they are half a second apart.
    """
    times, strengths = track.times, track.strengths
    period = float(np.median(np.diff(times))) if times.size > 1 else DEFAULT_PERIOD
    usual = float(np.median(strengths)) if times.size else 1.0
    if not times.size:
        times, strengths = np.array([start]), np.array([usual])
    early = before + max(0, int(np.ceil((times[0] - start) / period)))
    late = max(0, int(np.ceil((end - times[-1]) / period + EDGE)))
    filled, at = paced_beats(times, period, early, late, longest=LONGEST_INTERVAL)
    accents = np.full(filled.size, usual)
    accents[at] = strengths
    return filled, accents


def paced_beats(times: FloatArray, period: float, early: int, late: int, longest: float) -> tuple[FloatArray, IntArray]:
    """Beats (B,) that go on by a period (seconds) for so many more before and after, without gaps: (B',) times.

    In intervals of more than `longest` periods there are beats, evenly spaced. Also the number of each old beat, (B,).
    """
    intervals = np.diff(times)
    steps = np.where(intervals > longest * period, np.round(intervals / period), 1).astype(np.int64)
    at = early + np.concatenate([[0], np.cumsum(steps)])
    numbers = np.arange(at[-1] + late + 1)
    beyond = np.minimum(numbers - early, 0) + np.maximum(numbers - at[-1], 0)
    return np.interp(numbers, at, times) + period * beyond, at


def meter_frames(
    track: BeatTrack, features: FeatureParams, *, start: float, n_frames: int, fps: float
) -> list[MeterFrames]:
    """The meters that cover a dance, in order, without gaps; the first may begin before the dance.

    Parameters
    ----------
    track : BeatTrack on the audio time line
    features : FeatureParams
    start : float, seconds of audio time, of the dance's first frame
    n_frames : int, length of the dance
    fps : float, hertz
    """
    longest = features.unit_beats
    times, strengths = filled_beats(track, start, start + n_frames / fps, before=2 * longest)
    shifted = times - times[0]  # a beat track has no negative times
    spans = meter_spans(BeatTrack(shifted, strengths, track.fps, float(shifted[-1]) + 1.0), features)
    frames = np.floor((times - start) * fps + EDGE).astype(np.int64)
    meters = []
    for first, count in spans:
        meter, end = int(frames[first]), int(frames[first + count])
        before = min(max(longest - count, 1), first)
        if end > max(meter, 0) and meter < n_frames and before:
            begin = min(int(frames[first - before]), meter - 1)
            meters.append(MeterFrames(begin, meter, end, min(before / (longest - 4), 1.0)))
    return meters
