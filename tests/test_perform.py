"""`harmolab perform`: files that play, the error where a truth is known, one line for what cannot be done.

The shipped players make most of what is tested here; no number of theirs is asked for.
"""

import html
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile
import torch
from typer.testing import Result

import harmolab
from benchmarks import bench_audio2body
from harmolab.cli import app
from harmolab.musician import Audio2Body
from harmolab.musician.avatar import avatar
from harmolab.musician.cleaning import Reference
from harmolab.musician.events import bow_turns, strikes
from harmolab.musician.explain import explain_playing
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.page import Performed, performance_span, performed, save_performed
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import load_performance, load_playing
from harmolab.musician.sequences import PointSpace
from harmolab.musician.similarities import Similarity
from harmolab.musician.synthetic import PlantedPerformance, planted_performance, planted_performances
from harmolab.musician.train import compared
from harmolab.readers.audio import save_audio
from harmolab.readers.motion import load_motion, load_offset, save_motion
from harmolab.readers.player_points import HANDS_12, PLAYER_50
from harmolab.readers.video import write_video
from harmolab.systems.training import loop as training_loop
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.types import Audio, Motion
from tests.builders import called, cases, done, refused, save_performance
from tests.test_player import data_of
from tests.test_player_browser import FRAME, PHONE, WIDE, assert_lit_on_its_beats, opened, wait_until
from tools.ship import ship

SECONDS = 6.0
NOTICE = "A network's movement, not a recording; trained on planted, synthetic players only."
SHIPPED = Path(harmolab.__file__).parent / "musician" / "weights"


