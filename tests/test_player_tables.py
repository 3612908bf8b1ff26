"""Tables, limits and scores of musicians, with answers worked out by hand or planted; no training but tiny ones."""

from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

from harmolab.musician.cleaning import Reference
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PlayedSplit, PointSpace
from harmolab.musician.synthetic import planted_performance
from harmolab.readers.player_points import PLAYER_50
from study.experiments.instrument_sets import load_pianomime
from study.experiments.players import HANDS, PLANTED, PlayerData, our_settings, trained_player, with_rendered_sound
from study.profile import RunProfile
from tests.builders import refused
from tests.notebook_cells import notebook_cells
from tests.test_performances import pianomime_folder

QUICK = RunProfile.quick()
CELLS = notebook_cells("19_sound_to_hands")
FINAL, OURS, MEAN_POSE = "final", "recommended (ours)", "mean pose"
BLIND, FLOOR = "planted truth, direction of the bow unknown", "planted truth: all that the sound tells"
OWN_ROWS = ("sound of another piece", "notes in place of sound", "settings of Sec. 4", OURS)


def planted_data(instrument: str = "piano", *, label: str = PLANTED, **settings: Any) -> PlayerData:
    """Two planted pieces of 6 s to train on, a third that is validated on, and a fourth tested on."""
    planted = [planted_performance(instrument, seconds=6.0, seed=seed, **settings) for seed in range(1, 5)]
    return of_pieces(planted, label)


def of_pieces(planted: list[Any], label: str = PLANTED) -> PlayerData:
    names = [each.performance.name for each in planted]
    split = PlayedSplit(tuple(names[:2]), (names[2],), (names[3],))
    performances = tuple(each.performance for each in planted)
    truth = MappingProxyType(dict(zip(names, planted, strict=True)))
    return PlayerData(label, planted[0].performance.instrument, performances, split, truth)


def four_times(instrument: str, **changes: Any) -> PlayerData:
    """One performance under four names, so that all are placed alike; `changes` to the truth of each."""
    planted = planted_performance(instrument, seconds=6.0, faults=False, noise=0.0)
    names = [f"take {number}" for number in range(4)]
    takes = [replace(planted, performance=replace(planted.performance, name=name, piece=name)) for name in names]
    return of_pieces([replace(take, **{key: value(take) for key, value in changes.items()}) for take in takes])


def errors_by_row(rows: list[str], tests: list[float], *, seeds: int = 1, instrument: str = "piano") -> pd.DataFrame:
    """The same test errors for every seed; a mean pose of 20."""
    parts = []
    for seed in range(1, seeds + 1):
        for row, error in zip(rows, tests, strict=True):
            for side, value in (("train", error - 1), ("validation", error - 2), ("test", error), (MEAN_POSE, 20.0)):
                parts.append({"row": row, "seed": seed, "side": side, "projected": value, "full": value + 0.5})
    return pd.DataFrame(parts).assign(data=PLANTED, instrument=instrument, minutes=1.0)


# The tables


@pytest.mark.parametrize("instrument", ["violin", "piano"])
def test_each_row_of_a_table_changes_one_setting_of_the_final_ones(instrument: str):
    rows = CELLS.table_settings(SimpleNamespace(label=PLANTED, instrument=instrument))
    final = asdict(Audio2BodyParams.tables(instrument))
    changed = {
        row: [name for name in final if asdict(rows[row])[name] != final[name]] for row in CELLS.PAPER[instrument]
    }
    assert changed.pop(FINAL) == []
    assert {row: len(names) for row, names in changed.items()} == dict.fromkeys(changed, 1)
    assert (rows["dropout .6"].dropout, rows["2 steps a frame"].upsample, rows["no delay"].delay_steps) == (0.6, 2, 0)


def test_final_settings_are_those_under_the_captions():
    violin, piano = Audio2BodyParams.tables("violin"), Audio2BodyParams.tables("piano")
    assert (violin.sequence, violin.batch, violin.components, violin.upsample) == (60, 100, 15, 4)
    assert (violin.dropout, violin.rate, piano.dropout, piano.rate) == (0.15, 2e-3, 0.1, 1e-3)
    assert (violin.delay, violin.delay_steps) == (0.024, 2)


