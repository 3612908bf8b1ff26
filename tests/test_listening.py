"""User studies: balanced blind trials, answers that survive, marks, the analysis, and what is shown."""

import json
import math
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest

import harmolab
from harmolab.lab.listening import analysis
from harmolab.lab.listening import answers as files
from harmolab.lab.listening import corpus_study as corpus
from harmolab.lab.listening import trials as blind
from harmolab.lab.listening.analysis import Grid
from harmolab.lab.listening.answers import Answer, AnswerLog, Answers, SimulatedRater
from harmolab.lab.listening.corpus_study import Pieces
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.listening.trials import Item, Key, KeyEntry, Trial, TrialSet, make_key, make_trials
from harmolab.types import Audio, Clip
from study.figures.results import rates_figure, study_title
from tests.builders import cases, missing, refused

# Trials and their files

WALTZES = [Item(f"waltz {n}", {v: f"waltz {n} {v}" for v in ("true", "lagged", "other")}) for n in range(12)]
MODELS = [Item(f"song {n}", {v: f"song {n} by {v}" for v in ("HarmoGAN", "LSTM", "recorded")}) for n in range(4)]
PICK = {"kind": "pick", "n": 12, "seed": 5}
CHOICE = {"kind": "choice", "n": 12, "seed": 5}
KINDS = cases("items, settings", (WALTZES, PICK), (MODELS, CHOICE))


def test_half_of_the_clips_are_true_wrong_conditions_share_the_other_half_and_no_clip_comes_twice():
    asked = make_key(WALTZES, **PICK).trials.values()
    assert Counter(one.versions for one in asked) == {("true",): 6, ("lagged",): 3, ("other",): 3}
    assert {(one.versions[0] == "true", one.right) for one in asked} == {(True, "harmonious"), (False, "inharmonious")}
    assert len({one.item for one in asked}) == 12
    assert all(one.sources == (f"{one.item} {one.versions[0]}",) for one in asked)


def test_every_pair_of_models_comes_equally_often_and_on_both_sides():
    asked = make_key(MODELS, **CHOICE).trials.values()
    assert set(Counter(one.versions for one in asked).values()) == {2}
    assert len({one.versions for one in asked}) == 6
    assert len({(one.item, frozenset(one.versions)) for one in asked}) == 12
    assert {one.right for one in asked} == {None}


