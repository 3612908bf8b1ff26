"""Two movements of one picture over each other: the tracked points broad and red, the predicted ones narrow and green.

The colours are those of a miss and a hit, which differ in brightness too; the widths tell them apart without colour.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harmolab.io.player_points import limb_widths
from harmolab.kinematics import resample_motion, upsample_motion
from harmolab.lab.render.stick import Frame, Stroke, check_positive, draw_strokes, fixed, in_picture
from harmolab.skeletons import skull_and_limbs
from harmolab.types import FloatArray, Motion, Skeleton

PAPER, TRUTH, PREDICTION = (250, 250, 250), (178, 24, 43), (0, 158, 115)
BROAD, NARROW = 1 / 60, 1 / 110  # of a limb, in picture heights


def render_points(
    truth: Motion, prediction: Motion, *, height: int = 480, width: int | None = None, fps: float = 30.0
) -> Iterator[Frame]:
    """Frames of the predicted points over the true ones, as long as both last.

    Parameters
    ----------
    truth, prediction : Motion, (T, P, 2), image coordinates of one picture, which is shown as far as the points go
    height, width : int, pixels
        `width` defaults to 4/3 of the height.
    fps : float, hertz
        Rate of the pictures; slower motions are interpolated by cubic splines.

    Yields
    ------
    (H, W, 3) uint8 RGB arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        For a motion in space, a picture under 64 pixels, or an fps that is not positive.
    """
    width = round(height * 4 / 3) if width is None else width
    if truth.positions.shape[2] != 2 or prediction.positions.shape[2] != 2:
        raise ValueError("points over each other are image coordinates; one of these motions is in space")
    if min(height, width) < 64:
        raise ValueError(f"a picture needs at least 64 x 64 pixels, got {width} x {height}")
    check_positive(fps=fps)
    both = [resample_motion(upsample_motion(motion, fps), fps) for motion in (truth, prediction)]
    count = min(motion.n_frames for motion in both)
    places = in_picture(np.concatenate([motion.positions[:count] for motion in both], axis=1), height, width)
    split = len(truth.skeleton.joints)
    return _frames(np.split(places[..., :2], [split], axis=1), [m.skeleton for m in both], height, width)


def _frames(places: list[FloatArray], skeletons: list[Skeleton], height: int, width: int) -> Iterator[Frame]:
    looks = ((TRUTH, BROAD), (PREDICTION, NARROW))
    bodies = [skull_and_limbs(skeleton)[1] for skeleton in skeletons]
    widths = [limb_widths(*body) for body in zip(skeletons, bodies, strict=True)]
    for index in range(len(places[0])):
        frame = np.full((height, width, 3), PAPER, np.uint8)
        for points, limbs, sizes, (colour, share) in zip(places, bodies, widths, looks, strict=True):
            ends = fixed(points[index]).tolist()
            draw_strokes(
                frame,
                (
                    Stroke(ends[start], ends[end], max(1, round(size * share * height)), colour)
                    for (start, end), size in zip(limbs, sizes, strict=True)
                ),
            )
        yield frame