def test_rows_about_rejected_frames_are_left_out_where_none_is_rejected():
    planted, hands = (
        CELLS.table_settings(SimpleNamespace(instrument="piano", label=label)) for label in (PLANTED, HANDS)
    )
    assert set(planted) - set(hands) == {"frames not dropped", "gaps interpolated"}
    assert tuple(hands)[-len(OWN_ROWS) :] == OWN_ROWS


def test_means_and_spreads_of_a_row_are_over_seeds():
    values = errors_by_row([FINAL], [6.0], seeds=2)
    values.loc[(values["seed"] == 2) & (values["side"] == "test"), "full"] += 1.0
    (row,) = CELLS.error_table(values).to_dict("records")
    assert (row["seeds"], row["test full"], row["test full SD"], row["test projected SD"]) == (2, 7.0, 0.5, 0.0)
    assert row["of mean pose"] == pytest.approx(7.0 / 20.5)
    assert (row["paper train"], row["paper validation"], row["paper test"]) == (6.52, 6.06, 6.84)


def test_the_same_order_as_the_papers_agrees_fully_and_the_reverse_not_at_all():
    rows = ["frames not dropped", "2 steps a frame", FINAL]  # 9.49, 7.98, 6.84 in the paper
    same = CELLS.rank_agreement(errors_by_row(rows, [9.0, 8.0, 7.0], seeds=3))
    assert (same["tau"], same["low"], same["high"], same["rows"]) == (1.0, 1.0, 1.0, 3)
    assert CELLS.rank_agreement(errors_by_row(rows, [7.0, 8.0, 9.0], seeds=3))["tau"] == -1.0
    assert CELLS.rank_agreement(errors_by_row(rows, [9.0, 7.0, 8.0]))["tau"] == pytest.approx(1 / 3)  # 2 of 3 pairs


def test_one_training_gives_no_interval_of_agreement_and_our_rows_no_order():
    agreement = CELLS.rank_agreement(errors_by_row(["no delay", FINAL, OWN_ROWS[0]], [8.0, 7.0, 1.0]))
    assert agreement["rows"] == 2
    assert np.isnan([agreement["low"], agreement["high"]]).all()


# The limits


def test_the_truth_itself_has_no_error_and_a_shift_has_its_length():
    limits = CELLS.ceilings(QUICK, four_times("piano", **{"from_audio": lambda take: take.clean})).set_index("row")
    assert limits.loc[FLOOR, "full"] == pytest.approx(0.0, abs=1e-9)
    shifted = {"from_audio": lambda take: take.clean + np.array([3.0, 4.0])}
    limits = CELLS.ceilings(QUICK, four_times("piano", **shifted)).set_index("row")
    assert limits.loc[FLOOR, "full"] == pytest.approx(np.sqrt((9 + 16) / 2))


def test_a_violinist_without_the_bows_direction_lies_between_truth_and_mean_pose():
    limits = CELLS.ceilings(QUICK, planted_data("violin")).set_index("row")["full"]
    assert list(limits.index) == [MEAN_POSE, BLIND, FLOOR]
    assert limits[FLOOR] < limits[BLIND] < limits[MEAN_POSE]


def test_the_bows_direction_is_no_limit_of_a_pianist():
    assert list(CELLS.ceilings(QUICK, planted_data("piano"))["row"]) == [MEAN_POSE, FLOOR]


def test_real_hands_have_no_limit_but_the_mean_pose():
    data = planted_data()
    recorded = PlayerData(HANDS, "piano", data.performances, data.split, MappingProxyType({}))
    assert list(CELLS.ceilings(QUICK, recorded)["row"]) == [MEAN_POSE]


def test_limits_stand_below_the_table_with_test_errors_alone():
    table = CELLS.complete_table(QUICK, planted_data(), errors_by_row([FINAL], [6.0])).set_index("row")
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
    assert CELLS.moving_parts(space, PLAYER_50) == ["left hand", "body"]


# Epochs and random input (readings 15 and 24)


