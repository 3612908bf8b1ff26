"""`harmolab explain`: how a dance goes with its song, in words, and on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.common import AsJson, Beats, Dance, DanceName, Fps, Joints, PatternFile, Scale, Song


def explain(
    song: Song,
    motion: Dance,
    out: Annotated[Path | None, typer.Option(help="Also write a page, .html, with pictures and player.")] = None,
    offset: Annotated[
        float | None,
        typer.Option(help="Audio time in seconds at which the motion begins (default: searched for)."),
    ] = None,
    guess: Annotated[
        float | None, typer.Option(help="About where it begins, where only the movement can tell (default: 0).")
    ] = None,
    search: Annotated[float, typer.Option(help="How many seconds from the guess to look, to either side.")] = 2.0,
    dance: DanceName = "",
    beats: Beats = None,
    pattern: PatternFile = None,
    fps: Fps = None,
    scale: Scale = None,
    joints: Joints = "",
    as_json: AsJson = False,
) -> None:
    """Say how a dance goes with its song: together or not, early or late, and how sure that is.

    Where the dance begins in the song is found by comparing the video's sound with the song; without that sound from
    the movement, up to whole beats, and then nothing is said about being early or late throughout.

    Example: `harmolab explain song.mp3 phone_video.mp4 --out dance.html`

    For a video whose own sound is the only copy of the song: `harmolab explain video.mp4 video.mp4 --out dance.html`
    """
    from rich.console import Console

    from harmolab.bar_pattern import load_pattern
    from harmolab.io.beats import load_annotation
    from harmolab.lab.timing.performance import explain_performance, load_performance
    from harmolab.params import HarmonyParams

    with common.plain_errors():
        if out is not None:
            common.check_out(out, "the page", common.PAGES)
        params = HarmonyParams.recommended(load_pattern(pattern, dance) if pattern else None)
        performance = load_performance(
            motion, fps=fps, scale=scale, joints=common.names_in(joints) or None, progress=common.progress
        )
        annotation = None if beats is None else load_annotation(beats)
        with Console(stderr=True).status("listening (the first time on a machine: half a minute)"):
            result = explain_performance(
                song,
                performance,
                offset=offset,
                guess=guess,
                search=search,
                beats=annotation,
                dance=dance,
                params=params,
            )
        if out is not None:
            from harmolab.lab.timing.page import save_page

            save_page(out, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([result.verdict, "", str(result.placement), *result.words.sentences]))
    if out is not None:
        common.wrote(out)
