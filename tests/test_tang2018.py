"""The layout of Tang et al. (2018): units, axes, splices, floor, clock, and lengths that do not fit."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import soundfile

from harmolab.body.skeletons import Skeleton
from harmolab.data import recordings
from harmolab.data.recordings import PAPER_21, TANG_23, load_recording, load_skeletons, splice_steps
from tests.builders import cases, missing, refused

FRAMES = 60


def swaying() -> np.ndarray:
    """(T, 23, 3) centimetres: every joint on its own circle, never straight, lowest point 3 cm over y = 0."""
    time, joint = np.arange(FRAMES)[:, None], np.arange(23)[None, :]
    angle = 0.2 * time + joint
    return np.stack([10 * np.cos(angle), 8 + 5 * joint + 5 * np.sin(angle), 10 * np.sin(2 * angle)], axis=2)


def spliced(first: int = 20, last: int = 26, rise: float = 30.0) -> np.ndarray:
    """Swaying, with a straight line from frame `first` to frame `last`, and `rise` cm higher after it."""
    poses = swaying()
    poses[last:, :, 1] += rise
    share = np.linspace(0, 1, last - first + 1)[:, None, None]
    poses[first : last + 1] = poses[first] + share * (poses[last] - poses[first])
    return poses


def write_recording(
    folder: Path, poses: np.ndarray, *, centre: np.ndarray | None = None, start: int = 25, span: int | None = None
) -> Path:
    """A folder in the layout of the corpus."""
    folder.mkdir(parents=True, exist_ok=True)
    centre = np.zeros((len(poses), 3)) if centre is None else centre
    content = {"length": len(poses), "center": centre.tolist(), "skeletons": poses.tolist()}
    (folder / "skeletons.json").write_text(json.dumps(content))
    end = start + (len(poses) if span is None else span)
    (folder / "config.json").write_text(json.dumps({"start_position": start, "end_position": end}))
    soundfile.write(folder / "audio.wav", np.zeros(8000 * 5), 8000)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording of a swaying dancer."""
    return write_recording(tmp_path / "somewhere" / "DANCE_W_1", swaying())


def test_motion_is_skeleton_plus_centre_in_metres_with_z_turned_round(tmp_path: Path):
    folder = write_recording(tmp_path / "DANCE_W_1", swaying(), centre=np.tile([100.0, 90.0, 50.0], (FRAMES, 1)))
    motion = load_skeletons(folder / "skeletons.json", ground=False)
    np.testing.assert_allclose(motion.positions, (swaying() + np.array([100, 90, 50])) * [0.01, 0.01, -0.01])
    assert (motion.fps, motion.skeleton) == (25, TANG_23)


def test_without_travel_only_the_pose_is_left(tmp_path: Path):
    folder = write_recording(tmp_path / "DANCE_W_1", swaying(), centre=np.cumsum(np.ones((FRAMES, 3)), axis=0))
    motion = load_skeletons(folder / "skeletons.json", travel=False)
    np.testing.assert_allclose(motion.positions, swaying() * [0.01, 0.01, -0.01])


def test_clip_starts_at_start_position_over_25_and_knows_its_dance(folder: Path):
    clip = load_recording(folder).clip
    assert (clip.name, clip.offset, clip.dance, clip.source) == ("DANCE_W_1", 1.0, "waltz", "somewhere")
    assert clip.audio.duration == 5.0


def test_dance_is_read_from_the_folder_name():
    names = {"DANCE_C_2": "cha-cha", "DANCE_R_10": "rumba", "DANCE_T_5": "tango", "DANCE_W_1": "waltz", "DANCE_X_1": ""}
    assert {name: recordings.dance_of(Path("a") / name) for name in names} == names


def test_clock_stretches_the_motion_without_touching_a_frame(folder: Path):
    plain, stretched = (load_recording(folder, clock=clock).clip.motion for clock in (1.0, 1.013))
    np.testing.assert_array_equal(stretched.positions, plain.positions)
    assert stretched.duration == pytest.approx(1.013 * plain.duration)


