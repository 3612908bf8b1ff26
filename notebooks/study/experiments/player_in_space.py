"""A pianist and a violinist in space, seen by a camera whose place is set: the truth that an avatar is held against.

The movement is ours, not of any music: hands go from place to place along the keyboard, or the bow to and fro.
Arms follow by inverse kinematics with elbows that swing in and out, hands and fingers by angles.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from harmolab.body.kinematics import smooth
from harmolab.body.rotations import normal_part, two_bones
from harmolab.body.skeletons import turned
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, PHALANGES, PLAYER_50, SIDES
from harmolab.types import FloatArray, Motion

# Metres. Joints as estimators of poses see them lie nearer together than shoulders are wide.
HALF_SHOULDERS, HALF_HIPS, SPINE, UPPER_ARM, FOREARM = 0.175, 0.09, 0.5, 0.29, 0.25
HIP_HEIGHT = 0.54  # on a seat of 0.45
KEY_HEIGHT, KEY_DEPTH = 0.74, 0.34  # of the wrists: above the floor, before the shoulders
# Root of a finger from the wrist (along the hand, to the side of the thumb), its three bones, radians of its spread.
HAND = MappingProxyType(
    {
        "thumb": (0.03, 0.03, (0.04, 0.032, 0.026), 0.7),
        "index": (0.088, 0.025, (0.042, 0.026, 0.021), 0.12),
        "middle": (0.09, 0.005, (0.046, 0.03, 0.022), 0.0),
        "ring": (0.086, -0.014, (0.043, 0.028, 0.022), -0.1),
        "little": (0.078, -0.031, (0.034, 0.021, 0.019), -0.2),
    }
)
TURNS = MappingProxyType({"piano": np.radians(35.0), "violin": 0.0})  # radians, from the camera to the picture's right
FPS = 24.0
UP, FRONT = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Camera:
    """A level camera on the positive z side, above x = 0.

    Parameters
    ----------
    distance, height : float, metres, from z = 0 and above the floor
    focal : float, pixels
    centre : (float, float), pixel x and y (down) of what lies straight ahead
    """

    distance: float = 4.0
    height: float = 0.95
    focal: float = 1410.0
    centre: tuple[float, float] = (320.0, 240.0)

    def pixels(self, places: FloatArray) -> FloatArray:
        """(..., 2) pixels of places (..., 3), metres."""
        depth = self.distance - places[..., 2:]
        plane = self.focal * (places[..., :2] - np.array([0.0, self.height])) / depth
        return np.array(self.centre) + plane * np.array([1.0, -1.0])


@dataclass(frozen=True, eq=False)
class PlayerInSpace:
    """A planted player.

    Parameters
    ----------
    space : Motion, (T, 50, 3) metres, y up, z towards the camera, joints of `PLAYER_50`
    points : Motion, (T, 50, 2), the same in the picture: pixels, y down, with noise
    camera : Camera
    """

    space: Motion
    points: Motion
    camera: Camera


def elbow_angles(motion: Motion) -> FloatArray:
    """(T, 2) radians between upper arm and forearm, left and right; pi is a straight arm. ValueError without arms."""
    shoulders, elbows, wrists = (
        motion.positions[:, [motion.skeleton.joints.index(f"{side}_{part}") for side in SIDES]]
        for part in ("shoulder", "elbow", "wrist")
    )
    upper, lower = shoulders - elbows, wrists - elbows
    lengths = np.linalg.norm(upper, axis=2) * np.linalg.norm(lower, axis=2)
    return np.arccos(np.clip((upper * lower).sum(axis=2) / lengths, -1.0, 1.0))


def player_in_space(instrument: str, *, seconds: float = 20.0, seed: int = 1, noise: float = 1.0) -> PlayerInSpace:
    """A player on a seat before a camera; the pianist is turned, so that the left end is nearer to the camera.

    Parameters
    ----------
    instrument : "piano" or "violin"
    seconds : float, length
    seed : int
    noise : float, pixels, standard deviation of each coordinate of the points

    Raises
    ------
    ValueError
        For another instrument, or a noise or length that cannot be.
    """
    if instrument not in INSTRUMENTS:
        raise ValueError(f"instrument must be {' or '.join(INSTRUMENTS)}, got {instrument!r}")
    if not (0 <= noise < np.inf and 2 <= seconds * FPS < np.inf):
        raise ValueError(f"a player needs two frames and a noise of 0 or more, got {seconds} s, {noise} px")
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * FPS)) / FPS
    trunk = _trunk(times, rng)
    arms = _pianist(times, rng) if instrument == "piano" else _violinist(times, rng, trunk)
    places = {**trunk, **_limbs(times, rng, trunk, arms)}
    own = np.stack([places[name] for name in PLAYER_50.joints], axis=1)
    space, camera = turned(own, TURNS[instrument]), Camera()
    points = camera.pixels(space) + rng.normal(0.0, noise, (*space.shape[:2], 2))
    return PlayerInSpace(Motion(space, FPS, PLAYER_50), Motion(points, FPS, PLAYER_50), camera)


def _wave(times: FloatArray, rng: np.random.Generator, period: float) -> FloatArray:
    """(T,) a slow wave between -1 and 1 of about that period, with a random phase."""
    return np.sin(2 * np.pi * (times / (period * rng.uniform(0.8, 1.25)) + rng.uniform()))


def _steps(times: FloatArray, rng: np.random.Generator, low: float, high: float, pause: float) -> FloatArray:
    """(T,) places between `low` and `high` that change every `pause` seconds or so, by smooth moves of 0.2 s."""
    changes = np.cumsum(rng.uniform(0.5 * pause, 1.5 * pause, int(times[-1] / (0.5 * pause)) + 2))
    targets = rng.uniform(low, high, changes.size + 1)
    return smooth(targets[np.searchsorted(changes, times)], 0.08, FPS)


def _trunk(times: FloatArray, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Shoulders and hips of a player who sways a little from side to side, in the player's own frame."""
    lean, shift = 0.05 * _wave(times, rng, 8.0), 0.015 * _wave(times, rng, 5.0)
    nil = np.zeros_like(times)
    root = np.stack([shift, nil + HIP_HEIGHT, nil], axis=1)
    spine = np.stack([np.sin(lean), np.cos(lean), nil], axis=1)
    across = np.stack([np.cos(lean), -np.sin(lean), nil], axis=1)
    places: dict[str, FloatArray] = {}
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        places[f"{side}_shoulder"] = root + SPINE * spine + sign * HALF_SHOULDERS * across
        places[f"{side}_hip"] = root + sign * HALF_HIPS * np.array([1.0, 0.0, 0.0])
    return places


