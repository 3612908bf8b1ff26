"""`harmolab lab`: the sliders of the score on a dance of one's own, as a page."""

from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.playing import open_page
from harmolab.cli.screen import note, plain_errors, waiting, wrote
from harmolab.cli.sources import check_signs, clip_of, sources

LONGEST = 60.0  # seconds of a dance unless asked for more: the picture of a minute can still be read


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

    The page opens with the sentence of harmolab score. The paper counts beats that are met instead: its button makes
    the sliders move, and a mark below each is the paper's value. The page asks for no network and no Python. Without
    --seconds it shows the first minute.

    Example: `harmolab lab song.mp3 dance.bvh --offset 12.4 --out lab.html`

    Example: `harmolab lab phone_video.mp4`

    Parameters
    ----------
    out : The page to write, .html (default: DANCE_lab.html in this folder).
    no_open : Write the page, and do not open it.
    """
    from harmolab.lab.labs.one_clip import scoring_lab
    from harmolab.verdict.judge import score_clip

    with plain_errors():
        files = sources(context, song, motion, judged)
        out = out or Path(f"{common.plain_name(files.motion)}_lab.html")
        common.check_out(out, "the lab", common.PAGES)
        common.check_output(context, out)
        params = judged.params(files.dance)
        clip = clip_of(files, offset=part.offset, **read.keywords)
        begin = max(clip.offset, 0.0) if part.start is None else part.start
        clip = clip.span(begin, min(part.seconds or LONGEST, clip.audio.duration - begin))
        if files.is_video:
            check_signs(files, clip, [score_clip(clip, params)])
        if not clip.has_start:
            note("nothing says where in the song this dance begins; here it begins with it: --offset says otherwise")
        with waiting("making the lab"):
            scoring_lab(clip, pattern=params.pattern, mode="recommended").save(out)
    wrote(out)
    if not no_open:
        open_page(out)
