"""Motion files: our .npz, arrays, BVH to and fro, AIST++ pickles, key points, landmarks."""

import json
import pickle
import re
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from harmolab.body.skeletons import Skeleton
from harmolab.readers.bvh import load_bvh, save_bvh
from harmolab.readers.keypoints import COCO_17, MEDIAPIPE_33, OPENPOSE_18, OPENPOSE_25, keypoints_motion
from harmolab.readers.motion import load_motion, load_offset, read_motion, save_motion
from harmolab.types import Motion
from tests.builders import ARM, bone_lengths, cases, missing, refused


def walk(frames: int = 10, joints: int = 3, dimensions: int = 3) -> np.ndarray:
    return np.random.default_rng(4).normal(size=(frames, joints, dimensions))


WALK = Motion(walk(), 25, ARM)


def save(path: Path, array: np.ndarray) -> Path:
    np.save(path, array)
    return path


# Our .npz


@pytest.mark.parametrize("dimensions", [2, 3])
def test_saved_motion_comes_back_bit_by_bit(tmp_path: Path, dimensions: int):
    valid = np.arange(10) % 3 > 0
    motion = Motion(walk(dimensions=dimensions), 29.97, ARM, valid)
    save_motion(tmp_path / "arm.npz", motion)
    back = load_motion(tmp_path / "arm.npz")
    np.testing.assert_array_equal(back.positions, motion.positions)
    assert (back.fps, back.skeleton, back.valid.tolist()) == (29.97, ARM, valid.tolist())


@pytest.mark.parametrize("offset", [12.4, None, 0.0])
def test_a_saved_motion_keeps_the_song_time_it_was_made_for(tmp_path: Path, offset: float | None):
    save_motion(tmp_path / "arm.npz", WALK, offset=offset)
    assert load_offset(tmp_path / "arm.npz") == offset
    assert load_motion(tmp_path / "arm.npz").n_frames == 10


@cases(
    "offset, fault",
    (np.nan, "offset must be a number of seconds, ten hours at most, got nan"),
    (-np.inf, "ten hours at most, got -inf"),
    (36_001, "ten hours at most, got 36001"),
    ([1.0, 2.0], r"offset must be one number, got shape \(2,\)"),
    ("soon", "array 'offset': holds values of type"),
)
def test_an_offset_that_is_no_song_time_is_refused_by_name(tmp_path: Path, offset: object, fault: str):
    np.savez(tmp_path / "bad.npz", positions=walk(), fps=25, offset=offset)
    for read in (load_offset, load_motion):
        refused(rf"bad\.npz: .*{fault}", read, tmp_path / "bad.npz")


