"""The live labs: controls, numbers that are those of the score, the page, and its script against Python."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quickjs
from hypothesis import given
from hypothesis import strategies as st

from harmolab.beats.visual import visual_beats
from harmolab.data.synthetic import ClipSettings, PlantedClip, planted_clip, synthetic_clip
from harmolab.lab.labs import corpus, live, meter, one_clip, pages
from harmolab.lab.labs.corpus import Corpus, corpus_lab, corpus_numbers
from harmolab.lab.labs.live import CONTROLS, LabContent, LiveLab, Stage
from harmolab.lab.labs.one_clip import detector_lab
from harmolab.lab.player_data import percent
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.score import score_harmony
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip, score_motion
from tests.builders import along_x, cases, planted_dance, refused, track


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
    "scoring": one_clip.scoring_lab,
    "saliency": one_clip.saliency_lab,
    "corpus": lambda clip, **values: corpus_lab([clip], **values),
}
LABS = {**MAKERS, "detector": detector_lab, "meter": meter.meter_lab}


# Numbers


def test_one_to_one_matching_leaves_a_music_beat_without_the_visual_beat_it_shared():
    stage = Stage(track([1.0, 1.3, 3.0], duration=6.0), shared_turn())
    for matching, hits in (("many", 2), ("nearest", 1)):
        assert one_clip.scoring_numbers(stage, mode="valleys", delay=0.2, matching=matching)["hits"] == hits


def test_a_beat_dragged_away_from_its_movement_is_missed():
    stage = Stage(track([1.1, 3.0], duration=6.0), shared_turn())
    assert one_clip.scoring_numbers(stage, mode="valleys")["hits"] == 1
    assert one_clip.scoring_numbers(stage, mode="valleys", moves={"music": {"0": 1.4}})["hits"] == 0
    assert one_clip.scoring_numbers(stage, mode="valleys", moves={"dance": {"0": 2.95}})["pairs"].tolist() == [-1, 0]


@pytest.mark.parametrize("mode", ["paper", "valleys"])
def test_numbers_are_what_score_clip_says(planted_clip: Clip, stage: Stage, mode: str):
    numbers = one_clip.scoring_numbers(stage, mode=mode)
    score = score_clip(planted_clip, getattr(HarmonyParams, mode)(), n_rotations=one_clip.N_ROTATIONS)
    told = (score.harmony, score.chance, score.p_value, score.hits.sum(), score.n_audio)
    assert tuple(numbers[name] for name in ("harmony", "chance", "p", "hits", "beats")) == told
    words = f"Now {score.hits.sum()} of {score.n_audio} music beats are met; by chance alone {100 * score.chance:.0f} %"
    assert numbers["sentence"].startswith(words)


def test_recommended_mode_says_the_verdict_and_its_numbers(judged: Stage):
    numbers = one_clip.scoring_numbers(judged, mode="recommended")
    judgement = score_motion(judged.music, judged.motion).judgement
    assert numbers["sentence"] == judgement.verdict
    assert numbers["sentence"].startswith("You are on the beat: slow on it")
    assert (numbers["level"], numbers["above"]) == (4, judgement.harmony_above_chance)
    assert (numbers["p_time"], numbers["p_place"]) == (judgement.p_time, judgement.p_place)


@pytest.mark.slow
def test_evidence_holds_a_verdict_for_each_step_of_the_lag(judged: Stage):
    verdicts = one_clip.scoring_content(judged).to_browser()["evidence"]["verdicts"]
    steps = one_clip.lags()
    assert (steps[0], steps[20], steps[-1]) == (-0.4, 0.0, 0.4)
    later = score_motion(judged.music, judged.motion, params=replace(HarmonyParams.recommended(), lag=0.24)).judgement
    assert verdicts[steps.index(0.24)]["sentence"] == later.verdict != verdicts[20]["sentence"]


def test_few_beats_have_a_sentence_and_no_number(stage: Stage):
    numbers = one_clip.scoring_numbers(stage, mode="recommended")
    assert numbers["sentence"].startswith("Cannot tell: ")
    np.testing.assert_equal((numbers["level"], len(numbers["curve"]), numbers["above"]), (0, 0, np.nan))


def test_beats_that_all_go_unnoticed_leave_an_empty_score_and_a_sentence(stage: Stage):
    numbers = one_clip.scoring_numbers(stage, mode="valleys", lambda1=99.0)
    assert (numbers["harmony"], numbers["hits"], numbers["beats"]) == (0.0, 0, 0)
    assert numbers["sentence"] == "No music beat is loud enough to count."


def test_saliency_lab_keeps_what_was_counted_by_hand(planted_clip: Clip):
    music = BeatTrack([0.5, 1.0, 1.5, 2.0, 2.5], [2.0, 4.0, 0.1, 3.0, 1.0], fps=100, duration=3.0)
    dance = BeatTrack([0.2, 0.55, 0.8, 1.15, 1.6, 2.45], [4.0, 1.0, 5.0, 2.0, 2.2, 6.0], fps=100, duration=3.0)
    numbers = partial(one_clip.saliency_numbers, Stage(music, planted_clip.motion.span(0.0, 3.0)), dance)
    assert numbers(lambda1=0.1, lambda2=1.0)["sentence"] == "Now 4 of 5 music beats and 5 of 6 movements are noticed."
    assert numbers(lambda1=0.1, lambda2=0.0)["dance"] == 6
    # SD(s_a) is .3466 of the largest; the formula as printed keeps what exceeds it, whatever λ1: .5, 1 and .75.
    assert numbers(lambda1=0.1, lambda2=1.0, saliency="literal")["music"] == 3
    assert [numbers(lambda1=value)["music"] for value in (0.0, 1.0, 2.0, 3.0)] == [5, 3, 2, 0]


def test_halves_of_a_per_cent_are_rounded_up():
    assert [percent(share) for share in (0.0, 0.125, 0.974, 1.0)] == ["0", "13", "97", "100"]


# Controls and settings


def test_a_mode_sets_the_other_controls_to_its_own(planted_clip: Clip):
    lab = one_clip.scoring_lab(planted_clip)
    lab.set(mode="recommended")
    own = HarmonyParams.recommended()
    settings = {"detector": own.detector, "matching": own.matching, "beta": own.beta, "lag": 0.0}
    thresholds = {"lambda1": own.audio_threshold, "lambda2": 0.0, "delay": own.reaction_delay}
    assert (lab.values, lab.params) == ({"mode": "recommended", **settings, **thresholds}, own)


def test_a_lab_can_start_elsewhere(planted_clip: Clip):
    assert one_clip.scoring_lab(planted_clip, delay=0.1).line == "HarmonyParams(reaction_delay=0.1)"
    assert one_clip.saliency_lab(planted_clip, lambda2=0.0).line == "HarmonyParams(visual_threshold=None)"
    lab = corpus_lab([planted_clip], mode="valleys", lag=0.1)
    assert lab.line.endswith("subframe=True, lag=0.1)")
    assert eval(lab.line) == lab.params == replace(HarmonyParams.valleys(), lag=0.1)


@pytest.mark.parametrize("name", MAKERS)
@cases(
    "values, fault",
    ({"tolerance": 0.1}, "no control tolerance; there are "),
    ({"lambda1": -1.0}, r"lambda1 must lie between 0 and [\d.]+, got -1.0"),
    ({"lambda2": "two"}, r"lambda2 must lie between 0 and [\d.]+, got .two."),
)
def test_control_or_value_that_does_not_exist_is_refused_by_name(
    planted_clip: Clip, name: str, values: dict[str, Any], fault: str
):
    refused(fault, MAKERS[name], planted_clip, **values)


def test_clip_without_motion_is_refused(planted_clip: Clip):
    for maker in (*MAKERS.values(), detector_lab):
        refused("no motion", maker, Clip("song", planted_clip.audio))


def test_silence_and_a_dancer_who_stands_still_have_labs_too(planted_clip: Clip):
    clip = replace(planted_clip, motion=along_x(np.zeros(180), fps=30.0), beats=track([], duration=6.0))
    for maker in LABS.values():
        assert maker(clip).page
    assert one_clip.scoring_lab(clip).sentence == "No music beat is loud enough to count."


# The page


@pytest.mark.parametrize("name", LABS)
def test_a_notebook_gets_the_page_and_the_sentence_beside_the_live_widget(planted_clip: Clip, name: str):
    lab = LABS[name](planted_clip)
    data, _ = lab._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in data
    assert data["text/plain"] == f"{lab.sentence}\n{lab.line}"
    assert data["text/html"].startswith(f'<iframe title="{lab.content.title}" srcdoc="')
    # JupyterLab drops the frames of notebooks that are not trusted, and keeps what stands in them.
    left = re.sub("<[^>]*>", "", data["text/html"])
    assert left.startswith(f"{lab.content.title}: not shown here. ") and "“Trust Notebook”" in left


@cases(
    "kind, metadata, server, is_live",
    ("execute_request", {}, "", False),  # nbconvert and other programs
    ("execute_request", {"cellId": "a1", "deletedCells": []}, "", True),  # JupyterLab
    ("execute_request", {}, "voila/0.5.13", True),
    ("comm_msg", {}, "", True),  # a widget's page asks for it
)
def test_the_widget_is_left_out_where_no_page_can_show_it(
    kind: str, metadata: dict, server: str, is_live: bool, planted_clip: Clip, monkeypatch: pytest.MonkeyPatch
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


# The detector lab and the meter lab

FINE = {"detector": "valleys", "fps": None, "smoothing": 0.05, "subframe": True}


@pytest.fixture(scope="module")
def planted() -> PlantedClip:
    """Six seconds of a cha-cha whose rests are known."""
    return planted_clip(ClipSettings("cha-cha", seconds=6.0, seed=0))


def metronome(count: int, strengths: object = None, *, places: bool = False) -> BeatTrack:
    """Beats every half second from 0.25 s on."""
    bars = np.arange(count) % 4 if places else None
    return track(0.25 + 0.5 * np.arange(count), strengths, fps=43.0, duration=0.5 * count, bar_places=bars)


def holding_dancer() -> Motion:
    """A hand that speeds up, keeps its speed for four frames and slows down, over and over."""
    speed = np.tile([1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 3.0, 2.0, 1.0, 0.5], 16)
    return along_x(np.cumsum(speed) / 32, fps=30.0)  # exact in binary, so that a plateau is a tie


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
    assert lab.numbers["mask"] is lab.data["evidence"]["planted"] is None


def test_plateau_moves_the_beats_of_a_dancer_who_keeps_the_speed(planted_clip: Clip):
    lab = detector_lab(replace(planted_clip, motion=holding_dancer()), fps=None)
    before = lab.numbers["times"].mean()
    lab.set(plateau="middle")
    assert lab.numbers["times"].mean() < before


@cases(
    "values, line",
    ({"smoothing": 0.05}, "HarmonyParams(smoothing=0.05)"),
    ({"fps": None}, "HarmonyParams(fps=None)"),
    ({"fps": 30, "smoothing": 0}, "HarmonyParams(fps=30.0)"),  # a browser writes 30.0 as 30
    ({"subframe": True, "position_smoothing": 0.1}, "HarmonyParams(position_smoothing=0.1, subframe=True)"),
)
def test_line_of_the_detector_lab_follows_its_controls(planted_clip: Clip, values: dict[str, object], line: str):
    lab = detector_lab(planted_clip)
    lab.set(**values)
    assert lab.line == line


# The meter lab


def test_alternating_strengths_are_grouped_by_two_and_two_and_every_second_beat_has_no_accent():
    song = meter.Song({"of the clip": metronome(10, [1, 2] * 5)})
    numbers = meter.meter_numbers(song)
    # Beats 2-5 and 6-9 are strong, weak, strong, weak; the tenth ends the second unit: 4 of 5 seconds.
    assert [label for _, _, label in numbers["units"]] == ["4/4 (2+2)"] * 2
    assert numbers["sentence"] == "Now 5 of 10 beats are strong, and meter units cover 80 % of the time."
    numbers = meter.meter_numbers(song, every=2.0, lambda1=0.0)
    assert (numbers["beats"], numbers["strong"], len(numbers["units"])) == (5, 0, 0)


def test_units_start_later_when_the_first_beats_are_left_out():
    song = meter.Song({"of the clip": metronome(12, [1, 2] * 6)})
    early, late = (meter.meter_numbers(song, first=count)["units"][0][0] for count in (0.0, 2.0))
    assert late - early == pytest.approx(1.0)


def test_downbeats_are_counted_only_where_somebody_annotated_them(planted_clip: Clip):
    lab = meter.meter_lab(planted_clip)
    assert "downbeats" not in lab.sentence
    assert "annotated beats" not in [preset.label for preset in lab.content.presets]
    refused("beats must be one of of the clip; got 'annotated'", lab.set, beats="annotated")
    lab.play()
    assert (lab.player, lab.data["plays"]) == ("", False)  # only a corpus has a player
    beats = metronome(9, [2, 1, 1, 1] * 2 + [2], places=True)
    numbers = meter.meter_numbers(meter.Song({"of the clip": beats}, beats))
    # The first beat has none before it and is weak (Eq. 22).
    assert numbers["sentence"].endswith(" Of the downbeats among them 2 of 3 are strong.")
    assert numbers["accents"].tolist() == pytest.approx([2 / 3, 0, 0, 0])
    assert numbers["chance"] == pytest.approx(2 / 9)


def test_weak_beats_below_the_threshold_are_not_compared():
    song = meter.Song({"of the clip": metronome(12, [1.0, 0.2, 2.0] * 4)})
    assert meter.meter_numbers(song, lambda1=1.0)["beats"] == 8


# The corpus lab


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    kinds = ("cha-cha", "jive", "rumba", "waltz", "tango")
    return [synthetic_clip(kind, seconds=5.0, fps=30.0, jitter=0.08, seed=seed) for seed, kind in enumerate(kinds)]


def exact_dancers() -> Corpus:
    """Three dancers who stop on every music beat and at no other moment."""
    clips = []
    for name, count in (("a", 12), ("b", 16), ("c", 20)):
        time = np.arange(25 * count) / 50
        stops = along_x(time - np.sin(4 * np.pi * (time - 0.25)) / (4 * np.pi), fps=50.0)
        clips.append(Clip(name, Audio(np.zeros(500 * count), 1000), stops, beats=metronome(count)))
    return Corpus.of(clips)


@cases(
    "values, expected",
    ({"delay": 0.1}, (1.0, 3, 0, 0.0)),
    ({"delay": 0.25}, (0.5, 0, 3, 1.0)),
    ({"late": 0.0}, (0.5, 0, 3, 1.0)),
    ({"late": 1.0}, (0.5, 0, 3, 1.0)),
)
def test_music_half_a_beat_late_loses_against_exact_dancers_in_a_narrow_field_only(values: dict, expected: tuple):
    numbers = corpus_numbers(exact_dancers(), mode="valleys", score="hit_rate", **values)
    area, wins, ties, _ = expected
    assert (numbers["auc"], numbers["wins"], numbers["ties"], numbers["mean_wrong"]) == expected
    words = f"The true music wins in {wins} of 3 dances, with {ties} ties. AUC {100 * area:.0f} %"
    assert numbers["sentence"].startswith(words)


def test_moved_music_scores_as_score_harmony_says():
    clip = synthetic_clip("cha-cha", seconds=6.0, fps=30.0, jitter=0.1, seed=4)
    scored = Corpus.of([clip])
    stage = Stage.of(clip)
    moved = np.sort(np.mod(stage.music.times + 0.4 * scored.periods[0], stage.music.duration))
    params = replace(HarmonyParams.valleys(), audio_threshold=0.0)
    flat = replace(stage.music, times=moved, strengths=np.ones(moved.size))
    by_hand = score_harmony(flat, visual_beats(stage.motion, params=params), params=params, n_rotations=0)
    assert corpus.corpus_scores(scored, "valleys", params, "hit_rate", 0.4)[0] == pytest.approx(by_hand.hit_rate)


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


def test_mode_sets_the_sliders_and_the_chosen_clip_stays(clips: list[Clip]):
    lab = corpus_lab(clips, clip=2)
    lab.set(mode="valleys")
    assert (lab.values["delay"], lab.values["lambda2"], lab.values["clip"]) == (0.1, 0.0, 2)
    assert lab.params == HarmonyParams.valleys()


def test_the_button_opens_the_chosen_clip_and_no_slider_does(clips: list[Clip]):
    lab = corpus_lab(clips, mode="valleys", clip=2)
    lab.set(lag=0.02)
    assert lab.player == ""
    lab._handle_custom_msg({"play": True}, [])
    assert f'title="{clips[2].name}: player"' in unescape(lab.player)
    shown = lab.player
    lab.set(clip=3)
    assert lab.player == shown


def test_clip_that_cannot_be_played_says_why_under_the_picture(clips: list[Clip]):
    silent = replace(clips[0].audio, sample_rate=clips[0].audio.sample_rate * 100)
    lab = corpus_lab([replace(clips[0], audio=replace(silent, samples=np.zeros(round(silent.sample_rate * 5))))])
    lab.play()
    assert "the player takes sound of 3000 to 192000 Hz" in lab.player


def test_corpus_without_a_clip_is_refused():
    refused("at least one clip", corpus_lab, [])


# Settings as Python text

PRESETS = (HarmonyParams.paper(), HarmonyParams.recommended(), HarmonyParams.valleys())


def test_numbers_of_numpy_and_a_learnt_pattern_are_written_as_plain_python():
    pattern = BarPattern(2, (np.float64(-0.5), np.float64(0.25)), (np.float64(0.1), np.float64(0.0)), 'it\'s "learnt"')
    params = HarmonyParams(lag=np.float64(0.1), pattern=pattern)
    assert "np." not in live.params_line(params)
    assert eval(live.params_line(params)) == params


any_number = st.floats(0.0, 10.0, allow_nan=False)
any_params = st.builds(
    replace,
    st.sampled_from(PRESETS),
    audio_threshold=any_number,
    visual_threshold=st.none() | any_number,
    lag=st.floats(-1.0, 1.0),
    fps=st.none() | st.floats(1.0, 120.0),
    subframe=st.booleans(),
    **{name: st.sampled_from(choices) for name, choices in CHOICES.items()},
    pattern=st.builds(lambda values: BarPattern(1, tuple(values), tuple(values)), st.lists(any_number, min_size=1)),
)


@given(any_params)
def test_any_settings_come_back_from_their_line(params: HarmonyParams):
    assert eval(live.params_line(params)) == params


# The script in a JavaScript engine without a browser

STAGE = Stage.of(pages.inexact_dance())


def with_every_control(content: LabContent, measure: str = "hits") -> LabContent:
    """The lab with every control that one of its formulas reads and that has a place for each mode's own value."""
    read = [name for name in CONTROLS if not live.unread(content.kind, measure, [name])]
    controls = content.controls | {name: CONTROLS[name] for name in read if name != "position_smoothing"}
    return replace(content, controls=controls, evidence=content.evidence | live.curve_evidence(STAGE.motion, controls))


