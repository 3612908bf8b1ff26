"""Loss terms of the generator and its discriminators (paper Sec. 4.3, Eq. 24-32), one function each.

Every function returns one number, a mean over the clips of the batch. Padded frames never count. The terms of a
generator that corrects a movement (`sketch_terms`), which the paper does not have, keep it near that movement, and as
natural as that, while harmony pulls at it.
"""

from collections.abc import Sequence
from functools import cache, partial

import torch
from torch import Tensor
from torch.nn.functional import relu, softplus

from harmolab.body.skeletons import Skeleton, foot_joints
from harmolab.params import BarPattern, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.soft_score import SoftHarmony, soft_harmony
from harmolab.systems.harmogan.networks import Generator, GeneratorOutput, Networks
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.training.layers import drawn_by, local_joints
from harmolab.systems.training.loop import Shard, Tensors, Terms

SPREAD = 0.1  # metres, standard deviation of the place of a joint in a 2-D pose
FLOOR = 0.03  # metres above its lowest place in a clip, within which a foot is on the floor


def kl_loss(flat: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """KL divergence between the distributions of recorded and intermediate 2-D poses (Eq. 24).

    The paper leaves open how a pose becomes a distribution. We take the heat map of 2-D pose estimation: each joint is
    a round Gaussian of `SPREAD` about its position, independent of the others. KL(P || Q) of two such Gaussians is
    ``|difference|^2 / (2 spread^2)`` exactly. A softmax over coordinates, the usual shortcut, would see hardly any
    joint but the highest, and would not see a pose shifted as a whole.

    Parameters
    ----------
    flat, target : (N, T, J, 2) tensors, metres
    mask : (N, T) tensor, 1 at real frames

    Returns
    -------
    Mean over clips of the mean over joints and real frames, in nats.
    """
    check_shapes(flat, target, mask)
    divergence = (flat - target).square().sum(dim=-1).mean(dim=-1) / (2 * SPREAD**2)
    return clip_means(divergence, mask.to(flat.dtype)).mean()


def charbonnier_mse(motion: Tensor, target: Tensor, index: Tensor, mask: Tensor, *, epsilon: float = 1e-3) -> Tensor:
    """Distance of every frame from the recorded one, prior frames counting half, added up over time (Eq. 25).

    ``sum_t sqrt(W_tp(t) |V(t) - G(t)|^2 + epsilon^2)`` with ``W_tp = (2 - TI) / 2``; the square is that of the whole
    pose vector.

    Parameters
    ----------
    motion, target : (N, T, C) tensors
    index : (N, T) tensor, TI: 1 at prior frames, which come before the meter, else 0
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


# Terms that the paper does not have: they keep a movement natural while harmony pulls at it

RESTING = 1e-3  # metres per frame: less movement than this counts as this much
STILL = 1.0  # metres per second cubed: less jerk than this in a recording counts as this much
MOVED = 0.04  # metres from the sketch that cost 1


def jerk_loss(positions: Tensor, target: Tensor, mask: Tensor, *, fps: float) -> Tensor:
    """Excess of the jerk over that of the recorded motion: ``max(0, ratio of their root mean squares - 1)``.

    Parameters
    ----------
    positions, target : (N, T, J, 3) tensors, metres
    mask : (N, T) tensor, 1 at real frames
    fps : float, hertz

    Returns
    -------
    Mean over clips; 0 for clips of fewer than four frames.
    """
    check_shapes(positions, target, mask)
    real = mask.to(positions.dtype)
    real = real[:, 3:] * real[:, 2:-1] * real[:, 1:-2] * real[:, :-3]
    ours, theirs = (_root_mean_square_jerk(each, real, fps) for each in (positions, target))
    return relu(ours / theirs.clamp(min=STILL) - 1).mean()


def energy_loss(positions: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Difference in speed from the recorded dance: ``|log ratio of their root mean square speeds|``.

    A calm dance has a smaller error, so pose losses alone teach to move less than any dancer does.

    Parameters
    ----------
    positions, target : (N, T, J, 3) tensors, metres
    mask : (N, T) tensor, 1 at real frames

    Returns
    -------
    Mean over clips; 0 for equal speeds.
    """
    check_shapes(positions, target, mask)
    real = (mask[:, 1:] * mask[:, :-1]).to(positions.dtype)
    squares = [each.diff(dim=1).square().sum(dim=-1).mean(dim=-1) for each in (positions, target)]
    ours, theirs = (clip_means(square, real) for square in squares)
    return (0.5 * torch.log((ours + RESTING**2) / (theirs + RESTING**2))).abs().mean()


def _root_mean_square_jerk(positions: Tensor, real: Tensor, fps: float) -> Tensor:
    """(N,) root mean square over joints and real frames of the length of the third derivative."""
    square = (positions.diff(n=3, dim=1) * fps**3).square().sum(dim=-1).mean(dim=-1)
    return torch.sqrt(clip_means(square, real) + 1e-12)


def foot_loss(positions: Tensor, target: Tensor, mask: Tensor, *, feet: Sequence[int], fps: float) -> Tensor:
    """Excess of the speed at which feet slide over that of the sketch's, while the sketch's foot is on the floor.

    A foot is on the floor from one frame to the next when it is within `FLOOR` of its lowest place in the clip in
    both.

    Parameters
    ----------
    positions, target : (N, T, J, 3) tensors, metres, y up
    mask : (N, T) tensor, 1 at real frames
    feet : indices of the joints of the feet
    fps : float, hertz

    Returns
    -------
    Mean over clips of the mean excess of speed over all such steps, metres per second; 0 where no foot is on the floor.
    """
    check_shapes(positions, target, mask)
    if not feet:
        raise ValueError("foot_loss needs the indices of the feet, got none")
    joints = torch.as_tensor(list(feet), device=positions.device)
    ours, theirs = positions.index_select(2, joints), target.index_select(2, joints)
    return clip_means(relu(_sliding(ours, fps) - _sliding(theirs, fps)), _contact(theirs, mask)).mean()


@torch.no_grad()
def _contact(feet: Tensor, mask: Tensor) -> Tensor:
    """(N, T - 1, F), 1 where a foot is on the floor in two frames in a row."""
    real, altitude = mask.bool()[..., None], feet[..., 1]
    lowest = altitude.masked_fill(~real, float("inf")).amin(dim=1, keepdim=True)
    low = (altitude <= lowest + FLOOR) & real
    return (low[:, 1:] & low[:, :-1]).to(feet.dtype)


def _sliding(feet: Tensor, fps: float) -> Tensor:
    """(N, T - 1, F) horizontal speed of each foot."""
    return torch.linalg.vector_norm(feet.diff(dim=1)[..., (0, 2)], dim=-1) * fps


def moved_loss(joints: Tensor, sketch: Tensor, mask: Tensor) -> Tensor:
    """Squared way of the joints (N, T, J, 3) from those of a sketch, in 4 cm; mean over joints, frames and clips."""
    check_shapes(joints, sketch, mask)
    way = (joints - sketch).square().sum(dim=-1).mean(dim=-1) / MOVED**2
    return clip_means(way, mask.to(way.dtype)).mean()


def spread_and_turning(code: Tensor, counted: Tensor) -> tuple[Tensor, Tensor]:
    """Two means of motion codes (N, T, C) over frames that count.

    The distance of the joints from their mean place in the clip, metres; and the size of the clips' mean yaw rate, in
    which there and back cancel.
    """
    joints = local_joints(code)
    places = _clip_places(joints, counted)[:, None]
    spread = _mean(torch.linalg.vector_norm(joints - places, dim=-1), counted).mean()
    return spread, _clip_places(code[..., -1], counted).abs().mean()


def _clip_places(values: Tensor, counted: Tensor) -> Tensor:
    """(N, ...) means over the frames of each clip that count, of (N, T, ...) values."""
    weights = counted.to(values.dtype) / counted.sum(dim=1, keepdim=True).clamp(min=1)
    return torch.einsum("nt,nt...->n...", weights, values)


def _mean(values: Tensor, counted: Tensor) -> Tensor:
    """(...) mean of (N, T, ...) values over all frames that count."""
    return torch.einsum("nt,nt...->...", counted.to(values.dtype), values) / counted.sum().clamp(min=1)


# Terms of one batch by name: of pretraining, discriminators and generator (Eq. 24-32)

TINY = 1e-3  # metres, and radians per second: next to no spread and no turning
SHAPE = 2.0  # weight of the place test in the harmony loss, where valleys have 1
Patterns = Sequence[BarPattern]
NOISE = 0.1  # standard deviations, through which discriminators see movement where both are clean


def score_batch(generator: Generator, joints: Tensor, batch: Tensors, tau: float, params: HarmonyParams) -> SoftHarmony:
    """Relaxed harmony of joints (N, T, J, 3) with the batch's music, over each clip's own meter."""
    prior, length = (batch.index * batch.mask).sum(dim=1), batch.mask.sum(dim=1)
    meter, music = torch.stack([prior, length], dim=1) / generator.fps, (batch.beats, batch.strengths, batch.beat_mask)
    return soft_harmony(joints, *music, batch.mask, fps=generator.fps, tau=tau, params=params, span=meter)


def sketch_harmony(
    generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, tau: float, patterns: Patterns
) -> Tensor:
    """Loss of harmony in the body, over whole units: by the bar pattern of those that have one, else by valleys.

    Of a pattern it is `SHAPE` times the soft place test's; of valleys, `above_chance_loss`. A mean over the clips.
    """
    joints, parts = body_joints(generator, motion), []
    for number in batch.bars[:, 0].unique().tolist():
        rows = (batch.bars[:, 0] == number).nonzero().flatten()
        own = Tensors(**{name: values[rows] for name, values in vars(batch).items()})
        music = own.beats, own.strengths, own.beat_mask
        score = partial(soft_harmony, joints[rows], *music, own.mask, fps=generator.fps, tau=tau, bar_places=None)
        if number < 0:
            loss = above_chance_loss(score(params=HarmonyParams.valleys()), count_weight=params.count_weight)
        else:
            settings, places = HarmonyParams.recommended(patterns[int(number)]), own.bars[:, 1].long()
            placed = places if bool((places >= 0).all()) else None
            loss = -SHAPE * score(params=settings, bar_places=placed).above_chance.mean()
        parts.append(loss * (len(rows) / len(joints)))
    return torch.stack(parts).sum()


def body_joints(generator: Generator, motion: Tensor) -> Tensor:
    """Joints from the root in the dancer's heading, (N, T, J, 3) metres, of coded motion: no travel, turns or jumps."""
    joints, parents = local_joints(motion), generator.skeleton.parents
    root = parents.index(-1) if -1 in parents else 0
    return joints - joints[:, :, root : root + 1]


def pose_terms(generator: Generator, output: GeneratorOutput, batch: Tensors, params: TrainParams) -> Terms:
    """L_kl over the 2-D poses and L_mse over the standardised motion (Eq. 24-25)."""
    flat = local_joints(batch.motion)[..., :2]  # recorded 2-D poses V_2d: x and y as seen from the front
    error = motion_error(generator, output.motion, batch, params.epsilon)
    return {"kl": kl_loss(output.flat, flat, batch.mask), "mse": error}


def motion_error(generator: Generator, motion: Tensor, batch: Tensors, epsilon: float) -> Tensor:
    """L_mse (Eq. 25) of coded motion (N, T, C), every channel in standard deviations of the training split."""
    scale = generator.motion_scale
    return charbonnier_mse(scale(motion), scale(batch.motion), batch.index, batch.mask, epsilon=epsilon)


def discriminator_terms(networks: Networks, output: GeneratorOutput, shard: Shard, params: TrainParams) -> Terms:
    """The losses (Eq. 29-30) of the discriminators that have a weight, on recorded and on generated coded motion.

    Of generators that correct sketches both see through noise: else the tremor of recorded joints gives them away at
    once. There the cross-domain one is shown wrong pairs as well, recorded motion with the music half a beat late and
    with that of another unit; without them it is deaf.
    """
    batch, sketched = shard.own, params.sketches > 0
    recorded, danced = batch.motion, output.motion.detach()
    if sketched:
        recorded = noisy(networks.generator, recorded, shard.seed)
        danced = noisy(networks.generator, danced, shard.seed + 1)
    real, fake = (networks.spatial_temporal(each, batch.mask) for each in (recorded, danced))
    terms = {"critic_st": discriminator_loss(real, fake)}
    if params.cross_domain_weight:
        real, fake = (networks.cross_domain(batch.audio, each, batch.mask) for each in (recorded, danced))
        terms["critic_cd"] = discriminator_loss(real, fake)
        if sketched:
            others, both = shard.others.audio[: len(recorded)], batch.mask * shard.others.mask[: len(recorded)]
            wrong = [networks.cross_domain(half_a_beat_late(batch), recorded, batch.mask)]
            wrong.append(networks.cross_domain(others, recorded[: len(others)], both))
            terms["critic_cd"] = terms["critic_cd"] + softplus(torch.cat(wrong)).mean()
    return terms


def noisy(generator: Generator, motion: Tensor, seed: int) -> Tensor:
    """Motion codes through noise of a tenth of a standard deviation of each channel, drawn by a seed."""
    with drawn_by(seed, motion.device):
        return motion + NOISE * generator.motion_scale.std * torch.randn_like(motion)


def half_a_beat_late(batch: Tensors) -> Tensor:
    """The music (N, T, F) of a batch half a beat later; what passes the end of a clip comes in at its start."""
    lengths, beats = batch.mask.sum(dim=1, keepdim=True), batch.beat_mask.sum(dim=1, keepdim=True).clamp(min=1)
    frames = torch.arange(batch.mask.shape[1], device=batch.mask.device)
    late = ((frames - (lengths / beats / 2).round()) % lengths).long()
    return batch.audio.gather(1, late[..., None].expand_as(batch.audio))


def generator_terms(
    networks: Networks, output: GeneratorOutput, shard: Shard, params: TrainParams, tau: float,
    patterns: Patterns = (),
) -> Terms:  # fmt: skip
    """Terms of the generator's hybrid loss (Eq. 32) whose weight is not zero, before weighting."""
    batch, motion = shard.own, output.motion
    if params.sketches:
        terms = sketch_terms(networks.generator, motion, batch, params, tau, patterns)
        motion = noisy(networks.generator, motion, shard.seed + 1)
    else:
        terms = paper_terms(networks, output, batch, params, tau)
    if params.gan_weight:
        weight = params.cross_domain_weight
        together = networks.cross_domain(batch.audio, motion, batch.mask) if weight else None
        movement = networks.spatial_temporal(motion, batch.mask)
        terms["gan"] = generator_gan_loss(together, movement, cross_domain_weight=weight)
    return terms


def paper_terms(networks: Networks, output: GeneratorOutput, batch: Tensors, params: TrainParams, tau: float) -> Terms:
    """L_kl, L_mse, L_feat and L_harmo, of joints in the room (Eq. 24-27)."""
    generator, motion = networks.generator, output.motion
    terms = pose_terms(generator, output, batch, params)
    if params.feature_weight:
        maps = [networks.pose_net.features(each, batch.mask) for each in (batch.motion, motion)]
        terms["feature"] = feature_loss(*maps, epsilon=params.epsilon)
    if params.harmony_weight:
        score = score_batch(generator, generator.positions(motion), batch, tau, HarmonyParams.paper())
        terms["harmony"] = harmony_loss(score, count_weight=params.count_weight)
    return terms


def sketch_terms(
    generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, tau: float, patterns: Patterns
) -> Terms:
    """Harmony in the body, and what keeps a corrected movement near its sketch and as natural; all whose weight counts.

    A skeleton whose feet have no names has no "foot".
    """
    fps, sketch, mask = generator.fps, batch.initial, batch.mask
    terms: Terms = {}
    if params.harmony_weight:
        terms["harmony"] = sketch_harmony(generator, motion, batch, params, tau, patterns)
    bodies = (body_joints(generator, motion), body_joints(generator, sketch))
    places = (generator.positions(motion), generator.positions(sketch))
    if params.moved_weight:
        terms["moved"] = moved_loss(local_joints(motion), local_joints(sketch), mask)
    if params.energy_weight:
        terms["energy"] = energy_loss(*bodies, mask)
    if params.smoothness_weight:
        terms["smoothness"] = jerk_loss(*places, mask, fps=fps)
    if params.foot_weight and (feet := _feet(generator.skeleton)):
        terms["foot"] = foot_loss(*places, mask, feet=feet, fps=fps)
    return terms


def likeness_ratios(motion: Tensor, batch: Tensors) -> dict[str, float]:
    """Spread and turning of generated over recorded units: as much of a guard of likeness as short clips can show.

    Returns
    -------
    dict of spread, the mean distance of the joints from their mean place in the clip, and turning, the mean size of the
    clips' mean yaw rate; 1 is as recorded
    """
    own_meter = batch.mask * (1 - batch.index)  # frames before it (TI = 1) are thrown away in a dance
    ours, theirs = (spread_and_turning(each, own_meter) for each in (motion, batch.motion))
    names = ("spread", "turning")
    return {name: float((a + TINY) / (b + TINY)) for name, a, b in zip(names, ours, theirs, strict=True)}


@cache
def _feet(skeleton: Skeleton) -> tuple[int, ...]:
    """All joints of feet; none without joint names of feet."""
    try:
        return tuple(joint for foot in foot_joints(skeleton) for joint in foot)
    except ValueError:
        return ()
