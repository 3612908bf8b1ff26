"""Musicians in the files of pose estimators: every point under its own name, left and right the player's."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.files import MissingFrameRate
from harmolab.musician.keypoints import NAMES, PlayerPoints, load_player_points, player_points
from harmolab.readers.keypoints import COCO_17, MEDIAPIPE_33, OPENPOSE_18, OPENPOSE_25
from harmolab.readers.player_points import PLAYER_50, hand_joints
from tests.builders import cases, refused

# A pose that no mirror and no swap leaves alone: every point at a place of its own, the left at small x, on a picture
# of 640 by 480. Body points at y = 100, the left hand at 200, the right at 300.
SIZE = (640, 480)
POSE = {name: (10.0 + number, 100.0) for number, name in enumerate(PLAYER_50.joints[:8])}
POSE |= {name: (100.0 + number, 200.0) for number, name in enumerate(hand_joints("left"))}
POSE |= {name: (400.0 + number, 300.0) for number, name in enumerate(hand_joints("right"))}
LEFT, RIGHT = hand_joints("left"), hand_joints("right")


def flat(names: tuple[str, ...], shift: float = 0.0, sure: float = 0.9) -> list[float]:
    """x, y, confidence of points by name, one after the other; points of no name at 0 with 0."""
    rows = [(POSE[name][0] + shift, POSE[name][1], sure) if name in POSE else (0.0, 0.0, 0.0) for name in names]
    return [number for row in rows for number in row]


def openpose(shift: float = 0.0, body: tuple[str, ...] = OPENPOSE_25.joints, sure: float = 0.9) -> dict[str, Any]:
    return {
        "pose_keypoints_2d": flat(body, shift, sure),
        "hand_left_keypoints_2d": flat(LEFT, shift, sure),
        "hand_right_keypoints_2d": flat(RIGHT, shift, sure),
    }


def openpose_folder(folder: Path, frames: list[list[dict[str, Any]]]) -> Path:
    folder.mkdir(parents=True)
    for number, people in enumerate(frames):
        (folder / f"take_{number:012d}_keypoints.json").write_text(json.dumps({"version": 1.3, "people": people}))
    return folder


def saved(tmp_path: Path, content: Any, name: str = "points.json") -> Path:
    (tmp_path / name).write_text(json.dumps(content))
    return tmp_path / name


def landmarks(names: tuple[str, ...], shift: float = 0.0, **more: float) -> list[dict[str, float]]:
    """Landmarks as shares of the picture."""
    places = [POSE.get(name, (0.0, 0.0)) for name in names]
    return [{"x": (x + shift) / SIZE[0], "y": y / SIZE[1], "z": 0.0, **more} for x, y in places]


def holistic(shift: float = 0.0) -> dict[str, Any]:
    return {
        "pose_landmarks": landmarks(MEDIAPIPE_33.joints, shift, visibility=0.8),
        "left_hand_landmarks": landmarks(LEFT, shift, visibility=0.0),
        "right_hand_landmarks": landmarks(RIGHT, shift, visibility=0.0),
    }


def places(points: PlayerPoints, frame: int = 0) -> dict[str, tuple[float, float]]:
    rows = points.motion.positions[frame].tolist()
    return {name: (x, y) for name, (x, y) in zip(points.motion.skeleton.joints, rows, strict=True)}


def assert_pose(points: PlayerPoints, names: tuple[str, ...] = PLAYER_50.joints) -> None:
    assert points.motion.skeleton.joints == names
    assert places(points) == {name: pytest.approx(POSE[name]) for name in names}
    assert points.detected.all()


WHOLE_133 = (*COCO_17.joints, *("",) * 74, *LEFT, *RIGHT)
WHOLE_136 = (*COCO_17.joints, *("",) * 77, *LEFT, *RIGHT)


@pytest.mark.parametrize("body", [OPENPOSE_25, OPENPOSE_18])
def test_openpose_gives_body_and_hands_by_name(tmp_path: Path, body: Any):
    folder = openpose_folder(tmp_path / "frames", [[openpose(shift, body.joints)] for shift in (0, 1)])
    points = load_player_points(folder, fps=25)
    assert_pose(points)
    assert (points.motion.skeleton, points.motion.fps) == (PLAYER_50, 25)
    np.testing.assert_allclose(points.confidence, 0.9)
    np.testing.assert_allclose(points.motion.positions[1] - points.motion.positions[0], [[1, 0]] * 50)


@pytest.mark.parametrize("names", [WHOLE_133, WHOLE_136])
def test_whole_body_points_are_read_by_name(tmp_path: Path, names: tuple[str, ...]):
    content = [{"image_id": f"{number}.jpg", "keypoints": flat(names, number)} for number in range(2)]
    assert_pose(load_player_points(saved(tmp_path, content), fps=25))


def test_whole_body_pairs_of_mmpose_are_read_by_name(tmp_path: Path):
    frames = []
    for number in range(2):
        rows = np.reshape(flat(WHOLE_133, number), (-1, 3))
        person = {"keypoints": rows[:, :2].tolist(), "keypoint_scores": rows[:, 2].tolist()}
        frames.append({"frame_id": number, "instances": [person]})
    assert_pose(load_player_points(saved(tmp_path, {"instance_info": frames}), fps=25))


def test_results_of_coco_whole_body_have_hands_under_keys_of_their_own(tmp_path: Path):
    hands = {"lefthand_kpts": flat(LEFT), "righthand_kpts": flat(RIGHT), "face_kpts": [0.0] * 204}
    content = [{"image_id": number, "keypoints": flat(COCO_17.joints), **hands} for number in range(2)]
    assert_pose(load_player_points(saved(tmp_path, content), fps=25))


def test_holistic_gives_pixels_by_name_though_hands_have_no_visibility(tmp_path: Path):
    points = load_player_points(saved(tmp_path, {"fps": 30.0, "size": SIZE, "frames": [holistic(), holistic(1)]}))
    assert_pose(points)
    assert points.motion.fps == 30
    assert set(points.confidence[0, 8:]) == {1.0}
    np.testing.assert_allclose(points.confidence[0, :8], 0.8)


@pytest.mark.parametrize(("handedness", "label"), [("picture", "Left"), ("mirrored", "Right")])
def test_label_of_a_hand_is_read_as_the_file_says(tmp_path: Path, handedness: str, label: str):
    """The hand at small x is the player's left one; MediaPipe calls it Left or Right, depending on the version."""
    other = {"Left": "Right", "Right": "Left"}[label]
    hands = [
        {"handedness": label, "score": 0.9, "landmarks": landmarks(LEFT)},
        {"handedness": other, "score": 0.9, "landmarks": landmarks(RIGHT)},
    ]
    content = {"fps": 30.0, "size": SIZE, "handedness": handedness, "frames": [{"hands": hands}] * 2}
    assert_pose(load_player_points(saved(tmp_path, content)), PLAYER_50.joints[8:])


