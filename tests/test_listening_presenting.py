"""Local pages: a rater answers, a person taps the beats of a song; each answer is on disk before the next trial."""

import html
import http.client
import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import closing
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urlsplit
from urllib.request import urlopen

import numpy as np
import pytest
import soundfile

from harmolab.beats.audio import with_clicks
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer, TapServer
from harmolab.lab.listening.trials import MARKED, Item, Trial, TrialSet, make_trials
from harmolab.readers.beats import tap_grid, tapped_beats
from harmolab.types import Audio
from tests.builders import cases, refused, track
from tests.test_labs_browser import at_address, closed

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]


@pytest.fixture
def trials() -> TrialSet:
    return make_trials(CLIPS, kind="pick", n=4, seed=1, rater="Ada")


@pytest.fixture
def log(tmp_path: Path) -> AnswerLog:
    return AnswerLog(tmp_path / "answers.jsonl")


def shown(trial: Trial) -> str:
    return f"<b>{trial.id}</b>"


@pytest.fixture
def address(trials: TrialSet, log: AnswerLog) -> Iterator[str]:
    with StudyServer(trials, log, shown).running() as address:
        yield address


def ask(address: str, method: str, form: object = None, *, path: str = "", **options: object) -> tuple[int, str]:
    parts = urlsplit(address)
    with closing(http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=10)) as connection:
        connection.request(method, path or parts.path, urlencode(form) if isinstance(form, dict) else form, **options)
        reply = connection.getresponse()
        return reply.status, reply.read().decode()


def test_page_and_frame_ask_every_trial_each_answer_is_on_disk_and_thanks_are_the_end(trials: TrialSet, log: AnswerLog):
    server = StudyServer(trials, log, shown).start().start()  # as by the cell of notebook 14 that is run again
    assert urlsplit(server.address).hostname == "127.0.0.1"
    for number, trial in enumerate(trials.trials, 1):
        status, page = ask(server.address, "GET")
        assert status == 200
        assert html.unescape(re.search(r' srcdoc="([^"]*)"', server._repr_html_())[1]) == page
        assert f"Trial {number} of 4" in page and html.escape(f"<b>{trial.id}</b>") in page
        assert f'name="trial" value="{trial.id}"' in page
        assert re.findall(r'name="choice" value="(\w+)"', page) == list(trials.choices)
        action = re.search(r'<form method="post" action="([^"]*)"', page)[1]
        assert ask(action, "POST", {"trial": trial.id, "choice": "harmonious"})[0] == 303
        assert len(log.read().answers) == number
        assert not server.finished.is_set()
    assert "Thank you" in ask(server.address, "GET")[1]
    assert server.finished.wait(10)
    server.stop()


def test_page_sent_twice_changes_nothing(address: str, trials: TrialSet, log: AnswerLog):
    for choice in ("harmonious", "inharmonious"):
        assert ask(address, "POST", {"trial": trials.trials[0].id, "choice": choice})[0] == 303
    assert [answer.choice for answer in log.read().answers] == ["harmonious"]


@pytest.mark.parametrize("path", ["/", "/key.json", "/trials.json", "//", "/../key.json"])
def test_other_addresses_show_nothing_and_write_nothing(address: str, trials: TrialSet, log: AnswerLog, path: str):
    assert ask(address, "GET", path=path) == (404, ask(address, "GET", path="/x")[1])
    assert ask(address, "POST", {"trial": trials.trials[0].id, "choice": "harmonious"}, path=path)[0] == 404
    assert log.read().answers == ()


def test_hostile_forms_are_refused(address: str, trials: TrialSet, log: AnswerLog):
    assert ask(address, "POST", "x" * (StudyServer.most_bytes + 1))[0] == 400
    status, page = ask(address, "POST", {"trial": trials.trials[0].id, "choice": "<script>alert(1)"})
    assert (status, "<script>alert" in page, log.read().answers) == (400, False, ())


def test_damaged_answer_file_is_said_on_the_page_and_answer_asked_again(address: str, trials: TrialSet, log: AnswerLog):
    form = {"trial": trials.trials[0].id, "choice": "harmonious"}
    log.path.write_text("<no answers>\n")
    status, page = ask(address, "GET")
    assert (status, "<no answers>" in page) == (500, False)
    assert "line 1 is not an answer: b'<no answers>'" in html.unescape(page)
    status, page = ask(address, "POST", form)
    assert status == 400 and "The answer was not saved" in page
    log.path.unlink()
    assert "Trial 1 of 4" in ask(address, "GET")[1]
    assert ask(address, "POST", form)[0] == 303
    assert len(log.read().answers) == 1


