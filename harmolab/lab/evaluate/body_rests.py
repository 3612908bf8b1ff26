"""Does the body come to rest on the beats? The plainest number of a dance, beside that of half a beat later."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harmolab.harmony import score_motion
from harmolab.kinematics import in_body
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Motion


def rests_on_beat(motion: Motion, music: BeatTrack, *, late: float = 0.0) -> float:
    """Harmony above chance of the moments at which the joints are slowest in the body (`HarmonyParams.valleys`).

    The body's way through the room and its turns are taken out before. 0 is what chance reaches, 1 a rest on every
    beat; NaN where nothing moves in the body. Recorded ballroom dancers have about .06: they do not dance that plainly.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on its time line
    late : float, beats by which the music is taken to be later: at .5 a dancer who rests on the beat is below chance
    """
    if len(music) < 2:
        return float("nan")
    score = score_motion(
        later(music, late) if late else music, in_body(motion), params=HarmonyParams.valleys(), n_rotations=0
    )
    return score.harmony_above_chance if score.n_visual else float("nan")


def later(music: BeatTrack, beats: float) -> BeatTrack:
    """Music of which every beat comes so many beats later; those beyond its end are left out."""
    steps = np.diff(music.times)
    times = music.times + beats * np.append(steps, steps[-1:])
    return replace(music, times=times, duration=max(music.duration, times[-1])).span(0.0, music.duration)
