"""The sound of notes: a plucked timbre for the piano, a bowed one for the violin."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from harmolab.corpora.synthetic.music import Voice
from harmolab.corpora.synthetic.sounds import Mixer, tone
from harmolab.types import Audio, FloatArray, Notes

LONGEST = 6.0  # seconds after which a note has ended
VIBRATO_RATE = 5.5  # hertz
VIBRATO_DEPTH = 0.01  # share of the pitch: 17 cents
TIMBRES = MappingProxyType(
    {
        "piano": Voice((1.0, 0.55, 0.35, 0.2, 0.12, 0.08, 0.05), 1.4, 0.004, 0.2, 1.0),
        "violin": Voice((1.0, 0.8, 0.6, 0.55, 0.35, 0.25, 0.2, 0.15, 0.1, 0.08), 30.0, 0.06, 0.2, 1.0),
    }
)


def rendered_notes(
    notes: Notes, seconds: float, sample_rate: int = 44100, *, instrument: str = "piano", seed: int = 0
) -> Audio:
    """The sound of notes, played on a synthetic instrument.

    Parameters
    ----------
    notes : Notes; those that begin after the end are silent
    seconds : float, length of the sound, at most 3600
    sample_rate : int, hertz, from 8000 to 192000
    instrument : "piano" (dies away) or "violin" (lasts, with vibrato)
    seed : int, of the phases of the vibrato

    Returns
    -------
    Audio, peak 0.9; the amplitude of a note is in proportion to its loudness. No notes are silence.

    Raises
    ------
    ValueError
        For an instrument, length or rate out of range.
    """
    if instrument not in TIMBRES:
        raise ValueError(f"instrument must be {' or '.join(TIMBRES)}, got {instrument!r}")
    if not (8000 <= sample_rate <= 192000 and float(sample_rate).is_integer()):
        raise ValueError(f"sample_rate must be a whole number from 8000 to 192000 Hz, got {sample_rate}")
    if not 1 / sample_rate <= seconds <= 3600:
        raise ValueError(f"seconds must be positive and at most 3600, got {seconds}")
    mixer, timbre = Mixer(seconds, int(sample_rate)), TIMBRES[instrument]
    lengths = (notes.offsets - notes.onsets).clip(2 / mixer.rate, LONGEST)
    phases = vibrato_phases(len(notes), seed) if instrument == "violin" else None
    for pitch in np.unique(notes.pitches):
        numbers = np.flatnonzero(notes.pitches == pitch)
        sound = _tone(int(pitch), float(lengths[numbers].max()), mixer.rate, timbre)
        for number in numbers:
            note = sound if phases is None else _with_vibrato(sound, lengths[number], phases[number], mixer.rate)
            gain = timbre.level * notes.loudness[number]
            mixer.add_note(notes.onsets[number], note, lengths[number], gain, attack=timbre.attack)
    return Audio(mixer.mixed().astype(np.float32), sample_rate)


def vibrato_phases(count: int, seed: int) -> FloatArray:
    """(N,) phase of the vibrato at each onset, radians."""
    return np.random.default_rng([seed, 7]).uniform(0, 2 * np.pi, count)


def _tone(pitch: int, seconds: float, rate: int, timbre: Voice) -> FloatArray:
    """A note of a MIDI pitch; low ones last longer."""
    decay = timbre.decay * 2 ** ((60 - pitch) / 24)
    return tone(440 * 2 ** ((pitch - 69) / 12), seconds, rate, partials=timbre.partials, decay=decay)


def _with_vibrato(sound: FloatArray, seconds: float, phase: float, rate: int) -> FloatArray:
    """The first `seconds` of a note, read at a speed that swings about 1."""
    samples = np.arange(min(round(seconds * rate), sound.size))
    swing = VIBRATO_DEPTH * rate / (2 * np.pi * VIBRATO_RATE)  # samples
    swung = samples + swing * np.sin(2 * np.pi * VIBRATO_RATE * samples / rate + phase)
    return np.interp(swung, np.arange(sound.size), sound)
