"""What the documents say exists and runs as pasted; public names; the files of the project agree with each other."""

import ast
import dataclasses
import doctest
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from importlib.metadata import distribution, requires
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import soundfile
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from typer.main import get_command

import harmolab
import harmolab.lab
import harmolab.musician
import harmolab.systems
import study
from harmolab import load_motion, save_motion, synthetic_clip, write_corpus, write_video
from harmolab.cli import app
from harmolab.lab.render.video import write_dance
from harmolab.params import HarmonyParams
from tests.builders import cases
from tests.tiny_run import Numbers, square

ROOT = Path(__file__).resolve().parents[1]
CONVENTIONS = ROOT / "docs" / "conventions.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def rows(path: Path) -> Iterator[list[str]]:
    """Cells of every table row of a document, headings and rules left out."""
    lines = path.read_text("utf-8").splitlines()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line.startswith("|") and not line.startswith("|---") and not following.startswith("|---"):
            yield [cell.strip() for cell in line.strip().strip("|").split(" | ")]


def dotted_names(path: Path) -> list[str]:
    """Backticked names with a dot in the tables of a document: module.name or module.Class.field."""
    cells = " ".join(cell for row in rows(path) for cell in row)
    return sorted(set(re.findall(r"`([a-z]\w*(?:\.\w+)+)`", cells)) - {"beats.json"})


def resolve(name: str) -> object:
    """What a dotted name below harmolab, or of the notebooks' study, means; AttributeError when nothing."""
    words = name.split(".")
    top = [] if words[0] == "study" else ["harmolab"]
    for cut in range(len(words), 0, -1):
        try:
            found: object = importlib.import_module(".".join([*top, *words[:cut]]))
        except ModuleNotFoundError as error:
            if not str(error.name).startswith(("harmolab", "study")):
                raise
            continue
        for word in words[cut:]:
            fields = dataclasses.fields(found) if dataclasses.is_dataclass(found) else ()
            found = next((one for one in fields if one.name == word), None) or getattr(found, word)
        return found
    raise AttributeError(name)


NO_NOUNS = {"found", "told", "heard", "seen", "wanted", "made", "chosen", "known", "asked", "mine", "given", "shown"}
NO_NOUNS |= {"here", "there", "critic", "goes_on", "written_aside"}
NO_RESULTS = ("What ", "Where ", "Whether ", "How ", "Who ", "Why ")


def unsearchable_words(source: str) -> Iterator[tuple[int, str]]:
    """(line, word) of variables and functions that are no nouns, and docstrings that do not say what is returned."""
    for node in ast.walk(ast.parse(source)):
        name = ""
        if isinstance(node, ast.arg):
            name = node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = node.name
        if name.strip("_") in NO_NOUNS:
            yield node.lineno, name
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            text = ast.get_docstring(node) or ""
            if text.startswith(NO_RESULTS) or re.search(r"\b(nobody|somebody)\b", text, re.IGNORECASE):
                yield getattr(node, "lineno", 1), text.partition("\n")[0]


def test_the_package_keeps_to_its_words():
    paths = sorted((ROOT / "harmolab").rglob("*.py"))
    assert [(path.name, *word) for path in paths for word in unsearchable_words(path.read_text("utf-8"))] == []


def test_words_that_cannot_be_searched_for_are_noticed():
    source = 'def told(given, beats):\n    """What is hit."""\n    for found in beats:\n        pairs = found\n'
    assert sorted(unsearchable_words(source)) == [(1, "What is hit."), (1, "given"), (1, "told"), (3, "found")]


def exists(name: str) -> bool:
    try:
        return resolve(name) is not None
    except AttributeError:
        return False


def test_every_name_in_the_conventions_exists():
    names = dotted_names(CONVENTIONS)
    assert len(names) > 50
    assert [name for name in names if not exists(name)] == []
    wrong = ["body.kinematics.joint_sped", "types.Motion.position", "nothing.at_all"]
    assert [name for name in [*wrong, "body.kinematics.joint_speed"] if not exists(name)] == wrong


