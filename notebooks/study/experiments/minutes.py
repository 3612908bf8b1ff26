"""Dances of a minute, and of ten: do they go on as dancers do, and do they look like dancing?

Every dancer dances songs that no training heard, one a seed, the trainings in turn. Each is held against the dancers
who were recorded in that dance, on the twenty points that all of the bodies have.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
import pandas as pd

from harmolab.beats.meter import with_one
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.files import Arrays, Progress, silent
from harmolab.metrics.likeness import SHORTEST, LikenessLimits, likeness
from harmolab.metrics.quality import bone_error
from harmolab.params import DANCES
from harmolab.significance import mean_interval
from harmolab.systems.music2dance.codes import body_points
from harmolab.types import Clip, FloatArray, Motion
from study.experiments.contestants import (
    CHOREOGRAPHER,
    EVERY_ROW,
    M2D,
    M2D_CALM,
    M2D_LSTM,
    M2D_LSTM_CALM,
    M2D_PAPER,
    RECOMMENDED,
    RIGHT_SONG,
    Contestant,
)
from study.experiments.contests import Contest
from study.experiments.endurance import LIMITS, endurance, limits_of, passed
from study.experiments.generation import SYNTHETIC, generator_corpora
from study.experiments.measuring import kept, kept_name
from study.experiments.songs import Excerpt, recorded_songs, synthetic_songs
from study.profile import RunProfile

MINUTE, QUICK_SECONDS = 60.0, 10.0
SEEDS, QUICK_SEEDS, QUICK_DANCES = 10, 2, ("cha-cha", "waltz")
UNHEARD = 900_000  # first seed of their songs; those of corpora are drawn from another sequence
DANCERS = (RIGHT_SONG, M2D_PAPER, M2D_CALM, M2D_LSTM, M2D_LSTM_CALM, M2D, RECOMMENDED, CHOREOGRAPHER)
TEN_MINUTES = (RIGHT_SONG, M2D_CALM, M2D)
OURS = (RIGHT_SONG, M2D)  # of the table of a network that was trained on synthetic movement
LOOKED_AT = (RIGHT_SONG, M2D_PAPER, M2D_CALM, M2D_LSTM_CALM, M2D)
LOOK_SECONDS, LOOK_FROM = 10.0, 20.0
GUARD = ("moves like people", "measures within")
COLUMNS = (*LIMITS, "pose speed", "99.9th percentile", *GUARD)


def unheard_song(dance: str, number: int, seconds: float) -> Excerpt:
    """A synthetic song of a dance that is in no corpus, with its planted beats and "one": all of it is danced."""
    settings = ClipSettings(dance, seconds=seconds, seed=UNHEARD + 1000 * list(DANCES).index(dance) + number)
    planted = planted_clip(settings)
    beats, downbeats = planted.clip.beats, planted.annotation.downbeats
    if beats is None or downbeats is None:
        raise ValueError(f"{dance}: a planted clip came without beats")
    track = with_one(beats, float(downbeats[0]), DANCES[dance].meter)
    clip = Clip(f"{dance} {number}", planted.clip.audio, None, 0.0, "synthetic", track, dance)
    return Excerpt(clip.name, clip, 0.0, seconds)


def common_points(motion: Motion) -> Motion:
    """The twenty points that Music2Dance's rotations are fitted to; a body that lacks one of them as it is."""
    try:
        return body_points(motion)
    except ValueError:
        return motion


def dance_seconds(profile: RunProfile, seconds: float) -> float:
    """So many seconds, ten in a quick profile."""
    return QUICK_SECONDS if profile.epochs else seconds


def n_draws(profile: RunProfile, count: int) -> int:
    """So many dances of each style, two in a quick profile."""
    return QUICK_SEEDS if profile.epochs else count


