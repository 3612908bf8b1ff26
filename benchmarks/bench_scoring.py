"""Speed of the score core: milliseconds, and ratios to the plain path and to a bare librosa process, in one run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import soundfile

from benchmarks.timing import best_of
from harmolab.corpora.synthetic import synthetic_clip
from harmolab.harmony import score_harmony
from harmolab.io.motion import save_motion
from harmolab.lab.compare.batch import BeatBatch, rescore
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack

N_CLIPS = 200
BARE = "import sys, librosa; y, sr = librosa.load(sys.argv[1]); librosa.beat.beat_track(y=y, sr=sr)"


def beat_pairs(rng: np.random.Generator) -> list[tuple[BeatTrack, BeatTrack]]:
    """Music and visual beats of 200 clips of 6 s, as dense as real ones."""

    def track(count: int) -> BeatTrack:
        return BeatTrack(np.sort(rng.uniform(0, 6, count)), rng.uniform(0.1, 1, count), 15.0, 6.0)

    return [(track(12), track(30)) for _ in range(N_CLIPS)]


def measure_core() -> dict[str, float]:
    """Re-scoring of cached clips, in a batch and one by one."""
    pairs, params = beat_pairs(np.random.default_rng(0)), HarmonyParams.paper()
    batch = BeatBatch.of(pairs)
    together = best_of(lambda: rescore(batch, params), 50)
    built = best_of(lambda: rescore(BeatBatch.of(pairs), params), 20)
    alone = best_of(lambda: [score_harmony(*pair, params=params, n_rotations=0) for pair in pairs], 5)
    return {
        "re-scoring 200 cached clips (ms)": together,
        "one clip from known beats, in a batch (ms)": built / N_CLIPS,
        "one clip from known beats, alone (ms)": alone / N_CLIPS,
        "batch against one by one (ratio)": together / alone,
    }


def measure_command() -> dict[str, float]:
    """`harmolab score` on 60 s, against a process that only loads and tracks with librosa; no cache."""
    clip = synthetic_clip("rumba", seconds=60.0, seed=1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        soundfile.write(folder / "audio.wav", clip.audio.samples, int(clip.audio.sample_rate))
        if clip.motion is None:
            raise ValueError("a synthetic clip has a motion")
        save_motion(folder / "motion.npz", clip.motion)
        paths = [str(folder / "audio.wav"), str(folder / "motion.npz")]
        ours = [sys.executable, "-m", "harmolab.cli", "score", *paths, "--json"]
        bare = [sys.executable, "-c", BARE, paths[0]]
        times = {"ours": np.inf, "bare": np.inf}
        for _ in range(4):  # the first round compiles; the shortest counts
            times["bare"] = min(times["bare"], best_of(lambda: run(bare), 1))
            times["ours"] = min(times["ours"], best_of(lambda: run(ours), 1))
    return {
        "harmolab score, 60 s (s)": times["ours"] / 1000,
        "bare librosa load + beat_track, 60 s (s)": times["bare"] / 1000,
        "harmolab score against bare librosa (ratio)": times["ours"] / times["bare"],
    }


def run(command: list[str]) -> None:
    """One process, without the analysis cache."""
    import os

    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "HARMOLAB_CACHE": "off"})


def measure() -> dict[str, float]:
    """All figures of this file."""
    return {**measure_core(), **measure_command()}


if __name__ == "__main__":
    for label, value in measure().items():
        print(f"{label:50} {value:10.4f}")
