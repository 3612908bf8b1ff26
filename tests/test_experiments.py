"""What notebooks run on: corpora found on disk or made, the clip under study; tables and words of 00 to 06."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import soundfile

from harmolab import music_and_motion, score_harmony, synthetic_clip, visual_beats
from harmolab.data.recordings import Recording, load_recording, recording_beats
from harmolab.params import BarPattern, HarmonyParams
from harmolab.readers.motion import save_motion
from harmolab.types import Audio, BeatTrack, Motion
from harmolab.verdict.judge import score_clip
from study.cells import notebook_cells
from study.experiments import study
from study.experiments.study import agreement, clip_of_study, corpus_folders, data_root, excerpt, study_recordings
from study.profile import RunProfile
from tests.builders import cases, missing, refused, track

TINY = RunProfile("tiny", n_clips=2, n_sequences=None, n_rotations=40)
RATE = 8000
CELLS = notebook_cells("03_beats_from_joint_speed")
METER = notebook_cells("06_meter_units")
Swing = Callable[..., Motion]


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No recordings, and a cache of the test's own."""
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))


def bars(seconds: float = 8.0) -> Audio:
    """A click every half second; within each bar of four they grow weaker."""
    samples = np.zeros(round(seconds * RATE))
    click = np.sin(np.arange(160) * 0.8) * np.exp(-np.arange(160) / 40)
    for beat in range(1, round(seconds / 0.5)):
        first = round((0.5 * beat) * RATE)
        samples[first : first + 160] = click * (1.0, 0.06, 0.01, 0.001)[(beat - 1) % 4]
    return Audio(samples, RATE)


def write_recording(folder: Path, motion: Motion, *, dance: str = "cha-cha", offset: float = 0.0) -> Path:
    """A sequence in our own layout: clicks in bars of four from 0.5 s on."""
    folder.mkdir(parents=True)
    soundfile.write(folder / "audio.wav", bars().samples, RATE)
    save_motion(folder / "motion.npz", motion)
    beats = (0.5 * np.arange(1, 16)).tolist()
    content = {"beats_s": beats, "downbeats_s": beats[::4], "meter": 4, "dance": dance, "motion_offset_s": offset}
    (folder / "beats.json").write_text(json.dumps(content))
    return folder


