"""Array files, pickles and JSON to Motion: joints in space as bare numbers, and HumanML3D's vectors.

The shape of an array and the names beside it tell what they hold.

Joints in space as bare numbers are (T, J, 3) or flat: 24 and 22 joints of SMPL, 17 of COCO or of
Human3.6M (the body tells which), from arrays, JSON, pickles.
Bailando writes 24 joints under ``pred_position``, in an array file that holds a pickled dictionary, and its training
data as JSON with ``dance_array``; AIST++ has 17 joints. None of them tells its unit or the axis that points up.

Bailando's folders of JSON files, one a frame: those of ``jsons_original`` hold joints in space under ``3d_pose`` and
are read. Those of ``jsons`` are drawings, in OpenPose's layout but upside down and with left and right exchanged; they
are refused, since the same dances lie in ``pkl``.

HumanML3D's vectors of 263 numbers a frame give the places of 22 joints (Guo et al. 2022, "Generating Diverse and
Natural 3D Human Motions From Text").

A frame holds, in this order: how far the body turns about y until the next frame, as half the angle (1); how far the
pelvis moves until then along x and z of the body (2); the pelvis's height (1); the places of 21 joints, x and z from
the pelvis, y from the floor, in the body's frame that faces +z (63); their 6-D rotations (126), velocities of 22 joints
(66), and four contacts. The places alone tell where the joints are; the last three are not looked at.

The vectors hold no rate. HumanML3D itself is at 20 frames per second, other data written this way is not.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.body.skeletons import Skeleton, turned
from harmolab.files import MAX_JSON_BYTES, MAX_TEXT_BYTES, MissingFrameRate, PathLike, named_faults, read_json, reading
from harmolab.readers import keypoints, motion_file
from harmolab.readers.aist import AIST_FPS, aist_motion, is_aist_name, read_array_pickle
from harmolab.readers.arrays import checked_motion, in_metres, npy_pickle, number_array, read_npy
from harmolab.readers.motion_file import Assumption, MotionFile, ReadingOptions
from harmolab.readers.smpl import SMPL_22, SMPL_24, VECTORS, is_parameters, parameter_motion, vector_motion
from harmolab.types import FloatArray, Motion

# Joints in space as bare numbers

SKELETONS = {len(skeleton.joints): skeleton for skeleton in (keypoints.COCO_17, SMPL_22, SMPL_24)}
_NAMES = {keypoints.COCO_17: "COCO", keypoints.HUMAN36M_17: "Human3.6M", SMPL_22: "SMPL", SMPL_24: "SMPL"}
KEYS = ("pred_position", "dance_array", "keypoints3d_optim", "keypoints3d", "positions")
# Standard deviation over mean of a thigh's length, above which these are no joints: rotations have the same shape.
_STRETCH = 0.5
_STEADY = 0.25  # the same of all bones, above which it is told
_LOPSIDED = 1.5  # thigh over thigh, above which these are other joints
_BETTER = 0.75  # share of the one skeleton's spread of lengths below which the other's is smaller
_FRAME_KEY = "3d_pose"


def positions_in(content: Any) -> Any:
    """The numbers of joints in the content of a JSON file or of a pickle; None where it holds none of these."""
    if isinstance(content, Mapping):
        return next((content[key] for key in KEYS if key in content), None)
    frame = content[0] if isinstance(content, list) and content and isinstance(content[0], list) else []
    first = frame[0] if frame else None
    is_flat = isinstance(first, int | float) and is_joints((len(content), len(frame)))
    return content if is_flat or isinstance(first, list) else None


def is_joints(shape: tuple[int, ...]) -> bool:
    """True for the shape of joints in space, of one of the three skeletons."""
    return shape[1:] in {form for count in SKELETONS for form in ((count, 3), (3 * count,))}


def joint_motion(values: Any, options: ReadingOptions, own_fps: float | None = None, kind: str = "") -> MotionFile:
    """The motion of joints in space; call it inside `harmolab.files.reading`.

    Parameters
    ----------
    values : (T, J, 3) or (T, 3J) array or nested lists, J 17, 22 or 24
    options : ReadingOptions
    own_fps : float or None, frames per second that the file tells
    kind : of the file; made of the skeleton's name where left out

    Raises
    ------
    MissingFrameRate, ValueError
        There is no rate; the shape is another, the unit cannot be, or these are rotations.
    """
    array = _numbers(values)
    if not is_joints(array.shape) or not 2 <= len(array) <= keypoints.MAX_FRAMES:
        counts = ", ".join(map(str, SKELETONS))
        raise ValueError(f"joints must have shape (T, J, 3) or (T, 3J) with J of {counts}, got {array.shape}")
    options.check_no_body()
    rate = options.rate(own_fps)
    joints, valid = keypoints.filled_joints(array.reshape(len(array), -1, 3))
    skeleton, remarks = steady_skeleton(joints)
    spread, length = _spread_and_length(joints, _thigh(skeleton, "left"))
    if not spread <= _STRETCH * length:
        raise ValueError(
            "holds no joints: the thigh changes its length by more than half; SMPL rotations are read "
            "from .npz or .pkl with poses and trans"
        )
    factor, unit = motion_file.metre_factor(joints, options)
    places, up = motion_file.upright(in_metres(joints, factor), skeleton.joints, options)
    name = kind or f"{len(skeleton.joints)} joints of {_NAMES[skeleton]}"
    return MotionFile(checked_motion(places, rate, skeleton, valid), name, (unit, up, *remarks))


def _numbers(values: Any) -> FloatArray:
    """Joints as an array of numbers."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"joints must be numbers of shape (T, J, 3): {error}") from None


