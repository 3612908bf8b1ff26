"""Words of a player's page, of a dance or of a musician's hands, and the sentences that follow the sliders of a lab."""

from __future__ import annotations

import math
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

# The labs' script in the browser fills the same sentences.
LAB_SENTENCES: Mapping[str, str] = MappingProxyType(
    {
        "hits": "Now {hits} of {beats} music beats are met; by chance alone {chance} % would be.",
        "more": " Hardly any other start of the music would do as well (p = {p}).",
        "luck": " Other starts of the music do as well (p = {p}).",
        "unheard": "No music beat is loud enough to count.",
        "unseen": "No movement is large enough to count.",
        "kept": "Now {music} of {beats} music beats and {dance} of {movements} movements are noticed.",
        "planted": "Now {found} of {planted} planted rests are found within {near} ms; "
        "{beats} visual beats for {music} music beats.",
        "detected": "Now there are {beats} visual beats for {music} music beats.",
        "meter": "Now {strong} of {beats} beats are strong, and meter units cover {covered} % of the time.",
        "downbeats": " Of the downbeats among them {strong_downbeats} of {downbeats} are strong.",
        "corpus": "The true music wins in {wins} of {clips} dances, with {ties} ties. AUC {auc} %; a coin has 50 %.",
    }
)
LUCK = 0.05  # p-values above it are called luck


def percent(share: float) -> str:
    """A share in whole per cent; halves are rounded up, in the browser too."""
    return str(math.floor(100 * share + 0.5))


# Names of numbers, as tables of computed scores have them, in words that say what they mean.
PLAIN_FACTS: Mapping[str, str] = MappingProxyType(
    {
        "harmony above chance": "harmony above chance (0: as by luck, 1: all)",
        "p in time": "share of other tempi that fit as well (p)",
        "level, 0 to 4": "level of the verdict, 0 to 4",
        "pulse, 1/s": "pulse of the movement, 1/s",
        "share inside the body": "share of the movement inside the body",
        "music beats N": "beats of the music that count",
        "paper: harmony": "harmony as the paper computes it",
        "paper: hit rate": "beats met, as the paper counts (share)",
        "paper: chance": "the same by luck alone",
        "paper: visual beats M": "beats of the dancer, as the paper counts",
        "jerk, m/s³": "jerk: how abrupt the movement is, m/s³",
        "foot skating, m/s": "speed of feet that slide on the floor, m/s",
    }
)
