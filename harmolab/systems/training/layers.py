"""Parts of several systems' networks: normalisation, convolutions over time, motion coding, a coder of songs.

Normalisation is by the statistics of the training split. The motion coding is that of `motion_code` in torch:
differentiable, batched, without loops over time. A code has C = 3 J + 3 channels: the joints of every frame seen from
the dancer's heading, above the root's place on the floor (metres, J x 3), the root's velocity to the side and forward
(m/s), and the yaw rate (rad/s).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import batch_norm

from harmolab.body.skeletons import ancestors

# A channel that hardly varies (the root's own x and z never do) is not blown up to variance one.
_LEAST_STD = 1e-3
SLOPE = 0.1  # of the bend in `perceptron`


@contextmanager
def drawn_by(seed: int, device: torch.device | None = None) -> Iterator[None]:
    """Random numbers of torch, on the CPU and `device`, by a seed; afterwards they go on as before."""
    with torch.random.fork_rng(devices=[device] if device is not None and device.type == "cuda" else []):
        torch.manual_seed(seed)
        yield


def channel_statistics(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (C,) of values (N, T, C) over frames whose mask (N, T) is 1; ValueError without."""
    real = values[mask > 0.5].double()
    if not len(real):
        raise ValueError("mask must keep at least one frame to take statistics from")
    return real.mean(dim=0).float(), real.std(dim=0, correction=0).float()


class Normaliser(nn.Module):
    """To mean zero and standard deviation one, channel by channel; changes nothing until its statistics are set."""

    mean: Tensor
    std: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("std", torch.ones(channels))

    def set(self, mean: Tensor, std: Tensor) -> None:
        """Keep (channels,) mean and standard deviation; ValueError for other shapes, NaN, or a negative deviation."""
        for name, values in (("mean", mean), ("standard deviation", std)):
            if values.shape != self.mean.shape:
                raise ValueError(f"{name} must have shape {tuple(self.mean.shape)}, got {tuple(values.shape)}")
            if not bool(values.isfinite().all()):
                raise ValueError(f"{name} must be finite, got {values.tolist()}")
        if bool((std < 0).any()):
            raise ValueError(f"standard deviation must be zero or more, got {std.min().item()}")
        self.mean.copy_(mean)
        self.std.copy_(std)

    def forward(self, values: Tensor) -> Tensor:
        """(..., channels), in standard deviations from the mean."""
        return (values - self.mean) / self.std.clamp(min=_LEAST_STD)


def parameter_count(module: nn.Module) -> int:
    """Number of values that training changes."""
    return sum(values.numel() for values in module.parameters())


class Statistics(NamedTuple):
    """Mean and standard deviation of every channel of the training split: audio (F,), motion code (C,)."""

    audio_mean: Tensor
    audio_std: Tensor
    motion_mean: Tensor
    motion_std: Tensor

    @classmethod
    def of(cls, audio: Tensor, motion: Tensor, mask: Tensor) -> "Statistics":
        """Statistics over the frames whose mask is 1, of audio (N, T, F), motion (N, T, C) and mask (N, T)."""
        return cls(*channel_statistics(audio, mask), *channel_statistics(motion, mask))


class Normalised(nn.Module):
    """A network with a `Normaliser` of motion, and maybe one of audio."""

    def set_statistics(self, statistics: Statistics) -> None:
        """Normalise by the training split from now on."""
        for name, scale in self.named_children():
            if isinstance(scale, Normaliser):
                scale.set(*(statistics[:2] if name == "audio_scale" else statistics[2:]))

    def parameter_count(self) -> int:
        """Number of values that training changes."""
        return parameter_count(self)


def perceptron(n_in: int, n_hidden: int, n_out: int, *, first: float = 1.0) -> nn.Sequential:
    """Two linear layers with a bend between; the last one's first weights are multiplied by `first`, its bias is 0."""
    last = nn.Linear(n_hidden, n_out)
    with torch.no_grad():
        last.weight.mul_(first)
        last.bias.zero_()
    return nn.Sequential(nn.Linear(n_in, n_hidden), nn.LeakyReLU(SLOPE), last)


