"""Similarities of the plane: scaled, turned, shifted. They bring the points of camera shots to one place and size."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from harmolab.types import FloatArray

ROUNDING = 1e-12  # part of a square below which there is nothing but rounding


@dataclass(frozen=True, eq=False)
class Similarity:
    """A similarity of the plane: scaled, turned, then shifted; never mirrored.

    Parameters
    ----------
    scale : float, positive
    rotation : float, radians, from +x towards +y: clockwise in a picture, whose y points down
    shift : (2,) array, units of the result

    Examples
    --------
    >>> Similarity(2.0, np.pi / 2, np.array([1.0, 0.0])).apply(np.array([3.0, 0.0])).round(9)
    array([1., 6.])
    """

    scale: float
    rotation: float
    shift: FloatArray

    def __post_init__(self) -> None:
        shift = np.array(self.shift, dtype=np.float64)
        shift.setflags(write=False)
        object.__setattr__(self, "shift", shift)

    def apply(self, points: FloatArray) -> FloatArray:
        """`points` (..., 2) after the similarity."""
        cosine, sine = self.scale * np.cos(self.rotation), self.scale * np.sin(self.rotation)
        return points @ np.array([[cosine, sine], [-sine, cosine]]) + self.shift

    def inverse(self) -> "Similarity":
        """The similarity that undoes this one."""
        back = Similarity(1 / self.scale, -self.rotation, np.zeros(2))
        return replace(back, shift=-back.apply(self.shift))


def fit_similarity(points: FloatArray, target: FloatArray) -> Similarity:
    """The similarity that brings `points` closest to `target`: least squares, no reflection (Umeyama 1991).

    Parameters
    ----------
    points, target : (N, 2) arrays, two points or more

    Raises
    ------
    ValueError
        For other shapes, NaN, or points or a target that lie in one place.
    """
    factor, shift = similarity_factors(points, target)
    return Similarity(float(np.abs(factor)), float(np.angle(factor)), np.array([shift.real, shift.imag]))


def similarity_factors(points: FloatArray, target: FloatArray) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """`fit_similarity` as complex numbers: x + iy goes to factor (x + iy) + shift, for any number of sets at once.

    Parameters
    ----------
    points, target : (..., N, 2) arrays

    Returns
    -------
    factor, shift : (...) arrays, complex; the factor is scale exp(i rotation)
    """
    _check_points(points, target)
    shares = np.full(points.shape[-2], 1 / points.shape[-2])
    old, new = (array[..., 0] + 1j * array[..., 1] for array in (points, target))
    centre, new_centre = old @ shares, new @ shares
    old, new = old - centre[..., None], new - new_centre[..., None]
    spread, new_spread = (np.square(np.abs(array)) @ shares for array in (old, new))
    for name, size, array in (("points", spread, points), ("target", new_spread, target)):
        if (size <= (ROUNDING * np.abs(array).max()) ** 2).any():
            raise ValueError(f"the {name} lie in one place: no scale or rotation can be fitted; leave that frame out")
    factor = (np.conj(old) * new) @ shares / spread
    if (np.abs(factor) ** 2 * spread <= ROUNDING * new_spread).any():
        raise ValueError("points and target have no similar shape: the best scale is 0; are the points mirrored?")
    return factor, new_centre - factor * centre


def _check_points(points: FloatArray, target: FloatArray) -> None:
    """ValueError for what no similarity can be fitted to."""
    if points.ndim < 2 or points.shape[-1] != 2 or target.shape[-2:] != points.shape[-2:]:
        raise ValueError(f"points and target must be equal lists of x and y, got {points.shape} and {target.shape}")
    if not (np.isfinite(points).all() and np.isfinite(target).all()):
        raise ValueError("points or target hold NaN or infinity; leave those points out")
