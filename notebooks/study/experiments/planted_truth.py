"""The truth about planted players beside a network: what sound can tell at best, and which components it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from harmolab.body.skeletons import Skeleton
from harmolab.musician.bow import Bowing, Strokes, place_at
from harmolab.musician.cleaning import Reference, cleaned, shot_similarities
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.perform import predicted_points, predicted_strokes
from harmolab.musician.sequences import PlayedSequence, PointSpace, fitted_space, sides
from harmolab.musician.synthetic import PlantedPerformance
from harmolab.musician.train import Errors, errors_between
from harmolab.readers.player_points import SIDES, hand_joints
from harmolab.types import FloatArray, IntArray
from study.experiments.player_tables import FINAL, MEAN_POSE, OURS, error_table, n_player_seeds, row_settings
from study.experiments.players import PlayerData, TrainedPlayer, profiled, read_set, trained_player
from study.profile import RunProfile

FLOOR = "planted truth: all that the sound tells"
BLIND = "planted truth, direction of the bow unknown"
PARTS = ("body", "left hand", "right hand")
Truth = Literal["clean", "from_audio", "direction_blind"]


class BowErrors(NamedTuple):
    """Errors of a network with `bow_phase`, and how it came to them.

    Parameters
    ----------
    predicted : Errors
    true_directions : Errors of the same turns and lengths, each stroke in the direction that the tracked bow took
    true_place : Errors with the place of the tracked bow
    direction_share : float, of the strokes whose direction is right
    n_strokes : int, predicted strokes
    """

    predicted: Errors
    true_directions: Errors
    true_place: Errors
    direction_share: float
    n_strokes: int


def planted_points(planted: PlantedPerformance, reference: Reference, part: Truth = "from_audio") -> FloatArray:
    """A part of the planted truth, placed as the tracked points of its performance are: (T, 100) pixels.

    Parameters
    ----------
    planted : PlantedPerformance at the frame rate of the network
    reference : Reference of the training
    part : "clean", "from_audio" (all that sound can tell: the floor of the error), or "direction_blind" (everything
        but the direction of the bow)

    Raises
    ------
    ValueError
        For the direction of a pianist's bow.
    """
    points = getattr(planted, part)
    if points is None:
        raise ValueError(f"{planted.performance.name}: a {planted.performance.instrument} has no bow")
    result = cleaned(planted.performance)
    fits = shot_similarities(result, reference)
    parts = [fit.apply(points[span]) for fit, span in zip(fits, result.shots, strict=True)]
    return np.concatenate(parts).reshape(len(points), -1)


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


def component_correlations(
    space: PointSpace, predicted: Sequence[FloatArray], truth: Sequence[FloatArray]
) -> FloatArray:
    """Correlation (n,) of each component of predicted points (T, 2 P) with that of the truth, all recordings in a row.

    NaN where one of them does not move.
    """
    pairs = [space.encode(np.concatenate(values)) for values in (predicted, truth)]
    centred = [values - values.mean(axis=0) for values in pairs]
    sizes = [np.sqrt(np.square(values).sum(axis=0)) for values in centred]
    product = (centred[0] * centred[1]).sum(axis=0)
    return np.divide(product, sizes[0] * sizes[1], out=np.full(product.size, np.nan), where=sizes[0] * sizes[1] > 0)


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


def bow_table(profile: RunProfile, data: PlayerData) -> pd.DataFrame:
    """The recommended violinist on the test pieces: what it loses by directions, and by lengths of strokes.

    Returns
    -------
    DataFrame with the columns seed, predicted, "true directions", "true place" (full errors, pixels: `BowErrors`),
    "directions right" (share of the strokes), strokes
    """
    rows = []
    for seed in range(1, n_player_seeds(profile) + 1):
        network = trained_player(profile, data, row_settings(data, OURS), seed).system.network
        own = bow_errors(network, sides(read_set(data, network.params).sequences, data.split.test))
        errors = {"predicted": own.predicted, "true directions": own.true_directions, "true place": own.true_place}
        row = {"seed": seed} | {name: value.full for name, value in errors.items()}
        rows.append(row | {"directions right": own.direction_share, "strokes": own.n_strokes})
    return pd.DataFrame(rows)


def bow_errors(network: SoundToPoints, sequences: Sequence[PlayedSequence]) -> BowErrors:
    """Errors of a network with `bow_phase` as it predicts, and as it would if it were told directions or places.

    ValueError for a network without it.
    """
    if network.bow_scale is None:
        raise ValueError("this network was trained without bow_phase; it knows no strokes")
    bow, fps = network.bow_scale.bow, network.params.fps
    strokes = [predicted_strokes(network, each.sound) for each in sequences]
    ways = [bow.place(each.points) for each in sequences]
    signs = [true_signs(each, way, fps) for each, way in zip(strokes, ways, strict=True)]
    right = np.concatenate([each.signs == sign for each, sign in zip(strokes, signs, strict=True)])
    predicted = [
        predicted_points(network, each.sound, strokes=own) for each, own in zip(sequences, strokes, strict=True)
    ]
    directed = [
        predicted_points(network, each.sound, strokes=own._replace(signs=sign))
        for each, own, sign in zip(sequences, strokes, signs, strict=True)
    ]
    moved = [bow.at_place(bow.at_rest(guess), way) for guess, way in zip(predicted, ways, strict=True)]
    truth = [network.projected(each.points) for each in sequences]
    return BowErrors(
        predicted=errors_between(predicted, truth, sequences),
        true_directions=errors_between(directed, truth, sequences),
        true_place=errors_between(moved, truth, sequences),
        direction_share=float(right.mean()) if right.size else float("nan"),
        n_strokes=right.size,
    )


def true_signs(strokes: Strokes, way: FloatArray, fps: float) -> IntArray:
    """(K,) directions in which the tracked bow (T,) went from the beginning to the end of each stroke."""
    return np.where(np.diff(place_at(way, strokes.turns, fps)) >= 0, 1, -1)
