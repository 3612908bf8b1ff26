"""The readers that `benchmarks.fuzz` tries: small valid files of each kind, all made here, and calls that read them."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from harmolab.body.skeletons import Skeleton
from harmolab.cli import app
from harmolab.cli.data_check import check
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import write_corpus
from harmolab.lab.compare.windows import dance_patterns
from harmolab.lab.evaluate.engine import read_rows, run_rows
from harmolab.lab.evaluate.pairing import listed_pairs
from harmolab.lab.evaluate.reference import SHIPPED, load_reference
from harmolab.lab.evaluate.submission import submission_faults, write_submission
from harmolab.lab.listening.answers import (
    SimulatedRater,
    answer_files,
    answer_log,
    merge,
    read_key,
    read_page,
    read_scores,
    read_trials,
)
from harmolab.musician.performances import load_performance
from harmolab.readers.audio import load_sound
from harmolab.readers.video import video_frames, write_video
from harmolab.systems.choreographer.takes import Kept, load_takes, save_takes, take_of
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.checkpoints import load_state, save_state
from harmolab.systems.training.layers import Statistics
from harmolab.systems.training.runs import PoseBank, load_poses, save_poses
from harmolab.systems.training.weights import save_weights
from harmolab.types import Audio
from harmolab.verdict.bar_pattern import load_pattern, save_patterns
from tests.builders import called
from tests.test_hostile import arrays_of, arrays_of_performance, valid_files
from tests.tiny_run import Numbers, square


class Target(NamedTuple):
    """A reader.

    Parameters
    ----------
    name : str
    group : str, what `--only` chooses by
    files : path in a folder -> content, a valid whole
    damaged : paths of those that are damaged, one at a time
    read : function(folder), which returns arrays that must be finite
    mend : function(folder), run after the damage, so that it gets past a check sum
    """

    name: str
    group: str
    files: Mapping[str, bytes]
    damaged: tuple[str, ...]
    read: Callable[[Path], list[np.ndarray]]
    mend: Callable[[Path], None] = lambda folder: None


GROUPS = {"sound": "sound", "song": "beats", "beats": "beats", "config": "motion"}
ROWS = 12  # of a run
MUSICIANS = ("players", "wholebody", "holistic", "hands", "train_all", "set", "pianist", "notes")


def all_targets() -> list[Target]:
    """Every reader with its valid files; the same at every call."""
    return [*_single_files(), *_folders(), *_videos(), *_patterns(), *_studies(), *_weights(), *_evaluations()]


def _single_files() -> Iterator[Target]:
    """The formats of `tests.test_hostile`, and what `harmolab data check` says of them."""
    contents = valid_files()
    for name, content in contents.items():
        first = name.split("/")[0].split(".")[0]
        group = "musicians" if first in MUSICIANS else GROUPS.get(first, "motion")
        files = {name: content}
        if first == "set":
            files = {other: contents[other] for other in ("set/clip_001.npz", "set/clips.csv")}
        elif "/" in name:
            files[name.replace("1_", "0_")] = content
        yield Target(name, group, files, (name,), partial(_of_file, name))
        if name.endswith((".npz", ".json", ".csv")):
            yield Target(f"check {name}", "check", files, (name,), partial(_checked, name))


def _of_file(name: str, folder: Path) -> list[np.ndarray]:
    return arrays_of(folder / name)


def _checked(name: str, folder: Path) -> list[np.ndarray]:
    if not check(folder / name):
        raise TypeError("no row")
    return []


def _folders() -> Iterator[Target]:
    """Whole recordings, and the performance of a musician."""
    contents = valid_files()
    own = {"audio.wav": "sound.wav", "motion.npz": "motion.npz", "beats.json": "beats.json"}
    tang = {"audio.mp3": "sound.mp3", "skeletons.json": "skeletons.json", "config.json": "config.json"}
    for name, parts in {"own": own, "DANCE_W_1": tang}.items():
        files = {f"{name}/{part}": contents[source] for part, source in parts.items()}
        yield Target(f"recording {name}", "folders", files, tuple(files), partial(_recording, name))
    about = {"instrument": "piano", "fps": 25, "points": ["holistic.json"], "piece": "x", "size": [640, 480]}
    about |= {"offset_s": 0.05, "mirrored": False, "rendered": True}
    files = {f"take/{part}": contents[part] for part in ("sound.wav", "notes.csv", "holistic.json")}
    files["take/performance.json"] = json.dumps(about).encode()
    yield Target("performance", "musicians", files, tuple(files), _performance)


def _recording(name: str, folder: Path) -> list[np.ndarray]:
    recording = load_recording(folder / name)
    return [recording.clip.motion.positions, recording.clip.audio.samples, np.array(recording.clip.offset)]


def _performance(folder: Path) -> list[np.ndarray]:
    return arrays_of_performance(load_performance(folder / "take"))


def _made(write: Callable[[Path], Any]) -> dict[str, bytes]:
    """The files that a function writes into a folder, by their paths in it."""
    with tempfile.TemporaryDirectory() as name:
        write(Path(name))
        paths = sorted(path for path in Path(name).rglob("*") if path.is_file())
        return {str(path.relative_to(name)): path.read_bytes() for path in paths}


def _videos() -> Iterator[Target]:
    """Six small pictures with sound, in both codings."""
    frames = np.random.default_rng(2).integers(0, 256, (6, 32, 48), dtype=np.uint8)
    sound = Audio(np.sin(np.arange(2400) / 9.0) * 0.5, 8000.0)
    for name in ("video.mp4", "video.webm"):
        files = _made(lambda folder, name=name: write_video(folder / name, frames, 25.0, audio=sound))  # type: ignore[misc]
        yield Target(name, "video", files, (name,), partial(_pictures, name))
        yield Target(f"sound of {name}", "video", files, (name,), partial(_video_sound, name))


def _pictures(name: str, folder: Path) -> list[np.ndarray]:
    frames = video_frames(folder / name)
    return [np.array(frames.fps), np.array([sum(int(frame.any()) for frame in frames)])]


def _video_sound(name: str, folder: Path) -> list[np.ndarray]:
    return [load_sound(folder / name).samples]


def _corpus(folder: Path, clips: int = 4) -> Path:
    return write_corpus(folder / "corpus", clips=clips, seconds=10.0, fps=20.0)


def _patterns() -> Iterator[Target]:
    """A file of `harmolab data learn`."""

    def write(folder: Path) -> None:
        with tempfile.TemporaryDirectory() as name:
            save_patterns(folder / "patterns.json", dance_patterns(_corpus(Path(name))))

    files = _made(write)
    dances = list(json.loads(files["patterns.json"]))
    yield Target("patterns.json", "patterns", files, ("patterns.json",), partial(_pattern, dances))


def _pattern(dances: list[str], folder: Path) -> list[np.ndarray]:
    patterns = [load_pattern(folder / "patterns.json", dance) for dance in dances]
    return [np.array([*one.cosines, *one.sines]) for one in patterns]


def _studies() -> Iterator[Target]:
    """A study of two kinds, answered by simulated raters: its readers, and its analysis on the command line."""

    def write(folder: Path, kind: str) -> None:
        with tempfile.TemporaryDirectory() as name:
            study = folder / "study"
            made = called(
                app, "data", "study", "make", _corpus(Path(name)), study, "--n", 4, "--seconds", 4, "--kind", kind
            )
            if made.exit_code:
                raise RuntimeError(made.output)
        trials, key = read_trials(study / "trials.json"), read_key(study / "key.json")
        for seed in range(2):
            rater = SimulatedRater(0.9, seed)
            for answer in rater.answers(trials.ordered_for(rater.name), key):
                answer_log(study, rater.name).append(answer)

    for kind in ("pick", "choice"):
        files = _made(partial(write, kind=kind))
        small = tuple(name for name in files if not name.startswith("study/pages"))
        pages = [name for name in files if name not in small]
        small = tuple(name for name in small if not name.endswith(".lock"))
        yield Target(f"study {kind}", "study", files, (*small, pages[0]), partial(_study, Path(pages[0]).stem))
        yield Target(f"analyse {kind}", "study", files, small, _analysed)


def _study(page: str, folder: Path) -> list[np.ndarray]:
    study = folder / "study"
    read_trials(study / "trials.json").ordered_for("Ada")
    read_key(study / "key.json")
    read_page(study, page)
    read_scores(study / "scores.json")  # null stands for a number that does not exist
    merge(answer_files(study))
    return []


def _analysed(folder: Path) -> list[np.ndarray]:
    """The command's error as that of a reader; a traceback is the exception behind it."""
    result = called(app, "data", "study", "analyse", folder / "study", "--json")
    if result.exit_code == 2 and len(result.stderr.splitlines()) == 1:
        raise ValueError(result.stderr.removeprefix("harmolab: ").rstrip("\n"))
    if result.exit_code or not json.loads(result.stdout):
        raise result.exception or RuntimeError(f"exit {result.exit_code}: {result.output}")
    return []


