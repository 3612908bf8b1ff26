"""Peak memory of `harmolab evaluate compare` grows with the clip, not with the corpus: two, one eight times larger."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from harmolab.data.synthetic import write_corpus

SMALL, LARGE = 14, 112


def peak_megabytes(corpus: Path) -> float:
    """Peak resident memory of a process that compares a corpus."""
    script = (
        "import resource, sys; from harmolab.cli import app; sys.argv = ['harmolab', 'compare', sys.argv[1], "
        "'--rotations', '20', '--json']\n"
        "try: app()\n"
        "except SystemExit: pass\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script, str(corpus)], check=True, capture_output=True, text=True)
    unit = 1024 if sys.platform != "darwin" else 1024 * 1024
    return int(done.stderr.split()[-1]) / unit


def measure() -> dict[str, float]:
    """Peak memory for a small and a large corpus, and their ratio."""
    with tempfile.TemporaryDirectory() as name:
        peaks = {}
        for clips in (SMALL, LARGE):
            write_corpus(Path(name) / str(clips), clips=clips, seconds=6.0)
            peaks[clips] = peak_megabytes(Path(name) / str(clips))
    return {
        f"compare, {SMALL} clips (MB)": peaks[SMALL],
        f"compare, {LARGE} clips (MB)": peaks[LARGE],
        f"{LARGE // SMALL} times the clips (ratio of memory)": peaks[LARGE] / peaks[SMALL],
    }


if __name__ == "__main__":
    for label, value in measure().items():
        print(f"{label:50} {value:10.2f}")
