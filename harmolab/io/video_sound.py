"""The sound of video files, through PyAV; and the sound of any file that has one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from harmolab.io.audio import load_audio
from harmolab.io.files import PathLike
from harmolab.io.video import is_video, opened_container
from harmolab.types import Audio

MIN_RATE, MAX_RATE = 1000, 768_000
MAX_LATE = 60.0  # seconds that the sound may start behind the pictures


def load_sound(
    path: PathLike, *, start: float = 0.0, duration: float | None = None, sample_rate: float | None = 22050.0
) -> Audio:
    """A sound file, or the sound of a video; the parameters and errors are those of `load_audio`."""
    if not is_video(path):
        return load_audio(path, start=start, duration=duration, sample_rate=sample_rate)
    sound = video_sound(path, sample_rate=sample_rate)
    if not 0 <= start < sound.duration:
        raise ValueError(f"{path}: has {sound.duration:.2f} s of sound, none from {start:g} s on")
    return sound.span(start, sound.duration - start if duration is None else duration)


def video_sound(path: PathLike, *, sample_rate: float | None = 22050.0, max_seconds: float = 3600.0) -> Audio:
    """The sound of a video, mixed to one channel; it starts with the file, so that it fits `video_frames`.

    Parameters
    ----------
    path : str or path
    sample_rate : float or None, hertz
        Resampled to this rate. None keeps the file's rate.
    max_seconds : float
        More than this is an error.

    Returns
    -------
    Audio with float32 samples; silence where the sound starts later than the file

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; a video without sound is an error.
    """
    with opened_container(Path(path)) as container:
        if not container.streams.audio:
            raise ValueError("holds no sound; name the music's own file")
        stream = container.streams.audio[0]
        if stream.codec_context is None or not MIN_RATE <= stream.codec_context.sample_rate <= MAX_RATE:
            raise ValueError(f"holds sound that cannot be read; {MIN_RATE} to {MAX_RATE} Hz can be sound")
        rate = round(sample_rate or stream.codec_context.sample_rate)
        pieces = list(_pieces(container, stream, rate, max_seconds))
        if not pieces:
            raise ValueError("holds no samples of sound")
        return Audio(np.concatenate(pieces), rate)


def _pieces(container: Any, stream: Any, rate: int, max_seconds: float) -> Iterator[NDArray[np.float32]]:
    """The samples from the start of the file on; silence first, or the beginning cut, where the sound starts apart."""
    resampler = av.AudioResampler(format="flt", layout="mono", rate=rate)
    skip, count = None, 0
    for block in itertools.chain(container.decode(stream), [None]):  # None empties the resampler
        if skip is None:
            late = (block.time or 0.0) - (container.start_time or 0) / av.time_base if block is not None else 0.0
            if not (math.isfinite(late) and abs(late) <= MAX_LATE):
                raise ValueError(f"starts its sound {late:.0f} s from its pictures; its time stamps are damaged")
            skip = max(0, -round(late * rate))
            yield np.zeros(max(0, round(late * rate)), np.float32)
        for part in resampler.resample(block):
            samples = part.to_ndarray()[0][skip:]
            skip = max(0, skip - part.samples)
            count += samples.size
            if count > max_seconds * rate:
                raise ValueError(f"has more than {max_seconds:g} s of sound; cut it into parts")
            yield samples
