"""What goes into `harmolab evaluate`: where a dance begins, frames that a system was given, files that are faulty."""

import json
import os
import pickle
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
import soundfile
from filelock import FileLock
from scipy.spatial.transform import Rotation

from harmolab.cli import app
from harmolab.cli.data_check import check
from harmolab.lab.evaluate import pairing
from harmolab.lab.evaluate.evaluation import EvaluationSettings, evaluate_dances, evaluation_pairs
from harmolab.lab.evaluate.pairing import Pair, Song, folder_pairs, listed_pairs, slice_start, song_of
from harmolab.lab.evaluate.rows import RowOptions, clip_row
from harmolab.lab.evaluate.submission import file_hashes
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import Motion
from tests.builders import called, cases, done, planted_dance, refused, track, write_song
from tests.test_evaluate_models import smpl_dance
from tests.test_model_files import to_z_up
from tests.test_protocols import frames_of_aist, loop_beat_align
from tests.test_reference import CASES

run = partial(called, app)
SECONDS, FPS = 16.0, 60.0
RECORDED_NAME = "gBR_sBM_cAll_d04_{}_ch01"
SONGS = {"mBR0": "cha-cha", "mHO1": "rumba"}


def edge_file(path: Path, joints: np.ndarray) -> None:
    """As EDGE's `render_sample` writes a dance: 30 frames a second, z up."""
    content = {"smpl_poses": np.zeros((len(joints), 72)), "smpl_trans": to_z_up(joints[:, 0])}
    path.write_bytes(pickle.dumps(content | {"full_pose": to_z_up(joints)}))


def fact_file(path: Path, poses: np.ndarray, way: np.ndarray) -> None:
    """As FACT's evaluator writes a dance: 60 frames a second, six zeros, the translation, 24 matrices."""
    turns = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(len(poses), 216)
    np.save(path, np.hstack([np.zeros((len(poses), 6)), way, turns]))


