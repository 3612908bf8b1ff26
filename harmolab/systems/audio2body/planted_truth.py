"""Predictions beside the planted truth: floor and ceiling of the errors, components, directions of the bow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from harmolab.corpora.synthetic.players import PlantedPerformance
from harmolab.systems.audio2body.bow import Bowing, Strokes, place_at
from harmolab.systems.audio2body.cleaning import cleaned
from harmolab.systems.audio2body.networks import SoundToPoints
from harmolab.systems.audio2body.perform import predicted_points, predicted_strokes
from harmolab.systems.audio2body.placing import Reference, shot_similarities
from harmolab.systems.audio2body.point_space import PointSpace
from harmolab.systems.audio2body.sequences import PlayedSequence
from harmolab.systems.audio2body.train import Errors, errors_between
from harmolab.types import FloatArray, IntArray

Part = Literal["clean", "from_audio", "direction_blind"]


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


def planted_points(planted: PlantedPerformance, reference: Reference, part: Part = "from_audio") -> FloatArray:
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


def planted_errors(
    network: SoundToPoints,
    planted: Sequence[PlantedPerformance],
    sequences: Sequence[PlayedSequence],
    part: Part = "from_audio",
    *,
    bow: Bowing | None = None,
) -> Errors:
    """Errors of a part of the planted truth against the tracked points: what the best prediction from it would have.

    Parameters
    ----------
    network : trained; errors are against the points as far as its components can tell them, and against all of them
    planted, sequences : the same performances, in the same order
    part : as in `planted_points`
    bow : Bowing of the training recordings, optional
        With it the bow of the truth stays at their mean place: the ceiling of a prediction that cannot know the
        direction. ("direction_blind" has it at the mean of the recording itself, which nothing but the truth can tell.)
    """
    truth = [planted_points(each, network.reference, part) for each in planted]
    if bow is not None:
        truth = [bow.at_rest(points) for points in truth]
    return errors_between(truth, [network.projected(each.points) for each in sequences], sequences)


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
        direction_share=float(right.mean()),
        n_strokes=right.size,
    )


def true_signs(strokes: Strokes, way: FloatArray, fps: float) -> IntArray:
    """(K,) directions in which the tracked bow (T,) went from the beginning to the end of each stroke."""
    return np.where(np.diff(place_at(way, strokes.turns, fps)) >= 0, 1, -1)
