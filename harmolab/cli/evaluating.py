"""`harmolab evaluate` and `harmolab data learn`: tables of generated dances, scores over a corpus, bar patterns.

Folders of generated dances in, a table to publish out, whole or in shards, and a row for the leaderboard.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from functools import partial
from itertools import starmap
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import harmolab
from harmolab import lab
from harmolab.cli import common
from harmolab.cli.common import check_untold, left_out
from harmolab.cli.screen import note, progress, say, wrote

KEY = (
    *("harmony", "harmony_dance", "paper_harmony", "paper_harmony_chance", "beat_align_motion", "beat_align_music"),
    *("mir_eval_f", "pfc", "foot_skating", "freezing", "jerk", "likeness", "fid_kinetic", "fid_geometric", "fid_pose"),
)
FEW_RECORDINGS = 10  # up to which the interval of an AUC is clearly too narrow
NAMED = 5  # files left out that are named in the terminal
NAME_WIDTH, CELL_WIDTH = 26, 11  # letters in the terminal for the measures, and for each system beside them


def evaluate(
    context: typer.Context,
    music: Annotated[Path, typer.Option()],
    reference: Annotated[Path, typer.Option()],
    out: Annotated[Path, typer.Option()],
    generated: Annotated[Path | None, typer.Argument(metavar="GENERATED")] = None,
    system: Annotated[list[str] | None, typer.Option(metavar="NAME=FOLDER")] = None,
    pairs: Path | None = None,
    slice_stride: Annotated[float | None, typer.Option(metavar="SECONDS", min=0.0)] = None,
    seed_frames: Annotated[list[str] | None, typer.Option(metavar="[NAME=]FRAMES")] = None,
    protocol: Annotated[
        list[str] | None, typer.Option(autocompletion=common.completed("aist++", "edge", "bailando"))
    ] = None,
    fps: Annotated[list[str] | None, typer.Option(metavar="[NAME=]RATE")] = None,
    scale: common.Scale = None,
    smpl: common.Smpl = None,
    up: common.Up = None,
    pose_net: Path | None = None,
    save_reference: Path | None = None,
    shard: Annotated[str, typer.Option(metavar="I/N")] = "",
    resamples: Annotated[int, typer.Option(min=100)] = 4000,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: common.Jobs = None,
    scheduler: common.Scheduler = "",
    resume: common.Resume = False,
    force: common.Force = False,
    allow_missing: Annotated[bool, typer.Option("--allow-missing")] = False,
) -> None:
    """A table of dances by the field's measures, with controls and intervals, that can be published.

    A dance goes with the song of its name (`mBR0.npz` and `mBR0.wav`), or with the song whose name is a word of its
    own (`run3_mBR0_take1.npz`, `gBR_sBM_cAll_d04_mBR0_ch01.pkl`). Dances that go with no song are listed. Motions are
    of every kind that `harmolab data convert` reads; --fps, --smpl and --up count for files that leave these open.

    Three things can say where in its song a dance begins: the column offset of --pairs, the number of a slice
    (`mBR0_slice7.pkl` with --slice-stride 0.5: 3.5 s), or a file of harmolab. Otherwise the dance is taken to begin
    with the song, and the table says so. EDGE's test.py begins anywhere, and does not write where.

    A dance that cannot be read, is of another unit or axis, or goes with no song is in no number. It is named, and the
    exit code is 1, or 0 with --allow-missing.

    Recorded dances, the same with another song, and a pose that is held are always in the table. A system has a rank
    only where it differs from another one beyond luck, song by song.

    Example: `harmolab evaluate my_dances --music songs --reference recorded --out table`

    Example: `harmolab evaluate --system ours=runs/ours --system theirs=runs/theirs --music songs --reference recorded
    --out table`

    AIST++ as it is: `harmolab evaluate generated --music songs --reference motions --out table`, where `songs` holds
    `mBR0.wav` and so on, and `motions` the pickles of AIST++, `gBR_sBM_cAll_d04_mBR0_ch01.pkl` and so on, at 60 frames
    a second; `generated` has the same names, or `mBR0.pkl`.

    FACT's dances without the two seconds that it is given: `harmolab evaluate outputs --seed-frames 120 --fps 60
    --music songs --reference motions --out table`

    For the public page of numbers: `harmolab evaluate submit table --out my_row` makes and checks what you send.
    `harmolab evaluate compare CORPUS` compares scores, `harmolab evaluate merge` joins shards; each has its own --help.

    Example of a corpus that is there at once: `harmolab data synth demo --clips 14 --seconds 20 && harmolab evaluate
    demo --music demo --reference demo --out table`

    Parameters
    ----------
    music : Folder of the songs: wav, flac, ogg, mp3 or m4a, or folders of recordings; SONG.beats beside a song holds
        its beats, else they are tracked.
    reference : Folder of recorded dances, the controls of the table; or a file of --save-reference; or synthetic, for
        the one that comes with harmolab.
    out : Folder for the table: csv, json, LaTeX and an HTML page.
    generated : Folder of generated dances; one subfolder a seed.
    system : Another system to compare; can be repeated.
    pairs : CSV with the columns motion, music and perhaps system, seed, offset (seconds into the song at which the
        file begins), in place of names.
    fps : Frame rate of files that hold none. With a name, of that system's or of `recorded`; can be repeated.
    slice_stride : Seconds between the starts of two slices of a song, for files named by their slice.
    seed_frames : Frames at the start of each dance that the system was given, left out: 120 for FACT. With a name, of
        that system; can be repeated.
    protocol : Also the numbers of a published code: aist++, edge, bailando; can be repeated.
    pose_net : Pose network of `harmolab train`, for FID (default: the shipped one).
    save_reference : Also write the measured recorded dances into one file (npz), for --reference and for
        `harmolab.evaluate`: numbers and names, no movement.
    shard : Measure one of N parts into --out, such as 2/4, and make no table: `harmolab evaluate merge` does.
    resamples : Resamplings of the songs behind each interval.
    seed : Seed of the resampling.
    allow_missing : Exit code 0 though some dances could not be measured.
    """
    from harmolab.lab.evaluate.evaluation import evaluate_dances, write_reference
    from harmolab.lab.evaluate.shards import Shard, measure_shard

    check_untold(context, ("save_reference", "allow_missing"), "is of a whole table, no --shard", when=bool(shard))
    common.check_out(save_reference, "a reference", (".npz",))
    settings = _settings(
        generated, system or [], music=music, reference=reference, pairs=pairs, protocols=protocol or (),
        fps=_by_system("fps", fps or []),
        scale=scale, smpl=smpl, up=up or "", pose_net=pose_net, resamples=resamples, seed=seed,
        slice_stride=slice_stride, seed_frames=_by_system("seed-frames", seed_frames or [], whole=True) or 0,
    )  # fmt: skip
    measure = partial(measure_shard, shard=Shard.of(shard)) if shard else evaluate_dances
    evaluation = measure(settings, out, jobs=jobs, scheduler=scheduler, resume=resume, force=force, progress=progress)
    if isinstance(evaluation, int):
        typer.echo(f"shard {shard}: {evaluation} rows in {out}; the table of all shards: harmolab evaluate merge")
        return
    if save_reference is not None:
        write_reference(save_reference, evaluation, out)
        wrote(save_reference)
    _write(out, evaluation, allow_missing=allow_missing)


def merge(
    shards: list[Path],
    out: Annotated[Path, typer.Option()],
    allow_missing: Annotated[bool, typer.Option("--allow-missing")] = False,
    force: common.Force = False,
) -> None:
    """Make one table of all shards of an evaluation: to the last bit the table of a single run.

    The files of dances and songs must lie where they lay for the shards.

    Example: `harmolab evaluate merge shards/* --out table`

    Parameters
    ----------
    shards : Folders of all shards, each of which `harmolab evaluate --shard` has filled.
    out : Folder for the table.
    allow_missing : Exit code 0 though some dances could not be measured.
    """
    from harmolab.lab.evaluate.shards import merge_shards

    _write(out, merge_shards(shards, out, force=force, progress=progress), allow_missing=allow_missing)


def _write(out: Path, evaluation: lab.Evaluation, *, allow_missing: bool) -> None:
    """Write the files of a table, and print what is most important; exit code 1 where dances are missing."""
    paths = lab.write_evaluation(out, evaluation)
    _print(evaluation)
    wrote(*paths.values())
    if evaluation.missing and not allow_missing:
        count = "1 dance was" if evaluation.missing == 1 else f"{evaluation.missing} dances were"
        note(f"{count} not measured: exit code 1; --allow-missing makes it 0")
        raise typer.Exit(1)


def _by_system(option: str, texts: list[str], *, whole: bool = False) -> Any:
    """The number of all systems, or those by system; None without texts. ValueError for a text that is neither."""
    numbers: dict[str, float] = {}
    for text in texts:
        name, _, number = text.rpartition("=")
        try:
            numbers[name.strip()] = int(number) if whole else float(number)
        except ValueError:
            kind = "a whole number" if whole else "a number"
            raise ValueError(f"--{option} {text}: write {kind}, or NAME= and {kind} for one system") from None
        if not 0 <= numbers[name.strip()] < math.inf:
            raise ValueError(f"--{option} must be a finite number, not negative, got {text}")
    if "" in numbers and len(texts) > 1:
        raise ValueError(f"--{option}: write one number for all systems, or one with a name for each")
    return numbers.get("", numbers) if texts else None


def _settings(generated: Path | None, systems: list[str], **others: object) -> lab.EvaluationSettings:
    """The settings, with the systems by name.

    Raises
    ------
    ValueError
        A system has no name, no folder, or the name of another.
    """
    folders = {} if generated is None else {generated.resolve().name: generated}
    for text in systems:
        name, mark, folder = text.partition("=")
        if not (name.strip() and mark and folder):
            raise ValueError(f"--system {text}: write it as NAME=FOLDER, such as --system ours=runs/ours")
        if name.strip() in folders:
            raise ValueError(f"--system {text}: there is a system {name.strip()!r} already; choose another name")
        folders[name.strip()] = Path(folder).expanduser()  # the shell of a Mac leaves a ~ behind the = as it is
    return lab.EvaluationSettings(folders, **others)  # type: ignore[arg-type]


def _print(evaluation: lab.Evaluation) -> None:
    """The most important measures, as many systems beside one another as fit, findings, remarks, what was left out."""
    from rich.console import Console

    from harmolab.lab.evaluate.as_text import table_notes, table_records
    from harmolab.lab.evaluate.findings import findings

    records = table_records(evaluation)
    beside = max(1, (Console().width - NAME_WIDTH) // CELL_WIDTH)
    measured = {name: counts.text for name, counts in evaluation.counts.items()}
    names = [name for name in (*evaluation.measures, *evaluation.set_measures) if name in KEY or " " in name]
    for first in range(0, len(records), beside):
        _print_table(records[first : first + beside], names, measured)
    say(*findings(evaluation), *table_notes(evaluation))
    left_out = [*evaluation.errors, *evaluation.unpaired]
    for one in left_out[:NAMED]:
        note(f"left out: {one.file}: {one.reason}")
    if len(left_out) > NAMED:
        note(f"left out: {len(left_out) - NAMED} more files, in table.json")


def _print_table(records: list[dict[str, Any]], measures: Sequence[str], measured: dict[str, str]) -> None:
    """A table with a column a record, and a line a measure; `measured` are the numbers of dances by system, as text."""
    from rich.table import Column

    from harmolab.lab.evaluate.as_text import number_text

    systems = (Column(record["system"], overflow="fold") for record in records)
    rows = [["dances", *(measured[record["system"]] for record in records)]]
    rows += [[count, *(str(record[count]) for record in records)] for count in ("songs", "seeds")]
    for name in measures:
        cells = [(number_text(record[name]), record.get(f"{name}_rank")) for record in records]
        rows.append([name, *(f"{text} ({rank})" if rank else text for text, rank in cells)])
    published = "; those of published codes over dances" if any(" " in name for name in measures) else ""
    about = f"means over songs (rank), by columns of table.csv{published}"
    common.print_table([Column(no_wrap=True), *systems], rows, about)


def submit(folder: Path, out: Path | None = None) -> None:
    """A row for the leaderboard: make its folder from a table, or check one.

    The folder holds the measures of every dance, the means that are computed from them, command and versions, and the
    hashes of all files. It holds no motion and no sound. In its row.json you write what the data are. A check computes
    the numbers anew from the folder's own tables and says what is missing. Its exit code is 1 until nothing is missing.

    Example: `harmolab evaluate submit table --out my_row`

    Example: `harmolab evaluate submit my_row`

    Parameters
    ----------
    folder : Folder that `harmolab evaluate --out` wrote; without --out the folder of a row, to be checked.
    out : Folder of the row that is made from the table.
    """
    from harmolab.lab.evaluate.submission import ROW, submission_faults, write_submission

    if out is not None:
        write_submission(folder, out)
        wrote(out / ROW)
    faults = submission_faults(out or folder)
    say(*(faults or ["nothing is missing: the numbers follow from the files"]))
    raise typer.Exit(int(bool(faults) and out is None))


# `harmolab evaluate compare` and `harmolab data learn`: scores over a corpus


def compare(
    context: typer.Context,
    corpus: Path,
    window: Annotated[float, typer.Option(min=0.0)] = 6.0,
    null: Literal["lagged", "other"] = "lagged",
    beats: Literal["annotated", "tracked"] | None = None,
    fit_on: Path | None = None,
    dances: str = "",
    rotations: Annotated[int, typer.Option(min=20)] = 400,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Path | None = None,
    jobs: common.Jobs = None,
    scheduler: common.Scheduler = "",
    resume: common.Resume = False,
    force: common.Force = False,
    as_json: common.AsJson = False,
) -> None:
    """Which score tells true music from wrong?

    The answer is the AUC of every score over a folder of recordings: 0.5 is a coin, 1 is right every time. An AUC
    inside its chance band tells nothing. What a score learns, it learns on dance figures that are not in the window
    which it judges; for the band it learns anew, on music that begins anywhere. The row "discriminant" is trained on
    lagged music itself, so it stands in no verdict.

    The last table says how many whole recordings get each verdict of `harmolab score`; --json has them one by one.

    Example: `harmolab data synth demo --clips 70 && harmolab evaluate compare demo`

    Example of a large corpus, called again after it was cut off: `harmolab evaluate compare demo --out rows --resume`

    Parameters
    ----------
    corpus : Folder of recordings (Tang 2018 layout, or ours).
    window : Seconds a window; 0 judges whole recordings.
    null : Wrong music: lagged, the same music 0.3-0.7 beat late; other, other songs.
    beats : Music beats (default: annotated where every recording has a beats.json).
    fit_on : Fit patterns and lags on this corpus, in place of the one that is judged.
    dances : Only these dances, such as cha-cha,rumba.
    rotations : Corpora whose music begins anywhere, behind each chance band.
    seed : Seed of rotations and resampling.
    out : Folder that keeps what is measured of each recording, for --resume.
    """
    from harmolab.clips import check_dances, corpus_dances
    from harmolab.lab.compare.rows import Processes
    from harmolab.lab.evaluate.engine import usual_jobs

    check_untold(context, ("resume",), "goes on with the rows in a folder; name it by --out", when=out is None)
    check_untold(context, ("force",), "is for the rows in a folder; name it by --out", when=out is None)
    if names := common.names_in(dances):
        check_dances(corpus, names, corpus_dances(corpus))
    result = harmolab.compare(
        corpus, dances=names, window=window or None, null=null, fit_on=fit_on,
        beats=beats, n_rotations=rotations, seed=seed, progress=progress, report=left_out,
        processes=Processes(usual_jobs() if jobs is None else jobs, scheduler, out, resume, force),
    )  # fmt: skip
    if as_json:
        typer.echo(json.dumps(result.summary, indent=2))
    else:
        print_comparison(result.summary)


def print_comparison(summary: dict[str, Any]) -> None:
    """Tables: one row a score, the same by dance, and how many recordings reach each level of the verdict."""
    from rich.table import Column

    from harmolab.verdict.judge import LEVELS

    dances = sorted({dance for row in summary["scores"].values() for dance in row["by_dance"]})

    def cells(name: str, row: dict[str, Any]) -> list[str]:
        low, high = row["chance_band"]
        tells = "yes" if row["auc"] > high else "below" if row["auc"] < low else "no"
        return [name, *(common.show(row[column]) for column in ("auc", "interval", "chance_band")), tells]

    def own(name: str, row: dict[str, Any]) -> list[str]:
        return [name, *(common.show(row["by_dance"].get(dance, {}).get("auc")) for dance in dances)]

    headings = [Column("score", no_wrap=True), *map(Column, ("AUC", "interval", "chance band", "tells?"))]
    title = f"{summary['corpus']}: {summary['n']} windows, {summary['beats']} beats, {summary['null']} music"
    common.print_table(headings, starmap(cells, summary["scores"].items()), title)
    if len(dances) > 1:  # their headings are folded where the terminal is narrow, their numbers are not
        headings = [Column("AUC by dance", no_wrap=True), *(Column(dance, min_width=5) for dance in dances)]
        common.print_table(headings, starmap(own, summary["scores"].items()), box=None)
    if 1 < summary["n_sequences"] <= FEW_RECORDINGS:
        typer.echo(
            f"interval: of {summary['n_sequences']} recordings it is too narrow. Of 2 it holds the AUC in five cases "
            f"of ten, of 5 in eight, of {FEW_RECORDINGS} in nine."
        )
    typer.echo(f"fitted on: {summary['fitted_on']}")
    if summary["unfitted_parts"]:
        typer.echo(f"{summary['unfitted_parts']} of {summary['n_parts']} clips had nothing to fit a pattern on")
    beside = summary["discriminant"]
    counts = [f"{beside['lags_found'][name]} of {summary['n_sequences']}" for name in ("recommended", "discriminant")]
    typer.echo(
        "discriminant: it is trained on the kind of music that judges it, 0.3-0.7 beat late, so it is in no verdict. "
        f"Its AUC is {beside['auc_difference']:+.3f} [{common.show(beside['interval'])}] over the learnt curve "
        f"(recommended). It finds the lag within 1/8 beat in {counts[1]} recordings, the learnt curve in {counts[0]}."
    )
    levels = ["music", *(f"{level} {name}" for level, name in enumerate(LEVELS))]
    rows = ([music, *map(str, counts)] for music, counts in summary["levels"].items())
    common.print_table(levels, rows, "recordings by verdict")
    typer.echo("lagged: music 0.3-0.7 beat late; learnt: by a curve learnt on other figures, where there is one")


def learn(corpus: Path, out: Annotated[Path, typer.Option()]) -> None:
    """Learn from recordings how each dance moves in its bar, for `harmolab score --pattern`.

    Example: `harmolab data learn recordings --out patterns.json`

    Parameters
    ----------
    corpus : Folder of recordings with beats.json.
    out : Where to write the patterns (JSON).
    """
    from harmolab.lab.compare.windows import dance_patterns
    from harmolab.verdict.bar_pattern import save_patterns

    common.check_out(out, "a file of patterns", (".json",))
    patterns = dance_patterns(corpus, progress=progress, report=left_out)
    save_patterns(out, patterns)
    for name, pattern in patterns.items():
        say(f"{name or 'unknown dance'}: {pattern.beats} beats, learnt on {pattern.source}")
    first = next(iter(patterns))
    example = ["--dance", first] if first else []
    say(f"use them: {shlex.join(['harmolab', 'score', 'SONG', 'DANCE', '--pattern', str(out), *example])}")
