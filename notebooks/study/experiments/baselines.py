"""Dances that need no training: recorded movement as it is, retimed, or in pieces laid on the song's beats.

A comparison of systems means little without them. Pieces are the training units that networks learn from, in the same
code and with the same floor and feet; of each only the seven beats between its first and last half beat are danced, so
that no piece begins or ends on a beat, where a join would pass for a rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from harmolab.beats.visual import visual_beats
from harmolab.params import HarmonyParams
from harmolab.retime.retime import motion_at
from harmolab.retime.warps import beat_warp
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.feet import on_floor, planted_feet
from harmolab.systems.training.layers import PATH_CHANNELS
from harmolab.systems.training.motion_code import continued
from harmolab.systems.training.units import DanceUnit, UnitSet, filled_beats
from harmolab.types import FloatArray, Motion
from study.experiments.songs import Excerpt

EDGE = 0.5  # beats of a piece that are not danced at either end
CLOSEST = 0.5  # of a beat period: of rests that lie closer, one is taken
SHORTEST = 3  # beats between the first and the last rest of a piece
MFCC = FeatureParams.paper()  # what tells how similar two pieces of music are


@dataclass(frozen=True, eq=False)
class Material:
    """All that dances without training are made of: one corpus.

    Parameters
    ----------
    units : UnitSet of the training side
    dancers : sequence of Excerpt with recorded (or planted) movement of the corpus
    """

    units: UnitSet
    dancers: Sequence[Excerpt]

    @cached_property
    def timbres(self) -> FloatArray:
        """Mean MFCC of the music of every unit, (N, K)."""
        return np.stack([unit.audio[:, : self.units.features.n_mfcc].mean(axis=0) for unit in self.units.units])

    def places_of(self, dance: str) -> list[int]:
        """The places of the units of a dance; of all units where none is of that dance."""
        own = [place for place, unit in enumerate(self.units.units) if unit.dance == dance]
        return own or list(range(len(self.units)))


Baseline = Callable[[Material, Excerpt, np.random.Generator], Motion]


def recorded(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded (or planted) there."""
    return excerpt.dancer


