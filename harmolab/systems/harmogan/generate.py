"""Dances of any length: meter by meter, each from the end of the last (paper Sec. 4.1, Fig. 7b).

For every meter the generator is given its music and the beats before it, and as initial poses what was danced in those
beats (Eq. 23). Its output for the beats before (TI = 1) is thrown away; its meter is continued from the end of the
last one. The first meter follows a movement from the bank of poses, brought to the music's tempo.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from harmolab.beats.audio import music_beats
from harmolab.io.files import Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.params import DANCES
from harmolab.systems.common.audio_features import audio_features
from harmolab.systems.common.borders import continued
from harmolab.systems.common.grounding import on_floor, planted_feet
from harmolab.systems.common.length import n_frames
from harmolab.systems.common.motion_code import decode_motion, encode_motion
from harmolab.systems.common.poses_bank import PoseBank, retimed
from harmolab.systems.common.priors import initial_poses, temporal_index
from harmolab.systems.common.torch_code import PATH_CHANNELS, fix_bones, local_joints
from harmolab.systems.common.units import UnitSet, collate
from harmolab.systems.harmogan.grid import MeterFrames, meter_frames
from harmolab.systems.harmogan.networks import Generator
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion


def synthesize_dance(
    generator: Generator,
    audio: Audio,
    *,
    beats: BeatTrack | None = None,
    seconds: float | None = None,
    start: float = 0.0,
    seed: int = 0,
    poses: PoseBank | None = None,
    initial: Motion | None = None,
    dance: str | None = None,
    plant_feet: bool = True,
    progress: Progress = silent,
) -> Motion:
    """A dance to music, at the generator's frame rate; frame 0 belongs to the audio time `start`.

    Parameters
    ----------
    generator : Generator that knows its audio features
    audio : Audio
        The whole recording, even where only a part is danced to: beats are tracked in all of it.
    beats : BeatTrack on the audio time line; tracked when left out, with the tempo of `dance` as prior
    seconds : float, length of the dance; to the end of the music when left out or longer
    start : float, seconds of audio time
    seed : int
        Draws the movement that the dance starts from: another seed, another dance.
    poses : PoseBank of movements to start from
        Left out: the mean pose at rest, which makes the same dance for every seed.
    initial : Motion of the generator's skeleton that the dance goes on from; then `seed` draws nothing
    dance : name of a dance; starts from a movement of that dance if the bank has one
    plant_feet : bool
        Keep feet that carry from sliding (`harmolab.systems.common.grounding`).
    progress : function(iterable, label) -> iterable

    Returns
    -------
    Motion; the dancer starts at x = z = 0 facing +z, and stands on y = 0

    Raises
    ------
    ValueError
        If `start` or `seconds` lies outside the music, `dance` is unknown to both the bank and the tempo table, the
        poses or `initial` do not fit the generator, or it was built without features.

    Examples
    --------
    >>> from harmolab.systems.harmogan.networks import load_generator
    >>> generator = load_generator("run/model")  # doctest: +SKIP
    >>> motion = synthesize_dance(generator, load_audio("song.mp3"), seconds=20.0, seed=3)  # doctest: +SKIP
    """
    frames = n_frames(audio, start, seconds, generator.fps)
    if generator.features is None:
        raise ValueError("this generator does not say which audio features it hears; build it with features=...")
    code = _first_movement(generator, poses, dance, seed) if initial is None else _coded(generator, initial)
    track = music_beats(Clip("", audio, beats=beats, dance=dance or ""))
    meters = meter_frames(track, generator.features, start=start, n_frames=frames, fps=generator.fps)
    first, last = meters[0].begin, meters[-1].end
    times = start + np.arange(first, last) / generator.fps
    music = audio_features(audio, track, times, generator.features)
    if initial is None:  # a movement of the bank fills the beats before a meter of four
        length = max(1, round(meters[0].share * len(code)))
        prior = retimed(code[-length:], meters[0].meter - first)
    else:  # `initial` keeps its speed, and ends where the dance begins, which may be inside a meter
        prior = retimed(code[first:], -first)
    code = _danced(generator, music, meters, prior, progress)[-first : frames - first]
    positions = decode_motion(_with_bones(generator, code), generator.fps, generator.skeleton)
    positions = on_floor(positions, generator.fps)
    if plant_feet:
        positions = planted_feet(positions, generator.fps, generator.skeleton)
    return Motion(positions, generator.fps, generator.skeleton)


@torch.no_grad()
def generate_units(generator: Generator, units: UnitSet) -> list[Motion]:
    """A dance to each whole unit, from its music and the poses before the meter; one batch through the generator."""
    batch = collate(units.units)
    codes = generator.eval()(torch.from_numpy(batch.audio), torch.from_numpy(batch.initial)).motion
    pairs = zip(codes, units.units, strict=True)
    return [units.decoded(code[: unit.n_frames].double().numpy()) for code, unit in pairs]


def _first_movement(generator: Generator, poses: PoseBank | None, dance: str | None, seed: int) -> FloatArray:
    """The motion code (T0, C) that a dance starts from, drawn by `seed`; without a bank the mean pose, at rest."""
    names = {*DANCES, *(() if poses is None else poses.dances)} - {""}
    if dance and dance not in names:
        raise ValueError(f"unknown dance {dance!r}; known: {', '.join(sorted(names))}")
    if poses is None:
        mean = generator.motion_scale.mean.detach().cpu().double().numpy().copy()
        mean[-PATH_CHANNELS:] = 0.0
        return mean[None]
    clips = poses.of(dance)
    if clips.shape[2] != generator.n_motion:
        raise ValueError(f"poses must be motion codes (K, T0, {generator.n_motion}), got shape {clips.shape}")
    # Consecutive seeds draw different movements, until each was drawn once.
    return clips[np.random.default_rng(0).permutation(len(clips))[seed % len(clips)]]


def _coded(generator: Generator, motion: Motion) -> FloatArray:
    """The motion code (T0, C) of a motion of the generator's skeleton."""
    if motion.skeleton.joints != generator.skeleton.joints:
        joints = len(motion.skeleton.joints), len(generator.skeleton.joints)
        raise ValueError(f"initial has other joints ({joints[0]}) than the generator ({joints[1]}); retarget it first")
    motion = resample_motion(motion, generator.fps)
    return encode_motion(motion.positions, motion.fps, motion.skeleton).astype(np.float64)