@cases("name, written_by", ("arm.npz", "savez"), ("arm.bvh", "savetxt"))
def test_failed_save_leaves_only_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, written_by: str):
    path = tmp_path / name
    save_motion(path, WALK)
    before = path.read_bytes()
    monkeypatch.setattr(np, written_by, Mock(side_effect=OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        save_motion(path, Motion(walk() + 1, 25, ARM))
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_motion_is_saved_under_known_names_and_at_times_that_are_some_only(tmp_path: Path):
    refused(r"arm\.fbx: motion is saved as \.npz or \.bvh", save_motion, tmp_path / "arm.fbx", WALK)
    refused("offset must be a number of seconds", save_motion, tmp_path / "arm.npz", WALK, offset=np.nan)
    refused(r"arm\.npz: detected must be .*, got \(3,\)", save_motion, tmp_path / "arm.npz", WALK, detected=[True] * 3)
    assert list(tmp_path.iterdir()) == []


def test_npz_by_hand_with_positions_and_fps_is_enough(tmp_path: Path):
    np.savez(tmp_path / "hand.npz", positions=walk().astype(np.float32), fps=50)
    motion = load_motion(tmp_path / "hand.npz")
    assert (motion.fps, motion.skeleton.joints) == (50, ("joint_0", "joint_1", "joint_2"))
    assert motion.valid.all()
    assert load_motion(tmp_path / "hand.npz", fps=100).duration == 0.1


def test_nan_is_named_by_file_frame_and_joint(tmp_path: Path):
    positions = walk()
    positions[7, 1, 2] = np.nan
    np.savez(tmp_path / "gap.npz", positions=positions, fps=25, joints=list(ARM.joints), parents=list(ARM.parents))
    fault = r"gap\.npz: NaN or infinity at frame 7, joint 1 \(elbow\), 1 values in all"
    refused(fault, load_motion, tmp_path / "gap.npz")


@cases("count, value, scale", (23, np.nan, None), (23, np.nan, 0.01), (23, np.inf, None), (22, np.nan, None))
def test_nan_in_joints_without_names_is_named_by_frame_and_joint_and_no_unit(
    tmp_path: Path, count: int, value: float, scale: float | None
) -> None:
    joints = np.random.default_rng(0).normal(size=(20, count, 3))
    joints[7, 4] = value
    np.save(tmp_path / "dance.npy", joints)
    fault = r"dance\.npy: NaN or infinity at frame 7, joint 4 \(joint_4\), 3 values in all; interpolate"
    refused(fault, load_motion, tmp_path / "dance.npy", fps=30, scale=scale)


@cases(
    "arrays, fault",
    ({"fps": 25}, "has no array 'positions'"),
    ({"positions": walk()}, "has no array 'fps'"),
    ({"positions": walk(1), "fps": 25}, "at least two frames, got 1"),
    ({"positions": walk()[0], "fps": 25}, r"got shape \(3, 3\)"),
    ({"positions": walk(), "fps": 0}, "fps must lie between 1 and 1000, got 0"),
    ({"positions": walk(), "fps": 0.04}, "was this the time of one frame"),
    ({"positions": walk(), "fps": 25, "units": "cm"}, "'cm'; pass scale, the metres in one"),
    ({"positions": walk(), "fps": 25, "joints": ["a"], "parents": [-1]}, "3 joints, the skeleton 1"),
    ({"positions": walk(), "fps": 25, "valid": [True]}, "one entry per frame"),
)
def test_npz_that_is_not_as_documented_is_refused(tmp_path: Path, arrays: dict[str, object], fault: str):
    np.savez(tmp_path / "bad.npz", **arrays)
    refused(rf"bad\.npz: .*{fault}", load_motion, tmp_path / "bad.npz")


def test_npz_without_a_rate_has_the_one_that_is_passed(tmp_path: Path):
    np.savez(tmp_path / "walk.npz", positions=walk())
    assert load_motion(tmp_path / "walk.npz", fps=30).fps == 30


# .npy


def test_array_of_metres_needs_an_fps_and_perhaps_a_scale(tmp_path: Path):
    path = save(tmp_path / "walk.npy", walk())
    refused(r"walk\.npy: holds no frame rate; pass fps", load_motion, path)
    np.testing.assert_array_equal(load_motion(path, fps=30).positions, walk())
    np.testing.assert_allclose(load_motion(path, fps=30, scale=0.01).positions, walk() / 100)


@pytest.mark.parametrize("shape", [(10, 17, 2), (10, 34)])
def test_seventeen_points_get_the_names_of_coco(tmp_path: Path, shape: tuple[int, ...]):
    motion = load_motion(save(tmp_path / "points.npy", np.arange(340.0).reshape(shape)), fps=30)
    assert motion.skeleton == COCO_17
    np.testing.assert_array_equal(motion.positions[1, 2], [38.0, 39.0])


def test_aist_file_name_brings_its_60_fps(tmp_path: Path):
    assert load_motion(save(tmp_path / "gHO_sFM_cAll_d19_mHO1_ch02.npy", walk(10, 17, 2))).fps == 60


@cases(
    "skeleton, shape, size",
    (COCO_17, (10, 17, 3), [640, 480, 1]),
    (COCO_17, (10, 17, 3), [640, 480, 9]),  # a logit, as of RTMPose
    (COCO_17, (10, 17, 3), [1, 1, 1]),
    (COCO_17, (10, 133, 3), [640, 480, 1]),  # with feet, face and hands
    (Skeleton.unnamed(26), (10, 26, 3), [640, 480, 1]),
    (MEDIAPIPE_33, (10, 33, 4), [1, 1, 1, 1]),
)
def test_points_with_a_confidence_are_not_taken_for_metres(
    tmp_path: Path, skeleton: Skeleton, shape: tuple[int, ...], size: list[int]
):
    points = np.random.default_rng(1).uniform(0.6, 1, shape) * size
    file = read_motion(save(tmp_path / "points.npy", points), fps=30)
    assert file.motion.skeleton == skeleton
    np.testing.assert_allclose(file.motion.positions, points[:, : len(skeleton.joints), :2])
    briefs = [one.brief for one in file.assumptions]
    assert ("points of feet, face and hands left out" in briefs) == (shape[1] > len(skeleton.joints))


@pytest.mark.parametrize(("joints", "low", "high"), [(17, -0.5, 1.0), (17, 0.0, 1.8), (26, 25.0, 26.8), (26, 0.0, 1.0)])
def test_metres_are_not_taken_for_points_with_a_confidence(tmp_path: Path, joints: int, low: float, high: float):
    places = np.random.default_rng(1).uniform(low, high, (10, joints, 3)) * [1, 1, 1 / max(high, 1)]
    motion = load_motion(save(tmp_path / "body.npy", places), fps=30, scale=1.0, up="y")
    np.testing.assert_array_equal(motion.positions, places)


def test_array_file_in_fortran_order_and_other_byte_order_is_read(tmp_path: Path):
    path = save(tmp_path / "walk.npy", np.asfortranarray(walk().astype(">f4")))
    np.testing.assert_array_equal(load_motion(path, fps=30).positions, walk().astype(np.float32))


# BVH


def bvh(channels: str, rows: str, *, joint: str = "CHANNELS 3 Zrotation Yrotation Xrotation", frames: int = 2) -> str:
    return f"""HIERARCHY
ROOT hip
{{
  OFFSET 0 0 0
  CHANNELS {channels}
  JOINT knee
  {{
    OFFSET 1 0 0
    {joint}
    End Site
    {{
      OFFSET 0 2 0
    }}
  }}
}}
MOTION
Frames: {frames}
Frame Time: 0.05
{rows}
"""


SIX = "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"


def positions_of(tmp_path: Path, text: str) -> np.ndarray:
    (tmp_path / "walk.bvh").write_text(text)
    return load_bvh(tmp_path / "walk.bvh", scale=1.0).positions


@cases(
    "numbers, places",
    ("10 20 30 0 0 0 0 0 0", [[10, 20, 30], [11, 20, 30], [11, 22, 30]]),  # no rotation: the offsets are added
    ("0 0 0 90 0 0 0 0 0", [[0, 0, 0], [0, 1, 0], [-2, 1, 0]]),  # the root about z takes its children along
    ("0 0 0 0 0 0 0 0 90", [[0, 0, 0], [1, 0, 0], [1, 0, 2]]),  # a child about x moves only what hangs below it
)
def test_bvh_rotations_turn_what_hangs_below(tmp_path: Path, numbers: str, places: list[list[float]]):
    np.testing.assert_allclose(positions_of(tmp_path, bvh(SIX, f"{numbers}\n" * 2))[0], places, atol=1e-12)


def test_bvh_rotations_apply_in_the_order_of_the_channels(tmp_path: Path):
    # Knee at (1, 0, 0): Ry(90) takes x to -z, where Rz leaves it; Rz(90) takes x to y, where Ry leaves it.
    z_first = positions_of(tmp_path, bvh("3 Zrotation Yrotation Xrotation", "90 90 0 0 0 0\n" * 2))
    y_first = positions_of(tmp_path, bvh("3 Yrotation Zrotation Xrotation", "90 90 0 0 0 0\n" * 2))
    np.testing.assert_allclose(z_first[0, 1], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(y_first[0, 1], [0, 1, 0], atol=1e-12)


def test_bvh_positions_of_a_joint_take_the_place_of_its_offset(tmp_path: Path):
    text = bvh(SIX, "0 0 0 0 0 0 5 6 7\n" * 2, joint=POSITIONS)
    np.testing.assert_allclose(positions_of(tmp_path, text)[0, 1], [5, 6, 7])
    np.testing.assert_allclose(positions_of(tmp_path, text.replace("5 6 7", "0 0 0"))[0, 1], [1, 0, 0])


def test_bvh_names_joints_and_ends_and_gives_its_rate(tmp_path: Path):
    (tmp_path / "walk.bvh").write_text(GOOD)
    motion = load_motion(tmp_path / "walk.bvh")
    assert (motion.skeleton, motion.fps) == (Skeleton(("hip", "knee", "knee_end"), (-1, 0, 1)), pytest.approx(20))


def test_bvh_may_have_one_frame_more_than_it_promises_as_rokoko_writes_it(tmp_path: Path):
    places = positions_of(tmp_path, bvh(SIX, "0 0 0 0 0 0 0 0 0\n" * 4 + "7 0 0 0 0 0 0 0 0\n", frames=4))
    assert places[:, 0, 0].tolist() == [0, 0, 0, 0, 7]


@cases("step, rate", ("0.033", 30), ("0.0330000", 30), (".0167", 60), ("0.00833", 120), ("0.0417", 24), ("0.03333", 30),
    ("0.008333", 120), ("0.0334", 29.97), ("0.01668", 59.94))  # fmt: skip
def test_rounded_frame_time_of_a_bvh_is_that_of_the_usual_rate_and_said_so(tmp_path: Path, step: str, rate: float):
    (tmp_path / "walk.bvh").write_text(GOOD.replace("0.05", step))
    file = read_motion(tmp_path / "walk.bvh")
    assert (file.motion.fps, file.assumptions[1].brief) == (rate, "frame rate guessed: it is rounded")
    assert load_motion(tmp_path / "walk.bvh", fps=25).fps == 25


@pytest.mark.parametrize("step", ["0.04", "0.008", "0.016", ".0083333", "0.016667", "0.0333667"])
def test_frame_time_of_a_bvh_that_tells_its_rate_is_left_as_it_is(tmp_path: Path, step: str):
    (tmp_path / "walk.bvh").write_text(GOOD.replace("0.05", step))
    assert load_motion(tmp_path / "walk.bvh").fps == 1 / float(step)


@pytest.mark.parametrize(("leg", "factor"), [("0.9", 1.0), ("90", 0.01), ("1700", 0.001)])
def test_bvh_over_3_units_tall_is_in_centimetres_and_over_1000_in_millimetres(tmp_path: Path, leg: str, factor: float):
    (tmp_path / "walk.bvh").write_text(GOOD.replace("OFFSET 0 2 0", f"OFFSET 0 -{leg} 0"))
    assert load_bvh(tmp_path / "walk.bvh").positions[0, 2, 1] == pytest.approx(-float(leg) * factor)
    assert load_bvh(tmp_path / "walk.bvh", scale=0.5).positions[0, 2, 1] == pytest.approx(-float(leg) * 0.5)


@cases("leg, factor", (0.9, 1.0), (24, 0.056444), (58, 0.01), (90, 0.01), (1700, 0.001))
def test_bvh_of_a_body_that_is_too_small_in_centimetres_is_in_units_of_cmu(tmp_path: Path, leg, factor):
    text = GOOD.replace("ROOT hip", "ROOT Head").replace("JOINT knee", "JOINT Foot")
    (tmp_path / "walk.bvh").write_text(text.replace("OFFSET 0 2 0", f"OFFSET 0 -{leg} 0"))
    assert load_bvh(tmp_path / "walk.bvh").positions[0, 2, 1] == pytest.approx(-leg * factor)
    assert f"the body extends over {max(leg, 1):g} units at" in read_motion(tmp_path / "walk.bvh").notes[0]


def test_head_of_a_bvh_may_be_the_end_of_its_neck(tmp_path: Path):
    neck = "JOINT Neck1 { OFFSET 0 0 0.5 CHANNELS 0 End Site { OFFSET 0 0 0.2 } }"
    (tmp_path / "walk.bvh").write_text(
        f"HIERARCHY\nROOT Hips {{ OFFSET 0 0 0 CHANNELS 1 Zposition {neck} JOINT LeftFoot {{ OFFSET 0 0 -0.9 }} }}\n"
        "MOTION\nFrames: 2\nFrame Time: 0.04\n0\n0\n"
    )
    assert load_motion(tmp_path / "walk.bvh").positions[0, :, 1] == pytest.approx([0, 0.5, 0.7, -0.9])


POSITIONS = "CHANNELS 3 Xposition Yposition Zposition"


@cases(
    "root, knees, is_rig",
    (["0 0 0 0 0 0"] * 2, ["0 0.9 0", "2 0.9 0"], True),
    (["0 0 0 0 0 0", "0 0.1 0 0 0 0"], ["0 0.9 0", "2 0.9 0"], False),  # a root that moves
    (["0 0 0 0 0 0"] * 2, ["0 0.9 0", "0.9 0 0"], False),  # a bone that turns
)
def test_still_root_of_a_rig_is_no_part_of_the_body_that_travels(tmp_path: Path, root, knees, is_rig: bool):
    rows = "".join(f"{one} {other}\n" for one, other in zip(root, knees, strict=True))
    (tmp_path / "walk.bvh").write_text(bvh(SIX, rows, joint=POSITIONS))
    file = read_motion(tmp_path / "walk.bvh")
    whole = Skeleton(("hip", "knee", "knee_end"), (-1, 0, 1))
    assert file.motion.skeleton == (Skeleton(("knee", "knee_end"), (-1, 0)) if is_rig else whole)
    assert ("root of a rig left out" in [one.brief for one in file.assumptions]) == is_rig
    np.testing.assert_allclose(file.motion.positions[1, -2], np.array(knees[1].split(), float), atol=0.11)


@cases("place, is_rig", ("0 0 0", True), ("0 0 3", False))  # Unreal's bones for inverse kinematics; a stool
def test_what_stands_at_the_still_root_of_a_rig_is_left_out_with_all_that_hangs_on_it(tmp_path: Path, place, is_rig):
    ik = f"JOINT ik_foot_root {{ OFFSET {place} CHANNELS 0 JOINT ik_foot_l {{ OFFSET 0 0 0 {POSITIONS} }} }}"
    text = bvh(SIX, "0 0 0 0 0 0  0 0.9 0  0 0 1\n0 0 0 0 0 0  2 0.9 0  5 0 1\n", joint=POSITIONS)
    (tmp_path / "walk.bvh").write_text(text.replace("}\nMOTION", f"{ik} }}\nMOTION"))
    file = read_motion(tmp_path / "walk.bvh")
    body, rig = ("knee", "knee_end"), ("ik_foot_root", "ik_foot_l")
    assert file.motion.skeleton.joints == (body if is_rig else ("hip", *body, *rig))
    assert (f"without hip, {', '.join(rig)}: hip stays where it is while knee travels" in file.notes) == is_rig


GOOD = bvh(SIX, "0 0 0 0 0 0 0 0 0\n" * 2)


@cases(
    "text, fault",
    ("not a skeleton", "needs a HIERARCHY and a MOTION"),
    (GOOD.replace("MOTION", ""), "needs a HIERARCHY and a MOTION"),
    (GOOD.replace("0.05", "0"), "Frame Time must be positive"),
    (GOOD.replace("0.05", "1e-9"), r"fps must lie between 1 and 1000, got 1e\+09"),
    (GOOD.replace("0.05", "25"), "was this the time of one frame"),
    (GOOD.replace("Frames: 2", "Frames: 3"), "promises 3 frames of 9 numbers, but 18"),
    (GOOD.replace("Frames: 2", "Frames: 1e300"), "promises"),
    (GOOD.replace("Frames: 2", "Frames: 0"), "promises 0 frames of 9 numbers, but 18"),
    (GOOD[:-10], "numbers follow: cut off"),
    (bvh(SIX, "0 0 0 0 0 0 0 0 0", frames=1), "at least two frames, got 1"),
    (bvh("0", "", joint="CHANNELS 0"), "no joint has a channel"),
    (bvh(SIX, "0 0 0 0 0 0 0 0 x\n" * 2), "something else than numbers"),
    (bvh(SIX, "0 0 0 0 0 0 0 0 nan\n" * 2), r"NaN or infinity at frame 0, joint 2 \(knee_end\)"),
    (GOOD.replace("ROOT hip", "ROOT a { OFFSET 0 0 0 CHANNELS 0 }\nROOT hip"), r"second skeleton \('hip'\)"),
    (GOOD.replace("ROOT hip", "ROOT " + 100 * "hip"), "a name of 300 letters"),
    (GOOD.replace("Xposition", "Wposition"), "has channels"),
    (GOOD.replace("Xposition", "Yposition"), "once each"),
    (GOOD.replace("CHANNELS 6", "CHANNELS 7"), "7 channels"),
    (GOOD.replace("OFFSET 1 0 0", "OFFSET 1 0 inf"), "OFFSET of knee must be finite"),
    (GOOD.replace("OFFSET 1 0 0", "OFFSET 1 0"), "must be a number, got 'CHANNELS'"),
    (GOOD.replace("}\nMOTION", "MOTION"), "the hierarchy is cut off"),
)
def test_damaged_bvh_is_refused_with_its_fault(tmp_path: Path, text: str, fault: str):
    (tmp_path / "bad.bvh").write_text(text)
    refused(rf"bad\.bvh: .*{fault}", load_bvh, tmp_path / "bad.bvh")


# AIST++


def test_aist_pickle_takes_the_optimised_points_in_metres_at_60_fps(tmp_path: Path):
    points = walk(6, 17)
    (tmp_path / "dance.pkl").write_bytes(pickle.dumps({"keypoints3d": points * np.nan, "keypoints3d_optim": points}))
    motion = load_motion(tmp_path / "dance.pkl")
    np.testing.assert_allclose(motion.positions, points / 100)
    assert (motion.fps, motion.skeleton) == (60, COCO_17)


def test_aist_pickle_with_gaps_names_frame_and_joint(tmp_path: Path):
    points = walk(6, 17)
    points[3, 9] = np.nan
    (tmp_path / "dance.pkl").write_bytes(pickle.dumps({"keypoints3d": points}))
    refused(r"dance\.pkl: NaN or infinity at frame 3, joint 9 \(left_wrist\)", load_motion, tmp_path / "dance.pkl")


# Key points


def confident(frames: int = 5, joints: int = 17) -> np.ndarray:
    """Points that move to the right by one a frame, joint j at height 10 j, all seen."""
    x, y = np.meshgrid(np.arange(frames), 10.0 * np.arange(joints), indexing="ij")
    return np.stack([x, y, np.full(x.shape, 0.9)], axis=2)


@cases(
    "joint, hidden, places",
    (9, slice(1, 3), [0, 1, 2, 3, 4]),
    (8, slice(3, None), [0, 1, 2, 50 / 17, 66 / 17]),  # as the middle, in which it is itself where it was last
)
def test_unseen_joint_is_filled_by_a_straight_line_or_goes_along_with_the_body(
    tmp_path: Path, joint: int, hidden: slice, places: list[float]
):
    points = confident()
    points[hidden, joint] = 0.0
    motion = load_motion(save(tmp_path / "points.npy", points), fps=30)
    np.testing.assert_allclose(motion.positions[:, joint], [(x, 10 * joint) for x in places])
    assert motion.valid.all()


def test_frames_in_which_two_fifths_of_the_joints_are_hidden_are_not_valid(tmp_path: Path):
    points = confident()
    points[1, :6] = points[2, :7] = points[3, 10:] = 0.0
    motion = load_motion(save(tmp_path / "points.npy", points), fps=30)
    np.testing.assert_array_equal(motion.valid, [True, True, False, False, True])


def test_joint_that_is_never_seen_is_an_error_unless_left_out(tmp_path: Path):
    points = confident()
    points[:, 3] = 0.0
    path = save(tmp_path / "points.npy", points)
    refused(r"points\.npy: never shows left_ear; keep the other joints only", load_motion, path, fps=30)
    refused(
        r"\(--joints nose,left_eye,right_eye,right_ear,left_shoulder,\S+,right_ankle; in Py", load_motion, path, fps=30
    )
    refused(r"never shows left_ear$", load_motion, path, fps=30, joints=["left_ear"])
    motion = load_motion(path, fps=30, joints=["left_shoulder", "left_wrist"])
    assert motion.skeleton == Skeleton(("left_shoulder", "left_wrist"), (-1, 0))
    np.testing.assert_allclose(motion.positions[0, :, 1], [50, 90])
    assert motion.valid.all()


@pytest.mark.parametrize("skeleton", [COCO_17, OPENPOSE_18, OPENPOSE_25, MEDIAPIPE_33])
def test_skeleton_is_one_tree_with_limbs_on_their_own_side(skeleton: Skeleton):
    assert skeleton.parents.count(-1) == 1
    assert len(set(skeleton.joints)) == len(skeleton.joints) in (17, 18, 25, 33)
    for parent, child in skeleton.bones:
        assert not {"left", "right"} <= {skeleton.joints[joint].split("_")[0] for joint in (parent, child)}


def write_frames(folder: Path, frames: list[list[np.ndarray]]) -> Path:
    folder.mkdir()
    for number, people in enumerate(frames):
        content = {"people": [{"pose_keypoints_2d": person.ravel().tolist()} for person in people]}
        (folder / f"dance_{number:012d}_keypoints.json").write_text(json.dumps(content))
    return folder


def person(x: float, sure: float = 0.9) -> np.ndarray:
    points = confident(1, 25)[0]
    points[:, 0], points[:, 2] = x, sure
    return points


def test_openpose_folder_is_read_in_the_order_of_its_numbers(tmp_path: Path):
    motion = load_motion(write_frames(tmp_path / "frames", [[person(x)] for x in range(12)]), fps=30)
    np.testing.assert_allclose(motion.positions[:, 0, 0], np.arange(12))
    assert motion.skeleton == OPENPOSE_25


@cases(
    "frames, places",
    ([[person(0)], [person(100, 0.95), person(1)], [person(2), person(90, 0.95)]], [0, 1, 2]),  # a surer passer-by
    ([[person(0)], [person(0, 0.1), person(5)], [person(10)]], [0, 5, 10]),  # a doubtful figure, although it is near
)
def test_openpose_follows_the_same_dancer(tmp_path: Path, frames: list[list[np.ndarray]], places: list[float]):
    motion = load_motion(write_frames(tmp_path / "frames", frames), fps=30)
    np.testing.assert_allclose(motion.positions[:, 0, 0], places)


def test_openpose_frame_without_people_is_filled_and_marked(tmp_path: Path):
    motion = load_motion(write_frames(tmp_path / "frames", [[person(0)], [], [person(4)]]), fps=30)
    np.testing.assert_allclose(motion.positions[:, 0, 0], [0, 2, 4])
    np.testing.assert_array_equal(motion.valid, [True, False, True])


def test_openpose_frames_of_18_and_of_25_points_are_not_mixed(tmp_path: Path):
    folder = write_frames(tmp_path / "frames", [[person(0)], [person(1)[:18]]])
    refused("frames: mixes poses of different numbers of joints", load_motion, folder, fps=30)


def test_openpose_frame_number_that_is_missing_or_there_twice_is_an_error(tmp_path: Path):
    folder = write_frames(tmp_path / "frames", [[person(x)] for x in range(4)])
    (folder / "other_1_keypoints.json").write_text("{}")
    twice = r"frames: has two files for frame 1: dance_0+1_keypoints\.json and other_1_"
    refused(twice, load_motion, folder, fps=30)
    (folder / "other_1_keypoints.json").unlink()
    (folder / "dance_000000000002_keypoints.json").unlink()
    refused("frames: frame 2 is missing between 0 and 3; add it, or number the files", load_motion, folder, fps=30)


@cases(
    "content, fault",
    ("{", "cannot be read as an OpenPose frame"),
    ("[]", "has no list 'people', as OpenPose writes; of others save x, y, confidence"),
    ('{"people": [{"pose_keypoints_2d": [1, 2, 3]}]}', "3 values; OpenPose has 18 or 25 points"),
    ("[" * 100_000, "cannot be read as an OpenPose frame"),
    (json.dumps({"people": [{"pose_keypoints_2d": [float("nan")] * 75}]}), "NaN or infinity at joint 0"),
)
def test_damaged_openpose_frame_is_named(tmp_path: Path, content: str, fault: str):
    folder = write_frames(tmp_path / "frames", [[person(0)], [person(1)]])
    (folder / "dance_000000000001_keypoints.json").write_text(content)
    refused(rf"dance_000000000001_keypoints\.json: .*{fault}", load_motion, folder, fps=30)


# What is no motion at all


def test_unknown_missing_and_empty_files_are_told_apart(tmp_path: Path):
    (tmp_path / "dance.xyz").write_text("x")
    (tmp_path / "empty.npz").touch()
    refused(r"dance\.xyz: is no motion file that is known \(\.xyz\)", load_motion, tmp_path / "dance.xyz")
    (tmp_path / "dance.csv").write_text("frame,x_0,y_0\n")
    refused(r"\.csv\); .*export BVH.* of points .*MediaPipe's .*\(T, 33, 4\)", load_motion, tmp_path / "dance.csv")
    refused(r"empty\.npz: the file is empty", load_motion, tmp_path / "empty.npz")
    missing(r"none\.bvh: no such file", load_motion, tmp_path / "none.bvh")
    refused(r"holds no motion: neither motion\.npz nor skeletons\.json, nor", load_motion, tmp_path)


@cases(
    "name, arrays",
    ("points.npz", {"positions": np.zeros((2, 10_001, 3)), "fps": 25.0}),
    ("bones.npz", {"positions": np.zeros((2, 3, 3)), "fps": 25.0, "parents": np.arange(10_001) - 1}),
    ("points.npy", np.zeros((2, 10_001, 3))),
    ("picture.npy", np.zeros((2, 10_001, 2))),
)
def test_more_joints_than_any_body_has_are_refused(tmp_path: Path, name: str, arrays: Any):
    if name.endswith("npz"):
        np.savez(tmp_path / name, **arrays)
    else:
        np.save(tmp_path / name, arrays)
    refused(f"{name}: has 10001 joints, more than the 10000 allowed", load_motion, tmp_path / name, fps=25.0)


# JSON: what it holds decides


def coco_pose(x: float, sure: float = 0.9) -> list[float]:
    return [number for joint in range(17) for number in (x, 10.0 * joint, sure)]


def results(xs: list[float], **more: object) -> list[dict[str, object]]:
    return [{"image_id": 40 + place, "keypoints": coco_pose(x), **more} for place, x in enumerate(xs)]


def mmpose(xs: list[float]) -> list[dict[str, object]]:
    points = [{"keypoints": [[x, 10.0 * joint] for joint in range(17)], "keypoint_scores": [0.9] * 17} for x in xs]
    return [{"frame_id": place, "instances": [one]} for place, one in enumerate(points)]


def landmarks(x: float, visibility: float = 0.9) -> list[dict[str, float]]:
    return [{"x": x, "y": 0.1 * joint, "z": -0.5, "visibility": visibility} for joint in range(33)]


def as_json(path: Path, content: object) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return path


@cases(
    "content",
    results([0, 1, 2]),
    results([0, 1, 2], score=0.8, category_id=1),
    list(reversed(results([0, 1, 2]))),
    {"images": [], "annotations": results([0, 1, 2])},
    [{**entry, "image_id": f"clip2_{entry['image_id']:06d}.jpg"} for entry in results([0, 1, 2])],
    [{**entry, "keypoints": [*coco_pose(x), *[9.0] * 27]} for x, entry in enumerate(results([0, 1, 2]))],
    mmpose([0, 1, 2]),
    {"meta_info": {}, "instance_info": mmpose([0, 1, 2])},
    "\n".join(json.dumps({"frame": n, "predictions": [{"keypoints": coco_pose(n)}]}) for n in range(3)) + "\n",
    ids=["results", "with scores", "unsorted", "annotations", "named", "halpe", "mmpose list", "mmpose", "openpifpaf"],
)
def test_coco_key_points_of_every_layout_are_read(tmp_path: Path, content: object):
    motion = load_motion(as_json(tmp_path / "dance.json", content), fps=30)
    np.testing.assert_allclose(motion.positions[:, 4], [[0, 40], [1, 40], [2, 40]])
    assert motion.skeleton == COCO_17
    assert motion.valid.all()


@pytest.mark.parametrize(("first", "lead"), [(0, 0), (1, 0), (7, 7), (20, 20), (21, 0), (5000, 0)])
def test_frames_before_the_dancer_comes_are_there_unless_of_a_longer_video(tmp_path: Path, first: int, lead: int):
    entries = [{"image_id": f"{first + place}.jpg", "keypoints": coco_pose(place)} for place in range(20)]
    motion = load_motion(as_json(tmp_path / "alphapose-results.json", entries), fps=30)
    np.testing.assert_array_equal(motion.positions[:, 4, 0], [0.0] * lead + list(range(20)))
    np.testing.assert_array_equal(motion.valid, np.arange(lead + 20) >= lead)


def test_frames_of_openpose_in_one_list_are_read_in_their_order(tmp_path: Path):
    frames = [{"people": [{"pose_keypoints_2d": person(x).ravel().tolist()}]} for x in (3, 1, 2)]
    motion = load_motion(as_json(tmp_path / "dance.json", frames), fps=30)
    np.testing.assert_allclose(motion.positions[:, 0, 0], [3, 1, 2])
    assert motion.skeleton == OPENPOSE_25


def test_coco_frames_that_are_not_named_show_nobody(tmp_path: Path):
    motion = load_motion(as_json(tmp_path / "dance.json", results([0, 9, 2])[::2]), fps=30)
    np.testing.assert_allclose(motion.positions[:, 0, 0], [0, 1, 2])
    assert motion.valid.tolist() == [True, False, True]


def test_json_of_landmarks_is_known_by_its_content(tmp_path: Path):
    frames = [landmarks(x) for x in (0.1, 0.2)]
    motion = load_motion(as_json(tmp_path / "dance.json", {"fps": 25.0, "aspect": 2.0, "frames": [None, *frames]}))
    assert (motion.skeleton, motion.fps) == (MEDIAPIPE_33, 25)
    np.testing.assert_allclose(motion.positions[:, 0, 0], [0.2, 0.2, 0.4])
    world = load_motion(as_json(tmp_path / "world.json", {"fps": 25.0, "world": True, "frames": frames}))
    assert world.positions.shape == (2, 33, 3)


def test_shares_of_a_picture_whose_shape_no_file_tells_are_said_to_be_of_a_square_one(tmp_path: Path):
    film, pixels = {"fps": 25.0, "frames": [landmarks(0.1), landmarks(0.2)]}, confident()
    for content, briefs in ((film, ["picture assumed square"]), ({**film, "aspect": 1.0}, [])):
        file = read_motion(as_json(tmp_path / "dance.json", content))
        assert [one.brief for one in file.assumptions] == briefs
    for points, briefs in ((pixels, []), (pixels / [200, 200, 1], ["picture assumed square"])):
        file = read_motion(save(tmp_path / "dance.npy", points), fps=25)
        assert [one.brief for one in file.assumptions] == briefs


def test_joints_are_kept_by_name_in_any_format(tmp_path: Path):
    unseen = [{**entry, "keypoints": coco_pose(1)[:-3] + [0.0] * 3} for entry in results([0, 1, 2])]
    path = as_json(tmp_path / "dance.json", unseen)
    refused(r"dance\.json: never shows right_ankle", load_motion, path, fps=30)
    assert load_motion(path, fps=30, joints=["nose", "left_hip"]).skeleton.joints == ("nose", "left_hip")
    save_motion(tmp_path / "arm.npz", Motion(walk(), 30, ARM))
    np.testing.assert_array_equal(load_motion(tmp_path / "arm.npz", joints=["hand"]).positions[:, 0], walk()[:, 2])
    refused(r"arm\.npz: no joints named \['tail'\]", load_motion, tmp_path / "arm.npz", joints=["tail"])


@cases(
    "content, fault",
    ("", "the file is empty"),
    ("{", "cannot be read as"),
    ("[" * 100_000, "cannot be read as"),
    ('{"a": 1}\nnonsense', "cannot be read as"),
    ("[]", "holds a list of 0, which is neither MediaPipe landmarks .* nor COCO-17.*; of others save x, y, confidence"),
    ("3", "holds '3', which is neither"),
    ({}, "holds an object with nothing in it, which is neither"),
    ([[1, 2], [3, 4]], r"holds a list of 2, first '\[1, 2\]', which is neither"),
    ({"bones": [], "units": "cm"}, "an object with 'bones', 'units', which is neither"),
    ({"people": [], "version": 1.3}, "is one frame of OpenPose; name the folder"),
    ([{"image_id": 1, "keypoints": [1, 2, 3]}], "keypoints of entry 0: 3 values; COCO-17 has 17 points"),
    ([{"image_id": 1, "keypoints": ["x"] * 51}], "keypoints of entry 0 must be numbers"),
    ([{"image_id": 1, "keypoints": [float("nan")] * 51}], "keypoints of entry 0: NaN or infinity"),
    ([{"image_id": "front", "keypoints": coco_pose(1)}], "entry 0 names its frame 'front', which holds no number"),
    ([{"image_id": -1, "keypoints": coco_pose(1)}], "entry 0 names its frame '-1'"),
    ([{"image_id": True, "keypoints": coco_pose(1)}], "entry 0 names its frame 'True'"),
    ([*results([1]), 7], "entry 1 has no image_id and keypoints"),
    ([*results([1]), {"image_id": 10**12, "keypoints": coco_pose(1)}], "these are no frames of one video"),
    ([{"frame": 1, "predictions": 5}], "entry 0 has no list 'predictions'"),
    ([{"frame": 1, "predictions": []}], "nobody is seen in any of its 1 frames"),
    (results([1]), "at least two frames"),
    ([[]] * 432_001, "has 432001 frames, more than the 432000 allowed"),
    ([{**results([1])[0], "keypoints": coco_pose(1, 0.0)}] * 2, "nobody is seen"),
    ({"frames": 3}, "holds an object with 'frames', which is neither MediaPipe landmarks"),
    ('{"fps": 30}', "holds an object with 'fps', which is neither MediaPipe landmarks"),
    ({"frames": [landmarks(0.1)], "world": "yes"}, "world must be true or false, got 'yes'"),
    ([landmarks(0.1)[:32]], "frame 0 is no list of 33 landmarks"),
    ([landmarks(0.1), 7], "frame 1 is no list of 33 landmarks"),
    ([[{"x": 1, "y": 2}] * 33], "frame 0 has a landmark without z"),
    ([[{"x": "far", "y": 2, "z": 3}] * 33], "frame 0 must be numbers"),
    ([[{"x": float("nan"), "y": 2, "z": 3}] * 33], "NaN or infinity in frame 0"),
    ([landmarks(0.1)], "at least two frames"),
)
def test_damaged_json_is_refused_by_name(tmp_path: Path, content: object, fault: str):
    refused(rf"dance\.json: .*{fault}", load_motion, as_json(tmp_path / "dance.json", content), fps=30)


# MediaPipe's landmarks


def test_landmarks_are_2d_with_equal_units_or_metres_with_y_up(tmp_path: Path):
    frames = [landmarks(0.2), landmarks(0.4)]
    motion = load_motion(as_json(tmp_path / "dance.json", {"aspect": 2.0, "frames": frames}), fps=25)
    np.testing.assert_allclose(motion.positions[:, 5], [[0.4, 0.5], [0.8, 0.5]])
    motion = load_motion(as_json(tmp_path / "dance.json", {"world": True, "frames": frames}), fps=25)
    np.testing.assert_allclose(motion.positions[0, 5], [0.2, -0.5, 0.5])
    motion = load_motion(as_json(tmp_path / "dance.json", frames), fps=25, joints=("left_hip", "left_knee"))
    assert (motion.skeleton.joints, motion.skeleton.bones) == (("left_hip", "left_knee"), ((0, 1),))


@cases("columns", 3, 4)
def test_landmarks_whose_hips_stay_at_the_origin_are_in_metres(tmp_path: Path, columns: int):
    body = np.random.default_rng(1).normal(scale=0.3, size=(10, 33, 4))
    body[..., 3] = 0.9
    body[:, 24, :3] = -body[:, 23, :3]
    body[:, 0, 1] = -0.6  # the nose: y points down
    motion, _, notes = read_motion(save(tmp_path / "d.npy", body[..., :columns]), fps=25)
    assert motion.skeleton == MEDIAPIPE_33 and "guessed: the hips stay at the origin" in notes[-1]
    np.testing.assert_allclose(motion.positions, body[..., :3] * [1, -1, -1])
    picture = save(tmp_path / "e.npy", np.clip(body[..., :columns] + 0.5, 0, 1))
    assert load_motion(picture, fps=25).positions.shape[2] == (3 if columns == 3 else 2)
    landmarks = [dict(zip(("x", "y", "z", "visibility"), row, strict=False)) for row in body[0]]
    told = {"fps": 25.0, "frames": [landmarks] * 2}
    from_json, _, notes = read_motion(as_json(tmp_path / "d.json", told))
    assert from_json.positions.shape == (2, 33, 3) and "guessed: the hips stay at the origin" in notes[-1]
    assert not read_motion(as_json(tmp_path / "t.json", {**told, "world": True})).notes
    assert load_motion(as_json(tmp_path / "p.json", {**told, "world": False})).positions.shape == (2, 33, 2)


def test_33_places_without_visibility_are_of_a_picture_or_of_a_body_in_space_with_its_axis(tmp_path: Path):
    body = np.tile([0.5, 0.5, 0.0], (10, 33, 1))  # x, y as shares, depth from the hips
    body[:, 0, 1], body[:, 29:31, 1], body[:, 0, 2] = 0.2, 0.8, -0.1
    motion = load_motion(save(tmp_path / "picture.npy", body), fps=25)
    np.testing.assert_allclose(motion.positions, body[..., :2])
    space = np.stack(
        [1000 * body[..., 0], 1000 * body[..., 2], 2000 - 1000 * body[..., 1]], axis=2
    )  # as FreeMoCap has it
    motion, _, notes = file = read_motion(save(tmp_path / "mediapipe_body_3d_xyz.npy", space), fps=25)
    assert "order of joints guessed: MediaPipe" in [note.brief for note in file.assumptions]
    assert motion.skeleton == MEDIAPIPE_33 and notes[-1].startswith("z up (guessed: the head is 0.")
    np.testing.assert_allclose(motion.positions[0, [0, 29], 1], [1.8, 1.2])


@cases("frame", {"landmarks": [landmarks(0.2)]}, {"poseLandmarks": landmarks(0.2)}, [landmarks(0.2)])
def test_landmarks_may_be_written_as_tasks_and_javascript_have_them(tmp_path: Path, frame: object):
    path = as_json(tmp_path / "dance.json", [{"landmarks": []}, frame, frame, {"landmarks": []}])
    assert load_motion(path, fps=25).positions[0, 5].tolist() == [0.2, 0.5]
    two = as_json(tmp_path / "two.json", [frame, [landmarks(0.2)] * 2])
    refused(r"two\.json: frame 1 is no list of 33 landmarks", load_motion, two, fps=25)


def test_rate_in_the_file_is_taken_and_one_given_takes_its_place(tmp_path: Path):
    path = as_json(tmp_path / "dance.json", {"fps": 30.0, "frames": [landmarks(0.2), {"landmarks": landmarks(0.4)}]})
    assert (load_motion(path).fps, load_motion(path, fps=24).fps) == (30, 24)


def test_frames_without_anybody_are_filled_and_marked(tmp_path: Path):
    bodies = {0: landmarks(0.2), 3: landmarks(0.5), 4: landmarks(0.5, 0.2)}
    numbered = [{"frame_width": 1280, "frame_id": number, "pose_landmarks": body} for number, body in bodies.items()]
    for frames in ([bodies.get(number) for number in range(5)], numbered):
        motion = load_motion(as_json(tmp_path / "dance.json", frames), fps=25)
        np.testing.assert_allclose(motion.positions[:4, 0, 0], [0.2, 0.3, 0.4, 0.5])
        assert motion.valid.tolist() == [True, False, False, True, False]
    refused("names a frame twice", load_motion, as_json(tmp_path / "twice.json", numbered[:1] * 2), fps=25)


@cases("step, first", (2, 0), (2, 1), (3, 6))
def test_frames_numbered_at_a_regular_step_are_all_there_at_a_lower_rate(tmp_path: Path, step: int, first: int):
    numbers = [number for number in range(first, first + 40 * step, step) if number != first + 7 * step]
    lead, moves = first // step, 0.01 * np.array(numbers)
    media = [{"frame": number, "landmarks": landmarks(x)} for number, x in zip(numbers, moves, strict=True)]
    coco = [
        {"image_id": f"{number:06d}.jpg", "keypoints": coco_pose(x)} for number, x in zip(numbers, moves, strict=True)
    ]
    array = np.zeros((numbers[-1] + 1, 17, 3))
    array[numbers] = np.reshape([entry["keypoints"] for entry in coco], (-1, 17, 3))
    paths = [as_json(tmp_path / "media.json", media), as_json(tmp_path / "coco.json", coco)]
    for path in (*paths, save(tmp_path / "dance.npy", array)):
        file = read_motion(path, fps=30)
        assert file.motion.fps == 30 / step and "frame rate guessed" in file.assumptions[0].brief
        np.testing.assert_array_equal(np.flatnonzero(~file.motion.valid), [*range(lead), lead + 7])
        places = 0.01 * (first + step * np.arange(40))
        np.testing.assert_allclose(file.motion.positions[lead:, 4, 0], places)


def test_array_with_and_without_visibility_is_read(tmp_path: Path):
    values = np.random.default_rng(0).uniform(0, 1, (4, 33, 4))
    values[:, :, 3] = 1.0
    values[2] = np.nan
    motion = load_motion(save(tmp_path / "dance.npy", values), fps=25)
    assert motion.valid.tolist() == [True, True, False, True]
    np.testing.assert_allclose(motion.positions[2], (values[1, :, :2] + values[3, :, :2]) / 2)
    assert keypoints_motion(values[:2, :, :3], 25).valid.all()


def test_rate_aspect_shape_and_suffix_are_checked(tmp_path: Path):
    path = as_json(tmp_path / "dance.json", {"aspect": 0.0, "frames": [landmarks(0.2), landmarks(0.4)]})
    refused("holds key points but no frame rate; pass fps", load_motion, path)
    refused("aspect is width over height", load_motion, path, fps=25)
    refused(r"has shape \(2, 33, 5\)", keypoints_motion, np.zeros((2, 33, 5)), 25)
    (tmp_path / "dance.csv").write_text("x,y")
    refused(r"dance\.csv: is no motion file that is known", load_motion, tmp_path / "dance.csv", fps=25)


# Motion to BVH: what our reader gives back, and what other programs need

# A root with three children that keep together, an arm on one of them; listed out of order, child before parent.
TREE = Skeleton(("hand L", "hip L", "torso", "hip R", "neck", "elbow L"), (5, 2, -1, 2, 2, 4))
AT_REST = np.array([[0.6, 0.9, 0.1], [0.1, -0.1, 0.0], [0, 0, 0], [-0.1, -0.1, 0.0], [0.0, 0.5, 0.05], [0.3, 0.6, 0.0]])


def brought_back(path: Path, positions: np.ndarray, skeleton: Skeleton) -> Motion:
    """A movement that was saved as this BVH file and comes back from it."""
    save_bvh(path, Motion(positions, 15, skeleton))
    back = load_bvh(path)
    order = [back.skeleton.joints.index(name) for name in skeleton.joints]
    np.testing.assert_allclose(back.positions[:, order], positions, atol=1e-6)
    return back


def turned(skeleton: Skeleton, rest: np.ndarray, frames: int, seed: int = 0) -> np.ndarray:
    """(T, J, 3): every joint turns at random, smoothly, and takes its children along; bones keep their lengths."""
    rng = np.random.default_rng(seed)
    root = skeleton.parents.index(-1)
    children = [[c for c, p in enumerate(skeleton.parents) if p == joint] for joint in range(len(rest))]
    positions = np.zeros((frames, len(rest), 3))
    positions[:, root] = np.cumsum(rng.normal(0, 0.02, (frames, 3)), axis=0)
    waiting = [(root, Rotation.identity(frames))]
    while waiting:
        joint, above = waiting.pop()
        turn = above * Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.2, (frames, 3)), axis=0))
        for child in children[joint]:
            positions[:, child] = positions[:, joint] + turn.apply(rest[child] - rest[joint])
            waiting.append((child, turn))
    return positions


