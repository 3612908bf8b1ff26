"""Speed of Audio to Body Dynamics: cleaning and placing an hour of points; three minutes of sound played.

Cleaning is held against one copy of the same points; a tenth of the frames is bad, in bursts of up to six. Playing is
held against real time, on one core: the sound is loaded, heard, passed through the network and put on an avatar. The 28
numbers are held against librosa's 13 coefficients of the same frames. Only ratios mean something on another machine.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import librosa
import numpy as np
import torch

from benchmarks.timing import best_of
from harmolab.musician import Audio2Body
from harmolab.musician.avatar import avatar
from harmolab.musician.cleaning import cleaned, placed, reference_configuration
from harmolab.musician.networks import predicted_points
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import continued, steps_of
from harmolab.musician.sound_features import RATE, normalised_loudness, sound_features
from harmolab.musician.synthetic import planted_performance
from harmolab.readers.audio import load_audio, save_audio
from harmolab.readers.player_points import PLAYER_50
from harmolab.types import Motion

SECONDS, FPS = 3600.0, 24.0
SONG = 180.0  # seconds that are played


def hour_of_points(seed: int = 0) -> Performance:
    """An hour of 50 slowly moving points; a tenth of the frames are somewhere else, in bursts."""
    rng = np.random.default_rng(seed)
    n_frames = round(SECONDS * FPS)
    place = rng.uniform([150, 100], [450, 400], (50, 2))
    phase = np.arange(n_frames)[:, None] / FPS + rng.uniform(0, 6, 50)
    points = place + 20 * np.stack([np.sin(phase), np.cos(phase)], axis=-1) + rng.normal(0, 1, (n_frames, 50, 2))
    for first in np.flatnonzero(rng.random(n_frames) < 0.03):
        points[first : first + rng.integers(1, 7)] += rng.uniform(100, 300, 2)
    return Performance("an hour", "piano", None, Motion(points, FPS, PLAYER_50))


def aligned(performance: Performance) -> Motion:
    """The performance cleaned, and placed where its own medians are."""
    result = cleaned(performance)
    return placed(result, reference_configuration(result))


def measure(rounds: int = 3) -> dict[str, float]:
    """Milliseconds of cleaning, of cleaning and placing, and of a copy; share of frames rejected."""
    performance = hour_of_points()
    works: dict[str, Callable[[], object]] = {
        "cleaning (ms)": lambda: cleaned(performance),
        "cleaning and placing (ms)": lambda: aligned(performance),
        "a copy (ms)": performance.motion.positions.copy,
    }
    times = {name: best_of(work, rounds) for name, work in works.items()}
    times["times a copy"] = times["cleaning and placing (ms)"] / times["a copy (ms)"]
    return times | {"share rejected": 1 - cleaned(performance).accepted.mean()}


def played(song: Path, system: Audio2Body) -> Motion:
    """All of `harmolab perform` but the beats and the writing, nothing from a cache."""
    audio, params = load_audio(song), system.network.params
    sound = sound_features(audio, params, round(SONG * params.fps), cached=False)
    points = predicted_points(system.network, sound)
    return avatar(Motion(points.reshape(len(points), -1, 2), params.fps, system.network.skeleton), "piano")


def measure_playing(rounds: int = 3) -> dict[str, float]:
    """Frames a second of the network, times real time of playing, the 28 numbers in librosa's 13, each on one core."""
    system, threads = Audio2Body.shipped("piano"), torch.get_num_threads()
    params, heard = system.network.params, Audio2BodyParams()
    frames = round(SONG * params.fps)
    audio = planted_performance("piano", seconds=SONG).performance.audio
    if audio is None:
        raise ValueError("a planted performance has a sound")
    steps = continued(steps_of(sound_features(audio, params, frames), params.upsample), params.delay_steps)
    samples = normalised_loudness(audio)
    mfcc = {"sr": RATE, "n_mfcc": 13, "n_mels": 40, "n_fft": 2048, "hop_length": round(RATE / FPS), "window": "hamming"}
    try:
        torch.set_num_threads(1)
        with tempfile.TemporaryDirectory() as folder:
            song = Path(folder) / "song.wav"
            save_audio(song, audio)
            whole = best_of(lambda: played(song, system), rounds)
        network = best_of(lambda: system.network.predicted(steps), rounds)
        features = best_of(lambda: sound_features(audio, heard, frames, cached=False), rounds)
        coefficients = best_of(lambda: librosa.feature.mfcc(y=samples, **mfcc), rounds)
    finally:
        torch.set_num_threads(threads)
    return {
        "network (frames a second)": 1000 * frames / network,
        "playing (times real time)": 1000 * SONG / whole,
        "28 numbers (times librosa's 13)": features / coefficients,
    }


if __name__ == "__main__":
    for name, value in (measure() | measure_playing()).items():
        print(f"{name:32s}{value:12.3f}" if value < 1 else f"{name:32s}{value:12.1f}")
