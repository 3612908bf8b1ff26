"""Performances of musicians: points in the files of pose estimators, folders written and read, splits by piece.

Every point comes under its own name, left and right are the player's; sets in layouts of their own are read, too.
"""

import itertools
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from harmolab.cli.data_check import check
from harmolab.files import MissingFrameRate
from harmolab.musician import performances as played
from harmolab.musician.keypoints import PlayerPoints, load_player_points, player_points
from harmolab.musician.performances import Performance, find_performances, load_performance
from harmolab.readers.keypoints import COCO_17, MEDIAPIPE_33, OPENPOSE_18, OPENPOSE_25
from harmolab.readers.motion import save_motion
from harmolab.readers.player_points import HANDS_12, PLAYER_50, hand_joints
from harmolab.readers.video import write_video
from harmolab.types import Audio, Motion, Notes
from study.experiments.instrument_sets import load_pianomime, load_tracked
from tests.builders import cases, missing, refused, save_performance, write_late_pictures

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


def hand(label: str, names: tuple[str, ...], score: float = 0.9, shift: float = 0.0) -> dict[str, Any]:
    return {"handedness": label, "score": score, "landmarks": landmarks(names, shift)}


def with_frames(*frames: Any, **about: Any) -> dict[str, Any]:
    return {"fps": 30, "size": SIZE, "handedness": "picture", "frames": list(frames), **about}


def places(points: PlayerPoints, frame: int = 0) -> dict[str, tuple[float, float]]:
    rows = points.motion.positions[frame].tolist()
    return {name: (x, y) for name, (x, y) in zip(points.motion.skeleton.joints, rows, strict=True)}


def assert_pose(points: PlayerPoints, names: tuple[str, ...] = PLAYER_50.joints) -> None:
    assert points.motion.skeleton.joints == names
    assert places(points) == {name: pytest.approx(POSE[name]) for name in names}
    assert points.detected.all()


def coco(names: tuple[str, ...], **more: Any) -> list[dict[str, Any]]:
    """Two entries of one person as COCO has them."""
    return [{"image_id": f"{number}.jpg", "keypoints": flat(names, number), **more} for number in range(2)]


WHOLE_133 = (*COCO_17.joints, *("",) * 74, *LEFT, *RIGHT)
WHOLE_136 = (*COCO_17.joints, *("",) * 77, *LEFT, *RIGHT)
PAIRS = np.reshape(flat(WHOLE_133), (-1, 3))
MMPOSE = {"keypoints": PAIRS[:, :2].tolist(), "keypoint_scores": PAIRS[:, 2].tolist()}
OWN_HANDS = {"lefthand_kpts": flat(LEFT), "righthand_kpts": flat(RIGHT), "face_kpts": [0.0] * 204}


@cases(
    "content",
    coco(WHOLE_133),
    coco(WHOLE_136),
    {"instance_info": [{"frame_id": number, "instances": [MMPOSE]} for number in range(2)]},
    coco(COCO_17.joints, **OWN_HANDS),
    ids=["133 points", "136 points", "pairs of MMPose", "hands under keys of their own"],
)
def test_whole_body_points_are_read_by_name(tmp_path: Path, content: Any):
    assert_pose(load_player_points(saved(tmp_path, content), fps=25))


@pytest.mark.parametrize("body", [OPENPOSE_25, OPENPOSE_18])
def test_openpose_gives_body_and_hands_by_name(tmp_path: Path, body: Any):
    folder = openpose_folder(tmp_path / "frames", [[openpose(shift, body.joints)] for shift in (0, 1)])
    points = load_player_points(folder, fps=25)
    assert_pose(points)
    assert (points.motion.skeleton, points.motion.fps) == (PLAYER_50, 25)
    np.testing.assert_allclose(points.confidence, 0.9)
    np.testing.assert_allclose(points.motion.positions[1] - points.motion.positions[0], [[1, 0]] * 50)


def test_holistic_gives_pixels_by_name_though_hands_have_no_visibility(tmp_path: Path):
    points = load_player_points(saved(tmp_path, with_frames(holistic(), holistic(1))))
    assert_pose(points)
    assert points.motion.fps == 30
    assert set(points.confidence[0, 8:]) == {1.0}
    np.testing.assert_allclose(points.confidence[0, :8], 0.8)


@pytest.mark.parametrize(("handedness", "label"), [("picture", "Left"), ("mirrored", "Right")])
def test_label_of_a_hand_is_read_as_the_file_says(tmp_path: Path, handedness: str, label: str):
    """The hand at small x is the player's left one; MediaPipe calls it Left or Right, depending on the version."""
    frame = {"hands": [hand(label, LEFT), hand({"Left": "Right", "Right": "Left"}[label], RIGHT)]}
    content = with_frames(frame, frame, handedness=handedness)
    assert_pose(load_player_points(saved(tmp_path, content)), PLAYER_50.joints[8:])


def test_of_two_hands_with_one_label_the_surer_is_taken(tmp_path: Path):
    frame = {"hands": [hand("Left", LEFT, *own) for own in ((0.5, 50.0), (0.9, 0.0), (0.7, 99.0))]}
    points = load_player_points(saved(tmp_path, with_frames(frame, frame)))
    assert_pose(points, LEFT)
    assert set(points.confidence.ravel()) == {0.9}


