"""`harmolab play`: a motion and its music as one page that plays anywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import (
    Beats,
    Dance,
    DanceName,
    Fps,
    HowDanced,
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
from harmolab.cli.posing import is_body_found
from harmolab.cli.screen import plain_errors, wrote
from harmolab.cli.sources import check_signs, clip_of, note_lengths, sources

VIDEO = (
    "{video}: is a video, of which no body is known to play; `harmolab pose --install` fetches what finds it. Without, "
    "`harmolab explain {video} --out {stem}.html` makes a page about it, `harmolab render {video} --out "
    "{stem}_marked.mp4` marks its beats"
)


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
    how: HowDanced = None,
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
    from harmolab.harmony import score_clip
    from harmolab.lab.widgets.player import player_of

    with plain_errors():
        common.check_out(out, "the player", common.PAGES)
        files = sources(context, song, motion, beats=beats, one=one, dance=dance)
        if files.is_video and not is_body_found(files.motion):
            raise ValueError(VIDEO.format(video=files.motion, stem=files.motion.stem))
        params = common.recommended(pattern, files.dance, how)
        reading = common.reading(fps, scale, smpl, up)
        clip = clip_of(files, offset=offset, seconds=None, one=one, sample_rate=None, **reading)
        note_lengths(clip, files.song)
        if files.is_video:
            begin = clip.offset if start is None else start
            part = clip.span(begin, clip.audio.duration - begin if seconds is None else seconds)
            check_signs(files, part, [score_clip(part, params)])
        clips = [clip]
        if other is not None:
            begins = next((time for time in (other_offset, recorded_offset(other)) if time is not None), clip.offset)
            movement, name = load_any_motion(other, report=common.note_assumptions, **reading), other.stem or other.name
            clips.append(replace(clip, name=name, motion=movement, offset=begins))
        where = {"offset": clip.offset, "start": start, "seconds": seconds}
        command = video_command(files.song, files.motion, out, files.dance, **where)
        title = dance_title(files.motion, files.song)
        player_of(clips, start=start, seconds=seconds, title=title, params=params, command=command).save(out)
    wrote(out)
