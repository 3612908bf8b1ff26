"""Small things that many tests build: beats, bodies, dances to planted music, a call of the command line."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile
from numpy.typing import ArrayLike
from typer import Typer
from typer.testing import CliRunner, Result

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.files import write_json
from harmolab.musician.performances import ABOUT, MOTION, NOTES, Performance
from harmolab.readers.audio import save_audio
from harmolab.readers.motion import save_motion
from harmolab.systems.training.units import DanceUnit, temporal_index
from harmolab.types import BeatTrack, Clip, Motion

Places = Sequence[int] | None  # of beats, in their bars
ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))


def track(
    times: ArrayLike,
    strengths: ArrayLike | None = None,
    *,
    fps: float = 100.0,
    duration: float = 10.0,
    bar_places: Places = None,
) -> BeatTrack:
    """Beats at these seconds, all of strength 1 unless strengths are given."""
    times = np.asarray(times, float)
    return BeatTrack(times, np.ones(times.size) if strengths is None else strengths, fps, duration, bar_places)


def metronome(
    strengths: ArrayLike, *, period: float = 0.5, first: float = 0.0, duration: float = 60.0, bar_places: Places = None
) -> BeatTrack:
    """Beats of these strengths, one every `period` seconds from `first` on."""
    times = first + period * np.arange(np.size(strengths))
    return track(times, strengths, duration=duration, bar_places=bar_places)


def along_x(x: ArrayLike, *, fps: float) -> Motion:
    """One joint that is at these places (m) on the x axis, one a frame."""
    positions = np.zeros((np.size(x), 1, 3))
    positions[:, 0, 0] = x
    return Motion(positions, fps, Skeleton.unnamed(1))


def still(frames: int, *, fps: float, joints: int = 2, axes: int = 3) -> Motion:
    """Joints that rest at the origin, but for the second, a metre above it."""
    positions = np.zeros((frames, joints, axes))
    positions[:, 1:2, 1] = 1.0
    return Motion(positions, fps, Skeleton.unnamed(joints))


BODY = np.array([[0, 0.9, 0], [0, 1.4, 0], [0.5, 1.3, 0.1], [-0.5, 1.3, 0], [0.1, 0, 0], [-0.1, 0, 0.1]])


def waving(phase: np.ndarray, *, fps: float = 30.0) -> Motion:
    """A body whose hands go up and down once in two units of the phase: at rest at whole ones, fastest between."""
    positions = np.repeat(BODY[None], phase.size, axis=0)
    positions[:, 2:4, 1] += 0.3 * np.cos(np.pi * phase)[:, None]
    return Motion(positions, fps, Skeleton.unnamed(len(BODY)))


def bone_lengths(motion: Motion) -> np.ndarray:
    """(T, bones) lengths, in the motion's unit."""
    ends = [motion.positions[:, child] - motion.positions[:, parent] for parent, child in motion.skeleton.bones]
    return np.linalg.norm(np.stack(ends, axis=1), axis=2)


@cache
def planted_dance(dance: str = "cha-cha", *, seconds: float = 6.0, fps: float = 60.0, seed: int = 1) -> Clip:
    """The same synthetic clip for every test that asks for it: an exact dancer to beats that are known."""
    return synthetic_clip(dance, seconds=seconds, fps=fps, seed=seed)


def write_song(path: Path, clip: Clip) -> Path:
    """The file, which then holds the clip's music."""
    soundfile.write(path, clip.audio.samples, round(clip.audio.sample_rate))
    return path


def write_dance(path: Path, clip: Clip) -> Path:
    """The file, which then holds the clip's movement."""
    assert clip.motion is not None
    save_motion(path, clip.motion)
    return path


