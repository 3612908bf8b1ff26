"""Beats of music to BeatTrack: annotation files (`.beats`, `.csv`, `.txt`, `beats.json`), taps, Beat This! (neural).

==============  ==============================================================================================
``.beats``      lines ``time [beat-in-bar]``: seconds, and 1 on the first beat of a bar (Ballroom, madmom)
``.csv .txt``   lines ``time [strength]``: seconds; comma, semicolon, tab or blank between; a header line may be first
``.json``       ``{"beats_s": [...], "downbeats_s": [...] or null, "meter": 3, "bpm": 90.0, "dance": "waltz",
                "source": "synthetic", "motion_offset_s": 0.0, "units": [{"name", "start_s", "end_s", "beats",
                "figure"}]}``; only ``beats_s``, or ``beats`` as other programs have it, must be there
==============  ==============================================================================================

Lines that start with ``#`` are comments. `save_beats` writes ``.beats``. In ``.csv .txt`` a second column that repeats
the times (Audacity's labels), counts all beats, or is text (Sonic Visualiser's) is passed over. One that counts bars of
three beats or more holds the places, also as ``1.1 1.2 1.3 2.1``; one of 0 and 1 is 1 where a bar begins; any other
that never falls is an error, since lines may be numbered in the first. A comma may be that of a decimal: ``0,250``.

Through the taps of a person who listens go one tempo and one phase, mended by the sound; where its tempo moves and it
keeps to the taps, its own beats stand in.

Beat This! is a neural tracker of beats and bars (Foscarin, Schlueter, Widmer, ISMIR 2024), read where it is installed.
Nothing is downloaded, by us or by its package: weights are a file on this machine.
"""

import itertools
import math
import re
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from harmolab.beats.audio import audio_beats, beat_strengths, sounding_span
from harmolab.beats.tempo import NEAR, STEADY, Grid
from harmolab.files import MAX_TEXT_BYTES, WRITTEN_BY, PathLike, named_faults, read_json, read_text, reading, write_text
from harmolab.readers.arrays import number_array
from harmolab.types import Audio, BeatTrack, FloatArray, IntArray, check_kind, usual_meter

# Annotations are not read from a curve; they are good to a millisecond at best.
ANNOTATION_RATE = 1000.0

