"""Tricks that please a score and bodies on a metronome: what they are, what the scores say of each, and the tables."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import DANCER
from harmolab.shape_speed import shape_speed
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.units import UnitSet
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import judge
from study.cells import notebook_cells
from study.experiments import judging
from study.experiments.judging import LATE, TRUE, half_a_beat_late, trick_means
from study.experiments.locked import evidence, locked_table, metronome, statue_on_turntable
from study.profile import RunProfile
from tests.builders import bobbing, cases, dance_unit, planted_dance, refused, still, track

PROFILE = RunProfile("tiny", n_clips=2, n_sequences=None, n_rotations=40)
TWO = Skeleton(("hip", "knee"), (-1, 0))
AXES = {"SIDE": np.eye(3)[0], "UP": np.eye(3)[1]}
CELLS = notebook_cells("12_cheating_the_score", DANCER=DANCER, **AXES)
BEATS = metronome(CELLS.SECONDS, CELLS.PERIOD)
BASES = {
    "as danced + jitter 2 cm": "as danced",
    "too slow + tremor 2 Hz": "dance, 3 times too slow",
    "too slow + jitter 5 mm": "dance, 3 times too slow",
    "sway + tremor 2 Hz": "no dance, sway 0.4 Hz",
}
TRICKS = {*BASES, *BASES.values()}


@pytest.fixture
def walk() -> Motion:
    """Two joints that move by a metre a second to the side, ten frames a second."""
    positions = np.arange(20)[:, None, None] * [0.1, 0.0, 0.0] + [[0.0, 1.0, 0.0], [0.0, 0.5, 0.0]]
    return Motion(positions, 10.0, TWO)


# Tricks


def test_tremor_moves_the_whole_body_up_and_down(walk: Motion):
    moved = CELLS.trembling(walk, 2.5, 0.01).positions - walk.positions
    np.testing.assert_allclose(moved[:5, 0, 1], [0.0, 0.01, 0.0, -0.01, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved[:, 0], moved[:, 1])
    np.testing.assert_allclose(moved[..., [0, 2]], 0.0)


def test_jitter_has_the_size_asked_for(walk: Motion, rng: np.random.Generator):
    long = Motion(np.zeros((5000, 2, 3)), 10.0, TWO)
    assert CELLS.shaken(long, 0.02, rng).positions.std() == pytest.approx(0.02, rel=0.02)


def test_slowed_motion_has_come_a_third_of_the_way(walk: Motion):
    slow = CELLS.slowed(walk, 3.0)
    assert slow.n_frames == walk.n_frames
    np.testing.assert_allclose(slow.positions[:, 0, 0], np.arange(20) / 30)


def test_swaying_body_keeps_its_first_pose(walk: Motion):
    sway = CELLS.swaying(walk, 0.5, 0.05).positions
    np.testing.assert_allclose(sway[:, 0] - sway[:, 1], np.tile([0.0, 0.5, 0.0], (20, 1)))
    assert sway[5, 0, 0] == pytest.approx(0.05)


# Music half a beat late


def test_late_beats_lie_between_the_old_ones_and_come_in_again_at_the_start():
    late = half_a_beat_late(BeatTrack([0.25, 0.75, 1.25, 1.85], [1.0, 2.0, 3.0, 4.0], 100.0, 2.0))
    np.testing.assert_allclose(late.times, [0.1, 0.5, 1.0, 1.5])
    assert list(late.strengths) == [4.0, 1.0, 2.0, 3.0]


def test_single_beat_has_no_half():
    refused("half a beat needs two beats or more, got 1", half_a_beat_late, BeatTrack([0.25], [1.0], 100.0, 2.0))


# Tables


@pytest.fixture
def tricks(swinging_arm: Callable[..., Motion]) -> pd.DataFrame:
    """Tricks on one clip: an arm that rests on every beat."""
    clip = ("arm", swinging_arm(1.0, 60.0), track(0.25 + 0.5 * np.arange(12), duration=6.0))
    material = {"generator_corpora": lambda profile: ("one", "two"), "studied_clips": lambda *_: [clip]}
    return notebook_cells("12_cheating_the_score", **AXES, **material).cheating(PROFILE)


def test_table_has_every_trick_with_both_musics_for_each_corpus(tricks: pd.DataFrame):
    found = tricks.groupby(["corpus", "music"], sort=False)["trick"].apply(set).to_dict()
    assert found == {(corpus, music): TRICKS for corpus in ("one", "two") for music in (TRUE, LATE)}


def test_dancer_on_the_beat_loses_everything_when_the_music_is_late(tricks: pd.DataFrame):
    danced = tricks[(tricks["trick"] == "as danced") & (tricks["corpus"] == "one")].set_index("music")
    assert danced.loc[TRUE, "above_chance"] == pytest.approx(1.0)
    assert danced.loc[LATE, "hit_rate"] == 0.0 and danced.loc[LATE, "above_chance"] < -0.3


def test_what_does_not_depend_on_the_music_is_the_same_with_both(tricks: pd.DataFrame):
    wide = tricks[tricks["corpus"] == "one"].pivot_table(["jerk", "paper_count_ratio"], "trick", "music")
    for measure in ("jerk", "paper_count_ratio"):
        np.testing.assert_allclose(wide[measure, TRUE], wide[measure, LATE])


def made_up() -> pd.DataFrame:
    """Two clips: h of 1 and 2 for every base, 4 and 7 for every trick; 10 more with late music."""
    rows = []
    for trick in TRICKS:
        for clip, value in enumerate([4.0, 7.0] if trick in BASES else [1.0, 2.0]):
            for music, more in ((TRUE, 0.0), (LATE, 10.0)):
                rows.append({"corpus": "made up", "clip": clip, "trick": trick, "music": music, "h": value + more})
    return pd.DataFrame(rows)


def test_means_are_over_clips_of_one_trick_and_music():
    means = trick_means(made_up(), ["h"]).set_index(["trick", "music"])
    assert means.loc[("as danced", TRUE), "mean"] == 1.5
    assert means.loc[("sway + tremor 2 Hz", LATE), "mean"] == 15.5
    # Half the difference times t(0.975; 1) = 12.7062.
    assert means.loc[("as danced", TRUE), "high"] == pytest.approx(1.5 + 6.3531, abs=1e-4)
    assert set(means["n"]) == {2}


def test_gain_of_a_trick_is_over_the_motion_it_was_put_on_with_the_true_music():
    gained = CELLS.trick_gains(trick_means(made_up(), ["h"]))
    assert dict(zip(gained["trick"], gained["put on"], strict=True)) == dict(BASES)
    assert gained["h"].tolist() == [4.0] * len(BASES)


def test_synthetic_clips_are_read_from_their_own_corpus_where_there_are_recordings(monkeypatch: pytest.MonkeyPatch):
    beats, sound = track([0.1, 0.2], duration=1.0), Audio(np.zeros(10), 10.0)
    dancing = Clip("b", sound, Motion(np.zeros((2, 2, 3)), 10.0, TWO), beats=beats)
    clips = {"dances": dancing, "still": Clip("a", sound, beats=beats)}
    monkeypatch.setattr(judging, "excerpt", lambda sequence, seconds: clips[sequence])
    monkeypatch.setattr(judging, "synthetic_corpus", lambda profile: "folder")
    monkeypatch.setattr(judging, "readable_recordings", lambda folder: iter(["still", "dances"]))
    monkeypatch.setattr(judging, "study_recordings", lambda profile, corpus: iter(["still"]))
    monkeypatch.setattr(judging, "data_root", lambda: "recordings")
    assert [name for name, *_ in judging.studied_clips(PROFILE, judging.SYNTHETIC)] == ["b"]
    assert list(judging.studied_clips(PROFILE, "recordings")) == []


def test_generator_that_listens_falls_with_late_music_and_one_beside_the_beat_rises(monkeypatch: pytest.MonkeyPatch):
    unit = dance_unit("one", np.zeros((60, 6), np.float32), 30, beats=0.25 + 0.5 * np.arange(8), strengths=np.ones(8))
    units = UnitSet((unit,), Skeleton(("joint",), (-1,)), np.zeros(1), FeatureParams())
    dances = {"recorded": [bobbing(0.25)], "recommended": [bobbing(0.25)], "paper": [bobbing(0.5)]}
    monkeypatch.setattr(judging, "generator_corpora", lambda profile: ("made up",))
    monkeypatch.setattr(judging, "danced_units", lambda profile, corpus: (units, dances))
    rates = judging.generators_half_a_beat_late(PROFILE).set_index(["trick", "music"])["hit_rate"]
    for name, shares in {"recommended": (1.0, 0.0), "paper": (0.0, 1.0), "recorded": (1.0, 0.0)}.items():
        assert (rates[name, TRUE], rates[name, LATE]) == shares, name


# Bodies on a metronome


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return locked_table(CELLS.bodies(1), BEATS, CELLS.FPS).set_index("motion")


def test_poses_are_reached_on_the_beats_and_left_and_reached_at_rest():
    beats = np.array([0.0, 0.01, 0.5, 0.99, 1.0])
    np.testing.assert_allclose(CELLS.arrivals(beats), [0.0, 0.0, 0.5, 1.0, 1.0], atol=2e-5)
    np.testing.assert_allclose(CELLS.arrivals(beats, width=0.5), [0.0, 0.0, 0.0, 1.0, 1.0], atol=1e-3)


def test_stroke_is_half_done_on_the_beat_and_over_soon_after_it():
    np.testing.assert_allclose(CELLS.strokes(np.array([1.0, 1.3, 1.5, 1.7, 2.0]), width=0.6), [1, 1.5, 1.5, 1.5, 2])


def test_impact_is_fastest_when_the_beat_stops_it():
    progress = CELLS.impacts(np.array([0.0, 0.7, 0.85, 0.999, 1.0, 1.2]))
    np.testing.assert_allclose(progress, [0.0, 0.0, 0.25, 0.993, 1.0, 1.0], atol=1e-3)


@pytest.mark.slow
def test_cheat_that_pleased_the_old_score_gets_no_number(table: pd.DataFrame):
    statues, tremors = ["statue on a turntable", "statue, turning and travelling"], ["tremor of 1 mm", "tremor of 1 nm"]
    cheats = table.loc[[*statues, "rigid bob", *tremors, "one toe, 1 mm"]]
    assert (cheats["old score"] > 0.9).all() and (cheats["level"] == 0).all()
    assert cheats[["H", "p", "lag (ms)"]].isna().all(axis=None)


@pytest.mark.slow
@cases(
    "level, names",
    (0, ["tremor of 5 mm on a drift", "sensor noise, 1 cm"]),
    (1, ["sensor noise, 3 cm", "smooth noise", "tempo + 1 %", "tempo + 1.6 %", "tempo + 7 %", "other tempo (+ 27 %)"]),
    (3, ["rests, a quarter of a beat late"]),
    (4, ["rests on the beats", "rests, 60 ms late", "runner, a step a beat", "one hand, 10 cm"]),
)
def test_level_says_whether_a_body_moves_keeps_time_and_is_on_beat(table: pd.DataFrame, level: int, names: list[str]):
    assert table.loc[names, "level"].tolist() == [level] * len(names)


@pytest.mark.slow
def test_noise_that_passes_the_floor_has_no_tempo(table: pd.DataFrame):
    assert table.loc[["sensor noise, 3 cm", "smooth noise"], "own tempo"].isna().all()


@cases(
    "name, fastest",
    *[("hits the beats", 470), ("rests, half a beat late", 0), ("impact, then freeze", 450), ("double time", 125)],
    *[("arrives in .1 s, then stands", 450), ("arrives in .25 s, then stands", 375)],
)
def test_dancer_elsewhere_in_the_beat_is_in_time_and_gets_no_number(table: pd.DataFrame, name: str, fastest: float):
    assert table.loc[name, "level"] == 3 and np.isnan(table.loc[name, "H"])
    assert float(table.loc[name, "revealed by"].split()[1].rstrip(",")) == pytest.approx(fastest, abs=25)


def test_four_steps_in_three_beats_are_in_time_and_not_on_the_beat(table: pd.DataFrame):
    runner = table.loc["runner, 4 steps in 3 beats"]
    assert runner["level"] < 4 and runner["rate"] == pytest.approx(4 / 3)


def test_lag_rate_and_tempo_are_measured(table: pd.DataFrame):
    lags = table.loc[["rests, 60 ms late", "rests, a quarter of a beat late"], "lag (ms)"]
    np.testing.assert_allclose(lags, [60, 125], atol=12)
    assert table.loc[["half time", "double time", "rests on the beats"], "rate"].tolist() == [0.5, 2.0, 1.0]
    others = table.loc[["tempo + 1 %", "tempo + 1.6 %", "tempo + 7 %", "other tempo (+ 27 %)"], "own tempo"]
    np.testing.assert_allclose(others / 1.2 - 100, [1.0, 1.6, 7.0, 27.0], atol=0.2)


def test_hand_that_drums_shows_how_few_joints_move(table: pd.DataFrame):
    hand = table.loc["one hand, 10 cm"]
    assert hand["joints"] == pytest.approx(1 / 21, abs=0.02) and "joints 0.05" in hand["revealed by"]


def test_evidence_names_the_number_below_its_floor():
    speed = shape_speed(still(960, fps=30.0, joints=5))
    assert evidence(judge(speed, BEATS)) == "pulse 0.000: next to nothing"
    assert evidence(judge(speed, track([1.0]))) == "1 beats"


def test_statue_of_a_dancer_turns_and_keeps_its_shape():
    clip = planted_dance()
    shape = shape_speed(statue_on_turntable(clip.motion, clip.beats))
    assert shape.speed.max() < 1e-9
    assert np.sqrt(shape.room).max() > 0.5


def test_picture_has_a_row_for_each_body(table: pd.DataFrame):
    old, _, words = CELLS.locked_figure(table.reset_index()).axes
    assert len(old.patches) == len(words.texts) == len(table) == 31


def test_finding_counts_who_pleases_each_score(table: pd.DataFrame):
    assert CELLS.finding({"table_cheating_on_the_beat": table.reset_index()}) == (
        "A score of joint speed in the room accepts 10 of 13 cheats and 4 of 12 dancers in time; "
        "a score of the speed of the body's shape accepts 2 cheats and 12 dancers."
    )


def test_reading_names_the_cheats_that_pass_and_what_tricks_and_late_music_change(table: pd.DataFrame):
    gains = pd.DataFrame({"paper_hit_rate": [0.1, 0.2, -0.1], "above_chance": [0.1, -0.2, -0.1]})
    late = pd.DataFrame({"music": ["true", "half a beat late"], "mean": [0.8, -0.4]})
    late = late.assign(trick="recommended", measure="above_chance", corpus="made up")
    tables = {"table_cheating_gains": gains, "table_generators_late": late}
    words = CELLS.reading(tables | {"table_cheating_on_the_beat": table.reset_index()})
    assert "Cheats that keep time: one hand, 10 cm; random walk that stops on the beats." in words
    assert "Of 3 tricks 2 raise the paper's hit rate, and 1 harmony above chance." in words
    assert "our generator (made up) from 0.80 to -0.40." in words
