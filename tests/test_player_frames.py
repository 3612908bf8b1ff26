"""Frames of musicians picked by rule, causes of their errors, avatars beside each other: answers by hand."""

import re
from types import MappingProxyType

import numpy as np
import pytest

from harmolab.lab.figures.style import COLOURS
from harmolab.musician.avatar import SHOULDERS
from harmolab.musician.page import avatar_player
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSplit
from harmolab.musician.synthetic import planted_performance
from harmolab.readers.player_points import HANDS_12, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.types import Motion, Notes
from study.experiments.player_frames import (
    PREDICTED,
    TRUE,
    PickedFrame,
    PredictedPiece,
    even_frames,
    quantile_frames,
    worst_frames,
)
from study.experiments.player_in_space import FOREARM, HALF_SHOULDERS, player_in_space
from study.experiments.players import PLANTED, PlayerData
from study.figures.player_overlays import (
    HEAD,
    NECK,
    head_of,
    onsets_figure,
    overlay_figure,
    picture_limits,
    points_figure,
    stills_figure,
)
from study.profile import RunProfile
from tests.builders import refused
from tests.notebook_cells import notebook_cells

FPS = 10.0
BODY = player_skeleton(["left_shoulder", "right_shoulder"])
USUAL = {"leap": 5.0, "rate": 2.0, "low": 50.0, "high": 70.0}
RIGHT, OTHER = "right music", "another music"
CELLS = notebook_cells("20_players_and_avatars")


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


def test_quantile_frames_have_the_rank_of_their_quantile_among_all_accepted_frames() -> None:
    first = piece_of([5.0, 1.0, 100.0, 9.0], valid=[True, True, False, True])
    frames = quantile_frames([first, piece_of([3.0, 7.0], name="two")], (0.0, 0.25, 0.5, 0.75, 1.0))
    assert [each.error for each in frames] == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert [(each.piece.performance.name, each.frame) for each in frames[:2]] == [("one", 1), ("two", 0)]
    assert frames[1].words == "25 % of the frames are better: 3.0 px"
    assert frames[1].seconds == 0.0 and frames[4].seconds == pytest.approx(0.3)


def test_of_equal_errors_the_earlier_frame_comes_first() -> None:
    assert [each.frame for each in quantile_frames([piece_of([2.0, 2.0, 2.0])], (0.0, 0.5, 1.0))] == [0, 1, 2]


def test_worst_frames_lie_a_second_apart_in_one_piece_and_anywhere_in_another() -> None:
    errors = np.ones(40)
    errors[[5, 6, 14, 15, 30]] = 10.0, 9.0, 8.0, 7.0, 6.0
    first, second = piece_of(errors.tolist()), piece_of([1.0, 1.0, 8.5], name="two")
    frames = worst_frames([first, second])
    # 6 and 14 are less than ten frames from 5.
    assert [(each.piece.performance.name, each.frame) for each in frames] == [
        ("one", 5),
        ("two", 2),
        ("one", 15),
        ("one", 30),
    ]


def test_rejected_frames_are_never_the_worst() -> None:
    assert worst_frames([piece_of([50.0, 1.0, 2.0], valid=[False, True, True])], 1)[0].frame == 2


def test_fewer_worst_frames_than_asked_where_a_piece_is_short() -> None:
    assert len(worst_frames([piece_of([1.0, 2.0])])) == 1


def test_even_frames_go_from_the_first_accepted_frame_to_the_last() -> None:
    piece = piece_of([0.0] * 6, valid=[False, True, True, True, True, True])
    assert [each.frame for each in even_frames(piece, 3)] == [1, 3, 5]


def test_share_of_a_hand_is_that_of_its_squared_distances() -> None:
    skeleton = player_skeleton(["left_shoulder", "right_shoulder", "left_wrist", "right_wrist"])
    off = np.array([[[1.0, 0.0], [0.0, 0.0], [0.0, 3.0], [0.0, -2.0]]] * 2)
    still = Motion(np.zeros((2, 4, 2)), FPS, skeleton)
    piece = PredictedPiece(Performance("one", "piano", None, still), still, Motion(off, FPS, skeleton), np.zeros(2))
    assert PickedFrame(piece, 0, "").hand_shares == {"left": pytest.approx(9 / 14), "right": pytest.approx(4 / 14)}


