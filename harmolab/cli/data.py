"""`harmolab data`: what files hold, and a synthetic corpus."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli.checks import CheckedCommand
from harmolab.cli.common import (
    AsJson,
    show,
)
from harmolab.cli.screen import plain_errors, printable, progress

data_app = typer.Typer(no_args_is_help=True, help="Look at what files hold, or make a synthetic corpus.")


@data_app.command("check", cls=CheckedCommand)
def data_check(
    path: Annotated[Path, typer.Argument(help="A file, a sequence folder or a corpus.")],
    as_json: AsJson = False,
) -> None:
    """Contents of a file or corpus, and what is odd about it.

    Example: `harmolab data check dance.bvh`
    """
    from rich.console import Console
    from rich.table import Table

    from harmolab.corpora.check import check

    with plain_errors():
        findings = check(path)
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
        return
    table = Table("what", "kind", "frames", "rate", "joints", "seconds", "offset", "note", title=str(path))
    for finding in findings:
        numbers = (finding.frames, finding.rate, finding.joints, finding.seconds, finding.offset)
        table.add_row(_short(finding.path, path), finding.kind, *map(show, numbers), finding.note)
    console = Console()
    console.print(table)
    for finding in findings:
        for word, sentences in (("read", finding.how), ("odd", finding.odd)):
            for sentence in sentences:
                line = printable(f"{word}: {_short(finding.path, path)}: {sentence}")
                console.print(line, markup=False, highlight=False)


def _short(name: str, root: Path) -> str:
    """A path as seen from what was asked about."""
    return Path(name).name if name == str(root) else os.path.relpath(name, root)


@data_app.command("synth", cls=CheckedCommand)
def data_synth(
    out: Annotated[Path, typer.Argument(help="New folder for the corpus.")],
    clips: Annotated[int, typer.Option(help="Number of clips; the seven dances take turns.", min=1)] = 200,
    seconds: Annotated[float, typer.Option(help="Length of a clip.")] = 6.0,
    fps: Annotated[float, typer.Option(help="Frame rate of the motion.")] = 60.0,
    noise: Annotated[float, typer.Option(help="Sensor noise on every joint and axis, metres.")] = 0.0,
    jitter: Annotated[float, typer.Option(help="Standard deviation of each movement's end, seconds.")] = 0.0,
    lateness: Annotated[float, typer.Option(help="How late every movement ends, seconds.")] = 0.0,
    omission: Annotated[float, typer.Option(help="Share of beats without a movement's end.")] = 0.0,
    redundancy: Annotated[float, typer.Option(help="Share of beats with an extra end after them.")] = 0.0,
    drift: Annotated[float, typer.Option(help="Tempo change over the clip, as a share.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Same seed, same corpus.")] = 1,
) -> None:
    """Make music and dance whose beats were planted, as ordinary files (wav, npz, beats.json).

    A run that was cut off goes on where it stopped.

    Example: `harmolab data synth demo --clips 14 --seconds 20`
    """
    from harmolab.corpora.synthetic import write_corpus

    with plain_errors():
        write_corpus(
            out, clips=clips, seconds=seconds, fps=fps, noise=noise, jitter=jitter, lateness=lateness,
            omission=omission, redundancy=redundancy, drift=drift, seed=seed,
            progress=progress,
        )  # fmt: skip
    typer.echo(f"{clips} clips in {out}")
