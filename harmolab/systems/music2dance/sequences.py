"""Whole recordings as the networks of Music2Dance take them: music ten times a second, motion and contacts at one rate.

Sequences are kept whole; training windows are cut out of them (`windows`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.corpora.folders import Recording, load_recording, recording_beats
from harmolab.io.files import PathLike, Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.systems.common.contacts import foot_contacts
from harmolab.systems.common.groups import Outline, Segment, group_outlines, motion_in_space, outline
from harmolab.systems.common.motion_code import encode_motion
from harmolab.systems.common.torch_code import PATH_CHANNELS
from harmolab.systems.common.unit_corpus import recording_folders
from harmolab.systems.music2dance.codes import PositionCode, RotationCode
from harmolab.systems.music2dance.music_features import mel_features, music_features, usual_meter
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.types import Audio, BeatTrack, BoolArray, Motion

SingleArray = NDArray[np.float32]
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
    source : str, names of the corpora
    notes : tuple of str, one for each recording left out, with the reason
    """

    sequences: tuple[DanceSequence, ...]
    code: PositionCode | RotationCode
    params: Music2DanceParams
    source: str = ""
    notes: tuple[str, ...] = ()

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances, sorted."""
        return tuple(sorted({sequence.dance for sequence in self.sequences}))


def song_features(audio: Audio, beats: BeatTrack, params: SongParams, dance: str = "") -> SingleArray:
    """Features of a song, (M, F): attributes, with bars as long as those of `dance`, or a mel spectrogram."""
    if params.features == "mel":
        return mel_features(audio, rate=params.rate, bands=params.mels)
    return music_features(audio, beats, meter=usual_meter(dance), rate=params.rate)


class _Read(NamedTuple):
    """A recording until all are read, without its sound."""

    about: Outline
    start: float
    music: SingleArray
    motion: Motion  # at the rate of the parameters
    contacts: BoolArray


def load_sequences(
    roots: Sequence[PathLike],
    params: Music2DanceParams,
    *,
    progress: Progress = silent,
) -> SequenceSet:
    """All recordings of corpora, coded.

    Parameters
    ----------
    roots : folders of recordings
        Those that cannot be read are left out; `SequenceSet.notes` names them, with the reason.
    params : Music2DanceParams
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, recordings have different skeletons or bodies that cannot be coded, or there is none.
    """
    folders, notes = recording_folders(roots)
    read: list[_Read] = []
    for folder in progress(folders, "reading sequences"):
        try:
            read.append(_read(load_recording(folder), params))
        except (ValueError, FileNotFoundError) as error:
            notes.append(str(error))
    if not read:
        raise ValueError(
            f"no sequence to train on below {', '.join(map(str, roots))}: {(notes or ['none is there'])[0]}"
        )
    motions = [item.motion for item in read]
    code = motion_code(motions, params)
    segments = group_outlines([item.about for item in read])
    sequences = [_coded(item, code, tuple(spans)) for item, spans in zip(read, segments, strict=True)]
    source = ", ".join(dict.fromkeys(item.about.name.rpartition("/")[0] for item in read))
    return SequenceSet(tuple(sequences), code, params, source, tuple(notes))


def motion_code(motions: Sequence[Motion], params: Music2DanceParams) -> PositionCode | RotationCode:
    """The code of motions of one skeleton; ValueError where they have several, or rotations cannot be fitted."""
    if other := next((motion for motion in motions if motion.skeleton != motions[0].skeleton), None):
        counts = len(motions[0].skeleton.joints), len(other.skeleton.joints)
        raise ValueError(f"recordings have different skeletons ({counts[0]} and {counts[1]} joints); train on one body")
    if params.representation == "positions":
        return PositionCode.of(motions)
    return RotationCode.of(motions, end_effectors=params.end_effectors)


def _read(recording: Recording, params: Music2DanceParams) -> _Read:
    clip = recording.clip
    motion = resample_motion(motion_in_space(recording), params.fps)
    try:
        contacts = foot_contacts(motion.positions, motion.fps, motion.skeleton)
    except ValueError as error:
        raise ValueError(f"{recording.folder}: it must be known which foot stands, but {error}") from None
    kind = "annotated" if recording.annotation is not None and recording.annotation.times.size else "tracked"
    music = song_features(clip.audio, recording_beats(recording, kind), params.song, clip.dance)
    return _Read(outline(recording), clip.offset, music, motion, contacts)


def _coded(item: _Read, code: PositionCode | RotationCode, segments: tuple[Segment, ...]) -> DanceSequence:
    motion = item.motion
    poses = encode_motion(motion.positions, motion.fps, motion.skeleton)[:, :-PATH_CHANNELS]
    return DanceSequence(
        item.about.name, item.about.dance, item.start, segments, item.music, code.encode(motion).astype(np.float32),
        item.contacts.astype(np.float32), poses, motion.valid,
    )  # fmt: skip


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
) -> NDArray[np.int64]:
    """First frames of all windows of which a share lies in some motion groups, nine tenths being recorded movement."""
    length = params.n_frames
    if sequence.n_frames < length:
        return np.zeros(0, np.int64)
    inside = frames_from(side_frames(sequence, groups, params.fps), length) >= share * length
    return np.flatnonzero(inside & (frames_from(sequence.valid, length) >= VALID_SHARE * length))


def frames_from(mask: BoolArray, length: int) -> NDArray[np.int64]:
    """Number of ones among `length` entries of a mask (T,) from each on, (T - length + 1,)."""
    total = np.concatenate([[0], np.cumsum(mask)])
    return total[length:] - total[:-length]
