"""Links of a page to files beside docs/: to the page of the site that shows the file, or else its path as text."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[2]
PAGES = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "figures/manifest.json": "gallery.md"}
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((\.\./[^)\s#]+)\)")


def repository() -> str:
    """Address of the repository in pyproject.toml; empty while there is no public one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return str(project.get("urls", {}).get("Repository", "")).rstrip("/")


def site_link(label: str, target: str) -> str:
    """Markdown for a link to `target`, a path relative to docs/."""
    path = target.removeprefix("../")
    if path.endswith("MODEL_CARD.md"):
        return f"[{label}](model_cards.md)"
    if path.endswith(".ipynb"):
        return f"[{label}](generated/gallery/{Path(path).stem}.md)"
    if path in PAGES:
        return f"[{label}]({PAGES[path]})"
    if repository():
        return f"[{label}]({repository()}/blob/main/{path})"
    return f"`{path}`" if label.strip("`") in path else f"{label} (`{path}`)"


def rewrite_links(app: Sphinx, docname: str, source: list[str]) -> None:
    """Replace the links of one page that leave docs/; its pictures stay as they are."""
    source[0] = LINK.sub(lambda link: site_link(link[1], link[2]), source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Let Sphinx call `rewrite_links` on every page that it reads."""
    app.connect("source-read", rewrite_links)
    return {"parallel_read_safe": True}
