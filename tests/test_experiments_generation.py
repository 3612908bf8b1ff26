"""Trainings of the notebooks: done once, found again, shared where they are the same, one process at a time."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from filelock import FileLock
from study.experiments.own_songs import as_dance, beats_of, generated_dance, own_songs, song_means

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton
from harmolab.systems.harmogan.networks import generate_units
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.training.about import read_about
from harmolab.systems.training.motion_code import turned
from harmolab.systems.training.pose_network import embed_meters
from harmolab.types import Motion
from study.experiments import generation
from study.experiments.generation import (
    SWEEP,
    SYNTHETIC,
    VARIANTS,
    generator_corpora,
    trained,
    training_split,
    weight_sweep,
)
from study.experiments.judging import RECORDED, ablation, judge, recorded_motions
from study.profile import RunProfile
from tests.notebook_cells import notebook_cells

QUALITY = notebook_cells("08_motion_quality")
PROFILE = RunProfile(
    "quick", n_clips=20, n_sequences=1, n_rotations=1, n_seeds=1, epochs=(1, 1), pose_epochs=1, hidden=16
)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder of these tests' own, and no recordings."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("HARMOLAB_CACHE", str(folder))
        patch.delenv("HARMOLAB_DATA", raising=False)
        patch.setattr(generation, "SECONDS", 10.0)
        training_split.cache_clear()
        yield folder
        training_split.cache_clear()


@pytest.fixture(scope="module")
def paper(cache: Path) -> generation.Trained:
    return trained(PROFILE, SYNTHETIC, VARIANTS["paper"], 1)


def test_a_training_is_what_the_variant_says(paper: generation.Trained):
    settings = read_about(paper.folder / "model")["meta"]["settings"]
    assert (settings["train"]["harmony"], settings["train"]["harmony_weight"], settings["train"]["seed"]) == (
        "paper",
        1,
        1,
    )
    assert paper.generator.params.hidden == 16 and paper.generator.features == VARIANTS["paper"].features
    assert paper.generator.parameter_count() < 60_000  # small in every part


def test_its_history_begins_with_pretraining(paper: generation.Trained):
    assert paper.history["phase"].tolist() == ["pretrain", "adversarial"]


def test_a_second_run_finds_it(paper: generation.Trained, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(generation, "train_harmogan", lambda *given, **more: pytest.fail("it was trained again"))
    again = trained(PROFILE, SYNTHETIC, VARIANTS["paper"], 1)
    assert again.folder == paper.folder
    for one, two in zip(again.generator.parameters(), paper.generator.parameters(), strict=True):
        assert torch.equal(one, two)


def test_the_ablation_shares_pretraining_and_pose_network(paper: generation.Trained, cache: Path):
    before = set((cache / "runs").glob("pretrained-*"))
    without = trained(PROFILE, SYNTHETIC, VARIANTS["paper, without"], 1)
    folders = {path for path in (cache / "runs").iterdir() if path.is_dir() and path.name.startswith("pretrained-")}
    assert folders == {path for path in before if path.is_dir()} and len(folders) == 1
    assert without.folder != paper.folder
    weights = [(run.folder / "pose_net.safetensors").read_bytes() for run in (without, paper)]
    assert weights[0] == weights[1]
    assert "harmony" not in without.history.columns


@pytest.mark.slow  # another training
def test_another_seed_is_another_training_on_the_same_split(paper: generation.Trained):
    other = trained(PROFILE, SYNTHETIC, VARIANTS["paper"], 2)
    assert other.folder != paper.folder and other.split is paper.split
    assert not torch.equal(next(other.generator.parameters()), next(paper.generator.parameters()))


def test_a_training_that_was_cut_off_goes_on(paper: generation.Trained, monkeypatch: pytest.MonkeyPatch):
    (paper.folder / "model.json").unlink()
    again = trained(PROFILE, SYNTHETIC, VARIANTS["paper"], 1)
    assert again.folder == paper.folder and (again.folder / "model.json").is_file()
    for one, two in zip(again.generator.parameters(), paper.generator.parameters(), strict=True):
        assert torch.equal(one, two)


def _look_up(folder: str, results: multiprocessing.Queue[str]) -> None:
    os.environ["HARMOLAB_CACHE"] = folder
    generation.SECONDS = 10.0
    torch.set_num_threads(1)
    results.put("started")
    results.put(trained(PROFILE, SYNTHETIC, VARIANTS["paper"], 1).folder.name)


@pytest.mark.slow
def test_a_process_waits_for_the_one_that_trains(paper: generation.Trained, cache: Path):
    # The lock stands for a process that is at it; the other one may go on when it is let go.
    context = multiprocessing.get_context("spawn")
    results = context.Queue()
    other = context.Process(target=_look_up, args=(str(cache), results))
    with FileLock(paper.folder.with_suffix(".lock")):
        other.start()
        assert results.get(timeout=60) == "started"
        other.join(timeout=3)
        assert other.is_alive() and results.empty()
    assert results.get(timeout=60) == paper.folder.name
    other.join(timeout=60)
    assert other.exitcode == 0


def test_the_weights_of_the_sweep_are_those_of_its_trainings(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(generation, "trained", lambda profile, corpus, variant, seed: (corpus, variant, seed))
    for weight, (corpus, variant, seed) in weight_sweep(PROFILE, SYNTHETIC):
        assert (corpus, variant.params.harmony_weight, seed) == (SYNTHETIC, weight, 1)


@pytest.mark.slow  # a training for each weight
def test_the_sweep_goes_from_no_harmony_loss_to_three_times_as_much():
    runs = dict(weight_sweep(PROFILE, SYNTHETIC))
    assert tuple(runs) == SWEEP and (min(SWEEP), max(SWEEP)) == (0.0, 1.0)
    assert len({run.folder for run in runs.values()}) == len(SWEEP)
    # Without the loss it is the training of the ablation.
    assert runs[0.0].folder == trained(PROFILE, SYNTHETIC, VARIANTS["recommended, without"], 1).folder


def test_without_recordings_there_is_the_synthetic_corpus_alone():
    assert generator_corpora(PROFILE) == generator_corpora(replace(PROFILE, epochs=None)) == (SYNTHETIC,)


def test_an_unknown_corpus_is_named():
    with pytest.raises(ValueError, match="there is no corpus 'tango'; there are synthetic"):
        training_split(PROFILE, "tango", VARIANTS["paper"].features)


def test_the_split_shares_no_motion_group(paper: generation.Trained):
    sides = [frozenset().union(*(unit.meter_groups for unit in units.units)) for units in (
        paper.split.train, paper.split.validation, paper.split.test)]  # fmt: skip
    assert not sides[0] & sides[1] and not sides[0] & sides[2] and not sides[1] & sides[2]


def test_a_generator_is_judged_on_its_test_units(paper: generation.Trained):
    units = paper.split.test
    motions = generate_units(paper.generator, units)
    assert [motion.n_frames for motion in motions] == [unit.n_frames for unit in units.units]
    measures = judge(motions, units, paper.pose_net)
    assert measures["units"] == len(units) and measures["fid"] > 0 and 0 <= measures["paper_hit_rate"] <= 1


def test_recorded_motion_is_as_far_from_itself_as_nothing(paper: generation.Trained):
    units = paper.split.test
    assert judge(recorded_motions(units), units, paper.pose_net)["fid_raw"] == pytest.approx(0, abs=1e-3)


def test_a_system_that_only_makes_motions_is_judged_by_the_same_function(paper: generation.Trained):
    """Recorded motion, turned and carried elsewhere and at twice the frame rate, is judged as the recorded motion."""
    units = paper.split.test
    recorded, away = recorded_motions(units), np.array([3.0, 0.0, -2.0])
    elsewhere = [replace(motion, positions=turned(motion.positions, 1.0) + away) for motion in recorded]
    scores, same = (judge(motions, units, paper.pose_net) for motions in (recorded, elsewhere))
    assert same == pytest.approx(scores, abs=0.01)
    faster = judge([resample_motion(motion, 2 * motion.fps) for motion in recorded], units, paper.pose_net)
    assert faster["fid_raw"] == pytest.approx(0, abs=0.1)
    assert faster["diversity"] == pytest.approx(same["diversity"], rel=0.05)
    assert faster["n_audio"] == same["n_audio"] and faster["hit_rate"] == pytest.approx(same["hit_rate"], abs=0.1)


def test_a_motion_of_other_joints_is_refused_by_the_unit_it_was_danced_to(paper: generation.Trained):
    units = paper.split.test
    motion = recorded_motions(units)[0]
    point = Motion(motion.positions[:, :1], motion.fps, Skeleton(("tail",), (-1,)))
    with pytest.raises(ValueError, match="must have the joints of the pose network, got tail"):
        embed_meters([point], units.select([units.units[0].name]), paper.pose_net)


def test_long_dances_of_every_variant_are_measured_against_the_recorded_dancers(paper: generation.Trained):
    table = QUALITY.long_dances(PROFILE, SYNTHETIC, 10.0)
    songs = {unit.sequence.rpartition("/")[2] for unit in paper.split.test.units}
    dances = table[table["system"] != RECORDED].pivot(
        index=["system", "song", "seed"], columns="measure", values="value"
    )
    assert set(table["song"]) <= songs and set(table["system"]) == {RECORDED, *VARIANTS}
    assert dances["bones"].max() < 1e-6
    assert (dances[["jump", "skating_ratio", "jerk_ratio"]] > 0).all(axis=None)
    assert dances["likeness"].isin([0.0, 1.0]).all()
    assert (dances[["rests", "statue_rests"]].abs() <= 1).any(axis=None)
    recorded = table[(table["system"] == RECORDED) & (table["measure"] == "skating_ratio")]["value"]
    assert recorded.mean() == pytest.approx(1.0)


def test_songs_of_their_own_are_danced_to_by_people_choreographer_and_generators(paper: generation.Trained):
    table = own_songs(PROFILE)
    assert song_means(table)["motion"].tolist() == ["recorded", "choreographer", "recommended", "paper"]
    assert table[table["song"] != ""].groupby("system")["song"].nunique().nunique() == 1
    recorded = table[table["system"] == "recorded"].groupby("measure")["value"].min()
    assert recorded["rests"] > 0.5 and recorded["likeness_spread"] > 5


def test_recordings_left_out_are_in_no_unit_of_the_split(paper: generation.Trained):
    features = VARIANTS["paper"].features
    units = [unit for side in ("train", "validation", "test") for unit in getattr(paper.split, side).units]
    name = units[0].sequence.rpartition("/")[2]
    split = training_split(PROFILE, SYNTHETIC, features, (name,))
    left = [unit for side in ("train", "validation", "test") for unit in getattr(split, side).units]
    assert left and not any(unit.sequence.endswith(name) for unit in left)


def test_a_dance_beyond_a_limit_is_counted():
    values = pd.DataFrame({"bones": [0.0, 0.04], "jump": [1.0, 3.5], "skating_ratio": [3, 5]})
    limits = QUALITY.dance_limits(values.melt(var_name="measure").assign(corpus="c", system="v"))
    assert limits["within"].tolist() == ["2 of 2", "1 of 2", "0 of 2"]
    assert limits["worst"].tolist() == [0.04, 3.5, 5.0] and limits["most"].tolist() == [0.05, 3.0, 2.0]


def test_recorded_motion_has_no_distance_from_itself_in_the_ablation(paper: generation.Trained):
    table = ablation(PROFILE).set_index("variant")
    assert table["fid"].isna().to_dict() == {**dict.fromkeys(VARIANTS, False), RECORDED: True}
    assert table.loc[RECORDED, "jerk"] > 0


def test_a_long_dance_begins_with_its_music_and_its_recorded_dancer(paper: generation.Trained):
    song = QUALITY.songs_of(PROFILE, SYNTHETIC, paper)[0]
    motion = generated_dance(HarmoGAN.load(paper.folder), song, 10.0)
    assert motion.duration == pytest.approx(min(10.0, song.clip.motion.duration), abs=1 / motion.fps)
    music = as_dance("paper", 1, song, motion).music
    first = beats_of(song).span(song.clip.offset, motion.duration)
    assert len(music) > 0 and music.times[-1] <= motion.duration
    np.testing.assert_array_equal(music.times, first.times)
