"""The songs of Music2Dance: what is heard of them, each once in a corpus, which dance a song calls for."""

import json
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import soxr
import torch

from harmolab.data.synthetic import synthetic_clip, write_corpus
from harmolab.readers.audio import load_audio
from harmolab.systems.music2dance import attributes as att
from harmolab.systems.music2dance import music_features as hearing
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import parameter_count
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Audio, BeatTrack
from study.cells import notebook_cells
from study.experiments.attributes import LabelledSongs, folds, two_classes
from tests.builders import cases, metronome, planted_dance, refused, track, write_song
from tests.tiny_music2dance import trained


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two synthetic dances of each of the seven."""
    return write_corpus(tmp_path_factory.mktemp("songs") / "first", clips=14, seconds=8.0, fps=25.0, seed=5)


def noise(seed: int, *, cells: int = 60) -> np.ndarray:
    return np.random.default_rng(seed).random((cells, 15)).astype(np.float32)


def labelled(*counts: int) -> list[att.Song]:
    """So many songs of each class."""
    numbers = [(label, number) for label, count in enumerate(counts) for number in range(count)]
    return [att.Song(f"{label}.{number}", noise(100 * label + number), label) for label, number in numbers]


# The split


@cases("count, tested", (1, 0), (2, 1), (3, 1), (5, 1), (7, 1), (8, 2), (10, 2), (22, 4), ids=lambda value: str(value))
def test_a_fifth_of_a_dance_is_tested_on_and_one_song_at_least(count: int, tested: int):
    split = att.split_songs(labelled(2, count))
    assert sum(name.startswith("1.") for name in split.test) == tested
    assert len(split.train) + len(split.test) == 2 + count


def test_a_split_is_that_of_its_seed():
    songs = labelled(10, 10)
    assert att.split_songs(songs, seed=3) == att.split_songs(songs, seed=3) != att.split_songs(songs, seed=4)
    assert att.split_songs(songs[::-1], seed=3).test[::-1] == att.split_songs(songs, seed=3).test


def test_dances_of_one_song_each_cannot_be_tested():
    refused("3 songs, each of another dance: none can be tested on", att.split_songs, labelled(1, 1, 1))


# Leaks


def test_a_song_on_both_sides_is_no_split():
    refused("'b' is on both sides", att.SongSplit, ("a", "b"), ("b", "c"))


def test_a_song_that_is_tested_on_under_another_name_is_seen():
    songs = labelled(2, 2)
    songs.append(songs[0]._replace(name="again"))
    fault = r"'again' is tested on, but trained on as '0\.0'"
    refused(fault, att.side_songs, songs, att.SongSplit(("0.0", "1.0"), ("1.1", "again")))
    train, test = att.side_songs(songs, att.SongSplit(("0.0", "1.0", "again"), ("0.1", "1.1")))
    assert [song.name for song in train] == ["0.0", "1.0", "again"] and [song.name for song in test] == ["0.1", "1.1"]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [16000, 44100])
def test_a_song_cut_and_encoded_anew_is_the_same_song(rate: int):
    clip = synthetic_clip("rumba", seconds=40.0, seed=3)
    samples = np.asarray(clip.audio.samples, float)[int(6.25 * clip.audio.sample_rate) :]
    other = type(clip.audio)(0.4 * soxr.resample(samples, clip.audio.sample_rate, rate), rate)
    assert att.is_same_song(*(hearing.music_features(audio, clip.beats) for audio in (clip.audio, other)))


@pytest.mark.slow
def test_songs_of_one_dance_are_other_songs():
    clips = [synthetic_clip("rumba", seconds=40.0, seed=seed) for seed in range(4)]
    music = [hearing.music_features(clip.audio, clip.beats) for clip in clips]
    assert not any(att.is_same_song(one, other) for place, one in enumerate(music) for other in music[:place])
    assert not att.is_same_song(np.zeros_like(music[0]), music[0]) and not att.is_same_song(music[0][:5], music[1][:3])


# Corpora


@pytest.mark.slow
def test_every_song_of_a_corpus_is_there_once(corpus: Path, tmp_path: Path):
    """A second corpus has a song of the first, cut and encoded anew, and another under the name of one of the first."""
    first, second = sorted(corpus.glob("clip_*"))[:2]
    for name, folder in (("copy", first), (first.name, second)):
        shutil.copytree(folder, tmp_path / "second" / name)
    audio = load_audio(first / "audio.wav")
    shorter = np.asarray(audio.samples)[3000:]
    soundfile.write(tmp_path / "second" / "copy" / "audio.wav", shorter, int(audio.sample_rate))
    write_song(tmp_path / "second" / first.name / "audio.wav", planted_dance("rumba", seconds=8.0, seed=77))
    songs = att.load_songs([corpus, tmp_path / "second"])
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


def test_songs_of_one_dance_are_too_few(small: Path, corpus: Path, tmp_path: Path):
    for folder in corpus.glob("clip_*_cha-cha"):
        shutil.copytree(folder, small / folder.name, dirs_exist_ok=True)
    fault = f"harmolab: {small}: a classifier needs songs of two dances or more; songs here: 2, of cha-cha"
    assert refusal(small, tmp_path / "run") == fault


def test_a_silent_song_and_one_without_a_dance_are_left_out_by_name(small: Path, tmp_path: Path):
    (folder,) = small.iterdir()
    soundfile.write(folder / "audio.wav", np.zeros(22050), 22050)
    assert f"(left out: {folder}: silent from beginning to end)" in refusal(small, tmp_path / "run")
    (folder / "beats.json").unlink()
    folder = folder.rename(small / "nameless")
    fault = f"songs here: 0 (left out: {folder}: no dance is named in beats.json)"
    assert fault in refusal(small, tmp_path / "run")


def test_two_songs_of_two_dances_have_none_to_test(small: Path, corpus: Path, tmp_path: Path):
    shutil.copytree(sorted(corpus.glob("clip_*"))[1], small / "other")
    assert "2 songs, each of another dance: none can be tested on" in refusal(small, tmp_path / "run")


def test_the_command_trains_a_classifier_and_prints_its_outcome(corpus: Path, tmp_path: Path):
    out = tmp_path / "run" / "attributes"
    result = trained(corpus, "--out", out, "--system", "attributes", "--seed", 7)
    assert result.exit_code == 0, result.output
    classifier = load_weights(out, att.AttributeClassifier)
    assert classifier.params.seed == 7 and len(classifier.classes) == 7
    songs = att.load_songs([corpus])
    split = att.split_songs(songs.songs)
    tested = [song for song in songs.songs if song.name in split.test]
    right = sum(int(classifier.probabilities(song.music).argmax()) == song.label for song in tested)
    assert read_about(out)["meta"]["test"] == {"songs": 7, "right": right, "majority": 1}
    lines = result.stderr.splitlines()
    assert lines[0].startswith("songs: 7 train, 7 test; dances: cha-cha, jive")
    assert lines[-1].startswith(f"test songs: the dance of {right} of 7 is named rightly; always naming")
    assert lines[-1].endswith("would be right for 1")
    assert result.stdout == f"trained: {out}, a part of music2dance; a run uses it where it lies in RUN/attributes\n"


RATE = 22050
SECONDS = 12.0


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARMOLAB_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def clicks(times: np.ndarray) -> Audio:
    """Short noises at these seconds."""
    samples = np.zeros(int(SECONDS * RATE))
    burst = np.random.default_rng(0).normal(0, 0.3, 300) * np.exp(-np.arange(300) / 60)
    for start in np.round(times * RATE).astype(int):
        samples[start : start + 300] += burst
    return Audio(samples, RATE)


def tone(frequency: float) -> Audio:
    return Audio(0.5 * np.sin(2 * np.pi * frequency * np.arange(int(SECONDS * RATE)) / RATE), RATE)


def silent() -> BeatTrack:
    return track([], duration=SECONDS)


def test_planted_beats_peak_in_their_moment_or_its_neighbour():
    times = np.arange(0.5, SECONDS - 0.5, 0.537)
    features = hearing.music_features(clicks(times), track(times, duration=SECONDS))
    cells = np.round(times * 10).astype(int)
    for channel in ("onset", "beat"):
        curve = features[:, hearing.CHANNELS.index(channel)]
        peaks = [cell + np.argmax(curve[cell - 2 : cell + 3]) - 2 for cell in cells]
        assert np.mean(np.abs(peaks - cells) <= 1) >= 0.95, channel


def test_a_beat_between_two_moments_is_shared_by_them():
    np.testing.assert_allclose(hearing.marked(np.array([0.1, 0.23]), 5, 10.0), [0, 1, 0.7, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(hearing.marked(np.array([-0.1, 0.4, 0.45]), 5, 10.0), [0, 0, 0, 0, 1], atol=1e-12)


def test_known_bars_give_the_downbeats_and_else_the_strongest_place():
    beats = metronome(np.ones(16), first=0.5, duration=SECONDS, bar_places=[0, 1, 2, 3] * 4)
    down = hearing.music_features(clicks(beats.times), beats)[:, hearing.CHANNELS.index("downbeat")]
    np.testing.assert_array_equal(np.flatnonzero(down), [5, 25, 45, 65])
    assert np.flatnonzero(hearing.accented_place(metronome([1, 1, 3, 1] * 3))).tolist() == [2, 6, 10]
    assert not hearing.accented_place(silent()).any()


def test_an_a_sounds_in_the_channel_of_a():
    chroma = hearing.music_features(tone(440.0), silent())[:, 3:]
    assert (chroma.argmax(axis=1) == hearing.CHANNELS.index("A") - 3).mean() >= 0.95


def test_two_sample_rates_agree():
    clip = synthetic_clip("waltz", seconds=SECONDS, seed=2)
    samples = np.asarray(clip.audio.samples, float)
    twice = Audio(soxr.resample(samples, clip.audio.sample_rate, 2 * clip.audio.sample_rate, quality="VHQ"), 2 * RATE)
    one, other = (hearing.music_features(audio, clip.beats) for audio in (clip.audio, twice))
    assert np.abs(one - other[: len(one)]).max() < 0.05


def test_half_as_loud_is_the_same_music():
    clip = synthetic_clip("tango", seconds=SECONDS, seed=1)
    half = Audio(np.asarray(clip.audio.samples, float) / 2, clip.audio.sample_rate)
    for hear in (lambda audio: hearing.music_features(audio, clip.beats), hearing.mel_features):
        np.testing.assert_allclose(hear(half), hear(clip.audio), atol=1e-3)


def test_a_second_call_reads_what_the_first_kept(monkeypatch: pytest.MonkeyPatch):
    audio = tone(300.0)
    first = hearing.music_features(audio, silent())
    monkeypatch.setattr(hearing, "_listen", lambda *_: pytest.fail("it was listened to again"))
    np.testing.assert_array_equal(hearing.music_features(audio, silent()), first)


@pytest.mark.parametrize("seconds", [0.01, 0.3, 1.0])
def test_short_and_silent_sounds_have_features_of_their_length(seconds: float):
    for samples in (np.zeros(int(seconds * RATE)), np.random.default_rng(1).normal(0, 0.1, int(seconds * RATE))):
        audio = Audio(samples, RATE)
        features = hearing.music_features(audio, track([], duration=seconds))
        assert features.shape == (np.ceil(seconds * 10), 15)
        assert np.isfinite(features).all() and features.min() >= 0 and features.max() <= 1
        assert np.isfinite(hearing.mel_features(audio)).all()


FOUR = ("cha-cha", "rumba", "tango", "waltz")
TINY = att.AttributeParams(
    channels=(2, 3), hidden=4, window=4.0, hop=2.0, epochs=25, batch_size=8, learning_rate=0.02, seed=100_000
)


def rhythm(period: int, *, cells: int = 100, seed: int = 0) -> np.ndarray:
    """Features with an onset every `period` moments, and noise in all other channels."""
    music = np.random.default_rng(seed).random((cells, 15)).astype(np.float32)
    music[:, 0] = np.arange(cells) % period == 0
    return music


def rhythms() -> LabelledSongs:
    songs = [
        att.Song(f"{FOUR[label]} {number}", rhythm(4 + label, seed=number), label)
        for label, count in enumerate((3, 6, 3, 9))
        for number in range(count)
    ]
    return LabelledSongs(tuple(songs), FOUR)


def test_every_song_is_tested_once_and_no_class_is_missing_on_a_side():
    songs = rhythms()
    parts = folds(songs, 3, seed=1)
    assert sorted(name for part in parts for name in part.test) == sorted(song.name for song in songs.songs)
    labels = {song.name: song.label for song in songs.songs}
    for part in parts:
        assert not {*part.train} & {*part.test}
        assert {labels[name] for name in part.test} == {labels[name] for name in part.train} == {0, 1, 2, 3}
    assert folds(songs, 3, seed=2) != parts == folds(songs, 3, seed=1)


def test_two_classes_are_the_smooth_and_the_fast_dances():
    songs = two_classes(rhythms())
    assert songs.classes == ("smooth", "fast")
    labels = {song.name.split()[0]: song.label for song in songs.songs}
    assert labels == {"cha-cha": 1, "rumba": 0, "tango": 1, "waltz": 0}


@pytest.mark.parametrize("period", [4, 5, 7])
def test_rhythm_peaks_at_the_planted_period(period: int):
    onset_rhythm = notebook_cells("15_music_and_attributes").onset_rhythm
    curve = onset_rhythm(rhythm(period))
    assert curve.shape == (39,) and int(curve[: 2 * period - 2].argmax()) + 1 == period
    assert np.isfinite(onset_rhythm(np.zeros((50, 15), np.float32))).all()


def test_windows_cover_a_song_to_its_end_and_a_short_one_is_filled():
    music = rhythm(4, cells=95)
    windows = att.song_windows(music, TINY)
    assert windows.shape == (4, 40, 15)
    np.testing.assert_array_equal(windows[-1], music[-40:])
    short = att.song_windows(music[:10], TINY)
    assert short.shape == (1, 40, 15) and not short[0, 10:].any()


@pytest.mark.parametrize("front", ["convolution", "frames"])
def test_published_sizes(front: str):
    classifier = att.AttributeClassifier(att.AttributeParams(front=front), FOUR)
    assert parameter_count(classifier) == {"convolution": 62_316, "frames": 206_404}[front]


def learnt(out: Path, **options: Any) -> att.AttributeClassifier:
    """A classifier of the rhythms, trained into this folder."""
    songs = rhythms()
    return att.train_attributes(songs.songs, FOUR, folds(songs, 3, seed=1)[0], TrainOptions(out, **options), TINY)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[att.AttributeClassifier, Path]:
    """A classifier and its folder."""
    out = tmp_path_factory.mktemp("runs") / "whole"
    return learnt(out), out


@pytest.mark.slow
def test_it_learns_saves_and_says_the_same_again(whole: tuple[att.AttributeClassifier, Path]):
    classifier, out = whole
    again, songs = load_weights(out, att.AttributeClassifier), rhythms().songs
    np.testing.assert_array_equal(again.probabilities(songs[0].music), classifier.probabilities(songs[0].music))
    assert again.probabilities(songs[0].music).sum() == pytest.approx(1.0)
    right = [int(again.probabilities(song.music).argmax()) == song.label for song in songs]
    assert np.mean(right) > 0.6  # the most frequent class has 9 of 21


@pytest.mark.slow
def test_it_goes_on_where_it_was_stopped(whole: tuple[att.AttributeClassifier, Path], tmp_path: Path):
    def stop(row: dict, end: int) -> None:
        if row["epoch"] == 5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        learnt(tmp_path / "run", report=stop)
    learnt(tmp_path / "run", resume=True)
    for name in ("history.csv", "model.safetensors"):
        assert (tmp_path / "run" / name).read_bytes() == (whole[1] / name).read_bytes()


def test_two_songs_of_one_name_are_refused(tmp_path: Path):
    songs, options = rhythms().songs, TrainOptions(tmp_path / "run")
    twice, split = [*songs, songs[0]], att.SongSplit((songs[0].name,), ())
    refused("two songs have one name", att.train_attributes, twice, FOUR, split, options, TINY)


@pytest.mark.parametrize("change", [{"hidden": 10**9}, {"hidden": -1}, {"channels": [2.5]}, {"channels": [1] * 99}])
def test_hostile_sizes_are_refused_by_file(change: dict, tmp_path: Path):
    torch.manual_seed(0)
    save_weights(tmp_path / "model", att.AttributeClassifier(TINY, FOUR))
    about = json.loads((tmp_path / "model.json").read_text())
    about["build"]["params"] |= change
    (tmp_path / "model.json").write_text(json.dumps(about))
    refused(r"model\.safetensors", load_weights, tmp_path, att.AttributeClassifier)
