"""The truth about planted players beside a network: what sound can tell at best, and which components it predicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from harmolab.io.player_points import SIDES, hand_joints
from harmolab.lab.experiments.player_tables import FINAL, MEAN_POSE, error_table, row_settings
from harmolab.lab.experiments.players import PlayerData, TrainedPlayer, profiled, read_set
from harmolab.lab.profile import RunProfile
from harmolab.systems.audio2body.bow import Bowing
from harmolab.systems.audio2body.perform import predicted_points
from harmolab.systems.audio2body.planted_truth import component_correlations, planted_points
from harmolab.systems.audio2body.point_space import PointSpace
from harmolab.systems.audio2body.sequences import PlayedSequence, fitted_space, sides
from harmolab.systems.audio2body.train import Errors, errors_between
from harmolab.types import FloatArray, Skeleton

FLOOR = "planted truth: all that the sound tells"
BLIND = "planted truth, direction of the bow unknown"
PARTS = ("body", "left hand", "right hand")


def ceilings(profile: RunProfile, data: PlayerData) -> pd.DataFrame:
    """Errors that no network can beat on planted test pieces: those of the planted truth itself.

    The truth is placed as a training places its pieces, and held against the tracked points, whose noise and sway no
    sound tells. Of a violinist also with the bow at the mean place of the training pieces: everything but its
    direction. Of any data the mean pose of the training pieces.

    Returns
    -------
    DataFrame with the columns row (`MEAN_POSE`, `BLIND`, `FLOOR`), projected, full
    """
    params = profiled(profile, data, row_settings(data, FINAL))
    played, split = read_set(data, params), data.sides(params)
    train, test = sides(played.sequences, split.train), sides(played.sequences, split.test)
    space = fitted_space(train, params)
    guesses = {MEAN_POSE: [np.broadcast_to(space.mean, each.points.shape) for each in test]}
    if data.planted:
        truth = [planted_points(data.planted[each.name], played.reference) for each in test]
        if data.instrument == "violin":
            bow = Bowing.fit(train, played.skeleton, params)
            guesses[BLIND] = [bow.at_rest(points) for points in truth]
        guesses[FLOOR] = truth
    rows = [{"row": row, **errors_of(points, test, space)._asdict()} for row, points in guesses.items()]
    return pd.DataFrame(rows)


def errors_of(points: Sequence[FloatArray], sequences: Sequence[PlayedSequence], space: PointSpace) -> Errors:
    """Errors of points (T, 2 P) against the sequences, projected on the components of `space` and in full."""
    return errors_between(points, [space.decode(space.encode(each.points)) for each in sequences], sequences)


def complete_table(profile: RunProfile, data: PlayerData, values: pd.DataFrame) -> pd.DataFrame:
    """`error_table`, and below it the mean pose and the planted limits as rows of their own.

    One more column, "% of shoulder width", is the full test error as a percentage of the reference's shoulder width;
    NaN for hands alone.
    """
    table, limits = error_table(values), ceilings(profile, data)
    mean_pose = limits.loc[limits["row"] == MEAN_POSE, "full"].item()
    limits = limits.rename(columns={"projected": "test projected", "full": "test full"})
    limits["of mean pose"] = limits["test full"] / mean_pose
    rows = pd.DataFrame([*table.to_dict("records"), *limits.to_dict("records")], columns=table.columns)
    width = read_set(data, profiled(profile, data, row_settings(data, FINAL))).reference.shoulder_width
    rows["% of shoulder width"] = 100 * rows["test full"] / width
    return rows


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
    test = sides(played.sequences, split.test)
    predicted = [predicted_points(network, each.sound)[each.accepted] for each in test]
    values = component_correlations(space, predicted, [each.points[each.accepted] for each in test])
    parts = moving_parts(space, played.skeleton)
    return pd.DataFrame(
        {
            "instrument": data.instrument,
            "component": np.arange(len(parts)) + 1,
            "share": shares,
            "part": parts,
            "correlation": values,
        }
    )


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
