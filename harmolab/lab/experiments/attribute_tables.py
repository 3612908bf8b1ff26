"""Table 1 of Music2Dance from the predictions for each song: accuracies, paired differences, confusions; one song.

Accuracies are per cent, as the paper's are, and of songs that no training had.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.lab.experiments.attributes import (
    CONVOLUTION,
    FOLDS,
    FRAMES,
    MODELS,
    RHYTHM,
    LabelledSongs,
    folds,
    song_sets,
)
from harmolab.lab.profile import RunProfile
from harmolab.significance import bootstrap_interval
from harmolab.systems.music2dance.attributes import AttributeParams, Song, window_starts
from harmolab.systems.music2dance.music_features import blind_features
from harmolab.types import Audio, FloatArray

PAPER = "paper (other songs, two moods)"
PRINTED: Mapping[str, float] = MappingProxyType({FRAMES: 88.0, CONVOLUTION: 92.1})
ACCURACIES = ("windows", "songs", "balanced")


def attribute_outcomes(profile: RunProfile, models: Iterable[str] = tuple(MODELS)) -> pd.DataFrame:
    """Class that each model gives each song after a training without that song, over the profile's seeds.

    Returns
    -------
    DataFrame, a row for each set of songs ("recorded, 4 dances", ...), model, seed and song: set, model, seed, classes
    (their number), song, label and predicted (names of classes), windows and "right windows" (numbers), updates (of the
    weights in the training), training (share of the windows of its own songs that the training got right)
    """
    rows: list[dict[str, Any]] = []
    models = tuple(models)
    for name, songs in song_sets(profile).items():
        for model in models:
            for seed in range(1, profile.n_seeds + 1):
                about = {"set": name, "model": model, "seed": seed, "classes": len(songs.classes)}
                rows += [about | row for row in _tested(songs, model, profile, FOLDS[name], seed)]
    return pd.DataFrame(rows)


def _tested(songs: LabelledSongs, model: str, profile: RunProfile, count: int, seed: int) -> Iterator[dict[str, Any]]:
    """A row for each song when it was on the test side."""
    for split in folds(songs, count, seed):
        fitted = MODELS[model](songs, split, profile, seed)
        answers = {song.name: fitted.predict(song) for song in songs.songs}
        right = {song.name: answers[song.name].argmax(axis=1) == song.label for song in songs.songs}
        training = np.concatenate([right[name] for name in split.train]).mean()
        for song in songs.songs:
            if song.name in split.test:
                yield {
                    "song": song.name,
                    "label": songs.classes[song.label],
                    "predicted": songs.classes[int(answers[song.name].mean(axis=0).argmax())],
                    "windows": len(right[song.name]),
                    "right windows": int(right[song.name].sum()),
                    "updates": fitted.updates,
                    "training": float(training),
                }


def attribute_table(outcomes: pd.DataFrame) -> pd.DataFrame:
    """Table 1: accuracies of each model on each set of songs in per cent, with 95 % intervals by bootstrap over songs.

    Parameters
    ----------
    outcomes : DataFrame of `attribute_outcomes`

    Returns
    -------
    DataFrame with set, model, n (songs); windows, songs, balanced (songs, the mean over classes), each with " low" and
    " high"; chance (a guess among the classes), training (windows of the songs trained on), updates (of one training,
    mean), seeds, and the paper's number in a column of its own
    """
    rows = []
    for (name, model), table in outcomes.groupby(["set", "model"], sort=False):
        by_song = _by_song(table)
        row: dict[str, Any] = {"set": name, "model": model, "n": len(by_song)}
        for measure in ACCURACIES:
            row |= _with_interval(measure, _rates(by_song, measure), _weights(by_song, measure))
        by_seed = [_by_song(part) for _, part in table.groupby("seed")]
        balanced = [100 * np.average(_rates(part, "balanced"), weights=_weights(part, "balanced")) for part in by_seed]
        row |= {"least seed": min(balanced), "best seed": max(balanced)}
        row |= {"chance": 100 / table["classes"].iloc[0], "training": 100 * table["training"].mean()}
        row |= {"updates": round(table["updates"].mean()), "seeds": table["seed"].nunique()}
        rows.append(row | {PAPER: PRINTED.get(str(model), np.nan)})
    return pd.DataFrame(rows)


def attribute_differences(
    outcomes: pd.DataFrame, model: str = CONVOLUTION, others: Iterable[str] = (FRAMES, RHYTHM)
) -> pd.DataFrame:
    """Accuracies of a model minus those of others, song by song, in points of per cent.

    Parameters
    ----------
    outcomes : DataFrame of `attribute_outcomes`

    Returns
    -------
    DataFrame with set, model, against, measure (in `ACCURACIES`), difference, its 95 % interval by bootstrap over songs
    (low, high), clear (the interval leaves out 0), and "seeds ahead" (number of seeds in which the model is ahead) of
    seeds
    """
    rows = []
    for name, table in outcomes.groupby("set", sort=False):
        for other in others:
            pair = table[table["model"].isin([model, other])]
            seeds = [part for _, part in pair.groupby("seed")]
            for measure in ACCURACIES:
                gaps, weights = _gaps(pair, model, other, measure)
                value, low, high = _with_interval("difference", gaps, weights).values()
                ahead = sum(bool(np.dot(*_gaps(part, model, other, measure)) > 1e-9) for part in seeds)
                rows.append(
                    {"set": name, "model": model, "against": other, "measure": measure, "difference": value}
                    | {"low": low, "high": high, "clear": bool(low > 0 or high < 0)}
                    | {"seeds ahead": ahead, "seeds": len(seeds)}
                )
    return pd.DataFrame(rows)


def _gaps(table: pd.DataFrame, model: str, other: str, measure: str) -> tuple[FloatArray, FloatArray]:
    """Accuracy of a model minus that of another, song by song, and the weights of the songs."""
    first, second = (_by_song(table[table["model"] == name]) for name in (model, other))
    return _rates(first, measure) - _rates(second, measure), _weights(first, measure)


def _by_song(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each song, by name: label, windows, and over the seeds the means of what is right."""
    rows = table.assign(right=table["predicted"] == table["label"], share=table["right windows"] / table["windows"])
    return rows.groupby("song").agg(
        label=("label", "first"), windows=("windows", "first"), right=("right", "mean"), share=("share", "mean")
    )


