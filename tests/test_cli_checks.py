"""Small dangers of every command: nothing that is read is written over, one line names the option or file at fault."""

import _pyio
import io
import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import soundfile
import typer
from typer import Typer
from typer.main import get_command
from typer.models import OptionInfo

from harmolab.cli import app
from harmolab.cli.common import described, print_table
from harmolab.cli.evaluating import print_comparison
from harmolab.cli.screen import printable
from harmolab.data.synthetic import write_corpus
from harmolab.files import is_own_file, keep_arrays, write_text
from harmolab.lab.render.video import retime_files
from harmolab.readers.motion import load_motion, save_motion
from harmolab.readers.video import write_video
from tests.builders import called, cases, complaint, done, planted_dance, refused, still, write_pair

run, succeed, refusal = (partial(call, app) for call in (called, done, complaint))


@pytest.fixture(autouse=True)
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every test runs in an empty folder of its own."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=2, seconds=6.0, fps=30.0)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, str, Path]:
    """A song, a dance, and the option with the song's beats, so that none need be tracked."""
    return write_pair(tmp_path_factory.mktemp("pair"), planted_dance())


def functions(group: Typer, *names: str) -> Iterator[tuple[tuple[str, ...], Callable[..., None]]]:
    """Every command below a group: its words and its function."""
    for info in group.registered_commands:
        if info.callback is not None and not info.hidden:
            words = (*names, info.name or info.callback.__name__)
            yield words, info.callback
            yield from (((*words, name), part) for name, part in getattr(info.cls, "parts", {}).items())
    for part in group.registered_groups:
        if part.typer_instance is not None:
            yield from functions(part.typer_instance, *names, str(part.name))


def float_options(words: tuple[str, ...], function: Callable[..., None]) -> Iterator[tuple[str, ...]]:
    """Calls of a command, with all that it cannot do without, that end in an option for any number.

    Numbers with a range are left out: typer itself refuses NaN there (`test_a_value_beyond_its_range_is_one_line`).
    """
    numbers = []
    for one in signature(function, eval_str=True).parameters.values():
        kind, info = get_args(one.annotation)[:2] if hasattr(one.annotation, "__metadata__") else (one.annotation, None)
        option = f"--{one.name.replace('_', '-')}"
        if one.default is one.empty and kind is not typer.Context:
            word = {"song": "song.wav", "motion": "dance.npz"}.get(one.name, "x")
            words = (*words, option, word) if isinstance(info, OptionInfo) else (*words, word)
        if kind in (float, float | None) and getattr(info, "min", None) is getattr(info, "max", None) is None:
            numbers.append(option)
    yield from ((*words, option) for option in numbers)


FLOATS = [call for words, function in functions(app) for call in float_options(words, function)]


def test_the_options_below_are_those_of_nearly_all_commands():
    assert {words[0] for words in FLOATS} >= {"score", "play", "retime", "dance", "train", "data"}
    assert len(FLOATS) > 30


@pytest.mark.slow
@pytest.mark.parametrize("words", FLOATS, ids=" ".join)
def test_no_option_takes_a_number_that_is_none(words: tuple[str, ...]):
    assert refusal(*words, "nan") == f"{words[-1]} must be a finite number, got nan"


@cases(
    "words, value",
    (("evaluate", "compare", "x", "--window"), "nan"),
    (("evaluate", "compare", "x", "--window"), "-1"),
    (("evaluate", "compare", "x", "--rotations"), "3"),
    (("evaluate", "compare", "x", "--null"), "nobody"),
    (("score", "song.wav", "dance.npz", "--clock"), "1e9"),
    (("score", "song.wav", "dance.npz", "--clock"), "nan"),
    (("score", "song.wav", "dance.npz", "--clock"), "0"),
    (("play", "song.wav", "dance.npz", "--out", "x.mp4", "--rate"), "nan"),
    (("data", "synth", "x", "--clips"), "0"),
)
def test_a_value_beyond_its_range_is_one_line(words: tuple[str, ...], value: str):
    assert refusal(*words, value).startswith(f"Invalid value for '{words[-1]}': ")


def test_infinity_is_no_number_of_seconds_either():
    assert refusal("play", "x.wav", "x.npz", "--out", "x", "--offset=-inf").startswith("--offset must be a finite")


# Outputs


