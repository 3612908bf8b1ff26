"""`harmolab evaluate`: folders of generated dances in, a table to publish out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harmolab.cli.common import (
    Force,
    Fps,
    Jobs,
    Resume,
    Scale,
    Scheduler,
    Smpl,
    Up,
    check_pages,
    completed,
    processes,
)
from harmolab.cli.screen import note, plain_errors, printable, progress, wrote

if TYPE_CHECKING:
    from rich.table import Table

    from harmolab.lab.evaluate.evaluation import Evaluation
    from harmolab.lab.evaluate.settings import EvaluationSettings

KEY = (
    *("harmony", "harmony_dance", "paper_harmony", "paper_harmony_chance", "beat_align_motion", "beat_align_music"),
    *("mir_eval_f", "pfc", "foot_skating", "freezing", "jerk", "likeness", "fid_kinetic", "fid_geometric", "fid_pose"),
)
NAMED = 5  # files left out that are named in the terminal
NAME_WIDTH, CELL_WIDTH = 26, 11  # letters in the terminal for the measures, and for each system beside them


def evaluate(
    music: Annotated[
        Path,
        typer.Option(
            help="Folder of the songs: wav, flac, ogg or mp3, or folders of recordings; SONG.beats "
            "beside a song holds its beats, else they are tracked."
        ),
    ],
    reference: Annotated[Path, typer.Option(help="Folder of recorded dances, the controls of the table.")],
    out: Annotated[Path, typer.Option(help="Folder for the table: csv, json, LaTeX and an HTML page.")],
    generated: Annotated[
        Path | None, typer.Argument(metavar="GENERATED", help="Folder of generated dances; one subfolder a seed.")
    ] = None,
    system: Annotated[
        list[str] | None, typer.Option(metavar="NAME=FOLDER", help="Another system to compare; can be repeated.")
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(help="CSV with the columns motion, music and perhaps system, seed, in place of names."),
    ] = None,
    protocol: Annotated[
        str,
        typer.Option(
            help="Also the numbers of a published code: aist++, edge, bailando.",
            autocompletion=completed("aist++", "edge", "bailando"),
        ),
    ] = "",
    fps: Fps = None,
    scale: Scale = None,
    smpl: Smpl = None,
    up: Up = None,
    pose_net: Annotated[
        Path | None, typer.Option(help="Pose network of `harmolab train`, for FID (default: the shipped one).")
    ] = None,
    resamples: Annotated[int, typer.Option(help="Resamplings of the songs behind each interval.", min=100)] = 4000,
    seed: Annotated[int, typer.Option(help="Seed of the resampling.", min=0)] = 0,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    resume: Resume = False,
    force: Force = False,
) -> None:
    """A table of dances by the field's measures, with controls and intervals, that can be published.

    A dance goes with the song of its name (`mBR0.npz` and `mBR0.wav`), or with the song whose name is a word of its
    own (`run3_mBR0_take1.npz`, `gBR_sBM_cAll_d04_mBR0_ch01.pkl`). What goes with nothing is listed. Motions are of
    every kind that `harmolab convert` reads; --fps, --smpl and --up count for files that leave these open.

    Recorded dances, the same with another song, and a pose that is held are always rows. A system has a rank only where
    it differs from another one beyond luck, song by song.

    Example: `harmolab evaluate my_dances --music songs --reference recorded --out table`

    Example: `harmolab evaluate --system ours=runs/ours --system theirs=runs/theirs --music songs --reference recorded
    --out table`

    AIST++ as it is: `harmolab evaluate generated --music songs --reference motions --out table`, where `songs` holds
    `mBR0.wav` and so on, and `motions` the pickles of AIST++, `gBR_sBM_cAll_d04_mBR0_ch01.pkl` and so on, at 60 frames
    a second; `generated` has the same names, or `mBR0.pkl`.

    Example of a corpus that is there at once: `harmolab data synth demo --clips 14 --seconds 20 && harmolab evaluate
    demo --music demo --reference demo --out table`
    """
    from harmolab.lab.evaluate.evaluation import evaluate_dances

    with plain_errors():
        check_pages("--out")
        settings = _settings(
            generated, system or [], music=music, reference=reference, pairs=pairs, protocol=protocol, fps=fps,
            scale=scale, smpl=smpl, up=up or "", pose_net=pose_net, resamples=resamples, seed=seed,
        )  # fmt: skip
        evaluation = evaluate_dances(
            settings,
            out,
            jobs=processes(jobs),
            scheduler=scheduler,
            resume=resume,
            force=force,
            progress=progress,
        )
        from harmolab.lab.widgets.evaluation_page import write_evaluation

        paths = write_evaluation(out, evaluation)
    _print(evaluation)
    for path in paths.values():
        wrote(path)


def _settings(generated: Path | None, systems: list[str], **others: object) -> EvaluationSettings:
    """The settings, with the systems by name.

    Raises
    ------
    ValueError
        A system has no name, no folder, or the name of another.
    """
    from harmolab.lab.evaluate.settings import EvaluationSettings

    folders = {} if generated is None else {generated.resolve().name: generated}
    for text in systems:
        name, mark, folder = text.partition("=")
        if not (name.strip() and mark and folder):
            raise ValueError(f"--system {text}: write it as NAME=FOLDER, such as --system ours=runs/ours")
        if name.strip() in folders:
            raise ValueError(f"--system {text}: there is a system {name.strip()!r} already; choose another name")
        folders[name.strip()] = Path(folder)
    return EvaluationSettings(folders, **others)  # type: ignore[arg-type]


def _print(evaluation: Evaluation) -> None:
    """The most important measures, as many systems beside one another as fit, the remarks, and what was left out."""
    from rich.console import Console

    from harmolab.lab.evaluate.methods import table_notes
    from harmolab.lab.evaluate.table_files import table_records

    console, records = Console(), table_records(evaluation)
    beside = max(1, (console.width - NAME_WIDTH) // CELL_WIDTH)
    for first in range(0, len(records), beside):
        console.print(_terminal_table(records[first : first + beside]))
    for remark in table_notes(evaluation):
        typer.echo(printable(remark))
    left_out = [*evaluation.errors, *evaluation.unpaired]
    for one in left_out[:NAMED]:
        note(f"left out: {one.file}: {one.reason}")
    if len(left_out) > NAMED:
        note(f"left out: {len(left_out) - NAMED} more files, in table.json")


def _terminal_table(records: list[dict[str, Any]]) -> Table:
    """A table with a column a record."""
    from rich.markup import escape
    from rich.table import Table

    from harmolab.lab.evaluate.table_files import number_text

    table = Table(title="means over songs (rank), by columns of table.csv")
    table.add_column("", no_wrap=True)
    for record in records:
        table.add_column(escape(printable(record["system"])), overflow="fold")
    for count in ("dances", "songs", "seeds"):
        table.add_row(count, *(str(record[count]) for record in records))
    for name in (name for name in KEY if name in records[0]):
        cells = [(number_text(record[name]), record.get(f"{name}_rank")) for record in records]
        table.add_row(name, *(f"{text} ({rank})" if rank else text for text, rank in cells))
    return table
