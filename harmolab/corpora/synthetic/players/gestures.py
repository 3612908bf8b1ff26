"""Movement on planted moments: glides that arrive at onsets, pulses that peak at them, and the points put together."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import BODY, FINGERS, PHALANGES, PLAYER_50, SIDES, hand_joints
from harmolab.types import FloatArray, IntArray

# Share of a fingertip's movement that the points of its finger take part in, from the root to the tip.
BENDING = np.array([0.0, 0.35, 0.7, 1.0])


def glide(times: FloatArray, onsets: FloatArray, values: FloatArray, longest: float) -> FloatArray:
    """(T, ...) values over time: each is reached at its onset, by a raised cosine, and kept until the next glide.

    Parameters
    ----------
    times : (T,) array, seconds
    onsets : (N,) array, seconds, increasing
    values : (N, ...) array
    longest : float, seconds; a glide lasts so long, or the time since the onset before if that is less
    """
    following = np.searchsorted(onsets, times)
    after, before = np.minimum(following, onsets.size - 1), np.maximum(following - 1, 0)
    lasting = np.minimum(np.diff(onsets, prepend=-np.inf), longest)
    progress = (1 - (onsets[after] - times) / lasting[after]).clip(0, 1)
    share = (0.5 - 0.5 * np.cos(np.pi * progress)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[before] + share * (values[after] - values[before]))


def pulses(
    times: FloatArray, onsets: FloatArray, channels: IntArray, heights: FloatArray, *, n_channels: int, radius: float
) -> FloatArray:
    """(T, C) sums of raised-cosine pulses, one for each onset in its channel, which peak at the onset.

    Parameters
    ----------
    times : (T,) array, seconds, equally spaced
    onsets, channels, heights : (N,) arrays
    n_channels : int, C
    radius : float, seconds from the start of a pulse to its peak, and from there to its end
    """
    step = times[1] - times[0]
    around = np.arange(-np.ceil(radius / step), np.ceil(radius / step) + 1)
    frames = (np.round(onsets[:, None] / step) + around).astype(np.int64)
    distance = np.abs(frames * step - onsets[:, None])
    shapes = np.where(distance < radius, 0.5 + 0.5 * np.cos(np.pi * distance / radius), 0.0)
    inside = (frames >= 0) & (frames < times.size)
    track = np.zeros((times.size, n_channels))
    np.add.at(
        track,
        (frames[inside], np.broadcast_to(channels[:, None], frames.shape)[inside]),
        (heights[:, None] * shapes)[inside],
    )
    return track


def bent_hand(template: FloatArray, tips: FloatArray) -> FloatArray:
    """(T, 21, 2) a hand whose fingertips are moved, with the points between them and the roots.

    Parameters
    ----------
    template : (21, 2) array, the hand at rest
    tips : (T, 5, 2) array, movement of each fingertip, thumb first
    """
    bends = (tips[:, :, None, :] * BENDING[:, None]).reshape(len(tips), len(FINGERS) * PHALANGES, 2)
    return template + np.concatenate([np.zeros((len(tips), 1, 2)), bends], axis=1)


def joined(body: dict[str, FloatArray], hands: dict[str, FloatArray]) -> FloatArray:
    """(T, 50, 2) the points of a player, in the order of `PLAYER_50`.

    Parameters
    ----------
    body : (T, 2) arrays by the names of `BODY` without the wrists, which are those of the hands
    hands : (T, 21, 2) arrays by side
    """
    points = {name: body[name] for name in BODY if not name.endswith("wrist")}
    for side in SIDES:
        points |= dict(zip(hand_joints(side), np.moveaxis(hands[side], 1, 0), strict=True))
        points[f"{side}_wrist"] = points[f"{side}_hand"]
    return np.stack([points[name] for name in PLAYER_50.joints], axis=1)


def point(x: FloatArray | float, y: FloatArray | float) -> FloatArray:
    """(..., 2) points from their coordinates."""
    return np.stack(np.broadcast_arrays(x, y), axis=-1)
