"""Motion to BVH: what our reader gives back, and what other programs need."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.readers.bvh import load_bvh, save_bvh
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import Motion
from tests.builders import ARM, cases, refused

# A root with three children that keep together, an arm on one of them; listed out of order, child before parent.
BODY = Skeleton(("hand L", "hip L", "torso", "hip R", "neck", "elbow L"), (5, 2, -1, 2, 2, 4))
REST = np.array([[0.6, 0.9, 0.1], [0.1, -0.1, 0.0], [0, 0, 0], [-0.1, -0.1, 0.0], [0.0, 0.5, 0.05], [0.3, 0.6, 0.0]])


def places(motion: Motion, of: Skeleton) -> np.ndarray:
    """Positions in the order of another skeleton's joints."""
    return motion.positions[:, [motion.skeleton.joints.index(name) for name in of.joints]]


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
    lines = [line.split() for line in path.read_text().splitlines()]
    found, name = {}, ""
    for words in lines:
        if words[0] in ("ROOT", "JOINT"):
            name = " ".join(words[1:])
        elif words[0] == "CHANNELS":
            found[name] = int(words[1])
    return found


def test_straight_arm_along_x_has_its_bones_as_offsets_in_centimetres(tmp_path: Path):
    positions = np.array([[[0, 1, 0], [0.3, 1, 0], [0.5, 1, 0]], [[0, 1, 0], [0.3, 1, 0], [0.3, 1.2, 0]]])
    save_bvh(tmp_path / "arm.bvh", Motion(positions, 25, ARM))
    lines = [" ".join(line.split()) for line in (tmp_path / "arm.bvh").read_text().splitlines()]
    assert lines[:6] == [
        "HIERARCHY",
        "ROOT shoulder",
        "{",
        "OFFSET 0.000000 0.000000 0.000000",
        "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
        "JOINT elbow",
    ]
    assert "OFFSET 30.000000 0.000000 0.000000" in lines
    assert "OFFSET 20.000000 0.000000 0.000000" in lines
    head = lines.index("MOTION")
    assert lines[head + 1 : head + 3] == ["Frames: 2", "Frame Time: 0.04"]
    first, second = (np.array(line.split(), float) for line in lines[head + 3 :])
    np.testing.assert_allclose(first, [0, 100, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], atol=1e-6)
    # The hand went from along x to along y: a quarter turn about z in the elbow.
    np.testing.assert_allclose(second, [0, 100, 0, 0, 0, 0, 90, 0, 0, 0, 0, 0], atol=1e-6)


def test_rigid_body_comes_back_from_rotations_alone(tmp_path: Path):
    positions = turned(BODY, REST, 80)
    save_bvh(tmp_path / "body.bvh", Motion(positions, 15, BODY))
    back = load_bvh(tmp_path / "body.bvh")
    np.testing.assert_allclose(places(back, BODY), positions, atol=1e-6)
    assert back.fps == 15
    assert channels(tmp_path / "body.bvh") == {
        "torso": 6, "hip L": 3, "hip R": 3, "neck": 3, "elbow L": 3, "hand L": 3
    }  # fmt: skip


def test_parents_stay_parents(tmp_path: Path):
    save_bvh(tmp_path / "body.bvh", Motion(turned(BODY, REST, 5), 15, BODY))
    back = load_bvh(tmp_path / "body.bvh").skeleton
    pairs = {(back.joints[p], back.joints[c]) for p, c in back.bones}
    assert pairs == {(BODY.joints[p], BODY.joints[c]) for p, c in BODY.bones}
    assert len(back.joints) == len(BODY.joints)


def test_only_the_stretching_bone_gets_position_channels(tmp_path: Path):
    positions = turned(BODY, REST, 60)
    hand, elbow = 0, 5
    stretch = 1 + 0.2 * np.sin(np.arange(60))[:, None]
    positions[:, hand] = positions[:, elbow] + stretch * (positions[:, hand] - positions[:, elbow])
    save_bvh(tmp_path / "body.bvh", Motion(positions, 15, BODY))
    np.testing.assert_allclose(places(load_bvh(tmp_path / "body.bvh"), BODY), positions, atol=1e-6)
    assert {name for name, count in channels(tmp_path / "body.bvh").items() if count == 6} == {"torso", "hand L"}


def test_soft_torso_comes_back(tmp_path: Path):
    positions = turned(BODY, REST, 60)
    positions[:, 3] += 0.05 * np.sin(np.arange(60))[:, None]  # one hip on its own
    save_bvh(tmp_path / "body.bvh", Motion(positions, 15, BODY))
    np.testing.assert_allclose(places(load_bvh(tmp_path / "body.bvh"), BODY), positions, atol=1e-4)


@given(seed=st.integers(0, 10_000), frames=st.integers(2, 12))
def test_any_movement_of_any_tree_comes_back(tmp_path_factory: pytest.TempPathFactory, seed: int, frames: int):
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(0, joint)) for joint in range(1, 9))]
    shuffle = rng.permutation(9)
    inverse = np.argsort(shuffle)
    mixed = tuple(-1 if parents[joint] < 0 else int(inverse[parents[joint]]) for joint in shuffle)
    skeleton = Skeleton(tuple(f"j{i}" for i in range(9)), mixed)
    positions = rng.normal(size=(frames, 9, 3))
    path = tmp_path_factory.mktemp("tree") / "any.bvh"
    save_bvh(path, Motion(positions, 30, skeleton))
    np.testing.assert_allclose(places(load_bvh(path), skeleton), positions, atol=1e-6)