class _Arm(NamedTuple):
    """Targets of an arm: `wrist` (T, 3), `pole` (T, 3) of the elbow, `along` (T, 3) the hand, `palm` its normal."""

    wrist: FloatArray
    pole: FloatArray
    along: FloatArray
    palm: FloatArray


def _pianist(times: FloatArray, rng: np.random.Generator) -> list[_Arm]:
    """Both arms: wrists go along the keyboard, a little up and down and to and fro."""
    arms = []
    for sign in (1.0, -1.0):
        x = sign * _steps(times, rng, 0.04, 0.38, 0.8)
        height = KEY_HEIGHT + 0.012 * _wave(times, rng, 0.9)
        wrist = np.stack([x, height, KEY_DEPTH + 0.02 * _wave(times, rng, 4.0)], axis=1)
        outwards = sign * (0.5 + 0.3 * _wave(times, rng, 3.0))
        pole = np.stack([outwards, -np.ones_like(times), -0.3 + 0.2 * _wave(times, rng, 6.0)], axis=1)
        along = np.stack([0.5 * x, np.full_like(x, -0.12), np.ones_like(x)], axis=1)
        arms.append(_Arm(wrist, pole, along, np.broadcast_to(-UP, wrist.shape)))
    return arms


def _violinist(times: FloatArray, rng: np.random.Generator, trunk: dict[str, FloatArray]) -> list[_Arm]:
    """Left arm along the neck of the violin, right arm with the bow, across it near the bridge."""
    chin = (trunk["left_shoulder"] + trunk["right_shoulder"]) / 2 + np.array([0.04, 0.12, 0.07])
    angle = np.radians(48.0 + 3.0 * _wave(times, rng, 6.0))
    neck = np.stack([np.sin(angle), 0.05 * _wave(times, rng, 7.0), np.cos(angle)], axis=1)
    left = chin + neck * _steps(times, rng, 0.36, 0.46, 0.7)[:, None] - 0.07 * UP
    pole = np.stack([0.3 + 0.1 * _wave(times, rng, 4.0), -np.ones_like(times), np.full_like(times, 0.2)], axis=1)
    fingering = _Arm(left, pole, UP + 0.6 * np.cross(UP, neck) - 0.3 * neck, -np.cross(UP, neck))
    tilt = _steps(times, rng, -0.25, 0.25, 0.9)
    away = np.stack([-np.cos(angle), np.sin(tilt), np.sin(angle)], axis=1)
    stroke = 0.19 + 0.12 * np.sin(np.cumsum(2 * np.pi * _steps(times, rng, 0.4, 1.1, 1.5)) / FPS)
    right = chin + 0.19 * neck + away * stroke[:, None] + 0.04 * UP
    raised = np.stack([-np.ones_like(times), -0.6 + 0.2 * _wave(times, rng, 5.0), np.full_like(times, 0.1)], axis=1)
    return [fingering, _Arm(right, raised, -away - 0.6 * UP, np.broadcast_to(-UP, right.shape) - 0.3 * neck)]