def test_true_music_is_the_right_side_of_a_pair():
    songs = [Item(str(n), {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]
    asked = make_key(songs, kind="choice", n=4, seed=1).trials.values()
    assert Counter(one.right for one in asked) == {"left": 2, "right": 2}
    assert all(one.versions[("left", "right").index(one.right or "")] == "true" for one in asked)


def test_raters_get_the_same_trials_in_orders_of_their_own():
    ada, bob = (make_trials(WALTZES, **PICK, rater=name) for name in ("Ada", "Bob"))
    assert ada.study == bob.study == make_key(WALTZES, **PICK).study
    assert set(ada.trials) == set(bob.trials)
    assert ada.trials != bob.trials
    assert {trial.id for trial in ada.trials} == set(make_key(WALTZES, **PICK | {"seed": np.int64(5)}).trials)


@KINDS
def test_blind_trials_alone_give_every_rater_their_order_and_another_seed_others(items: list[Item], settings: dict):
    anyone = make_trials(items, **settings, rater="anyone")
    for name in ("Ada", "Zoë"):
        assert anyone.ordered_for(name) == make_trials(items, **settings, rater=name)
        assert anyone.ordered_for("Bob").ordered_for(name) == anyone.ordered_for(name)
    other = make_trials(items, **{**settings, "seed": 6}, rater="anyone")
    assert other.study != anyone.study
    assert {trial.id for trial in other.trials}.isdisjoint(trial.id for trial in anyone.trials)


@KINDS
def test_a_study_is_read_back_equal_and_the_raters_file_says_nothing(tmp_path: Path, items: list[Item], settings: dict):
    trials, key = make_trials(items, **settings, rater="Zoë"), make_key(items, **settings)
    files.write_study(tmp_path / "study", trials, key)
    assert files.read_trials(tmp_path / "study" / "trials.json") == trials
    assert files.read_key(tmp_path / "study" / "key.json") == key
    shown = (tmp_path / "study" / "trials.json").read_text()
    told = [text for item in items for text in (item.name, *item.versions, *item.versions.values())]
    assert [text for text in told if text in shown] == []
    assert set(json.loads(shown)) == {"study", "kind", "rater", "trials"}
    assert {tuple(sorted(row)) for row in json.loads(shown)["trials"]} == {("id", "stimuli")}


def test_key_of_another_study_is_refused(tmp_path: Path):
    trials, key = make_trials(WALTZES, **PICK, rater="Ada"), replace(make_key(WALTZES, **PICK), study="0" * 12)
    refused("do not go with the key of study", files.write_study, tmp_path, trials, key)


@cases(
    "change, message",
    ({"n": 10}, "n must be a multiple of 4"),
    ({"n": 0}, "n must be a multiple of 4 above 0"),
    ({"n": True}, "n must be a multiple of 4"),
    ({"n": 16}, "only 12 clips"),
    ({"kind": "rank"}, "kind must be 'pick', 'choice' or 'rate', got 'rank'"),
    ({"seed": -1}, "seed must be a whole number"),
    ({"rater": ""}, "a rater needs a name"),
    ({"rater": "a\nb"}, "a rater needs a name"),
    ({"truth": "right"}, "items need a version 'right'"),
    ({"items": []}, "a study needs items"),
    ({"items": [*WALTZES, Item("x", {"true": "a", "late": "b"})]}, "item 'x' has the versions"),
    ({"items": [*WALTZES, WALTZES[0]]}, "the name 'waltz 0' comes twice"),
    ({"items": [*WALTZES, Item("x", WALTZES[0].versions)]}, "the source 'waltz 0 true' comes twice"),
)
def test_settings_that_cannot_be_balanced_are_refused(change: dict[str, object], message: str):
    settings = {"items": WALTZES, **PICK, "rater": "Ada", **change}
    refused(message, make_trials, settings.pop("items"), **settings)


def test_trials_and_keys_that_contradict_their_kind_are_refused_and_an_item_with_one_version():
    refused("needs two or more versions", Item, "x", {"true": "a"})
    refused("must have 2 stimuli", TrialSet, "0" * 12, "choice", "Ada", (Trial("1" * 12, ("2" * 12,)),))
    asked = next(iter(make_key(WALTZES, **PICK).trials.values()))
    refused("right answer must be in", Key, "0" * 12, "pick", {"1" * 12: replace(asked, right="left")})


TRIAL = f'{{"id": "{"1" * 12}", "stimuli": ["{"2" * 12}"]}}'
GOOD = f'{{"study": "{"0" * 12}", "kind": "pick", "rater": "A", "trials": [{TRIAL}]}}'


def test_the_hand_written_trials_are_good(tmp_path: Path):
    (tmp_path / "t.json").write_text(GOOD)
    assert files.read_trials(tmp_path / "t.json").trials == (Trial("1" * 12, ("2" * 12,)),)


@cases(
    "read, content, message",
    (files.read_trials, "", "is empty"),
    (files.read_trials, "{", "Expecting property name"),
    (files.read_trials, "[]", "must have the fields study, kind, rater, trials"),
    (files.read_trials, "[" * 100_000, "cannot be read as the trials of a study"),
    (files.read_trials, GOOD.replace("0" * 12, "x"), "an id must be twelve hexadecimal digits"),
    (files.read_trials, GOOD.replace("1" * 12, "../etc/passwd"), "an id must be twelve hexadecimal digits"),
    (files.read_trials, GOOD.replace("pick", "choice"), "must have 2 stimuli"),
    (files.read_trials, GOOD.replace('"pick"', '["pick"]'), "kind must be"),
    (files.read_trials, GOOD.replace('"A"', "7"), "must be texts"),
    (files.read_trials, GOOD.replace('"id"', '"condition": "lagged", "id"'), "and no other"),
    (files.read_trials, GOOD.replace(TRIAL, f"{TRIAL}, {TRIAL}"), "of its own"),
    (files.read_trials, GOOD.replace(TRIAL, ""), "one or more trials"),
    (files.read_trials, GOOD.replace(f"[{TRIAL}]", "3"), "trials must be a list"),
    (files.read_scores, "[]", "from score to source"),
    (files.read_scores, '{"h": 1}', "from score to source"),
    (files.read_scores, '{"h": {"a": "1"}}', "a number or null"),
)
def test_damaged_trials_and_scores_are_refused_by_name(tmp_path: Path, read: Callable, content: str, message: str):
    (tmp_path / "t.json").write_text(content)
    refused(f"^{re.escape(str(tmp_path / 't.json'))}: .*{message}", read, tmp_path / "t.json")


@cases(
    "old, new, message",
    ('"harmonious"', '"left"', "right answer must be in"),
    ('"harmonious"', "[]", "right answer must be in"),
    ('"versions"', '"models"', "must have the fields item, versions"),
    ('"kind": "pick"', '"kind": "choice"', "must have 2 versions and sources"),
)
def test_damaged_key_is_refused_by_name(tmp_path: Path, old: str, new: str, message: str):
    files.write_study(tmp_path, make_trials(WALTZES, **PICK, rater="Ada"), make_key(WALTZES, **PICK))
    path = tmp_path / "key.json"
    path.write_text(path.read_text().replace(old, new))
    refused(f"^{re.escape(str(path))}: .*{message}", files.read_key, path)


@cases(
    "read, name, fault",
    (files.read_trials, "t.json", r"t\.json: no such file"),
    (lambda folder: files.read_page(folder, "2" * 12), ".", r"2{12}\.html: no such file"),
    (files.answer_files, ".", "nobody has answered yet"),
    (lambda path: files.merge([path]), "a.jsonl", r"a\.jsonl: no such file"),
    (AnswerLog, "none/a.jsonl", "create it first"),
)
def test_what_is_missing_is_named(tmp_path: Path, read: Callable[[Path], object], name: str, fault: str):
    missing(fault, read, tmp_path / name)


def test_pages_are_read_back_and_scores_with_those_that_do_not_exist(tmp_path: Path):
    files.write_page(tmp_path, "1" * 12, "<p>Zoë</p>")
    assert files.read_page(tmp_path, "1" * 12) == "<p>Zoë</p>"
    files.write_scores(tmp_path, {"h": {"a": 0.5, "b": math.nan}})
    assert json.loads((tmp_path / "scores.json").read_text()) == {"h": {"a": 0.5, "b": None}}
    assert files.read_scores(tmp_path / "scores.json")["h"] == pytest.approx({"a": 0.5, "b": math.nan}, nan_ok=True)


@pytest.mark.parametrize("name", ["Ada", "Zoë", "../../etc/passwd", ".", "a/b", "x" * 100, "é" * 100])
def test_every_rater_has_a_file_inside_the_study(tmp_path: Path, name: str):
    log = files.answer_log(tmp_path, name)
    trials = make_trials(WALTZES, **PICK, rater=name)
    log.record(trials, trials.trials[0].id, "harmonious")
    assert log.path.resolve().parent == tmp_path.resolve() / "answers"
    assert files.answer_files(tmp_path) == [log.path]


# Answers

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(40)]
ANSWER = Answer("0" * 12, "Ada", "1" * 12, "harmonious", "2026-01-01T00:00:00+00:00")

# Answers trial after trial until it is killed; says on its output what is surely written.
RATER = """
import sys
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import Item, make_trials
clips = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(40)]
trials = make_trials(clips, kind="pick", n=40, seed=1, rater="Ada")
log = AnswerLog(sys.argv[1])
for trial in log.resume(trials):
    log.record(trials, trial.id, "harmonious")
    print(trial.id, flush=True)
"""


def trials_of(rater: str, seed: int = 1) -> TrialSet:
    return make_trials(CLIPS, kind="pick", n=40, seed=seed, rater=rater)


@pytest.mark.parametrize("delay", [0.0, 0.007])
def test_kill_while_answering_keeps_every_confirmed_answer_and_the_study_goes_on(tmp_path: Path, delay: float):
    trials, log = trials_of("Ada"), AnswerLog(tmp_path / "answers.jsonl")
    with subprocess.Popen([sys.executable, "-c", RATER, log.path], stdout=subprocess.PIPE, text=True) as rater:
        said = [rater.stdout.readline().strip()]
        time.sleep(delay)
        rater.kill()
        said += rater.stdout.read().split()  # communicate() would lose what readline() has read ahead
    assert rater.returncode == -signal.SIGKILL
    found = [answer.trial for answer in log.read().answers]
    assert found[: len(said)] == said == [trial.id for trial in trials.trials[: len(said)]]
    assert len(found) <= len(said) + 1  # written, but killed before it could say so
    assert log.resume(trials) == trials.trials[len(found) :]
    log.record(trials, log.resume(trials)[0].id, "harmonious")  # the lock is free again
    assert len(log.read().answers) == len(found) + 1


def test_file_cut_anywhere_loses_only_the_line_it_was_cut_in(tmp_path: Path):
    path, cut = tmp_path / "answers.jsonl", tmp_path / "cut.jsonl"
    log = AnswerLog(path)
    answers = [replace(ANSWER, rater="Zoë", trial=f"{n:012x}") for n in range(2)]
    for answer in answers:
        log.append(answer)
    content = path.read_bytes()
    ends = [place + 1 for place, byte in enumerate(content) if byte == 10]
    for length in range(len(content) + 1):
        cut.write_bytes(content[:length])
        whole = sum(length >= end - 1 for end in ends)  # all but its line end is a whole answer too
        found = AnswerLog(cut).read()
        assert found.answers == tuple(answers[:whole])
        assert len(found.notes) == (length not in {0, *ends, *(end - 1 for end in ends)})


def test_answer_after_a_half_line_starts_a_line_of_its_own(tmp_path: Path):
    log, path = AnswerLog(tmp_path / "answers.jsonl"), tmp_path / "answers.jsonl"
    log.append(ANSWER)
    path.write_bytes(path.read_bytes() + path.read_bytes()[:30])
    after = replace(ANSWER, trial="2" * 12)
    log.append(after)
    assert log.read().answers == (ANSWER, after)
    assert log.read().notes == (f"{path}: line 2 was cut off while it was written; left out",)


def test_programs_that_write_at_once_do_not_mix_their_lines(tmp_path: Path):
    path = tmp_path / "answers.jsonl"
    answers = [replace(ANSWER, trial=f"{n:012x}") for n in range(40)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda answer: AnswerLog(path).append(answer), answers))
    assert set(AnswerLog(path).read().answers) == set(answers)


