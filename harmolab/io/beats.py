"""Beat annotations to BeatTrack: `.beats`, `.csv`, `.txt`, and `beats.json`.

==============  ==============================================================================================
``.beats``      lines ``time [beat-in-bar]``: seconds, and 1 on the first beat of a bar (Ballroom, madmom)
``.csv .txt``   lines ``time [strength]``: seconds; comma, semicolon, tab or blank between; a header line may be first
``.json``       ``{"beats_s": [...], "downbeats_s": [...] or null, "meter": 3, "bpm": 90.0, "dance": "waltz",
                "source": "synthetic", "motion_offset_s": 0.0, "units": [{"name", "start_s", "end_s", "beats",
                "figure"}]}``; only ``beats_s`` must be there
==============  ==============================================================================================

Lines that start with ``#`` are comments. `save_beats` writes ``.beats``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.arrays import number_array
from harmolab.io.files import MAX_TEXT_BYTES, WRITTEN_BY, PathLike, read_json, read_text, reading, write_text
from harmolab.types import BeatTrack, FloatArray

# Annotations are not read from a curve; they are good to a millisecond at best.
ANNOTATION_RATE = 1000.0

_MAX_BEATS = 100_000
_SUFFIXES = (".beats", ".csv", ".txt", ".json")


@dataclass(frozen=True)
class Unit:
    """A stretch of choreography: name, seconds, number of beats, and the figure it performs ("" when unknown)."""

    name: str
    start: float
    end: float
    beats: int
    figure: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.start < self.end):
            raise ValueError(f"unit {self.name!r} must end after it starts, got {self.start} to {self.end} s")
        if self.beats < 0:
            raise ValueError(f"unit {self.name!r} has {self.beats} beats; it cannot have less than none")


@dataclass(frozen=True, eq=False)
class BeatAnnotation:
    """The annotation of a piece of music, on the audio's time line.

    Parameters
    ----------
    times : (B,) array, seconds, strictly increasing
    downbeats : (D,) array or None, seconds
        The first beats of the bars; None when unknown.
    meter : int or None, beats in a bar
    bpm : float or None, beats per minute
    dance : str, "" when unknown
    units : tuple of Unit, the choreography
    offset : float or None, seconds
        Audio time of motion frame 0; None where it does not say.
    source : str, origin of the recording; "" when unknown
    strengths : (B,) array or None (all 1)
    """

    times: FloatArray
    downbeats: FloatArray | None = None
    meter: int | None = None
    bpm: float | None = None
    dance: str = ""
    units: tuple[Unit, ...] = ()
    offset: float | None = None
    source: str = ""
    strengths: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _times(self.times, "beat times"))
        if self.downbeats is not None:
            object.__setattr__(self, "downbeats", _times(self.downbeats, "downbeats"))
        if self.meter is not None and not 1 <= self.meter <= 32:
            raise ValueError(f"meter must be 1 to 32 beats in a bar, got {self.meter}")
        if self.bpm is not None and not 0 < self.bpm < 1000:
            raise ValueError(f"bpm must be positive and below 1000, got {self.bpm}")
        if self.offset is not None and not math.isfinite(self.offset):
            raise ValueError(f"motion_offset_s must be finite, got {self.offset}")

    def bar_places(self) -> NDArray[np.int64] | None:
        """Place of each beat in its bar, (B,), 0 for the downbeat; None without downbeats and units.

        Units of choreography begin with a bar, or half way through one, so without downbeats the first unit's start
        stands in for one.
        """
        anchors = self.downbeats
        if anchors is None or anchors.size == 0:
            anchors = np.array([unit.start for unit in self.units[:1]])
        if self.meter is None or anchors.size == 0 or self.times.size == 0:
            return None
        nearest = np.abs(np.subtract.outer(anchors, self.times)).argmin(axis=1)
        votes = np.bincount(nearest % self.meter, minlength=self.meter)
        return (np.arange(self.times.size) - int(votes.argmax())) % self.meter

    def track(self, duration: float | None = None) -> BeatTrack:
        """The beats as a BeatTrack of `duration` seconds (None: one beat longer than the last beat)."""
        if duration is None:
            if not self.times.size:
                raise ValueError("holds no beats; pass duration for an empty track")
            duration = float(self.times[-1] + (np.median(np.diff(self.times)) if self.times.size > 1 else 1.0))
        strengths = np.ones(self.times.size) if self.strengths is None else self.strengths
        return BeatTrack(self.times, strengths, ANNOTATION_RATE, duration, self.bar_places())


def _times(values: Any, name: str) -> FloatArray:
    """Seconds, checked: finite, not negative, increasing, and not frames or milliseconds."""
    times = number_array(values, name, (None,))
    if not np.isfinite(times).all():
        raise ValueError(f"{name} hold NaN or infinity (entry {int(np.argmin(np.isfinite(times)))})")
    steps = np.diff(times)
    if (steps <= 0).any():
        first = int(np.argmax(steps <= 0))
        raise ValueError(
            f"{name} must increase strictly, but {times[first + 1]:g} follows {times[first]:g}; sort them, drop doubles"
        )
    if times.size and times[0] < 0:
        raise ValueError(f"{name} start at {times[0]:g} s; they must not be negative")
    typical = float(np.median(steps)) if steps.size >= 3 else 0.0
    if name == "beat times" and (typical >= 10 or (typical >= 3 and (times == np.round(times)).all())):
        raise ValueError(f"{name} lie {typical:g} s apart; were these frames or milliseconds? seconds are needed")
    times.setflags(write=False)
    return times


def load_beats(path: PathLike, *, duration: float | None = None) -> BeatTrack:
    """The beats in an annotation file.

    Parameters
    ----------
    path : str or path
    duration : float or None, seconds
        Length of the recording. None: one beat longer than the last beat.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. Beats behind `duration` are an error: they may be frames.
    """
    annotation = load_annotation(path)
    with reading(path, "a beat annotation", max_bytes=MAX_TEXT_BYTES):
        return annotation.track(duration)


def load_annotation(path: PathLike) -> BeatAnnotation:
    """The content of an annotation file: beats, bars, tempo, dance, units.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "a beat annotation", max_bytes=MAX_TEXT_BYTES) as file:
        suffix = file.suffix.lower()
        if suffix not in _SUFFIXES:
            raise ValueError(f"is no beat annotation that is known; {', '.join(_SUFFIXES)} are read")
        if suffix == ".json":
            return _from_json(file)
        first, second = _columns(read_text(file), header=suffix != ".beats")
        return _from_bars(first, second) if suffix == ".beats" else _from_columns(first, second)


