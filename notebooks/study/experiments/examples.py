"""The running example of the notebooks, and the middle of a recording as a clip."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from harmolab.data.recordings import Recording, recording_beats
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.types import Clip, Motion

EXAMPLE_SECONDS = 12.0
SONG_SECONDS = 36.0
SOURCE = "synthetic song, CMU motion capture"


def example_recording(dance: str, *, seed: int = 1) -> Recording:
    """36 s of a synthetic song and a dance to it: recorded salsa, cut at its rests and laid on the song's beats.

    The beats of the music are planted, and so are the dancer's rests: on those beats, as closely as recorded movement
    rests on its own. The bank knows no other dance and no bar.

    Parameters
    ----------
    dance : str, one of `harmolab.DANCES`, the song's
    seed : int, of the song

    Raises
    ------
    ValueError
        For a dance that is unknown.
    """
    planted = planted_clip(ClipSettings(dance, SONG_SECONDS, seed=seed), name=f"example {dance}")
    song = planted.clip
    danced = shipped_bank("salsa").choreograph(song.audio, song.beats, seconds=SONG_SECONDS)
    clip = replace(song, motion=danced.motion, offset=danced.start, source=SOURCE)
    return Recording(clip, replace(planted.annotation, units=()), Path(clip.name))


def waltz_example(*, late: float = 0.0) -> Clip:
    """The notebooks' running example: twelve seconds of recorded movement that is free, laid on a synthetic waltz.

    Parameters
    ----------
    late : float, seconds by which the dance comes later than it was laid, rounded to whole frames

    Returns
    -------
    Clip from 0 s, its `beats` tracked in the whole song. Without recordings `clip_of_study` are the same seconds.
    """
    recording = example_recording("waltz")
    fps = cast(Motion, recording.clip.motion).fps
    offset = recording.clip.offset + round(late * fps) / fps
    clip = replace(recording.clip, beats=recording_beats(recording, "tracked"), offset=offset)
    return clip.span((SONG_SECONDS - EXAMPLE_SECONDS) / 2, EXAMPLE_SECONDS)


def middle_span(recording: Recording, seconds: float) -> tuple[float, float]:
    """Start in the music and length, in seconds, of the middle of what music and motion of a recording share.

    It starts on a frame of the motion and is at most `seconds` long.

    Raises
    ------
    ValueError
        If the recording has no motion.
    """
    clip, motion = recording.clip, recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    first, last = max(0.0, -clip.offset), min(motion.duration, clip.audio.duration - clip.offset)
    length = min(seconds, last - first)
    # On a frame, and never before the music.
    start = float(np.ceil((first + (last - first - length) / 2) * motion.fps - 1e-6) / motion.fps)
    return max(0.0, clip.offset + start), length


def excerpt(recording: Recording, seconds: float, beats: str = "tracked") -> Clip:
    """`middle_span` of a recording as a clip that starts at 0 s, with its music beats; as `clip_of_study`.

    Raises
    ------
    ValueError
        If the recording has no motion.
    """
    start, length = middle_span(recording, seconds)
    track = recording_beats(recording, "tracked" if recording.annotation is None else beats)
    clip = replace(recording.clip, name=f"{recording.clip.name} from {start:.1f} s", beats=track)
    return replace(clip.span(start, length), offset=0.0)  # the span starts on a frame
