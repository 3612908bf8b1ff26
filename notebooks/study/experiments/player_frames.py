"""Test pieces frame by frame: tracked points beside those predicted from the sound, and frames picked by rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harmolab.body.skeletons import Skeleton
from harmolab.musician.networks import SoundToPoints, predicted_points
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSequence, read_sequence, sides
from harmolab.musician.synthetic import PlantedPerformance
from harmolab.musician.train import frame_errors
from harmolab.readers.player_points import HANDS_12, SIDES, hand_joints
from harmolab.types import FloatArray, Motion
from study.experiments.players import PlayerData, our_settings, planted_data, read_set, tracked_players, trained_player
from study.profile import RunProfile

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.9, 0.95)
N_WORST, APART = 4, 1.0  # the worst frames, and seconds between two of one piece: else all would be one moment
PREDICTED, TRUE = "predicted from the sound", "planted truth"
SEED = 1  # of the training that is looked at
OVERLAID, BODY_ONLY = "violinist", "pianist_side_view"  # tracked videos; the second has no hands, and is of one side


@dataclass(frozen=True, eq=False)
class PredictedPiece:
    """One piece that no training saw or heard.

    Parameters
    ----------
    performance : Performance, as it was recorded or planted
    tracked : Motion, (T, P, 2), its points cleaned and placed; valid where they are accepted
    predicted : Motion, the same points from the sound alone
    errors : (T,) array, pixels of the reference configuration (millimetres of real hands), of each frame
    planted : PlantedPerformance, the truth about a planted one
    """

    performance: Performance
    tracked: Motion
    predicted: Motion
    errors: FloatArray
    planted: PlantedPerformance | None = None

    @property
    def times(self) -> FloatArray:
        """(T,) seconds of the frames."""
        return np.arange(self.tracked.n_frames) / self.tracked.fps

    @property
    def unit(self) -> str:
        """Unit of the points: millimetres of hands on one keyboard, else pixels."""
        return "mm" if self.tracked.skeleton == HANDS_12 else "px"

    @property
    def pair(self) -> dict[str, Motion]:
        """The predicted points, and those that were planted, without noise and faults.

        ValueError for recorded pieces, whose truth is not known.
        """
        if self.planted is None:
            raise ValueError(f"{self.performance.name}: is recorded, and only its tracked points are known")
        motion = self.performance.motion
        truth = Motion(self.planted.clean, motion.fps, motion.skeleton)
        return {PREDICTED: self.predicted, TRUE: truth}


@dataclass(frozen=True, eq=False)
class PickedFrame:
    """One frame of a piece, and the rule in words by which it was picked."""

    piece: PredictedPiece
    frame: int
    rule: str = "even steps"

    @property
    def error(self) -> float:
        """Its error, pixels or millimetres."""
        return float(self.piece.errors[self.frame])

    @property
    def words(self) -> str:
        """The rule and the error, in one line."""
        return f"{self.rule}: {self.error:.1f} {self.piece.unit}"

    @property
    def seconds(self) -> float:
        """Its place in the piece."""
        return self.frame / self.piece.tracked.fps

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton of its points."""
        return self.piece.tracked.skeleton

    @property
    def tracked(self) -> FloatArray:
        """(P, 2) tracked points."""
        return self.piece.tracked.positions[self.frame]

    @property
    def predicted(self) -> FloatArray:
        """(P, 2) predicted points."""
        return self.piece.predicted.positions[self.frame]

    @property
    def hand_shares(self) -> dict[str, float]:
        """Share of the squared error that each hand has, with its wrist: left, right."""
        squares = np.square(self.predicted - self.tracked).sum(axis=1)
        joints = self.skeleton.joints
        parts = {side: [joint in (*hand_joints(side), f"{side}_wrist") for joint in joints] for side in SIDES}
        return {side: float(squares[part].sum() / max(squares.sum(), 1e-12)) for side, part in parts.items()}


