"""The records that functions hand to each other: sound, motion, beats, notes, clips.

A record is frozen: its fields cannot be set anew. It checks itself once, when it is made, and raises ValueError where
arrays are not finite or shapes disagree. So a function that receives a record may trust it. Arrays are stored as
read-only copies, and times are seconds. Two records that hold arrays are equal only if they are the same object.
"""

from dataclasses import dataclass, replace
from importlib import import_module
from reprlib import repr as clipped
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.body.skeletons import Skeleton

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

# Share of a frame by which a time may miss the frame it stands for: rounding, not another frame.
FRAME_EDGE = 1e-6
# Share of the music from which on tracked beats that explain it are sure.
SURE = 0.75


def frozen_array(values: ArrayLike, name: str, dtype: Any = np.float64) -> NDArray[Any]:
    """A read-only contiguous copy of `values`; ValueError names the field when it is not a finite numeric array.

    With `dtype` None it is of single precision where `values` are, else of double.
    """
    if np.ma.is_masked(values):
        raise ValueError(f"{name} has masked entries; interpolate or cut them first")
    try:
        original = np.asarray(values)
        if values is None or np.iscomplexobj(original):
            raise TypeError(f"real ones are needed, got {None if values is None else original.dtype}")
        dtype = dtype or (np.float32 if original.dtype == np.float32 else np.float64)
        with np.errstate(invalid="ignore"):
            array = np.array(original, dtype=dtype, order="C")
    except (TypeError, ValueError, OverflowError, RuntimeError) as error:  # torch has the last for what has a gradient
        raise ValueError(f"{name} must be an array of numbers: {error}") from None
    if array.dtype.kind != "f" and not np.array_equal(array, original):
        raise ValueError(f"{name} must be {'True or False' if array.dtype.kind == 'b' else 'whole numbers'}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        where = ", ".join(map(str, np.argwhere(~np.isfinite(array))[0]))
        raise ValueError(f"{name} holds NaN or infinity (first at index {where}); interpolate or cut it first")
    array.setflags(write=False)
    return array


def check_kind(value: object, kind: type, name: str = "") -> None:
    """ValueError, with the name where it has one, unless the value is a record of this kind."""
    if not isinstance(value, kind):
        needed = f"{name} must be a harmolab.{kind.__name__}" if name else f"a harmolab.{kind.__name__} is needed"
        raise ValueError(f"{needed}, got {type(value).__name__}")


def _positive(value: float, name: str) -> float:
    """`value` as a float; ValueError unless it is positive and of a size that physical quantities have."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {str(value)[:40]!r}") from None
    if not (np.isfinite(number) and number > 0):
        raise ValueError(f"{name} must be positive and finite, got {value}")
    if not 1e-9 <= number <= 1e12:
        raise ValueError(f"{name} must lie between 1e-9 and 1e12, got {value}")
    return number


class Record:
    """Arrays of a record stay read-only when it is copied or sent to another process."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)


class Display(Record):
    """A record that is one line as text, and a picture or a player in Jupyter, which the laboratory then makes."""

    def _repr_html_(self) -> str:
        # By name, when Jupyter asks: the core imports nothing of the laboratory, and outside Jupyter loads none of it.
        return str(import_module("harmolab.lab.display").record_html(self))


@dataclass(frozen=True, eq=False)
class Audio(Display):
    """Sound of one channel (mono).

    Parameters
    ----------
    samples : (S,) array
        Amplitudes; full scale is 1. Single precision is kept, all else becomes double.
    sample_rate : float, hertz

    Raises
    ------
    ValueError
        If `samples` is empty, has two channels or more, or holds NaN; if it holds whole numbers beyond 1, as a file of
        16 bits does (divide them by 32768); or if `sample_rate` is not positive.

    Examples
    --------
    >>> Audio(np.zeros(44100), 22050.0)
    Audio(2.00 s, 22050 Hz)
    """

    samples: FloatArray
    sample_rate: float

    def __post_init__(self) -> None:
        samples = frozen_array(self.samples, "samples", None)
        if samples.ndim != 1 or samples.size == 0:
            raise ValueError(f"samples must be a non-empty mono array (S,), got shape {samples.shape}")
        if np.asarray(self.samples).dtype.kind in "iu" and np.abs(samples).max() > 1:
            raise ValueError("samples are whole numbers; divide them by full scale, such as 32768 for 16 bits")
        vars(self).update(samples=samples, sample_rate=_positive(self.sample_rate, "sample_rate"))

    def __repr__(self) -> str:
        return f"Audio({self.duration:.2f} s, {self.sample_rate:g} Hz)"

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.samples.size / self.sample_rate

    def span(self, start: float, duration: float) -> "Audio":
        """The part that begins at second `start` and lasts `duration` seconds.

        It is shorter where the recording ends before. ValueError if `start` is negative or no sound lies there.
        """
        first, last = np.round(np.array([start, start + duration]) * self.sample_rate).clip(max=self.samples.size)
        if not 0 <= first < last:
            raise ValueError(f"no audio from {start} s for {duration} s in a recording of {self.duration:.2f} s")
        return Audio(self.samples[int(first) : int(last)], self.sample_rate)


@dataclass(frozen=True, eq=False)
class Motion(Display):
    """The places of the joints of a body over time, one frame after another.

    Parameters
    ----------
    positions : (T, J, 3) or (T, J, 2) array
        Places of J joints in T frames, at least two. In space: metres, y up, right-handed. In a picture: image
        coordinates of any unit, y down.
    fps : float, frames per second
    skeleton : Skeleton
        Names and tree of the J joints. `Skeleton.unnamed` will do where neither is known.
    valid : (T,) bool array
        False where a frame is filler, as between two recordings that were joined, or where the body was hidden.
        Filler has no beats, and measures leave it out. All frames are valid when it is left out. Straight lines
        take the place of filler in which all joints lie at one point, such as frames that a sensor lost and that are 0.

    Raises
    ------
    ValueError
        If shapes disagree, a position is NaN or infinite, there are less than two frames, or `fps` is not positive.

    Examples
    --------
    >>> Motion(np.zeros((60, 2, 3)), 30.0, Skeleton(("hip", "knee"), (-1, 0)))
    Motion(2.00 s, 60 frames at 30 fps, 2 joints in 3D)
    """

    positions: FloatArray
    fps: float
    skeleton: Skeleton
    valid: BoolArray = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        positions = frozen_array(self.positions, "positions")
        check_kind(self.skeleton, Skeleton, "skeleton")
        if positions.ndim != 3 or positions.shape[2] not in (2, 3):
            raise ValueError(f"positions must be (frames, joints, 3) or (frames, joints, 2), got {positions.shape}")
        if positions.shape[0] < 2:
            raise ValueError(f"motion needs at least two frames, got {positions.shape[0]}")
        if positions.shape[1] != len(self.skeleton.joints):
            raise ValueError(f"positions have {positions.shape[1]} joints, the skeleton {len(self.skeleton.joints)}")
        if np.abs(positions).max(initial=0.0) > 1e12:
            raise ValueError("positions exceed 1e12: not metres, nor any other unit of length")
        valid = frozen_array(np.ones(len(positions), bool) if self.valid is None else self.valid, "valid", bool)
        if valid.shape != positions.shape[:1]:
            raise ValueError(f"valid must have one entry per frame ({len(positions)}), got shape {valid.shape}")
        vars(self).update(positions=_with_bodies(positions, valid), valid=valid, fps=_positive(self.fps, "fps"))

    def __repr__(self) -> str:
        size = "{} joints in {}D".format(*self.positions.shape[1:])
        filler = f", {(~self.valid).sum()} frames of filler" if not self.valid.all() else ""
        return f"Motion({self.duration:.2f} s, {self.n_frames} frames at {self.fps:g} fps, {size}{filler})"

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return self.positions.shape[0]

    @property
    def duration(self) -> float:
        """Length in seconds: T / fps."""
        return self.n_frames / self.fps

    def span(self, start: float, duration: float) -> "Motion":
        """The frames of `duration` seconds from second `start` on.

        There are fewer where the motion ends before. ValueError if `start` is negative or less than two frames lie
        there.
        """
        first, last = np.round(np.array([start, start + duration]) * self.fps).clip(max=self.n_frames)
        if not 0 <= first <= last - 2:
            raise ValueError(f"no motion from {start} s for {duration} s in a motion of {self.duration:.2f} s")
        part = slice(int(first), int(last))
        return Motion(self.positions[part], self.fps, self.skeleton, self.valid[part])


def bridged(curves: FloatArray, kept: BoolArray) -> FloatArray:
    """Curves (T, ...) with straight lines over the samples that are not `kept`, (T,); as they are where none is."""
    every, samples, flat = np.arange(len(kept)), np.flatnonzero(kept), curves.reshape(len(kept), -1)
    if samples.size in (0, every.size):
        return curves
    return np.column_stack([np.interp(every, samples, curve[samples]) for curve in flat.T]).reshape(curves.shape)


def _with_bodies(positions: FloatArray, valid: BoolArray) -> FloatArray:
    """`positions` with straight lines over filler in which all joints lie at one point.

    Frames that a sensor lost are such in many files: zeros. Interpolated or smoothed, they would move the valid frames
    beside them.
    """
    lost = ~valid
    lost[~valid] = (np.ptp(positions[~valid], axis=1) == 0).all(axis=-1)
    if positions.shape[1] == 1 or not lost.any():
        return positions
    return frozen_array(bridged(positions, ~lost), "positions")


def usual_meter(bar_places: IntArray) -> int:
    """Beats in most bars of (B,) places in the bar, one or more; of lengths that are as frequent, the longest.

    >>> usual_meter(np.array([2, 0, 1, 2, 0, 1, 2, 3, 4, 5, 0, 1, 2, 0]))  # a downbeat was missed
    3
    """
    counts = np.bincount(bar_places[np.append(bar_places[1:] == 0, True)] + 1)
    return int(np.flatnonzero(counts == counts.max())[-1])


@dataclass(frozen=True, eq=False)
class BeatTrack(Display):
    """Beats on a time line: those of the music, or those of a movement.

    `len` of a track is the number of its beats.

    Parameters
    ----------
    times : (B,) array, seconds
        Strictly increasing, from 0 to `duration`.
    strengths : (B,) array
        Zero or more. Music: onset strength at the beat. Movement: value of the curve at the beat. Where no strengths
        are known, give 1 to each.
    fps : float, hertz
        Rate of the curve that the beats were read from. For beats from elsewhere any rate will do, such as 1000.
    duration : float, seconds
        Length of the time line.
    bar_places : (B,) array of int or None
        Place of each beat in its bar, 0 for the first beat of the bar ("one", the downbeat). None where unknown.
    quality : float or None
        Of tracked beats: the share of them that lies within 70 ms of one grid of constant tempo. None for other beats.
    fit : float or None
        Of tracked beats: the share of the sounding music that keeps to them, 0 to 1. None for other beats. It follows
        from `windows` where these are passed.
    windows : (W, 2) array or None
        Of tracked beats: a row for each window of sounding music. It holds the middle of the window (seconds), and 1
        where the music there keeps to the beats, else 0. None for other beats.

    Raises
    ------
    ValueError
        If shapes disagree, or a value lies outside of what is said above.

    Examples
    --------
    >>> BeatTrack([0.5, 1.0, 1.5, 2.0], [1.0, 1.0, 1.0, 1.0], 1000.0, 2.5, bar_places=[0, 1, 2, 0])
    BeatTrack(4 beats in 2.50 s, 120.0 a minute, bars of 3)
    """

    times: FloatArray
    strengths: FloatArray
    fps: float
    duration: float
    bar_places: IntArray | None = None
    quality: float | None = None
    fit: float | None = None
    windows: FloatArray | None = None

    def __post_init__(self) -> None:
        times, strengths = frozen_array(self.times, "beat times"), frozen_array(self.strengths, "beat strengths")
        fps, duration = _positive(self.fps, "fps"), _positive(self.duration, "duration")
        vars(self).update(times=times, strengths=strengths, fps=fps, duration=duration)
        if times.ndim != 1 or times.shape != strengths.shape:
            raise ValueError(f"beat times {times.shape} and strengths {strengths.shape} must be two equal lists")
        if times.size and times.max() > self.duration + 1e-6:
            raise ValueError(f"beat times reach {times.max():g} in a clip of {self.duration:g} s; were these frames?")
        if times.size and times.min() < 0:
            raise ValueError(f"beat times start at {times.min():g} s; they must not be negative")
        if (np.diff(times) <= 0).any():
            raise ValueError("beat times must increase strictly; sort them and remove doubles")
        if (strengths < 0).any():
            raise ValueError("beat strengths must not be negative")
        if self.bar_places is not None:
            places = frozen_array(self.bar_places, "bar_places", np.int64)
            if places.shape != times.shape:
                raise ValueError(f"bar_places must have one entry per beat ({times.size}), got shape {places.shape}")
            if (places < 0).any():
                raise ValueError(f"bar_places must not be negative, got {places.min()}; 0 is the downbeat")
            object.__setattr__(self, "bar_places", places)
        if self.fit is not None and not 0 <= self.fit <= 1:
            raise ValueError(f"fit must be a share, 0 to 1, got {self.fit}")
        if self.windows is not None:
            windows = frozen_array(self.windows, "windows")
            if windows.shape[1:] != (2,):
                raise ValueError(f"windows must be (W, 2), moments and 0 or 1, got shape {windows.shape}")
            vars(self).update(windows=windows, fit=float(windows[:, 1].mean()) if len(windows) else 0.0)

    def __repr__(self) -> str:
        tempo = f", {self.tempo:.1f} a minute" if len(self) > 1 else ""
        bars = f", bars of {usual_meter(self.bar_places)}" if self.bar_places is not None and len(self) else ""
        return f"BeatTrack({len(self)} beats in {self.duration:.2f} s{tempo}{bars}{'' if self.is_sure else ', unsure'})"

    def __len__(self) -> int:
        return self.times.size

    @property
    def is_sure(self) -> bool:
        """False for tracked beats to which less than three quarters of the sounding music keep (`fit`), else True.

        The music may then have other beats: that a movement does not follow these says nothing about the dancer.
        """
        return self.fit is None or self.fit >= SURE

    @property
    def tempo(self) -> float:
        """Beats per minute: the slope of a line through all beats; NaN with fewer than two.

        A gap is counted as the nearest whole number of beats, so that beats that were left out do not slow the tempo.
        """
        if len(self) < 2:
            return float("nan")
        steps = np.diff(self.times)
        numbers = np.cumsum(np.round(steps / np.median(steps)))
        return float(60.0 / np.polyfit([0.0, *numbers], self.times, 1)[0])

    def select(self, mask: BoolArray) -> "BeatTrack":
        """The beats where `mask`, a (B,) bool array, is True, on the same time line."""
        places = None if self.bar_places is None else self.bar_places[mask]
        return replace(self, times=self.times[mask], strengths=self.strengths[mask], bar_places=places)

    def span(self, start: float, duration: float) -> "BeatTrack":
        """The beats in [start, start + duration), on a time line that begins at second `start` of this one."""
        if not np.isfinite(start):
            raise ValueError(f"no beats from {start} s on")
        part, windows = self.select((self.times >= start) & (self.times < start + duration)), self.windows
        if windows is not None:
            away = np.abs(windows[:, 0] - start - duration / 2)
            near = away <= max(duration / 2, away.min(initial=np.inf))  # a part shorter than a window has the nearest
            windows = windows[near] - (start, 0.0)
        return replace(part, times=part.times - start, duration=duration, windows=windows)


@dataclass(frozen=True, eq=False)
class Notes(Record):
    """The notes of a piece of music, in the order in which they begin.

    `len` of a record is the number of its notes.

    Parameters
    ----------
    onsets : (N,) array, seconds
        When each note begins, from 0 on; never less than the one before.
    offsets : (N,) array, seconds
        When each note ends, after its onset.
    pitches : (N,) array of int
        MIDI numbers, 0 to 127; 60 is middle C.
    loudness : (N,) array
        0 (silent) to 1; all 1 when left out.
    hands : (N,) array of int
        The hand that plays each note: 0 the left, 1 the right, -1 unknown. All unknown when left out.

    Raises
    ------
    ValueError
        If an array has another length, or a value lies outside of what is said above.
    """

    onsets: FloatArray
    offsets: FloatArray
    pitches: IntArray
    loudness: FloatArray = None  # type: ignore[assignment]  # filled in below
    hands: IntArray = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        count = np.size(self.onsets)
        values = {
            "onsets": frozen_array(self.onsets, "note onsets"),
            "offsets": frozen_array(self.offsets, "note offsets"),
            "pitches": frozen_array(self.pitches, "pitches", np.int64),
            "loudness": frozen_array(np.ones(count) if self.loudness is None else self.loudness, "loudness"),
            "hands": frozen_array(np.full(count, -1) if self.hands is None else self.hands, "hands", np.int64),
        }
        for name, array in values.items():
            if array.shape != (count,):
                raise ValueError(f"notes need one of their {name} each, got {array.shape} for {count} onsets")
            object.__setattr__(self, name, array)
        if (np.diff(self.onsets) < 0).any() or (self.onsets < 0).any() or (self.offsets <= self.onsets).any():
            raise ValueError("notes must be in the order of their onsets, from 0 s on, and end after they begin")
        if ((self.pitches < 0) | (self.pitches > 127)).any():
            raise ValueError("pitches are MIDI numbers, 0 to 127")
        if ((self.loudness < 0) | (self.loudness > 1)).any():
            raise ValueError("loudness must lie between 0 and 1")
        if not np.isin(self.hands, (-1, 0, 1)).all():
            raise ValueError("hands are 0 (left), 1 (right) or -1 (unknown)")

    def __len__(self) -> int:
        return self.onsets.size

    def select(self, mask: BoolArray) -> "Notes":
        """The notes where `mask`, an (N,) bool array, is True."""
        return Notes(self.onsets[mask], self.offsets[mask], self.pitches[mask], self.loudness[mask], self.hands[mask])

    def span(self, start: float, duration: float) -> "Notes":
        """The notes that begin in [start, start + duration), on a time line that begins at second `start` of this one.

        They keep their lengths, so that the last ones may end after the span.
        """
        if not np.isfinite(start) or np.isnan(duration):
            raise ValueError(f"no notes from {start} s for {duration} s")
        part = self.select((self.onsets >= start) & (self.onsets < start + duration))
        return replace(part, onsets=part.onsets - start, offsets=part.offsets - start)


@dataclass(frozen=True, eq=False)
class Clip(Display):
    """A piece of music, the motion that is danced to it, and the moment of the music at which the motion begins.

    Parameters
    ----------
    name : str
    audio : Audio
    motion : Motion or None
        None for music alone, which has beats but no score.
    offset : float, seconds
        Moment of the audio at which the first frame of the motion stands. It is negative where the motion begins
        before the sound.
    source : str
        "synthetic", or the name of the recordings.
    beats : BeatTrack or None
        Beats of the music on the audio's time line, such as annotated ones. None: they are tracked when they are
        needed.
    dance : str
        Name of the dance, such as "cha-cha"; "" where unknown.
    has_start : bool
        False where `offset` is only assumed, since nothing tells at which moment of the music the motion begins. A
        score then says no more than "in time": the place in the beat cannot be judged.

    Raises
    ------
    ValueError
        If a field is of another kind, or motion and audio do not overlap.
    """

    name: str
    audio: Audio
    motion: Motion | None = None
    offset: float = 0.0
    source: str = ""
    beats: BeatTrack | None = None
    dance: str = ""
    has_start: bool = True

    def __post_init__(self) -> None:
        check_kind(self.audio, Audio, "audio")
        for value, kind, name in ((self.motion, Motion, "motion"), (self.beats, BeatTrack, "beats")):
            if value is not None:
                check_kind(value, kind, name)
        if np.asarray(self.offset).dtype.kind not in "biuf" or not np.isfinite(self.offset):
            raise ValueError(f"offset must be finite, got {self.offset!r}")
        if self.motion is not None and not -self.motion.duration < self.offset < self.audio.duration:
            length = f"audio of {self.audio.duration:.2f} s"
            raise ValueError(f"{self.name}: motion starting at {self.offset:.2f} s does not overlap {length}")

    def __repr__(self) -> str:
        parts = [clipped(self.name), f"{self.audio.duration:.2f} s of music"]
        if self.motion is not None:
            parts.append(f"{self.motion.duration:.2f} s of motion at {self.motion.fps:g} fps from {self.offset:.2f} s")
        beats = "" if self.beats is None else f"{len(self.beats)} beats"
        return f"Clip({', '.join(filter(None, [*parts, beats, self.dance and clipped(self.dance)]))})"

    def span(self, start: float, seconds: float) -> "Clip":
        """The part of the clip from audio time `start` on, `seconds` long, on a time line that begins at `start`.

        It is shorter where the music ends before. Its motion begins with the first whole frame there, and `offset` is
        the time before that frame. ValueError if no music is there, or the clip has a motion and less than two frames
        of it are there.
        """
        audio = self.audio.span(start, seconds)
        beats = None if self.beats is None else self.beats.span(start, seconds)
        if self.motion is None:
            return replace(self, audio=audio, beats=beats, offset=0.0)
        skipped = max(0, int(np.ceil((start - self.offset) * self.motion.fps - FRAME_EDGE)))
        offset = self.offset + skipped / self.motion.fps - start
        motion = self.motion.span(skipped / self.motion.fps, seconds - offset)
        return replace(self, audio=audio, motion=motion, beats=beats, offset=offset)

    def shared_frame(self, *, clock: float = 1.0) -> int:
        """Number of the motion's first frame that lies within the music: 0 unless the motion begins before it.

        `clock` as in `shared`.
        """
        fps = 1.0 if self.motion is None else self.motion.fps
        return max(0, int(np.ceil(-self.offset * fps / _positive(clock, "clock") - FRAME_EDGE)))

    def shared(self, *, clock: float = 1.0) -> "Clip":
        """The stretch that music and motion have in common: both begin with it, and its `offset` is 0.

        `clock` is the seconds of music for each second of the motion: 1.013 for a motion that was recorded 1.3 % too
        fast. ValueError if it is not positive, the clip has no motion, or motion and music share less than two frames.
        """
        if self.motion is None:
            raise ValueError(f"{self.name}: there is no motion to score")
        frame = _positive(clock, "clock") / self.motion.fps  # seconds of music
        skipped = self.shared_frame(clock=clock)
        start = max(self.offset + skipped * frame, 0.0)
        seconds = min((self.motion.n_frames - skipped) * frame, self.audio.duration - start)
        if seconds < 2 * frame - FRAME_EDGE:
            raise ValueError(f"{self.name}: motion and music meet in less than two frames")
        motion = self.motion.span(skipped / self.motion.fps, seconds / clock)
        beats = None if self.beats is None else self.beats.span(start, seconds)
        return replace(self, audio=self.audio.span(start, seconds), motion=motion, beats=beats, offset=0.0)
