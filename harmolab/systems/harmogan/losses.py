"""Loss terms of the generator and its discriminators (paper Sec. 4.3, Eq. 24-32), one function each.

Every function returns one number, a mean over the clips of the batch. Padded frames never count. Terms that the paper
does not have: `harmolab.systems.harmogan.losses`.

Loss terms that the paper does not have: they keep movement like recorded movement while harmony pulls at it.

Jerk, energy and sliding feet are means over the clips of the batch. Path and spread compare the whole batch with the
recorded one: what a dance looks like is not in any clip alone. Every function returns one number; what is not counted
never matters.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import relu, softplus

from harmolab.body.skeletons import Skeleton, foot_joints, named_joints
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.soft_score import SoftHarmony, soft_harmony
from harmolab.systems.harmogan.networks import Generator, GeneratorOutput, Networks
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.training.layers import PATH_CHANNELS, local_joints
from harmolab.systems.training.loop import Tensors

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


# Loss terms that the paper does not have: they keep movement like recorded movement while harmony pulls at it.

RESTING = 1e-3  # metres per frame: less movement than this counts as this much
STILL = 1.0  # metres per second cubed: less jerk than this in a recording counts as this much
STANDING = 0.05  # metres per second and radians per second: a path slower than this counts as this fast
PLACE = 0.01  # metres, and metres per second: less spread or speed of a joint than this counts as this much
STRIDE = 0.1  # metres of difference between the ankles that cost 1
CROSSING_COST = 10.0  # times the mean by which ankles cross


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
    ours, theirs = (
        clip_means(each.diff(dim=1).square().sum(dim=-1).mean(dim=-1), real) for each in (positions, target)
    )
    return (0.5 * torch.log((ours + RESTING**2) / (theirs + RESTING**2))).abs().mean()


def _root_mean_square_jerk(positions: Tensor, real: Tensor, fps: float) -> Tensor:
    """(N,) root mean square over joints and real frames of the length of the third derivative."""
    square = (positions.diff(n=3, dim=1) * fps**3).square().sum(dim=-1).mean(dim=-1)
    return torch.sqrt(clip_means(square, real) + 1e-12)


def foot_loss(
    positions: Tensor, target: Tensor, mask: Tensor, *, feet: Sequence[int], fps: float, same_dance: bool = True
) -> Tensor:
    """Excess of the speed at which feet slide over that of the recorded ones.

    A foot is on the floor from one frame to the next when it is within `FLOOR` of its lowest place in the clip in
    both.

    Parameters
    ----------
    positions, target : (N, T, J, 3) tensors, metres, y up
    mask : (N, T) tensor, 1 at real frames
    feet : indices of the joints of the feet
    fps : float, hertz
    same_dance : bool
        True if the motion should equal the target: then a foot has to stand where the recorded one is on the floor,
        and may slide as that one does. If False, it has to stand where it is on the floor itself, and may slide as the
        recorded ones do on average.

    Returns
    -------
    Mean over clips of the mean excess of speed over all such steps, metres per second; 0 where no foot is on the floor.
    """
    check_shapes(positions, target, mask)
    if not feet:
        raise ValueError("foot_loss needs the indices of the feet, got none")
    joints = torch.as_tensor(list(feet), device=positions.device)
    ours, theirs = positions.index_select(2, joints), target.index_select(2, joints)
    contact, allowed = _contact(theirs, mask), _sliding(theirs, fps)
    if not same_dance:
        allowed = clip_means(allowed, contact)[:, None, None]
        contact = _contact(ours, mask)
    return clip_means(relu(_sliding(ours, fps) - allowed), contact).mean()


@torch.no_grad()
def _contact(feet: Tensor, mask: Tensor) -> Tensor:
    """(N, T - 1, F), 1 where a foot is on the floor in two frames in a row."""
    real, altitude = mask.bool()[..., None], feet[..., 1]
    lowest = altitude.masked_fill(~real, float("inf")).amin(dim=1, keepdim=True)
    low = (altitude <= lowest + FLOOR) & real
    return (low[:, 1:] & low[:, :-1]).to(feet.dtype)


def _sliding(feet: Tensor, fps: float) -> Tensor:
    """(N, T - 1, F) horizontal speed of each foot."""
    step = feet.diff(dim=1)
    return torch.linalg.vector_norm(step[..., (0, 2)], dim=-1) * fps


def path_loss(path: Tensor, target: Tensor, counted: Tensor) -> Tensor:
    """More turning or travelling than the recorded batch has: ``relu(log ratio of root mean squares)``.

    Once for the rates of all frames, and once for their means over each clip, which tell who circles from who sways; so
    a loss of speed or of shape cannot be lowered by turning the whole body.

    Parameters
    ----------
    path, target : (N, T, 3) tensors
        Velocity to the side and forward (m/s) and yaw rate (rad/s), generated and recorded.
    counted : (N, T) tensor, 1 at frames that count

    Returns
    -------
    Sum over both, and over side, forward and yaw; 0 for no more than recorded.
    """
    check_shapes(path, target, counted)
    clips = [_clip_places(each, counted)[:, None] for each in (path, target)]
    levels = ((path, target, counted), (*clips, counted.amax(dim=1, keepdim=True)))
    squares = [[_mean(each.square(), weights) for each in (ours, theirs)] for ours, theirs, weights in levels]
    excess = [relu(_log_ratio(ours, theirs, STANDING**2) / 2).sum() for ours, theirs in squares]
    return excess[0] + excess[1]


def spread_loss(
    joints: Tensor, target: Tensor, counted: Tensor, *, fps: float, ankles: tuple[int, int] | None = None
) -> Tensor:
    """Difference of the variety of poses from that of the recorded batch, and of where the joints are on average.

    A generator that was told to be close to the recorded pose, and to move on the beat, takes one pose and stays there.
    This term is the sum of ``|log ratio|`` of each joint's variance in time, of its variance from clip to clip, and
    twice that of its mean speed; of the squared difference of each coordinate's mean in its recorded standard
    deviations; and of `ankle_loss`.

    Parameters
    ----------
    joints, target : (N, T, J, 3) tensors, metres, in the dancer's heading; generated and recorded
    counted : (N, T) tensor, 1 at frames that count
    fps : float, hertz
    ankles : the joints of the left and the right ankle; None leaves `ankle_loss` out

    Returns
    -------
    Sum of the parts, each a mean over joints or coordinates; 0 for the recorded batch itself.
    """
    check_shapes(joints, target, counted)
    ours, theirs = (_spreads(each, counted, fps) for each in (joints, target))
    ratios = [_log_ratio(*pair).abs().mean() for pair in zip(ours, theirs, (PLACE**2, PLACE**2, PLACE), strict=True)]
    shift = _mean(joints, counted) - _mean(target, counted)
    variance = _mean((target - _mean(target, counted)).square(), counted)
    place = (shift.square() / (variance + PLACE**2)).mean()
    stance = ankle_loss(joints, target, counted, ankles) if ankles else 0.0
    return ratios[0] + ratios[1] + 2 * ratios[2] + place + stance


def ankle_loss(joints: Tensor, target: Tensor, counted: Tensor, ankles: tuple[int, int]) -> Tensor:
    """Difference from recorded in the ankles' distance, in its variety, and in which of them is on which side.

    ``(|difference of mean distances| + |difference of mean sides| + 10 relu(difference of mean crossings)) / 0.1 m``
    and ``|log ratio|`` of the distance's standard deviation. The side is that of the left ankle as seen from the right
    one, positive to the dancer's left; ankles cross where it is negative.

    Parameters
    ----------
    joints, target : (N, T, J, 3) tensors, metres, in the dancer's heading; generated and recorded
    counted : (N, T) tensor, 1 at frames that count
    ankles : the joints of the left and the right ankle
    """
    apart = [each[..., ankles[0], :] - each[..., ankles[1], :] for each in (joints, target)]
    side = [each[..., 0] for each in apart]
    distance = [torch.linalg.vector_norm(each[..., (0, 2)], dim=-1) for each in apart]
    means = [_mean(each, counted) for each in distance]
    sides, crossings = ([_mean(part, counted) for part in each] for each in (side, [relu(-each) for each in side]))
    metres = (
        (means[0] - means[1]).abs() + (sides[0] - sides[1]).abs() + CROSSING_COST * relu(crossings[0] - crossings[1])
    )
    spreads = [_mean((each - mean).square(), counted) for each, mean in zip(distance, means, strict=True)]
    return metres / STRIDE + _log_ratio(spreads[0], spreads[1], PLACE**2).abs() / 2


def spread_and_turning(code: Tensor, counted: Tensor) -> tuple[Tensor, Tensor]:
    """Two means of motion codes (N, T, C) over frames that count.

    The distance of the joints from their mean place in the clip, metres; and the size of the clips' mean yaw rate, in
    which there and back cancel.
    """
    joints = local_joints(code)
    places = _clip_places(joints, counted)[:, None]
    spread = _mean(torch.linalg.vector_norm(joints - places, dim=-1), counted).mean()
    return spread, _clip_places(code[..., -1], counted).abs().mean()


def _spreads(joints: Tensor, counted: Tensor, fps: float) -> tuple[Tensor, Tensor, Tensor]:
    """A joint's variance in time, a mean over clips; that of its mean place from clip to clip; its speed: (J,) each."""
    places = _clip_places(joints, counted)
    in_time = _mean((joints - places[:, None]).square().sum(dim=-1), counted)
    between = (places - places.mean(dim=0)).square().sum(dim=-1).mean(dim=0)
    speed = torch.linalg.vector_norm(joints.diff(dim=1), dim=-1) * fps
    return in_time, between, _mean(speed, counted[:, 1:] * counted[:, :-1])


