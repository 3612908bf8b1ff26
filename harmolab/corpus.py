"""Does a score tell right music from wrong over a folder of sequences? (`harmolab compare`; cf. the paper's Fig. 8)

On the grid of shifts that `parts` computes, the true music is shift 0 and lagged music is 0.3-0.7 beat further on; a
chance band comes from giving each choreographic unit a random origin. A window longer than a part scores the mean of
its parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from harmolab.data import folders
from harmolab.io.files import Progress, silent
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.parts import (
    PART_SECONDS,
    Part,
    all_parts,
    constant_lags,
    learn_patterns,
    score_others,
    score_parts,
)
from harmolab.significance import auc
from harmolab.types import FloatArray

LAGS = (3, 4, 5, 6, 7)  # tenths of a beat: what "lagged music" means


@dataclass(frozen=True, eq=False)
class CorpusResult:
    """Outcome of `compare`: per score the values behind its AUC, and the plain dictionary for JSON.

    Parameters
    ----------
    summary : dict as `harmolab compare --json` prints it
    true, wrong : dict from score name to (W,) and (W, K) arrays: each window with its own and with wrong music
    dances : (W,) list of str
    sequences : (W,) list of str, their folders
    patterns : dict from dance to the bar patterns fitted for its parts
    lags : dict from dance to the constant peak lags fitted for its parts, in beats
    """

    summary: dict[str, Any]
    true: dict[str, FloatArray]
    wrong: dict[str, FloatArray]
    dances: list[str]
    sequences: list[str]
    patterns: dict[str, list[BarPattern]] = field(default_factory=dict)
    lags: dict[str, list[float]] = field(default_factory=dict)


def compare(
    sequences: Iterable[folders.Recording],
    *,
    corpus: str = "",
    window: float | None = PART_SECONDS,
    null: Literal["lagged", "other"] = "lagged",
    beats: Literal["annotated", "tracked"] = "annotated",
    fit_on: Iterable[folders.Recording] | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
    params: HarmonyParams | None = None,
    progress: Progress = silent,
) -> CorpusResult:
    """AUC of true against wrong music for every score over a corpus.

    Parameters
    ----------
    sequences : iterable of `harmolab.data.folders.Recording`
        Read one at a time; only their beats and speed curves are kept.
    window : float, seconds; None judges whole sequences
    null : "lagged" (the same music 0.3-0.7 beat late) or "other" (other sequences' music)
    beats : "annotated" or "tracked"
    fit_on : sequences to fit patterns and lags on; None fits inside the corpus, on other figures
    n_rotations : int, random origins behind each chance band, and resamplings behind each interval; 0: neither
    seed : int
    params : HarmonyParams of the recommended score
    progress : function(iterable, label) -> iterable

    Raises
    ------
    ValueError
        Without sequences, or when annotated beats are asked for and missing; for a window that is not positive.
    """
    chosen = params or HarmonyParams.recommended()
    if window is not None and not 0 < window < float("inf"):
        raise ValueError(f"window must be a positive number of seconds, or None for whole sequences; got {window}")
    parts = all_parts(sequences, beats, window, chosen)
    if not parts:
        raise ValueError("no sequence to compare")
    fit_parts = None if fit_on is None else all_parts(fit_on, beats, window, chosen)
    if fit_parts is not None and not fit_parts:
        raise ValueError("no sequence to fit on")
    patterns = learn_patterns(parts, fit_parts)
    grids = score_parts(parts, patterns, chosen, progress)
    fit_peaks = None if fit_parts is None else score_parts(fit_parts, learn_patterns(fit_parts), chosen)["peaks"]
    lags = constant_lags(parts, grids["peaks"], fit_parts, fit_peaks)
    grids["peaks_lagged"] = [np.roll(grid, -lag) for grid, lag in zip(grids["peaks"], lags, strict=True)]
    others = None
    if null == "other":
        others = score_others(parts, patterns, chosen, seed, progress)
        others["peaks_lagged"] = others["peaks"]
    result = _summarise(parts, grids, others, n_rotations, seed)
    summary = {
        "corpus": corpus, "window": window if window is not None else "whole", "null": null, "beats": beats,
        "n": len(result.dances), "n_sequences": len(set(result.sequences)), "fitted_on": _fit_note(parts, fit_parts),
        "n_parts": len(parts), "unfitted_parts": sum(pattern == BarPattern.stop_on_the_beat() for pattern in patterns),
        "seed": seed, **result.summary,
    }  # fmt: skip
    fitted: dict[str, list[BarPattern]] = {}
    shifts: dict[str, list[float]] = {}
    for part, pattern, lag in zip(parts, patterns, lags, strict=True):
        fitted.setdefault(part.dance, []).append(pattern)
        shifts.setdefault(part.dance, []).append(lag / 10)
    return replace(result, summary=summary, patterns=fitted, lags=shifts)


def _fit_note(parts: Sequence[Part], fit_parts: Sequence[Part] | None) -> str:
    """What the fitted scores were fitted on, in words."""
    if fit_parts is not None:
        return f"{len({part.sequence for part in fit_parts})} sequences of another corpus, without shared figures"
    if all(part.figures for part in parts):
        return "other sequences, without the figures of the judged part"
    return "other sequences (figures are not named here, so the same movement may recur)"


@dataclass(frozen=True, eq=False)
class _Windows:
    """Which window each part belongs to, (parts,) indices, and each window's dance and sequence."""

    of_part: NDArray[np.int64]
    dances: list[str]
    sequences: list[str]

    @classmethod
    def of(cls, parts: Sequence[Part]) -> _Windows:
        first: dict[tuple[str, int], Part] = {}
        for part in parts:
            first.setdefault((part.sequence, part.window), part)
        number = {key: index for index, key in enumerate(first)}
        of_part = np.array([number[part.sequence, part.window] for part in parts])
        return cls(of_part, [part.dance for part in first.values()], [part.sequence for part in first.values()])

    def means(self, values: FloatArray) -> FloatArray:
        """Mean over the parts of each window: (parts, ...) to (windows, ...)."""
        sums = np.zeros((len(self.dances), *values.shape[1:]))
        np.add.at(sums, self.of_part, values)
        return sums / np.bincount(self.of_part).reshape(-1, *[1] * (values.ndim - 1))


def _read(grids: Sequence[FloatArray], shifts: NDArray[np.int64]) -> FloatArray:
    """Each part's score at its shifts (parts, ...), around its cycle."""
    return np.array([grid[shift % grid.size] for grid, shift in zip(grids, shifts, strict=True)])


def _summarise(
    parts: Sequence[Part],
    grids: dict[str, list[FloatArray]],
    others: dict[str, list[FloatArray]] | None,
    n_rotations: int,
    seed: int,
) -> CorpusResult:
    """AUC, interval, chance band and per-dance values of every score."""
    windows = _Windows.of(parts)
    here = np.zeros(len(parts), dtype=np.int64)
    true: dict[str, FloatArray] = {}
    wrong: dict[str, FloatArray] = {}
    scores: dict[str, Any] = {}
    origins = _origins(parts, n_rotations, seed)
    for name, grid in grids.items():
        strange = None if others is None else others[name]
        true[name], wrong[name] = _true_and_wrong(grid, here, windows, strange)
        scores[name] = _row(true[name], wrong[name], windows.sequences, seed, n_rotations)
        scores[name]["chance_band"] = _quantiles([auc(*_true_and_wrong(grid, at, windows, strange)) for at in origins])
        scores[name]["by_dance"] = _by_dance(true[name], wrong[name], windows, seed, n_rotations)
    return CorpusResult({"scores": scores}, true, wrong, windows.dances, windows.sequences)


def _true_and_wrong(
    grid: Sequence[FloatArray], origin: NDArray[np.int64], windows: _Windows, others: Sequence[FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Window means at the origin, (W,), and against wrong music, (W, K)."""
    right = _read(grid, origin)
    wrong = np.array(others) if others is not None else _read(grid, origin[:, None] + np.array(LAGS))
    return windows.means(right), windows.means(wrong)


def _origins(parts: Sequence[Part], count: int, seed: int) -> NDArray[np.int64]:
    """(count, parts) random shifts in tenths of a beat; parts of the same unit turn together."""
    rng = np.random.default_rng(seed)
    units = {unit: index for index, unit in enumerate(dict.fromkeys(part.unit for part in parts))}
    steps = math.lcm(*(10 * part.cycle for part in parts))
    drawn = rng.integers(0, steps, (count, len(units)))
    return drawn[:, [units[part.unit] for part in parts]]


def _quantiles(values: Sequence[float]) -> list[float | None]:
    """The middle 95 % of some values; None without them."""
    return [float(edge) for edge in np.quantile(values, [0.025, 0.975])] if len(values) else [None, None]


def _row(true: FloatArray, wrong: FloatArray, sequences: Sequence[str], seed: int, count: int) -> dict[str, Any]:
    """AUC, its bootstrap interval over sequences, and the mean scores."""
    names = np.array(sequences)
    members = [np.flatnonzero(names == name) for name in dict.fromkeys(sequences)]
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(members), (count if len(members) > 1 else 0, len(members)))
    indices = [np.concatenate([members[i] for i in row]) for row in drawn]
    return {
        "auc": auc(true, wrong),
        "interval": _quantiles([auc(true[index], wrong[index]) for index in indices]),
        "n": len(true),
        "mean_true": float(true.mean()),
        "mean_wrong": float(wrong.mean()),
    }


def _by_dance(true: FloatArray, wrong: FloatArray, windows: _Windows, seed: int, count: int) -> dict[str, Any]:
    """The same row for each dance, under its initial (C, J, Q, R, S, T, W), its name if it is not one of the seven."""
    rows = {}
    for dance in sorted(set(windows.dances)):
        index = np.flatnonzero(np.array(windows.dances) == dance)
        key = dance[0].upper() if dance in DANCES else dance or "?"
        rows[key] = _row(true[index], wrong[index], [windows.sequences[i] for i in index], seed, count)
    return rows
