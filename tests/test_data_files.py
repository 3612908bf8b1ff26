"""From files to clips: beats are the same at every rate of the sound, and a folder is read like its recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from harmolab.clips import corpus_recordings, load_clip
from harmolab.data.recordings import find_recordings
from harmolab.data.synthetic import synthetic_clip, write_corpus
from harmolab.lab.compare.auc import compare
from harmolab.params import BarPattern
from harmolab.readers.video import write_video
from harmolab.types import Audio, Clip
from harmolab.verdict.bar_pattern import load_pattern, save_patterns
from tests.builders import cases, refused


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


def test_beats_are_the_same_whatever_the_rate_of_the_sound(song: Path, clip: Clip) -> None:
    assert clip.motion is not None and clip.audio.sample_rate == 22050
    usual, full = load_clip(song, clip.motion), load_clip(song, clip.motion, sample_rate=None)
    assert (usual.audio.sample_rate, full.audio.sample_rate > 40000) == (22050, True)
    assert len(usual.beats) > 8
    np.testing.assert_array_equal(full.beats.times, usual.beats.times)
    np.testing.assert_array_equal(full.beats.strengths, usual.beats.strengths)


def test_a_clip_is_not_tracked_where_that_is_not_asked_for(song: Path, clip: Clip) -> None:
    assert load_clip(song, clip.motion, track=False).beats is None


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("inf"), float("nan")])
def test_a_length_that_is_none_is_refused(song: Path, clip: Clip, seconds: float) -> None:
    refused("seconds must be positive and finite", load_clip, song, clip.motion, seconds=seconds)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=7, seconds=6.0, fps=30.0, seed=2)


def test_a_folder_is_compared_like_its_recordings(corpus: Path) -> None:
    folder = compare(corpus, n_rotations=20, dances=("rumba", "waltz"))
    recordings = compare(corpus_recordings(corpus), n_rotations=20, dances=("rumba", "waltz"), corpus=str(corpus))
    assert folder.summary == recordings.summary
    assert sorted(folder.dances) == ["rumba", "waltz"]
    assert folder.summary["beats"] == "annotated"


def test_one_recording_without_annotation_makes_all_beats_tracked(tmp_path: Path) -> None:
    corpus = write_corpus(tmp_path / "synth", clips=2, seconds=4.0, fps=30.0, seed=1)
    (find_recordings(corpus).folders[0] / "beats.json").unlink()
    assert compare(corpus, n_rotations=0).summary["beats"] == "tracked"


def test_a_recording_that_cannot_be_read_is_reported_and_left_out(tmp_path: Path) -> None:
    corpus = write_corpus(tmp_path / "synth", clips=2, seconds=4.0, fps=30.0, seed=1)
    broken = find_recordings(corpus).folders[0]
    (broken / "motion.npz").write_bytes(b"no motion")
    problems: list[Path] = []
    readable = list(corpus_recordings(corpus, report=lambda problem: problems.append(problem.folder)))
    assert (len(readable), problems) == (1, [broken])


def test_bar_patterns_come_back_as_they_were(tmp_path: Path) -> None:
    patterns = {
        "waltz": BarPattern(3, (0.5, 0.25), (-0.1, 0.0), "planted", "waltz"),
        "rumba": BarPattern(1, (-1.0,), (0.0,), "planted", "rumba"),
    }
    save_patterns(tmp_path / "patterns.json", patterns)
    named = {dance: replace(pattern, dance=dance) for dance, pattern in patterns.items()}
    assert {dance: load_pattern(tmp_path / "patterns.json", dance) for dance in patterns} == named
    with pytest.raises(ValueError, match=r"patterns.json: holds no pattern for --dance ''; it has waltz, rumba"):
        load_pattern(tmp_path / "patterns.json")


def test_one_gives_each_beat_its_place_in_the_bar_of_the_dance(song: Path, clip: Clip) -> None:
    assert clip.beats is not None
    told = load_clip(song, clip.motion, dance="cha-cha", one=float(clip.beats.times[6])).beats
    nearest = np.abs(told.times - clip.beats.times[6]).argmin()
    assert told.bar_places.tolist() == ((np.arange(len(told)) - nearest) % 4).tolist()
    assert load_clip(song, clip.motion, dance="cha-cha").beats.bar_places is None


def test_one_is_counted_on_annotated_beats_too(song: Path, clip: Clip, tmp_path: Path) -> None:
    (tmp_path / "song.beats").write_text("1.0\n1.7\n2.4\n3.1\n")
    told = load_clip(song, clip.motion, dance="waltz", beats=tmp_path / "song.beats", one=1.69).beats
    assert told.bar_places.tolist() == [2, 0, 1, 2]


@cases("dance, one, fault", ("", 1.0, "with --dance: cha-cha"), ("waltz", 99.0, "no beat is near"))
def test_a_one_without_a_dance_or_a_beat_is_refused(song: Path, clip: Clip, dance: str, one: float, fault: str) -> None:
    refused(fault, load_clip, song, clip.motion, dance=dance, one=one)
