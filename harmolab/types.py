"""Frozen, self-checking records that every other module speaks in.

Each record checks itself once, on construction, so a function that receives one may trust it: arrays are finite,
shapes agree, times are seconds. Arrays are stored as read-only copies. Records that hold arrays compare by identity.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Audio", "BeatTrack", "Clip", "HarmonyScore", "MeterUnit", "Motion", "Skeleton"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


def _frozen(values: ArrayLike, name: str, dtype: Any = np.float64) -> NDArray[Any]:
    """A read-only contiguous copy of `values`; ValueError names the field when it is not a finite numeric array."""
    if np.iscomplexobj(values):
        raise ValueError(f"{name} must be real numbers, got complex ones")
    try:
        array = np.array(values, dtype=dtype, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of numbers: {error}") from None
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0]
        where = ", ".join(map(str, first))
        raise ValueError(f"{name} holds NaN or infinity (first at index {where}); interpolate or cut it first")
    array.setflags(write=False)
    return array


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


@dataclass(frozen=True, eq=False)
class Audio:
    """Sound as one mono channel.

    Parameters
    ----------
    samples : (S,) array, amplitude (full scale is 1)
    sample_rate : float, hertz
    """

    samples: FloatArray
    sample_rate: float

    def __post_init__(self) -> None:
        dtype = np.float32 if np.asarray(self.samples).dtype == np.float32 else np.float64
        samples = _frozen(self.samples, "samples", dtype)
        if samples.ndim != 1 or samples.size == 0:
            raise ValueError(f"samples must be a non-empty mono array (S,), got shape {samples.shape}")
        object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "sample_rate", _positive(self.sample_rate, "sample_rate"))

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.samples.size / self.sample_rate

    def span(self, start: float, duration: float) -> Audio:
        """The part from `start`, `duration` seconds long (shorter at the end of the recording)."""
        first = round(start * self.sample_rate)
        last = round((start + duration) * self.sample_rate)
        if first < 0 or first >= self.samples.size or last <= first:
            raise ValueError(f"no audio from {start} s for {duration} s in a recording of {self.duration:.2f} s")
        return Audio(self.samples[first:last], self.sample_rate)


@dataclass(frozen=True)
class Skeleton:
    """Joint names and the tree that joins them; `parents[i]` is -1 at the root.

    >>> Skeleton(("hip", "knee"), (-1, 0)).bones
    ((0, 1),)
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(map(str, self.joints)))
        object.__setattr__(self, "parents", tuple(map(int, self.parents)))
        count = len(self.joints)
        if count == 0 or len(self.parents) != count:
            raise ValueError(f"a skeleton needs one parent per joint, got {count} joints, {len(self.parents)} parents")
        if not all(-1 <= parent < count and parent != joint for joint, parent in enumerate(self.parents)):
            raise ValueError(f"parents must be -1 or the index of another joint (0..{count - 1}): {self.parents}")

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """(parent, child) pairs."""
        return tuple((parent, joint) for joint, parent in enumerate(self.parents) if parent >= 0)

    @classmethod
    def unnamed(cls, count: int) -> Skeleton:
        """`count` joints of which nothing is known: no names, no bones."""
        return cls(tuple(f"joint_{i}" for i in range(count)), (-1,) * count)


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint positions over time.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up, right-handed; or (T, J, 2) image coordinates (any unit, y down)
    fps : float, frames per second
    skeleton : Skeleton with J joints
    valid : (T,) bool array, optional
        False where a frame is filler and not recorded movement (a splice, an occlusion). All True when left out.
    """

    positions: FloatArray
    fps: float
    skeleton: Skeleton
    valid: BoolArray = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        positions = _frozen(self.positions, "positions")
        if positions.ndim != 3 or positions.shape[2] not in (2, 3):
            raise ValueError(f"positions must be (frames, joints, 3) or (frames, joints, 2), got {positions.shape}")
        if positions.shape[0] < 2:
            raise ValueError(f"motion needs at least two frames, got {positions.shape[0]}")
        if positions.shape[1] != len(self.skeleton.joints):
            raise ValueError(f"positions have {positions.shape[1]} joints, the skeleton {len(self.skeleton.joints)}")
        if np.abs(positions).max(initial=0.0) > 1e12:
            raise ValueError("positions exceed 1e12: not metres, nor any other unit of length")
        valid = np.ones(len(positions), bool) if self.valid is None else self.valid
        valid = _frozen(valid, "valid", bool)
        if valid.shape != positions.shape[:1]:
            raise ValueError(f"valid must have one entry per frame ({len(positions)}), got shape {valid.shape}")
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "valid", valid)
        object.__setattr__(self, "fps", _positive(self.fps, "fps"))

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return self.positions.shape[0]

    @property
    def duration(self) -> float:
        """Length in seconds: T / fps."""
        return self.n_frames / self.fps

    def span(self, start: float, duration: float) -> Motion:
        """The frames from `start`, `duration` seconds long (fewer at the end)."""
        first, last = round(start * self.fps), round((start + duration) * self.fps)
        if first < 0 or min(last, self.n_frames) - first < 2:
            raise ValueError(f"no motion from {start} s for {duration} s in a motion of {self.duration:.2f} s")
        return Motion(self.positions[first:last], self.fps, self.skeleton, self.valid[first:last])


@dataclass(frozen=True, eq=False)
class BeatTrack:
    """Beats on a time line.

    Parameters
    ----------
    times : (B,) array, seconds, strictly increasing, within [0, duration]
    strengths : (B,) array, not negative
    fps : float, rate of the curve the beats were read from, hertz
    duration : float, seconds
    bar_places : (B,) array of int, optional
        Place of each beat in its bar, 0 for the downbeat. None when nobody knows.
    """

    times: FloatArray
    strengths: FloatArray
    fps: float
    duration: float
    bar_places: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        times, strengths = _frozen(self.times, "beat times"), _frozen(self.strengths, "beat strengths")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "strengths", strengths)
        object.__setattr__(self, "fps", _positive(self.fps, "fps"))
        object.__setattr__(self, "duration", _positive(self.duration, "duration"))
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
            places = _frozen(self.bar_places, "bar_places", np.int64)
            if places.shape != times.shape:
                raise ValueError(f"bar_places must have one entry per beat ({times.size}), got shape {places.shape}")
            object.__setattr__(self, "bar_places", places)

    def __len__(self) -> int:
        return self.times.size

    def select(self, mask: BoolArray) -> BeatTrack:
        """The beats where `mask` is True, on the same time line."""
        places = None if self.bar_places is None else self.bar_places[mask]
        return BeatTrack(self.times[mask], self.strengths[mask], self.fps, self.duration, places)

    def span(self, start: float, duration: float) -> BeatTrack:
        """The beats in [start, start + duration), counted from `start`."""
        inside = (self.times >= start) & (self.times < start + duration)
        places = None if self.bar_places is None else self.bar_places[inside]
        return BeatTrack(self.times[inside] - start, self.strengths[inside], self.fps, duration, places)


@dataclass(frozen=True, eq=False)
class MeterUnit:
    """One meter: a group of beats that the music repeats (paper Fig. 6).

    Parameters
    ----------
    start, end : float, seconds
    strong : (B,) bool array, which of its beats are strong (Eq. 22)
    signature : str, such as "4/4"
    """

    start: float
    end: float
    strong: BoolArray
    signature: str

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"a meter unit must end after it starts, got {self.start} to {self.end} s")
        object.__setattr__(self, "strong", _frozen(self.strong, "strong", bool))


@dataclass(frozen=True, eq=False)
class Clip:
    """A piece of music, the motion danced to it, and where each starts.

    Parameters
    ----------
    name : str
    audio : Audio
    motion : Motion or None
    offset : float, seconds
        Audio time of motion frame 0.
    source : str
        What this is: "synthetic", or the name of the recordings.
    beats : BeatTrack or None
        Annotated music beats on the audio's time line, when somebody wrote them down.
    dance : str
        Name of the dance ("cha-cha", ...), empty when unknown.
    """

    name: str
    audio: Audio
    motion: Motion | None = None
    offset: float = 0.0
    source: str = ""
    beats: BeatTrack | None = None
    dance: str = ""

    def __post_init__(self) -> None:
        if not np.isfinite(self.offset):
            raise ValueError(f"offset must be finite, got {self.offset}")
        if self.motion is not None and not -self.motion.duration < self.offset < self.audio.duration:
            raise ValueError(
                f"{self.name}: motion starting at {self.offset:.2f} s does not overlap "
                f"audio of {self.audio.duration:.2f} s"
            )


@dataclass(frozen=True, eq=False)
class HarmonyScore:
    """Everything one scoring of a clip found out. Times of the intervals are seconds.

    Parameters
    ----------
    harmony : float
        h of Eq. 20-21.
    audio_harmony, visual_harmony : float
        h_a = h_s / N and h_v = h_s / M.
    hitting_score : float
        h_s of Eq. 19.
    hit_rate : float
        Share of all music beats with an attentional visual beat within the delay.
    chance : float
        The hit share that a random shift in time would reach.
    harmony_above_chance : float
        0 is what chance reaches, 1 is every beat hit.
    hits : (N,) bool array, one per attentional music beat (Eq. 18)
    intervals : (N,) array, seconds, from each attentional music beat to its nearest visual beat (Eq. 17)
    n_audio, n_visual : int
        N and M, the attentional beats.
    p_value : float
        Share of random rotations in time that score as high; NaN when not computed.
    interval : (float, float)
        95 % interval of harmony_above_chance; NaN when not computed.
    """

    harmony: float
    audio_harmony: float
    visual_harmony: float
    hitting_score: float
    hit_rate: float
    chance: float
    harmony_above_chance: float
    hits: BoolArray
    intervals: FloatArray
    n_audio: int
    n_visual: int
    p_value: float = float("nan")
    interval: tuple[float, float] = (float("nan"), float("nan"))
    others: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, ready for JSON; a number that does not exist is None."""
        return {name: _plain(value) for name, value in asdict(self).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [_plain(item) for item in value.tolist()]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
