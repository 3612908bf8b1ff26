"""The pages `docs/claims.md` and `docs/report.md`, written from the published tables: ``python -m study.claims.pages``."""

import sys
from functools import partial
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from harmolab.files import write_text
from study.claims.body_dynamics import BODY_DYNAMICS, rest_of_order
from study.claims.claim import claims_table, counts, short_table, spread, value
from study.claims.harmony import HARMONY
from study.claims.music2dance import MUSIC2DANCE
from study.findings import RunTables, published_tables
from study.saving import project_folder

PAGES = ("claims.md", "report.md")
PAPERS = {
    "Harmony-aware Human Motion Synthesis with Music": HARMONY,
    "Music2Dance": MUSIC2DANCE,
    "Audio to Body Dynamics": BODY_DYNAMICS,
}


def page(name: str, tables: RunTables) -> str:
    """The text of a page of `PAGES` with the numbers of these tables.

    Raises
    ------
    ValueError
        If a verdict is contradicted by its table.
    FileNotFoundError
        If a table is missing.
    """
    loader = FileSystemLoader(Path(__file__).parent)
    templates = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    every = [one for claims in PAPERS.values() for one in claims]
    return templates.get_template(f"{name}.j2").render(
        papers=[(title, claims_table(claims, tables)) for title, claims in PAPERS.items()],
        short={title: short_table(claims, tables) for title, claims in PAPERS.items()},
        total=len(every),
        counts=counts(every),
        value=partial(number, tables),
        spread=partial(spread, tables),
        rest_of_order=partial(rest_of_order, tables),
        tables=tables,
    )


def number(tables: RunTables, table: str, column: str, digits: int = 2, **where: object) -> str:
    """A number of a table, rounded; a word as it is."""
    entry = value(tables, table, column, **where)
    return entry if isinstance(entry, str) else f"{entry:.{digits}f}"


def main() -> int:
    """Write the pages into docs/ and say so."""
    tables, docs = published_tables(), project_folder() / "docs"
    try:
        texts = {name: page(name, tables) for name in PAGES}
    except (ValueError, FileNotFoundError) as error:
        print(error, file=sys.stderr)
        return 1
    for name, text in texts.items():
        write_text(docs / name, text)
        print(docs / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
