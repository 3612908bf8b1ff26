"""Points of a performance cleaned: frames rejected by rule and filled in, camera shots, one place, size, direction.

Frames whose points cannot be trusted are rejected by rule and filled in by lines (readings 8 and 9). In training their
loss is masked, or lines stand in for them, or they are cut out (reading 9). Between two camera shots the trunk and most
points jump at once and stay (reading 10). Recordings are brought to one place, size and direction by one similarity for
each camera shot (Eq. 1, reading 10).
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from harmolab.files import named_faults
from harmolab.musician.performances import Performance
from harmolab.musician.similarities import Similarity, fit_similarity, similarity_factors
from harmolab.readers.player_points import HANDS_12, SIDES
from harmolab.types import BoolArray, FloatArray, IntArray, Motion, bridged

# Rejected frames in training: masked, bridged by lines, or cut out (reading 9)

Gaps = Literal["mask", "interpolate", "splice"]


def training_frames(accepted: BoolArray, gaps: Gaps) -> tuple[IntArray, BoolArray]:
    """Frames (N,) of a recording that a network is trained on, and the mask (N,) of those whose error counts.

    "mask" keeps the time line and lets the error of frames that are not `accepted` (T,) not count; "interpolate" counts
    the lines that fill them ("interpolated missing data" of Table 2); "splice" cuts them out, sound and points alike,
    so that the network goes over every gap as if no time had passed.
    """
    frames = np.flatnonzero(accepted) if gaps == "splice" else np.arange(len(accepted))
    return frames, accepted if gaps == "mask" else np.ones(len(frames), bool)


def usable_steps(usable: BoolArray, upsample: int) -> BoolArray:
    """(upsample (T - 1) + 1,) mask of the steps between frames whose interpolation needs no frame that is not usable.

    Parameters
    ----------
    usable : (T,) mask of frames
    upsample : int, steps a frame: step `upsample` t is frame t

    Examples
    --------
    >>> usable_steps(np.array([True, True, False]), 2)
    array([ True,  True,  True, False, False])
    """
    if upsample < 1:
        raise ValueError(f"upsample must be 1 or more steps a frame, got {upsample}")
    steps = np.arange(upsample * (len(usable) - 1) + 1)
    return np.asarray(usable[steps // upsample] & usable[-(-steps // upsample)])


# Camera shots (reading 10)

_PARTS = ("shoulder", "hip", "wrist", "hand")
SHOULDERS, HIPS, WRISTS, HANDS = (tuple(f"{side}_{part}" for side in SIDES) for part in _PARTS)
RESTS = 0.25  # of the way from one place to the other: who sways is half way between two places when passing on


def shot_starts(motion: Motion, kept: BoolArray, *, share: float, longest_frames: int) -> IntArray:
    """First frame of every camera shot; [0] where there is no cut, or a shoulder is not among the points.

    At a cut the trunk (shoulders and hips) and half of all points jump, and the trunk stays: up to the cut it lies by
    its median over the frames before, from the cut on by its median over those after. Hands alone tell no cut, since
    both may leap.

    Parameters
    ----------
    motion : Motion, (T, P, 2)
    kept : (T,) mask of the frames without an error, as far as that can be told before the cuts are known
    share : float, of the median width of the box around the points: the least jump
    longest_frames : int
        Longest run of errors, which is no shot. Medians are taken over twice as many frames.
    """
    frames, joints = np.flatnonzero(kept), motion.skeleton.joints
    if not set(SHOULDERS) <= set(joints) or len(frames) < 2 * longest_frames + 2:
        return np.zeros(1, np.int64)
    trunk = motion.positions[:, [joints.index(name) for name in (*SHOULDERS, *HIPS) if name in joints]]
    x = motion.positions[..., 0]
    least = share * float(np.median(x.max(axis=1) - x.min(axis=1)))
    starts = [0]
    for number in map(int, np.flatnonzero(_distance(trunk[frames[1:]], trunk[frames[:-1]]) > least) + 1):
        before, after = frames[max(0, number - 2 * longest_frames - 1) : number], frames[number:]
        after = after[: 2 * longest_frames + 1]
        is_long = min(len(before), len(after)) > longest_frames and after[0] - starts[-1] > longest_frames
        is_gap = after[0] - before[-1] > 2 * longest_frames
        if not is_long or is_gap or _distance(motion.positions[after[0]], motion.positions[before[-1]]) <= least:
            continue
        old, new = np.median(trunk[before], axis=0), np.median(trunk[after], axis=0)
        apart = float(_distance(new, old))
        if apart > least and max(_distance(trunk[before[-1]], old), _distance(trunk[after[0]], new)) < RESTS * apart:
            # The frames behind a large jump were not kept: the first one in the new place is the cut.
            between = np.arange(before[-1] + 1, after[0] + 1)
            starts.append(int(between[(_distance(trunk[between], new) < RESTS * apart).argmax()]))
    return np.array(starts)


def shot_spans(starts: IntArray, n_frames: int) -> list[slice]:
    """Frames of each camera shot of a recording of `n_frames`."""
    return list(itertools.starmap(slice, itertools.pairwise([*map(int, starts), n_frames])))


def _distance(points: FloatArray, others: FloatArray) -> FloatArray:
    """Median over points of the distance of two arrays (..., P, 2)."""
    away = points - others
    return np.median(np.hypot(away[..., 0], away[..., 1]), axis=-1)


# Frames rejected by rule (reading 8) and filled in (reading 9)

# (frame number, box: left, top, right, bottom) -> True where the person in that box is the player.
Signature = Callable[[int, FloatArray], bool]
RULES = ("missing", "signature", "swapped", "centre", "jump")  # in this order: a frame counts for the first it breaks
LONG_FOREARM = 1.3  # of its median length in the picture: no arm reaches so far


@dataclass(frozen=True)
class CleaningRules:
    """Limits beyond which a frame is rejected; None switches a rule off. Shares are of the width of the points' box.

    Parameters
    ----------
    missing : bool
        Reject a frame that lacks a point, or that its reader marked as not valid.
    swapped : float or None
        Reject where both hands lie nearer to the other side's wrists (without these: elbows) by more than this share.
    jump : float or None
        Largest mean movement of the points since the last accepted frame, at any frame rate (the paper: 10 %).
    centre : float or None
        Largest movement of the centre of the box since the last accepted frame.
    longest_run : float, seconds
        After so long without an accepted frame the next complete one is accepted anew: 12 frames at 24 fps.
    cut : float or None
        Least jump of the trunk at a cut between camera shots; each shot is cleaned and placed by itself.
    """

    missing: bool = True
    swapped: float | None = 0.05
    jump: float | None = 0.10
    centre: float | None = 0.35
    longest_run: float = 0.5
    cut: float | None = 0.03

    @classmethod
    def off(cls) -> "CleaningRules":
        """No frame is rejected: the row "frames not dropped" of Tables 1 and 2."""
        return cls(missing=False, swapped=None, jump=None, centre=None)


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A performance and the frames of it that are accepted.

    Parameters
    ----------
    performance : Performance, as it came
    motion : Motion
        Its points, with lines over the rejected frames from the accepted ones around them; valid where accepted.
    broken : (T,) array of str, the rule that each frame breaks, one of `RULES`; "" where it is accepted
    starts : (N,) array of int, first frame of each camera shot
    """

    performance: Performance
    motion: Motion
    broken: NDArray[np.str_]
    starts: IntArray

    @property
    def shots(self) -> list[slice]:
        """Frames of each camera shot."""
        return shot_spans(self.starts, self.motion.n_frames)

    @property
    def accepted(self) -> BoolArray:
        """(T,) mask of the frames that break no rule."""
        return self.motion.valid

    def report(self) -> dict[str, float]:
        """Share of all frames that each rule rejects; each frame counts once, so that they sum to what is rejected."""
        return {rule: float(np.mean(self.broken == rule)) for rule in RULES}