def test_mirrored_picture_is_turned_back_with_the_names_of_both_sides(tmp_path: Path):
    """In the mirror image of the pose an estimator calls the left hand the right one, at 640 - x."""
    person = {}
    for key, names in zip(openpose(), (OPENPOSE_25.joints, LEFT, RIGHT), strict=True):
        others = [name.replace("left_", "@").replace("right_", "left_").replace("@", "right_") for name in names]
        rows = np.reshape(flat(tuple(others)), (-1, 3))
        rows[:, 0] = np.where(rows[:, 2] > 0, SIZE[0] - rows[:, 0], 0.0)
        person[key] = rows.ravel().tolist()
    folder = openpose_folder(tmp_path / "frames", [[person]] * 2)
    assert_pose(load_player_points(folder, fps=25, mirrored=True, size=SIZE))
    assert places(load_player_points(folder, fps=25))["left_hand"] == (640 - 400, 300)


def test_mirrored_landmarks_are_turned_back_by_the_word_of_the_file(tmp_path: Path):
    frame = {"left_hand_landmarks": landmarks(RIGHT), "right_hand_landmarks": landmarks(LEFT)}
    for point in itertools.chain(*frame.values()):
        point["x"] = 1 - point["x"]
    assert_pose(load_player_points(saved(tmp_path, with_frames(frame, frame, mirrored=True))), PLAYER_50.joints[8:])


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


def test_point_that_is_detected_in_less_than_a_tenth_of_the_frames_is_left_out(tmp_path: Path):
    frames = [holistic(), *(holistic() | {"left_hand_landmarks": None} for _ in range(19))]
    content = {"fps": 30.0, "size": SIZE, "frames": frames}
    assert set(load_player_points(saved(tmp_path, content)).motion.skeleton.joints) == set(PLAYER_50.joints) - set(LEFT)
    frames[7]["left_hand_landmarks"] = landmarks(LEFT)
    assert load_player_points(saved(tmp_path, content)).motion.skeleton == PLAYER_50


def test_doubtful_point_is_not_detected(tmp_path: Path):
    people = [[openpose(shift)] for shift in range(3)]
    people[1][0]["hand_left_keypoints_2d"][:6] = [999.0, 999.0, 0.29, 777.0, 777.0, 0.3]
    points = load_player_points(openpose_folder(tmp_path / "frames", people), fps=25)
    assert (places(points, 1)["left_hand"], places(points, 1)["left_thumb_1"]) == ((101, 200), (777, 777))
    assert np.argwhere(~points.detected).tolist() == [[1, PLAYER_50.joints.index("left_hand")]]


def test_of_several_files_each_point_comes_from_the_surer_one(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose(7.0, sure=0.6)]] * 2)
    frame = {"hands": [hand("Left", LEFT), hand("Right", RIGHT, 0.4)]}
    points = load_player_points([folder, saved(tmp_path, with_frames(frame, frame))])
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
    folder = openpose_folder(tmp_path / "frames", [[openpose()], [hidden, openpose(300.0)], [openpose()]])
    points = load_player_points(folder, fps=25)
    assert [places(points, frame)["left_shoulder"][0] for frame in range(3)] == [10, 10, 10]


def test_musician_can_be_told_by_a_function_of_frame_and_box(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose(300.0, sure=0.99), openpose()]] * 2)
    calls = []

    def is_left(frame: int, box: tuple[float, float, float, float]) -> bool:
        calls.append((frame, box))
        return box[0] < 200

    assert places(load_player_points(folder, fps=25))["left_hand"] == (400, 200)
    assert_pose(load_player_points(folder, fps=25, is_musician=is_left))
    assert calls[1] == (0, (10, 100, 420, 300))


def test_extra_points_of_the_head_are_kept_by_name():
    points = player_points(np.full((2, 3, 3), 320.0), ("nose", "neck", "left_wrist"), 25, extras=("nose",))
    assert places(points) == {"left_wrist": (320, 320), "nose": (320, 320)}
    refused("extras are of nose, neck, got tail", player_points, np.zeros((2, 3, 3)), (), 25, extras=("tail",))


def test_rate_that_no_file_holds_has_to_be_passed(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose()]] * 2)
    with pytest.raises(MissingFrameRate, match=r"frames: holds key points but no frame rate; pass fps"):
        load_player_points(folder)
    assert load_player_points(folder, default_fps=24).motion.fps == 24
    path = saved(tmp_path, {"fps": 30, "size": SIZE, "frames": [holistic()] * 2})
    assert load_player_points(path, default_fps=24).motion.fps == 30
    assert load_player_points(path, fps=24).motion.fps == 24
    place, audio = tmp_path / "points.npz", Audio(np.ones(8000, np.float32), 8000)
    about = {"positions": np.zeros((2, 1, 2)), "joints": ["left_wrist"], "parents": [-1]}
    np.savez(place, **about)
    assert played.load_playing(place, audio, instrument="piano", fps=24).motion.fps == 24
    np.savez(place, fps=30.0, **about)
    assert played.load_playing(place, audio, instrument="piano", fps=24).motion.fps == 30


UNEXPLAINED = {"fps": 30.0, "size": SIZE, "frames": [{"hands": [hand("Left", LEFT)]}] * 2}


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
    (UNEXPLAINED, 'hand 0 of frame 0 is labelled .* "handedness": "picture"'),
    ([{"image_id": 1, "keypoints": [1.0] * 12}], "keypoints of entry 0: 12 values; COCO-17 has 17 or 133 or 136"),
    ([{"image_id": 1, "keypoints": [float("nan")] * 51}], "NaN or infinity at joint 0"),
    ([{"image_id": 1, "keypoints": ["a"] * 51}], "keypoints of entry 0 must be numbers"),
    ({"people": []}, "is one frame of OpenPose; name the folder"),
)
def test_damaged_points_are_refused_with_the_file_and_the_fault(tmp_path: Path, content: Any, fault: str):
    refused(rf"points\.json: .*{fault}", load_player_points, saved(tmp_path, content))


