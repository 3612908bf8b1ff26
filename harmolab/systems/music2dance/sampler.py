"""Dancing frame by frame with a trained network, in numpy: every convolution remembers what it saw.

Convolved anew for each frame, a WaveNet of 125 frames' reach costs 125 times as much. Here each block keeps the values
of its last `dilation` frames in a ring. What music and dance add to every gate is known before the dance begins.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit

from harmolab.systems.music2dance.networks import CONTACTS, MOST_SPREAD, DanceNetwork, LstmDancer, WaveNet

SingleArray = NDArray[np.float32]
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
