"""Figures that are drawn again from the tables beside them."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread
from matplotlib.patches import Patch
from matplotlib.text import Text

from harmolab.lab.figures.style import styled_axes
from harmolab.lab.report.pages import MANIFEST
from study.figures.redraw import WEIGHTS, figures_of_tables, redraw
from study.profile import RunProfile
from study.saving import PAGE_WIDTH, save_figure, smallest_text
from tests.notebook_cells import notebook_cells

SHIPPED = Path(__file__).parents[1] / "figures"


def test_shipped_tables_give_figures_whose_letters_are_large_enough_on_a_page_of_the_report():
    sizes = {name: smallest_text(figure) for name, figure in figures_of_tables(SHIPPED).items()}
    assert {name for name, size in sizes.items() if size < 9} == set()
    assert {"fig11_harmony_loss", "m2d_chance", "a2b_hits"} <= set(sizes)


def test_figure_of_other_weights_is_there_only_with_its_table(tmp_path: Path):
    shipped = json.loads((SHIPPED / MANIFEST).read_text("utf-8"))
    assert ("fig11b_trade_off.png" in shipped) == ("table11d_trade_off.csv" in shipped)
    assert ("fig11b_trade_off" in figures_of_tables(SHIPPED)) == ("table11d_trade_off.csv" in shipped)
    for path in SHIPPED.glob("*.csv"):
        shutil.copy(path, tmp_path)
    corpus = pd.read_csv(tmp_path / "table11_ablation.csv")["corpus"][:1]
    sweep = pd.DataFrame({"corpus": corpus, "harmony_weight": 0.1, "above_chance": 0.5, "jerk": 80.0, "fid": 2.0})
    sweep.to_csv(tmp_path / "table11d_trade_off.csv", index=False)
    assert "fig11b_trade_off" in figures_of_tables(tmp_path)


def test_no_name_of_a_corpus_is_left_in_a_figure_of_a_table():
    for name, figure in figures_of_tables(SHIPPED).items():
        words = " ".join(text.get_text() for text in figure.findobj(Text))
        assert not re.search("beatlocked|realdance|tang2018", words), name


def test_marks_are_weighted_as_they_were_computed():
    assert notebook_cells("16_music2dance").MARKS == WEIGHTS
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


def test_legend_at_the_edge_stays_above_the_mark_for_synthetic_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_FIGURES", str(tmp_path))
    with styled_axes((6.0, 3.0)) as (figure, (ax,)):
        ax.set_axis_off()
        figure.legend(handles=[Patch(color="#0000FF", label=40 * "i")], loc="outside lower right")
    about = {"notebook": "00_start_here", "source": "synthetic", "profile": RunProfile.quick()}
    red, _, blue = np.moveaxis(imread(save_figure(figure, "legend", **about).path)[..., :3], -1, 0)
    of_legend, of_mark = (np.flatnonzero(mask.any(axis=1)) for mask in (blue - red > 0.8, red - blue > 0.3))
    assert of_legend.size and of_mark.size and of_legend.max() < of_mark.min()


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
