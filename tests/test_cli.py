"""The command line: JSON of the promised form, what is read and written, what is said beside it, clear errors."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest
import soundfile
from typer.testing import CliRunner, Result

from harmolab.body.skeletons import Skeleton
from harmolab.cli import PANELS, app, retiming, screen
from harmolab.data.oddities import jumps_inside
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import synthetic_motion, write_corpus
from harmolab.lab.explain.performance import Performance
from harmolab.params import HarmonyParams
from harmolab.readers.beats import load_annotation
from harmolab.readers.motion import save_motion
from harmolab.readers.motion_file import MotionFile
from harmolab.readers.video import write_gif, write_video
from harmolab.types import Audio, Motion
from harmolab.verdict.judge import score_clip
from tests.builders import called, cases, complaint, done, planted_dance, refused, write_dance, write_pair, write_song
from tests.test_listening_presenting import ask

run, succeed, refusal = (partial(call, app) for call in (called, done, complaint))
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


def test_a_dance_that_bends_the_tempo_of_its_music_is_said(tmp_path: Path) -> None:
    clip = planted_dance("cha-cha", seconds=12.0)
    song, dance = write_song(tmp_path / "song.wav", clip), write_dance(tmp_path / "dance.npz", clip)
    assert "song.wav by itself goes at 115" in succeed("score", song, dance, "--dance", "waltz").stderr
    for command, out in {"score": ("--why", tmp_path / "w.html"), "retime": ("--out", tmp_path / "r.npz")}.items():
        notes = succeed(command, song, dance, "--dance", "waltz", *out).stderr
        assert "so beats were sought there, and 76 were taken" in notes
    dancing = succeed("dance", song, "--dance", "waltz", "--style", "puppet", "--out", tmp_path / "d.npz")
    assert "song.wav by itself goes at 115" in dancing.stderr
    for name in ("cha-cha", "quickstep"):  # of the same tempo, and of twice that
        assert "by itself" not in succeed("score", song, dance, "--dance", name).stderr


def test_score_json_is_the_dictionary_of_score_clip_of_each_mode_or_of_the_one_asked_for(clip_folder: Path):
    words = ("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--json")
    assert set(json.loads(run(*words, "--mode", "paper").stdout)) == {"clip", "paper"}
    result = run(*words, "--plot", plot := clip_folder.with_name("beats.png"))
    assert result.stderr == f"wrote {plot}\n"
    printed = json.loads(result.stdout)
    clip = replace(load_recording(clip_folder).clip, beats=None, dance="")
    for mode, params in (("paper", HarmonyParams.paper()), ("recommended", HarmonyParams.recommended())):
        assert set(printed[mode]) >= MODE_KEYS
        assert printed[mode] == json.loads(json.dumps(score_clip(clip, params).to_dict()))


def test_the_picture_of_a_score_tells_the_time_of_the_song(clip_folder: Path, tmp_path: Path):
    run("score", clip_folder / "audio.wav", clip_folder / "motion.npz", "--offset", 1.3, "--plot", tmp_path / "p.svg")
    assert "<!-- 1.3 -->" in (tmp_path / "p.svg").read_text("utf-8")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a rumba of 24 s with annotated beats."""
    return next(write_corpus(tmp_path_factory.mktemp("long") / "synth", clips=4, seconds=24.0, seed=2).glob("*_rumba"))


def cells(result: Result, name: str) -> list[str]:
    """The cells of a row of the printed table."""
    rows = ([cell.strip() for cell in line.split("│")] for line in result.stdout.splitlines() if "│" in line)
    return next(row[2:-1] for row in rows if row[1] == name)


def test_score_says_the_verdict_first_and_then_the_numbers(recording: Path):
    result = succeed("score", recording, "--mode", "recommended", "--verbose")
    score = score_clip(load_recording(recording).clip)
    assert result.stdout.splitlines()[0] == score.judgement.verdict
    short = run("score", recording).stdout.splitlines()
    assert short == [score.judgement.verdict, *score.judgement.remarks]
    assert len(short) <= 4
    assert cells(result, "harmony above chance") == [f"{score.harmony_above_chance:.3f}"]
    assert cells(result, "p in time") == [f"{score.judgement.p_time:.3f}"]
    assert cells(result, "level, 0 to 4") == [str(score.judgement.level)]


def test_a_folder_alone_is_scored_with_its_song_its_dance_and_its_beats(recording: Path):
    printed = json.loads(run("score", recording, "--json").stdout)
    assert (printed["clip"]["beats"], printed["clip"]["dance"]) == (str(recording / "beats.json"), "rumba")
    assert printed["recommended"] == json.loads(json.dumps(score_clip(load_recording(recording).clip).to_dict()))
    assert set(JUDGEMENT_KEYS) <= set(printed["recommended"])


def test_where_chance_reaches_nearly_all_beats_nothing_is_above_it(recording: Path):
    result = run("score", recording, "--mode", "paper")
    assert float(cells(result, "chance")[0]) > 0.9
    assert cells(result, "harmony above chance") == cells(result, "p value") == ["-"]


