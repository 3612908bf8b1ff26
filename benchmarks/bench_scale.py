"""Many clips through the engine: clips a second, memory of client and workers, bytes a row, and the second stage.

    python -m benchmarks.bench_scale [N] [JOBS]

Each task makes a synthetic dance from its seed, on beats that are known (as cached ones are), and scores it with its
music and with the same music half a beat late. Memory is read while it runs; its slope is fitted from 1,000 rows on,
when every library is loaded and every buffer has its size. The second stage is that of `harmolab evaluate`.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.data.synthetic import synthetic_motion
from harmolab.files import PathLike
from harmolab.lab.evaluate.engine import read_rows, run_rows
from harmolab.lab.evaluate.measured import later
from harmolab.lab.evaluate.pairing import RECORDED
from harmolab.lab.evaluate.sets import collect, set_numbers
from harmolab.lab.evaluate.summary import system_means
from harmolab.metrics.features import kinetic_features
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, FloatArray
from harmolab.verdict.judge import score_motion
from tests.tiny_run import Tasks

N_CLIPS, N_SONGS, SECONDS, WARM = 2000, 100, 12.0, 1000  # the recommended score asks for 16 beats


@dataclass(frozen=True)
class PlantedClip:
    """A dance by its seed, to one of 100 songs that differ in tempo."""

    seed: int

    @property
    def key(self) -> str:
        return f"clip-{self.seed:010d}"

    @property
    def columns(self) -> dict[str, str]:
        """Those by which the second stage sorts the row: every second dance is one of the system, called x."""
        system, song = (RECORDED, "x")[self.seed % 2], f"song-{self.seed // 2 % N_SONGS:03d}"
        return {"system": system, "kind": system, "song": song, "seed": "", "skeleton": "synthetic"}


def clip_scores(task: PlantedClip) -> dict[str, Any]:
    """A row: harmony with true and late music, the paper's, two measures of quality, 63 kinetic features."""
    times = np.arange(0.2, SECONDS, 60 / (90 + task.seed % N_SONGS))
    music = BeatTrack(times, np.ones(times.size), 30.0, SECONDS)
    motion = synthetic_motion(times, times[::4], dance="cha-cha", seconds=SECONDS, fps=30.0, seed=task.seed)
    score = score_motion(music, motion)
    return {
        **task.columns,
        "harmony": score.harmony_above_chance,
        "p_value": score.p_value,
        "late": score_motion(later(music, 0.5), motion, n_rotations=0).place_harmony,
        "paper_harmony": score_motion(music, motion, params=HarmonyParams.paper(), n_rotations=0).harmony,
        "jerk": jerk(motion),
        "foot_skating": foot_skating(motion),
        **{f"f_kinetic_{place:03d}": float(one) for place, one in enumerate(kinetic_features(motion))},
    }


@dataclass
class Meter:
    """Progress that counts rows, while a thread notes the memory of this process and of its children by /proc."""

    rows: int = 0
    samples: array[float] = field(default_factory=lambda: array("d"))  # rows, client, largest worker (MB), one by one
    _is_over: threading.Event = field(default_factory=threading.Event)

    def __call__(self, items: Iterable[Any], label: str) -> Iterator[Any]:
        watch = threading.Thread(target=self._watch, daemon=True)
        watch.start()
        for item in items:
            yield item
            self.rows += 1
        self._is_over.set()
        watch.join()

    def _watch(self) -> None:
        while not self._is_over.wait(0.5):
            workers = [megabytes(pid) for pid in children(os.getpid())]
            self.samples.extend((self.rows, megabytes(os.getpid()), max(workers, default=0.0)))

    @property
    def table(self) -> FloatArray:
        """(n, 3) samples: rows, and the memory of the client and of the largest worker, MB."""
        return np.array(self.samples).reshape(-1, 3)

    def slope(self, side: int) -> tuple[float, float]:
        """Bytes that the client (1) or the largest worker (2) grows by with each row, and its standard error.

        Fitted to the means of ten stretches from `WARM` rows on, since neighbouring samples are alike; NaN where there
        are too few of them.
        """
        warm = self.table[self.table[:, 0] >= WARM]
        if len(warm) < 20:
            return float("nan"), float("nan")
        means = np.array([part.mean(axis=0) for part in np.array_split(warm, 10)])
        fit, variance = np.polyfit(means[:, 0], means[:, side], 1, cov=True)
        return float(fit[0]) * 2**20, float(np.sqrt(variance[0, 0])) * 2**20


def megabytes(pid: int) -> float:
    """Resident memory of a process; 0 when it is over."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    except OSError:
        return 0.0


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    return [int(child) for path in Path(f"/proc/{pid}/task").glob("*/children") for child in path.read_text().split()]


def second_stage(out: PathLike) -> dict[str, float]:
    """Means, an interval and the FID in one pass over the parts."""
    begun, before = time.perf_counter(), megabytes(os.getpid())
    collected = collect(read_rows(out))
    if collected.errors:
        raise ValueError(f"{min(collected.errors.values())}")
    means, distance = system_means(collected.song_means), set_numbers(collected.features)["x", "fid_kinetic"]
    return {
        "second stage: seconds": time.perf_counter() - begun,
        "its memory (MB)": megabytes(os.getpid()) - before,
        "harmony": means["x", "harmony"].mean,
        "its interval over songs, low": means["x", "harmony"].low,
        "its interval over songs, high": means["x", "harmony"].high,
        "harmony half a beat late": means["x", "late"].mean,
        "FID of one half against the other, bias off": distance.value,
        "the same, bias left in": distance.raw,
        "its dances": distance.n,
    }


def measure(count: int = N_CLIPS, jobs: int = 2) -> dict[str, float]:
    """All figures of this file."""
    with tempfile.TemporaryDirectory() as name:
        out, meter = Path(name) / "rows", Meter()
        begun = time.perf_counter()
        run_rows(Tasks(PlantedClip, count), clip_scores, out, jobs=jobs, progress=meter)
        seconds = time.perf_counter() - begun
        client, worker = meter.slope(1), meter.slope(2)
        results = second_stage(out)
        size = sum(path.stat().st_size for path in out.glob("part-*"))
    return {
        "clips": count,
        "worker processes": jobs,
        "clips a second, with start and end": count / seconds,
        "client, peak memory (MB)": float(meter.table[:, 1].max()),
        "largest worker, peak memory (MB)": float(meter.table[:, 2].max()),
        f"client, growth from {WARM} rows on (bytes a row)": client[0],
        "its standard error": client[1],
        f"largest worker, growth from {WARM} rows on (bytes a row)": worker[0],
        "the same of it": worker[1],
        "table (bytes a row)": size / count,
        **results,
    }


if __name__ == "__main__":
    for label, value in measure(*map(int, sys.argv[1:])).items():
        print(f"{label:60} {value:12.5g}")
