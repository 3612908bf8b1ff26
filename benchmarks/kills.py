"""Commands that are killed and go on: `python -m benchmarks.kills --times 50 --seed 1 [--only evaluate,train]`.

Each command runs once in peace. Then it is killed (-9, with all its processes) at random moments, called again as a
person would, killed again, and at last left to finish: what it leaves must be what the first one left. Any other
command that goes on where it stopped can be tried, one that writes to `{out}`:

    python -m benchmarks.kills --command "data synth {out} --clips 20"

Exit code 1 where a result differs or a run fails.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import os
import shlex
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from harmolab.cli import app
from harmolab.data.synthetic import write_corpus
from harmolab.lab.evaluate import parts
from harmolab.lab.listening.answers import (
    TRIALS_FILE,
    SimulatedRater,
    answer_files,
    answer_log,
    merge,
    read_key,
    read_trials,
)
from harmolab.systems.harmogan.train import train_harmogan
from harmolab.systems.training.checkpoints import TrainOptions
from tests.tiny_training import LONGER, MODEL, PATTERNS, tiny_split

MOST_KILLS = 4  # of one run, before it is left to finish
LEFTOVERS = (".tmp", ".lock")  # endings of files that may stay


@dataclass(frozen=True)
class Job:
    """A command to be killed.

    Parameters
    ----------
    name : str
    run : function(folder), run in a process of its own; called again in the same folder after a kill
    result : function(folder), all that counts of what it leaves, by name
    """

    name: str
    run: Callable[[Path], None]
    result: Callable[[Path], Mapping[str, str]]


def said(*words: object) -> str:
    """What a command of harmolab prints; ValueError where it fails."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            app([str(word) for word in words], standalone_mode=True)
        except SystemExit as leave:
            if leave.code:
                raise ValueError(f"{words[0]}: {err.getvalue()}") from None
    return out.getvalue()


