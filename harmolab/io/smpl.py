"""SMPL's body: 24 joints, rotations of them, and the places to which forward kinematics brings them.

SMPL, SMPL-H and SMPL-X share their first 22 joints; the rotations of fingers move none of the joints kept here. A body
at rest stands with arms spread (a T), faces +z and has y up; its left is +x. The body model itself is licensed and is
not part of this package: without a file of the user's own, joints lie on a skeleton of ours.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from harmolab.io.arrays import read_npz
from harmolab.io.files import PathLike, reading
from harmolab.io.layouts import MAX_FRAMES
from harmolab.rotations import Body, forward_kinematics
from harmolab.skeletons import skeleton_part
from harmolab.types import FloatArray, Skeleton

SMPL_24 = Skeleton(
    (
        *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle"),
        *("right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head"),
        *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
        *("left_hand", "right_hand"),
    ),
    (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21),
)
SHARED = 22  # joints that SMPL, SMPL-H and SMPL-X have in common, without hands
SMPL_22 = skeleton_part(SMPL_24, range(SHARED))

_COUNTS = (SHARED, 24, 52, 55)  # SMPL without hands, SMPL, SMPL-H, SMPL-X
_ROOTS = (-1, 2**32 - 1)  # SMPL's files write the root's parent, -1, into unsigned numbers
_MOST_RADIANS = 100.0
_HEIGHTS = (0.5, 3.0)  # metres that a body at rest may extend over
_BLOCK = 4096  # frames whose rotations are in memory at once

_MIDDLE = ((0, 0, 0), (0, 0.11, -0.01), (0, 0.13, 0), (0, 0.06, 0.01), (0, 0.21, -0.01), (0, 0.10, 0.03))
_LEG = ((0.085, -0.07, 0), (0, -0.417, 0), (0, -0.418, -0.02), (0, -0.055, 0.13))
_ARM = ((0.06, 0.10, -0.01), (0.13, 0.02, 0), (0.316, 0, 0), (0.248, 0, 0), (0.09, 0, 0))


class SmplBody(NamedTuple):
    """A body at rest, the place of its pelvis (metres) where the translation is 0, and a sentence on its origin."""

    body: Body
    pelvis: FloatArray
    note: str


def neutral_body() -> SmplBody:
    """An adult of 1.70 m whose 24 joints are ours, not SMPL's.

    Limbs are shares of stature after Drillis and Contini (1966): thigh 0.245, shank 0.246, ankle 0.039 above the floor,
    upper arm 0.186, forearm 0.146, shoulders 0.818 and eyes 0.936 high. Where these do not say how a trunk divides
    into joints, the numbers are judgements. The pelvis lies where the translation says.
    """
    offsets = np.zeros((len(SMPL_24.joints), 3))
    offsets[[0, 3, 6, 9, 12, 15]] = _MIDDLE
    for limb, joints in ((_LEG, (1, 4, 7, 10)), (_ARM, (13, 16, 18, 20, 22))):
        offsets[list(joints)] = limb
        offsets[[joint + 1 for joint in joints]] = np.array(limb) * [-1, 1, 1]
    note = "joints of harmolab's neutral skeleton, an average adult that is not SMPL's; --smpl FILE takes your own body"
    return SmplBody(Body(SMPL_24, offsets), np.zeros(3), note)


def load_body(path: PathLike) -> SmplBody:
    """The mean body of the user's own SMPL, SMPL-H or SMPL-X file; of the latter two, 22 joints without hands.

    Parameters
    ----------
    path : str or path of an `.npz`
        ``kintree_table`` (2, J), and the joints ``J`` (J, 3), or ``J_regressor`` (J, V) and ``v_template`` (V, 3).

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. A pickle is refused, since reading it would run it; the message says how to convert it.
    """
    with reading(path, "an SMPL body") as file:
        if file.suffix.lower() != ".npz":
            raise ValueError(
                "is no .npz; SMPL's pickles run code when they are read. Where you trust yours and chumpy is "
                "installed, convert it once: m = pickle.load(open(name, 'rb'), encoding='latin1'); "
                "numpy.savez('smpl.npz', J=numpy.array(m['J']), kintree_table=m['kintree_table'])"
            )
        members = ("J", "J_regressor", "v_template", "kintree_table")
        arrays = read_npz(file, dict.fromkeys(members, "fiu"))
        joints = _rest_joints(arrays)
        count = len(joints) if len(joints) == len(SMPL_24.joints) else SHARED
        skeleton = skeleton_part(SMPL_24, range(count))
        tree = arrays.get("kintree_table", np.zeros((0, 0)))
        if tree.ndim != 2 or len(tree) != 2 or tree.shape[1] != len(joints) or tree[0, 0] not in _ROOTS:
            raise ValueError(f"kintree_table must be (2, {len(joints)}) with a root first, got shape {tree.shape}")
        if tuple(tree[0, 1:count].tolist()) != skeleton.parents[1:]:
            raise ValueError("has another tree of joints than SMPL")
        parents = np.array((0, *skeleton.parents[1:]))
        offsets = joints[:count] - joints[parents]
        note = f"joints of the mean body in {file.name}; betas are left out"
        return SmplBody(Body(skeleton, offsets), joints[0], note)


def _rest_joints(arrays: dict[str, NDArray[Any]]) -> FloatArray:
    """(J, 3) joints at rest, metres, of the arrays in a body's file."""
    joints = arrays.get("J")
    if joints is None:
        if missing := {"J_regressor", "v_template"} - arrays.keys():
            raise ValueError(f"has no array J, and no {' and no '.join(sorted(missing))} either")
        regressor, template = arrays["J_regressor"], arrays["v_template"]
        if regressor.ndim != 2 or template.shape != (regressor.shape[1], 3):
            raise ValueError(f"J_regressor {regressor.shape} does not fit v_template {template.shape}")
        with np.errstate(over="ignore", invalid="ignore"):
            joints = regressor.astype(np.float64) @ template.astype(np.float64)
    if joints.ndim != 2 or joints.shape[1] != 3 or len(joints) not in _COUNTS:
        raise ValueError(f"must have 24, 52 or 55 joints (J, 3), got shape {joints.shape}")
    if not (np.isfinite(joints).all() and _HEIGHTS[0] <= np.ptp(joints, axis=0).max() <= _HEIGHTS[1]):
        raise ValueError("has joints that make no body in metres")
    return joints.astype(np.float64)