def test_fewer_than_sixteen_beats_have_no_number_above_chance(clip_folder: Path):
    result = run("score", clip_folder, "--verbose")
    assert result.stdout.startswith("Cannot tell: ")
    assert cells(result, "harmony above chance") == ["-", "-"]


def test_unknown_mode_is_refused_in_a_line(recording: Path):
    fault = "Invalid value for '--mode': 'mine' is not one of 'paper', 'recommended', 'both'."
    assert fault in refusal("score", recording, "--mode", "mine")


def test_joints_can_be_chosen_to_score(recording: Path):
    clip = load_recording(recording).clip
    names = ("hand L", "finger R", "hip L", "knee R")
    printed = json.loads(run("score", recording, "--joints", ",".join(names), "--json").stdout)["recommended"]
    keep = [clip.motion.skeleton.joints.index(name) for name in names]
    part = Motion(clip.motion.positions[:, keep], clip.motion.fps, Skeleton(names, (-1,) * 4))
    expected = score_clip(replace(clip, motion=part))
    assert printed["harmony_above_chance"] == pytest.approx(expected.harmony_above_chance, abs=1e-9)


def test_other_measures_stand_under_a_heading_of_their_own(recording: Path):
    table, others = run("score", recording, "--others").stdout.split("other measures of the field")
    assert "mir_eval_f" not in run("score", recording).stdout + table
    assert "mir_eval_f" in others


@cases(
    "arguments, hint",
    (("score", "song.wav", "dance.npz", "--start", "1"), "--start is called --offset now"),
    (("score", "song.wav", "dance.npz", "--duration", "1"), "--duration is called --seconds now"),
    (("retime", "dance.npz", "song.wav", "--out", "x.npz"), "dance.npz: the order is SONG DANCE"),
    (("retime", "film.mp4", "song.wav", "--out", "x.mp4"), "song.wav: the order is SONG DANCE"),
    (("score", "dance.npz", "song.wav"), "dance.npz: the order is SONG DANCE"),
    (("play", "dance.npz", "song.wav", "--out", "x.html"), "dance.npz: the order is SONG DANCE"),
    (("dance", "dance.npz", "--out", "x.npz"), "dance.npz: the order is SONG DANCE"),
    (("play", "dance.bvh", "film.mp4", "--out", "x.mp4"), "dance.bvh: the order is SONG DANCE"),
)
def test_an_old_spelling_is_one_line_that_says_the_new_one(arguments: tuple[str, ...], hint: str):
    assert hint in refusal(*arguments)


@pytest.mark.slow
def test_compare_json_has_every_promised_score(corpus: Path):
    summary = json.loads(run("evaluate", "compare", corpus, "--rotations", 40, "--json", "--jobs", 0).stdout)
    assert {"corpus", "window", "null", "beats", "n", "scores"} <= set(summary)
    assert (summary["window"], summary["null"], summary["beats"], summary["n"]) == (6.0, "lagged", "annotated", 21)
    wanted = {"paper", "recommended", "hit_rate", "beat_align_motion", "beat_align_music", "mir_eval_f"}
    assert wanted <= set(summary["scores"])
    for row in summary["scores"].values():
        assert {"auc", "interval", "chance_band", "by_dance"} <= set(row) and set(row["by_dance"]) == set("CJQRSTW")
    assert summary["scores"]["recommended"]["auc"] > 0.95


def compared(corpus: Path, *options: object) -> str:
    command = ("evaluate", "compare", corpus, "--rotations", 20, "--jobs", 0, "--dances", "rumba,waltz")
    return succeed(*command, *options).stdout


def test_compare_fits_on_another_corpus_and_says_so(corpus: Path):
    summary = json.loads(compared(corpus, "--fit-on", corpus, "--json"))
    assert summary["fitted_on"].startswith("6 sequences of another corpus")
    assert set(summary["scores"]["recommended"]["by_dance"]) == {"R", "W"}


def test_compare_says_its_null_and_beats_and_how_many_recordings_reach_each_verdict(corpus: Path):
    said = compared(corpus, "--null", "other", "--beats", "tracked")
    assert "tracked beats, other music" in " ".join(said.split())
    lines = [line.replace("│", " ").split() for line in said.splitlines()]
    # Six seconds hold fewer than 16 beats: no verdict on any of the six.
    assert ["true", "6", "0", "0", "0", "0"] in lines
    assert ["lagged", "6", "0", "0", "0", "0"] in lines


def test_compare_of_an_empty_folder_says_what_to_do(tmp_path: Path):
    assert "harmolab data check" in refusal("evaluate", "compare", tmp_path)


@pytest.mark.slow
def test_compare_gives_the_verdict_of_score(tmp_path: Path):
    root = write_corpus(tmp_path / "long", clips=7, seconds=20.0, fps=30.0, seed=3)
    command = ("evaluate", "compare", root, "--dances", "jive,samba", "--rotations", 20, "--jobs", 0, "--json")
    rows = json.loads(run(*command).stdout)["recordings"]
    assert [row["dance"] for row in rows] == ["jive", "samba"]
    for row in rows:
        folder = root / row["name"]
        dance = ("--dance", row["dance"], "--beats", folder / "beats.json")
        printed = json.loads(run("score", folder / "audio.wav", folder / "motion.npz", *dance, "--json").stdout)
        names = ("harmony_above_chance", "p_value", "level", "verdict", "p_time", "p_place", "lag_s")
        assert {name: printed["recommended"][name] for name in names} == {name: row[name] for name in names}


