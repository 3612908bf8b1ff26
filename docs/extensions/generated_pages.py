"""The folder of the pages that the build writes; git ignores it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "generated"


def write_pages(pages: Mapping[str, str]) -> None:
    """Write each page, by its name in the folder, where its text has changed, so that a second build is quick."""
    for name, text in pages.items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