@pytest.fixture
def recordings(tmp_path: Path, swinging_arm: Swing, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A corpus of three sequences whose dancer stops on every click (0.25 s into the motion, 0.5 s into the music)."""
    root = tmp_path / "recordings"
    for name, dance in (("A", "rumba"), ("B", "cha-cha"), ("C", "waltz")):
        write_recording(root / name, swinging_arm(1.0, 30.0, seconds=7.0), dance=dance, offset=0.25)
    monkeypatch.setenv("HARMOLAB_DATA", str(root))
    return root


# Corpora


def test_a_setting_that_names_no_folder_is_refused_and_without_one_there_are_no_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert data_root() is None
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path / "nowhere"))
    missing(r"HARMOLAB_DATA names .*nowhere, which is no folder", data_root)


def test_a_folder_of_sequences_is_one_corpus_and_a_folder_of_corpora_is_several(
    recordings: Path, swinging_arm: Swing, monkeypatch: pytest.MonkeyPatch
):
    assert corpus_folders(TINY) == {"recordings": recordings}
    other = recordings.parent / "other"
    write_recording(other / "D", swinging_arm(1.0, 30.0))
    (recordings.parent / "empty").mkdir()
    monkeypatch.setenv("HARMOLAB_DATA", str(recordings.parent))
    write_recording(recordings.parent / "groups" / "first" / "E", swinging_arm(1.0, 30.0))
    groups = {"groups/first": recordings.parent / "groups" / "first"}
    assert corpus_folders(TINY) == {**groups, "other": other, "recordings": recordings}


def test_pictures_come_after_corpora_in_space(recordings: Path, swinging_arm: Swing, monkeypatch: pytest.MonkeyPatch):
    arm = swinging_arm(1.0, 30.0)
    write_recording(recordings.parent / "a" / "E", replace(arm, positions=arm.positions[..., :2]))
    monkeypatch.setenv("HARMOLAB_DATA", str(recordings.parent))
    assert list(corpus_folders(TINY)) == ["recordings", "a"]


def test_one_sequence_is_a_corpus_of_its_own(recordings: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_DATA", str(recordings / "A"))
    assert corpus_folders(TINY) == {"A": recordings / "A"}
    assert [item.clip.dance for item in study_recordings(TINY)] == ["rumba"]


def test_without_recordings_a_synthetic_corpus_is_made_once():
    root = corpus_folders(TINY)["synthetic"]
    stamps = {file: file.stat().st_mtime_ns for file in root.rglob("*.npz")}
    assert len(stamps) == 2
    assert study.synthetic_corpus(TINY) == root
    assert {file: file.stat().st_mtime_ns for file in root.rglob("*.npz")} == stamps
    assert [item.clip.source for item in study_recordings(TINY)] == ["synthetic", "synthetic"]


def test_other_settings_make_another_synthetic_corpus():
    assert study.synthetic_corpus(TINY, seconds=3.0) != study.synthetic_corpus(TINY, seconds=3.0, noise=0.01)


def test_every_readable_sequence_is_read_and_the_rest_passed_over(recordings: Path):
    (recordings / "B" / "motion.npz").write_bytes(b"damaged")
    assert [item.folder.name for item in study.readable_recordings(recordings)] == ["A", "C"]


@pytest.mark.parametrize(("count", "names"), [(None, "ABC"), (1, "A"), (2, "AB"), (5, "ABC")])
def test_a_profile_takes_so_many_sequences(recordings: Path, count: int | None, names: str):
    assert [item.folder.name for item in study_recordings(replace(TINY, n_sequences=count))] == list(names)


def test_an_unknown_corpus_is_refused(recordings: Path):
    refused("there is no corpus 'tango'; there are recordings", next, study_recordings(TINY, "tango"))


# The clip under study


def test_the_clip_of_study_is_of_the_dance_asked_for(recordings: Path):
    assert clip_of_study(TINY, dance="waltz", seconds=4.0, beats="annotated").dance == "waltz"
    assert clip_of_study(TINY, dance="tango", seconds=4.0, beats="annotated").dance == "rumba"  # there is no tango


def test_an_excerpt_is_the_middle_of_a_sequence_on_its_own_time_line(recordings: Path):
    sequence = load_recording(recordings / "A")
    clip = excerpt(sequence, 4.0, "annotated")
    # Motion of 7 s from 0.25 s on: its middle 4 s begin 1.5 s into it, at 1.75 s of the music.
    assert clip.offset == 0.0
    assert (clip.audio.duration, clip.motion.duration) == (4.0, 4.0)
    np.testing.assert_array_equal(clip.motion.positions[0], sequence.clip.motion.positions[45])
    np.testing.assert_allclose(clip.beats.times, np.arange(8) * 0.5 + 0.25)


@pytest.mark.parametrize("offset", [-0.517, -0.49, 0.33])
def test_an_excerpt_longer_than_what_there_is_takes_all_of_it(recordings: Path, swinging_arm: Swing, offset: float):
    write_recording(recordings / "D", swinging_arm(1.0, 30.0, seconds=6.0), offset=offset)
    clip = excerpt(load_recording(recordings / "D"), 100.0, "annotated")
    assert clip.motion.duration == pytest.approx(6.0 + min(offset, 0), abs=1 / 30 + 1e-9)
    # Beat k is still 0.5 k s into the music, wherever the excerpt begins.
    begin = offset + 6.0 - clip.motion.duration if offset < 0 else offset
    phases = (clip.beats.times + begin) / 0.5
    np.testing.assert_allclose(phases, np.round(phases), atol=1e-9)


def test_an_excerpt_of_a_sequence_without_motion_is_refused(recordings: Path):
    sequence = load_recording(recordings / "A")
    still = Recording(replace(sequence.clip, motion=None), sequence.annotation, sequence.folder)
    refused("no motion", excerpt, still, 4.0)


@pytest.mark.slow
def test_without_recordings_the_clip_of_study_is_free_movement_on_a_synthetic_song():
    clip = clip_of_study(TINY, dance="jive", seconds=3.0, beats="annotated")
    assert (clip.dance, clip.motion.duration) == ("jive", 3.0)
    assert clip.source == "synthetic song, CMU motion capture"
    assert 60 / np.median(np.diff(clip.beats.times)) == pytest.approx(164, abs=20)  # jive: 144 to 184


def test_the_example_is_the_clip_of_study_without_recordings_and_can_come_half_a_beat_late():
    clip, studied, late = study.waltz_example(), clip_of_study(TINY), study.waltz_example(late=1 / 3)
    assert (clip.offset, late.offset, clip.audio.duration, clip.motion.duration) == (0.0, 0.0, 12.0, 12.0)
    for one, other in ((clip.motion.positions, studied.motion.positions), (clip.beats.times, studied.beats.times)):
        np.testing.assert_array_equal(one, other)
    # A third of a second is ten frames of thirty in one.
    np.testing.assert_array_equal(late.motion.positions[10:], clip.motion.positions[:-10])
    np.testing.assert_array_equal(late.audio.samples, clip.audio.samples)


def test_the_example_is_on_the_beat_and_not_when_it_comes_half_a_beat_late():
    clip = study.waltz_example()
    late = study.waltz_example(late=float(np.median(np.diff(clip.beats.times))) / 2)
    levels = [score_clip(each, HarmonyParams.recommended()).judgement.level for each in (clip, late)]
    assert levels[0] == 4 > levels[1]


def test_the_pattern_of_study_counts_figures_from_the_exact_start(recordings: Path, monkeypatch: pytest.MonkeyPatch):
    # Motion of 7 s from 0.34 s on: its middle 4 s begin 1.5 s into it, at 1.84 s of the music. The first figure ended
    # at 1.82 s; a start rounded to 1.8 s, as in the excerpt's name, would count it in.
    beats = recordings / "A" / "beats.json"
    beats.write_text(json.dumps(json.loads(beats.read_text()) | {"motion_offset_s": 0.34}))
    (whole,) = study.cut_clips(load_recording(recordings / "A"), "annotated", None)
    before = replace(whole, start=0.34, duration=1.48, figures=frozenset({"before"}))
    parts = [before, replace(whole, start=1.82, duration=5.52, figures=frozenset({"inside"}))]
    judged = []
    monkeypatch.setattr(study, "cut_clips", lambda *_arguments: parts)
    rest = BarPattern.stop_on_the_beat()
    monkeypatch.setattr(study, "learn_patterns", lambda those, _others: [judged.extend(those) or rest])
    study.pattern_of_study(TINY, dance="rumba", seconds=4.0)
    assert [part.figures for part in judged] == [{"inside"}]


def test_without_anything_to_learn_from_there_is_no_pattern(recordings: Path):
    assert study.pattern_of_study(TINY, dance="rumba", seconds=4.0) is None


# Tables


def test_agreement_counts_pairs_and_what_rotations_would_pair():
    result = agreement(track([1.0, 2.0, 3.0], duration=4.0), track([1.05, 2.5], duration=4.0), delay=0.1, n_rotations=4)
    # Turned by 0.5, 1.5, 2.5, 3.5 of 4 s, the visual beats hit 1, 0, 1 and 1 music beats.
    counts = {"music beats": 3, "visual beats": 2, "omitted": 2, "redundant": 1, "hits": 1}
    assert result == {**counts, "chance hits": 0.75}
    words = study.agreement_words(result)
    assert words == "1 of 3 music beats met, chance alone meets 0.8; 1 of 2 visual beats left over"
    assert "1 of 3 music beats met, no more than chance (1.2)" in study.agreement_words(result | {"chance hits": 1.2})


def test_agreement_without_music_is_defined():
    nothing = agreement(BeatTrack([], [], 15.0, 4.0), track([1.0], duration=4.0), delay=0.1, n_rotations=3)
    assert (nothing["hits"], nothing["chance hits"]) == (0, 0.0)


def test_the_table_of_agreement_adds_up_over_the_sequences(recordings: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(study, "recording_beats", lambda sequence, beats: recording_beats(sequence, "annotated"))
    table = CELLS.beat_agreement(TINY, detectors=["turns", "valleys"], delays=[0.12, 0.25])
    assert table["detector"].tolist() == ["turns", "turns", "valleys", "valleys"]
    assert table["tolerance (s)"].tolist() == [0.12, 0.25, 0.12, 0.25]
    valleys = table[table.detector == "valleys"].iloc[0]
    # Three dancers of seven seconds stop on every click.
    counted = valleys[["music beats", "visual beats", "omitted", "redundant", "hit rate"]].tolist()
    assert counted == [42, 42, 0, 0, 1.0]
    assert valleys["chance"] == pytest.approx(0.48, abs=0.15)  # 0.24 s of every half second
    turns = table[table.detector == "turns"].iloc[0]
    assert turns["visual beats"] > 1.8 * valleys["visual beats"]  # peaks as well


def test_words_about_joint_speed_name_the_numbers_of_their_table():
    row = {"detector": "turns", "tolerance (s)": 0.12, "music beats": 4, "visual beats": 9, "omitted": 1}
    row |= {"redundant": 6, "hit rate": 0.75, "chance": 0.5}
    tables = {"table05_omission_redundancy": pd.DataFrame([row])}
    words = (
        "Turns of the joint speed meet 75% of the music's beats within 0.12 s; at random moments they would meet 50%."
    )
    assert CELLS.finding(tables) == words
    assert "±0.12 s: 1 of 4 music beats omitted, 6 of 9 visual beats left over; 75.0% met" in CELLS.reading(tables)


def test_downbeats_that_are_loudest_are_the_strong_ones(recordings: Path):
    table = METER.strong_by_place(TINY)
    annotated = table[table.beats == "annotated"].set_index("place")
    assert annotated.index.tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(annotated["strong"], [1, 0, 0, 0])
    # Fifteen beats in each of three songs; the first has none before it, so three downbeats are left of four.
    assert annotated["n"].tolist() == [9, 12, 12, 9]
    np.testing.assert_allclose(annotated["chance"], 9 / 42)


def test_without_downbeats_the_table_is_empty(recordings: Path):
    for file in recordings.rglob("beats.json"):
        file.write_text(json.dumps(json.loads(file.read_text()) | {"downbeats_s": None}))
    assert METER.strong_by_place(TINY).empty


def test_words_about_meter_name_the_numbers_of_their_table_and_nothing_without_downbeats(recordings: Path):
    table = METER.strong_by_place(TINY)
    words = METER.reading({"table06_strong_by_place": table})
    downbeats = "Of the first beats of bars it calls strong 100% in bars of 4 beats (21% of all beats there)."
    assert f"Eq. 22 calls 21% of all beats strong. {downbeats}" in words
    assert "Bars of 4, annotated beats: downbeats are strong more often than other beats, 100% of them" in words
    assert METER.finding({"table06_strong_by_place": table[:0]}) == "No recording has annotated downbeats."


def test_words_about_harmony_distortion_name_the_numbers_of_their_table():
    counts = {"music beats": 18, "visual beats": 53, "omitted": 4, "redundant": 39, "hits": 14, "chance hits": 15.46}
    wide = counts | {"omitted": 0, "redundant": 35, "hits": 18, "chance hits": 17.96, "tolerance (s)": 0.24}
    table = pd.DataFrame([{"dance": "waltz", "seconds": 12.0, "tolerance (s)": 0.12} | counts, wide])
    words = notebook_cells("01_harmony_distortion").reading({"table01_agreement": table})
    met = "meet 14 of 18 music beats within 0.12 s (78%; at random moments 86%). Of the 53 changes of direction 39 are"
    assert f"{met} left over." in words
    assert words.endswith("The wide field gives changes of direction 4 hits more, and random moments 2.5.")


def test_words_about_the_box_add_up_its_walks():
    walks = {"without box": [8, 8], "found again": [6, 2], "lost": [2, 6], "new": [5, 6], "found by chance": [3.0, 3.4]}
    words = notebook_cells("02_flow_or_skeleton").reading({"table02_box": pd.DataFrame(walks)})
    assert "optical flow finds 50% of its beats again; by chance it would find 40%." in words
    assert words.endswith("In 2 walks 8 of 16 beats are lost, and 11 are new.")


@cases(
    "late, levels, words",
    (0.6, (4, 3), "Our score does. By the paper's own settings the late dance scores higher than the dance in time."),
    (0.497, (4, 3), "the late dance scores about as high as the dance in time."),
    (0.4, (4, 4), "score does not. By the paper's own settings the late dance scores lower than the dance in time."),
)
def test_the_first_finding_says_which_number_falls(late: float, levels: tuple[int, int], words: str):
    dances = ["in time", "half a beat late"]
    rows = [("paper", dance, harmony, np.nan) for dance, harmony in zip(dances, (0.5, late), strict=True)]
    rows += [("recommended", dance, np.nan, level) for dance, level in zip(dances, levels, strict=True)]
    table = pd.DataFrame(rows, columns=["settings", "dance", "harmony", "level"])
    assert notebook_cells("00_start_here").finding({"table00_first_score": table}).endswith(words)


# Equations and words of notebook 04

PAPER = HarmonyParams.paper()
SCORING = notebook_cells("04_salience_and_scoring", paper=PAPER)


@cases("dance, fps", ("waltz", 30.0), ("jive", 25.0), ("rumba", 60.0), ("samba", 120.0))
def test_equations_in_the_cells_give_the_package_s_score(dance: str, fps: float):
    beats, motion = music_and_motion(synthetic_clip(dance, seconds=20.0, fps=fps, seed=4))
    score = score_harmony(beats, visual_beats(motion, params=PAPER), params=PAPER, n_rotations=0)
    times, strengths = SCORING.noticed_music(beats.times, beats.strengths)
    moments = SCORING.noticed_movement(*SCORING.turns(SCORING.at_rate(motion.positions, motion.fps), PAPER.fps))
    harmony, hits = SCORING.harmony(times, strengths, moments, PAPER.reaction_delay, PAPER.beta)
    assert len(moments) == score.n_visual > 10
    assert harmony == pytest.approx(score.harmony, rel=1e-12)
    assert np.array_equal(hits, score.hits)


def test_words_about_tolerance_name_the_numbers_of_their_table():
    rows = [("turns", 0.1, 0.5, 0.4), ("turns", 0.25, 0.9, 0.88)]
    rows += [("valleys", 0.1, 0.6, 0.3), ("valleys", 0.25, 0.7, 0.6)]
    table = pd.DataFrame(rows, columns=["beats", "delay", "hit_rate", "chance"]).assign(delay_of_paper=0.25)
    tables = {"eq18_tolerance_and_chance": table}
    hits = "turns of the joint speed hit 90% of the beats; at random moments they would hit 88%."
    assert SCORING.finding(tables) == f"Within the 0.25 s that the paper allows, {hits}"
    words = SCORING.reading(tables)
    best = "stand furthest above chance at 0.1 s, by"
    assert f"Turns of the joint speed (paper) {best} 10%: they hit 50%, chance 40%." in words
    assert f"Valleys of the joint speed {best} 30%: they hit 60%, chance 30%." in words
