"""One dance, one number: every command gives the same harmony above chance to the same dance, song and beats."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.cli import app
from harmolab.clips import score_files
from harmolab.data.recordings import find_recordings, load_recording
from harmolab.data.synthetic import synthetic_motion, write_corpus
from harmolab.lab.compare.scores import hit_scores
from harmolab.lab.compare.windows import cut_clips
from harmolab.lab.evaluate import measured
from harmolab.lab.evaluate.pairing import Pair
from harmolab.lab.evaluate.rows import RowOptions, clip_row
from harmolab.lab.labs.live import Stage
from harmolab.lab.player_data import of_dance
from harmolab.lab.render.video import retime_files
from harmolab.params import HarmonyParams
from harmolab.readers.beats import load_annotation
from harmolab.readers.motion import load_motion, load_offset, save_motion
from harmolab.readers.motion_file import MotionFile
from harmolab.readers.video import write_video
from harmolab.types import Motion
from harmolab.verdict.judge import score_clip, score_motion
from harmolab.verdict.sentences import UNPLACED
from tests.builders import BODY, called, cases, planted_dance, waving, write_song

SECONDS, FPS = 32.0, 30.0
TIMES = np.arange(round(SECONDS * FPS)) / FPS
run = partial(called, app)


def turning(phase: np.ndarray) -> Motion:
    """A statue that turns to and fro, at rest at whole units of the phase."""
    angle = np.cos(np.pi * phase)[:, None]
    x, z = BODY[:, 0], BODY[:, 2]
    turned = [x * np.cos(angle) + z * np.sin(angle), np.broadcast_to(BODY[:, 1], (phase.size, 6))]
    return Motion(np.stack([*turned, z * np.cos(angle) - x * np.sin(angle)], axis=-1), FPS, Skeleton.unnamed(len(BODY)))


def noise() -> Motion:
    """Hands that go anywhere, smoothly."""
    rng = np.random.default_rng(4)
    return waving(np.interp(TIMES, np.arange(0, 40), np.cumsum(rng.uniform(0.4, 2.4, 40))))


def dances(beats: np.ndarray) -> dict[str, tuple[Motion, float, tuple[str, ...]]]:
    """Name -> motion, song time of its first frame, and options."""
    phase = np.interp(TIMES, beats, np.arange(beats.size))
    late = synthetic_motion(beats + 0.08, seconds=SECONDS, fps=FPS, dance="cha-cha", seed=2)
    clip = planted_dance(seconds=SECONDS, fps=FPS, seed=2)
    return {
        "dancer": (clip.motion, 0.0, ()),
        "dancer, dance told": (clip.motion, 0.0, ("--dance", "cha-cha")),
        "begins later": (clip.motion.span(3.0, SECONDS), 3.0, ()),
        "begins before the song": (waving(phase), -1.0, ()),
        "late": (late, 0.0, ()),
        "hits": (waving(phase + 0.5), 0.0, ()),
        "statue": (turning(phase), 0.0, ()),
        "noise": (noise(), 0.0, ("--dance", "cha-cha")),
        "one told": (clip.motion, 0.0, ("--dance", "cha-cha", "--one", f"{beats[8]:.2f}")),
    }


CASES = tuple(dances(np.arange(60) * 0.5))
LEVELS = {"dancer": 4, "dancer, dance told": None, "hits": 3, "statue": 0, "noise": 1}


@pytest.fixture(scope="module")
def song(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_song(tmp_path_factory.mktemp("song") / "song.wav", planted_dance(seconds=SECONDS, fps=FPS, seed=2))


def number_of_page(path: Path) -> dict[str, Any]:
    data = json.loads(re.search(r"^const data = (.*);$", path.read_text("utf-8"), flags=re.MULTILINE)[1])
    return dict(data["dancers"][0]["number"])


def numbers(song: Path, motion: Path, *options: object) -> dict[str, dict[str, Any]]:
    """Command -> harmony above chance, level and verdict of a dance."""
    page, bent = motion.with_suffix(".html"), motion.with_name("bent.npz")
    results = [
        run("score", song, motion, *options, "--json", "--mode", "recommended"),
        run("score", song, motion, *options, "--why", page.with_stem("why"), "--json"),
        run("play", song, motion, *options, "--out", page),
    ]
    assert [result.exit_code for result in results] == [0, 0, 0], [result.output for result in results]
    dance, one = (options[options.index(name) + 1] if name in options else None for name in ("--dance", "--one"))
    told = {"dance": str(dance or ""), "one": None if one is None else float(str(one))}
    before = retime_files(song, motion, bent, strength=0.0, **told).before.to_dict()
    score, explained = json.loads(results[0].stdout)["recommended"], json.loads(results[1].stdout)
    played = number_of_page(page)
    assert played["verdict"] == of_dance(score["verdict"])  # which nobody may have danced who opens the page
    return {"score": score, "explain": explained, "play": played | {"verdict": score["verdict"]}, "retime": before}


def assert_one(results: dict[str, dict[str, Any]]) -> None:
    """All commands agree, to rounding, in the number, the level and the words."""
    values = [result["harmony_above_chance"] for result in results.values()]
    if values[0] is None:
        assert values == [None] * len(values)
    else:
        np.testing.assert_allclose(values, values[0], rtol=0, atol=1e-9, err_msg=str(list(results)))
    assert len({(result["level"], result["verdict"]) for result in results.values()}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_every_command_gives_a_dance_the_same_number(case: str, song: Path, tmp_path: Path) -> None:
    motion, offset, options = dances(planted_dance(seconds=SECONDS, fps=FPS, seed=2).beats.times)[case]
    save_motion(tmp_path / "dance.npz", motion, offset=offset)
    results = numbers(song, tmp_path / "dance.npz", *options)
    assert_one(results)
    assert LEVELS.get(case) in (None, results["score"]["level"])


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--dance", "cha-cha")], ids=["nothing told", "dance told"])
def test_no_command_judges_the_place_in_the_beat_where_nothing_says_when_the_dance_begins(
    options: tuple[str, ...], song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = tmp_path / "dance.npz"
    save_motion(motion, dances(np.arange(60) * 0.5)["dancer"][0])
    results = numbers(song, motion, *options)
    assert {(result["level"], result["verdict"]) for result in results.values()} == {(3, UNPLACED)}
    placed = json.loads(run("score", song, motion, *options, "--offset", 0, "--json").stdout)["recommended"]
    assert placed["verdict"] != UNPLACED
    film, dancer = tmp_path / "silent.mp4", load_motion(motion)
    write_video(film, np.zeros((3, 32, 32, 3), np.uint8), FPS)
    monkeypatch.setattr("harmolab.lab.render.video.filmed_motion", lambda path, **_: MotionFile(dancer, "video"))
    retimed = retime_files(song, film, tmp_path / "bent.mp4", dance=options[-1] if options else "")
    assert {score.judgement.verdict for score in (retimed.before, retimed.after) if score.judgement} == {UNPLACED}


@pytest.mark.slow
@cases(
    "dancer, options",
    pytest.param((), (), id="salsa"),
    pytest.param(("--style", "puppet"), ("--dance", "cha-cha"), id="puppet"),
    pytest.param(("--system", "harmogan"), (), id="network"),
)
def test_a_generated_dance_keeps_its_number_without_an_offset_to_remember(
    dancer: tuple[str, ...], options: tuple[str, ...], song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "harmogan" in dancer:
        pytest.importorskip("torch")
    scored = Mock(wraps=measured.dance_scores)
    monkeypatch.setattr(measured, "dance_scores", scored)
    out = tmp_path / "dance.npz"
    result = run("dance", song, "--start", 2.5, "--seconds", 26, "--out", out, *dancer, *options, "--verbose")
    assert result.exit_code == 0, result.output
    assert load_offset(out) == 2.5
    assert load_motion(out).duration == pytest.approx(26, abs=0.1)
    results = numbers(song, out, *options)
    score = scored.call_args_list[0].args[2]
    number = None if np.isnan(score.above_chance) else score.above_chance
    words = {"level": score.judgement.level, "verdict": score.judgement.verdict}
    results["dance"] = {"harmony_above_chance": number, **words}
    assert_one(results)
    assert ("Not meaningful" in result.output) != (of_dance(results["dance"]["verdict"]) in result.output)


def paper_harmonies(folder: Path) -> dict[str, float]:
    """Command or function -> the paper's h of the one recording in a folder."""
    recording, params = load_recording(folder), HarmonyParams.paper()
    song, motion, beats = (folder / name for name in ("audio.wav", "motion.npz", "beats.json"))
    scored = {
        "score FOLDER": run("score", folder, "--mode", "paper", "--json"),
        "score SONG DANCE": run("score", song, motion, "--beats", beats, "--mode", "paper", "--json"),
    }
    assert [result.exit_code for result in scored.values()] == [0, 0], [result.output for result in scored.values()]
    (clip,) = cut_clips(recording, "annotated", None)
    return {
        **{name: json.loads(result.stdout)["paper"]["harmony"] for name, result in scored.items()},
        "score_clip": score_clip(recording.clip, params).harmony,
        "score_files": score_files(song, motion, beats=beats, params=params).harmony,
        "evaluate compare": float(hit_scores(clip, [clip.music()])["paper"][0]),
        "evaluate": float(clip_row(Pair("recorded", "", folder.name, motion, song), RowOptions())["paper_harmony"]),
        "lab": score_motion(Stage.of(recording.clip).music, Stage.of(recording.clip).motion, params=params).harmony,
    }


@pytest.mark.slow
def test_all_commands_print_one_h_for_a_recording_with_annotated_beats(tmp_path: Path) -> None:
    write_corpus(tmp_path, clips=1, seconds=11.0, seed=3)
    (folder,) = find_recordings(tmp_path).folders
    harmonies = paper_harmonies(folder)
    values = [*harmonies.values()]
    np.testing.assert_allclose(values, harmonies["score FOLDER"], rtol=0, atol=1e-9, err_msg=str(harmonies))
    track = load_annotation(folder / "beats.json").track(11.0)
    even = score_clip(replace(load_recording(folder).clip, beats=track), HarmonyParams.paper()).harmony
    assert abs(even - harmonies["score FOLDER"]) > 0.01  # beats of equal strength have another h
