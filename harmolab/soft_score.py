"""A differentiable counterpart of the score: soft hits, chance level and harmony (Eq. 7-21), and the soft shape score.

Every yes or no of `harmolab.score` becomes a smooth number of softness `tau`; as tau falls, it tends to that of
`score_harmony`. A visual beat becomes a weight b(t) from 0 to 1 at every frame. Soft beats are taken to be independent:
a moment is missed if every beat near it is missing. The measure "shape" ranks moments instead of counting hits: the
soft form of `harmolab.shape_speed` and `harmolab.verdict.evidence`. Once the joints are turned back about the vertical,
interpolation, smoothing and velocity are linear in them: one convolution does all three.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import conv1d, pad, relu

from harmolab.body.kinematics import TIE_TOLERANCE, smooth_positions, upsample_positions
from harmolab.params import HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.shape_speed import DRIFT, FEWEST, RIDGE
from harmolab.types import FloatArray
from harmolab.verdict.bar_pattern import templates
from harmolab.verdict.evidence import LEAST_PULSE

# Soft visual beats: joint speed, turning points, salience (Eq. 7-9, 12-13)

RATE = 15.0  # hertz: steps of the curve are judged by what they would be at this rate, so that fps hardly matters


def soft_speed(positions: Tensor, fps: float, *, reading: str = "norm") -> Tensor:
    """Joint velocity sum J_v of (N, T, J, D) positions (Eq. 7): (N, T), units per second.

    Readings and the first frame are those of `body.kinematics.joint_speed`.
    """
    steps = positions[:, 1:] - positions[:, :-1]
    if reading == "signed":
        speed = steps.sum(dim=(2, 3))
    else:
        steps = steps if reading == "norm" else steps.sum(dim=2, keepdim=True)
        rests = (steps.detach() == 0).all(dim=-1)  # where all derivatives are 0, the second too
        steps = steps.masked_fill(rests[..., None], 1.0).movedim(-1, 0)  # the norm takes half the time along the first
        speed = torch.linalg.vector_norm(steps, dim=0).masked_fill(rests, 0.0).sum(dim=-1)
    return torch.cat([speed[:, :1], speed], dim=1) * fps


def smoothed(curve: Tensor, mask: Tensor, sigma: float) -> Tensor:
    """The (N, T) curve smoothed by a Gaussian of `sigma` frames, as `body.kinematics.smooth` does.

    Beyond both ends of each clip the curve keeps its last value, whatever stands in the padding.
    """
    if sigma == 0:
        return curve
    last = (frames_before_end(mask).sum(dim=1, keepdim=True).long() - 1).clamp(min=0)
    return _smoothed_between(curve, torch.zeros_like(last), last, sigma)


def _smoothed_between(curve: Tensor, first: Tensor, last: Tensor, sigma: float) -> Tensor:
    """The (N, T) curve, held as it is at its first and last samples (N, 1), smoothed by a Gaussian of `sigma` ones."""
    radius = int(4 * sigma + 0.5)
    samples = torch.arange(-radius, curve.shape[1] + radius, device=curve.device)
    held = curve.gather(1, torch.maximum(torch.minimum(samples, last), first))
    offsets = torch.arange(-radius, radius + 1, device=curve.device, dtype=curve.dtype)
    kernel = torch.exp(-0.5 * (offsets / sigma) ** 2)
    return conv1d(held[:, None], (kernel / kernel.sum())[None, None])[:, 0]


def soft_beats(curve: Tensor, mask: Tensor, *, fps: float, tau: float, detector: str) -> Tensor:
    """Weight b(t) of a visual beat at every frame (Eq. 8-9, relaxed).

    ``u = tanh(D / (tau mean |D|))`` is the soft sign of a step D of the curve. A weak step leaves the sign before it
    standing, as far as it is weak: ``s(t) = (1 - |u(t)|) s(t-1) + u(t)``, the soft form of the carried sign of
    `body.kinematics.step_signs`; without it a turn half way between two frames would be missed. A turn is worth
    ``relu(-s(t-1) u(t))``; a valley or a peak is one half of that.

    Parameters
    ----------
    curve : (N, T) tensor, the (smoothed) joint speed
    mask : (N, T) tensor, 1 at real frames
    fps, tau : float, hertz, and softness
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
    turns = relu(-before * after)
    if detector != "turns":
        turns = turns * ((after > 0) == (detector == "valleys"))
    return pad(turns, (1, 1)) * mask


