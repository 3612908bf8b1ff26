"""Figures that are drawn again from the tables beside them."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from harmolab.lab.experiments.half_minutes import MARKS
from harmolab.lab.figures.redraw import WEIGHTS, figures_of_tables, redraw
from harmolab.lab.figures.style import MANIFEST, PAGE_WIDTH, smallest_text
from harmolab.lab.profile import RunProfile

SHIPPED = Path(__file__).parents[1] / "figures"


def test_shipped_tables_give_figures_whose_letters_are_large_enough_on_a_page_of_the_report():
    sizes = {name: smallest_text(figure) for name, figure in figures_of_tables(SHIPPED).items()}
    assert {name for name, size in sizes.items() if size < 9} == set()
    assert {"fig11_harmony_loss", "m2d_chance", "a2b_hits"} <= set(sizes)


def test_no_name_of_a_corpus_is_left_in_a_figure_of_a_table():
    for name, figure in figures_of_tables(SHIPPED).items():
        words = " ".join(text.get_text() for text in figure.findobj(Text))
        assert not re.search("beatlocked|realdance|tang2018", words), name


def test_marks_are_weighted_as_they_were_computed():
    assert WEIGHTS == MARKS
    totals = pd.read_csv(SHIPPED / "m2d_table03_machine.csv")
    np.testing.assert_allclose(totals[list(WEIGHTS)] @ list(WEIGHTS.values()), totals["total"], atol=0.002)


def test_figure_drawn_again_keeps_its_source_and_title_in_the_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for path in [*SHIPPED.glob("*.csv"), SHIPPED / MANIFEST]:
        shutil.copy(path, tmp_path)
    monkeypatch.setenv("HARMOLAB_FIGURES", str(tmp_path))
    saved = redraw(RunProfile.full())
    assert all(each.path.parent == tmp_path and each.path.stat().st_size > 10_000 for each in saved)
    before, after = (json.loads((folder / MANIFEST).read_text("utf-8")) for folder in (SHIPPED, tmp_path))
    assert [{**entry, "version": ""} for entry in after.values()] == [
        {**entry, "version": ""} for entry in before.values()
    ]


# Wider than a page of the report is for letters of 8 points; its own have 8.5.
WIDE = {"fig07c_networks.png"}


def inches(path: Path) -> float:
    """Width of a PNG by its pixels a metre."""
    data = path.read_bytes()
    place = data.index(b"pHYs") + 4
    return int.from_bytes(data[16:20]) / (int.from_bytes(data[place : place + 4]) * 0.0254)


def test_letters_of_eight_points_have_nine_pixels_in_every_shipped_figure_on_a_page_of_the_report():
    widest = PAGE_WIDTH * 8 / (9 * 72)
    assert {path.name for path in SHIPPED.glob("*.png") if inches(path) > widest} == WIDE