_MAX_BEATS = 100_000
_SUFFIXES = (".beats", ".csv", ".txt", ".json")
_FIT = re.compile(r"^# fit ([01]\.\d+):", re.MULTILINE)  # of tracked beats that are unsure, as `save_beats` writes it
_MOMENT = re.compile(r"^\s*(\S+)\t\1\s*$")  # a moment in Audacity's labels: its time twice
_LABEL = re.compile(r"^\s*(\S+)\t\1\t.*$")  # the same with a text
# A moment of Sonic Visualiser: "0.5,New Point", or "0.5,120.19 bpm"; flags and NaN are no names.
_NAMED = re.compile(r'^\s*[\d.]+ *[,;\t]\s*"?(?!(true|false|nan)\b)([\d.]+ bpm|[^\W\d])[^,;\t]*$', re.IGNORECASE)
_STRENGTH = re.compile(r'^\s*[\d.]+ *[,;\t]\s*"?\d*\.\d\S*\s*$')  # beside one: a name in such a file is a typing error


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
    places : (B,) array of int or None, each beat's place in its bar, 0 for the first, where the file names it
    fit : float or None, the `BeatTrack.fit` of tracked beats that were unsure when they were written
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
    places: IntArray | None = None
    fit: float | None = None

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

    def bar_places(self) -> IntArray | None:
        """Place of each beat in its bar, (B,), 0 for the downbeat; None without places, downbeats and units.

        Places that the file names stay as they are; without them, beats are counted from the last downbeat, before the
        first one back from it, in bars of `meter` beats. Units of choreography begin with a bar, or half way through
        one, so without downbeats the first unit's start stands in.
        """
        if self.places is not None:
            return self.places
        anchors = self.downbeats
        if anchors is None or anchors.size == 0:
            anchors = np.array([unit.start for unit in self.units[:1]])
        if self.meter is None or anchors.size == 0 or self.times.size == 0:
            return None
        nearest = np.abs(np.subtract.outer(anchors, self.times)).argmin(axis=1)
        inside = (anchors >= self.times[0] - NEAR) & (anchors <= self.times[-1] + NEAR)
        begins, numbers = nearest[inside] if inside.any() else nearest[:1], np.arange(self.times.size)
        return (numbers - begins[np.maximum(np.searchsorted(begins, numbers, side="right") - 1, 0)]) % self.meter

    def track(self, duration: float | None = None) -> BeatTrack:
        """The beats as a BeatTrack of `duration` seconds (None: one beat longer than the last beat)."""
        if duration is None:
            if not self.times.size:
                raise ValueError("holds no beats; pass duration for an empty track")
            duration = float(self.times[-1] + (np.median(np.diff(self.times)) if self.times.size > 1 else 1.0))
        strengths = np.ones(self.times.size) if self.strengths is None else self.strengths
        return BeatTrack(self.times, strengths, ANNOTATION_RATE, duration, self.bar_places(), fit=self.fit)

    def in_music(self, audio: Audio) -> BeatTrack:
        """The beats on the time line of their sound, with the strengths that Eq. 11 and 19 ask for.

        Strengths are the annotation's; where it names none, the music's onset strength by each beat (Eq. 2-3), or 1
        where the music is silent by all of them.
        """
        track = self.track(audio.duration)
        if self.strengths is not None:
            return track
        onsets = np.maximum(beat_strengths(audio, track.times), 0.0)
        return replace(track, strengths=onsets) if onsets.any() else track


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
    """The beats in an annotation file, such as those that you tapped or that another program wrote.

    ``.beats``: a line for each beat, ``seconds [place in the bar]``, 1 for the first of a bar. ``.csv`` and ``.txt``:
    ``seconds [strength]``. ``.json``: the times as ``"beats_s"``. `harmolab.readers.beats` has the formats in full.

    Parameters
    ----------
    path : str or path
    duration : float or None, seconds
        Length of the recording. None: one beat longer than the last beat.

    Returns
    -------
    BeatTrack; strengths are 1 where the file has none

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. Beats after `duration` are an error, since they may be numbers of frames.

    Examples
    --------
    >>> beats = load_beats("song.beats", duration=178.0)  # doctest: +SKIP
    """
    with named_faults(path):
        return load_annotation(path).track(duration)


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
            raise ValueError(f"is no beat annotation that is known; {', '.join(_SUFFIXES)} of seconds are read")
        if suffix == ".json":
            return _from_json(file)
        text = read_text(file)
        first, second = _columns(text, header=suffix != ".beats")
        if suffix != ".beats":
            return _from_columns(first, second)
        fit = _FIT.search(text)
        return replace(_from_bars(first, second), fit=float(fit[1]) if fit else None)


def save_beats(path: PathLike, track: BeatTrack, *, comment: str = "") -> None:
    """Write beats to a ``.beats`` file, which every command takes (``--beats``) and `load_beats` reads.

    It has a line for each beat, ``seconds [place in the bar]``, 1 for the first of a bar; strengths are not kept. The
    file is written whole or not at all. Beats that are unsure (`BeatTrack.is_sure`) are marked so in a comment.

    Parameters
    ----------
    path : str or path that ends in .beats
    track : BeatTrack of one beat or more
    comment : str
        Words for the first line.

    Raises
    ------
    ValueError
        For another ending, no beats, or beats that `load_beats` would refuse, such as two within a tenth of a
        millisecond; names the file.
    """
    check_kind(track, BeatTrack)
    path = Path(path)
    if path.suffix.lower() != ".beats":
        raise ValueError(f"{path}: beats are written as .beats; choose a name that ends so")
    if len(track) == 0:
        raise ValueError(f"{path}: there are no beats to write")
    places = [""] * len(track) if track.bar_places is None else [f" {place + 1}" for place in track.bar_places]
    last = math.floor(1e4 * track.duration) / 1e4  # rounded up it would lie beyond the song
    lines = [f"{min(time, last):.4f}{place}" for time, place in zip(track.times, places, strict=True)]
    with named_faults(path):
        _from_bars(*_columns("\n".join(lines), header=False))
    first = [f"# {': '.join([WRITTEN_BY, *([' '.join(comment.split())] if comment else [])])}"]
    fit = math.floor(100 * (track.fit or 0.0)) / 100  # never up to what is sure
    doubt = [] if track.is_sure else [f"# fit {fit:.2f}: unsure beats; take this line out once they are mended"]
    write_text(path, "\n".join([*first, *doubt, *lines]) + "\n")


