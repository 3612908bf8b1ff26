"""A performance from sound as a video: avatar or points, marks of notes and strikes, and on whom it was trained.

Needs OpenCV, numpy and PyAV.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np

from harmolab.io.files import PathLike, Progress, silent
from harmolab.io.video import write_video
from harmolab.lab.render.marks import INK, BeatMarks
from harmolab.lab.render.points import render_points
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import Frame
from harmolab.lab.render.video import RATE
from harmolab.lab.timing.performed import Performed

FONT = cv2.FONT_HERSHEY_SIMPLEX
WIDTH_SHARE = 0.94  # of a line of text in the picture's width
STRIP = 0.06  # of the strip below the picture in its height
MARKS_SHARE = 0.2  # of the picture's height that is left free for the marks above points, which fill the rest
STRIP_COLOUR = (246, 246, 246)


def write_performance(
    path: PathLike, performed: Performed, *, title: str = "", height: int = 480, progress: Progress = silent
) -> None:
    """Write a performance with its part of the sound as a video; the sentence on its training stands in every picture.

    Parameters
    ----------
    path : str or path that ends in .mp4 or .webm
    performed : Performed; points with a truth are drawn over it
    title : str, that players show, before the sentence on its training
    height : int, pixels
    progress : Progress over drawing

    Raises
    ------
    ValueError
        As `harmolab.io.video.write_video`.
    """
    marks = BeatMarks(height, performed.score.score, performed.mark_words)
    frames = _captioned(_marked(_pictures(performed, height), marks), performed.notice)
    heading = ". ".join(filter(None, [title, performed.notice]))
    write_video(path, progress(frames, "drawing"), RATE, audio=performed.audio, title=heading)


def _pictures(performed: Performed, height: int) -> Iterator[Frame]:
    """The avatar on a floor, the points alone, or the points over the true ones."""
    if performed.is_avatar:
        return render_dance(performed.figure, height=height, fps=RATE)
    beside, room, width = performed.compared, round(MARKS_SHARE * height), round(height * 4 / 3)
    if beside is not None:
        frames = render_points(beside.truth, beside.prediction, fps=RATE, height=height - room, width=width)
    else:
        frames = render_dance(performed.points, fps=RATE, height=height - room, width=width)
    return (np.pad(frame, ((room, 0), (0, 0), (0, 0)), mode="edge") for frame in frames)


def _marked(frames: Iterable[Frame], marks: BeatMarks) -> Iterator[Frame]:
    """The pictures with marks of notes, movement and hits in the corner."""
    for number, frame in enumerate(frames):
        marks.draw(frame, number / RATE)
        yield frame


def _captioned(frames: Iterable[Frame], text: str) -> Iterator[Frame]:
    """The pictures with a strip below them that holds one line of text."""
    strip: Frame | None = None
    for frame in frames:
        strip = _strip(text, *frame.shape[:2]) if strip is None else strip
        yield np.concatenate([frame, strip])


def _strip(text: str, height: int, width: int) -> Frame:
    """A line of text as large as fits."""
    rows = round(STRIP * height)
    strip = np.full((rows, width, 3), STRIP_COLOUR, np.uint8)
    (wide, tall), _ = cv2.getTextSize(text, FONT, 1.0, 1)
    size = min(WIDTH_SHARE * width / max(wide, 1), 0.6 * rows / tall)
    at = (round((1 - WIDTH_SHARE) / 2 * width), round((rows + size * tall) / 2))
    cv2.putText(strip, text, at, FONT, size, INK, 1, cv2.LINE_AA)
    return strip