@cache
def planted(instrument: str) -> PlantedPerformance:
    return planted_performance(instrument, seconds=SECONDS, seed=5)


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a performance of each instrument, "piano" and "violin"."""
    root = tmp_path_factory.mktemp("takes")
    for instrument in ("piano", "violin"):
        save_performance(root / instrument, planted(instrument).performance)
    return root


@pytest.fixture(scope="module")
def song(takes: Path) -> Path:
    """Six seconds of a planted pianist."""
    return takes / "piano" / "audio.wav"


def perform(song: Path, *options: object, instrument: str = "piano", code: int = 0) -> Result:
    result = called(app, "perform", song, *(("--instrument", instrument) if instrument else ()), *options)
    assert result.exit_code == code, result.output
    return result


def fault_of(song: Path, *options: object, instrument: str = "piano") -> str:
    """The one line that a performance ends in which cannot be."""
    error = perform(song, *options, instrument=instrument, code=2).stderr
    assert error.count("\n") == 1, error
    return error


def frames_of(path: Path) -> list[np.ndarray]:
    with av.open(path) as video:
        return [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]


def shown_text(page: str) -> str:
    """The words of a page that people read or hear."""
    labels = " ".join(re.findall(r'aria-label="([^"]*)"', page))
    return html.unescape(labels + re.sub(r"(?s)<(script|style)\b.*?</\1>|<[^>]*>", " ", page))


# The files


@pytest.mark.parametrize("instrument", ["piano", "violin"])
def test_page_speaks_of_notes_and_says_on_whom_the_player_was_trained(instrument: str, takes: Path, tmp_path: Path):
    song = takes / instrument / "audio.wav"
    result = perform(song, "--out", tmp_path / "p.html", instrument=instrument)
    assert result.stdout.splitlines()[1:] == [NOTICE, f"wrote {tmp_path / 'p.html'}"]
    assert result.stdout.startswith(f"6.00 s from 0.00 s of {song} on, played in ")
    assert f" s by the {instrument} player that comes with harmolab\n" in result.stdout
    page = (tmp_path / "p.html").read_text("utf-8")
    text = shown_text(page)
    assert len(page) < 300_000  # 50 kB a second: nine megabytes for three minutes
    assert NOTICE in text and f"a stick figure that plays the {instrument}" in text
    event = {"piano": "strike", "violin": "turn of the bow"}[instrument]
    assert all(words in text for words in ("note onset", event, "onset met", "onset missed"))
    assert not re.search(r"(?i)\bdance(?!s are scored)|\bdancer|\bbeats?\b", text)
    (dancer,) = data_of(page)["dancers"]
    assert not dancer["flat"] and "prop" in [paint for _, _, paint, _ in dancer["parts"]]


def test_npz_keeps_the_points_of_the_network_and_where_they_come_from(song: Path, tmp_path: Path):
    perform(song, "--start", 2, "--seconds", 3, "--out", tmp_path / "p.npz")
    motion, (samples, rate) = load_motion(tmp_path / "p.npz"), soundfile.read(song, dtype="float32")
    own = Audio2Body.shipped("piano").generate(Audio(samples, rate), start=2.0, seconds=3.0)
    np.testing.assert_array_equal(motion.positions, own.positions)
    assert (motion.skeleton, motion.fps, load_offset(tmp_path / "p.npz")) == (PLAYER_50, 24.0, 2.0)
    assert np.load(tmp_path / "p.npz")["about"] == NOTICE


def test_a_start_between_two_frames_is_that_of_the_frame_which_is_written(song: Path, tmp_path: Path):
    result = perform(song, "--start", 3.3125, "--seconds", 1, "--out", tmp_path / "p.npz")
    assert load_offset(tmp_path / "p.npz") == 80 / 24 and "from 3.33 s of" in result.stdout


@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_beside_a_truth_the_network_hears_the_song_from_its_beginning(offset: float):
    """A violinist whose sound begins in the middle bows the other way."""
    whole, violinist = planted("violin").performance, Audio2Body.shipped("violin")
    filmed = replace(performance_span(whole, offset, None), name="film")
    own = violinist.generate(whole.audio, start=3.0)
    beside = performed(violinist, whole.audio, start=3.0, is_avatar=False, truth=filmed)
    for points in (beside.points, beside.compared.prediction):
        np.testing.assert_array_equal(points.positions, own.positions)


def test_npz_and_bvh_keep_the_avatar(song: Path, tmp_path: Path):
    for name, options in (("a.npz", ["--avatar"]), ("a.bvh", []), ("p.npz", [])):
        perform(song, "--seconds", 1, *options, "--out", tmp_path / name)
    own, read = avatar(load_motion(tmp_path / "p.npz"), "piano"), load_motion(tmp_path / "a.bvh")
    np.testing.assert_allclose(load_motion(tmp_path / "a.npz").positions, own.positions, atol=1e-9)
    numbers = [read.skeleton.joints.index(name) for name in own.skeleton.joints]
    np.testing.assert_allclose(read.positions[:, numbers], own.positions, atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("drawn", ["--avatar", "--points"])
def test_video_plays_the_sound_and_says_on_whom_the_player_was_trained(drawn: str, song: Path, tmp_path: Path):
    perform(song, drawn, "--start", 1, "--seconds", 2, "--out", tmp_path / "p.mp4")
    with av.open(tmp_path / "p.mp4") as video:
        assert video.metadata["title"] == f"audio.wav: piano. {NOTICE}"
        assert sum(frame.samples for frame in video.decode(audio=0)) / 48_000 == pytest.approx(2.0, abs=0.05)
    frames = frames_of(tmp_path / "p.mp4")
    assert len(frames) in (59, 60)  # 48 points at 24 Hz end at 1.96 s
    strip = frames[30][-25:]  # dark letters on a light strip
    assert strip.max() > 230 and 0.01 < (strip < 128).mean() < 0.2


def test_without_a_name_files_are_named_after_the_song(song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    perform(song, "--seconds", 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["audio_performance.html", "audio_performance.mp4"]


# The truth


@pytest.fixture(scope="module")
def predicted(song: Path, tmp_path_factory: pytest.TempPathFactory) -> Motion:
    folder = tmp_path_factory.mktemp("predicted")
    perform(song, "--out", folder / "p.npz")
    return load_motion(folder / "p.npz")


def test_a_truth_that_is_the_prediction_seen_by_another_camera_has_no_error(predicted: Motion, tmp_path: Path):
    """But for the anchors' medians, to which the truth is brought: those of the reference sway."""
    other = Similarity(1.7, 0.2, np.array([40.0, -300.0])).apply(predicted.positions)
    save_motion(tmp_path / "truth.npz", replace(predicted, positions=other))
    audio = planted("piano").performance.audio
    network = Audio2Body.shipped("piano").network
    errors = compared(network, load_playing(tmp_path / "truth.npz", audio, instrument="piano")).errors
    assert errors.accepted == 1 and errors.points == 50 and errors.percent < 0.2 * errors.mean_pose_percent