def test_damaged_frame_of_openpose_is_named(tmp_path: Path):
    folder = openpose_folder(tmp_path / "frames", [[openpose()]] * 3)
    broken = {**openpose(), "hand_left_keypoints_2d": [1.0] * 60}
    (folder / "take_000000000001_keypoints.json").write_text(json.dumps({"people": [broken]}))
    fault = r"1_keypoints\.json: hand_left_keypoints_2d of frame: 60 values; OpenPose has 21"
    refused(fault, load_player_points, folder, fps=25)


def test_other_files_are_refused(tmp_path: Path):
    (tmp_path / "points.txt").write_text("x")
    refused(r"points\.txt: key points of musicians are read from \.json", load_player_points, tmp_path / "points.txt")
    missing(r"none\.json: no such file", load_player_points, tmp_path / "none.json", fps=25)
    refused("no file of key points is named", load_player_points, [], fps=25)


# Performances

FPS = 24.0


def sound(seconds: float = 2.0, rate: int = 44100) -> Audio:
    """A tone of 440 Hz at half of full scale."""
    return Audio(0.5 * np.sin(2 * np.pi * 440 * np.arange(round(seconds * rate)) / rate), rate)


def notes_of(pitches: Sequence[int], step: float = 0.25) -> Notes:
    onsets = step * np.arange(len(pitches))
    return Notes(onsets, onsets + step, np.array(pitches, int))


def performance(name: str = "etude", frames: int = 48, **fields: Any) -> Performance:
    """A pianist of 50 random points in two seconds."""
    places = np.random.default_rng(7).uniform(0, 640, (frames, 50, 2))
    detected = np.ones((frames, 50), bool)
    detected[3:5, 8:29] = False
    chosen = {"audio": sound(), "detected": detected, "offset": 0.125, "source": "tests", **fields}
    return Performance(name, "piano", motion=Motion(places, FPS, PLAYER_50), **chosen)


def song_folder(folder: Path, **about: Any) -> Path:
    """The simplest folder: song.wav, points.json, and performance.json where there is something to say."""
    folder.mkdir(parents=True)
    soundfile.write(folder / "song.wav", sound(0.5).samples, 44100)
    saved(folder, {"fps": 20.0, "size": SIZE, "frames": [holistic(shift) for shift in range(10)]})
    if about:
        (folder / "performance.json").write_text(json.dumps(about))
    return folder


# Written and read again


def test_saved_performance_comes_back_whole(tmp_path: Path):
    notes = Notes([0.1, 0.1, 1 / 3], [0.5, 0.7, 1.9], [36, 60, 88], [0.2, 1.0, 1 / 7], [0, 1, -1])
    one = performance(notes=notes, piece='op. 10/3 \u2013 "Tristesse"', rendered=True)
    save_performance(tmp_path / "one", one)
    again = load_performance(tmp_path / "one")
    np.testing.assert_array_equal(again.motion.positions, one.motion.positions)
    np.testing.assert_array_equal(again.detected, one.detected)
    assert (again.motion.skeleton, again.motion.fps) == (PLAYER_50, FPS)
    for field in ("name", "instrument", "offset", "piece", "rendered", "source"):
        assert getattr(again, field) == getattr(one, field)
    for field, values in vars(notes).items():
        np.testing.assert_array_equal(getattr(again.notes, field), values)
    np.testing.assert_allclose(again.audio.samples, sound().samples, atol=1 / 32768)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["one"]


def test_without_sound_a_performance_needs_notes(tmp_path: Path):
    save_performance(tmp_path / "notes", performance(audio=None, notes=notes_of([60])))
    assert load_performance(tmp_path / "notes").audio is None
    save_performance(tmp_path / "nothing", performance(audio=None))
    refused(r"nothing: has no sound .* and no notes\.csv", load_performance, tmp_path / "nothing")


# The folders of a user


def test_simplest_folder_needs_the_word_piano_in_its_name_and_nothing_else(tmp_path: Path):
    one = load_performance(song_folder(tmp_path / "Piano take 3"))
    assert (one.name, one.instrument, one.source) == ("Piano take 3", "piano", tmp_path.name)
    assert (one.motion.fps, one.offset, one.piece, one.rendered, one.notes) == (20, 0, "", False, None)
    assert one.motion.skeleton == PLAYER_50
    assert one.detected.all()
    assert one.audio.sample_rate == 44100
    assert load_performance(song_folder(tmp_path / "violin" / "take")).instrument == "violin"
    assert load_performance(song_folder(tmp_path / "take"), instrument="violin").instrument == "violin"


def test_folder_that_does_not_say_the_instrument_is_refused_with_the_line_that_helps(tmp_path: Path):
    silent, tuba = (song_folder(tmp_path / name) for name in ("take", "other"))
    refused(r'take: does not say the instrument; write \{"instrument": "piano"\} into', load_performance, silent)
    refused("other: instrument must be piano or violin, got 'tuba'", load_performance, tuba, instrument="tuba")
    own = song_folder(tmp_path / "own", instrument="violin")
    assert load_performance(own, instrument="piano").instrument == "violin"


