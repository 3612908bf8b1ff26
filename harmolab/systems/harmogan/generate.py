"""Dances of any length: meter by meter, each from the end of the last (paper Sec. 4.1, Fig. 7b).

For every meter the generator is given its music and the beats before it, and as initial poses what was danced in those
beats (Eq. 23). Its output for the beats before (TI = 1) is thrown away; its meter is continued from the end of the
last one. The first meter follows a movement from the bank of poses, brought to the music's tempo.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from harmolab.systems.common.borders import continued
from harmolab.systems.common.dancing import DanceInput
from harmolab.systems.common.priors import initial_poses, temporal_index
from harmolab.systems.common.units import UnitSet, collate
from harmolab.types import FloatArray, Motion


class MeterDancer(Protocol):
    """A generator of units: music (N, T, F) and initial poses (N, T, C) in, an output with their ``motion`` out."""

    fps: float
    n_motion: int
    bone_lengths: Tensor

    def __call__(self, audio: Tensor, initial: Tensor) -> Any:
        """The output of both tensors."""


@torch.inference_mode()
def danced_meters(generator: MeterDancer, source: DanceInput) -> FloatArray:
    """The motion code (n_frames, C) of all meters, one after the other, from the end of the movement before."""
    origin, prior = source.first, source.prior
    code = np.zeros((source.meters[-1].end - origin, generator.n_motion))
    code[: len(prior)] = prior
    for meter in source.progress(source.meters, "dancing"):
        begin, now, end = (frame - origin for frame in (meter.begin, meter.meter, meter.end))
        motion = _meter(generator, source.audio[begin:end], code[begin:end], now - begin)
        new = max(now, len(prior))
        code[new:end] = continued(code[:new], motion[new - now :], generator.fps)
    return code[-origin : source.n_frames - origin]


def _meter(generator: MeterDancer, music: NDArray[np.float32], code: FloatArray, n_prior: int) -> FloatArray:
    """Motion code of one meter, (T - n_prior, C), from its music (T, F) and the code (T, C) danced so far."""
    initial = initial_poses(code.astype(np.float32), temporal_index(len(code), n_prior))
    device = generator.bone_lengths.device
    motion = generator(torch.from_numpy(music[None]).to(device), torch.from_numpy(initial[None]).to(device)).motion
    code_of_meter: FloatArray = motion[0, n_prior:].double().cpu().numpy()
    return code_of_meter


@torch.no_grad()
def generate_units(generator: torch.nn.Module, units: UnitSet) -> list[Motion]:
    """A dance to each whole unit, from its music and the poses before the meter; one batch through the generator."""
    batch = collate(units.units)
    codes = generator.eval()(torch.from_numpy(batch.audio), torch.from_numpy(batch.initial)).motion
    pairs = zip(codes, units.units, strict=True)
    return [units.decoded(code[: unit.n_frames].double().numpy()) for code, unit in pairs]
