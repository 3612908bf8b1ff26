"""`harmolab dance`: a song in, a dance out, with the scores of what was made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.checks import check_unread
from harmolab.cli.common import (
    VIDEOS_OUT,
    One,
    PatternFile,
    Song,
    check_out,
    finding_beats,
    note,
    plain_errors,
    print_music,
    print_verdict,
    progress,
    recommended,
    show,
    wrote,
)
from harmolab.cli.training import accepted

if TYPE_CHECKING:
    from harmolab.lab.widgets.player import Dancer
    from harmolab.systems import System
    from harmolab.types import Audio, BeatTrack

SUFFIXES = (*VIDEOS_OUT, ".html", ".bvh", ".npz")
MEANINGS = (
    "Above chance: the number of `harmolab score`; 0 is a random phase, 1 the best moment on every beat. The share "
    "inside the body is small for one who only turns and travels. The paper's numbers (T_delay 0.25 s) mean little "
    "without their chance level."
)


def dance(
    context: typer.Context,
    song: Song,
    out: Annotated[Path, typer.Option(help="mp4 or webm (with sound), html (a player), bvh (Blender) or npz.")],
    weights: Annotated[
        Path | None, typer.Option(help="Folder of `harmolab train`, or a weights file (default: those shipped).")
    ] = None,
    system: Annotated[
        str | None, typer.Option(help="System that made the weights; needed for package.module:Class.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the dance (default: to the end).")] = None,
    start: Annotated[float, typer.Option(help="Audio time in seconds at which it begins.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Another seed, another dance.", min=0)] = 0,
    dance: Annotated[
        str, typer.Option(help="Start as this dance (waltz, ...), and be judged as one; also a prior for the tempo.")
    ] = "",
    pattern: PatternFile = None,
    one: One = None,
    samples: Annotated[int, typer.Option(help="So many dances, from --seed on; files are numbered.", min=1)] = 1,
    plant_feet: Annotated[bool, typer.Option(help="Keep feet that carry from sliding.")] = True,
) -> None:
    """Dance to a song, and say how well it went, in the words and with the number of `harmolab score`.

    An npz keeps the song time at which the dance begins. For a bvh or a video the offset to pass on is printed.

    Example: `harmolab dance song.mp3 --seconds 20 --dance waltz --out dance.mp4`
    """
    with plain_errors():
        paths = _paths(out, seed, samples)
        for path in paths.values():
            check_unread(context, path)
        trained = _system(weights, system)
        options = accepted(trained.generate, context, {"progress": progress})
        sound, audio, track = _music(song, dance, one)
        from harmolab import Clip, score_clip
        from harmolab.lab.evaluate.dance_scores import dance_scores
        from harmolab.lab.widgets.player import Dancer

        params = recommended(pattern, dance)
        table: dict[str, dict[str, str]] = {}
        for number, path in paths.items():
            motion = trained.generate(audio, track, **options | {"start": start, "seconds": seconds, "seed": number})
            music = track.span(start, motion.duration)
            if len(music) < 2:
                note(f"no beats heard in {song} from {start:g} s on: the scores of this dance mean nothing")
            score = score_clip(Clip(song.stem, audio, motion, start, beats=track, dance=dance), params)
            print_verdict(score.judgement, f"seed {number}")
            table[f"seed {number}"] = facts = {
                name: show(value) for name, value in dance_scores(motion, music, score).items()
            }
            _write(path, Dancer("generated", motion, score), sound, track, start, song.stem, facts)
    print_music(music)
    _print(table)
    for path in paths.values():
        wrote(path)
    if start and out.suffix.lower() != ".npz":
        typer.echo(f"it begins at {start:g} s of the song: pass --offset {start:g} with it")


def _paths(out: Path, seed: int, samples: int) -> dict[int, Path]:
    """The file of each seed, checked before any work is done."""
    check_out(out, "a dance", SUFFIXES)
    if samples == 1:
        return {seed: out}
    return {number: out.with_stem(f"{out.stem}_{number}") for number in range(seed, seed + samples)}


def _system(weights: Path | None, system: str | None) -> System:
    """The system in a folder; the shipped one when left out."""
    import harmolab

    shipped = Path(harmolab.__file__).parent / "systems" / "harmogan" / "weights"
    if weights is None and not (shipped / "model.safetensors").is_file():
        raise ValueError(
            f"no weights are shipped with this installation ({shipped} has none); train some with "
            "`harmolab train DATA --out RUN` and pass --weights RUN"
        )
    try:
        from harmolab.systems import load

        return load(shipped if weights is None else weights, system=system)
    except ModuleNotFoundError as error:
        raise ValueError(f"dancing needs {error.name}; install it with: pip install 'harmolab[train]'") from None


def _music(song: Path, dance: str, one: float | None) -> tuple[Audio, Audio, BeatTrack]:
    """The song at its own sample rate, as beats are tracked in it, and its beats."""
    from harmolab.corpora.files import song_beats, tracked_sound
    from harmolab.io.video_sound import load_sound

    sound = load_sound(song, sample_rate=None)
    audio = tracked_sound(song, sound)
    with finding_beats():
        return sound, audio, song_beats(audio, dance=dance, one=one)


def _write(
    path: Path, dancer: Dancer, sound: Audio, beats: BeatTrack, start: float, title: str, facts: dict[str, str]
) -> None:
    """The dance with its part of the sound and the beats, in the form that the name asks for."""
    from harmolab.io.motion import save_motion
    from harmolab.lab.render.video import write_dance
    from harmolab.lab.widgets.player import Player
    from harmolab.types import Clip

    suffix, seconds = path.suffix.lower(), dancer.motion.duration
    if suffix not in (*VIDEOS_OUT, ".html"):
        save_motion(path, dancer.motion, offset=start)
        return
    part, music = sound.span(start, seconds), beats.span(start, seconds)
    if suffix == ".html":
        Player(part, [dancer], music=music, title=title, facts=facts).save(path)
    else:
        write_dance(path, Clip(dancer.name, part, dancer.motion, beats=music), score=dancer.score, progress=progress)


def _print(table: dict[str, dict[str, str]]) -> None:
    """One column a dance."""
    from rich.console import Console
    from rich.table import Table

    columns = Table("", *table, title="the dance and its music")
    for name in next(iter(table.values())):
        columns.add_row(name, *(facts[name] for facts in table.values()))
    console = Console()
    console.print(columns)
    console.print(MEANINGS, highlight=False)
