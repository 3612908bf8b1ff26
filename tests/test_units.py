"""Units, sets of units, and padded batches."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.units import DanceUnit, UnitSet, collate
from tests.builders import refused

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
    assert (one.n_frames, one.n_prior) == (6, 2)
    assert (one.start, one.meter_start, one.end) == (3.0, 4.0, 6.0)


@pytest.mark.parametrize("n_prior", [0, 4])
def test_a_unit_needs_frames_before_the_meter_and_in_it(n_prior: int):
    refused(f"a: {n_prior} of 4 frames come before the meter; needs both", unit, n_prior=n_prior)


def test_parts_of_a_unit_must_be_equally_long():
    with pytest.raises(ValueError, match="audio, motion and index must be equally long, got 3, 4 and 4 frames"):
        replace(unit(), audio=np.zeros((3, 1), np.float32))
    refused("a: 2 beats have 1 strengths", replace, unit(), strengths=np.ones(1))


def test_two_units_of_one_name_are_refused():
    refused("two units are called 'a'", unit_set, unit("b"), unit("a"), unit("a"))


def test_units_are_selected_by_name_or_mask_in_their_order():
    units = unit_set(unit("a"), unit("b"), unit("c"))
    assert [one.name for one in units.select(["c", "a"]).units] == ["a", "c"]
    assert [one.name for one in units.select(np.array([False, True, False])).units] == ["b"]
    assert len(units.select([])) == 0


def test_an_unknown_name_or_a_short_mask_is_refused():
    refused("no unit is called 'd'", unit_set(unit("a")).select, ["a", "d"])
    refused(r"one entry per unit \(1\), got shape \(2,\)", unit_set(unit("a")).select, np.array([True, False]))


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


def test_a_batch_of_nothing_is_refused():
    refused("a batch needs at least one unit", collate, [])
