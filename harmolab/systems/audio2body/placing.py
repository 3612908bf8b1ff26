"""Recordings brought to one place, size and direction (Eq. 1, reading 10): one similarity for each camera shot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from harmolab.io.player_points import HANDS_12, SIDES
from harmolab.kinematics import Similarity, fit_similarity, similarity_factors
from harmolab.systems.audio2body.cleaning import Cleaned
from harmolab.types import FloatArray, Motion

Alignment = Literal["recording", "frame", "none"]
SHOULDERS, HIPS, WRISTS, HANDS = (
    tuple(f"{side}_{part}" for side in SIDES) for part in ("shoulder", "hip", "wrist", "hand")
)


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
    try:
        return tuple(fit_similarity(_median_points(result, joints, span), target) for span in result.shots)
    except ValueError as error:
        raise ValueError(f"{result.performance.name}: {error}") from None


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
    try:
        factor, shift = similarity_factors(anchors, np.broadcast_to(target, anchors.shape))
    except ValueError as error:
        raise ValueError(f"{result.performance.name}: {error}") from None
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
