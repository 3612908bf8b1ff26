"""Biovision files (`.bvh`) to Motion by forward kinematics, and Motion to `.bvh` by rotations fitted to positions.

Files are read with any skeleton and any order of channels:

* Rotations apply in the order in which the channels are written: `Zrotation Yrotation Xrotation` is Rz Ry Rx. Degrees.
* Position channels give the joint's place in its parent's frame, in place of OFFSET (for the root: in the world); a
  joint whose positions are all 0 stays at its OFFSET, as in files that write what is added to it.
* An `End Site` becomes a joint named `<parent>_end`; one at OFFSET 0 0 0 is the parent's own place and adds none.
* BVH says nothing about its unit. A rest skeleton that extends over more than 1000 units is taken for millimetres, over
  more than 3 for centimetres, else for metres. A body from head to feet of up to 45 units is taken for one of the CMU
  files, which are in units of 5.6 cm. Pass `scale` where it is wrong.
* A root that stays at one place while a joint on it travels, as rigs and the Bandai-Namco files have it, is no part of
  the body and left out, with what stands at it (Unreal's ik bones).
* Nor does it tell which axis points up: the way from the feet to the head does (Blender writes z up), else it is y.
* A Frame Time that is rounded is that of the usual rate: 0.033 means 30 frames per second; at 30.3 a dance would be
  half a beat off after half a minute.

Files are written so that Blender opens them and our own reader takes them back to the same places. A BVH holds
rotations, a Motion holds places. Going down the tree, each joint is turned so that its children come to lie where they
are: the best rotation of all children at once (Kabsch 1976), the shortest one where twist is free.

* The rest skeleton has the first frame's attitude and every bone's mean length. It is written in centimetres, or in
  metres where it extends over no more than 45 cm, because readers guess the unit by the size.
* A child that no rotation of its parent can reach (a bone that stretches, or children that do not keep together as the
  shoulders and hips of a soft torso do not) gets position channels of its own beside the rotations.
* Several trees (a player, a violin, a bow) hang on one more joint, `WORLD`, that rests at the origin: few readers take
  a second ROOT.
* A joint without children ends in an `End Site` at OFFSET 0 0 0, in which our reader sees no further joint.

Which frames are valid is not kept: BVH has no place for it. The log says how many are not.
"""

import itertools
import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from harmolab.body.rotations import alignment, mean_shape
from harmolab.body.skeletons import Skeleton, ancestors, children, skeleton_part, subtree, tree_order
from harmolab.files import PathLike, atomic_write, named_faults, read_text, reading
from harmolab.readers.arrays import checked_motion, in_metres
from harmolab.readers.motion_file import LOG, Assumption, MotionFile, ReadingOptions, as_read, head_above_feet
from harmolab.types import BoolArray, FloatArray, IntArray, Motion

_CHANNELS = ("xposition", "yposition", "zposition", "xrotation", "yrotation", "zrotation")
_HEAD = re.compile(r"\s*frames\s*:\s*(\S+)\s+frame\s+time\s*:\s*(\S+)\s", re.IGNORECASE)
_MAX_BYTES, _MAX_HEAD, _MAX_JOINTS, _MAX_NAME, _MAX_PLACES = 256 * 2**20, 4 * 2**20, 2000, 200, 2**24
_BLOCK_PLACES = 2**17
_UNITS = ((1000.0, 0.001), (3.0, 0.01))  # extent at rest, in units of the file, above which a unit is so many metres
_BODY_UNITS = ((1000.0, 0.001), (45.0, 0.01), (3.0, 0.056444))  # the same with head and feet
_TRAVEL = 0.05  # share of its distance from the root by which a joint is not joined to it
_AT_ROOT = 0.01  # share of the farthest joint's distance up to which a joint stands at the root
_USUAL_RATES = (24, 25, 30, 48, 50, 60, 90, 100, 120, 240, 23.976, 29.97, 59.94, 119.88)  # frames per second


