"""Training units as tensors on the device: collated once, cut per batch."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from harmolab.data.units import UnitSet, collate

__all__ = ["Tensors"]


@dataclass(frozen=True, eq=False)
class Tensors:
    """A batch of units (or all of a set), padded to the longest: names and shapes as in `harmolab.data.units.Batch`."""

    audio: Tensor
    motion: Tensor
    index: Tensor
    mask: Tensor
    initial: Tensor
    beats: Tensor
    strengths: Tensor
    beat_mask: Tensor

    def __len__(self) -> int:
        return len(self.audio)

    @classmethod
    def of(cls, units: UnitSet, device: torch.device | str = "cpu") -> Tensors:
        """Every unit of a set as one padded batch on `device`."""
        batch = collate(units.units)
        return cls(**{field.name: torch.as_tensor(getattr(batch, field.name)).to(device) for field in fields(cls)})

    def with_music_of(self, others: Tensors) -> Tensors:
        """The same movements to the music of other units, clip by clip; what either lacks is padding.

        Nobody danced that, so there is nothing to compare a motion with; but harmony needs music alone.
        """
        return replace(
            self,
            audio=others.audio,
            beats=others.beats,
            strengths=others.strengths,
            beat_mask=others.beat_mask,
            mask=self.mask * others.mask,
        )

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Tensors:
        """The units at `indices` that fall to process `rank` of `world`, padded to the longest of all of `indices`.

        Padding thus never depends on how a batch is shared among processes.
        """
        frames = int(self.mask[indices].sum(dim=1).max())
        beats = max(int(self.beat_mask[indices].sum(dim=1).max()), 1)
        ends = {"beats": beats, "strengths": beats, "beat_mask": beats}
        mine = indices[rank::world].to(self.audio.device)
        return Tensors(**{f.name: getattr(self, f.name)[mine, : ends.get(f.name, frames)] for f in fields(self)})
