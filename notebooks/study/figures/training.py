"""Course of a training: every loss term epoch by epoch, and the scores of validation units meanwhile (Fig. 7)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.types import FloatArray
from study.figures.variants import LOOKS, Record

PRETRAIN = "pretrain"
# Panels of the losses in reading order: title, column of the history, variants that share its scale (None: all). The
# other terms stand in history.csv.
TERMS: tuple[tuple[str, str, tuple[str, ...] | None], ...] = (
    ("poses of unseen units (Eq. 25)", "val_mse", None),
    ("paper's harmony (Eq. 27)", "harmony", ("paper",)),
    ("our harmony", "harmony", ("recommended",)),
)
VALIDATED = MappingProxyType(
    {
        "val_harmony": "paper's harmony h",
        "val_hit_rate": "paper's hit rate",
        "val_above_chance": "harmony above chance, in the room",
        "val_body_above_chance": "harmony above chance, in the body",
        "val_spread": "spread of poses / recorded",
        "val_count_ratio": "beats danced / heard",
    }
)
_STYLES = MappingProxyType({True: "-", False: (0, (4, 1.5))})  # with the harmony term, without


def draw_term(ax: Axes, rows: Sequence[Record], column: str, variants: Sequence[str]) -> Axes:
    """One column of the history over all epochs, a line for each variant; the pretraining epochs of all lie on grey.

    Parameters
    ----------
    ax : Axes
    rows : records of `study.experiments.generation.histories`: "variant", "phase" and the columns of history.csv
    column : name of a loss term; NaN (or absent) where an epoch does not have it
    variants : names in `LOOKS`
    """
    for name in variants:
        values = _column(rows, column, name)
        epochs = np.flatnonzero(np.isfinite(values)) + 1
        ax.plot(epochs, values[epochs - 1], **_line(name, epochs.size))
    before = min((_pretrained(rows, name) for name in _named(rows)), default=0)
    if any(np.isfinite(_column([row for row in rows if row["phase"] == PRETRAIN], column))):
        ax.axvspan(0.5, before + 0.5, color=COLOURS["faint"], alpha=0.5, linewidth=0, zorder=0, gid="pretraining")
    ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    return ax


def draw_validated(ax: Axes, rows: Sequence[Record], column: str) -> Axes:
    """Score of the validation units after each adversarial epoch; 0 is the end of the pretraining.

    Parameters
    ----------
    rows : as for `draw_term`
    column : name in `VALIDATED`
    """
    for name in _named(rows):
        before = _pretrained(rows, name)
        values = _column(rows, column, name)[max(before - 1, 0) :]
        epochs = np.flatnonzero(np.isfinite(values))
        ax.plot(epochs + (0 if before else 1), values[epochs], **_line(name, epochs.size))
    levels = {"val_above_chance": 0.0, "val_body_above_chance": 0.0, "val_spread": 1.0, "val_count_ratio": 1.0}
    if column in levels:
        ax.axhline(levels[column], color=COLOURS["chance"], linestyle=":", linewidth=1.5, zorder=0)
    if column != "val_count_ratio":
        low, high = ax.get_ylim()
        ax.set_ylim(min(low, 0.0), max(high, 1.0))
    ax.set_title(VALIDATED[column], fontsize=10.5)
    ax.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    return ax


def losses_figure(rows: Iterable[Record]) -> Figure:
    """`draw_term` for both harmony losses and the poses of unseen units; titles say where each begins and ends."""
    table = list(rows)
    names = _named(table)
    with styled_axes((9.0, 4.0), 1, len(TERMS)) as (figure, axes):
        for ax, (title, column, shared) in zip(axes, TERMS, strict=True):
            finite = [name for name in names if np.isfinite(_column(table, column, name)).any()]
            kept = [name for name in finite if name in (shared or names)]
            draw_term(ax, table, column, kept).set_title(f"{title}\n{_course(table, column, kept)}", fontsize=10)
        figure.supxlabel("epoch", fontsize=10)
        figure.supylabel("mean over the epoch's batches", fontsize=10)
        band = Patch(facecolor=COLOURS["faint"], alpha=0.5, label="pretraining")
        figure.legend(handles=[*_handles(names), band], loc="outside upper center", ncols=3)
    return figure


def _course(rows: Sequence[Record], column: str, names: Sequence[str]) -> str:
    """Number of variants that end lower than they begin; of a single one, both values."""
    ends = []
    for name in names:
        values = _column(rows, column, name)
        ends.append(values[np.isfinite(values)][[0, -1]])
    if len(ends) == 1:
        return f"{ends[0][0]:.2f} → {ends[0][1]:.2f}"
    return f"lower at the end for {sum(last < first for first, last in ends)} of {len(ends)}"


def validation_figure(rows: Iterable[Record]) -> Figure:
    """`draw_validated` for the paper's two scores, beside four measures that they leave out."""
    table = list(rows)
    with styled_axes((9.0, 6.2), 2, 3) as (figure, axes):
        for ax, column in zip(axes, VALIDATED, strict=True):
            draw_validated(ax, table, column)
        figure.supxlabel("adversarial epoch (0: end of pretraining)", fontsize=10)
        figure.legend(handles=_handles(_named(table)), loc="outside upper left", ncols=4)
    return figure


def _column(rows: Sequence[Record], column: str, variant: str = "") -> FloatArray:
    """Values of one column, of one variant if one is named; NaN where a row does not have it."""
    named = [row for row in rows if variant in ("", row["variant"])]
    return np.array([row.get(column, np.nan) for row in named], dtype=np.float64)


def _pretrained(rows: Sequence[Record], name: str) -> int:
    """Pretraining epochs of a variant."""
    return sum(row["phase"] == PRETRAIN for row in rows if row["variant"] == name)


def _named(rows: Sequence[Record]) -> list[str]:
    """Variants of the rows, in the order of `LOOKS`."""
    names = {row["variant"] for row in rows}
    return [name for name in LOOKS if name in names]


def _line(name: str, n_points: int) -> dict[str, Any]:
    """Look of a variant's line; few points are marked one by one."""
    look = LOOKS[name]
    mark = {"marker": look.marker, "markersize": 4.5, "markerfacecolor": look.colour if look.filled else "white"}
    return {"color": look.colour, "linestyle": _STYLES[look.filled], **(mark if n_points <= 20 else {})}


def _handles(names: Sequence[str]) -> list[Line2D]:
    return [Line2D([], [], label=LOOKS[name].label, **_line(name, 1)) for name in names]