SCRIPTED: dict[str, Callable[[], LiveLab]] = {
    "scoring": lambda: LiveLab(one_clip.scoring_content(STAGE)),
    "scoring, every control": lambda: LiveLab(with_every_control(one_clip.scoring_content(STAGE))),
    "saliency": lambda: one_clip.saliency_lab(pages.inexact_dance()),
    "corpus": lambda: corpus_lab(pages.inexact_corpus(6)),
    "corpus, every control": lambda: LiveLab(with_every_control(corpus_lab(pages.inexact_corpus(4)).content)),
    "detector": pages.inexact_detector_lab,
    "meter": pages.inexact_meter_lab,
}
WHOLE = {"clip", "every", "first"}  # sliders of whole numbers


@cache
def scripted(name: str) -> LiveLab:
    return SCRIPTED[name]()


@pytest.fixture(params=SCRIPTED)
def lab(request: pytest.FixtureRequest) -> LiveLab:
    return scripted(request.param)


ANSWER = """
const read = new Set(), recorded = settings => new Proxy(settings, {
  get: (all, name) => { read.add(name); return all[name]; }, has: (all, name) => name in all,
});
function answer(text) {
  const settings = JSON.parse(text), numbers = NUMBERS[data.kind](data, recorded(complete(data, settings)));
  return JSON.stringify([numbers, settingsLine(data, settings)]);
}
"""


