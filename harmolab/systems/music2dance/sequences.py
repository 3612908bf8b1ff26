"""Whole recordings as the networks of Music2Dance take them: music ten times a second, motion and contacts at one rate.

Sequences are kept whole; training windows of eight seconds are cut out of them (`WindowSource`), and drawn so that rare
movement comes up as often as other movement.
"""

import warnings
import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from torch import Tensor

from harmolab.body.kinematics import resample_motion
from harmolab.data.recordings import Recording, true_runs
from harmolab.files import PathLike, Progress, silent
from harmolab.params import DANCES
from harmolab.systems.music2dance.codes import MotionCode, PositionCode, RotationCode
from harmolab.systems.music2dance.music_features import mel_features, music_features
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.feet import foot_contacts
from harmolab.systems.training.groups import Segment, motion_in_space
from harmolab.systems.training.layers import PATH_CHANNELS, Statistics, channel_statistics
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import CutRecording, UnitSet, cut_recording, grouped_units, read_recordings
from harmolab.types import Audio, BeatTrack, BoolArray, FloatArray, IntArray, Motion, SingleArray

VALID_SHARE = 0.9  # of a window's frames must be recorded movement


@dataclass(frozen=True, eq=False)
class DanceSequence:
    """A recording, coded.

    Parameters
    ----------
    name : str, corpus folder and folder of the recording
    dance : str, "" where unknown
    start : float, seconds, audio time of frame 0
    segments : spans of audio time and the motion groups that they belong to
    music : (M, F) array of the whole song, from audio time 0
    motion : (T, C) array, the motion code, not standardised
    contacts : (T, 2) array, 1 where a foot stands
    poses : (T, 3 J) array, metres: joints in the heading frame, whatever the code
    valid : (T,) mask, False for filler
    """

    name: str
    dance: str
    start: float
    segments: tuple[Segment, ...]
    music: SingleArray
    motion: SingleArray
    contacts: SingleArray
    poses: SingleArray
    valid: BoolArray

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.motion)


