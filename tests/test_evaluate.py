"""`harmolab evaluate`: planted dancers land where they must, and what is luck is not called a difference."""

import json
import os
import re
import shutil
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import soundfile
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import Skeleton
from harmolab.cli import app, evaluating
from harmolab.data.synthetic import write_corpus
from harmolab.files import silent
from harmolab.lab.evaluate import page as evaluation_page
from harmolab.lab.evaluate import pairing, summary
from harmolab.lab.evaluate.as_text import full_methods, methods_paragraph, number_text, table_csv, table_notes
from harmolab.lab.evaluate.engine import run_rows
from harmolab.lab.evaluate.evaluation import Evaluation, EvaluationSettings, check_table_folder, evaluate_dances
from harmolab.lab.evaluate.findings import findings
from harmolab.lab.evaluate.latex import table_tex
from harmolab.lab.evaluate.measured import MEASURES, beat_numbers
from harmolab.lab.evaluate.page import write_evaluation
from harmolab.lab.evaluate.pairing import FROZEN, OTHER_SONG, RECORDED, Pair, Song, folder_pairs, song_of, songs_in
from harmolab.lab.evaluate.parts import part_rows, write_part
from harmolab.lab.evaluate.rows import RowOptions, clip_row, control_pairs, pair_clip, protocol_numbers, recorded_limits
from harmolab.lab.evaluate.sets import SetNumber, collect, protocol_sets, set_numbers, written_parts
from harmolab.lab.player_data import of_dance, player_of
from harmolab.metrics.features import diversity, frechet_distance
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import HarmonyParams
from harmolab.readers.motion import load_motion, save_motion
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import score_clip
from tests.builders import called, cases, done, refused
from tests.test_labs_browser import at_address, closed

run = partial(called, app)
CLIPS, SECONDS = 7, 12.0
WILD = "<b>50%_$x</b>"  # a name that HTML, LaTeX and matplotlib could read as commands


