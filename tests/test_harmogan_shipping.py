"""Weights that are given away: small, complete, and without recorded movement."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from harmolab import synthetic_clip
from harmolab.body.kinematics import resample_motion
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.about import read_about
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.runs import PoseBank, load_poses, save_poses
from harmolab.systems.training.weights import save_weights
from harmolab.types import Motion
from study.experiments.locked import statue_on_turntable
from tools.ship import best_run, standing
from tools.ship import ship_harmogan as ship

FPS, FRAMES = 15.0, 25
FEATURES = FeatureParams(n_mfcc=2, beat_channels=True)


@pytest.fixture(scope="module")
def danced() -> Motion:
    motion = synthetic_clip("waltz", seed=2).motion
    assert motion is not None
    return resample_motion(motion, FPS)


@pytest.fixture(scope="module")
def run(danced: Motion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished training of an untrained dancer: generator, pose network, two recorded movements."""
    folder = tmp_path_factory.mktemp("run")
    torch.manual_seed(0)
    body, lengths = danced.skeleton, torch.as_tensor(bone_lengths(danced.positions, danced.skeleton))
    generator = Generator(ModelParams(8, 1, 8, 4), FEATURES.n_audio, body, lengths, fps=FPS, features=FEATURES)
    save_weights(folder / "model", generator, {"note": "kept"})
    save_weights(folder / "pose_net", PoseNet(body, fps=FPS), {"seed": 1})
    code = encode_motion(danced.positions, FPS, body)
    save_poses(folder / "model", PoseBank(np.stack([code[:FRAMES], code[30 : 30 + FRAMES]]), ("waltz", "rumba")))
    return folder


@pytest.fixture(scope="module")
def shipped(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("weights")
    ship(run, folder, per_dance=1)
    return folder


def test_shipped_weights_load_and_say_where_they_come_from(shipped: Path, run: Path):
    assert load_generator(shipped).features == FEATURES
    assert read_about(shipped / "model")["meta"] == {"note": "kept"}
    assert load_pose_net(shipped / "pose_net").fps == FPS
    size = sum(file.stat().st_size for file in shipped.iterdir())
    assert size < 0.75 * sum(file.stat().st_size for file in run.iterdir())


def test_no_recorded_movement_is_shipped(shipped: Path, run: Path):
    recorded, given = load_poses(run / "model"), load_poses(shipped / "model")
    assert set(given.dances) == {"rumba", "waltz"}
    assert given.poses.shape == (2, FRAMES, recorded.poses.shape[2])
    assert np.abs(given.poses[:, None] - recorded.poses[None]).max(axis=(2, 3)).min() > 0.01


def test_shipping_twice_gives_the_same_files(shipped: Path, run: Path, tmp_path: Path):
    ship(run, tmp_path / "again", per_dance=1)
    again = load_poses(tmp_path / "again" / "model")
    np.testing.assert_array_equal(again.poses, load_poses(shipped / "model").poses)
    for file in shipped.glob("*[lt].safetensors"):  # the bank's header lists its entries in any order
        assert (tmp_path / "again" / file.name).read_bytes() == file.read_bytes(), file.name


def test_who_looks_like_dancing_stands_above_who_keeps_time():
    clip = synthetic_clip("waltz", seconds=20.0, seed=2)
    assert clip.motion is not None and clip.beats is not None
    turning = statue_on_turntable(clip.motion, clip.beats)
    late = replace(clip.beats, times=clip.beats.times + 0.25, duration=clip.beats.duration + 0.25)
    dancer, sleepy, figurine = (
        standing([dance, dance])
        for dance in (
            (clip.motion, clip.beats, "waltz"), (clip.motion, late, "waltz"), (turning, clip.beats, "waltz")
        )
    )  # fmt: skip
    assert dancer > sleepy > figurine
    assert dancer[:2] == sleepy[:2] and dancer[2] > 0.8 > sleepy[2]
    assert figurine[0] == 0 and figurine[1] < dancer[1]


def test_of_equal_runs_the_first_is_best(run: Path, tmp_path: Path):
    clip = synthetic_clip("waltz", seconds=12.0, seed=2)
    again = Path(shutil.copytree(run, tmp_path / "again"))
    assert best_run([again, run], [clip], seconds=10.0) == again
    assert best_run([run, again], [clip], seconds=10.0) == run


def test_an_incomplete_run_is_not_shipped(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="model"):
        ship(tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()
