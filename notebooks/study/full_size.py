"""Trainings as large and as long as the papers', for a machine with a GPU: ``python -m study.full_size``.

They are kept in the cache folder, where notebooks 09, 10 and 16 find them in the profile "gpu"; a run that was cut off
goes on. ``--minutes`` trains two epochs of each and says how long the whole takes on this machine at most. ``--tiny``
trains tiny networks for two epochs, to see that everything is there.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.ren2020.params import RenParams
from study.experiments.clock import epoch_seconds
from study.experiments.generation import VARIANTS, generator_corpora, trained
from study.experiments.music2dance import ABLATIONS, ablated, trained_dancer
from study.experiments.rivals import lee2019, ren2020
from study.profile import RunProfile

PAIR = ("paper, without", "paper")  # with and without the harmony loss


def trainings(profile: RunProfile, corpus: str) -> Iterator[tuple[str, Callable[[], object]]]:
    """Name and training of every network that the papers' Figs. 8 to 12 and Tables 1 and 2 need, seed by seed."""
    for seed in range(1, profile.n_seeds + 1):
        for name in PAIR:
            yield f"HarmoGAN, {name}, seed {seed}", partial(trained, profile, corpus, VARIANTS[name], seed)
    for seed in range(1, profile.n_rivals + 1):
        yield f"Lee et al. 2019, seed {seed}", partial(lee2019, profile, corpus, seed)
        yield f"Ren et al. 2020, seed {seed}", partial(ren2020, profile, corpus, seed)
    for seed in range(1, profile.n_dancers + 1):
        for name in ABLATIONS:  # the whole among them, which is the paper's network
            settings = ablated(name, profile.ablation_share)
            yield f"Music2Dance, {name}, seed {seed}", partial(trained_dancer, profile, corpus, settings, seed)


def schedules(profile: RunProfile) -> dict[str, tuple[int, dict[str, int]]]:
    """Kind of run, as its folder is called: how many there are, and the epochs of its phases."""
    gan, lee, ren, dancer = TrainParams.paper(), LeeParams.paper(), RenParams.paper(), Music2DanceParams.paper()
    units = {"style": lee.style_epochs, "units": lee.unit_epochs, "composition": lee.composition_epochs}
    before = {"pose network": gan.pose_epochs, "pretrain": gan.pretrain_epochs}
    frames = {"teacher": dancer.first_epochs, "feedback": dancer.second_epochs}
    return {
        "pretrained": (profile.n_seeds, before),
        "run": (len(PAIR) * profile.n_seeds, {"adversarial": gan.adversarial_epochs}),
        "lee2019": (profile.n_rivals, units),
        "ren2020": (profile.n_rivals, {"ST-GCN": ren.graph_epochs, "adversarial": ren.epochs}),
        "music2dance": (len(ABLATIONS) * profile.n_dancers, frames),
    }


def run_minutes(runs: Path, profile: RunProfile) -> dict[str, float]:
    """Minutes that all runs of a kind take at most, by the last epoch of each phase of those in a folder.

    A last epoch is validated, which most others are not.
    """
    minutes = {}
    for kind, (count, phases) in schedules(profile).items():
        epochs = map(epoch_seconds, runs.glob(f"{kind}-*.seconds.json"))
        seconds = [sum(one.get(phase, 0.0) * number for phase, number in phases.items()) for one in epochs]
        minutes[kind] = count * max(seconds, default=0.0) / 60
    return minutes


def measured(profile: RunProfile, corpus: str) -> dict[str, float]:
    """`run_minutes` of this machine, by two epochs of one training of each kind, full in size, in its own folder."""
    short = replace(profile, epochs=(2, 2), pose_epochs=2, n_seeds=1, n_rivals=1, n_dancers=1)
    before = os.environ.get("HARMOLAB_CACHE")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HARMOLAB_CACHE"] = folder
        try:
            for name, train in trainings(short, corpus):
                if "Music2Dance" not in name or ", whole," in name:
                    train()
        finally:
            os.environ.pop("HARMOLAB_CACHE") if before is None else os.environ.update(HARMOLAB_CACHE=before)
        return run_minutes(Path(folder) / "runs", profile)


def main(arguments: Sequence[str] | None = None) -> int:
    """Trains what is not yet trained, and says how long each took; with ``--minutes`` says how long all would take."""
    parser = argparse.ArgumentParser(prog="python -m study.full_size", description=__doc__)
    parser.add_argument("--tiny", action="store_true", help="tiny networks, two epochs")
    parser.add_argument("--minutes", action="store_true", help="measure two epochs of each, and train nothing else")
    options = parser.parse_args(arguments)
    profile = RunProfile.quick() if options.tiny else RunProfile.gpu()
    corpus = generator_corpora(profile)[0]
    if options.minutes:
        minutes = measured(profile, corpus)
        lines = [f"{kind}: {number:.0f} min for all {schedules(profile)[kind][0]}" for kind, number in minutes.items()]
        print("\n".join([*lines, f"together, at most: {sum(minutes.values()) / 60:.1f} h on this machine"]))
        return 0
    every = list(trainings(profile, corpus))
    for number, (name, train) in enumerate(every, 1):
        start = time.perf_counter()
        train()
        print(f"{number} of {len(every)}: {name}, {(time.perf_counter() - start) / 60:.1f} min", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
