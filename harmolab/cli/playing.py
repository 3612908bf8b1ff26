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
from harmolab.cli.screen import plain_errors, wrote
from harmolab.cli.sources import Sources, clip_of, note_lengths, sources

VIDEO = (
    "{video}: is a video, of which no body is known to play; `harmolab explain {video} --out {stem}.html` makes a page "
    "about it, `harmolab render {video} --out {stem}_marked.mp4` marks its beats"
)

GENERIC = ("audio", "skeletons")  # files of a corpus, which the name of their folder tells apart


def play(
    context: typer.Context,
    song: Song,
    out: Annotated[Path, typer.Option(help="The page to write, .html.")],
    motion: Dance = None,
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

    Example: `harmolab play recordings/DANCE_W_3 --out dance.html`
    """
    from harmolab.corpora.folders import load_any_motion, recorded_offset
    from harmolab.lab.widgets.player import player_of

    with plain_errors():
        common.check_out(out, "the player", common.PAGES)
        files = sources(context, song, motion, beats=beats, one=one, dance=dance)
        if files.is_video:
            raise ValueError(VIDEO.format(video=files.motion, stem=files.motion.stem))
        params = common.recommended(pattern, files.dance)
        reading: dict[str, Any] = {"fps": fps, "scale": scale, "smpl": smpl, "up": up or ""}
        clip = clip_of(files, offset=offset, seconds=None, one=one, sample_rate=None, **reading)
        note_lengths(clip, files.song)
        clips = [clip]
        if other is not None:
            begins = next((time for time in (other_offset, recorded_offset(other)) if time is not None), clip.offset)
            movement, name = load_any_motion(other, report=common.note_assumptions, **reading), other.stem or other.name
            clips.append(replace(clip, name=name, motion=movement, offset=begins))
        title = f"{_plain_name(files.motion)} to {_plain_name(files.song)}"
        command = "" if start is not None else _video_command(files, out, clip.offset, seconds)
        player_of(clips, start=start, seconds=seconds, title=title, params=params, command=command).save(out)
    wrote(out)


def _plain_name(path: Path) -> str:
    """The name of a file, or of its folder where all of a kind are called so, such as audio.mp3 of a corpus."""
    return path.resolve().parent.name if path.stem in GENERIC else path.stem or path.name


def _video_command(files: Sources, out: Path, offset: float, seconds: float | None) -> str:
    """The line of a shell that writes the same dance as a video."""
    numbers = {"--offset": offset, "--seconds": seconds or 0.0}
    options = {name: f"{value:g}" for name, value in numbers.items() if value}
    options |= {"--dance": files.dance} if files.dance else {}
    words = [word for option in options.items() for word in option]
    video = str(out.with_suffix(".mp4"))
    return shlex.join(["harmolab", "render", str(files.song), str(files.motion), *words, "--out", video])
