"""From music features to a few numbers a moment: convolutions over time, or layers, and a bidirectional LSTM."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from harmolab.systems.common.batch_norm import BatchNorm

KERNEL = 2  # moments that a convolution spans
FRAME_LAYERS = (120, 240, 480)  # units of the layers that read each moment alone


class TemporalConvolution(nn.Module):
    """Convolutions over time alone, the last one with stride 2: (N, M, F) -> (N, ceil(M / 2), last channels x F).

    Every feature goes through the same convolutions, so their axis stays (Music2Dance, Sec. 4.3).
    """

    stride = 2

    def __init__(self, n_audio: int, channels: Sequence[int], dropout: float) -> None:
        super().__init__()
        sizes = (1, *channels)
        self.layers = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(a, b, (KERNEL, 1), (self.stride if number == len(channels) else 1, 1)),
                BatchNorm(b, momentum=1.0), nn.ReLU(), nn.Dropout(dropout),
            )
            for number, (a, b) in enumerate(pairwise(sizes), 1)
        )  # fmt: skip
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
        pairs = pairwise(sizes)
        self.layers = nn.Sequential(*(layer for a, b in pairs for layer in (nn.Linear(a, b), nn.ReLU())))
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