def two_logs(folder: Path, **second: str) -> list[Path]:
    """Two files of one answer each, the second with these fields of its own."""
    paths = [folder / "a.jsonl", folder / "b.jsonl"]
    for path, answer in zip(paths, (ANSWER, replace(ANSWER, **second)), strict=True):
        AnswerLog(path).append(answer)
    return paths


def test_files_of_two_raters_merge(tmp_path: Path):
    merged = files.merge(two_logs(tmp_path, rater="Bob", choice="inharmonious"))
    assert (merged.raters, len(merged.answers), merged.notes, merged.simulated) == (("Ada", "Bob"), 2, (), False)


def test_the_earlier_of_two_answers_counts_whatever_its_file_is_called(tmp_path: Path):
    paths = two_logs(tmp_path, choice="inharmonious", time="2000-01-01T00:00:00+00:00")
    merged = files.merge(paths)
    assert [answer.choice for answer in merged.answers] == ["inharmonious"] != [ANSWER.choice]
    assert merged.notes == (f"{paths[0]}: line 1: Ada had answered trial 111111111111 before; left out",)


def test_of_two_answers_of_a_rater_to_a_trial_the_first_counts_and_the_second_is_reported(tmp_path: Path):
    paths = two_logs(tmp_path, choice="inharmonious")
    merged = files.merge(paths)
    assert merged.answers == (ANSWER,)
    assert merged.notes == (f"{paths[1]}: line 1: Ada had answered trial 111111111111 before; left out",)


def test_files_of_two_studies_do_not_merge_and_neither_is_gone_on_with_in_a_third(tmp_path: Path):
    paths = two_logs(tmp_path, study="f" * 12)
    refused(r"b\.jsonl: line 1 is of study ffffffffffff, but .*a\.jsonl is of study 0000", files.merge, paths)
    refused("answer files are needed, in a list", files.merge, [])
    refused("holds answers of study 000000000000", AnswerLog(paths[0]).resume, trials_of("Ada"))


def test_trial_is_answered_once_and_with_an_answer_of_its_kind(tmp_path: Path):
    log, trials = AnswerLog(tmp_path / "a.jsonl"), trials_of("Ada")
    log.record(trials, trials.trials[0].id, "harmonious")
    refused("not waiting for an answer of Ada", log.record, trials, trials.trials[0].id, "harmonious")
    refused("choice must be one of", log.record, trials, trials.trials[1].id, "left")
    assert len(log.read().answers) == 1


LINE = json.dumps({"study": "0" * 12, "rater": "Ada", "trial": "1" * 12, "choice": "left", "time": ""})
WHOLE = LINE[:-1] + ', "simulated": false}'


