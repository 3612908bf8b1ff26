"""Trials are balanced, seeded and blind, and files of them are checked."""

import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from harmolab.lab.listening.answers import (
    answer_files,
    answer_log,
    read_key,
    read_page,
    read_scores,
    read_trials,
    write_page,
    write_scores,
    write_study,
)
from harmolab.lab.listening.trials import Item, Key, Trial, TrialSet, make_key, make_trials
from tests.builders import cases, refused

CLIPS = [Item(f"waltz {n}", {v: f"waltz {n} {v}" for v in ("true", "lagged", "other")}) for n in range(12)]
MODELS = [Item(f"song {n}", {v: f"song {n} by {v}" for v in ("HarmoGAN", "LSTM", "recorded")}) for n in range(4)]
PICK = {"kind": "pick", "n": 12, "seed": 5}
CHOICE = {"kind": "choice", "n": 12, "seed": 5}


def test_half_of_the_clips_are_true_and_wrong_conditions_share_the_other_half():
    asked = make_key(CLIPS, **PICK).trials.values()
    assert Counter(one.versions for one in asked) == {("true",): 6, ("lagged",): 3, ("other",): 3}
    assert {(one.versions[0] == "true", one.right) for one in asked} == {(True, "harmonious"), (False, "inharmonious")}


def test_no_rater_sees_a_clip_twice():
    asked = make_key(CLIPS, **PICK).trials.values()
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


@pytest.mark.parametrize("settings", [PICK, CHOICE])
def test_same_seed_gives_the_same_trials_and_another_seed_others(settings: dict[str, object]):
    items = CLIPS if settings is PICK else MODELS
    first = make_trials(items, **settings, rater="Ada")
    assert make_trials(items, **settings, rater="Ada") == first
    other = make_trials(items, **{**settings, "seed": 6}, rater="Ada")
    assert other.study != first.study
    assert {trial.id for trial in other.trials}.isdisjoint(trial.id for trial in first.trials)


def test_raters_get_the_same_trials_in_orders_of_their_own():
    ada, bob = (make_trials(CLIPS, **PICK, rater=name) for name in ("Ada", "Bob"))
    assert ada.study == bob.study == make_key(CLIPS, **PICK).study
    assert set(ada.trials) == set(bob.trials)
    assert ada.trials != bob.trials
    assert {trial.id for trial in ada.trials} == set(make_key(CLIPS, **PICK).trials)


@pytest.mark.parametrize(("items", "settings"), [(CLIPS, PICK), (MODELS, CHOICE)])
def test_blind_trials_alone_give_every_rater_their_order(items: list[Item], settings: dict[str, object]):
    anyone = make_trials(items, **settings, rater="anyone")
    for name in ("Ada", "Zoë"):
        assert anyone.ordered_for(name) == make_trials(items, **settings, rater=name)
        assert anyone.ordered_for("Bob").ordered_for(name) == anyone.ordered_for(name)


@pytest.mark.parametrize(("items", "settings"), [(CLIPS, PICK), (MODELS, CHOICE)])
def test_the_file_for_the_rater_holds_nothing_of_what_is_asked(
    tmp_path: Path, items: list[Item], settings: dict[str, object]
):
    write_study(tmp_path, make_trials(items, **settings, rater="Ada"), make_key(items, **settings))
    blind = (tmp_path / "trials.json").read_text()
    told = [text for item in items for text in (item.name, *item.versions, *item.versions.values())]
    assert [text for text in told if text in blind] == []
    assert set(json.loads(blind)) == {"study", "kind", "rater", "trials"}
    assert {tuple(sorted(row)) for row in json.loads(blind)["trials"]} == {("id", "stimuli")}


def test_order_of_the_blind_trials_does_not_follow_the_condition():
    key = make_key(CLIPS, **PICK)
    orders = {
        tuple(key.trials[trial.id].right for trial in make_trials(CLIPS, **PICK, rater=name).trials)
        for name in ("Ada", "Bob", "Cleo", "Dan")
    }
    assert len(orders) == 4


@pytest.mark.parametrize(("items", "settings"), [(CLIPS, PICK), (MODELS, CHOICE)])
def test_a_written_study_is_read_back_equal(tmp_path: Path, items: list[Item], settings: dict[str, object]):
    trials, key = make_trials(items, **settings, rater="Zoë"), make_key(items, **settings)
    write_study(tmp_path / "study", trials, key)
    assert read_trials(tmp_path / "study" / "trials.json") == trials
    assert read_key(tmp_path / "study" / "key.json") == key


def test_key_of_another_study_is_refused(tmp_path: Path):
    trials = make_trials(CLIPS, **PICK, rater="Ada")
    with pytest.raises(ValueError, match="do not go with the key of study"):
        write_study(tmp_path, trials, replace(make_key(CLIPS, **PICK), study="0" * 12))


@cases(
    "change, message",
    ({"n": 10}, "n must be a multiple of 4"),
    ({"n": 0}, "n must be a multiple of 4"),
    ({"n": True}, "n must be a multiple of 4"),
    ({"n": 16}, "only 12 clips"),
    ({"kind": "rank"}, "kind must be 'pick', 'choice' or 'rate', got 'rank'"),
    ({"seed": -1}, "seed must be a whole number"),
    ({"rater": ""}, "a rater needs a name"),
    ({"rater": "a\nb"}, "a rater needs a name"),
    ({"truth": "right"}, "items need a version 'right'"),
    ({"items": []}, "a study needs items"),
    ({"items": [*CLIPS, Item("x", {"true": "a", "late": "b"})]}, "item 'x' has the versions"),
    ({"items": [*CLIPS, CLIPS[0]]}, "the name 'waltz 0' comes twice"),
    ({"items": [*CLIPS, Item("x", CLIPS[0].versions)]}, "the source 'waltz 0 true' comes twice"),
)
def test_settings_that_cannot_be_balanced_are_refused(change: dict[str, object], message: str):
    settings = {"items": CLIPS, **PICK, "rater": "Ada", **change}
    refused(message, make_trials, settings.pop("items"), **settings)


