"""`harmolab evaluate --shard` and `evaluate merge`: one table from several runs, to the last bit that of one."""

import hashlib
import json
import math
import os
import re
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab import files
from harmolab.cli import app
from harmolab.data.synthetic import write_corpus
from harmolab.files import read_json, write_json
from harmolab.lab.evaluate import evaluation, shards
from harmolab.lab.evaluate.evaluation import MARK, EvaluationSettings, evaluate_dances
from harmolab.lab.evaluate.page import write_evaluation
from harmolab.lab.evaluate.pairing import listed_pairs
from harmolab.lab.evaluate.rows import RowOptions
from harmolab.lab.evaluate.shards import Shard, measure_shard, merge_shards
from harmolab.readers.motion import load_motion, save_motion
from tests.builders import called, cases, refused

run = partial(called, app)
COUNT = 4


def settings(root: Path, **others: Any) -> EvaluationSettings:
    recorded = root / "recorded"
    common: dict[str, Any] = {"music": recorded, "reference": recorded, "protocols": ["edge"], "resamples": 100}
    return EvaluationSettings({"ours": root / "ours"}, **(common | others))


@pytest.fixture(scope="module", autouse=True)
def small_parts() -> Iterator[None]:
    """Parts of four rows, for shards that are resumed too: so that they have several."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (evaluation, shards):
            patch.setattr(module, "PART_DANCES", 4)
        yield


@pytest.fixture(scope="module")
def sharded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dances, one of them damaged and one without a protocol's joints; one/, and the four shards of it in shards/."""
    root = tmp_path_factory.mktemp("sharded")
    corpus = write_corpus(root / "recorded", clips=5, seconds=11.0, fps=30.0, seed=4)
    (root / "ours").mkdir()
    for clip in sorted(corpus.glob("clip_*")):
        save_motion(root / "ours" / f"{clip.name}.npz", load_motion(clip / "motion.npz"))
    first, second, *_ = sorted((root / "ours").iterdir())
    first.write_bytes(b"broken")
    np.savez(second, positions=load_motion(second).positions, fps=30.0)
    (root / "shards").mkdir()
    write_evaluation(root / "one", evaluate_dances(settings(root), root / "one"))
    for number in range(1, COUNT + 1):
        measure_shard(settings(root), root / "shards" / f"s{number}", Shard(number, COUNT))
    write_evaluation(root / "merged", merge_shards(folders(root / "shards"), root / "merged"))
    return root


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("index.html", ".lock")  # a page's sound has a serial number by chance
    }


@pytest.mark.slow
def test_four_shards_come_to_the_bytes_of_one_run(sharded: Path):
    one, merged = content(sharded / "one"), content(sharded / "merged")
    assert {"clips.csv", "table.csv", "table.json", "table.tex", "evaluation.json", "rows/run.json"} <= one.keys()
    assert len([name for name in one if name.startswith("rows/part-")]) == 5
    assert {name for name in one.keys() | merged.keys() if one.get(name) != merged.get(name)} == set()
    counts = [json.loads((sharded / "shards" / f"s{number}" / "evaluation.json").read_text())["rows"] for number in
              range(1, COUNT + 1)]  # fmt: skip
    assert sum(counts) == 20 and max(counts) < 20


def folders(shards: Path) -> list[Path]:
    return sorted(shards.iterdir())


def copied(sharded: Path, folder: Path) -> Path:
    shutil.copytree(sharded / "shards", folder)
    return folder


