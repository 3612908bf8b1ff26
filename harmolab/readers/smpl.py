"""SMPL's body (24 joints, their rotations, forward kinematics), and files of SMPL parameters to Motion.

SMPL, SMPL-H and SMPL-X share their first 22 joints; the rotations of fingers move none of the joints kept here. A body
at rest stands with arms spread (a T), faces +z and has y up; its left is +x. The body model itself is licensed and is
not part of this package: without a file of the user's own, joints lie on a skeleton of ours.

AMASS, AIST++, EDGE, FACT, LODGE, FineDance and Motion-X write SMPL parameters so:

===========================  =======================================================  =================  ===============
who                          arrays                                                   rate               up
===========================  =======================================================  =================  ===============
AMASS, `.npz`                ``poses`` (T, 156 or 165), ``trans``, ``betas``,         in the file        z: its capture
                             ``mocap_framerate`` or ``mocap_frame_rate``                                 studios' floor
AIST++, `.pkl`               ``smpl_poses`` (T, 72), ``smpl_trans``,                  60 by its name     y: its cameras'
                             ``smpl_scaling``, by which trans is divided                                 calibration
                             (of a generator, which writes 1 or 100: no rate)
EDGE, `.pkl`                 ``smpl_poses`` (T, 72), ``smpl_trans``, ``full_pose``    none               z: its training
                             (T, 24, 3), the joints as EDGE placed them                                  turned AIST++
others, `.npz`, `.pkl`       ``smpl_poses`` or ``poses``, ``smpl_trans`` or           ``fps``, or none   guessed from
                             ``trans``; ``root_orient``, ``pose_body``, ``trans``;                       the body
                             ``global_orient``, ``body_pose``, ``transl``
LODGE, FineDance, `.npy`     (T, 135, 139, 315 or 319): four contacts in 139 and      none               guessed from
                             319, translation, 6-D rotations of 22 or 52 joints                          the body
FACT, `.npy`                 (T, 225): six zeros, translation, 24 matrices; its       none               y: it learns
                             first 120 frames are recorded, the seed of the rest                         AIST++
others, `.npy`               (T, 219): the same without the zeros                     none               guessed from
                                                                                                         the body
Motion-X, `.npy`             (T, 322): axis-angle of 22 joints, hands, face (309       none               guessed from
                             numbers in all), translation, betas                                         the body
===========================  =======================================================  =================  ===============

Where the body stands along the other one of y and z, that is up.

Translations are in metres once `smpl_scaling` is divided out; it is the size of a dancer in AIST++'s own unit. Where a
file holds ``betas`` (S,), the shape of its body, joints at rest of the user's own SMPL file are shaped by them; of one
shape for each frame, (T, S), as GVHMR and WHAM write, by the mean.
"""

import itertools
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from harmolab.body.rotations import Body, alignment, forward_kinematics
from harmolab.body.skeletons import Skeleton, skeleton_part
from harmolab.files import PathLike, reading
from harmolab.readers.aist import AIST_FPS, is_aist_name
from harmolab.readers.arrays import checked_motion, in_metres, one_number, read_npz
from harmolab.readers.keypoints import check_frames
from harmolab.readers.motion_file import Assumption, MotionFile, ReadingOptions, upright
from harmolab.types import FloatArray, Motion

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
_LARGEST_FAULT = 0.5  # distance of a matrix from its nearest rotation (Frobenius), median, above which it is none
BODIES_KEPT = 4  # files of bodies whose joints a process keeps

_MIDDLE = ((0, 0, 0), (0, 0.11, -0.01), (0, 0.13, 0), (0, 0.06, 0.01), (0, 0.21, -0.01), (0, 0.10, 0.03))
_LEG = ((0.085, -0.07, 0), (0, -0.417, 0), (0, -0.418, -0.02), (0, -0.055, 0.13))
_ARM = ((0.06, 0.10, -0.01), (0.13, 0.02, 0), (0.316, 0, 0), (0.248, 0, 0), (0.09, 0, 0))
_NEUTRAL = Assumption(
    "joints of harmolab's neutral skeleton, an average adult that is not SMPL's; --smpl FILE takes your own body",
    "joints of harmolab's neutral skeleton, not SMPL's",
)


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
    return SmplBody(Body(SMPL_24, offsets), np.zeros(3), _NEUTRAL)


class RestJoints(NamedTuple):
    """Joints at rest of an SMPL file, metres: (J, 3) of its mean body, and by how much each of S numbers of a shape
    moves them, (J, 3, S); S is 0 where the file does not tell.
    """

    mean: FloatArray
    by_shape: FloatArray


