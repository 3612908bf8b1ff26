"""The saved reference that comes with harmolab: `python -m tools.reference`.

Twenty-eight synthetic dances of 20 s, four of each kind: those of `harmolab data synth DATA --clips 28 --seconds 20`.
"""

import sys
import tempfile
from pathlib import Path

from harmolab.data.synthetic import write_corpus
from harmolab.lab.evaluate.evaluation import EvaluationSettings, evaluate_dances, write_reference
from harmolab.lab.evaluate.reference import SHIPPED

CLIPS, SECONDS = 28, 20.0


def main(out: Path = SHIPPED) -> None:
    """Measure the corpus and write the reference."""
    with tempfile.TemporaryDirectory() as folder:
        corpus = write_corpus(Path(folder) / "data", clips=CLIPS, seconds=SECONDS)
        settings = EvaluationSettings({"same": corpus}, music=corpus, reference=corpus, resamples=100)
        table = Path(folder) / "table"
        write_reference(out, evaluate_dances(settings, table), table)
    sys.stdout.write(f"{out}: {out.stat().st_size} bytes\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
