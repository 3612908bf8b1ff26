"""Thousands of damaged and malicious inputs: each gives a finite result or one clear error, and runs nothing.

``HARMOLAB_HOSTILE_SEED`` and ``HARMOLAB_HOSTILE_TIMES`` (a factor on the numbers below) widen the search.
"""

import io
import json
import os
import pickle
import struct
import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from harmolab.body.skeletons import Skeleton
from harmolab.cli.data_check import check
from harmolab.data.recordings import load_any_motion, load_config, load_recording
from harmolab.musician.keypoints import load_player_points
from harmolab.musician.performances import Performance, load_notes, load_performance
from harmolab.readers.aist import read_array_pickle
from harmolab.readers.audio import audio_info, load_audio
from harmolab.readers.beats import load_annotation, load_beats
from harmolab.readers.motion import load_motion
from harmolab.readers.smpl import SMPL_24, load_body
from harmolab.types import Audio, BeatTrack, Motion, Notes
from study.experiments.instrument_sets import load_pianomime, load_tracked
from tests.builders import cases, refused

SEED = int(os.environ.get("HARMOLAB_HOSTILE_SEED", "1"))
TIMES = float(os.environ.get("HARMOLAB_HOSTILE_TIMES", "1"))

TRIES = 100  # mutated files of each format
FOLDERS = 60  # with one damaged part, of recordings and of performances
ARRAYS = 60  # made by hypothesis, for each of three types


def tries(count: int) -> int:
    """That many, more or fewer by the factor; never none."""
    return max(1, round(count * TIMES))


def poses(frames: int = 6, joints: int = 3, dimensions: int = 3) -> np.ndarray:
    return np.random.default_rng(3).normal(size=(frames, joints, dimensions)).cumsum(axis=0) * 0.1


def saved(save: Callable[..., None], *arrays: object, **named: object) -> bytes:
    stream = io.BytesIO()
    save(stream, *arrays, **named)
    return stream.getvalue()


def sound_bytes(format: str, subtype: str, channels: int = 1) -> bytes:
    tones = 2 * np.pi * (220 + 110 * np.arange(channels))
    waves = 0.5 * np.sin(np.arange(2205)[:, None] / 11025 * tones)
    return saved(soundfile.write, waves, 11025, format=format, subtype=subtype)


def bvh_text() -> str:
    joint = "CHANNELS 3 Zrotation Xrotation Yrotation"
    head = f"""HIERARCHY
ROOT hip {{ OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
 JOINT knee {{ OFFSET 0 -40.5 0 {joint} End Site {{ OFFSET 0 -40 0 }} }}
 JOINT back {{ OFFSET 0 50 0 {joint} }} }}
MOTION
Frames: 5
Frame Time: 0.04
"""
    rows = np.random.default_rng(5).normal(size=(5, 12)) * 20
    return head + "\n".join(" ".join(f"{value:.4f}" for value in row) for row in rows) + "\n"


def openpose_frame() -> dict:
    person = np.random.default_rng(8).uniform(0.1, 1.0, (25, 3)) * [640, 480, 1]
    return {"version": 1.3, "people": [{"pose_keypoints_2d": person.ravel().round(3).tolist()}]}


def annotation() -> dict:
    unit = {"name": "W-1-1", "start_s": 0.0, "end_s": 0.1, "beats": 3, "figure": "W-1"}
    about = {"downbeats_s": [0.01], "meter": 3, "bpm": 90.5, "dance": "waltz", "motion_offset_s": 0.0}
    return {"beats_s": [0.01, 0.05, 0.1, 0.15], "units": [unit], **about}


def coco_poses() -> list[list[float]]:
    """Five COCO-17 poses: x, y and confidence of every point, in one row."""
    rng = np.random.default_rng(3)
    return [np.round(pose, 2).tolist() for pose in rng.uniform(0.5, 1.0, (5, 51)) + 3.0]


def mediapipe_frames() -> list[list[dict[str, float]]]:
    """Four frames of 33 landmarks."""
    values = np.round(np.random.default_rng(4).uniform(0.2, 1.0, (4, 33, 4)), 3)
    keys = ("x", "y", "z", "visibility")
    return [[dict(zip(keys, map(float, row), strict=True)) for row in frame] for frame in values]


