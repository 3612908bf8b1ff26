"""Folders of sequences, what `check` finds in files and corpora, and the way from files to clips."""

import json
from dataclasses import asdict
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import soundfile

from harmolab.body.skeletons import Skeleton
from harmolab.cli.data_check import FileSummary, check
from harmolab.clips import corpus_recordings, load_clip
from harmolab.data import recordings as folders
from harmolab.data.recordings import find_recordings, load_any_motion, load_recording, recorded_offset
from harmolab.data.synthetic import synthetic_clip, write_corpus
from harmolab.lab.compare.auc import compare
from harmolab.params import BarPattern
from harmolab.readers.motion import save_motion
from harmolab.readers.video import write_video
from harmolab.types import Audio, Clip, Motion
from harmolab.verdict.bar_pattern import load_pattern, save_patterns
from tests.builders import refused

RATE = 8000
ARM = Skeleton(("hip", "head", "hand"), (-1, 0, 1))


def upright(frames: int = 50) -> np.ndarray:
    """(T, 3, 3) metres: a figure 1.7 m tall whose hand circles."""
    angle = 0.3 * np.arange(frames)
    still = np.zeros(frames)
    hand = np.stack([0.3 * np.cos(angle), 1 + 0.3 * np.sin(angle), still], axis=1)
    head = np.stack([0.01 * np.cos(angle), 1.7 + still, still], axis=1)
    return np.stack([np.zeros((frames, 3)), head, hand], axis=1)


MOTION = Motion(upright(), 25.0, ARM)


def own(folder: Path, *, beats: dict | None = None, positions: np.ndarray | None = None, fps: float = 25.0) -> Path:
    """A sequence in our layout: 3 s of quiet noise, 2 s of motion."""
    folder.mkdir(parents=True, exist_ok=True)
    soundfile.write(folder / "audio.wav", np.random.default_rng(1).uniform(-0.1, 0.1, 3 * RATE), RATE)
    save_motion(folder / "motion.npz", Motion(upright() if positions is None else positions, fps, ARM))
    if beats is not None:
        (folder / "beats.json").write_text(json.dumps(beats))
    return folder


def tang(folder: Path, *, frames: int = 50, span: int = 50) -> Path:
    """A sequence in the layout of Tang et al."""
    folder.mkdir(parents=True, exist_ok=True)
    poses = 80 * np.random.default_rng(2).uniform(-1, 1, (frames, 23, 3))
    content = {"length": frames, "center": np.full((frames, 3), 90.0).tolist(), "skeletons": poses.tolist()}
    (folder / "skeletons.json").write_text(json.dumps(content))
    (folder / "config.json").write_text(json.dumps({"start_position": 5, "end_position": 5 + span}))
    soundfile.write(folder / "audio.flac", np.random.default_rng(1).uniform(-0.1, 0.1, 3 * RATE), RATE)
    return folder


BEATS = {"beats_s": [0.5, 1.0, 1.5], "meter": 3, "bpm": 120.0, "dance": "jive", "source": "synthetic"}


def test_sequences_of_both_layouts_are_found_in_natural_order(tmp_path: Path):
    for name in ("DANCE_W_10", "DANCE_W_2"):
        tang(tmp_path / name)
    own(tmp_path / "group" / "clip_1")
    (tmp_path / "notes").mkdir()
    recordings = find_recordings(tmp_path)
    assert [folder.name for folder in recordings.folders] == ["DANCE_W_2", "DANCE_W_10", "clip_1"]
    assert recordings.problems == () and find_recordings(tmp_path / "DANCE_W_2").folders == (tmp_path / "DANCE_W_2",)


def test_recordings_that_are_links_are_found_and_none_twice(tmp_path: Path):
    root, other = tmp_path / "corpus", own(tmp_path / "elsewhere" / "clip_2")
    own(root / "clip_1")
    own(root / "taken" / "day" / "clip_3")
    links = {
        "latest": root / "taken" / "day",
        "clip_2": other,
        "more": other.parent,
        "again": root / "clip_1",
        "loop": root,
        "up": tmp_path,
        "gone": Path("no"),
    }
    for name, place in links.items():
        (root / name).symlink_to(place)
    folders = [root / name for name in ("clip_1", "clip_2", "taken/day/clip_3")]
    assert [*find_recordings(root).folders] == folders == [Path(row.path) for row in check(root)]


