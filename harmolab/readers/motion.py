"""Motion files to Motion, and Motion to our own `.npz` (or to BVH, for other programs).

The `.npz` format
-----------------
An archive as `numpy.savez` writes it, with these arrays:

==============  ==================================  =======================================================
name            shape and type                      meaning
==============  ==================================  =======================================================
``positions``   (T, J, 3) or (T, J, 2) numbers      places of the joints. 3-D: metres, y up, right-handed;
                                                    2-D: image coordinates, y down
``fps``         one number                          frames per second, 1 to 1000
``joints``      (J,) strings, optional              names of the joints
``parents``     (J,) integers, optional             index of each joint's parent, -1 at a root
``valid``       (T,) bool, optional                 False where a frame is filler (a splice, an occlusion);
                                                    one with all joints at one point, as at 0, is filler too
``units``       one string, optional                ``"m"`` for 3-D (else pass `scale`), any for 2-D
``offset``      one number, optional                seconds, audio time of frame 0 in the song it was made for
``detected``    (T, J) bool, optional               False where a joint was not detected and its place is filled in
``about``       one string, optional                where the motion comes from, for people
``written_by_harmolab``  one bool, optional         marks a file that harmolab may write over
==============  ==================================  =======================================================

T is at least 2. No value is NaN or infinite. Other arrays in the archive are ignored. Python objects are never read.

>>> about = dict(fps=60.0, joints=["hip", "knee"], parents=[-1, 0], units="m")
>>> numpy.savez("dance.npz", positions=positions, **about)  # doctest: +SKIP

Other formats
-------------
``.npy``
    (T, J, 3) in metres, or (T, J, 2) and flat (T, 2J) image coordinates; holds no rate, so pass `fps`. 18 or 25 joints
    get the names of OpenPose, 17 those of COCO or Human3.6M, as the body tells; pixels with a confidence behind them
    are read as such. AIST++ file names bring their 60 fps. (T, 33, 4) is read as MediaPipe landmarks. See
    `harmolab.readers.keypoints`. 17, 22 and 24 joints in space, also flat, and Bailando's dictionaries:
    `harmolab.readers.array_files`. HumanML3D's 263 numbers a frame: `harmolab.readers.array_files`. FACT's, LODGE's,
    FineDance's and Motion-X's vectors: `harmolab.readers.smpl`.
``.json``, ``.jsonl``
    MediaPipe's landmarks or COCO-17 key points of a whole video, as AlphaPose, Detectron2, MMPose, OpenPifPaf,
    Ultralytics and ViTPose write them (`harmolab.readers.keypoints`); joints in space. The content tells which.
``.npz`` with ``poses`` or ``pose_body``, ``.pkl``
    SMPL parameters as AMASS, AIST++ and EDGE write them (`harmolab.readers.smpl`); AIST++ keypoints3d
    (`harmolab.readers.aist`); joints in space.
``.bvh``
    any skeleton; `harmolab.readers.bvh`.
``.c3d``
    markers; `harmolab.readers.c3d`.
a folder
    JSON files, one a frame: OpenPose's (`harmolab.readers.keypoints`), or Bailando's ``jsons_original``
    (`harmolab.readers.array_files`).

`read_motion` says beside the motion of which kind a file is and how it was read.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from harmolab.body.skeletons import Skeleton, joint_indices, skeleton_part
from harmolab.files import WRITTEN_BY, MissingFrameRate, PathLike, atomic_write, named_faults, reading
from harmolab.readers.array_files import frame_motion, load_json, load_npy, load_pickle
from harmolab.readers.arrays import SAVING, check_joints, checked_motion, in_metres, npz_names, one_number, read_npz
from harmolab.readers.bvh import read_bvh, save_bvh
from harmolab.readers.c3d import load_c3d
from harmolab.readers.keypoints import (
    BAILANDO_END,
    SAVING_POINTS,
    followed_person,
    frame_files,
    keypoints_motion,
    people_in_frames,
)
from harmolab.readers.motion_file import MotionFile, ReadingKeywords, ReadingOptions, as_read
from harmolab.readers.smpl import MEMBERS, is_parameters, parameter_motion
from harmolab.readers.video import is_video
from harmolab.types import BoolArray, Motion, check_kind

_MEMBERS = {  # array -> its kinds of dtype
    "positions": "fiu", "fps": "fiu", "joints": "U", "parents": "iu", "valid": "b", "units": "U", "offset": "fiu",
    "detected": "b",
}  # fmt: skip
_MOST_SECONDS = 36_000.0  # ten hours: no song begins or ends beyond


def load_motion(
    path: PathLike,
    *,
    fps: float | None = None,
    scale: float | None = None,
    joints: Sequence[str] | None = None,
    smpl: PathLike | None = None,
    up: str = "",
) -> Motion:
    """The movement in a motion file, or in a folder of key points.

    Read are npz, BVH and c3d; SMPL parameters (AMASS, AIST++, EDGE, FACT, LODGE, Motion-X); joints of AIST++ and
    Bailando; the vectors of HumanML3D; key points of COCO-17, Human3.6M, OpenPose or MediaPipe; npy arrays. The content
    tells the kind. `harmolab.readers.motion` has the formats in full, and `read_motion` there also returns notes on how
    a file was read: body, unit, axis, rate.

    Parameters
    ----------
    path : str or path
    fps : float or None, frames per second
        Needed where the file holds no rate (`.npy`, OpenPose, COCO, EDGE). Elsewhere it takes the place of the file's.
    scale : float or None
        Metres in one unit of a 3-D file. None: 1 for `.npz`, 0.01 for AIST++; for BVH see
        `harmolab.readers.bvh.load_bvh`; joints in space without a unit are scaled by the extent of the body.
    joints : sequence of str, optional
        Names of the joints to keep. A joint that is never seen is an error, so leave out the legs of a film that does
        not show them.
    smpl : str or path, optional
        Your own SMPL body, for files of SMPL parameters (`harmolab.readers.smpl.load_body`). When left out, they are
        posed on the neutral skeleton that comes with harmolab.
    up : "y" or "z", optional
        The axis of a 3-D file that points up, where it is not the one that the file, its kind or the body tells.

    Returns
    -------
    Motion: in space metres, y up; in a picture its own units, y down

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.

    Examples
    --------
    >>> motion = load_motion("keypoints.npy", fps=30.0)  # doctest: +SKIP
    """
    return read_motion(path, fps=fps, scale=scale, joints=joints, smpl=smpl, up=up).motion


def read_motion(path: PathLike, *, as_defaults: bool = False, **options: Unpack[ReadingKeywords]) -> MotionFile:
    """As `load_motion`, with the kind of the file and notes on how it was read: units, axes, body, rate.

    With `as_defaults`, `fps`, `smpl` and `up` count only where the file leaves them open.
    """
    file = _load(Path(path), ReadingOptions(**options, as_defaults=as_defaults))
    return file._replace(motion=motion_part(file.motion, options.get("joints"), path))


def motion_part(motion: Motion, joints: Sequence[str] | None, path: PathLike) -> Motion:
    """The motion of these joints only, of all where there are no names; ValueError names file and joints."""
    if joints is None or motion.skeleton.joints == tuple(joints):
        return motion
    with named_faults(path):
        keep = joint_indices(motion.skeleton, joints)
    return Motion(motion.positions[:, keep], motion.fps, skeleton_part(motion.skeleton, keep), motion.valid)


def _load(path: Path, options: ReadingOptions) -> MotionFile:
    """The motion by the reader of its suffix; those that fill unseen joints leave out all but `joints` before."""
    suffix = path.suffix.lower()
    if path.is_dir() and (path / "motion.npz").is_file():
        path, suffix = path / "motion.npz", ".npz"
    elif path.is_dir() and (path / "skeletons.json").is_file():
        raise ValueError(f"{path}: is a sequence of Tang et al.; read it with harmolab.load_recording")
    if path.is_dir():
        return _load_folder(path, options)
    readers = {".bvh": read_bvh, ".npz": _load_npz, ".npy": load_npy, ".pkl": load_pickle, ".pickle": load_pickle}
    readers |= {".json": load_json, ".jsonl": load_json, ".c3d": load_c3d}
    if suffix in readers:
        return readers[suffix](path, options)
    with reading(path, "a motion", max_bytes=None):
        if is_video(path):
            raise ValueError("is a video, no motion file; `harmolab score`, `play`, `lab` and `retime` read videos")
        kinds = ".npz .npy .bvh .pkl .json .c3d are read; export BVH, as Blender does of FBX"
        if suffix in (".csv", ".txt"):
            kinds += f"; of points in a picture {SAVING_POINTS}"
        raise ValueError(f"is no motion file that is known ({suffix or 'no suffix'}); {kinds}, or {SAVING}")


def _load_folder(folder: Path, options: ReadingOptions) -> MotionFile:
    """A folder of OpenPose's, or of Bailando's joints in space."""
    if (files := frame_files(folder))[0].name.endswith(BAILANDO_END):
        return frame_motion(folder, files, options)
    if options.fps is None:
        raise MissingFrameRate(f"{folder}: holds no frame rate; pass fps, such as --fps 25")
    people = people_in_frames(files)
    with named_faults(folder):
        motion = keypoints_motion(followed_person(people), options.fps, joints=options.joints)
        return as_read(motion, "OpenPose key points", options)


def _load_npz(path: PathLike, options: ReadingOptions) -> MotionFile:
    """Our own format, as in the module's docstring, or SMPL parameters."""
    with reading(path, "an .npz motion") as file:
        names = npz_names(file)
        if "positions" not in names and is_parameters(dict.fromkeys(names)):
            return parameter_motion(read_npz(file, dict.fromkeys(MEMBERS, "fiu")), file, options)
        arrays = read_npz(file, _MEMBERS)
        if options.fps is not None:
            arrays.setdefault("fps", np.array(options.fps))
        for name in ("positions", "fps"):
            if name not in arrays:
                raise ValueError(
                    f"has no array {name!r} but {sorted(names)[:8]}; .npz needs positions and fps (or --fps), or "
                    "SMPL's poses and trans"
                )
        positions, rate = arrays["positions"], options.rate(one_number(arrays, "fps"))
        units = str(arrays["units"]) if "units" in arrays else "m"
        if positions.ndim == 3 and positions.shape[2] == 3:
            if options.scale is None and units != "m":
                raise ValueError(f"has positions in {units[:20]!r}; pass scale, the metres in one of them")
            positions = positions if options.scale is None else in_metres(positions, options.scale)
        _offset(arrays)
        return as_read(checked_motion(positions, rate, _skeleton(arrays), arrays.get("valid")), "npz", options)