def test_real_hands_are_in_millimetres_and_have_no_planted_truth() -> None:
    hands = Motion(np.zeros((2, 12, 2)), FPS, HANDS_12)
    piece = PredictedPiece(Performance("hands", "piano", None, hands), hands, hands, np.zeros(2))
    assert piece.unit == "mm"
    with pytest.raises(ValueError, match="hands: is recorded"):
        _ = piece.pair


# Causes


def test_notes_of_a_chord_are_one_onset_at_their_mean_pitch() -> None:
    times, pitches = CELLS.hand_onsets(notes_of([1.0, 1.02, 2.0], [60, 64, 67]), offset=0.5)
    np.testing.assert_allclose(times, [0.5, 1.5])
    np.testing.assert_allclose(pitches, [62.0, 67.0])
    assert CELLS.hand_onsets(notes_of([], []))[0].size == 0


def test_moments_are_near_up_to_their_reach_and_not_beyond() -> None:
    times = np.array([0.4, 0.5, 1.0, 1.5, 1.6])
    np.testing.assert_array_equal(CELLS.near_any(times, np.array([1.0]), 0.5), [False, True, True, True, False])
    np.testing.assert_array_equal(CELLS.near_any(times, np.zeros(0), 0.5), [False] * 5)


def frames_with(cause: str, notes: Notes, **limits: float) -> list[int]:
    """The frames of a piece of 7 s that a cause holds for."""
    masks = CELLS.frame_causes(piece_of([0.0] * 70, notes=notes), {1: USUAL | limits})
    return np.flatnonzero(masks[cause]).tolist()


def test_leap_is_a_larger_step_than_usual_and_counts_around_its_second_note() -> None:
    notes = notes_of([1.0, 2.0, 4.0], [60, 65, 71])
    assert frames_with("leap", notes, leap=5.0) == list(range(35, 46))
    assert frames_with("leap", notes, leap=6.0) == []


def test_rate_counts_the_onsets_of_the_second_around_a_time() -> None:
    onsets = np.array([0.0, 0.4, 0.5, 2.0])
    np.testing.assert_array_equal(CELLS.onset_rate(onsets, np.array([0.0, 0.5, 1.4, 1.5])), [3, 3, 0, 1])
    assert frames_with("very fast", notes_of(onsets.tolist(), [60] * 4), rate=2.0) == list(range(6))


def test_unseen_register_lies_below_or_above_what_is_usual() -> None:
    notes = notes_of([1.0, 3.0, 5.0], [50, 71, 49])
    assert frames_with("unseen register", notes) == [*range(25, 36), *range(45, 56)]


def test_frames_beside_a_rejected_one_are_occluded() -> None:
    valid = np.ones(7, bool)
    valid[3] = False
    motion = Motion(np.zeros((7, 2, 2)), FPS, BODY, valid)  # 0.1 s is one frame
    np.testing.assert_array_equal(CELLS.occluded(motion), [False, False, True, True, True, False, False])


def test_hands_whose_boxes_overlap_are_occluded() -> None:
    points = np.zeros((3, len(HANDS_12.joints), 2))
    right = [HANDS_12.joints.index(name) for name in hand_joints("right") if name in HANDS_12.joints]
    left = [number for number in range(len(HANDS_12.joints)) if number not in right]
    points[:, left] = np.linspace([0.0, 0.0], [10.0, 10.0], len(left))
    for frame, shift in enumerate(([9.0, 9.0], [11.0, 0.0], [0.0, 11.0])):
        points[frame, right] = points[frame, left] + shift
    np.testing.assert_array_equal(CELLS.occluded(Motion(points, FPS, HANDS_12)), [True, False, False])


def test_causes_of_a_frame_are_those_whose_rule_holds_there() -> None:
    notes = notes_of([0.5, 1.5, 1.7, 1.9, 4.0], [60, 60, 62, 60, 72])
    valid = [True] * 60
    valid[18] = False
    piece = piece_of([1.0] * 60, valid=valid, notes=notes)
    words = CELLS.failure_words([PickedFrame(piece, frame, "") for frame in (5, 17, 40, 55)], {1: USUAL})
    named = [line.partition("\n")[0] for line in words]
    assert named[1:3] == ["1 px: very fast, occluded", "1 px: leap, unseen register"]
    assert {named[0], named[3]} == {"1 px: none of these"}


def test_words_of_a_failure_name_error_causes_and_the_hand_that_is_off() -> None:
    piece = piece_of([12.3, 1.0])
    assert CELLS.failure_words([PickedFrame(piece, 0, "")], {}) == ["12 px: none of these\nleft hand: 0% of its square"]