def test_frames_of_openpose_beside_a_song_or_below_it_need_a_rate(tmp_path: Path):
    folder = openpose_folder(tmp_path / "piano_1" / "openpose", [[openpose(shift)] for shift in range(12)]).parent
    beside = openpose_folder(tmp_path / "piano", [[openpose(shift)] for shift in range(12)])
    for place in (folder, beside):
        soundfile.write(place / "song.flac", sound(0.5).samples, 44100)
    refused(r'openpose: holds no frame rate; write "fps" into performance\.json', load_performance, folder)
    assert load_performance(folder, fps=24).motion.fps == 24
    (row,) = check(beside)
    fault = "holds no frame rate: pass fps (--fps)"
    assert (row.kind, row.rate, row.seconds, row.odd[0]) == ("performance", None, None, fault)
    assert load_performance(beside, fps=24).motion.n_frames == 12
    assert find_performances(tmp_path).folders == (beside, folder)
    (folder / "performance.json").write_text('{"fps": 25}')
    assert load_performance(folder, fps=24).motion.fps == 25


def test_video_beside_openpose_gives_sound_and_rate(tmp_path: Path):
    folder = openpose_folder(tmp_path / "violin_2" / "openpose", [[openpose(shift)] for shift in range(20)]).parent
    frames = (np.full((48, 64, 3), number, np.uint8) for number in range(20))
    write_video(folder / "take.mp4", frames, 20.0, audio=sound(1.0))
    one = load_performance(folder)
    assert one.motion.fps == 20
    assert one.audio.duration == pytest.approx(1.0, abs=0.1)


def test_points_begin_with_the_first_picture_of_a_film_whose_sound_begins_before_it(tmp_path: Path):
    folder = openpose_folder(tmp_path / "violin_3" / "openpose", [[openpose(shift)] for shift in range(20)]).parent
    write_video(tmp_path / "film.mp4", (np.full((48, 64, 3), 9, np.uint8) for _ in range(20)), 20.0, audio=sound(1.5))
    write_late_pictures(folder / "take.mp4", tmp_path / "film.mp4", 0.25)
    assert load_performance(folder).offset == pytest.approx(0.25, abs=0.002)
    assert load_performance(folder, offset=0.0).offset == 0
    plays = partial(played.load_playing, folder / "openpose", sound(1.5), instrument="violin", fps=20)
    assert plays(film=folder / "take.mp4").offset == pytest.approx(0.25, abs=0.002)
    assert [plays(film=film).offset for film in (None, tmp_path / "film.mp4", "song.wav")] == [0, 0, 0]
    (folder / "performance.json").write_text('{"offset_s": 0}')
    assert load_performance(folder).offset == 0


def test_fields_of_performance_json_are_taken(tmp_path: Path):
    about = {"offset_s": 0.1, "piece": "BWV 1004", "name": "me", "source": "home", "comment": 5, "rendered": True}
    files = {"audio": "song.wav", "points": ["points.json"]}
    folder = song_folder(tmp_path / "take", instrument="piano", **about, **files)
    soundfile.write(folder / "other.wav", sound(0.5).samples, 44100)
    (folder / "more.json").write_text("{}")
    one = load_performance(folder)
    assert (one.offset, one.piece, one.name, one.source, one.rendered) == (0.1, "BWV 1004", "me", "home", True)


def test_an_offset_that_is_passed_counts_in_place_of_the_folders_own(tmp_path: Path):
    folder, audio = song_folder(tmp_path / "take", instrument="piano", offset_s=99.0), sound()
    assert played.load_playing(folder, audio, instrument="piano", offset=0.1).offset == 0.1
    for passed in ({}, {"offset": 99.0}):
        refused("and offset 99 s", played.load_playing, folder, audio, instrument="piano", **passed)
    (folder / "performance.json").write_text(json.dumps({"instrument": "piano"}))
    refused("and offset 99 s", played.load_playing, folder, audio, instrument="piano", offset=99.0)


def test_mirrored_recording_is_turned_back(tmp_path: Path):
    plain = load_performance(song_folder(tmp_path / "a", instrument="piano"))
    turned = load_performance(song_folder(tmp_path / "b", instrument="piano", mirrored=True))
    left, right = (PLAYER_50.joints.index(f"{side}_thumb_4") for side in ("left", "right"))
    x, y = plain.motion.positions[:, right].T
    np.testing.assert_allclose(turned.motion.positions[:, left], np.column_stack([SIZE[0] - x, y]))


@pytest.mark.parametrize("rate", [8000, 192_000])
def test_sound_of_any_rate_comes_at_44100_hertz_or_as_it_is(tmp_path: Path, rate: int):
    folder = song_folder(tmp_path / "piano")
    soundfile.write(folder / "song.wav", sound(0.5, rate).samples, rate)
    one = load_performance(folder)
    assert (one.audio.sample_rate, one.audio.duration) == (44100, pytest.approx(0.5, abs=1e-3))
    assert np.sqrt(np.mean(one.audio.samples[5000:17000] ** 2)) == pytest.approx(0.5 / np.sqrt(2), rel=0.01)
    assert load_performance(folder, sample_rate=None).audio.sample_rate == rate


def test_silence_and_a_single_note_are_a_performance(tmp_path: Path):
    folder = song_folder(tmp_path / "piano")
    soundfile.write(folder / "song.wav", np.zeros(22050), 44100)
    (folder / "notes.csv").write_text("onset_s,offset_s,midi\n")
    one = load_performance(folder)
    assert len(one.notes) == 0
    assert not one.audio.samples.any()


