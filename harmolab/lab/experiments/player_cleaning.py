"""Rejected frames of musicians with the rules that caught them (Fig. 3), and the places that alignment gives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
import pandas as pd

from harmolab.corpora.instrument_sets import load_tracked
from harmolab.corpora.instruments import Performance
from harmolab.corpora.synthetic.players import FAULTS, PlantedPerformance
from harmolab.lab.experiments.planted_truth import PARTS, part_of
from harmolab.lab.experiments.players import PlayerData, read_set
from harmolab.lab.experiments.study import data_root
from harmolab.systems.audio2body.cleaning import RULES, Cleaned, cleaned, rejected_examples
from harmolab.systems.audio2body.params import Audio2BodyParams
from harmolab.systems.audio2body.placing import Alignment, placed
from harmolab.systems.audio2body.reading import cleaning_rules
from harmolab.types import BoolArray, FloatArray, Skeleton

GOOD, NOT_REJECTED = "good frame", ""


@dataclass(frozen=True, eq=False)
class RejectedFrame:
    """A frame, the last accepted one before it, and the rule that rejects it.

    Parameters
    ----------
    recording : str
    seconds : float
    fault : planted fault; "" in a recording, where none is known
    rule : of `RULES`; "" where the frame was not rejected
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


def cleaning_table(performances: Iterable[Performance]) -> pd.DataFrame:
    """The report of every recording: share of its frames that each rule rejects, the first that a frame breaks.

    Returns
    -------
    DataFrame with the columns recording, instrument, source, seconds, each of `RULES`, rejected (their sum)
    """
    rows = []
    for each in performances:
        report = cleaned_performance(each).report()
        about = {"recording": each.name, "instrument": each.instrument, "source": each.source,
                 "seconds": each.motion.duration}  # fmt: skip
        rows.append({**about, **{rule: report[rule] for rule in RULES}, "rejected": sum(report.values())})
    return pd.DataFrame(rows)


def cleaning_summary(table: pd.DataFrame) -> pd.DataFrame:
    """`cleaning_table` with one row for all planted pieces of an instrument: means, weighted by seconds."""
    columns, rows = [*RULES, "rejected"], []
    for (instrument, source), own in table.groupby(["instrument", "source"], sort=False):
        if source != "synthetic":
            rows += [{"recording": f"{each['recording']} (recorded)", **each[columns]} for _, each in own.iterrows()]
            continue
        means = np.average(own[columns], axis=0, weights=own["seconds"])
        rows.append({"recording": f"planted {instrument}, {len(own)} pieces", **dict(zip(columns, means, strict=True))})
    return pd.DataFrame(rows)


def planted_cleaning(planted: Sequence[PlantedPerformance]) -> pd.DataFrame:
    """Shares of the frames of each planted fault that are rejected, and of the good ones.

    Returns
    -------
    DataFrame with the columns instrument, fault (of `FAULTS`, or `GOOD`), frames, rejected (share)
    """
    faults = np.concatenate([each.fault for each in planted])
    accepted = np.concatenate([cleaned_performance(each.performance).accepted for each in planted])
    rows = []
    for fault in (*FAULTS, NOT_REJECTED):
        own = faults == fault
        share = float(np.mean(~accepted[own])) if own.any() else float("nan")
        rows.append({"fault": fault or GOOD, "frames": int(own.sum()), "rejected": share})
    return pd.DataFrame(rows).assign(instrument=planted[0].performance.instrument)[
        ["instrument", "fault", "frames", "rejected"]
    ]


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
