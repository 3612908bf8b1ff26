"""Titles of pages, and the line of the shell that writes a page's dance as a video."""

from __future__ import annotations

import shlex
from pathlib import Path

FOLDER_NAMES = ("audio", "skeletons")  # files of a corpus, which the name of their folder tells apart


def plain_name(path: Path) -> str:
    """The name of a file, or of its folder where all files of a kind are called the same.

    >>> plain_name(Path("song.mp3")), plain_name(Path("corpus/DANCE_W_1/audio.mp3"))
    ('song', 'DANCE_W_1')
    """
    return (path.resolve().parent.name if path.stem in FOLDER_NAMES else path.stem) or path.name


def dance_title(motion: Path, song: Path) -> str:
    """The title of a page: the dance to the song, or one name for both."""
    return " to ".join(dict.fromkeys((plain_name(motion), plain_name(song))))


def video_command(song: Path, motion: Path, out: Path, dance: str, **seconds: float | None) -> str:
    """The line that writes the same as a video beside the page `out`; `seconds` are options that hold seconds.

    >>> video_command(Path("a song.mp3"), Path("x.bvh"), Path("x.html"), "waltz", offset=12.4, start=None)
    "harmolab render 'a song.mp3' x.bvh --offset 12.4 --dance waltz --out x.mp4"
    """
    words = [word for name, value in seconds.items() if value is not None for word in (f"--{name}", f"{value:g}")]
    words += ["--dance", dance] if dance else []
    return shlex.join(["harmolab", "render", str(song), str(motion), *words, "--out", str(out.with_suffix(".mp4"))])