@cases(
    "about, fault",
    ("[]", r"must be an object with fields such as"),
    ('{"intrument": "piano"}', "has a field 'intrument' that is not known; fields are instrument, fps"),
    ('{"instrument": "tuba"}', "instrument must be piano or violin, got 'tuba'"),
    ('{"instrument": ["piano"]}', "instrument must be piano or violin"),
    ('{"fps": "24"}', "fps must be a number, got '24'"),
    ('{"fps": NaN}', "fps must be a number, got 'nan'"),
    ('{"fps": 0}', "fps must lie between 1 and 1000, got 0"),
    ('{"offset_s": 1e400}', "offset_s must be a number, got 'inf'"),
    ('{"rendered": 1}', "rendered must be true or false, got '1'"),
    ('{"size": [640, -480]}', "size must be the picture's width and height"),
    ('{"audio": "../../etc/passwd"}', "audio must be a name inside of the folder"),
    ('{"points": "/etc"}', "points must be a name inside of the folder"),
    ('{"points": "' + 500 * "a" + '.json"}', "points must be a name inside of the folder"),
    ('{"points": []}', "points must be a name inside of the folder"),
    ('{"points": "none.json"}', "names 'none.json', which is not in the folder"),
    ('{"piece": 3}', "piece must be text, got '3'"),
    ("{", "cannot be read as the description of a performance"),
    ("", "the file is empty"),
)
def test_damaged_description_is_refused_with_the_file_and_the_fault(tmp_path: Path, about: str, fault: str):
    folder = song_folder(tmp_path / "piano")
    (folder / "performance.json").write_text(about)
    refused(f"^{re.escape(str(folder))}.*{fault}", load_performance, folder)


def test_what_cannot_be_a_performance_is_refused_with_the_folder_and_the_fault(tmp_path: Path):
    folder = song_folder(tmp_path / "piano")
    missing("nowhere: no such folder", load_performance, tmp_path / "nowhere")
    soundfile.write(folder / "take.wav", sound(0.5).samples, 44100)
    refused(r'piano: holds song\.wav, take\.wav; write the one that counts as "audio"', load_performance, folder)
    (folder / "take.wav").unlink()
    soundfile.write(folder / "song.wav", sound(0.5).samples[:4410], 44100)
    (folder / "points.json").write_text(json.dumps({**json.loads((folder / "points.json").read_text()), "fps": 5}))
    refused(r"piano: the points, at 5 frames a second, end 1\.90 s after the sound; is that", load_performance, folder)
    save_motion(folder / "motion.npz", Motion(np.zeros((4, 50, 3)), 24, PLAYER_50))
    refused(r"piano: .*points of a picture are needed, \(T, P, 2\), got three coordinates", load_performance, folder)
    np.savez(folder / "motion.npz", positions=np.zeros((4, 2, 2)), fps=24.0, detected=np.ones((4, 3), bool))
    refused(r"piano: .*detected must have shape \(4, 2\), got \(4, 3\)", load_performance, folder)
    (folder / "performance.json").write_text('{"instrument": "piano", "points": ["points.json", "motion.npz"]}')
    refused(r"performance\.json: an \.npz has no confidence", load_performance, folder)
    (folder / "performance.json").write_text('{"instrument": "piano", "points": "motion.npz", "mirrored": true}')
    refused(r'performance\.json: "mirrored" does not turn an \.npz round', load_performance, folder)


# Many folders


def test_performances_are_found_below_several_roots_and_parts_are_problems(tmp_path: Path):
    one = song_folder(tmp_path / "piano" / "take 10")
    two = song_folder(tmp_path / "piano" / "take 2")
    three = openpose_folder(tmp_path / "violin" / "c" / "openpose", [[openpose()]] * 2).parent
    soundfile.write(three / "c.ogg", sound(0.5).samples, 44100)
    (song_folder(tmp_path / "violin" / "silent") / "song.wav").unlink()
    (tmp_path / "piano" / "loose").mkdir()
    for place in ("loose/song.wav", "song.wav"):  # a song above performances is no problem
        soundfile.write(tmp_path / "piano" / place, sound(0.5).samples, 44100)
    folders, problems = find_performances([tmp_path / "piano", tmp_path / "violin"])
    assert folders == (two, one, three)
    assert [problem.folder.name for problem in problems] == ["loose", "silent"]
    assert "loose: has no points of the player: motion.npz, a .json" in problems[0].message
    assert "silent: has no sound" in problems[1].message
    assert find_performances(tmp_path).folders == folders
    assert find_performances(two).folders == (two,)
    (tmp_path / "mine" / "link").parent.mkdir()
    (tmp_path / "mine" / "link").symlink_to(two)
    assert find_performances(tmp_path / "mine").folders == (tmp_path / "mine" / "link",)


def test_root_that_is_none_is_refused(tmp_path: Path):
    missing("nowhere: no such folder", find_performances, tmp_path / "nowhere")
    (tmp_path / "file").write_text("")
    refused("file: is a file; a folder of performances is needed", find_performances, [tmp_path / "file"])


