"""Does a score tell right music from wrong over a folder of recordings? (`harmolab compare`; cf. the paper's Fig. 8)

On the grid of shifts that `parts` computes, the true music is shift 0 and lagged music is 0.3-0.7 beat further on; a
chance band comes from giving each choreographic unit a random origin. A window scores the mean of its clips.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from harmolab.corpora import folders
from harmolab.corpora.files import corpus_recordings
from harmolab.io.files import PathLike, Progress, silent
from harmolab.lab.compare.windows import (
    CLIP_SECONDS,
    BeatClip,
    all_clips,
    constant_lags,
    learn_patterns,
    score_others,
    score_shifts,
)
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.significance import auc
from harmolab.types import FloatArray, IntArray

LAGS = (3, 4, 5, 6, 7)  # tenths of a beat: what "lagged music" means
Corpus = PathLike | Iterable[folders.Recording]


@dataclass(frozen=True, eq=False)
class CorpusResult:
    """Outcome of `compare`: per score the values behind its AUC, and the plain dictionary for JSON.

    Parameters
    ----------
    summary : dict as `harmolab compare --json` prints it
    true, wrong : dict from score name to (W,) and (W, K) arrays: each window with its own and with wrong music
    dances : (W,) list of str
    sequences : (W,) list of str, their folders
    patterns : dict from dance to the bar patterns fitted for its clips
    lags : dict from dance to the constant peak lags fitted for its clips, in beats
    """

    summary: dict[str, Any]
    true: dict[str, FloatArray]
    wrong: dict[str, FloatArray]
    dances: list[str]
    sequences: list[str]
    patterns: dict[str, list[BarPattern]] = field(default_factory=dict)
    lags: dict[str, list[float]] = field(default_factory=dict)


def compare(
    recordings: Corpus,
    *,
    corpus: str = "",
    dances: Sequence[str] = (),
    window: float | None = CLIP_SECONDS,
    null: Literal["lagged", "other"] = "lagged",
    beats: Literal["annotated", "tracked"] | None = None,
    fit_on: Corpus | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
    params: HarmonyParams | None = None,
    progress: Progress = silent,
    report: Callable[[folders.Problem], object] = lambda problem: None,
) -> CorpusResult:
    """AUC of true against wrong music for every score over a corpus.

    Parameters
    ----------
    recordings : str or path of a folder of recordings, or the recordings
        Read one at a time; only their beats and speed curves are kept.
    corpus : str, its name in the summary; the path when left out
    dances : names; only recordings of these, of all when empty
    window : float, seconds; None judges whole recordings
    null : "lagged" (the same music 0.3-0.7 beat late) or "other" (other recordings' music)
    beats : "annotated" or "tracked"; left out, annotated unless a folder holds a recording without beats.json
    fit_on : corpus to fit patterns and lags on; None fits inside `recordings`, on other figures
    n_rotations : int, random origins behind each chance band, and resamplings behind each interval; 0: neither
    seed : int
    params : HarmonyParams of the recommended score
    progress, report : as in `corpus_recordings`; progress also over the clips that are scored

    Raises
    ------
    FileNotFoundError, ValueError
        Without recordings, or when annotated beats are asked for and missing; for a window that is not positive.
    """
    params = params or HarmonyParams.recommended()
    beats = beats or _common_beats(recordings, fit_on)
    if window is not None and not 0 < window < float("inf"):
        raise ValueError(f"window must be a positive number of seconds, or None for whole sequences; got {window}")

    def clips_of(source: Corpus) -> list[BeatClip]:
        return all_clips(corpus_recordings(source, dances, progress=progress, report=report), beats, window, params)

    clips = clips_of(recordings)
    if not clips:
        raise ValueError("no sequence to compare")
    fit_clips = None if fit_on is None else clips_of(fit_on)
    if fit_clips is not None and not fit_clips:
        raise ValueError("no sequence to fit on")
    patterns = learn_patterns(clips, fit_clips)
    grids = score_shifts(clips, patterns, params, progress)
    fit_peaks = None if fit_clips is None else score_shifts(fit_clips, learn_patterns(fit_clips), params)["peaks"]
    lags = constant_lags(clips, grids["peaks"], fit_clips, fit_peaks)
    grids["peaks_lagged"] = [np.roll(grid, -lag) for grid, lag in zip(grids["peaks"], lags, strict=True)]
    others = None
    if null == "other":
        others = score_others(clips, patterns, params, seed, progress)
        others["peaks_lagged"] = others["peaks"]
    result = _summarise(clips, grids, others, n_rotations, seed)
    summary = {
        "corpus": corpus or (str(recordings) if isinstance(recordings, str | os.PathLike) else ""),
        "window": window if window is not None else "whole", "null": null, "beats": beats,
        "n": len(result.dances), "n_sequences": len(set(result.sequences)), "fitted_on": _fit_note(clips, fit_clips),
        "n_parts": len(clips), "unfitted_parts": sum(pattern == BarPattern.stop_on_the_beat() for pattern in patterns),
        "seed": seed, **result.summary,
    }  # fmt: skip
    fitted: dict[str, list[BarPattern]] = {}
    shifts: dict[str, list[float]] = {}
    for clip, pattern, lag in zip(clips, patterns, lags, strict=True):
        fitted.setdefault(clip.dance, []).append(pattern)
        shifts.setdefault(clip.dance, []).append(lag / 10)
    return replace(result, summary=summary, patterns=fitted, lags=shifts)


def _common_beats(*corpora: Corpus | None) -> Literal["annotated", "tracked"]:
    """ "annotated" when every recording of the folders has a beats.json, else "tracked"."""
    roots = [corpus for corpus in corpora if isinstance(corpus, str | os.PathLike)]
    recordings = [folder for root in roots for folder in folders.find_recordings(root).folders]
    return "annotated" if all((folder / "beats.json").is_file() for folder in recordings) else "tracked"


def _fit_note(clips: Sequence[BeatClip], fit_clips: Sequence[BeatClip] | None) -> str:
    """A sentence about what the fitted scores were fitted on."""
    if fit_clips is not None:
        return f"{len({clip.sequence for clip in fit_clips})} sequences of another corpus, without shared figures"
    if all(clip.figures for clip in clips):
        return "other sequences, without the figures of the judged clip"
    return "other sequences (figures are not named here, so the same movement may recur)"


@dataclass(frozen=True, eq=False)
class _Windows:
    """Which window each clip belongs to, (clips,) indices, and each window's dance and recording."""

    of_clip: IntArray
    dances: list[str]
    sequences: list[str]

    @classmethod
    def of(cls, clips: Sequence[BeatClip]) -> _Windows:
        first: dict[tuple[str, int], BeatClip] = {}
        for clip in clips:
            first.setdefault((clip.sequence, clip.window), clip)
        number = {key: index for index, key in enumerate(first)}
        of_clip = np.array([number[clip.sequence, clip.window] for clip in clips])
        return cls(of_clip, [clip.dance for clip in first.values()], [clip.sequence for clip in first.values()])

    def means(self, values: FloatArray) -> FloatArray:
        """Mean over the clips of each window: (clips, ...) to (windows, ...)."""
        sums = np.zeros((len(self.dances), *values.shape[1:]))
        np.add.at(sums, self.of_clip, values)
        return sums / np.bincount(self.of_clip).reshape(-1, *[1] * (values.ndim - 1))


def _at_shifts(grids: Sequence[FloatArray], shifts: IntArray) -> FloatArray:
    """Each clip's score at its shifts (clips, ...), around its cycle."""
    return np.array([grid[shift % grid.size] for grid, shift in zip(grids, shifts, strict=True)])


def _summarise(
    clips: Sequence[BeatClip],
    grids: dict[str, list[FloatArray]],
    others: dict[str, list[FloatArray]] | None,
    n_rotations: int,
    seed: int,
) -> CorpusResult:
    """AUC, interval, chance band and per-dance values of every score."""
    windows = _Windows.of(clips)
    origin = np.zeros(len(clips), dtype=np.int64)
    true: dict[str, FloatArray] = {}
    wrong: dict[str, FloatArray] = {}
    scores: dict[str, Any] = {}
    origins = _origins(clips, n_rotations, seed)
    for name, grid in grids.items():
        strange = None if others is None else others[name]
        true[name], wrong[name] = _true_and_wrong(grid, origin, windows, strange)
        scores[name] = _row(true[name], wrong[name], windows.sequences, seed, n_rotations)
        scores[name]["chance_band"] = _quantiles([auc(*_true_and_wrong(grid, at, windows, strange)) for at in origins])
        scores[name]["by_dance"] = _rows_by_dance(true[name], wrong[name], windows, seed, n_rotations)
    return CorpusResult({"scores": scores}, true, wrong, windows.dances, windows.sequences)


def _true_and_wrong(
    grid: Sequence[FloatArray], origin: IntArray, windows: _Windows, others: Sequence[FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Window means at the origin, (W,), and against wrong music, (W, K)."""
    right = _at_shifts(grid, origin)
    wrong = np.array(others) if others is not None else _at_shifts(grid, origin[:, None] + np.array(LAGS))
    return windows.means(right), windows.means(wrong)


def _origins(clips: Sequence[BeatClip], count: int, seed: int) -> IntArray:
    """(count, clips) random shifts in tenths of a beat; clips of the same unit turn together."""
    rng = np.random.default_rng(seed)
    units = {unit: index for index, unit in enumerate(dict.fromkeys(clip.unit for clip in clips))}
    steps = math.lcm(*(10 * clip.cycle for clip in clips))
    return rng.integers(0, steps, (count, len(units)))[:, [units[clip.unit] for clip in clips]]


def _quantiles(values: Sequence[float]) -> list[float | None]:
    """The middle 95 % of some values; None without them."""
    return [float(edge) for edge in np.quantile(values, [0.025, 0.975])] if len(values) else [None, None]


def _row(true: FloatArray, wrong: FloatArray, sequences: Sequence[str], seed: int, count: int) -> dict[str, Any]:
    """AUC, its bootstrap interval over recordings, and the mean scores."""
    names = np.array(sequences)
    members = [np.flatnonzero(names == name) for name in dict.fromkeys(sequences)]
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, len(members), (count if len(members) > 1 else 0, len(members)))
    indices = [np.concatenate([members[i] for i in row]) for row in draws]
    return {
        "auc": auc(true, wrong),
        "interval": _quantiles([auc(true[index], wrong[index]) for index in indices]),
        "n": len(true),
        "mean_true": float(true.mean()),
        "mean_wrong": float(wrong.mean()),
    }


def _rows_by_dance(
    true: FloatArray, wrong: FloatArray, windows: _Windows, seed: int, count: int
) -> dict[str, dict[str, Any]]:
    """The same row for the windows of each dance, under its `dance_key`."""
    rows = {}
    for dance in sorted(set(windows.dances)):
        index = np.flatnonzero(np.array(windows.dances) == dance)
        rows[dance_key(dance)] = _row(true[index], wrong[index], [windows.sequences[i] for i in index], seed, count)
    return rows


def dance_key(dance: str) -> str:
    """The initial of one of the seven `DANCES` (C, J, Q, R, S, T, W), the name of another, "?" without a name."""
    return dance[0].upper() if dance in DANCES else dance or "?"
