"""From a song to a dance with a trained network: the song heard in windows, then frame after frame."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from harmolab.files import Progress
from harmolab.systems.music2dance.codes import RotationCode
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.networks import CONTACTS, DanceNetwork
from harmolab.systems.music2dance.sampler import Sampler, sampler
from harmolab.systems.music2dance.sequences import LEAST_STD, cells_from, n_cells
from harmolab.systems.training.feet import on_floor, standing_dancer
from harmolab.systems.training.layers import Normaliser
from harmolab.types import FloatArray

Feet = Literal["planted", "model", "none"]
FEET: tuple[Feet, ...] = ("planted", "model", "none")
EDGE = 1e-3  # weight of a window at its ends


@dataclass(frozen=True, eq=False)
class Danced:
    """A dance as the network made it.

    Parameters
    ----------
    code : (T, C) array, the motion code, not standardised
    contacts : (T, 2) array, 1 where a foot stands
    """

    code: FloatArray
    contacts: FloatArray


@torch.no_grad()
def heard_song(network: DanceNetwork, music: NDArray[np.float32], moments: FloatArray) -> torch.Tensor:
    """A song (M, F), not standardised, as the network hears it at moments (T,): (T, c).

    The LSTM of the mapping was trained on windows of eight seconds. So it hears a longer song in such windows, every
    four seconds, each faded into the next (R37).
    """
    params = network.params.song
    count, hop = n_cells(params), max(1, round(params.hop * params.rate))
    first, last = int(np.floor(moments[0])) - hop, int(np.ceil(moments[-1]))
    n_heard = params.n_audio if network.mapping is None else network.mapping.size
    total, weights = torch.zeros(len(moments), n_heard), torch.zeros(len(moments), 1)
    for start in range(first, last + 1, hop):
        places = moments - start
        rows = torch.from_numpy(np.flatnonzero((places >= 0) & (places <= count - 1)))
        window = network.audio_scale(torch.from_numpy(cells_from(music, start, count))[None])
        at = torch.from_numpy(places).float()[rows]
        mapped = network.music_at(window, at[None])[0]
        share = torch.minimum(at, count - 1 - at)[:, None] + EDGE
        total.index_add_(0, rows, share * mapped)
        weights.index_add_(0, rows, share)
    return total / weights


def danced(
    network: DanceNetwork, music: NDArray[np.float32], *, start: float, frames: int, dance: int, seed: int,
    prior: FloatArray, progress: Progress,
) -> Danced:  # fmt: skip
    """A dance of `frames` frames to a song from audio time `start` on (Eq. 12-13).

    Parameters
    ----------
    network : DanceNetwork in evaluation mode, on the CPU
    music : (M, F) features of the whole song, not standardised
    start : float, seconds of audio time of the first frame
    frames : int
    dance : int, number of the dance
    seed : int, of the draws
    prior : (P, C + 2) array, motion and contacts that the dance goes on from; P may be 0
    progress : function(iterable, label) -> iterable
    """
    params, before = network.params, len(prior)
    moments = (start + np.arange(-before, frames) / params.fps) * params.song.rate
    net = sampler(network, heard_song(network, music, moments), dance)
    mean, std = _scale(network.motion_scale)
    first = np.column_stack([(prior[:, :-CONTACTS] - mean) / std, prior[:, -CONTACTS:]]).astype(np.float32)
    draws = correlated_draws((frames, len(mean)), params.draw_memory * params.fps, np.random.default_rng(seed))
    rows = _frames(net, first, draws, params.temperature, progress)
    code = rows[:, :-CONTACTS].astype(np.float64)
    if params.smoothing:
        code = gaussian_filter1d(code, params.smoothing * params.fps, axis=0, mode="nearest")
    return Danced((code * std + mean)[before:], rows[before:, -CONTACTS:].astype(np.float64))


def dance_positions(network: DanceNetwork, dance: Danced, feet: Feet, model: FootModel | None = None) -> FloatArray:
    """Positions (T, J, 3) of a dance on the floor: a `standing_dancer`, corrected by a foot model, or as they are.

    Raises
    ------
    ValueError
        If the network or the foot model gives numbers that are not finite.
    """
    code, fps = network.motion_code, network.params.fps
    values = dance.code if feet != "model" or model is None else corrected(model, dance, fps)
    if not np.isfinite(values).all():
        raise ValueError(f"the {'foot model' if feet == 'model' else 'network'} gives no finite dance; train it anew")
    positions = code.decode(values, fps)
    if feet == "planted":
        return standing_dancer(positions, fps, code.skeleton, dance.contacts)
    return on_floor(positions, fps)


def corrected(model: FootModel, dance: Danced, fps: float) -> FloatArray:
    """The motion code (T, C) of a dance with a foot model's increments (Eq. 14).

    In a code of rotations the model sees the feet where the rotations put them, as it does in training, and not where
    the network predicts them.
    """
    code = model.motion_code
    return model.correct(
        code.refreshed(dance.code, fps) if isinstance(code, RotationCode) else dance.code, dance.contacts
    )


def _frames(
    net: Sampler, first: NDArray[np.float32], draws: NDArray[np.float32], temperature: float, progress: Progress
) -> NDArray[np.float32]:
    """Motion and contacts (P + T, C + 2): the frames `first` (P, C + 2), then one for each of the draws (T, C)."""
    rows = np.zeros((len(first) + len(draws), first.shape[1]), np.float32)
    frame = np.zeros(first.shape[1], np.float32)
    for number in progress(range(len(rows)), "dancing"):
        expected, sigma, logits = net.step(frame, number)
        if number < len(first):
            frame = first[number]
        else:
            drawn = np.float32(temperature) * sigma * draws[number - len(first)]
            frame = np.concatenate([expected + drawn, logits > 0], dtype=np.float32)
        rows[number] = frame
    return rows


def correlated_draws(shape: tuple[int, int], memory: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draws (T, C) of a standard normal distribution, of which frames `d` apart correlate by exp(-d / memory).

    Each channel is an autoregression of the first order: x(t) = a x(t - 1) + sqrt(1 - a^2) e(t), a = exp(-1 / memory).

    Parameters
    ----------
    shape : frames, channels
    memory : float, frames; 0 for draws that have nothing to do with each other
    rng : Generator
    """
    draws = rng.standard_normal(shape, dtype=np.float32)
    if not memory or not len(draws):
        return draws
    share = np.exp(-1 / memory)
    draws[1:] *= np.sqrt(1 - share**2)
    return lfilter([1.0], [1.0, -share], draws, axis=0).astype(np.float32)


def _scale(scale: Normaliser) -> tuple[FloatArray, FloatArray]:
    mean, std = (part.detach().cpu().double().numpy() for part in (scale.mean, scale.std))
    return mean, np.maximum(std, LEAST_STD)
