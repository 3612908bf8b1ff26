"""The leaderboard: its rows follow from their evidence, and its page from its rows."""

import hashlib
import json
import re
import shutil
from collections.abc import Callable
from itertools import product
from pathlib import Path

import pandas as pd
import pytest

from benchmarks.leaderboard import __main__ as leaderboard
from benchmarks.leaderboard.page import SCORES, page
from harmolab.data.synthetic import write_corpus
from harmolab.lab.evaluate import submission
from harmolab.lab.evaluate.measured import MEASURES
from tests.builders import cases, refused

FOLDERS = sorted(path.parent for path in leaderboard.ROWS.glob("*/row.json"))
LARGEST = 100_000  # bytes of a file of evidence
SETTINGS = {"rotations": 200, "resamples": 200, "seed": 0}


@pytest.fixture
def row(tmp_path: Path) -> Path:
    """A copy of a committed row."""
    return Path(shutil.copytree(leaderboard.ROWS / "compare-synthetic", tmp_path / "row"))


def edit(path: Path, change: Callable[[dict], object]) -> None:
    """Change the content of a JSON file."""
    content = json.loads(path.read_text("utf-8"))
    change(content)
    path.write_text(json.dumps(content), "utf-8")


def windows(scores: list[tuple[float, float]]) -> pd.DataFrame:
    """Evidence of windows, one a recording, in which every score has one true and one wrong value."""
    columns = {"recording": [f"take{place}" for place in range(len(scores))]}
    for name in SCORES:
        columns |= {f"{name} true": [true for true, _ in scores], f"{name} wrong 1": [wrong for _, wrong in scores]}
    return pd.DataFrame(columns)


def dances(harmony: dict[tuple[str, str, str], float]) -> pd.DataFrame:
    """Evidence of dances: (system, seed, song) -> harmony."""
    rows = [(*names, "generated", value) for names, value in harmony.items()]
    return pd.DataFrame(rows, columns=["system", "seed", "song", "kind", "harmony"])


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_committed_numbers_follow_from_their_evidence(folder: Path):
    measured = leaderboard.load_row(folder)
    evidence = leaderboard.read_evidence(folder)
    assert sorted(set(evidence["recording" if measured["kind"] == "compare" else "song"])) == measured["recordings"]
    assert measured.get("windows", len(evidence)) == len(evidence)


def test_an_auc_of_the_board_is_the_share_of_pairs_in_which_true_music_wins():
    folder = leaderboard.ROWS / "compare-synthetic"
    evidence = leaderboard.read_evidence(folder)
    true = evidence["mir_eval_f true"]
    wrong = [value for place in range(1, 6) for value in evidence[f"mir_eval_f wrong {place}"]]
    wins = [(high > low) + (high == low) / 2 for high, low in product(true, wrong)]
    assert leaderboard.load_row(folder)["numbers"]["mir_eval_f"]["auc"] == pytest.approx(sum(wins) / len(wins))


@pytest.mark.slow
def test_the_page_follows_from_the_rows():
    assert leaderboard.PAGE.read_text("utf-8") == page(leaderboard.load_rows())


def test_auc_of_two_windows_by_hand():
    # Of the pairs (3, 1), (3, 2), (2, 1), (2, 2) the true score wins three and ties one.
    numbers = leaderboard.compare_numbers(windows([(3.0, 1.0), (2.0, 2.0)]), SETTINGS)
    assert {row["auc"] for row in numbers.values()} == {0.875}


def test_means_are_over_songs_and_a_rank_needs_a_difference_beyond_luck():
    songs = [f"song{place}" for place in range(6)]
    better = {("a", seed, song): value for song in songs for seed, value in (("1", 0.6), ("2", 0.8))}
    worse = {("b", "1", song): 0.1 + 0.01 * place for place, song in enumerate(songs)}
    same = {("c", "1", song): 0.7 for song in songs}
    numbers = leaderboard.evaluate_numbers(dances(better | worse | same), SETTINGS)["systems"]
    assert [numbers[name]["harmony"]["mean"] for name in "abc"] == pytest.approx([0.7, 0.125, 0.7])
    assert [numbers[name]["harmony"]["rank"] for name in "abc"] == [1, 3, 1]
    assert (numbers["a"]["dances"], numbers["a"]["songs"]) == (12, 6)


