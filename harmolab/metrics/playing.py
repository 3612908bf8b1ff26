"""Does the playing meet the sound? The harmony score of strikes, or of turns of a bow, with the onsets of the sound.

Hits and the error in pixels are two things: hands that shrink towards their mean pose win pixels and lose hits. Read the
score of the hands' own notes beside that of all: there a strike of the wrong hand counts as well. The score of the whole
body, by which dances are judged, hardly sees a musician.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from harmolab.beats.notes import BOW_HAND, note_beats, playing_events, playing_hands, strikes
from harmolab.harmony import hit_mask, hitting_score, score_harmony, score_motion
from harmolab.io.player_points import SIDES
from harmolab.params import HarmonyParams
from harmolab.significance import bootstrap_interval_of
from harmolab.types import BeatTrack, Motion, Notes
from harmolab.verdict.score import HarmonyScore

REACH = 0.3  # seconds: how early or late hands are looked for as a whole
STEP = 0.01  # seconds between the lags that are tried
CERTAIN = 0.05  # p-value above which there is no evidence that hands and sound have to do with each other


class Lag(NamedTuple):
    """How much later than the onsets the hands move as a whole: median, seconds, late is positive.

    Parameters
    ----------
    seconds : float, NaN where nothing says that hands and sound have to do with each other
    interval : (float, float), 95 % of it when pairs of onset and event are drawn anew; NaN without
    share : float, of the onsets that are hit once the lag is taken off
    p_value : float, of that share, for all the lags that were tried
    """

    seconds: float
    interval: tuple[float, float]
    share: float
    p_value: float


@dataclass(frozen=True, eq=False)
class PlayingScore:
    """The score of a musician's hands, and what to read beside it.

    Parameters
    ----------
    instrument : "piano" or "violin"
    score : HarmonyScore of all events of the instrument with all onsets
    body : HarmonyScore of the valleys of the whole body's joint speed with the same onsets: the score of a dance
    lag : Lag of the events
    events : hand -> its BeatTrack of strikes; of a violin those of the hand that bows, its turns
    hands : hand -> HarmonyScore of its strikes with its own notes, where the notes tell the hand; empty for a violin
    """

    instrument: str
    score: HarmonyScore
    body: HarmonyScore
    lag: Lag
    events: Mapping[str, BeatTrack]
    hands: Mapping[str, HarmonyScore] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def is_together(self) -> bool:
        """True with evidence that hands and sound belong together, without any lag taken off."""
        return self.score.p_value < CERTAIN

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers by name, ready for JSON but for NaN."""
        scores = {"": self.score, "body_": self.body} | {f"{side}_": score for side, score in self.hands.items()}
        numbers = {prefix + name: value for prefix, score in scores.items() for name, value in _numbers(score).items()}
        lag = {"lag_s": self.lag.seconds, "lag_interval_s": list(self.lag.interval)}
        return {"instrument": self.instrument, **numbers, **lag}


def _numbers(score: HarmonyScore) -> dict[str, Any]:
    return {
        "share_hit": score.mean_share,
        "chance": score.chance,
        "harmony_above_chance": score.harmony_above_chance,
        "interval": list(score.interval),
        "p_value": score.p_value,
        "onsets": score.n_audio,
        "events": score.n_visual,
    }


def playing_score(
    motion: Motion,
    sound: Notes | BeatTrack,
    instrument: str,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> PlayingScore:
    """The score of a musician's hands with the onsets of a sound, on the motion's time line.

    Parameters
    ----------
    motion : Motion, points as in `harmolab.io.player_points`
    sound : Notes, or the BeatTrack of `note_beats` or `onset_beats`
        Notes that tell the hand are also scored hand by hand.
    instrument : "piano" or "violin"
    params : HarmonyParams of measure "hits", default ``HarmonyParams.playing()``
    n_rotations, seed : as in `harmolab.harmony.score_harmony`; without rotations there is no lag

    Raises
    ------
    ValueError
        As `harmolab.beats.notes.playing_events`.
    """
    params = params or HarmonyParams.playing()
    score = partial(score_harmony, params=params, n_rotations=n_rotations, seed=seed)
    onsets = note_beats(sound, motion.duration) if isinstance(sound, Notes) else sound
    events = playing_events(motion, instrument)
    is_piano = instrument == "piano"
    by_hand = {side: strikes(motion, hand=side) for side in playing_hands(motion)} if is_piano else {BOW_HAND: events}
    own = hand_onsets(sound, motion.duration) if is_piano and isinstance(sound, Notes) else {}
    whole = score(onsets, events)
    return PlayingScore(
        instrument,
        whole,
        score_motion(onsets, motion, params=params, n_rotations=n_rotations, seed=seed),
        _lag(onsets, events, whole, n_rotations),
        by_hand,
        {side: score(track, by_hand[side]) for side, track in own.items() if side in by_hand},
    )


def hand_onsets(notes: Notes, duration: float) -> dict[str, BeatTrack]:
    """The onsets of each hand by its name, as of `note_beats`; of hands that some of the notes are known to be played by.

    `duration` is that of the time line, seconds.
    """
    mine = {side: notes.select(notes.hands == number) for number, side in enumerate(SIDES)}
    return {side: note_beats(part, duration) for side, part in mine.items() if len(part)}


def _lag(onsets: BeatTrack, events: BeatTrack, score: HarmonyScore, n_rotations: int) -> Lag:
    """The lag with which most onsets are hit, made exact by the median distance of the pairs that it gives.

    It is believed where the score without a lag is evidence already, or where that with it is for all lags tried:
    Bonferroni's correction for as many as fit side by side.
    """
    params, nan = score.params, float("nan")
    steps = round(REACH / STEP)
    # From the smallest on: of equals the first is taken.
    lags = sorted((STEP * np.arange(-steps, steps + 1)).tolist(), key=abs)
    hits = [_share_hit(onsets, events, lag, params.reaction_delay) for lag in lags]
    if n_rotations == 0 or max(hits, default=0.0) == 0:
        return Lag(nan, (nan, nan), 0.0, nan)
    best = score_harmony(
        onsets, events, params=replace(params, lag=lags[int(np.argmax(hits))]), n_rotations=n_rotations
    )
    tried = 1 + REACH / max(params.reaction_delay, STEP)
    p = min(score.p_value, tried * best.p_value, 1.0)
    pairs = best.pairs >= 0
    late = best.visual.times[best.pairs[pairs]] - best.music.times[pairs]
    if not p < CERTAIN:
        return Lag(nan, (nan, nan), best.mean_share, p)
    interval = bootstrap_interval_of(lambda places: float(np.median(late[places])), late.size)
    return Lag(float(np.median(late)), interval, best.mean_share, p)


def _share_hit(onsets: BeatTrack, events: BeatTrack, lag: float, delay: float) -> float:
    """Share of the onsets, weighted by strength, with an event within the delay once the lag is taken off."""
    total = float(onsets.strengths.sum())
    return hitting_score(hit_mask(onsets.times, events.times - lag, delay=delay), onsets.strengths) / max(total, 1e-300)