@dataclass
class _Joint:
    """One joint while the file is read."""

    name: str
    parent: int
    is_end: bool = False
    offset: FloatArray = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()


def load_bvh(path: PathLike, *, fps: float | None = None, scale: float | None = None) -> Motion:
    """The movement in a BVH file.

    Parameters
    ----------
    path : str or path
    fps : float or None, frames per second
        None: from the file's Frame Time.
    scale : float or None, metres in one unit of the file
        None: by the extent of the rest skeleton, as above.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    return read_bvh(path, ReadingOptions(fps, scale)).motion


def read_bvh(path: PathLike, options: ReadingOptions) -> MotionFile:
    """As `load_bvh`, with notes on unit and axis."""
    with reading(path, "a BVH motion", max_bytes=_MAX_BYTES) as file:
        head, keyword, table = read_text(file).partition("MOTION")
        if not keyword or not head.lstrip()[:9].upper() == "HIERARCHY" or len(head) > _MAX_HEAD:
            raise ValueError("is no BVH motion: it needs a HIERARCHY and a MOTION")
        joints = _hierarchy(head.split())
        values, step = _table(table, sum(len(joint.channels) for joint in joints))
        if len(values) * len(joints) > _MAX_PLACES:
            raise ValueError(f"has {len(values)} frames of {len(joints)} joints; cut it into parts")
        factor, unit = _guessed_scale(joints)
        if options.scale is not None:
            factor, unit = options.scale, f"{options.scale:g} m a unit (as passed)"
        skeleton = Skeleton(tuple(joint.name for joint in joints), tuple(joint.parent for joint in joints))
        # Angles and offsets out of all bounds end as infinity, which is refused by frame and joint.
        with np.errstate(over="ignore", invalid="ignore"):
            positions = _positions(joints, values)
        rate, guess = _rate(step, options)
        motion, left_out = _without_rig(checked_motion(in_metres(positions, factor), rate, skeleton))
        return as_read(motion, "BVH", options, unit, *guess, *left_out, is_open=True)


def _without_rig(motion: Motion) -> tuple[Motion, tuple[Assumption, ...]]:
    """The motion without a root that stays at one place while a joint that hangs on it travels, and a note.

    Other joints may stand at the root, as Unreal's ik_foot_root does; they are left out with all that hangs on them.
    """
    joints, parents, places = motion.skeleton.joints, motion.skeleton.parents, motion.positions
    if (places[:, 0] != places[0, 0]).any():
        return motion, ()
    below, distances = children(parents)[0], np.linalg.norm(places - places[0, 0], axis=2)
    farthest = distances.max(axis=0)
    away = [joint for joint in below if farthest[joint] > _AT_ROOT * farthest.max()] or below
    if len(away) != 1 or np.ptp(distances[:, away]) <= _TRAVEL * farthest[away[0]]:
        return motion, ()
    rig = set(subtree(parents, 0)) - set(subtree(parents, away[0]))
    body = [joint for joint in range(len(joints)) if joint not in rig]
    sentence = f"{joints[0]} stays where it is while {joints[away[0]]} travels"
    without = f"without {', '.join(joints[joint] for joint in sorted(rig))}: {sentence}"
    rest = Motion(places[:, body], motion.fps, skeleton_part(motion.skeleton, body))
    return rest, (Assumption(without, "root of a rig left out"),)


def _hierarchy(words: list[str]) -> list[_Joint]:
    """The joints, parents before children, from the words before MOTION."""
    joints, open_joints, stream = list[_Joint](), list[int](), iter(words[1:])
    for word in stream:
        key = word.upper()
        if key in ("ROOT", "JOINT", "END"):
            _open_joint(key, _name(stream), joints, open_joints)
        elif key == "}" and open_joints:
            open_joints.pop()
        elif key in ("OFFSET", "CHANNELS") and open_joints:
            _fill_joint(key, joints[open_joints[-1]], stream)
        else:
            raise ValueError(f"cannot follow the hierarchy at {word[:40]!r}")
    if not joints or open_joints:
        raise ValueError("the hierarchy is cut off" if open_joints else "the hierarchy has no ROOT")
    return _without_empty_ends(joints)


def _without_empty_ends(joints: list[_Joint]) -> list[_Joint]:
    """The joints but for End Sites at their parent's own place; `parent` counts in what is left."""
    kept = [not joint.is_end or bool(joint.offset.any()) for joint in joints]
    numbers = [*(np.cumsum(kept) - 1).tolist(), -1]  # the last is that of the root's parent
    for joint in joints:
        joint.parent = numbers[joint.parent]
    return list(itertools.compress(joints, kept))