def _rates(by_song: pd.DataFrame, measure: str) -> FloatArray:
    """Accuracy for each song, from 0 to 1."""
    return by_song["share" if measure == "windows" else "right"].to_numpy(np.float64)


def _weights(by_song: pd.DataFrame, measure: str) -> FloatArray:
    """Weight of each song: its windows, one, or one for all songs of its class together."""
    if measure == "balanced":
        return 1 / by_song.groupby("label")["label"].transform("size").to_numpy(np.float64)
    return by_song["windows"].to_numpy(np.float64) if measure == "windows" else np.ones(len(by_song))


def _with_interval(name: str, rates: FloatArray, weights: FloatArray) -> dict[str, float]:
    """A weighted mean in per cent, and its interval."""
    low, high = bootstrap_interval(rates, weights)
    return {name: 100 * float(np.average(rates, weights=weights)), f"{name} low": 100 * low, f"{name} high": 100 * high}


def attribute_confusion(outcomes: pd.DataFrame, name: str, model: str) -> pd.DataFrame:
    """Songs of each class (rows) by the class that a model gives them (columns), means over the seeds.

    Parameters
    ----------
    outcomes : DataFrame of `attribute_outcomes`
    name : of a set in it
    """
    table = outcomes[(outcomes["set"] == name) & (outcomes["model"] == model)]
    classes = sorted(table["label"].unique())
    counts = pd.crosstab(table["label"], table["predicted"]) / table["seed"].nunique()
    return counts.reindex(index=classes, columns=classes, fill_value=0.0)


def song_probabilities(profile: RunProfile, audio: Audio, name: str = "") -> pd.DataFrame:
    """Probabilities of the classes along a song, by the convolution and by the logistic model of onset rhythm.

    They are those of the first of `song_sets`, of the first seed, and of a fold that tests the song where it is one of
    the set.

    Parameters
    ----------
    audio : Audio, the whole song
    name : of the song in the set, if it is one of it

    Returns
    -------
    DataFrame, a row for each model, window and class: set, model, start and end (seconds), label, probability
    """
    title, songs = next(iter(song_sets(profile).items()))
    splits = folds(songs, FOLDS[title], 1)
    split = next((split for split in splits if name in split.test), splits[0])
    song, params = Song(name, blind_features(audio), 0), AttributeParams()
    starts = window_starts(len(song.music), params) / params.rate
    rows = []
    for model in (CONVOLUTION, RHYTHM):
        for start, values in zip(starts, MODELS[model](songs, split, profile, 1).predict(song), strict=True):
            about = {"set": title, "model": model, "start": start, "end": start + params.window}
            rows += [about | {"label": label, "probability": p} for label, p in zip(songs.classes, values, strict=True)]
    return pd.DataFrame(rows)
