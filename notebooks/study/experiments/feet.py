"""The foot constraint model tried (Table 2): error on held-out figures, and standing feet that slide.

Foot models are trained as the paper says, in both motion codes, and kept in the cache folder. All rows of a code are of
one draw of simulated sliding.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.skeletons import Skeleton, foot_joints, joint_part
from harmolab.systems.music2dance.feet import LEG_PARTS, FootModel, FootParams, train_feet
from harmolab.systems.music2dance.params import Music2DanceParams, Representation
from harmolab.systems.music2dance.sequences import SequenceSet
from harmolab.systems.training.about import read_about
from harmolab.systems.training.feet import planted_feet
from harmolab.systems.training.layers import PATH_CHANNELS, parameter_count
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.weights import load_weights
from harmolab.types import BoolArray, FloatArray
from study.experiments.ablation import group_means
from study.experiments.generation import kept_run
from study.experiments.music2dance import coded_sequences, dancer_split, profiled
from study.experiments.sliding import SlidWindows, slid_windows
from study.profile import RunProfile

RECORDED, UNTOUCHED, PLANTED = "recorded", "no correction", "planted feet, not learnt"
LSTM, CONVOLUTION, VELOCITY = "FC + LSTM + FC", "temporal convolution", "temporal convolution, foot velocity (ours)"
SMOOTHER, BOTH = "temporal convolution, smoother (ours)", "temporal convolution, then planted feet"
# The last two are ours; their weights were set on validation figures of the recordings.
MODELS: Mapping[str, FootParams] = MappingProxyType(
    {
        LSTM: FootParams(kind="lstm"),
        CONVOLUTION: FootParams(),
        SMOOTHER: FootParams(smooth_weight=100.0),
        VELOCITY: FootParams(smooth_weight=30.0, velocity_weight=3.0),
    }
)
CODES: Mapping[Representation, str] = MappingProxyType({"rotations": "rad²", "positions": "SD²"})  # unit of the error
PAPER: Mapping[str, float] = MappingProxyType({LSTM: 0.0028, CONVOLUTION: 0.0010})  # Table 2, of other data
ERROR, LEARNT, LOWER, SLIDING = "MSE", "MSE, figures learnt", "lower body (cm)", "sliding (cm/s)"
CENTIMETRES = 100.0
QUICK_EPOCHS = 3


@dataclass(frozen=True, eq=False)
class TrainedFeet:
    """A finished foot model, and the updates that its training made."""

    model: FootModel
    updates: int


def foot_model(profile: RunProfile, corpus: str, code: Representation, params: FootParams) -> TrainedFeet:
    """The foot model of a motion code ("rotations", "positions"), trained now unless it was before."""
    params = params if profile.epochs is None else replace(params, epochs=QUICK_EPOCHS)
    split, sequences = dancer_split(profile, corpus), foot_sequences(profile, corpus, code)
    about = {"feet": params, "code": sequences.params, "split": split.to_dict()}
    folder = kept_run("feet", about, lambda options: train_feet(split, sequences, options, params))
    return TrainedFeet(load_weights(folder, FootModel), int(read_about(folder)["meta"]["updates"]))


def foot_sequences(profile: RunProfile, corpus: str, code: Representation) -> SequenceSet:
    """The recordings of a corpus in a motion code."""
    return coded_sequences(profile, corpus, profiled(profile, replace(Music2DanceParams.paper(), representation=code)))


def foot_trials(profile: RunProfile, corpus: str) -> pd.DataFrame:
    """Every way to treat simulated sliding (R38) of held-out figures, over the seeds of the trainings.

    Returns
    -------
    DataFrame with the columns corpus, code, feet, seed (0 for what is not trained), parameters, updates, and

    * MSE: squared radians of the lower body's rotations, or squared standard deviations of its positions and rates; NaN
      where positions were changed and no code
    * MSE, figures learnt: the same on the training side
    * lower body (cm): mean distance of its joints from where they were recorded, seen from the root
    * sliding (cm/s): of the slowest point of a foot that stands, as recorded
    """
    rows = [{"corpus": corpus, "code": code, **row} for code in CODES for row in _code_trials(profile, corpus, code)]
    return pd.DataFrame(rows)


def _code_trials(profile: RunProfile, corpus: str, code: Representation) -> Iterator[dict[str, Any]]:
    """The rows of one corpus in one code."""
    split = dancer_split(profile, corpus)
    windows, learnt = (
        slid_windows(split, foot_sequences(profile, corpus, code), side=side) for side in ("test", "train")
    )
    untrained = {"seed": 0, "parameters": 0, "updates": 0}
    yield {"feet": RECORDED, **untrained, LEARNT: 0.0, **measured(windows, windows.recorded)}
    yield {"feet": UNTOUCHED, **untrained, LEARNT: learnt.squared_error(learnt.slid), **measured(windows, windows.slid)}
    yield {"feet": PLANTED, **untrained, **measured_planted(windows, windows.slid)}
    for name, params in MODELS.items():
        if params.velocity_weight and code == "rotations":
            continue
        for seed in range(1, profile.n_seeds + 1):
            trained = foot_model(profile, corpus, code, replace(params, seed=seed))
            corrected = windows.corrected(trained.model)
            about = {"seed": seed, "parameters": parameter_count(trained.model), "updates": trained.updates}
            error = learnt.squared_error(learnt.corrected(trained.model))
            yield {"feet": name, **about, LEARNT: error, **measured(windows, corrected)}
            if name == CONVOLUTION:
                yield {"feet": BOTH, **about, **measured_planted(windows, corrected)}


def measured(windows: SlidWindows, codes: FloatArray) -> dict[str, float]:
    """MSE, lower body and sliding of codes (N, T, C), as in `foot_trials`."""
    return {ERROR: windows.squared_error(codes), **_position_measures(windows, windows.decoded(codes))}


def measured_planted(windows: SlidWindows, codes: FloatArray) -> dict[str, float]:
    """Lower body and sliding of codes (N, T, C) whose positions are given `planted_feet`."""
    skeleton, fps = windows.code.skeleton, windows.fps
    planted = np.stack([planted_feet(positions, fps, skeleton) for positions in windows.decoded(codes)])
    return {ERROR: np.nan, **_position_measures(windows, planted)}


def _position_measures(windows: SlidWindows, positions: FloatArray) -> dict[str, float]:
    skeleton, fps = windows.code.skeleton, windows.fps
    pairs = zip(positions, windows.decoded(windows.recorded), strict=True)
    away = np.stack([lower_body_distance(*pair, fps, skeleton) for pair in pairs])
    slide = standing_slide(positions, windows.contacts, windows.counted, fps, skeleton)
    return {LOWER: CENTIMETRES * float(away[windows.counted].mean()), SLIDING: CENTIMETRES * slide}


def lower_body_distance(positions: FloatArray, others: FloatArray, fps: float, skeleton: Skeleton) -> FloatArray:
    """Mean distance (T,) of the lower body's joints between two motions (T, J, 3), each seen from its root; metres."""
    joints = [joint for joint, name in enumerate(skeleton.joints) if joint_part(name) in LEG_PARTS]
    places = [encode_motion(each, fps, skeleton)[:, :-PATH_CHANNELS] for each in (positions, others)]
    away = (places[0] - places[1]).astype(np.float64).reshape(positions.shape)[:, joints]
    distance: FloatArray = np.linalg.norm(away, axis=-1).mean(axis=1)
    return distance


