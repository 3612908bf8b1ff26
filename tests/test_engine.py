"""One table from one process or several, killed or not: every row once, the same to the last bit."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from dask.system import cpu_count

from harmolab.files import read_json, write_json
from harmolab.lab.evaluate import engine, parts
from harmolab.lab.evaluate.engine import MANIFEST, read_rows, run_rows
from harmolab.lab.evaluate.parts import part_path
from tests.builders import cases, refused
from tests.tiny_run import Number, Numbers, square

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")

ROOT = Path(__file__).resolve().parents[1]
COUNT = 300


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "PART_ROWS", 64)
    monkeypatch.setattr("tests.tiny_run.PAUSE", 0.0)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of 300 tasks in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "PART_ROWS", 64)
        out = tmp_path_factory.mktemp("runs") / "undisturbed"
        run_rows(Numbers(COUNT), square, out, jobs=0)
    return out


def contents(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(out.glob("part-*"))}


@pytest.mark.slow
def test_rows_hold_what_is_measured_in_the_order_of_the_keys(undisturbed: Path):
    frames = list(read_rows(undisturbed))
    assert [len(frame) for frame in frames] == [64, 64, 64, 64, 44]
    table = pd.concat(frames, ignore_index=True)
    assert list(table["key"]) == [f"{number:05d}" for number in range(COUNT)]
    assert list(table.columns) == ["key", "error", "square", "draw", "name", "features", "beats"]
    assert all(frame.dtypes.equals(frames[0].dtypes) for frame in frames)
    fine = table[table["error"] == ""]
    assert list(fine["square"]) == [number**2 for number in range(COUNT) if number % 50 != 7]
    np.testing.assert_array_equal(fine["features"][0], np.random.default_rng(0).normal(size=4)[1:])
    assert list(fine["beats"].isna()) == [number % 3 == 0 for number in range(COUNT) if number % 50 != 7]


@pytest.mark.slow
def test_an_error_is_a_row_and_not_the_end(undisturbed: Path):
    table = pd.concat(read_rows(undisturbed), ignore_index=True)
    errors = table[table["error"] != ""]
    assert list(errors.index) == [7, 57, 107, 157, 207, 257]
    assert errors["error"][57] == "ValueError: clip 57 holds no motion"
    assert errors["square"].isna().all()


@pytest.mark.parametrize("jobs", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_any_number_of_processes_writes_the_same_bytes(jobs: int, undisturbed: Path, tmp_path: Path):
    run_rows(Numbers(COUNT), square, tmp_path / "out", jobs=jobs)
    assert contents(tmp_path / "out") == contents(undisturbed)


def test_few_tasks_are_measured_in_this_process_unless_a_number_is_set(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(engine, "_connected", lambda jobs, scheduler: 1 / jobs / 0)  # would start processes
    run_rows(Numbers(engine.FEW - 1), square, tmp_path / "few", jobs=None)
    with pytest.raises(ZeroDivisionError):
        run_rows(Numbers(engine.FEW), square, tmp_path / "many", jobs=None)
    with pytest.raises(ZeroDivisionError):
        run_rows(Numbers(3), square, tmp_path / "named", jobs=1)
    assert engine.usual_jobs(engine.FEW) == cpu_count()
    # As Slurm lends a job one core of a machine that has many.
    monkeypatch.setattr("psutil.Process.cpu_affinity", lambda process: [3], raising=False)
    assert engine.usual_jobs(engine.FEW) == 1


def worker_settings(task: Number) -> dict[str, Any]:
    import dask

    names = ("OMP_NUM_THREADS", "MALLOC_TRIM_THRESHOLD_")
    profile = dask.config.get("distributed.worker.profile.enabled")
    return {name: os.environ[name] for name in names} | {"profile": profile}


@pytest.mark.slow
def test_workers_have_one_thread_keep_their_arrays_and_no_samples_of_their_stack(tmp_path: Path):
    (frame,) = run_rows(Numbers(1), worker_settings, tmp_path, jobs=1)
    assert frame["error"][0] == ""
    row = frame.iloc[0]
    assert (row["OMP_NUM_THREADS"], row["MALLOC_TRIM_THRESHOLD_"], bool(row["profile"])) == ("1", "67108864", False)


class Stopped(Exception):
    pass


def test_a_stopped_run_measures_what_is_missing_and_nothing_else(undisturbed: Path, tmp_path: Path):
    measured: list[int] = []

    def noted(task: Number) -> dict[str, Any]:
        measured.append(task.number)
        return square(task)

    def stopping(items: Iterable[Any], label: str) -> Iterable[Any]:
        for item in items:
            if item == 100:
                raise Stopped
            yield item

    with pytest.raises(Stopped):
        run_rows(Numbers(COUNT), noted, tmp_path / "out", jobs=0, progress=stopping)
    refused(r"holds 100 of 300 rows; go on with --resume", read_rows, tmp_path / "out")
    run_rows(Numbers(COUNT), noted, tmp_path / "out", jobs=0, resume=True)
    assert measured == list(range(COUNT))
    assert contents(tmp_path / "out") == contents(undisturbed)


def counting(counts: list[int]) -> Callable[[Any, str], Any]:
    """A Progress that notes the numbers of the rows."""
    return lambda items, label: counts.append(len(items)) or items


def test_progress_counts_the_rows_that_are_missing(tmp_path: Path):
    counts: list[int] = []
    run_rows(Numbers(100), square, tmp_path, jobs=0, progress=counting(counts))
    part_path(tmp_path, 1).unlink()
    run_rows(Numbers(100), square, tmp_path, jobs=0, resume=True, progress=counting(counts))
    assert counts == [100, 36]


def test_rows_of_changed_inputs_are_measured_anew(tmp_path: Path):
    folder, out = tmp_path / "inputs", tmp_path / "out"
    folder.mkdir()
    measured: list[int] = []

    def content(task: Number) -> str:
        file = folder / f"{task.key}.txt"
        return file.read_text() if file.exists() else "none"

    def measure(task: Number) -> dict[str, Any]:
        measured.append(task.number)
        if content(task) == "damaged":
            raise ValueError("damaged")
        return {"content": content(task)}

    def go_on() -> list[int]:
        measured.clear()
        run_rows(Numbers(100), measure, out, jobs=0, stamp=content, resume=True)
        return list(measured)

    assert go_on() == list(range(100))
    assert go_on() == []
    (folder / "00070.txt").write_text("damaged")
    assert go_on() == list(range(70, 100))  # to the end of its part of 64
    (folder / "00070.txt").write_text("mended")
    (folder / "00061.txt").write_text("changed")
    assert go_on() == [61, 62, 63, *range(70, 100)]
    table = pd.concat(read_rows(out), ignore_index=True)
    assert list(table.columns) == ["key", "error", "content"]
    assert table["content"][table["content"] != "none"].to_dict() == {61: "changed", 70: "mended"}
    assert not table["error"].any()


def test_a_resumed_run_tries_again_what_failed_for_no_fault_of_its_inputs(tmp_path: Path):
    measured: list[int] = []
    failing: dict[int, Exception] = {3: ValueError("damaged"), 70: MemoryError()}

    def measure(task: Number) -> dict[str, Any]:
        measured.append(task.number)
        if task.number in failing:
            raise failing[task.number]
        return square(task)

    def go_on() -> list[int]:
        measured.clear()
        run_rows(Numbers(100), measure, tmp_path, jobs=0, resume=True)
        return list(measured)

    assert go_on() == list(range(100))
    del failing[70]
    assert go_on() == list(range(70, 100))
    assert go_on() == []
    errors = pd.concat(read_rows(tmp_path), ignore_index=True).set_index("key")["error"]
    assert errors["00003"] == "ValueError: damaged" and errors["00070"] == ""


def test_parts_without_the_state_of_their_inputs_are_measured_anew(tmp_path: Path):
    run_rows(Numbers(100), square, tmp_path / "out", jobs=0)
    counts: list[int] = []
    more: dict[str, Any] = {"stamp": attrgetter("key"), "resume": True, "progress": counting(counts)}
    run_rows(Numbers(100), square, tmp_path / "out", jobs=0, **more)
    assert counts == [100]


@pytest.mark.parametrize("fault", ["half", "bytes", "of other tasks", "missing"])
def test_a_part_that_is_not_whole_is_measured_anew(fault: str, undisturbed: Path, tmp_path: Path):
    run_rows(Numbers(COUNT), square, tmp_path, jobs=0)
    part = part_path(tmp_path, 2)
    data, other = part.read_bytes(), part_path(tmp_path, 1).read_bytes()
    changed = {"half": data[: len(data) // 2], "bytes": b"no Parquet", "of other tasks": other}
    if fault == "missing":
        part.unlink()
    else:
        part.write_bytes(changed[fault])
    run_rows(Numbers(COUNT), square, tmp_path, jobs=0, resume=True)
    assert contents(tmp_path) == contents(undisturbed)


def test_a_damaged_part_is_an_error_that_names_the_file(tmp_path: Path):
    run_rows(Numbers(100), square, tmp_path, jobs=0)
    whole = part_path(tmp_path, 1).read_bytes()
    for damaged in (whole[:20] + bytes([whole[20] ^ 1]) + whole[21:], whole.replace(b"square", b"squard")):
        part_path(tmp_path, 1).write_bytes(damaged)
        refused(r"part-0000001\.parquet: ", list, read_rows(tmp_path))


def test_a_foreign_folder_is_refused_and_by_force_keeps_its_files(tmp_path: Path):
    (tmp_path / "diary.txt").write_text("mine")
    refused(r"holds diary\.txt and no run", run_rows, Numbers(3), square, tmp_path, jobs=0)
    refused(r"holds diary\.txt and no run", run_rows, Numbers(3), square, tmp_path, jobs=0, resume=True)
    run_rows(Numbers(3), square, tmp_path, jobs=0, force=True)
    assert (tmp_path / "diary.txt").read_text() == "mine"
    refused("is a file; a run needs a folder", run_rows, Numbers(3), square, tmp_path / "diary.txt", jobs=0, force=True)


def test_a_run_is_neither_written_over_nor_mixed_with_another(tmp_path: Path):
    run_rows(Numbers(100), square, tmp_path, jobs=0, settings={"window": 6.0, "limits": {"jerk": 1}})
    with pytest.raises(ValueError, match="holds a run; go on with it by --resume, or begin anew by --force"):
        run_rows(Numbers(100), square, tmp_path, jobs=0)
    with pytest.raises(ValueError, match=r"settings\.limits\.jerk was 1 and is 2, settings\.window was 6\.0 and is 8"):
        run_rows(Numbers(100), square, tmp_path, jobs=0, resume=True, settings={"window": 8.0, "limits": {"jerk": 2}})
    with pytest.raises(ValueError, match=r"settings\.window was 6\.0 and is 'all'"):
        run_rows(Numbers(100), square, tmp_path, jobs=0, resume=True, settings={"window": "all", "limits": {"jerk": 1}})
    rounded = {"window": math.nextafter(6.0, 7.0), "limits": {"jerk": 1.0}}  # as of another processor
    run_rows(Numbers(100), square, tmp_path, jobs=0, resume=True, settings=rounded)
    with pytest.raises(ValueError, match=r"otherwise: rows was 100 and is 99; .* --force, without --resume"):
        run_rows(Numbers(99), square, tmp_path, jobs=0, resume=True, settings={"window": 6.0, "limits": {"jerk": 1}})
    with pytest.raises(ValueError, match="otherwise: other files, as many as now; ask for the same"):
        others = [*Numbers(101)][1:]
        run_rows(others, square, tmp_path, jobs=0, resume=True, settings={"window": 6.0, "limits": {"jerk": 1}})
    run_rows(Numbers(3), square, tmp_path, jobs=0, force=True)
    assert [len(frame) for frame in read_rows(tmp_path)] == [3]
    assert len(contents(tmp_path)) == 1


def test_a_run_of_another_version_is_not_resumed(tmp_path: Path):
    run_rows(Numbers(3), square, tmp_path, jobs=0)
    manifest = read_json(tmp_path / "run.json")
    write_json(tmp_path / "run.json", manifest | {"versions": manifest["versions"] | {"numpy": "1.0"}})
    refused(r"versions\.numpy was '1\.0' and is", run_rows, Numbers(3), square, tmp_path, jobs=0, resume=True)


def test_two_processes_do_not_write_into_one_run(tmp_path: Path):
    def second(items: Iterable[Any], label: str) -> Iterable[Any]:
        refused("another process is at this run", run_rows, Numbers(3), square, tmp_path, jobs=0, resume=True)
        return items

    run_rows(Numbers(3), square, tmp_path, jobs=0, progress=second)


@cases(
    "tasks, fault",
    ([Number(2), Number(1)], "in the order of their keys, each once; '00001' follows '00002'"),
    ([Number(1), Number(1)], "'00001' follows '00001'"),
    ([], "there is nothing to measure"),
)
def test_tasks_out_of_order_are_refused(tasks: list[Number], fault: str, tmp_path: Path):
    refused(fault, run_rows, tasks, square, tmp_path / "out", jobs=0)
    assert not (tmp_path / "out").exists()


def test_cells_of_no_known_kind_are_errors_and_mixed_columns_name_the_column(tmp_path: Path):
    run_rows([Number(1)], lambda task: {"scores": {"a": 1}}, tmp_path / "a", jobs=0)
    (frame,) = read_rows(tmp_path / "a")
    assert frame["error"][0] == "ValueError: a table holds text, numbers and lists of numbers, not dict"
    with pytest.raises(ValueError, match="several kinds in the column 'x'"):
        run_rows(Numbers(2), lambda task: {"x": "one" if task.number else 1.5}, tmp_path / "b", jobs=0)


def test_without_dask_processes_are_refused_and_its_name_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r'pip install "dask\[distributed\]"; or measure in this process: --jobs 0'):
        run_rows(Numbers(3), square, tmp_path / "out", jobs=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_without_arrow_rows_are_csv_and_tables_same(monkeypatch: pytest.MonkeyPatch, undisturbed: Path, tmp_path: Path):
    with monkeypatch.context() as patch:
        patch.setattr(parts, "find_spec", lambda name: None)
        run_rows(Numbers(100), square, tmp_path / "out", jobs=0)
        frames = list(run_rows(Numbers(100), square, tmp_path / "out", jobs=0, resume=True))
        refused("its rows are Parquet, which needs pyarrow; run: pip install pyarrow", read_rows, undisturbed)
    assert {path.suffix for path in (tmp_path / "out").glob("part-*")} == {".csv"}
    run_rows(Numbers(100), square, tmp_path / "parquet", jobs=0)
    for frame, other in zip(frames, read_rows(tmp_path / "parquet"), strict=True):
        pd.testing.assert_frame_equal(frame, other, check_dtype=False)
    assert len(pd.concat(read_rows(tmp_path / "out"))) == 100  # with pyarrow they are read as they are


def test_a_cell_of_a_csv_part_may_hold_the_curve_of_a_long_dance(tmp_path: Path):
    rows = [{"name": "long", "curve": [one / 7 for one in range(20000)]}, {"name": "none", "curve": None}]
    parts.write_part(tmp_path / "part-0000000.csv", rows)
    assert (tmp_path / "part-0000000.csv").stat().st_size > 2**17
    assert parts.part_rows(tmp_path / "part-0000000.csv") == rows


def test_a_damaged_csv_part_is_measured_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(parts, "find_spec", lambda name: None)
    run_rows(Numbers(70), square, tmp_path, jobs=0)
    whole = contents(tmp_path)
    (tmp_path / "part-0000001.csv").write_bytes(whole["part-0000001.csv"][:-20])
    run_rows(Numbers(70), square, tmp_path, jobs=0, resume=True)
    assert contents(tmp_path) == whole


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(engine, "CONNECT_SECONDS", 0.5)
    with pytest.raises(ConnectionError, match=r"--scheduler tcp://127\.0\.0\.1:9: no scheduler with workers answers"):
        run_rows(Numbers(3), square, tmp_path / "out", scheduler="tcp://127.0.0.1:9")
    with socket.create_server(("127.0.0.1", 0)) as other:  # takes the call, and never speaks
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(ConnectionError, match=r"answers \(another server does, such as"):
            run_rows(Numbers(3), square, tmp_path / "other", scheduler=address)


def started(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", *map(str, arguments)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=ROOT, env=environment, **pipes)


def rows_there(out: Path) -> int:
    return sum(len(engine.part_texts(path, engine.KEY)) for path in out.glob("part-*"))


@pytest.mark.slow
@cases("jobs, kills", (0, 4), (2, 3))
def test_clients_killed_at_random_moments_end_with_one_table(jobs: int, kills: int, undisturbed: Path, tmp_path: Path):
    rng = np.random.default_rng(jobs)
    moments = []
    while len(moments) < kills:
        with started("tests.tiny_run", tmp_path, jobs, COUNT) as client:
            before, pid = rows_there(tmp_path), int(client.stdout.readline())
            while rows_there(tmp_path) == before and client.poll() is None:  # it has begun to write
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.2))
            os.kill(pid, signal.SIGKILL)
        moments.append(rows_there(tmp_path))
    assert moments == sorted(moments) and moments[-1] > moments[0]
    assert contents(tmp_path) != contents(undisturbed)
    with started("tests.tiny_run", tmp_path, jobs, COUNT) as client:
        _, errors = client.communicate(timeout=120)
    assert (client.returncode, errors) == (0, "")
    assert contents(tmp_path) == contents(undisturbed)


def workers_of(pid: int) -> list[int]:
    """Processes of dask workers that a process has started, by /proc."""
    children = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
            command = (status.parent / "cmdline").read_text()
        except (OSError, ValueError):
            continue
        if parent == pid and "spawn_main" in command:
            children.append(int(status.parent.name))
    return children


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes by /proc")
def test_workers_killed_again_and_again_change_nothing(tmp_path: Path):
    count, kills = 320, list[int]()
    run_rows(Numbers(count), square, tmp_path / "alone", jobs=0)

    def killing(items: Iterable[Any], label: str) -> Iterable[Any]:
        for place, item in enumerate(items):
            if place in (40, 120, 200):  # a fourth could be the end of a row
                kills.append(workers_of(os.getpid())[0])
                os.kill(kills[-1], signal.SIGKILL)
            yield item

    run_rows(Numbers(count), square, tmp_path / "killed", jobs=2, progress=killing)
    assert len(set(kills)) == 3
    assert contents(tmp_path / "killed") == contents(tmp_path / "alone")


@pytest.mark.slow
def test_a_process_that_ends_while_it_starts_is_an_error_with_advice(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("distributed.Nanny.instantiate", failing_to_start)
    with pytest.raises(ConnectionError, match=r"--jobs 2: a process ended while it started; ask for fewer.*--jobs 0"):
        run_rows(Numbers(3), square, tmp_path, jobs=2)


async def failing_to_start(nanny: object) -> str:
    """A worker that the system ended: dask waits for it, and gives up."""
    return "failed"


@pytest.mark.slow
def test_a_task_that_kills_its_worker_each_time_is_an_error_row_and_the_only_one(tmp_path: Path):
    tasks = [Number(number, deadly=tmp_path if number == 10 else None) for number in range(8, 50)]
    (frame,) = run_rows(tasks, square, tmp_path / "out", jobs=2)
    assert list(frame["key"][frame["error"] != ""]) == ["00010"]
    assert "kills the process" in frame["error"][2]
    assert len(frame) == 42


@pytest.mark.slow
def test_a_scheduler_that_dies_is_an_error_and_the_run_goes_on_elsewhere(undisturbed: Path, tmp_path: Path):
    files = tmp_path / "scheduler.json"
    common = ("--no-dashboard", "--scheduler-file", files)
    with started("distributed.cli.dask_scheduler", *common, "--host", "127.0.0.1", "--port", 0) as scheduler:
        while not files.exists() or not files.read_text():
            time.sleep(0.05)
        address = json.loads(files.read_text())["address"]
        with started("distributed.cli.dask_worker", *common[1:], "--nthreads", 1, "--no-dashboard") as worker:
            with started("tests.tiny_run", tmp_path / "out", 0, COUNT, address) as client:
                while not rows_there(tmp_path / "out"):
                    assert client.poll() is None
                    time.sleep(0.02)
                scheduler.kill()
                _, errors = client.communicate(timeout=120)
            worker.kill()
    assert client.returncode != 0 and "ConnectionError" in errors and " - ERROR - " not in errors
    assert 0 < rows_there(tmp_path / "out") < COUNT
    run_rows(Numbers(COUNT), square, tmp_path / "out", jobs=0, resume=True)
    assert contents(tmp_path / "out") == contents(undisturbed)


def test_a_manifest_of_too_many_rows_is_an_error_at_once(tmp_path: Path) -> None:
    run_rows(Numbers(5), square, tmp_path / "rows", jobs=0)
    manifest = tmp_path / "rows" / MANIFEST
    manifest.write_text(manifest.read_text().replace('"rows": 5', f'"rows": {10**15}'))
    refused(f"rows: holds 5 of {10**15} rows", read_rows, tmp_path / "rows")
