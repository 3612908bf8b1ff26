"""The analysis gives back what was planted: skill, agreement, correlation; and says when raters were simulated."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from harmolab.lab.listening.analysis import (
    Grid,
    agreement_row,
    answer_grid,
    cohen_kappa,
    krippendorff_alpha,
    pooled_rate,
    rater_rows,
    score_rows,
    version_rows,
    wilson_rate,
)
from harmolab.lab.listening.answers import Answer, Answers, SimulatedRater
from harmolab.lab.listening.trials import Item, make_key, make_trials
from study.figures.results import rates_figure, study_title
from tests.builders import refused

CLIPS = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(40)]
SONGS = [Item(f"song {n}", {"A": f"{n} A", "B": f"{n} B"}) for n in range(40)]
NAN = math.nan
STUDIES = 200
FEW = 25  # where a bootstrap takes its time


def study(skills: list[float], *, seed: int = 0, kind: str = "pick", prefers: str | None = None) -> Grid:
    """The answers of simulated raters with these skills to 40 trials."""
    items = CLIPS if kind == "pick" else SONGS
    key = make_key(items, kind=kind, n=40, seed=seed)
    raters = [SimulatedRater(skill, 1000 * seed + n, prefers) for n, skill in enumerate(skills)]
    given = [
        answer
        for rater in raters
        for answer in rater.answers(make_trials(items, kind=kind, n=40, seed=seed, rater=rater.name), key)
    ]
    return answer_grid(Answers(tuple(given)), key)


def people(rows: list[str], key_seed: int = 0) -> Grid:
    """The answers of people, a string of 0, 1 and . for each: 1 is "inharmonious", a dot is no answer."""
    key = make_key(CLIPS, kind="pick", n=40, seed=key_seed)
    given = [
        Answer(key.study, f"person {n}", trial, ("harmonious", "inharmonious")[int(mark)])
        for n, row in enumerate(rows)
        for trial, mark in zip(key.trials, row, strict=False)
        if mark != "."
    ]
    return answer_grid(Answers(tuple(given)), key)


@pytest.mark.slow  # 200 studies
@pytest.mark.parametrize("skill", [0.5, 0.8])
def test_interval_of_every_rater_and_of_all_covers_the_planted_skill_as_often_as_it_says(skill: float):
    one, everyone = [], []
    for seed in range(STUDIES):
        rows = rater_rows(study([skill] * 6, seed=seed))
        one += [row["low"] <= skill <= row["high"] for row in rows[:-1]]
        everyone.append(rows[-1]["low"] <= skill <= rows[-1]["high"])
    assert 0.90 <= np.mean(one) <= 0.99
    assert 0.90 <= np.mean(everyone) <= 0.99


@pytest.mark.slow  # 200 studies
def test_interval_of_all_holds_for_raters_of_unequal_skill_where_counting_answers_fails():
    rng = np.random.default_rng(1)
    pooled, counted = [], []
    for seed in range(STUDIES):
        right = study(list(rng.uniform(0.5, 1.0, 8)), seed=seed).right()
        pooled.append(pooled_rate(right))
        counted.append(wilson_rate(right.ravel()))
    assert 0.90 <= np.mean([rate["low"] <= 0.75 <= rate["high"] for rate in pooled]) <= 0.99
    assert np.mean([rate["low"] <= 0.75 <= rate["high"] for rate in counted]) < 0.8


def test_wilson_interval_is_that_of_the_textbook():
    rate = wilson_rate(np.array([1.0] * 8 + [0.0] * 2 + [NAN]))
    assert (rate["n"], rate["rate"]) == (10, 0.8)
    # Centre (0.8 + z²/20) / (1 + z²/10), half width z sqrt(0.016 + z²/400) / (1 + z²/10), with z = 1.959964.
    assert (rate["low"], rate["high"]) == pytest.approx((0.490162, 0.943318), abs=1e-6)


def test_pooled_rate_of_one_rater_without_repeats_is_wilsons():
    values = np.array([[1.0, 1, 0, 1, 1, 1, 0, 1, 1, 1]])
    assert (pooled_rate(values)["low"], pooled_rate(values)["high"]) == pytest.approx(
        (wilson_rate(values)["low"], wilson_rate(values)["high"]), abs=0.03
    )


def test_pooled_rate_of_answers_that_are_alike_counts_raters_or_trials_not_answers():
    values = np.repeat([[1.0], [1.0], [0.0], [0.0]], 50, axis=1)
    for alike in (values, values.T):  # four raters who never waver; four trials that all answer in the same way
        # A variance of 1/12, as of 3 answers: Wilson's low is 0.125, with Student's quantile (3 degrees) 0.063.
        assert 0.02 < pooled_rate(alike)["low"] < 0.1
        assert 0.9 < pooled_rate(alike)["high"] < 0.98


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_unanimous_answers_still_have_an_interval(share: float):
    rate = pooled_rate(np.full((3, 10), share))
    assert rate["rate"] == share
    assert 0.1 < rate["high"] - rate["low"] < 0.2  # Wilson for 30 of 30: 0.886 to 1


def test_nothing_answered_has_no_rate():
    for measure in (pooled_rate, wilson_rate):
        rate = measure(np.full((2, 3), NAN))
        assert rate["n"] == 0
        assert np.isnan([rate["rate"], rate["low"], rate["high"]]).all()


def test_right_answers_are_counted_against_the_key():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    wrong = "".join("1" if asked.right == "inharmonious" else "0" for asked in key.trials.values())
    rows = rater_rows(people([wrong, "1" * 40, "." * 39 + "1"]))
    assert [(row["rater"], row["n"], row["rate"]) for row in rows[:2]] == [("person 0", 40, 1.0), ("person 1", 40, 0.5)]
    assert (rows[2]["n"], rows[3]["rater"], rows[3]["n"]) == (1, "all", 81)
    assert not any(row["simulated"] for row in rows)


def test_conditions_are_called_inharmonious_as_often_as_planted():
    covered = []
    for seed in range(FEW):
        rows = {row["version"]: row for row in version_rows(study([0.9] * 6, seed=seed))}
        assert set(rows) == {"true", "lagged"}
        covered += [
            rows[name]["low"] <= share <= rows[name]["high"] for name, share in (("lagged", 0.9), ("true", 0.1))
        ]
    assert np.mean(covered) >= 0.85


def test_preference_between_two_models_does_not_depend_on_the_side():
    (row,) = version_rows(study([1.0], kind="choice", prefers="A"))
    assert (row["version"], row["rate"], row["n"]) == ("A over B", 1.0, 40)
    (row,) = version_rows(study([1.0], kind="choice", prefers="B"))
    assert row["rate"] == 0.0


def test_two_models_have_no_right_answer():
    refused("use version_rows", rater_rows, study([0.8], kind="choice", prefers="A"))


def test_kappa_is_that_of_cohens_formula():
    first = np.array([1.0] * 25 + [0.0] * 25 + [NAN])
    second = np.array([1.0] * 20 + [0.0] * 5 + [1.0] * 10 + [0.0] * 15 + [1.0])
    assert cohen_kappa(first, second) == pytest.approx((0.7 - 0.5) / 0.5)
    assert math.isnan(cohen_kappa(np.ones(4), np.ones(4)))
    assert math.isnan(cohen_kappa(np.array([NAN]), np.array([1.0])))


def test_alpha_is_that_of_krippendorffs_formula():
    # Ten trials, two raters, four disagreements; 14 zeros and 6 ones: 1 - 19 * 4 / (6 * 14) (Krippendorff 2011, A).
    first = np.array([0, 1, 0, 0, 0, 0, 0, 0, 1, 0], float)
    second = np.array([1, 1, 1, 0, 0, 1, 0, 0, 0, 0], float)
    assert krippendorff_alpha(np.array([first, second])) == pytest.approx(0.095, abs=5e-4)
    alone = np.array([[*first, 1.0], [*second, NAN]])
    assert krippendorff_alpha(alone) == pytest.approx(krippendorff_alpha(np.array([first, second])))
    assert math.isnan(krippendorff_alpha(np.ones((3, 4))))


@pytest.mark.parametrize(("raters", "measure"), [(2, "Cohen's kappa"), (4, "Krippendorff's alpha")])
def test_agreement_of_two_is_kappa_and_of_more_alpha(raters: int, measure: str):
    row = agreement_row(study([0.9] * raters))
    assert row["measure"] == measure
    assert row["low"] < row["rate"] < row["high"]


@pytest.mark.slow  # 1000 resamplings of each of 25 studies
@pytest.mark.parametrize("raters", [2, 4])
def test_agreement_and_its_interval_cover_what_was_planted(raters: int):
    rows = [agreement_row(study([0.9] * raters, seed=seed)) for seed in range(FEW)]
    # Independent errors of 10 %: two agree in 0.82, by chance in 0.5, which makes 0.64.
    assert np.mean([row["rate"] for row in rows]) == pytest.approx(0.64, abs=0.06)
    assert np.mean([row["low"] <= 0.64 <= row["high"] for row in rows]) >= 0.8


def test_one_rater_has_nobody_to_agree_with():
    refused("two raters or more", agreement_row, study([0.9]))


def truth() -> dict[str, dict[str, float]]:
    """A score that knows the right answers."""
    return {"truth": {source: float(source.endswith("t")) for clip in CLIPS for source in clip.versions.values()}}


def test_correlation_with_the_planted_truth_is_the_raters_skill():
    row = score_rows(study([0.9] * 4, seed=1), truth())[0]
    # Right in 90 %, two values of each: the correlation of single answers is 0.9 - 0.1, their AUC 0.9.
    assert row["pb_low"] < row["point_biserial"] < row["pb_high"]
    assert row["point_biserial"] == pytest.approx(0.8, abs=0.1)
    assert row["auc"] == pytest.approx(0.9, abs=0.05)


@pytest.mark.slow  # 2000 resamplings of each of 25 studies
def test_correlation_with_the_planted_truth_is_covered_by_its_interval():
    rows = [score_rows(study([0.9] * 4, seed=seed), truth())[0] for seed in range(8)]
    # Right in 90 %, two values of each: the correlation of single answers is 0.9 - 0.1, their AUC 0.9.
    assert np.mean([row["point_biserial"] for row in rows]) == pytest.approx(0.8, abs=0.03)
    assert np.mean([row["auc"] for row in rows]) == pytest.approx(0.9, abs=0.015)
    assert np.mean([row["pb_low"] <= 0.8 <= row["pb_high"] for row in rows]) >= 0.8


def test_score_turned_round_turns_its_correlation_round_and_one_that_never_varies_has_none():
    sources = [source for clip in CLIPS for source in clip.versions.values()]
    good = {source: float(source.endswith("t")) for source in sources}
    scores = {"good": good, "bad": {name: -value for name, value in good.items()}, "flat": dict.fromkeys(sources, 1.0)}
    rows = {row["score"]: row for row in score_rows(study([0.9] * 4), scores)}
    assert rows["good"]["low"] > 0.5
    assert rows["bad"]["rank"] == pytest.approx(-rows["good"]["rank"])
    assert math.isnan(rows["flat"]["rank"])
    assert rows["flat"]["auc"] == 0.5


def test_choice_follows_the_difference_of_the_two_scores():
    scores = {"planted": {f"{n} {v}": n + (v == "A") for n in range(40) for v in "AB"}}
    (row,) = score_rows(study([1.0] * 2, kind="choice", prefers="A"), scores)
    assert (row["rank"], row["auc"]) == pytest.approx((1.0, 1.0))


def test_score_without_a_value_for_a_source_is_refused():
    refused(r"score 'h' has no value for '0 ", score_rows, study([0.9]), {"h": {}})


def test_answers_that_do_not_go_together_are_refused():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    good = Answer(key.study, "Ada", next(iter(key.trials)), "harmonious")
    mixed = replace(good, rater="simulated-1", simulated=True)
    for answers, message in [
        ((), "no answers"),
        ((good, mixed), "people and simulated raters"),
        ((replace(good, study="x"),), "do not go with the key"),
        ((replace(good, trial="x"),), "the key knows no answer"),
        ((replace(good, choice="left"),), "the key knows no answer 'left'"),
    ]:
        refused(message, answer_grid, Answers(answers), key)


def test_simulated_rater_is_called_so_in_everything_it_writes():
    key = make_key(CLIPS, kind="pick", n=40, seed=0)
    rater = SimulatedRater(0.7, 3)
    trials = make_trials(CLIPS, kind="pick", n=40, seed=0, rater=rater.name)
    answers = rater.answers(trials, key)
    assert answers == rater.answers(trials, key)
    assert {(answer.rater, answer.simulated) for answer in answers} == {("simulated-3", True)}
    refused("a simulated rater, and no other", replace, answers[0], simulated=False)
    refused("a simulated rater, and no other", replace, answers[0], rater="Ada")
    refused("was given trials of Ada", rater.answers, replace(trials, rater="Ada"), key)


@pytest.mark.parametrize(("skill", "seed", "name"), [(1.1, 0, "skill"), (NAN, 0, "skill"), (0.5, -1, "seed")])
def test_impossible_rater_is_refused(skill: float, seed: int, name: str):
    refused(f"{name} must", SimulatedRater, skill, seed)


def test_simulated_rater_needs_a_preference_between_models():
    refused("give prefers=", study, [0.8], kind="choice")


def titles(figure: Figure) -> list[str]:
    return [ax.get_title(loc="left") or ax.get_title() for ax in figure.axes]


def test_figures_of_simulated_raters_say_so_and_those_of_people_do_not():
    figure = rates_figure(rater_rows(study([0.9, 0.6])), label="right answers", title="Who was right?")
    assert titles(figure) == ["Who was right? (simulated raters, no people)"]
    assert [text.get_text() for text in figure.axes[0].texts if text.get_gid() == "watermark"] == [
        "simulated: no people"
    ]
    figure = rates_figure(rater_rows(people(["01" * 20])), label="right answers", title="Who was right?")
    assert titles(figure) == ["Who was right?"]
    assert not [text for text in figure.axes[0].texts if text.get_gid() == "watermark"]


def test_rows_that_do_not_say_who_answered_are_not_drawn():
    rows = [{"rater": "Ada", "rate": 0.5, "low": 0.4, "high": 0.6, "n": 9}]
    refused('must say "simulated"', rates_figure, rows, label="right", title="")
    refused('must say "simulated"', study_title, "Table", [])


def test_dot_is_filled_only_if_the_interval_leaves_out_guessing():
    rows = [
        {"rater": "Ada", "rate": 0.9, "low": 0.7, "high": 1.0, "n": 9, "simulated": False},
        {"rater": "Bob", "rate": 0.6, "low": 0.4, "high": 0.8, "n": 9, "simulated": False},
    ]
    (ax,) = rates_figure(rows, label="right", title="").axes
    assert [label.get_text() for label in ax.get_yticklabels()] == ["Bob", "Ada"]
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    assert {float(dot.get_xdata()[0]): dot.get_markerfacecolor() for dot in dots} == {0.6: "white", 0.9: "#222222"}
