"""Speed of `harmolab play` at 480p and 30 pictures a second, as times real time: drawing, coding, and both.

One core's work: processor seconds of the whole process, which other programs on the machine do not lengthen. Drawn
pictures are thrown away in the first row; in the second the same pictures are coded with their sound.
"""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2

from harmolab.beats.audio import music_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.render.scene import render_dance
from harmolab.params import HarmonyParams
from harmolab.readers.video import write_video
from harmolab.types import Clip
from harmolab.verdict.judge import score_motion

FPS, SECONDS = 30.0, 20.0


def processor_seconds(work: Callable[[], object], rounds: int) -> float:
    """Fewest processor seconds of `rounds` runs."""
    times = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def measure(rounds: int = 3, seconds: float = SECONDS) -> dict[str, float]:
    """Times real time, name -> ratio, of a waltz with all marks."""
    clip = synthetic_clip("waltz", seconds=seconds, seed=1)
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        return _measured(clip, rounds)
    finally:
        cv2.setNumThreads(threads)


def _measured(clip: Clip, rounds: int) -> dict[str, float]:
    motion = clip.motion
    if motion is None:
        raise ValueError("the clip has no motion")
    score = score_motion(music_beats(clip), motion, params=HarmonyParams.valleys(), n_rotations=0)
    draw = partial(render_dance, motion, fps=FPS, score=score)
    frames = list(draw())
    with tempfile.TemporaryDirectory() as folder:
        mp4, webm = (Path(folder) / name for name in ("x.mp4", "x.webm"))
        work: dict[str, Callable[[], object]] = {
            "drawing": lambda: deque(draw(), maxlen=0),
            "coding mp4": lambda: write_video(mp4, frames, FPS, audio=clip.audio),
            "coding webm": lambda: write_video(webm, frames, FPS, audio=clip.audio),
            "both, mp4": lambda: write_video(mp4, draw(), FPS, audio=clip.audio),
            "both, webm": lambda: write_video(webm, draw(), FPS, audio=clip.audio),
        }
        return {name: len(frames) / FPS / processor_seconds(job, rounds) for name, job in work.items()}


if __name__ == "__main__":
    for name, ratio in measure().items():
        print(f"{name:16s}{ratio:6.1f} x real time")
