"""Records behind the pictures of notebook 18: sound, points, their components, the delay, the network's sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.body.skeletons import Skeleton
from harmolab.musician.avatar import avatar
from harmolab.musician.cleaning import usable_steps
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PointSpace, fitted_space, sides, steps_of
from harmolab.musician.sound_features import sound_features
from harmolab.musician.synthetic import PlantedPerformance
from harmolab.musician.train import initial_network
from harmolab.systems.training.layers import parameter_count
from harmolab.types import Audio, BoolArray, FloatArray, Motion, Notes
from study.experiments.players import PlayerData, read_set

SHARES = (0.9, 0.99, 0.999)  # of the variance, for which components are counted
MODES_SHOWN = 3


@dataclass(frozen=True, eq=False)
class PlayedClip:
    """A stretch of a planted performance on its way from sound to avatar (Fig. 1).

    Parameters
    ----------
    audio : Audio of the stretch
    notes : Notes, on its time line
    features : (T, 28) array, in standard deviations of the recording
    feature_names : 28 names
    points : Motion, (T, 50, 2) pixels: as planted, without noise
    avatar : Motion, (T, J, 3) metres
    """

    audio: Audio
    notes: Notes
    features: FloatArray
    feature_names: tuple[str, ...]
    points: Motion
    avatar: Motion


def played_clip(planted: PlantedPerformance, *, start: float = 2.0, seconds: float = 6.0) -> PlayedClip:
    """The stretch from `start` on, with the features and the avatar that belong to it; ValueError without sound."""
    performance = planted.performance
    if performance.audio is None or performance.notes is None:
        raise ValueError(f"{performance.name}: sound and notes are needed")
    motion = performance.motion
    params = Audio2BodyParams(fps=motion.fps)
    features = sound_features(performance.audio, params, motion.n_frames)
    features = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-6)
    clean = Motion(planted.clean, motion.fps, motion.skeleton)
    body = avatar(clean, performance.instrument)
    rows = slice(round(start * motion.fps), round((start + seconds) * motion.fps))
    return PlayedClip(
        performance.audio.span(start, seconds),
        performance.notes.span(start, seconds),
        features[rows],
        feature_names(params),
        clean.span(start, seconds),
        body.span(start, seconds),
    )


def feature_names(params: Audio2BodyParams) -> tuple[str, ...]:
    """Names of the 28 (or 27) numbers a frame, in their order."""
    values = [*(f"MFCC {number}" for number in range(params.mfcc)), "log energy"]
    return (*values, *(f"slope of {name}" for name in values[: params.mfcc + params.energy_delta]))


@dataclass(frozen=True, eq=False)
class PointModes:
    """The mean pose of the training pieces and the directions in which points move most.

    Parameters
    ----------
    mean : (P, 2) array, pixels
    moves : (n, P, 2) array, pixels for one standard deviation of each component
    shares : (2 P,) array, of the variance, falling
    counts : share (of `SHARES`) -> number of components that hold it
    skeleton : of the points
    """

    mean: FloatArray
    moves: FloatArray
    shares: FloatArray
    counts: dict[float, int]
    skeleton: Skeleton


def point_modes(data: PlayerData, *, count: int = MODES_SHOWN) -> PointModes:
    """The first `count` principal components of the accepted training frames as displacements of the points."""
    played = read_set(data, Audio2BodyParams.tables(data.instrument))
    train = sides(played.sequences, data.sides(played.params).train)
    frames = np.concatenate([each.points[each.learnt] for each in train])
    every = PointSpace.fit(frames, frames.shape[1], even_scale=False)
    variances = np.square(every.encode(frames) * every.scale).mean(axis=0)
    shares = variances / variances.sum()
    moves = every.basis[:count] * np.sqrt(variances[:count, None])
    counts = {share: int(np.searchsorted(np.cumsum(shares), share)) + 1 for share in SHARES}
    return PointModes(every.mean.reshape(-1, 2), moves.reshape(count, -1, 2), shares, counts, played.skeleton)


@dataclass(frozen=True, eq=False)
class DelayedSteps:
    """The first component of a piece as the network learns it: frames, steps between them, and steps moved later.

    Parameters
    ----------
    frame_times, frames : (T,) arrays; seconds, pixels
    accepted : (T,) mask
    step_times, steps : (S,) arrays
    usable : (S,) mask of the steps whose error counts
    delays : milliseconds by which steps are moved, each a whole number of steps
    """

    frame_times: FloatArray
    frames: FloatArray
    accepted: BoolArray
    step_times: FloatArray
    steps: FloatArray
    usable: BoolArray
    delays: tuple[float, ...]


def delayed_steps(data: PlayerData, *, delays: Sequence[float] = (0.024, 0.125), frames: int = 14) -> DelayedSteps:
    """So many frames of the first training piece, around its rejected frame where the component moves most."""
    params = replace(Audio2BodyParams.tables(data.instrument), fps=data.fps)
    played = read_set(data, params)
    train = sides(played.sequences, data.sides(params).train)
    space = fitted_space(train, params)
    curve = space.encode(train[0].points)[:, :1] * space.scale[0]
    starts = np.maximum(np.flatnonzero(~train[0].accepted) - frames // 2, 0)
    ranges = [np.ptp(curve[start : start + frames]) for start in starts]
    start = int(starts[np.argmax(ranges)]) if ranges else 0
    rows = slice(start, start + frames)
    values = curve[rows]
    steps, accepted = steps_of(values, params.upsample)[:, 0], train[0].accepted[rows]
    return DelayedSteps(
        np.arange(len(values)) / params.fps,
        values[:, 0],
        accepted,
        np.arange(len(steps)) / params.step_rate,
        steps,
        usable_steps(accepted, params.upsample),
        tuple(1000 * replace(params, delay=delay).delay_steps / params.step_rate for delay in delays),
    )


def untrained_player(data: PlayerData) -> SoundToPoints:
    """The network of the tables before any training, in the paper's sizes."""
    params = replace(Audio2BodyParams.tables(data.instrument), fps=data.fps)
    played = read_set(data, params)
    space = fitted_space(sides(played.sequences, data.sides(params).train), params)
    network = initial_network(played, len(space.basis))
    network.space_scale.set(space)
    return network


def player_boxes(network: SoundToPoints) -> dict[str, str]:
    """Heading -> words of every part of a network, sizes and counts of parameters read from it (Fig. 4)."""
    params, lstm, linear = network.params, network.lstm, network.linear
    points = len(network.skeleton.joints)
    milliseconds = 1000 * params.delay_steps / params.step_rate
    return {
        "sound": f"{params.n_sound} numbers a frame\n{params.fps:g} frames a second",
        "steps": f"{params.upsample} a frame, straight lines\n{params.step_rate:g} a second",
        "LSTM": f"{lstm.input_size} to {lstm.hidden_size}, one direction\n{_count_of(parameter_count(lstm), network)}",
        "dropout": f"{network.dropout.p:g}, in training only\non the LSTM's output",
        "linear": f"{linear.in_features} to {linear.out_features}\n{_count_of(parameter_count(linear), network)}",
        "components": f"{linear.out_features} at each step\n{params.delay_steps} steps ({milliseconds:.0f} ms) late",
        "frames": f"every {params.upsample}th step, from\nthe first after the delay",
        "points": f"{linear.out_features} components and the mean\nto {points} points, {2 * points} numbers",
    }


def _count_of(count: int, network: SoundToPoints) -> str:
    return f"{count:,} of {parameter_count(network):,} parameters"