def channels(path: Path) -> dict[str, int]:
    """Joint -> number of channels, as the file's text has it."""
    pattern = r"(?:ROOT|JOINT) (.*)\n.*\n.*\n\s*CHANNELS (\d)"
    return {name: int(count) for name, count in re.findall(pattern, path.read_text())}


def test_straight_arm_along_x_has_its_bones_as_offsets_in_centimetres(tmp_path: Path):
    positions = np.array([[[0, 1, 0], [0.3, 1, 0], [0.5, 1, 0]], [[0, 1, 0], [0.3, 1, 0], [0.3, 1.2, 0]]])
    save_bvh(tmp_path / "arm.bvh", Motion(positions, 25, ARM))
    lines = [" ".join(line.split()) for line in (tmp_path / "arm.bvh").read_text().splitlines()]
    channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    assert lines[:3] == ["HIERARCHY", "ROOT shoulder", "{"]
    assert lines[3:6] == ["OFFSET 0.000000 0.000000 0.000000", channels, "JOINT elbow"]
    assert {f"OFFSET {length}.000000 0.000000 0.000000" for length in (30, 20)} <= set(lines)
    head = lines.index("MOTION")
    assert lines[head + 1 : head + 3] == ["Frames: 2", "Frame Time: 0.04"]
    first, second = (np.array(line.split(), float) for line in lines[head + 3 :])
    np.testing.assert_allclose(first, [0, 100, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], atol=1e-6)
    # The hand went from along x to along y: a quarter turn about z in the elbow.
    np.testing.assert_allclose(second, [0, 100, 0, 0, 0, 0, 90, 0, 0, 0, 0, 0], atol=1e-6)


