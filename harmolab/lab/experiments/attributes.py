"""Dances that songs call for: the classifier of Music2Dance, its baseline, and two linear ones (Table 1).

Songs are split, never windows of one song, and the tracker is told no dance. The classes are dances, or the smooth and
the fast ones together; no one sorted songs by mood.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from harmolab.corpora.folders import Recording, find_recordings, load_recording, recording_beats
from harmolab.corpora.synthetic import ClipSettings, planted_clip
from harmolab.lab.experiments.clock import TrainingClock
from harmolab.lab.experiments.generation import kept_run
from harmolab.lab.experiments.study import corpus_folders, data_root
from harmolab.lab.profile import RunProfile
from harmolab.params import DANCES
from harmolab.systems.common.phases import make_fabric
from harmolab.systems.common.weights import load_weights
from harmolab.systems.music2dance.attributes import (
    AttributeClassifier,
    AttributeParams,
    Song,
    SongSplit,
    song_windows,
    train_attributes,
)
from harmolab.systems.music2dance.music_features import CHANNELS, blind_features
from harmolab.types import Clip, FloatArray

SONG_SECONDS = 45.0  # of a synthetic song
SONGS_A_DANCE = 8  # synthetic ones
FOLDS = {"recorded, 4 dances": 3, "recorded, 2 classes": 3, "synthetic, 7 dances": 2}
SMOOTH = ("rumba", "waltz")  # against cha-cha and tango; the labels come from the dance, not from listening
LAGS = (1, 39)  # tenths of a second, of the autocorrelation of the onset channel
RHYTHM, FRAMES, CONVOLUTION = "logistic on onset rhythm", "FC + Bi-LSTM", "temporal convolution + Bi-LSTM"
Predict = Callable[[Song], FloatArray]  # a song to the probabilities of the classes in each of its windows


class Fitted(NamedTuple):
    """A fitted model, and the number of updates of its weights; 0 where it is not fitted by steps."""

    predict: Predict
    updates: int = 0


@dataclass(frozen=True, eq=False)
class LabelledSongs:
    """Songs and the names of their classes."""

    songs: tuple[Song, ...]
    classes: tuple[str, ...]


def recorded_songs() -> LabelledSongs | None:
    """Every recorded song once, of the dances that were recorded; None without ``HARMOLAB_DATA`` or such songs."""
    root = data_root()
    return None if root is None else _songs_below(root)


def _recordings() -> Iterator[Recording]:
    """Readable recordings of a known dance."""
    for root in corpus_folders(RunProfile.full()).values():
        for folder in find_recordings(root).folders:
            try:
                recording = load_recording(folder)
            except (ValueError, FileNotFoundError):
                continue
            if recording.clip.dance in DANCES:
                yield recording


@cache
def _songs_below(root: Path) -> LabelledSongs | None:
    songs: dict[str, tuple[np.ndarray, str]] = {}
    for clip in (recording.clip for recording in _recordings()):
        # Corpora of one source have the same songs, encoded anew, under the same names.
        if clip.name not in songs:
            songs[clip.name] = (blind_features(clip.audio), clip.dance)
    if not songs:
        return None
    classes = tuple(sorted({dance for _, dance in songs.values()}))
    return LabelledSongs(
        tuple(Song(name, music, classes.index(dance)) for name, (music, dance) in songs.items()), classes
    )


def two_classes(songs: LabelledSongs) -> LabelledSongs:
    """The same songs as smooth (rumba, waltz) and fast ones."""
    groups = [int(name not in SMOOTH) for name in songs.classes]
    return LabelledSongs(tuple(song._replace(label=groups[song.label]) for song in songs.songs), ("smooth", "fast"))


@cache
def synthetic_songs(profile: RunProfile) -> LabelledSongs:
    """Synthetic songs of the seven dances."""
    count = max(2, min(SONGS_A_DANCE, profile.n_clips // 10))
    songs = []
    for label, dance in enumerate(DANCES):
        for number in range(count):
            clip = _synthetic_song(dance, number)
            songs.append(Song(clip.name, blind_features(clip.audio), label))
    return LabelledSongs(tuple(songs), tuple(DANCES))


def _synthetic_song(dance: str, number: int) -> Clip:
    """A song with its planted beats and bars."""
    seed = 800_000 + 1000 * list(DANCES).index(dance) + number
    planted = planted_clip(ClipSettings(dance, SONG_SECONDS, seed=seed))
    beats = planted.annotation.track(planted.clip.audio.duration)
    return replace(planted.clip, name=f"{dance} {number + 1}", beats=beats)


def example_song(profile: RunProfile, dance: str = "cha-cha") -> Clip:
    """The first song of a dance in the first of `song_sets`, with its sound, and its beats as annotated or planted."""
    if profile.epochs is None and data_root() is not None:
        for recording in _recordings():
            if recording.clip.dance == dance:
                annotated = recording.annotation is not None and recording.annotation.times.size > 0
                return replace(recording.clip, beats=recording_beats(recording, "annotated") if annotated else None)
    return _synthetic_song(dance, 0)


def bar_starts(clip: Clip) -> FloatArray | None:
    """Times at which the bars of a clip's beats begin, in seconds; None where that is unknown."""
    if clip.beats is None or clip.beats.bar_places is None:
        return None
    return clip.beats.times[clip.beats.bar_places == 0]


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


