"""`harmolab.evaluate` and `DanceMetric`: the command's numbers in memory, from one process or several."""

import json
import math
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from harmolab import DanceMetric, Skeleton, evaluate, synthetic_clip
from harmolab.cli import app
from harmolab.data.synthetic import write_corpus
from harmolab.lab.evaluate import evaluation
from harmolab.lab.evaluate.evaluation import Evaluation, EvaluationSettings, evaluate_dances, write_reference
from harmolab.lab.evaluate.measured import MEASURES
from harmolab.lab.evaluate.page import write_evaluation
from harmolab.lab.evaluate.pairing import FROZEN, RECORDED
from harmolab.lab.evaluate.reference import SYNTHETIC, Reference, load_reference, save_reference
from harmolab.lab.evaluate.rows import pair_clip
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import music_and_motion
from tests.builders import cases, done, missing, refused

SYSTEM = "ours"


@dataclass(frozen=True)
class Evaluated:
    """A system whose dances the command has measured, and the same dances in memory."""

    root: Path
    table: Evaluation
    dances: list[dict[str, Any]]

    @property
    def saved(self) -> Path:
        return self.root / "reference.npz"

    @property
    def numbers(self) -> dict[str, float]:
        means = {measure: mean.mean for (system, measure), mean in self.table.means.items() if system == SYSTEM}
        return means | {name: one.value for (system, name), one in self.table.sets.items() if system == SYSTEM}


def settings(root: Path, **others: Any) -> EvaluationSettings:
    recorded = root / "recorded"
    named: dict[str, Any] = {"music": recorded, "reference": recorded, "resamples": 100}
    return EvaluationSettings({SYSTEM: root / SYSTEM}, **(named | others))


def updates(root: Path, table: Evaluation) -> list[dict[str, Any]]:
    """The dances of the system as arguments of `update`, one a call."""
    pairs = [pair for pair in evaluation.evaluation_pairs(settings(root)).pairs if pair.system == SYSTEM]
    clips = [(pair, pair_clip(pair, table.options)) for pair in pairs]
    named = [(pair, clip.dance, *music_and_motion(clip)) for pair, clip in clips]
    return [
        {"motions": [motion], "beats": [music], "songs": [pair.song], "seeds": [pair.seed], "dances": [dance]}
        for pair, dance, music, motion in named
    ]


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Evaluated:
    """Five recorded dances, and a system that dances like them with noise, twice."""
    root = tmp_path_factory.mktemp("metric")
    common: dict[str, Any] = {"clips": 5, "seconds": 12.0, "fps": 30.0, "seed": 4}
    write_corpus(root / "recorded", **common)
    for seed, noise in (("1", 0.001), ("2", 0.002)):
        (folder := root / SYSTEM / seed).mkdir(parents=True)
        for clip in sorted(write_corpus(root / f"corpus{seed}", noise=noise, **common).glob("clip_*")):
            save_motion(folder / f"{clip.name}.npz", load_motion(clip / "motion.npz"))
    table = evaluate_dances(settings(root), root / "table")
    write_reference(root / "reference.npz", table, root / "table")
    return Evaluated(root, table, updates(root, table))


def measured(saved: Path, dances: list[dict[str, Any]]) -> DanceMetric:
    metric = DanceMetric(saved)
    for dance in dances:
        metric.update(**dance)
    return metric


@pytest.mark.slow
def test_the_metric_has_the_numbers_of_the_command(evaluated: Evaluated):
    metric = measured(evaluated.saved, evaluated.dances)
    numbers = metric.compute()
    assert numbers.keys() == {*MEASURES, *evaluated.numbers}
    assert {"harmony", "likeness", "fid_kinetic", "fid_geometric", "multimodality_kinetic"} <= evaluated.numbers.keys()
    assert {name: numbers[name] for name in evaluated.numbers} == pytest.approx(evaluated.numbers, rel=1e-9, abs=1e-9)
    nan, of = "harmony_dance of 2 of 10 dances is NaN:", "is none of cha-cha, rumba, waltz."
    assert sorted(metric.remarks) == [f"{nan} {name!r} {of}" for name in ("jive", "quickstep", "samba")]
    metric.reset()
    refused("nothing was measured yet", metric.compute)


def rows_of(saved: Path, dances: list[dict[str, Any]]) -> list[Any]:
    """The rows that a process of its own measures."""
    return measured(saved, dances).rows