def test_points_ten_pixels_off_are_so_many_per_cent_of_the_shoulder_width(predicted: Motion):
    """Hands 10 pixels to the right in 42 of 50 points: root of 42 x 100 / 100 is 6.48 pixels a coordinate."""
    network = Audio2Body.shipped("piano").network
    anchors = [predicted.skeleton.joints.index(name) for name in network.reference.joints]
    positions = predicted.positions.copy()
    positions[:, anchors] = network.reference.points
    network.space_scale.basis.reshape(-1, 50, 2)[:, anchors] = 0  # shoulders and hips that stand still
    network.space_scale.mean.reshape(50, 2)[anchors] = torch.tensor(network.reference.points).float()
    hands = [number for number, name in enumerate(predicted.skeleton.joints) if number >= 8]
    positions[:, hands, 0] += 10
    performance = replace(planted("piano").performance, motion=replace(predicted, positions=positions), detected=None)
    errors = compared(network, performance).errors
    assert errors.pixels == pytest.approx(np.sqrt(42), rel=0.02)
    left, right = network.reference.points[:2]
    assert errors.percent == pytest.approx(100 * np.sqrt(42) / np.hypot(*(right - left)), rel=0.02)


def test_error_and_score_are_printed_only_with_a_truth(song: Path, takes: Path, tmp_path: Path):
    bare = perform(song, "--out", tmp_path / "p.html").stdout
    assert "shoulder width" not in bare and "chance" not in bare
    lines = perform(song, "--truth", takes / "piano", "--out", tmp_path / "t.html").stdout.splitlines()
    share, mean = (re.search(r"([\d.]+) %", line)[1] for line in lines[2:4])
    assert "% of the shoulder width from the truth" in lines[2] and lines[3].startswith("The mean pose, which hears ")
    errors = compared(Audio2Body.shipped("piano").network, planted("piano").performance).errors
    assert float(share) == pytest.approx(errors.percent, abs=0.1)
    assert float(mean) == pytest.approx(errors.mean_pose_percent, abs=0.1)
    assert any(line.startswith("From the sound: ") for line in lines)
    assert f"The truth: {explain_playing(planted('piano').performance).words.verdict}" in lines
    page = (tmp_path / "t.html").read_text("utf-8")
    assert [dancer["name"] for dancer in data_of(page)["dancers"]] == ["the truth", "from the sound"]
    assert all(html.escape(line, quote=False) in page for line in lines[2:5])


@pytest.mark.slow
def test_points_lie_over_the_truth_and_an_avatar_stands_beside_it(takes: Path, tmp_path: Path):
    take = takes / "violin"
    asked = ("--truth", take / "motion.npz", "--points", "--seconds", 3)
    perform(take / "audio.wav", *asked, "--out", tmp_path / "p.html", instrument="violin")
    data = data_of((tmp_path / "p.html").read_text("utf-8"))
    way = data["dancers"][0]["way"]
    assert data["overlaid"] and [(each["flat"], each["way"]) for each in data["dancers"]] == [(True, way)] * 2
    perform(take / "audio.wav", *asked, "--out", tmp_path / "p.mp4", instrument="violin")
    frame = frames_of(tmp_path / "p.mp4")[45].astype(int)
    red, green = ((np.abs(frame - colour).max(axis=2) < 40).sum() for colour in ((178, 24, 43), (0, 158, 115)))
    assert red > 200 and green > 200 and len(frame) == 480 + 2 * 29  # a line on colours, and one on the training
    perform(take / "audio.wav", *asked[:2], "--seconds", 1, "--out", tmp_path / "a.mp4", instrument="violin")
    for half in np.split(frames_of(tmp_path / "a.mp4")[15].astype(int), 2, axis=1):
        assert half.shape == (538, 480, 3) and (half[100:480, :, 0] > half[100:480, :, 2] + 80).sum() > 2000  # arms


