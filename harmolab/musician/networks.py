"""The network (Sec. 4, Fig. 4), one LSTM over the sound and a linear layer to the principal components; its playing."""

from collections.abc import Mapping
from dataclasses import asdict
from math import ceil
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor, nn

from harmolab.body.skeletons import Skeleton
from harmolab.musician.bow import Bowing, Strokes, loudness, turns_of
from harmolab.musician.cleaning import Reference
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PointSpace, continued, frames_of, input_features, steps_of
from harmolab.readers.arrays import number_array
from harmolab.readers.player_points import INSTRUMENTS
from harmolab.systems.training.about import stored_list, stored_skeleton, whole
from harmolab.systems.training.layers import Normaliser
from harmolab.systems.training.weights import stored_record
from harmolab.types import Audio, FloatArray, Motion, Notes, SingleArray

State = tuple[Tensor, Tensor]


class SoundToPoints(nn.Module):
    """Sound (N, S, F) at `params.step_rate` to scaled components (N, S, n) of the points, `params.delay` later.

    Parameters
    ----------
    params : Audio2BodyParams
    skeleton : Skeleton of the P points
    instrument : "piano" or "violin"
    n_components : int
    reference : Reference that the points are placed by

    Raises
    ------
    ValueError
        For `params.bow_phase` of another instrument than a violin.

    Notes
    -----
    With `params.bow_phase` one output more follows the components: `harmolab.musician.bow.turn_signal`.
    """

    system = "audio2body"

    def __init__(
        self, params: Audio2BodyParams, skeleton: Skeleton, instrument: str, n_components: int, reference: Reference
    ) -> None:
        super().__init__()
        if params.bow_phase and instrument != "violin":
            raise ValueError(f"bow_phase is of violinists, and this is a {instrument}")
        self.params, self.skeleton, self.instrument, self.reference = params, skeleton, instrument, reference
        self.sound_scale = Normaliser(params.n_sound)
        self.space_scale = KeptArrays(PointSpace.empty(len(skeleton.joints), n_components))
        self.lstm = nn.LSTM(params.n_sound, params.hidden, params.layers, batch_first=True)
        self.dropout = nn.Dropout(params.dropout)
        self.bow_scale = KeptArrays(Bowing.empty(len(skeleton.joints))) if params.bow_phase else None
        self.linear = nn.Linear(params.hidden, n_components + params.bow_phase)
        with torch.no_grad():
            gate = slice(params.hidden, 2 * params.hidden)  # of forgetting; two biases are added to each gate
            biases = dict(self.lstm.named_parameters())
            for layer in range(params.layers):
                biases[f"bias_ih_l{layer}"][gate] = 1.0
                biases[f"bias_hh_l{layer}"][gate] = 0.0

    def forward(self, sound: Tensor, state: State | None = None) -> tuple[Tensor, State]:
        """Components, and the state after the last step; from a state of 0 when left out."""
        values, state = self.lstm(self.sound_scale(sound), state)
        components: Tensor = self.linear(self.dropout(values))
        return components, state

    @torch.no_grad()
    def predicted(self, steps: SingleArray) -> FloatArray:
        """Components (S, n) of the sound (S, F) of one recording, in evaluation mode."""
        components, _ = self.eval()(torch.from_numpy(steps)[None].to(self.sound_scale.mean.device))
        return np.asarray(components[0].double().cpu().numpy())

    def set_statistics(self, mean: Tensor, std: Tensor, space: PointSpace, bow: Bowing | None = None) -> None:
        """Normalise sound (F,) and points by the training split from now on."""
        if self.bow_scale is not None and bow is not None:
            self.bow_scale.set(bow)
        self.sound_scale.set(mean, std)
        self.space_scale.set(space)

    @property
    def space(self) -> PointSpace:
        """The components, by the training split."""
        space: PointSpace = self.space_scale.record
        return space

    @property
    def bow(self) -> Bowing | None:
        """The bow, by the training split; None without `params.bow_phase`."""
        return None if self.bow_scale is None else self.bow_scale.record

    def projected(self, points: FloatArray) -> FloatArray:
        """Points (T, 2 P) as far as the components (with `bow_phase` also the bow's place) can tell them."""
        space, bow = self.space, self.bow
        if bow is None:
            return space.decode(space.encode(points))
        return bow.at_place(space.decode(space.encode(bow.at_rest(points))), bow.place(points))

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {
            "params": asdict(self.params),
            "skeleton": asdict(self.skeleton),
            "instrument": self.instrument,
            "components": len(self.space.sizes),
            "reference": {"joints": self.reference.joints, "points": self.reference.points.tolist()},
        }

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A network as its description says; ValueError for sizes that cannot be."""
        if build["instrument"] not in INSTRUMENTS:
            raise ValueError(f"describes the instrument {str(build['instrument'])[:40]!r}")
        skeleton = stored_skeleton(build)
        components = whole("components", build["components"])
        if components > 2 * len(skeleton.joints):
            raise ValueError(f"describes {components} components of {len(skeleton.joints)} points")
        params = stored_record(Audio2BodyParams, build["params"])
        return cls(params, skeleton, build["instrument"], components, _stored_reference(build["reference"], skeleton))


def _stored_reference(stored: Mapping[str, Any], skeleton: Skeleton) -> Reference:
    """The reference of a description; ValueError for other points than the skeleton's."""
    joints = tuple(str(name) for name in stored_list(stored, "joints"))
    if not {*joints} <= {*skeleton.joints}:
        raise ValueError(f"describes a reference of other points than its {len(skeleton.joints)}")
    points = number_array(stored["points"], "reference", (len(joints), 2)) if joints else np.zeros((0, 2))
    return Reference(joints, points)