def bailando_folder(folder: Path, joints: np.ndarray) -> None:
    """As Bailando writes a dance into `jsons_original`: a file a frame, 60 frames a second."""
    folder.mkdir(parents=True)
    for number, frame in enumerate(joints):
        (folder / f"frame{number:06d}_kps.json").write_text(json.dumps({"3d_pose": frame.tolist()}))


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two songs, a dancer to each that rests on their beats, recorded, and the same as three codes would write it."""
    root = tmp_path_factory.mktemp("field")
    for name in ("songs", "recorded", "edge", "fact", "bailando"):
        (root / name).mkdir()
    for number, (song, dance) in enumerate(SONGS.items()):
        clip = planted_dance(dance, seconds=SECONDS, seed=number)
        assert clip.beats is not None
        write_song(root / "songs" / f"{song}.wav", clip)
        poses, way = smpl_dance(clip.beats, fps=FPS)
        name = RECORDED_NAME.format(song)
        content = {"smpl_poses": poses, "smpl_trans": way * 93.8, "smpl_scaling": np.array([93.8])}
        (root / "recorded" / f"{name}.pkl").write_bytes(pickle.dumps(content))
        joints = load_motion(root / "recorded" / f"{name}.pkl").positions
        edge_file(root / "edge" / f"2000_{number}_{name}_slice7.pkl", joints[210:840:2])
        seed = np.vstack([np.zeros((120, 72)), poses[120:]])  # a seed that stands still
        still = np.vstack([np.repeat(way[120:121], 120, axis=0), way[120:]])
        fact_file(root / "fact" / f"{RECORDED_NAME.format('mJB4')}_{song}.npy", seed, still)
        bailando_folder(root / "bailando" / f"{name}.json", joints[:720])
    return root


def settings(field: Path, *systems: str, **others: Any) -> EvaluationSettings:
    folders = {name: field / name for name in systems}
    return EvaluationSettings(folders, field / "songs", field / "recorded", resamples=100, **others)


def evaluation(root: Path, out: Path, *words: object) -> tuple[object, ...]:
    """The command for dances to the songs of a folder."""
    inputs = ("--music", root / "songs", "--reference", root / "recorded", "--out", out)
    return ("evaluate", *words, *inputs, "--jobs", 0, "--resamples", 100)


# Where a dance begins


@pytest.mark.slow
def test_files_of_three_codes_evaluate_with_one_command_and_their_starts(field: Path, tmp_path: Path) -> None:
    """The beat alignment of AIST++ of each dance is that of an implementation in loops, given its true start."""
    systems = [part for name in ("edge", "fact", "bailando") for part in ("--system", f"{name}={field / name}")]
    rates = [part for name in ("edge=30", "fact=60", "bailando=60") for part in ("--fps", name)]
    starts = ("--slice-stride", 0.5, "--seed-frames", "fact=120", "--protocol", "aist++")
    result = done(app, *evaluation(field, tmp_path / "table", *systems, *rates, *starts))
    clips = pd.read_csv(tmp_path / "table" / "clips.csv").set_index(["system", "song"])
    for song in SONGS:
        joints = load_motion(field / "recorded" / f"{RECORDED_NAME.format(song)}.pkl")
        dances = {"edge": (joints.positions[210:840:2], 30.0, 3.5), "fact": (joints.positions[120:], 60.0, 2.0)}
        dances["bailando"] = (joints.positions[:720], 60.0, 0.0)
        for system, (positions, fps, start) in dances.items():
            row, motion = clips.loc[system, song], Motion(positions, fps, joints.skeleton)
            assert (row["offset"], row["fps"]) == (pytest.approx(start), fps)
            assert row["seconds"] == pytest.approx(motion.duration)
            frames = [frame for frame in frames_of_aist(field / "songs" / f"{song}.wav", fps) if frame >= start * fps]
            expected = loop_beat_align(motion, track([frame / fps - start for frame in frames], duration=60.0))
            assert row["aist++ BeatAlign"] == pytest.approx(expected, abs=1e-6)
            # The dancer rests on the planted beats, wherever it begins.
            assert row["beat_align_motion"] > 0.6
    assumed = dict.fromkeys(("fact", "bailando", "recorded", "recorded, other song", "frozen pose"), "assumed")
    assert clips["begins"].groupby("system").first().to_dict() == {"edge": "slice", **assumed}
    content = json.loads((tmp_path / "table" / "table.json").read_text("utf-8"))
    remark = next(one for one in content["notes"] if one.startswith("Taken to begin with their song"))
    assert "fact (2 of 2), bailando (2 of 2), recorded (2 of 2)" in remark and "edge" not in remark
    left_out = "The first 120 frames of each dance of fact, which the system was given, were left out."
    assert left_out in content["methods_in_full"] and "FACT's recorded seed" not in content["methods_in_full"]
    for text in ((tmp_path / "table" / "index.html").read_text("utf-8"), " ".join(result.output.split())):
        assert "Taken to begin with their song" in text


@pytest.mark.skipif(not CASES, reason="no reference file; set HARMOLAB_REFERENCE")
@pytest.mark.parametrize("case", [one for one in CASES if "sequence" in one], ids=lambda case: case["name"])
def test_hit_rates_of_the_reference_come_out_at_any_start_in_the_song(tmp_path: Path, case: dict[str, Any]) -> None:
    """A joint with the reference's speed, danced 4 s into a song that has the reference's beats from there on."""
    speed = np.array(case["J_v"]) / 100
    positions = np.zeros((len(speed), 1, 3))
    positions[1:, 0, 0] = np.cumsum(speed[1:]) / 15
    np.savez(tmp_path / "dance.npz", positions=positions, fps=15.0)
    soundfile.write(tmp_path / "song.wav", np.random.default_rng(1).normal(0, 0.1, 22050 * 12), 22050)
    times = 4.0 + np.array(case["p_a"]) / 15
    (tmp_path / "song.beats").write_text("\n".join(map(repr, times.tolist())))
    (tmp_path / "pairs.csv").write_text("motion,music,offset\ndance.npz,song.wav,4.0\n")
    (pair,) = listed_pairs(tmp_path / "pairs.csv", tmp_path, {}).pairs
    row, expected = clip_row(pair, RowOptions()), case["variants"]["default"]
    assert (row["offset"], row["begins"]) == (4.0, "listed")
    assert row["paper_hit_rate_chance"] == pytest.approx(expected["coverage"], abs=1e-9)
    assert row["paper_hit_rate"] == pytest.approx(expected["hit_rate"], abs=1e-9)
    assert clip_row(replace(pair, offset=None, begins=""), RowOptions())["begins"] == "assumed"


def test_a_slice_begins_where_its_number_says_and_is_not_guessed_without_a_stride(tmp_path: Path) -> None:
    songs = [Song("mBR0", Path("mBR0.wav"))]
    (tmp_path / "gBR_sBM_cAll_d04_mBR0_ch01_slice7.pkl").touch()
    (pair,) = folder_pairs("edge", tmp_path, songs, slice_stride=0.5).pairs
    assert (pair.offset, pair.begins) == (3.5, "slice")
    refused(r"slice7\.pkl: is slice 7 of its song; pass --slice-stride", folder_pairs, "edge", tmp_path, songs)
    sliced = [Song("mBR0_slice7", Path("gBR_sBM_cAll_d04_mBR0_ch01_slice7.wav"))]
    assert folder_pairs("edge", tmp_path, sliced).pairs[0].offset == 0.0  # the sound is the slice itself
    assert slice_start(Path("test_3_063z@005.pkl"), Song("063", Path("063.wav")), 4.0) == (20.0, "slice")
    (tmp_path / "test_mBR0.pkl").touch()
    (_, whole) = folder_pairs("edge", tmp_path, songs, slice_stride=0.5).pairs
    assert (whole.motion.name, whole.offset, whole.begins) == ("test_mBR0.pkl", None, "")


def test_a_dance_in_two_formats_counts_once(tmp_path: Path) -> None:
    for name in ("one.bvh", "one.npz", "two.bvh"):
        (tmp_path / name).touch()
    pairs, unpaired, _ = folder_pairs("ours", tmp_path, [Song(name, Path(f"{name}.wav")) for name in ("one", "two")])
    assert [pair.motion.name for pair in pairs] == ["one.npz", "two.bvh"]
    assert unpaired == ((tmp_path / "one.bvh", "has the name of one.npz, which alone counts", ""),)


def test_a_file_of_edge_that_says_no_start_is_remarked_on(field: Path, tmp_path: Path) -> None:
    shutil.copy(next((field / "edge").iterdir()), tmp_path / "test_mBR0.pkl")
    pair = Pair("edge", "", "mBR0", tmp_path / "test_mBR0.pkl", field / "songs" / "mBR0.wav")
    row = clip_row(pair, RowOptions(fps=30.0))
    assert (row["offset"], row["begins"]) == (0.0, "assumed, file of EDGE")
    # The same dance from its true start, by a list: the beats that it rests on are there again.
    right = clip_row(replace(pair, offset=3.5, begins="listed"), RowOptions(fps=30.0))
    assert right["beat_align_motion"] > row["beat_align_motion"] + 0.2


@cases(
    "line, fault",
    ("motion,music,start\na.npz,a.wav,3", "has a column 'start'; columns are motion and music, and perhaps system"),
    ("motion,music,offset\na.npz,a.wav,soon", "offset must be the second of the song .* got 'soon'"),
    ("motion,music,offset\na.npz,a.wav,nan", "offset must be the second of the song .* got 'nan'"),
)
def test_a_column_or_a_start_that_is_not_known_is_an_error(tmp_path: Path, line: str, fault: str) -> None:
    for name in ("a.npz", "a.wav"):
        (tmp_path / name).touch()
    (tmp_path / "pairs.csv").write_text(line)
    refused(fault, listed_pairs, tmp_path / "pairs.csv", tmp_path, {})


def test_rates_and_seeds_are_those_of_their_system(field: Path, tmp_path: Path) -> None:
    some = settings(field, "fact", "bailando", fps={"fact": 60.0}, seed_frames={"fact": 120})
    answers = {(pair.system, pair.fps, pair.seed_frames) for pair in evaluation_pairs(some).pairs}
    assert answers == {("fact", 60.0, 120), ("bailando", None, 0), ("recorded", None, 0)}
    unknown = settings(field, "fact", seed_frames={"fcat": 120})
    refused(r"--seed-frames fcat=120: no system is called 'fcat'", evaluation_pairs, unknown)
    for option, *texts, fault in (
        ("--fps", "30", "--fps", "fact=60", "--fps: write one number for all systems, or one with a name for each"),
        ("--seed-frames", "half", "write a whole number, or NAME="),
        ("--seed-frames", "-5", "must be a finite number, not negative"),
        ("--fps", "fact=inf", "--fps must be a finite number"),
    ):
        result = run(*evaluation(field, tmp_path / "x", field / "fact", option, *texts))
        assert result.exit_code == 2 and fault in result.stderr


def test_a_system_whose_folder_was_passed_and_that_no_line_names_is_an_error(field: Path, tmp_path: Path) -> None:
    dance = next((field / "edge").iterdir())
    (tmp_path / "pairs.csv").write_text(f"motion,music,system,offset\n{dance.name},mBR0.wav,edge,3.5\n")
    passed = settings(field, "edge", "fact", pairs=tmp_path / "pairs.csv")
    refused(r"pairs\.csv: names no dance of 'fact', whose folder was passed", evaluation_pairs, passed)


def test_the_seed_of_fact_is_remarked_on_until_it_is_left_out(field: Path, tmp_path: Path) -> None:
    pair = evaluation_pairs(settings(field, "fact")).pairs[-1]
    save_motion(tmp_path / "gBR_sBM_cAll_d04_mBR0_ch01_mHO1.npz", load_motion(pair.motion, fps=60.0))  # by its name
    for motion in (pair.motion, tmp_path / "gBR_sBM_cAll_d04_mBR0_ch01_mHO1.npz"):
        own = replace(pair, motion=motion)
        row, without = (clip_row(one, RowOptions(fps=60.0)) for one in (own, replace(own, seed_frames=120)))
        assert "seed, left in (--seed-frames 120 leaves them out)" in row["assumptions"]
        assert "seed" not in without["assumptions"]
        assert (row["offset"], without["offset"]) == (0.0, 2.0)
        assert without["freezing"] < row["freezing"]  # the seed of the fixture stands still


def test_a_dance_that_is_all_seed_is_refused(field: Path) -> None:
    pair = evaluation_pairs(settings(field, "fact", seed_frames=5000)).pairs[-1]
    refused(r"has 960 frames, none behind its seed \(--seed-frames 5000\)", clip_row, pair, RowOptions(fps=60.0))


# Faults


def faulty(path: Path, motion: Motion, **changes: Any) -> None:
    """An npz of the motion with some arrays changed, unchecked."""
    arrays = {"positions": motion.positions, "fps": motion.fps, "joints": np.array(motion.skeleton.joints)}
    np.savez(path, **arrays | {"parents": np.array(motion.skeleton.parents)} | changes)


@pytest.fixture(scope="module")
def faults(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sound dances in `ours`, and eleven that are not; `songs` with annotated beats, `recorded` dances."""
    root = tmp_path_factory.mktemp("faults")
    for name in ("ours", "songs", "recorded"):
        (root / name).mkdir()
    clip = planted_dance(seconds=12.0)
    assert clip.motion is not None and clip.beats is not None
    for number in range(10):
        write_song(root / "songs" / f"song{number}.wav", clip)
        (root / "songs" / f"song{number}.beats").write_text("\n".join(map(str, clip.beats.times)))
    motion, ours = clip.motion, root / "ours"
    names, parents = list(motion.skeleton.joints), list(motion.skeleton.parents)
    for folder in ("ours", "recorded"):
        for number in (0, 1):
            save_motion(root / folder / f"song{number}.npz", motion, offset=0.0)
    gap = np.where(np.arange(720)[:, None, None] == 99, np.nan, motion.positions)
    child_of_root = parents.index(parents.index(-1))
    faulty(ours / "song2.npz", motion, positions=motion.positions * 100)
    faulty(ours / "song3.npz", motion, positions=to_z_up(motion.positions))
    faulty(ours / "song4.npz", motion, fps=6.0)
    faulty(ours / "song5.npz", motion)
    (ours / "song5.npz").write_bytes((ours / "song5.npz").read_bytes()[:5000])
    faulty(ours / "song6.npz", motion, positions=gap)
    faulty(ours / "song7.npz", motion, joints=np.array([names[1], *names[1:]]))
    faulty(ours / "song8.npz", motion, parents=np.array([child_of_root if one == -1 else one for one in parents]))
    save_motion(ours / "song77.npz", motion)
    save_motion(ours / "song0 song1.npz", motion)
    (ours / "loop").symlink_to(ours)
    (ours / "about.json").write_text('{"epochs": 100}')  # no dance, and not missed
    (ours / "song9.npz").touch()
    return root


