"""The table of an evaluation as text: CSV, JSON and LaTeX."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from types import MappingProxyType
from typing import Any

import pandas as pd

from harmolab.lab.evaluate.evaluation import Evaluation
from harmolab.lab.evaluate.methods import methods_paragraph, table_notes
from harmolab.lab.evaluate.sets import SetNumber
from harmolab.lab.evaluate.summary import Mean, measure_of

# Columns of the LaTeX table, those that were measured: name -> heading. The others are in the CSV file.
COLUMNS: Mapping[str, str] = MappingProxyType(
    {
        "harmony": "Harmony",
        "harmony_dance": "H. of dance",
        "paper_harmony": r"$h$",
        "paper_harmony_chance": r"$h$ by chance",
        "beat_align_motion": r"BA$_\mathrm{motion}$",
        "beat_align_music": r"BA$_\mathrm{music}$",
        "mir_eval_f": "Beat $F$",
        "fid_kinetic": r"FID$_k$",
        "fid_geometric": r"FID$_g$",
        "fid_pose": r"FID$_\mathrm{pose}$",
        "diversity_kinetic": r"Div$_k$",
        "diversity_geometric": r"Div$_g$",
        "pfc": "PFC",
        "foot_skating": "Skating",
        "freezing": "Freezing",
        "likeness": "Likeness",
    }
)
ARROWS = MappingProxyType({1: r" $\uparrow$", -1: r" $\downarrow$", 0: ""})
NO_MEAN, NO_NUMBER = Mean(math.nan, math.nan, math.nan, 0), SetNumber(math.nan, 0)
# Below so much, so many digits; rounding must not lead over the edge.
_DIGITS = ((0.00005, 2), (0.00995, 4), (0.0995, 3), (9.995, 2), (99.95, 1))
_LATEX = MappingProxyType(
    {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"}
    | {"[": "{[}", "*": "{*}"}  # at the begin of a row, the end of the row before would take them for its own
    | {mark: f"\\{mark}" for mark in "&%$#_{}"}
)


def number_text(value: float) -> str:
    """A number with two digits or three, "-" where there is none; never -0.

    >>> [number_text(value) for value in (0.1234, 0.00123, -0.00001, 12.34, 123.4, float("nan"))]
    ['0.12', '0.0012', '0.00', '12.3', '123', '-']
    """
    if not math.isfinite(value):
        return "-"
    digits = next((digits for most, digits in _DIGITS if abs(value) < most), 0)
    return f"{round(value, digits) + 0.0:.{digits}f}"


def table_records(evaluation: Evaluation) -> list[dict[str, Any]]:
    """A record for each row of the table: counts, then every measure with low, high and rank, then those of sets."""
    records = []
    for name in evaluation.rows:
        record: dict[str, Any] = {"system": name, "control": name in evaluation.controls}
        record |= evaluation.counts[name]._asdict()
        for measure in evaluation.measures:
            mean = evaluation.means.get((name, measure), NO_MEAN)
            record |= {measure: mean.mean, f"{measure}_low": mean.low, f"{measure}_high": mean.high}
            record[f"{measure}_rank"] = evaluation.ranks.get(measure, {}).get(name)
        for measure in evaluation.set_measures:
            number = evaluation.sets.get((name, measure), NO_NUMBER)
            record |= {measure: number.value, f"{measure}_n": number.n}
            if measure.startswith("fid_"):
                record |= {f"{measure}_raw": number.raw, f"{measure}_n_recorded": number.n_recorded}
        records.append(record)
    return records


def table_csv(evaluation: Evaluation) -> str:
    """One line a row of the table; empty where there is no number."""
    frame = pd.DataFrame(table_records(evaluation))
    ranked = [name for name in map(str, frame) if name.endswith("_rank")]
    return str(frame.astype(dict.fromkeys(ranked, "Int64")).to_csv(index=False))


def table_content(evaluation: Evaluation) -> dict[str, Any]:
    """Everything there is to say about the table, for JSON: rows, differences, remarks, methods, what was left out."""
    return {
        "harmolab": version("harmolab"),
        "settings": evaluation.settings.to_dict(),
        "measures": {name: measure_of(name)._asdict() for name in evaluation.measures},
        "rows": table_records(evaluation),
        "differences": [one._asdict() for one in evaluation.differences],
        "facts": {row: {name: dict(values) for name, values in facts.items()}
                  for row, facts in evaluation.facts.items()},
        "notes": list(table_notes(evaluation)),
        "methods": methods_paragraph(evaluation),
        "unpaired": [{"file": str(one.file), "reason": one.reason} for one in evaluation.unpaired],
        "errors": [{"file": str(one.file), "reason": one.reason} for one in evaluation.errors],
    }  # fmt: skip


def table_tex(evaluation: Evaluation) -> str:
    """A table for LaTeX with the package booktabs, those of `COLUMNS` that were measured, then those of a protocol.

    Intervals stand small behind the numbers. Bold is a first rank: better than another system beyond luck, and none
    better than it; where no difference excludes 0, nothing is bold.
    """
    records, protocol = table_records(evaluation), evaluation.settings.protocol
    own = {name: head + ARROWS[measure_of(name).better] for name, head in COLUMNS.items()}
    columns = (name.partition(" ") for name in (*evaluation.measures, *evaluation.set_measures))
    published = {"".join(parts): latex_text(parts[2]) for parts in columns if parts[0] == protocol}
    lines = [
        "% needs \\usepackage{booktabs}",
        "\\begin{table*}",
        "\\centering\\scriptsize\\setlength{\\tabcolsep}{2.5pt}",
        f"\\caption{{{_caption(evaluation)}}}",
        *_tabular(records, own),
        *_tabular(records, published, f"by the published code of {latex_text(protocol)}"),
        "\\end{table*}",
    ]
    return "\n".join(lines) + "\n"


def _tabular(records: list[dict[str, Any]], heads: Mapping[str, str], group: str = "") -> Iterator[str]:
    """Lines of the columns that hold a number, with a heading over them all where `group` is one; none without any."""
    names = [name for name in heads if any(math.isfinite(record.get(name, math.nan)) for record in records)]
    if not names:
        return
    if group:
        yield "\n\\medskip"
    yield f"\\begin{{tabular}}{{l{'c' * len(names)}}}"
    yield "\\toprule"
    if group:
        yield f" & \\multicolumn{{{len(names)}}}{{c}}{{{group}}} \\\\"
        yield f"\\cmidrule(lr){{2-{len(names) + 1}}}"
    yield f"{' & '.join(['System', *(heads[name] for name in names)])} \\\\"
    for controls in (False, True):
        yield "\\midrule"
        yield from _lines([record for record in records if record["control"] == controls], names)
    yield "\\bottomrule"
    yield "\\end{tabular}"


def _caption(evaluation: Evaluation) -> str:
    numbers = [count.songs for count in evaluation.counts.values()]
    few, many = min(numbers), max(numbers)
    songs = f"{few}" if few == many else f"{few} to {many}"
    protocol = latex_text(evaluation.settings.protocol)
    published = f" Columns of {protocol} follow that code, its faults and the bias included." if protocol else ""
    return (
        f"Means over {songs} songs with 95\\,\\% intervals by resampling songs. Bold: better than another system, the "
        "interval of the paired difference excluding 0, and none better. FID corrected for the bias of small samples. "
        f"Below the line: controls.{published} Computed with harmolab {latex_text(version('harmolab'))}."
    )


def _lines(records: list[dict[str, Any]], names: list[str]) -> Iterator[str]:
    for record in records:
        cells = [_cell(record, name) for name in names]
        yield f"{' & '.join([latex_text(record['system']), *cells])} \\\\"


def _cell(record: dict[str, Any], name: str) -> str:
    """A number with its interval, bold for a first rank."""
    value = number_text(record.get(name, math.nan))
    text = f"\\textbf{{{value}}}" if record.get(f"{name}_rank") == 1 else value
    low, high = (record.get(f"{name}_{end}", math.nan) for end in ("low", "high"))
    return text if math.isnan(low) else f"{text} {{\\tiny[{number_text(low)}, {number_text(high)}]}}"


def latex_text(text: str) -> str:
    """Text with the marks that LaTeX reads as commands written out; new lines and other controls are blanks.

    >>> latex_text("my_model & 50%")
    'my\\\\_model \\\\& 50\\\\%'
    """
    return "".join(_LATEX.get(mark, mark if mark.isprintable() else " ") for mark in text)
