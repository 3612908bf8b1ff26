"""Systems compared: songs, contests, what is measured and kept, entry tests, and the layout for any data."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import soundfile

from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import synthetic_motion, write_corpus
from harmolab.params import DANCES
from harmolab.types import Audio, BeatTrack, Motion
from study.experiments import contestants, contests, generation
from study.experiments.contestants import (
    BANK,
    CHOREOGRAPHER,
    RIGHT_SONG,
    ROWS,
    Contestant,
    Entry,
    Row,
    entries,
    of_system,
    own_tempo,
)
from study.experiments.contests import (
    BALLROOM,
    Contest,
    Excerpt,
    ballroom_files,
    recorded_songs,
    seven_dances,
    training_spans,
    windows,
)
from study.experiments.generation import SYNTHETIC, training_split
from study.profile import RunProfile
from tests.builders import planted_dance
from tests.notebook_cells import notebook_cells

PROFILE = RunProfile(
    "tiny", n_clips=20, n_sequences=None, n_rotations=1, n_seeds=1, epochs=(1, 1), pose_epochs=1, hidden=16, songs=1,
    draws=2,
)  # fmt: skip
CELLS = notebook_cells("10_systems_compared", profile=PROFILE)
CHEAP = tuple(name for name, row in ROWS.items() if row.kind in ("recorded", "pieces"))


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder of these tests' own, short songs, and no recordings."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("HARMOLAB_CACHE", str(folder))
        patch.delenv("HARMOLAB_DATA", raising=False)
        patch.setattr(generation, "SECONDS", 10.0)
        patch.setattr(contests, "SONG_SECONDS", 18.0)
        forget()
        yield folder
        forget()


def forget() -> None:
    """Nothing is remembered of another corpus of the same name."""
    for remembered in (training_split, contests.teachers, contests.patterns):
        remembered.cache_clear()


class OnTheBeat:
    """A system whose movements end on the beats it is told, and that counts its dances."""

    def __init__(self) -> None:
        self.dances = 0

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float,
        seconds: float | None,
        seed: int,
        dance: str,
    ) -> Motion:
        assert beats is not None and seconds is not None
        self.dances += 1
        whole = synthetic_motion(beats.times, dance=dance or "rumba", seconds=start + seconds, fps=30.0, seed=seed)
        return whole.span(start, seconds)


def compared(entered: list[Entry]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Every dance, and the table of systems."""
    dances, longer = CELLS.measured_dances(entered)
    return dances, CELLS.system_table(entered, dances, longer)


@pytest.fixture(scope="module")
def tables() -> tuple[pd.DataFrame, pd.DataFrame]:
    """The cheap rows on one synthetic song of each dance: every dance, and the table of systems."""
    return compared(entries(PROFILE, CHEAP, trainings=0))


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> dict[str, Row]:
    """Rows to add to; the notebook sees them too."""
    known = dict(ROWS)
    monkeypatch.setattr(contestants, "ROWS", known)
    monkeypatch.setitem(CELLS.system_table.__globals__, "ROWS", known)
    return known


def made(contest: Contest, training: int, *, system: OnTheBeat, entry: dict | None = None) -> Contestant:
    return of_system(system, f"toy {training}", entry=entry or {}, parameters=1.5, minutes=2.0)


# Songs


def test_songs_of_seven_dances_are_synthetic_with_planted_dancers_and_tracked_beats():
    music, excerpts = seven_dances(PROFILE)
    assert music == "synthetic songs"
    assert [one.clip.dance for one in excerpts] == list(DANCES)
    assert {one.start for one in excerpts} == {12.0}
    assert all(one.dancer.duration == pytest.approx(6.0) for one in excerpts)
    assert all(one.beats.bar_places is None and one.beats.times.max() > 15.0 for one in excerpts)


def test_no_song_of_the_comparison_is_in_the_corpus_that_systems_are_trained_on():
    seeds = {contests.UNHEARD + 1000 * dance + number for dance in range(7) for number in range(24)}
    root = generation.corpus_root(PROFILE, SYNTHETIC)
    made_of = [pd.read_json(file, typ="series")["seed"] for file in root.glob("*/beats.json")]
    assert len(made_of) == 10
    assert not seeds & set(made_of)