def test_causes_of_the_worst_hundredth_stand_beside_those_of_all_frames() -> None:
    errors = np.ones(200)
    errors[[100, 101]] = 50.0
    piece = piece_of(errors.tolist(), notes=notes_of([0.5, 10.0], [60, 66]))
    table = CELLS.cause_table([piece], {1: USUAL}).set_index("cause")
    assert table.loc["leap", "worst frames"] == 1.0
    assert table.loc["leap", "all frames"] == pytest.approx(11 / 200)  # 9.5 to 10.5 s
    assert table.loc["leap", "error with"] == pytest.approx((2 * 50 + 9) / 11)
    assert table.loc["leap", "error without"] == 1.0
    assert table.loc["none of these", "worst frames"] == 0.0
    assert np.isnan(table.loc["very fast", "error with"])


def test_usual_is_what_the_training_pieces_have() -> None:
    motion = Motion(np.zeros((50, 2, 2)), FPS, BODY)
    steady = notes_of([0.5, 1.5, 2.5, 3.5], [60, 62, 60, 62])
    wild = notes_of([0.5, 0.6, 0.7], [20, 100, 20])
    performances = tuple(
        Performance(name, "piano", None, motion, notes=notes)
        for name, notes in (("a", steady), ("b", steady), ("test", wild))
    )
    split = PlayedSplit(("a",), ("b",), ("test",))
    limits = CELLS.usual_limits(PlayerData(PLANTED, "piano", performances, split, MappingProxyType({})))
    assert limits == {1: {"leap": 2.0, "rate": 2.0, "low": 60.0, "high": 62.0}}


# Music and points


@pytest.fixture(scope="module")
def planted() -> list[PredictedPiece]:
    """Pianists whose predicted points are the truth."""
    pieces = []
    for seed in (1, 2):
        own = planted_performance("piano", seconds=14.0, seed=seed, faults=False)
        motion = Motion(own.clean, 24.0, PLAYER_50)
        pieces.append(PredictedPiece(own.performance, own.performance.motion, motion, np.zeros(len(own.clean)), own))
    return pieces


def test_right_music_is_hit_and_another_is_not(planted: list[PredictedPiece]) -> None:
    scores = CELLS.music_scores(*planted, seconds=12.0, n_rotations=200)
    assert scores[RIGHT].harmony_above_chance > 0.9 and scores[RIGHT].p_value < 0.05
    assert abs(scores[OTHER].harmony_above_chance) < 0.25
    assert scores[RIGHT].n_audio == scores[OTHER].n_audio
    refused("one: its notes are not known", CELLS.music_scores, piece_of([0.0, 0.0]), planted[0], seconds=1.0)


def test_planted_truth_stands_beside_the_prediction(planted: list[PredictedPiece]) -> None:
    pair = planted[0].pair
    assert list(pair) == [PREDICTED, TRUE]
    np.testing.assert_array_equal(pair[TRUE].positions, planted[0].planted.clean)


def test_notice_says_where_players_are_from_and_what_is_not_trained() -> None:
    split = PlayedSplit(("a",))
    data = PlayerData(PLANTED, "piano", (), split, MappingProxyType({"a": planted_performance("piano", seconds=2.0)}))
    assert CELLS.player_notice(RunProfile.full(), data) == "Planted, synthetic players and sound."
    assert "the network is not trained" in CELLS.player_notice(RunProfile.quick(), data)


# Depth


def test_error_of_the_depth_is_in_forearms_and_blind_to_size() -> None:
    player = player_in_space("piano", seconds=4.0)
    same = Motion(player.space.positions * SHOULDERS / (2 * HALF_SHOULDERS), 24.0, PLAYER_50)
    assert CELLS.depth_errors(player, same) == pytest.approx({"wrist depth": 0.0, "elbow": 0.0}, abs=1e-5)
    points = np.array(player.space.positions)
    for side in SIDES:
        points[:, PLAYER_50.joints.index(f"{side}_wrist"), 2] += 0.1 * FOREARM
    nearer = Motion(points * SHOULDERS / (2 * HALF_SHOULDERS), 24.0, PLAYER_50)
    assert CELLS.depth_errors(player, nearer)["wrist depth"] == pytest.approx(10.0)


def test_our_avatar_is_deep_enough_and_the_papers_is_not() -> None:
    table = CELLS.depth_table(RunProfile.quick()).set_index("settings")
    for measure, most in CELLS.DEPTH_LIMITS.items():
        assert (table.loc["ours", f"{measure}, worst"] <= most).all()
        assert (table.loc[["as in the paper", "ours, linear depth"], measure] > most).all()
    figure = CELLS.depth_figure(table.reset_index())
    assert [len(ax.patches) for ax in figure.axes] == [len(table)] * 2


