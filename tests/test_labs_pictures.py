"""The pictures of the detector lab and the meter lab say what is true: planted beats, beats counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from harmolab.corpora.synthetic import ClipSettings, planted_clip
from harmolab.lab.widgets.labs.detector import detector_lab
from harmolab.lab.widgets.labs.meter import Song, draw_meter_lab, meter_lab
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