def player_files() -> dict[str, bytes]:
    """A small valid file of every format of musicians: points, notes, sets."""
    rng = np.random.default_rng(9)
    body, hand, whole = (rng.uniform(0.4, 1.0, (count, 3)).round(3) * [640, 480, 1] for count in (25, 21, 133))
    keys = ("pose_keypoints_2d", "hand_left_keypoints_2d", "hand_right_keypoints_2d")
    person = dict(zip(keys, (points.ravel().tolist() for points in (body, hand, hand + 1)), strict=True))
    points = [{"x": 0.5 + 0.01 * place, "y": 0.25, "z": 0.0, "visibility": 0.0} for place in range(21)]
    frame = {"pose_landmarks": mediapipe_frames()[0], "left_hand_landmarks": points, "right_hand_landmarks": None}
    hands = [{"handedness": side, "score": 0.9, "landmarks": points} for side in ("Left", "Right")]
    about = {"fps": 30.0, "size": [640, 480], "mirrored": True, "handedness": "mirrored"}
    sides = [f"{side}_{part}" for side in "lr" for part in ("wrist", "thumb", "index", "middle", "ring", "little")]
    notes = np.array([[0.0, 0.15, 36, 0, 4], [0.05, 0.1, 60, 1, 0]], np.float32)
    clip = {"positions_tenth_mm": rng.integers(-4000, 4000, (4, 12, 3)).astype(np.int16), "fps": np.float32(20)}
    clip |= {"joints": np.array(sides), "notes": notes, "pressed": np.zeros((4, 12), bool)}
    tracked = {"left_hand": rng.uniform(0, 640, (5, 21, 2)).astype(np.float16), "fps": 25.0, "notes": notes[:, :4]}
    tracked |= {"body": rng.uniform(0, 640, (5, 2, 2)), "joints": np.array(["left_wrist", "nose"])}
    tracked["visibility"] = np.ones((5, 2))
    return {
        "players/take_000000000001_keypoints.json": json.dumps({"people": [person]}).encode(),
        "wholebody.json": json.dumps([{"image_id": n, "keypoints": whole.ravel().tolist()} for n in range(3)]).encode(),
        "holistic.json": json.dumps({**about, "frames": [frame, None, frame]}).encode(),
        "hands.json": json.dumps({**about, "frames": [{"hands": hands}] * 3}).encode(),
        "set/clip_001.npz": saved(np.savez, **clip),
        "set/clips.csv": b"clip,piece,seconds\nclip_001,7,0.2\n",
        "pianist.npz": saved(np.savez, **tracked),
        "notes.csv": b"onset_s,offset_s,midi,loudness,hand\n0.0,0.5,60,0.5,left\n0.25,0.75,64,1.0,right\n",
    }


def model_files() -> dict[str, bytes]:
    """A small valid file of every format that models of dance write."""
    rng = np.random.default_rng(11)
    pose, way = 0.2 * rng.normal(size=(6, 24, 3)), rng.normal(size=(6, 3)) * 0.1
    joints = np.linspace(0, 1.7, 24)[None, :, None] * [0.1, 1.0, 0.1] + way[:, None]
    rows = np.zeros((6, 22, 6))
    rows[..., 0] = rows[..., 4] = 1.0
    vectors = np.zeros((6, 263))
    # An SMPL file whose points are its joints, with three numbers of shape.
    shapes = {"J_regressor": np.eye(24), "v_template": joints[0], "shapedirs": rng.normal(size=(24, 3, 3)) * 0.01}
    shapes["kintree_table"] = np.array([SMPL_24.parents, range(24)])
    vectors[:, 4:67] = (joints[:, 1:22] - joints[:, :1] * [1, 0, 1]).reshape(6, 63)
    return {
        "amass.npz": saved(np.savez, poses=np.zeros((6, 156)), trans=way, betas=np.ones(16), mocap_framerate=120.0),
        "edge.pkl": pickle.dumps({"smpl_poses": pose.reshape(6, 72), "smpl_trans": way, "full_pose": joints}),
        "bailando.pkl.npy": saved(np.save, {"pred_position": joints.reshape(6, 72)}, allow_pickle=True),
        "dance.json": json.dumps({"id": "a", "dance_array": joints.round(3).reshape(6, 72).tolist()}).encode(),
        "lodge.npy": saved(np.save, np.concatenate([np.ones((6, 4)), way, rows.reshape(6, 132)], axis=1)),
        "humanml.npy": saved(np.save, vectors),
        "fact.npy": saved(np.save, np.hstack([np.zeros((6, 6)), way, np.tile(np.eye(3).ravel(), (6, 24))])),
        "smpl.npz": saved(np.savez, **shapes),
        "bailando/ep000010_frame000001_kps.json": json.dumps({"3d_pose": joints[0].round(3).tolist()}).encode(),
    }