def soft_salience(weights: Tensor, curve: Tensor, *, tau: float, params: HarmonyParams) -> Tensor:
    """Weights of the attentional visual beats (Eq. 12-13, relaxed): (N, T), at most `weights`.

    The value of the last beat before t obeys ``v(t) = (1 - b(t)) v(t-1) + b(t) J(t)`` (`_last_values`).
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
    """Offset of the extremum at each frame from the frame, -0.5 to 0.5 frames (`body.kinematics.refine_extrema`)."""
    before, top, after = curve[:, :-2], curve[:, 1:-1], curve[:, 2:]
    bend = before - 2 * top + after
    flat = bend.abs() <= 1e-12 * top.abs() + 1e-30
    shift = 0.5 * (before - after) / bend.masked_fill(flat, 1.0)
    return pad(shift.masked_fill(flat, 0.0).clamp(-0.5, 0.5), (1, 1))


def frames_before_end(mask: Tensor) -> Tensor:
    """1 up to the last real frame of each clip, (N, T)."""
    return mask.flip(1).cummax(dim=1).values.flip(1)


# The soft shape score: shape speed, and the rank of the music's beats in it

SHAPE_RATE = 30.0  # hertz, at least: the rate of the shape speed; between its samples it is a straight line
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
    """

    rank: Tensor
    chance: Tensor
    harmony_above_chance: Tensor


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
    at_one = centred.abs().amax((1, 2, 3)) <= 64 * torch.finfo(centred.dtype).eps * positions.abs().amax((1, 2, 3))
    centred = centred.masked_fill(at_one[:, None, None, None], 0.0)  # else errors of rounding are scored
    n_joints, n_axes = positions.shape[2:]
    source = unturned(centred) if n_axes == 3 and n_joints >= FEWEST else centred
    shape, velocity, rate = _smoothed(source, last, fps, smoothing)
    if n_joints < FEWEST:
        _, velocity, _ = _smoothed(positions, last, fps, smoothing)
    energy = velocity.square().sum(dim=(1, 2))
    if n_joints >= FEWEST:
        energy = (energy - _outer_energy(shape, velocity)).clamp(min=0)
    last = (last * rate / fps).round().long()
    after = torch.arange(energy.shape[1], device=last.device) > last[:, None]
    size = shape.square().sum(dim=(1, 2)).masked_fill(after, torch.nan).nanmedian(dim=1, keepdim=True).values
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
    angle = pad(steps, (1, 0)).cumsum(dim=1)[..., None]
    cos, sin = angle.cos(), angle.sin()
    return torch.stack([cos * x - sin * z, centred[..., 1], sin * x + cos * z], dim=-1)


