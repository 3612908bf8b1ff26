"""The drawn dance: where the dancer is in the picture, what hides what, that the camera walks along."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.render.scene import FLOOR, WALL, render_dance
from harmolab.lab.render.stick import DANCER, HIT, MUSIC, hit_times
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.types import BeatTrack, Motion
from tests.builders import refused, track

MAN = Skeleton(("foot", "hip", "head"), (-1, 0, 1))
STANDING = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.7, 0.0]])


def dance(*frames: np.ndarray, fps: float = 30.0, skeleton: Skeleton = MAN) -> Motion:
    return Motion(np.stack(frames), fps, skeleton)


def dark(frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) where the dancer is: floor, lines and shadow are lighter."""
    return np.nonzero(frame.max(axis=2) < 165)


def test_standing_dancer_fills_the_middle_of_the_picture() -> None:
    frame = next(render_dance(dance(STANDING, STANDING)))
    rows, columns = dark(frame)
    assert frame.shape == (480, 640, 3)
    assert columns.mean() == pytest.approx(320, abs=2)
    assert 0.5 < np.ptp(rows) / 480 < 0.75
    assert rows.min() > 20
    assert rows.max() < 460


def test_floor_lies_below_the_wall_and_the_shadow_on_it() -> None:
    frame = next(render_dance(dance(STANDING, STANDING)))
    assert tuple(frame[0, 5]) == WALL
    assert tuple(frame[-1, 5]) == FLOOR or frame[-1, 5].min() > 150
    leaning = STANDING + np.array([[0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]])
    shadows = [next(render_dance(dance(pose, pose)))[:, :, 0] == 205 for pose in (STANDING, leaning)]
    assert shadows[1].sum() > 2 * shadows[0].sum()


def test_right_of_the_viewer_is_positive_x_and_nearer_is_larger() -> None:
    sideways = STANDING + np.array([[0, 0, 0], [0.4, 0, 0], [0.8, 0, 0]])
    rows, columns = dark(next(render_dance(dance(sideways, sideways))))
    assert columns[rows < np.median(rows)].mean() > columns[rows > np.median(rows)].mean() + 20
    pair = Skeleton(("a", "b", "c", "d"), (-1, 0, -1, 2))
    for nearer, expected in ((1.0, 1), (-1.0, -1)):
        poles = np.array([[-0.5, 0, nearer], [-0.5, 1.5, nearer], [0.5, 0, -nearer], [0.5, 1.5, -nearer]])
        rows, columns = dark(next(render_dance(dance(poles, poles, skeleton=pair))))
        left, right = (np.ptp(rows[side]) for side in (columns < 320, columns >= 320))
        assert np.sign(left - right) == expected


def test_nearer_limb_hides_the_farther_one_and_is_darker() -> None:
    cross = Skeleton(("a", "b", "c", "d"), (-1, 0, -1, 2))  # a bar from left to right and a pole that cross
    levels = []
    for near in (0.1, -0.1):
        pose = np.array([[-0.5, 1.0, near], [0.5, 1.0, near], [0.0, 0.2, -near], [0.0, 1.8, -near]])
        frame = next(render_dance(dance(pose, pose, skeleton=cross)))
        rows, columns = dark(frame)
        bar = rows[columns > columns.max() - 20]  # the right end of the bar
        levels.append(
            (
                frame[int(np.median(bar)), int(np.median(columns))].max(),
                frame[int(np.median(bar)), columns.max() - 20].max(),
            )
        )
    assert levels[0][0] == levels[0][1] < 60  # bar in front: its colour goes through, and is dark
    assert levels[1][0] < levels[1][1]  # bar behind: light, and at the crossing the dark pole hides it


def test_camera_follows_a_walk_while_the_grid_goes_by() -> None:
    frames = list(render_dance(dance(*[STANDING + np.array([1.5 * frame / 30, 0, 0]) for frame in range(90)])))
    places = [dark(frame)[1].mean() for frame in frames]
    assert len(frames) == 90
    assert max(abs(place - 320) for place in places[35:55]) < 15  # 3 m are some 500 pixels
    assert all(100 < place < 540 for place in places)
    assert (frames[30][470] != frames[40][470]).any()


def test_slow_motion_is_interpolated_to_the_pictures_rate() -> None:
    motion = dance(*(STANDING + np.array([0, 0.02 * frame, 0]) for frame in range(16)), fps=15.0)
    frames = list(render_dance(motion, height=120, fps=30.0))
    assert len(frames) == 31
    assert frames[0].shape == (120, 160, 3)