def save_performance(folder: Path, performance: Performance) -> None:
    """A performance as a folder that `load_performance` reads back to the last bit, but for its sound of 16 bits."""
    folder.mkdir()
    if performance.audio is not None:
        save_audio(folder / "audio.wav", performance.audio)
    save_motion(folder / MOTION, performance.motion, offset=performance.offset, detected=performance.detected)
    if performance.notes is not None:
        own, hands = performance.notes, {-1: "", 0: "left", 1: "right"}
        arrays = (own.onsets, own.offsets, own.pitches, own.loudness)
        rows = zip(*(array.tolist() for array in arrays), [hands[hand] for hand in own.hands.tolist()], strict=True)
        lines = [",".join(map(str, row)) for row in rows]
        (folder / NOTES).write_text("\n".join(["onset_s,offset_s,midi,loudness,hand", *lines]) + "\n")
    fields = ("name", "instrument", "piece", "rendered", "source")
    write_json(folder / ABOUT, {name: getattr(performance, name) for name in fields})


def bobbing(first_rest: float, *, size: float = 0.2, fps: float = 15.0, seconds: float = 4.0) -> Motion:
    """One joint that rests at `first_rest` and every half second after."""
    heights = 1.0 + size * np.cos(2 * np.pi * (np.arange(round(seconds * fps)) / fps - first_rest))
    return Motion(heights[:, None, None] * np.array([0.0, 1.0, 0.0]), fps, Skeleton(("joint",), (-1,)))


def called(app: Typer, *arguments: object) -> Result:
    """Exit code and output of a command with these arguments."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(message: str, call: Callable[..., object], /, *arguments: Any, **options: Any) -> None:
    """Passes where the call ends in a ValueError whose text has this pattern in it."""
    with pytest.raises(ValueError, match=message):
        call(*arguments, **options)


def missing(message: str, call: Callable[..., object], /, *arguments: Any, **options: Any) -> None:
    """Passes where the call ends in a FileNotFoundError whose text has this pattern in it."""
    with pytest.raises(FileNotFoundError, match=message):
        call(*arguments, **options)


def cases(names: str, *rows: object, **options: Any) -> pytest.MarkDecorator:
    """A test that is run once a row, its arguments these names: `pytest.mark.parametrize` of a written-out table."""
    return pytest.mark.parametrize(names, rows, **options)


def done(app: Typer, *arguments: object) -> Result:
    """Exit code and output of a command that succeeds."""
    result = called(app, *arguments)
    assert result.exit_code == 0, result.output
    return result


def complaint(app: Typer, *arguments: object) -> str:
    """The one line that a command prints which cannot be done, beside its notes."""
    result = called(app, *arguments, "--quiet")
    assert (result.exit_code, result.stdout, len(result.stderr.splitlines())) == (2, "", 1), result.output
    return result.stderr.removeprefix("harmolab: ").rstrip("\n")


def dance_unit(name: str, motion: np.ndarray, n_prior: int, **fields: Any) -> DanceUnit:
    """A unit of a waltz with this code (T, C), of which so many frames come before its meter; silent, without beats."""
    none, frames = frozenset[str](), len(motion)
    made = {"sequence": "s", "dance": "waltz", "groups": none, "meter_groups": none, "start": 0.0, "fps": 15.0}
    arrays = {"audio": np.zeros((frames, 1), np.float32), "beats": np.zeros(0), "strengths": np.zeros(0)}
    return DanceUnit(name=name, motion=motion, index=temporal_index(frames, n_prior), **made | arrays | fields)


def write_late_pictures(path: Path, film: Path, seconds: float) -> None:
    """A film with the same sound, whose pictures come `seconds` later."""
    with av.open(str(film)) as early, av.open(str(path), "w") as late:
        streams = [late.add_stream_from_template(stream) for stream in early.streams]
        for packet in filter(lambda each: each.dts is not None, early.demux()):
            later = round(seconds / packet.time_base) if packet.stream.type == "video" else 0
            packet.pts, packet.dts, packet.stream = packet.pts + later, packet.dts + later, streams[packet.stream.index]
            late.mux(packet)


def write_pair(folder: Path, clip: Clip) -> tuple[Path, Path, str, Path]:
    """The clip's song, its dance, and the option with the song's beats, so that none need be tracked."""
    assert clip.beats is not None
    beats = folder / "song.beats"
    beats.write_text("".join(f"{time:.4f}\n" for time in clip.beats.times))
    return write_song(folder / "song.wav", clip), write_dance(folder / "dance.npz", clip), "--beats", beats
