"""The form of a song, which a choreographer hears besides its beats: loud and quiet parts, silences, the end.

==========  ==========================================================================================================
loud        each beat aims at a rank of speed in the body: low where the song is quiet or slow, high where loud or fast
silent      the pose is held: the beat counter stands still
at its end  the last beat is danced slowly, in the time of two or more, and the dance comes to rest
==========  ==========================================================================================================
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.ndimage import binary_opening, gaussian_filter1d

from harmolab.systems.choreographer.lay import SLACK, MusicBeats
from harmolab.types import Audio, BoolArray, FloatArray

HOP = 0.05  # seconds of sound whose loudness is one number
NOTHING, FAINT = -55.0, 30.0  # decibels of full scale, and below the median of what sounds, at which there is silence
# Where no moment reaches the first (decibels of full scale), silence is so far below the loudest one, or at the last.
QUIET, BELOW, LEAST = -42.0, 32.0, -100.0
# Seconds that a silence lasts at least, and beats of it, since slow music pauses between two beats.
SILENCE, SILENT_BEATS = 1.0, 1.5
BLINK = 1.0  # seconds of sound that a silence may have in it
SMOOTHING = 0.6  # seconds, standard deviation, of the loudness
NARROW, WIDE = 5.0, 20.0  # decibels of range: below the first loudness hardly counts; more than the second is not used
SECTION, MOST_TOLD = 4.0, 8  # seconds that a quiet or a loud part lasts at least; parts that are told
SPREAD = 0.8  # of the ranks, from the quietest to the loudest beat
LIVELIER = 0.35  # ranks that a tempo twice the usual one aims higher
PACE = 0.15  # of the logarithm of a tempo over the usual one, by which movement is quickened or slowed
EASE = 1.25  # seconds that the last beat of a dance takes at least
NEAR = 0.25  # beats by which a beat may lie in a silence that it begins or ends

Rows = list[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Form:
    """The loudness of a song over time.

    Parameters
    ----------
    loudness : (L,) array, decibels of full scale, smoothed, one every `HOP` seconds; none where there is no sound
    sounds : (L,) bool array, False where nothing is heard
    """

    loudness: FloatArray
    sounds: BoolArray

    @classmethod
    def of(cls, audio: Audio) -> Self:
        """The form of a whole recording; one without any sound has none: its beats were told, and are danced."""
        size = max(1, round(HOP * audio.sample_rate))
        squares = np.pad(np.square(audio.samples, dtype=np.float64), (0, -audio.samples.size % size))
        power = squares.reshape(-1, size).mean(axis=1)
        level = _decibels(power)
        sounds = level > (NOTHING if level.max() > QUIET else max(level.max() - BELOW, LEAST))
        if not sounds.any():
            return cls(np.zeros(0), np.zeros(0, bool))
        sounds &= level > np.median(level[sounds]) - FAINT
        power, share = (gaussian_filter1d(part, SMOOTHING / HOP) for part in (power, sounds.astype(np.float64)))
        loudness = _decibels(power[sounds] / share[sounds])
        return cls(np.interp(np.arange(sounds.size), np.flatnonzero(sounds), loudness), sounds)

    def silences(self, period: float) -> Rows:
        """Seconds from and to which the song is silent, for music of a beat every `period` seconds."""
        silent = _lasting(~self.sounds, max(SILENCE, SILENT_BEATS * period))
        return _rows(~_lasting(~silent, BLINK))

    @property
    def range(self) -> tuple[float, float]:
        """Decibels of the quiet and of the loud parts of what sounds (5th and 95th percentile)."""
        low, high = np.percentile(self.loudness[self.sounds], (5, 95)).tolist()
        return max(low, high - WIDE), high

    def ranks(self, music: MusicBeats, usual: float) -> FloatArray:
        """Ranks of speed (M,) to aim at; a beat of `usual` seconds and of middle loudness aims at the middle."""
        low, high = self.range
        middles = music.times[:-1] + music.lengths / 2
        loud = np.interp(middles / HOP - 0.5, np.arange(self.loudness.size), self.loudness)
        level = np.clip((loud - low) / max(high - low, 1e-9), 0, 1) - 0.5
        middle = 0.5 + LIVELIER * np.log2(usual / music.period)
        return np.clip(middle + SPREAD * min(1.0, (high - low) / NARROW) ** 2 * level, 0, 1)

    def parts(self, period: float) -> list[tuple[float, float, str]]:
        """Seconds from and to of what is quiet, loud, or silent; of a narrow range nothing is either of the former."""
        silences, parts = self.silences(period), []
        if self.sounds.any() and np.diff(self.range) >= NARROW:
            loud = _lasting(~_lasting(self.loudness < np.mean(self.range), SECTION), SECTION)
            parts = [(*row, word) for flags, word in ((loud, "loud"), (~loud, "quiet")) for row in _rows(flags)]
        for start, end in silences:  # in which no other part ends or begins
            parts = [
                (end if start <= first < end else first, start if start < last <= end else last, word)
                for first, last, word in parts
            ]
        return sorted([part for part in parts if part[0] < part[1]] + [(*row, "silence") for row in silences])

    def in_words(self, start: float, end: float, period: float) -> str:
        """The parts between two moments, seconds; "" where there is one alone, and that is no silence."""
        parts = [(max(row[0], start), *row[1:]) for row in self.parts(period) if row[0] < end and row[1] > start]
        if len(parts) == 1 and parts[0][2] != "silence":
            return ""
        words = [
            f"{word} {_clock(first)}-{_clock(last)}" if last < end else f"{word} from {_clock(first)}"
            for first, last, word in parts[:MOST_TOLD]
        ]
        if len(parts) > MOST_TOLD:
            words.append(f"{len(parts) - MOST_TOLD} more")
        return ", ".join(words)

    def before_silence(self, music: MusicBeats, start: float) -> float:
        """The second from which to take beats for a dance from `start`: before it where all of these are silent.

        The last beat before a silence is that at which the dance rests.
        """
        near = NEAR * music.period
        for first, last in self.silences(music.period):
            if first + near < music.times[1] and music.times[-2] < last - near:
                return min(start, first - 2 * music.period)
        return start

    def danced_beats(self, music: MusicBeats, end: float, usual: float) -> MusicBeats:
        """The beats of a dance until second `end` as they are danced: held in silence, at rest at the end.

        `usual` is the length of a beat, seconds, to which recorded movement is neither slow nor fast.
        """
        music = _ending(_held(music, self.silences(music.period)), end)
        return replace(music, ranks=self.ranks(music, usual)) if self.loudness.size else music


def _clock(seconds: float) -> str:
    return f"{int(seconds + 0.5) // 60}:{int(seconds + 0.5) % 60:02d}"


def pace(period: float, usual: float) -> float:
    """Seconds of movement for a beat of `period` seconds: more than that where it is shorter than a usual one."""
    return period * (usual / period) ** PACE


def _decibels(power: FloatArray) -> FloatArray:
    return 10 * np.log10(np.maximum(power, 1e-12))


def _lasting(flags: BoolArray, seconds: float) -> BoolArray:
    """The flags (L,), one every `HOP` seconds, without those in rows of less than so many seconds."""
    return np.asarray(binary_opening(flags, np.ones(max(1, round(seconds / HOP)), bool)))


def _rows(flags: BoolArray) -> Rows:
    """Seconds from and to which flags, one every `HOP` seconds, are set in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))) * HOP
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _held(music: MusicBeats, silences: Rows) -> MusicBeats:
    """The beats without those inside of silences, where the beat before is held."""
    times, near = music.times, NEAR * music.period
    held, keep = music.held.copy(), np.ones(times.size, bool)
    for start, end in silences:
        first = max(0, int(np.searchsorted(times, start + near, side="right")) - 1)
        last = min(int(np.searchsorted(times, end - near)), times.size - 1)
        if last > first:
            held[last] = times[last] - times[first] + held[first]
            keep[first:last] = False
    return music.part(keep, held) if keep.sum() > 1 else music


def _ending(music: MusicBeats, end: float) -> MusicBeats:
    """The beats until second `end`, the last of them danced in the time of two or more beats of the music, and a rest.

    In a silence a dance rests already; one that is not twice as long as its slow beat is not slowed down.
    """
    last = int(np.searchsorted(music.times, end + SLACK, side="right")) - 1
    eased = last - max(2, int(np.ceil(EASE / music.period)))  # the beat before the last one
    if 2 * eased < last or music.held[eased:].any():
        return music
    keep = (np.arange(music.times.size) <= eased) | (np.arange(music.times.size) == last)
    slowed, rest = music.part(keep, music.held), end + music.period
    held = np.append(slowed.held[:-1], rest - slowed.times[-1])
    # The bar goes on counting: recorded beats are danced in a row, however long the last ones take.
    return replace(slowed, times=np.append(slowed.times[:-1], rest), held=held, places=music.places[: held.size])
