"""Figures that show nothing but a table, drawn again from that table: ``python -m harmolab.lab.figures.redraw``.

A run of the notebooks takes hours in the full profile; a change of a figure's looks needs only its numbers.
"""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from harmolab.lab.figures.ablation import ablation_figure, trade_off_figure
from harmolab.lab.figures.cheating import listening_figure, tricks_figure
from harmolab.lab.figures.comparison import comparison_figure
from harmolab.lab.figures.quality import distances_figure
from harmolab.lab.figures.results import auc_figure, disturbances_figure, forced_choice_figure
from harmolab.lab.figures.style import MANIFEST, Saved, figures_folder, save_figure
from harmolab.lab.figures.variants import Record, by_corpus
from harmolab.lab.profile import RunProfile


def figures_of_tables(folder: Path) -> dict[str, Figure]:
    """Name -> the figure that stands under it in the manifest, from the tables in `folder`.

    Raises
    ------
    FileNotFoundError
        If a table is missing.
    """

    means = _records(folder, "table11_ablation")
    # The table of other weights is younger than the shipped figures: without it there are no marks for them.
    sweep = _records(folder, "table11d_trade_off") if (folder / "table11d_trade_off.csv").is_file() else []
    return {
        "cheating_generators": listening_figure(_records(folder, "table_generators_late")),
        "cheating_tricks": tricks_figure(_records(folder, "table_cheating_tricks")),
        "fig08b_auc_of_all_scores": auc_figure(pd.read_csv(folder / "table08b_auc.csv")),
        "fig08d_disturbances": disturbances_figure(pd.read_csv(folder / "table08g_beat_jitter.csv")),
        "fig09_frechet_distances": distances_figure(_records(folder, "table09_motion_quality")),
        "fig12_systems": comparison_figure(_records(folder, "table12_systems")),
        "fig13_machine_comparison": forced_choice_figure(by_corpus(_records(folder, "table13_machine_comparison"))),
        "fig11_harmony_loss": ablation_figure(means, _records(folder, "table11b_gains")),
        "fig11b_trade_off": trade_off_figure(means, sweep),
    }


def _records(folder: Path, name: str) -> list[Record]:
    return [dict(row) for _, row in pd.read_csv(folder / f"{name}.csv").iterrows()]


def redraw(profile: RunProfile) -> list[Saved]:
    """Every figure of `figures_of_tables` in the folder of a profile, saved under its own entry in the manifest."""
    folder = figures_folder(profile)
    entries = json.loads((folder / MANIFEST).read_text("utf-8"))
    saved = []
    for name, figure in figures_of_tables(folder).items():
        about = {key: entries[f"{name}.png"][key] for key in ("notebook", "source", "seed", "title")}
        saved.append(save_figure(figure, name, profile=profile, **about))
    return saved


if __name__ == "__main__":
    redraw(RunProfile.full())
