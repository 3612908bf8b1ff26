"""Key points of musicians: body and hands, with their confidence, from the files of pose estimators.

`harmolab.io.player_layouts` says which files. Of several people in a picture, the musician is followed as
`harmolab.io.keypoints` follows a dancer. Left and right are the player's: in a mirrored picture (as front cameras make)
an estimator names the mirror image's, and the keys run the wrong way, so ``mirrored`` turns both back.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from harmolab.io import layouts
from harmolab.io.arrays import checked_motion
from harmolab.io.files import MAX_JSON_BYTES, MissingFrameRate, PathLike, read_json, reading
from harmolab.io.keypoints import filled_points, followed_person, frame_files
from harmolab.io.layouts import OPENPOSE
from harmolab.io.player_layouts import (
    COMPARED,
    EXTRAS,
    NAMES,
    by_name,
    checked_size,
    is_player_landmarks,
    mirrored_names,
    picture_scale,
    player_landmarks,
    player_pose,
    surer,
)
from harmolab.io.player_points import player_skeleton
from harmolab.types import BoolArray, FloatArray, Motion

SURE = 0.3  # confidence from which on a point counts as detected
LEAST_SHARE = 0.1  # of the frames; a point that is detected in fewer is left out
_FRAME_BYTES = 64 * 2**20

# function(frame, (left, top, right, bottom)) -> True where the person in that box of that frame is the musician
IsMusician = Callable[[int, tuple[float, float, float, float]], bool]


class PlayerPoints(NamedTuple):
    """Tracked points of a musician.

    Parameters
    ----------
    motion : Motion, (T, P, 2) image coordinates, y down, with the names of `PLAYER_50`
        Gaps are filled by straight lines. A frame in which nothing is detected is not valid.
    confidence : (T, P) array, as the estimator gives it, mostly 0 to 1
    detected : (T, P) mask, False where a point's place is filled in
    """

    motion: Motion
    confidence: FloatArray
    detected: BoolArray


class _Source(NamedTuple):
    """Points of one file: (T, 52, 3) x, y, confidence, its frame rate if it has one, and True for pixels."""

    points: FloatArray
    fps: Any
    is_pixels: bool


def load_player_points(
    paths: PathLike | Sequence[PathLike],
    *,
    fps: float | None = None,
    default_fps: float | None = None,
    size: tuple[float, float] | None = None,
    mirrored: bool | None = None,
    sure: float = SURE,
    least: float = LEAST_SHARE,
    extras: Sequence[str] = (),
    is_musician: IsMusician | None = None,
) -> PlayerPoints:
    """The points of one musician from `.json`, `.jsonl` or the folder that OpenPose wrote; or from several of these.

    Of several files of one video, each point in each frame is taken from the file that is surer of it.

    Parameters
    ----------
    paths : str or path, or several
    fps, default_fps : float, frames per second: in place of what the file says, and where it says nothing
    size : width and height of the picture in pixels; for MediaPipe's files that do not hold it, and for `mirrored`
    mirrored : bool, the picture is a mirror image; default what the file says, else False
    sure : float, least confidence of a point that counts as detected
    least : float, share of frames; a point that is detected in fewer is left out
    extras : of "nose" and "neck", those to keep
    is_musician : function(frame, box) -> bool, such as the signature of a face; it is asked of every person that a
        file of people holds, before one is followed. Default: everybody may be the musician.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError also for files of different lengths or units.
    """
    files = [Path(paths)] if isinstance(paths, str | os.PathLike) else [Path(path) for path in paths]
    if not files:
        raise ValueError("no file of key points is named")
    sources = [_source(file, size, mirrored, is_musician) for file in files]
    rate = next((rate for rate in (fps, *(source.fps for source in sources), default_fps) if rate is not None), None)
    if rate is None:
        raise MissingFrameRate(f"{files[0]}: holds key points but no frame rate; pass fps, such as --fps 25")
    _check_alike(files, sources)
    try:
        points = reduce(surer, (source.points for source in sources))
        return player_points(points, NAMES, rate, sure=sure, least=least, extras=extras)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{', '.join(map(str, files))}: {error}") from None


def player_points(
    points: FloatArray,
    names: tuple[str, ...],
    fps: Any,
    *,
    sure: float = SURE,
    least: float = LEAST_SHARE,
    extras: Sequence[str] = (),
) -> PlayerPoints:
    """The points of a musician from an array of them; gaps are filled, points that are hardly ever detected left out.

    Parameters
    ----------
    points : (T, P, 3) array: x, y, confidence; a place of NaN is not detected
    names : the P names, of which those of `PLAYER_50` and of `extras` are kept
    fps : frames per second
    sure, least, extras : as in `load_player_points`

    Raises
    ------
    ValueError
        No point is detected in enough frames; a rate, a name or a value cannot be.
    """
    if unknown := set(extras) - set(EXTRAS):
        raise ValueError(f"extras are of {', '.join(EXTRAS)}, got {', '.join(map(str, unknown))}")
    rows = by_name(points, names)
    is_detected = (rows[..., 2] >= max(sure, 1e-9)) & ~np.isnan(rows).any(axis=2)
    optional = set(EXTRAS) - set(extras)
    shares = is_detected.mean(axis=0) if len(rows) else np.zeros(len(NAMES))
    keep = [number for number, name in enumerate(NAMES) if name not in optional and 0 < shares[number] >= least]
    if not keep:
        raise ValueError(f"no point of a musician is detected in {least:.0%} or more of its {len(rows)} frames")
    skeleton, detected = player_skeleton([NAMES[number] for number in keep]), is_detected[:, keep]
    with np.errstate(over="ignore", invalid="ignore"):  # places out of all bounds, which the motion's check refuses
        places = filled_points(rows[:, keep, :2], detected, skeleton)
    motion = checked_motion(places, fps, skeleton, np.asarray(detected.any(axis=1)))
    return PlayerPoints(motion, np.nan_to_num(rows[:, keep, 2]), detected)


def _source(
    path: Path, size: tuple[float, float] | None, mirrored: bool | None, is_musician: IsMusician | None
) -> _Source:
    """The points of one file or folder, the player's left being left."""
    about: Mapping[str, Any] = {} if size is None else {"size": checked_size(size)}
    if path.is_dir():
        points = _folder_points(path, is_musician)
        return _Source(_unmirrored(points, about, bool(mirrored), 0.0), None, True)
    if path.suffix.lower() not in (".json", ".jsonl"):
        raise ValueError(f"{path}: key points of musicians are read from .json, .jsonl and folders of OpenPose")
    with reading(path, "key points", max_bytes=MAX_JSON_BYTES):
        content = layouts.json_or_lines(path)
        about = {**(content if isinstance(content, dict) else {}), **about}
        turn = about.get("mirrored", False) if mirrored is None else mirrored
        if not isinstance(turn, bool):
            raise ValueError(f"mirrored must be true or false, got {str(turn)[:30]!r}")
        if not is_player_landmarks(content):
            people = layouts.people_by_frame(content, player_pose)
            return _Source(_unmirrored(_musician(people, is_musician), about, turn, 0.0), about.get("fps"), True)
        (width, height), is_pixels = picture_scale(about)
        with np.errstate(over="ignore"):
            points = player_landmarks(content) * [width, height, 1.0]
        return _Source(_unmirrored(points, {}, turn, width), about.get("fps"), is_pixels)


