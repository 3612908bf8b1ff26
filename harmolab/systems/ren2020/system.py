"""Ren et al. 2020 as a system: a generator that makes a whole dance from music and noise in one pass."""

from __future__ import annotations

from typing import Any

from harmolab.io.files import PathLike
from harmolab.systems.common.network_system import PresetSystem
from harmolab.systems.common.splits import Split
from harmolab.systems.ren2020.networks import RenGenerator
from harmolab.systems.ren2020.params import RenParams


class Ren2020(PresetSystem):
    """A trained generator that dances; another seed is other noise, and another movement to go on from.

    Parameters
    ----------
    generator : RenGenerator that knows its audio features
    poses : PoseBank, optional
        Movements to go on from. Without: the mean pose at rest.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network = RenGenerator
    settings = RenParams

    @classmethod
    def train_network(cls, split: Split, folder: PathLike, **options: Any) -> None:
        """`harmolab.systems.ren2020.train.train_ren2020`, which says what is in the folder."""
        from harmolab.systems.ren2020.train import train_ren2020

        train_ren2020(split, folder, **options)
