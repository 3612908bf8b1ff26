"""Beats and bars by Beat This!, a neural tracker (Foscarin, Schlueter, Widmer, ISMIR 2024), where it is installed.

Nothing is downloaded, by us or by its package: weights are a file on this machine.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from harmolab.io.beats import BeatAnnotation
from harmolab.io.files import PathLike, reading
from harmolab.types import Audio, BeatTrack

PACKAGE = "beat_this"
HELP = "get a checkpoint (final0.ckpt) from https://github.com/CPJKU/beat_this and name the file with --checkpoint"


def neural_beats(audio: Audio, checkpoint: PathLike | None) -> BeatTrack:
    """Music beats with their places in the bar, as the network of a checkpoint hears them; on the CPU.

    Parameters
    ----------
    audio : Audio
    checkpoint : path of a file of weights; from its makers only, since such files may hold programs

    Raises
    ------
    ValueError
        Where the package or the file is not here, or the file cannot be read; says what to install and where from.
    """
    if find_spec(PACKAGE) is None:
        raise ValueError(f"--tracker {PACKAGE} needs its package; pip install beat-this, then {HELP}")
    if checkpoint is None or not Path(checkpoint).is_file():
        raise ValueError(f"{checkpoint or PACKAGE}: no weights on this machine; {HELP}")
    with reading(checkpoint, "a checkpoint of beat_this", max_bytes=None) as file:
        # Its package downloads what is no file; it gets the path of one.
        tracker = import_module(f"{PACKAGE}.inference").Audio2Beats(str(file.resolve()), device="cpu")
    beats, downbeats = tracker(np.asarray(audio.samples, np.float32), round(audio.sample_rate))
    return annotation_of(np.asarray(beats, float), np.asarray(downbeats, float)).track(audio.duration)


def annotation_of(beats: np.ndarray, downbeats: np.ndarray) -> BeatAnnotation:
    """Beats and downbeats as an annotation whose meter is the most frequent number of beats from bar to bar."""
    beats, downbeats = np.unique(beats), np.unique(downbeats)
    lengths = np.diff(np.searchsorted(beats, downbeats - 0.01)) if beats.size else np.zeros(0, np.int64)
    lengths = lengths[(lengths >= 1) & (lengths <= 32)]
    if not lengths.size:
        return BeatAnnotation(beats)
    return BeatAnnotation(beats, downbeats, int(np.bincount(lengths).argmax()))
