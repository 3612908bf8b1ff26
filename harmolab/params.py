"""Settings of scoring: dances, bar patterns, every choice that a harmony score depends on."""

from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any, Literal, get_args, get_origin

import numpy as np


@dataclass(frozen=True)
class Dance:
    """Usual music of one dance: tempo in beats per minute, and beats in a bar."""

    tempo: tuple[float, float]
    meter: int


# Tempo ranges hold the competition range of each dance and the practice recordings on either side of it.
DANCES = MappingProxyType(
    {
        "cha-cha": Dance((104.0, 136.0), 4),
        "jive": Dance((144.0, 184.0), 4),
        "quickstep": Dance((188.0, 216.0), 4),
        "rumba": Dance((62.0, 112.0), 4),
        "samba": Dance((92.0, 108.0), 4),
        "tango": Dance((116.0, 140.0), 4),
        "waltz": Dance((78.0, 96.0), 3),
    }
)


@dataclass(frozen=True)
class BarPattern:
    """The usual course of movement through a cycle of beats: when the body is fast, and when it is slow.

    It is the expected shape speed (see `harmolab.shape_speed`) in standard deviations from its mean, as a short Fourier
    series. At beat position x (0 is the first beat of the cycle) it is

    ``sum_h cosines[h-1] cos(2 pi h x / beats) + sines[h-1] sin(2 pi h x / beats)``, h = 1 to H.

    Parameters
    ----------
    beats : int
        Length of the cycle: 3 for a waltz, whose bar has one course, 2 for half a bar of 4/4.
    cosines, sines : sequences of H floats
        One of each for every harmonic h; kept as tuples, so that patterns can be compared and printed.
    source : str
        The recordings that it was learnt on.
    dance : str
        Name of the dance; "" where unknown.

    Raises
    ------
    ValueError
        If `beats` is no whole number from 1 on, the lists are empty or differ in length, or a number is not finite.

    Examples
    --------
    Slowest on every beat, fastest half way between two, is one cosine:

    >>> BarPattern(1, [-1.0], [0.0], "rest") == HOW_PATTERNS["rest"]
    True
    """

    beats: int
    cosines: tuple[float, ...]
    sines: tuple[float, ...]
    source: str = ""
    dance: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.beats, Integral) or self.beats < 1:
            raise ValueError(f"a bar pattern needs whole beats, at least one beat, got {self.beats}")
        for name in ("cosines", "sines"):  # lists and arrays are the same pattern as a tuple
            object.__setattr__(self, name, tuple(float(each) for each in getattr(self, name)))
        if not self.cosines or len(self.cosines) != len(self.sines):
            raise ValueError(f"cosines and sines must be two equal lists, got {self.cosines} and {self.sines}")
        if not np.isfinite(self.cosines + self.sines).all():
            raise ValueError("a bar pattern's coefficients must be finite")

    @classmethod
    def stop_on_the_beat(cls) -> "BarPattern":
        """The pattern of movements that end on the beat: slowest on every beat, fastest half way between two beats."""
        return cls(1, (-1.0,), (0.0,), "assumed: movements end on the beat")


# Shape speed through the half bar (4/4) or bar (3/4), learnt by `harmolab data learn` on 6 s clips of recorded
# dancers whose beats were annotated. Tango has none: unit by unit its fastest moment lies anywhere, so no curve
# carries over.
DANCE_PATTERNS = MappingProxyType(
    {
        "cha-cha": BarPattern(2, (0.276, -0.098), (0.444, 0.005), "learnt on 41 clips of recorded cha-cha", "cha-cha"),
        "rumba": BarPattern(2, (0.099, -0.016), (0.356, -0.087), "learnt on 49 clips of recorded rumba", "rumba"),
        "waltz": BarPattern(
            3, (0.078, 0.188, 0.088), (0.443, -0.102, 0.22), "learnt on 60 clips of recorded waltz", "waltz"
        ),
    }
)
# What a dancer may say of the movement: slowest on each beat, fastest on it, or slowest on every second one.
HOW_PATTERNS = MappingProxyType(
    {
        "rest": BarPattern(1, (-1.0,), (0.0,), "rest"),
        "hit": BarPattern(1, (1.0,), (0.0,), "hit"),
        "half time": BarPattern(2, (-1.0,), (0.0,), "half time"),
    }
)
MAX_LAG = 2.0  # seconds: a beat of 30 bpm


