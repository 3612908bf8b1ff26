"""Words of a player's page: of a dance to its music, and of a musician's hands and the sound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class PageWords:
    """Words for what a player shows.

    Parameters
    ----------
    figure : the stick figure, for people who hear the page
    piece : noun for all of it, as in "the dance is silent"
    sound, mover : names of the two lamps, and of their clicks
    onset, unit : a beat of the sound; the short word for one that is met or missed
    event : a beat of the movement
    curve : the curve under the marks
    """

    figure: str
    piece: str
    sound: str
    mover: str
    onset: str
    unit: str
    event: str
    curve: str = "speed"


DANCING = PageWords(
    figure="a stick figure that dances to the music", piece="dance", sound="music", mover="dancer",
    onset="music beat", unit="beat", event="dancer's beat",
)  # fmt: skip
PLAYING: Mapping[str, PageWords] = MappingProxyType(
    {
        instrument: PageWords(
            figure=f"a stick figure that plays the {instrument}", piece="performance", sound="notes", mover=mover,
            onset="note onset",
            unit="onset", event=event, curve=f"speed of the {hands}",
        )
        for instrument, mover, event, hands in (
            ("piano", "fingers", "strike", "hands"), ("violin", "bow", "turn of the bow", "hand that bows"),
        )
    }
)  # fmt: skip
