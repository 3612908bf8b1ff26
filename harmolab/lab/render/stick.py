"""Frames of a textured stick figure that dances, with marks of beats in a corner and words at the lower edge.

They show a dancer without a recording. All are streams of frames, so a video of any length needs the memory of one
frame. Needs OpenCV and numpy only.

Marks of beats are a disc for the music, a diamond for the dancer, a ring where they meet, a cross for a beat of the
music that is missed. They differ in shape and word, colour only helps.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton, skull_and_limbs
from harmolab.readers.player_points import joint_widths, limb_widths
from harmolab.score import HarmonyScore
from harmolab.types import FloatArray, Motion, check_kind

Frame = NDArray[np.uint8]

BACKGROUND = 225
LIMB_LEVELS = (40, 120) * 2
JOINT_LEVEL = 75
# OpenCV draws at fixed-point coordinates: four fractional bits place a limb to a sixteenth of a pixel, so that slow
# movement does not jump from pixel to pixel and look like a row of stops.
FRACTION_BITS = 4
FARTHEST = 2.0**20  # sixteenths of a pixel that OpenCV can draw at


class Stroke(NamedTuple):
    """A limb: a line from start to end, `size` pixels thick; or without an end a ball, `size` its fixed-point radius.

    Start and end are `fixed` places.
    """

    start: Sequence[int]
    end: Sequence[int] | None
    size: int
    colour: Sequence[float] | float


def fixed(points: FloatArray) -> NDArray[np.int32]:
    """Pixel positions in OpenCV's fixed-point coordinates, kept within what it can draw at."""
    return np.rint(np.clip(points * 2**FRACTION_BITS, -FARTHEST, FARTHEST)).astype(np.int32)


def draw_strokes(frame: Frame, strokes: Iterable[Stroke]) -> None:
    """Draw strokes over one another on `frame`."""
    for start, end, size, colour in strokes:
        if end is None:
            cv2.circle(frame, start, size, colour, -1, cv2.LINE_AA, FRACTION_BITS)
        else:
            cv2.line(frame, start, end, colour, size, cv2.LINE_AA, FRACTION_BITS)


