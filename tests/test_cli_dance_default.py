"""`harmolab dance` with the choreographer: no option at all, one's own recordings, what is printed, what is refused."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from typer.testing import Result

from harmolab.body.skeletons import Skeleton, standing_height
from harmolab.cli import app
from harmolab.cli.dancing import MOST_SEEDS
from harmolab.data.synthetic import DANCER, synthetic_motion, write_corpus
from harmolab.lab.evaluate.measured import OF_HARMONY
from harmolab.metrics.likeness import Likeness
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import Clip, Motion
from tests.builders import called, cases, planted_dance, write_song

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
def aside(tmp_path: Path, heard: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A working folder of the test's own, and a cache that all tests here share: the song is listened to once."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("HARMOLAB_CACHE", str(heard))


@pytest.fixture
def own_cache(tmp_path: Path, aside: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, for tests of what is kept in it."""
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def files() -> list[str]:
    """Names of all that was written."""
    return sorted(path.name for path in Path.cwd().iterdir())


def one_line(result: Result) -> str:
    """The only line of an error; nothing was written."""
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("harmolab: ")
    assert len(result.stderr.splitlines()) == 1
    assert files() == []
    return result.stderr.strip()


def test_no_option_at_all_writes_a_page_a_video_and_a_bvh(song: Path) -> None:
    result = called(app, "dance", song, "--verbose")
    assert result.exit_code == 0, result.output
    assert files() == ["my song_dance.bvh", "my song_dance.html", "my song_dance.mp4"]
    assert result.stdout.startswith("seed ")
    assert SALSA in result.stdout
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
        assert container.streams.video
        assert container.streams.audio


def test_the_same_song_again_gives_the_same_dance_in_place_of_the_first(song: Path) -> None:
    assert called(app, "dance", song, "--out", "dance.npz").exit_code == 0
    before = Path("dance.npz").read_bytes()
    assert called(app, "dance", song, "--out", "dance.npz").exit_code == 0
    assert Path("dance.npz").read_bytes() == before
    assert files() == ["dance.npz"]


def test_without_its_library_the_page_is_left_out_and_the_rest_is_written(
    song: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["harmolab.cli.common"], "find_spec", lambda name: None)
    result = called(app, "dance", song)
    assert result.exit_code == 0, result.output
    assert files() == ["my song_dance.bvh", "my song_dance.mp4"]
    assert "left out: my song_dance.html: " in result.stderr
    assert "pip install jinja2" in result.stderr


def test_torch_and_figures_are_never_loaded(song: Path) -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from harmolab.cli import app\n"
        f"result = CliRunner().invoke(app, ['dance', {str(song)!r}, '--out', 'dance.npz'])\n"
        "assert result.exit_code == 0, result.output\n"
        "print(*sorted({'torch', 'matplotlib', 'pandas'} & {name.partition('.')[0] for name in sys.modules}))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip() == ""


def test_likeness_stands_before_harmony_and_each_number_beside_the_recorded_ones(song: Path) -> None:
    output = called(app, "dance", song, "--out", "dance.npz", "--verbose").stdout
    assert re.match(r"seed \d: (Moves like recorded dancers|Not meaningful)", output)
    assert re.search(r"like dancing: steps a second\W+[\d.]+ \([\d.]+ to [\d.]+\)", output)
    assert re.search(r"rests of the body on the beat, above\W+-?[\d.]+", output)


def test_json_names_every_piece(song: Path) -> None:
    result = called(app, "dance", song, "--json", "--out", "dance.npz")
    (told,) = json.loads(result.stdout)
    assert told["likeness"]["passed"] is True
    assert set(told["likeness"]["values"]) == set(told["likeness"]["recorded"])
    assert told["pieces"][0]["recording"].startswith("cmu61_")
    assert sum(told["shares"].values()) == pytest.approx(1.0)
    assert told["worst_seam_cm"] >= told["mean_seam_cm"] > 0
    assert result.stderr.endswith("wrote dance.npz\n")


