"""Videos as a phone makes them, of dancers whose every movement is known: the planted answers of reading a video.

A person with skin, hair and clothes, lit by a lamp, before a wall with a texture, filmed by a hand that shakes, through
a noisy sensor, compressed hard; perhaps beside a second person who hardly moves, perhaps with the feet out of sight.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import av
import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.body.skeletons import joint_part, joint_side
from harmolab.lab.person import Camera, stage_of
from harmolab.readers.video import AUDIO_RATE
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import Audio, BeatTrack, Clip, Motion

Frame = np.ndarray
START = 0.5  # seconds of the song before the film begins


@dataclass(frozen=True)
class Phone:
    """How a dance is filmed.

    Parameters
    ----------
    fps : float, hertz
    noise : float, standard deviation in grey levels of 255, anew in every frame
    shake : float, pixels, standard deviation of a hand's quick tremor; its slow sway is three times as wide
    crf : int, of H.264; more is worse
    contrast : float, of the texture of the wall, 0 for a plain one
    people : 1, or 2 with one beside who hardly moves
    has_feet : bool, False where the picture ends at the knees
    curtain : float, pixels by which a part of the wall swings to either side, at a tempo of its own
    height : int, pixels
    seed : int
    """

    fps: float = 30.0
    noise: float = 2.0
    shake: float = 0.0
    crf: int = 28
    contrast: float = 1.0
    people: int = 1
    has_feet: bool = True
    curtain: float = 0.0
    height: int = 480
    seed: int = 0


def wall(height: int, width: int, contrast: float, seed: int) -> Frame:
    """(H, W, 3) picture of a room: blotches of all sizes and things with edges, the same in every frame."""
    rng, picture = np.random.default_rng(seed), np.full((height, width, 3), 150.0)
    for size in (3, 7, 15, 40, 100):
        blotches = rng.normal(0, 1, (height // size + 2, width // size + 2, 1)) + rng.normal(0, 0.2, 3)
        smooth = cv2.resize(blotches, (width + size, height + size), interpolation=cv2.INTER_CUBIC)
        picture += contrast * (4 + size / 6) * smooth[:height, :width]
    for _ in range(round(12 * min(contrast, 1.0))):
        left, top, wide, high = rng.uniform(0, 0.9, 2).tolist() + rng.uniform(0.03, 0.25, 2).tolist()
        rows = slice(round(top * height), round((top + high) * height))
        colour = rng.uniform(40, 220) + rng.normal(0, 20, 3)
        picture[rows, round(left * width) : round((left + wide) * width)] *= 0.3
        picture[rows, round(left * width) : round((left + wide) * width)] += 0.7 * colour
    return np.clip(picture, 20, 235).astype(np.float32)


def phone_frames(motion: Motion, phone: Phone) -> Iterator[Frame]:
    """(H, W, 3) uint8 frames, frame i at i / fps seconds of the motion."""
    height, width = phone.height, round(phone.height * 4 / 3)
    rng, room = np.random.default_rng(phone.seed + 1), wall(height, width, phone.contrast, phone.seed)
    people = [motion] if phone.people == 1 else [motion, hardly_moving(motion)]
    drawn = [person_frames(one, height=height, width=width, fps=phone.fps, follow=phone.people > 1) for one in people]
    shifts = [0] if phone.people == 1 else [round(0.22 * width), -round(0.22 * width)]
    grains = phone.noise * rng.standard_normal((4, height + 64, width + 64, 3), np.float32)
    hand = _hand(motion.n_frames / motion.fps * phone.fps, phone, rng)
    for index, (pictures, (right, down, turn)) in enumerate(zip(zip(*drawn, strict=False), hand, strict=False)):
        frame, swing = room.copy(), phone.curtain * np.sin(2 * np.pi * 0.83 * index / phone.fps)
        if phone.curtain:
            frame[:, -width // 3 :] = np.roll(room, round(swing * height / 480), axis=1)[:, -width // 3 :]
        for (picture, mask), shift in zip(pictures, shifts, strict=True):
            is_person = np.roll(mask, shift, axis=1)
            frame[is_person] = np.roll(picture, shift, axis=1)[is_person]
        matrix = cv2.getRotationMatrix2D((width / 2, 0.1 * height), turn, 1.0 if phone.has_feet else 1.35)
        matrix[:, 2] += right, down
        blurred = cv2.GaussianBlur(frame, (3, 3), 0.7)
        seen = cv2.warpAffine(blurred, matrix, (width, height), borderMode=cv2.BORDER_REFLECT)
        down, right = rng.integers(0, 64, 2)
        seen += grains[rng.integers(4), down : down + height, right : right + width]
        yield np.clip(seen, 0, 255).astype(np.uint8)


def hardly_moving(motion: Motion) -> Motion:
    """Another person beside, who sways a little, at a tempo of her own."""
    times = np.arange(motion.n_frames) / motion.fps
    pose = np.repeat(motion.positions[:1], motion.n_frames, axis=0)
    sway = 0.04 * np.sin(2 * np.pi * 0.31 * times)[:, None] * (pose[:, :, 1] / pose[:, :, 1].max())
    return replace(motion, positions=pose + np.stack([sway, 0 * sway, 0 * sway], axis=-1))


def _hand(frames: float, phone: Phone, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Pixels to the right and down, and degrees, by which the picture is moved in each frame."""
    number = round(frames) + 2
    if not phone.shake:
        yield from np.zeros((number, 3))
        return
    moves = np.zeros((number, 3))
    for seconds, size in ((0.06, phone.shake), (0.5, 3 * phone.shake)):
        smooth = gaussian_filter1d(rng.normal(0, 1, (number, 3)), seconds * phone.fps, axis=0)
        moves += size * smooth / smooth.std(axis=0)
    yield from moves * (phone.height / 480) * np.array([1, 1, 0.1])


