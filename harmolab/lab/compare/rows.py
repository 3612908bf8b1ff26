"""Scores of each recording of a corpus alone, computed in this process or by the engine, whose rows hold them.

A record of arrays becomes cells of a table, and comes back to the last bit: one text, and one list of all numbers.
"""

import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from harmolab.clips import check_dances, recording_folders
from harmolab.data import recordings
from harmolab.data.recordings import Problem, ProblemReport, load_recording
from harmolab.files import Progress, plain, reading
from harmolab.lab.compare.scores import RecordingVerdict, ScoredClip, recording_verdict, scored_clip
from harmolab.lab.compare.windows import Corpus, cut_clips
from harmolab.lab.evaluate.engine import ERROR, run_rows
from harmolab.lab.evaluate.pairing import input_stamp
from harmolab.lab.evaluate.parts import part_path
from harmolab.types import FloatArray, check_kind

# Records of arrays as cells of a table

Record = TypeVar("Record")
Arrays = Sequence[NDArray[Any]]


def packed(record: object) -> dict[str, str | FloatArray]:
    """The cells "record", JSON in which an array is its number, and "numbers", the arrays one after another.

    Parameters
    ----------
    record : dataclass
        Its fields are text, numbers, None, arrays, other such dataclasses, and tuples, frozen sets of text and
        mappings from text of these. An array that several fields hold is kept once.
    """
    places: dict[int, tuple[int, NDArray[Any]]] = {}
    content = _content(record, places)
    arrays = [array for _, array in places.values()]
    about = [(array.dtype.str, array.shape) for array in arrays]
    numbers = np.concatenate([np.zeros(0), *map(_numbers, arrays)])
    return {"record": json.dumps({"content": content, "arrays": about}), "numbers": numbers}


def unpacked(kind: type[Record], cells: Mapping[str, Any]) -> Record:
    """The record of this class whose cells `packed` returned.

    Raises
    ------
    ValueError, LookupError, TypeError
        The cells are those of another class, or damaged.
    """
    text = json.loads(cells["record"])
    about = [(np.dtype(name), tuple(shape)) for name, shape in text["arrays"]]
    edges = np.cumsum([0, *(int(np.prod(shape)) * (1 + (dtype.kind == "c")) for dtype, shape in about)])
    numbers = np.asarray(cells["numbers"], np.float64)
    if numbers.size != edges[-1]:
        raise ValueError(f"holds {numbers.size} of {edges[-1]} numbers")
    parts = [numbers[start:end] for start, end in pairwise(edges.tolist())]
    arrays = [_array(part, *one) for part, one in zip(parts, about, strict=True)]
    record: Record = _value(kind, text["content"], arrays)
    return record


