"""Bar patterns: the usual course of movement through a cycle of beats, how it is learnt, and how well it fits.

Dancers do not all stop on the beat. In recorded cha-cha the body moves fastest between the beats of one half bar; in
waltz the whole bar has one course. A `BarPattern` holds that course, and is learnt on other motion than it is applied
to. A *place* of a pattern is a beat of its cycle, counted from 0.

How well a moment of the movement fits a place is one number, the correlation of the movement around the moment, seen
through a Hann window of one cycle, with the pattern around that place (`pattern_fits`). The place test of the verdict,
the comparison of corpora and the choreographer use it; the soft score convolves the same `templates`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harmolab.files import PathLike, read_json, reading, write_json
from harmolab.params import BarPattern
from harmolab.significance import ranks
from harmolab.types import BeatTrack, FloatArray, IntArray, usual_meter

GRID = 24  # moments a beat of `beat_curve` and `beat_ranks`
MOST_MOMENTS = 5_000_000  # a day of music on the grid


@dataclass(frozen=True, eq=False)
class PatternSums:
    """Fourier sums of the speed of one piece of motion, from which a pattern is fitted; those of pieces add up.

    Parameters
    ----------
    beats : int, length of the cycle
    sums : (beats,) complex array, the sum over all frames for each harmonic of the cycle
    count : int, number of frames
    """

    beats: int
    sums: NDArray[np.complex128]
    count: int


def beat_positions(times: FloatArray, track: BeatTrack) -> FloatArray:
    """Beat position of each time: 2.5 is half way between the third and the fourth beat.

    The first beat has position 0, or its place in the bar where that is known. Before the first and after the last beat
    the nearest interval of two beats is continued.

    Parameters
    ----------
    times : array, seconds
    track : BeatTrack of two beats or more

    Returns
    -------
    array of the shape of `times`, beats

    Raises
    ------
    ValueError
        With fewer than two beats, of which there is no tempo.
    """
    beats = track.times
    if beats.size < 2:
        raise ValueError(f"a pattern needs two music beats at least, got {beats.size}")
    first, last = beats[1] - beats[0], beats[-1] - beats[-2]
    # A knot more at either end, behind all times.
    start, end = np.min(times, initial=beats[0]) - first, np.max(times, initial=beats[-1]) + last
    numbers = np.arange(-1.0, beats.size + 1)
    numbers[0], numbers[-1] = (start - beats[0]) / first, beats.size - 1 + (end - beats[-1]) / last
    index: FloatArray = np.interp(times, np.concatenate([[start], beats, [end]]), numbers)
    return index + (0 if track.bar_places is None else first_place(track.bar_places))


def evaluate_pattern(pattern: BarPattern, positions: FloatArray) -> FloatArray:
    """The speed that a pattern expects at beat positions (any shape), in standard deviations from the mean."""
    angle = 2 * np.pi * np.asarray(positions)[..., None] * np.arange(1, len(pattern.cosines) + 1) / pattern.beats
    return np.cos(angle) @ np.array(pattern.cosines) + np.sin(angle) @ np.array(pattern.sines)


def pattern_sums(positions: FloatArray, speed: FloatArray, beats: int) -> PatternSums:
    """The Fourier sums from which a pattern is fitted, of one piece of motion: harmonics up to one turn a beat.

    Parameters
    ----------
    positions : (T,) array, beat positions
    speed : (T,) array, normalised speed
    beats : int, length of the cycle
    """
    angle = -2j * np.pi * positions[:, None] * np.arange(1, beats + 1) / beats
    return PatternSums(beats, speed @ np.exp(angle), speed.size)


def fit_pattern(pieces: Iterable[PatternSums], *, source: str = "") -> BarPattern:
    """The pattern that the pieces share: the mean of their Fourier series, each weighted by its number of frames.

    Raises
    ------
    ValueError
        If there is nothing to fit, or the pieces have cycles of different length.
    """
    moving = [piece for piece in pieces if piece.count > 0]
    if not moving:
        raise ValueError("no motion to fit a bar pattern on")
    lengths = {piece.beats for piece in moving}
    if len(lengths) > 1:
        raise ValueError(f"pieces with cycles of {sorted(lengths)} beats cannot share a pattern")
    mean = 2 * np.sum([piece.sums for piece in moving], axis=0) / sum(piece.count for piece in moving)
    return BarPattern(lengths.pop(), tuple(mean.real.tolist()), tuple((-mean.imag).tolist()), source)


def beat_curve(
    times: FloatArray, speed: FloatArray, track: BeatTrack, *, moments: int = GRID
) -> tuple[FloatArray, int]:
    """The speed at every moment of the beat grid: (G,) array, empty if there is none, and the first moment's number.

    Parameters
    ----------
    times, speed : (T,) arrays, seconds and normalised speed
    track : BeatTrack of two beats at least
    moments : int, in a beat

    Raises
    ------
    ValueError
        If the beats lie so close together that there are millions of moments, or are fewer than two.
    """
    positions = beat_positions(times, track)
    first, last = int(np.ceil(positions[0] * moments)), int(np.floor(positions[-1] * moments))
    if last - first > MOST_MOMENTS:
        closest = float(np.diff(track.times).min())
        raise ValueError(f"music beats lie {closest:.2g} s apart: are there doubles among them?")
    return np.interp(np.arange(first, last + 1) / moments, positions, speed), first


def beat_ranks(times: FloatArray, speed: FloatArray, track: BeatTrack, pattern: BarPattern) -> FloatArray:
    """Rank of each beat among all moments of a motion, by the fit to its place in a pattern: (B,), between 0 and 1.

    Parameters are those of `beat_curve`, and `pattern`. Before and after the motion there is no movement; beats outside
    of it have the rank of its first or last moment. Where no bar is known the pattern begins on the first beat.
    """
    curve, first = beat_curve(times, speed, track)
    beats = np.arange(len(track)) + (0 if track.bar_places is None else first_place(track.bar_places))
    half = pattern.beats * GRID // 2
    fits = pattern_fits(np.pad(curve, half), pattern, moments=GRID)[:, half:-half]
    moments = np.clip(beats * GRID - first, 0, curve.size - 1)
    return np.array([moment_ranks(row) for row in fits])[beats % pattern.beats, moments]


def moment_ranks(fits: FloatArray) -> FloatArray:
    """Ranks (G,), between 0 and 1, of moments by their fits (G,); fits that differ by rounding alone share a rank."""
    return (ranks(np.round(fits / max(np.abs(fits).max(), 1e-300), 9)) - 0.5) / fits.size


def pattern_fits(speed: FloatArray, pattern: BarPattern, *, moments: int) -> FloatArray:
    """Fit of the movement around each moment to each place of a pattern.

    Parameters
    ----------
    speed : (G,) array, `moments` samples a beat, taken as a circle: after the last comes the first
    pattern : BarPattern

    Returns
    -------
    (beats, G) array: a row for each place of the pattern
    """
    harmonics = harmonic_fits(speed, pattern.beats, len(pattern.cosines), moments=moments)
    return np.array([weights @ harmonics for weights in _place_weights(pattern)])


def templates(pattern: BarPattern, moments: int) -> FloatArray:
    """(beats, K) weights of the moments around a moment in its `pattern_fits`, for each place of the pattern."""
    waves = _waves(pattern.beats, len(pattern.cosines), moments)
    return np.array([weights @ waves for weights in _place_weights(pattern)])


def _place_weights(pattern: BarPattern) -> list[FloatArray]:
    """The coefficients of a pattern seen from each of its places."""
    weights = np.array([pattern.cosines, pattern.sines]).T.ravel()
    return [turned(weights, pattern.beats, place) for place in range(pattern.beats)]


def harmonic_fits(speed: FloatArray, beats: int, count: int, *, moments: int) -> FloatArray:
    """Correlation of the movement around each moment with each cosine and sine of a cycle.

    Cosines and sines are seen through a Hann window of one cycle, and their means are taken off. The fit to a pattern
    is the sum of these correlations, weighted by the pattern's coefficients. The fit to another of its places has
    `turned` coefficients.

    Parameters
    ----------
    speed : (G,) array, `moments` samples a beat, taken as a circle
    beats : int, length of the cycle
    count : int, H harmonics

    Returns
    -------
    (2 H, G) array: first cosine, first sine, second cosine ...
    """
    waves = _waves(beats, count, moments)
    half = waves.shape[1] // 2
    kernels = np.zeros((speed.size, 2 * count))
    np.add.at(kernels, np.arange(-half, half + 1) % speed.size, waves.T)
    return np.fft.irfft(np.fft.rfft(speed) * np.conj(np.fft.rfft(kernels.T)), speed.size)


def _waves(beats: int, count: int, moments: int) -> FloatArray:
    """(2 H, K) cosines and sines of a cycle through a Hann window of one cycle, without their means."""
    half = beats * moments // 2
    offsets = np.arange(-half, half + 1)
    window = 0.5 + 0.5 * np.cos(np.pi * offsets / half)
    angle = np.pi / half * np.arange(1, count + 1)[:, None] * offsets
    waves = window * np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(2 * count, -1)
    return waves - window * (waves.sum(axis=1) / window.sum())[:, None]


def turned(weights: FloatArray, beats: int, place: float | FloatArray) -> FloatArray:
    """Coefficients of a pattern that begins `place` beats later in its cycle: cosines and sines in turn, (..., 2 H).

    `place` is one for all, or has the shape (..., 1).
    """
    pairs = weights.reshape(*weights.shape[:-1], -1, 2)
    angle = 2 * np.pi * np.arange(1, pairs.shape[-2] + 1) * place / beats
    cosines, sines = pairs[..., 0], pairs[..., 1]
    both = [cosines * np.cos(angle) + sines * np.sin(angle), sines * np.cos(angle) - cosines * np.sin(angle)]
    return np.stack(both, axis=-1).reshape(weights.shape)


def save_patterns(path: PathLike, patterns: Mapping[str, BarPattern]) -> None:
    """Write bar patterns by dance as JSON, whole or not at all; `load_pattern` reads one of them."""
    write_json(path, dict(patterns))


def load_pattern(path: PathLike, dance: str = "") -> BarPattern:
    """The bar pattern of a dance in a file of `save_patterns`; without a dance the only one there is.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; a dance that is not in it is an error.
    """
    with reading(path, "bar patterns written by `harmolab data learn`") as file:
        patterns = read_json(file)
        if not isinstance(patterns, dict) or not patterns:
            raise ValueError("holds no bar patterns; write one with `harmolab data learn`")
        name = dance if dance or len(patterns) > 1 else next(iter(patterns))
        if name not in patterns:
            raise ValueError(f"holds no pattern for --dance {name!r}; it has {', '.join(patterns)}")
        row = patterns[name]
        if not isinstance(row, dict) or set(row) - {"dance"} != {"beats", "cosines", "sines", "source"}:
            raise ValueError(f"pattern {name!r} must have beats, cosines, sines and source")
        return BarPattern(int(row["beats"]), tuple(row["cosines"]), tuple(row["sines"]), str(row["source"]), name)


def first_place(bar_places: IntArray) -> int:
    """Place in its bar of the first beat, by the majority of all beats.

    So a bar of another length, or a beat that was missed, does not move the bars of the whole.

    >>> first_place(np.array([0, 1, 0, 1, 2, 0, 1, 2]))
    1
    """
    return int(np.bincount((bar_places - np.arange(bar_places.size)) % usual_meter(bar_places)).argmax())
