"""The recordings of Tang et al. (2018), in their original layout: one folder with audio, config.json, skeletons.json.

``config.json``
    ``{"start_position", "end_position"}``: the span of the audio that the motion belongs to, in frames at 25 fps.
``skeletons.json``
    ``{"length", "center": (T, 3), "skeletons": (T, 23, 3)}``: 25 fps, centimetres, y up, left-handed; the skeletons
    are relative to the centre.

Properties of the recordings, and how the loader meets them:

* The recordings are spliced from reused units; six steps of a straight line join two units. The six frames that such a
  line leads to are no recorded movement: `Motion.valid` is False there.
* The units were recorded at other places, so the floor climbs and falls by up to half a metre from unit to unit. Each
  unit is set back on the floor by one constant, which changes no speed inside a unit.
* The motion runs 1.0 to 1.5 % fast against the music: `clock=1.013` stretches it. Off by default.
* Most motions are up to 56 frames shorter than the span in config.json. A motion of quite another length belongs to
  another frame rate (a second copy of this corpus is around that has one) and is refused.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from harmolab.io.arrays import checked_motion, in_metres, number_array
from harmolab.io.files import MAX_JSON_BYTES, PathLike, read_json, reading
from harmolab.types import BoolArray, FloatArray, Motion, Skeleton

FPS = 25.0

_JOINTS = (
    *("left_head", "right_head", "torso", "left_shoulder", "left_elbow", "left_forearm", "left_hand"),
    *("left_hip", "left_knee", "left_ankle", "left_heel", "left_toe"),
    *("right_shoulder", "right_elbow", "right_wrist", "right_finger"),
    *("right_hip", "right_knee", "right_ankle", "right_heel", "right_toe", "right_forearm", "left_finger"),
)
_PARENTS = (3, 12, -1, 2, 3, 4, 5, 2, 7, 8, 9, 9, 2, 12, 21, 14, 2, 16, 17, 18, 18, 13, 6)

TANG_23 = Skeleton(_JOINTS, _PARENTS)
# The harmony paper's joints are the first 21; its right wrist hangs on the elbow.
PAPER_21 = Skeleton(_JOINTS[:21], tuple(13 if parent == 21 else parent for parent in _PARENTS[:21]))

_DANCES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}

# Positions are rounded to 1e-5 m, so a straight line bends by up to 4e-5 m. A dancer bends more in every frame.
_STRAIGHT_METRES, _MOVING_METRES = 5e-5, 1e-3
# A splice of 6 steps has 5 frames without acceleration; retimed copies have 3 to 8.
_SPLICE_FRAMES = (3, 8)
# Shares of the span in config.json between which a motion's length is believed.
_SPAN_SHARES = (0.9, 1.02)


class SpanFrames(NamedTuple):
    """The span of the audio that was danced, in frames at 25 fps."""

    start: int
    end: int


def dance_of(folder: PathLike) -> str:
    """The dance by the letter in a folder's name (``DANCE_W_12`` is a waltz), or ""."""
    match = re.match(r"DANCE_([A-Z])(_|$)", Path(folder).name)
    return _DANCES.get(match[1], "") if match else ""


def find_audio(folder: PathLike) -> Path:
    """The file audio.wav, .flac, .ogg or .mp3 of a folder; FileNotFoundError if there is none."""
    paths = [Path(folder) / f"audio.{suffix}" for suffix in ("wav", "flac", "ogg", "mp3")]
    for path in filter(Path.is_file, paths):
        return path
    raise FileNotFoundError(f"{folder}: has no audio.wav, .flac, .ogg or .mp3")


def load_danced(
    folder: Path, *, clock: float = 1.0, points: int = 23, travel: bool = True, ground: bool = True
) -> tuple[Motion, float]:
    """The motion of one folder and the audio time of its first frame, start_position / 25 fps, in seconds.

    Parameters
    ----------
    folder : Path
    clock, points, travel, ground
        As in `load_skeletons`.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. A motion whose length does not fit config.json is an error.
    """
    span = load_config(folder / "config.json")
    motion = load_skeletons(folder / "skeletons.json", clock=clock, points=points, travel=travel, ground=ground)
    share = motion.n_frames / (span.end - span.start)
    if not _SPAN_SHARES[0] <= share <= _SPAN_SHARES[1]:
        raise ValueError(
            f"{folder / 'skeletons.json'}: has {motion.n_frames} frames, config.json spans {span.end - span.start} at "
            f"25 fps; this copy seems to have another frame rate ({FPS * share:.1f} fps would fit)"
        )
    return motion, span.start / FPS


def load_config(path: PathLike) -> SpanFrames:
    """The danced span in a config.json, in frames at 25 fps."""
    with reading(path, "a config.json", max_bytes=2**20) as file:
        content = read_json(file)
        values = content if isinstance(content, dict) else {}
        start, end = values.get("start_position"), values.get("end_position")
        if not isinstance(start, int) or not isinstance(end, int):
            raise ValueError("needs the whole numbers start_position and end_position (frames at 25 fps)")
        # Ten hours: beyond, these are no frames.
        if not 0 <= start < end <= 36_000 * FPS:
            raise ValueError(f"the motion must end after it starts, got {start} to {end} frames")
        return SpanFrames(start, end)


