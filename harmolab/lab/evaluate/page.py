"""The page of an evaluation, and all its files written in one go."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from harmolab.files import PathLike, plain, write_text
from harmolab.lab.evaluate import as_text
from harmolab.lab.evaluate.evaluation import CLIPS, Evaluation, Extreme
from harmolab.lab.evaluate.findings import findings
from harmolab.lab.evaluate.latex import table_tex
from harmolab.lab.evaluate.measured import MEASURES
from harmolab.lab.evaluate.rows import pair_clip
from harmolab.lab.evaluate.summary import measure_of
from harmolab.lab.figures.beats import png_text
from harmolab.lab.figures.evaluation import distribution_figure
from harmolab.lab.player_data import player_of
from harmolab.lab.report.templates import rendered
from harmolab.params import HarmonyParams

SHOWN_SECONDS = 20.0  # of a dance in the page's players
LISTED = 200  # files that the page names as left out; table.json has them all


class Shown(NamedTuple):
    """A dance in a player: its heading, the page of the player, and the reason where there is none."""

    title: str
    player: str
    reason: str


def write_evaluation(out: PathLike, evaluation: Evaluation) -> dict[str, Path]:
    """Write an evaluation as a page to read, a table in three formats, and a paragraph for the methods of a paper.

    The files are index.html, table.csv, table.json, table.tex and methods.txt. Nothing is written unless all can be
    made.

    Parameters
    ----------
    out : str or path
        Folder, usually that of `evaluate_dances`.
    evaluation : Evaluation

    Returns
    -------
    dict: name -> path of each file, and of clips.csv, which `evaluate_dances` wrote

    Raises
    ------
    ValueError
        Unless an Evaluation is passed.
    """
    if not isinstance(evaluation, Evaluation):
        raise ValueError(f"an evaluation of evaluate_dances is needed, got {type(evaluation).__name__}")
    content = plain({**as_text.table_content(evaluation), "findings": list(findings(evaluation))})
    texts = {
        "index.html": evaluation_page(evaluation),
        "methods.txt": f"{as_text.methods_paragraph(evaluation)}\n\n{as_text.full_methods(evaluation)}\n",
        "table.csv": as_text.table_csv(evaluation),
        "table.json": json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False),
        "table.tex": table_tex(evaluation),
    }
    paths = {name: Path(out) / name for name in texts}
    for name, text in texts.items():
        write_text(paths[name], text)
    return paths | {CLIPS: Path(out) / CLIPS}


def evaluation_page(evaluation: Evaluation) -> str:
    """One HTML page with table, distributions, best and worst dances, and the methods; it needs no network."""
    records = as_text.table_records(evaluation)
    charts = [name for name in evaluation.measures if name not in MEASURES or MEASURES[name].drawn]
    left_out = [*evaluation.errors, *evaluation.unpaired]
    notes = list(as_text.table_notes(evaluation))
    return rendered(
        "evaluation.html.j2",
        title=f"{', '.join(evaluation.systems)}: harmony and movement",
        findings=list(findings(evaluation)),
        records=[_marked(evaluation, record, notes) for record in records],
        groups=[(title, [_line(records, name, notes) for name in names]) for title, names in _groups(evaluation)],
        charts=[(measure_of(name).words, _chart(evaluation, name)) for name in charts],
        differences=list(_differences(evaluation)),
        compared=len(evaluation.systems) > 1,
        dances=list(_players(evaluation)),
        shown_seconds=SHOWN_SECONDS,
        notes=notes,
        methods=as_text.methods_paragraph(evaluation),
        full_methods=as_text.full_methods(evaluation).split("\n\n"),
        left_out=[(str(one.file), one.reason) for one in left_out[:LISTED]],
        more=max(0, len(left_out) - LISTED),
    )


def _groups(evaluation: Evaluation) -> Iterator[tuple[str, Sequence[str]]]:
    """Title and measures of each part of the table: our own of single dances and of sets, then those of protocols."""
    columns = (*evaluation.measures, *evaluation.set_measures)
    yield "", [name for name in evaluation.measures if name in MEASURES]
    yield "", [name for name in evaluation.set_measures if " " not in name]
    for protocol in evaluation.settings.protocols:
        title = f"by the published code of {protocol}, its faults included: means over dances"
        yield title, [name for name in columns if name.startswith(f"{protocol} ")]


def _line(records: list[dict[str, Any]], name: str, notes: Sequence[as_text.Note]) -> dict[str, Any]:
    """A line of the page's table: a measure in words, its direction, remarks, and a cell for each row of the table."""
    measure = measure_of(name)
    cells = [_cell(record, name) for record in records]
    return {"words": measure.words, "better": measure.better, "cells": cells, "marks": _marks(notes, name)}