def test_hands_whose_labels_are_not_explained_are_refused(tmp_path: Path):
    hands = [{"handedness": "Left", "landmarks": landmarks(LEFT)}]
    path = saved(tmp_path, {"fps": 30.0, "size": SIZE, "frames": [{"hands": hands}] * 2})
    refused(r'points\.json: hand 0 of frame 0 is labelled .* "handedness": "picture"', load_player_points, path)


def test_of_two_hands_with_one_label_the_surer_is_taken(tmp_path: Path):
    hands = [
        {"handedness": "Left", "score": score, "landmarks": landmarks(LEFT, shift)}
        for score, shift in ((0.5, 50.0), (0.9, 0.0), (0.7, 99.0))
    ]
    content = {"fps": 30.0, "size": SIZE, "handedness": "picture", "frames": [{"hands": hands}] * 2}
    points = load_player_points(saved(tmp_path, content))
    assert_pose(points, LEFT)
    assert set(points.confidence.ravel()) == {0.9}


def mirrored(name: str) -> str:
    return name.replace("left_", "@").replace("right_", "left_").replace("@", "right_")


def test_mirrored_picture_is_turned_back_with_the_names_of_both_sides(tmp_path: Path):
    """In the mirror image of the pose an estimator calls the left hand the right one, at 640 - x."""
    person = {}
    for key, names in {
        "pose_keypoints_2d": OPENPOSE_25.joints,
        "hand_left_keypoints_2d": LEFT,
        "hand_right_keypoints_2d": RIGHT,
    }.items():
        rows = np.reshape(flat(tuple(map(mirrored, names))), (-1, 3))
        rows[:, 0] = np.where(rows[:, 2] > 0, SIZE[0] - rows[:, 0], 0.0)
        person[key] = rows.ravel().tolist()
    folder = openpose_folder(tmp_path / "frames", [[person]] * 2)
    assert_pose(load_player_points(folder, fps=25, mirrored=True, size=SIZE))
    assert places(load_player_points(folder, fps=25))["left_hand"] == (640 - 400, 300)


def test_mirrored_landmarks_are_turned_back_by_the_word_of_the_file(tmp_path: Path):
    frame = holistic()
    left, right = frame["left_hand_landmarks"], frame["right_hand_landmarks"]
    for point in (*left, *right):
        point["x"] = 1 - point["x"]
    frame = {"left_hand_landmarks": right, "right_hand_landmarks": left}
    content = {"fps": 30, "size": SIZE, "mirrored": True, "frames": [frame, frame]}
    assert_pose(load_player_points(saved(tmp_path, content)), PLAYER_50.joints[8:])


