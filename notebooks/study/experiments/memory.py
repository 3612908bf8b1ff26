"""Distance of dances from the movement that their makers were trained on, two seconds at a time.

A network of 300,000 numbers that saw eighteen minutes a thousand times may repeat them. Recorded figures that it never
saw say how near two different figures of one dance are anyway.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from harmolab.body.kinematics import in_body, resample_motion
from harmolab.files import Progress, silent
from harmolab.systems.training.splits import Split
from harmolab.types import FloatArray, Motion
from study.experiments.contestants import EVERY_ROW, RIGHT_SONG
from study.experiments.contests import Contest
from study.experiments.half_minutes import HALF_ROWS, SECONDS
from study.experiments.minutes import common_points, dance_seconds, n_draws, recorded_dancers, unheard_song

RATE = 12.5  # frames a second that are compared
PIECE = 2.0  # seconds
FIRST_SONG = 100  # the same dances as of `half_minutes`
COUNT = 2  # dances of each system in each style
HELD_OUT = "recorded, other figures"


def memory_table(
    contest: Contest, *, rows: Iterable[str] = HALF_ROWS, count: int = COUNT, progress: Progress = silent
) -> pd.DataFrame:
    """Distance of each 2 s of a dance to the nearest 2 s of the training recordings, in the body.

    Returns
    -------
    DataFrame with the columns system, dance, nearest (mean over pieces), closest (5th percentile), both centimetres a
    joint, pieces
    """
    seconds, count = dance_seconds(contest.profile, SECONDS), n_draws(contest.profile, count)
    learnt = np.concatenate([_pieces(recording.clip.motion, hop=2) for recording in contest.teachers])
    outcomes = []
    for name in rows:
        contestants = () if name == RIGHT_SONG else EVERY_ROW[name].contestants(contest)
        for dance in progress(list(recorded_dancers(contest)), name):
            if name == RIGHT_SONG:
                motions = _held_out(contest, dance)
            else:
                songs = [unheard_song(dance, FIRST_SONG + draw, seconds) for draw in range(count)]
                motions = [contestants[draw % len(contestants)].dance(song, draw) for draw, song in enumerate(songs)]
            away = nearest_pieces(motions, learnt)
            row = {"system": HELD_OUT if name == RIGHT_SONG else name, "dance": dance}
            numbers = (away.mean(), np.percentile(away, 5)) if away.size else (np.nan, np.nan)
            outcomes.append(row | dict(zip(("nearest", "closest"), numbers, strict=True)) | {"pieces": away.size})
    return pd.DataFrame(outcomes)


def nearest_pieces(motions: Sequence[Motion], learnt: FloatArray) -> FloatArray:
    """(P,) centimetres from each piece of some motions to the nearest of the pieces `learnt` (L, T, J, 3)."""
    own = [_pieces(motion, hop=round(PIECE * RATE)) for motion in motions]
    pieces = np.concatenate([np.zeros((0, *learnt.shape[1:])), *own])
    away = np.zeros((len(pieces), len(learnt)))
    for frame in range(learnt.shape[1]):
        for joint in range(learnt.shape[2]):
            away += cdist(pieces[:, frame, joint], learnt[:, frame, joint])
    return 100 * away.min(axis=1, initial=np.inf) / (learnt.shape[1] * learnt.shape[2])


def _pieces(motion: Motion | None, *, hop: int) -> FloatArray:
    """(P, T, J, 3) pieces of `PIECE` seconds inside the body, on the common points, `hop` frames apart."""
    if motion is None:
        raise ValueError("a recording came without motion")
    body = in_body(resample_motion(common_points(motion), RATE))
    length = round(PIECE * RATE)
    starts = [start for start in range(0, body.n_frames - length + 1, hop) if body.valid[start : start + length].all()]
    return np.array([body.positions[start : start + length] for start in starts]).reshape(
        -1, length, *body.positions.shape[1:]
    )


def _held_out(contest: Contest, dance: str) -> list[Motion]:
    """The recorded movement of a dance that lies in figures of the test side."""
    return [
        motion.span(first, last - first)
        for clip in recorded_dancers(contest)[dance]
        if (motion := clip.motion) is not None
        for first, last in test_spans(contest.split, clip.name, clip.offset)
    ]


def test_spans(split: Split, name: str, offset: float) -> list[tuple[float, float]]:
    """Stretches of a recording's motion, in its seconds, that units of the test side cover."""
    units = [unit for unit in split.test.units if unit.sequence.rpartition("/")[2] == name]
    return [(max(0.0, unit.start - offset), unit.end - offset) for unit in units]
