"""What a generator does on units it was not trained on: hard scores of its motion, beside those of the recorded one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from harmolab.beats.visual import visual_beats
from harmolab.data.units import DanceUnit, UnitSet, collate
from harmolab.features.kinetic import kinetic_features
from harmolab.features.poses import decode_motion
from harmolab.harmony import score_harmony
from harmolab.metrics import diversity, foot_skating, frechet_distance, jerk, standardise
from harmolab.models.harmogan import Generator
from harmolab.models.pose_features import PoseNet
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, HarmonyScore, Motion

__all__ = ["generate", "judge", "meter_motion", "score_unit", "unit_motion"]

FloatArray = NDArray[np.float64]


@torch.no_grad()
def generate(generator: Generator, units: UnitSet) -> list[FloatArray]:
    """Motion codes (T, C) a generator makes for the units, each from its own music and the poses before the meter."""
    batch = collate(units.units)
    made = generator.eval()(torch.from_numpy(batch.audio), torch.from_numpy(batch.initial)).motion
    return [code[: unit.n_frames].double().numpy() for code, unit in zip(made, units.units, strict=True)]


def unit_motion(code: FloatArray, units: UnitSet) -> Motion:
    """The motion that a code (T, C) of these units stands for."""
    fps = units.features.fps
    return Motion(decode_motion(code, fps, units.skeleton), fps, units.skeleton)


def meter_motion(code: FloatArray, unit: DanceUnit, units: UnitSet) -> Motion:
    """The same without the beats before the meter."""
    motion = unit_motion(code, units)
    return Motion(motion.positions[unit.n_prior :], motion.fps, motion.skeleton)


def score_unit(motion: Motion, unit: DanceUnit, params: HarmonyParams) -> HarmonyScore:
    """Harmony of a unit's motion over its meter: beats are found in all of it, those of the meter count."""
    start, end = unit.n_prior / motion.fps, motion.duration
    heard = BeatTrack(unit.beats, unit.strengths, motion.fps, max(end, float(unit.beats.max(initial=0.0))))
    seen = visual_beats(motion, params=params)
    music = heard.span(start, end - start)
    return score_harmony(music, seen.span(start, end - start), params=params, n_rotations=0)


def judge(codes: Sequence[FloatArray], units: UnitSet, pose_net: PoseNet, *, seed: int = 0) -> dict[str, float]:
    """Means over units of every measure of motion codes (T, C), one for each unit.

    Returns
    -------
    dict with, in paper mode (`paper_`) and for valleys within 0.1 s: harmony, hit rate, chance, harmony above chance,
    M and N a unit, M / N; jerk (m/s^3), skating (m/s), Frechet distances on the pose network's and on kinetic features,
    to the units' recorded motion, and diversity.
    """
    motions = [unit_motion(code, units) for code in codes]
    found = _harmony(motions, units, HarmonyParams.paper(), "paper_") | _harmony(
        motions, units, HarmonyParams.valleys(), ""
    )
    meters = [meter_motion(code, unit, units) for code, unit in zip(codes, units.units, strict=True)]
    recorded = [meter_motion(unit.motion.astype(np.float64), unit, units) for unit in units.units]
    found["jerk"] = float(np.mean([jerk(motion) for motion in meters]))
    found["foot_skating"] = float(np.mean([foot_skating(motion) for motion in meters]))
    target = embed([unit.motion for unit in units.units], units, pose_net)
    mine = embed(codes, units, pose_net)
    found["fid"] = frechet_distance(mine, target, seed=seed).value
    found["fid_raw"] = frechet_distance(mine, target, correct_bias=False).value
    kinetic, reference = (np.stack([kinetic_features(motion) for motion in each]) for each in (meters, recorded))
    kinetic, reference = standardise(kinetic, reference), standardise(reference, reference)
    found["fid_kinetic"] = frechet_distance(kinetic, reference, seed=seed).value
    found["diversity"] = diversity(mine)
    found["units"] = float(len(units))
    return found


def _harmony(motions: Sequence[Motion], units: UnitSet, params: HarmonyParams, prefix: str) -> dict[str, float]:
    """Mean harmony figures of one mode."""
    scores = [score_unit(motion, unit, params) for motion, unit in zip(motions, units.units, strict=True)]
    fields: dict[str, Callable[[HarmonyScore], float]] = {
        "harmony": lambda score: score.harmony,
        "hit_rate": lambda score: score.hit_rate,
        "chance": lambda score: score.chance,
        "above_chance": lambda score: score.harmony_above_chance,
        "n_visual": lambda score: float(score.n_visual),
        "n_audio": lambda score: float(score.n_audio),
    }
    means = {f"{prefix}{name}": float(np.mean([read(score) for score in scores])) for name, read in fields.items()}
    means[f"{prefix}count_ratio"] = means[f"{prefix}n_visual"] / max(means[f"{prefix}n_audio"], 1e-9)
    return means


@torch.no_grad()
def embed(codes: Sequence[NDArray[np.floating]], units: UnitSet, pose_net: PoseNet) -> FloatArray:
    """Pose network's features (N, D) of the meters of motion codes."""
    cut = [replace(unit, motion=np.asarray(code, np.float32)) for code, unit in zip(codes, units.units, strict=True)]
    pieces = [torch.from_numpy(unit.motion[unit.n_prior :]) for unit in cut]
    mask = torch.nn.utils.rnn.pad_sequence([torch.ones(len(piece)) for piece in pieces], batch_first=True)
    motion = torch.nn.utils.rnn.pad_sequence(pieces, batch_first=True)
    return pose_net.eval().embed(motion, mask).double().numpy()
