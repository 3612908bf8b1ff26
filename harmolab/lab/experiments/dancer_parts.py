"""From recordings to windows, and through Music2Dance's network, in boxes (Figs. 2 and 3): every number is measured."""

from __future__ import annotations

import numpy as np
import torch

from harmolab.lab.experiments.generation import training_split
from harmolab.lab.experiments.music2dance import coded_sequences, profiled
from harmolab.lab.profile import RunProfile
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.layers import parameter_count
from harmolab.systems.music2dance.networks import CONTACTS, DanceNetwork, LstmDancer
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.sequences import window_starts
from harmolab.systems.music2dance.windows import n_cells

Boxes = dict[str, str]  # heading -> what stands below it


def recording_chain(profile: RunProfile, corpus: str, params: Music2DanceParams) -> Boxes:
    """What stands for Fig. 2, the capture: recordings, their code, windows, and the split by figure."""
    sequences = coded_sequences(profile, corpus, profiled(profile, params))
    frames = sum(sequence.n_frames for sequence in sequences.sequences)
    groups = training_split(profile, corpus, FeatureParams.paper()).groups
    counts = {
        side: sum(len(window_starts(each, groups[side], sequences.params)) for each in sequences.sequences)
        for side in groups
    }
    every = {segment.group for each in sequences.sequences for segment in each.segments}
    fps, window = sequences.params.fps, sequences.params.window
    return {
        "recordings": f"{len(sequences.sequences)} of {len(sequences.dances)} dances\n{frames / fps / 60:.1f} minutes",
        "motion code": f"{fps:g} frames a second\n{sequences.code.n_motion} channels + {CONTACTS} contacts",
        "figures": f"{len(every)} motion groups\nwindows of {window:g} s",
        **{side: f"{len(groups[side])} groups\n{count} windows" for side, count in counts.items()},
    }


@torch.no_grad()
def network_boxes(network: DanceNetwork) -> Boxes:
    """What stands for Fig. 3, the framework: the shapes of a training window on its way through the network."""
    params, frames = network.params, network.params.n_frames
    cells = n_cells(params.song)
    music, moments = torch.zeros(1, cells, params.song.n_audio), torch.linspace(0, cells - 1, frames)[None]
    heard = network.music_at(music, moments)
    motion, contacts = torch.zeros(1, frames, network.motion_code.n_motion), torch.zeros(1, frames, CONTACTS)
    prediction = network.predicted(motion, contacts, heard, torch.zeros(1, dtype=torch.long))
    mapping = {} if network.mapping is None else {"mapping network": _shape(network.mapping(music))}
    body = (
        f"LSTM of {params.lstm}"
        if isinstance(network.body, LstmDancer)
        else f"{params.groups * len(params.dilations)} gated blocks\nsees {params.reach} frames"
    )
    return {
        "music": f"{_shape(music)}\n{params.song.rate:g} moments a second",
        **mapping,
        "music at each frame": _shape(heard),
        "frames so far": f"{_shape(torch.cat([motion, contacts], dim=-1))}\n{params.fps:g} frames a second",
        "network": body,
        "dance": f"learnt vector of {params.dance_vector}\n{len(network.dances)} dances",
        "next frame": f"mean, spread {_shape(prediction.mean)}\ncontacts {_shape(prediction.contacts)}",
        "parameters": f"{parameter_count(network):,}".replace(",", " "),
    }


def _shape(values: torch.Tensor) -> str:
    return " x ".join(map(str, np.array(values.shape[1:])))