def load_body(path: PathLike, betas: FloatArray | None = None) -> SmplBody:
    """The body of the user's own SMPL, SMPL-H or SMPL-X file; of the latter two, 22 joints without hands.

    Parameters
    ----------
    path : str or path of an `.npz`
        ``kintree_table`` (2, J), and the joints ``J`` (J, 3), or ``J_regressor`` (J, V) and ``v_template`` (V, 3).
    betas : (S,) array, the shape of a body; None for the mean one
        It moves the joints at rest by ``J_regressor @ shapedirs @ betas``, with ``shapedirs`` (V, 3, at least S) of the
        file (Loper et al. 2015, Eqs. 8 and 10); numbers that the file has no directions for are left out. Betas belong
        to the model of a gender: name the file of the same.

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
                "numpy.savez('smpl.npz', J_regressor=m['J_regressor'].toarray(), kintree_table=m['kintree_table'], "
                "**{name: numpy.array(m[name]) for name in ('v_template', 'shapedirs')})"
            )
        joints, note = _shaped(_rest_joints(file, file.stat().st_mtime_ns), betas, file.name)
    count = len(joints) if len(joints) == len(SMPL_24.joints) else SHARED
    skeleton = skeleton_part(SMPL_24, range(count))
    return SmplBody(Body(skeleton, joints[:count] - joints[[0, *skeleton.parents[1:]]]), joints[0], note)


def _shaped(rest: RestJoints, betas: FloatArray | None, name: str) -> tuple[FloatArray, str]:
    """Joints at rest (J, 3) of a body with these betas, and a sentence on it; `name` is that of the SMPL file."""
    if betas is None or not betas.any():
        return rest.mean, f"joints of the mean body in {name}"
    count = min(len(betas), rest.by_shape.shape[2])
    if not count:
        reason = "betas are left out, since it has no J_regressor with shapedirs"
        return rest.mean, Assumption(f"joints of the mean body in {name}; {reason}", "betas left out")
    with np.errstate(over="ignore", invalid="ignore"):
        joints = rest.mean + rest.by_shape[:, :, :count] @ betas[:count]
    if not _is_body(joints):
        raise ValueError(f"is made no body in metres by betas up to {np.abs(betas).max():.3g}")
    return joints, f"joints of the body in {name} shaped by {count} of {len(betas)} betas"


@lru_cache(maxsize=BODIES_KEPT)
def _rest_joints(file: Path, _: int) -> RestJoints:
    """The joints at rest of an SMPL file; the second argument, its time of change, keeps them up to date.

    ValueError for another tree than SMPL's, or arrays that do not fit.
    """
    arrays = read_npz(file, dict.fromkeys(("J", "J_regressor", "v_template", "shapedirs", "kintree_table"), "fiu"))
    joints = _mean_joints(arrays)
    count = len(joints) if len(joints) == len(SMPL_24.joints) else SHARED
    tree = arrays.get("kintree_table", np.zeros((0, 0)))
    if tree.ndim != 2 or len(tree) != 2 or tree.shape[1] != len(joints) or tree[0, 0] not in _ROOTS:
        raise ValueError(f"kintree_table must be (2, {len(joints)}) with a root first, got shape {tree.shape}")
    if tuple(tree[0, 1:count].tolist()) != SMPL_24.parents[1:count]:
        raise ValueError("has another tree of joints than SMPL")
    regressor, directions = arrays.get("J_regressor"), arrays.get("shapedirs")
    if regressor is None or directions is None:
        return RestJoints(joints, np.zeros((len(joints), 3, 0)))
    fits = regressor.ndim == 2 and len(regressor) == len(joints) and directions.ndim == 3
    if not fits or directions.shape[:2] != (regressor.shape[1], 3):
        raise ValueError(f"shapedirs {directions.shape} do not fit J_regressor {regressor.shape}")
    with np.errstate(over="ignore", invalid="ignore"):
        by_shape = np.tensordot(regressor.astype(np.float64), directions.astype(np.float64), axes=1)
    if not np.isfinite(by_shape).all():
        raise ValueError("shapedirs hold NaN or infinity")
    return RestJoints(joints, by_shape)


def _is_body(joints: FloatArray) -> bool:
    """True for joints at rest of a size that bodies have."""
    return bool(np.isfinite(joints).all() and _HEIGHTS[0] <= np.ptp(joints, axis=0).max() <= _HEIGHTS[1])


def _mean_joints(arrays: dict[str, NDArray[Any]]) -> FloatArray:
    """(J, 3) joints at rest, metres, of the mean body in the arrays of a file."""
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
    if not _is_body(joints):
        raise ValueError("has joints that make no body in metres")
    return joints.astype(np.float64)


def rotation_matrices(values: NDArray[Any], name: str) -> tuple[FloatArray, str]:
    """Rotations (T, 24, 3, 3) relative to the parent, and a sentence on how they were written.

    Parameters
    ----------
    values : (T, J, 3) axis-angle in radians, (T, J, 6) 6-D rotations (Zhou et al. 2019), or (T, J, 9), all also flat
        J is 22, 24, 52 or 55. The six numbers are the first two rows of the matrix, as PyTorch3D has them, and with it
        EDGE and LODGE; they are made orthonormal. Nine are a matrix row by row, of which the nearest rotation is taken,
        as FACT's authors do. Fingers, jaw and eyes are left out.
    name : of the array, for messages

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, an angle beyond all turns, a row of length 0, matrices that are far
        from rotations.
    """
    sizes = {count * size: (count, size) for count in _COUNTS for size in (3, 6, 9)}
    width = values.shape[1] if values.ndim == 2 else 0
    count, size = values.shape[1:] if values.ndim == 3 else sizes.get(width, (0, 0))
    if count not in _COUNTS or size not in (3, 6, 9):
        raise ValueError(
            f"{name} must be axis-angle (T, J, 3), 6-D (T, J, 6) or matrices (T, J, 9), also flat, of 22, 24, 52 or 55 "
            f"joints, got shape {values.shape}"
        )
    check_frames(len(values))
    # SMPL-H and SMPL-X have fingers, jaw and eyes from the 23rd joint on.
    kept = count if count in (SHARED, 24) else SHARED
    numbers = values.reshape(len(values), count, size)[:, :kept].astype(np.float64)
    if not np.isfinite(numbers).all():
        frame, joint = np.argwhere(~np.isfinite(numbers))[0][:2]
        raise ValueError(f"{name} holds NaN or infinity at frame {frame}, joint {joint}")
    turns = np.broadcast_to(np.eye(3), (len(values), 24, 3, 3)).copy()
    if size == 6:
        turns[:, :kept] = _from_rows(numbers, name)
        reason = "assumed, as PyTorch3D writes; where they are its columns, save axis-angle"
        note = f"6-D rotations of {count} joints, the first two rows of each matrix ({reason})"
        return turns, Assumption(note, "6-D rotations assumed to be rows")
    if size == 9:
        turns[:, :kept] = _from_matrices(numbers, name)
        return turns, f"rotation matrices of {count} joints, row by row"
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


def _from_matrices(numbers: FloatArray, name: str) -> FloatArray:
    """Rotations (T, J, 3, 3) nearest to matrices (T, J, 9), of which no number is NaN."""
    matrices = numbers.reshape(-1, 3, 3)
    # Numbers out of all bounds would stop the decomposition; the distance refuses them.
    turns = alignment(np.eye(3), np.clip(matrices, -_MOST_RADIANS, _MOST_RADIANS).swapaxes(1, 2))
    with np.errstate(over="ignore"):
        fault = float(np.median(np.linalg.norm(matrices - turns, axis=(1, 2)))) if len(matrices) else 0.0
    if fault > _LARGEST_FAULT:
        raise ValueError(f"{name} holds no rotation matrices: half of them are {fault:.2g} or more from any rotation")
    return turns.reshape(*numbers.shape[:2], 3, 3)


def posed(turns: FloatArray, translation: FloatArray, body: SmplBody) -> FloatArray:
    """Positions (T, J, 3), metres, of a body turned by (T, 24, 3, 3) and moved by a translation (T, 3)."""
    count = len(body.body.skeleton.joints)
    root = translation + body.pelvis
    starts = range(0, len(turns), _BLOCK)
    parts = [forward_kinematics(turns[s : s + _BLOCK, :count], root[s : s + _BLOCK], body.body) for s in starts]
    return np.concatenate(parts) if parts else np.zeros((0, count, 3))


def body_for(path: PathLike | None, betas: FloatArray | None = None) -> SmplBody:
    """The body of the user's own file with these betas; the neutral one, which has no shapes, where there is none."""
    if path is not None:
        return load_body(Path(path), betas)
    if betas is None or not betas.any():
        return neutral_body()
    note = Assumption(f"{_NEUTRAL}; betas are left out", f"{_NEUTRAL.brief}, betas left out")
    return neutral_body()._replace(note=note)


