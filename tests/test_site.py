"""The site of `make docs`: pages are listed, public names and notebooks have their place, nothing is fetched."""

import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
pytest.importorskip("sphinx")


@pytest.fixture
def extension(monkeypatch: pytest.MonkeyPatch):
    """Import one of the modules behind the site, by its name."""
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))

    def imported(name: str) -> ModuleType:
        return importlib.import_module(name)

    return imported


def test_every_page_is_in_the_list_of_pages():
    listed = re.findall(r"^([a-z_]+)$", (DOCS / "index.md").read_text("utf-8"), flags=re.MULTILINE)
    assert sorted(listed) == sorted(path.stem for path in DOCS.glob("*.md") if path.stem != "index")


def test_every_public_name_is_on_one_page_of_the_reference(extension):
    reference = extension("api_pages")
    for facade in reference.FACADES:
        areas = reference.public_names(facade)
        names = [name for area in areas.values() for name in area]
        assert sorted(names) == sorted(set(importlib.import_module(facade).__all__) - {"__version__"})
        assert set(areas) <= set(reference.AREAS), "an area without a title"


def test_every_notebook_has_a_card_with_its_finding_and_a_picture(extension):
    cards = extension("gallery_pages").gallery()["cards.inc"]
    for path in (ROOT / "notebooks").glob("[0-9]*.ipynb"):
        text = cards.partition(f":link: generated/gallery/{path.stem}\n")[2].partition("\n:::\n")[0]
        assert (DOCS / re.search(r":img-top: (\S+)", text)[1]).exists()
        assert len(text.splitlines()[-1]) > 40, f"{path.name} says nothing"


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


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_fetches_nothing(tmp_path: Path):
    site = tmp_path / "site"
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", str(DOCS), str(site)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    pages = list(site.rglob("*.html"))
    assert len(pages) > 60
    for page in pages:
        sources = re.findall(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=\"([^\"]+)\"", page.read_text("utf-8"))
        assert [source for source in sources if re.match(r"(?:https?:)?//", source)] == [], page.name
