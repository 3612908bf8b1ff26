"""HarmoGAN on movement that is shipped, to songs that it never heard: notebook 09's tables without any recording.

From the folder of the project, `PYTHONPATH=notebooks python -m study.experiments.bank_songs OUT`: about an hour on one
core; `HARMOLAB_PROFILE=quick` tries it in minutes. Trained on dances of the bank to synthetic songs (`tools.ship`), and
measured on other synthetic songs, beats planted. A trained network is kept, as those of the notebooks are.
"""

import argparse
import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import pandas as pd

from harmolab.data.recordings import Recording, find_recordings, load_recording
from harmolab.files import atomic_write
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.harmogan.train import POSE_NET
from harmolab.systems.training.pose_network import load_pose_net
from study.experiments.generation import kept_run, model_params, song_folder
from study.experiments.whole_songs import (
    CORRECTED,
    SONG_SECONDS,
    UNJUDGED,
    WITHOUT,
    OwnSongs,
    hearing,
    own_dances,
    song_differences,
    song_means,
)
from study.profile import RunProfile
from tools.ship import train_on_bank

STYLE, SONGS, TAUGHT = "salsa", 12, 21  # the bank, songs that are kept from training, and songs of the training
SEED = 910_000  # of the songs that are kept; those of the training have the profile's
SHORTEST = 20.0  # seconds of a take that stands for recorded movement
# Name of a training -> what differs in its settings, and how often it is trained.
TRAININGS: dict[str, tuple[dict[str, Any], int]] = {
    CORRECTED: ({}, 3),
    WITHOUT: ({"harmony_weight": 0.0}, 1),
    UNJUDGED: ({"gan_weight": 0.0}, 1),
}


def bank_songs(profile: RunProfile, *, songs: int = SONGS, trainings: int = 3) -> OwnSongs:
    """Synthetic songs that no training heard, and generators that correct dances of the bank, trained unless before.

    Each song has a take of the bank in place of a recorded dancer: what a body does that hears another music. It is
    danced for as long as the take is, 30 s at most.
    """
    bank = shipped_bank(STYLE)
    runs = {
        (name, seed): _trained(profile, seed, changes)
        for name, (changes, most) in TRAININGS.items()
        for seed in range(1, min(most, trainings) + 1)
    }
    folder = song_folder("unheard", clips=songs, seconds=SONG_SECONDS, seed=SEED)
    kept = _with_takes([load_recording(one) for one in find_recordings(folder).folders], bank)
    systems = {key: HarmoGAN.load(run) for key, run in runs.items()}
    pose_net = load_pose_net(next(iter(runs.values())) / POSE_NET)
    return OwnSongs(replace(profile, draws=1), kept, kept, systems, pose_net, bank.limits)


def _trained(profile: RunProfile, seed: int, changes: dict[str, Any]) -> Path:
    """The folder of a training on the bank's dances to synthetic songs."""
    clips, more = TAUGHT, dict(changes)
    if profile.epochs:
        clips = profile.n_clips // 5
        more |= {"adversarial_epochs": 1, "pose_epochs": profile.pose_epochs, "sketches": 1}
    data = song_folder("taught", clips=clips, seconds=SONG_SECONDS, seed=profile.seed)
    model, params = model_params(profile), replace(TrainParams.recommended(), seed=seed, **more)
    return kept_run(
        "bank",
        {"data": data.name, "style": STYLE, "model": model, "params": params},
        lambda options: train_on_bank(data, options, style=STYLE, model=model, seed=seed, **more),
    )


def _with_takes(songs: Sequence[Recording], bank: Choreographer) -> tuple[Recording, ...]:
    """The songs with the bank's long takes, in turn, in place of their dancers, and without the name of a dance."""
    takes = cycle(take for take in bank.takes if take.motion.duration >= SHORTEST)
    pairs = zip(songs, takes, strict=False)
    return tuple(replace(song, clip=replace(song.clip, motion=take.motion, dance="")) for song, take in pairs)


def tables(own: OwnSongs) -> dict[str, pd.DataFrame]:
    """Means of all rows, differences by song, and what is made of sketches beside the beat; nothing of bar patterns."""
    long = own_dances(own)
    differences = song_differences(long).dropna(subset="change")
    frames = {"songs": song_means(long), "differences": differences, "hearing": hearing(own)}
    return {name: frame.dropna(axis="columns", how="all") for name, frame in frames.items()}


def main(argv: Sequence[str] | None = None) -> None:
    """Write the tables to a folder, and print them."""
    os.environ.setdefault("HARMOLAB_PROFILE", "full")
    parser = argparse.ArgumentParser(description=" ".join((__doc__ or "").split()))
    parser.add_argument("out", type=Path, help="folder of songs.csv, differences.csv and hearing.csv")
    parser.add_argument("--songs", type=int, default=SONGS, help="songs that are kept from training (%(default)s)")
    parser.add_argument("--trainings", type=int, default=3, help="trainings of the recommended loss (%(default)s)")
    given = parser.parse_args(argv)
    own = bank_songs(RunProfile.from_env(), songs=given.songs, trainings=given.trainings)
    given.out.mkdir(parents=True, exist_ok=True)
    for name, frame in tables(own).items():
        with atomic_write(given.out / f"{name}.csv") as part:
            frame.round(4).to_csv(part, index=False)
        print(f"\n{name}\n{frame.round(2).to_string(index=False)}", flush=True)


if __name__ == "__main__":
    main()
