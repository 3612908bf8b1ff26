"""The scoring lab: its controls, its picture, and that its numbers are those of `score_clip`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure

from harmolab.harmony import score_clip, score_motion
from harmolab.lab.widgets.explorer import Explorer
from harmolab.lab.widgets.labs.scoring import N_ROTATIONS, draw_lab, lab_params, scoring_lab
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, Clip, Motion
from tests.builders import along_x, planted_dance

PNG = b"\x89PNG\r\n"
HALF_BAR = BarPattern(2, (-0.5, -0.5), (0.1, 0.0), "planted")


@pytest.fixture
def stage(planted_clip: Clip) -> Stage:
    return Stage.of(planted_clip)


def board(figure: Figure) -> dict[str, str]:
    """What stands on the board."""
    ax = figure.axes[3]
    return dict(
        zip([label.get_text() for label in ax.get_xticklabels()], [text.get_text() for text in ax.texts], strict=True)
    )


def numbers(figure: Figure) -> dict[str, float]:
    """The board of a mode that counts hits."""
    values = board(figure)
    hits, beats = values["music beats hit"].split("/")
    found = {"h": values["harmony h"], "hits": hits, "beats": beats, "chance": values["chance"]}
    found |= {"above": values["above chance"], "p": values["p-value"].replace("–", "nan")}
    return {name: float(value) for name, value in found.items()}


@pytest.fixture(scope="module")
def judged() -> Stage:
    """Enough beats for a verdict: a waltz danced on the beat."""
    return Stage.of(planted_dance("waltz", seconds=30.0, seed=3))


def test_one_to_one_matching_leaves_a_music_beat_without_the_visual_beat_it_shared():
    music = BeatTrack([1.0, 1.3, 3.0], [1.0, 1.0, 1.0], fps=43.0, duration=6.0)
    stage = Stage(music, shared_turn())
    many, nearest = (numbers(draw_lab(stage, mode="valleys", delay=0.2, matching=how)) for how in ("many", "nearest"))
    assert (many["hits"], nearest["hits"]) == (2, 1)


def shared_turn() -> Motion:
    """A hand that slows down once, at 1.15 s, in six seconds at 50 fps."""
    time = np.arange(300) / 50
    speed = 1.0 - 0.8 * np.exp(-0.5 * ((time - 1.15) / 0.1) ** 2)
    return along_x(np.cumsum(speed) / 50, fps=50.0)


def test_a_mode_sets_the_other_controls_to_its_own(planted_clip: Clip):
    lab = scoring_lab(planted_clip)
    lab.controls["mode"].value = "recommended"
    own = HarmonyParams.recommended()
    assert lab.values == {
        "mode": "recommended",
        "detector": own.detector,
        "matching": own.matching,
        "lambda1": own.audio_threshold,
        "lambda2": 0.0,
        "delay": own.reaction_delay,
        "beta": own.beta,
        "lag": 0.0,
    }


def test_a_change_of_mode_draws_one_picture(planted_clip: Clip, monkeypatch: pytest.MonkeyPatch):
    drawn = []
    lab = scoring_lab(planted_clip)
    original = lab._draw
    monkeypatch.setattr(lab, "_draw", lambda **values: drawn.append(values["mode"]) or original(**values))
    lab.controls["mode"].value = "valleys"
    assert drawn == ["valleys"]


def test_picture_is_the_one_that_draw_lab_makes_when_called_directly(planted_clip: Clip):
    lab = scoring_lab(planted_clip, pattern=HALF_BAR)
    lab.controls["mode"].value = "recommended"
    lab.controls["lag"].value = 0.1
    stage = Stage.of(planted_clip, HALF_BAR)
    plain = {name: type(widget)(**widget_state(widget)) for name, widget in lab.controls.items()}
    assert Explorer(partial(draw_lab, stage), **plain).png == lab.png


def widget_state(widget: object) -> dict[str, object]:
    names = ("options", "min", "max", "step", "value")
    return {name: getattr(widget, name) for name in names if hasattr(widget, name)}


@pytest.mark.parametrize("mode", ["paper", "valleys"])
def test_headline_tells_what_score_clip_finds(planted_clip: Clip, stage: Stage, mode: str):
    found = numbers(draw_lab(stage, mode=mode))
    score = score_clip(planted_clip, getattr(HarmonyParams, mode)(), n_rotations=N_ROTATIONS)
    assert found["h"] == pytest.approx(score.harmony, abs=0.006)
    assert (found["hits"], found["beats"]) == (score.hits.sum(), score.n_audio)
    assert found["chance"] == pytest.approx(score.chance, abs=0.006)
    assert found["above"] == pytest.approx(score.harmony_above_chance, abs=0.006)
    assert found["p"] == pytest.approx(score.p_value, abs=0.0006)


def test_recommended_mode_shows_the_verdict_and_its_numbers(judged: Stage):
    figure = draw_lab(judged, mode="recommended")
    judgement = score_motion(judged.music, judged.motion).judgement
    assert [text.get_text() for text in figure.axes[1].texts] == [judgement.verdict]
    assert judgement.verdict.startswith("You are on the beat: you rest on it")
    assert board(figure) == {
        "level": "4 of 4",
        "H, above chance": f"{judgement.harmony_above_chance:+.2f}",
        "p in time": f"{judgement.p_time:.3f}",
        "p in place": f"{judgement.p_place:.3f}",
        "lag (ms)": f"{1000 * judgement.lag_s:+.0f}",
    }


def test_few_beats_have_a_sentence_and_no_number(stage: Stage):
    figure = draw_lab(stage, mode="recommended")
    (sentence,) = [text.get_text() for text in figure.axes[1].texts]
    assert sentence.startswith("Cannot tell: ")
    assert list(board(figure).values()) == ["0 of 4", "–", "–", "–", "–"]
    assert len(figure.axes[2].lines) == 0


def test_picture_of_synthetic_data_says_so(stage: Stage):
    assert draw_lab(stage).axes[1].get_xlabel() == "time (s)   |   synthetic data"


def test_wider_tolerance_brings_chance_close_to_one(stage: Stage):
    narrow, wide = (numbers(draw_lab(stage, delay=delay)) for delay in (0.05, 0.25))
    assert narrow["chance"] < 0.5
    assert wide["chance"] > 0.95
    assert wide["hits"] >= narrow["hits"]


def test_diamond_stands_on_the_curve_of_the_moved_music(judged: Stage):
    for mode in ("paper", "recommended"):
        right = draw_lab(judged, mode=mode).axes[2]
        curve, _, diamond = right.lines
        height = np.interp(0.0, curve.get_xdata(), curve.get_ydata())
        # The nearest shifts lie a hundredth of a second to either side.
        assert diamond.get_ydata()[0] == pytest.approx(height, abs=0.12)
        assert diamond.get_xdata()[0] == 0.0


def test_planted_beats_put_the_diamond_at_the_top_of_the_recommended_mode(judged: Stage):
    curve, _, diamond = draw_lab(judged, mode="recommended").axes[2].lines
    assert diamond.get_ydata()[0] >= 0.99 * curve.get_ydata().max()


def test_expected_speed_is_lowest_on_the_beats_and_moves_with_the_lag(stage: Stage):
    for lag in (0.0, 0.1):
        expected = draw_lab(stage, mode="recommended", lag=lag).axes[1].lines[1]
        times, speed = expected.get_xdata(), expected.get_ydata()
        valleys = times[1:-1][(speed[1:-1] < speed[:-2]) & (speed[1:-1] <= speed[2:])]
        inner = stage.music.times[1:-1] + lag
        assert np.abs(valleys[:, None] - inner[None, :]).min(axis=0).max() <= 1.0 / stage.motion.fps


def test_pattern_over_two_beats_is_not_laid_on_beats_whose_places_nobody_knows(planted_clip: Clip):
    unknown = Stage.of(planted_clip).music
    known = replace(unknown, bar_places=np.arange(len(unknown)) % 4)
    motion = Stage.of(planted_clip).motion
    lines = [draw_lab(Stage(track, motion, HALF_BAR), mode="recommended").axes[1].lines for track in (known, unknown)]
    assert [len(found) for found in lines] == [2, 1]


@pytest.mark.parametrize("mode", ["paper", "valleys"])
def test_beats_that_all_go_unnoticed_leave_an_empty_score_and_no_error(planted_clip: Clip, mode: str):
    flat = BeatTrack([1.0, 2.0, 3.0], [1.0, 0.9, 1.1], fps=43.0, duration=6.0)
    stage = Stage(flat, Stage.of(planted_clip).motion)
    found = numbers(draw_lab(stage, mode=mode, lambda1=99.0))
    assert (found["h"], found["hits"], found["beats"]) == (0.0, 0, 0)


def test_music_without_beats_draws_too(planted_clip: Clip):
    silence = Stage(BeatTrack([], [], fps=43.0, duration=6.0), Stage.of(planted_clip).motion)
    assert numbers(draw_lab(silence, mode="paper"))["beats"] == 0
    assert board(draw_lab(silence, mode="recommended"))["level"] == "0 of 4"


def test_lab_can_start_elsewhere(planted_clip: Clip):
    assert scoring_lab(planted_clip, delay=0.1).values["delay"] == 0.1


def test_clip_without_motion_is_refused(planted_clip: Clip):
    with pytest.raises(ValueError, match="no motion"):
        scoring_lab(Clip("song", planted_clip.audio))


def test_controls_stand_for_params_and_a_lambda2_of_zero_keeps_every_visual_beat():
    params = lab_params(
        "paper", detector="peaks", matching="max", lambda1=0.5, lambda2=0.0, delay=0.1, beta=1.0, lag=0.2
    )
    assert (params.detector, params.matching, params.audio_threshold) == ("peaks", "max", 0.5)
    assert params.visual_threshold is None
    assert (params.reaction_delay, params.beta, params.lag) == (0.1, 1.0, 0.2)
    assert params.fps == HarmonyParams.paper().fps