def test_a_truth_that_begins_later_is_compared_from_there(song: Path, tmp_path: Path):
    save_motion(tmp_path / "late.npz", planted("piano").performance.motion.span(2.0, 4.0))
    command = ("--truth", tmp_path / "late.npz", "--out", tmp_path / "p.html")
    late, wrong = (perform(song, *command, "--offset", offset).stdout for offset in (2, 0))
    assert late.startswith("4.00 s from 2.00 s of ")
    late_error, wrong_error = (float(re.search(r"are ([\d.]+) %", text)[1]) for text in (late, wrong))
    assert late_error < wrong_error


@cases(
    "start, seconds, offset, first, count",
    (0.0, None, 0.0, 0, 144),
    (1.0, 2.0, 0.0, 24, 48),
    (0.0, 3.0, 2.0, 0, 24),
    (3.0, None, 2.0, 24, 120),
    (2.0, 99.0, -1.0, 72, 72),
)
def test_a_performance_is_cut_by_the_time_of_its_sound(start, seconds, offset, first, count):
    whole = replace(planted("piano").performance, offset=offset)
    part = performance_span(whole, start, seconds)
    np.testing.assert_array_equal(part.motion.positions, whole.motion.positions[first : first + count])
    np.testing.assert_array_equal(part.detected, whole.detected[first : first + count])
    assert part.offset == offset + first / 24


def test_what_cannot_be_compared_is_named(song: Path, takes: Path, tmp_path: Path):
    own = planted("piano").performance
    for name, motion in (("hands.npz", Motion(own.motion.positions[:, 8:20], 24.0, HANDS_12)), ("far.npz", own.motion)):
        save_motion(tmp_path / name, motion)
    (tmp_path / "points.json").write_text("[]")
    faults = {
        (takes / "violin",): "is played on a violin, not on a piano",
        (tmp_path / "hands.npz",): "to be aligned by",
        (tmp_path / "far.npz", "--offset", 99): "end 99.00 s after the sound; is that rate right, and offset 99 s?",
        (tmp_path / "points.json",): "points.json: ",
        (tmp_path / "none.npz",): "none.npz: no such file",
        (takes / "piano", "--start", 6): "nothing at these seconds",
    }
    for options, message in faults.items():
        assert message in fault_of(song, "--truth", *options, "--out", tmp_path / "p.html")
    assert not (tmp_path / "p.html").exists()


# Hostile input


@cases("kind, rate", ("piano", 8000), ("silence", 44100), ("silence", 192000), ("noise", 192000))
def test_any_sound_gives_a_performance(kind: str, rate: int, tmp_path: Path):
    rng = np.random.default_rng(0)
    piano = planted_performance("piano", seconds=2.0, sample_rate=rate).performance.audio.samples
    samples = {"piano": piano, "silence": np.zeros(2 * rate), "noise": rng.normal(0, 0.3, 2 * rate)}[kind]
    soundfile.write(tmp_path / "song.wav", samples, rate)
    result = perform(tmp_path / "song.wav", "--out", tmp_path / "p.html")
    assert ("no note is heard in these 2.00 s of" in result.stderr) == (kind == "silence")
    perform(tmp_path / "song.wav", "--avatar", "--out", tmp_path / "p.npz")
    motion = load_motion(tmp_path / "p.npz")
    assert motion.n_frames == 48 and np.isfinite(motion.positions).all()
    page = (tmp_path / "p.html").read_text("utf-8")
    json.loads(re.search(r"const data = (.*);", page)[1], parse_constant=pytest.fail)
    assert not re.search(r"\bnan\b", shown_text(page))
    assert ("Cannot tell: the sound has no onsets" in page) == (kind == "silence")


@cases("instrument, seconds", ("piano", 0.1), ("violin", 1.0))
def test_short_sounds_are_played(instrument: str, seconds: float, tmp_path: Path):
    save_audio(tmp_path / "song.wav", planted(instrument).performance.audio.span(0.0, seconds))
    for name in ("p.html", "p.mp4", "p.bvh"):
        perform(tmp_path / "song.wav", "--out", tmp_path / name, instrument=instrument)


