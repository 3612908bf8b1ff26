"""What a study shows: dances exchanged under one music, equally long and loud, and nothing heard or seen twice."""

from dataclasses import replace

import numpy as np
import pytest

import harmolab
from harmolab.lab.listening.corpus_study import (
    FPS,
    LOUDNESS,
    ONSET,
    QUIET,
    Pieces,
    clip_scores,
    lagged_pieces,
    paired_pieces,
    swapped_pieces,
)
from harmolab.lab.listening.trials import KeyEntry, make_key
from harmolab.types import Audio, Clip
from tests.builders import cases, refused

SECONDS = 5.0


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    """Four rumbas and four tangos of 9 s, each at a loudness of its own."""
    made = []
    for number in range(8):
        clip = harmolab.synthetic_clip(("rumba", "tango")[number % 2], seconds=9.0, seed=number)
        audio = Audio(clip.audio.samples * 0.1 * (number + 1), clip.audio.sample_rate)
        made.append(replace(clip, name=f"clip {number}", audio=audio))
    return made


@pytest.fixture(scope="module")
def lagged(clips: list[Clip]) -> Pieces:
    return lagged_pieces(clips, seconds=SECONDS, seed=3)


@pytest.fixture(scope="module")
def swapped(clips: list[Clip]) -> Pieces:
    return swapped_pieces(clips, seconds=SECONDS, seed=3)


def power(samples: np.ndarray) -> float:
    return float(np.sqrt(np.mean(samples**2)))


def start_of(clip: Clip, positions: np.ndarray) -> int:
    """The frame of a clip at which these positions begin."""
    whole = clip.motion.positions
    apart = [np.abs(whole[k : k + 30] - positions[:30]).max() for k in range(len(whole) - 30)]
    assert min(apart) < 1e-9
    return int(np.argmin(apart))


def test_lagged_dance_is_the_same_half_a_beat_late(clips: list[Clip], lagged: Pieces):
    assert [piece.name for piece in lagged.pieces] == [clip.name for clip in clips]
    for clip, piece in zip(clips, lagged.pieces, strict=True):
        late = start_of(clip, piece.motions["true"].positions) - start_of(clip, piece.motions["lagged"].positions)
        assert late / FPS == pytest.approx(0.5 * np.median(np.diff(clip.beats.times)), abs=0.5 / FPS)


