"""The report and the site: what they say about notebooks, and that they need no network."""

import base64
import importlib
import json
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat
import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image

from harmolab.lab.figures import style
from harmolab.lab.report import run as report
from harmolab.lab.report.pages import SAVED, NotebookRun, data_words, source_names, write_pages
from harmolab.lab.report.run import publish
from harmolab.lab.report.templates import TEMPLATES
from study import saving
from study.profile import RunProfile
from tests.builders import cases, refused

GOOD = """# 00 The good one

Inline $T_d \\ge 0.25$ and

$$ h = \\frac{2 h_a h_v}{h_a + h_v} $$
"""

FIGURE = """from matplotlib.figure import Figure
from study.saving import save_figure
figure = Figure()
figure.subplots().plot([0, 1])
save_figure(figure, "fig01", notebook="00_good", source="synthetic", profile=profile, title="A <planted> title")
"""

PLOTS = """from matplotlib import pyplot
from harmolab.lab.figures.style import figure_style
with figure_style():
    pyplot.subplots()
"""

TABLE = """import pandas as pd
from study.saving import save_table
frame = pd.DataFrame({"score": ["ours"], "auc": [0.875]})
save_table(frame, "table1", notebook="00_good", source="planted recordings", profile=profile, title="One row")
"""

LAB = """from harmolab import synthetic_clip
from harmolab.lab import meter_lab
meter_lab(synthetic_clip("rumba", seconds=6.0))
"""


def write_notebook(path: Path, *cells: str, paper: tuple[str, ...] = ()) -> None:
    """A notebook whose first cell is Markdown and the others code."""
    nodes = [new_markdown_cell(cells[0]), *map(new_code_cell, cells[1:])]
    kernel = {"name": "her-own", "display_name": "Her own", "language": "python"}
    nbformat.write(new_notebook(cells=nodes, metadata={"kernelspec": kernel, "harmolab": {"paper": list(paper)}}), path)


def run_of(title: str, *paper: str, error: str = "", stem: str = "03_beats", cells: tuple = (), **facts: str):
    """A run that never took place, of a notebook that builds these items of the paper."""
    metadata = {"harmolab": {"paper": list(paper), **facts}}
    node = new_notebook(cells=[new_markdown_cell(title), *cells], metadata=metadata)
    return NotebookRun(Path(f"/planted/{stem}.ipynb"), node, 1.0, error)


def write_picture(folder: Path, name: str, *, inches: float = 4.0, notebook: str = "03_beats", **about: str) -> bytes:
    """A saved figure and its entry in the manifest: of a quick run and of synthetic data unless it is said."""
    folder.mkdir(parents=True, exist_ok=True)
    Figure(figsize=(inches, 2.0)).savefig(folder / f"{name}.png")
    entry = {"profile": "quick", "seed": 1, "source": "synthetic", "title": f"The <{name}>"} | about
    manifest = folder / "manifest.json"
    entries = json.loads(manifest.read_text()) if manifest.is_file() else {}
    manifest.write_text(json.dumps({**entries, f"{name}.png": {"notebook": f"{notebook}.ipynb", **entry}}))
    return (folder / f"{name}.png").read_bytes()


def cell_with(*pictures: bytes, saved: tuple[str, ...], remark: str = "") -> nbformat.NotebookNode:
    """An executed cell: the pictures in its outputs, a line of text, and the names of the figures that it saved."""
    outputs = [new_output("display_data", {"image/png": base64.b64encode(png).decode()}) for png in pictures]
    outputs += [new_output("execute_result", {"text/plain": remark})] if remark else []
    return new_code_cell("draw()", outputs=outputs, metadata={SAVED: list(saved)})


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path, Path]:
    """(exit code, report, published figures) of a good notebook and one that fails."""
    root = tmp_path_factory.mktemp("report")
    (root / "notebooks").mkdir()
    parameters = "from study import RunProfile\nprofile = RunProfile.from_env()"
    good, bad = (root / "notebooks" / f"{name}.ipynb" for name in ("00_good", "01_bad"))
    write_notebook(good, GOOD, parameters, FIGURE, PLOTS, PLOTS, TABLE, LAB, paper=("Fig. 1", "Table 1"))
    write_notebook(bad, "# Bad", "1", "raise KeyError('planted fault')", paper=("Fig. 2",))
    folders = ["--notebooks", root / "notebooks", "--out", root / "out", "--figures", root / "figures"]
    return report.main([str(part) for part in folders]), root / "out", root / "figures"


