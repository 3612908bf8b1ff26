"""One's own dance: a song and a motion file or a video, put together, scored, told in words, shown on one page.

The page, in `harmolab.own_dance.page`, needs jinja2 of the extra `lab`; the rest does not.
"""

from harmolab.own_dance.recording import (
    OwnDance,
    Performance,
    Placement,
    explain_performance,
    load_performance,
    place_performance,
)
from harmolab.own_dance.telling import Explanation, Finding, explain

__all__ = [
    "Explanation",
    "Finding",
    "OwnDance",
    "Performance",
    "Placement",
    "explain",
    "explain_performance",
    "load_performance",
    "place_performance",
]
