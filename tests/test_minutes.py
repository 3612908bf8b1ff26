"""Dances of minutes and half minutes in tables: planted dancers whose answers are known by construction."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest

from harmolab.beats.audio import audio_beats
from harmolab.data.synthetic import ClipSettings, planted_clip, synthetic_clip
from harmolab.params import DANCES
from harmolab.types import Motion
from study import diagram
from study.cells import notebook_cells
from study.experiments import contestants, generation, unheard_songs
from study.experiments.contestants import RIGHT_SONG, Contestant, Row, kept_name
from study.experiments.contests import Contest, Excerpt
from study.experiments.unheard_songs import recorded_dancers, unheard_song
from study.figures.music2dance import chance_figure, endurance_summary, limits_figure, marks_figure
from study.profile import RunProfile
from tests.builders import cases

PROFILE = replace(RunProfile.quick(), n_seeds=2, n_clips=20, pose_epochs=1)
PLANTED, FROZEN = "planted dancer", "frozen pose"


def planted(excerpt: Excerpt, seed: int) -> Motion:
    """A synthetic dancer who knows the very beats of the song: it comes with the same settings."""
    place, number = list(DANCES).index(excerpt.clip.dance), int(excerpt.song.rpartition(" ")[2])
    seed = unheard_songs.UNHEARD + 1000 * place + number
    return planted_clip(ClipSettings(excerpt.clip.dance, excerpt.seconds, seed=seed, fps=25.0)).clip.motion


def frozen(excerpt: Excerpt, seed: int) -> Motion:
    dancer = planted(excerpt, seed)
    return replace(dancer, positions=np.repeat(dancer.positions[:1], dancer.n_frames, axis=0))


def contestant(name: str, dance: Callable[[Excerpt, int], Motion], contest: Contest, training: int) -> Contestant:
    return Contestant(dance, f"{name} {training}")


DANCERS = {PLANTED: planted, FROZEN: frozen}
OWN = {name: Row(partial(contestant, name, dance), "network", "") for name, dance in DANCERS.items()}
CELLS = notebook_cells("16_music2dance", EVERY_ROW={**contestants.EVERY_ROW, **OWN})
MARKS, STATUE = CELLS.MARKS, CELLS.STATUE
MEASURES = ["slowest 10 s", "fastest 10 s", "pose variance", "still", "freezing"]
MEASURES += ["jerk", "bones", "fastest step", "lowest joint"]


@pytest.fixture(scope="module", autouse=True)
def cache_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARMOLAB_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setattr(unheard_songs, "QUICK_SECONDS", 14.0)
        patch.setattr(generation, "SECONDS", 10.0)  # of the corpus that the network of points learns from
        yield


@pytest.fixture(scope="module")
def contest() -> Contest:
    dancers = []
    for dance, seed in product(("cha-cha", "waltz"), (1, 2, 3, 4)):
        clip, name = synthetic_clip(dance, seconds=24.0, fps=25.0, seed=seed), f"{dance} recorded {seed}"
        dancers.append(Excerpt(name, replace(clip, name=name, source="", beats=audio_beats(clip.audio)), 0.0))
    return Contest(PROFILE, "synthetic", "unheard", (), tuple(dancers), 2)


@pytest.fixture(scope="module")
def dances(contest: Contest) -> pd.DataFrame:
    return CELLS.minutes(contest, [PLANTED, FROZEN])


def test_songs_are_of_no_corpus_and_know_their_one():
    song = unheard_song("waltz", 3, 12.0)
    assert song.seconds == 12.0 and song.beats.bar_places is not None
    assert set(np.diff(song.beats.bar_places) % 3) == {1}
    assert unheard_song("waltz", 4, 12.0).clip.audio.samples.tobytes() != song.clip.audio.samples.tobytes()


def test_every_recording_counts_once(contest: Contest):
    assert {dance: len(clips) for dance, clips in recorded_dancers(contest).items()} == {"cha-cha": 4, "waltz": 4}


def test_a_planted_dancer_keeps_the_limits_and_a_frozen_pose_does_not(dances: pd.DataFrame):
    assert {*MEASURES, CELLS.LIKE, CELLS.WITHIN} <= set(dances) and set(dances["seconds"]) == {14.0}
    assert dances[dances["system"] == PLANTED]["training"].tolist() == [1, 2, 1, 2]
    summary = endurance_summary(CELLS.endurance_table(dances))
    assert list(summary.columns) == MEASURES
    assert (summary.loc[RIGHT_SONG] == 1.0).all()
    assert summary.loc[PLANTED].mean() > 0.9
    assert summary.loc[FROZEN, ["slowest 10 s", "pose variance", "still", "freezing"]].tolist() == [0.0] * 4
    assert summary.loc[FROZEN, "jerk"] == 1.0


def test_what_was_measured_is_kept(contest: Contest, dances: pd.DataFrame):
    nobody = {name: Row(partial(contestant, name, None), "network", "") for name in OWN}
    again = notebook_cells("16_music2dance", EVERY_ROW=nobody).minutes(contest, [PLANTED])
    pd.testing.assert_frame_equal(again, dances[dances["system"] != FROZEN])


def test_likeness_has_a_row_for_all_dances_and_its_interval_over_trainings(dances: pd.DataFrame):
    table = CELLS.likeness_table(dances).set_index(["dance", "system"]).loc["all"]
    assert table.loc[FROZEN, "moves like people"] == 0.0
    assert table.loc[[PLANTED, RIGHT_SONG], "interval over"].tolist() == ["trainings", "dances"]
    assert table.loc[PLANTED, "dances"] == 4


@pytest.fixture(scope="module")
def halves(contest: Contest) -> dict[tuple[str, str], Any]:
    return CELLS.half_minutes(contest, [PLANTED, FROZEN])


def test_own_music_is_told_from_other_music_by_its_place_on_the_diagonal():
    noise = np.random.default_rng(0).normal(size=(20, 20))
    outcome = CELLS.right_music(noise + 5 * np.eye(20))
    assert outcome["auc"] > 0.99 > outcome["chance high"]
    nothing = CELLS.right_music(noise)
    assert nothing["chance low"] < nothing["auc"] < nothing["chance high"]
    assert np.isnan(CELLS.right_music(np.full((3, 3), np.nan))["auc"])


@pytest.mark.slow
def test_planted_dancers_are_nearer_to_their_own_music(halves: dict[tuple[str, str], Any]):
    table = CELLS.right_music_table(halves)
    own = table[(table["system"] == PLANTED) & (table["score"] == "without a pattern")]
    assert (own["own music"] > own["other music"] + 0.2).all()
    assert STATUE not in set(table["system"])


@pytest.mark.slow
def test_marks_go_from_statues_to_recorded_dancers(halves: dict[tuple[str, str], Any]):
    marks = CELLS.machine_marks(halves).set_index("system")
    assert sum(MARKS.values()) == pytest.approx(1.0)
    assert marks.loc[RIGHT_SONG, list(MARKS)].tolist() == pytest.approx([10.0] * 4)
    assert marks.loc[STATUE, ["naturalness", "richness", "music", "sliding"]].tolist() == [0.0] * 4
    assert marks.loc[FROZEN, "music"] == 0.0 and marks.loc[FROZEN, "richness"] < marks.loc[PLANTED, "richness"]
    assert marks.loc[PLANTED, "total"] > marks.loc[FROZEN, "total"] + 2
    weighted = sum(weight * marks.loc[PLANTED, name] for name, weight in MARKS.items())
    assert marks.loc[PLANTED, "total"] == pytest.approx(weighted)


@cases("value, expected", (5.0, 0.0), (7.0, 0.0), (1.0, 10.0), (0.0, 10.0), (2.0, 7.5))
def test_a_mark_lies_between_the_worst_and_the_best(value: float, expected: float):
    assert CELLS.mark(value, worst=5.0, best=1.0) == expected


def test_a_repeated_movement_is_near_and_a_shifted_one_as_far_as_it_was_shifted():
    motion = synthetic_clip("cha-cha", seconds=12.0, fps=25.0, seed=5).motion
    learnt = CELLS.pieces_of(motion, 1)
    np.testing.assert_allclose(CELLS.nearest_pieces([motion], learnt), 0.0, atol=1e-9)
    raised = motion.positions.copy()
    hand = next(number for number, name in enumerate(motion.skeleton.joints) if "hand" in name.lower())
    raised[:, hand, 1] += 0.2
    moved = CELLS.nearest_pieces([replace(motion, positions=raised)], learnt)
    assert (moved > 0.1).all() and (moved < 20.0).all()


@pytest.mark.slow
def test_titles_say_who_keeps_the_limits_and_how_many_dances_move_like_people(dances: pd.DataFrame):
    figure = limits_figure(CELLS.endurance_table(dances), length="a few seconds")
    assert f"hardest limit: 100 % with {PLANTED}; next 0 % with {FROZEN}" in figure.get_suptitle()
    assert "synthetic dancers" in figure.axes[0].get_xlabel()
    names = ["dancers", "temperature", "smoothing", "draw_memory", "moves like people", "poses apart"]
    rows = [("Music2Dance", 0.0, 0.0, 0.0, 0.5, 9.0, 0.4, 0.5), ("Music2Dance", 1.0, 0.0, 0.0, 0.2, 80.0, 1.0, 9.0)]
    rows += [("statues of the recorded", np.nan, np.nan, np.nan, 1.0, 50.0, 1.0, 1.0)]
    table = pd.DataFrame(rows, columns=[*names, "pose variance / recorded", "jerk / recorded"])
    used = {"temperature": 1.0, "smoothing": 0.0, "draw_memory": 0.0}
    title = chance_figure(table, used=used).get_suptitle()
    assert "20% of dances move like people, fewer than at the best others (50%)" in title


def test_hands_effectors_and_losses_are_drawn_as_they_are():
    heights = np.random.default_rng(0).normal(1, 0.1, (4, 10, 2))
    about = [{"number": dance, "seconds": frame / 25} for dance in range(4) for frame in range(10)]
    one = pd.DataFrame(about).join(pd.DataFrame(heights.reshape(-1, 2), columns=CELLS.HANDS))
    kinds = [one.assign(features=name, kind=kind) for name in ("one", "other") for kind in ("raw", "smoothed")]
    figure = CELLS.hands_figure(pd.concat(kinds), "tango", "beatlocked")
    spread = np.ptp(heights, axis=1).mean() * 100
    assert figure.get_suptitle() == f"Hands in tango range over {spread:.0f} cm with one and {spread:.0f} cm with other"
    shares = pd.DataFrame({"ablation": ["a"], "share": [0.5], "low": [np.nan], "high": [np.nan]})
    points = pd.DataFrame({"x": [0.0, 1.0], "y": [1.0, 2.0], "ablation": ["recorded", "a"]})
    assert "0.50" in CELLS.effectors_figure(points, shares).axes[0].get_title("left")
    figure = CELLS.clusters_figure(losses({"a": [3.0], "b": [1.0]}), "beatlocked")
    assert [line.get_ydata().tolist() for line in figure.axes[1].lines] == [[3.0], [1.0]]


def losses(ends: dict[str, list[float]]) -> pd.DataFrame:
    rows = [(label, n, end) for label, own in ends.items() for n, end in enumerate(own)]
    table = pd.DataFrame(rows, columns=["label", "training", "fixed_nats"])
    return table.assign(phase="teacher", epoch=0, likelihood=1.0)


@cases("last, title", (2.0, "every training ends lower with b"), (5.0, "trainings with a and b overlap at the end"))
def test_title_of_losses_says_which_is_lower_only_where_no_training_disagrees(last: float, title: str):
    assert CELLS.clusters_title(losses({"a": [3.0, 4.0], "b": [1.0, last]})).endswith(title)


@pytest.mark.parametrize(("high", "doubt"), [(7.0, ""), (9.0, ", but inside another's interval")])
def test_highest_mark_is_doubted_inside_another_interval(high: float, doubt: str):
    totals = {"recorded, right song": 10.0, "statue of the recorded": 0.0, "a": 5.0, "b": 8.0}
    marks = pd.DataFrame({"system": list(totals), "total": list(totals.values()), **dict.fromkeys(MARKS, 5.0)})
    marks[["low", "high"]] = [(1.0, high) if system == "a" else (np.nan, np.nan) for system in totals]
    title = marks_figure(marks, MARKS, corpus="beatlocked").get_suptitle()
    assert title == f"Machine marks, nobody was asked: b highest with 8.0 of 10{doubt}"


def test_boxes_are_drawn_with_their_words():
    (ax,) = diagram("m2d_fig02_chain", {"recordings": "one", "motion code": "two\nlines"}).axes
    assert {"recordings", "one", "motion code", "two", "lines"} <= {text.get_text() for text in ax.texts}
    assert [patch.get_gid() for patch in ax.patches].count("arrow") == 5


def test_the_cache_of_a_contest_is_its_own(contest: Contest):
    other = replace(contest, music="other songs")
    song = unheard_song("waltz", 1, 10.0)
    one, two = (kept_name("minutes", each, PLANTED, Contestant(planted, "x"), [song], {}) for each in (contest, other))
    assert one != two
