"""Music whose beats are planted: a small band (drums, bass, chords, melody) for each of the seven ballroom dances."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.data.synthetic.beats import BeatGrid, ClipSettings, beat_grid
from harmolab.readers.beats import ANNOTATION_RATE
from harmolab.types import Audio, BeatTrack, FloatArray

# Sounds of the band, one hit or note at a time, and the buffer they are mixed in

ATTACK = 0.004  # seconds in which every sound rises, so that none begins with a click


def _seconds(length: float, rate: int) -> FloatArray:
    return np.arange(round(length * rate)) / rate


def _shaped(sound: FloatArray, rate: int, *, attack: float = ATTACK, release: float = 0.02) -> FloatArray:
    """The sound with raised-cosine ends."""
    shaped = sound.copy()
    for seconds, order in ((attack, slice(None)), (release, slice(None, None, -1))):
        ramp = _ramp(min(round(seconds * rate), sound.size))
        shaped[order][: ramp.size] *= ramp
    return shaped


@cache
def _ramp(size: int) -> FloatArray:
    """(size,) raised cosine from 0 to 1."""
    return np.sin(np.linspace(0, np.pi / 2, size)) ** 2


def _noise(size: int, rate: int, low: float, high: float, rng: np.random.Generator) -> FloatArray:
    """White noise between two frequencies (hertz, soft edges), standard deviation 1."""
    spectrum = np.fft.rfft(rng.standard_normal(size))
    pitch = np.fft.rfftfreq(size, 1 / rate)
    top = min(high, 0.45 * rate)
    spectrum *= np.exp(-((np.maximum(low - pitch, 0) / 300) ** 2) - (np.maximum(pitch - top, 0) / 300) ** 2)
    sound = np.fft.irfft(spectrum, size)
    return sound / max(float(sound.std()), 1e-12)


def _skin(rate: int, rng: np.random.Generator, *, pitch: float, drop: float, decay: float, hiss: float) -> FloatArray:
    """A drum head: a sine that falls by `drop` hertz, with a little stick noise."""
    t = _seconds(5 * decay, rate)
    phase = 2 * np.pi * (pitch * t + drop * 0.03 * (1 - np.exp(-t / 0.03)))
    noise = hiss * _noise(t.size, rate, 300, 3000, rng) * np.exp(-t / 0.012)
    return _shaped(np.sin(phase) * np.exp(-t / decay) + noise, rate)


def _rattle(
    rate: int, rng: np.random.Generator, *, low: float, high: float, decay: float, body: float = 0.0
) -> FloatArray:
    """A noise instrument: snare, brush, hi-hat, maracas; `body` adds the snare's drum."""
    t = _seconds(5 * decay, rate)
    sound = 0.35 * _noise(t.size, rate, low, high, rng) * np.exp(-t / decay)
    return _shaped(sound + body * np.sin(2 * np.pi * 190 * t) * np.exp(-t / 0.05), rate)


def _bell(rate: int, rng: np.random.Generator, *, pitches: tuple[float, ...], decay: float) -> FloatArray:
    """Wood or metal: a few inharmonic partials, slightly out of tune from clip to clip."""
    t = _seconds(5 * decay, rate)
    tuning = 1 + 0.02 * rng.standard_normal()
    partials = [np.sin(2 * np.pi * tuning * pitch * t) / (1 + place) for place, pitch in enumerate(pitches)]
    return _shaped(np.sum(partials, axis=0) * np.exp(-t / decay), rate)


DRUMS: Mapping[str, Any] = {
    "kick": (1.0, partial(_skin, pitch=52.0, drop=110.0, decay=0.11, hiss=0.12)),
    "conga": (0.45, partial(_skin, pitch=210.0, drop=30.0, decay=0.07, hiss=0.15)),
    "snare": (0.55, partial(_rattle, low=900, high=7000, decay=0.06, body=0.5)),
    "brush": (0.4, partial(_rattle, low=1500, high=7000, decay=0.05)),
    "hat": (0.3, partial(_rattle, low=5500, high=9500, decay=0.03)),
    "maracas": (0.25, partial(_rattle, low=3500, high=9000, decay=0.025)),
    "clave": (0.3, partial(_bell, pitches=(2350.0,), decay=0.03)),
    "cowbell": (0.22, partial(_bell, pitches=(555.0, 835.0, 1660.0), decay=0.06)),
}


