"""A paper's claim, what our tables say of it, and the page that puts them side by side."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from study.findings import RunTables

Verdict = Literal["reproduced", "refuted", "not reproduced", "cannot be tested"]
Words = Callable[[RunTables], str]
HEADS = ("in the paper", "what it claims", "its number", "what came out here")


@dataclass(frozen=True)
class Claim:
    """One claim, its verdict, and the tables that it rests on.

    Parameters
    ----------
    place : str, figure, table or section of the paper
    claim : str
    paper : str, the paper's own number, "" where it prints none
    ours : function of the tables: our number, with its interval
    beside : function of the tables: chance, or the control that a reader would ask for
    verdict : "reproduced", "refuted" (our numbers say the opposite), "not reproduced" (they do not show it, and would not
        have to), "cannot be tested"
    stands : function of the tables: True where they bear the verdict out; None only where nothing can be tested
    notebook : str, stem of the notebook that makes the tables
    test : str, the test that pins the measure
    needs : str, what it would take, for a claim that cannot be tested or was not reproduced
    """

    place: str
    claim: str
    paper: str
    ours: Words
    beside: Words
    verdict: Verdict
    stands: Callable[[RunTables], bool] | None
    notebook: str
    test: str
    needs: str = ""

    def __post_init__(self) -> None:
        if (self.stands is None) != (self.verdict == "cannot be tested"):
            raise ValueError(f"{self.place}: a verdict needs tables to stand on, unless nothing can be tested")
        if self.verdict == "cannot be tested" and not self.needs:
            raise ValueError(f"{self.place}: say what a test would take")


def value(tables: RunTables, table: str, column: str, **where: Any) -> Any:
    """The value in the one row of a table that has these entries.

    Raises
    ------
    ValueError
        If no row has them, or several have.
    """
    rows = tables[table]
    for name, entry in where.items():
        rows = rows[rows[name] == entry]
    if len(rows) != 1:
        raise ValueError(f"{table}.csv: {len(rows)} rows have {where}, one was asked for; the claims rest on it")
    return rows[column].iloc[0]


def spread(tables: RunTables, table: str, column: str = "mean", *, digits: int = 2, **where: Any) -> str:
    """A number of a table with its interval, as "0.41 [0.35, 0.46]": columns low and high, with the column's name or not."""
    prefix = next(words for words in (f"{column} ", f"{column}, ", "interval ", "") if f"{words}low" in tables[table])
    numbers = [float(value(tables, table, name, **where)) for name in (column, f"{prefix}low", f"{prefix}high")]
    return "{} [{}, {}]".format(*(f"{number:.{digits}f}" for number in numbers))


def contradicted(claims: Iterable[Claim], tables: RunTables) -> list[str]:
    """The claims whose verdict the tables do not bear out, by place and claim."""
    return [f"{one.place}: {one.claim}" for one in claims if one.stands is not None and not one.stands(tables)]


def claims_table(claims: Sequence[Claim], tables: RunTables) -> str:
    """The claims of one paper as a Markdown table.

    Raises
    ------
    ValueError
        If a verdict is contradicted by its table; names the claims.
    """
    if wrong := contradicted(claims, tables):
        raise ValueError(
            f"the tables contradict the verdict on {'; '.join(wrong)}: look at them, and change the verdict"
        )
    heads = [*HEADS, "beside it: chance or a control", "verdict", "notebook, test"]
    return markdown_table(heads, (_cells(one, tables) for one in claims))


def short_table(claims: Sequence[Claim], tables: RunTables) -> str:
    """The claims of one paper that could be tested, with the paper's number, ours and the verdict."""
    tested = [one for one in claims if one.verdict != "cannot be tested"]
    rows = ([one.place, one.claim, one.paper, one.ours(tables), one.verdict] for one in tested)
    return markdown_table([*HEADS, "verdict"], rows)


def _cells(one: Claim, tables: RunTables) -> list[str]:
    notebook = f"[{one.notebook[:2]}](../notebooks/{one.notebook}.ipynb), `{one.test}`"
    verdict = f"**{one.verdict}**" + (f"; it would take {one.needs}" if one.needs else "")
    return [one.place, one.claim, one.paper, one.ours(tables), one.beside(tables), verdict, notebook]


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table, a dash in its empty cells."""
    lines = [f"| {' | '.join(cell or '-' for cell in row)} |" for row in (heads, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(heads), *lines[1:]])


def counts(claims: Iterable[Claim]) -> dict[str, int]:
    """How many claims have each verdict, in the order of the words."""
    verdicts = [one.verdict for one in claims]
    order = ("reproduced", "not reproduced", "refuted", "cannot be tested")
    return {verdict: verdicts.count(verdict) for verdict in order if verdict in verdicts}