def test_every_name_below_harmolab_or_study_that_a_page_names_exists():
    pages = [*sorted((ROOT / "docs").glob("*.md")), *ROOT.glob("*.md")]
    named = {
        (page.name, name.removeprefix("harmolab."))
        for page in pages
        if page.name != "CHANGELOG.md"  # also has what went
        for name in re.findall(r"`((?:harmolab|study)(?:\.[A-Za-z_]\w*)+)[`(]", page.read_text("utf-8"))
    }
    assert len(named) > 40
    assert [one for one in sorted(named) if not (exists(one[1]) or hasattr(harmolab, one[1]))] == []


def test_settings_of_paper_mode_are_as_the_conventions_say():
    paper = HarmonyParams.paper()
    told = {row[1].strip("`").rpartition(".")[2]: row[2] for row in rows(CONVENTIONS) if "HarmonyParams." in row[1]}
    numbers = {name: float(value.split()[0]) for name, value in told.items() if re.match(r"\d", value)}
    assert len(numbers) == 5
    assert numbers == {name: getattr(paper, name) for name in numbers}


def test_every_module_of_the_numeric_core_is_in_the_conventions():
    named = {name.rpartition(".")[0] for name in dotted_names(CONVENTIONS)}
    modules = {"score", "shape_speed", "significance"}
    for folder in ("beats", "body", "metrics", "verdict"):
        modules |= {f"{folder}.{path.stem}" for path in (ROOT / "harmolab" / folder).glob("[a-z]*.py")}
    assert modules <= named


def linked_files() -> list[tuple[str, str]]:
    """(document, target) of every relative link in the documents."""
    documents = [*sorted((ROOT / "docs").glob("*.md")), *sorted(ROOT.glob("*.md"))]
    return [
        (str(path.relative_to(ROOT)), target)
        for path in documents
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text("utf-8"))
        if "://" not in target and not target.startswith("mailto:")
    ]


def test_every_link_of_the_documents_leads_to_a_file():
    links = linked_files()
    assert len(links) > 10
    assert [link for link in links if not (ROOT / link[0]).parent.joinpath(link[1]).exists()] == []


def test_every_test_the_documents_name_exists():
    sources = {path.name: path.read_text("utf-8") for path in (ROOT / "tests").glob("test_*.py")}
    functions = {name for source in sources.values() for name in re.findall(r"^def (test_\w+)", source, re.MULTILINE)}
    for document in [*(ROOT / "docs").glob("*.md"), ROOT / "CONTRIBUTING.md"]:
        for name in re.findall(r"`(?:tests/)?(test_\w+(?:\.py)?)`", document.read_text("utf-8")):
            assert name in sources or any(one.startswith(name) for one in functions), f"{document.name} names {name}"


