"""Training units as tensors on the device: collated once, selected per batch."""

from __future__ import annotations

from dataclasses import fields, replace

import torch
from torch import Tensor

from harmolab.data.units import Batch, UnitSet, collate


class Tensors(Batch[Tensor]):
    """A batch of units (or all of a set) on a device."""

    def __len__(self) -> int:
        return len(self.audio)

    @classmethod
    def of(cls, units: UnitSet, device: torch.device | str = "cpu") -> Tensors:
        """Every unit of a set as one padded batch on `device`."""
        batch = collate(units.units)
        return cls(**{field.name: torch.as_tensor(getattr(batch, field.name)).to(device) for field in fields(cls)})

    def continued_from(self, motion: Tensor, mask: Tensor) -> Tensors:
        """These units with V_f of Eq. 23 from the last frames of another motion instead of the recorded one.

        So a song is danced, meter by meter (Fig. 7b). There is no recording of it to compare with; but harmony needs
        music alone, and a discriminator of movement needs no recording of the same dance.

        Parameters
        ----------
        motion : (N, T, C) motion codes
        mask : (N, T), 1 where `motion` is real
        """
        lengths, prior = mask.sum(dim=1).long(), self.index.sum(dim=1).long()
        frames = torch.arange(self.index.shape[1], device=motion.device)
        at = ((lengths - prior)[:, None] + frames).clamp(min=0).minimum(lengths[:, None] - 1)
        tail = motion.gather(1, at[..., None].expand(-1, -1, motion.shape[2]))
        index = self.index[..., None]
        mean = (tail * index).sum(dim=1, keepdim=True) / prior[:, None, None].clamp(min=1)
        return replace(self, initial=torch.where(index > 0, tail, mean))

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Tensors:
        """The units at `indices` that fall to process `rank` of `world`, padded to the longest of all of `indices`.

        Padding thus never depends on how a batch is shared among processes.
        """
        frames = int(self.mask[indices].sum(dim=1).max())
        beats = max(int(self.beat_mask[indices].sum(dim=1).max()), 1)
        ends = {"beats": beats, "strengths": beats, "beat_mask": beats}
        rows = indices[rank::world].to(self.audio.device)
        return Tensors(**{f.name: getattr(self, f.name)[rows, : ends.get(f.name, frames)] for f in fields(self)})
