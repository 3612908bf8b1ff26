"""`harmolab play`: a motion and its music as one page that plays anywhere."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from harmolab.cli import common
from harmolab.cli.common import (
    Beats,
    Dance,
    DanceName,
    Fps,
    Offset,
    One,
    PatternFile,
    Scale,
    Seconds,
    Smpl,
    Song,
    Start,
    Up,
)

GENERIC = ("audio", "skeletons")  # files of a corpus, which the name of their folder tells apart


def play(
    song: Song,
    motion: Dance,
    out: Annotated[Path, typer.Option(help="The page to write, .html.")],
    other: Annotated[Path | None, typer.Option(help="A second motion to the same music, shown beside it.")] = None,
    offset: Offset = None,
    other_offset: Annotated[
        float | None,
        typer.Option(help="Audio time at which the second begins (default: what its file says, else --offset)."),
    ] = None,
    start: Start = None,
    seconds: Seconds = None,
    dance: DanceName = "",
    beats: Beats = None,
    one: One = None,
    pattern: PatternFile = None,
    fps: Fps = None,
    scale: Scale = None,
    smpl: Smpl = None,
    up: Up = None,
) -> None:
    """Write a page that plays a motion to its music: beats, hits and misses on a time line, slow motion, loops, clicks.

    Below the picture stand the verdict and the number of what is shown, the same as those of `harmolab score`. The
    marks are rests of the body, or hits where it hits the beats, within a tenth of a second of the music.

    Example: `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`
    """
    from harmolab.corpora.files import load_clip
    from harmolab.corpora.folders import load_any_motion, recorded_offset
    from harmolab.lab.widgets.player import player_of

    with common.plain_errors():
        common.check_out(out, "the player", common.PAGES)
        params = common.recommended(pattern, dance)
        reading: dict[str, Any] = {
            "fps": fps, "scale": scale, "smpl": smpl, "up": up or "", "report": common.note_assumptions
        }  # fmt: skip
        with common.finding_beats():
            clip = load_clip(
                song, motion, offset=offset, dance=dance, beats=beats, one=one, sample_rate=None, **reading
            )
        clips = [clip]
        if other is not None:
            begins = next((time for time in (other_offset, recorded_offset(other)) if time is not None), clip.offset)
            movement, name = load_any_motion(other, **reading), other.stem or other.name
            clips.append(replace(clip, name=name, motion=movement, offset=begins))
        command = (
            "" if start is not None else shlex.join(_video_command(song, motion, out, clip.offset, seconds, dance))
        )
        title = f"{_plain_name(motion)} to {_plain_name(song)}"
        player_of(clips, start=start, seconds=seconds, title=title, params=params, command=command).save(out)
    common.wrote(out)


def _plain_name(path: Path) -> str:
    """The name of a file, or of its folder where all of a kind are called so, such as audio.mp3 of a corpus."""
    return path.resolve().parent.name if path.stem in GENERIC else path.stem or path.name


def _video_command(song: Path, motion: Path, out: Path, offset: float, seconds: float | None, dance: str) -> str:
    """The line of a shell that writes the same dance as a video."""
    numbers = {"--offset": offset, "--seconds": seconds or 0.0}
    options = {name: f"{value:g}" for name, value in numbers.items() if value} | ({"--dance": dance} if dance else {})
    words = [word for option in options.items() for word in option]
    return shlex.join(["harmolab", "render", str(song), str(motion), *words, "--out", str(out.with_suffix(".mp4"))])
