"""`harmolab play` of a video: a motion and its music as a film that plays anywhere, or as a moving picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import FileOptions
from harmolab.cli.screen import note, progress
from harmolab.cli.sources import Sources, check_signs, clip_of, note_lengths

if TYPE_CHECKING:
    from harmolab.params import HarmonyParams

GIF = ".gif"
GIF_SECONDS, GIF_HEIGHT, GIF_RATE = 5.0, 240, 12.5  # unless asked for otherwise: some hundred kilobytes
HEIGHT = 480
NO_GIF = "a video has more colours than a gif; choose a name that ends in .mp4 or .webm"
NO_START = "a video is drawn from its first picture on; leave out --start"


@dataclass(frozen=True)
class VideoOptions:
    """Options of a video.

    Parameters
    ----------
    over : Video: draw the skeleton over this film, in which the points were found.
    marks : Video: marks that light up on beats: of the music, of the dancer, hits.
    follow : Video: keep the hips in the middle of the picture.
    height : Video: pixels; the width is 4/3 of it, or the film's (never enlarged).
    rate : Video: pictures a second, 30 (12.5 of a gif), or those of the film.
    """

    over: Path | None = None
    marks: bool = True
    follow: Annotated[bool, typer.Option("--follow")] = False
    height: Annotated[int | None, typer.Option(min=120, max=2160, show_default="480; 240 of a gif")] = None
    rate: Annotated[float | None, typer.Option(min=10, max=120)] = None


def render(
    files: Sources,
    out: Path,
    video: VideoOptions,
    params: HarmonyParams,
    read: FileOptions,
    *,
    offset: float | None,
    start: float | None,
    seconds: float | None,
) -> None:
    """Write the video, and print the verdict of the dance that it shows."""
    from harmolab.lab.explain.filmed import points_in_video
    from harmolab.lab.render.overlay import load_points
    from harmolab.lab.render.video import write_dance
    from harmolab.verdict.judge import score_clip

    is_gif, over = out.suffix.lower() == GIF, video.over or (files.motion if files.is_video else None)
    if over is not None and (is_gif or start is not None):
        raise ValueError(f"{over}: {NO_GIF if is_gif else NO_START}")
    seconds = GIF_SECONDS if is_gif and seconds is None else seconds
    reading, points = read.keywords, None
    if over is not None and not files.is_video:
        points = load_points(files.motion, fps=read.fps, joints=reading["joints"], report=common.note_assumptions)
    clip = clip_of(
        files, offset=offset, seconds=seconds if start is None else None, track=video.marks, sample_rate=None,
        movement=points, **reading,
    )  # fmt: skip
    note_lengths(clip, files.song)
    in_video = points_in_video(files.motion) if files.is_video else None
    if start is not None:
        clip = clip.span(start, seconds or clip.audio.duration - start)
    write_dance(
        out, clip, over=over, points=in_video, marks=video.marks, rate=video.rate or (GIF_RATE if is_gif else None),
        height=video.height or (GIF_HEIGHT if is_gif else HEIGHT), follow=video.follow, params=params,
        progress=progress,
    )  # fmt: skip
    if not video.marks:
        return
    score = score_clip(clip, params)
    try:
        check_signs(files, clip, [score])
        common.print_verdict(score.judgement)
    except ValueError as error:  # the video is written all the same
        note(str(error))
    common.print_music(score.music)
