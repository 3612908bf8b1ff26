"""The choreographer: seams in closed form, the best path, beats on beats, what it refuses; and the shipped banks."""

import hashlib
import itertools
import json
import pickle
import subprocess
import sys
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize

from harmolab.beats.audio import music_beats
from harmolab.body.skeletons import Skeleton, foot_joints, heading
from harmolab.data.recordings import Recording, load_recording
from harmolab.data.synthetic import ClipSettings, PlantedClip, planted_clip, synthetic_motion
from harmolab.data.synthetic.clips import write_corpus
from harmolab.lab.compare.windows import cut_clips
from harmolab.lab.evaluate.measured import Dance, dance_numbers
from harmolab.metrics.likeness import LONGEST, LikenessLimits, likeness, window_measures
from harmolab.metrics.quality import STEP, bone_error, foot_skating, sampled, vector_lengths
from harmolab.params import HarmonyParams
from harmolab.readers.motion import load_motion, save_motion
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.systems.choreographer import generate
from harmolab.systems.choreographer import moves as mv
from harmolab.systems.choreographer.banks import FOLDER, REMARKS, puppets, shipped_bank
from harmolab.systems.choreographer.form import EASE, HOP, Form, pace
from harmolab.systems.choreographer.generate import TOO_LITTLE, Choreographer, Choreography, repetition, warnings_of
from harmolab.systems.choreographer.lay import (
    MusicBeats,
    beat_numbers,
    beats_between,
    choose,
    faded,
    fit,
    node_costs,
    runs_of,
)
from harmolab.systems.choreographer.takes import Take, dancing_span, mirrored, nearest_dance, take_of
from harmolab.systems.training.motion_code import fixed_bones
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.bar_pattern import fit_pattern
from harmolab.verdict.judge import score_motion
from study.cells import notebook_cells
from study.experiments.study import readable_recordings
from tests.builders import BODY, bone_lengths, cases, refused, track, waving
from tools.bank import DREAMT, NO_RECORDING, TAKES, danced_parts, dreamt_takes, shipped_takes, write_bank

SILENCE = Audio(np.zeros(8000 * 60), 8000.0)


def planted(dance: str, seed: int, seconds: float = 20.0) -> PlantedClip:
    return planted_clip(ClipSettings(dance, seconds, fps=30.0, seed=seed), name=f"{dance} {seed}")


def waltz_motion(seed: int, seconds: float = 20.0) -> Motion:
    motion = planted("waltz", seed, seconds).clip.motion
    assert motion is not None
    return motion


@pytest.fixture(scope="module")
def dancer() -> Choreographer:
    return Choreographer.of([planted("waltz", seed) for seed in (1, 2, 3)])


def beats(bpm: float = 88.0, *, first: float = 0.31, meter: int = 3) -> BeatTrack:
    times = np.arange(first, 60.0, 60.0 / bpm)
    places = None if meter == 0 else (np.arange(times.size) % meter).tolist()
    return track(times, duration=60.0, bar_places=places)


# Seams


def clouds(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, mv.Clouds]:
    positions, weights = rng.normal(size=(count, 3, 4, 3)), np.array([0.1, 0.2, 0.3, 0.4])
    return positions, weights, mv.clouds_of(positions, weights)


