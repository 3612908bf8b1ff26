"""`harmolab dance`: a song in, a dance out, and how well it went."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.checks import check_output, is_told
from harmolab.cli.common import (
    AsJson,
    One,
    PatternFile,
    Scale,
    Song,
    completed,
    dance_names,
    print_music,
    recommended,
)
from harmolab.cli.dance_files import dance_files, write_files
from harmolab.cli.dance_report import DanceReport
from harmolab.cli.dancers import dancer_of
from harmolab.cli.naming import plain_name
from harmolab.cli.screen import finding_beats, is_verbose, note, plain_errors, printable, progress, wrote
from harmolab.cli.training import TRAIN_HINT
from harmolab.io.files import plain

if TYPE_CHECKING:
    from harmolab.params import HarmonyParams
    from harmolab.types import Audio, BeatTrack, Motion

FARTHEST = 30.0  # centimetres that --harmonise may move a joint
CENTIMETRE = 0.01  # metres
MOST_SEEDS = 4  # that are tried, where none is named, until a dance moves like recorded dancers
MEANINGS = (
    "Moves like people: each number beside those of recorded dancers; what lies far outside FAILS, and then harmony "
    "means nothing. Harmony above chance: the number of `harmolab score`; 0 is a random phase, 1 the best moment on "
    "every beat. The paper's numbers (T_delay 0.25 s) mean little without their chance level."
)


def dance(
    context: typer.Context,
    song: Song,
    out: Annotated[
        Path | None,
        typer.Option(
            help="mp4 or webm (with sound), html (a player), bvh (Blender) or npz. Left out: SONG_dance.html, .mp4 and "
            ".bvh in this folder."
        ),
    ] = None,
    corpus: Annotated[
        Path | None,
        typer.Option(
            "--from", help="Dance with your own recordings: a corpus, a folder of npz or BVH files, or one file."
        ),
    ] = None,
    scale: Scale = None,
    style: Annotated[
        str | None,
        typer.Option(
            help="Movement that comes with harmolab: salsa (default), indian, or puppet (synthetic).",
            autocompletion=completed("salsa", "indian", "puppet"),
        ),
    ] = None,
    dance: Annotated[
        str,
        typer.Option(
            help="What the music is (waltz, ...): its usual tempo, and the dance to be judged as. With --weights of "
            'music2dance, --dance "" asks their classifier.',
            autocompletion=dance_names,
        ),
    ] = "",
    one: One = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the dance (default: to the end).")] = None,
    offset: Annotated[
        float, typer.Option("--offset", "--start", help="Audio time in seconds at which the dance begins.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Another seed, another dance.", min=0)] = 0,
    samples: Annotated[int, typer.Option(help="So many dances, from --seed on; files are numbered.", min=1)] = 1,
    harmonise: Annotated[
        float | None,
        typer.Option(metavar="CM", help="Move joints by so many cm at most, to fit the beats better (needs torch)."),
    ] = None,
    system: Annotated[
        str | None,
        typer.Option(
            help="choreographer (default), harmogan, or another; package.module:Class.",
            autocompletion=completed("choreographer", "harmogan", "lee2019", "music2dance", "ren2020"),
        ),
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="Folder of `harmolab train`, or a weights file; it knows its system.")
    ] = None,
    pattern: PatternFile = None,
    plant_feet: Annotated[bool, typer.Option(help="Keep feet that carry from sliding.")] = True,
    feet: Annotated[
        str | None,
        typer.Option(
            help="How, in music2dance: planted (default), model (a network that was trained for it), or none.",
            autocompletion=completed("planted", "model", "none"),
        ),
    ] = None,
    temperature: Annotated[
        float | None,
        typer.Option(help="Chance in music2dance: share of the predicted spread that is drawn, 0 to 4."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Dance to a song: recorded movement, chosen beat by beat and laid on the music. No training, no torch.

    **Without any option** it dances salsa (practice, without the partner) and writes a page that plays it, a video
    and a BVH file, named after the song, into the folder you are in.

    It says whether the dance moves like recorded dancers, how well its pieces fit together, and how it goes with the
    music, in the words and with the number of `harmolab score`.

    An npz keeps the song time at which the dance begins. For a bvh or a video the offset to pass on is printed.

    Example: `harmolab dance song.mp3`

    Example: `harmolab dance song.mp3 --from my_corpus --dance waltz --one 12.4 --out dance.mp4`
    """
    with plain_errors():
        files = dance_files(out, song, seed, samples)
        for path in (path for paths in files.values() for path in paths):
            check_output(context, path)
        _check_harmonise(harmonise)
        dancer = dancer_of(
            context, corpus=corpus, scale=scale, style=style, system=system, weights=weights, dance=dance
        )
        if pattern is not None and not dancer.knows_bars:
            raise ValueError("--pattern: this movement knows no bar that a pattern could judge; leave it out")
        from harmolab.corpora.files import song_beats
        from harmolab.harmony import score_clip
        from harmolab.metrics.likeness import likeness
        from harmolab.params import DANCES
        from harmolab.types import Clip

        sound, audio = _sound(song)
        with finding_beats():
            dancer, dance = dancer.for_music(audio, dance)
            track = song_beats(audio, dance=dance if dance in DANCES else "", one=one)
        params = recommended(pattern, dance if dancer.knows_bars else "")

        def danced(number: int) -> DanceReport:
            motion, choreography = dancer.dance(audio, track, start=offset, seconds=seconds, seed=number)
            music = track.span(offset, motion.duration)
            motion = _harmonised(motion, music, harmonise, params)
            score = score_clip(Clip(song.stem, audio, motion, offset, beats=track, dance=dance), params)
            judged = likeness(motion, dance=dance, limits=dancer.limits)
            return DanceReport(
                number, motion, offset, music, score, judged, choreography, dancer.remarks,
                knows_bars=dancer.knows_bars, dance_probabilities=dancer.dance_probabilities,
            )  # fmt: skip

        is_open = samples == 1 and dancer.choreographer is not None and not is_told(context, "seed")
        reports: list[DanceReport] = []
        paths: list[Path] = []
        for number in files:
            reports.append(_likely(danced, number) if is_open else danced(number))
            title = f"A generated dance to {plain_name(song)}"
            paths += write_files(files[number], reports[-1], sound, title, is_asked=out is not None)
    if len(reports[0].music) < 2:
        note(f"no beats heard in {song} from {offset:g} s on: the scores of this dance mean nothing")
    _print(reports, as_json=as_json)
    for path in paths:
        wrote(path, err=as_json)
    if offset and any(path.suffix.lower() != ".npz" for path in paths):
        typer.echo(f"it begins at {offset:g} s of the song: pass --offset {offset:g} with it", err=as_json)


