"""`harmolab compare` and `harmolab learn`: scores over a corpus."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harmolab.cli.common import (
    AsJson,
    Force,
    Jobs,
    Resume,
    Scheduler,
    check_out,
    left_out,
    names_in,
    processes,
    show,
)
from harmolab.cli.screen import plain_errors, progress

if TYPE_CHECKING:
    from rich.table import Table


class Null(StrEnum):
    """Kind of wrong music."""

    lagged = "lagged"
    other = "other"


class Source(StrEnum):
    """Which beats the music has."""

    annotated = "annotated"
    tracked = "tracked"


def compare(
    corpus: Annotated[Path, typer.Argument(help="Folder of recordings (Tang 2018 layout, or ours).")],
    window: Annotated[float, typer.Option(help="Seconds a window; 0 judges whole recordings.", min=0.0)] = 6.0,
    null: Annotated[Null, typer.Option(help="Wrong music: the same 0.3-0.7 beat late, or other songs.")] = Null.lagged,
    beats: Annotated[
        Source | None, typer.Option(help="Music beats (default: annotated where every recording has a beats.json).")
    ] = None,
    fit_on: Annotated[Path | None, typer.Option(help="Fit patterns and lags on this corpus instead.")] = None,
    dances: Annotated[str, typer.Option(help="Only these dances, such as cha-cha,rumba.")] = "",
    rotations: Annotated[int, typer.Option(help="Null corpora behind each chance band.", min=20)] = 400,
    seed: Annotated[int, typer.Option(help="Seed of rotations and resampling.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder that keeps what is measured of each recording, for --resume.")
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    resume: Resume = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Which score tells true music from wrong?

    The AUC of every score over a folder of recordings: 0.5 is a coin, 1 tells every time. An AUC inside its chance
    band tells nothing. Whatever a score fits is fitted on figures that the judged window does not dance, and for the
    band anew on music that begins anywhere. The row "discriminant" is trained on lagged music itself, and stands in no
    verdict. Below stands how many whole recordings get each verdict of `harmolab score`; --json has them one by one.

    Example: `harmolab data synth demo --clips 70 && harmolab compare demo`

    Example of a large corpus, called again after it was cut off: `harmolab compare demo --out rows --resume`
    """
    from harmolab.corpora.files import check_dances, corpus_dances
    from harmolab.lab.compare.auc import compare as run
    from harmolab.lab.compare.rows import Processes

    with plain_errors():
        if resume and out is None:
            raise ValueError("--resume goes on with the rows in a folder; name it by --out")
        if names := names_in(dances):
            check_dances(corpus, names, corpus_dances(corpus))
        result = run(
            corpus, dances=names, window=window or None, null=null.value, fit_on=fit_on,
            beats=beats.value if beats else None, n_rotations=rotations, seed=seed, progress=progress, report=left_out,
            processes=Processes(processes(jobs), scheduler, out, resume, force),
        )  # fmt: skip
    if as_json:
        typer.echo(json.dumps(result.summary, indent=2))
    else:
        print_comparison(result.summary)


def print_comparison(summary: dict[str, Any]) -> None:
    """Two tables: one row a score, and how many recordings reach each level of the verdict."""
    from rich.console import Console
    from rich.table import Table

    title = f"{summary['corpus']}: {summary['n']} windows, {summary['beats']} beats, {summary['null']} music"
    table = Table(title=title)
    table.add_column("score", no_wrap=True)
    for heading in ("AUC", "interval", "chance band", "tells?"):
        table.add_column(heading)
    dances = sorted({dance for row in summary["scores"].values() for dance in row["by_dance"]})
    for dance in dances:
        table.add_column(dance)
    for name, row in summary["scores"].items():
        low, high = row["chance_band"]
        tells = "yes" if row["auc"] > high else "below" if row["auc"] < low else "no"
        own = [show(row["by_dance"].get(dance, {}).get("auc")) for dance in dances]
        table.add_row(name, show(row["auc"]), show(row["interval"]), show(row["chance_band"]), tells, *own)
    Console().print(table)
    typer.echo(f"fitted on: {summary['fitted_on']}")
    if summary["unfitted_parts"]:
        typer.echo(f"{summary['unfitted_parts']} of {summary['n_parts']} clips had nothing to fit a pattern on")
    beside = summary["discriminant"]
    counts = [f"{beside['lags_found'][name]} of {summary['n_sequences']}" for name in ("recommended", "discriminant")]
    typer.echo(
        "discriminant: trained on the very kind of music that judges it, the same 0.3-0.7 beat late, so never in a "
        f"verdict; AUC {beside['auc_difference']:+.3f} [{show(beside['interval'])}] over the learnt curve "
        f"(recommended); finds the lag within 1/8 beat in {counts[1]} recordings, the learnt curve in {counts[0]}"
    )
    Console().print(_level_table(summary["levels"]))
    typer.echo("lagged: the music 0.3-0.7 beat late; learnt: by a curve of other figures, for recordings that have one")


def _level_table(levels: dict[str, list[int]]) -> Table:
    """A table of the number of whole recordings that reach each level."""
    from rich.table import Table

    from harmolab.verdict.judge import LEVELS

    table = Table("music", *(f"{level} {name}" for level, name in enumerate(LEVELS)), title="recordings by verdict")
    for music, counts in levels.items():
        table.add_row(music, *map(str, counts))
    return table


def learn(
    corpus: Annotated[Path, typer.Argument(help="Folder of recordings with beats.json.")],
    out: Annotated[Path, typer.Option(help="Where to write the patterns (JSON).")],
) -> None:
    """Learn each dance's bar pattern, for `harmolab score --pattern`.

    Example: `harmolab learn recordings --out patterns.json`
    """
    from harmolab.bar_pattern import save_patterns
    from harmolab.lab.compare.windows import dance_patterns

    with plain_errors():
        check_out(out, "a file of patterns", (".json",))
        patterns = dance_patterns(corpus, progress=progress, report=left_out)
        save_patterns(out, patterns)
    for name, pattern in patterns.items():
        typer.echo(f"{name or 'unknown dance'}: {pattern.beats} beats, learnt on {pattern.source}")
    example = next(iter(patterns))
    typer.echo(f"use them: harmolab score SONG DANCE --pattern {out}" + (f" --dance {example}" if example else ""))
