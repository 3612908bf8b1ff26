"""Files of the field's models: SMPL parameters, joints in space, HumanML3D vectors, markers; `harmolab data convert`.

Each answer is worked out by hand or by a second implementation here, in loops, from the published definitions.
"""

import json
import math
import os
import pickle
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import harmolab.readers.c3d as c3d_reader
from harmolab.body.skeletons import Skeleton, standing_height, tree_order
from harmolab.cli import app
from harmolab.cli.data_check import check
from harmolab.files import MissingFrameRate
from harmolab.lab.evaluate.pairing import Song, folder_pairs
from harmolab.readers.keypoints import COCO_17, HUMAN36M_17
from harmolab.readers.motion import load_motion, read_motion, save_motion
from harmolab.readers.smpl import SMPL_22, SMPL_24, load_body, neutral_body
from harmolab.types import Motion
from tests.builders import called, cases, complaint, done, missing, refused
from tests.test_hostile import Malicious

AIST = "gBR_sBM_cAll_d04_mBR0_ch02"
TREE = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]  # of SMPL, as published
# A body of the test's own, metres, T pose: x is its left, y up, z before it.
REST = np.array([
    [0, -0.2, 0], [0.1, -0.3, 0], [-0.1, -0.3, 0], [0, -0.1, 0], [0.1, -0.7, 0], [-0.1, -0.7, 0], [0, 0, 0],
    [0.1, -1.1, 0], [-0.1, -1.1, 0], [0, 0.1, 0], [0.1, -1.15, 0.1], [-0.1, -1.15, 0.1], [0, 0.3, 0], [0.1, 0.2, 0],
    [-0.1, 0.2, 0], [0, 0.4, 0.05], [0.2, 0.2, 0], [-0.2, 0.2, 0], [0.5, 0.2, 0], [-0.5, 0.2, 0], [0.75, 0.2, 0],
    [-0.75, 0.2, 0], [0.85, 0.2, 0], [-0.85, 0.2, 0],
])  # fmt: skip