NO_DANCE = ("is no motion file", "no dance goes with this song")
REASONS = {
    "song2.npz": "the body extends over",
    "song3.npz": "the head is above the feet along z, and not along y",
    "song4.npz": "6 frames a second are too few for a dance",
    "song5.npz": "cannot be read as an .npz motion",
    "song6.npz": "NaN or infinity at frame 99",
    "song7.npz": "several joints have one name: ",
    "song8.npz": "the parents of its joints lead round in a circle",
    "song77.npz": "no song has its name, or a word of its name",
    "song0 song1.npz": "goes with 2 songs: song0.wav, song1.wav",
    "loop": "is a link to a folder that it lies in",
    "song9.npz": "the file is empty",
}


@pytest.mark.slow
def test_eleven_faults_are_each_named_and_are_in_no_number(faults: Path, tmp_path: Path) -> None:
    command = evaluation(faults, tmp_path / "table", faults / "ours")
    result = run(*command)
    assert result.exit_code == 1, result.output
    content = json.loads((tmp_path / "table" / "table.json").read_text("utf-8"))
    left_out = {Path(one["file"]).name: one["reason"] for one in content["errors"] + content["unpaired"]}
    assert REASONS.keys() == {name for name, reason in left_out.items() if reason not in NO_DANCE}
    for name, reason in REASONS.items():
        assert reason in left_out[name]
    page = (tmp_path / "table" / "index.html").read_text("utf-8")
    assert [name for name in REASONS if f"{name}: " not in page] == []
    said = "Measured: 2 of 13 dances of ours, 2 dances of recorded."
    assert said in page and said in (tmp_path / "table" / "table.tex").read_text("utf-8")
    assert said in " ".join(result.output.split()) and "2 of 13" in result.output
    assert ">2 of 13, 2, 1<" in page
    table = pd.read_csv(tmp_path / "table" / "table.csv").set_index("system").loc["ours"]
    assert (table["dances"], table["total"], table["seeds"]) == (2, 13, 1)
    assert pd.read_csv(tmp_path / "table" / "clips.csv").set_index("system").loc["ours", "error"].notna().sum() == 8
    # No fault reaches a mean: the sound dances are those of `recorded`.
    recorded = pd.read_csv(tmp_path / "table" / "table.csv").set_index("system").loc["recorded"]
    for measure in ("harmony", "pfc", "foot_skating", "jerk", "hands"):
        assert table[measure] == pytest.approx(recorded[measure])
    done(app, *command, "--resume", "--allow-missing")


