"""Checks that every command makes of its options before it runs: finite numbers, and files that stay as they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from harmolab.cli.screen import Quiet, Verbose, detail, plain_errors, quiet_decoders, refuse, said_level
from harmolab.io import files

OUTPUTS = ("out", "plot", "clicks", "csv")  # parameters that name what a command writes; every other path is read
FOLDERS = ("train", "report")  # commands whose output is a folder that they look into themselves
FORCE = "--force"


class CheckedCommand(TyperCommand):
    """A command that ends with one line for a number that is not finite, or for an output that is worth keeping.

    An output is worth keeping where it is an input or, without `FORCE`, a file that harmolab did not write.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self.params += options_of(_said)
        writes = any(one.name in OUTPUTS and one.param_type_name == "option" for one in self.params)
        if writes and self.name not in FOLDERS and not any(FORCE in one.opts for one in self.params):
            self.params += options_of(_forced)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The remaining arguments; ends with one line for a value that an option does not take."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            if type(error) is not typer.BadParameter:  # an argument is missing: the usage says more
                raise
            refuse(error.format_message().replace("Value error, ", ""))

    def invoke(self, ctx: Any) -> Any:
        """Result of the command."""
        with said_level(ctx), quiet_decoders():
            detail(f"{ctx.command_path}: {_settings(ctx)}")
            with plain_errors():
                check_numbers(ctx)
                for name in OUTPUTS:
                    for out in _paths(ctx.params.get(name)):
                        check_output(ctx, out)
            return super().invoke(ctx)


def _keep(context: typer.Context, value: bool) -> None:
    """Keeps the option with the call, since the function of a command does not get it."""
    context.meta[FORCE] = value


def _forced(
    _: Annotated[
        bool,
        typer.Option(FORCE, help="Write over files that harmolab did not write.", callback=_keep, expose_value=False),
    ] = False,
) -> None:
    """A command that has the option alone, from which others take it."""


def _said(quiet: Quiet = False, verbose: Verbose = False) -> None:
    """A command that has these options alone, from which others take them."""


def options_of(function: Callable[..., None]) -> list[Any]:
    """The options of a command."""
    app = typer.Typer(add_completion=False)
    app.command()(function)
    return [one for one in typer.main.get_command(app).params if one.name != "help"]


def _settings(context: typer.Context) -> str:
    """Names and values of all parameters of a call, those that were told apart from the others."""
    values = {name: value for name, value in context.params.items() if value not in (None, "", [], ())}
    explicit, usual = (
        ", ".join(f"{name} {value}" for name, value in values.items() if is_told(context, name) is is_explicit)
        for is_explicit in (True, False)
    )
    return f"{explicit or 'no options'}; by default {usual or 'nothing'}"


def check_numbers(context: typer.Context) -> None:
    """ValueError for the first option that is NaN or infinite; it names the option."""
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{parameter.opts[0]} must be a finite number, got {value}")


def check_output(context: typer.Context, out: Path) -> None:
    """ValueError where writing `out` would replace what the command reads or, without `FORCE`, a file of others."""
    read = [path for name, value in context.params.items() if name not in OUTPUTS for path in _paths(value)]
    files.check_output(out, read)
    if context.meta.get(FORCE) is False and out.is_file() and not files.is_own_file(out):
        raise ValueError(
            f"{out}: is there already, and not of harmolab; choose another name, or replace it with {FORCE}"
        )


def check_folder(context: typer.Context, folder: Path, names: Container[str]) -> None:
    """ValueError where a folder to be filled holds more than `names`; with `FORCE` it may."""
    held = sorted(path.name for path in folder.iterdir() if path.name not in names) if folder.is_dir() else []
    if held and not context.meta.get(FORCE):
        raise ValueError(f"{folder}: holds {held[0]}, which is not of harmolab; name an empty or a new folder")


def is_told(context: typer.Context, name: str) -> bool:
    """True where a parameter stands on the command line."""
    return getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"


def _paths(value: Any) -> Iterator[Path]:
    """The paths that a parameter holds: one, several or none."""
    yield from (path for path in (value if isinstance(value, list | tuple) else [value]) if isinstance(path, Path))