@pytest.mark.slow
def test_what_does_not_belong_together_is_not_merged(sharded: Path, tmp_path: Path):
    shards = copied(sharded, tmp_path / "shards")
    shutil.rmtree(shards / "s2")
    refused("shards are missing: 2/4", merge_shards, folders(shards), tmp_path / "table")
    shutil.copytree(shards / "s1", shards / "again")
    refused("are not parts of one evaluation: 1/4, 1/4, 3/4, 4/4", merge_shards, folders(shards), tmp_path / "table")
    shutil.rmtree(shards / "again")
    measure_shard(settings(sharded, seed=1), shards / "s2", Shard(2, COUNT))
    refused("s2: has another seed than s1; measure all", merge_shards, folders(shards), tmp_path / "table")
    refused("s2: is an input here", merge_shards, folders(shards), shards / "s2", force=True)
    refused("one: is no shard; measure one by --shard", merge_shards, [sharded / "one"], tmp_path / "table")
    for shard, fault in ((3, "4/4, got '3'"), ("1/1", r"s2.evaluation\.json: cannot be read as the settings")):
        write_json(shards / "s2" / MARK, {"settings": {"systems": 3, "music": 1}, "shard": shard, "rows": 8})
        refused(fault, merge_shards, [shards / "s2"], tmp_path / "table")
    shards = copied(sharded, tmp_path / "cut")
    max((shards / "s3" / "rows").glob("part-*")).unlink()
    refused(r"s3: holds \d+ of \d+ rows", merge_shards, folders(shards), tmp_path / "table")


@pytest.mark.slow
def test_an_unfinished_run_is_not_replaced_unasked_but_for_one_that_the_shards_hold(sharded: Path, tmp_path: Path):
    shutil.copytree(sharded / "one", out := tmp_path / "table")
    max((out / "rows").glob("part-*")).unlink()
    mark = read_json(out / MARK)
    write_json(out / MARK, {**mark, "settings": {**mark["settings"], "seed": 1}})
    asked = partial(merge_shards, folders(sharded / "shards"), out)
    refused(r"rows: holds \d+ of 20 rows; go on with --resume, or begin anew with --force", asked)
    assert read_json(out / MARK)["settings"]["seed"] == 1
    write_json(out / MARK, mark)  # as a merge that was killed leaves it
    asked()
    assert (out / "clips.csv").read_bytes() == (sharded / "one" / "clips.csv").read_bytes()


@pytest.mark.slow
def test_shards_of_processors_that_differ_in_the_last_digit_are_resumed_and_merged(sharded: Path, tmp_path: Path):
    shards = copied(sharded, tmp_path / "shards")
    manifest = read_json(shards / "s2" / "rows" / "run.json")
    for numbers in manifest["settings"]["limits"]["pooled"].values():  # as with and without AVX-512
        numbers[0] = math.nextafter(numbers[0], 0.0)
    write_json(shards / "s2" / "rows" / "run.json", manifest)
    measure_shard(settings(sharded), shards / "s2", Shard(2, COUNT), resume=True)
    merge_shards(folders(shards), tmp_path / "table")
    assert (tmp_path / "table" / "clips.csv").read_bytes() == (sharded / "one" / "clips.csv").read_bytes()


@pytest.mark.slow
def test_dances_that_came_after_the_shards_are_noticed(sharded: Path, tmp_path: Path):
    root = tmp_path / "root"
    for name in ("recorded", "ours", "shards"):
        shutil.copytree(sharded / name, root / name)
    for mark in (root / "shards").glob("*/evaluation.json"):
        mark.write_text(mark.read_text().replace(str(sharded), str(root)))
    refused("the dances or songs have changed since the shards were measured", merge_shards, folders(root / "shards"),
            tmp_path / "table")  # fmt: skip


@pytest.mark.slow
def test_a_dance_that_has_changed_since_its_shard_was_measured_is_named(sharded: Path, tmp_path: Path):
    dance = max((sharded / "ours").iterdir())
    status = dance.stat()
    os.utime(dance, ns=(status.st_atime_ns, status.st_mtime_ns + 10**9))
    fault = rf"{dance.name} or audio\.wav has changed since it was measured, .* its shard again with --resume"
    refused(fault, merge_shards, folders(sharded / "shards"), tmp_path / "table")
    os.utime(dance, ns=(status.st_atime_ns, status.st_mtime_ns))


