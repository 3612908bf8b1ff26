"""Units of dance: sets and padded batches, temporal index and initial poses (Eq. 23), groups of like movement."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import Recording, load_recording
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.groups import NEAR, Segment, group_outlines, motion_groups, outline
from harmolab.systems.training.units import DanceUnit, UnitSet, collate, initial_poses, temporal_index
from harmolab.types import Audio, Clip, Motion
from tests.builders import cases, refused

JOINT = Skeleton(("joint",), (-1,))


def unit(name: str = "a", n_frames: int = 4, n_prior: int = 2, beats: tuple[float, ...] = (0.0, 0.5)) -> DanceUnit:
    """A unit whose motion counts its frames; one audio channel that counts by tens."""
    count = np.arange(n_frames, dtype=np.float32)
    motion = np.tile(count[:, None], (1, 6))
    index = (count < n_prior).astype(np.float32)
    return DanceUnit(
        name, "corpus/one", "waltz", frozenset("xy"), frozenset("x"), 3.0, 10 * count[:, None], motion, index,
        np.array(beats), np.ones(len(beats)), fps=2.0,
    )  # fmt: skip


def unit_set(*units: DanceUnit) -> UnitSet:
    return UnitSet(units, JOINT, np.zeros(1), FeatureParams())


def test_a_unit_knows_its_lengths_and_times():
    one = unit(n_frames=6, n_prior=2)
    assert (one.n_frames, one.n_prior) == (6, 2) and (one.start, one.meter_start, one.end) == (3.0, 4.0, 6.0)


@cases(
    "message, call",
    ("a: 0 of 4 frames come before the meter; needs both", lambda: unit(n_prior=0)),
    ("a: 4 of 4 frames come before the meter; needs both", lambda: unit(n_prior=4)),
    ("must be equally long, got 3, 4 and 4 frames", lambda: replace(unit(), audio=np.zeros((3, 1), np.float32))),
    ("a: 2 beats have 1 strengths", lambda: replace(unit(), strengths=np.ones(1))),
    ("two units are called 'a'", lambda: unit_set(unit("b"), unit("a"), unit("a"))),
    ("no unit is called 'd'", lambda: unit_set(unit("a")).select(["a", "d"])),
    (r"one entry per unit \(1\), got shape \(2,\)", lambda: unit_set(unit("a")).select(np.array([True, False]))),
    ("a batch needs at least one unit", lambda: collate([])),
    (r"n_prior must lie between 0 and n_frames \(3\), got -1", lambda: temporal_index(3, -1)),
    (r"n_prior must lie between 0 and n_frames \(3\), got 4", lambda: temporal_index(3, 4)),
    (r"index is 0 everywhere.*Eq\. 23", lambda: initial_poses(np.zeros((3, 2)), np.zeros(3))),
    (r"one entry per frame \(3\), got shape \(2,\)", lambda: initial_poses(np.zeros((3, 2)), np.ones(2))),
    ("corpus/a: needs a motion in three dimensions", lambda: motion_groups([recorded("a", None)])),
)
def test_what_is_no_unit_and_has_no_groups_is_refused(message: str, call: Callable[[], object]):
    refused(message, call)


def test_units_are_selected_by_name_or_mask_in_their_order():
    units = unit_set(unit("a"), unit("b"), unit("c"))
    assert [one.name for one in units.select(["c", "a"]).units] == ["a", "c"]
    assert [one.name for one in units.select(np.array([False, True, False])).units] == ["b"]
    assert len(units.select([])) == 0


def test_a_batch_is_padded_with_last_frames_that_do_not_count():
    batch = collate([unit(n_frames=3, n_prior=2), unit("b", n_frames=5, n_prior=1, beats=(0.0, 0.5, 1.0))])
    np.testing.assert_array_equal(batch.motion[:, :, 0], [[0, 1, 2, 2, 2], [0, 1, 2, 3, 4]])
    np.testing.assert_array_equal(batch.audio[:, :, 0], [[0, 10, 20, 20, 20], [0, 10, 20, 30, 40]])
    np.testing.assert_array_equal(batch.mask, [[1, 1, 1, 0, 0], [1, 1, 1, 1, 1]])
    np.testing.assert_array_equal(batch.index, [[1, 1, 0, 0, 0], [1, 0, 0, 0, 0]])
    # Eq. 23 from the unit alone: the mean of 0 and 1, which the padding goes on with.
    np.testing.assert_array_equal(batch.initial[:, :, 0], [[0, 1, 0.5, 0.5, 0.5], [0, 0, 0, 0, 0]])
    np.testing.assert_array_equal(batch.beats, [[0, 0.5, 0], [0, 0.5, 1]])
    np.testing.assert_array_equal(batch.beat_mask, [[1, 1, 0], [1, 1, 1]])
    np.testing.assert_array_equal(batch.strengths, batch.beat_mask)
    assert {array.dtype for array in vars(batch).values()} == {np.dtype(np.float32)}
    assert batch.motion.shape == (2, 5, 6)


def test_units_without_beats_make_a_batch_without():
    assert collate([unit(beats=())]).beats.shape == (1, 0)


@cases("n_frames, n_prior, expected", (4, 3, [1, 1, 1, 0]), (2, 0, [0, 0]), (2, 2, [1, 1]))
def test_frames_of_the_last_meter_have_index_one(n_frames: int, n_prior: int, expected: list[int]):
    np.testing.assert_array_equal(temporal_index(n_frames, n_prior), expected)


def test_the_current_meter_does_not_show_in_its_initial_poses(rng: np.random.Generator):
    motion, index = rng.normal(size=(6, 4)), temporal_index(6, 2)
    other = motion.copy()
    other[2:] = 1e6
    np.testing.assert_array_equal(initial_poses(motion, index), initial_poses(other, index))


GROUP_FPS = 25.0
BODY = Skeleton(("torso", "hip L", "hip R", "hand"), (-1, 0, 0, 0))
SPLICE = 6  # frames
SILENCE = Audio(np.zeros(100 * 100), 100.0)


def movement(kind: str, seconds: float = 2.0) -> np.ndarray:
    """A hand that goes round the body in its own way, (T, 4, 3); twice as long is half as fast."""
    share = (np.arange(round(seconds * GROUP_FPS)) + 0.5) / round(seconds * GROUP_FPS)
    turns = {"once": 1, "twice": 2, "back": -1}[kind]
    angle = 2 * np.pi * turns * share
    hand = np.stack([0.3 * np.sin(angle), 1 + 0.6 * share, 0.3 * np.cos(angle)], axis=1)
    still = np.tile([[0.0, 1.0, 0.0], [0.2, 1.0, 0.0], [-0.2, 1.0, 0.0]], (len(share), 1, 1))
    return np.concatenate([still, hand[:, None]], axis=1)


def recorded(name: str, motion: Motion | None, *about: Any, **clip: Any) -> Recording:
    return Recording(Clip(name, SILENCE, motion, *about, **clip), None, Path("corpus") / name)


def spliced(*pieces: np.ndarray, name: str = "a", offset: float = 0.0) -> Recording:
    """Pieces joined by straight lines of six frames, which are not valid."""
    positions, valid = [pieces[0]], [np.ones(len(pieces[0]), bool)]
    for piece in pieces[1:]:
        share = (np.arange(1, SPLICE + 1) / (SPLICE + 1))[:, None, None]
        positions += [positions[-1][-1] + share * (piece[0] - positions[-1][-1]), piece]
        valid += [np.zeros(SPLICE, bool), np.ones(len(piece), bool)]
    motion = Motion(np.concatenate(positions), GROUP_FPS, BODY, np.concatenate(valid))
    return recorded(name, motion, offset, dance="waltz")


def named(sequence: Recording, *units: Unit) -> Recording:
    """`sequence` with annotated units."""
    return replace(sequence, annotation=BeatAnnotation(np.arange(0, 20, 0.5), units=units))


def letters(groups: list[list[Segment]]) -> str:
    """Groups as letters in order of appearance, sequences parted by a blank: "abA" for one, two, one."""
    known: dict[str, str] = {}
    return " ".join("".join(known.setdefault(s.group, chr(97 + len(known))) for s in one) for one in groups)


def test_annotated_figures_are_the_groups_and_a_unit_without_one_goes_by_its_name():
    sequence = spliced(movement("once", 4.0))
    units = (Unit("W-1-1", 0.0, 1.5, 3, "W-1"), Unit("W-2-1", 1.5, 4.0, 3, "W-2"))
    assert motion_groups([named(sequence, *units)]) == [[Segment(0.0, 1.5, "W-1"), Segment(1.5, 4.0, "W-2")]]
    assert motion_groups([named(sequence, Unit("walk", 0.0, 4.0, 3))])[0][0].group == "walk"


def test_annotated_units_are_stretched_to_the_motion_and_each_to_the_next():
    # The motion lasts from 1 to 5 s; before, between and after the units nothing is written down.
    sequence = spliced(movement("once", 4.0), offset=1.0)
    units = (Unit("a", 2.0, 3.0, 2), Unit("b", 3.5, 4.0, 2), Unit("later", 7.0, 8.0, 2))
    assert motion_groups([named(sequence, *units)]) == [[Segment(1.0, 3.5, "a"), Segment(3.5, 5.0, "b")]]


def test_without_figures_a_motion_is_cut_in_the_middle_of_its_splices():
    (segments,) = motion_groups([spliced(movement("once"), movement("twice"), offset=3.0)])
    # 50 frames, 6 of splice, 50 frames: the middle lies 53 frames from the start.
    assert [(segment.start, segment.end) for segment in segments] == [(3.0, 3 + 53 / 25), (3 + 53 / 25, 3 + 106 / 25)]
    assert [segment.group for segment in segments] == ["waltz 1", "waltz 2"]


ONCE, TWICE, BACK = (movement(kind) for kind in ("once", "twice", "back"))
TURN = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


@cases(
    "expected, recordings",
    ("a b", ([ONCE], [BACK])),  # unspliced motions
    ("abac bc", ([ONCE, TWICE, ONCE, BACK], [TWICE, BACK])),
    ("aba", ([ONCE, TWICE, movement("once", 1.6)],)),  # at another tempo
    ("aba", ([ONCE, TWICE, movement("once", 3.0)],)),
    ("a a", ([ONCE], [ONCE @ TURN.T + [4.0, 0.3, -2.0]])),  # elsewhere, and facing elsewhere
)
def test_the_same_movement_is_one_group_within_and_across_sequences(expected: str, recordings: tuple[Any, ...]):
    sequences = [spliced(*pieces, name="ab"[number]) for number, pieces in enumerate(recordings)]
    assert letters(motion_groups(sequences)) == expected


def near(name: str, share: float) -> Recording:
    """The movement that goes round once, this share of the distance away that is still near."""
    other = movement("once")
    other[:, 3, 0] += 4 * NEAR * share  # one joint of four is moved, so the mean distance is a quarter
    return spliced(other, name=name)


# The last is a chain.
@cases("shares, expected", ((0, 0.9), "a a"), ((0, 1.1), "a b"), ((0, 1.8), "a b"), ((0, 1.8, 0.9), "a a a"))
def test_movements_are_the_same_up_to_the_distance_that_is_near(shares: tuple[float, ...], expected: str):
    assert letters(motion_groups([near("abc"[number], share) for number, share in enumerate(shares)])) == expected


def test_a_stretch_under_half_a_second_is_joined_with_the_next():
    (segments,) = motion_groups([spliced(movement("once"), movement("twice", 0.2), movement("back"))])
    assert [round(segment.end - segment.start, 2) for segment in segments] == [2.12, 2.56]


def test_a_copy_of_an_annotated_figure_takes_its_group():
    units = (Unit("u", 0.0, 53 / 25, 4, "spot turn"), Unit("v", 53 / 25, 106 / 25, 4, "box"))
    groups = motion_groups([spliced(BACK, TWICE, name="b"), named(spliced(ONCE, TWICE), *units)])
    assert [[segment.group for segment in one] for one in groups] == [["waltz 1", "box"], ["spot turn", "box"]]


def test_annotated_figures_are_never_merged():
    annotated = [named(spliced(ONCE, name=name), Unit("u", 0.0, 2.0, 4, name)) for name in "ab"]
    assert [one[0].group for one in motion_groups([*annotated, spliced(ONCE, name="c")])] == ["a", "b", "a"]


def test_a_dance_without_name_has_groups_all_the_same():
    sequence = spliced(movement("once"))
    assert motion_groups([replace(sequence, clip=replace(sequence.clip, dance=""))])[0][0].group == "movement 1"


def test_bodies_that_differ_cannot_be_compared(swinging_arm: Callable[..., Motion]):
    message = "motions of 3 and 4 joints have no figures that could be compared"
    refused(message, motion_groups, [recorded("arm", swinging_arm(1.0, 25.0)), spliced(ONCE)])


@pytest.mark.data
def test_a_unit_of_the_beat_locked_recordings_is_found_again_by_its_motion(data_root: Path):
    # The annotated units once more, as if nobody had named them: each is found, under its own figure.
    told = load_recording(data_root / "beatlocked" / "DANCE_C_1")
    blind = outline(load_recording(data_root / "beatlocked" / "DANCE_C_7"))
    found = group_outlines([outline(told), blind._replace(figures=("",) * len(blind.figures))])[1]
    known = {segment.group for segment in motion_groups([told])[0]}
    shared = [(one.group, figure) for one, figure in zip(found, blind.figures, strict=True) if figure in known]
    agreeing = sum(group == figure for group, figure in shared)
    assert len(shared) >= 15 and agreeing >= 0.8 * len(shared)
    assert not any(group in known for group, figure in shared if group != figure)
