"""Causes of large errors by rule (Fig. 11): leap, very fast, occluded, unseen register, or none of these.

The paper names "unexpected tones or movements that are not captured well in the training data (..., movement from one
side of keyboard to extreme other, or very fast pace)" and "extreme occlusions". What is unexpected is read from the
training pieces, hand by hand: what less than a hundredth of them has.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.ndimage import binary_dilation

from harmolab.musician.events import MERGE
from harmolab.musician.performances import Performance
from harmolab.readers.player_points import SIDES, hand_joints
from harmolab.types import BoolArray, FloatArray, Motion, Notes
from study.experiments.player_frames import PickedFrame, PredictedPiece
from study.experiments.players import PlayerData

RARE = 0.01  # share of the training's steps between notes, of its moments, and of its notes at either end
REACH = 0.5  # seconds from a note within which it can be the cause
NEAR = 0.1  # seconds from a rejected frame within which points may be wrong as well
WORST_SHARE = 0.01  # of the frames, whose causes are held against those of all
LEAP, FAST, OCCLUDED, REGISTER, NONE = "leap", "very fast", "occluded", "unseen register", "none of these"
CAUSES = (LEAP, FAST, OCCLUDED, REGISTER)


class HandLimits(NamedTuple):
    """Limits of what is usual in training pieces, of one hand.

    Parameters
    ----------
    leap : float, semitones from one onset to the next
    rate : float, onsets within a second
    low, high : float, MIDI numbers
    """

    leap: float
    rate: float
    low: float
    high: float


class Onsets(NamedTuple):
    """Onsets of one hand, the notes of a chord as one: seconds of the motion, and mean MIDI numbers, both (N,)."""

    times: FloatArray
    pitches: FloatArray


def usual_limits(data: PlayerData) -> dict[int, HandLimits]:
    """`HandLimits` of each hand (as `Notes.hands` numbers them) in the training pieces."""
    pieces = [each for each in data.performances if each.name in data.split.train and each.notes is not None]
    hands: dict[int, list[tuple[Onsets, FloatArray, FloatArray]]] = {}
    for piece in pieces:
        times: FloatArray = np.arange(piece.motion.n_frames) / piece.motion.fps
        for hand, notes in _by_hand(piece):
            pitches = notes.pitches.astype(np.float64)
            hands.setdefault(hand, []).append((hand_onsets_of(notes, piece.offset), pitches, times))
    return {hand: _limits(parts) for hand, parts in sorted(hands.items())}


def _limits(parts: Sequence[tuple[Onsets, FloatArray, FloatArray]]) -> HandLimits:
    steps = np.concatenate([np.abs(np.diff(onsets.pitches)) for onsets, _, _ in parts])
    rates = np.concatenate([onset_rate(onsets, times) for onsets, _, times in parts])
    low, high = np.quantile(np.concatenate([pitches for _, pitches, _ in parts]), (RARE / 2, 1 - RARE / 2))
    leap = np.quantile(steps, 1 - RARE) if steps.size else np.inf
    return HandLimits(float(leap), float(np.quantile(rates, 1 - RARE)), float(low), float(high))


def hand_onsets_of(notes: Notes, offset: float = 0.0) -> Onsets:
    """The onsets of one hand's notes; a note within 40 ms of the one before belongs to its chord.

    `offset` is the time of motion frame 0 on the notes' time line, seconds.
    """
    if not len(notes):
        return Onsets(np.zeros(0), np.zeros(0))
    firsts = np.flatnonzero(np.diff(notes.onsets, prepend=-np.inf) > MERGE)
    counts = np.diff(np.append(firsts, len(notes)))
    return Onsets(notes.onsets[firsts] - offset, np.add.reduceat(notes.pitches * 1.0, firsts) / counts)


def leaps(onsets: Onsets, times: FloatArray, *, leap: float) -> BoolArray:
    """(T,) mask of the times within half a second of a note that is more than `leap` semitones from the one before."""
    after = onsets.times[1:][np.abs(np.diff(onsets.pitches)) > leap]
    return near_any(times, after, REACH)


def onset_rate(onsets: Onsets, times: FloatArray) -> FloatArray:
    """(T,) onsets within the second around each time."""
    ends = np.searchsorted(onsets.times, times + 0.5, side="right")
    return (ends - np.searchsorted(onsets.times, times - 0.5, side="left")).astype(np.float64)


def in_unseen_register(notes: Notes, offset: float, times: FloatArray, *, low: float, high: float) -> BoolArray:
    """(T,) mask of the times within half a second of the onset of a note below `low` or above `high`."""
    outside = (notes.pitches < low) | (notes.pitches > high)
    return near_any(times, notes.onsets[outside] - offset, REACH)


def occluded(tracked: Motion) -> BoolArray:
    """(T,) mask of frames within 0.1 s of a rejected one, or in which the boxes around both hands overlap."""
    reach_frames = round(NEAR * tracked.fps)
    result: BoolArray = binary_dilation(~tracked.valid, np.ones(2 * reach_frames + 1, bool))
    names = tracked.skeleton.joints
    hands = [[names.index(joint) for joint in hand_joints(side) if joint in names] for side in SIDES]
    if all(hands):
        points = [tracked.positions[:, hand] for hand in hands]
        low, high = (np.stack([edge(own, axis=1) for own in points]) for edge in (np.min, np.max))
        result |= (low.max(axis=0) < high.min(axis=0)).all(axis=1)
    return result


def near_any(times: FloatArray, moments: FloatArray, reach: float) -> BoolArray:
    """(T,) mask of the times within `reach` seconds of one of the moments, which are in order."""
    first = np.searchsorted(moments, times - reach, side="left")
    return np.asarray(first < np.searchsorted(moments, times + reach, side="right"))


def frame_causes(piece: PredictedPiece, limits: Mapping[int, HandLimits]) -> dict[str, BoolArray]:
    """Cause -> (T,) mask of the frames of a piece that it holds for; several may hold for one frame."""
    times = piece.times
    masks = {cause: np.zeros(times.size, bool) for cause in CAUSES}
    masks[OCCLUDED] = occluded(piece.tracked)
    for hand, notes in _by_hand(piece.performance):
        if hand in limits:
            usual, offset = limits[hand], piece.performance.offset
            onsets = hand_onsets_of(notes, offset)
            masks[LEAP] |= leaps(onsets, times, leap=usual.leap)
            masks[FAST] |= onset_rate(onsets, times) > usual.rate
            masks[REGISTER] |= in_unseen_register(notes, offset, times, low=usual.low, high=usual.high)
    return masks


def causes_of(picked: PickedFrame, limits: Mapping[int, HandLimits]) -> str:
    """The causes that hold for a frame, or "none of these"."""
    masks = frame_causes(picked.piece, limits)
    return ", ".join(cause for cause in CAUSES if masks[cause][picked.frame]) or NONE


def failure_words(frames: Sequence[PickedFrame], limits: Mapping[int, HandLimits]) -> list[str]:
    """For each frame its error and causes, and in a second line the hand with most of the squared error."""
    lines = []
    for picked in frames:
        hand, share = max(picked.hand_shares.items(), key=lambda item: item[1])
        error = f"{picked.error:.0f} {picked.piece.unit}"
        lines.append(f"{error}: {causes_of(picked, limits)}\n{hand} hand: {share:.0%} of its square")
    return lines


def cause_table(pieces: Sequence[PredictedPiece], limits: Mapping[int, HandLimits]) -> pd.DataFrame:
    """Share of frames that each cause holds for; one that the worst frames have no more often explains nothing.

    Returns
    -------
    DataFrame with the columns cause, "all frames", "worst frames" (shares of the accepted frames, and of the hundredth
    of them with the largest errors), "error with", "error without" (means; NaN where no frame has it)
    """
    errors = np.concatenate([piece.errors[piece.tracked.valid] for piece in pieces])
    masks = [frame_causes(piece, limits) for piece in pieces]
    joined = {
        cause: np.concatenate([own[cause][piece.tracked.valid] for own, piece in zip(masks, pieces, strict=True)])
        for cause in CAUSES
    }
    joined[NONE] = ~np.any(list(joined.values()), axis=0)
    worst = np.argsort(-errors, kind="stable")[: max(1, round(WORST_SHARE * errors.size))]
    rows = [
        {"cause": cause, "all frames": mask.mean(), "worst frames": mask[worst].mean(),
         "error with": _mean(errors[mask]), "error without": _mean(errors[~mask])}
        for cause, mask in joined.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if values.size else float("nan")


def _by_hand(performance: Performance) -> Iterable[tuple[int, Notes]]:
    """The notes of each hand that plays; none where they are not known."""
    notes = performance.notes
    if notes is None:
        return []
    return [(hand, notes.select(notes.hands == hand)) for hand in np.unique(notes.hands).tolist()]