@cases(
    "content, message",
    (b"\x80\x04K\x01.\n", "line 1 is not an answer"),
    (b"hello\n", "line 1 is not an answer"),
    (f"{WHOLE}\n[]\n".encode(), "line 2 must have the fields"),
    (f"{LINE}\n".encode(), "line 1 must have the fields"),
    (WHOLE.replace('"left"', '"up"').encode(), "line 1: choice must be one of"),
    (WHOLE.replace('"left"', "[1]").encode(), "line 1: choice must be text"),
    (WHOLE.replace("Ada", "simulated-1").encode(), "line 1: a simulated rater"),
    (WHOLE.replace("false", "true").encode(), "line 1: a simulated rater"),
    (WHOLE.replace("Ada", "").encode(), "line 1: an answer needs a study, a rater and a trial"),
    (b"[" * 100_000, "line 1 is not an answer"),
)
def test_file_that_is_no_answer_file_is_refused_by_name_and_line(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "a.jsonl").write_bytes(content)
    fault = rf"^{re.escape(str(tmp_path / 'a.jsonl'))}: {message}[^\n]{{0,300}}$"
    refused(fault, files.merge, [tmp_path / "a.jsonl"])


@pytest.mark.parametrize("seconds", ["1.5", "null"])
def test_an_older_file_that_says_how_long_an_answer_took_is_read_and_gone_on_with(tmp_path: Path, seconds: str):
    (tmp_path / "a.jsonl").write_text(f'{WHOLE[:-1]}, "seconds": {seconds}}}\n')
    later = replace(ANSWER, choice="right", trial="2" * 12)
    AnswerLog(tmp_path / "a.jsonl").append(later)
    assert files.merge([tmp_path / "a.jsonl"]).answers == (replace(ANSWER, choice="left", time=""), later)


# Analysis

SONGS = [Item(f"song {n}", {"A": f"{n} A", "B": f"{n} B"}) for n in range(40)]
NAN = math.nan
STUDIES = 100
FEW = 12  # where a bootstrap takes its time


def study(skills: list[float], *, seed: int = 0, kind: str = "pick", prefers: str | None = None) -> Grid:
    """The answers of simulated raters with these skills to 40 trials."""
    items = CLIPS if kind == "pick" else SONGS
    key = make_key(items, kind=kind, n=40, seed=seed)
    raters = [SimulatedRater(skill, 1000 * seed + n, prefers) for n, skill in enumerate(skills)]
    asked = make_trials(items, kind=kind, n=40, seed=seed, rater="anyone")
    given = [answer for rater in raters for answer in rater.answers(asked.ordered_for(rater.name), key)]
    return analysis.answer_grid(Answers(tuple(given)), key)


def people(rows: list[str], key_seed: int = 0) -> Grid:
    """The answers of people, a string of 0, 1 and . for each: 1 is "inharmonious", a dot is no answer."""
    key = make_key(CLIPS, kind="pick", n=40, seed=key_seed)
    given = [
        Answer(key.study, f"person {n}", trial, ("harmonious", "inharmonious")[int(mark)])
        for n, row in enumerate(rows)
        for trial, mark in zip(key.trials, row, strict=False)
        if mark != "."
    ]
    return analysis.answer_grid(Answers(tuple(given)), key)


@pytest.mark.slow  # 100 studies
@pytest.mark.parametrize("skill", [0.5, 0.8])
def test_interval_of_every_rater_and_of_all_covers_the_planted_skill_as_often_as_it_says(skill: float):
    tables = [analysis.rater_rows(study([skill] * 6, seed=seed)) for seed in range(STUDIES)]
    covered = np.array([[row["low"] <= skill <= row["high"] for row in rows] for rows in tables])
    assert 0.90 <= covered[:, :-1].mean() <= 0.99
    assert 0.90 <= covered[:, -1].mean() <= 0.99


@pytest.mark.slow  # 100 studies
def test_interval_of_all_holds_for_raters_of_unequal_skill_where_counting_answers_fails():
    rng = np.random.default_rng(1)
    tables = [study(list(rng.uniform(0.5, 1.0, 8)), seed=seed).right() for seed in range(STUDIES)]
    rates = [(analysis.pooled_rate(right), analysis.wilson_rate(right.ravel())) for right in tables]
    pooled, counted = np.mean([[rate["low"] <= 0.75 <= rate["high"] for rate in pair] for pair in rates], axis=0)
    assert 0.90 <= pooled <= 0.99
    assert counted < 0.8


def test_wilson_interval_is_that_of_the_textbook():
    rate = analysis.wilson_rate(np.array([1.0] * 8 + [0.0] * 2 + [NAN]))
    assert (rate["n"], rate["rate"]) == (10, 0.8)
    # Centre (0.8 + z²/20) / (1 + z²/10), half width z sqrt(0.016 + z²/400) / (1 + z²/10), with z = 1.959964.
    assert (rate["low"], rate["high"]) == pytest.approx((0.490162, 0.943318), abs=1e-6)


def test_pooled_rate_of_one_rater_without_repeats_is_wilsons():
    values = np.array([[1.0, 1, 0, 1, 1, 1, 0, 1, 1, 1]])
    assert analysis.pooled_rate(values) == pytest.approx(analysis.wilson_rate(values), abs=0.03)


def test_pooled_rate_of_answers_that_are_alike_counts_raters_or_trials_not_answers():
    values = np.repeat([[1.0], [1.0], [0.0], [0.0]], 50, axis=1)
    for alike in (values, values.T):  # four raters who never waver; four trials that all answer in the same way
        # A variance of 1/12, as of 3 answers: Wilson's low is 0.125, with Student's quantile (3 degrees) 0.063.
        assert 0.02 < analysis.pooled_rate(alike)["low"] < 0.1
        assert 0.9 < analysis.pooled_rate(alike)["high"] < 0.98


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_unanimous_answers_still_have_an_interval(share: float):
    rate = analysis.pooled_rate(np.full((3, 10), share))
    assert rate["rate"] == share
    assert 0.1 < rate["high"] - rate["low"] < 0.2  # Wilson for 30 of 30: 0.886 to 1


def test_nothing_answered_has_no_rate():
    for measure in (analysis.pooled_rate, analysis.wilson_rate):
        rate = measure(np.full((2, 3), NAN))
        assert rate["n"] == 0
        assert np.isnan([rate["rate"], rate["low"], rate["high"]]).all()