def _smoothed(positions: Tensor, last: Tensor, fps: float, smoothing: float) -> tuple[Tensor, Tensor, float]:
    """Smoothed positions and velocities between the frames, (N, D, J, S) each, and the rate of S.

    Beyond both ends of each clip the motion goes on as it came: an odd reflection.
    """
    factor = max(1, int(np.ceil(SHAPE_RATE / fps)))
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
    beats : (N, B) tensor, seconds; those that count ascend where `places` are passed
    counted : (N, B) bool tensor
    pattern : BarPattern
    tau : float
    places : (N,) tensor of int, the place in the bar of the first of all B beats; None tries every place
    """
    cycles = (beats.shape[1] - 1) // pattern.beats
    if cycles < 1:
        zero = shape.speed.sum(dim=1) * 0
        return SoftPlace(zero + 0.5, zero + 0.5, zero)
    order = beats.masked_fill(~counted, torch.inf).argsort(dim=1, stable=True)  # the beats that count come first
    beats, total = beats.gather(1, order), counted.sum(dim=1, keepdim=True)
    speed = _on_the_beats(shape, beats, total)[:, : cycles * pattern.beats * MOMENTS]
    size = MOMENTS * pattern.beats * ((total - 1).clamp(min=0) // pattern.beats)  # moments of whole cycles
    fits = soft_fits(speed, size, pattern)
    fits = fits / _spread(fits, size[..., None])
    readings = torch.arange(pattern.beats, device=beats.device)[:, None] if places is None else places[:, None, None]
    numbers = torch.arange(speed.shape[1] // MOMENTS, device=beats.device)
    rows = (numbers + order[:, :1, None] + readings) % pattern.beats
    mean = _best_means(_soft_ranks(fits, size, tau)[:, :, None], rows, size)[:, 0]
    chance = torch.zeros_like(mean) if rows.shape[1] == 1 else _chance(fits, rows, size)
    pulse = _spread(speed, size)[:, 0]
    gate = pulse.square() / (pulse.square() + LEAST_PULSE**2) * (size[:, 0] > 0)
    return SoftPlace((1 + mean) / 2, (1 + chance) / 2, gate * (mean - chance) / (1 - chance))


def _on_the_beats(shape: SoftShape, beats: Tensor, total: Tensor) -> Tensor:
    """Speed without its slow drift at 24 moments a beat, (N, 24 (B - 1)); nothing outside the beats has part in it."""
    n_samples, rate = shape.speed.shape[1], shape.rate
    first = (beats[:, :1] * rate - 1e-6).ceil().long().clamp(0, n_samples - 1)
    end = beats.gather(1, (total - 1).clamp(min=0))
    final = torch.minimum((end * rate + 1e-6).floor().long(), shape.last[:, None]).clamp(min=0)
    first = torch.minimum(first, final)
    rest = shape.speed - _smoothed_between(shape.speed, first, final, DRIFT * rate)
    parts = torch.arange(MOMENTS, device=beats.device, dtype=rest.dtype) / MOMENTS
    moments = (beats[:, :-1, None] + parts * beats.diff(dim=1)[..., None]).flatten(1)
    at = torch.maximum(torch.minimum(moments * rate, final), first)
    left = torch.minimum(at.floor().long(), (final - 1).clamp(min=0))
    right = torch.minimum(left + 1, final)
    return torch.lerp(rest.gather(1, left), rest.gather(1, right), at - left)


def soft_fits(speed: Tensor, size: Tensor, pattern: BarPattern) -> Tensor:
    """`bar_pattern.pattern_fits` of a batch, (N, places, G): each speed is a circle of `size` moments, (N, 1)."""
    kernels = torch.as_tensor(templates(pattern, MOMENTS)).to(speed)
    half = kernels.shape[1] // 2
    around = torch.arange(-half, speed.shape[1] + half, device=speed.device) % size.clamp(min=1)
    return conv1d(speed.gather(1, around)[:, None], kernels[:, None])


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


def _best_means(ranks: Tensor, rows: Tensor, size: Tensor) -> Tensor:
    """(N, lags) means over the beats of their ranks (N, places, lags, beats), in the best reading.

    `rows` (N, readings, beats) is the place of the pattern that each beat has in each reading.
    """
    inside = (torch.arange(rows.shape[2], device=rows.device) * MOMENTS < size).to(ranks.dtype)[:, None, None]
    own = ranks.gather(1, rows[:, :, None].expand(-1, -1, ranks.shape[2], -1))
    return ((own * inside).sum(dim=3) / inside.sum(dim=3).clamp(min=1)).amax(dim=1)


@torch.no_grad()
def _chance(fits: Tensor, rows: Tensor, size: Tensor) -> Tensor:
    """(N,) mean over all lags of the best reading's mean rank, -1 to 1; a constant to the gradient."""
    cycle, moments = fits.shape[1], torch.arange(fits.shape[2], device=fits.device)
    order = fits.masked_fill((moments >= size)[:, None], float("inf")).argsort(dim=2).argsort(dim=2)
    ranks = (2 * order + 1).to(fits.dtype) / size.clamp(min=1)[..., None] - 1
    starts = torch.arange(MOMENTS * cycle, device=fits.device)[:, None] + moments[::MOMENTS]
    at_lags = (starts.flatten() % size.clamp(min=1))[:, None].expand(-1, cycle, -1)
    moved = ranks.gather(2, at_lags).unflatten(2, starts.shape)  # (N, places, lags, beats)
    return _best_means(moved, rows, size).mean(dim=1)


# Soft hits, chance level and harmony (Eq. 11, 17-21)

EDGE = 1e-7  # seconds: a beat exactly at the delay is a hit, also at the smallest tau
REACH = 9.2  # widths of the hit kernel's edge beyond which it is nothing (below 1e-4)
NODES = 4  # moments a frame at which chance is looked up when beats lie between frames
# Choices of HarmonyParams of which one alone has a relaxation.
ONLY = {"saliency": "threshold", "matching": "many", "plateau": "last", "clock": 1.0, "position_smoothing": 0.0}


