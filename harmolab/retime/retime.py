"""Retiming: a motion or a video at other moments, so that its beats come with the music's; no pose is changed."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import tree_order
from harmolab.files import Counted, PathLike, Progress, silent
from harmolab.params import HarmonyParams
from harmolab.readers.video import video_frames, write_video
from harmolab.retime.warps import Method, TimeWarp, beat_warp, moved
from harmolab.score import HarmonyScore
from harmolab.types import Audio, BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import score_motion

Frame = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Retimed:
    """A motion whose time was bent.

    Parameters
    ----------
    motion : Motion
    warp : TimeWarp
        The moment that frame i shows is ``warp.inverse(i / fps)`` of the motion as it was.
    before, after : HarmonyScore, the recommended one, of the motion as it was and as it is
    target_before, target_after : HarmonyScore, by the visual beats that the warp brings to their place in the beat
    """

    motion: Motion
    warp: TimeWarp
    before: HarmonyScore
    after: HarmonyScore
    target_before: HarmonyScore
    target_after: HarmonyScore


def retime(
    motion: Motion,
    music: BeatTrack,
    *,
    strength: float = 1.0,
    phase: float = 0.0,
    slowest: float = 0.7,
    fastest: float = 1.4,
    params: HarmonyParams | None = None,
    score: Callable[[Motion], HarmonyScore] | None = None,
    method: Method = "dp",
) -> Retimed:
    """The motion, slower here and faster there, so that its visual beats meet the music's.

    The first and the last frame stay. Bones that keep their lengths keep them to rounding (`motion_at`). At strength 1
    a second run changes nothing: see `beat_warp` for the definition of in time. It can still bend a stretch where the
    bounds stopped the first run half way, since it has the whole bounds again.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack
        Music beats on the motion's own time line.
    strength, phase, slowest, fastest : float, see `beat_warp`
    params : HarmonyParams, default ``HarmonyParams.valleys()``
        The definition of visual beats and of the distance within which they should come: the target of the warp.
    score : function from Motion to HarmonyScore
        The number before and after; default that of `score_motion` with these beats and the recommended settings.
    method : "dp" or "lee2019", see `beat_warp`

    Returns
    -------
    Retimed; with `motion` itself when nothing is bent.

    Raises
    ------
    ValueError
        For a setting out of range, params with a clock of their own, or a skeleton whose bones form a ring.

    Examples
    --------
    >>> from harmolab.data.synthetic import ClipSettings, planted_clip
    >>> clip = planted_clip(ClipSettings("rumba", seconds=20.0, jitter=0.15)).clip
    >>> retimed = retime(clip.motion, clip.beats)
    >>> retimed.target_after.hit_rate > retimed.target_before.hit_rate
    True
    >>> retimed.after.harmony_above_chance > retimed.before.harmony_above_chance
    True
    """
    params = params or HarmonyParams.valleys()
    if params.clock != 1:
        raise ValueError(f"retiming takes a motion at its own clock; divide its fps by {params.clock} instead")
    beats = music.span(0.0, motion.duration)
    target = partial(score_motion, moved(beats, phase), params=params, n_rotations=0)
    score = score or partial(score_motion, beats)
    before, target_before = score(motion), target(motion)
    visual, last = visual_beats(motion, params=params), (motion.n_frames - 1) / motion.fps
    limits = {"phase": phase, "strength": strength, "slowest": slowest, "fastest": fastest}
    warp = beat_warp(visual, beats, last, params=params, method=method, **limits)
    if warp.is_identity:
        return Retimed(motion, warp, before, before, target_before, target_before)
    bent = motion_at(motion, warp.inverse(np.arange(motion.n_frames) / motion.fps))
    return Retimed(bent, warp, before, score(bent), target_before, target(bent))


def motion_at(motion: Motion, times: FloatArray) -> Motion:
    """The motion's poses at the given times, one a frame.

    Roots follow cubic splines. Bones turn along cubic splines of their direction, and their lengths are interpolated
    linearly, so a bone of constant length keeps it.

    Parameters
    ----------
    motion : Motion of T frames
    times : (T',) array, seconds from the first frame, within 0 and (T - 1) / fps

    Raises
    ------
    ValueError
        When the skeleton's bones form a ring.
    """
    frames = np.clip(times * motion.fps, 0.0, motion.n_frames - 1)
    parents = np.array(motion.skeleton.parents)
    is_root = parents < 0
    parts = np.where(is_root[:, None], motion.positions, motion.positions - motion.positions[:, parents])
    positions = CubicSpline(np.arange(motion.n_frames), parts)(frames)
    positions[:, ~is_root] = _turned(parts[:, ~is_root], positions[:, ~is_root], frames)
    for joint in tree_order(motion.skeleton.parents):
        if not is_root[joint]:
            positions[:, joint] += positions[:, parents[joint]]
    return Motion(positions, motion.fps, motion.skeleton, motion.valid[frames.round().astype(np.int64)])


def _turned(bones: FloatArray, splined: FloatArray, frames: FloatArray) -> FloatArray:
    """The splined bones (T', B, D) with the lengths that the bones (T, B, D) have at those frames."""
    before = np.minimum(frames.astype(np.int64), len(bones) - 2)
    share = (frames - before)[:, None]
    lengths = np.linalg.norm(bones, axis=2)
    expected = lengths[before] + share * (lengths[before + 1] - lengths[before])
    # A bone that flips over passes through a point without direction; the nearest frame then lends its own.
    undirected = np.linalg.norm(splined, axis=2) <= 1e-6 * expected
    directions = np.where(undirected[..., None], bones[frames.round().astype(np.int64)], splined)
    norms = np.linalg.norm(directions, axis=2)
    return directions * (expected / np.where(norms > 0, norms, 1.0))[..., None]


def warped_frames(frames: Iterable[Frame], fps: float, warp: TimeWarp) -> Iterator[Frame]:
    """As many frames as came in: for each moment the frame nearest to it in source time.

    Slow stretches repeat a frame now and then, fast ones leave one out; none is blended. Frames are read once.
    """
    place = 0
    for index, frame in enumerate(frames):
        while float(warp.inverse(place / fps)) * fps <= index + 0.5:
            yield frame
            place += 1


def warp_video(
    path: PathLike, out: PathLike, warp: TimeWarp, audio: Audio | None = None, *,
    height: int = 480, progress: Progress = silent,
) -> None:  # fmt: skip
    """Write a video's frames at warped times, with the song.

    Parameters
    ----------
    path, out : str or path; `out` ends in .mp4 or .webm and appears whole or not at all
    warp : TimeWarp of the video's time line, from `retime` of `picture_motion` of the video
    audio : Audio, optional
        Sound from the first frame on. It is not warped: the frames go to the music.
    height : int, pixels
        A smaller video keeps its size.
    progress : Progress over the frames

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    video = video_frames(path, height=height, colour=True)
    frames = Counted(warped_frames(video, video.fps, warp), round(warp.target[-1] * video.fps) + 1)
    write_video(out, progress(frames, "drawing"), video.fps, audio=audio)
