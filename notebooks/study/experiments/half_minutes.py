"""Twenty dances of 25 s in each style, as the paper showed to people: harmony with the right music, and marks.

No one was asked. What people would say is replaced by four measures, each from 0, what a statue or chance reaches,
to 10, what the recorded dancers reach (Fig. 6, Table 3 by machine).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.files import Arrays, Progress, silent
from harmolab.lab.evaluate.measured import statue
from harmolab.metrics.features import diversity, frechet_distance, standardise
from harmolab.metrics.quality import foot_skating
from harmolab.params import HarmonyParams
from harmolab.significance import LEVEL, auc, mean_interval
from harmolab.systems.training.pose_network import embed_windows
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.contestants import EVERY_ROW, M2D_LSTM, RIGHT_SONG, Contestant
from study.experiments.contests import Contest
from study.experiments.measuring import kept, kept_name
from study.experiments.minutes import DANCERS, common_points, dance_seconds, n_draws, recorded_dancers, unheard_song
from study.experiments.points_net import points_net
from study.experiments.songs import Excerpt

SECONDS, COUNT = 25.0, 20
PIECE = 2.0  # seconds of a dance that are compared with pieces of recorded ones
PERMUTATIONS = 1000
STATUE = "statue of the recorded"
HALF_ROWS = tuple(name for name in DANCERS if name != M2D_LSTM)
SCORES = ("without a pattern", "bar pattern")
BY_BAR = 1  # its place among them
MARKS: Mapping[str, float] = MappingProxyType({"naturalness": 0.25, "richness": 0.25, "music": 0.4, "sliding": 0.1})


@dataclass(frozen=True, eq=False)
class HalfMinutes:
    """Dances of one row in one style.

    Parameters
    ----------
    scores : (S, N, N) array, by `SCORES`: harmony above chance of dance n with the music of dance m; NaN where the
        style has no bar pattern
    poses : (N, P, F) array, pose network's features of pieces of each dance, on the common points
    skating : (N,) array, m/s
    training : (N,) array, 0 for none
    """

    scores: FloatArray
    poses: FloatArray
    skating: FloatArray
    training: FloatArray


def half_minutes(
    contest: Contest, *, rows: Iterable[str] = HALF_ROWS, count: int = COUNT, progress: Progress = silent
) -> dict[tuple[str, str], HalfMinutes]:
    """(System, dance) -> its dances to unheard songs, of the recorded dancers to their own; and statues of those.

    In a quick profile there are two dances of ten seconds. What was measured is kept in the cache folder.
    """
    seconds, count = dance_seconds(contest.profile, SECONDS), n_draws(contest.profile, count)
    outcomes = {}
    for name in rows:
        contestants = () if name == RIGHT_SONG else EVERY_ROW[name].contestants(contest)
        for dance in progress(list(recorded_dancers(contest)), f"{name}, {seconds:g} s"):
            if name == RIGHT_SONG:
                songs = own_songs(contest, dance, seconds)
                motions = [song.dancer for song in songs]
                outcomes[name, dance] = _measured(contest, dance, songs, motions, [0] * len(songs))
                outcomes[STATUE, dance] = _measured(contest, dance, songs, [*map(statue, motions)], [0] * len(songs))
            else:
                outcomes[name, dance] = _kept(contest, name, contestants, dance, count, seconds)
    return outcomes


def own_songs(contest: Contest, dance: str, seconds: float) -> list[Excerpt]:
    """The first stretch of each recording of a dance that is long enough."""
    return [
        Excerpt(clip.name, clip, max(0.0, clip.offset), seconds)
        for clip in recorded_dancers(contest)[dance]
        if clip.motion is not None and clip.motion.duration + min(0.0, clip.offset) >= seconds
    ]


def _kept(
    contest: Contest, name: str, contestants: Sequence[Contestant], dance: str, count: int, seconds: float
) -> HalfMinutes:
    songs = [unheard_song(dance, 100 + draw, seconds) for draw in range(count)]
    training = [draw % len(contestants) for draw in range(count)]
    ids = [one.identity for one in contestants]
    key = kept_name("half minutes", contest, name, contestants[0], songs, {"identities": ids, "piece": PIECE})

    def measure() -> Arrays:
        motions = [contestants[training[draw]].dance(song, draw) for draw, song in enumerate(songs)]
        numbers = [place + 1 if EVERY_ROW[name].is_trained else 0 for place in training]
        return vars(_measured(contest, dance, songs, motions, numbers))

    return HalfMinutes(**kept(key, HalfMinutes.__annotations__, measure))


def _measured(
    contest: Contest, dance: str, songs: Sequence[Excerpt], motions: Sequence[Motion], training: Sequence[int]
) -> HalfMinutes:
    pattern = contest.patterns.get(dance)
    tracks = [song.beats.span(song.start, song.seconds) for song in songs]
    plain = harmony_matrix(motions, tracks, HarmonyParams.recommended())
    by_bar = np.full_like(plain, np.nan)
    if pattern is not None and all(track.bar_places is not None for track in tracks):
        by_bar = harmony_matrix(motions, tracks, HarmonyParams.recommended(pattern))
    net = points_net(contest.profile, contest.corpus)
    poses = [embed_windows([common_points(motion)], net, seconds=PIECE) for motion in motions]
    least = min((len(each) for each in poses), default=0)
    skating = np.array([foot_skating(motion) for motion in motions])
    pieces = np.array([each[:least] for each in poses])
    return HalfMinutes(np.stack([plain, by_bar]), pieces, skating, np.array(training, np.float64))


def harmony_matrix(motions: Sequence[Motion], tracks: Sequence[BeatTrack], params: HarmonyParams) -> FloatArray:
    """(N, M) harmony above chance of each motion with each music, both from time 0."""
    return np.array(
        [
            [score_motion(track, motion, params=params, n_rotations=0).place_harmony for track in tracks]
            for motion in motions
        ]
    ).reshape(len(motions), len(tracks))


def right_music(scores: FloatArray, *, seed: int = 0) -> dict[str, float]:
    """Is a dance nearer to its own music than to others'? AUC of the diagonal of (N, N), and what chance makes of it.

    Returns
    -------
    dict : auc, and the middle 95 % of the AUCs where each dance is given the music of another, or its own, at random
    """
    if np.isfinite(scores.diagonal()).sum() < 2:
        return {"auc": np.nan, "chance low": np.nan, "chance high": np.nan}
    rng, rows = np.random.default_rng(seed), np.arange(len(scores))
    drawn = [_auc(scores, rng.permutation(rows)) for _ in range(PERMUTATIONS)]
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return {"auc": _auc(scores, rows), "chance low": float(low), "chance high": float(high)}


def _auc(scores: FloatArray, own: np.ndarray) -> float:
    """AUC of scores (N, N) with the music `own` (N,) of each dance, against all other music."""
    mask = np.zeros(scores.shape, bool)
    mask[np.arange(len(scores)), own] = True
    right, other = scores[mask], scores[~mask]
    return auc(right[np.isfinite(right)], other[np.isfinite(other)])


def right_music_table(outcomes: Mapping[tuple[str, str], HalfMinutes]) -> pd.DataFrame:
    """`right_music` of every system and dance by both scores.

    Returns
    -------
    DataFrame with the columns system, dance, score (of `SCORES`), dances, own music, other music (mean harmony above
    chance), auc, "chance low", "chance high", verdict ("inside chance", "above", "below"; "" without a number)
    """
    rows = []
    for (system, dance), own in outcomes.items():
        if system == STATUE:
            continue
        for score, matrix in zip(SCORES, own.scores, strict=True):
            row = {"system": system, "dance": dance, "score": score, "dances": len(matrix)}
            outcome = right_music(matrix)
            rows.append(row | _means(matrix) | outcome | {"verdict": _verdict(*outcome.values())})
    return pd.DataFrame(rows)


def _means(matrix: FloatArray) -> dict[str, float]:
    own = np.eye(len(matrix), dtype=bool)
    return {"own music": _mean(matrix[own]), "other music": _mean(matrix[~own])}


def _verdict(value: float, low: float, high: float) -> str:
    if not np.isfinite(value):
        return ""
    return "inside chance" if low <= value <= high else "above" if value > high else "below"


def machine_marks(outcomes: Mapping[tuple[str, str], HalfMinutes]) -> pd.DataFrame:
    """Four marks of every system, 0 to 10, and their weighted sum (R40), over all dances together.

    Naturalness: Frechet distance of a pose network from one half of the recorded dancers, 10 as far as the other half
    is, 0 as far as statues are. Richness: mean distance between pieces, 10 as of the recorded, 0 as of statues. Music:
    harmony above chance, with the bar pattern where the dance has one, 10 as of the recorded, 0 at chance or where
    nothing rests. Sliding: 10 as of the recorded or less, 0 as of statues that glide on their paths.

    Returns
    -------
    DataFrame with the columns system, those of `MARKS`, total, and low and high of the total (95 % over trainings)
    """
    scale = _Scale.of(outcomes)
    rows = []
    for system in dict.fromkeys(system for system, _ in outcomes):
        own = [each for (name, _), each in outcomes.items() if name == system]
        trainings = sorted({number for each in own for number in each.training.tolist()} - {0.0})
        totals = [_total(scale.marks(own, training)) for training in trainings]
        _, low, high = mean_interval(totals) if totals else (0.0, np.nan, np.nan)
        marks = scale.marks([replace(each, poses=each.poses[1::2]) for each in own] if system == RIGHT_SONG else own)
        rows.append({"system": system, **marks, "total": _total(marks), "low": low, "high": high})
    return pd.DataFrame(rows)


def _total(marks: Mapping[str, float]) -> float:
    """The weighted sum of Table 3."""
    return sum(weight * marks[name] for name, weight in MARKS.items())


@dataclass(frozen=True, eq=False)
class _Scale:
    """Both ends of every mark: of the recorded dancers, and of statues or other music."""

    reference: FloatArray
    best: Mapping[str, float]
    worst: Mapping[str, float]

    @classmethod
    def of(cls, outcomes: Mapping[tuple[str, str], HalfMinutes]) -> _Scale:
        """From the rows of the recorded dancers and of their statues."""
        recorded = [each for (name, _), each in outcomes.items() if name == RIGHT_SONG]
        still = [each for (name, _), each in outcomes.items() if name == STATUE]
        half = _pooled([each.poses[::2] for each in recorded])
        bare = cls(half, {}, {})
        other = bare.numbers([replace(each, poses=each.poses[1::2]) for each in recorded])
        worst = bare.numbers(still) | {"music": 0.0}
        return cls(half, other, worst)

    def numbers(self, own: Sequence[HalfMinutes], training: float | None = None) -> dict[str, float]:
        """The numbers that are marked, of all dances of a system, or those of one training."""
        rows = [np.ones(len(each.skating), bool) if training is None else each.training == training for each in own]
        kept = [mask[: len(each.poses)] for each, mask in zip(own, rows, strict=True)]
        pieces = _pooled([each.poses[mask] for each, mask in zip(own, kept, strict=True)])
        pieces, reference = standardise(pieces, self.reference), standardise(self.reference, self.reference)
        music = [_harmony(each).diagonal()[mask] for each, mask in zip(own, rows, strict=True)]
        return {
            "naturalness": frechet_distance(pieces, reference).value,
            "richness": diversity(pieces),
            "music": _mean(_mean(values) for values in music),
            "sliding": float(np.concatenate([each.skating[mask] for each, mask in zip(own, rows, strict=True)]).mean()),
        }

    def marks(self, own: Sequence[HalfMinutes], training: float | None = None) -> dict[str, float]:
        """`numbers` as marks."""
        numbers = self.numbers(own, training)
        marks = {name: mark(numbers[name], worst=self.worst[name], best=self.best[name]) for name in MARKS}
        return {name: 0.0 if np.isnan(marks[name]) else marks[name] for name in MARKS}


def _pooled(poses: Sequence[FloatArray]) -> FloatArray:
    """Pieces (N, P, K) of several styles as rows (R, K)."""
    return np.concatenate([each.reshape(-1, each.shape[-1]) for each in poses if each.size])


def _mean(values: Iterable[float]) -> float:
    """Mean of those that are numbers; NaN without any."""
    numbers = [value for value in values if np.isfinite(value)]
    return float(np.mean(numbers)) if numbers else float("nan")


def _harmony(own: HalfMinutes) -> FloatArray:
    """(N, N) by the bar pattern where the dance has one, else without."""
    by_bar, plain = own.scores[BY_BAR], own.scores[0]
    return plain if np.isnan(by_bar).all() else by_bar


def mark(value: float, *, worst: float, best: float) -> float:
    """0 to 10 between the worst and the best; NaN where any is missing.

    >>> mark(3.0, worst=5.0, best=1.0), mark(0.5, worst=5.0, best=1.0)
    (5.0, 10.0)
    """
    return float(np.clip(10 * (worst - value) / (worst - best), 0.0, 10.0))