def _majority(songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int) -> Fitted:
    labels = [song.label for song in songs.songs if song.name in split.train]
    shares = np.bincount(labels, minlength=len(songs.classes)) / len(labels)
    return Fitted(lambda song: np.tile(shares, (len(song_windows(song.music, AttributeParams())), 1)))


def _logistic(
    describe: Callable[[np.ndarray], FloatArray],
    songs: LabelledSongs,
    split: SongSplit,
    profile: RunProfile,
    seed: int,
) -> Fitted:
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

    return Fitted(predict)


def attribute_params(profile: RunProfile, front: str, seed: int) -> AttributeParams:
    """The paper's network; batches of 8, since there are few windows, and a quick profile's epochs."""
    params = AttributeParams(front=front, batch_size=8, seed=seed)  # type: ignore[arg-type]
    return params if profile.epochs is None else replace(params, epochs=4)


def training_remark(profile: RunProfile) -> str:
    """Words that a picture of a quick profile's training needs; "" for a whole training."""
    return "" if profile.epochs is None else "quick profile: networks hardly trained"


def trained_classifier(
    songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int, *, front: str = "convolution"
) -> AttributeClassifier:
    """A classifier trained on the training side of a split, now unless it was before."""
    params = attribute_params(profile, front, seed)
    sound = hashlib.sha256(b"".join(np.ascontiguousarray(song.music).tobytes() for song in songs.songs)).hexdigest()
    labels = {song.name: song.label for song in songs.songs}
    about = {"params": params, "split": split.to_dict(), "classes": songs.classes, "labels": labels, "songs": sound}
    folder = kept_run(
        "attributes", about, lambda folder: train_attributes(
            songs.songs, songs.classes, split, folder, params, resume=True, fabric=make_fabric(accelerator="cpu"),
            report=TrainingClock(folder),
        )
    )  # fmt: skip
    return load_weights(folder, AttributeClassifier)


def _network(front: str, songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int) -> Fitted:
    classifier = trained_classifier(songs, split, profile, seed, front=front)
    params = classifier.params
    windows = sum(len(song_windows(song.music, params)) for song in songs.songs if song.name in split.train)
    updates = params.epochs * -(-windows // params.batch_size)
    return Fitted(lambda song: classifier.window_probabilities(song.music), updates)


Fit = Callable[[LabelledSongs, SongSplit, RunProfile, int], Fitted]
MODELS: Mapping[str, Fit] = MappingProxyType(
    {
        "majority": _majority,
        "logistic on means": partial(_logistic, window_means),
        RHYTHM: partial(_logistic, onset_rhythm),
        FRAMES: partial(_network, "frames"),
        CONVOLUTION: partial(_network, "convolution"),
    }
)
