"""`harmolab dance`: a song in, a dance out, with the scores of what was made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import VIDEOS_OUT, check_out, plain_errors, progress, show, track_beats

if TYPE_CHECKING:
    from collections.abc import Callable

    from harmolab.models.harmogan import Generator
    from harmolab.models.poses_bank import PoseBank
    from harmolab.types import Audio, BeatTrack, Motion

__all__ = ["dance", "dance_scores"]

SUFFIXES = (*VIDEOS_OUT, ".html", ".bvh", ".npz")
MEANINGS = (
    "Above chance: speed valleys within 0.1 s of the beats; 0 is a random moment, 1 every beat met. "
    "The paper's numbers (T_delay 0.25 s) mean little without their chance level."
)


@dataclass(frozen=True)
class _Sample:
    """One dance that is asked for: its seed and where it goes."""

    seed: int
    path: Path


def dance(
    song: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3, or a video with sound.")],
    out: Annotated[Path, typer.Option(help="mp4 or webm (with sound), html (a player), bvh (Blender) or npz.")],
    weights: Annotated[
        Path | None, typer.Option(help="Folder of `harmolab train`, or a weights file (default: those shipped).")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the dance (default: to the end).")] = None,
    start: Annotated[float, typer.Option(help="Audio time in seconds at which it begins.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Another seed, another dance.", min=0)] = 0,
    dance: Annotated[str, typer.Option(help="Start as this dance; also a prior for the tempo (waltz, ...).")] = "",
    samples: Annotated[int, typer.Option(help="So many dances, from --seed on; files are numbered.", min=1)] = 1,
    plant_feet: Annotated[bool, typer.Option(help="Keep feet that carry from sliding.")] = True,
) -> None:
    """Dance to a song, and say how well it went.

    Example: `harmolab dance song.mp3 --seconds 20 --dance waltz --out dance.mp4`
    """
    with plain_errors():
        wanted = _wanted(out, seed, samples)
        generator, bank = _generator(weights)
        audio, track = _music(song, dance)
        table: dict[str, dict[str, float | int | None]] = {}
        for sample in wanted:
            motion = _danced(generator, bank, audio, track, sample, seconds, start, dance, plant_feet)
            scores = dance_scores(motion, track.span(start, motion.duration))
            _write(sample.path, motion, track, song, start, scores)
            table[f"seed {sample.seed}"] = scores
    _print(table)
    for sample in wanted:
        typer.echo(f"wrote {sample.path}")


def _wanted(out: Path, seed: int, samples: int) -> list[_Sample]:
    """The files to write, checked before any work is done."""
    check_out(out, "a dance", SUFFIXES)
    if samples == 1:
        return [_Sample(seed, out)]
    return [_Sample(number, out.with_stem(f"{out.stem}_{number}")) for number in range(seed, seed + samples)]


def _generator(weights: Path | None) -> tuple[Generator, PoseBank | None]:
    """The generator and the bank of poses beside it, if there is one."""
    import harmolab

    shipped = Path(harmolab.__file__).with_name("weights")
    if weights is None and not (shipped / "model.safetensors").is_file():
        raise ValueError(
            f"no weights are shipped with this installation ({shipped} has none); train some with "
            "`harmolab train DATA --out RUN` and pass --weights RUN"
        )
    chosen = shipped if weights is None else weights
    try:
        from harmolab.models.poses_bank import load_poses, poses_path
        from harmolab.models.weights import load_generator
    except ModuleNotFoundError as error:
        raise ValueError(f"dancing needs {error.name}; install it with: pip install 'harmolab[train]'") from None
    generator = load_generator(chosen)
    has_bank = poses_path(chosen).is_file()
    return generator, load_poses(chosen, n_channels=generator.n_motion) if has_bank else None


def _music(song: Path, dance: str) -> tuple[Audio, BeatTrack]:
    """The song and its beats."""
    from harmolab.io.video_sound import load_sound
    from harmolab.params import DANCES

    audio = load_sound(song)
    return audio, track_beats(audio, dance if dance in DANCES else "")


def _danced(
    generator: Generator,
    bank: PoseBank | None,
    audio: Audio,
    track: BeatTrack,
    sample: _Sample,
    seconds: float | None,
    start: float,
    dance: str,
    plant_feet: bool,
) -> Motion:
    """The dance of one seed."""
    from harmolab.synthesis import synthesize_dance

    return synthesize_dance(
        generator, audio, beats=track, seconds=seconds, start=start, seed=sample.seed, poses=bank,
        dance=dance or None, plant_feet=plant_feet, progress=progress,
    )  # fmt: skip


def dance_scores(motion: Motion, music: BeatTrack) -> dict[str, float | int | None]:
    """What a dance is judged by, name -> number; None where it is too short for that, or has no feet to judge.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on the motion's time line
    """
    from harmolab.harmony import score_motion
    from harmolab.metrics.quality import foot_skating, jerk
    from harmolab.params import HarmonyParams

    valleys = score_motion(music, motion, params=HarmonyParams.valleys())
    paper = score_motion(music, motion, params=HarmonyParams.paper(), n_rotations=0)
    return {
        "harmony above chance": valleys.harmony_above_chance,
        "p value": valleys.p_value,
        "visual beats M": valleys.n_visual,
        "music beats N": valleys.n_audio,
        "paper: harmony": paper.harmony,
        "paper: hit rate": paper.hit_rate,
        "paper: chance": paper.chance,
        "paper: visual beats M": paper.n_visual,
        "jerk, m/s³": _or_none(jerk, motion),
        "foot skating, m/s": _or_none(foot_skating, motion),
    }


def _or_none(measure: Callable[[Motion], float], motion: Motion) -> float | None:
    """A measure, or None where it does not apply."""
    try:
        return measure(motion)
    except ValueError:
        return None


def _write(
    path: Path,
    motion: Motion,
    track: BeatTrack,
    song: Path,
    start: float,
    scores: dict[str, float | int | None],
) -> None:
    """The dance in the form that the name asks for."""
    from harmolab.io.motion import save_motion

    suffix = path.suffix.lower()
    if suffix in (".npz", ".bvh"):
        save_motion(path, motion)
        return
    from harmolab.dance_video import write_dance
    from harmolab.io.video_sound import load_sound
    from harmolab.types import Clip
    from harmolab.widgets.player import player_of

    clip = Clip("generated", load_sound(song, sample_rate=None), motion, start, beats=track)
    if suffix in VIDEOS_OUT:
        write_dance(path, clip, progress=progress)
        return
    facts = {name: show(value) for name, value in scores.items()}
    player_of([clip], title=song.stem, facts=facts).save(path)


def _print(table: dict[str, dict[str, float | int | None]]) -> None:
    """One column a dance."""
    from rich.console import Console
    from rich.table import Table

    shown = Table("", *table, title="the dance and its music")
    for name in next(iter(table.values())):
        shown.add_row(name, *(show(scores[name]) for scores in table.values()))
    console = Console()
    console.print(shown)
    console.print(MEANINGS, highlight=False)
