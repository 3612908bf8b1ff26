"""`harmolab play`: a motion and its music as one page that plays anywhere."""

from __future__ import annotations

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
from harmolab.cli.naming import dance_title, video_command


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
        command = video_command(song, motion, out, dance, offset=offset, start=start, seconds=seconds)
        title = dance_title(motion, song)
        player_of(clips, start=start, seconds=seconds, title=title, params=params, command=command).save(out)
    common.wrote(out)
