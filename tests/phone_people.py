"""A person with skin, hair and clothes, lit by a lamp: enough like a filmed one for a pose estimator to find the body.

Limbs are round and get thinner; each pixel has the depth and the normal of the nearest limb.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.body.skeletons import joint_part, joint_side
from harmolab.lab.person import Camera, stage_of
from harmolab.types import Motion

SKIN, HAIR, SHIRT, TROUSERS, SHOES = (205, 155, 125), (60, 42, 32), (176, 42, 48), (45, 55, 95), (235, 235, 230)
LAMP = np.array([-0.45, 0.65, 0.6])
# The limbs: two joints, radii at both (heights of the person), colour. "{}" stands for either side.
LIMBS = (
    ("shoulder", "elbow", 0.031, 0.025, SHIRT), ("elbow", "wrist", 0.024, 0.018, SKIN),
    ("wrist", "hand", 0.019, 0.016, SKIN), ("hip", "knee", 0.049, 0.034, TROUSERS),
    ("knee", "ankle", 0.034, 0.024, TROUSERS), ("heel", "toe", 0.022, 0.02, SHOES),
    ("ankle", "heel", 0.024, 0.022, SHOES),
)  # fmt: skip
NAMES = {"forearm": "wrist", "finger": "hand"}


class Limb(NamedTuple):
    """A round limb in view space: ends (3,), radii in metres, and colour."""

    begin: np.ndarray
    end: np.ndarray
    radii: tuple[float, float]
    colour: tuple[int, int, int]


def person_frames(
    motion: Motion, *, height: int, width: int, fps: float, follow: bool = False
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each picture its RGB (H, W, 3), and the mask (H, W) of the pixels where the person is."""
    stage = stage_of(resample_motion(upsample_motion(motion, fps), fps), follow=follow)
    camera, positions = stage.camera(height, width), stage.turned(stage.positions)
    joints: dict[tuple[str, str], int] = {}
    for index, name in enumerate(motion.skeleton.joints):
        joints.setdefault((joint_side(name), NAMES.get(joint_part(name), joint_part(name))), index)
    for frame in range(len(positions)):
        view = camera.to_view(positions[frame][None], slice(frame, frame + 1))[0]
        yield _picture({key: view[index] for key, index in joints.items()}, camera)