def _clip_places(values: Tensor, counted: Tensor) -> Tensor:
    """(N, ...) means over the frames of each clip that count, of (N, T, ...) values."""
    weights = counted.to(values.dtype) / counted.sum(dim=1, keepdim=True).clamp(min=1)
    return torch.einsum("nt,nt...->n...", weights, values)


def _mean(values: Tensor, counted: Tensor) -> Tensor:
    """(...) mean of (N, T, ...) values over all frames that count."""
    return torch.einsum("nt,nt...->...", counted.to(values.dtype), values) / counted.sum().clamp(min=1)


def _log_ratio(ours: Tensor, theirs: Tensor, least: float) -> Tensor:
    """log((ours + least) / (theirs + least)): finite, with a finite gradient, also where nothing moves."""
    return torch.log((ours + least) / (theirs + least))


# Loss terms of one batch by name: of pretraining, of the discriminators and of the generator (Eq. 24-32).

TINY = 1e-3  # metres, and radians per second: next to no spread and no turning


class Danced(NamedTuple):
    """A generator's output for a batch, and its rollout to other music from the end of an earlier dance.

    Parameters
    ----------
    own : GeneratorOutput, to the batch's own music from recorded movement
    later : the units of the rollout, and its motion code (N, T, C); None without rollout
    """

    own: GeneratorOutput
    later: tuple[Tensors, Tensor] | None = None


