"""Cost of relaxed harmony, path and spread in training: forward and backward as a share of one step of the generator.

A batch of 10 clips of 60 frames, 23 joints, 10 music beats, on one thread. The step is forward and backward through
the `small` generator with the reconstruction loss alone; the real one also has discriminators, so the share is an
upper bound. Both run one after the other in one process: only the share means something on another machine.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from benchmarks.timing import best_of
from harmolab.body.skeletons import Skeleton
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.soft_score import soft_harmony
from harmolab.systems.harmogan.losses import charbonnier_mse
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.features import FeatureParams

N_CLIPS, N_FRAMES, N_JOINTS, N_BEATS, FPS = 10, 60, 23, 10, 15.0
MODES = {
    "paper": HarmonyParams.paper(),
    "valleys": HarmonyParams.valleys(),
    "shape": HarmonyParams.recommended(DANCE_PATTERNS["cha-cha"]),
    "shape of a waltz": HarmonyParams.recommended(DANCE_PATTERNS["waltz"]),
}


def harmony_pass(params: HarmonyParams, tau: float) -> Callable[[], object]:
    """Forward and backward of the relaxed harmony of random walks."""
    torch.manual_seed(0)
    positions = (0.03 * torch.randn(N_CLIPS, N_FRAMES, N_JOINTS, 3)).cumsum(dim=1).requires_grad_()
    beats = (torch.rand(N_CLIPS, N_BEATS) * N_FRAMES / FPS).sort(dim=1).values
    masks = torch.ones(N_CLIPS, N_BEATS), torch.ones(N_CLIPS, N_FRAMES)

    def work() -> Tensor:
        soft = soft_harmony(positions, beats, torch.rand_like(beats), *masks, fps=FPS, tau=tau, params=params)
        loss = (soft.n_visual - soft.above_chance - soft.hitting_score).sum()
        return torch.autograd.grad(loss, positions)[0]

    return work


def generator_step() -> Callable[[], object]:
    """Forward and backward of the small generator, and Adam's step."""
    torch.manual_seed(0)
    features = FeatureParams()
    skeleton = Skeleton(tuple(f"joint_{joint}" for joint in range(N_JOINTS)), tuple(range(-1, N_JOINTS - 1)))
    lengths = torch.full((N_JOINTS,), 0.2)
    generator = Generator(ModelParams.small(), features.n_audio, skeleton, lengths, fps=FPS)
    audio = torch.randn(N_CLIPS, N_FRAMES, features.n_audio)
    target = torch.randn(N_CLIPS, N_FRAMES, 3 * N_JOINTS + 3)
    index, mask = torch.zeros(N_CLIPS, N_FRAMES), torch.ones(N_CLIPS, N_FRAMES)
    adam = torch.optim.Adam(generator.parameters())

    def work() -> None:
        adam.zero_grad()
        charbonnier_mse(generator(audio, target).motion, target, index, mask).backward()
        adam.step()

    return work


def measure() -> dict[str, float]:
    """Milliseconds of all modes at the first and last softness and of the generator's step, and all shares."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        step = best_of(generator_step(), 10)
        times = {(mode, tau): best_of(harmony_pass(MODES[mode], tau), 50) for mode in MODES for tau in (0.5, 0.05)}
    finally:
        torch.set_num_threads(threads)
    figures = {f"soft harmony, {mode}, tau {tau} (ms)": cost for (mode, tau), cost in times.items()}
    shares = {
        f"soft harmony, {mode}, against the step (ratio)": max(times[mode, 0.5], times[mode, 0.05]) / step
        for mode in MODES
    }
    return {**figures, "training step of the small generator (ms)": step, **shares}


if __name__ == "__main__":
    for label, value in measure().items():
        print(f"{label:50} {value:10.3f}")
