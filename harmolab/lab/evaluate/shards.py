"""An evaluation in shards: each is measured by a run of its own, on any machine, and all are merged into one table.

A dance belongs to a shard by a hash of its name, so a shard needs nothing of the others, and holds its own dances only.
"""

import hashlib
import heapq
import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from harmolab.files import PathLike, Progress, check_output, reading, silent
from harmolab.lab.evaluate import engine, evaluation
from harmolab.lab.evaluate.engine import KEY, adopt_rows, check_alike, check_engine_installed, read_manifest
from harmolab.lab.evaluate.evaluation import MARK, PART_DANCES, ROWS, Evaluation, EvaluationSettings
from harmolab.lab.evaluate.pairing import Pair
from harmolab.lab.evaluate.parts import STAMP, part_paths, part_rows
from harmolab.lab.evaluate.sets import FEATURES

Row = dict[str, Any]


class Shard(NamedTuple):
    """One of several parts of an evaluation, numbered from 1.

    >>> str(Shard.of("2/4"))
    '2/4'
    """

    number: int
    total: int

    @classmethod
    def of(cls, text: str) -> "Shard":
        """The shard that "2/4" names; ValueError for anything else."""
        words = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
        if words is None or not 1 <= int(words[1]) <= int(words[2]):
            raise ValueError(f"--shard must be a number and how many there are, as 1/4 to 4/4, got {text!r}")
        return cls(int(words[1]), int(words[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.total}"

    def holds(self, pair: Pair) -> bool:
        """True for a pair that this shard measures."""
        return int.from_bytes(hashlib.sha256(pair.key.encode()).digest()[:8]) % self.total == self.number - 1


def measure_shard(
    settings: EvaluationSettings,
    out: PathLike,
    shard: Shard,
    *,
    jobs: int | None = 0,
    scheduler: str = "",
    resume: bool = False,
    force: bool = False,
    progress: Progress = silent,
) -> int:
    """Measure the dances of a shard into a folder of its own, for `merge_shards`; returns their number.

    Parameters and errors are those of `evaluate_dances`.
    """
    check_engine_installed(jobs, scheduler)
    out = Path(out)
    plan = evaluation.begun(
        settings, out, resume=resume, force=force, progress=progress, keep=shard.holds, shard=str(shard)
    )  # fmt: skip
    if plan.tasks:
        evaluation.measured_parts(plan, out, jobs=jobs, scheduler=scheduler, resume=resume, progress=progress)
    evaluation.write_mark(out, settings, shard=str(shard), rows=len(plan.tasks))  # it is complete
    return len(plan.tasks)


def merge_shards(
    folders: Sequence[PathLike], out: PathLike, *, force: bool = False, progress: Progress = silent
) -> Evaluation:
    """The evaluation that shards come to, to the last bit that of one run.

    Parameters
    ----------
    folders : of all shards
    out : folder of the table, as in `evaluate_dances`
    force, progress : as there

    Raises
    ------
    FileNotFoundError, ValueError
        A shard is missing, unfinished or of other settings, or the folders of dances have changed; names it.
    """
    out = Path(out)
    check_output(out, folders)
    shards = {Path(folder): evaluation.read_mark(Path(folder)) for folder in folders}
    _check_complete(shards)
    settings = _common_settings(shards)
    evaluation.check_table_folder(out, settings, force=force)
    measured = next(iter(shards.values()))["settings"]
    if not force and (out / ROWS / engine.MANIFEST).is_file() and evaluation.read_mark(out)["settings"] != measured:
        engine.read_rows(out / ROWS)  # an error where it was cut off: no shard holds what it measured
    plan = evaluation.planned(settings, progress=progress)
    manifests = {path: read_manifest(path / ROWS) for path, about in shards.items() if about["rows"]}
    tasks = evaluation.in_order(plan.tasks)
    check_alike(tasks, plan.options.to_dict(), {path / ROWS: about for path, about in manifests.items()})
    deque(_same(tasks, _merged(manifests)), maxlen=0)  # before anything is written
    evaluation.write_mark(out, settings, rows=None)
    counted = progress(_same(tasks, _merged(manifests)), "merged")
    parts = adopt_rows(tasks, counted, out / ROWS, settings=plan.options.to_dict(), part_rows=PART_DANCES)
    return evaluation.finished(settings, plan, parts, out)


def _check_complete(shards: Mapping[Path, Mapping[str, Any]]) -> None:
    """ValueError unless these are all shards of an evaluation, each once and finished."""
    if strange := [path for path, about in shards.items() if "shard" not in about]:
        raise ValueError(f"{strange[0]}: is no shard; measure one by --shard 1/4 and so on")
    numbers = [Shard.of(str(about["shard"])) for about in shards.values()]
    total = numbers[0].total
    if {each.total for each in numbers} != {total} or len(set(numbers)) < len(numbers):
        raise ValueError(f"these shards are not parts of one evaluation: {', '.join(map(str, numbers))}")
    if missing := sorted({*range(1, total + 1)} - {each.number for each in numbers}):
        raise ValueError(f"shards are missing: {', '.join(f'{number}/{total}' for number in missing[:10])}")
    if unfinished := [path for path, about in shards.items() if about.get("rows") is None]:
        raise ValueError(f"{unfinished[0]}: is not finished; go on with it by --resume")


def _common_settings(shards: Mapping[Path, Mapping[str, Any]]) -> EvaluationSettings:
    choices = {path: {"version": about.get("version"), **about["settings"]} for path, about in shards.items()}
    first, usual = next(iter(choices.items()))
    for path, other in choices.items():
        if changed := [name for name in {**usual, **other} if usual.get(name) != other.get(name)]:
            raise ValueError(f"{path}: has another {', '.join(changed)} than {first.name}; measure all shards alike")
    with reading(first / MARK, "the settings of an evaluation"):
        return EvaluationSettings(**shards[first]["settings"])


def _merged(manifests: Mapping[Path, Mapping[str, Any]]) -> Iterator[Row]:
    """The rows of all shards in the order of their keys."""
    return heapq.merge(*(_rows(path, about["rows"]) for path, about in manifests.items()), key=itemgetter(KEY))


def _rows(folder: Path, count: int) -> Iterator[Row]:
    """The rows of a shard in the order of their keys, as they were measured: without what they lack."""
    number = 0
    for path in part_paths(folder / ROWS):
        for row in part_rows(path):
            number += 1
            yield {name: row[name] for name in sorted(row, key=_place) if row[name] is not None}
    if number != count:
        raise ValueError(f"{folder}: holds {number} of {count} rows; go on with it by --resume")


def _place(name: str) -> int:
    """Place of a column among others: features come last, in the order in which a dance has them."""
    kind = name.removeprefix("f_").rpartition("_")[0] if name.startswith("f_") else ""
    return FEATURES.index(kind) + 1 if kind in FEATURES else len(FEATURES) + 1 if kind else 0


def _same(tasks: Iterable[Pair], rows: Iterator[Row]) -> Iterator[Row]:
    """The rows, each checked to be that of its task."""
    for task in tasks:
        row = next(rows, None)
        if row is None or row[KEY] != task.key:
            raise ValueError(f"the dances or songs have changed since the shards were measured ({task.key})")
        if row.get(STAMP) not in (None, task.stamp):
            raise ValueError(
                f"{task.motion} or {task.music.name} has changed since it was measured, in size or time of change "
                "(a copy keeps it by cp -p); measure its shard again with --resume"
            )
        yield row
    if next(rows, None) is not None:
        raise ValueError("the dances or songs have changed since the shards were measured; measure the shards anew")
