"""Loss terms that the paper does not have: they keep movement like recorded movement while harmony pulls at it.

Jerk, energy and sliding feet are means over the clips of the batch. Path and spread compare the whole batch with the
recorded one: what a dance looks like is not in any clip alone. Every function returns one number; what is not counted
never matters.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import relu

from harmolab.systems.harmogan.terms import check_shapes, clip_means

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
    positions: Tensor,
    target: Tensor,
    mask: Tensor,
    *,
    feet: Sequence[int],
    fps: float,
    height: float = 0.03,
    same_dance: bool = True,
) -> Tensor:
    """Excess of the speed at which feet slide over that of the recorded ones.

    A foot is on the floor from one frame to the next when it is within `height` of its lowest place in the clip in
    both.

    Parameters
    ----------
    positions, target : (N, T, J, 3) tensors, metres, y up
    mask : (N, T) tensor, 1 at real frames
    feet : indices of the joints of the feet
    fps : float, hertz
    height : float, metres
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
    contact, allowed = _contact(theirs, mask, height), _sliding(theirs, fps)
    if not same_dance:
        allowed = clip_means(allowed, contact)[:, None, None]
        contact = _contact(ours, mask, height)
    return clip_means(relu(_sliding(ours, fps) - allowed), contact).mean()


@torch.no_grad()
def _contact(feet: Tensor, mask: Tensor, height: float) -> Tensor:
    """(N, T - 1, F), 1 where a foot is on the floor in two frames in a row."""
    real, altitude = mask.bool()[..., None], feet[..., 1]
    lowest = altitude.masked_fill(~real, float("inf")).amin(dim=1, keepdim=True)
    low = (altitude <= lowest + height) & real
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
    excess = [
        relu(_log_ratio(_mean_square(ours), _mean_square(theirs), STANDING**2) / 2).sum()
        for ours, theirs in zip(_frames_and_clips(path, counted), _frames_and_clips(target, counted), strict=True)
    ]
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


def mean_spread(joints: Tensor, counted: Tensor) -> Tensor:
    """Mean distance of joints (N, T, J, 3) from their mean place in the clip, metres, over frames that count."""
    places = _clip_places(joints, counted)[:, None]
    return _mean(torch.linalg.vector_norm(joints - places, dim=-1), counted).mean()


def net_turning(yaw: Tensor, counted: Tensor) -> Tensor:
    """Mean size of the mean yaw rate (N, T) of a clip over frames that count; there and back cancel."""
    return _clip_places(yaw, counted).abs().mean()


def _spreads(joints: Tensor, counted: Tensor, fps: float) -> tuple[Tensor, Tensor, Tensor]:
    """A joint's variance in time, a mean over clips; that of its mean place from clip to clip; its speed: (J,) each."""
    places = _clip_places(joints, counted)
    in_time = _mean((joints - places[:, None]).square().sum(dim=-1), counted)
    between = (places - places.mean(dim=0)).square().sum(dim=-1).mean(dim=0)
    speed = torch.linalg.vector_norm(joints.diff(dim=1), dim=-1) * fps
    return in_time, between, _mean(speed, counted[:, 1:] * counted[:, :-1])


def _frames_and_clips(path: Tensor, counted: Tensor) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """The path of every frame, and its mean in every clip, as (values, what counts) each."""
    means = _clip_places(path, counted)[:, None]
    return (path, counted), (means, counted.amax(dim=1, keepdim=True))


def _clip_places(values: Tensor, counted: Tensor) -> Tensor:
    """(N, ...) means over the frames of each clip that count, of (N, T, ...) values."""
    weights = counted.to(values.dtype) / counted.sum(dim=1, keepdim=True).clamp(min=1)
    return torch.einsum("nt,nt...->n...", weights, values)


def _mean_square(values: tuple[Tensor, Tensor]) -> Tensor:
    return _mean(values[0].square(), values[1])


def _mean(values: Tensor, counted: Tensor) -> Tensor:
    """(...) mean of (N, T, ...) values over all frames that count."""
    return torch.einsum("nt,nt...->...", counted.to(values.dtype), values) / counted.sum().clamp(min=1)


def _log_ratio(ours: Tensor, theirs: Tensor, least: float) -> Tensor:
    """log((ours + least) / (theirs + least)): finite, with a finite gradient, also where nothing moves."""
    return torch.log((ours + least) / (theirs + least))
