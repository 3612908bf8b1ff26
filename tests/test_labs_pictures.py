"""The pictures of the labs say what is true: planted beats, beats counted by hand, music that was moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from harmolab.beats.visual import visual_beats
from harmolab.corpora.synthetic import ClipSettings, planted_clip, synthetic_clip
from harmolab.harmony import score_harmony
from harmolab.lab.compare.batch import BeatBatch
from harmolab.lab.widgets.labs.corpus import Corpus, corpus_lab, corpus_scores, draw_corpus_lab
from harmolab.lab.widgets.labs.detector import detector_lab
from harmolab.lab.widgets.labs.meter import Song, draw_meter_lab, meter_lab
from harmolab.lab.widgets.labs.scoring import draw_saliency_lab, saliency_lab
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, Clip


def board(figure: Figure) -> dict[str, str]:
    """The numbers at the top of a lab's picture, by name."""
    ax = figure.axes[-1]
    names = [label.get_text() for label in ax.get_xticklabels()]
    return dict(zip(names, [text.get_text() for text in ax.texts], strict=True))


def metronome(count: int, strengths: object = None, *, places: bool = False) -> BeatTrack:
    """Beats every half second from 0.25 s on."""
    times = 0.25 + 0.5 * np.arange(count)
    strong = np.ones(count) if strengths is None else np.asarray(strengths, float)
    return BeatTrack(times, strong, 43.0, 0.5 * count, np.arange(count) % 4 if places else None)


# The detector lab


def test_valleys_of_a_smoothed_curve_find_every_planted_movement_end():
    planted = planted_clip(ClipSettings("cha-cha", seconds=6.0, seed=0))
    lab = detector_lab(planted.clip, planted=planted.visual_beat_times)
    coarse = board(lab._figure)
    for control, value in {"detector": "valleys", "fps": None, "smoothing": 0.05, "subframe": True}.items():
        lab.controls[control].value = value
    fine = board(lab._figure)
    total = planted.visual_beat_times.size
    assert fine["planted, found within 50 ms"] == f"{total}/{total}"
    assert int(coarse["visual beats"]) > 1.5 * int(fine["visual beats"])
    assert float(fine["median distance"].removesuffix(" ms")) <= 20


def test_planted_beats_are_counted_from_the_start_of_the_motion():
    planted = planted_clip(ClipSettings("cha-cha", seconds=6.0, seed=0))
    clip = planted.clip
    later = replace(clip, motion=clip.motion.span(2.0, 3.0), offset=2.0)
    lab = detector_lab(
        later, planted=planted.visual_beat_times, detector="valleys", fps=None, smoothing=0.05, subframe=True
    )
    inside = ((planted.visual_beat_times >= 2.0) & (planted.visual_beat_times < 5.0)).sum()
    found, total = map(int, board(lab._figure)["planted, found within 50 ms"].split("/"))
    assert total == inside
    assert found >= inside - 1  # the first or last may lie at the cut


def test_lab_without_a_truth_makes_no_claim_about_planted_beats(planted_clip: Clip):
    assert not any("planted" in name for name in board(detector_lab(planted_clip)._figure))


# The saliency lab


def test_saliency_lab_keeps_what_was_counted_by_hand(planted_clip: Clip):
    music = BeatTrack([0.5, 1.0, 1.5, 2.0, 2.5], [2.0, 4.0, 0.1, 3.0, 1.0], fps=100, duration=3.0)
    dance = BeatTrack([0.2, 0.55, 0.8, 1.15, 1.6, 2.45], [4.0, 1.0, 5.0, 2.0, 2.2, 6.0], fps=100, duration=3.0)
    stage = Stage(music, planted_clip.motion.span(0.0, 3.0), BarPattern.stop_on_the_beat())
    values = {"lambda1": 0.1, "lambda2": 1.0}
    found = board(draw_saliency_lab(stage, dance, **values))
    assert (found["music beats kept"], found["visual beats kept"]) == ("4/5", "5/6")
    assert board(draw_saliency_lab(stage, dance, lambda1=0.1, lambda2=0.0))["visual beats kept"] == "6/6"
    # SD(s_a) is .36 of the largest; the formula as printed keeps what exceeds it, whatever λ1: .5, 1 and .75.
    assert board(draw_saliency_lab(stage, dance, **values, saliency="literal"))["music beats kept"] == "3/5"


def test_higher_thresholds_keep_fewer_beats(planted_clip: Clip):
    assert planted_clip.beats is not None
    strengths = np.where(np.arange(len(planted_clip.beats)) % 3 == 0, 1.0, 0.2)
    lab = saliency_lab(replace(planted_clip, beats=replace(planted_clip.beats, strengths=strengths)))
    kept = []
    for value in (0.1, 2.0, 4.0):  # SD is .38: the weak beats go first, then the strong ones
        lab.controls["lambda1"].value = value
        kept.append(int(board(lab._figure)["music beats kept"].split("/")[0]))
    assert kept == [strengths.size, (strengths == 1.0).sum(), 0]


# The meter lab


def test_alternating_strengths_are_grouped_by_two_and_two():
    song = Song({"of the clip": metronome(10, [1, 2] * 5)})
    found = board(draw_meter_lab(song))
    # Beats 2-5 and 6-9 are strong, weak, strong, weak; the tenth ends the second unit: 4 of 5 seconds.
    assert found == {"beats": "10", "strong": "5", "meter units": "2", "time covered": "80%"}