def load_offset(path: PathLike) -> float | None:
    """Audio time (seconds) of the first frame that an `.npz` motion was made for; None where it holds none.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError where the offset is not one finite number of ten hours at most.
    """
    with reading(path, "an .npz motion") as file:
        return _offset(read_npz(file, {"offset": _MEMBERS["offset"]}))


def load_detected(path: PathLike) -> BoolArray | None:
    """The mask (T, J) of the joints that were detected, of an `.npz` motion; None where it holds none.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "an .npz motion") as file:
        return read_npz(file, {"detected": _MEMBERS["detected"]}).get("detected")


def _offset(arrays: dict[str, NDArray[Any]]) -> float | None:
    """The checked offset among the arrays of an `.npz`, None without one."""
    if "offset" not in arrays:
        return None
    seconds = one_number(arrays, "offset")
    if not abs(seconds) <= _MOST_SECONDS:
        raise ValueError(f"offset must be a number of seconds, ten hours at most, got {seconds:g}")
    return seconds


def _skeleton(arrays: dict[str, NDArray[Any]]) -> Skeleton | None:
    """The skeleton of an `.npz`; joints without names, or without bones, where it holds one of the two only."""
    for name in ("joints", "parents"):
        check_joints(arrays[name].size if name in arrays else 0)
    parts = {name: tuple(arrays[name].ravel().tolist()) for name in ("joints", "parents") if name in arrays}
    return replace(Skeleton.unnamed(len(next(iter(parts.values())))), **parts) if parts else None


def save_motion(
    path: PathLike, motion: Motion, *, offset: float | None = None, detected: BoolArray | None = None, about: str = ""
) -> None:
    """Write a motion to an `.npz` file, or for other programs to a `.bvh` file; whole or not at all.

    From an `.npz` `load_motion` reads the same numbers again, bit by bit. `harmolab.readers.motion` has its layout.
    `harmolab.readers.bvh.save_bvh` says what a `.bvh` keeps.

    Parameters
    ----------
    path : str or path that ends in .npz or .bvh
    motion : Motion
    offset : float, seconds, optional
        Moment of the song at which the motion begins. Only an `.npz` keeps this and what follows.
    detected : (T, J) bool array, optional
        False where a joint was not detected and its place is filled in.
    about : str
        A sentence on where the motion comes from.

    Raises
    ------
    ValueError
        If the name has another ending, the motion has no skeleton that BVH can hold, the offset is no time in a song,
        or `detected` has another shape.
    """
    check_kind(motion, Motion)
    path = Path(path)
    optional: dict[str, Any] = {} if offset is None else {"offset": np.array(offset, np.float64)}
    _offset(optional)
    optional |= {} if detected is None else {"detected": np.asarray(detected, bool)}
    optional |= ({"about": np.array(about)} if about else {}) | {WRITTEN_BY.replace(" ", "_"): np.array(True)}
    if detected is not None and np.shape(detected) != (size := motion.positions.shape[:2]):
        raise ValueError(f"{path}: detected must be {size}, frames and joints, got {np.shape(detected)}")
    if (suffix := path.suffix.lower()) == ".bvh":
        save_bvh(path, motion)
        return
    if suffix != ".npz":
        raise ValueError(f"{path}: motion is saved as .npz or .bvh; choose a name that ends so")
    with atomic_write(path) as part, part.open("wb") as stream:
        np.savez(
            stream,
            positions=motion.positions,
            fps=np.float64(motion.fps),
            joints=np.array(motion.skeleton.joints),
            parents=np.array(motion.skeleton.parents),
            valid=motion.valid,
            units=np.array("m" if motion.positions.shape[2] == 3 else "image"),
            **optional,
        )