def rodrigues(vector: np.ndarray) -> np.ndarray:
    """The matrix of one axis-angle rotation."""
    angle = math.sqrt(sum(one * one for one in vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = (one / angle for one in vector)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def loop_joints(poses: np.ndarray, root: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Forward kinematics of (T, 24, 3) axis-angle, joint by joint, frame by frame."""
    joints = np.zeros((len(poses), 24, 3))
    for frame, pose in enumerate(poses):
        worlds: list[np.ndarray] = []
        for joint, parent in enumerate(TREE):
            local = rodrigues(pose[joint])
            worlds.append(local if parent < 0 else worlds[parent] @ local)
            place = root[frame] if parent < 0 else joints[frame, parent] + worlds[parent] @ offsets[joint]
            joints[frame, joint] = place
    return joints


def dance(frames: int = 12, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Axis-angle (T, 24, 3) of an upright body that moves all limbs, and a way (T, 3), y up."""
    rng = np.random.default_rng(seed)
    poses = 0.2 * np.sin(np.linspace(0, 3, frames)[:, None, None] + rng.uniform(0, 6, (24, 3)))
    way = np.array([0.1, 0.95, -0.2]) + 0.02 * rng.normal(size=(frames, 3)).cumsum(axis=0)
    return poses, way


def to_z_up(joints: np.ndarray) -> np.ndarray:
    """Places with y up as places with z up: height goes from the second number to the third."""
    return np.stack([joints[..., 0], -joints[..., 2], joints[..., 1]], axis=-1)


def placed(frames: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (T, 24, 3) and way of a dance, and the joints of the neutral body that they stand for."""
    poses, way = dance(frames)
    return poses, way, loop_joints(poses, way, neutral_body().body.offsets)


def z_up_parameters() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (T, 72) and translation with z up, and the joints with y up that they stand for."""
    poses, way, expected = placed()
    quarter = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # y to z
    poses[:, 0] = [Rotation.from_matrix(quarter @ rodrigues(pose)).as_rotvec() for pose in poses[:, 0]]
    return poses.reshape(-1, 72), to_z_up(way), expected


def pickled(path: Path, **content: object) -> Path:
    path.write_bytes(pickle.dumps(content))
    return path


def saved(path: Path, values: object) -> Path:
    np.save(path, values, allow_pickle=True)
    return path


def asks_for_rate(path: Path, message: str = "holds no frame rate") -> None:
    """Passes where a file without a rate is refused with these words."""
    with pytest.raises(MissingFrameRate, match=message):
        load_motion(path)


# SMPL parameters


def test_neutral_body_at_rest_is_an_adult_with_arms_spread(tmp_path: Path):
    still = {"smpl_poses": np.zeros((3, 72)), "smpl_trans": np.zeros((3, 3)), "smpl_scaling": np.array([93.8])}
    path = pickled(tmp_path / f"{AIST}.pkl", **still)
    places = dict(zip(SMPL_24.joints, load_motion(path).positions[0], strict=True))
    # By hand: hip and knee and ankle below each other; 0.06 + 0.13 + 0.316 + 0.248 from the middle to the left wrist.
    np.testing.assert_allclose(places["left_ankle"], [0.085, -0.07 - 0.417 - 0.418, -0.02])
    assert (places["left_wrist"][0], places["right_wrist"][0]) == (pytest.approx(0.754), pytest.approx(-0.754))
    assert places["left_wrist"][1] == pytest.approx(places["left_shoulder"][1])
    assert places["left_foot"][2] > places["left_ankle"][2]
    # Drillis and Contini: shoulders 0.818 of 1.70 m, ankles 0.039.
    assert places["left_shoulder"][1] - places["left_ankle"][1] == pytest.approx((0.818 - 0.039) * 1.70, abs=0.02)


def test_amass_is_turned_upright_and_keeps_its_rate(tmp_path: Path):
    poses, way, expected = z_up_parameters()
    for width, rate in ((156, "mocap_framerate"), (165, "mocap_frame_rate"), (72, "mocap_framerate")):
        values = np.concatenate([poses[:, :66], np.full((12, width - 66), 0.3)], axis=1)
        np.savez(tmp_path / "walk.npz", poses=values, trans=way, betas=np.zeros(16), gender="male", **{rate: 120.0})
        motion, kind, notes = read_motion(tmp_path / "walk.npz")
        assert (motion.fps, motion.skeleton, kind) == (120, SMPL_24, "AMASS SMPL parameters")
        np.testing.assert_allclose(motion.positions[:, :22], expected[:, :22], atol=1e-9)
        assert any("neutral skeleton" in note for note in notes)
        assert "z up (as AMASS writes), turned to y up" in notes


def test_a_bent_elbow_is_where_a_hand_calculation_puts_it(tmp_path: Path):
    poses = np.zeros((2, 24, 3))
    poses[:, 18, 1] = -math.pi / 2  # the left elbow about y: what pointed left points forward
    poses[1, 0, 1] = math.pi / 2  # and the whole body about y: forward becomes left
    np.savez(tmp_path / "arm.npz", poses=poses.reshape(2, 72), trans=np.zeros((2, 3)), mocap_framerate=60.0)
    offsets = neutral_body().body.offsets
    places = load_motion(tmp_path / "arm.npz", up="y").positions
    elbow, wrist = places[:, 18], places[:, 20]
    np.testing.assert_allclose(wrist[0] - elbow[0], [0, 0, offsets[20, 0]], atol=1e-12)
    np.testing.assert_allclose(wrist[1] - elbow[1], [offsets[20, 0], 0, 0], atol=1e-12)


def test_aist_recordings_have_60_frames_a_second_and_are_scaled(tmp_path: Path):
    poses, way, expected = placed()
    content = {"smpl_poses": poses.reshape(-1, 72), "smpl_trans": way * 93.8, "smpl_scaling": np.array([93.8])}
    motion, kind, notes = read_motion(pickled(tmp_path / f"{AIST}.pkl", **content))
    assert (motion.fps, kind) == (60, "AIST++ SMPL parameters")
    np.testing.assert_allclose(motion.positions, expected, atol=1e-9)
    assert "60 frames a second (AIST++)" in notes
    other = pickled(tmp_path / "other.pkl", **content)
    asks_for_rate(other, r"other\.pkl: holds no frame rate; pass fps, such as --fps 25")
    for scaling in ({}, {"smpl_scaling": np.ones(1)}, {"smpl_scaling": np.array([100])}):  # a generator's to that song
        content = {"smpl_poses": poses.reshape(-1, 72), "smpl_trans": way, **scaling}
        asks_for_rate(pickled(tmp_path / f"{AIST}.pkl", **content))
        assert read_motion(tmp_path / f"{AIST}.pkl", fps=30.0, as_defaults=True).motion.fps == 30


def test_edge_joints_are_as_edge_placed_them_and_its_rate_is_asked_for(tmp_path: Path):
    poses, way, _ = z_up_parameters()
    joints = np.random.default_rng(2).normal(size=(12, 24, 3))
    path = pickled(tmp_path / "test_song.pkl", smpl_poses=poses, smpl_trans=way, full_pose=joints.astype(np.float32))
    asks_for_rate(path, "pass fps, such as --fps 30 of EDGE's own settings")
    motion, kind, notes = read_motion(path, fps=30)
    assert (motion.fps, kind) == (30, "EDGE's joints")
    np.testing.assert_allclose(to_z_up(motion.positions), joints, atol=1e-6)
    assert notes == ("joints of full_pose", "z up (as EDGE writes), turned to y up")


def test_parameters_of_unknown_origin_stand_as_their_body_does(tmp_path: Path):
    poses, way, expected = z_up_parameters()
    for content, up in (((poses, way), "z"), ((dance()[0].reshape(-1, 72), dance()[1]), "y")):
        path = pickled(tmp_path / "dance.pkl", smpl_poses=content[0], smpl_trans=content[1])
        motion, _, notes = read_motion(path, fps=30)
        np.testing.assert_allclose(motion.positions, expected, atol=1e-9)
        assert any(note.startswith(f"{up} up (guessed: the head is") for note in notes)
    root, body = poses[:, :3], poses[:, 3:].reshape(12, 23, 3)
    for names in (("root_orient", "pose_body", "trans"), ("global_orient", "body_pose", "transl")):
        np.savez(tmp_path / "parts.npz", fps=30, **dict(zip(names, (root, body, way), strict=True)))
        np.testing.assert_allclose(load_motion(tmp_path / "parts.npz").positions, expected, atol=1e-9)
    flat = np.tile([0, 0, math.pi / 2] + [0] * 69, (3, 1))
    lying = pickled(tmp_path / "lying.pkl", smpl_poses=flat, smpl_trans=way[:3])
    refused(r"lying\.pkl: does not tell which axis points up.* --up z", load_motion, lying, fps=30)
    assert load_motion(lying, fps=30, up="y").n_frames == 3


def matrices(poses: np.ndarray) -> np.ndarray:
    """(T, J, 9) of axis-angle (T, J, 3): each matrix row by row; the first six numbers are its first two rows."""
    return np.array([[rodrigues(one).ravel() for one in frame] for frame in poses])


def test_six_numbers_nine_and_axis_angle_are_the_same_rotation(tmp_path: Path):
    poses, way, expected = placed()
    rows = matrices(poses)[..., :6] * 1.7  # a network's rows are not of length 1
    nine = matrices(poses) * 1.1  # nor are its matrices
    for values in (rows, rows.reshape(12, 144), nine, nine.reshape(12, 216), poses):
        file = read_motion(pickled(tmp_path / "six.pkl", smpl_poses=values, smpl_trans=way), fps=30)
        np.testing.assert_allclose(file.motion.positions, expected, atol=1e-9)
        is_six = values.shape[-1] in (6, 144)  # other codes write columns: nothing in the file tells
        assert ("6-D rotations assumed to be rows" in [one.brief for one in file.assumptions]) == is_six


@pytest.mark.parametrize(("width", "contacts", "joints"), [(139, 4, 22), (135, 0, 22), (319, 4, 52), (315, 0, 52)])
def test_vectors_of_lodge_and_finedance_are_read(tmp_path: Path, width: int, contacts: int, joints: int):
    poses, way, expected = placed()
    rows = np.zeros((12, joints, 6))
    rows[..., 0] = rows[..., 4] = 1.0
    rows[:, :22] = matrices(poses[:, :22])[..., :6]
    values = np.concatenate([np.ones((12, contacts)), way, rows.reshape(12, -1)], axis=1)
    assert values.shape[1] == width
    motion = load_motion(saved(tmp_path / "dance.npy", values), fps=30)
    np.testing.assert_allclose(motion.positions[:, :22], expected[:, :22], atol=1e-9)
    asks_for_rate(tmp_path / "dance.npy")


def fact_vectors(poses: np.ndarray, way: np.ndarray, fault: np.ndarray | float = 0.0) -> np.ndarray:
    """(T, 225) as FACT writes them: six zeros, the translation, 24 matrices."""
    nine = matrices(poses) + fault
    return np.concatenate([np.zeros((len(way), 6)), way, nine.reshape(len(way), 216)], axis=1).astype(np.float32)


def test_vectors_of_fact_are_read_and_its_seed_is_a_remark(tmp_path: Path):
    poses, way, expected = placed()
    path = saved(tmp_path / "mBR0.npy", fact_vectors(poses, way))
    asks_for_rate(path, r"mBR0\.npy: .*pass fps, such as --fps 60 of FACT's own settings")
    motion, kind, notes = read_motion(path, fps=60)
    assert (kind, motion.fps, motion.skeleton) == ("SMPL vectors of FACT", 60, SMPL_24)
    np.testing.assert_allclose(motion.positions, expected, atol=1e-5)
    assert "y up (as FACT writes)" in notes
    assert any("the first 120 too, which are recorded" in note for note in notes)
    without = read_motion(saved(tmp_path / "plain.npy", fact_vectors(poses, way)[:, 6:]), fps=60)
    assert without.kind == "SMPL vectors"
    np.testing.assert_allclose(without.motion.positions, expected, atol=1e-5)


def test_a_matrix_that_is_no_rotation_is_taken_for_the_nearest_one(tmp_path: Path):
    poses, way = dance(3)
    fault = np.random.default_rng(9).normal(size=(3, 24, 9)) * 0.05
    nearest = [[polar(one.reshape(3, 3))[0] for one in frame] for frame in matrices(poses) + fault]
    axis_angle = Rotation.from_matrix(np.reshape(nearest, (-1, 3, 3))).as_rotvec().reshape(3, 24, 3)
    motion = load_motion(saved(tmp_path / "d.npy", fact_vectors(poses, way, fault)), fps=60)
    np.testing.assert_allclose(motion.positions, loop_joints(axis_angle, way, neutral_body().body.offsets), atol=1e-5)


@cases(
    "values, fault",
    (np.zeros((4, 225)), "the vectors holds no rotation matrices: half of them are 1.7 or more from any rotation"),
    (np.random.default_rng(1).normal(size=(4, 225)), "holds no rotation matrices"),
    (np.full((4, 225), 1e300), "holds no rotation matrices"),
    (np.full((4, 225), np.nan), "the vectors holds NaN or infinity at frame 0, joint 0"),
    (np.zeros((0, 225)), ""),
)
def test_vectors_that_hold_no_matrices_are_refused_by_name(tmp_path: Path, values: np.ndarray, fault: str):
    refused(rf"bad\.npy: .*{fault}", load_motion, saved(tmp_path / "bad.npy", values), fps=60)


# The user's own body


def tree_of(parents: list[int]) -> np.ndarray:
    """kintree_table as SMPL's files have it: parents in unsigned numbers, and the joints' own numbers."""
    return np.array([parents, range(len(parents))], np.int64).astype(np.uint32)


TEMPLATE = np.random.default_rng(3).normal(size=(60, 3))  # points of a body
REGRESSOR = REST @ np.linalg.pinv(TEMPLATE)  # from which its joints follow


@cases("arrays", {"J": REST}, {"J_regressor": REGRESSOR, "v_template": TEMPLATE}, ids=["J", "J_regressor"])
def test_a_body_of_ones_own_takes_the_place_of_the_neutral_one(tmp_path: Path, arrays: dict[str, np.ndarray]):
    poses, way = dance()
    np.savez(tmp_path / "smpl.npz", kintree_table=tree_of(TREE), **arrays)
    path = pickled(tmp_path / "d.pkl", smpl_poses=poses.reshape(-1, 72), smpl_trans=way, smpl_scaling=np.ones(1))
    motion, _, notes = read_motion(path, fps=60, smpl=tmp_path / "smpl.npz")
    offsets = REST - REST[[0, *TREE[1:]]]
    np.testing.assert_allclose(motion.positions, loop_joints(poses, way + REST[0], offsets), atol=1e-9)
    assert any("smpl.npz" in note for note in notes)


def test_edge_with_a_body_of_ones_own_is_posed_anew(tmp_path: Path):
    poses, way, _ = z_up_parameters()
    np.savez(tmp_path / "smpl.npz", J=REST, kintree_table=tree_of(TREE))
    path = pickled(tmp_path / "edge.pkl", smpl_poses=poses, smpl_trans=way, full_pose=np.zeros((12, 24, 3)))
    places = to_z_up(load_motion(path, fps=30, smpl=tmp_path / "smpl.npz").positions)
    np.testing.assert_allclose(places[:, 0], way + REST[0], atol=1e-9)
    assert np.linalg.norm(places[:, 4] - places[:, 1], axis=1) == pytest.approx(0.4)  # its thigh


def shaped_body(path: Path, directions: np.ndarray) -> Path:
    """An SMPL file of 60 points from which the joints of `REST` follow, with directions (60, 3, S) of its shape."""
    np.savez(path, J_regressor=REGRESSOR, v_template=TEMPLATE, shapedirs=directions, kintree_table=tree_of(TREE))
    return path


def test_betas_shape_the_joints_at_rest(tmp_path: Path):
    poses, way, _ = z_up_parameters()
    directions, betas = np.random.default_rng(4).normal(size=(60, 3, 2)) * 0.2, np.array([0.8, -1.1, 5.0])
    body = shaped_body(tmp_path / "smpl.npz", directions)
    rest = REGRESSOR @ (TEMPLATE + 0.8 * directions[..., 0] - 1.1 * directions[..., 1])  # the first two betas
    assert np.abs(rest - REST).max() > 0.01
    np.savez(tmp_path / "walk.npz", poses=poses, trans=way, betas=betas, gender="male", mocap_framerate=120.0)
    motion, _, notes = read_motion(tmp_path / "walk.npz", smpl=body)
    expected = loop_joints(poses.reshape(-1, 24, 3), way + rest[0], rest - rest[[0, *TREE[1:]]])
    np.testing.assert_allclose(to_z_up(motion.positions), expected, atol=1e-9)
    assert "joints of the body in smpl.npz shaped by 2 of 3 betas" in notes
    mean = pickled(tmp_path / "mean.pkl", smpl_poses=poses, smpl_trans=way, betas=np.zeros((1, 10)))
    assert "joints of the mean body in smpl.npz" in read_motion(mean, fps=30, smpl=body).notes
    each = betas + np.linspace(-1, 1, len(poses))[:, None]  # a shape for each frame, as GVHMR and WHAM write
    np.savez(tmp_path / "walk.npz", poses=poses, trans=way, betas=each, gender="male", mocap_framerate=120.0)
    np.testing.assert_allclose(load_motion(tmp_path / "walk.npz", smpl=body).positions, motion.positions, atol=1e-9)


def test_betas_that_cannot_be_used_are_said_to_be_left_out(tmp_path: Path):
    poses, way, expected = z_up_parameters()
    np.savez(tmp_path / "walk.npz", poses=poses, trans=way, betas=np.ones(16), mocap_framerate=120.0)
    np.savez(tmp_path / "joints.npz", J=REST, kintree_table=tree_of(TREE))
    neutral, own = (read_motion(tmp_path / "walk.npz", smpl=body) for body in (None, tmp_path / "joints.npz"))
    np.testing.assert_allclose(neutral.motion.positions, expected, atol=1e-9)
    briefs = [one.brief for read in (neutral, own) for one in read.assumptions]
    assert briefs == ["joints of harmolab's neutral skeleton, not SMPL's, betas left out", "betas left out"]
    assert "joints.npz; betas are left out, since it has no J_regressor with shapedirs" in own.assumptions[0]


@cases(
    "betas, fault",
    (np.ones((12, 10)), r"betas must be the shape of one body, \(S,\) or \(1, S\), got shape \(12, 10\)"),
    (np.float64(1), "betas must be the shape of one body"),
    (np.full(10, np.nan), "betas hold NaN or infinity"),
    (np.full(10, 1e6), r"smpl\.npz: is made no body in metres by betas up to 1e\+06"),
    (np.full(10, 1e300), "no body in metres"),
)
def test_betas_that_are_no_shape_are_refused_by_name(tmp_path: Path, betas: np.ndarray, fault: str):
    body = shaped_body(tmp_path / "smpl.npz", np.ones((60, 3, 2)) * np.arange(60)[:, None, None])
    np.savez(tmp_path / "w.npz", poses=np.zeros((3, 72)), trans=np.zeros((3, 3)), betas=betas, mocap_framerate=60.0)
    refused(rf"w\.npz: .*{fault}", load_motion, tmp_path / "w.npz", smpl=body)


def test_a_missing_body_is_named_and_one_that_was_replaced_is_read_anew(tmp_path: Path):
    np.savez(tmp_path / "w.npz", poses=np.zeros((3, 72)), trans=np.zeros((3, 3)), mocap_framerate=60.0)
    missing(r"smpl\.npz: no such file", load_motion, tmp_path / "w.npz", smpl=tmp_path / "smpl.npz")
    for factor, stamp in ((1.0, 1), (1.1, 2)):
        np.savez(tmp_path / "smpl.npz", J=REST * factor, kintree_table=tree_of(TREE))
        os.utime(tmp_path / "smpl.npz", (stamp, stamp))
        np.testing.assert_allclose(load_body(tmp_path / "smpl.npz").pelvis, REST[0] * factor)


def test_a_body_with_fingers_gives_22_joints(tmp_path: Path):
    rest = np.concatenate([REST[:22], np.full((30, 3), 0.1)])
    np.savez(tmp_path / "smplh.npz", J=rest, kintree_table=tree_of([*TREE[:22], *[20] * 15, *[21] * 15]))
    assert load_body(tmp_path / "smplh.npz").body.skeleton == SMPL_22


SHAPED = {"J": REST, "kintree_table": tree_of(TREE), "J_regressor": np.ones((24, 9))}


@cases(
    "arrays, fault",
    ({"kintree_table": tree_of(TREE)}, "has no array J, and no J_regressor and no v_template"),
    ({"J": REST}, "kintree_table must be"),
    ({"J": REST, "kintree_table": tree_of([-1, *range(23)])}, "another tree of joints"),
    ({"J": REST * 100, "kintree_table": tree_of(TREE)}, "make no body in metres"),
    ({"J": REST * np.nan, "kintree_table": tree_of(TREE)}, "make no body in metres"),
    ({"J": REST[:7], "kintree_table": tree_of(TREE[:7])}, "24, 52 or 55 joints"),
    ({"J_regressor": np.ones((24, 9)), "v_template": np.ones((8, 3))}, "does not fit v_template"),
    (SHAPED | {"shapedirs": np.ones((8, 3))}, r"shapedirs \(8, 3\) do not fit J_regressor \(24, 9\)"),
    (SHAPED | {"shapedirs": np.full((9, 3, 2), np.nan)}, "shapedirs hold NaN or infinity"),
)
def test_a_file_that_holds_no_smpl_body_is_refused(tmp_path: Path, arrays: dict[str, Any], fault: str):
    np.savez(tmp_path / "body.npz", **arrays)
    refused(rf"body\.npz: .*{fault}", load_body, tmp_path / "body.npz")


def test_a_pickled_body_is_refused_with_the_way_to_convert_it(tmp_path: Path):
    path = pickled(tmp_path / "SMPL_NEUTRAL.pkl", J=REST)
    refused(r"SMPL_NEUTRAL\.pkl: is no \.npz.*numpy\.savez\('smpl\.npz'", load_body, path)


def test_a_body_is_refused_for_files_without_parameters(tmp_path: Path):
    np.savez(tmp_path / "smpl.npz", J=REST, kintree_table=tree_of(TREE))
    path = saved(tmp_path / "joints.npy", np.tile(REST, (4, 1, 1)))
    refused(r"joints\.npy: holds no SMPL parameters; leave out", load_motion, path, fps=30, smpl=tmp_path / "smpl.npz")


# Joints in space


def moving_joints() -> np.ndarray:
    """(12, 24, 3) joints, metres, y up."""
    poses, way = dance()
    return loop_joints(poses, way, REST - REST[[0, *TREE[1:]]])


@cases("name", "array.npy", "flat.npy", "bailando.pkl.npy", "dance.json", "bare.json", "flat.pkl", "bare.pkl")
def test_24_joints_are_read_from_arrays_json_and_pickles(tmp_path: Path, name: str):
    joints, path = moving_joints(), tmp_path / name
    flat = joints.reshape(12, 72)
    contents: dict[str, Any] = {
        "array.npy": joints, "flat.npy": flat, "bailando.pkl.npy": {"pred_position": flat},
        "dance.json": {"id": "x", "music_array": [[0.5]], "dance_array": flat.tolist()}, "bare.json": joints.tolist(),
        "flat.pkl": {"pred_position": flat}, "bare.pkl": joints,
    }  # fmt: skip
    if path.suffix == ".npy":
        np.save(path, contents[name])
    else:
        path.write_bytes(pickle.dumps(contents[name]) if path.suffix == ".pkl" else json.dumps(contents[name]).encode())
    asks_for_rate(path, "--fps 25")
    motion, kind, notes = read_motion(path, fps=60)
    assert (motion.skeleton, motion.fps, kind) == (SMPL_24, 60, "24 joints of SMPL")
    np.testing.assert_allclose(motion.positions, joints, atol=1e-12)
    assert notes[0].startswith("metres (guessed: the body extends over 1.")
    assert notes[1].startswith("y up (guessed: the head is 1.")


def test_rate_in_a_json_file_of_joints_is_taken(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    caplog.set_level("INFO", "harmolab")
    path = tmp_path / "dance.json"
    path.write_text(json.dumps({"fps": 50, "pred_position": moving_joints().tolist()}))
    assert [load_motion(path, fps=fps).fps for fps in (None, 50, 25)] == [50, 50, 25]
    assert read_motion(path, fps=25, as_defaults=True).motion.fps == 50
    assert caplog.messages == ["--fps 25 takes the place of the file's own 50 frames a second"]
    path.write_text(json.dumps({"fps": "fast", "pred_position": moving_joints().tolist()}))
    refused(r"dance\.json: ", load_motion, path)


def test_axis_of_our_own_files_can_be_passed_where_there_is_one(tmp_path: Path):
    np.savez(tmp_path / "own.npz", positions=to_z_up(moving_joints()), fps=30.0)
    np.testing.assert_allclose(load_motion(tmp_path / "own.npz", up="z").positions, moving_joints())
    np.savez(tmp_path / "flat.npz", positions=moving_joints()[..., :2], fps=30.0)
    refused(r"flat\.npz: holds image coordinates, .*leave out up", load_motion, tmp_path / "flat.npz", up="z")
    refused("up must be y or z", load_motion, tmp_path / "own.npz", up="x")
    (tmp_path / "walk.bvh").write_text(
        "HIERARCHY\nROOT hip { OFFSET 0 0 0 CHANNELS 3 Xposition Yposition Zposition\n"
        "JOINT top { OFFSET 0 0 100 CHANNELS 0 } }\nMOTION\nFrames: 2\nFrame Time: 0.1\n0 0 0\n0 0 50\n"
    )
    motion, _, notes = read_motion(tmp_path / "walk.bvh", up="z")
    assert notes[0] == "0.01 m a unit (guessed: its rest skeleton is larger than 3 units; --scale overrules it)"
    assert notes[1:] == ("z up (as passed), turned to y up",)
    np.testing.assert_allclose(motion.positions, [[[0, 0, 0], [0, 1, 0]], [[0, 0.5, 0], [0, 1.5, 0]]], atol=1e-12)


def test_bailando_file_with_an_aist_name_has_its_rate_unless_one_is_passed(tmp_path: Path):
    np.save(tmp_path / f"{AIST}.pkl.npy", {"pred_position": moving_joints().reshape(12, 72)})
    motion, _, notes = read = read_motion(tmp_path / f"{AIST}.pkl.npy")
    assert (motion.fps, notes[-1].startswith("60 frames a second (assumed: it is named")) == (60, True)
    briefs = [one.brief for one in read.assumptions]
    assert briefs == ["unit guessed: metres", "axis guessed: y up", "60 frames a second assumed by the name"]
    for as_defaults in (True, False):
        read = read_motion(tmp_path / f"{AIST}.pkl.npy", fps=30, scale=1.0, up="y", as_defaults=as_defaults)
        assert (read.motion.fps, read.assumptions) == (30, ())


def test_what_bare_joints_do_not_tell_is_assumed_aloud(tmp_path: Path):
    path = saved(tmp_path / "d.npy", np.random.default_rng(1).normal(size=(5, 21, 3)))
    briefs = [one.brief for one in read_motion(path, fps=30).assumptions]
    assert briefs == ["unit assumed: metres", "axis assumed: y up"]
    read = read_motion(path, fps=30, scale=0.5, up="y")
    assert (read.assumptions, read.notes) == ((), ("0.5 m a unit (as passed)", "y up (as passed)"))


def test_options_as_defaults_leave_alone_what_a_file_tells(tmp_path: Path):
    np.savez(tmp_path / "own.npz", positions=moving_joints(), fps=50.0)
    (tmp_path / "marks.json").write_text(json.dumps({"fps": 50, "frames": [[dict.fromkeys("xyz", 0.5)] * 33] * 4}))
    z_up, way, expected = z_up_parameters()
    np.savez(tmp_path / "walk.npz", poses=z_up, trans=way, mocap_framerate=50.0)
    for name in ("own.npz", "marks.json", "walk.npz"):
        default, passed = (read_motion(tmp_path / name, fps=30, as_defaults=one).motion.fps for one in (True, False))
        assert (default, passed) == (50, 30)
    saved(tmp_path / "bare.npy", to_z_up(moving_joints()))
    rows = ("own.npz", "z", moving_joints()), ("walk.npz", "y", expected), ("bare.npy", "z", moving_joints())
    for name, up, places in rows:
        motion = read_motion(tmp_path / name, fps=30, up=up, as_defaults=True).motion
        np.testing.assert_allclose(motion.positions, places)


@pytest.mark.parametrize(("unit", "factor"), [("centimetres", 100.0), ("millimetres", 1000.0)])
def test_units_and_axis_are_guessed_from_the_body_and_said(tmp_path: Path, unit: str, factor: float):
    joints = moving_joints()
    motion, _, notes = read_motion(saved(tmp_path / "d.npy", to_z_up(joints) * factor), fps=60)
    np.testing.assert_allclose(motion.positions, joints, atol=1e-9)
    assert notes[0].startswith(f"{unit} (guessed")
    assert notes[1].startswith("z up (guessed")
    passed = load_motion(tmp_path / "d.npy", fps=60, scale=1 / factor, up="y").positions
    np.testing.assert_allclose(passed, to_z_up(joints), atol=1e-9)
    refused(r"d\.npy: .*pass scale", load_motion, saved(tmp_path / "d.npy", joints * 1e6), fps=60)


def test_the_way_from_feet_to_head_is_up_where_a_file_leaves_it_open_or_its_kind_is_known_by_habit(tmp_path: Path):
    joints, openpose = moving_joints(), np.zeros((12, 25, 3))
    openpose[:, [0, 11]] = joints[:, [15, 7]]  # nose and an ankle
    for up, turn in (("z", to_z_up), ("-y", lambda places: places * [1, -1, -1])):
        save_motion(tmp_path / "d.bvh", Motion(turn(joints), 60, SMPL_24))
        saved(tmp_path / "d.npy", turn(openpose) * 1000)
        for name, places in (("d.bvh", joints[:, tree_order(SMPL_24.parents)]), ("d.npy", openpose)):
            file = read_motion(tmp_path / name, fps=60)
            np.testing.assert_allclose(file.motion.positions, places, atol=1e-4)
            assert file.assumptions[-1].brief == f"axis guessed: {up} up"
    np.savez(tmp_path / "walk.npz", poses=dance()[0].reshape(-1, 72), trans=dance()[1], mocap_framerate=50.0)
    file = read_motion(tmp_path / "walk.npz")
    np.testing.assert_allclose(file.motion.positions, z_up_parameters()[2], atol=1e-9)
    assert file.assumptions[-1].brief == "axis guessed: y up"


def test_joints_of_another_order_have_a_long_and_a_short_thigh_and_a_remark_says_so(tmp_path: Path):
    joints = moving_joints()
    legs = joints[:, [0, 1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, *range(12, 24)]]  # branch by branch: LAFAN1
    for places, briefs in ((joints, 0), (legs, 1)):
        file = read_motion(saved(tmp_path / "d.npy", places), fps=60)
        assert [one.brief for one in file.assumptions].count("order of joints in doubt") == briefs


def seventeen_joints() -> np.ndarray:
    """(5, 17, 3) joints of COCO, metres, y up; most lie in the origin."""
    joints = np.zeros((5, 17, 3))
    for name, place in {"nose": (0, 1.6, 0.1), "left_hip": (0.1, 0.9, 0), "left_knee": (0.1, 0.5, 0)}.items():
        joints[:, COCO_17.joints.index(name)] = place
    joints[:, 0, 0] += np.arange(5) * 0.01
    return joints


def test_17_joints_are_read_from_json_pickles_and_arrays_and_told_from_points_in_a_picture(tmp_path: Path):
    joints = seventeen_joints()
    (tmp_path / "d.json").write_text(json.dumps({"fps": 60, "positions": joints.reshape(5, 51).tolist()}))
    pickled(tmp_path / "d.pkl", positions=joints)
    pickled(tmp_path / f"{AIST}.pkl", keypoints3d=joints * 100)
    saved(tmp_path / "d.npy", joints)
    saved(tmp_path / "flat.npy", joints.reshape(5, 51))
    for name, fps in (("d.json", None), ("d.pkl", 60), (f"{AIST}.pkl", None), ("d.npy", 60), ("flat.npy", 60)):
        motion = load_motion(tmp_path / name, fps=fps)
        assert (motion.skeleton, motion.fps) == (COCO_17, 60)
        np.testing.assert_allclose(motion.positions, joints)
    for size in ([640, 480, 1], [1, 1, 1]):
        points = np.random.default_rng(1).uniform(0.1, 1, (5, 17, 3)) * size
        (tmp_path / "p.json").write_text(json.dumps(points.tolist()))
        for path in (saved(tmp_path / "d.npy", points.reshape(5, 51)), tmp_path / "p.json"):
            np.testing.assert_allclose(load_motion(path, fps=60).positions, points[..., :2])


def bailando_frames(folder: Path, joints: np.ndarray, key: str = "3d_pose") -> Path:
    """A folder as Bailando writes it, one file a frame."""
    folder.mkdir(parents=True)
    for number, frame in enumerate(joints):
        (folder / f"ep000010_frame{number:06d}_kps.json").write_text(json.dumps({key: frame.tolist()}))
    return folder


def test_frames_of_bailando_are_one_dance(tmp_path: Path):
    folder = bailando_frames(tmp_path / "jsons_original" / "ep000010" / f"{AIST}.json", moving_joints())
    asks_for_rate(folder, rf"{AIST}\.json: .*pass fps, such as --fps 60 of Bailando's settings")
    motion, kind, notes = read_motion(folder, fps=60)
    assert (motion.skeleton, motion.fps, kind) == (SMPL_24, 60, "Bailando's frames, 24 joints of SMPL")
    np.testing.assert_allclose(motion.positions, moving_joints(), atol=1e-12)
    assert notes[0].startswith("metres (guessed")
    (row,) = check(folder.parent)
    assert (row.kind, row.frames, row.note) == ("motion", 12, f"3-D, {kind}")
    songs = [Song("mBR0", Path("mBR0.wav"))]
    assert [pair.song for pair in folder_pairs("bailando", folder.parent, songs).pairs] == ["mBR0"]


def test_frames_of_bailando_that_hold_no_dance_are_refused_by_name(tmp_path: Path):
    drawn = bailando_frames(tmp_path / "drawn", moving_joints(), key="people")
    refused(r"frame000000_kps\.json: has no 3d_pose; Bailando's drawings in jsons are not", load_motion, drawn, fps=60)
    short = bailando_frames(tmp_path / "short", moving_joints()[:, :23])
    refused(r"frame000000_kps\.json: 3d_pose must have shape \(24, 3\), got \(23, 3\)", load_motion, short, fps=60)
    still = bailando_frames(tmp_path / "one", moving_joints()[:1])
    refused(r"one: joints must have shape", load_motion, still, fps=60)
    (still / "ep000010_frame000002_kps.json").write_text("{}")
    refused(r"one: frame 1 is missing between 0 and 2", load_motion, still, fps=60)


def test_samples_of_mdm_are_refused_with_what_saves_one_of_them(tmp_path: Path):
    samples = {
        "motion": moving_joints()[None, :, :22].transpose(0, 2, 3, 1),
        "text": ["salsa"],
        "lengths": np.array([9]),
    }
    saved(tmp_path / "results.npy", samples)
    with pytest.raises(ValueError, match=r"results\.npy: holds 1 motions of MDM; where you trust") as refusal:
        load_motion(tmp_path / "results.npy", fps=20)
    recipe = str(refusal.value).partition("save one: ")[2]
    code = recipe.replace("results.npy", f"{tmp_path}/results.npy").replace("dance.npz", f"{tmp_path}/dance.npz")
    exec(code, {"numpy": np})
    motion = load_motion(tmp_path / "dance.npz")
    np.testing.assert_allclose(motion.positions, moving_joints()[:9, :22])


def test_rotations_in_the_place_of_joints_are_noticed(tmp_path: Path):
    poses = np.random.default_rng(1).normal(size=(40, 72)) * np.linspace(0, 1, 40)[:, None]
    refused(r"d\.npy: holds no joints: the thigh changes", load_motion, saved(tmp_path / "d.npy", poses), fps=60)


def test_rotations_that_move_little_are_told_from_joints_by_a_remark(tmp_path: Path):
    poses = np.random.default_rng(1).normal(size=(40, 24, 3)) * 0.4 + 0.5
    kind, notes = read_motion(saved(tmp_path / "d.npy", poses), fps=60)[1:]
    assert kind == "24 joints of SMPL" and notes[-1].startswith("joints (guessed: bones change their lengths by")
    assert not [note for note in read_motion(saved(tmp_path / "d.npy", moving_joints()), fps=60)[2] if "bones" in note]


def swinging_bones(skeleton: Skeleton, frames: int = 60) -> np.ndarray:
    """(T, J, 3) joints whose bones swing about where they hang, each at its own rate, a fifth of a metre long."""
    rng, joints = np.random.default_rng(2), np.zeros((frames, len(skeleton.joints), 3))
    for parent, joint in sorted(skeleton.bones, key=lambda bone: bone[0]):
        angle = rng.uniform(0, 6) + 0.5 * np.sin(rng.uniform(0.1, 0.3) * np.arange(frames))
        joints[:, joint] = joints[:, parent] + 0.2 * np.stack([np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    return joints


# SMPL's joint for each of the others'.
OF_SMPL = {
    COCO_17: [15, 15, 15, 15, 15, 16, 17, 18, 19, 20, 21, 1, 2, 4, 5, 7, 8],
    HUMAN36M_17: [0, 2, 5, 8, 1, 4, 7, 6, 12, 15, 15, 16, 18, 20, 17, 19, 21],
}


def in_order(skeleton: Skeleton, joints: np.ndarray) -> np.ndarray:
    """(T, 17, 3) joints in the skeleton's order, of SMPL's (T, 24, 3); eyes and ears lie beside the nose."""
    aside = np.zeros((17, 3))
    aside[1:5, 0] = [0.03, -0.03, 0.07, -0.07] if skeleton == COCO_17 else 0.0
    return joints[:, OF_SMPL[skeleton]] + aside


def test_open_arms_and_noise_make_no_other_skeleton(tmp_path: Path):
    for noise in (0.0, 0.01, 0.03):
        joints = in_order(COCO_17, REST[None]) + np.random.default_rng(4).normal(scale=noise, size=(60, 17, 3))
        assert read_motion(saved(tmp_path / "d.npy", joints), fps=30, up="y").motion.skeleton == COCO_17


@cases("skeleton", HUMAN36M_17, COCO_17)
@cases("turns", [0, 0], [90, 0], [200, 0], [0, 90], [90, 180], [300, 40])  # degrees: facing, then on the side
def test_order_of_17_joints_is_told_by_the_body_from_all_sides_and_in_pictures_either_way_up(
    tmp_path: Path, skeleton: Skeleton, turns: list[int]
):
    # A lift into space trembles too much for lengths of bones to tell.
    tremble = np.random.default_rng(3).normal(scale=0.03, size=(12, 17, 3))
    joints = (in_order(skeleton, moving_joints()) + tremble) @ Rotation.from_euler(
        "yz", turns, degrees=True
    ).as_matrix().T
    sure = np.full((12, 17, 1), 0.9)
    pictures = [joints[..., :2] * [200, side] + 600 for side in (200, -200)]
    flat = [np.append(picture, sure, axis=2).reshape(12, 51) for picture in pictures]
    for places in (joints, *pictures, *flat):
        file = read_motion(saved(tmp_path / "d.npy", places), fps=30)
        order = [note.brief for note in file.assumptions if note.brief.startswith("order of joints")]
        assert file.motion.skeleton == skeleton
        assert order == ([] if skeleton == COCO_17 else ["order of joints guessed: Human3.6M"])


def test_17_joints_of_an_order_that_is_neither_are_said_to_be_in_doubt(tmp_path: Path):
    joints = moving_joints()[:, [15, 12, 17, 19, 21, 16, 18, 20, 2, 5, 8, 1, 4, 7, 0, 6, 15]]  # MPI-INF-3DHP
    for places in (joints, joints[..., :2] * 200 + 600):
        file = read_motion(saved(tmp_path / "d.npy", places), fps=30)
        assert "order of joints in doubt" in [note.brief for note in file.assumptions]


@cases("skeleton", HUMAN36M_17, COCO_17)
def test_17_joints_are_those_of_the_skeleton_whose_bones_keep_their_lengths(tmp_path: Path, skeleton: Skeleton):
    joints = swinging_bones(skeleton) + np.random.default_rng(3).normal(scale=0.01, size=(60, 17, 3))
    motion, kind, _ = read_motion(saved(tmp_path / "d.npy", joints), fps=30, scale=1.0, up="y")
    assert motion.skeleton == skeleton
    assert kind == f"17 joints of {'COCO' if skeleton == COCO_17 else 'Human3.6M'}"
    np.testing.assert_allclose(motion.positions, joints)


def test_vectors_of_motion_x_hold_smpl_parameters(tmp_path: Path):
    poses, way, joints = placed()
    vectors = np.full((12, 322), 7.0)  # hands and face are nonsense
    vectors[:, :66], vectors[:, 309:312], vectors[:, 312:] = poses[:, :22].reshape(12, 66), way, 0.0
    motion, kind, _ = read_motion(saved(tmp_path / "v.npy", vectors), fps=30)
    assert (motion.skeleton, kind) == (SMPL_24, "SMPL-X vectors of Motion-X")
    np.testing.assert_allclose(motion.positions, joints, atol=1e-9)


# HumanML3D


def humanml_vectors(joints: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """(T - 1, 263) vectors of joints (T, 22, 3) that face `headings` (T), radians from +z towards +x."""
    into = [rodrigues(np.array([0, -angle, 0])) for angle in headings]  # world to body
    vectors = np.full((len(joints) - 1, 263), 7.0)  # what is not looked at is nonsense here
    for frame, vector in enumerate(vectors):
        vector[0] = (headings[frame] - headings[frame + 1]) / 2  # half the angle of the turn into the body's frame
        vector[1:3] = (into[frame + 1] @ (joints[frame + 1, 0] - joints[frame, 0]))[[0, 2]]
        vector[3] = joints[frame, 0, 1]
        vector[4:67] = ((joints[frame, 1:] - joints[frame, 0] * [1, 0, 1]) @ into[frame].T).ravel()
    return vectors


def test_humanml_vectors_give_back_the_joints_they_were_made_of(tmp_path: Path):
    headings = 0.9 * np.sin(np.linspace(0, 4, 30))
    poses, _ = dance(30)
    poses[:, 0] = np.stack([headings * 0, headings, headings * 0], axis=1)
    way = np.stack([np.sin(np.linspace(0, 2, 30)), 0.95 + 0.05 * np.cos(headings), np.linspace(0, 1.5, 30)], axis=1)
    way[:, [0, 2]] -= way[0, [0, 2]]
    joints = loop_joints(poses, way, REST - REST[[0, *TREE[1:]]])[:, :22]
    path = saved(tmp_path / "012314.npy", humanml_vectors(joints, headings).astype(np.float32))
    asks_for_rate(path, "--fps 20 for HumanML3D's own")
    motion, kind, _ = read_motion(path, fps=20)
    assert (motion.skeleton, motion.fps, kind) == (SMPL_22, 20, "HumanML3D vectors")
    np.testing.assert_allclose(motion.positions, joints[:-1], atol=1e-5)


def test_normalised_humanml_vectors_are_refused(tmp_path: Path):
    for values in (np.zeros((9, 263)), np.full((9, 263), 50.0) * np.arange(263)):
        path = saved(tmp_path / "v.npy", values)
        refused(r"v\.npy: .*multiply by Std\.npy and add Mean\.npy", load_motion, path, fps=20)


# c3d


def markers(path: Path, points: np.ndarray, names: tuple[str, ...], **parameters: Any) -> Path:
    """A c3d file of points (T, J, 3) that ezc3d writes."""
    content = ezc3d.c3d()
    for name, value in {"RATE": [120.0], "LABELS": names, "UNITS": ["mm"], **parameters}.items():
        if name in content["parameters"]["POINT"]:
            content["parameters"]["POINT"][name]["value"] = value
        else:
            content.add_parameter("POINT", name, value)
    content["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2).transpose(2, 1, 0)
    content.write(str(path))
    return path


def suit() -> np.ndarray:
    """(20, 4, 3) markers of two temples and two toes, millimetres, z up."""
    points = np.array([[80, 0, 1650], [-80, 0, 1650], [120, 100, 30], [-120, 100, 30]], float)
    return points + np.random.default_rng(5).normal(size=(20, 4, 3)).cumsum(axis=0)


NAMES = ("LFHD", "RFHD", "LTOE", "RTOE")


def test_markers_are_metres_at_the_rate_of_their_file(tmp_path: Path):
    motion, kind, notes = read_motion(markers(tmp_path / "walk.c3d", suit(), NAMES))
    assert (motion.fps, motion.skeleton.joints, kind) == (120, NAMES, "c3d markers")
    np.testing.assert_allclose(to_z_up(motion.positions), suit() / 1000, atol=1e-6)
    assert motion.valid.all()
    assert notes[0] == "in mm (POINT:UNITS)"
    assert notes[1].startswith("z up (guessed: the head is 1.6")


def test_what_a_model_wrote_beside_the_markers_is_no_joint(tmp_path: Path):
    names, points = (*NAMES, "LKneeMoments", "LAnkleAngles"), np.concatenate([suit(), 1e5 * suit()[:, :2]], axis=1)
    more = {"MOMENTS": ["LKneeMoments"], "ANGLES2": ["LAnkleAngles"]}
    motion, _, notes = read_motion(markers(tmp_path / "gait.c3d", points, names, **more))
    assert motion.skeleton.joints == NAMES
    assert notes[-1] == "2 points left out that are no markers: LKneeMoments, LAnkleAngles"
    asked, _, notes = read_motion(tmp_path / "gait.c3d", joints=names, up="z")
    assert asked.skeleton.joints == names and not any("left out" in note for note in notes)
    alone = markers(tmp_path / "alone.c3d", points[:, 4:], names[4:], **more)
    refused(r"alone\.c3d: holds no markers: all of its points are angles, forces and the like", load_motion, alone)


@cases(
    "pieces", ("*12", "*113", "*7"), ("Anna:*1", "Anna:*2", "Anna:*3"), ("Unlabeled 17", "Unlabeled_2", "unlabelled")
)
def test_pieces_of_tracks_that_nobody_labelled_hide_no_frame_of_the_body(tmp_path: Path, pieces: tuple[str, ...]):
    seldom = np.full((20, 3, 3), np.nan)
    seldom[5:7] = suit()[5:7, :3]
    points, names = np.concatenate([suit(), seldom], axis=1), (*NAMES, *pieces)
    motion, _, notes = read_motion(markers(tmp_path / "raw.c3d", points, names))
    assert motion.skeleton.joints == NAMES and motion.valid.all()
    assert notes[-1] == f"3 points left out that are no labelled markers: {', '.join(pieces)}"
    bare = markers(tmp_path / "bare.c3d", suit()[:, :3], pieces)
    assert load_motion(bare, up="z").skeleton.joints == pieces


def test_the_screen_of_a_c3d_file_tells_which_axis_points_up(tmp_path: Path):
    path = markers(tmp_path / "d.c3d", suit(), ("a", "b", "c", "d"), X_SCREEN=["+X"], Y_SCREEN=["+Z"])
    motion, _, notes = read_motion(path)
    np.testing.assert_allclose(to_z_up(motion.positions), suit() / 1000, atol=1e-6)
    assert notes[1] == "z up (POINT:Y_SCREEN of the file), turned to y up"
    refused(r"n\.c3d: does not tell which axis points up", load_motion, markers(tmp_path / "n.c3d", suit(), (*"abcd",)))
    np.testing.assert_allclose(load_motion(tmp_path / "n.c3d", up="y").positions, suit() / 1000, atol=1e-6)


def test_a_missing_marker_is_filled_in_and_its_frame_marked_and_a_file_that_is_cut_off_is_refused(tmp_path: Path):
    points = suit()
    points[4:6, 0] = points[9, :2] = np.nan
    motion = load_motion(markers(tmp_path / "gap.c3d", points, NAMES))
    assert np.flatnonzero(~motion.valid).tolist() == [9]  # half of the markers
    # A third of the way from frame 3 to frame 6, as seen from the middle of all markers.
    points[4, 0] = points[3, 0] + (points[6, 0] - points[3, 0]) / 3
    middle = points.mean(axis=1)
    ends = points[[3, 6], 0] - middle[[3, 6]]
    expected = middle[4] + ends[0] + (ends[1] - ends[0]) / 3
    np.testing.assert_allclose(to_z_up(motion.positions)[4, 0] * 1000, expected, atol=1e-3)
    points[:, 1] = np.nan
    (tmp_path / "cut.c3d").write_bytes((tmp_path / "gap.c3d").read_bytes()[:-448])
    refused(r"cut\.c3d: is cut off or damaged: 17 of 20 frames are there", load_motion, tmp_path / "cut.c3d")
    never = markers(tmp_path / "never.c3d", points, NAMES)
    refused(r"never\.c3d: never shows RFHD; keep the other joints only", load_motion, never)
    assert load_motion(never, joints=["LFHD", "LTOE"]).skeleton.joints == ("LFHD", "LTOE")


@pytest.mark.data
def test_a_recorded_dancer_in_markers_stands_upright(data_root: Path):
    motion, _, notes = read_motion(data_root / "extra" / "choreonet" / "mm_tg_03_1.c3d")
    assert (motion.positions.shape, motion.fps) == ((574, 41, 3), 80)
    assert notes[1].startswith("z up (guessed: the head is 1.55 m from the feet")
    assert 1.5 < standing_height(motion.positions) < 2.0


def test_unknown_units_of_a_c3d_file_need_a_scale_and_a_missing_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = markers(tmp_path / "feet.c3d", suit(), NAMES, UNITS=["furlong"])
    refused(r"feet\.c3d: has points in 'furlong'; pass scale", load_motion, path)
    assert standing_height(load_motion(path, scale=0.001).positions) == pytest.approx(1.62, abs=0.05)
    monkeypatch.setattr(c3d_reader, "find_spec", lambda name: None)
    refused(r"feet\.c3d: to read c3d, install ezc3d: pip install ezc3d", load_motion, path)


@pytest.mark.slow
def test_damaged_c3d_gives_a_finite_motion_or_an_error_and_never_hangs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(c3d_reader, "SECONDS", 1.5)
    valid = markers(tmp_path / "walk.c3d", suit(), NAMES).read_bytes()
    rng, faults = np.random.default_rng(8), 0
    for _ in range(10):
        data = bytearray(valid)
        for place in rng.integers(len(data) if rng.random() < 0.5 else 700, size=4):
            data[place] = rng.integers(256)
        (tmp_path / "bad.c3d").write_bytes(data[: rng.integers(1, len(data)) if rng.random() < 0.3 else None])
        try:
            assert np.isfinite(load_motion(tmp_path / "bad.c3d").positions).all()
        except ValueError as error:
            faults += 1
            assert str(error).startswith(str(tmp_path / "bad.c3d"))
    assert faults > 0


# Hostile content


def parameters(**changes: Any) -> dict[str, Any]:
    poses, way = dance()
    return {"smpl_poses": poses.reshape(-1, 72), "smpl_trans": way, "smpl_scaling": np.ones(1)} | changes


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (parameters(smpl_poses=np.zeros((12, 71))), r"smpl_poses must be axis-angle .*got shape \(12, 71\)"),
        (parameters(smpl_poses=np.zeros(72)), "smpl_poses must be axis-angle"),
        (parameters(smpl_poses=np.full((12, 72), np.nan)), "smpl_poses holds NaN or infinity at frame 0, joint 0"),
        (parameters(smpl_poses=np.full((12, 72), 170.0)), "angles up to 170 radians; are these degrees"),
        (parameters(smpl_poses=np.zeros((12, 144))), "rows span no plane"),
        (parameters(smpl_poses=np.zeros((11, 72))), "rotations of 11 frames and a translation of 12"),
        (parameters(smpl_poses=np.zeros((0, 72)), smpl_trans=np.zeros((0, 3))), ""),
        (parameters(smpl_poses=np.zeros((1, 72)), smpl_trans=np.zeros((1, 3))), "at least two frames"),
        (parameters(smpl_trans=np.full((12, 3), np.inf)), "NaN or infinity at frame 0"),
        (parameters(smpl_trans=np.zeros((12, 2))), r"translation must have shape \(T, 3\), got \(12, 2\)"),
        (parameters(smpl_scaling=np.zeros(1)), "smpl_scaling must lie between"),
        (parameters(smpl_scaling=np.ones(2)), "smpl_scaling must be one number"),
        ({"pose_body": np.zeros((12, 63)), "trans": np.zeros((12, 3))}, "has no array root_orient"),
        (parameters(smpl_trans="none"), "has no array smpl_trans of numbers"),
        ({"smpl_poses": np.zeros((12, 72))}, "has no array smpl_trans"),
        ({"full_pose": np.zeros((12, 23, 3))}, r"full_pose must have shape \(T, 24, 3\)"),
        ({"full_pose": np.full((12, 24, 3), np.nan)}, "NaN or infinity"),
        ({"pred_position": np.zeros((12, 70))}, r"joints must have shape"),
        ({"pred_position": [[1, 2], [3]]}, "joints must be numbers"),
        ({"pred_position": np.full((12, 72), np.inf)}, "NaN or infinity at frame 0"),
        ({"anything": np.zeros(3)}, "has no array keypoints3d"),
    ],
)  # fmt: skip
def test_parameters_that_make_no_motion_are_refused_by_name(tmp_path: Path, content: dict[str, Any], fault: str):
    refused(rf"bad\.pkl: .*{fault}", load_motion, pickled(tmp_path / "bad.pkl", **content), fps=30)


def test_objects_in_an_array_file_are_refused_and_run_nothing(tmp_path: Path):
    call = Malicious(open, str(tmp_path / "ran"), "w")
    for content in (call, {"pred_position": call}, [call]):
        refused(r"evil\.npy", load_motion, saved(tmp_path / "evil.npy", np.array(content, dtype=object)), fps=30)
        np.savez(tmp_path / "evil.npz", poses=np.array([content], dtype=object), trans=np.zeros((2, 3)))
        refused(r"evil\.npz", load_motion, tmp_path / "evil.npz", fps=30)
    assert not (tmp_path / "ran").exists()


# What the commands say


def test_check_says_what_each_file_of_a_folder_is_and_how_it_was_read(tmp_path: Path):
    pickled(tmp_path / f"{AIST}.pkl", **parameters(smpl_trans=dance()[1] * 90, smpl_scaling=np.array([90.0])))
    markers(tmp_path / "suit.c3d", suit(), NAMES)
    saved(tmp_path / "joints.npy", to_z_up(moving_joints()) * 100)
    rows = {Path(row.path).name: row for row in check(tmp_path)}
    aist, capture, joints = rows[f"{AIST}.pkl"], rows["suit.c3d"], rows["joints.npy"]
    assert (aist.kind, aist.rate, aist.joints, aist.note) == ("motion", 60, 24, "3-D, AIST++ SMPL parameters")
    assert "translation divided by smpl_scaling, 90" in aist.how
    assert (capture.rate, capture.note, capture.how[0]) == (120, "3-D, c3d markers", "in mm (POINT:UNITS)")
    assert (joints.rate, joints.odd[0]) == (None, "holds no frame rate: pass fps (--fps)")
    assert joints.how[0].startswith("centimetres (guessed")
    assert "read: joints.npy: z up (guessed" in " ".join(called(app, "data", "check", tmp_path).stdout.split())


def test_convert_writes_what_it_read_and_says_how(tmp_path: Path):
    poses, way, expected = z_up_parameters()
    source = pickled(tmp_path / "edge.pkl", smpl_poses=poses, smpl_trans=way, full_pose=to_z_up(expected))
    said = " ".join(done(app, "data", "convert", source, tmp_path / "dance.npz", "--fps", "30").stdout.split())
    assert "EDGE's joints, 12 frames of 24 joints at 30 a second read: joints of full_pose" in said
    assert "read: z up (as EDGE writes), turned to y up" in said
    motion = load_motion(tmp_path / "dance.npz")
    np.testing.assert_allclose(motion.positions, expected, atol=1e-9)
    done(app, "data", "convert", tmp_path / "dance.npz", tmp_path / "dance.bvh")
    back = load_motion(tmp_path / "dance.bvh")
    order = [back.skeleton.joints.index(name) for name in motion.skeleton.joints]
    np.testing.assert_allclose(back.positions[:, order], expected, atol=1e-3)


def test_convert_takes_a_body_and_an_axis(tmp_path: Path):
    poses, way = dance()
    np.savez(tmp_path / "smpl.npz", J=REST, kintree_table=tree_of(TREE))
    source = pickled(tmp_path / "d.pkl", smpl_poses=poses.reshape(-1, 72), smpl_trans=way)
    options = ("--fps", "30", "--smpl", tmp_path / "smpl.npz", "--up", "y", "--joints", "left_hip, left_knee")
    done(app, "data", "convert", source, tmp_path / "out.npz", *options)
    motion = load_motion(tmp_path / "out.npz")
    assert motion.skeleton.joints == ("left_hip", "left_knee")
    np.testing.assert_allclose(np.linalg.norm(np.diff(motion.positions, axis=1), axis=2), 0.4, atol=1e-9)


def test_convert_overwrites_nothing_unasked(tmp_path: Path):
    source = saved(tmp_path / "joints.npy", moving_joints())
    taken = tmp_path / "taken.npz"
    taken.write_bytes(b"of somebody else")
    np.savez(tmp_path / "own.npz", positions=moving_joints(), fps=30.0)
    for arguments, fault in (
        ((source, taken, "--fps", "30"), "taken.npz: is there already; --force writes over it"),
        ((tmp_path / "own.npz", tmp_path / "own.npz", "--force"), "is an input here"),
        ((source, tmp_path / "out.npy", "--fps", "30"), "a motion is written as .npz, .bvh"),
        ((source, tmp_path / "out.npz"), "joints.npy: holds no frame rate; pass fps, such as --fps 25"),
        ((source, tmp_path / "none" / "out.npz", "--fps", "30"), "no such folder"),
    ):
        assert fault in complaint(app, "data", "convert", *arguments)
    assert taken.read_bytes() == b"of somebody else"
    assert not (tmp_path / "out.npz").exists()
    done(app, "data", "convert", source, taken, "--fps", "30", "--force")
    assert load_motion(taken).n_frames == 12
