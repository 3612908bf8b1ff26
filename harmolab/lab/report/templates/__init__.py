"""The HTML pages of players, own dances and reports: filled and framed here."""

import html
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parent
ENVIRONMENT = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True)
ENVIRONMENT.globals["version"] = lambda: version("harmolab")


def rendered(template: str, **values: Any) -> str:
    """The page of a template of this folder; text among the values is escaped."""
    return ENVIRONMENT.get_template(template).render(**values)


def framed(page: str, *, title: str = "Dance", height: int = 520) -> str:
    """A page in a frame, as HTML to stand in another page, a notebook or the report.

    A player's page sets the frame's height itself; `height`, in pixels, is for readers that run no script. Browsers
    never show the words inside a frame: they stay where it is left out, as of a notebook that is not trusted.
    """
    return (
        f'<iframe title="{html.escape(title)}" srcdoc="{html.escape(page)}" '
        f'style="width: 100%; height: {height}px; border: 0" loading="lazy" allowfullscreen>{html.escape(title)}: '
        "not shown here. In JupyterLab run this cell, or choose “Trust Notebook”; previews show none.</iframe>"
    )