def files_below(folder: Path) -> dict[str, str]:
    """SHA-256 of every file at or below a folder, but locks and what a killed process left half written."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.endswith(LEFTOVERS)]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def jobs(data: Path) -> list[Job]:
    """The commands by name, on small synthetic data below `data`."""
    corpus = write_corpus(data / "corpus", clips=6, seconds=8.0, fps=30.0)

    def compare(folder: Path) -> None:
        os.environ["HARMOLAB_CACHE"] = str(folder / "cache")  # a kill may come while beats are kept
        parts.FLUSH_SECONDS = 0.0  # every row counts, so that there is something to go on with
        rows = ("--out", folder / "rows", "--resume", "--jobs", 2)
        text = said("compare", corpus, "--beats", "tracked", "--rotations", 20, *rows, "--json")
        (folder / "compare.json").write_text(text)

    def evaluate(folder: Path) -> None:
        parts.FLUSH_SECONDS = 0.0
        options = ("--resamples", 100, "--jobs", 2, "--resume", "--out", folder / "table")
        said("evaluate", corpus, "--music", corpus, "--reference", corpus, *options)

    def train(folder: Path) -> None:
        torch.set_num_threads(1)
        options = TrainOptions(folder / "run", resume=True, accelerator="cpu")
        train_harmogan(tiny_split(sketched=True), options, model=MODEL, params=LONGER, patterns=PATTERNS)

    def study(folder: Path) -> None:
        if not (folder / "study" / TRIALS_FILE).exists():
            said("study", "make", corpus, folder / "study", "--n", 6, "--seconds", 4)
        _answer(folder / "study")
        said("study", "analyse", folder / "study", "--out", folder / "analysis")

    return [
        Job("compare", compare, lambda folder: {"compare.json": (folder / "compare.json").read_text()}),
        Job("evaluate", evaluate, lambda folder: files_below(folder / "table")),
        Job("train", train, lambda folder: _weights(folder / "run")),
        Job("study", study, _study),
    ]


def _answer(study: Path) -> None:
    """Answers of three simulated raters, each of which goes on after the last answer it gave."""
    trials, key = read_trials(study / "trials.json"), read_key(study / "key.json")
    for seed in range(3):
        rater = SimulatedRater(0.8, seed)
        own, log = trials.ordered_for(rater.name), answer_log(study, rater.name)
        waiting = {trial.id for trial in log.resume(own)}
        for answer in rater.answers(own, key):
            if answer.trial in waiting:
                log.append(answer)


def _study(folder: Path) -> dict[str, str]:
    """Files of study and analysis, and the answers without the moments at which they were given."""
    answers = merge(answer_files(folder / "study")).answers
    given = sorted((answer.rater, answer.trial, answer.choice) for answer in answers)
    made = {name: digest for name, digest in files_below(folder).items() if "/answers/" not in name}
    return made | {"answers": json.dumps(given)}


def _weights(run: Path) -> dict[str, str]:
    """The tensors of a training and its history without times; a description holds the moment it was written at."""
    rows = [line.split(",") for line in (run / "history.csv").read_text().splitlines()]
    kept = [place for place, name in enumerate(rows[0]) if "second" not in name]
    history = json.dumps([[row[place] for place in kept] for row in rows])
    tensors = {name: digest for name, digest in files_below(run).items() if name.endswith(".safetensors")}
    return {name: digest for name, digest in tensors.items() if not name.startswith("state")} | {"history": history}


def named_job(words: Sequence[str]) -> Job:
    """A command of harmolab that writes to {out}, told by its words."""

    def run(folder: Path) -> None:
        said(*(word.replace("{out}", str(folder / "out")) for word in words))

    return Job(words[0], run, lambda folder: files_below(folder / "out"))


def started(job: Job, folder: Path) -> int:
    """Number of a process, in a group of its own, that runs the job; it is forked, so that torch is there already."""
    folder.mkdir(parents=True, exist_ok=True)
    if child := os.fork():
        os.setpgid(child, child)  # here too: the kill may come before the child has done it
        return child
    os.setpgid(0, 0)
    try:
        job.run(folder)
    except BaseException as error:  # noqa: BLE001  # the parent is told by a file, whatever it was
        (folder / "failed.txt").write_text(f"{type(error).__name__}: {error}")
        os._exit(1)
    os._exit(0)


def finished(child: int, *, wait: float) -> bool:
    """True once the process has ended, False if it still runs after `wait` seconds; ValueError where it failed."""
    until = time.monotonic() + wait
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            if os.waitstatus_to_exitcode(status):
                raise ValueError(f"exit {os.waitstatus_to_exitcode(status)}")
            return True
        if time.monotonic() >= until:
            return False
        time.sleep(0.002)


def run_with_kills(job: Job, folder: Path, rng: np.random.Generator, *, kills: int, seconds: float) -> int:
    """Number of kills, at most so many, that came before a run ended; a run takes about so many seconds."""
    for number in range(kills):
        child = started(job, folder)
        if finished(child, wait=float(rng.uniform(0, seconds))):
            return number
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
    finished(started(job, folder), wait=float("inf"))
    return kills


def killed(job: Job, folder: Path, *, times: int, seed: int) -> list[str]:
    """Lines about what differed or failed in the runs below `folder` of a job that was killed so many times."""
    rng = np.random.default_rng(seed)
    begin = time.monotonic()
    finished(started(job, folder / "peace"), wait=float("inf"))
    seconds = time.monotonic() - begin
    expected = job.result(folder / "peace")
    faults: list[str] = []
    runs = kills = 0
    while kills < times:
        place = folder / f"run_{runs}"
        runs += 1
        most = min(int(rng.integers(1, MOST_KILLS + 1)), times - kills)
        try:
            kills += run_with_kills(job, place, rng, kills=most, seconds=seconds)
            faults += differences(expected, job.result(place), place.name)
        except (ValueError, OSError) as error:
            failed = place / "failed.txt"
            faults.append(f"{place.name}: {failed.read_text() if failed.exists() else error}")
            kills += most
    print(f"{job.name}: {kills} kills in {runs} runs of {seconds:.1f} s, {len(faults)} faults", flush=True)
    return [f"{job.name}: {fault}" for fault in faults]


def differences(expected: Mapping[str, str], result: Mapping[str, str], run: str) -> list[str]:
    """A line for each name whose content is not that of the undisturbed run."""
    names = sorted(expected.keys() | result.keys())
    return [f"{run}: {name} differs" for name in names if expected.get(name) != result.get(name)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kills", description=__doc__)
    parser.add_argument("--times", type=int, default=50, help="kills of each command")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="compare, evaluate, train, study, with commas")
    parser.add_argument("--command", help="another command of harmolab, which writes to {out}")
    options = parser.parse_args(arguments)
    named = set(filter(None, options.only.split(",")))
    with tempfile.TemporaryDirectory(prefix="kills_") as name:
        chosen = [named_job(shlex.split(options.command))] if options.command else jobs(Path(name))
        faults = [
            fault
            for job in chosen
            if not named or job.name in named
            for fault in killed(job, Path(name) / job.name, times=options.times, seed=options.seed)
        ]
    print("\n".join(faults) or "nothing was lost")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