def test_a_number_that_does_not_follow_is_noticed(row: Path):
    edit(row / "row.json", lambda content: content["measured"]["numbers"]["paper"].update(auc=0.5))
    refused(r"row\.json: its numbers do not follow from evidence\.csv", leaderboard.load_row, row)


def test_changed_evidence_is_noticed(row: Path):
    table = pd.read_csv(row / "evidence.csv")
    table.loc[0, "recommended true"] = -1.0
    table.to_csv(row / "evidence.csv", index=False)
    refused("do not follow", leaderboard.load_row, row)


@cases(
    "change, fault",
    (lambda content: content["about"].pop("licence"), '"about" lacks licence'),
    (lambda content: content.pop("measured"), "nothing measured yet"),
)
def test_a_row_that_lacks_something_says_what(row: Path, change: Callable[[dict], object], fault: str):
    edit(row / "row.json", change)
    refused(fault, leaderboard.load_row, row)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_evidence_is_small_and_names_no_place_on_a_disk(folder: Path):
    evidence = folder / "evidence.csv"
    assert evidence.stat().st_size < LARGEST
    assert re.search(r"[/\\]", evidence.read_text("utf-8")) is None
    assert re.search(r'"[^"]*(?:/work|/root|/home|/tmp)', (folder / "row.json").read_text("utf-8")) is None


