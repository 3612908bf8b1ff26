"""Sounds of a small dance band, one hit or note at a time, and the buffer they are mixed in."""

from __future__ import annotations

from functools import partial
from types import MappingProxyType

import numpy as np

from harmolab.types import FloatArray

ATTACK = 0.004  # seconds in which every sound rises, so that none begins with a click


def _seconds(length: float, rate: int) -> FloatArray:
    return np.arange(round(length * rate)) / rate


def _shaped(sound: FloatArray, rate: int, *, attack: float = ATTACK, release: float = 0.02) -> FloatArray:
    """The sound with raised-cosine ends."""
    ends = np.ones(sound.size)
    for seconds, order in ((attack, slice(None)), (release, slice(None, None, -1))):
        ramp = np.sin(np.linspace(0, np.pi / 2, min(round(seconds * rate), sound.size))) ** 2
        ends[order][: ramp.size] *= ramp
    return sound * ends


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


DRUMS = MappingProxyType(
    {
        "kick": (1.0, partial(_skin, pitch=52.0, drop=110.0, decay=0.11, hiss=0.12)),
        "conga": (0.45, partial(_skin, pitch=210.0, drop=30.0, decay=0.07, hiss=0.15)),
        "snare": (0.55, partial(_rattle, low=900, high=7000, decay=0.06, body=0.5)),
        "brush": (0.4, partial(_rattle, low=1500, high=7000, decay=0.05)),
        "hat": (0.3, partial(_rattle, low=5500, high=9500, decay=0.03)),
        "maracas": (0.25, partial(_rattle, low=3500, high=9000, decay=0.025)),
        "clave": (0.3, partial(_bell, pitches=(2350.0,), decay=0.03)),
        "cowbell": (0.22, partial(_bell, pitches=(555.0, 835.0, 1660.0), decay=0.06)),
    }
)


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