@cache
def valid_files() -> dict[str, bytes]:
    """A small valid file of every format."""
    three, coco = poses(), poses(8, 17)
    named = {"positions": three, "fps": 30.0, "joints": ["a", "b", "c"], "parents": [-1, 0, 1], "valid": [True] * 6}
    body = np.round(poses(12, 23) * 100, 3)
    tang = {"length": 12, "center": body[:, 0].tolist(), "skeletons": body.tolist()}
    lines = [{"frame": n, "predictions": [{"keypoints": pose}]} for n, pose in enumerate(coco_poses(), 1)]
    return {
        "sound.wav": sound_bytes("WAV", "PCM_16"),
        "sound.flac": sound_bytes("FLAC", "PCM_16", 2),
        "sound.ogg": sound_bytes("OGG", "VORBIS"),
        "sound.mp3": sound_bytes("MP3", "MPEG_LAYER_III"),
        "motion.npz": saved(np.savez, **named, units="m"),
        "packed.npz": saved(np.savez_compressed, **named),
        "points.npy": saved(np.save, three),
        "flat.npy": saved(np.save, coco[:, :, :2].reshape(8, 34)),
        "walk.bvh": bvh_text().encode(),
        "gBR_sBM_cAll_d04_mBR0_ch01.pkl": pickle.dumps({"keypoints3d": coco, "keypoints3d_optim": coco[::2]}),
        "skeletons.json": json.dumps(tang, separators=(",", ":")).encode(),
        "config.json": b'{"start_position": 1, "end_position": 13}',
        "frames/dance_000000000001_keypoints.json": json.dumps(openpose_frame()).encode(),
        "coco.json": json.dumps([{"image_id": n, "keypoints": pose} for n, pose in enumerate(coco_poses())]).encode(),
        "lines.jsonl": "\n".join(map(json.dumps, lines)).encode(),
        "landmarks.json": json.dumps({"fps": 30.0, "aspect": 1.5, "frames": mediapipe_frames()}).encode(),
        "song.beats": b"# comment\n0.50 1\n1.00 2\n1.50 3\n2.00 1\n2.50 2\n",
        "song.csv": b"time,strength\n0.5,1.0\n1.0,0.25\n1.5,0.75\n2.0,0\n",
        "song.txt": b"5.0e-01\n1.0e+00\n1.5e+00\n2.0e+00\n",
        "beats.json": json.dumps(annotation()).encode(),
        **player_files(),
        **model_files(),
    }


