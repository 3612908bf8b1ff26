"""The songs that the attribute classifier learns from: each once, split dance by dance, heard without a prior."""

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import soundfile
import soxr

from harmolab.beats.audio import audio_beats
from harmolab.data.synthetic import synthetic_clip, write_corpus
from harmolab.readers.audio import load_audio
from harmolab.systems.music2dance.attributes import (
    AttributeClassifier,
    Song,
    SongSplit,
    is_same_song,
    load_songs,
    side_songs,
    split_songs,
)
from harmolab.systems.music2dance.music_features import blind_features, music_features
from harmolab.systems.training.about import read_about
from harmolab.systems.training.weights import load_weights
from tests.builders import cases, refused
from tests.tiny_music2dance import trained

DANCES = ("cha-cha", "rumba", "waltz")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two synthetic dances of each of the seven."""
    return write_corpus(tmp_path_factory.mktemp("songs") / "first", clips=14, seconds=8.0, fps=25.0, seed=5)


def noise(seed: int, *, cells: int = 60) -> np.ndarray:
    return np.random.default_rng(seed).random((cells, 15)).astype(np.float32)


def labelled(*counts: int) -> list[Song]:
    """So many songs of each class."""
    numbers = [(label, number) for label, count in enumerate(counts) for number in range(count)]
    return [Song(f"{label}.{number}", noise(100 * label + number), label) for label, number in numbers]


# The split


@cases("count, tested", (1, 0), (2, 1), (3, 1), (5, 1), (7, 1), (8, 2), (10, 2), (22, 4), ids=lambda value: str(value))
def test_a_fifth_of_a_dance_is_tested_on_and_one_song_at_least(count: int, tested: int):
    split = split_songs(labelled(2, count))
    assert sum(name.startswith("1.") for name in split.test) == tested
    assert len(split.train) + len(split.test) == 2 + count


def test_a_split_is_that_of_its_seed():
    songs = labelled(10, 10)
    assert split_songs(songs, seed=3) == split_songs(songs, seed=3) != split_songs(songs, seed=4)
    assert split_songs(songs[::-1], seed=3).test[::-1] == split_songs(songs, seed=3).test


def test_dances_of_one_song_each_cannot_be_tested():
    refused("3 songs, each of another dance: none can be tested on", split_songs, labelled(1, 1, 1))


# Leaks


def test_a_song_on_both_sides_is_no_split():
    refused("'b' is on both sides", SongSplit, ("a", "b"), ("b", "c"))


def test_a_song_that_is_tested_on_under_another_name_is_seen():
    songs = labelled(2, 2)
    songs.append(songs[0]._replace(name="again"))
    with pytest.raises(ValueError, match=r"'again' is tested on, but trained on as '0\.0'"):
        side_songs(songs, SongSplit(("0.0", "1.0"), ("1.1", "again")))
    train, test = side_songs(songs, SongSplit(("0.0", "1.0", "again"), ("0.1", "1.1")))
    assert [song.name for song in train] == ["0.0", "1.0", "again"] and [song.name for song in test] == ["0.1", "1.1"]


@pytest.mark.parametrize("rate", [16000, 44100])
def test_a_song_cut_and_encoded_anew_is_the_same_song(rate: int):
    clip = synthetic_clip("rumba", seconds=40.0, seed=3)
    samples = np.asarray(clip.audio.samples, float)[int(6.25 * clip.audio.sample_rate) :]
    other = type(clip.audio)(0.4 * soxr.resample(samples, clip.audio.sample_rate, rate), rate)
    assert is_same_song(*(music_features(audio, clip.beats) for audio in (clip.audio, other)))


def test_songs_of_one_dance_are_other_songs():
    clips = [synthetic_clip("rumba", seconds=40.0, seed=seed) for seed in range(4)]
    music = [music_features(clip.audio, clip.beats) for clip in clips]
    assert not any(is_same_song(one, other) for place, one in enumerate(music) for other in music[:place])
    assert not is_same_song(np.zeros_like(music[0]), music[0]) and not is_same_song(music[0][:5], music[1][:3])


# Corpora


def test_features_are_heard_without_a_prior():
    clip = synthetic_clip("waltz", seconds=8.0, seed=1)
    np.testing.assert_array_equal(blind_features(clip.audio), music_features(clip.audio, audio_beats(clip.audio)))


def test_every_song_of_a_corpus_is_there_once(corpus: Path, tmp_path: Path):
    """A second corpus has a song of the first, cut and encoded anew, and another under the name of one of the first."""
    first, second = sorted(corpus.glob("clip_*"))[:2]
    for name, folder in (("copy", first), (first.name, second)):
        shutil.copytree(folder, tmp_path / "second" / name)
    audio = load_audio(first / "audio.wav")
    soundfile.write(
        tmp_path / "second" / "copy" / "audio.wav", np.asarray(audio.samples)[3000:], int(audio.sample_rate)
    )
    fresh = synthetic_clip("rumba", seconds=8.0, seed=77).audio
    soundfile.write(
        tmp_path / "second" / first.name / "audio.wav", np.asarray(fresh.samples, np.float32), int(fresh.sample_rate)
    )
    songs = load_songs([corpus, tmp_path / "second"])
    assert len(songs.songs) == 15 == len({song.name for song in songs.songs})
    assert songs.songs[-1].name == f"second/{first.name}"
    assert songs.notes == (f"{tmp_path / 'second' / 'copy'}: has the song of first/{first.name}",)
    assert Counter(song.label for song in songs.songs[:14]) == dict.fromkeys(range(7), 2)


@pytest.fixture
def small(corpus: Path, tmp_path: Path) -> Path:
    """The folder of a corpus of one song."""
    first = sorted(corpus.glob("clip_*"))[0]
    shutil.copytree(first, tmp_path / "small" / first.name)
    return tmp_path / "small"


def refusal(corpus: Path, out: Path) -> str:
    result = trained(corpus, "--out", out, "--system", "attributes")
    assert result.exit_code == 2 and not out.exists()
    (line,) = result.stderr.splitlines()
    return line


def test_one_song_is_too_few(small: Path, tmp_path: Path):
    told = f"harmolab: {small}: a classifier needs songs of two dances or more; songs here: 1, of cha-cha"
    assert refusal(small, tmp_path / "run") == told


def test_one_dance_is_too_few(small: Path, corpus: Path, tmp_path: Path):
    for folder in corpus.glob("clip_*_cha-cha"):
        shutil.copytree(folder, small / folder.name, dirs_exist_ok=True)
    assert "two dances or more; songs here: 2, of cha-cha" in refusal(small, tmp_path / "run")


def test_a_song_without_a_dance_is_left_out_by_name(small: Path, tmp_path: Path):
    (folder,) = small.iterdir()
    (folder / "beats.json").unlink()
    folder = folder.rename(small / "nameless")
    told = f"songs here: 0 (left out: {folder}: no dance is named in beats.json)"
    assert told in refusal(small, tmp_path / "run")


def test_two_songs_of_two_dances_have_none_to_test(small: Path, corpus: Path, tmp_path: Path):
    shutil.copytree(sorted(corpus.glob("clip_*"))[1], small / "other")
    assert "2 songs, each of another dance: none can be tested on" in refusal(small, tmp_path / "run")


def test_the_command_trains_a_classifier_and_prints_its_outcome(corpus: Path, tmp_path: Path):
    out = tmp_path / "run" / "attributes"
    result = trained(corpus, "--out", out, "--system", "attributes", "--seed", 7)
    assert result.exit_code == 0, result.output
    classifier = load_weights(out, AttributeClassifier)
    assert classifier.params.seed == 7 and len(classifier.classes) == 7
    songs = load_songs([corpus])
    split = split_songs(songs.songs)
    right = sum(
        int(classifier.probabilities(song.music).argmax()) == song.label
        for song in songs.songs
        if song.name in split.test
    )
    assert read_about(out)["meta"]["test"] == {"songs": 7, "right": right, "majority": 1}
    lines = result.stderr.splitlines()
    assert lines[0].startswith("songs: 7 train, 7 test; dances: cha-cha, jive")
    assert lines[-1].startswith(f"test songs: {right} of 7 dances are right; 1 would be by always naming")
    assert result.stdout == f"trained: {out}, a part of music2dance, which uses it where it is RUN/attributes\n"
