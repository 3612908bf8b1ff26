"""`harmolab dance`: with weights, with the choreographer and no option at all; what is written, printed and refused."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile
import torch
from typer.testing import Result

import harmolab
from harmolab.beats import meter
from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import standing_height
from harmolab.cli import app
from harmolab.cli.dancing import MOST_SEEDS, DanceReport
from harmolab.data.synthetic import DANCER, synthetic_motion, write_corpus
from harmolab.lab import player_data
from harmolab.lab.evaluate.measured import OF_HARMONY, dance_scores
from harmolab.metrics.likeness import Likeness
from harmolab.readers.audio import load_audio
from harmolab.readers.motion import load_motion, load_offset, save_motion
from harmolab.systems.choreographer import banks, generate, takes
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.runs import PoseBank, load_poses, save_poses
from harmolab.systems.training.song_to_dance import synthesize_dance
from harmolab.systems.training.weights import save_weights
from harmolab.types import Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import called, cases, done, planted_dance, refused, write_song

FPS = 15.0


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

    return partial(called, app, "dance", song, "--weights", run_folder, "--seconds", 2, "--out")


def test_npz_holds_what_the_function_gives(dance: Callable[..., Result], tmp_path: Path, song: Path, run_folder: Path):
    result = dance(tmp_path / "dance.npz", "--seed", 1, "--start", 1.5, "--dance", "cha-cha")
    assert result.exit_code == 0, result.output
    asked = {"seconds": 2.0, "start": 1.5, "seed": 1, "dance": "cha-cha", "poses": load_poses(run_folder)}
    expected = synthesize_dance(load_generator(run_folder), load_audio(song), **asked)
    np.testing.assert_allclose(load_motion(tmp_path / "dance.npz").positions, expected.positions, atol=1e-6)
    assert [file.name for file in tmp_path.iterdir()] == ["dance.npz"]


def test_table_begins_with_the_number_and_names_every_score_of_the_paper_beside_its_chance(
    dance: Callable[..., Result], tmp_path: Path
):
    output = dance(tmp_path / "dance.npz", "--verbose").stdout
    assert output.startswith("Too short to be judged: 10 s of movement are needed, these are 2 s.\n  Cannot")
    assert re.search(r"harmony above chance\W+-\W+looks like dancing\W+too short", output)
    assert re.search(r"level, 0 to 4\W+0\b", output)
    for name in ("paper: harmony", "paper: hit rate", "paper: chance"):
        assert re.search(rf"{name}\W+-?\d", output), name
    for name in ("visual beats M", "music beats N", "pulse", "share inside the body", "jerk", "foot skating"):
        assert name in output
    assert f"wrote {tmp_path / 'dance.npz'}" in output.replace("\n", "")


def test_a_dance_keeps_the_song_time_it_was_made_for(dance: Callable[..., Result], tmp_path: Path):
    kept = dance(tmp_path / "dance.npz", "--start", 1.5)
    assert load_offset(tmp_path / "dance.npz") == 1.5
    assert "--offset" not in kept.output
    written = dance(tmp_path / "dance.bvh", "--start", 1.5)
    assert "the movement begins at 1.5 s of the song: pass --offset 1.5 with it" in written.output
    # Of a BVH that is scored without it nothing more than "in time" is told.
    assert "begins at 0 s of the song: pass --offset 0 with it" in dance(tmp_path / "dance.bvh").output
    assert "--offset" not in dance(tmp_path / "dance.html").output


def test_one_is_told_to_the_verdict(dance: Callable[..., Result], tmp_path: Path):
    result = dance(tmp_path / "dance.npz", "--dance", "cha-cha", "--one", 1.0, "--verbose")
    assert result.exit_code == 0 and '"one" known, 4 beats a bar' in result.output, result.output


def test_beats_of_a_file_take_the_place_of_tracked_ones(song: Path, tmp_path: Path):
    (tmp_path / "song.beats").write_text("".join(f"{beat:.3f}\n" for beat in np.arange(0.2, 6, 0.3)))
    words = ("dance", song, "--beats", tmp_path / "song.beats", "--style", "puppet", "--out", tmp_path / "dance.npz")
    said = done(app, "--verbose", *words).stdout
    assert "music: annotated, 200.0 bpm" in said and "Danced at" not in said


def test_bvh_and_npz_of_a_seed_are_the_same_dance(dance: Callable[..., Result], tmp_path: Path):
    for name in ("dance.npz", "dance.bvh"):
        assert dance(tmp_path / name).exit_code == 0
    motion, back = load_motion(tmp_path / "dance.npz"), load_motion(tmp_path / "dance.bvh")
    order = [back.skeleton.joints.index(name) for name in motion.skeleton.joints]
    np.testing.assert_allclose(back.positions[:, order], motion.positions, atol=1e-4)


def test_mp4_has_picture_and_sound_of_the_length_asked_for(dance: Callable[..., Result], tmp_path: Path):
    assert dance(tmp_path / "dance.mp4", "--start", 2).exit_code == 0
    with av.open(str(tmp_path / "dance.mp4")) as container:
        picture, sound = container.streams.video[0], container.streams.audio[0]
        assert (picture.width, picture.height, picture.average_rate) == (640, 480, 30)
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert len(frames) == pytest.approx(60, abs=2)
        assert float(sound.duration * sound.time_base) == pytest.approx(2.0, abs=0.1)
    assert (frames[0] != frames[-1]).any()


def test_several_samples_are_numbered_by_their_seeds(dance: Callable[..., Result], tmp_path: Path):
    result = dance(tmp_path / "dance.npz", "--samples", 2, "--seed", 3)
    names = sorted(file.name for file in tmp_path.iterdir())
    assert (result.exit_code, names) == (0, ["dance_3.npz", "dance_4.npz"]), result.output
    assert "seed 3" in result.output and "seed 4" in result.output
    one, other = (load_motion(tmp_path / f"dance_{seed}.npz").positions for seed in (3, 4))
    assert (one != other).any()


@cases(
    "name, options, fault",
    ("dance.avi", (), "dance.avi: a dance is written as .mp4, .webm, .html, .htm, .bvh, .npz"),
    ("none/dance.mp4", (), "none: no such folder"),
    ("dance.mp4", ("--start", 60), "start must lie within the music (0 to 12.00 s), got 60 s"),
    ("dance.mp4", ("--dance", "polka"), "unknown dance 'polka'"),
    ("dance.mp4", ("--seconds", -1), "seconds must be positive, got -1"),
    ("dance.mp4", ("--weights", "nowhere"), "nowhere: no such folder or file of weights"),
)
def test_what_cannot_be_done_is_one_line_and_no_file(
    dance: Callable[..., Result], name: str, options: tuple[object, ...], fault: str
):
    assert fault in one_line(dance(name, *options))


def test_missing_song_is_named(run_folder: Path, tmp_path: Path):
    line = one_line(called(app, "dance", tmp_path / "none.mp3", "--weights", run_folder, "--out", "x.npz"))
    assert line == f"harmolab: {tmp_path / 'none.mp3'}: no such file"


def test_installation_without_weights_says_how_to_get_some(song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(harmolab, "__file__", str(tmp_path / "harmolab" / "__init__.py"))
    line = one_line(called(app, "dance", song, "--system", "harmogan", "--out", "x.npz"))
    assert "no weights are shipped for --system harmogan" in line
    assert "harmolab train DATA --system harmogan --out RUN" in line


def loaded_by(command: list[str]) -> set[str]:
    """Packages that a fresh process has loaded after a command."""
    code = (
        "import sys; from typer.testing import CliRunner; from harmolab.cli import app\n"
        f"result = CliRunner().invoke(app, {command!r})\n"
        "assert result.exit_code == 0, result.output\n"
        "print(*{name.partition('.')[0] for name in sys.modules})"
    )
    return {*subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()}


def test_help_loads_neither_torch_nor_opencv():
    assert not loaded_by(["dance", "--help"]) & {"torch", "cv2", "librosa", "av"}


@pytest.mark.slow
def test_torch_and_figures_are_never_loaded_to_dance(song: Path):
    command = ["dance", str(song), "--seconds", "3", "--out", "dance.npz"]
    assert not loaded_by(command) & {"torch", "matplotlib", "pandas"}


def test_scores_of_a_planted_dance():
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


def test_html_is_the_player_with_the_scores(dance: Callable[..., Result], tmp_path: Path):
    assert dance(tmp_path / "dance.html").exit_code == 0
    page = (tmp_path / "dance.html").read_text("utf-8")
    data = json.loads(re.search(r"^const data = (.*);$", page, flags=re.MULTILINE)[1])
    assert data["duration"] == pytest.approx(2.0)
    assert [dancer["name"] for dancer in data["dancers"]] == ["generated"]
    assert '<th scope="row">harmony above chance (0: as by luck, 1: all)</th>' in page
    assert [file.name for file in tmp_path.iterdir()] == ["dance.html"]


@pytest.mark.browser
def test_mp4_plays_with_its_sound(dance: Callable[..., Result], tmp_path: Path, chromium: Any):
    assert dance(tmp_path / "dance.mp4").exit_code == 0
    (tmp_path / "page.html").write_text('<video src="dance.mp4" autoplay></video>')
    page = chromium.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("document.querySelector('video').currentTime > 1.5", timeout=20_000)
    decoded = "v.webkitVideoDecodedByteCount > 0, v.webkitAudioDecodedByteCount > 0"
    assert page.eval_on_selector("video", f"v => [v.videoWidth, v.videoHeight, {decoded}]") == [640, 480, True, True]


def test_a_dance_on_beats_that_are_unsure_gets_no_verdict_from_them():
    clip = planted_dance(seconds=20.0, fps=30.0)
    assert clip.motion is not None and clip.beats is not None
    unsure = "No verdict, since it is laid on beats that a program found, which are unsure."
    for fit, words in ((1.0, "The dance is on the beat: slow on it"), (0.3, unsure)):
        music = replace(clip.beats, quality=fit, fit=fit)
        report = DanceReport(0, clip.motion, 0.0, music, score_motion(music, clip.motion), Likeness())
        assert report.verdict[1].startswith(words)
    silent = replace(music, times=[], strengths=[], bar_places=None)
    report = DanceReport(0, clip.motion, 0.0, silent, score_motion(silent, clip.motion), Likeness())
    assert unsure not in report.verdict


SALSA = "Salsa steps on the beat, practised without the partner."


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance("cha-cha", seconds=12.0)


@pytest.fixture(scope="module")
def song(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve seconds of a synthetic cha-cha."""
    return write_song(tmp_path_factory.mktemp("music") / "my song.wav", clip)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings with music and beats: a cha-cha and a jive, and as the eighth another cha-cha."""
    return write_corpus(tmp_path_factory.mktemp("corpus") / "clips", clips=8, seed=3, seconds=12.0, fps=30.0)


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("heard")


@pytest.fixture(autouse=True)
def aside(tmp_path_factory: pytest.TempPathFactory, heard: Path, monkeypatch: pytest.MonkeyPatch):
    """A working folder of the test's own, and a cache that all tests here share: the song is listened to once."""
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))
    monkeypatch.setenv("HARMOLAB_CACHE", str(heard))


