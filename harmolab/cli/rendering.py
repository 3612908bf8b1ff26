"""`harmolab render`: a motion and its music as a video that plays anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import (
    Beats,
    Dance,
    DanceName,
    Fps,
    Joints,
    Offset,
    One,
    PatternFile,
    Scale,
    Seconds,
    Smpl,
    Song,
    Up,
    show,
)


def render(
    song: Song,
    motion: Dance,
    out: Annotated[Path, typer.Option(help="The video to write: .mp4 (plays everywhere) or .webm.")],
    over: Annotated[
        Path | None, typer.Option(help="Draw the skeleton over this video, in which the points were found.")
    ] = None,
    offset: Offset = None,
    seconds: Seconds = None,
    marks: Annotated[
        bool, typer.Option(help="Marks that light up on beats: of the music, of the dancer, hits.")
    ] = True,
    follow: Annotated[bool, typer.Option("--follow", help="Keep the hips in the middle of the picture.")] = False,
    dance: DanceName = "",
    beats: Beats = None,
    one: One = None,
    pattern: PatternFile = None,
    height: Annotated[
        int, typer.Option(help="Pixels; the width is 4/3 of it, or the video's (never enlarged).", min=120, max=2160)
    ] = 480,
    rate: Annotated[
        float | None, typer.Option(help="Pictures a second: 30, or those of the video.", min=10, max=120)
    ] = None,
    fps: Fps = None,
    scale: Scale = None,
    joints: Joints = "",
    smpl: Smpl = None,
    up: Up = None,
) -> None:
    """Write a video of a motion with its music: a person on a floor, or a skeleton over the dancer's own video.

    With marks, the verdict and the number of `harmolab score` are printed too; the marks are rests of the body, or hits
    where it hits the beats.

    Examples:

    `harmolab render song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.mp4`

    `harmolab render take.mp4 keypoints/ --fps 25 --over take.mp4 --out checked.webm`
    """
    from harmolab.corpora.files import load_clip
    from harmolab.harmony import score_clip
    from harmolab.lab.render.overlay import load_points
    from harmolab.lab.render.video import write_dance

    names = common.names_in(joints) or None
    with common.plain_errors():
        common.check_out(out, "a video", common.VIDEOS_OUT)
        params = common.recommended(pattern, dance)
        report = common.note_assumptions
        movement = load_points(motion, fps=fps, joints=names, report=report) if over else motion
        with common.finding_beats():
            clip = load_clip(
                song, movement, offset=offset, seconds=seconds, dance=dance, beats=beats, one=one, track=marks, fps=fps,
                scale=scale, joints=names, smpl=smpl, up=up or "", sample_rate=None, report=report,
            )  # fmt: skip
        write_dance(
            out, clip, over=over, marks=marks, rate=rate, height=height, follow=follow, params=params,
            progress=common.progress,
        )  # fmt: skip
        score = score_clip(clip, params) if marks else None
    if score is not None:
        common.print_verdict(score.judgement)
        common.print_music(score.music)
        typer.echo(f"harmony above chance {show(score.above_chance)}, p {show(score.p_value)}")
    common.wrote(out)
