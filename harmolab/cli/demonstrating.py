"""`harmolab demo`: a first page to look at, without any file."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.screen import note, plain_errors, waiting, wrote

NEXT = (
    "What next?",
    "  harmolab dance SONG.mp3                      a dance to a song of yours",
    "  harmolab explain VIDEO.mp4 --out page.html   your own dance: are you in time?",
)


def demo(
    out: Annotated[Path, typer.Option(help="The page to write, .html.")] = Path("harmolab_demo.html"),
    no_open: Annotated[bool, typer.Option("--no-open", help="Write the page, and do not open it.")] = False,
) -> None:
    """See what harmolab does: a page with a dancer who meets the beats, and the same one late. Needs no files.

    The song is synthetic; the movement was recorded (CMU, salsa) and comes with harmolab.

    Example: `harmolab demo`
    """
    with plain_errors():
        common.check_out(out, "the page", common.PAGES)
        with waiting("making the page"):
            from harmolab.lab.widgets import demo as pages

            page = pages.demo()
            page.player.save(out)
    typer.echo("A page with two dancers, who are one: recorded salsa, laid on the beats of a synthetic song.")
    for name, score in (("left, in time", page.in_time), (f"right, {page.late:.2f} s late", page.delayed)):
        met = f"{int((score.pairs >= 0).sum())} of {score.n_audio} beats met"
        verdict = "" if score.judgement is None else score.judgement.verdict
        typer.echo(f"  {name}: {met}, harmony above chance {score.above_chance:.2f}. {verdict}")
    typer.echo("Press play on the page; the lamps flash on the beats of the music and of the dancer.")
    wrote(out)
    typer.echo("\n".join(NEXT))
    if not no_open and not webbrowser.open(out.resolve().as_uri()):
        note(f"no browser could be opened; open {out.resolve()} in one")
