"""Movement in little room: whole millimetres in 16 bits, as second differences in time.

A joint of mass changes its speed little from frame to frame, so the second differences of its places are small numbers,
which a zip file holds in a byte or less. Nothing adds up: the differences are of whole numbers, and 16-bit arithmetic
that wraps round gives every place back to the half millimetre it was rounded by.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.types import FloatArray

UNITS = 1000.0  # in a metre
FARTHEST = 32.0  # metres from the origin that 16 bits reach


def packed(positions: ArrayLike) -> NDArray[np.int16]:
    """Positions (T, J, D), metres, as (J * D, T) second differences of millimetres.

    Raises
    ------
    ValueError
        For a joint that is farther from the origin than 16 bits reach.

    >>> packed([[[0.0]], [[0.01]], [[0.0204]]])
    array([[0, 10, 0]], dtype=int16)
    """
    places = np.asarray(positions, dtype=np.float64)
    if (reached := np.abs(places).max(initial=0.0)) > FARTHEST:
        raise ValueError(f"a joint is {reached:.1f} m from the origin, {FARTHEST:g} m at most can be kept; centre it")
    whole = np.rint(places * UNITS).astype(np.int16).reshape(len(places), -1).T
    return np.diff(whole, n=2, axis=1, prepend=np.zeros((len(whole), 2), np.int16))


def unpacked(differences: NDArray[np.int16], joints: int) -> FloatArray:
    """Positions (T, J, D), metres, of what `packed` gave; each number is off by half a millimetre at most."""
    speeds = np.cumsum(differences, axis=1, dtype=np.int16)
    whole = np.cumsum(speeds, axis=1, dtype=np.int16)
    return whole.T.reshape(whole.shape[1], joints, -1) / UNITS
