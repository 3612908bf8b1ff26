"""`harmolab convert`: a motion file of any kind to one of ours, or to BVH."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import Fps, Joints, Scale, Smpl, Up
from harmolab.cli.screen import plain_errors, printable, wrote


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
    fps: Fps = None,
    scale: Scale = None,
    joints: Joints = "",
    smpl: Smpl = None,
    up: Up = None,
    force: Annotated[bool, typer.Option("--force", help="Write over B where it is there already.")] = False,
) -> None:
    """Turn a motion file of any kind into npz or BVH, in metres with y up, and say what it is and how it was read.

    Example: `harmolab convert EDGE_dance.pkl dance.npz --fps 30`
    """
    from harmolab.corpora.folders import read_any_motion, recorded_offset
    from harmolab.io.motion import save_motion

    with plain_errors():
        common.check_out(out, "a motion", (".npz", ".bvh"))
        if out.exists() and not force:
            raise ValueError(f"{out}: is there already; --force writes over it")
        read = read_any_motion(
            motion, fps=fps, scale=scale, joints=common.names_in(joints) or None, smpl=smpl, up=up or ""
        )
        about = f"converted from {motion.name}: {'; '.join((read.kind, *read.notes))}"
        save_motion(out, read.motion, offset=recorded_offset(motion), about=about)
    frames, count, _ = read.motion.positions.shape
    typer.echo(printable(f"{motion}: {read.kind}, {frames} frames of {count} joints at {read.motion.fps:g} a second"))
    for sentence in read.notes:
        typer.echo(printable(f"read: {sentence}"))
    wrote(out)
