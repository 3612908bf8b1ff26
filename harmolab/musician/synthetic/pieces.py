"""Pieces that follow from a seed: two voices for a pianist, one for a violinist."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.signal import lfilter

from harmolab.data.synthetic.music import Mixer, tone
from harmolab.data.synthetic.music import Voice as SoundVoice
from harmolab.readers.player_points import INSTRUMENTS
from harmolab.types import Audio, FloatArray, IntArray, Notes

TEMPI = (66.0, 112.0)  # beats per minute
METER = 4
SWELL_BEATS = 16  # beats of one swell of the loudness
REST = 0.5  # seconds without an onset at either end of a piece
MODES = ((0, 2, 4, 5, 7, 9, 11), (0, 2, 3, 5, 7, 8, 11), (0, 2, 3, 5, 7, 9, 10))  # major, harmonic minor, Dorian
STEPS = np.arange(-5, 6)  # of a melody, in degrees of its scale
STEP_CHANCES = np.array([0.02, 0.04, 0.07, 0.15, 0.2, 0.04, 0.2, 0.15, 0.07, 0.04, 0.02])
RETURN = 0.78  # share of its way from the middle of the range that a melody keeps from note to note

Rhythms = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Voice:
    """One line of a piece.

    Parameters
    ----------
    lowest, highest : int, MIDI numbers between which it moves
    rhythms : lengths of notes in beats, one group after another drawn from these; all groups are equally long
    legato : float, share of its time that a note sounds
    accent : float, loudness of a downbeat over that of the other beats
    hand : int, as in `Notes.hands`
    """

    lowest: int
    highest: int
    rhythms: Rhythms
    legato: float
    accent: float
    hand: int


RIGHT_HAND: Rhythms = (
    (1.0,), (0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (0.25, 0.25, 0.5), (0.5, 0.25, 0.25), (0.25, 0.25, 0.25, 0.25),
)  # fmt: skip
LEFT_HAND: Rhythms = ((2.0,), (1.0, 1.0), (1.0, 1.0), (0.5, 0.5, 0.5, 0.5), (1.5, 0.5))
# An even number of notes in each bar: bows alternate, and so every bar begins with a down-bow.
BOWED: Rhythms = (
    (2.0, 2.0), (1.0, 1.0, 1.0, 1.0), (1.5, 0.5, 1.0, 1.0), (2.0, 1.0, 0.5, 0.5), (1.0, 0.5, 0.5, 2.0),
    (1.0, 1.0, 0.5, 0.5, 0.5, 0.5), (0.5, 0.5, 0.5, 0.5, 1.0, 1.0), (0.5, 0.5, 1.0, 1.0, 0.5, 0.5),
    (0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5),
)  # fmt: skip
VOICES = MappingProxyType(
    {
        "piano": (Voice(36, 60, LEFT_HAND, 0.9, 1.1, hand=0), Voice(62, 88, RIGHT_HAND, 0.9, 1.1, hand=1)),
        "violin": (Voice(55, 90, BOWED, 1.0, 1.25, hand=-1),),
    }
)


@dataclass(frozen=True, eq=False)
class PlantedPiece:
    """The notes of a piece, the beginnings of its bars (seconds) and the length of its beat (seconds)."""

    notes: Notes
    downbeats: FloatArray
    beat: float


def planted_piece(instrument: str, seconds: float, seed: int) -> PlantedPiece:
    """A piece in four, of one tempo; its loudness swells over 16 beats.

    Parameters
    ----------
    instrument : "piano" (left hand MIDI 36 to 60, right hand 62 to 88) or "violin" (55 to 90)
    seconds : float; the first onset is at 0.5 s, and the last one 0.5 s or more before the end
    seed : int; a longer piece of the same seed begins with the same notes

    Raises
    ------
    ValueError
        For another instrument, or less than a second.
    """
    if instrument not in VOICES:
        raise ValueError(f"instrument must be {' or '.join(INSTRUMENTS)}, got {instrument!r}")
    if not 2 * REST <= seconds < np.inf:
        raise ValueError(f"a piece begins and ends with {REST} s of rest, so it lasts at least 1 s, got {seconds} s")
    rng = np.random.default_rng([seed, INSTRUMENTS.index(instrument)])
    beat = 60 / rng.uniform(*TEMPI)
    scale = (np.array(MODES[rng.integers(len(MODES))]) + rng.integers(12)) % 12
    swell = rng.uniform(0, 2 * np.pi)
    last = (seconds - 2 * REST) / beat + 1e-9  # beats from the first onset to the last one possible
    lines = []
    for voice in VOICES[instrument]:
        starts, lengths = _rhythm(voice, last, rng.spawn(1)[0])
        onsets, offsets = REST + beat * starts, REST + beat * (starts + voice.legato * lengths)
        pitches = _melody(voice, scale, starts.size, rng.spawn(1)[0])
        loudness = _loudness(voice, starts, swell, rng.spawn(1)[0])
        hands = np.full(starts.size, voice.hand)
        lines.append((onsets, np.minimum(offsets, seconds), pitches, loudness, hands))
    columns = [np.concatenate(parts) for parts in zip(*lines, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    notes = Notes(*(column[order] for column in columns))
    return PlantedPiece(notes, REST + beat * np.arange(0, last, METER), beat)


def _rhythm(voice: Voice, last: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(N,) starts and lengths of the notes that begin up to beat `last`, in beats."""
    groups = int(last // sum(voice.rhythms[0])) + 1
    lengths = np.concatenate([voice.rhythms[number] for number in rng.integers(len(voice.rhythms), size=groups)])
    starts = np.cumsum(lengths) - lengths
    return starts[starts <= last], lengths[starts <= last]


def _melody(voice: Voice, scale: IntArray, count: int, rng: np.random.Generator) -> IntArray:
    """(N,) pitches of a walk on a scale; it is drawn to the middle of the voice's range and turns back at its ends."""
    ladder = np.arange(voice.lowest, voice.highest + 1)
    ladder = ladder[np.isin(ladder % 12, scale)]
    steps = rng.choice(STEPS, size=count, p=STEP_CHANCES)
    walk = np.rint(ladder.size / 2 + lfilter([1.0], [1.0, -RETURN], steps)).astype(np.int64)
    round_trip = walk % (2 * (ladder.size - 1))
    return ladder[np.minimum(round_trip, 2 * (ladder.size - 1) - round_trip)]


def _loudness(voice: Voice, starts: FloatArray, swell: float, rng: np.random.Generator) -> FloatArray:
    """(N,) loudness: a slow swell, louder downbeats, and 4 % of chance."""
    accents = np.where(starts % METER < 1e-6, voice.accent, 1.0)
    swelling = 0.55 + 0.22 * np.sin(2 * np.pi * starts / SWELL_BEATS + swell)
    return np.asarray(swelling * accents * rng.uniform(0.96, 1.04, starts.size)).clip(0, 1)


# The sound of notes: a plucked timbre for the piano, a bowed one for the violin.

LONGEST = 6.0  # seconds after which a note has ended
VIBRATO_RATE = 5.5  # hertz
VIBRATO_DEPTH = 0.01  # share of the pitch: 17 cents
TIMBRES = MappingProxyType(
    {
        "piano": SoundVoice((1.0, 0.55, 0.35, 0.2, 0.12, 0.08, 0.05), 1.4, 0.004, 0.2, 1.0),
        "violin": SoundVoice((1.0, 0.8, 0.6, 0.55, 0.35, 0.25, 0.2, 0.15, 0.1, 0.08), 30.0, 0.06, 0.2, 1.0),
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


def _tone(pitch: int, seconds: float, rate: int, timbre: SoundVoice) -> FloatArray:
    """A note of a MIDI pitch; low ones last longer."""
    decay = timbre.decay * 2 ** ((60 - pitch) / 24)
    return tone(440 * 2 ** ((pitch - 69) / 12), seconds, rate, partials=timbre.partials, decay=decay)


def _with_vibrato(sound: FloatArray, seconds: float, phase: float, rate: int) -> FloatArray:
    """The first `seconds` of a note, read at a speed that swings about 1."""
    samples = np.arange(min(round(seconds * rate), sound.size))
    swing = VIBRATO_DEPTH * rate / (2 * np.pi * VIBRATO_RATE)  # samples
    swung = samples + swing * np.sin(2 * np.pi * VIBRATO_RATE * samples / rate + phase)
    return np.interp(swung, np.arange(sound.size), sound)
