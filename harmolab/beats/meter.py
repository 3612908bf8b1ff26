"""Strong and weak beats, their grouping into meter units (paper Sec. 4.1, Fig. 6, Eq. 22), and "one" of the bar.

m_e(b) of Eq. 22 is 1 for a strong beat and 0 for a weak one. "One" is the first beat of a bar.
"""

from dataclasses import dataclass, replace

import numpy as np

from harmolab.beats.audio import LATENESS, onset_envelope
from harmolab.beats.tempo import STEADY
from harmolab.types import SURE, Audio, BeatTrack, BoolArray, FloatArray, Record, check_kind, usual_meter

COURSE = 8  # beats over which the tempo of a moment is told
MOMENTS, FEWEST = 4, 24  # of a beat at which onsets are heard; beats of music whose bar can be heard
ONE_WAY = 0.9  # part of its whole range that a tempo has moved by, from start to end, where it goes one way

# Accent pattern (True = strong) -> signature. Three types in four categories, as Sec. 4.1 counts them: a quarter-note
# meter opens on a strong beat and is split by its inner strong beats, 4 = 2+2 or 4, 5 = 3+2, 6 = 3+3.
CATEGORIES: dict[tuple[bool, ...], str] = {
    (True, False, True, False): "4/4",
    (True, False, False, False): "4/4",
    (True, False, False, True, False): "5/4",
    (True, False, False, True, False, False): "6/4",
}


@dataclass(frozen=True, eq=False)
class MeterUnit(Record):
    """A meter unit (MU): four to six beats in a row with the accents of a bar (paper Sec. 4.1, Fig. 6).

    Parameters
    ----------
    start, end : float, seconds
        From its first beat to the beat after its last.
    strong : (B,) bool array
        True for each of its beats that is strong (Eq. 22).
    signature : str
        "4/4", "5/4" or "6/4".

    Raises
    ------
    ValueError
        If it does not end after it starts.
    """

    start: float
    end: float
    strong: BoolArray
    signature: str

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"a meter unit must end after it starts, got {self.start} to {self.end} s")
        strong = np.array(self.strong, bool)
        strong.setflags(write=False)
        object.__setattr__(self, "strong", strong)


def strong_beats(strengths: FloatArray) -> BoolArray:
    """Strong beats m_e(b): those that are stronger than the beat before (Eq. 22).

    Parameters
    ----------
    strengths : (B,) array, such as `BeatTrack.strengths`

    Returns
    -------
    (B,) bool array; the first beat, which has none before it, is weak

    Examples
    --------
    >>> strong_beats(np.array([1.0, 3.0, 2.0, 2.5]))
    array([False,  True, False,  True])
    """
    return np.diff(strengths, prepend=np.inf) > 0


def cycle_of_meter(meter: int | None) -> int:
    """Beats of the cycle after which movement may recur: half a bar in even meters, the bar in odd ones, else one."""
    if meter is None:
        return 1
    return 2 if meter % 2 == 0 else meter


def with_one(track: BeatTrack, seconds: float, meter: int) -> BeatTrack:
    """The beats with their places in the bar, counted from a moment at which a bar is known to begin.

    The beat nearest to `seconds` gets place 0, and the others are counted from it.

    Parameters
    ----------
    track : BeatTrack of two beats or more
        All beats of the music: one that is left out would move the bars.
    seconds : float
        A moment of the music at which a bar begins.
    meter : int
        Beats in a bar: 3 for a waltz.

    Returns
    -------
    BeatTrack

    Raises
    ------
    ValueError
        With fewer than two beats, when no beat lies within half a beat of `seconds`, or for a meter below 1.

    Examples
    --------
    >>> beats = BeatTrack([0.5, 1.0, 1.5, 2.0], [1.0, 1.0, 1.0, 1.0], 100.0, 3.0)
    >>> with_one(beats, 1.04, 3).bar_places
    array([2, 0, 1, 2])
    """
    check_kind(track, BeatTrack)
    if meter < 1:
        raise ValueError(f"a bar has one beat or more, got {meter}")
    if len(track) < 2:
        raise ValueError(f'"one" needs two beats or more to count from, this music has {len(track)}')
    nearest = int(np.abs(track.times - seconds).argmin())
    if not abs(track.times[nearest] - seconds) <= 30.0 / track.tempo:
        first, last = track.times[[0, -1]]
        raise ValueError(f'"one" at {seconds:g} s: no beat is near; the beats lie from {first:.1f} to {last:.1f} s')
    return replace(track, bar_places=(np.arange(len(track)) - nearest) % meter)


