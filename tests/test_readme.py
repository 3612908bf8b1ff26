"""The first page of the project: short, in plain words, and true of the commands that there are."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from harmolab.cli import app

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")
JARGON = r"\b(AUC|FID|chance band|M / N|p-value|null distribution|bar pattern|jerk|valleys|harmony loss|guard)\b"
TASKS = {  # what a newcomer wants, and the command for it
    "score a dance": "score",
    "see why": "play",
    "explain my video": "explain",
    "dance to a song": "dance",
    "evaluate a model's folder": "evaluate",
}


def commands_in(text: str) -> list[tuple[str, list[str]]]:
    """(command, its long options) of every call of harmolab in code blocks and in backquotes."""
    blocks = text.split("```")
    lines = [line.partition(" #")[0] for block in blocks[1::2] for line in block.splitlines()]
    calls = re.findall(r"(?:^|&& |do |\$ )harmolab ([a-z][^;&\n]*)", "\n".join(lines), flags=re.MULTILINE)
    calls += re.findall(r"`harmolab ([a-z][^`\n]+)`", "".join(blocks[::2]))
    return [(call.split()[0], re.findall(r"(?<!\S)--[\w-]+", call)) for call in calls]


def test_the_readme_is_one_page():
    assert len(README.splitlines()) <= 90
    assert max(map(len, README.splitlines())) <= 160


def test_the_readme_uses_no_word_that_it_does_not_explain():
    assert re.findall(JARGON, README) == []


def test_the_readme_has_one_command_for_each_task():
    named = [command for command, _ in commands_in(README)]
    assert {task for task, command in TASKS.items() if command not in named} == set()


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_and_option_of_the_pages_exists(page: Path):
    known = get_command(app).commands
    for command, options in commands_in(page.read_text("utf-8")):
        assert command in known, command
        parts = [known[command], *getattr(known[command], "commands", {}).values()]
        flags = {flag for part in parts for option in part.params for flag in [*option.opts, *option.secondary_opts]}
        assert set(options) <= flags | {"--help"}, f"{command}: {set(options) - flags}"


def test_the_readme_opens_with_a_moving_picture_that_is_there():
    (name,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert (ROOT / name).read_bytes()[:3] == b"GIF"
    assert (ROOT / name).stat().st_size < 2e6


def test_a_command_and_its_options_are_read_from_blocks_and_lines():
    text = "Say `harmolab beats song.mp3 --one 3`.\n```\n$ harmolab score a b --plot x.png  # a picture\n```\n"
    assert commands_in(text) == [("score", ["--plot"]), ("beats", ["--one"])]


# What is pasted runs

NOT_RUN = ("pip ", "make ")  # installing, and hours of the whole project's own work


def blocks_in(text: str, language: str) -> list[str]:
    """The code blocks of a language, "" for those that name none."""
    blocks = re.findall(r"^```(.*)\n((?:.*\n)*?)```$", text, flags=re.MULTILINE)
    return [block for name, block in blocks if name == language]


def console_commands(text: str) -> list[tuple[str, list[str]]]:
    """(command, lines of output printed below it) of the console blocks; a block without "$ " holds commands alone.

    Comments and the commands of `NOT_RUN` are left out.
    """
    commands: list[tuple[str, list[str]]] = []
    for block in blocks_in(text, ""):
        has_prompts = "$ " in block
        for line in block.splitlines():
            if line.startswith("$ ") or not has_prompts:
                commands.append((line.removeprefix("$ ").partition("  #")[0].strip(), []))
            else:
                commands[-1][1].append(line)
    return [(command, lines) for command, lines in commands if command and not command.startswith(NOT_RUN)]


def squeezed(text: str) -> str:
    """The text without white space."""
    return re.sub(r"\s+", "", text)


def test_commands_are_read_with_their_output_and_without_set_up_and_comments():
    text = "```\npip install .  # once\nharmolab demo  # a page\n```\n"
    text += "```python\nprint(1)\n```\n```\n$ ls a  # all\none\ntwo\n$ make x\n```\n"
    assert blocks_in(text, "python") == ["print(1)\n"]
    assert console_commands(text) == [("harmolab demo", []), ("ls a", ["one", "two"])]


@pytest.fixture(scope="module")
def newcomer(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """An empty folder, and an environment in which `harmolab` is this copy and no browser opens."""
    programs = tmp_path_factory.mktemp("bin")
    shim = programs / "harmolab"
    shim.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m harmolab.cli "$@"\n')
    shim.chmod(0o755)
    search = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    changes = {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": search}
    return tmp_path_factory.mktemp("newcomer"), {**os.environ, **changes, "BROWSER": "true", "COLUMNS": "100"}


@pytest.mark.slow
def test_every_block_of_the_readme_runs_as_pasted_and_prints_what_it_shows(newcomer: tuple[Path, dict[str, str]]):
    folder, environment = newcomer
    ran = console_commands(README)
    assert {command.split()[1] for command, _ in ran if command.startswith("harmolab ")} >= {"demo", *TASKS.values()}
    for command, lines in ran:
        run = subprocess.run(["sh", "-ec", command], cwd=folder, env=environment, capture_output=True, text=True)
        assert run.returncode == 0, f"{command}\n{run.stderr}"
        missing = [line for line in lines if squeezed(line) not in squeezed(run.stdout + run.stderr)]
        assert missing == [], f"{command}\n{run.stdout}"
    for block in blocks_in(README, "python"):
        run = subprocess.run([sys.executable, "-c", block], cwd=folder, env=environment, capture_output=True, text=True)
        assert run.returncode == 0 and run.stdout.strip(), run.stderr
