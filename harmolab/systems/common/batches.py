"""Training units as tensors on the device: collated once, cut per batch."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from harmolab.systems.common.units import UnitSet, collate


@dataclass(frozen=True, eq=False)
class Tensors:
    """A batch of units (or all of a set), padded to the longest: names and shapes as in `units.Batch`."""

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

    def continued_from(self, motion: Tensor, mask: Tensor) -> Tensors:
        """These units, begun where another motion ended: V_f of Eq. 23 from its last frames, not from recorded ones.

        That is how a song is danced, meter by meter (Fig. 7b). There is no recording of it to compare with; but
        harmony needs music alone, and a discriminator of movement needs none.

        Parameters
        ----------
        motion : (N, T, C) motion codes
        mask : (N, T), 1 where `motion` is real
        """
        lengths, prior = mask.sum(dim=1).long(), self.index.sum(dim=1).long()
        frames = torch.arange(self.index.shape[1], device=motion.device)
        at = ((lengths - prior)[:, None] + frames).clamp(min=0).minimum(lengths[:, None] - 1)
        tail = motion.gather(1, at[..., None].expand(-1, -1, motion.shape[2]))
        known = self.index[..., None]
        mean = (tail * known).sum(dim=1, keepdim=True) / prior[:, None, None].clamp(min=1)
        return replace(self, initial=torch.where(known > 0, tail, mean))

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Tensors:
        """The units at `indices` that fall to process `rank` of `world`, padded to the longest of all of `indices`.

        Padding thus never depends on how a batch is shared among processes.
        """
        frames = int(self.mask[indices].sum(dim=1).max())
        beats = max(int(self.beat_mask[indices].sum(dim=1).max()), 1)
        ends = {"beats": beats, "strengths": beats, "beat_mask": beats}
        mine = indices[rank::world].to(self.audio.device)
        return Tensors(**{f.name: getattr(self, f.name)[mine, : ends.get(f.name, frames)] for f in fields(self)})
