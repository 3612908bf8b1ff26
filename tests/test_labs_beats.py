"""The detector lab and the meter lab say what is true: planted beats, beats counted by hand."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.data.synthetic import ClipSettings, PlantedClip, planted_clip, synthetic_clip
from harmolab.lab.labs.detector import detector_lab
from harmolab.lab.labs.meter import Song, meter_lab, meter_numbers
from harmolab.types import BeatTrack, Clip, Motion
from tests.builders import along_x, cases, refused

FINE = {"detector": "valleys", "fps": None, "smoothing": 0.05, "subframe": True}


@pytest.fixture(scope="module")
def planted() -> PlantedClip:
    """Six seconds of a cha-cha whose rests are known."""
    return planted_clip(ClipSettings("cha-cha", seconds=6.0, seed=0))


@pytest.fixture(scope="module")
def human_clip() -> Clip:
    """An inexact dancer, and beats of very different strength, so that every control has something to act on."""
    clip = synthetic_clip("cha-cha", seconds=8.0, fps=30.0, jitter=0.06, omission=0.2, redundancy=0.3, seed=2)
    assert clip.beats is not None
    count = len(clip.beats)
    strengths = np.where(np.arange(count) % 3 == 0, 1.0, 0.2) + np.arange(count) % 2
    return replace(clip, beats=replace(clip.beats, strengths=strengths, bar_places=np.arange(count) % 4))


def holding_dancer() -> Motion:
    """A hand that speeds up, keeps its speed for four frames and slows down, over and over."""
    speed = np.tile([1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 3.0, 2.0, 1.0, 0.5], 16)
    return along_x(np.cumsum(speed) / 32, fps=30.0)  # exact in binary, so that a plateau is a tie


def metronome(count: int, strengths: object = None, *, places: bool = False) -> BeatTrack:
    """Beats every half second from 0.25 s on."""
    times = 0.25 + 0.5 * np.arange(count)
    strong = np.ones(count) if strengths is None else np.asarray(strengths, float)
    return BeatTrack(times, strong, 43.0, 0.5 * count, np.arange(count) % 4 if places else None)


# The detector lab


def test_valleys_of_a_smoothed_curve_find_every_planted_rest(planted: PlantedClip):
    lab = detector_lab(planted.clip, planted=planted.visual_beat_times)
    coarse = lab.numbers
    lab.set(**FINE)
    fine, total = lab.numbers, planted.visual_beat_times.size
    assert (fine["found"], fine["planted"]) == (total, total)
    assert coarse["beats"] > 1.5 * fine["beats"]
    assert fine["distance"] <= 0.02
    counts = f"{fine['beats']} visual beats for {fine['music']} music beats."
    assert lab.sentence == f"Now {total} of {total} planted rests are found within 50 ms; {counts}"


def test_planted_rests_are_counted_from_the_start_of_the_motion(planted: PlantedClip):
    later = replace(planted.clip, motion=planted.clip.motion.span(2.0, 3.0), offset=2.0)
    numbers = detector_lab(later, planted=planted.visual_beat_times, **FINE).numbers
    inside = ((planted.visual_beat_times >= 2.0) & (planted.visual_beat_times < 5.0)).sum()
    assert numbers["planted"] == inside
    assert numbers["found"] >= inside - 1  # the first or last may lie at the cut


def test_lab_without_a_truth_makes_no_claim_about_planted_rests(planted_clip: Clip):
    lab = detector_lab(planted_clip)
    assert "planted" not in lab.sentence
    assert lab.numbers["mask"] is None
    assert lab.data["evidence"]["planted"] is None


@pytest.mark.parametrize(
    "value",
    [{"detector": "valleys"}, {"fps": 25.0}, {"smoothing": 0.1}, {"position_smoothing": 0.1}, {"subframe": True}],
    ids=lambda value: next(iter(value)),
)
def test_each_control_of_the_detector_lab_moves_the_beats(human_clip: Clip, value: dict[str, object]):
    lab = detector_lab(human_clip)
    before = lab.numbers["times"].tolist()
    lab.set(**value)
    assert lab.numbers["times"].tolist() != before


def test_plateau_moves_the_beats_of_a_dancer_who_keeps_the_speed(human_clip: Clip):
    lab = detector_lab(replace(human_clip, motion=holding_dancer()), fps=None)
    before = lab.numbers["times"]
    lab.set(plateau="middle")
    assert lab.numbers["times"].mean() < before.mean()


@cases(
    "values, line",
    ({"smoothing": 0.05}, "HarmonyParams(smoothing=0.05)"),
    ({"fps": None}, "HarmonyParams(fps=None)"),
    ({"fps": 30}, "HarmonyParams(fps=30.0)"),  # a browser writes 30.0 as 30
    ({"subframe": True, "position_smoothing": 0.1}, "HarmonyParams(position_smoothing=0.1, subframe=True)"),
)
def test_line_of_the_detector_lab_follows_its_controls(planted_clip: Clip, values: dict[str, object], line: str):
    lab = detector_lab(planted_clip)
    lab.set(**values)
    assert lab.line == line


def test_a_rate_that_is_not_offered_is_refused(planted_clip: Clip):
    refused(r"fps must be one of None, 60\.0, 30\.0, .*; got 29\.97", detector_lab, planted_clip, fps=29.97)


# The meter lab


def test_alternating_strengths_are_grouped_by_two_and_two():
    numbers = meter_numbers(Song({"of the clip": metronome(10, [1, 2] * 5)}))
    # Beats 2-5 and 6-9 are strong, weak, strong, weak; the tenth ends the second unit: 4 of 5 seconds.
    assert [label for _, _, label in numbers["units"]] == ["4/4 (2+2)"] * 2
    assert numbers["sentence"] == "Now 5 of 10 beats are strong, and meter units cover 80 % of the time."


def test_every_second_beat_of_an_alternation_has_no_accent():
    numbers = meter_numbers(Song({"of the clip": metronome(10, [1, 2] * 5)}), every=2.0, lambda1=0.0)
    assert (numbers["beats"], numbers["strong"], len(numbers["units"])) == (5, 0, 0)


def test_units_start_later_when_the_first_beats_are_left_out():
    song = Song({"of the clip": metronome(12, [1, 2] * 6)})
    starts = [meter_numbers(song, first=count)["units"][0][0] for count in (0.0, 2.0)]
    assert starts[1] - starts[0] == pytest.approx(1.0)


def test_downbeats_are_counted_only_where_somebody_annotated_them(planted_clip: Clip):
    assert "downbeats" not in meter_lab(planted_clip).sentence
    track = metronome(9, [2, 1, 1, 1] * 2 + [2], places=True)
    numbers = meter_numbers(Song({"of the clip": track}, track))
    # The first beat has none before it and is weak (Eq. 22).
    assert numbers["sentence"].endswith(" Of the downbeats among them 2 of 3 are strong.")
    assert numbers["accents"].tolist() == pytest.approx([2 / 3, 0, 0, 0])
    assert numbers["chance"] == pytest.approx(2 / 9)


def test_weak_beats_below_the_threshold_are_not_compared():
    assert meter_numbers(Song({"of the clip": metronome(12, [1.0, 0.2, 2.0] * 4)}), lambda1=1.0)["beats"] == 8


@pytest.mark.parametrize(
    "value",
    [{"beats": "annotated"}, {"lambda1": 1.0}, {"every": 2.0}, {"first": 3.0}, {"error": 0.5}],
    ids=lambda value: next(iter(value)),
)
def test_each_control_of_the_meter_lab_changes_its_sentence(human_clip: Clip, value: dict[str, object]):
    assert human_clip.beats is not None
    annotated = replace(human_clip.beats, strengths=1.0 + (np.arange(len(human_clip.beats)) % 4 == 0))
    lab = meter_lab(human_clip, annotated=annotated)
    before = lab.sentence
    lab.set(**value)
    assert lab.sentence != before


def test_line_of_the_meter_lab_holds_the_threshold_alone(planted_clip: Clip):
    lab = meter_lab(planted_clip, first=2.0)
    assert lab.line == "HarmonyParams.paper()"
    lab.set(lambda1=1.0)
    assert lab.line == "HarmonyParams(audio_threshold=1.0)"
