"""How a generator does on units it was not trained on, epoch by epoch: hard scores, no relaxation."""

from __future__ import annotations

import torch

from harmolab.models.harmogan import Generator
from harmolab.params import HarmonyParams, TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.steps import motion_error, score_batch

__all__ = ["HARD", "validate"]

HARD = 1e-8  # softness at which the relaxed score is the hard one


@torch.no_grad()
def validate(generator: Generator, units: Tensors, params: TrainParams) -> dict[str, float]:
    """Means over units: error, the paper's harmony and hit rate, harmony above chance, beats M per beat N.

    Returns
    -------
    dict of val_mse, val_harmony, val_hit_rate (paper mode), val_above_chance, val_count_ratio (valleys within 0.1 s)
    """
    generator.eval()
    motion = generator(units.audio, units.initial).motion
    generator.train()
    paper = score_batch(generator, motion, units, HARD, HarmonyParams.paper())
    valleys = score_batch(generator, motion, units, HARD, HarmonyParams.valleys())
    return {
        "val_mse": float(motion_error(generator, motion, units, params.epsilon)),
        "val_harmony": float(paper.harmony.mean()),
        "val_hit_rate": float(paper.hit_rate.mean()),
        "val_above_chance": float(valleys.above_chance.mean()),
        "val_count_ratio": float(valleys.n_visual.sum() / valleys.n_audio.sum().clamp(min=1.0)),
    }