def test_files_of_the_ballroom_set_take_the_place_of_synthetic_songs_where_every_dance_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for folder in BALLROOM:
        (tmp_path / folder).mkdir()
        soundfile.write(tmp_path / folder / "one.wav", planted_dance("rumba", seconds=18.0).audio.samples, 22050)
    (tmp_path / "VienneseWaltz").mkdir()
    soundfile.write(tmp_path / "VienneseWaltz" / "one.wav", np.zeros(100), 22050)
    assert set(ballroom_files(tmp_path)) == set(DANCES)
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path))
    music, excerpts = seven_dances(PROFILE)
    assert music == "Ballroom songs"
    assert [one.song for one in excerpts][:2] == ["ChaChaCha/one", "Jive/one"]
    assert all(one.clip.motion is None for one in excerpts)
    (tmp_path / "Samba" / "one.wav").unlink()
    assert seven_dances(PROFILE)[0] == "synthetic songs"


def test_windows_of_a_recording_follow_each_other_and_leave_filler_out(tmp_path: Path):
    write_corpus(tmp_path, clips=1, seconds=32.0)
    recording = load_recording(next(tmp_path.glob("clip_*")))
    motion = recording.clip.motion
    assert motion is not None
    assert [one.start for one in windows(recording)] == pytest.approx([0.0, 6.0, 12.0, 18.0])
    valid = np.ones(motion.n_frames, bool)
    valid[round(6.5 * motion.fps) : round(8.0 * motion.fps)] = False
    spliced = replace(recording, clip=replace(recording.clip, motion=replace(motion, valid=valid)))
    assert [one.start for one in windows(spliced)] == pytest.approx([0.0, 12.0, 18.0, 24.0])
    late = replace(recording, clip=replace(recording.clip, motion=motion.span(0.0, 13.0), offset=4.02))
    assert [one.start for one in windows(late)] == pytest.approx([4.02, 10.02])


def test_a_longer_excerpt_reaches_back_where_the_song_ends():
    song = Excerpt("rumba", planted_dance("rumba", seconds=18.0), 12.0)
    assert (song.longer(10.0).start, song.longer(10.0).seconds) == (8.0, 10.0)
    assert (song.longer(40.0).start, song.longer(40.0).seconds) == (0.0, 18.0)
    assert song.longer(10.0).dancer.duration == pytest.approx(10.0)


# Contests


def test_teachers_are_what_training_units_cover_and_nothing_of_a_test_meter():
    contest = contests.contests(PROFILE, 0)[0]
    spans = training_spans(contest.split)
    for unit in contest.split.test.units:
        pieces = spans.get(unit.sequence.rpartition("/")[2], [])
        assert all(end <= unit.meter_start + 0.1 or start >= unit.end - 0.1 for start, end in pieces)
    taught = sum(one.clip.motion.duration for one in contest.teachers if one.clip.motion is not None)
    assert taught == pytest.approx(sum(end - start for pieces in spans.values() for start, end in pieces), rel=0.01)
    first = contest.teachers[0]
    whole = load_recording(generation.corpus_root(PROFILE, SYNTHETIC) / first.folder.name).clip.motion
    assert first.clip.motion is not None and whole is not None
    np.testing.assert_array_equal(first.clip.motion.positions[0], whole.positions[round(first.clip.offset * whole.fps)])


def test_without_recordings_there_is_one_contest_and_its_dancers_are_those_planted_in_its_songs():
    (contest,) = contests.contests(PROFILE, 0)
    assert contest.about == {"music": "synthetic songs", "corpus": "synthetic"}
    assert contest.has_own_dancers
    assert contest.patterns == {}
    assert len(contest.guarded) == 7


# Measures


def test_a_dance_on_the_beat_has_harmony_that_goes_when_the_music_is_half_a_beat_late():
    song = Excerpt("rumba", planted_dance("rumba", seconds=18.0), 6.0)
    numbers = CELLS.clip_measures(song.dancer, song)
    assert numbers["above_chance"] > 0.8 > 0.0 > numbers["half a beat late"]
    assert numbers["hit_rate chance"] == pytest.approx(numbers["hit_rate"], abs=0.3)
    assert np.isnan(numbers["pattern"])


def test_a_still_body_has_no_harmony_and_no_chance():
    song = Excerpt("rumba", planted_dance("rumba", seconds=18.0), 6.0)
    dancer = song.dancer
    still = Motion(np.repeat(dancer.positions[:1], dancer.n_frames, axis=0), dancer.fps, dancer.skeleton)
    numbers = CELLS.clip_measures(still, song)
    assert [
        numbers[name] for name in ("h", "h chance", "hit_rate", "hit_rate chance", "speed", "jerk")
    ] == pytest.approx([0.0] * 6)


