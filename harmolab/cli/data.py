"""`harmolab data`: what files hold, and a synthetic corpus."""

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import AsJson, CheckedCommand, FileOptions, print_table, show, with_options
from harmolab.cli.screen import plain_errors, printable, progress, wrote

data_app = typer.Typer(no_args_is_help=True, help="Look at what files hold, or make a synthetic corpus.")


@data_app.command("check", cls=CheckedCommand)
def data_check(
    path: Annotated[Path, typer.Argument(help="A file, a sequence folder or a corpus.")], as_json: AsJson = False
) -> None:
    """Contents of a file or corpus, and what is odd about it.

    Example: `harmolab data check dance.bvh`
    """
    from harmolab.cli.data_check import check

    with plain_errors():
        findings = check(path)
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
        return
    headings = ("what", "kind", "frames", "rate", "joints", "seconds", "offset", "note")
    rows, notes = [], []
    for finding in findings:
        name = _short(finding.path, path)
        numbers = (finding.frames, finding.rate, finding.joints, finding.seconds, finding.offset)
        rows.append((name, finding.kind, *map(show, numbers), finding.note))
        notes += [printable(f"read: {name}: {sentence}") for sentence in finding.how]
        notes += [printable(f"odd: {name}: {sentence}") for sentence in finding.odd]
    print_table(headings, rows, str(path), *notes)


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
    from harmolab.data.synthetic import write_corpus

    with plain_errors():
        write_corpus(
            out, clips=clips, seconds=seconds, fps=fps, noise=noise, jitter=jitter, lateness=lateness,
            omission=omission, redundancy=redundancy, drift=drift, seed=seed,
            progress=progress,
        )  # fmt: skip
    typer.echo(f"{clips} clips in {out}")


# `harmolab convert`: a motion file of any kind to one of ours, or to BVH.


@with_options
def convert(
    motion: Annotated[
        Path,
        typer.Argument(
            metavar="A",
            help="The motion: SMPL parameters (AMASS npz, AIST++ or EDGE pkl, FACT or LODGE npy), joints (npy, json, "
            "pkl, Bailando's jsons_original), HumanML3D npy, c3d, bvh, npz, key points of a pose estimator, or a Tang "
            "2018 folder.",
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="B", help="The file to write, npz or bvh.")],
    *,
    options: FileOptions,
    force: Annotated[bool, typer.Option("--force", help="Write over B where it is there already.")] = False,
) -> None:
    """Turn a motion file of any kind into npz or BVH, in metres with y up, and say what it is and how it was read.

    Example: `harmolab convert EDGE_dance.pkl dance.npz --fps 30`
    """
    from harmolab.data.recordings import read_any_motion, recorded_offset
    from harmolab.readers.motion import save_motion

    with plain_errors():
        common.check_out(out, "a motion", (".npz", ".bvh"))
        if out.exists() and not force:
            raise ValueError(f"{out}: is there already; --force writes over it")
        read = read_any_motion(motion, **options.keywords)
        about = f"converted from {motion.name}: {'; '.join((read.kind, *read.notes))}"
        save_motion(out, read.motion, offset=recorded_offset(motion), about=about)
    frames, count, _ = read.motion.positions.shape
    typer.echo(printable(f"{motion}: {read.kind}, {frames} frames of {count} joints at {read.motion.fps:g} a second"))
    for sentence in read.notes:
        typer.echo(printable(f"read: {sentence}"))
    wrote(out)