def test_check_says_how_a_performance_was_read(tmp_path: Path):
    folder = song_folder(tmp_path / "piano" / "take")
    content = json.loads((folder / "points.json").read_text())
    for number, frame in enumerate(content["frames"]):
        frame |= {"right_hand_landmarks": None} | ({"left_hand_landmarks": None} if number < 4 else {})
    (folder / "points.json").write_text(json.dumps(content))
    (row,) = check(tmp_path)
    assert (row.path, row.kind, row.joints, row.offset) == (str(folder), "performance", 29, 0)
    assert (row.frames, row.rate, row.note) == (10, 20, "piano, points of points.json, 0.50 s of audio")
    assert "all its points of the left hand are detected in 60% of the frames only" in row.odd
    assert "no point of the right hand" in row.odd


def test_check_shows_a_saved_performance_once_and_a_part_as_unreadable(tmp_path: Path):
    save_performance(tmp_path / "one", performance(notes=notes_of([60, 62, 64]), rendered=True))
    save_performance(tmp_path / "two", performance(audio=None))
    rows = {Path(row.path).name: row for row in check(tmp_path)}
    assert {name: row.kind for name, row in rows.items()} == {"one": "performance", "two": "unreadable"}
    assert rows["one"].note == "piano, points of motion.npz, 2.00 s of rendered audio, 3 notes"
    assert "has no sound" in rows["two"].odd[0]


# Notes


def test_notes_are_read_in_the_order_of_their_onsets_with_any_separator(tmp_path: Path):
    text = "# a score\nmidi;offset_s;finger;onset_s;hand\n60;1.5;1;1.0;right\n\n36.0;0.75;5;0.5;Left\n72;2.5;5;2.0;\n"
    (tmp_path / "notes.csv").write_text(text)
    columns = {name: values.tolist() for name, values in vars(played.load_notes(tmp_path / "notes.csv")).items()}
    assert (columns["onsets"], columns["offsets"]) == ([0.5, 1.0, 2.0], [0.75, 1.5, 2.5])
    assert (columns["pitches"], columns["hands"], columns["loudness"]) == ([36, 60, 72], [0, 1, -1], [1, 1, 1])


@cases(
    "text, fault",
    ("0.5,1.0,60\n", "has no column onset_s and no offset_s and no midi in its first line, '0.5,1.0,60'"),
    ("onset_s,offset_s\n", "has no column midi"),
    ("onset_s,offset_s,midi,midi\n1,2,3,4\n", "has a name twice"),
    ("onset_s,offset_s,midi\n0,1\n", "line 2 has 2 values, the first line 3 names"),
    ("onset_s,offset_s,midi\n0,one,60\n", "offset_s must be numbers, got 'one'"),
    ("onset_s,offset_s,midi\nnan,1,60\n", "note onsets holds NaN"),
    ("onset_s,offset_s,midi\n-1,1,60\n", "from 0 s on"),
    ("onset_s,offset_s,midi\n1,1,60\n", "end after they begin"),
    ("onset_s,offset_s,midi\n0,1,60.5\n", "midi must be whole numbers from 0 to 127, got '60.5'"),
    ("onset_s,offset_s,midi\n0,1,1e300\n", "midi must be whole numbers from 0 to 127, got '1e300'"),
    ("onset_s,offset_s,midi,loudness\n0,1,60,64\n", "loudness reaches 64; these are MIDI velocities: divide"),
    ("onset_s,offset_s,midi,loudness\n0,1,60,-1\n", "loudness must lie between 0 and 1"),
    ("onset_s,offset_s,midi,hand\n0,1,60,both\n", "hand must be left, right or empty, got 'both'"),
    ("# nothing\n", "has no line of names"),
    ("", "the file is empty"),
)
def test_damaged_notes_are_refused_with_the_file_and_the_fault(tmp_path: Path, text: str, fault: str):
    (tmp_path / "notes.csv").write_text(text)
    refused(rf"notes\.csv: .*{fault}", played.load_notes, tmp_path / "notes.csv")


# Splits by piece


def player_of(name: str, piece: str = "", pitches: Sequence[int] | None = None) -> Performance:
    return performance(name, piece=piece, audio=None, notes=None if pitches is None else notes_of(pitches))


def shared(notes: Notes, others: Notes) -> float:
    return played.shared_patterns(played.note_patterns(notes), played.note_patterns(others))


@cases(
    "pitches, share",
    ([60, 62, 64, 65, 67], 1),
    ([60, 62, 64, 65, 50, 51, 52, 53], 0.5),
    ([61, 63, 65, 66, 68], 0),
    ([60, 62, 64], 0),
)
def test_shared_patterns_is_the_share_of_four_notes_in_a_row_that_both_have(pitches: list[int], share: float):
    scale = notes_of([60, 62, 64, 65, 67])  # two patterns
    assert shared(scale, notes_of(pitches)) == share


def test_notes_of_a_chord_are_one_pattern_in_whatever_order_they_were_struck():
    late = 0.01 * np.array([0, 1, 2, 30, 31, 32])
    chords = [Notes(late, late + 0.2, np.array(keys)) for keys in ([60, 64, 67, 59, 62, 67], [67, 60, 64, 62, 67, 59])]
    assert shared(*chords) == 1


def test_pieces_that_share_patterns_are_one_group_through_any_of_their_performances():
    scale = [60, 62, 64, 65, 67, 69, 71, 72]
    performances = [
        player_of("a", "1", scale),
        player_of("b", "1", [40, 41, 43, 45, 46]),
        player_of("c", "2", [*scale[:5], 30, 31, 32]),  # two of its five patterns are in a: more than a quarter
        player_of("g", "4", [*scale[4:], 30, 31, 32]),  # one of its four is in a: a quarter
        player_of("d", "3", scale[::-1]),
        player_of("e"),
        player_of("f"),
        *(performance(name, audio=sound(seconds)) for name, seconds in (("h", 0.5), ("copy of h", 0.5), ("i", 0.6))),
    ]
    groups = played.piece_groups(performances)
    assert groups[0] == groups[1] == groups[2]
    assert groups[7] == groups[8]
    assert len(set(groups)) == 7