def save_beats(path: PathLike, track: BeatTrack, *, comment: str = "") -> None:
    """Write beats as lines ``time [place]`` of a ``.beats`` file, whole or not at all; a place of 1 begins a bar.

    Parameters
    ----------
    path : str or path
    track : BeatTrack of one beat or more
    comment : str, a first line

    Raises
    ------
    ValueError
        For another suffix or no beats; names the file.
    """
    path = Path(path)
    if path.suffix.lower() != ".beats":
        raise ValueError(f"{path}: beats are written as .beats; choose a name that ends so")
    if len(track) == 0:
        raise ValueError(f"{path}: there are no beats to write")
    places = [""] * len(track) if track.bar_places is None else [f" {place + 1}" for place in track.bar_places]
    lines = [f"{time:.4f}{place}" for time, place in zip(track.times, places, strict=True)]
    first = ": ".join([WRITTEN_BY, *([" ".join(comment.split())] if comment else [])])
    write_text(path, "\n".join([f"# {first}", *lines]) + "\n")


def _columns(text: str, *, header: bool) -> tuple[FloatArray, FloatArray | None]:
    """The one or two columns of numbers in a text file."""
    lines = enumerate(text.splitlines(), start=1)
    rows = [(number, re.findall(r"[^\s,;]+", line)) for number, line in lines if not line.lstrip().startswith("#")]
    rows = [(number, words) for number, words in rows if words]
    if header and rows and all(_number(word) is None for word in rows[0][1]):
        rows = rows[1:]
    if not rows:
        raise ValueError("holds no beats; a line for each is read, with its time in seconds first")
    if len(rows) > _MAX_BEATS:
        raise ValueError(f"has {len(rows)} lines of numbers, more than {_MAX_BEATS}: not the beats of one recording")
    width = len(rows[0][1])
    if width not in (1, 2):
        raise ValueError(f"has {width} columns; a time and perhaps one more number are read")
    table = np.empty((len(rows), width))
    for row, (line, words) in zip(table, rows, strict=True):
        for word in words:
            number = _number(word)
            if number is None or not math.isfinite(number):
                raise ValueError(f"line {line}: {word[:40]!r} is not a number")
        if len(words) != width:
            raise ValueError(f"line {line} has {len(words)} columns, the first has {width}")
        row[:] = list(map(float, words))
    return table[:, 0], table[:, 1] if width == 2 else None


def _number(word: str) -> float | None:
    """A word as a number, or None."""
    try:
        return float(word)
    except ValueError:
        return None


def _from_columns(times: FloatArray, strengths: FloatArray | None) -> BeatAnnotation:
    """An annotation from times and, perhaps, strengths."""
    if strengths is not None and strengths.min() < 0:
        raise ValueError(f"strengths must not be negative, got {strengths.min():g}")
    return BeatAnnotation(times, strengths=strengths)


def _from_bars(times: FloatArray, places: FloatArray | None) -> BeatAnnotation:
    """An annotation from times and, perhaps, each beat's place in its bar (1 is the downbeat)."""
    period = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    bpm = 60.0 / period if period > 0.06 else None
    if places is None:
        return BeatAnnotation(times, bpm=bpm)
    if ((places != places.round()) | (places < 1) | (places > 32)).any():
        raise ValueError("the second column must be the beat's place in its bar: 1, 2, ...")
    return BeatAnnotation(times, times[places == 1], int(places.max()), bpm)


def _from_json(path: Path) -> BeatAnnotation:
    """An annotation from our `beats.json`."""
    content = read_json(path)
    if not isinstance(content, dict) or "beats_s" not in content:
        raise ValueError("has no 'beats_s', the list of beats in seconds")
    if not content["beats_s"]:
        raise ValueError("holds no beats: 'beats_s' is empty")
    units = content.get("units") or []
    if not isinstance(units, list):
        raise ValueError("'units' must be a list")
    return BeatAnnotation(
        content["beats_s"],
        content.get("downbeats_s"),
        None if content.get("meter") is None else int(_field(content, "meter")),
        None if content.get("bpm") is None else _field(content, "bpm"),
        str(content.get("dance") or ""),
        tuple(_unit(unit, number) for number, unit in enumerate(units)),
        None if content.get("motion_offset_s") is None else _field(content, "motion_offset_s"),
        str(content.get("source") or ""),
    )


def _unit(unit: Any, number: int) -> Unit:
    """One entry of 'units'."""
    if not isinstance(unit, dict):
        raise ValueError(f"unit {number} is not a record with name, start_s, end_s, beats")
    start, end, beats = (_field(unit, name) for name in ("start_s", "end_s", "beats"))
    return Unit(str(unit.get("name", number)), start, end, int(beats), str(unit.get("figure") or ""))


def _field(record: dict[str, Any], name: str) -> float:
    """A finite number out of a record of JSON."""
    value = record.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{name!r} must be a number, got {str(value)[:40]!r}")
    return float(value)
