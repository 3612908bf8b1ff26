"""Runs that stop and go on, folders that hold something else: the same end, or one clear line and nothing touched."""

import ast
import pickle
import shutil
import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from filelock import FileLock
from safetensors.torch import save_file
from tensorboardX.proto.event_pb2 import Event

from harmolab.systems import Generator, TrainParams
from harmolab.systems.harmogan.train import train_harmogan
from harmolab.systems.training import checkpoints, loop
from harmolab.systems.training.checkpoints import STATE, TrainOptions, load_state
from harmolab.systems.training.splits import Split
from tests import tiny_training as tiny
from tests.builders import cases
from tests.tiny_training import Stopped

PACKAGE = Path(__file__).resolve().parents[1] / "harmolab"
# Few and large batches: here it matters what is on disk, not what is learnt.
PAPER: TrainParams = replace(tiny.PAPER, pretrain_epochs=2, adversarial_epochs=2, batch_size=13)
LESS_HARMONY = replace(PAPER, harmony_weight=0.5)
EPOCHS = PAPER.pretrain_epochs + PAPER.adversarial_epochs


@pytest.fixture(scope="module")
def split() -> Split:
    return tiny.tiny_split(sketched=True)


Train = Callable[..., Generator]


@pytest.fixture(scope="module")
def train(split: Split) -> Train:
    """`train(folder, stop_after=None, params=PAPER, ...)`; a run that stops raises Stopped."""

    def run(folder: Path, *, stop_after: int | None = None, params: TrainParams = PAPER, **more: Any) -> Generator:
        kept = {name: more.pop(name) for name in ("resume", "corpus") if name in more}
        options = TrainOptions(folder, accelerator="cpu", report=tiny.stopping(stop_after), **kept)
        return train_harmogan(options=options, params=params, **{"model": tiny.MODEL, "split": split} | more)

    return run


