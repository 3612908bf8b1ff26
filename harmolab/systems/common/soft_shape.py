"""The score of the shape of the body, differentiable: shape speed, and the rank of the music's beats in it.

The soft form of `harmolab.shape_speed` and of `harmolab.verdict.place_test`. Once the joints are turned back about the
vertical, interpolation, smoothing and velocity are linear in them: one convolution does all three.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import conv1d

from harmolab.bar_pattern import evaluate_pattern
from harmolab.kinematics import smooth_positions, upsample_positions
from harmolab.params import BarPattern
from harmolab.shape_speed import DRIFT, FEWEST, RIDGE
from harmolab.systems.common.soft_beats import frames_before_end
from harmolab.types import FloatArray
from harmolab.verdict.evidence import LEAST_PULSE

RATE = 30.0  # hertz, at least: the rate of the shape speed; between its samples it is a straight line
MOMENTS = 24  # a beat
REST_SPEED = 1e-4  # body sizes a second: the root of 0 has no gradient
LEAST_SPREAD = 1e-12  # body sizes a second: a signal that varies less does not vary
SPLINE_REACH = 6  # frames: a cubic through all frames forgets one by a factor 3.7 a frame


@dataclass(frozen=True, eq=False)
class SoftShape:
    """Shape speed of a batch of clips.

    Parameters
    ----------
    speed : (N, S) tensor, body sizes a second; padding behind the last sample
    last : (N,) tensor of int, the last sample of each clip
    rate : float, hertz
    """

    speed: Tensor
    last: Tensor
    rate: float


@dataclass(frozen=True, eq=False)
class SoftPlace:
    """Place of the beats in the movement of a batch of clips; each field is an (N,) tensor.

    Parameters
    ----------
    rank : mean rank of the beats among all moments, 0 to 1
    chance : mean rank at a random lag: 1/2, and more where the best of several places is taken
    harmony_above_chance : H, -1 to 1: the soft form of `PlaceTest.harmony_above_chance`, times the gate
    pulse : SD of the speed without its drift, body sizes a second
    """

    rank: Tensor
    chance: Tensor
    harmony_above_chance: Tensor
    pulse: Tensor


def soft_shape_speed(positions: Tensor, mask: Tensor, fps: float, *, smoothing: float) -> SoftShape:
    """Speed of the shape of the body over its size, at 30 hertz or more (see `harmolab.shape_speed`).

    Parameters
    ----------
    positions : (N, T, J, D) tensor
    mask : (N, T) tensor, 1 at real frames; padding stands at the end, and what is not real before counts as it is
    fps : float, hertz
    smoothing : float, seconds, standard deviation of the Gaussian over the positions
    """
    last = frames_before_end(mask).sum(dim=1).long().clamp(min=1) - 1
    centred = positions - positions.mean(dim=2, keepdim=True)
    n_joints, n_axes = positions.shape[2:]
    source = unturned(centred) if n_axes == 3 and n_joints >= FEWEST else centred
    shape, velocity, rate = _smoothed(source, last, fps, smoothing)
    if n_joints < FEWEST:
        _, velocity, _ = _smoothed(positions, last, fps, smoothing)
    energy = velocity.square().sum(dim=(1, 2))
    if n_joints >= FEWEST:
        energy = (energy - _outer_energy(shape, velocity)).clamp(min=0)
    last = (last * rate / fps).round().long()
    size = _median(shape.square().sum(dim=(1, 2)), last)
    is_point = size <= torch.finfo(size.dtype).tiny ** 0.5
    energy = (energy / size.masked_fill(is_point, 1.0)).masked_fill(is_point, 0.0)
    return SoftShape((energy + REST_SPEED**2).sqrt(), last, rate)


def unturned(centred: Tensor) -> Tensor:
    """Joints (N, T, J, 3) around their mean, turned back about the vertical as `harmolab.shape_speed.unturn` does."""
    x, z = centred[..., 0], centred[..., 2]
    cross = (z[:, :-1] * x[:, 1:] - x[:, :-1] * z[:, 1:]).sum(dim=2)
    dot = (x[:, :-1] * x[:, 1:] + z[:, :-1] * z[:, 1:]).sum(dim=2)
    # Joints in one vertical line have no heading: their turn is 0, and so is its gradient.
    upright = cross.square() + dot.square() <= torch.finfo(centred.dtype).tiny
    steps = torch.atan2(cross.masked_fill(upright, 0.0), dot.masked_fill(upright, 1.0))
    angle = torch.nn.functional.pad(steps, (1, 0)).cumsum(dim=1)[..., None]
    cos, sin = angle.cos(), angle.sin()
    return torch.stack([cos * x - sin * z, centred[..., 1], sin * x + cos * z], dim=-1)


def _smoothed(positions: Tensor, last: Tensor, fps: float, smoothing: float) -> tuple[Tensor, Tensor, float]:
    """Smoothed positions and velocities between the frames, (N, D, J, S) each, and the rate of S.

    Beyond both ends of each clip the motion goes on as it came: an odd reflection.
    """
    factor = max(1, int(np.ceil(RATE / fps)))
    kernels = torch.as_tensor(_kernels(fps, factor, smoothing), dtype=positions.dtype, device=positions.device)
    n_clips, n_frames, n_joints, n_axes = positions.shape
    reach = kernels.shape[1] // 2
    frames = torch.arange(-reach, n_frames + reach, device=positions.device).expand(n_clips, -1)
    end = last[:, None]
    nearest = torch.minimum(frames.clamp(min=0), end)
    mirrored = (end - (end - frames.abs()).abs()).clamp(min=0)
    start = n_frames * torch.arange(n_clips, device=positions.device)[:, None]
    rows = positions.reshape(n_clips * n_frames, -1)
    near, far = (rows.index_select(0, (start + each).flatten()) for each in (nearest, mirrored))
    columns = (2 * near - far).view(n_clips, frames.shape[1], -1).mT.reshape(-1, 1, frames.shape[1])
    both = conv1d(columns, kernels[:, None]).view(n_clips, n_joints, n_axes, 2, factor, n_frames)
    smooth, velocity = both.permute(3, 0, 2, 1, 5, 4).flatten(4)
    return smooth, velocity, factor * fps


@lru_cache(maxsize=16)
def _kernels(fps: float, factor: int, smoothing: float) -> FloatArray:
    """(2 factor, K) weights of the frames around a frame: positions at `factor` moments from it on, then velocities.

    They are the answer of the hard functions to one frame that stands out.
    """
    finer = factor * max(1, round(400 / (factor * fps)))
    reach = int(4 * smoothing * fps) + 1 + SPLINE_REACH
    impulse = (np.arange(4 * reach + 1) == 2 * reach).astype(float)[:, None, None]
    curve = smooth_positions(upsample_positions(impulse, fps, finer * fps), smoothing, finer * fps)[:, 0, 0]
    slope = np.gradient(curve, 1 / (finer * fps))
    moments = np.arange(factor)[:, None] * (finer // factor) - np.arange(-reach, reach + 1) * finer
    return np.concatenate([each[2 * reach * finer + moments] for each in (curve, slope)])


def _outer_energy(shape: Tensor, velocity: Tensor) -> Tensor:
    """(N, S) sum over the joints of what the rotation, in 2-D the 2 x 2 matrix, that fits best explains of |W|^2.

    With ``(M + r) A = B`` the fit and r its ridge, that is ``A B + r A^2``. Time is the last axis of every product:
    solved as a matrix of each moment it takes three times as long.
    """
    outer, mixed = ((shape[:, :, None] * each[:, None]).sum(dim=3) for each in (shape, velocity))  # (N, D, D, S)
    trace = outer.diagonal(dim1=1, dim2=2).sum(dim=-1).clamp(min=torch.finfo(shape.dtype).tiny)[:, None, None]
    n_axes = shape.shape[1]
    unit, ridge = torch.eye(n_axes, dtype=shape.dtype, device=shape.device)[..., None], RIDGE * (n_axes - 1)
    if n_axes == 3:
        turns = [mixed[:, row, column] - mixed[:, column, row] for row, column in ((1, 2), (2, 0), (0, 1))]
        inertia, target = (1 + ridge) * unit - outer / trace, torch.stack(turns, dim=1)[:, :, None] / trace
    else:
        inertia, target = outer / trace + ridge * unit, mixed / trace
    fit = (_inverse(inertia)[:, :, :, None] * target[:, None]).sum(dim=2)
    return (trace * fit * (target + ridge * fit)).sum(dim=(1, 2))


def _inverse(matrices: Tensor) -> Tensor:
    """Inverses of (N, D, D, S) matrices, D = 2 or 3, by their determinants."""
    if matrices.shape[1] == 2:
        (a, b), (c, d) = (row.unbind(1) for row in matrices.unbind(1))
        columns = [torch.stack([d, -c], dim=1), torch.stack([-b, a], dim=1)]
    else:
        a, b, c = matrices.unbind(1)
        columns = [torch.linalg.cross(*pair, dim=1) for pair in ((b, c), (c, a), (a, b))]
    determinants = (matrices[:, 0] * columns[0]).sum(dim=1)
    return torch.stack(columns, dim=2) / determinants[:, None, None]


def _median(values: Tensor, last: Tensor) -> Tensor:
    """(N, 1) medians of (N, S) values up to the last sample."""
    inside = torch.arange(values.shape[1], device=values.device) <= last[:, None]
    return values.masked_fill(~inside, float("nan")).nanmedian(dim=1, keepdim=True).values


def soft_place(
    shape: SoftShape, beats: Tensor, counted: Tensor, pattern: BarPattern, *, tau: float, places: Tensor | None = None
) -> SoftPlace:
    """The place test of one pattern, soft: ranks of the beats among all moments, `tau` SDs of the fit wide.

    With F the fit of the speed around every moment, the rank of a beat b is ``mean_g erf((F(b) - F(g)) / (sqrt(2) tau
    SD F))``, from -1 to 1. H is the mean over the beats times ``pulse^2 / (pulse^2 + .03^2)``: a body that hardly
    changes its shape gets 0. Dancers get the hard H within .02 at ``tau = .1``; a strictly periodic movement, whose fit
    is as high beside a beat as on it, gets up to .17 less.

    Parameters
    ----------
    shape : SoftShape
    beats : (N, B) tensor, seconds, ascending
    counted : (N, B) bool tensor
    pattern : BarPattern
    tau : float
    places : (N,) tensor of int, the place in the bar of the first of all B beats; None tries every place
    """
    order = (~counted).to(torch.int8).argsort(dim=1, stable=True)  # the beats that count come first
    beats, total = beats.gather(1, order), counted.sum(dim=1, keepdim=True)
    speed = _on_the_beats(shape, beats, total)[:, : (beats.shape[1] - 1) // pattern.beats * pattern.beats * MOMENTS]
    if speed.shape[1] == 0:
        zero = shape.speed.sum(dim=1) * 0
        return SoftPlace(zero + 0.5, zero + 0.5, zero, zero)
    size = MOMENTS * pattern.beats * ((total - 1).clamp(min=0) // pattern.beats)  # moments of whole cycles
    fits = _fits(speed, size, pattern)
    first = order[:, :1] + (0 if places is None else places[:, None])
    rows = _rows(first, speed.shape[1] // MOMENTS, pattern.beats, is_placed=places is not None)
    mean = _beat_means(_soft_ranks(fits, size, tau), rows, size).amax(dim=1)
    chance = torch.zeros_like(mean) if rows.shape[1] == 1 else _chance(fits, rows, size)
    pulse = _spread(speed, size)[:, 0]
    gate = pulse.square() / (pulse.square() + LEAST_PULSE**2) * (size[:, 0] > 0)
    return SoftPlace((1 + mean) / 2, (1 + chance) / 2, gate * (mean - chance) / (1 - chance), pulse)


def _on_the_beats(shape: SoftShape, beats: Tensor, total: Tensor) -> Tensor:
    """Speed without its slow drift at 24 moments a beat, (N, 24 (B - 1)); nothing outside the beats has part in it."""
    n_samples, rate = shape.speed.shape[1], shape.rate
    first = (beats[:, :1] * rate - 1e-6).ceil().long().clamp(0, n_samples - 1)
    end = beats.gather(1, (total - 1).clamp(min=0))
    final = torch.minimum((end * rate + 1e-6).floor().long(), shape.last[:, None]).clamp(min=0)
    first = torch.minimum(first, final)
    reach = int(4 * DRIFT * rate + 0.5)
    samples = torch.arange(-reach, n_samples + reach, device=beats.device)
    held = shape.speed.gather(1, torch.maximum(torch.minimum(samples, final), first))
    offsets = torch.arange(-reach, reach + 1, device=beats.device, dtype=held.dtype)
    kernel = torch.exp(-0.5 * (offsets / (DRIFT * rate)) ** 2)
    rest = shape.speed - conv1d(held[:, None], (kernel / kernel.sum())[None, None])[:, 0]
    parts = torch.arange(MOMENTS, device=beats.device, dtype=held.dtype) / MOMENTS
    moments = (beats[:, :-1, None] + parts * beats.diff(dim=1)[..., None]).flatten(1)
    at = torch.maximum(torch.minimum(moments * rate, final), first)
    left = torch.minimum(at.floor().long(), (final - 1).clamp(min=0))
    right = torch.minimum(left + 1, final)
    return torch.lerp(rest.gather(1, left), rest.gather(1, right), at - left)


def _fits(speed: Tensor, size: Tensor, pattern: BarPattern) -> Tensor:
    """(N, places, G) fit of the speed around every moment to every place of the pattern, in its standard deviations.

    The speed of each clip is a circle of `size` moments, (N, 1).
    """
    half = pattern.beats * MOMENTS // 2
    offsets = np.arange(-half, half + 1) / MOMENTS
    window = 0.5 + 0.5 * np.cos(np.pi * offsets * MOMENTS / half)
    templates = window * evaluate_pattern(pattern, offsets + np.arange(pattern.beats)[:, None])
    templates -= window * (templates.sum(axis=1) / window.sum())[:, None]
    around = torch.arange(-half, speed.shape[1] + half, device=speed.device) % size.clamp(min=1)
    fits = conv1d(speed.gather(1, around)[:, None], torch.as_tensor(templates).to(speed)[:, None])
    return fits / _spread(fits, size[..., None])


def _spread(values: Tensor, size: Tensor) -> Tensor:
    """SD of the first `size` values of the last axis."""
    inside = (torch.arange(values.shape[-1], device=values.device) < size).to(values.dtype)
    weights = inside / inside.sum(dim=-1, keepdim=True).clamp(min=1)
    mean = (values * weights).sum(dim=-1, keepdim=True)
    variance = ((values - mean).square() * weights).sum(dim=-1, keepdim=True)
    return variance.clamp(min=LEAST_SPREAD**2).sqrt()


def _soft_ranks(fits: Tensor, size: Tensor, tau: float) -> Tensor:
    """(N, places, beats) ranks of the beats among all moments, -1 to 1, for fits in standard deviations."""
    inside = (torch.arange(fits.shape[2], device=fits.device) < size).to(fits.dtype)[:, None, None]
    above = torch.erf((fits[:, :, ::MOMENTS, None] - fits[:, :, None]) / (tau * 2**0.5))
    return (above * inside).sum(dim=-1) / inside.sum(dim=-1).clamp(min=1)


def _rows(first: Tensor, n_beats: int, cycle: int, *, is_placed: bool) -> Tensor:
    """(N, readings, beats) place of the pattern that each beat has, in each reading; `first` is that of the first."""
    readings = torch.arange(1 if is_placed else cycle, device=first.device)[:, None]
    return (torch.arange(n_beats, device=first.device) + first[..., None] - readings) % cycle


def _beat_means(ranks: Tensor, rows: Tensor, size: Tensor) -> Tensor:
    """(N, readings) means over the beats of their ranks, each of the (N, places, beats) in its row."""
    inside = (torch.arange(rows.shape[2], device=rows.device) * MOMENTS < size).to(ranks.dtype)[:, None]
    return (ranks.gather(1, rows) * inside).sum(dim=2) / inside.sum(dim=2).clamp(min=1)


@torch.no_grad()
def _chance(fits: Tensor, rows: Tensor, size: Tensor) -> Tensor:
    """(N,) mean over all lags of the best reading's mean rank, -1 to 1; a constant to the gradient."""
    cycle, moments = fits.shape[1], torch.arange(fits.shape[2], device=fits.device)
    order = fits.masked_fill((moments >= size)[:, None], float("inf")).argsort(dim=2).argsort(dim=2)
    ranks = (2 * order + 1).to(fits.dtype) / size.clamp(min=1)[..., None] - 1
    starts = torch.arange(MOMENTS * cycle, device=fits.device)[:, None] + moments[::MOMENTS]
    at_lags = (starts.flatten() % size.clamp(min=1))[:, None].expand(-1, cycle, -1)
    moved = ranks.gather(2, at_lags).unflatten(2, starts.shape)  # (N, places, lags, beats)
    rows = rows[:, :, None].expand(-1, -1, len(starts), -1)
    inside = (moments[::MOMENTS] < size).to(fits.dtype)[:, None, None]
    means = (moved.gather(1, rows) * inside).sum(dim=3) / inside.sum(dim=3).clamp(min=1)
    return means.amax(dim=1).mean(dim=1)