def test_rigid_body_comes_back_from_rotations_alone_parents_as_parents(tmp_path: Path):
    back = brought_back(tmp_path / "body.bvh", turned(TREE, AT_REST, 80), TREE)
    counts = {"torso": 6, "hip L": 3, "hip R": 3, "neck": 3, "elbow L": 3, "hand L": 3}
    assert (back.fps, channels(tmp_path / "body.bvh")) == (15, counts)
    bones = [{(one.joints[p], one.joints[c]) for p, c in one.bones} for one in (back.skeleton, TREE)]
    assert bones[0] == bones[1] and len(back.skeleton.joints) == len(TREE.joints)
    text = " ".join((tmp_path / "body.bvh").read_text().split())  # every branch ends in a site of no length
    assert text.count("End Site { OFFSET 0 0 0 }") == 3
    assert text.count("{") == text.count("}")


def test_only_the_stretching_bone_gets_position_channels(tmp_path: Path):
    positions = turned(TREE, AT_REST, 60)
    hand, elbow = positions[:, 0], positions[:, 5]
    positions[:, 0] = elbow + (1 + 0.2 * np.sin(np.arange(60))[:, None]) * (hand - elbow)
    brought_back(tmp_path / "body.bvh", positions, TREE)
    assert {name for name, count in channels(tmp_path / "body.bvh").items() if count == 6} == {"torso", "hand L"}


