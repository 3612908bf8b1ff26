"""Bodies on a metronome: cheats that are locked to the beat, honest dancers, and dancers of another tempo.

The tricks of `cheating` know nothing of the music. These know it better than any dancer, and move next to nothing, or
as one piece; beside them stand people who dance in time in other ways than resting on every beat. 32 s at 120 bpm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from harmolab.bar_pattern import beat_positions
from harmolab.corpora.synthetic import DANCER, synthetic_motion
from harmolab.harmony import score_motion
from harmolab.lab.profile import RunProfile
from harmolab.params import HarmonyParams
from harmolab.shape_speed import ShapeSignal, shape_speed
from harmolab.types import BeatTrack, FloatArray, Motion, Skeleton
from harmolab.verdict.evidence import LEAST_SHARE
from harmolab.verdict.judge import Judgement, judge
from harmolab.verdict.sentences import FEW_JOINTS, moments_after_beat

Course = Callable[[FloatArray], FloatArray]  # number of the beat -> number of poses gone through
Body = Callable[[FloatArray, np.random.Generator], FloatArray]  # number of the beat -> positions (T, J, 3)

SECONDS, PERIOD, FPS = 32.0, 0.5, 30.0
CHEATS, IN_TIME, OTHER_TEMPO = "Cheats", "Dancers in time", "Other tempi"
AWAY = 8  # poses that exist before the first beat, for courses that begin early


def metronome() -> BeatTrack:
    """120 beats a minute, a quarter of a second from the start."""
    times = np.arange(PERIOD / 2, SECONDS, PERIOD)
    return BeatTrack(times, np.ones(times.size), 100.0, SECONDS)


def key_poses(seed: int) -> FloatArray:
    """(K, 21, 3) poses of a synthetic dancer on the beats of twice the length, so that any course has enough."""
    count = round(2 * SECONDS / PERIOD) + 2 * AWAY
    beats = PERIOD * (1 + np.arange(count))
    motion = synthetic_motion(beats, seconds=float(beats[-1] + PERIOD), fps=2 / PERIOD, seed=seed)
    return motion.positions[2 : 2 * count + 1 : 2]


# Courses


def rests(beats: FloatArray, *, rate: float = 1.0, late: float = 0.0) -> FloatArray:
    """From pose to pose with minimum jerk, at rest on each: `rate` poses a beat, `late` beats after it."""
    return strokes(rate * (beats - late) - 0.5, width=1.0) + 0.5


def strokes(beats: FloatArray, *, width: float) -> FloatArray:
    """From pose to pose in strokes that are fastest on the beat and last `width` beats."""
    number = np.floor(beats + 0.5)
    share = np.clip(0.5 + (beats - number) / width, 0.0, 1.0)
    return number - 0.5 + share**3 * (10 - 15 * share + 6 * share**2)


def impacts(beats: FloatArray, *, width: float = 0.3) -> FloatArray:
    """Frozen, then faster and faster for `width` beats until the beat stops the body dead."""
    number = np.floor(beats)
    return number + np.clip((beats - number - 1) / width + 1, 0.0, 1.0) ** 2


def dancing(course: Course) -> Body:
    """A dancer who goes through key poses in a course."""

    def positions(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
        poses = key_poses(int(rng.integers(1 << 30)))
        progress = course(beats) + AWAY
        before = np.clip(np.floor(progress).astype(np.int64), 0, len(poses) - 2)
        share = (progress - before)[:, None, None]
        return poses[before] * (1 - share) + poses[before + 1] * share

    return positions


# Cheats: one pose, and next to no dance


def standing(rng: np.random.Generator, beats: FloatArray) -> FloatArray:
    """One pose of a dancer, for as long as the beats."""
    return np.repeat(key_poses(int(rng.integers(1 << 30)))[AWAY : AWAY + 1], beats.size, axis=0)


def turntable(beats: FloatArray, rng: np.random.Generator, *, travel: float = 0.0) -> FloatArray:
    """A statue that turns by an eighth from beat to beat and pauses on each; it travels `travel` metres a beat."""
    turned = _turned(standing(rng, beats), np.pi / 4 * rests(beats))
    return turned + travel * rests(beats)[:, None, None] * np.array([1.0, 0.0, 0.0])


def statue_on_turntable(motion: Motion, track: BeatTrack) -> Motion:
    """The first pose of `motion`, turned by an eighth from beat to beat of `track` and at rest on each."""
    pose = np.repeat(motion.positions[:1], motion.n_frames, axis=0)
    angle = np.pi / 4 * rests(beat_positions(np.arange(motion.n_frames) / motion.fps, track))
    return replace(motion, positions=_turned(pose, angle))


def _turned(pose: FloatArray, angle: FloatArray) -> FloatArray:
    """Joints (T, J, 3) turned by (T,) angles about the vertical through the middle of the first frame's."""
    middle = pose[0].mean(axis=0) * np.array([1.0, 0.0, 1.0])
    x, y, z = np.moveaxis(pose - middle, -1, 0)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([x * cos + z * sin, y, z * cos - x * sin], axis=-1) + middle


