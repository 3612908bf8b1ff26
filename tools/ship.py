"""Weights for publication: `python -m tools.ship RUN OUT`. 16 bits, and no recorded movement in them.

A run keeps recorded movements for its dances to start from. Recordings are not ours to publish, so those of a published
network were danced by the network itself, to synthetic music, long after nothing of a recorded frame was in its reach.
HarmoGAN corrects the dances of a bank that is shipped beside it: `python -m tools.ship --bank DATA RUN SEED` trains it.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.musician.system import Audio2Body
from harmolab.params import DANCES
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.contract import maker_of
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.harmogan.sketches import SKETCHES, sketched
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.harmogan.train import train_harmogan
from harmolab.systems.music2dance.system import ATTRIBUTES, FOOT_MODEL, Music2Dance
from harmolab.systems.training.about import DEFAULT_STEM
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.motion_code import bone_lengths
from harmolab.systems.training.runs import PoseBank, save_poses
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import UnitSet, cut_recording
from harmolab.systems.training.weights import save_weights

ENDING_SECONDS = 40.0  # of each dance of Music2Dance that a movement is cut from: its end
PER_DANCE = 6
BANK_SEED = 1_000_000


def train_on_bank(
    data: Path, options: TrainOptions, *, style: str = "salsa", model: ModelParams | None = None, seed: int = 1,
    **changes: Any,
) -> None:  # fmt: skip
    """Train HarmoGAN to correct dances of a shipped bank to the songs of a corpus, whose own movement is not used.

    Parameters
    ----------
    data : folder of recordings: their sound and beats are used
    options : TrainOptions, with the folder of the run
    style : bank
    model : ModelParams, the small preset when left out
    seed : int
    changes : other values for fields of `TrainParams`
    """
    bank, features = shipped_bank(style), FeatureParams.recommended()
    params = replace(TrainParams.recommended(), seed=seed, **changes)
    folders = find_recordings(data).folders
    cut = [cut_recording(_danced_by(bank, load_recording(folder)), features, step=2).units for folder in folders]
    lengths = np.average([bone_lengths(take.motion.positions, bank.skeleton) for take in bank.takes], axis=0)
    sides = {"validation": cut[:1], "test": cut[1:2], "train": cut[2:]}
    sets = {
        side: UnitSet(tuple(unit for units in own for unit in units), bank.skeleton, lengths, features, data.name)
        for side, own in sides.items()
    }
    split = Split(**sets, groups={side: [] for side in sides}, settings={"songs": "the first is for validation"})
    of_songs = sketched(split, folders, params, bank=bank)
    model = model or ModelParams.small()
    train_harmogan(of_songs.split, options, model=model, params=params, choreographer=bank)


def _danced_by(bank: Choreographer, recording: Recording) -> Recording:
    """A recording whose dancer is another: the bank's, with a seed that no sketch has."""
    clip, track = recording.clip, recording_beats(recording, "annotated" if recording.annotation else "tracked")
    seconds = None if clip.motion is None else clip.motion.duration
    motion = bank.generate(clip.audio, track, start=clip.offset, seconds=seconds, seed=BANK_SEED)
    return replace(recording, clip=replace(clip, motion=motion))


def ship_harmogan(run: Path, out: Path) -> None:
    """Write the generator of a run of `train_on_bank` to `out`, ready to be published: 16 bits, the name of its bank.

    Raises
    ------
    FileNotFoundError, ValueError
        If the run is not complete or damaged, or corrects the dances of other movement.
    """
    system = HarmoGAN.load(run)
    styles = [style for style in ("salsa", "indian") if _same_takes(system.sketches, shipped_bank(style))]
    if not styles:
        raise ValueError(f"{run}: its sketches are of recordings that are not ours to publish; see train_on_bank")
    out.mkdir(parents=True, exist_ok=True)
    save_weights(out / DEFAULT_STEM, system.generator, {**system.meta, SKETCHES: styles[0]}, half=True)


def _same_takes(one: Choreographer | None, other: Choreographer) -> bool:
    return one is not None and [take.name for take in one.takes] == [take.name for take in other.takes]


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
    match sys.argv[1:]:
        case ["--bank", data, run, seed]:
            train_on_bank(Path(data), TrainOptions(Path(run)), seed=int(seed))
        case [run, out]:
            ship(Path(run), Path(out))
        case _:
            sys.exit(__doc__)