# SMPL parameters to Motion

# Arrays of an `.npz` that are looked at.
_POSES = {  # arrays of rotations, the root's apart or not -> translation
    ("smpl_poses",): "smpl_trans",
    ("poses",): "trans",
    ("root_orient", "pose_body"): "trans",
    ("global_orient", "body_pose"): "transl",
}
_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
MEMBERS = (*itertools.chain(*_POSES), *_POSES.values(), *_RATES, "betas", "smpl_scaling", "full_pose")
_EDGE_HINT = "such as --fps 30 of EDGE's own settings"
_FACT_HINT = "such as --fps 60 of FACT's own settings"
_MOST_BETAS = 1000
_LODGE = "SMPL vectors of LODGE or FineDance"
FACT_SEED = Assumption(
    "all frames are the dance: the first 120 too, which are recorded where FACT's own script wrote the file",
    "the first 120 frames, FACT's recorded seed, left in (--seed-frames 120 leaves them out)",
)


# Length of the vector of a frame -> its kind, the numbers before the translation, and how many; rotations come behind.
VECTORS = {
    135: (_LODGE, "", 0),
    139: (_LODGE, "four contacts, ", 4),
    315: (_LODGE, "", 0),
    319: (_LODGE, "four contacts, ", 4),
    219: ("SMPL vectors", "", 0),
    225: ("SMPL vectors of FACT", "six zeros, ", 6),
    322: ("SMPL-X vectors of Motion-X", "", 0),
}


