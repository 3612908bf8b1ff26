"""Which dance a song calls for: folds by song, planted rhythms, a classifier that learns, saves and refuses leaks."""

from pathlib import Path

import numpy as np
import pytest
import torch

from harmolab.systems.music2dance.attributes import (
    AttributeClassifier,
    AttributeParams,
    Song,
    SongSplit,
    song_windows,
    train_attributes,
)
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.weights import load_weights, save_weights
from study.experiments.attributes import LabelledSongs, folds, two_classes
from tests.builders import refused
from tests.notebook_cells import notebook_cells

DANCES = ("cha-cha", "rumba", "tango", "waltz")
TINY = AttributeParams(
    channels=(2, 3), hidden=4, window=4.0, hop=2.0, epochs=25, batch_size=8, learning_rate=0.02, seed=100_000
)


def rhythm(period: int, *, cells: int = 100, seed: int = 0) -> np.ndarray:
    """Features with an onset every `period` moments, and noise in all other channels."""
    music = np.random.default_rng(seed).random((cells, 15)).astype(np.float32)
    music[:, 0] = np.arange(cells) % period == 0
    return music


def labelled() -> LabelledSongs:
    counts = (3, 6, 3, 9)
    songs = [
        Song(f"{DANCES[label]} {number}", rhythm(4 + label, seed=number), label)
        for label, count in enumerate(counts)
        for number in range(count)
    ]
    return LabelledSongs(tuple(songs), DANCES)


def test_every_song_is_tested_once_and_no_class_is_missing_on_a_side():
    songs = labelled()
    parts = folds(songs, 3, seed=1)
    assert sorted(name for part in parts for name in part.test) == sorted(song.name for song in songs.songs)
    labels = {song.name: song.label for song in songs.songs}
    for part in parts:
        assert not {*part.train} & {*part.test}
        assert {labels[name] for name in part.test} == {labels[name] for name in part.train} == {0, 1, 2, 3}
    assert folds(songs, 3, seed=2) != parts == folds(songs, 3, seed=1)


def test_two_classes_are_the_smooth_and_the_fast_dances():
    songs = two_classes(labelled())
    assert songs.classes == ("smooth", "fast")
    assert {song.name.split()[0]: song.label for song in songs.songs} == {
        "cha-cha": 1, "rumba": 0, "tango": 1, "waltz": 0,
    }  # fmt: skip


@pytest.mark.parametrize("period", [4, 5, 7])
def test_rhythm_peaks_at_the_planted_period(period: int):
    onset_rhythm = notebook_cells("15_music_and_attributes").onset_rhythm
    curve = onset_rhythm(rhythm(period))
    assert curve.shape == (39,)
    assert int(curve[: 2 * period - 2].argmax()) + 1 == period
    assert np.isfinite(onset_rhythm(np.zeros((50, 15), np.float32))).all()


def test_windows_cover_a_song_to_its_end_and_a_short_one_is_filled():
    music = rhythm(4, cells=95)
    windows = song_windows(music, TINY)
    assert windows.shape == (4, 40, 15)
    np.testing.assert_array_equal(windows[-1], music[-40:])
    short = song_windows(music[:10], TINY)
    assert short.shape == (1, 40, 15) and not short[0, 10:].any()


@pytest.mark.parametrize("front", ["convolution", "frames"])
def test_published_sizes(front: str):
    classifier = AttributeClassifier(AttributeParams(front=front), DANCES)
    assert (
        sum(values.numel() for values in classifier.parameters()) == {"convolution": 62_316, "frames": 206_404}[front]
    )


def test_it_learns_saves_and_says_the_same_again(tmp_path: Path):
    songs = labelled()
    (split, *_) = folds(songs, 3, seed=1)
    classifier = train_attributes(songs.songs, DANCES, split, TrainOptions(tmp_path / "run"), TINY)
    again = load_weights(tmp_path / "run", AttributeClassifier)
    song = songs.songs[0]
    np.testing.assert_array_equal(again.probabilities(song.music), classifier.probabilities(song.music))
    assert again.probabilities(song.music).sum() == pytest.approx(1.0)
    right = [int(again.probabilities(song.music).argmax()) == song.label for song in songs.songs]
    assert np.mean(right) > 0.6  # the most frequent class has 9 of 21


@pytest.mark.slow
def test_it_goes_on_where_it_was_stopped(tmp_path: Path):
    songs = labelled()
    (split, *_) = folds(songs, 3, seed=1)
    train_attributes(songs.songs, DANCES, split, TrainOptions(tmp_path / "whole"), TINY)

    def stop(row: dict, end: int) -> None:
        if row["epoch"] == 5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        train_attributes(songs.songs, DANCES, split, TrainOptions(tmp_path / "run", report=stop), TINY)
    train_attributes(songs.songs, DANCES, split, TrainOptions(tmp_path / "run", resume=True), TINY)
    for name in ("history.csv", "model.safetensors"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_windows_of_a_batch_do_not_hear_each_other():
    torch.manual_seed(0)
    classifier, music = AttributeClassifier(TINY, DANCES).eval(), torch.rand(5, 40, 15)
    order = torch.tensor([3, 0, 4, 2, 1])
    with torch.no_grad():
        torch.testing.assert_close(classifier(music)[order], classifier(music[order]), atol=1e-6, rtol=1e-5)


def test_a_song_on_both_sides_is_refused(tmp_path: Path):
    songs = labelled()
    name = songs.songs[0].name
    with pytest.raises(ValueError, match="'cha-cha 0' is on both sides"):
        train_attributes(songs.songs, DANCES, SongSplit((name,), (name,)), TrainOptions(tmp_path / "run"), TINY)
    with pytest.raises(ValueError, match="two songs have one name"):
        options = TrainOptions(tmp_path / "run")
        train_attributes([*songs.songs, songs.songs[0]], DANCES, SongSplit((name,), ()), options, TINY)


@pytest.mark.parametrize("change", [{"hidden": 10**9}, {"hidden": -1}, {"channels": [2.5]}, {"channels": [1] * 99}])
def test_hostile_sizes_are_refused_by_file(change: dict, tmp_path: Path):
    import json

    torch.manual_seed(0)
    save_weights(tmp_path / "model", AttributeClassifier(TINY, DANCES))
    about = json.loads((tmp_path / "model.json").read_text())
    about["build"]["params"] |= change
    (tmp_path / "model.json").write_text(json.dumps(about))
    refused(r"model\.safetensors", load_weights, tmp_path, AttributeClassifier)