def drum(name: str, rate: int, rng: np.random.Generator) -> FloatArray:
    """(S,) one full hit of a drum of `DRUMS` at its level in the mix."""
    level, strike = DRUMS[name]
    return level * strike(rate, rng)


def tone(pitch: float, seconds: float, rate: int, *, partials: tuple[float, ...], decay: float) -> FloatArray:
    """A plucked or blown note: harmonics that die away, the higher the faster.

    Parameters
    ----------
    pitch : float, hertz
    seconds : float
    rate : int, hertz
    partials : amplitudes of the harmonics from the fundamental up; those above 0.4 `rate` are left out
    decay : float, seconds in which the fundamental falls to 1/e
    """
    t = _seconds(seconds, rate)
    turn = np.exp(t * (2j * np.pi * pitch - 1 / decay))
    sound, wave = np.zeros(t.size), np.ones(t.size, complex)
    for harmonic, amplitude in enumerate(partials, start=1):
        wave = wave * turn
        if harmonic * pitch < 0.4 * rate:
            sound += amplitude * wave.imag
    return sound


class Mixer:
    """A buffer that sounds are added to; it begins two seconds before the clip, for notes that ring into it."""

    before = 2.0

    def __init__(self, seconds: float, rate: int) -> None:
        self.rate, self.size = rate, round(seconds * rate)
        self.buffer = np.zeros(self.size + round(self.before * rate))

    def add(self, time: float, sound: FloatArray, gain: float) -> None:
        """Mix `sound` in at `time` seconds of the clip."""
        first = round((time + self.before) * self.rate)
        if 0 <= first < self.buffer.size:
            part = sound[: self.buffer.size - first]
            self.buffer[first : first + part.size] += gain * part

    def add_note(self, time: float, note: FloatArray, length: float, gain: float, *, attack: float = ATTACK) -> None:
        """Mix in the first `length` seconds of a note, with soft ends."""
        cut = note[: max(round(length * self.rate), 2)]
        self.add(time, _shaped(cut, self.rate, attack=attack, release=0.03), gain)

    def mixed(self) -> FloatArray:
        """(S,) the clip, peak 0.9, faded in and out over 10 ms so that the cuts do not click."""
        clip = _shaped(self.buffer[-self.size :], self.rate, attack=0.01, release=0.01)
        return 0.9 * clip / max(float(np.abs(clip).max()), 1e-9)


@dataclass(frozen=True)
class Groove:
    """The notes of the band in one bar; every string spans the bar, so its length sets the grid.

    Drums and chords: digits are loudness (9 is full), dots rest. Bass: R root, F fifth, O octave, small letters
    softly. `swell` is the loudness of each beat of the bar, `minor` the mode.
    """

    drums: MappingProxyType[str, str]
    bass: str
    chords: str
    swell: tuple[float, ...]
    minor: bool = False


def _groove(bass: str, chords: str, swell: tuple[float, ...], *, minor: bool = False, **drums: str) -> Groove:
    return Groove(MappingProxyType(drums), bass, chords, swell, minor)


