"""Weights for publication: 16 bits, and no recorded movement in them.

A run keeps a bank of recorded movements for its dances to start from. Recordings are not ours to publish, so a
published bank holds movements that the generator itself danced, to synthetic music.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.params import DANCES
from harmolab.systems.common.about import read_about
from harmolab.systems.common.dancing import synthesize_dance
from harmolab.systems.common.motion_code import encode_motion
from harmolab.systems.common.pose_network import load_pose_net
from harmolab.systems.common.poses_bank import PoseBank, load_poses, retimed, save_poses
from harmolab.systems.common.weights import save_weights
from harmolab.systems.harmogan.networks import Generator, load_generator

SECONDS = 24.0  # of each dance
SETTLED = 10.0  # seconds after which nothing of the movement it started from is left: several meters


def ship(run: Path, out: Path, *, per_dance: int = 8, seed: int = 0) -> None:
    """Write a run's generator and pose network to `out`, ready to be published.

    Parameters
    ----------
    run : folder of `harmolab train`
    out : folder; files in it are replaced
    per_dance : int, movements of each dance in the bank
    seed : int, of the dances that the bank is cut from

    Raises
    ------
    FileNotFoundError, ValueError
        If the run is not complete or damaged.
    """
    generator, net = load_generator(run / "model"), load_pose_net(run / "pose_net")
    recorded = load_poses(run / "model", n_channels=generator.n_motion)
    bank = danced_bank(generator, recorded, per_dance=per_dance, seed=seed)
    out.mkdir(parents=True, exist_ok=True)
    save_weights(out / "model", generator, read_about(run / "model")["meta"], half=True)
    save_poses(out / "model", bank)
    save_weights(out / "pose_net", net, read_about(run / "pose_net")["meta"], half=True)


def danced_bank(generator: Generator, bank: PoseBank, *, per_dance: int, seed: int) -> PoseBank:
    """A bank like `bank`, of generated movements: each from the settled part of another dance to synthetic music."""
    names = sorted({name for name in bank.dances if name in DANCES}) or sorted(DANCES)
    frames = bank.poses.shape[1]
    rng = np.random.default_rng(seed)
    codes, dances = [], [name for name in names for _ in range(per_dance)]
    for number, name in enumerate(dances):
        clip = synthetic_clip(name, seconds=SECONDS, seed=int(rng.integers(2**31)))
        seed = number % per_dance
        motion = synthesize_dance(generator, clip.audio, beats=clip.beats, seed=seed, poses=bank, dance=name)
        first = int(rng.integers(round(SETTLED * motion.fps), motion.n_frames - frames))
        code = encode_motion(motion.positions, motion.fps, motion.skeleton)
        codes.append(retimed(code[first : first + frames], frames))
    return PoseBank(np.stack(codes), tuple(dances))
