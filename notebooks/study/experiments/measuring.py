"""Dances of contestants, measured: timing, movement, the guard, and the time that they take.

What was measured of a row is kept in the cache folder, dance by dance, under all that it depends on: a comparison that
was killed goes on where it was, and a second one reads.
"""

from __future__ import annotations

import hashlib
import json
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.body.kinematics import joint_speed
from harmolab.files import Arrays, cached_arrays, keep_arrays, plain
from harmolab.lab.evaluate.measured import paper_numbers
from harmolab.metrics.features import kinetic_features
from harmolab.metrics.likeness import likeness
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import BarPattern, HarmonyParams
from harmolab.score import above_chance
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.systems.training.layers import one_thread
from harmolab.systems.training.pose_network import embed_windows
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.bar_pattern import beat_ranks
from harmolab.verdict.judge import score_motion
from study.experiments.cheating import half_a_beat_late
from study.experiments.contestants import RIGHT_SONG, ROWS, Contestant
from study.experiments.contests import Contest
from study.experiments.songs import Excerpt

VERSION = 1  # of the measures; raise it when one changes
PIECE = 2.0  # seconds of a dance that the pose network sees at once, about a meter
GUARD_SECONDS = 30.0
TIMED = 5  # dances of which the median is the time that a system takes
MEASURES = (
    "h", "h_chance", "hit_rate", "hit_chance", "above_chance", "late", "n_visual", "n_audio", "pattern", "jerk",
    "skating", "speed",
)  # fmt: skip
_VALLEYS = HarmonyParams.valleys()


def clip_measures(motion: Motion, excerpt: Excerpt, pattern: BarPattern | None = None) -> dict[str, float]:
    """The numbers of one dance to an excerpt, by `MEASURES`.

    Parameters
    ----------
    motion : Motion; frame 0 belongs to the excerpt's start
    excerpt : Excerpt
    pattern : BarPattern of the dance, where one is known

    Returns
    -------
    dict : h and hit_rate in paper mode, h_chance and hit_chance of as many beats at random moments; for valleys within
    0.1 s the harmony above chance, the same with the music half a beat late, M and N; pattern, the mean rank of the
    music beats above chance by the bar pattern in the body (NaN without a pattern or where "one" is unknown); jerk
    (m/s^3), skating (m/s), and the mean speed of a joint (m/s)
    """
    music, late = (_within(track, excerpt, motion) for track in (excerpt.beats, half_a_beat_late(excerpt.beats)))
    paper = paper_numbers(music, motion)
    valleys = score_motion(music, motion, params=_VALLEYS, n_rotations=0)
    return {
        "h": paper["paper_harmony"],
        "h_chance": paper["paper_harmony_chance"],
        "hit_rate": paper["paper_hit_rate"],
        "hit_chance": paper["paper_hit_rate_chance"],
        "above_chance": valleys.harmony_above_chance,
        "late": score_motion(late, motion, params=_VALLEYS, n_rotations=0).harmony_above_chance,
        "n_visual": float(valleys.n_visual),
        "n_audio": float(valleys.n_audio),
        "pattern": _pattern_score(music, motion, pattern),
        "jerk": jerk(motion),
        "skating": foot_skating(motion),
        "speed": float(joint_speed(motion.positions, motion.fps).mean() / len(motion.skeleton.joints)),
    }


def _within(track: BeatTrack, excerpt: Excerpt, motion: Motion) -> BeatTrack:
    """The beats of a song on the time line of a motion danced to an excerpt of it."""
    return track.span(excerpt.start, min(motion.duration, excerpt.seconds))


def _pattern_score(music: BeatTrack, motion: Motion, pattern: BarPattern | None) -> float:
    if pattern is None or music.bar_places is None or len(music) < 2 or not music.strengths.any():
        return float("nan")
    signal = shape_signal(shape_speed(motion))
    ranks = beat_ranks(signal.times, signal.values, music, pattern)
    return above_chance(float(np.average(ranks, weights=music.strengths)), 0.5)


@dataclass(frozen=True, eq=False)
class Measured:
    """Dances of one row and training to some excerpts, every one `draws` times.

    Parameters
    ----------
    excerpts : E excerpts
    values : (E, D, K) array, by `MEASURES`
    kinetic : (E, D, 3 J) array; empty where the body is not that of the contest's dancers
    poses : (E, D, P, F) array, pose network's features of P pieces of each dance; empty likewise
    """

    excerpts: tuple[Excerpt, ...]
    values: FloatArray
    kinetic: FloatArray
    poses: FloatArray

    def of(self, measure: str) -> FloatArray:
        """One of `MEASURES`, (E, D)."""
        values: FloatArray = self.values[..., MEASURES.index(measure)]
        return values


def measured(
    contest: Contest, name: str, contestant: Contestant, excerpts: Sequence[Excerpt], *, draws: int
) -> Measured:
    """A row's dances to some excerpts, measured now unless they were before."""
    net = contest.pose_net_name
    key = kept_name("dances", contest, name, contestant, excerpts, {"draws": draws, "pose_net": net, "piece": PIECE})

    def measure() -> Arrays:
        motions = [[contestant.dance(excerpt, seed) for seed in range(1, draws + 1)] for excerpt in excerpts]
        return _measures_of(contest, motions, excerpts)

    return Measured(tuple(excerpts), **kept(key, ("values", "kinetic", "poses"), measure))


