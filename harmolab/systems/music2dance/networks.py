"""The networks of Music2Dance (Sec. 4.4): a WaveNet over motion, with music beside it, and the LSTM it is held against.

Both predict the next frame from all frames before it: a Gaussian for each channel of the motion code, and how likely
each foot stands. Motion is in standard deviations of the training split, contacts are 0 or 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple, Self

import torch
from torch import Tensor, nn
from torch.nn.functional import pad, relu, softplus

from harmolab.systems.music2dance.codes import MotionCode, stored_code
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.music2dance.sequences import Windows
from harmolab.systems.training import layers
from harmolab.systems.training.about import stored_list
from harmolab.systems.training.weights import MOST_LAYERS, stored_record

KERNEL = 2  # frames of a dilated convolution
CONTACTS = 2  # left and right foot
MOST_SPREAD = 10.0  # standard deviations of a channel
MOST_DANCES = 256


class Prediction(NamedTuple):
    """Of every frame: mean and logarithm of the standard deviation (N, T, C), logits of the contacts (N, T, 2)."""

    mean: Tensor
    log_sigma: Tensor
    contacts: Tensor


class GatedBlock(nn.Module):
    """A residual block of the WaveNet: tanh x sigmoid of a dilated convolution, the music and the dance."""

    def __init__(self, params: Music2DanceParams, n_music: int, dilation: int, *, last: bool) -> None:
        super().__init__()
        self.dilation = dilation
        self.seeing = nn.Conv1d(params.residual, 2 * params.residual, KERNEL, dilation=dilation)
        self.hearing = nn.Linear(n_music, 2 * params.residual, bias=False)
        self.knowing = nn.Linear(params.dance_vector, 2 * params.residual, bias=False)
        self.aside = nn.Linear(params.residual, params.skip)
        self.onward = None if last else nn.Linear(params.residual, params.residual)  # nothing follows the last block

    def forward(self, values: Tensor, music: Tensor, dance: Tensor) -> tuple[Tensor, Tensor]:
        """Values (N, T, residual) for the next block, and (N, T, skip) for the output."""
        convolved = self.seeing(pad(values.transpose(1, 2), (self.dilation, 0))).transpose(1, 2)
        change, gate = (convolved + self.hearing(music) + self.knowing(dance)[:, None]).chunk(2, dim=-1)
        gated = torch.tanh(change) * torch.sigmoid(gate)
        return values if self.onward is None else values + self.onward(gated), self.aside(gated)


class Head(nn.Module):
    """The end of both networks: mean, standard deviation, contacts; `carry` times the frame before is in the mean."""

    def __init__(self, params: Music2DanceParams, n_in: int, n_motion: int) -> None:
        super().__init__()
        self.n_motion, self.carry, self.least = n_motion, params.carry, params.least_sigma
        self.layer = nn.Linear(n_in, 2 * n_motion + CONTACTS)

    def forward(self, values: Tensor, before: Tensor) -> Prediction:
        # Small spreads need more digits than the 8 bits of bfloat16.
        with torch.autocast(values.device.type, enabled=False):
            mean, spread, contacts = self.layer(values.float()).split([self.n_motion, self.n_motion, CONTACTS], dim=-1)
            log_sigma = (self.least + softplus(spread.clamp(max=MOST_SPREAD))).log()
            return Prediction(mean + self.carry * before, log_sigma, contacts)


class WaveNet(nn.Module):
    """Dilated convolutions over the frames so far, in front of them nothing (Sec. 4.4.3, Eq. 6)."""

    def __init__(self, params: Music2DanceParams, n_motion: int, n_music: int) -> None:
        super().__init__()
        dilations = params.dilations * params.groups
        self.front = nn.Sequential(
            nn.Linear(n_motion + CONTACTS, params.residual), nn.ReLU(),
            nn.Linear(params.residual, params.residual), nn.ReLU(),
        )  # fmt: skip
        self.blocks = nn.ModuleList(
            GatedBlock(params, n_music, dilation, last=number == len(dilations))
            for number, dilation in enumerate(dilations, 1)
        )
        self.joining = nn.Linear(params.skip, params.skip)
        self.head = Head(params, params.skip, n_motion)

    def forward(self, frames: Tensor, music: Tensor, dance: Tensor, before: Tensor) -> Prediction:
        """The frames that follow `frames` (N, T, C + 2): music (N, T, c) of what is predicted, dance (N, d)."""
        values, total = self.front(frames), torch.zeros(())
        for block in self.blocks:
            values, aside = block(values, music, dance)
            total = total.to(aside) + aside
        return self.head(relu(self.joining(relu(total))), before)


class LstmDancer(nn.Module):
    """The paper's baseline (Sec. 5.1): motion, music and dance joined, one LSTM."""

    def __init__(self, params: Music2DanceParams, n_motion: int, n_music: int) -> None:
        super().__init__()
        self.reader = nn.LSTM(n_motion + CONTACTS + n_music + params.dance_vector, params.lstm, batch_first=True)
        self.head = Head(params, params.lstm, n_motion)

    def forward(self, frames: Tensor, music: Tensor, dance: Tensor, before: Tensor) -> Prediction:
        """As `WaveNet.forward`."""
        joined = torch.cat([frames, music, dance[:, None].expand(-1, frames.shape[1], -1)], dim=-1)
        return self.head(self.reader(joined)[0], before)


