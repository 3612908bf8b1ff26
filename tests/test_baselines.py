"""Dances that need no training: recorded movement, and pieces of it laid on the beats of a song."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.params import HarmonyParams
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.contests import (
    BASELINES,
    DRAWN,
    Excerpt,
    Material,
    another_song,
    danced_at,
    music_anchors,
    nearest_neighbour,
    random_pieces,
    recorded,
    rest_anchors,
    resting_pieces,
    retimed_dance,
)
from tests.builders import planted_dance, refused

FEATURES = FeatureParams.paper()
VALLEYS = HarmonyParams.valleys()


def excerpt(dance: str, seed: int, start: float = 6.0) -> Excerpt:
    return Excerpt(f"{dance} {seed}", planted_dance(dance, seconds=18.0, seed=seed), start)


def unit_of(dance: str, seed: int, *, late: float = 0.0) -> DanceUnit:
    """Eight beats of a synthetic clip, and their dancer; its music's beats are told `late` periods late."""
    clip = planted_dance(dance, seconds=18.0, seed=seed)
    motion = clip.motion
    assert motion is not None and clip.beats is not None
    slow = Motion(motion.positions[::4], motion.fps / 4, motion.skeleton)
    beats = clip.beats.times[clip.beats.times > 2.0]
    first, end = (int(np.floor(time * slow.fps)) for time in (beats[0], beats[8]))
    start = first / slow.fps
    code = encode_motion(slow.positions, slow.fps, slow.skeleton)[first:end]
    times = start + np.arange(len(code)) / slow.fps
    told = beats[:8] - start + late * np.diff(beats[:9])
    index = (np.arange(len(code)) < len(code) // 2).astype(np.float32)
    sound = audio_features(clip.audio, clip.beats, times, FEATURES)
    name = f"{dance} {seed} {late}"
    return DanceUnit(name, name, dance, frozenset(), frozenset(), start, sound, code, index, told, np.ones(8), slow.fps)


def material(*units: DanceUnit, dancers: tuple[Excerpt, ...] = ()) -> Material:
    motion = planted_dance("rumba", seconds=18.0, seed=1).motion
    assert motion is not None
    return Material(UnitSet(units, motion.skeleton, bone_lengths(motion.positions, motion.skeleton), FEATURES), dancers)


def above_chance(motion: Motion, song: Excerpt) -> float:
    return score_motion(
        song.beats.span(song.start, song.seconds), motion, params=VALLEYS, n_rotations=0
    ).harmony_above_chance


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_the_right_song_is_the_dancer_planted_there(rng: np.random.Generator):
    song = excerpt("rumba", 1)
    motion = recorded(material(unit_of("rumba", 2)), song, rng)
    assert song.clip.motion is not None
    np.testing.assert_array_equal(motion.positions, song.clip.motion.span(6.0, 6.0).positions)
    assert above_chance(motion, song) > 0.8


def test_another_song_is_of_the_same_dance_and_never_the_song_itself(rng: np.random.Generator):
    songs = (excerpt("rumba", 1), excerpt("rumba", 2), excerpt("waltz", 1))
    motion = another_song(material(unit_of("rumba", 2), dancers=songs), songs[0], rng)
    np.testing.assert_array_equal(motion.positions, songs[1].dancer.positions)
    away = another_song(material(unit_of("rumba", 2), dancers=songs), songs[2], rng)
    assert any(np.array_equal(away.positions, song.dancer.positions) for song in songs[:2])
    refused("there is no other song", another_song, material(unit_of("rumba", 2), dancers=songs[:1]), songs[0], rng)


def test_retiming_brings_another_songs_dancer_to_the_beats(rng: np.random.Generator):
    song, other = excerpt("rumba", 1), excerpt("rumba", 2)
    stuff = material(unit_of("rumba", 2), dancers=(other,))
    before, after = (above_chance(dance(stuff, song, rng), song) for dance in (another_song, retimed_dance))
    assert after > before + 0.3


def test_pieces_of_planted_dancers_are_in_time_whatever_their_own_tempo(rng: np.random.Generator):
    song = excerpt("jive", 1)
    for dance in (random_pieces, resting_pieces, nearest_neighbour):
        motion = dance(material(unit_of("rumba", 1), unit_of("rumba", 2)), song, rng)
        assert motion.duration == pytest.approx(song.seconds, abs=1 / FEATURES.fps)
        assert above_chance(motion, song) > 0.5


def test_only_rests_on_beats_are_in_time_where_the_pieces_are_danced_beside_their_music(rng: np.random.Generator):
    song = excerpt("rumba", 3)
    stuff = material(unit_of("rumba", 1, late=0.5), unit_of("rumba", 2, late=0.5))
    assert above_chance(random_pieces(stuff, song, rng), song) < 0.2
    assert above_chance(resting_pieces(stuff, song, rng), song) > 0.5


def test_rests_are_counted_in_beats_and_of_two_close_ones_the_first_is_taken(monkeypatch: pytest.MonkeyPatch):
    unit = unit_of("rumba", 1)
    period = unit.n_frames / unit.fps / 8
    rests = period * np.array([0.5, 1.4, 1.7, 3.5, 4.4])
    monkeypatch.setattr(
        "study.experiments.contests.visual_beats", lambda motion, params: BeatTrack(rests, np.ones(5), 15.0, 60.0)
    )
    anchors = rest_anchors(unit, material(unit).units)
    np.testing.assert_array_equal(anchors.beats, [0, 1, 3, 4])
    np.testing.assert_allclose(anchors.seconds, rests[[0, 1, 3, 4]])


def test_a_unit_that_hardly_rests_keeps_the_beats_of_its_music():
    unit = unit_of("rumba", 1)
    still = replace(unit, motion=np.repeat(unit.motion[:1], unit.n_frames, axis=0))
    stuff = material(still)
    np.testing.assert_array_equal(rest_anchors(still, stuff.units).seconds, music_anchors(still, stuff.units).seconds)


def test_a_piece_at_its_own_tempo_is_itself_and_at_double_tempo_travels_as_far():
    unit = unit_of("waltz", 1)
    anchors = music_anchors(unit, material(unit).units)
    frames = np.arange(unit.n_frames)
    own = np.interp(frames / unit.fps, anchors.seconds, anchors.beats)
    inside = (own > 0.2) & (own < 7.8)
    same = danced_at(unit, anchors, own[inside], frames[inside] / unit.fps)
    # The beats of a unit are not quite even, and the map between them is smooth.
    np.testing.assert_allclose(same[:, :-3], unit.motion[inside, :-3], atol=0.02)
    fast = danced_at(unit, anchors, own[inside], frames[inside] / unit.fps / 2)
    np.testing.assert_allclose(fast[:, -3:], 2 * same[:, -3:])


def test_the_same_draw_is_the_same_dance_and_another_is_not():
    song, stuff = excerpt("rumba", 3), material(*(unit_of("rumba", seed) for seed in (1, 2, 4, 5)))
    stuff = replace(stuff, dancers=[excerpt("rumba", seed) for seed in (1, 2, 4, 5)])
    for name in DRAWN:
        one, same, *others = (BASELINES[name](stuff, song, np.random.default_rng(seed)) for seed in (1, 1, 2, 3, 4, 5))
        np.testing.assert_array_equal(one.positions, same.positions)
        assert not all(np.array_equal(one.positions, other.positions) for other in others)


def test_the_nearest_neighbour_of_a_units_own_music_is_that_unit(monkeypatch: pytest.MonkeyPatch):
    units = [unit_of(dance, 1) for dance in ("rumba", "waltz", "jive")]
    taken: list[str] = []

    def anchors(unit: DanceUnit, units: UnitSet):
        taken.append(unit.dance)
        return music_anchors(unit, units)

    monkeypatch.setattr("study.experiments.contests.music_anchors", anchors)
    nearest_neighbour(material(*units), excerpt("waltz", 1, start=3.0), np.random.default_rng(0))
    assert taken[0] == "waltz"  # the seconds that the unit was danced to; later ones are other music


def test_pieces_join_between_beats_and_rest_nowhere_else():
    song, unit = excerpt("rumba", 3), unit_of("rumba", 1)
    motion = resting_pieces(material(unit), song, np.random.default_rng(0))
    beats = song.beats.span(song.start, song.seconds).times
    phases = (np.interp(visual_beats(motion, params=VALLEYS).times, beats, np.arange(beats.size)) + 0.5) % 1 - 0.5
    assert np.median(np.abs(phases)) < 0.2