def test_shares_of_a_picture_of_known_aspect_have_one_unit(tmp_path: Path):
    points = load_player_points(saved(tmp_path, {"fps": 30.0, "aspect": 4 / 3, "frames": [holistic()] * 2}))
    np.testing.assert_allclose(places(points)["left_hand"], (100 / 480, 200 / 480))


def test_lost_hand_is_filled_by_a_straight_line_and_its_mask_says_so(tmp_path: Path):
    frames: list[Any] = [holistic(0), {**holistic(1), "left_hand_landmarks": None}, holistic(2), None]
    points = load_player_points(saved(tmp_path, {"fps": 30.0, "size": SIZE, "frames": frames}))
    left = points.motion.skeleton.joints.index("left_hand")
    np.testing.assert_allclose(points.motion.positions[:, left, 0], [100, 101, 102, 102])
    assert points.detected[:, left].tolist() == [True, False, True, False]
    assert points.detected[:, 0].tolist() == [True, True, True, False]
    assert points.motion.valid.tolist() == [True, True, True, False]


def test_point_that_is_hardly_ever_detected_is_left_out(tmp_path: Path):
    frames = [{**holistic(), "left_hand_landmarks": landmarks(LEFT) if number == 3 else None} for number in range(20)]
    path = saved(tmp_path, {"fps": 30.0, "size": SIZE, "frames": frames})
    assert set(load_player_points(path).motion.skeleton.joints) == set(PLAYER_50.joints) - set(LEFT)
    assert load_player_points(path, least=0.05).motion.skeleton == PLAYER_50


def test_doubtful_point_is_not_detected(tmp_path: Path):
    people = [[openpose(shift)] for shift in range(3)]
    people[1][0]["hand_left_keypoints_2d"][:3] = [999.0, 999.0, 0.2]
    folder = openpose_folder(tmp_path / "frames", people)
    points = load_player_points(folder, fps=25)
    assert places(points, 1)["left_hand"] == (101, 200)
    assert np.argwhere(~points.detected).tolist() == [[1, PLAYER_50.joints.index("left_hand")]]
    assert load_player_points(folder, fps=25, sure=0.1).detected.all()


def test_of_several_files_each_point_comes_from_the_surer_one(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose(7.0, sure=0.6)]] * 2)
    hands = [{"handedness": "Left", "score": 0.9, "landmarks": landmarks(LEFT)}]
    hands += [{"handedness": "Right", "score": 0.4, "landmarks": landmarks(RIGHT)}]
    content = {"fps": 30.0, "size": SIZE, "handedness": "picture", "frames": [{"hands": hands}] * 2}
    points = load_player_points([folder, saved(tmp_path, content)])
    assert places(points)["left_hand"] == pytest.approx((100, 200))
    assert places(points)["right_hand"] == (407, 300)
    assert places(points)["left_shoulder"] == (17, 100)
    assert points.confidence[0].round(6).tolist() == [0.6] * 8 + [0.9] * 21 + [0.6] * 21


def test_files_of_other_lengths_or_units_are_not_merged(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose()]] * 2)
    longer = saved(tmp_path, {"fps": 30, "size": SIZE, "frames": [holistic()] * 3})
    refused(r"points\.json: has 3 frames, frames 2", load_player_points, [folder, longer])
    shares = saved(tmp_path, {"fps": 30, "aspect": 1.5, "frames": [holistic()] * 2})
    refused(r"points\.json: has another unit than frames", load_player_points, [folder, shares])


def test_musician_is_followed_though_hands_of_a_listener_show_better(tmp_path: Path):
    """Bodies decide, not hands: the musician at 0 hides the hands while a listener at 300 claps."""
    hidden = {"pose_keypoints_2d": flat(OPENPOSE_25.joints), "hand_left_keypoints_2d": []}
    listener = openpose(300.0)
    folder = openpose_folder(tmp_path / "frames", [[openpose()], [hidden, listener], [openpose()]])
    points = load_player_points(folder, fps=25)
    shoulder = points.motion.skeleton.joints.index("left_shoulder")
    assert points.motion.positions[:, shoulder, 0].tolist() == [10, 10, 10]


def test_musician_can_be_told_by_a_function_of_frame_and_box(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose(300.0, sure=0.99), openpose()]] * 2)
    calls = []

    def is_left(frame: int, box: tuple[float, float, float, float]) -> bool:
        calls.append((frame, box))
        return box[0] < 200

    assert places(load_player_points(folder, fps=25))["left_hand"] == (400, 200)
    assert_pose(load_player_points(folder, fps=25, is_musician=is_left))
    assert calls[1] == (0, (10, 100, 420, 300))