def is_parameters(content: Mapping[str, Any]) -> bool:
    """True for a content that holds SMPL parameters, or the joints that EDGE placed by them."""
    return bool({"full_pose", *(names[-1] for names in _POSES)} & content.keys())


def parameter_motion(content: Mapping[str, Any], path: PathLike, options: ReadingOptions) -> MotionFile:
    """The motion of SMPL parameters; call it inside `harmolab.files.reading`.

    Parameters
    ----------
    content : name -> array, as in the module's docstring
    path : whose name tells AIST++'s recordings, and with them their rate
    options : ReadingOptions
        `scale` are metres in one unit of the translation, in place of `smpl_scaling`. With `smpl`, the joints of EDGE
        too come from its rotations.

    Raises
    ------
    MissingFrameRate, ValueError
        There is no rate, an array is missing or of another shape, a number is not finite.
    """
    if "full_pose" in content and options.smpl is None:
        return _edge_joints(_array(content, "full_pose"), options)
    names = next((names for names in _POSES if names[-1] in content), ("smpl_poses",))
    arrays = [_array(content, name) for name in names]
    poses = arrays[0] if len(arrays) == 1 else np.hstack([values.reshape(max(len(values), 1), -1) for values in arrays])
    translation = _array(content, _POSES[names])
    rate, rate_note = _rate(content, path, options)
    places, scale_note = _metres(content, translation, options)
    turns, turns_note = rotation_matrices(poses, " and ".join(names))
    (kind, up, reason), body = _kind(content), body_for(options.smpl, _betas(content, len(poses)))
    motion, notes = _placed(turns, places, rate, (up, reason), body, options)
    return MotionFile(motion, kind, (turns_note, *notes, scale_note, *rate_note))


