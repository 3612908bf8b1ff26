"""Pictures of musicians: rejected frames and their rules, alignment, steps, the network's sizes, drawings."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from harmolab.musician.cleaning import RULES
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.synthetic import FAULTS, planted_performance
from harmolab.readers.player_points import PLAYER_50
from harmolab.types import Notes
from study.experiments.players import cleaned_performance, tracked_players
from study.figures.player_points import (
    cleaning_figure,
    draw_player,
    faults_figure,
    features_figure,
    frames_figure,
    note_name,
    overview_figure,
    player_network_figure,
)
from study.figures.player_results import components_figure, hits_figure, player_table_figure
from tests.notebook_cells import notebook_cells
from tests.test_player_tables import planted_data

NAN = float("nan")
CELLS = notebook_cells("18_sound_and_points")
HANDS = notebook_cells("19_sound_to_hands")


def planted(instrument: str = "piano"):
    return planted_performance(instrument, seconds=30.0)


# Cleaning and placing


def test_the_first_frame_of_each_planted_fault_is_shown_with_the_rule_that_caught_it():
    performance = planted()
    examples = CELLS.fault_examples([performance])
    assert tuple(example.fault for example in examples) == FAULTS
    rules = {example.fault: example.rule for example in examples}
    assert (rules["swapped hands"], rules["missing hand"]) == ("swapped", "missing")
    for example in examples:
        assert round(example.seconds * 24) == np.flatnonzero(performance.fault == example.fault)[0]
        assert example.before.tolist() != example.points.tolist()


def test_a_frame_that_passes_is_shown_as_not_rejected():
    performance = planted_performance("piano", seconds=6.0, faults=False)
    fault = np.full(performance.fault.shape, "", "<U20")
    fault[70] = "jump"  # said to be one, but nothing jumps
    (example,) = CELLS.fault_examples([replace(performance, fault=fault)])
    assert (example.rule, example.seconds) == ("", 70 / 24)


def test_recorded_examples_have_one_frame_for_each_rule_that_rejects():
    performance = planted().performance
    report = cleaned_performance(performance).report()
    examples = CELLS.recorded_examples([performance])
    assert {example.rule for example in examples} == {rule for rule, share in report.items() if share > 0}
    assert {example.fault for example in examples} == {""}


def test_every_frame_counts_for_one_fault_or_as_good():
    table = CELLS.planted_cleaning([planted()]).set_index("fault")
    assert list(table.index) == [*FAULTS, CELLS.GOOD]
    assert table["frames"].sum() == 720
    assert table.loc["missing hand", "rejected"] == 1.0  # points that were not detected are always missing
    assert table.loc[CELLS.GOOD, "rejected"] < 0.08


def test_planted_pieces_are_one_row_of_the_summary_and_recordings_rows_of_their_own():
    shares = dict.fromkeys(RULES, 0.0)
    rows = [
        {"recording": "a", "instrument": "piano", "source": "synthetic", "seconds": 10.0, **shares, "rejected": 0.1},
        {"recording": "b", "instrument": "piano", "source": "synthetic", "seconds": 30.0, **shares, "rejected": 0.3},
        {"recording": "c", "instrument": "violin", "source": "tracked", "seconds": 5.0, **shares, "rejected": 0.5},
    ]
    summary = CELLS.cleaning_summary(pd.DataFrame(rows))
    assert summary["recording"].tolist() == ["planted piano, 2 pieces", "c (recorded)"]
    assert summary["rejected"].tolist() == pytest.approx([0.25, 0.5])


def test_shares_of_the_rules_add_up_to_what_is_rejected():
    performance = planted()
    (row,) = CELLS.cleaning_table([performance.performance]).to_dict("records")
    accepted = cleaned_performance(performance.performance).accepted
    assert row["rejected"] == pytest.approx(sum(row[rule] for rule in RULES))
    assert row["rejected"] == pytest.approx(np.mean(~accepted))


def test_words_of_notebook_18_weigh_faults_by_their_frames():
    faults = pd.DataFrame({"instrument": "piano", "fault": ["jump", "swapped hands", "good frame"],
                           "frames": [30, 10, 200], "rejected": [1.0, 0.6, 0.01]})  # fmt: skip
    words = CELLS.finding({"a2b_faults": faults})
    assert words == "Rules alone reject 90% of the 40 wrong frames that were planted, and 1.0% of the good ones."


def test_one_similarity_a_recording_is_better_for_hands_than_one_a_frame_or_none():
    errors = CELLS.alignment_table(planted_data()).pivot_table(index="alignment", columns="part", values="error")
    for hand in ("left hand", "right hand"):
        assert errors.loc["recording", hand] < 0.8 * errors.loc["frame", hand] < errors.loc["none", hand]


def test_without_recordings_there_are_no_tracked_players(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    assert tracked_players() == ()


# Sound, components, steps, sizes


def test_notes_of_a_stretch_begin_in_it_and_are_on_its_time_line():
    own = Notes([0.5, 2.0, 3.9, 4.0], [1.0, 5.0, 4.5, 4.2], [60, 61, 62, 63]).span(2.0, 2.0)
    assert own.pitches.tolist() == [61, 62]
    assert own.onsets.tolist() == pytest.approx([0.0, 1.9])
    assert own.offsets.tolist() == pytest.approx([3.0, 2.5])


def test_twenty_eight_names_and_twenty_seven_without_the_energys_slope():
    names = CELLS.feature_names(Audio2BodyParams())
    assert (len(names), names[13], names[27]) == (28, "log energy", "slope of log energy")
    assert CELLS.feature_names(Audio2BodyParams(energy_delta=False)) == names[:27]


def test_a_clip_is_cut_alike_from_sound_features_points_and_avatar():
    clip = CELLS.played_clip(planted_performance("piano", seconds=8.0), start=1.0, seconds=4.0)
    assert clip.features.shape == (96, 28)
    assert clip.points.n_frames == clip.avatar.n_frames == 96
    assert clip.audio.duration == pytest.approx(4.0)


def test_modes_share_all_of_the_variance_and_two_hold_the_hands():
    shares, moves = CELLS.point_components(planted_data())
    assert shares["share"].sum() == pytest.approx(1.0)
    assert moves.groupby("component").size().tolist() == [50, 50, 50]
    assert CELLS.counts(shares)[0.9] <= 2
    lengths = moves.assign(square=moves["dx"] ** 2 + moves["dy"] ** 2).groupby("component")["square"].sum()
    assert (lengths / lengths.iloc[0]).tolist() == pytest.approx(
        (shares["share"] / shares["share"].iloc[0])[:3].tolist()
    )


def test_steps_show_a_rejected_frame_and_no_step_beside_it_counts():
    steps = CELLS.delayed_steps(planted_data())
    frames = steps[steps["frame"]]
    assert frames.index.tolist() == list(range(0, 4 * 14, 4))[: len(frames)]
    rejected = int(frames.index[~frames["accepted"]][0])
    assert not steps["usable"][rejected - 3 : rejected + 4].any()
    between = steps["value"].iloc[1:4].to_numpy()
    assert between == pytest.approx(np.interp([1, 2, 3], [0, 4], frames["value"].iloc[:2]))
    late = [1000 * (steps[name] - steps["time"]).iloc[0] for name in ("tables", "ours")]
    assert late == pytest.approx([1000 * 2 / 96, 125.0])


def test_the_diagram_counts_the_papers_parameters():
    boxes = CELLS.player_boxes(CELLS.untrained_player(planted_data("violin")))
    # An LSTM of 200 units has 4 x 200 x (28 + 200 + 2) numbers, the layer after it (200 + 1) x 15.
    assert "184,000 of 187,015 parameters" in boxes["LSTM"]
    assert "3,015 of 187,015 parameters" in boxes["linear"]
    assert "28 numbers a frame" in boxes["sound"]
    assert "2 steps (21 ms) late" in boxes["components"]


# Drawing


def test_points_that_were_not_detected_are_not_drawn():
    detected = np.ones(50, bool)
    detected[PLAYER_50.joints.index("left_wrist")] = False
    points = np.arange(100.0).reshape(50, 2)
    whole, partly = (draw_player(Figure().subplots(), points, PLAYER_50, detected=seen) for seen in (None, detected))
    bones = [len(ax.collections[0].get_segments()) for ax in (whole, partly)]
    assert bones[0] - bones[1] == 2  # from the elbow, and to the hand
    assert [len(ax.collections[1].get_offsets()) for ax in (whole, partly)] == [50, 49]


def test_middle_c_is_c4():
    assert [note_name(pitch) for pitch in (21, 60, 61, 108)] == ["A0", "C4", "C#4", "C8"]


def test_frames_are_accepted_ones_and_name_the_notes_that_sound():
    result = cleaned_performance(planted().performance)
    figure = frames_figure({"a pianist": result}, columns=3)
    times = [float(ax.get_xlabel().split(" s")[0]) for ax in figure.axes]
    assert times == pytest.approx([5.0, 15.0, 25.0], abs=0.5)
    silent = replace(result, performance=replace(result.performance, notes=None))
    assert frames_figure({"a pianist": silent}).axes[0].get_xlabel().endswith("notes not known")


def test_each_rejected_frame_names_its_fault_and_its_rule():
    figure = faults_figure(CELLS.fault_examples([planted()]))
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[0] == "swapped hands\nrejected by: swapped"
    assert len(titles) == 4


def test_pictures_of_notebook_18_are_drawn_from_their_records():
    data = planted_data()
    clip = CELLS.played_clip(planted_performance("piano", seconds=8.0), start=1.0, seconds=4.0)
    titles = [ax.get_title(loc="left") for ax in overview_figure(clip, at=1.0).axes]
    assert titles == ["1 the sound", "2 28 numbers a frame", "3 50 points (planted)", "4 an avatar"]
    assert [label.get_text() for label in features_figure(clip).axes[1].get_yticklabels()][2] == "log energy"
    shares, moves = CELLS.point_components(data)
    titles = [ax.get_title(loc="left") for ax in CELLS.components_picture(shares, moves).axes]
    assert titles[3].startswith(f"{CELLS.counts(shares)[0.9]} hold 90 %")
    assert titles[0].startswith("planted piano, component 1\n") and titles[1].startswith("component 2\n")
    legend = CELLS.steps_figure(CELLS.delayed_steps(data)).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()][1:3] == ["learnt 21 ms later", "learnt 125 ms later"]
    boxes = player_network_figure(CELLS.player_boxes(CELLS.untrained_player(data))).axes[0].patches
    assert [patch.get_gid() for patch in boxes].count("box") == 8
    assert [patch.get_gid() for patch in boxes].count("arrow") == 7
    performances = [each.performance for each in data.planted.values()]
    report = cleaning_figure(
        CELLS.cleaning_summary(CELLS.cleaning_table(performances)), CELLS.planted_cleaning(list(data.planted.values()))
    )
    assert [label.get_text() for label in report.axes[1].get_yticklabels()] == [*FAULTS, CELLS.GOOD]


def test_titles_of_figure_5_have_epochs_and_the_correlations_of_accepted_frames():
    curve = np.sin(np.arange(360))
    half = np.where(np.arange(360) % 2, curve, -curve)
    still = np.zeros(360)
    parts = {1: half, 10: still, 30: np.where(np.arange(360) == 7, 50.0, 3 - 2 * curve)}
    table = pd.concat(
        [
            pd.DataFrame({"epochs": epochs, "time": np.arange(360) / 24, "tracked": curve, "predicted": own})
            for epochs, own in parts.items()
        ]
    )
    figure = HANDS.mode_epochs_figure(table.assign(accepted=np.tile(np.arange(360) != 7, 3)), "planted piano", "pixels")
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[1:] == ["10 epochs: correlation nan", "30 epochs: correlation -1.00"]
    assert titles[0].startswith("1 epoch: correlation ")
    assert figure.get_suptitle().startswith("Planted piano: correlation highest after 1 epoch")
    assert len(figure.axes[0].lines[0].get_xdata()) == 288  # twelve seconds


def test_titles_of_figure_6_have_shares_of_the_spread_to_music():
    names = ("music", "white noise as sound")
    times = np.arange(48) / 24
    curves = pd.concat([pd.DataFrame({"input": name, "piece": "a", "time": times, "first": times}) for name in names])
    table = pd.DataFrame({"input": names, "SD 1": [50.0, 4.0], "SD 1 / music": [1.0, 0.08]})
    figure = HANDS.random_inputs_figure(curves, table, "planted piano")
    assert figure.get_suptitle() == "Planted piano, share of the movement to music: 8% to white noise as sound"
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "music: SD 50.0 pixels", "white noise as sound: SD 4.0 pixels, 8 % of that to music",
    ]  # fmt: skip


def table_of(rows: dict[str, tuple[float, float]]) -> pd.DataFrame:
    """Rows of (test error, the paper's), and a mean pose of 20."""
    parts = [
        {"row": row, "seeds": 3, "train full": ours, "validation full": ours, "test full": ours, "test full SD": 0.1,
         "paper test": paper}
        for row, (ours, paper) in rows.items()
    ]  # fmt: skip
    return pd.DataFrame([*parts, {"row": "mean pose", "test full": 20.0}])


def test_a_table_is_drawn_as_differences_from_final_with_limits_as_lines():
    figure = player_table_figure(table_of({"no delay": (8.0, 9.5), "final": (7.0, 9.0)}), players="players")
    assert figure.get_suptitle() == "Players: least error with final, 7.0 pixels (mean pose 20.0)"
    ours, differences, paper = figure.axes
    assert [line.get_xdata()[0] for line in ours.lines if line.get_label() == "mean pose"] == [20.0]
    assert list(differences.containers[0].lines[0].get_xdata()) == [1.0, 0.0]
    assert list(paper.containers[0].lines[0].get_xdata()) == [0.5, 0.0]


def test_without_numbers_of_the_paper_its_panel_is_left_out():
    table = table_of({"final": (7.0, NAN)})
    assert len(player_table_figure(table, players="players").axes) == 3
    assert len(player_table_figure(table.drop(columns="paper test"), players="hands").axes) == 2


def test_components_are_labelled_with_part_and_share():
    rows = [("violin", 1, 0.77, "right hand", 0.2), ("violin", 2, 0.16, "left hand", 0.95)]
    table = pd.DataFrame(rows, columns=["instrument", "component", "share", "part", "correlation"])
    (ax,) = components_figure(table).axes
    assert [bar.get_height() for bar in ax.patches] == [0.2, 0.95]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["1\nright hand\n77 %", "2\nleft hand\n16 %"]
    assert ax.get_title("left") == "Planted violin: largest component predicted at 0.20"


def test_error_and_hits_stand_side_by_side_with_other_music():
    table = pd.DataFrame(
        {"hands": ["planted hands", "final"], "error": [1.0, 7.0], "error SD": [0.0, 0.2], "hits": [1.0, 0.8],
         "hits SD": [0.0, 0.1], "other": [0.0, 0.02], "pieces p < .05": [1.0, 0.5]}
    )  # fmt: skip
    error, hits = hits_figure({"piano": table}).axes
    assert error.get_title("left") == "Planted piano: least error\nwith final"
    assert [bar.get_width() for bar in error.patches] == [1.0, 7.0]
    assert [bar.get_width() for bar in hits.patches] == [1.0, 0.8]
    (other,) = [line for line in hits.lines if line.get_label() == "other music"]
    assert list(other.get_xdata()) == [0.0, 0.02]
    assert [text.get_text() for text in hits.texts[:2]] == ["100 %", "50 %"]
