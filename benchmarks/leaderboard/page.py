"""`docs/leaderboard.md` as text, from the rows of the leaderboard."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from harmolab.lab.evaluate.as_text import number_text
from harmolab.lab.evaluate.rows import CONTROLS
from harmolab.lab.evaluate.submission import TABLE_MEASURES
from harmolab.lab.evaluate.summary import measure_of

SCORES = {
    "recommended": "recommended score of harmolab",
    "paper": "harmony h (paper)",
    "hit_rate": "hit rate (paper)",
    "beat_align_motion": "beat alignment, over motion beats (AIST++)",
    "beat_align_music": "beat alignment, over music beats (Bailando)",
    "beat_hit_rate": "beat hit rate",
    "mir_eval_f": "F-measure of mir_eval",
}
ARROWS = {1: " ↑", -1: " ↓", 0: ""}


def page(rows: Sequence[Mapping[str, Any]]) -> str:
    """The page of some rows, as `load_rows` returns them."""
    compared, evaluated = ([row for row in rows if row["kind"] == kind] for kind in ("compare", "evaluate"))
    template = Template(Path(__file__).with_name("template.md").read_text("utf-8"))
    return template.substitute(
        compare="\n".join(_compare_lines(compared)), evaluate="\n".join(map(_evaluate_text, evaluated))
    )


def _compare_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A table with a line a score and a column a corpus, then what is to say about each corpus."""
    yield from _table(["score", "tells on", *map(_title, rows)], [_score_cells(score, rows) for score in SCORES])
    for row in rows:
        amount = f"{row['windows']} windows of {len(row['recordings'])} recordings, {row['settings']['beats']} beats"
        yield from ("", f"**{_title(row)}**: {amount}", "", *_about(row))


def _score_cells(score: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A score, on how many corpora it tells right from wrong music, and its AUC on each."""
    cells = [_auc(row["numbers"][score], row["chance_band"][score]) for row in rows]
    telling = sum(cell.startswith("**") for cell in cells)
    return [SCORES[score], f"{telling} of {len(rows)}", *cells]


def _auc(numbers: Mapping[str, Any], band: Sequence[float | None]) -> str:
    value, (low, high) = numbers["auc"], band
    text = number_text(value)
    if low is not None and high is not None:
        text = f"**{text}**" if value > high else f"*below* {text}" if value < low else text
    return f"{text} [{_span(numbers['interval'])}]<br>chance {_span(band)}"


def _evaluate_text(row: Mapping[str, Any]) -> str:
    """A table with a line a measure and a column a system, controls last, and what is to say about it."""
    systems, deaf = row["numbers"]["systems"], row["numbers"]["deaf"]
    heads = ["", *(f"{_cell(name)}{' (control)' if name in CONTROLS else ''}" for name in systems)]
    lines = [[count, *(str(numbers[count]) for numbers in systems.values())] for count in ("dances", "songs")]
    for name in TABLE_MEASURES:
        measure = measure_of(name)
        means = (_mean(numbers.get(name)) for numbers in systems.values())
        lines.append([measure.words + ARROWS[measure.better] + " ‡" * (name in deaf), *means])
    return "\n".join([f"### {_title(row)}\n", *_table(heads, lines), "", *_about(row), ""])


def _mean(numbers: Mapping[str, Any] | None) -> str:
    if numbers is None:
        return "-"
    rank = "" if numbers["rank"] is None else f" #{numbers['rank']}"
    return f"{number_text(numbers['mean'])} [{_span(numbers['interval'])}]{rank}"


def _span(ends: Iterable[float | None]) -> str:
    return " to ".join("-" if end is None else number_text(end) for end in ends)


def _about(row: Mapping[str, Any]) -> Iterator[str]:
    """Lines about data, command and harmolab of a row."""
    about, code = row["about"], row["harmolab"]
    yield f"- Data: {about['data']}"
    yield f"- Licence: {about['licence']}"
    yield f"- Where to get them: {about['obtain']}"
    yield from [f"- Note: {about['note']}"] if about["note"] else []
    yield from (f"- `{command}`" for command in (*about["commands"], row["command"]))
    copy = f"commit {code['commit'][:12]}" if code.get("commit") else f"sources {code['sources'][:12]}"
    made = f"harmolab {code['version']}, {copy}, {code['date']}, by {about['by']}"
    folder = f"../benchmarks/leaderboard/rows/{row['name']}"
    yield f"- {made}; files: [{row['name']}]({folder}); digest of the data: {row['digest'][:12]}"


def _title(row: Mapping[str, Any]) -> str:
    about = row["about"]
    return _cell(f"{about['title']}{' (synthetic)' if about['synthetic'] else ''}")


def _table(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> Iterator[str]:
    return (f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *lines))


def _cell(text: str) -> str:
    """A text that stays in its cell."""
    return " ".join(text.split()).replace("|", "\\|")
