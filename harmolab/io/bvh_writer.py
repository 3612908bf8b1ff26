"""Motion to Biovision files (`.bvh`) that Blender opens and that our own reader takes back to the same places.

A BVH holds rotations, a Motion holds places. Going down the tree, each joint is turned so that its children come to lie
where they are: the best rotation of all children at once (Kabsch 1976), the shortest one where twist is free.

* The rest skeleton has the first frame's attitude and every bone's mean length. It is written in centimetres, or in
  metres where it extends over no more than 3 cm, because readers guess the unit by the size.
* A child that no rotation of its parent can reach (a bone that stretches, or children that do not keep together as the
  shoulders and hips of a soft torso do not) gets position channels of its own beside the rotations.
* A joint without children ends in an `End Site` at OFFSET 0 0 0, in which our reader sees no further joint.

Which frames are valid is not kept: BVH has no place for it.
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from harmolab.io.files import PathLike, atomic_write
from harmolab.types import FloatArray, Motion, Skeleton

__all__ = ["save_bvh"]

# Metres by which a joint may miss its place before it gets position channels.
REACH = 2e-5
MEAN_SHAPE_ROUNDS = 3
# Share of the children's weight that draws a rotation to no rotation: it decides about the twist only.
REST = 1e-9
ROTATIONS = "Zrotation Xrotation Yrotation"
POSITIONS = "Xposition Yposition Zposition"
# Rest skeletons above this extent are read as centimetres (`harmolab.io.bvh`).
CENTIMETRES_FROM = 0.03


@dataclass(frozen=True, eq=False)
class _Bones:
    """What a BVH says of the joints, in its own order: parents before children, a branch at a time.

    Parameters
    ----------
    order : J joint indices
    depth : J, ancestors of each
    offsets : (J, 3), metres; the root's is 0
    local : (T, J, 3), metres, place in the parent's frame (of the root: in the world)
    turns : (T, J, 3), degrees, about z, x and y in turn
    moving : (J,) bool, which need position channels
    """

    order: tuple[int, ...]
    depth: tuple[int, ...]
    offsets: FloatArray
    local: FloatArray
    turns: FloatArray
    moving: tuple[bool, ...]


def save_bvh(path: PathLike, motion: Motion) -> None:
    """Write a motion as BVH; the file appears whole or not at all.

    `load_bvh` gives every joint back by its name, within 0.1 mm. The joints come in another order where the skeleton
    does not list them branch by branch; what BVH cannot have in a name (a bracket, a colon) becomes "_".

    Parameters
    ----------
    path : str or path
    motion : Motion, (T, J, 3) metres
        Its skeleton must hang together: one joint without a parent, from which every other can be reached.

    Raises
    ------
    ValueError
        For a motion in image coordinates, or a skeleton with several roots, without bones or with a ring of bones.
    """
    path = Path(path)
    if motion.positions.shape[2] != 3:
        raise ValueError(f"{path}: BVH holds movement in space; this motion is in image coordinates")
    order, depth = _branches(path, motion.skeleton)
    bones = _fitted(motion, order, depth)
    extent = np.ptp(_rest(bones.offsets, motion.skeleton, order), axis=0).max()
    scale = 100.0 if extent > CENTIMETRES_FROM else 1.0
    with atomic_write(path) as aside, aside.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _hierarchy(motion.skeleton, bones, scale))
        stream.write(f"MOTION\nFrames: {motion.n_frames}\nFrame Time: {1 / motion.fps!r}\n")
        np.savetxt(stream, _table(bones, scale), fmt="%.6f")


def _branches(path: Path, skeleton: Skeleton) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The joints branch by branch, and the depth of each; ValueError unless the skeleton is one tree of two or more."""
    roots = [joint for joint, parent in enumerate(skeleton.parents) if parent < 0]
    if len(roots) != 1 or len(skeleton.joints) < 2:
        raise ValueError(
            f"{path}: BVH needs bones that hang on one root; this skeleton has {len(skeleton.joints)} joints and "
            f"{len(roots)} roots; save it as .npz"
        )
    children = _children(skeleton)
    order, depth, waiting = [], [], [(roots[0], 0)]
    while waiting:
        joint, level = waiting.pop()
        order.append(joint)
        depth.append(level)
        waiting += [(child, level + 1) for child in reversed(children[joint])]
    if len(order) < len(skeleton.joints):
        raise ValueError(f"{path}: the skeleton's bones form a ring: {skeleton.parents}")
    return tuple(order), tuple(depth)


def _children(skeleton: Skeleton) -> list[list[int]]:
    """The children of every joint."""
    children: list[list[int]] = [[] for _ in skeleton.joints]
    for parent, child in skeleton.bones:
        children[parent].append(child)
    return children


