"""Step 5: a pianist's wrists lie along the keyboard, which is turned; keyboard and stool."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import KEY_LINES, KEYBOARD, SIDES, STOOL
from harmolab.skeletons import turned
from harmolab.types import FloatArray

WIDTH, DEPTH = 1.22, 0.15  # metres, of 88 keys
OCTAVE, LOWEST_C = 0.1645, 0.047  # metres, and of the lowest C from the left end
F_IN_OCTAVE = 3 / 7
TIPS_AHEAD = 0.06  # metres from the front edge of the keys to where fingers strike
REST_TIPS = np.array([0.0, -0.05, 0.13])  # metres from the wrist to fingertips that no points show
LEAST_ABOVE_HIPS = 0.17  # metres of a pianist's wrists: thighs go under the keys
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


def above_thighs(targets: dict[str, FloatArray], pelvis: FloatArray) -> dict[str, FloatArray]:
    """Wrists, side -> (T, 3), all raised alike where they lie on average less than `LEAST_ABOVE_HIPS` over the hips.

    A camera that looks down on a pianist shows the hands, which are nearer, too low.
    """
    if not targets:
        return {}
    height = float(np.median(np.concatenate([wrist[:, 1] for wrist in targets.values()])) - pelvis[:, 1].mean())
    rise = np.array([0.0, max(LEAST_ABOVE_HIPS - height, 0.0), 0.0])
    return {side: wrist + rise for side, wrist in targets.items()}


def keyboard(joints: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """The corners of a keyboard that rests under the fingertips, before the player, name -> (T, 3).

    From the player, front is near, and low keys are at the left. ValueError without arms.
    """
    tips = [name for side in SIDES for name in joints if name.startswith(f"{side}_") and name.endswith("_4")]
    wrists = [joints[f"{side}_wrist"] for side in SIDES if f"{side}_wrist" in joints]
    if not wrists:
        raise ValueError("a keyboard lies under hands; there are none")
    places = np.concatenate([joints[name] for name in tips] or [wrist + turned(REST_TIPS, turn) for wrist in wrists])
    pelvis = joints["pelvis"].mean(axis=0)
    own = turned(places - pelvis, -turn)
    corner = np.array([0.0, np.percentile(own[:, 1], 10), np.median(own[:, 2]) - TIPS_AHEAD])
    numbers = np.arange(KEY_LINES)
    x = WIDTH / 2 - LOWEST_C - OCTAVE * (numbers // 2 + F_IN_OCTAVE * (numbers % 2))
    lines = [[place, 0.0, depth] for place in x for depth in (0.0, DEPTH)]
    table = _table(WIDTH, DEPTH, float(corner[1] + pelvis[1])) + corner
    return _at_rest(KEYBOARD, np.concatenate([table, lines + corner]), joints["pelvis"], turn)


def stool(pelvis: FloatArray, seat: float, turn: float) -> dict[str, FloatArray]:
    """The corners and feet of a stool of height `seat` on the floor y = 0, name -> (T, 3)."""
    corner = np.array([0.0, seat - pelvis[:, 1].mean(), -STOOL_DEPTH / 2])
    return _at_rest(STOOL, _table(STOOL_WIDTH, STOOL_DEPTH, seat) + corner, pelvis, turn)


def _table(width: float, depth: float, height: float) -> FloatArray:
    """(9, 3): a level rectangle from the origin on, `OUTLINE`: corners, the first once more, and feet on the floor."""
    left, right = width / 2, -width / 2  # the avatar faces +z: its left is +x
    corners = np.array([[left, 0, 0], [right, 0, 0], [right, 0, depth], [left, 0, depth]])
    return np.concatenate([corners, corners[:1], corners - [0.0, height, 0.0]])


def _at_rest(names: tuple[str, ...], places: FloatArray, pelvis: FloatArray, turn: float) -> dict[str, FloatArray]:
    """Places (N, 3) in the player's own frame, from the mean pelvis, as joints that do not move."""
    world = turned(places, turn) + pelvis.mean(axis=0)
    return {name: np.broadcast_to(place, pelvis.shape) for name, place in zip(names, world, strict=True)}
