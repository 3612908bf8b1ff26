"""A rater answers in the notebook or on a local page; each answer is on disk before the next trial shows."""

from __future__ import annotations

import html
import http.client
import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlencode, urlsplit

import pytest
from jupyter_client.manager import start_new_kernel

from harmolab.listening.answers import AnswerLog
from harmolab.listening.presenting import MOST_BYTES, StudyServer
from harmolab.listening.trials import Item, Trial, TrialSet, make_trials
from harmolab.types import Audio, Clip
from harmolab.widgets.player import BlindPlayer
from harmolab.widgets.trials import TrialPresenter, player_trial

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]


@pytest.fixture
def trials() -> TrialSet:
    return make_trials(CLIPS, kind="pick", n=4, seed=1, rater="Ada")


@pytest.fixture
def log(tmp_path: Path) -> AnswerLog:
    return AnswerLog(tmp_path / "answers.jsonl")


def shown(trial: Trial) -> str:
    return f"<b>{trial.id}</b>"


def buttons(presenter: TrialPresenter) -> list[object]:
    return list(presenter.children[2].children)


def test_every_click_is_written_before_the_next_trial_shows(trials: TrialSet, log: AnswerLog):
    presenter = TrialPresenter(trials, log, shown)
    for number, trial in enumerate(trials.trials):
        assert presenter.trial == trial
        buttons(presenter)[number % 2].click()
        assert len(log.read().answers) == number + 1
    assert [answer.choice for answer in log.read().answers] == ["harmonious", "inharmonious"] * 2
    assert all(answer.seconds is not None and answer.seconds < 60 for answer in log.read().answers)


def test_presenter_starts_at_the_first_trial_without_an_answer_and_ends_with_thanks(trials: TrialSet, log: AnswerLog):
    for trial in trials.trials[:3]:
        log.record(trials, trial.id, "harmonious")
    presenter = TrialPresenter(trials, log, shown)
    assert presenter.trial == trials.trials[3]
    assert "Trial 4 of 4" in presenter.children[0].value
    presenter.answer("harmonious")
    assert "Thank you" in presenter.children[0].value
    assert all(button.disabled for button in buttons(presenter))
    with pytest.raises(ValueError, match="all trials are answered"):
        presenter.answer("harmonious")


def test_answer_that_cannot_be_written_is_said_and_asked_again(trials: TrialSet, log: AnswerLog):
    presenter = TrialPresenter(trials, log, shown)
    log.path.write_text("<no answers>\n")
    buttons(presenter)[0].click()
    assert "line 1 is not an answer: b'<no answers>'" in presenter.error
    assert presenter.trial == trials.trials[0]
    assert not buttons(presenter)[0].disabled
    log.path.unlink()
    buttons(presenter)[0].click()
    assert presenter.error == ""
    assert presenter.trial == trials.trials[1]


def test_report_shows_the_trial_and_buttons_that_do_nothing(trials: TrialSet, log: AnswerLog):
    presenter = TrialPresenter(trials, log, shown)
    bundle = presenter._repr_mimebundle_()
    assert f"<b>{trials.trials[0].id}</b>" in bundle["text/html"]
    assert re.findall(r"<button disabled[^>]*>(\w+)</button>", bundle["text/html"]) == list(trials.choices)
    assert "application/vnd.jupyter.widget-view+json" in bundle


@pytest.fixture
def address(trials: TrialSet, log: AnswerLog) -> Iterator[str]:
    with StudyServer(trials, log, shown).running() as address:
        yield address


def ask(address: str, method: str, form: object = None, *, path: str | None = None) -> tuple[int, str]:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=10)
    try:
        body = urlencode(form) if isinstance(form, dict) else form
        connection.request(method, path or parts.path, body)
        reply = connection.getresponse()
        return reply.status, reply.read().decode()
    finally:
        connection.close()


