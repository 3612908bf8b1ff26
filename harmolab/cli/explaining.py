"""`harmolab explain`: how a dance goes with its song, in words, and on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer

from harmolab import __version__
from harmolab.cli.common import PAGES, CountBar, check_out, plain_errors

if TYPE_CHECKING:
    from harmolab.own_dance import OwnDance, Recording
    from harmolab.params import HarmonyParams

__all__ = ["explain"]


class _Wishes(TypedDict):
    """What `harmolab.own_dance.explain_recording` is told."""

    offset: float | None
    guess: float | None
    search: float
    dance: str
    params: HarmonyParams


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
    from harmolab.params import HarmonyParams
    from harmolab.pattern import load_pattern

    with plain_errors():
        if out is not None:
            check_out(out, "the page", PAGES)
        params = HarmonyParams.recommended(load_pattern(pattern, dance) if pattern else None)
        wishes = _Wishes(offset=offset, guess=guess, search=search, dance=dance, params=params)
        told = _told(song, _read(dance_file, fps, joints), beats, wishes)
        if out is not None:
            from harmolab.own_dance.page import save_page

            save_page(out, told)
    if as_json:
        typer.echo(json.dumps({**told.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([told.verdict, "", str(told.placement), *told.words.sentences]))
    if out is not None:
        typer.echo(f"wrote {out}")


def _read(path: Path, fps: float | None, joints: str) -> Recording:
    """The recording, with a count of pictures where it is a video."""
    from harmolab.own_dance import load_recording

    names = tuple(name.strip() for name in joints.split(",") if name.strip()) or None
    bar = CountBar("reading the pictures")
    try:
        return load_recording(path, fps=fps, joints=names, progress=lambda done: bar(done, 0))
    finally:
        bar.bar.close()


def _told(song: Path, recording: Recording, beats: Path | None, wishes: _Wishes) -> OwnDance:
    """The recording beside its song, with the annotated beats where a file of them is named."""
    from rich.console import Console

    from harmolab.io.beats import load_annotation
    from harmolab.io.video_sound import load_sound
    from harmolab.own_dance import explain_recording

    track = None if beats is None else load_annotation(beats).track(load_sound(song).duration)
    with Console(stderr=True).status("listening (the first time on a machine: half a minute)"):
        return explain_recording(song, recording, beats=track, **wishes)
