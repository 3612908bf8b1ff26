"""Amount of work that a notebook does."""

import os
from dataclasses import dataclass, replace
from typing import Literal, Self


@dataclass(frozen=True)
class RunProfile:
    """Amount of work that a notebook does; the notebook itself never asks which profile it runs in.

    Parameters
    ----------
    name : "quick", "full" or "gpu"
    n_clips : int, clips of the synthetic corpus
    n_sequences : int or None, recorded sequences to read (None: all)
    n_rotations : int, rotations of a null distribution
    n_nulls : int, clips in each row of a table of false alarms
    n_seeds : int, trainings of each generator, over which means and intervals are taken
    n_rivals : int, trainings of each rival system of the comparison, which take an hour each
    n_dancers : int, trainings of Music2Dance, which take twenty minutes each, and of its ablations
    epochs : (pretraining, adversarial) or None
        Epochs of each training; None: the whole schedule.
    pose_epochs : int or None
        Epochs of the pose network; None: as many as ``TrainParams`` says.
    songs : int, songs of each dance that systems are compared on
    draws : int, dances of each system to the same seconds of a song
    hidden : int or None
        Recurrent units of the generators, everything else in proportion; None: those of the preset.
    preset : "small", or "paper": HarmoGAN and both rivals as large as in their papers, for their whole schedules
    ablation_share : float, of Music2Dance's schedule that its ablations are trained for
    """

    name: str
    n_clips: int
    n_sequences: int | None
    n_rotations: int
    n_nulls: int = 400
    n_seeds: int = 3
    n_rivals: int = 1
    n_dancers: int = 2
    epochs: tuple[int, int] | None = None
    pose_epochs: int | None = None
    hidden: int | None = None
    preset: Literal["small", "paper"] = "small"
    ablation_share: float = 0.1
    songs: int = 24
    draws: int = 3
    seed: int = 1

    @classmethod
    def quick(cls) -> Self:
        """Under a minute a notebook on two cores; where generators are trained, about a minute for all of them."""
        return cls(
            "quick",
            n_clips=35,
            n_sequences=6,
            n_rotations=200,
            n_nulls=8,
            n_seeds=1,
            epochs=(6, 8),
            pose_epochs=4,
            hidden=48,
            songs=2,
            draws=2,
        )

    @classmethod
    def full(cls) -> Self:
        """The numbers that are published in `figures/`."""
        return cls("full", n_clips=200, n_sequences=None, n_rotations=1000)

    @classmethod
    def gpu(cls) -> Self:
        """As `full`, with full-size networks, whole schedules and three trainings of each: for a machine with a GPU."""
        return replace(cls.full(), name="gpu", preset="paper", n_rivals=3, n_dancers=3, ablation_share=1.0)

    @classmethod
    def from_env(cls) -> Self:
        """The profile that ``HARMOLAB_PROFILE`` names (default quick)."""
        profiles = {"quick": cls.quick, "full": cls.full, "gpu": cls.gpu}
        name = os.environ.get("HARMOLAB_PROFILE", "quick")
        if name not in profiles:
            raise ValueError(f"HARMOLAB_PROFILE must be one of {', '.join(profiles)}, got {name!r}")
        return profiles[name]()
