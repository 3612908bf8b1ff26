"""Step 5: a pianist's wrists lie along the keyboard, which is turned; keyboard and stool."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import CORNERS, KEYBOARD, OCTAVES, SIDES, STOOL
from harmolab.skeletons import turned
from harmolab.types import FloatArray

WIDTH, DEPTH = 1.22, 0.15  # metres, of 88 keys
OCTAVE = 0.1645  # metres
TIPS_AHEAD = 0.06  # metres from the front edge of the keys to where fingers strike
REST_TIPS = np.array([0.0, -0.05, 0.13])  # metres from the wrist to fingertips that no points show
STOOL_WIDTH, STOOL_DEPTH = 0.42, 0.32


def keyboard_depth(targets: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """Wrists on a line along the keyboard: z = z0 + tan(turn) (xc - x), side -> (T, 3).

    xc is the mean middle of the shoulders, the origin, and z0 the median over hands and frames of what depth from
    forearms gives there. Farther left in the picture is nearer to the camera.
    """
    if not targets:
        return {}
    slope = np.tan(turn)
    ahead = np.median(np.concatenate([wrist[:, 2] + slope * wrist[:, 0] for wrist in targets.values()]))
    return {side: np.column_stack([wrist[:, :2], ahead - slope * wrist[:, 0]]) for side, wrist in targets.items()}


def keyboard(joints: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """The corners of a keyboard that rests under the fingertips, before the player, name -> (T, 3); empty without arms.

    From the player, front is near, and low keys are at the left.
    """
    tips = [name for side in SIDES for name in joints if name.startswith(f"{side}_") and name.endswith("_4")]
    wrists = [joints[f"{side}_wrist"] for side in SIDES if f"{side}_wrist" in joints]
    places = np.concatenate([joints[name] for name in tips] or [wrist + turned(REST_TIPS, turn) for wrist in wrists])
    own = turned(places - joints["pelvis"].mean(axis=0), -turn)
    height, front = np.percentile(own[:, 1], 10), np.median(own[:, 2]) - TIPS_AHEAD
    outline = _rectangle(WIDTH, DEPTH) + np.array([0.0, height, front])
    octaves = (WIDTH / 2 - 0.05) - OCTAVE * np.arange(OCTAVES)
    lines = [[x, height, front + depth] for x in octaves for depth in (0.0, DEPTH)]
    return _at_rest(KEYBOARD, np.concatenate([outline, lines]), joints["pelvis"], turn)


def stool(pelvis: FloatArray, seat: float, turn: float) -> dict[str, FloatArray]:
    """The corners and feet of a stool of height `seat` on the floor y = 0, name -> (T, 3)."""
    top = _rectangle(STOOL_WIDTH, STOOL_DEPTH) - np.array([0.0, 0.0, STOOL_DEPTH / 2])
    middle = float(pelvis[:, 1].mean())
    return _at_rest(
        STOOL,
        np.concatenate([top + [0.0, seat - middle, 0.0], top[: len(CORNERS)] - [0.0, middle, 0.0]]),
        pelvis,
        turn,
    )


def _rectangle(width: float, depth: float) -> FloatArray:
    """(5, 3): the corners of a level rectangle from z = 0 on in the order of `CORNERS`, and the first once more."""
    left, right = width / 2, -width / 2  # the avatar faces +z: its left is +x
    corners = [[left, 0, 0], [right, 0, 0], [right, 0, depth], [left, 0, depth], [left, 0, 0]]
    return np.array(corners, dtype=np.float64)


def _at_rest(names: tuple[str, ...], places: FloatArray, pelvis: FloatArray, turn: float) -> dict[str, FloatArray]:
    """Places (N, 3) in the player's own frame, from the mean pelvis, as joints that do not move."""
    world = turned(places, turn) + pelvis.mean(axis=0)
    return {name: np.broadcast_to(place, pelvis.shape) for name, place in zip(names, world, strict=True)}
