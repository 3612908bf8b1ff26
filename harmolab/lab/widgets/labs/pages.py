"""The labs as pages of their own, of synthetic dances, for a site or to send around."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.lab.widgets.labs.corpus import corpus_lab
from harmolab.lab.widgets.labs.live import LiveLab
from harmolab.lab.widgets.labs.saliency import saliency_lab
from harmolab.lab.widgets.labs.scoring import scoring_lab
from harmolab.params import DANCES
from harmolab.types import Clip

SECONDS = 12.0
N_CLIPS = 42


def write_lab_pages(folder: Path) -> list[Path]:
    """Pages scoring_lab.html, saliency_lab.html and corpus_lab.html in `folder`, each one self-contained file.

    Parameters
    ----------
    folder : folder to write to, made if there is none

    Returns
    -------
    list of the three paths

    Examples
    --------
    >>> write_lab_pages(Path("site"))  # doctest: +SKIP
    """
    Path(folder).mkdir(parents=True, exist_ok=True)
    clip = inexact_dance()
    labs: dict[str, Callable[[], LiveLab]] = {
        "scoring_lab": lambda: scoring_lab(clip),
        "saliency_lab": lambda: saliency_lab(clip),
        "corpus_lab": lambda: corpus_lab(inexact_corpus(N_CLIPS), mode="valleys"),
    }
    paths = [Path(folder) / f"{name}.html" for name in labs]
    for path, lab in zip(paths, labs.values(), strict=True):
        lab().save(path)
    return paths


def inexact_dance() -> Clip:
    """A synthetic cha-cha whose movements end a little early or late, some left out and some too many."""
    return synthetic_clip("cha-cha", seconds=SECONDS, jitter=0.04, omission=0.1, redundancy=0.1, seed=3)


def inexact_corpus(count: int) -> list[Clip]:
    """Synthetic dances of six seconds, whose movements end early or late by 0.1 s or so."""
    dances = tuple(DANCES)
    return [
        synthetic_clip(dances[seed % len(dances)], seconds=6.0, fps=30.0, jitter=0.1, seed=seed)
        for seed in range(count)
    ]