NUMBERS = [0, 1, 2, 255, 2**15 - 1, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1]
WORDS = [b"nan", b"-inf", b"1e999", b"-1", b"0", b"9" * 30, b"9" * 5000, b"null", b'"x"', b"[]", b"{}", b"[" * 3000]
WORDS += [b"\x00", b"\xff\xfe", b",", b"\n", b"}", b"OFFSET", b"true", b"1e-320", b"(1<<99,)"]


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` after one to three random kinds of damage."""
    for _ in range(rng.integers(1, 4)):
        data = MUTATIONS[rng.integers(len(MUTATIONS))](bytearray(data), rng) or b"\x00"
    return data


def span(data: bytearray, rng: np.random.Generator) -> tuple[int, int]:
    first = int(rng.integers(len(data)))
    return first, first + int(rng.integers(1, max(2, min(64, len(data) - first + 1))))


def flip_bits(data: bytearray, rng: np.random.Generator) -> bytes:
    for place in rng.integers(len(data), size=rng.integers(1, 9)):
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def splice(data: bytearray, rng: np.random.Generator) -> bytes:
    first, last = span(data, rng)
    place = int(rng.integers(len(data)))
    return bytes(data[:place] + data[first:last] + data[place:])


def overwrite(data: bytearray, rng: np.random.Generator) -> bytes:
    """A part that is noise, zeros, or gone."""
    first, last = span(data, rng)
    size = len(data[first:last])
    data[first:last] = (rng.bytes(size), bytes(size), b"")[rng.integers(3)]
    return bytes(data)


def edit_header(data: bytearray, rng: np.random.Generator) -> bytes:
    """An extreme number somewhere in the first or last bytes, where sizes and rates stand."""
    size = int(rng.choice([1, 2, 4, 8]))
    number = NUMBERS[rng.integers(len(NUMBERS))] % 256**size
    place = int(rng.integers(min(len(data), 96)))
    place = place if rng.random() < 0.7 else len(data) - 1 - place
    data[place : place + size] = number.to_bytes(size, "little" if rng.random() < 0.7 else "big")
    return bytes(data)


def replace_word(data: bytearray, rng: np.random.Generator) -> bytes:
    first, last = span(data, rng)
    return bytes(data[:first] + WORDS[rng.integers(len(WORDS))] + data[min(last, first + 6) :])


MUTATIONS = (
    *(flip_bits, lambda data, rng: bytes(data[: rng.integers(len(data))]), splice),
    *(overwrite, overwrite, overwrite, edit_header, edit_header, replace_word, replace_word),
)


def arrays_of_points(path: Path) -> list[np.ndarray]:
    points = load_player_points(path, default_fps=25)
    return [points.motion.positions, points.confidence]


def arrays_of_performance(one: Performance) -> list[np.ndarray]:
    return [one.motion.positions, np.array([one.offset]), *([] if one.notes is None else arrays_of_notes(one.notes))]


def arrays_of_notes(notes: Notes) -> list[np.ndarray]:
    return [notes.onsets, notes.offsets, notes.loudness]


def arrays_of_annotation(path: Path) -> list[np.ndarray]:
    notes, beats = load_annotation(path), load_beats(path)
    bars = [] if notes.downbeats is None else [notes.downbeats]
    return [notes.times, *bars, beats.times, beats.strengths, np.array([beats.duration])]


def arrays_of_sound(path: Path) -> list[np.ndarray]:
    info, part = audio_info(path), load_audio(path, start=0.0, duration=0.05, sample_rate=None)
    return [np.array([info.seconds, info.sample_rate]), part.samples, load_audio(path).samples]


def arrays_of_body(path: Path) -> list[np.ndarray]:
    body = load_body(path, np.array([0.5, -1.0]))
    return [body.body.offsets, body.pelvis]


def arrays_of_motion(path: Path) -> list[np.ndarray]:
    has_no_rate = path.name.endswith("npy") or path.name in ("coco.json", "lines.jsonl", "edge.pkl", "dance.json")
    motion = load_any_motion(path, fps=30.0 if has_no_rate else None)
    return [motion.positions, np.array([motion.fps])]


# Readers by the name of a file's folder, of the file, or of what comes before its suffix; all else is a motion.
READERS: dict[str, Callable[[Path], list[np.ndarray]]] = {
    "players/": lambda path: arrays_of_points(path.parent),
    "bailando/": lambda path: [load_motion(path.parent, fps=60.0).positions],
    "frames/": lambda path: [load_motion(path.parent, fps=25).positions],
    "set/": lambda path: [array for one in load_pianomime(path.parent) for array in arrays_of_performance(one)],
    **dict.fromkeys(("wholebody", "holistic", "hands"), arrays_of_points),
    "pianist": lambda path: arrays_of_performance(load_tracked(path)),
    "notes": lambda path: arrays_of_notes(load_notes(path)),
    "smpl": arrays_of_body,
    "sound": arrays_of_sound,
    **dict.fromkeys(("song", "beats"), arrays_of_annotation),
    "config": lambda path: [np.array(load_config(path))],
}


def arrays_of(path: Path) -> list[np.ndarray]:
    """Every array that reading a file gives."""
    name = next((name for name in (f"{path.parent.name}/", path.name.partition(".")[0]) if name in READERS), "")
    return READERS.get(name, arrays_of_motion)(path)


def outcome(path: Path, read: Callable[[Path], list[np.ndarray]]) -> str:
    """'result' or 'error'; anything that is neither fails the test."""
    try:
        arrays = read(path)
    except (ValueError, FileNotFoundError) as error:
        assert path.name in str(error) or path.parent.name in str(error), f"error without the file's name: {error}"
        return "error"
    assert all(np.isfinite(array).all() for array in arrays)
    return "result"


@pytest.mark.parametrize("name", valid_files())
def test_damaged_file_gives_a_finite_result_or_an_error_with_its_name(name: str, tmp_path: Path):
    rng = np.random.default_rng([SEED, list(valid_files()).index(name)])
    path, valid = tmp_path / name, valid_files()[name]
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(valid)
    if path.parent.name in ("frames", "players", "bailando"):
        (path.parent / path.name.replace("1_", "0_")).write_bytes(valid)
    if path.parent.name == "set":
        for part in ("set/clip_001.npz", "set/clips.csv"):
            (tmp_path / part).write_bytes(valid_files()[part])
    assert outcome(path, arrays_of) == "result"
    seen = set()
    for turn in range(tries(TRIES)):
        path.write_bytes(mutated(valid, rng))
        seen.add(outcome(path, arrays_of))
        if turn % 10 == 0:
            assert len(check(path)) == 1
    assert "error" in seen


def damaged_folders(parts: dict[str, bytes], folder: Path, rng: np.random.Generator) -> Iterator[Path]:
    """The folder with these files, one of them damaged, again and again; `check` has a row for it."""
    folder.mkdir()
    for turn in range(tries(FOLDERS)):
        damaged = list(parts)[turn % len(parts)]
        for name, content in parts.items():
            (folder / name).write_bytes(mutated(content, rng) if name == damaged else content)
        yield folder
        if turn % 10 < 4:
            assert len(check(folder)) == 1


@cases(
    "name, parts",
    ("own", {"audio.wav": "sound.wav", "motion.npz": "motion.npz", "beats.json": "beats.json"}),
    ("DANCE_W_1", {"audio.mp3": "sound.mp3", "skeletons.json": "skeletons.json", "config.json": "config.json"}),
)
def test_damaged_part_of_a_sequence_gives_a_clip_or_an_error_by_name(tmp_path: Path, name: str, parts: dict[str, str]):
    content = {part: valid_files()[kind] for part, kind in parts.items()}
    for folder in damaged_folders(content, tmp_path / name, np.random.default_rng([SEED, 99])):
        outcome(folder, lambda folder: [load_recording(folder).clip.motion.positions])


def test_damaged_part_of_a_performance_gives_one_or_an_error_with_its_name(tmp_path: Path):
    about = {"instrument": "piano", "fps": 25, "points": ["holistic.json"], "piece": "x", "size": [640, 480]}
    about |= {"offset_s": 0.05, "mirrored": False, "rendered": True}
    content = {name: valid_files()[name] for name in ("sound.wav", "notes.csv", "holistic.json")}
    content["performance.json"] = json.dumps(about).encode()
    folders = damaged_folders(content, tmp_path / "take", np.random.default_rng([SEED, 98]))
    seen = {outcome(one, lambda folder: arrays_of_performance(load_performance(folder))) for one in folders}
    assert seen == {"error", "result"}


class Malicious:
    """Pickles to a call of any function with any arguments."""

    def __init__(self, function: Callable[..., object], *arguments: object):
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


def malicious_pickles(marker: Path) -> dict[str, bytes]:
    """Pickles that run code, hold objects, or want all the memory."""
    touch = f"open({str(marker)!r}, 'w').close()"
    zeros = np.zeros((4, 17, 3))
    huge = pickle.dumps({"keypoints3d": zeros}, protocol=4).replace(b"K\x04K\x11K\x03", b"J\xff\xff\xff\x7fK\x11K\x03")
    call = b"\x80\x04cnumpy\nndarray\n(J\xff\xff\xff\x7fJ\xff\xff\xff\x7ft\x85R."
    return {
        "eval": pickle.dumps(Malicious(eval, touch)),
        "exec": pickle.dumps(Malicious(exec, touch), protocol=0),
        "system": pickle.dumps({"keypoints3d": Malicious(os.system, f"touch {marker}")}),
        "system in plain words": f"cos\nsystem\n(S'touch {marker}'\ntR.".encode(),
        "getattr": b"\x80\x04cbuiltins\ngetattr\n(cnumpy\nndarray\nX\x05\x00\x00\x00dtypetR.",
        "numpy load": pickle.dumps(Malicious(np.load, str(marker))),
        "dotted name": b"\x80\x04\x8c\x05numpy\x8c\x0endarray.tofile\x93.",
        "bytes of no text": b"\x80\x02c_codecs\nencode\nK\x01K\x01\x86R.",
        "objects": pickle.dumps({"keypoints3d": np.array([Malicious(eval, touch)] * 51, object).reshape(1, 17, 3)}),
        "strings": pickle.dumps({"keypoints3d": np.full((4, 17, 3), "1.0")}),
        "instance": b"(ios\nsystem\n.",
        "extension": b"\x80\x02\x82\x01.",
        "persistent": b"Pos\n.",
        "huge shape": huge,
        "huge ndarray": call,
        "huge memo": b"\x80\x02]r\xff\xff\xff\x7f.",
        "huge string": b"\x80\x04\x8d\xff\xff\xff\xff\xff\xff\xff\x0f.",
        "huge bytes": b"\x80\x05\x96\x00\x00\x00\x00\xff\x00\x00\x00.",
        "huge frame": b"\x80\x04\x95\xff\xff\xff\xff\xff\xff\xff\x7f.",
        "nested": b"\x80\x04" + b"(" * 200_000 + b"l" * 200_000 + b".",
        "many lists": b"\x80\x04" + b"]" * 2_000_000 + b".",
        "one list": pickle.dumps({"keypoints3d": [[[1.0] * 3] * 17] * 4}),
        "one text": b"\x80\x02}X\x01\x00\x00\x00aX\xff\xff\x00\x00" + b"a" * 65535 + b"q\x00h\x00\x86s.",
        "no dictionary": pickle.dumps([zeros]),
        "one frame": pickle.dumps({"keypoints3d": zeros[:1]}),
        "fewer bytes": pickle.dumps({"keypoints3d": zeros}, protocol=4)[:-200] + b".",
    }


def test_malicious_pickle_is_refused_and_runs_nothing(tmp_path: Path):
    marker = tmp_path / "ran"
    for name, content in malicious_pickles(marker).items():
        path = tmp_path / f"{name.replace(' ', '_')}.pkl"
        path.write_bytes(content)
        refused(path.name, load_motion, path)
    shared = "holds one list or long text in several places"
    for name, fault in (("system", "asks for posix.system"), ("one_list", shared), ("one_text", shared)):
        refused(f"{name}.pkl: .*{fault}", load_motion, tmp_path / f"{name}.pkl")
    assert not marker.exists()


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
@pytest.mark.parametrize("module", [b"numpy._core", b"numpy.core"])
def test_honest_pickle_of_either_numpy_gives_its_arrays(protocol: int, module: bytes):
    points = np.asfortranarray(poses(4, 17)).astype(">f4")
    data = pickle.dumps({"keypoints3d": points, "scale": np.float64(2.5), "n": 3}, protocol=protocol)
    if module == b"numpy.core":
        for name in (b".multiarray", b".numeric"):
            long, short = b"numpy._core" + name, b"numpy.core" + name
            data = data.replace(bytes([len(long)]) + long, bytes([len(short)]) + short).replace(long, short)
    data = data if protocol < 4 else data[:2] + data[11:]  # without the frame, whose length changed
    content = read_array_pickle(data)
    np.testing.assert_array_equal(content["keypoints3d"], points)
    assert (content["scale"], content["n"]) == (2.5, 3)


def npy_header(descr: str, shape: str) -> bytes:
    head = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


def hostile_arrays() -> dict[str, bytes]:
    """`.npy` and `.npz` files whose headers lie, or that unpack to far more than they are."""
    lies = {
        "huge.npy": npy_header("'<f8'", "(1000000000, 1000, 3)") + bytes(4800),
        "negative.npy": npy_header("'<f8'", "(-5, 3, 3)") + bytes(4800),
        "overflow.npy": npy_header("'<f8'", f"({2**62}, 4, 3)") + bytes(4800),
        "empty_items.npy": npy_header("'<U0'", "(1000000000000,)"),
        "objects.npy": saved(np.save, np.array([[None]], object), allow_pickle=True),
        "structured.npy": npy_header("[('x', '<f8', (1000000,))]", "(100,)"),
        "complex.npy": saved(np.save, poses() * 1j),
        "text.npy": saved(np.save, np.array(["a", "b"])),
        "one_frame.npy": saved(np.save, poses(1)),
        "no_joints.npy": saved(np.save, np.zeros((5, 0, 3))),
        "four_dimensions.npy": saved(np.save, np.zeros((2, 5, 3, 3))),
        "number.npy": saved(np.save, np.float64(3)),
        "code.npy": npy_header("__import__('os').getcwd()", "(1,)"),
        "deep.npy": npy_header("'<f8'", "(" * 4000),
        "not_a_number.npy": saved(np.save, np.where(np.arange(54).reshape(6, 3, 3) == 7, np.nan, 1.0)),
        "infinite.npy": saved(np.save, np.where(np.arange(54).reshape(6, 3, 3) == 7, np.inf, 1.0)),
        "long_double.npy": saved(np.save, poses().astype(np.longdouble)),
    }
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("positions.npy", "w", force_zip64=True) as member:
            member.write(npy_header("'<f8'", "(4000000, 3, 3)"))
            for _ in range(275):
                member.write(bytes(2**20))
        archive.writestr("fps.npy", saved(np.save, 25.0))
    return lies | {
        "bomb.npz": bomb.getvalue(),
        "text.npz": b"this is not a zip file",
        "nan_fps.npz": saved(np.savez, positions=poses(), fps=np.nan),
        "many_fps.npz": saved(np.savez, positions=poses(), fps=np.ones(3)),
        "objects.npz": saved(np.savez, positions=np.array([[[None]]]), fps=25.0),
        "cycle.npz": saved(np.savez, positions=poses(), fps=25.0, parents=[0, 1, 2]),
        "short_valid.npz": saved(np.savez, positions=poses(), fps=25.0, valid=np.ones(2, bool)),
        "bad_text.npz": saved(np.savez, positions=poses(), fps=25.0, joints=np.full(3, 2**31, "<u4").view("<U1")),
    }


def test_array_file_that_lies_about_itself_is_refused_by_name(tmp_path: Path):
    for name, content in hostile_arrays().items():
        path = tmp_path / name
        path.write_bytes(content)
        refused(name, load_motion, path, fps=25.0 if name.endswith("npy") else None)


numbers = hnp.arrays(
    st.sampled_from([np.float64, np.float32, np.int64, np.bool_]),
    hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5),
)
scalars = st.one_of(st.floats(), st.integers(), st.none(), st.text(max_size=3), st.complex_numbers())
hostile = settings(max_examples=tries(ARRAYS), deadline=None, suppress_health_check=list(HealthCheck), database=None)


def finite_or_value_error(build: Callable[[], object], *fields: str) -> None:
    """Run `build`; the record it gives must be finite, or it must raise ValueError."""
    try:
        record = build()
    except ValueError:
        return
    assert all(np.isfinite(getattr(record, field)).all() for field in fields)


@hostile
@given(numbers, scalars)
def test_any_array_makes_finite_audio_or_a_value_error(samples: np.ndarray, rate: object):
    finite_or_value_error(lambda: Audio(samples, rate), "samples", "sample_rate")


@hostile
@given(numbers, scalars, st.one_of(st.none(), numbers))
def test_any_array_makes_finite_motion_or_a_value_error(positions: np.ndarray, fps: object, valid: np.ndarray | None):
    joints = Skeleton.unnamed(max(1, positions.shape[1] if positions.ndim > 1 else 1))
    finite_or_value_error(lambda: Motion(positions, fps, joints, valid), "positions", "fps")


@hostile
@given(numbers, numbers, scalars, scalars)
def test_arrays_make_finite_beats_or_a_value_error(times: np.ndarray, strengths: np.ndarray, fps: object, end: object):
    finite_or_value_error(lambda: BeatTrack(times, strengths, fps, end), "times", "strengths", "duration")
