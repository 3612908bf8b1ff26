"""Splits by motion group: nothing is tested on movement that was trained on."""

import itertools
import json

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.network_system import noticed_split
from harmolab.systems.training.splits import Split, split_units
from harmolab.systems.training.units import DanceUnit, UnitSet
from tests.builders import dance_unit, refused


def unit(place: int, groups: str, meter: str, *, dance: str = "waltz", sequence: str = "s", extra: bool = False):
    """A unit of 8 frames, 4 s, whose meter begins at `place` seconds; groups are single letters."""
    return dance_unit(
        f"{sequence}:{place}{'+' * extra}", np.zeros((8, 6), np.float32), 4, sequence=sequence, dance=dance,
        groups=frozenset(groups), meter_groups=frozenset(meter), start=place - 2.0, fps=2.0, extra=extra,
    )  # fmt: skip


def unit_set(units: list[DanceUnit]) -> UnitSet:
    return UnitSet(tuple(units), Skeleton(("joint",), (-1,)), np.zeros(1), FeatureParams(), "made up")


def corpus(*, dances: tuple[str, ...] = ("waltz", "tango"), seed: int = 3, extras: bool = True) -> UnitSet:
    """Sequences of eight figures a dance in random order, two meters each; each meter has the one before as prior."""
    rng = np.random.default_rng(seed)
    units = []
    for name in (f"{dance}{sequence}" for dance in dances for sequence in range(4)):
        danced = [f"{name[:-1]} {letter}" for letter in np.repeat(rng.permutation(list("abcdefgh")), 2)]
        for place in range(1, len(danced)):
            before, now, after = danced[place - 1], danced[place], danced[place + 1 : place + 2]
            units.append(unit(2 * place, {before, now}, {now}, dance=name[:-1], sequence=name))
            if extras and after:
                groups = {before, now, *after}
                units.append(unit(2 * place + 1, groups, {now, *after}, dance=name[:-1], sequence=name, extra=True))
    return unit_set(units)


def names(units: UnitSet) -> set[str]:
    return {one.name for one in units.units}


@pytest.fixture(scope="module")
def split() -> Split:
    return split_units(corpus())


@pytest.mark.parametrize("seed", range(2))
def test_sides_share_no_group(seed: int):
    """Training units touch no group of another side; meters of test and validation lie wholly in their own."""
    split = split_units(corpus(), seed=seed)
    held = {*split.groups["validation"], *split.groups["test"]}
    assert held
    assert not any(one.groups & held for one in split.train.units)
    for side, units in (("validation", split.validation), ("test", split.test)):
        assert all(one.meter_groups <= set(split.groups[side]) for one in units.units)


def test_every_group_is_on_one_side(split: Split):
    sides = [set(groups) for groups in split.groups.values()]
    assert sum(map(len, sides)) == len(set.union(*sides)) == 16


def test_no_unit_is_lost_that_could_be_used(split: Split):
    units, train = corpus(), set(split.groups["train"])
    assert names(split.train) == {one.name for one in units.units if one.groups <= train}
    test = set(split.groups["test"])
    assert names(split.test) >= {one.name for one in units.units if one.meter_groups <= test and not one.extra}


def test_meters_of_one_side_do_not_overlap():
    # Four seconds each from every second on, all in one figure; the ordinary ones are at 2 and 12. Of three groups the
    # one with most units is trained on, the one with fewest makes the smaller side.
    held = [unit(place, "t", "t", extra=place not in (2, 12)) for place in range(2, 20)]
    others = [unit(4 * place, "u", "u", sequence="u") for place in range(60)]
    few = [unit(4 * place, "v", "v", sequence="v") for place in range(3)]
    split = split_units(unit_set([*held, *others, *few]))
    assert split.groups == {"train": ["u"], "validation": ["v"], "test": ["t"]}
    places = sorted(float(one.meter_start) for one in split.test.units if one.sequence == "s")
    assert {2.0, 12.0} <= set(places)
    assert np.diff(places).min() >= 2.0
    assert len(places) >= 7


def test_every_dance_is_on_every_side(split: Split):
    for units in (split.train, split.validation, split.test):
        assert {one.dance for one in units.units} == {"waltz", "tango"}


def test_about_as_many_units_are_tested_on_as_were_asked_for(split: Split):
    # 2 x 4 x 15 ordinary units, of which 15 % are 18.
    assert 14 <= len(split.test) <= 30
    assert 8 <= len(split.validation) <= 24


def test_the_seed_decides(split: Split):
    again, other = split_units(corpus()), split_units(corpus(), seed=1)
    assert again.to_dict() == split.to_dict()
    assert other.groups != split.groups


def test_a_split_is_written_down_as_json(split: Split):
    content = json.loads(json.dumps(split.to_dict()))
    about = {"seed": 0, "test_share": 0.15, "validation_share": 0.1, "source": "made up", "groups": split.groups}
    assert {name: content[name] for name in about} == about
    assert set(content["units"]["test"]) == names(split.test)
    assert names(corpus().select(content["units"]["train"])) == names(split.train)


def test_a_group_danced_in_two_dances_is_on_one_side():
    places = itertools.product(("rumba", "tango"), "abcdefgh", range(1, 4))
    units = [unit(4 * n, letter, letter, dance=dance, sequence=f"{dance}{letter}") for dance, letter, n in places]
    split = split_units(unit_set(units))
    for name in split.groups["test"]:
        assert not any(name in one.groups for one in split.train.units)
    assert sum(map(len, split.groups.values())) == 8


def test_units_of_unknown_groups_are_only_trained_on():
    split = split_units(unit_set([*corpus(extras=False).units, unit(500, "", "")]))
    assert "s:500" in names(split.train)
    assert "s:500" not in names(split.test) | names(split.validation)


def test_one_group_cannot_be_split_nor_can_nothing():
    alone = unit_set([unit(place, "a", "a") for place in (2, 4, 6)])
    refused(r"no unit is left for the \w+ side: 3 units dance 1 motion groups; .* are needed$", split_units, alone)
    refused("no unit is left for the train side: 0 units", split_units, unit_set([]))
    joined = unit_set([unit(2, "abc", "abc", dance=name, sequence=name) for name in "abc"])
    refused("3 motion groups; .*, or another --split-seed", split_units, joined)


def test_dances_of_one_group_each_are_dealt_out_together():
    dances = ["jive", "rumba", "samba", "tango", "waltz"]
    parts = [unit(4 * n, {d}, {d}, dance=d, sequence=d) for d in dances for n in range(1, 5)]
    split = split_units(unit_set(parts))
    assert sum(map(len, split.groups.values())) == 5 and len(split.train) == 12
    assert {one.dance for one in split.test.units} == set(split.groups["test"])


def test_a_dance_of_which_no_unit_is_trained_on_is_named():
    dances = {"waltz": "abcdefgh", "tango": "ijklmn", "rumba": "r"}  # a group for each recording
    groups = [(dance, group) for dance, own in dances.items() for group in own]
    units = unit_set(
        [unit(2 * at, group, group, dance=dance, sequence=group) for dance, group in groups for at in (1, 2)]
    )
    outcomes = set()
    for seed in range(12):
        lines: list[str] = []
        split = noticed_split(units, seed, 2, lines.append)
        is_trained = "rumba" in {one.dance for one in split.train.units}
        assert ("; not trained on: rumba (add" in lines[-1]) is not is_trained
        outcomes.add(is_trained)
    assert outcomes == {True, False}
