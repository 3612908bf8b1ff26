"""The command line: JSON of the promised form, clear errors, files that appear whole."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from harmolab.body.skeletons import Skeleton
from harmolab.cli import app
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import write_corpus
from harmolab.params import HarmonyParams
from harmolab.types import Motion
from harmolab.verdict.judge import score_clip
from tests.builders import called, cases

MODE_KEYS = {
    "harmony", "harmony_above_chance", "hit_rate", "chance", "hitting_score", "n_audio", "n_visual", "p_value",
    "interval", "music_times", "visual_times", "pairs",
}  # fmt: skip
JUDGEMENT_KEYS = ("level", "verdict", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "pulse", "share")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three clips of each of the seven dances."""
    return write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=21, seconds=6.0, fps=30.0, seed=2)


@pytest.fixture(scope="module")
def clip_folder(corpus: Path) -> Path:
    return sorted(corpus.glob("clip_*_rumba"))[0]


run = partial(called, app)


def test_score_json_is_the_dictionary_of_score_clip(clip_folder: Path) -> None:
    printed = json.loads(run("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--json").stdout)
    clip = load_recording(clip_folder).clip
    for mode, params in (("paper", HarmonyParams.paper()), ("recommended", HarmonyParams.recommended())):
        expected = score_clip(replace(clip, beats=None, dance=""), params).to_dict()
        assert set(printed[mode]) >= MODE_KEYS
        assert printed[mode] == json.loads(json.dumps(expected))