def test_learnt_patterns_can_be_scored_with_for_the_dances_they_have(corpus: Path, recording: Path, tmp_path: Path):
    patterns = tmp_path / "patterns.json"
    succeed("data", "learn", corpus, "--out", patterns)
    assert set(json.loads(patterns.read_text())) >= {"rumba", "waltz"}
    words = ("score", recording, "--pattern", patterns, "--mode", "recommended", "--json", "--dance")
    assert json.loads(run(*words, "rumba").stdout)["recommended"]["harmony_above_chance"] > 0.3
    fault = refusal(*words, "foxtrot")
    assert "no pattern for --dance 'foxtrot'" in fault and "rumba" in fault


def test_data_check_tells_key_points_from_beats_by_what_a_json_file_holds(tmp_path: Path):
    (tmp_path / "coco.json").write_text(json.dumps([{"image_id": n, "keypoints": [n + 5.0] * 51} for n in range(3)]))
    (tmp_path / "mine.json").write_text(json.dumps({"beats_s": [0.5, 1.0, 1.5]}))
    rows = [json.loads(run("data", "check", file, "--json").stdout)[0] for file in sorted(tmp_path.iterdir())]
    assert [(row["kind"], row["frames"]) for row in rows] == [("motion", 3), ("beats", 3)]


def test_bracketed_names_are_whole(tmp_path: Path, click_track: Callable[..., Audio], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "200")
    names = ("Song [official video].wav", "[bold].wav", "x[/b].wav")
    for name in names[:2]:
        soundfile.write(tmp_path / name, click_track(90, seconds=2.0).samples, 22050)
    (tmp_path / "x[").mkdir()
    (tmp_path / "x[" / "b].wav").write_bytes((tmp_path / "[bold].wav").read_bytes())
    shown = succeed("data", "check", tmp_path).stdout
    assert all(name in shown for name in names)
    assert "b].wav" in succeed("data", "check", tmp_path / "x[/b].wav").stdout


def test_where_a_dance_begins_is_shown_and_said_where_a_file_cannot_keep_it(tmp_path: Path):
    clip = planted_dance(seconds=12.0)
    save_motion(tmp_path / "late.npz", replace(clip.motion, valid=np.arange(clip.motion.n_frames) >= 40), offset=3.0)
    assert json.loads(succeed("data", "check", tmp_path / "late.npz", "--json").stdout)[0]["offset"] == 3.0
    (tmp_path / "take").mkdir()
    save_motion(tmp_path / "take" / "motion.npz", clip.motion, offset=3.0)
    (tmp_path / "take" / "beats.json").write_text("damaged")
    beside = json.loads(run("data", "check", tmp_path / "take" / "motion.npz", "--json").stdout)[0]
    assert beside["kind"] == "motion" and "beats.json: cannot be read" in beside["odd"][-1]
    said = "the movement begins at 3 s of the song: pass --offset 3 with it"
    converted = succeed("data", "convert", tmp_path / "late.npz", tmp_path / "late.bvh").output
    assert said in converted and "late.bvh: BVH cannot say that 40 frames are filler" in converted
    assert said not in succeed("data", "convert", tmp_path / "late.npz", tmp_path / "copy.npz").output
    song = write_song(tmp_path / "song.wav", planted_dance(seconds=15.0))
    bent = ("--out", tmp_path / "bent.bvh")
    known = succeed("retime", song, tmp_path / "late.npz", *bent).output
    assert said in known and (taken := "is taken to begin with the song; --offset says where else") not in known
    assert re.search(r"bent\.bvh: BVH cannot say that \d+ frames are filler", known)
    assert f"late.bvh {taken}" in succeed("retime", song, tmp_path / "late.bvh", *bent).output
    assert taken not in succeed("retime", song, tmp_path / "late.bvh", "--offset", 0, *bent).output


def test_data_synth_writes_as_many_clips_as_are_asked_for(tmp_path: Path):
    succeed("data", "synth", tmp_path / "new", "--clips", 2, "--seconds", 3)
    assert len(list((tmp_path / "new").glob("clip_*"))) == 2


# Beats: tracked, read, or tapped by a person


@pytest.fixture
def song(tmp_path: Path, click_track: Callable[..., Audio]) -> Path:
    """Twenty seconds of clicks, 90 a minute from 0 s on."""
    soundfile.write(tmp_path / "song.wav", 0.9 * click_track(90, seconds=20.0).samples, 22050)
    return tmp_path / "song.wav"


