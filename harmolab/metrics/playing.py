"""Does the playing meet the sound? The harmony score of strikes, or of turns of a bow, with the onsets of the sound.

Hits and the error in pixels are two things: hands that shrink towards their mean pose win pixels and lose hits. Read
the score of each hand with its own notes beside that of all, where a strike of the wrong hand counts as well. The score
of the whole body, by which dances are judged, hardly sees a musician.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from harmolab.beats.notes import BOW_HAND, note_beats, playing_events, playing_hands, strikes
from harmolab.beats.visual import visual_beats
from harmolab.harmony import hit_mask, hit_pairs, hitting_score, score_harmony
from harmolab.io.player_points import SIDES
from harmolab.params import HarmonyParams
from harmolab.significance import bootstrap_interval_of, p_value, rotated_shares, rotations
from harmolab.types import FRAME_EDGE, BeatTrack, FloatArray, Motion, Notes
from harmolab.verdict.score import HarmonyScore

REACH = 0.3  # seconds: how early or late hands are looked for as a whole
STEP = 0.01  # seconds between the lags that are tried
NULL_STEP, MOST_ROTATIONS = 0.02, 20_000  # seconds between rotations of the null of lags, and how many at most
CERTAIN = 0.05  # p-value below which there is evidence that hands and sound belong together
# The same for a lag: of players and pieces that do not belong together a tenth has p < .05 there, for both keep time.
CERTAIN_LAG = 0.01


class Lag(NamedTuple):
    """Seconds that the hands as a whole move after the onsets: a median, late is positive.

    Parameters
    ----------
    seconds : float, NaN where nothing says that hands and sound have to do with each other
    interval : (float, float), 95 % of it when pairs of onset and event are drawn anew; NaN without
    share : float, of the onsets that are hit at the best lag, weighted by strength
    p_value : float, share of other moments of the motion at which some lag gives as much; NaN when not computed
    """

    seconds: float
    interval: tuple[float, float]
    share: float
    p_value: float


NO_LAG = Lag(float("nan"), (float("nan"), float("nan")), float("nan"), float("nan"))


@dataclass(frozen=True, eq=False)
class PlayingScore:
    """The score of a musician's hands, and what to read beside it.

    Parameters
    ----------
    instrument : "piano" or "violin"
    score : HarmonyScore of all events of the instrument with all onsets, from the first onset to the last
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
    score = partial(_scored, params=params, n_rotations=n_rotations, seed=seed)
    onsets = note_beats(sound, motion.duration) if isinstance(sound, Notes) else sound
    events = playing_events(motion, instrument)
    is_piano = instrument == "piano"
    by_hand = {side: strikes(motion, hand=side) for side in playing_hands(motion)} if is_piano else {BOW_HAND: events}
    own = hand_onsets(sound, motion.duration) if is_piano and isinstance(sound, Notes) else {}
    whole = score(onsets, events)
    return PlayingScore(
        instrument,
        whole,
        score(onsets, visual_beats(motion, params=params)),
        _lag(whole) if n_rotations else NO_LAG,
        by_hand,
        {side: score(track, by_hand[side]) for side, track in own.items() if side in by_hand},
    )


def hand_onsets(notes: Notes, duration: float) -> dict[str, BeatTrack]:
    """The onsets of each hand by its name, as of `note_beats`, of the hands that notes are known to be played by.

    `duration` is that of the time line, seconds.
    """
    parts = {side: notes.select(notes.hands == number) for number, side in enumerate(SIDES)}
    return {side: note_beats(part, duration) for side, part in parts.items() if len(part)}


def _scored(
    onsets: BeatTrack, events: BeatTrack, *, params: HarmonyParams, n_rotations: int, seed: int
) -> HarmonyScore:
    """The score from the first onset to the last, give or take the delay; times stay those of the motion.

    Before and after there is nothing to hit, and rotated hands that fall silent there would make chance look small.
    """
    if not len(onsets):
        return score_harmony(onsets, events, params=params, n_rotations=n_rotations, seed=seed)
    start = max(float(onsets.times[0]) - params.reaction_delay, 0.0)
    length = min(float(onsets.times[-1]) + params.reaction_delay, onsets.duration) - start + FRAME_EDGE
    parts = onsets.span(start, length), events.span(start, length)
    score = score_harmony(*parts, params=params, n_rotations=n_rotations, seed=seed)
    music, visual = (
        replace(track, times=track.times + start, duration=onsets.duration) for track in (score.music, score.visual)
    )
    return replace(score, music=music, visual=visual)


def _lag(score: HarmonyScore) -> Lag:
    """The lag with which most onsets are hit, made exact by the median distance of the pairs that it gives."""
    onsets, events, delay = score.music, score.visual, score.params.reaction_delay
    if not (len(onsets) and len(events)):
        return NO_LAG
    steps = round(REACH / STEP)
    # From the smallest on: of equals the first is taken.
    lags = sorted((STEP * np.arange(-steps, steps + 1)).tolist(), key=abs)
    weights = onsets.strengths / onsets.strengths.sum()
    hits = [hitting_score(hit_mask(onsets.times, events.times - lag, delay=delay), weights) for lag in lags]
    best = int(np.argmax(hits))
    p = _lag_p(onsets, events, weights, delay, hits[best])
    if not (score.p_value < CERTAIN or p < CERTAIN_LAG):
        return NO_LAG._replace(share=hits[best], p_value=p)
    pairs = hit_pairs(onsets.times, events.times - lags[best], delay=delay, matching=score.params.matching)
    late = events.times[pairs[pairs >= 0]] - onsets.times[pairs >= 0]
    interval = bootstrap_interval_of(lambda places: float(np.median(late[places])), late.size)
    return Lag(float(np.median(late)), interval, hits[best], p)


def _lag_p(onsets: BeatTrack, events: BeatTrack, weights: FloatArray, delay: float, share: float) -> float:
    """Share of other places of the events at which some lag hits as much; each place is all lags around a rotation."""
    start, length = float(onsets.times[0]), float(np.ptp(onsets.times)) + delay
    count = min(round(length / NULL_STEP), MOST_ROTATIONS)
    shifts = rotations(length, count)
    others = (shifts > 2 * REACH) & (shifts < length - 2 * REACH)
    if not others.any():
        return 1.0
    around = np.sort(np.mod(events.times - start, length))
    null = rotated_shares(onsets.times - start, around, weights, delay=delay, duration=length, count=count)
    return p_value(share, maximum_filter1d(null, round(2 * REACH * count / length), mode="wrap")[others])