def test_recordings_that_lie_too_deep_are_found_by_a_link_that_leads_there(tmp_path: Path):
    day = tmp_path / "by" / "year" / "month" / "day"
    own(day / "clip_1")
    assert not find_recordings(tmp_path).folders
    for name in ("today", "twice"):
        (tmp_path / name).symlink_to(day)
    (day / "loop").symlink_to(day)
    folders = [tmp_path / "today" / "clip_1"]
    assert [*find_recordings(tmp_path).folders] == folders == [Path(row.path) for row in check(tmp_path)]


def test_folder_with_missing_parts_is_a_problem_and_not_fatal(tmp_path: Path):
    (tang(tmp_path / "DANCE_W_1") / "audio.flac").unlink()
    (tang(tmp_path / "DANCE_W_2") / "config.json").unlink()
    motion, song, _ = (own(tmp_path / name) / "motion.npz" for name in ("a", "b", "good"))
    other = motion.rename(motion.with_name("dance.npz"))
    motion.symlink_to(motion)
    song.with_name("audio.wav").rename(song.with_name("song.WAV"))
    recordings = find_recordings(tmp_path)
    assert [folder.name for folder in recordings.folders] == ["good"]
    faults, sound = [message for _, message in recordings.problems], "has no audio.wav (.flac, .ogg, .mp3, .m4a)"
    cures = f"; harmolab data convert {other} {motion} writes it", "; rename song.WAV to audio.wav"
    lacking = sound, "has no config.json", f"has no motion.npz{cures[0]}", sound + cures[1]
    assert [fault.split(": ")[1] for fault in faults] == [*lacking]


def test_a_folder_that_cannot_be_read_is_a_problem(tmp_path: Path):
    with patch("os.scandir", side_effect=PermissionError(13, "Permission denied", "closed")):
        assert find_recordings(tmp_path).problems == ((Path("closed"), "closed: Permission denied"),)


