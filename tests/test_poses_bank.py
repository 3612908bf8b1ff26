"""Movements a dance may start from: which are chosen, how they are stored, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from harmolab.body.skeletons import Skeleton
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.runs import PoseBank, load_poses, pose_bank, poses_path, retimed, save_poses
from harmolab.systems.training.units import DanceUnit, UnitSet
from tests.builders import cases, refused

SKELETON = Skeleton(("hip", "knee"), (-1, 0))
C = 9


def unit(name: str, dance: str, beats_before: int, frames_before: int) -> DanceUnit:
    """A unit of 8 beats and 40 frames whose code holds the number in its name everywhere."""
    frames = 40
    beats = np.concatenate(
        [np.linspace(0, frames_before, beats_before, endpoint=False), np.linspace(frames_before, 40, 8 - beats_before)]
    ) / 15  # fmt: skip
    index = (np.arange(frames) < frames_before).astype(np.float32)
    motion = np.full((frames, C), float(name.rpartition("-")[2]), np.float32)
    return DanceUnit(
        name=name, sequence="s", dance=dance, groups=frozenset(), meter_groups=frozenset(), start=0.0, fps=15.0,
        audio=np.zeros((frames, 3), np.float32), motion=motion, index=index, beats=beats, strengths=np.ones(8),
    )  # fmt: skip


def units(*given: DanceUnit) -> UnitSet:
    return UnitSet(given, SKELETON, np.array([0.0, 0.4]), FeatureParams())


def bank() -> PoseBank:
    return PoseBank(np.arange(4.0 * 3 * C).reshape(4, 3, C) / 16, ("waltz", "rumba", "waltz", ""))


def test_retimed_joints_keep_their_course_and_rates_grow_with_the_tempo():
    code = np.zeros((10, C))
    code[:, 0] = np.linspace(0, 9, 10)
    code[:, -3:] = 2.0
    faster = retimed(code, 5)
    np.testing.assert_allclose(faster[:, 0], [0, 2.25, 4.5, 6.75, 9])
    np.testing.assert_allclose(faster[:, -3:], 4.0)  # the same way in half the time
    np.testing.assert_allclose(retimed(code, 10), code)
    np.testing.assert_allclose(retimed(code[:1], 3)[:, 0], 0)


def test_bank_takes_what_was_danced_before_meters_of_four():
    found = pose_bank(units(unit("a-1", "waltz", 4, 20), unit("b-2", "waltz", 3, 15), unit("c-3", "rumba", 4, 24)))
    assert sorted(found.dances) == ["rumba", "waltz"]
    assert found.poses.shape == (2, 22, C)
    assert {float(clip[0, 0]) for clip in found.poses} == {1.0, 3.0}


def test_places_are_shared_evenly_among_dances_and_depend_on_the_seed():
    many = units(*(unit(f"w-{i}", "waltz", 4, 20) for i in range(20)), unit("r-90", "rumba", 4, 20))
    found = pose_bank(many, count=5)
    assert sorted(found.dances) == ["rumba"] + ["waltz"] * 4
    np.testing.assert_array_equal(found.poses, pose_bank(many, count=5).poses)
    other = [pose_bank(many, count=5, seed=seed).poses[:, 0, 0].tolist() for seed in range(1, 4)]
    assert any(values != found.poses[:, 0, 0].tolist() for values in other)


def test_units_without_a_meter_of_four_make_no_bank():
    refused("no unit has a meter of 4 beats", pose_bank, units(unit("b-2", "waltz", 3, 15)))
    refused("count must be positive, got 0", pose_bank, units(unit("b-2", "waltz", 4, 15)), count=0)


def test_bank_comes_back_in_sixteen_bits(tmp_path: Path):
    save_poses(tmp_path / "model", bank())
    back = load_poses(tmp_path / "model")
    np.testing.assert_array_equal(back.poses, bank().poses.astype(np.float16))
    assert back.dances == bank().dances
    assert [file.name for file in tmp_path.iterdir()] == ["model_poses.safetensors"]


def test_bank_lies_beside_the_weights_however_they_are_named(tmp_path: Path):
    for weights in (tmp_path, tmp_path / "model", tmp_path / "model.safetensors", tmp_path / "model.json"):
        assert poses_path(weights) == tmp_path / "model_poses.safetensors"


def test_clips_of_a_dance_or_all_where_the_bank_has_none_of_it():
    np.testing.assert_array_equal(bank().of("waltz"), bank().poses[[0, 2]])
    assert len(bank().of("tango")) == 4
    assert len(bank().of(None)) == 4


def test_poses_for_another_skeleton_are_refused_by_file(tmp_path: Path):
    save_poses(tmp_path / "model", bank())
    with pytest.raises(ValueError, match=r"model_poses\.safetensors: .*\(4, 3, 9\); this generator needs 72 channels"):
        load_poses(tmp_path / "model", n_channels=72)


def test_missing_damaged_and_foreign_banks_are_refused_by_file(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"model_poses\.safetensors: no such file"):
        load_poses(tmp_path / "model")
    path = tmp_path / "model_poses.safetensors"
    path.write_bytes(b"\x80\x04\x95 this is a pickle, or anything")
    refused(r"model_poses\.safetensors: .*damaged", load_poses, tmp_path / "model")
    save_file({"poses": np.zeros((2, 3, C), np.float16)}, path)
    refused("is no bank of poses", load_poses, tmp_path / "model")
    save_poses(tmp_path / "model", bank())
    path.write_bytes(path.read_bytes()[:-20])
    refused("damaged", load_poses, tmp_path / "model")


@cases(
    "poses, dances, fault",
    (np.zeros((2, 3)), ("a", "b"), r"got shape \(2, 3\)"),
    (np.full((1, 3, C), np.nan), ("a",), "must be finite"),
    (np.full((1, 3, C), 1e6), ("a",), "must be finite"),
    (np.zeros((2, 3, C)), ("a",), "each of the 2 clips of poses needs a dance, got 1"),
)
def test_bank_checks_itself(poses: np.ndarray, dances: tuple[str, ...], fault: str):
    refused(fault, PoseBank, poses, dances)