def _name(stream: Iterator[str]) -> str:
    """The words up to the opening bracket: the name of a joint."""
    name = " ".join(itertools.takewhile(lambda word: word != "{", stream)) or "joint"
    if len(name) > _MAX_NAME:
        raise ValueError(f"has a joint with a name of {len(name)} letters; shorten it to {_MAX_NAME} at most")
    return name


def _open_joint(kind: str, name: str, joints: list[_Joint], open_joints: list[int]) -> None:
    """Append a joint below the innermost open one."""
    if kind == "ROOT" and joints:
        raise ValueError(f"holds a second skeleton ({name[:40]!r}); write one file for each")
    if kind != "ROOT" and not open_joints:
        raise ValueError(f"{kind} {name[:40]} stands outside of the skeleton")
    if len(joints) >= _MAX_JOINTS:
        raise ValueError(f"has more than {_MAX_JOINTS} joints")
    parent = open_joints[-1] if open_joints else -1
    joints.append(_Joint(f"{joints[parent].name}_end" if kind == "END" else name, parent, is_end=kind == "END"))
    open_joints.append(len(joints) - 1)


def _fill_joint(key: str, joint: _Joint, stream: Iterator[str]) -> None:
    """Read OFFSET or CHANNELS into a joint."""
    if key == "OFFSET":
        joint.offset = np.array([_number(stream, f"OFFSET of {joint.name}") for _ in range(3)])
        return
    count = _number(stream, f"CHANNELS of {joint.name}")
    if count not in range(7):
        raise ValueError(f"joint {joint.name[:40]!r} has {count:g} channels; 0 to 6 are possible")
    names = tuple(next(stream, "").lower() for _ in range(int(count)))
    if joint.channels or len(set(names)) < len(names) or not set(names) <= set(_CHANNELS):
        raise ValueError(f"joint {joint.name[:40]!r} has channels {names}; known are {', '.join(_CHANNELS)}, once each")
    joint.channels = names


def _number(stream: Iterator[str], where: str) -> float:
    """The next word as a finite number."""
    word = next(stream, "")
    try:
        number = float(word)
    except ValueError:
        raise ValueError(f"{where[:60]} must be a number, got {word[:40]!r}") from None
    if not math.isfinite(number):
        raise ValueError(f"{where[:60]} must be finite, got {word[:40]!r}")
    return number


def _table(text: str, channels: int) -> tuple[FloatArray, float]:
    """The motion table (T, channels), and the Frame Time in seconds, from the text behind MOTION."""
    head = _HEAD.match(text)
    if head is None:
        raise ValueError("has no lines 'Frames:' and 'Frame Time:' behind MOTION")
    frames, step = (_number(iter([head[i]]), name) for i, name in ((1, "Frames"), (2, "Frame Time")))
    if step <= 0:
        raise ValueError(f"Frame Time must be positive, got {step:g}")
    if channels == 0:
        raise ValueError("no joint has a channel, so nothing moves")
    values = _numbers(text[head.end() :])
    if values.size not in (frames * channels, (frames + 1) * channels):  # Rokoko promises one frame less than there are
        raise ValueError(
            f"promises {frames:g} frames of {channels} numbers, but {values.size} numbers follow: cut off or damaged"
        )
    return values.reshape(-1, channels), step


