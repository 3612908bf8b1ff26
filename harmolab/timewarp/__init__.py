"""Retiming by time-warp: a motion's own poses, struck when the music's beats come.

`harmolab.retiming` is the other way to the same end: there joints move a little and time stays.
"""

from __future__ import annotations

from harmolab.timewarp.matching import beat_warp, lee_warp
from harmolab.timewarp.retime import Retimed, retime, warp_video
from harmolab.timewarp.warps import TimeWarp

__all__ = ["Retimed", "TimeWarp", "beat_warp", "lee_warp", "retime", "warp_video"]
