"""The first page of the project: short, in plain words, and true of the commands that there are."""

from __future__ import annotations

import re
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
    assert len(README.splitlines()) <= 70
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
