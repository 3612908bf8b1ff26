"""The `harmolab` command. Thin: every command calls one function of the package and prints."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from harmolab import __version__
from harmolab.cli.beats import beats, tap
from harmolab.cli.common import CheckedCommand
from harmolab.cli.dancing import dance
from harmolab.cli.data import convert, data_app
from harmolab.cli.evaluating import compare, evaluate, learn, submit
from harmolab.cli.explaining import explain
from harmolab.cli.performing import perform
from harmolab.cli.playing import demo, play
from harmolab.cli.posing import pose
from harmolab.cli.rendering import render
from harmolab.cli.retiming import retime
from harmolab.cli.scoring import score
from harmolab.cli.screen import Quiet, Verbose, plain_errors
from harmolab.cli.studying import study_app
from harmolab.cli.training import train

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Is this motion in harmony with this music? A number beside its chance level, a picture, a comparison.",
)
PANELS = {
    "Start here": (demo, score, explain, play, dance, render),
    "The music": (beats, tap),
    "Many dances": (evaluate, submit, compare, learn),
    "Movement": (pose, retime, convert),
    "Networks": (train, perform),
}
for panel, commands in PANELS.items():
    for command in commands:
        app.command(cls=CheckedCommand, rich_help_panel=panel)(command)
app.add_typer(study_app, name="study", rich_help_panel="Many dances")
app.add_typer(data_app, name="data", rich_help_panel="Movement")


@app.command(cls=CheckedCommand, rich_help_panel="Many dances")
def report(
    notebooks: Path = Path("notebooks"), out: Path = Path("report"), profile: Literal["quick", "full"] = "quick"
) -> None:
    """Run the notebooks and build the offline HTML report.

    Example: `harmolab report --notebooks notebooks --out report`

    Parameters
    ----------
    notebooks : Folder of notebooks.
    out : Folder to write.
    profile : quick (minutes) or full.
    """
    from harmolab.lab.report.run import TIMEOUTS, build, print_outcome

    with plain_errors():
        result = build(notebooks, out, profile=profile, timeout=TIMEOUTS[profile])
    raise typer.Exit(print_outcome(result))


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
    """Entry point of the console command."""
    app()
