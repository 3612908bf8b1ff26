"""Borders between generated pieces: the end of one fades into the next, nothing jumps."""

from __future__ import annotations

import numpy as np

from harmolab.types import FloatArray

FADE = 0.25  # seconds after which a tenth of a difference is left
# Solution of (1 + a) exp(-a) = 0.1: a critically damped fade has then come down to a tenth.
_TENTH = 3.8897


def continued(past: FloatArray, new: FloatArray, fps: float, *, fade: float = FADE) -> FloatArray:
    """The piece `new` changed so that it goes on from the end of `past` without a jump in place or velocity.

    The difference in place and velocity at the border is carried into the new piece and fades like a critically damped
    spring ("inertialisation", Bollo 2018). A cross-fade would need both pieces at the same time, and slows or speeds
    the movement up at the border, which lies on a beat.

    Parameters
    ----------
    past : (P, C) array, at least one frame
    new : (T, C) array, the frames that follow
    fps : float, hertz
    fade : float, seconds
        After this a tenth of the difference in place is left.

    Returns
    -------
    (T, C) array
    """
    before = 2 * new[0] - new[1] if len(new) > 1 else new[0]  # where the new piece would have come from
    off = past[-1] - before
    faster = (past[-1] - past[-2]) - (new[0] - before) if len(past) > 1 else np.zeros_like(off)
    rate = _TENTH / (fade * fps)
    steps = np.arange(1, len(new) + 1)[:, None]
    return new + (off + (faster + rate * off) * steps) * np.exp(-rate * steps)
