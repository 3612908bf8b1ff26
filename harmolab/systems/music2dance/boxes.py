"""Shapes of a training window on its way through Music2Dance's network, in boxes (Fig. 3); all measured."""

from __future__ import annotations

import torch

from harmolab.systems.common.layers import parameter_count
from harmolab.systems.music2dance.networks import CONTACTS, DanceNetwork, LstmDancer
from harmolab.systems.music2dance.windows import n_cells


@torch.no_grad()
def network_boxes(network: DanceNetwork) -> dict[str, str]:
    """Heading -> what stands below it: Fig. 3, the framework, with the shapes of a training window."""
    params, frames = network.params, network.params.n_frames
    cells = n_cells(params.song)
    music, moments = torch.zeros(1, cells, params.song.n_audio), torch.linspace(0, cells - 1, frames)[None]
    music_at_frames = network.music_at(music, moments)
    motion, contacts = torch.zeros(1, frames, network.motion_code.n_motion), torch.zeros(1, frames, CONTACTS)
    prediction = network.predicted(motion, contacts, music_at_frames, torch.zeros(1, dtype=torch.long))
    mapping = {} if network.mapping is None else {"mapping network": _shape(network.mapping(music))}
    body = (
        f"LSTM of {params.lstm}"
        if isinstance(network.body, LstmDancer)
        else f"{params.groups * len(params.dilations)} gated blocks\nsees {params.reach} frames"
    )
    return {
        "music": f"{_shape(music)}\n{params.song.rate:g} moments a second",
        **mapping,
        "music at each frame": _shape(music_at_frames),
        "frames so far": f"{_shape(torch.cat([motion, contacts], dim=-1))}\n{params.fps:g} frames a second",
        "network": body,
        "dance": f"learnt vector of {params.dance_vector}\n{len(network.dances)} dances",
        "next frame": f"mean, spread {_shape(prediction.mean)}\ncontacts {_shape(prediction.contacts)}",
        "parameters": f"{parameter_count(network):,}".replace(",", " "),
    }


def _shape(values: torch.Tensor) -> str:
    return " x ".join(map(str, values.shape[1:]))