def cleaned(
    performance: Performance, rules: CleaningRules | None = None, *, signature: Signature | None = None
) -> Cleaned:
    """The performance with its bad frames rejected (reading 8) and filled in (reading 9); the time line stays.

    A frame is held against the last accepted frame of its shot: against the raw frame before it, the inside of a run
    of errors would pass.

    Parameters
    ----------
    performance : Performance
    rules : CleaningRules, the readings' when left out
    signature : callable (frame number, box) -> bool, optional
        False where another person is in the box (left, top, right, bottom); off by default: no face is looked at.

    Raises
    ------
    ValueError
        Names the performance, if no frame is left.
    """
    rules = CleaningRules() if rules is None else rules
    motion = performance.motion
    complete = performance.detected.all(axis=1) & motion.valid
    run_frames = max(1, round(rules.longest_run * motion.fps))
    poses = _Poses.of(motion.positions)
    broken = _broken_alone(motion, poses, complete, rules, signature)
    if not (broken == "").any():
        raise ValueError(f"{performance.name}: no frame is left; {_reason(performance, broken)}")
    steps = np.append("", _breaches(poses[1:], poses[:-1], rules))
    moved = partial(_moved, poses, broken, steps, rules, run_frames)
    starts, whole = np.zeros(1, np.int64), moved(slice(0, motion.n_frames))
    if rules.cut is not None:
        starts = shot_starts(motion, whole == "", share=rules.cut, longest_frames=run_frames)
    broken = np.concatenate([moved(span) for span in shot_spans(starts, motion.n_frames)]) if len(starts) > 1 else whole
    accepted = broken == ""
    # A shot without an accepted frame belongs to the one before it, or after it at the start.
    starts = np.append(0, starts[np.logical_or.reduceat(accepted, starts)][1:])
    shots = [bridged(motion.positions[span], accepted[span]) for span in shot_spans(starts, motion.n_frames)]
    filled = Motion(np.concatenate(shots), motion.fps, motion.skeleton, accepted)
    return Cleaned(performance, filled, broken, starts)