def danced(generator: Generator, batch: Tensors, others: Tensors | None = None, last: Danced | None = None) -> Danced:
    """The generator's dance to a batch, and a rollout: to the music of `others`, from the end of the `last` rollout.

    So batch by batch a dance grows as long as that of a song. Without `last` it begins where the batch's recorded
    movement ends. `others` has as many units as the batch, `last` may have had more.
    """
    if others is None:
        return Danced(generator(batch.audio, batch.initial))
    before, mask = batch.motion, batch.mask
    if last is not None and last.later is not None:
        before, mask = last.later[1][: len(others)].detach(), last.later[0].mask[: len(others)]
    later = others.continued_from(before, mask)
    # In one call: a recurrent layer takes its time for each frame, whether ten units take the step or twenty.
    output = generator(torch.cat([batch.audio, later.audio]), torch.cat([batch.initial, later.initial]))
    own, after = (GeneratorOutput(*pair) for pair in zip(*(part.chunk(2) for part in output), strict=True))
    return Danced(own, (later, after.motion))


def score_batch(
    generator: Generator, positions: Tensor, batch: Tensors, tau: float, params: HarmonyParams
) -> SoftHarmony:
    """Relaxed harmony of joints (N, T, J, 3) with the batch's music, over each clip's own meter."""
    prior, length = (batch.index * batch.mask).sum(dim=1), batch.mask.sum(dim=1)
    return soft_harmony(
        positions, batch.beats, batch.strengths, batch.beat_mask, batch.mask,
        fps=generator.fps, tau=tau, params=params, span=torch.stack([prior, length], dim=1) / generator.fps,
    )  # fmt: skip


