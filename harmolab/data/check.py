"""What a file or a corpus holds, and what is odd about it: the rows of `harmolab data check PATH`.

Nothing here fails on a file: what cannot be read becomes a row that says why.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.data import tang2018
from harmolab.data.folders import find_sequences, load_any_motion, load_sequence
from harmolab.io.audio import audio_info, load_audio
from harmolab.io.beats import load_annotation
from harmolab.io.files import PathLike
from harmolab.types import Audio, BoolArray, Motion

__all__ = ["Finding", "check"]

MAX_SPEED = 10.0
FROZEN_SECONDS = 0.5
_STILL_METRES = 1e-4
_HEIGHTS = (0.8, 2.5)
_MAX_FILES = 10_000

_SOUND = (".wav", ".flac", ".ogg", ".mp3")
_BEATS = (".beats", ".csv", ".txt")
_MOTION = (".npz", ".npy", ".bvh", ".pkl", ".pickle", ".jsonl")
_HEAD = 100_000  # bytes


@dataclass(frozen=True)
class Finding:
    """One row: what a file or a sequence folder holds.

    Parameters
    ----------
    path : str
    kind : "sequence", "audio", "motion", "beats" or "unreadable"
    frames : int or None
        Frames of motion, samples of audio, or number of beats.
    rate : float or None
        Frames or samples a second; None where the file does not tell.
    joints : int or None
    seconds : float or None
    offset : float or None, seconds
        Audio time of motion frame 0.
    note : str
        What else it holds: dimensions, format, dance, tempo.
    odd : tuple of str
        One sentence for each odd thing, missing part, or the reason why it cannot be read.
    """

    path: str
    kind: str
    frames: int | None = None
    rate: float | None = None
    joints: int | None = None
    seconds: float | None = None
    offset: float | None = None
    note: str = ""
    odd: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self) | {"odd": list(self.odd)}


def check(path: PathLike) -> list[Finding]:
    """One row for a file, or one for each sequence and each loose file of a folder.

    Raises
    ------
    FileNotFoundError
        There is nothing at `path`. Whatever is there gives rows, never an error.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file or folder")
    if not path.is_dir():
        return [_guarded(_file, path)]
    found = find_sequences(path)
    rows = [_guarded(_sequence, folder) for folder in found.folders]
    rows += [Finding(str(problem.folder), "unreadable", odd=(problem.message,)) for problem in found.problems]
    taken = {*found.folders, *(problem.folder for problem in found.problems)}
    rows += [_guarded(_file, file) for file in _loose(path, taken)]
    return rows or [Finding(str(path), "unreadable", odd=(f"{path}: holds no file that is known",))]


def _guarded(look: Callable[[Path], Finding], path: Path) -> Finding:
    """The row that `look` gives, or one that says why it could not."""
    try:
        return look(path)
    except (ValueError, OSError) as error:
        return Finding(str(path), "unreadable", odd=(str(error),))


def _loose(root: Path, taken: set[Path]) -> list[Path]:
    """Known files below `root` outside of the sequence folders, and folders of OpenPose files."""
    loose: list[Path] = []
    for name, below, files in os.walk(root):
        folder = Path(name)
        below[:] = sorted(child for child in below if not child.startswith("."))
        if folder in taken:
            continue
        if any(file.endswith("_keypoints.json") for file in files):
            loose.append(folder)
        loose += [folder / file for file in sorted(files) if _is_known(file)]
        if len(loose) > _MAX_FILES:
            break
    return loose[:_MAX_FILES]


def _is_known(name: str) -> bool:
    """Whether a file's name is one that the readers know."""
    named = name in ("beats.json", "skeletons.json", "config.json")
    return named or Path(name).suffix.lower() in (*_SOUND, *_BEATS, *_MOTION)


def _file(path: Path) -> Finding:
    """The row of one file, or of a folder of OpenPose files."""
    suffix = path.suffix.lower()
    if suffix in _SOUND:
        return _sound(path)
    if path.name == "config.json":
        span = tang2018.load_config(path)
        return Finding(str(path), "sequence", span.end - span.start, tang2018.FPS, offset=span.start / tang2018.FPS)
    if suffix in _BEATS or (suffix == ".json" and _is_annotation(path)):
        return _beats(path)
    return _motion(path)


def _is_annotation(path: Path) -> bool:
    """Whether a JSON file is one of beats, by its name or by the one field that those must have."""
    with path.open("rb") as file:
        return path.name == "beats.json" or b'"beats_s"' in file.read(_HEAD)


def _sound(path: Path) -> Finding:
    """The row of a sound file; the samples are looked at if they are not too many."""
    info = audio_info(path)
    row = Finding(
        str(path),
        "audio",
        round(info.seconds * info.sample_rate),
        info.sample_rate,
        seconds=info.seconds,
        note=f"{info.format}, {'mono' if info.channels == 1 else f'{info.channels} channels'}",
    )
    if info.seconds > 3600:
        return replace(row, odd=("longer than an hour: read spans of it; its samples were not looked at",))
    return replace(row, odd=_odd_sound(load_audio(path, sample_rate=None)))


def _odd_sound(audio: Audio) -> tuple[str, ...]:
    """Odd things in samples."""
    peak = float(np.abs(audio.samples).max())
    if peak == 0:
        return ("silent from beginning to end",)
    return (f"amplitudes reach {peak:.3g}; full scale is 1",) if peak > 2 else ()