def _rate(step: float, options: ReadingOptions) -> tuple[float, tuple[Assumption, ...]]:
    """Frames per second, of a Frame Time unless passed, and a note where it is the rounded one of a usual rate."""
    digits = len(repr(step).partition(".")[2])
    usual = [rate for rate in _USUAL_RATES if abs(rate * step - 1) > 3e-5 and round(1 / rate, digits) == step]
    if not usual or (1 / step).is_integer() or not (options.fps is None or options.as_defaults):
        return options.rate(1 / step), ()
    reason = f"guessed: {step:g} s a frame is rounded; --fps overrules it"
    return usual[0], (Assumption(f"{usual[0]} frames a second ({reason})", "frame rate guessed: it is rounded"),)


def _numbers(text: str) -> FloatArray:
    """All numbers of a text."""
    with warnings.catch_warnings(action="error"):  # at a word that is no number, older numpy only warns
        try:
            return np.fromstring(text, sep=" ")
        except (DeprecationWarning, ValueError):
            raise ValueError("holds something else than numbers in its motion table") from None


def _guessed_scale(joints: list[_Joint]) -> tuple[float, str]:
    """Metres in one unit, by the extent of the rest skeleton, and a sentence."""
    rest = ancestors([joint.parent for joint in joints]) @ np.array([joint.offset for joint in joints])
    extent = np.ptp(rest, axis=0).max()
    is_body = head_above_feet(np.zeros((1, *rest.shape)), [joint.name for joint in joints]) is not None
    limit, factor = next((row for row in (_BODY_UNITS if is_body else _UNITS) if extent > row[0]), (3.0, 1.0))
    size = f"its rest skeleton {'is' if factor < 1 else 'is not'} larger than {limit:g} units"
    size = f"the body extends over {extent:.4g} units at rest" if is_body else size
    reason = f"guessed: {size}; --scale overrules it"
    return factor, Assumption(f"{factor:g} m a unit ({reason})", f"unit guessed: {factor:g} m")


