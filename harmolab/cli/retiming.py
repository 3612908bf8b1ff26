"""`harmolab retime`: a motion or a video whose time is bent until its beats meet the music's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from harmolab.cli import common
from harmolab.cli.common import HEIGHT, VIDEOS_OUT, Dance, FileOptions, JudgeOptions, Offset, Song, show, with_options
from harmolab.cli.screen import note, printable, progress, wrote
from harmolab.cli.sources import film_offset, note_tempo, reading_fault, sources

if TYPE_CHECKING:
    from harmolab.retime.retime import Retimed
    from harmolab.score import HarmonyScore

MEANINGS = (
    "The warp brings moments of rest (in a video: of all that moves) to within 0.1 s of {place}. It does not look at "
    "harmony above chance, the number of `harmolab score`. Local speed: seconds of the source in one second."
)
LOSS = 0.1  # of the number above chance, which moves by less with nothing but chance
WORSE = "The dance goes less well with the music than before: keep it as it was (or --strength with a smaller number)."


@with_options
def retime(
    context: typer.Context,
    song: Song,
    out: Annotated[Path, typer.Option()],
    motion: Dance = None,
    strength: float = 1.0,
    phase: float | None = None,
    offset: Offset = None,
    slowest: float = 0.7,
    fastest: float = 1.4,
    *,
    judged: JudgeOptions,
    method: Literal["dp", "lee2019"] = "dp",
    height: Annotated[int | None, typer.Option(min=120, max=2160, show_default=f"{HEIGHT}")] = None,
    read: FileOptions,
) -> None:
    """Bend the time of a motion, or of a video, until its rests meet the music's beats, and say how much was bent.

    A motion whose rests are there already is left alone. A video is refused if it was read too poorly and shows no sign
    of the beat, neither before nor after. The verdict and the number of `harmolab score` are printed as they were
    before and as they are after.

    Example: `harmolab retime song.mp3 dance.bvh --out mended.mp4 --dance waltz`

    Example: `harmolab retime phone_video.mp4 --out mended.mp4`

    Parameters
    ----------
    out : File to write: npz, bvh, or a video with sound (mp4, webm). Of a video only a video can be written.
    strength : Share of each shift in time that is made, 0 to 1.
    phase : Where in the beat rests land: 0 on it, 0.5 half way to the next (default: 0, or 0.5 with --how hit).
    slowest : Lowest speed at any moment, a share of the dance's own: above 0, and 1 at most.
    fastest : Highest speed at any moment, a multiple of the dance's own: 1 or more.
    method : dp keeps the speed between --slowest and --fastest; lee2019, for comparison, is that of Lee et al. 2019
        and has no bounds.
    height : Height of a video that is written, pixels; a film is never enlarged.
    """
    from harmolab.data.recordings import recorded_offset
    from harmolab.lab.render.video import retime_files

    common.check_untold(context, ("slowest", "fastest"), "is for --method dp only", when=method == "lee2019")
    place = (0.5 if judged.how == "hit" else 0.0) if phase is None else phase
    common.check_place(out)
    files = sources(context, song, motion, judged)
    common.check_out(out, "this", VIDEOS_OUT if files.is_video else (".npz", ".bvh", *VIDEOS_OUT))
    is_video = out.suffix.lower() in VIDEOS_OUT
    common.check_untold(context, ("height",), f"is for a video, not for {out}", when=not is_video)
    offset = recorded_offset(files.motion) if offset is None else offset
    if offset is None and files.song != files.motion:
        offset = film_offset(files, files.motion) if files.is_video else None
        if offset is None:
            note(f"{files.motion.name} is taken to begin with the song; --offset says where else")
    retimed = retime_files(
        files.song, files.motion, out, strength=strength, phase=place, offset=offset, slowest=slowest,
        fastest=fastest, dance=files.dance, beats=files.beats, one=files.one, method=method,
        height=height or HEIGHT, progress=progress, params=judged.params(files.dance), **read.keywords,
    )  # fmt: skip
    note_tempo(files.song, files.dance, retimed.before.music)
    _print(retimed, files.motion, place)
    wrote(out)
    if out.suffix.lower() == ".bvh":
        common.say_begin(offset, out)


def instead(score: HarmonyScore, source: Path, retimed: Retimed) -> str:
    """The words in place of a verdict, where a video was read too poorly or time was bent to unsure beats; else ""."""
    if score is retimed.after and not (retimed.warp.is_identity or score.music.is_sure):
        return common.UNSURE
    return reading_fault(score, source, retimed.motion)


def is_worse(retimed: Retimed) -> bool:
    """True where bending time led to a lower level of the verdict, at the same level to a lower number or fewer rests.

    A number above chance is lower where it falls by more than `LOSS`; rests are those near beats.
    """
    scores = (retimed.before, retimed.after)
    before, after = (score.judgement.level if score.judgement else 0 for score in scores)
    if before != after:
        return after < before
    has_lost = retimed.before.above_chance - retimed.after.above_chance > LOSS
    return has_lost or retimed.target_after.hit_rate < retimed.target_before.hit_rate


def _meaning(retimed: Retimed, phase: float) -> str:
    """The sentence below the table."""
    if len(retimed.before.music) == 0:
        return "No beats were found in the music: nothing could be bent."
    if retimed.warp.is_identity:
        return "Nothing was worth bending."
    place = "the beats" if phase == 0 else f"the moments that lie {phase:g} of a beat after the beats"
    return WORSE if is_worse(retimed) else MEANINGS.format(place=place)


def _print(retimed: Retimed, source: Path, phase: float) -> None:
    """A table of scores before and after, and of the bending to a place in the beat; `source`: file of the motion."""
    import numpy as np

    before, after, warp = retimed.before, retimed.after, retimed.warp
    for name, score in (("before", before), ("after", after)):
        if words := instead(score, source, retimed):
            typer.echo(printable(f"{name}: {words}"))
        else:
            common.print_verdict(score.judgement, name)
    common.print_music(before.music)
    targets = (retimed.target_before, retimed.target_after)
    rows = (
        ("harmony above chance", show(before.above_chance), show(after.above_chance)),
        (f"{'places' if phase else 'beats'} with a rest near", *(show(target.hit_rate) for target in targets)),
        ("time bent, mean, ms", "0", f"{1000 * warp.bent:.0f}"),
        ("time bent, largest, ms", "0", f"{1000 * np.abs(warp.shifts()).max():.0f}"),
        ("local speed", "1", show(warp.speed_range())),
    )
    common.print_table(("", "before", "after"), rows, "the motion and its music", _meaning(retimed, phase))
