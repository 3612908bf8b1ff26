"""A performance from sound: the network over a recording, in one pass."""

import numpy as np
from numpy.typing import NDArray

from harmolab.musician.bow import Strokes, loudness, turns_of
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.sequences import continued, frames_of, steps_of
from harmolab.musician.sound_features import note_features, sound_features
from harmolab.types import Audio, FloatArray, Motion, Notes


def synthesize_performance(
    network: SoundToPoints,
    audio: Audio,
    *,
    start: float = 0.0,
    seconds: float | None = None,
    notes: Notes | None = None,
) -> Motion:
    """The points of a musician who plays a recording: (T, P, 2) pixels of the reference configuration.

    Parameters
    ----------
    network : trained
    audio : the whole recording
    start : float, seconds of audio time of frame 0; the network hears the recording from its beginning
    seconds : float; to the end when left out or longer
    notes : of the recording, needed by a network that hears notes

    Raises
    ------
    ValueError
        If `start` or `seconds` lies outside the recording, less than two frames are left, or notes are missing.
    """
    params = network.params
    length = audio.duration - start if seconds is None else min(seconds, audio.duration - start)
    if not (np.isfinite(start) and start >= 0 and length > 0):
        raise ValueError(f"start and seconds must lie within the recording of {audio.duration:.2f} s")
    first, count = round(start * params.fps), int(length * params.fps + 1e-6)
    if count < 2:
        raise ValueError(f"{length:.2f} s of sound are less than two frames of {1 / params.fps:.3f} s")
    if params.hears == "notes":
        if notes is None:
            raise ValueError("this network hears notes, not sound; pass them")
        sound = note_features(notes, params.fps, first + count)
    else:
        sound = sound_features(audio, params, first + count)
    points = predicted_points(network, sound)[first:]
    return Motion(points.reshape(count, -1, 2), params.fps, network.skeleton)


def predicted_points(
    network: SoundToPoints, sound: NDArray[np.float32], *, strokes: Strokes | None = None
) -> FloatArray:
    """Points (T, 2 P) for what is heard (T, F), in one pass over the whole recording.

    With `bow_phase`, `strokes` may be given in place of those that `predicted_strokes` hears.
    """
    params = network.params
    components = _predicted_steps(network, sound)[:, : len(network.space.sizes)]
    points = network.space.decode(frames_of(components, params.upsample, params.delay_steps))
    bow = network.bow
    if bow is None:
        return points
    strokes = predicted_strokes(network, sound) if strokes is None else strokes
    return bow.at_place(points, bow.places(strokes, len(points), params.fps))


def predicted_strokes(network: SoundToPoints, sound: NDArray[np.float32]) -> Strokes:
    """The strokes of the bow for what is heard (T, F); ValueError for a network without `bow_phase`."""
    bow = network.bow
    if bow is None:
        raise ValueError("this network was trained without bow_phase; it knows no strokes")
    params = network.params
    signal = _predicted_steps(network, sound)[params.delay_steps :, -1]
    turns = turns_of(signal, params.step_rate)
    return bow.strokes(turns, loudness(sound, params), params.fps)


def _predicted_steps(network: SoundToPoints, sound: NDArray[np.float32]) -> FloatArray:
    """Outputs of the network, (S + delay, n) steps, over a whole recording (T, F)."""
    params = network.params
    return network.predicted(continued(steps_of(sound, params.upsample), params.delay_steps))