def _columns(text: str, *, header: bool) -> tuple[FloatArray, FloatArray | None]:
    """The one or two columns of numbers in a text file."""
    numbered = enumerate(text.splitlines(), 1)
    lines = [(number, line) for number, line in numbered if line.strip() and line.lstrip()[0] != "#"]
    if len(lines) > _MAX_BEATS:
        raise ValueError(f"has {len(lines)} lines of numbers, more than {_MAX_BEATS}: not the beats of one recording")
    lines = _without_texts(lines) if header else lines
    if _are_decimal_commas([line.strip() for _, line in lines if re.search(r"\d", line)]):
        lines = [(number, line.replace(",", ".")) for number, line in lines]
    rows = [(number, words) for number, line in lines if (words := re.findall(r'[^\s,;"]+', line))]
    if header and rows and all(_number(word) is None for word in rows[0][1]):
        rows = rows[1:]
    if not rows:
        raise ValueError("holds no beats; a line for each is read, with its time in seconds first")
    width = len(rows[0][1])
    if width not in (1, 2):
        raise ValueError(f"has {width} columns; a time and perhaps one more number are read")
    table = np.empty((len(rows), width))
    for row, (line, words) in zip(table, rows, strict=True):
        for word in words:
            if (number := _number(word)) is None or not math.isfinite(number):
                raise ValueError(f"line {line}: {word[:40]!r} is not a number")
        if len(words) != width:
            raise ValueError(f"line {line} has {len(words)} columns, the first has {width}")
        row[:] = list(map(float, words))
    return table[:, 0], table[:, 1] if width == 2 else None


