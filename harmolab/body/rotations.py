"""Rotations of a body's joints: fitted to joint positions, back to positions (forward kinematics), limbs of two bones.

A rotation turns column vectors of the parent's frame: a joint's child lies at the joint's place plus the joint's
rotation in the world times the child's offset.
"""

from dataclasses import dataclass

import numpy as np

from harmolab.body.skeletons import Skeleton, children, tree_order
from harmolab.types import FloatArray

MEAN_SHAPE_ROUNDS = 3
# Share of the children's weight that draws a rotation to no rotation: it decides about the twist only.
REST = 1e-9
TINY = 1e-9  # metres
DOWN = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Body:
    """Bones at rest.

    Parameters
    ----------
    skeleton : Skeleton with J joints and one root
    offsets : (J, 3) array, metres, from the parent, in the attitude at rest; the root's is 0
    """

    skeleton: Skeleton
    offsets: FloatArray

    @property
    def order(self) -> tuple[int, ...]:
        """Joints, parents first."""
        return tree_order(self.skeleton.parents)

    @property
    def lengths(self) -> FloatArray:
        """(J,) metres, 0 for the root."""
        return np.asarray(np.linalg.norm(self.offsets, axis=1))

    def resized(self, lengths: FloatArray) -> "Body":
        """The same directions with bones of other lengths (J,), metres."""
        own = np.maximum(self.lengths, np.finfo(float).tiny)
        return Body(self.skeleton, self.offsets * (np.asarray(lengths) / own)[:, None])


def fit_body(positions: FloatArray, skeleton: Skeleton) -> Body:
    """The body whose bones fit positions (T, J, 3) best.

    Bones that hang on one joint keep their mean shape; a single bone points where it points on average, as its parent
    sees it, not as in some frame.
    """
    body = Body(skeleton, np.zeros((len(skeleton.joints), 3)))
    _fitted(positions, body, is_known=False)
    return body


def joint_rotations(positions: FloatArray, body: Body) -> FloatArray:
    """Rotations (T, J, 3, 3) relative to the parent (the root's to the world) that bring a body nearest to positions.

    From the root outwards; each is fitted to where the joints above have come to lie, so that no error adds up. Joints
    without children have none (the identity).
    """
    return _fitted(positions, body, is_known=True)


def _fitted(positions: FloatArray, body: Body, *, is_known: bool) -> FloatArray:
    """The rotations of a body; its offsets are filled in on the way unless they are known."""
    below, order = children(body.skeleton.parents), body.order
    turns = np.broadcast_to(np.eye(3), (*positions.shape[:2], 3, 3)).copy()
    reached = positions.copy()
    frames = {order[0]: np.broadcast_to(np.eye(3), (len(positions), 3, 3))}  # of the parent, in the world
    for joint in order:
        branch, above = below[joint], frames.pop(joint)
        if not branch:
            continue
        # Rows times a rotation: the world's axes to the parent's.
        vectors = (positions[:, branch] - reached[:, joint, None]) @ above
        if not is_known:
            body.offsets[branch] = mean_shape(vectors) if len(branch) > 1 else _mean_bone(vectors)
        turns[:, joint] = alignment(body.offsets[branch], vectors)
        own = above @ turns[:, joint]
        for child in branch:
            reached[:, child] = reached[:, joint] + own @ body.offsets[child]
            frames[child] = own
    return turns


def _mean_bone(vectors: FloatArray) -> FloatArray:
    """(1, 3): the mean direction of a bone (T, 1, 3), at its mean length."""
    mean = vectors.mean(axis=0)
    return mean * (np.linalg.norm(vectors, axis=2).mean() / max(float(np.linalg.norm(mean)), np.finfo(float).tiny))