@given(seed=st.integers(0, 10_000), frames=st.integers(2, 12))
def test_any_movement_of_any_tree_comes_back(tmp_path_factory: pytest.TempPathFactory, seed: int, frames: int):
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(0, joint)) for joint in range(1, 9))]
    shuffle = rng.permutation(9)
    inverse = np.argsort(shuffle)
    mixed = tuple(-1 if parents[joint] < 0 else int(inverse[parents[joint]]) for joint in shuffle)
    skeleton = Skeleton(tuple(f"j{i}" for i in range(9)), mixed)
    brought_back(tmp_path_factory.mktemp("tree") / "any.bvh", rng.normal(size=(frames, 9, 3)), skeleton)


def test_quarter_turn_where_two_angles_become_one_comes_back(tmp_path: Path):
    # The bone stands along -z: a turn of exactly 90 degrees about x.
    bone = np.array([[0, 0.3, 0], [0, 0, 0.3], [0, 0.3, 0], [0.3, 0, 0], [0, -0.3, 0]], float)
    brought_back(tmp_path / "arm.bvh", np.stack([np.zeros((5, 3)), bone, 2 * bone], axis=1), ARM)


def test_angles_go_on_beyond_half_a_turn_without_a_jump(tmp_path: Path):
    angle = np.linspace(0, 4 * np.pi, 60)
    bone = np.stack([np.cos(angle), np.sin(angle), np.zeros(60)], axis=1)
    save_bvh(tmp_path / "arm.bvh", Motion(np.stack([np.zeros((60, 3)), bone, 2 * bone], axis=1), 15, ARM))
    table = np.loadtxt((tmp_path / "arm.bvh").read_text().split("Frame Time:")[1].splitlines()[1:])
    assert table[-1, 3] == pytest.approx(720, abs=1e-4)
    assert np.abs(np.diff(table[:, 3:], axis=0)).max() < 15