def _fitted(motion: Motion, order: tuple[int, ...], depth: tuple[int, ...]) -> _Bones:
    """Offsets and rotations, each fitted to where the joints above have come to lie, so that no error adds up."""
    wanted, children = motion.positions, _children(motion.skeleton)
    root = order[0]
    offsets, turns = np.zeros(wanted.shape[1:]), np.zeros(wanted.shape)
    local, reached = np.zeros(wanted.shape), np.zeros(wanted.shape)
    local[:, root] = reached[:, root] = wanted[:, root]
    frames = {root: np.broadcast_to(np.eye(3), (len(wanted), 3, 3))}  # of the parent, in the world
    moving = {root: True}
    for joint in order:
        below, above = children[joint], frames.pop(joint)
        if not below:
            continue
        offsets[below] = _mean_shape(wanted[:, below] - wanted[:, joint, None])
        # Rows times a rotation: the world's axes to the parent's.
        seen = (wanted[:, below] - reached[:, joint, None]) @ above
        turn = _alignment(offsets[below], seen)
        local[:, below], missed = seen @ turn, np.linalg.norm(seen - offsets[below] @ turn.swapaxes(1, 2), axis=2)
        turns[:, joint] = _angles(turn)
        for place, child in enumerate(below):
            moving[child] = bool(missed[:, place].max() > REACH)
            held = seen[:, place] if moving[child] else offsets[child] @ turn.swapaxes(1, 2)
            reached[:, child] = reached[:, joint] + (above @ held[..., None])[..., 0]
            frames[child] = above @ turn
    rows = list(order)
    return _Bones(
        order, depth, offsets[rows], local[:, rows], turns[:, rows], tuple(moving[joint] for joint in order)
    )  # fmt: skip


def _mean_shape(vectors: FloatArray) -> FloatArray:
    """(C, 3): the vectors (T, C, 3) turned together and averaged, in the first frame's attitude, at their mean lengths.

    Each round turns every frame onto the shape found so far (generalised Procrustes analysis).
    """
    lengths = np.linalg.norm(vectors, axis=2).mean(axis=0)
    shape = vectors[0]
    for _ in range(MEAN_SHAPE_ROUNDS):
        mean = (vectors @ _alignment(shape, vectors)).mean(axis=0)
        size = np.linalg.norm(mean, axis=1)
        shape = mean * np.divide(lengths, size, out=np.zeros_like(size), where=size > 0)[:, None]
    return shape


def _alignment(shape: FloatArray, vectors: FloatArray) -> FloatArray:
    """(T, 3, 3): the rotations that bring `shape` (C, 3) closest to `vectors` (T, C, 3) (Kabsch 1976).

    Where twist stays free (one child, or children on a line) it is the smallest such rotation.
    """
    product = vectors.swapaxes(1, 2) @ shape
    weight = np.linalg.norm(product, axis=(1, 2)) + np.finfo(float).tiny
    left, _, right = np.linalg.svd(product + REST * weight[:, None, None] * np.eye(3))
    # No mirror images: where the product of both is one, the weakest axis is turned round.
    left[:, :, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[:, None]
    return left @ right


def _angles(turn: FloatArray) -> FloatArray:
    """(T, 3) degrees about z, x, y of rotations (T, 3, 3), without jumps by a full turn."""
    with warnings.catch_warnings():
        # At a quarter turn about x, z and y are one axis; scipy puts all of it into z, which is right, and warns.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_matrix(turn).as_euler("ZXY", degrees=True)
    return np.unwrap(angles, period=360.0, axis=0)


def _rest(offsets: FloatArray, skeleton: Skeleton, order: tuple[int, ...]) -> FloatArray:
    """Places of the rest skeleton's joints (J, 3), in the order of the file."""
    rows = {joint: row for row, joint in enumerate(order)}
    rest = offsets.copy()
    for row, joint in enumerate(order[1:], start=1):
        rest[row] += rest[rows[skeleton.parents[joint]]]
    return rest


def _hierarchy(skeleton: Skeleton, bones: _Bones, scale: float) -> Iterator[str]:
    """The lines before MOTION."""
    names = _names(skeleton.joints)
    offsets = np.round(bones.offsets * scale, 6) + 0.0  # no minus before a zero
    yield "HIERARCHY"
    for row, (joint, depth) in enumerate(zip(bones.order, bones.depth, strict=True)):
        pad, following = "\t" * depth, bones.depth[row + 1] if row + 1 < len(bones.depth) else 0
        yield f"{pad}{'JOINT' if row else 'ROOT'} {names[joint]}"
        yield f"{pad}{{"
        yield f"{pad}\tOFFSET {' '.join(f'{value:.6f}' for value in offsets[row])}"
        yield f"{pad}\tCHANNELS {f'6 {POSITIONS}' if bones.moving[row] else '3'} {ROTATIONS}"
        if following <= depth:
            yield from (f"{pad}\t{line}" for line in ("End Site", "{", "\tOFFSET 0 0 0", "}"))
        yield from ("\t" * level + "}" for level in range(depth, following - 1, -1))


def _names(joints: tuple[str, ...]) -> list[str]:
    """Names that a BVH can hold, each once."""
    names: list[str] = []
    for joint in joints:
        # Readers find the end of the hierarchy by the word MOTION.
        name = re.sub(r"[{}:]", "_", " ".join(joint.split())).replace("MOTION", "Motion") or "joint"
        twins = (f"{name}_{number}" for number in itertools.count(2))
        names.append(name if name not in names else next(twin for twin in twins if twin not in names))
    return names


def _table(bones: _Bones, scale: float) -> FloatArray:
    """The numbers of every frame, (T, channels)."""
    columns = []
    for row, moving in enumerate(bones.moving):
        columns += [bones.local[:, row] * scale] * moving + [bones.turns[:, row]]
    return np.concatenate(columns, axis=1)