def _beats(path: Path) -> Finding:
    """The row of a beat annotation."""
    annotation = load_annotation(path)
    track = annotation.track(None if annotation.times.size else 1.0)
    facts = [annotation.dance] if annotation.dance else []
    facts += [] if annotation.bpm is None else [f"{annotation.bpm:.1f} beats a minute"]
    facts += [] if annotation.meter is None else [f"{annotation.meter} beats a bar"]
    facts += [f"{len(annotation.units)} units"] if annotation.units else []
    steps = np.diff(annotation.times)
    odd = ["holds no beats"] if not len(track) else []
    if steps.size and steps.max() > 2.5 * np.median(steps):
        where = annotation.times[int(np.argmax(steps))]
        odd.append(f"no beat for {steps.max():.2f} s after {where:.2f} s, others are {np.median(steps):.2f} s apart")
    return Finding(str(path), "beats", len(track), seconds=track.duration, note=", ".join(facts), odd=tuple(odd))


def _motion(path: Path) -> Finding:
    """The row of a motion; one whose file holds no rate is read with a rate that is not shown."""
    try:
        motion, told = load_any_motion(path), True
    except ValueError as error:
        if "pass fps" not in str(error):
            raise
        motion, told = load_any_motion(path, fps=25.0), False
    row = _motion_row(path, motion)
    if told:
        return row
    return replace(row, rate=None, seconds=None, odd=("holds no frame rate: pass fps", *_shape_oddities(motion)))


def _motion_row(path: Path, motion: Motion) -> Finding:
    """The row that describes a motion."""
    dimensions = motion.positions.shape[2]
    return Finding(
        str(path),
        "motion",
        motion.n_frames,
        motion.fps,
        motion.positions.shape[1],
        motion.duration,
        note=f"{dimensions}-D",
        odd=_odd_motion(motion),
    )


def _sequence(folder: Path) -> Finding:
    """The row of a sequence folder."""
    sequence = load_sequence(folder, sample_rate=None)
    clip, motion = sequence.clip, sequence.clip.motion
    if motion is None:
        raise ValueError(f"{folder}: has no motion")
    facts = [clip.dance or "dance not told", f"{clip.audio.duration:.2f} s of audio"]
    facts += [] if sequence.annotation is None else [f"{sequence.annotation.times.size} beats"]
    facts += [f"{len(sequence.annotation.units)} units"] if sequence.annotation and sequence.annotation.units else []
    odd = [*_odd_span(folder, motion), *_odd_sound(clip.audio), *_odd_motion(motion)]
    beyond = clip.offset + motion.duration - clip.audio.duration
    if beyond > 0.1:
        odd.append(f"the motion ends {beyond:.2f} s after the audio")
    return replace(
        _motion_row(folder, motion), kind="sequence", offset=clip.offset, note=", ".join(facts), odd=tuple(odd)
    )


def _odd_span(folder: Path, motion: Motion) -> list[str]:
    """How the length of a motion differs from its config.json."""
    if not (folder / "config.json").is_file() or (folder / "motion.npz").is_file():
        return []
    span = tang2018.load_config(folder / "config.json")
    short = span.end - span.start - motion.n_frames
    if not short:
        return []
    frames = "1 frame" if abs(short) == 1 else f"{abs(short)} frames"
    return [f"{frames} {'shorter' if short > 0 else 'longer'} than config.json says ({span.end - span.start})"]


def _odd_motion(motion: Motion) -> tuple[str, ...]:
    """Odd things in a motion: filler, unlikely size, frozen stretches, impossible speeds."""
    return (*_shape_oddities(motion), *_frozen(motion), *_too_fast(motion))


def _shape_oddities(motion: Motion) -> list[str]:
    """What is odd whatever the frame rate: frames that are not valid, a body of unlikely size."""
    odd = []
    filler = int((~motion.valid).sum())
    if filler:
        odd.append(f"{filler} of {motion.n_frames} frames are filler (splices, unseen joints)")
    if motion.positions.shape[2] == 3:
        extent = float(np.median(np.ptp(motion.positions, axis=1).max(axis=1)))
        if not _HEIGHTS[0] <= extent <= _HEIGHTS[1]:
            odd.append(f"the body extends over {extent:.3g} m: other units? pass scale")
    return odd


def _frozen(motion: Motion) -> list[str]:
    """Stretches of half a second and more in which no joint moves."""
    size = 1.0 if motion.positions.shape[2] == 3 else float(np.median(np.ptp(motion.positions, axis=1).max(axis=1)))
    still = np.abs(np.diff(motion.positions, axis=0)).max(axis=(1, 2)) <= _STILL_METRES * size
    runs = [(first, last) for first, last in _runs(still) if (last - first) / motion.fps >= FROZEN_SECONDS]
    if not runs:
        return []
    first, last = max(runs, key=lambda run: run[1] - run[0])
    times = "once" if len(runs) == 1 else f"{len(runs)} times"
    return [f"frozen {times}, longest {(last - first) / motion.fps:.2f} s at {first / motion.fps:.2f} s"]


def _runs(mask: BoolArray) -> list[tuple[int, int]]:
    """(first, one behind last) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _too_fast(motion: Motion) -> list[str]:
    """Valid frames in which a joint of a 3-D motion is faster than 10 m/s."""
    if motion.positions.shape[2] != 3:
        return []
    speed = np.linalg.norm(np.diff(motion.positions, axis=0), axis=2) * motion.fps
    speed[~motion.valid[1:]] = 0.0
    count = int((speed.max(axis=1) > MAX_SPEED).sum())
    if not count:
        return []
    frame, joint = np.unravel_index(int(np.argmax(speed)), speed.shape)
    name = motion.skeleton.joints[int(joint)]
    frames = "1 frame" if count == 1 else f"{count} frames"
    when = (int(frame) + 1) / motion.fps
    return [f"faster than {MAX_SPEED:g} m/s in {frames}, up to {speed.max():.1f} m/s ({name}, {when:.2f} s)"]
