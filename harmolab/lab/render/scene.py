"""Pictures of a dance for people to watch: perspective, a floor with a grid and a shadow, a camera that follows.

The camera stands where the dancer faces on average and walks along; the grid stands still, so that travelling is
seen. Near limbs are darker and drawn over far ones. Needs OpenCV and numpy only.

The camera never turns. So where everything lies is computed for many frames at once, and only drawing is left for each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from harmolab.io.player_points import PROPS, joint_widths, limb_widths, playing_box, prop_joints
from harmolab.kinematics import resample_motion, upsample_motion
from harmolab.lab.render.marks import BeatMarks
from harmolab.lab.render.stick import FARTHEST, FRACTION_BITS, Frame, Stroke, check_positive, draw_strokes, fixed
from harmolab.skeletons import camera_way, mean_heading, skull_and_limbs, standing_height, turned
from harmolab.types import BoolArray, FloatArray, IntArray, Motion, Skeleton
from harmolab.verdict.score import HarmonyScore

WALL, FLOOR, LINE, SHADOW = (246, 246, 246), (232, 232, 228), (196, 196, 192), (205, 205, 200)
NEAR, FAR = np.array([30.0, 34.0, 42.0]), np.array([140.0, 146.0, 156.0])  # of limbs
WOOD_NEAR, WOOD_FAR = np.array([92.0, 50.0, 20.0]), np.array([176.0, 140.0, 110.0])  # of props
GRID = 0.5  # metres between lines of the floor
REACH = 4.5  # metres of floor with lines, on every side of the dancer
FADES = 5  # shades of a line
BLOCK = 64  # frames that are laid out together
# In heights of the dancer: how far away the camera stands, how high, and how high it looks.
DISTANCE, EYE, TARGET = 3.4, 0.85, 0.47
FLOOR_SEEN = 1.0  # heights of the dancer: floor nearer to the camera lies far below the picture
FILL = 0.58  # share of the picture's height that a standing dancer fills
# A player with an instrument: seen from a little above and from one side (radians), by a camera at rest.
LIFT, ASIDE, PLAYER_FILL = 0.35, -0.45, 0.84
LIMB, JOINT, HEAD = 0.036, 0.02, 0.072  # thickness and radii in heights of the dancer


@dataclass(frozen=True, eq=False)
class _Camera:
    """The place of the camera in each frame; it looks the same way in all. Everything in metres, one picture size.

    Parameters
    ----------
    eye : (T, 3)
    axes : (3, 3), rows: right, up and forward
    focal : float, pixels
    height, width : int, pixels
    size : float, height of the dancer
    ahead : float, metres along the floor from the camera to the dancer
    """

    eye: FloatArray
    axes: FloatArray
    focal: float
    height: int
    width: int
    size: float
    ahead: float

    def to_view(self, points: FloatArray, frames: slice) -> FloatArray:
        """Points (F, N, 3) of some frames as the camera has them: to its right, above it, in front of it."""
        return (points - self.eye[frames, None]) @ self.axes.T

    def to_pixels(self, view: FloatArray) -> FloatArray:
        """(..., 2) pixel x and pixel y (down) of points (..., 3) of `to_view`."""
        plane = self.focal * view[..., :2] / np.maximum(view[..., 2:], 1e-3)
        return np.array([self.width / 2, self.height / 2]) + plane * np.array([1.0, -1.0])

    def pixels(self, metres: FloatArray | float, distance: FloatArray) -> IntArray:
        """Length in pixels at distances; one at least."""
        return np.maximum(1, np.rint(self.focal * metres / np.maximum(distance, 0.1))).astype(np.int64)


def render_dance(
    motion: Motion,
    *,
    height: int = 480,
    width: int | None = None,
    fps: float = 30.0,
    score: HarmonyScore | None = None,
) -> Iterator[Frame]:
    """Frames of a dancer on a floor, seen from where she faces on average, by a camera that walks along.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres, y up, floor at y = 0
    height, width : int, pixels
        `width` defaults to 4/3 of the height.
    fps : float, hertz
        Rate of the pictures; a slower motion is interpolated by cubic splines.
    score : HarmonyScore, optional
        Of the motion with its music: each beat lights its mark in the corner, and a ring shows where two meet
        (`harmolab.lab.render.marks`).

    Yields
    ------
    (H, W, 3) uint8 RGB arrays, frame i at i / fps seconds

    Raises
    ------
    ValueError
        For a motion in image coordinates, a picture under 64 pixels, or an fps that is not positive.
    """
    width = round(height * 4 / 3) if width is None else width
    if motion.positions.shape[2] != 3:
        raise ValueError("a floor needs movement in space; points of a picture go over their video (--over)")
    if min(height, width) < 64:
        raise ValueError(f"a picture needs at least 64 x 64 pixels, got {width} x {height}")
    check_positive(fps=fps)
    dance = resample_motion(upsample_motion(motion, fps), fps)
    # The camera stands at +z.
    aside = 0.0 if PROPS.isdisjoint(dance.skeleton.joints) else ASIDE
    facing = turned(dance.positions, aside - mean_heading(dance.positions, fps, dance.skeleton))
    turned_motion = Motion(facing, fps, dance.skeleton, dance.valid)
    box = playing_box(turned_motion) if aside else None
    return _frames(turned_motion, box, height, width, BeatMarks(height, score))


def _frames(motion: Motion, box: FloatArray | None, height: int, width: int, marks: BeatMarks) -> Iterator[Frame]:
    camera = _following(motion, height, width) if box is None else _at_rest(box, motion.n_frames, height, width)
    body = _Body.of(motion.skeleton)
    empty = _room(camera)
    for start in range(0, motion.n_frames, BLOCK):
        frames = slice(start, start + BLOCK)
        joints = motion.positions[frames]
        grids, shadows = _grid(camera, frames), body.shadow(camera, frames, joints)
        figures = body.strokes(camera, frames, joints)
        for index, (grid, shadow, figure) in enumerate(zip(grids, shadows, figures, strict=True), start):
            frame = empty.copy()
            _draw_grid(frame, grid)
            draw_strokes(frame, shadow)
            draw_strokes(frame, figure, rim=WALL)
            marks.draw(frame, index / motion.fps)
            yield frame


def _following(motion: Motion, height: int, width: int) -> _Camera:
    """The camera in front of the dancer."""
    size = max(standing_height(motion.positions), 0.1)
    eye = camera_way(motion.positions, motion.fps) + size * np.array([0.0, 0.0, DISTANCE])
    eye[:, 1] = EYE * size
    axes = _axes(np.array([0.0, TARGET - EYE, -DISTANCE]))
    return _Camera(eye, axes, FILL * height * DISTANCE, height, width, size, DISTANCE * size)


def _at_rest(box: FloatArray, n_frames: int, height: int, width: int) -> _Camera:
    """The camera in front of a player who stays in the box (2, 3), which fills the picture."""
    across, up, deep = np.ptp(box, axis=0)
    tall = up * np.cos(LIFT) + deep * np.sin(LIFT)
    size = max(tall, across * height / width, 0.1) * FILL / PLAYER_FILL
    back = np.array([0.0, np.sin(LIFT), np.cos(LIFT)]) * DISTANCE * size
    eye = np.tile(box.mean(axis=0) + back, (n_frames, 1))
    return _Camera(eye, _axes(-back), FILL * height * DISTANCE, height, width, size, float(back[2]))


def _axes(forward: FloatArray) -> FloatArray:
    """(3, 3) rows: right, up and forward of a level camera that looks along `forward` (3,)."""
    forward = forward / np.linalg.norm(forward)
    right = np.array([1.0, 0.0, 0.0])
    return np.stack([right, np.cross(right, forward), forward])


def _room(camera: _Camera) -> Frame:
    """The wall, and below the horizon the floor."""
    frame = np.full((camera.height, camera.width, 3), WALL, np.uint8)
    far = camera.to_pixels(camera.axes @ np.array([0.0, -camera.eye[0, 1], -1000.0]))
    frame[int(np.clip(far[1], 0, camera.height)) :] = FLOOR
    return frame


def _grid(camera: _Camera, frames: slice) -> Iterator[list[list[IntArray]]]:
    """For each frame and shade of line, from the faintest on: the ends (2, 2) of its pieces."""
    points, is_drawn = _pieces(camera, frames)
    shades = np.minimum(np.arange(2 * FADES - 1), np.arange(2 * FADES - 1)[::-1])
    for ends, drawn in zip(points, is_drawn, strict=True):
        yield [list(ends[:, shades == shade][drawn[:, shades == shade]]) for shade in range(FADES)]


def _pieces(camera: _Camera, frames: slice) -> tuple[IntArray, BoolArray]:
    """The lines of the floor, cut where each changes its shade, on circles round the dancer.

    Returns
    -------
    points : (F, lines, pieces, 2 ends, 2), fixed-point pixels
    is_drawn : (F, lines, pieces) bool, False for pieces without length
    """
    centre = camera.eye[frames][:, [0, 2]] - np.array([0.0, camera.ahead])
    count = int(np.ceil(REACH / GRID))
    shifts = (np.round(centre / GRID)[..., None] + np.arange(-count, count + 1)) * GRID - centre[
        ..., None
    ]  # (F, 2, lines)
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


def _nearest_floor(camera: _Camera) -> float:
    """End of the drawn floor, metres along z from the dancer; nearer floor would be behind the camera."""
    _, down, forward = camera.axes[2]
    return float(camera.ahead - (FLOOR_SEEN * camera.size + down * camera.eye[0, 1]) / -forward)


def _draw_grid(frame: Frame, pieces: list[list[IntArray]]) -> None:
    # One call for each shade: a call for each piece would take longer than the rest of the picture.
    for shade, ends in enumerate(pieces, start=1):
        colour = np.array(FLOOR) + (np.array(LINE) - FLOOR) * (shade / FADES)
        cv2.polylines(frame, ends, False, colour.tolist(), 1, cv2.LINE_AA, FRACTION_BITS)


@dataclass(frozen=True, eq=False)
class _Body:
    """The drawn parts of a skeleton: limbs first, then joints, then the head if there is one.

    Parameters
    ----------
    limbs : (L, 2) joints
    widths : (L,) thickness in that of a body's limb
    is_prop : (P,) bool; props are of wood, and throw no shadow
    shares : (P, J), share of each joint in the middle of each part; L of the P parts are limbs
    radii : (P - L,) of the balls, heights of the dancer
    nudge : (P,) metres by which a part counts as farther away: the head lies before the neck, whatever the neck does
    """

    limbs: IntArray
    widths: FloatArray
    is_prop: BoolArray
    shares: FloatArray
    radii: FloatArray
    nudge: FloatArray

    @classmethod
    def of(cls, skeleton: Skeleton) -> _Body:
        skull, limbs = skull_and_limbs(skeleton)
        joints = [(joint,) for joint in range(len(skeleton.joints)) if joint not in skull]
        balls = [*joints, *([tuple(skull)] if skull else [])]
        props, thick = set(prop_joints(skeleton)), joint_widths(skeleton)
        shares = np.zeros((len(limbs) + len(balls), len(skeleton.joints)))
        for part, members in enumerate([*limbs, *balls]):
            shares[part, list(members)] = 1 / len(members)
        necks = [0.1 * (not set(limb).isdisjoint(skull)) for limb in limbs]
        heads = [HEAD] if skull else []
        nudge = np.array([*necks, *[0.0] * len(joints), *[-0.1] * len(heads)])
        return cls(
            np.array(limbs, int).reshape(-1, 2),
            np.array(limb_widths(skeleton, limbs)),
            np.array([not props.isdisjoint(part) for part in [*limbs, *balls]], bool),
            shares,
            np.array([*[JOINT * thick[joint] for (joint,) in joints], *heads]),
            nudge,
        )

    def strokes(self, camera: _Camera, frames: slice, joints: FloatArray) -> Iterator[list[Stroke]]:
        """Limbs, joints and head of each frame, from far to near; near ones are darker."""
        view = camera.to_view(joints, frames)
        flat, depth = camera.to_pixels(view), np.maximum(view[..., 2], 1e-3)
        span = np.maximum(np.ptp(depth, axis=1), 0.3 * camera.size)[:, None]
        distance = depth @ self.shares.T
        far = np.clip((distance - depth.min(axis=1)[:, None]) / span, 0.0, 1.0)
        near, pale = (np.where(self.is_prop[:, None], *ends) for ends in ((WOOD_NEAR, NEAR), (WOOD_FAR, FAR)))
        colours = (near + far[..., None] * (pale - near)).tolist()
        limbs, balls = np.split(distance, [len(self.limbs)], axis=1)
        radii = np.rint(camera.focal * camera.size * self.radii / balls * 2**FRACTION_BITS).clip(1, FARTHEST)
        sizes = np.concatenate(
            [camera.pixels(LIMB * camera.size * self.widths, limbs), radii.astype(int)], axis=1
        ).tolist()
        middles = self.shares[len(self.limbs) :] @ flat
        starts = fixed(np.concatenate([flat[:, self.limbs[:, 0]], middles], axis=1)).tolist()
        ends = [[*row, *[None] * middles.shape[1]] for row in fixed(flat[:, self.limbs[:, 1]]).tolist()]
        order = np.argsort(-(distance + self.nudge), axis=1, kind="stable").tolist()
        for parts, *looks in zip(order, starts, ends, sizes, colours, strict=True):
            strokes = list(map(Stroke, *looks))
            yield [strokes[part] for part in parts]

    def shadow(self, camera: _Camera, frames: slice, joints: FloatArray) -> Iterator[list[Stroke]]:
        """The limbs of each frame once more, flat on the floor; not those of props."""
        is_body = ~self.is_prop[: len(self.limbs)]
        limbs, widths = self.limbs[is_body], self.widths[is_body]
        view = camera.to_view(joints * np.array([1.0, 0.0, 1.0]), frames)
        flat = fixed(camera.to_pixels(view))
        thick = camera.pixels(1.3 * LIMB * camera.size * widths, view[:, limbs, 2].mean(axis=2)).tolist()
        for ends, sizes in zip(flat[:, limbs].tolist(), thick, strict=True):
            yield [Stroke(start, end, size, SHADOW) for (start, end), size in zip(ends, sizes, strict=True)]