def test_right_answers_are_counted_against_the_key():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    wrong = "".join("1" if asked.right == "inharmonious" else "0" for asked in key.trials.values())
    rows = analysis.rater_rows(people([wrong, "1" * 40, "." * 39 + "1"]))
    assert [(row["rater"], row["n"], row["rate"]) for row in rows[:2]] == [("person 0", 40, 1.0), ("person 1", 40, 0.5)]
    assert (rows[2]["n"], rows[3]["rater"], rows[3]["n"]) == (1, "all", 81)
    assert not any(row["simulated"] for row in rows)


def test_conditions_are_called_inharmonious_as_often_as_planted():
    planted = {"lagged": 0.9, "true": 0.1}
    rows = [row for seed in range(FEW) for row in analysis.version_rows(study([0.9] * 6, seed=seed))]
    assert Counter(row["version"] for row in rows) == {"true": FEW, "lagged": FEW}
    assert np.mean([row["low"] <= planted[row["version"]] <= row["high"] for row in rows]) >= 0.85


def test_preference_between_two_models_does_not_depend_on_the_side():
    (row,) = analysis.version_rows(study([1.0], kind="choice", prefers="A"))
    assert (row["version"], row["rate"], row["n"]) == ("A over B", 1.0, 40)
    assert analysis.version_rows(study([1.0], kind="choice", prefers="B"))[0]["rate"] == 0.0


def test_kappa_is_that_of_cohens_formula():
    first = np.array([1.0] * 25 + [0.0] * 25 + [NAN])
    second = np.array([1.0] * 20 + [0.0] * 5 + [1.0] * 10 + [0.0] * 15 + [1.0])
    assert analysis.cohen_kappa(first, second) == pytest.approx((0.7 - 0.5) / 0.5)
    assert math.isnan(analysis.cohen_kappa(np.ones(4), np.ones(4)))
    assert math.isnan(analysis.cohen_kappa(np.array([NAN]), np.array([1.0])))


def test_alpha_is_that_of_krippendorffs_formula():
    # Ten trials, two raters, four disagreements; 14 zeros and 6 ones: 1 - 19 * 4 / (6 * 14) (Krippendorff 2011, A).
    first = np.array([0, 1, 0, 0, 0, 0, 0, 0, 1, 0], float)
    second = np.array([1, 1, 1, 0, 0, 1, 0, 0, 0, 0], float)
    assert analysis.krippendorff_alpha(np.array([first, second])) == pytest.approx(0.095, abs=5e-4)
    alone = np.array([[*first, 1.0], [*second, NAN]])
    assert analysis.krippendorff_alpha(alone) == pytest.approx(analysis.krippendorff_alpha(np.array([first, second])))
    assert math.isnan(analysis.krippendorff_alpha(np.ones((3, 4))))


@pytest.mark.parametrize(("raters", "measure"), [(2, "Cohen's kappa"), (4, "Krippendorff's alpha")])
def test_agreement_of_two_is_kappa_and_of_more_alpha(raters: int, measure: str):
    row = analysis.agreement_row(study([0.9] * raters))
    assert (row["measure"], row["low"] < row["rate"] < row["high"]) == (measure, True)


@pytest.mark.slow  # 1000 resamplings of each of 12 studies
@pytest.mark.parametrize("raters", [2, 4])
def test_agreement_and_its_interval_cover_what_was_planted(raters: int):
    rows = [analysis.agreement_row(study([0.9] * raters, seed=seed)) for seed in range(FEW)]
    # Independent errors of 10 %: two agree in 0.82, by chance in 0.5, which makes 0.64.
    assert np.mean([row["rate"] for row in rows]) == pytest.approx(0.64, abs=0.06)
    assert np.mean([row["low"] <= 0.64 <= row["high"] for row in rows]) >= 0.8


def truth() -> dict[str, dict[str, float]]:
    """A score that knows the right answers."""
    return {"truth": {source: float(source.endswith("t")) for clip in CLIPS for source in clip.versions.values()}}


@pytest.mark.slow
def test_correlation_with_the_planted_truth_is_the_raters_skill_and_covered_by_its_interval():
    rows = [analysis.score_rows(study([0.9] * 4, seed=seed), truth())[0] for seed in range(6)]
    # Right in 90 %, two values of each: the correlation of single answers is 0.9 - 0.1, their AUC 0.9.
    assert np.mean([row["point_biserial"] for row in rows]) == pytest.approx(0.8, abs=0.03)
    assert np.mean([row["auc"] for row in rows]) == pytest.approx(0.9, abs=0.015)
    assert np.mean([row["pb_low"] <= 0.8 <= row["pb_high"] for row in rows]) >= 0.8


def test_score_turned_round_turns_its_correlation_round_and_one_that_never_varies_has_none():
    good = truth()["truth"]
    scores = {"good": good, "bad": {name: -value for name, value in good.items()}, "flat": dict.fromkeys(good, 1.0)}
    rows = {row["score"]: row for row in analysis.score_rows(study([0.9] * 4), scores)}
    assert rows["good"]["low"] > 0.5
    assert rows["bad"]["rank"] == pytest.approx(-rows["good"]["rank"])
    assert math.isnan(rows["flat"]["rank"])
    assert rows["flat"]["auc"] == 0.5


def test_choice_follows_the_difference_of_the_two_scores():
    scores = {"planted": {f"{n} {v}": n + (v == "A") for n in range(40) for v in "AB"}}
    (row,) = analysis.score_rows(study([1.0] * 2, kind="choice", prefers="A"), scores)
    assert (row["rank"], row["auc"]) == pytest.approx((1.0, 1.0))


def test_what_cannot_be_analysed_is_refused():
    refused("use version_rows", analysis.rater_rows, study([0.8], kind="choice", prefers="A"))
    refused("two raters or more", analysis.agreement_row, study([0.9]))
    refused("give prefers=", study, [0.8], kind="choice")
    refused(r"score 'h' has no value for '0 ", analysis.score_rows, study([0.9]), {"h": {}})