def load_skeletons(
    path: PathLike, *, clock: float = 1.0, points: int = 23, travel: bool = True, ground: bool = True
) -> Motion:
    """The motion in a skeletons.json: metres, y up, right-handed, splices marked as not valid.

    Parameters
    ----------
    path : str or path
    clock : float
        Time stretch of the motion: 1.013 makes it 1.3 % longer.
    points : 23 or 21
        All joints, or those of the harmony paper (without right forearm and left finger).
    travel : bool
        False: the pose only, without the dancer's way through the room. This is what the harmony paper's numbers were
        computed from.
    ground : bool
        Set every unit back on the floor (y = 0). Without effect if `travel` is False.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    if points not in (21, 23):
        raise ValueError(f"points must be 23 (all) or 21 (the paper's), got {points}")
    if not 0.5 <= clock <= 2.0:
        raise ValueError(f"clock is a time stretch near 1, got {clock}")
    with reading(path, "a skeletons.json", max_bytes=MAX_JSON_BYTES) as file:
        poses, centre = _content(read_json(file))
        world = in_metres(poses + centre[:, None], 0.01)
        first, last = splice_steps(world)
        valid = np.ones(len(world), bool)
        for before, after in zip(first, last, strict=True):
            valid[before + 1 : after + 1] = False
        positions = world if travel else in_metres(poses, 0.01)
        if travel and ground:
            positions = on_the_floor(world, first, last)
        # Left-handed to right-handed.
        positions = positions * (1.0, 1.0, -1.0)
        return checked_motion(positions[:, :points], FPS / clock, TANG_23 if points == 23 else PAPER_21, valid)


def _content(content: Any) -> tuple[FloatArray, FloatArray]:
    """Poses (T, 23, 3) and centres (T, 3), centimetres."""
    if not isinstance(content, dict) or not {"skeletons", "center"} <= set(content):
        raise ValueError("needs the lists 'skeletons' and 'center'")
    poses = number_array(content["skeletons"], "skeletons", (None, 23, 3))
    centre = number_array(content["center"], "center", (len(poses), 3))
    if content.get("length", len(poses)) != len(poses):
        raise ValueError(f"says length {content['length']!r}, but holds {len(poses)} frames: cut off?")
    for name, values in (("skeletons", poses), ("center", centre)):
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            joint = f", joint {bad[0][1]} ({TANG_23.joints[bad[0][1]]})" if values is poses else ""
            raise ValueError(f"{name} hold NaN or infinity at frame {bad[0][0]}{joint}")
    # A body that is a kilometre long, or that far away, is damaged; sums of such numbers are not safe either.
    if len(poses) and max(np.abs(poses).max(), np.abs(centre).max()) > 1e5:
        raise ValueError("has positions over 1 km; centimetres are expected")
    return poses, centre


def splice_steps(positions: FloatArray) -> tuple[list[int], list[int]]:
    """The last frame before and the first frame after each straight line that joins two units.

    A line shows as three to eight frames in a row in which no joint accelerates although the body moves.

    Parameters
    ----------
    positions : (T, J, 3) array, metres

    Returns
    -------
    two lists of frame indices, equally long; the frames strictly between lie on the line
    """
    if len(positions) < 3:
        return [], []
    straight = np.abs(np.diff(positions, n=2, axis=0)).max(axis=(1, 2)) < _STRAIGHT_METRES
    moving = np.abs(np.diff(positions, axis=0)).max(axis=(1, 2))[1:] > _MOVING_METRES
    shortest, longest = _SPLICE_FRAMES
    runs = [(first, last) for first, last in true_runs(straight & moving) if shortest <= last - first <= longest]
    return [first for first, _ in runs], [last + 1 for _, last in runs]


def true_runs(mask: BoolArray) -> list[tuple[int, int]]:
    """(first, one behind last) index of each run of True in a (T,) mask."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def on_the_floor(positions: FloatArray, first: list[int], last: list[int]) -> FloatArray:
    """`positions` with every unit between splices shifted so that the median of its lowest point is at y = 0.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up
    first, last : frame indices as `splice_steps` gives them; the shift changes along the line between them
    """
    lowest = positions[:, :, 1].min(axis=1)
    starts, ends = [0, *last], [*first, len(positions) - 1]
    frames = np.array([frame for unit in zip(starts, ends, strict=True) for frame in unit])
    floor = [float(np.median(lowest[start : end + 1])) for start, end in zip(starts, ends, strict=True)]
    shift = np.interp(np.arange(len(positions)), frames, np.repeat(floor, 2))
    return positions - shift[:, None, None] * np.array([0.0, 1.0, 0.0])
