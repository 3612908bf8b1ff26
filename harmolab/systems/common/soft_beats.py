"""Soft visual beats of a batch of motions: joint speed, turning points, salience, relaxed (Eq. 7-9, 12-13).

A visual beat becomes a weight b(t) between 0 and 1 at every frame. As the softness `tau` falls, the weights tend to 1
at the beats of `harmolab.beats.visual` and `harmolab.beats.saliency`, and to 0 elsewhere.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import conv1d, pad, relu

from harmolab.kinematics import TIE_TOLERANCE
from harmolab.params import HarmonyParams

RATE = 15.0  # hertz: steps of the curve are judged by what they would be at this rate, so that fps hardly matters


def soft_speed(positions: Tensor, fps: float, *, reading: str = "norm") -> Tensor:
    """Joint velocity sum J_v of (N, T, J, D) positions (Eq. 7): (N, T), units per second.

    Readings and the first frame are those of `kinematics.joint_speed`.
    """
    steps = positions[:, 1:] - positions[:, :-1]
    if reading == "norm":
        # Along the first axis the norm of three numbers takes half the time; at rest its gradient is 0, not NaN.
        speed = torch.linalg.vector_norm(steps.movedim(-1, 0), dim=0).sum(dim=-1)
    elif reading == "signed":
        speed = steps.sum(dim=(2, 3))
    else:
        speed = torch.linalg.vector_norm(steps.sum(dim=2), dim=-1)
    return torch.cat([speed[:, :1], speed], dim=1) * fps


def smoothed(curve: Tensor, mask: Tensor, sigma: float) -> Tensor:
    """The (N, T) curve smoothed by a Gaussian of `sigma` frames, as `kinematics.smooth` does.

    Beyond both ends of each clip the curve keeps its last value, whatever stands in the padding.
    """
    if sigma == 0:
        return curve
    radius = int(4 * sigma + 0.5)
    last = (frames_before_end(mask).sum(dim=1, keepdim=True).long() - 1).clamp(min=0)
    frames = torch.arange(-radius, curve.shape[1] + radius, device=curve.device).clamp(min=0)
    held = curve.gather(1, torch.minimum(frames, last))
    offsets = torch.arange(-radius, radius + 1, device=curve.device, dtype=curve.dtype)
    kernel = torch.exp(-0.5 * (offsets / sigma) ** 2)
    return conv1d(held[:, None], (kernel / kernel.sum())[None, None])[:, 0]


def soft_beats(curve: Tensor, mask: Tensor, *, fps: float, tau: float, detector: str) -> Tensor:
    """Weight b(t) of a visual beat at every frame (Eq. 8-9, relaxed).

    ``u = tanh(D / (tau mean |D|))`` is the soft sign of a step D of the curve. A weak step leaves the sign before it
    standing, as far as it is weak: ``s(t) = (1 - |u(t)|) s(t-1) + u(t)``, the soft form of the carried sign of
    `kinematics.step_signs`; without it a turn half way between two frames would be missed. A turn is worth
    ``relu(-s(t-1) u(t))``; a valley or a peak is one half of that.

    Parameters
    ----------
    curve : (N, T) tensor, the (smoothed) joint speed
    mask : (N, T) tensor, 1 at real frames
    fps : float, hertz
    tau : float
    detector : "turns", "valleys" or "peaks"

    Returns
    -------
    (N, T) tensor of weights from 0 to 1
    """
    real = frames_before_end(mask)
    steps = (curve[:, 1:] - curve[:, :-1]) * real[:, 1:]
    with torch.no_grad():
        largest = (curve.abs() * real).amax(dim=1, keepdim=True)
        ties = steps.abs() <= TIE_TOLERANCE * largest
    scale = steps.abs().sum(dim=1, keepdim=True) / real[:, 1:].sum(dim=1, keepdim=True).clamp(min=1)
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    signs = torch.tanh(steps * (fps / RATE) / (tau * scale)).masked_fill(ties, 0.0)
    before, after = _last_values(1 - signs.abs(), signs)[:, :-1], signs[:, 1:]
    if detector == "turns":
        return pad(relu(-before * after), (1, 1)) * mask
    sign = 1 if detector == "valleys" else -1
    return pad(relu(-sign * before) * relu(sign * after), (1, 1)) * mask


def soft_salience(weights: Tensor, curve: Tensor, *, tau: float, params: HarmonyParams) -> Tensor:
    """Weights of the attentional visual beats (Eq. 12-13, relaxed): (N, T), at most `weights`.

    The value of the last beat before t obeys ``v(t) = (1 - b(t)) v(t-1) + b(t) J(t)``, a chain of affine maps that
    `_last_values` composes in log2(T) steps.
    """
    if params.visual_threshold is None:
        return weights
    strengths = curve.abs()
    inputs = torch.stack([weights * strengths, weights])  # (2, N, T)
    last, has_last = pad(_last_values(1 - weights, inputs), (1, 0))[..., :-1]
    # A beat without any neighbour has no difference, and Eq. 13 drops it; a first one borrows the second's.
    steps, defined = (has_last * strengths - last).abs(), has_last
    if params.first_beat == "copy":
        after = _last_values(1 - weights.flip(-1), inputs.flip(-1)).flip(-1)
        following, has_next = pad(after, (0, 1))[..., 1:]
        steps = steps + (1 - has_last) * (has_next * strengths - following).abs()
        defined = has_last + (1 - has_last) * has_next
    counted = weights * has_last
    total = counted.sum(dim=1, keepdim=True).clamp(min=1e-12)
    mean = (counted * steps).sum(dim=1, keepdim=True) / total
    variance = (counted * (steps - mean) ** 2).sum(dim=1, keepdim=True) / total
    scale = torch.where(mean > 0, mean, torch.ones_like(mean))
    spread = torch.sqrt(variance + (1e-6 * scale) ** 2)  # the root of 0 has no gradient
    compared = strengths if params.visual_saliency == "strength" else steps
    passed = torch.sigmoid((compared - params.visual_threshold * spread) / (tau * scale))
    return weights * passed * defined


def _last_values(decay: Tensor, inputs: Tensor) -> Tensor:
    """v(t) = decay(t) v(t-1) + inputs(t) from v = 0, along the last axis, in log2(T) steps.

    Every step composes the affine maps of neighbouring stretches, twice as long each time.
    """
    reach = 1
    while reach < inputs.shape[-1]:
        inputs = inputs + decay * pad(inputs, (reach, 0))[..., :-reach]
        decay = decay * pad(decay, (reach, 0))[..., :-reach]
        reach *= 2
    return inputs


def parabola_shift(curve: Tensor) -> Tensor:
    """Offset of the extremum at each frame from the frame, -0.5 to 0.5 frames (`kinematics.refine_extrema`)."""
    before, top, after = curve[:, :-2], curve[:, 1:-1], curve[:, 2:]
    bend = before - 2 * top + after
    flat = bend.abs() <= 1e-12 * top.abs() + 1e-30
    shift = 0.5 * (before - after) / bend.masked_fill(flat, 1.0)
    return pad(shift.masked_fill(flat, 0.0).clamp(-0.5, 0.5), (1, 1))


def frames_before_end(mask: Tensor) -> Tensor:
    """1 up to the last real frame of each clip, (N, T)."""
    return mask.flip(1).cummax(dim=1).values.flip(1)
