"""Pictures that tables alone give, drawn again from the tables of a run: ``python -m study.figures.redraw``.

A run of the notebooks takes hours in the full profile; a change of a figure's looks needs only its numbers.
"""

import argparse
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from harmolab.lab.report import MANIFEST
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.music2dance.params import Music2DanceParams
from study.cells import notebook_cells
from study.figures import player_points, player_results
from study.figures.pictures import LENGTHS, PICTURES
from study.figures.words import corpus_words
from study.findings import RunTables
from study.profile import RunProfile
from study.saving import figures_folder, save_figure

# Other arguments. {source}: of the data; {corpus}: that in words; {untrained}: said of networks of a quick run.
CORPUS, REMARK = {"corpus": "{source}"}, {"remark": "{untrained}"}
REAL = {"players": "real hands, rendered sound", "unit": "millimetres"}
DRAWN = {name: getattr(Music2DanceParams.recommended(), name) for name in ("temperature", "smoothing", "draw_memory")}
OPTIONS: Mapping[str, Mapping[str, Any]] = {
    **dict.fromkeys(("fig08_picking_inharmonious_clips", "fig08c_bar_patterns", "m2d_fig11_clusters"), CORPUS),
    **dict.fromkeys(("m2d_table01_accuracy", "m2d_table01c_confusion", "m2d_song_probabilities"), REMARK),
    **{f"m2d_{length}": {"length": words} for length, words in LENGTHS.items()},
    "m2d_chance": {"used": DRAWN},
    "fig07_framework": {"params": {"paper": TrainParams.paper(), "ours": TrainParams.recommended()}},
    "fig08e_listening_study": {"label": "right answers", "title": "Who picks out late dances?"},
    "m2d_fig06_machine_marks": CORPUS,
    "m2d_fig08_hands": {"dance": "cha-cha", **CORPUS},
    "m2d_fig10_end_effectors": {"words": "{corpus}; cha-cha, a tenth of the spread drawn"},
    "a2b_table01_violin": {"players": "planted violinist"},
    "a2b_table02_piano": {"players": "planted pianist"},
    "a2b_fig05_epochs_piano": {"players": "planted piano", "unit": "pixels"},
    **dict.fromkeys(("a2b_fig05_epochs_hands", "a2b_hands"), REAL),
}
KEPT = ("notebook", "source", "seed", "title", "trained")  # of the entry in the manifest
RUN = ("commit", "date", "seconds", "experiment")  # of the run that the tables are of
cells = cache(notebook_cells)


def marks_of(marks: pd.DataFrame, corpus: str) -> Figure:
    """Marks by machine, by the weights they were given."""
    notebook = cells("16_music2dance")
    return notebook.marks_figure(marks, notebook.MARKS, corpus=corpus)


def cleaning_of(report: pd.DataFrame, faults: pd.DataFrame) -> Figure:
    """Rejected frames, with one row for all planted pieces of an instrument."""
    return player_points.cleaning_figure(cells("18_sound_and_points").cleaning_summary(report), faults)


def random_inputs_of(curves: pd.DataFrame, numbers: pd.DataFrame) -> Figure:
    """The piano's first component to sound that is no music."""
    piano = numbers[numbers["instrument"] == "piano"]
    return cells("19_sound_to_hands").random_inputs_figure(curves, piano, "planted piano")


def hits_of(violin: pd.DataFrame, piano: pd.DataFrame) -> Figure:
    """Error and hits of both instruments."""
    return player_results.hits_figure({"violin": violin, "piano": piano})


def place_of(name: str) -> Any:
    """A notebook's definitions, or a module of figures."""
    return cells(name) if name[0].isdigit() else import_module(f"study.figures.{name}")


def drawn_again(name: str, tables: RunTables, entry: Mapping[str, Any]) -> Figure:
    """The picture of that name, of the tables of a run and its entry in their manifest.

    Raises
    ------
    FileNotFoundError
        If a table is missing.
    """
    place, function, *given = PICTURES[name]
    frames = [tables[table] for table in given]
    untrained = "" if entry["profile"] == "full" else "quick profile: networks hardly trained"
    words = {"source": entry["source"], "corpus": corpus_words(entry["source"]), "untrained": untrained}
    options = {
        option: value.format_map(words) if isinstance(value, str) else value
        for option, value in OPTIONS.get(name, {}).items()
    }
    return getattr(place_of(place), function)(*frames, **options)


def redraw(folder: Path) -> Iterator[tuple[str, str]]:
    """Every picture of `PICTURES` saved again under its own entry in the manifest; and why one is left out, or ""."""
    tables, entries = RunTables(folder), json.loads((folder / MANIFEST).read_text("utf-8"))
    profiles = {profile.name: profile for profile in (RunProfile.quick(), RunProfile.full())}
    for name, (_, _, *given) in PICTURES.items():
        missing = [f"{table}.csv" for table in given if table not in set(tables)]
        entry = entries.get(f"{name}.png")
        if missing:
            yield name, f"its table {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not there"
        elif entry is None:
            yield name, "the manifest does not name it: no run has drawn it"
        else:
            about = {key: entry[key] for key in KEPT if key in entry}
            figure = drawn_again(name, tables, entry)
            run = {key: entry[key] for key in RUN if key in entry}
            save_figure(figure, name, profile=profiles[entry["profile"]], run=run, **about)
            yield name, ""


def main(argv: Sequence[str] | None = None) -> None:
    """One line a picture, and their number."""
    parser = argparse.ArgumentParser(description="Draw the pictures of a run again from its tables.")
    parser.add_argument("--folder", type=Path, default=figures_folder(RunProfile.full()))
    folder = parser.parse_args(argv).folder
    os.environ["HARMOLAB_FIGURES"] = str(folder)
    begun, left_out = perf_counter(), 0
    for number, (name, reason) in enumerate(redraw(folder), 1):
        left_out += bool(reason)
        print(f"{number:2d} of {len(PICTURES)}: {name}" + f" is left out: {reason}" * bool(reason), flush=True)
    print(f"{len(PICTURES) - left_out} drawn, {left_out} left out, {perf_counter() - begun:.0f} s: {folder}")


if __name__ == "__main__":
    main()
