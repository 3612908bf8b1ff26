"""Notebooks 18 to 20: points, tables and frames of musicians; answers by hand or planted, no training but tiny ones.

What notebook 18 says of sound and points is in `POINTS`, notebook 19 in `SOUND`, notebook 20 in `FRAMES`.
"""

import re
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import cache, partial
from itertools import product
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS
from harmolab.musician.avatar import SHOULDERS
from harmolab.musician.cleaning import RULES
from harmolab.musician.page import avatar_player
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSplit, PointSpace
from harmolab.musician.synthetic import FAULTS, PlantedPerformance, planted_performance
from harmolab.readers.player_points import HANDS_12, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.types import Motion, Notes
from study import diagram
from study.cells import notebook_cells
from study.experiments import player_frames
from study.experiments import players as players_of
from study.experiments.instrument_sets import load_pianomime
from study.experiments.player_in_space import FOREARM, HALF_SHOULDERS, player_in_space
from study.experiments.players import HANDS, PLANTED, PlayerData, cleaned_performance, trained_player
from study.figures import player_overlays, player_points, player_results
from study.profile import RunProfile
from tests.builders import refused
from tests.test_performances import pianomime_folder

QUICK = RunProfile.quick()
POINTS, SOUND, FRAMES = map(notebook_cells, ("18_sound_and_points", "19_sound_to_hands", "20_players_and_avatars"))
PickedFrame, PredictedPiece = player_frames.PickedFrame, player_frames.PredictedPiece
Pieces = list[PredictedPiece]
player_table_figure = player_results.player_table_figure

FINAL, OURS, MEAN_POSE = "final", "recommended (ours)", "mean pose"
BLIND, FLOOR = "planted truth, direction of the bow unknown", "planted truth: all that the sound tells"
HEARD_ROWS = ("sound of another piece", "notes in place of sound")
OWN_ROWS = (*HEARD_ROWS, "settings of Sec. 4", "two layers", "no PCA: every point", OURS)


@cache
def planted_data(instrument: str = "piano", *, label: str = PLANTED) -> PlayerData:
    """Two planted pieces of 6 s to train on, a third that is validated on, and a fourth tested on."""
    return of_pieces([planted_performance(instrument, seconds=6.0, seed=seed) for seed in range(1, 5)], label)


def of_pieces(planted: list[Any], label: str = PLANTED) -> PlayerData:
    names = [each.performance.name for each in planted]
    split = PlayedSplit(tuple(names[:2]), (names[2],), (names[3],))
    performances = tuple(each.performance for each in planted)
    truth = MappingProxyType(dict(zip(names, planted, strict=True)))
    return PlayerData(label, planted[0].performance.instrument, performances, split, truth)


def four_times(shift: tuple[float, float]) -> PlayerData:
    """One performance under four names, so that all are placed alike; what sound tells is the truth, shifted."""
    planted = planted_performance("piano", seconds=6.0, faults=False, noise=0.0)
    planted = replace(planted, from_audio=planted.clean + np.array(shift))
    names = [f"take {number}" for number in range(4)]
    takes = [replace(planted.performance, name=name, piece=name) for name in names]
    return of_pieces([replace(planted, performance=take) for take in takes])


def errors_by_row(rows: list[str], tests: list[float], *, seeds: int = 1) -> pd.DataFrame:
    """The same test errors of pianists for every seed; a mean pose of 20."""
    parts = []
    for seed, (row, error) in product(range(1, seeds + 1), zip(rows, tests, strict=True)):
        sides = {"train": error - 1, "validation": error - 2, "test": error, MEAN_POSE: 20.0}
        parts += [(row, seed, side, value, value + 0.5) for side, value in sides.items()]
    table = pd.DataFrame(parts, columns=["row", "seed", "side", "projected", "full"])
    return table.assign(data=PLANTED, instrument="piano")


# The tables


@pytest.mark.parametrize("instrument", ["violin", "piano"])
def test_each_row_of_a_table_changes_one_setting_of_the_final_ones(instrument: str):
    rows = SOUND.table_settings(SimpleNamespace(label=PLANTED, instrument=instrument))
    final = asdict(Audio2BodyParams.tables(instrument))
    names = SOUND.printed(instrument)
    changed = {row: sum(asdict(rows[row])[name] != final[name] for name in final) for row in names}
    assert changed == dict.fromkeys(names, 1) | {FINAL: 0}
    assert (rows["dropout .6"].dropout, rows["2 steps a frame"].upsample, rows["no delay"].delay_steps) == (0.6, 2, 0)


def test_final_settings_are_those_under_the_captions():
    violin, piano = Audio2BodyParams.tables("violin"), Audio2BodyParams.tables("piano")
    assert (violin.sequence, violin.batch, violin.components, violin.upsample) == (60, 100, 15, 4)
    assert (violin.dropout, violin.rate, piano.dropout, piano.rate) == (0.15, 2e-3, 0.1, 1e-3)
    assert (violin.delay, violin.delay_steps) == (0.024, 2)


def test_errors_of_the_paper_go_from_the_worst_to_its_final_settings():
    rows = [SOUND.printed(instrument) for instrument in ("violin", "piano")]
    assert [next(iter(own)) for own in rows] == ["frames not dropped"] * 2
    assert [len(own) for own in rows] == [12, 11]
    assert [[*own.items()][-1] for own in rows] == [(FINAL, (7.35, 6.58, 8.31)), (FINAL, (6.52, 6.06, 6.84))]


def test_rows_about_rejected_frames_are_left_out_where_none_is_rejected():
    data = [SimpleNamespace(instrument="piano", label=label) for label in (PLANTED, HANDS)]
    planted, hands = map(SOUND.table_settings, data)
    assert set(planted) - set(hands) == {"frames not dropped", "gaps interpolated"}
    assert tuple(hands)[-len(OWN_ROWS) :] == OWN_ROWS


def test_means_and_spreads_of_a_row_are_over_seeds():
    values = errors_by_row([FINAL], [6.0], seeds=2)
    values.loc[(values["seed"] == 2) & (values["side"] == "test"), "full"] += 1.0
    (row,) = SOUND.error_table(values).to_dict("records")
    assert (row["seeds"], row["test full"], row["test full SD"], row["test projected SD"]) == (2, 7.0, 0.5, 0.0)
    assert row["of mean pose"] == pytest.approx(7.0 / 20.5)
    assert (row["paper train"], row["paper validation"], row["paper test"]) == (6.52, 6.06, 6.84)