def test_data_check_finds_them_too_and_ends_with_1(faults: Path, tmp_path: Path) -> None:
    result = run("data", "check", faults / "ours", "--json")
    assert result.exit_code == 1
    odd = {Path(row["path"]).name: " ".join(row["odd"]) for row in json.loads(result.stdout)}
    for name in [f"song{number}.npz" for number in range(2, 10)]:
        assert REASONS[name] in odd[name]
    done(app, "data", "check", faults / "ours" / "song0.npz")
    for name in ("song2.npz", "song5.npz"):
        assert run("data", "check", faults / "ours" / name).exit_code == 1


def test_what_is_odd_and_no_fault_is_a_remark_in_the_row(faults: Path, tmp_path: Path) -> None:
    motion = load_motion(faults / "ours" / "song0.npz")
    positions = motion.positions.copy()
    positions[100:160] = positions[100]
    save_motion(tmp_path / "song0.npz", replace(motion, positions=positions), offset=3.0)
    row = clip_row(Pair("x", "", "song0", tmp_path / "song0.npz", faults / "songs" / "song0.wav"), RowOptions())
    assert row["begins"] == "kept in the file"
    assert "frozen for 0.5 s and more" in row["odd"] and "ends after its song" in row["odd"]
    assert "frozen once, longest 0.98 s" in row["oddities"] and "ends 3.00 s after the audio" in row["oddities"]
    (summary,) = check(tmp_path / "song0.npz")
    assert set(summary.odd) <= set(row["oddities"].split("; "))
    # Floor work: x is no axis that files have up.
    save_motion(tmp_path / "lying.npz", replace(motion, positions=motion.positions[..., [1, 0, 2]]))
    assert not any(one.is_fault for one in check(tmp_path / "lying.npz")[0].odd)


