"""Tables 1 and 2 of Audio to Body Dynamics: one setting changed in each row, several seeds, and what the paper lacks.

All trainings are kept in the cache folder: a table that was cut off goes on where it was.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import kendalltau

from harmolab.files import Progress, silent
from harmolab.musician.params import Audio2BodyParams
from study.experiments.players import PLANTED, PLAYER_SEEDS, QUICK_PLAYER_SEEDS, PlayerData, trained_player
from study.profile import RunProfile

FINAL, OURS = "final", "recommended (ours)"
SIDES = ("train", "validation", "test")
MEAN_POSE = "mean pose"


class PrintedRow(NamedTuple):
    """A row of the paper: what is changed of the final settings, and its errors in training, validation and test."""

    changes: Mapping[str, Any]
    printed: tuple[float, float, float]


# In the paper's order, from the worst test error to the best.
VIOLIN_ROWS: Mapping[str, PrintedRow] = MappingProxyType(
    {
        "frames not dropped": PrintedRow({"reject": False}, (12.44, 12.09, 18.31)),
        "50 % of the training data": PrintedRow({"data_share": 0.5}, (7.22, 11.18, 9.38)),
        "5 components": PrintedRow({"components": 5}, (6.86, 7.04, 9.35)),
        "dropout .6": PrintedRow({"dropout": 0.6}, (7.25, 7.51, 9.31)),
        "sequences of 500": PrintedRow({"sequence": 500}, (7.40, 6.95, 9.24)),
        "no delay": PrintedRow({"delay": 0.0}, (7.32, 7.76, 9.19)),
        "6 steps a frame": PrintedRow({"upsample": 6}, (7.07, 6.95, 9.18)),
        "30 components": PrintedRow({"components": 30}, (7.39, 7.12, 9.13)),
        "sequences of 200": PrintedRow({"sequence": 200}, (6.88, 6.75, 9.13)),
        "no dropout": PrintedRow({"dropout": 0.0}, (7.32, 7.71, 9.03)),
        "2 steps a frame": PrintedRow({"upsample": 2}, (7.33, 9.09, 8.66)),
        FINAL: PrintedRow({}, (7.35, 6.58, 8.31)),
    }
)
PIANO_ROWS: Mapping[str, PrintedRow] = MappingProxyType(
    {
        "frames not dropped": PrintedRow({"reject": False}, (17.15, 14.64, 9.49)),
        "50 % of the training data": PrintedRow({"data_share": 0.5}, (6.94, 6.65, 8.87)),
        "gaps interpolated": PrintedRow({"gaps": "interpolate"}, (7.05, 6.41, 8.14)),
        "2 steps a frame": PrintedRow({"upsample": 2}, (7.18, 6.95, 7.98)),
        "no delay": PrintedRow({"delay": 0.0}, (6.83, 6.04, 7.48)),
        "30 components": PrintedRow({"components": 30}, (6.66, 6.79, 7.42)),
        "dropout .6": PrintedRow({"dropout": 0.6}, (6.76, 5.97, 7.38)),
        "no dropout": PrintedRow({"dropout": 0.0}, (6.77, 6.07, 7.28)),
        "sequences of 200": PrintedRow({"sequence": 200}, (6.76, 6.92, 7.06)),
        "5 components": PrintedRow({"components": 5}, (6.27, 7.24, 6.94)),
        FINAL: PrintedRow({}, (6.52, 6.06, 6.84)),
    }
)
ROWS: Mapping[str, Mapping[str, PrintedRow]] = MappingProxyType({"violin": VIOLIN_ROWS, "piano": PIANO_ROWS})
UNREJECTED = ("frames not dropped", "gaps interpolated")  # rows that change nothing where no frame is rejected
ANOTHER_PIECE, NOTES, SECTION_4 = "sound of another piece", "notes in place of sound", "settings of Sec. 4"
OWN_ROWS = (ANOTHER_PIECE, NOTES, SECTION_4, OURS)
SCHEDULE = "our schedule"  # the recommended settings with the paper's delay and sound: what the gains are counted from
PLANTED_DELAY, LONG_DELAY = 0.0625, 0.125  # seconds; the first by the error on validation pieces of planted players


def row_settings(data: PlayerData, row: str) -> Audio2BodyParams:
    """The settings of a row; those of `ANOTHER_PIECE` are the final ones, trained with the sound of other pieces."""
    final = Audio2BodyParams.tables(data.instrument)
    own = {
        ANOTHER_PIECE: replace(final, shuffled_sound=True),
        NOTES: replace(final, hears="notes"),
        SECTION_4: Audio2BodyParams.section_4(data.instrument),
        OURS: our_settings(data),
        **gain_settings(data),
    }
    return own[row] if row in own else replace(final, **ROWS[data.instrument][row].changes)


def our_settings(data: PlayerData) -> Audio2BodyParams:
    """The recommended settings; with `PLANTED_DELAY` for planted players, whose hands lead their notes by less."""
    ours = Audio2BodyParams.recommended(data.instrument)
    return replace(ours, delay=PLANTED_DELAY) if data.label == PLANTED else ours


def gain_settings(data: PlayerData) -> dict[str, Audio2BodyParams]:
    """Our settings with none of our changes (`SCHEDULE`), and with each of them alone."""
    ours, final = our_settings(data), Audio2BodyParams.tables(data.instrument)
    schedule = replace(ours, delay=final.delay, tones="none", bow_phase=False)
    changes: dict[str, dict[str, Any]] = {
        SCHEDULE: {},
        f"delay {1e3 * ours.delay:.0f} ms": {"delay": ours.delay},
        f"delay {1e3 * LONG_DELAY:.0f} ms": {"delay": LONG_DELAY},
        "chroma": {"tones": "chroma"},
        "semitones": {"tones": "semitones"},
    }
    changes |= {"strokes alternate": {"bow_phase": True}} if ours.bow_phase else {}
    return {row: replace(schedule, **change) for row, change in changes.items()}


def table_rows(data: PlayerData) -> tuple[str, ...]:
    """The rows of a table: the paper's, as far as they change something in the data, and ours."""
    rows = (row for row in ROWS[data.instrument] if data.label == PLANTED or row not in UNREJECTED)
    return (*rows, *OWN_ROWS)


