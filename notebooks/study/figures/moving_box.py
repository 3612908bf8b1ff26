"""A box that wanders about in front of a video: the disturbance of the paper's Fig. 2.

It takes and returns a stream of frames, so a video of any length needs the memory of one frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np

from harmolab.lab.render.stick import FRACTION_BITS, Frame, check_positive, fixed
from harmolab.types import FloatArray


def moving_box(
    frames: Iterable[Frame],
    fps: float,
    *,
    seed: int,
    size: float = 0.3,
    speed: float = 0.8,
    colour: tuple[int, int, int] = (40, 80, 220),
) -> Iterator[Frame]:
    """The same frames with a plain box over them that wanders at random (paper Fig. 2).

    Parameters
    ----------
    frames : iterable of (H, W) grey or (H, W, 3) RGB uint8 arrays; they are not changed
    fps : float, hertz
    seed : int
        The same seed draws the same walk, in seconds and picture heights, whatever fps and resolution are.
    size : float, side of the box in picture heights
    speed : float, picture heights per second
        Mean speed; each leg of the walk has its own, between half and one and a half of it.
    colour : RGB, 0 to 255; on grey frames its brightness is drawn

    Yields
    ------
    uint8 arrays of the shape of `frames`

    Raises
    ------
    ValueError
        If fps, size or speed is not positive.
    """
    check_positive(fps=fps, size=size, speed=speed)
    return _boxed(frames, fps, seed, size, speed, colour)


def _boxed(
    frames: Iterable[Frame], fps: float, seed: int, size: float, speed: float, colour: tuple[int, int, int]
) -> Iterator[Frame]:
    walk: Iterator[FloatArray] | None = None
    brightness = round(float(np.dot(colour, (0.299, 0.587, 0.114))))
    for frame in frames:
        height, width = frame.shape[:2]
        if walk is None:
            reach = (max(width / height - size, 0.0), max(1.0 - size, 0.0))
            walk = box_walk(np.random.default_rng(seed), reach, speed, fps)
        corner = next(walk)
        outline = (corner + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * height
        boxed = frame.copy()
        level = colour if frame.ndim == 3 else (brightness,)
        cv2.fillConvexPoly(boxed, fixed(outline), level, cv2.LINE_AA, FRACTION_BITS)
        yield boxed


def box_walk(rng: np.random.Generator, reach: tuple[float, float], speed: float, fps: float) -> Iterator[FloatArray]:
    """Endless (x, y) places of a point that walks straight to one random place after another.

    Parameters
    ----------
    rng : numpy Generator
    reach : (float, float), largest x and y; the walk stays within [0, reach]
    speed : float, mean distance per second
    fps : float, places per second
    """
    place = rng.uniform((0.0, 0.0), reach)
    remaining = 0.0  # seconds of the current leg
    velocity = np.zeros(2)
    while True:
        yield place.copy()
        step = 1.0 / fps
        while step >= remaining:
            place = place + velocity * remaining
            step -= remaining
            target, pace = rng.uniform((0.0, 0.0), reach), speed * rng.uniform(0.5, 1.5)
            remaining = max(float(np.linalg.norm(target - place)) / pace, 1e-3)
            velocity = (target - place) / remaining
        place = place + velocity * step
        remaining -= step
