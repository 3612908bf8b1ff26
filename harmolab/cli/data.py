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
def data_check(path: Path, as_json: AsJson = False) -> None:
    """Contents of a file or corpus, and what is odd about it.

    The exit code is 1 where something cannot be read, or has a fault for which `harmolab evaluate` leaves it out:
    another unit, another axis, a frame rate below 10, joints of one name, parents in a circle.

    Example: `harmolab data check dance.bvh`

    Parameters
    ----------
    path : A file, a sequence folder or a corpus.
    """
    from harmolab.cli.data_check import check

    with plain_errors():
        findings = check(path)
    is_faulty = any(finding.is_faulty for finding in findings)
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
        raise typer.Exit(int(is_faulty))
    headings = ("what", "kind", "frames", "rate", "joints", "seconds", "offset", "note")
    rows, notes = [], []
    for finding in findings:
        name = _short(finding.path, path)
        numbers = (finding.frames, finding.rate, finding.joints, finding.seconds, finding.offset)
        rows.append((name, finding.kind, *map(show, numbers), finding.note))
        notes += [printable(f"read: {name}: {sentence}") for sentence in finding.how]
        notes += [printable(f"odd: {name}: {sentence}") for sentence in finding.odd]
    print_table(headings, rows, str(path), *notes)
    raise typer.Exit(int(is_faulty))


def _short(name: str, root: Path) -> str:
    """A path as seen from what was asked about."""
    return Path(name).name if name == str(root) else os.path.relpath(name, root)


@data_app.command("synth", cls=CheckedCommand)
def data_synth(
    out: Path,
    clips: Annotated[int, typer.Option(min=1)] = 200,
    seconds: float = 6.0,
    fps: float = 60.0,
    noise: float = 0.0,
    jitter: float = 0.0,
    lateness: float = 0.0,
    omission: float = 0.0,
    redundancy: float = 0.0,
    drift: float = 0.0,
    seed: int = 1,
) -> None:
    """Make music and dance whose beats were planted, as ordinary files (wav, npz, beats.json).

    A run that was cut off goes on where it stopped.

    Example: `harmolab data synth demo --clips 14 --seconds 20`

    Parameters
    ----------
    out : New folder for the corpus.
    clips : Number of clips; the seven dances take turns.
    seconds : Length of a clip.
    fps : Frame rate of the motion.
    noise : Sensor noise on every joint and axis, metres.
    jitter : Standard deviation of each movement's end, seconds.
    lateness : How late every movement ends, seconds.
    omission : Share of beats without a movement's end.
    redundancy : Share of beats with an extra end after them.
    drift : Tempo change over the clip, as a share.
    seed : Same seed, same corpus.
    """
    from harmolab.data.synthetic import write_corpus

    with plain_errors():
        write_corpus(
            out, clips=clips, seconds=seconds, fps=fps, noise=noise, jitter=jitter, lateness=lateness,
            omission=omission, redundancy=redundancy, drift=drift, seed=seed,
            progress=progress,
        )  # fmt: skip
    typer.echo(f"{clips} clips in {out}")


# `harmolab data convert`: a motion file of any kind to one of ours, or to BVH.


@with_options
def convert(
    motion: Annotated[Path, typer.Argument(metavar="A")],
    out: Annotated[Path, typer.Argument(metavar="B")],
    *,
    options: FileOptions,
    force: Annotated[bool, typer.Option("--force")] = False,
) -> None:
    """Turn a motion file of any kind into npz or BVH, in metres with y up, and say what it is and how it was read.

    Example: `harmolab data convert EDGE_dance.pkl dance.npz --fps 30`

    Parameters
    ----------
    motion : The motion: SMPL parameters (AMASS npz, AIST++ or EDGE pkl, FACT or LODGE npy), joints (npy, json, pkl,
        Bailando's jsons_original), HumanML3D npy, c3d, bvh, npz, key points of a pose estimator, or a Tang 2018 folder.
    out : The file to write, npz or bvh.
    force : Write over B where it is there already.
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
