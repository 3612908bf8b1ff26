"""`harmolab explain`: how a dance goes with its song, in words, and on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab import __version__
from harmolab.cli.common import PAGES, check_out, plain_errors, progress

if TYPE_CHECKING:
    from harmolab.lab.timing.performance import Performance


def explain(
    song: Annotated[
        Path, typer.Argument(help="The music: wav, flac, ogg, mp3; or a video, for its sound (the same video, too).")
    ],
    dance_file: Annotated[
        Path,
        typer.Argument(
            metavar="DANCE",
            help="A video, or a motion: npz, npy, bvh, AIST++ pkl, key points of a pose estimator (json, or a folder "
            "of OpenPose), a Tang 2018 folder.",
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Also write a page, .html, with pictures and player.")] = None,
    offset: Annotated[
        float | None,
        typer.Option(help="Song time in seconds at which the dance begins. Left out, it is found."),
    ] = None,
    guess: Annotated[
        float | None, typer.Option(help="About where it begins, where only the movement can tell (default: 0).")
    ] = None,
    search: Annotated[float, typer.Option(help="How many seconds from the guess to look, to either side.")] = 2.0,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo (waltz, ...).")] = "",
    beats: Annotated[
        Path | None, typer.Option(help="Beat annotation (.beats, csv, beats.json) in place of beat tracking.")
    ] = None,
    pattern: Annotated[
        Path | None,
        typer.Option(help="Bar patterns learnt by `harmolab learn`, for dancers who do not rest on the beat."),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, key points).")
    ] = None,
    joints: Annotated[
        str, typer.Option(help="Keep these joints only, as in: left_wrist,right_wrist (a camera that sees no legs).")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say how a dance goes with its song: together or not, early or late, and how sure that is.

    Where the dance begins in the song is found by comparing the video's sound with the song; without that sound from
    the movement, up to whole beats, and then nothing is said about being early or late throughout.

    Example: `harmolab explain song.mp3 phone_video.mp4 --out dance.html`

    The song plays in the video and you have no other copy: `harmolab explain video.mp4 video.mp4 --out dance.html`
    """
    from rich.console import Console

    from harmolab.bar_pattern import load_pattern
    from harmolab.io.beats import load_annotation
    from harmolab.lab.timing.performance import explain_performance
    from harmolab.params import HarmonyParams

    with plain_errors():
        if out is not None:
            check_out(out, "the page", PAGES)
        params = HarmonyParams.recommended(load_pattern(pattern, dance) if pattern else None)
        performance = _load(dance_file, fps, joints)
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
        typer.echo(f"wrote {out}")


def _load(path: Path, fps: float | None, joints: str) -> Performance:
    """The performance in a file, with a count of pictures on standard error where it is a video."""
    from harmolab.lab.timing.performance import load_performance

    names = tuple(name.strip() for name in joints.split(",") if name.strip()) or None
    return load_performance(path, fps=fps, joints=names, progress=progress)