def rejected_examples(result: Cleaned) -> dict[str, int]:
    """For each rule that rejects a frame the frame with the largest mean movement since the last accepted one (Fig. 3).

    Frames before the first accepted one are held against that.
    """
    frames, points = np.flatnonzero(~result.accepted), result.performance.motion.positions
    kept = np.flatnonzero(result.accepted)
    before = kept[np.maximum(np.searchsorted(kept, frames) - 1, 0)]
    movement = np.linalg.norm(points[frames] - points[before], axis=2).mean(axis=1)
    rules = result.broken[frames]
    return {rule: int(frames[own][movement[own].argmax()]) for rule in RULES if (own := rules == rule).any()}


@dataclass(frozen=True, eq=False)
class _Poses:
    """Points (T, P, 2) and the boxes around them, (T, 4): left, top, right, bottom."""

    points: FloatArray
    box: FloatArray

    @classmethod
    def of(cls, points: FloatArray) -> "_Poses":
        x, y = points[..., 0], points[..., 1]
        return cls(points, np.stack([x.min(axis=1), y.min(axis=1), x.max(axis=1), y.max(axis=1)], axis=-1))

    def __getitem__(self, frames: int | slice | IntArray) -> "_Poses":
        return _Poses(self.points[frames], self.box[frames])

    @property
    def width(self) -> FloatArray:
        return self.box[..., 2] - self.box[..., 0]


def _broken_alone(
    motion: Motion, poses: _Poses, complete: BoolArray, rules: CleaningRules, signature: Signature | None
) -> NDArray[np.str_]:
    """(T,) rule that each frame breaks by itself, whatever the other frames are; "" where none."""
    broken = np.full(motion.n_frames, "", dtype=f"<U{max(map(len, RULES))}")
    if rules.swapped is not None:
        broken[_swapped_hands(motion, rules.swapped * poses.width)] = "swapped"
    if signature is not None:
        for frame in np.flatnonzero(complete):
            if not signature(int(frame), poses.box[frame]):
                broken[frame] = "signature"
    if rules.missing:
        broken[~complete] = "missing"
    return broken


def _swapped_hands(motion: Motion, margin: FloatArray) -> BoolArray:
    """(T,) mask of frames whose hands lie nearer to the other side's wrists by `margin` (T,), units of the points.

    The hands' own roots against the wrists of the body; wrists against elbows only where a forearm is also longer than
    it can be, since arms may cross.
    """
    x = {name: motion.positions[:, number] for number, name in enumerate(motion.skeleton.joints)}
    swapped = np.zeros(motion.n_frames, bool)
    for tip, root in (("hand", "wrist"), ("wrist", "elbow"), ("hand", "elbow")):
        names = [f"{side}_{part}" for part in (tip, root) for side in SIDES]
        if not x.keys() >= set(names):
            continue
        left, right, left_root, right_root = (x[name] for name in names)
        own = np.stack([_length(left - left_root), _length(right - right_root)])
        crossed = _length(left - right_root) + _length(right - left_root)
        is_crossed = own.sum(axis=0) > crossed + margin
        if root == "elbow":
            is_crossed &= (own > LONG_FOREARM * np.median(own, axis=1, keepdims=True)).any(axis=0)
        swapped |= is_crossed
    return swapped