def test_the_papers_21_joints_are_the_first_21_and_still_a_tree(folder: Path):
    motion = load_recording(folder, points=21).clip.motion
    np.testing.assert_array_equal(motion.positions, load_recording(folder).clip.motion.positions[:, :21])
    assert motion.skeleton == PAPER_21
    assert PAPER_21.joints[PAPER_21.parents[PAPER_21.joints.index("right_wrist")]] == "right_elbow"


@pytest.mark.parametrize("skeleton", [TANG_23, PAPER_21])
def test_skeleton_hangs_on_the_torso_with_limbs_on_their_own_side(skeleton: Skeleton):
    assert [joint for joint, parent in zip(skeleton.joints, skeleton.parents, strict=True) if parent < 0] == ["torso"]
    for parent, child in skeleton.bones:
        assert not {"left", "right"} <= {skeleton.joints[joint].split("_")[0] for joint in (parent, child)}


def test_frames_that_a_splice_leads_to_are_not_valid(tmp_path: Path):
    motion = load_skeletons(write_recording(tmp_path / "DANCE_W_1", spliced(20, 26)) / "skeletons.json")
    np.testing.assert_array_equal(np.flatnonzero(~motion.valid), [21, 22, 23, 24, 25, 26])


def test_lines_between_units_count_as_movement_where_that_is_asked_for(tmp_path: Path):
    folder = write_recording(tmp_path / "DANCE_W_1", spliced(20, 26))
    motion = load_skeletons(folder / "skeletons.json", splices=True)
    assert motion.valid.all()
    np.testing.assert_array_equal(motion.positions, load_skeletons(folder / "skeletons.json").positions)


def test_dance_without_splices_and_a_dancer_who_stands_still_are_all_valid():
    assert splice_steps(swaying() / 100) == ([], [])
    still = swaying()
    still[20:26] = still[20]
    assert splice_steps(still / 100) == ([], [])


def test_splice_is_found_between_its_two_real_frames_also_where_they_are_rounded():
    for poses in (spliced(20, 26), np.round(spliced(20, 26), 3)):
        assert splice_steps(poses / 100) == ([20], [26])


def test_every_unit_is_set_on_the_floor_and_keeps_its_own_movement():
    raw = spliced(20, 26, rise=30.0) / 100
    grounded = recordings.on_the_floor(raw, [20], [26])
    for own in (slice(21), slice(26, None)):
        assert np.median(grounded[own, :, 1].min(axis=1)) == pytest.approx(0)
        np.testing.assert_allclose(np.diff(grounded[own], axis=0), np.diff(raw[own], axis=0), atol=1e-12)


def test_motion_a_little_shorter_than_its_config_is_read(tmp_path: Path):
    assert load_recording(write_recording(tmp_path / "DANCE_W_1", swaying(), span=63)).clip.motion.n_frames == FRAMES


@pytest.mark.parametrize(("span", "rate"), [(30, "50.0"), (120, "12.5")])
def test_motion_of_another_frame_rate_is_refused(tmp_path: Path, span: int, rate: str):
    folder = write_recording(tmp_path / "DANCE_W_1", swaying(), span=span)
    refused(rf"skeletons\.json: has 60 frames, config.json spans {span} .*{rate} fps would fit", load_recording, folder)
    refused("leave out --fps", recordings.load_any_motion, folder, fps=float(rate))


@pytest.mark.parametrize("part", ["skeletons.json", "config.json", "audio.wav"])
def test_missing_part_is_named(folder: Path, part: str):
    (folder / part).unlink()
    missing(part, load_recording, folder)


@cases(
    "change, fault",
    ({"length": 59}, "says length 59, but holds 60 frames"),
    ({"center": [[0, 0, 0]]}, r"center must have shape \(60, 3\), got \(1, 3\)"),
    ({"skeletons": [[[0, 0, 0]]]}, r"skeletons must have shape \(any, 23, 3\), got \(1, 1, 3\)"),
    ({"skeletons": "none"}, "skeletons must be numbers"),
    ({"center": [[0, 0, 1e9]] * 60}, "positions over 1 km"),
    ({"center": [[0, 0, float("nan")]] * 60}, "center hold NaN or infinity at frame 0"),
)
def test_damaged_skeletons_are_refused_with_their_fault(folder: Path, change: dict[str, object], fault: str):
    path = folder / "skeletons.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    refused(rf"skeletons\.json: .*{fault}", load_skeletons, path)


