"""Brings a motion's beats to the music's by bending time: no pose is changed, only the moment it is struck."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.harmony import score_motion
from harmolab.params import HarmonyParams
from harmolab.timewarp.beats import Method, beat_warp
from harmolab.timewarp.resampling import motion_at
from harmolab.timewarp.warps import TimeWarp
from harmolab.types import BeatTrack, HarmonyScore, Motion

__all__ = ["Retimed", "retime"]


@dataclass(frozen=True, eq=False)
class Retimed:
    """A motion whose time was bent.

    Parameters
    ----------
    motion : Motion
    warp : TimeWarp
        The moment that frame i shows is ``warp.inverse(i / fps)`` of the motion as it was.
    before, after : HarmonyScore, of the motion as it was and as it is
    """

    motion: Motion
    warp: TimeWarp
    before: HarmonyScore
    after: HarmonyScore


def retime(
    motion: Motion,
    music: BeatTrack,
    *,
    strength: float = 1.0,
    phase: float = 0.0,
    slowest: float = 0.7,
    fastest: float = 1.4,
    params: HarmonyParams | None = None,
    method: Method = "dp",
) -> Retimed:
    """The motion, slower here and faster there, so that its visual beats meet the music's.

    The first and the last frame stay. Bones that keep their lengths keep them to rounding (`motion_at`). At strength 1
    a second run changes nothing: see `beat_warp` for what counts as in time. It can still find something where the
    bounds stopped the first run in the middle of a bad stretch, since it has the whole bounds again.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack
        Music beats on the motion's own time line.
    strength, phase, slowest, fastest : float, see `beat_warp`
    params : HarmonyParams, default ``HarmonyParams.valleys()``
        What a visual beat is, and the score before and after.
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
    >>> retimed.after.harmony_above_chance > retimed.before.harmony_above_chance
    True
    """
    chosen = params or HarmonyParams.valleys()
    if chosen.clock != 1:
        raise ValueError(f"retiming takes a motion at its own clock; divide its fps by {chosen.clock} instead")
    heard = music.span(0.0, motion.duration)
    before = score_motion(heard, motion, params=chosen, n_rotations=0)
    visual, last = visual_beats(motion, params=chosen), (motion.n_frames - 1) / motion.fps
    warp = beat_warp(
        visual, heard, last,
        phase=phase, strength=strength, slowest=slowest, fastest=fastest, params=chosen, method=method,
    )  # fmt: skip
    if warp.is_identity:
        return Retimed(motion, warp, before, before)
    bent = motion_at(motion, warp.inverse(np.arange(motion.n_frames) / motion.fps))
    return Retimed(bent, warp, before, score_motion(heard, bent, params=chosen, n_rotations=0))