class DanceNetwork(layers.Normalised):
    """Music and the frames so far in, the next frame out.

    Parameters
    ----------
    params : Music2DanceParams
    code : of the motion
    dances : names of the dances that were danced in training
    """

    system = "music2dance"

    def __init__(self, params: Music2DanceParams, code: MotionCode, dances: Sequence[str]) -> None:
        super().__init__()
        self.params, self.motion_code, self.dances = params, code, tuple(dances)
        self.audio_scale, self.motion_scale = layers.Normaliser(params.song.n_audio), layers.Normaliser(code.n_motion)
        self.mapping: layers.SongEncoder | None = None
        if params.mapping:  # temporal convolutions and a bidirectional LSTM (Fig. 5 without its last layer)
            front = layers.TemporalConvolution(params.song.n_audio, params.song.channels, params.song.dropout)
            self.mapping = layers.SongEncoder(front, params.song.hidden)
        n_music = params.song.n_audio if self.mapping is None else self.mapping.size
        self.vectors = nn.Embedding(len(self.dances), params.dance_vector)
        kind = WaveNet if params.generator == "wavenet" else LstmDancer
        self.body: WaveNet | LstmDancer = kind(params, code.n_motion, n_music)
        for layer in self.modules():
            if isinstance(layer, nn.Linear | nn.Conv1d | nn.Conv2d):
                nn.init.xavier_normal_(layer.weight)

    @property
    def n_motion(self) -> int:
        """Channels of a movement to go on from: those of the motion code, and both contacts."""
        return self.motion_code.n_motion + CONTACTS

    def music_at(self, music: Tensor, moments: Tensor) -> Tensor:
        """The music (N, T, c) at the moments (N, T) of frames, of features (N, M, F): mapped, or as they are."""
        if self.mapping is None:
            return layers.between(music, moments)
        return self.mapping.at(self.mapping(music), moments)

    def predicted(
        self, motion: Tensor, contacts: Tensor, music: Tensor, dance: Tensor, *, dropout: float = 0.0
    ) -> Prediction:
        """Every frame predicted from the frames (N, T, C) and (N, T, 2) before it; before frame 0 all is 0.

        Parameters
        ----------
        motion, contacts : of recorded frames, or of predicted ones
        music : (N, T, c), as of `music_at`
        dance : (N,) numbers of the dances
        dropout : float, share of the motion that the convolutions do not see
        """
        before = shifted(motion)
        visible = nn.functional.dropout(before, dropout, training=dropout > 0)
        return self.body(torch.cat([visible, shifted(contacts)], dim=-1), music, self.vectors(dance), before)

    def forward(self, windows: Windows) -> Prediction:
        """Every frame predicted from the recorded ones before it ("teacher forcing")."""
        music = self.music_at(windows.music, windows.moments)
        return self.predicted(windows.motion, windows.contacts, music, windows.dance)

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {"params": asdict(self.params), "code": self.motion_code.to_dict(), "dances": list(self.dances)}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A network as its description says; ValueError for sizes that cannot be."""
        dances = [str(dance) for dance in stored_list(build, "dances")]
        if not 0 < len(dances) == len(set(dances)) <= MOST_DANCES:
            raise ValueError(f"describes {len(dances)} dances; one to {MOST_DANCES}, all different, are needed")
        return cls(stored_params(build["params"]), stored_code(build["code"]), dances)


def stored_params(stored: Mapping[str, Any]) -> Music2DanceParams:
    """Settings out of a description; ValueError for what cannot be."""
    params = stored_record(Music2DanceParams, {**stored, "song": stored_record(SongParams, stored["song"])})
    if params.groups * len(params.dilations) > MOST_LAYERS:
        raise ValueError(f"describes {params.groups * len(params.dilations)} blocks, more than {MOST_LAYERS}")
    return params


def shifted(values: Tensor) -> Tensor:
    """Values (N, T, c) one frame later; the first frame is 0."""
    return pad(values[:, :-1], (0, 0, 1, 0))
