"""Weights of Music2Dance for publication: 16 bits, and no recorded movement in them.

Recordings are not ours to publish. So the movements that a published network's dances go on from were danced by the
network itself, to synthetic music, long after nothing of a recorded frame was in its reach.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.io.files import PathLike
from harmolab.params import DANCES
from harmolab.systems.common.about import DEFAULT_STEM
from harmolab.systems.common.poses_bank import PoseBank, save_poses
from harmolab.systems.common.weights import save_weights
from harmolab.systems.music2dance.system import ATTRIBUTES, FOOT_MODEL, Music2Dance

SECONDS = 40.0  # of each dance that a movement is cut from: its end
PER_DANCE = 6


def ship(run: PathLike, out: PathLike, *, per_dance: int = PER_DANCE, seed: int = 0) -> None:
    """Write the network of a run, and its classifier and foot model, to `out`, with movements of its own.

    Parameters
    ----------
    run : folder of `harmolab train DATA --system music2dance`
    out : folder; files in it are replaced
    per_dance : int, movements of each dance
    seed : int, of the songs that they are danced to

    Raises
    ------
    FileNotFoundError, ValueError
        If the run is not complete or damaged, or has no movements to begin with.
    """
    system, out = Music2Dance.load(run), Path(out)
    bank = danced_bank(system, per_dance=per_dance, seed=seed)
    out.mkdir(parents=True, exist_ok=True)
    save_weights(out / DEFAULT_STEM, system.generator, system.meta, half=True)
    save_poses(out / DEFAULT_STEM, bank)
    for name, part in ((ATTRIBUTES, system.attributes), (FOOT_MODEL, system.feet)):
        if part is not None:
            (out / name).mkdir(exist_ok=True)
            save_weights(out / name / DEFAULT_STEM, part, part.meta, half=True)


def danced_bank(system: Music2Dance, *, per_dance: int = PER_DANCE, seed: int = 0) -> PoseBank:
    """Movements as long as those of the system's own bank: the ends of its dances to synthetic music."""
    if system.poses is None:
        raise ValueError("the run has no bank of movements; train it again, or copy its model_poses.safetensors")
    frames = system.poses.poses.shape[1]
    rng = np.random.default_rng(seed)
    clips, names = [], []
    for dance in system.generator.dances:
        for number in range(per_dance):
            style = dance if dance in DANCES else str(rng.choice(sorted(DANCES)))
            clip = synthetic_clip(style, seconds=SECONDS, seed=int(rng.integers(2**31)))
            name = dance if dance in DANCES else ""
            motion = system.generate(clip.audio, clip.beats, seed=number, dance=name, plant_feet=False)
            clips.append(system.coded(motion)[-frames:])
            names.append(dance)
    return PoseBank(np.stack(clips), tuple(names))
