"""Figures that show nothing but a table, drawn again from that table: ``python -m study.figures.redraw``.

A run of the notebooks takes hours in the full profile; a change of a figure's looks needs only its numbers.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from harmolab.lab.report.pages import MANIFEST
from harmolab.systems.music2dance.params import Music2DanceParams
from study.figures import attributes, feet, music2dance, player_results, results, variants
from study.findings import RunTables
from study.profile import RunProfile
from study.saving import Saved, figures_folder, save_figure

CORPUS = "beatlocked"  # of the tables that do not name it
LENGTHS = ("a minute", "a minute on synthetic movement", "ten minutes")
# Weights of the machine's marks; a test holds them to those of notebook 16.
WEIGHTS: Mapping[str, float] = {"naturalness": 0.25, "richness": 0.25, "music": 0.4, "sliding": 0.1}
RATERS = {"label": "right answers", "title": "Who picks out late dances?"}
DRAWN = ("temperature", "smoothing", "draw_memory")


def figures_of_tables(folder: Path) -> Iterator[tuple[str, Figure]]:
    """Every figure and its name in the manifest, from the tables in `folder`.

    The figure of other weights of the harmony loss is the first of them where its table is.

    Raises
    ------
    FileNotFoundError
        If a table is missing.
    """
    tables = RunTables(folder)
    means = tables["table11_ablation"]
    if "table11d_trade_off" in set(tables):
        yield "fig11b_trade_off", variants.trade_off_figure(means, tables["table11d_trade_off"])
    study_rows: list[Any] = tables["table08e_listening_study"].to_dict("records")
    yield from {
        "cheating_generators": variants.listening_figure(tables["table_generators_late"]),
        "cheating_tricks": variants.tricks_figure(tables["table_cheating_tricks"]),
        "fig08_picking_inharmonious_clips": results.picks_figure(tables["table08h_picked_clips"], corpus=CORPUS),
        "fig08b_auc_of_all_scores": results.auc_figure(tables["table08b_auc"]),
        "fig08c_bar_patterns": results.patterns_figure(tables["fig08c_bar_patterns"], corpus=CORPUS),
        "fig08d_disturbances": results.disturbances_figure(tables["table08g_beat_jitter"]),
        "fig08e_listening_study": results.rates_figure(study_rows, **RATERS),
        "fig08f_levels": results.levels_figure(tables["table08i_levels"]),
        "fig08g_false_alarms": results.nulls_figure(tables["table08f_false_alarms"]),
        "fig09_frechet_distances": variants.distances_figure(tables["table09_motion_quality"]),
        "fig12_systems": variants.comparison_figure(tables["table12_systems"]),
        "fig13_machine_comparison": variants.forced_choice_figure(tables["table13_machine_comparison"]),
        "fig11_harmony_loss": variants.ablation_figure(means, tables["table11b_gains"]),
    }.items()
    yield from _music2dance_figures(tables).items()
    yield from _player_figures(tables).items()


def _music2dance_figures(tables: RunTables) -> dict[str, Figure]:
    """Figures of Music2Dance."""
    params = Music2DanceParams.recommended()
    used = {name: getattr(params, name) for name in DRAWN}
    files = {length: f"m2d_{length.replace(' ', '_')}" for length in LENGTHS}
    return {
        **{file: music2dance.limits_figure(tables[f"{file}_table"], length=length) for length, file in files.items()},
        "m2d_chance": music2dance.chance_figure(tables["m2d_table_chance"], used=used),
        "m2d_fig06_machine_marks": music2dance.marks_figure(tables["m2d_table03_machine"], WEIGHTS, corpus=CORPUS),
        "m2d_table01_accuracy": attributes.accuracy_figure(tables["m2d_table01"], tables["m2d_table01b_differences"]),
        "m2d_table02_foot_models": feet.ways_figure(tables["m2d_table02"]),
    }


def _player_figures(tables: RunTables) -> dict[str, Figure]:
    """Figures of Audio to Body Dynamics."""
    hands, violin, piano = (tables[f"a2b_{name}"] for name in ("hands", "table01_violin", "table02_piano"))
    hits = {instrument: tables[f"a2b_hits_{instrument}"] for instrument in ("violin", "piano")}
    real = {"players": "real hands, rendered sound", "unit": "millimetres"}
    return {
        "a2b_component_correlations": player_results.components_figure(tables["a2b_component_correlations"]),
        "a2b_hands": player_results.player_table_figure(hands, **real),
        "a2b_hits": player_results.hits_figure(hits),
        "a2b_table01_violin": player_results.player_table_figure(violin, players="planted violinist"),
        "a2b_table02_piano": player_results.player_table_figure(piano, players="planted pianist"),
    }


def redraw(profile: RunProfile) -> list[Saved]:
    """Every figure of `figures_of_tables` in the folder of a profile, saved under its own entry in the manifest."""
    folder = figures_folder(profile)
    entries = json.loads((folder / MANIFEST).read_text("utf-8"))
    saved = []
    for name, figure in figures_of_tables(folder):
        about = {key: entries[f"{name}.png"][key] for key in ("notebook", "source", "seed", "title")}
        saved.append(save_figure(figure, name, profile=profile, **about))
    return saved


if __name__ == "__main__":
    redraw(RunProfile.full())