# Accents follow the dance's usual count: cha-cha "one, two, three, four-and", samba with its surdo on two, jive with a
# swung hi-hat and back beat, quickstep and waltz as low note and after-beats, tango marcato on every beat.
GROOVES: Mapping[str, Groove] = {
    "cha-cha": _groove(
        "R.....F.R.....F.", "7...5...7...5.5.", (1.0, 0.8, 0.85, 0.9),
        kick="9...5...8...6...", cowbell="8...6...7...6...", maracas="5.2.5.2.5.2.5.2.", conga="....6.......6.5.",
    ),
    "jive": _groove(
        "R..F..O..F..", "6.....5.....", (1.0, 0.85, 0.9, 0.85),
        kick="9..5..8..5..", snare="...7.....7..", hat="6..6.36..6.3",
    ),
    "quickstep": _groove(
        "R...F...", "..5...5.", (1.0, 0.8, 0.9, 0.8),
        kick="9.4.8.4.", brush="5.7.5.7.", hat="4.4.4.4.",
    ),
    "rumba": _groove(
        "R.....F.R...F...", "7...4...6...4...", (1.0, 0.8, 0.85, 0.85),
        kick="9...5...8...6...", clave="8...5...6...6...", maracas="5.2.5.2.5.2.5.2.", conga="....5.....3.6.3.",
    ),
    "samba": _groove(
        "R..fF..rR..fF..r", "6.....4.6.....4.", (1.0, 0.9, 0.9, 0.9), minor=True,
        kick="8...9...7...9...", maracas="7.237.237.237.23", snare="6..16..16..16..1",
    ),
    "tango": _groove(
        "R...R...F...R...", "8...6...7...6...", (1.0, 0.8, 0.9, 0.8), minor=True,
        kick="9...6...8...6...", snare="5...4...5...4.34", hat="3...3...3...3...",
    ),
    "waltz": _groove(
        "R...........", "....6...6...", (1.0, 0.75, 0.75),
        kick="9...5...5...", brush="4...6...6...", hat="3...5...5...",
    ),
}  # fmt: skip

# Semitones above the key, one chord per bar; the second number tells major (4) from minor (3).
MAJOR_SONGS = (((0, 4), (9, 3), (5, 4), (7, 4)), ((0, 4), (7, 4), (9, 3), (5, 4)), ((0, 4), (5, 4), (7, 4), (0, 4)))
MINOR_SONGS = (((0, 3), (5, 3), (7, 4), (0, 3)), ((0, 3), (8, 4), (3, 4), (10, 4)), ((0, 3), (10, 4), (8, 4), (7, 4)))

Chords = tuple[tuple[int, int], ...]

# Rhythm of the melody, in half beats of a bar; each piece keeps to one.
MELODIES = MappingProxyType({3: ("7...6.", "7.6.5."), 4: ("7...6.5.", "7.5.6...")})


@dataclass(frozen=True, eq=False)
class PlantedMusic:
    """Music and the truth about it: every beat with its accent, the downbeats, and the grid beyond the clip."""

    audio: Audio
    beats: BeatTrack
    downbeat_times: FloatArray
    grid: BeatGrid


def synthetic_music(dance: str, **settings: Any) -> PlantedMusic:
    """Music for a dance, with the beats that were planted in it.

    Parameters
    ----------
    dance : str, one of `params.DANCES`
    **settings
        seconds, tempo, drift, sample_rate and seed, as in `ClipSettings`. The seed sets tempo, key, chords, melody and
        where in the bar the clip starts.

    Returns
    -------
    PlantedMusic; the strengths of its beats are the accents of the bar (downbeat 1).

    Raises
    ------
    ValueError
        For an unknown dance or a setting out of range.
    """
    return planted_music(ClipSettings(dance, **settings))


def planted_music(settings: ClipSettings) -> PlantedMusic:
    """The music of a clip, with the beats that were planted in it."""
    grid, rate = beat_grid(settings), settings.sample_rate
    samples = _play(settings.dance, grid, settings.seconds, rate, np.random.default_rng([settings.seed, 3]))
    inside = grid.inside(settings.seconds)
    accents = np.array(GROOVES[settings.dance].swell)[grid.positions]
    beats = BeatTrack(grid.times[inside], accents[inside], ANNOTATION_RATE, samples.size / rate)
    return PlantedMusic(Audio(samples, rate), beats, grid.times[inside & (grid.positions == 0)], grid)


@dataclass(frozen=True)
class _Step:
    """One sounding place of a pattern, on the clip's time line (seconds)."""

    time: float
    length: float
    bar: int
    mark: str
    accent: float