@pytest.mark.slow
def test_two_processes_have_the_numbers_of_one(evaluated: Evaluated):
    halves = [evaluated.dances[1::2], evaluated.dances[::2]]
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        parts = list(pool.map(rows_of, [evaluated.saved] * 2, halves))
    both, one = DanceMetric(evaluated.saved), DanceMetric(evaluated.saved)
    for part in parts:
        both.merge_state(json.loads(json.dumps(part)))  # as it may be sent
    one.merge_state(rows_of(evaluated.saved, evaluated.dances))
    assert both.compute() == one.compute()
    assert both.compute()["fid_kinetic"] == pytest.approx(evaluated.numbers["fid_kinetic"], rel=1e-9)


@pytest.mark.slow
def test_a_saved_reference_stands_for_the_folder(evaluated: Evaluated, tmp_path: Path):
    table = evaluate_dances(settings(evaluated.root, reference=evaluated.saved), tmp_path / "table")
    assert (table.rows, table.counts) == (evaluated.table.rows, evaluated.table.counts)
    for key, mean in evaluated.table.means.items():
        np.testing.assert_allclose(table.means[key], mean, rtol=1e-9, atol=1e-12, err_msg=str(key))
    for key, number in evaluated.table.sets.items():
        assert table.sets[key]._replace(value=0.0, raw=0.0) == number._replace(value=0.0, raw=0.0), key
        values = [(one.value, one.raw) for one in (table.sets[key], number)]
        np.testing.assert_allclose(*values, rtol=1e-9, atol=1e-9, err_msg=str(key))
    assert {system for system, _ in table.means} == {SYSTEM, *table.controls}
    assert "index.html" in write_evaluation(tmp_path / "table", table)
    refused("is a saved reference already", write_reference, tmp_path / "again.npz", table, tmp_path / "table")
    edge = settings(evaluated.root, reference=evaluated.saved, protocols=["edge"])
    refused("has no numbers of the protocol edge", evaluate_dances, edge, tmp_path / "edge")


@pytest.mark.slow
def test_the_command_saves_a_reference_that_it_reads(evaluated: Evaluated, tmp_path: Path):
    recorded, saved = evaluated.root / "recorded", tmp_path / "saved.npz"
    common = ("evaluate", evaluated.root / SYSTEM, "--music", recorded, "--resamples", 100, "--jobs", 0)
    done(app, *common, "--reference", recorded, "--save-reference", saved, "--out", tmp_path / "a")
    assert saved.read_bytes() == evaluated.saved.read_bytes()
    done(app, *common, "--reference", saved, "--out", tmp_path / "b")
    rows = [json.loads((tmp_path / name / "table.json").read_text())["rows"] for name in "ab"]
    assert [row["system"] for row in rows[1]] == [SYSTEM, "recorded", "recorded, other song", "frozen pose"]
    assert rows[1][0]["fid_kinetic"] == pytest.approx(rows[0][0]["fid_kinetic"], rel=1e-9)
    assert rows[1][1]["harmony"] == pytest.approx(rows[0][1]["harmony"], rel=1e-9)


def test_the_reference_that_is_shipped_is_of_synthetic_dances():
    reference = load_reference(SYNTHETIC)
    assert len(reference.features) == 28 and reference.limits is not None
    assert set(MEASURES) <= set(reference.rows)  # a new one: python -m tools.reference
    harmony = reference.rows.groupby("system")["harmony"].mean()
    assert harmony[RECORDED] > 0.5 and harmony[FROZEN] == 0


def test_a_reference_is_the_same_after_its_file(tmp_path: Path):
    reference = load_reference(SYNTHETIC)
    save_reference(tmp_path / "a.npz", reference)
    again = load_reference(tmp_path / "a.npz")
    assert again.rows.equals(reference.rows) and again.limits == reference.limits
    save_reference(tmp_path / "b.npz", again)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def damaged(path: Path, **changes: Any) -> Path:
    """A file like that of a reference, with other arrays, or another entry of its description."""
    save_reference(path, load_reference(SYNTHETIC))
    arrays = dict(np.load(path))
    arrays["numbers"] = changes.pop("numbers", arrays["numbers"])
    about = json.loads(arrays["about"].tobytes()) | changes
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    np.savez(path, **arrays)
    return path


