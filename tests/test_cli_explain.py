"""`harmolab explain`: the words, the numbers, the page, and one line where it cannot be done."""

import html
import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from harmolab.cli import app
from harmolab.types import Clip
from tests.builders import cases, planted_dance, write_dance, write_song


@pytest.fixture
def files(planted_clip: Clip, tmp_path: Path) -> tuple[Path, Path]:
    """Song and motion of six seconds of a synthetic cha-cha."""
    return write_song(tmp_path / "song.wav", planted_clip), write_dance(tmp_path / "dance.npz", planted_clip)


@pytest.fixture
def long_files(tmp_path: Path) -> tuple[Path, Path]:
    """Song and motion of 20 seconds, enough beats for a verdict."""
    clip = planted_dance(seconds=20.0)
    return write_song(tmp_path / "song.wav", clip), write_dance(tmp_path / "dance.npz", clip)


def explain(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["explain", *map(str, arguments)])


def test_words_are_printed_and_the_page_is_written(long_files: tuple[Path, Path], tmp_path: Path):
    short = explain(*long_files, "--offset", 0).stdout.splitlines()
    result = explain(*long_files, "--offset", 0, "--out", tmp_path / "page.html", "--verbose")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[: len(short)] == short
    verdict, *remarks, placement = short
    music, *words = result.stdout.splitlines()[len(short) :]
    assert music.startswith("music: ") and music.endswith('"one": not known')
    assert verdict.startswith("You are on the beat: slow on it, fastest ")
    assert len(remarks) <= 3 and remarks[0].startswith("How sure: harmony above chance ")
    assert placement == "Your dance begins at 0.00 s of the song, as you said."
    assert any(line.startswith("Harmony above chance is ") for line in words)
    assert words[-1] == f"wrote {tmp_path / 'page.html'}"
    page = (tmp_path / "page.html").read_text("utf-8")
    assert verdict in page
    assert all(remark in html.unescape(page) for remark in remarks)


def test_json_holds_the_same(long_files: tuple[Path, Path]):
    told = json.loads(explain(*long_files, "--offset", 0, "--json").stdout)
    assert told["verdict"].startswith("You are on the beat: slow on it")
    assert (told["level"], told["reading"]) == (4, "rest")
    assert (told["offset"]["source"], told["findings"][-1]["kind"]) == ("given", "hits")
    assert told["version"]


def test_few_beats_give_no_number_and_no_milliseconds(files: tuple[Path, Path]):
    result = explain(*files, "--offset", 0)
    assert result.stdout.startswith("Cannot tell: ")
    assert "ms" not in result.stdout.split()
    assert "above chance" not in result.stdout
    assert result.stdout.splitlines()[-1].startswith("Your dance begins at ")


def test_page_of_few_beats_has_no_milliseconds_either(files: tuple[Path, Path], tmp_path: Path):
    explain(*files, "--offset", 0, "--out", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text("utf-8")
    words = re.sub(r"<[^>]*>", " ", re.sub(r"(?s)<(style|script)\b.*?</\1>", "", page)).split()
    assert "Cannot" in words
    assert not {"ms", "late", "early"} & set(words)


def test_annotated_beats_take_the_place_of_tracking(files: tuple[Path, Path], planted_clip: Clip, tmp_path: Path):
    beats = tmp_path / "song.beats"
    beats.write_text("\n".join(f"{time:.4f}" for time in planted_clip.beats.times))
    told = json.loads(explain(*files, "--offset", 0, "--beats", beats, "--json").stdout)
    assert told["music_beats"] == len(planted_clip.beats)


def test_joints_can_be_chosen(files: tuple[Path, Path], planted_clip: Clip):
    first, second = planted_clip.motion.skeleton.joints[-2:]
    assert explain(*files, "--joints", f"{first}, {second}").exit_code == 0
    result = explain(*files, "--joints", "tail")
    assert result.exit_code == 2
    assert "no joints named ['tail']" in result.stderr


@cases(
    "options, told",
    (("--out", "page.pdf"), "the page is written as .html, .htm"),
    (("--out", "/nowhere/page.html"), "/nowhere: no such folder"),
    (("--search", "-1"), "dance.npz: search must lie between 0 and 600 s"),
    (("--offset", "1000"), "does not overlap"),
    (("--offset", "nan"), "--offset must be a finite number"),
    (("--beats", "none.beats"), "none.beats: no such file"),
)
def test_what_cannot_be_done_is_one_line(files: tuple[Path, Path], options: tuple[str, str], told: str):
    result = explain(*files, *options)
    assert result.exit_code == 2
    assert told in result.stderr
    assert result.stderr.strip().count("\n") == 0


@pytest.mark.parametrize("name", ["none.npz", "none.mp4", "none.json"])
def test_missing_dance_is_named(files: tuple[Path, Path], tmp_path: Path, name: str):
    result = explain(files[0], tmp_path / name)
    assert result.exit_code == 2
    assert f"{name}: no such file" in result.stderr


def test_damaged_video_is_named(files: tuple[Path, Path], tmp_path: Path):
    (tmp_path / "film.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(100))
    result = explain(files[0], tmp_path / "film.mp4")
    assert result.exit_code == 2
    assert "film.mp4: cannot be read as video" in result.stderr


def test_a_learnt_pattern_changes_the_score_and_an_unknown_one_is_named(long_files: tuple[Path, Path], tmp_path: Path):
    patterns = {"jive": {"beats": 1, "cosines": [1.0], "sines": [0.0], "source": "planted: fastest on the beat"}}
    (tmp_path / "patterns.json").write_text(json.dumps(patterns))
    asked = (*long_files, "--offset", 0, "--pattern", tmp_path / "patterns.json", "--json")
    fits, opposite = (
        json.loads(explain(*words).stdout)["harmony_above_chance"] for words in (asked[:4] + asked[-1:], asked)
    )
    assert opposite < 0 < fits
    result = explain(*asked, "--dance", "waltz")
    assert result.exit_code == 2
    assert "no pattern for --dance 'waltz'" in result.stderr