def frame_motion(folder: Path, files: Sequence[Path], options: ReadingOptions) -> MotionFile:
    """The motion of Bailando's files of a frame, in their order.

    Raises
    ------
    MissingFrameRate, ValueError
        As `joint_motion`, or a file holds no joints in space; names the folder, or the file.
    """
    with named_faults(folder):
        keypoints.check_frames(len(files))
    if options.fps is None:
        raise MissingFrameRate(f"{folder}: holds no frame rate; pass fps, such as --fps 60 of Bailando's settings")
    frames = []
    for path in files:
        with reading(path, "a frame of Bailando", max_bytes=MAX_TEXT_BYTES) as file:
            content = read_json(file)
            if not isinstance(content, dict) or _FRAME_KEY not in content:
                raise ValueError(
                    f"has no {_FRAME_KEY}; Bailando's drawings in jsons are not read: name the array of this dance in "
                    "its folder pkl, or its folder in jsons_original"
                )
            frames.append(number_array(content[_FRAME_KEY], _FRAME_KEY, (len(SMPL_24.joints), 3)))
    with named_faults(folder):
        return joint_motion(np.stack(frames), options, kind="Bailando's frames, 24 joints of SMPL")


def _thigh(skeleton: Skeleton, side: str) -> list[tuple[int, int]]:
    """The bone from a hip to its knee."""
    return [(skeleton.joints.index(f"{side}_hip"), skeleton.joints.index(f"{side}_knee"))]


def steady_skeleton(joints: FloatArray) -> tuple[Skeleton, tuple[Assumption, ...]]:
    """The skeleton of joints (T, J, 3), and remarks on what the body leaves open."""
    skeleton, remarks = SKELETONS[joints.shape[1]], list[Assumption]()
    if skeleton == keypoints.COCO_17:
        fitting = keypoints.body_order(joints) or _steadier(joints)
        skeleton, remarks = fitting or skeleton, [*_order_notes(fitting)]
    shorter, longer = sorted(_spread_and_length(joints, _thigh(skeleton, side))[1] for side in ("left", "right"))
    if longer > _LOPSIDED * shorter:
        doubt = f"one thigh is {shorter:.3g} long, one {longer:.3g}; an .npz holds names of its own"
        order = f"the joints of {_NAMES[skeleton]} (guessed: {doubt})"
        remarks.append(Assumption(order, "order of joints in doubt"))
    spread, length = _spread_and_length(joints, skeleton.bones)
    if not spread <= _STEADY * length:
        reason = f"bones change their lengths by {spread / length:.0%}; SMPL rotations are read from .npz or .pkl"
        remarks.append(Assumption(f"joints (guessed: {reason})", "joints guessed, not rotations"))
    return skeleton, tuple(remarks)