@cache
def unheard(profile: RunProfile, corpus: str | None = None, *, trainings: int | None = None) -> Contest:
    """A contest of songs that no training heard, with all dancers of a corpus (of two dances in a quick profile).

    Parameters
    ----------
    profile : RunProfile
    corpus : str, one of `generation.generator_corpora`, the first when left out
    trainings : int, of each network; the profile's when left out
    """
    corpus = corpus or generator_corpora(profile)[0]
    dancers = synthetic_songs(profile) if corpus == SYNTHETIC else recorded_songs(profile)
    if profile.epochs:
        dancers = [excerpt for excerpt in dancers if excerpt.clip.dance in QUICK_DANCES]
    trainings = profile.n_seeds if trainings is None else trainings
    return Contest(profile, corpus, "songs that no training heard", (), tuple(dancers), trainings)


def recorded_dancers(contest: Contest) -> dict[str, list[Clip]]:
    """Dance -> whole recordings of it in the contest's corpus, each once."""
    clips: dict[str, Clip] = {excerpt.song: excerpt.clip for excerpt in contest.dancers}
    by_dance: dict[str, list[Clip]] = {}
    for clip in clips.values():
        by_dance.setdefault(clip.dance, []).append(clip)
    return by_dance


def measures(motion: Motion, dance: str, limits: LikenessLimits | None) -> dict[str, float]:
    """The numbers of `COLUMNS`, of one dance: `endurance` on the common points, and the guard's answer."""
    judged = likeness(motion, dance=dance, limits=limits)
    own = endurance(common_points(motion)) | {"bones": bone_error(motion)}
    within = 1 - len(judged.fails) / max(len(judged.values), 1)
    return own | {"moves like people": np.nan if judged.passed is None else float(judged.passed), GUARD[1]: within}