@cases(
    "changes, fault",
    ({"format": "x"}, "has format 'x'; this version reads"),
    ({"columns": ["song"]}, "its columns do not fit"),
    ({"text": {}}, "its columns do not fit"),
    ({"numbers": np.zeros((3, 2))}, "zip|fit"),
    ({"limits": {"pooled": 3}}, "no limits of likeness"),
    ({"numbers": np.array([{}])}, "only plain numbers are read, never Python objects"),
)
def test_a_damaged_reference_is_an_error_that_names_the_file(tmp_path: Path, changes: dict[str, Any], fault: str):
    refused(rf"ref\.npz: .*({fault})", load_reference, damaged(tmp_path / "ref.npz", **changes))


def test_another_file_is_no_reference(tmp_path: Path):
    np.savez(tmp_path / "x.npz", positions=np.zeros((3, 2)))
    refused(r"x\.npz: is no reference", load_reference, tmp_path / "x.npz")
    (tmp_path / "demo.tar").write_bytes(b"recorded")
    refused(r"demo\.tar: cannot be read as a folder of recorded dances or", load_reference, tmp_path / "demo.tar")
    missing("nowhere", load_reference, tmp_path / "nowhere.npz")


# In memory


def short(count: int = 4, *, seconds: float = 5.0) -> tuple[list[Motion], list[BeatTrack]]:
    clips = [synthetic_clip("waltz", seconds=seconds, fps=30.0, seed=seed) for seed in range(count)]
    return [clip.motion for clip in clips], [clip.beats for clip in clips]


def test_arrays_and_tensors_have_the_numbers_of_motions():
    torch = pytest.importorskip("torch")
    motions, beats = short(2)
    skeleton, times = motions[0].skeleton, [track.times for track in beats]
    expected = evaluate(motions, times)
    batch = np.stack([motion.positions for motion in motions])
    assert evaluate(batch, times, fps=30.0, skeleton=skeleton)["jerk"] == expected["jerk"]
    tensors = torch.as_tensor(batch).requires_grad_()
    seconds = [torch.as_tensor(np.array(each)) for each in times]
    own = evaluate(tensors.detach(), seconds, fps=30.0, skeleton=skeleton)
    assert own["beat_align_motion"] == expected["beat_align_motion"] > 0.5
    half = evaluate(torch.as_tensor(batch).bfloat16(), seconds, fps=30.0, skeleton=skeleton)
    assert half["foot_skating"] == half["foot_skating"]
    message = r"motions\[0\] is a tensor with a gradient.*motions\[0\]\.detach\(\); a loss is harmolab\.soft_harmony"
    refused(message, evaluate, tensors, seconds, fps=30.0)


def test_clips_of_five_seconds_have_no_harmony_and_say_so():
    motions, beats = short(2)
    numbers = evaluate(motions, beats)
    assert math.isnan(numbers["harmony"]) and math.isnan(numbers["likeness"])
    assert says(numbers["remarks"], "harmony of 2 of 2 dances is NaN: it needs 16 beats of the music, some 8 s")
    assert says(numbers["remarks"], "likeness of 2 of 2 dances is NaN: it needs 10 s")
    assert numbers["beat_align_motion"] > 0.5 and "fid_kinetic" not in numbers


def says(remarks: list[str], text: str) -> bool:
    return any(text in remark for remark in remarks)


def test_fingers_of_a_rig_count_in_no_measure_of_the_body(rng: np.random.Generator):
    clips = [synthetic_clip("jive", seconds=12.0, seed=seed) for seed in range(4)]
    bones = clips[0].motion.skeleton  # which calls a hand a finger
    body = Skeleton(tuple(name.replace("finger", "palm") for name in bones.joints), bones.parents)
    rig = Skeleton((*body.joints, *(f"RightHandIndex{place}" for place in range(30))), (*body.parents, *(30 * [0])))
    plain, rigged = [], []
    for motion in (clip.motion for clip in clips):
        hand = motion.positions[:, :1] + rng.normal(size=(motion.n_frames, 30, 3))
        plain.append(Motion(motion.positions, motion.fps, body))
        rigged.append(Motion(np.concatenate([motion.positions, hand], axis=1), motion.fps, rig))
    expected, numbers = (evaluate(each, [clip.beats for clip in clips], reference=plain) for each in (plain, rigged))
    for name in ("harmony", "jerk", "freezing", "likeness", "nearest", "fid_kinetic", "fid_geometric"):
        assert numbers[name] == pytest.approx(expected[name], nan_ok=True), name
    assert evaluate(plain, [clip.beats for clip in clips], reference=rigged)["likeness"] == expected["likeness"] == 1


