"""Settings of features, model and training: the paper's numbers, one by one, and refusals that name what is wrong."""

import json
import re
from dataclasses import asdict, fields, replace

import pytest

from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.training.features import FeatureParams
from study.profile import RunProfile
from tests.builders import cases, refused


def test_training_settings_are_those_of_section_5_2():
    paper = TrainParams.paper()
    assert (paper.pretrain_epochs, paper.adversarial_epochs, paper.batch_size) == (225, 45, 10)
    assert (paper.pretrain_rate, paper.pretrain_drops, paper.pretrain_drop_epochs) == (0.001, (0.5, 0.2, 0.2, 0.5), 50)
    # "divided by 2 and 5 alternatively every 5 epochs"
    assert (paper.adversarial_rate, paper.adversarial_drops) == (0.0001, (1 / 2, 1 / 5))
    assert paper.adversarial_drop_epochs == 5
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


PAPER, FEATURES, SMALL = TrainParams.paper(), FeatureParams.paper(), ModelParams.small()


@cases(
    "settings, name, value, rule",
    *((SMALL, field.name, 0, "positive") for field in fields(ModelParams)),
    (PAPER, "batch_size", 0, "positive"),
    (PAPER, "pose_epochs", 0, "positive"),
    (PAPER, "shards", 0, "positive"),
    (PAPER, "pretrain_rate", -0.001, "positive"),
    (PAPER, "adversarial_rate", float("nan"), "positive"),
    (PAPER, "tau_end", 0.0, "positive"),
    (PAPER, "epsilon", float("inf"), "positive"),
    (PAPER, "pretrain_drop_epochs", 0, "positive"),
    (PAPER, "pretrain_drops", (0.5, 0.0), "positive factors"),
    (PAPER, "adversarial_drops", (0.5, 0.0), "positive factors"),
    (PAPER, "pretrain_epochs", -1, "zero or more"),
    (PAPER, "harmony_weight", -0.5, "zero or more"),
    (PAPER, "discriminator_decay", float("nan"), "zero or more"),
    (PAPER, "seed", -1, "zero or more"),
    (PAPER, "harmony", "hs", "paper or above_chance"),
    (PAPER, "harmony_frame", "torso", "room or body"),
    (FEATURES, "fps", 0.0, "positive"),
    (FEATURES, "fps", float("nan"), "positive"),
    (FEATURES, "n_mfcc", 0, "positive"),
)
def test_a_setting_out_of_range_is_refused_by_name(
    settings: TrainParams | ModelParams | FeatureParams, name: str, value: object, rule: str
):
    refused(re.escape(f"{name} must be {rule}, got {value!r}"), replace, settings, **{name: value})


def test_a_unit_must_be_longer_than_the_longest_meter():
    refused("unit_beats must leave at least one beat before a meter of six, got 6", FeatureParams, unit_beats=6)


def test_the_full_profile_trains_by_the_whole_schedule_and_the_quick_one_less():
    full, quick = RunProfile.full(), RunProfile.quick()
    assert (full.epochs, full.pose_epochs, full.hidden, full.n_seeds) == (None, None, None, 3)
    assert quick.epochs is not None and sum(quick.epochs) < 270 and quick.n_seeds == 1
