"""The first component of the points over the epochs of a training (Fig. 5), and to sound that is no music (Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from harmolab.musician.networks import SoundToPoints
from harmolab.musician.perform import predicted_points
from harmolab.musician.sequences import sides
from harmolab.musician.sound_features import sound_features
from harmolab.types import Audio, BoolArray, FloatArray
from study.experiments.player_tables import FINAL, row_settings
from study.experiments.players import PlayerData, TrainedPlayer, profiled, read_set, trained_player
from study.profile import RunProfile

EPOCHS_SHOWN = (1, 10, 100)  # of Fig. 5, and the last
MUSIC, NOISE_SOUND, NOISE_FEATURES = "music", "white noise as sound", "random features"
NOISE_RATE = 44100.0  # hertz


@dataclass(frozen=True, eq=False)
class ModeOverEpochs:
    """The first component of a test piece, tracked and predicted after some epochs.

    Parameters
    ----------
    name : of the piece
    times : (T,) array, seconds
    tracked : (T,) array, pixels (millimetres of real hands)
    accepted : (T,) mask of the frames that correlations are taken over
    predicted : epochs -> (T,) array
    correlations : epochs -> float
    """

    name: str
    times: FloatArray
    tracked: FloatArray
    accepted: BoolArray
    predicted: dict[int, FloatArray]
    correlations: dict[int, float]


def shown_epochs(last: int) -> tuple[int, ...]:
    """The epochs of Fig. 5 that a training of `last` epochs has, and `last`.

    >>> shown_epochs(30)
    (1, 10, 30)
    """
    return (*(epoch for epoch in EPOCHS_SHOWN if epoch < last), last)


def mode_over_epochs(profile: RunProfile, data: PlayerData, *, seed: int = 1) -> ModeOverEpochs:
    """Fig. 5: the first component of the first test piece after the epochs of `shown_epochs`, final settings.

    A training keeps its best epoch, so "after 10" is the best of the first ten.
    """
    settings = row_settings(data, FINAL)
    last = profiled(profile, data, settings).epochs
    runs = {epochs: trained_player(profile, data, settings, seed, epochs=epochs) for epochs in shown_epochs(last)}
    network = runs[last].system.network
    played = read_set(data, network.params)
    piece = sides(played.sequences, data.split.test)[0]
    curves = {epochs: first_mode(run.system.network, predicted_points(run.system.network, piece.sound))
              for epochs, run in runs.items()}  # fmt: skip
    tracked, kept = first_mode(network, piece.points), piece.accepted
    return ModeOverEpochs(
        piece.name,
        np.arange(len(tracked)) / network.params.fps,
        tracked,
        kept,
        curves,
        {epochs: correlation(curve[kept], tracked[kept]) for epochs, curve in curves.items()},
    )


def correlation(one: FloatArray, other: FloatArray) -> float:
    """Pearson's correlation of two curves; NaN where one does not move."""
    if min(np.ptp(one), np.ptp(other)) == 0:
        return float("nan")
    return float(np.corrcoef(one, other)[0, 1])


def first_mode(network: SoundToPoints, points: FloatArray) -> FloatArray:
    """First component (T,), in the units of the points (T, 2 P)."""
    space = network.space_scale.space
    return np.asarray(space.encode(points)[:, 0] * space.scale[0])


@dataclass(frozen=True, eq=False)
class RandomInputs:
    """Components that a network predicts to sound that is no music.

    Parameters
    ----------
    times : (T,) array, seconds
    curves : `MUSIC`, `NOISE_SOUND`, `NOISE_FEATURES` -> (T,) first component of the first test piece, or as long
    table : DataFrame with the columns input, "SD 1", "SD 2" (of the first two components, means over as many pieces as
        are tested on), "speed 1" (mean change a second of the first), and each as a share of that to music
    """

    times: FloatArray
    curves: dict[str, FloatArray]
    table: pd.DataFrame


def random_inputs(data: PlayerData, run: TrainedPlayer, *, seed: int = 0) -> RandomInputs:
    """Fig. 6: components to the music of the test pieces, to white noise of the same length, and to random features.

    White noise is a sound and goes through the whole chain. Random features take its place behind it: drawn from
    N(0, 1) for each frame and each of the network's normalised inputs, all of them at once.
    """
    network, rng = run.system.network, np.random.default_rng(seed)
    played = read_set(data, network.params)
    fps = network.params.fps
    components: dict[str, list[FloatArray]] = {MUSIC: [], NOISE_SOUND: [], NOISE_FEATURES: []}
    for sequence in sides(played.sequences, data.split.test):
        count = len(sequence.sound)
        noise = Audio(rng.normal(0.0, 0.1, int(np.ceil(count / fps * NOISE_RATE))), NOISE_RATE)
        inputs = {
            MUSIC: sequence.sound,
            NOISE_SOUND: sound_features(noise, network.params, count, cached=False),
            NOISE_FEATURES: random_features(network, count, rng),
        }
        for name, values in inputs.items():
            points = predicted_points(network, values)
            space = network.space_scale.space
            components[name].append(space.encode(points) * space.scale)
    curves = {name: values[0][:, 0] for name, values in components.items()}
    return RandomInputs(np.arange(len(curves[MUSIC])) / fps, curves, spread_table(components, fps))


def random_features(network: SoundToPoints, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, F) features that are N(0, 1) once they are normalised."""
    mean, std = (values.cpu().numpy() for values in (network.sound_scale.mean, network.sound_scale.std))
    return np.asarray(mean + std * rng.standard_normal((count, len(mean))), np.float32)


def spread_table(components: dict[str, list[FloatArray]], fps: float) -> pd.DataFrame:
    """Spread of the first two components: see `RandomInputs.table`; `components` are (T, n) by input and piece."""
    rows = []
    for name, pieces in components.items():
        spreads = np.mean([values[:, :2].std(axis=0) for values in pieces], axis=0)
        speed = np.mean([np.abs(np.diff(values[:, 0])).mean() * fps for values in pieces])
        rows.append({"input": name, "SD 1": spreads[0], "SD 2": spreads[-1], "speed 1": speed})
    table = pd.DataFrame(rows)
    music = table.set_index("input").loc[MUSIC]
    for name in ("SD 1", "SD 2", "speed 1"):
        table[f"{name} / music"] = table[name] / music[name]
    return table