@dataclass(frozen=True, eq=False)
class SequenceSet:
    """Recordings of one body.

    Parameters
    ----------
    sequences : tuple of DanceSequence
    code : of their motion
    params : Music2DanceParams that they were read by
    units : UnitSet without features and motion: the spans of time that a split deals out, by motion group
    """

    sequences: tuple[DanceSequence, ...]
    code: MotionCode
    params: Music2DanceParams
    units: UnitSet

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances, sorted."""
        return tuple(sorted({sequence.dance for sequence in self.sequences}))


def song_features(audio: Audio, beats: BeatTrack, params: SongParams, dance: str = "") -> SingleArray:
    """Features of a song, (M, F): attributes, with bars as long as those of `dance`, or a mel spectrogram."""
    if params.features == "mel":
        return mel_features(audio, rate=params.rate, bands=params.mels)
    meter = DANCES[dance].meter if dance in DANCES else 4
    return music_features(audio, beats, meter=meter, rate=params.rate)


class _Read(NamedTuple):
    """A recording until all are read, without its sound."""

    cut: CutRecording
    start: float
    music: SingleArray
    motion: Motion  # at the rate of the parameters
    contacts: BoolArray


def load_sequences(
    roots: Sequence[PathLike], params: Music2DanceParams, *, step: int = 2, progress: Progress = silent
) -> SequenceSet:
    """All recordings of corpora, coded, and the spans of time that a split deals out; each is read once.

    Parameters
    ----------
    roots : folders of recordings
        Those that cannot be read are left out; `units.notes` names them, with the reason.
    params : Music2DanceParams
    step : int, beats between the starts of additional spans, as in `load_units`
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, recordings have different skeletons or bodies that cannot be coded, or no span is long
        enough to be dealt out.
    """
    read, notes = read_recordings(roots, lambda recording: _read(recording, params, step), progress)
    units, segments = grouped_units([item.cut for item in read], FeatureParams.paper(), roots, notes)
    code = motion_code([item.motion for item in read], params)
    sequences = [_coded(item, code, tuple(spans)) for item, spans in zip(read, segments, strict=True)]
    return SequenceSet(tuple(sequences), code, params, units)


def motion_code(motions: Sequence[Motion], params: Music2DanceParams) -> MotionCode:
    """The code of motions of one skeleton; ValueError where rotations cannot be fitted."""
    if params.representation == "positions":
        return PositionCode.of(motions)
    return RotationCode.of(motions, end_effectors=params.end_effectors)


def _read(recording: Recording, params: Music2DanceParams, step: int) -> _Read:
    clip = recording.clip
    motion = resample_motion(motion_in_space(recording), params.fps)
    try:
        contacts = foot_contacts(motion.positions, motion.fps, motion.skeleton)
    except ValueError as error:
        raise ValueError(f"{recording.folder}: it must be known which foot stands, but {error}") from None
    cut = cut_recording(recording, FeatureParams.paper(), step=step, bare=True)
    return _Read(cut, clip.offset, song_features(clip.audio, cut.track, params.song, clip.dance), motion, contacts)


def _coded(item: _Read, code: MotionCode, segments: tuple[Segment, ...]) -> DanceSequence:
    motion, about = item.motion, item.cut.outline
    poses = encode_motion(motion.positions, motion.fps, motion.skeleton)[:, :-PATH_CHANNELS]
    coded, contacts = code.encode(motion).astype(np.float32), item.contacts.astype(np.float32)
    return DanceSequence(
        about.name, about.dance, item.start, segments, item.music, coded, contacts, poses, motion.valid
    )


def side_frames(sequence: DanceSequence, groups: Collection[str], fps: float) -> BoolArray:
    """(T,) mask of the frames that lie in segments of some motion groups."""
    times = sequence.start + np.arange(sequence.n_frames) / fps
    mask = np.zeros(sequence.n_frames, bool)
    for segment in sequence.segments:
        if segment.group in groups:
            mask |= (times >= segment.start) & (times < segment.end)
    return mask


def window_starts(
    sequence: DanceSequence, groups: Sequence[str], params: Music2DanceParams, *, share: float = 1.0
) -> IntArray:
    """First frames of all windows of which a share lies in some motion groups, nine tenths being recorded movement."""
    length = params.n_frames
    if sequence.n_frames < length:
        return np.zeros(0, np.int64)
    inside = frames_from(side_frames(sequence, groups, params.fps), length) >= share * length
    return np.flatnonzero(inside & (frames_from(sequence.valid, length) >= VALID_SHARE * length))


def frames_from(mask: BoolArray, length: int) -> IntArray:
    """Number of ones among `length` entries of a mask (T,) from each on, (T - length + 1,)."""
    total = np.concatenate([[0], np.cumsum(mask)])
    return total[length:] - total[:-length]


# Training windows

N_POSES, N_COMPONENTS = 10, 30  # of a window, by which windows are clustered
LEAST_STD = 1e-3  # of a channel: the root never moves to the side
FITTED = 4000  # windows that the clusters are found from, at most


class Windows(NamedTuple):
    """A batch of windows as the networks take it.

    Parameters
    ----------
    motion : (N, T, C), standardised
    contacts : (N, T, 2), 1 where a foot stands
    music : (N, M, F), standardised features, from the moment of frame 0 or up to one before it
    moments : (N, T), place of every frame in `music`, between its moments too
    dance : (N,), number of the dance
    valid : (N, T), 1 where the motion was recorded, and is of the side of the split that is asked about
    """

    motion: Tensor
    contacts: Tensor
    music: Tensor
    moments: Tensor
    dance: Tensor
    valid: Tensor


def _too_short(sides: Sequence[BoolArray], params: Music2DanceParams) -> str:
    """The longest stretch of a side of the split, the frames of each recording, too short for a window; what helps."""
    stretch = max((last - first for side in sides for first, last in true_runs(side)), default=0) / params.fps
    longest = max(map(len, sides)) / params.fps
    return (
        f"windows are {params.window:g} s long, and the movements that the split by motion group gives one side last "
        f"{stretch:.1f} s in a row at most, though the longest of {len(sides)} recordings lasts "
        f"{longest:.1f} s. Add recordings of a minute or more, or try another --split-seed"
    )


@dataclass(frozen=True, eq=False)
class WindowSource:
    """The windows of one side of a split; a batch draws from all of them (`harmolab.systems.training.loop.Units`).

    Parameters
    ----------
    sequences : SequenceSet
    statistics : Statistics that everything is standardised by
    places : (W, 2) array: number of a sequence, first frame
    weights : (W,) array, how likely each window is drawn; adds up to 1
    counted : of each sequence a (T,) mask: recorded frames of the side
    device : where batches are needed
    """

    sequences: SequenceSet
    statistics: Statistics
    places: IntArray
    weights: FloatArray
    counted: tuple[BoolArray, ...]
    device: torch.device | str = "cpu"

    @classmethod
    def of(
        cls,
        sequences: SequenceSet,
        groups: Sequence[str],
        *,
        statistics: Statistics,
        share: float = 1.0,
        device: torch.device | str = "cpu",
    ) -> Self:
        """The windows of which a share lies in some motion groups; ValueError where there is none."""
        params = sequences.params
        starts = [window_starts(sequence, groups, params, share=share) for sequence in sequences.sequences]
        numbers = np.repeat(np.arange(len(starts)), [own.size for own in starts])
        places = np.column_stack([numbers, np.concatenate(starts)])
        counted = tuple(each.valid & side_frames(each, groups, params.fps) for each in sequences.sequences)
        if not len(places):
            raise ValueError(f"{sequences.units.source}: {_too_short(counted, params)}")
        weights = cluster_weights(sequences.sequences, places, params if share == 1 else replace(params, clusters=0))
        return cls(sequences, statistics, places, weights, counted, device)

    def __len__(self) -> int:
        """Windows of an epoch: as many as fit into the recordings without overlap."""
        length, (numbers, starts) = self.sequences.params.n_frames, self.places.T
        # Places rise: each window covers what lies before the next one, the last of a recording all of its own.
        new = np.where(np.diff(numbers) > 0, length, np.minimum(np.diff(starts), length))
        return max(1, int(new.sum() + length) // length)

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Windows:
        """A batch of as many windows as there are `indices` for process `rank`, drawn anew for these indices.

        The order of an epoch's indices is the epoch's own, so every epoch draws other windows, and a run that resumes
        draws the same ones again.
        """
        seed = zlib.crc32(indices.cpu().numpy().astype("<i8").tobytes())
        drawn = np.random.default_rng(seed).choice(len(self.places), size=len(indices), p=self.weights)
        return self.batch(drawn[rank::world])

    def batch(self, rows: IntArray) -> Windows:
        """The windows of some rows of `places`."""
        parts = [self._window(*self.places[row]) for row in rows]
        motion, contacts, music, moments, dance, valid = (
            torch.from_numpy(np.stack(values)).to(self.device) for values in zip(*parts, strict=True)
        )
        scale = Statistics(*(values.to(self.device) for values in self.statistics))
        motion = (motion - scale.motion_mean) / scale.motion_std
        music = (music - scale.audio_mean) / scale.audio_std
        return Windows(motion, contacts, music, moments, dance, valid)

    def raw(self, row: int) -> tuple[NDArray[Any], ...]:
        """Motion (T, C), not standardised, and contacts (T, 2) of the window of a row of `places`."""
        return self._window(*self.places[row])[:2]

    def _window(self, number: int, start: int) -> tuple[NDArray[Any], ...]:
        """The arrays of one window."""
        sequence, params = self.sequences.sequences[number], self.sequences.params
        frames = slice(start, start + params.n_frames)
        first = (sequence.start + start / params.fps) * params.song.rate
        cell, moments = int(np.floor(first)), first + np.arange(params.n_frames) * params.song.rate / params.fps
        return (
            sequence.motion[frames],
            sequence.contacts[frames],
            cells_from(sequence.music, cell, n_cells(params.song)),
            (moments - cell).astype(np.float32),
            np.array(self.sequences.dances.index(sequence.dance)),
            self.counted[number][frames].astype(np.float32),
        )


def n_cells(params: SongParams) -> int:
    """Moments of music that a window needs, wherever it begins."""
    return int(np.ceil(params.window * params.rate)) + 2


def cells_from(music: SingleArray, first: int, count: int) -> SingleArray:
    """`count` moments of music (M, F) from number `first` on; before the start and after the end its ends hold."""
    return music[np.clip(np.arange(first, first + count), 0, len(music) - 1)]


def training_windows(split: Split, sequences: SequenceSet, device: torch.device | str = "cpu") -> WindowSource:
    """The windows of the training side, and the statistics of that side.

    Raises
    ------
    ValueError
        If the side has no window, or one holds a frame of a figure of another side.
    """
    groups = split.groups["train"]
    source = WindowSource.of(sequences, groups, statistics=training_statistics(sequences, groups), device=device)
    check_leaks(source, split.groups)
    return source


def check_leaks(source: WindowSource, groups: Mapping[str, Sequence[str]]) -> None:
    """ValueError where a training window holds a frame of a figure that is validated or tested on.

    Parameters
    ----------
    source : WindowSource of the training side
    groups : motion groups of each side, as of `Split`
    """
    params = source.sequences.params
    for side, number in product(("validation", "test"), np.unique(source.places[:, 0])):
        sequence = source.sequences.sequences[number]
        starts = source.places[source.places[:, 0] == number, 1]
        held_out = side_frames(sequence, groups[side], params.fps)
        if (leaking := starts[frames_from(held_out, params.n_frames)[starts] > 0]).size:
            frame = leaking[0] + int(held_out[leaking[0] :].argmax())
            fault = f"the training window at frame {leaking[0]} holds frame {frame}"
            raise ValueError(f"{sequence.name}: {fault}, which is in a figure of the {side} side")


def training_statistics(sequences: SequenceSet, groups: Sequence[str]) -> Statistics:
    """Mean and standard deviation of music and motion over the frames of some motion groups; least deviation 1e-3."""
    params = sequences.params
    motion, music = [], []
    for sequence in sequences.sequences:
        frames = np.flatnonzero(side_frames(sequence, groups, params.fps) & sequence.valid)
        cells = np.round((sequence.start + frames / params.fps) * params.song.rate).astype(np.int64)
        motion.append(sequence.motion[frames])
        music.append(sequence.music[np.clip(cells, 0, len(sequence.music) - 1)])
    tables = [torch.from_numpy(np.concatenate(parts))[None] for parts in (music, motion)]
    of_music, of_motion = (channel_statistics(table, torch.ones(table.shape[:2])) for table in tables)
    stds = [std.clamp(min=LEAST_STD) for _, std in (of_music, of_motion)]
    return Statistics(of_music[0], stds[0], of_motion[0], stds[1])


def cluster_weights(sequences: Sequence[DanceSequence], places: IntArray, params: Music2DanceParams) -> FloatArray:
    """Probability of each window, (W,): each cluster of windows with like poses as often as the others (R27)."""
    count = min(params.clusters, len(places))
    if count < 2:
        return np.full(len(places), 1 / len(places))
    at = np.linspace(0, params.n_frames - 1, N_POSES).round().astype(np.int64)
    rng = np.random.default_rng(params.seed)

    def poses(rows: IntArray) -> SingleArray:
        return np.stack([sequences[number].poses[start + at].ravel() for number, start in rows])

    sample = poses(places[rng.permutation(len(places))[:FITTED]]).astype(np.float64)
    mean = sample.mean(axis=0)
    axes = np.linalg.svd(sample - mean, full_matrices=False)[2][:N_COMPONENTS].T
    parts = np.array_split(places, -(-len(places) // FITTED))
    reduced = np.concatenate([(poses(part) - mean) @ axes for part in parts])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a cluster may be empty
        _, labels = kmeans2(reduced, count, minit="++", seed=rng)
    weights = 1 / np.bincount(labels, minlength=count)[labels]
    return weights / weights.sum()
