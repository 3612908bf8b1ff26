"""The field's other measures, by hand: of beats, of motion alone, features of motions, distances between their sets."""

from collections.abc import Callable
from dataclasses import replace

import mir_eval.beat
import numpy as np
import pytest
from scipy.linalg import sqrtm

from benchmarks import bench_motion_features
from harmolab.body.skeletons import Skeleton, joint_side
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics import beat_alignment as alignment
from harmolab.metrics import features, quality
from harmolab.metrics.quality import STEP, bone_error, foot_skating, freezing, jerk, largest_step, pfc, relative_jerk
from harmolab.readers.keypoints import COCO_17
from harmolab.score import chance_level, hit_mask, hitting_score
from harmolab.types import Motion
from tests.builders import along_x, cases, refused, track

STEADY = np.arange(1.0, 20.0, 0.5)


def test_beat_alignment_falls_as_a_gaussian_of_the_distance():
    # One beat exact, one a sigma away, one two sigmas away.
    expected = (1 + np.exp(-0.5) + np.exp(-2)) / 3
    assert alignment.beat_align([1.0, 2.05, 3.1], np.array([1.0, 2.0, 3.0]), sigma=0.05) == pytest.approx(expected)


def test_beat_alignment_has_two_directions():
    music, motion = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0])
    assert (alignment.beat_align(motion, music), alignment.beat_align(music, motion)) == (1.0, pytest.approx(0.25))


@cases(
    "message, call, arguments, options",
    (r"queries holds NaN or infinity \(first at index 1\)", alignment.beat_align, ([1.0, np.nan], STEADY), {}),
    ("queries has masked entries", alignment.beat_align, (np.ma.masked_equal([0.5, 1.0], 1.0), STEADY), {}),
    (r"targets must be a list of moments \(B,\), got shape \(1, 38\)", alignment.beat_align, ([], [STEADY]), {}),
    ("queries must be an array of numbers: .*not 'BeatTrack'", alignment.beat_align, (track([1.0]), STEADY), {}),
    *(("must rise", alignment.mir_eval_scores, ([2.0, 1.0], STEADY), {"only": [each]}) for each in ("f", "p_score")),
    ("sigma must be positive, got 0", alignment.beat_align, ([1.0], STEADY), {"sigma": 0}),
    ("visual_times holds NaN", alignment.mir_eval_scores, (STEADY, np.array([np.nan])), {}),
    ("no measure is called recall; there are f, cemgil", alignment.mir_eval_scores, ([], []), {"only": ["recall"]}),
    (r"audio_times holds NaN.*index 1\)", hit_mask, (np.array([1, np.nan]), STEADY), {"delay": 0.1}),
    ("matching must be one of many, nearest, max; got 'one'", hit_mask, ([], []), {"delay": 0.1, "matching": "one"}),
    ("visual_times must be a list of moments", chance_level, (1.0,), {"delay": 0.1, "duration": 2.0}),
    ("duration must be positive, got 0", chance_level, ([1.0],), {"delay": 0.1, "duration": 0}),
    ("delay zero or more, got nan", chance_level, ([1.0],), {"delay": np.nan, "duration": 2.0}),
)
def test_what_are_no_moments_is_refused_by_name(message, call, arguments, options):
    refused(message, call, *arguments, **options)


def test_lists_and_frame_numbers_are_moments_too():
    assert alignment.beat_align(np.array([1, 3], np.uint8), [2, 3], sigma=1) == pytest.approx((1 + np.exp(-0.5)) / 2)
    assert hitting_score(hit_mask([1.0, 2.0], [2.0], delay=0.1), [3.0, 4.0]) == 4.0


def test_hit_rate_counts_motion_beats_near_music_beats():
    assert alignment.beat_hit_rate(np.array([1.1, 2.2, 3.0]), np.array([1.0, 2.0, 3.0])) == pytest.approx(2 / 3)


def test_mir_eval_gives_full_marks_to_the_music_itself():
    expected = {f"mir_eval_{name}": pytest.approx(1.0) for name in alignment.MIR_EVAL_NAMES}
    assert alignment.mir_eval_scores(STEADY, STEADY) == expected


def test_mir_eval_drops_no_beats_of_a_short_clip():
    # Two of four within 70 ms, all in the first five seconds: F = 2 * 2 / (4 + 4).
    assert alignment.mir_eval_scores([1, 2, 3, 4], [1.05, 2.05, 3.3, 4.3], only=("f",)) == {"mir_eval_f": 0.5}


@cases("music, motion", ([], STEADY), (STEADY, []), ([1.0], STEADY), (STEADY, [1.0]), ([4.24, 4.25], [0.3, 1.5, 5.0]))
def test_too_few_beats_score_zero_in_mir_eval(music, motion):
    assert set(alignment.mir_eval_scores(np.array(music), np.array(motion)).values()) == {0.0}