def _length(vectors: FloatArray) -> FloatArray:
    """Lengths (...) of vectors (..., 2)."""
    return np.asarray(np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2))  # three times as fast as hypot


def _breaches(poses: _Poses, before: _Poses, rules: CleaningRules) -> NDArray[np.str_]:
    """(T,) rule that each pose breaks against the one `before` it; "" where none."""
    broken = np.full(len(poses.points), "", dtype=f"<U{max(map(len, RULES))}")
    if rules.jump is not None:
        broken[_length(poses.points - before.points).mean(axis=-1) > rules.jump * before.width] = "jump"
    if rules.centre is not None:
        moved = (poses.box[..., :2] + poses.box[..., 2:] - before.box[..., :2] - before.box[..., 2:]) / 2
        broken[np.hypot(moved[..., 0], moved[..., 1]) > rules.centre * before.width] = "centre"
    return broken


def _moved(
    poses: _Poses, broken: NDArray[np.str_], steps: NDArray[np.str_], rules: CleaningRules, run_frames: int, span: slice
) -> NDArray[np.str_]:
    """`broken` of the frames of one shot, with those that moved too far from the last accepted one.

    `steps` (T,) are the breaches of each frame against the frame before it. No other test is needed while that one is
    accepted: only behind a rejected frame the last accepted one has to be looked for.
    """
    poses, broken, steps = poses[span], broken[span].copy(), steps[span]
    eligible = np.flatnonzero(broken == "")
    if not eligible.size:
        return broken
    skipped = _first_player(poses[eligible[: run_frames + 1]], rules)
    stops = np.flatnonzero((broken != "") | (steps != ""))
    broken[eligible[:skipped]] = "centre"
    reference = eligible[skipped]
    while (place := np.searchsorted(stops, reference, side="right")) < len(stops):
        window = np.arange(stops[place], min(stops[place] + run_frames, len(broken)))
        window = window[broken[window] == ""]
        breaches = _breaches(poses[window], poses[int(stops[place]) - 1], rules)
        passed = np.flatnonzero(breaches == "")
        n_rejected = passed[0] if passed.size else len(window)
        broken[window[:n_rejected]] = breaches[:n_rejected]
        later = eligible[np.searchsorted(eligible, stops[place] + run_frames) :]
        if not passed.size and not later.size:
            break
        reference = window[n_rejected] if passed.size else later[0]
    return broken


def _first_player(poses: _Poses, rules: CleaningRules) -> int:
    """Number of the first of some poses whose box is about where the median of the boxes is: no passer-by."""
    median = _Poses(np.median(poses.points, axis=0), np.median(poses.box, axis=0))
    near = _breaches(poses, median, replace(rules, jump=None)) == ""
    return int(near.argmax())


def _reason(performance: Performance, broken: NDArray[np.str_]) -> str:
    """The reason that no frame of a performance is left, and the point that is missing most often."""
    lost = 1 - performance.detected.mean(axis=0)
    name, share = performance.motion.skeleton.joints[lost.argmax()], lost.max()
    text = ", ".join(f"{rule} rejects {np.mean(broken == rule):.0%}" for rule in RULES if (broken == rule).any())
    return f"{text} ({name} is not detected in {share:.0%} of them: leave such points out)" if share else text


# Recordings brought to one place, size and direction (Eq. 1, reading 10)

Alignment = Literal["recording", "frame", "none"]


@dataclass(frozen=True, eq=False)
class Reference:
    """The configuration that recordings are aligned to.

    Parameters
    ----------
    joints : names of its points; none for hands on one keyboard in millimetres, which need no alignment
    points : (K, 2) array, in the units that everything is in once it is placed
    """

    joints: tuple[str, ...]
    points: FloatArray

    @property
    def shoulder_width(self) -> float:
        """Distance of the shoulders, of which errors are given in per cent; NaN where there are no shoulders."""
        if not set(SHOULDERS) <= set(self.joints):
            return float("nan")
        left, right = (self.points[self.joints.index(name)] for name in SHOULDERS)
        return float(np.hypot(*(right - left)))