# Pictures


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_head_is_above_the_shoulders_in_a_mirror_too(sign: float) -> None:
    head = head_of(np.array([[0.0, 0.0], [10.0 * sign, 0.0]]), BODY)
    assert head is not None
    np.testing.assert_allclose(head[0], [5.0 * sign, -10 * NECK])
    assert head[1] == pytest.approx(10 * HEAD)
    assert head_of(np.zeros((12, 2)), HANDS_12) is None


def test_picture_has_room_for_the_head() -> None:
    low, high = picture_limits([np.array([[0.0, 0.0], [10.0, 0.0]])], BODY)
    assert low[1] < -10 * (NECK + HEAD) and high[1] > 0


def test_overlays_share_one_frame_and_show_the_prediction_over_the_truth(planted: list[PredictedPiece]) -> None:
    frames = even_frames(planted[0], 5)
    figure = overlay_figure(frames, [each.words for each in frames], title="planted")
    drawn = [ax for ax in figure.axes if ax.axison]
    assert len(drawn) == 5
    assert len({(ax.get_xlim(), ax.get_ylim()) for ax in drawn}) == 1
    low, high = drawn[0].get_ylim()
    assert low > high  # y points down
    lines = [each for each in drawn[0].collections if hasattr(each, "get_segments")]
    colours = ["#{:02x}{:02x}{:02x}".format(*(np.rint(255 * each.get_colors()[0][:3]).astype(int))) for each in lines]
    assert colours == [COLOURS["miss"].lower(), COLOURS["hit"].lower()]
    assert max(lines[0].get_linewidths()) > 2 * max(lines[1].get_linewidths())


def test_points_alone_are_drawn_at_the_times_that_are_named(planted: list[PredictedPiece]) -> None:
    figure = points_figure(planted[0].tracked, (1.0, 2.5), title="x")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["1.0 s", "2.5 s"]


def test_stills_of_one_movement_are_alike_and_stand_beside_those_of_another(planted: list[PredictedPiece]) -> None:
    points = {"one": planted[0].predicted, "same": planted[0].predicted, "other": planted[1].predicted}
    stills = CELLS.avatar_stills(points, "piano", (1.0, 4.0), height=120, width=100)
    assert {name: [still.shape for still in row] for name, row in stills.items()} == {
        name: [(120, 100, 3)] * 2 for name in points
    }
    np.testing.assert_array_equal(stills["one"], stills["same"])
    assert (stills["one"][0] != stills["one"][1]).any() and (stills["one"][0] != stills["other"][0]).any()
    assert len(stills_figure(stills, (1.0, 4.0), title="x").axes) == 6
    refused("times must lie within the 14", CELLS.avatar_stills, points, "piano", (14.0,))
    with pytest.raises(ValueError, match="the same points"):
        CELLS.avatar_stills({"one": planted[0].predicted, "two": piece_of([0.0, 0.0]).predicted}, "piano", (0.0,))


def test_player_shows_both_avatars_with_their_hits(planted: list[PredictedPiece]) -> None:
    played = planted[0].performance
    both = {RIGHT: planted[0].predicted, OTHER: planted[1].predicted}
    player = avatar_player(
        played.audio, both, played.notes, "piano", title="x", seconds=6.0, notice="Planted.", n_rotations=50
    )
    assert player.page.count('class="stage"') == 2
    assert "Planted." in player.page and "strike" in player.page
    for name, score in CELLS.music_scores(*planted, seconds=6.0, n_rotations=50).items():
        hits = re.search(rf"{name}: onsets hit.*?(\d+) of (\d+)", player.page, flags=re.DOTALL)
        assert hits is not None and (int(hits[1]), int(hits[2])) == (score.hits.sum(), score.n_audio)


def test_row_of_onsets_says_how_many_are_hit(planted: list[PredictedPiece]) -> None:
    scores = CELLS.music_scores(*planted, seconds=6.0, n_rotations=50)
    figure = onsets_figure(scores, title="x", event="strikes", seconds=6.0)
    for ax, (name, score) in zip(figure.axes, scores.items(), strict=True):
        assert ax.get_title(loc="left").startswith(f"{name}: {score.hits.sum()} of {score.n_audio} onsets hit")
        assert [label.get_text() for label in ax.get_yticklabels()] == ["strikes", "notes"]
