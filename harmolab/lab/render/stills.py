"""Single pictures of avatars, all by one camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import Frame
from harmolab.systems.audio2body.avatar import avatar
from harmolab.types import Motion

RATE = 30.0  # of the pictures as `render_dance` counts them; stills are rendered at it, so that none is interpolated


def avatar_stills(
    points: Mapping[str, Motion],
    instrument: str,
    times: Sequence[float],
    *,
    height: int = 480,
    width: int = 420,
) -> dict[str, list[Frame]]:
    """Name -> pictures of the avatar at some times; one camera for all, which stands as in `render_dance`.

    Parameters
    ----------
    points : name -> Motion, (T, P, 2) as in `harmolab.io.player_points`, all with the same points
    instrument : "piano" or "violin"
    times : seconds; the nearest frame of each
    height, width : int, pixels

    Raises
    ------
    ValueError
        As `avatar` and `render_dance`; also for motions with several sets of points, or times outside one of them.
    """
    if len({motion.skeleton.joints for motion in points.values()}) != 1:
        raise ValueError("stills by one camera need motions with the same points")
    avatars = [avatar(motion, instrument) for motion in points.values()]
    poses = np.concatenate([own.positions[_frames_at(own, times)] for own in avatars])
    rendered = list(render_dance(Motion(poses, RATE, avatars[0].skeleton), height=height, width=width, fps=RATE))
    return {name: rendered[row * len(times) : (row + 1) * len(times)] for row, name in enumerate(points)}


def _frames_at(motion: Motion, times: Sequence[float]) -> list[int]:
    frames = [round(time * motion.fps) for time in times]
    if not all(0 <= frame < motion.n_frames for frame in frames):
        raise ValueError(f"times must lie within the {motion.duration:.2f} s of the motion, got {list(times)}")
    return frames