def reference_configuration(first: Cleaned) -> Reference:
    """The medians over time of the anchors of the first training recording, in its longest camera shot.

    Anchors are both shoulders, and both hips if they are there. Without shoulders they are the wrists of both hands,
    whose medians also depend on what is played. Wrists and fingertips alone (`HANDS_12`) come in the millimetres of
    one keyboard and have no anchors.
    """
    joints = _anchors(first.motion.skeleton.joints)
    longest = max(first.shots, key=lambda span: span.stop - span.start)
    return Reference(joints, _median_points(first, joints, longest))


def shot_similarities(result: Cleaned, reference: Reference) -> tuple[Similarity, ...]:
    """The similarity from each camera shot to the reference, fitted to the medians of the anchors both have.

    ValueError names the performance if it lacks the anchors, or they lie in one place.
    """
    joints = _shared_anchors(result, reference)
    if not joints:
        return tuple(Similarity(1.0, 0.0, np.zeros(2)) for _ in result.starts)
    target = _reference_points(reference, joints)
    with named_faults(result.performance.name):
        return tuple(fit_similarity(_median_points(result, joints, span), target) for span in result.shots)


def placed(result: Cleaned, reference: Reference, *, alignment: Alignment = "recording") -> Motion:
    """The points of a cleaned performance in the place, size and direction of the reference.

    Parameters
    ----------
    result : Cleaned
    reference : Reference
    alignment : "recording", "frame" or "none"
        One similarity for each camera shot of the recording; one for each frame, which writes the sway of the body and
        the noise of its few anchors into hands that the keyboard holds in place; or the points as they are.

    Raises
    ------
    ValueError
        As `shot_similarities`.
    """
    if alignment not in get_args(Alignment):
        raise ValueError(f"alignment must be recording, frame or none, got {alignment!r}")
    joints = () if alignment == "none" else _shared_anchors(result, reference)
    if not joints:
        return result.motion
    if alignment == "frame":
        return replace(result.motion, positions=_aligned_frames(result, reference, joints))
    similarities, positions = shot_similarities(result, reference), result.motion.positions
    parts = [fit.apply(positions[span]) for fit, span in zip(similarities, result.shots, strict=True)]
    return replace(result.motion, positions=np.concatenate(parts))


def _aligned_frames(result: Cleaned, reference: Reference, joints: Sequence[str]) -> FloatArray:
    """Points (T, P, 2), each frame aligned by its own anchors."""
    positions, target = result.motion.positions, _reference_points(reference, joints)
    anchors = positions[:, _numbers(result, joints)]
    with named_faults(result.performance.name):
        factor, shift = similarity_factors(anchors, np.broadcast_to(target, anchors.shape))
    z = factor[:, None] * (positions[..., 0] + 1j * positions[..., 1]) + shift[:, None]
    return np.stack([z.real, z.imag], axis=-1)


def _anchors(joints: Sequence[str]) -> tuple[str, ...]:
    """Names of the points of a recording that it is aligned by."""
    if set(SHOULDERS) <= set(joints):
        return (*SHOULDERS, *HIPS) if set(HIPS) <= set(joints) else SHOULDERS
    if set(joints) <= set(HANDS_12.joints):
        return ()
    return next((names for names in (HANDS, WRISTS) if set(names) <= set(joints)), ())


def _shared_anchors(result: Cleaned, reference: Reference) -> tuple[str, ...]:
    """Names of the anchors that a performance and the reference have; ValueError if one has some and both none."""
    own = _anchors(result.motion.skeleton.joints)
    names = tuple(name for name in own if name in reference.joints)
    if not names and (own or reference.joints):
        raise ValueError(
            f"{result.performance.name}: has {', '.join(own) or 'nothing'} to be aligned by, the reference "
            f'{", ".join(reference.joints) or "nothing"}; take recordings with the same points, or alignment "none"'
        )
    return names


def _numbers(result: Cleaned, joints: Sequence[str]) -> list[int]:
    return [result.motion.skeleton.joints.index(name) for name in joints]


def _reference_points(reference: Reference, joints: Sequence[str]) -> FloatArray:
    return reference.points[[reference.joints.index(name) for name in joints]]


def _median_points(result: Cleaned, joints: Sequence[str], span: slice) -> FloatArray:
    """Medians (K, 2) over the accepted frames of a camera shot."""
    anchors = result.motion.positions[span][:, _numbers(result, joints)]
    return np.median(anchors[result.accepted[span]], axis=0)