def test_a_reference_may_be_motions_or_a_file_and_what_is_missing_has_its_reason():
    motions, beats = short(4)
    arrays, skeleton = [motion.positions for motion in motions], motions[0].skeleton
    numbers = evaluate(motions, beats, reference=arrays, fps=30.0, skeleton=skeleton)
    assert numbers["fid_kinetic"] < 0 < numbers["diversity_kinetic"]  # the same dances: raw 0, the bias taken off
    assert evaluate(motions, beats, reference=SYNTHETIC)["fid_geometric"] > 0
    few = evaluate(motions[:1], beats[:1], reference=SYNTHETIC)
    assert "fid_kinetic" not in few
    assert says(few["remarks"], "There is no Fréchet distance: it needs 4 dances on either side.")
    other = Skeleton(tuple(f"j{number}" for number in range(21)), skeleton.parents)
    named = evaluate(arrays, beats, fps=30.0, skeleton=other, reference=SYNTHETIC)
    assert says(named["remarks"], "on kinetic features: the joints are not those of the reference")


def test_a_reference_of_another_pose_network_has_no_pose_features():
    reference = Reference(load_reference(SYNTHETIC).rows.assign(f_pose_000=1.0), None, pose_net="old")
    assert "f_pose_000" in reference.for_pose_net("old").rows
    assert "f_pose_000" not in reference.for_pose_net("new").rows


@cases(
    "motions, beats, options, fault",
    (np.zeros((30, 24, 3)), [[1.0]], {"fps": 30.0}, "motions are several dances: put the one that there is"),
    (None, [[1.0]], {}, "motions are several dances: .*; got NoneType"),
    ([np.zeros((30, 24, 3))], None, {"fps": 30.0}, "beats are those of several dances: .*; got NoneType"),
    (["dance.npz"], [[1.0]], {}, r"motions\[0\] must be a Motion or an array of joint positions, got str"),
    ([np.zeros((30, 24, 3))], [[1.0]], {}, r"motions\[0\] is an array, which has no frame rate: pass fps"),
    ([np.zeros((30, 7, 3))], [[1.0]], {"fps": 30.0}, r"motions\[0\]: has 7 joints: pass skeleton=harmolab\.Skeleton"),
    ([np.zeros((30, 72))], [[1.0]], {"fps": 30.0}, r"motions\[0\]: positions must be \(frames, joints, 3\)"),
    ([np.full((30, 24, 3), np.nan)], [[1.0]], {"fps": 30.0}, r"motions\[0\]: "),
    ([np.ma.masked_less(np.zeros((30, 24, 3)), 1)], [[1.0]], {"fps": 30.0}, r"motions\[0\]: positions has masked"),
    ([np.zeros((30, 24, 3))], [np.ones(1, "f2")], {"fps": 30.0}, r"beats\[0\] are of float16: one at 30 s would be"),
    ([np.zeros((30, 24, 3))], [], {"fps": 30.0}, r"beats must have one entry a dance \(1\), got 0"),
    ([np.zeros((30, 24, 3))], [[20.0]], {"fps": 30.0}, r"beats\[0\]: beat times reach 20 in a clip of 1 s; were these"),
    ([np.zeros((30, 24, 3))], [[0.5]], {"fps": 30.0, "songs": []}, None),
    ([np.zeros((30, 24, 3))], [[0.5]], {"fps": 30.0, "songs": ["a", "b"]}, "songs must have one entry a dance"),
    ([np.zeros((30, 24, 3))], [[0.5]], {"fps": 30.0, "reference": []}, "the reference holds no motion"),
    ([], [], {"reference": ["dance.npz"]}, r"reference: motions\[0\] must be a Motion or an array of joint positions"),
)
def test_what_cannot_be_measured_is_named(motions: Any, beats: Any, options: dict[str, Any], fault: str | None):
    if fault is None:
        assert evaluate(motions, beats, **options)["seconds"] == 1.0
    else:
        refused(fault, evaluate, motions, beats, **options)


def test_beats_beyond_the_motion_are_left_out():
    (motion,), (track,) = short(1)
    motion = motion.span(0.0, 3.0)
    assert evaluate([motion], [track])["paper_hit_rate"] == evaluate([motion], [track.span(0.0, 3.0)])["paper_hit_rate"]


def test_a_dance_without_a_bar_pattern_is_remarked():
    clips = [synthetic_clip("jive", seconds=10.0, seed=seed) for seed in (1, 2, 3, 4)]
    inputs = [clip.motion for clip in clips], [clip.beats for clip in clips]
    remarks = evaluate(*inputs, dances=["walz", "waltz", "", "tango"])["remarks"]
    first, second = (one for one in remarks if one.startswith("harmony_dance of 1 of 4 dances is NaN: "))
    assert "'walz' is none of cha-cha, rumba, waltz." in first and "'tango' is none of" in second