def check_positive(**values: float) -> None:
    """ValueError that names the first value that is not positive and finite."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")


def picture_width(height: int, width: int | None, *, least: int) -> int:
    """The width, 4/3 of the height when left out; ValueError for a picture of fewer than `least` pixels on a side."""
    width = round(height * 4 / 3) if width is None else width
    if min(height, width) < least:
        raise ValueError(f"a picture needs at least {least} x {least} pixels, got {width} x {height}")
    return width


def render_skeleton(
    motion: Motion, *, height: int = 240, width: int | None = None, fps: float | None = None, colour: bool = False
) -> Iterator[Frame]:
    """Frames of a grey stick figure that dances a motion before a plain background: a video without a recording.

    The camera stands still, far away on the positive z side (orthographic: x to the right, y up). It is placed once, so
    that the whole motion stays in the picture. Limbs are striped, so that optical flow also sees movement along a limb.
    For a drawn person with sound and marks of beats take `write_dance`.

    Parameters
    ----------
    motion : Motion
        (T, J, 3) metres with y up, or (T, J, 2) image coordinates with y down. A skeleton without bones is drawn as
        dots.
    height, width : int, pixels
        `width` is 4/3 of the height when left out.
    fps : float, frames per second, optional
        Of the pictures; positions are interpolated linearly. The motion's own when left out.
    colour : bool
        Whether frames are (H, W, 3) RGB in place of (H, W) grey ones; the figure stays grey.

    Yields
    ------
    (H, W) or (H, W, 3) uint8 arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        If the picture would be smaller than 16 pixels, `fps` is not positive, or `motion` is no Motion.

    Examples
    --------
    >>> motion = Motion(np.zeros((30, 1, 3)), 30.0, Skeleton.unnamed(1))
    >>> next(render_skeleton(motion, height=48)).shape
    (48, 64)
    """
    check_kind(motion, Motion)
    width = picture_width(height, width, least=16)
    if fps is not None:
        check_positive(fps=fps)
    danced = motion if fps is None else resample_motion(motion, fps)
    return _figures(in_picture(danced.positions, height, width), motion.skeleton, height, width, colour)


def in_picture(positions: FloatArray, height: int, width: int) -> FloatArray:
    """(T, J, 3) pixel x, pixel y (down) and nearness, with a margin of a tenth on every side."""
    across, up = positions[..., 0], positions[..., 1]
    nearness = positions[..., 2] if positions.shape[2] == 3 else np.zeros_like(across)
    down = -up if positions.shape[2] == 3 else up
    extents = [max(np.ptp(axis), 1e-9) for axis in (across, down)]
    scale = min(0.8 * width / extents[0], 0.8 * height / extents[1])
    centred = [(axis - (axis.min() + axis.max()) / 2) * scale for axis in (across, down)]
    return np.stack([centred[0] + width / 2, centred[1] + height / 2, nearness], axis=-1)


def _figures(places: FloatArray, skeleton: Skeleton, height: int, width: int, colour: bool) -> Iterator[Frame]:
    skull, _ = skull_and_limbs(skeleton)
    figure_height = np.ptp(places[..., 1], axis=1).mean()
    thickness = max(2, round(0.05 * max(figure_height, 0.2 * height)))
    for place in places:
        frame = np.full((height, width), BACKGROUND, np.uint8)
        draw_strokes(frame, _strokes(place, skeleton, skull, thickness))
        yield np.repeat(frame[..., None], 3, axis=2) if colour else frame


def _strokes(place: FloatArray, skeleton: Skeleton, skull: list[int], thickness: int) -> Iterator[Stroke]:
    """Striped limbs from far to near, then joints."""
    widths = dict(zip(skeleton.bones, limb_widths(skeleton, skeleton.bones), strict=True))
    for parent, child in sorted(skeleton.bones, key=lambda bone: place[bone[0], 2] + place[bone[1], 2]):
        steps = np.arange(len(LIMB_LEVELS) + 1)[:, None]
        cuts = fixed(place[parent, :2] + (place[child, :2] - place[parent, :2]) * steps / len(LIMB_LEVELS)).tolist()
        width = max(1, round(thickness * widths[parent, child]))
        for start, end, level in zip(cuts[:-1], cuts[1:], LIMB_LEVELS, strict=True):
            yield Stroke(start, end, width, level)
    for joint, (point, wide) in enumerate(zip(fixed(place[:, :2]).tolist(), joint_widths(skeleton), strict=True)):
        radius = (1.6 if joint in skull else 0.7) * wide * thickness * 2**FRACTION_BITS
        yield Stroke(point, None, round(radius), JOINT_LEVEL)


# Marks of beats, and captions

# The project's colours for music, dancer and hits.
MUSIC, DANCER, HIT, MISS = (0, 114, 178), (230, 159, 0), (0, 158, 115), (178, 24, 43)
PLATE, INK = (246, 246, 246), (34, 34, 34)
FLASH = 0.15  # seconds for which a beat is shown
RADIUS, LEAST_RADIUS = 0.02, 4.0  # of a mark: share of the picture's height, pixels
ROW, TEXT_AT, WORD_WIDTH = 2.9, 4.2, 7.5  # in radii
LEAST_WORDS = 200  # pixels of height from which the words can be read
WORDS: Mapping[str, str] = MappingProxyType({"music": "music", "dancer": "dancer", "hit": "hit", "miss": "missed"})


class BeatMarks:
    """The marks of every moment, drawn once and then only copied into the pictures.

    Parameters
    ----------
    height : int, pixels of the pictures
    score : HarmonyScore or None
        Its attentional beats and pairs light the marks; without it there are none.
    words : mark -> the word beside it, of the marks to be shown
    begin : float, seconds of the score's time line at the first picture
    """

    def __init__(
        self, height: int, score: HarmonyScore | None, words: Mapping[str, str] = WORDS, *, begin: float = 0.0
    ) -> None:
        self.times: dict[str, FloatArray] = {}
        if score is not None:
            music, visual, missed = score.music.times, score.visual.times, score.music.times[score.pairs < 0]
            moments = {"music": music, "dancer": visual, "hit": hit_times(score), "miss": missed}
            self.times = {name: moments[name] - begin for name in words}
        states = product((False, True), repeat=len(self.times))
        self.plates = {lit: _plate(height, dict(zip(self.times, lit, strict=True)), words) for lit in states}

    def draw(self, frame: Frame, index: int, fps: float) -> None:
        """Put the marks into the upper left corner of `frame` (H, W, 3), lit from the picture nearest to each beat."""
        if not self.times:
            return
        since = [index / fps - times for times in self.times.values()]
        plate = self.plates[tuple(bool(((past > -0.5 / fps) & (past < FLASH)).any()) for past in since)]
        rows, columns = np.minimum(plate.shape[:2], frame.shape[:2])
        frame[:rows, :columns] = plate[:rows, :columns]


def hit_times(score: HarmonyScore) -> FloatArray:
    """Seconds, in order, at which the pairs of a score are complete: the later beat of the two, (hits,) array."""
    hits = score.pairs >= 0
    return np.sort(np.maximum(score.music.times[hits], score.visual.times[score.pairs[hits]]))


def _plate(height: int, lit: dict[str, bool], words: Mapping[str, str]) -> Frame:
    """The corner of a picture with one row for each mark."""
    radius = max(LEAST_RADIUS, RADIUS * height)
    worded = height >= LEAST_WORDS
    width = (TEXT_AT + WORD_WIDTH if worded else TEXT_AT) * radius
    plate = np.full((round((2.2 + ROW * (len(lit) - 1) + 2.0) * radius), round(width), 3), PLATE, np.uint8)
    for row, (name, on) in enumerate(lit.items()):
        middle = np.array([2.2, 2.2 + ROW * row]) * radius
        _draw_mark(plate, name, middle, radius, on)
        if worded:
            at = (round(TEXT_AT * radius), round(middle[1] + 0.62 * radius))
            thickness = max(1, height // 480)
            cv2.putText(plate, words[name], at, cv2.FONT_HERSHEY_SIMPLEX, radius / 17, INK, thickness, cv2.LINE_AA)
    return plate


def _draw_mark(plate: Frame, name: str, middle: FloatArray, radius: float, on: bool) -> None:
    """An outline, filled when `on`; the ring of a hit stays open and grows thick."""
    if name == "dancer":
        corners = fixed(middle + 1.15 * radius * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]))
        cv2.polylines(plate, [corners], True, DANCER, 1, cv2.LINE_AA, FRACTION_BITS)
        if on:
            cv2.fillPoly(plate, [corners], DANCER, cv2.LINE_AA, FRACTION_BITS)
        return
    if name == "miss":
        corners = fixed(middle + 0.8 * radius * np.array([[-1, -1], [1, 1], [-1, 1], [1, -1]])).tolist()
        for start, end in (corners[:2], corners[2:]):
            cv2.line(plate, start, end, MISS, max(2, round(0.5 * radius)) if on else 1, cv2.LINE_AA, FRACTION_BITS)
        return
    ring = max(2, round(0.5 * radius))
    size, colour, lit = (radius, MUSIC, -1) if name == "music" else (0.85 * radius, HIT, ring)
    centre, reach = fixed(middle).tolist(), round(size * 2**FRACTION_BITS)
    cv2.circle(plate, centre, reach, colour, lit if on else 1, cv2.LINE_AA, FRACTION_BITS)


LETTER, LEAST_LETTER = 0.028, 10.0  # height of a line's capitals: share of the picture's height, pixels
FONT, FONT_HEIGHT = cv2.FONT_HERSHEY_SIMPLEX, 21.0  # pixels of a capital at scale 1


def captioned(frames: Iterable[Frame], text: str) -> Iterator[Frame]:
    """The frames with words in a band at their lower edge; they are changed."""
    band: Frame | None = None
    for frame in frames:
        band = _band(text, *frame.shape[:2]) if band is None else band
        frame[-len(band) :] = band[-len(frame) :]
        yield frame


def _band(text: str, height: int, width: int) -> Frame:
    """(rows, width, 3) picture of words, in as many lines as they need."""
    letter = max(LEAST_LETTER, LETTER * height)
    scale, thickness = letter / FONT_HEIGHT, max(1, round(letter / 12))
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        fits = cv2.getTextSize(longer, FONT, scale, thickness)[0][0] <= width - 2 * letter
        lines = [*lines[:-1], longer] if fits or not lines[-1] else [*lines, word]
    band = np.full((round((1.9 * len(lines) + 0.9) * letter), width, 3), PLATE, np.uint8)
    for row, line in enumerate(lines):
        at = round(letter), round((1.9 * row + 1.7) * letter)
        cv2.putText(band, line, at, FONT, scale, INK, thickness, cv2.LINE_AA)
    return band
