"""`harmolab evaluate` on what the field's models write: a folder like AIST++, and what is said about its reading."""

import json
import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from harmolab.cli import app
from harmolab.lab.evaluate.evaluation import EvaluationSettings
from harmolab.lab.evaluate.pairing import Pair
from harmolab.lab.evaluate.rows import RowOptions, clip_row
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import BeatTrack
from tests.builders import called, cases, done, planted_dance, refused, write_song

run = partial(called, app)
SONGS = {"mBR0": "cha-cha", "mHO1": "rumba", "mWA5": "jive"}
SECONDS = 12.0
# Joint, axis and radians of what swings: arms, thighs, back.
SWINGS = ((16, 2, 0.6), (17, 2, -0.6), (18, 1, 0.5), (19, 1, -0.5), (1, 0, 0.3), (2, 0, -0.3), (3, 1, 0.2))
NEUTRAL = "joints of harmolab's neutral skeleton, not SMPL's"


def smpl_dance(music: BeatTrack, *, fps: float, tempo: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Poses (T, 72) that swing from beat to beat and rest on each, and a translation (T, 3), metres, y up.

    `tempo` is that of the dance over that of the music.
    """
    times = np.arange(round(music.duration * fps)) / fps
    beats = np.interp(times, music.times, np.arange(len(music))) * tempo
    swing, poses = np.cos(np.pi * beats), np.zeros((len(times), 24, 3))
    for joint, axis, size in SWINGS:
        poses[:, joint, axis] = size * swing
    way = np.stack([0.05 * swing, np.full(len(times), 0.95), np.zeros(len(times))], axis=1)
    return poses.reshape(-1, 72), way


@pytest.fixture(scope="module")
def aist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders as AIST++ has them, 60 frames a second: `songs` named by their ids, `motions` of two dancers each that
    rest on the beats, and `generated`, dances of the same names in a tempo of their own.
    """
    root = tmp_path_factory.mktemp("aist")
    for name in ("songs", "motions", "generated"):
        (root / name).mkdir()
    for number, (song, dance) in enumerate(SONGS.items()):
        clip = planted_dance(dance, seconds=SECONDS, seed=number)
        assert clip.beats is not None
        write_song(root / "songs" / f"{song}.wav", clip)
        for folder, choreography, tempo in (("motions", 1, 1.0), ("motions", 2, 1.0), ("generated", 1, 1.17)):
            poses, way = smpl_dance(clip.beats, fps=60.0, tempo=tempo)
            content = {"smpl_poses": poses, "smpl_trans": way * 93.8, "smpl_scaling": np.array([93.8])}
            name = f"g{song[1:3]}_sBM_cAll_d04_{song}_ch0{choreography}.pkl"
            (root / folder / name).write_bytes(pickle.dumps(content | {"smpl_loss": 0.1 * choreography}))
    return root


def pair_of(aist: Path) -> tuple[Path, Path]:
    """A song and a recorded dance to it."""
    return aist / "songs" / "mBR0.wav", aist / "motions" / "gBR_sBM_cAll_d04_mBR0_ch01.pkl"


@pytest.mark.slow
def test_a_folder_like_aist_evaluates_with_one_command(aist: Path, tmp_path: Path) -> None:
    out = tmp_path / "table"
    inputs = ("--music", aist / "songs", "--reference", aist / "motions")
    result = done(app, "evaluate", aist / "generated", *inputs, "--out", out, "--jobs", 0)
    clips = pd.read_csv(out / "clips.csv", keep_default_na=False)
    assert set(clips["error"]) == {""}
    by_song = clips.groupby(["system", "song"]).size().unstack()
    assert by_song.loc["generated"].to_dict() == dict.fromkeys(SONGS, 1)
    assert by_song.loc["recorded"].to_dict() == dict.fromkeys(SONGS, 2)
    assert (set(clips["fps"]), set(clips["joints"]), set(clips["assumptions"])) == ({60.0}, {24}, {NEUTRAL})
    harmony = clips.groupby("system")["harmony"].mean()
    assert harmony["recorded"] > 0.5
    assert max(harmony["generated"], harmony["recorded, other song"]) < harmony["recorded"] / 2
    assert harmony["frozen pose"] == 0
    content = json.loads((out / "table.json").read_text("utf-8"))
    said = f"Assumptions in reading recorded (dances): {NEUTRAL} (6)."
    assert said in content["methods_in_full"] and said in content["notes"]
    assert said in " ".join(result.output.split())
    assert NEUTRAL in (out / "index.html").read_text("utf-8").replace("&#39;", "'")


def test_rate_axis_and_body_of_the_options_are_for_files_that_leave_them_open(aist: Path, tmp_path: Path) -> None:
    song, recorded = pair_of(aist)
    joints = load_motion(recorded)
    z_up = np.stack([joints.positions[..., 0], -joints.positions[..., 2], joints.positions[..., 1]], axis=-1)
    np.save(tmp_path / "mBR0.npy", z_up[::2] * 100)
    save_motion(tmp_path / "mBR0.npz", joints)
    body = tmp_path / "smpl.npz"
    np.savez(body, J=joints.positions[0], kintree_table=np.array([joints.skeleton.parents, range(24)]))
    options = RowOptions(fps=30.0, up="z", smpl=body)
    rows = {}
    for motion in (recorded, tmp_path / "mBR0.npy", tmp_path / "mBR0.npz"):
        rows[motion.suffix] = clip_row(Pair("x", "", "mBR0", motion, song), options)
    readings = {suffix: (row["fps"], row["assumptions"]) for suffix, row in rows.items()}
    assert readings == {".pkl": (60.0, ""), ".npy": (30.0, "unit guessed: centimetres"), ".npz": (60.0, "")}
    # Feet that skate tell that the body stands as it was recorded: its file is not turned.
    plain = clip_row(Pair("x", "", "mBR0", tmp_path / "mBR0.npz", song), RowOptions())
    assert rows[".npz"]["foot_skating"] == plain["foot_skating"]
    assert rows[".npy"]["foot_skating"] == pytest.approx(plain["foot_skating"], rel=0.2)


@cases(
    "option, value, fault",
    ("--smpl", "none.npz", "none.npz: no such file"),
    ("--smpl", "songs/mBR0.wav", "mBR0.wav: is no .npz"),
    ("--up", "x", "'x' is not one of 'y', 'z'"),
)
def test_a_body_and_an_axis_that_cannot_be_end_the_command(
    aist: Path, tmp_path: Path, option: str, value: str, fault: str
) -> None:
    inputs = ("--music", aist / "songs", "--reference", aist / "motions", "--out", tmp_path / "table")
    named = aist / value if option == "--smpl" else value
    result = run("evaluate", aist / "generated", *inputs, option, named)
    assert result.exit_code == 2
    assert fault in " ".join(result.stderr.replace("│", " ").split())
    assert not (tmp_path / "table").exists()


def test_another_axis_than_y_and_z_is_refused_by_the_settings(aist: Path) -> None:
    folders = ({"x": aist / "generated"}, aist / "songs", aist / "motions")
    refused("up must be y or z", EvaluationSettings, *folders, up="x")


def test_score_says_in_one_line_what_was_assumed(aist: Path, tmp_path: Path) -> None:
    song, recorded = pair_of(aist)
    np.save(tmp_path / "dance.npy", load_motion(recorded).positions)
    save_motion(tmp_path / "dance.npz", load_motion(recorded))
    (line,) = run("score", song, recorded, "--json").stderr.splitlines()
    assert line.startswith(f"harmolab: {recorded.name}: read as joints of harmolab's neutral skeleton")
    (line,) = run("score", song, tmp_path / "dance.npy", "--fps", 60, "--json").stderr.splitlines()
    assert "read as metres (guessed: the body extends over" in line
    assert "y up (guessed: the head is" in line
    for options in (("dance.npz",), ("dance.npy", "--fps", 60, "--scale", 1, "--up", "y")):
        result = run("score", song, tmp_path / options[0], *options[1:], "--json")
        assert (result.exit_code, result.stderr) == (0, "")


@pytest.mark.parametrize(
    ("command", "more"),
    [("score", ("--why", "{}/x.html")), ("play", ("--out", "{}/x.html", "--seconds", 2)),
     ("play", ("--out", "{}/x.mp4", "--seconds", 1, "--height", 120, "--no-marks"))],
)  # fmt: skip
def test_other_commands_say_it_too(aist: Path, tmp_path: Path, command: str, more: tuple[object, ...]) -> None:
    result = done(app, command, *pair_of(aist), *(str(option).format(tmp_path) for option in more))
    said = [line for line in result.stderr.splitlines() if "read as joints of harmolab's neutral skeleton" in line]
    assert len(said) == 1