def _picture(joints: dict[tuple[str, str], np.ndarray], camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    height, width = round(camera.height), round(camera.width)
    picture, depth = np.zeros((height, width, 3), np.float32), np.full((height, width), np.inf, np.float32)
    for limb in [*_limbs(joints, camera.size), *_trunk(joints, camera.size)]:
        _paint(picture, depth, limb, camera)
    _paint_head(picture, depth, joints, camera)
    return picture.clip(0, 255), np.isfinite(depth)


def _limbs(joints: dict[tuple[str, str], np.ndarray], size: float) -> Iterator[Limb]:
    for side in ("left", "right"):
        for begin, end, first, last, colour in LIMBS:
            yield Limb(joints[side, begin], joints[side, end], (first * size, last * size), colour)


def _trunk(joints: dict[tuple[str, str], np.ndarray], size: float) -> Iterator[Limb]:
    shoulders = [joints[side, "shoulder"] for side in ("left", "right")]
    hips = [joints[side, "hip"] for side in ("left", "right")]
    neck, pelvis, head = np.mean(shoulders, axis=0), np.mean(hips, axis=0), _head(joints)[0]
    for share in np.linspace(0, 1, 12):  # across, from the shoulders to the hips
        left, right = ((1 - share) * above + share * below for above, below in zip(shoulders, hips, strict=True))
        middle = (left + right) / 2
        waist = 1 - 0.25 * np.sin(np.pi * share) - 0.12 * (share == 0)
        colour = SHIRT if share < 0.9 else TROUSERS
        yield Limb(middle + waist * (left - middle), middle + waist * (right - middle), (0.05 * size,) * 2, colour)
    yield Limb(neck, pelvis, (0.055 * size, 0.06 * size), SHIRT)
    yield Limb(neck, head, (0.033 * size, 0.03 * size), SKIN)


def _head(joints: dict[tuple[str, str], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The middle of the head, and its axis from left to right."""
    left, right = joints["left", "head"], joints["right", "head"]
    across = right - left
    return (left + right) / 2, across / max(float(np.linalg.norm(across)), 1e-9)


def _paint(picture: np.ndarray, depth: np.ndarray, limb: Limb, camera: Camera) -> None:
    ends = camera.to_pixels(np.stack([limb.begin, limb.end]))
    radii = camera.focal * np.array(limb.radii) / np.maximum([limb.begin[2], limb.end[2]], 0.1)
    low = np.floor((ends - radii[:, None]).min(axis=0)).astype(int).clip(0)
    high = np.ceil((ends + radii[:, None]).max(axis=0)).astype(int).clip(0, picture.shape[1::-1]) + 1
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    if not x.size or depth[part].shape != x.shape:
        x, y = (axis[: depth[part].shape[0], : depth[part].shape[1]] for axis in (x, y))
    along = ends[1] - ends[0]
    share = (((x - ends[0, 0]) * along[0] + (y - ends[0, 1]) * along[1]) / max(along @ along, 1e-6)).clip(0, 1)
    right, up = x - ends[0, 0] - share * along[0], -(y - ends[0, 1] - share * along[1])
    radius = radii[0] + share * (radii[1] - radii[0])
    inside = (right / radius) ** 2 + (up / radius) ** 2
    near = np.sqrt((1 - inside).clip(0))
    metres = limb.radii[0] + share * (limb.radii[1] - limb.radii[0])
    depths = limb.begin[2] + share * (limb.end[2] - limb.begin[2]) - near * metres
    is_seen = (inside < 1) & (depths < depth[part])
    light = 0.55 + 0.55 * ((right * LAMP[0] + up * LAMP[1]) / radius + near * LAMP[2]).clip(0)
    picture[part][is_seen] = (light[..., None] * np.array(limb.colour))[is_seen]
    depth[part][is_seen] = depths[is_seen]


def _paint_head(
    picture: np.ndarray, depth: np.ndarray, joints: dict[tuple[str, str], np.ndarray], camera: Camera
) -> None:
    """A ball with hair, eyes, brows and mouth."""
    middle, across = _head(joints)
    size = 0.068 * camera.size
    up_axis = middle - np.mean([joints[side, "shoulder"] for side in ("left", "right")], axis=0)
    up_axis = up_axis - (up_axis @ across) * across
    up_axis /= max(float(np.linalg.norm(up_axis)), 1e-9)
    front = np.cross(across, up_axis) * np.array([1, 1, 1.0])  # view space is left-handed: x right, y up, z away
    centre, radius = camera.to_pixels(middle), camera.focal * size / max(middle[2], 0.1)
    x, y = np.meshgrid(np.arange(picture.shape[1]), np.arange(picture.shape[0]))
    rows = np.s_[
        max(int(centre[1] - 1.3 * radius), 0) : max(int(centre[1] + 1.3 * radius) + 2, 0),
        max(int(centre[0] - 1.1 * radius), 0) : max(int(centre[0] + 1.1 * radius) + 2, 0),
    ]
    right, up = (x[rows] - centre[0]) / radius, -(y[rows] - centre[1]) / (1.22 * radius)
    inside = right**2 + up**2
    near = np.sqrt((1 - inside).clip(0))
    normal = np.stack([right, up, -near], axis=-1)
    a, u, f = normal @ across, normal @ up_axis, normal @ front
    colour = np.broadcast_to(np.array(SKIN, float), normal.shape).copy()
    colour[(u > 0.5) | (f < -0.05) & (u > -0.45)] = HAIR
    eyes = (np.abs(np.abs(a) - 0.36) < 0.13) & (np.abs(u - 0.12) < 0.07) & (f > 0)
    colour[eyes] = (240, 240, 240)
    colour[(np.abs(np.abs(a) - 0.36) < 0.06) & (np.abs(u - 0.12) < 0.07) & (f > 0)] = (40, 30, 30)
    colour[(np.abs(np.abs(a) - 0.36) < 0.16) & (np.abs(u - 0.27) < 0.04) & (f > 0)] = HAIR
    colour[(np.abs(a) < 0.26) & (np.abs(u + 0.45) < 0.06) & (f > 0)] = (150, 60, 60)
    colour[(np.abs(a) < 0.09) & (np.abs(u + 0.12) < 0.12) & (f > 0)] *= 0.85
    light = 0.55 + 0.55 * (right * LAMP[0] + up * LAMP[1] + near * LAMP[2]).clip(0)
    depths = middle[2] - near * size
    is_seen = (inside < 1) & (depths < depth[rows])
    picture[rows][is_seen] = (light[..., None] * colour)[is_seen]
    depth[rows][is_seen] = depths[is_seen]