def _content(value: Any, places: dict[int, tuple[int, NDArray[Any]]]) -> Any:
    """A value as JSON holds it, with the place of an array in its stead: `places` has place and array by the id."""
    if isinstance(value, np.ndarray):
        return places.setdefault(id(value), (len(places), value))[0]
    if is_dataclass(value):
        return {field.name: _content(getattr(value, field.name), places) for field in fields(value)}
    if isinstance(value, Mapping):
        return {name: _content(one, places) for name, one in value.items()}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple | list):
        return [_content(one, places) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _numbers(array: NDArray[Any]) -> FloatArray:
    """All numbers of an array in C order; a complex one as its two parts. Integers are exact up to 2^53."""
    flat = array.ravel()
    return flat.view(np.float64) if flat.dtype.kind == "c" else flat.astype(np.float64)


def _array(numbers: FloatArray, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return (numbers.view(dtype) if dtype.kind == "c" else numbers.astype(dtype)).reshape(shape)


def _value(kind: Any, content: Any, arrays: Arrays) -> Any:
    """The value of this type, as the fields of records name types."""
    kinds, origin = get_args(kind), get_origin(kind)
    origin = get_origin(getattr(origin, "__value__", None)) or origin  # since numpy 2.5 NDArray is a named type
    if content is None or kind is Any:
        return content
    if NoneType in kinds:
        return _value(next(one for one in kinds if one is not NoneType), content, arrays)
    if np.ndarray in (kind, origin):
        return arrays[content]
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: _value(hints[name], one, arrays) for name, one in content.items()})  # type: ignore[operator]
    if origin is tuple:
        each = kinds[:1] * len(content) if kinds[-1] is Ellipsis else kinds
        return tuple(_value(one, part, arrays) for one, part in zip(each, content, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {name: _value(kinds[1], one, arrays) for name, one in content.items()}
    return frozenset(content) if origin is frozenset else content


# Scores of recordings


PART_RECORDINGS = 16  # in a part of the rows: each holds beats and curves of all its clips


@dataclass(frozen=True)
class RecordingOptions:
    """Settings that the scores of a recording depend on.

    Parameters
    ----------
    beats : "annotated" or "tracked"
    window : float, seconds; None for whole recordings
    dances : names; recordings of others are not scored, of none when empty
    other_music : bool, True where the clips will be scored with other music
    judged : bool, False leaves the verdicts out
    """

    beats: str
    window: float | None
    dances: tuple[str, ...]
    other_music: bool = False
    judged: bool = True


@dataclass(frozen=True, eq=False)
class RecordingScores:
    """A recording scored with its own music.

    Parameters
    ----------
    dance : str
    clips : its ScoredClips; none where its dance is not asked for
    verdict : RecordingVerdict, None where it is left out
    """

    dance: str
    clips: tuple[ScoredClip, ...] = ()
    verdict: RecordingVerdict | None = None


@dataclass(frozen=True)
class RecordingTask:
    """A folder to be scored, and its number in the corpus."""

    number: int
    folder: Path

    @property
    def key(self) -> str:
        """Its name in a table of the corpus."""
        return f"{self.number:07d} {self.folder}"

    @property
    def stamp(self) -> str:
        """A text that changes with its files."""
        return input_stamp(self.folder)


@dataclass(frozen=True)
class Processes:
    """The processes that score recordings, and the folder of their rows.

    Parameters
    ----------
    jobs, scheduler, resume, force : as in `run_rows`
    out : folder; None: a temporary one, and none at all where this process scores
    """

    jobs: int = 0
    scheduler: str = ""
    out: Path | None = None
    resume: bool = False
    force: bool = False

    @property
    def is_this_one(self) -> bool:
        """True where no row has to be kept or sent."""
        return not (self.jobs or self.scheduler or self.out)

    def below(self, name: str) -> "Processes":
        """The same for another corpus, with its rows in a folder of this name inside `out`."""
        return self if self.out is None else replace(self, out=self.out / name)


THIS_PROCESS = Processes()


def recording_scores(recording: recordings.Recording, options: RecordingOptions) -> RecordingScores:
    """The clips of a recording with their own music, and its verdict."""
    check_kind(recording, recordings.Recording)
    dance = recording.clip.dance
    if options.dances and dance not in options.dances:
        return RecordingScores(dance)
    clips = cut_clips(recording, options.beats, options.window)
    verdict = recording_verdict(recording, options.beats, clips) if options.judged else None
    scored = (scored_clip(clip, other_music=options.other_music) for clip in clips)
    return RecordingScores(dance, tuple(scored), verdict)


def folder_scores(folder: Path, options: RecordingOptions) -> RecordingScores | Problem:
    """`recording_scores` of a folder, or the reason why there are none."""
    try:
        return recording_scores(load_recording(folder), options)
    except (ValueError, FileNotFoundError) as error:
        return Problem(folder, str(error))


def recording_row(task: RecordingTask, options: RecordingOptions) -> dict[str, Any]:
    """The scores of a folder as cells: "problem", text, or those of `packed`."""
    scores = folder_scores(task.folder, options)
    return {"problem": scores.message} if isinstance(scores, Problem) else {"problem": "", **packed(scores)}


def corpus_scores(
    corpus: Corpus, options: RecordingOptions, processes: Processes, *, progress: Progress, report: ProblemReport
) -> Iterator[RecordingScores]:
    """The scores of all recordings of a corpus, in the order of their folders.

    Recordings in the place of a folder are scored in this process, and their errors are raised.

    Raises
    ------
    FileNotFoundError, ValueError
        As `corpus_recordings` and `run_rows`.
    """
    if not isinstance(corpus, str | os.PathLike):
        if not processes.is_this_one:
            raise ValueError("jobs, scheduler and out are for a folder of recordings; these are in memory")
        yield from (recording_scores(one, options) for one in corpus)
        return
    complete, dances = recording_folders(corpus), set()
    items: Iterator[RecordingScores | Problem]
    if processes.is_this_one:
        items = (folder_scores(folder, options) for folder in progress(complete.folders, Path(corpus).name))
    else:
        items = _engine_scores(complete.folders, options, processes, progress)
    for problem in complete.problems:
        report(problem)
    for item in items:
        if isinstance(item, Problem):
            report(item)
        else:
            dances.add(item.dance)
            if item.clips:
                yield item
    check_dances(corpus, options.dances, dances)


def _engine_scores(
    paths: tuple[Path, ...], options: RecordingOptions, processes: Processes, progress: Progress
) -> Iterator[RecordingScores | Problem]:
    """Scores or problem of every folder, measured by the engine."""
    tasks = [RecordingTask(number, path) for number, path in enumerate(paths)]
    with nullcontext(processes.out) if processes.out else tempfile.TemporaryDirectory() as out:
        frames = run_rows(
            tasks, partial(recording_row, options=options), out, jobs=processes.jobs, scheduler=processes.scheduler,
            resume=processes.resume, force=processes.force, settings=plain(options),
            stamp=attrgetter("stamp"), part_rows=PART_RECORDINGS, progress=progress,
        )  # fmt: skip
        remaining = iter(paths)
        for number, frame in enumerate(frames):
            with reading(part_path(Path(out), number), "rows of a comparison"):
                items = [_item(next(remaining), row) for row in frame.to_dict("records")]
            yield from items


def _item(folder: Path, row: Mapping[Any, Any]) -> RecordingScores | Problem:
    """The scores or the problem in a row of the engine."""
    if row[ERROR] or row["problem"]:
        return Problem(folder, f"{folder}: {row[ERROR]}" if row[ERROR] else row["problem"])
    return unpacked(RecordingScores, row)
