"""Music with a click on each of its beats, to judge beats by ear."""

from __future__ import annotations

import numpy as np

from harmolab.types import Audio, BeatTrack

SECONDS = 0.03  # of a click
DECAY = 0.006  # seconds in which it falls to 1/e
PITCHES = (2400.0, 1500.0)  # hertz: on "one", on any other beat
MUSIC = 0.5  # amplitude of the music, whose largest is 1, under clicks of 0.5


def with_clicks(audio: Audio, track: BeatTrack) -> Audio:
    """The music, its loudest sample at half of full scale, with a click on each beat, higher on the first of a bar."""
    samples = audio.samples * (MUSIC / max(float(np.abs(audio.samples).max()), 1e-12))
    time = np.arange(round(SECONDS * audio.sample_rate)) / audio.sample_rate
    one, other = (0.5 * np.sin(2 * np.pi * pitch * time) * np.exp(-time / DECAY) for pitch in PITCHES)
    places = np.ones(len(track)) if track.bar_places is None else track.bar_places
    for first, place in zip(np.round(track.times * audio.sample_rate).astype(int), places, strict=True):
        click = (other if place else one)[: max(0, samples.size - first)]
        samples[first : first + click.size] += click
    return Audio(samples, audio.sample_rate)
