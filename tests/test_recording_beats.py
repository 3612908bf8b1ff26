"""Beats of a sequence's music: annotated or tracked."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harmolab.data.recordings import Recording, recording_beats
from harmolab.readers.beats import BeatAnnotation
from harmolab.types import Audio, Clip
from tests.builders import cases


def sequence(audio: Audio, annotation: BeatAnnotation | None, dance: str = "cha-cha") -> Recording:
    return Recording(Clip("a", audio, dance=dance), annotation, Path("corpus/a"))


def test_annotated_beats_have_the_strength_of_the_musics_onsets(click_track: Callable[..., Audio]):
    # Clicks at 0.5, 1.0 ... s; nothing sounds at 1.25 s.
    track = recording_beats(sequence(click_track(120), BeatAnnotation([1.0, 1.25, 1.5])), "annotated")
    np.testing.assert_array_equal(track.times, [1.0, 1.25, 1.5])
    assert track.strengths[1] < 0.1 * track.strengths[[0, 2]].min()


def test_annotated_beats_of_silent_music_are_equally_strong():
    track = recording_beats(sequence(Audio(np.zeros(22050), 22050.0), BeatAnnotation([0.2, 0.8])), "annotated")
    np.testing.assert_array_equal(track.strengths, [1.0, 1.0])


def test_tracked_beats_keep_to_the_tempo_of_the_dance(click_track: Callable[..., Audio]):
    # Clicks at 160 a minute: a jive counts each, a waltz, 78 to 96 a minute, every other one.
    for dance, period in (("jive", 60 / 160), ("waltz", 60 / 80)):
        track = recording_beats(sequence(click_track(160, seconds=20.0), None, dance), "tracked")
        assert np.median(np.diff(track.times)) == pytest.approx(period, abs=0.025)


@cases("annotation, fault", (None, "no beats.json"), (BeatAnnotation([]), "beats.json holds no beats"))
def test_annotated_beats_that_are_missing_are_an_error(annotation: BeatAnnotation | None, fault: str):
    with pytest.raises(ValueError, match=rf"corpus/a: {fault}; use tracked beats"):
        recording_beats(sequence(Audio(np.zeros(22050), 22050.0), annotation), "annotated")
