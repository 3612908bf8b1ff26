"""SMPL parameters as AMASS, AIST++, EDGE, FACT, LODGE and FineDance write them, to Motion.

===========================  =======================================================  =================  ===============
who                          arrays                                                   rate               up
===========================  =======================================================  =================  ===============
AMASS, `.npz`                ``poses`` (T, 156 or 165), ``trans``, ``betas``,         in the file        z: its capture
                             ``mocap_framerate`` or ``mocap_frame_rate``                                 studios' floor
AIST++, `.pkl`               ``smpl_poses`` (T, 72), ``smpl_trans``,                  60 by its name     y: its cameras'
                             ``smpl_scaling``, by which trans is divided                                 calibration
EDGE, `.pkl`                 ``smpl_poses`` (T, 72), ``smpl_trans``, ``full_pose``    none               z: its training
                             (T, 24, 3), the joints as EDGE placed them                                  turned AIST++
others, `.npz`, `.pkl`       ``smpl_poses`` or ``poses``, ``smpl_trans`` or           ``fps``, or none   guessed from
                             ``trans``                                                                   the body
LODGE, FineDance, `.npy`     (T, 135, 139, 315 or 319): four contacts in 139 and      none               guessed from
                             319, translation, 6-D rotations of 22 or 52 joints                          the body
FACT, `.npy`                 (T, 225): six zeros, translation, 24 matrices; its       none               y: it learns
                             first 120 frames are recorded, the seed of the rest                         AIST++
others, `.npy`               (T, 219): the same without the zeros                     none               guessed from
                                                                                                         the body
===========================  =======================================================  =================  ===============

Translations are in metres once `smpl_scaling` is divided out; it is the size of a dancer in AIST++'s own unit. Where a
file holds ``betas`` (S,), the shape of its body, joints at rest of the user's own SMPL file are shaped by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.io.aist import AIST_FPS, is_aist_name
from harmolab.io.arrays import checked_motion, in_metres
from harmolab.io.files import PathLike
from harmolab.io.motion_file import Assumption, MotionFile, ReadingOptions, guessed_up, stated_up
from harmolab.io.smpl import SMPL_24, SmplBody, body_for, posed, rotation_matrices
from harmolab.types import FloatArray, Motion

# Arrays of an `.npz` that are looked at.
MEMBERS = (
    *("poses", "trans", "betas", "mocap_framerate", "mocap_frame_rate", "fps"),
    *("smpl_poses", "smpl_trans", "smpl_scaling", "full_pose"),
)
_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_EDGE_HINT = " (EDGE's own settings make 30)"
_FACT_HINT = " (FACT's own settings make 60)"
_MOST_BETAS = 1000
_LODGE = "SMPL vectors of LODGE or FineDance"
_SEED = Assumption(
    "all frames are the dance: the first 120 too, which are recorded where FACT's own script wrote the file",
    "the first 120 frames, FACT's recorded seed, left in",
)


class VectorLayout(NamedTuple):
    """One vector a frame: its kind, the numbers before the translation, and how many; rotations come behind."""

    kind: str
    first: str = ""
    start: int = 0


VECTORS = {  # numbers of a frame -> layout
    135: VectorLayout(_LODGE),
    139: VectorLayout(_LODGE, "four contacts, ", 4),
    315: VectorLayout(_LODGE),
    319: VectorLayout(_LODGE, "four contacts, ", 4),
    219: VectorLayout("SMPL vectors"),
    225: VectorLayout("SMPL vectors of FACT", "six zeros, ", 6),
}


def is_parameters(content: Mapping[str, Any]) -> bool:
    """True for a content that holds SMPL parameters, or the joints that EDGE placed by them."""
    return bool({"smpl_poses", "poses", "full_pose"} & content.keys())


def parameter_motion(content: Mapping[str, Any], path: PathLike, options: ReadingOptions) -> MotionFile:
    """The motion of SMPL parameters; call it inside `harmolab.io.files.reading`.

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
    prefix = "smpl_" if "smpl_poses" in content else ""
    poses, translation = _array(content, f"{prefix}poses"), _array(content, f"{prefix}trans")
    rate, rate_note = _rate(content, path, options)
    places, scale_note = _metres(content, translation, options)
    turns, turns_note = rotation_matrices(poses, f"{prefix}poses")
    kind, up, reason = _kind(content)
    body = body_for(options.smpl, _betas(content))
    motion, notes = _placed(turns, places, rate, (up, reason), body, options)
    return MotionFile(motion, kind, (turns_note, *notes, scale_note, *rate_note))


