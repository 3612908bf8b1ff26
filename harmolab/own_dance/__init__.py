"""One's own dance: a song and a motion file or a video, put together, scored, explained in words and on one page.

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

__all__ = ["OwnDance", "Performance", "Placement", "explain_performance", "load_performance", "place_performance"]
