"""The live labs in Python: controls, settings to copy, numbers that are those of the score, and the page."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.labs import live
from harmolab.lab.labs.corpus import corpus_lab
from harmolab.lab.labs.detector import detector_lab
from harmolab.lab.labs.live import LiveLab, Stage, lab_params
from harmolab.lab.labs.meter import meter_lab
from harmolab.lab.labs.saliency import saliency_lab, saliency_numbers
from harmolab.lab.labs.scoring import N_ROTATIONS, lags, scoring_content, scoring_lab
from harmolab.lab.labs.scoring import scoring_numbers as numbers_of
from harmolab.lab.player import percent
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip, score_motion
from tests.builders import along_x, cases, planted_dance, refused


@pytest.fixture
def stage(planted_clip: Clip) -> Stage:
    return Stage.of(planted_clip)


@pytest.fixture(scope="module")
def judged() -> Stage:
    """Enough beats for a verdict: a waltz danced on the beat."""
    return Stage.of(planted_dance("waltz", seconds=30.0, seed=3))


def shared_turn() -> Motion:
    """A hand that slows down once, at 1.15 s, in six seconds at 50 fps."""
    time = np.arange(300) / 50
    speed = 1.0 - 0.8 * np.exp(-0.5 * ((time - 1.15) / 0.1) ** 2)
    return along_x(np.cumsum(speed) / 50, fps=50.0)


MAKERS: dict[str, Callable[..., LiveLab]] = {
    "scoring": scoring_lab,
    "saliency": saliency_lab,
    "corpus": lambda clip, **values: corpus_lab([clip], **values),
}
LABS = {**MAKERS, "detector": detector_lab, "meter": meter_lab}


# Numbers


def test_one_to_one_matching_leaves_a_music_beat_without_the_visual_beat_it_shared():
    stage = Stage(BeatTrack([1.0, 1.3, 3.0], [1.0, 1.0, 1.0], fps=43.0, duration=6.0), shared_turn())
    many, nearest = (numbers_of(stage, mode="valleys", delay=0.2, matching=how) for how in ("many", "nearest"))
    assert (many["hits"], nearest["hits"]) == (2, 1)


def test_a_beat_dragged_away_from_its_movement_is_missed():
    stage = Stage(BeatTrack([1.1, 3.0], [1.0, 1.0], fps=43.0, duration=6.0), shared_turn())
    assert numbers_of(stage, mode="valleys")["hits"] == 1
    assert numbers_of(stage, mode="valleys", moves={"music": {"0": 1.4}})["hits"] == 0
    assert numbers_of(stage, mode="valleys", moves={"dance": {"0": 2.95}})["pairs"].tolist() == [-1, 0]


@pytest.mark.parametrize("mode", ["paper", "valleys"])
def test_numbers_are_what_score_clip_says(planted_clip: Clip, stage: Stage, mode: str):
    numbers = numbers_of(stage, mode=mode)
    score = score_clip(planted_clip, getattr(HarmonyParams, mode)(), n_rotations=N_ROTATIONS)
    assert (numbers["harmony"], numbers["chance"], numbers["p"]) == (score.harmony, score.chance, score.p_value)
    assert (numbers["hits"], numbers["beats"]) == (score.hits.sum(), score.n_audio)
    words = f"Now {score.hits.sum()} of {score.n_audio} music beats are met; by chance alone {100 * score.chance:.0f} %"
    assert numbers["sentence"].startswith(words)


def test_recommended_mode_says_the_verdict_and_its_numbers(judged: Stage):
    numbers = numbers_of(judged, mode="recommended")
    judgement = score_motion(judged.music, judged.motion).judgement
    assert numbers["sentence"] == judgement.verdict
    assert numbers["sentence"].startswith("You are on the beat: slow on it")
    assert (numbers["level"], numbers["above"]) == (4, judgement.harmony_above_chance)
    assert (numbers["p_time"], numbers["p_place"]) == (judgement.p_time, judgement.p_place)


def test_evidence_holds_a_verdict_for_each_step_of_the_lag(judged: Stage):
    verdicts = scoring_content(judged).to_browser()["evidence"]["verdicts"]
    steps = lags()
    assert (steps[0], steps[20], steps[-1]) == (-0.4, 0.0, 0.4)
    sentence = score_motion(
        judged.music, judged.motion, params=replace(HarmonyParams.recommended(), lag=0.24)
    ).judgement
    assert verdicts[steps.index(0.24)]["sentence"] == sentence.verdict
    assert verdicts[20]["sentence"] != sentence.verdict


def test_few_beats_have_a_sentence_and_no_number(stage: Stage):
    numbers = numbers_of(stage, mode="recommended")
    assert numbers["sentence"].startswith("Cannot tell: ")
    assert numbers["level"] == 0
    assert np.isnan(numbers["above"])
    assert len(numbers["curve"]) == 0


def test_wider_tolerance_brings_chance_close_to_one(stage: Stage):
    narrow, wide = (numbers_of(stage, mode="paper", delay=delay) for delay in (0.05, 0.25))
    assert narrow["chance"] < 0.5
    assert wide["chance"] > 0.95
    assert wide["hits"] >= narrow["hits"]


@pytest.mark.parametrize("mode", ["paper", "valleys"])
def test_beats_that_all_go_unnoticed_leave_an_empty_score_and_a_sentence(stage: Stage, mode: str):
    numbers = numbers_of(stage, mode=mode, lambda1=99.0)
    assert (numbers["harmony"], numbers["hits"], numbers["beats"]) == (0.0, 0, 0)
    assert numbers["sentence"] == "No music beat is loud enough to count."


def test_saliency_lab_keeps_what_was_counted_by_hand(planted_clip: Clip):
    music = BeatTrack([0.5, 1.0, 1.5, 2.0, 2.5], [2.0, 4.0, 0.1, 3.0, 1.0], fps=100, duration=3.0)
    dance = BeatTrack([0.2, 0.55, 0.8, 1.15, 1.6, 2.45], [4.0, 1.0, 5.0, 2.0, 2.2, 6.0], fps=100, duration=3.0)
    stage = Stage(music, planted_clip.motion.span(0.0, 3.0))
    numbers = saliency_numbers(stage, dance, lambda1=0.1, lambda2=1.0)
    assert numbers["sentence"] == "Now 4 of 5 music beats and 5 of 6 movements are noticed."
    assert saliency_numbers(stage, dance, lambda1=0.1, lambda2=0.0)["dance"] == 6
    # SD(s_a) is .3466 of the largest; the formula as printed keeps what exceeds it, whatever λ1: .5, 1 and .75.
    assert saliency_numbers(stage, dance, lambda1=0.1, lambda2=1.0, saliency="literal")["music"] == 3


def test_higher_thresholds_keep_fewer_beats(planted_clip: Clip):
    assert planted_clip.beats is not None
    strengths = np.where(np.arange(len(planted_clip.beats)) % 3 == 0, 1.0, 0.2)
    lab = saliency_lab(replace(planted_clip, beats=replace(planted_clip.beats, strengths=strengths)))
    kept = []
    for value in (0.1, 2.0, 4.0):  # SD is .38: the weak beats go first, then the strong ones
        lab.set(lambda1=value)
        kept.append(lab.numbers["music"])
    assert kept == [strengths.size, (strengths == 1.0).sum(), 0]


def test_halves_of_a_per_cent_are_rounded_up():
    assert [percent(share) for share in (0.0, 0.125, 0.974, 1.0)] == ["0", "13", "97", "100"]


# Controls and settings


def test_a_mode_sets_the_other_controls_to_its_own(planted_clip: Clip):
    lab = scoring_lab(planted_clip)
    lab.set(mode="recommended")
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
    assert lab.params == own


def test_a_lab_can_start_elsewhere(planted_clip: Clip):
    assert scoring_lab(planted_clip, delay=0.1).line == "HarmonyParams(reaction_delay=0.1)"
    assert saliency_lab(planted_clip, lambda2=0.0).line == "HarmonyParams(visual_threshold=None)"
    lab = corpus_lab([planted_clip], mode="valleys", lag=0.1)
    assert lab.line.endswith("subframe=True, lag=0.1)")
    assert eval(lab.line) == lab.params == replace(HarmonyParams.valleys(), lag=0.1)


def test_settings_of_a_browser_arrive_as_python_has_them(planted_clip: Clip):
    lab = scoring_lab(planted_clip)
    lab.settings = {**lab.settings, "beta": 1, "lag": 0}  # a browser writes 1.0 as 1
    assert lab.line == "HarmonyParams(beta=1.0)"


@pytest.mark.parametrize("name", MAKERS)
@cases(
    "values, fault",
    ({"tolerance": 0.1}, "no control tolerance; there are "),
    ({"lambda1": -1.0}, "lambda1 must lie between 0 and 15, got -1.0"),
    ({"lambda2": "two"}, "lambda2 must lie between 0 and 6, got 'two'"),
)
def test_control_or_value_that_does_not_exist_is_refused_by_name(
    planted_clip: Clip, name: str, values: dict[str, Any], fault: str
):
    refused(fault, MAKERS[name], planted_clip, **values)


def test_unknown_mode_is_refused_by_name(planted_clip: Clip):
    with pytest.raises(ValueError, match="mode must be one of paper, recommended, valleys; got 'tea leaves'"):
        scoring_lab(planted_clip, mode="tea leaves")


def test_clip_without_motion_is_refused(planted_clip: Clip):
    for maker in (*MAKERS.values(), detector_lab):
        refused("no motion", maker, Clip("song", planted_clip.audio))


def test_controls_stand_for_params_and_a_lambda2_of_zero_keeps_every_visual_beat():
    params = lab_params(
        "paper", detector="peaks", matching="max", lambda1=0.5, lambda2=0.0, delay=0.1, beta=1.0, lag=0.2
    )
    assert (params.detector, params.matching, params.audio_threshold) == ("peaks", "max", 0.5)
    assert params.visual_threshold is None
    assert (params.reaction_delay, params.beta, params.lag) == (0.1, 1.0, 0.2)
    assert params.fps == HarmonyParams.paper().fps


@pytest.mark.parametrize("name", LABS)
def test_each_preset_is_a_setting_of_the_lab_with_a_sentence(planted_clip: Clip, name: str):
    lab = LABS[name](planted_clip)
    sentences = {}
    for preset in lab.content.presets:
        lab.set(**preset.values)
        assert preset.note.endswith(".")
        sentences[preset.label] = lab.sentence
    assert len(set(sentences.values())) > 1


def test_silence_and_a_dancer_who_stands_still_have_labs_too(planted_clip: Clip):
    still = Motion(np.zeros((180, 1, 3)), 30.0, shared_turn().skeleton)
    clip = replace(planted_clip, motion=still, beats=BeatTrack([], [], fps=43.0, duration=6.0))
    for maker in LABS.values():
        assert maker(clip).page
    lab = scoring_lab(clip)
    assert lab.sentence == "No music beat is loud enough to count."
    lab.set(mode="recommended")
    assert lab.sentence.startswith("Cannot tell: ")


# The page


@pytest.mark.parametrize("name", LABS)
def test_a_notebook_gets_the_page_and_the_sentence_beside_the_live_widget(planted_clip: Clip, name: str):
    lab = LABS[name](planted_clip)
    data, _ = lab._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in data
    assert data["text/plain"] == f"{lab.sentence}\n{lab.line}"
    assert data["text/html"].startswith(f'<iframe title="{lab.content.title}" srcdoc="')


@cases(
    "kind, metadata, server, is_live",
    ("execute_request", {}, "", False),  # nbconvert and other programs
    ("execute_request", {"cellId": "a1", "deletedCells": []}, "", True),  # JupyterLab
    ("execute_request", {}, "voila/0.5.13", True),
    ("comm_msg", {}, "", True),  # a widget's page asks for it
)
def test_the_widget_is_left_out_where_no_page_can_show_it(
    kind: str,
    metadata: dict[str, object],
    server: str,
    is_live: bool,
    planted_clip: Clip,
    monkeypatch: pytest.MonkeyPatch,
):
    request = {"header": {"msg_type": kind}, "metadata": metadata}
    shell = SimpleNamespace(kernel=SimpleNamespace(get_parent=lambda: request))
    monkeypatch.setattr(live, "get_ipython", lambda: shell)
    monkeypatch.setenv("SERVER_SOFTWARE", server)
    data, _ = LABS["saliency"](planted_clip)._repr_mimebundle_()
    assert ("application/vnd.jupyter.widget-view+json" in data) == is_live
    assert {"text/html", "text/plain"} <= set(data)


def test_names_of_clips_are_escaped_and_the_page_asks_for_no_file(planted_clip: Clip, tmp_path: Path):
    clip = replace(planted_clip, name="</script><script>alert(1)</script>")
    lab = corpus_lab([clip, synthetic_clip("rumba", seconds=6.0, fps=30.0)])
    lab.save(tmp_path / "lab.html")
    page = (tmp_path / "lab.html").read_text("utf-8")
    assert page == lab.page
    assert page.count("<script") == page.count("</script>") == 1
    assert re.findall(r'(?:src|href)="(?!data:)', page) == []


def test_the_page_of_synthetic_data_says_so(planted_clip: Clip):
    for maker in LABS.values():
        assert maker(planted_clip).data["evidence"]["source"] == "synthetic"
