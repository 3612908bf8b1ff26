"""Damaged files to every reader: `PYTHONPATH=notebooks python -m benchmarks.fuzz --count 100000 [--only motion,sound]`.

Each input is a valid file (`benchmarks.fuzz_targets`) after one to three kinds of damage. It must give finite arrays,
or a ValueError or FileNotFoundError in one line that names the file. Anything else is a finding: another exception, a
death, more than `SECONDS` or `MEGABYTES`. The same seed gives the same inputs, in any order and number.

A finding is kept as a file of its own in `--out`, with the damaged bytes; `--replay FILE` tries it again, with the
whole traceback. Exit code 1 where there are findings.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.fuzz_targets import Target, all_targets
from tests.test_hostile import mutated

SECONDS = 20  # that an input may take; the whole worker is killed after twice that
MEGABYTES = 1500  # that a worker may take beyond what it begins with
FINDINGS = Path("benchmarks") / "findings"
KEPT = 5  # findings of one kind that are kept
NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")
VALUES = [
    b"0",
    b"-1",
    b"1",
    b"1e308",
    b"-1e-308",
    b"1e17",
    b"99999999",
    b"2147483648",
    b"0.5",
    b"NaN",
    b"Infinity",
    b"01",
]


NPY_HEADER = 128  # bytes before the numbers of an array in an archive


class TooLong(BaseException):
    """The time of one input is over; no reader may take it for a fault of its file."""


def damaged(target: Target, seed: int, number: int) -> tuple[str, bytes]:
    """Path and content of the file that input `number` of a target damages."""
    rng = np.random.default_rng([seed, zlib.crc32(target.name.encode()), number])
    path = target.damaged[int(rng.integers(len(target.damaged)))]
    content = target.files[path]
    if path.endswith(".npz") and rng.random() < 0.6:
        return path, with_a_damaged_member(content, rng)
    kind = KINDS[int(rng.integers(len(KINDS)))]
    return path, kind(content, rng) if kind is not crossed else crossed(content, rng, list(target.files.values()))


def with_a_damaged_member(data: bytes, rng: np.random.Generator) -> bytes:
    """An archive packed anew with one array damaged, so that its own check sum is right."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = sorted(members)[int(rng.integers(len(members)))]
    head, values = members[name][:NPY_HEADER], members[name][NPY_HEADER:]
    damage = mutated if rng.random() < 0.5 else gently
    members[name] = head + damage(values, rng) if values and rng.random() < 0.6 else damage(members[name], rng)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for each, content in members.items():
            archive.writestr(zipfile.ZipInfo(each), content)  # the time of day is no part of it
    return packed.getvalue()