def test_bone_of_no_length_and_a_dancer_of_a_centimetre_come_back(tmp_path: Path):
    brought_back(tmp_path / "arm.bvh", turned(ARM, np.array([[0, 0, 0], [0.01, 0, 0], [0.01, 0, 0]]), 20), ARM)


@pytest.mark.parametrize("size", [0.01, 0.2, 1.0])
def test_small_robot_with_head_and_feet_comes_back_in_its_size_and_not_in_that_of_cmu(tmp_path: Path, size: float):
    names = {"hand L": "head", "hip L": "foot L", "hip R": "foot R"}
    robot = Skeleton(tuple(names.get(name, name) for name in TREE.joints), TREE.parents)
    positions = size * turned(TREE, AT_REST, 20)
    save_bvh(tmp_path / "robot.bvh", Motion(positions, 15, robot))
    back = load_motion(tmp_path / "robot.bvh", joints=robot.joints).positions
    np.testing.assert_allclose(back, positions, atol=1e-5)


def test_end_site_of_some_length_is_still_a_joint(tmp_path: Path):
    save_bvh(tmp_path / "arm.bvh", Motion(turned(ARM, np.eye(3), 3), 15, ARM))
    (tmp_path / "long.bvh").write_text((tmp_path / "arm.bvh").read_text().replace("OFFSET 0 0 0\n", "OFFSET 0 5 0\n"))
    assert load_bvh(tmp_path / "long.bvh").skeleton.joints == ("shoulder", "elbow", "hand", "hand_end")


