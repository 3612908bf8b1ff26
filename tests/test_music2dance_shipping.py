"""Weights of Music2Dance that are given away: small, whole, without recorded movement; and those that are shipped."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import harmolab
from harmolab.body.kinematics import resample_motion
from harmolab.data.synthetic import synthetic_clip
from harmolab.systems.music2dance.attributes import AttributeClassifier
from harmolab.systems.music2dance.codes import PositionCode
from harmolab.systems.music2dance.feet import FootModel, FootParams
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.systems.training.runs import PoseBank, load_poses
from harmolab.types import Motion
from tests.builders import refused
from tests.notebook_cells import notebook_cells
from tests.tiny_music2dance import TINY, TINY_ATTRIBUTES
from tools.ship import ENDING_SECONDS
from tools.ship import ship_music2dance as ship

DANCES = ("rumba", "waltz")
SHIPPED = Path(harmolab.__file__).parent / "systems" / "music2dance" / "weights"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished training of an untrained dancer with two recorded movements, a classifier and a foot model."""
    recorded = [synthetic_clip(dance, seed=2, seconds=8.0).motion for dance in DANCES]
    motions = [resample_motion(motion, TINY.fps) for motion in recorded if isinstance(motion, Motion)]
    code = PositionCode.of(motions)
    torch.manual_seed(0)
    network = DanceNetwork(replace(TINY, temperature=0.1), code, DANCES).eval()
    clips = [np.column_stack([code.encode(motion)[:25], np.ones((25, 2))]) for motion in motions]
    system = Music2Dance(
        network, PoseBank(np.stack(clips), DANCES), {"note": "kept"}, feet=FootModel(FootParams(), code),
        attributes=AttributeClassifier(TINY_ATTRIBUTES, DANCES),
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("run")
    system.save(folder)
    return folder


@pytest.fixture(scope="module")
def given_away(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("weights")
    ship(run, folder, per_dance=2)
    return folder


def test_all_that_a_run_has_is_in_it_in_half_the_size(run: Path, given_away: Path):
    one, other = Music2Dance.load(run), Music2Dance.load(given_away)
    assert other.meta == {"note": "kept"} and other.feet is not None and other.attributes is not None
    assert other.generator.params == one.generator.params
    for name in ("model", "feet/model", "attributes/model"):
        sizes = [(folder / f"{name}.safetensors").stat().st_size for folder in (given_away, run)]
        assert sizes[0] < 0.7 * sizes[1]


def test_no_recorded_movement_is_in_it(run: Path, given_away: Path):
    recorded, own = load_poses(run / "model"), load_poses(given_away / "model")
    assert own.dances == ("rumba", "rumba", "waltz", "waltz") and own.poses.shape == (4, *recorded.poses.shape[1:])
    assert np.abs(own.poses[:, None] - recorded.poses[None]).max(axis=(2, 3)).min() > 0.01


def test_a_dance_begins_with_a_movement_of_the_dance_and_lasts(given_away: Path):
    clip = synthetic_clip("waltz", seconds=ENDING_SECONDS / 4, seed=3)
    motion = Music2Dance.load(given_away).generate(clip.audio, clip.beats, dance="waltz", seed=1)
    assert motion.duration == pytest.approx(ENDING_SECONDS / 4, abs=0.05) and np.isfinite(motion.positions).all()


def test_a_run_without_movements_cannot_be_given_away(run: Path, tmp_path: Path):
    Music2Dance(Music2Dance.load(run).generator).save(tmp_path / "bare")
    refused("no bank of movements", ship, tmp_path / "bare", tmp_path / "out")


def test_shipped_weights_are_small():
    sizes = [path.stat().st_size for path in SHIPPED.rglob("*.safetensors")]
    assert len(sizes) == 4 and max(sizes) < 2e6
    assert (SHIPPED / "MODEL_CARD.md").is_file()


@pytest.mark.parametrize("dance", ["cha-cha", "rumba", "tango", "waltz"])
def test_the_shipped_network_dances_for_half_a_minute_without_rest_or_shaking(dance: str):
    clip = synthetic_clip(dance, seconds=30.0, seed=77)
    motion = Music2Dance.load(SHIPPED).generate(clip.audio, clip.beats, dance=dance, seed=1)
    measures = notebook_cells("16_music2dance").endurance(motion)
    assert measures["slowest 10 s"] > 0.12 and measures["still"] <= 0.1 and measures["jerk"] < 150
    assert measures["bones"] < 1e-3 and measures["lowest joint"] > -1e-3