def _steps(pattern: str, grid: BeatGrid, swell: tuple[float, ...]) -> list[_Step]:
    """The places of the grid at which the pattern of one bar sounds; a place lasts until the next one."""
    per_beat = len(pattern) // grid.meter
    places = [place for place, mark in enumerate(pattern) if mark != "."]
    gaps = np.diff([*places, places[0] + len(pattern)])
    counts = np.arange(grid.times.size)
    steps = []
    for bar, start in enumerate(range(grid.first_downbeat, grid.times.size - 2 * grid.meter, grid.meter)):
        for place, gap in zip(places, gaps, strict=True):
            time, until = np.interp(start + np.array([place, place + gap]) / per_beat, counts, grid.times)
            steps.append(_Step(time, until - time, bar, pattern[place], swell[place // per_beat]))
    return steps


def _play(dance: str, grid: BeatGrid, seconds: float, rate: int, rng: np.random.Generator) -> FloatArray:
    """(S,) samples of the whole band."""
    groove, key = GROOVES[dance], int(rng.integers(0, 12))
    songs = MINOR_SONGS if groove.minor else MAJOR_SONGS
    chords = songs[rng.integers(len(songs))]
    mixer = Mixer(seconds, rate)
    for name, pattern in groove.drums.items():
        hit = drum(name, rate, rng)
        for step in _steps(pattern, grid, groove.swell):
            mixer.add(step.time, hit, int(step.mark) / 9 * step.accent)
    for notes, voice in _voices(groove, grid, key, chords, rng):
        _sing(mixer, notes, voice)
    return mixer.mixed()


@dataclass(frozen=True)
class Voice:
    """A pitched instrument: harmonics, decay and attack in seconds, level, and how much of its time a note sounds."""

    partials: tuple[float, ...]
    decay: float
    attack: float
    level: float
    legato: float


BASS = Voice((1.0, 0.6, 0.25, 0.1), 0.5, 0.006, 0.5, 0.9)
CHORDS = Voice((1.0, 0.45, 0.3, 0.15, 0.08), 0.35, 0.006, 0.13, 0.6)
MELODY = Voice((1.0, 0.25, 0.3, 0.05), 0.9, 0.025, 0.16, 0.95)

Note = tuple[_Step, int]  # and its pitch, as a MIDI number


def _voices(
    groove: Groove, grid: BeatGrid, key: int, chords: Chords, rng: np.random.Generator
) -> list[tuple[list[Note], Voice]]:
    """The notes of bass, chords and melody."""
    bass, accompaniment, melody = [], [], []
    for step in _steps(groove.bass, grid, groove.swell):
        root = 33 + (key + chords[step.bar % len(chords)][0]) % 12
        bass.append((step, root + {"R": 0, "F": 7, "O": 12}[step.mark.upper()]))
    for step in _steps(groove.chords, grid, groove.swell):
        accompaniment += [(step, pitch) for pitch in _triad(step.bar, key, chords, 55)]
    for step in _steps(MELODIES[grid.meter][rng.integers(2)], grid, groove.swell):
        melody.append((step, int(rng.choice(_triad(step.bar, key, chords, 67)))))
    return [(bass, BASS), (accompaniment, CHORDS), (melody, MELODY)]


def _triad(bar: int, key: int, chords: Chords, lowest: int) -> list[int]:
    """Three MIDI pitches within the octave above `lowest`, so that chords lead smoothly into each other."""
    root, third = chords[bar % len(chords)]
    return [lowest + (key + root + interval - lowest) % 12 for interval in (0, third, 7)]


def _sing(mixer: Mixer, notes: list[Note], voice: Voice) -> None:
    """Mix in the notes of one voice; each pitch is computed once, at its greatest length."""
    longest = max(step.length for step, _ in notes) * voice.legato
    sounds: dict[int, FloatArray] = {}
    for step, pitch in notes:
        if pitch not in sounds:
            hertz = 440 * 2 ** ((pitch - 69) / 12)
            sounds[pitch] = tone(hertz, longest, mixer.rate, partials=voice.partials, decay=voice.decay)
        gain = voice.level * step.accent * _loudness(step.mark)
        mixer.add_note(step.time, sounds[pitch], step.length * voice.legato, gain, attack=voice.attack)


def _loudness(mark: str) -> float:
    if mark.isdigit():
        return int(mark) / 9
    return 1.0 if mark.isupper() else 0.4
