"""Trainings in processes of their own: killed at any moment, or shared by two under torchrun, they end the same."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from harmolab.systems.training.loop import Batching, check_shards
from tests.builders import refused
from tests.tiny_training import CASES, main

SCRIPT = Path(__file__).with_name("tiny_training.py")


def python(*arguments: object) -> str:
    """What a Python of its own prints, one thread a process; fails with its errors."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout


@pytest.mark.slow
def test_a_run_killed_five_times_at_random_moments_ends_as_if_undisturbed(tmp_path: Path):
    moments = json.loads(python(SCRIPT, tmp_path, "--kills", 5).splitlines()[-1])
    assert len(moments) == 5
    assert "settings.json" in moments[0][1] and "pose_net.json" not in moments[0][1]
    for run in {f"run{number}" for number, _ in moments}:
        for name in ("model.safetensors", "pretrained.safetensors", "pose_net.safetensors", "history.csv"):
            assert (tmp_path / run / name).read_bytes() == (tmp_path / "undisturbed" / name).read_bytes(), (run, name)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every case in a folder "one", by this process, and in "two", by two that torchrun started."""
    folder = tmp_path_factory.mktemp("shared")
    main(folder / "one", [*CASES])
    python("-m", "torch.distributed.run", "--standalone", "--nproc-per-node", 2, SCRIPT, folder / "two", *CASES)
    return folder


def history(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "history.csv").read_text().splitlines()))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_two_processes_have_the_history_of_one(case: str, shared: Path):
    # Batches of 5 units and 3 do not share evenly between two.
    one, two = history(shared / "one" / case), history(shared / "two" / case)
    assert [list(row) for row in one] == [list(row) for row in two] and len(one) == 4
    for alone, together in zip(one, two, strict=True):
        for name, value in alone.items():
            if value and name != "phase":
                assert float(together[name]) == pytest.approx(float(value), rel=1e-4, abs=1e-4), (alone["epoch"], name)


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES][1:])
def test_with_the_same_shards_two_processes_do_the_same_to_the_last_bit(case: str, shared: Path):
    for name in ("history.csv", "model.safetensors"):
        assert (shared / "one" / case / name).read_bytes() == (shared / "two" / case / name).read_bytes(), name


@pytest.mark.slow
def test_only_the_first_process_writes_events(shared: Path):
    for case in CASES:
        assert len(list((shared / "two" / case).glob("events.out.tfevents.*"))) == 1


def test_a_batch_that_cannot_be_shared_is_refused():
    check_shards(11, Batching(10), 5)  # batches of six and five
    refused("batches of 5 units cannot be cut into 6 shards; 5 at most", check_shards, 11, Batching(10), 6)
    refused("3 shards cannot be spread evenly over 2 processes", check_shards, 11, Batching(10, shards=3), 2)