def dances(corpus: Path, folder: Path) -> Path:
    """A folder with the motions of a corpus as files, named after its songs."""
    folder.mkdir(parents=True)
    for clip in sorted(corpus.glob("clip_*")):
        save_motion(folder / f"{clip.name}.npz", load_motion(clip / "motion.npz"))
    return folder


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven songs with their dancer ("recorded"), the same dancer twice with noise ("on"), and one off the beat."""
    root = tmp_path_factory.mktemp("planted")
    common: dict[str, Any] = {"clips": CLIPS, "seconds": SECONDS, "fps": 30.0, "seed": 4}
    write_corpus(root / "recorded", **common)
    for seed, noise in (("seed1", 0.001), ("seed2", 0.002)):
        dances(write_corpus(root / "corpora" / seed, noise=noise, **common), root / "on" / seed)
    dances(write_corpus(root / "corpora" / "off", jitter=0.25, **common), root / "off")
    return root


def settings(planted: Path, **others: Any) -> EvaluationSettings:
    systems = {"on the beat": planted / "on", WILD: planted / "off"}
    recorded = planted / "recorded"
    more: dict[str, Any] = {"systems": systems, "music": recorded, "reference": recorded, "resamples": 1000}
    return EvaluationSettings(**(more | others))


@pytest.fixture(scope="module")
def few(planted: Path) -> Path:
    """Two of the songs with their recorded dancer and the one off the beat, where no mean is looked at."""
    for song in sorted((planted / "recorded").glob("clip_*"))[:2]:
        shutil.copytree(song, planted / "few" / "recorded" / song.name)
        (planted / "few" / "off").mkdir(exist_ok=True)
        shutil.copy(planted / "off" / f"{song.name}.npz", planted / "few" / "off")
    return planted / "few"


@pytest.fixture(scope="module")
def table(planted: Path) -> Evaluation:
    evaluation = evaluate_dances(settings(planted), planted / "table")
    write_evaluation(planted / "table", evaluation)
    return evaluation


# Planted answers


@pytest.mark.slow
def test_a_missing_package_is_named_before_any_work(planted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harmolab.lab.evaluate.engine.find_spec", lambda name: None)
    message = r'need dask; install it by: pip install "dask\[distributed\]"'
    refused(message, evaluate_dances, settings(planted), planted / "nothing", jobs=2)
    assert not (planted / "nothing").exists()


@pytest.mark.slow
def test_a_dancer_on_the_beat_beats_one_off_the_beat(table: Evaluation) -> None:
    for measure in ("harmony", "beat_align_motion", "beat_align_music", "mir_eval_f"):
        assert table.ranks[measure] == {"on the beat": 1, WILD: 2}
    assert table.means["on the beat", "harmony"].mean > 0.5


@pytest.mark.slow
def test_a_held_pose_lands_at_zero(table: Evaluation) -> None:
    for measure in ("harmony", "significant", "paper_harmony", "beat_align_motion", "mir_eval_f", "likeness"):
        assert table.means[FROZEN, measure].mean == 0
    assert table.means[FROZEN, "jerk"].mean == pytest.approx(0, abs=1e-9) and table.means[FROZEN, "freezing"].mean == 1
    assert table.sets[FROZEN, "fid_kinetic"].value > table.sets["on the beat", "fid_kinetic"].value


@pytest.mark.slow
def test_another_song_is_at_chance_and_the_own_one_is_not(table: Evaluation) -> None:
    other, own = table.means[OTHER_SONG, "harmony"], table.means[RECORDED, "harmony"]
    assert other.low < 0.05 and other.high < 0.2
    assert own.low > 0.5
    assert next(one for one in table.differences if {one.a, one.b} == {RECORDED, OTHER_SONG}).songs == CLIPS


def test_paths_given_as_text_are_the_same_settings(planted: Path) -> None:
    paths = settings(planted, pairs=planted / "pairs.csv", smpl=planted / "body.npz")
    systems = {name: str(folder) for name, folder in paths.systems.items()}
    texts = {name: str(getattr(paths, name)) for name in ("music", "reference", "pairs", "smpl")}
    assert settings(planted, systems=systems, **texts) == paths


def test_controls_have_no_rank(table: Evaluation) -> None:
    assert {name for ranked in table.ranks.values() for name in ranked} <= set(table.systems)
    assert table.controls == (RECORDED, OTHER_SONG, FROZEN)


def test_subfolders_are_seeds(table: Evaluation) -> None:
    assert table.counts["on the beat"] == (2 * CLIPS, CLIPS, 2, 2 * CLIPS)
    assert table.counts[WILD] == (CLIPS, CLIPS, 1, CLIPS)
    assert table.sets["on the beat", "multimodality_kinetic"].value > 0
    assert (WILD, "multimodality_kinetic") not in table.sets


@pytest.mark.parametrize("own", ["beats.json that says nothing of it", "npz alone"])
def test_a_dance_is_scored_from_where_its_npz_begins_in_the_song(tmp_path: Path, own: str) -> None:
    song = next(write_corpus(tmp_path / "songs", clips=1, seconds=22.0, fps=30.0, seed=4).glob("clip_*"))
    notes = json.loads((song / "beats.json").read_text())
    del notes["motion_offset_s"]
    (folder := tmp_path / song.name).mkdir()
    shutil.copy(song / "audio.wav", folder)
    if own != "npz alone":
        (folder / "beats.json").write_text(json.dumps(notes))
    save_motion(folder / "motion.npz", load_motion(song / "motion.npz").span(10.0, 12.0), offset=10.0)
    row = clip_row(Pair("x", "", song.name, folder, song / "audio.wav"), RowOptions())
    arguments = ("score", folder / "audio.wav", folder / "motion.npz", "--beats", song / "beats.json", "--json")
    scored = json.loads(run(*arguments).stdout)
    assert scored["clip"]["offset"] == 10.0
    assert row["harmony"] == pytest.approx(scored["recommended"]["harmony_above_chance"], abs=1e-9)
    assert row["seconds"] == pytest.approx(12.0)
    whole = clip_row(Pair("x", "", song.name, song, song / "audio.wav"), RowOptions())
    assert row["harmony"] == pytest.approx(whole["harmony"], abs=0.1)  # the same dancer, from 10 s on


def test_no_other_song_is_the_own_one() -> None:
    recorded = [Pair(RECORDED, "", song, Path(song), Path(song), RECORDED) for song in "abcde"]
    others = [pair for pair in control_pairs(recorded) if pair.kind == OTHER_SONG]
    assert len(others) == 5
    assert all(pair.motion != pair.music for pair in others)
    assert [pair.kind for pair in control_pairs(recorded[:1])] == [RECORDED, FROZEN]


# Pairs


def song_among(motion: str, music: tuple[str, ...]) -> Song | str:
    return song_of(Path(motion), [Song(Path(name).stem, Path(name)) for name in music])


@cases(
    "motion, music, match",
    ("tune.npz", ("tune.wav", "tune_2.wav"), "tune.wav"),
    ("Tune.npz", ("tune.wav",), "tune.wav"),
    ("run3_tune_take1.npz", ("tune.wav", "run.wav"), "tune.wav"),
    ("my tune 2-a.bvh", ("tune 2.wav", "tune.wav"), "tune 2.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01.pkl", ("mBR0.wav", "mBR1.wav"), "mBR0.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01.pkl", ("gLO_sBM_cAll_d13_mBR0_ch02.wav", "x_mLO1_y.wav"), "gLO_sBM"),
    # As published codes write them.
    ("test_mBR0.pkl", ("mBR0.wav", "mBR1.wav"), "mBR0.wav"),
    ("2000_3_gBR_sBM_cAll_d04_mBR0_ch01_slice7.pkl", ("mBR0.wav", "mBR1.wav"), "mBR0.wav"),
    ("2000_3_gBR_sBM_cAll_d04_mBR0_ch01_slice7.pkl", ("gBR_sBM_cAll_d04_mBR0_ch01_slice7.wav", "mBR0.wav"), "gBR_sBM"),
    ("test_3_063z@005.pkl", ("063.wav", "005.wav", "003.wav"), "063.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01_mJB4.npy", ("mBR0.wav", "mJB4.wav"), "mJB4.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01_mJB4.npy", ("mBR0.wav", "mJB4_full.wav"), "mJB4_full.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01_mJB4.npy", ("mBR0.wav", "mjb4.wav"), "mjb4.wav"),
    ("gBR_sBM_cAll_d04_mBR0_ch01.json.npy", ("mBR0.wav", "mJB4.wav"), "mBR0.wav"),
)
def test_a_dance_goes_with_the_song_that_its_name_asks_for(motion: str, music: tuple[str, ...], match: str) -> None:
    song = song_among(motion, music)
    assert isinstance(song, Song) and song.path.name.startswith(match)


@cases(
    "motion, music, reason",
    ("fortune.npz", ("tune.wav",), "no song has its name"),
    ("tune.npz", ("tune.wav", "tune.mp3"), "2 songs: tune.mp3, tune.wav"),
    ("a_b.npz", ("a.wav", "b.wav"), "2 songs"),
    ("gBR_sBM_cAll_d04_mBR0_ch01_mJB4.npy", ("mBR0.wav", "mLH1.wav"), "no song has its name"),  # not that of its seed
    ("test_3_063z@005.pkl", ("005.wav",), "no song has its name"),  # not that of its piece's number
)
def test_a_dance_without_a_song_has_the_reason(motion: str, music: tuple[str, ...], reason: str) -> None:
    answer = song_among(motion, music)
    assert isinstance(answer, str) and reason in answer


def test_what_does_not_pair_is_listed(tmp_path: Path, planted: Path) -> None:
    folder = dances(planted / "corpora" / "off", tmp_path / "x")
    (folder / "clip_0001_cha-cha.npz").rename(folder / "stranger.npz")
    (folder / "notes.txt").write_text("mine")
    (folder / "corpus.json").write_text('{"source": "synthetic"}')
    first = next(folder.glob("clip_0002*"))
    (folder / f"{first.stem}_info.json").write_text('{"epochs": 100}')
    for number, fault in enumerate(('{"frames": [', '{"frames": [{}]}', '[{"x": 1}]')):  # dances that are missed
        (folder / f"{first.stem}_{number}.json").write_text(fault)
    found = folder_pairs("x", folder, songs_in(planted / "recorded"))
    assert len(found.pairs) == CLIPS + 2
    assert {(one.file.name, one.reason) for one in found.unpaired} == {
        ("stranger.npz", "no song has its name, or a word of its name"),
        ("notes.txt", "is no motion file"),
        (f"{first.stem}_info.json", "is no motion file"),
    }


def test_a_folder_in_which_nothing_pairs_is_an_error(tmp_path: Path, planted: Path) -> None:
    (tmp_path / "stranger.npz").touch()
    message = r"stranger\.npz: no song has its name.*--pairs"
    refused(message, folder_pairs, "x", tmp_path, songs_in(planted / "recorded"))


def listed(tmp_path: Path, planted: Path, *lines: str, header: str = "motion,music,system,seed") -> Any:
    table = tmp_path / "pairs.csv"
    table.write_text("\n".join([header, *lines]) + "\n")
    return pairing.listed_pairs(table, planted / "recorded", {"x": planted / "off"})


def test_songs_that_are_all_called_audio_have_the_names_of_their_folders(tmp_path: Path, planted: Path) -> None:
    for name in ("mBR0", "mBR1"):
        (tmp_path / "songs" / name).mkdir(parents=True)
        (tmp_path / "songs" / name / "audio.wav").touch()
    table = tmp_path / "pairs.csv"
    table.write_text("motion,music\nclip_0001_cha-cha.npz,mBR0/audio.wav\nclip_0002_jive.npz,mBR1/audio.wav\n")
    pairs = pairing.listed_pairs(table, tmp_path / "songs", {pairing.GENERATED: planted / "off"}).pairs
    assert [pair.song for pair in pairs] == [song.name for song in songs_in(tmp_path / "songs")] == ["mBR0", "mBR1"]


def test_songs_of_one_name_in_a_list_are_not_averaged_as_one(tmp_path: Path, planted: Path) -> None:
    songs = [tmp_path / "album" / disc / folder / "track.wav" for disc, folder in ("1a", "1b", "2b")]
    for song in songs:
        song.parent.mkdir(parents=True)
        song.write_text(str(song))
    (tmp_path / "a.npz").touch()
    copied = shutil.copy(songs[0], tmp_path / "track.wav")  # another name of a song, as one copy for each system has
    lines = [f"a.npz,{song},{seed}" for seed, song in enumerate((*songs, songs[0], copied))]
    (tmp_path / "pairs.csv").write_text("\n".join(["motion,music,seed", *lines]))
    names = [pair.song for pair in pairing.listed_pairs(tmp_path / "pairs.csv", None, {}).pairs]
    assert names == ["track", "track (b)", f"track ({songs[2]})", "track", "track"]


def test_a_list_pairs_what_names_do_not(tmp_path: Path, planted: Path) -> None:
    line = "clip_0001_cha-cha.npz,clip_0002_jive/audio.wav,x,3"
    found = listed(tmp_path, planted, line, "nowhere.npz,clip_0002_jive/audio.wav,x,3")
    (pair,) = found.pairs
    assert (pair.system, pair.seed) == ("x", "3")
    assert (pair.song, pair.motion.name) == ("clip_0002_jive", "clip_0001_cha-cha.npz")
    reasons = {one.file.name: one.reason for one in found.unpaired}
    assert reasons["nowhere.npz"] == "nowhere.npz: no such file"
    assert reasons["clip_0002_jive.npz"] == "is not in pairs.csv"


def test_a_list_may_have_quotation_marks_and_leave_the_system_out(tmp_path: Path, planted: Path) -> None:
    song, dance = "clip_0002_jive/audio.wav", planted / "off" / "clip_0001_cha-cha.npz"
    lines = f'"{dance}", "{song}","one, two",3', f"{dance},{song},,3"
    assert [pair.system for pair in listed(tmp_path, planted, *lines).pairs] == ["one, two", "generated"]


@cases(
    "header, lines, fault",
    ("motion,song", ["a,b"], "no column music"),
    ("motion,music", [f"{'a' * 140_000},b"], "no row of a table"),
    ("motion,music", ["nowhere.npz,nowhere.wav"], "names no pair that is there"),
    ("motion,music,system", ["clip_0001_cha-cha.npz,clip_0002_jive/audio.wav,x"] * 2, "twice"),
    (
        "motion,music,system", ["clip_0001_cha-cha.npz,clip_0002_jive/audio.wav,x", "nowhere.npz,b.wav,y"],
        "no pair of 'y' that is there .nowhere.npz: no such file",
    ),
)  # fmt: skip
def test_a_wrong_list_is_an_error(tmp_path: Path, planted: Path, header: str, lines: list[str], fault: str) -> None:
    refused(f"pairs.csv.*{fault}", listed, tmp_path, planted, *lines, header=header)


# Statistics


def test_the_interval_of_two_and_of_ten_songs_by_hand() -> None:
    # Resamplings of 0 and 1 have the means 0, 1/2 and 1 in shares of 1/4, 1/2 and 1/4.
    assert summary.song_interval(np.array([0.0, 1.0])) == (0.0, 1.0)
    assert np.isnan(summary.song_interval(np.array([1.0]))).all()
    # Five zeros and five ones: ten times the mean is binomial. Student's t of 9 degrees is 2.262, times the root of
    # 10/9 it is 2.384, beyond which the normal distribution has 0.0086 on either side. P(X <= 0) = 0.001 is less,
    # P(X <= 1) = 0.011 is more: the interval is 0.1 to 0.9, where the plain one of 0.025 is 0.2 to 0.8.
    assert summary.song_interval(np.repeat([0.0, 1.0], 5), count=20_000) == (0.1, 0.9)


def rows_of(values: Mapping[tuple[str, str, str], float], measure: str = "harmony") -> pd.DataFrame:
    """Rows of dances, as `clip_row` gives them, of (system, song, seed) -> value."""
    rows = [(f"{place}", *place, value) for place, value in values.items()]
    table = pd.DataFrame(rows, columns=["key", "system", "song", "seed", measure])
    about: dict[str, Any] = {"error": "", "kind": "generated", "skeleton": "s", "fps": 30.0, "joints": 1}
    return table.assign(**about, beats="tracked", dance="")


def of_songs(**systems: Iterable[float]) -> dict[tuple[str, str, str], float]:
    """(system, song, seed) -> value: of each system one dance to each song."""
    return {(system, f"{song}", ""): value for system, values in systems.items() for song, value in enumerate(values)}


def test_seeds_are_averaged_within_a_song() -> None:
    rows = rows_of({("x", "a", "1"): 0.0, ("x", "a", "2"): 2.0, ("x", "b", "1"): 4.0})
    mean = summary.system_means(collect([rows]).song_means)["x", "harmony"]
    assert (mean.mean, mean.songs) == (2.5, 2)  # songs have 1 and 4; the mean over dances is 2


def test_songs_of_one_system_are_in_no_difference_and_what_was_not_measured_in_no_mean() -> None:
    songs = collect([rows_of(of_songs(x=[1.0, np.nan, 9.0, 5.0], y=[0.0, 1.0, 8.0]))]).song_means
    mean = summary.system_means(songs)["x", "harmony"]
    assert (mean.mean, mean.songs) == (5, 3)
    assert summary.system_differences(songs, ["x", "y"]) == [("harmony", "x", "y", 1, 1, 1, 2)]


def test_parts_of_any_size_give_the_same_sums(rng: np.random.Generator) -> None:
    values = {(system, f"{song}", f"{seed}"): rng.normal() for system in "xy" for song in range(5) for seed in range(2)}
    rows = rows_of(values).assign(f_kinetic_000=rng.normal(size=20))
    whole, parts = collect([rows]), collect([rows[place : place + 1] for place in range(20)])
    pd.testing.assert_frame_equal(whole.song_means, parts.song_means)
    pd.testing.assert_frame_equal(whole.features["x"], parts.features["x"])
    assert whole.extremes == parts.extremes
    assert whole.extremes["x"][1][0] == max(value for (system, *_), value in values.items() if system == "x")


def test_more_songs_than_are_kept_become_groups(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    songs = rng.normal(size=600)
    rows = rows_of(of_songs(x=songs, y=songs + 1))
    single = summary.system_means(collect([rows]).song_means)["x", "harmony"]
    monkeypatch.setattr("harmolab.lab.evaluate.sets.MOST_SONGS", 200)
    whole, parts = (collect(rows[place : place + size] for place in range(0, 1200, size)) for size in (1200, 100))
    pd.testing.assert_frame_equal(whole.song_means, parts.song_means)
    assert len(whole.song_means.loc["x"]) <= 200 and whole.is_grouped and whole.counts.loc["x"]["harmony"].sum() == 600
    grouped = summary.system_means(whole.song_means)["x", "harmony"]
    assert grouped.mean == pytest.approx(single.mean, abs=0.05)
    assert grouped.high - grouped.low == pytest.approx(single.high - single.low, rel=0.2)
    (difference,) = summary.system_differences(whole.song_means, ["x", "y"])
    assert (difference.low, difference.high) == pytest.approx((-1, -1))  # the groups are paired as the songs are


def differences_of(rows: pd.DataFrame) -> list[summary.Difference]:
    means, interval = collect([rows]).song_means, partial(summary.song_interval, count=500)
    return summary.system_differences(means, list(rows["system"].unique()), interval=interval)


def ranks_of(*, better: int = 1, **systems: Iterable[float]) -> dict[str, int]:
    return summary.ranks(differences_of(rows_of(of_songs(**systems))), [*systems], "harmony", better=better)


def test_a_clear_difference_is_a_rank(rng: np.random.Generator) -> None:
    songs = rng.normal(size=8)  # that songs differ is no matter: differences are paired
    assert ranks_of(x=songs + 0.5, y=songs + rng.normal(0, 0.1, 8)) == {"x": 1, "y": 2}
    assert ranks_of(x=songs + 0.5, y=songs + rng.normal(0, 0.1, 8), better=-1) == {"x": 2, "y": 1}
    assert ranks_of(x=songs + 0.5, y=songs, better=0) == {}


@pytest.mark.slow
def test_systems_of_one_distribution_get_no_rank_but_by_luck(rng: np.random.Generator) -> None:
    trials = pd.DataFrame({f"trial {number}": rng.normal(size=16) for number in range(200)})  # a measure each
    differences = differences_of(pd.concat([rows_of(of_songs(x=np.zeros(8), y=np.zeros(8))), trials], axis=1))
    ranked = [bool(summary.ranks(differences, ["x", "y"], name, better=1)) for name in trials]
    assert np.mean(ranked) < 0.09  # 0.05 is expected; 200 trials have a standard error of 0.015


def test_five_songs_give_no_rank() -> None:
    assert ranks_of(x=np.ones(5), y=np.zeros(5)) == {}
    assert ranks_of(x=np.ones(6), y=np.zeros(6)) == {"x": 1, "y": 2}


def test_a_third_system_that_is_like_both_has_no_rank() -> None:
    songs = np.arange(6)
    assert ranks_of(x=1.0 + 0.01 * songs, y=0.01 * songs, z=0.5 + (-1.0) ** songs) == {"x": 1, "y": 2}


def feature_rows(
    system: str, values: np.ndarray, songs: list[str], seeds: Any = "", names: tuple[str, ...] = ("kinetic",)
) -> pd.DataFrame:
    columns = {f"f_{name}_{place:03d}": column for name in names for place, column in enumerate(values.T)}
    return pd.DataFrame({"key": system, "song": songs, "seed": seeds, "skeleton": "s", **columns})


published_rows = partial(feature_rows, names=("aist++ kinetic", "aist++ geometric"))


def test_distances_lose_the_bias_of_small_samples(rng: np.random.Generator) -> None:
    names = [f"{song}" for song in range(60)]
    both = {name: feature_rows(name, rng.normal(size=(60, 8)), names) for name in ("x", RECORDED)}
    number = set_numbers(both)["x", "fid_kinetic"]
    assert (number.n, number.n_recorded) == (60, 60)
    assert abs(number.value) < number.raw / 2  # 0 is the truth


def test_a_system_of_more_joints_takes_no_distance_from_the_others(rng: np.random.Generator) -> None:
    songs = [f"{song}" for song in range(12)]
    alike = [feature_rows(name, rng.normal(size=(12, 8)), songs) for name in (RECORDED, "x")]
    more = feature_rows("y", rng.normal(size=(12, 11)), songs).assign(skeleton="other")
    apart = set_numbers({RECORDED: alike[0], "x": alike[1]})
    together = pd.concat([*alike, more])  # as the parts of a table have them: NaN where a body has no such joint
    assert set_numbers({str(name): rows for name, rows in together.groupby("key")}) == apart


def test_what_is_left_of_the_bias_and_distances_below_0_is_said(table: Evaluation, rng: np.random.Generator) -> None:
    few, most = (rng.normal(size=(2, n, 72)) for n in (20, 200))  # one distribution: 0 is the truth
    left, none = (frechet_distance(*sides) for sides in (few, most))
    assert 10 < left.value < left.raw / 2 and abs(none.value) < 1
    assert any("some stays below twice as many dances as features" in note for note in table_notes(table))
    numbers = {("on the beat", "fid_kinetic"): SetNumber(-0.5, 300, 8.0, 300)}
    assert any("below 0 is chance" in note for note in table_notes(replace(table, sets=numbers)))
    numbers = {("on the beat", "fid_kinetic"): SetNumber(0.5, 300, 8.0, 300)}
    assert not any("below 0" in note for note in table_notes(replace(table, sets=numbers)))


def test_diversity_is_over_songs_and_multimodality_over_seeds() -> None:
    recorded = feature_rows(RECORDED, np.array([[-1.0], [1.0]]), ["a", "b"])  # mean 0, spread 1
    danced = feature_rows("x", np.array([[0.0], [4.0], [1.0], [2.0]]), ["a", "b", "a", "b"], ["1", "1", "2", "2"])
    numbers = set_numbers({RECORDED: recorded, "x": danced})
    assert numbers["x", "diversity_kinetic"].value == 2.5  # |0 - 4| and |1 - 2|
    assert numbers["x", "multimodality_kinetic"].value == 1.5  # |0 - 1| and |4 - 2|


@cases("folders", ["", "", "", ""], ["waltz", "waltz", "tango", "tango"], ["anna", "bert", "carl", "dora"])
def test_diversity_is_over_all_dances_where_folders_are_no_draws(folders: list[str]) -> None:
    songs = ["a", "b", "c", "d"]
    recorded = feature_rows(RECORDED, np.array([[-1.0], [-1.0], [1.0], [1.0]]), songs, folders)  # mean 0, spread 1
    number = set_numbers({RECORDED: recorded})[RECORDED, "diversity_kinetic"]
    assert (number.value, number.n) == (pytest.approx(4 / 3), 4)  # four of six pairs are 2 apart


# Files


def test_all_files_are_there_and_agree(planted: Path, table: Evaluation) -> None:
    out = planted / "table"
    content = json.loads((out / "table.json").read_text("utf-8"))
    frame = pd.read_csv(out / "table.csv").set_index("system")
    assert list(frame.index) == [row["system"] for row in content["rows"]] == list(table.rows)
    assert frame.loc["on the beat", "harmony"] == pytest.approx(table.means["on the beat", "harmony"].mean)
    assert frame.loc[WILD, "harmony_rank"] == 2 and RECORDED not in frame.index[frame["harmony_rank"].notna()]
    clips = pd.read_csv(out / "clips.csv", keep_default_na=False, na_values={"harmony": ""})
    assert len(clips) == (2 + 1 + 3) * CLIPS
    assert set(MEASURES) <= set(clips.columns)
    assert not [name for name in clips.columns if name.startswith("f_")]
    by_song = clips[clips["system"] == "on the beat"].groupby("song")["harmony"].mean()
    assert by_song.mean() == pytest.approx(frame.loc["on the beat", "harmony"])


def test_the_methods_name_what_was_done(planted: Path, table: Evaluation) -> None:
    content = json.loads((planted / "table" / "table.json").read_text("utf-8"))
    for words in ("14 dances to 7 songs, 2 seeds, 30 frames per second", "annotated for 28", "1000 resamplings"):
        assert words in content["methods_in_full"]
    assert any("pose" in note for note in content["notes"])  # the planted body is not that of the network


def test_page_begins_with_findings_and_table_and_marks_what_a_remark_concerns(planted: Path, table: Evaluation) -> None:
    page = (planted / "table" / "index.html").read_text("utf-8")
    assert page.index('class="finding"') < page.index('<table role="table">') < page.index('id="note-1"')
    notes = list(table_notes(table))
    (limits,) = (note for note in notes if note.startswith("The limits of likeness are the recorded"))
    assert limits.about == ("likeness",)
    line = page.split("share that moves like the recorded dancers")[1].split("</th>")[0]
    assert f'href="#note-{notes.index(limits) + 1}"' in line
    assert [one.split(" goes ")[0].split(" cannot ")[0] for one in findings(table)] == list(table.systems)


# What the first sentence claims


def with_difference(table: Evaluation, a: str, b: str, *numbers: float, songs: int = CLIPS) -> Evaluation:
    """The table with another difference a - b in harmony: mean, low, high."""
    others = [one for one in table.differences if (one.measure, {one.a, one.b}) != ("harmony", {a, b})]
    return replace(table, differences=[*others, summary.Difference("harmony", a, b, *numbers, songs)])


@cases(
    "a, numbers, songs, start",
    (RECORDED, (0.02, -0.03, 0.07), 20, "Harmony says nothing on these data: the recorded dances are not clearly more"),
    (RECORDED, (0.5, 0.3, 0.7), 3, "3 songs are too few to say how the dances go with their music"),
    (
        WILD,
        (-0.44, -0.9, 0.02),
        7,
        f"{WILD} may go with its music as the recorded dances do, or not: 7 songs are too few",
    ),
    (WILD, (-0.44, -0.7, -0.2), 3, f"{WILD} cannot be compared with the recorded dances: 3 common songs are too few"),
    (WILD, (-0.4, -0.4, -0.4), 1, f"{WILD} cannot be compared with the recorded dances: 1 common song is too few"),
    (WILD, (0.0, 0.0, 0.0), 0, f"{WILD} cannot be compared with the recorded dances: these are to other songs"),
    (WILD, (-0.01, -0.05, 0.02), 20, f"{WILD} cannot be told from the recorded dances by its harmony"),
    (WILD, (-0.10, -0.15, -0.05), 20, f"{WILD} goes with its music less than the recorded dances"),
    (WILD, (0.10, 0.05, 0.15), 20, f"{WILD} goes with its music more than the recorded dances"),
)
def test_a_finding_is_only_what_the_controls_and_the_number_of_songs_allow(
    table: Evaluation, a: str, numbers: tuple[float, ...], songs: int, start: str
) -> None:
    b = OTHER_SONG if a == RECORDED else RECORDED
    changed = with_difference(replace(table, systems=(WILD,)), a, b, *numbers, songs=songs)
    assert next(findings(changed)).startswith(start)
    turned = with_difference(changed, b, a, *(-number for number in (numbers[0], numbers[2], numbers[1])), songs=songs)
    assert list(findings(turned)) == list(findings(changed))


@cases(
    "numbers, words",
    ((0.2, 0.1, 0.3), "but more than"),
    ((0.2, -0.1, 0.5), "and cannot be told from"),
    ((-0.2, -0.3, -0.1), "and less than"),
)
def test_a_system_below_the_recorded_dances_is_told_beside_these_with_another_song(
    table: Evaluation, numbers: tuple[float, ...], words: str
) -> None:
    below = with_difference(replace(table, systems=(WILD,)), WILD, RECORDED, -0.1, -0.15, -0.05, songs=20)
    changed = with_difference(below, WILD, OTHER_SONG, *numbers, songs=20)
    start = f"{WILD} goes with its music less than the recorded dances, {words} the same with another song (harmony "
    assert next(findings(changed)).startswith(start)


def test_a_finding_says_of_how_many_songs_a_likeness_is(table: Evaluation) -> None:
    mean = table.means[WILD, "likeness"]._replace(mean=1.0, songs=3)
    (finding,) = findings(replace(table, systems=(WILD,), means={**table.means, (WILD, "likeness"): mean}))
    end = "100% of its dances to the 3 of 7 songs where that can be judged move like recorded dancers."
    assert finding.endswith(end)


def flailing(motion: Motion, seed: int) -> Motion:
    """A body whose joints go their own ways at random, about a tenth of a second each."""
    noise = np.random.default_rng(seed).normal(0.0, 0.15, motion.positions.shape)
    return replace(motion, positions=motion.positions[:1] + gaussian_filter1d(noise, 2.0, axis=0) * 2)


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 10])
def test_the_first_sentence_of_the_page_is_true_of_dances_that_are_known(tmp_path: Path, count: int) -> None:
    songs = sorted(write_corpus(tmp_path / "songs", clips=count, seconds=SECONDS, fps=30.0, seed=4).glob("clip_*"))
    motions = [load_motion(song / "motion.npz") for song in songs]
    for place, (song, motion) in enumerate(zip(songs, motions, strict=True)):
        held = np.repeat(motion.positions[100:101], motion.n_frames, axis=0)
        dances = {"frozen": replace(motion, positions=held), "flailing": flailing(motion, place), "same": motion}
        dances["other"] = motions[(place + 1) % count]
        for name, dance in dances.items():
            (tmp_path / name).mkdir(exist_ok=True)
            save_motion(tmp_path / name / f"{song.name}.npz", dance)
    systems = {name: tmp_path / name for name in dances}
    whole = EvaluationSettings(systems, tmp_path / "songs", tmp_path / "songs")
    evaluation = evaluate_dances(whole, tmp_path / "table")
    first = {name: next(findings(replace(evaluation, systems=(name,)))) for name in systems}
    if count == 3:
        too_few = "3 songs are too few to say how the dances go with their music"
        assert {one.split(";")[0] for one in first.values()} == {too_few}
        return
    assert first.pop("same").startswith("same cannot be told from the recorded dances by its harmony")
    less = "goes with its music less than the recorded dances, and cannot be told from the same with another song"
    assert [one.split(" (")[0] for one in first.values()] == [f"{name} {less}" for name in first]


def test_a_page_says_no_verdict_on_the_best_of_many_that_luck_explains(table: Evaluation) -> None:
    (worst, best), options = table.extremes["on the beat"], table.options
    assert (worst.dances, best.dances) == (2 * CLIPS, 2 * CLIPS)
    clip, params = pair_clip(best.pair, options), HarmonyParams.recommended()
    judgement = score_clip(clip, params).judgement
    most = int(0.05 / judgement.p_harmony)  # dances among which it may be the best, and still be in time
    shown = {looks: player_of([clip], params=params, looks=looks).page for looks in (1, most, most + 1)}
    said = {looks: of_dance(judgement.verdict) in page for looks, page in shown.items()}
    assert said == {1: True, most: True, most + 1: False}
    luck = f"p = {judgement.p_harmony:.3f} is {(most + 1) * judgement.p_harmony:.2g} once corrected for so many."
    assert f"No verdict: picked among {most + 1} dances. Its {luck}" in shown[most + 1]


@cases("songs, share", (1, ""), (2, "50%"), (3, "75%"), (5, "94%"), (6, ""))
def test_it_is_remarked_how_often_an_interval_over_few_songs_holds_the_mean(
    table: Evaluation, songs: int, share: str
) -> None:
    some = {name: count._replace(songs=songs) for name, count in table.counts.items()}
    notes = [note for note in table_notes(replace(table, counts=some)) if note.startswith("An interval over")]
    assert [f"in some {share} of such tables" in note for note in notes] == ([True] if share else [])


@cases("mean, songs, most", (0.0, 6, "46%"), (1.0, 20, "17%"), (0.5, 6, ""), (0.0, 1, ""))
def test_it_is_remarked_how_far_a_share_may_lie_from_songs_that_all_agree(
    table: Evaluation, mean: float, songs: int, most: str
) -> None:
    system = table.systems[0]
    means = {key: value for key, value in table.means.items() if key[1] not in ("significant", "likeness")}
    means[system, "likeness"] = table.means[system, "likeness"]._replace(mean=mean, songs=songs)
    notes = [note for note in table_notes(replace(table, means=means)) if "has no width" in note]
    assert [(f"up to {most} away" in note, note.about) for note in notes] == [(True, (system, "likeness"))] * bool(most)


def test_it_is_remarked_that_recorded_dances_set_their_own_limits(table: Evaluation) -> None:
    assert table.means[RECORDED, "likeness"].mean == 1
    (note,) = (note for note in table_notes(table) if note.startswith("The limits of likeness are the recorded"))
    assert "Those of so few are narrow" in note
    many = {**table.counts, RECORDED: table.counts[RECORDED]._replace(dances=12)}
    assert not any("so few are narrow" in note for note in table_notes(replace(table, counts=many)))


@cases("before", 0, 300)
def test_limits_of_likeness_are_of_what_is_danced_to_music(planted: Path, tmp_path: Path, before: int) -> None:
    """Who stands before the song, after it, and in a silence of it, would set limits that a standing dancer passes."""
    clip = next((planted / "recorded").glob("clip_*"))
    motion, (sound, rate) = load_motion(clip / "motion.npz"), soundfile.read(clip / "audio.wav")
    dance, standing = motion.positions, np.repeat(motion.positions[-1:], 300, axis=0)
    places = np.concatenate([standing[:before], dance, standing, standing])
    save_motion(tmp_path / "danced.npz", motion)
    save_motion(tmp_path / "stood.npz", Motion(places, motion.fps, motion.skeleton), offset=-before / motion.fps)
    soundfile.write(tmp_path / "song.wav", np.pad(sound, (0, 10 * rate)), rate)

    def limits(name: str) -> LikenessLimits | None:
        pair = Pair(RECORDED, "", "song", tmp_path / f"{name}.npz", tmp_path / "song.wav", RECORDED)
        return recorded_limits([pair], RowOptions(), progress=silent)

    plain, stood = limits("danced"), limits("stood")
    assert plain is not None and stood is not None
    assert stood.pooled["poorest"] == pytest.approx(plain.pooled["poorest"], rel=0.01)


def test_the_methods_name_groups_of_songs_though_no_system_has_so_many(table: Evaluation) -> None:
    assert "groups of songs" not in full_methods(table)
    few = {name: count._replace(songs=count.songs + 1) for name, count in table.counts.items()}
    assert "5000 groups of songs, drawn by name, stand for the songs" in full_methods(replace(table, counts=few))


def test_no_beat_measure_changes_with_the_frame_rate() -> None:
    numbers = []
    for fps in (120.0, 60.0, 30.0, 15.0):
        scores = []
        for place in range(20):  # a rest a second, anywhere between two frames
            beats = np.arange(0.5, 20.0) + place / 20 / fps
            turns = np.arange(20 * fps + 1) / fps - beats[0]
            way = turns - np.sin(2 * np.pi * turns) / 2 / np.pi
            motion = Motion(way[:, None, None] * np.array([1.0, 0.0, 0.0]), fps, Skeleton.unnamed(1))
            scores.append(beat_numbers(BeatTrack(beats, np.ones(20), 100.0, 20.0), motion))
        numbers.append(pd.DataFrame(scores).mean())
    pd.testing.assert_series_equal(numbers[0], numbers[1], atol=0.01)
    pd.testing.assert_series_equal(numbers[0], numbers[2], atol=0.01)
    pd.testing.assert_series_equal(numbers[0], numbers[3], atol=0.02)


def test_remarks_on_what_does_not_compare(table: Evaluation) -> None:
    songs = table.songs.copy()
    songs.loc[("on the beat", songs.loc["on the beat"].index[0]), "harmony"] = np.nan
    faulty = replace(
        table,
        songs=songs,
        facts={**table.facts, WILD: {**table.facts[WILD], "fps": Counter({"60": CLIPS})}},
        sets={**table.sets, (WILD, "fid_kinetic"): SetNumber(-1.0, CLIPS)},
    )
    remarks = (
        'The measure "harmony above chance" is of fewer songs than there are: on the beat 6 of 7.',
        f"The frame rates differ (on the beat: 30; {WILD}: 60; recorded: 30)",
        "A Fréchet distance below 0 is chance",
    )
    assert [remark for remark in remarks if remark not in " ".join(table_notes(faulty))] == []
    assert [remark for remark in remarks[:2] if remark in " ".join(table_notes(table))] == []


def test_the_terminal_has_columns_that_can_be_read(
    table: Evaluation, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    evaluating._print(table)
    lines = [line.split("│")[2:-1] for line in capsys.readouterr().out.splitlines() if "│ beat_align_motion " in line]
    numbers = [number_text(table.means[row, "beat_align_motion"].mean) for row in table.rows]
    assert [cell.split()[0] for line in lines for cell in line] == numbers
    assert len(lines) == 2


def tabulars(text: str) -> list[tuple[str, list[list[str]]]]:
    """(columns as the tabular declares them, cells of its rows) of each; a cell over several columns counts as many.

    Fails on what LaTeX would stop at: braces or environments that do not match, and bare marks of commands.
    """
    depth = 0
    for mark in re.findall(r"\\.|[{}]", text.split("\n", 1)[1], re.DOTALL):
        depth += {"{": 1, "}": -1}.get(mark, 0)
        assert depth >= 0
    assert depth == 0
    names: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{([^}]*)\}", text):
        if kind == "begin":
            names.append(name)
        else:
            assert names.pop() == name
    assert not names
    found = []
    for columns, body in re.findall(r"\\begin\{tabular\}\{(l?c*)\}(.*?)\\end\{tabular\}", text, re.DOTALL):
        body = re.sub(r"\\(?:top|mid|bottom)rule\n|(?:\\cmidrule\(lr\)\{\d+-\d+\})+\n", "", body)
        rows = [re.split(r"\s*(?<!\\)&\s*", row.strip()) for row in body.strip().removesuffix(r"\\").split("\\\\\n")]
        assert not re.search(r"(?<!\\)[%#~]|(?<![\\$])\^|(?:^|\n)\s*[\[*]", body)
        found.append((columns, rows))
    return found


def width(row: list[str]) -> int:
    """Columns that a row fills."""
    return sum(int(wide[1]) if (wide := re.search(r"\\multicolumn\{(\d+)\}", cell)) else 1 for cell in row)


def test_latex_is_balanced_and_bold_where_the_rank_allows_it(table: Evaluation) -> None:
    (columns, rows), (body_columns, body_rows) = tabulars(table_tex(table))
    assert [width(row) for row in rows] == [len(columns)] * 6
    assert [width(row) for row in body_rows] == [len(body_columns)] * 6
    off = r"\textless{}b\textgreater{}50\%\_\$x\textless{}/b\textgreater{}"
    assert (rows[1][0], rows[2][0]) == ("on the beat", off)
    assert rows[1][1].startswith(r"\textbf{0.") and rows[2][1].startswith("0.")


def with_protocols(table: Evaluation) -> Evaluation:
    """The table with columns of AIST++ and Bailando, the latter of geometric features that are constant."""
    beats = ("aist++ BeatAlign", "bailando BAS")
    means = {(row, name): summary.Mean(0.25, 0.2, 0.3, 7) for row in table.rows for name in (*beats, "edge PFC")}
    rows = [row for row in table.rows if row != OTHER_SONG]
    sets = {(row, f"aist++ {name}"): SetNumber(123.4, 14, n_recorded=7) for row in rows for name in ("FID_k", "Div_k")}
    sets |= {(row, "bailando FID_g"): SetNumber(3397420215585169408.0, 14, n_recorded=7) for row in rows}
    sets[WILD, "bailando FID_g"] = sets[WILD, "bailando FID_g"]._replace(constant=(2, 31))
    control = summary.Difference("aist++ BeatAlign", RECORDED, OTHER_SONG, 0.01, -0.02, 0.04, 7)
    return replace(
        table,
        settings=replace(table.settings, protocols=["aist++", "bailando", "edge"]),
        songs=table.songs.assign(**dict.fromkeys((*beats, "edge PFC"), 0.25)),
        means={**table.means, **means},
        sets={**table.sets, **sets},
        differences=[*table.differences, control],
        ranks={**table.ranks, "aist++ BeatAlign": {"on the beat": 1, WILD: 2}},
    )


def test_latex_has_the_columns_of_all_protocols_as_papers_print_them(table: Evaluation) -> None:
    text = table_tex(with_protocols(table))
    *own, (columns, rows) = tabulars(text)
    assert own == tabulars(table_tex(table))
    assert columns == "lcccccc" and [width(row) for row in rows] == [7] * 7
    names = (3, "aist++"), (2, "bailando"), (1, "edge")
    assert rows[0][1:] == [rf"\multicolumn{{{count}}}{{c}}{{{name}}}" for count, name in names]
    assert r"\cmidrule(lr){2-4}\cmidrule(lr){5-6}\cmidrule(lr){7-7}" in text
    down, up = r"$\downarrow$", r"$\uparrow$"
    heads = [f"FID$_k$ {down}", "Div$_k$", rf"BeatAlign$^\dagger$ {up}", f"FID$_g$ {down}", f"BAS {up}", f"PFC {down}"]
    assert rows[1] == ["System", *heads]
    numbers = ["123", "123", r"\textbf{0.25} {\tiny[0.20, 0.30]}", "3.4e18", *[r"0.25 {\tiny[0.20, 0.30]}"] * 2]
    assert rows[2] == ["on the beat", *numbers] and rows[3][4] == r"3.4e18$^\ddagger$"
    assert rows[4][:3] == ["recorded", "123", "123"] and rows[5][:3] == ["recorded, other song", "-", "-"]
    assert "3397420215585169408" not in text and "FID\\_" not in text
    assert "edge: Its paper also prints beat alignment and diversity (Dist\\_k, Dist\\_g); no code" in text


@pytest.mark.slow
def test_remarks_on_columns_of_protocols_are_those_of_our_own(table: Evaluation) -> None:
    published = with_protocols(table)
    about = {note: note.about for note in table_notes(published)}
    (constant,) = (note for note in about if "constant in the reference" in note)
    assert constant.startswith("bailando FID_g: 2 of 32 geometric features are constant in the reference: meaningless")
    assert f"for {WILD}, where they are not" in constant and "They are: right hand above neck, root fast." in constant
    assert about[constant] == ("bailando FID_g",)
    (deaf,) = (names for note, names in about.items() if note.startswith("These measures do not tell"))
    assert "aist++ BeatAlign" in deaf
    assert ("aist++ FID_k",) in about.values()  # of few dances
    (missing,) = (note for note in about if note.startswith("edge: Its paper"))
    assert "they cannot be reproduced" in missing
    page = evaluation_page.evaluation_page(replace(published, extremes={}))
    line = page.split("aist++ BeatAlign ↑")[1].split("</tr>")[0]
    assert 'aria-label="remark' in line.split("</th>")[0] and 'title="rank 1"' in line
    assert page.index("by the published code of aist++") < page.index("aist++ FID_k ↓") < page.index("bailando FID_g ↓")
    assert "aist++ FID_k_n_recorded" in table_csv(published).splitlines()[0]


def test_a_held_pose_that_wins_a_column_is_a_remark(table: Evaluation) -> None:
    (note,) = (note for note in table_notes(table) if note.startswith("By these measures a held pose is better"))
    assert "foot_skating" in note.about and not {"freezing", "harmony", "jerk"} & set(note.about)


def test_a_protocol_means_over_dances_and_draws_songs_again() -> None:
    rows = rows_of({("x", "a", "1"): 0.0, ("x", "a", "2"): 2.0, ("x", "b", "1"): 4.0}, "aist++ BeatAlign")
    collected = collect([rows.assign(harmony=np.nan)])
    means = summary.dance_means(collected.sums, collected.counts, ["aist++ BeatAlign"])
    assert means["x", "aist++ BeatAlign"][::3] == (2.0, 2)  # our own mean, of songs, is 2.5
    same = collect([rows_of(of_songs(x=np.arange(6.0)))])
    assert summary.dance_means(same.sums, same.counts, ["harmony"]) == summary.system_means(same.song_means)


def test_the_ground_truth_of_a_protocol_is_a_line(rng: np.random.Generator) -> None:
    songs = [f"{song}" for song in range(40)]
    recorded, danced = published_rows(RECORDED, rng.normal(size=(40, 3)), songs), rng.normal(size=(8, 3))
    some = protocol_sets({RECORDED: recorded, "x": published_rows("x", danced, songs[:8])}, "aist++")
    vectors = recorded[[f"f_aist++ kinetic_{place:03d}" for place in range(3)]].to_numpy()
    scaled = (vectors - vectors.mean(axis=0)) / vectors.std(axis=0)
    truth = some[RECORDED, "aist++ FID_k"]
    assert (truth.n, truth.n_recorded) == (8, 40)
    assert truth.value == pytest.approx(frechet_distance(scaled[:8], scaled, correct_bias=False).raw, rel=1e-6)
    assert some[RECORDED, "aist++ Div_k"].value == pytest.approx(diversity(scaled[:8]), rel=1e-6)
    every = protocol_sets({RECORDED: recorded, "x": published_rows("x", np.tile(danced, (5, 1)), songs)}, "aist++")
    assert every[RECORDED, "aist++ FID_k"][1::2] == (20, 20)  # against itself it would be 0
    assert every[RECORDED, "aist++ FID_k"].value > 0
    assert every[RECORDED, "aist++ Div_k"].value == pytest.approx(diversity(scaled), rel=1e-6)


def test_features_that_are_constant_in_the_reference_are_counted(rng: np.random.Generator) -> None:
    songs = [f"{song}" for song in range(9)]
    values, danced = rng.normal(size=(9, 3)), rng.normal(size=(9, 3))
    values[:, 1:] = 0.25
    danced[:, 1] = 0.25  # here the dances agree, too: nothing is divided by 1e-10
    both = {RECORDED: published_rows(RECORDED, values, songs), "x": published_rows("x", danced, songs)}
    sets, names = protocol_sets(both, "aist++"), ("aist++ FID_k", "aist++ Div_k", "aist++ FID_g", "aist++ Div_g")
    assert {name: one.constant for (row, name), one in sets.items() if row == "x"} == dict.fromkeys(names, (2,))
    assert sets["x", "aist++ FID_g"].value > 1e15


def test_the_methods_can_be_pasted_and_the_rest_is_in_a_file(planted: Path, table: Evaluation) -> None:
    published = with_protocols(table)
    many = {f"system {place}": published.counts[WILD] for place in range(40)}
    for one in (table, published, replace(published, systems=tuple(many), counts={**published.counts, **many},
                facts={**published.facts, **dict.fromkeys(many, published.facts[WILD])})):  # fmt: skip
        assert 100 < len(methods_paragraph(one).split()) <= 200
    text = (planted / "table" / "methods.txt").read_text("utf-8")
    assert text.startswith(methods_paragraph(table)) and full_methods(table) in text


def test_the_caption_counts_the_songs_of_each_column(table: Evaluation) -> None:
    assert "Means over 7 songs (H. of dance: " in table_tex(table)
    means = {**table.means, (WILD, "harmony"): table.means[WILD, "harmony"]._replace(songs=5)}
    assert "Means over 7 songs (Harmony: 5 to 7; H. of dance: " in table_tex(replace(table, means=means))


@pytest.mark.parametrize("name", [r"_ & % # ~ ^ \ { } $", "[ours]", "* | <", "two\nlines & 100%\\", "\\end{tabular}"])
def test_latex_holds_names_with_any_mark(table: Evaluation, name: str) -> None:
    means = {(name, measure): value for (row, measure), value in table.means.items() if row == WILD}
    counts = table.counts | {name: table.counts[WILD]}
    renamed = replace(table, systems=(name,), counts=counts, means=table.means | means, sets={})
    (columns, rows), _ = tabulars(table_tex(renamed))
    assert [width(row) for row in rows] == [len(columns)] * 5
    spelt = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\n": " "}
    spelt |= {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", "[": "{[}", "*": "{*}"}
    spelt |= {one: f"\\{one}" for one in "_&%#{}$"}
    assert rows[1][0] == "".join(spelt.get(one, one) for one in name).strip()


def test_the_page_needs_no_network_and_escapes_names(planted: Path, table: Evaluation) -> None:
    page = (planted / "table" / "index.html").read_text("utf-8")
    assert not re.search(r"(src|href|srcset|action)=[\"']?(https?:)?//", page)
    assert not re.search(r"url\(|@import|<link\b", page) and WILD not in page and "&lt;b&gt;50%_$x&lt;/b&gt;" in page
    assert page.count("<iframe") == 6  # the best and the worst of two systems and of the recorded dances


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_page_fits_its_window_and_asks_for_nothing(chromium: Any, planted: Path, table: Evaluation, width: int) -> None:
    page = at_address(chromium, (planted / "table" / "index.html").as_uri(), {"width": width, "height": 844})
    page.frames[1].wait_for_function("window.harmolabPlayer", timeout=20_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("[...document.images].every(one => one.naturalWidth > 0)")
    assert page.evaluate("[...document.all].every(one => parseFloat(getComputedStyle(one).fontSize) >= 12)")
    edges = page.eval_on_selector_all("td.control", "cells => cells.map(one => one.getBoundingClientRect().right)")
    assert len(edges) > 3 * 20 and max(edges) <= width  # no control is out of sight
    closed(page)


@pytest.mark.slow
def test_the_page_is_the_same_to_the_byte_each_time(planted: Path, table: Evaluation) -> None:
    assert evaluation_page.evaluation_page(table) == (planted / "table" / "index.html").read_text("utf-8")


@pytest.mark.slow
def test_a_fault_while_writing_leaves_the_table_as_it_was(
    planted: Path, table: Evaluation, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {path: path.read_bytes() for path in (planted / "table").rglob("*.*") if path.is_file()}

    def broken(_: Evaluation) -> str:
        raise ValueError("planted")

    monkeypatch.setattr(evaluation_page, "table_tex", broken)
    refused("planted", write_evaluation, planted / "table", replace(table, extremes={}))
    assert {path: path.read_bytes() for path in (planted / "table").rglob("*.*") if path.is_file()} == files


def test_rows_that_break_off_leave_the_clips_as_they_were(tmp_path: Path) -> None:
    pair = Pair("x", "", "a", Path("m"), Path("s"))
    rows = rows_of({("x", "a", ""): 1.0}).assign(key=pair.key)

    def parts() -> Any:
        yield rows
        raise ValueError("planted")

    path = tmp_path / "clips.csv"
    path.write_text("former")
    refused("planted", list, written_parts(parts(), path, [pair]))
    assert [one.read_text() for one in tmp_path.iterdir()] == ["former"]


def test_a_dance_that_fails_is_a_line_and_not_the_end(tmp_path: Path) -> None:
    pairs = [Pair("x", "", name, Path(name), Path(name)) for name in "abc"]
    row = rows_of({("x", "c", ""): 1.0}).drop(columns="key")

    def measure(pair: Pair) -> dict[str, Any]:
        if pair.song != "c":
            raise ValueError(f"{pair.song}: damaged")
        return dict(zip(row.columns, row.iloc[0], strict=True))

    path = tmp_path / "clips.csv"
    collected = collect(written_parts(run_rows(pairs, measure, tmp_path / "rows", jobs=0), path, pairs))
    assert sorted(collected.errors.values()) == ["ValueError: a: damaged", "ValueError: b: damaged"]
    assert collected.counts["harmony"].tolist() == [1]
    frame = pd.read_csv(path)
    assert list(frame["song"]) == ["a", "b", "c"]
    assert list(frame["error"].fillna("")) == ["ValueError: a: damaged", "ValueError: b: damaged", ""]


def test_a_song_in_which_no_beat_is_heard_is_a_fault(planted: Path, tmp_path: Path) -> None:
    silent = tmp_path / "silent.wav"
    soundfile.write(silent, np.zeros(10 * 22050), 22050)
    pair = Pair("x", "", "silent", planted / "off" / "clip_0001_cha-cha.npz", silent)
    refused(r"silent\.wav: holds no beats; give them in a file SONG\.beats", clip_row, pair, RowOptions())
    silent.with_suffix(".beats").write_text("1\n2\n3\n")
    assert clip_row(pair, RowOptions())["music_beats"] == 3


def test_a_body_that_a_protocol_does_not_know_has_its_other_numbers(planted: Path) -> None:
    pair = folder_pairs("x", planted / "recorded", songs_in(planted / "recorded")).pairs[0]
    row = clip_row(pair, RowOptions(protocols=("aist++",)))
    assert row["harmony"] > 0 and not any(name.startswith("aist++") for name in row)
    *numbers, remark = protocol_numbers(pair_clip(pair, RowOptions()), pair, "aist++")
    assert numbers == [{}, {}] and remark.startswith("No numbers: the published code takes SMPL's joints; none is")


@pytest.mark.slow
def test_measured_rows_of_a_run_that_was_cut_off_are_not_thrown_away(few: Path, tmp_path: Path) -> None:
    out, some = tmp_path / "table", settings(few, systems={"off": few / "off"})
    evaluate_dances(some, out)
    whole = (out / "clips.csv").read_bytes()
    part = out / "rows" / "part-0000000.parquet"
    write_part(part, part_rows(part)[:5])
    before = part.read_bytes()
    refused(r"holds 5 of 8 rows; go on with --resume", evaluate_dances, some, out)
    assert part.read_bytes() == before
    evaluate_dances(some, out, resume=True)
    assert (out / "clips.csv").read_bytes() == whole


@pytest.mark.slow
def test_files_that_changed_are_measured_anew(few: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, music = tmp_path / "off", tmp_path / "music"
    shutil.copytree(few / "off", folder)
    music.mkdir()
    for clip in sorted((few / "recorded").glob("clip_*")):
        shutil.copyfile(clip / "audio.wav", music / f"{clip.name}.wav")
    measured: list[str] = []

    def counted(pair: Pair, options: RowOptions) -> dict[str, Any]:
        measured.append(f"{pair.system} {pair.song}")
        return clip_row(pair, options)

    monkeypatch.setattr("harmolab.lab.evaluate.evaluation.clip_row", counted)
    some = settings(few, systems={"off": folder}, music=music)

    def resumed() -> list[str]:
        measured.clear()
        evaluate_dances(some, tmp_path / "table", resume=True)
        return list(measured)

    whole = resumed()
    assert len(whole) == 8 and resumed() == []
    last = sorted(folder.iterdir())[-1]
    save_motion(last, load_motion(sorted(folder.iterdir())[0]))
    assert resumed() == whole[whole.index(f"off {last.stem}") :]
    (music / f"{last.stem}.beats").write_text("1\n2\n3\n4\n")
    first = next(place for place, name in enumerate(whole) if name.endswith(last.stem))
    assert resumed() == whole[first:]
    clips = pd.read_csv(tmp_path / "table" / "clips.csv").query(f"song == '{last.stem}' and system == 'off'")
    assert list(clips["music_beats"]) == [4] and list(clips["beats"]) == ["annotated"]


def test_a_run_with_other_recorded_dances_is_not_resumed(few: Path, tmp_path: Path) -> None:
    recorded = shutil.copytree(few / "recorded", tmp_path / "recorded")
    some = settings(few, systems={"off": few / "off"}, reference=recorded)
    evaluate_dances(some, tmp_path / "table")
    changed = sorted(recorded.iterdir())[0] / "motion.npz"
    motion = load_motion(changed)
    save_motion(changed, replace(motion, positions=motion.positions * [1.0, 1.3, 1.0]))
    message = r"recorded: the recorded dances have changed since .*--force"
    refused(message, evaluate_dances, some, tmp_path / "table", resume=True)


@pytest.mark.slow
def test_a_protocol_without_numbers_is_a_remark(few: Path, tmp_path: Path) -> None:
    some = settings(few, protocols=["bailando"], systems={"off": few / "off"})
    notes = list(table_notes(evaluate_dances(some, tmp_path / "table")))
    assert any(note.startswith("No dance has numbers of bailando") for note in notes)


# What is refused


def test_a_table_is_not_written_over_what_it_is_made_from(planted: Path, tmp_path: Path) -> None:
    refused("is an input", evaluate_dances, settings(planted), planted / "recorded")
    refused("lies in a folder of dances", evaluate_dances, settings(planted), planted / "on" / "table")
    (tmp_path / "thesis.tex").write_text("mine")
    refused(r"no table of harmolab; .*--force", evaluate_dances, settings(planted), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
    check_table_folder(tmp_path, settings(planted), force=True)
    with pytest.MonkeyPatch.context() as patch:  # root may write anywhere
        patch.setattr(os, "access", lambda folder, _: folder != tmp_path)
        for out in (tmp_path, tmp_path / "table"):
            refused("nothing may be written there", check_table_folder, out, settings(planted), force=True)


def test_a_system_must_not_be_called_like_a_control(planted: Path) -> None:
    refused("'recorded' is the name of a row", settings, planted, systems={"recorded": planted / "on"})


def test_a_missing_frame_rate_names_the_option(planted: Path, tmp_path: Path) -> None:
    (folder := tmp_path / "x").mkdir()
    np.save(folder / "clip_0001_cha-cha.npy", load_motion(planted / "off" / "clip_0001_cha-cha.npz").positions)
    some = settings(planted, systems={"x": folder})
    refused(r"clip_0001_cha-cha\.npy.*--fps", evaluate_dances, some, tmp_path / "table")
    assert not (tmp_path / "table").exists()
    (pair,) = folder_pairs("x", folder, songs_in(planted / "recorded")).pairs
    row = clip_row(pair, RowOptions(fps=30.0))
    assert row["fps"] == 30.0
    assert np.isnan(row["pfc"]) and np.isnan(row["likeness"])  # which joint is a foot is unknown
    assert np.isfinite(row["jerk"])


class Fake:
    """A protocol with one number a dance, one feature and one number a set."""

    source, notes, missing = "a test", ("It is planted.",), ""
    music_beats = None

    def clip(self, motion: Any, music: Any) -> dict[str, float]:
        return {"beats": float(len(music))}

    def features(self, motion: Any) -> dict[str, np.ndarray]:
        return {"frames": np.array([motion.n_frames, 1.0])}

    def sets(self, features: Any, reference: Any) -> dict[str, float]:
        return {"FID_k": float(features["frames"].mean() - reference["frames"].mean())}

    def remarks(self, motion: Any, scores: Any) -> tuple[str, ...]:
        return (f"Planted at {motion.fps:g}.",)


@pytest.mark.slow
def test_a_protocol_adds_its_numbers(few: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refused("no protocol is called 'fake'", settings, few, protocols=["fake"])
    monkeypatch.setattr("harmolab.lab.evaluate.protocols.PROTOCOLS", {"fake": Fake()})
    evaluation = evaluate_dances(settings(few, protocols=["fake"], systems={"off": few / "off"}), tmp_path / "table")
    beats = pd.read_csv(tmp_path / "table" / "clips.csv").query("system == 'off'")
    assert evaluation.means["off", "fake beats"].mean == pytest.approx(beats["music_beats"].mean())
    assert evaluation.sets["off", "fake FID_k"].value == 0 and "fake beats" in evaluation.measures
    write_evaluation(tmp_path / "table", evaluation)
    page = (tmp_path / "table" / "index.html").read_text("utf-8")
    assert "It is planted." in page and "off, 2 dances: fake: Planted at 30." in page


# The command


@pytest.mark.slow
def test_the_command_writes_the_table_and_says_where(few: Path, tmp_path: Path) -> None:
    out, inputs = tmp_path / "table", ("--music", few / "recorded", "--reference", few / "recorded")
    command = ("evaluate", few / "off", *inputs, "--out", out, "--resamples", 100, "--jobs", 0)
    result = done(app, *command)
    for name in ("index.html", "table.csv", "table.json", "table.tex", "clips.csv"):
        assert (out / name).is_file() and f"wrote {out / name}" in result.output.replace("\n", "")
    assert "frozen pose" in result.output
    done(app, *command)  # its own table may be written anew


@cases(
    "options, fault",
    (("--system", "ours"), "write it as NAME=FOLDER"),
    (("--system", "ours={planted}/on", "--system", "ours={planted}/off"), "there is a system 'ours' already"),
    ((), "there is nothing to evaluate"),
    (("--system", "ours={planted}/nowhere"), "nowhere: no such folder"),
    (("--system", "ours=~/nowhere"), f"{Path.home()}/nowhere: no such folder"),
    (("--system", "ours={tmp}/loop"), "/loop"),
    (("--system", "ours={planted}/on", "--fps", "nan"), "--fps must be a finite number"),
    (("--system", "ours={planted}/on", "--protocol", "nobody"), "no protocol is called 'nobody'"),
)
def test_what_cannot_be_is_one_line(planted: Path, tmp_path: Path, options: tuple[str, ...], fault: str) -> None:
    inputs = ("--music", planted / "recorded", "--reference", planted / "recorded", "--out", tmp_path / "table")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    result = run("evaluate", *(option.format(planted=planted, tmp=tmp_path) for option in options), *inputs)
    assert result.exit_code == 2
    assert fault in result.stderr and len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "table").exists()