def test_the_same_order_as_the_papers_agrees_fully_and_the_reverse_not_at_all():
    rows = ["frames not dropped", "2 steps a frame", FINAL]  # 9.49, 7.98, 6.84 in the paper
    same = SOUND.rank_agreement(errors_by_row(rows, [9.0, 8.0, 7.0], seeds=3))
    assert (same["tau"], same["low"], same["high"], same["rows"]) == (1.0, 1.0, 1.0, 3)
    assert SOUND.rank_agreement(errors_by_row(rows, [7.0, 8.0, 9.0], seeds=3))["tau"] == -1.0
    assert SOUND.rank_agreement(errors_by_row(rows, [9.0, 7.0, 8.0]))["tau"] == pytest.approx(1 / 3)  # 2 of 3 pairs


def test_one_training_gives_no_interval_of_agreement_and_our_rows_no_order():
    agreement = SOUND.rank_agreement(errors_by_row(["no delay", FINAL, OWN_ROWS[0]], [8.0, 7.0, 1.0]))
    assert agreement["rows"] == 2 and np.isnan([agreement["low"], agreement["high"]]).all()


# The limits


def limits_of(data: PlayerData) -> "pd.Series[float]":
    return SOUND.ceilings(QUICK, data).set_index("row")["full"]


@pytest.mark.parametrize(("shift", "error"), [((0.0, 0.0), 0.0), ((3.0, 4.0), np.sqrt((9 + 16) / 2))])
def test_the_truth_itself_has_no_error_and_a_shift_has_its_length(shift: tuple[float, float], error: float):
    assert limits_of(four_times(shift))[FLOOR] == pytest.approx(error, abs=1e-9)


def test_a_violinist_without_the_bows_direction_lies_between_truth_and_mean_pose():
    limits = limits_of(planted_data("violin"))
    assert list(limits.index) == [MEAN_POSE, BLIND, FLOOR]
    assert limits[FLOOR] < limits[BLIND] < limits[MEAN_POSE]


def test_the_bows_direction_is_no_limit_of_a_pianist_and_real_hands_have_two_controls():
    recorded = replace(planted_data(), label=HANDS, planted=MappingProxyType({}))
    assert list(limits_of(planted_data()).index) == [MEAN_POSE, FLOOR]
    limits = limits_of(recorded)
    assert list(limits.index) == [MEAN_POSE, "mean place of each hand", "ridge regression"]
    assert limits["mean place of each hand"] < limits[MEAN_POSE]


def played(sound: np.ndarray, points: np.ndarray) -> SimpleNamespace:
    every = np.ones(len(points), bool)
    return SimpleNamespace(sound=sound, points=points, learnt=every, accepted=every)


def test_ridge_regression_has_the_weights_that_were_planted():
    rng = np.random.default_rng(0)
    sound, weights = rng.normal(size=(300, 2)), rng.normal(size=(2, 4))
    early = np.vstack([sound[5:], np.repeat(sound[-1:], 5, axis=0)])  # a quarter of a second at 20 frames a second
    one = played(sound, early @ weights + 7.0)
    around = SOUND.sound_around(one, 20.0)
    fitted, flat = (around @ SOUND.ridge_weights([one], 20.0, ridge) for ridge in (1e-6, 1e12))
    np.testing.assert_allclose(fitted, one.points, atol=1e-6)
    np.testing.assert_allclose(flat, np.broadcast_to(one.points.mean(axis=0), flat.shape), atol=1e-6)


def test_mean_place_moves_each_hand_and_keeps_its_shape():
    pose = np.arange(2.0 * len(HANDS_12.joints))
    left = np.array(["left" in joint for joint in HANDS_12.joints])
    shift = np.where(left[:, None], [3.0, -1.0], [0.0, 5.0]).ravel()
    swing = np.array([-2.0, 0.0, 2.0])[:, None] * np.ones_like(pose)
    moved = SOUND.mean_place(pose, played(np.zeros((3, 1)), pose + shift + swing), HANDS_12)
    np.testing.assert_allclose(moved, np.broadcast_to(pose + shift, (3, len(pose))))


def test_rows_of_section_4_change_the_layers_and_keep_every_coordinate():
    rows = SOUND.table_settings(SimpleNamespace(label=PLANTED, instrument="piano"))
    assert rows["two layers"] == replace(Audio2BodyParams.tables("piano"), layers=2)
    frames = np.random.default_rng(0).normal(size=(400, 100))
    space = PointSpace.fit(frames, rows["no PCA: every point"].components)
    np.testing.assert_allclose(space.decode(space.encode(frames)), frames)
    assert len(set(space.sizes)) == 1  # one scale: a squared error of components is that of the points


def test_limits_stand_below_the_table_with_test_errors_alone():
    table = SOUND.complete_table(QUICK, planted_data(), errors_by_row([FINAL], [6.0])).set_index("row")
    assert list(table.index) == [FINAL, MEAN_POSE, FLOOR]
    assert table.loc[MEAN_POSE, "of mean pose"] == 1.0
    assert table.loc[[MEAN_POSE, FLOOR], ["seeds", "train full", "paper test"]].isna().all(axis=None)
    ratio = table["test full"] / table["% of shoulder width"]
    assert ratio.to_numpy() == pytest.approx(ratio.iloc[0])


def test_the_part_that_moves_with_a_component_is_named():
    basis = np.zeros((2, 2 * len(PLAYER_50.joints)))
    basis[0, 2 * PLAYER_50.joints.index("left_index_4")] = 1.0
    basis[1, 2 * PLAYER_50.joints.index("right_hip") + 1] = 1.0
    space = PointSpace(np.zeros(basis.shape[1]), basis, np.ones(2))
    assert SOUND.moving_parts(space, PLAYER_50) == ["left hand", "body"]


# Epochs and random input (readings 15 and 24)


def test_epochs_beyond_the_last_are_left_out():
    assert [SOUND.shown_epochs(last) for last in (300, 30, 10, 1)] == [(1, 10, 100, 300), (1, 10, 30), (1, 10), (1,)]