def _measures_of(contest: Contest, motions: list[list[Motion]], excerpts: Sequence[Excerpt]) -> Arrays:
    """The arrays of `Measured`."""
    rows = []
    for dances, excerpt in zip(motions, excerpts, strict=True):
        pattern = contest.patterns.get(excerpt.clip.dance)
        each = [clip_measures(motion, excerpt, pattern) for motion in dances]
        rows.append([[numbers[name] for name in MEASURES] for numbers in each])
    values = np.array(rows, np.float64)
    none: Arrays = {"values": values, "kinetic": values[..., :0], "poses": values[..., None, :0]}
    if motions[0][0].skeleton.joints != contest.dancers[0].dancer.skeleton.joints:
        return none
    kinetic = np.array([[kinetic_features(motion) for motion in dances] for dances in motions])
    if not contest.pose_net_name:
        return none | {"kinetic": kinetic}
    poses = [[embed_windows([motion], contest.pose_net, seconds=PIECE) for motion in dances] for dances in motions]
    count = min(len(pieces) for dances in poses for pieces in dances)
    return none | {"kinetic": kinetic, "poses": np.array([[pieces[:count] for pieces in dances] for dances in poses])}


def kept(key: str, names: Iterable[str], measure: Callable[[], Arrays]) -> Arrays:
    """The arrays of some names that were kept under a key; measured and kept now unless they were."""
    arrays = cached_arrays(key)
    if arrays is None or set(arrays) != set(names):
        arrays = measure()
        keep_arrays(key, arrays)
    return arrays


def kept_name(
    kind: str, contest: Contest, name: str, contestant: Contestant, excerpts: Sequence[Excerpt], more: Any
) -> str:
    """Name of what is kept: a hash of all that it depends on."""
    songs = [[one.name, one.seconds, _sound_of(one)] for one in excerpts]
    about = [VERSION, kind, contest.about, name, contestant.identity, songs, more]
    return f"compared-{hashlib.sha256(json.dumps(plain(about), sort_keys=True).encode()).hexdigest()[:32]}"


def _sound_of(excerpt: Excerpt) -> str:
    """A hash of a song and its beats."""
    digest = hashlib.sha256(excerpt.clip.audio.samples.tobytes())
    digest.update(excerpt.beats.times.tobytes())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class Guarded:
    """Longer dances of one row and training: one to each guarded song.

    Parameters
    ----------
    passed : (G,) array, 1 where the dance moves like the recorded dancers, 0 where not, NaN where it cannot be told
    shape : (G,) array, the recommended score, with the dance's bar pattern where it and "one" are known; NaN where
        the music is too short or nothing moves
    """

    passed: FloatArray
    shape: FloatArray


def guarded(contest: Contest, name: str, contestant: Contestant) -> Guarded:
    """The guard and the recommended score of dances of 30 s to one song in a few, measured now unless before."""
    excerpts = [excerpt.longer(GUARD_SECONDS) for excerpt in contest.guarded]
    key = kept_name("guard", contest, name, contestant, excerpts, {})

    def measure() -> Arrays:
        rows = [_guard_of(contest, contestant, excerpt) for excerpt in excerpts]
        return dict(zip(("passed", "shape"), np.array(rows, np.float64).T, strict=True))

    return Guarded(**kept(key, ("passed", "shape"), measure))


def _guard_of(contest: Contest, contestant: Contestant, excerpt: Excerpt) -> tuple[float, float]:
    motion = contestant.dance(excerpt, 1)
    limits = contestant.limits or contest.limits
    judged = likeness(motion, dance=excerpt.clip.dance, limits=limits).passed
    music = _within(excerpt.beats, excerpt, motion)
    pattern = None if music.bar_places is None else contest.patterns.get(excerpt.clip.dance)
    shape = score_motion(music, motion, params=HarmonyParams.recommended(pattern), n_rotations=0)
    return float("nan") if judged is None else float(judged), shape.place_harmony


def dance_seconds(contest: Contest, name: str, contestant: Contestant) -> float:
    """Seconds that a dance of six takes on one thread, median of `TIMED` after one; kept with the machine's name."""
    excerpt = contest.excerpts[0]
    key = kept_name("seconds", contest, name, contestant, [excerpt], {"machine": processor(), "timed": TIMED})

    def measure() -> Arrays:
        with one_thread():
            contestant.dance(excerpt, 0)
            return {"seconds": np.array([_seconds(contestant, excerpt, seed) for seed in range(1, TIMED + 1)])}

    return float(np.median(kept(key, ("seconds",), measure)["seconds"]))


def _seconds(contestant: Contestant, excerpt: Excerpt, seed: int) -> float:
    begin = time.perf_counter()
    contestant.dance(excerpt, seed)
    return time.perf_counter() - begin


def processor() -> str:
    """Name of this machine's processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text("utf-8").splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def reference(contest: Contest) -> Measured:
    """The recorded (or planted) dancers of a contest's corpus, measured as the dances are."""
    own = replace(contest, excerpts=contest.dancers, music="their own songs")
    return all_dances(own, RIGHT_SONG, ROWS[RIGHT_SONG].make(contest, 1), 1)


def all_dances(contest: Contest, name: str, contestant: Contestant, draws: int) -> Measured:
    """The excerpts of a contest dance by dance, each kept as soon as it is measured."""
    by_dance: dict[str, list[Excerpt]] = {}
    for excerpt in contest.excerpts:
        by_dance.setdefault(excerpt.clip.dance, []).append(excerpt)
    parts = [measured(contest, name, contestant, excerpts, draws=draws) for excerpts in by_dance.values()]
    arrays = [np.concatenate([getattr(part, each) for part in parts]) for each in ("values", "kinetic", "poses")]
    return Measured(tuple(excerpt for part in parts for excerpt in part.excerpts), *arrays)
