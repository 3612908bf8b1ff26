"""Claims and their verdicts: numbers come from the published tables, and a contradiction is noticed."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from study.claims.body_dynamics import BODY_DYNAMICS
from study.claims.claim import claims_table, contradicted, spread, value
from study.claims.harmony import HARMONY
from study.claims.music2dance import MUSIC2DANCE
from study.claims.pages import PAGES, page
from study.findings import RunTables
from tests.builders import cases, refused

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = RunTables(ROOT / "figures")
EVERY = (*HARMONY, *MUSIC2DANCE, *BODY_DYNAMICS)


@pytest.fixture
def tables(tmp_path: Path) -> Iterator[RunTables]:
    """A copy of the published tables, to be changed."""
    for path in (ROOT / "figures").glob("*.csv"):
        shutil.copy(path, tmp_path)
    return RunTables(tmp_path)


def set_cell(tables: RunTables, table: str, column: str, entry: object, **where: object) -> None:
    frame = tables[table]
    rows = pd.concat([frame[name] == wanted for name, wanted in where.items()], axis=1).all(axis=1)
    assert rows.any()
    frame.loc[rows, column] = entry
    frame.to_csv(tables.folder / f"{table}.csv", index=False)


def test_published_tables_bear_out_every_verdict():
    assert contradicted(EVERY, PUBLISHED) == []


@cases(
    "place, table, column, entry, where",
    (
        "Fig. 11(a)",
        "table11b_gains",
        "low",
        -0.01,
        {"corpus": "beatlocked", "loss": "paper", "measure": "paper_harmony"},
    ),
    ("Fig. 8, Sec. 5.6", "table08b_auc", "AUC", 0.7, {"corpus": "tang2018", "score": "paper"}),
    ("Fig. 8", "table08j_readings", "AUC low", 0.6, {"reading": "librosa as it comes"}),
    ("Fig. 2", "table02_box", "found again", 7, {"without box": 7}),
    ("Fig. 5", "table05_omission_redundancy", "hit rate", 0.9, {"detector": "turns"}),
    ("abstract, Table 1", "table12_systems", "h", 0.9, {"music": "recorded songs", "system": "HarmoGAN"}),
    ("Sec. 6", "table_cheating_gains", "paper_hit_rate", 0.0, {"trick": "too slow + jitter 5 mm"}),
)
def test_a_table_that_contradicts_a_verdict_is_noticed(place, table, column, entry, where, tables: RunTables):
    set_cell(tables, table, column, entry, **where)
    assert {one.partition(": ")[0] for one in contradicted(HARMONY, tables)} == {place}
    refused(f"the tables contradict the verdict on {place[:6]}.*change the verdict", claims_table, HARMONY, tables)


@cases(
    "claims, table, column, entry, where",
    (MUSIC2DANCE, "m2d_table01b_differences", "low", -1.0, {"measure": "songs", "against": "FC + Bi-LSTM"}),
    (MUSIC2DANCE, "m2d_table_likeness", "moves like people", 0.5, {"system": "Music2Dance", "dance": "all"}),
    (MUSIC2DANCE, "m2d_table02b_dances", "sliding (cm/s)", 9.0, {"dancer": "recommended", "feet": "model"}),
    (BODY_DYNAMICS, "a2b_rank_agreement", "p", 0.01, {"instrument": "violin"}),
    (BODY_DYNAMICS, "a2b_hands", "of mean pose", 1.0, {"row": "recommended (ours)"}),
)
def test_so_is_one_of_the_other_papers(claims, table, column, entry, where, tables: RunTables):
    set_cell(tables, table, column, entry, **where)
    assert len(contradicted(claims, tables)) == 1


@pytest.mark.parametrize("name", PAGES)
def test_committed_page_is_what_the_published_tables_give(name: str):
    assert (ROOT / "docs" / name).read_text("utf-8") == page(name, PUBLISHED), "run `make claims`"


def test_numbers_of_a_page_are_those_of_the_table_it_is_written_from(tables: RunTables):
    before = page("claims.md", tables)
    set_cell(tables, "table08h_picked_clips", "harmolab", 0.512, judge="paper's h (machine)")
    assert "h in their place picks 0.51 [0.30, 0.70]" in page("claims.md", tables)
    assert "h in their place picks 0.49 [0.30, 0.70]" in before


def test_every_claim_names_its_notebook_and_a_test_that_are_there():
    assert {one.notebook for one in EVERY} <= {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert {one.test for one in EVERY} <= {path.name for path in (ROOT / "tests").glob("*.py")}
    assert len({(one.place, one.claim, one.notebook) for one in EVERY}) == len(EVERY)


def test_what_cannot_be_tested_says_what_it_would_take_and_no_other_verdict_stands_on_nothing():
    untested = next(one for one in EVERY if one.stands is None)
    refused("say what a test would take", replace, untested, needs="")
    refused("a verdict needs tables to stand on", replace, untested, verdict="refuted")


def test_a_number_is_one_row_of_a_table_and_has_its_interval(tmp_path: Path):
    (tmp_path / "one.csv").write_text("name,mean,low,high\na,0.5,0.4,0.61\nb,1,0,2\nb,1,0,2\n")
    tables = RunTables(tmp_path)
    assert (value(tables, "one", "mean", name="a"), spread(tables, "one", name="a")) == (0.5, "0.50 [0.40, 0.61]")
    refused(r"one.csv: 2 rows have .*'b'", value, tables, "one", "mean", name="b")
    refused(r"one.csv: 0 rows have .*'c'", value, tables, "one", "mean", name="c")


def test_rows_of_a_paper_stay_in_their_columns():
    lines = claims_table(HARMONY, PUBLISHED).splitlines()
    assert {line.count(" | ") for line in lines if not line.startswith("|---")} == {6}
    assert len(lines) == len(HARMONY) + 2
