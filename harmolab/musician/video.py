"""A performance from sound as a video: avatar or points, or predicted points over the true ones, with marks.

The marks are those of notes and strikes; a line of text says on whom the network was trained. Needs OpenCV, numpy and
PyAV.

Where two movements of one picture lie over each other, the tracked points are broad and red, the predicted ones narrow
and green. The colours are those of a miss and a hit, which differ in brightness too; the widths tell them apart without
colour.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.files import Counted, PathLike, Progress, silent
from harmolab.lab.person import OUTLINES, Part, Stage, person_shapes, shared_wall, stage_of
from harmolab.lab.player_data import PLAYING
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import FRACTION_BITS, INK, BeatMarks, Frame, check_positive, fixed, picture_width
from harmolab.lab.render.video import RATE as DANCE_RATE
from harmolab.musician.avatar import avatar
from harmolab.musician.page import Performed
from harmolab.readers.video import write_video
from harmolab.types import Motion

# Predicted points over the tracked ones

PAPER, TRUTH, PREDICTION = (250, 250, 250), (178, 24, 43), (0, 158, 115)
LOOKS = ((TRUTH, 0.9), (PREDICTION, 0.4))  # colour, and thickness of limbs in that of a person's
LINE = 1 / 110  # thickness of the outline of trunk and head, in picture heights


def render_points(
    truth: Motion, prediction: Motion, *, height: int = 480, width: int | None = None, fps: float = 30.0
) -> Iterator[Frame]:
    """Frames for `harmolab.write_video` with predicted points over the true ones, as long as both last.

    True points are broad and red, predicted ones narrow and green.

    Parameters
    ----------
    truth, prediction : Motion, (T, P, 2)
        Points in the coordinates of one picture, which is shown as far as they reach.
    height, width : int, pixels
        `width` is 4/3 of the height when left out.
    fps : float, frames per second
        Of the pictures; slower motions are interpolated by cubic splines.

    Yields
    ------
    (H, W, 3) uint8 RGB arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        For a motion in space, a picture under 64 pixels, or an fps that is not positive.
    """
    if truth.positions.shape[2] != 2 or prediction.positions.shape[2] != 2:
        raise ValueError("points over each other are image coordinates; one of these motions is in space")
    width = picture_width(height, width, least=64)
    check_positive(fps=fps)
    both = [resample_motion(upsample_motion(motion, fps), fps) for motion in (truth, prediction)]
    count = min(motion.n_frames for motion in both)
    wall = shared_wall(both)
    return _frames([stage_of(motion, wall=wall) for motion in both], count, height, width)


def _frames(stages: list[Stage], count: int, height: int, width: int) -> Iterator[Frame]:
    people, frames = [], slice(0, count)
    for stage, (_, broad) in zip(stages, LOOKS, strict=True):
        plan = replace(stage.plan, parts=tuple(_scaled(part, broad) for part in stage.plan.parts))
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


def _scaled(part: Part, broad: float) -> Part:
    """A part, thicker or thinner where it is a limb."""
    size = 1.0 if part.paint in OUTLINES else broad
    return part._replace(radii=tuple(size * radius for radius in part.radii))


# The video of a performance

FONT = cv2.FONT_HERSHEY_SIMPLEX
WIDTH_SHARE = 0.94  # of a line of text in the picture's width
STRIP = 0.06  # of the strip below the picture in its height
MARKS_SHARE = 0.2  # of the picture's height that is left free for the marks above points, which fill the rest
STRIP_COLOUR = (246, 246, 246)
BESIDE, OVER = "Left: from the sound. Right: the truth.", "Green: from the sound. Red: the truth."


def write_performance(
    path: PathLike, performed: Performed, *, title: str = "", height: int = 480, progress: Progress = silent
) -> None:
    """Write a performance with its part of the sound as a video; the sentence on its training stands in every picture.

    Parameters
    ----------
    path : str or path that ends in .mp4 or .webm
    performed : Performed; points with a truth are drawn over it, an avatar beside it
    title : str, that players show, before the sentence on its training
    height : int, pixels
    progress : Progress over drawing

    Raises
    ------
    ValueError
        As `harmolab.readers.video.write_video`.
    """
    words = PLAYING[performed.instrument]
    marks = BeatMarks(height, performed.score.score, {"music": words.sound, "dancer": words.mover, "hit": "hit"})
    sides = BESIDE if performed.is_avatar else OVER
    texts = [performed.notice] if performed.compared is None else [sides, performed.notice]
    frames = _finished(_pictures(performed, height), marks, texts)
    heading = ". ".join(filter(None, [title, performed.notice]))
    pictures = progress(Counted(frames, round(performed.figure.duration * DANCE_RATE)), "drawing")
    write_video(path, pictures, DANCE_RATE, audio=performed.audio, title=heading)


def _pictures(performed: Performed, height: int) -> Iterator[Frame]:
    """The avatar on a floor, that of the truth to its right; the points alone, or over the true ones."""
    beside, room, width = performed.compared, round(MARKS_SHARE * height), round(height * 4 / 3)
    if performed.is_avatar:
        figures = [performed.figure]
        if beside is not None:
            figures, width = [performed.figure, avatar(beside.truth, performed.instrument)], height
        films = [render_dance(figure, fps=DANCE_RATE, height=height, width=width) for figure in figures]
        return map(np.hstack, zip(*films, strict=False))
    draw = partial(render_dance, performed.points)
    if beside is not None:
        draw = partial(render_points, beside.truth, beside.prediction)
    frames = draw(fps=DANCE_RATE, height=height - room, width=width)
    return (np.pad(frame, ((room, 0), (0, 0), (0, 0)), mode="edge") for frame in frames)


def _finished(frames: Iterable[Frame], marks: BeatMarks, texts: Iterable[str]) -> Iterator[Frame]:
    """The pictures with marks of notes, movement and hits in the corner, and lines of text in strips below them."""
    strips: list[Frame] = []
    for number, frame in enumerate(frames):
        marks.draw(frame, number, DANCE_RATE)
        strips = strips or [_strip(text, *frame.shape[:2]) for text in texts]
        yield np.concatenate([frame, *strips])


def _strip(text: str, height: int, width: int) -> Frame:
    """A line of text as large as fits."""
    strip = np.full((round(STRIP * height), width, 3), STRIP_COLOUR, np.uint8)
    (wide, tall), _ = cv2.getTextSize(text, FONT, 1.0, 1)
    size = min(WIDTH_SHARE * width / max(wide, 1), 0.6 * len(strip) / tall)
    at = (round((1 - WIDTH_SHARE) / 2 * width), round((len(strip) + size * tall) / 2))
    cv2.putText(strip, text, at, FONT, size, INK, 1, cv2.LINE_AA)
    return strip
