"""Step 7: all parts as one motion, whose skeleton has further trees for the instrument."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import (
    BOW,
    CORNERS,
    FINGERS,
    INSTRUMENTS,
    KEY_LINES,
    KEYBOARD,
    PHALANGES,
    SIDES,
    STOOL,
    VIOLIN,
)
from harmolab.systems.audio2body.avatar.arms import arm_lengths, arms, wrist_targets
from harmolab.systems.audio2body.avatar.hands import fingers, hand_axes
from harmolab.systems.audio2body.avatar.params import HIP_ABOVE_SEAT, AvatarParams
from harmolab.systems.audio2body.avatar.piano import above_thighs, keyboard, keyboard_depth, stool
from harmolab.systems.audio2body.avatar.place import PlacedPoints, placed_points
from harmolab.systems.audio2body.avatar.spine import legs, spine
from harmolab.systems.audio2body.avatar.violin import bow, violin
from harmolab.types import FloatArray, Motion, Skeleton


def avatar(points: Motion, instrument: str, *, params: AvatarParams | None = None) -> Motion:
    """An avatar that moves as the points of a musician in a picture do (Sec. 5).

    Parameters
    ----------
    points : Motion, (T, P, 2), any unit, y down, joints by the names of `player_points`
        Both shoulders are needed. Other points may be missing: an arm needs its wrist (or the hand's), a hand the roots
        of index and little finger, a finger its root and its tip; what they lack is left out.
    instrument : "piano" or "violin"
    params : AvatarParams, default our settings

    Returns
    -------
    Motion, (T, J, 3) metres, y up, floor at y = 0, facing +z (at the piano turned to +x by `piano_turn`). Its first
    tree is the body, with the fingers that there are; further trees are the stool, and keyboard or violin and bow
    (`player_points.PROPS`). No bone changes its length.

    Raises
    ------
    ValueError
        For another instrument, points in space, or points without both shoulders.
    """
    params = AvatarParams() if params is None else params
    if instrument not in INSTRUMENTS:
        raise ValueError(f"instrument must be {' or '.join(INSTRUMENTS)}, got {instrument!r}")
    if points.positions.shape[2] != 2:
        raise ValueError("an avatar is put together from the points of a picture, (T, P, 2); these are in space")
    placed = placed_points(points, turn=params.piano_turn if instrument == "piano" else 0.0)
    joints = _body(placed, instrument, params)
    height = params.seat + HIP_ABOVE_SEAT - joints["pelvis"][:, 1].mean()
    joints = {name: places + np.array([0.0, height, 0.0]) for name, places in joints.items()}
    joints |= legs(joints, placed.turn) | stool(joints["pelvis"], params.seat, placed.turn)
    if instrument == "piano" and not {"left_wrist", "right_wrist"}.isdisjoint(joints):
        joints |= keyboard(joints, placed.turn)
    skeleton = avatar_skeleton(tuple(joints))
    return Motion(np.stack(list(joints.values()), axis=1), points.fps, skeleton, points.valid)


def _body(placed: PlacedPoints, instrument: str, params: AvatarParams) -> dict[str, FloatArray]:
    """Trunk, arms, hands and violin, name -> (T, 3), shoulders around the origin."""
    trunk = spine(placed)
    lengths = arm_lengths(placed, params)
    targets = wrist_targets(placed, trunk, lengths, params)
    if instrument == "piano":
        targets = above_thighs(keyboard_depth(targets, placed.turn), trunk["pelvis"])
    joints = trunk | arms(trunk, targets, lengths, placed.turn)
    axes = {side: hand_axes(placed, side, params) for side in targets}
    for side, hand in axes.items():
        if hand is not None:
            joints |= fingers(placed, side, joints[f"{side}_wrist"], hand, params)
    if instrument == "violin":
        joints |= violin(trunk, joints)
        if "right" in targets:
            joints |= bow(joints["right_wrist"], axes["right"], joints["violin_bridge"])
    return joints


def avatar_skeleton(joints: tuple[str, ...]) -> Skeleton:
    """The skeleton of an avatar's joints, by their names; props are trees of their own."""
    return Skeleton(joints, tuple(joints.index(_PARENTS[name]) if name in _PARENTS else -1 for name in joints))


def _parents() -> dict[str, str]:
    parents = {"neck": "pelvis", "head": "neck"}
    for side in SIDES:
        chain = ["pelvis", *(f"{side}_{part}" for part in ("hip", "knee", "ankle", "toe"))]
        chains = [chain, ["neck", *(f"{side}_{part}" for part in ("shoulder", "elbow", "wrist"))]]
        chains += [[f"{side}_wrist", *(f"{side}_{f}_{k}" for k in range(1, PHALANGES + 1))] for f in FINGERS]
        for chain in chains:
            parents |= dict(zip(chain[1:], chain[:-1], strict=True))
    outlines = (KEYBOARD[: len(CORNERS) + 1], STOOL[: len(CORNERS) + 1], VIOLIN, BOW)
    for outline in outlines:
        parents |= dict(zip(outline[1:], outline[:-1], strict=True))
    parents |= {f"{table}_{c}_foot": f"{table}_{c}" for table in ("keyboard", "stool") for c in CORNERS}
    return parents | {f"keyboard_{line}_back": f"keyboard_{line}_front" for line in range(1, KEY_LINES + 1)}


_PARENTS = _parents()
