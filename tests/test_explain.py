"""Findings in words, and the command that prints them."""

import html
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from harmolab.cli import app
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.explain.performance import Explanation, explain
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.types import Clip
from harmolab.verdict.judge import score_motion, without_start
from tests.builders import cases, complaint, done, planted_dance, refused, still, write_dance, write_song

SECONDS = 24.0
TIMING = re.compile(r"\b(ms|early|late|later|earlier)\b")


CLIP = planted_dance(seconds=SECONDS, seed=5)
MUSIC = CLIP.beats


def score_of(ends: np.ndarray) -> HarmonyScore:
    """The score of a dancer whose movements end at these times."""
    motion = synthetic_motion(np.sort(ends), seconds=SECONDS, fps=60, seed=5, dance="cha-cha")
    return score_motion(MUSIC, motion, params=HarmonyParams.recommended(HOW_PATTERNS["rest"]))


def kinds_of(words: Explanation) -> list[str]:
    return [finding.kind for finding in words.findings]


def value_of(words: Explanation, kind: str) -> float:
    return next(finding.value for finding in words.findings if finding.kind == kind)


def test_dancer_who_falls_80_ms_behind_in_the_second_half_hears_of_it():
    score = score_of(MUSIC.times + 0.08 * (MUSIC.times >= SECONDS / 2))
    words = explain(score)
    (change,) = [finding for finding in words.findings if finding.kind == "change"]
    assert change.value == pytest.approx(0.08, abs=0.015)
    assert change.interval[0] > 0
    assert re.fullmatch(r"In the second half you are \d\d ms later than in the first\.", change.sentence)
    assert [half.mean for half in words.halves] == pytest.approx([0.0, 0.08], abs=0.015)
    unplaced = explain(without_start(score))  # without a known place in the song
    assert (kinds_of(unplaced), unplaced.halves) == (["tempo", "rate", "change"], ())


@pytest.mark.parametrize("shift", [0.0, 0.08, -0.08])
def test_a_constant_lag_is_that_of_the_judgement_and_no_change(shift: float):
    score = score_of(MUSIC.times + shift)
    words = explain(score)
    assert value_of(words, "lag") == score.judgement.lag_s == pytest.approx(shift, abs=0.02)
    assert "change" not in kinds_of(words)
    assert [half.mean for half in words.halves] == pytest.approx([shift, shift], abs=0.02)


def test_steady_dancer_is_seldom_told_a_change_that_is_not_there():
    rng = np.random.default_rng(2)
    words = [explain(score_of(MUSIC.times + rng.normal(0, 0.03, len(MUSIC)))) for _ in range(6)]
    assert sum("change" in kinds_of(one) for one in words) <= 1


def test_a_dancer_a_quarter_beat_late_is_not_said_to_have_jumped():
    rng = np.random.default_rng(0)
    words = explain(score_of(MUSIC.times + 15 / MUSIC.tempo + rng.normal(0, 0.005, len(MUSIC))))
    assert "change" not in kinds_of(words)


@pytest.mark.parametrize("seed", range(4))
def test_movement_out_of_time_is_given_no_milliseconds_and_no_side(seed: int):
    score = score_of(np.random.default_rng(seed).uniform(0, SECONDS, len(MUSIC)))
    words = explain(score)
    assert score.judgement.level < 3
    assert (kinds_of(words)[:2], words.halves) == (["score", "tempo"], ())
    assert TIMING.search(" ".join([score.judgement.verdict, *words.sentences])) is None


def test_too_little_to_judge_has_no_findings():
    assert explain(score_motion(MUSIC, still(1440, fps=60.0))) == Explanation()
    assert explain(score_motion(MUSIC.span(0.0, 5.0), CLIP.motion.span(0.0, 5.0))) == Explanation()


def test_beats_met_are_the_pairs_of_the_score():
    ends = MUSIC.times.copy()
    ends[10] += 0.18  # one rest too far away
    score = score_of(ends)
    met = int((score.pairs >= 0).sum())
    finding = explain(score).findings[-1]
    assert finding.kind == "hits"
    assert finding.sentence.startswith(f"{met} of {len(MUSIC)} beats have a rest within 100 ms")
    assert finding.value == met / len(MUSIC) < 1


def test_a_dancer_steadily_late_hears_no_count_of_beats_missed():
    score = score_of(MUSIC.times + 0.1)
    assert score.judgement.level == 3
    assert "hits" not in kinds_of(explain(score))


def test_rate_and_number_are_those_of_the_judgement():
    score = score_of(MUSIC.times)
    words = explain(score)
    assert value_of(words, "rate") == score.judgement.time.rate == 1.0
    assert value_of(words, "score") == score.harmony_above_chance
    assert f"Harmony above chance is {score.harmony_above_chance:.2f} (" in words.sentences[0]
    assert "by its bars" in words.sentences[0]
    assert "95 %" not in str(words)


def test_half_a_beat_is_neither_late_nor_early():
    (finding,) = (one for one in explain(score_of(MUSIC.times + 30 / MUSIC.tempo)).findings if one.kind == "lag")
    assert re.fullmatch(r"You are \d+ ms off, about half a beat: neither late nor early\.", finding.sentence)


def test_an_expected_lag_is_no_lateness():
    late = synthetic_motion(MUSIC.times + 0.08, seconds=SECONDS, fps=60, seed=5, dance="cha-cha")
    score = score_motion(MUSIC, late, params=replace(HarmonyParams.recommended(HOW_PATTERNS["rest"]), lag=0.08))
    assert value_of(explain(score), "lag") == pytest.approx(0.0, abs=0.02)


