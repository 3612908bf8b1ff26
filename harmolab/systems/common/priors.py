"""Temporal index TI and initial poses V_f: the generator's input from the meter before (paper Sec. 4.1, Eq. 23)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def temporal_index(n_frames: int, n_prior: int) -> NDArray[np.float32]:
    """TI: 1 where a frame belongs to the last meter, 0 where it belongs to this one; (T,) array.

    Parameters
    ----------
    n_frames : int, frames T of the unit
    n_prior : int, number of them, at its start, that belong to the last meter

    Raises
    ------
    ValueError
        Unless 0 <= n_prior <= n_frames.

    Examples
    --------
    >>> temporal_index(5, 2)
    array([1., 1., 0., 0., 0.], dtype=float32)
    """
    if not 0 <= n_prior <= n_frames:
        raise ValueError(f"n_prior must lie between 0 and n_frames ({n_frames}), got {n_prior}")
    return (np.arange(n_frames) < n_prior).astype(np.float32)


def initial_poses(motion_code: NDArray[np.float32], index: NDArray[np.float32]) -> NDArray[np.float32]:
    """V_f: the motion where TI is 1, and its mean over those frames everywhere else (paper Eq. 23).

    Parameters
    ----------
    motion_code : (T, C) array, V
        Frames with TI 0 are not read; they may hold any finite numbers.
    index : (T,) array of 0 and 1, TI

    Returns
    -------
    (T, C) array, single precision

    Raises
    ------
    ValueError
        If no frame belongs to the last meter, or the lengths differ.
    """
    prior = np.asarray(index) > 0.5
    if prior.shape != (len(motion_code),):
        raise ValueError(f"index must have one entry per frame ({len(motion_code)}), got shape {prior.shape}")
    if not prior.any():
        raise ValueError("index is 0 everywhere: without a frame of the last meter there is no initial pose (Eq. 23)")
    mean = motion_code[prior].mean(axis=0, dtype=np.float64)
    return np.where(prior[:, None], motion_code, mean).astype(np.float32)