def test_names_that_bvh_cannot_hold_are_changed_and_stay_apart(tmp_path: Path):
    skeleton = Skeleton(("MOTION{", "a b", "a b"), (-1, 0, 1))
    save_bvh(tmp_path / "names.bvh", Motion(turned(ARM, np.eye(3), 3), 15, skeleton))
    assert load_bvh(tmp_path / "names.bvh").skeleton.joints == ("Motion_", "a b", "a b_2")


@cases(
    "skeleton, axes, fault",
    (Skeleton.unnamed(3), 3, "has 3 joints and 3 roots; save it as .npz"),
    (Skeleton(("a", "b", "c"), (-1, 2, 1)), 3, "form a ring"),
    (Skeleton(("a", "b", "c"), (1, 2, 0)), 3, "0 roots"),
    (ARM, 2, "image coordinates"),
)
def test_no_tree_and_image_coordinates_are_refused_by_file(tmp_path: Path, skeleton: Skeleton, axes: int, fault: str):
    refused(rf"dance\.bvh: .*{fault}", save_bvh, tmp_path / "dance.bvh", Motion(np.zeros((4, 3, axes)), 15, skeleton))
    assert list(tmp_path.iterdir()) == []


# Recordings


@pytest.mark.data
def test_recorded_bvh_moves_like_a_person(data_root: Path):
    motion = load_bvh(data_root / "extra" / "bvh" / "cmu_131_03.bvh", scale=0.056444)
    np.testing.assert_array_equal(load_bvh(data_root / "extra" / "bvh" / "cmu_131_03.bvh").positions, motion.positions)
    assert (motion.positions.shape, motion.fps) == ((1102, 38, 3), pytest.approx(120, abs=0.01))
    head, toe = (motion.skeleton.joints.index(name) for name in ("Head", "LeftToe"))
    assert np.median(motion.positions[:, head, 1] - motion.positions[:, toe, 1]) == pytest.approx(1.5, abs=0.3)
    assert np.ptp(bone_lengths(motion), axis=0).max() < 1e-9


