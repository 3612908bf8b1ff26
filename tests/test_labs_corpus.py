"""The corpus lab: scores of many clips in each mode, music that was moved, and the player of the chosen clip."""

from dataclasses import replace
from html import unescape
from typing import Any

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.labs.corpus import Corpus, corpus_lab, corpus_numbers, corpus_scores
from harmolab.lab.labs.live import Stage
from harmolab.params import HarmonyParams
from harmolab.score import score_harmony
from harmolab.types import BeatTrack, Clip
from harmolab.verdict.judge import score_motion
from tests.builders import refused


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    kinds = ("cha-cha", "jive", "rumba", "waltz", "tango")
    return [synthetic_clip(kind, seconds=5.0, fps=30.0, jitter=0.08, seed=seed) for seed, kind in enumerate(kinds)]


def metronome(count: int) -> BeatTrack:
    """Beats every half second from 0.25 s on."""
    return BeatTrack(0.25 + 0.5 * np.arange(count), np.ones(count), 43.0, 0.5 * count)


def exact_corpus() -> Corpus:
    """Three dancers with a visual beat on every music beat."""
    tracks = tuple(metronome(count) for count in (12, 16, 20))
    return Corpus(("a", "b", "c"), tracks, {"paper": tracks, "valleys": tracks})


def exact_numbers(**values: Any) -> tuple[float, int, int, float]:
    """AUC, wins, ties and mean score with wrong music, of the exact dancers."""
    numbers = corpus_numbers(exact_corpus(), mode="valleys", score="hit_rate", **values)
    return numbers["auc"], numbers["wins"], numbers["ties"], numbers["mean_wrong"]


def test_music_half_a_beat_late_loses_against_exact_dancers_in_a_narrow_field_only():
    assert exact_numbers(delay=0.1) == (1.0, 3, 0, 0.0)
    assert exact_numbers(delay=0.25) == (0.5, 0, 3, 1.0)


def test_the_sentence_counts_wins_and_ties():
    numbers = corpus_numbers(exact_corpus(), mode="valleys", delay=0.1)
    assert numbers["sentence"].startswith("The true music wins in 3 of 3 dances, with 0 ties. AUC 100 %")


@pytest.mark.parametrize("late", [0.0, 1.0])
def test_music_a_whole_beat_late_is_as_good_as_the_true_one(late: float):
    assert exact_numbers(late=late)[:3] == (0.5, 0, 3)


def test_moved_music_scores_as_score_harmony_says():
    clip = synthetic_clip("cha-cha", seconds=6.0, fps=30.0, jitter=0.1, seed=4)
    corpus = Corpus.of([clip])
    stage = Stage.of(clip)
    moved = np.sort(np.mod(stage.music.times + 0.4 * corpus.periods[0], stage.music.duration))
    params = replace(HarmonyParams.valleys(), audio_threshold=0.0)
    flat = replace(stage.music, times=moved, strengths=np.ones(moved.size))
    by_hand = score_harmony(flat, visual_beats(stage.motion, params=params), params=params, n_rotations=0)
    assert corpus_scores(corpus, "valleys", params, "hit_rate", 0.4)[0] == pytest.approx(by_hand.hit_rate)


def test_recommended_mode_scores_every_clip_as_score_motion():
    kinds = ("cha-cha", "jive", "waltz")
    clips = [synthetic_clip(kind, seconds=14.0, fps=30.0, jitter=0.08, seed=seed) for seed, kind in enumerate(kinds)]
    numbers = corpus_lab(clips, mode="recommended", score="harmony_above_chance", late=0.25).numbers
    for clip, true, wrong in zip(clips, numbers["true"], numbers["wrong"], strict=True):
        stage = Stage.of(clip)
        score = score_motion(stage.music, stage.motion)
        late = score.judgement.place.curve[12]  # the quarter of a beat is 12 of 48 moments
        assert true == pytest.approx(score.place_harmony)
        assert wrong == pytest.approx((late - score.chance) / (1 - score.chance))


def test_mode_sets_the_sliders_and_the_chosen_clip_stays():
    lab = corpus_lab(exact_corpus(), clip=2)
    lab.set(mode="valleys")
    assert (lab.values["delay"], lab.values["lambda2"], lab.values["clip"]) == (0.1, 0.0, 2)
    assert lab.params == HarmonyParams.valleys()


def test_corpus_without_a_mode_has_no_button_for_it():
    lab = corpus_lab(exact_corpus())
    assert "recommended" not in [preset.label for preset in lab.content.presets]
    refused("mode must be one of paper, valleys", lab.set, mode="recommended")


def test_the_button_opens_the_chosen_clip_and_no_slider_does(clips: list[Clip]):
    lab = corpus_lab(clips, mode="valleys", clip=2)
    lab.set(lag=0.02)
    assert lab.player == ""
    lab._handle_custom_msg({"play": True}, [])
    assert f'title="{clips[2].name}: player"' in unescape(lab.player)
    shown = lab.player
    lab.set(clip=3)
    assert lab.player == shown


def test_a_corpus_of_beats_alone_has_no_player():
    lab = corpus_lab(exact_corpus())
    lab.play()
    assert (lab.player, lab.data["plays"]) == ("", False)


def test_sound_of_the_player_starts_with_the_motion(clips: list[Clip]):
    clip = clips[0]
    late = replace(clip, motion=clip.motion.span(1.0, 2.0), offset=1.0)
    early = replace(clip, audio=clip.audio.span(0.5, 4.0), offset=-0.5, beats=clip.beats.span(0.5, 4.0))
    for other, start in ((late, 1.0), (early, 0.0)):
        sound = other.shared().audio
        np.testing.assert_array_equal(sound.samples, other.audio.span(start, sound.duration).samples)


def test_clip_that_cannot_be_played_says_why_under_the_picture(clips: list[Clip]):
    silent = replace(clips[0].audio, sample_rate=clips[0].audio.sample_rate * 100)
    lab = corpus_lab([replace(clips[0], audio=replace(silent, samples=np.zeros(round(silent.sample_rate * 5))))])
    lab.play()
    assert "the player takes sound of 3000 to 192000 Hz" in lab.player


def test_corpus_whose_parts_do_not_fit_is_refused():
    track = metronome(12)
    with pytest.raises(ValueError, match="as many names, tracks and places as clips; got 1, 2 in the modes paper"):
        Corpus(("a", "b"), (track, track), {"paper": (track,)})
    refused(r"at least one clip and one mode, .* in the modes none", Corpus, ("a",), (track,), {})
    for mode in ("literal", "recommended"):
        refused(f"no mode {mode} counts hits", Corpus, ("a",), (track,), {mode: (track,)})


def test_empty_corpus_is_refused():
    refused("at least one clip", corpus_lab, [])
