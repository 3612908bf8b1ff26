"""Principal components of the points (Sec. 3.4), steps between the frames, and the delay from sound to movement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from harmolab.types import FloatArray

LEAST_SCALE = 1e-6
A = TypeVar("A", bound=np.generic)


@dataclass(frozen=True, eq=False)
class PointSpace:
    """Points as a few numbers: the mean, and the directions of most variance.

    Parameters
    ----------
    mean : (2 P,) array
    basis : (n, 2 P) array, orthonormal rows; the largest entry of each is positive
    scale : (n,) array, what a component is divided by
    """

    mean: FloatArray
    basis: FloatArray
    scale: FloatArray

    @classmethod
    def fit(cls, frames: FloatArray, components: float, *, even_scale: bool = True) -> PointSpace:
        """The space of frames (F, 2 P): so many components, or as many as hold a share (below 1) of the variance.

        Parameters
        ----------
        frames : accepted frames of the training recordings
        components : number, or share of the variance
        even_scale : one scale for all, the largest standard deviation; else each component's own

        Raises
        ------
        ValueError
            For fewer than two frames.
        """
        if len(frames) < 2:
            raise ValueError(f"principal components need two frames or more, got {len(frames)}")
        mean = frames.mean(axis=0)
        centred = frames - mean
        variances, vectors = np.linalg.eigh(centred.T @ centred / len(frames))
        variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1].T
        count = _count(variances, components)
        basis = vectors[:count]
        largest = np.abs(basis).argmax(axis=1)
        basis = basis * np.sign(basis[np.arange(count), largest])[:, None]
        deviations = np.sqrt(variances[:count])
        scale = np.full(count, deviations.max()) if even_scale else deviations
        return cls(mean, basis, np.maximum(scale, LEAST_SCALE))

    def encode(self, frames: FloatArray) -> FloatArray:
        """Components (..., n), scaled, of frames (..., 2 P)."""
        components: FloatArray = (frames - self.mean) @ self.basis.T / self.scale
        return components

    def decode(self, components: FloatArray) -> FloatArray:
        """Frames (..., 2 P) of scaled components (..., n)."""
        frames: FloatArray = (components * self.scale) @ self.basis + self.mean
        return frames


def _count(variances: FloatArray, components: float) -> int:
    """Number of components to keep of those that there are."""
    if components >= 1:
        return min(int(components), len(variances))
    shares = np.cumsum(variances) / max(float(variances.sum()), 1e-30)
    return min(int(np.searchsorted(shares, components - 1e-12)) + 1, len(variances))


def steps_of(values: NDArray[A], upsample: int) -> NDArray[A]:
    """Frames (T, C) as steps, straight lines between them: (upsample (T - 1) + 1, C)."""
    after = np.concatenate([values[1:], values[-1:]])
    shares = (np.arange(upsample) / upsample).astype(values.dtype)[None, :, None]
    between: NDArray[A] = values[:, None] * (1 - shares) + after[:, None] * shares
    return between.reshape(-1, values.shape[1])[: upsample * (len(values) - 1) + 1]


def later(values: NDArray[A], delay: int) -> NDArray[A]:
    """Targets (S, C) moved `delay` steps later, zeros before them: (S + delay, C). The first ones count for nothing."""
    return np.concatenate([np.zeros((delay, *values.shape[1:]), values.dtype), values])


def continued(values: NDArray[A], delay: int) -> NDArray[A]:
    """Sound (S, F) with its last step held for `delay` more: (S + delay, F), so that no pose is lost."""
    return np.concatenate([values, np.repeat(values[-1:], delay, axis=0)])


def frames_of(steps: NDArray[A], upsample: int, delay: int) -> NDArray[A]:
    """Predicted steps (S + delay, C) back as frames (T, C): every `upsample`-th, from the one after the delay."""
    return steps[delay::upsample]
