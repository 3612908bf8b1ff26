"""Systems compared: songs, contests, dances that need no training, what is measured and kept, any data's layout."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import soundfile

from harmolab.beats.visual import visual_beats
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import synthetic_motion, write_corpus
from harmolab.lab.evaluate.measured import MOTION_BEATS
from harmolab.params import DANCES, HarmonyParams
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import score_motion
from study.cells import notebook_cells
from study.experiments import contestants, contests, generation
from study.experiments.contestants import BANK, CHOREOGRAPHER, RIGHT_SONG, ROWS, Contestant, Entry, Row, entries
from study.experiments.contests import Contest, Excerpt, Material, music_anchors, rest_anchors
from study.experiments.generation import SYNTHETIC, sketched_split, training_split
from study.profile import RunProfile
from tests.builders import bobbing, planted_dance, refused

SIZES = {"n_clips": 20, "n_sequences": None, "n_rotations": 1, "n_seeds": 1, "songs": 1, "draws": 2}
PROFILE = RunProfile("tiny", **SIZES, epochs=(1, 1), pose_epochs=1, hidden=16)
# Of the notebook, but for shorter dances and one that is timed.
CELLS = notebook_cells("10_systems_compared", profile=PROFILE, TIMED=1, GUARD_SECONDS=10.0)
CHEAP = tuple(name for name, row in ROWS.items() if row.kind in ("recorded", "pieces"))
FEATURES = FeatureParams.paper()
VALLEYS = HarmonyParams.valleys()


def excerpt(dance: str, seed: int, start: float = 6.0) -> Excerpt:
    """Six seconds of a song with a planted dancer."""
    return Excerpt(f"{dance} {seed}", planted_dance(dance, seconds=18.0, seed=seed), start)


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
    for remembered in (training_split, sketched_split, contests.teachers, contests.patterns):
        remembered.cache_clear()


class OnTheBeat:
    """A system whose movements end on the beats it is told, and that counts its dances."""

    def __init__(self) -> None:
        self.dances = 0

    def generate(self, audio, beats: BeatTrack, *, start: float, seconds: float, seed: int, dance: str) -> Motion:
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
    return contestants.of_system(system, f"toy {training}", entry=entry or {}, parameters=1.5, minutes=2.0)


# Songs


def test_songs_of_seven_dances_are_synthetic_with_planted_dancers_and_tracked_beats():
    music, excerpts = contests.seven_dances(PROFILE)
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
    samples = planted_dance("rumba", seconds=18.0).audio.samples
    for folder, sound in (dict.fromkeys(contests.BALLROOM, samples) | {"VienneseWaltz": np.zeros(100)}).items():
        (tmp_path / folder).mkdir()
        soundfile.write(tmp_path / folder / "one.wav", sound, 22050)
    assert set(contests.ballroom_files(tmp_path)) == set(DANCES)
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path))
    music, excerpts = contests.seven_dances(PROFILE)
    assert (music, [one.song for one in excerpts][:2]) == ("Ballroom songs", ["ChaChaCha/one", "Jive/one"])
    assert all(one.clip.motion is None for one in excerpts)
    (tmp_path / "Samba" / "one.wav").unlink()
    assert contests.seven_dances(PROFILE)[0] == "synthetic songs"


def test_windows_of_a_recording_follow_each_other_and_leave_filler_out(tmp_path: Path):
    write_corpus(tmp_path, clips=1, seconds=32.0)
    recording = load_recording(next(tmp_path.glob("clip_*")))
    motion = recording.clip.motion
    assert motion is not None
    assert [one.start for one in contests.windows(recording)] == pytest.approx([0.0, 6.0, 12.0, 18.0])
    valid = np.ones(motion.n_frames, bool)
    valid[round(6.5 * motion.fps) : round(8.0 * motion.fps)] = False
    spliced = replace(recording, clip=replace(recording.clip, motion=replace(motion, valid=valid)))
    assert [one.start for one in contests.windows(spliced)] == pytest.approx([0.0, 12.0, 18.0, 24.0])
    late = replace(recording, clip=replace(recording.clip, motion=motion.span(0.0, 13.0), offset=4.02))
    assert [one.start for one in contests.windows(late)] == pytest.approx([4.02, 10.02])


def test_a_longer_excerpt_reaches_back_where_the_song_ends():
    longer, longest = (excerpt("rumba", 1, start=12.0).longer(seconds) for seconds in (10.0, 40.0))
    assert (longer.start, longer.seconds, longest.start, longest.seconds) == (8.0, 10.0, 0.0, 18.0)
    assert longer.dancer.duration == pytest.approx(10.0)


# Contests


@pytest.mark.slow
def test_teachers_are_what_training_units_cover_and_nothing_of_a_test_meter():
    contest = contests.contests(PROFILE, 0)[0]
    spans = contests.training_spans(contest.split)
    for unit in contest.split.test.units:
        pieces = spans.get(unit.sequence, [])
        assert all(end <= unit.meter_start + 0.1 or start >= unit.end - 0.1 for start, end in pieces)
    taught = sum(one.clip.motion.duration for one in contest.teachers if one.clip.motion is not None)
    assert taught == pytest.approx(sum(end - start for pieces in spans.values() for start, end in pieces), rel=0.01)
    first = contest.teachers[0]
    whole = load_recording(generation.corpus_root(PROFILE, SYNTHETIC) / first.folder.name).clip.motion
    assert first.clip.motion is not None and whole is not None
    np.testing.assert_array_equal(first.clip.motion.positions[0], whole.positions[round(first.clip.offset * whole.fps)])


@pytest.mark.slow
def test_the_choreographer_dances_the_sketches_that_harmogan_corrects():
    contest = contests.contests(PROFILE, 0)[0]
    run = generation.trained(PROFILE, SYNTHETIC, generation.VARIANTS["recommended"], 1)
    (row,), song = ROWS[CHOREOGRAPHER].contestants(contest), contest.excerpts[0]
    sketcher = contestants.of_system(HarmoGAN.load(run.folder).sketches, "")
    np.testing.assert_array_equal(sketcher.dance(song, 2).positions, row.dance(song, 2).positions)


def test_without_recordings_there_is_one_contest_and_its_dancers_are_those_planted_in_its_songs():
    (contest,) = contests.contests(PROFILE, 0)
    assert contest.about == {"music": "synthetic songs", "corpus": "synthetic"}
    assert contest.has_own_dancers and len(contest.guarded) == 7
    assert contest.patterns == {} and contests.recorded_songs(PROFILE) == []


# Measures


def test_a_dance_on_the_beat_has_harmony_that_goes_when_the_music_is_half_a_beat_late():
    song = excerpt("rumba", 1)
    numbers = CELLS.clip_measures(song.dancer, song)
    assert numbers["above_chance"] > 0.8 > 0.0 > numbers["half a beat late"]
    assert numbers["hit_rate chance"] == pytest.approx(numbers["hit_rate"], abs=0.3)
    assert np.isnan(numbers["pattern"])
    assert numbers["body"] > 0.8 > 0.0 > numbers["body, late"]
    assert numbers["BAS"] > 0.8 > 0.3 > numbers["BAS, late"]


def test_bailando_s_score_is_of_each_music_beat_and_its_nearest_rest():
    motion = bobbing(0.5, seconds=8.0)
    rests = visual_beats(motion, params=MOTION_BEATS).times
    tracks = [BeatTrack(rests + late, np.ones(rests.size), 15.0, 9.0) for late in (0.0, 0.05, 0.1)]
    # A sigma (.05 s) beside each rest: exp(-1/2), and exp(-2) at two of them.
    assert CELLS.bailando(motion, tracks) == pytest.approx([1.0, np.exp(-0.5), np.exp(-2.0)], abs=1e-6)


def test_harmony_with_other_songs_is_a_mean_over_songs_that_are_not_its_own():
    song, faster = excerpt("rumba", 1), excerpt("jive", 2)
    own = CELLS.clip_measures(song.dancer, song)["body"]
    alone = CELLS.other_songs(song.dancer, song, [song, faster])["body, other songs"]
    assert abs(alone) < 0.4 < own
    twice = CELLS.other_songs(song.dancer, song, [faster, replace(song, song="the same, by another name")])
    assert twice["body, other songs"] == pytest.approx((alone + own) / 2)
    assert 0.0 < twice["BAS, other songs"] < CELLS.clip_measures(song.dancer, song)["BAS"]


def test_a_still_body_has_no_harmony_and_no_chance():
    song = excerpt("rumba", 1)
    numbers = CELLS.clip_measures(replace(song.dancer, positions=0 * song.dancer.positions), song)
    names = ["h", "h chance", "hit_rate", "hit_rate chance", "speed", "jerk"]
    assert [numbers[name] for name in names] == pytest.approx([0.0] * 6)


@pytest.mark.slow
def test_right_song_beats_another_song_and_pieces_are_in_time(tables: tuple[pd.DataFrame, pd.DataFrame]):
    table = tables[1].set_index("system")
    above, late = table["above_chance"], table["half a beat late"]
    assert above[RIGHT_SONG] > 0.8 and above["recorded, another song"] < 0.4
    assert above["random pieces, rests on beats"] > 0.5 and late["random pieces, rests on beats"] < 0.1
    # Chance in paper mode is nearly the score.
    assert (table["h"] - table["h chance"]).abs().max() < 0.15
    assert (table["hit_rate"] - table["hit_rate chance"]).abs().max() < 0.2


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.fixture
def two_songs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A contest of two songs alone, one draw each."""
    whole = contests.contests

    def cut(profile: RunProfile, trainings: int) -> list[Contest]:
        return [replace(one, excerpts=one.excerpts[:2]) for one in whole(replace(profile, draws=1), trainings)]

    monkeypatch.setattr(contestants, "contests", cut)