def test_links_that_lead_nowhere_or_to_a_neighbour_are_no_seeds(faults: Path, tmp_path: Path) -> None:
    shutil.copytree(faults / "recorded", tmp_path / "seed1")
    (tmp_path / "seed2").symlink_to(tmp_path / "seed1")
    (tmp_path / "seed3").symlink_to(tmp_path / "gone")
    (tmp_path / "self").symlink_to(tmp_path / "self")
    (tmp_path / "elsewhere").symlink_to(faults / "recorded")
    paired = folder_pairs("x", tmp_path, [Song(f"song{n}", Path(f"song{n}.wav")) for n in (0, 1)])
    assert sorted({pair.seed for pair in paired.pairs}) == ["elsewhere", "seed1"]
    assert {one.file.name: one.reason for one in paired.unpaired} == {
        "seed2": "is a link to seed1, which is there too",
        "seed3": "is a link that leads nowhere",
        "self": "is a link that leads nowhere",
    }


def test_dances_that_lie_deeper_than_a_seed_are_missing_by_name(faults: Path, tmp_path: Path) -> None:
    shutil.copytree(faults / "recorded", tmp_path / "seed1")
    shutil.copytree(faults / "recorded", tmp_path / "run" / "seed2")
    paired = folder_pairs("x", tmp_path, [Song(f"song{n}", Path(f"song{n}.wav")) for n in (0, 1)])
    assert {pair.seed for pair in paired.pairs} == {"seed1"}
    assert [(one.file.name, one.reason, one.system) for one in paired.unpaired] == [("seed2", pairing.TOO_DEEP, "x")]


