"""Speed of the generator and of its parts in training, on the CPU, all figures of one run on one machine.

Frames a second of the `paper` preset stand against what was published for other systems: other machines, so an order of
magnitude, not a ratio. The ratios at the end compare parts measured here, in one run.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from benchmarks.timing import best_of
from harmolab.data.recordings import TANG_23
from harmolab.systems.harmogan.networks import CrossDomainDiscriminator, Generator, SpatialTemporalDiscriminator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.pose_network import PoseNet

N_AUDIO, FPS = 23, 15.0
CLIPS, FRAMES = 64, 90
TRAINING_CLIPS, TRAINING_FRAMES = 10, 64
PUBLISHED = {"Dancing2Music": 2141.0, "Ren et al. 2020": 2287.0, "DanceNet": 61.0, "EDGE": 14.0}  # frames a second


def generator_of(params: ModelParams) -> Generator:
    """An untrained generator of Tang's 23 joints."""
    return Generator(params, N_AUDIO, TANG_23, torch.full((23,), 0.2), fps=FPS)


def frames_per_second(params: ModelParams, *, rounds: int = 5) -> float:
    """Frames generated a second, in batches of 64 clips of 6 s."""
    generator = generator_of(params).eval()
    audio, initial = torch.randn(CLIPS, FRAMES, N_AUDIO), torch.randn(CLIPS, FRAMES, generator.n_motion)
    with torch.inference_mode():
        generator(audio, initial)
        return 1000 * CLIPS * FRAMES / best_of(lambda: generator(audio, initial), rounds)


def training_milliseconds(params: ModelParams, *, rounds: int = 15) -> dict[str, float]:
    """Forward and backward of every network of a training step: a batch of 10 clips of 64 frames."""
    generator = generator_of(params)
    audio, mask = torch.randn(TRAINING_CLIPS, TRAINING_FRAMES, N_AUDIO), torch.ones(TRAINING_CLIPS, TRAINING_FRAMES)
    motion = torch.randn(TRAINING_CLIPS, TRAINING_FRAMES, generator.n_motion).requires_grad_()
    cross, temporal = CrossDomainDiscriminator(params, N_AUDIO, TANG_23), SpatialTemporalDiscriminator(params, TANG_23)
    pose_net = PoseNet(TANG_23, fps=FPS)

    def features() -> Tensor:
        return torch.stack([layer.square().mean() for layer in pose_net.features(motion, mask)]).sum()

    losses: dict[str, Callable[[], Tensor]] = {
        "generator": lambda: generator(audio, motion).motion.square().sum(),
        "both discriminators": lambda: cross(audio, motion, mask).sum() + temporal(motion, mask).sum(),
        "pose network": features,
    }
    return {name: best_of(lambda loss=loss: loss().backward(), rounds) for name, loss in losses.items()}


def measure() -> dict[str, float]:
    """All figures of this file. Training on one thread; generation on one and on all."""
    threads = torch.get_num_threads()
    presets = {"paper": ModelParams.paper(), "small": ModelParams.small()}
    figures: dict[str, float] = {}
    try:
        for name, params in presets.items():
            figures[f"{name}: parameters (millions)"] = generator_of(params).parameter_count() / 1e6
            torch.set_num_threads(threads)
            figures[f"{name}: frames a second, {threads} threads"] = fastest = frames_per_second(params)
            torch.set_num_threads(1)
            figures[f"{name}: frames a second, 1 thread"] = frames_per_second(params)
            figures[f"{name}: times faster than music is played at {FPS:g} Hz"] = fastest / FPS
            steps = training_milliseconds(params)
            figures |= {f"{name}: {part}, forward and backward (ms)": value for part, value in steps.items()}
            figures[f"{name}: both discriminators against generator (ratio)"] = (
                steps["both discriminators"] / steps["generator"]
            )
    finally:
        torch.set_num_threads(threads)
    return figures


if __name__ == "__main__":
    torch.manual_seed(0)
    for label, value in measure().items():
        print(f"{label:58} {value:10.2f}")
    for label, value in PUBLISHED.items():
        print(f"published, other machine: {label:32} {value:10.2f}")
