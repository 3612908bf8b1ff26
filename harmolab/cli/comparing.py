"""`harmolab compare` and `harmolab learn`: scores over a corpus."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from harmolab.cli.common import plain_errors, progress, sequences_of, show, write_text


class Null(StrEnum):
    """What the wrong music is."""

    lagged = "lagged"
    other = "other"


class Beats(StrEnum):
    """Where the music's beats come from."""

    annotated = "annotated"
    tracked = "tracked"


def compare(
    corpus: Annotated[Path, typer.Argument(help="Folder of sequences (Tang 2018 layout, or ours).")],
    window: Annotated[float, typer.Option(help="Seconds a window; 0 judges whole sequences.", min=0.0)] = 6.0,
    null: Annotated[Null, typer.Option(help="Wrong music: the same 0.3-0.7 beat late, or other songs.")] = Null.lagged,
    beats: Annotated[
        Beats | None, typer.Option(help="Music beats (default: annotated where every sequence has a beats.json).")
    ] = None,
    fit_on: Annotated[Path | None, typer.Option(help="Fit patterns and lags on this corpus instead.")] = None,
    dances: Annotated[str, typer.Option(help="Only these dances, such as cha-cha,rumba.")] = "",
    rotations: Annotated[int, typer.Option(help="Random origins behind each chance band.", min=20)] = 1000,
    seed: Annotated[int, typer.Option(help="Seed of rotations and resampling.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Which score tells true music from wrong?

    The AUC of every score over a folder of sequences: 0.5 is a coin, 1 tells every time. An AUC inside its chance
    band tells nothing. Whatever a score fits is fitted on figures that the judged window does not dance.

    Example: `harmolab data synth demo --clips 70 && harmolab compare demo`
    """
    from harmolab.corpus import compare as run

    with plain_errors():
        wanted = tuple(name.strip() for name in dances.split(",") if name.strip())
        source = beats.value if beats else common_beats(corpus, fit_on)
        result = run(
            sequences_of(corpus, wanted),
            corpus=str(corpus),
            window=window or None,
            null=null.value,
            beats=source,  # type: ignore[arg-type]  # one of the two by construction
            fit_on=sequences_of(fit_on, wanted) if fit_on else None,
            n_rotations=rotations,
            seed=seed,
            progress=progress,
        )
    if as_json:
        typer.echo(json.dumps(result.summary, indent=2))
    else:
        print_comparison(result.summary)


def common_beats(*corpora: Path | None) -> str:
    """ "annotated" when every sequence has a beats.json, else "tracked"."""
    from harmolab.data.folders import find_recordings

    folders = [folder for corpus in corpora if corpus for folder in find_recordings(corpus).folders]
    return "annotated" if folders and all((folder / "beats.json").is_file() for folder in folders) else "tracked"


def print_comparison(summary: dict[str, Any]) -> None:
    """A table: one row a score."""
    from rich.console import Console
    from rich.table import Table

    title = f"{summary['corpus']}: {summary['n']} windows, {summary['beats']} beats, {summary['null']} music"
    table = Table("score", "AUC", "interval", "chance band", "tells?", title=title)
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
        typer.echo(f"{summary['unfitted_parts']} of {summary['n_parts']} parts had nothing to fit a pattern on")


def learn(
    corpus: Annotated[Path, typer.Argument(help="Folder of sequences with beats.json.")],
    out: Annotated[Path, typer.Option(help="Where to write the patterns (JSON).")],
) -> None:
    """Learn each dance's bar pattern, for `harmolab score --pattern`."""
    from harmolab.parts import dance_patterns

    with plain_errors():
        patterns = dance_patterns(sequences_of(corpus))
        write_text(out, json.dumps({name: asdict(pattern) for name, pattern in patterns.items()}, indent=2))
    for name, pattern in patterns.items():
        typer.echo(f"{name or 'unknown dance'}: {pattern.beats} beats, learnt on {pattern.source}")