def test_a_folder_that_cannot_be_opened_is_a_missing_dance_by_name(faults: Path, tmp_path: Path) -> None:
    shutil.copytree(faults / "recorded", tmp_path / "seed1")
    for name in ("song1", "seed1/song2"):
        (tmp_path / name).mkdir()
    with patch("os.access", lambda path, mode: Path(path).suffix or Path(path).name == "seed1"):
        paired = folder_pairs("x", tmp_path, [Song(f"song{n}", Path(f"song{n}.wav")) for n in (0, 1)])
        assert pairing.songs_in(tmp_path)[-1] == Song("song1", tmp_path / "song1" / "audio.wav")  # its dances say why
    assert {pair.seed for pair in paired.pairs} == {"seed1"}
    closed = [(one.file.name, one.system) for one in paired.unpaired if one.reason == pairing.CLOSED]
    assert closed == [("song2", "x"), ("song1", "x")]


@pytest.mark.slow
def test_a_second_run_beside_one_that_is_alive_is_not_told_to_begin_anew(faults: Path, tmp_path: Path) -> None:
    some = EvaluationSettings({"ours": faults / "recorded"}, faults / "songs", faults / "recorded", resamples=100)
    evaluate_dances(some, tmp_path / "table")
    before = (tmp_path / "table" / "evaluation.json").read_bytes()
    with FileLock(tmp_path / "table" / "rows" / ".lock"):
        for force in (False, True):
            message = r"another process is at this run; wait until it ends, or stop it$"
            refused(message, evaluate_dances, replace(some, seed=2), tmp_path / "table", force=force)
    assert (tmp_path / "table" / "evaluation.json").read_bytes() == before


