"""What commands say beside their results: less with --quiet, more with --verbose, lines without a terminal."""

import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from typer.main import get_command

from harmolab.cli import PANELS, app, screen
from tests.builders import called, cases, planted_dance, write_dance, write_song

run = partial(called, app)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, ...]:
    """A song of 6 s, a dance of 6 s, and the option with the song's beats."""
    folder, clip = tmp_path_factory.mktemp("pair"), planted_dance()
    (folder / "song.beats").write_text("".join(f"{time:.4f}\n" for time in clip.beats.times))
    song, dance = write_song(folder / "song.wav", clip), write_dance(folder / "dance.npz", clip)
    return song, dance, "--beats", folder / "song.beats"


def test_quiet_leaves_the_results_alone(pair: tuple[object, ...], tmp_path: Path) -> None:
    usual, quiet = run("score", *pair), run("score", *pair, "-q")
    assert quiet.stdout == usual.stdout and quiet.stderr == ""
    page = run("--quiet", "play", *pair, "--out", tmp_path / "x.html")
    assert page.exit_code == 0 and page.output == "" and (tmp_path / "x.html").is_file()


def test_quiet_does_not_silence_a_refusal() -> None:
    assert run("score", "-q", "nothing.wav").stderr == "harmolab: nothing.wav: no such file\n"


def test_verbose_says_what_is_read_and_with_which_settings(pair: tuple[object, ...]) -> None:
    lines = run("score", *pair, "--lag", "0.1", "-v").stderr
    assert "lag 0.1" in lines and "by default mode both" in lines
    assert f"reads beats: {pair[-1]}" in lines
    assert "dance.npz: npz, 360 frames of 21 joints at 60 a second" in lines


def test_verbose_shows_where_an_error_arose() -> None:
    usual, verbose = run("score", "nothing.wav"), run("-v", "score", "nothing.wav")
    assert "Traceback" not in usual.stderr
    assert "Traceback" in verbose.stderr and verbose.stderr.endswith(usual.stderr)
    assert usual.exit_code == verbose.exit_code == 2


def test_quiet_and_verbose_exclude_each_other() -> None:
    assert "exclude each other" in run("score", "x.wav", "-q", "-v").stderr


def test_every_command_takes_both() -> None:
    commands = list(get_command(app).commands.values())  # type: ignore[attr-defined]
    commands += [part for one in commands for part in getattr(one, "commands", {}).values()]
    single = [one for one in commands if not hasattr(one, "commands")]
    assert len(single) > 18
    for command in single:
        options = {name for one in command.params for name in one.opts}
        assert {"-q", "--quiet", "-v", "--verbose"} <= options, command.name


def test_long_work_says_a_line_every_while_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(screen, "EVERY", 0.05)
    for _ in screen.progress([1, 2, 3], "scoring"):
        time.sleep(0.2)
    with screen.waiting("listening"):
        time.sleep(0.12)
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith("harmolab: scoring: 1 of 3 (") for line in lines)
    assert any(line.startswith("harmolab: listening (") for line in lines)
    assert len(lines) < 10


def test_short_work_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(screen.progress([1, 2], "scoring")) == [1, 2]
    assert capsys.readouterr().err == ""


def test_what_a_decoder_in_c_prints_does_not_reach_the_screen() -> None:
    code = (
        "import os, sys; from harmolab.cli.screen import quiet_decoders\n"
        "with quiet_decoders():\n    os.write(2, b'part2_3_length'); print('ours', file=sys.stderr)\n"
        "os.write(2, b'after')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "ours\nafter"


# Help


def test_the_demo_is_the_first_command() -> None:
    assert next(iter(PANELS.values()))[0].__name__ == "demo"
    listed = run("--help").stdout
    places = [
        listed.index(f" {name} ") for name in ("demo", "score", "explain", "beats", "evaluate", "convert", "train")
    ]
    assert places == sorted(places)


def test_every_command_has_an_example() -> None:
    for name, command in get_command(app).commands.items():  # type: ignore[attr-defined]
        for each in getattr(command, "commands", {name: command}).values():
            assert "`harmolab " in (each.help or "") or "    harmolab " in (each.help or ""), each.name


@cases(
    "words, expected",
    ("harmolab sc", {"score"}),
    ("harmolab score --dance c", {"cha-cha"}),
    ("harmolab retime --method l", {"lee2019"}),
    ("harmolab dance --style p", {"puppet"}),
    ("harmolab train --system mus", {"music2dance"}),
)
def test_the_shell_completes_commands_and_choices(words: str, expected: set[str]) -> None:
    environment = {"_HARMOLAB_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    assert set(run_with(environment).split()) == expected


def run_with(environment: dict[str, str]) -> str:
    """Output of the command with these variables alone."""
    from typer.testing import CliRunner

    return CliRunner().invoke(app, [], prog_name="harmolab", env=environment).stdout
