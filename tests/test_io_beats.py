"""Beat annotations: text files, beats.json, and beats that are no seconds."""

import json
from pathlib import Path

import numpy as np
import pytest

from harmolab.readers.beats import BeatAnnotation, Unit, load_annotation, load_beats, save_beats
from tests.builders import cases, refused, track

WALTZ = {
    "beats_s": [0.5, 1.0, 1.5, 2.0],
    "downbeats_s": [0.5, 2.0],
    "meter": 3,
    "bpm": 120.0,
    "dance": "waltz",
    "source": "synthetic",
    "seed": 1,
    "motion_offset_s": 0.25,
    "units": [{"name": "W-3-1", "start_s": 0.5, "end_s": 2.0, "beats": 3, "figure": "W-3"}],
}


def write(folder: Path, name: str, content: object) -> Path:
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))
    return folder / name


def test_beats_file_gives_times_bars_and_tempo(tmp_path: Path):
    path = write(tmp_path, "song.beats", "# by hand\n0.5 1\n1.0\t2\n\n1.5 3\n2.0 1\n2.5 2\n")
    notes = load_annotation(path)
    np.testing.assert_array_equal(notes.times, [0.5, 1.0, 1.5, 2.0, 2.5])
    np.testing.assert_array_equal(notes.downbeats, [0.5, 2.0])
    assert (notes.meter, notes.bpm) == (3, 120.0)


def test_beats_file_without_places_in_the_bar_knows_no_bars(tmp_path: Path):
    notes = load_annotation(write(tmp_path, "song.beats", "0.5\n1.0\n1.5\n"))
    assert notes.downbeats is None
    assert notes.meter is None


def test_track_has_equal_strengths_and_ends_one_beat_after_the_last(tmp_path: Path):
    track = load_beats(write(tmp_path, "song.txt", "0.5\n1.0\n1.5\n"))
    np.testing.assert_array_equal(track.strengths, [1, 1, 1])
    assert track.duration == 2.0


def test_duration_that_is_given_is_the_length_of_the_track(tmp_path: Path):
    assert load_beats(write(tmp_path, "song.txt", "0.5\n1.0\n"), duration=30.0).duration == 30.0


@cases("text", "time,strength\n0.5,2\n1.0,0\n", "0.5;2\n1.0;0\n", "0.5\t2\n1.0\t0\n", "0.5, 2\r\n1.0, 0")
def test_second_column_of_a_table_is_the_strength(tmp_path: Path, text: str):
    track = load_beats(write(tmp_path, "song.csv", text))
    np.testing.assert_array_equal(track.times, [0.5, 1.0])
    np.testing.assert_array_equal(track.strengths, [2.0, 0.0])


def test_json_gives_everything_that_was_written_down(tmp_path: Path):
    notes = load_annotation(write(tmp_path, "beats.json", WALTZ))
    np.testing.assert_array_equal(notes.times, WALTZ["beats_s"])
    np.testing.assert_array_equal(notes.downbeats, [0.5, 2.0])
    assert (notes.meter, notes.bpm, notes.dance, notes.source, notes.offset) == (3, 120.0, "waltz", "synthetic", 0.25)
    assert notes.units == (Unit("W-3-1", 0.5, 2.0, 3, "W-3"),)


def test_json_with_beats_alone_is_enough(tmp_path: Path):
    notes = load_annotation(write(tmp_path, "beats.json", {"beats_s": [1.0, 2.0], "downbeats_s": None}))
    assert (notes.downbeats, notes.meter, notes.bpm, notes.dance, notes.units) == (None, None, None, "", ())


@pytest.mark.parametrize("times", [[12, 24, 37, 50], [500, 1000, 1500, 2000], [12.5, 25.0, 37.5, 50.0, 62.5]])
def test_beats_in_frames_or_milliseconds_are_refused(tmp_path: Path, times: list[float]):
    path = write(tmp_path, "song.txt", "\n".join(map(str, times)))
    refused(r"song\.txt: beat times lie .* apart; were these frames or milliseconds", load_beats, path)


def test_beats_behind_the_end_of_the_recording_are_refused(tmp_path: Path):
    path = write(tmp_path, "song.txt", "0.5\n1.5\n3.0\n")
    refused(r"song\.txt: beat times reach 3 in a clip of 2 s; were these frames", load_beats, path, duration=2.0)


def test_slow_music_in_whole_seconds_is_no_frames(tmp_path: Path):
    assert len(load_beats(write(tmp_path, "song.txt", "1\n2\n3\n4\n5\n"))) == 5


