"""Skeletons: joints, and the tree that joins them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Skeleton:
    """Joint names and the tree that joins them; `parents[i]` is -1 at the root.

    >>> Skeleton(("hip", "knee"), (-1, 0)).bones
    ((0, 1),)
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(map(str, self.joints)))
        object.__setattr__(self, "parents", tuple(map(int, self.parents)))
        count = len(self.joints)
        if count == 0 or len(self.parents) != count:
            raise ValueError(f"a skeleton needs one parent per joint, got {count} joints, {len(self.parents)} parents")
        if not all(-1 <= parent < count and parent != joint for joint, parent in enumerate(self.parents)):
            raise ValueError(f"parents must be -1 or the index of another joint (0..{count - 1}): {self.parents}")

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """(parent, child) pairs."""
        return tuple((parent, joint) for joint, parent in enumerate(self.parents) if parent >= 0)

    @classmethod
    def unnamed(cls, count: int) -> Skeleton:
        """`count` joints of which nothing is known: no names, no bones."""
        return cls(tuple(f"joint_{i}" for i in range(count)), (-1,) * count)