def test_spread_of_components_is_a_mean_over_pieces_and_a_share_of_that_to_music():
    still, wave = np.zeros((4, 2)), np.tile([[1.0, 2.0], [-1.0, -2.0]], (2, 1))
    pieces = {"music": (2 * wave, 4 * wave), "white noise as sound": (wave, still)}
    parts = [
        pd.DataFrame(own, columns=["first", "second"]).assign(input=name, piece=piece, time=np.arange(4) / 10)
        for name, both in pieces.items()
        for piece, own in enumerate(both)
    ]
    table = SOUND.spread_table(pd.concat(parts)).set_index("input")
    assert table.loc["music", ["SD 1", "SD 2", "speed 1"]].tolist() == pytest.approx([3.0, 6.0, 60.0])
    assert table.loc["white noise as sound", ["SD 1", "SD 1 / music"]].tolist() == [0.5, pytest.approx(1 / 6)]


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Trainings are kept in a folder of these tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARMOLAB_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.mark.usefixtures("kept")
def test_figures_5_and_6_show_the_first_test_piece_in_full_and_features_that_the_network_scales_to_normal_ones():
    data = planted_data()
    mode = SOUND.mode_over_epochs(QUICK, data)
    assert mode["piece"].unique().tolist() == ["planted piano 4"]
    assert mode.groupby("epochs").size().to_dict() == {1: 144, 2: 144}
    run = trained_player(QUICK, data, Audio2BodyParams.tables("piano"), 1)
    inputs = SOUND.random_inputs(data, run)
    assert inputs["input"].unique().tolist() == ["music", "white noise as sound", "random features"]
    curve = mode["predicted"][mode["epochs"] == 2].to_numpy()
    assert inputs["first"][inputs["input"] == "music"].to_numpy() == pytest.approx(curve)
    network = run.system.network
    features = SOUND.random_features(network, 4000, np.random.default_rng(0))
    scaled = network.sound_scale(torch.from_numpy(features)).detach()
    assert scaled.mean(dim=0).abs().max() < 0.1 and (scaled.std(dim=0) - 1).abs().max() < 0.1
    components = SOUND.component_table(data, run)
    assert components["share"].is_monotonic_decreasing
    assert components["share"].sum() == pytest.approx(1.0, abs=0.01)


@pytest.mark.usefixtures("kept")
def test_fewer_epochs_are_the_beginning_of_the_same_training():
    data, settings = planted_data(), Audio2BodyParams.tables("piano")
    short, whole = (trained_player(QUICK, data, settings, 1, epochs=epochs) for epochs in (1, None))
    assert (len(short.history), len(whole.history)) == (1, 2)
    assert short.history["val_error"].iloc[0] == whole.history["val_error"].iloc[0]


@pytest.mark.usefixtures("kept")
def test_a_table_has_every_side_of_every_row():
    rows = SOUND.table_settings(planted_data())
    values = SOUND.player_errors(QUICK, planted_data(), {row: rows[row] for row in (FINAL, "no delay")})
    sides = ["train", "validation", "test", MEAN_POSE]
    assert list(zip(values["row"], values["side"], strict=True)) == [*product((FINAL, "no delay"), sides)]
    assert values["full"].gt(values["projected"]).all()


@pytest.mark.parametrize("instrument", ["violin", "piano"])
def test_each_gain_is_one_setting_on_the_way_from_the_paper_to_ours(instrument: str):
    data = SimpleNamespace(label=PLANTED, instrument=instrument)
    rows = {row: asdict(params) for row, params in SOUND.gain_settings(data).items()}
    plain, ours = rows.pop("our schedule"), asdict(players_of.our_settings(data))
    assert rows.pop(OURS) == ours
    changed = {row: {name: own[name] for name in own if own[name] != plain[name]} for row, own in rows.items()}
    assert {len(names) for names in changed.values()} == {1}
    gone = {name for name in ours if ours[name] != plain[name]}
    assert gone == {name for change in changed.values() for name in change}
    assert all(any(change == {name: ours[name]} for change in changed.values()) for name in gone)


def test_a_gain_is_counted_seed_by_seed_from_our_schedule():
    def errors(profile: object, data: object, settings: dict[str, Audio2BodyParams], seeds: object) -> pd.DataFrame:
        first = errors_by_row(list(settings), [10.0] + [8.0] * (len(settings) - 1), seeds=2)
        return first.assign(full=first["full"] + np.where(first["row"].eq("chroma"), first["seed"], 0.0))

    cells = notebook_cells("19_sound_to_hands", player_errors=errors)
    table = cells.gains_table(QUICK, SimpleNamespace(label=HANDS, instrument="piano")).set_index("row")
    assert table.loc["our schedule", ["gain", "gain SD"]].tolist() == [0, 0]
    assert table.loc["semitones", ["gain", "gain SD", "error"]].tolist() == [2, 0, 8.5]
    assert table.loc["chroma", ["gain", "gain SD"]].tolist() == [0.5, 0.5]
    assert table["seeds"].tolist() == [2] * 5 and "hits" not in table


def test_hits_of_a_change_are_those_of_the_settings_whose_error_stands_beside_them():
    scored: list[Audio2BodyParams] = []

    def scores(profile: object, data: object, settings: dict[str, Audio2BodyParams]) -> pd.DataFrame:
        scored.extend(settings.values())
        values = dict.fromkeys(("error", "hits", "p", "other", "events", "depth", "body"), 0.5)
        return pd.DataFrame({"hands": [*settings], "seed": 1, "piece": "a"}).assign(**values)

    def errors(profile: object, data: object, settings: dict[str, Audio2BodyParams], seeds: object) -> pd.DataFrame:
        return errors_by_row(list(settings), [8.0] * len(settings))

    cells = notebook_cells("19_sound_to_hands", player_errors=errors, piece_scores=scores)
    data = SimpleNamespace(label=PLANTED, instrument="piano")
    assert cells.gains_table(QUICK, data)["hits"].tolist() == [0.5] * 6
    assert scored == list(cells.gain_settings(data).values())


# Error and hits


def test_planted_strikes_meet_every_onset_of_their_own_music():
    scores = SOUND.piece_scores(QUICK, planted_data(), {})
    assert scores["hands"].tolist() == ["planted hands"]
    assert scores.loc[0, ["hits", "left", "right", "events"]].tolist() == pytest.approx([1.0] * 4, abs=0.02)
    # The noise that was planted, 1 pixel, and cameras that differ in size by 8 % each.
    assert scores.loc[0, "error"] == pytest.approx(1.0, rel=0.17)
    assert np.isnan(scores.loc[0, "other"])  # there is no other test piece
    # Strikes of real hands are never scored.
    refused("no score of them is evidence", SOUND.piece_scores, QUICK, planted_data(label=HANDS), {})


