"""Records show themselves: one line of text, and in Jupyter a player or a picture."""

import base64
import io
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache, partial
from html import unescape

import numpy as np
import pytest
import soundfile
from IPython.core.formatters import DisplayFormatter

from harmolab.body.skeletons import Skeleton
from harmolab.params import HarmonyParams
from harmolab.types import Audio, BeatTrack, Clip, Display, Motion
from harmolab.verdict.judge import Judgement, score_clip
from tests.builders import cases, planted_dance, still, track

HOSTILE = "</script><img src=x onerror=alert(1)>\n\"'&\udc80" * 20
MARKS = ("<img src=x",)  # of the name, where it is not escaped
dance = partial(planted_dance, seconds=12.0)


@cache
def records() -> list[Display]:
    """One of each kind, with hostile words where it has words."""
    clip = replace(dance(), name=HOSTILE, dance=HOSTILE, source=HOSTILE)
    score = score_clip(dance())
    hits = score_clip(dance(), HarmonyParams())
    return [clip, replace(clip, motion=None), clip.audio, clip.motion, clip.beats, score, hits, score.judgement]


def sound_of(html: str) -> np.ndarray:
    """The samples of the only sound that a page embeds."""
    data = re.search(r'src="data:audio/ogg;base64,([^"]+)"', html)[1]
    return soundfile.read(io.BytesIO(base64.b64decode(data)))[0]


# As text


def test_each_record_is_one_short_line():
    for record in records():
        assert "\n" not in repr(record) and len(repr(record)) < 160


def test_lines_say_what_was_planted():
    audio = Audio(np.zeros(5000), 2000.0)
    motion = Motion(np.zeros((30, 4, 3)), 15.0, Skeleton.unnamed(4), [0] + [1] * 29)
    beats = track([0.5, 1.0, 1.5], duration=2.5, bar_places=[0, 1, 2])
    assert repr(audio) == "Audio(2.50 s, 2000 Hz)"
    assert repr(motion) == "Motion(2.00 s, 30 frames at 15 fps, 4 joints in 3D, 1 frames of filler)"
    assert repr(beats) == "BeatTrack(3 beats in 2.50 s, 120.0 a minute, bars of 3)"
    assert repr(replace(beats, fit=0.5, bar_places=None)).endswith("120.0 a minute, unsure)")
    assert repr(track([], duration=2.5, bar_places=[])) == "BeatTrack(0 beats in 2.50 s)"
    assert repr(Clip("a", audio, motion, 0.5, beats=beats, dance="waltz")) == (
        "Clip('a', 2.50 s of music, 2.00 s of motion at 15 fps from 0.50 s, 3 beats, 'waltz')"
    )
    assert repr(Clip("a", audio)) == "Clip('a', 2.50 s of music)"


def test_score_says_its_sentence_or_its_hits():
    score, hits = score_clip(dance("jive", seconds=30.0)), score_clip(dance("jive", seconds=30.0), HarmonyParams())
    assert repr(score.judgement) == f"Judgement({score.judgement.level} of 4: {score.judgement.verdict})"
    assert repr(score).endswith(f" above chance, {score.judgement!r})")
    assert f"h = {hits.harmony:.2f}, {hits.hits.sum()} of {len(hits.music)} music beats met" in repr(hits)


# As HTML


def test_hostile_words_stay_words_and_nothing_is_asked_of_the_network():
    for record in records():
        html = record._repr_html_()
        page = unescape("".join(re.findall(r' srcdoc="([^"]*)"', html)))
        assert not any(mark in part for mark in MARKS for part in (html, page)), repr(record)
        html.encode("utf-8")  # a name of a file may hold what is no text
        assert re.findall(r"""(?:src|href)=["'](?!data:)([^"']+)""", html) == []


def test_sound_plays_as_it_is():
    tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    samples = sound_of(Audio(tone, 22050.0)._repr_html_())
    assert samples.size == 22050
    assert np.corrcoef(samples, tone)[0, 1] > 0.99


@pytest.mark.slow
def test_what_is_long_is_cut_to_a_minute_and_it_is_said():
    clip = planted_dance("jive", seconds=66.0, fps=15.0)
    for record in (clip, clip.audio, clip.beats, score_clip(clip)):
        html = record._repr_html_()
        assert "Below: the first 60 s of 66 s." in html
        assert len(html) < 2e6
    assert sound_of(clip.audio._repr_html_()).size == 60 * clip.audio.sample_rate


@pytest.mark.parametrize("rate", [1000.0, 1e6])
def test_sound_of_a_rate_that_no_browser_plays_says_so(rate: float):
    html = Audio(np.zeros(5000), rate)._repr_html_()
    assert "3000 to 192000 Hz" in html and "<audio" not in html


def test_clip_is_a_player_and_without_motion_its_sound():
    clip = dance()
    assert re.search(r"<iframe .*&#34;ogg&#34;: &#34;|<iframe .*ogg&quot;: &quot;", clip._repr_html_(), re.DOTALL)
    assert "synthetic" in clip._repr_html_().partition("<iframe")[0]
    alone = replace(clip, motion=None)._repr_html_()
    assert "<audio controls" in alone and "there is no motion" in alone


def test_judgement_is_its_verdict_and_its_remarks():
    judgement = score_clip(dance("jive", seconds=30.0)).judgement
    texts = re.findall(r"<div>(.*?)</div>", judgement._repr_html_().replace("&#x27;", "'"))
    assert texts == [f"<b>{judgement.verdict} (level {judgement.level} of 4)</b>", *judgement.remarks]


@cases(
    "record",
    BeatTrack([], [], 100.0, 5.0),
    BeatTrack([1.0], [0.0], 100.0, 5.0, [0]),
    still(2, fps=15.0),
    still(30, fps=15.0, axes=2),
    Motion(np.zeros((5, 1, 3)), 15.0, Skeleton.unnamed(1)),
    Judgement(0, BeatTrack([], [], 100.0, 5.0)),
    ids=lambda record: f"{type(record).__name__}",
)
def test_little_or_nothing_is_drawn_too(record: Display):
    assert record._repr_html_().startswith("<div><b>")


def test_score_without_a_beat_is_drawn_too():
    silent = replace(dance(), beats=BeatTrack([], [], 100.0, 12.0))
    assert 'src="data:image/png;base64,' in score_clip(silent, HarmonyParams())._repr_html_()


# Where it is asked for


def test_text_loads_nothing_of_the_laboratory():
    code = (
        "import sys, harmolab.types as t; repr(t.Clip('a', t.Audio([0.0], 8000.0)));"
        "print(*[name for name in sys.modules if name.startswith(('matplotlib', 'harmolab.lab', 'IPython'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_cell_of_a_notebook_shows_a_player():
    data, _ = DisplayFormatter().format(planted_dance("jive", seconds=6.0, fps=15.0))
    assert data["text/plain"].startswith("Clip('jive 1', 6.00 s of music, 6.00 s of motion at 15 fps")
    assert "<iframe" in data["text/html"]
