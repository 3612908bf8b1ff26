"""The folder of the pages that the build writes; git ignores it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "generated"


def write_pages(pages: Mapping[str, str]) -> None:
    """Write each page, by its name in the folder, where its text has changed, so that a second build is quick.

    Other pages beside them are removed: what they are of has another name by now.
    """
    for name, text in pages.items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    rooms = {Path(name).parent for name in pages if "/" in name}
    for old in (path for room in rooms for path in (FOLDER / room).iterdir()):
        if old.suffix in (".md", ".rst") and old.relative_to(FOLDER).as_posix() not in pages:
            old.unlink()