def another_song(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded to another song of the same dance; of any dance where no other song has the same.

    Raises
    ------
    ValueError
        If there is no dancer of another song.
    """
    others = [other for other in material.dancers if other.song != excerpt.song]
    same = [other for other in others if other.clip.dance == excerpt.clip.dance]
    if not others:
        raise ValueError(f"{excerpt.song}: there is no other song whose dancer could be taken")
    other = (same or others)[int(rng.integers(len(same or others)))]
    return other.longer(excerpt.seconds).dancer


def retimed_dance(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded there, else to another song, bent in time so that its valleys meet the beats."""
    at_home = any(other.song == excerpt.song for other in material.dancers)
    motion = (recorded if at_home else another_song)(material, excerpt, rng)
    music, last = excerpt.beats.span(excerpt.start, motion.duration), (motion.n_frames - 1) / motion.fps
    warp = beat_warp(visual_beats(motion, params=HarmonyParams.valleys()), music, last)
    return motion_at(motion, warp.inverse(np.arange(motion.n_frames) / motion.fps))


def nearest_neighbour(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The training pieces whose music is most similar, by mean MFCC, to what is played; its beats on the song's."""
    scale = material.timbres.std(axis=0) + 1e-9

    def nearest(begin: float, end: float) -> DanceUnit:
        times = np.arange(begin, end, 1 / MFCC.fps)
        music = audio_features(excerpt.clip.audio, excerpt.beats, times, MFCC)[:, : material.timbres.shape[1]]
        apart = np.linalg.norm((material.timbres - music.mean(axis=0)) / scale, axis=1)
        return material.units.units[int(np.argmin(apart))]

    return _laid(material, excerpt, nearest, music_anchors)


def random_pieces(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """Training pieces of the dance drawn at random, the beats of their music on the song's."""
    return _laid(material, excerpt, _drawn(material, excerpt, rng), music_anchors)


def resting_pieces(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The same pieces, their rests on the song's beats: `rest_anchors`."""
    return _laid(material, excerpt, _drawn(material, excerpt, rng), rest_anchors)


def _drawn(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Callable[[float, float], DanceUnit]:
    places = material.places_of(excerpt.clip.dance)
    return lambda begin, end: material.units.units[places[int(rng.integers(len(places)))]]


BASELINES: Mapping[str, Baseline] = MappingProxyType(
    {
        "recorded, right song": recorded,
        "recorded, another song": another_song,
        "recorded, retimed": retimed_dance,
        "nearest neighbour": nearest_neighbour,
        "random pieces, beats on beats": random_pieces,
        "random pieces, rests on beats": resting_pieces,
    }
)
DRAWN = ("recorded, another song", "random pieces, beats on beats", "random pieces, rests on beats")  # by a seed


class Anchors(NamedTuple):
    """Moments of a unit's movement that belong on beats of a song.

    Parameters
    ----------
    beats : (K,) array, numbers of the beats, rising from 0
    seconds : (K,) array, seconds from the unit's frame 0
    """

    beats: FloatArray
    seconds: FloatArray


def music_anchors(unit: DanceUnit, units: UnitSet) -> Anchors:
    """The beats of the music that the unit was danced to; it ends with one beat more."""
    return Anchors(np.arange(unit.beats.size + 1.0), np.append(unit.beats, unit.n_frames / unit.fps))


def rest_anchors(unit: DanceUnit, units: UnitSet) -> Anchors:
    """The rests of the unit (valleys of the joint speed), each on a beat.

    A rest comes as many beats after the one before as their distance has, at least one; of rests that lie closer than
    half a beat the first is taken. So nothing is danced at less than half or more than one and a half times its speed.
    A unit with fewer than three beats between its rests keeps its `music_anchors`.
    """
    valleys = visual_beats(units.decoded(unit.motion.astype(np.float64)), params=HarmonyParams.valleys()).times
    period = unit.n_frames / unit.fps / unit.beats.size
    rests: list[float] = []
    numbers: list[int] = []
    for valley in valleys.tolist():
        if not rests or valley - rests[-1] >= CLOSEST * period:
            numbers.append(numbers[-1] + max(1, round((valley - rests[-1]) / period)) if rests else 0)
            rests.append(valley)
    if not numbers or numbers[-1] < SHORTEST:
        return music_anchors(unit, units)
    return Anchors(np.array(numbers, np.float64), np.array(rests))


def _laid(
    material: Material,
    excerpt: Excerpt,
    choose: Callable[[float, float], DanceUnit],
    anchors: Callable[[DanceUnit, UnitSet], Anchors],
) -> Motion:
    """Pieces one after the other, the `anchors` of each on the song's beats.

    `choose` answers the seconds of the song that a piece may be danced to with the unit to take it from.
    """
    units, fps = material.units, material.units.features.fps
    length = units.features.unit_beats
    beats, _ = filled_beats(excerpt.beats, excerpt.start, excerpt.start + excerpt.seconds, before=2)
    times = excerpt.start + np.arange(int(excerpt.seconds * fps + 1e-6)) / fps
    places = np.interp(times, beats, np.arange(beats.size))  # of every frame, in beats
    code = np.zeros((0, units.units[0].motion.shape[1]))
    origin = np.floor(places[0] - EDGE)  # the beat that a piece's beat 0 lies on
    while len(code) < times.size:
        unit = choose(*np.interp([origin + EDGE, origin + length - EDGE], np.arange(beats.size), beats))
        held = anchors(unit, units)
        end = origin + held.beats[-1] - EDGE
        frames = slice(len(code), int(np.searchsorted(places, end)))
        piece = danced_at(unit, held, places[frames] - origin, times[frames])
        code = np.concatenate([code, continued(code, piece, fps) if len(code) else piece])
        origin = end - EDGE
    positions = on_floor(units.decoded(code).positions, fps)
    return Motion(planted_feet(positions, fps, units.skeleton), fps, units.skeleton)


def danced_at(unit: DanceUnit, anchors: Anchors, beats: FloatArray, times: FloatArray) -> FloatArray:
    """A unit's motion code where it is at given places in beats, one a frame: (T, C).

    Poses are interpolated; the rates of the path are scaled by how much faster the piece is danced.

    Parameters
    ----------
    unit : DanceUnit
    anchors : Anchors of the unit
    beats : (T,) array, places within the anchors' beats
    times : (T,) array, seconds at which they are danced
    """
    own = PchipInterpolator(anchors.beats, anchors.seconds)(beats)
    frames = np.clip(own * unit.fps, 0.0, unit.n_frames - 1)
    code: FloatArray = CubicSpline(np.arange(unit.n_frames), unit.motion.astype(np.float64))(frames)
    speed = np.gradient(own, times) if times.size > 1 else np.ones(times.size)
    code[:, -PATH_CHANNELS:] *= speed[:, None]
    return code
