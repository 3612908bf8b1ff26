"""Speed of Music2Dance's sampler, which remembers, against the same network that sees its reach anew for each frame.

Both dance the same frames of the paper's size in one process on one thread; only the ratio means something on another
machine.
"""

from __future__ import annotations

import numpy as np
import torch

from benchmarks.timing import best_of
from harmolab.data.synthetic import synthetic_clip
from harmolab.systems.music2dance.codes import RotationCode
from harmolab.systems.music2dance.generate import CachedWaveNet
from harmolab.systems.music2dance.networks import DanceNetwork, WaveNet
from harmolab.systems.music2dance.params import Music2DanceParams

FRAMES, ANEW = 2000, 200  # danced by either
DANCES = ("cha-cha", "rumba", "tango", "waltz")


def paper_network() -> DanceNetwork:
    """An untrained network of the paper's size: rotations of 20 points."""
    motion = synthetic_clip("cha-cha", seconds=8.0, fps=25.0, seed=0).motion
    if motion is None:
        raise ValueError("a synthetic clip has a motion")
    return DanceNetwork(Music2DanceParams.paper(), RotationCode.of([motion]), DANCES).eval()


def cached(net: WaveNet, music: torch.Tensor, dance: torch.Tensor, frames: np.ndarray) -> np.ndarray:
    """Mean (T, C) of what follows each frame, remembered."""
    stepped = CachedWaveNet(net, music, dance)
    return np.array([stepped.step(frame, number)[0] for number, frame in enumerate(frames)])


def anew(net: WaveNet, music: torch.Tensor, dance: torch.Tensor, frames: np.ndarray, reach: int) -> np.ndarray:
    """The same, from the last `reach` frames, which are seen again for each."""
    rows = []
    for end in range(1, len(frames) + 1):
        span = slice(max(0, end - reach), end)
        seen = torch.from_numpy(frames[None, span])
        prediction = net(seen, music[None, span], dance, seen[..., : net.head.n_motion])
        rows.append(prediction.mean[0, -1].numpy())
    return np.array(rows)


def measure(rounds: int = 3) -> dict[str, float]:
    """Frames a second of both, their ratio, and the largest difference of what they predict (standard deviations)."""
    torch.manual_seed(0)
    network, threads = paper_network(), torch.get_num_threads()
    net, reach = network.body, network.params.reach
    if not isinstance(net, WaveNet) or network.mapping is None:
        raise ValueError("the paper's generator is a WaveNet that hears mapped music")
    frames = np.random.default_rng(0).standard_normal((FRAMES, network.n_motion)).astype(np.float32)
    try:
        torch.set_num_threads(1)
        with torch.inference_mode():
            music, dance = torch.randn(FRAMES, network.mapping.size), network.vectors(torch.tensor([0]))
            difference = np.abs(
                cached(net, music, dance, frames)[:ANEW] - anew(net, music, dance, frames[:ANEW], reach)
            )
            ours = best_of(lambda: cached(net, music, dance, frames), rounds) / FRAMES
            plain = best_of(lambda: anew(net, music, dance, frames[:ANEW], reach), rounds) / ANEW
    finally:
        torch.set_num_threads(threads)
    return {
        "parameters (thousands)": network.parameter_count() / 1e3,
        "frames a second, remembered": 1000 / ours,
        "frames a second, seen anew": 1000 / plain,
        "times faster": plain / ours,
        "largest difference (SD)": float(difference.max()),
    }


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:32s}{value:12.3g}" if value < 1 else f"{name:32s}{value:12.1f}")