@pytest.mark.slow
def test_a_system_of_another_body_has_no_distance(two_songs: None):
    row = compared(entries(PROFILE, [BANK], trainings=0))[1].iloc[0]
    assert np.isnan([row["FID (kinetic)"], row["diversity"], row["multimodality"]]).all()
    assert np.isfinite([row["h"], row["jerk / recorded"]]).all()


def test_lee_without_warper_is_told_its_own_tempo():
    song = excerpt("rumba", 1)
    beats = contestants.own_tempo(song)
    assert (beats.tempo, beats.times[0], beats.duration) == (pytest.approx(112.5), 0.0, song.clip.audio.duration)


@pytest.mark.slow
def test_dances_side_by_side_are_of_the_same_seconds(tables: tuple[pd.DataFrame, pd.DataFrame]):
    ((song, motions),) = CELLS.side_by_side(entries(PROFILE, [RIGHT_SONG, CHOREOGRAPHER], trainings=0)).items()
    assert (song, *motions) == ("cha-cha 1 (cha-cha)", RIGHT_SONG, CHOREOGRAPHER)
    assert [motion.duration for motion, _ in motions.values()] == pytest.approx([10.0, 10.0])


# Any data


@pytest.mark.slow
def test_a_folder_never_seen_gives_tables_of_the_same_layout(
    tables: tuple[pd.DataFrame, pd.DataFrame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    write_corpus(tmp_path / "mine", clips=4, seconds=14.0, seed=5)
    monkeypatch.setenv("HARMOLAB_DATA", str(tmp_path))
    names = ["recorded, another song", "random pieces, rests on beats"]
    dances, systems = compared(entries(PROFILE, names, trainings=0))
    assert [list(table.columns) for table in (dances, systems)] == [list(table.columns) for table in tables]
    assert systems["music"].unique().tolist() == ["synthetic songs", "recorded songs"]
    assert set(systems["corpus"]) == {"synthetic"}
    own = dances[dances["music"] == "recorded songs"]
    assert own["song"].nunique() == 4 and own["clip"].nunique() == 8
    assert list(CELLS.table_by_dance(dances, "h").columns) == list(CELLS.table_by_dance(tables[0], "h").columns)
    differences = CELLS.difference_table(dances, ["h"], base="recorded, another song")
    assert list(differences.columns)[:4] == ["music", "corpus", "system", "measure"]


@pytest.mark.slow
def test_every_row_of_the_quick_profile_is_made_and_its_rivals_are_not_trained_well_enough(two_songs: None):
    table = compared(entries(PROFILE))[1].set_index("system")
    assert list(table.index) == list(ROWS)
    weak = table["remark"].str.startswith("not trained well enough")
    assert set(table.index[weak]) == {contestants.LEE, contestants.LEE_UNWARPED, contestants.REN}
    assert np.isfinite(table["h"][~weak]).all()
    trained_rows = [name for name, row in ROWS.items() if row.is_trained]
    assert (table.loc[trained_rows, ["parameters (M)", "training minutes"]] > 0).all(axis=None)


# Dances that need no training


def unit_of(dance: str, seed: int, *, late: float = 0.0) -> DanceUnit:
    """Eight beats of a synthetic clip, and their dancer; its music's beats are told `late` periods late."""
    clip = planted_dance(dance, seconds=18.0, seed=seed)
    slow = Motion(clip.motion.positions[::4], clip.motion.fps / 4, clip.motion.skeleton)
    beats = clip.beats.times[clip.beats.times > 2.0]
    first, end = (int(np.floor(time * slow.fps)) for time in (beats[0], beats[8]))
    start = first / slow.fps
    code = encode_motion(slow.positions, slow.fps, slow.skeleton)[first:end]
    times = start + np.arange(len(code)) / slow.fps
    told = beats[:8] - start + late * np.diff(beats[:9])
    index = (np.arange(len(code)) < len(code) // 2).astype(np.float32)
    sound = audio_features(clip.audio, clip.beats, times, FEATURES)
    name = f"{dance} {seed} {late}"
    return DanceUnit(name, name, dance, frozenset(), frozenset(), start, sound, code, index, told, np.ones(8), slow.fps)


def material(*units: DanceUnit, dancers: tuple[Excerpt, ...] = ()) -> Material:
    motion = planted_dance("rumba", seconds=18.0, seed=1).motion
    return Material(UnitSet(units, motion.skeleton, bone_lengths(motion.positions, motion.skeleton), FEATURES), dancers)


def above_chance(motion: Motion, song: Excerpt) -> float:
    beats = song.beats.span(song.start, song.seconds)
    return score_motion(beats, motion, params=VALLEYS, n_rotations=0).harmony_above_chance


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_the_right_song_is_the_dancer_planted_there(rng: np.random.Generator):
    song = excerpt("rumba", 1)
    motion = contests.recorded(material(unit_of("rumba", 2)), song, rng)
    np.testing.assert_array_equal(motion.positions, song.clip.motion.span(6.0, 6.0).positions)
    assert above_chance(motion, song) > 0.8


def test_another_song_is_of_the_same_dance_and_never_the_song_itself(rng: np.random.Generator):
    songs = (excerpt("rumba", 1), excerpt("rumba", 2), excerpt("waltz", 1))
    motion = contests.another_song(material(unit_of("rumba", 2), dancers=songs), songs[0], rng)
    np.testing.assert_array_equal(motion.positions, songs[1].dancer.positions)
    away = contests.another_song(material(unit_of("rumba", 2), dancers=songs), songs[2], rng)
    assert any(np.array_equal(away.positions, song.dancer.positions) for song in songs[:2])
    alone = material(unit_of("rumba", 2), dancers=songs[:1])
    refused("there is no other song", contests.another_song, alone, songs[0], rng)


def test_retiming_brings_another_songs_dancer_to_the_beats(rng: np.random.Generator):
    song, other = excerpt("rumba", 1), excerpt("rumba", 2)
    stuff = material(unit_of("rumba", 2), dancers=(other,))
    before, after = (dance(stuff, song, rng) for dance in (contests.another_song, contests.retimed_dance))
    assert above_chance(after, song) > above_chance(before, song) + 0.3


def test_pieces_of_planted_dancers_are_in_time_whatever_their_own_tempo(rng: np.random.Generator):
    song = excerpt("jive", 1)
    for dance in (contests.random_pieces, contests.resting_pieces, contests.nearest_neighbour):
        motion = dance(material(unit_of("rumba", 1), unit_of("rumba", 2)), song, rng)
        assert motion.duration == pytest.approx(song.seconds, abs=1 / FEATURES.fps)
        assert above_chance(motion, song) > 0.5


def test_only_rests_on_beats_are_in_time_where_the_pieces_are_danced_beside_their_music(rng: np.random.Generator):
    song = excerpt("rumba", 3)
    stuff = material(unit_of("rumba", 1, late=0.5), unit_of("rumba", 2, late=0.5))
    assert above_chance(contests.random_pieces(stuff, song, rng), song) < 0.2
    assert above_chance(contests.resting_pieces(stuff, song, rng), song) > 0.5


def test_rests_are_counted_in_beats_and_of_two_close_ones_the_first_is_taken(monkeypatch: pytest.MonkeyPatch):
    unit = unit_of("rumba", 1)
    period = unit.n_frames / unit.fps / 8
    rests = period * np.array([0.5, 1.4, 1.7, 3.5, 4.4])
    monkeypatch.setattr(contests, "visual_beats", lambda motion, params: BeatTrack(rests, np.ones(5), 15.0, 60.0))
    anchors = rest_anchors(unit, material(unit).units)
    np.testing.assert_array_equal(anchors.beats, [0, 1, 3, 4])
    np.testing.assert_allclose(anchors.seconds, rests[[0, 1, 3, 4]])


def test_a_unit_that_hardly_rests_keeps_the_beats_of_its_music():
    unit = unit_of("rumba", 1)
    still = replace(unit, motion=np.repeat(unit.motion[:1], unit.n_frames, axis=0))
    stuff = material(still)
    np.testing.assert_array_equal(rest_anchors(still, stuff.units).seconds, music_anchors(still, stuff.units).seconds)


def test_a_piece_at_its_own_tempo_is_itself_and_at_double_tempo_travels_as_far():
    unit = unit_of("waltz", 1)
    anchors = music_anchors(unit, material(unit).units)
    times = np.arange(unit.n_frames) / unit.fps
    own = np.interp(times, anchors.seconds, anchors.beats)
    inside = (own > 0.2) & (own < 7.8)
    same, fast = (contests.danced_at(unit, anchors, own[inside], times[inside] / tempo) for tempo in (1, 2))
    # The beats of a unit are not quite even, and the map between them is smooth.
    np.testing.assert_allclose(same[:, :-3], unit.motion[inside, :-3], atol=0.02)
    np.testing.assert_allclose(fast[:, -3:], 2 * same[:, -3:])


def test_the_same_draw_is_the_same_dance_and_another_is_not():
    song, stuff = excerpt("rumba", 3), material(*(unit_of("rumba", seed) for seed in (1, 2, 4, 5)))
    stuff = replace(stuff, dancers=[excerpt("rumba", seed) for seed in (1, 2, 4, 5)])
    for name in contests.DRAWN:
        dance = contests.BASELINES[name]
        one, same, *others = (dance(stuff, song, np.random.default_rng(seed)) for seed in (1, 1, 2, 3, 4, 5))
        np.testing.assert_array_equal(one.positions, same.positions)
        assert not all(np.array_equal(one.positions, other.positions) for other in others)


def test_the_nearest_neighbour_of_a_units_own_music_is_that_unit(monkeypatch: pytest.MonkeyPatch):
    units = [unit_of(dance, 1) for dance in ("rumba", "waltz", "jive")]
    taken: list[str] = []

    def anchors(unit: DanceUnit, units: UnitSet):
        taken.append(unit.dance)
        return music_anchors(unit, units)

    monkeypatch.setattr(contests, "music_anchors", anchors)
    contests.nearest_neighbour(material(*units), excerpt("waltz", 1, start=3.0), np.random.default_rng(0))
    assert taken[0] == "waltz"  # the seconds that the unit was danced to; later ones are other music


def test_pieces_join_between_beats_and_rest_nowhere_else():
    song, unit = excerpt("rumba", 3), unit_of("rumba", 1)
    motion = contests.resting_pieces(material(unit), song, np.random.default_rng(0))
    beats = song.beats.span(song.start, song.seconds).times
    phases = (np.interp(visual_beats(motion, params=VALLEYS).times, beats, np.arange(beats.size)) + 0.5) % 1 - 0.5
    assert np.median(np.abs(phases)) < 0.2
