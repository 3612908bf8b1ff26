"""A differentiable counterpart of the harmony score: soft hits, chance level and harmony (Eq. 7-21).

The measure "shape" ranks moments in place of counting hits, see `harmolab.systems.common.soft_shape`. Of hits, every
hard decision of `harmolab.harmony` becomes a smooth one whose softness is `tau`; as tau falls, each number tends to
that of `score_harmony`. A visual beat becomes a weight b(t) between 0 and 1 at every frame, and the soft beats are
taken to be independent: a moment is missed when every beat near it is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.systems.common.soft_beats import (
    frames_before_end,
    parabola_shift,
    smoothed,
    soft_beats,
    soft_salience,
    soft_speed,
)
from harmolab.systems.common.soft_shape import soft_place, soft_shape_speed

EDGE = 1e-7  # seconds: a beat exactly at the delay is a hit, also at the smallest tau
REACH = 9.2  # widths of the hit kernel's edge beyond which it is nothing (below 1e-4)
NODES = 4  # moments a frame at which chance is looked up when beats lie between frames
ONLY = {  # choices of HarmonyParams of which one alone has a relaxation
    "saliency": "threshold",
    "matching": "many",
    "plateau": "last",
    "clock": 1.0,
    "position_smoothing": 0.0,
}


@dataclass(frozen=True, eq=False)
class SoftHarmony:
    """The relaxed score of every clip; each field is an (N,) tensor. Names are those of `verdict.score.HarmonyScore`.

    In the measure "shape" the rank of a music beat among all moments, 0 to 1, takes the place of its hit; its strength
    does not matter, and M = N, since no visual beats are counted.

    Parameters
    ----------
    harmony : h of Eq. 21
    hitting_score : h_s of Eq. 19
    chance : share of the time at which a random music beat would be hit
    above_chance : h_cc, 0 at chance and 1 with every beat hit
    hit_rate : share of all music beats that are hit
    n_visual : M, the sum of the soft visual beats
    n_audio : N, attentional music beats, a constant
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
    positions: Tensor,
    beats: Tensor,
    strengths: Tensor,
    beat_mask: Tensor,
    mask: Tensor,
    *,
    fps: float,
    tau: float,
    params: HarmonyParams,
    span: Tensor | None = None,
    bar_places: Tensor | None = None,
) -> SoftHarmony:
    """The relaxed harmony of a batch of clips: Eq. 7-21, or the place test of the shape of the body.

    Parameters
    ----------
    positions : (N, T, J, D) tensor of joint positions, or (N, T) tensor of joint speed
    beats, strengths : (N, B) tensors
        Music beats in seconds from frame 0, and their strengths.
    beat_mask : (N, B) tensor, 1 (or True) at real beats
    mask : (N, T) tensor, 1 at real frames; padding stands at the end
    fps : float, hertz
    tau : float
        Softness: 0.5 lets gradients reach most frames, 0.05 is close to the hard score, 1e-8 the hard score of hits.
    params : HarmonyParams
        With ``subframe`` beats lie between frames at the top of a parabola, which the gradient can move; the cubic
        interpolation to 120 hertz of the hard score is not done here. The measure "shape" asks for the pattern, or
        for rests where there is none, and is 0 where the shape hardly changes.
    span : (N, 2) tensor, seconds, optional
        Only music beats, visual beats and chance in [start, end) count; the whole clip if None.
    bar_places : (N,) tensor of int, optional
        Place in its bar of each clip's first beat, for patterns of several beats; the best place is taken if None.

    Returns
    -------
    SoftHarmony

    Raises
    ------
    ValueError
        For tensors that do not fit together, tau not positive, or a setting that has no relaxation.
    """
    _check_tensors(positions, beats, strengths, beat_mask, mask, span, bar_places)
    if params.measure == "shape" and positions.ndim == 2:
        raise ValueError("the shape of the body needs joint positions (N, T, J, D); a speed (N, T) has none")
    _check_settings(fps, tau, params)
    # Differences of 16-bit positions would be mostly rounding.
    positions = positions.float() if positions.dtype.itemsize < 4 else positions
    if params.measure == "shape":
        with torch.autocast(positions.device.type, enabled=False):
            return _of_shape(
                positions, beats.to(positions.dtype), beat_mask.bool(), mask, span, bar_places,
                fps=fps, tau=tau, params=params,
            )  # fmt: skip
    curve = positions if positions.ndim == 2 else soft_speed(positions, fps, reading=params.speed)
    mask = mask.to(curve.dtype)
    with torch.autocast(curve.device.type, enabled=False):
        curve = smoothed(curve, mask, params.smoothing * fps)
    duration = frames_before_end(mask).sum(dim=1) / fps
    limits = torch.stack([torch.zeros_like(duration), duration], dim=1) if span is None else span.to(curve.dtype)
    track = _visual_track(curve, mask, limits, fps=fps, tau=tau, params=params)
    beats, counted = beats.to(curve.dtype), beat_mask.bool()
    if span is not None:
        counted = counted & (beats >= limits[:, :1]) & (beats < limits[:, 1:])
    return _score(track, beats, _audio_strengths(strengths.to(curve.dtype), counted, params), counted, params)