def minutes(
    contest: Contest,
    *,
    seconds: float = MINUTE,
    count: int = SEEDS,
    rows: Iterable[str] = DANCERS,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Dances of a minute (or of `seconds`) to unheard songs, and the recorded dancers; ten seconds in a quick profile.

    What was measured is kept in the cache folder, dance by dance.

    Parameters
    ----------
    contest : Contest, whose corpus the systems are trained on; how often, it says
    seconds : float
    count : int, dances of each system in each style; dance n is of training (n - 1) modulo the trainings
    rows : names in `contestants.EVERY_ROW`
    progress : function(iterable, label) -> iterable

    Returns
    -------
    DataFrame with the columns corpus, system, dance, draw, training (0 for none), seconds, and `COLUMNS`
    """
    seconds, count = dance_seconds(contest.profile, seconds), n_draws(contest.profile, count)
    tables = []
    for name in rows:
        if name == RIGHT_SONG:
            tables.append(_recorded(contest, seconds))
            continue
        contestants = EVERY_ROW[name].contestants(contest)
        for dance in progress(list(recorded_dancers(contest)), f"{name}, {seconds:g} s"):
            values = [
                _kept(contest, name, contestants[draw % len(contestants)], dance, draw + 1, seconds)
                for draw in range(count)
            ]
            table = pd.DataFrame(values, columns=COLUMNS).assign(dance=dance, draw=range(1, count + 1))
            is_trained = EVERY_ROW[name].is_trained
            training = [draw % len(contestants) + 1 if is_trained else 0 for draw in range(count)]
            tables.append(table.assign(system=name, training=training))
    return pd.concat(tables, ignore_index=True).assign(corpus=contest.corpus, seconds=seconds)


def _recorded(contest: Contest, seconds: float) -> pd.DataFrame:
    rows = []
    for dance, clips in recorded_dancers(contest).items():
        for draw, clip in enumerate(clips, 1):
            if clip.motion is not None and clip.motion.duration >= SHORTEST:
                motion = clip.motion.span(0.0, min(seconds, clip.motion.duration))
                rows.append({**measures(motion, dance, contest.limits), "dance": dance, "draw": draw})
    return pd.DataFrame(rows).assign(system=RIGHT_SONG, training=0)


def _kept(contest: Contest, name: str, contestant: Contestant, dance: str, draw: int, seconds: float) -> FloatArray:
    """`COLUMNS` of one dance, measured now unless before."""
    song = unheard_song(dance, draw, seconds)
    key = kept_name("minutes", contest, name, contestant, [song], {"draw": draw, "columns": COLUMNS})

    def measure() -> Arrays:
        numbers = measures(contestant.dance(song, draw), dance, contestant.limits or contest.limits)
        return {"values": np.array([numbers[column] for column in COLUMNS])}

    return kept(key, ("values",), measure)["values"]


def looked_at(contest: Contest, rows: Iterable[str] = LOOKED_AT) -> dict[str, dict[str, Motion]]:
    """Dance -> row -> ten seconds: of a recorded dancer, and of each system's first training from second 20 on."""
    seconds = dance_seconds(contest.profile, LOOK_FROM + LOOK_SECONDS)
    sheets: dict[str, dict[str, Motion]] = {}
    for dance, clips in recorded_dancers(contest).items():
        song, rows_of = unheard_song(dance, 1, seconds), sheets.setdefault(dance, {})
        for name in rows:
            if name == RIGHT_SONG and clips[0].motion is not None:
                rows_of["recorded"] = clips[0].motion.span(0.0, min(LOOK_SECONDS, clips[0].motion.duration))
            elif name != RIGHT_SONG:
                motion = EVERY_ROW[name].contestants(contest)[0].dance(song, 1)
                rows_of[name] = motion.span(max(0.0, seconds - LOOK_SECONDS), min(LOOK_SECONDS, seconds))
    return sheets


def endurance_table(dances: pd.DataFrame) -> pd.DataFrame:
    """Means of `minutes` by system, dance and measure, beside the limits that recorded dancers set.

    Returns
    -------
    DataFrame with the columns corpus, system, dance, measure, mean, low, high (95 % over dances, Student's t), least,
    most (of one dance), within (dances that keep the limits), of (dances)
    """
    rows = []
    for (corpus, dance), part in dances.groupby(["corpus", "dance"], sort=False):
        limits = limits_of(_numbers(part[part["system"] == RIGHT_SONG]))
        for system, own in part.groupby("system", sort=False):
            outcomes = pd.DataFrame([passed(row, limits) for row in _numbers(own)])
            for measure, (least, most) in limits.items():
                mean, low, high = mean_interval(own[measure])
                row = {"corpus": corpus, "system": system, "dance": dance, "measure": measure, "mean": mean}
                row |= {"low": low, "high": high, "least": least, "most": most}
                rows.append(row | {"within": int(outcomes[measure].sum()), "of": len(own)})
    return pd.DataFrame(rows)


def _numbers(dances: pd.DataFrame) -> list[dict[str, float]]:
    """`COLUMNS` of each dance."""
    return [dict(zip(COLUMNS, row, strict=True)) for row in dances[list(COLUMNS)].to_numpy(np.float64).tolist()]


def likeness_table(dances: pd.DataFrame) -> pd.DataFrame:
    """Does it look like dancing? Share of dances that pass the guard, and of its measures within their limits.

    Returns
    -------
    DataFrame with the columns system, dance ("all" too), "moves like people" (share of dances), low and high (95 % over
    trainings where there are several, else over dances), "measures within", dances
    """
    rows = []
    for system, own in dances.groupby("system", sort=False):
        for dance, part in [*own.groupby("dance", sort=False), ("all", own)]:
            several = part["training"].nunique() > 1
            units = part.groupby("training")[GUARD[0]].mean() if several else part[GUARD[0]]
            _, low, high = mean_interval(units)
            row = {"system": system, "dance": dance, GUARD[0]: part[GUARD[0]].mean(), "low": low, "high": high}
            row |= {"interval over": "trainings" if several else "dances", GUARD[1]: part[GUARD[1]].mean()}
            rows.append(row | {"dances": len(part)})
    return pd.DataFrame(rows)
