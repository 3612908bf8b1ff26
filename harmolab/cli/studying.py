"""`harmolab data study`: ask people which dances fit their music, on this machine, and say what they answered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from harmolab import lab
from harmolab.cli import common
from harmolab.cli.common import left_out
from harmolab.cli.screen import progress, wrote
from harmolab.files import named_faults, plain, write_text

if TYPE_CHECKING:
    from harmolab.lab.listening.corpus_study import Pieces


Tables = dict[str, list[dict[str, Any]]]

SUMMARY = "analysis.json"
FEW_DANCES = 20  # up to which the intervals of a bootstrap are clearly too narrow
ANYONE = "anyone"  # whom the trials in the folder are for; each rater has an order of their own

study_app = typer.Typer(
    no_args_is_help=True, help="Ask people which dances fit their music: make the blind trials, ask, analyse."
)


Kind = Literal["pick", "choice", "rate"]


@study_app.command(cls=common.CheckedCommand)
def make(
    context: typer.Context,
    corpus: Path,
    out: Path,
    kind: Kind = "pick",
    n: int = 20,
    seconds: float = 8.0,
    wrong: Literal["lagged", "swapped"] = "lagged",
    against: Path | None = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
) -> None:
    """Make a study from a corpus: balanced blind trials, a page for each, and the key.

    All trials are equally long and loud, and nothing that a rater sees or finds in a page's source tells the answer;
    `key.json` and `scores.json` do, so do not hand them out.

    Example: `harmolab data synth demo --clips 40 --seconds 10 && harmolab data study make demo my_study --n 20`

    Parameters
    ----------
    corpus : Folder of recordings (Tang 2018 layout, or ours).
    out : Folder for the study; `ask` needs nothing else.
    kind : pick: one dance, does it fit (Fig. 8)? choice: two dances, which fits better (Fig. 13)? rate: one dance, four
        marks from 0 to 10 (Music2Dance).
    n : Number of trials; an even one, so that the answers are balanced.
    seconds : Length of a trial's music and dances.
    wrong : Without --against, the wrong dance: lagged, the same half a beat late; swapped, that of another clip (two
        clips a trial).
    against : For choice and rate: a folder that has another dance to the same music for each recording, under the same
        name (a folder, NAME.npz or NAME.bvh). It begins where its file says, else where the recording begins. No answer
        is right then; `analyse` says which dance is preferred.
    seed : Same seed, same study. Raters should not know it.
    """
    from harmolab.lab.listening.answers import KEY_FILE, PAGES, SCORES_FILE, TRIALS_FILE
    from harmolab.lab.listening.corpus_study import study_pieces

    if against is not None and kind == "pick":
        raise ValueError("--against compares two dances; it goes with --kind choice or rate")
    common.check_untold(context, ("wrong",), "is the other dance without --against", when=against is not None)
    if against is None and kind == "rate":
        raise ValueError("--kind rate has the dances of two systems marked; name the folder of the other: --against")
    if (out / TRIALS_FILE).exists():
        raise ValueError(f"{out}: holds a study already; name another folder")
    common.check_folder(context, out, (PAGES, SCORES_FILE, KEY_FILE))  # what a run that was cut off leaves
    pieces = study_pieces(corpus, against, wrong=wrong, seconds=seconds, seed=seed, progress=progress, report=left_out)
    _write_study(out, pieces, kind, n, seed, "true" if against is None else "")
    typer.echo(f"{n} trials in {out}; next: harmolab data study ask {out} --rater NAME")


def _write_study(out: Path, pieces: Pieces, kind: Kind, n: int, seed: int, truth: str) -> None:
    """Pages and scores of all that is asked, then key and trials."""
    from harmolab.lab.listening.answers import write_page, write_scores, write_study

    key = lab.make_key(pieces.items, kind=kind, n=n, seed=seed, truth=truth)
    trials = lab.make_trials(pieces.items, kind=kind, n=n, seed=seed, rater=ANYONE, truth=truth)
    out.mkdir(parents=True, exist_ok=True)
    for trial, entry in progress(key.trials.items(), "writing trials"):
        write_page(out, trial, lab.blind_page(*pieces.presented(entry)))
    write_scores(out, pieces.scores(progress(key.trials.values(), "scoring")))
    write_study(out, trials, key)


@study_app.command(cls=common.CheckedCommand)
def ask(
    study: Path,
    rater: Annotated[str, typer.Option()],
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open")] = False,
) -> None:
    """Ask one rater, on a page that only this machine can open; every answer is saved at once.

    Ctrl-C stops; the same command goes on where the rater was. It ends by itself after the last answer.

    Example: `harmolab data study ask my_study --rater Ada`

    Parameters
    ----------
    study : Folder of `harmolab data study make`.
    rater : Name of the rater; it decides the order of the trials.
    port : Port of the local page; 0: any free one.
    no_open : Print the address only.
    """
    from harmolab.lab.listening.answers import SIMULATED, TRIALS_FILE, answer_log, read_page, read_trials

    if rater.startswith(SIMULATED):
        raise ValueError(f"--rater {rater}: names that begin with {SIMULATED!r} are not for people; choose another")
    trials = read_trials(study / TRIALS_FILE).ordered_for(rater)
    for trial in trials.trials:
        read_page(study, trial.id)  # a page that is missing must not come up half way through
    log = answer_log(study, rater)
    if log.resume(trials):
        server = lab.StudyServer(trials, log, lambda trial: read_page(study, trial.id), port=port)
        common.serve(server, no_open, "nothing that was answered is lost")
    done = len(trials) - len(log.resume(trials))
    typer.echo(f"{done} of {len(trials)} trials answered by {trials.rater}, in {log.path}")


@study_app.command(cls=common.CheckedCommand)
def analyse(
    context: typer.Context,
    study: Path,
    out: Path | None = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    as_json: common.AsJson = False,
) -> None:
    """Say what all raters answered: rates with 95 % intervals, agreement, and which score goes with their answers.

    Scores are compared with the answers of --kind pick and choice, not with marks (--kind rate).

    Example: `harmolab data study analyse my_study --out results`

    Parameters
    ----------
    study : Folder of `harmolab data study make`, with answers.
    out : Folder for the tables (csv) and analysis.json (default: they are printed only).
    seed : Seed of the bootstrap.
    """
    from harmolab.lab.listening.analysis import TABLES, study_tables
    from harmolab.lab.listening.answers import KEY_FILE, SCORES_FILE, answer_files, merge, read_key, read_scores

    answers = merge(answer_files(study))
    key, scores = read_key(study / KEY_FILE), read_scores(study / SCORES_FILE)
    with named_faults(study):
        tables = study_tables(answers, key, scores, seed=seed)
    summary = {"study": answers.answers[0].study, "simulated": answers.simulated, **tables}
    text = json.dumps(plain(summary), indent=2)
    if out is not None:
        common.check_folder(context, out, (SUMMARY, *(f"{name}.csv" for name in TABLES)))
        _save(out, tables, text)
    for note in answers.notes:
        typer.echo(f"harmolab: {note}", err=True)
    if as_json:
        typer.echo(text)
    else:
        _print(tables, answers, key.kind)
    wrote(out, err=as_json)


def _save(out: Path, tables: Tables, text: str) -> None:
    """Write all tables and the summary; tables of an earlier run that this one does not have are removed."""
    import pandas as pd

    from harmolab.lab.listening.analysis import TABLES

    out.mkdir(parents=True, exist_ok=True)
    for name in TABLES:
        if name not in tables and (out / SUMMARY).is_file():
            (out / f"{name}.csv").unlink(missing_ok=True)
    for name, rows in tables.items():
        write_text(out / f"{name}.csv", pd.DataFrame(rows).to_csv(index=False))
    write_text(out / SUMMARY, f"{text}\n")


def _print(tables: Tables, answers: lab.Answers, kind: str) -> None:
    from rich.table import Column

    whose = "simulated raters, no people" if answers.simulated else f"{len(answers.raters)} raters"
    titles = {
        "raters": "right answers",
        "versions": "called inharmonious" if kind == "pick" else "preferred",
        "marks": "marks, 0 to 10",
        "agreement": "agreement beyond chance",
        "scores": "how the scores go with the answers",
    }
    for name, rows in tables.items():
        printed = [_printed(row) for row in rows]
        first, *others = printed[0]
        cells = [[common.show(value) for value in row.values()] for row in printed]
        common.print_table([Column(first, no_wrap=True), *others], cells, f"{titles[name]} ({whose})")
    if any(row["n"] <= FEW_DANCES for name in ("marks", "agreement", "scores") for row in tables.get(name, ())):
        typer.echo(
            "Intervals of marks, agreement and rank resample the dances, and are for these raters alone. Of 5 to "
            f"{FEW_DANCES} dances they hold the truth in eight or nine cases of ten, of fewer dances in fewer."
        )


def _printed(row: dict[str, Any]) -> dict[str, Any]:
    """The columns of a row that fit into a terminal, its interval as one of them, after what it is the interval of."""
    left_out = ("simulated", "high", "point_biserial", "pb_low", "pb_high")
    whole = {**row, "low": (row["low"], row["high"])}
    return {"95 % interval" if name == "low" else name: whole[name] for name in row if name not in left_out}
