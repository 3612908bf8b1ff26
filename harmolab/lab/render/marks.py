"""Marks of beats in the corner of a picture: a disc for the music, a diamond for the dancer, a ring where they meet.

Marks differ in shape and word, colour only helps. Needs OpenCV and numpy only.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from types import MappingProxyType

import cv2
import numpy as np

from harmolab.lab.render.stick import FRACTION_BITS, Frame, fixed
from harmolab.types import FloatArray
from harmolab.verdict.score import HarmonyScore

# The project's colours for music, dancer and hits.
MUSIC, DANCER, HIT = (0, 114, 178), (230, 159, 0), (0, 158, 115)
PLATE, INK = (246, 246, 246), (34, 34, 34)
FLASH = 0.15  # seconds for which a beat is shown
RADIUS, LEAST_RADIUS = 0.02, 4.0  # of a mark: share of the picture's height, pixels
ROW, TEXT_AT, WORD_WIDTH = 2.9, 4.2, 7.5  # in radii
LEAST_WORDS = 200  # pixels of height from which the words can be read
WORDS: Mapping[str, str] = MappingProxyType({"music": "music", "dancer": "dancer", "hit": "hit"})


class BeatMarks:
    """The marks of every moment, drawn once and then only copied into the pictures.

    Parameters
    ----------
    height : int, pixels of the pictures
    score : HarmonyScore or None
        Its attentional beats and pairs, on the pictures' time line, light the marks; without it there are none.
    words : mark -> the word beside it
    """

    def __init__(self, height: int, score: HarmonyScore | None, words: Mapping[str, str] = WORDS) -> None:
        self.times: dict[str, FloatArray] = {}
        if score is not None:
            self.times = {"music": score.music.times, "dancer": score.visual.times, "hit": hit_times(score)}
        states = product((False, True), repeat=len(self.times))
        self.plates = {lit: _plate(height, dict(zip(self.times, lit, strict=True)), words) for lit in states}

    def draw(self, frame: Frame, seconds: float) -> None:
        """Put the marks into the upper left corner of `frame` (H, W, 3), lit as they are at that moment."""
        if not self.times:
            return
        since = {name: seconds - times for name, times in self.times.items()}
        plate = self.plates[tuple(bool(((past >= 0) & (past < FLASH)).any()) for past in since.values())]
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
            cv2.putText(
                plate, words[name], at, cv2.FONT_HERSHEY_SIMPLEX, radius / 17, INK, max(1, height // 480), cv2.LINE_AA
            )
    return plate


def _draw_mark(plate: Frame, name: str, middle: FloatArray, radius: float, on: bool) -> None:
    """An outline, filled when `on`; the ring of a hit stays open and grows thick."""
    if name == "dancer":
        corners = fixed(middle + 1.15 * radius * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]))
        cv2.polylines(plate, [corners], True, DANCER, 1, cv2.LINE_AA, FRACTION_BITS)
        if on:
            cv2.fillPoly(plate, [corners], DANCER, cv2.LINE_AA, FRACTION_BITS)
        return
    ring = max(2, round(0.5 * radius))
    size, colour, lit = (radius, MUSIC, -1) if name == "music" else (0.85 * radius, HIT, ring)
    centre, reach = fixed(middle).tolist(), round(size * 2**FRACTION_BITS)
    cv2.circle(plate, centre, reach, colour, lit if on else 1, cv2.LINE_AA, FRACTION_BITS)