def forward_kinematics(turns: FloatArray, root: FloatArray, body: Body) -> FloatArray:
    """Positions (T, J, 3) of a body with rotations (T, J, 3, 3) and the root at (T, 3)."""
    parents, order = body.skeleton.parents, body.order
    positions, world = np.zeros((*turns.shape[:2], 3)), np.zeros(turns.shape)
    for joint in order:
        parent = parents[joint]
        if parent < 0:
            positions[:, joint], world[:, joint] = root, turns[:, joint]
            continue
        positions[:, joint] = positions[:, parent] + world[:, parent] @ body.offsets[joint]
        world[:, joint] = world[:, parent] @ turns[:, joint]
    return positions


def mean_shape(vectors: FloatArray) -> FloatArray:
    """(C, 3): the vectors (T, C, 3) turned together and averaged, in the first frame's attitude, at their mean lengths.

    Each round turns every frame onto the shape so far (generalised Procrustes analysis).
    """
    lengths = np.linalg.norm(vectors, axis=2).mean(axis=0)
    shape = vectors[0]
    for _ in range(MEAN_SHAPE_ROUNDS):
        mean = (vectors @ alignment(shape, vectors)).mean(axis=0)
        size = np.linalg.norm(mean, axis=1)
        shape = mean * np.divide(lengths, size, out=np.zeros_like(size), where=size > 0)[:, None]
    return shape


def alignment(shape: FloatArray, vectors: FloatArray) -> FloatArray:
    """(T, 3, 3): the rotations that bring `shape` (C, 3) closest to `vectors` (T, C, 3) (Kabsch 1976).

    Where twist stays free (one child, or children on a line) it is the smallest such rotation.
    """
    product = vectors.swapaxes(1, 2) @ shape
    weight = np.linalg.norm(product, axis=(1, 2)) + np.finfo(float).tiny
    left, _, right = np.linalg.svd(product + REST * weight[:, None, None] * np.eye(3))
    # No mirror images: where the product of both is one, the weakest axis is turned round.
    left[:, :, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[:, None]
    return np.asarray(left @ right)


def two_bones(
    root: FloatArray,
    target: FloatArray,
    upper: FloatArray | float,
    lower: FloatArray | float,
    pole: FloatArray,
    *,
    longest: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Middle joint and end, (T, 3) each, of a limb of two bones that reaches for `target`: inverse kinematics.

    The end lies on the line from the root to the target, at most as far from the root as the limb reaches; the law of
    cosines gives the middle joint, on the side of the pole. Both bones keep their lengths in every frame, also where
    the target is the root itself or the pole lies on that line.

    Parameters
    ----------
    root, target : (T, 3) arrays, metres
    upper, lower : lengths of the bones, metres, one number or (T, 1)
    pole : (3,) or (T, 3) array, direction to which the middle joint is bent
    longest : (T, 1) array, metres, optional
        Largest distance of the end from the root; the sum of both bones when left out.
    """
    towards = directions(target - root, DOWN)
    length = np.linalg.norm(target - root, axis=1, keepdims=True)
    reach = np.clip(length, np.abs(upper - lower) + TINY, upper + lower if longest is None else longest)
    along = (upper**2 - lower**2 + reach**2) / (2 * reach)
    aside = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    return root + along * towards + aside * normal_part(pole, towards), root + reach * towards


def directions(vectors: FloatArray, fallback: FloatArray) -> FloatArray:
    """Unit vectors (T, 3) along `vectors` (T, 3); `fallback`, unit vectors (3,) or (T, 3), where a vector is 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > TINY, vectors / np.maximum(length, TINY), fallback)


def normal_part(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """Unit vectors (T, 3) along the part of `vectors` (3,) or (T, 3) at a right angle to unit vectors `axes` (T, 3).

    Where there is no such part, some direction at a right angle.
    """
    other = _across(np.eye(3)[np.abs(axes).argmin(axis=1)], axes)
    other = other / np.linalg.norm(other, axis=1, keepdims=True)
    return directions(_across(np.broadcast_to(vectors, axes.shape), axes), other)


def _across(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """The part of vectors (T, 3) at a right angle to unit vectors `axes` (T, 3)."""
    return vectors - (vectors * axes).sum(axis=1, keepdims=True) * axes
