"""Likeness: each measure by hand, who passes the guard and who does not, and what it says."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import Collection
from matplotlib.offsetbox import AnnotationBbox

from harmolab import LikenessLimits, likeness, synthetic_motion
from harmolab.body.skeletons import HIPS, Skeleton, body_frame, heading, turned
from harmolab.data.recordings import Recording, iter_recordings
from harmolab.lab.evaluate.measured import OF_HARMONY, dance_scores, statue
from harmolab.lab.person import PAINTS
from harmolab.metrics import likeness as guard
from harmolab.metrics.likeness import AMOUNTS, MEASURES
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.types import BeatTrack, FloatArray, Motion
from study import beat_sheet, contact_sheet, save_blind_sheets
from study.figures import sheets
from study.figures.sheets import CELL, blind_strips
from tests.builders import cases, refused, still

FPS = 15.0


PLACES = {"torso": (0.0, 1.2, 0.0)} | {
    f"{side}_{part}": (sign * aside, height, 0.0)
    for part, aside, height in (
        *(("shoulder", 0.2, 1.4), ("hand", 0.4, 1.0), ("hip", 0.1, 0.9), ("knee", 0.1, 0.5), ("ankle", 0.1, 0.1)),
    )
    for side, sign in (("left", 1), ("right", -1))
}
BODY = Skeleton(tuple(PLACES), (-1, 0, 0, 1, 2, 0, 0, 5, 6, 7, 8))
COUNT = len(PLACES)
TIMES = np.arange(round(20 * FPS)) / FPS


def standing() -> FloatArray:
    """20 s of a body that faces +z and stands still; to be changed."""
    return np.repeat(np.array(list(PLACES.values()))[None], TIMES.size, axis=0)


def measured(positions: FloatArray, **about: object) -> dict[str, float]:
    return guard.body_measures(Motion(positions, FPS, BODY, **about))


def moved(joint: str, axis: int, course: FloatArray) -> FloatArray:
    """The body with one joint moved along an axis."""
    positions = standing()
    positions[:, BODY.joints.index(joint), axis] += course
    return positions


# The measures


def test_a_joint_that_is_now_here_now_there_is_spread_by_half_the_way() -> None:
    values = measured(moved("left_hand", 1, np.where(np.arange(TIMES.size) % 2, 0.11, -0.11)))
    assert values["spread"] == pytest.approx(11.0 / COUNT)
    assert values["poorest"] == pytest.approx(11.0 / COUNT, rel=0.01)


def test_the_poorest_five_seconds_are_those_at_rest() -> None:
    values = measured(moved("left_hand", 1, np.where(np.abs(TIMES - 10) < 2.6, 0.0, np.sin(5 * TIMES))))
    assert values["poorest"] == pytest.approx(0.0, abs=1e-9)
    assert values["spread"] > 1


def test_the_range_of_the_hands_leaves_out_a_twentieth_at_either_end() -> None:
    triangle = np.abs(2 * (TIMES / 1.93 % 1) - 1)  # even between 0 and 1 m
    assert measured(moved("left_hand", 2, triangle))["hands"] == pytest.approx(0.9 / 2, abs=0.01)  # mean of two hands


@pytest.mark.parametrize(("size", "rate"), [(0.1, 1.0), (0.03, 0.0)])
def test_a_step_is_a_peak_of_the_distance_of_the_ankles_of_eight_centimetres(size: float, rate: float) -> None:
    course = size * (1 - np.cos(2 * np.pi * TIMES)) / 2
    assert measured(moved("left_ankle", 0, course))["steps"] == pytest.approx(rate)


def test_the_nearest_other_two_seconds_of_steady_drift_are_two_seconds_away() -> None:
    assert measured(moved("left_hand", 1, 0.05 * TIMES))["nearest"] == pytest.approx(100 * 0.05 * 2 / COUNT)


@pytest.mark.parametrize("period", [4.0, 4.2, 5.8])
def test_a_loop_of_any_length_repeats_itself(period: float) -> None:
    phase = 2 * np.pi * TIMES / period
    positions = moved("left_hand", 1, np.sin(phase) + 0.5 * np.sin(2 * phase))
    assert measured(positions)["nearest"] == pytest.approx(0.0, abs=1e-6)


def test_the_share_inside_compares_speeds_in_the_body_and_in_the_room() -> None:
    positions = moved("left_hand", 1, 3.0 * TIMES) + 4.0 * TIMES[:, None, None] * np.array([1.0, 0.0, 0.0])
    assert measured(positions)["inside"] == pytest.approx(3.0 / (4.0 * (COUNT - 1) + 5.0))


def test_who_does_not_move_at_all_has_no_share_inside() -> None:
    assert measured(standing())["inside"] == 0


def test_a_body_that_turns_as_one_piece_only_turns() -> None:
    angles = 2 * np.pi * 3 * TIMES / TIMES[-1]
    values = measured(turned(standing(), angles[:, None]))
    assert values["turns"] == pytest.approx(3.0, abs=0.02)  # the ends are smoothed
    assert (values["spread"], values["inside"]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_turns_there_and_back_are_none() -> None:
    angles = 3 * np.sin(2 * np.pi * TIMES / TIMES[-1])
    assert measured(turned(standing(), angles[:, None]))["turns"] == pytest.approx(0.0, abs=0.02)


def test_ankles_are_crossed_where_the_left_one_is_right_of_the_right_one_whatever_the_heading() -> None:
    crossed = TIMES < 5
    values = measured(turned(moved("left_ankle", 0, np.where(crossed, -0.3, 0.0)), 2.0))
    assert [values[name] for name in ("crossed", "ankles", "stride")] == pytest.approx([0.25, 0.2, 0.2])


def test_the_bend_of_a_knee_is_the_angle_between_thigh_and_shin() -> None:
    positions = standing()
    ankles = [BODY.joints.index(f"{side}_ankle") for side in ("left", "right")]
    positions[:, ankles] = [(0.1, 0.5, -0.4), (-0.1, 0.5, -0.4)]
    assert measured(positions)["knees"] == pytest.approx(90.0)
    assert measured(standing())["knees"] == pytest.approx(0.0, abs=1e-3)


def test_jerk_and_skating_are_those_of_the_motion_itself() -> None:
    motion = dancer(0)
    values = guard.body_measures(motion)
    assert (values["jerk"], values["skating"]) == (jerk(motion), foot_skating(motion))


def test_filler_counts_nowhere() -> None:
    values = measured(moved("left_hand", 1, np.where(TIMES < 4, 50.0, 0.0)), valid=TIMES >= 4)
    for name in ("spread", "poorest", "hands", "inside", "nearest", "jerk"):
        assert values[name] == pytest.approx(0.0, abs=1e-6), name


def test_measures_without_their_joints_are_left_out(swinging_arm: Callable[..., Motion]) -> None:
    values = guard.body_measures(swinging_arm(1.0, 30.0, seconds=12.0))
    assert set(values) == {"spread", "poorest", "nearest", "inside", "jerk"}


def test_measures_hardly_depend_on_the_frame_rate() -> None:
    slow, fast = (guard.body_measures(dancer(3, fps=fps)) for fps in (30.0, 60.0))
    for name in MEASURES:
        assert fast[name] == pytest.approx(slow[name], rel=0.1, abs=0.05), name


# Limits


@cache
def dancer(seed: int, *, seconds: float = 30.0, fps: float = 30.0) -> Motion:
    """A synthetic dancer at 112 beats a minute."""
    beats = np.arange(0.4, seconds, 60 / 112)
    return synthetic_motion(beats, beats[::4], dance="cha-cha", seconds=seconds, fps=fps, seed=seed)


@cache
def others() -> LikenessLimits:
    """What synthetic dancers other than number 0 have."""
    return LikenessLimits.of([dancer(seed) for seed in range(1, 9)])


def test_a_pose_that_is_held_on_purpose_counts_nowhere() -> None:
    positions, held = dancer(0).positions.copy(), np.zeros(900, bool)
    positions[300:480], held[300:480] = positions[300], True
    motion = replace(dancer(0), positions=positions)
    assert "poorest" in likeness(motion, limits=others()).fails
    filler, judged = replace(motion, valid=~held), partial(likeness, limits=others())
    assert judged(motion, held=held) == judged(motion, held=held.tolist()) == judged(filler)
    assert judged(filler, held=np.zeros_like(held)) == judged(filler)
    assert likeness(motion, limits=others(), held=np.ones_like(held)).cannot.startswith("too short")


def test_limits_are_the_recorded_ends_with_half_as_much_again() -> None:
    judged = likeness(dancer(0), limits=others())
    for name in MEASURES:
        low, middle, high = others().pooled[name]
        assert low <= middle <= high
        assert judged.least.get(name) == (low / guard.MARGIN if name in guard.LOWER else None)
        assert judged.most.get(name) == (high * guard.MARGIN if name in guard.UPPER else None)


def test_amounts_are_held_against_the_same_dance_and_the_rest_against_all() -> None:
    motions = [dancer(1), dancer(2)]
    limits = LikenessLimits.of(motions, ["waltz", "tango"])
    alone = LikenessLimits.of(motions[:1])
    for name in MEASURES:
        assert limits.reference(name, "waltz") == (alone if name in AMOUNTS else limits).pooled[name]
        assert limits.reference(name, "salsa") == limits.pooled[name]


def test_limits_survive_json() -> None:
    limits = LikenessLimits.of([dancer(1), dancer(2)], ["waltz", ""])
    kept = LikenessLimits.from_dict(json.loads(json.dumps(limits.to_dict())))
    assert (kept.windows, set(kept.dances)) == (2, {"waltz"})
    for name in MEASURES:
        assert kept.pooled[name] == pytest.approx(limits.pooled[name], rel=1e-3)


RANGES = ({"charm": [1, 2, 3]}, {"hands": [3, 2, 1]}, {"hands": [1, 2]}, {"hands": ["a", "b", "c"]})


@cases("content", {}, [], *({"pooled": ranges, "dances": {}, "windows": 1} for ranges in RANGES))
def test_what_is_no_limits_is_refused(content: object) -> None:
    refused("likeness", LikenessLimits.from_dict, content)


def test_nobody_makes_limits_of_nothing() -> None:
    refused("10 s of movement", LikenessLimits.of, [dancer(1, seconds=8.0)])
    refused("names of dances", LikenessLimits.of, [dancer(1)], ["waltz", "tango"])
    refused("three-dimensional", LikenessLimits.of, [still(600, fps=30.0, axes=2)])


def test_shipped_limits_are_of_46_windows_and_all_measures() -> None:
    limits = LikenessLimits.recorded()
    assert (limits.windows, list(limits.pooled)) == (46, list(MEASURES))
    assert set(limits.dances) == {"cha-cha", "rumba", "tango", "waltz"}
    limits.pooled.clear()
    assert LikenessLimits.recorded().pooled  # who changes them changes nobody else's


@pytest.mark.data
def test_shipped_limits_are_what_the_recordings_give(locked) -> None:
    limits = LikenessLimits.of_windows([windows for _, windows in locked], [item.clip.dance for item, _ in locked])
    assert limits.to_dict() == LikenessLimits.recorded().to_dict()


# Who passes


def test_a_dancer_moves_like_other_dancers() -> None:
    judged = likeness(dancer(0), limits=others())
    words = "moves like recorded dancers (13 of 13 measures)"
    assert (judged.passed, judged.fails, judged.verdict) == (True, (), words)


def in_the_body(motion: Motion, change: Callable[[FloatArray], FloatArray]) -> Motion:
    """A motion whose poses (T, J, 3) in the body are changed, on the path of the motion and turning as it turns."""
    body = body_frame(motion.positions, motion.fps, motion.skeleton)
    angles = heading(motion.positions, motion.fps, motion.skeleton, parts=HIPS, smoothing=0.0)[:, None]
    torso = motion.positions - turned(body, angles)
    return replace(motion, positions=turned(change(body), angles) + torso[:, :1])


def spun(motion: Motion, turns: float = 8.0) -> Motion:
    """The whole dance on a turntable that makes so many turns in half a minute."""
    middle = motion.positions.mean(axis=(0, 1))
    angles = np.linspace(0.0, 2 * np.pi * turns * motion.duration / 30.0, motion.n_frames)
    return replace(motion, positions=turned(motion.positions - middle, angles[:, None]) + middle)


def shrunk(body: FloatArray) -> FloatArray:
    return body.mean(axis=0) + 0.35 * (body - body.mean(axis=0))


# The guard must let dancers through, and none of these.
DOCTORED: dict[str, Callable[[Motion], Motion]] = {
    "statue on the recorded path": statue,
    "4 s looped": lambda motion: in_the_body(motion, lambda body: body[np.arange(len(body)) % round(4 * motion.fps)]),
    "movement shrunk to 35 %": lambda motion: in_the_body(motion, shrunk),
    "eight turns added": spun,
}


@cases(
    "change, fails, words",
    ("statue on the recorded path", {*AMOUNTS}, "the body hardly moves"),
    ("4 s looped", {"nearest"}, "the same 2 s come again and again"),
    ("movement shrunk to 35 %", {"spread", "hands", "inside"}, "the body hardly moves"),
    ("eight turns added", {"turns"}, "the body turns round and round"),
)
def test_who_does_not_dance_fails_and_is_told_why(change: str, fails: set[str], words: str) -> None:
    judged = likeness(DOCTORED[change](dancer(0)), limits=others())
    assert judged.passed is False
    assert fails <= set(judged.fails)
    assert judged.verdict.startswith("not meaningful: ")
    assert words in judged.verdict and "0.97" not in judged.verdict


def test_of_a_long_dance_the_worst_window_counts() -> None:
    lively = dancer(0, seconds=90.0)
    positions = lively.positions.copy()
    positions[900:1800] = positions[900]
    judged = likeness(replace(lively, positions=positions), limits=others())
    assert (judged.windows, judged.passed) == (3, False)
    assert judged.values["spread"] == pytest.approx(0.0, abs=1e-6)


def test_windows_cover_a_motion_evenly() -> None:
    motion = dancer(0, seconds=50.0)
    first, last = guard.motion_windows(motion)
    np.testing.assert_array_equal(first.positions, motion.positions[:900])
    np.testing.assert_array_equal(last.positions, motion.positions[-900:])
    assert guard.motion_windows(dancer(0, seconds=31.0)) == (dancer(0, seconds=31.0),)


TOO_SHORT = "too short to be judged: 10 s of movement are needed"


@cases(
    "motion, words",
    (dancer(0).span(0.0, 8.0), f"{TOO_SHORT}, these are 8 s"),
    (replace(dancer(0), valid=np.arange(900) < 240), f"{TOO_SHORT}, these are 8"),
    (still(600, fps=30.0, axes=2), "cannot be judged: places in a picture"),
    (still(600, fps=30.0), "cannot be judged: no joints are named left and right hip"),
)
def test_who_cannot_be_judged_neither_passes_nor_fails(motion: Motion, words: str) -> None:
    judged = likeness(motion)
    assert judged.passed is None and judged.verdict.startswith(words)


def part_of(motion: Motion, *words: str) -> Motion:
    """The joints whose names hold one of these words, without bones."""
    joints = motion.skeleton.joints
    keep = [joint for joint, name in enumerate(joints) if any(word in name for word in words)]
    skeleton = Skeleton(tuple(joints[joint] for joint in keep), (-1,) * len(keep))
    return Motion(motion.positions[:, keep], motion.fps, skeleton)


def test_a_body_without_arms_and_legs_is_asked_what_it_can_answer() -> None:
    judged = likeness(part_of(dancer(0), "hip", "shoulder"), limits=others())
    assert {"hands", "steps", "ankles", "crossed", "stride", "knees", "skating"} == set(judged.missing)
    assert judged.passed is False
    assert "of 6 measures" in judged.verdict and "not asked: hands, steps" in judged.verdict


def test_nobody_passes_where_nothing_is_asked() -> None:
    judged = likeness(part_of(dancer(0), "hip"), limits=LikenessLimits({"hands": (0.4, 0.8, 1.6)}))
    assert judged.passed is None and judged.verdict.startswith("cannot be judged")


# Tables

BEATS = BeatTrack(np.arange(0.4, 30.0, 60 / 112), np.ones(56), 100.0, 30.0)


def test_scores_of_a_dance_that_fails_hide_all_that_speaks_of_harmony() -> None:
    still_body = statue(dancer(0))
    scores = dance_scores(still_body, BEATS, likeness=likeness(still_body, limits=others()))
    assert list(scores)[:2] == ["harmony above chance", "looks like dancing"]
    assert {scores[name] for name in OF_HARMONY} == {"not meaningful"}
    assert str(scores["looks like dancing"]).endswith("of 13")
    assert str(scores["like dancing: range of the hands, m"]).endswith("fails")


def test_scores_of_a_dance_that_passes_keep_it() -> None:
    plain = dance_scores(dancer(0), BEATS)
    scores = dance_scores(dancer(0), BEATS, likeness=likeness(dancer(0), limits=others()))
    assert scores["looks like dancing"] == "13 of 13"
    assert plain.items() <= scores.items()
    low, _, high = others().pooled["hands"]
    assert f"(recorded {low:.3g} to {high:.3g})" in str(scores["like dancing: range of the hands, m"])


@pytest.fixture(scope="session")
def locked(data_root: Path) -> list[tuple[Recording, tuple[dict[str, float], ...]]]:
    """The 23 beat-locked recordings, and what their windows measure."""
    folder = data_root / "beatlocked"
    if not folder.is_dir():
        pytest.skip("no beat-locked recordings")
    recordings = [item for item in iter_recordings(folder) if isinstance(item, Recording)]
    return [(item, guard.window_measures(item.clip.motion)) for item in recordings]


@pytest.mark.data
@pytest.mark.slow
def test_every_recording_passes_against_the_others_and_nothing_else_does(locked) -> None:
    passed: dict[str, list[bool | None]] = {}
    for place, (item, _) in enumerate(locked):
        rest = locked[:place] + locked[place + 1 :]  # no dancer is held against himself
        limits = LikenessLimits.of_windows([each for _, each in rest], [other.clip.dance for other, _ in rest])
        for number, part in enumerate(guard.motion_windows(item.clip.motion)):
            # One window in three is doctored; all are to pass as they are.
            changes = DOCTORED if (place + number) % 3 == 0 else {}
            for name, motion in {"recorded": part, **{name: change(part) for name, change in changes.items()}}.items():
                passed.setdefault(name, []).append(likeness(motion, dance=item.clip.dance, limits=limits).passed)
    assert passed.pop("recorded") == [True] * 46
    assert set(passed) == set(DOCTORED) and {verdict for verdicts in passed.values() for verdict in verdicts} == {False}


# Contact sheets


def test_a_sheet_has_a_figure_every_half_second_and_the_names_of_dances() -> None:
    figure = contact_sheet({"one": dancer(0, seconds=6.0), "other": dancer(1, seconds=3.0)}, columns=8)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts[:13] == ["one", *(f"{moment / 2:g}" for moment in range(12))]
    assert texts[13:] == ["other", *(f"{moment / 2:g}" for moment in range(6))]


def test_times_of_a_fine_sheet_are_hundredths() -> None:
    texts = contact_sheet({"one": dancer(0).span(0.0, 0.5)}, every=1 / 12).axes[0].texts
    assert [text.get_text() for text in texts[1:]] == ["0", "0.08", "0.17", "0.25", "0.33", "0.42"]


def test_a_sheet_goes_along_with_a_dancer_who_travels() -> None:
    motion = dancer(0, seconds=3.0)
    path = np.linspace(0, 9, motion.n_frames)[:, None, None] * np.array([1.0, 0.0, 0.0])
    assert np.allclose(outlines(motion), outlines(replace(motion, positions=motion.positions + path)))


def test_left_and_right_limbs_have_their_colours() -> None:
    people = people_of(Motion(standing(), FPS, BODY), columns=40)
    middles = np.array([path.vertices[:, 0].mean() for path in people.get_paths()]) % CELL[0] - CELL[0] / 2
    hues = people.get_facecolors()[:, 2] - people.get_facecolors()[:, 0]
    # Seen from the front, the dancer's left is at the right.
    assert (PAINTS["left"][2] > PAINTS["left"][0]) and (PAINTS["right"][2] < PAINTS["right"][0])
    assert middles[hues > 0.15].mean() > 0.02 and middles[hues < -0.15].mean() < -0.02


@pytest.mark.parametrize("motion", [still(60, fps=30.0), still(60, fps=30.0, axes=2)])
def test_bodies_without_bones_and_pictures_have_sheets_too(motion: Motion) -> None:
    assert len(contact_sheet({"dots": motion}, every=1.0).axes[0].texts) == 3


def test_a_sheet_of_beats_has_a_person_at_each_beat_that_has_movement_before_it() -> None:
    motion, beats = dancer(0, seconds=3.0), np.array([0.1, 0.5, 1.0, 1.5, 2.0, 3.5])
    figure = beat_sheet({"one": (motion, beats), "other": (motion, beats[2:4])}, count=3)
    for ax, times in zip(figure.axes, ([0.5, 1.0, 1.5], [1.0, 1.5]), strict=True):
        places = [artist.xy[0] for artist in ax.get_children() if isinstance(artist, AnnotationBbox)]
        lines = [line.get_xdata()[0] for line in ax.lines if line.get_gid() == "beat"]
        assert places == lines == times
    refused("two beats each", beat_sheet, {"one": (motion, beats[:2])})
    refused("two beats each", beat_sheet, {})


def test_blind_strips_hide_which_is_made_and_the_answers_tell_it() -> None:
    pairs = [(dancer(seed, seconds=6.0), dancer(seed + 10, seconds=6.0)) for seed in range(8)]
    strips, answers = blind_strips(pairs, np.random.default_rng(0))
    assert list(strips) == [f"{pair} {side}" for pair in range(1, 9) for side in "AB"]
    assert set(answers["made"]) == {"A", "B"} and sorted(answers["place"]) == list(range(8)) != list(answers["place"])
    for row in answers.itertuples():
        other = "AB".replace(row.made, "")
        assert (strips[f"{row.pair} {other}"], strips[f"{row.pair} {row.made}"]) == pairs[row.place]


def test_blind_sheets_and_their_answers_are_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheets, "PAIRS", 2)
    pairs = [(dancer(0).span(0.0, 0.6), dancer(1).span(0.0, 0.6))] * 3
    made = save_blind_sheets(pairs, tmp_path / "new", np.random.default_rng(1))
    assert [path.name for path in made] == ["sheet_1.png", "sheet_2.png"]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["answers.csv", "sheet_1.png", "sheet_2.png"]
    assert (tmp_path / "new" / "answers.csv").read_text("utf-8").splitlines()[0] == "pair,made,place"


def outlines(motion: Motion) -> FloatArray:
    """Corners of all parts of the people on a sheet with six columns."""
    return np.concatenate([path.vertices for path in people_of(motion, columns=6).get_paths()])


def people_of(motion: Motion, columns: int) -> Collection:
    axes = contact_sheet({"": motion}, columns=columns).axes[0]
    (people,) = [item for item in axes.collections if item.get_gid() == "person"]
    return people