def test_disc_lights_up_at_each_beat_only_where_beats_are_given() -> None:
    motion = dance(*[STANDING] * 30)
    lit = [bool((frame[21, 21] == MUSIC).all()) for frame in render_dance(motion, score=score(track([0.5]), track([])))]
    assert [index for index, on in enumerate(lit) if on] == [15, 16, 17, 18, 19]
    assert not any((frame[:60, :60] == MUSIC).all(axis=2).any() for frame in render_dance(motion))


def score(music: BeatTrack, visual: BeatTrack, **changes: object) -> HarmonyScore:
    return score_harmony(music, visual, params=replace(HarmonyParams.valleys(), **changes), n_rotations=0)


def test_dancer_and_hits_have_marks_of_their_own() -> None:
    frames = render_dance(dance(*[STANDING] * 60), score=score(track([0.5, 1.5]), track([0.566, 1.0])))
    lit = {"music": [], "dancer": [], "hit": []}
    for index, frame in enumerate(frames):
        for name, colour in (("music", MUSIC), ("dancer", DANCER), ("hit", HIT)):
            if (frame[:120, :160] == colour).all(axis=2).sum() > 60:  # an outline has fewer
                lit[name].append(index)
    assert (lit["music"], lit["dancer"]) == ([*range(15, 20), *range(45, 50)], [*range(17, 22), *range(30, 35)])
    assert lit["hit"] == [*range(17, 22)]


def test_marks_have_the_projects_colours() -> None:
    for mark, name in ((MUSIC, "audio"), (DANCER, "visual"), (HIT, "hit")):
        assert "#{:02X}{:02X}{:02X}".format(*mark) == COLOURS[name]


def test_hit_falls_on_the_later_beat_of_the_two() -> None:
    np.testing.assert_allclose(hit_times(score(track([0.5, 1.0, 1.5]), track([0.4, 1.05, 1.65]))), [0.5, 1.05])
    assert hit_times(score(track([0.5]), track([]))).size == hit_times(score(track([]), track([0.5]))).size == 0
    np.testing.assert_allclose(hit_times(score(track([0.5]), track([0.55]))), [0.55])


def test_hits_are_those_of_the_score_whatever_lag_and_matching_it_has() -> None:
    np.testing.assert_allclose(hit_times(score(track([0.5, 1.0]), track([0.8, 1.3]), lag=0.3)), [0.8, 1.3])
    music, one = track([0.5, 0.6]), track([0.55])
    assert hit_times(score(music, one)).size == 2
    np.testing.assert_allclose(hit_times(score(music, one, matching="nearest")), [0.55])


def test_floor_in_front_of_a_small_dancer_is_not_drawn_from_behind_the_camera() -> None:
    small = next(render_dance(dance(0.3 * STANDING, 0.3 * STANDING)))
    assert (small[:100, :250] == WALL).all() and (small[:100, 390:] == WALL).all()
    assert (small[150:, :100] != FLOOR).any()


def test_real_skeleton_and_one_without_bones_are_drawn() -> None:
    clip = synthetic_clip("waltz", seed=1)
    assert 3000 < dark(next(render_dance(clip.motion)))[0].size < 30_000
    dots = Motion(clip.motion.positions, 60.0, Skeleton.unnamed(clip.motion.positions.shape[1]))
    assert 200 < dark(next(render_dance(dots)))[0].size < 10_000


def test_what_cannot_be_drawn_is_refused() -> None:
    refused("at least 64 x 64 pixels, got 53 x 40", render_dance, dance(STANDING, STANDING), height=40)
    refused("fps must be positive", render_dance, dance(STANDING, STANDING), fps=float("nan"))


@pytest.mark.parametrize("angle", [0.0, 1.2, np.pi])
def test_dancer_is_seen_from_where_she_faces(angle: float) -> None:
    """Her left side lies to the right in the picture, whichever way she faces; one arm alone tells left from right."""
    left = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    pose = np.outer([0, 0.15, -0.15, 0.8, 0], left) + np.outer([0, 1, 1, 1, 1.7], [0, 1, 0])
    body = Skeleton(("foot", "left_hip", "right_hip", "left_hand", "top"), (-1, 0, 0, 1, 0))
    _, columns = dark(next(render_dance(dance(pose, pose, skeleton=body))))
    assert columns.max() - 320 > 1.5 * (320 - columns.min())
