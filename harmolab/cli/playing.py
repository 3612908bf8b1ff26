"""`harmolab play`: a motion and its music as one page that plays anywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import Beats, Dance, DanceName, Fps, Offset, Scale, Seconds, Song, Start


def play(
    song: Song,
    motion: Dance,
    out: Annotated[Path, typer.Option(help="The page to write, .html.")],
    other: Annotated[Path | None, typer.Option(help="A second motion to the same music, shown beside it.")] = None,
    offset: Offset = None,
    start: Start = None,
    seconds: Seconds = None,
    dance: DanceName = "",
    beats: Beats = None,
    fps: Fps = None,
    scale: Scale = None,
) -> None:
    """Write a page that plays a motion to its music: beats, hits and misses on a time line, slow motion, loops, clicks.

    Example: `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`
    """
    from harmolab.corpora.files import load_clip
    from harmolab.corpora.folders import load_any_motion
    from harmolab.lab.widgets.player import player_of

    with common.plain_errors():
        common.check_out(out, "the player", common.PAGES)
        with common.finding_beats():
            clip = load_clip(
                song, motion, offset=offset, dance=dance, beats=beats, fps=fps, scale=scale, sample_rate=None
            )
        clips = [clip]
        if other is not None:
            clips.append(
                replace(clip, name=other.stem or other.name, motion=load_any_motion(other, fps=fps, scale=scale))
            )
        player_of(clips, start=start, seconds=seconds, title=f"{clip.name} to {song.name}").save(out)
    common.wrote(out)
