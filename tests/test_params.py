"""Settings of features, model and training: the paper's numbers, one by one, and refusals that name what is wrong."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, replace

import pytest

from harmolab.lab.profile import RunProfile
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.harmogan.params import ModelParams, TrainParams


def test_training_settings_are_those_of_section_5_2():
    paper = TrainParams.paper()
    assert (paper.pretrain_epochs, paper.adversarial_epochs, paper.batch_size) == (225, 45, 10)
    assert (paper.pretrain_rate, paper.pretrain_drops, paper.pretrain_drop_epochs) == (0.001, (0.5, 0.2, 0.2, 0.5), 50)
    # "divided by 2 and 5 alternatively every 5 epochs"
    assert (paper.adversarial_rate, paper.adversarial_drops, paper.adversarial_drop_epochs) == (
        0.0001,
        (1 / 2, 1 / 5),
        5,
    )
    assert paper.pretrain_kl_weight == 0.1
    assert (paper.kl_weight, paper.harmony_weight) == (0.0001, 1)
    assert paper.mse_weight == paper.feature_weight == paper.gan_weight == 0.001
    assert paper.cross_domain_weight == 1
    assert (paper.discriminator_decay, paper.generator_decay) == (0.001, 0.0001)
    assert paper.harmony == "paper"


def test_the_paper_has_no_terms_of_ours():
    paper = TrainParams.paper()
    assert (paper.smoothness_weight, paper.energy_weight, paper.foot_weight) == (0, 0, 0)
    assert (paper.path_weight, paper.spread_weight, paper.harmony_frame) == (0, 0, "room")


def test_the_recommended_loss_is_corrected_for_chance():
    ours = TrainParams.recommended()
    assert ours.harmony == "above_chance"
    assert min(ours.harmony_weight, ours.count_weight, ours.smoothness_weight, ours.foot_weight) > 0


def test_the_recommended_loss_sees_the_body_and_holds_path_and_variety():
    ours = TrainParams.recommended()
    assert ours.harmony_frame == "body"
    assert (ours.path_weight, ours.spread_weight, ours.energy_weight, ours.gan_weight) == (1, 0.5, 0.5, 0.1)


def test_features_of_the_paper_are_mfcc_at_15_hertz():
    assert FeatureParams.paper() == FeatureParams(fps=15.0, n_mfcc=20, beat_channels=False)
    # Onset strength, sine and cosine beside the MFCC.
    assert (FeatureParams.paper().n_audio, FeatureParams.recommended().n_audio) == (20, 23)


@pytest.mark.parametrize("settings", [TrainParams.paper(), TrainParams.recommended(), ModelParams.small()])
def test_settings_survive_json(settings: TrainParams | ModelParams):
    again = json.loads(json.dumps(asdict(settings)))
    again = {name: tuple(value) if isinstance(value, list) else value for name, value in again.items()}
    assert type(settings)(**again) == settings


@pytest.mark.parametrize("name", [field.name for field in fields(ModelParams)])
def test_a_model_without_size_is_refused_by_name(name: str):
    with pytest.raises(ValueError, match=f"{name} must be positive, got 0"):
        replace(ModelParams.small(), **{name: 0})


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("batch_size", 0, "positive"),
        ("pose_epochs", 0, "positive"),
        ("shards", 0, "positive"),
        ("pretrain_rate", -0.001, "positive"),
        ("adversarial_rate", float("nan"), "positive"),
        ("tau_end", 0.0, "positive"),
        ("epsilon", float("inf"), "positive"),
        ("pretrain_drop_epochs", 0, "positive"),
        ("pretrain_epochs", -1, "zero or more"),
        ("harmony_weight", -0.5, "zero or more"),
        ("discriminator_decay", float("nan"), "zero or more"),
        ("seed", -1, "zero or more"),
    ],
)
def test_a_training_setting_out_of_range_is_refused_by_name(name: str, value: float, rule: str):
    with pytest.raises(ValueError, match=f"{name} must be {rule}, got {value}"):
        replace(TrainParams.paper(), **{name: value})


@pytest.mark.parametrize("name", ["pretrain_drops", "adversarial_drops"])
def test_a_rate_cannot_drop_to_nothing(name: str):
    with pytest.raises(ValueError, match=rf"{name} must be positive factors, got \(0.5, 0.0\)"):
        replace(TrainParams.paper(), **{name: (0.5, 0.0)})


def test_an_unknown_harmony_loss_is_refused():
    with pytest.raises(ValueError, match="harmony must be paper or above_chance, got 'hs'"):
        replace(TrainParams.paper(), harmony="hs")


def test_a_frame_that_is_neither_room_nor_body_is_refused():
    with pytest.raises(ValueError, match="harmony_frame must be room or body, got 'torso'"):
        replace(TrainParams.paper(), harmony_frame="torso")


@pytest.mark.parametrize(("name", "value"), [("fps", 0.0), ("fps", float("nan")), ("n_mfcc", 0)])
def test_features_out_of_range_are_refused_by_name(name: str, value: float):
    with pytest.raises(ValueError, match=f"{name} must be positive, got {value}"):
        replace(FeatureParams.paper(), **{name: value})


def test_a_unit_must_be_longer_than_the_longest_meter():
    with pytest.raises(ValueError, match="unit_beats must leave at least one beat before a meter of six, got 6"):
        FeatureParams(unit_beats=6)


def test_the_full_profile_trains_by_the_whole_schedule_and_the_quick_one_less():
    full, quick = RunProfile.full(), RunProfile.quick()
    assert (full.epochs, full.pose_epochs, full.hidden, full.n_seeds) == (None, None, None, 3)
    assert quick.epochs is not None and sum(quick.epochs) < 270 and quick.n_seeds == 1
