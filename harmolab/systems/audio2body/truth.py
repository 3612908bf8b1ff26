"""A prediction beside the playing that was filmed: errors in pixels and in per cent of the shoulder width (A2B 19)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from harmolab.corpora.instruments import Performance
from harmolab.io.motion import motion_part
from harmolab.systems.audio2body.networks import SoundToPoints
from harmolab.systems.audio2body.perform import predicted_points
from harmolab.systems.audio2body.reading import read_sequence
from harmolab.systems.audio2body.train import frame_errors
from harmolab.types import FloatArray, Motion


class TruthErrors(NamedTuple):
    """Errors of a prediction against the true points, over the frames of them that are accepted.

    Parameters
    ----------
    pixels, mean_pose : float, pixels of the reference configuration: of the prediction; of the mean pose of training,
        which hears nothing
    shoulder_width : float, pixels; NaN for points without shoulders
    points : int, points that both have
    accepted : float, share of the frames
    """

    pixels: float
    mean_pose: float
    shoulder_width: float
    points: int
    accepted: float

    @property
    def percent(self) -> float:
        """Per cent of the shoulder width; NaN without shoulders."""
        return 100 * self.pixels / self.shoulder_width

    @property
    def mean_pose_percent(self) -> float:
        """The same of the mean pose."""
        return 100 * self.mean_pose / self.shoulder_width


@dataclass(frozen=True, eq=False)
class Compared:
    """True points and predicted ones, frame by frame at the rate of the network.

    Parameters
    ----------
    truth : Motion, (T, P, 2), placed as the network's points are; frames that are not accepted are filled in
    prediction : Motion of the same points
    errors : TruthErrors
    """

    truth: Motion
    prediction: Motion
    errors: TruthErrors


def compared(network: SoundToPoints, performance: Performance) -> Compared:
    """A performance, and the points that the network predicts for its sound, of the points that both have.

    Raises
    ------
    ValueError
        The performance is of another instrument or has no sound, no point in common with the network's, nothing to be
        placed by, or no frame that is accepted; it names the performance.
    """
    name = performance.name
    if performance.instrument != network.instrument:
        raise ValueError(f"{name}: is played on a {performance.instrument}, this player plays the {network.instrument}")
    own = performance.motion.skeleton.joints
    joints = [joint for joint in network.skeleton.joints if joint in own]
    if not joints:
        raise ValueError(f"{name}: has no point that this player has; its points are {', '.join(own[:6])} ...")
    motion = motion_part(performance.motion, joints, name)
    part = replace(performance, motion=motion, detected=performance.detected[:, [own.index(each) for each in joints]])
    sequence = read_sequence(part, network.params, network.reference, is_test=True)
    if not sequence.accepted.any():
        raise ValueError(f"{name}: every frame of its points is rejected, so there is nothing to compare with")
    numbers = [network.skeleton.joints.index(joint) for joint in joints]
    predicted = _selected(predicted_points(network, sequence.sound), numbers)
    mean = _selected(network.space_scale.space.mean[None], numbers)
    own_error, mean_error = (
        float(frame_errors(each, sequence.points)[sequence.accepted].mean()) for each in (predicted, mean)
    )
    width, accepted = network.reference.shoulder_width, float(sequence.accepted.mean())
    return Compared(
        Motion(sequence.points.reshape(len(predicted), -1, 2), network.params.fps, motion.skeleton, sequence.accepted),
        Motion(predicted.reshape(len(predicted), -1, 2), network.params.fps, motion.skeleton),
        TruthErrors(own_error, mean_error, width, len(joints), accepted),
    )


def _selected(points: FloatArray, numbers: list[int]) -> FloatArray:
    """Flat frames (T, 2 K) of the points of some numbers, from flat frames (T, 2 P)."""
    return points.reshape(len(points), -1, 2)[:, numbers].reshape(len(points), -1)