def film(path: Path, motion: Motion, sound: Audio | None, phone: Phone) -> Path:
    """The file, which then holds the film of a motion with the sound that was in the room."""
    rate = Fraction(phone.fps).limit_denominator(1000)
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=rate, options={"crf": str(phone.crf), "preset": "veryfast"})
        video.height, video.width, video.pix_fmt = phone.height, round(phone.height * 4 / 3), "yuv420p"
        if sound is not None:
            write_sound(container, sound)
        for frame in phone_frames(motion, phone):
            container.mux(video.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(video.encode())
    return path


def write_sound(container: Any, sound: Audio) -> None:
    stream = container.add_stream("aac", rate=AUDIO_RATE, layout="mono")
    resampler = av.AudioResampler("fltp", "mono", AUDIO_RATE)
    rate, size = round(sound.sample_rate), 4096
    for start in range(0, sound.samples.size, size):
        part = av.AudioFrame.from_ndarray(sound.samples[None, start : start + size].astype(np.float32), "fltp", "mono")
        part.sample_rate, part.pts, part.time_base = rate, start, Fraction(1, rate)
        for one in resampler.resample(part):
            container.mux(stream.encode(one))
    for one in resampler.resample(None):
        container.mux(stream.encode(one))
    container.mux(stream.encode())


def filmed_part(clip: Clip, *, seconds: float | None = None) -> tuple[Motion, Audio, BeatTrack]:
    """The movement that is filmed, the music in the room meanwhile, and its beats, all from `START` on."""
    assert clip.motion is not None and clip.beats is not None
    length = clip.motion.duration - START - 0.1 if seconds is None else seconds
    return clip.motion.span(START, length), clip.audio.span(START, length), clip.beats.span(START, length)


def agreement(true: Motion, read: Motion, *, most: float = 0.15) -> tuple[float, float]:
    """Best correlation of the shape speeds, and how many seconds the read one comes later there."""
    first, second = (shape_signal(shape_speed(motion)) for motion in (true, read))
    times = np.arange(0.3, min(first.times[-1], second.times[-1]) - 0.3, 0.005)
    shifts = 0.005 * np.arange(-round(most / 0.005), round(most / 0.005) + 1)
    true_values = np.interp(times, first.times, first.values)
    later = (np.interp(times + shift, second.times, second.values) for shift in shifts)
    fits = [np.corrcoef(true_values, values)[0, 1] for values in later]
    best = int(np.argmax(fits))
    return float(fits[best]), float(shifts[best])


# A person: enough like a filmed one for a pose estimator to find the body. Limbs are round and get thinner; each pixel
# has the depth and the normal of the nearest limb.

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
