"""`harmolab retime`: a motion or a video whose time is bent until its beats meet the music's."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import Beats, Dance, DanceName, Fps, Offset, Scale, Song, show

if TYPE_CHECKING:
    from harmolab.retime.retime import Retimed

MEANINGS = (
    "Above chance: speed valleys (in a video: of all that moves) within 0.1 s of the beats; 0 is a random moment, 1 "
    "every beat met. Speed: source seconds a second."
)


class Method(StrEnum):
    """Method that finds the warp."""

    dp = "dp"
    lee2019 = "lee2019"


def retime(
    song: Song,
    motion: Dance,
    out: Annotated[Path, typer.Option(help="npz, bvh, or mp4 or webm (with sound); mp4 or webm for a video.")],
    strength: Annotated[float, typer.Option(help="Share of every shift that is made, 0 to 1.")] = 1.0,
    phase: Annotated[float, typer.Option(help="Where in the beat to land: 0 on it, 0.5 half way to the next.")] = 0.0,
    offset: Offset = None,
    slowest: Annotated[float, typer.Option(help="Lowest local speed, above 0 to 1.")] = 0.7,
    fastest: Annotated[float, typer.Option(help="Highest local speed, 1 or more.")] = 1.4,
    dance: DanceName = "",
    beats: Beats = None,
    method: Annotated[
        Method, typer.Option(help="dp: bounded; lee2019: Lee et al. 2019, for comparison, no bounds.")
    ] = Method.dp,
    fps: Fps = None,
    scale: Scale = None,
) -> None:
    """Bend the time of a motion, or of a video, until it is in time with the music, and say how much was bent.

    A motion that is in time already is left alone.

    Example: `harmolab retime song.mp3 dance.bvh --out mended.mp4 --dance waltz`
    """
    from harmolab.io.video import is_video
    from harmolab.lab.render.video import retime_files

    with common.plain_errors():
        common.check_out(out, "this", common.VIDEOS_OUT if is_video(motion) else (".npz", ".bvh", *common.VIDEOS_OUT))
        retimed = retime_files(
            song, motion, out, strength=strength, phase=phase, offset=offset, slowest=slowest, fastest=fastest,
            dance=dance, beats=beats, method=method.value, fps=fps, scale=scale, progress=common.progress,
        )  # fmt: skip
    _print(retimed)
    common.wrote(out)


def _print(retimed: Retimed) -> None:
    """A table of scores before and after, and of the bending between."""
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    before, after, warp = retimed.before, retimed.after, retimed.warp
    table = Table("", "before", "after", title="the motion and its music")
    table.add_row("harmony above chance", show(before.harmony_above_chance), show(after.harmony_above_chance))
    table.add_row("hit rate", show(before.hit_rate), show(after.hit_rate))
    table.add_row("time bent, mean, ms", "0", f"{1000 * warp.bent:.0f}")
    table.add_row("time bent, largest, ms", "0", f"{1000 * np.abs(warp.shifts()).max():.0f}")
    table.add_row("local speed", "1", show(warp.speed_range()))
    console = Console()
    console.print(table)
    console.print("Nothing was worth bending." if warp.is_identity else MEANINGS, highlight=False)