def test_a_distance_is_what_is_left_after_the_best_turn_and_shift(rng: np.random.Generator):
    positions, weights, made = clouds(rng, 3)

    def left(way: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
        floor = (other[..., 0] + 1j * other[..., 2]) * np.exp(1j * way[0]) + way[1] + 1j * way[2]
        off = np.abs(one[..., 0] + 1j * one[..., 2] - floor) ** 2 + (one[..., 1] - other[..., 1]) ** 2
        return float(np.sqrt((off * weights).sum(axis=1).mean()))

    for first, second in ((0, 1), (1, 2), (2, 0)):
        tried = [minimize(left, [angle, 0.0, 0.0], (positions[first], positions[second])).fun for angle in (0, 2, 4)]
        assert mv.distances(made, made)[first, second] == pytest.approx(100 * min(tried), rel=1e-4)


def test_a_cloud_that_was_only_turned_and_shifted_is_at_no_distance_and_fits(rng: np.random.Generator):
    positions, weights, made = clouds(rng, 1)
    floor = (positions[..., 0] + 1j * positions[..., 2]) * np.exp(0.7j) + 5 - 3j
    moved = mv.clouds_of(np.stack([floor.real, positions[..., 1], floor.imag], axis=-1), weights)
    assert mv.distances(made, moved)[0, 0] == pytest.approx(0.0, abs=0.05)
    turn, shift = fit(moved, made)
    assert turn == pytest.approx(np.exp(0.7j), abs=1e-6) and shift == pytest.approx(5 - 3j, abs=1e-5)


def test_of_many_clouds_the_nearest_alone_are_kept(rng: np.random.Generator):
    _, _, made = clouds(rng, 40)
    made = mv.Clouds(made.floor / 5, made.heights / 5, made.middles)
    every = mv.Distances(made, mv.ChoreographerParams())
    few = mv.Distances(made, mv.ChoreographerParams(dense=39, nearest=5))
    rows = np.arange(40)
    full, kept = every.rows(rows), few.rows(rows)
    assert ((kept < mv.TOO_LONG).sum(axis=1) == 5).all()
    np.testing.assert_allclose(np.sort(kept, axis=1)[:, :5], np.sort(full, axis=1)[:, :5], atol=1e-3)
    np.testing.assert_allclose(few.pairs(rows, kept.argmin(axis=1)), kept.min(axis=1), atol=1e-3)


# Choice


SIDED = Skeleton(("hips", "head", "left_hand", "right_hand", "left_hip", "right_hip"), (-1,) * 6)


def wandering_take(name: str, rng: np.random.Generator, *, count: int = 8, meter: int = 0) -> Take:
    """A body that goes through random poses, one a beat of half a second."""
    keys = BODY + 0.3 * rng.normal(size=(count, *BODY.shape))
    places = np.linspace(0, count - 1, (count - 1) * 15 + 1)
    positions = np.stack([np.interp(places, np.arange(count), column) for column in keys.reshape(count, -1).T], axis=1)
    motion = Motion(positions.reshape(-1, *BODY.shape), 30.0, SIDED)
    bars = np.arange(count) % meter if meter else None
    return take_of(Clip(name, SILENCE, motion, beats=track(np.arange(count) / 2, bar_places=bars)))


PLAIN = mv.ChoreographerParams(variety=0.0, noise=0.0, unplaced_run=1, harmony=0.0, winding=0.0)


def test_the_path_is_the_best_of_all_there_are(rng: np.random.Generator):
    moves = plain_moves(*(wandering_take(name, rng, count=4) for name in "ab"))
    music = MusicBeats(np.cumsum([0.0, 0.5, 0.6, 0.4, 0.5, 0.5]), np.zeros(0, int), 0)
    _, step = moves.seam_rows(np.arange(len(moves)), PLAIN)
    goes_on = moves.following >= 0
    step[goes_on, moves.following[goes_on]] = 0.0
    tempo = PLAIN.tempo / 4 * np.abs(np.log(np.diff(music.times))[:, None] - np.log(moves.lengths))

    def cost(path: tuple[int, ...]) -> float:
        seams = sum(step[one, other] for one, other in itertools.pairwise(path))
        return float(seams + sum(tempo[beat, node] for beat, node in enumerate(path)))

    best = min(itertools.product(range(len(moves)), repeat=5), key=cost)
    assert cost(tuple(choose(moves, music, PLAIN))) == pytest.approx(cost(best), rel=1e-5)


@pytest.mark.parametrize("paths", [2, 3, 500])
def test_every_path_that_is_followed_has_its_own_memory_its_own_turns_and_its_own_run(paths: int):
    costs = {"seam": 1.0, "variety": 60.0, "alike": 20.0, "noise": 0.0, "forgetting": 32.0, "winding": 40.0}
    params = mv.ChoreographerParams(**costs, unplaced_run=2, longest_run=3, paths=paths)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        takes = [wandering_take(name, rng, count=7) for name in "ab"]
        shares = [rng.uniform(size=7) for _ in takes]
        moves = mv.moves_of([mv.Course(take, take.beats) for take in takes], params, shares)
        music = MusicBeats(np.cumsum(rng.uniform(0.4, 0.6, 10)), np.zeros(0, int), 0, ranks=rng.uniform(size=9))
        assert np.abs(moves.turns).max() > 0.1
        assert choose(moves, music, params).tolist() == followed(moves, music, params), seed


def followed(moves: mv.Moves, music: MusicBeats, params: mv.ChoreographerParams) -> list[int]:
    """The best path where to each beat and node the best way is kept, all of each path's costs counted from itself."""
    every = np.arange(len(moves))
    cost, likeness = moves.seam_rows(every, params)[1], np.exp(-((moves.alike.rows(every) / params.alike) ** 2))
    own = params.tempo / 4 * np.abs(np.log(np.diff(music.times))[:, None] - np.log(moves.lengths))
    own += params.harmony * (1 - moves.shares) + params.energy * (music.ranks[:, None] - moves.ranks) ** 2

    def step(path: list[int], node: int) -> float:
        run = 1
        while run < len(path) and moves.following[path[-run - 1]] == path[-run]:
            run += 1
        ages = np.arange(len(path))[::-1]
        seen = (likeness[path, node] * np.exp(-ages / params.forgetting)).max() * params.variety / 4
        seen += params.winding * abs(moves.turns[[*path, node]].sum())
        if moves.following[path[-1]] == node:
            return float(seen + mv.TOO_LONG * (run >= params.longest_run))
        return float(seen + cost[path[-1], node] + mv.TOO_SHORT * (run < params.unplaced_run))

    paths = [(float(own[0, node]), [node]) for node in every.tolist()]
    for beat in range(1, len(own)):
        kept = sorted(paths)[: params.paths]
        paths = []
        for node in every.tolist():
            total, path = min((total + step(path, node), path) for total, path in kept)
            paths.append((total + float(own[beat, node]), [*path, node]))
    return min(paths)[1]


def test_of_two_recordings_alike_the_one_that_fits_its_dance_better_is_danced(rng: np.random.Generator):
    params = replace(PLAIN, harmony=6.0)
    take, music = wandering_take("a", rng, count=6), MusicBeats(np.arange(6) / 2, np.zeros(0, int), 0)
    courses = [mv.Course(take, take.beats)] * 2
    for shares, danced in (((0.9, 0.1), 0), ((0.1, 0.9), 1), ((0.45, 0.55), 1)):
        moves = mv.moves_of(courses, params, [np.full(6, share) for share in shares])
        assert moves.course[choose(moves, music, params)].tolist() == [danced] * 5
        costs = node_costs(moves, music, params, 0)
        np.testing.assert_allclose(costs[:, [0, 5]], np.tile(6.0 * (1 - np.array(shares)), (5, 1)), atol=1e-6)


@pytest.mark.parametrize("first", [0, 1, 2])
def test_each_beat_is_ranked_as_the_beat_of_the_bar_that_it_is(first: int):
    # Hands go up or down around "one" and rest on "two" and "three"; the take begins on any of them.
    count = 31
    numbers = np.arange(0.0, count - 1, 1 / 15) + first
    phase = np.floor((numbers + 0.5) / 3) + np.clip((numbers + 0.5) % 3, 0, 1)
    places = (np.arange(count) + first) % 3
    (shares,) = mv.pattern_shares([Take("waltz", waving(phase), "waltz", np.arange(count) / 2, places, 3)])
    for place in range(3):
        assert shares[2:-2][places[2:-2] == place].min() > 0.9


def test_no_run_is_shorter_than_a_bar_or_longer_than_eight_beats_each_danced_at_its_place(dancer: Choreographer):
    music = beats()
    pieces = dancer.choreograph(SILENCE, music, seconds=30.0).pieces
    lengths = [piece.last_beat - piece.first_beat for piece in pieces]
    assert min(lengths[:-1]) >= 3 and max(lengths) <= 8
    places = {take.name: take.places for take in dancer.takes}
    for piece in (piece for piece in pieces if piece.start >= 0):
        beat = int(np.abs(music.times - piece.start).argmin())
        assert places[piece.recording][piece.first_beat] == music.bar_places[beat]


def test_without_variety_the_dance_repeats_itself_more(dancer: Choreographer):
    again = Choreographer(dancer.takes, params=mv.ChoreographerParams(variety=0.0, noise=0.0))
    more, usual = (each.choreograph(SILENCE, beats(), seconds=40.0).seen_before for each in (again, dancer))
    assert more > usual + 0.1


@pytest.mark.parametrize(("name", "value"), [("seam", -1.0), ("nearest", 0), ("alike", 0.0), ("samples", 2.5)])
def test_impossible_settings_are_refused(name: str, value: float):
    refused(name, mv.ChoreographerParams, **{name: value})


# The music's beats


def test_gaps_and_ends_of_the_music_are_filled_with_beats_at_its_pace_and_places_in_the_bar_go_on():
    times = [1.0, 1.5, 2.0, 3.5, 4.0]
    music = beats_between(track(times), 0.2, 5.1, meter=0, period=9.0)
    np.testing.assert_allclose(music.times, np.arange(0.0, 5.6, 0.5))
    assert music.meter == 0 and music.places.size == 0
    music = beats_between(track(times, bar_places=[0, 1, 2, 2, 0]), 0.2, 4.4, meter=3, period=1.0)
    assert music.places.tolist() == [1, 2, 0, 1, 2, 0, 1, 2, 0, 1]


def test_a_beat_of_the_music_lies_exactly_on_a_recorded_beat(dancer: Choreographer):
    music = MusicBeats(np.array([0.2, 0.9, 1.5, 2.3, 3.0, 3.6, 4.4]), np.arange(7) % 3, 3)
    moves = dancer._moves_of(dancer.takes, music.period)
    path = choose(moves, music, dancer.params)
    runs = runs_of(moves, path, dancer.params)
    numbers = beat_numbers(music, music.times)
    np.testing.assert_allclose(numbers, np.arange(7), atol=1e-12)
    middle = next(run.first + 1 for run in runs if run.last - run.first >= 3)  # outside of every fade
    course, node = moves.courses[moves.course[path[middle]]], path[middle]
    recorded = course.take.motion.positions
    frame = course.beats[moves.beat[node]] * course.take.motion.fps
    made = faded(moves, runs, numbers)[middle]
    np.testing.assert_allclose(made[:, 1], recorded[round(frame)][:, 1], atol=0.02)
    np.testing.assert_allclose(made[:, 1], course.positions(moves.beat[node : node + 1] + 0.0)[0, :, 1], atol=1e-9)


def plain_moves(*takes: Take) -> mv.Moves:
    return mv.moves_of([mv.Course(take, take.beats) for take in takes], PLAIN)


def walked(name: str, turn: complex = 1.0, shift: complex = 0.0, height: float = 0.0) -> Take:
    """A body that walks eight beats of half a second with waving hands: turned, moved on the floor, and lifted."""
    positions = waving(np.arange(0.0, 8.0, 1 / 15)).positions.copy()
    positions[..., 2] += np.linspace(0.0, 4.0, len(positions))[:, None]
    floor = (positions[..., 0] + 1j * positions[..., 2]) * turn + shift
    placed = np.stack([floor.real, positions[..., 1] + height, floor.imag], axis=-1)
    return Take(name, Motion(placed, 30.0, Skeleton.unnamed(len(BODY))), beats=np.arange(8) / 2)


def test_one_walk_recorded_in_three_places_and_directions_is_danced_as_one():
    moves = plain_moves(walked("a"), walked("b", np.exp(0.7j), 5 - 3j), walked("c", np.exp(-2.1j), -2 + 1j))
    runs = runs_of(moves, np.array([0, 1, 9, 10, 11, 19, 20]), PLAIN)  # seven nodes a recording
    assert [(run.course, run.beat, run.first, run.last) for run in runs] == [(0, 0, 0, 2), (1, 2, 2, 5), (2, 5, 5, 7)]
    numbers = np.linspace(0.0, 6.9, 80)
    np.testing.assert_allclose(faded(moves, runs, numbers), moves.courses[0].positions(numbers), atol=1e-5)


def test_a_dance_that_begins_turned_and_moved_is_turned_and_moved_as_a_whole(rng: np.random.Generator):
    moves = plain_moves(*(wandering_take(name, rng) for name in "abc"))
    path, numbers = np.array([0, 1, 9, 10, 18, 19]), np.linspace(0.0, 5.9, 80)
    usual = faded(moves, runs_of(moves, path, PLAIN), numbers)
    other = faded(moves, runs_of(moves, path, PLAIN, turn=1j, shift=2 - 3j), numbers)
    # 1j turns x to z and z to -x.
    expected = np.stack([2 - usual[..., 2], usual[..., 1], usual[..., 0] - 3], axis=-1)
    np.testing.assert_allclose(other, expected, atol=1e-9)


def test_a_fade_is_slow_at_its_ends_and_fast_in_its_middle():
    # From a body to the same one a metre higher. With s from 0 to 1: s^3 (10 - 15 s + 6 s^2), 53 / 512 at s = 1 / 4.
    moves = plain_moves(walked("a"), walked("b", height=1.0))
    runs = runs_of(moves, np.array([0, 1, 9, 10]), PLAIN)
    numbers = 2 + np.array([-0.6, -0.5, -0.25, 0.0, 0.25, 0.5, 0.6])
    risen = faded(moves, runs, numbers) - moves.courses[0].positions(numbers)
    expected = [0, 0, 53 / 512, 1 / 2, 459 / 512, 1, 1]
    np.testing.assert_allclose(risen[..., 1], np.tile(expected, (len(BODY), 1)).T, atol=1e-9)


# What is heard of the song


def sound(*parts: tuple[float, float]) -> Audio:
    """Sound of so many seconds each, at so many decibels of full scale."""
    levels = np.concatenate([np.full(round(1000 * seconds), 10 ** (decibels / 20)) for seconds, decibels in parts])
    return Audio(levels * (-1.0) ** np.arange(levels.size), 1000.0)


@cases(
    "parts, period, silences",
    ([(4, -20), (1, -51), (4, -20)], 0.5, [(4, 5)]),  # 30 dB below the median
    ([(4, -20), (1, -49), (4, -20)], 0.5, []),
    ([(4, -20), (0.95, -51), (4, -20)], 0.5, []),
    ([(4, -40), (1, -56), (4, -40)], 0.5, [(4, 5)]),
    ([(4, -40), (1, -54), (4, -40)], 0.5, []),
    ([(4, -20), (1.5, -90), (4, -20)], 1.0, [(4, 5.5)]),  # one and a half beats
    ([(4, -20), (1.45, -90), (4, -20)], 1.0, []),
    ([(4, -20), (2, -90), (0.95, -20), (2, -90), (4, -20)], 0.5, [(4, 8.95)]),
    ([(4, -20), (2, -90), (1, -20), (2, -90), (4, -20)], 0.5, [(4, 6), (7, 9)]),
    ([(2, -90), (4, -20), (2, -90)], 0.5, [(0, 2), (6, 8)]),
    ([(8, -90), (4, -20), (1, -51), (2, -20)], 0.5, [(0, 8), (12, 13)]),  # the median of what sounds
    ([(4, -90)], 0.5, []),
    ([(4, -45), (2, -57), (4, -45)], 0.5, []),  # a quiet recording
    ([(4, -45), (2, -78), (4, -45)], 0.5, [(4, 6)]),
    ([(4, -70), (2, -99), (4, -80), (1, -120)], 0.5, [(10, 11)]),
)
def test_silence_is_far_below_the_music_or_below_hearing_for_a_second(
    parts: list[tuple[float, float]], period: float, silences: list[tuple[float, float]]
):
    np.testing.assert_allclose(Form.of(sound(*parts)).silences(period), silences, atol=1e-9)


def heard(form: Form, *, end: float = 99.0, count: int = 40, period: float = 0.5, usual: float = 0.5) -> MusicBeats:
    """A beat every half second, as it is danced to a song until a second."""
    return form.danced_beats(MusicBeats(period * np.arange(count + 1), np.arange(count + 1) % 3, 3), end, usual)


def silent(start: float, end: float, *, seconds: float = 30.0) -> Form:
    times = (np.arange(round(seconds / HOP)) + 0.5) * HOP
    return Form(np.full(times.size, -20.0), (times < start) | (times > end))


@cases(
    "start, end, first, last",  # beats: the pose is that of the first until the last
    (2.1, 4.05, 4, 8),
    (2.1, 4.15, 4, 9),  # the beat at 4 s lies deeper in the silence
    (1.9, 4.05, 4, 8),
    (1.85, 4.05, 3, 8),
    (0.0, 2.0, 0, 4),
    (18.0, 20.0, 36, 40),
    (2.1, 3.4, 4, 7),
)
def test_in_silence_beats_stand_still_and_the_next_goes_on_in_time(start: float, end: float, first: int, last: int):
    music = heard(silent(start, end), end=-1.0)  # that is before any end could be eased
    numbers = beat_numbers(music, np.arange(0.0, 20.25, 0.25))
    np.testing.assert_allclose(numbers[2 * first : 2 * last + 1], first)
    np.testing.assert_allclose(numbers[: 2 * first : 2], np.arange(first), atol=1e-9)
    np.testing.assert_allclose(numbers[2 * last :: 2], first + np.arange(41 - last), atol=1e-9)
    assert music.lengths.size == 40 - (last - first)
    np.testing.assert_allclose(music.lengths, 0.5)
    assert np.diff(numbers).min() >= 0
    assert music.places.tolist() == (np.array([*range(first), *range(last, 41)]) % 3).tolist()


def test_a_single_beat_between_two_silences_is_not_danced():
    one, other = silent(1.9, 3.7), silent(4.72, 7.9)
    music = heard(replace(one, sounds=one.sounds & other.sounds), end=-1.0, period=1.0)
    np.testing.assert_allclose(beat_numbers(music, np.array([1.0, 2.0, 4.0, 6.0, 8.0, 9.0])), [1, 2, 2, 2, 2, 3])


def test_a_beat_is_as_loud_as_its_middle():
    times = (np.arange(400) + 0.5) * HOP  # half a decibel a second; 5 and 95 % of it lie at 1.0225 and 18.9775 s
    music = heard(Form(times / 2 - 30, np.ones(400, bool)), end=-1.0)
    assert music.ranks[20] == pytest.approx(0.5 + 0.8 * ((10.25 - 1.0225) / 17.955 - 0.5), abs=1e-4)


def test_silences_throughout_or_at_other_times_hold_nothing():
    for form in (silent(0.0, 25.0), silent(21.0, 25.0)):
        assert form.silences(0.5)
        music = heard(form, end=-1.0)
        assert not music.held.any() and music.lengths.size == 40


def test_a_dance_slows_down_in_its_last_beat_and_rests_at_its_end():
    form = silent(99.0, 99.0)
    music = heard(form, end=15.2)  # the last three beats, from 13.5 to 15 s, are danced as one
    np.testing.assert_allclose(beat_numbers(music, np.array([13.5, 15.0, 15.1, 15.2])), [27, 28, 28, 28])
    assert music.places.tolist() == (np.arange(29) % 3).tolist()
    fast = heard(form, end=7.0, period=0.35)  # 20 beats: the last four are danced as one
    np.testing.assert_allclose(beat_numbers(fast, 0.35 * np.array([15, 16, 20])), [15, 16, 17])
    slow = heard(form, end=20.0, period=1.0)
    np.testing.assert_allclose(beat_numbers(slow, np.array([17.0, 18.0, 20.0])), [17, 18, 19])


def test_a_short_dance_and_one_that_ends_in_silence_are_not_slowed_down():
    for beats, eased in ((5, 0), (6, 2)):
        assert beats - heard(silent(99.0, 99.0), end=0.5 * beats, count=beats).lengths.size == eased
    np.testing.assert_allclose(heard(silent(8.0, 12.0), end=10.0, count=20).lengths, 0.5)


@cases(
    "levels, usual, ranks",
    ((-30, -20), 0.5, (0.1, 0.9)),
    ((-22.5, -20), 0.5, (0.4, 0.6)),  # half of 5 dB: a quarter of the way
    ((-30, -20), 1.0, (0.45, 1.0)),  # twice as fast as usual
    ((-30, -20), 0.25, (0.0, 0.55)),
    ((-50, -20, -30), 0.5, (0.1, 0.9, 0.5)),  # of 30 dB the upper 20 count
)
def test_loud_and_fast_music_aims_at_quick_movement(levels: tuple[float, ...], usual: float, ranks: tuple[float, ...]):
    music = heard(Form.of(sound(*((10.0, level) for level in levels))), end=-1.0, count=20 * len(levels), usual=usual)
    np.testing.assert_allclose(music.ranks[10::20], ranks, atol=1e-6)
    assert heard(Form.of(SILENCE)).ranks.size == 0


@cases(
    "parts, span, words",
    ([(32, -30), (38, -20), (4, -90), (6, -20)], (0, 80),
     "quiet 0:00-0:32, loud from 0:32, silence 1:10-1:14"),
    ([(32, -30), (38, -20), (4, -90), (6, -20)], (40, 72), "loud from 0:40, silence from 1:10"),
    ([(4, -90), (20, -30), (4, -90), (20, -20), (4, -90)], (0, 52),
     "silence 0:00-0:04, quiet 0:04-0:24, silence 0:24-0:28, loud 0:28-0:48, silence from 0:48"),
    ([(32, -30), (38, -20)], (0, 30), ""),
    ([(20, -25), (20, -20.1)], (0, 40), ""),  # less than 5 dB
    ([(20, -25.1), (20, -20)], (0, 40), "quiet 0:00-0:20, loud from 0:20"),
    # Power is smoothed, which makes .8 s more of what is loud.
    ([(20, -30), (20, -20), (20, -30), (3, -20), (20, -30)], (30, 83), "loud 0:30-0:40, quiet from 0:40"),
    ([(20, -30), (20, -20), (20, -30), (3.5, -20), (20, -30)], (50, 83),
     "quiet 0:50-1:00, loud 1:00-1:04, quiet from 1:04"),
    ([(20, -20), (3.5, -30), (20, -20), (5, -30)], (0, 48), "loud 0:00-0:44, quiet from 0:44"),
    ([(8, -20), (8, -30)] * 5, (0, 80), "loud 0:00-0:08, quiet 0:08-0:16, loud 0:16-0:24, quiet 0:24-0:32, "
     "loud 0:32-0:40, quiet 0:40-0:48, loud 0:48-0:56, quiet 0:56-1:04, 2 more"),
)  # fmt: skip
def test_what_is_heard_is_said(parts: list[tuple[float, float]], span: tuple[float, float], words: str):
    assert Form.of(sound(*parts)).in_words(*span, 0.5) == words


def test_slow_music_is_danced_more_slowly_than_recorded_and_fast_music_faster():
    assert pace(0.5, 0.5) == 0.5
    assert pace(1.0, 0.5) == pytest.approx(2**-0.15) and pace(0.25, 0.5) == pytest.approx(2**0.15 / 4)


def test_quick_beats_are_ranked_above_slow_ones_and_the_rank_aimed_at_is_cheap():
    phases = (np.arange(0.0, 4.0, 1 / 30), np.arange(0.0, 8.0, 1 / 15))  # the second waves twice as fast
    moves = plain_moves(*(Take("a", waving(phase), beats=np.arange(4.0)) for phase in phases))
    assert moves.ranks[:3].max() < 0.5 < moves.ranks[3:].min() and moves.ranks.mean() == pytest.approx(0.5)
    music = MusicBeats(np.arange(3.0), np.zeros(0, int), 0, ranks=np.array([0.2, 0.8]))
    expected = PLAIN.energy * (np.array([[0.2], [0.8]]) - moves.ranks) ** 2
    np.testing.assert_allclose(node_costs(moves, music, PLAIN, 0), expected, atol=1e-5)
    held = replace(music, times=np.array([0.0, 1.0, 4.0]), held=np.array([0.0, 0.0, 2.0]))
    np.testing.assert_allclose(node_costs(moves, held, PLAIN, 0), expected, atol=1e-5)  # danced in one second, too


def test_speed_and_turns_of_a_beat_are_told_whatever_its_length():
    waved = waving(np.arange(0.0, 6.0, 1 / 30))
    angle = np.linspace(0, 3 * np.pi, 180)[:, None]  # a quarter turn a second
    x, z = waved.positions[..., 0], waved.positions[..., 2]
    ways = [x * np.cos(angle) + z * np.sin(angle), waved.positions[..., 1], z * np.cos(angle) - x * np.sin(angle)]
    course = mv.Course(Take("a", Motion(np.stack(ways, axis=-1), 30.0, SIDED)), np.array([1.0, 2.0, 4.0, 5.0]))
    np.testing.assert_allclose(course.speeds(), course.speeds()[0], rtol=0.02)
    np.testing.assert_allclose(np.abs(course.turns()), [0.25, 0.5, 0.25], rtol=0.02)


def test_a_seam_that_may_show_costs_four_times_for_what_is_wide_of_it(rng: np.random.Generator):
    moves = plain_moves(*(wandering_take(name, rng) for name in "abc"))
    moves = replace(moves, edges=np.zeros_like(moves.edges))
    distance, cost = moves.seam_rows(np.arange(len(moves)), PLAIN)
    assert distance.min() < 12 < distance.max()
    np.testing.assert_allclose(cost, 3 + np.where(distance < 12, distance, 4 * distance - 36), rtol=1e-5)


def test_music_is_slow_or_fast_beside_the_recorded_beats(dancer: Choreographer, monkeypatch: pytest.MonkeyPatch):
    usual, periods = [], []
    monkeypatch.setattr(Form, "danced_beats", lambda form, music, end, each: usual.append(each) or music)
    monkeypatch.setattr(generate, "pulse", lambda signal, period: periods.append(period) or np.arange(9.0))
    for one in (dancer, Choreographer.of([waltz_motion(1)])):
        one.choreograph(SILENCE, beats(100.0), seconds=9.0)
    own = np.median(np.concatenate([np.diff(take.beats) for take in dancer.takes]))
    assert usual == [own, 0.5] and periods == [pytest.approx(pace(0.6, 0.5))]


# Mirrored takes


def test_a_mirrored_take_has_left_and_right_in_each_others_place(rng: np.random.Generator):
    take = wandering_take("a", rng)
    twin = mirrored(take)
    left, right = SIDED.joints.index("left_hand"), SIDED.joints.index("right_hand")
    np.testing.assert_allclose(twin.motion.positions[:, [left, 0]], take.motion.positions[:, [right, 0]] * [-1, 1, 1])
    assert twin.name == "a, mirrored"
    np.testing.assert_array_equal(mirrored(twin).motion.positions, take.motion.positions)
    one, other = (mv.Course(each, take.beats) for each in (take, twin))
    np.testing.assert_allclose(one.turns(), -other.turns(), atol=1e-9)
    np.testing.assert_allclose(one.speeds(), other.speeds(), rtol=1e-6)
    moves = mv.moves_of([one, other], PLAIN)
    assert repetition(moves, np.array([0, 7]), PLAIN)[1] == 0.0  # the same beat in the mirror is another movement


@cases(
    "recorded, danced, skeleton, joins",
    (179.0, 30.0, SIDED, True),
    (181.0, 30.0, SIDED, False),
    (181.0, 122.0, SIDED, True),  # less than one and a half of the dance
    (181.0, 119.0, SIDED, False),
    (30.0, 30.0, Skeleton.unnamed(6), False),
)
def test_mirrored_takes_join_where_recordings_are_few(recorded: float, danced: float, skeleton: Skeleton, joins: bool):
    dancer = Choreographer.of([replace(waving(np.arange(0.0, 2 * recorded, 1 / 15)), skeleton=skeleton)])
    names = {course.take.name for course in dancer._moves_of(dancer.takes, 0.5, danced).courses}
    assert names == ({"motion 1", "motion 1, mirrored"} if joins else {"motion 1"})


# Dances


def test_the_pose_is_held_in_silence_and_the_guard_does_not_mind(dancer: Choreographer):
    made = dancer.choreograph(sound((8, -20), (8, -90), (14, -20)), beats(120.0, first=0.0), seconds=30.0)
    assert made.form == "silence 0:08-0:16"
    speed = vector_lengths(np.diff(made.motion.positions, axis=0)).mean(axis=1)
    assert speed[8 * 30 + 3 : 16 * 30 - 3].max() < 0.1 * speed[: 7 * 30].mean()
    assert made.held[8 * 30 + 2 : 16 * 30 - 2].all() and not made.held[: 7 * 30].any()
    assert "poorest" in likeness(made.motion, limits=dancer.limits).fails
    assert "poorest" not in likeness(made.motion, limits=dancer.limits, held=made.held).fails


@pytest.mark.parametrize("start", (1.0, 13.8, 15.0, 29.0))  # in silences, and a little before one
def test_a_dance_to_nothing_but_silence_is_a_pose_that_is_held(dancer: Choreographer, start: float):
    song = sound((8, -90), (6, -20), (8, -90), (6, -20), (8, -90))
    made = dancer.choreograph(song, beats(120.0, first=0.0), start=start, seconds=6.0)
    assert made.held[10:].all() and np.ptp(made.motion.positions[10:], axis=0).max() < 0.05


def test_a_dancer_sent_to_another_process_dances_the_same(dancer: Choreographer):
    sent = pickle.loads(pickle.dumps(dancer))
    np.testing.assert_array_equal(*(each.generate(SILENCE, seconds=6.0, seed=1).positions for each in (dancer, sent)))


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_dance(dancer: Choreographer):
    one, same, other = (dancer.generate(SILENCE, beats(), seconds=12.0, seed=seed) for seed in (3, 3, 4))
    assert one.positions.tobytes() == same.positions.tobytes()
    assert np.abs(one.positions - other.positions).max() > 0.1


def test_another_song_of_the_same_tempo_gets_another_dance(dancer: Choreographer):
    made = (dancer.choreograph(SILENCE, beats(first=first), seconds=30.0).pieces for first in (0.31, 0.32))
    one, other = ([(piece.recording, piece.first_beat) for piece in pieces] for pieces in made)
    assert one != other


def test_the_dance_begins_in_the_middle_faces_the_camera_and_keeps_its_bones(dancer: Choreographer):
    motion = dancer.generate(SILENCE, beats(), seconds=10.0)
    assert motion.fps == 30.0 and motion.n_frames == 300 and motion.skeleton == dancer.skeleton
    assert abs(heading(motion.positions, motion.fps, motion.skeleton)[0]) < 0.1
    assert motion.positions[..., 1].min() >= -1e-6
    assert bone_error(motion) < 0.02


def test_what_a_dance_is_made_of_adds_up(dancer: Choreographer):
    made = dancer.choreograph(SILENCE, beats(), start=2.0, seconds=20.0)
    danced = sum(piece.last_beat - piece.first_beat for piece in made.pieces)
    assert danced == pytest.approx(20.0 * 88 / 60 - 2, abs=1.5)  # at the end two beats are danced in the time of four
    assert sum(made.shares.values()) == pytest.approx(1.0)
    assert {piece.recording for piece in made.pieces} == set(made.shares)
    assert made.start == 2.0 and made.pieces[0].start <= 0 < made.pieces[1].start
    assert made.worst_seam_cm == max(piece.seam_cm for piece in made.pieces)
    assert 0 < made.mean_seam_cm <= made.worst_seam_cm
    assert 1 <= made.longest_stretch <= danced and 0 <= made.seen_before <= 1


def test_a_dance_goes_on_from_where_a_motion_in_three_dimensions_ends(dancer: Choreographer):
    past = dancer.takes[0].motion.span(2.0, 3.0)
    past = replace(past, positions=past.positions + np.array([4.0, 0.0, -7.0]))
    motion = dancer.generate(SILENCE, beats(), seconds=5.0, initial=past)
    steps = np.linalg.norm(np.diff(past.positions, axis=0), axis=2).max()
    assert np.linalg.norm(motion.positions[0] - past.positions[-1], axis=1).max() < 2 * steps
    flat = replace(past, positions=past.positions[..., :2])
    refused("initial must be a motion in three dimensions, got 2", dancer.generate, SILENCE, beats(), initial=flat)


def test_feet_slide_less_when_they_are_planted(dancer: Choreographer):
    dances = [dancer.generate(SILENCE, beats(), seconds=8.0, plant_feet=plant) for plant in (True, False)]
    assert foot_skating(dances[0]) < foot_skating(dances[1])


def test_bones_are_fixed_as_torch_fixes_them_and_one_of_no_length_stays_as_it_is(rng: np.random.Generator):
    torch = pytest.importorskip("torch")
    from harmolab.systems.training.layers import fix_bones

    parents, lengths = (1, -1, 1, 2, -1), np.array([0.4, 9.0, 0.3, 0.2, 9.0])
    positions = rng.normal(size=(6, 5, 3))
    made = fixed_bones(positions, parents, lengths)
    theirs = fix_bones(torch.tensor(positions[None]), parents, torch.tensor(lengths))[0]
    np.testing.assert_allclose(made, theirs, atol=1e-6)
    skeleton = Skeleton(tuple("abcde"), parents)
    np.testing.assert_allclose(bone_lengths(Motion(made, 30.0, skeleton)), np.tile(lengths[[0, 2, 3]], (6, 1)))
    np.testing.assert_array_equal(fixed_bones(np.zeros((2, 2, 3)), (-1, 0), np.array([0.0, 0.5])), 0.0)


def test_what_no_choreographer_can_be_made_of_is_refused(dancer: Choreographer, rng: np.random.Generator):
    refused("needs a recording at least", Choreographer.of, [])
    refused("two-dimensional", Choreographer.of, [Motion(np.zeros((30, 3, 2)), 30.0, Skeleton.unnamed(3))])
    other = [*dancer.takes, wandering_take("a", rng)]
    refused(r"waltz 1 and a have different skeletons \(21 and 6 joints\)", Choreographer, other)


# Corpora of all kinds


def test_a_motion_without_beats_rests_on_the_beats_of_the_song():
    phase = np.arange(0.0, 60.0, 1 / 30.0 / 0.61)  # rests every .61 s
    made = Choreographer.of([waving(phase)]).choreograph(SILENCE, beats(100.0, meter=0), seconds=20.0)
    signal = shape_signal(shape_speed(made.motion))
    on_beat = np.interp(beats(100.0).times[2:30], signal.times, signal.values)
    assert (on_beat < -1).mean() > 0.8  # standard deviations of speed; a seam may hide a rest
    assert any("bar is not danced" in line for line in made.warnings)


def test_the_pulse_of_a_motion_is_where_it_rests():
    rests = mv.pulse(shape_signal(shape_speed(waving(np.arange(0.0, 40.0, 1 / 30.0 / 0.55)))), 0.6)
    assert np.abs(np.diff(rests) - 0.55).max() < 0.06
    assert np.abs(rests[2:-2] / 0.55 - np.round(rests[2:-2] / 0.55)).max() < 0.1


def test_seconds_in_which_nobody_was_seen_are_not_danced():
    motions = [waltz_motion(seed) for seed in (1, 2)]
    is_seen = np.abs(np.arange(motions[0].n_frames) / 30.0 - 10.0) > 5.0
    seen, every = (Choreographer.of(one) for one in ([replace(each, valid=is_seen) for each in motions], motions))
    dances = [dancer.choreograph(SILENCE, beats(meter=0), seconds=15.0) for dancer in (seen, every)]
    inside = [
        max(min(piece.source_end, 15.0) - max(piece.source_start, 5.0) for piece in dance.pieces) for dance in dances
    ]
    assert inside[0] < 0.5 < 2.0 < inside[1]  # a beat may be in it by less than a half
    assert dances[0].distinct_minutes < 0.6 * dances[1].distinct_minutes


def test_recordings_with_and_without_beats_do_not_mix(dancer: Choreographer):
    short, long = waltz_motion(1, 8.0), waltz_motion(1, 70.0)
    one_beat = Clip("one beat", SILENCE, short, beats=track([0.5]))
    waltzes, long_ones = {"waltz 1", "waltz 2", "waltz 3"}, {"motion 4", "motion 4, mirrored"}
    for others, names in (([short, one_beat], waltzes), ([long], long_ones)):
        takes = Choreographer.of([*dancer.takes, *others]).choreograph(SILENCE, beats(), seconds=9.0)
        assert set(takes.shares) <= names
        assert "left out: those with and without beats do not mix" in takes.warnings[0]


def test_only_the_dance_that_is_asked_for_is_danced(dancer: Choreographer):
    both = Choreographer.of([*dancer.takes, planted("cha-cha", 1)])
    assert any("mixed" in line for line in both.choreograph(SILENCE, beats(), seconds=9.0).warnings)
    made = both.choreograph(SILENCE, beats(), seconds=9.0, dance="waltz")
    assert set(made.shares) <= {"waltz 1", "waltz 2", "waltz 3"}
    assert not any("mixed" in line for line in made.warnings)


def test_a_dance_that_was_not_recorded_is_said_and_one_that_nobody_knows_is_refused(dancer: Choreographer):
    assert "there is no tango" in dancer.choreograph(SILENCE, beats(), seconds=9.0, dance="tango").warnings[0]
    refused("unknown dance 'polka'", dancer.generate, SILENCE, beats(), seconds=9.0, dance="polka")


@cases(
    "tempo, meter, dance",
    (88.0, 3, "waltz"),
    (88.0, 4, "rumba"),
    (114.0, 4, "tango"),  # log 114 / 100 is .13, log 128 / 114 is .12
    (112.0, 4, "rumba"),
    (120.0, 4, "tango"),
    (120.0, 3, "waltz"),
    (64.0, 4, "tango"),  # heard at half its tempo
    (200.0, 4, "rumba"),
    (128.0, 5, "tango"),
)
def test_of_several_dances_that_of_the_meter_and_then_of_the_tempo_is_nearest(tempo: float, meter: int, dance: str):
    motion = waving(np.arange(0.0, 8.0, 1 / 15))
    recorded = (("waltz", 88.0, 3), ("rumba", 100.0, 4), ("tango", 128.0, 4))
    takes = [Take(name, motion, name, np.arange(4) * 60 / bpm, np.arange(4), bar) for name, bpm, bar in recorded]
    assert nearest_dance(takes, tempo, meter) == dance
    bare = [replace(take, beats=np.zeros(0), meter=0) for take in takes]  # by the usual tempo: 62-112, 116-140
    assert nearest_dance(bare, 113.0, 4) == "rumba" and nearest_dance(bare, 115.0, 4) == "tango"
    slow = [replace(takes[1], beats=np.arange(4) * 60 / 118), takes[2]]  # no usual tempo of a rumba
    assert nearest_dance(slow, 118.0, 4) == "tango" and nearest_dance(slow, 112.0, 4) == "rumba"
    again = [takes[2], replace(takes[2], beats=np.arange(4) * 60 / 120), replace(takes[2], dance="cha-cha")]
    again[2] = replace(again[2], beats=np.arange(4) * 60 / 125)  # the nearest take of a dance counts
    assert nearest_dance(again, 128.0, 4) == "tango" and nearest_dance(again, 124.0, 4) == "cha-cha"
    assert nearest_dance([replace(bare[0], dance="polka")], tempo, meter) == ""


def opened(jump: float, standing: float = 0.0) -> Motion:
    """Eight seconds of waving after a pose a jump away, and after standing."""
    waved = waving(np.arange(0.0, 16.0, 1 / 15)).positions
    first = waved[:1].repeat(1 + round(30 * standing), 0)
    first[0, 2, 0] += jump
    return Motion(np.concatenate([first, waved]), 30.0, Skeleton.unnamed(6))


def test_a_pose_that_a_file_opens_with_and_standing_are_cut_where_files_are_read(tmp_path: Path):
    for jump, kept in ((0.45, 0), (0.55, 1)):
        save_motion(tmp_path / "take.npz", opened(jump))
        (take,) = Choreographer.load(tmp_path / "take.npz").takes
        assert opened(jump).n_frames - take.motion.n_frames == kept
    save_motion(tmp_path / "take.npz", opened(0.55, 3.0))
    (take,) = Choreographer.load(tmp_path / "take.npz").takes
    assert take.motion.duration == pytest.approx(8.0, abs=0.6)


def test_when_standing_is_cut_off_a_recording_its_beats_stay_with_its_poses(tmp_path: Path):
    corpus = write_corpus(tmp_path / "corpus", clips=1, seconds=12.0, fps=30.0)
    (before,) = Choreographer.load(corpus).takes
    (file,) = corpus.rglob("motion.npz")
    motion, about = load_motion(file), json.loads((file.parent / "beats.json").read_text())
    standing = np.concatenate([motion.positions[:1].repeat(90, 0), motion.positions])
    save_motion(file, replace(motion, positions=standing, valid=None), offset=-3.0)
    (file.parent / "beats.json").write_text(json.dumps(about | {"motion_offset_s": -3.0}))
    (after,) = Choreographer.load(corpus).takes
    assert abs(after.motion.n_frames - before.motion.n_frames) <= 15
    poses = [take.motion.positions[np.round(take.beats[-9:] * 30).astype(int)] for take in (before, after)]
    heights = [pose[..., 1] - pose[:, :1, 1] for pose in poses]
    np.testing.assert_allclose(heights[0], heights[1], atol=0.02)


def test_folders_of_recordings_and_of_bare_motions_are_read(tmp_path: Path):
    write_corpus(tmp_path / "corpus", clips=2, seconds=12.0, fps=30.0)
    (tmp_path / "bare" / "inner").mkdir(parents=True)
    for seed, name in ((1, "a.npz"), (2, "inner/b.npz"), (3, "c.bvh")):
        save_motion(tmp_path / "bare" / name, waltz_motion(seed, 10.0))
    (tmp_path / "bare" / "broken.npz").write_bytes(b"nothing")
    corpus = Choreographer.load(tmp_path / "corpus")
    assert [take.dance for take in corpus.takes] == ["cha-cha", "jive"] and corpus.takes[0].meter == 4
    with pytest.raises(ValueError, match="different skeletons"):  # BVH has end sites
        Choreographer.load(tmp_path / "bare")
    (tmp_path / "bare" / "c.bvh").rename(tmp_path / "bare" / "a.bvh")
    bare = Choreographer.load(tmp_path / "bare")
    assert [take.name for take in bare.takes] == ["a", "inner/b"]
    assert bare.notes[0] == f"{tmp_path}/bare/a.bvh: has the name of a.npz, which alone is danced"
    assert len(bare.notes) == 2 and "broken.npz" in bare.notes[1]
    (tmp_path / "bare" / "a.bvh").unlink()
    (both,) = Choreographer.load(tmp_path).notes
    assert both == f"{tmp_path}/bare/a.npz (and 2 more): lies beside whole recordings, which alone are danced"
    assert Choreographer.load(tmp_path / "bare" / "a.npz").takes[0].name == "a"
    assert bare.generate(SILENCE, beats(), seconds=6.0).n_frames == 180
    motion = bare.takes[0].motion
    save_motion(tmp_path / "bare" / "giant.npz", replace(motion, positions=10 * motion.positions))
    assert Choreographer.load(tmp_path / "bare").notes[1].startswith("giant: the body extends over 1")


def test_a_folder_without_movement_is_named(tmp_path: Path):
    refused(f"{tmp_path}: holds no motion", Choreographer.load, tmp_path)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        Choreographer.load(tmp_path / "nowhere")


# Warnings


def warned(dancer: Choreographer, music: BeatTrack, **options: Any) -> str:
    return " ".join(dancer.choreograph(SILENCE, music, seconds=20.0, **options).warnings)


def test_who_has_enough_is_not_told_how_much_is_enough(dancer: Choreographer):
    music = beats_between(beats(), 0.0, 20.0, meter=3, period=0.5)
    moves = dancer._moves_of(dancer.takes, music.period)
    about = {"worst": 20.0, "is_own_pulse": False, "has_beats": True}
    told = [" ".join(warnings_of(moves, music, minutes=minutes, **about)) for minutes in (1.5, 2.5)]
    assert all(f"{TOO_LITTLE} (a seam of 20 cm shows)" in line for line in told)
    assert ["2 distinct minutes of a dance are enough" in line for line in told] == [True, False]


def test_too_little_another_tempo_what_is_not_known_of_the_bar_and_music_without_beats_are_said(dancer: Choreographer):
    assert TOO_LITTLE in warned(Choreographer(dancer.takes[:1]), beats())
    own = 60 / np.median(np.concatenate([np.diff(take.beats) for take in dancer.takes]))
    assert "slower than the recorded" in warned(dancer, beats(0.7 * own))
    assert "faster than the recorded" in warned(dancer, beats(1.4 * own))
    assert "than the recorded" not in warned(dancer, beats(1.1 * own))
    assert '"one" of this music is not known' in warned(dancer, beats(meter=0))
    assert "the music has 4 beats in a bar, these recordings 3" in warned(dancer, beats(meter=4))
    assert "bar" not in warned(dancer, beats())
    assert "no beats are heard" in warned(dancer, track([], duration=60.0))


# What is saved


@pytest.fixture
def saved(dancer: Choreographer, tmp_path: Path) -> Path:
    dancer.save(tmp_path / "run")
    return tmp_path / "run"


def test_what_is_saved_is_the_same_to_the_millimetre(dancer: Choreographer, saved: Path):
    again = Choreographer.load(saved)
    for one, other in zip(dancer.takes, again.takes, strict=True):
        np.testing.assert_array_equal(one.motion.positions, other.motion.positions)
        np.testing.assert_array_equal(one.beats, other.beats)
        np.testing.assert_array_equal(one.places, other.places)
        about = [(take.name, take.dance, take.meter, take.motion.fps) for take in (one, other)]
        assert about[0] == about[1]
    off = waltz_motion(1).positions - dancer.takes[0].motion.positions
    assert np.abs(off - off[0, 0]).max() <= 0.001 + 1e-9
    assert again.limits is not None and (saved / "model.npz").stat().st_size < 200_000


def test_training_is_reading_and_saving(tmp_path: Path):
    corpus = write_corpus(tmp_path / "corpus", clips=2, seconds=12.0, fps=30.0)
    made = Choreographer.train([corpus], tmp_path / "run", seed=3)
    assert [take.name for take in Choreographer.load(tmp_path / "run").takes] == [take.name for take in made.takes]
    Choreographer.train([corpus], tmp_path / "run")
    about = json.loads((tmp_path / "run" / "model.json").read_text())
    (tmp_path / "run" / "model.json").write_text(json.dumps(about | {"system": "harmogan"}))
    for out in (corpus, corpus / "corpus.json", tmp_path / "run"):
        refused("holds something else", Choreographer.train, [corpus], out)
    refused("no setting 'epochs'", Choreographer.train, [corpus], tmp_path / "other", epochs=3)


def rewrite(folder: Path, change: Callable[[dict[str, Any]], None], **arrays: Any):
    """Change description and arrays of a saved choreographer as somebody would who can count, but means ill."""
    about = json.loads((folder / "model.json").read_text())
    with np.load(folder / "model.npz") as content:
        kept = dict(content) | arrays
    np.savez_compressed(folder / "model.npz", **kept)
    about["sha256"] = hashlib.sha256((folder / "model.npz").read_bytes()).hexdigest()
    change(about)
    (folder / "model.json").write_text(json.dumps(about))


def entry(about: dict[str, Any]) -> dict[str, Any]:
    return about["build"]["takes"][0]


@cases(
    "change, message",
    (lambda about: entry(about).update(frames=1000), "calls for"),
    (lambda about: entry(about).update(frames=10**9), "more than 50000000 numbers"),
    (lambda about: about["build"]["skeleton"].update(parents=[1, 0] + [0] * 19), "form a ring"),
    (lambda about: entry(about).update(frames=1), "frames = 1"),
    (lambda about: entry(about).update(frames=True), "frames = True"),
    (lambda about: entry(about).update(beats=-1), "beats = -1"),
    (lambda about: entry(about).update(fps=float("1e9")), "fps must lie between"),
    (lambda about: entry(about).update(meter=2), "places in the bar do not fit"),
    (lambda about: entry(about).update(meter="three"), "meter = three"),
    (lambda about: about["build"].update(takes=[]), "1 to 10000 recordings"),
    (lambda about: about["build"].update(takes={}), "1 to 10000 recordings"),
    (lambda about: about["build"].update(skeleton={"joints": ["a"], "parents": [-1]}), "calls for"),
    (lambda about: about["build"]["skeleton"].update(parents=[0] * 21), "parents must be"),
    (lambda about: about.update(sha256="0"), "SHA-256 differs"),
    (lambda about: about.update(limits={"pooled": {"spread": "wide"}}), "no limits of likeness"),
    (lambda about: about["build"].pop("skeleton"), "skeleton"),
)
def test_a_description_that_lies_is_refused(saved: Path, change: Callable[[dict[str, Any]], None], message: str):
    rewrite(saved, change)
    refused(rf"model\.npz.*{message}", Choreographer.load, saved)


@cases(
    "name, changed, message",
    ("beats", lambda old: np.full_like(old, np.nan), "beats must be two or more"),
    ("beats", lambda old: old[::-1], "beats must be two or more"),
    ("beats", lambda old: old + 1e6, "beats must be two or more"),
    ("places", lambda old: old + 100, "places in the bar must lie"),
    ("positions", lambda old: old.astype(np.int32), "16-bit"),
    ("positions", lambda old: np.full_like(old, 32767), "damaged"),
    ("positions", lambda old: old.astype(float), "positions"),
    ("valid", lambda old: old[:-1], "valid has shape"),
    ("positions", lambda old: np.zeros((3 * 10**7, 1, 3), np.int16), "would unpack to"),
    ("beats", lambda old: np.array([{"a": 1}] * 3, dtype=object), "never Python objects"),
)
def test_arrays_that_no_recording_has_are_refused(saved: Path, name: str, changed: Callable[[Any], Any], message: str):
    with np.load(saved / "model.npz") as content:
        old = content[name]
    rewrite(saved, lambda about: None, **{name: changed(old)})
    refused(rf"model\.npz.*{message}", Choreographer.load, saved)


# No torch


@pytest.mark.slow
def test_a_dance_imports_no_torch(saved: Path):
    code = (
        "import sys, numpy as np\n"
        "from harmolab.systems import find, load\n"
        "from harmolab.types import Audio, BeatTrack\n"
        "times = np.arange(0.3, 9.0, 0.7)\n"
        "music = BeatTrack(times, np.ones(times.size), 100.0, 10.0)\n"
        f"made = load({str(saved)!r}).generate(Audio(np.zeros(80000), 8000.0), music, seconds=5.0)\n"
        "assert type(find('choreographer')) and made.n_frames == 150\n"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "harmolab" in loaded
    assert {"torch", "safetensors", "matplotlib", "pandas", "librosa"}.isdisjoint(loaded)


# Recordings


@pytest.mark.data
@pytest.mark.slow
def test_songs_danced_from_all_other_recordings_are_dances(data_root: Path):
    folder = data_root / "beatlocked"
    if not folder.is_dir():
        pytest.skip(f"no beat-locked recordings in {data_root}")
    table = danced_from_others(list(readable_recordings(folder)))
    means = table.mean(numeric_only=True)
    assert (table["likeness"] == 1).all(), table.loc[table["likeness"] != 1, "recording"]
    assert means["seam"] <= 8 and means["jerk ratio"] <= 1.1 and means["foot_skating"] <= 0.35
    assert means["H"] >= 0.35


NEAR = 0.05  # seconds: a beat this near to the start of a piece is a seam


def measured(made: Choreography, beats: BeatTrack, dancer: Choreographer, dance: str = "") -> dict[str, float]:
    """The numbers of a dance to beats on the audio time line; likeness is by the limits of the dancer."""
    one = Dance("", "", made.motion, beats.span(made.start, made.motion.duration), dance=dance, limits=dancer.limits)
    numbers = dance_numbers(one, ["likeness", "foot_skating", "rests", "rests_late"])
    seams = {"seam": made.mean_seam_cm, "worst seam": made.worst_seam_cm, "jerk ratio": seam_jerk(made, beats)}
    return numbers | seams


def danced_from_others(recordings: Sequence[Recording]) -> pd.DataFrame:
    """`measured` of every third song danced from the other recordings of its dance, with H by their bar pattern.

    The song's own recording is left out of the corpus that it is danced from, of the bar pattern that it is scored by
    and of the limits that its dance is held against.
    """
    takes = [take_of(one) for one in recordings]
    windows = [window_measures(take.motion) for take in takes]
    sums = [[cut.sums for cut in cut_clips(one, "annotated", None) if cut.sums is not None] for one in recordings]
    rows = []
    for number, (recording, take) in [*enumerate(zip(recordings, takes, strict=True))][::3]:
        clip, others = recording.clip, [place for place in range(len(takes)) if place != number]
        same = [place for place in others if takes[place].dance == take.dance]
        limits = LikenessLimits.of_windows([windows[n] for n in others], [takes[n].dance for n in others])
        pattern = replace(fit_pattern(part for place in same for part in sums[place]), dance=take.dance)
        dancer = Choreographer([takes[place] for place in same], limits=limits)
        start = max(clip.offset, 0.0)
        made = dancer.choreograph(clip.audio, clip.beats, start=start, seconds=LONGEST, dance=clip.dance)
        music, params = clip.beats.span(start, LONGEST), HarmonyParams.recommended(pattern)
        harmony = score_motion(music, made.motion, params=params).harmony_above_chance
        rows.append({"recording": clip.name, "H": harmony} | measured(made, clip.beats, dancer, clip.dance))
    return pd.DataFrame(rows)


def seam_jerk(dance: Choreography, beats: BeatTrack) -> float:
    """Jerk in the beat around the seams of a dance over jerk around its other beats; NaN without seams, or beats.

    `beats` are those of the music, on the audio time line. Those within a beat of the dance's beginning or of the slow
    beat at its end do not count.
    """
    positions, _, stride = sampled(dance.motion, STEP, steps=3)
    size = len(positions) - 3 * stride
    first, second, third, fourth = (positions[place * stride :][:size] for place in range(4))
    values = vector_lengths(fourth - 3 * third + 3 * second - first).mean(axis=1)
    times = (np.arange(size) + 1.5 * stride) * STEP / stride
    moments = beats.times - dance.start
    period = float(np.median(np.diff(moments)))
    moments = moments[(moments > period) & (moments < dance.motion.duration - max(2 * period, EASE) - period)]
    seams = np.array([piece.start for piece in dance.pieces[1:]])
    around = np.array([values[np.abs(times - moment) <= period / 2].mean() for moment in moments])
    is_seam = (np.abs(np.subtract.outer(moments, seams)) < NEAR).any(axis=1)
    if not is_seam.any() or is_seam.all():
        return float("nan")
    return float(around[is_seam].mean() / around[~is_seam].mean())


ROOT = Path(__file__).resolve().parents[1]


def dance(seed: int, *, seconds: float = 14.0) -> Motion:
    """Somebody who dances from the first second to the last."""
    return synthetic_motion(np.arange(0.3, seconds, 0.5), seconds=seconds, fps=30.0, seed=seed)


def with_standing(motion: Motion, before: float, after: float) -> Motion:
    """The motion with so many seconds of standing at its ends."""
    first, last = motion.positions[:1], motion.positions[-1:]
    parts = [first.repeat(round(before * motion.fps), 0), motion.positions, last.repeat(round(after * motion.fps), 0)]
    return replace(motion, positions=np.concatenate(parts), valid=None)


def test_standing_at_the_ends_is_no_dance():
    assert dancing_span(with_standing(dance(1), 3.0, 2.0)) == pytest.approx((3.0, 17.0), abs=0.6)


def test_a_change_of_stance_before_the_dance_does_not_begin_it():
    standing = with_standing(dance(1), 6.0, 0.0)
    positions = standing.positions.copy()
    step = 0.2 * np.sin(np.linspace(0, np.pi, 15)) ** 2  # half a second, there and back
    positions[30:45, :, 0] += step[:, None]
    assert dancing_span(replace(standing, positions=positions))[0] == pytest.approx(6.0, abs=0.7)


def test_holes_split_a_take_and_short_parts_are_left_out():
    motion = dance(2)
    parts = danced_parts("take", motion, [(5.0, 6.0)])
    assert [part.name for part in parts] == ["take, part 1", "take, part 2"]
    assert sum(part.motion.duration for part in parts) == pytest.approx(13.0, abs=1.2)
    assert [part.name for part in danced_parts("take", motion, [(1.5, 6.0)])] == ["take"]


DREAMS = [f"dreamt {dance} {number}" for dance in ("cha-cha", "rumba", "tango", "waltz") for number in (1, 2, 3)]


@cases(
    "style, names, fps, minutes, kilobytes",
    *(("salsa", TAKES["salsa"], 30.0, 5.3, 480), ("indian", TAKES["indian"], 30.0, 1.9, 180)),
    ("ballroom", DREAMS, 25.0, 6.0, 395),
)
def test_shipped_takes_are_small_and_have_limits(style: str, names: Any, fps: float, minutes: float, kilobytes: int):
    bank = shipped_bank(style)
    assert sum(take.seconds for take in bank.takes) / 60 == pytest.approx(minutes, abs=0.1)
    assert {take.name.partition(",")[0] for take in bank.takes} == set(names)
    assert sum(file.stat().st_size for file in (FOLDER / style).iterdir()) < 1024 * kilobytes
    assert bank.fps == fps and bank.dances == (style,)
    assert bank.limits is not None
    assert False not in [likeness(take.motion, limits=bank.limits).passed for take in bank.takes]


def test_no_recording_but_those_of_the_notice_is_shipped():
    shipped = {path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*") if path.suffix not in (".py", ".pyc")}
    files = {f"{style}/model.{suffix}" for style in (*TAKES, DREAMT) for suffix in ("json", "npz")}
    assert {name for name in shipped if "__pycache__" not in name} == {"NOTICE", *TAKES, DREAMT, *files}
    assert shipped_bank(DREAMT).notes == (NO_RECORDING,) and "no recorded frame" in REMARKS[DREAMT]
    for style in TAKES:
        about = json.loads((FOLDER / style / "model.json").read_text("utf-8"))
        assert all(take["name"].startswith("cmu") for take in about["build"]["takes"])


def test_notice_says_what_cmu_asks_for_and_goes_with_the_package():
    words = " ".join((FOLDER / "NOTICE").read_text("utf-8").split())
    assert "The data used in this project was obtained from mocap.cs.cmu.edu." in words
    assert "The database was created with funding from NSF EIA-0196217." in words
    parts = ("not be sold by itself", "Copyright (c) 2018 Yi_Zhou", "Not checked", "What was changed")
    for part in (*parts, "The folder ballroom holds no recorded movement"):
        assert part in words
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert (FOLDER / "NOTICE").relative_to(ROOT).as_posix() in project["license-files"]
    assert "LicenseRef-CMU-Mocap" in project["license"]
    assert "banks/NOTICE" in (ROOT / "LICENSE").read_text("utf-8")


@pytest.mark.slow
def test_the_dreamt_bank_is_what_the_shipped_network_dances_on_feet_that_stand():
    shipped = {take.name: take.motion for take in shipped_bank(DREAMT).takes}
    for name, motion in dreamt_takes(FOLDER.parents[1] / "music2dance" / "weights").items():
        if shipped[name].n_frames == motion.n_frames:  # nothing was cut off
            moved = np.diff(motion.positions[:50], axis=0), np.diff(shipped[name].positions[:50], axis=0)
            np.testing.assert_allclose(*moved, atol=0.005)
        assert foot_skating(shipped[name]) < 0.25
        soles = [joint for foot in foot_joints(motion.skeleton) for joint in foot]
        assert (shipped[name].positions[:, soles, 1].min(axis=1) > 0.06).mean() < 0.05


@pytest.mark.slow
def test_a_dreamt_bank_dances_on_the_beat_as_its_takes_do():
    song = planted_clip(ClipSettings("waltz", seconds=21.0, tempo=90.0, seed=7))
    beats, bank = song.annotation.track(21.0), shipped_bank(DREAMT)
    numbers = measured(bank.choreograph(song.clip.audio, beats, seconds=20.0, seed=0), beats, bank)
    assert numbers["likeness"] == 1 and numbers["seam"] < 14.0
    assert numbers["foot_skating"] < 0.15 and numbers["rests"] > max(0.15, numbers["rests_late"])


def test_a_missed_downbeat_takes_the_bars_neither_from_a_song_nor_from_a_recording(dancer: Choreographer):
    threes = beats()
    missed = replace(threes, bar_places=np.r_[np.arange(12) % 3, np.arange(6), threes.bar_places[18:]])
    dance = dancer.choreograph(SILENCE, missed, seconds=8.0, seed=0)
    assert not [line for line in dance.warnings if "the bar is not danced" in line]
    take = take_of(Clip("waltz", SILENCE, waltz_motion(1, 20.0), beats=missed))
    assert (take.meter, set(take.places)) == (3, {0, 1, 2})


def test_puppets_know_their_bars_and_dance_any_dance():
    clips = puppets("waltz", clips=2, seconds=6.0)
    assert [clip.dance for clip in clips] == ["waltz", "waltz"]
    assert set(clips[0].beats.bar_places) == {0, 1, 2}
    assert Choreographer.of(clips).takes[0].meter == 3


@pytest.mark.data
@pytest.mark.slow
def test_salsa_may_be_shown(data_root: Path):
    names = ("W_3", "W_20", "C_4", "C_8", "R_4", "T_8")  # 86 to 128 beats a minute
    songs = [load_recording(data_root / "beatlocked" / f"DANCE_{name}").clip for name in names]
    bank, rows = shipped_bank("salsa"), []
    for clip, seed in itertools.product(songs, (0, 1)):
        beats = music_beats(clip)
        rows.append(measured(bank.choreograph(clip.audio, beats, seconds=LONGEST, seed=seed), beats, bank))
    table = pd.DataFrame(rows)
    mean = table.mean()
    assert mean["likeness"] == 1
    assert mean["seam"] <= 10.0 and table["worst seam"].max() <= 18.0
    assert mean["jerk ratio"] <= 1.0 and mean["foot_skating"] <= 0.15
    assert mean["rests"] >= 0.25 and mean["rests_late"] < 0.05


@pytest.mark.data
def test_the_shipped_salsa_is_what_its_takes_give(data_root: Path, tmp_path: Path):
    made = write_bank(shipped_takes(data_root / "free_dance", "salsa"), tmp_path, style="salsa")
    assert (tmp_path / "model.npz").stat().st_size == (FOLDER / "salsa" / "model.npz").stat().st_size
    shipped = shipped_bank("salsa")
    for take, other in zip(made.takes, shipped.takes, strict=True):
        np.testing.assert_allclose(take.motion.positions, other.motion.positions, atol=1e-9)
        assert take.name == other.name
    assert isinstance(shipped.limits, LikenessLimits) and made.dances == shipped.dances == ("salsa",)


default_dances = notebook_cells("11_frame_by_frame").default_dances


def test_a_waltz_is_danced_by_a_person_who_passes_the_guard():
    ((title, dance),) = default_dances(["waltz"]).items()
    assert dance.motion.duration == pytest.approx(30.0, abs=0.1)
    assert 0 < dance.mean_seam_cm < dance.worst_seam_cm < 25
    assert title.startswith("waltz (synthetic song): moves like recorded dancers (13 of 13 measures); seams ")
