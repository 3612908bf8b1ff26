"""The points of a musician: eight of the body and twenty-one of each hand, as OpenPose and MediaPipe number them.

And the names of the things that an avatar plays on, which are drawn thin, as fingers are.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from harmolab.body.skeletons import Skeleton
from harmolab.types import FloatArray, Motion

SIDES = ("left", "right")
INSTRUMENTS = ("piano", "violin")
FINGERS = ("thumb", "index", "middle", "ring", "little")
PHALANGES = 4  # points of a finger from its root (1) to its tip
BODY = tuple(f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hip") for side in SIDES)


def hand_joints(side: str) -> tuple[str, ...]:
    """Names of the 21 points of a hand: its wrist, then each finger from its root to its tip.

    >>> hand_joints("left")[:5]
    ('left_hand', 'left_thumb_1', 'left_thumb_2', 'left_thumb_3', 'left_thumb_4')
    """
    fingers = (f"{side}_{finger}_{place}" for finger in FINGERS for place in range(1, PHALANGES + 1))
    return (f"{side}_hand", *fingers)


def player_skeleton(joints: Sequence[str]) -> Skeleton:
    """The skeleton of some points of a musician, each joined to the next one there is towards the trunk."""
    at = {name: number for number, name in enumerate(joints)}
    parents = []
    for name in joints:
        parent = _PARENTS.get(name, "")
        while parent and parent not in at:
            parent = _PARENTS.get(parent, "")
        parents.append(at.get(parent, -1))
    return Skeleton(tuple(joints), tuple(parents))


def _parents() -> dict[str, str]:
    parents = {"left_shoulder": "", "right_shoulder": "left_shoulder"}
    for side in SIDES:
        parents |= {f"{side}_elbow": f"{side}_shoulder", f"{side}_wrist": f"{side}_elbow"}
        parents |= {f"{side}_hip": f"{side}_shoulder", f"{side}_hand": f"{side}_wrist"}
        for finger in FINGERS:
            chain = [f"{side}_hand", *(f"{side}_{finger}_{place}" for place in range(1, PHALANGES + 1))]
            parents |= dict(zip(chain[1:], chain[:-1], strict=True))
    return parents


_PARENTS = _parents()
PLAYER_50 = player_skeleton((*BODY, *hand_joints("left"), *hand_joints("right")))
# Wrist and fingertips of both hands: what sets of pianists' hands record.
HANDS_12 = player_skeleton([f"{side}_{part}" for side in SIDES for part in ("hand", *(f"{f}_4" for f in FINGERS))])


def fingertips(skeleton: Skeleton, side: str) -> list[int]:
    """Numbers of the fingertips of one hand, thumb first; those that a skeleton lacks are left out."""
    names = [f"{side}_{finger}_{PHALANGES}" for finger in FINGERS]
    return [skeleton.joints.index(name) for name in names if name in skeleton.joints]


def wrist_names(side: str) -> tuple[str, ...]:
    """Names of a wrist: as the hand has it, then as the body has it."""
    return f"{side}_hand", f"{side}_wrist"


def hand_root(skeleton: Skeleton, side: str) -> int | None:
    """Number of a hand's wrist, by the first of its names that the skeleton has; None without either."""
    return next((skeleton.joints.index(name) for name in wrist_names(side) if name in skeleton.joints), None)


VIOLIN = ("violin_chin", "violin_bridge", "violin_neck", "violin_scroll")
BOW = ("bow_frog", "bow_tip")
CORNERS = ("front_low", "front_high", "back_high", "back_low")
KEY_LINES = 15  # across the keyboard, before each C and F
# Outlines come back to their first corner, which has a second name for it; each corner has a foot.
OUTLINE = (*CORNERS, "end", *(f"{corner}_foot" for corner in CORNERS))
KEYBOARD = (
    *(f"keyboard_{corner}" for corner in OUTLINE),
    *(f"keyboard_{line}_{edge}" for line in range(1, KEY_LINES + 1) for edge in ("front", "back")),
)
STOOL = tuple(f"stool_{corner}" for corner in OUTLINE)
PROPS = frozenset((*VIOLIN, *BOW, *KEYBOARD, *STOOL))
FINGER_JOINTS = frozenset(name for side in SIDES for name in hand_joints(side)[1:])
# Thickness in that of a limb.
THIN, SOUND_BOX, CASE = 0.22, 2.4, 0.6


def joint_widths(skeleton: Skeleton) -> list[float]:
    """Thickness at each joint: 1, or `THIN` for the joints of fingers and props, by their names."""
    return [THIN if name in FINGER_JOINTS or name in PROPS else 1.0 for name in skeleton.joints]


def limb_widths(skeleton: Skeleton, limbs: Sequence[tuple[int, int]]) -> list[float]:
    """Thickness of drawn limbs (pairs of joints): 1 for those of a body, `THIN` for fingers and props by their names.

    Of the violin only the neck is thin; a keyboard has a case behind it.

    >>> hand = player_skeleton(["left_elbow", "left_wrist", "left_index_1"])
    >>> limb_widths(hand, hand.bones)
    [1.0, 0.22]
    """
    thick = dict.fromkeys(itertools.pairwise(VIOLIN[:-1]), SOUND_BOX)
    thick["keyboard_back_high", "keyboard_back_low"] = CASE
    widths, names = joint_widths(skeleton), skeleton.joints
    return [thick.get((names[start], names[end]), min(widths[start], widths[end])) for start, end in limbs]


def prop_joints(skeleton: Skeleton) -> list[int]:
    """Numbers of the joints of props, which throw no shadow."""
    return [number for number, name in enumerate(skeleton.joints) if name in PROPS]


def playing_box(motion: Motion) -> FloatArray | None:
    """(2, 3) metres: low and high corner of the box in which a player and the props stay, but for rare moments.

    None for a motion without props: dancers travel, and a camera follows them.
    """
    if motion.positions.shape[2] != 3 or not prop_joints(motion.skeleton):
        return None
    low, high = np.percentile(motion.positions, (1, 99), axis=0)
    return np.stack([low.min(axis=0), high.max(axis=0)])
