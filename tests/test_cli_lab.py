"""`harmolab lab`: the sliders on a dance of one's own."""

import json
import re
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from harmolab.beats.salience import audio_mask
from harmolab.beats.visual import visual_beats
from harmolab.cli import app
from harmolab.lab.labs import live, one_clip
from harmolab.verdict.sentences import UNPLACED
from tests.builders import complaint, done, planted_dance, write_dance, write_song

succeed, refusal = partial(done, app), partial(complaint, app)


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    monkeypatch.chdir(tmp_path)
    clip = planted_dance(seconds=20.0)
    return write_song(tmp_path / "song.wav", clip), write_dance(tmp_path / "dance.npz", clip)


def data_of(page: Path) -> dict:
    return json.JSONDecoder().raw_decode(page.read_text("utf-8").partition('getElementById("lab"), ')[2])[0]


@pytest.mark.slow
def test_a_lab_of_a_dance_is_a_page_of_the_seconds_that_were_asked_for(pair: tuple[Path, Path]):
    assert "wrote " in succeed("lab", *pair, "--start", 2, "--seconds", 8, "--no-open").stdout
    (page,) = Path().glob("*_lab.html")
    data = data_of(page)
    assert (data["kind"], data["evidence"]["duration"]) == ("scoring", pytest.approx(8.0, abs=0.1))
    assert "<title>dance to song: the scoring lab</title>" in page.read_text("utf-8")
    assert {"lambda1", "lambda2", "delay", "beta", "lag"} <= data["start"].keys()
    assert not re.findall(r"""(?:src|href)=["'](?:https?:)?//""", page.read_text("utf-8"))


@pytest.mark.slow
def test_a_lab_opens_with_the_sentence_of_score(pair: tuple[Path, Path]):
    first = succeed("score", *pair, "--offset", 0).stdout.splitlines()[0]
    succeed("lab", *pair, "--offset", 0, "--no-open", "--out", "lab.html")
    data = data_of(Path("lab.html"))
    now = round((data["start"]["lag"] - live.LAG.low) / live.LAG.step)
    assert data["start"]["mode"] == "recommended"
    assert data["evidence"]["verdicts"][now]["sentence"] == first


@pytest.mark.slow
def test_a_lab_of_the_first_minute_alone_says_so_in_its_title(pair: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys.modules["harmolab.cli.common"], "OF_LAB", 5.0)
    for words, part in (((), ", first minute"), (("--seconds", 6), "")):
        succeed("lab", *pair, *words, "--no-open", "--out", "lab.html")
        assert data_of(Path("lab.html"))["title"] == f"dance to song{part}: the scoring lab"


@pytest.mark.slow
def test_a_dance_of_no_known_start_is_told_so_and_one_with_an_offset_is_not(pair: tuple[Path, Path]):
    assert "nothing says where in the song this dance begins" in succeed("lab", *pair, "--no-open").stderr
    verdicts = data_of(next(Path().glob("*_lab.html")))["evidence"]["verdicts"]
    assert {one["sentence"] for one in verdicts if one["level"] == 3} == {UNPLACED}
    assert all(one["level"] <= 3 and one["late"] is None for one in verdicts)
    assert "begins" not in succeed("lab", *pair, "--offset", 0, "--no-open").stderr


def test_a_lab_spares_its_inputs_and_is_a_page(pair: tuple[Path, Path]):
    assert "the lab is written as .html, .htm" in refusal("lab", *pair, "--out", "x.pdf", "--no-open")
    assert "no such file" in refusal("lab", "none.wav", pair[1], "--no-open")
    assert "is too much, got 601; a lab shows 600 at most" in refusal("lab", *pair, "--seconds", 601, "--no-open")


@pytest.mark.slow
def test_the_sliders_of_the_thresholds_end_where_nothing_is_left():
    stage = live.Stage.of(planted_dance(seconds=20.0))
    controls = one_clip.scoring_content(stage).controls
    strengths = stage.music.strengths / stage.music.strengths.max()
    ends = {name: controls[name].high for name in ("lambda1", "lambda2")}
    assert not audio_mask(strengths, threshold=ends["lambda1"]).any()
    assert ends["lambda1"] == 2.0 or audio_mask(strengths, threshold=ends["lambda1"] - 0.3).any()
    steps = np.abs(np.diff(visual_beats(stage.motion, params=live.lab_params("paper")).strengths))
    assert 2.0 <= ends["lambda2"] <= 15.0 and steps.max() / steps.std() < ends["lambda2"]


def test_a_track_of_equal_or_no_strengths_keeps_the_slider():
    for heights in (np.ones(5), np.zeros(0)):
        assert live.last_lambda(heights, live.LAMBDA1) == live.LAMBDA1
