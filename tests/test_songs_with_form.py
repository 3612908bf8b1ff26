"""Songs with loud, quiet and silent parts, and who hears them: notebook 10, and the guard that leaves silence out."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from harmolab.cli import app, dancing
from harmolab.cli.dancers import Dancer
from harmolab.lab.evaluate.measured import Dance, dance_numbers, silent_frames
from harmolab.lab.evaluate.pairing import Pair
from harmolab.lab.evaluate.rows import RowOptions, clip_row
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import DANCES
from harmolab.readers.motion import load_motion, save_motion
from harmolab.retime.retime import motion_at
from harmolab.systems.choreographer.form import Form
from harmolab.types import Motion
from study.cells import notebook_cells
from study.experiments import unheard_songs
from study.experiments.contestants import RIGHT_SONG, Contestant, Entry
from study.experiments.contests import Contest, Excerpt
from study.experiments.unheard_songs import song_with_form, songs_with_form, unheard_song
from study.profile import RunProfile
from tests.builders import done, planted_dance, write_song

CELLS = notebook_cells("10_systems_compared", profile=RunProfile.quick())
SECONDS = 40.0


@cache
def formed(number: int = 0) -> Excerpt:
    return song_with_form("cha-cha", number, SECONDS)


@cache
def dancer() -> Motion:
    return planted_dance(seconds=SECONDS, fps=30.0).motion


def held_in(motion: Motion, stop: float, seconds: float) -> Motion:
    """The same with one pose from `stop` on, for so long; everything else comes later."""
    times = np.arange(motion.n_frames) / motion.fps
    return motion_at(motion, np.minimum(times, np.maximum(stop, times - seconds)))


def following(song: Excerpt) -> Motion:
    """A dancer as fast as the song is loud, still in its silence, and at rest at the end."""
    form = Form.of(song.clip.audio)
    times = np.arange(dancer().n_frames) / dancer().fps
    loud = np.interp(times / 0.05, np.arange(form.loudness.size), form.loudness)
    pace = 0.2 + 0.8 * (loud - loud.min()) / np.ptp(loud)
    pace[silent_frames(dancer(), song.clip.audio, song.beats) | (times > SECONDS - 1.0)] = 0.0
    return motion_at(dancer(), np.cumsum(pace) / dancer().fps)


def test_a_song_with_form_has_one_silence_and_loud_and_quiet_parts_in_an_order_of_its_own():
    songs = [formed(), formed(1)]
    forms = [Form.of(song.clip.audio) for song in songs]
    assert [len(form.silences(0.5)) for form in forms] == [1, 1]
    ((first, last),) = forms[0].silences(0.5)
    assert last - first == pytest.approx(unheard_songs.STOP_SECONDS, abs=0.3)
    assert all(np.diff(form.range) > 10 for form in forms)
    assert np.corrcoef(*(form.loudness for form in forms))[0, 1] < 0.5
    np.testing.assert_array_equal(songs[0].beats.times, unheard_song("cha-cha", 0, SECONDS).beats.times)


def test_there_are_two_songs_of_each_dance_and_two_at_all_in_a_quick_profile(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(unheard_songs, "song_with_form", lambda dance, number, seconds: (dance, number))
    assert songs_with_form(RunProfile.full(), SECONDS) == [(dance, number) for dance in DANCES for number in (0, 1)]
    assert songs_with_form(RunProfile.quick(), SECONDS) == [("cha-cha", 0), ("waltz", 0)]


def test_who_follows_the_form_is_told_from_who_does_not():
    song, others = formed(), [formed(1)]
    hears, deaf = (CELLS.form_numbers(others, motion, song) for motion in (following(song), dancer()))
    assert list(hears) == list(deaf) == CELLS.FORM
    assert hears["loudness"] > 0.8 and hears["loudness, other songs"] < 0.5
    assert hears["silence"] < 0.1 and hears["ending"] < 0.1
    assert abs(deaf["loudness"]) < 0.5 and min(deaf["silence"], deaf["ending"]) > 0.7


def test_what_cannot_be_measured_is_no_number():
    flat = CELLS.form_numbers([formed(1)], dancer(), unheard_song("cha-cha", 0, SECONDS))
    assert [name for name, value in flat.items() if np.isnan(value)] == ["loudness", "silence"]
    pose = replace(dancer(), positions=np.repeat(dancer().positions[:1], dancer().n_frames, axis=0))
    assert np.isnan(list(CELLS.form_numbers([formed(1)], pose, formed()).values())).all()


@pytest.fixture
def no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))


def test_table_has_recorded_dancers_with_their_own_songs_and_a_pose_beside_each_system(no_cache: None):
    clip = replace(planted_dance(seconds=SECONDS, fps=30.0), name="own")
    own = (Excerpt("own", clip, 0.0), Excerpt("own", clip, 6.0))
    contest = Contest(RunProfile.quick(), "synthetic", "songs", own, own)
    deaf = Contestant(lambda song, seed: dancer(), "deaf")
    rows = {RIGHT_SONG: Contestant(lambda song, seed: song.dancer, "right"), "deaf": deaf}
    rows |= {"hears": Contestant(lambda song, seed: following(song), "hears")}
    rows |= {"failing": replace(deaf, entry={"test": (0.0, "1", False)})}
    entered = [Entry(contest, name, (one,)) for name, one in rows.items()]
    table = CELLS.form_table([*entered, entered[1]], [formed(), formed(1)]).set_index("system")
    assert list(table.index) == [RIGHT_SONG, "frozen pose", "deaf", "hears", "failing"]
    assert table["songs"].fillna(0).tolist() == [1, 1, 2, 2, 0]
    assert table.loc[["frozen pose", "failing"], CELLS.FORM].isna().all(axis=None)
    assert np.isnan(table.loc[RIGHT_SONG, "silence"]) and table.loc[RIGHT_SONG, "ending"] > 0.7
    words = CELLS.form_reading({"table12d_form": table.reset_index()})
    assert words.startswith(f"*synthetic*: loudness is followed most by hears (r {table['loudness']['hears']:.2f};")
    assert "In silence hears has the least" in words and "in the last second hears" in words


# The guard


def test_a_pose_that_is_held_in_silence_is_not_judged():
    song = formed()
    ((stop, end),) = CELLS.silences(song)
    motion = held_in(dancer(), stop, end - stop)
    silent = silent_frames(motion, song.clip.audio, song.beats)
    assert silent.sum() == pytest.approx((end - stop) * motion.fps, abs=2)
    rest = silent_frames(motion.span(2.0, 38.0), song.clip.audio, song.beats, start=2.0)
    np.testing.assert_array_equal(silent[60:], rest)
    one = Dance("x", song.song, motion, song.beats, limits=LikenessLimits.of([dancer()]))
    assert dance_numbers(one, ["likeness"]) == {"likeness": 0.0}
    assert dance_numbers(one._replace(silent=silent), ["likeness"]) == {"likeness": 1.0}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """A song with a stop, and a dancer who holds a pose there."""
    folder = tmp_path_factory.mktemp("stopped")
    ((stop, end),) = CELLS.silences(formed())
    save_motion(folder / "song.npz", held_in(dancer(), stop, end - stop))
    return Pair("x", "", "song", folder / "song.npz", write_song(folder / "song.wav", formed().clip))


@pytest.mark.slow
def test_an_evaluation_leaves_silence_out_too(stopped: Pair):
    assert clip_row(stopped, RowOptions(limits=LikenessLimits.of([dancer()])))["likeness"] == 1.0


@pytest.mark.slow
def test_a_network_that_rests_in_silence_passes_at_the_command_line(stopped: Pair, monkeypatch: pytest.MonkeyPatch):
    motion = load_motion(stopped.motion)
    rests = SimpleNamespace(generate=lambda audio, beats, **options: motion)
    limits = LikenessLimits.of([dancer()])
    monkeypatch.setattr(dancing, "dancer_of", lambda context, options: Dancer(rests, {}, limits=limits))
    said = done(app, "dance", stopped.music, "--out", stopped.motion.with_name("made.npz"), "--json")
    assert json.loads(said.stdout)[0]["likeness"]["passed"] is True