def gently(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with one to three bytes changed; text stays text, letter for letter and digit for digit."""
    changed = bytearray(data)
    for place in rng.integers(len(changed), size=int(rng.integers(1, 4))).tolist():
        old = changed[place]
        kin = b"0123456789" if chr(old).isdigit() else bytes(range(32, 127)) if data.isascii() else bytes(range(256))
        changed[place] = kin[int(rng.integers(len(kin)))]
    return bytes(changed)


def with_other_numbers(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with one to three of the numbers that stand in its text replaced."""
    for _ in range(int(rng.integers(1, 4))):
        places = list(NUMBER.finditer(data[:200_000]))
        if not places:
            return mutated(data, rng)
        place = places[int(rng.integers(len(places)))]
        data = data[: place.start()] + VALUES[int(rng.integers(len(VALUES)))] + data[place.end() :]
    return data


def with_a_false_length(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with a whole number of 2, 4 or 8 bytes, anywhere in it, made larger or smaller."""
    size = int(rng.choice([2, 4, 8]))
    place = int(rng.integers(max(1, len(data) - size)))
    order = "little" if rng.random() < 0.5 else "big"
    value = int.from_bytes(data[place : place + size], order)  # type: ignore[arg-type]
    changed = (
        value * int(rng.integers(2, 300)) if rng.random() < 0.5 else value + int(rng.integers(-9, 10))
    ) % 256**size
    return data[:place] + changed.to_bytes(size, order) + data[place + size :]  # type: ignore[arg-type]


def crossed(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """The begin of `data` and the end of another file of the target."""
    other = others[int(rng.integers(len(others)))]
    return data[: int(rng.integers(len(data) + 1))] + other[int(rng.integers(len(other) + 1)) :]


KINDS = (mutated, mutated, gently, gently, with_other_numbers, with_other_numbers, with_a_false_length, crossed)


def tried(target: Target, path: str, content: bytes, folder: Path) -> tuple[str, str]:
    """Outcome and message of one input: "result", "error", or the kind of a finding."""
    for name, data in target.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content if name == path else data)
    target.mend(folder)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        arrays = target.read(folder)
        is_finite = all(np.isfinite(array).all() for array in arrays)
        return ("result", "") if is_finite else ("not finite", "")
    except (ValueError, FileNotFoundError) as error:
        return _judged(str(error), folder)
    except TooLong:
        return "too long", f"more than {SECONDS} s"
    except BaseException as error:  # noqa: BLE001  # whatever it is, it is a finding
        return type(error).__name__, f"{error}: {''.join(traceback.format_tb(error.__traceback__)[-2:])}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for each in folder.iterdir():
            shutil.rmtree(each) if each.is_dir() else each.unlink()


def _judged(message: str, folder: Path) -> tuple[str, str]:
    """An error that is one line with the path of what was read, or a finding."""
    if str(folder) not in message:
        return "no name", message
    if "\n" in message:
        return "several lines", message
    return ("memory" if "more memory than" in message else "error"), message


def _on_alarm(*_: object) -> None:
    raise TooLong


def work(targets: Sequence[Target], seed: int, numbers: range, pipe: int) -> None:
    """What a worker does: the inputs, one line about each into the pipe."""
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    limit = pages * resource.getpagesize() + MEGABYTES * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, _on_alarm)
    warnings.simplefilter("ignore")
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    with tempfile.TemporaryDirectory(prefix="fuzz_") as name, os.fdopen(pipe, "w") as out:
        for number in numbers:
            target = targets[number % len(targets)]
            path, content = damaged(target, seed, number)
            begin = time.monotonic()
            outcome, message = tried(target, path, content, Path(name))
            seconds = time.monotonic() - begin
            out.write(json.dumps([number, outcome, message[:2000], seconds]) + "\n")
            out.flush()


def outcomes(targets: Sequence[Target], seed: int, numbers: range) -> Iterator[tuple[int, str, str, float]]:
    """(number, outcome, message, seconds) of every input, in order; a worker that dies or hangs costs one input."""
    place = numbers.start
    while place < numbers.stop:
        ending = "died"
        for row in _worker_rows(targets, seed, range(place, numbers.stop)):
            if row is None:
                ending = "hang"
                break
            place = row[0] + 1
            yield row
        if place < numbers.stop:
            yield place, ending, "", 0.0
            place += 1


def _worker_rows(targets: Sequence[Target], seed: int, numbers: range) -> Iterator[tuple[int, str, str, float] | None]:
    """The rows of one worker, and None where it was silent for too long; it is gone afterwards."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        work(targets, seed, numbers, writing)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb", buffering=0) as rows:
        rest = b""
        try:
            while True:
                if not select.select([rows], [], [], 2 * SECONDS)[0]:
                    yield None
                    return
                block = rows.read(65_536)
                if not block:
                    return
                *lines, rest = (rest + block).split(b"\n")
                yield from (tuple(json.loads(line)) for line in lines)  # type: ignore[misc]
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def fuzz(targets: Sequence[Target], *, count: int, seed: int, out: Path) -> tuple[dict[str, Counter[str]], list[Path]]:
    """Counts of the outcomes by target, and the files of the findings."""
    counts: dict[str, Counter[str]] = {target.name: Counter() for target in targets}
    kinds: Counter[tuple[str, str]] = Counter()
    kept: list[Path] = []
    for number, outcome, message, _ in tqdm(outcomes(targets, seed, range(count)), total=count, unit="", leave=False):
        target = targets[number % len(targets)]
        counts[target.name][outcome] += 1
        if outcome in ("result", "error"):
            continue
        kinds[target.name, outcome] += 1
        if kinds[target.name, outcome] <= KEPT:
            kept.append(keep(out, target, seed, number, outcome, message))
    return counts, kept


def keep(out: Path, target: Target, seed: int, number: int, outcome: str, message: str) -> Path:
    """The file of a finding, with all that it takes to try it again."""
    path, content = damaged(target, seed, number)
    about = {"target": target.name, "seed": seed, "number": number, "outcome": outcome, "message": message}
    about |= {"file": path, "base64": base64.b64encode(content).decode()}
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{re.sub(r'[^A-Za-z0-9_.]', '_', target.name)}_{seed}_{number}.json"
    file.write_text(json.dumps(about, indent=1))
    return file


def replay(file: Path) -> str:
    """Outcome of a kept finding now, with its traceback."""
    about: dict[str, Any] = json.loads(file.read_text())
    target = next(target for target in all_targets() if target.name == about["target"])
    signal.signal(signal.SIGALRM, _on_alarm)
    with tempfile.TemporaryDirectory(prefix="fuzz_") as name:
        outcome, message = tried(target, about["file"], base64.b64decode(about["base64"]), Path(name))
    return f"{about['target']}: {outcome} now, {about['outcome']} when it was kept\n{message}"


def table(counts: dict[str, Counter[str]]) -> str:
    """A line for each target, and one for all."""
    total = sum(counts.values(), Counter())
    names = ["result", "error", *sorted(total.keys() - {"result", "error"})]
    rows = [[name, *(str(row[each]) for each in names)] for name, row in [*counts.items(), ("all", total)]]
    return "\n".join(f"{row[0]:48}" + "".join(f"{cell:>16}" for cell in row[1:]) for row in [["", *names], *rows])


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="groups or targets, with commas")
    parser.add_argument("--out", type=Path, default=FINDINGS)
    parser.add_argument("--replay", type=Path)
    options = parser.parse_args(arguments)
    if options.replay:
        print(replay(options.replay))
        return 0
    named = set(filter(None, options.only.split(",")))
    targets = [target for target in all_targets() if not named or named & {target.name, target.group}]
    if not targets:
        parser.error(f"--only {options.only}: no such group or target")
    begin = time.monotonic()
    counts, kept = fuzz(targets, count=options.count, seed=options.seed, out=options.out)
    print(table(counts))
    print(f"{options.count} inputs, seed {options.seed}, {len(targets)} targets, {time.monotonic() - begin:.0f} s")
    for file in kept:
        print(f"finding: {file}")
    return 1 if kept else 0


if __name__ == "__main__":
    sys.exit(main())
