"""MediaPipe landmarks: values by hand, gaps, and files that are none."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.readers.keypoints import MEDIAPIPE_33, keypoints_motion, load_keypoints
from tests.builders import cases, refused


def frame(x: float, visibility: float = 0.9) -> list[dict[str, float]]:
    return [{"x": x, "y": 0.1 * joint, "z": -0.5, "visibility": visibility} for joint in range(33)]


def saved(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "dance.json"
    path.write_text(json.dumps(content), "utf-8")
    return path


def test_skeleton_is_one_tree_of_33_joints():
    assert len(MEDIAPIPE_33.joints) == len(set(MEDIAPIPE_33.joints)) == 33
    assert MEDIAPIPE_33.joints[23] == "left_hip"
    assert [joint for joint, parent in enumerate(MEDIAPIPE_33.parents) if parent < 0] == [0]
    assert all(parent < joint for joint, parent in enumerate(MEDIAPIPE_33.parents))


def test_image_landmarks_become_2d_with_equal_units(tmp_path: Path):
    motion = load_keypoints(saved(tmp_path, [frame(0.2), frame(0.4)]), fps=25, aspect=2.0)
    np.testing.assert_allclose(motion.positions[:, 5], [[0.4, 0.5], [0.8, 0.5]])
    assert (motion.fps, motion.skeleton) == (25, MEDIAPIPE_33)


def test_world_landmarks_become_3d_with_y_up(tmp_path: Path):
    motion = load_keypoints(saved(tmp_path, [frame(0.2), frame(0.4)]), fps=25, world=True)
    np.testing.assert_allclose(motion.positions[0, 5], [0.2, -0.5, 0.5])


def test_rate_in_the_file_is_taken_and_one_given_takes_its_place(tmp_path: Path):
    path = saved(tmp_path, {"fps": 30.0, "frames": [frame(0.2), {"landmarks": frame(0.4)}]})
    assert load_keypoints(path).fps == 30
    assert load_keypoints(path, fps=24).fps == 24


def test_frames_without_anybody_are_filled_and_marked(tmp_path: Path):
    motion = load_keypoints(saved(tmp_path, [frame(0.2), None, [], frame(0.5), frame(0.5, 0.2)]), fps=25)
    np.testing.assert_allclose(motion.positions[:4, 0, 0], [0.2, 0.3, 0.4, 0.5])
    assert motion.valid.tolist() == [True, False, False, True, False]


def test_joints_can_be_chosen_by_name(tmp_path: Path):
    path = saved(tmp_path, [frame(0.2), frame(0.4)])
    motion = load_keypoints(path, fps=25, joints=("left_hip", "left_knee"))
    assert (motion.skeleton.joints, motion.skeleton.bones) == (("left_hip", "left_knee"), ((0, 1),))
    refused(r"no joints named \['tail'\]", load_keypoints, path, fps=25, joints=("tail",))


def test_array_with_and_without_visibility_is_read(tmp_path: Path):
    values = np.random.default_rng(0).uniform(0, 1, (4, 33, 4))
    values[:, :, 3] = 1.0
    values[2] = np.nan
    np.save(tmp_path / "dance.npy", values)
    motion = load_keypoints(tmp_path / "dance.npy", fps=25)
    assert motion.valid.tolist() == [True, True, False, True]
    np.testing.assert_allclose(motion.positions[2], (values[1, :, :2] + values[3, :, :2]) / 2)
    assert keypoints_motion(values[:2, :, :3], 25).valid.all()


@cases(
    "content, fault",
    ([], "holds a list of 0, which is neither MediaPipe landmarks"),
    ({"frames": 3}, "holds an object with 'frames', which is neither MediaPipe landmarks"),
    ("text", "holds 'text', which is neither MediaPipe landmarks"),
    ({"frames": [frame(0.1)], "world": "yes"}, "world must be true or false, got 'yes'"),
    ([frame(0.1)[:32]], "frame 0 is no list of 33 landmarks"),
    ([frame(0.1), 7], "frame 1 is no list of 33 landmarks"),
    ([[{"x": 1, "y": 2}] * 33], "frame 0 has a landmark without z"),
    ([[{"x": "far", "y": 2, "z": 3}] * 33], "frame 0 must be numbers"),
    ([[{"x": float("nan"), "y": 2, "z": 3}] * 33], "NaN or infinity in frame 0"),
    ([None, None], "nobody is seen in any of its 2 frames"),
    ([frame(0.1)], "at least two frames"),
)
def test_damaged_landmarks_are_refused_by_name(tmp_path: Path, content: Any, fault: str):
    refused(rf"dance\.json: .*{fault}", load_keypoints, saved(tmp_path, content), fps=25)


@pytest.mark.parametrize("text", ["", "{", "[1, 2", '{"fps": 30}'])
def test_files_that_are_no_json_of_landmarks_are_refused(tmp_path: Path, text: str):
    path = tmp_path / "dance.json"
    path.write_text(text)
    refused(r"dance\.json: ", load_keypoints, path, fps=25)


def test_rate_aspect_shape_and_suffix_are_checked(tmp_path: Path):
    path = saved(tmp_path, [frame(0.2), frame(0.4)])
    refused("holds key points but no frame rate; pass fps", load_keypoints, path)
    refused("aspect is width over height", load_keypoints, path, fps=25, aspect=0.0)
    refused(r"has shape \(2, 33, 5\)", keypoints_motion, np.zeros((2, 33, 5)), 25)
    (tmp_path / "dance.csv").write_text("x,y")
    refused(r"dance\.csv: cannot be read as key points", load_keypoints, tmp_path / "dance.csv", fps=25)
    with pytest.raises(FileNotFoundError, match="no such file"):
        load_keypoints(tmp_path / "none.json", fps=25)
