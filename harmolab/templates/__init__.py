"""The HTML pages of players, own dances and reports, and the one way to fill them; needs jinja2 (extra `lab`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parent


def rendered(template: str, **values: Any) -> str:
    """The page of a template of this folder; text among the values is escaped."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True)
    return environment.get_template(template).render(**values)