def _weights() -> Iterator[Target]:
    """Weights, poses and a state of a tiny network, recorded movement of a choreographer; check sums are mended."""
    arm = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))
    torch.manual_seed(1)
    network = Generator(ModelParams(8, 2, 8, 4), 4, arm, torch.tensor([0.0, 0.3, 0.25]), fps=10.0)
    network.set_statistics(Statistics.of(torch.randn(2, 9, 4), torch.randn(2, 9, 12), torch.ones(2, 9)))
    files = _made(lambda folder: save_weights(folder / "arm", network, {"seed": 7}))
    yield Target("weights", "weights", files, tuple(files), _network, partial(_mend, "arm.json", "arm.safetensors"))
    bank = PoseBank(np.random.default_rng(1).normal(size=(6, 5, 12)), ("waltz",) * 6)
    files = _made(lambda folder: save_poses(folder / "arm", bank))
    yield Target("poses", "weights", files, tuple(files), _poses)
    adam = torch.optim.Adam(network.parameters())
    files = _made(lambda folder: save_state(folder, {"generator": network}, {"adam": adam}, {"epoch": 3}))
    yield Target("state", "weights", files, tuple(files), _state)

    def write(folder: Path) -> None:
        with tempfile.TemporaryDirectory() as name:
            save_takes(folder, Kept((take_of(load_recording(_corpus(Path(name)) / "clip_0001_cha-cha")),)))

    files = _made(write)
    array = next(name for name in files if not name.endswith(".json"))
    yield Target("takes", "weights", files, tuple(files), _takes, partial(_mend, "model.json", array))