def test_epochs_beyond_the_last_are_left_out():
    assert [CELLS.shown_epochs(last) for last in (300, 30, 10, 1)] == [(1, 10, 100, 300), (1, 10, 30), (1, 10), (1,)]


def test_spread_of_components_is_a_mean_over_pieces_and_a_share_of_that_to_music():
    still, wave = np.zeros((4, 2)), np.tile([[1.0, 2.0], [-1.0, -2.0]], (2, 1))
    pieces = {"music": (2 * wave, 4 * wave), "white noise as sound": (wave, still)}
    parts = [
        pd.DataFrame(
            {"input": name, "piece": piece, "time": np.arange(4) / 10, "first": own[:, 0], "second": own[:, 1]}
        )
        for name, both in pieces.items()
        for piece, own in enumerate(both)
    ]
    table = CELLS.spread_table(pd.concat(parts)).set_index("input")
    assert table.loc["music", ["SD 1", "SD 2", "speed 1"]].tolist() == pytest.approx([3.0, 6.0, 60.0])
    assert table.loc["white noise as sound", ["SD 1", "SD 1 / music"]].tolist() == [0.5, pytest.approx(1 / 6)]


def untrained(data: PlayerData, **settings: Any) -> SoundToPoints:
    """A network without training whose points are the mean pose, 10 pixels each."""
    params = Audio2BodyParams(hidden=4, components=2, fps=data.fps, **settings)
    reference = Reference((), np.zeros((0, 2)))
    network = SoundToPoints(params, data.performances[0].motion.skeleton, data.instrument, 2, reference)
    size = 2 * len(network.skeleton.joints)
    space = PointSpace(np.full(size, 10.0), np.eye(2, size), np.ones(2))
    network.set_statistics(torch.full((params.n_sound,), 5.0), torch.full((params.n_sound,), 2.0), space)
    return network.eval()


