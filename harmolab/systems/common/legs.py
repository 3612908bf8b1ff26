"""Legs of two bones, hip to knee to ankle: where the knee goes when the foot is put elsewhere (inverse kinematics)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harmolab.skeletons import subtree
from harmolab.types import FloatArray, Skeleton

STRETCHED = 0.99  # of its length: a leg is not pulled further, since a knee snaps where a leg becomes straight
FORWARD = 0.05  # of the foot's direction in that of the knee, which a straight leg does not show
TINY = 1e-9  # metres


@dataclass(frozen=True)
class Leg:
    """Joints of a leg by number; `foot` is the ankle and all that hangs on it."""

    hip: int
    knee: int
    ankle: int
    foot: tuple[int, ...]


def find_leg(skeleton: Skeleton, foot: Sequence[int]) -> Leg | None:
    """The leg above the joints of one foot (`harmolab.skeletons.foot_joints`).

    None where they hang on more than one joint, where no knee and hip are above them, or where the knee carries more
    than this foot.
    """
    tops = [joint for joint in foot if skeleton.parents[joint] not in foot]
    if len(tops) != 1:
        return None
    ankle = tops[0]
    knee = skeleton.parents[ankle]
    hip = skeleton.parents[knee] if knee >= 0 else -1
    below = subtree(skeleton.parents, ankle)
    if hip < 0 or subtree(skeleton.parents, knee) != (*sorted({knee, *below}),):
        return None
    return Leg(hip, knee, ankle, below)


def moved_foot(positions: FloatArray, leg: Leg, shift: FloatArray) -> FloatArray:
    """Positions (T, J, 3) with the foot of one leg moved by `shift` (T, 3), as far as the leg reaches.

    The hip stays, thigh and shank keep their lengths, and the knee stays on the side that it was bent to.
    """
    hip, knee, ankle = (positions[:, joint] for joint in (leg.hip, leg.knee, leg.ankle))
    thigh, shank = _lengths(knee - hip), _lengths(ankle - knee)
    towards = ankle + shift - hip
    longest = np.maximum(STRETCHED * (thigh + shank), _lengths(ankle - hip))
    reach = np.clip(_lengths(towards), np.abs(thigh - shank) + TINY, longest)
    towards = towards / _lengths(towards)
    along = (thigh**2 - shank**2 + reach**2) / (2 * reach)
    aside = np.sqrt(np.maximum(thigh**2 - along**2, 0.0))
    bent = _across(knee - hip, towards) + FORWARD * _across(positions[:, leg.foot].mean(axis=1) - ankle, towards)
    changed = positions.copy()
    changed[:, leg.knee] = hip + along * towards + aside * bent / _lengths(bent)
    changed[:, leg.foot] += (hip + reach * towards - ankle)[:, None]
    return changed


def _lengths(vectors: FloatArray) -> FloatArray:
    """(T, 1) lengths of vectors (T, 3), never 0."""
    return np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


def _across(vectors: FloatArray, directions: FloatArray) -> FloatArray:
    """The part of vectors (T, 3) at a right angle to unit vectors `directions` (T, 3)."""
    return vectors - (vectors * directions).sum(axis=1, keepdims=True) * directions
