"""Speed of the kinetic and geometric features, against per-frame loops in the style of the published AIST++ code.

The references ask for every joint, frame and window anew, with small numpy arrays in Python loops, and give the same
numbers as our ``form="aist++"``; `measure` checks that. Both see the same clip, one after the other in one process on
one thread; only the ratio means something on another machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import best_of
from harmolab.body.skeletons import Skeleton
from harmolab.metrics.features import geometric_features, kinetic_features
from harmolab.types import Motion

FloatArray = NDArray[np.float64]

SMPL_24 = Skeleton(
    (
        *("root", "lhip", "rhip", "belly", "lknee", "rknee", "spine", "lankle", "rankle", "chest", "ltoes", "rtoes"),
        *("neck", "linshoulder", "rinshoulder", "head", "lshoulder", "rshoulder", "lelbow", "relbow"),
        *("lwrist", "rwrist", "lhand", "rhand"),
    ),
    (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21),
)
# A standing body, left is +x, metres.
STANDING = np.array([
    [0, 0.95, 0], [0.07, 0.87, 0], [-0.07, 0.87, 0], [0, 1.07, 0], [0.09, 0.5, 0.01], [-0.09, 0.5, 0.01], [0, 1.2, 0],
    [0.1, 0.08, 0], [-0.1, 0.08, 0], [0, 1.26, 0], [0.11, 0.02, 0.08], [-0.11, 0.02, 0.08], [0, 1.46, 0],
    [0.08, 1.38, 0], [-0.08, 1.38, 0], [0, 1.56, 0.02], [0.19, 1.4, 0], [-0.19, 1.4, 0], [0.24, 1.15, 0.02],
    [-0.24, 1.15, 0.02], [0.26, 0.93, 0.1], [-0.26, 0.93, 0.1], [0.26, 0.86, 0.13], [-0.26, 0.86, 0.13],
])  # fmt: skip
HUMERUS, SHOULDERS, HIPS = 0.2568381092115207, 0.39084835854945527, 0.11924706586886204  # AIST++, metres


def moving_body(seconds: float = 10.0, fps: float = 60.0, *, seed: int = 0) -> Motion:
    """24 joints that swing about a standing pose, each in its own way, for ten seconds at 60 frames per second."""
    rng = np.random.default_rng(seed)
    moments = np.arange(round(seconds * fps))[:, None, None, None] / fps
    speeds, starts = rng.uniform(0.3, 2.5, (24, 3, 4)), rng.uniform(0, 2 * np.pi, (24, 3, 4))
    sway = np.sin(2 * np.pi * speeds * moments + starts).sum(axis=-1) * 0.06 * STANDING[:, 1, None]
    return Motion(STANDING + sway, fps, SMPL_24)


def loop_kinetic(positions: FloatArray, step: float = 1 / 60, reach: int = 2) -> FloatArray:
    """Kinetic features joint by joint, frame by frame, with the bracket error of the published code."""
    found = []
    for joint in range(positions.shape[1]):
        sums = np.zeros(3)
        for frame in range(1, len(positions)):
            moved, gained, counts = np.zeros(3), np.zeros(3), [0, 0]
            for near in range(frame - reach, frame + reach + 1):
                if near >= 1 and near < len(positions):
                    moved += positions[near][joint] - positions[near - 1][joint]
                    counts[0] += 1
                if near >= 1 and near + 1 < len(positions):
                    later = (positions[near + 1][joint] - positions[near][joint]) / step
                    earlier = positions[near][joint] - positions[near - 1][joint] / step
                    gained += (later - earlier) / step
                    counts[1] += 1
            velocity = moved / (counts[0] * step)
            sums[0] += np.linalg.norm(velocity[[0, 2]]) ** 2
            sums[1] += velocity[1] ** 2
            sums[2] += np.linalg.norm(gained / counts[1])
        found.append(sums / (len(positions) - 1))
    return np.concatenate(found)


class LoopBody:
    """One frame and the one before it, asked relation by relation."""

    def __init__(self, before: FloatArray, now: FloatArray) -> None:
        self.before, self.now = before, now

    def at(self, *names: str) -> list[FloatArray]:
        """Places of joints by name."""
        return [np.array(self.now[SMPL_24.joints.index(name)]) for name in names]

    def velocity(self, name: str, origin: str | None = None) -> FloatArray:
        """Velocity by the time step of 120 frames per second, of a joint or of it against another."""
        joint = SMPL_24.joints.index(name)
        step = np.array(self.now[joint]) - np.array(self.before[joint])
        return step * 120 if origin is None else step * 120 - self.velocity(origin)

    def move(self, a: str, b: str, c: str, limit: float) -> bool:
        """Velocity of c against a, along the line from a to b."""
        start, end = self.at(a, b)
        return bool(np.dot(self.velocity(c, a), end - start) / np.linalg.norm(end - start) > limit)

    def plane_move(self, a: str, b: str, c: str, d: str, limit: float) -> bool:
        """Velocity of d against a, along the normal of the plane through a, b, c."""
        normal = self.normal(a, b, c)
        return bool(np.dot(self.velocity(d, a), normal) / np.linalg.norm(normal) > limit)

    def normal(self, a: str, b: str, c: str) -> FloatArray:
        """Normal of the plane through three joints."""
        pa, pb, pc = self.at(a, b, c)
        return np.cross(pc - pa, pb - pa)

    def plane(self, a: str, b: str, c: str, d: str, limit: float) -> bool:
        """Distance of d from the plane through a, b, c."""
        pa, pd = self.at(a, d)
        normal = self.normal(a, b, c)
        return bool(np.dot(normal, pd - pa) / np.linalg.norm(normal) > limit)

    def beyond(self, a: str, b: str, c: str, d: str, limit: float) -> bool:
        """Distance from c to d along the line from a to b."""
        pa, pb, pc, pd = self.at(a, b, c, d)
        return bool(np.dot(pb - pa, pd - pc) / np.linalg.norm(pb - pa) > limit)

    def angle(self, a: str, b: str, c: str, d: str, low: float, high: float) -> bool:
        """Angle between the lines from a to b and from c to d, in degrees."""
        pa, pb, pc, pd = self.at(a, b, c, d)
        return bool(low < self.degrees(pb - pa, pd - pc) < high)

    @staticmethod
    def degrees(one: FloatArray, other: FloatArray) -> float:
        """Angle between two vectors."""
        return float(np.degrees(np.arccos(np.dot(one, other) / (np.linalg.norm(one) * np.linalg.norm(other)))))

    def height(self, name: str) -> float:
        """Height above the lowest joint."""
        return float(self.at(name)[0][1] - min(place[1] for place in self.now))

    def fast(self, name: str, limit: float) -> bool:
        """Whether a joint's speed exceeds a limit."""
        return bool(np.linalg.norm(self.velocity(name)) > limit)

    def relations(self) -> list[bool]:
        """The 32 of them, as the published code has them."""
        root, neck = self.at("root", "neck")
        return [
            self.plane_move("neck", "rhip", "lhip", "rwrist", 1.8 * HUMERUS),
            self.plane_move("neck", "lhip", "rhip", "lwrist", 1.8 * HUMERUS),
            self.beyond("chest", "neck", "neck", "rwrist", 0.2 * HUMERUS),
            self.beyond("chest", "neck", "neck", "lwrist", 0.2 * HUMERUS),
            self.move("belly", "chest", "chest", 1.8 * HUMERUS),
            self.move("belly", "chest", "chest", 1.8 * HUMERUS),
            self.angle("relbow", "rshoulder", "relbow", "rwrist", 0, 110),
            self.angle("lelbow", "lshoulder", "lelbow", "lwrist", 0, 110),
            self.beyond("lshoulder", "rshoulder", "lwrist", "rwrist", 2.5 * SHOULDERS),
            self.move("lwrist", "rwrist", "rwrist", 1.4 * HUMERUS),
            self.move("rwrist", "root", "lwrist", 1.4 * HUMERUS),
            self.move("lwrist", "root", "rwrist", 1.4 * HUMERUS),
            self.fast("rwrist", 2.5 * HUMERUS),
            self.fast("lwrist", 2.5 * HUMERUS),
            self.plane("root", "lhip", "ltoes", "rankle", 0.38 * HUMERUS),
            self.plane("root", "rhip", "rtoes", "lankle", 0.38 * HUMERUS),
            self.height("rankle") > 1.2 * HUMERUS,
            self.height("lankle") > 1.2 * HUMERUS,
            self.beyond("lhip", "rhip", "lankle", "rankle", 2.1 * HIPS),
            self.angle("rknee", "rhip", "rknee", "rankle", 0, 110),
            self.angle("lknee", "lhip", "lknee", "lankle", 0, 110),
            self.fast("rankle", 2.5 * HUMERUS),
            self.fast("lankle", 2.5 * HUMERUS),
            self.angle("neck", "root", "rshoulder", "relbow", 25, 180),
            self.angle("neck", "root", "lshoulder", "lelbow", 25, 180),
            self.angle("neck", "root", "rhip", "rknee", 50, 180),
            self.angle("neck", "root", "lhip", "lknee", 50, 180),
            self.plane("rankle", "neck", "lankle", "root", 0.5 * HUMERUS),
            70 < self.degrees(root - neck, np.array([0.0, 1.0, 0.0])) < 110,
            self.height("rwrist") < 1.2 * HUMERUS,
            self.height("lwrist") < 1.2 * HUMERUS,
            self.fast("root", 2.3 * HUMERUS),
        ]