def predicted_pieces(profile: RunProfile, data: PlayerData) -> tuple[PredictedPiece, ...]:
    """The test pieces with what the recommended network predicts for them; it is trained unless it was before."""
    network = recommended_network(profile, data)
    performances = {each.name: each for each in data.performances}
    return tuple(
        _predicted(network, performances[sequence.name], sequence, data.planted.get(sequence.name))
        for sequence in sides(read_set(data, network.params).sequences, data.split.test)
    )


def recommended_network(profile: RunProfile, data: PlayerData) -> SoundToPoints:
    """The network of `Audio2BodyParams.recommended`, of the first seed."""
    return trained_player(profile, data, our_settings(data), SEED).system.network


def _predicted(
    network: SoundToPoints, performance: Performance, sequence: PlayedSequence, truth: PlantedPerformance | None = None
) -> PredictedPiece:
    predicted, shape, fps = predicted_points(network, sequence.sound), (len(sequence.sound), -1, 2), network.params.fps
    tracked = Motion(sequence.points.reshape(shape), fps, network.skeleton, sequence.accepted)
    motion = Motion(predicted.reshape(shape), fps, network.skeleton)
    return PredictedPiece(performance, tracked, motion, frame_errors(predicted, sequence.points), truth)


def quantile_frames(pieces: Sequence[PredictedPiece], quantiles: Sequence[float] = QUANTILES) -> list[PickedFrame]:
    """For each quantile the accepted frame whose error has that rank among all of them (Figs. 7, 8).

    Of n frames in the order of their errors it is number q (n - 1), rounded; of equal errors the earlier frame is
    first.
    """
    frames = sorted(_accepted(pieces), key=lambda frame: frame.error)
    picked = [(frames[round(quantile * (len(frames) - 1))], quantile) for quantile in quantiles]
    return [replace(frame, rule=f"{100 * quantile:g} % of the frames are better") for frame, quantile in picked]


def worst_frames(pieces: Sequence[PredictedPiece], count: int = N_WORST) -> list[PickedFrame]:
    """The accepted frames with the largest errors (Fig. 11); two of one piece lie `APART` seconds or more apart."""
    picked: list[PickedFrame] = []
    for frame in sorted(_accepted(pieces), key=lambda frame: -frame.error):
        steps = [abs(frame.frame - other.frame) for other in picked if other.piece is frame.piece]
        if len(picked) < count and min(steps, default=np.inf) >= APART * frame.piece.tracked.fps:
            picked.append(replace(frame, rule=f"number {len(picked) + 1} from the worst"))
    return picked


def even_frames(piece: PredictedPiece, count: int) -> list[PickedFrame]:
    """So many accepted frames of a piece, at even steps from the first to the last."""
    frames = _accepted([piece])
    return [frames[place] for place in np.rint(np.linspace(0, len(frames) - 1, count)).astype(int)]


def _accepted(pieces: Sequence[PredictedPiece]) -> list[PickedFrame]:
    """All accepted frames, piece after piece."""
    return [PickedFrame(piece, int(frame)) for piece in pieces for frame in np.flatnonzero(piece.tracked.valid)]


def tracked_violinist(profile: RunProfile) -> PredictedPiece | None:
    """A tracked violinist, and what the network of the planted ones predicts from the recorded sound.

    To be looked at: the planted violinist is no measure of a real one. None without recordings.
    """
    if (performance := tracked_player(OVERLAID)) is None:
        return None
    network = recommended_network(profile, planted_data(profile, "violin"))
    sequence = read_sequence(performance, network.params, network.reference, is_test=True)
    return _predicted(network, performance, sequence)


def tracked_player(name: str = BODY_ONLY) -> Performance | None:
    """A tracked musician by name: a pianist's body, seen from the side, to be looked at. None without recordings."""
    return next((each for each in tracked_players() if each.name == name), None)
