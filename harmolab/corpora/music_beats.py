"""The music's beats of a recorded sequence: annotated or tracked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harmolab.beats.audio import audio_beats, beat_strengths
from harmolab.corpora.folders import Recording
from harmolab.params import DANCES
from harmolab.types import BeatTrack


def music_beats(sequence: Recording, beats: str) -> BeatTrack:
    """Beats of a sequence's music on the audio time line.

    Parameters
    ----------
    sequence : Recording
    beats : "annotated" or "tracked"
        Annotated beats take their strengths from the music's onsets; tracked ones have the dance's tempo as prior.

    Raises
    ------
    ValueError
        If annotated beats are asked for and there are none.
    """
    clip, annotation = sequence.clip, sequence.annotation
    if beats == "annotated":
        if annotation is None:
            raise ValueError(f"{sequence.folder}: no beats.json; use tracked beats")
        if annotation.times.size == 0:
            raise ValueError(f"{sequence.folder}: beats.json holds no beats; use tracked beats")
        duration = max(clip.audio.duration, float(annotation.times[-1]) + 1e-3)
        strengths = np.maximum(beat_strengths(clip.audio, annotation.times), 0.0)
        return replace(annotation.track(duration), strengths=strengths if strengths.any() else annotation.times * 0 + 1)
    return audio_beats(clip.audio, tempo=clip.dance if clip.dance in DANCES else None)