def vector_motion(values: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The motion of one vector a frame, of a width in `VECTORS`."""
    kind, first, start = VECTORS[values.shape[1]]
    is_fact = values.shape[1] == 225
    rate = options.rate(hint=_FACT_HINT if is_fact else "")
    turns, note = rotation_matrices(values[:, start + 3 :], "the vectors")
    places = in_metres(values[:, start : start + 3], 1.0 if options.scale is None else options.scale)
    axis = ("y", "as FACT writes") if is_fact else ("", "")
    motion, notes = _placed(turns, places, rate, axis, body_for(options.smpl), options)
    layout = f"{values.shape[1]} numbers a frame: {first}translation, rotations"
    return MotionFile(motion, kind, (layout, note, *notes, *([_SEED] if is_fact else [])))


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
    turns: FloatArray,
    places: FloatArray,
    rate: float,
    axis: tuple[str, str],
    body: SmplBody,
    options: ReadingOptions,
) -> tuple[Motion, tuple[str, str]]:
    """The motion by forward kinematics, y up, and sentences on its body and on the axis, told with its reason."""
    if len(turns) != len(places):
        raise ValueError(f"has rotations of {len(turns)} frames and a translation of {len(places)}")
    skeleton = body.body.skeleton
    with np.errstate(over="ignore", invalid="ignore"):
        positions = posed(turns, places, body)
        is_open = not axis[0]
        positions, note = (
            guessed_up(positions, skeleton.joints, options) if is_open else stated_up(positions, *axis, options)
        )
    return checked_motion(positions, rate, skeleton), (body.note, note)


def _edge_joints(joints: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The joints that EDGE placed itself, by a skeleton of its own."""
    if joints.ndim != 3 or joints.shape[1:] != (24, 3):
        raise ValueError(f"full_pose must have shape (T, 24, 3), got {joints.shape}")
    rate = options.rate(hint=_EDGE_HINT)
    places = in_metres(joints, 1.0 if options.scale is None else options.scale)
    positions, note = stated_up(places, "z", "as EDGE writes", options)
    return MotionFile(checked_motion(positions, rate, SMPL_24), "EDGE's joints", ("joints of full_pose", note))


def _array(content: Mapping[str, Any], name: str) -> NDArray[Any]:
    """An array of numbers by its name."""
    values = content.get(name)
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise ValueError(f"has no array {name} of numbers but {sorted(map(str, content))[:8]}")
    return values


def _betas(content: Mapping[str, Any]) -> FloatArray | None:
    """The shape of the body (S,), None where there is none."""
    if "betas" not in content:
        return None
    values = _array(content, "betas")
    if values.ndim not in (1, 2) or (values.ndim == 2 and len(values) != 1) or values.size > _MOST_BETAS:
        raise ValueError(f"betas must be the shape of one body, (S,) or (1, S), got shape {values.shape}")
    betas = values.reshape(-1).astype(np.float64)
    if not np.isfinite(betas).all():
        raise ValueError("betas hold NaN or infinity")
    return betas


def _number(content: Mapping[str, Any], name: str) -> float:
    """The one number of an array."""
    values = np.asarray(content[name])
    if values.size != 1 or values.dtype.kind not in "fiu":
        raise ValueError(f"{name} must be one number, got shape {values.shape}")
    return float(values.item())


def _rate(content: Mapping[str, Any], path: PathLike, options: ReadingOptions) -> tuple[float, tuple[str, ...]]:
    """Frames per second, and a sentence on where they are from unless they were passed."""
    own, reason = None, ""
    if (name := next((name for name in _RATES if name in content), None)) is not None:
        own, reason = _number(content, name), f"{name} of the file"
    # A generator may name its dances as AIST++ does, and run at another rate; the scaling is AIST++'s own.
    elif is_aist_name(path) and "smpl_scaling" in content:
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
    scaling = _number(content, "smpl_scaling")
    if not 1e-3 <= scaling <= 1e6:
        raise ValueError(f"smpl_scaling must lie between 0.001 and 1e6, got {scaling:g}")
    return in_metres(translation, 1 / scaling), f"translation divided by smpl_scaling, {scaling:.4g}"