@dataclass(frozen=True, eq=False)
class SoftHarmony:
    """The score of each clip of a batch, smooth so that it has gradients; each field is an (N,) tensor.

    Names are those of `HarmonyScore`. In the measure "shape" the rank of a music beat among all moments, 0 to 1, takes
    the place of its hit; its strength does not matter, and M = N, since no visual beats are counted.

    Parameters
    ----------
    harmony, hitting_score : h of Eq. 21, h_s of Eq. 19
    chance : hit rate of music beats at random moments; in "shape" their mean rank
    above_chance : harmony above chance: 0 at chance, 1 with every beat hit; take this for a loss
    hit_rate : share of all music beats that are hit
    n_visual : M, the sum of the soft visual beats
    n_audio : N, the number of music beats that count (Eq. 11), a constant
    """

    harmony: Tensor
    hitting_score: Tensor
    chance: Tensor
    above_chance: Tensor
    hit_rate: Tensor
    n_visual: Tensor
    n_audio: Tensor


@dataclass(frozen=True, eq=False)
class _SoftTrack:
    """Soft visual beats: weight and time (seconds) of each frame's beat, (N, T) both; rate, softness, limits (N, 2)."""

    weights: Tensor
    times: Tensor
    fps: float
    tau: float
    limits: Tensor


def anneal(epoch: int, epochs: int, start: float, end: float) -> float:
    """Softness in epoch 0 .. epochs - 1: geometric from `start` to `end`; `end` from then on.

    >>> [round(anneal(epoch, 3, 0.4, 0.1), 3) for epoch in range(4)]
    [0.4, 0.2, 0.1, 0.1]
    """
    if not 0 < start < float("inf") or not 0 < end < float("inf"):
        raise ValueError(f"softness must be positive, got start {start} and end {end}")
    share = min(max(epoch / (epochs - 1), 0.0), 1.0) if epochs > 1 else 1.0
    return float(start * (end / start) ** share)


def soft_harmony(
    positions: Tensor, beats: Tensor, strengths: Tensor | None = None, beat_mask: Tensor | None = None,
    mask: Tensor | None = None,
    *, fps: float, tau: float, params: HarmonyParams, span: Tensor | None = None, bar_places: Tensor | None = None,
) -> SoftHarmony:  # fmt: skip
    """The score of a batch of clips as a loss with gradients: Eq. 7-21 by hits, or the place test of the body's shape.

    Parameters
    ----------
    positions : (N, T, J, D) tensor of joint positions; for the measure "hits" also (N, T) tensor of joint speed
    beats, strengths : (N, B) tensors
        Music beats in seconds from frame 0, and their strengths (all alike if None).
    beat_mask : (N, B) tensor, 1 (or True) at real beats; if None, all that are not NaN are real
    mask : (N, T) tensor, 1 at real frames; all are real if None. Padding stands at the end, and may hold anything.
    fps : float, frames per second
    tau : float, softness: 0.5 lets gradients reach most frames, 0.05 is near the usual score, 1e-8 is that of hits
    params : HarmonyParams
        "hits": with ``subframe`` beats lie between frames, at the top of a parabola that the gradient can move; motion
        is not interpolated to 120 hertz as in the usual score. "shape": asks for ``pattern``, or for rests without
        one, and is 0 where the shape hardly changes.
    span : (N, 2) tensor, seconds, optional
        Only beats and chance in [start, end) of each clip count. If None, the whole clip does, up to the end of its
        mask, so that the beats of the whole song may be passed.
    bar_places : (N,) tensor of int, optional
        Place in its bar of each clip's first beat, for patterns of several beats; beats must ascend then. If None, the
        best place is taken, and beats may stand in any order, each once.

    Returns
    -------
    SoftHarmony
        As a loss take ``-above_chance.mean()``, with a small weight beside losses that keep the movement a dance.

    Raises
    ------
    ValueError
        For what is no tensor, tensors that do not fit together, positions that are whole numbers or not finite, masks
        of other values than 1 and 0, beats of 16 bits, beats or strengths that are not finite, or a bad setting.
    """
    _check_settings(fps, tau, params)
    _check_kinds(positions, beats, strengths, beat_mask, mask, span, bar_places)
    strengths = torch.ones_like(beats) if strengths is None else strengths
    beat_mask = ~beats.isnan() if beat_mask is None else beat_mask
    mask = torch.ones(positions.shape[:2], device=positions.device) if mask is None else mask
    _check_tensors(positions, beats, strengths, beat_mask, mask, span, bar_places)
    if params.measure == "shape" and positions.ndim == 2:
        raise ValueError("the shape of the body needs joint positions (N, T, J, D); a speed (N, T) has none")
    # Differences of 16-bit positions would be mostly rounding.
    positions = positions.float() if positions.dtype.itemsize < 4 else positions
    mask = mask.to(positions.dtype)  # whose sums are numbers of frames, which 16 bits would round
    counted, real = beat_mask.bool(), frames_before_end(mask)
    positions = positions.masked_fill(real[(..., *[None] * (positions.ndim - 2))] == 0, 0.0)  # padding may overflow
    beats, end = beats.to(positions.dtype).nan_to_num(), real.sum(dim=1, keepdim=True) / fps
    if span is not None:
        span = span.to(positions.dtype)
        counted = counted & (beats >= span[:, :1]) & (beats < span[:, 1:])
    with torch.autocast(positions.device.type, enabled=False):
        if params.measure == "shape":
            late = beats + params.lag
            counted = counted & (late >= 0) & (late <= end)
            shape = soft_shape_speed(positions, mask, fps, smoothing=params.position_smoothing)
            return _of_shape(shape, late, counted, bar_places, tau=tau, params=params)
        if span is None:  # a beat on the last frame may be rounded past it
            counted = counted & (beats >= 0) & (beats < end + 0.5 / fps)
            span = torch.cat([torch.zeros_like(end), end], dim=1)
        track = _visual_track(positions, mask, span, fps=fps, tau=tau, params=params)
        return _score(track, beats, _audio_strengths(strengths.to(beats.dtype), counted, params), counted, params)


