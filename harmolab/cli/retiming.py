"""`harmolab retime`: a motion or a video whose time is bent until its beats meet the music's."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.common import Beats, Dance, DanceName, Fps, HowDanced, Offset, One, PatternFile, Scale, Song, show
from harmolab.cli.screen import note, plain_errors, printable, progress, wrote
from harmolab.cli.sources import sources

if TYPE_CHECKING:
    from harmolab.retime.retime import Retimed
    from harmolab.types import Motion
    from harmolab.verdict.score import HarmonyScore

MEANINGS = (
    "The warp brings moments of rest (in a video: of all that moves) to within 0.1 s of the beats, and knows nothing "
    "of the number above chance, which is that of `harmolab score`. Local speed: source seconds a second."
)


class Method(StrEnum):
    """Method that finds the warp."""

    dp = "dp"
    lee2019 = "lee2019"


def retime(
    context: typer.Context,
    song: Song,
    out: Annotated[Path, typer.Option(help="npz, bvh, or mp4 or webm (with sound); mp4 or webm for a video.")],
    motion: Dance = None,
    strength: Annotated[float, typer.Option(help="Share of every shift that is made, 0 to 1.")] = 1.0,
    phase: Annotated[float, typer.Option(help="Where in the beat to land: 0 on it, 0.5 half way to the next.")] = 0.0,
    offset: Offset = None,
    slowest: Annotated[float, typer.Option(help="Lowest local speed, above 0 to 1.")] = 0.7,
    fastest: Annotated[float, typer.Option(help="Highest local speed, 1 or more.")] = 1.4,
    dance: DanceName = "",
    beats: Beats = None,
    one: One = None,
    pattern: PatternFile = None,
    how: HowDanced = None,
    method: Annotated[
        Method, typer.Option(help="dp: bounded; lee2019: Lee et al. 2019, for comparison, no bounds.")
    ] = Method.dp,
    fps: Fps = None,
    scale: Scale = None,
) -> None:
    """Bend the time of a motion, or of a video, until its rests meet the music's beats, and say how much was bent.

    A motion whose rests are there already is left alone. The verdict and the number of `harmolab score` are printed as
    they were before and as they are after.

    Example: `harmolab retime song.mp3 dance.bvh --out mended.mp4 --dance waltz`

    Example: `harmolab retime phone_video.mp4 --out mended.mp4`
    """
    from harmolab.lab.render.video import retime_files

    with plain_errors():
        common.check_place(out)
        files = sources(context, song, motion, beats=beats, one=one, dance=dance)
        common.check_out(out, "this", common.VIDEOS_OUT if files.is_video else (".npz", ".bvh", *common.VIDEOS_OUT))
        if files.is_video and files.song != files.motion and offset is None:
            note(f"{files.motion.name} is taken to begin with the song; --offset says where else")
        retimed = retime_files(
            files.song, files.motion, out, strength=strength, phase=phase, offset=offset, slowest=slowest,
            fastest=fastest, dance=files.dance, beats=files.beats, one=one, method=method.value, fps=fps, scale=scale,
            progress=progress, params=common.recommended(pattern, files.dance, how),
        )  # fmt: skip
    _print(retimed, files.motion)
    wrote(out)


def _print_verdict(score: HarmonyScore, name: str, source: Path, motion: Motion) -> None:
    """The verdict after a name; of a video that was read too poorly for one, the reason."""
    from harmolab.lab.timing.filmed import check_sign

    try:
        check_sign(source, motion, score.judgement.level if score.judgement else 0)
    except ValueError as error:
        typer.echo(printable(f"{name}: {error}"))
    else:
        common.print_verdict(score.judgement, name)


def _print(retimed: Retimed, source: Path) -> None:
    """A table of scores before and after, and of the bending between; `source` is the file of the motion."""
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    before, after, warp = retimed.before, retimed.after, retimed.warp
    for name, score in (("before", before), ("after", after)):
        _print_verdict(score, name, source, retimed.motion)
    common.print_music(before.music)
    table = Table("", "before", "after", title="the motion and its music")
    table.add_row("harmony above chance", show(before.above_chance), show(after.above_chance))
    targets = (retimed.target_before, retimed.target_after)
    table.add_row("beats with a rest near", *(show(target.hit_rate) for target in targets))
    table.add_row("time bent, mean, ms", "0", f"{1000 * warp.bent:.0f}")
    table.add_row("time bent, largest, ms", "0", f"{1000 * np.abs(warp.shifts()).max():.0f}")
    table.add_row("local speed", "1", show(warp.speed_range()))
    console = Console()
    console.print(table)
    console.print("Nothing was worth bending." if warp.is_identity else MEANINGS, highlight=False)