def _positions(joints: list[_Joint], values: FloatArray) -> FloatArray:
    """Places of all joints (T, J, 3); in blocks of frames, because the rotations take much more room."""
    positions = np.empty((len(values), len(joints), 3))
    step = max(1, _BLOCK_PLACES // len(joints))
    for first in range(0, len(values), step):
        block = values[first : first + step]
        places = positions[first : first + step]
        rotations = np.empty((len(joints), len(block), 3, 3))
        tables = np.split(block, np.cumsum([len(joint.channels) for joint in joints])[:-1], axis=1)
        for index, (joint, columns) in enumerate(zip(joints, tables, strict=True)):
            local, turn = _translation(joint, columns), _rotation(joint, columns)
            if joint.parent >= 0:
                above = rotations[joint.parent]
                local = places[:, joint.parent] + (above @ local[..., None])[..., 0]
                turn = above @ turn
            places[:, index], rotations[index] = local, turn
    return positions


def _translation(joint: _Joint, values: FloatArray) -> FloatArray:
    """Place of a joint in its parent's frame, (T, 3), from its channels (T, C)."""
    local = np.tile(joint.offset, (len(values), 1))
    columns = {axis: joint.channels.index(name) for axis, name in enumerate(_CHANNELS[:3]) if name in joint.channels}
    if joint.parent < 0 or values[:, list(columns.values())].any():
        local[:, list(columns)] = values[:, list(columns.values())]
    return local


def _rotation(joint: _Joint, values: FloatArray) -> FloatArray:
    """Rotation of a joint against its parent, (T, 3, 3), from its channels (T, C)."""
    columns = [column for column, name in enumerate(joint.channels) if name.endswith("rotation")]
    if not columns:
        return np.tile(np.eye(3), (len(values), 1, 1))
    axes = "".join(joint.channels[column][0].upper() for column in columns)  # capitals: about the turned axes
    return Rotation.from_euler(axes, values[:, columns], degrees=True).as_matrix()


# Motion to `.bvh`

# Metres by which a joint may miss its place before it gets position channels.
REACH = 2e-5
WORLD = "world"
ROTATIONS = "Zrotation Xrotation Yrotation"
POSITIONS = "Xposition Yposition Zposition"
# Metres above which a rest skeleton is written in centimetres: a smaller body in them would be read in units of CMU.
CENTIMETRES_FROM = 0.45


class _Bones(NamedTuple):
    """The joints as a BVH has them, each array in the order of the skeleton's joints.

    Parameters
    ----------
    offsets : (J, 3), metres; the root's is 0
    local : (T, J, 3), metres, place in the parent's frame (of the root: in the world)
    turns : (T, J, 3), degrees, about z, x and y in turn
    moving : (J,) bool, which need position channels
    """

    offsets: FloatArray
    local: FloatArray
    turns: FloatArray
    moving: BoolArray


def save_bvh(path: PathLike, motion: Motion) -> None:
    """Write a motion as BVH; the file appears whole or not at all.

    `load_bvh` gives every joint back by its name, within 0.1 mm. The joints come in another order where the skeleton
    does not list them branch by branch; what BVH cannot have in a name (a bracket, a colon) becomes "_".

    Parameters
    ----------
    path : str or path
    motion : Motion, (T, J, 3) metres
        Its skeleton must have bones; several trees come to hang on a joint called `WORLD`.

    Raises
    ------
    ValueError
        For a motion in image coordinates, or a skeleton without bones or with a ring of bones.
    """
    path = Path(path)
    if motion.positions.shape[2] != 3:
        raise ValueError(f"{path}: BVH holds movement in space; this motion is in image coordinates")
    roots = motion.skeleton.parents.count(-1)
    if not roots or not motion.skeleton.bones:
        raise ValueError(
            f"{path}: BVH needs bones that hang on a root; this skeleton has {len(motion.skeleton.joints)} joints and "
            f"{roots} roots; save it as .npz"
        )
    motion = motion if roots == 1 else _one_tree(motion)
    skeleton = motion.skeleton
    with named_faults(path):
        order = tree_order(skeleton.parents)
    bones = _fitted(motion, order, root_rests=roots > 1)
    above = ancestors(skeleton.parents)
    scale = 100.0 if np.ptp(above @ bones.offsets, axis=0).max() > CENTIMETRES_FROM else 1.0
    with atomic_write(path) as part, part.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _hierarchy_text(skeleton, order, above.sum(axis=1) - 1, bones, scale))
        stream.write(f"MOTION\nFrames: {motion.n_frames}\nFrame Time: {1 / motion.fps!r}\n")
        np.savetxt(stream, _motion_text(bones, order, scale), fmt="%.6f")
    if lost := int((~motion.valid).sum()):
        LOG.info("%s: BVH cannot say that %d frames are filler; they count as movement", path, lost)


def _one_tree(motion: Motion) -> Motion:
    """The motion with a joint at the origin, `WORLD`, last in the list, on which all its trees hang."""
    count = len(motion.skeleton.joints)
    parents = [count if parent < 0 else parent for parent in motion.skeleton.parents]
    positions = np.pad(motion.positions, ((0, 0), (0, 1), (0, 0)))
    return Motion(positions, motion.fps, Skeleton((*motion.skeleton.joints, WORLD), (*parents, -1)), motion.valid)