@pytest.fixture
def own_cache(tmp_path: Path, aside: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, for tests of what is kept in it."""
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def files() -> list[str]:
    """Names of all that was written."""
    return sorted(path.name for path in Path.cwd().iterdir())


danced = partial(done, app, "dance")


def one_line(result: Result) -> str:
    """The only line of an error; nothing was written."""
    assert (result.exit_code, len(result.stderr.splitlines()), files()) == (2, 1, []), result.output
    assert result.stderr.startswith("harmolab: ")
    return result.stderr.strip()


@pytest.mark.slow
def test_no_option_at_all_writes_a_page_a_video_and_a_bvh(song: Path):
    result = danced(song, "--verbose")
    assert re.match(r"(seed [1-3]: )?(Moves like recorded dancers|Not meaningful)", result.stdout)
    assert re.search(r"like dancing: steps a second\W+[\d.]+ \(recorded [\d.]+ to [\d.]+\)", result.stdout)
    assert re.search(r"rests of the body on the beat, above\W+-?[\d.]+", result.stdout)
    assert files() == ["my song_dance.bvh", "my song_dance.html", "my song_dance.mp4"]
    assert f"{SALSA}\n  Danced at about 115 bpm; if you count half or twice as many, give" in result.stdout
    assert "The bar is not danced" in result.stdout
    assert "--one" not in result.stdout  # of no use to who knows no bar
    assert re.search(r"looks like dancing\W+\d+ of \d+", result.stdout)
    assert re.search(r"seams, cm\W+\d+\.\d on average", result.stdout)
    assert "cmu61_" in result.stdout
    motion = load_motion("my song_dance.bvh")
    assert motion.duration == pytest.approx(12.0, abs=0.1)
    assert "left_eye" in motion.skeleton.joints
    assert '<th scope="row">looks like dancing</th>' in Path("my song_dance.html").read_text("utf-8")
    with av.open("my song_dance.mp4") as container:
        assert container.streams.video and container.streams.audio


def test_page_that_is_too_long_is_left_out_and_the_rest_is_written(song: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(player_data, "LONGEST", 0.4)
    result = danced(song, "--seconds", 0.5)
    assert files() == ["my song_dance.bvh", "my song_dance.mp4"]
    assert "left out: my song_dance.html: the player shows 0.4 s at most, got 0.5 s" in result.stderr


def test_json_names_every_piece(song: Path):
    result = called(app, "dance", song, "--json", "--seconds", 20, "--out", "dance.npz")
    assert "my song.wav ends at 12.0 s, and so does the dance" in result.stderr
    (told,) = json.loads(result.stdout)
    assert told["likeness"]["passed"] is True
    assert set(told["likeness"]["values"]) == set(told["likeness"]["recorded"])
    assert told["pieces"][0]["recording"].startswith("cmu61_")
    assert sum(told["shares"].values()) == pytest.approx(1.0)
    assert told["worst_seam_cm"] >= told["mean_seam_cm"] > 0
    assert result.stderr.endswith("wrote dance.npz\n")


@pytest.mark.slow
def test_samples_without_a_name_are_numbered_after_the_song(song: Path):
    danced(song, "--samples", 2, "--seed", 3, "--seconds", 0.5)
    assert files() == [f"my song_dance_{seed}.{end}" for seed in (3, 4) for end in ("bvh", "html", "mp4")]
    one, other = (load_motion(f"my song_dance_{seed}.bvh").positions for seed in (3, 4))
    assert np.abs(one - other).max() > 0.05


SPUN = Likeness({"turns": 9.0}, {}, {"turns": 3.0}, {"turns": (0.0, 1.0, 2.0)})


def judged_as(monkeypatch: pytest.MonkeyPatch, *verdicts: Likeness):
    """The guard gives these verdicts, one after the other."""
    left = iter(verdicts)
    monkeypatch.setattr(sys.modules[Likeness.__module__], "likeness", lambda motion, **options: next(left))


@pytest.mark.slow
def test_a_dance_that_fails_is_left_for_the_next_seed_unless_one_is_named(song: Path, monkeypatch: pytest.MonkeyPatch):
    judged_as(monkeypatch, SPUN, Likeness(), SPUN)
    result = called(app, "dance", song, "--out", "dance.npz")
    assert result.stdout.startswith("seed 1: ")
    assert "seed 0 is not used: not meaningful: the body turns round and round" in result.stderr
    named = called(app, "dance", song, "--seed", 0, "--out", "dance.npz", "--verbose")
    assert named.stdout.startswith("Not meaningful: the body turns round and round")
    assert re.search(r"harmony above chance\W+not meaningful", named.stdout)
    assert "rests of the body" not in named.stdout


@pytest.mark.slow
def test_where_every_seed_fails_the_first_is_danced_and_it_is_said(song: Path, monkeypatch: pytest.MonkeyPatch):
    judged_as(monkeypatch, *[SPUN] * MOST_SEEDS)
    result = called(app, "dance", song, "--out", "dance.npz")
    assert result.stdout.startswith("Not meaningful: the body turns round and round")
    assert "no seed up to 3 does better, so seed 0 is danced" in result.stderr


def test_nothing_that_is_written_tells_the_harmony_of_a_dance_that_fails(song: Path, monkeypatch: pytest.MonkeyPatch):
    judged_as(monkeypatch, SPUN)
    (told,) = json.loads(called(app, "dance", song, "--seed", 0, "--json", "--out", "dance.html").stdout)
    assert told["harmony"] is None
    page = Path("dance.html").read_text("utf-8")
    (data,) = re.findall(r"^const data = (.*);$", page, flags=re.MULTILINE)
    (number,) = [dancer["number"] for dancer in json.loads(data)["dancers"]]
    assert number == {"verdict": told["likeness"]["verdict"].capitalize() + "."}
    assert page.count("<td>not meaningful</td>") == len(OF_HARMONY)


def test_page_of_a_dance_too_short_to_be_judged_says_so_before_its_harmony(song: Path):
    danced(song, "--seconds", 4, "--out", "dance.html")
    (data,) = re.findall(r"^const data = (.*);$", Path("dance.html").read_text("utf-8"), flags=re.MULTILINE)
    (dancer,) = json.loads(data)["dancers"]
    assert dancer["number"]["verdict"].startswith("Too short to be judged: 10 s of movement are needed")
    assert "Cannot tell: " in dancer["number"]["verdict"]


def test_recordings_of_ones_own_know_their_bars(song: Path, corpus: Path, own_cache: Path):
    words = (song, "--from", corpus, "--dance", "cha-cha", "--one", 1.0, "--out", "dance.npz", "--verbose")
    first = danced(*words)
    assert load_motion("dance.npz").skeleton == DANCER
    assert '"one" known, 4 beats a bar' in first.stdout
    assert "clip_0001_cha-cha" in first.stdout
    assert "jive" not in first.stdout
    before = Path("dance.npz").read_bytes()
    assert danced(*words).stdout == first.stdout
    assert Path("dance.npz").read_bytes() == before  # of what was kept


def test_of_several_dances_the_nearest_is_danced_and_said_unless_one_is_named(song: Path, corpus: Path):
    words = ("dance", song, "--from", corpus, "--out", "dance.npz", "--verbose")
    heard = called(app, *words).stdout  # the tango there has 129 beats a minute, the cha-chas 133 and 135
    assert "Four beats in a bar are heard, 115 a minute, so tango, the nearest, is danced (--dance: another)." in heard
    assert "_tango 100%" in heard
    told = called(app, *words, "--dance", "jive").stdout
    assert "_jive 100%" in told and "the nearest" not in told


@pytest.fixture
def ballroom(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """A bank for ballroom, which is the Indian one here, and a function that sets how much the song goes in threes."""
    load = banks.shipped_bank
    monkeypatch.setattr(banks, "STYLES", (*banks.STYLES, "ballroom"))
    monkeypatch.setattr(banks, "REMARKS", {**banks.REMARKS, "ballroom": "a ballroom dance"})
    monkeypatch.setattr(banks, "shipped_bank", lambda style, dance="": load(style.replace("ballroom", "indian"), dance))
    return lambda amount: monkeypatch.setattr(meter, "threes", lambda audio, track: amount)


BALLROOM = "A ballroom dance."
THREES = "The music seems to go in threes, so ballroom is danced (--style salsa: dance salsa all the same)."


@cases(
    "options, amount, lines",
    ((), 0.04, (THREES, BALLROOM)),
    ((), 0.02, (SALSA,)),
    (("--dance", "tango"), -1.0, (BALLROOM,)),
    (("--style", "salsa"), 1.0, (SALSA,)),
)
def test_music_in_threes_and_a_dance_by_name_are_ballroom_unless_a_style_is_named(
    song: Path, ballroom: Callable[[float], None], options: tuple[str, ...], amount: float, lines: tuple[str, ...]
):
    ballroom(amount)
    said = danced(song, *options, "--seed", 0, "--seconds", 4, "--out", "dance.npz").stdout
    for line in (THREES, BALLROOM, SALSA):
        assert (line in said) == (line in lines)


@pytest.mark.slow
def test_what_was_heard_of_the_song_is_said_everywhere(clip: Clip, tmp_path: Path):
    loud = clip.audio.samples
    silent = np.concatenate([0.1 * loud, loud, np.zeros(round(3 * clip.audio.sample_rate)), loud[: loud.size // 2]])
    soundfile.write(tmp_path / "song.wav", silent, round(clip.audio.sample_rate))
    # Loudness is smoothed in power, so what is 20 dB louder begins .8 s before its time.
    heard = "quiet 0:00-0:11, loud from 0:11, silence 0:24-0:27"
    said = called(app, "dance", tmp_path / "song.wav", "--seed", 0, "--out", "dance.html", "--json")
    (told,) = json.loads(said.stdout)
    assert told["form"] == heard and told["likeness"]["passed"] is True
    assert f"Heard: {heard}." in Path("dance.html").read_text("utf-8")
    said = danced(tmp_path / "song.wav", "--seed", 0, "--seconds", 14, "--out", "dance.npz")
    assert "Heard: quiet 0:00-0:11, loud from 0:11.\n" in said.stdout
    assert "Heard" not in danced(tmp_path / "song.wav", "--seed", 0, "--seconds", 6, "--out", "dance.npz").stdout


def test_a_corpus_that_changed_and_each_in_another_version_is_read_again(
    song: Path, tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / "moves"
    folder.mkdir()
    for number in (1, 2):
        save_motion(folder / f"take {number}.npz", swaying(number))
        assert ("take 2" in danced(song, "--from", folder, "--out", "dance.npz", "--verbose").stdout) == (number == 2)
    (kept,) = (own_cache / "corpora").iterdir()
    monkeypatch.setattr(generate, "version", lambda name: "another")
    danced(song, "--from", folder, "--seconds", 4, "--out", "dance.npz")
    (again,) = (own_cache / "corpora").iterdir()
    assert again != kept


def test_a_corpus_of_more_than_is_kept_is_danced_all_the_same(
    song: Path, tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(takes, "MOST_VALUES", 10_000)
    save_motion(tmp_path / "take.npz", swaying(1))
    danced(song, "--from", tmp_path / "take.npz", "--seconds", 4, "--out", "dance.npz")
    assert not (own_cache / "corpora").exists()
    refused("run: describes .* take fewer recordings", Choreographer.train, [tmp_path / "take.npz"], tmp_path / "run")
    assert not (tmp_path / "run").exists()


def swaying(seed: int, *, seconds: float = 15.0) -> Motion:
    """A synthetic dancer, whose beats nobody wrote down."""
    return synthetic_motion(np.arange(0.3, seconds, 0.5), seconds=seconds, fps=30.0, seed=seed)


def test_one_bvh_dances_and_too_little_is_said(song: Path, tmp_path: Path):
    save_motion(tmp_path / "take.bvh", swaying(1))
    result = danced(song, "--from", tmp_path / "take.bvh", "--out", "dance.npz", "--verbose")
    assert "Too little motion for this song" in result.stdout
    assert "too few to judge a dance by" in result.stdout
    assert re.search(r"made of\W+take(, mirrored)? \d+%", result.stdout)


def test_a_body_of_another_unit_is_noticed_and_scaled(song: Path, tmp_path: Path):
    motion = swaying(1)
    save_motion(tmp_path / "take.npz", Motion(motion.positions / 5, motion.fps, motion.skeleton))
    small = called(app, "dance", song, "--from", tmp_path / "take.npz", "--seed", 0, "--out", "dance.npz")
    assert "m tall; for other units pass --scale" in small.stderr
    assert danced(song, "--from", tmp_path / "take.npz", "--scale", 5, "--seed", 0, "--out", "dance.npz").stderr == ""
    height = standing_height(load_motion("dance.npz").positions)
    assert height == pytest.approx(standing_height(motion.positions), rel=0.1)


def test_what_cannot_be_read_is_left_out_and_named(song: Path, tmp_path: Path):
    save_motion(tmp_path / "a.npz", swaying(1))
    (tmp_path / "b.bvh").write_text("no bvh")
    result = danced(song, "--from", tmp_path, "--out", "dance.npz", "--verbose")
    assert f"harmolab: left out: {tmp_path / 'b.bvh'}" in result.stderr


def test_a_dance_that_it_cannot_is_said_and_not_judged_by(song: Path):
    result = danced(song, "--dance", "waltz", "--out", "dance.html")
    assert "There is no waltz among these recordings, so ballroom is danced." in result.stdout
    assert "No bar of a waltz is asked for" in result.stdout
    assert "There is no waltz among these recordings, so ballroom is danced." in Path("dance.html").read_text("utf-8")


@pytest.mark.slow
@cases(
    "style, words",
    ("indian", "limits from six short takes"),
    ("ballroom", "Ballroom, dreamt by a network: no recorded frame."),
    ("puppet", "no person was recorded"),
)
def test_other_styles_say_what_they_are(song: Path, style: str, words: str):
    assert words in danced(song, "--style", style, "--out", "dance.npz").stdout


@pytest.mark.slow
def test_harmonised_by_a_centimetre_no_joint_moves_further_nor_where_the_pose_is_held(song: Path):
    for name, options in (("plain.npz", ()), ("moved.npz", ("--harmonise", 1))):
        danced(song, "--seed", 0, "--seconds", 4.5, *options, "--out", name)
    places = (load_motion(name).positions for name in ("plain.npz", "moved.npz"))
    moved = np.linalg.norm(np.subtract(*places), axis=2)
    assert 0 < moved.max() <= 0.01 + 1e-9 and moved[-1].max() < 1e-12


def test_a_saved_choreographer_names_itself(song: Path, corpus: Path, tmp_path: Path):
    done(app, "train", corpus, "--system", "choreographer", "--out", tmp_path / "run")
    about = ("--dance", "cha-cha", "--seed", 0, "--seconds", 6, "--verbose", "--out", "dance.npz")
    for option in ("--weights", "--from"):
        assert re.search(r"seams, cm\W+\d", danced(song, option, tmp_path / "run", *about).stdout)


@cases(
    "options, fault",
    (("--style", "polka"), "unknown style 'polka'; there are salsa, indian, ballroom, puppet"),
    (("--dance", "polka"), "unknown dance 'polka'; known: ballroom, cha-cha, jive"),
    (("--from", "nowhere"), "nowhere: no such f"),
    (("--from", ".", "--style", "salsa"), "--from and --style exclude each other"),
    (("--from", ".", "--weights", "run"), "leave out --weights"),
    (("--style", "salsa", "--system", "harmogan"), "leave out --system harmogan"),
    (("--system", "nothing"), "no weights are shipped for 'nothing': pass --weights RUN, or one of choreographer"),
    (("--scale", "0.01"), "--scale is for the files of --from"),
    (("--harmonise", "0"), "--harmonise is a number of centimetres up to 30, got 0"),
    (("--harmonise", "nan"), "--harmonise must be a finite number"),
    (("--pattern", "."), "this movement knows no bar"),
    (("--one", "3"), "say how long the bars are with --dance"),
)
def test_what_the_choreographer_cannot_do_is_one_line_and_no_file(song: Path, options: tuple[str, ...], fault: str):
    assert fault in one_line(called(app, "dance", song, *options))


def test_an_input_is_never_written_over(song: Path):
    recording = Path(f"{song.stem}_dance.bvh")
    save_motion(recording, swaying(1))
    before = recording.read_bytes()
    result = called(app, "dance", song, "--from", recording)
    assert result.exit_code == 2
    assert "is an input here" in result.stderr
    assert recording.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["-a\nb.wav", "v1.2 [red]é.wav"])
def test_hostile_names_of_songs_are_written_beside_and_said_in_one_line(clip: Clip, tmp_path: Path, name: str):
    write_song(tmp_path / name, clip)
    result = danced("--seconds", 0.5, "--", tmp_path / name)
    assert files() == sorted(f"{Path(name).stem}_dance{end}" for end in (".bvh", ".html", ".mp4"))
    assert result.output.count("wrote ") == 3 and "a\nb" not in result.output


def test_a_name_too_long_to_add_to_is_said_before_any_work(clip: Clip, tmp_path: Path):
    assert "choose one with --out" in one_line(called(app, "dance", write_song(tmp_path / f"{'x' * 240}.wav", clip)))


@pytest.mark.browser
def test_the_page_plays_somebody_who_moves(song: Path, chromium: Any):
    danced(song, "--out", "dance.html")
    page, faults = chromium.new_page(), []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(Path("dance.html").resolve().as_uri())
    page.wait_for_selector("canvas")
    before = page.screenshot()
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(1500)
    assert page.screenshot() != before
    assert faults == []
    assert not page.get_by_text("looks like dancing").is_visible()
    page.get_by_text("Numbers").click()
    assert page.get_by_text("looks like dancing").is_visible()