@pytest.mark.parametrize("is_link", [False, True])
@cases(
    "words, out",
    (("retime", "song.wav", "dance.npz", "--out"), "dance.npz"),
    (("retime", "song.mp4", "dance.npz", "--out"), "song.mp4"),
    (("play", "song.wav", "dance.npz", "--other", "x.html", "--out"), "x.html"),
    (("score", "song.wav", "dance.npz", "--beats", "x.html", "--why"), "x.html"),
    (("play", "song.mp4", "dance.npz", "--out"), "song.mp4"),
    (("score", "song.wav", "dance.npz", "--plot"), "dance.npz"),
    (("dance", "song.mp4", "--out"), "song.mp4"),
    (("dance", "song_1.mp4", "--samples", "3", "--out"), "song_1.mp4"),
    (("data", "learn", "corpus", "--out"), "corpus/beats.json"),
    (("play", "song.wav", "corpus", "--out"), "corpus/x.mp4"),
)
def test_what_is_read_is_not_written_over(words: tuple[str, ...], out: str, is_link: bool):
    file = name = Path(out)
    file.parent.mkdir(exist_ok=True)
    file.write_text("precious")
    if is_link:
        (name := Path(f"link{file.suffix}")).symlink_to(file)
    message = refusal(*words, name)
    assert message.startswith(f"{name}: is ") and message.endswith("choose another name for the output")
    assert file.read_text() == "precious"


def test_the_numbered_file_of_a_dance_is_not_the_song_and_retiming_from_python_spares_its_inputs_too():
    for name in ("song_1.mp4", "take.mp4"):
        Path(name).write_text("precious")
    assert "song_1.mp4: is an input" in refusal("dance", "song_1.mp4", "--samples", 3, "--out", "song.mp4")
    refused(r"take\.mp4: is an input here", retime_files, "song.wav", "take.mp4", "take.mp4")


FOREIGN = "is there already, and harmolab did not write it; choose another name, or write over it: --force"
WRITERS = (
    ("play", "--out", "x.html"),
    ("play", "--seconds", "1", "--height", "120", "--out", "x.webm"),
    ("play", "--seconds", "1", "--height", "120", "--out", "x.mp4"),
    ("retime", "--out", "x.npz"),
    ("retime", "--out", "x.bvh"),
    ("score", "--plot", "x.png"),
    ("score", "--why", "x.html"),
)


@cases(
    "words",
    *((command, "song.wav", "dance.npz", *words) for command, *words in WRITERS),
    ("dance", "song.wav", "--out", "x.bvh"),
    ("data", "learn", "corpus", "--out", "x.json"),
    ids=lambda words: words[0],
)
def test_an_output_needs_a_folder_that_may_be_written_and_is_none(words: tuple[str, ...], tmp_path: Path):
    *command, name = words
    for path in ("song.wav", "dance.npz", "corpus"):
        Path(path).touch()
    assert refusal(*command, f"nodir/{name}") == "nodir: no such folder"
    with pytest.MonkeyPatch.context() as patch:  # root may write anywhere
        patch.setattr(os, "access", lambda folder, _: folder != tmp_path)
        assert refusal(*command, name) == f"{name}: nothing may be written into its folder; name a file in another one"
    Path(name).mkdir()
    assert refusal(*command, name) == f"{name}: is a folder; name a file in it"


@pytest.mark.slow
@pytest.mark.parametrize("writer", WRITERS, ids=" ".join)
def test_a_file_of_others_is_written_over_by_force_only(pair: tuple[Any, ...], writer: tuple[str, ...]):
    command, *options, out = writer
    words = (command, *pair, *options, out)
    Path(out).write_text("precious")
    assert refusal(*words) == f"{out}: {FOREIGN}" and Path(out).read_text() == "precious"
    for force in ("--force",), ():  # what harmolab wrote it may write over
        succeed(*words, *force)
    assert is_own_file(out)
    assert [path.name for path in Path().iterdir()] == [out]


def test_a_named_pipe_is_a_file_of_others(pair: tuple[Any, ...]):
    os.mkfifo("x.npz")
    assert refusal("retime", *pair, "--out", "x.npz") == f"x.npz: {FOREIGN}" and Path("x.npz").is_fifo()


