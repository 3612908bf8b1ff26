"""A song danced in one pass: its music and one draw of noise in, all frames out."""

from __future__ import annotations

from typing import Any

import torch

from harmolab.systems.common.borders import continued
from harmolab.systems.common.dancing import DanceInput
from harmolab.types import FloatArray


@torch.inference_mode()
def danced_song(generator: Any, source: DanceInput, seed: int) -> FloatArray:
    """The motion code (n_frames, C) of a dance by a `RenGenerator`, in evaluation mode, with noise drawn by `seed`.

    The generator knows no movement before the dance. Where `source` has one, the first moments go on from its end, as
    at the borders of every other system.
    """
    was_training = generator.training
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        noise = generator.noise(1, len(source.audio))
    audio = torch.from_numpy(source.audio)[None].to(noise.device)
    scaled = generator.eval()(audio, audio.new_ones(audio.shape[:2]), noise)[0]
    generator.train(was_training)
    scale = generator.motion_scale
    code: FloatArray = (scaled * scale.std + scale.mean).double().cpu().numpy()
    begin, past = -source.first, source.prior[: -source.first]
    dance = code[begin : begin + source.n_frames]
    return continued(past, dance, generator.fps) if len(past) else dance