def test_a_score_without_a_judgement_is_refused():
    score = score_motion(MUSIC, CLIP.motion, params=HarmonyParams.valleys())
    refused("words need a score of measure 'shape', got 'hits'", explain, score)


# The command


def song_and_dance(folder: Path, clip: Clip) -> tuple[Path, Path]:
    return write_song(folder / "song.wav", clip), write_dance(folder / "dance.npz", clip)


@pytest.fixture(scope="module")
def files(planted_clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Song and motion of six seconds of a synthetic cha-cha."""
    return song_and_dance(tmp_path_factory.mktemp("short"), planted_clip)


@pytest.fixture(scope="module")
def long_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Song and motion of 20 seconds, enough beats for a verdict."""
    return song_and_dance(tmp_path_factory.mktemp("long"), planted_dance(seconds=20.0))


explained = partial(done, app, "score", "--why", "page.html")
unexplained = partial(complaint, app, "score", "--why", "page.html")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_words_are_printed_and_the_page_is_written(long_files: tuple[Path, Path], tmp_path: Path):
    *short, written = explained(*long_files, "--offset", 0).stdout.splitlines()
    result = explained(*long_files, "--offset", 0, "--verbose")
    assert result.stdout.splitlines()[: len(short)] == short
    verdict, *remarks, placement = short
    music, *words = result.stdout.splitlines()[len(short) :]
    assert music.startswith("music: ") and music.endswith('"one": not known')
    assert verdict.startswith("You are on the beat: slow on it, fastest ")
    assert len(remarks) <= 3 and remarks[0].startswith("How sure: harmony above chance ")
    assert placement == "Your dance begins at 0.00 s of the song, as you said."
    assert any(line.startswith("Harmony above chance is ") for line in words)
    assert words[-1] == written == "wrote page.html"
    page = (tmp_path / "page.html").read_text("utf-8")
    assert verdict in page
    assert all(remark in html.unescape(page) for remark in remarks)


def test_json_holds_the_same(long_files: tuple[Path, Path]):
    told = json.loads(explained(*long_files, "--offset", 0, "--json").stdout)
    assert told["verdict"].startswith("You are on the beat: slow on it")
    assert (told["level"], told["reading"]) == (4, "rest")
    assert (told["offset"]["source"], told["findings"][-1]["kind"]) == ("given", "hits")
    assert told["version"]


def test_few_beats_give_no_number_and_no_milliseconds_on_the_page_either(files: tuple[Path, Path], tmp_path: Path):
    result = explained(*files, "--offset", 0)
    assert result.stdout.startswith("Cannot tell: ")
    assert "ms" not in result.stdout.split()
    assert "above chance" not in result.stdout
    assert result.stdout.splitlines()[-2].startswith("Your dance begins at ")
    page = (tmp_path / "page.html").read_text("utf-8")
    words = re.sub(r"<[^>]*>", " ", re.sub(r"(?s)<(style|script)\b.*?</\1>", "", page)).split()
    assert "Cannot" in words
    assert not {"ms", "late", "early"} & set(words)


def test_annotated_beats_take_the_place_of_tracking(files: tuple[Path, Path], planted_clip: Clip, tmp_path: Path):
    beats = tmp_path / "song.beats"
    beats.write_text("\n".join(f"{time:.4f}" for time in planted_clip.beats.times))
    told = json.loads(explained(*files, "--offset", 0, "--beats", beats, "--json").stdout)
    assert told["music_beats"] == len(planted_clip.beats)


def test_joints_can_be_chosen(files: tuple[Path, Path], planted_clip: Clip):
    first, second = planted_clip.motion.skeleton.joints[-2:]
    assert explained(*files, "--joints", f"{first}, {second}")
    assert "no joints named ['tail']" in unexplained(*files, "--joints", "tail")


@cases(
    "options, told",
    (("--why", "page.pdf"), "the page is written as .html, .htm"),
    (("--why", "/nowhere/page.html"), "/nowhere: no such folder"),
    (("--plot", "x.png"), "--plot goes without --why"),
    (("--search", "-1"), "dance.npz: search must lie between 0 and 600 s"),
    (("--offset", "1000"), "does not overlap"),
    (("--offset", "nan"), "--offset must be a finite number"),
    (("--beats", "none.beats"), "none.beats: no such file"),
)
def test_what_cannot_be_done_is_one_line(files: tuple[Path, Path], options: tuple[str, str], told: str):
    assert told in unexplained(*files, *options)


@cases(
    "name, fault",
    *((f"none.{ending}", "no such file") for ending in ("npz", "mp4", "json")),
    ("film.mp4", "cannot be read as video"),
)
def test_missing_dance_and_damaged_video_are_named(files: tuple[Path, Path], tmp_path: Path, name: str, fault: str):
    (tmp_path / "film.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(100))
    assert f"{name}: {fault}" in unexplained(files[0], tmp_path / name)


@pytest.mark.slow
def test_a_learnt_pattern_changes_the_score_and_an_unknown_one_is_named(long_files: tuple[Path, Path], tmp_path: Path):
    patterns = {"jive": {"beats": 1, "cosines": [1.0], "sines": [0.0], "source": "planted: fastest on the beat"}}
    (tmp_path / "patterns.json").write_text(json.dumps(patterns))
    plain = (*long_files, "--offset", 0, "--json")
    asked = (*plain, "--pattern", tmp_path / "patterns.json")
    fits, opposite = (json.loads(explained(*words).stdout)["harmony_above_chance"] for words in (plain, asked))
    assert opposite < 0 < fits
    assert "no pattern for --dance 'waltz'" in unexplained(*asked, "--dance", "waltz")