def test_music_and_true_dance_are_those_of_one_moment(clips: list[Clip], lagged: Pieces):
    for clip, piece in zip(clips, lagged.pieces, strict=True):
        start = start_of(clip, piece.motions["true"].positions) / FPS
        rate = round(clip.audio.sample_rate)
        heard = clip.audio.samples[round(start * rate) :][: piece.audio.samples.size]
        middle = slice(rate // 10, -rate // 10)  # not the fades
        assert np.corrcoef(heard[middle], piece.audio.samples[middle])[0, 1] > 1 - 1e-9
        inside = clip.beats.times[(clip.beats.times >= start) & (clip.beats.times < start + SECONDS)]
        np.testing.assert_allclose(piece.beats.times, inside - start, atol=1e-9)


def test_offset_between_music_and_dance_is_kept(clips: list[Clip]):
    moved = replace(clips[0], offset=0.7, motion=clips[0].motion.span(0.7, 9.0))
    piece = lagged_pieces([moved], seconds=SECONDS, seed=3).pieces[0]
    start = start_of(clips[0], piece.motions["true"].positions) / FPS
    np.testing.assert_allclose(
        piece.beats.times, [time - start for time in clips[0].beats.times if start <= time < start + SECONDS], atol=1e-9
    )


@pytest.mark.parametrize("made", ["lagged", "swapped"])
def test_all_sounds_and_dances_are_equally_long_loud_faded_and_begin_with_sound(
    made: str, request: pytest.FixtureRequest
):
    pieces = request.getfixturevalue(made).pieces
    samples = [piece.audio.samples for piece in pieces]
    assert {motion.n_frames for piece in pieces for motion in piece.motions.values()} == {round(SECONDS * FPS)}
    assert {motion.fps for piece in pieces for motion in piece.motions.values()} == {FPS}
    assert np.ptp([sound.size for sound in samples]) <= 1
    assert {round(power(sound), 9) for sound in samples} == {round(power(samples[0]), 9)}
    assert 0.2 * LOUDNESS < power(samples[0]) <= LOUDNESS + 1e-9
    assert max(np.abs(sound).max() for sound in samples) <= 0.99 + 1e-9
    assert max(abs(sound[at]) for sound in samples for at in (0, -1)) < 1e-9
    for piece in pieces:
        beginning = piece.audio.samples[: round(ONSET * piece.audio.sample_rate)]
        assert power(beginning) > QUIET * power(piece.audio.samples)


def test_swapped_dance_is_of_another_clip_of_its_kind_and_nothing_comes_twice(clips: list[Clip], swapped: Pieces):
    kinds = {clip.name: clip.dance for clip in clips}
    found = []
    for piece in swapped.pieces:
        lender = next(
            clip.name
            for clip in clips
            if min(np.abs(clip.motion.positions - piece.motions["swapped"].positions[0]).max((1, 2))) < 1e-9
        )
        assert kinds[lender] == kinds[piece.name] == piece.dance
        found += [piece.name, lender]
    assert sorted(found) == sorted(kinds)


def test_clip_without_a_partner_and_clips_that_are_too_short_are_left_out_and_named(clips: list[Clip]):
    made = swapped_pieces([*clips[:4:2], clips[1]], seconds=SECONDS, seed=1)
    assert len(made.pieces) == 1
    assert made.left_out == ("clip 1: no other clip is left to swap its dance (tango) with",)
    assert lagged_pieces(clips[:1], seconds=8.9, seed=1).left_out == (
        "clip 0: has no 8.9 s of dance and music together",
    )
    assert lagged_pieces([replace(clips[0], motion=None)], seconds=4.0, seed=1).left_out == (
        "clip 0: has no motion to show",
    )


def test_music_that_is_silent_at_first_begins_where_it_sounds(clips: list[Clip]):
    samples = np.array(clips[0].audio.samples)
    samples[: round(2.5 * clips[0].audio.sample_rate)] = 0.0
    quiet = replace(clips[0], audio=Audio(samples, clips[0].audio.sample_rate))
    for seed in range(5):
        piece = lagged_pieces([quiet], seconds=SECONDS, seed=seed).pieces[0]
        assert start_of(clips[0], piece.motions["true"].positions) / FPS > 2.5 - ONSET
    silent = replace(quiet, audio=Audio(np.zeros(samples.size), quiet.audio.sample_rate))
    assert "that begin with sound" in lagged_pieces([silent], seconds=SECONDS, seed=0).left_out[0]


def test_same_seed_gives_the_same_pieces_whatever_other_clips_there_are(clips: list[Clip], lagged: Pieces):
    alone = lagged_pieces(clips[2:3], seconds=SECONDS, seed=3).pieces[0]
    np.testing.assert_array_equal(alone.motions["true"].positions, lagged.pieces[2].motions["true"].positions)
    others = lagged_pieces(clips, seconds=SECONDS, seed=4).pieces
    assert any(
        not np.array_equal(one.motions["true"].positions, other.motions["true"].positions)
        for one, other in zip(lagged.pieces, others, strict=True)
    )


def test_two_dances_to_one_music_are_cut_at_the_same_moment_and_shown_at_one_rate(clips: list[Clip]):
    slow = clips[2].motion
    other = replace(slow, positions=slow.positions[::2], fps=30.0, valid=slow.valid[::2])
    made = paired_pieces([(clips[0], other)], ("ours", "theirs"), seconds=SECONDS, seed=2)
    motions = made.pieces[0].motions
    assert list(motions) == ["ours", "theirs"]
    assert {motion.n_frames for motion in motions.values()} == {round(SECONDS * FPS)}
    start = start_of(clips[0], motions["ours"].positions)
    np.testing.assert_allclose(
        motions["theirs"].positions, slow.positions[start : start + round(SECONDS * FPS)], atol=0.02
    )
    key = make_key([*made.items, replace(made.items[0], name="x", versions={"ours": "1", "theirs": "2"})],
                   kind="choice", n=2, seed=0, truth="")  # fmt: skip
    assert {asked.right for asked in key.trials.values()} == {None}


def test_scores_tell_the_true_dance_from_the_late_one(lagged: Pieces):
    for piece in lagged.pieces:
        true, late = clip_scores(piece.clip("true")), clip_scores(piece.clip("lagged"))
        assert set(true) >= {"paper_h", "paper_above_chance", "valleys_above_chance", "recommended_above_chance"}
        assert true["valleys_above_chance"] > late["valleys_above_chance"] + 0.3


@cases(
    "change, message",
    ({"seconds": 1.0}, "seconds must be between 2 and 60"),
    ({"seconds": float("nan")}, "seconds must be between 2 and 60"),
    ({"seed": -1}, "seed must not be negative"),
)
def test_settings_out_of_range_are_refused(clips: list[Clip], change: dict[str, float], message: str):
    for make in (lagged_pieces, swapped_pieces):
        refused(message, make, clips, **{"seconds": SECONDS, "seed": 1, **change})
    refused("two names", paired_pieces, [], ("a", "a"), seconds=SECONDS, seed=1)


def test_trial_shows_the_dances_that_its_key_names_to_the_music_of_its_item(lagged: Pieces):
    piece = lagged.pieces[2]
    audio, motions = lagged.presented(KeyEntry(piece.name, ("lagged", "true"), ("a", "b"), "right"))
    assert audio is piece.audio
    assert motions == [piece.motions["lagged"], piece.motions["true"]]


def test_scores_of_a_study_are_those_of_each_dance_shown(lagged: Pieces):
    piece = lagged.pieces[0]
    scores = lagged.scores([KeyEntry(piece.name, ("true", "lagged"), ("a", "b"), "left")])
    expected = clip_scores(piece.clip("lagged"))
    assert {name: values["b"] for name, values in scores.items()} == pytest.approx(expected, nan_ok=True)
    assert scores["valleys_above_chance"]["a"] > scores["valleys_above_chance"]["b"]
    assert np.isnan([*scores["recommended_above_chance"].values()]).all()  # six seconds hold fewer than 16 beats
