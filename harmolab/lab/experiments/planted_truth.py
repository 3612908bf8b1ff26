"""The truth about planted players beside a network: what sound can tell at best, and which components it predicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.corpora.instruments import Performance
from harmolab.io.player_points import SIDES, hand_joints
from harmolab.lab.experiments.player_tables import FINAL, MEAN_POSE, error_table, row_settings
from harmolab.lab.experiments.players import PlayerData, TrainedPlayer, profiled, read_set
from harmolab.lab.profile import RunProfile
from harmolab.systems.audio2body.cleaning import cleaned
from harmolab.systems.audio2body.perform import predicted_points
from harmolab.systems.audio2body.placing import Reference, shot_similarities
from harmolab.systems.audio2body.point_space import PointSpace
from harmolab.systems.audio2body.reading import cleaning_rules
from harmolab.systems.audio2body.sequences import PlayedSequence, PlayedSet, fitted_space, sides
from harmolab.systems.audio2body.train import Errors, errors_between
from harmolab.types import FloatArray, Skeleton

FLOOR = "planted truth: all that the sound tells"
BLIND = "planted truth, direction of the bow unknown"
LIMITS: Mapping[str, str] = MappingProxyType({BLIND: "direction_blind", FLOOR: "from_audio"})
PARTS = ("body", "left hand", "right hand")


def ceilings(profile: RunProfile, data: PlayerData) -> pd.DataFrame:
    """Errors that no network can beat on planted test pieces: those of the planted truth itself.

    The truth is placed as a training places its pieces, and held against the tracked points, whose noise and sway no
    sound tells. Of a violinist also everything but the direction of the bow; of any data the mean pose of the training
    pieces.

    Returns
    -------
    DataFrame with the columns row (`MEAN_POSE`, `BLIND`, `FLOOR`), projected, full
    """
    params = profiled(profile, data, row_settings(data, FINAL))
    played, split = read_set(data, params), data.sides(params)
    test = sides(played.sequences, split.test)
    space = fitted_space(sides(played.sequences, split.train), params)
    guesses = {MEAN_POSE: [np.broadcast_to(space.mean, each.points.shape) for each in test]}
    planted = [data.planted[each.name] for each in test if each.name in data.planted]
    for row, name in LIMITS.items():
        truths = [points for each in planted if (points := getattr(each, name)) is not None]
        if truths and len(truths) == len(test):
            pairs = zip(truths, planted, strict=True)
            guesses[row] = [placed_truth(truth, each.performance, played.reference) for truth, each in pairs]
    rows = [{"row": row, **errors_of(points, test, space)._asdict()} for row, points in guesses.items()]
    return pd.DataFrame(rows)


def placed_truth(truth: FloatArray, performance: Performance, reference: Reference) -> FloatArray:
    """True points (T, P, 2) of a performance brought to the reference as its tracked ones are: (T, 2 P)."""
    result = cleaned(performance, cleaning_rules(performance))
    parts = [
        fit.apply(truth[span]) for fit, span in zip(shot_similarities(result, reference), result.shots, strict=True)
    ]
    return np.concatenate(parts).reshape(len(truth), -1)


def errors_of(points: Sequence[FloatArray], sequences: Sequence[PlayedSequence], space: PointSpace) -> Errors:
    """Errors of points (T, 2 P) against the sequences, projected on the components of `space` and in full."""
    return errors_between(points, [space.decode(space.encode(each.points)) for each in sequences], sequences)


def complete_table(profile: RunProfile, data: PlayerData, values: pd.DataFrame) -> pd.DataFrame:
    """`error_table`, and below it the mean pose and the planted limits as rows of their own."""
    table, limits = error_table(values), ceilings(profile, data).set_index("row")
    mean_pose = limits.loc[MEAN_POSE, "full"]
    rows = [
        {"row": row, "test projected": errors["projected"], "test full": errors["full"],
         "of mean pose": errors["full"] / mean_pose}
        for row, errors in limits.iterrows()
    ]  # fmt: skip
    return pd.DataFrame([*table.to_dict("records"), *rows], columns=table.columns)


def component_table(data: PlayerData, run: TrainedPlayer) -> pd.DataFrame:
    """Correlation of predicted and tracked components of the points on the test pieces.

    Returns
    -------
    DataFrame with the columns instrument, component (from 1), share (of the variance of the training frames), part
    (that moves most: of `PARTS`), correlation (of predicted and tracked, over accepted frames of all test pieces)
    """
    network = run.system.network
    played, split = read_set(data, network.params), data.sides(network.params)
    space = network.space_scale.space
    frames = np.concatenate([each.points[each.learnt] for each in sides(played.sequences, split.train)])
    shares = np.square(space.encode(frames) * space.scale).mean(axis=0) / frames.var(axis=0).sum()
    pairs = [values for _, *values in component_pairs(run, played, split.test)]
    predicted, tracked = (np.concatenate(values) for values in zip(*pairs, strict=True))
    names = moving_parts(space, played.skeleton)
    rows = [
        {"instrument": data.instrument, "component": number + 1, "share": shares[number], "part": part,
         "correlation": correlation(predicted[:, number], tracked[:, number])}
        for number, part in enumerate(names)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def component_pairs(
    run: TrainedPlayer, played: PlayedSet, names: Sequence[str]
) -> Iterator[tuple[PlayedSequence, FloatArray, FloatArray]]:
    """A sequence, and its predicted and its tracked components (F, n), pixels, of the accepted frames, one by one."""
    space = run.system.network.space_scale.space
    for sequence in sides(played.sequences, names):
        predicted = predicted_points(run.system.network, sequence.sound)[sequence.accepted]
        tracked = sequence.points[sequence.accepted]
        yield sequence, space.encode(predicted) * space.scale, space.encode(tracked) * space.scale


def correlation(one: FloatArray, other: FloatArray) -> float:
    """Pearson's correlation of two curves; NaN where one does not move."""
    if min(np.ptp(one), np.ptp(other)) == 0:
        return float("nan")
    return float(np.corrcoef(one, other)[0, 1])


def moving_parts(space: PointSpace, skeleton: Skeleton) -> list[str]:
    """The part of the player, one of `PARTS`, with the largest mean square loading of each component."""
    loadings = np.square(space.basis).reshape(len(space.basis), -1, 2).sum(axis=2)
    owners = [part_of(name) for name in skeleton.joints]
    parts = [part for part in PARTS if part in owners]
    means = np.stack([loadings[:, [own == part for own in owners]].mean(axis=1) for part in parts])
    return [parts[number] for number in means.argmax(axis=0)]


def part_of(joint: str) -> str:
    """The part that a point belongs to; wrists of the body move with their hands."""
    return next((f"{side} hand" for side in SIDES if joint in (*hand_joints(side), f"{side}_wrist")), "body")