def test_beats_and_clicks_of_others_are_written_over_by_force_only(pair: tuple[Any, ...]):
    words = ("beats", pair[0], *pair[2:], "--out", "x.beats", "--clicks", "x.wav")
    Path("x.beats").write_text("# tapped by hand\n1.0\n2.0\n")
    assert refusal(*words) == f"x.beats: {FOREIGN}"
    Path("x.wav").write_text("precious")
    succeed(*words, "--force")
    succeed(*words)
    assert is_own_file("x.beats") and is_own_file("x.wav")


def test_files_named_after_the_song_are_not_written_over_either():
    soundfile.write("song.wav", np.zeros(22050), 22050)
    Path("song_dance.mp4").write_text("precious")
    assert refusal("dance", "song.wav") == f"song_dance.mp4: {FOREIGN}"
    Path("song_performance.html").write_text("precious")
    assert refusal("perform", "song.wav", "--instrument", "piano").startswith("song_performance.html: is there")


@pytest.mark.slow
def test_a_long_film_of_ours_is_known_though_its_tags_stand_neither_at_the_begin_nor_at_the_end():
    write_video("x.mp4", [np.full((16, 16, 3), 90, np.uint8)] * 7000, 30.0)
    content = Path("x.mp4").read_bytes()
    assert 2**16 < content.index(b"written by harmolab") < len(content) - 2**16 and is_own_file("x.mp4")


def test_the_files_of_other_programs_are_told_from_ours(tmp_path: Path):
    contents = {
        "a.html": "<title>my notes on harmolab</title>",
        "a.bvh": "HIERARCHY\nROOT hip\n{\n\tOFFSET 0 0 0\n\tEnd Site\n\t{\n\t\tOFFSET 0 1 0\n\t}\n}\n",
        "a.json": '{"beats_s": [1.0]}',
        "empty": "",
    }
    for name, content in contents.items():
        Path(name).write_text(content)
    assert not any(map(is_own_file, [*contents, "nothing"]))


def test_lines_end_alike_on_every_system(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "linesep", "\r\n")
    monkeypatch.setattr(io, "open", _pyio.open)  # which reads `linesep`, as Windows does
    write_text("table.csv", "a\r\n1\r\n")  # as pandas ends lines there
    assert Path("table.csv").read_bytes() == b"a\r\n1\r\n"


def test_a_study_is_made_in_an_empty_folder(corpus: Path):
    Path("mine").mkdir()
    Path("mine/key.json").write_text("{}")
    Path("mine/letter.txt").write_text("precious")
    message = "mine: holds letter.txt, which harmolab did not write; name an empty or a new folder"
    assert refusal("data", "study", "make", corpus, "mine", "--n", 2, "--seconds", 4) == message
    assert Path("mine/key.json").read_text() == "{}"


@pytest.mark.parametrize("content", ["{}", '{"beats_s": [1.0], "dance": "waltz"}', ""])
def test_learning_takes_the_place_of_patterns_only(corpus: Path, content: str):
    Path("x.json").write_text(content)
    assert refusal("data", "learn", corpus, "--out", "x.json") == f"x.json: {FOREIGN}"
    assert Path("x.json").read_text() == content
    succeed("data", "learn", corpus, "--out", "x.json", "--force")
    learnt = Path("x.json").read_text()
    said = succeed("data", "learn", corpus, "--out", "x.json").stdout
    assert "harmolab score SONG DANCE --pattern x.json --dance cha-cha" in said and Path("x.json").read_text() == learnt