def _marked(evaluation: Evaluation, record: dict[str, Any], notes: Sequence[as_text.Note]) -> dict[str, Any]:
    """A record with the numbers of the remarks that concern it, and how many of its dances were measured."""
    name = record["system"]
    return {**record, "marks": _marks(notes, name), "measured": evaluation.counts[name].text}


def _marks(notes: Sequence[as_text.Note], name: str) -> list[int]:
    """Numbers of the remarks that concern a row or a measure, from 1."""
    return [number for number, note in enumerate(notes, 1) if name in note.about]


def _cell(record: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The texts of a number, of its interval or its sample sizes, and its rank."""
    low, high = (record.get(f"{name}_{end}", math.nan) for end in ("low", "high"))
    sizes = [record.get(f"{name}_{each}", math.nan) for each in ("n", "n_recorded")]
    beside = "" if math.isnan(low) else f"{as_text.number_text(low)} to {as_text.number_text(high)}"
    if sizes[0] > 0:
        beside = f"{' and '.join(f'{size:.0f}' for size in sizes if size == size)} dances"
    return {"value": as_text.number_text(record[name]), "beside": beside, "rank": record.get(f"{name}_rank")}


def _chart(evaluation: Evaluation, name: str) -> str:
    """The picture of a measure, song by song."""
    values = evaluation.songs[name].dropna()
    rows = {row: values.loc[row] for row in evaluation.rows if (row, name) in evaluation.means}
    means = {row: evaluation.means[row, name] for row in rows}
    return png_text(distribution_figure(rows, means, controls=evaluation.controls))


def _differences(evaluation: Evaluation) -> Iterator[dict[str, Any]]:
    """The differences between two systems that exclude 0, in measures that have a direction."""
    for one in evaluation.differences:
        if one.is_clear and {one.a, one.b} <= evaluation.ranks[one.measure].keys():
            text = "{} ({} to {})".format(*map(as_text.number_text, (one.mean, one.low, one.high)))
            yield one._asdict() | {"measure": measure_of(one.measure).words, "difference": text}


def _players(evaluation: Evaluation) -> Iterator[Shown]:
    """The best and the worst dance of each system and of the recorded ones."""
    for system, (worst, best) in evaluation.extremes.items():
        among = f" of {best.dances}" if best.dances > 1 else ""
        yield _in_player(evaluation, best, f"{system}: best{among}")
        if worst.pair != best.pair:
            yield _in_player(evaluation, worst, f"{system}: worst{among}")


def _in_player(evaluation: Evaluation, extreme: Extreme, words: str) -> Shown:
    pair = extreme.pair
    seed = f", {pair.seed}" if pair.seed else ""
    title = f"{words}, {pair.song}{seed} ({as_text.number_text(extreme.harmony)} above chance)"
    try:
        clip = pair_clip(pair, evaluation.options)
        seconds = min(SHOWN_SECONDS, clip.audio.duration)
        params = HarmonyParams.recommended()
        player = player_of([clip], seconds=seconds, title=title, params=params, looks=extreme.dances)
        return Shown(title, player.page, "")
    except (ValueError, OSError) as error:
        return Shown(title, "", str(error))
