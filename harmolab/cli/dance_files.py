"""The files of a dance: their names, checked before any work, and what is written to each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harmolab.cli.common import PAGES, VIDEOS_OUT, check_out, check_pages, check_place
from harmolab.cli.screen import note, progress

if TYPE_CHECKING:
    from harmolab.cli.dance_report import DanceReport
    from harmolab.types import Audio

SUFFIXES = (*VIDEOS_OUT, ".html", ".bvh", ".npz")
UNASKED = (".html", ".mp4", ".bvh")  # where nothing is asked for
LONGEST_NAME = 200  # bytes: file systems take 255, and a file that is being written has a longer name


def dance_files(out: Path | None, song: Path, seed: int, samples: int) -> dict[int, list[Path]]:
    """Seed -> its files: `out`, or a page, a video and a BVH named after the song in the working folder.

    Raises
    ------
    ValueError
        For a name that cannot be written or is of no kind that is known.
    """
    paths = files_to_write(out, song, "dance", UNASKED)
    if samples == 1:
        return {seed: paths}
    numbers = range(seed, seed + samples)
    return {number: [path.with_name(f"{path.stem}_{number}{path.suffix}") for path in paths] for number in numbers}


def files_to_write(out: Path | None, song: Path, noun: str, unasked: Sequence[str]) -> list[Path]:
    """`out`, or without it files of the `unasked` kinds, named after the song and a noun; errors as `dance_files`."""
    if out is not None:
        check_out(out, f"a {noun}", SUFFIXES)
        return [out]
    if len(song.stem.encode()) > LONGEST_NAME:
        raise ValueError(f"{song}: its name is too long to add to; choose one with --out")
    paths = [Path(f"{song.stem}_{noun}{suffix}") for suffix in unasked]
    for path in paths:
        check_place(path)
    return paths


def write_files(paths: list[Path], report: DanceReport, sound: Audio, title: str, *, is_asked: bool) -> list[Path]:
    """Write a dance with its part of the sound to files, as `written`."""
    return written(paths, lambda path: _writer(path)(path, report, sound, title), is_asked=is_asked)


def written(paths: Iterable[Path], write: Callable[[Path], None], *, is_asked: bool) -> list[Path]:
    """The paths of files that `write` could write.

    Raises
    ------
    ValueError
        For a file that cannot be made, if it was asked for; else a note says that it is left out, and why.
    """
    done = []
    for path in paths:
        try:
            write(path)
        except ValueError as error:
            if is_asked:
                raise
            note(f"left out: {path}: {error}")
        else:
            done.append(path)
    return done


def _writer(path: Path) -> Callable[[Path, DanceReport, Audio, str], None]:
    """The function that writes the kind of file that a name asks for."""
    suffix = path.suffix.lower()
    if suffix in PAGES:
        return _write_page
    return _write_video if suffix in VIDEOS_OUT else _write_motion


def _write_motion(path: Path, report: DanceReport, sound: Audio, title: str) -> None:
    from harmolab.io.motion import save_motion

    save_motion(path, report.motion, offset=report.start)


def _write_page(path: Path, report: DanceReport, sound: Audio, title: str) -> None:
    """A page that plays the dance, with everything that is known about it."""
    check_pages(str(path))
    from harmolab.lab.widgets.player import Dancer, Player

    part = sound.span(report.start, report.motion.duration)
    dancer = Dancer("generated", report.motion, report.score, instead=report.caption)
    facts = report.facts | ({"to note": " ".join(report.notes)} if report.notes else {})
    Player(part, [dancer], music=report.music, title=title, facts=facts).save(path)


def _write_video(path: Path, report: DanceReport, sound: Audio, title: str) -> None:
    from harmolab.lab.render.video import write_dance
    from harmolab.types import Clip

    part = sound.span(report.start, report.motion.duration)
    write_dance(path, Clip(title, part, report.motion, beats=report.music), score=report.score, progress=progress)