def _of_shape(
    positions: Tensor, beats: Tensor, counted: Tensor, mask: Tensor, span: Tensor | None, bar_places: Tensor | None,
    *, fps: float, tau: float, params: HarmonyParams,
) -> SoftHarmony:  # fmt: skip
    """The place test in the terms of the hits."""
    duration = frames_before_end(mask.to(beats.dtype)).sum(dim=1, keepdim=True) / fps
    late = beats + params.lag
    counted = counted & (late >= 0) & (late <= duration)
    if span is not None:
        counted = counted & (beats >= span[:, :1]) & (beats < span[:, 1:])
    pattern = params.pattern or HOW_PATTERNS["rest"]
    shape = soft_shape_speed(positions, mask, fps, smoothing=params.position_smoothing)
    place = soft_place(shape, late, counted, pattern, tau=tau, places=bar_places)
    n_audio = counted.sum(dim=1).to(positions.dtype)
    share = place.rank * (n_audio > 0)
    return SoftHarmony(share, share * n_audio, place.chance, place.harmony_above_chance, share, n_audio, n_audio)


def _visual_track(
    curve: Tensor, mask: Tensor, limits: Tensor, *, fps: float, tau: float, params: HarmonyParams
) -> _SoftTrack:
    """Attentional soft beats inside the limits, at their times after the lag is taken off."""
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
    weights, times = (
        pad(each, (radius, radius)).flatten().index_select(0, places.flatten()).view(places.shape)
        for each in (track.weights, track.times)
    )
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


def _check_tensors(
    positions: Tensor,
    beats: Tensor,
    strengths: Tensor,
    beat_mask: Tensor,
    mask: Tensor,
    span: Tensor | None,
    bar_places: Tensor | None,
) -> None:
    """ValueError for tensors that do not fit together."""
    shape = tuple(positions.shape)
    if len(shape) not in (2, 4) or shape[1] < 2:
        raise ValueError(f"positions must be (N, T, J, 3), or a speed (N, T), with two frames or more; got {shape}")
    if tuple(mask.shape) != shape[:2]:
        raise ValueError(f"mask must be {shape[:2]}, one entry per frame; got {tuple(mask.shape)}")
    if not beats.shape == strengths.shape == beat_mask.shape or beats.ndim != 2 or len(beats) != shape[0]:
        shapes = [tuple(each.shape) for each in (beats, strengths, beat_mask)]
        raise ValueError(f"beats, strengths and beat_mask must be ({shape[0]}, B) each, got {shapes}")
    if bar_places is not None and tuple(bar_places.shape) != shape[:1]:
        raise ValueError(f"bar_places must be ({shape[0]},), one a clip; got {tuple(bar_places.shape)}")
    if span is not None and tuple(span.shape) != (shape[0], 2):
        raise ValueError(f"span must be ({shape[0]}, 2), start and end of each clip; got {tuple(span.shape)}")


def _check_settings(fps: float, tau: float, params: HarmonyParams) -> None:
    """ValueError for settings that have no relaxation."""
    for name, number in {"fps": fps, "tau": tau}.items():
        if not 0 < number < float("inf"):
            raise ValueError(f"{name} must be positive, got {number}")
    if params.fps is not None and params.fps != fps:
        raise ValueError(f"the score is defined at {params.fps:g} fps and the motion has {fps:g}: resample it first")
    if params.measure == "pattern":
        raise ValueError("measure = 'pattern' has no relaxation; use shape or hits")
    only = {"clock": 1.0} if params.measure == "shape" else ONLY
    if params.measure == "hits" and params.detector == "direction":
        raise ValueError("detector = 'direction' has no relaxation; use turns, valleys or peaks")
    for name, value in only.items():
        if getattr(params, name) != value:
            raise ValueError(f"only {name} = {value!r} has a relaxation, got {getattr(params, name)!r}")