@pytest.mark.slow
def test_report_with_a_failing_notebook_publishes_the_good_one_and_its_pages_load_nothing_from_elsewhere(built):
    code, out, figures = built
    assert sorted(file.name for file in figures.iterdir()) == ["fig01.png", "manifest.json", "table1.csv"]
    pages = {path.stem: path.read_text() for path in out.glob("*.html")}
    assert code == 1 and {stem for stem, page in pages.items() if "This notebook failed" in page} == {"01_bad"}
    elsewhere = r"""(?:(?:src|href)=["']|(?:@import|url\()\s*["']?)(?:https?:)?//|<script[^>]*src="""
    assert [name for name, page in pages.items() if re.search(elsewhere, page)] == []
    # Figures are pictures, the lab is a page in the page, and equations need no script.
    page = pages["00_good"]
    assert len(re.findall(r'<img[^>]* src="data:image/png;base64,', page)) == 3
    assert len(re.findall(r'<iframe[^>]* title="The meter lab"', page)) == 1
    assert "<mfrac>" in page and "$$" not in page and "widget-view" not in page


@pytest.mark.slow
def test_index_names_faults_figures_tables_their_data_and_the_state_of_every_item_of_the_paper(built):
    _, out, _ = built
    index = (out / "index.html").read_text()
    assert "1 of 2 notebooks failed" in index and "code cell 2: KeyError: &#39;planted fault&#39;" in index
    assert '<img src="figures/fig01.png" alt="A &lt;planted&gt; title" loading="lazy">' in index
    assert "<td>0.875</td>" in index and "data: planted recordings, synthetic" in index and "quick profile" in index
    assert (out / "figures" / "fig01.png").is_file()
    states = dict(re.findall(r"<td>((?:Fig\.|Table) \d+)</td><td>[^<]*</td>\s*<td><span class=\"(\w+)\"", index))
    assert list(states) == [f"Fig. {n}" for n in range(1, 15)] + ["Table 1", "Table 2"]
    there = {item: state for item, state in states.items() if state != "missing"}
    assert there == {"Fig. 1": "built", "Table 1": "built", "Fig. 2": "failed"}