def test_samples_without_a_name_are_numbered_after_the_song(song: Path) -> None:
    result = called(app, "dance", song, "--samples", 2, "--seed", 3, "--seconds", 3)
    assert result.exit_code == 0, result.output
    ends = ("bvh", "html", "mp4")
    assert files() == [f"my song_dance_{seed}.{end}" for seed in (3, 4) for end in ends]
    one, other = (load_motion(f"my song_dance_{seed}.bvh").positions for seed in (3, 4))
    assert np.abs(one - other).max() > 0.05


SPUN = Likeness({"turns": 9.0}, {}, {"turns": 3.0}, {"turns": (0.0, 1.0, 2.0)})


def judged_as(monkeypatch: pytest.MonkeyPatch, *verdicts: Likeness) -> None:
    """The guard gives these verdicts, one after the other."""
    left = iter(verdicts)
    monkeypatch.setattr(sys.modules[Likeness.__module__], "likeness", lambda motion, **options: next(left))


def test_a_dance_that_fails_is_left_for_the_next_seed_unless_one_is_named(
    song: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged_as(monkeypatch, SPUN, Likeness(), SPUN)
    result = called(app, "dance", song, "--out", "dance.npz")
    assert result.stdout.startswith("seed 1: ")
    assert "seed 0 is left: not meaningful: the body turns round and round" in result.stderr
    named = called(app, "dance", song, "--seed", 0, "--out", "dance.npz", "--verbose")
    assert named.stdout.startswith("seed 0: Not meaningful: the body turns round and round")
    assert re.search(r"harmony above chance\W+not meaningful", named.stdout)
    assert "rests of the body" not in named.stdout


def test_where_every_seed_fails_the_first_is_danced_and_it_is_said(song: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged_as(monkeypatch, *[SPUN] * MOST_SEEDS)
    result = called(app, "dance", song, "--out", "dance.npz")
    assert result.stdout.startswith("seed 0: Not meaningful: the body turns round and round")
    assert "no seed up to 3 does better: seed 0 is danced" in result.stderr


def test_nothing_that_is_written_tells_the_harmony_of_a_dance_that_fails(
    song: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged_as(monkeypatch, SPUN)
    (told,) = json.loads(called(app, "dance", song, "--seed", 0, "--json", "--out", "dance.html").stdout)
    assert told["harmony"] is None
    page = Path("dance.html").read_text("utf-8")
    (data,) = re.findall(r"^const data = (.*);$", page, flags=re.MULTILINE)
    (number,) = [dancer["number"] for dancer in json.loads(data)["dancers"]]
    assert number == {"verdict": told["likeness"]["verdict"].capitalize() + "."}
    assert page.count("<td>not meaningful</td>") == len(OF_HARMONY)


def test_page_of_a_dance_too_short_to_be_judged_says_so_before_its_harmony(song: Path) -> None:
    assert called(app, "dance", song, "--seconds", 4, "--out", "dance.html").exit_code == 0
    (data,) = re.findall(r"^const data = (.*);$", Path("dance.html").read_text("utf-8"), flags=re.MULTILINE)
    (dancer,) = json.loads(data)["dancers"]
    assert dancer["number"]["verdict"].startswith("Too short to be judged: 10 s of movement are needed")
    assert "Cannot tell: " in dancer["number"]["verdict"]


def test_recordings_of_ones_own_know_their_bars(song: Path, corpus: Path, own_cache: Path) -> None:
    words = ("dance", song, "--from", corpus, "--dance", "cha-cha", "--one", 1.0, "--out", "dance.npz", "--verbose")
    first = called(app, *words)
    assert first.exit_code == 0, first.output
    assert load_motion("dance.npz").skeleton == DANCER
    assert '"one" known, 4 beats a bar' in first.stdout
    assert "clip_0001_cha-cha" in first.stdout
    assert "jive" not in first.stdout
    before = Path("dance.npz").read_bytes()
    again = called(app, *words)
    assert Path("dance.npz").read_bytes() == before  # of what was kept
    assert again.stdout == first.stdout


def test_a_corpus_that_changed_is_read_again(song: Path, tmp_path: Path, own_cache: Path) -> None:
    folder = tmp_path / "moves"
    folder.mkdir()
    for number in (1, 2):
        save_motion(folder / f"take {number}.npz", swaying(number))
        result = called(app, "dance", song, "--from", folder, "--out", "dance.npz", "--verbose")
        assert result.exit_code == 0, result.output
        assert ("take 2" in result.stdout) == (number == 2)
    assert len(list((own_cache / "corpora").iterdir())) == 1


def swaying(seed: int, *, seconds: float = 15.0) -> Motion:
    """A synthetic dancer, whose beats nobody wrote down."""
    return synthetic_motion(np.arange(0.3, seconds, 0.5), seconds=seconds, fps=30.0, seed=seed)


def test_one_bvh_dances_and_too_little_is_said(song: Path, tmp_path: Path) -> None:
    save_motion(tmp_path / "take.bvh", swaying(1))
    result = called(app, "dance", song, "--from", tmp_path / "take.bvh", "--out", "dance.npz", "--verbose")
    assert result.exit_code == 0, result.output
    assert "Too little motion for this song" in result.stdout
    assert "too few to be a measure" in result.stdout
    assert re.search(r"made of\W+take 100%", result.stdout)


def test_a_body_of_another_unit_is_noticed_and_scaled(song: Path, tmp_path: Path) -> None:
    motion = swaying(1)
    save_motion(tmp_path / "take.npz", Motion(motion.positions / 5, motion.fps, motion.skeleton))
    small = called(app, "dance", song, "--from", tmp_path / "take.npz", "--seed", 0, "--out", "dance.npz")
    assert "m tall; for other units pass --scale" in small.stderr
    scaled = called(
        app, "dance", song, "--from", tmp_path / "take.npz", "--scale", 5, "--seed", 0, "--out", "dance.npz"
    )
    assert scaled.exit_code == 0, scaled.output
    assert scaled.stderr == ""
    assert standing_height(load_motion("dance.npz").positions) == pytest.approx(
        standing_height(motion.positions), rel=0.1
    )


def test_another_skeleton_dances_on_its_own_and_not_with_others(song: Path, tmp_path: Path) -> None:
    folder = tmp_path / "moves"
    folder.mkdir()
    motion = swaying(1)
    renamed = Skeleton(tuple(f"my_{name}" for name in DANCER.joints), DANCER.parents)
    save_motion(folder / "a.npz", Motion(motion.positions, motion.fps, renamed))
    result = called(app, "dance", song, "--from", folder, "--out", "dance.npz", "--verbose")
    assert result.exit_code == 0, result.output
    assert load_motion("dance.npz").skeleton.joints == renamed.joints
    Path("dance.npz").unlink()
    save_motion(folder / "b.npz", motion)
    assert "a and b have different skeletons" in one_line(called(app, "dance", song, "--from", folder))


def test_what_cannot_be_read_is_left_out_and_named(song: Path, tmp_path: Path) -> None:
    folder = tmp_path / "moves"
    folder.mkdir()
    save_motion(folder / "a.npz", swaying(1))
    (folder / "b.bvh").write_text("no bvh")
    result = called(app, "dance", song, "--from", folder, "--out", "dance.npz", "--verbose")
    assert result.exit_code == 0, result.output
    assert f"harmolab: left out: {folder / 'b.bvh'}" in result.stderr


def test_a_dance_that_it_cannot_is_said_and_not_judged_by(song: Path) -> None:
    result = called(app, "dance", song, "--dance", "waltz", "--out", "dance.html")
    assert result.exit_code == 0, result.output
    assert "There is no waltz among these recordings: danced is salsa." in result.stdout
    assert "The bar of a waltz is not asked for" in result.stdout
    assert "There is no waltz among these recordings: danced is salsa." in Path("dance.html").read_text("utf-8")


@pytest.mark.parametrize("style", ["indian", "puppet"])
def test_other_styles_say_what_they_are(song: Path, style: str) -> None:
    result = called(app, "dance", song, "--style", style, "--out", "dance.npz")
    assert result.exit_code == 0, result.output
    assert {"indian": "limits from six short takes", "puppet": "no person was recorded"}[style] in result.stdout


def test_harmonised_by_a_centimetre_no_joint_moves_further(song: Path) -> None:
    plain = called(app, "dance", song, "--seed", 0, "--seconds", 6, "--out", "plain.npz")
    assert plain.exit_code == 0, plain.output
    result = called(app, "dance", song, "--seed", 0, "--seconds", 6, "--harmonise", 1, "--out", "moved.npz")
    assert result.exit_code == 0, result.output
    one, other = (load_motion(name).positions for name in ("plain.npz", "moved.npz"))
    assert 0 < np.linalg.norm(one - other, axis=2).max() <= 0.01 + 1e-9


def test_a_saved_choreographer_names_itself(song: Path, corpus: Path, tmp_path: Path) -> None:
    trained = called(app, "train", corpus, "--system", "choreographer", "--out", tmp_path / "run")
    assert trained.exit_code == 0, trained.output
    for options in (("--weights", tmp_path / "run"), ("--from", tmp_path / "run")):
        result = called(
            app, "dance", song, *options, "--dance", "cha-cha", "--seed", 0, "--out", "dance.npz", "--verbose"
        )
        assert result.exit_code == 0, result.output
        assert re.search(r"seams, cm\W+\d", result.stdout)


@cases(
    "options, fault",
    (("--style", "polka"), "unknown style 'polka'; there are salsa, indian, puppet"),
    (("--dance", "polka"), "unknown dance 'polka'; known: cha-cha, jive"),
    (("--from", "nowhere"), "nowhere: no such f"),
    (("--from", ".", "--style", "salsa"), "--from and --style exclude each other"),
    (("--from", ".", "--weights", "run"), "leave out --weights"),
    (("--style", "salsa", "--system", "harmogan"), "leave out --system harmogan"),
    (("--system", "nothing"), "no weights are shipped for 'nothing': pass --weights RUN, or one of choreographer"),
    (("--scale", "0.01"), "--scale is for the files of --from"),
    (("--harmonise", "0"), "--harmonise is a number of centimetres up to 30, got 0"),
    (("--harmonise", "nan"), "--harmonise must be a finite number"),
    (("--pattern", "patterns.json"), "this movement knows no bar"),
    (("--one", "3"), "say how long the bars are with --dance"),
    (("--start", "60"), "start must lie within the music (0 to 12.00 s), got 60 s"),
    (("--seconds", "0"), "seconds must be positive, got 0"),
)
def test_what_cannot_be_done_is_one_line_and_no_file(song: Path, options: tuple[str, ...], fault: str) -> None:
    assert fault in one_line(called(app, "dance", song, *options))


def test_an_input_is_never_written_over(song: Path) -> None:
    recording = Path(f"{song.stem}_dance.bvh")
    save_motion(recording, swaying(1))
    before = recording.read_bytes()
    result = called(app, "dance", song, "--from", recording)
    assert result.exit_code == 2
    assert "is an input here" in result.stderr
    assert recording.read_bytes() == before


@pytest.mark.parametrize("name", ["-x.wav", "a\nb.wav", "v1.2 [red]é.wav"])
def test_hostile_names_of_songs_are_written_beside_and_said_in_one_line(clip: Clip, tmp_path: Path, name: str) -> None:
    write_song(tmp_path / name, clip)
    result = called(app, "dance", "--seconds", 2, "--", tmp_path / name)
    assert result.exit_code == 0, result.output
    stem = Path(name).stem
    assert files() == sorted(f"{stem}_dance{end}" for end in (".bvh", ".html", ".mp4"))
    assert result.output.count("wrote ") == 3
    assert "a\nb" not in result.output


def test_a_name_too_long_to_add_to_is_said_before_any_work(clip: Clip, tmp_path: Path) -> None:
    path = write_song(tmp_path / f"{'x' * 240}.wav", clip)
    assert "choose one with --out" in one_line(called(app, "dance", path))


@pytest.mark.browser
def test_the_page_plays_somebody_who_moves(song: Path, chromium: Any) -> None:
    assert called(app, "dance", song, "--out", "dance.html").exit_code == 0
    page, faults = chromium.new_page(), []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(Path("dance.html").resolve().as_uri())
    page.wait_for_selector("canvas")
    before = page.screenshot()
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(1500)
    assert page.screenshot() != before
    assert faults == []
    assert page.get_by_text("looks like dancing").is_visible()
