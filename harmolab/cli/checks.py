"""Checks that every command makes of its options before it runs: finite numbers, and files that stay as they are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from harmolab.cli.common import plain_errors
from harmolab.io.files import check_output

OUTPUTS = ("out", "plot", "clicks")  # parameters that name what a command writes; every other path is read


class CheckedCommand(TyperCommand):
    """A command that ends with one line for a number that is not finite, or for an output that is an input."""

    def invoke(self, ctx: Any) -> Any:
        """Result of the command."""
        with plain_errors():
            check_numbers(ctx)
            for name in OUTPUTS:
                for out in _paths(ctx.params.get(name)):
                    check_unread(ctx, out)
        return super().invoke(ctx)


def check_numbers(context: typer.Context) -> None:
    """ValueError for the first option that is NaN or infinite; it names the option."""
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{parameter.opts[0]} must be a finite number, got {value}")


def check_unread(context: typer.Context, out: Path) -> None:
    """ValueError where writing `out` would replace what the command reads."""
    check_output(out, [path for name, value in context.params.items() if name not in OUTPUTS for path in _paths(value)])


def is_told(context: typer.Context, name: str) -> bool:
    """True where a parameter stands on the command line."""
    return getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"


def _paths(value: Any) -> Iterator[Path]:
    """The paths that a parameter holds: one, several or none."""
    yield from (path for path in (value if isinstance(value, list | tuple) else [value]) if isinstance(path, Path))