def _likely(danced: Callable[[int], DanceReport], seed: int) -> DanceReport:
    """The dance of the first seed from `seed` on that moves like recorded dancers; that of `seed` where none does."""
    left: list[DanceReport] = []
    for number in range(seed, seed + MOST_SEEDS):
        report = danced(number)
        if report.has_harmony:
            return report
        left.append(report)
        note(f"seed {number} is left: {report.likeness.verdict}")
    note(f"no seed up to {seed + MOST_SEEDS - 1} does better: seed {seed} is danced")
    return left[0]


def _check_harmonise(reach: float | None) -> None:
    """ValueError for a reach that is out of range, or where the library is missing that it needs."""
    if reach is None:
        return
    if not 0 < reach <= FARTHEST:
        raise ValueError(f"--harmonise is a number of centimetres up to {FARTHEST:g}, got {reach:g}")
    if find_spec("torch") is None:
        raise ValueError(f"--harmonise needs torch; {TRAIN_HINT}")


def _harmonised(motion: Motion, music: BeatTrack, reach: float | None, params: HarmonyParams) -> Motion:
    """The motion with its joints moved by `reach` cm at most, to fit the music better; as it is without a reach."""
    if reach is None:
        return motion
    from harmolab.lab.timing.harmonise import harmonise

    return harmonise(motion, music, reach=reach * CENTIMETRE, params=params, progress=progress)


def _sound(song: Path) -> tuple[Audio, Audio]:
    """The song at its own sample rate, and as beats are tracked in it."""
    from harmolab.corpora.files import tracked_sound
    from harmolab.io.video_sound import load_sound

    sound = load_sound(song, sample_rate=None)
    return sound, tracked_sound(song, sound)


def _print(reports: Sequence[DanceReport], *, as_json: bool) -> None:
    """All that is known of the dances: as JSON, or as sentences and a column of a table each."""
    if as_json:
        typer.echo(json.dumps(plain([report.to_dict() for report in reports]), indent=1))
        return
    for report in reports:
        typer.echo("\n  ".join(map(printable, [f"seed {report.seed}: {report.verdict[0]}", *report.verdict[1:]])))
    print_music(reports[0].music)
    if is_verbose():
        _print_table({f"seed {report.seed}": report.facts for report in reports})


def _print_table(facts: Mapping[str, Mapping[str, str]]) -> None:
    """One column a dance."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    columns = Table("", *facts, title="the dance and its music")
    for row in dict.fromkeys(name for column in facts.values() for name in column):
        columns.add_row(row, *(escape(printable(column.get(row, "-"))) for column in facts.values()))
    console = Console()
    console.print(columns)
    console.print(MEANINGS, highlight=False)