def test_score_of_one_mode_prints_that_mode_only(clip_folder: Path) -> None:
    result = run("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--mode", "paper", "--json")
    assert set(json.loads(result.stdout)) == {"clip", "paper"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a rumba of 24 s with annotated beats."""
    return next(write_corpus(tmp_path_factory.mktemp("long") / "synth", clips=4, seconds=24.0, seed=2).glob("*_rumba"))


def cells(result: Result, name: str) -> list[str]:
    """The cells of a row of the printed table."""
    rows = ([cell.strip() for cell in line.split("│")] for line in result.stdout.splitlines() if "│" in line)
    return next(row[2:-1] for row in rows if row[1] == name)


def test_score_says_the_verdict_first_and_then_the_numbers(recording: Path) -> None:
    result = run("score", recording, "--mode", "recommended", "--verbose")
    assert result.exit_code == 0, result.output
    score = score_clip(load_recording(recording).clip)
    assert result.stdout.splitlines()[0] == score.judgement.verdict
    short = run("score", recording).stdout.splitlines()
    assert short == [score.judgement.verdict, *score.judgement.remarks]
    assert len(short) <= 4
    for name, value in (("harmony above chance", score.harmony_above_chance), ("p in time", score.judgement.p_time)):
        assert cells(result, name) == [f"{value:.3f}"]
    assert cells(result, "level, 0 to 4") == [str(score.judgement.level)]


def test_a_folder_alone_is_scored_with_its_song_its_dance_and_its_beats(recording: Path) -> None:
    printed = json.loads(run("score", recording, "--json").stdout)
    assert (printed["clip"]["beats"], printed["clip"]["dance"]) == (str(recording / "beats.json"), "rumba")
    assert printed["recommended"] == json.loads(json.dumps(score_clip(load_recording(recording).clip).to_dict()))
    assert set(JUDGEMENT_KEYS) <= set(printed["recommended"])


def test_a_song_alone_is_no_recording(recording: Path, tmp_path: Path) -> None:
    for path, fault in (
        (recording / "audio.wav", "score takes SONG DANCE"),
        (tmp_path, "has no motion.npz and no audio.wav"),
    ):
        result = run("score", path)
        assert result.exit_code == 2
        assert fault in result.stderr
        assert len(result.stderr.splitlines()) == 1


def test_where_chance_reaches_nearly_all_beats_nothing_is_above_it(recording: Path) -> None:
    result = run("score", recording, "--mode", "paper")
    assert float(cells(result, "chance")[0]) > 0.9
    assert cells(result, "harmony above chance") == cells(result, "p value") == ["-"]


def test_fewer_than_sixteen_beats_have_no_number_above_chance(clip_folder: Path) -> None:
    result = run("score", clip_folder, "--verbose")
    assert result.stdout.startswith("Cannot tell: ")
    assert cells(result, "harmony above chance") == ["-", "-"]


@pytest.mark.parametrize(
    ("mode", "fault"),
    [("room", "--mode room is gone"), ("mine", "--mode must be one of paper, recommended, both; got 'mine'")],
)
def test_mode_that_is_gone_or_unknown_is_refused_in_a_line(recording: Path, mode: str, fault: str) -> None:
    result = run("score", recording, "--mode", mode)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and fault in result.stderr
    assert "recommended" in result.stderr


def test_joints_can_be_chosen_to_score(recording: Path) -> None:
    clip = load_recording(recording).clip
    names = ("hand L", "finger R", "hip L", "knee R")
    printed = json.loads(run("score", recording, "--joints", ",".join(names), "--json").stdout)["recommended"]
    keep = [clip.motion.skeleton.joints.index(name) for name in names]
    part = Motion(clip.motion.positions[:, keep], clip.motion.fps, Skeleton(names, (-1,) * 4))
    expected = score_clip(replace(clip, motion=part))
    assert printed["harmony_above_chance"] == pytest.approx(expected.harmony_above_chance, abs=1e-9)


def test_other_measures_stand_under_a_heading_of_their_own(recording: Path) -> None:
    plain, more = (run("score", recording, *options).stdout for options in ((), ("--others",)))
    assert "mir_eval_f" not in plain
    table, others = more.split("other measures of the field")
    assert "mir_eval_f" not in table
    assert "mir_eval_f" in others


def test_score_plot_is_a_png_and_leaves_nothing_else(clip_folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "score.png"
    result = run("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--plot", picture)
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["score.png"]


def test_missing_file_gives_one_line_that_names_it(clip_folder: Path, tmp_path: Path) -> None:
    result = run("score", tmp_path / "none.wav", clip_folder / "motion.npz")
    assert result.exit_code == 2
    assert result.stderr.strip() == f"harmolab: {tmp_path / 'none.wav'}: no such file"


def test_motion_after_the_end_of_the_music_is_refused(clip_folder: Path) -> None:
    result = run("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--offset", 100)
    assert result.exit_code == 2
    assert "does not overlap" in result.stderr


@cases(
    "arguments, hint",
    (("score", "song.wav", "dance.npz", "--start", "1"), "--start is called --offset now"),
    (("score", "song.wav", "dance.npz", "--duration", "1"), "--duration is called --seconds now"),
    (("retime", "dance.npz", "song.wav", "--out", "x.npz"), "dance.npz: the order is SONG DANCE"),
    (("retime", "film.mp4", "song.wav", "--out", "x.mp4"), "song.wav: the order is SONG DANCE"),
    (("explain", "dance.npz", "song.wav"), "dance.npz: the order is SONG DANCE"),
    (("play", "dance.npz", "song.wav", "--out", "x.html"), "dance.npz: the order is SONG DANCE"),
    (("dance", "dance.npz", "--out", "x.npz"), "dance.npz: the order is SONG DANCE"),
    (("render", "dance.bvh", "film.mp4", "--out", "x.mp4"), "dance.bvh: the order is SONG DANCE"),
)
def test_an_old_spelling_is_one_line_that_says_the_new_one(arguments: tuple[str, ...], hint: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert hint in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("command", ["play", "render", "retime"])
def test_commands_that_write_sound_decode_the_song_once(
    clip_folder: Path, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = counted(monkeypatch, "harmolab.clips", "load_sound", "music_beats")
    out = tmp_path / ("x.html" if command == "play" else "x.mp4")
    result = run(command, clip_folder / "audio.wav", clip_folder / "motion.npz", "--out", out)
    assert result.exit_code == 0, result.output
    assert calls == {"load_sound": 1, "music_beats": 1}


def counted(monkeypatch: pytest.MonkeyPatch, module: str, *names: str) -> dict[str, int]:
    """Calls of functions from a module by name; the dictionary fills as they are made."""
    calls = dict.fromkeys(names, 0)

    def counting(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: object, **options: object) -> Any:
            calls[name] += 1
            return function(*arguments, **options)

        return call

    for name in names:
        monkeypatch.setattr(f"{module}.{name}", counting(name, getattr(import_module(module), name)))
    return calls


def test_compare_json_has_every_promised_score(corpus: Path) -> None:
    summary = json.loads(run("compare", corpus, "--rotations", 40, "--json", "--jobs", 0).stdout)
    assert {"corpus", "window", "null", "beats", "n", "scores"} <= set(summary)
    assert (summary["window"], summary["null"], summary["beats"], summary["n"]) == (6.0, "lagged", "annotated", 21)
    wanted = {"paper", "recommended", "hit_rate", "beat_align_motion", "beat_align_music", "mir_eval_f"}
    assert wanted <= set(summary["scores"])
    for row in summary["scores"].values():
        assert {"auc", "interval", "chance_band", "by_dance"} <= set(row)
        assert set(row["by_dance"]) == set("CJQRSTW")
    assert summary["scores"]["recommended"]["auc"] > 0.95


def test_compare_fits_on_another_corpus_and_says_so(corpus: Path) -> None:
    result = run(
        "compare", corpus, "--fit-on", corpus, "--dances", "rumba,waltz", "--rotations", 20, "--json", "--jobs", 0
    )
    summary = json.loads(result.stdout)
    assert summary["fitted_on"].startswith("6 sequences of another corpus")
    assert set(summary["scores"]["recommended"]["by_dance"]) == {"R", "W"}


def test_compare_against_other_songs_and_tracked_beats(corpus: Path) -> None:
    result = run("compare", corpus, "--null", "other", "--beats", "tracked", "--rotations", 20, "--jobs", 0)
    assert result.exit_code == 0, result.output
    assert "tracked beats, other music" in " ".join(result.stdout.split())


def test_compare_of_an_empty_folder_says_what_to_do(tmp_path: Path) -> None:
    result = run("compare", tmp_path)
    assert result.exit_code == 2
    assert "harmolab data check" in result.stderr


def test_compare_tells_how_many_recordings_reach_each_verdict(corpus: Path) -> None:
    result = run("compare", corpus, "--dances", "rumba,waltz", "--rotations", 20, "--jobs", 0)
    lines = [line.replace("│", " ").split() for line in result.stdout.splitlines()]
    # Six seconds hold fewer than 16 beats: no verdict on any of the six.
    assert ["true", "6", "0", "0", "0", "0"] in lines
    assert ["lagged", "6", "0", "0", "0", "0"] in lines


def test_compare_gives_the_verdict_of_score(tmp_path: Path) -> None:
    root = write_corpus(tmp_path / "long", clips=7, seconds=20.0, fps=30.0, seed=3)
    command = ("compare", root, "--dances", "jive,samba", "--rotations", 20, "--jobs", 0, "--json")
    rows = json.loads(run(*command).stdout)["recordings"]
    assert [row["dance"] for row in rows] == ["jive", "samba"]
    for row in rows:
        folder = root / row["name"]
        dance = ("--dance", row["dance"], "--beats", folder / "beats.json")
        printed = json.loads(run("score", folder / "audio.wav", folder / "motion.npz", *dance, "--json").stdout)
        names = ("harmony_above_chance", "p_value", "level", "verdict", "p_time", "p_place", "lag_s")
        assert {name: printed["recommended"][name] for name in names} == {name: row[name] for name in names}


def test_learnt_patterns_can_be_scored_with(corpus: Path, tmp_path: Path) -> None:
    patterns = tmp_path / "patterns.json"
    assert run("learn", corpus, "--out", patterns).exit_code == 0
    assert set(json.loads(patterns.read_text())) >= {"rumba", "waltz"}
    folder = sorted(write_corpus(tmp_path / "long", clips=7, seconds=20.0, fps=30.0, seed=3).glob("clip_*_rumba"))[0]
    inputs = (folder / "audio.wav", folder / "motion.npz", "--beats", folder / "beats.json")
    result = run("score", *inputs, "--pattern", patterns, "--dance", "rumba", "--mode", "recommended", "--json")
    assert json.loads(result.stdout)["recommended"]["harmony_above_chance"] > 0.3


def test_a_pattern_file_without_the_dance_names_those_it_has(corpus: Path, clip_folder: Path, tmp_path: Path) -> None:
    patterns = tmp_path / "patterns.json"
    run("learn", corpus, "--out", patterns)
    inputs = (clip_folder / "audio.wav", clip_folder / "motion.npz", "--pattern", patterns)
    result = run("score", *inputs, "--dance", "foxtrot")
    assert result.exit_code == 2
    assert "no pattern for --dance 'foxtrot'" in result.stderr
    assert "rumba" in result.stderr


def test_data_check_reports_what_is_odd(tmp_path: Path) -> None:
    frozen = np.zeros((60, 2, 3))
    frozen[:, 1, 1] = 1.7
    np.savez(tmp_path / "motion.npz", positions=frozen, fps=30.0)
    result = run("data", "check", tmp_path / "motion.npz")
    assert result.exit_code == 0
    assert "odd: motion.npz" in result.stdout
    assert json.loads(run("data", "check", tmp_path / "motion.npz", "--json").stdout)[0]["frames"] == 60


def test_data_check_tells_key_points_from_beats_by_what_a_json_file_holds(tmp_path: Path) -> None:
    (tmp_path / "coco.json").write_text(json.dumps([{"image_id": n, "keypoints": [n + 5.0] * 51} for n in range(3)]))
    (tmp_path / "mine.json").write_text(json.dumps({"beats_s": [0.5, 1.0, 1.5]}))
    rows = [
        json.loads(run("data", "check", tmp_path / name, "--json").stdout)[0] for name in ("coco.json", "mine.json")
    ]
    assert [(row["kind"], row["frames"]) for row in rows] == [("motion", 3), ("beats", 3)]


def test_data_synth_writes_a_corpus_and_refuses_a_foreign_folder(tmp_path: Path) -> None:
    assert run("data", "synth", tmp_path / "new", "--clips", 2, "--seconds", 3).exit_code == 0
    assert len(list((tmp_path / "new").glob("clip_*"))) == 2
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious")
    assert run("data", "synth", tmp_path / "mine", "--clips", 2).exit_code == 2
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "precious"


COMMANDS = [
    *(
        [name]
        for name in ("compare", "dance", "explain", "learn", "play", "render", "report", "retime", "score", "train")
    ),
    *(["data", name] for name in ("check", "synth")),
    *(["study", name] for name in ("make", "ask", "analyse")),
]


def test_every_command_is_listed() -> None:
    listed = run("--help").stdout
    assert all(f" {command[0]} " in listed for command in COMMANDS)


def test_every_command_explains_itself() -> None:
    for command in COMMANDS:
        result = run(*command, "--help")
        assert result.exit_code == 0
        assert "Usage" in result.stdout