def test_page_asks_every_trial_and_saves_every_answer(address: str, trials: TrialSet, log: AnswerLog):
    assert urlsplit(address).hostname == "127.0.0.1"
    for number, trial in enumerate(trials.trials, 1):
        status, page = ask(address, "GET")
        assert status == 200
        assert f"Trial {number} of 4" in page
        assert f'name="trial" value="{trial.id}"' in page
        assert ask(address, "POST", {"trial": trial.id, "choice": "harmonious"})[0] == 303
        assert len(log.read().answers) == number
    assert "Thank you" in ask(address, "GET")[1]


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
    assert ask(address, "POST", "x" * (MOST_BYTES + 1))[0] == 400
    status, page = ask(address, "POST", {"trial": trials.trials[0].id, "choice": "<script>"})
    assert status == 400
    assert "<script>" not in page
    assert log.read().answers == ()


def test_damaged_answer_file_is_said_on_the_page(address: str, log: AnswerLog):
    log.path.write_text("<no answers>\n")
    status, page = ask(address, "GET")
    assert status == 500
    assert "line 1 is not an answer: b&#x27;&lt;no answers&gt;&#x27;" in page


def test_server_is_finished_when_thanks_were_sent_and_not_before(trials: TrialSet, log: AnswerLog):
    server = StudyServer(trials, log, shown)
    assert isinstance(server.finished, threading.Event)
    with server.running() as address:
        for trial in trials.trials:
            ask(address, "GET")
            assert not server.finished.is_set()
            ask(address, "POST", {"trial": trial.id, "choice": "harmonious"})
        assert not server.finished.is_set()
        assert "Thank you" in ask(address, "GET")[1]
        assert server.finished.wait(10)


def test_trial_is_a_blind_player_of_one_dancer_or_two_to_one_music(planted_clip: Clip):
    assert planted_clip.motion is not None
    for count in (1, 2):
        page = html.unescape(re.search(r' srcdoc="([^"]*)"', player_trial(*[planted_clip] * count))[1])
        assert page.count("<canvas") == count
        assert planted_clip.name not in page
        # The sound's coding holds a random serial number.
        wanted = BlindPlayer(planted_clip.audio, [planted_clip.motion] * count).page
        sound = re.compile(r'"ogg": "[^"]*"')
        assert sound.sub("", page) == sound.sub("", wanted)


def test_clips_that_cannot_be_one_trial_are_refused(planted_clip: Clip):
    with pytest.raises(ValueError, match="has no motion to show"):
        player_trial(replace(planted_clip, motion=None))
    with pytest.raises(ValueError, match=r"its motion starts 0\.5 s into the music"):
        player_trial(replace(planted_clip, offset=0.5))
    quiet = Audio(0.5 * planted_clip.audio.samples, planted_clip.audio.sample_rate)
    with pytest.raises(ValueError, match="have two pieces of music"):
        player_trial(planted_clip, replace(planted_clip, audio=quiet))


PRESENT = """
from harmolab.listening.answers import AnswerLog
from harmolab.listening.trials import Item, make_trials
from harmolab.widgets.trials import TrialPresenter
clips = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]
trials = make_trials(clips, kind="pick", n=4, seed=1, rater="Ada")
presenter = TrialPresenter(trials, AnswerLog("answers.jsonl"), lambda trial: trial.id)
presenter
"""


def test_killed_kernel_loses_no_answer_and_the_notebook_goes_on_where_it_was(
    tmp_path: Path, trials: TrialSet, log: AnswerLog
):
    manager, client = start_new_kernel(cwd=str(tmp_path))
    try:
        client.execute(PRESENT, reply=True, timeout=60)
        client.execute("presenter.answer('harmonious'); presenter.answer('inharmonious')", reply=True, timeout=60)
        client.stop_channels()
        manager.shutdown_kernel(now=True)  # SIGKILL
    finally:
        client.stop_channels()
        if manager.is_alive():
            manager.shutdown_kernel(now=True)
    assert [(answer.trial, answer.choice) for answer in log.read().answers] == [
        (trials.trials[0].id, "harmonious"),
        (trials.trials[1].id, "inharmonious"),
    ]
    assert TrialPresenter(trials, log, shown).trial == trials.trials[2]
