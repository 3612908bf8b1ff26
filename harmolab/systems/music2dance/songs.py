"""The songs of corpora, each once, with the dance that was danced to it: what the attribute classifier learns from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from harmolab.corpora.folders import recording_files
from harmolab.io.audio import load_audio
from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.unit_corpus import recording_folders
from harmolab.systems.music2dance.attributes import Song, SongSplit
from harmolab.systems.music2dance.music_features import CHANNELS, blind_features

TEST_SHARE = 0.2  # of the songs of each dance
EXCERPT = 200  # moments (20 s) by which songs are compared
# Least correlation of two encodings of one song: in the recorded corpora these have .98 and more, other songs .29 at
# most, synthetic songs of one dance .68.
SAME = 0.9
SOUND = [number for number, name in enumerate(CHANNELS) if name not in ("beat", "downbeat")]  # tracked beats may differ


class SongSet(NamedTuple):
    """Songs, the names of their classes, and a note for each recording whose song is not among them."""

    songs: tuple[Song, ...]
    classes: tuple[str, ...]
    notes: tuple[str, ...]


def load_songs(roots: Sequence[PathLike], *, progress: Progress = silent) -> SongSet:
    """The songs of corpora; a song that several recordings have, be it cut or encoded anew, is there once.

    Parameters
    ----------
    roots : folders of recordings
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        A root is missing, or there are no two songs of two dances.
    """
    folders, notes = recording_folders(roots)
    labelled: list[tuple[str, NDArray[np.float32], str]] = []
    for folder in progress(folders, "reading songs"):
        name = f"{folder.resolve().parent.name}/{folder.name}"
        try:
            files = recording_files(folder)
            if not files.dance:
                raise ValueError(f"{folder}: no dance is named in beats.json")
            music = blind_features(load_audio(files.song))
        except (ValueError, FileNotFoundError) as error:
            notes.append(str(error))
            continue
        if same := next((other for other, earlier, _ in labelled if is_same_song(music, earlier)), None):
            notes.append(f"{folder}: has the song of {same}")
            continue
        labelled.append((name, music, files.dance))
    classes = tuple(sorted({dance for _, _, dance in labelled}))
    if len(classes) < 2:
        place, of = ", ".join(map(str, roots)), f", of {classes[0]}" if classes else ""
        raise ValueError(
            f"{place}: a classifier needs songs of two dances or more; songs here: {len(labelled)}{of}"
            + (f" (left out: {notes[0]})" if notes else "")
        )
    songs = [Song(name, music, classes.index(dance)) for name, music, dance in labelled]
    return SongSet(tuple(songs), classes, tuple(notes))


def is_same_song(one: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """True where the middle of one song's features (M, 15) is somewhere in the other's, or the other way round."""
    return max(_likeness(one, other), _likeness(other, one)) > SAME


def _likeness(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Highest correlation of the middle 20 s of one song's onsets and chroma with as long a stretch of another's."""
    parts = [part[:, SOUND].astype(np.float64) for part in (one, other)]
    query, song = (part - part.mean(axis=0) for part in parts)
    first = max(0, (len(query) - EXCERPT) // 2)
    query = query[first : first + EXCERPT]
    if len(song) < len(query):
        return 0.0
    products = fftconvolve(song, query[::-1], mode="valid", axes=0).sum(axis=1)
    energy = np.concatenate([[0.0], np.cumsum((song**2).sum(axis=1))])
    norms = np.sqrt(np.maximum((energy[len(query) :] - energy[: -len(query)]) * (query**2).sum(), 0.0))
    return float((products / np.maximum(norms, 1e-6)).max())


def split_songs(songs: Iterable[Song], *, seed: int = 0) -> SongSplit:
    """Songs drawn dance by dance: a fifth of each dance is tested on (R12), one song of two to seven, none of a single.

    Raises
    ------
    ValueError
        If every dance has a single song, so that none could be tested on.
    """
    labels = {song.name: song.label for song in songs}
    test: set[str] = set()
    for label in sorted({*labels.values()}):
        names = sorted(name for name, own in labels.items() if own == label)
        count = min(max(1, round(TEST_SHARE * len(names))), len(names) - 1)
        test |= {*np.random.default_rng([seed, label]).permutation(names)[:count].tolist()}
    if not test:
        raise ValueError(
            f"{len(labels)} songs, each of another dance: none can be tested on; two of a dance are needed"
        )
    return SongSplit(tuple(name for name in labels if name not in test), tuple(name for name in labels if name in test))