@pytest.mark.slow
def test_a_run_that_is_refused_leaves_the_settings_of_the_one_that_is_there(sharded: Path, tmp_path: Path):
    shard = shutil.copytree(sharded / "shards" / "s1", tmp_path / "s1")
    table = shutil.copytree(sharded / "one", tmp_path / "one")
    before = [(folder / "evaluation.json").read_bytes() for folder in (shard, table)]
    other = settings(sharded, protocols=[])
    refused("was begun otherwise", measure_shard, other, shard, Shard(1, COUNT), resume=True)
    refused("was begun otherwise", evaluate_dances, other, table, resume=True)
    unread = settings(sharded, reference=tmp_path / "nowhere")
    refused("shard was 1/4 and is 2/4", measure_shard, unread, shard, Shard(2, COUNT), resume=True)
    refused("shard was 1/4 and is None", evaluate_dances, unread, shard, resume=True)
    assert [(folder / "evaluation.json").read_bytes() for folder in (shard, table)] == before


@pytest.mark.slow
def test_the_command_measures_shards_and_merges_them(sharded: Path, tmp_path: Path):
    shards = copied(sharded, tmp_path / "shards")
    recorded = sharded / "recorded"
    common = ("--music", recorded, "--reference", recorded, "--protocol", "edge", "--resamples", 100, "--jobs", 0)
    mark = shards / "s4" / MARK  # as a kill leaves it
    mark.write_text(re.sub(r'"rows": \d+', '"rows": null', mark.read_text()))
    next((shards / "s4" / "rows").glob("part-*")).unlink()
    result = run("evaluate", "merge", *folders(shards), "--out", tmp_path / "table")
    assert "s4: is not finished; go on with it by --resume" in result.output.replace("\n", " ")
    result = run("evaluate", sharded / "ours", *common, "--shard", "4/4", "--resume", "--out", shards / "s4")
    assert result.exit_code == 0 and "shard 4/4: " in result.output, result.output
    result = run("evaluate", "merge", *folders(shards), "--out", tmp_path / "table", "--allow-missing")
    assert result.exit_code == 0, result.output
    result = run("evaluate", "merge", *folders(shards), "--out", tmp_path / "table")
    assert result.exit_code == 1 and "1 dance was not measured" in result.output
    assert content(tmp_path / "table")["table.csv"] == content(sharded / "merged")["table.csv"]


def test_settings_of_rows_are_what_is_in_the_files_of_network_and_body(tmp_path: Path):
    options = RowOptions(pose_net=tmp_path / "net", smpl=tmp_path / "net.json")
    for text in ("one", "other"):
        (tmp_path / "net.json").write_text(text)
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        assert [options.to_dict()[name] for name in ("pose_net", "smpl")] == [digest, digest]


@cases("text", "0/4", "5/4", "1", "a/b", "1/0", "-1/4")
def test_a_shard_is_a_number_and_how_many_there_are(text: str):
    refused("--shard must be a number and how many there are, as 1/4 to 4/4", Shard.of, text)


def test_a_list_of_pairs_is_read_by_lines_and_a_shard_keeps_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "song.wav").touch()
    names = [f"d{number}.npz" for number in range(40)]
    for name in names:
        (tmp_path / name).touch()
    table = tmp_path / "pairs.csv"
    table.write_text("motion,music\n" + "".join(f"{name},song.wav\n" for name in names))
    monkeypatch.setattr(files, "read_text", None)  # nothing reads the text as a whole
    monkeypatch.setattr(files, "MAX_ROWS", 10)  # and there is no bound on it
    parts = [listed_pairs(table, None, {}, keep=Shard(number, 4).holds) for number in range(1, 5)]
    assert sorted(pair.motion.name for part in parts for pair in part.pairs) == sorted(names)
    assert max(len(part.pairs) for part in parts) < 25
    nothing = listed_pairs(table, None, {}, keep=lambda pair: False)  # --fps NAME= stands in every shard's command
    assert (nothing.pairs, nothing.systems) == ((), ("generated",))
