"""The `harmolab` command. Thin: every command calls one function of the package and prints."""

import io
import os
import signal
import sys
from typing import Annotated

import typer

from harmolab import __version__
from harmolab.cli.beats import beats
from harmolab.cli.common import RENAMED, CheckedCommand, CommandWithParts, moved
from harmolab.cli.dancing import dance
from harmolab.cli.data import convert, data_app, pose
from harmolab.cli.evaluating import compare, evaluate, learn, merge, submit
from harmolab.cli.labs import app as app_page
from harmolab.cli.labs import lab
from harmolab.cli.performing import perform
from harmolab.cli.playing import demo, play
from harmolab.cli.retiming import retime
from harmolab.cli.scoring import score
from harmolab.cli.screen import Quiet, Verbose
from harmolab.cli.studying import study_app
from harmolab.cli.training import train

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Is this motion in harmony with this music? A number beside its chance level, a picture, a comparison.",
)
PANELS = {
    "Start here": (demo, app_page, score, play, lab, dance),
    "The music": (beats,),
    "Movement": (retime,),
    "Networks": (train, perform),
}
for panel, commands in PANELS.items():
    for command in commands:
        app.command(cls=CheckedCommand, rich_help_panel=panel)(command)
of_evaluate = CommandWithParts.of(compare=compare, merge=merge, submit=submit)
app.command(cls=of_evaluate, rich_help_panel="Many dances")(evaluate)
for command in (pose, convert, learn):
    data_app.command(cls=CheckedCommand)(command)
data_app.add_typer(study_app, name="study")
app.add_typer(data_app, name="data", rich_help_panel="Movement")
for name in RENAMED:
    anything = {"ignore_unknown_options": True, "allow_extra_args": True}
    app.command(name, hidden=True, add_help_option=False, context_settings=anything)(moved)


def version(value: bool) -> None:
    """Print the version and leave."""
    if value:
        typer.echo(f"harmolab {__version__}")
        raise typer.Exit


@app.callback()
def common(
    quiet: Quiet = False,
    verbose: Verbose = False,
    _: Annotated[bool, typer.Option("--version", callback=version, is_eager=True, help="Print the version.")] = False,
) -> None:
    """Options of every command."""


def main() -> None:
    """Entry point of the console command; what a signal to end stops removes its half-written files, as Ctrl-C does."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):  # closed ones, as the files 0, 1 and 2
        setattr(sys, name, getattr(sys, name) or open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115, PTH123
    if isinstance(sys.stdout, io.TextIOWrapper):  # a pipe of Windows knows neither λ nor the names of most songs
        sys.stdout.reconfigure(errors="backslashreplace")
    for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
        if signal.getsignal(number) is signal.SIG_DFL:  # nohup ignores it
            signal.signal(number, lambda number, _: sys.exit(128 + number))
    app()