@dataclass(frozen=True)
class HarmonyParams:
    """The settings of a harmony score: every choice that it depends on.

    Take one of the presets, and change single fields by `dataclasses.replace`:

    ``HarmonyParams.recommended()``
        the score that we advise, which `score_clip` and `score_motion` take where no settings are passed
    ``HarmonyParams.paper()``
        the score of the paper; the defaults below are its values
    ``HarmonyParams.valleys()``
        hits of rests, corrected for chance: the simplest score that sees planted beats
    ``HarmonyParams.playing()``
        the same for the hands of musicians

    A *visual beat* is a beat of the movement, such as a moment at which the body is slowest.

    Parameters
    ----------
    measure : "shape" or "hits"
        "shape" asks of the shape of the body whether it is in time, and where in the beat (`harmolab.verdict.judge`).
        "hits" counts the music beats that have a visual beat close by (Eq. 14-21). `audio_threshold`,
        `visual_threshold` and `smoothing` are read by "hits" alone.
    audio_threshold : float
        lambda_1 of Eq. 11, in standard deviations: a music beat counts if its strength is above it.
    visual_threshold : float or None
        lambda_2 of Eq. 13, in standard deviations: a visual beat counts if it differs by more from the one before. None
        keeps every visual beat.
    reaction_delay : float, seconds
        T_delay of Eq. 18: a music beat is hit if a visual beat is at most this far away. At most 10.
    beta : float
        Weight in Eq. 20. Above 1 it matters more that music beats are hit, below 1 that visual beats hit.
    detector : "turns", "valleys", "peaks" or "direction"
        The moments that are visual beats: all turning points of the joint speed (Eq. 8-9), its valleys (rests) or
        peaks (hits) alone, or peaks of the change of direction (motion SD).
    fps : float or None, hertz
        The motion is resampled to this rate first, by linear interpolation. None keeps its own rate.
    smoothing : float, seconds
        Standard deviation of the Gaussian that smooths the speed curve; 0 does not smooth. At most 10.
    position_smoothing : float, seconds
        The same for the joint positions, before the speed is taken: for sensors that tremble.
    subframe : bool
        Whether visual beats are placed between frames, so that their times do not depend on the frame rate. A speed
        then stands half way between its two frames, and an extremum at the top of the parabola through three samples.
        Where `fps` is None, motion below 120 hertz is first interpolated by cubic splines.
    lag : float, seconds
        Time by which movements are expected later than the music's beats, from -2 to 2; it is taken off before scoring.
    clock : float
        Time stretch of the motion: its times are multiplied by this. 1.013 fits most recordings of Tang et al. 2018,
        which run 1 to 1.5 % fast.
    speed : "norm", "signed" or "norm_of_sum"
        Joint speed of Eq. 7: sum of the lengths of the joints' velocities; sum over joints and axes, with sign; or
        length of the summed velocity. This and the fields up to `normalisation` are readings of equations that leave
        room; the first word is the paper mode's. ``docs/readings.md`` has the reasons.
    plateau : "last", "middle" or "literal"
        A flat top of the speed curve is one turning point, at its last or middle sample; "literal" misses it (Eq. 8-9).
    saliency : "threshold" or "literal"
        Eq. 11 and 13 with lambda as a threshold, or as they are printed, where lambda cannot matter.
    visual_saliency : "difference" or "strength"
        Eq. 13 on the difference R of two neighbouring visual beats, as its text says, or on the strength s_v, as its
        formula does.
    first_beat : "copy" or "drop"
        The first visual beat has no difference R (Eq. 12): it takes that of the second, or is left out.
    matching : "many", "nearest" or "max"
        One visual beat may hit many music beats, or one only: each music beat in turn takes the nearest that is free,
        or as many pairs as possible are made (Eq. 17-18).
    normalisation : "max", "mean" or "raw"
        The strengths of music beats are divided by their maximum, by their mean, or not at all (Eq. 19).
    pattern : BarPattern or None
        For the measure "shape": the expected course of movement, of a dance or one of `HOW_PATTERNS`. None takes the
        waltz's course where the movement recurs most clearly every three beats, and else asks for a rest on each beat.

    Raises
    ------
    ValueError
        For a value out of range, another word, or another kind of value; the message names the field.

    Examples
    --------
    >>> HarmonyParams.paper().reaction_delay, HarmonyParams.recommended().measure
    (0.25, 'shape')
    """

    measure: Literal["shape", "hits"] = "hits"
    audio_threshold: float = 0.1
    visual_threshold: float | None = 1.0
    reaction_delay: float = 0.25
    beta: float = 2.0
    detector: Literal["turns", "valleys", "peaks", "direction"] = "turns"
    fps: float | None = 15.0
    smoothing: float = 0.0
    position_smoothing: float = 0.0
    subframe: bool = False
    lag: float = 0.0
    clock: float = 1.0
    speed: Literal["norm", "signed", "norm_of_sum"] = "norm"
    plateau: Literal["last", "middle", "literal"] = "last"
    saliency: Literal["threshold", "literal"] = "threshold"
    visual_saliency: Literal["difference", "strength"] = "difference"
    first_beat: Literal["copy", "drop"] = "copy"
    matching: Literal["many", "nearest", "max"] = "many"
    normalisation: Literal["max", "mean", "raw"] = "max"
    pattern: BarPattern | None = None

    def __post_init__(self) -> None:
        check_kinds(self)
        for name in ("audio_threshold", "visual_threshold", "reaction_delay", "smoothing", "position_smoothing"):
            if (value := getattr(self, name)) is not None and not 0 <= value < float("inf"):
                raise ValueError(f"{name} must be zero or more{', or None' if 'visual' in name else ''}, got {value}")
        # Of more smoothing no beat is left, and a filter as long would fill the memory; more delay is in milliseconds.
        if (value := max(self.reaction_delay, self.smoothing, self.position_smoothing)) > 10:
            raise ValueError(f"reaction_delay, smoothing and position_smoothing must be at most 10 s, got {value:g}")
        for name in ("beta", "clock", "fps"):
            if (value := getattr(self, name)) is not None and not 0 < value < float("inf"):
                raise ValueError(f"{name} must be positive{' or None' if name == 'fps' else ''}, got {value}")
        if not abs(self.lag) <= MAX_LAG:
            raise ValueError(f"lag must lie within {MAX_LAG:g} s of the beat, got {self.lag:g}")
        if not isinstance(self.pattern, BarPattern | None):
            raise ValueError(f"pattern must be a BarPattern or None, got {self.pattern!r}; see HOW_PATTERNS")
        for name, choices in CHOICES.items():
            if (value := getattr(self, name)) not in choices:
                raise ValueError(f"{name} must be one of {', '.join(choices)}; got {value!r}{GONE.get(str(value), '')}")

    @classmethod
    def paper(cls) -> "HarmonyParams":
        """The paper's settings (Sec. 5.2): the defaults of all fields. ``docs/readings.md`` says how it was read."""
        return cls()

    @classmethod
    def recommended(cls, pattern: BarPattern | None = None) -> "HarmonyParams":
        """The score that we advise: is the movement in time, and where in the beat is it?

        Parameters
        ----------
        pattern : BarPattern or None
            The movement that is meant: one of `HOW_PATTERNS` (rest, hit, half time), or the course of a dance, from
            `harmolab.params.DANCE_PATTERNS` or learnt by `harmolab data learn`. None where nothing is told.
        """
        detector: Literal["peaks", "valleys"] = "peaks" if pattern == HOW_PATTERNS["hit"] else "valleys"
        shape = replace(cls.valleys(), measure="shape", audio_threshold=0.0, beta=1.0, smoothing=0.0)
        return replace(shape, detector=detector, position_smoothing=0.06, pattern=pattern)

    @classmethod
    def valleys(cls) -> "HarmonyParams":
        """Hits of music beats by valleys of the joint speed (rests) within 0.1 s; read it above chance.

        It is the simplest score that sees the beats that were planted in synthetic dances.
        """
        return cls(
            visual_threshold=None, reaction_delay=0.1, detector="valleys", fps=None, smoothing=0.05, subframe=True
        )

    @classmethod
    def playing(cls) -> "HarmonyParams":
        """Hits within 0.05 s of the onset of every note, for the hands of musicians (`playing_score`).

        Of the motion of a whole body the valleys of its joint speed are compared with the onsets: the score of a dance,
        to be read beside that of the hands.
        """
        return replace(cls.valleys(), audio_threshold=0.0, reaction_delay=0.05, beta=1.0)


# Choices that were taken out: the error of one says what took its place.
GONE = MappingProxyType({"pattern": "; the joint speed in the room gave way to that of the shape: measure 'shape'"})
KINDS: Any = {int: Integral, float: Real, float | None: Real | None, bool: bool | np.bool_}


def check_kinds(settings: Any) -> None:
    """ValueError that names the first number, whole number or flag of a dataclass that is of another kind."""
    for field in fields(settings):
        if not isinstance(value := getattr(settings, field.name), KINDS.get(field.type, object)):
            words: dict[Any, str] = {bool: "True or False", int: "a whole number"}
            raise ValueError(f"{field.name} must be {words.get(field.type, 'a number')}, got {value!r}")


CHOICES = MappingProxyType(
    {field.name: get_args(field.type) for field in fields(HarmonyParams) if get_origin(field.type) is Literal}
)
