"""`harmolab explain`: how a dance, or a musician's hands, go with the sound, in words and on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.common import AsJson, Dance, FileOptions, JudgeOptions, Song, is_told, with_options
from harmolab.cli.screen import is_verbose, plain_errors, progress, waiting, wrote
from harmolab.cli.sources import Sources, note_music, sources, video_performance

if TYPE_CHECKING:
    from harmolab.lab.explain.performance import OwnDance
    from harmolab.musician.explain import ExplainedPlaying
    from harmolab.params import HarmonyParams

FOR_DANCES = ("guess", "search", "dance", "beats", "one", "pattern", "scale", "joints", "smpl", "up")


@with_options
def explain(
    context: typer.Context,
    song: Song,
    motion: Dance = None,
    out: Path | None = None,
    offset: float | None = None,
    guess: float | None = None,
    search: float = 2.0,
    *,
    judged: JudgeOptions,
    read: FileOptions,
    instrument: Annotated[Literal["piano", "violin"] | None, typer.Option(show_default=False)] = None,
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

    Parameters
    ----------
    out : Also write a page, .html, with pictures and player.
    offset : Audio time in seconds at which the motion begins (default: what its file says, else searched for).
    guess : About where it begins, where only the movement can tell (default: 0).
    search : How many seconds from the guess to look, to either side.
    instrument : DANCE is a musician's playing instead: key points of body and hands, or the folder of a performance.
    """
    with plain_errors():
        common.check_out(out, "the page", common.PAGES)
        result: OwnDance | ExplainedPlaying
        if instrument is None:
            files = sources(context, song, motion, judged)
            result = _dance(files, judged.params(files.dance), read, offset=offset, guess=guess, search=search)
        else:
            result = _playing(context, song, motion, instrument, offset=offset, fps=read.fps)
        if out is not None:
            _save(out, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([*result.summary, *(result.details if is_verbose() else ())]))
    wrote(out)


def _dance(files: Sources, params: HarmonyParams, read: FileOptions, **place: Any) -> OwnDance:
    """A dance beside its song; `place` are offset, guess and search of `explain_performance`."""
    from harmolab.lab.explain.performance import explain_performance, load_performance

    performance = video_performance(files.motion) if files.is_video else load_performance(
        files.motion, report=common.note_assumptions, progress=progress, **read.keywords
    )  # fmt: skip
    with waiting("listening"):
        result = explain_performance(
            files.song, performance, beats=files.beats, one=files.one, dance=files.dance, params=params, **place
        )
    note_music(result.skipped + result.motion.duration, performance.motion.duration, files.song)
    return result


def _playing(
    context: typer.Context, song: Path, points: Path | None, instrument: str, **options: Any
) -> ExplainedPlaying:
    """A musician's hands beside the sound; options as of `load_playing`."""
    from harmolab.musician.explain import explain_playing
    from harmolab.musician.performances import load_playing
    from harmolab.readers.audio import load_sound

    if points is None:
        raise ValueError(f"{song}: --instrument takes SONG and the playing, key points or the folder of a performance")
    if dancing := [name for name in FOR_DANCES if is_told(context, name)]:
        raise ValueError(f"--{dancing[0]} is for dances; leave it out with --instrument")
    with waiting("listening"):
        audio = load_sound(song, sample_rate=None)
        return explain_playing(load_playing(points, audio, instrument=instrument, **options))


def _save(out: Path, result: OwnDance | ExplainedPlaying) -> None:
    """Write the page about a dance or a playing."""
    from harmolab.lab.explain.page import save_page
    from harmolab.lab.explain.performance import OwnDance
    from harmolab.musician.page import save_playing_page

    if isinstance(result, OwnDance):
        save_page(out, result)
    else:
        save_playing_page(out, result)