def test_texts_of_what_came_out_are_pages_that_the_index_links_to_first(tmp_path: Path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a.png").write_bytes(b"a")
    (text := tmp_path / "docs" / "claims.md").parent.mkdir()
    table = "| a |\n|---|\n| [03](../notebooks/03_beats.ipynb), [more](readings.md) |\n"
    text.write_text(f"# Claim by claim\n\n{table}\n![b](../figures/a.png)\n")
    write_pages(tmp_path, [run_of("# a", "Fig. 8")], "quick", documents=[text])
    page = (tmp_path / "claims.html").read_text()
    assert '<a href="03_beats.html">03</a>, more' in page
    assert "swipe sideways ↔</p><table>" in page and 'src="data:image/png;base64,YQ=="' in page
    index = (tmp_path / "index.html").read_text()
    assert index.index('<a href="claims.html">Claim by claim</a>') < index.index('href="03_beats.html"')


def page_of(folder: Path, text: str, *cells: nbformat.NotebookNode, profile: str = "quick", **facts: str) -> str:
    """The page of a notebook with this text and these executed cells; full figures lie in `committed` beside it."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    write_pages(folder, [run_of(text, cells=cells, **facts)], profile, committed=folder.parent / "committed")
    return (folder / "03_beats.html").read_text()


def git(project: Path, *words: str) -> None:
    who = ("-c", "user.name=one", "-c", "user.email=one@example.org")
    subprocess.run(["git", *who, *words], cwd=project, check=True, capture_output=True)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, list[str], set[str]]:
    """A project under git of three notebooks: its folder, the notebooks that were run, and those that are to fail."""
    ran, failing = [], set()

    async def run(path: Path, variables: dict[str, str], timeout: float) -> NotebookRun:
        assert variables["HARMOLAB_PROFILE"] == "full"
        ran.append(path.stem)
        write_picture(Path(variables["HARMOLAB_FIGURES"]), f"of_{path.stem}", notebook=path.stem)
        return run_of(f"# {path.stem}", stem=path.stem, error="planted" if path.stem in failing else "")

    monkeypatch.setattr(report, "_run", run)
    (tmp_path / "notebooks").mkdir()
    for name in ("00_one", "01_two", "02_three"):
        write_notebook(tmp_path / "notebooks" / f"{name}.ipynb", f"# {name}")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "notebooks")
    git(tmp_path, "commit", "-qm", "one")
    return tmp_path, ran, failing


def full_run(folder: Path, only: tuple[str, ...] = (), failed: tuple[str, ...] = ()) -> dict[str, dict]:
    """The manifest after a full run of the project, in which these notebooks fail."""
    options = {"profile": "full", "figures": folder / "figures", "jobs": 1, "progress": False, "only": only}
    result = report.build(folder / "notebooks", folder / "out", **options)
    assert tuple(run.path.stem for run in result.failures) == failed
    return json.loads((folder / "figures" / "manifest.json").read_text())


def test_a_full_run_replaces_the_last_one_publishes_what_ran_and_goes_on_with_the_others(project):
    folder, ran, failing = project
    failing.add("01_two")
    for name, old in (("out", "old.html"), ("figures", "old.png")):
        (folder / name).mkdir()
        (folder / name / old).write_text("from an earlier run")
    (folder / "out" / "index.html").write_text(report.MARK)
    (folder / "figures" / "manifest.json").write_text('{"old.png": {"notebook": "00_one.ipynb"}}')
    manifest = full_run(folder, failed=("01_two",))
    assert [*manifest] == ["of_00_one.png", "of_02_three.png"]
    pages = ["00_one.html", "01_two.html", "02_three.html"]
    assert sorted(file.name for file in (folder / "out").iterdir()) == [*pages, "figures", "index.html"]
    assert sorted(file.name for file in (folder / "figures").iterdir()) == ["manifest.json", *manifest]
    assert not list(folder.glob(".out-*"))
    (commit,) = {entry["commit"] for entry in manifest.values()}
    assert re.fullmatch("[0-9a-f]{7,}", commit) and {entry["seconds"] for entry in manifest.values()} == {1}
    failing.clear()
    assert [*full_run(folder)] == ["of_00_one.png", "of_01_two.png", "of_02_three.png"]
    full_run(folder)
    assert ran == ["00_one", "01_two", "02_three", "01_two"]


def test_changed_code_is_run_again_and_a_notebook_that_is_gone_loses_its_figures(project):
    folder, ran, _ = project
    assert [*full_run(folder, only=("00", "02"))] == ["of_00_one.png", "of_02_three.png"]
    write_notebook(folder / "notebooks" / "00_one.ipynb", "# Another text")
    assert full_run(folder, only=("00",))["of_00_one.png"]["commit"].endswith("+")
    full_run(folder, only=("00",))  # not committed, so that nobody knows of what it is
    git(folder, "rm", "-q", "notebooks/02_three.ipynb")
    assert [*full_run(folder, only=("01",))] == ["of_00_one.png", "of_01_two.png"]
    assert ran == ["00_one", "02_three", "00_one", "00_one", "01_two"]
    assert not (folder / "figures" / "of_02_three.png").exists()


def test_what_is_private_is_not_published(tmp_path: Path, save):
    for name, more in (("shown", {}), ("people", {"private": True}), ("players", {"source": "tracked"})):
        save(Figure(), name, tables=(), **{"source": "synthetic", "profile": RunProfile.full(), **more})
    publish(run_of("# One", stem="00_x"), tmp_path, tmp_path / "figures", "abc")
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == ["manifest.json", "shown.png"]


def test_a_name_that_no_notebook_has_is_refused(project, capsys: pytest.CaptureFixture[str]):
    folder = project[0]
    assert report.main(["--notebooks", str(folder / "notebooks"), "--out", str(folder / "out"), "--only", "07"]) == 2
    assert "no notebook in" in capsys.readouterr().err


def test_where_there_is_no_git_no_commit_is_told_and_nothing_is_left_out(project):
    folder, ran, _ = project
    (folder / ".git").rename(folder / "git")
    assert {entry["commit"] for entry in full_run(folder).values()} == {""}
    full_run(folder)
    assert len(ran) == 6


@pytest.mark.slow
def test_cell_that_runs_too_long_is_stopped_and_named(tmp_path: Path):
    write_notebook(tmp_path / "00_slow.ipynb", "# Slow", "1", "import time", "time.sleep(600)")
    (run,) = report.build(tmp_path, tmp_path / "report", timeout=1, progress=False).runs
    assert run.error == "code cell 3: still running after 1 s" and run.seconds < 60


@cases("arguments, seconds", ((), 900), (("--profile", "full"), 21600), (("--timeout", "30"), 30))
def test_a_cell_may_take_a_quarter_of_an_hour_in_the_quick_report(arguments, seconds: float, monkeypatch):
    def build(*, timeout: float, **_: object) -> report.Report:
        assert timeout == seconds
        return report.Report(Path("index.html"), ())

    monkeypatch.setattr(report, "build", build)
    assert report.main(arguments) == 0


def test_a_file_that_is_no_notebook_fails_alone(tmp_path: Path):
    (tmp_path / "00_merged.ipynb").write_text('<<<<<<< HEAD\n{"cells": []}\n=======\n')
    (run,) = report.build(tmp_path, tmp_path / "report", progress=False).failures
    assert run.error.startswith("its file, which is no notebook")
    assert "This notebook failed" in (tmp_path / "report" / "00_merged.html").read_text("utf-8")


def test_folder_that_holds_something_else_is_not_replaced(tmp_path: Path):
    write_notebook(tmp_path / "00_good.ipynb", "# Good", "1")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "index.html").write_text("years of work")
    refused("no report of ours", report.build, tmp_path, tmp_path / "thesis")
    assert (tmp_path / "thesis" / "index.html").read_text() == "years of work"


def test_command_line_says_what_is_wrong_and_returns_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert report.main(["--notebooks", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert f"error: no notebooks (*.ipynb) in {tmp_path}" in capsys.readouterr().err


def test_title_is_the_first_heading_without_its_number():
    assert run_of("Intro\n\n# 03 Beats from joint speed\n\n# Later").title == "Beats from joint speed"
    assert run_of("no heading").title == "03_beats"


def test_item_that_one_of_two_notebooks_builds_counts_as_built(tmp_path: Path):
    (tmp_path / "figures").mkdir()
    write_pages(tmp_path, [run_of("# a", "Fig. 8"), run_of("# b", "Fig. 8", error="code cell 1: no")], "quick")
    index = (tmp_path / "index.html").read_text()
    assert re.search(r"<td>Fig. 8</td>.*?class=\"(\w+)\"", index, flags=re.DOTALL)[1] == "built"


def test_equation_that_cannot_be_drawn_is_shown_as_its_source_and_aligned_ones_keep_their_columns(tmp_path: Path):
    assert "<code> \\left( a &lt; b </code>" in page_of(tmp_path, "$$ \\left( a < b $$")
    page = page_of(tmp_path, "$$ \\begin{aligned} a &= b \\\\ c &= d \\end{aligned} $$")
    assert (page.count("<mtr>"), page.count("<mi>&")) == (2, 0)


def test_picture_of_a_quick_run_stands_beside_the_committed_one_with_both_labels(tmp_path: Path):
    png = write_picture(tmp_path / "out" / "figures", "a")
    write_picture(tmp_path / "committed", "a", source="beatlocked", profile="full", inches=6.0)
    cell = cell_with(png, saved=("a.png",), remark="saved a.png")
    page = page_of(tmp_path / "out", "# 03 Beats", cell, picture="a.png")
    labels = re.findall(r'<label[^>]* for="picture-1-\d">([^<]+)</label>', page)
    assert labels == ["this run, synthetic data", "full run, recordings"]
    shown = re.findall(r'<img alt="([^"]+)" src="([^"]{0,40}).*?--pixels: (\d+)px', page)
    assert shown == [
        ("The &lt;a&gt; (full run, recordings)", "figures/full/a.png", "600"),  # under the finding
        ("The &lt;a&gt; (this run, synthetic data)", shown[1][1], "400"),
        ("The &lt;a&gt; (full run, recordings)", "figures/full/a.png", "600"),
    ]
    assert shown[1][1].startswith("data:image/png;base64,") and "saved a.png" not in page
    copy = tmp_path / "out" / "figures" / "full" / "a.png"
    assert copy.read_bytes() == (tmp_path / "committed" / "a.png").read_bytes()


def test_report_of_the_full_profile_has_its_own_pictures_alone(tmp_path: Path):
    png = write_picture(tmp_path / "out" / "figures", "a", source="beatlocked", profile="full")
    write_picture(tmp_path / "committed", "a", source="beatlocked", profile="full")
    page = page_of(tmp_path / "out", "# 03 Beats", cell_with(png, saved=("a.png",)), profile="full", picture="a.png")
    assert 'for="picture-' not in page and not (tmp_path / "out" / "figures" / "full").exists()


def test_figures_that_a_loop_saved_and_did_not_show_are_on_the_page_in_order(tmp_path: Path):
    names = ("a.png", "b.png", "c.png")
    pngs = [write_picture(tmp_path / "figures", name[0]) for name in names]
    page = page_of(tmp_path, "# 03 Beats", cell_with(pngs[-1], saved=names))
    assert re.findall(r'<img alt="The &lt;(\w)&gt;', page) == ["a", "b", "c"]


def test_card_shows_the_panel_that_the_notebook_names():
    run = run_of("# One")
    assert run.crop == "0% 0% 0% 0%"
    run.node.metadata["harmolab"] = {"panel": [0.1, 0.2, 0.7, 0.5]}
    assert run.crop == "20% 30% 50% 10%"  # from top, right, bottom and left


def test_pages_follow_one_another_in_story_order(tmp_path: Path):
    (tmp_path / "figures").mkdir()
    text = "[on](04_next.ipynb)\n\nNext: [04 Next](04_next.ipynb)"
    first = run_of("# 03 Beats\n\n" + text, part="the score", finding="3 of 4 <b>.")
    write_pages(tmp_path, [first, run_of("# 04 Next", stem="04_next", part="the generator")], "quick")
    first, second = ((tmp_path / f"{stem}.html").read_text() for stem in ("03_beats", "04_next"))
    assert first.count('href="04_next.html" rel="next"') == second.count('href="03_beats.html" rel="prev"') == 2
    assert 'rel="prev"' not in first
    assert '<a href="04_next.html">on</a>' in first
    assert "Next:" not in first
    index = (tmp_path / "index.html").read_text()
    assert re.findall(r"<h2>([^<]+)</h2>", index) == ["the score", "the generator"]
    assert "<strong>3 of 4 &lt;b&gt;.</strong>" in index


@cases(
    "source, words",
    ("synthetic + Synthetic songs", "synthetic data"),
    ("beatlocked", "recordings"),
    ("beatlocked + synthetic", "recordings and synthetic data"),
    ("synthetic song, CMU motion capture and tracked", "recordings and synthetic data"),
    ("real hands, rendered sound", "recordings"),
    ("no data: shapes alone", ""),
    ("", ""),
)
def test_source_of_a_figure_in_plain_words_and_its_corpora_as_people_know_them(source: str, words: str):
    assert data_words(source) == words
    names = source_names("beatlocked + realdance/a + realdance/b + synthetic")
    assert names == ["recordings on the beat", "recordings", "synthetic"]


def test_cell_of_a_table_that_holds_no_number_is_a_dash(tmp_path: Path):
    output = new_output("display_data", {"text/html": pd.DataFrame({"low": [float("nan")], "high": [0.5]}).to_html()})
    page = page_of(tmp_path, "# a", new_code_cell("table", outputs=[output]))
    assert "<td>–</td>" in page and "<td>0.5</td>" in page


@pytest.fixture
def save(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., saving.Saved]:
    """`save_figure` of a quick run into the test's own folder."""
    monkeypatch.setenv("HARMOLAB_FIGURES", str(tmp_path))
    return partial(saving.save_figure, notebook="00_x.ipynb", profile=RunProfile.quick())


def test_figure_of_synthetic_data_says_so_once_and_a_recording_does_not(save):
    for source, words in (("Synthetic cha-cha", ["synthetic data"]), ("tang2018", [])):
        figure = Figure()
        for name in "ab":
            save(figure, name, source=source)
        assert [text.get_text() for text in figure.texts] == words


def test_saved_figure_shows_its_picture_in_a_notebook_unless_pyplot_does(tmp_path: Path, save):
    bundle = save(Figure(), "a", source="tang2018")._repr_mimebundle_()
    assert base64.b64decode(bundle["image/png"]) == (tmp_path / "a.png").read_bytes()
    figure = pyplot.figure()
    assert save(figure, "b", source="tang2018")._repr_mimebundle_() == {"text/plain": "saved b.png"}
    pyplot.close(figure)


def test_style_holds_inside_the_block_and_leaves_everything_else_alone():
    with style.figure_style():
        assert pyplot.rcParams["axes.spines.top"] is False
        pyplot.rcParams["interactive"] = True  # as a notebook's first plot does
    assert pyplot.rcParams["axes.spines.top"] is True
    assert pyplot.rcParams["interactive"] is True
    pyplot.rcParams["interactive"] = False


def test_same_figure_is_saved_as_the_same_bytes(tmp_path: Path, save):
    for name in "ab":
        figure = Figure()
        figure.subplots().plot([0, 1])
        save(figure, name, source="tang2018")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_manifest_keeps_other_entries_and_replaces_its_own(tmp_path: Path, save):
    for name, source in [("a", "one"), ("b", "two"), ("a", "three")]:
        save(Figure(), name, source=source, seed=0)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    told = {name: (entry["source"], entry["seed"]) for name, entry in manifest.items()}
    assert told == {"a.png": ("three", 0), "b.png": ("two", 0)}
    assert sorted(file.name for file in tmp_path.glob("[!.]*")) == ["a.png", "b.png", "manifest.json"]


def test_what_is_saved_at_the_same_time_loses_no_entry(tmp_path: Path, save):
    one = partial(saving.save_table, pd.DataFrame({"score": [1.0]}), source="planted", **save.keywords)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(one, [f"table{number}" for number in range(40)]))
    assert len(json.loads((tmp_path / "manifest.json").read_text())) == 40