def test_item_with_one_version_is_refused():
    refused("needs two or more versions", Item, "x", {"true": "a"})


def test_trials_and_keys_that_contradict_their_kind_are_refused():
    refused("must have 2 stimuli", TrialSet, "0" * 12, "choice", "Ada", (Trial("1" * 12, ("2" * 12,)),))
    asked = next(iter(make_key(CLIPS, **PICK).trials.values()))
    refused("right answer must be in", Key, "0" * 12, "pick", {"1" * 12: replace(asked, right="left")})


TRIAL = f'{{"id": "{"1" * 12}", "stimuli": ["{"2" * 12}"]}}'
GOOD = f'{{"study": "{"0" * 12}", "kind": "pick", "rater": "A", "trials": [{TRIAL}]}}'


def test_the_hand_written_trials_are_good(tmp_path: Path):
    (tmp_path / "t.json").write_text(GOOD)
    assert read_trials(tmp_path / "t.json").trials == (Trial("1" * 12, ("2" * 12,)),)


@cases(
    "content, message",
    ("", "is empty"),
    ("{", "Expecting property name"),
    ("[]", "must have the fields study, kind, rater, trials"),
    ("[" * 100_000, "cannot be read as the trials of a study"),
    (GOOD.replace("0" * 12, "x"), "an id must be twelve hexadecimal digits"),
    (GOOD.replace("1" * 12, "../etc/passwd"), "an id must be twelve hexadecimal digits"),
    (GOOD.replace("pick", "choice"), "must have 2 stimuli"),
    (GOOD.replace('"pick"', '["pick"]'), "kind must be"),
    (GOOD.replace('"A"', "7"), "must be texts"),
    (GOOD.replace('"id"', '"condition": "lagged", "id"'), "and no other"),
    (GOOD.replace(TRIAL, f"{TRIAL}, {TRIAL}"), "of its own"),
    (GOOD.replace(TRIAL, ""), "one or more trials"),
    (GOOD.replace(f"[{TRIAL}]", "3"), "trials must be a list"),
)
def test_damaged_trials_are_refused_by_name(tmp_path: Path, content: str, message: str):
    path = tmp_path / "t.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=message) as caught:
        read_trials(path)
    assert str(caught.value).startswith(f"{path}: ")


@cases(
    "old, new, message",
    ('"harmonious"', '"left"', "right answer must be in"),
    ('"harmonious"', "[]", "right answer must be in"),
    ('"versions"', '"models"', "must have the fields item, versions"),
    ('"kind": "pick"', '"kind": "choice"', "must have 2 versions and sources"),
)
def test_damaged_key_is_refused_by_name(tmp_path: Path, old: str, new: str, message: str):
    write_study(tmp_path, make_trials(CLIPS, **PICK, rater="Ada"), make_key(CLIPS, **PICK))
    path = tmp_path / "key.json"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(ValueError, match=message) as caught:
        read_key(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_missing_trials_are_a_missing_file(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"t\.json: no such file"):
        read_trials(tmp_path / "t.json")


def test_pages_are_read_back_and_a_missing_one_is_named(tmp_path: Path):
    write_page(tmp_path, "1" * 12, "<p>Zoë</p>")
    assert read_page(tmp_path, "1" * 12) == "<p>Zoë</p>"
    with pytest.raises(FileNotFoundError, match=rf"{'2' * 12}\.html: no such file"):
        read_page(tmp_path, "2" * 12)


def test_scores_are_read_back_with_those_that_do_not_exist(tmp_path: Path):
    write_scores(tmp_path, {"h": {"a": 0.5, "b": math.nan}})
    assert json.loads((tmp_path / "scores.json").read_text()) == {"h": {"a": 0.5, "b": None}}
    found = read_scores(tmp_path / "scores.json")
    assert found["h"]["a"] == 0.5
    assert math.isnan(found["h"]["b"])


@pytest.mark.parametrize(
    ("content", "message"),
    [("[]", "from score to source"), ('{"h": 1}', "from score to source"), ('{"h": {"a": "1"}}', "a number or null")],
)
def test_damaged_scores_are_refused_by_name(tmp_path: Path, content: str, message: str):
    path = tmp_path / "scores.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=message) as caught:
        read_scores(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("name", ["Ada", "Zoë", "../../etc/passwd", ".", "a/b", "x" * 100, "é" * 100])
def test_every_rater_has_a_file_inside_the_study(tmp_path: Path, name: str):
    log = answer_log(tmp_path, name)
    trials = make_trials(CLIPS, **PICK, rater=name)
    log.record(trials, trials.trials[0].id, "harmonious")
    assert log.path.resolve().parent == tmp_path.resolve() / "answers"
    assert answer_files(tmp_path) == [log.path]


def test_study_that_nobody_answered_says_so(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="nobody has answered yet"):
        answer_files(tmp_path)