def test_answers_that_do_not_go_together_are_refused():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    good = Answer(key.study, "Ada", next(iter(key.trials)), "harmonious")
    mixed = replace(good, rater="simulated-1", simulated=True)
    refused("no answers", analysis.answer_grid, Answers(()), key)
    refused("people and simulated raters", analysis.answer_grid, Answers((good, mixed)), key)
    refused("do not go with the key", analysis.answer_grid, Answers((replace(good, study="x"),)), key)
    refused("the key knows no answer", analysis.answer_grid, Answers((replace(good, trial="x"),)), key)
    refused("the key knows no answer 'left'", analysis.answer_grid, Answers((replace(good, choice="left"),)), key)


def test_simulated_rater_is_called_so_in_everything_it_writes():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    rater = SimulatedRater(0.7, 3)
    trials = trials_of(rater.name, seed=0)
    answers = rater.answers(trials, key)
    assert answers == rater.answers(trials, key)
    assert {(answer.rater, answer.simulated) for answer in answers} == {("simulated-3", True)}
    refused("a simulated rater, and no other", replace, answers[0], simulated=False)
    refused("a simulated rater, and no other", replace, answers[0], rater="Ada")
    refused("was given trials of Ada", rater.answers, replace(trials, rater="Ada"), key)


@cases("skill, seed, name", (1.1, 0, "skill"), (NAN, 0, "skill"), (0.5, -1, "seed"), (0.5, 0.5, "seed"))
def test_impossible_rater_is_refused(skill: float, seed: int, name: str):
    refused(f"{name} must", SimulatedRater, skill, seed)


def test_figures_of_simulated_raters_say_so_and_those_of_people_do_not():
    for grid, title, marks in (
        (study([0.9, 0.6]), "Who was right? (simulated raters, no people)", ["simulated: no people"]),
        (people(["01" * 20]), "Who was right?", []),
    ):
        (ax,) = rates_figure(analysis.rater_rows(grid), label="right answers", title="Who was right?").axes
        assert (ax.get_title(loc="left") or ax.get_title()) == title
        assert [text.get_text() for text in ax.texts if text.get_gid() == "watermark"] == marks


def test_rows_that_do_not_say_who_answered_are_not_drawn():
    rows = [{"rater": "Ada", "rate": 0.5, "low": 0.4, "high": 0.6, "n": 9}]
    refused('must say "simulated"', rates_figure, rows, label="right", title="")
    refused('must say "simulated"', study_title, "Table", [])


# Marks from 0 to 10

SYSTEMS = ("WaveNet", "LSTM")
ITEMS = [Item(f"song {i}", {name: f"{i} {name}" for name in SYSTEMS}) for i in range(20)]
DESIGN = {"kind": "rate", "n": 40, "seed": 3, "truth": ""}
MARKS = make_key(ITEMS, **DESIGN)


def marked(*rows: tuple[str, int, str]) -> Answers:
    """Answers of raters to trials by number."""
    return Answers(tuple(Answer(MARKS.study, rater, sorted(MARKS.trials)[n], text) for rater, n, text in rows))


def test_every_system_is_marked_as_often_and_no_dance_twice():
    entries = MARKS.trials.values()
    assert Counter(entry.versions[0] for entry in entries) == {"WaveNet": 20, "LSTM": 20}
    assert len({entry.sources for entry in entries}) == 40
    assert {entry.right for entry in entries} == {None}
    refused("multiple of 2", make_key, ITEMS, **{**DESIGN, "n": 7})
    refused("only 40 dances", make_key, ITEMS, **{**DESIGN, "n": 42})


@pytest.mark.parametrize("text", ["8 7 10", "8 7 10 11", "8 7 10 -1", "8 7 10 3 2", "a b c d", "8,7,10,3", "left", ""])
def test_what_is_no_four_marks_is_refused(text: str):
    assert not blind.is_answer("rate", text)
    refused(r"four|4 whole", blind.marks_of, text)


def test_means_and_weights_by_hand():
    version = MARKS.trials[min(MARKS.trials)].versions[0]
    rows = analysis.mark_rows(marked(("Ada", 0, "8 6 10 2"), ("Bob", 0, "6 6 4 4")), MARKS)
    (own,) = [row for row in rows if row["version"] == version and row["side"] == analysis.MARK]
    assert own["n"] == 1 and own["raters"] == 2 and not own["simulated"]
    assert own["rate"] == pytest.approx(np.mean([0.25 * 8 + 0.25 * 6 + 0.4 * 10 + 0.1 * 2, 0.5 * 6 + 0.4 * 4 + 0.4]))
    assert next(row for row in rows if row["version"] == version and row["side"] == "music")["rate"] == 7.0
    assert sum(analysis.WEIGHTS.values()) == pytest.approx(1.0)


def test_agreement_of_marks_is_krippendorffs_alpha():
    assert analysis.krippendorff_alpha(np.array([[1.0, 2, 3], [1.0, 2, 3]])) == 1.0
    assert abs(analysis.krippendorff_alpha(np.random.default_rng(0).integers(0, 11, (8, 400)).astype(float))) < 0.05
    refused("two raters", analysis.agreement_of_marks, marked(("Ada", 0, "8 6 10 2")), MARKS)


def test_simulated_raters_find_the_system_that_they_prefer():
    raters = [SimulatedRater(0.9, seed, prefers="WaveNet") for seed in range(1, 6)]
    asked = [(rater, make_trials(ITEMS, **DESIGN, rater=rater.name)) for rater in raters]
    answers = [answer for rater, trials in asked for answer in rater.answers(trials, MARKS)]
    tables = analysis.study_tables(Answers(tuple(answers)), MARKS, {})
    assert set(tables) == {"marks", "agreement"} and all(row["simulated"] for row in tables["marks"])
    means = {row["version"]: row for row in tables["marks"] if row["side"] == analysis.MARK}
    assert means["WaveNet"]["low"] > means["LSTM"]["high"]
    assert means["WaveNet"]["n"] == 20 and tables["agreement"][0]["rate"] > 0.5


