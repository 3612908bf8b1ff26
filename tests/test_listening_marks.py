"""Marks from 0 to 10: balanced trials, answers that are checked, means and agreement with known results."""

from urllib.parse import urlencode

import numpy as np
import pytest

from harmolab.lab.listening.analysis import MARK, WEIGHTS, agreement_of_marks, interval_alpha, mark_rows, study_tables
from harmolab.lab.listening.answers import Answer, AnswerLog, Answers, SimulatedRater
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.listening.trials import MARKED, Item, is_answer, make_key, make_trials, marks_of
from tests.builders import refused

SYSTEMS = ("WaveNet", "LSTM")
ITEMS = [Item(f"song {i}", {name: f"{i} {name}" for name in SYSTEMS}) for i in range(20)]
DESIGN = {"kind": "rate", "n": 40, "seed": 3, "truth": ""}


def study(rater: str = "Ada"):
    return make_trials(ITEMS, **DESIGN, rater=rater), make_key(ITEMS, **DESIGN)


def marked(*rows: tuple[str, int, str]) -> Answers:
    """Answers of raters to trials by number."""
    trials, _ = study()
    ids = sorted(trial.id for trial in trials.trials)
    return Answers(tuple(Answer(trials.study, rater, ids[number], text) for rater, number, text in rows))


def test_every_system_is_marked_as_often_and_no_dance_twice():
    _, key = study()
    versions = [entry.versions[0] for entry in key.trials.values()]
    assert {name: versions.count(name) for name in SYSTEMS} == {"WaveNet": 20, "LSTM": 20}
    assert len({entry.sources for entry in key.trials.values()}) == 40
    assert all(entry.right is None for entry in key.trials.values())
    refused("multiple of 2", make_key, ITEMS, **{**DESIGN, "n": 7})
    refused("only 40 dances", make_key, ITEMS, **{**DESIGN, "n": 42})


@pytest.mark.parametrize("text", ["8 7 10", "8 7 10 11", "8 7 10 -1", "8 7 10 3 2", "a b c d", "8,7,10,3", "left", ""])
def test_what_is_no_four_marks_is_refused(text: str):
    assert not is_answer("rate", text)
    refused(r"four|4 whole", marks_of, text)


def test_means_and_weights_by_hand():
    _, key = study()
    version = key.trials[sorted(key.trials)[0]].versions[0]
    rows = mark_rows(marked(("Ada", 0, "8 6 10 2"), ("Bob", 0, "6 6 4 4")), key)
    (own,) = [row for row in rows if row["version"] == version and row["side"] == MARK]
    assert own["n"] == 1 and own["raters"] == 2 and not own["simulated"]
    assert own["rate"] == pytest.approx(np.mean([0.25 * 8 + 0.25 * 6 + 0.4 * 10 + 0.1 * 2, 0.5 * 6 + 0.4 * 4 + 0.4]))
    assert next(row for row in rows if row["version"] == version and row["side"] == "music")["rate"] == 7.0
    assert sum(WEIGHTS.values()) == pytest.approx(1.0)


def test_agreement_of_marks_is_krippendorffs_alpha():
    assert interval_alpha(np.array([[1.0, 2, 3], [1.0, 2, 3]])) == 1.0
    assert np.isnan(interval_alpha(np.full((2, 3), 5.0)))
    assert abs(interval_alpha(np.random.default_rng(0).integers(0, 11, (8, 400)).astype(float))) < 0.05
    refused("two raters", agreement_of_marks, marked(("Ada", 0, "8 6 10 2")), study()[1])


def test_simulated_raters_find_the_system_that_they_prefer():
    _, key = study()
    raters = [SimulatedRater(0.9, seed, prefers="WaveNet") for seed in range(1, 6)]
    answers = Answers(sum((rater.answers(study(rater.name)[0], key) for rater in raters), ()))
    tables = study_tables(answers, key, {})
    assert set(tables) == {"marks", "agreement"} and all(row["simulated"] for row in tables["marks"])
    means = {row["version"]: row for row in tables["marks"] if row["side"] == MARK}
    assert means["WaveNet"]["low"] > means["LSTM"]["high"]
    assert means["WaveNet"]["n"] == 20 and tables["agreement"][0]["rate"] > 0.5


def test_the_page_asks_four_marks_and_saves_them(tmp_path):
    trials, _ = study()
    server = StudyServer(trials, AnswerLog(tmp_path / "answers.jsonl"), lambda trial: "<p>dance</p>")
    with server.running():
        waiting, page = server.turn()
        assert all(f'name="{side}"' in page for side in MARKED) and "professionals" in page
        form = dict(zip(MARKED, "8709", strict=True)) | {"trial": waiting[0].id}
        server.post(urlencode(form))
        (answer,) = AnswerLog(tmp_path / "answers.jsonl").read().answers
        assert answer.choice == "8 7 0 9"
        refused("not saved", server.post, urlencode({"trial": waiting[1].id, "music": "4"}))
