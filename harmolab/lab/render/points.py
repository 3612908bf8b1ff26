"""Two movements of one picture over each other: the tracked points broad and red, the predicted ones narrow and green.

The colours are those of a miss and a hit, which differ in brightness too; the widths tell them apart without colour.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import cv2
import numpy as np

from harmolab.kinematics import resample_motion, upsample_motion
from harmolab.lab.person.camera import Stage, shared_wall, stage_of
from harmolab.lab.person.plan import OUTLINES, Part
from harmolab.lab.person.shapes import person_shapes
from harmolab.lab.render.stick import FRACTION_BITS, Frame, check_positive, fixed
from harmolab.types import Motion

PAPER, TRUTH, PREDICTION = (250, 250, 250), (178, 24, 43), (0, 158, 115)
LOOKS = ((TRUTH, 0.9), (PREDICTION, 0.4))  # colour, and thickness of limbs in that of a person's
LINE = 1 / 110  # thickness of the outline of trunk and head, in picture heights


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
    wall = shared_wall(both)
    return _frames([stage_of(motion, wall=wall) for motion in both], count, height, width)


def _frames(stages: list[Stage], count: int, height: int, width: int) -> Iterator[Frame]:
    people = []
    for stage, (_, broad) in zip(stages, LOOKS, strict=True):
        frames, plan = slice(0, count), replace(stage.plan, parts=tuple(_scaled(stage.plan.parts, broad)))
        people.append(person_shapes(plan, stage.camera(height, width), stage.positions[frames], frames))
    for pair in zip(*people, strict=True):
        frame = np.full((height, width, 3), PAPER, np.uint8)
        for stage, shapes, (colour, broad) in zip(stages, pair, LOOKS, strict=True):
            for shape in shapes:
                outline = [fixed(shape.outline)]
                if stage.plan.parts[shape.part].paint in OUTLINES:
                    thick = max(1, round(broad * LINE * height))
                    cv2.polylines(frame, outline, True, colour, thick, cv2.LINE_AA, FRACTION_BITS)
                else:
                    cv2.fillPoly(frame, outline, colour, cv2.LINE_AA, FRACTION_BITS)
        yield frame


def _scaled(parts: Iterable[Part], broad: float) -> Iterator[Part]:
    """The parts, the limbs among them thicker or thinner."""
    for part in parts:
        size = 1.0 if part.paint in OUTLINES else broad
        yield part._replace(radii=tuple(size * radius for radius in part.radii))
