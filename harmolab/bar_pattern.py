"""Our measure: how well the movement around each music beat fits what dancers do there.

Dancers do not all stop on the beat: in recorded cha-cha they are fastest between the beats of one half bar, in waltz
the whole bar has one shape. A `BarPattern` holds that shape, the course of normalised joint speed over a cycle of
beats, and is learnt on other motion than it is applied to. For a clip we lay the motion on the music's beats, ask at
every moment how well the next bit of movement fits the pattern, and rank the music's beats among all moments of the
clip: 0.5 is what a random moment reaches, whatever the music's tempo, the motion's frame rate or how much the dancer
moves.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.stats import rankdata

from harmolab.beats.saliency import salient_audio
from harmolab.beats.visual import RATE, motion_curve
from harmolab.io.files import PathLike, read_json, reading, write_json
from harmolab.kinematics import upsample_motion
from harmolab.params import BarPattern, HarmonyParams
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import BeatTrack, FloatArray, IntArray, Motion

GRID = 24  # samples per beat on which curve and pattern are compared
DRIFT = 1.0  # seconds: slower changes of speed belong to the choreography, not to the beat
CHANCE_ROTATIONS = 60  # at least so many, when chance is not known beforehand
MOST_MOMENTS = 5_000_000  # a day of music on the grid


@dataclass(frozen=True, eq=False)
class PatternFit:
    """Percentile ranks of the music beats among all moments of the clip.

    Parameters
    ----------
    music : BeatTrack, the N attentional music beats
    shares : (N,) array in [0, 1], the percentile rank of each
    null : (R,) array, the weighted mean of the shares after each rotation in time
    chance : float, mean of the null
    """

    music: BeatTrack
    shares: FloatArray
    null: FloatArray
    chance: float

    @property
    def mean(self) -> float:
        """Mean share, weighted by the strengths of the beats; 0 without beats."""
        total = self.music.strengths.sum()
        return float(self.shares @ self.music.strengths / total) if total > 0 else 0.0


@dataclass(frozen=True, eq=False)
class PatternSums:
    """Fourier sums of the speed over a cycle, additive over pieces of motion: the sufficient statistic of a fit."""

    beats: int
    sums: NDArray[np.complex128]
    count: int


def normalised_speed(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, FloatArray]:
    """Joint speed in the room, or shape speed, without its slow drift, in standard deviations of the clip.

    Returns
    -------
    times : (T',) array, seconds; a frame difference belongs half way between its frames
    speed : (T',) array with mean 0; all 0 when nothing moves
    """
    if params.measure == "shape":
        signal = shape_signal(shape_speed(motion, smoothing=params.position_smoothing))
        return signal.times, signal.values
    is_fine = params.subframe or params.fps is not None  # `motion_curve` interpolates by itself
    curve, fps = motion_curve(motion if is_fine else upsample_motion(motion, RATE), params)
    rest: FloatArray = curve - gaussian_filter1d(curve, DRIFT * fps, mode="nearest")
    spread = rest.std()
    still = spread <= 1e-9 * max(np.abs(curve).max(), 1e-300)
    speed = np.zeros_like(rest) if still else (rest - rest.mean()) / spread
    return (np.arange(curve.size, dtype=np.float64) - 0.5) / fps, speed


def beat_positions(times: FloatArray, track: BeatTrack) -> FloatArray:
    """Place of each time on the music's beats: 2.5 is half way between the third and the fourth beat.

    Counting starts at the first beat's place in its bar when that is known. Before the first and after the last beat
    the nearest beat interval goes on.

    Raises
    ------
    ValueError
        With fewer than two beats there is no tempo.
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
    return index + (0 if track.bar_places is None else track.bar_places[0])


def evaluate_pattern(pattern: BarPattern, positions: FloatArray) -> FloatArray:
    """Expected normalised speed at beat positions (any shape)."""
    angle = 2 * np.pi * np.asarray(positions)[..., None] * np.arange(1, len(pattern.cosines) + 1) / pattern.beats
    return np.cos(angle) @ np.array(pattern.cosines) + np.sin(angle) @ np.array(pattern.sines)


def pattern_sums(positions: FloatArray, speed: FloatArray, beats: int) -> PatternSums:
    """The sums a pattern is fitted from, for one piece of motion: harmonics up to one turn a beat.

    Parameters
    ----------
    positions : (T,) array, beat positions
    speed : (T,) array, normalised speed
    beats : int, length of the cycle
    """
    angle = -2j * np.pi * positions[:, None] * np.arange(1, beats + 1) / beats
    return PatternSums(beats, speed @ np.exp(angle), speed.size)


def fit_pattern(pieces: Iterable[PatternSums], *, source: str = "") -> BarPattern:
    """The pattern that the pieces share; each counts by its length.

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


def fit_of_motion(
    audio_track: BeatTrack, motion: Motion, params: HarmonyParams, *, n_rotations: int = 1000
) -> PatternFit:
    """Fit of `motion` to ``params.pattern`` on the beats of `audio_track` (same time line).

    When a bar place is not known the best one is taken, and chance is what the best one reaches at random moments.
    """
    return fit_of_speed(audio_track, *normalised_speed(motion, params), params, n_rotations=n_rotations)


def fit_of_speed(
    audio_track: BeatTrack, times: FloatArray, speed: FloatArray, params: HarmonyParams, *, n_rotations: int = 1000
) -> PatternFit:
    """As `fit_of_motion`, from `normalised_speed`: what to call when one motion meets many beat tracks."""
    music = salient_audio(audio_track, params)
    neutral = PatternFit(music, np.full(music.times.size, 0.5), np.full(max(n_rotations, 1), 0.5), 0.5)
    if music.times.size == 0 or audio_track.times.size < 2 or not speed.any():
        return neutral
    # All beats make the time line, or each one that is too weak to count would move those after it in the bar.
    curve, first = beat_curve(times - params.lag, speed, audio_track)
    if curve.size == 0:
        return neutral
    pattern = params.pattern or BarPattern.stop_on_the_beat()
    ranks = moment_ranks(curve, pattern)
    beats = np.round(beat_positions(music.times, audio_track)).astype(np.int64)
    # Those outside count at its ends.
    moments = np.clip(beats * GRID - first, 0, curve.size - 1)
    is_placed = audio_track.bar_places is not None or pattern.beats == 1
    return _best_places(ranks, moments, beats, music, n_rotations, is_placed)


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


def moment_ranks(curve: FloatArray, pattern: BarPattern) -> FloatArray:
    """Rank of every moment, in (0, 1), by how well the curve around it fits each place of the pattern.

    Parameters
    ----------
    curve : (G,) array, normalised speed on the beat grid
    pattern : BarPattern

    Returns
    -------
    (beats, G) array: row k ranks the moments as candidates for place k.
    """
    half = pattern.beats * GRID // 2
    offsets = np.arange(-half, half + 1) / GRID
    window = 0.5 + 0.5 * np.cos(np.pi * offsets * GRID / half)
    padded = np.pad(curve, half)
    fits = []
    for place in range(pattern.beats):
        template = window * evaluate_pattern(pattern, offsets + place)
        template -= window * template.sum() / window.sum()
        fits.append(np.convolve(padded, template[::-1], mode="valid"))
    return (rankdata(fits, axis=1) - 0.5) / curve.size


def _best_places(
    ranks: FloatArray, moments: IntArray, places: IntArray, music: BeatTrack, n_rotations: int, is_placed: bool
) -> PatternFit:
    """The ranks at the music's beats, and at every rotation of them; those of the best place unless it is known."""
    weights = music.strengths
    cycle, size = ranks.shape
    count = max(n_rotations, 1 if is_placed else CHANCE_ROTATIONS)
    # The observation itself is no part of its null: shift 0 is left out.
    shifts = np.unique(np.linspace(1, max(size, 2), count, endpoint=False).astype(np.int64))
    rotated = np.mod(moments[None, :] + shifts[:, None], size)
    mass = weights / weights.sum() if weights.sum() > 0 else np.full(weights.size, 1 / weights.size)
    options = [0] if is_placed else list(range(cycle))
    shares = [ranks[np.mod(places + option, cycle), moments] for option in options]
    nulls = [ranks[np.mod(places + option, cycle), rotated] @ mass for option in options]
    best = int(np.argmax([share @ mass for share in shares]))
    null = np.max(nulls, axis=0)
    return PatternFit(music, shares[best], null, 0.5 if len(options) == 1 else float(null.mean()))


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
    with reading(path, "bar patterns written by `harmolab learn`") as file:
        patterns = read_json(file)
        if not isinstance(patterns, dict) or not patterns:
            raise ValueError("holds no bar patterns; write one with `harmolab learn`")
        name = dance if dance or len(patterns) > 1 else next(iter(patterns))
        if name not in patterns:
            raise ValueError(f"holds no pattern for --dance {name!r}; it has {', '.join(patterns)}")
        row = patterns[name]
        if not isinstance(row, dict) or set(row) - {"dance"} != {"beats", "cosines", "sines", "source"}:
            raise ValueError(f"pattern {name!r} must have beats, cosines, sines and source")
        return BarPattern(int(row["beats"]), tuple(row["cosines"]), tuple(row["sines"]), str(row["source"]), name)