def test_the_sound_of_a_video_is_played(song: Path, tmp_path: Path):
    picture, audio = np.zeros((64, 64, 3), np.uint8), planted("piano").performance.audio.span(0, 2.0)
    write_video(tmp_path / "film.mp4", [picture] * 50, 25.0, audio=audio)
    write_video(tmp_path / "silent.mp4", [picture] * 50, 25.0)
    perform(tmp_path / "film.mp4", "--out", tmp_path / "p.npz")
    assert load_motion(tmp_path / "p.npz").duration == pytest.approx(2.0, abs=0.1)
    assert "silent.mp4" in perform(tmp_path / "silent.mp4", "--out", tmp_path / "q.npz", code=2).stderr


def test_what_cannot_be_done_is_one_line(hands: Callable[..., Path], song: Path, tmp_path: Path):
    (tmp_path / "empty").mkdir()
    ship(SHIPPED / "piano", tmp_path / "cut")
    weights = (tmp_path / "cut" / "model.safetensors").read_bytes()
    (tmp_path / "cut" / "model.safetensors").write_bytes(weights[:-9])
    (tmp_path / "broken.wav").write_bytes(b"RIFF....WAVE")
    soundfile.write(tmp_path / "click.wav", np.zeros(1000), 44100)
    out = ("--out", tmp_path / "p.html")
    harmogan = Path(harmolab.__file__).parent / "systems" / "harmogan" / "weights"
    faults: dict[tuple[object, ...], str] = {
        (tmp_path / "none.wav", *out): "none.wav: no such file",
        (tmp_path / "broken.wav", *out): "broken.wav: ",
        (tmp_path / "click.wav", *out): "click.wav: 0.02 s of sound are less than two frames",
        (tmp_path, *out): "folder",
        (song, "--out", tmp_path / "p.pdf"): "a performance is written as",
        (song, "--out", "/nowhere/p.html"): "/nowhere: no such folder",
        (song, "--out", song): "is an input here",
        (song, *out, "--start", 9): "must lie within the recording of 6.00 s",
        (song, *out, "--start", -1): "must lie within the recording",
        (song, *out, "--seconds", 0): "must lie within the recording",
        (song, *out, "--seconds", "nan"): "--seconds must be a finite number",
        (song, *out, "--offset", 1): "--offset and --fps are those of --truth",
        (song, "--out", tmp_path / "p.bvh", "--points"): "leave out --points",
        (song, *out, "--weights", tmp_path / "empty"): "model.json: no such file",
        (song, *out, "--weights", harmogan): "was made by the system 'harmogan', which plays no instrument",
        (song, *out, "--weights", SHIPPED / "violin"): "plays the violin, not the piano",
        (song, *out, "--weights", tmp_path / "cut"): "model.safetensors",
        (song, *out, "--weights", hands(hears="notes")): "hears notes, not sound",
    }
    for arguments, message in faults.items():
        assert message in fault_of(*arguments)
    assert "say what is played: --instrument piano" in fault_of(song, *out, instrument="")
    assert not (tmp_path / "p.html").exists()


@pytest.fixture
def hands(tmp_path: Path) -> Callable[..., Path]:
    """`hands(hears=)`: a run of an untrained network of a pianist's wrists and fingertips."""

    def build(**settings: str) -> Path:
        params = replace(Audio2BodyParams.recommended(), hidden=8, components=2, **settings)
        network = SoundToPoints(params, HANDS_12, "piano", 2, Reference((), np.zeros((0, 2))))
        space = PointSpace.fit(np.random.default_rng(0).uniform(0, 300, (30, 24)), 2)
        network.set_statistics(torch.zeros(params.n_sound), torch.ones(params.n_sound), space)
        Audio2Body(network, {"source": "<b>mine</b>"}).save(tmp_path / "run")
        return tmp_path / "run"

    return build


def test_hands_without_a_body_are_shown_as_points(hands: Callable[..., Path], song: Path, tmp_path: Path):
    result = perform(song, "--weights", hands(), "--out", tmp_path / "p.html", instrument="")
    assert "of which no avatar can be built" in result.stderr
    assert "A network's movement, not a recording; trained on: <b>mine</b>." in result.stdout
    page = (tmp_path / "p.html").read_text("utf-8")
    assert data_of(page)["dancers"][0]["flat"] and "trained on: &lt;b&gt;mine" in page


# Own playing, explained