def test_the_late_row_differs_from_the_final_one_by_its_delay_alone():
    rows = SOUND.scored_settings(SimpleNamespace(label=PLANTED, instrument="piano"))
    assert rows["delay 125 ms"] == replace(rows[FINAL], delay=0.125) != rows[FINAL]


def test_hits_are_means_over_pieces_and_their_spread_is_over_seeds():
    scores = {"seed": [1, 1, 2, 2], "piece": [*"abab"], "error": [6.0, 8.0, 6.0, 6.0], "hits": [0.8, 0.6, 0.4, 0.6]}
    scores |= {"p": [0.01, 0.20, 0.01, 0.04], "other": [0.1, -0.3, 0.0, 0.0], "events": [1.0, 1.0, 1.0, 2.0]}
    (row,) = SOUND.hits_table(pd.DataFrame(scores).assign(hands="final", depth=4.0, body=0.0)).to_dict("records")
    exact = {"seeds": 2, "pieces": 2, "largest p": 0.2, "pieces p < .05": 0.75, "error": 6.5, "error SD": 0.5}
    close = {"hits": 0.6, "hits SD": 0.1, "other": -0.05, "largest other": 0.3, "events": 1.25}
    assert row == row | exact | {name: pytest.approx(value) for name, value in close.items()}
    assert "left" not in row


def test_notes_without_a_sound_are_rendered_as_long_as_the_points(tmp_path: Path):
    (clip,) = load_pianomime(pianomime_folder(tmp_path / "set"))
    rendered = players_of.with_rendered_sound(clip)
    assert rendered.rendered
    assert rendered.audio.duration == pytest.approx(clip.motion.duration, abs=1e-4)
    refused("its notes are not known", players_of.with_rendered_sound, replace(clip, notes=None))


# Notebook 18


@cache
def pianist() -> PlantedPerformance:
    return planted_performance("piano", seconds=30.0)


# Cleaning and placing


def test_the_first_frame_of_each_planted_fault_is_shown_with_the_rule_that_caught_it():
    performance = pianist()
    examples = POINTS.fault_examples([performance])
    assert tuple(example.fault for example in examples) == FAULTS
    rules = {example.fault: example.rule for example in examples}
    assert (rules["swapped hands"], rules["missing hand"]) == ("swapped", "missing")
    for example in examples:
        assert round(example.seconds * 24) == np.flatnonzero(performance.fault == example.fault)[0]
        assert example.before.tolist() != example.points.tolist()
    titles = [ax.get_title(loc="left") for ax in player_points.faults_figure(examples).axes]
    assert len(titles) == 4 and titles[0] == "swapped hands\nrejected by: swapped"


def test_a_frame_that_passes_is_shown_as_not_rejected():
    performance = planted_performance("piano", seconds=6.0, faults=False)
    fault = np.full(performance.fault.shape, "", "<U20")
    fault[70] = "jump"  # said to be one, but nothing jumps
    (example,) = POINTS.fault_examples([replace(performance, fault=fault)])
    assert (example.rule, example.seconds) == ("", 70 / 24)


def test_recorded_examples_have_one_frame_for_each_rule_that_rejects():
    performance = pianist().performance
    report = cleaned_performance(performance).report()
    examples = POINTS.recorded_examples([performance])
    assert {example.rule for example in examples} == {rule for rule, share in report.items() if share > 0}
    assert {example.fault for example in examples} == {""}


def test_every_frame_counts_for_one_fault_or_as_good_and_for_one_rule_at_most():
    table = POINTS.planted_cleaning([pianist()]).set_index("fault")
    assert list(table.index) == [*FAULTS, POINTS.GOOD]
    assert table["frames"].sum() == 720
    assert table.loc["missing hand", "rejected"] == 1.0  # points that were not detected are always missing
    assert table.loc[POINTS.GOOD, "rejected"] < 0.08
    (row,) = POINTS.cleaning_table([pianist().performance]).to_dict("records")
    assert row["rejected"] == pytest.approx((table["frames"] * table["rejected"]).sum() / 720)


def test_planted_pieces_are_one_row_of_the_summary_and_recordings_rows_of_their_own():
    shares = dict.fromkeys(RULES, 0.0)
    names = {"recording": ["a", "b", "c"], "instrument": ["piano", "piano", "violin"]}
    about = {"source": ["synthetic", "synthetic", "tracked"], "seconds": [10.0, 30.0, 5.0]}
    summary = POINTS.cleaning_summary(pd.DataFrame({**names, **about, **shares, "rejected": [0.1, 0.3, 0.5]}))
    assert summary["recording"].tolist() == ["planted piano, 2 pieces", "c (recorded)"]
    assert summary["rejected"].tolist() == pytest.approx([0.25, 0.5])


def test_words_of_notebook_18_weigh_faults_by_their_frames():
    faults = pd.DataFrame({"instrument": "piano", "fault": ["jump", "swapped hands", "good frame"],
                           "frames": [30, 10, 200], "rejected": [1.0, 0.6, 0.01]})  # fmt: skip
    words = POINTS.finding({"a2b_faults": faults})
    assert words == "Rules alone reject 90% of the 40 wrong frames that were planted, and 1.0% of the good ones."


def test_one_similarity_a_recording_is_better_for_hands_than_one_a_frame_or_none():
    errors = POINTS.alignment_table(planted_data()).pivot_table(index="alignment", columns="part", values="error")
    for hand in ("left hand", "right hand"):
        assert errors.loc["recording", hand] < 0.8 * errors.loc["frame", hand] < errors.loc["none", hand]


# Sound, components, steps, sizes


def test_notes_of_a_stretch_begin_in_it_and_are_on_its_time_line():
    own = Notes([0.5, 2.0, 3.9, 4.0], [1.0, 5.0, 4.5, 4.2], [60, 61, 62, 63]).span(2.0, 2.0)
    assert np.array([own.pitches, own.onsets, own.offsets]) == pytest.approx(np.array([[61, 62], [0, 1.9], [3, 2.5]]))


def test_a_clip_is_cut_alike_from_sound_features_points_and_avatar():
    clip = POINTS.played_clip(planted_performance("piano", seconds=8.0), start=1.0, seconds=4.0)
    names = clip.feature_names
    assert (len(names), names[13], names[27]) == (28, "log energy", "slope of log energy")
    assert POINTS.feature_names(Audio2BodyParams(energy_delta=False)) == names[:27]
    frames = (clip.features.shape, clip.points.n_frames, clip.avatar.n_frames)
    assert (*frames, clip.audio.duration) == ((96, 28), 96, 96, pytest.approx(4.0))