def _mend(about: str, data: str, folder: Path) -> None:
    """The right SHA-256 of `data` in its description, as far as that can still be read."""
    try:
        content = json.loads((folder / about).read_bytes())
        content["sha256"] = hashlib.sha256((folder / data).read_bytes()).hexdigest()
        (folder / about).write_text(json.dumps(content))
    except (ValueError, TypeError, RecursionError):
        return


def _network(folder: Path) -> list[np.ndarray]:
    return [values.numpy() for values in load_generator(folder / "arm").state_dict().values()]


def _poses(folder: Path) -> list[np.ndarray]:
    return [load_poses(folder / "arm", n_channels=12).poses]


def _state(folder: Path) -> list[np.ndarray]:
    load_state(folder)
    return []


def _takes(folder: Path) -> list[np.ndarray]:
    takes = load_takes(folder).takes
    return [array for take in takes for array in (take.motion.positions, take.beats)]


def _evaluations() -> Iterator[Target]:
    """A list of pairs, the rows of a run, read as a whole and gone on with, and a row of the leaderboard."""
    lines = ("motion,music,seed,offset", "a.npz,songs/tune.wav,1,2.5", 'b.bvh,"songs/other tune.wav",2,')
    files = dict.fromkeys(("dances/a.npz", "dances/b.bvh", "songs/tune.wav", "songs/other tune.wav"), b"")
    files["pairs.csv"] = "\n".join(lines).encode()
    yield Target("pairs.csv", "evaluate", files, ("pairs.csv",), _pairs)
    files = {"reference.npz": SHIPPED.read_bytes()}
    yield Target("reference.npz", "evaluate", files, ("reference.npz",), _reference)
    files = _made(lambda folder: run_rows(Numbers(ROWS), square, folder / "rows", jobs=0))
    full = tuple(name for name, content in files.items() if content)  # a lock is empty
    yield Target("rows", "evaluate", files, full, _rows)
    yield Target("resumed rows", "evaluate", files, full, _resumed)
    files = {name: content for name, content in _made(_write_submission).items() if name.startswith("row/")}
    yield Target("submission", "evaluate", files, tuple(name for name in files if "README" not in name), _submission)


def _write_submission(folder: Path) -> None:
    """A table of two dances, and a row of it."""
    (folder / "table").mkdir()
    settings = {"systems": {"ours": "ours"}, "music": "songs", "reference": "recorded", "resamples": 100, "seed": 0}
    (folder / "table" / "evaluation.json").write_text(json.dumps({"settings": settings}))
    (folder / "a.npz").write_bytes(b"dance")
    place = folder / "a.npz"
    rows = (f",{name},1,tune,{place},{place},kind,30,,{len(name)}" for name in ("ours", "recorded"))
    header = "error,system,seed,song,motion,music,kind,fps,dance,harmony"
    (folder / "table" / "clips.csv").write_text("\n".join((header, *rows)))
    write_submission(folder / "table", folder / "row")


def _submission(folder: Path) -> list[np.ndarray]:
    submission_faults(folder / "row")
    return []


def _pairs(folder: Path) -> list[np.ndarray]:
    listed_pairs(folder / "pairs.csv", folder, {"ours": folder / "dances"}, default="ours")
    return []


def _reference(folder: Path) -> list[np.ndarray]:
    assert load_reference(folder / "reference.npz").pairs
    return []


def _rows(folder: Path) -> list[np.ndarray]:
    for part in read_rows(folder / "rows"):
        part.select_dtypes("number").sum()
    return []


def _resumed(folder: Path) -> list[np.ndarray]:
    for part in run_rows(Numbers(ROWS), square, folder / "rows", jobs=0, resume=True):
        part.select_dtypes("number").sum()
    return []
