"""Weights for publication: `python -m tools.ship RUN OUT`. 16 bits, and no recorded movement in them.

A run keeps recorded movements for its dances to start from. Recordings are not ours to publish, so those of a published
network were danced by the network itself, to synthetic music, long after nothing of a recorded frame was in its reach.
Of several runs of HarmoGAN that one is published whose dances look most like dancing; how well they keep time comes
second.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.body.kinematics import in_body
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics.likeness import likeness
from harmolab.musician.system import Audio2Body
from harmolab.params import DANCES, HarmonyParams
from harmolab.systems.contract import maker_of
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.music2dance.system import ATTRIBUTES, FOOT_MODEL, Music2Dance
from harmolab.systems.training.about import DEFAULT_STEM, read_about
from harmolab.systems.training.dancing import synthesize_dance
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.pose_network import load_pose_net
from harmolab.systems.training.runs import PoseBank, load_poses, retimed, save_poses
from harmolab.systems.training.weights import save_weights
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_motion

SETTLED_SECONDS = 24.0  # of each dance of HarmoGAN that a movement is cut from
SETTLED = 10.0  # seconds after which nothing of the movement it started from is left: several meters
ENDING_SECONDS = 40.0  # of each dance of Music2Dance that a movement is cut from: its end
PER_DANCE = 6


def ship_harmogan(run: Path, out: Path, *, per_dance: int = 8, seed: int = 0) -> None:
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
    bank = settled_bank(generator, recorded, per_dance=per_dance, seed=seed)
    out.mkdir(parents=True, exist_ok=True)
    save_weights(out / "model", generator, read_about(run / "model")["meta"], half=True)
    save_poses(out / "model", bank)
    save_weights(out / "pose_net", net, read_about(run / "pose_net")["meta"], half=True)


def best_run(runs: Sequence[Path], clips: Sequence[Clip], *, seconds: float = 30.0, seed: int = 1) -> Path:
    """The run whose dances to validation songs have the highest `standing`; the first of equals.

    Parameters
    ----------
    runs : folders of `harmolab train`
    clips : songs with their beats, on audio time, and the names of their dances; each is danced to from its offset on
    seconds : float, length of each dance, at least 10
    seed : int, of the dances
    """
    return max(runs, key=lambda run: standing(_dances(run, clips, seconds, seed)))


def standing(dances: Sequence[tuple[Motion, BeatTrack, str]]) -> tuple[int, int, float]:
    """Likeness and harmony of dances (motion, beats on its time line, name of the dance); compare as tuples.

    Returns
    -------
    How many move like recorded dancers (`harmolab.metrics.likeness`); how many of all measures lie within the limits;
    and their mean harmony above chance, of speed valleys in the body within 0.1 s
    """
    judged = [likeness(motion, dance=dance) for motion, _, dance in dances]
    harmonies = [
        score_motion(beats, in_body(motion), params=HarmonyParams.valleys(), n_rotations=0).harmony_above_chance
        for motion, beats, _ in dances
    ]
    within = sum(len(each.values) - len(each.fails) for each in judged)
    return sum(each.passed is True for each in judged), within, float(np.mean(harmonies))


def _dances(run: Path, clips: Sequence[Clip], seconds: float, seed: int) -> list[tuple[Motion, BeatTrack, str]]:
    """A run's dances to clips, as `standing` takes them."""
    generator = load_generator(run / "model")
    poses = load_poses(run / "model", n_channels=generator.n_motion)
    dances = []
    for clip in clips:
        motion = synthesize_dance(
            generator, clip.audio, beats=clip.beats, start=clip.offset, seconds=seconds, seed=seed, poses=poses,
            dance=clip.dance or None,
        )  # fmt: skip
        dances.append((motion, music_beats(clip).span(clip.offset, motion.duration), clip.dance))
    return dances


def settled_bank(generator: Generator, bank: PoseBank, *, per_dance: int, seed: int) -> PoseBank:
    """A bank like `bank`, of generated movements: each from the settled part of another dance to synthetic music."""
    names = sorted({name for name in bank.dances if name in DANCES}) or sorted(DANCES)
    frames = bank.poses.shape[1]
    rng = np.random.default_rng(seed)
    codes, dances = [], [name for name in names for _ in range(per_dance)]
    for number, name in enumerate(dances):
        clip = synthetic_clip(name, seconds=SETTLED_SECONDS, seed=int(rng.integers(2**31)))
        seed = number % per_dance
        motion = synthesize_dance(generator, clip.audio, beats=clip.beats, seed=seed, poses=bank, dance=name)
        first = int(rng.integers(round(SETTLED * motion.fps), motion.n_frames - frames))
        code = encode_motion(motion.positions, motion.fps, motion.skeleton)
        codes.append(retimed(code[first : first + frames], frames))
    return PoseBank(np.stack(codes), tuple(dances))


def ship_music2dance(run: Path, out: Path, *, per_dance: int = PER_DANCE, seed: int = 0) -> None:
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
    system = Music2Dance.load(run)
    bank = ending_bank(system, per_dance=per_dance, seed=seed)
    out.mkdir(parents=True, exist_ok=True)
    save_weights(out / DEFAULT_STEM, system.generator, system.meta, half=True)
    save_poses(out / DEFAULT_STEM, bank)
    for name, part in ((ATTRIBUTES, system.attributes), (FOOT_MODEL, system.feet)):
        if part is not None:
            (out / name).mkdir(exist_ok=True)
            save_weights(out / name / DEFAULT_STEM, part, part.meta, half=True)


def ending_bank(system: Music2Dance, *, per_dance: int = PER_DANCE, seed: int = 0) -> PoseBank:
    """Movements as long as those of the system's own bank: the ends of its dances to synthetic music."""
    if system.poses is None:
        raise ValueError("the run has no bank of movements; train it again, or copy its model_poses.safetensors")
    frames = system.poses.poses.shape[1]
    rng = np.random.default_rng(seed)
    clips, names = [], []
    for dance in system.generator.dances:
        for number in range(per_dance):
            style = dance if dance in DANCES else str(rng.choice(sorted(DANCES)))
            clip = synthetic_clip(style, seconds=ENDING_SECONDS, seed=int(rng.integers(2**31)))
            name = dance if dance in DANCES else ""
            motion = system.generate(clip.audio, clip.beats, seed=number, dance=name, plant_feet=False)
            clips.append(system.coded(motion)[-frames:])
            names.append(dance)
    return PoseBank(np.stack(clips), tuple(names))


def ship_audio2body(run: Path, out: Path) -> None:
    """Write the network of a run to `out`.

    Parameters
    ----------
    run : folder of `harmolab train FOLDER --system audio2body`
    out : folder; files in it are replaced

    Raises
    ------
    FileNotFoundError, ValueError
        If the run is not complete or damaged.
    """
    system = Audio2Body.load(run)
    save_weights(out / DEFAULT_STEM, system.network, system.meta, half=True)


SHIPPERS = {"harmogan": ship_harmogan, "music2dance": ship_music2dance, "audio2body": ship_audio2body}


def ship(run: Path, out: Path) -> None:
    """Write the weights of a run to a folder, by the system that made them; ValueError for one without such weights."""
    if (maker := maker_of(run)) not in SHIPPERS:
        raise ValueError(f"{run}: was made by {maker!r}; weights are published of {', '.join(SHIPPERS)}")
    SHIPPERS[maker](run, out)


if __name__ == "__main__":
    ship(Path(sys.argv[1]), Path(sys.argv[2]))
