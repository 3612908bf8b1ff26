"""The page on which a song is tapped: what it sends, what it takes, what it refuses."""

import http.client
import io
import json
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

import numpy as np
import pytest
import soundfile

from harmolab.lab.listening.local_page import TapServer
from harmolab.types import Audio
from tests.builders import cases
from tests.test_listening_presenting import ask

Saved = list[tuple[list[float], list[float]]]


@pytest.fixture
def saved() -> Saved:
    return []


@pytest.fixture
def server(click_track: Callable[..., Audio], saved: Saved) -> Iterator[TapServer]:
    def save(taps: np.ndarray, ones: np.ndarray) -> str:
        if not taps.size:
            raise ValueError("0 taps are too few")
        saved.append((taps.tolist(), ones.tolist()))
        return "kept <all>"

    server = TapServer("<song> & co", click_track(120, seconds=2.0), save)
    with server.running():
        yield server


def test_page_plays_the_song_and_names_it(server: TapServer, click_track: Callable[..., Audio]):
    status, page = ask(server.address, "GET")
    assert status == 200
    assert "&lt;song&gt; &amp; co" in page
    assert "http" not in page.replace(server.address, "")
    import urllib.request

    with urllib.request.urlopen(f"{server.address}sound.wav", timeout=10) as reply:
        samples, rate = soundfile.read(io.BytesIO(reply.read()))
    assert rate == 22050
    np.testing.assert_allclose(samples, click_track(120, seconds=2.0).samples, atol=1e-4)


def test_taps_are_handed_on_and_the_answer_comes_back(server: TapServer, saved: Saved):
    assert not server.finished.is_set()
    assert ask(server.address, "POST", json.dumps({"taps": [0.5, 1.0], "ones": [1.0]})) == (200, "kept <all>")
    assert saved == [([0.5, 1.0], [1.0])]
    assert server.finished.wait(10)


@cases(
    "body, fault",
    (json.dumps({"taps": [], "ones": []}), "0 taps are too few"),
    (json.dumps({"taps": [0.5]}), "ones must"),
    (json.dumps({"taps": [["x"]], "ones": []}), "taps must be numbers"),
    ("[]", "taps come as a record"),
    ("{", "Expecting property name"),
    ("[" * 200_000, "lists within lists"),
)
def test_what_is_no_taps_is_refused_and_the_person_may_go_on(server: TapServer, saved: Saved, body: str, fault: str):
    status, text = ask(server.address, "POST", body)
    assert status == 400
    assert fault in text
    assert saved == []
    assert not server.finished.is_set()


def test_a_body_that_is_announced_too_long_is_refused_unread(server: TapServer, saved: Saved):
    parts = urlsplit(server.address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=10)
    connection.putrequest("POST", parts.path)
    connection.putheader("Content-Length", str(TapServer.most_bytes + 1))
    connection.endheaders()
    reply = connection.getresponse()
    assert (reply.status, reply.read()) == (400, b"at most 1048576 bytes are taken")
    connection.close()
    assert saved == []


@pytest.mark.parametrize("path", ["/", "/sound.wav", "//", "/x/sound.wav"])
def test_other_addresses_hold_nothing(server: TapServer, saved: Saved, path: str):
    assert ask(server.address, "GET", path=path)[0] == 404
    assert ask(server.address, "POST", json.dumps({"taps": [1], "ones": []}), path=path)[0] == 404
    assert ask(server.address, "GET", path=f"{server.path}other")[0] == 404
    assert ask(server.address, "POST", "{}", path=f"{server.path}sound.wav")[0] == 404
    assert saved == []
