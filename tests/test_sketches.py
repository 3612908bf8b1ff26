"""Sketches of the songs of a corpus: who dances them, how many there are, and which of them lie beside the beat."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harmolab import Motion
from harmolab.data.recordings import find_recordings, load_recording
from harmolab.data.synthetic import write_corpus
from harmolab.systems import FeatureParams, TrainParams
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.choreographer.takes import take_of
from harmolab.systems.harmogan.sketches import Sketched, dance_patterns, sketched
from harmolab.systems.training.groups import sequence_name
from harmolab.systems.training.motion_code import coded
from harmolab.systems.training.requests import DanceRequest
from harmolab.systems.training.splits import SIDES, Split, split_units, training_spans
from harmolab.systems.training.units import load_units
from tests.builders import refused

pytestmark = pytest.mark.slow
PARAMS = replace(TrainParams.recommended(), sketches=2, shifted=0.5)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("dances"), clips=14, seconds=14.0, seed=1)


@pytest.fixture(scope="module")
def split(corpus: Path) -> Split:
    return split_units(load_units([corpus], FeatureParams.recommended(), step=3), seed=1)


@pytest.fixture(scope="module")
def of_songs(corpus: Path, split: Split) -> Sketched:
    return sketched(split, (*find_recordings(corpus).folders, corpus / "without units and unreadable"), PARAMS)


def test_training_units_have_so_many_sketches_and_the_others_one_under_their_name(split: Split, of_songs: Sketched):
    assert len(of_songs.split.train) == 2 * len(split.train)
    assert {unit.name for unit in of_songs.split.test.units} == {unit.name for unit in split.test.units}
    for unit in (*of_songs.split.train.units, *of_songs.split.test.units):
        assert unit.sketch.shape == unit.motion.shape and not np.array_equal(unit.sketch, unit.motion)


def test_nobody_dances_to_a_song_with_its_own_recording(corpus: Path, split: Split, monkeypatch: pytest.MonkeyPatch):
    asked: list[tuple[bytes, set[str]]] = []
    respond = Choreographer.respond

    def noted(self: Choreographer, request: DanceRequest) -> Motion:
        asked.append((request.audio.samples.tobytes(), {take.name.rpartition(" ")[0] for take in self.takes}))
        return respond(self, request)

    monkeypatch.setattr(Choreographer, "respond", noted)
    folders = find_recordings(corpus).folders
    sketched(split, folders, replace(PARAMS, sketches=1))
    songs = {load_recording(folder).clip.audio.samples.tobytes(): folder.name for folder in folders}
    teachers = {Path(name).name for name in training_spans(split)}
    assert len(asked) > len(teachers) > 2
    assert all(takes == teachers - {songs[song]} for song, takes in asked)


def test_sketches_beside_the_music_are_the_same_dance_up_to_half_a_beat_away(corpus: Path, split: Split):
    folders = find_recordings(corpus).folders
    on, beside = (sketched(split, folders, replace(PARAMS, shifted=share)).split.train for share in (0.0, 1.0))
    moved = []
    for first, second in zip(on.units, beside.units, strict=True):
        half = 0.5 * np.median(np.diff(first.beats)) * first.fps + 0.5
        same = [np.array_equal(first.sketch[10:20], second.sketch[10 - n : 20 - n]) for n in range(-8, 9)]
        apart = np.flatnonzero(same) - 8
        assert apart.size and np.abs(apart).min() <= half
        moved.append(apart[0])
    assert min(moved) < 0 < max(moved)


def test_a_single_sketch_of_a_song_may_lie_beside_it_too(corpus: Path, split: Split):
    folders, params = find_recordings(corpus).folders, [replace(PARAMS, sketches=1, shifted=share) for share in (0, 1)]
    on, beside = (sketched(split, folders, each).split for each in params)
    assert len(on.train) == len(split.train)
    assert not all(np.array_equal(a.sketch, b.sketch) for a, b in zip(on.train.units, beside.train.units, strict=True))
    assert all(np.array_equal(a.sketch, b.sketch) for a, b in zip(on.test.units, beside.test.units, strict=True))


def test_the_truth_of_training_is_the_recording_with_feet_that_stand(corpus: Path, of_songs: Sketched):
    unit = of_songs.split.train.units[0]
    clip = load_recording(corpus / unit.sequence.rpartition("/")[2]).clip
    first = round((unit.start - clip.offset) * unit.fps)
    recorded = coded(clip.motion, unit.fps)[first : first + unit.n_frames]
    assert np.abs(unit.motion - recorded)[:, :-3].mean() < 0.03
    assert not np.array_equal(unit.motion, recorded)


def test_a_dance_of_one_recording_and_movement_that_begins_before_its_music_are_sketched(corpus: Path, tmp_path: Path):
    folders = find_recordings(shutil.copytree(corpus, tmp_path / "dances")).folders
    for folder in folders:
        about = json.loads((folder / "beats.json").read_text("utf-8"))
        about["dance"] = "house" if folder == folders[0] else about["dance"]
        (folder / "beats.json").write_text(json.dumps(about | {"motion_offset_s": -1.01}), "utf-8")
    split = split_units(load_units([tmp_path / "dances"], FeatureParams.recommended(), step=3), seed=1)
    parts = sketched(split, folders, replace(PARAMS, sketches=1)).split
    assert "house" in {unit.dance for side in SIDES for unit in getattr(parts, side).units}
    unit = parts.train.units[0]
    recorded = coded(load_recording(tmp_path / unit.sequence).clip.motion, unit.fps)
    first = round((unit.start + 1.01) * unit.fps)
    assert np.abs(unit.motion - recorded[first : first + unit.n_frames])[:, :-3].mean() < 0.03


def test_bars_name_the_pattern_of_the_dance_and_the_place_of_the_first_beat(corpus: Path, of_songs: Sketched):
    for unit in of_songs.split.train.units[:6]:
        track = load_recording(corpus / unit.sequence.rpartition("/")[2]).annotation.track()
        nearest = np.abs(track.times - unit.start - unit.beats[0]).argmin()
        assert unit.bar[1] == track.bar_places[nearest]
        assert of_songs.patterns[unit.bar[0]].dance == unit.dance


def test_one_recording_is_too_few(corpus: Path, split: Split):
    alone = [folder for folder in find_recordings(corpus).folders if sequence_name(folder) in training_spans(split)][:1]
    refused("two with training units are needed at least; add recordings", sketched, split, alone, PARAMS)


def test_folders_of_one_name_below_different_dancers_stay_apart(corpus: Path, of_songs: Sketched, tmp_path: Path):
    for folder in find_recordings(corpus).folders:
        shutil.copytree(folder, tmp_path / folder.name / "take")
    units = load_units([tmp_path], FeatureParams.recommended(), step=3)
    splits = sketched(split_units(units, seed=1), find_recordings(tmp_path).folders, PARAMS).split, of_songs.split
    below, flat = ([unit.sketch.tobytes() for side in SIDES for unit in getattr(one, side).units] for one in splits)
    assert below == flat


def test_dances_without_bars_have_no_pattern(corpus: Path):
    takes = [take_of(load_recording(folder)) for folder in find_recordings(corpus).folders[:2]]
    assert set(dance_patterns(takes)) == {take.dance for take in takes}
    assert dance_patterns([replace(take, places=np.zeros(0, np.int64), meter=0) for take in takes]) == {}