def loop_geometric(positions: FloatArray) -> FloatArray:
    """Geometric features frame by frame."""
    moments = [LoopBody(positions[t - 1], positions[t]).relations() for t in range(1, len(positions))]
    return np.mean(moments, axis=0)


def measure(rounds: int = 200) -> dict[str, float]:
    """Milliseconds a clip of ten seconds (60 frames per second, 24 joints), and the ratios to the references."""
    clip = moving_body()
    np.testing.assert_allclose(kinetic_features(clip, form="aist++"), loop_kinetic(clip.positions), rtol=1e-9)
    np.testing.assert_allclose(geometric_features(clip, form="aist++"), loop_geometric(clip.positions), atol=1e-12)
    figures = {}
    for name, ours, reference in (
        ("kinetic", kinetic_features, loop_kinetic),
        ("geometric", geometric_features, loop_geometric),
    ):
        fast = best_of(lambda ours=ours: ours(clip), rounds)
        slow = best_of(lambda reference=reference: reference(clip.positions), 3)
        figures |= {f"{name} (ms a clip)": fast, f"{name}, loops (ms a clip)": slow, f"{name} (ratio)": slow / fast}
    return figures


if __name__ == "__main__":
    for label, value in measure().items():
        print(f"{label:30} {value:10.2f}")