@pytest.mark.data
def test_recorded_aist_key_points_are_upright_in_image_coordinates(data_root: Path):
    motion = load_motion(data_root / "extra" / "aist_keypoints2d" / "gMH_sFM_cAll_d22_mMH1_ch02.npy")
    assert (motion.positions.shape, motion.fps) == ((1279, 17, 2), 60)
    height = motion.positions[:, :, 1].mean(axis=0)
    assert height[COCO_17.joints.index("nose")] < height[COCO_17.joints.index("left_ankle")]


# What estimators write where they do not see


# As Ultralytics does below a confidence of .5, and DWPose.
@cases("columns, place", (2, (0, 0, 0.4)), (3, (0, 0, 0.4)), (2, (-1, -1, 0)))
def test_points_at_the_corner_of_a_picture_were_not_seen(tmp_path: Path, columns: int, place: tuple[float, ...]):
    points = np.random.default_rng(1).uniform(100, 600, (40, 17, 3))
    points[..., 2] = 0.9
    points[10:15, 5:12] = place
    np.save(tmp_path / "points.npy", points[..., :columns])
    motion = load_motion(tmp_path / "points.npy", fps=30)
    assert (~motion.valid).nonzero()[0].tolist() == [10, 11, 12, 13, 14]
    assert (np.abs(motion.positions[10:15, 5:12]) > 90).all()


# As Kinect and zeros that one's own code puts there; the places of a picture count from its middle.
@pytest.mark.parametrize("name", ["joints.npy", "body.npz"])
@pytest.mark.parametrize("size", [(22, 3), (33, 3), (17, 2), (5, 2)])
def test_frames_whose_joints_all_lie_at_one_point_show_nobody(tmp_path: Path, name: str, size: tuple[int, int]):
    rng = np.random.default_rng(1)
    places = rng.uniform(-1, 1, size) + 0.01 * rng.normal(size=(40, *size)).cumsum(axis=0)
    places[:10] = places[20:23] = 0
    np.savez(tmp_path / "body.npz", positions=places, fps=30, valid=np.arange(40) < 38)
    np.save(tmp_path / "joints.npy", places)
    file = read_motion(tmp_path / name, fps=30)
    masked = [38, 39] if name == "body.npz" else []
    assert (~file.motion.valid).nonzero()[0].tolist() == [*range(10), 20, 21, 22, *masked]
    assert (np.ptp(file.motion.positions, axis=1) > 0.5).all()
    np.testing.assert_allclose(np.diff(file.motion.positions[19:24], 2, axis=0), 0, atol=1e-12)  # a straight line
    assert "joints guessed, not rotations" not in [note.brief for note in file.assumptions]


# As Qualisys writes a gap. The first joint is the origin from which others count; the path of the second begins there.
@pytest.mark.parametrize("joints", [22, 21])
def test_a_joint_in_space_that_is_0_was_lost_unless_it_is_near_there_anyway(tmp_path: Path, joints: int):
    rng = np.random.default_rng(1)
    places = rng.uniform(-1, 1, (joints, 3)) + 0.01 * rng.normal(size=(40, joints, 3))
    places[:, 0] = places[0, 1] = 0
    places[1:, 1] *= 0.05
    true = places[10:15, 2:4].copy()
    places[10:15, 2:4] = 0
    motion = load_motion(save(tmp_path / "joints.npy", places), fps=30, scale=1.0, up="y")
    assert motion.valid.all()
    np.testing.assert_allclose(motion.positions[10:15, 2:4], true, atol=0.1)
    np.testing.assert_array_equal(motion.positions[:, :2], places[:, :2])


def test_a_confidence_a_little_above_one_makes_no_metres(tmp_path: Path):
    points = np.random.default_rng(1).uniform(100, 600, (40, 17, 3))
    points[..., 2] = 0.9
    points[3, 3, 2] = 1.03
    np.save(tmp_path / "points.npy", points)
    assert load_motion(tmp_path / "points.npy", fps=30).positions.shape == (40, 17, 2)


@cases("count, is_guess", (25, True), (18, True), (21, False))  # Kinect and NTU have 25 too, in another order
def test_order_of_joints_in_space_told_by_number_is_said_to_be_a_guess(tmp_path: Path, count: int, is_guess: bool):
    np.save(tmp_path / "kinect.npy", np.random.default_rng(1).uniform(-1, 2, (40, count, 3)))
    file = read_motion(tmp_path / "kinect.npy", fps=30)
    assert ("order of joints guessed: OpenPose" in [one.brief for one in file.assumptions]) == is_guess


def test_columns_of_which_each_third_is_no_confidence_are_not_read_as_a_picture(tmp_path: Path):
    np.save(tmp_path / "kinect.npy", np.random.default_rng(1).uniform(-1, 2, (40, 75)))
    refused(r"has 75 columns.*\(T, 25, 3\)", load_motion, tmp_path / "kinect.npy", fps=30)
