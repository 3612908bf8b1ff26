"""`harmolab app`: a page of this machine's own for those who want no terminal."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.screen import plain_errors

if TYPE_CHECKING:
    from harmolab.lab.app import AppServer, Work


def app(
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open")] = False,
) -> None:
    """Drop a video, or a movement and a song, on a page in the browser: are you in time? With player and sliders.

    Only this machine can open the page, and nothing leaves it. Files of up to 1 GB are kept in a temporary folder
    that is gone when the command ends.

    Example: `harmolab app`

    Parameters
    ----------
    port : Port of the local page; 0: any free one.
    no_open : Print the address only.
    """
    for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
        signal.signal(number, signal.default_int_handler)  # as Ctrl-C: the page ends, and its files go
    with plain_errors():
        common.check_pages("harmolab app")
        common.serve(new_server(port), no_open, "then all files of the page are gone")


def new_server(port: int = 0) -> AppServer:
    """The page, with the work that is done here and the files that are read."""
    from harmolab.lab.app import AppServer
    from harmolab.params import DANCES
    from harmolab.readers.video import SUFFIXES

    endings = {"dance": (*SUFFIXES, *common.MOTIONS), "song": (*common.SOUNDS, *SUFFIXES)}
    return AppServer(work, endings, tuple(DANCES), port=port)


def work() -> Work:
    """The work of the page's worker; imported there, since it takes seconds."""
    from harmolab.cli.app_work import work

    return work