def test_remarks_are_true_of_flat_dances_and_of_none():
    assert DanceMetric(SYNTHETIC).remarks == ()
    (motion,), beats = short(1)
    flat = replace(motion, positions=motion.positions[..., :2])
    assert says(evaluate([flat], beats)["remarks"], "foot_skating of 1 of 1 dances is NaN: it needs three dimensions")


def test_a_body_on_its_side_or_in_centimetres_is_remarked_and_columns_of_a_table_will_do():
    (motion, other), beats = short(2)
    lying, large = replace(motion, positions=motion.positions[..., [0, 2, 1]]), 100 * other.positions
    numbers = evaluate([lying, replace(other, positions=large)], beats, songs=pd.Series(["a", "b"]))
    assert says(numbers["remarks"], "The numbers of 1 of 2 dances mean little: z up.")
    assert says(numbers["remarks"], "The numbers of 1 of 2 dances mean little: a body of another size.")
    refused(r"motions\[1\]: a motion of 0.067 s has no two frames", evaluate, [motion, motion.span(0.0, 0.05)], beats)


def test_a_process_without_a_dance_gathers_those_of_others():
    pytest.importorskip("torchmetrics")
    theirs = DanceMetric().torchmetrics()
    ours = type(theirs)(DanceMetric(), sync_on_compute=False)
    theirs.update(*short(2))
    (lines,) = theirs.lines
    ours.sync(dist_sync_fn=lambda part, group: [part, lines], should_sync=True, distributed_available=lambda: True)
    with pytest.warns(UserWarning, match="before the ``update``"):
        np.testing.assert_equal(ours.compute(), theirs.compute())


def test_without_torchmetrics_it_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "torchmetrics", None)
    monkeypatch.delitem(sys.modules, "harmolab.lab.evaluate.torch_metric", raising=False)
    refused("this needs torchmetrics; run: pip install torchmetrics", DanceMetric().torchmetrics)


def test_dances_without_a_song_are_each_of_their_own_whatever_the_batches_and_processes():
    torchmetrics = pytest.importorskip("torchmetrics")
    motions, beats = short(4)
    whole, one, other = (DanceMetric(SYNTHETIC) for _ in range(3))
    gathered = torchmetrics.MetricCollection({"dance": DanceMetric(SYNTHETIC).torchmetrics()})
    seeds = ["a", "a", "b", "b"]
    whole.update(motions, beats, seeds=seeds)
    for metric, part in ((one, slice(0, 3)), (other, slice(3, 4))):
        metric.update(motions[part], beats[part], songs=[None, np.nan, None, None][part], seeds=seeds[part])
        gathered.update(motions[part], beats[part], seeds=seeds[part])
    one.merge_state(json.loads(json.dumps(other.rows)))
    numbers = whole.compute()
    assert not any(name.startswith("multimodality") for name in numbers)  # which is of dances to one song
    np.testing.assert_equal(one.compute(), numbers)
    told = {name.removeprefix("dance_"): float(value) for name, value in gathered.compute().items()}
    np.testing.assert_equal(told, numbers)


def test_songs_and_seeds_in_arrays_and_tensors_are_named_by_their_numbers():
    metric, (motions, beats) = DanceMetric(), short(2)
    for kind in (np.array, pd.Series, pytest.importorskip("torch").tensor):
        metric.update(motions, beats, songs=kind([3, 4]), seeds=kind([0, 1]))
    assert {(row["song"], row["seed"]) for row in metric.rows} == {("3", "0"), ("4", "1")}


def test_torchmetrics_has_the_same_numbers():
    torchmetrics = pytest.importorskip("torchmetrics")
    motions, beats = short(4)
    metric = DanceMetric(SYNTHETIC)
    metric.update(motions, beats, songs=["0", "1", "2", "3"])
    collection = torchmetrics.MetricCollection({"dance": DanceMetric(SYNTHETIC).torchmetrics()})
    for first in (0, 2):
        collection.update(motions[first : first + 2], beats[first : first + 2], songs=[f"{first}", f"{first + 1}"])
    collection.update([], [])  # a batch of which nothing is left
    numbers = collection.set_dtype("torch.BFloat16Tensor").compute().items()
    np.testing.assert_equal({name.removeprefix("dance_"): float(one) for name, one in numbers}, metric.compute())