@pytest.fixture(scope="module")
def undisturbed(train: Train, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "undisturbed"
    train(folder)
    return folder


@pytest.fixture(scope="module")
def stopped(train: Train, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "stopped"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "SAVING_SHARE", float("inf"))
        stop(train, folder, PAPER.pretrain_epochs)
    return folder


@pytest.fixture
def half(stopped: Path, tmp_path: Path) -> Path:
    """A run that stopped after its first adversarial epoch."""
    return shutil.copytree(stopped, tmp_path / "half")


@pytest.fixture
def begun(undisturbed: Path, tmp_path: Path) -> Path:
    """A run that has only its pose network so far."""
    folder = tmp_path / "begun"
    folder.mkdir()
    for name in ("settings.json", "split.json", "pose_net.safetensors", "pose_net.json"):
        shutil.copy(undisturbed / name, folder)
    return folder


def stop(train: Train, folder: Path, epoch: int, **more: Any) -> None:
    """A training in the folder that stops after this epoch."""
    with pytest.raises(Stopped):
        train(folder, stop_after=epoch, **more)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def assert_same_run(folder: Path, other: Path) -> None:
    for name in ("model.safetensors", "pretrained.safetensors", "pose_net.safetensors", "history.csv"):
        assert (folder / name).read_bytes() == (other / name).read_bytes(), name
    assert events(folder) == events(other)  # for TensorBoard: each epoch once


def events(folder: Path) -> list[tuple[int, str, float]]:
    """(step, tag, value) of all events below a folder; a record is its length, a checksum, the event, a checksum."""
    found = []
    for path in folder.glob("events.out.tfevents.*"):
        data, place = path.read_bytes(), 0
        while place < len(data):
            (length,) = struct.unpack_from("<Q", data, place)
            event = Event.FromString(data[place + 12 : place + 12 + length])
            found += [(event.step, value.tag, value.simple_value) for value in event.summary.value]
            place += 16 + length
    return found


# The state itself


def learner() -> tuple[torch.nn.Module, torch.optim.Optimizer]:
    """A layer after two steps of Adam."""
    torch.manual_seed(0)
    optimiser = torch.optim.Adam((layer := torch.nn.Linear(3, 2)).parameters(), lr=0.1)
    for _ in range(2):
        step(layer, optimiser)
    return layer, optimiser


def step(layer: torch.nn.Module, optimiser: torch.optim.Optimizer) -> None:
    optimiser.zero_grad()
    layer(torch.ones(1, 3)).square().sum().backward()
    optimiser.step()


def test_a_restored_optimiser_takes_the_same_next_step(tmp_path: Path):
    layer, optimiser = learner()
    about = {"history": [{"phase": "pretrain", "mse": 0.1 + 0.2}]}
    checkpoints.save_state(tmp_path, {"layer": layer}, {"adam": optimiser}, about)
    other = torch.nn.Linear(3, 2)
    fresh = torch.optim.Adam(other.parameters(), lr=0.1)
    assert load_state(tmp_path / "nowhere") is None
    saved = load_state(tmp_path)
    assert saved is not None and saved[1] == about  # numbers to the last bit
    checkpoints.restore(saved[0], {"layer": other}, {"adam": fresh})
    step(layer, optimiser)
    step(other, fresh)
    assert torch.equal(layer.weight, other.weight) and torch.equal(layer.bias, other.bias)


def test_a_state_that_was_read_lets_go_of_its_file(tmp_path: Path):
    """Windows replaces no file that is open; here what is written into one shows in numbers that still lie in it."""
    layer, optimiser = learner()
    step(layer, optimiser)
    checkpoints.save_state(tmp_path, {"layer": layer}, {"adam": optimiser}, {})
    tensors, _ = load_state(tmp_path) or ({}, {})
    (tmp_path / STATE).write_bytes(bytes((tmp_path / STATE).stat().st_size))
    assert torch.equal(tensors["module.layer.weight"], layer.weight)


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[-9] ^= 4
    path.write_bytes(data)


def retell(path: Path) -> None:
    """Other words of the same length in the header."""
    data = path.read_bytes()
    assert b"pretrain" in data
    path.write_bytes(data.replace(b"pretrain", b"preTrain"))


def folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGE = {
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:-40]), "is damaged or no safetensors file"),
    "flipped": (flip, "is damaged"),
    "retold": (retell, "is damaged"),
    "foreign": (lambda path: save_file({"w": torch.ones(3)}, path, metadata={"format": "pt"}), "is no training state"),
    "bare": (lambda path: save_file({"w": torch.ones(3)}, path), "is no training state"),
    "pickle": (lambda path: path.write_bytes(pickle.dumps({"w": 1})), "is damaged or no safetensors file"),
    "empty": (lambda path: path.write_bytes(b""), "the file is empty"),
    "folder": (folder_instead, "is a folder"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_state_is_told_in_one_line_and_kept(kind: str, half: Path, train: Train):
    damage, message = DAMAGE[kind]
    damage(half / STATE)
    before = contents(half)
    with pytest.raises(ValueError, match=message) as caught:
        train(half, resume=True)
    assert str(caught.value).startswith(str(half / STATE)) and "\n" not in str(caught.value)
    assert contents(half) == before


# Going on


@cases(
    "last, share, kept",
    *(pytest.param(epoch, float("inf"), epoch + 1, marks=pytest.mark.slow) for epoch in range(EPOCHS)),
    (EPOCHS - 2, 1e-9, PAPER.pretrain_epochs),  # only the first epoch and the last of each phase are kept
)
def test_a_run_that_stops_after_any_epoch_ends_the_same(
    last: int, share: float, kept: int, undisturbed: Path, train: Train, begun: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(loop, "SAVING_SHARE", share)
    stop(train, begun, last, resume=True)
    saved = load_state(begun)
    assert saved is not None and len(saved[1]["history"]) == kept
    train(begun, resume=True)
    assert_same_run(begun, undisturbed)


def shorter_history(run: Path) -> None:
    (run / "history.csv").write_text("".join((run / "history.csv").read_text().splitlines(keepends=True)[:-1]))


def half_written(run: Path) -> None:
    for name in (STATE, "history.csv", "settings.json"):
        (run / f".{name}.1.2.tmp").write_bytes(b"half a fi")


@cases(
    "until, left",
    ("begun", lambda run: (run / "pose_net.json").unlink()),
    ("half", shorter_history),
    ("half", lambda run: (run / "history.csv").unlink()),
    ("half", half_written),
    ("undisturbed", lambda run: (run / "model.json").unlink()),
    ids=["within the pose network", "before the history", "before the first history", "within a file", "at the end"],
)
def test_a_stop_at_any_moment_does_no_harm(
    until: str, left: Callable[[Path], object], undisturbed: Path, train: Train, request: Any, tmp_path: Path
):
    run = shutil.copytree(request.getfixturevalue(until), tmp_path / "run")
    left(run)
    train(run, resume=True)
    assert_same_run(run, undisturbed)
    assert (run / "model.json").is_file() and not list(run.glob(".*.tmp"))


def test_a_stop_between_the_pretrained_weights_and_the_state_does_no_harm(
    undisturbed: Path, train: Train, begun: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(loop, "SAVING_SHARE", float("inf"))
    stop(train, begun, PAPER.pretrain_epochs - 2, resume=True)
    for name in ("pretrained.json", "pretrained.safetensors"):
        shutil.copy(undisturbed / name, begun)
    train(begun, resume=True)
    assert_same_run(begun, undisturbed)


def test_resuming_a_finished_run_changes_nothing(undisturbed: Path, train: Train, tmp_path: Path):
    run = shutil.copytree(undisturbed, tmp_path / "run")
    train(run, resume=True)
    before, after = ({k: v for k, v in contents(each).items() if "events" not in k} for each in (undisturbed, run))
    assert after == before  # but for the events, which bear the time in their names


def test_resume_starts_what_has_not_begun(undisturbed: Path, train: Train, tmp_path: Path):
    train(tmp_path / "new", resume=True)
    assert_same_run(tmp_path / "new", undisturbed)


# TensorBoard


def test_stale_events_are_replaced_and_nothing_else_and_columns_are_grouped(tmp_path: Path):
    (tmp_path / "events.out.tfevents.1.old").write_bytes(b"stale")
    (tmp_path / "events.txt").write_text("mine")
    threads = threading.active_count()
    log = checkpoints.EventLog(tmp_path, [{"phase": "pretrain", "epoch": 0, "mse": 2.0, "tau": ""}])
    log.add({"phase": "adversarial", "epoch": 1, "critic_cd": 1.0, "val_mse": 3.0, "rate": 0.5, "tau": 0.25})
    assert threading.active_count() == threads  # where one cannot start for want of memory, a run would never end
    log.close()
    tags = {"loss/critic_cd": 1.0, "validation/mse": 3.0, "schedule/rate": 0.5, "schedule/tau": 0.25}
    assert events(tmp_path) == [(0, "loss/mse", 2.0), *((1, *each) for each in tags.items())]
    assert not (tmp_path / "events.out.tfevents.1.old").exists() and (tmp_path / "events.txt").read_text() == "mine"


def test_history_leaves_out_what_an_epoch_does_not_have():
    text = checkpoints.history_text([{"epoch": 0, "mse": 0.5}, {"epoch": 1, "mse": 0.25, "gan": 1.0}])
    assert text == "epoch,mse,gan\n0,0.5,\n1,0.25,1.0\n"


# Folders that hold something else


def refused(folder: Path, call: Callable[[], Any]) -> str:
    """The message of the ValueError that a call raises without touching `folder`."""
    before = contents(folder)
    with pytest.raises(ValueError) as caught:
        call()
    assert contents(folder) == before and "\n" not in str(caught.value)
    return str(caught.value)


def test_somebody_elses_folder_is_no_run_to_resume(train: Train, tmp_path: Path):
    (tmp_path / "thesis.tex").write_text("years of work")
    message = refused(tmp_path, lambda: train(tmp_path, resume=True))
    assert message.startswith(f"{tmp_path}: holds thesis.tex but no settings.json, so no run to resume")


@pytest.mark.parametrize("place", ["run", "run/below/it"])
def test_a_file_is_no_folder(place: str, tmp_path: Path):
    (tmp_path / "run").write_text("")
    with pytest.raises(ValueError, match="run: is a file; a run needs a folder of its own"):
        checkpoints.check_folder(tmp_path / place, resume=True)


@cases(
    "changes, words",
    ({"params": LESS_HARMONY}, "settings.json: train.harmony_weight is 1.0, but 0.5 is asked for"),
    ({"model": replace(tiny.MODEL, hidden=8)}, "settings.json: model.hidden is 16, but 8 is asked for"),
    ({"split": tiny.tiny_split(n_train=12, sketched=True)}, "split.json: units.test is "),
)
def test_run_with_other_settings_or_units_is_not_resumed(changes: dict[str, Any], words: str, half: Path, train: Train):
    assert refused(half, lambda: train(half, **changes, resume=True)).startswith(f"{half}/{words}")


def test_the_place_in_which_long_settings_differ_is_shown(tmp_path: Path):
    split, names = SimpleNamespace(to_dict=dict), [f"dance {number}" for number in range(20)]
    with checkpoints.open_folder(tmp_path, {"dances": names}, split, resume=False):
        pass
    fault = r'dances is \.\.\..*"dance 12".*\.\.\., but \.\.\..*"another".*\.\.\. is asked for'
    other = {"dances": [*names[:12], "another", *names[13:]]}
    with pytest.raises(ValueError, match=fault), checkpoints.open_folder(tmp_path, other, split, resume=True):
        pass


# Changed, gone, new.
@cases("corpus", {"synth/one/motion.npz": "b"}, {}, {"synth/one/motion.npz": "a", "synth/new/motion.npz": "c"})
def test_a_recording_that_has_changed_since_is_named(corpus: dict[str, str], tmp_path: Path):
    split, begun = SimpleNamespace(to_dict=dict), {"synth/one/motion.npz": "a"}
    for resume in (False, True):
        with checkpoints.open_folder(tmp_path, {}, split, resume=resume, corpus=lambda: begun):
            pass
    fault = f"{tmp_path}/corpus.json: synth/.*/motion.npz is not what it was when this training began; put it back"
    again = checkpoints.open_folder(tmp_path, {}, split, resume=True, corpus=lambda: corpus)
    with pytest.raises(ValueError, match=fault), again:
        pass


@cases(
    "name, text, words",
    ("settings.json", "", "settings.json"),
    ("settings.json", "[1]", "settings.json"),
    ("pose_net.safetensors", "nonsense", "pose_net"),
    ("pose_net.json", "nonsense", "pose_net"),
)
def test_a_damaged_file_of_a_run_is_named(name: str, text: str, words: str, half: Path, train: Train):
    (half / name).write_text(text)
    assert str(half / words) in refused(half, lambda: train(half, resume=True))


def test_a_state_of_other_settings_is_not_resumed(half: Path, train: Train, tmp_path: Path):
    stop(train, tmp_path / "other", 0, params=LESS_HARMONY)
    shutil.copy(tmp_path / "other" / STATE, half / STATE)
    assert refused(half, lambda: train(half, resume=True)).startswith(f"{half}: was trained with other settings")


def test_two_processes_do_not_train_in_one_folder(half: Path, train: Train):
    with FileLock(half / ".lock"):
        assert refused(half, lambda: train(half, resume=True)) == f"{half}: another process is training there"


# Pretraining of another run


@cases(
    "changes, words",
    ({"split": tiny.tiny_split(n_train=12, sketched=True)}, "split.json: "),  # its validation unit was trained on there
    ({"model": replace(tiny.MODEL, hidden=8)}, "settings.json: model.hidden is 16, but 8 is asked for"),
)
def test_pretraining_on_other_data_or_of_another_size_is_not_taken_over(
    changes: dict[str, Any], words: str, undisturbed: Path, train: Train, tmp_path: Path
):
    message = refused(undisturbed, lambda: train(tmp_path / "new", **changes, pretrained=undisturbed))
    assert message.startswith(f"{undisturbed}/{words}") and not (tmp_path / "new").exists()


def test_pretraining_on_files_that_changed_since_is_not_taken_over(undisturbed: Path, train: Train, tmp_path: Path):
    old = shutil.copytree(undisturbed, tmp_path / "old")
    (old / "corpus.json").write_text('{"synth/one/motion.npz": "a"}')
    message = refused(old, lambda: train(tmp_path / "new", pretrained=old, corpus={"synth/one/motion.npz": "b"}.copy))
    assert message.startswith(f"{old}/corpus.json: synth/one/motion.npz is not what it was when this training began")


@pytest.fixture(scope="module")
def taken_over(undisturbed: Path, train: Train, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run on the pretraining of another."""
    train(folder := tmp_path_factory.mktemp("runs") / "taken_over", pretrained=undisturbed)
    return folder


def test_run_on_taken_over_pretraining_can_stop_too(undisturbed: Path, taken_over: Path, train: Train, tmp_path: Path):
    stop(train, tmp_path, 1, pretrained=undisturbed)
    train(tmp_path, pretrained=undisturbed, resume=True)
    for name in ("model.safetensors", "history.csv"):
        assert (tmp_path / name).read_bytes() == (taken_over / name).read_bytes()


# Nothing is unpickled


def unpicklings(tree: ast.AST) -> Iterator[int]:
    """Lines that could load a pickle."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name for alias in node.names} | {getattr(node, "module", None)}
            if names & {"joblib", "dill", "cloudpickle", "shelve"}:
                yield node.lineno
            if getattr(node, "module", None) in ("pickle", "torch") and names & {"load", "loads", "Unpickler"}:
                yield node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if (node.value.id, node.attr) in {
                ("torch", "load"), ("pickle", "load"), ("pickle", "loads"), ("pickle", "Unpickler"),
                ("pd", "read_pickle"), ("torch", "package"),
            }:  # fmt: skip
                yield node.lineno
        elif isinstance(node, ast.keyword) and node.arg == "allow_pickle" and ast.unparse(node.value) != "False":
            yield node.value.lineno


@pytest.mark.parametrize(
    "line",
    [
        "torch.load(path)", "pickle.load(file)", "pickle.loads(data)", "import joblib", "from joblib import load",
        "from torch import load", "np.load(path, allow_pickle=True)", "np.load(path, allow_pickle=yes)",
        "pickle.Unpickler(file)", "pd.read_pickle(path)",
    ],
)  # fmt: skip
def test_the_search_for_pickles_finds(line: str):
    assert list(unpicklings(ast.parse(line))) == [1]


# The reader of AIST++ lets only opcodes through that build plain values, and calls none of the functions named.
CHECKED_READER = {"readers/aist.py"}


def test_no_pickle_is_loaded_anywhere():
    found = {
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in PACKAGE.rglob("*.py")
        if str(path.relative_to(PACKAGE)) not in CHECKED_READER
        for line in unpicklings(ast.parse(path.read_text("utf-8")))
    }
    assert not found