def threes(audio: Audio, track: BeatTrack) -> float:
    """Excess of repetition every third beat of music over that every fourth: above 0 it is in 3/4. From -1.3 to 1.5.

    It is the correlation of the onset strength around four moments of each beat with that of 3 and 6 beats later, less
    that with 4 and 8 beats later; 0 for music of less than 24 beats.
    """
    if len(track) < FEWEST:
        return 0.0
    envelope, rate = onset_envelope(audio)
    borders = np.interp(np.arange(0, len(track) - 1 + 0.5 / MOMENTS, 1 / MOMENTS), np.arange(len(track)), track.times)
    borders -= np.diff(borders).mean() / 2
    # Sums, not samples: how high a sample is depends on where it lies in its onset.
    sums = np.interp(borders, (np.arange(envelope.size) + 0.5 - LATENESS) / rate, np.cumsum(envelope))
    onsets = np.diff(sums).reshape(-1, MOMENTS)
    onsets -= onsets.mean(axis=0)

    def repeated(lag: int) -> float:
        products = (onsets[lag:] * onsets[:-lag]).sum()
        return float(products / max(np.sqrt((onsets[lag:] ** 2).sum() * (onsets[:-lag] ** 2).sum()), 1e-12))

    return (repeated(3) + repeated(6) - repeated(4) - repeated(8)) / 2


def describe_beats(track: BeatTrack) -> str:
    """One line in words about the beats of music: their tempo, how steady or sure they are, and whether bars are known.

    Beats that no program tracked are called annotated. ValueError unless a BeatTrack is passed.

    >>> describe_beats(BeatTrack([0.5, 1.0, 1.5], [1.0, 1.0, 1.0], 100.0, 3.0, [0, 1, 2]))
    'annotated, 120.0 bpm; "one" known, 3 beats a bar'
    """
    check_kind(track, BeatTrack)
    if track.times.size < 2:
        return "no beats" if track.times.size == 0 else "one beat: no tempo"
    places = track.bar_places
    one = '"one": not known' if places is None else f'"one" known, {usual_meter(places)} beats a bar'
    if track.quality is None and track.is_sure:
        return f"annotated, {track.tempo:.1f} bpm; {one}"
    return f"{track.tempo:.1f} bpm, {_steadiness(track)}; {one}"


def _steadiness(track: BeatTrack) -> str:
    """Steadiness of tracked beats in words, or a warning that the sound does not keep to them."""
    quality = track.quality or 0.0
    if not quality and track.times.size < FEWEST:
        return "too few beats to call it steady"
    if track.fit is not None and track.fit < SURE:
        seconds = float(np.ptp(track.times))
        lost = (1 - track.fit) * seconds
        return f"unsure: in about {lost:.0f} of {seconds:.0f} s the sound does not keep to these beats"
    share, course = f"({quality:.0%} of tracked beats on one grid)", _course(track.times)
    if quality >= STEADY and not course:
        return f"steady {share}"
    return f"not steady {share}, followed beat by beat{course}"


def _course(times: FloatArray) -> str:
    """From where to where a tempo goes, eight beats at a time; nothing where it stays within one beat a minute."""
    tempi = 60 * COURSE / (times[COURSE:] - times[:-COURSE])
    if not tempi.size or np.ptp(tempi) < 1:
        return ""
    if abs(tempi[-1] - tempi[0]) >= ONE_WAY * np.ptp(tempi):
        return f" from {tempi[0]:.0f} to {tempi[-1]:.0f} bpm"
    return f" between {tempi.min():.0f} and {tempi.max():.0f} bpm"


def meter_units(track: BeatTrack) -> tuple[MeterUnit, ...]:
    """The meter units of a beat track: groups of four to six beats with the accents of a bar (paper Sec. 4.1, Fig. 6).

    From each beat on the longest group is taken whose accents fit one of these, S a strong beat and w a weak one
    (Eq. 22): ``SwSw`` and ``Swww`` (4/4), ``SwwSw`` (5/4), ``SwwSww`` (6/4). A beat at which none fits is passed over.

    Parameters
    ----------
    track : BeatTrack with the strengths of its beats

    Returns
    -------
    tuple of MeterUnit
        In order and without overlap. A unit ends with the beat after it, so that the last unit needs this beat, too.

    Raises
    ------
    ValueError
        Unless a BeatTrack is passed.

    Examples
    --------
    >>> strengths = [1.0, 3.0, 1.0, 2.0, 1.0, 3.0, 1.0]
    >>> (unit,) = meter_units(BeatTrack(np.arange(7) / 2, strengths, 100.0, 4.0))
    >>> unit.signature, unit.start, unit.end
    ('4/4', 0.5, 2.5)
    """
    check_kind(track, BeatTrack)
    strong, last = strong_beats(track.strengths), track.times.size - 1
    units: list[MeterUnit] = []
    beat = 0
    while beat < last:
        accents = (tuple(strong[beat : beat + length].tolist()) for length in (6, 5, 4))
        longest = next((marks for marks in accents if marks in CATEGORIES), ())
        after = beat + max(len(longest), 1)
        if longest and after <= last:
            start, end = track.times[[beat, after]].tolist()
            units.append(MeterUnit(start, end, np.array(longest), CATEGORIES[longest]))
        beat = after
    return tuple(units)
