"""From performances to sequences: points cleaned, placed and at the network's rate; the sound beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harmolab.corpora.instruments import Performance
from harmolab.io.files import Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.systems.audio2body.cleaning import CleaningRules, cleaned
from harmolab.systems.audio2body.gaps import training_frames
from harmolab.systems.audio2body.params import Audio2BodyParams
from harmolab.systems.audio2body.placing import Reference, placed, reference_configuration
from harmolab.systems.audio2body.sequences import PlayedSequence, PlayedSet, PlayedSplit
from harmolab.systems.audio2body.sound_features import note_features, sound_features
from harmolab.types import FloatArray, Motion


def played_set(
    performances: Sequence[Performance],
    params: Audio2BodyParams,
    split: PlayedSplit,
    *,
    progress: Progress = silent,
) -> PlayedSet:
    """Performances as the network takes them, placed as the first one of the training side is.

    Those of the test side are cleaned whatever `params.reject` and `params.gaps` say, and keep their time line.

    Raises
    ------
    ValueError
        Where they are of several instruments or sets of points, all frames of one are rejected, or one lacks the sound
        or the notes that are to be heard; it names the performance.
    """
    check_alike(performances)
    first = next((each for each in performances if each.name == split.train[0]), None)
    if first is None:
        raise ValueError(f"the split names {split.train[0]!r}, which is no performance here")
    reference = reference_configuration(cleaned(at_rate(first, params.fps), cleaning_rules(first)))
    sequences = tuple(
        read_sequence(each, params, reference, is_test=each.name in split.test)
        for each in progress(performances, "reading performances")
    )
    source = ", ".join(dict.fromkeys(each.source for each in performances if each.source))
    skeleton, instrument = first.motion.skeleton, first.instrument
    return PlayedSet(sequences, skeleton, instrument, params, reference, source)


def check_alike(performances: Sequence[Performance]) -> None:
    """ValueError unless performances are of one instrument and one set of points."""
    if not performances:
        raise ValueError("no performance to train on")
    first = performances[0]
    for other in performances[1:]:
        if other.instrument != first.instrument:
            raise ValueError(f"{first.name} is played on a {first.instrument}, {other.name} on a {other.instrument}")
        if other.motion.skeleton != first.motion.skeleton:
            counts = len(first.motion.skeleton.joints), len(other.motion.skeleton.joints)
            raise ValueError(
                f"{first.name} has {counts[0]} points, {other.name} {counts[1]}; train on one set of points"
            )


def at_rate(performance: Performance, fps: float) -> Performance:
    """A performance whose points have a frame rate; a point between two is detected where both are."""
    motion = performance.motion
    if motion.fps == fps:
        return performance
    resampled = resample_motion(motion, fps)
    places = np.arange(resampled.n_frames) * motion.fps / fps
    before = np.minimum(np.floor(places + 1e-6).astype(np.int64), motion.n_frames - 1)
    after = np.minimum(np.ceil(places - 1e-6).astype(np.int64), motion.n_frames - 1)
    detected = performance.detected[before] & performance.detected[after]
    return replace(performance, motion=resampled, detected=detected)


def read_sequence(
    performance: Performance, params: Audio2BodyParams, reference: Reference, *, is_test: bool = False
) -> PlayedSequence:
    """A performance as the network takes it; ValueError names one that cannot be.

    Parameters
    ----------
    performance : Performance
    params : Audio2BodyParams
    reference : that its points are placed by
    is_test : cleaned, and with its own time line, whatever `params` say of training
    """
    performance = at_rate(performance, params.fps)
    result = cleaned(performance, cleaning_rules(performance) if is_test or params.reject else CleaningRules.off())
    motion = placed(result, reference, alignment=params.alignment)
    frames = training_frames(motion, "mask" if is_test else params.gaps)
    points = _flat(frames.positions)
    accepted = result.accepted[frames.frames]
    sound = _input(performance, params, motion)[frames.frames]
    return PlayedSequence(performance.name, performance.piece, sound, points, frames.usable, accepted)


def cleaning_rules(performance: Performance) -> CleaningRules:
    """The rules for a performance: hands without a body have no box whose width could measure a jump."""
    has_body = "left_shoulder" in performance.motion.skeleton.joints
    return CleaningRules() if has_body else CleaningRules(swapped=None, jump=None, centre=None)


def _flat(positions: FloatArray) -> FloatArray:
    return positions.reshape(len(positions), -1)


def _input(performance: Performance, params: Audio2BodyParams, motion: Motion) -> np.ndarray:
    """Sound or notes, (T, F), beside the frames of a motion."""
    if params.hears == "notes":
        if performance.notes is None:
            raise ValueError(f"{performance.name}: its notes are not known; hear the sound")
        return note_features(performance.notes, params.fps, motion.n_frames, start=performance.offset)
    if performance.audio is None:
        raise ValueError(f"{performance.name}: has no sound; render its notes, or hear them")
    return sound_features(performance.audio, params, motion.n_frames, start=performance.offset)