def test_random_features_are_normal_once_the_network_has_scaled_them():
    network = untrained(planted_data())
    features = CELLS.random_features(network, 4000, np.random.default_rng(0))
    scaled = network.sound_scale(torch.from_numpy(features)).numpy()
    assert np.abs(scaled.mean(axis=0)).max() < 0.1
    assert np.abs(scaled.std(axis=0) - 1).max() < 0.1


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trainings of a test are kept in its own folder."""
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))


@pytest.mark.usefixtures("kept")
def test_figures_5_and_6_show_the_first_test_piece_in_full():
    data = planted_data()
    mode = CELLS.mode_over_epochs(QUICK, data)
    assert mode["piece"].unique().tolist() == ["planted piano 4"]
    assert mode.groupby("epochs").size().to_dict() == {1: 144, 2: 144}
    run = trained_player(QUICK, data, Audio2BodyParams.tables("piano"), 1)
    inputs = CELLS.random_inputs(data, run)
    assert inputs["input"].unique().tolist() == ["music", "white noise as sound", "random features"]
    assert inputs["first"][inputs["input"] == "music"].to_list() == pytest.approx(
        mode["predicted"][mode["epochs"] == 2].to_list()
    )
    components = CELLS.component_table(data, run)
    assert components["share"].is_monotonic_decreasing
    assert components["share"].sum() == pytest.approx(1.0, abs=0.01)


@pytest.mark.usefixtures("kept")
def test_fewer_epochs_are_the_beginning_of_the_same_training():
    data = planted_data()
    settings = Audio2BodyParams.tables(data.instrument)
    short, whole = (trained_player(QUICK, data, settings, 1, epochs=epochs) for epochs in (1, None))
    assert len(short.history) == 1
    assert len(whole.history) == 2
    assert short.history["val_error"].iloc[0] == whole.history["val_error"].iloc[0]


@pytest.mark.usefixtures("kept")
def test_a_table_has_every_side_of_every_row():
    rows = CELLS.table_settings(planted_data())
    values = CELLS.player_errors(QUICK, planted_data(), {row: rows[row] for row in (FINAL, "no delay")})
    sides = ["train", "validation", "test", MEAN_POSE]
    assert list(zip(values["row"], values["side"], strict=True)) == [
        (row, side) for row in (FINAL, "no delay") for side in sides
    ]
    assert values["full"].gt(values["projected"]).all()


@pytest.mark.parametrize("instrument", ["violin", "piano"])
def test_each_gain_is_one_setting_on_the_way_from_the_paper_to_ours(instrument: str):
    data = SimpleNamespace(label=PLANTED, instrument=instrument)
    rows = {row: asdict(params) for row, params in CELLS.gain_settings(data).items()}
    plain, ours = rows.pop("our schedule"), asdict(our_settings(data))
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
        columns = ("error", "hits", "p", "other", "events", "depth", "body")
        return pd.DataFrame(
            [{"hands": row, "seed": 1, "piece": "a", **dict.fromkeys(columns, 0.5)} for row in settings]
        )

    def errors(profile: object, data: object, settings: dict[str, Audio2BodyParams], seeds: object) -> pd.DataFrame:
        return errors_by_row(list(settings), [8.0] * len(settings))

    cells = notebook_cells("19_sound_to_hands", player_errors=errors, piece_scores=scores)
    data = SimpleNamespace(label=PLANTED, instrument="piano")
    assert cells.gains_table(QUICK, data)["hits"].tolist() == [0.5] * 6
    assert scored == list(cells.gain_settings(data).values())


# Error and hits


def test_planted_strikes_meet_every_onset_of_their_own_music():
    scores = CELLS.piece_scores(QUICK, planted_data(), {})
    assert scores["hands"].tolist() == ["planted hands"]
    assert scores.loc[0, ["hits", "left", "right", "events"]].tolist() == pytest.approx([1.0] * 4, abs=0.02)
    # The noise that was planted, 1 pixel, and cameras that differ in size by 8 % each.
    assert scores.loc[0, "error"] == pytest.approx(1.0, rel=0.17)
    assert np.isnan(scores.loc[0, "other"])  # there is no other test piece


def test_strikes_of_real_hands_are_never_scored():
    refused("no score of them is evidence", CELLS.piece_scores, QUICK, planted_data(label=HANDS), {})


def test_the_late_row_differs_from_the_final_one_by_its_delay_alone():
    data = SimpleNamespace(label=PLANTED, instrument="piano")
    rows = CELLS.scored_settings(data)
    late, final = asdict(rows["delay 125 ms"]), asdict(rows[FINAL])
    assert {name for name in late if late[name] != final[name]} == {"delay"}
    assert late["delay"] == 0.125


def test_hits_are_means_over_pieces_and_their_spread_is_over_seeds():
    columns = ["hands", "seed", "piece", "error", "hits", "p", "other", "events", "depth", "body"]
    rows = [
        ("final", 1, "a", 6.0, 0.8, 0.01, 0.1, 1.0, 4.0, 0.0),
        ("final", 1, "b", 8.0, 0.6, 0.20, -0.3, 1.0, 4.0, 0.0),
        ("final", 2, "a", 6.0, 0.4, 0.01, 0.0, 1.0, 4.0, 0.0),
        ("final", 2, "b", 6.0, 0.6, 0.04, 0.0, 2.0, 4.0, 0.0),
    ]
    (row,) = CELLS.hits_table(pd.DataFrame(rows, columns=columns)).to_dict("records")
    assert (row["seeds"], row["pieces"], row["largest p"], row["pieces p < .05"]) == (2, 2, 0.2, 0.75)
    assert (row["error"], row["error SD"]) == (6.5, 0.5)
    assert (row["hits"], row["hits SD"]) == pytest.approx((0.6, 0.1))
    assert (row["other"], row["largest other"], row["events"]) == pytest.approx((-0.05, 0.3, 1.25))
    assert "left" not in row


def test_notes_without_a_sound_are_rendered_as_long_as_the_points(tmp_path: Path):
    (clip,) = load_pianomime(pianomime_folder(tmp_path / "set"))
    rendered = with_rendered_sound(clip)
    assert rendered.rendered
    assert rendered.audio.duration == pytest.approx(clip.motion.duration, abs=1e-4)
    refused("its notes are not known", with_rendered_sound, replace(clip, notes=None))