def test_rater_who_closes_the_page_of_thanks_before_it_has_come_is_finished(
    trials: TrialSet, log: AnswerLog, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def closed(handler: BaseHTTPRequestHandler) -> None:
        raise ConnectionResetError

    for trial in trials.trials:
        log.record(trials, trial.id, "harmonious")
    monkeypatch.setattr(BaseHTTPRequestHandler, "end_headers", closed)
    server = StudyServer(trials, log, shown)
    with server.running() as address:
        with pytest.raises(http.client.RemoteDisconnected):
            ask(address, "GET")
        assert server.finished.wait(10)
    assert capfd.readouterr().err == ""


@pytest.mark.browser
def test_a_double_click_answers_one_trial(address: str, trials: TrialSet, log: AnswerLog, chromium: Any):
    page = at_address(chromium, address)
    for number in (2, 3):
        page.wait_for_timeout(700)  # nobody looks at a dance for less
        place = page.locator("button").first.bounding_box()
        for _ in range(2):
            page.mouse.click(place["x"] + 9, place["y"] + 9)
            page.get_by_text(f"Trial {number} of 4").wait_for()
    page.wait_for_timeout(500)
    assert page.inner_text("#count") == "Trial 3 of 4"
    assert [one.trial for one in log.read().answers] == [one.id for one in trials.trials[:2]]
    closed(page)


@pytest.mark.browser
def test_who_goes_back_in_the_browser_finds_no_marks_of_another_trial_in_the_form(log: AnswerLog, chromium: Any):
    trials = make_trials(CLIPS, kind="rate", n=4, seed=1, rater="Ada")
    with StudyServer(trials, log, shown).running() as address:
        page = at_address(chromium, address)
        for mark, name in enumerate(MARKED):
            page.select_option(f"#{name}", str(mark))
        page.click("text=Save")
        page.get_by_text("Trial 2 of 4").wait_for()
        page.go_back()
        assert page.inner_text("#count") == "Trial 2 of 4"
        assert [page.input_value(f"#{name}") for name in MARKED] == [""] * 4
        with page.expect_navigation():  # Safari shows the page that was left, as it was
            page.evaluate("dispatchEvent(new PageTransitionEvent('pageshow', { persisted: true }))")
        closed(page)
    assert [(one.trial, one.choice) for one in log.read().answers] == [(trials.trials[0].id, "0 1 2 3")]


# The page on which a song is tapped

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
    assert status == 200 and "&lt;song&gt; &amp; co" in page
    assert "http" not in page.replace(server.address, "")
    with urlopen(f"{server.address}sound.wav", timeout=10) as reply:
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
    assert status == 400 and fault in text
    assert (saved, server.finished.is_set()) == ([], False)


def test_a_body_that_is_announced_too_long_is_refused_unread(server: TapServer, saved: Saved):
    announced = {"Content-Length": str(TapServer.most_bytes + 1)}
    assert ask(server.address, "POST", headers=announced) == (400, "at most 1048576 bytes are taken")
    assert saved == []


@pytest.mark.parametrize("path", ["/", "/sound.wav", "//", "/x/sound.wav"])
def test_other_addresses_hold_nothing(server: TapServer, saved: Saved, path: str):
    assert ask(server.address, "GET", path=path)[0] == 404
    assert ask(server.address, "POST", json.dumps({"taps": [1], "ones": []}), path=path)[0] == 404
    assert ask(server.address, "GET", path=f"{server.path}other")[0] == 404
    assert ask(server.address, "POST", "{}", path=f"{server.path}sound.wav")[0] == 404
    assert saved == []


# Taps of a person

NOTHING = np.zeros(0)


def sloppy(beats: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Taps with a jitter of 25 ms, one in eight missed, some double."""
    taps = beats + rng.normal(0, 0.025, beats.size)
    taps = taps[rng.random(beats.size) > 1 / 8]
    return np.sort(np.concatenate([taps, taps[::7] + 0.07]))


@pytest.mark.parametrize("tempo", [62.0, 118.3, 190.0])
def test_sloppy_taps_give_their_tempo_and_phase(tempo: float, rng: np.random.Generator):
    beats = 3.21 + 60 / tempo * np.arange(40)
    grid = tap_grid(sloppy(beats, rng))
    assert 60 / grid.period == pytest.approx(tempo, rel=0.005)
    assert np.abs(grid.deviations(beats)).max() < 0.03


def test_a_pause_of_half_a_minute_between_taps_does_no_harm(rng: np.random.Generator):
    beats = 0.4 + 0.5 * np.concatenate([np.arange(20), np.arange(80, 100)])
    assert tap_grid(beats + rng.normal(0, 0.02, beats.size)).period == pytest.approx(0.5, abs=2e-4)


def test_a_key_that_counts_every_tap_twice_does_no_harm(rng: np.random.Generator):
    taps = 0.4 + 0.5 * np.arange(30) + rng.normal(0, 0.02, 30)
    for delay in (1e-9, 0.03, 0.1):
        assert tap_grid(np.concatenate([taps, taps + delay])).period == pytest.approx(0.5, abs=2e-3)


@cases(
    "taps, fault",
    (np.arange(7) * 0.5, "7 taps are too few; tap 8 beats or more"),
    (np.ones(20), "1 taps are too few"),
    (np.cumsum([0.3, 0.9, 0.5, 1.4, 0.35, 0.8, 1.1, 0.45, 0.6, 1.3, 0.7, 0.4]), "keep no steady tempo"),
)
def test_taps_that_keep_no_tempo_are_refused(taps: np.ndarray, fault: str):
    refused(fault, tap_grid, taps)


def test_taps_to_a_part_become_beats_of_the_song_there(click_track: Callable[..., Audio], rng: np.random.Generator):
    # Clicks of 113 a minute for a minute, tapped for ten seconds, 40 ms late; silence at both ends has no beats.
    clicks = click_track(113, seconds=60.0).samples
    audio = Audio(np.concatenate([np.zeros(22050), clicks, np.zeros(3 * 22050)]), 22050)
    beats = 1.0 + 60 / 113 * np.arange(113)
    ones = 1.04 + 60 / 113 * np.array([33, 36, 114, 117])  # the last two after the last sound
    result = tapped_beats(audio, sloppy(beats[30:50], rng) + 0.04, ones, meter=3)
    np.testing.assert_allclose(result.track.times, beats, atol=0.02, rtol=0)
    assert result.track.bar_places.tolist() == (np.arange(113) % 3).tolist()
    assert (result.track.quality, result.remark) == (None, "")


def test_taps_between_the_beats_of_the_sound_stay_there_and_it_is_said(click_track: Callable[..., Audio]):
    result = tapped_beats(click_track(120, seconds=30.0), 5.2 + 0.5 * np.arange(20), NOTHING)
    assert np.median(np.mod(result.track.times, 0.5)) == pytest.approx(0.2, abs=0.02)
    assert "ms after the sound's own beats and were left there" in result.remark
    assert result.track.bar_places is None


def test_where_no_grid_is_heard_the_taps_alone_count_and_it_is_said(rng: np.random.Generator):
    result = tapped_beats(Audio(0.1 * rng.normal(size=30 * 22050), 22050), 5.2 + 0.61 * np.arange(20), NOTHING)
    np.testing.assert_allclose(result.track.times, np.arange(0.32, 30.0, 0.61), atol=0.01)
    assert "far from your taps the beats may drift" in result.remark


@pytest.mark.parametrize("late", [0.02, 0.2])
def test_taps_to_a_part_of_a_song_that_becomes_faster_follow_its_sound(click_track: Callable[..., Audio], late: float):
    # A line through the taps would be two beats off in the end.
    slow, fast = (click_track(tempo, seconds=20.0).samples for tempo in (120, 126))
    beats = np.concatenate([0.5 * np.arange(40), 20.0 + 60 / 126 * np.arange(42)])
    result = tapped_beats(Audio(np.concatenate([slow, fast]), 22050), beats[10:34] + late, beats[[12, 16]] + late)
    expected = beats if late < 0.06 else beats + late
    away = np.abs(result.track.times[:, None] - expected).min(axis=1)
    assert np.median(away) < 0.02 and away.max() < 0.06 and len(result.track) >= 80
    assert result.track.bar_places[np.abs(result.track.times - expected[60]).argmin()] == 0
    assert result.remark == "The tempo of this song moves: the beats follow its sound."


def test_ones_that_disagree_are_outvoted_and_it_is_said(click_track: Callable[..., Audio]):
    beats = 0.5 * np.arange(8, 40)
    result = tapped_beats(click_track(120, seconds=30.0), beats, beats[[2, 6, 10, 15]], meter=4)
    assert result.track.bar_places[np.abs(result.track.times - beats[2]).argmin()] == 0
    assert '3 of 4 "ones" agree on where a bar of 4 beats begins.' in result.remark


@cases(
    "taps, ones, meter, fault",
    ([1.0, 99.0], [], 4, "taps must lie in the song, between 0 and 10.0 s"),
    ([1.0, float("nan")], [], 4, "taps must lie in the song"),
    ([1.0], [-1.0], 4, "ones must lie in the song"),
    ([0.5] * 20_001, [], 4, "20001 taps are more than 20000"),
    ([1.0], [], 0, "a bar has 1 to 32 beats, got 0"),
    ([[1.0]], [], 4, "taps must have shape"),
)
def test_impossible_taps_are_refused(click_track: Callable[..., Audio], taps: list, ones: list, meter: int, fault: str):
    refused(fault, tapped_beats, click_track(120), np.array(taps), np.array(ones), meter=meter)


def test_clicks_lie_on_the_beats_and_are_higher_on_one():
    silent = Audio(np.zeros(22050), 22050)
    samples = with_clicks(silent, track([0.25, 0.5, 0.99], duration=1.0, bar_places=[0, 1, 0])).samples
    sounding = np.flatnonzero(np.abs(samples) > 1e-3)
    assert np.abs(sounding[0] / 22050 - 0.25) < 1e-3
    assert not ((sounding > 0.29 * 22050) & (sounding < 0.5 * 22050)).any()
    crossings = [np.count_nonzero(np.diff(np.sign(samples[start : start + 600]))) for start in (5513, 11025)]
    assert crossings[0] > 1.4 * crossings[1]
    np.testing.assert_array_equal(silent.samples, 0)