def _of_shape(
    shape: SoftShape, beats: Tensor, counted: Tensor, places: Tensor | None, *, tau: float, params: HarmonyParams
) -> SoftHarmony:
    """The place test in the terms of the hits."""
    place = soft_place(shape, beats, counted, params.pattern or HOW_PATTERNS["rest"], tau=tau, places=places)
    n_audio = counted.sum(dim=1).to(beats.dtype)
    share = place.rank * (n_audio > 0)
    return SoftHarmony(share, share * n_audio, place.chance, place.harmony_above_chance, share, n_audio, n_audio)


def _visual_track(
    positions: Tensor, mask: Tensor, limits: Tensor, *, fps: float, tau: float, params: HarmonyParams
) -> _SoftTrack:
    """Attentional soft beats inside the limits, at their times after the lag is taken off."""
    curve = positions if positions.ndim == 2 else soft_speed(positions, fps, reading=params.speed)
    curve = smoothed(curve, mask, params.smoothing * fps)
    weights = soft_beats(curve, mask, fps=fps, tau=tau, detector=params.detector)
    weights = soft_salience(weights, curve, tau=tau, params=params)
    frames = torch.arange(curve.shape[1], device=curve.device, dtype=curve.dtype).expand_as(curve)
    times = (frames + parabola_shift(curve) - 0.5 if params.subframe else frames) / fps - params.lag
    inside = (times >= limits[:, :1] - params.lag) & (times < limits[:, 1:] - params.lag)
    return _SoftTrack(weights * inside, times, fps, tau, limits)


def _score(track: _SoftTrack, beats: Tensor, strengths: Tensor, counted: Tensor, params: HarmonyParams) -> SoftHarmony:
    """Eq. 17-21 and the chance level; `strengths` are 0 at beats that are not attentional."""
    nodes, lengths = _chance_nodes(track, params)
    reached = _reached(track, torch.cat([beats, nodes], dim=1), params)
    hits, covered = reached[:, : beats.shape[1]] * counted, reached[:, beats.shape[1] :]
    chance = (covered * lengths).sum(dim=1) / lengths.sum(dim=1).clamp(min=1e-12)
    score, total = (hits * strengths).sum(dim=1), strengths.sum(dim=1)
    n_audio, n_visual = (strengths > 0).sum(dim=1).to(score.dtype), track.weights.sum(dim=1)
    share = score / torch.where(total > 0, total, torch.ones_like(total))
    n_beats = (n_audio * params.beta**2 + n_visual).clamp(min=1e-12)
    return SoftHarmony(
        harmony=(1 + params.beta**2) * score / n_beats,
        hitting_score=score,
        chance=chance,
        above_chance=torch.where(total > 0, (share - chance) / (1 - chance).clamp(min=1e-6), torch.zeros_like(share)),
        hit_rate=hits.sum(dim=1) / counted.sum(dim=1).clamp(min=1),
        n_visual=n_visual,
        n_audio=n_audio,
    )


