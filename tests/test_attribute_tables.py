"""Table 1 of Music2Dance from planted predictions, and its pictures: accuracies, pairs of songs, confusions, shapes."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.systems.music2dance.attributes import AttributeClassifier, AttributeParams, Song, SongSplit, window_starts
from harmolab.types import Audio, Clip
from study.cells import notebook_cells
from study.experiments import attributes
from study.experiments.attributes import LabelledSongs
from study.figures import attributes as drawing
from study.profile import RunProfile
from study.shapes import classifier_stages
from tests.builders import cases

QUICK, NOTEBOOK = RunProfile.quick(), "15_music_and_attributes"
CELLS = notebook_cells(NOTEBOOK)
CONVOLUTION, FRAMES, RHYTHM = CELLS.CONVOLUTION, CELLS.FRAMES, CELLS.RHYTHM
PAPER = "paper (other songs, two moods)"


def outcome(model: str, song: str, label: str, predicted: str, *, seed: int = 1, **more: Any) -> dict[str, Any]:
    """A song of four windows, all right or all wrong."""
    right = 4 if label == predicted else 0
    row = {"set": "planted", "model": model, "seed": seed, "classes": 2, "song": song, "label": label}
    row |= {"predicted": predicted, "windows": 4, "right windows": right, "updates": 30, "training": 1.0}
    return row | more


def waltzes_and_tango(model: str, right: str) -> list[dict[str, Any]]:
    """Three waltzes and a tango; the letters of `right` say of each if it is recognised (y or n)."""
    songs = [("w1", "waltz"), ("w2", "waltz"), ("w3", "waltz"), ("t1", "tango")]
    other = {"waltz": "tango", "tango": "waltz"}
    pairs = zip(songs, right, strict=True)
    return [outcome(model, name, label, label if letter == "y" else other[label]) for (name, label), letter in pairs]


@pytest.mark.slow
def test_accuracies_are_per_cent_of_windows_of_songs_and_of_classes():
    rows = waltzes_and_tango(CONVOLUTION, "yynn")
    rows[0] |= {"windows": 12, "right windows": 9}
    (row,) = CELLS.accuracy_table(pd.DataFrame(rows)).to_dict("records")
    shares = [row[name] for name in ("windows", "songs", "balanced")]
    assert shares == pytest.approx([100 * 13 / 24, 50.0, (200 / 3 + 0) / 2])
    assert (row["n"], row["chance"], row["updates"], row["seeds"], row["training"]) == (4, 50.0, 30, 1, 100.0)
    assert row[PAPER] == 92.1
    assert 0 <= row["songs low"] < row["songs"] < row["songs high"] <= 100


@pytest.mark.slow
def test_seeds_of_one_song_count_as_one_song():
    songs = [f"s{number}" for number in range(6)]
    rows = [outcome("m", song, "waltz", name, seed=n) for song in songs for n, name in ((1, "waltz"), (2, "tango"))]
    (row,) = CELLS.accuracy_table(pd.DataFrame(rows)).to_dict("records")
    assert (row["n"], row["seeds"]) == (6, 2)
    # Each song is right in half of the trainings: there is nothing that another draw of songs could change.
    assert row["songs"] == row["songs low"] == row["songs high"] == 50.0
    assert (row["least seed"], row["best seed"]) == (0.0, 100.0)
    assert np.isnan(row[PAPER])


@pytest.mark.slow
def test_differences_are_taken_song_by_song_whatever_their_order():
    better, worse = waltzes_and_tango(CONVOLUTION, "yyyn"), waltzes_and_tango(FRAMES, "nnnn")[::-1]
    rhythm = waltzes_and_tango(RHYTHM, "yyyn")[::-1]
    table = CELLS.difference_table(pd.DataFrame([*better, *worse, *rhythm])).set_index(["against", "measure"])
    assert table.loc[[(FRAMES, "songs"), (FRAMES, "balanced")], "difference"].tolist() == pytest.approx([75.0, 50.0])
    # The same songs right and wrong: no draw of songs shows a difference. Unpaired, the interval would be wide.
    assert [*table.loc[(RHYTHM, "songs"), ["difference", "low", "high"]]] == [0.0, 0.0, 0.0]
    assert not table.loc[(RHYTHM, "songs"), "clear"]


def test_a_difference_is_clear_where_its_interval_leaves_out_zero():
    names = [f"s{number}" for number in range(12)]
    better = [outcome(CONVOLUTION, name, "waltz", "waltz") for name in names]
    worse = [outcome(FRAMES, name, "waltz", "tango" if number % 2 else "waltz") for number, name in enumerate(names)]
    table = CELLS.difference_table(pd.DataFrame([*better, *worse]), others=[FRAMES]).set_index("measure")
    assert table.loc["songs", "difference"] == pytest.approx(50.0)
    assert table.loc["songs", "low"] > 0 and table["clear"].all()


def test_seeds_ahead_are_counted_one_by_one_and_a_tie_is_not_ahead():
    rows = [
        outcome(model, name, "waltz", "waltz" if right else "tango", seed=seed)
        for name in ("w1", "w2")
        for seed, better, worse in ((1, True, False), (2, True, True), (3, False, True))
        for model, right in ((CONVOLUTION, better), (FRAMES, worse))
    ]
    table = CELLS.difference_table(pd.DataFrame(rows), others=[FRAMES])
    assert table[["difference", "seeds ahead", "seeds"]].to_numpy().tolist() == [[0.0, 1, 3]] * 3


def test_confusions_are_means_over_seeds_with_every_class_in_both_directions():
    rows = [outcome("m", "t1", "tango", "waltz"), outcome("m", "t1", "tango", "tango", seed=2)]
    rows += [outcome("m", "w1", "waltz", "waltz", seed=seed) for seed in (1, 2)]
    table = CELLS.confusion_table(pd.DataFrame(rows), ["m"]).set_index("label").drop(columns="model")
    assert [*table.index] == [*table.columns] == ["tango", "waltz"]
    np.testing.assert_array_equal(table.to_numpy(), [[0.5, 0.5], [0.0, 1.0]])


def rhythms() -> LabelledSongs:
    """Twelve songs of 30 s in two classes, which differ in the time from onset to onset."""
    songs = []
    for number in range(12):
        music = np.random.default_rng(number).random((300, 15)).astype(np.float32)
        music[:, 0] = np.arange(300) % (4 + number % 2) == 0
        songs.append(Song(f"song {number}", music, number % 2))
    return LabelledSongs(tuple(songs), ("four", "five"))


def planted_cells(**names: Any) -> Any:
    """The notebook's functions with the twelve songs in place of the corpora."""
    sets = {"planted": rhythms()}
    return notebook_cells(NOTEBOOK, song_sets=lambda profile: sets, PARTS={"planted": 3}, **names)