def test_modes_share_all_of_the_variance_and_two_hold_the_hands():
    shares, moves = POINTS.point_components(planted_data())
    assert shares["share"].sum() == pytest.approx(1.0)
    assert moves.groupby("component").size().tolist() == [50, 50, 50]
    assert POINTS.counts(shares)[0.9] <= 2
    squares = (moves["dx"] ** 2 + moves["dy"] ** 2).groupby(moves["component"]).sum().to_numpy()
    share = shares["share"].to_numpy()[:3]
    assert squares / squares[0] == pytest.approx(share / share[0])


def test_steps_show_a_rejected_frame_and_no_step_beside_it_counts():
    steps = POINTS.delayed_steps(planted_data())
    frames = steps[steps["frame"]]
    assert frames.index.tolist() == list(range(0, 4 * 14, 4))[: len(frames)]
    rejected = int(frames.index[~frames["accepted"]][0])
    assert not steps["usable"][rejected - 3 : rejected + 4].any()
    between = steps["value"].iloc[1:4].to_numpy()
    assert between == pytest.approx(np.interp([1, 2, 3], [0, 4], frames["value"].iloc[:2]))
    late = [1000 * (steps[name] - steps["time"]).iloc[0] for name in ("tables", "ours")]
    assert late == pytest.approx([1000 * 2 / 96, 125.0])


def test_the_diagram_counts_the_papers_parameters():
    boxes = POINTS.player_boxes(POINTS.untrained_player(planted_data("violin")))
    # An LSTM of 200 units has 4 x 200 x (28 + 200 + 2) numbers, the layer after it (200 + 1) x 15.
    assert "184,000 of 187,015 parameters" in boxes["LSTM"]
    assert "3,015 of 187,015 parameters" in boxes["linear"]
    assert "28 numbers a frame" in boxes["sound"]
    assert "2 steps (21 ms) late" in boxes["components"]
    (ax,) = diagram("a2b_fig04_network", boxes).axes
    gids = [patch.get_gid() for patch in ax.patches]
    assert (gids.count("box"), gids.count("arrow")) == (8, 7)
    words = "\n".join(text.get_text() for text in ax.texts)
    assert "{" not in words and all(text in words for text in boxes.values())


# Drawing


def test_points_that_were_not_detected_are_not_drawn():
    detected = np.ones(50, bool)
    detected[PLAYER_50.joints.index("left_wrist")] = False
    draw = partial(player_points.draw_player, points=np.arange(100.0).reshape(50, 2), skeleton=PLAYER_50)
    whole, partly = (draw(Figure().subplots(), detected=seen) for seen in (None, detected))
    bones = [len(ax.collections[0].get_segments()) for ax in (whole, partly)]
    assert bones[0] - bones[1] == 2  # from the elbow, and to the hand
    assert [len(ax.collections[1].get_offsets()) for ax in (whole, partly)] == [50, 49]


def test_frames_are_accepted_ones_and_name_the_notes_that_sound():
    result = cleaned_performance(pianist().performance)
    axes = player_points.frames_figure({"a pianist": result}, columns=3).axes
    assert [float(ax.get_xlabel().split(" s")[0]) for ax in axes] == pytest.approx([5.0, 15.0, 25.0], abs=0.5)
    assert [player_points.note_name(pitch) for pitch in (21, 60, 61, 108)] == ["A0", "C4", "C#4", "C8"]
    silent = replace(result, performance=replace(result.performance, notes=None))
    assert player_points.frames_figure({"a pianist": silent}).axes[0].get_xlabel().endswith("notes not known")


def test_pictures_of_notebook_18_are_drawn_from_their_records():
    data = planted_data()
    clip = POINTS.played_clip(planted_performance("piano", seconds=8.0), start=1.0, seconds=4.0)
    titles = [ax.get_title(loc="left") for ax in player_points.overview_figure(clip, at=1.0).axes]
    assert titles == ["1 the sound", "2 28 numbers a frame", "3 50 points (planted)", "4 an avatar"]
    assert player_points.features_figure(clip).axes[1].get_yticklabels()[2].get_text() == "log energy"
    shares, moves = POINTS.point_components(data)
    titles = [ax.get_title(loc="left") for ax in POINTS.components_picture(shares, moves).axes]
    assert titles[3].startswith(f"{POINTS.counts(shares)[0.9]} hold 90 %")
    assert titles[0].startswith("planted piano, component 1\n") and titles[1].startswith("component 2\n")
    (legend,) = POINTS.steps_figure(POINTS.delayed_steps(data)).legends
    assert [text.get_text() for text in legend.get_texts()][1:3] == ["learnt 21 ms later", "learnt 125 ms later"]
    planted = list(data.planted.values())
    summary = POINTS.cleaning_summary(POINTS.cleaning_table([each.performance for each in planted]))
    report = player_points.cleaning_figure(summary, POINTS.planted_cleaning(planted))
    shares = [bar.get_width() for bar in report.axes[0].patches]
    assert sum(shares) == pytest.approx(100 * summary["rejected"].sum())
    assert [label.get_text() for label in report.axes[1].get_yticklabels()] == [*FAULTS, POINTS.GOOD]


def test_titles_of_figure_5_have_epochs_and_the_correlations_of_accepted_frames():
    curve = np.sin(np.arange(360))
    half = np.where(np.arange(360) % 2, curve, -curve)
    still = np.zeros(360)
    parts = {1: half, 10: still, 30: np.where(np.arange(360) == 7, 50.0, 3 - 2 * curve)}
    about = {"time": np.arange(360) / 24, "tracked": curve, "accepted": np.arange(360) != 7}
    table = pd.concat([pd.DataFrame({"epochs": epochs, **about, "predicted": own}) for epochs, own in parts.items()])
    figure = SOUND.mode_epochs_figure(table, "planted piano", "pixels")
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[1:] == ["10 epochs: correlation nan", "30 epochs: correlation -1.00"]
    assert titles[0].startswith("1 epoch: correlation ")
    assert figure.get_suptitle().startswith("Planted piano: correlation highest after 1 epoch")
    assert len(figure.axes[0].lines[0].get_xdata()) == 288  # twelve seconds