def _reached(track: _SoftTrack, moments: Tensor, params: HarmonyParams) -> Tensor:
    """(N, G) soft truth that a visual beat lies within the delay of each of the (N, G) moments (Eq. 17-18).

    One minus the product of (1 - b k) over the frames around the moment, with k a sigmoid edge at the delay.
    """
    width = track.tau * (params.reaction_delay or 1 / track.fps)
    n_frames = track.weights.shape[1]
    radius = min(int((params.reaction_delay + REACH * width) * track.fps) + 2, n_frames)
    around = torch.arange(2 * radius + 1, device=moments.device)
    nearest = ((moments + params.lag) * track.fps).round().clamp(0, n_frames - 1).long()
    first = torch.arange(len(moments), device=moments.device)[:, None] * (n_frames + 2 * radius)
    places = (nearest + first)[..., None] + around  # (N, G, 2 radius + 1), in rows padded by the radius
    rows = (pad(each, (radius, radius)).flatten() for each in (track.weights, track.times))
    weights, times = (each.index_select(0, places.flatten()).view(places.shape) for each in rows)
    kernel = torch.sigmoid((params.reaction_delay + EDGE - (moments[..., None] - times).abs()) / width)
    almost_one = 1 - 4 * torch.finfo(weights.dtype).eps
    return -torch.expm1(torch.log1p(-(weights * kernel).clamp(max=almost_one)).sum(dim=-1))


@torch.no_grad()
def _chance_nodes(track: _SoftTrack, params: HarmonyParams) -> tuple[Tensor, Tensor]:
    """Moments (N, G) at which chance is looked up, and the length of time (N, G) that each stands for.

    With beats on frames, the set of beats within the delay changes only a delay before and after each frame: one
    moment between any two such times makes the sum exact at small tau.
    """
    weights, period = track.weights, 1 / track.fps
    frames = torch.arange(-1, weights.shape[1] + 1, device=weights.device, dtype=weights.dtype)
    if params.subframe:
        phases = [step / NODES for step in range(NODES)]
    else:
        ends = (params.reaction_delay, -params.reaction_delay)
        phases = sorted(((end - params.lag) * track.fps) % 1.0 for end in ends)
    edges = torch.stack([(frames + phase) * period for phase in phases], dim=1).flatten()
    cut = torch.maximum(torch.minimum(edges, track.limits[:, 1:]), track.limits[:, :1])
    return (cut[:, 1:] + cut[:, :-1]) / 2, cut.diff(dim=1)


@torch.no_grad()
def _audio_strengths(strengths: Tensor, counted: Tensor, params: HarmonyParams) -> Tensor:
    """Normalised strengths of the attentional music beats, 0 at all others (Eq. 11; exact: nothing here is soft)."""
    count = counted.sum(dim=1, keepdim=True).clamp(min=1)
    strengths = strengths.masked_fill(~counted, 0.0)
    if params.normalisation != "raw" and strengths.shape[1]:
        mean = strengths.sum(dim=1, keepdim=True) / count
        scale = strengths.amax(dim=1, keepdim=True) if params.normalisation == "max" else mean
        strengths = strengths / scale.masked_fill(scale <= 0, 1.0)
    deviations = (strengths - strengths.sum(dim=1, keepdim=True) / count).masked_fill(~counted, 0.0)
    spread = (deviations.square().sum(dim=1, keepdim=True) / count).sqrt()
    return strengths.masked_fill(strengths <= params.audio_threshold * spread, 0.0)


def _check_kinds(*arguments: Tensor | None) -> None:
    """ValueError for what is no tensor; only positions and beats are needed."""
    names = ("positions", "beats", "strengths", "beat_mask", "mask", "span", "bar_places")
    for name, value in zip(names, arguments, strict=True):
        if not isinstance(value, Tensor if name in ("positions", "beats") else Tensor | None):
            raise ValueError(f"{name} must be a torch.Tensor, got {type(value).__name__}; torch.as_tensor makes one")


