"""`harmolab explain`: how a dance, or a musician's hands, go with the sound, in words and on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.checks import is_told
from harmolab.cli.common import (
    AsJson,
    Beats,
    Dance,
    DanceName,
    Fps,
    HowDanced,
    Joints,
    One,
    PatternFile,
    Scale,
    Smpl,
    Song,
    Up,
)
from harmolab.cli.screen import is_verbose, plain_errors, progress, refuse, waiting, wrote
from harmolab.cli.sources import note_music, sources, video_performance

FOR_DANCES = ("guess", "search", "dance", "beats", "one", "pattern", "scale", "joints", "smpl", "up")


def explain(
    context: typer.Context,
    song: Song,
    motion: Dance = None,
    out: Annotated[Path | None, typer.Option(help="Also write a page, .html, with pictures and player.")] = None,
    offset: Annotated[
        float | None,
        typer.Option(
            help="Audio time in seconds at which the motion begins (default: what its file says, else searched for)."
        ),
    ] = None,
    guess: Annotated[
        float | None, typer.Option(help="About where it begins, where only the movement can tell (default: 0).")
    ] = None,
    search: Annotated[float, typer.Option(help="How many seconds from the guess to look, to either side.")] = 2.0,
    dance: DanceName = "",
    beats: Beats = None,
    one: One = None,
    pattern: PatternFile = None,
    how: HowDanced = None,
    fps: Fps = None,
    scale: Scale = None,
    joints: Joints = "",
    smpl: Smpl = None,
    up: Up = None,
    instrument: Annotated[
        Literal["piano", "violin"] | None,
        typer.Option(
            help="DANCE is a musician's playing instead: key points of body and hands, or the folder of a performance.",
            show_default=False,
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say how a dance goes with its song: whether it is in time, where in the beat, and how steady that is.

    The first line is the verdict, the same as that of `harmolab score`; --verbose and the page of --out say more. Early
    and late are spoken of only where it was told what is danced (--dance) or meant (--how).

    Where the dance begins in the song is found by comparing the video's sound with the song; without that sound from
    the movement, up to whole beats, and then nothing is said about its place in the beat.

    Example: `harmolab explain song.mp3 phone_video.mp4 --out dance.html`

    For a video whose own sound is the only copy of the song: `harmolab explain video.mp4 --out dance.html`

    For the folder of a recording: `harmolab explain recordings/DANCE_W_3 --out dance.html`

    **A pianist or violinist**: do the hands meet the notes, and where do they part?

    `harmolab explain take/audio.wav take/points.json --instrument piano --out playing.html`
    """
    if instrument is not None:
        if motion is None:
            refuse(f"{song}: --instrument takes SONG and the playing, key points or the folder of a performance")
        _explain_playing(context, song, motion, instrument, out=out, offset=offset, fps=fps, as_json=as_json)
        return
    from harmolab.lab.timing.performance import explain_performance, load_performance

    with plain_errors():
        if out is not None:
            common.check_out(out, "the page", common.PAGES)
        files = sources(context, song, motion, beats=beats, one=one, dance=dance)
        params = common.recommended(pattern, files.dance, how)
        performance = video_performance(files.motion) if files.is_video else load_performance(
            files.motion, fps=fps, scale=scale, joints=common.names_in(joints) or None, smpl=smpl, up=up or "",
            report=common.note_assumptions, progress=progress,
        )  # fmt: skip
        with waiting("listening"):
            result = explain_performance(
                files.song,
                performance,
                offset=offset,
                guess=guess,
                search=search,
                beats=files.beats,
                one=one,
                dance=files.dance,
                params=params,
            )
        note_music(result.skipped + result.motion.duration, performance.motion.duration, files.song)
        if out is not None:
            from harmolab.lab.timing.page import save_page

            save_page(out, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([result.verdict, *result.remarks, str(result.placement)]))
    if is_verbose():
        common.print_music(result.music)
        typer.echo("\n".join([*result.judgement.details, *result.words.sentences]))
    if out is not None:
        wrote(out)


def _explain_playing(
    context: typer.Context,
    song: Path,
    points: Path,
    instrument: str,
    *,
    out: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """The same for a musician's hands; options as of `load_playing`."""
    from harmolab.corpora.performances import load_playing
    from harmolab.io.video_sound import load_sound
    from harmolab.lab.timing.playing import explain_playing

    with plain_errors():
        if out is not None:
            common.check_out(out, "the page", common.PAGES)
        if dancing := [name for name in FOR_DANCES if is_told(context, name)]:
            raise ValueError(f"--{dancing[0]} is for dances; leave it out with --instrument")
        with waiting("listening"):
            audio = load_sound(song, sample_rate=None)
            result = explain_playing(load_playing(points, audio, instrument=instrument, **options))
        if out is not None:
            from harmolab.lab.timing.playing_page import save_playing_page

            save_playing_page(out, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([result.words.verdict, *result.words.sentences]))
    if out is not None:
        wrote(out)
