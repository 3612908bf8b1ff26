"""From a song to a dance with a trained network: the song heard in windows, then frame after frame.

Dancing frame by frame is done in numpy, where every convolution remembers what it saw. Convolved anew for each frame, a
WaveNet of 125 frames' reach costs 125 times as much. Here each block keeps the values of its last `dilation` frames in
a ring. What music and dance add to every gate is known before the dance begins.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy
import torch
from scipy.ndimage import gaussian_filter1d
from scipy.special import expit

from harmolab.files import Progress
from harmolab.systems.music2dance.codes import RotationCode
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.networks import CONTACTS, MOST_SPREAD, DanceNetwork, LstmDancer, WaveNet
from harmolab.systems.music2dance.sequences import LEAST_STD, cells_from, n_cells
from harmolab.systems.training.feet import on_floor, standing_dancer
from harmolab.systems.training.layers import Normaliser
from harmolab.types import FloatArray, SingleArray

Feet = Literal["planted", "model", "none"]
FEET: tuple[Feet, ...] = ("planted", "model", "none")
EDGE = 1e-3  # weight of a window at its ends
Step = tuple[SingleArray, SingleArray, SingleArray]


class Sampler:
    """A network that dances one song, frame by frame.

    Parameters
    ----------
    net : WaveNet or LstmDancer
    """

    def __init__(self, net: WaveNet | LstmDancer) -> None:
        self.head, self.n_motion = _affine(net.head.layer), net.head.n_motion
        self.carry, self.least = np.float32(net.head.carry), np.float32(net.head.least)

    def step(self, frame: SingleArray, number: int) -> Step:
        """Mean (C,), standard deviation (C,) and contact logits (2,) of frame `number`, after the frame (C + 2,)."""
        raise NotImplementedError

    def predicted(self, values: SingleArray, frame: SingleArray) -> Step:
        """As `networks.Head`, of one frame."""
        values, n_motion = values @ self.head[0] + self.head[1], self.n_motion
        spread = np.minimum(values[n_motion : 2 * n_motion], np.float32(MOST_SPREAD))
        sigma = self.least + np.logaddexp(np.float32(0), spread)
        return values[:n_motion] + self.carry * frame[:n_motion], sigma, values[2 * n_motion :]


def sampler(network: DanceNetwork, music: torch.Tensor, dance: int) -> Sampler:
    """The sampler of a network for heard music (T, c), one row a frame, and the number of a dance."""
    body: Any = network.body
    with torch.no_grad():
        vector = network.vectors(torch.tensor([dance]))
        return (CachedWaveNet if isinstance(body, WaveNet) else SteppedLstm)(body, music, vector)


class CachedWaveNet(Sampler):
    """A `WaveNet` that remembers.

    Parameters
    ----------
    net : WaveNet
    music : (T, c) tensor, of each frame that will be predicted
    dance : (1, d) tensor
    """

    def __init__(self, net: WaveNet, music: torch.Tensor, dance: torch.Tensor) -> None:
        super().__init__(net)
        front: Any = net.front
        blocks: list[Any] = list(net.blocks)
        self.front = [_affine(front[0]), _affine(front[2])]
        self.dilations: list[int] = [block.dilation for block in blocks]
        # Both taps of a convolution as one matrix: the frame `dilation` ago, then this one.
        taps = [block.seeing.weight for block in blocks]
        self.seeing = [_array(torch.cat([tap[..., 0], tap[..., 1]], dim=1).T) for tap in taps]
        self.given = [_array(block.seeing.bias + block.hearing(music) + block.knowing(dance)) for block in blocks]
        self.onward = [None if block.onward is None else _affine(block.onward) for block in blocks]
        # What goes aside is added up over the blocks: one product of all their gates.
        self.aside = _array(torch.cat([block.aside.weight for block in blocks], dim=1).T)
        self.aside_bias = _array(torch.stack([block.aside.bias for block in blocks]).sum(dim=0))
        self.joining = _affine(net.joining)
        size = int(front[2].out_features)
        self.rings = [np.zeros((dilation, size), np.float32) for dilation in self.dilations]
        self.gates = np.zeros((len(self.dilations), size), np.float32)

    def step(self, frame: SingleArray, number: int) -> Step:
        """As of `Sampler`; call it with number 0, 1, 2, ... in turn."""
        values = frame
        for weight, bias in self.front:
            values = np.maximum(values @ weight + bias, 0)
        size = values.size
        for place, dilation in enumerate(self.dilations):
            slot = self.rings[place][number % dilation]
            convolved = np.concatenate([slot, values]) @ self.seeing[place] + self.given[place][number]
            slot[:] = values
            gate = np.tanh(convolved[:size]) * expit(convolved[size:])
            self.gates[place] = gate
            if (onward := self.onward[place]) is not None:
                values = values + gate @ onward[0] + onward[1]
        joined = np.maximum(self.gates.ravel() @ self.aside + self.aside_bias, 0)
        joined = np.maximum(joined @ self.joining[0] + self.joining[1], 0)
        return self.predicted(joined, frame)


class SteppedLstm(Sampler):
    """An `LstmDancer`, one step at a time; parameters as of `CachedWaveNet`."""

    def __init__(self, net: LstmDancer, music: torch.Tensor, dance: torch.Tensor) -> None:
        super().__init__(net)
        reader: Any = net.reader
        n_frame = self.n_motion + CONTACTS
        self.frame = _array(reader.weight_ih_l0[:, :n_frame].T)
        rest = torch.cat([music, dance.expand(len(music), -1)], dim=1) @ reader.weight_ih_l0[:, n_frame:].T
        self.given = _array(rest + reader.bias_ih_l0 + reader.bias_hh_l0)
        self.past = _array(reader.weight_hh_l0.T)
        self.state, self.memory = np.zeros((2, reader.hidden_size), np.float32)

    def step(self, frame: SingleArray, number: int) -> Step:
        """As of `Sampler`."""
        entry, forget, new, out = np.split(frame @ self.frame + self.state @ self.past + self.given[number], 4)
        self.memory = expit(forget) * self.memory + expit(entry) * np.tanh(new)
        self.state = expit(out) * np.tanh(self.memory)
        return self.predicted(self.state, frame)


def _affine(layer: torch.nn.Linear) -> tuple[SingleArray, SingleArray]:
    """Weight, to multiply rows from the right, and bias."""
    return _array(layer.weight.T), _array(layer.bias)


def _array(values: torch.Tensor) -> SingleArray:
    return np.ascontiguousarray(values.detach().cpu().numpy(), dtype=np.float32)


# A dance to a whole song


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
def heard_song(network: DanceNetwork, music: SingleArray, moments: FloatArray) -> torch.Tensor:
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
    network: DanceNetwork, music: SingleArray, *, start: float, frames: int, dance: int, seed: int,
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
    fresh = code.refreshed(dance.code, fps) if isinstance(code, RotationCode) else dance.code
    return model.correct(fresh, dance.contacts)


def _frames(
    net: Sampler, first: SingleArray, draws: SingleArray, temperature: float, progress: Progress
) -> SingleArray:
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


def correlated_draws(shape: tuple[int, int], memory: float, rng: np.random.Generator) -> SingleArray:
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
    return scipy.signal.lfilter([1.0], [1.0, -share], draws, axis=0).astype(np.float32)


def _scale(scale: Normaliser) -> tuple[FloatArray, FloatArray]:
    mean, std = (part.detach().cpu().double().numpy() for part in (scale.mean, scale.std))
    return mean, np.maximum(std, LEAST_STD)