def _folder_points(folder: Path, is_musician: IsMusician | None) -> FloatArray:
    """(T, 52, 3) of OpenPose's JSON files, one a frame in the order of their numbers."""
    frames = []
    for path in frame_files(folder):
        with reading(path, "an OpenPose frame", max_bytes=_FRAME_BYTES):
            frames.append(layouts.entry_poses(read_json(path), OPENPOSE, "frame", player_pose))
    try:
        return _musician(frames, is_musician)
    except ValueError as error:
        raise ValueError(f"{folder}: {error}") from None


def _musician(frames: Sequence[Sequence[FloatArray]], is_musician: IsMusician | None) -> FloatArray:
    """(T, 52, 3) of the musician among the people of every frame."""
    if is_musician is not None:
        frames = [
            [pose for pose in people if (pose[:, 2] > 0).any() and is_musician(frame, _box(pose))]
            for frame, people in enumerate(frames)
        ]
    has_body = any((pose[COMPARED, 2] > 0).any() for people in frames for pose in people)
    return followed_person(frames, COMPARED if has_body else slice(None))


def _box(pose: FloatArray) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a person's detected points."""
    places = pose[pose[:, 2] > 0, :2]
    return (*map(float, places.min(axis=0)), *map(float, places.max(axis=0)))  # type: ignore[return-value]


def _unmirrored(points: FloatArray, about: Mapping[str, Any], mirrored: bool, width: float) -> FloatArray:
    """(T, 52, 3) points as they are, or of a mirrored picture turned back, with left and right exchanged.

    The picture's width is that of "size" in `about`, else `width`; from another one the points are shifted as a whole.
    """
    if not mirrored:
        return points
    if about.get("size") is not None:
        width = checked_size(about["size"])[0]
    turned = points[:, mirrored_names()]
    turned[..., 0] = np.where(turned[..., 2] > 0, width - turned[..., 0], 0.0)
    return turned


def _check_alike(files: Sequence[Path], sources: Sequence[_Source]) -> None:
    """ValueError unless all sources have as many frames, and one unit."""
    for file, source in zip(files, sources, strict=True):
        if len(source.points) != len(sources[0].points):
            counts = f"{len(source.points)} frames, {files[0].name} {len(sources[0].points)}"
            raise ValueError(f"{file}: has {counts}; points are merged of files of one video")
        if source.is_pixels != sources[0].is_pixels:
            raise ValueError(f'{file}: has another unit than {files[0].name}: write "size" into MediaPipe\'s file')
