"""Measures of motion alone: worked out by hand, the same at every frame rate, the same everywhere in the room."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics.quality import STEP, bone_error, foot_skating, freezing, jerk, largest_step, pfc, relative_jerk
from harmolab.types import Motion
from tests.builders import along_x, cases, refused

LEGS = Skeleton(("hip", "left toe", "left heel", "right toe", "right heel"), (-1, 0, 0, 0, 0))
STANDING = np.array([[0, 0.9, 0], [0.1, 0.02, 0.2], [0.1, 0.03, 0], [-0.1, 0.02, 0.2], [-0.1, 0.03, 0]])

MEASURES: dict[str, Callable[[Motion], float]] = {
    "jerk": jerk,
    "relative_jerk": relative_jerk,
    "freezing": lambda motion: freezing(motion, threshold=0.6),
    "foot_skating": foot_skating,
    "pfc": pfc,
    "bone_error": bone_error,
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


def test_over_short_steps_jerk_is_the_third_derivative():
    assert jerk(swing(1.5, fps=600), step=1 / 600) == pytest.approx(0.3 * (3 * np.pi) ** 3 * 2 / np.pi, rel=0.01)


def test_constant_acceleration_has_no_jerk():
    assert jerk(along_x(4.9 * (np.arange(60) / 30) ** 2, fps=30)) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("reach", [0.1, 0.5])
def test_relative_jerk_is_the_same_for_wide_and_narrow_swings(reach: float):
    assert relative_jerk(swing(1.5, reach=reach)) == pytest.approx(
        (2 * np.sin(np.pi * 1.5 * STEP) / STEP) ** 2, rel=0.01
    )


def test_relative_jerk_of_a_still_dancer_is_zero():
    assert relative_jerk(legs({})) == 0.0


def test_trembling_raises_jerk(rng: np.random.Generator):
    smooth = swing(1.0, fps=15)
    trembling = replace(smooth, positions=smooth.positions + rng.normal(0, 0.01, smooth.positions.shape))
    assert jerk(trembling) > 3 * jerk(smooth)


# Freezing


def test_a_dancer_who_stops_half_way_is_frozen_in_the_windows_after():
    # 4 s at 0.5 m/s, then 4 s still, at 15 fps: 105 windows of 15 steps fit into 119, 45 of them into the last 59.
    x = np.concatenate([0.5 / 15 * np.arange(60), np.full(60, 0.5 / 15 * 59)])
    assert freezing(along_x(x, fps=15)) == pytest.approx(46 / 105)


def test_slow_movement_is_still_below_the_threshold_only():
    creeping = along_x(0.08 / 30 * np.arange(90), fps=30)
    assert freezing(creeping, threshold=0.1) == 1.0
    assert freezing(creeping, threshold=0.05) == 0.0


def test_a_pause_shorter_than_the_window_is_no_freezing():
    x = np.concatenate([np.arange(30), np.full(15, 29), np.arange(29, 60)]) / 30.0
    assert freezing(along_x(x, fps=30), window=1.0) == 0.0
    assert freezing(along_x(x, fps=30), window=0.3) > 0


def test_a_motion_shorter_than_the_window_is_one_window():
    assert freezing(legs({}, frames=10)) == 1.0


# Feet


def test_sliding_feet_skate_at_the_speed_they_slide_with():
    assert foot_skating(legs(dict.fromkeys(range(5), way(x=SLIDE)))) == pytest.approx(0.4)


def test_one_sliding_foot_of_two_skates_half():
    assert foot_skating(legs(dict.fromkeys((1, 2), way(x=SLIDE)))) == pytest.approx(0.2)


def test_turning_on_the_ball_of_the_foot_is_no_skating():
    assert foot_skating(legs({2: way(x=SLIDE)})) == 0.0


def test_a_foot_in_the_air_may_move():
    # The left foot is lifted by 10 cm for two of three seconds, and moves only then.
    lift = np.where(np.arange(90) < 60, 0.1, 0.0)
    forward = np.minimum(SLIDE, SLIDE[55])
    assert foot_skating(legs(dict.fromkeys((1, 2), way(x=forward, y=lift)))) == pytest.approx(0, abs=1e-5)


def test_feet_without_joints_of_their_own_name_are_refused():
    refused("no joint is called toe, heel, ankle or foot", foot_skating, swing(1.0))


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


def test_physical_foot_contact_needs_both_feet():
    motion = legs({})
    one_foot = replace(motion, skeleton=replace(LEGS, joints=("hip", "left toe", "left heel", "left knee", "neck")))
    refused("two feet are needed", pfc, one_foot)


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
    assert bone_error(replace(broken, valid=np.arange(broken.n_frames) != 7), [0, 0.3, 0.3]) == pytest.approx(
        0, abs=1e-9
    )


@cases(
    "lengths, message",
    ([0.3, 0.3], "one per joint"),
    ([0, -0.3, 0.3], "finite and not negative"),
    ([0, np.nan, 0.3], "finite and not negative"),
    ([0, 0, 0], "no bone"),
)
def test_unfit_reference_lengths_are_refused(swinging_arm: Callable[..., Motion], lengths: list[float], message: str):
    refused(message, bone_error, swinging_arm(1.0, 30.0), lengths)


def test_a_skeleton_without_bones_has_no_bone_error():
    refused("needs a skeleton with bones", bone_error, swing(1.0))


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
    assert MEASURES[name](leap) == pytest.approx(
        MEASURES[name](replace(dance, positions=dance.positions[:60], valid=None))
    )


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


def test_windows_that_are_filler_for_the_most_part_say_nothing():
    refused("no window of 1 s is valid for half of its time", freezing, replace(legs({}), valid=np.arange(90) % 6 < 3))


def test_no_valid_frame_has_no_bones(swinging_arm: Callable[..., Motion]):
    arm = swinging_arm(1.0, 30.0)
    refused("no frame of the motion is valid", bone_error, replace(arm, valid=np.zeros(arm.n_frames, bool)))


@cases(
    "call",
    lambda motion: jerk(motion, step=0.0),
    lambda motion: largest_step(motion, step=np.nan),
    lambda motion: freezing(motion, threshold=-1.0),
    lambda motion: freezing(motion, window=0.0),
    lambda motion: foot_skating(motion, height=0.0),
)
def test_settings_that_are_not_positive_are_refused(call: Callable[[Motion], float]):
    refused("must be positive", call, legs({}))