def test_synthetic_dancer_comes_back_through_save_motion(tmp_path: Path):
    motion = synthetic_clip("waltz", seed=1).motion
    save_motion(tmp_path / "waltz.bvh", motion)
    back = load_motion(tmp_path / "waltz.bvh")
    np.testing.assert_allclose(places(back, motion.skeleton), motion.positions, atol=1e-6)


def test_quarter_turn_where_two_angles_become_one_comes_back(tmp_path: Path):
    # The bone stands along -z: a turn of exactly 90 degrees about x.
    bone = np.array([[0, 0.3, 0], [0, 0, 0.3], [0, 0.3, 0], [0.3, 0, 0], [0, -0.3, 0]], float)
    positions = np.stack([np.zeros((5, 3)), bone, 2 * bone], axis=1)
    save_bvh(tmp_path / "arm.bvh", Motion(positions, 15, ARM))
    np.testing.assert_allclose(load_bvh(tmp_path / "arm.bvh").positions, positions, atol=1e-6)


def test_angles_go_on_beyond_half_a_turn_without_a_jump(tmp_path: Path):
    angle = np.linspace(0, 4 * np.pi, 60)
    bone = np.stack([np.cos(angle), np.sin(angle), np.zeros(60)], axis=1)
    save_bvh(tmp_path / "arm.bvh", Motion(np.stack([np.zeros((60, 3)), bone, 2 * bone], axis=1), 15, ARM))
    table = np.loadtxt((tmp_path / "arm.bvh").read_text().split("Frame Time:")[1].splitlines()[1:])
    assert table[-1, 3] == pytest.approx(720, abs=1e-4)
    assert np.abs(np.diff(table[:, 3:], axis=0)).max() < 15


def test_bone_of_no_length_and_a_dancer_of_a_centimetre_come_back(tmp_path: Path):
    positions = turned(ARM, np.array([[0, 0, 0], [0.01, 0, 0], [0.01, 0, 0]]), 20)
    save_bvh(tmp_path / "arm.bvh", Motion(positions, 15, ARM))
    np.testing.assert_allclose(load_bvh(tmp_path / "arm.bvh").positions, positions, atol=1e-6)


def test_every_branch_ends_in_an_end_site_of_no_length(tmp_path: Path):
    save_bvh(tmp_path / "body.bvh", Motion(turned(BODY, REST, 5), 15, BODY))
    text = " ".join((tmp_path / "body.bvh").read_text().split())
    assert text.count("End Site { OFFSET 0 0 0 }") == 3
    assert text.count("{") == text.count("}")


def test_end_site_of_some_length_is_still_a_joint(tmp_path: Path):
    save_bvh(tmp_path / "arm.bvh", Motion(turned(ARM, np.eye(3), 3), 15, ARM))
    text = (tmp_path / "arm.bvh").read_text()
    (tmp_path / "long.bvh").write_text(text.replace("OFFSET 0 0 0\n", "OFFSET 0 5 0\n"))
    assert load_bvh(tmp_path / "long.bvh").skeleton.joints == ("shoulder", "elbow", "hand", "hand_end")


def test_names_that_bvh_cannot_hold_are_changed_and_stay_apart(tmp_path: Path):
    skeleton = Skeleton(("MOTION{", "a b", "a b"), (-1, 0, 1))
    save_bvh(tmp_path / "names.bvh", Motion(turned(ARM, np.eye(3), 3), 15, skeleton))
    assert load_bvh(tmp_path / "names.bvh").skeleton.joints == ("Motion_", "a b", "a b_2")


@cases(
    "skeleton, fault",
    (Skeleton.unnamed(3), "has 3 joints and 3 roots; save it as .npz"),
    (Skeleton(("a", "b", "c"), (-1, 2, 1)), "form a ring"),
    (Skeleton(("a", "b", "c"), (1, 2, 0)), "0 roots"),
)
def test_skeleton_that_is_no_tree_is_refused_by_file(tmp_path: Path, skeleton: Skeleton, fault: str):
    refused(rf"dance\.bvh: .*{fault}", save_bvh, tmp_path / "dance.bvh", Motion(np.zeros((4, 3, 3)), 15, skeleton))
    assert list(tmp_path.iterdir()) == []


def test_image_coordinates_are_refused(tmp_path: Path):
    refused(r"flat\.bvh: .*image coordinates", save_bvh, tmp_path / "flat.bvh", Motion(np.zeros((4, 3, 2)), 15, ARM))


def test_failed_save_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "arm.bvh"
    save_bvh(path, Motion(turned(ARM, np.eye(3), 3), 15, ARM))
    before = path.read_bytes()

    def fail(*_args: object, **_named: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(np, "savetxt", fail)
    with pytest.raises(OSError, match="disk full"):
        save_bvh(path, Motion(turned(ARM, np.eye(3), 9), 15, ARM))
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["arm.bvh"]
