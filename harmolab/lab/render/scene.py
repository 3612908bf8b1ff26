"""Pictures of a dance for people to watch: perspective, a floor with a grid and a shadow, a camera that follows.

The camera stands a little beside where the dancer faces on average and walks along; the grid stands still, so that
travelling is seen. Near parts are darker and drawn over far ones. Needs OpenCV and numpy only.

The camera never turns. So where everything lies is computed for many frames at once, and only drawing is left for each.
"""

from collections.abc import Iterator, Sequence
from itertools import repeat

import cv2
import numpy as np

from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.lab.person import Camera, Shape, Stage, person_shapes, shadow_outline, stage_of
from harmolab.lab.render.stick import FRACTION_BITS, BeatMarks, Frame, check_positive, fixed, picture_width
from harmolab.score import HarmonyScore
from harmolab.types import BoolArray, IntArray, Motion

WALL, FLOOR, LINE, SHADOW = (246, 246, 246), (232, 232, 228), (196, 196, 192), (205, 205, 200)
GRID = 0.5  # metres between lines of the floor
REACH = 4.5  # metres of floor with lines, on every side of the dancer
FADES = 5  # shades of a line
BLOCK = 64  # frames that are laid out together
RIM, RIM_SHARE = 2, 1 / 200  # thickness around a part: pixels at least, share of the picture's height
FLOOR_SEEN = 1.0  # heights of the dancer: floor nearer to the camera lies far below the picture


def render_dance(
    motion: Motion,
    *,
    height: int = 480,
    width: int | None = None,
    fps: float = 30.0,
    score: HarmonyScore | None = None,
    begin: float = 0.0,
    follow: bool = False,
) -> Iterator[Frame]:
    """Frames of a dancer on a floor, seen from where she faces on average, by a camera that walks along.

    Points of a picture are drawn as a person before a plain wall.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres, y up, or (T, J, 2) image coordinates
    height, width : int, pixels
        `width` defaults to 4/3 of the height.
    fps : float, hertz
        Rate of the pictures; a slower motion is interpolated by cubic splines.
    score : HarmonyScore, optional
        Of the motion with its music: each beat lights its mark in the corner, and a ring shows where two meet
        (`harmolab.lab.render.stick`).
    begin : float, seconds of the score's time line at the motion's first frame
    follow : bool
        True to keep the hips in the middle of the picture; the camera goes along smoothly when left out.

    Yields
    ------
    (H, W, 3) uint8 RGB arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        For a picture under 64 pixels, or an fps that is not positive.
    """
    width = picture_width(height, width, least=64)
    check_positive(fps=fps)
    dance = resample_motion(upsample_motion(motion, fps), fps)
    return _frames(stage_of(dance, follow=follow), fps, height, width, BeatMarks(height, score, begin=begin))


def _frames(stage: Stage, fps: float, height: int, width: int, marks: BeatMarks) -> Iterator[Frame]:
    camera, positions = stage.camera(height, width), stage.turned(stage.positions)
    empty = np.full((height, width, 3), WALL, np.uint8) if stage.flat else _room(camera)
    for start in range(0, len(positions), BLOCK):
        frames = slice(start, start + BLOCK)
        people = person_shapes(stage.plan, camera, positions[frames], frames)
        shadows = fixed(shadow_outline(stage.plan, camera, positions[frames], frames))
        grids = repeat(None) if stage.flat else _grid(camera, frames)
        for index, (grid, shadow, person) in enumerate(zip(grids, shadows, people, strict=False), start):
            frame = empty.copy()
            if grid is not None:
                _draw_grid(frame, grid)
                cv2.fillPoly(frame, [shadow], SHADOW, cv2.LINE_AA, FRACTION_BITS)
            draw_shapes(frame, person)
            marks.draw(frame, index, fps)
            yield frame