def test_picture_is_written_in_the_format_of_its_suffix_else_path_and_fault_are_named(tmp_path: Path):
    assert style.write_figure(Figure(), tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert style.write_figure(Figure(), tmp_path / "a.PDF").read_bytes().startswith(b"%PDF")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.PDF", "a.png"]
    refused(r"a\.wav: no picture format 'wav'", style.write_figure, Figure(), tmp_path / "a.wav")
    with pytest.raises(FileNotFoundError, match="nowhere does not exist"):
        style.write_figure(Figure(), tmp_path / "nowhere" / "a.png")


@pytest.mark.parametrize("name", ["", "../a", "a/b", ".hidden"])
def test_figure_name_that_is_no_plain_file_name_is_refused(save, name: str):
    refused("plain file name", save, Figure(), name, source="x")


def test_quick_figures_do_not_replace_the_published_ones(tmp_path: Path, monkeypatch):
    monkeypatch.delenv("HARMOLAB_FIGURES")
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.chdir(tmp_path / "notebooks")
    assert saving.figures_folder(RunProfile.full()) == tmp_path / "figures"
    assert saving.figures_folder(RunProfile.quick()) == tmp_path / "figures" / "quick"


@pytest.mark.browser
@pytest.mark.usefixtures("built")  # a report cannot be built any more once the browser's event loop runs
def test_code_and_full_run_are_switched_without_a_network(tmp_path: Path, chromium):
    png = write_picture(tmp_path / "out" / "figures", "a", inches=9.0)
    write_picture(tmp_path / "committed", "a", source="beatlocked", profile="full")
    plumbed = [new_output("stream", text="plumbed")]
    plumbing = new_code_cell("settings", outputs=plumbed, metadata={"tags": ["plumbing"]})
    page_of(tmp_path / "out", "# 03 Beats", plumbing, cell_with(png, saved=("a.png",)))
    tab = chromium.new_context(offline=True, viewport={"width": 390, "height": 800}).new_page()
    tab.goto((tmp_path / "out" / "03_beats.html").as_uri())
    code, plumbed = tab.get_by_text("draw()"), tab.get_by_text("plumbed")
    mine, full = (tab.locator(f"img[alt*='{run}']") for run in ("this run", "full run"))
    assert [part.is_visible() for part in (code, plumbed, mine, full)] == [False, False, False, True]
    tab.get_by_label("show code").check()
    tab.get_by_text("this run, synthetic data").click()
    assert [part.is_visible() for part in (code, plumbed, mine, full)] == [True, True, True, False]
    tab.get_by_text("swipe sideways").nth(0).wait_for(state="visible")  # nine inches on a phone
    tab.keyboard.press("ArrowRight")
    assert full.is_visible()
    tab.reload()
    assert code.is_visible()  # the choice stays
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.browser
@pytest.mark.slow
def test_report_opens_offline_with_every_picture_in_place(built, chromium):
    tab, asked = chromium.new_context(offline=True).new_page(), []
    tab.on("request", lambda request: asked.append(request.url))
    for page in sorted(built[1].glob("*.html")):
        tab.goto(page.as_uri())
        tab.eval_on_selector_all("details", "folds => folds.forEach(fold => { fold.open = true; })")
        tab.eval_on_selector_all("img", "pictures => Promise.all(pictures.map(picture => picture.decode()))")
        assert tab.eval_on_selector_all("img", "all => all.every(one => one.naturalWidth > 100)"), page.name
    assert {url.partition(":")[0] for url in asked} <= {"file", "data"}
    assert any(url.endswith("fig01.png") for url in asked)


# Light and dark

THEME = (TEMPLATES / "theme.css.j2").read_text("utf-8").split("@media screen and (prefers-color-scheme: dark)")
LIGHT, DARK = (dict(re.findall(r"--(\w+): (#\w+);", part)) for part in THEME)  # name -> colour


def luminance(colour: str) -> float:
    """Relative luminance of a colour, as WCAG has it."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    parts = np.array([int(digits[at : at + 2], 16) for at in (0, 2, 4)]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
def test_words_can_be_read_on_light_and_on_dark_pages(palette: dict[str, str]):
    on_paper = [(words, "paper") for words in ("ink", "quiet", "link", "good", "bad")]
    for words, ground in (*on_paper, ("quiet", "wash"), *(("ink", one) for one in ("wash", "alarm", "mark", "field"))):
        assert contrast(palette[words], palette[ground]) > 4.5, (words, ground)


def test_every_page_takes_its_colours_from_the_theme_and_has_none_of_its_own():
    assert set(LIGHT) == set(DARK)
    for path in TEMPLATES.glob("*.html.j2"):
        text = path.read_text("utf-8")
        assert "theme.css.j2" in text or re.search(r'extends "\w+.html.j2"', text), path.name
        style = "".join(re.findall(r"<style.*?</style>", text, flags=re.DOTALL))
        assert set(re.findall(r"var\(--(?!jp-|pixels)(\w+)", style)) <= {*LIGHT, "shade"}, path.name
        # Of the names of a body's sides, on their colours, and white under pictures.
        own = set(re.findall(r"[^-](?:color|background|border[a-z-]*): [^;}]*(#\w{3,6})\b", style))
        assert own <= {"#fff", "#111"}, path.name


def test_a_page_has_one_main_part_and_its_heading_in_it():
    for path in (*TEMPLATES.glob("*.html.j2"), ROOT / "docs" / "templates" / "404.html"):
        before, *parts = path.read_text("utf-8").split("<main")
        assert len(parts) == ("<body" in before) and "<h1" not in before, path.name


# The site of `make docs`

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
pytest.importorskip("sphinx")


@pytest.fixture
def extension(monkeypatch: pytest.MonkeyPatch):
    """Import one of the modules behind the site, by its name."""
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))
    return importlib.import_module


def test_every_page_is_in_the_list_of_pages():
    listed = re.findall(r"^([a-z0-9_]+)$", (DOCS / "index.md").read_text("utf-8"), flags=re.MULTILINE)
    assert sorted(listed) == sorted(path.stem for path in DOCS.glob("*.md") if path.stem != "index")


def test_page_of_what_has_another_name_by_now_is_removed_and_no_other(extension, tmp_path: Path, monkeypatch):
    generated = extension("generated_pages")
    monkeypatch.setattr(generated, "FOLDER", tmp_path)
    generated.write_pages({"labs.inc": "labs", "gallery/04.md": "four"})
    generated.write_pages({"areas.inc": "areas", "api/player.rst": "player", "api/score.rst": "score"})
    generated.write_pages({"areas.inc": "areas", "api/player_data.rst": "player", "api/score.rst": "score"})
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert names == {"labs.inc", "gallery/04.md", "areas.inc", "api/player_data.rst", "api/score.rst"}


def test_every_public_name_is_on_one_page_of_the_reference(extension):
    reference = extension("api_pages")
    for facade in reference.FACADES:
        areas = reference.public_names(facade)
        names = [name for area in areas.values() for name in area]
        assert sorted(names) == sorted(set(importlib.import_module(facade).__all__) - {"__version__"})
        assert set(areas) <= set(reference.AREAS), "an area without a title"


def test_every_notebook_has_a_card_with_its_finding_and_a_picture(extension):
    pages = extension("gallery_pages").gallery()
    cards, players = pages["cards.inc"], pages["gallery/20_players_and_avatars.md"]
    assert players.count("grey dots are movements without a note") == 1  # for two pictures, of a name that is filled in
    for path in (ROOT / "notebooks").glob("[0-9]*.ipynb"):
        text = cards.partition(f":link: generated/gallery/{path.stem}\n")[2].partition("\n:::\n")[0]
        assert f":img-top: generated/gallery/{path.stem}.png" in text and re.search(r":img-alt: \w.{15,}", text)
        assert len(text.splitlines()[-1]) > 40, f"{path.name} says nothing"


def test_thumbnail_of_a_card_is_the_panel_that_the_notebook_names(extension, tmp_path: Path):
    gallery = extension("gallery_pages")
    picture = np.zeros((40, 100, 3), np.uint8)
    picture[10:20, 50:75] = 255
    panel = np.asarray(gallery.thumbnail(Image.fromarray(picture), (0.5, 0.25, 0.75, 0.5)))
    assert panel.shape == (10, 25, 3) and panel.min() == 255
    gallery.write_thumbnails(tmp_path)
    names = {path.stem for path in (ROOT / "notebooks").glob("[0-9]*.ipynb")}
    assert {path.stem for path in tmp_path.glob("*.png")} == names
    for path in tmp_path.glob("*.png"):
        with Image.open(path) as image:
            # It is shown 400 wide, so that letters of 8 points are left.
            assert 200 < image.width < 920 and image.height > 100


def test_links_beside_the_docs_lead_to_a_page_or_are_text(extension, monkeypatch: pytest.MonkeyPatch):
    links = extension("repository_links")
    monkeypatch.setattr(links, "repository", lambda: "")
    assert links.site_link("rows", "../benchmarks/rows") == "`benchmarks/rows`"
    assert links.site_link("the notice", "../a/NOTICE") == "the notice (`a/NOTICE`)"
    assert links.site_link("card", "../x/MODEL_CARD.md") == "[card](model_cards.md)"
    monkeypatch.setattr(links, "repository", lambda: "https://example.org/h")
    assert links.site_link("rows", "../benchmarks/rows") == "[rows](https://example.org/h/blob/main/benchmarks/rows)"


def test_bars_and_underscores_of_a_docstring_are_no_references(extension):
    lines = ["the |x| of `a|b` and name_, not mir_eval", ">>> a | b"]
    extension("api_pages").escape_prose(None, "function", "f", None, None, lines)
    assert lines == ["the \\|x\\| of `a|b` and name\\_, not mir_eval", ">>> a | b"]


class Links(HTMLParser):
    """The places of a page that can be linked to, and where its own links lead."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.places, self.targets = {""}, set()
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.places |= {value for name, value in attrs if name == "id" or (tag, name) == ("a", "name")}
        self.targets |= {value for name, value in attrs if name in ("href", "src") and value}


def dead_links(site: Path) -> set[tuple[str, str]]:
    """(page, link) of what leads to no file of the site, or to no place of its page."""
    links = {path: Links(path) for path in site.rglob("*.html")}
    dead = set()
    for page, target in ((page, target) for page, own in links.items() for target in own.targets):
        address = urlsplit(target)
        if address.scheme or address.netloc:
            continue
        start = site if address.path.startswith("/") else page.parent
        file = (start / unquote(address.path).lstrip("/")).resolve() if address.path else page
        places = links[file].places if file in links else {""}
        if not file.is_file() or (file in links and unquote(address.fragment) not in places):
            dead.add((page.name, target))
    return dead


def test_link_check_finds_a_file_and_a_place_that_are_not_there(tmp_path: Path):
    (tmp_path / "a").mkdir()
    links = '<a href="../two.html#here"><a href="../two.html#there"><img src="no.png">'
    (tmp_path / "a" / "one.html").write_text(links)
    (tmp_path / "two.html").write_text('<p id="here"><a href="/a/one.html"><a href="#"><a href="https://example.org">')
    assert dead_links(tmp_path) == {("one.html", "../two.html#there"), ("one.html", "no.png")}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """The site as `make docs` has built it where nothing has changed since, else built anew."""
    page, folders = ROOT / "site" / "404.html", ("docs", "figures", "harmolab", "notebooks")
    changed = max(path.stat().st_mtime for name in folders for path in (ROOT / name).rglob("*.*[!c]"))  # no .pyc
    if page.is_file() and page.stat().st_mtime > changed:
        return page.parent
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return tmp_path


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_fetches_nothing(site: Path):
    pages = [*site.rglob("*.html")]
    assert len(pages) > 60 and dead_links(site.resolve()) == set()
    assert (site / ".nojekyll").is_file() and 'href="/index.html"' in (site / "404.html").read_text("utf-8")
    returned = (site / "generated" / "api" / "harmolab.score.html").read_text("utf-8").partition(">Returns</p>")[2]
    assert returned.lstrip().startswith("<p>")  # a text, and no list of its lines
    elsewhere = r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=\"(?:https?:)?//"
    assert [page.name for page in pages if re.search(elsewhere, page.read_text("utf-8"))] == []


@pytest.mark.browser
def test_the_site_is_searched_on_a_phone_and_printed_whole(site: Path, chromium):
    page = chromium.new_page(viewport={"width": 700, "height": 900})
    page.goto(f"{site.as_uri()}/search.html")
    page.get_by_label("Words to look for").press_sequentially("waltz\n")
    page.locator("#search-results li").first.wait_for()
    page.goto(f"{site.as_uri()}/report.html")
    assert page.locator("article p > img").first.bounding_box()["width"] >= 704
    page.emulate_media(media="print")
    assert page.locator(".skip-to-content").is_hidden()
    for name in ("claims", "report"):
        page.goto(f"{site.as_uri()}/{name}.html")
        boxes = page.locator("article").locator(".table-wrapper, p:has(> img)")
        assert boxes.evaluate_all("all => all.length > 2 && all.every(e => e.scrollWidth <= e.clientWidth)")