def _without_texts(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines of other programs, numbered: without what stands beside a moment, and without a head that begins empty."""
    lines = [(number, _LABEL.sub(r"\1", line)) for number, line in lines]
    if any(_NAMED.match(line) for _, line in lines) and not any(_STRENGTH.match(line) for _, line in lines):
        lines = [(number, re.sub(r"[,;\t].*", "", line)) for number, line in lines]
    if all(_MOMENT.match(line) for _, line in lines):
        return [(number, _MOMENT.sub(r"\1", line)) for number, line in lines]
    return lines[1:] if lines[0][1].lstrip(' "')[:1] in (",", ";") else lines  # pandas and R number the lines


def _are_decimal_commas(lines: list[str]) -> bool:
    """True for lines such as "0,25": two or more digits behind each comma, or no times where commas part columns."""
    parts = [re.fullmatch(r"(\d+),(\d+)", line) for line in lines]
    pairs = [(int(part[1]), len(part[2])) for part in parts if part]
    if not pairs or len(pairs) < len(lines):
        return False
    rises = all(later > earlier for (earlier, _), (later, _) in itertools.pairwise(pairs))
    return not rises or all(digits > 1 for _, digits in pairs)


def _number(word: str) -> float | None:
    """A word as a number, or None."""
    try:
        return float(word)
    except ValueError:
        return None


def _from_columns(times: FloatArray, second: FloatArray | None) -> BeatAnnotation:
    """An annotation from times and, perhaps, strengths; also from what other programs write beside a time.

    That is the time once more (Audacity's labels of a moment), 1 where a bar begins and 0 elsewhere, the number of the
    beat, or the places in bars of three beats or more.
    """
    if second is None or np.abs(second - times).max() < 1e-3:
        return BeatAnnotation(times)
    if second.min() < 0:
        raise ValueError(f"strengths must not be negative, got {second.min():g}")
    if set(second) == {0.0, 1.0}:
        return _with_meter(BeatAnnotation(times, times[second == 1]))
    if second.size > 3 and (np.diff(second) == 1).all() and (np.diff(times) != 1).any():
        return BeatAnnotation(times)
    second = _places_in_bars(second)
    counts_on = (second[0] == round(second[0])) & ((np.diff(second) == 1) | (second[1:] == 1))
    if second.min() >= 1 and second.max() >= 3 and second.size > second.max() and counts_on.all():
        return _from_bars(times, second)
    if second.size > 3 and (np.diff(second) >= 0).all() and second[-1] > second[0]:
        raise ValueError(
            "has a second column that rises as times and counts do, no strengths; write the time of each beat, alone"
        )
    return BeatAnnotation(times, strengths=second)


def _with_meter(notes: BeatAnnotation) -> BeatAnnotation:
    """The annotation with the meter that its downbeats tell, where it names none."""
    if notes.meter is not None or notes.downbeats is None:
        return notes
    return replace(notes, meter=annotation_of(notes.times, notes.downbeats).meter)


def _places_in_bars(column: FloatArray) -> FloatArray:
    """The places of numbers such as 1.1, 1.2, 1.3, 2.1, ... (bar and place); other columns as they are."""
    bars, places = np.divmod(np.round(10 * column), 10)
    begins = np.diff(bars) == 1
    steps = np.where(begins, places[1:] == 1, (np.diff(bars) == 0) & (np.diff(places) == 1))
    return places if steps.all() and places.min() >= 1 and column.size > places.max() >= 3 else column


def _from_bars(times: FloatArray, places: FloatArray | None) -> BeatAnnotation:
    """An annotation from times and, perhaps, each beat's place in its bar (1 is the downbeat)."""
    period = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    bpm = 60.0 / period if period > 0.06 else None
    if places is None:
        return BeatAnnotation(times, bpm=bpm)
    if ((places != places.round()) | (places < 1) | (places > 32)).any():
        raise ValueError("the second column must be the beat's place in its bar: 1, 2, ...")
    counted = places.astype(np.int64) - 1
    return BeatAnnotation(times, times[counted == 0], usual_meter(counted), bpm, places=counted)


def _from_json(path: Path) -> BeatAnnotation:
    """An annotation from our `beats.json`."""
    content = read_json(path)
    if isinstance(content, dict):
        content = {f"{name}_s": content[name] for name in ("beats", "downbeats") if name in content} | content
    if not isinstance(content, dict) or "beats_s" not in content:
        raise ValueError("has no 'beats_s', the list of beats in seconds")
    if not content["beats_s"]:
        raise ValueError("holds no beats: 'beats_s' is empty")
    units = content.get("units") or []
    if not isinstance(units, list):
        raise ValueError("'units' must be a list")
    meter, bpm, offset = (
        None if content.get(name) is None else _field(content, name) for name in ("meter", "bpm", "motion_offset_s")
    )
    return _with_meter(BeatAnnotation(
        content["beats_s"], content.get("downbeats_s"), None if meter is None else int(meter), bpm,
        str(content.get("dance") or ""), tuple(_unit(unit, number) for number, unit in enumerate(units)), offset,
        str(content.get("source") or ""),
    ))  # fmt: skip


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


# Beats out of taps, mended by the sound

FEWEST = 8  # taps
MOST = 20_000
REFINED = 0.06  # seconds within which the sound's phase is believed rather than the taps'; people differ by as much
LEAST_UNITY = 0.6  # length of the mean of the taps as arrows on the beat's circle; a jitter of 16 % of a beat has .6
SHORTEST = 0.15  # seconds between two taps: less is one tap that the key counted twice
SEARCH = 0.06  # part of the tempo by which the tempo of all taps may differ from their median interval
SAME_TEMPO = 0.02  # part of the tempo by which the sound's may differ from that of the taps


class TappedBeats(NamedTuple):
    """The beats of a whole song, and a remark on what the taps left open."""

    track: BeatTrack
    remark: str


def tapped_beats(audio: Audio, taps: FloatArray, ones: FloatArray, *, meter: int = 4) -> TappedBeats:
    """The beats of a song from taps to a part of it, extended from its first to its last sound.

    Double and missed taps do no harm. Where the sound has a steady grid of the tapped tempo, the beats take its period,
    and its phase too if that lies within 60 ms of the taps: a person's constant delay, and the machine's, cannot be
    told from a beat that lies elsewhere. Where its tempo moves, and it keeps to the taps, the beats are those of the
    sound, as late as the taps lie if that is more than 60 ms.

    Parameters
    ----------
    audio : Audio, the whole song
    taps : (K,) array, seconds of audio time, in any order
    ones : (D,) array, seconds, taps on the first beat of a bar; without any, bar places are unknown
    meter : int, beats in a bar

    Raises
    ------
    ValueError
        For fewer than 8 taps, more than 20,000, times outside the song, a meter below 1, or taps that keep no tempo.
    """
    taps, ones = (_moments(values, name, audio.duration) for values, name in ((taps, "taps"), (ones, "ones")))
    if not 1 <= meter <= 32:
        raise ValueError(f"a bar has 1 to 32 beats, got {meter}")
    times, remark = _by_sound(audio, taps, tap_grid(taps))
    if times.size < 2:
        raise ValueError("the song has no two beats at the tapped tempo")
    places = None
    if ones.size:
        inside = np.clip(ones, times[0], times[-1])  # who taps before the first sound, or after the last, counts on
        numbers = np.rint(np.interp(inside, times, np.arange(times.size)) + (ones - inside) / np.median(np.diff(times)))
        votes = np.bincount(numbers.astype(np.int64) % meter, minlength=meter)
        places = (np.arange(times.size) - int(votes.argmax())) % meter
        if votes.max() < ones.size:
            remark += f' {votes.max()} of {ones.size} "ones" agree on where a bar of {meter} beats begins.'
    strengths = beat_strengths(audio, times)
    return TappedBeats(BeatTrack(times, strengths, ANNOTATION_RATE, audio.duration, places), remark.strip())


def tap_grid(taps: FloatArray) -> Grid:
    """The line through taps: first + k period, k whole, with each tap's k its nearest; taps far off do not count.

    The period is first that on whose circle the taps point one way, so pauses, doubles and misses do not matter.

    Raises
    ------
    ValueError
        For fewer than 8 taps, or taps that keep no tempo.
    """
    taps = np.unique(taps)
    taps = taps[np.diff(taps, prepend=-np.inf) >= SHORTEST]
    if taps.size < FEWEST:
        raise ValueError(f"{taps.size} taps are too few; tap {FEWEST} beats or more")
    span = float(np.ptp(taps))
    tempo = 1.0 / float(np.median(np.diff(taps)))
    frequencies = np.arange(tempo * (1 - SEARCH), tempo * (1 + SEARCH), 1 / (20 * span))
    arrows = np.array([np.exp(2j * np.pi * frequency * taps).mean() for frequency in frequencies])
    best = int(np.abs(arrows).argmax())
    if np.abs(arrows[best]) < LEAST_UNITY:
        raise ValueError(
            "the taps keep no steady tempo; start again and tap every beat for ten seconds or more. Of a song whose "
            "tempo changes, write the moments of the beats into a file, a line each, for --beats"
        )
    grid = Grid(float(np.angle(arrows[best]) / (2 * np.pi * frequencies[best])), 1.0 / float(frequencies[best]), 0.0)
    near = taps[np.abs(grid.deviations(taps)) < grid.period / 4]
    period, first = np.polyfit(np.round((near - grid.first) / grid.period), near, 1)
    return Grid(float(first), float(period), float(np.abs(arrows[best])))


def _by_sound(audio: Audio, taps: FloatArray, grid: Grid) -> tuple[FloatArray, str]:
    """The beats of the whole song, (B,) seconds: those of the taps, mended by the sound where it has them; a remark."""
    start, end = sounding_span(audio)
    span, tempo = (max(start - NEAR, 0.0), end), 60.0 / grid.period
    track = audio_beats(audio, tempo=(tempo * (1 - SAME_TEMPO), tempo * (1 + SAME_TEMPO)))
    is_steady = track.quality is not None and track.quality >= STEADY and len(track) > 1
    if not is_steady or abs(track.tempo / tempo - 1) > SAME_TEMPO:
        moving = _moving_beats(track, taps, grid)
        unheard = "No steady grid was heard at your tempo: far from your taps the beats may drift."
        moves = "The tempo of this song moves: the beats follow its sound."
        return (grid.beats(*span), unheard) if moving is None else (moving, moves)
    sound = Grid(float(track.times[0]), 60.0 / track.tempo, 0.0)
    late = float(np.median(sound.deviations(taps)))
    if abs(late) <= REFINED:
        return sound.beats(*span), ""
    side = "after" if late > 0 else "before"
    remark = f"Your taps lie {1000 * abs(late):.0f} ms {side} the sound's own beats and were left there."
    return sound._replace(first=sound.first + late).beats(*span), remark


def _moving_beats(track: BeatTrack, taps: FloatArray, grid: Grid) -> FloatArray | None:
    """The beats heard in a song whose tempo moves, (B,), each as late as the taps; None if the taps keep to none."""
    if not track.is_sure or len(track) < FEWEST:
        return None
    numbers = np.arange(len(track))
    places, tapped = np.interp(taps, track.times, numbers), np.round((taps - grid.first) / grid.period)
    arrow = np.exp(2j * np.pi * places).mean()
    if np.abs(arrow) < LEAST_UNITY or abs(np.ptp(places) / np.ptp(tapped) - 1) > SAME_TEMPO:
        return None
    late = float(np.angle(arrow) / (2 * np.pi))
    late = 0.0 if abs(late) * grid.period <= REFINED else late
    moved = numbers + late
    return np.interp(moved[(moved >= 0) & (moved <= numbers[-1])], numbers, track.times)


def _moments(values: FloatArray, name: str, duration: float) -> FloatArray:
    """Times in a song, checked."""
    times = number_array(values, name, (None,))
    if times.size > MOST:
        raise ValueError(f"{times.size} {name} are more than {MOST}")
    if not (np.isfinite(times).all() and (times >= 0).all() and (times <= duration).all()):
        raise ValueError(f"{name} must lie in the song, between 0 and {duration:.1f} s")
    return times


# Beats and bars by Beat This!

PACKAGE = "beat_this"
HELP = "get a checkpoint (final0.ckpt) from https://github.com/CPJKU/beat_this and name the file with --checkpoint"


def neural_beats(audio: Audio, checkpoint: PathLike | None) -> BeatTrack:
    """Music beats with their places in the bar, as the network of a checkpoint hears them; on the CPU.

    Parameters
    ----------
    audio : Audio
    checkpoint : path of a file of weights; from its makers only, since such files may hold programs

    Raises
    ------
    ValueError
        Where the package or the file is not here, or the file cannot be read; says what to install and where from.
    """
    if find_spec(PACKAGE) is None:
        raise ValueError(f"--tracker {PACKAGE} needs its package; pip install beat-this, then {HELP}")
    if checkpoint is None or not Path(checkpoint).is_file():
        raise ValueError(f"{checkpoint or PACKAGE}: no weights on this machine; {HELP}")
    with reading(checkpoint, "a checkpoint of beat_this", max_bytes=None) as file:
        # Its package downloads what is no file; it gets the path of one.
        tracker = import_module(f"{PACKAGE}.inference").Audio2Beats(str(file.resolve()), device="cpu")
    beats, downbeats = tracker(np.asarray(audio.samples, np.float32), round(audio.sample_rate))
    return annotation_of(np.asarray(beats, float), np.asarray(downbeats, float)).track(audio.duration)


def annotation_of(beats: np.ndarray, downbeats: np.ndarray) -> BeatAnnotation:
    """Beats and downbeats as an annotation whose meter is the most frequent number of beats from bar to bar."""
    beats, downbeats = np.unique(beats), np.unique(downbeats)
    lengths = np.diff(np.searchsorted(beats, downbeats - 0.01)) if beats.size else np.zeros(0, np.int64)
    lengths = lengths[(lengths >= 1) & (lengths <= 32)]
    if not lengths.size:
        return BeatAnnotation(beats)
    return BeatAnnotation(beats, downbeats, int(np.bincount(lengths).argmax()))