def test_tempo_steadiness_and_one_are_printed_and_written(song: Path):
    out = song.with_suffix(".beats")
    # Any "one" will do: 14.1 s is near the 22nd beat, so the first of a bar of three is the first.
    line, rest = succeed("beats", song, "--dance", "waltz", "--one", 14.1, "--out", out).output.split("\n", 1)
    assert re.fullmatch(r'(89\.9|90\.[01]) bpm, steady \(100% of tracked beats .*\); "one" known, 3 beats a bar', line)
    assert rest == f"wrote {out}\n"
    assert out.read_text().startswith(f"# written by harmolab: song.wav: {line}\n")
    annotation = load_annotation(out)
    np.testing.assert_allclose(annotation.times, 2 / 3 * np.arange(30)[-annotation.times.size :], atol=0.02)
    assert annotation.bar_places()[np.abs(annotation.times - 14.0).argmin()] == 0


def test_without_the_dance_the_octave_is_said_to_be_open(song: Path):
    result = run("beats", song)
    assert '"one": not known' in result.output
    assert (
        "tell this tempo from 45 or 180: --dance decides. Nor does it tell the beat from the off-beat" in result.output
    )


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
    (("--out", "diary.beats"), "is there already, and harmolab did not write it"),
    (("--clicks", "song.wav"), "is an input here"),
    (("--beats", "b.beats", "--out", "b.beats"), "is an input here"),
    (("--one", 3.0), "say how long the bars are with --dance"),
    (("--one", 300.0, "--dance", "waltz"), "no beat is near"),
    (("--dance", "polka"), "unknown dance 'polka'"),
    (("--tracker", "beat_this", "--one", 3.0), "finds the beats and the bars itself"),
    (("--beats", "hello.txt"), "hello.txt: holds no beats"),
    (("--beats", "b.beats", "--dance", "waltz"), "--dance is of no use to beats that are read"),
    (("--checkpoint", "hello.txt"), "--checkpoint goes with --tracker beat_this only"),
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(
    song: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[object, ...], fault: str
):
    monkeypatch.chdir(song.parent)
    contents = {"diary.beats": "dear diary", "b.beats": "1.0\n2.0\n", "hello.txt": "hello"}
    for name, content in contents.items():
        Path(name).write_text(content)
    before = song.read_bytes()
    assert fault in refusal("beats", song, *options)
    assert song.read_bytes() == before
    assert {name: Path(name).read_text() for name in contents} == contents
    assert len(list(song.parent.iterdir())) == 4


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
    result = succeed("beats", song, "--tap", "--out", out, "--meter", 3)
    few, (status, text) = replies
    assert (few, status) == ((400, "1 taps are too few; tap 8 beats or more"), 200)
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
    assert fault in refusal("beats", song, "--tap", "--out", song.parent / name)
    assert replies == []


# What commands say beside their results


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, ...]:
    """A song of 6 s, a dance of 6 s, and the option with the song's beats."""
    return write_pair(tmp_path_factory.mktemp("pair"), planted_dance())


def test_quiet_leaves_the_results_alone(pair: tuple[object, ...], tmp_path: Path):
    usual, quiet = run("score", *pair), run("score", *pair, "-q")
    assert quiet.stdout == usual.stdout and quiet.stderr == ""
    page = run("--quiet", "play", *pair, "--out", tmp_path / "x.html")
    assert page.exit_code == 0 and page.output == "" and (tmp_path / "x.html").is_file()


def test_verbose_says_what_is_read_and_with_which_settings(pair: tuple[object, ...]):
    lines = run("score", *pair, "--lag", "0.1", "-v").stderr
    assert "lag 0.1" in lines and "by default mode both" in lines
    assert f"reads beats: {pair[-1]}" in lines
    assert "dance.npz: npz, 360 frames of 21 joints at 60 a second" in lines


def test_verbose_shows_where_an_error_arose_and_is_not_quiet():
    usual, verbose = run("score", "nothing.wav"), run("-v", "score", "nothing.wav")
    assert "Traceback" not in usual.stderr
    assert "Traceback" in verbose.stderr and verbose.stderr.endswith(usual.stderr)
    assert usual.exit_code == verbose.exit_code == 2
    assert "exclude each other" in refusal("score", "x.wav", "-q", "-v")


def test_long_work_says_a_line_every_while_where_there_is_no_terminal_and_short_work_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    assert list(screen.progress([1, 2], "scoring")) == [1, 2]
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(screen, "EVERY", 0.05)
    for _ in screen.progress([1, 2, 3], "scoring"):
        time.sleep(0.2)
    with screen.waiting("listening"):
        time.sleep(0.12)
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith("harmolab: scoring: 1 of 3 (") for line in lines)
    assert any(line.startswith("harmolab: listening (") for line in lines)
    assert len(lines) < 10