def test_no_piece_is_on_two_sides_and_shares_are_nearly_as_asked():
    performances = [player_of(f"{piece}-{take}", str(piece)) for piece in range(40) for take in range(1 + piece % 3)]
    for seed in range(10):
        split = played.split_by_piece(performances, test_share=0.2, validation_share=0.1, seed=seed)
        assert sum(map(len, [{one.piece for one in side} for side in split])) == 40
        assert [len(side) / len(performances) for side in split] == pytest.approx([0.7, 0.1, 0.2], abs=0.05)
    assert played.split_by_piece(performances, seed=1) == played.split_by_piece(performances, seed=1)
    assert played.split_by_piece(performances, seed=1) != played.split_by_piece(performances, seed=2)


def test_every_side_gets_a_piece_and_a_share_of_nothing_gets_none():
    three = [player_of(name, name) for name in "abc"]
    assert [len(side) for side in played.split_by_piece(three)] == [1, 1, 1]
    assert [len(side) for side in played.split_by_piece(three, validation_share=0.0)][1] == 0
    refused("2 performances are of 2 pieces: too few for 3 sides", played.split_by_piece, three[:2])
    refused("must leave some to train on", played.split_by_piece, three, test_share=0.6, validation_share=0.4)
    refused("too few", played.split_by_piece, [])


# Sets in layouts of their own

_CLIP_JOINTS = [f"{side}_{part}" for side in "lr" for part in ("wrist", "thumb", "index", "middle", "ring", "little")]


def pianomime_arrays() -> dict[str, Any]:
    """Three frames; point p at x = p cm, 1 mm deeper in every frame, z of no meaning; two notes."""
    positions = np.zeros((3, 12, 3), np.int16)
    positions[..., 0] = 100 * np.arange(12)
    positions[..., 1] = 10 * np.arange(3)[:, None]
    positions[..., 2] = 32000
    notes = np.array([[0.05, 0.1, 60, 1, 0], [0.0, 0.15, 36, 0, 4]], np.float32)
    arrays = {"positions_tenth_mm": positions, "fps": np.float32(20), "joints": np.array(_CLIP_JOINTS), "notes": notes}
    return arrays | {"pressed": positions[..., 0] == 300}


def pianomime_folder(folder: Path, **changes: Any) -> Path:
    folder.mkdir()
    (folder / "clips.csv").write_text("clip,piece,seconds\nclip_001,7,0.15\n")
    np.savez(folder / "clip_001.npz", **{**pianomime_arrays(), **changes})
    return folder


def test_pianomime_is_read_in_millimetres_with_hands_and_without_z(tmp_path: Path):
    (one,) = load_pianomime(pianomime_folder(tmp_path / "set"))
    assert (one.name, one.piece, one.instrument, one.source) == ("clip_001", "pianomime_7", "piano", "pianomime")
    assert (one.audio, one.motion.skeleton, one.motion.positions.shape) == (None, HANDS_12, (3, 12, 2))
    np.testing.assert_allclose(one.motion.positions[2], [[10 * point, 2] for point in range(12)])
    assert np.transpose([one.notes.onsets, one.notes.offsets]).tolist() == [[0.0, 0.15], [0.05, 0.1]]
    assert np.transpose([one.notes.pitches, one.notes.hands]).tolist() == [[36, 0], [60, 1]]


@cases(
    "changes, fault",
    ({"joints": np.array(_CLIP_JOINTS[::-1])}, "12 of both hands are needed"),
    ({"positions_tenth_mm": np.zeros((3, 12, 2), np.int16)}, "12 of both hands are needed"),
    ({"positions_tenth_mm": np.zeros((1, 12, 3), np.int16)}, "motion needs at least two frames"),
    ({"positions_tenth_mm": np.zeros((3, 12, 3))}, "holds values of type float64"),
    ({"notes": np.full((2, 5), np.nan, np.float32)}, "notes must be rows of four finite numbers"),
    ({"notes": np.zeros(5, np.float32)}, "notes must be rows of four finite numbers"),
    ({"notes": np.array([[0, 1, 200, 0, 0]], np.float32)}, "pitches are MIDI numbers"),
    ({"notes": np.array([[0, 1, 60, 7, 0]], np.float32)}, "hands are 0"),
    ({"fps": np.zeros(3, np.float32)}, "fps must be one number"),
    ({"fps": np.float32(0)}, "fps must lie between 1 and 1000"),
    ({"notes": np.array([None], object)}, "never Python objects"),
)
def test_damaged_clip_of_pianomime_is_refused_by_name(tmp_path: Path, changes: dict[str, Any], fault: str):
    refused(rf"clip_001\.npz.*{fault}", load_pianomime, pianomime_folder(tmp_path / "set", **changes))


def test_table_of_pianomime_names_no_file_elsewhere(tmp_path: Path):
    folder = pianomime_folder(tmp_path / "set")
    (folder / "clips.csv").write_text("clip,piece\n../secret,1\n")
    refused(r"clips\.csv: names a clip '\.\./secret'", load_pianomime, folder)
    (folder / "clips.csv").write_text("clip,piece\nclip_002,1\n")
    missing(r"clip_002\.npz: no such file", load_pianomime, folder)


