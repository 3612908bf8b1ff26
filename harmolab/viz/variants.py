"""How each generator looks in every picture: colour and mark name its losses; hollow is without the harmony term."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from harmolab.viz.style import COLOURS

__all__ = ["LOOKS", "Look"]


@dataclass(frozen=True)
class Look:
    """Colour and mark of one kind of motion, and its name in words."""

    label: str
    colour: str
    marker: str
    filled: bool

    @property
    def mark(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot` for a single mark."""
        return {
            "linestyle": "none",
            "marker": self.marker,
            "markersize": 8,
            "color": self.colour,
            "markerfacecolor": self.colour if self.filled else "white",
            "markeredgewidth": 1.8,
        }


# Neither colour means anything in `COLOURS`; they differ in lightness and in shape of the mark too.
_PAPER, _OURS = "#8C6D31", "#6A3D9A"

LOOKS = MappingProxyType(
    {
        "paper, without": Look("paper's losses, no harmony", _PAPER, "s", False),
        "paper": Look("paper's losses + harmony", _PAPER, "s", True),
        "recommended, without": Look("our losses, no harmony", _OURS, "o", False),
        "recommended": Look("our losses + harmony", _OURS, "o", True),
        "recorded": Look("recorded motion", COLOURS["ink"], "D", True),
    }
)