def test_every_second_beat_of_an_alternation_has_no_accent():
    song = Song({"of the clip": metronome(10, [1, 2] * 5)})
    found = board(draw_meter_lab(song, every=2, lambda1=0.0))
    assert (found["beats"], found["strong"], found["meter units"]) == ("5", "0", "0")


def test_units_start_later_when_the_first_beats_are_left_out():
    song = Song({"of the clip": metronome(12, [1, 2] * 6)})
    first = [draw_meter_lab(song, first=count).axes[0].lines for count in (0, 2)]
    starts = [min(line.get_xdata()[0] for line in lines if line.get_gid() == "bracket") for lines in first]
    assert starts[1] - starts[0] == pytest.approx(1.0)


def test_downbeats_are_counted_only_where_somebody_annotated_them(planted_clip: Clip):
    assert "downbeats that are strong" not in board(meter_lab(planted_clip)._figure)
    track = metronome(9, [2, 1, 1, 1] * 2 + [2], places=True)
    found = board(draw_meter_lab(Song({"of the clip": track}, track)))
    # The first beat has none before it and is weak (Eq. 22).
    assert found["downbeats that are strong"] == "2/3"


def test_weak_beats_below_the_threshold_are_not_compared():
    track = metronome(12, [1.0, 0.2, 2.0] * 4)
    assert board(draw_meter_lab(Song({"of the clip": track}), lambda1=1.0))["beats"] == "8"


# The corpus lab


def exact_corpus() -> Corpus:
    """Three dancers with a visual beat on every music beat."""
    pairs = [(metronome(count), metronome(count)) for count in (12, 16, 20)]
    return Corpus(("a", "b", "c"), {"paper": BeatBatch.of(pairs), "valleys": BeatBatch.of(pairs)}, np.full(3, 0.5))


def test_music_half_a_beat_late_loses_against_exact_dancers_in_a_narrow_field_only():
    narrow = board(draw_corpus_lab(exact_corpus(), mode="valleys", score="hit rate", delay=0.1))
    assert narrow == {
        "AUC": "1.00", "true music wins": "3/3", "ties": "0", "mean, true": "1.00", "mean, wrong": "0.00",
    }  # fmt: skip
    wide = board(draw_corpus_lab(exact_corpus(), mode="valleys", score="hit rate", delay=0.25))
    assert (wide["AUC"], wide["ties"], wide["mean, wrong"]) == ("0.50", "3", "1.00")


@pytest.mark.parametrize("late", [0.0, 1.0])
def test_music_a_whole_beat_late_is_as_good_as_the_true_one(late: float):
    found = board(draw_corpus_lab(exact_corpus(), mode="valleys", late=late))
    assert (found["AUC"], found["ties"]) == ("0.50", "3")


def test_moved_music_scores_as_score_harmony_says():
    clip = synthetic_clip("cha-cha", seconds=6.0, fps=30.0, jitter=0.1, seed=4)
    corpus = Corpus.of([clip])
    stage = Stage.of(clip)
    moved = np.sort(np.mod(stage.music.times + 0.4 * corpus.periods[0], stage.music.duration))
    params = replace(HarmonyParams.valleys(), audio_threshold=0.0)
    flat = replace(stage.music, times=moved, strengths=np.ones(moved.size))
    by_hand = score_harmony(flat, visual_beats(stage.motion, params=params), params=params, n_rotations=0)
    assert corpus_scores(corpus, "valleys", params, 0.4).hit_rate[0] == pytest.approx(by_hand.hit_rate)


def test_mode_sets_the_sliders_and_the_chosen_clip_stays():
    lab = corpus_lab(exact_corpus(), clip=2)
    lab.controls["mode"].value = "valleys"
    assert (lab.values["delay"], lab.values["lambda2"], lab.values["clip"]) == (0.1, 0.0, 2)
    assert lab.params == HarmonyParams.valleys()


def test_lab_that_starts_in_a_mode_has_its_settings():
    assert corpus_lab(exact_corpus(), mode="valleys").params == HarmonyParams.valleys()
    assert corpus_lab(exact_corpus(), mode="valleys", lag=0.1).line.endswith("subframe=True, lag=0.1)")


def test_chosen_clip_is_named_over_the_dots():
    lab = corpus_lab(exact_corpus(), mode="valleys")
    lab.controls["clip"].value = 1
    right = lab._figure.axes[1]
    assert [text.get_text() for text in right.texts] == ["b: 1.00 true, 0.00 wrong"]


def test_corpus_whose_parts_do_not_fit_is_refused():
    pairs = [(metronome(12), metronome(12))]
    with pytest.raises(ValueError, match="as many clips as names and periods; got paper with 1, 2 clips"):
        Corpus(("a", "b"), {"paper": BeatBatch.of(pairs)}, np.array([0.5]))
    with pytest.raises(ValueError, match="a batch for some of paper, recommended, valleys"):
        Corpus(("a",), {"literal": BeatBatch.of(pairs)}, np.array([0.5]))
    with pytest.raises(ValueError, match="the recommended mode cannot score a BeatBatch"):
        Corpus(("a",), {"recommended": BeatBatch.of(pairs)}, np.array([0.5]))


def test_clip_without_motion_is_refused(planted_clip: Clip):
    with pytest.raises(ValueError, match="there is no motion to score"):
        corpus_lab([Clip("song", planted_clip.audio)])


def test_empty_corpus_is_refused():
    with pytest.raises(ValueError, match="at least one clip"):
        corpus_lab([])