def n_player_seeds(profile: RunProfile) -> int:
    """Trainings of each row."""
    return PLAYER_SEEDS if profile.epochs is None else QUICK_PLAYER_SEEDS


def player_errors(
    profile: RunProfile,
    data: PlayerData,
    *,
    rows: Iterable[str] | None = None,
    seeds: int | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """The errors of every training of every row, trained now unless before: one command for a whole table.

    `rows` are those of `table_rows` when left out, `seeds` as many as the profile says.

    Returns
    -------
    DataFrame with the columns data, instrument, row, seed, side (of `SIDES`, or "mean pose"), projected, full (pixels,
    or millimetres of real hands), minutes
    """
    names = table_rows(data) if rows is None else tuple(rows)
    jobs = [(row, seed) for seed in range(1, (seeds or n_player_seeds(profile)) + 1) for row in names]
    parts = []
    for row, seed in progress(jobs, f"{data.instrument}, {data.label}"):
        run = trained_player(profile, data, row_settings(data, row), seed)
        for side, values in run.errors.items():
            parts.append({"row": row, "seed": seed, "side": side, **values._asdict(), "minutes": run.minutes})
    table = pd.DataFrame(parts).assign(data=data.label, instrument=data.instrument)
    return table[["data", "instrument", "row", "seed", "side", "projected", "full", "minutes"]]


def error_table(values: pd.DataFrame) -> pd.DataFrame:
    """A table as the paper's: means and SDs over seeds of every setting; the paper's numbers in columns of their own.

    Returns
    -------
    DataFrame with the columns row, seeds, and for each side its projected and full error ("test full", "test full SD",
    ...), "of mean pose" (test, full), and "paper train", "paper validation", "paper test" (NaN where it has none)
    """
    instrument = str(values["instrument"].iloc[0])
    rows = []
    for row, own in values.groupby("row", sort=False):
        numbers: dict[str, Any] = {"row": row, "seeds": own["seed"].nunique()}
        for side in SIDES:
            for kind in ("projected", "full"):
                part = own.loc[own["side"] == side, kind]
                numbers |= {f"{side} {kind}": part.mean(), f"{side} {kind} SD": part.std(ddof=0)}
        mean_pose = own.loc[own["side"] == MEAN_POSE, "full"].mean()
        numbers["of mean pose"] = numbers["test full"] / mean_pose
        printed = ROWS[instrument][str(row)].printed if row in ROWS[instrument] else (np.nan,) * 3
        rows.append(numbers | {f"paper {side}": value for side, value in zip(SIDES, printed, strict=True)})
    return pd.DataFrame(rows)


def rank_agreement(values: pd.DataFrame, *, n_resamples: int = 1000, seed: int = 0) -> dict[str, float]:
    """Kendall's tau between the paper's test errors and ours, rows that both have; its interval by resampled seeds.

    Returns
    -------
    dict of "tau", "low", "high" (95 %), "p" (of no agreement), "rows"; low and high are NaN with one seed
    """
    instrument = str(values["instrument"].iloc[0])
    test = values[values["side"] == "test"]
    grid = test.pivot_table(index="row", columns="seed", values="projected")
    grid = grid.loc[[row for row in ROWS[instrument] if row in grid.index]]
    printed = [ROWS[instrument][str(row)].printed[2] for row in grid.index]
    tau, p_value = kendalltau(printed, grid.mean(axis=1))
    low = high = float("nan")
    if grid.shape[1] > 1:
        rng = np.random.default_rng(seed)
        draws = rng.integers(grid.shape[1], size=(n_resamples, *grid.shape))
        means = np.take_along_axis(np.broadcast_to(grid.to_numpy(), draws.shape), draws, axis=2).mean(axis=2)
        low, high = np.quantile([kendalltau(printed, mean)[0] for mean in means], (0.025, 0.975))
    return {"tau": tau, "low": float(low), "high": float(high), "p": p_value, "rows": len(grid)}