def test_the_page_asks_four_marks_and_saves_them(tmp_path):
    trials = make_trials(ITEMS, **DESIGN, rater="Ada")
    server = StudyServer(trials, AnswerLog(tmp_path / "answers.jsonl"), lambda trial: "<p>dance</p>")
    with server.running():
        waiting, page = server.turn()
        assert all(f'name="{side}"' in page for side in blind.MARKED) and "professionals" in page
        server.post(urlencode(dict(zip(blind.MARKED, "8709", strict=True)) | {"trial": waiting[0].id}))
        (answer,) = AnswerLog(tmp_path / "answers.jsonl").read().answers
        assert answer.choice == "8 7 0 9"
        refused("not saved", server.post, urlencode({"trial": waiting[1].id, "music": "4"}))


# Pieces of a corpus

SECONDS = 5.0


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    """Four rumbas and four tangos of 9 s, each at a loudness of its own."""
    plain = [harmolab.synthetic_clip(("rumba", "tango")[n % 2], seconds=9.0, seed=n) for n in range(8)]
    sounds = [Audio(clip.audio.samples * 0.1 * (n + 1), clip.audio.sample_rate) for n, clip in enumerate(plain)]
    return [replace(clip, name=f"clip {n}", audio=sounds[n]) for n, clip in enumerate(plain)]


@pytest.fixture(scope="module")
def lagged(clips: list[Clip]) -> Pieces:
    return corpus.lagged_pieces(clips, seconds=SECONDS, seed=3)


@pytest.fixture(scope="module")
def swapped(clips: list[Clip]) -> Pieces:
    return corpus.swapped_pieces(clips, seconds=SECONDS, seed=3)


def power(samples: np.ndarray) -> float:
    return float(np.sqrt(np.mean(samples**2)))


def start_of(clip: Clip, positions: np.ndarray) -> int:
    """The frame of a clip at which these positions begin."""
    whole = clip.motion.positions
    apart = [np.abs(whole[k : k + 30] - positions[:30]).max() for k in range(len(whole) - 30)]
    assert min(apart) < 1e-9
    return int(np.argmin(apart))


def test_lagged_dance_is_the_same_half_a_beat_late(clips: list[Clip], lagged: Pieces):
    assert [piece.name for piece in lagged.pieces] == [clip.name for clip in clips]
    for clip, piece in zip(clips, lagged.pieces, strict=True):
        late = start_of(clip, piece.motions["true"].positions) - start_of(clip, piece.motions["lagged"].positions)
        assert late / corpus.FPS == pytest.approx(0.5 * np.median(np.diff(clip.beats.times)), abs=0.5 / corpus.FPS)


