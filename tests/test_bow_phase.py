"""The bow of Audio to Body Dynamics: strokes by hand, and a network that keeps up-bow and down-bow apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harmolab.musician.bow import (
    AROUND,
    LATENESS,
    LEAK,
    PEAK,
    Bowing,
    Strokes,
    alternating,
    discriminant,
    loudness,
    stroke_contrasts,
    stroke_ends,
    stroke_sounds,
    turn_signal,
    turns_of,
)
from harmolab.musician.cleaning import Reference
from harmolab.musician.networks import SoundToPoints, predicted_points, predicted_strokes, synthesize_performance
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PlayedSet, PlayedSplit, PointSpace, played_set
from harmolab.musician.synthetic import PlantedPerformance, planted_performances
from harmolab.musician.train import errors, errors_between, mean_pose_errors, prepared, train_audio2body
from harmolab.readers.player_points import HANDS_12, PLAYER_50
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.weights import load_weights, save_weights
from tests.builders import refused
from tests.notebook_cells import notebook_cells

FPS = 24.0
CELLS = notebook_cells("19_sound_to_hands")
PARAMS = replace(
    Audio2BodyParams.tables(), bow_phase=True, hidden=48, components=6, epochs=14, batch=8, rate=1e-2
)  # fmt: skip
NOWHERE = Reference((), np.zeros((0, 2)))


@pytest.fixture(scope="module")
def planted() -> list[PlantedPerformance]:
    return list(planted_performances("violin", 7, seconds=20.0))


@pytest.fixture(scope="module")
def split(planted: list[PlantedPerformance]) -> PlayedSplit:
    names = [each.performance.name for each in planted]
    return PlayedSplit(tuple(names[:5]), (), tuple(names[5:]))


@pytest.fixture(scope="module")
def played(planted: list[PlantedPerformance], split: PlayedSplit) -> PlayedSet:
    return played_set([each.performance for each in planted], PARAMS, split)


@pytest.fixture(scope="module")
def bow(played: PlayedSet) -> Bowing:
    return Bowing.fit(played.sequences[:5], PLAYER_50, PARAMS)


@pytest.fixture(scope="module")
def network(played: PlayedSet, split: PlayedSplit, tmp_path_factory: pytest.TempPathFactory) -> SoundToPoints:
    return train_audio2body(played, split, TrainOptions(tmp_path_factory.mktemp("runs") / "bow"))


# By hand


def test_strokes_alternate_against_weak_evidence_and_break_off_for_strong() -> None:
    assert alternating(np.array([2.0, 0.5, 0.1, -0.5, 1.0])).tolist() == [1, -1, 1, -1, 1]
    assert alternating(np.array([-2.0, 0.5, 0.1])).tolist() == [-1, 1, -1]
    # An overlooked turn: two down-bows in a row, of which five strokes on each side are sure.
    sure = np.array([3.0, -3.0, 3.0, -3.0, 3.0, 3.0, -3.0, 3.0, -3.0, 3.0])
    assert alternating(sure).tolist() == np.sign(sure).tolist()
    # One break costs log(.98 / .02) = 3.89. Evidence of 3.8 on one side of it is too little, of 4.0 enough.
    for least, signs in ((3.8, [1, -1]), (4.0, [1, 1])):
        assert alternating(np.array([9.0, least])).tolist() == signs
    assert alternating(np.zeros(0)).tolist() == []
    with np.errstate(divide="ignore"):
        assert alternating(np.array([1.0, 5.0, 5.0]), alternation=1.0).tolist() == [1, -1, 1]


def test_a_bow_stays_within_its_ends_and_is_drawn_to_its_mean() -> None:
    places = stroke_ends(np.array([0.5, -0.2, 0.9, -2.0]), start=0.25, mean=0.5, leak=0.0)
    np.testing.assert_allclose(places, [0.25, 0.75, 0.55, 1.0, 0.0])
    np.testing.assert_allclose(stroke_ends(np.zeros(2), start=0.0, mean=0.5, leak=0.1), [0.0, 0.05, 0.095])


def test_places_are_straight_lines_between_turns() -> None:
    bow = replace(Bowing.empty(1), levels=np.array([0.0, 0.5, 0.5]))
    places = bow.places(Strokes(np.array([1.0, 2.0, 3.0]), np.array([1, -1]), np.array([0.25, 0.5])), 5, 1.0)
    down = 0.5 + 0.25
    up = down + LEAK * (0.5 - down) - 0.5
    np.testing.assert_allclose(places, [0.5, 0.5, down, up, up])


def test_turns_are_read_from_bumps_and_moved_back() -> None:
    times = np.arange(0, 4, 1 / 96)
    turns = np.array([0.5, 1.003, 2.71])
    signal = PEAK * np.exp(-np.square((times[:, None] - turns - LATENESS) / 0.03) / 2).max(axis=1)
    np.testing.assert_allclose(turns_of(signal, 96.0), turns, atol=1e-3)
    assert turns_of(0.1 * signal, 96.0).size == 0
    assert turns_of(np.zeros(50), 96.0).size == 0


def test_strokes_have_their_mean_loudness_and_duration() -> None:
    loud = np.repeat([1.0, 3.0], 12)
    sounds = stroke_sounds(np.array([0.0, 0.5, 1.0]), loud, FPS)
    np.testing.assert_allclose(sounds, [[np.log(0.5), 1.0], [np.log(0.5), 3.0]])
    np.testing.assert_allclose(stroke_sounds(np.array([0.25, 0.75]), loud, FPS), [[np.log(0.5), 2.0]])
    assert stroke_sounds(np.zeros(1), loud, FPS).shape == (0, 2)


def test_contrasts_are_differences_to_the_neighbours() -> None:
    contrasts = stroke_contrasts(np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 4.0]]))
    assert contrasts.shape == (3, 4 * AROUND + 1)
    # Two before, one before, one after, two after; beyond the ends the last one stands for all.
    np.testing.assert_allclose(contrasts[:, 1::2], [[0, 0, -1, -3], [1, 1, -2, -2], [3, 2, 0, 0]])
    np.testing.assert_allclose(contrasts[:, -1], 1.0)
    assert stroke_contrasts(np.zeros((0, 2))).shape == (0, 4 * AROUND + 1)


def test_the_discriminant_is_the_log_odds_of_two_normal_distributions() -> None:
    rng = np.random.default_rng(0)
    truth = np.arange(40000) % 2 == 0
    values = np.column_stack([np.where(truth, 1.0, -1.0) + 2 * rng.normal(size=truth.size), np.ones(truth.size)])
    np.testing.assert_allclose(discriminant(values, truth), [2 * 1.0 / 4, 0.0], atol=0.02)
    assert not discriminant(values, np.ones(truth.size, bool)).any()


def test_a_bow_that_hears_nothing_stays_at_its_start() -> None:
    bow = replace(Bowing.empty(2), levels=np.array([0.0, 0.6, 0.3]))
    silence = np.full(48, -13.8)
    strokes = bow.strokes(np.zeros(0), silence, FPS)
    assert (strokes.turns.size, strokes.signs.size) == (1, 0)
    np.testing.assert_allclose(bow.places(strokes, 48, FPS), 0.3)
    assert bow.strokes(np.array([1.5]), silence, FPS).turns[1] == pytest.approx(1.5 + 1 / FPS)


# On the planted violinist


def test_the_bow_of_the_points_is_the_planted_one(
    planted: list[PlantedPerformance], played: PlayedSet, bow: Bowing
) -> None:
    for each, sequence in zip(planted, played.sequences, strict=True):
        good = sequence.accepted
        assert each.bow is not None
        assert np.corrcoef(bow.place(sequence.points)[good], each.bow[good])[0, 1] > 0.98
        rest = bow.at_rest(sequence.points)
        np.testing.assert_allclose(bow.at_place(rest, bow.place(sequence.points)), sequence.points, atol=1e-9)
        # Read through its own effect, the place of a bow at rest is the mean one, give or take string crossings.
        assert np.std(bow.place(rest)[good]) < 0.2 * np.std(bow.place(sequence.points)[good])
    assert 0.5 < bow.law[1] < 1.0  # planted: loudness (half the log energy) x duration^0.8
    assert 0.35 < bow.law[2] < 0.65


def test_the_turn_signal_has_a_bump_after_each_turn(planted: list[PlantedPerformance], played: PlayedSet) -> None:
    signal = turn_signal(played.sequences[0], PLAYER_50, FPS)
    turns = turns_of(np.interp(np.arange(0, signal.size - 1, 0.25), np.arange(signal.size), signal), 4 * FPS)
    times = planted[0].strikes.times
    assert abs(turns.size - times.size) <= 2
    around = np.round(times[:, None] * FPS).astype(int) + np.arange(-2, 3)
    tracked = played.sequences[0].accepted[around.clip(0, signal.size - 1)].all(axis=1)
    assert tracked.sum() > 20
    away = np.abs(times[tracked, None] - turns).min(axis=1)
    assert np.median(away) < 0.02
    assert np.mean(away < 0.06) > 0.9


def test_directions_follow_from_planted_turns_alone(
    planted: list[PlantedPerformance], played: PlayedSet, bow: Bowing
) -> None:
    for each, sequence in zip(planted[5:], played.sequences[5:], strict=True):
        strokes = bow.strokes(each.strikes.times, loudness(sequence.sound, PARAMS), FPS)
        assert strokes.signs.tolist() == [(-1) ** number for number in range(len(each.strikes))]
        assert (CELLS.true_signs(strokes, each.bow, FPS) == strokes.signs)[:-1].all()


def test_the_network_comes_below_the_ceiling_of_those_that_do_not_know_the_direction(
    planted: list[PlantedPerformance], played: PlayedSet, bow: Bowing, network: SoundToPoints
) -> None:
    test = played.sequences[5:]
    truth = [CELLS.planted_points(each, network.reference) for each in planted[5:]]
    projected = [network.projected(each.points) for each in test]
    ceiling = errors_between([bow.at_rest(points) for points in truth], projected, test)
    floor = errors_between(truth, projected, test)
    full = errors(network, test).full
    assert floor.full < full < 0.85 * ceiling.full
    assert ceiling.full < mean_pose_errors(network, test).full
    outcome = CELLS.bow_errors(network, test)
    assert outcome["predicted"] == pytest.approx(full)
    assert outcome["true place"] < outcome["predicted"]
    assert outcome["directions right"] > 0.8
    assert outcome["strokes"] == sum(predicted_strokes(network, each.sound).signs.size for each in test)


def test_a_performance_follows_its_strokes(
    planted: list[PlantedPerformance], played: PlayedSet, network: SoundToPoints
) -> None:
    sequence, performance = played.sequences[5], planted[5].performance
    points = predicted_points(network, sequence.sound)
    assert performance.audio is not None
    motion = synthesize_performance(network, performance.audio)
    np.testing.assert_allclose(motion.positions.reshape(len(points), -1), points, atol=1e-6)
    strokes = predicted_strokes(network, sequence.sound)
    turned = predicted_points(network, sequence.sound, strokes=strokes._replace(signs=-strokes.signs))
    assert np.abs(turned - points).max() > 20


def test_weights_keep_the_bow(played: PlayedSet, network: SoundToPoints, tmp_path: Path) -> None:
    save_weights(tmp_path / "again", network)
    again = load_weights(tmp_path / "again", SoundToPoints)
    sound = played.sequences[6].sound
    np.testing.assert_array_equal(predicted_points(again, sound), predicted_points(network, sound))


def test_the_loss_of_windows_has_the_turns_and_their_error_has_not(played: PlayedSet, split: PlayedSplit) -> None:
    network, train, _ = prepared(played, split)
    plain, plain_train, _ = prepared(replace(played, params=replace(PARAMS, bow_phase=False)), split)
    assert (train.target.shape[2], plain_train.target.shape[2]) == (7, 6)
    assert (network.linear.out_features, plain.linear.out_features) == (7, 6)
    assert "bow_scale.effect" in network.state_dict()
    assert not any("bow" in name for name in plain.state_dict())
    assert 0 <= float(train.target[..., 6].min()) < 0.01 < 0.9 < float(train.target[..., 6].max()) / PEAK <= 1


def test_correlations_of_components() -> None:
    space = PointSpace(np.zeros(3), np.eye(3), np.ones(3))
    truth = np.array([[1.0, 0.0, 5.0], [2.0, 1.0, 5.0], [3.0, 0.0, 5.0]])
    values = CELLS.component_correlations(
        space, [truth[:2] * (2, -1, 1), truth[2:] * (2, -1, 1)], [truth[:2], truth[2:]]
    )
    np.testing.assert_allclose(values, [1.0, -1.0, np.nan])


# Refused


def test_bow_phase_is_refused_where_there_is_no_bow(
    planted: list[PlantedPerformance], played: PlayedSet, split: PlayedSplit, network: SoundToPoints
) -> None:
    refused("bow_phase is of violinists", SoundToPoints, PARAMS, PLAYER_50, "piano", 3, NOWHERE)
    refused("bow_phase is of violinists", prepared, replace(played, instrument="piano"), split)
    refused("left_shoulder", prepared, replace(played, skeleton=HANDS_12), split)
    plain = SoundToPoints(replace(PARAMS, bow_phase=False), PLAYER_50, "violin", 3, NOWHERE)
    for call in (predicted_strokes, CELLS.bow_errors):
        with pytest.raises(ValueError, match="without bow_phase"):
            call(plain, played.sequences[0].sound if call is predicted_strokes else played.sequences)
    still = replace(played.sequences[0], points=np.zeros_like(played.sequences[0].points))
    refused("10 strokes or more; these recordings have 0", Bowing.fit, [still], PLAYER_50, PARAMS)