@cases(
    "name, content, fault",
    ("song.beats", "", "the file is empty"),
    ("song.beats", "0.5 1\n0.4 2\n", r"increase strictly, but 0\.4 follows 0\.5"),
    ("song.beats", "0.5 1\n0.5 2\n", "drop doubles"),
    ("song.beats", "-0.5 1\n0.5 2\n", r"start at -0\.5 s"),
    ("song.beats", "0.5 1\n1.0 nan\n", "line 2: 'nan' is not a number"),
    ("song.beats", "0.5 1\n1.0 x\n", "line 2: 'x' is not a number"),
    ("song.beats", "0.5 1\n1.0\n", "line 2 has 1 columns, the first has 2"),
    ("song.beats", "0.5 1.5\n1.0 2\n", "place in its bar"),
    ("song.beats", "time place\n1.0 2\n", "line 1: 'time' is not a number"),
    ("song.csv", "0.5,1,7\n", "has 3 columns"),
    ("song.csv", "0.5,-1\n", "strengths must not be negative"),
    ("song.csv", "# nothing\n", "holds no beats; a line for each"),
    ("song.doc", "0.5\n", r"no beat annotation that is known; \.beats"),
    ("beats.json", "{", "cannot be read as a beat annotation"),
    ("beats.json", "[1, 2]", "has no 'beats_s'"),
    ("beats.json", {"beats_s": [[1, 2]]}, r"shape \(any\), got \(1, 2\)"),
    ("beats.json", {"beats_s": [1, None]}, "NaN or infinity"),
    ("beats.json", {"beats_s": [1, {}]}, "must be numbers"),
    ("beats.json", WALTZ | {"meter": "three"}, "'meter' must be a number"),
    ("beats.json", WALTZ | {"bpm": -3}, "bpm must be positive"),
    ("beats.json", WALTZ | {"units": [{"name": "W-1"}]}, "'start_s' must be a number"),
    ("beats.json", WALTZ | {"units": [WALTZ["units"][0] | {"end_s": 0.5}]}, "must end after it starts"),
)
def test_damaged_annotation_is_refused_with_its_fault(tmp_path: Path, name: str, content: object, fault: str):
    refused(rf"{name}: .*{fault}", load_beats, write(tmp_path, name, content))


@pytest.mark.parametrize("name", ["song.txt", "song.csv", "song.beats"])
@pytest.mark.parametrize("text", ["# silence\n", "\n\n", "hello\n"])
def test_text_without_a_beat_is_no_annotation(tmp_path: Path, name: str, text: str):
    fault = "line 1: 'hello' is not a number" if (name, text) == ("song.beats", "hello\n") else "holds no beats"
    refused(rf"{name}: {fault}", load_beats, write(tmp_path, name, text), duration=5.0)


def test_beats_that_were_written_are_read_again(tmp_path: Path):
    save_beats(tmp_path / "song.beats", track([0.5, 1.0, 1.5, 2.0], bar_places=[2, 0, 1, 2]), comment="by\nhand")
    assert (
        tmp_path / "song.beats"
    ).read_text() == "# written by harmolab: by hand\n0.5000 3\n1.0000 1\n1.5000 2\n2.0000 3\n"
    save_beats(tmp_path / "song.beats", track([0.25, 1.0]))
    assert (tmp_path / "song.beats").read_text() == "# written by harmolab\n0.2500\n1.0000\n"
    assert load_annotation(tmp_path / "song.beats").meter is None


def test_beats_are_written_under_a_name_that_says_so(tmp_path: Path):
    refused(r"song\.wav: beats are written as \.beats", save_beats, tmp_path / "song.wav", track([0.5, 1.0]))


@pytest.mark.parametrize("beats", [[], None])
def test_an_annotation_must_hold_beats(tmp_path: Path, beats: list[float] | None):
    path = write(tmp_path, "beats.json", json.dumps({"beats_s": beats, "dance": "waltz"}))
    refused(r"beats\.json: holds no beats: 'beats_s' is empty", load_annotation, path)


def test_no_beats_are_no_file(tmp_path: Path):
    refused(r"song.beats: there are no beats to write", save_beats, tmp_path / "song.beats", track([]))
    assert list(tmp_path.iterdir()) == []


def test_annotation_cannot_be_changed():
    notes = BeatAnnotation([0.5, 1.0])
    with pytest.raises(ValueError, match="read-only"):
        notes.times[0] = 3.0


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "beats", "meter", "bpm"),
    [("Media-105901", 40, 3, 84), ("Media-104309", 90, 3, 180), ("Albums-Cafe_Paradiso-05", 63, 4, 125)],
)
def test_ballroom_annotation_has_its_meter_and_tempo(data_root: Path, name: str, beats: int, meter: int, bpm: float):
    notes = load_annotation(data_root / "extra" / "ballroom" / "annotations" / f"{name}.beats")
    assert (notes.times.size, notes.meter) == (beats, meter)
    assert notes.bpm == pytest.approx(bpm, abs=1)


@pytest.mark.data
def test_annotations_of_other_tools_are_read(data_root: Path):
    assert len(load_beats(data_root / "extra" / "madmom" / "sample.dbn_beat_tracker.txt")) == 8
    for path in sorted((data_root / "extra" / "mir_eval_beat").glob("*.txt")):
        assert 280 <= len(load_beats(path)) <= 640


@pytest.mark.data
def test_beat_locked_annotations_name_units_that_cover_whole_beats(data_root: Path):
    for path in sorted((data_root / "beatlocked").glob("*/beats.json")):
        notes = load_annotation(path)
        for unit in notes.units:
            beats = np.count_nonzero((notes.times > unit.start - 0.01) & (notes.times < unit.end - 0.01))
            assert beats == unit.beats, f"{path}: {unit}"