def _check_tensors(
    positions: Tensor, beats: Tensor, strengths: Tensor, beat_mask: Tensor, mask: Tensor,
    span: Tensor | None, bar_places: Tensor | None,
) -> None:  # fmt: skip
    """ValueError for tensors that do not fit together, and for values that have no score."""
    shape = tuple(positions.shape)
    if len(shape) not in (2, 4) or min(shape) < 1 or shape[1] < 2 or shape[3:] not in ((), (2,), (3,)):
        raise ValueError(f"positions must be (N, T, J, 3), or a speed (N, T), with two frames or more; got {shape}")
    if not positions.is_floating_point():
        raise ValueError(f"positions must be floating-point numbers, got {positions.dtype}; pass positions.float()")
    if tuple(mask.shape) != shape[:2]:
        raise ValueError(f"mask must be {shape[:2]}, one entry per frame; got {tuple(mask.shape)}")
    if not beats.shape == strengths.shape == beat_mask.shape or beats.ndim != 2 or len(beats) != shape[0]:
        shapes = [tuple(each.shape) for each in (beats, strengths, beat_mask)]
        raise ValueError(f"beats, strengths and beat_mask must be ({shape[0]}, B) each, got {shapes}")
    if beats.dtype.itemsize < 4:
        raise ValueError(f"beats are of {beats.dtype}: one at 30 s would be up to 60 ms off; pass seconds of 32 bits")
    if bar_places is not None and tuple(bar_places.shape) != shape[:1]:
        raise ValueError(f"bar_places must be ({shape[0]},), one a clip; got {tuple(bar_places.shape)}")
    if span is not None and tuple(span.shape) != (shape[0], 2):
        raise ValueError(f"span must be ({shape[0]}, 2), start and end of each clip; got {tuple(span.shape)}")
    _check_values(positions, beats, strengths, beat_mask, mask, ascend=bar_places is not None)


def _check_values(
    positions: Tensor, beats: Tensor, strengths: Tensor, beat_mask: Tensor, mask: Tensor, *, ascend: bool
) -> None:
    """ValueError for values that have no score: one look at all of them, since the processor waits for a GPU's."""
    absent = ~beat_mask.bool()
    finite = positions.isfinite().reshape(*mask.shape, -1).all(dim=2) | (frames_before_end(mask) == 0)
    order = beats.float().masked_fill(absent, -torch.inf)
    order = order if ascend else order.sort(dim=1).values
    rising = (order[:, 1:] > order.cummax(dim=1).values[:, :-1]) | ~order[:, 1:].isfinite()
    at_least_0 = (strengths >= 0) & (strengths < torch.inf)
    sound = {
        "mask must be True and False, or 1 and 0": mask == mask.bool(),
        "beat_mask must be True and False, or 1 and 0": beat_mask == ~absent,
        "positions must be finite up to the last frame where mask is 1; fill gaps, or end the mask before them": finite,
        "beats must be finite where beat_mask is 1; mask what is none": absent | beats.isfinite(),
        "strengths must be finite and not negative where beat_mask is 1": absent | at_least_0,
        "beats must differ, and ascend where bar_places are passed; sort them, and pad by NaN or mask": rising,
    }
    for message, is_sound in zip(sound, torch.stack([each.all() for each in sound.values()]).tolist(), strict=True):
        if not is_sound:
            raise ValueError(message)


def _check_settings(fps: float, tau: float, params: HarmonyParams) -> None:
    """ValueError for settings that have no relaxation."""
    if not isinstance(params, HarmonyParams):
        raise ValueError(f"params must be HarmonyParams, such as HarmonyParams.recommended(); got {params!r}")
    for name, number in {"fps": fps, "tau": tau}.items():
        if not 0 < number < float("inf"):
            raise ValueError(f"{name} must be positive, got {number}")
    if params.fps is not None and params.fps != fps:
        raise ValueError(f"the score is defined at {params.fps:g} fps and the motion has {fps:g}: resample it first")
    if params.measure == "hits" and params.detector == "direction":
        raise ValueError("detector = 'direction' has no relaxation; use turns, valleys or peaks")
    for name, value in ({"clock": 1.0} if params.measure == "shape" else ONLY).items():
        if getattr(params, name) != value:
            raise ValueError(f"only {name} = {value!r} has a relaxation, got {getattr(params, name)!r}")