@torch.inference_mode()
def _danced(
    generator: Generator, music: NDArray[np.float32], meters: list[MeterFrames], prior: FloatArray, progress: Progress
) -> FloatArray:
    """The motion code (T, C) of all meters, one after the other, from the end of `prior` (P, C), its first frames."""
    origin = meters[0].begin
    code = np.zeros((meters[-1].end - origin, generator.n_motion))
    code[: len(prior)] = prior
    for meter in progress(meters, "dancing"):
        begin, now, end = (frame - origin for frame in (meter.begin, meter.meter, meter.end))
        motion = _meter(generator, music[begin:end], code[begin:end], now - begin)
        new = max(now, len(prior))
        code[new:end] = continued(code[:new], motion[new - now :], generator.fps)
    return code


def _meter(generator: Generator, music: NDArray[np.float32], code: FloatArray, n_prior: int) -> FloatArray:
    """Motion code of one meter, (T - n_prior, C), from its music (T, F) and the code (T, C) danced so far."""
    initial = initial_poses(code.astype(np.float32), temporal_index(len(code), n_prior))
    device = generator.bone_lengths.device
    motion = generator(torch.from_numpy(music[None]).to(device), torch.from_numpy(initial[None]).to(device)).motion
    return motion[0, n_prior:].double().cpu().numpy()


def _with_bones(generator: Generator, code: FloatArray) -> FloatArray:
    """The code (T, C) with every bone at the generator's length, which fading at a border has changed a little."""
    local = local_joints(torch.from_numpy(code)[None])
    fixed = fix_bones(local, generator.skeleton.parents, generator.bone_lengths.cpu().double())
    return np.concatenate([fixed[0].flatten(1).numpy(), code[:, -PATH_CHANNELS:]], axis=1)
