"""Performances of musicians: folders written and read, sets in layouts of their own, and splits by piece."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from harmolab.cli.data_check import check
from harmolab.musician.performances import (
    Performance,
    find_performances,
    load_notes,
    load_performance,
    piece_groups,
    shared_patterns,
    split_by_piece,
)
from harmolab.readers.motion import load_detected, save_motion
from harmolab.readers.player_points import HANDS_12, PLAYER_50
from harmolab.readers.video import write_video
from harmolab.types import Audio, Motion, Notes
from study.experiments.instrument_sets import load_pianomime, load_tracked
from tests.builders import cases, refused, save_performance
from tests.test_player_keypoints import SIZE, holistic, openpose, openpose_folder

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
    motion = Motion(places, FPS, PLAYER_50)
    chosen = {"audio": sound(), "detected": detected, "offset": 0.125, "source": "tests", **fields}
    return Performance(name, "piano", motion=motion, **chosen)


def song_folder(folder: Path, **about: Any) -> Path:
    """The simplest folder: song.wav, points.json, and performance.json where there is something to say."""
    folder.mkdir(parents=True)
    soundfile.write(folder / "song.wav", sound(0.5).samples, 44100)
    frames = {"fps": 20.0, "size": SIZE, "frames": [holistic(shift) for shift in range(10)]}
    (folder / "points.json").write_text(json.dumps(frames))
    if about:
        (folder / "performance.json").write_text(json.dumps(about))
    return folder


# Written and read again


def test_saved_performance_comes_back_whole(tmp_path: Path):
    notes = Notes(
        np.array([0.1, 0.1, 1 / 3]), np.array([0.5, 0.7, 1.9]), np.array([36, 60, 88]), np.array([0.2, 1.0, 1 / 7]),
        np.array([0, 1, -1]),
    )  # fmt: skip
    one = performance(notes=notes, piece='op. 10/3 \u2013 "Tristesse"', rendered=True)
    save_performance(tmp_path / "one", one)
    again = load_performance(tmp_path / "one")
    np.testing.assert_array_equal(again.motion.positions, one.motion.positions)
    np.testing.assert_array_equal(again.detected, one.detected)
    assert (again.motion.skeleton, again.motion.fps) == (PLAYER_50, FPS)
    for field in ("name", "instrument", "offset", "piece", "rendered", "source"):
        assert getattr(again, field) == getattr(one, field)
    for field in ("onsets", "offsets", "pitches", "loudness", "hands"):
        np.testing.assert_array_equal(getattr(again.notes, field), getattr(notes, field))
    assert again.audio is not None
    np.testing.assert_allclose(again.audio.samples, sound().samples, atol=1 / 32768)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["one"]


def test_without_sound_a_performance_needs_notes(tmp_path: Path):
    save_performance(tmp_path / "notes", performance(audio=None, notes=notes_of([60])))
    assert load_performance(tmp_path / "notes").audio is None
    save_performance(tmp_path / "nothing", performance(audio=None))
    refused(r"nothing: has no sound .* and no notes\.csv", load_performance, tmp_path / "nothing")


def test_mask_of_a_motion_file_is_kept_and_none_where_there_is_none(tmp_path: Path):
    one = performance()
    save_motion(tmp_path / "a.npz", one.motion, detected=one.detected)
    save_motion(tmp_path / "b.npz", one.motion)
    np.testing.assert_array_equal(load_detected(tmp_path / "a.npz"), one.detected)
    assert load_detected(tmp_path / "b.npz") is None


# The folders of a user


def test_simplest_folder_needs_the_word_piano_in_its_name_and_nothing_else(tmp_path: Path):
    one = load_performance(song_folder(tmp_path / "Piano take 3"))
    assert (one.name, one.instrument, one.source) == ("Piano take 3", "piano", tmp_path.name)
    assert (one.motion.fps, one.offset, one.piece, one.rendered, one.notes) == (20, 0, "", False, None)
    assert one.motion.skeleton == PLAYER_50
    assert one.detected.all()
    assert one.audio is not None
    assert one.audio.sample_rate == 44100
    assert load_performance(song_folder(tmp_path / "violin" / "take")).instrument == "violin"
    assert load_performance(song_folder(tmp_path / "take"), instrument="violin").instrument == "violin"


def test_folder_that_does_not_say_the_instrument_is_refused_with_the_line_that_helps(tmp_path: Path):
    with pytest.raises(ValueError, match=r'take: does not say the instrument; write \{"instrument": "piano"\} into'):
        load_performance(song_folder(tmp_path / "take"))
    with pytest.raises(ValueError, match=r"other: instrument must be piano or violin, got 'tuba'"):
        load_performance(song_folder(tmp_path / "other"), instrument="tuba")
    own = song_folder(tmp_path / "own", instrument="violin")
    assert load_performance(own, instrument="piano").instrument == "violin"


def test_openpose_folder_beside_a_song_needs_a_rate(tmp_path: Path):
    folder = tmp_path / "piano_1"
    openpose_folder(folder / "openpose", [[openpose(shift)] for shift in range(12)])
    soundfile.write(folder / "song.flac", sound(0.5).samples, 44100)
    refused(r'openpose: holds no frame rate; write "fps" into performance\.json', load_performance, folder)
    assert load_performance(folder, fps=24).motion.fps == 24
    (folder / "performance.json").write_text('{"fps": 25}')
    assert load_performance(folder, fps=24).motion.fps == 25


def test_video_beside_openpose_gives_sound_and_rate(tmp_path: Path):
    folder = tmp_path / "violin_2"
    openpose_folder(folder / "openpose", [[openpose(shift)] for shift in range(20)])
    frames = (np.full((48, 64, 3), number, np.uint8) for number in range(20))
    write_video(folder / "take.mp4", frames, 20.0, audio=sound(1.0))
    one = load_performance(folder)
    assert one.motion.fps == 20
    assert one.audio is not None
    assert one.audio.duration == pytest.approx(1.0, abs=0.1)


def test_frames_of_openpose_may_lie_beside_the_song(tmp_path: Path):
    folder = openpose_folder(tmp_path / "piano", [[openpose(shift)] for shift in range(12)])
    soundfile.write(folder / "song.wav", sound(0.5).samples, 44100)
    assert load_performance(folder, fps=24).motion.n_frames == 12
    assert find_performances(tmp_path).folders == (folder,)


def test_fields_of_performance_json_are_taken(tmp_path: Path):
    folder = song_folder(
        tmp_path / "take", instrument="piano", offset_s=0.1, piece="BWV 1004", name="me", source="home", comment=5,
        rendered=True, audio="song.wav", points=["points.json"],
    )  # fmt: skip
    soundfile.write(folder / "other.wav", sound(0.5).samples, 44100)
    (folder / "more.json").write_text("{}")
    one = load_performance(folder)
    assert (one.offset, one.piece, one.name, one.source, one.rendered) == (0.1, "BWV 1004", "me", "home", True)


def test_mirrored_recording_is_turned_back(tmp_path: Path):
    plain = load_performance(song_folder(tmp_path / "a", instrument="piano"))
    turned = load_performance(song_folder(tmp_path / "b", instrument="piano", mirrored=True))
    names = list(PLAYER_50.joints)
    left, right = names.index("left_thumb_4"), names.index("right_thumb_4")
    x, y = plain.motion.positions[:, right].T
    np.testing.assert_allclose(turned.motion.positions[:, left], np.column_stack([SIZE[0] - x, y]))


@pytest.mark.parametrize("rate", [8000, 192_000])
def test_sound_of_any_rate_comes_at_44100_hertz_or_as_it_is(tmp_path: Path, rate: int):
    folder = song_folder(tmp_path / "piano")
    soundfile.write(folder / "song.wav", sound(0.5, rate).samples, rate)
    one = load_performance(folder)
    assert one.audio is not None
    assert (one.audio.sample_rate, one.audio.duration) == (44100, pytest.approx(0.5, abs=1e-3))
    assert np.sqrt(np.mean(one.audio.samples[5000:17000] ** 2)) == pytest.approx(0.5 / np.sqrt(2), rel=0.01)
    kept = load_performance(folder, sample_rate=None).audio
    assert kept is not None
    assert kept.sample_rate == rate


def test_silence_and_a_single_note_are_a_performance(tmp_path: Path):
    folder = song_folder(tmp_path / "piano")
    soundfile.write(folder / "song.wav", np.zeros(22050), 44100)
    (folder / "notes.csv").write_text("onset_s,offset_s,midi\n")
    one = load_performance(folder)
    assert one.notes is not None
    assert len(one.notes) == 0
    assert one.audio is not None
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
    with pytest.raises(ValueError, match=fault) as raised:
        load_performance(folder)
    assert str(raised.value).startswith(str(folder))


def test_what_cannot_be_a_performance_is_refused_with_the_folder_and_the_fault(tmp_path: Path):
    folder = song_folder(tmp_path / "piano")
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder"):
        load_performance(tmp_path / "nowhere")
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


# Many folders


def test_performances_are_found_below_several_roots_and_parts_are_problems(tmp_path: Path):
    one = song_folder(tmp_path / "piano" / "take 10")
    two = song_folder(tmp_path / "piano" / "take 2")
    three = openpose_folder(tmp_path / "violin" / "c" / "openpose", [[openpose()]] * 2).parent
    soundfile.write(three / "c.ogg", sound(0.5).samples, 44100)
    (song_folder(tmp_path / "violin" / "silent") / "song.wav").unlink()
    (tmp_path / "piano" / "loose").mkdir()
    soundfile.write(tmp_path / "piano" / "loose" / "song.wav", sound(0.5).samples, 44100)
    folders, problems = find_performances([tmp_path / "piano", tmp_path / "violin"])
    assert folders == (two, one, three)
    assert [problem.folder.name for problem in problems] == ["loose", "silent"]
    assert "loose: has no points of the player: motion.npz, a .json" in problems[0].message
    assert "silent: has no sound" in problems[1].message
    assert find_performances(tmp_path).folders == folders
    assert find_performances(two).folders == (two,)


def test_song_above_its_performances_is_no_problem(tmp_path: Path):
    song_folder(tmp_path / "piano" / "take")
    soundfile.write(tmp_path / "piano" / "song.wav", sound(0.5).samples, 44100)
    assert find_performances(tmp_path).problems == ()


def test_root_that_is_none_is_refused(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder"):
        find_performances(tmp_path / "nowhere")
    (tmp_path / "file").write_text("")
    refused("file: is a file; a folder of performances is needed", find_performances, [tmp_path / "file"])


def test_check_says_how_a_performance_was_read(tmp_path: Path):
    folder = song_folder(tmp_path / "piano" / "take")
    content = json.loads((folder / "points.json").read_text())
    for frame in content["frames"][:4]:
        frame["left_hand_landmarks"] = None
    for frame in content["frames"]:
        frame["right_hand_landmarks"] = None
    (folder / "points.json").write_text(json.dumps(content))
    (row,) = check(tmp_path)
    assert (row.path, row.kind, row.frames, row.rate, row.joints, row.offset) == (
        str(folder),
        "performance",
        10,
        20,
        29,
        0,
    )
    assert row.note == "piano, points of points.json, 0.50 s of audio"
    assert "all its points of the left hand are detected in 60% of the frames only" in row.odd
    assert "no point of the right hand" in row.odd


def test_check_shows_a_saved_performance_once_and_a_part_as_unreadable(tmp_path: Path):
    save_performance(tmp_path / "one", performance(notes=notes_of([60, 62, 64]), rendered=True))
    save_performance(tmp_path / "two", performance(audio=None))
    rows = {Path(row.path).name: row for row in check(tmp_path)}
    assert {name: row.kind for name, row in rows.items()} == {"one": "performance", "two": "unreadable"}
    assert rows["one"].note == "piano, points of motion.npz, 2.00 s of rendered audio, 3 notes"
    assert "has no sound" in rows["two"].odd[0]


def test_check_reads_a_performance_without_a_rate(tmp_path: Path):
    folder = openpose_folder(tmp_path / "piano", [[openpose(shift)] for shift in range(12)])
    soundfile.write(folder / "song.wav", sound(0.5).samples, 44100)
    (row,) = check(tmp_path)
    assert (row.kind, row.rate, row.seconds) == ("performance", None, None)
    assert row.odd[0] == "holds no frame rate: pass fps"


# Notes


def test_notes_are_read_in_the_order_of_their_onsets_with_any_separator(tmp_path: Path):
    text = (
        "# from a score\nmidi;offset_s;finger;onset_s;hand\n60;1.5;1;1.0;right\n\n36.0;0.75;5;0.5;Left\n72;2.5;5;2.0;\n"
    )
    (tmp_path / "notes.csv").write_text(text)
    notes = load_notes(tmp_path / "notes.csv")
    assert notes.onsets.tolist() == [0.5, 1.0, 2.0]
    assert notes.offsets.tolist() == [0.75, 1.5, 2.5]
    assert notes.pitches.tolist() == [36, 60, 72]
    assert notes.hands.tolist() == [0, 1, -1]
    assert notes.loudness.tolist() == [1, 1, 1]


def test_a_table_without_notes_is_read(tmp_path: Path):
    (tmp_path / "notes.csv").write_text("onset_s,offset_s,midi\n")
    assert len(load_notes(tmp_path / "notes.csv")) == 0


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
    with pytest.raises(ValueError, match=fault) as raised:
        load_notes(tmp_path / "notes.csv")
    assert "notes.csv" in str(raised.value)


# Splits by piece


def player_of(name: str, piece: str = "", pitches: Sequence[int] | None = None, frames: int = 48) -> Performance:
    return performance(name, frames, piece=piece, audio=None, notes=None if pitches is None else notes_of(pitches))


def test_shared_patterns_is_the_share_of_four_notes_in_a_row_that_both_have():
    scale = notes_of([60, 62, 64, 65, 67])  # two patterns
    assert shared_patterns(scale, scale) == 1
    assert shared_patterns(scale, notes_of([60, 62, 64, 65, 50, 51, 52, 53])) == 0.5
    assert shared_patterns(scale, notes_of([61, 63, 65, 66, 68])) == 0
    assert shared_patterns(scale, notes_of([60, 62, 64])) == 0


def test_notes_of_a_chord_are_one_pattern_in_whatever_order_they_were_struck():
    late = 0.01 * np.array([0, 1, 2, 30, 31, 32])
    chords = [Notes(late, late + 0.2, np.array(keys)) for keys in ([60, 64, 67, 59, 62, 67], [67, 60, 64, 62, 67, 59])]
    assert shared_patterns(*chords) == 1


def test_pieces_that_share_patterns_are_one_group_through_any_of_their_performances():
    scale = [60, 62, 64, 65, 67, 69, 71, 72]
    performances = [
        player_of("a", "1", scale),
        player_of("b", "1", [40, 41, 43, 45, 46]),
        player_of("c", "2", [*scale[:5], 30, 31, 32]),  # two of its five patterns are in a
        player_of("d", "3", scale[::-1]),
        player_of("e"),
        player_of("f"),
    ]
    groups = piece_groups(performances)
    assert groups[0] == groups[1] == groups[2]
    assert len(set(groups)) == 4
    assert len(set(piece_groups(performances, most_shared=0.5))) == 5


def test_no_piece_is_on_two_sides_and_shares_are_nearly_as_asked():
    performances = [player_of(f"{piece}-{take}", str(piece)) for piece in range(40) for take in range(1 + piece % 3)]
    for seed in range(10):
        split = split_by_piece(performances, test_share=0.2, validation_share=0.1, seed=seed)
        assert sum(map(len, [{one.piece for one in side} for side in split])) == 40
        assert [len(side) / len(performances) for side in split] == pytest.approx([0.7, 0.1, 0.2], abs=0.05)
    assert split_by_piece(performances, seed=1) == split_by_piece(performances, seed=1)
    assert split_by_piece(performances, seed=1) != split_by_piece(performances, seed=2)


def test_every_side_gets_a_piece_and_a_share_of_nothing_gets_none():
    three = [player_of(name, name) for name in "abc"]
    assert [len(side) for side in split_by_piece(three)] == [1, 1, 1]
    assert [len(side) for side in split_by_piece(three, validation_share=0.0)][1] == 0
    refused("2 performances are of 2 pieces: too few for 3 sides", split_by_piece, three[:2])
    refused("must leave some to train on", split_by_piece, three, test_share=0.6, validation_share=0.4)
    refused("too few", split_by_piece, [])


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
    assert one.audio is None
    assert (one.motion.skeleton, one.motion.positions.shape) == (HANDS_12, (3, 12, 2))
    np.testing.assert_allclose(one.motion.positions[2], [[10 * point, 2] for point in range(12)])
    assert one.notes is not None
    assert one.notes.onsets.tolist() == [0.0, 0.05]
    assert one.notes.offsets.tolist() == [0.15, 0.1]
    assert one.notes.pitches.tolist() == [36, 60]
    assert one.notes.hands.tolist() == [0, 1]


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
    folder = pianomime_folder(tmp_path / "set", **changes)
    with pytest.raises(ValueError, match=fault) as raised:
        load_pianomime(folder)
    assert "clip_001.npz" in str(raised.value)


def test_table_of_pianomime_names_no_file_elsewhere(tmp_path: Path):
    folder = pianomime_folder(tmp_path / "set")
    (folder / "clips.csv").write_text("clip,piece\n../secret,1\n")
    refused(r"clips\.csv: names a clip '\.\./secret'", load_pianomime, folder)
    (folder / "clips.csv").write_text("clip,piece\nclip_002,1\n")
    with pytest.raises(FileNotFoundError, match=r"clip_002\.npz: no such file"):
        load_pianomime(folder)


def test_tracked_video_keeps_what_was_lost_in_its_mask(tmp_path: Path):
    body = np.full((4, 2, 2), 5.0, np.float16)
    hand = np.full((4, 21, 2), 7.0, np.float16)
    hand[1] = np.nan
    visibility = np.array([[1, 1], [1, 0.1], [1, 1], [1, 1]], np.float16)
    np.savez(
        tmp_path / "violinist_9.npz", body=body, visibility=visibility, joints=np.array(["left_wrist", "nose"]),
        left_hand=hand, fps=25.0, notes=np.array([[0.1, 0.2, 69, 127]], np.float32),
    )  # fmt: skip
    soundfile.write(tmp_path / "violinist_9.ogg", sound(0.2).samples, 44100)
    one = load_tracked(tmp_path / "violinist_9.npz", extras=("nose",))
    assert (one.instrument, one.piece) == ("violin", "tracked_violinist_9")
    assert one.motion.skeleton.joints == ("left_wrist", *PLAYER_50.joints[8:29], "nose")
    assert one.detected[:, 0].all()
    assert one.detected[:, 1:].all(axis=1).tolist() == [True, False, True, True]
    np.testing.assert_array_equal(one.motion.positions[1, 1:22], np.full((21, 2), 7.0))
    assert one.notes is not None
    assert one.notes.loudness.tolist() == [1]
    assert one.audio is not None
    (tmp_path / "violinist_9.npz").rename(tmp_path / "cellist.npz")
    refused(r'cellist\.npz: has neither "pian" nor "violin" in its name', load_tracked, tmp_path / "cellist.npz")


# Real recordings


@pytest.fixture(scope="module")
def instruments(data_root: Path) -> Path:
    folder = data_root / "instruments"
    if not folder.is_dir():
        pytest.skip(f"no recordings of musicians: {folder} is not there")
    return folder


@pytest.mark.data
def test_real_pianists_have_the_notes_and_minutes_that_their_table_says(instruments: Path):
    performances = load_pianomime(instruments / "pianomime")
    lines = (instruments / "pianomime" / "clips.csv").read_text().splitlines()[1:]
    table = {line.split(",")[0]: line.split(",") for line in lines}
    assert len(performances) == len(table) > 100
    for one in performances:
        _, piece, seconds, count, lowest, highest = table[one.name]
        assert one.notes is not None
        assert one.piece == f"pianomime_{piece}"
        assert len(one.notes) == int(count)
        assert one.motion.duration == pytest.approx(float(seconds), abs=0.06)
        assert (one.notes.pitches.min(), one.notes.pitches.max()) == (int(lowest), int(highest))


@pytest.mark.data
def test_real_left_hands_lie_left_of_right_hands_and_play_lower(instruments: Path):
    left, right, keys = [], [], []
    for one in load_pianomime(instruments / "pianomime"):
        names = one.motion.skeleton.joints
        left.append(one.motion.positions[:, names.index("left_hand"), 0].mean())
        right.append(one.motion.positions[:, names.index("right_hand"), 0].mean())
        assert one.notes is not None
        keys.append([one.notes.pitches[one.notes.hands == hand].mean() for hand in (0, 1)])
    assert (np.array(left) < np.array(right)).mean() > 0.98
    assert (np.diff(np.array(keys), axis=1) > 0).mean() > 0.98


@pytest.mark.data
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sides_of_real_pianists_share_at_most_a_quarter_of_their_note_patterns(instruments: Path, seed: int):
    split = split_by_piece(load_pianomime(instruments / "pianomime"), seed=seed)
    pairs = [
        (one, two)
        for number, side in enumerate(split)
        for one in side
        for later in split[number + 1 :]
        for two in later
    ]
    assert len(pairs) > 5000
    assert max(shared_patterns(one.notes, two.notes) for one, two in pairs) <= 0.25
    minutes = [sum(one.motion.duration for one in side) / 60 for side in split]
    assert minutes == pytest.approx(np.array([0.7, 0.15, 0.15]) * sum(minutes), abs=3)


@pytest.mark.data
def test_three_tracked_musicians_are_read(instruments: Path):
    side, top, violin = (
        load_tracked(instruments / "tracked" / f"{name}.npz")
        for name in ("pianist_side_view", "piano_top_view", "violinist")
    )
    assert side.motion.skeleton.joints == PLAYER_50.joints[:8]
    assert top.motion.skeleton.joints == PLAYER_50.joints[8:]
    assert violin.motion.skeleton == PLAYER_50
    assert (side.instrument, top.instrument, violin.instrument) == ("piano", "piano", "violin")
    assert side.audio is not None
    assert violin.audio is not None
    assert top.audio is None
    assert top.notes is not None
    assert len(top.notes) == 138
    assert violin.detected[:, 8:].mean() == pytest.approx(0.87, abs=0.01)
    assert top.detected.mean() > 0.999


@pytest.mark.data
def test_tracked_pianist_is_of_the_piece_that_the_clip_of_the_same_performance_is_of(instruments: Path):
    twin = load_tracked(instruments / "tracked" / "piano_top_view.npz")
    clips = {one.name: one for one in load_pianomime(instruments / "pianomime")}
    assert twin.piece == clips["clip_186"].piece
    assert twin.notes is not None
    assert clips["clip_186"].notes is not None
    assert shared_patterns(twin.notes, clips["clip_186"].notes) > 0.5
    assert piece_groups([replace(twin, piece=""), clips["clip_186"]]) == [0, 0]


@pytest.mark.data
def test_real_performance_survives_being_written(instruments: Path, tmp_path: Path):
    one = load_tracked(instruments / "tracked" / "violinist.npz")
    save_performance(tmp_path / "one", one)
    again = load_performance(tmp_path / "one")
    np.testing.assert_array_equal(again.motion.positions, one.motion.positions)
    np.testing.assert_array_equal(again.detected, one.detected)
