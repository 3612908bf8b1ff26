"""The labs that need no Python: files of their own, written beside the pages, and the page that leads to them."""

from __future__ import annotations

from pathlib import Path

from generated_pages import write_pages
from sphinx.application import Sphinx

import harmolab.lab

LABS = {
    "scoring_lab.html": (
        "Scoring",
        "Two rows of beats, the settings of the score, and how many beats are met by chance alone.",
    ),
    "saliency_lab.html": (
        "Which beats count",
        "Every movement makes small beats; choose how large one must be to count.",
    ),
    "corpus_lab.html": ("A corpus", "Every recording as a dot: with its own music, and with the same music late."),
    "detector_lab.html": (
        "Beats of a dance",
        "The curve that visual beats are read from, and which rests of a synthetic dancer each setting finds.",
    ),
    "meter_lab.html": ("Meter units", "Strong and weak beats of a song, and what they are grouped into."),
}


def links() -> str:
    """Markdown of the links to the labs."""
    lines = [f'- <a href="labs/{file}">{title}</a>: {text}' for file, (title, text) in LABS.items()]
    return "\n".join(lines)


def write_labs(app: Sphinx, exception: Exception | None) -> None:
    """Write the labs into the finished site."""
    if exception is None:
        harmolab.lab.write_lab_pages(Path(app.outdir) / "labs")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the page before Sphinx looks for sources, and the labs when it has finished."""
    app.connect("builder-inited", lambda app: write_pages({"lab_links.inc": links()}))
    app.connect("build-finished", write_labs)
    return {"parallel_read_safe": True}