@cases(
    "music, motion",
    ([0.0, 0.5], [0.0, 0.5]),  # means of nothing in Goto's score
    ([0.0, 0.5, 1.0], [0.0, 0.5, 1.0, 1.5]),
    ([0.47, 4.27, 4.53], [0.83, 1.11, 4.23, 4.5]),  # mir_eval's P-score is 1.25 here
    ([1.0, 1.016, 1.031], [1.0, 1.016]),  # and Cemgil's 1.17
)
def test_mir_eval_stays_between_zero_and_one_without_warnings(music, motion):
    for value in alignment.mir_eval_scores(np.array(music), np.array(motion)).values():
        assert 0 <= value <= 1 + 1e-12


def test_the_p_score_is_that_of_mir_eval(rng: np.random.Generator):
    for _ in range(50):
        music, motion = (np.sort(rng.uniform(0, 20, rng.integers(10, 40))) for _ in range(2))
        expected = pytest.approx(min(mir_eval.beat.p_score(music, motion), 1.0))
        assert alignment.mir_eval_scores(music, motion, only=("p_score",))["mir_eval_p_score"] == expected


def test_the_p_score_is_not_the_slow_one_of_mir_eval(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mir_eval.beat, "p_score", None)  # 15 s for ten minutes of music
    assert alignment.mir_eval_scores(STEADY, STEADY)["mir_eval_p_score"] == pytest.approx(1.0)


def test_all_other_scores_come_in_one_dictionary():
    scores = alignment.other_scores(track(STEADY, duration=30.0), track(STEADY[:10] + 0.05, duration=30.0))
    assert scores["beat_align_motion"] == pytest.approx(np.exp(-0.5))  # 0.05 s is AIST++'s sigma
    assert (scores["beat_coverage"], scores["beat_hit_rate"]) == (10 / STEADY.size, 1.0)
    assert scores["mir_eval_f"] == pytest.approx(2 * 10 / (10 + STEADY.size))


LEGS = Skeleton(("hip", "left toe", "left heel", "right toe", "right heel"), (-1, 0, 0, 0, 0))
STANDING = np.array([[0, 0.9, 0], [0.1, 0.02, 0.2], [0.1, 0.03, 0], [-0.1, 0.02, 0.2], [-0.1, 0.03, 0]])


