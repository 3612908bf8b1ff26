"""Bodies on a metronome: a statue on a turntable, and the verdicts of bodies in a table."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.skeletons import Skeleton, turned
from harmolab.data.synthetic import DANCER
from harmolab.shape_speed import ShapeSignal, shape_speed
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.bar_pattern import beat_positions
from harmolab.verdict.evidence import LEAST_SHARE
from harmolab.verdict.judge import Judgement, judge
from harmolab.verdict.sentences import FEW_JOINTS, moments_after_beat

OLD_MEASURE = Path(__file__).with_name("old_measure.json")  # numbers of the score on the joint speed in the room


def metronome(seconds: float, period: float) -> BeatTrack:
    """A beat every `period` seconds, from half a period on."""
    times = np.arange(period / 2, seconds, period)
    return BeatTrack(times, np.ones(times.size), 100.0, seconds)


def statue_on_turntable(motion: Motion, track: BeatTrack) -> Motion:
    """The first pose of `motion`, turned by an eighth from beat to beat of `track` and at rest on each."""
    pose = np.repeat(motion.positions[:1], motion.n_frames, axis=0)
    beats = beat_positions(np.arange(motion.n_frames) / motion.fps, track)
    way = beats % 1.0
    angle = np.pi / 4 * (np.floor(beats) + way**3 * (10 - 15 * way + 6 * way**2))
    middle = pose[0].mean(axis=0) * np.array([1.0, 0.0, 1.0])
    return replace(motion, positions=turned(pose - middle, angle[:, None]) + middle)


def locked_table(bodies: Mapping[str, Mapping[str, FloatArray]], track: BeatTrack, fps: float) -> pd.DataFrame:
    """The verdict of every body on a metronome, beside the old score as it was published.

    Parameters
    ----------
    bodies : group -> name -> positions (T, J, 3); names as published
    track : BeatTrack
    fps : float

    Returns
    -------
    DataFrame, a row a body: group, motion, "old score" (joint speed in the room), level, "H", p, p_time,
    "lag (ms)", "own tempo" (bpm), rate (movements a beat), pulse, share, joints, and "revealed by": the number
    that gives the body away, or the reading that fits.
    """
    rows = []
    published = json.loads(OLD_MEASURE.read_text("utf-8"))["old score"]
    for group, members in bodies.items():
        for name, positions in members.items():
            joints = positions.shape[1]
            motion = Motion(positions, fps, DANCER if joints == len(DANCER.joints) else Skeleton.unnamed(joints))
            row = {"group": group, "motion": name, "old score": published[name]}
            rows.append(row | judged_columns(judge(shape_speed(motion), track)))
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
    if signal.dimensions == 0 and signal.axes == 3:
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
