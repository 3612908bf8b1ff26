"""`harmolab lab`: sliders of the score on a dance of one's own, as a page; `harmolab app`: a page that takes files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import harmolab
from harmolab.cli import common
from harmolab.cli.playing import open_page
from harmolab.cli.screen import note, waiting, wrote
from harmolab.cli.sources import check_signs, clip_of, sources
from harmolab.files import SOUNDS

if TYPE_CHECKING:
    from harmolab.lab.app import AppServer, Work

# The app: a page of this machine's own for those who want no terminal


def app(
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open")] = False,
) -> None:
    """Drop a video, or a movement and a song, on a page in the browser: are you in time? With player and sliders.

    Only this machine can open the page, and nothing leaves this machine. Files may have up to 1 GB. They are kept in a
    temporary folder that is removed when the command ends.

    Example: `harmolab app`

    Parameters
    ----------
    port : Port of the local page; 0: any free one.
    no_open : Print the address only.
    """
    common.serve(new_server(port), no_open, "then all files of the page are gone")


def new_server(port: int = 0) -> AppServer:
    """The page, with the work that is done here and the files that are read."""
    from harmolab.lab.app import AppServer
    from harmolab.readers.video import SUFFIXES

    endings = {"dance": (*SUFFIXES, *common.MOTIONS), "song": (*SOUNDS, *SUFFIXES)}
    return AppServer(work, endings, tuple(harmolab.DANCES), port=port)


def work() -> Work:
    """The work of the page's worker; imported there, since it takes seconds."""
    from harmolab.cli.app_work import work

    return work


@common.with_options
def lab(
    context: typer.Context,
    song: common.Song,
    motion: common.Dance = None,
    out: Path | None = None,
    *,
    part: common.PartOptions,
    no_open: Annotated[bool, typer.Option("--no-open")] = False,
    judged: common.JudgeOptions,
    read: common.FileOptions,
) -> None:
    """Sliders for λ1, λ2, T_delay, β and lag on your own dance: a page that shows what each does to the score.

    Without --seconds the page shows the first minute of the dance. It opens with the verdict of `harmolab score` on
    this part. The paper scores in another way: it counts the beats that are met. The button "the paper's" changes to
    this way, in which all sliders count. A mark below a slider is the paper's value. The page needs no network and no
    Python.

    Example: `harmolab lab song.mp3 dance.bvh --offset 12.4 --out lab.html`

    Example: `harmolab lab phone_video.mp4`

    Parameters
    ----------
    out : The page to write, .html (default: DANCE_lab.html in this folder).
    no_open : Write the page, and do not open it.
    """

    from harmolab.lab.labs.one_clip import scoring_lab
    from harmolab.lab.player_data import LONGEST

    files = sources(context, song, motion, judged)
    out = out or Path(f"{common.plain_name(files.motion)}_lab.html")
    common.check_out(out, "the lab", common.PAGES)
    common.check_output(context, out)
    params = judged.params(files.dance)
    clip = clip_of(files, offset=part.offset, **read.keywords)
    begin = max(clip.offset, 0.0) if part.start is None else part.start
    length = common.OF_LAB if part.seconds is None else part.seconds
    if not 0 < length <= LONGEST:
        fault = "is too much" if length > 0 else "must be positive"
        raise ValueError(f"--seconds {fault}, got {length:g}; a lab shows {LONGEST:g} at most")
    if begin >= clip.audio.duration:
        raise ValueError(f"--start {begin:g}: {files.song} ends at {clip.audio.duration:.1f} s")
    is_cut = part.start is None and part.seconds is None
    name = common.dance_title(files.motion, files.song) + (common.of_lab(clip.shared()) if is_cut else "")
    clip = clip.span(begin, min(length, clip.audio.duration - begin))
    if files.is_video:
        check_signs(files, clip, [harmolab.score_clip(clip, params)])
    if not clip.has_start:
        note("nothing says where in the song this dance begins; here it begins with the song: --offset says otherwise")
    with waiting("making the lab"):
        scoring_lab(clip, pattern=params.pattern, name=name, mode="recommended").save(out)
    wrote(out)
    if not no_open:
        open_page(out)
