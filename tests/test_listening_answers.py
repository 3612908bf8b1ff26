"""Answers survive a killed program, and the files of several raters become one."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from harmolab.lab.listening.answers import Answer, AnswerLog, Answers, merge
from harmolab.lab.listening.trials import Item, TrialSet, make_trials
from tests.builders import cases, refused

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(40)]
ANSWER = Answer("0" * 12, "Ada", "1" * 12, "harmonious", 1.5, "2026-01-01T00:00:00+00:00")

# Answers trial after trial until it is killed; says on its output what is surely written.
RATER = """
import sys
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import Item, make_trials
clips = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(40)]
trials = make_trials(clips, kind="pick", n=40, seed=1, rater="Ada")
log = AnswerLog(sys.argv[1])
for trial in log.resume(trials):
    log.record(trials, trial.id, "harmonious")
    print(trial.id, flush=True)
    if sys.argv[2] == "wait":
        sys.stdin.readline()
"""


def trials_of(rater: str, seed: int = 1) -> TrialSet:
    return make_trials(CLIPS, kind="pick", n=40, seed=seed, rater=rater)


def start(path: Path, how: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", RATER, str(path), how]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def kill(process: subprocess.Popen[str]) -> list[str]:
    """What the process had said before it was killed."""
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait(timeout=30) == -signal.SIGKILL
    assert process.stdin is not None
    assert process.stdout is not None
    with process.stdin, process.stdout:  # communicate() would lose what readline() has read ahead
        return process.stdout.read().split()


def test_kill_between_answers_loses_nothing_and_the_study_goes_on_where_it_was(tmp_path: Path):
    path = tmp_path / "answers.jsonl"
    rater = start(path, "wait")
    assert rater.stdin is not None
    assert rater.stdout is not None
    said = [rater.stdout.readline().strip()]
    for _ in range(2):
        rater.stdin.write("\n")
        rater.stdin.flush()
        said.append(rater.stdout.readline().strip())
    kill(rater)
    trials, log = trials_of("Ada"), AnswerLog(path)
    assert [answer.trial for answer in log.read().answers] == said == [trial.id for trial in trials.trials[:3]]
    assert log.resume(trials) == trials.trials[3:]
    assert log.read().notes == ()


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.007, 0.013])
def test_kill_while_answering_keeps_every_answer_that_was_confirmed(tmp_path: Path, delay: float):
    path = tmp_path / "answers.jsonl"
    rater = start(path, "run")
    assert rater.stdout is not None
    first = rater.stdout.readline().strip()
    time.sleep(delay)
    said = [first, *kill(rater)]
    log = AnswerLog(path)
    found = [answer.trial for answer in log.read().answers]
    assert found[: len(said)] == said
    assert len(found) <= len(said) + 1  # written, but killed before it could say so
    log.record(trials_of("Ada"), log.resume(trials_of("Ada"))[0].id, "harmonious")  # the lock is free again
    assert len(log.read().answers) == len(found) + 1


def test_file_cut_anywhere_loses_only_the_line_it_was_cut_in(tmp_path: Path):
    path, cut = tmp_path / "answers.jsonl", tmp_path / "cut.jsonl"
    log = AnswerLog(path)
    answers = [replace(ANSWER, rater="Zoë", trial=f"{n:012x}") for n in range(3)]
    for answer in answers:
        log.append(answer)
    content = path.read_bytes()
    ends = [place + 1 for place, byte in enumerate(content) if byte == 10]
    for length in range(len(content) + 1):
        cut.write_bytes(content[:length])
        whole = sum(length >= end - 1 for end in ends)  # all but its line end is a whole answer too
        found = AnswerLog(cut).read()
        assert found.answers == tuple(answers[:whole])
        assert len(found.notes) == (length not in {0, *ends, *(end - 1 for end in ends)})


def test_answer_after_a_half_line_starts_a_line_of_its_own(tmp_path: Path):
    path = tmp_path / "answers.jsonl"
    log = AnswerLog(path)
    log.append(ANSWER)
    path.write_bytes(path.read_bytes() + path.read_bytes()[:30])
    after = replace(ANSWER, trial="2" * 12)
    log.append(after)
    assert log.read().answers == (ANSWER, after)
    assert log.read().notes == (f"{path}: line 2 was cut off while it was written; left out",)


def test_programs_that_write_at_once_do_not_mix_their_lines(tmp_path: Path):
    path = tmp_path / "answers.jsonl"
    answers = [replace(ANSWER, trial=f"{n:012x}") for n in range(40)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda answer: AnswerLog(path).append(answer), answers))
    assert set(AnswerLog(path).read().answers) == set(answers)


def test_files_of_two_raters_merge(tmp_path: Path):
    logs = [AnswerLog(tmp_path / f"{name}.jsonl") for name in ("ada", "bob")]
    for log, name in zip(logs, ("Ada", "Bob"), strict=True):
        for trial in trials_of(name).trials[:5]:
            log.record(trials_of(name), trial.id, "inharmonious", seconds=2.0)
    merged = merge([log.path for log in logs])
    assert merged.raters == ("Ada", "Bob")
    assert len(merged.answers) == 10
    assert merged.notes == ()
    assert not merged.simulated


def test_of_two_answers_of_a_rater_to_a_trial_the_first_counts_and_the_second_is_reported(tmp_path: Path):
    first, second = tmp_path / "a.jsonl", tmp_path / "b.jsonl"
    AnswerLog(first).append(ANSWER)
    AnswerLog(second).append(replace(ANSWER, choice="inharmonious"))
    merged = merge([first, second])
    assert merged.answers == (ANSWER,)
    assert merged.notes == (f"{second}: line 1: Ada had answered trial 111111111111 before; left out",)


def test_files_of_two_studies_do_not_merge(tmp_path: Path):
    first, second = tmp_path / "a.jsonl", tmp_path / "b.jsonl"
    AnswerLog(first).append(ANSWER)
    AnswerLog(second).append(replace(ANSWER, study="f" * 12))
    refused(r"b\.jsonl: line 1 is of study ffffffffffff, but .*a\.jsonl is of study 0000", merge, [first, second])
    refused("no answer files", merge, [])


def test_log_of_another_study_is_not_gone_on_with(tmp_path: Path):
    log = AnswerLog(tmp_path / "a.jsonl")
    log.append(ANSWER)
    refused("holds answers of study 000000000000", log.resume, trials_of("Ada"))


def test_trial_is_answered_once_and_with_an_answer_of_its_kind(tmp_path: Path):
    log, trials = AnswerLog(tmp_path / "a.jsonl"), trials_of("Ada")
    log.record(trials, trials.trials[0].id, "harmonious")
    refused("not waiting for an answer of Ada", log.record, trials, trials.trials[0].id, "harmonious")
    refused("choice must be one of", log.record, trials, trials.trials[1].id, "left")
    assert len(log.read().answers) == 1


def test_log_that_is_not_there_yet_is_empty_but_its_folder_must_be(tmp_path: Path):
    assert AnswerLog(tmp_path / "a.jsonl").read() == Answers(())
    with pytest.raises(FileNotFoundError, match="create it first"):
        AnswerLog(tmp_path / "none" / "a.jsonl")
    with pytest.raises(FileNotFoundError, match="no such file"):
        merge([tmp_path / "a.jsonl"])


LINE = json.dumps({"study": "0" * 12, "rater": "Ada", "trial": "1" * 12, "choice": "left", "seconds": None, "time": ""})
WHOLE = LINE[:-1] + ', "simulated": false}'


@cases(
    "content, message",
    (b"\x80\x04K\x01.\n", "line 1 is not an answer"),
    (b"hello\n", "line 1 is not an answer"),
    (f"{WHOLE}\n[]\n".encode(), "line 2 must have the fields"),
    (f"{LINE}\n".encode(), "line 1 must have the fields"),
    (WHOLE.replace('"left"', '"up"').encode(), "line 1: choice must be one of"),
    (WHOLE.replace('"left"', "[1]").encode(), "line 1: choice must be text"),
    (WHOLE.replace("null", "NaN").encode(), "line 1: seconds must be zero or more"),
    (WHOLE.replace("null", "-1").encode(), "line 1: seconds must be zero or more"),
    (WHOLE.replace("Ada", "simulated-1").encode(), "line 1: a simulated rater"),
    (WHOLE.replace("false", "true").encode(), "line 1: a simulated rater"),
    (WHOLE.replace("Ada", "").encode(), "line 1: an answer needs a study, a rater and a trial"),
    (b"[" * 100_000, "line 1 is not an answer"),
)
def test_file_that_is_no_answer_file_is_refused_by_name_and_line(tmp_path: Path, content: bytes, message: str):
    path = tmp_path / "a.jsonl"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        merge([path])
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 600
