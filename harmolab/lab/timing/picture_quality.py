"""Is the flow of a picture the dancer's movement? Where it is not, no dancer is judged by it.

Flow follows everything that moves. A dancer is surrounded by what should rest: at the left, right and upper edge of the
picture. The share of that edge which moves tells a shaking camera and a moving background.

The limits were chosen on 92 planted videos (`tests/phone_videos.py`) of ten dancers, and tried on 67 of ten others.
Where at most .27 of the edge moved, the correlation of the flow with the true movement of the body was about that of a
clean film of the same dance; where .33 or more did, it was .31 at most. A sensor's noise of up to 20 grey levels,
compression (CRF 23 to 35) and 8 to 60 pictures a second made no such difference.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from harmolab.beats.flow import STILL
from harmolab.io.pose import UNREAD

ROWS, COLUMNS = 6, 8  # of the grid that is looked at
EDGE_MOVES = 0.3  # share of the edge, over all pictures
ALL_MOVES = 0.75  # share of the picture that moves in one picture of ten: the camera, and not a part of the background
LEAST_RATE = 8.0  # hertz, the slowest that was tried
SHAKES = "the camera moves; put it on something that stands still"
MOVES = "the background moves, or others do; film with only yourself in the picture"
NOTHING = "nothing moves in the picture"


@dataclass(eq=False)
class PictureWatch:
    """Which cells of a video's picture move, picture by picture; to be called by `flow_directograms`."""

    cells: list[NDArray[np.bool_]] = field(default_factory=list)

    def __call__(self, speed: NDArray[np.float32]) -> None:
        """Look at the speed of every pixel (H, W), picture heights per second."""
        moving = np.where(speed > STILL, speed, np.float32(0.0))
        means = cv2.resize(moving, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
        self.cells.append(means > STILL / 2)

    @property
    def edge(self) -> float:
        """Share of the left, right and upper edge that moves, over all pictures."""
        cells = np.stack(self.cells)
        return float(np.concatenate([cells[:, :, 0], cells[:, :, -1], cells[:, 0, 1:-1]], axis=1).mean())

    @property
    def most(self) -> float:
        """Share of the picture that moves in the liveliest tenth of the pictures, at least."""
        return float(np.percentile(np.stack(self.cells).mean(axis=(1, 2)), 90))

    def check(self) -> None:
        """ValueError, with the reason, where the flow is not that of a dancer."""
        if not self.cells or not np.any(self.cells):
            raise ValueError(UNREAD + NOTHING)
        if self.edge > EDGE_MOVES:
            raise ValueError(UNREAD + (SHAKES if self.most > ALL_MOVES else MOVES))


def check_rate(fps: float) -> None:
    """ValueError for a video of too few pictures a second."""
    if fps < LEAST_RATE:
        raise ValueError(f"{UNREAD}{fps:g} pictures a second are too few; film with {LEAST_RATE:g} or more")