def test_missing_root_and_file_as_root_are_errors(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder"):
        find_recordings(tmp_path / "nowhere")
    (tmp_path / "file.txt").write_text("x")
    refused(r"file\.txt: is a file", find_recordings, tmp_path / "file.txt")


def test_own_layout_takes_dance_source_beats_and_offset_from_its_annotation(tmp_path: Path):
    sequence = load_recording(own(tmp_path / "clip_7", beats=BEATS | {"motion_offset_s": 0.75}))
    clip = sequence.clip
    assert (clip.name, clip.dance, clip.source, clip.offset) == ("clip_7", "jive", "synthetic", 0.75)
    np.testing.assert_array_equal(clip.beats.times, [0.5, 1.0, 1.5])
    assert clip.beats.duration == 3.0
    assert sequence.annotation.meter == 3
    np.testing.assert_array_equal(clip.motion.positions, upright())
    with pytest.raises(TypeError, match="load_recording has no argument fps"):
        load_recording(sequence.folder, fps=30.0)


def test_tang_layout_takes_the_dance_from_its_name_and_beats_from_an_annotation(tmp_path: Path):
    folder = tang(tmp_path / "corpus" / "DANCE_R_3")
    (folder / "beats.json").write_text(json.dumps({"beats_s": [0.5, 1.0]}))
    clip = load_recording(folder).clip
    assert (clip.dance, clip.source, clip.offset) == ("rumba", "corpus", 0.2) and len(clip.beats) == 2
    (folder / "beats.json").unlink()
    bare = load_recording(folder, clock=1.01, points=21)
    assert (bare.annotation, bare.clip.beats) == (None, None)
    assert (bare.clip.motion.positions.shape, bare.clip.motion.fps) == ((50, 21, 3), pytest.approx(25 / 1.01))


def test_motion_and_beats_much_longer_than_the_audio_ask_whether_their_unit_is_right(tmp_path: Path):
    folder = own(tmp_path / "clip", fps=5.0)
    refused(r"clip: the motion lasts 10\.00 s at 5 fps and ends 7\.00 s after the audio", load_recording, folder)
    own(folder, beats={"beats_s": [1.0, 2.0, 3.5]})
    fault = r"beats\.json: beat times reach 3\.5 in a clip of 3 s; were these frames"
    refused(fault, load_recording, folder)
    refused(fault, load_clip, folder / "audio.wav", folder / "motion.npz", beats=folder / "beats.json")


def test_unreadable_sequence_is_reported_beside_the_readable_ones(tmp_path: Path):
    (own(tmp_path / "a") / "motion.npz").write_bytes(b"PK broken")
    own(tmp_path / "b")
    (own(tmp_path / "c") / "audio.wav").unlink()
    rows = list(folders.iter_recordings(tmp_path))
    problems = {row.folder.name: row.message for row in rows if isinstance(row, folders.Problem)}
    assert [row.folder.name for row in rows if isinstance(row, folders.Recording)] == ["b"]
    assert set(problems) == {"a", "c"} and "motion.npz: cannot be read as an .npz motion" in problems["a"]


def test_any_motion_is_read_from_folders_of_both_layouts_and_from_files(tmp_path: Path):
    folder = tang(tmp_path / "DANCE_R_3")
    assert load_any_motion(folder).positions.shape == (50, 23, 3)
    assert load_any_motion(folder / "skeletons.json").fps == 25
    assert load_any_motion(own(tmp_path / "clip")).n_frames == 50
    assert load_any_motion(tmp_path / "clip" / "motion.npz").n_frames == 50


# check


def odd(path: Path) -> str:
    """All odd things that `check` finds in one file or folder."""
    (row,) = check(path)
    return "; ".join(row.odd)


def test_check_of_a_good_sequence_gives_its_numbers_and_nothing_odd(tmp_path: Path):
    folder = own(tmp_path / "clip", beats=BEATS | {"motion_offset_s": 0.5})
    (row,) = check(folder)
    assert row == FileSummary(str(folder), "sequence", 50, 25.0, 3, 2.0, 0.5, "jive, 3.00 s of audio, 3 beats", ())
    assert json.loads(json.dumps(asdict(row)))["odd"] == []


def test_check_names_what_is_odd_about_a_motion(tmp_path: Path):
    frozen, fast = upright(), upright()
    frozen[10:30] = frozen[10]
    fast[20, 2, 0] += 0.6
    assert odd(own(tmp_path / "frozen", positions=frozen)) == "frozen once, longest 0.76 s at 0.40 s"
    assert "faster than 10 m/s in 2 frames, up to" in odd(own(tmp_path / "fast", positions=fast))
    assert "(hand, 0.80 s)" in odd(tmp_path / "fast")
    assert "extends over 0.017 m: other units? pass scale (--scale)" in odd(
        own(tmp_path / "tiny", positions=upright() / 100)
    )
    assert "beside files in metres, convert this one by harmolab data convert" in odd(tmp_path / "tiny")
    assert "1 frame shorter than config.json says (51)" in odd(tang(tmp_path / "DANCE_W_1", span=51))
    save_motion(own(tmp_path / "filler") / "motion.npz", Motion(upright(), 25, ARM, np.arange(50) > 3))
    assert "4 of 50 frames are filler" in odd(tmp_path / "filler")
    assert "no beat for 1.20 s" in odd(own(tmp_path / "gap", beats={"beats_s": [0.2, 0.6, 1.0, 2.2, 2.6]}))


def test_check_of_arrays_and_key_points_without_a_rate_says_so(tmp_path: Path):
    np.save(tmp_path / "walk.npy", upright())
    (row,) = check(tmp_path / "walk.npy")
    assert (row.frames, row.rate, row.seconds, row.joints) == (50, None, None, 3)
    assert row.odd == ("holds no frame rate: pass fps (--fps)",)
    points = {"people": [{"pose_keypoints_2d": [100.0, 200.0, 0.9] * 25}]}
    (tmp_path / "frames").mkdir()
    for frame in range(30):
        (tmp_path / "frames" / f"film_{frame:012d}_keypoints.json").write_text(json.dumps(points))
    (row,) = check(tmp_path / "frames")
    assert (row.kind, row.frames, row.rate, row.odd[0]) == ("motion", 30, None, "holds no frame rate: pass fps (--fps)")


def test_check_of_sound_and_beats_gives_their_numbers(tmp_path: Path):
    soundfile.write(tmp_path / "song.wav", np.zeros((RATE, 2)), RATE)
    (tmp_path / "song.beats").write_text("0.5 1\n1.0 2\n1.5 3\n4.0 1\n")
    beats, sound = check(tmp_path)
    facts = (sound.kind, sound.frames, sound.rate, sound.seconds, sound.note)
    assert facts == ("audio", 8000, 8000, 1.0, "WAV, 2 channels")
    assert sound.odd == ("silent from beginning to end",)
    assert (beats.kind, beats.frames, beats.note) == ("beats", 4, "120.0 beats a minute, 3 beats a bar")
    assert beats.odd == ("no beat for 2.50 s after 1.50 s, others are 0.50 s apart",)


def test_check_of_a_corpus_has_a_row_for_each_sequence_problem_and_loose_file(tmp_path: Path):
    own(tmp_path / "a")
    (own(tmp_path / "b") / "audio.wav").unlink()
    (tmp_path / "loose.csv").write_text("time\n0.5\n1.0\n")
    (tmp_path / "beats of a program.json").write_text('{"path": "song.mp3", "beats": [0.5, 1.0]}')
    points = json.dumps([{"image_id": frame, "keypoints": [9.0] * 51} for frame in range(3)])
    (tmp_path / "points.json").write_text(points)
    (tmp_path / "cut off.json").write_text(points[:-9])
    (tmp_path / "about.json").write_text('{"camera": "phone"}')
    rows = {Path(row.path).name: row for row in check(tmp_path)}
    kinds = {"a": "sequence", "b": "unreadable", "loose.csv": "beats", "beats of a program.json": "beats"}
    assert {name: row.kind for name, row in rows.items()} == {
        **kinds, "points.json": "motion", "cut off.json": "unreadable",
    }  # fmt: skip
    assert "has no audio" in rows["b"].odd[0]


@pytest.mark.slow
def test_check_leaves_out_no_file_however_many_there_are(tmp_path: Path):
    for number in range(10_002):
        (tmp_path / f"{number}.npy").touch()
    assert len(check(tmp_path)) == 10_002


def test_check_of_nothing_known_is_a_row_and_of_nothing_an_error(tmp_path: Path):
    (tmp_path / "readme.md").write_text("hello")
    assert "holds no file that is known" in odd(tmp_path)
    assert "is no motion file that is known" in odd(tmp_path / "readme.md")
    (tmp_path / "pass fps.npy").write_bytes(b"damaged")  # whose name is no word about a missing rate
    assert check(tmp_path / "pass fps.npy")[0].kind == "unreadable"
    with pytest.raises(FileNotFoundError, match="gone: no such file or folder"):
        check(tmp_path / "gone")


@pytest.mark.data
@pytest.mark.parametrize(("corpus", "count"), [("tang2018", 32), ("tang2018_rebuilt", 3), ("beatlocked", 23)])
def test_recorded_corpus_is_found_whole(data_root: Path, corpus: str, count: int):
    recordings = find_recordings(data_root / corpus)
    assert (len(recordings.folders), recordings.problems) == (count, ())


@pytest.mark.data
def test_beat_locked_recording_has_beats_units_and_no_oddities(data_root: Path):
    sequence = load_recording(data_root / "beatlocked" / "DANCE_W_3")
    assert (sequence.clip.dance, sequence.annotation.meter, len(sequence.annotation.units)) == ("waltz", 3, 14)
    assert sequence.annotation.units[0].start == pytest.approx(sequence.clip.offset, abs=0.04)
    assert check(data_root / "beatlocked" / "DANCE_W_3")[0].odd == ()


@pytest.mark.data
def test_check_notices_the_tango_that_is_too_fast_and_a_held_pose(data_root: Path):
    assert "faster than 10 m/s in 66 frames" in odd(data_root / "tang2018" / "DANCE_T_5")
    assert "56 frames shorter than config.json says (2560)" in odd(data_root / "tang2018" / "DANCE_T_5")
    assert "frozen once, longest 2.00 s" in odd(data_root / "tang2018" / "DANCE_R_4")


def test_start_is_what_the_folder_tells(tmp_path: Path):
    ours, theirs = own(tmp_path / "ours", beats={**BEATS, "motion_offset_s": 0.75}), tang(tmp_path / "theirs")
    bare = own(tmp_path / "bare")
    save_motion(ours / "another.npz", MOTION)
    starts = [recorded_offset(path) for path in (ours, ours / "motion.npz", theirs, theirs / "skeletons.json")]
    assert starts == [0.75, 0.75, 0.2, 0.2]
    assert [recorded_offset(path) for path in (ours / "another.npz", theirs / "audio.flac", bare)] == [None, None, None]
    assert load_clip(ours / "audio.wav", ours / "motion.npz").offset == 0.75
    assert load_clip(ours / "audio.wav", ours / "motion.npz", offset=0.25).offset == 0.25


def test_joints_of_a_recording_can_be_chosen(tmp_path: Path):
    folder = tang(tmp_path / "DANCE_R_3")
    names = load_any_motion(folder).skeleton.joints[3:6]
    part = load_any_motion(folder, joints=names)
    assert part.skeleton.joints == names
    np.testing.assert_array_equal(part.positions, load_any_motion(folder).positions[:, 3:6])
    refused(r"skeletons\.json: .*no joints named \['tail'\]", load_any_motion, folder, joints=("tail",))


def test_start_is_what_a_motion_file_keeps(tmp_path: Path):
    save_motion(tmp_path / "dance.npz", MOTION, offset=7.5)
    assert recorded_offset(tmp_path / "dance.npz") == 7.5
    ours = own(tmp_path / "ours", beats={**BEATS, "motion_offset_s": 0.75})
    save_motion(ours / "motion.npz", MOTION, offset=0.5)
    save_motion(ours / "another.npz", MOTION, offset=0.25)
    assert [recorded_offset(ours / name) for name in ("", "motion.npz", "another.npz")] == [0.75, 0.75, 0.25]
    (ours / "beats.json").write_text(json.dumps(BEATS))
    assert [recorded_offset(ours), load_recording(ours).clip.offset] == [0.5, 0.5]
    (ours / "beats.json").unlink()
    assert [recorded_offset(ours), load_recording(ours).clip.offset] == [0.5, 0.5]


def test_files_of_a_recording_are_its_song_its_beats_and_its_dance(tmp_path: Path):
    ours = own(tmp_path / "ours", beats={**BEATS, "dance": "waltz"})
    assert folders.recording_files(ours) == (ours / "audio.wav", ours / "beats.json", "waltz")
    theirs = tang(tmp_path / "DANCE_R_3")
    assert folders.recording_files(theirs) == (theirs / "audio.flac", None, "rumba")
    (ours / "audio.wav").unlink()
    with pytest.raises(FileNotFoundError, match=r"ours: has no audio\.wav"):
        folders.recording_files(ours)


# From files to clips


@pytest.fixture(scope="module")
def clip() -> Clip:
    return synthetic_clip("cha-cha", seconds=8.0, seed=4)


@pytest.fixture(scope="module", params=["song.wav", "song.mp4"])
def song(request: pytest.FixtureRequest, clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clip's sound at 44,100 Hz, as a sound file and as a video."""
    path = tmp_path_factory.mktemp("song") / request.param
    samples = np.repeat(clip.audio.samples, 2)
    if path.suffix == ".wav":
        soundfile.write(path, samples, 44100)
    else:
        write_video(path, [np.zeros((64, 64, 3), np.uint8)] * 80, 10.0, audio=Audio(samples, 44100))
    return path


def test_beats_are_the_same_whatever_the_rate_of_the_sound(song: Path, clip: Clip):
    assert clip.motion is not None and clip.audio.sample_rate == 22050
    usual, full = load_clip(song, clip.motion), load_clip(song, clip.motion, sample_rate=None)
    assert (usual.audio.sample_rate, full.audio.sample_rate > 40000) == (22050, True) and len(usual.beats) > 8
    np.testing.assert_array_equal(full.beats.times, usual.beats.times)
    np.testing.assert_array_equal(full.beats.strengths, usual.beats.strengths)
    assert load_clip(song, clip.motion, track=False).beats is None


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=7, seconds=6.0, fps=30.0, seed=2)


def test_a_folder_is_compared_like_its_recordings(corpus: Path):
    folder = compare(corpus, n_rotations=20, dances=("rumba", "waltz"))
    recordings = compare(corpus_recordings(corpus), n_rotations=20, dances=("rumba", "waltz"), corpus=str(corpus))
    assert folder.summary == recordings.summary and sorted(folder.dances) == ["rumba", "waltz"]
    assert folder.summary["beats"] == "annotated"


def test_a_recording_without_annotation_makes_all_beats_tracked_and_one_that_cannot_be_read_is_left_out(tmp_path: Path):
    corpus = write_corpus(tmp_path / "synth", clips=2, seconds=4.0, fps=30.0, seed=1)
    broken = find_recordings(corpus).folders[0]
    (broken / "beats.json").unlink()
    assert compare(corpus, n_rotations=0).summary["beats"] == "tracked"
    (broken / "motion.npz").write_bytes(b"no motion")
    problems: list[Path] = []
    readable = list(corpus_recordings(corpus, report=lambda problem: problems.append(problem.folder)))
    assert (len(readable), problems) == (1, [broken])


def test_bar_patterns_come_back_as_they_were(tmp_path: Path):
    patterns = {
        "waltz": BarPattern(3, (0.5, 0.25), (-0.1, 0.0), "planted", "waltz"),
        "rumba": BarPattern(1, (-1.0,), (0.0,), "planted", "rumba"),
    }
    save_patterns(tmp_path / "patterns.json", patterns)
    assert {dance: load_pattern(tmp_path / "patterns.json", dance) for dance in patterns} == patterns
    refused("holds no pattern for --dance ''; it has waltz, rumba", load_pattern, tmp_path / "patterns.json")
    for content, fault in (("[]", "holds no bar patterns"), ('{"waltz": {}}', "pattern 'waltz' must have beats")):
        (tmp_path / "damaged.json").write_text(content)
        refused(rf"damaged\.json: .*{fault}", load_pattern, tmp_path / "damaged.json")


def test_one_gives_each_beat_its_place_in_the_bar_of_the_dance(song: Path, clip: Clip, tmp_path: Path):
    assert clip.beats is not None
    beats = load_clip(song, clip.motion, dance="cha-cha", one=float(clip.beats.times[6])).beats
    nearest = np.abs(beats.times - clip.beats.times[6]).argmin()
    assert beats.bar_places.tolist() == ((np.arange(len(beats)) - nearest) % 4).tolist()
    assert load_clip(song, clip.motion, dance="cha-cha").beats.bar_places is None
    (tmp_path / "song.beats").write_text("1.0\n1.7\n2.4\n3.1\n")
    beats = load_clip(song, clip.motion, dance="waltz", beats=tmp_path / "song.beats", one=1.69).beats
    assert beats.bar_places.tolist() == [2, 0, 1, 2]


def test_a_one_without_a_dance_or_a_beat_and_a_length_that_is_none_are_refused(song: Path, clip: Clip):
    refused("with --dance: cha-cha", load_clip, song, clip.motion, one=1.0)
    refused("no beat is near", load_clip, song, clip.motion, dance="waltz", one=99.0)
    for seconds in (0.0, -1.0, float("inf"), float("nan")):
        refused("seconds must be positive and finite", load_clip, song, clip.motion, seconds=seconds)
    refused(f"{song}: no motion from 0.0 s for 0.001 s", load_clip, song, clip.motion, seconds=0.001)
