"""Motion to Biovision files (`.bvh`) that Blender opens and that our own reader takes back to the same places.

A BVH holds rotations, a Motion holds places. Going down the tree, each joint is turned so that its children come to lie
where they are: the best rotation of all children at once (Kabsch 1976), the shortest one where twist is free.

* The rest skeleton has the first frame's attitude and every bone's mean length. It is written in centimetres, or in
  metres where it extends over no more than 3 cm, because readers guess the unit by the size.
* A child that no rotation of its parent can reach (a bone that stretches, or children that do not keep together as the
  shoulders and hips of a soft torso do not) gets position channels of its own beside the rotations.
* Several trees (a player, a violin, a bow) hang on one more joint, `WORLD`, that rests at the origin: few readers take
  a second ROOT.
* A joint without children ends in an `End Site` at OFFSET 0 0 0, in which our reader sees no further joint.

Which frames are valid is not kept: BVH has no place for it.
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from harmolab.io.files import PathLike, atomic_write
from harmolab.rotations import alignment, mean_shape
from harmolab.skeletons import ancestors, children, tree_order
from harmolab.types import BoolArray, FloatArray, IntArray, Motion, Skeleton

# Metres by which a joint may miss its place before it gets position channels.
REACH = 2e-5
WORLD = "world"
ROTATIONS = "Zrotation Xrotation Yrotation"
POSITIONS = "Xposition Yposition Zposition"
# Rest skeletons above this extent are read as centimetres (`harmolab.io.bvh`).
CENTIMETRES_FROM = 0.03


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
    try:
        order = tree_order(skeleton.parents)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    bones = _fitted(motion, order, root_rests=roots > 1)
    above = ancestors(skeleton.parents)
    scale = 100.0 if np.ptp(above @ bones.offsets, axis=0).max() > CENTIMETRES_FROM else 1.0
    with atomic_write(path) as part, part.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _hierarchy(skeleton, order, above.sum(axis=1) - 1, bones, scale))
        stream.write(f"MOTION\nFrames: {motion.n_frames}\nFrame Time: {1 / motion.fps!r}\n")
        np.savetxt(stream, _table(bones, order, scale), fmt="%.6f")


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


def _hierarchy(
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


def _table(bones: _Bones, order: tuple[int, ...], scale: float) -> FloatArray:
    """The numbers of every frame, (T, channels)."""
    columns = []
    for joint in order:
        columns += [bones.local[:, joint] * scale] * bool(bones.moving[joint]) + [bones.turns[:, joint]]
    return np.concatenate(columns, axis=1)