def body_joints(generator: Generator, motion: Tensor) -> Tensor:
    """Joints from the root in the dancer's heading, (N, T, J, 3) metres, of coded motion: no travel, turns or jumps."""
    joints, parents = local_joints(motion), generator.skeleton.parents
    root = parents.index(-1) if -1 in parents else 0
    return joints - joints[:, :, root : root + 1]


def seen_joints(generator: Generator, motion: Tensor, params: TrainParams) -> Tensor:
    """Joints (N, T, J, 3) of coded motion where harmony and energy see them: in the room or in the body."""
    return generator.positions(motion) if params.harmony_frame == "room" else body_joints(generator, motion)


def meter_mask(batch: Tensors) -> Tensor:
    """(N, T), 1 at the frames of each clip's own meter: those before it (TI = 1) are thrown away in a dance."""
    return batch.mask * (1 - batch.index)


def pose_terms(generator: Generator, output: GeneratorOutput, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """L_kl over the 2-D poses and L_mse over the standardised motion (Eq. 24-25)."""
    flat = local_joints(batch.motion)[..., :2]  # recorded 2-D poses V_2d: x and y as seen from the front
    error = motion_error(generator, output.motion, batch, params.epsilon)
    return {"kl": kl_loss(output.flat, flat, batch.mask), "mse": error}


def motion_error(generator: Generator, motion: Tensor, batch: Tensors, epsilon: float) -> Tensor:
    """L_mse (Eq. 25) of coded motion (N, T, C), every channel in standard deviations of the training split."""
    scale = generator.motion_scale
    return charbonnier_mse(scale(motion), scale(batch.motion), batch.index, batch.mask, epsilon=epsilon)


def discriminator_terms(networks: Networks, dances: Danced, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """The losses (Eq. 29-30) of the discriminators that have a weight, on recorded and on generated coded motion.

    The spatial-temporal one judges movement alone, so half of its loss is of the rollout, if there is one.
    """
    motion = dances.own.motion.detach()
    recorded = networks.spatial_temporal(batch.motion, batch.mask)
    terms = {"critic_st": discriminator_loss(recorded, networks.spatial_temporal(motion, batch.mask))}
    if params.cross_domain_weight:
        real = networks.cross_domain(batch.audio, batch.motion, batch.mask)
        terms["critic_cd"] = discriminator_loss(real, networks.cross_domain(batch.audio, motion, batch.mask))
    if dances.later is not None:
        later, after = dances.later
        more = discriminator_loss(recorded, networks.spatial_temporal(after.detach(), later.mask))
        terms["critic_st"] = (terms["critic_st"] + more) / 2
    return terms


def generator_terms(
    networks: Networks, dances: Danced, batch: Tensors, params: TrainParams, tau: float
) -> dict[str, Tensor]:
    """Terms of the generator's hybrid loss (Eq. 32) whose weight is not zero, before weighting.

    With a rollout, half of each term that needs no recorded answer is of the rollout.
    """
    generator, motion = networks.generator, dances.own.motion
    terms = pose_terms(generator, dances.own, batch, params)
    if params.feature_weight:
        maps = [networks.pose_net.features(each, batch.mask) for each in (batch.motion, motion)]
        terms["feature"] = feature_loss(*maps, epsilon=params.epsilon)
    free = _free_terms(networks, motion, batch, params, tau)
    if dances.later is not None:
        later, after = dances.later
        more = _free_terms(networks, after, later, params, tau, same_dance=False)
        free = {name: (value + more[name]) / 2 for name, value in free.items()}
    return terms | free


def _free_terms(
    networks: Networks, motion: Tensor, batch: Tensors, params: TrainParams, tau: float, *, same_dance: bool = True
) -> dict[str, Tensor]:
    """L_gan, L_harmo and natural terms of coded motion (N, T, C), which may be another dance than the recorded."""
    terms: dict[str, Tensor] = {}
    if params.gan_weight:
        weight = params.cross_domain_weight
        together = networks.cross_domain(batch.audio, motion, batch.mask) if weight else None
        movement = networks.spatial_temporal(motion, batch.mask)
        terms["gan"] = generator_gan_loss(together, movement, cross_domain_weight=weight)
    if params.harmony_weight:
        paper = params.harmony == "paper"  # else the chance-corrected score
        settings = HarmonyParams.paper() if paper else HarmonyParams.valleys()
        joints = seen_joints(networks.generator, motion, params)
        score = score_batch(networks.generator, joints, batch, tau, settings)
        terms["harmony"] = (harmony_loss if paper else above_chance_loss)(score, count_weight=params.count_weight)
    return terms | _natural_terms(networks.generator, motion, batch, params, same_dance=same_dance)


def _natural_terms(
    generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, *, same_dance: bool
) -> dict[str, Tensor]:
    """Terms that keep movement natural while harmony pulls at it; none in paper mode, no "foot" for nameless feet."""
    terms, fps = _variety_terms(generator, motion, batch, params), generator.fps
    feet = _feet(generator.skeleton) if params.foot_weight else ()
    if not params.smoothness_weight and not feet:
        return terms
    ours, theirs = (generator.positions(each) for each in (motion, batch.motion))
    if params.smoothness_weight:
        terms["smoothness"] = jerk_loss(ours, theirs, batch.mask, fps=fps)
    if feet:
        terms["foot"] = foot_loss(ours, theirs, batch.mask, feet=feet, fps=fps, same_dance=same_dance)
    return terms


def _variety_terms(generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """Energy, path and spread against the recorded units of the batch."""
    terms: dict[str, Tensor] = {}
    target, counted = batch.motion, meter_mask(batch)
    if params.energy_weight:
        ours, theirs = (seen_joints(generator, each, params) for each in (motion, target))
        terms["energy"] = energy_loss(ours, theirs, batch.mask if params.harmony_frame == "room" else counted)
    if params.path_weight:
        terms["path"] = path_loss(motion[..., -PATH_CHANNELS:], target[..., -PATH_CHANNELS:], counted)
    if params.spread_weight:
        ours, theirs, ankles = local_joints(motion), local_joints(target), _ankles(generator.skeleton)
        terms["spread"] = spread_loss(ours, theirs, counted, fps=generator.fps, ankles=ankles)
    return terms


@cache
def _ankles(skeleton: Skeleton) -> tuple[int, int] | None:
    """The left and the right ankle; None without joints of that name."""
    joints = named_joints(skeleton)
    left, right = (joints.get((side, "ankle")) for side in ("left", "right"))
    return None if left is None or right is None else (left, right)


def likeness_ratios(motion: Tensor, batch: Tensors) -> dict[str, float]:
    """Spread and turning of generated over recorded units: as much of a guard of likeness as short clips can show.

    Returns
    -------
    dict of spread, the mean distance of the joints from their mean place in the clip, and turning, the mean size of the
    clips' mean yaw rate; 1 is as recorded
    """
    ours, theirs = (spread_and_turning(each, meter_mask(batch)) for each in (motion, batch.motion))
    names = ("spread", "turning")
    return {name: float((a + TINY) / (b + TINY)) for name, a, b in zip(names, ours, theirs, strict=True)}


@cache
def _feet(skeleton: Skeleton) -> tuple[int, ...]:
    """All joints of feet; none without joint names of feet."""
    try:
        return tuple(joint for foot in foot_joints(skeleton) for joint in foot)
    except ValueError:
        return ()