def test_documents_do_not_speak_of_the_machine_they_were_written_on():
    for document in [*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")]:
        found = re.search(r"/work/|/root/|/home/\w", document.read_text("utf-8"))
        assert found is None, f"{document.name}: {found and found.group()}"


# The first page: short, in plain words, and true of the commands that there are

README = (ROOT / "README.md").read_text("utf-8")
JARGON = r"\b(AUC|FID|chance band|M / N|p-value|null distribution|bar pattern|jerk|valleys|harmony loss|guard)\b"
TASKS = {  # what a newcomer wants, and the command for it
    "score a dance": "score",
    "see why": "play",
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


RESULTS = {row[0]: row[1:] for row in rows(ROOT / "docs" / "results.md")}
FORM = {
    "recorded ballroom dancers, their own 22 songs": "recorded, right song",
    "the same, to these songs": "recorded, another song",
    "choreographer, of those recordings": "choreographer",
    "choreographer, salsa": "choreographer, shipped bank",
    "HarmoGAN, our loss": "HarmoGAN, recommended loss",
    "HarmoGAN, the paper's loss": "HarmoGAN",
    "Ren et al. 2020": "Ren et al. 2020",
    "Music2Dance, recommended": "Music2Dance, recommended",
}


def brief(value: float) -> str:
    """A number as the results print it: two digits, no zero before the point."""
    return f"{round(value, 2) + 0.0:.2f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.2f}"


def published(table: str, **keys: str | bool) -> pd.DataFrame:
    """The rows of a published table that have these words in these columns."""
    frame = pd.read_csv(ROOT / "figures" / f"{table}.csv")
    return frame[(frame[list(keys)] == list(keys.values())).all(axis=1)]


@cases("row", *FORM)
def test_results_on_the_form_of_songs_are_the_published_ones(row: str) -> None:
    of_row = {"corpus": "beatlocked", "system": FORM[row]}
    form = published("table12d_form", **of_row).iloc[0].drop(["corpus", "system", "songs"]).map(brief)
    beats = published("table12c_beat_alignment", **of_row).iloc[0].drop(["corpus", "system", "music"]).map(brief)
    loudness = f"{form['loudness']} ({form['loudness, standard error']})"
    others = form[["loudness, other songs", "silence", "ending"]]
    assert RESULTS[row] == [loudness, *others, " / ".join(beats[:3]), " / ".join(beats[3:])]


@cases("row", *(f"{corpus}, {loss}" for corpus in ("recordings", "synthetic") for loss in ("paper's", "recommended")))
def test_results_on_the_harmony_loss_are_the_published_ones(row: str) -> None:
    corpus, loss = row.replace("recordings", "beatlocked").replace("'s", "").split(", ")
    gains = published("table11b_gains", corpus=corpus, loss=loss).set_index("measure")[["without", "with"]]
    means = published("table11_ablation", corpus=corpus, variant=loss).set_index("measure")["mean"].map(brief)
    ends = gains.map(brief).agg(" to ".join, axis=1)[["paper_harmony", "paper_hit_rate", "above_chance"]]
    assert all(map(str.startswith, RESULTS[row], ends))
    assert RESULTS[row][3:6] == means[["body_above_chance", "statue_above_chance", "count_ratio"]].tolist()


LEVELS = {
    "**found by a program, nothing told**": ("beatlocked", "tracked", False),
    "found by a program, the dance told: its tempi and its course": ("beatlocked", "tracked", True),
    "annotated, nothing told": ("beatlocked", "annotated", False),
    "annotated, course of the dance told": ("beatlocked", "annotated", True),
    "street dance, 58 takes: annotated, nothing told": ("aist", "annotated", False),
    "street dance, 58 takes: found by a program, nothing told": ("aist", "tracked", False),
}


@cases("row", *LEVELS)
def test_results_on_what_a_dancer_is_told_are_the_published_ones(row: str) -> None:
    corpus, beats, dance_told = LEVELS[row]
    levels = published("table08i_levels", corpus=corpus, beats=beats, told=dance_told)
    assert [cell.replace("*", "") for cell in RESULTS[row]] == levels.fillna("").iloc[0, 3:].tolist()


def test_each_verdict_that_is_not_on_the_beat_has_its_advice_on_the_page_of_scores():
    code = (ROOT / "harmolab" / "verdict" / "sentences.py").read_text("utf-8")
    openings = re.findall('"((?:Cannot|No sign|You keep|You are in|In time)[^:.{"]*)', code)
    page = (ROOT / "docs" / "scoring.md").read_text("utf-8")
    advice = page.partition("### What you can do next")[2].partition("###")[0]
    assert {words.strip() for words in openings} <= set(re.findall('"([^"]+)"', advice))


SYSTEMS = {
    "recorded dancers, their own song": "recorded, right song",
    "recorded dancers, another song": "recorded, another song",
    "recorded dancers, retimed to the song": "recorded, retimed",
    "random pieces of recordings, rests laid on the beats": "random pieces, rests on beats",
    "choreographer, which chooses by a bar pattern": "choreographer",
    "choreographer of salsa, which lays rests on the beats": "choreographer, shipped bank",
    "HarmoGAN with our loss, which is trained for a bar pattern": "HarmoGAN, recommended loss",
    "HarmoGAN with the paper's loss": "HarmoGAN",
    "HarmoGAN without a harmony loss": "HarmoGAN without L_harmo",
    "Ren et al., one training": "Ren et al. 2020",
    "Music2Dance with our settings": "Music2Dance, recommended",
    "Music2Dance as its paper prints it": "Music2Dance",
}


@cases("row", *SYSTEMS)
def test_results_on_systems_are_the_published_ones(row: str) -> None:
    system = published("table12_systems", corpus="beatlocked", system=SYSTEMS[row]).set_index("music")
    measures = ["hit_rate", "hit_rate chance", "pattern", "body", "body, late"]
    hits, chance, pattern, rests, late = system.loc["recorded songs", measures].map(brief)
    guard = system["guard"].reindex(["synthetic songs", "recorded songs"], fill_value="-")
    assert RESULTS[row] == [f"{hits} ({chance})", pattern, f"{rests} ({late})", *guard]


SONGS = {
    "recorded, to these songs": "recorded",
    "sketch, to these songs": "sketch",
    "**corrected**, three trainings": "recommended",
    "corrected without harmony": "recommended, without",
    "corrected without discriminators": "recommended, no discriminators",
    "search on the sketch, to these songs": "search",
}


@cases("row", *SONGS)
def test_results_on_songs_kept_from_training_are_the_published_ones(row: str) -> None:
    songs = published("table09c_own_songs", motion=SONGS[row]).iloc[0]
    measures = songs[["pattern", "pattern, late", "pattern, other song", "body"]].map(brief)
    assert RESULTS[row] == [*measures, songs["guard"]]


def test_the_readme_is_one_page_of_words_that_it_explains_with_a_command_for_each_task():
    assert len(README.splitlines()) <= 90
    assert max(map(len, README.splitlines())) <= 160
    assert re.findall(JARGON, README) == []
    named = [command for command, _ in commands_in(README)]
    assert any(options for _, options in commands_in(README))
    assert {task for task, command in TASKS.items() if command not in named} == set()


def with_parts(command: Any) -> Iterator[Any]:
    """A command, and all commands that are called by its name and another word."""
    yield command
    yield from (command.part(name) for name in getattr(command, "parts", ()))
    for one in getattr(command, "commands", {}).values():
        yield from with_parts(one)


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_and_option_of_the_pages_exists(page: Path):
    known = get_command(app).commands
    for command, options in commands_in(page.read_text("utf-8")):
        assert command in known, command
        flags = {
            flag
            for part in with_parts(known[command])
            for option in part.params
            for flag in [*option.opts, *option.secondary_opts]
        }
        assert set(options) <= flags | {"--help"}, f"{command}: {set(options) - flags}"


def test_the_readme_opens_with_a_moving_picture_that_is_there():
    (name,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert (ROOT / name).read_bytes()[:3] == b"GIF"
    assert (ROOT / name).stat().st_size < 2e6


# What is pasted runs

MODULES = sorted((ROOT / "harmolab").rglob("*.py"))
EXAMPLES = [path for path in MODULES if re.search(r">>> (?!.*\+SKIP)", path.read_text("utf-8"))]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_of_docstrings_print_what_they_show(path: Path):
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    results = doctest.testmod(importlib.import_module(name))
    assert results.failed == 0 < results.attempted


# Installing, the whole project's own work, what is fetched, and what the tutorial tries once more on less.
NOT_RUN = (
    *("pip install .", "make ", "harmolab data pose --install"),
    *("harmolab train my_corpus", "harmolab dance song.mp3 --weights run"),
)


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


def installed_with(requirements: Iterable[str]) -> set[str]:
    """All packages that `pip install` of these requirements brings, no extras."""
    needed, waiting = set[str](), [*requirements]
    while waiting:
        one = Requirement(waiting.pop())
        if one.name not in needed and (one.marker is None or one.marker.evaluate({"extra": ""})):
            needed.add(one.name)
            waiting += requires(one.name) or ()
    return needed


def link_packages(folder: Path, names: Iterable[str]) -> None:
    """Links in a folder to all that these packages have installed, so that Python finds there nothing else."""
    for package in map(distribution, names):
        for part in {file.parts[0] for file in package.files or ()} - {"..", "__pycache__"}:
            if not part.endswith(".pth"):
                (folder / part).unlink(missing_ok=True)
                (folder / part).symlink_to(str(package.locate_file(part)))


class Newcomer:
    """An empty folder, and an environment of `pip install .`: this copy, what it depends on, and no browser opens."""

    def __init__(self, root: Path) -> None:
        self.folder, self.packages = root / "folder", root / "packages"
        for folder in (self.folder, self.packages):
            folder.mkdir()
        link_packages(self.packages, {"harmolab", *installed_with(PROJECT["dependencies"])})
        for name, module in (("harmolab", "-m harmolab.cli"), ("python", "")):
            (root / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" -S {module} "$@"\n')
            (root / name).chmod(0o755)
        paths = {"PATH": f"{root}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": f"{ROOT}{os.pathsep}{self.packages}"}
        self.environment = {**os.environ, **paths, "BROWSER": "true", "COLUMNS": "100"}

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        """The call of a program, which ended well."""
        run = subprocess.run(words, cwd=self.folder, env=self.environment, capture_output=True, text=True)
        assert run.returncode == 0, f"{words[-1]}\n{run.stdout}\n{run.stderr}"
        return run

    def paste(self, text: str) -> None:
        """Every command of a text, each of which prints what is shown below it; `pip install` brings its packages."""
        for command, lines in console_commands(text):
            if command.startswith("pip install "):
                link_packages(self.packages, installed_with(command.split()[2:]))
                continue
            run = self.run("sh", "-ec", command)
            missing = [line for line in lines if squeezed(line) not in squeezed(run.stdout + run.stderr)]
            assert missing == [], f"{command}\n{run.stdout}"


@pytest.fixture
def newcomer(tmp_path: Path) -> Newcomer:
    return Newcomer(tmp_path)


@pytest.mark.slow
def test_every_block_of_the_readme_runs_as_pasted_and_prints_what_it_shows(newcomer: Newcomer):
    ran = console_commands(README)
    assert {command.split()[1] for command, _ in ran if command.startswith("harmolab ")} >= {"demo", *TASKS.values()}
    assert any(lines for _, lines in ran) and blocks_in(README, "python")
    with pytest.raises(AssertionError, match="No module named 'torch'"):
        newcomer.run("python", "-c", "import torch")
    newcomer.paste(README)
    for block in blocks_in(README, "python"):
        assert newcomer.run("python", "-c", block).stdout.strip()
    table = pd.read_csv(newcomer.folder / "table" / "table.csv").set_index("system")
    tutorial = (ROOT / "docs" / "tutorial_model.md").read_text("utf-8")
    rows = re.findall(r"^\| (\w+) \| ([-.\d]+) \| ([-.\d]+) \| ([-.\d]+) \| ([-.\d]+) \|$", tutorial, re.MULTILINE)
    assert len(rows) == 6
    for measure, *numbers in rows:
        columns = ["ours", "recorded", "recorded, other song", "frozen pose"]
        np.testing.assert_allclose(table.loc[columns, measure], list(map(float, numbers)), atol=0.0051)


def test_commands_of_the_tutorial_for_models_are_those_of_the_readme_which_run():
    commands = [command for command, _ in console_commands((ROOT / "docs" / "tutorial_model.md").read_text("utf-8"))]
    assert commands and set(commands) <= {command for command, _ in console_commands(README)}


@pytest.mark.slow
@pytest.mark.parametrize("page", ["tutorial_dance.md", "tutorial_train.md"])
def test_every_command_of_a_tutorial_runs_as_pasted(page: str, newcomer: Newcomer):
    folder, clip = newcomer.folder, synthetic_clip("waltz", seconds=20.0, fps=30.0, seed=7)
    soundfile.write(folder / "song.mp3", clip.audio.samples, round(clip.audio.sample_rate))
    if page == "tutorial_train.md":
        write_corpus(folder / "try", clips=7, seconds=30.0)
        shutil.copytree(folder / "try", folder / "my_corpus")
    else:
        write_dance(folder / "phone_video.mp4", clip)
        for name in ("me.npz", "teacher.npz", "dance.bvh"):
            save_motion(folder / name, clip.motion)
    newcomer.paste((ROOT / "docs" / page).read_text("utf-8"))


# The Python of a page runs, block after block in one folder, with what the page takes for granted


def with_songs(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Two synthetic songs in try/, and their dances in ours/."""
    for clip in sorted(write_corpus("try", clips=2, seconds=11.0, fps=30.0).glob("clip_*")):
        save_motion(Path("ours") / f"{clip.name}.npz", load_motion(clip / "motion.npz"))
    return {}


def with_dance(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    clip = synthetic_clip("waltz", seconds=11.0, fps=30.0)
    return {"motion": clip.motion, "beats": clip.beats}


def with_mediapipe(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A film, and a stand-in for MediaPipe that sees one body and one hand in every picture."""
    write_video("dance.mp4", [np.zeros((64, 48, 3), np.uint8)] * 4, fps=10.0)
    points = [SimpleNamespace(x=0.01 * place, y=0.02 * place, z=0.0, visibility=1.0) for place in range(33)]
    side = SimpleNamespace(category_name="Left", score=1.0)
    hand = SimpleNamespace(handedness=[[side]], hand_landmarks=[points[:21]])
    estimator = SimpleNamespace(detect_for_video=lambda *_: SimpleNamespace(pose_landmarks=[points], **vars(hand)))
    vision = SimpleNamespace(
        PoseLandmarkerOptions=SimpleNamespace, RunningMode=SimpleNamespace(VIDEO="video"),
        PoseLandmarker=SimpleNamespace(create_from_options=lambda _: nullcontext(estimator)),
    )  # fmt: skip
    modules = {
        "mediapipe": {"Image": lambda *_: None, "ImageFormat": SimpleNamespace(SRGB="rgb")},
        "mediapipe.tasks": {}, "mediapipe.tasks.python": {"BaseOptions": SimpleNamespace, "vision": vision},
    }  # fmt: skip
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(sys, "argv", ["landmarks.py", "dance.mp4", "pose.task", "dance.json"])
    return {}


MATERIAL = {
    "dancing.md": with_dance, "pose_estimation.md": with_mediapipe, "tutorial_model.md": with_songs,
    "scale.md": lambda monkeypatch: {"__name__": "__main__", "tasks": Numbers(3), "measure": square},
    "scoring.md": lambda monkeypatch: {},
}  # fmt: skip


def test_every_page_with_python_is_run():
    pages = {page.name for page in (ROOT / "docs").glob("*.md") if blocks_in(page.read_text("utf-8"), "python")}
    assert pages == set(MATERIAL)


@pytest.mark.slow
@pytest.mark.parametrize("page", MATERIAL)
def test_the_python_of_a_page_runs_as_pasted(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ours").mkdir()
    names = MATERIAL[page](monkeypatch)
    for block in blocks_in((ROOT / "docs" / page).read_text("utf-8"), "python"):
        exec(compile(block, page, "exec"), names)
    results = {
        "dancing.md": lambda: names["better"].n_frames == names["motion"].n_frames,
        "pose_estimation.md": lambda: names["motion"].n_frames == 4 and len(names["frames"][-1]["hands"]) == 1,
        "scale.md": lambda: (tmp_path / "rows" / "run.json").is_file(),
        "scoring.md": lambda: names["score"].harmony_above_chance > 0.5,
        "tutorial_model.md": lambda: (tmp_path / "table" / "index.html").is_file()
        and names["numbers"]["fid_kinetic"] and names["harmony"] > 0.5,
    }  # fmt: skip
    assert results[page]()


# The doors: what README and docs import from, and what notebooks may use

DOORS = {door.__name__: door for door in (harmolab, harmolab.systems, harmolab.lab, harmolab.musician, study)}


def sources() -> Iterator[tuple[str, str]]:
    """(file, Python source) of every code cell of a notebook and every code block of a document."""
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for cell in json.loads(path.read_text("utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                yield path.name, re.sub(r"^%.*$", "pass", "".join(cell["source"]), flags=re.MULTILINE)
    for path in sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")]):
        for block in re.findall(r"```(?:python|py|pycon)?\n(.*?)```", path.read_text("utf-8"), flags=re.DOTALL):
            yield path.name, "\n".join(re.findall(r"^(?:>>> )?((?:from|import) .*)$", block, flags=re.MULTILINE))


def imports() -> Iterator[tuple[str, str, str]]:
    """(file, module, name) of every import of harmolab in them; name "" for `import module`."""
    for file, source in sources():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ImportFrom) and re.match(r"(harmolab|study)\b", node.module or ""):
                yield from ((file, str(node.module), alias.name) for alias in node.names)
            if isinstance(node, ast.Import):
                yield from ((file, alias.name, "") for alias in node.names if re.match(r"harmolab\b", alias.name))


def test_readme_and_docs_import_from_the_doors():
    assert {(file, module) for file, module, _ in imports() if module not in DOORS and file.endswith("md")} == set()
    assert {module for _, module, _ in imports()} >= set(DOORS)
    assert len({file for file, _, _ in imports()}) >= 15  # the search finds them


def test_every_name_they_import_from_a_door_is_public():
    names = [(file, module, name) for file, module, name in imports() if name and module in DOORS]
    assert [(file, name) for file, module, name in names if name not in DOORS[module].__all__] == []


def test_every_public_name_resolves_to_what_is_called_so_and_hides_no_module_of_its_package():
    for door in DOORS.values():
        assert [name for name in door.__all__ if getattr(getattr(door, name), "__name__", name) != name] == []
        folder = Path(str(door.__file__)).parent
        modules = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
        assert not modules & set(door.__all__)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="scor_clip"):
        harmolab.scor_clip  # noqa: B018


def private_names(source: str) -> list[str]:
    """Names of harmolab that begin with an underscore, imported or reached through a module or an object."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and re.match(r"harmolab\b", node.module or ""):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") not in ("self", "cls"):
            names.append(node.attr)
    return [name for name in names if re.search(r"(^|\.)_(?!_|replace$|asdict$)", name)]


def test_the_study_uses_nothing_private_of_the_package():
    planted = "from harmolab.score import _with_null\nscore._secret\nself._own"
    assert private_names(planted) == ["harmolab.score._with_null", "_secret"]
    files = {path.name: path.read_text("utf-8") for path in (ROOT / "notebooks" / "study").rglob("*.py")}
    assert len(files) > 5
    files |= {f"{file} {number}": source for number, (file, source) in enumerate(sources()) if file.endswith("ipynb")}
    assert {file: names for file, source in files.items() if (names := private_names(source))} == {}


def test_the_wheel_holds_the_package_alone_and_the_package_knows_no_study():
    content = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert content["tool"]["hatch"]["build"]["targets"]["wheel"] == {"packages": ["harmolab"]}
    package = [path.read_text("utf-8") for path in (ROOT / "harmolab").rglob("*.py")]
    assert not [source for source in package if re.search(r"^\s*(from|import) study\b", source, flags=re.MULTILINE)]


# pyproject.toml, environment.yml, constraints.txt and the Makefile agree with each other

# Where conda-forge's name is not the one on PyPI.
CONDA_NAMES = {
    "build": "python-build", "opencv-python-headless": "opencv", "playwright": "playwright-python",
    "soundfile": "pysoundfile", "soxr": "soxr-python", "torch": "pytorch",
}  # fmt: skip


def requirements(*extras: str) -> list[Requirement]:
    """The core dependencies and those of the named extras."""
    parts = (PROJECT["dependencies"], *map(PROJECT["optional-dependencies"].get, extras))
    return [Requirement(line) for part in parts for line in part]


def pins() -> dict[str, str]:
    """Name -> version of constraints.txt for this Python; a line that is no exact pin fails here."""
    found = {}
    for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines():
        if line and not line.startswith("#"):
            requirement = Requirement(line)
            (pin,) = requirement.specifier
            assert pin.operator == "=="
            if requirement.marker is None or requirement.marker.evaluate():
                found[canonicalize_name(requirement.name)] = pin.version
    return found


def conda_packages() -> dict[str, SpecifierSet]:
    """Name -> version bounds of environment.yml, without python and pip."""
    document = yaml.safe_load((ROOT / "environment.yml").read_text("utf-8"))
    parts = ([part] if isinstance(part, str) else part["pip"] for part in document["dependencies"])
    lines = [line for part in parts for line in part]
    parsed = [re.fullmatch(r"([\w.-]+)(.*)", line).groups() for line in lines]
    return {name: SpecifierSet(bounds) for name, bounds in parsed if name not in ("python", "pip")}


def test_conda_environment_names_the_same_packages_with_the_same_bounds_and_python():
    expected = {}
    for requirement in requirements("lab", "train", "cluster", "docs", "dev"):
        expected[CONDA_NAMES.get(canonicalize_name(requirement.name), requirement.name)] = requirement.specifier
    assert conda_packages() == expected
    document = yaml.safe_load((ROOT / "environment.yml").read_text("utf-8"))
    assert f"python{PROJECT['requires-python']}" in document["dependencies"]
    assert document["channels"][0] == "conda-forge"


def test_every_direct_dependency_is_pinned_within_its_bounds():
    versions, direct = pins(), requirements(*PROJECT["optional-dependencies"])
    found = {one: versions.get(canonicalize_name(one.name), "0") for one in direct}
    assert [str(one) for one, version in found.items() if not one.specifier.contains(version)] == []


def test_hints_name_packages_that_an_index_has_and_all_of_them():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "notebooks").glob("*")]
    texts = {path: path.read_text("utf-8") for path in (*pages, *(ROOT / "harmolab").rglob("*.py")) if path.is_file()}
    assert [path.name for path, text in texts.items() if re.search(r"harmolab\[[a-z]|pip install '\.\[", text)] == []
    extras = PROJECT["optional-dependencies"]
    for path in ("harmolab/cli/training.py", "docs/tutorial_train.md", "docs/dancing.md"):
        hint = re.search(r"pip install (lightning[-\w ]+)", (ROOT / path).read_text("utf-8"))
        assert hint and set(hint[1].split()) == {Requirement(line).name for line in extras["train"]}, path


def test_scoring_does_not_depend_on_torch_or_jupyter():
    names = {requirement.name for requirement in requirements()}
    assert names.isdisjoint({"torch", "lightning-fabric", "jupyterlab", "ipywidgets", "dask"})


def test_citation_names_the_software_and_three_papers():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == PROJECT["version"]
    titles = [reference["title"].split(":")[0] for reference in citation["references"]]
    assert titles == ["Harmony-aware Human Motion Synthesis with Music", "Music2Dance", "Audio to Body Dynamics"]


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not on this machine")
def test_make_lists_every_promised_target_and_says_which_python_is_needed_if_the_one_named_is_missing(tmp_path: Path):
    listing = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    promised = "setup test test-browser check lint lab report figures docs dist bench clean"
    assert set(promised.split()) <= set(re.findall(r"^  make (\S+)", listing, flags=re.MULTILINE))
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    result = subprocess.run(["make", "setup", "PYTHON=no-such-python"], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode != 0
    assert "needs Python 3.11 or later" in result.stderr
