"""Temperature, the share of the predicted spread that a dance draws, how long a draw lasts, and smoothing (R34).

Drawn in full, as Eq. 12 is printed, a dance shakes; without any chance it may come to rest. A draw that lasts moves the
body further than one that the next frame takes back. All are compared by the measures of a minute, to songs that are in
no other table; and by a measure that chose nothing, how far a pose network finds their poses from recorded ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from harmolab.files import Progress, silent
from harmolab.lab.evaluate.measured import statue
from harmolab.metrics.features import frechet_distance, standardise
from harmolab.systems.music2dance.system import Music2Dance, drawn_with
from harmolab.systems.training.pose_network import PoseNet, embed_windows
from harmolab.types import FloatArray, Motion
from study.experiments.contestants import RIGHT_SONG
from study.experiments.contests import Contest
from study.experiments.endurance import LIMITS
from study.experiments.minutes import (
    COLUMNS,
    GUARD,
    MINUTE,
    common_points,
    dance_seconds,
    endurance_table,
    measures,
    minutes,
    recorded_dancers,
    unheard_song,
)
from study.experiments.music2dance import DANCER_SETTINGS, trained_dancer
from study.experiments.points_net import points_net
from study.experiments.songs import Excerpt

TEMPERATURES = (0.0, 0.1, 0.3, 0.5, 0.7, 1.0)
DRAWINGS = ((0.0, 0.0), (0.04, 0.0), (0.08, 0.0), (0.04, 0.1), (0.04, 0.3))  # smoothing, draw memory
FIRST_SONG = 500  # number of the songs that settings are compared on
SONGS = 3  # of each dance and training
PIECE = 2.0  # seconds that the pose network sees at once
APART = "poses apart"


def chance_table(
    contest: Contest,
    settings: str = "recommended",
    *,
    temperatures: Sequence[float] = TEMPERATURES,
    drawings: Sequence[tuple[float, float]] = DRAWINGS,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Dances of a minute by temperature, smoothing and draw memory: what of the limits they keep.

    Returns
    -------
    DataFrame with the columns dancers, temperature, smoothing, draw_memory, shares of the dances within each of
    `endurance.LIMITS`, their mean "kept", "measures within" of the guard, and means of pose variance and jerk in
    multiples of the recorded dancers'; and "poses apart", the Frechet distance of a pose network from every other piece
    of the recordings. The recorded dancers (their other pieces) and their statues are the last rows, and have no
    temperature
    """
    seconds = dance_seconds(contest.profile, MINUTE)
    recorded = minutes(contest, rows=[RIGHT_SONG])
    every = [
        trained_dancer(contest.profile, contest.corpus, DANCER_SETTINGS[settings], training).system
        for training in range(1, min(contest.trainings, contest.profile.n_dancers) + 1)
    ]
    songs = [
        unheard_song(dance, FIRST_SONG + number, seconds)
        for dance in recorded_dancers(contest)
        for number in range(SONGS)
    ]
    dancers = [clip.motion for clips in recorded_dancers(contest).values() for clip in clips if clip.motion is not None]
    net, rows = points_net(contest.profile, contest.corpus), []
    pieces = poses_of(dancers, net)
    for smoothing, memory in drawings:
        for temperature in progress(temperatures, f"smoothing {smoothing:g} s, draws last {memory:g} s"):
            drawing = {"temperature": temperature, "smoothing": smoothing, "draw_memory": memory}
            networks = [drawn_with(each.generator, **drawing) for each in every]
            systems = [Music2Dance(net, each.poses) for net, each in zip(networks, every, strict=True)]
            dances = [
                (song.clip.dance, _danced(system, song, seed))
                for seed, system in enumerate(systems, 1)
                for song in songs
            ]
            table = pd.DataFrame(
                [{"dance": dance, **measures(motion, dance, contest.limits)} for dance, motion in dances]
            )
            apart = poses_apart(poses_of([motion for _, motion in dances], net), pieces[::2])
            rows.append({**drawing, **_summary(table, recorded), APART: apart})
    ends = {"recorded": pieces[1::2], "statues of the recorded": poses_of(map(statue, dancers), net)}
    limits = [{"dancers": name, APART: poses_apart(own, pieces[::2])} for name, own in ends.items()]
    limits[0] |= _summary(recorded.drop(columns="system"), recorded)
    return pd.DataFrame([*({"dancers": "Music2Dance", **row} for row in rows), *limits])


def poses_of(motions: Iterable[Motion], net: PoseNet) -> FloatArray:
    """Features (R, K) of pieces of some dances on the common points, by a pose network."""
    return np.concatenate([embed_windows([common_points(motion)], net, seconds=PIECE) for motion in motions])


def poses_apart(poses: FloatArray, reference: FloatArray) -> float:
    """Frechet distance of features from those of a reference, both standardised by it."""
    return frechet_distance(standardise(poses, reference), standardise(reference, reference)).value


def _danced(system: Music2Dance, song: Excerpt, seed: int) -> Motion:
    return system.generate(song.clip.audio, song.beats, seconds=song.seconds, seed=seed, dance=song.clip.dance)


def _summary(table: pd.DataFrame, recorded: pd.DataFrame) -> dict[str, float]:
    """Shares of the limits that some dances keep, and how lively they are beside the recorded."""
    both = pd.concat([recorded, table.assign(system="own", corpus=recorded["corpus"].iloc[0])], ignore_index=True)
    limits = endurance_table(both)
    own = limits[limits["system"] == "own"].groupby("measure")[["within", "of"]].sum()
    shares = (own["within"] / own["of"])[list(LIMITS)]
    means = recorded.groupby("dance")[list(COLUMNS)].mean()
    relative = {
        f"{name} / recorded": (table.groupby("dance")[name].mean() / means[name]).mean()
        for name in ("pose variance", "pose speed", "jerk")
    }
    return {
        **shares,
        "kept": shares.mean(),
        GUARD[1]: table[GUARD[1]].mean(),
        GUARD[0]: table[GUARD[0]].mean(),
        **relative,
    }
