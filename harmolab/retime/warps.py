"""Time-warps: a smooth map of one time line onto another that never stands still and never jumps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from harmolab.types import FloatArray

HALVINGS = 60  # of the interval between two knots: beyond the precision of a double
STEP = 0.01  # seconds between the moments over which `bent` is a mean


@dataclass(frozen=True, eq=False)
class TimeWarp:
    """A map of source times (of the motion as it was) to target times (of the motion as it becomes).

    Between the knots, source time is a monotone cubic (PCHIP) of target time; outside them nothing is shifted.

    Parameters
    ----------
    source, target : (K,) arrays, seconds
        Knots, two or more, strictly increasing, equal at both ends.

    Raises
    ------
    ValueError
        For knots that are too few, not finite, not increasing, or that move an end.

    Examples
    --------
    >>> warp = TimeWarp([0.0, 1.2, 2.0], [0.0, 1.0, 2.0])
    >>> warp([0.0, 1.2, 2.0]).round(6)
    array([0., 1., 2.])
    >>> warp.inverse(1.0)
    array(1.2)
    """

    source: FloatArray
    target: FloatArray

    def __post_init__(self) -> None:
        source, target = _knots(self.source, "source"), _knots(self.target, "target")
        if source.shape != target.shape:
            raise ValueError(f"a warp needs as many source as target knots, got {source.size} and {target.size}")
        if source[0] != target[0] or source[-1] != target[-1]:
            raise ValueError("a warp keeps its ends; the first and the last knot must be equal in source and target")
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "target", target)

    @classmethod
    def identity(cls, duration: float) -> TimeWarp:
        """The warp of [0, duration] that shifts nothing."""
        return cls(np.array([0.0, duration]), np.array([0.0, duration]))

    @property
    def is_identity(self) -> bool:
        """True if nothing is shifted."""
        return bool(np.array_equal(self.source, self.target))

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.target, self.source)

    def inverse(self, times: ArrayLike) -> FloatArray:
        """Source times of target times (any shape), seconds: which moment of the old motion is seen then."""
        moments = np.asarray(times, dtype=np.float64)
        if self.is_identity:
            return moments.copy()
        inside = (moments > self.target[0]) & (moments < self.target[-1])
        curve: FloatArray = self._curve(np.clip(moments, self.target[0], self.target[-1]))
        return np.where(inside, curve, moments)

    def __call__(self, times: ArrayLike) -> FloatArray:
        """Target times of source times (any shape), seconds: when a moment of the old motion is seen now."""
        moments = np.asarray(times, dtype=np.float64)
        place = np.clip(np.searchsorted(self.source, moments, side="right") - 1, 0, self.source.size - 2)
        low, high = self.target[place], self.target[place + 1]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            early = self.inverse(middle) < moments
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        inside = (moments > self.source[0]) & (moments < self.source[-1])
        return np.where(inside & (not self.is_identity), (low + high) / 2, moments)

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest local speed anywhere, source seconds per target second (1 is as before)."""
        if self.is_identity:
            return 1.0, 1.0
        slope = self._curve.derivative()
        bends = slope.derivative().roots(discontinuity=False, extrapolate=False)
        speeds = slope(np.concatenate([self.target, bends[np.isfinite(bends)]]))
        return float(speeds.min()), float(speeds.max())

    def shifts(self) -> FloatArray:
        """Target minus source time at every hundredth second of the target, seconds."""
        times = np.linspace(self.target[0], self.target[-1], max(2, round(np.ptp(self.target) / STEP) + 1))
        return times - self.inverse(times)

    @property
    def bent(self) -> float:
        """Mean absolute shift, seconds."""
        return float(np.abs(self.shifts()).mean())

    def scaled(self, strength: float) -> TimeWarp:
        """The warp with all its shifts times `strength`: 0 is the identity, 1 the warp itself."""
        if not 0 <= strength <= 1:
            raise ValueError(f"strength must lie between 0 and 1, got {strength}")
        return TimeWarp(self.target + strength * (self.source - self.target), self.target)


def _knots(values: ArrayLike, name: str) -> FloatArray:
    """A read-only copy of knots that increase."""
    knots = np.array(values, dtype=np.float64)
    if knots.ndim != 1 or knots.size < 2:
        raise ValueError(f"{name} knots must be a list of two or more times, got shape {knots.shape}")
    if not np.isfinite(knots).all() or (np.diff(knots) <= 0).any():
        raise ValueError(f"{name} knots must be finite and increase strictly")
    knots.setflags(write=False)
    return knots