def test_right_song_beats_another_song_and_pieces_are_in_time(tables: tuple[pd.DataFrame, pd.DataFrame]):
    above = tables[1].set_index("system")["above_chance"]
    assert above[RIGHT_SONG] > 0.8
    assert above["recorded, another song"] < 0.4
    assert above["random pieces, rests on beats"] > 0.5
    assert tables[1].set_index("system")["half a beat late"]["random pieces, rests on beats"] < 0.1


def test_chance_in_paper_mode_is_nearly_the_score(tables: tuple[pd.DataFrame, pd.DataFrame]):
    table = tables[1].set_index("system")
    assert (table["h"] - table["h chance"]).abs().max() < 0.15
    assert (table["hit_rate"] - table["hit_rate chance"]).abs().max() < 0.2


def test_table_of_systems_says_all_that_is_asked(tables: tuple[pd.DataFrame, pd.DataFrame]):
    table = tables[1]
    assert table["system"].tolist() == list(CHEAP)
    right = table.set_index("system").loc[RIGHT_SONG]
    assert right[["jerk / recorded", "skating / recorded", "speed / recorded"]].tolist() == [1.0] * 3
    assert np.isnan(right["FID (kinetic)"]) and right["multimodality"] == 0.0
    assert (table["trainings"] == 0).all() and (table["clips"] == 7).all()
    assert table["h low"].isna().all()  # one song of each dance
    assert (table["seconds for 6 s"] >= 0).all() and table["processor"].str.len().gt(0).all()
    assert table["guard"].str.fullmatch(r"\d of \d|cannot be judged").all()


# What is kept


def test_a_second_run_dances_nothing_and_a_killed_one_goes_on(rows: dict[str, Row], monkeypatch: pytest.MonkeyPatch):
    system = OnTheBeat()
    rows["toy"] = Row(partial(made, system=system), "choreographer", "yes")
    keep = contestants.keep_arrays
    kept: list[str] = []

    def killed(name: str, arrays: dict) -> None:
        if len(kept) == 3:
            raise KeyboardInterrupt
        kept.append(name)
        keep(name, arrays)

    monkeypatch.setattr(contestants, "keep_arrays", killed)
    toys = entries(PROFILE, ["toy"], trainings=0)
    with pytest.raises(KeyboardInterrupt):
        compared(toys)
    assert system.dances == 4 * PROFILE.draws  # three dances kept, the fourth lost
    monkeypatch.setattr(contestants, "keep_arrays", keep)
    first = compared(toys)
    assert system.dances == (4 + 4) * PROFILE.draws + 7 + 1 + CELLS.TIMED
    for table, again in zip(first, compared(toys), strict=True):
        pd.testing.assert_frame_equal(table, again)
    assert system.dances == (4 + 4) * PROFILE.draws + 7 + 1 + CELLS.TIMED
    assert first[0]["above_chance"].mean() > 0.8


def test_what_fails_an_entry_test_is_a_row_without_a_number(rows: dict[str, Row]):
    entry = {"speed": (0.2, (0.7, 1.2), False), "L1": (0.3, (0.0, 0.5), True)}
    system = OnTheBeat()
    rows["weak"] = Row(partial(made, system=system, entry=entry), "network", "no", "Ren")
    assert entries(PROFILE, ["weak"], trainings=0) == []
    contest = replace(contests.contests(PROFILE, 0)[0], trainings=2)
    weak = Entry(contest, "weak", rows["weak"].contestants(contest))
    dances, table = compared([*entries(PROFILE, [RIGHT_SONG], trainings=0), weak])
    row = table.iloc[1]
    assert system.dances == 0
    assert np.isnan([row[name] for name in ("h", "hit_rate", "above_chance", "M / N", "seconds for 6 s")]).all()
    assert (row["remark"], row["entry tests"]) == ("not trained well enough: speed", "2 of 4")
    assert row["entry values"] == "speed: 0.2; L1: 0.3"
    assert row["h paper"] == pytest.approx(0.263, abs=1e-3)
    assert set(dances["system"]) == {RIGHT_SONG}


