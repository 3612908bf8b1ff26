"""Your own dance: a song and a motion file or a video, put together, scored, told in words, shown on one page.

The page, in `harmolab.own_dance.page`, needs jinja2 of the extra `lab`; the rest does not.
"""

from harmolab.own_dance.recording import Placement, Recording, load_recording, place_recording
from harmolab.own_dance.telling import OwnDance, explain_recording

__all__ = [
    "OwnDance",
    "Placement",
    "Recording",
    "explain_recording",
    "load_recording",
    "place_recording",
]