def test_extra_points_of_the_head_are_kept_by_name(tmp_path: Path):
    rows = np.reshape(flat(OPENPOSE_25.joints), (-1, 3))
    rows[0], rows[1] = (320, 20, 0.9), (320, 50, 0.9)
    folder = openpose_folder(tmp_path / "frames", [[{"pose_keypoints_2d": rows.ravel().tolist()}]] * 2)
    points = load_player_points(folder, fps=25, extras=("nose",))
    assert points.motion.skeleton.joints == (*PLAYER_50.joints[:8], "nose")
    assert places(points)["nose"] == (320, 20)
    with pytest.raises(ValueError, match="extras are of nose, neck, got tail"):
        player_points(np.zeros((2, len(NAMES), 3)), NAMES, 25, extras=("tail",))


def test_rate_that_no_file_holds_has_to_be_passed(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose()]] * 2)
    with pytest.raises(MissingFrameRate, match=r"frames: holds key points but no frame rate; pass fps"):
        load_player_points(folder)
    assert load_player_points(folder, default_fps=24).motion.fps == 24
    path = saved(tmp_path, {"fps": 30, "size": SIZE, "frames": [holistic()] * 2})
    assert load_player_points(path, default_fps=24).motion.fps == 30
    assert load_player_points(path, fps=24).motion.fps == 24


def with_frames(*frames: Any, **about: Any) -> dict[str, Any]:
    return {"fps": 30, "size": SIZE, "handedness": "picture", "frames": list(frames), **about}


@cases(
    "content, fault",
    (with_frames(holistic()), "motion needs at least two frames, got 1"),
    (with_frames({"hands": []}, {"hands": []}), "no point of a musician is detected"),
    (with_frames({"hands": [{"landmarks": []}]}), "hand 0 of frame 0 has no 'handedness'"),
    (with_frames({"hands": {}}, {"hands": 5}), "frame 1: 'hands' is no list"),
    (with_frames({"left_hand_landmarks": landmarks(LEFT)[:20]}), "left_hand_landmarks of frame 0 is no list of 21"),
    (with_frames({"left_hand_landmarks": "x"}), "left_hand_landmarks of frame 0 is no list of 21"),
    (with_frames(holistic(), 5), "frame 1 is no frame of landmarks but '5'"),
    (with_frames(holistic(), size=None), r'write its "size": \[width, height\]'),
    (with_frames(holistic(), size=[640]), r"size must be the picture's width and height in pixels, got '\[640\]'"),
    (with_frames(holistic(), size=["640", "480"]), "size must be the picture's"),
    (with_frames(holistic(), size=None, aspect="wide"), "aspect is width over height"),
    (with_frames(holistic(), mirrored="no"), "mirrored must be true or false, got 'no'"),
    (with_frames(holistic(), handedness="left"), "'handedness' is 'left'; it must be 'mirrored' or 'picture'"),
    (with_frames(holistic(), holistic(), fps="fast"), "could not convert string to float: 'fast'"),
    (with_frames({"hands": [{"handedness": "Left", "score": "0.9"}]}), "score must lie between 0 and 1, got '0.9'"),
    ([{"image_id": 1, "keypoints": [1.0] * 12}], "keypoints of entry 0: 12 values; COCO-17 has 17 or 133 or 136"),
    ([{"image_id": 1, "keypoints": [float("nan")] * 51}], "NaN or infinity at joint 0"),
    ([{"image_id": 1, "keypoints": ["a"] * 51}], "keypoints of entry 0 must be numbers"),
    ({"people": []}, "is one frame of OpenPose; name the folder"),
)
def test_damaged_points_are_refused_with_the_file_and_the_fault(tmp_path: Path, content: Any, fault: str):
    with pytest.raises(ValueError, match=fault) as raised:
        load_player_points(saved(tmp_path, content))
    assert "points.json" in str(raised.value)


def test_damaged_frame_of_openpose_is_named(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose()]] * 3)
    broken = {**openpose(), "hand_left_keypoints_2d": [1.0] * 60}
    (folder / "take_000000000001_keypoints.json").write_text(json.dumps({"people": [broken]}))
    with pytest.raises(
        ValueError, match=r"1_keypoints\.json: hand_left_keypoints_2d of frame: 60 values; OpenPose has 21"
    ):
        load_player_points(folder, fps=25)


def test_other_files_are_refused(tmp_path: Path):
    (tmp_path / "points.txt").write_text("x")
    with pytest.raises(ValueError, match=r"points\.txt: key points of musicians are read from \.json"):
        load_player_points(tmp_path / "points.txt", fps=25)
    with pytest.raises(FileNotFoundError, match=r"none\.json: no such file"):
        load_player_points(tmp_path / "none.json", fps=25)
    refused("no file of key points is named", load_player_points, [], fps=25)