def test_rivals_are_trained_on_the_first_corpus_alone(monkeypatch: pytest.MonkeyPatch):
    contest = contests.contests(PROFILE, 0)[0]
    assert all(contestants.applies(name, contest) for name in ROWS)
    monkeypatch.setattr(contestants, "generator_corpora", lambda profile: ("recorded", SYNTHETIC))
    left_out = [name for name in ROWS if not contestants.applies(name, contest)]
    rivals = [contestants.LEE_UNWARPED, contestants.LEE, contestants.REN]
    assert left_out == [*rivals, contestants.M2D_LSTM, contestants.M2D_PAPER, contestants.M2D]


def test_rivals_are_trained_as_often_as_the_profile_says_and_never_more_often_than_the_others():
    def numbers(contest: contests.Contest, training: int) -> Contestant:
        return Contestant(lambda excerpt, seed: excerpt.dancer, str(training))

    contest = replace(contests.contests(PROFILE, 0)[0], trainings=3)
    rival = Row(numbers, "network", "no", rival=True, repeats="n_rivals")
    several = replace(contest, profile=replace(PROFILE, n_rivals=2))
    assert [one.identity for one in Row(numbers, "network", "no").contestants(contest)] == ["1", "2", "3"]
    assert [one.identity for one in rival.contestants(contest)] == ["1"]
    assert [one.identity for one in rival.contestants(several)] == ["1", "2"]
    assert rival.contestants(replace(contest, trainings=0)) == ()
    assert len(Row(numbers, "recorded", "no").contestants(contest)) == 1


@pytest.mark.slow
def test_a_system_of_another_body_has_no_distance(rows: dict[str, Row]):
    row = compared(entries(replace(PROFILE, songs=1, draws=1), [BANK], trainings=0))[1].iloc[0]
    assert np.isnan([row["FID (kinetic)"], row["diversity"], row["multimodality"]]).all()
    assert np.isfinite([row["h"], row["jerk / recorded"]]).all()


def test_lee_without_warper_is_told_its_own_tempo():
    song = Excerpt("rumba", planted_dance("rumba", seconds=18.0), 6.0)
    beats = own_tempo(song)
    assert beats.tempo == pytest.approx(112.5)
    assert (beats.times[0], beats.duration) == (0.0, song.clip.audio.duration)


def test_dances_side_by_side_are_of_the_same_seconds(tables: tuple[pd.DataFrame, pd.DataFrame]):
    ((song, motions),) = CELLS.side_by_side(entries(PROFILE, [RIGHT_SONG, CHOREOGRAPHER], trainings=0)).items()
    assert song == "cha-cha 1 (cha-cha)"
    assert list(motions) == [RIGHT_SONG, CHOREOGRAPHER]
    assert [motion.duration for motion in motions.values()] == pytest.approx([10.0, 10.0])


# Any data


def test_a_folder_never_seen_gives_tables_of_the_same_layout(
    tables: tuple[pd.DataFrame, pd.DataFrame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    write_corpus(tmp_path / "mine", clips=4, seconds=14.0, seed=5)
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path))
    names = ["recorded, another song", "random pieces, rests on beats"]
    dances, systems = compared(entries(PROFILE, names, trainings=0))
    assert list(dances.columns) == list(tables[0].columns)
    assert list(systems.columns) == list(tables[1].columns)
    assert systems[["music", "corpus"]].drop_duplicates().to_numpy().tolist() == [
        ["synthetic songs", "synthetic"],
        ["recorded songs", "synthetic"],
    ]
    own = dances[dances["music"] == "recorded songs"]
    assert own["song"].nunique() == 4 and own["clip"].nunique() == 8
    assert list(CELLS.table_by_dance(dances, "h").columns) == list(CELLS.table_by_dance(tables[0], "h").columns)
    differences = CELLS.difference_table(dances, ["h"], base="recorded, another song")
    assert list(differences.columns)[:4] == ["music", "corpus", "system", "measure"]


def test_without_recordings_there_are_no_recorded_songs():
    assert recorded_songs(PROFILE) == []


@pytest.mark.slow
def test_every_row_of_the_quick_profile_is_made_and_its_rivals_are_not_trained_well_enough():
    table = compared(entries(replace(PROFILE, draws=1)))[1].set_index("system")
    assert list(table.index) == list(ROWS)
    weak = table["remark"].str.startswith("not trained well enough")
    assert set(table.index[weak]) == {contestants.LEE, contestants.LEE_UNWARPED, contestants.REN}
    assert np.isfinite(table["h"][~weak]).all()
    trained_rows = [name for name, row in ROWS.items() if row.is_trained]
    assert (table.loc[trained_rows, ["parameters (M)", "training minutes"]] > 0).all(axis=None)
