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
    """Usual course of shape speed through a cycle of beats, as a short Fourier series.

    The expected (normalised) speed at beat position x is ``sum_h cosines[h-1] cos(2 pi h x / beats) + sines[h-1]
    sin(2 pi h x / beats)``; x = 0 is the cycle's first beat. Plain tuples, so that patterns compare and print.

    Parameters
    ----------
    beats : int, length of the cycle
    cosines, sines : tuples of H floats
    source : str, what it was learnt on
    dance : str, name of the dance; "" when unknown
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
        """Slowest on every beat, fastest half way between: movements that end on the beat."""
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
    """Every choice a harmony score depends on. ``paper()`` is the paper; ``recommended()`` is what we advise.

    Parameters
    ----------
    measure : "shape" or "hits"
        "shape" judges the shape of the body: in time, and where in the beat (see `harmolab.verdict.judge`). "hits"
        counts music beats with a visual beat close by (Eq. 14-21).
    audio_threshold : float
        lambda_1 of Eq. 11, in standard deviations.
    visual_threshold : float or None
        lambda_2 of Eq. 13; None keeps every visual beat.
    reaction_delay : float, seconds
        T_delay of Eq. 18; a beat exactly this far away is still a hit. At most 10, as smoothing is.
    beta : float
        Weight of Eq. 20; above 1 favours the music's beats.
    detector : which moments of a motion are visual beats
        "turns" of the joint speed (Eq. 8-9), its "valleys" or "peaks" alone, or "direction" (motion SD).
    fps : float or None, hertz
        Rate the motion is resampled to (linearly) first; None keeps its own.
    smoothing : float, seconds
        Standard deviation of the Gaussian that smooths the speed curve, at most 10; 0 leaves it alone.
    position_smoothing : float, seconds
        The same for the joint positions before the speed is taken: what sensor noise calls for.
    subframe : bool
        Place visual beats between frames: a frame difference belongs half a frame before its frame, and an extremum to
        the top of the parabola through three samples; motion below 120 hertz is interpolated by cubic splines first.
        Makes beat times independent of the frame rate.
    lag : float, seconds
        How much later than the music's beats the visual ones are expected, at most 2; taken off before scoring.
    clock : float
        Time stretch of the motion: its times are multiplied by this (1.013 fits most Tang 2018 recordings).
    speed, plateau, saliency, visual_saliency, first_beat, matching, normalisation
        Readings of unclear equations, see ``docs/readings.md``. Defaults are the paper mode's.
    pattern : BarPattern or None
        Expected course of speed through a cycle of beats, for the measure "shape". None takes the waltz where the
        movement recurs every three beats and else asks for rests.
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
        """The paper's settings (Sec. 5.2) under the readings of ``docs/readings.md``."""
        return cls()

    @classmethod
    def recommended(cls, pattern: BarPattern | None = None) -> "HarmonyParams":
        """In time, and where: what we advise.

        ``pattern`` is what is told: the dance's, of `DANCE_PATTERNS` or `harmolab data learn`, or one of
        `HOW_PATTERNS`.
        """
        detector: Literal["peaks", "valleys"] = "peaks" if pattern == HOW_PATTERNS["hit"] else "valleys"
        shape = replace(cls.valleys(), measure="shape", audio_threshold=0.0, beta=1.0, smoothing=0.0)
        return replace(shape, detector=detector, position_smoothing=0.06, pattern=pattern)

    @classmethod
    def valleys(cls) -> "HarmonyParams":
        """Chance-corrected hits of speed valleys within 0.1 s: the simplest score that sees planted beats."""
        return cls(
            visual_threshold=None, reaction_delay=0.1, detector="valleys", fps=None, smoothing=0.05, subframe=True
        )

    @classmethod
    def playing(cls) -> "HarmonyParams":
        """Chance-corrected hits within 0.05 s of every onset: for the events of hands at an instrument.

        Of a whole motion they are those of its joint speed's valleys: the score of a dance, beside that of the hands.
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