def test_titles_of_figure_6_have_shares_of_the_spread_to_music():
    names = ("music", "white noise as sound")
    about = {"piece": "a", "time": np.arange(48) / 24, "first": np.arange(48) / 24}
    curves = pd.concat([pd.DataFrame({"input": name, **about}) for name in names])
    table = pd.DataFrame({"input": names, "SD 1": [50.0, 4.0], "SD 1 / music": [1.0, 0.08]})
    figure = SOUND.random_inputs_figure(curves, table, "planted piano")
    assert figure.get_suptitle() == "Planted piano, share of the movement to music: 8% to white noise as sound"
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles == ["music: SD 50.0 pixels", "white noise as sound: SD 4.0 pixels, 8 % of that to music"]


def table_of(rows: dict[str, tuple[float, float]]) -> pd.DataFrame:
    """Rows of (test error, the paper's), and a mean pose of 20."""
    table = pd.DataFrame([(row, *own) for row, own in rows.items()], columns=["row", "test full", "paper test"])
    sides = {f"{side} full": table["test full"] for side in ("train", "validation")}
    runs = table.assign(**sides, seeds=3, **{"test full SD": 0.1})
    return pd.concat([runs, pd.DataFrame({"row": ["mean pose"], "test full": 20.0})], ignore_index=True)


def test_title_of_a_table_has_its_least_error_and_the_papers_panel_is_there_where_there_are_numbers():
    figure = player_table_figure(table_of({"no delay": (8.0, 9.5), "final": (7.0, 9.0)}), players="players")
    assert figure.get_suptitle() == "Players: least error with final, 7.0 pixels (mean pose 20.0)"
    table = table_of({"final": (7.0, float("nan"))})
    assert len(player_table_figure(table, players="players").axes) == 3
    assert len(player_table_figure(table.drop(columns="paper test"), players="hands").axes) == 2


def test_title_of_components_has_the_correlation_of_the_largest():
    rows = [("violin", 1, 0.77, "right hand", 0.2), ("violin", 2, 0.16, "left hand", 0.95)]
    table = pd.DataFrame(rows, columns=["instrument", "component", "share", "part", "correlation"])
    (ax,) = player_results.components_figure(table).axes
    assert ax.get_title("left") == "Planted violin: largest component predicted at 0.20"


def test_title_names_the_hands_of_least_error():
    table = pd.DataFrame({"hands": ["planted hands", "final"], "error": [1.0, 7.0], "error SD": [0.0, 0.2]})
    table = table.assign(**{"hits": [1.0, 0.8], "hits SD": [0, 0.1], "other": [0, 0.02], "pieces p < .05": [1.0, 0.5]})
    error, _ = player_results.hits_figure({"piano": table}).axes
    assert error.get_title("left") == "Planted piano: least error\nwith final"


# Notebook 20

FPS = 10.0
BODY = player_skeleton(["left_shoulder", "right_shoulder"])
USUAL = {"leap": 5.0, "rate": 2.0, "low": 50.0, "high": 70.0}
RIGHT, OTHER = "right music", "another music"


def piece_of(
    errors: list[float], *, valid: list[bool] | None = None, notes: Notes | None = None, name: str = "one"
) -> PredictedPiece:
    """A piece with these errors, whose points all rest."""
    points = np.zeros((len(errors), 2, 2))
    motion = Motion(points, FPS, BODY, np.ones(len(errors), bool) if valid is None else np.array(valid))
    performance = Performance(name, "piano", None, motion, notes=notes)
    return PredictedPiece(performance, motion, Motion(points, FPS, BODY), np.array(errors))


def notes_of(onsets: list[float], pitches: list[int], hand: int = 1) -> Notes:
    times = np.array(onsets)
    return Notes(times, times + 0.1, np.array(pitches), hands=np.full(len(onsets), hand))


# Frames by rule


def test_quantile_frames_have_the_rank_of_their_quantile_among_all_accepted_frames():
    first = piece_of([5.0, 1.0, 100.0, 9.0], valid=[True, True, False, True])
    frames = player_frames.quantile_frames([first, piece_of([3.0, 7.0], name="two")], (0.0, 0.25, 0.5, 0.75, 1.0))
    assert [each.error for each in frames] == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert [(each.piece.performance.name, each.frame) for each in frames[:2]] == [("one", 1), ("two", 0)]
    assert frames[1].words == "25 % of the frames are better: 3.0 px"
    assert frames[1].seconds == 0.0 and frames[4].seconds == pytest.approx(0.3)
    equal = player_frames.quantile_frames([piece_of([2.0, 2.0, 2.0])], (0.0, 0.5, 1.0))
    assert [each.frame for each in equal] == [0, 1, 2]  # of equal errors the earlier frame is first


def test_worst_frames_lie_a_second_apart_in_one_piece_and_anywhere_in_another():
    errors = np.ones(40)
    errors[[5, 6, 14, 15, 30]] = 10.0, 9.0, 8.0, 7.0, 6.0
    first, second = piece_of(errors.tolist()), piece_of([1.0, 1.0, 8.5], name="two")
    # 6 and 14 are less than ten frames from 5.
    places = [(each.piece.performance.name, each.frame) for each in player_frames.worst_frames([first, second])]
    assert places == [("one", 5), ("two", 2), ("one", 15), ("one", 30)]


def test_rejected_frames_are_never_the_worst_and_a_short_piece_has_fewer():
    frames = player_frames.worst_frames([piece_of([50.0, 1.0, 2.0], valid=[False, True, True])])
    assert [each.frame for each in frames] == [2]


def test_even_frames_go_from_the_first_accepted_frame_to_the_last():
    piece = piece_of([0.0] * 6, valid=[False, True, True, True, True, True])
    assert [each.frame for each in player_frames.even_frames(piece, 3)] == [1, 3, 5]


def test_share_of_a_hand_is_that_of_its_squared_distances():
    skeleton = player_skeleton(["left_shoulder", "right_shoulder", "left_wrist", "right_wrist"])
    off = np.array([[[1.0, 0.0], [0.0, 0.0], [0.0, 3.0], [0.0, -2.0]]] * 2)
    still = Motion(np.zeros((2, 4, 2)), FPS, skeleton)
    piece = PredictedPiece(Performance("one", "piano", None, still), still, Motion(off, FPS, skeleton), np.zeros(2))
    assert PickedFrame(piece, 0).hand_shares == {"left": pytest.approx(9 / 14), "right": pytest.approx(4 / 14)}


