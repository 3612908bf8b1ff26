"""The fuzz and kill runners of `benchmarks`: what was planted is found, the same each time, and nothing else."""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from benchmarks import fuzz, kills
from benchmarks.fuzz_targets import Target, all_targets
from tests.builders import refused

VALID = b"1 2 3 4 5 6 7 8 9"


def target(read: Callable[[str], float]) -> Target:
    """A reader of one file, by a function of its text."""

    def arrays(folder: Path) -> list[np.ndarray]:
        return [np.array(read((folder / "a.txt").read_text("latin-1")))]

    return Target("a.txt", "text", {"a.txt": VALID}, ("a.txt",), arrays)


def outcome_of(read: Callable[[str], float], folder: Path) -> str:
    return fuzz.tried(target(read), "a.txt", VALID, folder)[0]


def refuse(message: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        raise ValueError(message)

    return read


def test_an_error_must_name_the_file_in_one_line(tmp_path: Path):
    assert outcome_of(refuse(f"{tmp_path}/a.txt: is no number"), tmp_path) == "error"
    assert outcome_of(refuse("is no number"), tmp_path) == "no name"
    assert outcome_of(refuse(f"{tmp_path}/a.txt: is\nno number"), tmp_path) == "several lines"
    assert outcome_of(refuse(f"{tmp_path}/a.txt: needs more memory than this machine has"), tmp_path) == "memory"


def test_what_is_no_error_of_a_reader_is_called_by_its_name(tmp_path: Path):
    assert outcome_of(lambda text: float(len(text)), tmp_path) == "result"
    assert outcome_of(lambda text: float("nan"), tmp_path) == "not finite"
    assert outcome_of(lambda text: {}[text], tmp_path) == "KeyError"
    assert list(tmp_path.iterdir()) == []


def test_the_same_seed_damages_the_same_bytes():
    one = target(lambda text: 0.0)
    first = [fuzz.damaged(one, 3, number) for number in range(60)]
    assert first == [fuzz.damaged(one, 3, number) for number in range(60)]
    assert first != [fuzz.damaged(one, 4, number) for number in range(60)]
    assert len({content for _, content in first}) > 50


def test_a_death_and_a_hang_cost_one_input_each(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fuzz, "SECONDS", 0.3)

    def read(text: str) -> float:
        if texts[text] == 3:
            os._exit(9)
        if texts[text] == 5:
            time.sleep(60)
        return 0.0

    one = target(read)
    texts = {fuzz.damaged(one, 1, number)[1].decode("latin-1"): number for number in range(8)}
    outcomes = [row[:2] for row in fuzz.outcomes([one], 1, range(8))]
    expected = {3: "died", 5: "too long"}
    assert outcomes == [(number, expected.get(number, "result")) for number in range(8)]


def test_a_finding_is_kept_and_can_be_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    one = target(lambda text: 1 / text.count("1 "))
    counts, kept = fuzz.fuzz([one], count=80, seed=1, out=tmp_path)
    assert counts["a.txt"]["ZeroDivisionError"] >= len(kept) > 0
    monkeypatch.setattr(fuzz, "all_targets", lambda: [one])
    assert fuzz.replay(kept[0]).startswith("a.txt: ZeroDivisionError now, ZeroDivisionError when it was kept")


@pytest.mark.slow
def test_every_target_reads_its_valid_files(tmp_path: Path):
    targets = all_targets()
    assert len({one.name for one in targets}) == len(targets) > 50
    for one in targets:
        path = one.damaged[0]
        assert fuzz.tried(one, path, one.files[path], tmp_path)[0] == "result", one.name


def counting(folder: Path) -> None:
    """Ten lines in a file, each written through; goes on after the last."""
    folder.mkdir(exist_ok=True)
    path = folder / "lines.txt"
    done = len(path.read_text().splitlines()) if path.exists() else 0
    for number in range(done, 10):
        time.sleep(0.02)
        with path.open("a") as file:
            file.write(f"{number}\n")


def forgetful(folder: Path) -> None:
    """The same, that begins anew in the same file."""
    with (folder / "lines.txt").open("a") as file:
        for number in range(10):
            time.sleep(0.02)
            file.write(f"{number}\n")
            file.flush()


@pytest.mark.slow
def test_kills_do_no_harm_to_what_goes_on_and_show_what_does_not(tmp_path: Path):
    assert kills.killed(kills.Job("good", counting, kills.files_below), tmp_path / "good", times=3, seed=1) == []
    faults = kills.killed(kills.Job("bad", forgetful, kills.files_below), tmp_path / "bad", times=3, seed=1)
    assert faults and all(fault.endswith("lines.txt differs") for fault in faults)


def test_a_command_that_goes_on_is_named_by_its_words(tmp_path: Path):
    job = kills.named_job(["data", "synth", "{out}", "--clips", "1", "--seconds", "6"])
    job.run(tmp_path)
    assert json.loads((tmp_path / "out" / "corpus.json").read_text())["clips"] == 1
    assert "clip_0001_cha-cha/motion.npz" in job.result(tmp_path)


def test_a_run_that_fails_is_a_fault(tmp_path: Path):
    job = kills.Job("x", counting, lambda folder: {})
    (tmp_path / "x").mkdir()
    child = kills.started(kills.Job("x", lambda folder: 1 / 0, job.result), tmp_path / "x")  # type: ignore[arg-type]
    refused("exit 1", kills.finished, child, wait=float("inf"))
    assert (tmp_path / "x" / "failed.txt").read_text() == "ZeroDivisionError: division by zero"
