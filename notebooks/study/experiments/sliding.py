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

    def corrected(self, model: FootModel) -> FloatArray:
        """The slid codes (N, T, C) as a foot model corrects them."""
        return np.stack([model.correct(*pair) for pair in zip(self.slid, self.signals, strict=True)])

    def decoded(self, codes: FloatArray) -> FloatArray:
        """Positions (N, T, J, 3) of codes (N, T, C), metres."""
        return np.stack([self.code.decode(code, self.fps) for code in codes])


def slid_windows(split: Split, sequences: SequenceSet, *, side: str = "test", most: int = 64) -> SlidWindows:
    """Windows of the figures of one side of a split, with the sliding that foot models are trained on.

    Parameters
    ----------
    split, sequences : of the same recordings
    side : "test", "validation", or "train" for figures that foot models do learn on
    most : int, windows, evenly apart; only their frames of held-out figures count

    Raises
    ------
    ValueError
        If the side has no window.
    """
    statistics = training_statistics(sequences, split.groups["train"])
    # A share of less than 1 on the training side, too: windows are drawn alike, and only frames of the side count.
    source = WindowSource.of(sequences, split.groups[side], statistics=statistics, share=HELD_OUT)
    model = FootModel(FootParams(), sequences.code)  # it knows the channels and their scale, and changes nothing
    model.motion_scale.set(statistics.motion_mean, statistics.motion_std)
    windows = source.batch(rows := even_rows(source, most))
    with torch.no_grad():
        slid, signals = simulated_sliding(model, windows, sequences.params.fps, seed=0)
    rotations, std = isinstance(model.motion_code, RotationCode), statistics.motion_std
    channels = [place for place in model.lower if (place >= RATES if rotations else float(std[place]) > LEAST_STD)]
    return SlidWindows(
        code=model.motion_code,
        fps=sequences.params.fps,
        recorded=np.stack([source.raw(row)[0] for row in rows]).astype(np.float64),
        slid=(slid * std + statistics.motion_mean).double().numpy(),
        contacts=windows.contacts.numpy() > 0.5,
        signals=signals.double().numpy(),
        counted=windows.valid.numpy() > 0.5,
        channels=channels,
        units=np.ones(len(channels)) if rotations else std[channels].double().numpy(),
    )
