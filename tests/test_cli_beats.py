"""`harmolab beats` and `harmolab tap`: what they print and write, and what they refuse to write over."""

import json
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from typer.testing import Result

from harmolab.cli import app
from harmolab.readers.beats import load_annotation
from harmolab.types import Audio
from tests.builders import called, cases
from tests.test_listening_presenting import ask


@pytest.fixture
def song(tmp_path: Path, click_track: Callable[..., Audio]) -> Path:
    """Twenty seconds of clicks, 90 a minute from 0 s on."""
    soundfile.write(tmp_path / "song.wav", 0.9 * click_track(90, seconds=20.0).samples, 22050)
    return tmp_path / "song.wav"


def run(*arguments: object) -> Result:
    return called(app, *arguments)


def test_tempo_steadiness_and_one_are_printed_and_written(song: Path):
    out = song.with_suffix(".beats")
    # Any "one" will do: 14.1 s is near the 22nd beat, so the first of a bar of three is the first.
    result = run("beats", song, "--dance", "waltz", "--one", 14.1, "--out", out)
    assert result.exit_code == 0, result.output
    line, rest = result.output.split("\n", 1)
    assert re.fullmatch(r'(89\.9|90\.[01]) bpm, steady \(100% of tracked beats .*\); "one" known, 3 beats a bar', line)
    assert rest == f"wrote {out}\n"
    assert out.read_text().startswith(f"# written by harmolab: song.wav: {line}\n")
    annotation = load_annotation(out)
    np.testing.assert_allclose(annotation.times, 2 / 3 * np.arange(30)[-annotation.times.size :], atol=0.02)
    near = np.abs(annotation.times - 14.0).argmin()
    assert annotation.bar_places()[near] == 0


def test_without_the_dance_the_octave_is_said_to_be_open(song: Path):
    result = run("beats", song)
    assert '"one": not known' in result.output
    assert "The sound alone does not tell this tempo from 45 or 180: --dance decides." in result.output


def test_written_beats_are_read_again_and_clicks_lie_on_them(song: Path):
    written, clicks = song.with_suffix(".beats"), song.with_name("clicks.wav")
    written.write_text("1.25 1\n2.25 2\n3.25 3\n")
    result = run("beats", song, "--beats", written, "--clicks", clicks)
    assert result.output == f'annotated, 60.0 bpm; "one" known, 3 beats a bar\nwrote {clicks}\n'
    samples, rate = soundfile.read(clicks)
    assert rate == 22050
    assert np.abs(samples[round(1.251 * rate) : round(1.256 * rate)]).max() > 0.2
    assert np.abs(samples[: round(1.249 * rate)]).max() < 0.51


@cases(
    "options, fault",
    (("--out", "song.wav"), "is an input here"),
    (("--out", "diary.beats"), "is there already, and not of harmolab"),
    (("--clicks", "song.wav"), "is an input here"),
    (("--beats", "b.beats", "--out", "b.beats"), "is an input here"),
    (("--one", 3.0), "say how long the bars are with --dance"),
    (("--one", 300.0, "--dance", "waltz"), "no beat is near"),
    (("--dance", "polka"), "unknown dance 'polka'"),
    (("--tracker", "beat_this", "--one", 3.0), "finds the beats and the bars itself"),
    (("--beats", "hello.txt"), "hello.txt: holds no beats"),
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(
    song: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[object, ...], fault: str
):
    monkeypatch.chdir(song.parent)
    contents = {"diary.beats": "dear diary", "b.beats": "1.0\n2.0\n", "hello.txt": "hello"}
    for name, content in contents.items():
        Path(name).write_text(content)
    before = song.read_bytes()
    result = run("beats", song, *options)
    assert result.exit_code == 2
    assert fault in result.stderr
    assert result.stderr.count("\n") == 1
    assert song.read_bytes() == before
    assert {name: Path(name).read_text() for name in contents} == contents
    assert len(list(song.parent.iterdir())) == 4


def test_score_counts_bars_from_one(song: Path, tmp_path: Path):
    from tests.builders import planted_dance, write_dance

    dance = write_dance(tmp_path / "dance.bvh", planted_dance())
    result = run("score", song, dance, "--one", 300, "--dance", "waltz")
    assert result.exit_code == 2
    assert '"one" at 300 s: no beat is near' in result.stderr


def tapping(monkeypatch: pytest.MonkeyPatch, *contents: dict[str, Any]) -> list[tuple[int, str]]:
    """The replies that a person's browser gets, who opens the page and sends these taps one after the other."""
    replies: list[tuple[int, str]] = []

    def browse(address: str) -> None:
        def person() -> None:
            assert ask(address, "GET")[0] == 200
            replies.extend(ask(address, "POST", json.dumps(content)) for content in contents)

        threading.Thread(target=person, daemon=True).start()

    monkeypatch.setattr("webbrowser.open", browse)
    return replies


def test_taps_are_saved_as_beats_of_the_whole_song(song: Path, monkeypatch: pytest.MonkeyPatch):
    taps = [2 / 3 * beat + 0.02 for beat in range(6, 20)]
    replies = tapping(monkeypatch, {"taps": [1.0], "ones": []}, {"taps": taps, "ones": [taps[1], taps[4]]})
    out = song.with_suffix(".beats")
    result = run("tap", song, "--out", out, "--meter", 3)
    assert result.exit_code == 0, result.output
    assert replies[0] == (400, "1 taps are too few; tap 8 beats or more")
    status, text = replies[1]
    assert status == 200
    assert re.fullmatch(rf'wrote {out}: annotated, (89\.9|90\.[01]) bpm; "one" known, 3 beats a bar\.', text)
    assert text in result.output
    annotation = load_annotation(out)
    assert annotation.times.size >= 29
    assert np.abs(annotation.times / (2 / 3) - np.round(annotation.times / (2 / 3))).max() < 0.03
    assert annotation.bar_places()[np.abs(annotation.times - taps[1]).argmin()] == 0


@cases("name, fault", ("x.txt", "a file of beats is written as .beats"), ("no/x.beats", "no such folder"))
def test_a_place_that_cannot_be_written_is_refused_before_anyone_taps(
    song: Path, monkeypatch: pytest.MonkeyPatch, name: str, fault: str
):
    replies = tapping(monkeypatch)
    result = run("tap", song, "--out", song.parent / name)
    assert result.exit_code == 2
    assert fault in result.stderr
    assert replies == []