def test_every_song_is_judged_once_a_seed_and_rhythm_tells_planted_rhythms():
    outcomes = planted_cells().all_outcomes(QUICK, ["majority", RHYTHM])
    assert sorted(outcomes["song"]) == sorted(2 * [song.name for song in rhythms().songs])
    table = CELLS.accuracy_table(outcomes).set_index("model")
    assert table.loc[RHYTHM, ["windows", "songs", "balanced", "training"]].tolist() == [100.0] * 4
    assert table.loc["majority", "balanced"] == pytest.approx(50.0)
    assert table.loc["majority", "chance"] == 50.0


def test_a_song_of_the_set_is_shown_by_a_training_without_it():
    splits: list[SongSplit] = []

    def spy(model: str, songs: LabelledSongs, split: SongSplit, profile: RunProfile, seed: int) -> tuple[Any, int]:
        splits.append(split)
        return lambda song: np.tile([0.25, 0.75], (len(window_starts(len(song.music), AttributeParams())), 1)), 0

    cells = planted_cells(fitted=spy)
    sound = Audio(np.random.default_rng(0).normal(0, 0.1, 22050 * 41), 22050.0)
    for song in rhythms().songs:
        table = cells.song_probabilities(QUICK, sound, song.name)
        assert all(song.name not in split.train for split in splits)
        splits.clear()
    assert sorted(set(table["start"])) == [0.0, 5.0, 10.0, 11.0]
    assert {*zip(table["label"], table["probability"], strict=True)} == {("four", 0.25), ("five", 0.75)}


