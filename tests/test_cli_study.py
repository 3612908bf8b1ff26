"""`harmolab data study`: trials from a corpus, asked without it, analysed; the key stays out of what is served."""

import json
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from functools import partial
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pandas as pd
import pytest

from harmolab.cli import app
from harmolab.data.recordings import recorded_offset
from harmolab.data.synthetic import write_corpus
from harmolab.lab.listening import answers as study_files
from harmolab.lab.listening.analysis import TABLES
from harmolab.lab.listening.answers import answer_log, read_key, read_page, read_scores, read_trials
from harmolab.lab.listening.corpus_study import study_pieces
from harmolab.readers.motion import load_motion, save_motion
from tests.builders import called, cases, complaint, done

N = 8


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("corpus") / "dances", clips=14, seconds=7.0, fps=30.0, seed=2)


run, succeed, refusal = (partial(call, app) for call in (called, done, complaint))


def made(corpus: Path, out: Path, *options: object) -> Path:
    succeed("data", "study", "make", corpus, out, "--n", N, "--seconds", 4, *options)
    return out


@pytest.fixture(scope="module")
def study(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lagged dances to be picked, that nobody has answered."""
    return made(corpus, tmp_path_factory.mktemp("study") / "pick")


def answered(folder: Path, *skills: float, prefers: str | None = None) -> Path:
    """The study with the answers of simulated raters, and two of its scores."""
    scores = read_scores(folder / "scores.json")
    study_files.write_scores(folder, {name: scores[name] for name in ("paper_h", "valleys_above_chance")})
    trials, key = read_trials(folder / "trials.json"), read_key(folder / "key.json")
    for seed, skill in enumerate(skills):
        rater = study_files.SimulatedRater(skill, seed, prefers)
        for answer in rater.answers(trials.ordered_for(rater.name), key):
            answer_log(folder, rater.name).append(answer)
    return folder


# make


def test_study_is_whole_balanced_and_blind(study: Path):
    trials, key = read_trials(study / "trials.json"), read_key(study / "key.json")
    scores = read_scores(study / "scores.json")
    assert len(trials) == N
    assert [one.right for one in key.trials.values()].count("harmonious") == N // 2
    sources = {source for one in key.trials.values() for source in one.sources}
    assert all(set(values) == sources for values in scores.values())
    for trial in trials.trials:
        page, asked = read_page(study, trial.id), key.trials[trial.id]
        assert [text for text in (asked.item, *asked.sources, "harmonious", "lagged") if text in page] == []
        assert len(page) < 400_000


@pytest.mark.slow
def test_same_seed_makes_the_same_study(corpus: Path, study: Path, tmp_path: Path):
    again, other = made(corpus, tmp_path / "again"), made(corpus, tmp_path / "other", "--seed", 2)
    for name in ("trials.json", "key.json", "scores.json"):
        assert (again / name).read_text() == (study / name).read_text()
        assert (other / name).read_text() != (study / name).read_text()


def test_pages_of_a_choice_show_two_dancers_and_the_true_one_as_often_on_the_left(corpus: Path, tmp_path: Path):
    folder = made(corpus, tmp_path / "choice", "--kind", "choice", "--wrong", "swapped", "--n", 6)
    key = read_key(folder / "key.json")
    assert [one.right for one in key.trials.values()].count("left") == 3
    for trial, asked in key.trials.items():
        assert read_page(folder, trial).count("<canvas") == 2 and set(asked.versions) == {"true", "swapped"}


def other_dances(corpus: Path, folder: Path, *, left_out: int = 0) -> Path:
    """The folder, which then holds a dance for each recording but the first ones."""
    folder.mkdir()
    for one in sorted(corpus.glob("clip_*"))[left_out:]:
        shutil.copy(one / "motion.npz", folder / f"{one.name}.npz")
    return folder


def test_two_folders_of_dances_are_compared_and_none_is_right(corpus: Path, tmp_path: Path):
    against = other_dances(corpus, tmp_path / "late", left_out=1)
    words = ("data", "study", "make", corpus, tmp_path / "duel", "--kind", "choice", "--against", against, "--n", N)
    assert f"left out: {against} holds no dance called clip_0001_cha-cha" in succeed(*words, "--seconds", 4).stderr
    key = read_key(tmp_path / "duel" / "key.json")
    assert {tuple(sorted(one.versions)) for one in key.trials.values()} == {("dances", "late")}
    assert {one.right for one in key.trials.values()} == {None}
    result = run("data", "study", "analyse", answered(tmp_path / "duel", 1.0, 1.0, prefers="late"), "--json")
    tables = json.loads(result.stdout)
    assert "raters" not in tables
    assert [(row["version"], row["rate"]) for row in tables["versions"]] == [("dances over late", 0.0)]


def test_dance_of_another_folder_begins_in_its_song_where_its_file_says(corpus: Path, tmp_path: Path):
    own = next(corpus.glob("clip_*"))
    later = load_motion(own / "motion.npz").span(2.1, 4.9)
    save_motion(tmp_path / f"{own.name}.npz", later, offset=recorded_offset(own) + 2.1)
    (piece,) = study_pieces(corpus, tmp_path, seconds=4.0, seed=1).pieces
    first, second = (motion.positions for motion in piece.motions.values())
    np.testing.assert_allclose(first, second, atol=1e-3)


def test_two_systems_are_marked_one_dance_at_a_time(corpus: Path, tmp_path: Path):
    against = other_dances(corpus, tmp_path / "other")
    folder = made(corpus, tmp_path / "marks", "--kind", "rate", "--against", against, "--n", 4)
    key = read_key(folder / "key.json")
    assert sorted(one.versions[0] for one in key.trials.values()) == ["dances", "dances", "other", "other"]
    assert all(read_page(folder, trial).count("<canvas") == 1 for trial in key.trials)


@cases(
    "options, fault",
    (("--n", 7), "n must be a multiple of 2"),
    (("--n", 100), "only 14 clips"),
    (("--seconds", 100), "seconds must be between 2 and 60"),
    (("--seconds", 6.99), "no recording gives a trial of 6.99 s"),
    (("--against", "."), "--against compares two dances"),
    (("--kind", "choice", "--against", "nowhere"), "nowhere: no such file or folder"),
    (("--kind", "choice", "--against", ".", "--wrong", "swapped"), "--wrong is the other dance without --against"),
    (("--kind", "rate"), "name the folder of the other: --against"),
)
def test_faulty_study_is_said_and_writes_nothing(corpus: Path, tmp_path: Path, options: tuple[object, ...], fault: str):
    assert fault in refusal("data", "study", "make", corpus, tmp_path / "x", "--n", N, "--seconds", 4, *options)
    assert list(tmp_path.iterdir()) == []


def test_study_with_answers_is_not_overwritten(corpus: Path, study: Path):
    assert "holds a study already" in refusal("data", "study", "make", corpus, study)


# ask


def start(study: Path, rater: str) -> tuple[subprocess.Popen[str], str]:
    """A running `harmolab data study ask` and its address."""
    command = [sys.executable, "-m", "harmolab.cli", "data", "study", "ask", str(study), "--rater", rater, "--no-open"]
    # A shell's background job ignores Ctrl-C, and hands that on to all that it starts.
    listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, preexec_fn=listening, **pipes)
    assert process.stdout is not None
    return process, process.stdout.readline().split()[1]


def get(address: str) -> str:
    return urllib.request.urlopen(address, timeout=20).read().decode()


def answer(address: str, choice: str) -> None:
    trial = re.search(r'name="trial" value="(\w+)"', get(address))[1]
    urllib.request.urlopen(address, urlencode({"trial": trial, "choice": choice}).encode(), timeout=20).close()


@pytest.mark.slow  # processes
def test_rater_is_asked_without_corpus_or_key_killed_interrupted_and_goes_on_to_the_end(study: Path, tmp_path: Path):
    alone = tmp_path
    shutil.copy(study / "trials.json", alone)
    (alone / "pages").symlink_to(study / "pages")
    for ending, count in ((signal.SIGKILL, 2), (signal.SIGINT, 4)):
        process, address = start(alone, "Ada")
        for _ in range(2):
            answer(address, "harmonious")
        process.send_signal(ending)
        output = process.communicate(timeout=30)[0]
        assert len(answer_log(alone, "Ada").read().answers) == count
        assert ending == signal.SIGKILL or f"{count} of {N} trials answered by Ada" in output
    process, address = start(alone, "Ada")
    assert f"Trial 5 of {N}" in get(address)
    for _ in range(N - 4):
        answer(address, "inharmonious")
    output, faults = process.communicate(timeout=30)
    assert (process.returncode, faults) == (0, "")
    assert f"{N} of {N} trials answered by Ada" in output
    asked = [one.trial for one in answer_log(alone, "Ada").read().answers]
    assert asked == [trial.id for trial in read_trials(study / "trials.json").ordered_for("Ada").trials]
    assert f"{N} of {N} trials answered" in run("data", "study", "ask", alone, "--rater", "Ada").output


@cases("rater, fault", ("simulated-1", "are not for people; choose another"), ("a\nb", "a rater needs a name"))
def test_rater_without_a_proper_name_is_refused(study: Path, rater: str, fault: str):
    assert fault in refusal("data", "study", "ask", study, "--rater", rater)


def test_study_that_lacks_a_page_is_refused_before_the_first_trial(study: Path, tmp_path: Path):
    shutil.copy(study / "trials.json", tmp_path)
    assert ".html: no such file" in refusal("data", "study", "ask", tmp_path, "--rater", "Ada")


# analyse


@pytest.mark.slow
def test_tables_hold_what_was_planted_and_say_that_raters_were_simulated(corpus: Path, tmp_path: Path):
    folder = answered(made(corpus, tmp_path / "study"), 1.0, 1.0, 0.0)
    summary = json.loads(succeed("data", "study", "analyse", folder, "--out", tmp_path / "results", "--json").stdout)
    assert summary["simulated"] is True
    rates = {row["rater"]: (row["n"], row["rate"]) for row in summary["raters"]}
    assert rates.pop("all") == (3 * N, pytest.approx(2 / 3))
    assert rates == {"simulated-0": (N, 1.0), "simulated-1": (N, 1.0), "simulated-2": (N, 0.0)}
    assert {row["version"] for row in summary["versions"]} == {"true", "lagged"}
    assert summary["agreement"][0]["measure"] == "Krippendorff's alpha"
    assert {row["score"]: row["rank"] for row in summary["scores"]}["valleys_above_chance"] > 0.7
    for name in ("raters", "versions", "agreement", "scores"):
        table = pd.read_csv(tmp_path / "results" / f"{name}.csv")
        assert len(table) == len(summary[name]) and table["simulated"].all()
    assert json.loads((tmp_path / "results" / "analysis.json").read_text()) == summary
    printed = run("data", "study", "analyse", folder).output
    assert printed.count("simulated raters, no") == 4
    assert re.search("score .* rank .* 95 % interval .* auc", printed)  # the interval is that of the rank
    assert "Of 5 to 20 dances they hold the truth in eight or nine" in printed


def test_people_and_simulated_raters_never_mix(corpus: Path, tmp_path: Path):
    folder = answered(made(corpus, tmp_path / "study"), 1.0)
    trials = read_trials(folder / "trials.json").ordered_for("Ada")
    for trial in trials.trials:
        answer_log(folder, "Ada").record(trials, trial.id, "harmonious")
    assert "apart: move answers/simulated-* away" in refusal("data", "study", "analyse", folder)
    answer_log(folder, "simulated-0").path.unlink()
    people = json.loads(run("data", "study", "analyse", folder, "--json").stdout)
    assert people["simulated"] is False
    assert [row["rater"] for row in people["raters"]] == ["Ada", "all"]
    assert people["raters"][0]["rate"] == 0.5


def test_tables_of_an_earlier_analysis_do_not_stay_beside_new_ones(study: Path, tmp_path: Path):
    folder = answered(shutil.copytree(study, tmp_path / "study"), 1.0, 0.0)
    command = ("data", "study", "analyse", folder, "--out", tmp_path / "results")
    succeed(*command)
    assert (tmp_path / "results" / "agreement.csv").exists()
    answer_log(folder, "simulated-1").path.unlink()
    succeed(*command)
    names = {path.stem for path in (tmp_path / "results").glob("*.csv")}
    assert names == {"raters", "versions", "scores"} < set(TABLES)


def test_help_says_that_scores_are_not_compared_with_marks():
    assert "not with marks (--kind rate)" in " ".join(succeed("data", "study", "analyse", "--help").stdout.split())


def test_study_without_answers_says_so(study: Path):
    assert "nobody has answered yet" in refusal("data", "study", "analyse", study)
