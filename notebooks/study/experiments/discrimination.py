"""The tables of notebook 05: how well scores tell right from wrong music, and under which disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from harmolab.data.recordings import find_recordings
from harmolab.lab.compare.auc import CorpusResult, compare
from harmolab.params import BarPattern
from harmolab.types import FloatArray
from study.experiments.study import corpus_folders, readable_recordings, study_recordings, synthetic_corpus
from study.profile import RunProfile


def compare_corpora(profile: RunProfile, *, window: float | None = 6.0) -> dict[str, CorpusResult]:
    """`compare` on every study corpus, and always on the synthetic one as the control that must succeed.

    Annotated beats where every sequence has them, else tracked ones. Corpora without annotations are cut down to the
    profile's number of sequences; patterns need other sequences of the same dance, so annotated corpora are not.
    """
    folders = {**corpus_folders(profile), "synthetic": synthetic_corpus(profile)}
    results = {}
    for name, root in folders.items():
        paths = find_recordings(root).folders
        annotated = all((folder / "beats.json").is_file() for folder in paths)
        sequences = readable_recordings(root) if annotated else study_recordings(profile, name)
        results[name] = compare(
            sequences,
            corpus=name,
            window=window,
            beats="annotated" if annotated else "tracked",
            n_rotations=profile.n_rotations,
            seed=profile.seed,
        )
    return results


def auc_table(results: dict[str, CorpusResult]) -> pd.DataFrame:
    """One row a corpus and score: AUC, interval, chance band, and whether it lies above the band."""
    bounds = ("interval low", "interval high", "chance low", "chance high")
    rows = [
        {"corpus": name, "windows": result.summary["n"], "beats": result.summary["beats"], "score": score}
        | {"AUC": row["auc"], **dict(zip(bounds, (*row["interval"], *row["chance_band"]), strict=True))}
        for name, result in results.items()
        for score, row in result.summary["scores"].items()
    ]
    table = pd.DataFrame(rows)
    return table.assign(tells=np.where(table["AUC"] > table["chance high"], "yes", "no")).round(3)


def dance_table(results: dict[str, CorpusResult], score: str = "recommended") -> pd.DataFrame:
    """AUC of one score by corpus and dance, with the number of windows."""
    rows = [
        {"corpus": name, "dance": dance, "windows": row["n"], "AUC": round(row["auc"], 3)}
        for name, result in results.items()
        for dance, row in result.summary["scores"][score]["by_dance"].items()
    ]
    return pd.DataFrame(rows)


def pick_table(result: CorpusResult, profile: RunProfile, *, n_clips: int = 20) -> pd.DataFrame:
    """The paper's viewing test with scores as viewers (Fig. 8): half of the clips have wrong music; pick them out.

    A score picks the half it rates lowest. The mean and the 95 % range are over random draws of clips.
    """
    rng = np.random.default_rng(profile.seed)
    rows: list[dict[str, Any]] = [{"judge": "10 people (paper, other clips)", "paper": 0.78}]
    half = min(n_clips // 2, len(result.dances) // 2)
    for score, label in (("recommended", "recommended"), ("paper", "paper's h"), ("hit_rate", "paper's hit rate")):
        shares = [_one_draw(result.true[score], result.wrong[score], half, rng) for _ in range(profile.n_rotations)]
        low, high = np.quantile(shares, [0.025, 0.975])
        rows.append({"judge": f"{label} (machine)", "harmolab": np.mean(shares), "low": low, "high": high})
    return pd.DataFrame(rows).round(3)


def _one_draw(true: FloatArray, wrong: FloatArray, half: int, rng: np.random.Generator) -> float:
    """Share of wrong clips among the lowest-rated half of a random set."""
    order = rng.permutation(len(true))[: 2 * half]
    column = rng.integers(0, wrong.shape[1], half)
    values = np.concatenate([true[order[:half]], wrong[order[half:], column]])
    lowest = np.argsort(values + 1e-12 * rng.standard_normal(values.size))[:half]
    return float((lowest >= half).mean())


def disturbance_table(profile: RunProfile, what: str, levels: Sequence[float]) -> pd.DataFrame:
    """AUC of every score on synthetic corpora in which one disturbance grows; ``mean`` columns: mean recommended score.

    Parameters
    ----------
    what : "noise" (metres), "jitter" (seconds) or "fps" (hertz)
    levels : values of it
    """
    label, scale = {
        "noise": ("sensor noise (cm)", 100.0),
        "jitter": ("beat jitter (ms)", 1000.0),
        "fps": ("frame rate (fps)", 1.0),
    }[what]
    rows = []
    for level in levels:
        root = synthetic_corpus(profile, **{what: level})
        result = compare(readable_recordings(root), corpus=what, n_rotations=0, seed=profile.seed)
        row = {name: entry["auc"] for name, entry in result.summary["scores"].items()}
        means = {f"mean {name}": result.summary["scores"][name]["mean_true"] for name in ("recommended", "paper")}
        rows.append({label: level * scale, **row, **means})
    return pd.DataFrame(rows).round(3)


def dance_patterns_of(results: dict[str, CorpusResult], corpus: str) -> dict[str, BarPattern]:
    """The bar pattern of each dance of a compared corpus: the one learnt for its first part."""
    return {dance: patterns[0] for dance, patterns in results[corpus].patterns.items()}
