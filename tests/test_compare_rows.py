"""A corpus compared by one process or several, in memory or by rows on disk, cut off or not: one result."""

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.cli import app
from harmolab.clips import corpus_recordings
from harmolab.data.recordings import Problem, find_recordings
from harmolab.data.synthetic import write_corpus
from harmolab.lab.compare import rows
from harmolab.lab.compare.auc import CorpusResult, compare
from harmolab.lab.compare.rows import Processes, packed, unpacked
from harmolab.lab.evaluate.engine import read_rows
from harmolab.lab.evaluate.parts import part_path
from harmolab.types import BeatTrack
from tests.builders import called, done, refused, track

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")

run = partial(called, app)
compared = partial(compare, n_rotations=20, window=4.0)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clips of each of the seven dances, the fourth without a motion that can be read."""
    root = write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=14, seconds=8.0, fps=30.0, seed=2)
    (find_recordings(root).folders[3] / "motion.npz").write_bytes(b"no motion")
    return root


def numbers(result: CorpusResult) -> list[Any]:
    """All of a result, its arrays as lists."""
    scores = [{name: row.tolist() for name, row in side.items()} for side in (result.true, result.wrong)]
    return [result.summary, *scores, result.dances, result.sequences, result.patterns]


@pytest.fixture(scope="module")
def expected(corpus: Path) -> CorpusResult:
    """The result from recordings in memory."""
    return compared(corpus_recordings(corpus), corpus=str(corpus))


@pytest.mark.slow
def test_several_processes_give_the_same_result(corpus: Path, expected: CorpusResult):
    problems: list[Problem] = []
    assert numbers(compared(corpus, processes=Processes(2), report=problems.append)) == numbers(expected)
    assert [problem.folder for problem in problems] == [find_recordings(corpus).folders[3]]


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"null": "other", "dances": ("rumba", "waltz"), "seed": 3}])
def test_rows_on_disk_give_the_result_of_memory(options: dict[str, Any], corpus: Path, tmp_path: Path):
    memory, problems = compared(corpus_recordings(corpus), corpus=str(corpus), **options), []
    disk = compared(corpus, processes=Processes(out=tmp_path / "rows"), report=problems.append, **options)
    here = compared(corpus, report=problems.append, **options)
    assert numbers(disk) == numbers(memory) == numbers(here) and problems[0] == problems[1]
    assert "motion.npz: cannot be read" in problems[0].message


@pytest.mark.slow
def test_another_corpus_to_fit_on_has_rows_of_its_own(corpus: Path, tmp_path: Path):
    options: dict[str, Any] = {"dances": ("rumba", "waltz"), "fit_on": corpus}
    result = compared(corpus, processes=Processes(out=tmp_path / "rows"), **options)
    assert numbers(result) == numbers(compared(corpus, **options))
    (frame,) = read_rows(tmp_path / "rows" / "fit_on")
    assert len(frame) == 14


class Stopped(Exception):
    pass


def stopping_at(last: int) -> Callable[[Iterable[Any], str], Iterable[Any]]:
    """A Progress that ends with an error before so many rows."""

    def progress(items: Iterable[Any], label: str) -> Iterable[Any]:
        for item in items:
            if label == "measured" and item == last:
                raise Stopped
            yield item

    return progress


@pytest.mark.slow
def test_a_comparison_that_was_cut_off_reads_what_is_missing_and_nothing_else(
    corpus: Path, expected: CorpusResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    read: list[Path] = []
    load = rows.load_recording
    monkeypatch.setattr(rows, "load_recording", lambda folder: [read.append(folder), load(folder)][1])
    processes = Processes(out=tmp_path / "rows", resume=True)
    with pytest.raises(Stopped):
        compared(corpus, processes=processes, progress=stopping_at(6))
    assert len(read) == 6
    assert numbers(compared(corpus, processes=processes)) == numbers(expected)
    assert read == list(find_recordings(corpus).folders)
    refused(r"settings\.window was 4\.0 and is 6\.0", compared, corpus, processes=processes, window=6.0)
    message = "holds a run; go on with it by --resume, or begin anew by --force"
    refused(message, compared, corpus, processes=replace(processes, resume=False))


def test_foreign_rows_are_an_error_that_names_the_file(corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    processes = Processes(out=tmp_path / "rows", resume=True)
    with monkeypatch.context() as patch:
        patch.setattr(rows, "recording_row", lambda task, options: {"problem": "", **packed(track([1.0]))})
        refused(r"part-0000000\.parquet: cannot be read as rows of a comparison", compared, corpus, processes=processes)
    assert part_path(tmp_path / "rows", 0).is_file()


@pytest.mark.slow
def test_a_recording_that_cannot_be_scored_is_reported_and_left_out(corpus: Path, tmp_path: Path):
    root = shutil.copytree(corpus, tmp_path / "corpus")
    shutil.rmtree(find_recordings(root).folders[3])
    folder = find_recordings(root).folders[5]
    (folder / "beats.json").unlink()
    problems: list[Problem] = []
    annotated = partial(compared, root, beats="annotated", report=problems.append)
    result, rows_result = annotated(), annotated(processes=Processes(out=tmp_path / "rows"))
    assert problems == [Problem(folder, f"{folder}: no beats.json; use tracked beats")] * 2
    assert result.summary["n_sequences"] == 12 and numbers(rows_result) == numbers(result)


def test_recordings_in_memory_are_scored_where_they_are(corpus: Path, tmp_path: Path):
    message = "jobs, scheduler and out are for a folder of recordings"
    for processes in (Processes(jobs=2), Processes(out=tmp_path / "rows"), Processes(scheduler="tcp://10.0.0.5:8786")):
        refused(message, compared, corpus_recordings(corpus), processes=processes)


# The command


@pytest.mark.slow
def test_compare_keeps_rows_and_goes_on_with_them(corpus: Path, tmp_path: Path):
    words = ("evaluate", "compare", corpus, "--dances", "rumba,waltz", "--rotations", 20, "--jobs", 0, "--json")
    first = done(app, *words, "--out", tmp_path / "rows")
    assert "left out: " in first.stderr
    assert run(*words, "--out", tmp_path / "rows", "--resume").stdout == first.stdout == run(*words).stdout
    stopped = run(*words, "--out", tmp_path / "rows")
    assert (stopped.exit_code, stopped.stdout) == (2, "")
    assert "go on with it by --resume, or begin anew by --force" in stopped.stderr
    assert run(*words, "--out", tmp_path / "rows", "--force").stdout == first.stdout


def test_compare_goes_on_with_named_rows_only(corpus: Path):
    stopped = run("evaluate", "compare", corpus, "--resume")
    message = "harmolab: --resume goes on with the rows in a folder; name it by --out\n"
    assert (stopped.exit_code, stopped.stderr) == (2, message)


# Records as cells


@dataclass(frozen=True)
class Tracks:
    name: str
    tracks: tuple[BeatTrack, ...]
    pair: tuple[float, np.ndarray]
    sums: dict[str, np.typing.NDArray[np.complex128]]
    mask: np.typing.NDArray[np.bool_]
    figures: frozenset[str]
    missing: BeatTrack | None = None


def test_records_come_back_to_the_last_bit():
    third = 1 / 3
    beats = BeatTrack([third, 1.0], [0.1, 0.2], 100.0, 10.0, bar_places=[0, 1], quality=third)
    sums = {"wave": np.array([1 + third * 1j, np.nan])}
    record = Tracks("Ö", (beats, beats), (np.inf, np.zeros((0, 2))), sums, np.array([[True], [False]]), frozenset("ba"))
    cells = packed(record)
    assert cells["numbers"].tolist()[:6] == [third, 1.0, 0.1, 0.2, 0.0, 1.0]  # both tracks hold the same arrays
    assert cells["numbers"].size == 6 + 4 + 2
    back = unpacked(Tracks, cells)
    assert (back.name, back.figures, back.missing, back.pair[0]) == ("Ö", {"a", "b"}, None, np.inf)
    for one in back.tracks:
        assert (one.times.tolist(), one.strengths.tolist()) == ([third, 1.0], [0.1, 0.2])
        assert (one.fps, one.duration) == (100, 10)
        assert (one.bar_places.dtype, one.bar_places.tolist(), one.quality) == (np.int64, [0, 1], third)
    assert back.pair[1].shape == (0, 2)
    assert back.sums["wave"].tobytes() == sums["wave"].tobytes()
    assert (back.mask.dtype, back.mask.tolist()) == (bool, [[True], [False]])


def test_cells_that_lack_numbers_are_refused():
    cells = packed(track([1.0, 2.0]))
    refused("holds 3 of 4 numbers", unpacked, BeatTrack, {**cells, "numbers": cells["numbers"][:-1]})