def draw_shapes(frame: Frame, shapes: Sequence[Shape]) -> None:
    """Fill shapes over one another, each with a rim, to set it off from those behind."""
    rim = max(RIM, round(RIM_SHARE * len(frame)))
    for shape in shapes:
        outline = [fixed(shape.outline)]
        cv2.polylines(frame, outline, True, WALL, 1 if shape.thin else rim, cv2.LINE_AA, FRACTION_BITS)
        cv2.fillPoly(frame, outline, shape.colour, cv2.LINE_AA, FRACTION_BITS)


def _room(camera: Camera) -> Frame:
    """The wall, and below the horizon the floor."""
    frame = np.full((round(camera.height), round(camera.width), 3), WALL, np.uint8)
    far = camera.to_pixels(camera.axes @ np.array([0.0, -camera.eye[0, 1], -1000.0]))
    frame[int(np.clip(far[1], 0, camera.height)) :] = FLOOR
    return frame


def _grid(camera: Camera, frames: slice) -> Iterator[list[list[IntArray]]]:
    """For each frame and shade of line, from the faintest on: the ends (2, 2) of its pieces."""
    points, is_drawn = _pieces(camera, frames)
    shades = np.minimum(np.arange(2 * FADES - 1), np.arange(2 * FADES - 1)[::-1])
    for ends, drawn in zip(points, is_drawn, strict=True):
        yield [list(ends[:, shades == shade][drawn[:, shades == shade]]) for shade in range(FADES)]


def _pieces(camera: Camera, frames: slice) -> tuple[IntArray, BoolArray]:
    """The lines of the floor, cut where each changes its shade, on circles round the dancer.

    Returns
    -------
    points : (F, lines, pieces, 2 ends, 2), fixed-point pixels
    is_drawn : (F, lines, pieces) bool, False for pieces without length
    """
    centre = camera.eye[frames][:, [0, 2]] - np.array([0.0, camera.ahead])
    count = int(np.ceil(REACH / GRID))
    lines = (np.round(centre / GRID)[..., None] + np.arange(-count, count + 1)) * GRID
    shifts = lines - centre[..., None]  # (F, 2, lines)
    radii = REACH * np.minimum(1.15 - np.arange(FADES) / FADES, 1.0)
    halves = np.sqrt(np.maximum(radii**2 - shifts[..., None] ** 2, 0.0))
    along = np.concatenate([-halves, halves[..., ::-1]], axis=-1)  # (F, 2, lines, cuts)
    across = np.broadcast_to(shifts[..., None], along.shape)
    nearest = _nearest_floor(camera)
    # Lines that go away from the camera (x stays), then lines from left to right (z stays).
    x = np.concatenate([across[:, 0], along[:, 1]], axis=1)
    z = np.concatenate([np.minimum(along[:, 0], nearest), across[:, 1]], axis=1)
    places = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(len(centre), -1, 3)
    ground = np.stack([centre[:, 0], np.zeros(len(centre)), centre[:, 1]], axis=-1)[:, None]
    cuts = fixed(camera.to_pixels(camera.to_view(places + ground, frames))).reshape(*x.shape, 2)
    is_drawn = (np.abs(np.diff(x)) + np.abs(np.diff(z)) > 1e-6) & (z[..., :-1] <= nearest)
    return np.stack([cuts[..., :-1, :], cuts[..., 1:, :]], axis=-2), is_drawn


def _nearest_floor(camera: Camera) -> float:
    """End of the drawn floor, metres along z from the dancer; nearer floor would be behind the camera."""
    _, down, forward = camera.axes[2]
    return float(camera.ahead - (FLOOR_SEEN * camera.size + down * camera.eye[0, 1]) / -forward)


def _draw_grid(frame: Frame, pieces: list[list[IntArray]]) -> None:
    # One call for each shade: a call for each piece would take longer than the rest of the picture.
    for shade, ends in enumerate(pieces, start=1):
        colour = np.array(FLOOR) + (np.array(LINE) - FLOOR) * (shade / FADES)
        cv2.polylines(frame, ends, False, colour.tolist(), 1, cv2.LINE_AA, FRACTION_BITS)
