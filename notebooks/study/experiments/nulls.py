"""False alarms: p-values of movements that have nothing to do with the beats, or only their tempo.

Beats and movement are drawn apart from each other, so that p <= .05 ought to come up in 5 % of clips. Periodic movement
is the hard case: a dancer of the music's tempo is in time whatever the phase, and only the place in the beat is luck.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.params import DANCES
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import judge
from study.experiments.study import corpus_folders, data_root, readable_recordings
from study.profile import RunProfile

Pair = tuple[Motion, BeatTrack]
Draw = Callable[[float, np.random.Generator], Pair]

FPS = 25.0
PERIODS = (0.4, 0.7)  # seconds between the beats
RECORDED_PERIODS = (1 / 3, 1.0)  # grids laid over recordings: 60 to 180 beats a minute
FAR = 0.04  # logarithm of the ratio from which on two tempi are told apart easily
RECORDED_WINDOWS = (6.0, 15.0, 30.0)  # seconds
JOINTS = 8
NOISE_SIZE, NOISE_TIME = 0.1, 0.15  # metres, and seconds of the Gaussian that makes noise smooth
SWING = 0.1  # metres to either side
LEVELS = (0.05, 0.01)
OLD_MEASURE = Path(__file__).with_name("old_measure.json")  # numbers of the score on the joint speed in the room


def steady_beats(period: float, seconds: float, rng: np.random.Generator) -> BeatTrack:
    """Beats of one period (seconds) at a random phase."""
    times = np.arange(rng.uniform(0, period), seconds, period)
    return BeatTrack(times, np.ones(times.size), 100.0, seconds)


def dancer(track: BeatTrack, rng: np.random.Generator) -> Motion:
    """A synthetic dancer of any dance, whose movements end on the beats of `track`."""
    settings: dict[str, Any] = {"seconds": track.duration, "fps": FPS, "seed": int(rng.integers(1 << 30))}
    return synthetic_motion(track.times, dance=str(rng.choice(list(DANCES))), **settings)


def swinging(track: BeatTrack, rng: np.random.Generator) -> Motion:
    """A body whose joints swing to and fro in sines that turn back on the beats of `track`."""
    places, ways = rng.normal(0.0, 0.5, (JOINTS, 3)), rng.normal(0.0, SWING, (JOINTS, 3))
    times = np.arange(round(track.duration * FPS)) / FPS
    beats = (times - track.times[0]) / float(np.median(np.diff(track.times)))
    return _body(places + np.cos(np.pi * beats)[:, None, None] * ways)


def smooth_noise(seconds: float, rng: np.random.Generator) -> Motion:
    """A body whose joints wander about their places without any tempo."""
    wander = gaussian_filter1d(rng.normal(0.0, 1.0, (round(seconds * FPS), JOINTS, 3)), NOISE_TIME * FPS, axis=0)
    return _body(rng.normal(0.0, 0.5, (JOINTS, 3)) + NOISE_SIZE * wander / wander.std())


def _body(positions: FloatArray) -> Motion:
    return Motion(positions, FPS, Skeleton.unnamed(positions.shape[1]))


def _at_tempo(body: Callable[[BeatTrack, np.random.Generator], Motion], ratio: Callable[[Any], float]) -> Draw:
    """Beats, and a body that moves to a grid of its own, whose tempo is `ratio` times theirs, at its own phase."""

    def draw(seconds: float, rng: np.random.Generator) -> Pair:
        period = rng.uniform(*PERIODS)
        return body(steady_beats(period / ratio(rng), seconds, rng), rng), steady_beats(period, seconds, rng)

    return draw


def _drawn_apart(seconds: float, rng: np.random.Generator) -> Pair:
    """Beats, and a dancer whose tempo is drawn as theirs is: of all, it may happen to be nearly the same."""
    own, music = (steady_beats(rng.uniform(*PERIODS), seconds, rng) for _ in range(2))
    return dancer(own, rng), music


def _near_ratio(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.98, 1.02))


def _far_ratio(rng: np.random.Generator) -> float:
    """Ratio of tempi that are told apart easily, up to 4 : 3 to either side."""
    return float(np.exp(rng.choice([-1, 1]) * rng.uniform(FAR, 0.28)))


def _noise(still: float) -> Draw:
    """Noise to beats, and the body standing still for `still` seconds after the last of them."""

    def draw(seconds: float, rng: np.random.Generator) -> Pair:
        beats = steady_beats(rng.uniform(*PERIODS), seconds, rng)
        motion = smooth_noise(seconds, rng)
        rest = np.repeat(motion.positions[-1:], round(still * FPS), axis=0)
        return _body(np.concatenate([motion.positions, rest])), replace(beats, duration=seconds + still)

    return draw


# What is drawn, and the lengths in seconds at which it is judged.
NULLS: Mapping[str, tuple[Draw, tuple[float, ...]]] = MappingProxyType(
    {
        "dancer, same tempo, any phase": (_at_tempo(dancer, lambda rng: 1.0), (6.0, 15.0, 60.0)),
        "sines, same tempo, any phase": (_at_tempo(swinging, lambda rng: 1.0), (60.0,)),
        "dancer, tempo within 2 %": (_at_tempo(dancer, _near_ratio), (6.0, 60.0)),
        "dancer, tempo drawn apart": (_drawn_apart, (15.0, 30.0, 60.0)),
        "dancer, tempo over 4 % off": (_at_tempo(dancer, _far_ratio), (15.0, 60.0)),
        "smooth noise": (_noise(0.0), (6.0, 15.0, 30.0, 60.0)),
        "noise, no stillness after it": (_noise(0.0), (12.0,)),
        "noise, then 12 s of stillness": (_noise(12.0), (12.0,)),
        "noise, then 48 s of stillness": (_noise(48.0), (12.0,)),
    }
)


def recorded_nulls(dances: Sequence[Pair]) -> dict[str, tuple[Draw, tuple[float, ...]]]:
    """The rows of recorded dancers: to grids that know nothing of them, and to their own beats moved by any phase.

    Parameters
    ----------
    dances : motions of recordings with their own beats, on one time line
    """

    def to_grid(seconds: float, rng: np.random.Generator) -> Pair:
        motion, _, start = _window(dances, seconds, rng)
        return motion.span(start, seconds), steady_beats(rng.uniform(*RECORDED_PERIODS), seconds, rng)

    def to_moved_beats(seconds: float, rng: np.random.Generator) -> Pair:
        motion, beats, start = _window(dances, seconds, rng)
        moved = beats.span(start - rng.uniform(0.0, 4.0) * 60 / beats.tempo, seconds)
        return motion.span(start, seconds), replace(moved, bar_places=None)

    if not dances:
        return {}
    windows = tuple(window for window in RECORDED_WINDOWS if any(motion.duration >= window for motion, _ in dances))
    return {
        "recorded dancer, any grid": (to_grid, windows),
        "recorded dancer, own beats moved": (to_moved_beats, windows),
    }


def _window(dances: Sequence[Pair], seconds: float, rng: np.random.Generator) -> tuple[Motion, BeatTrack, float]:
    """A dance that is long enough, its beats, and a second at which a window may begin."""
    long = [pair for pair in dances if pair[0].duration >= seconds]
    motion, beats = long[rng.integers(len(long))]
    return motion, beats, round(rng.uniform(0.0, motion.duration - seconds) * motion.fps) / motion.fps


def annotated_dances(profile: RunProfile) -> list[Pair]:
    """Motions and annotated beats of the recorded dances, by name, that ``HARMOLAB_DATA`` names; none without."""
    if data_root() is None:
        return []
    recordings = [item for root in corpus_folders(profile).values() for item in readable_recordings(root)]
    dances = [item.clip for item in recordings if item.annotation is not None and item.clip.dance]
    shared = [clip.shared() for clip in dances if clip.motion is not None]
    return [(clip.motion, clip.beats) for clip in shared if clip.motion is not None and clip.beats is not None]


def null_table(profile: RunProfile, nulls: Mapping[str, tuple[Draw, tuple[float, ...]]] | None = None) -> pd.DataFrame:
    """Shares of small p-values where nothing is to be found.

    Parameters
    ----------
    profile : RunProfile, `n_nulls` clips a row
    nulls : name -> (function that draws a motion and beats, lengths in seconds)
        When left out `NULLS`, and the `recorded_nulls` of `annotated_dances` if there are any.

    Returns
    -------
    DataFrame, a row for each kind and length: n, "cannot tell" (share at level 0), shares of p <= .05 and <= .01 of the
    time test ("p_time .05") and of H ("p .05") among the clips that were judged, NaN where less than half were; and of
    the score on the joint speed in the room ("old p .05") among 400, as published, NaN for other kinds and lengths.
    """
    if nulls is None:
        nulls = {**NULLS, **recorded_nulls(annotated_dances(profile))}
    rows = []
    for name, (draw, windows) in nulls.items():
        for seconds in windows:
            # The same numbers for every kind: noise is the same noise with and without stillness after it.
            drawn = (
                draw(seconds, np.random.default_rng([profile.seed, int(seconds), clip]))
                for clip in range(profile.n_nulls)
            )
            values = pd.DataFrame([_p_values(motion, beats) for motion, beats in drawn])
            rows.append({"kind": name, "seconds": seconds, "n": len(values), **_small_shares(values)})
    published = pd.DataFrame(json.loads(OLD_MEASURE.read_text("utf-8"))["false alarms"])
    return pd.DataFrame(rows).merge(published, how="left", on=["kind", "seconds"])


def _p_values(motion: Motion, beats: BeatTrack) -> dict[str, float]:
    """The p-values of one clip; NaN where it is not judged."""
    judgement = judge(shape_speed(motion), beats)
    return {"p_time": judgement.p_time, "p": judgement.p_harmony}


def _small_shares(values: pd.DataFrame) -> dict[str, float]:
    """Share of rows that were not judged, and of small p-values among the others; NaN if these are fewer."""
    judged = values.dropna(subset="p_time")
    enough = len(judged) >= len(values) / 2
    shares = {"cannot tell": 1 - len(judged) / len(values)}
    for name in values:
        for level in LEVELS:
            shares[f"{name} {str(level)[1:]}"] = float((judged[name] <= level).mean()) if enough else np.nan
    return shares