def test_what_a_decoder_in_c_prints_does_not_reach_the_screen():
    code = (
        "import os, sys; from harmolab.cli.screen import quiet_decoders\n"
        "with quiet_decoders():\n    os.write(2, b'part2_3_length'); print('ours', file=sys.stderr)\n"
        "os.write(2, b'after')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "ours\nafter"


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_leaves_no_file_that_is_half_written(ending: signal.Signals, tmp_path: Path):
    code = (
        "import os, signal, harmolab.cli\nfrom harmolab.files import atomic_write\n"
        f"signal.signal({ending:d}, signal.SIG_DFL)\n"  # nohup around the tests ignores it
        f"def work():\n with atomic_write('x') as part: part.touch(); os.kill(os.getpid(), {ending:d})\n"
        "harmolab.cli.app = work; harmolab.cli.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr, list(tmp_path.iterdir())) == (128 + ending, b"", [])


def test_a_closed_standard_error_takes_no_result_away(pair: tuple[object, ...]):
    command = ["sh", "-c", 'exec "$@" 2>&-', "sh", sys.executable, "-m", "harmolab.cli", "score", *map(str, pair)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == run("score", *pair).stdout


def test_signs_that_a_pipe_cannot_write_end_no_command():
    command = [sys.executable, "-m", "harmolab.cli", "lab", "--help"]
    done = subprocess.run(command, env=os.environ | {"PYTHONIOENCODING": "cp1252"}, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"") and rb"\u03bb" in done.stdout


# Help


def test_the_demo_is_the_first_command():
    assert next(iter(PANELS.values()))[0].__name__ == "demo"
    listed, names = run("--help").stdout, ("demo", "score", "play", "beats", "retime", "data", "train")
    places = [listed.index(f" {name} ") for name in names]
    assert places == sorted(places)


@cases(
    "words, expected",
    ("harmolab sc", {"score"}),
    ("harmolab score --dance c", {"cha-cha"}),
    ("harmolab retime --method l", {"lee2019"}),
    ("harmolab dance --style p", {"puppet"}),
    ("harmolab train --system mus", {"music2dance"}),
)
def test_the_shell_completes_commands_and_choices(words: str, expected: set[str]):
    environment = {"_HARMOLAB_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    assert set(CliRunner().invoke(app, [], prog_name="harmolab", env=environment).stdout.split()) == expected


# A folder or a video alone in place of a song and a dance


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of 20 s, and one whose movement is damaged."""
    folder = write_corpus(tmp_path_factory.mktemp("takes") / "synth", clips=3, seconds=20.0, fps=30.0)
    (sorted(folder.glob("clip_*"))[2] / "motion.npz").write_bytes(b"damaged")
    return folder


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball that comes to rest on each beat of a synthetic song of 12 s, with that song."""
    clip, path = planted_dance(seconds=12.0), tmp_path_factory.mktemp("video") / "take.mp4"
    whole, share = np.divmod(np.interp(np.arange(12 * 20) / 20, clip.beats.times, np.arange(len(clip.beats))), 1)
    way = 20 + 80 * np.abs((whole + share**2 * (3 - 2 * share)) % 2 - 1)
    rows, columns = np.mgrid[:96, :128]
    frames = (np.where(np.hypot(rows - 48, columns - x) < 14, 220, 40).astype(np.uint8) for x in way)
    write_video(path, frames, 20.0, audio=clip.audio)
    return path


@pytest.mark.slow
def test_a_folder_alone_goes_to_every_command(recording: Path, tmp_path: Path):
    succeed("score", recording)
    succeed("score", recording, "--why", tmp_path / "why.html")
    succeed("play", recording, "--out", tmp_path / "x.html")
    succeed("play", recording, "--seconds", 1, "--height", 120, "--out", tmp_path / "x.mp4")
    succeed("retime", recording, "--out", tmp_path / "x.npz")


def test_a_folder_with_one_song_and_one_motion_needs_no_layout_and_keeps_its_beats(tmp_path: Path):
    clip = planted_dance(seconds=20.0)
    write_song(tmp_path / "my song.wav", clip)
    write_dance(tmp_path / "my dance.npz", clip)
    (tmp_path / "song.beats").write_text("".join(f"{time:.4f}\n" for time in clip.beats.times))
    read = json.loads(run("score", tmp_path, "--json").stdout)["clip"]
    assert (Path(read["motion"]).name, Path(read["beats"]).name) == ("my dance.npz", "song.beats")
    write_dance(tmp_path / "another.npz", clip)
    assert "has no motion.npz" in refusal("score", tmp_path)


@pytest.mark.slow
def test_a_video_alone_is_scored_as_it_is_explained(video: Path, tmp_path: Path):
    scored = json.loads(run("score", video, "--json").stdout)
    explained = json.loads(run("score", video, "--why", tmp_path / "why.html", "--json").stdout)
    assert scored["clip"]["offset"] == 0.0
    for name in ("level", "verdict", "harmony_above_chance", "p_value"):
        assert scored["recommended"][name] == pytest.approx(explained[name], abs=1e-9)


@pytest.mark.slow
def test_a_video_alone_is_rendered_with_marks_and_retimed(video: Path, tmp_path: Path):
    for command in ("play", "retime"):
        out = tmp_path / f"{command}.mp4"
        succeed(command, video, "--out", out)
        with av.open(str(out)) as container:
            assert container.streams.video and container.streams.audio


def test_a_video_is_no_gif_and_takes_no_options_of_motion_files(video: Path, tmp_path: Path):
    assert "more colours than a gif" in refusal("play", video, "--out", tmp_path / "x.gif")
    assert "--scale is for motion files" in refusal("score", video, "--scale", 2)


@cases("song, begins, words", (False, 2.5, "2.5 s later"), (True, -0.25, "0.25 s earlier"), (False, 0, ""))
def test_an_offset_of_a_video_against_its_own_sound_is_said(video: Path, song: bool, begins: float, words: str):
    said = run("score", video, *[video] * song, "--offset", begins).stderr
    assert (f"take.mp4: --offset lays the picture {words} than its own sound" in said) == bool(words)


@pytest.mark.parametrize("command", ["score", "play", "retime"])
def test_a_song_alone_is_told_what_is_missing(command: str, tmp_path: Path):
    song = write_song(tmp_path / "song.wav", planted_dance())
    out = () if command == "score" else ("--out", tmp_path / "x.mp4")
    assert f"{command} takes SONG DANCE; the folder of one recording, or a video" in refusal(command, song, *out)


@pytest.mark.parametrize("command", ["score", "retime"])
def test_an_unknown_dance_is_refused_before_a_file_is_read(command: str, tmp_path: Path, recording: Path):
    for name in ("song.wav", "take.mp4"):
        (tmp_path / name).write_text("no media file")
    words = ("--dance", "chacha", *(("--out", tmp_path / "x.mp4") if command == "retime" else ()))
    for files in ((tmp_path / "song.wav", tmp_path / "take.mp4"), (recording,)):  # which has annotated beats
        assert "unknown dance 'chacha'; did you mean 'cha-cha'?" in refusal(command, *files, *words)


def test_a_dance_longer_than_its_song_is_said(tmp_path: Path):
    clip = planted_dance(seconds=20.0)
    song = write_song(tmp_path / "song.wav", clip)
    save_motion(tmp_path / "long.npz", Motion(np.tile(clip.motion.positions, (2, 1, 1)), 60.0, clip.motion.skeleton))
    result = run("score", song, tmp_path / "long.npz")
    assert "song.wav ends 20.0 s before the dance does: only the first 20.0 s of the dance have music" in result.stderr


@pytest.mark.parametrize("page", [(), ("--why", "why.html")])
def test_a_dance_that_begins_before_its_song_is_said(tmp_path: Path, page: tuple[str, ...]):
    clip = planted_dance(seconds=20.0)
    song = write_song(tmp_path / "song.wav", clip)
    save_motion(tmp_path / "long.npz", Motion(np.tile(clip.motion.positions, (2, 1, 1)), 60.0, clip.motion.skeleton))
    out = [tmp_path / word if word == "why.html" else word for word in page]
    said = run("score", song, tmp_path / "long.npz", "--offset", -5, *out).stderr
    assert "the dance begins 5.0 s before song.wav: a verdict counts minutes from the begin of the song" in said
    assert "song.wav ends 15.0 s before the dance does: only 20.0 s of the dance have music" in said


def test_frames_that_hide_the_body_are_said_with_the_joints_to_choose_from(tmp_path: Path):
    clip = planted_dance(seconds=12.0)
    song, motion = write_song(tmp_path / "song.wav", clip), clip.motion
    hidden = np.arange(motion.n_frames) % 2 > 0
    save_motion(tmp_path / "dance.npz", replace(motion, valid=~hidden))
    said = run("score", song, tmp_path / "dance.npz").stderr
    assert f"dance.npz: {hidden.sum()} of {motion.n_frames} frames do not count: most of the body is hidden" in said
    assert f"(--joints, a part of {','.join(motion.skeleton.joints)})" in said
    save_motion(tmp_path / "dance.npz", replace(motion, valid=np.arange(motion.n_frames) % 4 > 0))
    assert "do not count" not in run("score", song, tmp_path / "dance.npz").stderr


@cases(
    "fault, is_said",
    ("no fault", False), ("elbows swapped", True), ("elbows swapped for a frame", False), ("body elsewhere", False),
)  # fmt: skip
def test_joints_that_jump_inside_the_body_are_said_where_a_verdict_counts_them(
    tmp_path: Path, fault: str, is_said: bool
) -> None:
    clip = planted_dance(seconds=12.0)
    song, positions = write_song(tmp_path / "song.wav", clip), clip.motion.positions.copy()
    elbows = [clip.motion.skeleton.joints.index(f"elbow {side}") for side in "LR"]
    if "elbows" in fault:
        for frame in (200, 400):
            some = slice(frame, frame + (1 if "a frame" in fault else 6))
            positions[some, elbows] = positions[some, elbows[::-1]]
    positions[300:] += [0.5, 0.0, 0.3] if "elsewhere" in fault else 0.0
    save_motion(tmp_path / "dance.npz", replace(clip.motion, positions=positions))
    said = run("score", song, tmp_path / "dance.npz", "--offset", 0).stderr
    assert ("dance.npz: joints jump, faster than 10 m/s in 4 frames" in said) == is_said


@cases("seconds, is_named", (60, True), (200, False))
def test_few_frames_in_which_joints_jump_are_not_named_in_a_long_dance(seconds: int, is_named: bool) -> None:
    motion = planted_dance(seconds=12.0).motion
    positions = np.repeat(motion.positions[:1], int(seconds * motion.fps), axis=0)
    elbows = [motion.skeleton.joints.index(f"elbow {side}") for side in "LR"]
    positions[200:206, elbows] = positions[200:206, elbows[::-1]]
    assert bool(jumps_inside(Motion(positions, motion.fps, motion.skeleton))) == is_named


# A folder of recordings


def test_a_folder_of_recordings_is_a_table_and_a_fault_is_a_row(takes: Path, tmp_path: Path):
    out = tmp_path / "table.csv"
    result = run("score", takes, "--csv", out)
    assert result.exit_code == 1 and "1 of 3 recordings could not be scored" in result.stderr
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [bool(row["error"]) for row in rows] == [False, False, True]
    alone = json.loads(run("score", sorted(takes.glob("clip_*"))[0], "--json").stdout)
    numbers = [float(rows[0][name]) for name in ("harmony_above_chance", "paper_hit_rate")]
    assert numbers == [alone["recommended"]["harmony_above_chance"], alone["paper"]["hit_rate"]]
    assert rows[0]["verdict"] == alone["recommended"]["verdict"]
    assert "motion.npz: cannot be read" in rows[2]["error"]
    assert run("score", takes, "--csv", out).exit_code == 1, "a table of ours is written over"
    out.write_text("precious")
    assert "harmolab did not write it" in refusal("score", takes, "--csv", out)


def test_a_dance_told_of_a_folder_is_that_of_each_recording(takes: Path, tmp_path: Path):
    assert "unknown dance 'wlatz'; did you mean 'waltz'?" in refusal("score", takes, "--dance", "wlatz")
    first = sorted(takes.glob("clip_*"))[0]
    bare = tmp_path / "bare" / "take"
    bare.mkdir(parents=True)
    for name in ("audio.wav", "motion.npz"):
        (bare / name).write_bytes((first / name).read_bytes())
    rows = json.loads(run("score", bare.parent, "--dance", "waltz", "--json").stdout)
    alone = json.loads(succeed("score", bare, "--dance", "waltz", "--json").stdout)["recommended"]
    assert (rows[0]["dance"], rows[0]["n_audio"], rows[0]["verdict"]) == ("waltz", alone["n_audio"], alone["verdict"])


def test_a_folder_in_the_mode_of_the_paper_shows_the_numbers_of_the_paper(takes: Path):
    result = run("score", takes, "--mode", "paper")
    rows = json.loads(run("score", takes, "--mode", "paper", "--json").stdout)
    numbers = [f"{rows[0][name]:.3f}" for name in ("paper_harmony", "paper_hit_rate", "paper_chance")]
    assert cells(result, rows[0]["name"])[1:4] == numbers


def test_options_that_would_do_nothing_are_refused(recording: Path, tmp_path: Path):
    why, table = ("score", recording, "--why", tmp_path / "p.html"), ("--music", recording, "--reference", recording)
    shard = ("evaluate", recording, *table, "--out", tmp_path / "t", "--shard", "1/1")
    for words, fault in (
        (("lab", recording, "--seconds", 0, "--out", tmp_path / "l.html"), "--seconds must be positive, got 0"),
        (("play", recording, "--other-offset", 3, "--out", tmp_path / "p.html"), "--other-offset is of --other"),
        ((*shard, "--save-reference", tmp_path / "r.npz"), "--save-reference is of a whole table"),
        ((*shard, "--allow-missing"), "--allow-missing is of a whole table"),
        (("evaluate", "compare", recording, "--force"), "--force is for the rows in a folder; name it by --out"),
        ((*why, "--offset", 1, "--search", 3), "--search is of no use where --offset says it"),
        (("score", recording, "--mode", "paper", "--how", "hit"), "--how is not for --mode paper"),
        (("data", "pose", "--install", "--out", tmp_path / "p.npz"), "--out goes with a VIDEO only"),
    ):
        assert fault in refusal(*words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("levels", "rates", "numbers", "is_worse"),
    [
        ((3, 1), (0.2, 0.6), (0.5, 0.5), True),
        ((3, 3), (0.6, 0.5), (0.5, 0.5), True),
        ((1, 3), (0.6, 0.5), (0.5, 0.2), False),  # the verdict, which the warp does not aim at, counts first
        ((3, 3), (0.5, 0.5), (0.5, 0.5), False),
        ((3, 3), (0.0, 0.9), (0.45, -0.81), True),  # rests on the beats of a dance that is told to hit them
        ((3, 3), (0.0, 0.9), (0.45, 0.41), False),
        ((None, None), (0.2, 0.6), (np.nan, np.nan), False),
    ],
)
def test_a_warp_that_did_no_good_is_called_so(levels: tuple, rates: tuple, numbers: tuple, is_worse: bool):
    before, after = (
        SimpleNamespace(judgement=level and SimpleNamespace(level=level), above_chance=number)
        for level, number in zip(levels, numbers, strict=True)
    )
    bent = (SimpleNamespace(hit_rate=rate) for rate in rates)
    retimed = SimpleNamespace(before=before, after=after, target_before=next(bent), target_after=next(bent))
    assert retiming.is_worse(retimed) == is_worse


def test_a_movement_bent_to_beats_that_are_unsure_gets_no_verdict_from_them(tmp_path: Path, rng: np.random.Generator):
    soundfile.write(tmp_path / "surf.wav", 0.1 * rng.normal(size=20 * 22050), 22050)
    dance = write_dance(tmp_path / "dance.npz", planted_dance(seconds=20.0))
    bent = tmp_path / "bent.npz"
    once = succeed("retime", tmp_path / "surf.wav", dance, "--offset", 0, "--out", bent)
    before, after = once.stdout.splitlines()[:2]
    assert before.startswith("before: Cannot tell: the beats found in this music are unsure") and "--tap" in before
    assert after == "after: no verdict, since it is laid on beats that a program found, which are unsure"
    again = succeed("retime", tmp_path / "surf.wav", dance, "--strength", 0, "--offset", 0, "--out", bent)
    assert "after: Cannot tell" in again.stdout


def test_options_of_one_recording_are_none_of_many(takes: Path):
    assert "--offset is for one recording" in refusal("score", takes, "--offset", 1)
    assert "--csv is for a folder of recordings" in refusal("score", sorted(takes.glob("clip_*"))[0], "--csv", "x.csv")


# Moving pictures


def test_a_gif_repeats_has_few_colours_and_is_known_as_ours(tmp_path: Path, recording: Path):
    out = tmp_path / "x.gif"
    succeed("play", recording, "--start", 2, "--seconds", 1, "--height", 120, "--out", out)
    with av.open(str(out)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 13 and frames[0].shape == (120, 160, 3)
    assert len(np.unique(frames[0].reshape(-1, 3), axis=0)) <= 64
    succeed("play", recording, "--seconds", 1, "--height", 120, "--out", out)


def test_a_gif_needs_frames_of_one_size_and_a_rate_that_it_can_hold(tmp_path: Path):
    frame = np.zeros((32, 32, 3), np.uint8)
    refused("at least one frame", write_gif, tmp_path / "x.gif", [], 10.0)
    refused("x.gif: a gif has 1 to 50 pictures a second, got 60", write_gif, tmp_path / "x.gif", [frame], 60.0)
    refused("frame 1 has shape", write_gif, tmp_path / "x.gif", [frame, frame[:20]], 10.0)
    refused("x.gif: frame 0 has shape", write_gif, tmp_path / "x.gif", [frame[..., 0]], 10.0)
    assert not list(tmp_path.iterdir())


# Demo


@pytest.mark.slow
def test_the_demo_shows_one_dancer_in_time_and_one_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    out = tmp_path / "demo.html"
    result = succeed("demo", "--out", out)
    assert "The dance is on the beat" in result.stdout and "late for a rest on the beat" in result.stdout
    assert result.stdout.count("  harmolab ") == 2
    page = out.read_text()
    assert "The song is synthetic" in page and "mocap.cs.cmu.edu" in page
    succeed("demo", "--out", out, "--no-open")
    assert opened == [out.as_uri()]  # once, and not where that was not wanted
    out.write_text("precious")
    assert "harmolab did not write it" in refusal("demo", "--out", out)


@pytest.mark.slow
def test_a_poorly_followed_body_is_told_no_sign_anywhere(video: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    lost = synthetic_motion(np.sort(np.random.default_rng(3).uniform(0, 12, 24)), seconds=12.0, fps=30.0, seed=1)
    growing = 1 + 0.2 * np.where(np.arange(lost.n_frames) // 30 % 2, 1.0, -1.0)[:, None, None]
    loose = replace(lost, positions=growing * lost.positions)
    monkeypatch.setattr("harmolab.cli.playing.is_body_found", lambda path: True)
    monkeypatch.setattr("harmolab.cli.sources.dance_performance", lambda files: Performance(files.motion, loose, True))
    monkeypatch.setattr("harmolab.lab.render.video.filmed_motion", lambda path, **_: MotionFile(loose, "video"))
    outs = {"score": (), "play": ("--out", tmp_path / "x.html"), "retime": ("--out", tmp_path / "x.mp4")}
    for command, out in outs.items():
        said = run(command, video, *out).output
        assert "limbs of the body that was found change their length by 20%" in said.replace("\n", " "), command
        assert "No sign that you follow" not in said.partition("after: ")[0], command
    assert not (tmp_path / "x.html").exists()


def test_a_dance_that_hits_is_retimed_to_hit_and_the_text_says_where_its_rests_lie(tmp_path: Path):
    planted = planted_dance("jive", seconds=30.0, seed=3)
    half = 30.0 / planted.beats.tempo  # the body is fastest on the beats, and a little early
    frames = round((half - 0.06) * planted.motion.fps)
    moved = replace(planted.motion, positions=np.roll(planted.motion.positions, frames, axis=0))
    soundfile.write(tmp_path / "song.wav", planted.audio.samples, int(planted.audio.sample_rate))
    save_motion(tmp_path / "dance.npz", moved, offset=0.0)
    words = ("retime", tmp_path / "song.wav", tmp_path / "dance.npz", "--how", "hit")
    output = " ".join(succeed(*words, "--out", tmp_path / "mended.npz").output.split())
    assert "0.5 of a beat after the beats" in output
    assert output.partition("places with a rest near")[2].replace("│", " ").split()[:2] == ["1.000", "1.000"]
    assert "after: You hit the beat" in output or "after: You are on the beat" in output
