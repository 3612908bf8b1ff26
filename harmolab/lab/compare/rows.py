"""All that a comparison needs of each recording alone: read and scored in this process, or as rows of the engine."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from harmolab.corpora import folders
from harmolab.corpora.files import check_dances, corpus_recordings, recording_folders
from harmolab.corpora.folders import Problem, load_recording
from harmolab.io.files import PathLike, Progress, plain, reading
from harmolab.lab.compare.packing import packed, unpacked
from harmolab.lab.compare.scores import ScoredClip, scored_clip
from harmolab.lab.compare.verdicts import RecordingVerdict, recording_verdict
from harmolab.lab.compare.windows import cut_clips
from harmolab.lab.evaluate.engine import run_rows
from harmolab.lab.evaluate.pairing import input_stamp
from harmolab.lab.evaluate.parts import ERROR, part_path

Corpus = PathLike | Iterable[folders.Recording]

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

    def below(self, name: str) -> Processes:
        """The same for another corpus, with its rows in a folder of this name inside `out`."""
        return self if self.out is None else replace(self, out=self.out / name)


THIS_PROCESS = Processes()


def recording_scores(recording: folders.Recording, options: RecordingOptions) -> RecordingScores:
    """The clips of a recording with their own music, and its verdict."""
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
    corpus: Corpus,
    options: RecordingOptions,
    processes: Processes,
    *,
    progress: Progress,
    report: Callable[[Problem], object],
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
        yield from (recording_scores(one, options) for one in corpus_recordings(corpus, options.dances))
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