def test_songs_under_other_labels_are_trained_anew(monkeypatch: pytest.MonkeyPatch):
    keys: list[Any] = []
    monkeypatch.setattr(attributes, "kept_run", lambda kind, about, train: keys.append(about))
    monkeypatch.setattr(attributes, "load_weights", lambda folder, kind: None)
    songs, split = rhythms(), SongSplit(("song 0",), ("song 1",))
    other = LabelledSongs(tuple(song._replace(label=1 - song.label) for song in songs.songs), songs.classes)
    for each in (songs, songs, other):
        attributes.trained_classifier(each, split, QUICK, 1)
    assert keys[0] == keys[1] != keys[2]


def test_a_folder_without_songs_of_a_dance_gives_no_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path))
    assert attributes.recorded_songs() is None


def test_example_is_a_synthetic_song_with_its_bars_where_none_is_recorded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    clip = attributes.example_song(RunProfile.full(), "waltz")
    assert (clip.name, clip.dance) == ("waltz 1", "waltz")
    assert clip.beats is not None and clip.beats.bar_places is not None
    bars = clip.beats.times[clip.beats.bar_places == 0]
    assert np.diff(bars) == pytest.approx(3 * np.median(np.diff(clip.beats.times)), rel=0.05)


@cases("cells, starts", (20, [0]), (40, [0]), (95, [0, 20, 40, 55]), (80, [0, 20, 40]))
def test_windows_start_a_hop_apart_and_the_last_ends_with_the_song(cells: int, starts: list[int]):
    assert window_starts(cells, AttributeParams(window=4.0, hop=2.0)).tolist() == starts


def test_shapes_are_those_of_the_paper():
    stages = classifier_stages(AttributeClassifier(AttributeParams(), ["a", "b"]))
    convolutions = [(1, 300, 15), (16, 300, 15), (24, 300, 15), (32, 150, 15)]
    assert [stage.shape for stage in stages] == [(300, 15), *convolutions, (150, 480), (150, 30), (30,), (2,)]
    assert [stage.detail[-1] for stage in stages if stage.detail.startswith("kernel 2, stride ")] == ["1", "1", "2"]


@pytest.mark.parametrize("front", ["convolution", "frames"])
def test_shapes_are_measured_and_the_parameters_of_all_layers_add_up(front: str):
    params = AttributeParams(front=front, channels=(2, 3), hidden=4, window=4.1)  # type: ignore[arg-type]
    classifier = AttributeClassifier(params, ["a", "b", "c"])
    stages = classifier_stages(classifier)
    assert sum(stage.parameters for stage in stages) == sum(values.numel() for values in classifier.parameters())
    assert stages[0].shape == (41, 15)
    assert [stage.shape for stage in stages[-3:]] == [(21 if front == "convolution" else 41, 8), (8,), (3,)]
    assert classifier.training
    assert not any(module._forward_hooks or module._forward_pre_hooks for module in classifier.modules())


@pytest.fixture
def ax() -> Axes:
    return Figure().add_subplot()


ROW = {"set": "planted", "model": CONVOLUTION, "n": 4, "balanced": 60.0, "balanced low": 40.0, "balanced high": 80.0}
ROW |= {"chance": 25.0, "least seed": 55.0, "best seed": 70.0}
GAP = {"set": "planted", "against": FRAMES, "measure": "balanced", "difference": 10.0, "low": -5.0, "high": 20.0}


def test_table_has_a_row_of_panels_for_each_set_and_its_remark():
    rows, gaps = (pd.DataFrame([one, {**one, "set": "other"}]) for one in (ROW, GAP))
    figure = drawing.accuracy_figure(rows, gaps, remark="not trained")
    assert [ax.get_title("left") for ax in figure.axes[::2]] == ["planted: 4 songs", "other: 4 songs"]
    title = "The temporal convolution is the best model on 2 of 2 sets of songs (planted and other)"
    assert (figure.get_suptitle(), figure.get_supxlabel()) == (title, "not trained")