def test_a_digest_depends_on_names_and_bytes_and_not_on_the_place(tmp_path: Path):
    for place, text in (("one", "a"), ("two", "a"), ("three", "b")):
        (tmp_path / place / "take").mkdir(parents=True)
        (tmp_path / place / "take" / "motion.npz").write_text(text)
    one, two, three = (leaderboard.digest([tmp_path / place / "take"]) for place in ("one", "two", "three"))
    assert one == two != three
    both = [str(tmp_path / place / "take" / "motion.npz") for place in ("one", "three")]  # of one name, in two seeds
    own = [f"motion.npz {hashlib.sha256(text).hexdigest()}\n" for text in (b"a", b"b")]
    assert leaderboard.digest(both) == hashlib.sha256("".join(sorted(own)).encode()).hexdigest()


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as `harmolab evaluate` leaves it, of two dances; the row "NAME" waits for it."""
    row, folder = tmp_path / "rows" / "NAME", tmp_path / "table"
    row.mkdir(parents=True)
    folder.mkdir()
    about = dict.fromkeys(leaderboard.ABOUT, "text") | {"synthetic": True, "commands": []}
    (row / "row.json").write_text(json.dumps({"about": about}))
    settings = {"systems": {"ours": str(tmp_path / "ours")}, "music": str(tmp_path / "songs"), "resamples": 200}
    settings |= {"reference": str(tmp_path / "recorded"), "protocols": [], "fps": 30.0, "scale": None, "seed": 0}
    (folder / "evaluation.json").write_text(json.dumps({"settings": settings}))
    lines = ["error,system,seed,song,motion,music,kind,fps,dance,harmony"]
    for system, seed, harmony in (("ours", "1", 0.25), ("recorded", "", 0.5)):
        (tmp_path / f"{system}.npz").write_text(system)
        lines.append(f",{system},{seed},one,{tmp_path}/{system}.npz,{tmp_path}/ours.npz,kind,30.0,,{harmony}")
    (folder / "clips.csv").write_text("\n".join(lines))
    monkeypatch.setattr(leaderboard, "ROWS", row.parent)
    monkeypatch.setattr(leaderboard, "code_commit", lambda: "0" * 40)
    return folder


def test_a_row_of_an_evaluation_has_its_numbers_and_none_of_its_paths(table: Path):
    leaderboard.write_evaluate_row("NAME", table)
    row = leaderboard.ROWS / "NAME"
    measured = leaderboard.load_row(row)
    assert measured["numbers"]["systems"]["ours"]["harmony"]["mean"] == 0.25
    assert measured["command"] == (
        "harmolab evaluate --system ours=ours --music songs --reference recorded "
        "--fps 30.0 --resamples 200 --seed 0 --out table"
    )
    edit(table / "evaluation.json", lambda content: content["settings"].update(smpl=str(table / "body.npz")))
    leaderboard.write_evaluate_row("NAME", table)  # on a body of one's own, which its numbers depend on
    measured = leaderboard.load_row(row)
    assert measured["settings"]["smpl"] == "body.npz" and " --smpl body.npz " in measured["command"]
    assert str(table.parent) not in (row / "evidence.csv").read_text() + (row / "row.json").read_text()


def test_an_evaluation_with_dances_that_failed_is_no_row(table: Path):
    path = table / "clips.csv"
    path.write_text(path.read_text().replace("\n,ours", "\nbroken file,ours"))
    refused("1 dances could not be measured", leaderboard.write_evaluate_row, "NAME", table)


@pytest.mark.slow
def test_the_synthetic_row_can_be_measured_again_by_anybody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    corpus = tmp_path / "synthetic"
    write_corpus(corpus, clips=70)
    row = tmp_path / "rows" / "compare-synthetic"
    row.mkdir(parents=True)
    shutil.copy(leaderboard.ROWS / "compare-synthetic" / "row.json", row)
    monkeypatch.setattr(leaderboard, "ROWS", row.parent)
    monkeypatch.setattr(leaderboard, "code_commit", lambda: "")
    leaderboard.write_compare_row("compare-synthetic", corpus)
    again, committed = leaderboard.load_row(row), leaderboard.load_row(FOLDERS[0].parent / "compare-synthetic")
    for name in SCORES:
        assert again["numbers"][name]["auc"] == pytest.approx(committed["numbers"][name]["auc"], abs=0.002)
        assert again["numbers"][name]["interval"] == pytest.approx(committed["numbers"][name]["interval"], abs=0.005)
        assert again["chance_band"][name] == pytest.approx(committed["chance_band"][name], abs=0.005)


def test_names_of_songs_that_look_like_numbers_or_like_nothing_stay_what_they_are(tmp_path: Path):
    lines = ["system,seed,song,kind,dance,fps,harmony", "7,,001,generated,,30,0.5", "7,02,None,generated,NA,30,"]
    (tmp_path / "evidence.csv").write_text("\n".join(lines) + "\n")
    evidence = submission.read_evidence(tmp_path)
    assert evidence["song"].tolist() == ["001", "None"] and evidence["system"].tolist() == ["7", "7"]
    assert (evidence["seed"].tolist(), evidence["dance"].tolist()) == (["", "02"], ["", "NA"])
    assert evidence["fps"].mean() == 30 and evidence["harmony"].isna().tolist() == [False, True]


def test_columns_of_a_protocol_are_means_over_dances_as_in_the_table():
    names = {"system": "x", "seed": "", "kind": "generated", "dance": "", "song": ["a", "a", "a", "b"]}
    dances = pd.DataFrame(
        {
            **dict.fromkeys(MEASURES, float("nan")),
            **names,
            "edge PFC": [1.0, 1.0, 1.0, 3.0],
            "jerk": [1.0, 1.0, 1.0, 3.0],
        }
    )
    numbers = submission.evaluate_numbers(dances, {"resamples": 100, "seed": 0})["systems"]["x"]
    assert (numbers["edge PFC"]["mean"], numbers["jerk"]["mean"]) == (1.5, 2.0)