@pytest.mark.slow
def test_own_playing_is_explained(song: Path, takes: Path, tmp_path: Path):
    words = explain_playing(planted("piano").performance).words
    command = ("score", "--why", tmp_path / "e.html", "--instrument", "piano", song)
    asked = (*command, takes / "piano")
    result = called(app, *asked)
    assert result.stdout.splitlines() == [words.verdict, *words.sentences, f"wrote {tmp_path / 'e.html'}"]
    assert words.verdict in html.unescape((tmp_path / "e.html").read_text("utf-8"))
    assert json.loads(called(app, *asked, "--json").stdout)["verdict"] == words.verdict
    assert json.loads(called(app, *command, takes / "piano" / "motion.npz", "--json").stdout)["onsets"] > 0
    refused_option = called(app, *asked, "--dance", "waltz")
    assert refused_option.exit_code == 2 and "--dance is for dances" in refused_option.stderr


# Sync


def test_strikes_of_the_avatar_are_those_of_the_points():
    own = planted("piano")
    points = replace(own.performance.motion, positions=own.clean)
    flat, deep = strikes(points).times, strikes(avatar(points, "piano")).times
    assert len(flat) > 8
    np.testing.assert_allclose(deep, flat, atol=1 / 24)


@pytest.mark.slow
def test_three_minutes_are_played_to_their_end(tmp_path: Path):
    save_audio(tmp_path / "song.wav", planted_performance("piano", seconds=bench_audio2body.SONG).performance.audio)
    motion = bench_audio2body.played(tmp_path / "song.wav", Audio2Body.shipped("piano"))
    assert motion.duration == pytest.approx(180.0, abs=0.1)