def test_real_hands_are_in_millimetres_and_have_no_planted_truth():
    hands = Motion(np.zeros((2, 12, 2)), FPS, HANDS_12)
    piece = PredictedPiece(Performance("hands", "piano", None, hands), hands, hands, np.zeros(2))
    assert piece.unit == "mm"
    with pytest.raises(ValueError, match="hands: is recorded"):
        _ = piece.pair


# Causes


def test_notes_of_a_chord_are_one_onset_at_their_mean_pitch():
    times, pitches = FRAMES.hand_onsets(notes_of([1.0, 1.02, 2.0], [60, 64, 67]), offset=0.5)
    np.testing.assert_allclose(times, [0.5, 1.5])
    np.testing.assert_allclose(pitches, [62.0, 67.0])
    assert FRAMES.hand_onsets(notes_of([], []))[0].size == 0


def test_moments_are_near_up_to_their_reach_and_not_beyond():
    times = np.array([0.4, 0.5, 1.0, 1.5, 1.6])
    np.testing.assert_array_equal(FRAMES.near_any(times, np.array([1.0]), 0.5), [False, True, True, True, False])
    np.testing.assert_array_equal(FRAMES.near_any(times, np.zeros(0), 0.5), [False] * 5)


def frames_with(cause: str, notes: Notes, **limits: float) -> list[int]:
    """The frames of a piece of 7 s that a cause holds for."""
    return np.flatnonzero(FRAMES.frame_causes(piece_of([0.0] * 70, notes=notes), {1: USUAL | limits})[cause]).tolist()


def test_leap_is_a_larger_step_than_usual_and_counts_around_its_second_note():
    notes = notes_of([1.0, 2.0, 4.0], [60, 65, 71])
    assert frames_with("leap", notes, leap=5.0) == list(range(35, 46))
    assert frames_with("leap", notes, leap=6.0) == []


def test_rate_counts_the_onsets_of_the_second_around_a_time():
    onsets = np.array([0.0, 0.4, 0.5, 2.0])
    np.testing.assert_array_equal(FRAMES.onset_rate(onsets, np.array([0.0, 0.5, 1.4, 1.5])), [3, 3, 0, 1])
    assert frames_with("very fast", notes_of(onsets.tolist(), [60] * 4), rate=2.0) == list(range(6))


def test_unseen_register_lies_below_or_above_what_is_usual():
    assert frames_with("unseen register", notes_of([1.0, 3.0, 5.0], [50, 71, 49])) == [*range(25, 36), *range(45, 56)]


def test_frames_beside_a_rejected_one_are_occluded():
    valid = np.ones(7, bool)
    valid[3] = False
    motion = Motion(np.zeros((7, 2, 2)), FPS, BODY, valid)  # 0.1 s is one frame
    np.testing.assert_array_equal(FRAMES.occluded(motion), [False, False, True, True, True, False, False])


def test_hands_whose_boxes_overlap_are_occluded():
    points = np.zeros((3, len(HANDS_12.joints), 2))
    right = [HANDS_12.joints.index(name) for name in hand_joints("right") if name in HANDS_12.joints]
    left = [number for number in range(len(HANDS_12.joints)) if number not in right]
    points[:, left] = np.linspace([0.0, 0.0], [10.0, 10.0], len(left))
    for frame, shift in enumerate(([9.0, 9.0], [11.0, 0.0], [0.0, 11.0])):
        points[frame, right] = points[frame, left] + shift
    np.testing.assert_array_equal(FRAMES.occluded(Motion(points, FPS, HANDS_12)), [True, False, False])


def test_causes_of_a_frame_are_those_whose_rule_holds_there():
    notes = notes_of([0.5, 1.5, 1.7, 1.9, 4.0], [60, 60, 62, 60, 72])
    valid = [True] * 60
    valid[18] = False
    piece = piece_of([1.0] * 60, valid=valid, notes=notes)
    words = FRAMES.failure_words([PickedFrame(piece, frame) for frame in (5, 17, 40, 55)], {1: USUAL})
    named = [line.partition("\n")[0] for line in words]
    assert named[1:3] == ["1 px: very fast, occluded", "1 px: leap, unseen register"]
    assert {named[0], named[3]} == {"1 px: none of these"}
    (words,) = FRAMES.failure_words([PickedFrame(piece_of([12.3, 1.0]), 0)], {})
    assert words == "12 px: none of these\nleft hand: 0% of its square"


def test_causes_of_the_worst_hundredth_stand_beside_those_of_all_frames():
    errors = np.ones(200)
    errors[[100, 101]] = 50.0
    piece = piece_of(errors.tolist(), notes=notes_of([0.5, 10.0], [60, 66]))
    table = FRAMES.cause_table([piece], {1: USUAL}).set_index("cause")
    leap = table.loc["leap", ["worst frames", "error without", "all frames", "error with"]].tolist()
    assert leap == [1.0, 1.0, pytest.approx(11 / 200), pytest.approx((2 * 50 + 9) / 11)]  # 9.5 to 10.5 s
    assert table.loc["none of these", "worst frames"] == 0.0
    assert np.isnan(table.loc["very fast", "error with"])


def test_usual_is_what_the_training_pieces_have():
    motion = Motion(np.zeros((50, 2, 2)), FPS, BODY)
    steady = notes_of([0.5, 1.5, 2.5, 3.5], [60, 62, 60, 62])
    notes = {"a": steady, "b": steady, "test": notes_of([0.5, 0.6, 0.7], [20, 100, 20])}
    performances = tuple(Performance(name, "piano", None, motion, notes=own) for name, own in notes.items())
    split = PlayedSplit(("a",), ("b",), ("test",))
    limits = FRAMES.usual_limits(PlayerData(PLANTED, "piano", performances, split, MappingProxyType({})))
    assert limits == {1: {"leap": 2.0, "rate": 2.0, "low": 60.0, "high": 62.0}}


# Music and points


@pytest.fixture(scope="module")
def predicted() -> Pieces:
    """Pianists whose predicted points are the truth."""
    pieces = []
    for seed in (1, 2):
        own = planted_performance("piano", seconds=14.0, seed=seed, faults=False)
        motion = Motion(own.clean, 24.0, PLAYER_50)
        pieces.append(PredictedPiece(own.performance, own.performance.motion, motion, np.zeros(len(own.clean)), own))
    return pieces


