"""Trials of the guard of a score: it must let dancers through, and no others.

Recorded dancers, who are held against all other recordings; the same with one thing taken from them or added; and
whatever systems dance to their songs. A guard is of use when the first pass and the second fail.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.kinematics import NANOMETRE
from harmolab.body.skeletons import HIPS, body_frame, heading, turned
from harmolab.data.recordings import Recording
from harmolab.metrics.likeness import LONGEST, LikenessLimits, likeness, motion_windows, window_measures
from harmolab.systems.contract import System
from harmolab.types import FloatArray, Motion

Generate = Callable[[Recording], Motion]

RECORDED = "recorded"
NOBODY: Mapping[str, Generate] = MappingProxyType({})


def statue(motion: Motion) -> Motion:
    """The mean pose of a dancer on the dancer's own path, turning as the dancer turns."""
    body = _body(motion)
    return _on_path(motion, np.repeat(body.mean(axis=0, keepdims=True), len(body), axis=0))


def shrunk(motion: Motion, share: float = 0.35) -> Motion:
    """The movement in the body made smaller about the mean pose, on the same path."""
    body = _body(motion)
    middle = body.mean(axis=0)
    return _on_path(motion, middle + share * (body - middle))


def looped(motion: Motion, seconds: float = 4.0) -> Motion:
    """The first seconds of movement in the body over and over, on the same path."""
    frames = np.arange(motion.n_frames) % round(seconds * motion.fps)
    return _on_path(motion, _body(motion)[frames])


def spun(motion: Motion, turns: float = 8.0) -> Motion:
    """The whole dance on a turntable that makes so many turns in half a minute."""
    middle = motion.positions.mean(axis=(0, 1))
    angles = np.linspace(0.0, 2 * np.pi * turns * motion.duration / LONGEST, motion.n_frames)
    return replace(motion, positions=turned(motion.positions - middle, angles[:, None]) + middle)


def _body(motion: Motion) -> FloatArray:
    return body_frame(motion.positions, motion.fps, motion.skeleton)


def _on_path(motion: Motion, body: FloatArray) -> Motion:
    """Poses (T, J, 3) in the body put where the motion is and turned as it is turned."""
    angles = heading(motion.positions, motion.fps, motion.skeleton, parts=HIPS, smoothing=0.0)[:, None]
    torso = motion.positions - turned(_body(motion), angles)
    # To the nanometre: the valleys of rounding errors would be the beats of a statue that stands.
    return replace(motion, positions=(turned(body, angles) + torso[:, :1]).round(NANOMETRE))


DOCTORED: Mapping[str, Callable[[Motion], Motion]] = MappingProxyType(
    {
        RECORDED: lambda motion: motion,
        "statue on the recorded path": statue,
        "4 s looped": looped,
        "movement shrunk to 35 %": shrunk,
        "eight turns added": spun,
    }
)


def guard_verdicts(recordings: Sequence[Recording], systems: Mapping[str, Generate] = NOBODY) -> pd.DataFrame:
    """The likeness of every window of recordings, as recorded and doctored, and of what systems dance to their songs.

    Limits are those of the other recordings, so no dancer is held against himself.

    Parameters
    ----------
    recordings : at least two, each with a motion
    systems : name -> function(recording) -> Motion
        What dances to the song of each recording, such as ``song_dancer(harmolab.systems.load(run))``.

    Returns
    -------
    DataFrame, a row for each window of each motion: motion, recording, dance, passed (None where it cannot be judged),
    fails, verdict, and every measure

    Raises
    ------
    ValueError
        If a recording has no motion, or there are too few.
    """
    motions = [_motion(recording) for recording in recordings]
    measured, dances = [window_measures(motion) for motion in motions], [item.clip.dance for item in recordings]
    rows = []
    for place, recording in enumerate(recordings):
        others = [number for number in range(len(recordings)) if number != place]
        limits = LikenessLimits.of_windows([measured[n] for n in others], [dances[n] for n in others])
        for name, motion in _danced(recording, motions[place], systems):
            judged = likeness(motion, dance=dances[place], limits=limits)
            about = {"motion": name, "recording": recording.clip.name, "dance": dances[place]}
            verdict = {"passed": judged.passed, "fails": ", ".join(judged.fails), "verdict": judged.verdict}
            rows.append(about | verdict | dict(judged.values))
    return pd.DataFrame(rows)


def _danced(recording: Recording, motion: Motion, systems: Mapping[str, Generate]) -> Iterator[tuple[str, Motion]]:
    """Every motion to judge and its name."""
    for part in motion_windows(motion):
        yield from ((name, change(part)) for name, change in DOCTORED.items())
    yield from ((name, generate(recording)) for name, generate in systems.items())


def song_dancer(system: System, *, seconds: float = LONGEST, **options: Any) -> Generate:
    """A function that has a system dance to a recording's song, from where the dancer begins, on the annotated beats.

    `options` are passed on to its ``generate``, such as ``seed=1``.
    """

    def generate(recording: Recording) -> Motion:
        clip = recording.clip
        return system.generate(clip.audio, clip.beats, start=max(clip.offset, 0.0), seconds=seconds, **options)

    return generate


def guard_table(recordings: Sequence[Recording], systems: Mapping[str, Generate] = NOBODY) -> pd.DataFrame:
    """`guard_verdicts`, counted.

    Returns
    -------
    DataFrame, a row for each kind of motion: motion, passed and of (windows), "fails by": the measures that fail and in
    how many windows, the most frequent first
    """
    verdicts = guard_verdicts(recordings, systems)
    rows = []
    for name, group in verdicts.groupby("motion", sort=False):
        counts = Counter(measure for fails in group["fails"] for measure in fails.split(", ") if measure)
        fails = ", ".join(f"{measure} {count}" for measure, count in counts.most_common())
        passed = sum(verdict is True for verdict in group["passed"])
        rows.append({"motion": name, "passed": passed, "of": len(group), "fails by": fails})
    return pd.DataFrame(rows)


def _motion(recording: Recording) -> Motion:
    if recording.clip.motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    return recording.clip.motion