def engine(lab: LiveLab) -> Any:
    """A JavaScript engine with the script and the lab's data; `answer` gives numbers and line of settings, as JSON."""
    context = quickjs.Context()
    context.eval(re.sub(r"^export (default .*)?", "", live.SCRIPT, flags=re.MULTILINE))
    context.eval(f"const data = {json.dumps(lab.data)}; {ANSWER}")
    return context


def random_values(lab: LiveLab, rng: np.random.Generator) -> dict[str, Any]:
    """Any values of the controls: a third of the sliders on a step, the others between; and beats that were dragged."""
    values = {name: control_value(control, rng) for name, control in lab.content.controls.items()}
    if values.get("mode") == "recommended" and lab.content.kind == "scoring":
        values["lag"] = float(rng.choice(one_clip.lags()))  # the verdict is computed at the slider's steps
    for name in WHOLE & set(values):
        values[name] = float(round(values[name]))
    if lab.content.kind == "scoring" and values["mode"] != "recommended" and rng.random() < 0.3:
        values["moves"] = random_moves(lab, values, rng)
    return values


def control_value(slider: live.Slider | live.Menu, rng: np.random.Generator) -> Any:
    if isinstance(slider, live.Menu):
        return list(slider.options)[int(rng.integers(len(slider.options)))]
    steps = round((slider.high - slider.low) / slider.step)
    if rng.random() < 1 / 3:
        return round(slider.low + int(rng.integers(steps + 1)) * slider.step, 6)
    return round(float(rng.uniform(slider.low, slider.high)), 4)  # smaller ones JavaScript writes in another way