def test_confusion_shows_its_numbers_and_how_many_songs_a_class_has():
    counts = pd.DataFrame({"model": ["m", "m"], "label": ["tango", "waltz"], "tango": [2.0, 0.0], "waltz": [1.0, 4.5]})
    ax = CELLS.confusion_figure(counts).axes[0]
    assert [text.get_text() for text in ax.texts] == ["2", "1", "\N{MIDDLE DOT}", "4.5"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["tango (3)", "waltz (4)"]


@cases("first, title, bold", (0.3, "2 of 3 windows taken for tango", "70"), (0.9, "3 of 3 windows taken", "90"))
def test_title_of_a_model_counts_the_windows_of_its_class_which_are_bold(first: float, title: str, bold: str):
    starts = {"start": [0.0, 5.0, 10.0], "end": [30.0, 35.0, 40.0], "song": "Tune", "model": "m"}
    shares = {"tango": np.array([0.8, 0.6, first]), "waltz": 1 - np.array([0.8, 0.6, first])}
    rows = [pd.DataFrame(starts | {"label": label, "probability": share}) for label, share in shares.items()]
    ax = CELLS.probabilities_figure(pd.concat(rows)).axes[0]
    assert ax.get_title("left").startswith(f"m: {title}")
    assert {text.get_text() for text in ax.texts if text.get_weight() == "bold"} == {"80", "60", bold}
    assert [text.get_text() for text in ax.get_xticklabels()] == ["15", "20", "25"]


def test_its_words_name_the_numbers_of_the_tables():
    better, worse = waltzes_and_tango(CONVOLUTION, "yyyn"), waltzes_and_tango(FRAMES, "nnnn")
    others = waltzes_and_tango(RHYTHM, "yyyy") + waltzes_and_tango("majority", "yyyn")
    outcomes = pd.DataFrame([*better, *worse, *others])
    differences = CELLS.difference_table(outcomes)
    tables = {"m2d_table01": CELLS.accuracy_table(outcomes), "m2d_table01b_differences": differences}
    assert "gives 50% of 4 songs (planted) their dance, its baseline 0%," in CELLS.finding(tables)
    words = CELLS.reading(tables)
    assert "the paper's network gives 75% their class, the baseline 0%, always the same class 75%." in words
    assert f"- minus {RHYTHM}: -50 points" in words


def test_song_is_drawn_on_one_time_axis_with_what_the_classifier_hears():
    music = np.zeros((250, 15), np.float32)
    music[40, 1:3], music[60, 1], music[40, 0] = 1.0, 0.5, 0.7
    clip = Clip("Tune", Audio(np.sin(np.arange(25 * 8000) / 9.0), 8000.0), source="beatlocked", dance="waltz")
    rates, bars = (10.0, 40.0), np.array([4.1, 9.0])
    figure = drawing.song_figure(clip, music, np.zeros((1000, 80), np.float32), rates=rates, bars=bars, start=2.0)
    words = "Waltz Tune, recordings on the beat: the downbeat is guessed at 1 of 2 true bar lines"
    assert figure.get_suptitle() == words
    assert [ax.get_xlim() for ax in figure.axes] == [(2.0, 22.0)] * 5
    assert figure.axes[1].images[0].get_extent() == pytest.approx([-0.0125, 24.9875, -0.5, 79.5])
    assert figure.axes[2].images[0].get_array().shape == (12, 250)
    onsets = {round(bar.get_x() + bar.get_width() / 2, 6): bar.get_height() for bar in figure.axes[4].patches}
    assert {time: height for time, height in onsets.items() if height} == {4.0: pytest.approx(0.7)}


def test_bars_are_marked_only_where_they_are_known(ax: Axes):
    drawing.draw_beat_channels(ax, np.zeros((20, 15), np.float32), 10.0)
    assert not ax.lines
    drawing.draw_beat_channels(ax, np.zeros((20, 15), np.float32), 10.0, np.array([0.5, 1.5]))
    assert ax.lines[0].get_xdata().tolist() == [0.5, 1.5]


def test_each_stage_is_a_box_with_its_shape():
    networks = {
        front: classifier_stages(AttributeClassifier(AttributeParams(front=front), ["a", "b"]))  # type: ignore[arg-type]
        for front in ("convolution", "frames")
    }
    (ax,) = drawing.classifier_figure(networks).axes
    words = [text.get_text() for text in ax.texts]
    assert len([patch for patch in ax.patches if patch.get_gid() == "box"]) == 9 + 7
    assert {"(300, 15)", "(1, 300, 15)", "(32, 150, 15)", "(150, 480)", "(300, 480)", "(30)", "(2)"} <= {*words}
    assert "frames:\n206 k parameters" in words
