"""Settings of the avatar (Sec. 5), and the measures of its body."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from harmolab.systems.common.feature_params import check_numbers

DepthLaw = Literal["root", "linear"]

# Metres. Joints as estimators of poses see them: shoulders lie nearer together than they are wide.
SHOULDERS, HIPS, SPINE, HEAD = 0.36, 0.18, 0.5, 0.2
FOREARM, UPPER_ARM = 0.26, 0.3
THIGH, SHANK, ANKLE, TOE = 0.43, 0.42, 0.08, 0.16
HIP_ABOVE_SEAT = 0.09
# Root of a finger from the wrist (along the hand, to the side of the thumb) and its three bones.
HAND = MappingProxyType(
    {
        "thumb": (0.03, 0.032, (0.042, 0.032, 0.027)),
        "index": (0.09, 0.026, (0.042, 0.026, 0.022)),
        "middle": (0.092, 0.005, (0.047, 0.03, 0.023)),
        "ring": (0.087, -0.014, (0.043, 0.028, 0.023)),
        "little": (0.078, -0.032, (0.034, 0.021, 0.02)),
    }
)


@dataclass(frozen=True)
class AvatarParams:
    """Settings by which points become an avatar.

    Parameters
    ----------
    depth : "root" or "linear"
        Forward offset of a bone of length L that is l long in the picture: sqrt(L^2 - l^2), or L - l.
    percentile : float, 0 to 100
        L is this percentile of l over all frames; the paper's is 100, the longest, which one bad frame decides.
    smoothing : float, seconds
        Standard deviation of the Gaussian over l, since dz/dl is infinite where l = L.
    least_forearm : float, in mean shoulder distances
        The forearm is at least so long; an arm that never lies in the plane of the picture does not show its length.
    elbow_depth : bool
        The upper arm brings the elbow forward by the same law; else, as in the paper, only the forearm counts.
    dead_band : float, widths of the palm
        A hand turns over where its index finger is past the little finger by so much, not before.
    piano_turn : float, radians
        By which a pianist is turned; what is farther left in the picture is nearer to the camera.
    seat : float, metres, height of the stool
    """

    depth: DepthLaw = "root"
    percentile: float = 99.0
    smoothing: float = 0.1
    least_forearm: float = 0.6
    elbow_depth: bool = True
    dead_band: float = 0.15
    piano_turn: float = float(np.radians(35.0))
    seat: float = 0.45

    def __post_init__(self) -> None:
        check_numbers(self, positive=("percentile", "seat"), not_negative=("smoothing", "least_forearm", "dead_band"))
        if self.depth not in ("root", "linear"):
            raise ValueError(f"depth must be root or linear, got {self.depth!r}")
        if self.percentile > 100:
            raise ValueError(f"percentile must be 100 at most, got {self.percentile}")
        if not abs(self.piano_turn) < np.radians(80.0):
            raise ValueError(f"piano_turn must lie within 80 degrees, in radians, got {self.piano_turn}")

    @classmethod
    def paper(cls) -> AvatarParams:
        """As Sec. 5 has it: the longest forearm of all frames as it comes, and the forearm alone makes the depth."""
        return cls(percentile=100.0, smoothing=0.0, least_forearm=0.0, elbow_depth=False)