def rotation_matrices(values: NDArray[Any], name: str) -> tuple[FloatArray, str]:
    """Rotations (T, 24, 3, 3) relative to the parent, and a sentence on how they were written.

    Parameters
    ----------
    values : (T, J, 3) axis-angle in radians, or (T, J, 6) 6-D rotations (Zhou et al. 2019), both also flat
        J is 22, 24, 52 or 55. The six numbers are the first two rows of the matrix, as PyTorch3D has them, and with it
        EDGE and LODGE; they are made orthonormal. Fingers, jaw and eyes are left out.
    name : of the array, for messages

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, an angle beyond all turns, a row of length 0.
    """
    sizes = {count * size: (count, size) for count in _COUNTS for size in (3, 6)}
    width = values.shape[1] if values.ndim == 2 else 0
    count, size = values.shape[1:] if values.ndim == 3 else sizes.get(width, (0, 0))
    if count not in _COUNTS or size not in (3, 6):
        raise ValueError(
            f"{name} must be axis-angle (T, J, 3) or 6-D (T, J, 6), also flat, of 22, 24, 52 or 55 joints, "
            f"got shape {values.shape}"
        )
    if len(values) > MAX_FRAMES:
        raise ValueError(f"has {len(values)} frames, more than the {MAX_FRAMES} allowed; cut it into parts")
    # SMPL-H and SMPL-X have fingers, jaw and eyes from the 23rd joint on.
    kept = count if count in (SHARED, 24) else SHARED
    numbers = values.reshape(len(values), count, size)[:, :kept].astype(np.float64)
    if not np.isfinite(numbers).all():
        frame, joint = np.argwhere(~np.isfinite(numbers))[0][:2]
        raise ValueError(f"{name} holds NaN or infinity at frame {frame}, joint {joint}")
    turns = np.broadcast_to(np.eye(3), (len(values), 24, 3, 3)).copy()
    if size == 6:
        turns[:, :kept] = _from_rows(numbers, name)
        return turns, f"6-D rotations of {count} joints, read as the first two rows of each matrix"
    if np.abs(numbers).max(initial=0.0) > _MOST_RADIANS:
        largest = np.abs(numbers).max()
        raise ValueError(f"{name} holds angles up to {largest:.3g} radians; are these degrees, or positions?")
    turns[:, :kept] = Rotation.from_rotvec(numbers.reshape(-1, 3)).as_matrix().reshape(len(values), kept, 3, 3)
    return turns, f"axis-angle rotations of {count} joints"


def _from_rows(numbers: FloatArray, name: str) -> FloatArray:
    """Matrices (T, J, 3, 3) whose first two rows are (T, J, 6) numbers, made orthonormal (Gram-Schmidt)."""
    with np.errstate(all="ignore"):
        first = numbers[..., :3] / np.linalg.norm(numbers[..., :3], axis=-1, keepdims=True)
        second = numbers[..., 3:] - (first * numbers[..., 3:]).sum(axis=-1, keepdims=True) * first
        second = second / np.linalg.norm(second, axis=-1, keepdims=True)
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        raise ValueError(f"{name} holds 6-D rotations whose two rows span no plane")
    return np.stack([first, second, np.cross(first, second)], axis=-2)


def posed(turns: FloatArray, translation: FloatArray, body: SmplBody) -> FloatArray:
    """Positions (T, J, 3), metres, of a body turned by (T, 24, 3, 3) and moved by a translation (T, 3)."""
    count = len(body.body.skeleton.joints)
    root = translation + body.pelvis
    starts = range(0, len(turns), _BLOCK)
    parts = [forward_kinematics(turns[s : s + _BLOCK, :count], root[s : s + _BLOCK], body.body) for s in starts]
    return np.concatenate(parts) if parts else np.zeros((0, count, 3))


def body_for(path: PathLike | None) -> SmplBody:
    """The body of the user's own file, or the neutral one where there is none."""
    return neutral_body() if path is None else load_body(Path(path))
