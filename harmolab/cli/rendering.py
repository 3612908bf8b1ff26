"""`harmolab render`: a motion and its music as a video that plays anywhere, or as a moving picture."""

from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import Dance, FileOptions, JudgeOptions, Offset, Seconds, Song, Start, with_options
from harmolab.cli.screen import note, plain_errors, progress, wrote
from harmolab.cli.sources import check_signs, clip_of, note_lengths, sources

GIF = ".gif"
GIF_SECONDS, GIF_HEIGHT, GIF_RATE = 5.0, 240, 12.5  # unless asked for otherwise: some hundred kilobytes
HEIGHT = 480
NO_GIF = "a video has more colours than a gif; choose a name that ends in .mp4 or .webm"
NO_START = "a video is drawn from its first picture on; leave out --start"


@with_options
def render(
    context: typer.Context,
    song: Song,
    out: Annotated[Path, typer.Option()],
    motion: Dance = None,
    over: Path | None = None,
    offset: Offset = None,
    start: Start = None,
    seconds: Seconds = None,
    marks: bool = True,
    follow: Annotated[bool, typer.Option("--follow")] = False,
    *,
    judged: JudgeOptions,
    height: Annotated[int | None, typer.Option(min=120, max=2160, show_default="480; 240 of a gif")] = None,
    rate: Annotated[float | None, typer.Option(min=10, max=120)] = None,
    read: FileOptions,
) -> None:
    """Write a video of a motion with its music: a person on a floor, or a skeleton over the dancer's own video.

    With marks, the verdict and the number of `harmolab score` are printed too; the marks are rests of the body, or hits
    where it hits the beats. A video alone gets the marks, and a
    skeleton where `harmolab pose` finds the body.

    Examples:

    `harmolab render song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.mp4`

    `harmolab render recordings/DANCE_W_3 --start 20 --out dance.gif`

    `harmolab render phone_video.mp4 --out marked.mp4`

    `harmolab render take.mp4 keypoints/ --fps 25 --over take.mp4 --out checked.webm`

    Parameters
    ----------
    out : The video to write: .mp4 (plays everywhere) or .webm; or .gif, for a README: without sound, 5 s unless
        --seconds says otherwise.
    over : Draw the skeleton over this video, in which the points were found.
    marks : Marks that light up on beats: of the music, of the dancer, hits.
    follow : Keep the hips in the middle of the picture.
    height : Pixels; the width is 4/3 of it, or the video's (never enlarged).
    rate : Pictures a second: 30 (12.5 of a gif), or those of the video.
    """
    from harmolab.lab.explain.filmed import points_in_video
    from harmolab.lab.render.overlay import load_points
    from harmolab.lab.render.video import write_dance
    from harmolab.verdict.judge import score_clip

    is_gif = out.suffix.lower() == GIF
    with plain_errors():
        common.check_out(out, "a video", (*common.VIDEOS_OUT, GIF))
        files = sources(context, song, motion, judged)
        over = over or (files.motion if files.is_video else None)
        if over is not None and (is_gif or start is not None):
            raise ValueError(f"{over}: {NO_GIF if is_gif else NO_START}")
        params = judged.params(files.dance)
        seconds = GIF_SECONDS if is_gif and seconds is None else seconds
        reading, points = read.keywords, None
        if over is not None and not files.is_video:
            points = load_points(files.motion, fps=read.fps, joints=reading["joints"], report=common.note_assumptions)
        clip = clip_of(
            files, offset=offset, seconds=seconds if start is None else None, track=marks, sample_rate=None,
            movement=points, **reading,
        )  # fmt: skip
        note_lengths(clip, files.song)
        in_video = points_in_video(files.motion) if files.is_video else None
        if start is not None:
            clip = clip.span(start, seconds or clip.audio.duration - start)
        write_dance(
            out, clip, over=over, points=in_video, marks=marks, rate=rate or (GIF_RATE if is_gif else None),
            height=height or (GIF_HEIGHT if is_gif else HEIGHT), follow=follow, params=params, progress=progress,
        )  # fmt: skip
        score = score_clip(clip, params) if marks else None
    if score is not None:
        try:
            check_signs(files, clip, [score])
            common.print_verdict(score.judgement)
        except ValueError as error:  # the video is written all the same
            note(str(error))
        common.print_music(score.music)
    wrote(out)
