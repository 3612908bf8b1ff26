"""Speed of the score core: milliseconds, and ratios to the plain path and to a bare librosa process, in one run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import soundfile

from benchmarks.timing import best_of
from harmolab.data.recordings import Recording
from harmolab.data.synthetic import ClipSettings, planted_clip, synthetic_clip
from harmolab.lab.compare.batch import BeatBatch, PlaceBatch, rescore, rescore_places
from harmolab.lab.compare.rows import RecordingOptions, recording_scores
from harmolab.lab.compare.scores import hit_scores, score_table, shifted_music
from harmolab.lab.compare.windows import learn_patterns, usable_clips
from harmolab.params import HarmonyParams
from harmolab.readers.motion import save_motion
from harmolab.score import score_harmony
from harmolab.types import BeatTrack
from harmolab.verdict.judge import score_motion

N_CLIPS = 200
N_DANCES = 20  # dancers among them: the rest are the same again
N_SEQUENCES = 25
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


def measure_recommended() -> dict[str, float]:
    """The same in the recommended mode: ranks at every lag are kept, so a slider looks them up."""
    clips = [synthetic_clip("cha-cha", seconds=8.0, fps=30.0, seed=seed) for seed in range(N_DANCES)]
    pairs = [(clip.beats, clip.motion) for clip in clips if clip.beats is not None and clip.motion is not None]
    pairs, params = pairs * (N_CLIPS // N_DANCES), HarmonyParams.recommended()
    batch = PlaceBatch.of(pairs, params)
    together = best_of(lambda: rescore_places(batch, replace(params, lag=0.03)), 50)
    moved = best_of(lambda: rescore_places(batch.moved(0.3 * batch.periods), params), 20)
    alone = best_of(lambda: [score_motion(*pair, params=params) for pair in pairs[:N_DANCES]], 3) * N_CLIPS / N_DANCES
    return {
        "recommended, re-scoring 200 cached clips (ms)": together,
        "recommended, 200 clips with music moved (ms)": moved,
        "recommended, batch against one by one (ratio)": together / alone,
    }


def measure_band() -> dict[str, float]:
    """One null corpus of `compare`: patterns and lags learnt anew, every score of 175 clips."""
    options = RecordingOptions("annotated", 6.0, (), other_music=True, judged=False)
    clips = [clip for number in range(N_SEQUENCES) for clip in recording_scores(sequence(number), options).clips]
    table = score_table(clips, learn_patterns(clips), usable_clips(clips), None, None)
    rng = np.random.default_rng(0)
    draw = best_of(lambda: table.at(rng.integers(0, 20, len(clips))), 20)
    hits = best_of(lambda: [hit_scores(clip, shifted_music(clip)) for clip in clips[:10]], 2) * len(clips) / 10
    return {
        f"compare, a null corpus of {len(clips)} clips (ms)": draw,
        "compare, a null corpus against scoring once (ratio)": draw / hits,
    }


def sequence(number: int) -> Recording:
    """A synthetic recording of 42 s with its beats and bars."""
    planted = planted_clip(ClipSettings("cha-cha", seconds=42.0, fps=30.0, seed=number))
    return Recording(planted.clip, planted.annotation, Path(f"sequence {number}"))


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
    return {**measure_core(), **measure_recommended(), **measure_band(), **measure_command()}


if __name__ == "__main__":
    for label, value in measure().items():
        print(f"{label:50} {value:10.4g}")
