"""Movement that comes with harmolab, so that `harmolab dance` needs nothing else: recorded, of a network, computed.

========  ============================================================================================================
salsa     the follower of a salsa couple, 11 takes, 5 minutes: CMU Graphics Lab Motion Capture Database, subject 61
indian    an Indian solo dance, 6 takes, 2 minutes: subject 94 of the same
ballroom  twelve dances of half a minute, made by the shipped Music2Dance (`systems.music2dance`): no recorded frame
puppet    synthetic dancers, computed when they are asked for; no person was recorded
========  ============================================================================================================

The recorded takes have a notice of their own beside them (NOTICE) and are not under the licence of the package.
No bank knows the beats that it was danced to: each song cuts it anew, at the rests of the body.
"""

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.types import Clip

FOLDER = Path(__file__).parent
REMARKS: Mapping[str, str] = MappingProxyType(
    {
        "salsa": "salsa steps on the beat, practised without the partner",
        "indian": "Indian dance on the beat; limits from six short takes",
        "ballroom": "ballroom, dreamt by a network: no recorded frame",
        "puppet": "a puppet: synthetic dancers, no person was recorded",
    }
)
STYLES = tuple(style for style in REMARKS if style == "puppet" or (FOLDER / style).is_dir())
PUPPETS, PUPPET_SECONDS, PUPPET_FPS = 14, 23.0, 30.0  # clips, seconds of each, hertz


def shipped_bank(style: str = "salsa", dance: str = "") -> Choreographer:
    """A choreographer with movement that comes with harmolab, so that it can dance at once.

    Parameters
    ----------
    style : str
        "salsa": the follower of a recorded salsa couple, 11 takes, 5 minutes. "indian": a recorded Indian solo dance, 6
        takes, 2 minutes. "ballroom": twelve dances of half a minute, made by the shipped Music2Dance. "puppet":
        computed dancers.
    dance : str
        Name of one of `harmolab.DANCES`, all of which a puppet can dance (cha-cha when left out); of no effect for
        other styles.

    Returns
    -------
    Choreographer

    Raises
    ------
    ValueError
        For another style, or a dance that no puppet knows.
    FileNotFoundError
        If the movement was left out of this installation.

    Examples
    --------
    >>> motion = shipped_bank("salsa").generate(audio, seconds=20.0)  # doctest: +SKIP
    """
    if style not in STYLES:
        raise ValueError(f"unknown style {style!r}; there are {', '.join(STYLES)}")
    return copy(_bank(style, (dance or "cha-cha") if style == "puppet" else ""))


@cache
def _bank(style: str, dance: str) -> Choreographer:
    """The bank, read and measured once for all songs of a process."""
    return Choreographer.of(puppets(dance)) if style == "puppet" else Choreographer.load(FOLDER / style)


def puppets(dance: str, *, clips: int = PUPPETS, seconds: float = PUPPET_SECONDS) -> list[Clip]:
    """Synthetic dancers of one dance, whose beats and bars are known; ValueError for an unknown dance."""
    settings = (ClipSettings(dance, seconds=seconds, fps=PUPPET_FPS, seed=seed) for seed in range(1, clips + 1))
    return [
        replace(planted.clip, name=f"puppet {number}", beats=planted.annotation.track(seconds))
        for number, planted in enumerate(map(planted_clip, settings), 1)
    ]