def bobbing(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A statue that goes up and down by 5 cm, at rest on the beats."""
    return standing(rng, beats) + 0.05 * np.cos(np.pi * beats)[:, None, None] * np.array([0.0, 1.0, 0.0])


def trembling_body(beats: FloatArray, rng: np.random.Generator, *, size: float, drift: float = 0.0) -> FloatArray:
    """A statue whose joints tremble to and fro by `size` metres, each its own way; it drifts `drift` metres around."""
    ways = rng.normal(size=(1, len(DANCER.joints), 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    path = drift * np.sin(2 * np.pi * beats / 23)[:, None, None] * np.array([1.0, 0.0, 0.0])
    return standing(rng, beats) + path + size * np.cos(np.pi * beats)[:, None, None] * ways


def one_joint(beats: FloatArray, rng: np.random.Generator, *, joint: str, size: float) -> FloatArray:
    """A statue with one joint that goes up and down by `size` metres, at rest on the beats."""
    pose = standing(rng, beats)
    pose[:, DANCER.joints.index(joint), 1] += size * np.cos(np.pi * beats)
    return pose


def sensor_noise(beats: FloatArray, rng: np.random.Generator, *, size: float) -> FloatArray:
    """A statue seen by a sensor with an error of `size` metres in every frame."""
    pose = standing(rng, beats)
    return pose + rng.normal(0.0, size, pose.shape)


def stopping_walk(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Joints that wander at random and stop on the beats."""
    pose = standing(rng, beats)
    velocity = gaussian_filter1d(rng.normal(size=pose.shape), 0.3 * FPS, axis=0)
    walk = np.cumsum(velocity * np.sin(np.pi * beats)[:, None, None] ** 2, axis=0)
    return pose + 0.2 * walk / walk.std()


def circling(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Every joint on a circle of its own, 10 cm around, once in two beats: its speed never changes."""
    phases = rng.uniform(0.0, 2 * np.pi, len(DANCER.joints))
    angle = np.pi * beats[:, None] + phases
    return standing(rng, beats) + 0.1 * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)


def wandering(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Joints that wander at random and know no tempo."""
    pose = standing(rng, beats)
    wander = gaussian_filter1d(rng.normal(size=pose.shape), 0.15 * FPS, axis=0)
    return pose + 0.1 * wander / wander.std()


def running(beats: FloatArray, rng: np.random.Generator, *, rate: float, late: float = 0.0) -> FloatArray:
    """A runner's left and right, to and fro by 20 cm against each other: `rate` steps a beat, `late` beats late."""
    pose = standing(rng, beats)
    sides = np.array([{"L": 1.0, "R": -1.0}.get(name[-1], 0.0) for name in DANCER.joints])
    pose[..., 2] += 0.2 * sides * np.cos(np.pi * rate * (beats - late))[:, None]
    return pose


def trembling_point(beats: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A single point that trembles by a nanometre on the beats."""
    return 1e-9 * np.cos(np.pi * beats)[:, None, None] * rng.normal(size=(1, 1, 3))


def arrivals(beats: FloatArray, *, width: float) -> FloatArray:
    """The course of movements that last `width` beats, end on the beats, and stand until the next begins."""
    way = np.clip((beats % 1.0 - 1 + width) / width, 0.0, 1.0)
    return np.floor(beats) + way**3 * (10 - 15 * way + 6 * way**2)


BODIES: Mapping[str, Mapping[str, Body]] = MappingProxyType(
    {
        CHEATS: {
            "statue on a turntable": turntable,
            "statue, turning and travelling": partial(turntable, travel=0.3),
            "rigid bob": bobbing,
            "tremor of 1 mm": partial(trembling_body, size=1e-3),
            "tremor of 1 nm": partial(trembling_body, size=1e-9),
            "one point, 1 nm": trembling_point,
            "one toe, 1 mm": partial(one_joint, joint="toe L", size=1e-3),
            "tremor of 5 mm on a drift": partial(trembling_body, size=5e-3, drift=1.0),
            "sensor noise, 1 cm": partial(sensor_noise, size=0.01),
            "sensor noise, 3 cm": partial(sensor_noise, size=0.03),
            "one hand, 10 cm": partial(one_joint, joint="hand L", size=0.1),
            "random walk that stops on the beats": stopping_walk,
            "circles of constant speed": circling,
        },
        IN_TIME: {
            "rests on the beats": dancing(rests),
            "rests, 60 ms late": dancing(partial(rests, late=0.06 / PERIOD)),
            "rests, a quarter of a beat late": dancing(partial(rests, late=0.25)),
            "rests, half a beat late": dancing(partial(rests, late=0.5)),
            "hits the beats": dancing(partial(strokes, width=0.6)),
            "impact, then freeze": dancing(impacts),
            "arrives in .1 s, then stands": dancing(partial(arrivals, width=0.2)),
            "arrives in .25 s, then stands": dancing(partial(arrivals, width=0.5)),
            "runner, a step a beat": partial(running, rate=1.0, late=0.1),
            "accents on 2 and 4": dancing(lambda beats: strokes((beats + 1) / 2, width=0.3)),
            "half time": dancing(partial(rests, rate=0.5)),
            "double time": dancing(partial(rests, rate=2.0)),
        },
        OTHER_TEMPO: {
            "tempo + 1 %": dancing(partial(rests, rate=1.01)),
            "tempo + 1.6 %": dancing(partial(rests, rate=1.016)),
            "tempo + 7 %": dancing(partial(rests, rate=1.07)),
            "other tempo (+ 27 %)": dancing(partial(rests, rate=1.27)),
            "runner, 4 steps in 3 beats": partial(running, rate=4 / 3, late=0.1),
            "smooth noise": wandering,
        },
    }
)


def locked_motion(body: Body, *, seed: int) -> Motion:
    """The motion of a body to the `metronome`."""
    beats = np.arange(round(SECONDS * FPS)) / FPS / PERIOD - 0.5
    positions = body(beats, np.random.default_rng(seed))
    joints = positions.shape[1]
    return Motion(positions, FPS, DANCER if joints == len(DANCER.joints) else Skeleton.unnamed(joints))


def locked_table(profile: RunProfile) -> pd.DataFrame:
    """The old score and the verdict of every body of `BODIES` on the `metronome`.

    Returns
    -------
    DataFrame, a row a body: group, motion, "old score" and "old p" (joint speed in the room), level, "H", p, p_time,
    "lag (ms)", "own tempo" (bpm), rate (movements a beat), pulse, share, joints, and "revealed by": the number
    that gives the body away, or the reading that fits.
    """
    track, rows = metronome(), []
    for group, bodies in BODIES.items():
        for name, body in bodies.items():
            motion = locked_motion(body, seed=profile.seed)
            old = score_motion(track, motion, params=HarmonyParams.room_speed(), n_rotations=profile.n_rotations)
            new = judge(shape_speed(motion), track)
            before = {"old score": old.harmony_above_chance, "old p": old.p_value}
            rows.append({"group": group, "motion": name, **before, **judged_columns(new)})
    return pd.DataFrame(rows)


def judged_columns(judgement: Judgement) -> dict[str, Any]:
    """The numbers of a judgement that tables print, and "revealed by"."""
    signal = judgement.signal
    return {
        "level": judgement.level,
        "H": judgement.harmony_above_chance,
        "p": judgement.p_harmony,
        "p_time": judgement.p_time,
        "lag (ms)": 1000 * judgement.lag_s,
        "own tempo": judgement.own_tempo,
        "rate": np.nan if judgement.time is None else float(judgement.time.rate),
        "pulse": np.nan if signal is None else signal.pulse,
        "share": np.nan if signal is None else signal.share,
        "joints": np.nan if signal is None else signal.joints,
        "revealed by": evidence(judgement),
    }


def evidence(judgement: Judgement) -> str:
    """The numbers behind a verdict, in a few words."""
    signal = judgement.signal
    if signal is None:
        return f"{len(judgement.beats)} beats"
    if judgement.level == 0:
        return _below_the_floor(signal)
    if judgement.level == 1:
        own = "" if np.isnan(judgement.own_tempo) else f", own tempo {judgement.own_tempo:.1f} bpm"
        return f"time test: p = {judgement.p_time:.2f}{own}"
    rate = 1.0 if judgement.time is None else float(judgement.time.rate)
    pace = "" if rate == 1 else f", {rate:.3g} movements a beat"
    return _place(judgement) + pace + (f", joints {signal.joints:.2f}" if signal.joints < FEW_JOINTS else "")


def _below_the_floor(signal: ShapeSignal) -> str:
    if signal.is_point:
        return f"speed {signal.swing:.1e} m/s: next to nothing"
    only_turns = signal.dimensions == 3 and signal.share < LEAST_SHARE
    return f"share {signal.share:.2f}: one piece" if only_turns else f"pulse {signal.pulse:.3f}: next to nothing"


def _place(judgement: Judgement) -> str:
    """The lag after what was told, or when the body is fastest."""
    if judgement.pattern is not None:
        return f"{judgement.reading}: lag {1000 * judgement.lag_s:+.0f} ms"
    seconds = moments_after_beat(judgement)
    fastest, stillest = (1000 * seconds[name] for name in ("fastest_after_beat_s", "stillest_after_beat_s"))
    return f"fastest {fastest:.0f}, stillest {stillest:.0f} ms after the beat"