def random_moves(lab: LiveLab, values: dict[str, Any], rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """One music beat and one visual beat, each moved to somewhere between its neighbours."""
    visual, moves = visual_beats(STAGE.motion, params=lab.content.params(**values)), {}
    for kind, times in (("music", STAGE.music.times), ("dance", visual.times)):
        beat = int(rng.integers(1, len(times) - 1))
        moves[kind] = {str(beat): float(rng.uniform(times[beat - 1] + 0.001, times[beat + 1] - 0.001))}
    return moves


def differences(ours: Any, theirs: Any, name: str = "") -> list[str]:
    """Names of what is not equal: numbers to 1e-9, all else exactly."""
    if isinstance(ours, dict):
        return [fault for key in ours for fault in differences(ours[key], theirs[key], f"{name}.{key}")]
    ours = ours.tolist() if isinstance(ours, np.ndarray | np.generic) else ours
    if isinstance(ours, list | tuple):
        if len(ours) != len(theirs):
            return [f"{name}: {len(ours)} and {len(theirs)}"]
        return [fault for one, other in zip(ours, theirs, strict=True) for fault in differences(one, other, name)]
    if isinstance(ours, float) and np.isnan(ours):
        ours = None
    is_equal = np.isclose(ours, theirs, rtol=1e-9, atol=1e-12) if isinstance(ours, float) else ours == theirs
    return [] if is_equal else [f"{name}: {ours} in Python, {theirs} in the script"]


def test_numbers_sentences_and_lines_of_random_settings_are_those_of_python(lab: LiveLab) -> None:
    rng, answer, wrong = np.random.default_rng(17), engine(lab).get("answer"), []
    for _ in range(50 if lab.content.kind in ("saliency", "corpus") else 100):
        lab.settings = values = random_values(lab, rng)
        numbers, line = json.loads(answer(json.dumps(values)))
        faults = differences(lab.numbers, numbers) + differences(lab.line, line, "line")
        wrong += [(values, faults)] if faults else []
    assert wrong == []


def test_numbers_sentences_and_lines_of_every_preset_are_those_of_python(lab: LiveLab) -> None:
    answer, presets = engine(lab).get("answer"), lab.content.presets
    assert len(presets) > 5
    for preset in presets:
        lab.settings = dict(lab.content.start)
        lab.set(**preset.values)
        numbers, line = json.loads(answer(json.dumps(lab.settings)))
        assert differences(lab.numbers, numbers) + differences(lab.line, line, "line") == [], preset.label


@pytest.mark.parametrize("lab", sorted(live.FORMULAS), indirect=True)
def test_the_formulas_read_every_setting_that_is_declared_for_them(lab: LiveLab) -> None:
    context, rng = engine(lab), np.random.default_rng(1)
    for _ in range(30):
        context.get("answer")(json.dumps(random_values(lab, rng)))
    formulas = {formula for formulas in live.FORMULAS[lab.content.kind].values() for formula in formulas}
    assert set(json.loads(context.eval("JSON.stringify([...read])"))) >= {
        name for formula in formulas for name in live.READS[formula]
    }


@cases(
    "settings, name, fault",
    ("{ delay: 1 }", "delay", "the formula place reads delay, which READS in live.py does not declare"),
    ("{ beta: 1 }", "lag", "the formula place reads lag, which has no value"),
)
def test_a_formula_that_reads_what_it_does_not_declare_stops(settings: str, name: str, fault: str) -> None:
    context = engine(scripted("meter"))
    with pytest.raises(quickjs.JSException, match=fault):
        context.eval(f'declared({settings}, "place").{name}')


@cases(
    "kind, control, readers",
    ("scoring", "every", "(detector, salient music, salient dance, hits, verdict); those that read it: meter"),
    ("corpus", "detector", "(salient music, salient dance, hits, corpus, place); those that read it: detector"),
    ("saliency", "clock", "(salient music, salient dance); those that read it: none of any lab"),
)
def test_a_control_that_no_formula_of_the_lab_reads_is_refused(kind: str, control: str, readers: str) -> None:
    content = scripted(kind).content
    slider = live.Slider("how fast", "n", 0.0, 1.0, 0.1)
    fault = f"the {kind} lab has a control {control} that none of its formulas reads {readers}; leave the control out"
    refused(re.escape(fault), replace, content, controls={**content.controls, control: slider})


def test_a_menu_without_the_value_of_a_mode_is_refused() -> None:
    content = scripted("scoring").content
    controls = {**content.controls, "position_smoothing": CONTROLS["position_smoothing"]}
    refused(r"position_smoothing must be one of 0\.0, 0\.05, .*; got 0\.06", replace, content, controls=controls)
