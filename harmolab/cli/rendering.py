"""`harmolab play` of a video: a motion and its music as a film that plays anywhere, or as a moving picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import FileOptions, PartOptions
from harmolab.cli.screen import note, progress
from harmolab.cli.sources import Sources, check_signs, clip_of

if TYPE_CHECKING:
    from harmolab.params import HarmonyParams
    from harmolab.score import HarmonyScore
    from harmolab.types import Clip
    from harmolab.verdict.judge import Judgement

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
    marks : Video: marks that light up on beats: of the music, of the dancer, met (green), missed (red).
    verdict : Video: the verdict on the whole dance, below in the picture.
    follow : Video: keep the hips in the middle of the picture.
    height : Video: pixels; the width is 4/3 of it, or the film's (never enlarged).
    rate : Video: pictures a second, 30 (12.5 of a gif), or those of the film.
    """

    over: Path | None = None
    marks: bool = True
    verdict: bool = True
    follow: Annotated[bool, typer.Option("--follow")] = False
    height: Annotated[int | None, typer.Option(min=120, max=2160, show_default="480; 240 of a gif")] = None
    rate: Annotated[float | None, typer.Option(min=10, max=120)] = None


def render(
    files: Sources, out: Path, video: VideoOptions, params: HarmonyParams, read: FileOptions, part: PartOptions
) -> None:
    """Write the video, and print the verdict on the whole dance, of which it may show a part."""
    from harmolab.lab.explain.filmed import points_in_video
    from harmolab.lab.render.overlay import load_points
    from harmolab.lab.render.video import write_dance
    from harmolab.verdict.judge import score_clip

    is_gif, over = out.suffix.lower() == GIF, video.over or (files.motion if files.is_video else None)
    if over is not None and (is_gif or part.start is not None):
        raise ValueError(f"{over}: {NO_GIF if is_gif else NO_START}")
    seconds = GIF_SECONDS if is_gif and part.seconds is None else part.seconds
    if seconds is not None and seconds <= 0:
        raise ValueError(f"seconds must be positive and finite, got {seconds:g}")
    reading, points = read.keywords, None
    if over is not None and not files.is_video:
        points = load_points(files.motion, fps=read.fps, joints=reading["joints"], report=common.note_assumptions)
    clip = clip_of(files, offset=part.offset, track=video.marks, sample_rate=None, movement=points, **reading)
    in_video = points_in_video(files.motion) if files.is_video else None
    score = score_clip(clip, params) if video.marks else None
    judgement = _judgement(files, clip, score)
    excerpt, begin = _part(clip, part.start, seconds)
    write_dance(
        out, excerpt, over=over, points=in_video, marks=video.marks, rate=video.rate or (GIF_RATE if is_gif else None),
        height=video.height or (GIF_HEIGHT if is_gif else HEIGHT), follow=video.follow, score=score, begin=begin,
        verdict=judgement.verdict if judgement and video.verdict else "", progress=progress,
    )  # fmt: skip
    common.print_verdict(judgement)
    if score is not None:
        common.print_music(score.music)


def _judgement(files: Sources, clip: Clip, score: HarmonyScore | None) -> Judgement | None:
    """The judgement of a score; none, and a note, where a video was read too poorly for one."""
    if score is None:
        return None
    try:
        check_signs(files, clip, [score])
    except ValueError as error:  # the video is written all the same
        note(str(error))
        return None
    return score.judgement


def _part(clip: Clip, start: float | None, seconds: float | None) -> tuple[Clip, float]:
    """The part of a clip that is drawn, and where its first frame lies on the time line of the whole clip's score."""
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to show")
    scored = max(clip.offset + clip.shared_frame() / clip.motion.fps, 0.0)  # audio time at which the score begins
    if start is not None:
        part = clip.span(start, seconds or clip.audio.duration - start)
        return part, start + part.offset - scored
    motion = clip.motion if seconds is None else clip.motion.span(0.0, seconds)
    return replace(clip, motion=motion), clip.offset - scored
