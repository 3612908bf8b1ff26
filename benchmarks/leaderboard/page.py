"""`docs/leaderboard.md` as text, from the rows of the leaderboard."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from harmolab.lab.evaluate.controls import CONTROLS
from harmolab.lab.evaluate.summary import measure_of
from harmolab.lab.evaluate.table_files import number_text

SCORES = {
    "recommended": "recommended score of harmolab",
    "paper": "harmony h (paper)",
    "hit_rate": "hit rate (paper)",
    "beat_align_motion": "beat alignment, over motion beats (AIST++)",
    "beat_align_music": "beat alignment, over music beats (Bailando)",
    "beat_hit_rate": "beat hit rate",
    "mir_eval_f": "F-measure of mir_eval",
}
TABLE_MEASURES = (
    *("harmony", "harmony_dance", "significant", "paper_harmony", "paper_harmony_chance", "beat_align_motion"),
    *("beat_align_music", "mir_eval_f", "pfc", "foot_skating", "freezing", "jerk", "likeness"),
)
ARROWS = {1: " ↑", -1: " ↓", 0: ""}

HEAD = """\
# Leaderboard

Numbers that harmolab measured, on data that others can get or make. This page is made from files: every row has a folder in
[benchmarks/leaderboard/rows](../benchmarks/leaderboard/rows) with the numbers (`row.json`) and what they were computed from, the score of
every window or of every dance (`evidence.csv`). `tests/test_leaderboard.py` computes all numbers but one kind again from that evidence,
and compares this page with its files. The kind that it cannot compute again is the chance band, which needs the recordings.

No number of a paper stands on this page, only numbers that were measured by the command beside them. Motion, sound and key points of
recordings are not in the repository; each row says where they can be obtained.
"""

COMPARE = """\
## Does a score tell right from wrong music?

Each recording is cut into windows of six seconds. Every window is scored with its own music and with the same music 0.3 to 0.7 beat late. The
number is the AUC: how often the true music has the higher score. 0.5 is a coin, 1 is always. `[low to high]` is its 95 % interval, by
resampling recordings; below it stands the chance band, where 95 % of AUCs lie when the music begins anywhere.

**Bold**: above the chance band, so this score tells something on these data. *Below*: under the band, so it prefers the wrong music. All else is
chance, wherever it lies from 0.5.
"""

EVALUATE = """\
## How well do systems dance?

Means over songs, over all seeds, with the 95 % interval by resampling songs. ↑ more is better, ↓ less is better, neither: compare with the
recorded dances. `#1` is a rank among the systems: one more than the number of systems that are better song by song, the interval of the
difference excluding 0. A system without a rank differs from no other one by more than luck.

Read the three controls first: recorded dances, the same dances with the music of another song, and a pose that is held. A measure by which the
other song does as well as the own one does not measure harmony; a measure by which the held pose wins measures stillness. Fréchet distances
are not here: so few dances cannot bear them.
"""

SUBMIT = """\
## How to submit a row

1. Make a folder `benchmarks/leaderboard/rows/NAME` with a file `row.json` that says what the data are. All fields are asked for; `commands` are
   those that made the data or the dances, before the command that measured them.

   ```json
   {"about": {
     "title": "Name of the data set or of the systems", "by": "who measured it", "synthetic": false,
     "data": "what was recorded, how, how much of it", "licence": "of motion and of music", "obtain": "where others get it",
     "note": "what a reader must know: songs that a system was trained on, faults of the data", "commands": ["..."]
   }}
   ```

2. Measure. The command writes `evidence.csv`, the numbers, a digest of the files, version and commit of harmolab, and this page. The
   package must be as it was committed.

   ```
   python -m benchmarks.leaderboard compare NAME CORPUS      # a folder of recordings
   python -m benchmarks.leaderboard evaluate NAME TABLE      # a folder that `harmolab evaluate ... --out TABLE` wrote
   ```

3. Look at `evidence.csv` before you publish it: it names your recordings and songs as their files are called, and holds their scores, nothing else.
   It stays under 100 kB.