# A row for the leaderboard


@pytest.fixture(scope="module")
def sound(faults: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a table of two dances, which are sound."""
    out = tmp_path_factory.mktemp("sound") / "table"
    done(app, *evaluation(faults, out, "--system", f"ours={faults / 'recorded'}"))
    return out


def edited(path: Path, **changes: Any) -> None:
    content = json.loads(path.read_text("utf-8"))
    content["about"] |= changes
    path.write_text(json.dumps(content), "utf-8")


@pytest.mark.slow
def test_a_row_can_be_made_of_a_table_and_is_checked_from_its_own_files(sound: Path, tmp_path: Path) -> None:
    out = tmp_path / "row"
    first = done(app, "evaluate", "submit", sound, "--out", out)
    assert '"about" lacks title, by, data, licence, obtain' in first.output
    assert {path.name for path in out.iterdir()} == {"evidence.csv", "files.csv", "row.json"}
    assert run("evaluate", "submit", out).exit_code == 1
    edited(out / "row.json", **dict.fromkeys(("title", "by", "data", "licence", "obtain"), "text"))
    assert "nothing is missing" in done(app, "evaluate", "submit", out).output
    measured = json.loads((out / "row.json").read_text("utf-8"))["measured"]
    table = pd.read_csv(sound / "table.csv").set_index("system")
    assert measured["numbers"]["systems"]["ours"]["pfc"]["mean"] == pytest.approx(table.loc["ours", "pfc"], rel=1e-5)
    songs = [path for path in pd.read_csv(out / "files.csv")["file"] if path.endswith(".wav")]
    assert songs == ["song0.wav", "song1.wav"] and measured["versions"].keys() >= {"harmolab", "numpy", "scipy"}
    assert measured["command"].startswith("harmolab evaluate --system ours=recorded --music songs --reference recorded")
    assert str(sound.parent) not in "".join(path.read_text("utf-8") for path in out.iterdir())
    (out / ".DS_Store").touch()  # as a Mac leaves it where people have looked
    again = done(app, "evaluate", "submit", sound, "--out", out)  # what people wrote stays
    assert "nothing is missing" in again.output


def test_hidden_files_are_no_part_of_a_recording(tmp_path: Path) -> None:
    (tmp_path / "motion.npz").write_text("a dance")
    stamp, hashes = pairing.input_stamp(tmp_path), file_hashes([tmp_path])
    (tmp_path / ".DS_Store").touch()
    assert pairing.input_stamp(tmp_path) == stamp and file_hashes([tmp_path]).equals(hashes)
    (tmp_path / "beats.json").touch()
    assert pairing.input_stamp(tmp_path) != stamp


def test_a_dance_that_may_be_read_now_is_in_another_state_than_before(tmp_path: Path) -> None:
    (tmp_path / "motion.npz").write_text("a dance")
    with patch.object(pairing.os, "access", lambda path, mode: False):
        closed = pairing.input_stamp(tmp_path)
    assert pairing.input_stamp(tmp_path) != closed


@pytest.mark.slow
def test_what_does_not_follow_from_the_files_of_a_row_is_named(sound: Path, tmp_path: Path) -> None:
    out = tmp_path / "row"
    run("evaluate", "submit", sound, "--out", out)
    row, evidence = out / "row.json", out / "evidence.csv"
    edited(row, **dict.fromkeys(("title", "by", "data", "licence"), "text"), obtain="from /home/me/data")
    dances = pd.read_csv(evidence)
    dances.assign(harmony=dances["harmony"] + 0.1, song=["song0"] * len(dances)).to_csv(evidence, index=False)
    pd.read_csv(out / "files.csv").iloc[1:].to_csv(out / "files.csv", index=False)
    (out / "README.md").write_text("dances of ~/takes")  # people may add one
    result = run("evaluate", "submit", out)
    assert result.exit_code == 1
    faults = ["numbers do not follow", "digest of the data does not", "are not the songs of"]
    faults += ["row.json: names a place on a disk (/h", "README.md: names a place"]
    assert [fault for fault in faults if fault not in " ".join(result.output.split())] == []
    content = json.loads(row.read_text("utf-8"))
    content["measured"]["settings"]["resamples"] = 10**15
    row.write_text(json.dumps(content))
    assert "resamples must lie between 100 and 100000" in run("evaluate", "submit", out).output
    content["measured"]["settings"]["resamples"] = 100
    row.write_text(json.dumps(content))
    dances.drop(columns="song").to_csv(evidence, index=False)
    assert "row.json: " in run("evaluate", "submit", out).stderr
    evidence.unlink()
    assert "evidence.csv: no such file" in run("evaluate", "submit", out).stderr
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    mine = run("evaluate", "submit", sound, "--out", tmp_path / "mine")
    assert "thesis.tex, which is no part of a row" in mine.stderr


@cases(
    "about, fault",
    ({"rows": None}, "holds a run that is not finished; go on with it by --resume"),
    ({"reference": "synthetic"}, "was made beside saved recorded dances; a row needs their folder by --reference"),
    ({"reference": "synthetic"}, "since it names the hash of each file: measure anew, into another folder"),
)
def test_an_unfinished_table_and_one_without_recorded_dances_is_no_row(
    sound: Path, tmp_path: Path, about: dict[str, Any], fault: str
) -> None:
    folder = shutil.copytree(sound, tmp_path / "table")
    content = json.loads((folder / "evaluation.json").read_text("utf-8"))
    content |= {"settings": content["settings"] | about} if "reference" in about else about
    (folder / "evaluation.json").write_text(json.dumps(content))
    assert fault in " ".join(run("evaluate", "submit", folder, "--out", tmp_path / "row").stderr.split())


def test_a_row_is_of_the_files_that_were_measured(sound: Path, tmp_path: Path) -> None:
    song = Path(pd.read_csv(sound / "clips.csv")["music"][0])
    status = song.stat()
    os.utime(song, ns=(status.st_atime_ns, status.st_mtime_ns + 10**9))
    assert "has changed since it was measured" in run("evaluate", "submit", sound, "--out", tmp_path / "row").stderr
    song.rename(tmp_path / "song")
    assert f"{song}: no such file" in run("evaluate", "submit", sound, "--out", tmp_path / "row").stderr
    (tmp_path / "song").rename(song)
    os.utime(song, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert not (tmp_path / "row").exists()


def test_a_table_with_missing_dances_is_no_row(sound: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(sound, tmp_path / "table")
    table = pd.read_csv(folder / "table.csv")
    table.assign(total=table["total"] + (table["system"] == "ours")).to_csv(folder / "table.csv", index=False)
    result = run("evaluate", "submit", folder, "--out", tmp_path / "row")
    assert "1 dances could not be measured; a row is of whole sets" in result.stderr
    assert not (tmp_path / "row").exists()


# Names


@cases(
    "dance, songs, song",
    ("\u0915\u093e_take1", ["\u0915\u0940"], None),
    ("\u0e2a\u0e35_1", ["\u0e2a\u0e32", "\u0e2a\u0e39"], None),
    ("Cafe\u0301_2", ["Caf\u00e9", "Cafe"], "Caf\u00e9"),
    ids=["Hindi", "Thai", "an accent in two ways"],
)
def test_marks_are_parts_of_the_words_of_a_name(dance: str, songs: list[str], song: str | None):
    paired = song_of(Path(f"{dance}.npz"), [Song(name, Path(f"{name}.wav")) for name in songs])
    assert getattr(paired, "name", None) == song


def test_recorded_dances_may_have_a_frame_rate_of_their_own(field: Path):
    some = settings(field, "fact", fps={"fact": 60.0, "recorded": 30.0})
    assert {(pair.kind, pair.fps) for pair in evaluation_pairs(some).pairs} == {("generated", 60.0), ("recorded", 30.0)}
    seeded = settings(field, "fact", seed_frames={"recorded": 3})
    refused("--seed-frames recorded=3: no system", evaluation_pairs, seeded)
