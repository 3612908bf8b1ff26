"""Dances that songs call for: the classifier of Music2Dance, its baseline, and two linear ones (Table 1).

Songs are split, never windows of one song, and the tracker is told no dance. The classes are dances, or the smooth and
the fast ones together; no one sorted songs by mood.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.corpora.folders import find_recordings, load_recording
from harmolab.corpora.synthetic import synthetic_clip
from harmolab.lab.experiments.clock import TrainingClock
from harmolab.lab.experiments.generation import kept_run
from harmolab.lab.experiments.study import corpus_folders, data_root
from harmolab.lab.profile import RunProfile
from harmolab.params import DANCES
from harmolab.significance import bootstrap_interval
from harmolab.systems.common.phases import make_fabric
from harmolab.systems.common.weights import load_weights
from harmolab.systems.music2dance.attributes import (
    AttributeClassifier,
    AttributeParams,
    Song,
    SongSplit,
    blind_features,
    song_windows,
    train_attributes,
)
from harmolab.systems.music2dance.music_features import CHANNELS
from harmolab.types import FloatArray

SONG_SECONDS = 45.0  # of a synthetic song
SONGS_A_DANCE = 8  # synthetic ones
FOLDS = {"recorded, 4 dances": 3, "recorded, 2 classes": 3, "synthetic, 7 dances": 2}
SMOOTH = ("rumba", "waltz")  # against cha-cha and tango; the labels come from the dance, not from listening
LAGS = (1, 39)  # tenths of a second, of the autocorrelation of the onset channel
PAPER = MappingProxyType({"FC + Bi-LSTM": 88.0, "temporal convolution + Bi-LSTM": 92.1})  # other songs, two moods
Predict = Callable[[Song], FloatArray]  # a song to the probabilities of the classes in each of its windows


@dataclass(frozen=True, eq=False)
class LabelledSongs:
    """Songs and the names of their classes."""

    songs: tuple[Song, ...]
    classes: tuple[str, ...]


@cache
def recorded_songs() -> LabelledSongs | None:
    """Every recorded song once, of the dances that were recorded; None without ``HARMOLAB_DATA``."""
    if data_root() is None:
        return None
    songs: dict[str, tuple[np.ndarray, str]] = {}
    for root in corpus_folders(RunProfile.full()).values():
        for folder in find_recordings(root).folders:
            try:
                clip = load_recording(folder).clip
            except (ValueError, FileNotFoundError):
                continue
            # Corpora of one source have the same songs, encoded anew, under the same names.
            if clip.dance in DANCES and folder.name not in songs:
                songs[folder.name] = (blind_features(clip.audio), clip.dance)
    classes = tuple(sorted({dance for _, dance in songs.values()}))
    return LabelledSongs(
        tuple(Song(name, music, classes.index(dance)) for name, (music, dance) in songs.items()), classes
    )


def two_classes(songs: LabelledSongs) -> LabelledSongs:
    """The same songs as smooth (rumba, waltz) and fast ones."""
    groups = [int(name not in SMOOTH) for name in songs.classes]
    return LabelledSongs(tuple(song._replace(label=groups[song.label]) for song in songs.songs), ("smooth", "fast"))


def synthetic_songs(profile: RunProfile) -> LabelledSongs:
    """Synthetic songs of the seven dances."""
    count = max(2, min(SONGS_A_DANCE, profile.n_clips // 10))
    classes = tuple(DANCES)
    songs = []
    for label, dance in enumerate(classes):
        for number in range(count):
            clip = synthetic_clip(dance, seconds=SONG_SECONDS, seed=800_000 + 1000 * label + number)
            songs.append(Song(f"{dance} {number + 1}", blind_features(clip.audio), label))
    return LabelledSongs(tuple(songs), classes)


def song_sets(profile: RunProfile) -> dict[str, LabelledSongs]:
    """Name -> songs: recorded ones by dance and by two classes where there are any, and synthetic ones."""
    recorded = recorded_songs() if profile.epochs is None else None
    sets = {} if recorded is None else {"recorded, 4 dances": recorded, "recorded, 2 classes": two_classes(recorded)}
    return {**sets, "synthetic, 7 dances": synthetic_songs(profile)}


def folds(songs: LabelledSongs, count: int, seed: int) -> list[SongSplit]:
    """The songs in `count` parts, dance by dance, each part once the test side."""
    rng = np.random.default_rng(seed)
    part: dict[str, int] = {}
    for label in range(len(songs.classes)):
        names = [song.name for song in songs.songs if song.label == label]
        part |= {names[place]: turn % count for turn, place in enumerate(rng.permutation(len(names)).tolist())}
    return [
        SongSplit(
            tuple(name for name, own in part.items() if own != fold),
            tuple(name for name, own in part.items() if own == fold),
        )
        for fold in range(count)
    ]


def window_means(music: np.ndarray) -> FloatArray:
    """(30,) means and standard deviations of the channels of a window."""
    return np.concatenate([music.mean(axis=0), music.std(axis=0)])


def onset_rhythm(music: np.ndarray) -> FloatArray:
    """(39,) autocorrelation of the onset channel of a window, lags of .1 to 3.9 s: tempo and meter."""
    onset = music[:, CHANNELS.index("onset")].astype(np.float64)
    onset = onset - onset.mean()
    whole = np.correlate(onset, onset, "full")[onset.size - 1 :]
    return whole[LAGS[0] : LAGS[1] + 1] / max(whole[0], 1e-9)


def _majority(songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int) -> Predict:
    labels = [song.label for song in songs.songs if song.name in split.train]
    shares = np.bincount(labels, minlength=len(songs.classes)) / len(labels)
    return lambda song: np.tile(shares, (len(song_windows(song.music, AttributeParams())), 1))


def _logistic(
    describe: Callable[[np.ndarray], FloatArray],
    songs: LabelledSongs,
    split: SongSplit,
    profile: RunProfile,
    seed: int,
) -> Predict:
    """Logistic regression on a few numbers of a window (scikit-learn)."""
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    def rows(song: Song) -> FloatArray:
        return np.stack([describe(window) for window in song_windows(song.music, AttributeParams())])

    selected = [song for song in songs.songs if song.name in split.train]
    tables = [rows(song) for song in selected]
    labels = np.repeat([song.label for song in selected], [len(table) for table in tables])
    model = make_pipeline(StandardScaler(), LogisticRegression(max_iter=2000))
    model.fit(np.concatenate(tables), labels)
    classes = model[-1].classes_

    def predict(song: Song) -> FloatArray:
        table = rows(song)
        shares = np.zeros((len(table), len(songs.classes)))
        shares[:, classes] = model.predict_proba(table)
        return shares

    return predict


def attribute_params(profile: RunProfile, front: str, seed: int) -> AttributeParams:
    """The paper's network; batches of 8, since there are few windows, and a quick profile's epochs."""
    params = AttributeParams(front=front, batch_size=8, seed=seed)  # type: ignore[arg-type]
    return params if profile.epochs is None else replace(params, epochs=4)


def trained_classifier(
    songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int, *, front: str = "convolution"
) -> AttributeClassifier:
    """A classifier trained on the training side of a split, now unless it was before."""
    params = attribute_params(profile, front, seed)
    sound = hashlib.sha256(b"".join(np.ascontiguousarray(song.music).tobytes() for song in songs.songs)).hexdigest()
    about = {"params": params, "split": split.to_dict(), "classes": songs.classes, "songs": sound}
    folder = kept_run(
        "attributes", about, lambda folder: train_attributes(
            songs.songs, songs.classes, split, folder, params, resume=True, fabric=make_fabric(accelerator="cpu"),
            report=TrainingClock(folder),
        )
    )  # fmt: skip
    return load_weights(folder, AttributeClassifier)


def _network(front: str, songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int) -> Predict:
    classifier = trained_classifier(songs, split, profile, seed, front=front)
    return lambda song: classifier.window_probabilities(song.music)


Fit = Callable[[LabelledSongs, SongSplit, RunProfile, int], Predict]
MODELS: Mapping[str, Fit] = MappingProxyType(
    {
        "majority": _majority,
        "logistic on means": partial(_logistic, window_means),
        "logistic on onset rhythm": partial(_logistic, onset_rhythm),
        "FC + Bi-LSTM": partial(_network, "frames"),
        "temporal convolution + Bi-LSTM": partial(_network, "convolution"),
    }
)


def table_1(profile: RunProfile, models: Iterable[str] = tuple(MODELS)) -> pd.DataFrame:
    """Shares of windows and songs that are classified rightly, cross-validated by song, over the profile's seeds.

    Returns
    -------
    DataFrame with the columns songs ("recorded, 4 dances", ...), model, n, windows, "windows, balanced", "by song",
    "by song, balanced", low and high (95 %, of "by song", bootstrap over songs), guessing (1 / classes), seeds, and
    "paper (other songs, two moods)" in per cent
    """
    rows = []
    for name, songs in song_sets(profile).items():
        for model in models:
            tables = [_outcomes(songs, MODELS[model], profile, FOLDS[name], seed) for seed in _seeds(profile)]
            rows.append({"songs": name, "model": model, **_summary(songs, pd.concat(tables))})
            rows[-1]["paper (other songs, two moods)"] = PAPER.get(model, np.nan)
    return pd.DataFrame(rows)


def _seeds(profile: RunProfile) -> range:
    return range(1, profile.n_seeds + 1)


def _outcomes(songs: LabelledSongs, fit: Fit, profile: RunProfile, count: int, seed: int) -> pd.DataFrame:
    """A row for each song when it was tested: its name and class, the prediction, the share of right windows."""
    rows = []
    for split in folds(songs, count, seed):
        predict = fit(songs, split, profile, seed)
        for song in songs.songs:
            if song.name in split.test:
                shares = predict(song)
                right = (shares.argmax(axis=1) == song.label).mean()
                predicted = int(shares.mean(axis=0).argmax())
                rows.append({"song": song.name, "label": song.label, "predicted": predicted, "right windows": right,
                             "windows": len(shares), "seed": seed})  # fmt: skip
    return pd.DataFrame(rows)


def _summary(songs: LabelledSongs, table: pd.DataFrame) -> dict[str, float]:
    right = (table["predicted"] == table["label"]).astype(float)
    by_song = right.groupby(table["song"]).mean()
    low, high = bootstrap_interval(by_song.to_numpy(), np.ones(len(by_song)))
    windows = table["right windows"] * table["windows"]
    weights = windows.groupby(table["label"]).sum() / table.groupby("label")["windows"].sum()
    return {
        "n": len(by_song),
        "windows": windows.sum() / table["windows"].sum(),
        "windows, balanced": weights.mean(),
        "by song": right.mean(),
        "by song, balanced": right.groupby(table["label"]).mean().mean(),
        "low": low,
        "high": high,
        "guessing": 1 / len(songs.classes),
        "seeds": table["seed"].nunique(),
    }


def confusion(profile: RunProfile, name: str, model: str) -> pd.DataFrame:
    """Counts of songs of each dance (rows) that were taken for each (columns), over the profile's seeds."""
    songs = song_sets(profile)[name]
    tables = [_outcomes(songs, MODELS[model], profile, FOLDS[name], seed) for seed in _seeds(profile)]
    table = pd.concat(tables)
    counts = pd.crosstab(table["label"], table["predicted"]).reindex(
        index=range(len(songs.classes)), columns=range(len(songs.classes)), fill_value=0
    )
    return counts.set_axis(songs.classes, axis=0).set_axis(songs.classes, axis=1)
