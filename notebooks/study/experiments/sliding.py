"""Held-out movement with simulated sliding (R38), one draw for every foot model that is tried on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from harmolab.systems.music2dance.codes import PositionCode, RotationCode
from harmolab.systems.music2dance.feet import FootModel, FootParams, simulated_sliding
from harmolab.systems.music2dance.sequences import LEAST_STD, SequenceSet, WindowSource, training_statistics
from harmolab.systems.music2dance.train import HELD_OUT, even_rows
from harmolab.systems.training.layers import Statistics
from harmolab.systems.training.splits import Split
from harmolab.types import BoolArray, FloatArray

RATES = 4  # first channels of the code of rotations: rates of the root and its height


@dataclass(frozen=True, eq=False)
class SlidWindows:
    """Windows of recorded movement, and the same with simulated sliding.

    Parameters
    ----------
    code : PositionCode or RotationCode of the motion
    fps : float, hertz
    recorded, slid : (N, T, C) arrays, motion codes, not standardised
    contacts : (N, T, 2) mask, True where a foot stands, as recorded
    signals : (N, T, 2) array, the contacts that a foot model is given: some are wrong, as predicted ones are
    counted : (N, T) mask, frames of the held-out figures; all others say nothing
    channels : of the lower body that errors are of: rotations, or places and rates that vary
    units : (L,) array, what an error of 1 is in each of these channels: a radian, or its standard deviation
    """

    code: PositionCode | RotationCode
    fps: float
    recorded: FloatArray
    slid: FloatArray
    contacts: BoolArray
    signals: FloatArray
    counted: BoolArray
    channels: Sequence[int]
    units: FloatArray

    def squared_error(self, codes: FloatArray) -> float:
        """Mean square of what codes (N, T, C) differ from the recorded ones by in the lower body (R39).

        Squared radians of the rotations, or squared standard deviations of positions; counted frames alone.
        """
        away = (codes - self.recorded)[..., self.channels] / self.units
        return float(np.square(away[self.counted]).mean())

    def corrected(self, model: FootModel | None) -> FloatArray:
        """The slid codes (N, T, C) as a foot model corrects them; without one, as they are."""
        if model is None:
            return self.slid
        pairs = zip(self.slid, self.signals, strict=True)
        return np.stack([model.correct(code, signals) for code, signals in pairs])

    def decoded(self, codes: FloatArray) -> FloatArray:
        """Positions (N, T, J, 3) of codes (N, T, C), metres."""
        return np.stack([self.code.decode(code, self.fps) for code in codes])


def slid_windows(
    split: Split, sequences: SequenceSet, *, side: str = "test", params: FootParams | None = None, seed: int = 0,
    most: int = 64,
) -> SlidWindows:  # fmt: skip
    """Windows of the figures of one side of a split, with the sliding that foot models are trained on.

    Parameters
    ----------
    split, sequences : of the same recordings
    side : "test", "validation", or "train" for figures that foot models do learn on
    params : FootParams of the simulated sliding; the paper's when left out
    seed : int, of the draw
    most : int, windows, evenly apart; only their frames of held-out figures count

    Raises
    ------
    ValueError
        If the side has no window.
    """
    statistics = training_statistics(sequences, split.groups["train"])
    # A share of less than 1 on the training side, too: windows are drawn alike, and only frames of the side count.
    source = WindowSource.of(
        sequences, split.groups[side], dances=sequences.dances, statistics=statistics, share=HELD_OUT
    )
    model = _untrained(sequences, params or FootParams(), statistics)
    rows = even_rows(source, most)
    windows = source.batch(rows)
    with torch.no_grad():
        slid, signals = simulated_sliding(model, windows, sequences.params.fps, seed)
    channels = _measured(model)
    rotations = isinstance(model.motion_code, RotationCode)
    return SlidWindows(
        code=model.motion_code,
        fps=sequences.params.fps,
        recorded=np.stack([source.raw(row)[0] for row in rows]).astype(np.float64),
        slid=(slid * statistics.motion_std + statistics.motion_mean).double().numpy(),
        contacts=windows.contacts.numpy() > 0.5,
        signals=signals.double().numpy(),
        counted=windows.valid.numpy() > 0.5,
        channels=channels,
        units=np.ones(len(channels)) if rotations else statistics.motion_std[channels].double().numpy(),
    )


def _untrained(sequences: SequenceSet, params: FootParams, statistics: Statistics) -> FootModel:
    """A model that knows the channels and their scale, and changes nothing."""
    model = FootModel(params, sequences.code)
    model.motion_scale.set(statistics.motion_mean, statistics.motion_std)
    return model


def _measured(model: FootModel) -> list[int]:
    """Channels that errors are of: the lower body's rotations, or those of its positions and rates that vary."""
    if isinstance(model.motion_code, RotationCode):
        return [channel for channel in model.lower if channel >= RATES]
    std = model.motion_scale.std
    return [channel for channel in model.lower if float(std[channel]) > LEAST_STD]
