"""The table of an evaluation in LaTeX, with the package booktabs."""

import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Any

from harmolab.lab.evaluate import as_text
from harmolab.lab.evaluate.evaluation import Evaluation
from harmolab.lab.evaluate.measured import DANCE_MEASURES, MUSIC_MEASURES
from harmolab.lab.evaluate.protocols import protocol_of
from harmolab.lab.evaluate.summary import measure_of

# Headings of measures of sets of dances, of those that were measured.
SET_COLUMNS: Mapping[str, str] = {
    **{"fid_kinetic": r"FID$_k$", "fid_geometric": r"FID$_g$", "fid_pose": r"FID$_\mathrm{pose}$"},
    **{"diversity_kinetic": r"Div$_k$", "diversity_geometric": r"Div$_g$"},
}
PUBLISHED_COLUMNS = ("FID_k", "FID_g", "Div_k", "Div_g", "BeatAlign", "BAS", "PFC")  # in the order of papers
DEAF, CONSTANT = r"$^\dagger$", r"$^\ddagger$"  # marks of a heading, and of a number
ARROWS = MappingProxyType({1: r" $\uparrow$", -1: r" $\downarrow$", 0: ""})
_LATEX = MappingProxyType(
    {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"}
    | {"[": "{[}", "*": "{*}"}  # at the begin of a row, the end of the row before would take them for its own
    | {mark: f"\\{mark}" for mark in "&%$#_{}"}
)


def table_tex(evaluation: Evaluation) -> str:
    """A table for LaTeX with the package booktabs: our columns, those that were measured, then those of protocols.

    Intervals stand small behind the numbers. Bold is a first rank: better than another system beyond luck, and none
    better than it; where no difference excludes 0, nothing is bold.
    """
    records, deaf = as_text.table_records(evaluation), set(as_text.deaf_measures(evaluation))
    heads = _heads(evaluation)

    def marked(group: str) -> dict[str, str]:
        marks = {name: (DEAF if name in deaf else "") + ARROWS[measure_of(name).better] for name in heads[group]}
        return {name: head + marks[name] for name, head in heads[group].items()}

    blocks = [list(_tabular(records, {"": marked(group)})) for group in ("music", "body")]
    protocols = {latex_text(name): marked(name) for name in evaluation.settings.protocols}
    blocks.append(list(_tabular(records, protocols)))
    lines = [line for block in blocks if block for line in ("", "\\medskip", *block)]
    caption = _caption(evaluation, {name: head for names in heads.values() for name, head in names.items()})
    return "\n".join([
        "% needs \\usepackage{booktabs}",
        "\\begin{table*}",
        "\\centering\\scriptsize\\setlength{\\tabcolsep}{2.5pt}",
        f"\\caption{{{caption}}}",
        *lines[2:],
        "\\end{table*}",
        "",
    ])  # fmt: skip


def _heads(evaluation: Evaluation) -> dict[str, dict[str, str]]:
    """Groups of columns that were measured -> column -> heading in LaTeX: two of our own, then those of protocols."""
    columns = (*evaluation.measures, *evaluation.set_measures)
    sets = {name: head for name, head in SET_COLUMNS.items() if name in columns}
    music, body = (
        {name: measure.head for name, measure in own.items() if measure.head and name in columns}
        for own in (MUSIC_MEASURES, DANCE_MEASURES)
    )
    heads = {"music": music, "body": sets | body}
    for protocol in evaluation.settings.protocols:
        names = [name.partition(" ")[2] for name in columns if name.startswith(f"{protocol} ")]
        ordered = sorted(names, key=lambda name: (*PUBLISHED_COLUMNS, name).index(name))
        heads[protocol] = {f"{protocol} {name}": _subscript(name) for name in ordered}
    return heads


def _subscript(name: str) -> str:
    """A name in LaTeX, the letter behind its mark set low: FID_k is FID$_k$."""
    stem, _, letter = name.partition("_")
    return f"{latex_text(stem)}$_{letter}$" if len(letter) == 1 else latex_text(name)


def _tabular(records: list[dict[str, Any]], groups: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Lines of groups of columns, those that hold a number, each below its title if it has one; none without any."""
    has_numbers = {name for record in records for name, value in record.items() if _is_number(value)}
    held = {title: [name for name in heads if name in has_numbers] for title, heads in groups.items()}
    held = {title: names for title, names in held.items() if names}
    if not held:
        return
    columns = {name: groups[title][name] for title, names in held.items() for name in names}
    yield f"\\begin{{tabular}}{{l{'c' * len(columns)}}}"
    yield "\\toprule"
    if any(held):
        yield from _titles({title: len(names) for title, names in held.items()})
    yield f"{' & '.join(['System', *columns.values()])} \\\\"
    for controls in (False, True):
        yield "\\midrule"
        for record in (record for record in records if record["control"] == controls):
            yield f"{' & '.join([latex_text(record['system']), *(_cell(record, name) for name in columns)])} \\\\"
    yield "\\bottomrule"
    yield "\\end{tabular}"


def _titles(widths: Mapping[str, int]) -> Iterator[str]:
    """The line of the titles over so many columns each, and the rules below them."""
    yield "".join(f" & \\multicolumn{{{width}}}{{c}}{{{title}}}" for title, width in widths.items()) + " \\\\"
    ends = list(accumulate(widths.values(), initial=1))
    yield "".join(f"\\cmidrule(lr){{{first + 1}-{last}}}" for first, last in pairwise(ends))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _caption(evaluation: Evaluation, heads: Mapping[str, str]) -> str:
    songs = as_text.number_range(count.songs for count in evaluation.counts.values())
    others = ((head, _songs_of(evaluation, name)) for name, head in heads.items())
    fewer = [f"{head}: {text}" for head, text in others if text not in ("", songs)]
    few = f" ({'; '.join(fewer)})" if fewer else ""
    protocols = [one for one in evaluation.settings.protocols if any(name.startswith(f"{one} ") for name in heads)]
    parts = [
        f"Means over {songs} songs{few} with 95\\,\\% intervals by resampling "
        "songs. Bold: better than another system, the interval of the paired difference excluding 0, and none better. "
        "FID corrected for the bias of small samples. Below the line: controls."
    ]
    if evaluation.missing:
        parts.append(f"Measured: {latex_text(as_text.measured_text(evaluation))}.")
    if protocols:
        parts.append(
            f"Columns of {latex_text(', '.join(protocols))} follow these published codes, their faults and the bias of "
            "small samples included; means over dances; recorded: the ground truth."
        )
        missing = ((name, protocol_of(name).missing) for name in protocols)
        parts += [latex_text(f"{name}: {text}") for name, text in missing if text]
    if heads.keys() & set(as_text.deaf_measures(evaluation)):
        parts.append(f"{DEAF}: does not tell recorded dances from the same with another song.")
    if any(as_text.constant_features(evaluation, name) for name in heads):
        parts.append(f"{CONSTANT}: meaningless, of features that are constant in the reference.")
    return " ".join([*parts, f"Computed with harmolab {latex_text(version('harmolab'))}."])


def _songs_of(evaluation: Evaluation, measure: str) -> str:
    """The numbers of songs that the means of a measure are over; "" for a measure of sets."""
    numbers = [mean.songs for (_, name), mean in evaluation.means.items() if name == measure]
    return as_text.number_range(numbers) if numbers else ""


def _cell(record: dict[str, Any], name: str) -> str:
    """A number with its interval, bold for a first rank, marked where it rests on features that are constant."""
    value = _number(record.get(name, math.nan))
    text = f"\\textbf{{{value}}}" if record.get(f"{name}_rank") == 1 else value
    text += CONSTANT if record.get(f"{name}_constant") else ""
    low, high = (record.get(f"{name}_{end}", math.nan) for end in ("low", "high"))
    return text if math.isnan(low) else f"{text} {{\\tiny[{_number(low)}, {_number(high)}]}}"


def _number(value: float) -> str:
    """A number with a minus sign, where the text of a table has a hyphen."""
    text = as_text.number_text(value)
    return f"$-${text[1:]}" if text[1:] and text[0] == "-" else text


def latex_text(text: str) -> str:
    """Text with the marks that LaTeX reads as commands written out; new lines and other controls are blanks.

    >>> latex_text("my_model & 50%")
    'my\\\\_model \\\\& 50\\\\%'
    """
    return "".join(_LATEX.get(mark, mark if mark.isprintable() else " ") for mark in text)