def test_nan_in_a_skeleton_names_frame_and_joint(tmp_path: Path):
    poses = swaying()
    poses[7, 8, 1] = np.nan
    folder = write_recording(tmp_path / "DANCE_W_1", poses)
    refused(r"skeletons hold NaN or infinity at frame 7, joint 8 \(left_knee\)", load_recording, folder)


@cases(
    "content, fault",
    ('{"start_position": 5}', "whole numbers start_position and end_position"),
    ('{"start_position": 5.5, "end_position": 9}', "whole numbers"),
    ('{"start_position": 9, "end_position": 9}', "must end after it starts"),
    ('{"start_position": -9, "end_position": 9}', "must end after it starts"),
    ('{"start_position": 0, "end_position": 99999999}', "must end after it starts"),
    ("[]", "whole numbers"),
    ("", "the file is empty"),
)
def test_damaged_config_is_refused_with_its_fault(tmp_path: Path, content: str, fault: str):
    (tmp_path / "config.json").write_text(content)
    refused(rf"config\.json: .*{fault}", recordings.load_config, tmp_path / "config.json")


def test_motion_that_starts_behind_the_end_of_the_audio_is_refused(tmp_path: Path):
    folder = write_recording(tmp_path / "DANCE_W_1", swaying(), start=200)
    refused(r"DANCE_W_1: .*does not overlap audio of 5\.00 s", load_recording, folder)


@pytest.mark.parametrize(("option", "value"), [("points", 25), ("clock", 0.0), ("clock", 25.0)])
def test_option_out_of_range_is_refused_by_name(folder: Path, option: str, value: float):
    refused(option, load_recording, folder, **{option: value})


@pytest.mark.data
@cases("name, frames, offset, splices", ("DANCE_C_2", 1890, 6.24, 24), ("DANCE_W_16", 1320, 0.0, 19))
def test_recording_has_these_frames_and_splices(data_root: Path, name: str, frames: int, offset: float, splices: int):
    clip = load_recording(data_root / "tang2018" / name).clip
    assert (clip.motion.n_frames, clip.offset) == (frames, offset)
    assert np.count_nonzero(~clip.motion.valid) == 6 * splices


@pytest.mark.data
def test_recorded_floor_no_longer_climbs(data_root: Path):
    path = data_root / "tang2018" / "DANCE_W_31" / "skeletons.json"
    raw, grounded = (load_skeletons(path, ground=ground).positions[:, :, 1].min(axis=1) for ground in (False, True))
    assert np.ptp(raw) > 0.5
    assert np.ptp(grounded) < 0.1


@pytest.mark.data
def test_pose_speed_at_15_fps_agrees_with_the_reference(data_root: Path):
    named = os.environ.get("HARMOLAB_REFERENCE")
    file = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "reference" / "fixtures.json"
    if not file.is_file():
        pytest.skip(f"no reference numbers: set HARMOLAB_REFERENCE ({file} is not there)")
    for fixture in json.loads(file.read_text())["clips"]:
        path = data_root / "tang2018" / fixture["sequence"] / "skeletons.json"
        poses = load_skeletons(path, points=21, travel=False).positions
        times = np.arange(fixture["t0_frame_15fps"], fixture["t0_frame_15fps"] + 90) / 15 * 25
        before = times.astype(int)
        share = (times - before)[:, None, None]
        resampled = poses[before] * (1 - share) + poses[before + 1] * share
        speed = np.linalg.norm(np.diff(resampled, axis=0), axis=2).sum(axis=1) * 100
        # The reference read the skeletons before they were rounded to 3 decimals.
        np.testing.assert_allclose(speed, fixture["J_v"][1:], rtol=3e-4)
