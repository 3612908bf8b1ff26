"""Rejected frames of musicians with the rules that caught them (Fig. 3), and the places that alignment gives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import get_args

import numpy as np
import pandas as pd

from harmolab.body.skeletons import Skeleton
from harmolab.musician.cleaning import Alignment, Cleaned, cleaned, placed, rejected_examples
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import cleaning_rules
from harmolab.musician.synthetic import FAULTS, PlantedPerformance
from harmolab.types import BoolArray, FloatArray
from study.experiments.instrument_sets import load_tracked
from study.experiments.players import PARTS, PlayerData, part_of, read_set
from study.experiments.study import data_root


@dataclass(frozen=True, eq=False)
class RejectedFrame:
    """A frame, the last accepted one before it, and the rule that rejects it.

    Parameters
    ----------
    recording : str
    seconds : float
    fault : planted fault; "" in a recording, where none is known
    rule : of `harmolab.musician.cleaning.RULES`; "" where the frame was not rejected
    points, before : (P, 2) arrays, pixels
    detected : (P,) mask
    skeleton : of the points
    """

    recording: str
    seconds: float
    fault: str
    rule: str
    points: FloatArray
    before: FloatArray
    detected: BoolArray
    skeleton: Skeleton


def cleaned_performance(performance: Performance) -> Cleaned:
    """A performance cleaned as it is for a training."""
    return cleaned(performance, cleaning_rules(performance))


def tracked_players() -> tuple[Performance, ...]:
    """Tracked videos of musicians below ``HARMOLAB_DATA``, by name; none without recordings."""
    root = data_root()
    paths = [] if root is None else sorted((root / "instruments" / "tracked").glob("*.npz"))
    return tuple(load_tracked(path) for path in paths)


def fault_examples(planted: Iterable[PlantedPerformance]) -> dict[str, RejectedFrame]:
    """For each planted fault its first frame in the first performance that has one, whatever becomes of it (Fig. 3)."""
    examples: dict[str, RejectedFrame] = {}
    for each in planted:
        result = cleaned_performance(each.performance)
        for fault in FAULTS:
            frames = np.flatnonzero(each.fault == fault)
            if fault not in examples and frames.size:
                examples[fault] = _rejected_frame(result, int(frames[0]), fault)
        if len(examples) == len(FAULTS):
            break
    return {fault: examples[fault] for fault in FAULTS if fault in examples}


def recorded_examples(performances: Iterable[Performance]) -> Iterator[RejectedFrame]:
    """For each recording and rule the rejected frame with the largest movement, as `rejected_examples` chooses it."""
    for performance in performances:
        result = cleaned_performance(performance)
        for frame in rejected_examples(result).values():
            yield _rejected_frame(result, frame, "")


def _rejected_frame(result: Cleaned, frame: int, fault: str) -> RejectedFrame:
    performance = result.performance
    motion, kept = performance.motion, np.flatnonzero(result.accepted)
    before = kept[max(int(np.searchsorted(kept, frame)) - 1, 0)]
    return RejectedFrame(
        performance.name, frame / motion.fps, fault, str(result.broken[frame]), motion.positions[frame],
        motion.positions[before], performance.detected[frame], motion.skeleton,
    )  # fmt: skip


def alignment_table(data: PlayerData) -> pd.DataFrame:
    """Errors of planted points placed by one similarity a recording, and by one a frame (Eq. 1, reading 10).

    Planted cameras are known, so the right place is: the clean points as the first training recording's camera would
    show them.

    Returns
    -------
    DataFrame with the columns instrument, alignment, part (of `PARTS`), error: root mean square distance a coordinate
    on accepted frames, pixels, noise of 1 pixel included
    """
    played = read_set(data, Audio2BodyParams.tables(data.instrument))
    camera = data.planted[data.split.train[0]].camera
    results = {name: cleaned_performance(each.performance) for name, each in data.planted.items()}
    names = [part_of(name) for name in played.skeleton.joints]
    rows = []
    for alignment in get_args(Alignment):
        squares = []
        for name, result in results.items():
            planted = data.planted[name]
            right = camera.apply(planted.camera.inverse().apply(planted.clean))
            points = placed(result, played.reference, alignment=alignment).positions
            squares.append(np.square(points - right)[result.accepted])
        by_point = np.concatenate(squares).mean(axis=(0, 2))
        for part in PARTS:
            error = float(np.sqrt(by_point[[own == part for own in names]].mean()))
            rows.append({"instrument": data.instrument, "alignment": alignment, "part": part, "error": error})
    return pd.DataFrame(rows)
