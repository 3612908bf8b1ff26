"""Songs by the dance that they call for: sets of them, their folds, and classifiers trained on a fold (notebook 15).

Songs are split, never windows of one song, and the tracker is told no dance. The classes are dances, or the smooth and
the fast ones together; no one sorted songs by mood.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, product
from pathlib import Path

import numpy as np

from harmolab.data.recordings import Recording, recording_beats
from harmolab.params import DANCES
from harmolab.significance import bootstrap_interval as bootstrap_interval
from harmolab.systems.music2dance.attributes import AttributeClassifier, AttributeParams, SongSplit, train_attributes
from harmolab.systems.music2dance.attributes import Song as Song
from harmolab.systems.music2dance.attributes import song_windows as song_windows
from harmolab.systems.music2dance.attributes import window_starts as window_starts
from harmolab.systems.music2dance.music_features import blind_features
from harmolab.systems.training.weights import load_weights
from harmolab.types import Clip
from study.experiments.generation import kept_run
from study.experiments.study import corpus_folders, data_root, planted_song, readable_recordings
from study.profile import RunProfile

SONG_SECONDS, FIRST_SEED = 45.0, 800_000  # of synthetic songs
SONGS_A_DANCE = 8  # synthetic ones
SMOOTH = ("rumba", "waltz")  # against cha-cha and tango; the labels come from the dance, not from listening


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
    every = chain.from_iterable(map(readable_recordings, corpus_folders(RunProfile.full()).values()))
    return (recording for recording in every if recording.clip.dance in DANCES)


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
    for (label, dance), number in product(enumerate(DANCES), range(count)):
        clip = planted_song(dance, number, SONG_SECONDS, FIRST_SEED)
        songs.append(Song(clip.name, blind_features(clip.audio), label))
    return LabelledSongs(tuple(songs), tuple(DANCES))


def example_song(profile: RunProfile, dance: str = "cha-cha") -> Clip:
    """The first song of a dance in the first of `song_sets`, with its sound, and its beats as annotated or planted."""
    if profile.epochs is None and data_root() is not None:
        for recording in _recordings():
            if recording.clip.dance == dance:
                annotated = recording.annotation is not None and recording.annotation.times.size > 0
                return replace(recording.clip, beats=recording_beats(recording, "annotated") if annotated else None)
    return planted_song(dance, 0, SONG_SECONDS, FIRST_SEED)


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


def trained_classifier(
    songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int, *, front: str = "convolution"
) -> AttributeClassifier:
    """A classifier trained on the training side of a split, now unless it was before.

    The paper's network but for batches of 8, since there are few windows; a quick profile's has 4 epochs.
    """
    params = AttributeParams(front=front, batch_size=8, seed=seed)  # type: ignore[arg-type]
    params = params if profile.epochs is None else replace(params, epochs=4)
    sound = hashlib.sha256(b"".join(np.ascontiguousarray(song.music).tobytes() for song in songs.songs)).hexdigest()
    labels = {song.name: song.label for song in songs.songs}
    about = {"params": params, "split": split.to_dict(), "classes": songs.classes, "labels": labels, "songs": sound}
    folder = kept_run(
        "attributes", about, lambda options: train_attributes(songs.songs, songs.classes, split, options, params)
    )
    return load_weights(folder, AttributeClassifier)