def test_music_and_true_dance_are_those_of_one_moment(clips: list[Clip], lagged: Pieces):
    for clip, piece in zip(clips, lagged.pieces, strict=True):
        start = start_of(clip, piece.motions["true"].positions) / corpus.FPS
        rate = round(clip.audio.sample_rate)
        heard = clip.audio.samples[round(start * rate) :][: piece.audio.samples.size]
        middle = slice(rate // 10, -rate // 10)  # not the fades
        assert np.corrcoef(heard[middle], piece.audio.samples[middle])[0, 1] > 1 - 1e-9
        np.testing.assert_allclose(piece.beats.times, clip.beats.span(start, SECONDS).times, atol=1e-9)


def test_offset_between_music_and_dance_is_kept(clips: list[Clip]):
    moved = replace(clips[0], offset=0.7, motion=clips[0].motion.span(0.7, 9.0))
    piece = corpus.lagged_pieces([moved], seconds=SECONDS, seed=3).pieces[0]
    start = start_of(clips[0], piece.motions["true"].positions) / corpus.FPS
    np.testing.assert_allclose(piece.beats.times, clips[0].beats.span(start, SECONDS).times, atol=1e-9)


@pytest.mark.parametrize("made", ["lagged", "swapped"])
def test_sounds_and_dances_are_equally_long_loud_faded_and_begin_with_sound(made: str, request: pytest.FixtureRequest):
    pieces = request.getfixturevalue(made).pieces
    samples = [piece.audio.samples for piece in pieces]
    motions = [motion for piece in pieces for motion in piece.motions.values()]
    assert {(motion.n_frames, motion.fps) for motion in motions} == {(round(SECONDS * corpus.FPS), corpus.FPS)}
    assert np.ptp([sound.size for sound in samples]) <= 1
    assert {round(power(sound), 9) for sound in samples} == {round(power(samples[0]), 9)}
    assert 0.2 * corpus.LOUDNESS < power(samples[0]) <= corpus.LOUDNESS + 1e-9
    assert max(np.abs(sound).max() for sound in samples) <= 0.99 + 1e-9
    assert max(abs(sound[at]) for sound in samples for at in (0, -1)) < 1e-9
    for piece in pieces:
        beginning = piece.audio.samples[: round(corpus.ONSET * piece.audio.sample_rate)]
        assert power(beginning) > corpus.QUIET * power(piece.audio.samples)


def test_swapped_dance_is_of_another_clip_of_its_kind_and_nothing_comes_twice(clips: list[Clip], swapped: Pieces):
    kinds = {clip.name: clip.dance for clip in clips}
    found = []
    for piece in swapped.pieces:
        first = piece.motions["swapped"].positions[0]
        (lender,) = [clip.name for clip in clips if np.abs(clip.motion.positions - first).max((1, 2)).min() < 1e-9]
        assert kinds[lender] == kinds[piece.name] == piece.dance
        found += [piece.name, lender]
    assert sorted(found) == sorted(kinds)


def test_clip_without_a_partner_and_clips_that_are_too_short_are_left_out_and_named(clips: list[Clip]):
    made = corpus.swapped_pieces([*clips[:4:2], clips[1]], seconds=SECONDS, seed=1)
    assert len(made.pieces) == 1
    assert made.left_out == ("clip 1: no other clip is left to swap its dance (tango) with",)
    short = corpus.lagged_pieces(clips[:1], seconds=8.9, seed=1)
    assert short.left_out == ("clip 0: has no 8.9 s of dance and music together",)
    still = corpus.lagged_pieces([replace(clips[0], motion=None)], seconds=4.0, seed=1)
    assert still.left_out == ("clip 0: has no motion to show",)


def test_music_that_is_silent_at_first_begins_where_it_sounds(clips: list[Clip]):
    samples = np.array(clips[0].audio.samples)
    samples[: round(2.5 * clips[0].audio.sample_rate)] = 0.0
    quiet = replace(clips[0], audio=Audio(samples, clips[0].audio.sample_rate))
    for seed in range(5):
        piece = corpus.lagged_pieces([quiet], seconds=SECONDS, seed=seed).pieces[0]
        assert start_of(clips[0], piece.motions["true"].positions) / corpus.FPS > 2.5 - corpus.ONSET
    silent = replace(quiet, audio=Audio(np.zeros(samples.size), quiet.audio.sample_rate))
    assert "that begin with sound" in corpus.lagged_pieces([silent], seconds=SECONDS, seed=0).left_out[0]


def test_same_seed_gives_the_same_pieces_whatever_other_clips_there_are(clips: list[Clip], lagged: Pieces):
    alone = corpus.lagged_pieces(clips[2:3], seconds=SECONDS, seed=3).pieces[0]
    np.testing.assert_array_equal(alone.motions["true"].positions, lagged.pieces[2].motions["true"].positions)
    pairs = zip(lagged.pieces, corpus.lagged_pieces(clips, seconds=SECONDS, seed=4).pieces, strict=True)
    assert not all(np.array_equal(*(piece.motions["true"].positions for piece in pair)) for pair in pairs)


def test_two_dances_to_one_music_are_cut_at_the_same_moment_and_shown_at_one_rate(clips: list[Clip]):
    slow = clips[2].motion
    other = replace(slow, positions=slow.positions[::2], fps=30.0, valid=slow.valid[::2])
    made = corpus.paired_pieces([(clips[0], other, 0.0)], ("ours", "theirs"), seconds=SECONDS, seed=2)
    motions = made.pieces[0].motions
    assert list(motions) == ["ours", "theirs"]
    assert {motion.n_frames for motion in motions.values()} == {round(SECONDS * corpus.FPS)}
    start = start_of(clips[0], motions["ours"].positions)
    expected = slow.positions[start : start + round(SECONDS * corpus.FPS)]
    np.testing.assert_allclose(motions["theirs"].positions, expected, atol=0.02)
    items = [*made.items, replace(made.items[0], name="x", versions={"ours": "1", "theirs": "2"})]
    assert {asked.right for asked in make_key(items, kind="choice", n=2, seed=0, truth="").trials.values()} == {None}


@cases("own, others", (0.0, 2.1), (2.1, 0.0), (0.5, 0.5))
def test_two_dances_show_one_moment_of_the_music_wherever_files_begin(clips: list[Clip], own: float, others: float):
    whole = clips[0].motion
    clip = replace(clips[0], motion=whole.span(own, 9.0), offset=own)
    made = corpus.paired_pieces([(clip, whole.span(others, 9.0), others)], ("a", "b"), seconds=SECONDS, seed=2)
    motions = made.pieces[0].motions
    np.testing.assert_array_equal(motions["a"].positions, motions["b"].positions)


@cases(
    "change, message",
    ({"seconds": 1.0}, "seconds must be between 2 and 60"),
    ({"seconds": float("nan")}, "seconds must be between 2 and 60"),
    *(({"seed": seed}, "seed must be a whole number, not negative") for seed in (-1, 0.5)),
)
def test_settings_out_of_range_are_refused(clips: list[Clip], change: dict[str, float], message: str):
    settings = {"seconds": SECONDS, "seed": 1, **change}
    refused(message, corpus.lagged_pieces, clips, **settings)
    refused(message, corpus.swapped_pieces, clips, **settings)
    refused("two names", corpus.paired_pieces, [], ("a", "a"), seconds=SECONDS, seed=1)


def test_trial_shows_the_dances_that_its_key_names_to_the_music_of_its_item(lagged: Pieces):
    piece = lagged.pieces[2]
    audio, motions = lagged.presented(KeyEntry(piece.name, ("lagged", "true"), ("a", "b"), "right"))
    assert audio is piece.audio
    assert motions == [piece.motions["lagged"], piece.motions["true"]]


def test_scores_of_a_study_are_those_of_each_dance_shown(lagged: Pieces):
    piece = lagged.pieces[0]
    scores = lagged.scores([KeyEntry(piece.name, ("true", "lagged"), ("a", "b"), "left")])
    expected = corpus.clip_scores(piece.clip("lagged"))
    assert {name: values["b"] for name, values in scores.items()} == pytest.approx(expected, nan_ok=True)
    assert set(scores) >= {"paper_h", "paper_above_chance", "valleys_above_chance", "recommended_above_chance"}
    assert scores["valleys_above_chance"]["a"] > scores["valleys_above_chance"]["b"] + 0.3
    assert np.isnan([*scores["recommended_above_chance"].values()]).all()  # six seconds hold fewer than 16 beats


def test_a_dance_off_the_beat_has_a_recommended_score_also_to_unsure_beats():
    clip = harmolab.synthetic_clip("jive", seconds=24.0, seed=1)
    late = replace(clip, motion=replace(clip.motion, positions=np.roll(clip.motion.positions, 5, axis=0)))
    unsure = replace(late, beats=replace(clip.beats, quality=0.5, windows=[[12.0, 0.0]]))
    out_of_time = replace(unsure, beats=replace(unsure.beats, times=0.83 * clip.beats.times))
    on, off, same, other = (
        corpus.clip_scores(one)["recommended_above_chance"] for one in (clip, late, unsure, out_of_time)
    )
    assert on > 0.5 > off == same and abs(other) < 0.4