def _steadier(joints: FloatArray) -> Skeleton | None:
    """Human3.6M's skeleton where its bones keep their lengths better than COCO's."""
    # Not as shares of the lengths: those would favour whichever skeleton joins what lies far apart.
    spreads = [_spread_and_length(joints, one.bones)[0] for one in (keypoints.HUMAN36M_17, keypoints.COCO_17)]
    return keypoints.HUMAN36M_17 if spreads[0] < _BETTER * spreads[1] else None


def _spread_and_length(joints: FloatArray, bones: Sequence[tuple[int, int]]) -> tuple[float, float]:
    """Standard deviations and means of the lengths of bones, each summed."""
    parents, children = np.array(bones).T
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(joints[:, children] - joints[:, parents], axis=2)
        return float(lengths.std(axis=0).sum()), float(lengths.mean(axis=0).sum())


# HumanML3D vectors

WIDTH = 263
_LOCAL = slice(4, 4 + 3 * 21)
_HEIGHTS = (0.3, 3.0)  # metres over which a body extends, median


def vector_joints(values: NDArray[Any]) -> FloatArray:
    """Joints (T, 22, 3), metres, y up, of vectors (T, 263); the first frame faces +z, its pelvis over the origin."""
    numbers = values.astype(np.float64)
    facing = 2 * np.concatenate([[0.0], np.cumsum(numbers[:-1, 0])])
    steps = np.zeros((len(numbers), 3))
    steps[1:, [0, 2]] = numbers[:-1, 1:3]
    # Half angles are those of the turn into the body's frame; out of it, the body turns the other way.
    pelvis = np.cumsum(turned(steps, -facing), axis=0)
    pelvis[:, 1] = numbers[:, 3]
    local = numbers[:, _LOCAL].reshape(len(numbers), 21, 3)
    joints = turned(local, -facing[:, None]) + pelvis[:, None] * [1, 0, 1]
    return np.concatenate([pelvis[:, None], joints], axis=1)


