"""Full-size trainings: which there are, how long they take, and all of them once, tiny, on the processor."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.ren2020.params import RenParams
from study import full_size
from study.experiments import generation, rivals
from study.experiments.generation import SYNTHETIC
from study.experiments.music2dance import ABLATIONS, ablated, profiled
from study.profile import RunProfile

GPU = RunProfile.gpu()
TINY = RunProfile(
    "tiny", n_clips=20, n_sequences=None, n_rotations=1, n_seeds=1, n_dancers=1, epochs=(1, 1), pose_epochs=1,
    hidden=16,
)  # fmt: skip


def test_the_gpu_profile_trains_what_the_papers_did_for_as_long():
    assert generation.model_params(GPU) == ModelParams.paper()
    assert rivals.lee_params(GPU, 2) == replace(LeeParams.paper(), seed=2)
    assert rivals.ren_params(GPU, 2) == replace(RenParams.paper(), seed=2)
    assert (ablated("mel", GPU.ablation_share).first_epochs, ablated("mel").first_epochs) == (1300, 130)
    assert profiled(GPU, ablated("mel")) == ablated("mel")


def test_a_profile_can_cut_the_epochs_and_keep_the_size():
    short = replace(GPU, epochs=(2, 2))
    assert generation.model_params(short) == ModelParams.paper()
    lee = rivals.lee_params(short, 1)
    assert (lee.hidden, lee.unit_epochs) == (LeeParams.paper().hidden, 2)
    assert profiled(short, ablated("mel", 1.0)).residual == ablated("mel").residual


def test_every_training_is_there_by_seed():
    names = [name for name, _ in full_size.trainings(GPU, "recordings")]
    assert len(names) == len(set(names)) == 3 * (2 + 2 + len(ABLATIONS))
    some = {"HarmoGAN, paper, without, seed 3", "Lee et al. 2019, seed 2", "Music2Dance, no mapping, seed 1"}
    assert some <= {*names}


def test_minutes_are_the_epochs_of_a_phase_times_its_last_one(tmp_path: Path):
    epochs = {"pretrained-a": {"pretrain": 2.0}, "run-b": {"adversarial": 4.0}, "ren2020-c": {"adversarial": 1.5}}
    for name, seconds in epochs.items():
        (tmp_path / f"{name}.seconds.json").write_text(json.dumps({"seconds": 9.0, "last epoch": seconds}))
    minutes = full_size.run_minutes(tmp_path, GPU)
    # 3 pretrainings of 225 epochs, 6 runs of 45, 3 rivals of 400; nothing was measured of the others.
    assert minutes == {"pretrained": 22.5, "run": 18.0, "ren2020": 30.0, "lee2019": 0.0, "music2dance": 0.0}


@pytest.mark.slow
def test_all_trainings_run_tiny_on_the_processor_and_not_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    monkeypatch.setattr(generation, "SECONDS", 10.0)
    monkeypatch.setattr(RunProfile, "quick", lambda: TINY)
    assert full_size.main(["--tiny"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [name for name, _ in full_size.trainings(TINY, SYNTHETIC)]
    assert [line.partition(": ")[2].rpartition(", ")[0] for line in lines] == names
    runs = {path: path.stat().st_mtime_ns for path in (tmp_path / "runs").glob("*/model.json")}
    # Both variants of HarmoGAN share their pretraining, and a tiny network has as many clusters with and without.
    assert len(runs) == 1 + 2 + 2 + len(ABLATIONS) - 1
    assert full_size.main(["--tiny"]) == 0
    assert {path: path.stat().st_mtime_ns for path in runs} == runs
    assert min(full_size.run_minutes(tmp_path / "runs", GPU).values()) > 0
