"""`harmolab train`: help that teaches, a run from folders to weights, one line for a refusal, a bar to watch."""

import csv
import inspect
import json
import os
import pty
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import typer
from filelock import FileLock
from typer.testing import CliRunner, Result

from harmolab import write_corpus
from harmolab.cli import app as harmolab
from harmolab.cli import training
from harmolab.cli.training import VALIDATED, epoch_bar, train
from harmolab.systems import ModelParams, TrainParams
from harmolab.systems.harmogan.networks import load_generator
from harmolab.systems.training import checkpoints
from tests.builders import cases

Run = Callable[..., Result]
STEP = re.compile(r"harmolab: [\w ]+: \d+ of \d+ \(\d+ s\)")  # a line of a slow machine


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight synthetic dances of ten seconds."""
    return write_corpus(tmp_path_factory.mktemp("corpora") / "synth", clips=8, seconds=10.0, fps=30.0, seed=2)


@pytest.fixture(scope="module")
def run() -> Run:
    """`run(arguments...)` of the command, with a model and a schedule for a second."""
    app = typer.Typer(rich_markup_mode="markdown")
    app.command()(train)
    quick = {"pretrain_epochs": 2, "adversarial_epochs": 1, "pose_epochs": 1, "batch_size": 50}
    tiny = ModelParams(hidden=8, layers=1, pose_features=8, discriminator=4)
    kept = {name: replace(getattr(TrainParams, name)(), **quick) for name in ("paper", "recommended")}

    def invoke(*arguments: object) -> Result:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ModelParams, "small", lambda: tiny)
            patch.setattr(training, "LONGEST", float("inf"))  # no more lines where epochs take long
            for name, params in kept.items():
                patch.setattr(TrainParams, name, lambda params=params: params)
            return CliRunner().invoke(app, [*map(str, arguments), "--accelerator", "cpu"], env={"COLUMNS": "200"})

    return invoke


def test_help_teaches(run: Run):
    shown = " ".join(run("--help").stdout.split())
    for told in (
        "9 adversarial epochs that correct sketches", "split.json says how", "history.csv has every loss term",
        "tensorboard --logdir RUN", "--resume goes on where the run was, after a kill too", "0 is the ablation",
        "harmolab train DATA --out without --harmony-weight 0", "harmolab dance SONG --weights RUN",
        "small (1 M parameters, a laptop) or paper (7 M)", "harmolab data check", "torchrun --nproc-per-node 2",
        "predicts a dance frame by frame", "harmolab train DATA --system music2dance --out RUN",
        "harmolab train DATA --system feet --out RUN/feet",
        "harmolab train DATA --system attributes --out RUN/attributes",
        "a fifth of the songs of each dance", "Neither dances by itself",
    ):  # fmt: skip
        assert told in shown, told


@pytest.fixture(scope="module")
def trained(run: Run, corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("runs") / "run"
    return out, run(corpus, "--out", out)


def test_folders_become_a_generator(trained: tuple[Path, Result]):
    out, result = trained
    assert result.exit_code == 0, result.output
    assert load_generator(out / "model").skeleton.joints[0] == "head L"
    assert f"harmolab dance SONG --weights {out}" in result.stdout
    settings = json.loads((out / "settings.json").read_text())
    assert settings["train"]["sketches"] == 4 and settings["model"]["bounded"] and settings["features"]["bar_channels"]
    assert (out / "sketches" / "model.npz").is_file()


def test_without_a_terminal_there_is_a_line_for_each_validated_epoch(trained: tuple[Path, Result]):
    lines = [line for line in trained[1].stderr.splitlines() if not STEP.fullmatch(line)]
    assert lines[0].startswith("units: ") and "synth" in lines[0]
    assert [line.split(":")[0] for line in lines[1:]] == ["pretrain epoch 2", "adversarial epoch 3"]
    assert " val_harmony " in lines[2] and " critic_st " in lines[2]


@pytest.mark.slow
def test_validation_has_measures_of_evaluate_and_training_is_the_same_without(
    trained: tuple[Path, Result], run: Run, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    names = ["val_beat_align_motion", "val_beat_align_music", "val_mir_eval_f", "val_foot_skating", "val_jerk"]
    rows = list(csv.DictReader((trained[0] / "history.csv").read_text().splitlines()))
    last = {name: float(rows[-1][name]) for name in names}
    assert 0 < last["val_beat_align_motion"] <= 1 and last["val_foot_skating"] > 0 and last["val_jerk"] > 0
    assert " val_beat_align_motion " in trained[1].stderr.splitlines()[-1]
    monkeypatch.setattr(training, "VALIDATED", ())
    assert run(corpus, "--out", tmp_path / "run").exit_code == 0
    plain = list(csv.DictReader((tmp_path / "run" / "history.csv").read_text().splitlines()))
    assert plain == [{name: value for name, value in row.items() if name in plain[0]} for row in rows]
    assert set(rows[0]) - set(plain[0]) == {f"val_{name}" for name in VALIDATED}
    assert files(tmp_path / "run")["model.safetensors"] == files(trained[0])["model.safetensors"]


def test_quiet_trainings_print_results_only(capsys: pytest.CaptureFixture[str]):
    token = training.LEVEL.set(training.USUAL - 1)
    for line in ("units: 9 train", "songs: 7 train", "test songs: 1 of 7"):
        training._notice(line)
    training.LEVEL.reset(token)
    assert capsys.readouterr().err == "test songs: 1 of 7\n"


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} if folder.is_dir() else {}


def told(result: Result) -> str:
    """The one line that a refusal prints; the bar, steps of a slow machine and the count of units may stand before."""
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    lines = [line for line in result.stderr.splitlines() if not line.startswith("units: ") and not STEP.fullmatch(line)]
    assert len(lines) == 1, result.stderr
    return lines[0]


@cases(
    "option, value, line",
    ("--preset", "large", "preset must be small or paper, got 'large'"),
    ("--harmony-weight", "-1", "harmony_weight must be zero or more, got -1.0"),
    ("--harmony-weight", "nan", "harmony_weight must be zero or more, got nan"),
)
def test_an_unknown_choice_is_named(option: str, value: str, line: str, run: Run, tmp_path: Path):
    result = run(tmp_path / "nowhere", "--out", tmp_path / "run", option, value)
    assert told(result) == f"harmolab: {line}" and not (tmp_path / "run").exists()


@pytest.mark.parametrize(("option", "value"), [("--accelerator", "tpu"), ("--params", "ours")])
def test_a_choice_of_few_is_checked_before_any_work(option: str, value: str, corpus: Path, tmp_path: Path):
    result = CliRunner().invoke(harmolab, ["train", str(corpus), "--out", str(tmp_path / "run"), option, value])
    assert told(result).startswith(f"harmolab: Invalid value for '{option}': '{value}' is not one of ")


@cases(
    "name, size, message",
    ("nowhere", None, "nowhere: no such folder"),
    ("empty", (0, 0.0), "empty: there is no recording"),
    ("short", (2, 2.0), "no unit to train on below .*short"),
    ("few", (1, 10.0), "more recordings"),
)
def test_a_corpus_that_fails_is_told(name: str, size: tuple[int, float] | None, message: str, run: Run, tmp_path: Path):
    if size is not None:
        (tmp_path / name).mkdir()
        if size[0]:
            write_corpus(tmp_path / name, clips=size[0], seconds=size[1], fps=30.0, seed=2)
    assert re.search(message, told(run(tmp_path / name, "--out", tmp_path / "run")))
    assert not (tmp_path / "run").exists()


def test_a_folder_in_use_is_refused_before_any_recording_is_read(
    trained: tuple[Path, Result], run: Run, tmp_path: Path
):
    out, before = trained[0], files(trained[0])
    line = told(run("/nowhere/at/all", "--out", out))
    assert line == f"harmolab: {out}: is not empty; use --resume to go on with a run there, or choose another folder"
    assert files(out) == before
    with FileLock(tmp_path / ".lock"):  # of a training that has only begun to read
        line = told(run("/nowhere/at/all", "--out", tmp_path))
    assert line == f"harmolab: {tmp_path}: another process is training there"


@pytest.mark.slow
@cases("option, words", ("--split-seed", "seed is 0, but 1"), ("--step", "step is 2, but 1"))
def test_resuming_with_another_seed_or_step_of_the_units_names_both(
    option: str, words: str, trained: tuple[Path, Result], run: Run, corpus: Path
):
    out, before = trained[0], files(trained[0])
    assert f"{out}/split.json: {words} is asked for" in told(run(corpus, "--out", out, "--resume", option, 1))
    assert files(out) == before


@pytest.mark.slow
def test_resuming_after_a_movement_has_changed_names_its_file(trained: tuple[Path, Result], run: Run, corpus: Path):
    out, before = trained[0], files(trained[0])
    motion = next(corpus.glob("*/motion.npz"))
    recorded = motion.read_bytes()
    with np.load(motion) as held:
        np.savez(motion, **{**held, "positions": 1.01 * held["positions"]})
    result = run(corpus, "--out", out, "--resume")
    motion.write_bytes(recorded)
    name, line = motion.relative_to(corpus.parent), told(result)
    assert "units: " not in result.stderr  # nothing was read before
    assert line.startswith(f"harmolab: {out}/corpus.json: {name} is not what it was when this training began")
    assert files(out) == before


@pytest.mark.parametrize(("ending", "code"), [(KeyboardInterrupt(), 130), (SystemExit(143), 143)])
def test_after_ctrl_c_or_a_signal_to_end_there_is_a_line_that_says_how_to_go_on(
    ending: BaseException, code: int, monkeypatch: pytest.MonkeyPatch, run: Run, tmp_path: Path
):
    monkeypatch.setattr("harmolab.systems.music2dance.Music2Dance.train", Mock(side_effect=ending))
    result = run(tmp_path, "--out", tmp_path / "run", "--system", "music2dance")
    assert result.exit_code == code
    assert "harmolab: stopped; the same command with --resume goes on from there\n" in result.stderr


def test_a_setting_called_otherwise_is_named_by_option_too(monkeypatch: pytest.MonkeyPatch, run: Run, tmp_path: Path):
    def train(*given: object, **options: object) -> None:
        raise ValueError("settings.json: music2dance.first_epochs is 3, but 4 is asked for")

    monkeypatch.setattr("harmolab.systems.music2dance.Music2Dance.train", train)
    line = told(run(tmp_path, "--out", tmp_path / "run", "--system", "music2dance"))
    assert line == "harmolab: settings.json: music2dance.first_epochs (--phase1) is 3, but 4 is asked for"


@pytest.mark.slow
def test_defaults_of_the_help_are_those_of_the_settings():
    for name in ("harmony_weight", "pretrain_epochs", "adversarial_epochs", "pose_epochs"):
        usual, paper = (getattr(params, name) for params in (TrainParams.recommended(), TrainParams.paper()))
        option = inspect.get_annotations(train)[name].__metadata__[0]
        assert option.show_default == (f"{usual:g}" if usual == paper else f"{usual:g}; {paper:g} in paper")


def test_pretraining_of_a_run_that_is_none_is_told(run: Run, corpus: Path, tmp_path: Path):
    line = told(run(corpus, "--out", tmp_path / "run", "--pretrained", tmp_path / "nowhere"))
    assert line == f"harmolab: {tmp_path / 'nowhere' / 'settings.json'}: no such file"
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_the_ablation_takes_over_pretraining(trained: tuple[Path, Result], run: Run, corpus: Path, tmp_path: Path):
    out = tmp_path / "without"
    result = run(corpus, "--out", out, "--harmony-weight", 0, "--pretrained", trained[0])
    assert result.exit_code == 0, result.output
    header, *rows = (out / "history.csv").read_text().splitlines()
    assert len(rows) == 1 and "harmony" not in header.split(",")
    line = told(run(corpus, "--out", tmp_path / "third", "--pretrained", out))  # which took its own from another run
    assert line == f"harmolab: {out}: has no pretraining to take over; leave --pretrained out"
    assert not (tmp_path / "third").exists()


def test_without_the_libraries_training_says_what_to_install(monkeypatch: pytest.MonkeyPatch, run: Run, tmp_path: Path):
    for name in [name for name in sys.modules if name.startswith("harmolab.systems")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "lightning_fabric", None)
    line = told(run(tmp_path, "--out", tmp_path / "run"))
    packages = "pip install lightning-fabric safetensors tensorboardX torch"
    assert line == f"harmolab: training needs lightning_fabric; install its packages by: {packages}"


def test_the_second_process_does_not_look_at_the_folder(monkeypatch: pytest.MonkeyPatch, run: Run, tmp_path: Path):
    # The first may have made it already.
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "settings.json").write_text("{}")
    monkeypatch.setenv("RANK", "1")
    monkeypatch.setattr(checkpoints, "check_folder", lambda *given, **more: pytest.fail("it looked"))
    assert "nowhere" in told(run(tmp_path / "nowhere", "--out", tmp_path / "run"))


# The bar


TERMS = {"kl": 0.01, "mse": 250.0, "feature": 50.0, "gan": 1.41, "harmony": -0.25, "smoothness": 0.5}
TERMS |= {"energy": 0.2, "foot": 0.1}
JUDGES = {"critic_cd": 1.38, "critic_st": 1.37, "total": 3.25}
SCORES = {"val_mse": 260.0, "val_harmony": 0.375, "val_hit_rate": 0.5, "val_above_chance": 0.125}


def on_terminal(monkeypatch: pytest.MonkeyPatch, *rows: tuple[dict[str, Any], int], fault: bool = False) -> str:
    """What the bar draws of these epochs, and before a fault, on a terminal of 80 columns that is standard error."""
    ours, theirs = pty.openpty()
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with suppress(ZeroDivisionError), epoch_bar() as report:
            for row, end in rows:
                report(row, end)
            if fault:
                raise ZeroDivisionError
        terminal.flush()
        os.set_blocking(ours, False)
        shown = b""
        with suppress(BlockingIOError):
            while True:
                shown += os.read(ours, 65536)
    os.close(ours)
    return shown.decode()


def epoch(phase: str, number: int, values: dict[str, float]) -> dict[str, Any]:
    return {"phase": phase, "epoch": number, "rate": 1e-4, "tau": 0.25, **values}


def test_a_terminal_shows_every_term_and_the_validation(monkeypatch: pytest.MonkeyPatch):
    shown = on_terminal(monkeypatch, (epoch("adversarial", 229, TERMS | JUDGES | SCORES), 270))
    assert "adversarial" in shown and "230/270" in shown
    for name, value in (TERMS | JUDGES).items():
        assert f"{name} {value:.3g}" in shown, name
    assert "validation: mse 260  harmony 0.375  hit_rate 0.5  above_chance 0.125" in shown
    assert shown.rfind("\x1b[?25h") > shown.rfind("\x1b[?25l")  # the cursor is back


def test_the_last_validation_stays_in_sight(monkeypatch: pytest.MonkeyPatch):
    epochs = (epoch("pretrain", 4, {"mse": 250.0} | SCORES), 225), (epoch("pretrain", 5, {"mse": 249.0}), 225)
    assert "harmony 0.375" in on_terminal(monkeypatch, *epochs).split("mse 249")[1]


def test_the_bar_leaves_the_terminal_usable_after_a_fault(monkeypatch: pytest.MonkeyPatch):
    row = {"phase": "pose network", "epoch": 0, "train": 1.5, "validation": 2.5}
    shown = on_terminal(monkeypatch, (row, 40), fault=True)
    assert "pose network" in shown and "1/40" in shown and "train 1.5" in shown
    assert shown.rfind("\x1b[?25h") > shown.rfind("\x1b[?25l")


def test_nothing_is_drawn_before_the_first_epoch(monkeypatch: pytest.MonkeyPatch):
    # Processes beside the first are told of no epoch, and reading the recordings has a bar of its own.
    assert on_terminal(monkeypatch) == ""


def test_numbers_are_shown_with_three_digits(capsys: pytest.CaptureFixture[str]):
    with epoch_bar() as report:
        report(epoch("pretrain", 4, {"mse": np.pi * 100, "val_mse": 1 / 3}), 225)
    assert capsys.readouterr().err == "pretrain epoch 5: rate 0.0001  tau 0.25  mse 314  val_mse 0.333\n"


def test_long_epochs_are_told_without_a_validation(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    moments = iter([0.0, 20.0, 40.0, 40.0, 60.0])  # the begin, three epochs, and the line
    monkeypatch.setattr(training, "monotonic", lambda: next(moments))
    with epoch_bar() as report:
        for number in range(3):
            report({"phase": "ST-GCN", "epoch": number, "train": 1.5}, 40)
    assert capsys.readouterr().err == "ST-GCN epoch 2: train 1.5\n"
