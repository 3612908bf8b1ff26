"""Figures that show nothing but a table, drawn again from that table: ``python -m study.figures.redraw``.

A run of the notebooks takes hours in the full profile; a change of a figure's looks needs only its numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pandas as pd
from matplotlib.figure import Figure

from harmolab.lab.report.pages import MANIFEST
from harmolab.systems.music2dance.params import Music2DanceParams
from study.figures.ablation import ablation_figure, trade_off_figure
from study.figures.attributes import accuracy_figure
from study.figures.cheating import listening_figure, tricks_figure
from study.figures.comparison import comparison_figure
from study.figures.feet import ways_figure
from study.figures.listening import rates_figure
from study.figures.music2dance import chance_figure, limits_figure, marks_figure
from study.figures.player_results import components_figure, hits_figure, player_table_figure
from study.figures.quality import distances_figure
from study.figures.results import auc_figure, disturbances_figure, forced_choice_figure, patterns_figure, picks_figure
from study.figures.variants import Record, by_corpus
from study.figures.verdicts import levels_figure, nulls_figure
from study.profile import RunProfile
from study.saving import Saved, figures_folder, save_figure

CORPUS = "beatlocked"  # of the tables that do not name it
LENGTHS = ("a minute", "a minute on synthetic movement", "ten minutes")
# Weights of the machine's marks; a test holds them to those of notebook 16.
WEIGHTS: Mapping[str, float] = MappingProxyType({"naturalness": 0.25, "richness": 0.25, "music": 0.4, "sliding": 0.1})
DRAWN = ("temperature", "smoothing", "draw_memory")


def figures_of_tables(folder: Path) -> dict[str, Figure]:
    """Name -> the figure that stands under it in the manifest, from the tables in `folder`.

    The figure of other weights of the harmony loss is among them where its table is.

    Raises
    ------
    FileNotFoundError
        If a table is missing.
    """
    means = _records(folder, "table11_ablation")
    return {
        "cheating_generators": listening_figure(_records(folder, "table_generators_late")),
        "cheating_tricks": tricks_figure(_records(folder, "table_cheating_tricks")),
        "fig08_picking_inharmonious_clips": picks_figure(_table(folder, "table08h_picked_clips"), corpus=CORPUS),
        "fig08b_auc_of_all_scores": auc_figure(_table(folder, "table08b_auc")),
        "fig08c_bar_patterns": patterns_figure(_table(folder, "fig08c_bar_patterns"), corpus=CORPUS),
        "fig08d_disturbances": disturbances_figure(_table(folder, "table08g_beat_jitter")),
        "fig08e_listening_study": rates_figure(
            _records(folder, "table08e_listening_study"), label="right answers", title="Who picks out late dances?"
        ),
        "fig08f_levels": levels_figure(_table(folder, "table08i_levels")),
        "fig08g_false_alarms": nulls_figure(_table(folder, "table08f_false_alarms")),
        "fig09_frechet_distances": distances_figure(_records(folder, "table09_motion_quality")),
        "fig12_systems": comparison_figure(_records(folder, "table12_systems")),
        "fig13_machine_comparison": forced_choice_figure(by_corpus(_records(folder, "table13_machine_comparison"))),
        "fig11_harmony_loss": ablation_figure(means, _records(folder, "table11b_gains")),
        **_trade_off(folder, means),
        **_music2dance_figures(folder),
        **_player_figures(folder),
    }


def _trade_off(folder: Path, means: list[Record]) -> dict[str, Figure]:
    if not (folder / "table11d_trade_off.csv").is_file():
        return {}
    return {"fig11b_trade_off": trade_off_figure(means, _records(folder, "table11d_trade_off"))}


def _music2dance_figures(folder: Path) -> dict[str, Figure]:
    """Figures of Music2Dance."""
    params = Music2DanceParams.recommended()
    used = {name: getattr(params, name) for name in DRAWN}
    files = {length: f"m2d_{length.replace(' ', '_')}" for length in LENGTHS}
    limits = {file: limits_figure(_table(folder, f"{file}_table"), length=length) for length, file in files.items()}
    accuracies = (_records(folder, name) for name in ("m2d_table01", "m2d_table01b_differences"))
    return {
        **limits,
        "m2d_chance": chance_figure(_table(folder, "m2d_table_chance"), used=used),
        "m2d_fig06_machine_marks": marks_figure(_table(folder, "m2d_table03_machine"), WEIGHTS, corpus=CORPUS),
        "m2d_table01_accuracy": accuracy_figure(*accuracies),
        "m2d_table02_foot_models": ways_figure(_records(folder, "m2d_table02")),
    }


def _player_figures(folder: Path) -> dict[str, Figure]:
    """Figures of Audio to Body Dynamics."""
    hits = {instrument: _table(folder, f"a2b_hits_{instrument}") for instrument in ("violin", "piano")}
    return {
        "a2b_component_correlations": components_figure(_table(folder, "a2b_component_correlations")),
        "a2b_hands": player_table_figure(
            _table(folder, "a2b_hands"), players="real hands, rendered sound", unit="millimetres"
        ),
        "a2b_hits": hits_figure(hits),
        "a2b_table01_violin": player_table_figure(_table(folder, "a2b_table01_violin"), players="planted violinist"),
        "a2b_table02_piano": player_table_figure(_table(folder, "a2b_table02_piano"), players="planted pianist"),
    }


def _table(folder: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(folder / f"{name}.csv")


def _records(folder: Path, name: str) -> list[Record]:
    return [{str(key): value for key, value in row.items()} for row in _table(folder, name).to_dict("records")]


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
