"""Loss terms of the generator and its discriminators (paper Sec. 4.3, Eq. 24-32), one function each.

Every function returns one number, a mean over the clips of the batch. Padded frames never count. Terms that the paper
does not have: `harmolab.systems.harmogan.natural_terms`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import softplus

from harmolab.systems.common.soft_harmony import SoftHarmony
from harmolab.verdict.score import HarmonyScore


def kl_loss(flat: Tensor, target: Tensor, mask: Tensor, *, spread: float = 0.1) -> Tensor:
    """KL divergence between the distributions of recorded and intermediate 2-D poses (Eq. 24).

    The paper leaves open how a pose becomes a distribution. We take the heat map of 2-D pose estimation: each joint is
    a round Gaussian about its position, independent of the others. KL(P || Q) of two such Gaussians is
    ``|difference|^2 / (2 spread^2)`` exactly. A softmax over coordinates, the usual shortcut, would see hardly any
    joint but the highest, and would not see a pose shifted as a whole.

    Parameters
    ----------
    flat, target : (N, T, J, 2) tensors, metres
    mask : (N, T) tensor, 1 at real frames
    spread : float, metres, standard deviation of the Gaussians

    Returns
    -------
    Mean over clips of the mean over joints and real frames, in nats.
    """
    check_shapes(flat, target, mask)
    if not 0 < spread < float("inf"):
        raise ValueError(f"spread must be positive, got {spread}")
    divergence = (flat - target).square().sum(dim=-1).mean(dim=-1) / (2 * spread**2)
    return clip_means(divergence, mask.to(flat.dtype)).mean()


def charbonnier_mse(motion: Tensor, target: Tensor, index: Tensor, mask: Tensor, *, epsilon: float = 1e-3) -> Tensor:
    """Distance of every frame from the recorded one, prior frames counting half, added up over time (Eq. 25).

    ``sum_t sqrt(W_tp(t) |V(t) - G(t)|^2 + epsilon^2)`` with ``W_tp = (2 - TI) / 2``; the square is that of the whole
    pose vector.

    Parameters
    ----------
    motion, target : (N, T, C) tensors
    index : (N, T) tensor, TI: 1 where a frame belongs to the last meter
    mask : (N, T) tensor, 1 at real frames
    epsilon : float

    Returns
    -------
    Mean over clips of the sum over real frames.
    """
    check_shapes(motion, target, mask)
    weights = (2 - index.to(motion.dtype)) / 2
    distance = torch.sqrt(weights * (motion - target).square().sum(dim=-1) + epsilon**2)
    return (distance * mask.to(motion.dtype)).sum(dim=1).mean()


def feature_loss(maps: Sequence[Tensor], targets: Sequence[Tensor], *, epsilon: float = 1e-3) -> Tensor:
    """Distance of deep features of generated and recorded motion, added up over time (Eq. 26).

    Parameters
    ----------
    maps, targets : lists of (N, channels, T', ...) tensors, one for each layer of the pose network
    epsilon : float

    Returns
    -------
    Mean over layers and clips of ``sum_t sqrt((difference)^2 + epsilon^2)``; the square is a mean over channels and
    joints, since layers differ in size.
    """
    if not maps or [each.shape for each in maps] != [each.shape for each in targets]:
        shapes = [tuple(each.shape) for each in maps], [tuple(each.shape) for each in targets]
        raise ValueError(f"feature maps must be two equal lists of layers, got shapes {shapes[0]} and {shapes[1]}")
    differences = (ours - theirs for ours, theirs in zip(maps, targets, strict=True))
    squares = [each.square().movedim(2, 1).flatten(2).mean(dim=-1) for each in differences]  # (N, T') a layer
    return torch.stack([torch.sqrt(square + epsilon**2).sum(dim=1).mean() for square in squares]).mean()


def literal_harmony_loss(score: HarmonyScore) -> float:
    """The harmony loss as printed, of a hard score: ``-h_s + sqrt|M - N|`` (Eq. 27). It has no gradient: report it.

    The text speaks of an L1 distance of the counts, the formula has its root; the formula is followed.
    """
    return float(-score.hitting_score + abs(score.n_visual - score.n_audio) ** 0.5)


def harmony_loss(soft: SoftHarmony, *, count_weight: float = 1.0) -> Tensor:
    """The paper's harmony loss, relaxed: ``-h_s`` plus a smooth root of ``|M - N|`` (Eq. 27).

    The root has infinite slope at 0; ``(x^2 + 1)^(1/4) - 1`` has slope 0 there and tends to ``sqrt|x| - 1``.
    """
    excess = soft.n_visual - soft.n_audio
    count = (excess.square() + 1) ** 0.25 - 1
    return (count_weight * count - soft.hitting_score).mean()


def above_chance_loss(soft: SoftHarmony, *, count_weight: float = 1.0) -> Tensor:
    """Our harmony loss: ``-h_cc`` plus the squared logarithm of ``(M + 1) / (N + 1)``.

    Chance grows with every visual beat, so more beats alone win nothing; the count term keeps M near N from both sides
    alike. Clips without music beats count 0.
    """
    has_beats = (soft.n_audio > 0).to(soft.above_chance.dtype)
    count = torch.log((soft.n_visual + 1) / (soft.n_audio + 1)).square()
    return (has_beats * (count_weight * count - soft.above_chance)).mean()


def adversarial_value(real: Tensor, fake: Tensor) -> Tensor:
    """``E[log D(x)] + E[log(1 - D(G(Y)))]``, which D raises and G lowers (Eq. 28).

    Parameters
    ----------
    real, fake : (N,) tensors of logits; D is their sigmoid. Computed from logits, it stays finite when D is sure.
    """
    return -softplus(-real).mean() - softplus(fake).mean()


def discriminator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """The loss of D_cd and D_st: the negative of the values they are to maximise (Eq. 29-30).

    Parameters
    ----------
    real, fake : (N,) tensors of logits, for recorded motion and for generated (detached) motion
    """
    return -adversarial_value(real, fake)


def generator_gan_loss(
    cross_domain: Tensor | None, spatial_temporal: Tensor, *, cross_domain_weight: float = 1.0
) -> Tensor:
    """``w E[-log D_cd] + E[-log D_st]`` of generated motion, which the generator minimises (Eq. 31, w = 1).

    Parameters
    ----------
    cross_domain, spatial_temporal : (N,) logits; None for the first leaves it out
    cross_domain_weight : float, w; reasons for other weights: `harmolab.systems.harmogan.params.TrainParams`
    """
    movement = softplus(-spatial_temporal).mean()
    return movement if cross_domain is None else cross_domain_weight * softplus(-cross_domain).mean() + movement


def clip_means(values: Tensor, counted: Tensor) -> Tensor:
    """(N,) means of (N, ...) values where `counted` is 1; 0 for a clip where nothing counts.

    Losses are means over clips: that does not depend on how a batch is shared among processes; one over all frames
    would.
    """
    sums, counts = (part.flatten(1).sum(dim=1) for part in (values * counted, counted))
    return sums / counts.clamp(min=1)


def check_shapes(motion: Tensor, target: Tensor, mask: Tensor) -> None:
    """ValueError unless motion and target agree, and the mask has one entry per frame."""
    if motion.shape != target.shape or motion.ndim < 3:
        shapes = f"{tuple(motion.shape)} and {tuple(target.shape)}"
        raise ValueError(f"motion and target must have one shape (N, T, ...), got {shapes}")
    if mask.shape != motion.shape[:2]:
        raise ValueError(f"mask must be {tuple(motion.shape[:2])}, one entry per frame; got {tuple(mask.shape)}")