def slow_share(motion: Motion) -> float:
    """`freezing` for dancers who never stand still: share of windows slower than 0.6 m/s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quality, "STILL", 0.6)
        return freezing(motion)


MEASURES: dict[str, Callable[[Motion], float]] = {
    **{measure.__name__: measure for measure in (jerk, relative_jerk, foot_skating, pfc, bone_error)},
    "freezing": lambda motion: slow_share(motion),
    "largest": lambda motion: largest_step(motion).largest,
    "percentile_999": lambda motion: largest_step(motion).percentile_999,
}


def swing(hertz: float, *, fps: float = 60.0, seconds: float = 10.0, reach: float = 0.3) -> Motion:
    return along_x(reach * np.sin(2 * np.pi * hertz * np.arange(round(seconds * fps)) / fps), fps=fps)


def legs(moves: dict[int, np.ndarray], *, fps: float = 30.0, frames: int = 90) -> Motion:
    """Somebody who stands, but for what `moves` adds to the places of joints, (frames, 3)."""
    positions = np.tile(STANDING, (frames, 1, 1))
    for joint, way in moves.items():
        positions[:, joint] += way
    return Motion(positions, fps, LEGS)


def way(*, x: np.ndarray | float = 0.0, y: np.ndarray | float = 0.0, frames: int = 90) -> np.ndarray:
    return np.stack([np.broadcast_to(values, frames) for values in (x, y, 0.0)], axis=1)


SLIDE = 0.4 / 30 * np.arange(90)  # 0.4 m/s at 30 frames per second


@pytest.fixture(scope="module")
def dances() -> dict[float, Motion]:
    """One dance seen at several frame rates."""
    return {fps: synthetic_clip("rumba", seconds=8.0, fps=fps, seed=3).motion for fps in (15, 25, 30, 60, 90)}


# Jerk


def test_the_jerk_of_a_swing_is_that_of_its_third_difference():
    # A sine's third difference over s is a sine (2 sin(pi f s))^3 as wide; the mean of |sine| is 2 / pi.
    expected = 0.3 * (2 * np.sin(np.pi * 1.5 * STEP)) ** 3 / STEP**3 * 2 / np.pi
    assert jerk(swing(1.5)) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("reach", [0.1, 0.5])
def test_relative_jerk_is_the_same_for_wide_and_narrow_swings(reach: float):
    expected = (2 * np.sin(np.pi * 1.5 * STEP) / STEP) ** 2
    assert relative_jerk(swing(1.5, reach=reach)) == pytest.approx(expected, rel=0.01)


def test_relative_jerk_of_a_still_dancer_is_zero():
    assert relative_jerk(legs({})) == 0.0


# Freezing


def test_a_dancer_who_stops_half_way_is_frozen_in_the_windows_after():
    # 4 s at 0.5 m/s, then 4 s still, at 15 fps: 105 windows of 15 steps fit into 119, 45 of them into the last 59.
    x = np.concatenate([0.5 / 15 * np.arange(60), np.full(60, 0.5 / 15 * 59)])
    assert freezing(along_x(x, fps=15)) == pytest.approx(46 / 105)


def test_slow_movement_is_still_below_the_threshold_only():
    slow, slower = (along_x(speed / 30 * np.arange(90), fps=30) for speed in (0.12, 0.08))
    assert (freezing(slow), freezing(slower)) == (0.0, 1.0)


def test_a_pause_shorter_than_the_window_is_no_freezing():
    short, long = (np.concatenate([np.arange(30), np.full(rest, 29), np.arange(29, 60)]) / 30 for rest in (15, 45))
    assert freezing(along_x(short, fps=30)) == 0.0
    assert freezing(along_x(long, fps=30)) > 0


def test_a_motion_shorter_than_the_window_is_one_window():
    assert freezing(legs({}, frames=10)) == 1.0


# Feet


@cases("sliding, speed", (range(5), pytest.approx(0.4)), ((1, 2), pytest.approx(0.2)), ((2,), 0.0))
@pytest.mark.parametrize("frames", [3, 90])
def test_feet_skate_at_the_speed_they_slide_with_one_of_two_by_half_and_one_on_its_ball_not(sliding, speed, frames):
    slide = way(x=SLIDE[:frames], frames=frames)
    assert foot_skating(legs(dict.fromkeys(sliding, slide), frames=frames)) == speed


def test_a_foot_in_the_air_may_move():
    # The left foot is lifted by 10 cm for two of three seconds, and moves only then.
    lift = np.where(np.arange(90) < 60, 0.1, 0.0)
    forward = np.minimum(SLIDE, SLIDE[55])
    assert foot_skating(legs(dict.fromkeys((1, 2), way(x=forward, y=lift)))) == pytest.approx(0, abs=1e-5)


def test_physical_foot_contact_is_that_of_edge(rng: np.random.Generator):
    positions = np.cumsum(rng.normal(0, 0.01, (60, 5, 3)), axis=0)
    # EDGE's code frame by frame at 30 fps, y up: foot speeds in metres per frame, times 10^4.
    products, pushes = [], []
    for t in range(58):
        push = (positions[t + 2, 0] - 2 * positions[t + 1, 0] + positions[t, 0]) * 30**2
        pushes.append(np.linalg.norm([push[0], max(push[1], 0.0), push[2]]))
        speeds = [np.linalg.norm((positions[t + 2, j] - positions[t + 1, j])[[0, 2]]) for j in range(1, 5)]
        products.append(min(speeds[:2]) * min(speeds[2:]))
    published = np.mean(np.array(products) * pushes) / max(pushes) * 1e4
    assert pfc(Motion(positions, 30.0, LEGS), step=1 / 30) * 1e4 / 30**2 == pytest.approx(published)


def test_a_foot_that_stands_makes_all_pushing_plausible(rng: np.random.Generator):
    assert pfc(legs({0: rng.normal(0, 0.02, (90, 3)), 3: way(x=SLIDE), 4: way(x=SLIDE)})) == 0.0


def test_falling_needs_no_foot():
    falling = way(y=-4.9 * (np.arange(90) / 30) ** 2)
    assert pfc(legs(dict.fromkeys(range(5), falling + way(x=SLIDE)))) == pytest.approx(0, abs=1e-12)


# Bones and jumps


def test_a_bone_a_tenth_too_long_is_an_error_of_a_tenth(swinging_arm: Callable[..., Motion]):
    arm = swinging_arm(1.0, 30.0)
    assert bone_error(arm) == pytest.approx(0, abs=1e-12)
    assert bone_error(arm, [0.0, 0.3, 0.3]) == pytest.approx(0, abs=1e-12)
    assert bone_error(arm, [0.0, 0.3, 0.3 / 1.1]) == pytest.approx(0.1)
    assert bone_error(arm, [0.0, 0.0, 0.3]) == pytest.approx(0, abs=1e-12)  # 0 leaves a bone out


def test_one_bad_frame_is_enough_for_a_bone_error(swinging_arm: Callable[..., Motion]):
    arm = swinging_arm(1.0, 30.0)
    positions = arm.positions.copy()
    positions[7, 2] += 0.2 * (positions[7, 2] - positions[7, 1])
    broken = replace(arm, positions=positions)
    assert bone_error(broken, [0, 0.3, 0.3]) == pytest.approx(0.2)
    masked = replace(broken, valid=np.arange(broken.n_frames) != 7)
    assert bone_error(masked, [0, 0.3, 0.3]) == pytest.approx(0, abs=1e-9)


ONE_FOOT = replace(LEGS, joints=("hip", "left toe", "left heel", "left knee", "neck"))


@cases(
    "message, call",
    ("must be positive", lambda: jerk(legs({}), step=0.0)),
    ("must be positive", lambda: largest_step(legs({}), step=np.nan)),
    ("no joint is called toe, heel, ankle or foot", lambda: foot_skating(swing(1.0))),
    ("two feet are needed", lambda: pfc(replace(legs({}), skeleton=ONE_FOOT))),
    ("no window of 1 s is valid for half", lambda: freezing(replace(legs({}), valid=np.arange(90) % 6 < 3))),
    ("needs a skeleton with bones", lambda: bone_error(swing(1.0))),
    ("no frame of the motion is valid", lambda: bone_error(replace(legs({}), valid=np.zeros(90, bool)))),
    ("one per joint", lambda: bone_error(legs({}), [0.3, 0.3])),
    ("finite and not negative", lambda: bone_error(legs({}), [0, -0.3, 0.3, 0.3, 0.3])),
    ("finite and not negative", lambda: bone_error(legs({}), [0, np.nan, 0.3, 0.3, 0.3])),
    ("no bone", lambda: bone_error(legs({}), [0] * 5)),
)
def test_what_cannot_be_measured_is_refused(message: str, call: Callable[[], float]):
    refused(message, call)


def test_a_jump_is_the_largest_step_but_not_the_usual_one():
    x = 0.5 / 15 * np.arange(1500)
    x[700:] += 0.4
    steps = largest_step(along_x(x, fps=15))
    assert (steps.largest, steps.percentile_999) == (pytest.approx(0.5 + 0.4 * 15), pytest.approx(0.5))


# All of them


@pytest.mark.parametrize("name", MEASURES)
@pytest.mark.parametrize("fps", [15, 25, 30, 90])
def test_the_frame_rate_does_not_matter(dances: dict[float, Motion], name: str, fps: float):
    expected = MEASURES[name](dances[60])
    assert expected > 0
    assert MEASURES[name](dances[fps]) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("name", MEASURES)
def test_the_place_in_the_room_does_not_matter(dances: dict[float, Motion], name: str):
    moved = replace(dances[30], positions=dances[30].positions + np.array([5.0, 2.0, -7.0]))
    assert MEASURES[name](moved) == pytest.approx(MEASURES[name](dances[30]), rel=1e-9)


@pytest.mark.parametrize("name", sorted(set(MEASURES) - {"bone_error"}))
def test_fillers_do_not_count(name: str):
    # Two seconds of a dance, then a leap to another place in frames that are marked as filler.
    dance = legs(dict.fromkeys(range(5), way(x=0.1 * np.sin(np.arange(90) / 3), y=0.1 * np.cos(np.arange(90) / 4))))
    positions = dance.positions.copy()
    positions[60:] += np.linspace(0, 50, 30)[:, None, None]
    leap = replace(dance, positions=positions, valid=np.arange(90) < 60)
    short = replace(dance, positions=dance.positions[:60], valid=None)
    assert MEASURES[name](leap) == pytest.approx(MEASURES[name](short))


@pytest.mark.parametrize("name", sorted(MEASURES))
def test_frames_that_were_lost_and_are_zero_do_not_move_those_beside_them(dances: dict[float, Motion], name: str):
    lines, valid = dances[30].positions.copy(), np.ones(240, bool)
    valid[100:110] = False
    lines[99:111] = np.linspace(lines[99], lines[110], 12)
    zeros = np.where(valid[:, None, None], lines, 0.0)
    bridged, lost = (replace(dances[30], positions=positions, valid=valid) for positions in (lines, zeros))
    assert MEASURES[name](lost) == pytest.approx(MEASURES[name](bridged), rel=1e-9)


@pytest.mark.parametrize("name", sorted(set(MEASURES) - {"bone_error"}))
def test_flat_short_and_invalid_motions_are_refused(name: str):
    motion = legs({})
    refused("three-dimensional", MEASURES[name], replace(motion, positions=motion.positions[..., :2]))
    refused("too short", MEASURES[name], replace(motion, positions=motion.positions[:2], valid=None))
    refused("nowhere valid", MEASURES[name], replace(motion, valid=np.zeros(90, bool)))


def test_a_splice_does_not_hide_that_nobody_moves():
    # Every second a filler of a third of a second, in which the pose leaps.
    filler = np.arange(90) % 30 >= 20
    leaping = legs(dict.fromkeys(range(5), way(x=np.where(filler, 0.5, 0.0))))
    assert freezing(replace(leaping, valid=~filler)) == 1.0
    assert freezing(leaping) == 0.0


SMPL_24: Skeleton = bench_motion_features.SMPL_24


def somebody(places: dict[str, tuple[float, float, float]] | None = None, velocities: dict | None = None) -> Motion:
    """A tenth of a second of somebody who stands facing +z, some joints elsewhere or moving (metres per second)."""
    standing, velocity = bench_motion_features.STANDING.copy(), np.zeros((24, 3))
    for name, place in (places or {}).items():
        standing[SMPL_24.joints.index(name)] = place
    for name, way in (velocities or {}).items():
        velocity[SMPL_24.joints.index(name)] = way
    return Motion(standing + np.arange(6)[:, None, None] / 60 * velocity, 60.0, SMPL_24)


def true_features(motion: Motion, **settings: str) -> set[str]:
    """The features that are true in every frame; none may be true in some only."""
    shares = features.geometric_features(motion, **settings)
    assert set(shares) <= {0.0, 1.0}
    return {name for name, share in zip(features.GEOMETRIC_FEATURES, shares, strict=True) if share}


def mirrored(motion: Motion) -> Motion:
    """The motion as a mirror shows it: x reversed, left and right exchanged."""
    names = motion.skeleton.joints
    other = {"l": "r", "r": "l"}
    sided = {name: other[name[0]] + name[1:] for name in names if name[0] in "lr" and name != "root"}
    order = [names.index(sided.get(name, name)) for name in names]
    return replace(motion, positions=motion.positions[:, order] * np.array([-1.0, 1.0, 1.0]))


def exchanged(name: str) -> str:
    """The same feature of the other side."""
    return name.replace("right", "?").replace("left", "right").replace("?", "left")


POSES = {
    "right hand above neck": {"rwrist": (-0.35, 1.7, 0)},
    "right elbow bent": {"rwrist": (-0.2, 1.35, 0.1)},
    "hands far apart sideways": {"rwrist": (-0.5, 0.93, 0), "lwrist": (0.5, 0.93, 0)},
    "right foot behind left leg": {"rankle": (-0.1, 0.2, -0.4)},
    "right foot raised": {"rankle": (-0.1, 0.4, 0)},
    "feet far apart sideways": {"rankle": (-0.3, 0.08, 0), "lankle": (0.3, 0.08, 0)},
    "right knee bent": {"rankle": (-0.09, 0.25, 0.29), "rtoes": (-0.09, 0.2, 0.3), "rknee": (-0.09, 0.5, 0.45)},
    "right upper arm abducted": {"relbow": (-0.4, 1.25, 0), "rwrist": (-0.4, 1.0, 0)},
    "right thigh abducted": {"rknee": (-0.45, 0.65, 0)},
    "root behind frontal plane": {"root": (0, 0.95, -0.2)},
    "spine horizontal": {"neck": (0, 0.95, 0.5), "chest": (0, 0.95, 0.3), "belly": (0, 0.95, 0.1)},
    "right hand low": {"rwrist": (-0.3, 0.2, 0.1)},
}


def test_nothing_is_true_of_somebody_who_stands_still():
    assert true_features(somebody()) == set()


@pytest.mark.parametrize("name", POSES)
def test_a_pose_makes_its_feature_true(name: str):
    assert name in true_features(somebody(POSES[name]))
    assert exchanged(name) in true_features(mirrored(somebody(POSES[name])))


SPEED = 0.6  # metres per second; upper arms of 25.6 cm want 0.46 to move, 0.36 to approach, 0.64 to be fast
MOVES = {
    "right hand moves forward": {"rwrist": (0, 0, SPEED)},
    "right hand moves up": {"rwrist": (0, SPEED, 0)},
    "hands approach each other": {"rwrist": (SPEED / 2, 0, 0), "lwrist": (-SPEED / 2, 0, 0)},
    "right hand leaves root": {"rwrist": (-SPEED, 0, 0)},
}


@pytest.mark.parametrize("name", MOVES)
def test_a_movement_makes_its_feature_true_and_the_opposite_one_does_not(name: str):
    assert true_features(somebody(velocities=MOVES[name])) == {name}
    assert true_features(mirrored(somebody(velocities=MOVES[name]))) == {exchanged(name)}
    backward = {joint: tuple(-part for part in way) for joint, way in MOVES[name].items()}
    assert name not in true_features(somebody(velocities=backward))


@cases("joint, name", ("rwrist", "right hand fast"), ("lankle", "left foot fast"), ("root", "root fast"))
def test_what_moves_faster_than_its_limit_is_fast(joint: str, name: str):
    assert name in true_features(somebody(velocities={joint: (0, 0.7, 0)}))
    assert name not in true_features(somebody(velocities={joint: (0, 0.55, 0)}))


def test_somebody_who_is_carried_is_fast_but_moves_no_limb():
    carried = somebody(velocities=dict.fromkeys(SMPL_24.joints, (0.0, 0.0, 1.0)))
    fast = {"right hand fast", "left hand fast", "right foot fast", "left foot fast", "root fast"}
    assert true_features(carried) == fast


def test_the_mirrored_dance_has_the_features_of_the_other_side():
    dance = bench_motion_features.moving_body(4.0)
    names = features.GEOMETRIC_FEATURES
    own, other = (dict(zip(names, features.geometric_features(m), strict=True)) for m in (dance, mirrored(dance)))
    assert other == {name: own[exchanged(name)] for name in names}


# The published form


def test_the_published_form_is_that_of_plain_loops():
    dance = bench_motion_features.moving_body(1.5)
    looped = bench_motion_features.loop_geometric(dance.positions)
    np.testing.assert_allclose(features.geometric_features(dance, form="aist++"), looped, atol=1e-12)


# What must not matter


@pytest.mark.parametrize("form", ["fixed", "aist++"])
def test_place_and_heading_do_not_matter(form: str):
    dance = bench_motion_features.moving_body(4.0)
    turn = np.array([[np.cos(2), 0, np.sin(2)], [0, 1, 0], [-np.sin(2), 0, np.cos(2)]])
    moved = replace(dance, positions=dance.positions @ turn + np.array([5.0, 3.0, -2.0]))
    both = (features.geometric_features(motion, form=form) for motion in (moved, dance))
    np.testing.assert_allclose(*both, atol=5e-3)


def test_the_size_of_the_dancer_does_not_matter():
    dance = bench_motion_features.moving_body(4.0)
    child = replace(dance, positions=0.6 * dance.positions)
    np.testing.assert_allclose(features.geometric_features(child), features.geometric_features(dance), atol=5e-3)


@pytest.mark.parametrize("fps", [15, 25, 30, 90, 120])
def test_the_frame_rate_does_not_matter_for_relations(fps: float):
    def found(rate: float) -> np.ndarray:
        return features.geometric_features(synthetic_clip("cha-cha", seconds=8.0, fps=rate, seed=1).motion)

    assert np.count_nonzero(found(60)) > 10
    np.testing.assert_allclose(found(fps), found(60), atol=0.02)


def test_fillers_make_no_relations():
    bent = somebody(POSES["right elbow bent"])
    motion = Motion(np.concatenate([bent.positions, somebody().positions]), 60.0, SMPL_24, np.arange(12) < 6)
    # Upper arm and shoulders are the same in both halves.
    np.testing.assert_array_equal(features.geometric_features(motion), features.geometric_features(bent))


# Joints


def joint_weights(skeleton: Skeleton) -> dict[str, dict[str, float]]:
    """Which joints make each point, and how much."""
    rows = zip(features.BODY_POINTS, features.body_points(skeleton), strict=True)
    return {point: {skeleton.joints[j]: float(row[j]) for j in np.flatnonzero(row)} for point, row in rows}


@pytest.mark.parametrize("skeleton", [TANG_23, PAPER_21])
def test_points_of_the_recordings_are_found(skeleton: Skeleton):
    found = joint_weights(skeleton)
    assert (found["lwrist"], found["rwrist"]) == ({"left_hand": 1.0}, {"right_wrist": 1.0})
    assert (found["ltoes"], found["belly"]) == ({"left_toe": 1.0}, {"torso": 1.0})
    assert found["root"] == {"left_hip": 0.5, "right_hip": 0.5}
    assert found["neck"] == {"left_shoulder": 0.5, "right_shoulder": 0.5}
    assert found["chest"] == {"torso": 0.5, "left_shoulder": 0.25, "right_shoulder": 0.25}


def test_points_of_smpl_are_found_under_both_of_its_namings():
    words = "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot "
    words += "right_foot neck left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow "
    words += "left_wrist right_wrist left_hand right_hand"
    renamed = Skeleton(tuple(words.split()), SMPL_24.parents)
    np.testing.assert_array_equal(features.body_points(renamed), features.body_points(SMPL_24))


def test_points_of_a_bvh_file_are_found():
    words = "Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase Spine Spine1 Neck "
    words += "Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm RightForeArm RightHand"
    found = joint_weights(Skeleton(tuple(words.split()), (-1,) * 21))
    first = {point: next(iter(joints)) for point, joints in found.items()}
    expected = {"root": "Hips", "belly": "Spine", "chest": "Spine1", "lshoulder": "LeftArm", "lelbow": "LeftForeArm"}
    expected |= {"lwrist": "LeftHand", "rhip": "RightUpLeg", "rknee": "RightLeg", "rankle": "RightFoot"}
    assert first == first | expected | {"rtoes": "RightToeBase"}


@cases(
    "words, knee, points",
    ("root pelvis spine_01 spine_03 neck_01 thigh_l foot_l upperarm_l lowerarm_l hand_l ball_l", "calf_l",
     {"root": "pelvis", "belly": "spine_01", "chest": "spine_03", "neck": "neck_01", "ltoes": "ball_l"}),
    ("B_Pelvis B_Spine B_Spine1 B_Neck B_L_Thigh B_L_Foot B_L_UpperArm B_L_Forearm B_L_Hand B_L_Toe0", "B_L_Calf",
     {"root": "B_Pelvis", "chest": "B_Spine1", "ltoes": "B_L_Toe0"}),
    ("B_Pelvis B_Waist B_Spine01 B_Spine02 B_L_Thigh B_L_Foot B_L_Upperarm B_L_Forearm B_L_Hand B_L_ToeBase",
     "B_L_Calf", {"root": "B_Pelvis", "belly": "B_Waist", "chest": "B_Spine02"}),
)  # fmt: skip
@pytest.mark.parametrize("rig", ["Bip01_", "CC_Base_"])
def test_points_of_the_rigs_of_unreal_3ds_max_and_character_creator_are_found(rig: str, words, knee, points):
    left = [name.replace("B_", rig) for name in (*words.split(), knee)]
    right = [name.replace("_L_", "_R_") if "_L_" in name else f"{name[:-2]}_r" for name in left if joint_side(name)]
    found = joint_weights(Skeleton((*left, *right), (-1,) * (len(left) + len(right))))
    expected = {point: {name.replace("B_", rig): 1.0} for point, name in {**points, "lknee": knee}.items()}
    assert found == found | expected


def test_missing_joints_are_named():
    dance = Motion(np.zeros((30, 17, 3)), 60.0, COCO_17)
    refused("no joint is called belly, chest, ltoes, rtoes, or alike", features.geometric_features, dance)


def test_one_foot_joint_a_leg_is_not_both_ankle_and_toes():
    words = [name.replace("lankle", "left foot") for name in SMPL_24.joints if name != "ltoes"]
    refused("no joint is called ltoes, or alike", features.body_points, Skeleton(tuple(words), (-1,) * 23))


@cases(
    "change, message",
    (lambda motion: replace(motion, positions=motion.positions[..., :2]), "three-dimensional"),
    (lambda motion: replace(motion, positions=motion.positions[:2], valid=None), "too short"),
    (lambda motion: replace(motion, valid=np.arange(6) % 2 == 0), "nowhere valid for 2 steps"),
)
def test_flat_short_and_invalid_motions_have_no_relations(change: Callable[[Motion], Motion], message: str):
    refused(message, features.geometric_features, change(somebody()))


@pytest.mark.slow
def test_a_body_without_extent_has_no_relations():
    assert true_features(Motion(np.zeros((30, 24, 3)), 60.0, SMPL_24)) == set()


TWO = Skeleton(("still", "moving"), (-1, 0))
SIXTIETH = 1 / 60


def second_joint(x: np.ndarray, y: np.ndarray, z: np.ndarray, fps: float = 60.0) -> Motion:
    """A joint that rests at the origin, and one that moves."""
    moving = np.stack([x, y, z], axis=1)
    return Motion(np.stack([np.zeros_like(moving), moving], axis=1), fps, TWO)


def test_a_joint_at_constant_velocity_has_energy_and_spends_none():
    t = np.arange(120) / 60
    own = features.kinetic_features(second_joint(3 * t, 2 * t, 4 * t))
    np.testing.assert_allclose(own, [0, 0, 0, 25, 4, 0], rtol=1e-9, atol=1e-9)


def test_a_swing_has_the_energy_and_acceleration_of_means_over_five_steps():
    # The mean of five velocities is the way over five steps, 2 sin(5 pi f / 60) wide, by their time; that of five
    # accelerations the change of a velocity over them. Means over time: 1/2 for sin^2, 2 / pi for |sin|.
    f, t = 1.5, np.arange(3600) / 60
    found = features.kinetic_features(second_joint(0.2 * np.sin(2 * np.pi * f * t), 0 * t, 0 * t))
    window = 2 * np.sin(5 * np.pi * f * SIXTIETH) / (5 * SIXTIETH)
    assert found[3] == pytest.approx((0.2 * window) ** 2 / 2, rel=2e-3)
    assert found[5] == pytest.approx(0.2 * window * 2 * np.sin(np.pi * f * SIXTIETH) / SIXTIETH * 2 / np.pi, rel=2e-3)


def test_the_published_form_moves_with_the_place_in_the_room_and_ours_does_not():
    dance = bench_motion_features.moving_body(2.0)
    moved = replace(dance, positions=dance.positions + np.array([4.0, 0.0, -3.0]))
    np.testing.assert_allclose(features.kinetic_features(moved), features.kinetic_features(dance), rtol=1e-8)
    expenditure = slice(2, None, 3)
    change = features.kinetic_features(moved, form="aist++") / features.kinetic_features(dance, form="aist++")
    assert (change[expenditure] > 1.5).all()


@pytest.mark.parametrize("frames", [3, 4, 6, 7, 60])
def test_both_forms_are_those_of_plain_loops(frames: int):
    dance = bench_motion_features.moving_body(frames / 60)
    published = bench_motion_features.loop_kinetic(dance.positions)
    np.testing.assert_allclose(features.kinetic_features(dance, form="aist++"), published, rtol=1e-9)
    ours, theirs = (np.delete(each, slice(2, None, 3)) for each in (features.kinetic_features(dance), published))
    np.testing.assert_allclose(ours, theirs)


@pytest.mark.parametrize("fps", [15, 25, 30, 90, 120])
def test_the_frame_rate_does_not_matter_for_energies(fps: float):
    def found(rate: float) -> np.ndarray:
        return features.kinetic_features(synthetic_clip("rumba", seconds=8.0, fps=rate, seed=3).motion)

    # At 15 frames per second splines must guess the quickest accelerations.
    np.testing.assert_allclose(found(fps), found(60), rtol=0.06 if fps == 15 else 0.03, atol=2e-3)


def test_fillers_have_no_energy():
    t = np.arange(120) / 60
    leap = np.where(np.arange(120) < 60, t, 100 * t)
    motion = replace(second_joint(leap, 0 * t, 0 * t), valid=np.arange(120) < 60)
    np.testing.assert_allclose(features.kinetic_features(motion), [0, 0, 0, 1, 0, 0], atol=1e-9)


def test_flat_short_and_invalid_motions_have_no_energies():
    t = np.arange(30) / 60
    motion = second_joint(t, t, t)
    refused("three-dimensional", features.kinetic_features, replace(motion, positions=motion.positions[..., :2]))
    short = replace(motion, positions=motion.positions[:2], valid=None)
    refused(r"lasts 0.033 s, too short", features.kinetic_features, short)
    refused("nowhere valid for 1/12 s", features.kinetic_features, replace(motion, valid=np.arange(30) % 4 != 0))


distance = features.frechet_distance


def test_distance_is_that_of_the_matrix_root(rng: np.random.Generator):
    a, b = rng.normal(size=(60, 6)) @ rng.normal(size=(6, 6)), rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6))
    covariances = np.cov(a.T), np.cov(b.T)
    root = sqrtm(covariances[0] @ covariances[1]).real
    expected = ((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(covariances[0] + covariances[1] - 2 * root)
    assert distance(a, b, correct_bias=False).raw == pytest.approx(expected)


def test_shifting_both_sides_changes_nothing(rng: np.random.Generator):
    a, b = rng.normal(size=(30, 3)), rng.normal(size=(40, 3))
    assert distance(a + 1e3, b + 1e3).value == pytest.approx(distance(a, b).value, abs=1e-8)


def test_fewer_samples_than_features_give_a_finite_distance(rng: np.random.Generator):
    a = rng.normal(size=(5, 64))
    assert distance(a, a, correct_bias=False).raw == pytest.approx(0.0, abs=1e-9)
    assert distance(a, rng.normal(size=(5, 64)), correct_bias=False).raw > 1


def test_constant_features_are_no_obstacle():
    a = np.tile([1.0, 2.0], (10, 1))
    assert distance(a, a + 1.0) == features.FrechetResult(2.0, 10, 10, 2.0)


@pytest.mark.parametrize(("size_a", "size_b"), [(60, 60), (40, 120), (200, 200)])
def test_two_samples_of_one_distribution_are_nothing_apart_once_corrected(size_a: int, size_b: int):
    rng = np.random.default_rng(4)
    results = [distance(rng.normal(size=(size_a, 16)), rng.normal(size=(size_b, 16))) for _ in range(40)]
    raw, values = np.mean([result.raw for result in results]), np.array([result.value for result in results])
    assert raw > 0.8
    # The mean of 40 estimates lies within three standard errors of 0, and a tenth of the bias at most is left.
    assert abs(values.mean()) < max(3 * values.std() / np.sqrt(40), 0.1 * raw)


def test_the_correction_keeps_a_distance_that_is_there():
    # |0.5|^2 in 12 features and an SD of 1.5 for 1: 3 + 12 * 0.25 = 6.
    rng = np.random.default_rng(5)
    results = [distance(rng.normal(size=(80, 12)), rng.normal(0.5, 1.5, size=(80, 12)), seed=i) for i in range(40)]
    assert np.mean([result.value for result in results]) == pytest.approx(6.0, rel=0.05)
    assert np.mean([result.raw for result in results]) > 7


def test_the_same_seed_gives_the_same_value(rng: np.random.Generator):
    a, b = rng.normal(size=(30, 3)), rng.normal(size=(20, 3))
    assert distance(a, b, seed=3) == distance(a, b, seed=3)
    assert distance(a, b, seed=3).value != distance(a, b, seed=4).value


GOOD = np.arange(12.0).reshape(6, 2) % 5


@pytest.mark.slow
@cases(
    "message, call",
    (r"features_a must be \(samples, features\), got shape \(6,\)", lambda: distance(GOOD[:, 0], GOOD)),
    ("features_a must be", lambda: distance(np.zeros((6, 0)), np.zeros((6, 0)))),
    ("features_a must have at least 4 rows, got 3", lambda: distance(GOOD[:3], GOOD)),
    ("features_b must have at least 4 rows, got 0", lambda: distance(GOOD, np.zeros((0, 2)))),
    ("features_b holds NaN", lambda: distance(GOOD, np.where(GOOD == 4, np.nan, GOOD))),
    ("features_b must be an array of numbers: real ones", lambda: distance(GOOD, GOOD * 1j)),
    ("same columns, got 2 and 1", lambda: distance(GOOD, GOOD[:, :1])),
    ("at least 2 rows, got 1", lambda: distance([[0.0]], [[3.0], [5.0]], correct_bias=False)),
    ("same columns, got 1 and 2", lambda: features.standardise([[1.0]], [[1.0, 2.0]])),
    ("at least 2 rows", lambda: features.diversity([[1.0, 2.0]])),
    ("one song at least", lambda: features.multimodality([])),
    ("at least 2 rows", lambda: features.multimodality([[[1.0], [2.0]], [[1.0]]])),
    ("form must be fixed or aist", lambda: features.geometric_features(somebody(), form="published")),
)
def test_unfit_features_are_refused_by_name(message: str, call: Callable[[], float]):
    refused(message, call)


@pytest.mark.slow
def test_standardised_features_are_in_units_of_the_reference():
    reference = np.array([[0.0, 7.0], [2.0, 7.0]])  # mean 1, SD 1; a column that never changes
    np.testing.assert_allclose(features.standardise([[3.0, 8.0]], reference), [[2.0, 1.0]])


def test_errors_of_rounding_are_no_unit():
    reference = np.array([[0.0, 1e-31], [2.0, 3e-31]])  # a joint that rests beside one that moves
    np.testing.assert_allclose(features.standardise([[3.0, 1e-3]], reference), [[2.0, 1e-3]])


def test_diversity_is_the_mean_distance_of_pairs():
    # Pairs of the corners of a 3-4-5 triangle.
    assert features.diversity([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]) == pytest.approx(4.0)


def test_multimodality_is_the_mean_over_songs_of_the_diversity_within():
    songs = [[[0.0], [1.0]], [[10.0], [13.0]]]  # 1 apart, 3 apart; how far the songs are apart does not count
    assert features.multimodality(songs) == 2.0