@contextmanager
def small_files(limit: int) -> Iterator[None]:
    """No file may grow over so many bytes: what a full disk does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_a_line_that_names_the_sound_of_a_clip():
    with small_files(50_000):
        fault = refusal("data", "synth", "new", "--clips", 1, "--seconds", 6)
    assert fault == "new/clip_0001_cha-cha/audio.wav: File too large"
    assert [path.name for path in Path("new").iterdir()] == ["corpus.json"]


@pytest.mark.parametrize(("command", "name"), [("play", "x.html"), ("retime", "x.npz"), ("retime", "x.bvh")])
def test_a_full_disk_is_a_line_that_names_the_output(pair: tuple[Any, ...], command: str, name: str):
    with small_files(50_000):
        fault = refusal(command, *pair, "--out", name)
    assert fault == f"{name}: File too large" and list(Path().iterdir()) == []


def test_files_that_killed_processes_left_in_the_cache_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))
    old, new, foreign = (tmp_path / name for name in (".x.npz.12.34.tmp", ".y.npz.12.34.tmp", ".mine.tmp"))
    for file in (old, new, foreign):
        file.write_text("half")
    for file in (old, foreign):
        os.utime(file, (0, 0))
    keep_arrays("z", {"a": np.zeros(2)})
    assert {file.name for file in tmp_path.iterdir()} == {new.name, foreign.name, "z.npz"}


# Units


@pytest.mark.parametrize("writer", WRITERS, ids=" ".join)
def test_every_command_that_reads_a_dance_takes_its_scale(pair: tuple[Any, ...], writer: tuple[str, ...]):
    command, *options = writer
    assert "dance.npz: scale must be positive" in refusal(command, *pair, *options, "--scale", -1)


def test_a_dance_in_millimetres_is_read_by_its_scale_and_not_bent_without_strength(pair: tuple[Any, ...]):
    song, dance, *beats = pair
    words = (song, dance, *beats, "--strength", 0, "--scale", 0.001, "--out", "x.npz")
    assert "Nothing was worth bending." in succeed("retime", *words).output
    np.testing.assert_allclose(load_motion("x.npz").positions, 0.001 * load_motion(dance).positions, rtol=1e-12)


# Messages


def test_a_motion_without_a_rate_an_empty_folder_and_a_video_that_is_none_say_what_helps():
    for name in ("song.wav", "take.mp4"):
        Path(name).write_text("x")
    Path("empty").mkdir()
    np.save("m.npy", np.zeros((9, 3, 3)))
    assert refusal("score", "song.wav", "m.npy") == "m.npy: holds no frame rate; pass fps, such as --fps 25"
    assert "empty: holds no motion: neither motion.npz nor skeletons" in refusal("score", "song.wav", "empty")
    assert refusal("score", "song.wav", "take.mp4").startswith("take.mp4: cannot be read as video")


def test_a_dance_that_no_recording_dances_gets_the_list_of_those_there_are(corpus: Path):
    message = refusal("evaluate", "compare", corpus, "--dances", "polka", "--jobs", 0)
    assert message == f"{corpus}: holds no polka; its dances: cha-cha, jive"


def test_a_lag_of_years_is_refused(pair: tuple[Any, ...]):
    assert refusal("score", *pair, "--lag", "1e9") == "lag must lie within 2 s of the beat, got 1e+09"


def test_a_song_without_beats_is_danced_to_with_a_warning(tmp_path: Path):
    pytest.importorskip("torch")
    soundfile.write("quiet.wav", np.zeros(22050), 22050)
    result = run("dance", "quiet.wav", "--out", "x.npz")
    if "no weights are shipped" in result.stderr:
        pytest.skip("no weights here")
    assert result.exit_code == 0, result.output
    assert "no beats heard in quiet.wav from 0 s on" in result.stderr


def test_a_name_with_a_new_line_stays_in_one_line():
    Path("song.wav").touch()
    assert refusal("score", "song.wav", "two\nlines.npz") == r"two\nlines.npz: no such file"
    Path("two\nlines.npz").write_text("x")
    message = refusal("score", "song.wav", "two\nlines.npz")
    assert message.startswith(r"two\nlines.npz: cannot be read") and message.count("lines") == 1
    np.save("two\nlines.npy", np.zeros((9, 3, 3)))
    assert r"odd: two\nlines.npy: holds no frame rate" in run("data", "check", "two\nlines.npy").stdout


def test_a_name_too_long_to_be_written_is_that_of_the_output_and_any_other_is_written(tmp_path: Path):
    name = f"{'a' * 251}.html"
    assert refusal("play", "song.wav", "dance.npz", "--out", name) == f"{name}: File name too long"
    write_text(tmp_path / name[1:], "the longest that a file may have")
    assert [path.name for path in tmp_path.iterdir()] == [name[1:]]


def test_names_that_are_no_utf_8_are_read_drawn_and_written(pair: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("harmolab.cli.scoring.LONGEST_PLOT", 2.0)
    song, dance = (shutil.copy(path, os.fsdecode(b"m\xff") + path.suffix) for path in pair[:2])
    assert "x.png shows the first 0 minutes" in succeed("score", song, dance, *pair[2:], "--plot", "x.png").stderr
    succeed("play", song, dance, *pair[2:], "--out", "x.html")
    assert r"m\udcff" in Path("x.html").read_text()


def test_a_full_disk_behind_standard_output_is_named(pair: tuple[Any, ...]):
    words = (sys.executable, "-m", "harmolab.cli", "score", *map(str, pair))
    result = subprocess.run(["sh", "-c", '"$@" > /dev/full', "sh", *words], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (2, "harmolab: standard output: No space left on device\n")


def test_no_control_code_of_a_name_reaches_the_screen(capsys: pytest.CaptureFixture[str]):
    print_table([code := "\x1b[31m[/]"], [[code]], code, code)
    shown = capsys.readouterr().out
    assert shown.count(r"\x1b[31m[/]") == 4 and "\x1b" not in shown
    assert printable("naïve \x1b[31m\udcff\t.npz") == r"naïve \x1b[31m\udcff\t.npz"


def test_the_table_of_a_corpus_shows_its_scores_by_their_whole_names(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("COLUMNS", "80")
    row = {"auc": 0.7, "interval": (0.6, 0.8), "chance_band": (0.4, 0.6)}
    row |= {"by_dance": {key: {"auc": 0.123} for key in ("cha-cha", "quickstep", "tango", "rumba", "waltz", "samba")}}
    names = ("recommended", "paper_above_chance", "beat_align_motion")
    about = {"corpus": "corpus", "n": 70, "beats": "annotated", "null": "lagged", "fitted_on": "x", "unfitted_parts": 0}
    about["levels"] = {"true": [0, 1, 0, 0, 6]}
    lags_found = {"recommended": 21, "discriminant": 10}
    about["discriminant"] = {"auc_difference": 0.0806, "interval": [-0.05, 0.11], "lags_found": lags_found}
    print_comparison({**about, "n_sequences": 4, "scores": dict.fromkeys(names, row)})
    assert "of 4 recordings it is too narrow" in capsys.readouterr().out
    print_comparison({**about, "n_sequences": 23, "scores": dict.fromkeys(names, row)})
    table = capsys.readouterr().out
    assert "too narrow" not in table
    assert all(name in table for name in names)
    assert "0.600 to 0.800" in table and table.count("0.123") == 18 and "…" not in table
    assert "AUC is +0.081 [-0.050 to 0.110] over the learnt curve" in table
    assert "within 1/8 beat in 10 of 23 recordings, the learnt curve in 21 of 23" in table


# Sizes


@pytest.mark.slow
def test_a_slow_motion_that_would_become_too_many_frames_is_refused_before_it_is_made(pair: tuple[Any, ...]):
    save_motion("long.npz", still(500_000, fps=1.0, joints=4))
    fault = "long.npz: 500000 frames of 4 joints at 1 fps would be 50000000 frames at 100 fps, too many"
    assert refusal("score", "--why", "x.html", pair[0], "long.npz", *pair[2:]).startswith(fault)


def commands(group: Any) -> Iterator[Any]:
    for command in group.commands.values():
        yield from commands(command) if hasattr(command, "commands") else [command]


@pytest.mark.slow
def test_every_command_explains_itself_and_takes_no_option_twice():
    for words, function in functions(app):
        assert re.match("[^`]*Usage[^`]*$", succeed(*words, "--help").stdout), "no mark-up is shown"
        assert words[0] != "evaluate" or " ".join(words) in " ".join(succeed("evaluate", "--help").stdout.split())
        parameters = {name if name[0] != "_" else "_" for name in signature(function).parameters}
        assert described(function.__doc__)[1].keys() <= parameters, words
    assert 8 <= len({words[0] for words, _ in functions(app)}) <= 13, "few enough to be read at one look"
    for command in (one for one in commands(get_command(app)) if not one.hidden):
        options = [name for one in command.params for name in (*one.opts, *one.secondary_opts)]
        assert len(options) == len(set(options)), command.name
        assert {"-q", "--quiet", "-v", "--verbose"} <= set(options), command.name
        assert [one.name for one in command.params if not (one.help or one.hidden)] == [], command.name
        assert re.search("(`|    )harmolab ", command.help), command.name


def test_a_file_that_is_not_there_is_said_before_any_slow_import():
    program = (
        "import sys; from harmolab.cli import app\n"
        "try: app(['score', 'nope.mp3', 'nope.bvh'])\n"
        "finally: print(*{'numpy', 'scipy', 'pandas', 'librosa', 'matplotlib', 'torch'} & set(sys.modules))"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout.strip()) == (2, "")
    assert result.stderr == "harmolab: nope.mp3: no such file\n"
