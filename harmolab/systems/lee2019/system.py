"""Lee et al. 2019 as a system: trained networks, and the movements that their dances start from."""

from __future__ import annotations

from typing import Any

from harmolab.io.files import PathLike
from harmolab.systems.common.network_system import PresetSystem
from harmolab.systems.common.splits import Split
from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.lee2019.params import LeeParams


class Lee2019(PresetSystem):
    """The rival "Dancing to Music": dances composed of learnt four-beat units, warped to the music's beats.

    Ours, written from facts about the public code and trained on our units; not the authors' model.

    Parameters
    ----------
    generator : DancingToMusic
    poses : PoseBank, optional
        Movements to start from. Without: the mean pose at rest.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network = DancingToMusic
    settings = LeeParams

    @classmethod
    def train_network(cls, split: Split, folder: PathLike, **options: Any) -> None:
        """`harmolab.systems.lee2019.train.train_lee2019`, which says what is in the folder."""
        from harmolab.systems.lee2019.train import train_lee2019

        train_lee2019(split, folder, **options)
