"""One measurement for every task, in this process, in several, or on a cluster: the same table from all of them.

Rows are handed to the client in the order of the tasks and stand in parts (`harmolab.lab.evaluate.parts`), so a run
that was stopped goes on where it was. Tasks in flight and rows that wait for an earlier one are bounded, so memory does
not grow with their number. Several processes need dask (``pip install "dask[distributed]"``).
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import platform
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from itertools import count, islice, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol
from uuid import uuid4

from filelock import FileLock, Timeout

from harmolab.files import PathLike, Progress, is_close, plain, read_json, reading, silent, write_json
from harmolab.lab.evaluate.parts import PART_ROWS, STAMP, Row, cell, part_frames, part_path, part_texts, write_parts

if TYPE_CHECKING:
    import pandas as pd
    from distributed import Client, LocalCluster, Scheduler

FORMAT = "harmolab rows 1"
MANIFEST = "run.json"
KEY, ERROR = "key", "error"  # the first two columns of every row


def read_manifest(folder: PathLike) -> dict[str, Any]:
    """The manifest of a run beside its parts: number of rows, digest of their keys, versions, settings.

    Raises
    ------
    FileNotFoundError, ValueError
        Without a run in the folder.
    """
    with reading(Path(folder) / MANIFEST, "the manifest of a run") as file:
        manifest = read_json(file)
        if not isinstance(manifest, dict) or manifest.get("format") != FORMAT or not isinstance(manifest["rows"], int):
            raise ValueError(f"is no manifest of {FORMAT!r}")
        return manifest


def read_rows(folder: PathLike) -> Iterator[pd.DataFrame]:
    """The table of a finished run, a part at a time, in the order of the keys.

    Every part has all columns, of the same types: the first is "key", the second "error" (empty text where there was
    none, else what stood in the way; the other columns are then missing).

    Raises
    ------
    FileNotFoundError, ValueError
        Without a run in the folder, for a damaged part, and for a run that is not finished.
    """
    folder = Path(folder)
    return part_frames(folder, read_manifest(folder)["rows"])


FEW = 40  # tasks that one process has measured before several have started
PER_WORKER = 4  # tasks under way for each: one runs, the others wait, so that it never does
MOST_WAITING = 1024  # rows that are measured, but wait for an earlier one
TURNS = 256  # rows after which the workers are counted again: a cluster may grow
SUBMISSIONS = 2  # of a task that kills its worker; dask tries each four times
CONNECT_SECONDS = 30
LOCK = ".lock"
_BUSY = "another process is at this run; wait until it ends, or stop it"
_KILLED = "kills the process each time (no memory, or a fault in compiled code); try --resume with fewer --jobs"
OF_INPUTS = ("ValueError: ", "FileNotFoundError: ", "MissingFrameRate: ")  # errors that stay while the inputs do


class Task(Protocol):
    """One measurement to be taken: a record that can be sent to another process, with a key of its own."""

    @property
    def key(self) -> str:
        """Stable name of the row; no two tasks have the same."""


Measure = Callable[[Any], Mapping[str, Any]]
Stamp = Callable[[Any], str]


class Measurement(NamedTuple):
    """The function that measures a task, and that of the state of its inputs, where there is one."""

    measure: Measure
    stamp: Stamp | None

    def row(self, task: Task) -> dict[str, Any]:
        """The key of a task, an empty "error", and what is measured; or its key and what stood in the way."""
        row = self.failed_row(task, "")  # the state of the inputs before they are read: they may change meanwhile
        try:
            return row | {name: cell(value) for name, value in self.measure(task).items()}
        except Exception as error:  # noqa: BLE001  # whatever one clip of a million raises, the others are measured
            return row | {ERROR: f"{type(error).__name__}: {' '.join(str(error).split())[:400]}"}

    def failed_row(self, task: Task, error: str) -> dict[str, Any]:
        """The row of a task that was not measured."""
        return {KEY: task.key, ERROR: error} | ({} if self.stamp is None else {STAMP: self.stamp(task)})


def check_engine_installed(jobs: int | None, scheduler: str = "") -> None:
    """ValueError unless dask is installed, where `run_rows` needs it for these."""
    if (jobs or scheduler) and find_spec("distributed") is None:
        raise ValueError(
            'several processes need dask; install it by: pip install "dask[distributed]"; or measure in this process: '
            "--jobs 0"
        )


def usual_jobs(n_tasks: int = FEW) -> int:
    """Processes for so many tasks without a number: one a core of this job, 0 for a few tasks or without dask."""
    if n_tasks < FEW or find_spec("distributed") is None:
        return 0
    from dask.system import cpu_count

    return int(cpu_count())  # a cluster or a container may lend a job some of the machine's cores only


def run_rows(
    tasks: Sequence[Task],
    measure: Measure,
    out: PathLike,
    *,
    jobs: int | None = 1,
    scheduler: str = "",
    resume: bool = False,
    force: bool = False,
    settings: Mapping[str, Any] | None = None,
    stamp: Stamp | None = None,
    part_rows: int | None = None,
    progress: Progress = silent,
) -> Iterator[pd.DataFrame]:
    """Measure many tasks, in several processes or on a cluster, into one table on disk that survives a stop.

    The table has a row for each task, in the order of the tasks' keys, and stands in parts. Everything is measured when
    this returns. The table is the same to the last bit for any number of processes if `measure` is a function of its
    task alone, and numpy has one thread (``OMP_NUM_THREADS=1``), as it has in the workers.

    Parameters
    ----------
    tasks : sequence of tasks, each with a `key`
        In the order of their keys. They may be computed on access, since none is kept.
    measure : function from a task to a dict of cells: text, numbers, lists of numbers
        A function of a module, or a `functools.partial` of one. An exception becomes a row with a text in the column
        "error", and so does a task that kills its process again and again.
    out : str or path
        Folder of the run: ``run.json`` and the parts.
    jobs : int or None
        Worker processes on this machine. 0 measures in this process, without dask. None: one for each core, or 0 for
        few tasks.
    scheduler : str
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``, in place of `jobs`. Its workers need the same
        packages and files.
    resume : bool
        Go on with a run in `out`, or start it where there is none.
    force : bool
        Begin anew where a run is, or in a folder with other files, which stay.
    settings : JSON-able mapping
        All that the rows depend on besides the tasks. A run is resumed with the same settings only.
    stamp : function of a module, from a task to a text that changes with its inputs
        A run that is resumed measures tasks anew whose text is another one, and those after them in their part; so it
        does with tasks that failed for want of memory, of a package or of a disk, with or without `stamp`.
    part_rows : int
        Rows of a part, 1,024 when left out. Take fewer where rows are long: a part is held in memory, and written anew
        as it grows.
    progress : function(iterable, label) -> iterable
        Reports on the rows that are missing, such as a progress bar.

    Returns
    -------
    iterator of DataFrame
        A part at a time. The first column is "key", the second "error": "" where all went well, else the reason, and
        the other columns are missing then.

    Raises
    ------
    ValueError
        For tasks out of order or none, negative jobs, a folder that may not be written to, a run with other settings,
        tasks or versions, and without dask where it is needed.
    ConnectionError
        If the scheduler does not answer, or not any more, or a process cannot start; what was measured is kept.
    """
    check_engine_installed(jobs, scheduler)
    if jobs is not None and jobs < 0:
        raise ValueError(f"--jobs must be 0 (this process) or a number of processes, got {jobs}")
    out, size = Path(out), part_rows or PART_ROWS
    with _open_folder(out, _manifest(tasks, settings or {}), resume=resume, force=force):
        places = [range(len(tasks))[first : first + size] for first in range(0, len(tasks), size)]
        done = [_rows_done(part_path(out, number), tasks, place, stamp) for number, place in enumerate(places)]
        missing = len(tasks) - sum(done)
        if missing:
            measurement = Measurement(measure, stamp)
            indices = (index for place, rows in zip(places, done, strict=True) for index in place[rows:])
            workers = usual_jobs(missing) if jobs is None else jobs
            with _rows(tasks, measurement, indices, workers, scheduler) as rows:
                counted = zip(progress(range(missing), "measured"), rows, strict=True)
                write_parts(out, size, (row for _, row in counted))
    return read_rows(out)


def check_resumed(tasks: Sequence[Task], out: PathLike, settings: Mapping[str, Any]) -> None:
    """ValueError where a run in `out` was begun with other tasks, settings or versions."""
    if tasks and (Path(out) / MANIFEST).is_file():
        _check_same(Path(out) / MANIFEST, read_manifest(Path(out)), _manifest(tasks, settings))


def adopt_rows(
    tasks: Sequence[Task], rows: Iterable[Row], out: PathLike, *, settings: Mapping[str, Any], part_rows: int
) -> Iterator[pd.DataFrame]:
    """The table of rows that runs elsewhere have measured, written as `run_rows` would have done in one run.

    Parameters
    ----------
    tasks, out, settings, part_rows : as in `run_rows`; a run in `out` is replaced
    rows : the row of each task, in their order, with "key" and "error" first
    """
    out = Path(out)
    with _open_folder(out, _manifest(tasks, settings), resume=False, force=True):
        write_parts(out, part_rows, enumerate(rows))
    return read_rows(out)


def check_alike(tasks: Sequence[Task], settings: Mapping[str, Any], runs: Mapping[Path, Mapping[str, Any]]) -> None:
    """ValueError where a run (folder -> manifest) was begun with other settings or versions; names it and them."""
    manifest = _manifest(tasks, settings)
    common = {name: manifest[name] for name in ("format", "settings", "versions")}
    for folder, other in runs.items():
        _check_same(folder / MANIFEST, {name: other.get(name) for name in common}, common)


def _manifest(tasks: Sequence[Task], settings: Mapping[str, Any]) -> dict[str, Any]:
    """All that the rows of a run follow from; ValueError unless the keys increase from task to task."""
    digest, last = hashlib.sha256(), None
    for task in tasks:
        if last is not None and task.key <= last:
            raise ValueError(f"tasks must come in the order of their keys, each once; {task.key!r} follows {last!r}")
        last = task.key
        digest.update(f"{last}\0".encode())
    if last is None:
        raise ValueError("there is nothing to measure")
    packages = {name: version(name) for name in ("harmolab", "numpy", "scipy")}
    return plain({
        "format": FORMAT, "rows": len(tasks), "keys": digest.hexdigest(), "settings": settings,
        "versions": {"python": platform.python_version(), **packages},
    })  # fmt: skip


@contextmanager
def _open_folder(out: Path, manifest: Mapping[str, Any], *, resume: bool, force: bool) -> Iterator[None]:
    """Lock the folder of a run and write its manifest, or compare it with the one that is there."""
    check_free(out)
    is_run = _check_folder(out, resume=resume, force=force)
    out.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(out / LOCK, timeout=0):
            if is_run and not force:
                _check_same(out / MANIFEST, read_manifest(out), manifest)
            for path in [*out.glob(".*.tmp"), *(out.glob("part-*") if force else ())]:
                path.unlink()
            if force or not is_run:
                write_json(out / MANIFEST, manifest)
            yield
    except Timeout:
        raise ValueError(f"{out}: {_BUSY}") from None


def check_free(out: Path) -> None:
    """ValueError where another process is at the run of a folder, which is neither to be resumed nor begun anew."""
    if not (out / LOCK).is_file():
        return
    try:
        with FileLock(out / LOCK, timeout=0):
            return
    except Timeout:
        raise ValueError(f"{out}: {_BUSY}") from None


def _check_folder(out: Path, *, resume: bool, force: bool) -> bool:
    """Is there a run in the folder? ValueError where it may not be written to."""
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out}: is a file; a run needs a folder")
    held = sorted(path.name for path in out.iterdir() if not path.name.startswith(".")) if out.is_dir() else []
    is_run = MANIFEST in held
    if is_run and not (resume or force):
        raise ValueError(f"{out}: holds a run; go on with it by --resume, or begin anew by --force")
    if held and not is_run and not force:
        raise ValueError(f"{out}: holds {held[0]} and no run; choose another folder, or add to it by --force")
    return is_run


def _check_same(path: Path, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """ValueError that names every entry in which the manifest of a run differs from that of this one."""
    before, now = dict(_leaves(old)), dict(_leaves(new))
    changed = [name for name in sorted(before.keys() | now.keys()) if not is_close(before.get(name), now.get(name))]
    named = [name for name in changed if name != "keys"]
    pairs = [f"{name} was {before.get(name)!r:.60} and is {now.get(name)!r:.60}" for name in named]
    if changed:
        pairs = pairs or ["other files, as many as now"]
        raise ValueError(
            f"{path}: the run was begun otherwise: {', '.join(pairs)}; ask for the same, or begin anew by --force, "
            "without --resume"
        )


def _leaves(entry: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """(dotted name, value) of all that stands in nested dictionaries."""
    if isinstance(entry, Mapping):
        for key, value in entry.items():
            yield from _leaves(value, f"{name}.{key}" if name else str(key))
    else:
        yield name, entry


def _rows_done(path: Path, tasks: Sequence[Task], place: range, stamp: Stamp | None) -> int:
    """Rows of a part that are there, up to the first of changed inputs, or that failed for no fault of its inputs.

    0 for half a file, or rows of other tasks.
    """
    keys = part_texts(path, KEY)
    own = [tasks[index] for index in place[: len(keys)]]
    if keys != [task.key for task in own]:
        return 0
    states = [""] * len(keys) if stamp is None else part_texts(path, STAMP)  # older parts have none
    rows = zip(own, states, part_texts(path, ERROR), strict=False)
    same = takewhile(lambda row: stamp is None or stamp(row[0]) == row[1], rows)
    return sum(1 for _ in takewhile(lambda row: not row[2] or row[2].startswith(OF_INPUTS), same))


@contextmanager
def _rows(
    tasks: Sequence[Task], measurement: Measurement, indices: Iterable[int], jobs: int, scheduler: str
) -> Iterator[Iterator[tuple[int, Row]]]:
    """An iterator over (index, row) of those tasks, in the order of `indices`."""
    if scheduler or jobs:
        with _connected(jobs, scheduler) as client:
            yield _cluster_rows(client, measurement, tasks, indices)
    else:
        yield ((index, measurement.row(tasks[index])) for index in indices)


def _worker_row(measurement: Measurement, task: Task) -> dict[str, Any]:
    _forget_keys()
    return measurement.row(task)


def _forget_keys() -> None:
    """Empty a cache of dask in which each process holds 100,000 names of tasks, long after these are done."""
    from dask.utils import key_split

    if key_split.cache_info().currsize > MOST_WAITING:
        key_split.cache_clear()


def _threads(dask_scheduler: Scheduler) -> int:
    """Tasks that run at a time. Lets the scheduler forget what it keeps of every task that there was."""
    _forget_keys()
    for span in getattr(dask_scheduler.extensions.get("spans"), "spans", {}).values():
        if metadata := getattr(span, "_metadata", None):
            metadata["collections"].clear()
    return sum(worker.nthreads for worker in dask_scheduler.workers.values())


@contextmanager
def _connected(jobs: int, scheduler: str) -> Iterator[Client]:
    """A client of the scheduler, or of one with `jobs` processes on this machine, which ends with the block."""
    import dask
    from distributed import Client
    from distributed.utils import LoopRunner, silence_logging_cmgr

    if scheduler:
        try:
            LoopRunner(asynchronous=False).run_sync(_check_scheduler, scheduler)
            client = Client(scheduler, timeout=CONNECT_SECONDS)
            client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except (OSError, ValueError) as error:
            fault = " ".join(str(error).split()) or "another server does, such as the page of dask's dashboard"
            raise ConnectionError(f"--scheduler {scheduler}: no scheduler with workers answers ({fault})") from None
        quiet = partial(silence_logging_cmgr, logging.CRITICAL)
        with quiet("distributed.client"), quiet("tornado.application"), client:
            yield client
        return
    config = {
        # A worker holds the task that it runs and no other: one that kills it brings no other into suspicion.
        "distributed.scheduler.worker-saturation": 1.0,
        # dask has every array of 128 kB given back to the system at once, which doubles the time of a clip.
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 64 * 2**20,
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 * 2**20,
        # A worker would keep a thousand seconds of samples of its stack: 13 kB for each row.
        "distributed.worker.profile.enabled": False,
        # Every process would keep an hour of measurements of the machine: up to 4 MB, in the client several times.
        "distributed.admin.system-monitor.log-length": 10,
    }
    with dask.config.set(config), _local_cluster(jobs) as cluster, Client(cluster) as client:
        # dask gives up on a process that dies while it starts.
        cluster.adapt(minimum=jobs, maximum=jobs, interval="1s")
        yield client


async def _check_scheduler(address: str) -> None:
    """An OSError unless a dask scheduler is at an address; `Client` waits for another server without end."""
    from distributed import Security
    from distributed.comm.core import connect

    connection = connect(address, timeout=CONNECT_SECONDS, **Security().get_connection_args("client"))
    await (await asyncio.wait_for(connection, CONNECT_SECONDS + 1)).close()


def _local_cluster(jobs: int) -> LocalCluster:
    """A scheduler and `jobs` processes of one thread on this machine; ConnectionError where one cannot start."""
    from distributed import LocalCluster

    local = partial(LocalCluster, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL)
    try:
        return local(n_workers=jobs, threads_per_worker=1, scheduler_kwargs={"dashboard": False})
    except RuntimeError:
        advice = "ask for fewer: each needs memory, and --jobs 0 measures in this one"
        raise ConnectionError(f"--jobs {jobs}: a process ended while it started; {advice}") from None


def _cluster_rows(
    client: Client, measurement: Measurement, tasks: Sequence[Task], indices: Iterable[int]
) -> Iterator[tuple[int, Row]]:
    """(index, row) of the tasks, in the order of `indices`; a bounded number of them is under way."""
    from distributed import KilledWorker, as_completed

    remaining = iter(indices)
    group = f"rows-{uuid4().hex}"  # one name for all: dask then keeps those that wait at the scheduler
    pool = as_completed(loop=client.loop, with_results=True, raise_errors=False)
    order: deque[int] = deque()
    ready: dict[int, Row] = {}
    deaths: Counter[int] = Counter()

    def submit(index: int) -> None:
        pool.add(client.submit(_worker_row, measurement, tasks[index], key=(group, index, deaths[index])))

    for turn in count():
        if turn % TURNS == 0:
            window = PER_WORKER * max(client.run_on_scheduler(_threads), 1)
        for index in islice(remaining, max(min(window - pool.count(), MOST_WAITING - len(order)), 0)):
            order.append(index)
            submit(index)
        if not order:
            return
        future, result = next(pool)
        index = future.key[1]
        if isinstance(result, dict):
            ready[index] = result
        elif not isinstance(result, tuple):
            raise ConnectionError("the scheduler is gone; what was measured is kept, go on with --resume")
        elif not isinstance(result[1], KilledWorker):
            raise result[1]
        elif deaths[index] + 1 < SUBMISSIONS:
            deaths[index] += 1
            submit(index)
        else:
            ready[index] = measurement.failed_row(tasks[index], _KILLED)
        while order and order[0] in ready:
            yield order[0], ready.pop(order.popleft())
