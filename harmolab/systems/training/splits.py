"""Training, validation and test units that share no movement: split by motion group, not by clip."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harmolab.data.recordings import Recording
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import IntArray

SIDES = ("train", "validation", "test")
TRAIN, VALIDATION, TEST = range(3)
# Share of each dance's units to aim at, additional ones not counted. Units that touch groups of two sides are lost,
# which makes the sides smaller than that.
TEST_SHARE, VALIDATION_SHARE = 0.15, 0.1
N_CANDIDATES = 400  # ways to deal the groups out; the one that wastes least is the split
# Most of the groups that a candidate puts on the test and on the validation side, as multiples of the share of units
# asked for: a unit touches several groups and stays only where all of them do, so more groups than units are needed.
SPREAD = 3.0
ROUNDING = 1e-6  # seconds


@dataclass(frozen=True, eq=False)
class Split:
    """Units by side, and the motion groups of each side; groups of one side occur in no unit of another's meters.

    Parameters
    ----------
    train, validation, test : UnitSet
    groups : dict from "train", "validation", "test" to the names of the motion groups, sorted
    settings : dict, the options of `split_units`
    """

    train: UnitSet
    validation: UnitSet
    test: UnitSet
    groups: dict[str, list[str]]
    settings: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Settings, groups and names of the units, ready for JSON: enough to repeat the split."""
        units = {side: [unit.name for unit in getattr(self, side).units] for side in SIDES}
        return {**self.settings, "source": self.train.source, "groups": self.groups, "units": units}


def split_units(units: UnitSet, *, seed: int = 0) -> Split:
    """Units dealt out by motion group, dance by dance, at random but so that few are lost.

    Where that leaves a side empty, as of dances with a group or two each, all dances are dealt out together.

    A training unit touches groups of the training side only, its beats before the meter included. A test or validation
    unit has its meter wholly in groups of its side, and overlaps no other meter of that side; additional units
    (`DanceUnit.extra`) fill the gaps there. All other units go nowhere.

    Parameters
    ----------
    units : UnitSet
    seed : int

    Raises
    ------
    ValueError
        When a side would be empty.
    """
    dances = sorted({unit.dance for unit in units.units})
    names, sides = _dealt([[unit for unit in units.units if unit.dance == dance] for dance in dances], seed)
    if dances[1:] and not all(names):
        names, sides = _dealt([units.units], seed)
    for side, members in enumerate(names):
        if not members:
            other = ", or another --split-seed" if len(sides) >= len(SIDES) else ""
            raise ValueError(
                f"no unit is left for the {SIDES[side]} side: {len(units)} units dance {len(sides)} motion groups; "
                f"more recordings of other figures are needed{other}"
            )
    groups = {name: sorted(group for group, at in sides.items() if at == side) for side, name in enumerate(SIDES)}
    settings = {"seed": seed, "test_share": TEST_SHARE, "validation_share": VALIDATION_SHARE}
    train, validation, test = (units.select(names[side]) for side in range(3))
    return Split(train, validation, test, groups, settings)


def _dealt(parts: Sequence[Sequence[DanceUnit]], seed: int) -> tuple[list[list[str]], dict[str, int]]:
    """Names of the units on each side, and the side of each motion group, dealt out part by part."""
    names: list[list[str]] = [[], [], []]
    sides: dict[str, int] = {}
    for number, part in enumerate(parts):
        table = _Table(part)
        dealt = _deal(table, sides, np.random.default_rng([seed, number]))
        sides |= dict(zip(table.groups, dealt.tolist(), strict=True))
        for side, rows in enumerate(table.members(dealt)):
            names[side] += [table.units[row].name for row in rows]
    return names, sides


class _Table:
    """Units of one dance and the groups they touch: (U, G) incidence of the whole unit, and of its meter."""

    def __init__(self, units: Sequence[DanceUnit]) -> None:
        self.units, self.groups = units, sorted({group for unit in units for group in unit.groups})
        self.touches = np.array([[group in unit.groups for group in self.groups] for unit in units], dtype=bool)
        self.meters = np.array([[group in unit.meter_groups for group in self.groups] for unit in units], dtype=bool)

    def members(self, sides: IntArray) -> tuple[list[int], list[int], list[int]]:
        """Rows of the units on each side when group g is on the side `sides[g]`."""
        train = np.flatnonzero(~(self.touches & (sides != TRAIN)).any(axis=1))
        held = [~(self.meters & (sides != side)).any(axis=1) & self.meters.any(axis=1) for side in (VALIDATION, TEST)]
        return train.tolist(), self._apart(np.flatnonzero(held[0])), self._apart(np.flatnonzero(held[1]))

    def _apart(self, rows: IntArray) -> list[int]:
        """As many of some rows as have meters that do not overlap: the ordinary units, then additional ones."""
        meters: dict[str, list[tuple[float, float]]] = {}
        kept = []
        for row in sorted(rows.tolist(), key=lambda row: (self.units[row].extra, self.units[row].start)):
            unit = self.units[row]
            start, end = unit.meter_start, unit.end
            others = meters.setdefault(unit.sequence, [])
            if all(end <= first + ROUNDING or start >= last - ROUNDING for first, last in others):
                others.append((start, end))
                kept.append(row)
        return sorted(kept)


def _deal(table: _Table, fixed: dict[str, int], rng: np.random.Generator) -> IntArray:
    """The side of each group of one dance, (G,); groups of `fixed` keep theirs.

    Of many random ways the best one comes closest to the target numbers of units and loses least training.
    """
    shares, ordinary = (VALIDATION_SHARE, TEST_SHARE), sum(not unit.extra for unit in table.units)
    targets = [max(1.0, share * ordinary) for share in shares]
    best, best_gain = np.zeros(len(table.groups), dtype=np.int64), -np.inf
    for _ in range(N_CANDIDATES):
        edges = np.cumsum(rng.uniform(0, SPREAD, 2) * shares)
        dealt = np.array([VALIDATION, TEST, TRAIN])[np.searchsorted(edges, rng.random(len(table.groups)))]
        dealt = np.array([fixed.get(group, side) for group, side in zip(table.groups, dealt.tolist(), strict=True)])
        train, validation, test = table.members(dealt)
        gain = 2 * len(train) / len(table.units)
        gain += min(len(validation) / targets[0], 1.0) + 2 * min(len(test) / targets[1], 1.0)
        if gain > best_gain:
            best, best_gain = dealt, gain
    return best


def training_spans(split: Split) -> dict[str, list[tuple[float, float]]]:
    """Name of each recording (`sequence_name`) -> stretches of audio time, seconds, that its training units cover."""
    spans: dict[str, list[tuple[float, float]]] = {}
    for unit in sorted(split.train.units, key=lambda unit: unit.start):
        pieces = spans.setdefault(unit.sequence, [])
        start, end = unit.start, unit.end
        if pieces and start <= pieces[-1][1]:  # it goes on where the piece before has not ended
            start, before = pieces.pop()
            end = max(before, end)
        pieces.append((start, end))
    return spans


def stretches(recording: Recording, spans: list[tuple[float, float]]) -> list[Recording]:
    """A recording with its movement cut to each of some stretches of audio time; ValueError where it has none."""
    clip, motion = recording.clip, recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: has no motion")
    cut = []
    for number, (start, end) in enumerate(spans, 1):
        first = max(0, round((start - clip.offset) * motion.fps))
        part = motion.span(first / motion.fps, end - start)
        offset = clip.offset + first / motion.fps
        cut.append(replace(recording, clip=replace(clip, name=f"{clip.name} {number}", motion=part, offset=offset)))
    return cut
