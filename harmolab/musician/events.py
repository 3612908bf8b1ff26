"""Events of playing (onsets of the sound, strikes of fingers, turns of the bow), and the harmony score of playing.

The beats of a whole body say little about a musician, whose hands do the work (docs/readings_audio_to_body.md). So the
score of `harmolab.score` is taken of the strikes of a pianist's fingers, or the turns of a violinist's bow, with the
onsets of the sound.

How to read it: hits and the error in pixels are two things, since hands that shrink towards their mean pose win pixels
and lose hits. In the score of all strikes a strike of the wrong hand counts as well; read the score of each hand with
its own notes beside it. The score of the whole body, by which dances are judged, hardly sees a musician.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import find_peaks

from harmolab.beats.flow import envelope_beats
from harmolab.beats.visual import RATE, visual_beats
from harmolab.body.kinematics import refine_extrema, smooth_positions, upsample_positions
from harmolab.musician.sound_features import note_envelope
from harmolab.params import HarmonyParams
from harmolab.readers.beats import ANNOTATION_RATE
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, SIDES, fingertips, hand_joints, hand_root, wrist_names
from harmolab.score import HarmonyScore, hit_mask, hit_pairs, hitting_score, score_harmony
from harmolab.significance import bootstrap_interval_of, p_value, rotated_hits, rotations
from harmolab.systems.training.features import check_choice
from harmolab.types import FRAME_EDGE, Audio, BeatTrack, BoolArray, FloatArray, Motion, Notes, bridged, check_kind

MERGE = 0.04  # seconds within which events are one: the notes of a chord, the fingers that strike it
PALM_SHARE = 0.03  # of the palm's length that a strike goes down at least: 1.5 pixels where it is 50 pixels long
STROKE_SHARE = 0.03  # of the range of the bow hand's distance that a stroke is long at least
BRIDGE_SHARE = 1 / 3  # of the way from the left shoulder to the left hand: where the bridge of a violin stands
SMOOTHING = 0.02  # seconds: fingers that repeat a note come down every 0.14 s, and more would level that out
HAND_SMOOTHING = 0.2  # seconds: a hand dips when one finger strikes, and beside it the others would seem to rise
# Standard deviations of the smoothed noise that an event exceeds at least. On planted hands with noise of 1 pixel 4.5
# finds .98 to .999 of the strikes, and 1.06 for each onset; with 3 it would be 1.4 to 1.9.
NOISE = 4.5
LOUDEST = 99.0  # percentile of the onset strength that counts as 1
ONSET_RADIUS, ONSET_AROUND = 0.03, 0.1  # seconds: the highest peak within one, measured against the mean over the other
# An onset exceeds that mean by 0.1 and fifteen times the median, but 0.4 is enough. Of planted pieces it gives every
# note, and of the violinist's onsets .97 are notes: vibrato makes others, five a note without this.
ONSET_THRESHOLD, ONSET_FLOOR, ONSET_LIMIT = 0.1, 15.0, 0.4
ONSET_LEAD = 0.01  # seconds by which onset strength is ahead of a planted note: the window reaches it early
BRIDGE = "violin_bridge"  # a point of avatars; no camera tracks it
BOW_HAND = "right"
DIFFERENCE, DIFFERENCE_NORM = 4, np.sqrt(70.0)  # order of the differences that show noise, and their gain for it
MAD = 1.4826  # standard deviations of a normal distribution in a median absolute value


def note_beats(notes: Notes, duration: float) -> BeatTrack:
    """The onsets of notes as beats; the notes of a chord, which begin together, are one.

    Onsets within 40 ms of the first of a chord belong to it. The time of the chord is their mean, weighted by loudness,
    and its strength is the loudness of the loudest.

    Parameters
    ----------
    notes : Notes
        On a time line of `duration` seconds. Notes after its end, and silent ones (loudness 0), are left out.
    duration : float, seconds

    Returns
    -------
    BeatTrack of `duration` seconds

    Examples
    --------
    >>> chord = Notes([1.0, 1.02, 2.0], [1.5, 1.5, 2.5], [60, 64, 67])
    >>> note_beats(chord, 3.0).times
    array([1.01, 2.  ])
    """
    check_kind(notes, Notes)
    sounding = notes.select((notes.onsets <= duration) & (notes.loudness > 0))
    return _merged(_Events(sounding.onsets, sounding.loudness), ANNOTATION_RATE, duration)


def onset_beats(audio: Audio) -> BeatTrack:
    """The onsets of the notes in a sound of which no notes are known; a program finds them.

    They are all notes that can be told apart, not the beats of the music (`audio_beats`). Chords are as in
    `note_beats`. Soft notes under louder ones are missed.

    Parameters
    ----------
    audio : Audio

    Returns
    -------
    BeatTrack: peaks of `harmolab.musician.sound_features.note_envelope`, with their heights, 0 to 1, as strengths

    Raises
    ------
    ValueError
        Unless an Audio is passed.
    """
    check_kind(audio, Audio)
    envelope, rate = note_envelope(audio)
    loudest = float(np.percentile(envelope, LOUDEST))
    heights = np.minimum(envelope / loudest, 1.0) if loudest > 0 else np.zeros_like(envelope)
    threshold = min(ONSET_THRESHOLD + ONSET_FLOOR * float(np.median(heights)), ONSET_LIMIT)
    peaks = envelope_beats(heights, rate, radius=ONSET_RADIUS, around=ONSET_AROUND, threshold=threshold)
    times = peaks.times + ONSET_LEAD
    inside = (times >= 0) & (times <= audio.duration)
    return _merged(_Events(times[inside], peaks.strengths[inside]), rate, audio.duration)


def strikes(motion: Motion, *, hand: str | None = None, detected: BoolArray | None = None) -> BeatTrack:
    """The strikes of a pianist's fingers: moments at which a fingertip is lowest, seen from its hand.

    The hand is the mean of its wrist and, where the motion has them, the roots of its fingers, smoothed over 0.2 s.

    Parameters
    ----------
    motion : Motion
        (T, P, 2) image coordinates, y down, or (T, P, 3), y up; joints are named as in
        `harmolab.readers.player_points`.
    hand : "left" or "right", optional
        One hand alone; when left out, every hand that the motion has.
    detected : (T, P) mask, optional
        False where a point's place is filled in, which has no noise; all True when left out.

    Returns
    -------
    BeatTrack
        The strength of a strike is its depth, at least 3 % of the palm, and 4.5 standard deviations of the fingertip's
        smoothed noise. Times lie between frames (by cubic splines, then parabolas). Strikes within 40 ms are one.
        Frames that are not valid are bridged, and strikes there are left out.

    Raises
    ------
    ValueError
        For another hand, a hand without wrist or fingertips in the motion, or a mask that has not an entry for each
        frame and joint of the motion.

    Notes
    -----
    A camera above the keys does not see fingers go down: strikes read from such points are no evidence.
    """
    hands, size = _hands(motion, hand), motion.positions.shape[:2]
    if detected is not None and np.shape(detected) != size:
        raise ValueError(f"detected must be {size}, frames and joints of the motion, got {np.shape(detected)}")
    return _track([_fingertip_events(motion, side, detected) for side in hands], motion)


def bow_turns(motion: Motion, *, reading: str = "distance") -> BeatTrack:
    """The moments at which a violinist's bow turns from one stroke to the next.

    They are the extrema of the distance of the bow hand (the mean of the right hand's points) from the bridge. The
    bridge is the point `violin_bridge` where there is one, as an avatar has it. Else it is a third of the way from the
    left shoulder to the left hand, or the one of these two that the motion has.

    Parameters
    ----------
    motion : Motion, (T, P, 2) or (T, P, 3); joints are named as in `harmolab.readers.player_points`
    reading : "distance" or "direction"
        The curve whose extrema are taken. The distance does not change when the bow goes over to another string.
        "direction" is the place along the first principal component of the hand's path, seen from the bridge; where
        strings change often, this lies across the bow.

    Returns
    -------
    BeatTrack
        The strength of a turn is the length of the shorter stroke beside it, at least 3 % of the range of the curve;
        else as of `strikes`. Slurred notes share a stroke, and a bow that stops and goes on does not turn.

    Raises
    ------
    ValueError
        For another reading, or a motion that has no right hand, or no shoulder or hand on the left.
    """
    check_choice("reading", reading, ("distance", "direction"))
    path = _bow_path(motion)
    if reading == "distance":
        curve = np.linalg.norm(path, axis=1)
    else:
        curve = path @ np.linalg.eigh(np.cov(path, rowvar=False))[1][:, -1]
    smooth = _smooth_curves(curve[:, None], motion, SMOOTHING)[:, 0]
    least = max(STROKE_SHARE * float(np.ptp(smooth)), NOISE * _noise(curve, motion.fps))
    return _track([_peaks(sign * smooth, _rate(motion), least) for sign in (1.0, -1.0)], motion)


def playing_events(motion: Motion, instrument: str, *, detected: BoolArray | None = None) -> BeatTrack:
    """The events of an instrument: `strikes` of a piano, where `detected` counts, or `bow_turns` of a violin.

    ValueError for another instrument, or as those.
    """
    check_choice("instrument", instrument, INSTRUMENTS)
    return strikes(motion, detected=detected) if instrument == "piano" else bow_turns(motion)


def playing_hands(motion: Motion) -> tuple[str, ...]:
    """The hands of which a motion has a wrist and a fingertip at least."""
    check_kind(motion, Motion)
    skeleton = motion.skeleton
    return tuple(side for side in SIDES if hand_root(skeleton, side) is not None and fingertips(skeleton, side))


class _Events(NamedTuple):
    """Times in seconds and strengths, both (B,), in any order, before those close together are merged."""

    times: FloatArray
    strengths: FloatArray


def _merged(events: _Events, fps: float, duration: float) -> BeatTrack:
    """Groups of events that lie within `MERGE` seconds of their first: weighted mean time, largest strength."""
    order = np.argsort(events.times, kind="stable")
    times, strengths = events.times[order], events.strengths[order]
    firsts: list[int] = []
    first = 0
    while first < times.size:
        firsts.append(first)
        first = int(np.searchsorted(times, times[first] + MERGE, side="right"))
    if not firsts:
        return BeatTrack(times, strengths, fps, duration)
    means = np.add.reduceat(times * strengths, firsts) / np.add.reduceat(strengths, firsts)
    return BeatTrack(means, np.maximum.reduceat(strengths, firsts), fps, duration)


def _track(events: Iterable[_Events], motion: Motion) -> BeatTrack:
    """The events of several curves as one track, without those on frames that are not valid."""
    every = _joined(events)
    valid = motion.valid[np.minimum((every.times * motion.fps).round().astype(np.int64), motion.n_frames - 1)]
    return _merged(_Events(every.times[valid], every.strengths[valid]), _rate(motion), motion.duration)


def _peaks(curve: FloatArray, fps: float, prominence: float) -> _Events:
    """Peaks of a curve (T,) that stand out by `prominence`, at least by more than rounding."""
    least = max(prominence, 1e-9 * float(np.ptp(curve)), np.finfo(float).tiny)
    frames, properties = find_peaks(curve, prominence=least)
    return _Events(refine_extrema(curve, frames) / fps, properties["prominences"])


def _fingertip_events(motion: Motion, side: str, detected: BoolArray | None) -> _Events:
    """Lowest points of the fingertips of one hand."""
    skeleton = motion.skeleton
    tips, wrist = fingertips(skeleton, side), _numbers_of(motion, wrist_names(side))[:1]
    hand = wrist + _numbers_of(motion, [f"{side}_{finger}_1" for finger in FINGERS])
    down = motion.positions[..., 1] if motion.positions.shape[2] == 2 else -motion.positions[..., 1]
    heights = bridged(np.column_stack([down[:, tips], down[:, hand].mean(axis=1)]), motion.valid)
    curves = _smooth_curves(heights[:, :-1], motion, SMOOTHING)
    curves = curves - _smooth_curves(heights[:, -1:], motion, HAND_SMOOTHING)
    least = PALM_SHARE * _palm(motion, side)
    beside = heights[:, :-1] - heights[:, -1:]
    if detected is not None:
        is_seen = np.asarray(detected, bool)
        beside[~(is_seen[:, tips] & is_seen[:, hand].all(axis=1, keepdims=True))] = np.nan
    bounds = [max(least, NOISE * _noise(each, motion.fps)) for each in beside.T]
    return _joined(_peaks(curve, _rate(motion), bound) for curve, bound in zip(curves.T, bounds, strict=True))


def _joined(events: Iterable[_Events]) -> _Events:
    """All events of several curves."""
    return _Events(*(np.concatenate(values) for values in zip(*events, strict=True)))


def _palm(motion: Motion, side: str) -> float:
    """Length of a palm, a median over time: from the wrist to the root of the middle finger.

    Without that point it is half the way to the fingertips, since a finger is about as long as its palm.
    """
    root, knuckle = hand_root(motion.skeleton, side), _numbers_of(motion, [f"{side}_middle_1"])
    ends, share = (knuckle, 1.0) if knuckle else (fingertips(motion.skeleton, side), 0.5)
    ways = motion.positions[:, ends].mean(axis=1) - motion.positions[:, root]
    return share * float(np.median(np.linalg.norm(ways, axis=1)))


def _bow_path(motion: Motion) -> FloatArray:
    """(T, D) places of the bow hand from the bridge, frames that are not valid bridged over."""
    check_kind(motion, Motion)
    bow = _numbers_of(motion, hand_joints(BOW_HAND)) or _numbers_of(motion, [f"{BOW_HAND}_wrist"])
    left = _numbers_of(motion, ["left_shoulder"]) + _numbers_of(motion, wrist_names("left"))[:1]
    ends = _numbers_of(motion, [BRIDGE]) or left
    if not bow or not ends:
        raise ValueError(
            "turns of a bow need a point of the right hand, and left_shoulder, left_hand or violin_bridge; "
            f"the motion has {', '.join(motion.skeleton.joints[:6])} ..."
        )
    first, last = motion.positions[:, ends[0]], motion.positions[:, ends[-1]]
    anchor = first + BRIDGE_SHARE * (last - first)
    return bridged(motion.positions[:, bow].mean(axis=1) - anchor, motion.valid)


def _hands(motion: Motion, hand: str | None) -> tuple[str, ...]:
    """The hands to read; ValueError where there is nothing to read."""
    if hand is not None and hand not in SIDES:
        raise ValueError(f"hand must be {' or '.join(SIDES)}, got {hand!r}")
    hands = tuple(side for side in playing_hands(motion) if hand in (None, side))
    if not hands:
        raise ValueError(
            f"strikes need the wrist and fingertips of {'a' if hand is None else f'the {hand}'} hand, named as in "
            f"harmolab.readers.player_points (left_hand, left_index_4); the motion has "
            f"{', '.join(motion.skeleton.joints[:6])} ..."
        )
    return hands


def _numbers_of(motion: Motion, names: Sequence[str]) -> list[int]:
    """Numbers of the joints of these names that the motion has."""
    return [motion.skeleton.joints.index(name) for name in names if name in motion.skeleton.joints]


def _rate(motion: Motion) -> float:
    """Rate of the curves that events are read from, hertz."""
    return max(motion.fps, RATE)


def _smooth_curves(curves: FloatArray, motion: Motion, smoothing: float) -> FloatArray:
    """Curves (T, K) at 120 hertz at least, smoothed by a Gaussian of so many seconds."""
    fast = upsample_positions(curves[:, :, None], motion.fps, RATE)
    return smooth_positions(fast, smoothing, _rate(motion))[:, :, 0]


def _noise(curve: FloatArray, fps: float) -> float:
    """Standard deviation that is left of the white noise on a curve (T,) once it is smoothed.

    Noise shows in fourth differences, in which hands hardly move. A Gaussian of s samples leaves (2 sqrt(pi) s)^-1/2.
    Frames that are NaN do not count.
    """
    steps = np.diff(curve, DIFFERENCE)
    steps = steps[~np.isnan(steps)]
    left = min(1.0, (2 * np.sqrt(np.pi) * SMOOTHING * fps) ** -0.5)
    return left * MAD * float(np.median(np.abs(steps))) / DIFFERENCE_NORM if steps.size else 0.0


# The harmony score of playing

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
    """The score of a musician's hands, and the numbers to read beside it: the result of `playing_score`.

    Parameters
    ----------
    instrument : "piano" or "violin"
    score : HarmonyScore
        Of all strikes, or turns of the bow, with all onsets, from the first onset to the last.
    body : HarmonyScore
        Of the valleys of the whole body's joint speed with the same onsets: the score that a dance would get.
    lag : Lag
        How much later than the onsets the strikes or turns come: `seconds` and `interval`.
    events : dict
        Hand ("left", "right") -> BeatTrack of its strikes; of a violin the turns of the hand that bows.
    hands : dict
        Hand -> HarmonyScore of its strikes with its own notes, where the notes tell the hand; empty for a violin.
    """

    instrument: str
    score: HarmonyScore
    body: HarmonyScore
    lag: Lag
    events: Mapping[str, BeatTrack]
    hands: Mapping[str, HarmonyScore] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def is_together(self) -> bool:
        """True where there is evidence that hands and sound belong together: a p-value below .05, no lag taken off."""
        return self.score.p_value < CERTAIN

    def to_dict(self) -> dict[str, Any]:
        """The numbers by name, ready for JSON but for NaN; names begin with "body_", "left_" or "right_" for a part."""
        scores = {"": self.score, "body_": self.body} | {f"{side}_": score for side, score in self.hands.items()}
        numbers = {prefix + name: value for prefix, score in scores.items() for name, value in _numbers(score).items()}
        lag = {"lag_s": self.lag.seconds, "lag_interval_s": list(self.lag.interval)}
        return {"instrument": self.instrument, **numbers, **lag}


def _numbers(score: HarmonyScore) -> dict[str, Any]:
    return {
        "share_hit": score.mean_share, "chance": score.chance, "harmony_above_chance": score.harmony_above_chance,
        "interval": list(score.interval), "p_value": score.p_value, "onsets": score.n_audio, "events": score.n_visual,
    }  # fmt: skip


def playing_score(
    motion: Motion,
    sound: Notes | BeatTrack,
    instrument: str,
    *,
    n_rotations: int = 1000,
    detected: BoolArray | None = None,
) -> PlayingScore:
    """The score of a musician's hands with the onsets of the sound: do the hands meet the notes?

    Parameters
    ----------
    motion : Motion
        Points of the musician, named as in `harmolab.readers.player_points`.
    sound : Notes or BeatTrack
        The notes, or the onsets of `note_beats` or `onset_beats`, on the motion's time line. Notes that tell the hand
        are also scored hand by hand.
    instrument : "piano" or "violin"
        Strikes are read of a pianist (`strikes`), turns of the bow of a violinist (`bow_turns`).
    n_rotations : as in `score_harmony`; without rotations there is no lag
    detected : as in `strikes`

    Returns
    -------
    PlayingScore

    Raises
    ------
    ValueError
        For another instrument or kind of sound, and where the motion lacks the points of the hands.
    """
    if not isinstance(sound, Notes | BeatTrack):
        raise ValueError(f"sound must be Notes, or the BeatTrack of onset_beats, got {type(sound).__name__}")
    check_kind(motion, Motion)
    score = partial(scored, n_rotations=n_rotations)
    onsets = note_beats(sound, motion.duration) if isinstance(sound, Notes) else sound
    events = playing_events(motion, instrument, detected=detected)
    by_hand, own = {BOW_HAND: events}, {}
    if instrument == "piano":
        by_hand = {side: strikes(motion, hand=side, detected=detected) for side in playing_hands(motion)}
        own = hand_onsets(sound, motion.duration) if isinstance(sound, Notes) else {}
    whole, body = score(onsets, events), score(onsets, visual_beats(motion, params=HarmonyParams.playing()))
    hands = {side: score(track, by_hand[side]) for side, track in own.items() if side in by_hand}
    return PlayingScore(instrument, whole, body, _lag(whole) if n_rotations else NO_LAG, by_hand, hands)


def hand_onsets(notes: Notes, duration: float) -> dict[str, BeatTrack]:
    """The onsets of each hand by its name, as of `note_beats`, of the hands that notes are known to be played by.

    `duration` is that of the time line, seconds.
    """
    parts = {side: notes.select(notes.hands == number) for number, side in enumerate(SIDES)}
    return {side: note_beats(part, duration) for side, part in parts.items() if len(part)}


def scored(onsets: BeatTrack, events: BeatTrack, n_rotations: int = 1000) -> HarmonyScore:
    """The score from the first onset to the last, give or take the delay; times stay those of the motion.

    Before and after there is nothing to hit, and rotated hands that fall silent there would make chance look small.
    """
    params = HarmonyParams.playing()
    if not len(onsets):
        return score_harmony(onsets, events, params=params, n_rotations=n_rotations)
    start = max(float(onsets.times[0]) - params.reaction_delay, 0.0)
    length = min(float(onsets.times[-1]) + params.reaction_delay, onsets.duration) - start + FRAME_EDGE
    parts = onsets.span(start, length), events.span(start, length)
    score = score_harmony(*parts, params=params, n_rotations=n_rotations)
    own = [replace(each, times=each.times + start, duration=onsets.duration) for each in (score.music, score.visual)]
    return replace(score, music=own[0], visual=own[1])


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
    interval = bootstrap_interval_of(lambda places: np.median(late[places], axis=1), late.size)
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
    null = rotated_hits(onsets.times - start, around, weights, delay=delay, duration=length, count=count)
    return p_value(share, maximum_filter1d(null, round(2 * REACH * count / length), mode="wrap")[others])