def test_right_music_is_hit_and_another_is_not(predicted: Pieces):
    scores = FRAMES.music_scores(*predicted, seconds=12.0, n_rotations=200)
    assert scores[RIGHT].harmony_above_chance > 0.9 and scores[RIGHT].p_value < 0.05
    assert abs(scores[OTHER].harmony_above_chance) < 0.25
    assert scores[RIGHT].n_audio == scores[OTHER].n_audio
    refused("one: its notes are not known", FRAMES.music_scores, piece_of([0.0, 0.0]), predicted[0], seconds=1.0)


def test_planted_truth_stands_beside_the_prediction(predicted: Pieces):
    pair = predicted[0].pair
    assert list(pair) == [player_frames.PREDICTED, player_frames.TRUE]
    np.testing.assert_array_equal(pair[player_frames.TRUE].positions, predicted[0].planted.clean)


def test_notice_says_where_players_are_from_and_what_is_not_trained():
    split = PlayedSplit(("a",))
    data = PlayerData(PLANTED, "piano", (), split, MappingProxyType({"a": planted_performance("piano", seconds=2.0)}))
    assert FRAMES.player_notice(RunProfile.full(), data) == "Planted, synthetic players and sound."
    assert "the network is not trained" in FRAMES.player_notice(RunProfile.quick(), data)


# Depth


def test_error_of_the_depth_is_in_forearms_and_blind_to_size():
    player = player_in_space("piano", seconds=4.0)
    same = Motion(player.space.positions * SHOULDERS / (2 * HALF_SHOULDERS), 24.0, PLAYER_50)
    assert FRAMES.depth_errors(player, same) == pytest.approx({"wrist depth": 0.0, "elbow": 0.0}, abs=1e-5)
    points = np.array(player.space.positions)
    for side in SIDES:
        points[:, PLAYER_50.joints.index(f"{side}_wrist"), 2] += 0.1 * FOREARM
    nearer = Motion(points * SHOULDERS / (2 * HALF_SHOULDERS), 24.0, PLAYER_50)
    assert FRAMES.depth_errors(player, nearer)["wrist depth"] == pytest.approx(10.0)


def test_our_avatar_is_deep_enough_and_the_papers_is_not():
    table = FRAMES.depth_table(RunProfile.quick()).set_index("settings")
    for measure, most in FRAMES.DEPTH_LIMITS.items():
        assert (table.loc["ours", f"{measure}, worst"] <= most).all()
        assert (table.loc[["as in the paper", "ours, linear depth"], measure] > most).all()
    assert [len(ax.patches) for ax in FRAMES.depth_figure(table.reset_index()).axes] == [len(table)] * 2


# Pictures


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_head_is_above_the_shoulders_in_a_mirror_too(sign: float):
    head = player_overlays.head_of(np.array([[0.0, 0.0], [10.0 * sign, 0.0]]), BODY)
    assert head is not None
    np.testing.assert_allclose(head[0], [5.0 * sign, -10 * player_overlays.NECK])
    assert head[1] == pytest.approx(10 * player_overlays.HEAD)
    assert player_overlays.head_of(np.zeros((12, 2)), HANDS_12) is None
    low, high = player_overlays.picture_limits([np.array([[0.0, 0.0], [10.0, 0.0]])], BODY)
    assert low[1] < -10 * (player_overlays.NECK + player_overlays.HEAD) and high[1] > 0  # with room for the head


def test_overlays_share_one_frame_and_show_the_prediction_over_the_truth(predicted: Pieces):
    frames = player_frames.even_frames(predicted[0], 5)
    figure = player_overlays.overlay_figure(frames, [each.words for each in frames], title="planted")
    drawn = [ax for ax in figure.axes if ax.axison]
    assert len(drawn) == 5
    assert len({(ax.get_xlim(), ax.get_ylim()) for ax in drawn}) == 1
    low, high = drawn[0].get_ylim()
    assert low > high  # y points down
    lines = [each for each in drawn[0].collections if hasattr(each, "get_segments")]
    assert [to_hex(each.get_colors()[0]) for each in lines] == [COLOURS["miss"].lower(), COLOURS["hit"].lower()]
    assert max(lines[0].get_linewidths()) > 2 * max(lines[1].get_linewidths())


def test_points_alone_are_drawn_at_the_times_that_are_named(predicted: Pieces):
    figure = player_overlays.points_figure(predicted[0].tracked, (1.0, 2.5), title="x")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["1.0 s", "2.5 s"]


def test_stills_of_one_movement_are_alike_and_stand_beside_those_of_another(predicted: Pieces):
    points = {"one": predicted[0].predicted, "same": predicted[0].predicted, "other": predicted[1].predicted}
    stills = FRAMES.avatar_stills(points, "piano", (1.0, 4.0), height=120, width=100)
    assert {name: np.shape(row) for name, row in stills.items()} == dict.fromkeys(points, (2, 120, 100, 3))
    np.testing.assert_array_equal(stills["one"], stills["same"])
    assert (stills["one"][0] != stills["one"][1]).any() and (stills["one"][0] != stills["other"][0]).any()
    assert len(player_overlays.stills_figure(stills, (1.0, 4.0), title="x").axes) == 6
    refused("times must lie within the 14", FRAMES.avatar_stills, points, "piano", (14.0,))
    points = {"one": predicted[0].predicted, "two": piece_of([0.0, 0.0]).predicted}
    refused("the same points", FRAMES.avatar_stills, points, "piano", (0.0,))


def test_player_and_row_of_onsets_show_both_avatars_with_their_hits(predicted: Pieces):
    played = predicted[0].performance
    both = {RIGHT: predicted[0].predicted, OTHER: predicted[1].predicted}
    about = {"title": "x", "seconds": 6.0, "notice": "Planted.", "n_rotations": 50}
    player = avatar_player(played.audio, both, played.notes, "piano", **about)
    assert player.page.count('class="stage"') == 2
    assert "Planted." in player.page and "strike" in player.page
    scores = FRAMES.music_scores(*predicted, seconds=6.0, n_rotations=50)
    for name, score in scores.items():
        hits = re.search(rf"{name}: onsets hit.*?(\d+) of (\d+)", player.page, flags=re.DOTALL)
        assert hits is not None and (int(hits[1]), int(hits[2])) == (score.hits.sum(), score.n_audio)
    figure = player_overlays.onsets_figure(scores, title="x", event="strikes", seconds=6.0)
    for ax, (name, score) in zip(figure.axes, scores.items(), strict=True):
        assert ax.get_title(loc="left").startswith(f"{name}: {score.hits.sum()} of {score.n_audio} onsets hit")
        assert [label.get_text() for label in ax.get_yticklabels()] == ["strikes", "notes"]
