"""`harmolab dance`: files that play, the scores of what was made, one line for what cannot be done."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import torch
from typer.testing import CliRunner, Result

import harmolab
from harmolab.body.kinematics import resample_motion
from harmolab.cli import app
from harmolab.cli.dancing import DanceReport
from harmolab.lab.evaluate.measured import dance_scores
from harmolab.metrics.likeness import Likeness
from harmolab.readers.audio import load_audio
from harmolab.readers.motion import load_motion, load_offset
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.dancing import synthesize_dance
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.runs import PoseBank, load_poses, save_poses
from harmolab.systems.training.weights import save_weights
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import cases, planted_dance, write_song

FPS = 15.0


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance()


@pytest.fixture(scope="module")
def song(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of a synthetic cha-cha."""
    return write_song(tmp_path_factory.mktemp("music") / "song.wav", clip)


@pytest.fixture(scope="module")
def run_folder(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights of a small untrained generator, and movements to start from."""
    torch.manual_seed(0)
    features = FeatureParams(n_mfcc=4, beat_channels=True)
    motion = resample_motion(clip.motion, FPS)
    code = encode_motion(motion.positions, FPS, motion.skeleton)
    generator = Generator(
        ModelParams(hidden=8, layers=1, pose_features=8, discriminator=4), features.n_audio, motion.skeleton,
        torch.tensor(bone_lengths(motion.positions, motion.skeleton)), fps=FPS, features=features,
    )  # fmt: skip
    generator.motion_scale.set(torch.tensor(code.mean(axis=0)), torch.tensor(code.std(axis=0)))
    folder = tmp_path_factory.mktemp("run")
    save_weights(folder / "model", generator)
    save_poses(folder / "model", PoseBank(np.stack([code[:30], code[30:60]]), ("cha-cha", "cha-cha")))
    return folder


@pytest.fixture
def dance(song: Path, run_folder: Path) -> Callable[..., Result]:
    """The command, with song and weights; two seconds unless said otherwise."""

    def call(out: Path, *options: object) -> Result:
        arguments = ["dance", song, "--weights", run_folder, "--seconds", 2, "--out", out, *options]
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return call


def test_npz_holds_what_the_function_gives(
    dance: Callable[..., Result], tmp_path: Path, song: Path, run_folder: Path
) -> None:
    result = dance(tmp_path / "dance.npz", "--seed", 1, "--start", 1.5, "--dance", "cha-cha")
    assert result.exit_code == 0, result.output
    expected = synthesize_dance(
        load_generator(run_folder), load_audio(song), seconds=2.0, start=1.5, seed=1, poses=load_poses(run_folder),
        dance="cha-cha",
    )  # fmt: skip
    np.testing.assert_allclose(load_motion(tmp_path / "dance.npz").positions, expected.positions, atol=1e-6)
    assert [file.name for file in tmp_path.iterdir()] == ["dance.npz"]


def test_table_begins_with_the_number_and_names_every_score_of_the_paper_beside_its_chance(
    dance: Callable[..., Result], tmp_path: Path
) -> None:
    output = dance(tmp_path / "dance.npz", "--verbose").stdout
    assert output.startswith(
        "seed 0: Too short to be judged: 10 s of movement are needed, these are 2 s.\n  Cannot tell: "
    )
    assert re.search(r"harmony above chance\W+-\W+looks like dancing\W+too short", output)
    assert re.search(r"level, 0 to 4\W+0\b", output)
    for name in ("paper: harmony", "paper: hit rate", "paper: chance"):
        assert re.search(rf"{name}\W+-?\d", output), name
    for name in ("visual beats M", "music beats N", "pulse", "share inside the body", "jerk", "foot skating"):
        assert name in output
    assert f"wrote {tmp_path / 'dance.npz'}" in output.replace("\n", "")


def test_a_dance_keeps_the_song_time_it_was_made_for(dance: Callable[..., Result], tmp_path: Path) -> None:
    kept = dance(tmp_path / "dance.npz", "--start", 1.5)
    assert load_offset(tmp_path / "dance.npz") == 1.5
    assert "--offset" not in kept.output
    written = dance(tmp_path / "dance.bvh", "--start", 1.5)
    assert "it begins at 1.5 s of the song: pass --offset 1.5 with it" in written.output


def test_one_is_told_to_the_verdict(dance: Callable[..., Result], tmp_path: Path) -> None:
    result = dance(tmp_path / "dance.npz", "--dance", "cha-cha", "--one", 1.0, "--verbose")
    assert result.exit_code == 0, result.output
    assert '"one" known, 4 beats a bar' in result.output


def test_bvh_and_npz_of_a_seed_are_the_same_dance(dance: Callable[..., Result], tmp_path: Path) -> None:
    for name in ("dance.npz", "dance.bvh"):
        assert dance(tmp_path / name).exit_code == 0
    motion, back = load_motion(tmp_path / "dance.npz"), load_motion(tmp_path / "dance.bvh")
    order = [back.skeleton.joints.index(name) for name in motion.skeleton.joints]
    np.testing.assert_allclose(back.positions[:, order], motion.positions, atol=1e-4)


def test_mp4_has_picture_and_sound_of_the_length_asked_for(dance: Callable[..., Result], tmp_path: Path) -> None:
    assert dance(tmp_path / "dance.mp4", "--start", 2).exit_code == 0
    with av.open(str(tmp_path / "dance.mp4")) as container:
        picture, sound = container.streams.video[0], container.streams.audio[0]
        assert (picture.width, picture.height, picture.average_rate) == (640, 480, 30)
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert len(frames) == pytest.approx(60, abs=2)
        assert float(sound.duration * sound.time_base) == pytest.approx(2.0, abs=0.1)
    assert (frames[0] != frames[-1]).any()


def test_several_samples_are_numbered_by_their_seeds(dance: Callable[..., Result], tmp_path: Path) -> None:
    result = dance(tmp_path / "dance.npz", "--samples", 2, "--seed", 3)
    assert result.exit_code == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["dance_3.npz", "dance_4.npz"]
    assert "seed 3" in result.output
    assert "seed 4" in result.output
    one, other = (load_motion(tmp_path / f"dance_{seed}.npz").positions for seed in (3, 4))
    assert (one != other).any()


@cases(
    "name, options, fault",
    ("dance.avi", (), "dance.avi: a dance is written as .mp4, .webm, .html, .bvh, .npz"),
    ("none/dance.mp4", (), "none: no such folder"),
    ("dance.mp4", ("--start", 60), "start must lie within the music (0 to 6.00 s), got 60 s"),
    ("dance.mp4", ("--dance", "polka"), "unknown dance 'polka'"),
    ("dance.mp4", ("--seconds", -1), "seconds must be positive, got -1"),
    ("dance.mp4", ("--weights", "nowhere"), "nowhere.json: no such file"),
)
def test_what_cannot_be_done_is_one_line_and_no_file(
    dance: Callable[..., Result], tmp_path: Path, name: str, options: tuple[object, ...], fault: str
) -> None:
    result = dance(tmp_path / name, *options)
    assert result.exit_code == 2
    assert result.stderr.startswith("harmolab: ")
    assert fault in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_missing_song_is_named(run_folder: Path, tmp_path: Path) -> None:
    arguments = ["dance", str(tmp_path / "none.mp3"), "--weights", str(run_folder), "--out", str(tmp_path / "x.npz")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert result.stderr.strip() == f"harmolab: {tmp_path / 'none.mp3'}: no such file"


def test_installation_without_weights_says_how_to_get_some(
    song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(harmolab, "__file__", str(tmp_path / "harmolab" / "__init__.py"))
    arguments = ["dance", str(song), "--system", "harmogan", "--out", str(tmp_path / "x.npz")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "no weights are shipped for --system harmogan" in result.stderr
    assert "harmolab train DATA --system harmogan --out RUN" in result.stderr


def test_page_without_its_library_is_refused_before_any_work(
    dance: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["harmolab.cli.common"], "find_spec", lambda name: None)
    result = dance(tmp_path / "dance.html")
    assert result.exit_code == 2
    assert "pages need jinja2" in result.stderr


def test_help_loads_neither_torch_nor_opencv() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from harmolab.cli import app\n"
        "assert CliRunner().invoke(app, ['dance', '--help']).exit_code == 0\n"
        "print(*sorted({'torch', 'cv2', 'librosa', 'av'} & {name.partition('.')[0] for name in sys.modules}))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip() == ""


def test_scores_of_a_planted_dance() -> None:
    clip = planted_dance(seconds=20.0)
    scores = dance_scores(clip.motion, clip.beats)
    assert next(iter(scores)) == "harmony above chance"
    assert scores["harmony above chance"] > 0.5
    assert scores["level, 0 to 4"] == 4
    assert scores["p in time"] <= 0.05
    assert scores["pulse, 1/s"] > 0.03
    assert scores["music beats N"] == len(clip.beats)
    assert 0 < scores["paper: chance"] <= 1
    assert scores["foot skating, m/s"] is not None


def test_scores_of_a_dancer_without_feet_have_none_for_skating(swinging_arm: Callable[..., Motion]) -> None:
    motion = swinging_arm(1.0, 30.0)
    beats = BeatTrack(np.arange(0.25, 6.0, 0.5), np.ones(12), 30.0, 6.0)  # the arm rests there
    scores = dance_scores(motion, beats)
    assert scores["foot skating, m/s"] is None
    assert scores["music beats N"] == 12
    assert scores["jerk, m/s³"] > 0
    assert np.isnan(scores["harmony above chance"])  # twelve beats are too few


def test_three_frames_are_a_dance_without_jerk(dance: Callable[..., Result], tmp_path: Path) -> None:
    result = dance(tmp_path / "dance.npz", "--seconds", 0.2, "--verbose")
    assert result.exit_code == 0, result.output
    assert load_motion(tmp_path / "dance.npz").n_frames == 3
    assert re.search(r"jerk, m/s³\W+-", result.output)


def test_html_is_the_player_with_the_scores(dance: Callable[..., Result], tmp_path: Path) -> None:
    assert dance(tmp_path / "dance.html").exit_code == 0
    page = (tmp_path / "dance.html").read_text("utf-8")
    data = json.loads(re.search(r"^const data = (.*);$", page, flags=re.MULTILINE)[1])
    assert data["duration"] == pytest.approx(2.0)
    assert [dancer["name"] for dancer in data["dancers"]] == ["generated"]
    assert '<th scope="row">harmony above chance (0: as by luck, 1: all)</th>' in page
    assert [file.name for file in tmp_path.iterdir()] == ["dance.html"]


@pytest.mark.browser
def test_mp4_plays_with_its_sound(dance: Callable[..., Result], tmp_path: Path, chromium: Any) -> None:
    assert dance(tmp_path / "dance.mp4").exit_code == 0
    (tmp_path / "page.html").write_text('<video src="dance.mp4" autoplay></video>')
    page = chromium.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("document.querySelector('video').currentTime > 1.5", timeout=20_000)
    found = page.eval_on_selector(
        "video",
        "v => [v.videoWidth, v.videoHeight, v.webkitVideoDecodedByteCount > 0, v.webkitAudioDecodedByteCount > 0]",
    )
    assert found == [640, 480, True, True]


def test_a_dance_on_beats_that_are_unsure_gets_no_verdict_from_them() -> None:
    clip = planted_dance(seconds=20.0, fps=30.0)
    assert clip.motion is not None and clip.beats is not None
    for fit, words in (
        (1.0, "You are on the beat"),
        (0.3, "Laid on beats that a program found, which are unsure here."),
    ):
        music = replace(clip.beats, quality=fit, fit=fit)
        report = DanceReport(0, clip.motion, 0.0, music, score_motion(music, clip.motion), Likeness())
        assert report.verdict[1].startswith(words)