def _limbs(
    times: FloatArray, rng: np.random.Generator, trunk: dict[str, FloatArray], arms: list[_Arm]
) -> dict[str, FloatArray]:
    """Elbows, wrists and both hands."""
    places: dict[str, FloatArray] = {}
    for side, sign, arm in zip(SIDES, (1.0, -1.0), arms, strict=True):
        elbow, wrist = two_bones(trunk[f"{side}_shoulder"], arm.wrist, UPPER_ARM, FOREARM, arm.pole)
        along = arm.along / np.linalg.norm(arm.along, axis=1, keepdims=True)
        palm = normal_part(arm.palm, along)
        # Towards the thumb: with palms down and fingers ahead thumbs lie side by side.
        thumbwards = sign * np.cross(along, -palm)
        places |= {f"{side}_elbow": elbow, f"{side}_wrist": wrist, f"{side}_hand": wrist}
        for finger in FINGERS:
            bend = 0.25 + 0.3 * _steps(times, rng, 0.0, 1.0, 0.4)
            places |= _finger(f"{side}_{finger}", wrist, np.stack([along, thumbwards, palm]), bend)
    return places


def _finger(name: str, wrist: FloatArray, axes: FloatArray, bend: FloatArray) -> dict[str, FloatArray]:
    """The four points of a finger; `axes` (3, T, 3) of the hand: along, to the thumb, out of the palm."""
    forward, aside, bones, spread = HAND[name.rpartition("_")[2]]
    along, thumbwards, palm = axes
    ahead = np.cos(spread) * along + np.sin(spread) * thumbwards
    places = [wrist + forward * along + aside * thumbwards]
    for number, bone in enumerate(bones):
        angle = (bend * (1 + 0.6 * number))[:, None]
        places.append(places[-1] + bone * (np.cos(angle) * ahead + np.sin(angle) * palm))
    return {f"{name}_{place}": places[place - 1] for place in range(1, PHALANGES + 1)}