def _fitted(motion: Motion, order: tuple[int, ...], *, root_rests: bool) -> _Bones:
    """Offsets and rotations, each fitted to where the joints above have come to lie, so that no error adds up.

    A root that rests is not turned.
    """
    places, below = motion.positions, children(motion.skeleton.parents)
    root = order[0]
    offsets, turns = np.zeros(places.shape[1:]), np.zeros(places.shape)
    local, reached = np.zeros(places.shape), np.zeros(places.shape)
    local[:, root] = reached[:, root] = places[:, root]
    frames = {root: np.broadcast_to(np.eye(3), (len(places), 3, 3))}  # of the parent, in the world
    moving = np.arange(places.shape[1]) == root
    for joint in order:
        branch, above = below[joint], frames.pop(joint)
        if not branch:
            continue
        offsets[branch] = mean_shape(places[:, branch] - places[:, joint, None])
        # Rows times a rotation: the world's axes to the parent's.
        vectors = (places[:, branch] - reached[:, joint, None]) @ above
        is_still = root_rests and joint == root
        turn = np.broadcast_to(np.eye(3), (len(places), 3, 3)) if is_still else alignment(offsets[branch], vectors)
        local[:, branch] = vectors @ turn
        missed = np.linalg.norm(vectors - offsets[branch] @ turn.swapaxes(1, 2), axis=2)
        turns[:, joint] = _angles(turn)
        for place, child in enumerate(branch):
            moving[child] = missed[:, place].max() > REACH
            bone = vectors[:, place] if moving[child] else offsets[child] @ turn.swapaxes(1, 2)
            reached[:, child] = reached[:, joint] + (above @ bone[..., None])[..., 0]
            frames[child] = above @ turn
    return _Bones(offsets, local, turns, moving)


def _angles(turn: FloatArray) -> FloatArray:
    """(T, 3) degrees about z, x, y of rotations (T, 3, 3), without jumps by a full turn."""
    with warnings.catch_warnings():
        # At a quarter turn about x, z and y are one axis; scipy puts all of it into z, which is right, and warns.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_matrix(turn).as_euler("ZXY", degrees=True)
    return np.unwrap(angles, period=360.0, axis=0)


def _hierarchy_text(
    skeleton: Skeleton, order: tuple[int, ...], depths: IntArray, bones: _Bones, scale: float
) -> Iterator[str]:
    """The lines before MOTION; `depths` (J,) counts the joints above each."""
    names = _names(skeleton.joints)
    offsets = np.round(bones.offsets * scale, 6) + 0.0  # no minus before a zero
    following = [*depths[list(order[1:])].tolist(), 0]
    yield "HIERARCHY"
    for joint, after in zip(order, following, strict=True):
        depth = int(depths[joint])
        pad = "\t" * depth
        yield f"{pad}{'JOINT' if depth else 'ROOT'} {names[joint]}"
        yield f"{pad}{{"
        yield f"{pad}\tOFFSET {' '.join(f'{value:.6f}' for value in offsets[joint])}"
        yield f"{pad}\tCHANNELS {f'6 {POSITIONS}' if bones.moving[joint] else '3'} {ROTATIONS}"
        if after <= depth:
            yield from (f"{pad}\t{line}" for line in ("End Site", "{", "\tOFFSET 0 0 0", "}"))
        yield from ("\t" * level + "}" for level in range(depth, after - 1, -1))


def _names(joints: tuple[str, ...]) -> list[str]:
    """Names that a BVH can hold, each once."""
    names: list[str] = []
    for joint in joints:
        # Readers find the end of the hierarchy by the word MOTION.
        name = re.sub(r"[{}:]", "_", " ".join(joint.split())).replace("MOTION", "Motion") or "joint"
        twins = (f"{name}_{number}" for number in itertools.count(2))
        names.append(name if name not in names else next(twin for twin in twins if twin not in names))
    return names


def _motion_text(bones: _Bones, order: tuple[int, ...], scale: float) -> FloatArray:
    """The numbers of every frame, (T, channels)."""
    columns = []
    for joint in order:
        columns += [bones.local[:, joint] * scale] * bool(bones.moving[joint]) + [bones.turns[:, joint]]
    return np.concatenate(columns, axis=1)