def vector_motion(values: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The motion of one vector a frame, of a width in `VECTORS`."""
    kind, first, start = VECTORS[values.shape[1]]
    if values.shape[1] == 322:
        parts = {"root_orient": values[:, :3], "pose_body": values[:, 3:66], "trans": values[:, 309:312]}
        return parameter_motion({**parts, "betas": values[:1, 312:]}, "", options)._replace(kind=kind)
    is_fact = values.shape[1] == 225
    rate = options.rate(hint=_FACT_HINT if is_fact else "")
    turns, note = rotation_matrices(values[:, start + 3 :], "the vectors")
    places = in_metres(values[:, start : start + 3], 1.0 if options.scale is None else options.scale)
    axis = ("y", "as FACT writes") if is_fact else ("", "")
    motion, notes = _placed(turns, places, rate, axis, body_for(options.smpl), options)
    layout = f"{values.shape[1]} numbers a frame: {first}translation, rotations"
    return MotionFile(motion, kind, (layout, note, *notes, *([FACT_SEED] if is_fact else [])))


def _kind(content: Mapping[str, Any]) -> tuple[str, str, str]:
    """The kind of parameters, the axis that points up there ("" where it is open), and the reason."""
    if "full_pose" in content:
        return "EDGE's SMPL parameters", "z", "as EDGE writes"
    if "smpl_scaling" in content:
        return "AIST++ SMPL parameters", "y", "as AIST++ writes"
    if {"mocap_framerate", "mocap_frame_rate"} & content.keys():
        return "AMASS SMPL parameters", "z", "as AMASS writes"
    return "SMPL parameters", "", ""


def _placed(
    turns: FloatArray, places: FloatArray, rate: float, axis: tuple[str, str], body: SmplBody, options: ReadingOptions
) -> tuple[Motion, tuple[str, str]]:
    """The motion by forward kinematics, y up, and sentences on its body and on the axis, told with its reason."""
    if len(turns) != len(places):
        raise ValueError(f"has rotations of {len(turns)} frames and a translation of {len(places)}")
    skeleton = body.body.skeleton
    with np.errstate(over="ignore", invalid="ignore"):
        positions = posed(turns, places, body)
        positions, note = upright(positions, skeleton.joints, options, *axis, is_needed=True)
    return checked_motion(positions, rate, skeleton), (body.note, note)


def _edge_joints(joints: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The joints that EDGE placed itself, by a skeleton of its own."""
    if joints.ndim != 3 or joints.shape[1:] != (24, 3):
        raise ValueError(f"full_pose must have shape (T, 24, 3), got {joints.shape}")
    rate = options.rate(hint=_EDGE_HINT)
    places = in_metres(joints, 1.0 if options.scale is None else options.scale)
    positions, note = upright(places, (), options, "z", "as EDGE writes")
    return MotionFile(checked_motion(positions, rate, SMPL_24), "EDGE's joints", ("joints of full_pose", note))


def _array(content: Mapping[str, Any], name: str) -> NDArray[Any]:
    """An array of numbers by its name."""
    values = content.get(name)
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise ValueError(f"has no array {name} of numbers but {sorted(map(str, content))[:8]}")
    return values


def _betas(content: Mapping[str, Any], n_frames: int) -> FloatArray | None:
    """The shape of the body (S,), the mean of those of the frames, None where there is none."""
    if "betas" not in content:
        return None
    values = _array(content, "betas")
    rows = values[None] if values.ndim == 1 else values
    if rows.ndim != 2 or len(rows) not in (1, n_frames or 1) or rows.shape[1] > _MOST_BETAS:
        raise ValueError(f"betas must be the shape of one body, (S,) or (1, S), got shape {values.shape}")
    betas = rows.mean(axis=0, dtype=np.float64)
    if not np.isfinite(betas).all():
        raise ValueError("betas hold NaN or infinity")
    return betas


def _rate(content: Mapping[str, Any], path: PathLike, options: ReadingOptions) -> tuple[float, tuple[str, ...]]:
    """Frames per second, and a sentence on where they are from unless they were passed."""
    own, reason = None, ""
    if (name := next((name for name in _RATES if name in content), None)) is not None:
        own, reason = one_number(content, name), f"{name} of the file"
    # A generator may name its dances as AIST++ does, and run at another rate; a scaling that is fitted is AIST++'s own.
    elif is_aist_name(path) and "smpl_scaling" in content and one_number(content, "smpl_scaling") not in (1, 100):
        own, reason = AIST_FPS, "AIST++"
    rate = options.rate(own, _EDGE_HINT if "full_pose" in content else "")
    is_own = own is not None and (options.fps is None or options.as_defaults)
    return rate, (f"{rate:g} frames a second ({reason})",) if is_own else ()


def _metres(content: Mapping[str, Any], translation: NDArray[Any], options: ReadingOptions) -> tuple[FloatArray, str]:
    """The translation (T, 3) in metres, and a sentence on its unit."""
    if translation.ndim != 2 or translation.shape[1] != 3:
        raise ValueError(f"the translation must have shape (T, 3), got {translation.shape}")
    if options.scale is not None:
        return in_metres(translation, options.scale), f"translation of {options.scale:g} m a unit (as passed)"
    if "smpl_scaling" not in content:
        return in_metres(translation, 1.0), "translation in metres"
    scaling = one_number(content, "smpl_scaling")
    if not 1e-3 <= scaling <= 1e6:
        raise ValueError(f"smpl_scaling must lie between 0.001 and 1e6, got {scaling:g}")
    return in_metres(translation, 1 / scaling), f"translation divided by smpl_scaling, {scaling:.4g}"