class MaskedConvolution(nn.Module):
    """Convolution over time that leaves padding out: (N, T, in), (N, T) -> (N, T', out), (N, T')."""

    def __init__(self, n_in: int, n_out: int, *, stride: int = 1) -> None:
        super().__init__()
        self.stride = stride
        self.convolution = nn.Conv1d(n_in, n_out, 3, stride, padding=1)

    def forward(self, values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        bent = nn.functional.leaky_relu(self.convolution(values), 0.2)
        mask = mask[:, :: self.stride]
        return bent * mask[:, None], mask


class MotionBranch(nn.Module):
    """Three convolutions over time, halving its rate after the first: (N, C, T), (N, T) -> (N, 4 c, T / 4) and mask."""

    def __init__(self, n_in: int, channels: int) -> None:
        super().__init__()
        sizes = (n_in, channels, 2 * channels, 4 * channels)
        self.layers = nn.ModuleList(
            MaskedConvolution(a, b, stride=stride) for a, b, stride in zip(sizes, sizes[1:], (1, 2, 2), strict=False)
        )

    def forward(self, values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        return self.maps(values, mask)[-1]

    def maps(self, values: Tensor, mask: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Output of each of the three layers, with its mask."""
        maps = [(values * mask[:, None], mask)]
        for layer in self.layers:
            maps.append(layer(*maps[-1]))
        return maps[1:]


def mean_over_time(values: Tensor, mask: Tensor) -> Tensor:
    """(N, c): mean of (N, c, T) over the frames whose mask (N, T) is 1."""
    return (values * mask[:, None]).sum(dim=2) / mask.sum(dim=1, keepdim=True).clamp(min=1.0)


# Batch normalisation whose statistics are floating-point numbers only, as weights on disk have to be


class BatchNorm(nn.Module):
    """Values (N, c, ...) normalised channel by channel: in training by the batch's statistics, else by those kept.

    Parameters
    ----------
    channels : int
    momentum : float, share of a batch's statistics in those kept after it; 1 keeps the last batch's
    """

    mean: Tensor
    variance: Tensor

    def __init__(self, channels: int, *, momentum: float = 0.1) -> None:
        super().__init__()
        self.momentum = momentum
        self.weight, self.bias = nn.Parameter(torch.ones(channels)), nn.Parameter(torch.zeros(channels))
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("variance", torch.ones(channels))

    def forward(self, values: Tensor) -> Tensor:
        kept = self.mean, self.variance
        return batch_norm(values, *kept, self.weight, self.bias, training=self.training, momentum=self.momentum)


# Motion coding in torch

# Root velocity to the side and forward, yaw rate: the last channels of a code.
PATH_CHANNELS = 3
# Square of a length (0.1 mm) below which a bone has no direction.
_TINY = 1e-8


def local_joints(code: Tensor) -> Tensor:
    """The joints in the heading frame, (N, T, J, 3) metres, of a code (N, T, 3 J + 3)."""
    return code[..., :-PATH_CHANNELS].unflatten(-1, (-1, 3))


def root_path(code: Tensor, fps: float) -> tuple[Tensor, Tensor]:
    """Place of the root on the floor (N, T, 2: x, z; metres) and heading (N, T; radians), from (0, 0) and 0 on.

    Rates at frame t describe the step from t - 1 to t, so those of frame 0 say nothing. A step is taken in the heading
    that it ends with.
    """
    rates = code[..., -PATH_CHANNELS:] / fps
    rates = torch.cat([torch.zeros_like(rates[:, :1]), rates[:, 1:]], dim=1)
    heading = rates[..., 2].cumsum(dim=1)
    x, z = _turned(rates[..., 0], rates[..., 1], heading)
    return torch.stack([x, z], dim=-1).cumsum(dim=1), heading


def _turned(x: Tensor, z: Tensor, heading: Tensor) -> tuple[Tensor, Tensor]:
    """x and z of floor vectors turned by `heading` about the vertical axis (0: along z; positive: towards x)."""
    sine, cosine = heading.sin(), heading.cos()
    return x * cosine + z * sine, z * cosine - x * sine


def decode(code: Tensor, fps: float) -> Tensor:
    """Joint positions in the world that a motion code stands for; starts at x = z = 0 with heading 0.

    Parameters
    ----------
    code : (N, T, 3 J + 3) tensor, not normalised
    fps : float, hertz

    Returns
    -------
    (N, T, J, 3) tensor, metres, y up. Same as `harmolab.systems.training.motion_code.decode_motion`.
    """
    path, heading = root_path(code, fps)
    x, y, z = local_joints(code).unbind(dim=-1)  # each (N, T, J)
    x, z = _turned(x, z, heading[..., None])
    return torch.stack([x + path[..., 0, None], y, z + path[..., 1, None]], dim=-1)


def fix_bones(local: Tensor, parents: Sequence[int], lengths: Tensor) -> Tensor:
    """Joints moved along their bones until every bone has its length; roots stay, directions stay.

    A joint is the sum of the bones between it and its root, so the whole tree is one product with `ancestors`.

    Parameters
    ----------
    local : (N, T, J, 3) tensor, metres
    parents : J indices, -1 at roots
    lengths : (J,) or (N, T, J) tensor, metres; those of roots are not read

    Returns
    -------
    (N, T, J, 3) tensor. A bone of no length (under 0.1 mm) keeps less than its length, and finite gradients.
    """
    steps = bones(local, parents)
    directions = steps * torch.rsqrt((steps * steps).sum(dim=-1, keepdim=True) + _TINY)
    is_root = torch.as_tensor(list(parents), device=local.device) < 0
    steps = torch.where(is_root[:, None], local, directions * lengths.to(local)[..., None])
    return torch.einsum("ij,ntjc->ntic", local.new_tensor(ancestors(parents)), steps)


def bones(local: Tensor, parents: Sequence[int]) -> Tensor:
    """Vectors (N, T, J, 3) from each joint's parent to the joint, of joints (N, T, J, 3); zero at roots."""
    above = torch.as_tensor([max(parent, 0) for parent in parents], device=local.device)
    is_root = torch.as_tensor(list(parents), device=local.device) < 0
    return (local - local[..., above, :]).masked_fill(is_root[:, None], 0.0)


# Threads of torch: one, for timings that shall mean the same on other machines


@contextmanager
def one_thread() -> Iterator[None]:
    """A ``with`` block in which torch takes one thread only."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


# Songs: convolutions over time, or layers, and a bidirectional LSTM, to a few numbers a moment

KERNEL = 2  # moments that a convolution spans
FRAME_LAYERS = (120, 240, 480)  # units of the layers that read each moment alone


class TemporalConvolution(nn.Module):
    """Convolutions over time alone, the last one with stride 2: (N, M, F) -> (N, ceil(M / 2), last channels x F).

    Every feature goes through the same convolutions, so their axis stays (Music2Dance, Sec. 4.3).
    """

    stride = 2

    def __init__(self, n_audio: int, channels: Sequence[int], dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList()
        for number, (a, b) in enumerate(pairwise((1, *channels)), 1):
            stride = self.stride if number == len(channels) else 1
            convolution = nn.Conv2d(a, b, (KERNEL, 1), (stride, 1))
            self.layers.append(nn.Sequential(convolution, BatchNorm(b, momentum=1.0), nn.ReLU(), nn.Dropout(dropout)))
        self.size = channels[-1] * n_audio

    def forward(self, music: Tensor) -> Tensor:
        values = music[:, None]
        for layer in self.layers:
            # One moment more at the end, so that none is lost.
            values = layer(nn.functional.pad(values, (0, 0, 0, KERNEL - 1)))
        return values.transpose(1, 2).flatten(2)


class FrameLayers(nn.Module):
    """Each moment by itself: (N, M, F) -> (N, M, 480). The baseline of Music2Dance's Table 1."""

    stride = 1

    def __init__(self, n_audio: int) -> None:
        super().__init__()
        sizes = (n_audio, *FRAME_LAYERS)
        self.layers = nn.Sequential(*(layer for a, b in pairwise(sizes) for layer in (nn.Linear(a, b), nn.ReLU())))
        self.size = sizes[-1]

    def forward(self, music: Tensor) -> Tensor:
        values: Tensor = self.layers(music)
        return values


class SongEncoder(nn.Module):
    """A front of layers, then an LSTM in both directions over time: (N, M, F) -> (N, K, 2 hidden).

    Parameters
    ----------
    front : TemporalConvolution or FrameLayers
    hidden : int, units in each direction
    """

    def __init__(self, front: TemporalConvolution | FrameLayers, hidden: int) -> None:
        super().__init__()
        self.front = front
        self.reader = nn.LSTM(front.size, hidden, batch_first=True, bidirectional=True)

    @property
    def size(self) -> int:
        """Channels of the output."""
        return 2 * self.reader.hidden_size

    @torch.no_grad()
    def settle(self, music: Tensor) -> None:
        """Give batch normalisation the statistics of all of some windows (N, M, F); then evaluation mode."""
        self.train()
        for layer in self.modules():
            if isinstance(layer, nn.Dropout):
                layer.eval()
        self.front(music)
        self.eval()

    def forward(self, music: Tensor) -> Tensor:
        values: Tensor = self.reader(self.front(music))[0]
        return values

    def at(self, code: Tensor, moments: Tensor) -> Tensor:
        """The output (N, K, c) at moments (N, T) of the input, which may lie between: (N, T, c), linear, ends held.

        Entry k of the output stands at moment stride k + (stride - 1) / 2 of the input.
        """
        return between(code, (moments - (self.front.stride - 1) / 2) / self.front.stride)


def between(values: Tensor, places: Tensor) -> Tensor:
    """Values (N, M, c) at places (N, T) that may lie between: (N, T, c), linear; the ends hold."""
    values, places = values.float(), places.clamp(0, values.shape[1] - 1)
    before = places.long().clamp(max=max(values.shape[1] - 2, 0))
    after = (before + 1).clamp(max=values.shape[1] - 1)
    index = [each[..., None].expand(-1, -1, values.shape[2]) for each in (before, after)]
    return torch.lerp(values.gather(1, index[0]), values.gather(1, index[1]), (places - before)[..., None])