class KeptArrays(nn.Module):
    """The arrays of a `PointSpace` or a `Bowing`, kept with the network by their names; it has no weights."""

    def __init__(self, record: PointSpace | Bowing) -> None:
        super().__init__()
        self.kind: Any = type(record)
        for name, values in asdict(record).items():
            self.register_buffer(name, torch.from_numpy(values).float())

    def set(self, record: PointSpace | Bowing) -> None:
        """Keep the arrays of a record of the same sizes."""
        for name, values in asdict(record).items():
            self.get_buffer(name).copy_(torch.from_numpy(values))

    @property
    def record(self) -> Any:
        """The record in numpy."""
        return self.kind(**{name: values.double().cpu().numpy() for name, values in self.named_buffers()})


# A performance from sound: the network over a recording, in one pass


def synthesize_performance(
    network: SoundToPoints,
    audio: Audio,
    *,
    start: float = 0.0,
    seconds: float | None = None,
    notes: Notes | None = None,
) -> Motion:
    """The points of a musician who plays a recording: (T, P, 2) pixels of the reference configuration.

    Parameters
    ----------
    network : trained
    audio : the whole recording
    start : float, seconds of audio time of frame 0; the network hears the whole recording
    seconds : float; to the end when left out or longer
    notes : of the recording, needed by a network that hears notes

    Raises
    ------
    ValueError
        If `start` or `seconds` lies outside the recording, less than two frames are left, or notes are missing.
    """
    params = network.params
    length = audio.duration - start if seconds is None else min(seconds, audio.duration - start)
    if not (np.isfinite(start) and start >= 0 and length > 0):
        raise ValueError(f"start and seconds must lie within the recording of {audio.duration:.2f} s")
    if (count := int(length * params.fps + 1e-6)) < 2:
        raise ValueError(f"{length:.2f} s of sound are less than two frames of {1 / params.fps:.3f} s")
    if params.hears == "notes" and notes is None:
        raise ValueError("this network hears notes, not sound; pass them")
    return points_from(network, audio, notes, start=start, count=count)


def points_from(
    network: SoundToPoints, audio: Audio | None, notes: Notes | None, *, start: float, count: int
) -> Motion:
    """So many frames (count, P, 2) from second `start` on, to what is heard in the whole recording.

    A violinist whose sound began in the middle would bow the other way: the direction is counted from the beginning.
    What follows the part is heard, too: movement comes `params.delay` after its sound, and strokes are held against
    later ones.
    """
    fps, length = network.params.fps, 0.0 if audio is None else audio.duration
    before = max(0, ceil(start * fps - 1e-6))
    whole = before + max(count, int((length - start) * fps + 1e-6))
    sound = input_features(audio, notes, network.params, whole, start=start - before / fps)
    return Motion(predicted_points(network, sound)[before:][:count].reshape(count, -1, 2), fps, network.skeleton)


def predicted_points(network: SoundToPoints, sound: SingleArray, *, strokes: Strokes | None = None) -> FloatArray:
    """Points (T, 2 P) for what is heard (T, F), in one pass over the whole recording.

    With `bow_phase`, `strokes` may be given in place of those that `predicted_strokes` hears.
    """
    params = network.params
    components = _predicted_steps(network, sound)[:, : len(network.space.sizes)]
    points = network.space.decode(frames_of(components, params.upsample, params.delay_steps))
    bow = network.bow
    if bow is None:
        return points
    strokes = predicted_strokes(network, sound) if strokes is None else strokes
    return bow.at_place(points, bow.places(strokes, len(points), params.fps))


def predicted_strokes(network: SoundToPoints, sound: SingleArray) -> Strokes:
    """The strokes of the bow for what is heard (T, F); ValueError for a network without `bow_phase`."""
    bow = network.bow
    if bow is None:
        raise ValueError("this network was trained without bow_phase; it knows no strokes")
    params = network.params
    signal = _predicted_steps(network, sound)[params.delay_steps :, -1]
    return bow.strokes(turns_of(signal, params.step_rate), loudness(sound, params), params.fps)


def _predicted_steps(network: SoundToPoints, sound: SingleArray) -> FloatArray:
    """Outputs of the network, (S + delay, n) steps, over a whole recording (T, F)."""
    params = network.params
    return network.predicted(continued(steps_of(sound, params.upsample), params.delay_steps))
