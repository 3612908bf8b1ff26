"""Training units of a generator: recordings cut into meters with the beats before them (paper Sec. 4.1, Fig. 6).

A unit is a meter of 4 to 6 beats (Eq. 22) preceded by as many beats as fill up the unified length; its motion is coded
as in `harmolab.systems.common.motion_code`. Everything is numpy, at the rate of `FeatureParams.fps`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.beats.meter import meter_units
from harmolab.corpora.folders import Recording, find_recordings, load_recording, recording_beats
from harmolab.io.files import PathLike, Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.systems.common.audio_features import audio_features
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.groups import (
    Outline,
    Segment,
    group_outlines,
    motion_groups,
    motion_in_space,
    outline,
    sequence_name,
)
from harmolab.systems.common.motion_code import bone_lengths, encode_motion
from harmolab.systems.common.priors import temporal_index
from harmolab.systems.common.units import DanceUnit, UnitSet
from harmolab.types import BeatTrack, Clip, Motion

METERS = (4, 5, 6)  # beats in the categories of Eq. 22
EXTRA_METER = 4  # beats in the meter of an additional training unit
VALID_SHARE = 0.9  # of a unit's frames must be recorded movement
LONGEST_UNIT = 30.0  # seconds; where beats lie further apart, they are not counted
TOO_FAST = "DANCE_T_5"  # of Tang's recordings: 2.2 times too fast


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
class _Coded:
    """A recording ready to be cut: its clip, its beats within the motion, features and motion code of all frames."""

    name: str
    clip: Clip
    movement: Motion  # at the rate of the features
    track: BeatTrack
    audio: NDArray[np.float32]
    code: NDArray[np.float32]

    def frame(self, time: float) -> int:
        """The last frame at or before a moment of audio time."""
        return int(np.clip(np.floor((time - self.clip.offset) * self.movement.fps + 1e-6), 0, len(self.code)))


def recording_units(
    recording: Recording,
    params: FeatureParams,
    *,
    step: int | None = None,
    segments: Sequence[Segment] | None = None,
) -> list[DanceUnit]:
    """The units of one recording: one for each meter that has motion and enough beats before it.

    Parameters
    ----------
    recording : Recording
        Annotated beats are used where there are any, else beats tracked with the dance's tempo as prior.
    params : FeatureParams
    step : int or None
        Additional training units of `unit_beats` beats, with a meter of four, from every `step`-th beat on.
    segments : spans of audio time and their motion groups; default: `motion_groups` of this recording alone

    Returns
    -------
    list of DanceUnit in order of time, additional ones last. Units of which more than a tenth is no recorded movement,
    or whose beats before the meter lie outside the motion, are left out.

    Raises
    ------
    ValueError
        If the recording has no motion in three dimensions, or `step` is not positive.
    """
    if step is not None and step < 1:
        raise ValueError(f"step must be a positive number of beats, got {step}")
    coded = _coded(recording, params)
    spans = meter_spans(coded.track, params)
    starts = range(0, len(coded.track) - params.unit_beats, step) if step else ()
    extras = {(start + params.unit_beats - EXTRA_METER, EXTRA_METER) for start in starts} - set(spans)
    units = [_unit(coded, span, params, extra=False) for span in spans]
    units += [_unit(coded, span, params, extra=True) for span in sorted(extras)]
    segments = motion_groups([recording])[0] if segments is None else segments
    return [_grouped(unit, segments) for unit in units if unit is not None]


def _coded(recording: Recording, params: FeatureParams) -> _Coded:
    """Features and motion code of every frame of a recording, and the beats that fall into the motion."""
    clip, annotation = recording.clip, recording.annotation
    motion = resample_motion(motion_in_space(recording), params.fps)
    track = recording_beats(recording, "annotated" if annotation is not None and annotation.times.size else "tracked")
    # Half a frame of grace: recordings start on a frame, not on the beat.
    start, end = clip.offset - 0.5 / motion.fps, clip.offset + (motion.n_frames + 0.5) / motion.fps
    times = clip.offset + np.arange(motion.n_frames) / motion.fps
    inside = track.select((track.times >= start) & (track.times <= end))
    audio, code = (
        audio_features(clip.audio, track, times, params),
        encode_motion(motion.positions, motion.fps, motion.skeleton),
    )
    return _Coded(sequence_name(recording), clip, motion, inside, audio, code)


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
        name=f"{coded.name}:{start}+{first - start}+{count}",
        sequence=coded.name,
        dance=coded.clip.dance,
        groups=frozenset(),
        meter_groups=frozenset(),
        start=at,
        audio=coded.audio[begin:end],
        motion=coded.code[begin:end],
        index=temporal_index(end - begin, meter - begin),
        # A beat up to half a frame before the first frame counts as on it.
        beats=np.maximum(times[start : first + count] - at, 0.0),
        strengths=coded.track.strengths[start : first + count],
        fps=motion.fps,
        extra=extra,
    )


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
        Recordings are read one at a time. Those that cannot be read, and Tang's T_5, which is 2.2 times too fast, are
        left out; `UnitSet.notes` names them, with the reason.
    params : FeatureParams
    step : as in `recording_units`
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, two recordings have different skeletons, or there is no unit at all; both name the folder.
    """
    roots = list(roots) if isinstance(roots, list | tuple) else [roots]
    folders, notes = recording_folders(roots)
    contents: list[_Contents] = []
    for folder in progress(folders, "reading sequences"):
        try:
            recording = load_recording(folder)
            units = recording_units(recording, params, step=step, segments=())
            motion = resample_motion(motion_in_space(recording), params.fps)
            contents.append(_Contents(folder, units, outline(recording), motion))
        except (ValueError, FileNotFoundError) as error:
            notes.append(str(error))
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
        reason = "every sequence is too short" if folders else "there is no sequence (see `harmolab data check`)"
        raise ValueError(f"no unit to train on below {', '.join(map(str, roots))}: {notes[0] if notes else reason}")
    motions = [item.motion for item in contents]
    bones = [bone_lengths(motion.positions[motion.valid], motion.skeleton) for motion in motions]
    lengths = np.average(bones, axis=0, weights=[motion.n_frames for motion in motions])
    source = ", ".join(dict.fromkeys(item.outline.name.rpartition("/")[0] for item in contents))
    return UnitSet(tuple(units), motions[0].skeleton, lengths, params, source, tuple(notes))


class _Contents(NamedTuple):
    """The parts of a recording that a set of units needs; its sound is not kept."""

    folder: Path
    units: list[DanceUnit]  # not yet grouped
    outline: Outline
    motion: Motion  # at the rate of the features


def recording_folders(roots: Iterable[PathLike]) -> tuple[list[Path], list[str]]:
    """Folders of recordings below all roots, each once, and notes on those that are left out."""
    folders: dict[Path, Path] = {}
    notes = []
    for root in roots:
        paths, problems = find_recordings(root)
        notes += [problem.message for problem in problems]
        folders |= {path.resolve(): path for path in paths if path.resolve() not in folders}
    fast = [path for path in folders if path.name == TOO_FAST and not (path / "beats.json").is_file()]
    notes += [f"{folders.pop(path)}: left out, its motion is 2.2 times too fast" for path in fast]
    return list(folders.values()), notes
