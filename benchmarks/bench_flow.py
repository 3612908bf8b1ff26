"""Speed of the visual beats from video, against a straightforward reference in the style of visbeat.

The reference runs Farneback's dense flow on the whole picture and a numpy histogram over all pixels. Both see the same
frames, one after the other in one process; only the ratio means something on another machine.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import best_of
from harmolab.beats.flow import envelope_beats, flow_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.render.stick import render_skeleton

Frame = NDArray[np.uint8]
FPS = 25.0


def farneback_beats(frames: Sequence[Frame]) -> int:
    """Number of beats by the reference."""
    columns = []
    for before, after in itertools.pairwise(frames):
        flow = cv2.calcOpticalFlowFarneback(before, after, None, 0.5, 3, 15, 3, 5, 1.2, 0)
        length = np.linalg.norm(flow, axis=2)
        angle = np.arctan2(flow[..., 1], flow[..., 0])
        columns.append(np.histogram(angle, bins=128, range=(-np.pi, np.pi), weights=length)[0])
    impacts = np.maximum(-np.diff(np.array(columns), axis=0), 0).sum(axis=1)
    return len(envelope_beats(impacts / impacts.max(), FPS))


def measure(repeats: int = 3) -> dict[str, float]:
    """Milliseconds a frame (240 x 427 pixels, one core) of ours and of the reference, and the ratio."""
    motion = synthetic_clip("cha-cha", seconds=4.0, fps=FPS, seed=0).motion
    frames = list(render_skeleton(motion, height=240, width=427))
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        ours = best_of(lambda: flow_beats(frames, FPS), repeats) / len(frames)
        reference = best_of(lambda: farneback_beats(frames[:25]), repeats) / 25
    finally:
        cv2.setNumThreads(threads)
    return {"flow_ms_per_frame": ours, "reference_ms_per_frame": reference, "times_faster": reference / ours}


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:24s}{value:8.2f}")