def test_tracked_video_keeps_what_was_lost_in_its_mask(tmp_path: Path):
    hand = np.full((4, 21, 2), 7.0, np.float16)
    hand[1] = np.nan
    visibility = np.array([[1, 1], [1, 0.1], [1, 1], [1, 1]], np.float16)
    body = {"body": np.full((4, 2, 2), 5.0, np.float16), "visibility": visibility, "joints": ["left_wrist", "nose"]}
    notes = np.array([[0.1, 0.2, 69, 127]], np.float32)
    np.savez(tmp_path / "violinist_9.npz", **body, left_hand=hand, fps=25.0, notes=notes)
    soundfile.write(tmp_path / "violinist_9.ogg", sound(0.2).samples, 44100)
    one = load_tracked(tmp_path / "violinist_9.npz", extras=("nose",))
    assert (one.instrument, one.piece) == ("violin", "tracked_violinist_9")
    assert one.motion.skeleton.joints == ("left_wrist", *PLAYER_50.joints[8:29], "nose")
    assert one.detected[:, 0].all()
    assert one.detected[:, 1:].all(axis=1).tolist() == [True, False, True, True]
    np.testing.assert_array_equal(one.motion.positions[1, 1:22], np.full((21, 2), 7.0))
    assert one.notes.loudness.tolist() == [1]
    (tmp_path / "violinist_9.npz").rename(tmp_path / "cellist.npz")
    refused(r'cellist\.npz: has neither "pian" nor "violin" in its name', load_tracked, tmp_path / "cellist.npz")


# Real recordings


@pytest.fixture(scope="module")
def instruments(data_root: Path) -> Path:
    folder = data_root / "instruments"
    if not folder.is_dir():
        pytest.skip(f"no recordings of musicians: {folder} is not there")
    return folder


@pytest.fixture(scope="module")
def pianists(instruments: Path) -> list[Performance]:
    return load_pianomime(instruments / "pianomime")


@pytest.mark.data
def test_real_pianists_have_the_notes_and_minutes_that_their_table_says(instruments: Path, pianists: list[Performance]):
    lines = (instruments / "pianomime" / "clips.csv").read_text().splitlines()[1:]
    table = {line.split(",")[0]: line.split(",") for line in lines}
    assert len(pianists) == len(table) > 100
    for one in pianists:
        _, piece, seconds, count, lowest, highest = table[one.name]
        assert (one.piece, len(one.notes)) == (f"pianomime_{piece}", int(count))
        assert one.motion.duration == pytest.approx(float(seconds), abs=0.06)
        assert (one.notes.pitches.min(), one.notes.pitches.max()) == (int(lowest), int(highest))


@pytest.mark.data
def test_real_left_hands_lie_left_of_right_hands_and_play_lower(pianists: list[Performance]):
    hands, keys = [], []
    for one in pianists:
        wrists = [one.motion.skeleton.joints.index(f"{side}_hand") for side in ("left", "right")]
        hands.append(one.motion.positions[:, wrists, 0].mean(axis=0))
        keys.append([one.notes.pitches[one.notes.hands == hand].mean() for hand in (0, 1)])
    assert (np.diff(hands, axis=1) > 0).mean() > 0.98
    assert (np.diff(keys, axis=1) > 0).mean() > 0.98


@pytest.mark.data
@pytest.mark.parametrize("seed", [0, 1])
def test_sides_of_real_pianists_share_at_most_a_quarter_of_their_note_patterns(pianists: list[Performance], seed: int):
    split = played.split_by_piece(pianists, seed=seed)
    patterns = [[played.note_patterns(one.notes) for one in side] for side in split]
    pairs = [pair for sides in itertools.combinations(patterns, 2) for pair in itertools.product(*sides)]
    assert len(pairs) > 5000
    assert max(played.shared_patterns(*pair) for pair in pairs) <= 0.25
    minutes = [sum(one.motion.duration for one in side) / 60 for side in split]
    assert minutes == pytest.approx(np.array([0.7, 0.15, 0.15]) * sum(minutes), abs=3)


@pytest.mark.data
def test_three_tracked_musicians_are_read(instruments: Path):
    names = ("pianist_side_view", "piano_top_view", "violinist")
    side, top, violin = (load_tracked(instruments / "tracked" / f"{name}.npz") for name in names)
    joints = [each.motion.skeleton.joints for each in (side, top, violin)]
    assert joints == [PLAYER_50.joints[:8], PLAYER_50.joints[8:], PLAYER_50.joints]
    assert (side.instrument, top.instrument, violin.instrument) == ("piano", "piano", "violin")
    assert (top.audio, len(top.notes)) == (None, 138)
    assert violin.detected[:, 8:].mean() == pytest.approx(0.87, abs=0.01)
    assert top.detected.mean() > 0.999


@pytest.mark.data
def test_tracked_pianist_plays_the_piece_of_the_clip_of_the_same_take(instruments: Path, pianists: list[Performance]):
    twin = load_tracked(instruments / "tracked" / "piano_top_view.npz")
    (clip,) = (one for one in pianists if one.name == "clip_186")
    assert twin.piece == clip.piece
    assert shared(twin.notes, clip.notes) > 0.5
    assert played.piece_groups([replace(twin, piece=""), clip]) == [0, 0]
