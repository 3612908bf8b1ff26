"""The labs as pages of their own, of synthetic dances, for a site or to send around."""

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from pathlib import Path

from harmolab.beats.audio import music_beats
from harmolab.data.synthetic import ClipSettings, planted_clip, synthetic_clip
from harmolab.lab.labs.corpus import corpus_lab
from harmolab.lab.labs.live import LiveLab
from harmolab.lab.labs.meter import meter_lab
from harmolab.lab.labs.one_clip import detector_lab, saliency_lab, scoring_lab
from harmolab.params import DANCES
from harmolab.types import Clip

SECONDS = 12.0
N_CLIPS = 42


def write_lab_pages(folder: Path) -> list[Path]:
    """Write the five labs as pages of synthetic dances: scoring_lab.html and so on, each one self-contained file.

    Parameters
    ----------
    folder : str or path
        Made if there is none.

    Returns
    -------
    list of the paths of the five pages

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
        "detector_lab": inexact_detector_lab,
        "meter_lab": inexact_meter_lab,
    }
    paths = [Path(folder) / f"{name}.html" for name in labs]
    for path, lab in zip(paths, labs.values(), strict=True):
        lab().save(path)
    return paths


def inexact_dance() -> Clip:
    """A synthetic cha-cha whose movements end a little early or late, some left out and some too many."""
    return synthetic_clip("cha-cha", seconds=SECONDS, jitter=0.04, omission=0.1, redundancy=0.1, seed=3)


def inexact_detector_lab() -> LiveLab:
    """The detector lab of a synthetic cha-cha whose rests are known."""
    planted = planted_clip(ClipSettings("cha-cha", seconds=8.0, jitter=0.03, seed=0))
    return detector_lab(planted.clip, planted=planted.visual_beat_times)


def inexact_meter_lab() -> LiveLab:
    """The meter lab of a synthetic rumba: beats tracked in its sound, and the planted ones in bars."""
    planted = planted_clip(ClipSettings("rumba", seconds=18.0, seed=2))
    bars = replace(music_beats(planted.clip), bar_places=planted.annotation.bar_places())
    return meter_lab(replace(planted.clip, beats=None), annotated=bars)


def inexact_corpus(count: int) -> list[Clip]:
    """Synthetic dances of six seconds, whose movements end early or late by 0.1 s or so."""
    dances = zip(range(count), cycle(DANCES), strict=False)
    return [synthetic_clip(dance, seconds=6.0, fps=30.0, jitter=0.1, seed=seed) for seed, dance in dances]
