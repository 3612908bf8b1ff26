"""The drawn dancer and the wandering box: where things are in the picture, and that nothing else changes."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.lab.render.stick import BACKGROUND, render_skeleton
from harmolab.types import Motion
from study.figures.moving_box import box_walk, moving_box
from tests.builders import cases, refused

PLAIN = np.full((100, 160), 225, np.uint8)


def dots(*places: tuple[float, float], dimensions: int = 3, fps: float = 10.0) -> Motion:
    """One joint that visits `places` in turn, one a frame."""
    positions = np.zeros((len(places), 1, dimensions))
    positions[:, 0, :2] = places
    return Motion(positions, fps, Skeleton.unnamed(1))


def drawn_centre(frame: np.ndarray) -> tuple[float, float]:
    """(x, y) of the middle of what is not background."""
    rows, columns = np.nonzero(frame != BACKGROUND)
    return columns.mean(), rows.mean()


@cases("dimensions, origin, opposite", (3, (10, 90), (90, 10)), (2, (10, 10), (90, 90)))
def test_x_goes_right_and_y_up_in_the_room_but_down_in_a_picture(
    dimensions: int, origin: tuple, opposite: tuple
) -> None:
    frames = render_skeleton(dots((0, 0), (1, 1), dimensions=dimensions), height=100, width=100)
    assert [drawn_centre(frame) for frame in frames] == [pytest.approx(at, abs=1) for at in (origin, opposite)]


def test_the_camera_keeps_the_whole_motion_in_the_picture(swinging_arm: Callable[..., Motion]) -> None:
    for frame in render_skeleton(swinging_arm(1.0, 25.0, seconds=2.0), height=120):
        assert (np.concatenate([frame[0], frame[-1], frame[:, 0], frame[:, -1]]) == BACKGROUND).all()
        assert (frame != BACKGROUND).any()


def test_a_nearer_limb_hides_a_farther_one() -> None:
    positions = np.array([[[0, 0, -1.0], [1, 0, -1.0], [0.5, -0.5, 1.0], [0.5, 0.5, 1.0]]] * 2)
    near_last = Motion(positions, 10.0, Skeleton(("a", "b", "c", "d"), (-1, 0, -1, 2)))
    near_first = Motion(positions * [1, 1, -1], 10.0, Skeleton(("a", "b", "c", "d"), (-1, 0, -1, 2)))
    crossing = [
        next(render_skeleton(motion, height=200, width=200))[90:110, 90:110] for motion in (near_last, near_first)
    ]
    assert (crossing[0] != crossing[1]).any()


def test_at_another_rate_the_dance_takes_the_same_time() -> None:
    motion = dots(*((i, 0) for i in range(11)))  # one second at 10 fps
    frames = list(render_skeleton(motion, height=100, width=220, fps=25.0))
    assert len(frames) == 26
    np.testing.assert_allclose(np.diff([drawn_centre(frame)[0] for frame in frames]), 0.8 * 220 / 25, atol=0.7)


def test_frames_have_the_size_that_was_asked_for() -> None:
    motion = dots((0, 0), (1, 1))
    assert next(render_skeleton(motion)).shape == (240, 320)
    coloured = next(render_skeleton(motion, height=90, width=50, colour=True))
    assert (coloured.shape, coloured.dtype) == ((90, 50, 3), np.uint8)
    np.testing.assert_array_equal(coloured[..., 0], next(render_skeleton(motion, height=90, width=50)))


def test_a_dancer_who_stands_still_is_drawn_in_the_middle() -> None:
    frame = next(render_skeleton(dots((5, 5), (5, 5)), height=100, width=100))
    assert drawn_centre(frame) == pytest.approx((50, 50), abs=1)


def test_a_picture_too_small_or_a_rate_of_zero_is_refused() -> None:
    motion = dots((0, 0), (1, 1))
    refused("at least 16 x 16 pixels, got 20 x 8", render_skeleton, motion, height=8, width=20)
    refused("fps must be positive", render_skeleton, motion, fps=0.0)


def test_the_box_covers_its_share_of_the_picture_and_leaves_the_rest_alone() -> None:
    original = PLAIN.copy()
    for frame in moving_box([original] * 50, 25.0, seed=3, size=0.3):
        changed = frame != PLAIN
        assert changed.sum() == pytest.approx(30 * 30, rel=0.25)  # with its soft edge
        rows, columns = np.nonzero(changed)
        assert np.ptp(rows) == pytest.approx(30, abs=3)
        assert np.ptp(columns) == pytest.approx(30, abs=3)
    np.testing.assert_array_equal(original, PLAIN)


def test_the_box_is_blue_on_colour_frames_and_as_bright_on_grey_ones() -> None:
    coloured = next(moving_box([np.repeat(PLAIN[..., None], 3, axis=2)], 25.0, seed=0))
    grey = next(moving_box([PLAIN], 25.0, seed=0))
    rows, columns = (int(np.median(axis)) for axis in np.nonzero(grey != 225))
    assert coloured[rows, columns].tolist() == [40, 80, 220]
    assert grey[rows, columns] == 84  # 0.299 * 40 + 0.587 * 80 + 0.114 * 220


def test_the_same_seed_walks_the_same_way_at_any_frame_rate() -> None:
    slow = list(itertools.islice(box_walk(np.random.default_rng(5), (1.0, 0.7), 0.8, 25.0), 50))
    fast = list(itertools.islice(box_walk(np.random.default_rng(5), (1.0, 0.7), 0.8, 50.0), 100))
    np.testing.assert_allclose(fast[::2], slow, atol=1e-9)


def test_the_box_walks_within_reach_at_about_its_speed() -> None:
    places = np.array(list(itertools.islice(box_walk(np.random.default_rng(1), (1.0, 0.7), 0.8, 25.0), 5000)))
    assert places.min() >= 0
    assert places[:, 0].max() <= 1.0
    assert places[:, 1].max() <= 0.7
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) * 25
    assert speed.max() <= 1.5 * 0.8 + 1e-9
    assert speed.mean() == pytest.approx(0.8, rel=0.2)


def test_a_box_as_large_as_the_picture_stays_where_it_is() -> None:
    frames = list(moving_box([PLAIN] * 5, 25.0, seed=0, size=2.0))
    assert all((frame == 84).all() for frame in frames)


@pytest.mark.parametrize("bad", [{"fps": 0.0}, {"size": -0.1}, {"speed": float("nan")}])
def test_an_impossible_box_is_refused_by_name(bad: dict[str, float]) -> None:
    settings = {"fps": 25.0, "size": 0.3, "speed": 0.8} | bad
    refused(f"{next(iter(bad))} must be positive", moving_box, [PLAIN], settings.pop("fps"), seed=0, **settings)
