"""A local page that plays a song while a person taps its beats and marks "one"."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from harmolab.io.arrays import number_array
from harmolab.io.audio import wav_bytes
from harmolab.lab.listening.local_page import TEXT, LocalPage, Reply
from harmolab.lab.report.templates import rendered
from harmolab.types import Audio, FloatArray

SOUND = "sound.wav"


class TapServer(LocalPage):
    """Plays a song in a browser on this machine and takes the taps to it.

    Parameters
    ----------
    title : str, name of the song
    audio : Audio
    save : function(taps, ones) -> str
        Keeps the (K,) times of all taps and the (D,) times of those on "one", in seconds of audio time, and returns
        what to tell the person. Its ValueErrors and OSErrors are told too, and the person may go on tapping.
    port : int, 0 for any free one

    Attributes
    ----------
    finished : threading.Event, set when taps were saved
    """

    most_bytes = 2**20

    def __init__(
        self, title: str, audio: Audio, save: Callable[[FloatArray, FloatArray], str], *, port: int = 0
    ) -> None:
        super().__init__(port=port)
        self._title, self._save, self._sound = title, save, wav_bytes(audio)

    def get(self, name: str) -> Reply | None:
        """The page, or its sound."""
        if name == SOUND:
            return Reply(self._sound, kind="audio/wav")
        return None if name else Reply(rendered("tap.html.j2", title=self._title, sound=SOUND))

    def post(self, body: str) -> Reply:
        """Hands on the taps, ``{"taps": [seconds, ...], "ones": [seconds, ...]}``."""
        content = _parsed(body)
        taps, ones = (number_array(content.get(name), name, (None,)) for name in ("taps", "ones"))
        return Reply(self._save(taps, ones), kind=TEXT, is_last=True)


def _parsed(body: str) -> dict[str, Any]:
    """The record in a text of JSON."""
    try:
        content = json.loads(body)
    except RecursionError:
        raise ValueError("taps lie in lists within lists") from None
    if not isinstance(content, dict):
        raise ValueError("taps come as a record of JSON")
    return content