def standing_slide(
    positions: FloatArray, contacts: BoolArray, counted: BoolArray, fps: float, skeleton: Skeleton
) -> float:
    """Mean speed along the floor of the slowest point of a foot, over steps at both ends of which it stands.

    Parameters
    ----------
    positions : (N, T, J, 3) array, metres
    contacts : (N, T, 2) mask, True where the left, the right foot stands
    counted : (N, T) mask, frames that count
    fps : float, hertz
    skeleton : Skeleton with a left and a right foot

    Returns
    -------
    float, metres per second; NaN where no foot stands
    """
    speed = np.linalg.norm(np.diff(positions[..., [0, 2]], axis=1), axis=-1) * fps
    slowest = np.stack([speed[..., list(foot)].min(axis=-1) for foot in foot_joints(skeleton)], axis=-1)
    both = contacts & counted[..., None]
    standing = both[:, 1:] & both[:, :-1]
    return float(slowest[standing].mean()) if standing.any() else float("nan")


def foot_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Table 2: means of `foot_trials` over trainings with 95 % intervals (Student's t; NaN for one training).

    Returns
    -------
    DataFrame, a row for each corpus, code and way to treat feet: corpus, code, feet, loss, parameters, updates, number
    of trainings, unit of the MSE; of each measure the mean, low and high; sliding before it, and recorded; and what the
    paper prints, which is of other data
    """
    keys = ["corpus", "code", "feet"]
    means = wide_means(trials, keys, (ERROR, LEARNT, LOWER, SLIDING))
    firsts = trials.drop_duplicates(keys)  # in the same order
    names = list(zip(means["corpus"], means["code"], means["feet"], strict=True))
    sliding = means.set_index(keys)[SLIDING]
    table = means[keys].copy()
    table["loss"] = table["feet"].map(_loss)
    table["parameters"], table["updates"] = firsts["parameters"].to_numpy(), firsts["updates"].to_numpy()
    table["trainings"] = means["n"].where(table["updates"] > 0, 0)
    table["unit of MSE"] = [CODES[code] for _, code, _ in names]
    columns = [name for name in means.columns if name not in (*keys, "n")]
    table[columns] = means[columns]
    table["sliding before"] = [sliding[corpus, code, UNTOUCHED] for corpus, code, _ in names]
    table["sliding recorded"] = [sliding[corpus, code, RECORDED] for corpus, code, _ in names]
    printed = [PAPER.get(feet, np.nan) if code == "rotations" else np.nan for _, code, feet in names]
    table["MSE, paper (other data)"] = printed
    return table


def wide_means(table: pd.DataFrame, keys: Sequence[str], measures: Sequence[str]) -> pd.DataFrame:
    """Mean and 95 % interval of each measure in each group of rows, a row a group.

    Returns
    -------
    DataFrame with the columns of `keys`, then n, and three for each measure: the measure, "measure, low" and "measure,
    high", as `study.experiments.ablation.group_means` gives them
    """
    rows = [
        {
            **dict(zip(keys, names, strict=True)),
            "n": int(part["n"].iloc[0]),
            **{
                f"{row['measure']}{suffix}": row[column]
                for row in part.to_dict("records")
                for column, suffix in (("mean", ""), ("low", ", low"), ("high", ", high"))
            },
        }
        for names, part in group_means(table, keys, measures).groupby(list(keys), sort=False)
    ]
    return pd.DataFrame(rows)


def _loss(feet: str) -> str:
    """The loss that a way to treat feet was trained by."""
    if (params := MODELS.get(CONVOLUTION if feet == BOTH else feet)) is None:
        return ""
    speed = f" + {params.velocity_weight:g} velocity" if params.velocity_weight else ""
    return f"MSE + {params.smooth_weight:g} smooth{speed}"