4. `pytest tests/test_leaderboard.py`, then open a pull request with the folder and `docs/leaderboard.md`. Say in it how a reviewer can get the data.

Rows with weak or bad numbers are as welcome as others. A row of systems has seeds, the three controls, and songs that no system was trained on, or
it says in `note` which it was.
"""


def page(rows: Sequence[Mapping[str, Any]]) -> str:
    """The page of some rows, as `load_rows` returns them."""
    compared, evaluated = ([row for row in rows if row["kind"] == kind] for kind in ("compare", "evaluate"))
    parts = [HEAD, COMPARE, *_compare_table(compared), "", EVALUATE]
    for row in evaluated:
        parts += [f"### {_title(row)}\n", *_evaluate_table(row), "", *_about(row), ""]
    return "\n".join([*parts, SUBMIT])


def _title(row: Mapping[str, Any]) -> str:
    title = str(row["about"]["title"])
    return _cell(title if "ynthetic" in title or not row["about"]["synthetic"] else f"{title} (synthetic)")


def _compare_table(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line a score and a column a corpus, then what is to say about each corpus."""
    yield from _table(["score", *map(_title, rows)], [
        [SCORES[score], *(_auc(row["numbers"][score], row["chance_band"][score]) for row in rows)] for score in SCORES
    ])  # fmt: skip
    for row in rows:
        amount = f"{row['windows']} windows of {len(row['recordings'])} recordings, {row['settings']['beats']} beats"
        yield from ("", f"### {_title(row)}: {amount}\n", *_about(row))


def _auc(numbers: Mapping[str, Any], band: Sequence[float | None]) -> str:
    value, (low, high) = numbers["auc"], band
    text = number_text(value)
    if low is not None and high is not None:
        text = f"**{text}**" if value > high else f"*below* {text}" if value < low else text
    return f"{text} [{_span(numbers['interval'])}]<br>chance {_span(band)}"


def _span(ends: Sequence[float | None]) -> str:
    return " to ".join("-" if end is None else number_text(end) for end in ends)


def _evaluate_table(row: Mapping[str, Any]) -> Iterator[str]:
    """A line a measure and a column a system, controls last."""
    systems = row["numbers"]
    heads = [f"{_cell(name)}{' (control)' if name in CONTROLS else ''}" for name in systems]
    lines = [[count, *(str(numbers[count]) for numbers in systems.values())] for count in ("dances", "songs")]
    for measure in TABLE_MEASURES:
        words = measure_of(measure).words + ARROWS[measure_of(measure).better]
        lines.append([words, *(_mean(numbers.get(measure)) for numbers in systems.values())])
    yield from _table(["", *heads], lines)


def _mean(numbers: Mapping[str, Any] | None) -> str:
    if numbers is None:
        return "-"
    rank = "" if numbers["rank"] is None else f" #{numbers['rank']}"
    return f"{number_text(numbers['mean'])} [{_span(numbers['interval'])}]{rank}"


def _about(row: Mapping[str, Any]) -> Iterator[str]:
    """What the data are, how the numbers were measured, and with which harmolab."""
    about, code = row["about"], row["harmolab"]
    yield f"- Data{' (synthetic)' if about['synthetic'] else ''}: {about['data']}"
    yield f"- Licence: {about['licence']} To be had: {about['obtain']}"
    if about["note"]:
        yield f"- Note: {about['note']}"
    for command in (*about["commands"], row["command"]):
        yield f"- `{command}`"
    made = f"harmolab {code['version']}, commit {code['commit'][:12]}, {code['date']}, by {about['by']}"
    folder = f"../benchmarks/leaderboard/rows/{row['name']}"
    yield f"- {made}; files: [{row['name']}]({folder}), digest of the data {row['digest'][:12]}"


def _table(heads: Iterable[str], lines: Iterable[Iterable[str]]) -> Iterator[str]:
    heads = list(heads)
    for cells in (heads, ["---"] * len(heads), *lines):
        yield f"| {' | '.join(cells)} |"


def _cell(text: str) -> str:
    """A text that stays in its cell."""
    return " ".join(text.split()).replace("|", "\\|")