def humanml_motion(values: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The motion of vectors (T, 263); call it inside `harmolab.files.reading`.

    Raises
    ------
    MissingFrameRate, ValueError
        No rate is passed; numbers are not finite, or make no body in metres, as those that a network is trained on:
        multiply by the standard deviation and add the mean first.
    """
    options.check_no_body()
    rate = options.rate(hint="such as --fps 20 for HumanML3D's own")
    if not np.isfinite(values).all():
        raise ValueError(f"NaN or infinity at frame {np.argwhere(~np.isfinite(values))[0][0]}; interpolate or cut it")
    with np.errstate(over="ignore", invalid="ignore"):
        joints = in_metres(vector_joints(values), 1.0 if options.scale is None else options.scale)
        extent = float(np.median(np.ptp(joints, axis=1).max(axis=1))) if len(joints) else 0.0
    if not _HEIGHTS[0] <= extent <= _HEIGHTS[1]:
        raise ValueError(
            f"holds HumanML3D vectors of a body that extends over {extent:.3g} m; if they are normalised, multiply by "
            "Std.npy and add Mean.npy first"
        )
    positions, note = motion_file.upright(joints, (), options, "y", "as HumanML3D writes")
    notes = ("22 joints from the turn and speed of the pelvis and the places in the body", note)
    return MotionFile(checked_motion(positions, rate, SMPL_22), "HumanML3D vectors", notes)


# Array files, pickles and JSON, told apart by what they hold

_NAMED = Assumption(
    f"{AIST_FPS:g} frames a second (assumed: it is named as AIST++'s recordings are; --fps overrules it)",
    f"{AIST_FPS:g} frames a second assumed by the name",
)
_WORLD = Assumption(
    "MediaPipe's landmarks in metres (guessed: the hips stay at the origin)", "landmarks in metres guessed"
)
_SQUARE = Assumption(
    "shares of a square picture (assumed; else multiply x by width over height)", "picture assumed square"
)
_HUMAN36M = Assumption(
    "the joints of Human3.6M (guessed by the body; an .npz names its own)", "order of joints guessed: Human3.6M"
)
_DOUBT = Assumption(
    "the joints of COCO (guessed by their number, but the body does not fit; an .npz names its own)",
    "order of joints in doubt",
)
_BODY = Assumption(
    "the body's 17 points, without feet, face and hands (guessed by the number of points)",
    "points of feet, face and hands left out",
)
_PICTURE_SHAPES = ((17, 2), (17, 3), (34,), (51,))
_METRES = Assumption("metres (assumed, since the array does not tell; --scale overrules it)", "unit assumed: metres")


def load_pickle(path: PathLike, options: ReadingOptions) -> MotionFile:
    """AIST++ keypoints3d, SMPL parameters, or joints in space."""
    with reading(path, "a pickle of arrays") as file:
        return _content_motion(read_array_pickle(file.read_bytes()), file, options)


def _content_motion(content: dict[str, Any], file: Path, options: ReadingOptions) -> MotionFile:
    """The motion in a dictionary of arrays."""
    if is_parameters(content):
        return parameter_motion(content, file, options)
    if isinstance(samples := content.get("motion"), np.ndarray) and samples.ndim == 4:
        item = ".item()" if file.suffix.lower() == ".npy" else ""
        raise ValueError(
            f"holds {len(samples)} motions of MDM; where you trust it, save one: m = numpy.load({file.name!r}, "
            f"allow_pickle=True){item}; numpy.savez('dance.npz', "
            "positions=m['motion'][0].transpose(2, 0, 1)[: m['lengths'][0]], fps=20)"
        )
    if {"keypoints3d", "keypoints3d_optim"} & content.keys() or (values := positions_in(content)) is None:
        scale = 0.01 if options.scale is None else options.scale
        motion = aist_motion(content, options.rate(AIST_FPS), scale)
        units = f"{scale:g} m a unit, {motion.fps:g} frames a second"
        return motion_file.as_read(motion, "AIST++ key points", options, units)
    return _joint_motion(values, file, options, content.get("fps"))


def _joint_motion(values: Any, file: Path, options: ReadingOptions, own_fps: float | None = None) -> MotionFile:
    """Joints in space at the rate that their file tells, else at that of its name."""
    rate, notes = _own_rate(own_fps, file, options)
    read = joint_motion(values, options, rate)
    return read._replace(notes=(*read.notes, *notes))


def _own_rate(own: float | None, file: Path, options: ReadingOptions) -> tuple[float | None, tuple[Assumption, ...]]:
    """The rate that a file tells, else that of its name unless one is passed, and the note on the latter."""
    is_named = own is None and options.fps is None and is_aist_name(file)
    return (AIST_FPS, (_NAMED,)) if is_named else (own, ())


def load_json(path: PathLike, options: ReadingOptions) -> MotionFile:
    """Joints in space, or key points of a pose estimator."""
    with reading(path, "key points", max_bytes=MAX_JSON_BYTES) as file:
        content = keypoints.json_or_lines(file)
        values = None if keypoints.is_landmarks(content) else positions_in(content)
        about = content if isinstance(content, dict) else {}
        own = about.get("fps")
        if values is None:
            passed = {} if options.fps is None else {"fps": options.rate(own)}
            points, own_words = keypoints.content_points(content)
            motion = keypoints.described_motion(points, own_words | passed, joints=options.joints)
            return motion_file.as_read(motion, "key points", options, *_guess(motion, points, about))
        return _array_motion(_numbers(values), file, options, own)


def _guess(motion: Motion, values: NDArray[Any], about: Mapping[str, Any]) -> tuple[Assumption, ...]:
    """Notes on what key points leave open unless their file is about it: rate, metres, order and shape of a picture."""
    notes = list[Assumption]()
    frames = keypoints.looked_at(values)
    if (step := frames.step) > 1:
        rates = f"guessed: of {step} frames, at {motion.fps * step:g} a second, one is in the file"
        brief = "frame rate guessed: frames lie at a regular step"
        notes.append(Assumption(f"{motion.fps:g} frames a second ({rates})", brief))
    if motion.positions.shape[2] == 3:
        return (*notes, *(() if "world" in about else (_WORLD,)))
    notes += [_BODY] if values.shape[1] in keypoints.FACES_AND_HANDS and values.ndim == 3 else []
    if values.shape[1:] in _PICTURE_SHAPES:
        notes += _order_notes(keypoints.picture_order(values[frames]))
    is_square = np.median(np.abs(motion.positions)) < 1 and "aspect" not in about
    return (*notes, _SQUARE) if is_square else tuple(notes)


def _order_notes(order: Skeleton | None) -> tuple[Assumption, ...]:
    """The note on 17 joints of an order that is not COCO's."""
    return () if order == keypoints.COCO_17 else (_HUMAN36M if order else _DOUBT,)


def load_npy(path: PathLike, options: ReadingOptions) -> MotionFile:
    """A `.npy` array: joints in space, image coordinates, landmarks with their visibility, vectors, a dictionary."""
    with reading(path, "a .npy array") as file:
        with file.open("rb") as stream:
            if (pickled := npy_pickle(stream)) is not None:
                return _content_motion(read_array_pickle(pickled), file, options)
            values = read_npy(stream, file.stat().st_size)
        width = values.shape[1] if values.ndim == 2 else 0
        if width == WIDTH:
            return humanml_motion(values, options)
        if width in VECTORS:
            return vector_motion(values, options)
        return _array_motion(values, file, options)


def _array_motion(
    values: NDArray[Any], file: Path, options: ReadingOptions, own_fps: float | None = None
) -> MotionFile:
    """Joints in space, image coordinates or landmarks, by the shape and the range of their numbers."""
    if is_joints(values.shape) and not _has_confidence(values):
        return _joint_motion(values, file, options, own_fps)
    own, notes = _own_rate(own_fps, file, options)
    rate = options.rate(own)
    is_open = options.scale is None and not options.up
    is_world = is_open and keypoints.are_world_landmarks(values)
    is_image = is_open and keypoints.are_image_landmarks(values)
    if is_world or is_image or values.ndim != 3 or values.shape[2] != 3 or _has_confidence(values):
        motion = keypoints.described_motion(values, {"fps": rate, "world": is_world}, joints=options.joints)
        return motion_file.as_read(motion, "key points", options, *notes, *_guess(motion, values, {}))
    joints, valid = keypoints.filled_joints(values)
    factor, unit = motion_file.metre_factor(joints, options)
    unit = _METRES if options.scale is None and factor == 1 else unit
    is_mediapipe = values.shape[1] == len(keypoints.MEDIAPIPE_33.joints)
    skeleton = keypoints.MEDIAPIPE_33 if is_mediapipe else keypoints.named_skeleton(values.shape[1])
    if skeleton:
        estimator = "MediaPipe" if is_mediapipe else "OpenPose"
        order = f"the joints of {estimator} (guessed by their number; an .npz names its own)"
        notes += (Assumption(order, f"order of joints guessed: {estimator}"),)
    motion = checked_motion(in_metres(joints, factor), rate, skeleton, valid)
    return motion_file.as_read(motion, "joints", options, unit, *notes, is_open=True)


def _has_confidence(values: NDArray[Any]) -> bool:
    """True where (T, J, 3), also flat, is image coordinates with a confidence: pixels or shares beside 0 to 1.

    Joints of an unknown number are pixels where they extend over more than any body does in metres.
    """
    is_flat = values.ndim == 2
    points = values.reshape(len(values), -1, 3) if is_flat and values.shape[1] % 3 == 0 else values
    if not points.size or points.ndim != 3 or points.shape[2] != 3:
        return False
    places = points[..., :2]
    is_named = keypoints.named_skeleton(points.shape[1]) is not None
    are_shares = is_named and points.min() >= 0 and points.max() <= 1
    are_large = (np.abs(places).max() if is_named else np.median(np.ptp(places, axis=1))) > keypoints.PIXELS
    return bool(are_shares or (are_large and keypoints.are_confidences(points)))
