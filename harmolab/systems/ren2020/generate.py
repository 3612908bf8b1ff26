"""A song danced in one pass: its music and one draw of noise in, all frames out."""

from __future__ import annotations

from typing import Any

import torch

from harmolab.systems.common.borders import continued
from harmolab.systems.common.dancing import Heard
from harmolab.types import FloatArray


@torch.inference_mode()
def danced_song(generator: Any, heard: Heard, seed: int) -> FloatArray:
    """The motion code (n_frames, C) of a dance by a `RenGenerator`, in evaluation mode, with noise drawn by `seed`.

    The generator knows no movement before the dance. Where `heard` has one, the first moments go on from its end, as
    at the borders of every other system.
    """
    was_training = generator.training
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        noise = generator.noise(1, len(heard.audio))
    audio = torch.from_numpy(heard.audio)[None].to(noise.device)
    scaled = generator.eval()(audio, audio.new_ones(audio.shape[:2]), noise)[0]
    generator.train(was_training)
    scale = generator.motion_scale
    code: FloatArray = (scaled * scale.std + scale.mean).double().cpu().numpy()
    begin, past = -heard.first, heard.prior[: -heard.first]
    dance = code[begin : begin + heard.n_frames]
    return continued(past, dance, generator.fps) if len(past) else dance
