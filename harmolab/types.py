"""Frozen, self-checking records that every other module speaks in.

Each record checks itself once, on construction, so a function that receives one may trust it: arrays are finite,
shapes agree, times are seconds. Arrays are stored as read-only copies. Records that hold arrays compare by identity.
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
    """Sound as one mono channel.

    Parameters
    ----------
    samples : (S,) array, amplitude (full scale is 1)
    sample_rate : float, hertz
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
        """The part from `start`, `duration` seconds long (shorter at the end of the recording)."""
        first, last = np.round(np.array([start, start + duration]) * self.sample_rate).clip(max=self.samples.size)
        if not 0 <= first < last:
            raise ValueError(f"no audio from {start} s for {duration} s in a recording of {self.duration:.2f} s")
        return Audio(self.samples[int(first) : int(last)], self.sample_rate)


@dataclass(frozen=True, eq=False)
class Motion(Display):
    """Joint positions over time.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up, right-handed; or (T, J, 2) image coordinates (any unit, y down)
    fps : float, frames per second
    skeleton : Skeleton with J joints
    valid : (T,) bool array: False where a frame is filler (a splice, an occlusion); all True when left out
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
        vars(self).update(positions=positions, valid=valid, fps=_positive(self.fps, "fps"))

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
        """The frames from `start`, `duration` seconds long (fewer at the end)."""
        first, last = np.round(np.array([start, start + duration]) * self.fps).clip(max=self.n_frames)
        if not 0 <= first <= last - 2:
            raise ValueError(f"no motion from {start} s for {duration} s in a motion of {self.duration:.2f} s")
        part = slice(int(first), int(last))
        return Motion(self.positions[part], self.fps, self.skeleton, self.valid[part])


@dataclass(frozen=True, eq=False)
class BeatTrack(Display):
    """Beats on a time line.

    Parameters
    ----------
    times : (B,) array, seconds, strictly increasing, within [0, duration]
    strengths : (B,) array, not negative
    fps : float, rate of the curve the beats were read from, hertz
    duration : float, seconds
    bar_places : (B,) array of int: place of each beat in its bar, 0 for the downbeat; None when unknown
    quality : float, of tracked beats: share of them within 70 ms of one steady grid; None for any others
    fit : float, of tracked beats: share of the sounding music that they explain; None for any others
    windows : (W, 2) array, of tracked beats: the middle (seconds) of each stretch of sounding music, and 1 where they
        explain it, else 0; `fit` is the share of those within the track's time line; None for any others
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
        bars = f", bars of {self.bar_places.max() + 1}" if self.bar_places is not None and len(self) else ""
        return f"BeatTrack({len(self)} beats in {self.duration:.2f} s{tempo}{bars}{'' if self.is_sure else ', unsure'})"

    def __len__(self) -> int:
        return self.times.size

    @property
    def is_sure(self) -> bool:
        """False for tracked beats that explain less than `SURE` of the music: not to follow them says nothing."""
        return self.fit is None or self.fit >= SURE

    @property
    def tempo(self) -> float:
        """Beats per minute, from a line through all beats, gaps counted as whole beats; NaN with fewer than two."""
        if len(self) < 2:
            return float("nan")
        steps = np.diff(self.times)
        numbers = np.cumsum(np.round(steps / np.median(steps)))
        return float(60.0 / np.polyfit([0.0, *numbers], self.times, 1)[0])

    def select(self, mask: BoolArray) -> "BeatTrack":
        """The beats where `mask` is True, on the same time line."""
        places = None if self.bar_places is None else self.bar_places[mask]
        return replace(self, times=self.times[mask], strengths=self.strengths[mask], bar_places=places)

    def span(self, start: float, duration: float) -> "BeatTrack":
        """The beats in [start, start + duration), counted from `start`."""
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
    """Notes of a piece, by onset.

    Parameters
    ----------
    onsets, offsets : (N,) arrays, seconds; onsets do not fall, offsets come after them
    pitches : (N,) array of int, MIDI numbers (60 is middle C)
    loudness : (N,) array, 0 to 1; 1 where left out
    hands : (N,) array of int: 0 the left hand, 1 the right, -1 unknown (where left out)
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
        """The notes where `mask` is True."""
        return Notes(self.onsets[mask], self.offsets[mask], self.pitches[mask], self.loudness[mask], self.hands[mask])

    def span(self, start: float, duration: float) -> "Notes":
        """The notes that begin in [start, start + duration), counted from `start`."""
        if not np.isfinite(start) or np.isnan(duration):
            raise ValueError(f"no notes from {start} s for {duration} s")
        part = self.select((self.onsets >= start) & (self.onsets < start + duration))
        return replace(part, onsets=part.onsets - start, offsets=part.offsets - start)


@dataclass(frozen=True, eq=False)
class Clip(Display):
    """A piece of music, the motion danced to it, and where each starts.

    Parameters
    ----------
    name : str
    audio : Audio
    motion : Motion or None
    offset : float, seconds, audio time of motion frame 0
    source : str: "synthetic", or the name of the recordings
    beats : BeatTrack or None, annotated music beats on the audio's time line
    dance : str, name of the dance ("cha-cha", ...), empty when unknown
    has_start : bool
        False where the offset was assumed: nothing tells at which moment of the music the motion begins.
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
        """The clip from audio time `start` on, `seconds` long (shorter at the end of the music), on a new time line.

        Its motion begins with the first whole frame there; `offset` is what lies before that frame. ValueError if there
        is no music there, or the clip has a motion and less than two frames of it are there.
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
        """Number of the motion's first frame that lies within the music; `clock` as in `shared`."""
        fps = 1.0 if self.motion is None else self.motion.fps
        return max(0, int(np.ceil(-self.offset * fps / _positive(clock, "clock") - FRAME_EDGE)))

    def shared(self, *, clock: float = 1.0) -> "Clip":
        """The stretch that music and motion have in common, on the motion's time line: its `offset` is 0.

        `clock` is seconds of music for each second of the motion. ValueError if it is not positive, the clip has no
        motion, or motion and music meet in less than two frames.
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
