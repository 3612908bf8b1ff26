"""The corpus lab: its recommended mode, and what a click on a dot does."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.harmony import score_motion
from harmolab.lab.widgets.labs.corpus import PLACES, CorpusLab, corpus_lab
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.types import Clip

SIZE = np.array([900.0, 486.0])  # of the picture, pixels
WIDTHS = (900.0, 640.0, 1800.0)  # at which a page may show it


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    kinds = ("cha-cha", "jive", "rumba", "waltz", "tango")
    return [synthetic_clip(kind, seconds=5.0, fps=30.0, jitter=0.08, seed=seed) for seed, kind in enumerate(kinds)]


@pytest.fixture
def lab(clips: list[Clip]) -> CorpusLab:
    return corpus_lab(clips, mode="valleys")


def dots(lab: CorpusLab) -> list[tuple[float, float]]:
    """(wrong, true) of every clip, as the line of text over the dots tells them, two digits each."""
    found = []
    for clip in range(len(lab.controls["clip"].options)):
        lab.controls["clip"].value = clip
        text = lab._figure.axes[1].texts[0].get_text()
        true, wrong = re.search(r"(-?[\d.]+) true, (-?[\d.]+) wrong", text).groups()
        found.append((float(wrong), float(true)))
    lab.controls["clip"].value = 0
    return found


def spot(wrong: float, true: float, low: float = 0.0) -> tuple[float, float]:
    """Where such a dot stands, in shares of the picture: worked out from the panel's place and its limits."""
    left, bottom, width, height = PLACES[1]
    first, last = low - 0.03, 1.05
    x, y = ((value - first) / (last - first) for value in (wrong, true))
    return left + width * x, 1 - (bottom + height * y)


def test_recommended_mode_scores_every_clip_as_score_motion():
    kinds = ("cha-cha", "jive", "waltz")
    clips = [synthetic_clip(kind, seconds=14.0, fps=30.0, jitter=0.08, seed=seed) for seed, kind in enumerate(kinds)]
    lab = corpus_lab(clips, mode="recommended", score="above chance", late=0.25)
    for clip, (wrong, true) in zip(clips, dots(lab), strict=True):
        stage = Stage.of(clip)
        score = score_motion(stage.music, stage.motion)
        late = score.judgement.place.curve[12]  # the quarter of a beat is 12 of 48 moments
        assert true == pytest.approx(score.harmony_above_chance, abs=0.0051)
        assert wrong == pytest.approx((late - score.chance) / (1 - score.chance), abs=0.0051)


def test_click_on_a_dot_rings_its_clip_at_any_size_of_the_picture(lab: CorpusLab):
    for number, dot in enumerate(dots(lab)):
        # Two digits of the score are two pixels of the picture at most.
        assert [lab.clip_at(*spot(*dot), width) for width in WIDTHS] == [number] * len(WIDTHS)


def test_click_counts_as_far_from_a_dot_as_a_dozen_pixels_of_the_screen(lab: CorpusLab):
    points = np.array([spot(*dot) for dot in dots(lab)]) * SIZE
    lowest = int(np.argmax(points[:, 1]))
    x, y = points[lowest]
    for width in WIDTHS:
        near, far = (y + pixels * SIZE[0] / width for pixels in (9.0, 16.0))
        assert lab.clip_at(x / SIZE[0], near / SIZE[1], width) == lowest
        assert lab.clip_at(x / SIZE[0], far / SIZE[1], width) is None


def test_click_moves_the_ring_and_opens_the_player_which_no_slider_does(lab: CorpusLab, clips: list[Clip]):
    places = dots(lab)
    lab.controls["lag"].value = 0.02
    lab.controls["lag"].value = 0.0
    assert lab._player.value == ""
    lab.click(*spot(*places[2]), 900.0)
    ring = lab._figure.axes[1].lines[-1]
    assert (ring.get_xdata()[0], ring.get_ydata()[0]) == pytest.approx(places[2], abs=0.0051)
    assert lab.values["clip"] == 2
    page = unescape(lab._player.value)
    assert lab._player.layout.display == "block"
    assert f'title="{clips[2].name}: player"' in page
    shown = lab._player.value
    lab.controls["clip"].value = 3
    assert lab._player.value == shown


def test_click_beside_all_dots_does_nothing(lab: CorpusLab):
    lab.click(0.3, 0.4, 900.0)  # the histogram
    assert lab.values["clip"] == 0
    assert lab._player.value == ""


def test_clips_on_one_spot_take_turns(clips: list[Clip]):
    lab = corpus_lab([clips[0]] * 3, mode="valleys")
    place = spot(*dots(lab)[0])
    seen = []
    for _ in range(4):
        lab.click(*place, 900.0)
        seen.append(lab.values["clip"])
    assert seen == [1, 2, 0, 1]


def test_sound_of_the_player_starts_with_the_motion(clips: list[Clip]):
    clip = clips[0]
    late = replace(clip, motion=clip.motion.span(1.0, 2.0), offset=1.0)
    early = replace(clip, audio=clip.audio.span(0.5, 4.0), offset=-0.5, beats=clip.beats.span(0.5, 4.0))
    for other, start in ((late, 1.0), (early, 0.0)):
        sound = other.shared().audio
        np.testing.assert_array_equal(sound.samples, other.audio.span(start, sound.duration).samples)


def test_clip_that_cannot_be_played_says_why_above_the_picture(clips: list[Clip]):
    silent = replace(clips[0].audio, sample_rate=clips[0].audio.sample_rate * 100)
    lab = corpus_lab([replace(clips[0], audio=replace(silent, samples=np.zeros(round(silent.sample_rate * 5))))])
    lab.play()
    assert "the player takes sound of 3000 to 192000 Hz" in lab.error


def test_click_is_told_by_the_page_as_shares_and_width(lab: CorpusLab):
    place = dict(zip(("x", "y"), spot(*dots(lab)[1]), strict=True))
    lab._image._handle_custom_msg({**place, "width": 640.0}, [])
    assert lab.values["clip"] == 1
