"""A rater answers on a local page, or in its frame in a notebook; each answer is on disk before the next trial."""

import html
import http.client
import re
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from urllib.parse import urlencode, urlsplit

import pytest
from jupyter_client.manager import start_new_kernel

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.listening.trials import Item, Trial, TrialSet, make_trials

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]


@pytest.fixture
def trials() -> TrialSet:
    return make_trials(CLIPS, kind="pick", n=4, seed=1, rater="Ada")


@pytest.fixture
def log(tmp_path: Path) -> AnswerLog:
    return AnswerLog(tmp_path / "answers.jsonl")


def shown(trial: Trial) -> str:
    return f"<b>{trial.id}</b>"


def framed_page(server: StudyServer) -> str:
    """The page in the frame that a notebook shows."""
    return html.unescape(re.search(r' srcdoc="([^"]*)"', server._repr_html_())[1])


def test_notebook_frames_the_trial_and_its_buttons_send_answers_to_the_server(trials: TrialSet, log: AnswerLog):
    server = StudyServer(trials, log, shown).start()
    for number, trial in enumerate(trials.trials, 1):
        page = framed_page(server)
        assert f"Trial {number} of 4" in page
        assert html.escape(f"<b>{trial.id}</b>") in page
        assert re.findall(r'name="choice" value="(\w+)"', page) == list(trials.choices)
        action = re.search(r'<form method="post" action="([^"]*)"', page)[1]
        assert ask(action, "POST", {"trial": trial.id, "choice": "harmonious"})[0] == 303
        assert len(log.read().answers) == number
    assert "Thank you" in framed_page(server)
    server.stop()


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
    assert ask(address, "POST", "x" * (StudyServer.most_bytes + 1))[0] == 400
    status, page = ask(address, "POST", {"trial": trials.trials[0].id, "choice": "<script>alert(1)"})
    assert status == 400
    assert "<script>alert" not in page
    assert log.read().answers == ()


def test_damaged_answer_file_is_said_on_the_page(address: str, log: AnswerLog):
    log.path.write_text("<no answers>\n")
    status, page = ask(address, "GET")
    assert status == 500
    assert "<no answers>" not in page
    assert "line 1 is not an answer: b'<no answers>'" in html.unescape(page)


def test_answer_that_cannot_be_written_is_said_and_asked_again(address: str, trials: TrialSet, log: AnswerLog):
    form = {"trial": trials.trials[0].id, "choice": "harmonious"}
    log.path.write_text("<no answers>\n")
    status, page = ask(address, "POST", form)
    assert status == 400
    assert "The answer was not saved" in page
    log.path.unlink()
    assert "Trial 1 of 4" in ask(address, "GET")[1]
    assert ask(address, "POST", form)[0] == 303
    assert len(log.read().answers) == 1


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


PRESENT = """
from pathlib import Path
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.listening.trials import Item, make_trials
clips = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]
trials = make_trials(clips, kind="pick", n=4, seed=1, rater="Ada")
server = StudyServer(trials, AnswerLog("answers.jsonl"), lambda trial: trial.id).start()
Path("address").write_text(server.address)
server
"""


@pytest.mark.slow  # processes
def test_killed_kernel_loses_no_answer_and_the_notebook_goes_on_where_it_was(
    tmp_path: Path, trials: TrialSet, log: AnswerLog
):
    manager, client = start_new_kernel(cwd=str(tmp_path))
    try:
        client.execute(PRESENT, reply=True, timeout=60)
        address = (tmp_path / "address").read_text()
        for trial, choice in zip(trials.trials, trials.choices, strict=False):
            assert ask(address, "POST", {"trial": trial.id, "choice": choice})[0] == 303
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
    with StudyServer(trials, log, shown).running() as address:
        assert html.escape(f"<b>{trials.trials[2].id}</b>") in ask(address, "GET")[1]