# Training and weights


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six short performances of a planted pianist."""
    root = tmp_path_factory.mktemp("corpus")
    for number, each in enumerate(planted_performances("piano", 6, seconds=4.0)):
        save_performance(root / f"take_{number}", each.performance)
    return root


@pytest.fixture(scope="module")
def run(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "run"
    result = done(app, "train", corpus, "--system", "audio2body", "--out", out, "--epochs", 3, "--seed", 2)
    assert result.stdout == f"trained: {out}; play with it: harmolab perform SONG --weights {out}\n"
    assert "units: performances, 4 train, 1 validation, 1 test" in result.stderr
    return out


def test_a_run_plays_and_says_on_whom_it_was_trained(run: Path, song: Path, tmp_path: Path):
    result = perform(song, "--weights", run, "--seconds", 2, "--out", tmp_path / "p.html", instrument="")
    assert f" s by {run}\n" in result.stdout and NOTICE in result.stdout
    about = read_about(run)["meta"]
    assert about["settings"]["audio2body"] | {"epochs": 3, "seed": 2} == about["settings"]["audio2body"]
    assert about["errors"]["mean pose"]["full"] > 0


def test_a_performance_without_sound_is_left_out_and_named_and_a_silent_one_is_named_too(corpus: Path, tmp_path: Path):
    takes = shutil.copytree(corpus, tmp_path / "takes")
    (takes / "take_3" / "audio.wav").unlink()
    save_audio(takes / "take_4" / "audio.wav", Audio(np.zeros(4 * 22050), 22050.0))
    command = ("train", takes, "--system", "audio2body", "--out", tmp_path / "run", "--epochs", 1)
    notes = done(app, *command).stderr
    assert f"left out: {takes / 'take_3'}: has no sound; render its notes" in notes
    assert f"trained on although silent: {takes / 'take_4'}; " in notes
    for path in takes.glob("*/audio.wav"):
        path.unlink()
    alone = called(app, *command[:-4], "--out", tmp_path / "none")
    assert f"no performance to train on below {takes}: " in alone.stderr and alone.exit_code == 2


def test_a_performance_without_notes_is_left_out_where_notes_are_learnt_from(corpus: Path, tmp_path: Path):
    takes = shutil.copytree(corpus, tmp_path / "takes")
    (takes / "take_3" / "notes.csv").unlink()
    notices: list[str] = []
    Audio2Body.learn([takes], TrainOptions(tmp_path / "run", notice=notices.append), hears="notes", epochs=1)
    assert notices[0] == f"left out: {takes / 'take_3'}: has no notes.csv, from which this network learns"


def test_points_that_one_performance_does_not_show_are_left_out_of_all_and_names_differ(corpus: Path, tmp_path: Path):
    takes = shutil.copytree(corpus, tmp_path / "takes")
    whole, notices = load_performance(takes / "take_2"), list[str]()
    part = whole.part([name for name in whole.motion.skeleton.joints if "hip" not in name])
    save_motion(takes / "take_2" / "motion.npz", part.motion, detected=part.detected)
    Audio2Body.learn([takes], TrainOptions(tmp_path / "run", notice=notices.append), epochs=1)
    assert notices[0] == "left out of all performances, since takes/take_2 does not show them: left_hip, right_hip"
    assert Audio2Body.load(tmp_path / "run").network.skeleton == part.motion.skeleton
    roots = [takes, shutil.copytree(takes, tmp_path / "other" / "takes")]
    fault = "other/takes/take_0: is called takes/take_0, as .*takes/take_0 is; rename a folder"
    refused(fault, Audio2Body.learn, roots, TrainOptions(tmp_path / "none"))
    Audio2Body.learn([takes, takes], TrainOptions(tmp_path / "twice", notice=notices.append), epochs=1)
    models = [(tmp_path / run / "split.json").read_text() for run in ("run", "twice")]
    assert models[0] == models[1]


def test_options_that_a_training_does_not_take_are_named(corpus: Path, tmp_path: Path):
    faults = {
        (corpus, "--preset", "small"): "preset must be recommended or tables or section_4",
        (corpus, "--step", 3): "--step is no option of this system",
        (tmp_path,): f"no performance to train on below {tmp_path}",
    }
    for asked, words in faults.items():
        result = called(app, "train", *asked, "--system", "audio2body", "--out", tmp_path / "run")
        assert result.exit_code == 2 and words in result.stderr and not (tmp_path / "run").exists()


def test_stopped_training_ends_in_equal_bytes(run: Path, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def report(row: dict[str, object], end: int) -> None:
        if row["epoch"] == 1:
            raise InterruptedError

    monkeypatch.setattr(training_loop, "SAVING_SHARE", float("inf"))
    settings = {"out": tmp_path / "run", "epochs": 3, "seed": 2, "accelerator": "cpu"}
    with pytest.raises(InterruptedError):
        Audio2Body.train([corpus], report=report, **settings)
    assert not (tmp_path / "run" / "model.json").exists()
    Audio2Body.train([corpus], resume=True, **settings)
    for file in ("history.csv", "model.safetensors"):
        assert (run / file).read_bytes() == (tmp_path / "run" / file).read_bytes()


def test_a_run_is_given_away_in_half_the_size(run: Path, tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="model"):
        ship(tmp_path, tmp_path / "weights")
    ship(run, tmp_path / "weights")
    assert sorted(path.name for path in (tmp_path / "weights").iterdir()) == ["model.json", "model.safetensors"]
    sizes = [(folder / "model.safetensors").stat().st_size for folder in (tmp_path / "weights", run)]
    assert sizes[0] < 0.52 * sizes[1]
    own, away = Audio2Body.load(run), Audio2Body.load(tmp_path / "weights")
    assert (away.meta, away.trained_on) == (own.meta, NOTICE)
    audio = planted("piano").performance.audio
    assert np.abs(own.generate(audio).positions - away.generate(audio).positions).max() < 1.0  # pixel


def test_shipped_players_take_a_megabyte_and_were_trained_on_planted_ones():
    files = [path for path in SHIPPED.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files if path.suffix != ".md") <= 1_000_000
    names = {path.relative_to(SHIPPED).as_posix() for path in files} - {"MODEL_CARD.md"}
    assert names == {f"{each}/model.{kind}" for each in ("piano", "violin") for kind in ("json", "safetensors")}
    for instrument, system in ((each, Audio2Body.shipped(each)) for each in ("piano", "violin")):
        assert (system.network.instrument, system.trained_on) == (instrument, NOTICE)
    refused("instrument must be piano or violin", Audio2Body.shipped, "tuba")


# In a browser: it opens offline; hands, keys and strikes keep time with the sound

LONG = 12.0  # seconds


@pytest.fixture(scope="module", params=["piano", "violin"])
def clean_player(request: pytest.FixtureRequest) -> PlantedPerformance:
    return planted_performance(request.param, seconds=LONG, seed=3, faults=False)


@pytest.fixture(scope="module")
def performance(clean_player: PlantedPerformance) -> Performed:
    """Planted points in place of predicted ones, so that the moment of every strike is known."""
    own = clean_player.performance
    points = Motion(clean_player.clean, own.motion.fps, own.motion.skeleton)
    return Performed(own.instrument, points, own.audio, 0.0, "These points were planted.")


@pytest.fixture(scope="module")
def saved(performance: Performed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "p.html"
    save_performed(path, performance, title="A planted piece")
    return path


def drawn_by(page: Any) -> np.ndarray:
    """(T, J, 3) what the page draws."""
    frames, joints = page.evaluate("[dancers[0].frames, dancers[0].joints]")
    return np.array(page.evaluate("Array.from(dancers[0].positions)")).reshape(frames, joints, 3)


@pytest.mark.browser
@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
@pytest.mark.parametrize("drawn", ["--avatar", "--points", "--truth"])
def test_page_of_the_command_opens_offline_and_fits(
    clean_player: PlantedPerformance, drawn: str, viewport: dict[str, int], chromium: Any, tmp_path: Path
):
    save_performance(tmp_path / "take", clean_player.performance)
    options = (drawn, tmp_path / "take") if drawn == "--truth" else (drawn,)
    instrument = clean_player.performance.instrument
    asked = ("perform", tmp_path / "take" / "audio.wav", "--instrument", instrument, "--seconds", 4, *options)
    done(app, *asked, "--out", tmp_path / "p.html")
    page = opened(chromium, tmp_path / "p.html", viewport)
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.5")
    assert page.evaluate("document.documentElement.scrollWidth") == viewport["width"]
    assert page.is_visible(f"text={NOTICE}")
    assert not page.is_visible("#silent") and page.faults == []
    page.close()


@pytest.mark.browser
@pytest.mark.parametrize("kind", ["music", "visual"])
def test_onsets_and_strikes_light_up_within_one_frame(kind: str, performance: Performed, saved: Path, chromium: Any):
    page = opened(chromium, saved)
    page.evaluate("harmolabPlayer.rate(0.5); harmolabPlayer.seek(1); harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 1.2")
    score = performance.score.score
    assert_lit_on_its_beats(page, kind, score.music.times if kind == "music" else score.visual.times, 5.0)
    page.close()


@pytest.mark.browser
def test_the_drawn_hands_strike_within_one_frame_of_the_marks(
    performance: Performed, clean_player: PlantedPerformance, saved: Path, chromium: Any
):
    page = opened(chromium, saved)
    drawn, fps = drawn_by(page), page.evaluate("dancers[0].fps")
    marks = np.array(page.evaluate("dancers[0].visual"))
    page.close()
    assert drawn.shape[1] == len(performance.figure.skeleton.joints)
    is_piano = performance.instrument == "piano"
    seen = (strikes if is_piano else bow_turns)(Motion(drawn, fps, performance.figure.skeleton)).times
    times = clean_player.strikes.times
    distance = [np.abs(marks - time).min() for time in times[(times > 0.5) & (times < LONG - 0.5)]]
    assert len(marks) > 10 and np.median(distance) < FRAME
    late = np.array([np.abs(seen - mark).min() for mark in marks])
    assert (late <= 1 / performance.points.fps).mean() >= (0.95 if is_piano else 0.8)


@pytest.mark.browser
@pytest.mark.parametrize("clean_player", ["piano"], indirect=True)
def test_the_keys_stand_still_under_the_hands(performance: Performed, saved: Path, chromium: Any):
    page = opened(chromium, saved)
    names = performance.figure.skeleton.joints
    keys = [number for number, name in enumerate(names) if name.startswith("keyboard_")]
    tips = [number for number, name in enumerate(names) if name.endswith("_index_4")]
    drawn = drawn_by(page)
    page.close()
    assert np.ptp(drawn[:, keys], axis=0).max() < 1e-3
    assert np.ptp(drawn[:, tips], axis=0).max() > 0.02
