"""`harmolab score --why`: how a dance, or a musician's hands, go with the sound, in words and on one page."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from harmolab import __version__
from harmolab.cli import common
from harmolab.cli.common import FileOptions, JudgeOptions, first_told
from harmolab.cli.screen import is_verbose, progress, waiting, wrote
from harmolab.cli.sources import Sources, note_music, sources, video_performance

if TYPE_CHECKING:
    from harmolab.lab.explain.performance import OwnDance
    from harmolab.musician.explain import ExplainedPlaying
    from harmolab.params import HarmonyParams

FOR_DANCES = ("guess", "search", "dance", "beats", "one", "pattern", "scale", "joints", "smpl", "up")
WITHOUT_PAGE = ("seconds", "mode", "lag", "clock", "csv", "plot", "others")  # options of a score that no page has
WITH_PAGE = ("guess", "search", "instrument")


@dataclass(frozen=True)
class PageOptions:
    """Options of the page that says why.

    Parameters
    ----------
    why : Also write a page, .html, that shows why: pictures, beats, player. Where the dance begins in the song is then
        found by comparing a video's sound with the song; without that sound from the movement, up to whole beats, and
        then nothing is said about its place in the beat.
    guess : With --why: about where it begins, where only the movement can tell (default: 0).
    search : With --why: how many seconds from the guess to look, to either side.
    instrument : With --why: DANCE is a musician's playing, key points of body and hands, or the folder of a
        performance: do the hands meet the notes?
    """

    why: Path | None = None
    guess: float | None = None
    search: float = 2.0
    instrument: Annotated[Literal["piano", "violin"] | None, typer.Option(show_default=False)] = None


def check_options(context: typer.Context, page: PageOptions) -> None:
    """ValueError for an option that goes without a page only, or with one only."""
    if wrong := first_told(context, WITH_PAGE if page.why is None else WITHOUT_PAGE):
        raise ValueError(f"{wrong} goes {'with --why PAGE.html only' if page.why is None else 'without --why'}")


def explain(
    context: typer.Context,
    song: Path,
    motion: Path | None,
    page: PageOptions,
    judged: JudgeOptions,
    read: FileOptions,
    *,
    offset: float | None,
    as_json: bool,
) -> None:
    """Write the page that says how a dance, or a playing, goes with its song, and print its first lines."""
    common.check_out(page.why, "the page", common.PAGES)
    result: OwnDance | ExplainedPlaying
    if page.instrument is None:
        files, place = sources(context, song, motion, judged), {"guess": page.guess, "search": page.search}
        result = _dance(files, judged.params(files.dance), read, offset=offset, **place)
    else:
        result = _playing(context, song, motion, page.instrument, offset=offset, fps=read.fps)
    if page.why is not None:
        _save(page.why, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
        return
    typer.echo("\n".join([*result.summary, *(result.details if is_verbose() else ())]))
    wrote(page.why)


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
    if dancing := first_told(context, FOR_DANCES):
        raise ValueError(f"{dancing} is for dances; leave it out with --instrument")
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
