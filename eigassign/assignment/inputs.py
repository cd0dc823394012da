"""Targets and weights in time, linear models of λ, linear limits; checks of such input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError

Floats = NDArray[np.float64]


def frozen(values: ArrayLike) -> Floats:
    """A float64 copy that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def finite(what: str, values: ArrayLike, ndim: int) -> Floats:
    """A frozen copy of ``values`` with ``ndim`` axes, all finite.

    Raises:
        UsageError: other number of axes, or NaN or infinite at the index named.
    """
    array = frozen(values)
    if array.ndim != ndim:
        raise UsageError(f"{what}: has {array.ndim} axes, {ndim} expected")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        where = tuple(int(i) for i in bad[0])
        raise UsageError(f"{what}: {array[where]} at index {list(where)}; must be finite")
    return array


def trapezoidal_weights(time_s: ArrayLike) -> Floats:
    """Weights (n_t,) in s with ``∫ g dt ≈ weights @ g`` by the trapezoidal rule.

    The weight of sample k is (t_{k+1} − t_{k−1})/2, one-sided at both ends; samples need not be
    evenly spaced. A single sample has weight 1: the integral becomes the value there.

    Raises:
        UsageError: no samples, a time that is not finite, or times that do not increase.
    """
    time = finite("time", time_s, 1)
    if time.size == 0:
        raise UsageError("time: no samples")
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        sample = int(np.argmax(steps <= 0.0)) + 1
        raise UsageError(f"time: sample {sample} is not later than the one before it")
    if time.size == 1:
        return frozen([1.0])
    return frozen(0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)))


def sample_target(
    time_s: ArrayLike, frequency_hz: ArrayLike, knot_time_s: ArrayLike | None = None
) -> Floats:
    """The wanted frequency in Hz at the samples, (n_t,).

    ``frequency_hz`` is one number, held throughout; or values at ``knot_time_s``, between which
    the frequency in Hz runs linearly in time. Nothing is extrapolated.

    Raises:
        UsageError: a frequency that is not positive, knots that do not increase, or knots that do
            not cover the samples.
    """
    time = finite("time", time_s, 1)
    if knot_time_s is None:
        return positive_hz(np.full(time.shape, float(finite("target frequency", frequency_hz, 0))))
    knots = finite("target time", knot_time_s, 1)
    values = positive_hz(frequency_hz)
    if values.size != knots.size:
        given = f"{values.size} given, but there are {knots.size} times"
        raise UsageError(f"target frequency: {given}")
    trapezoidal_weights(knots)
    _require_cover(knots, time)
    return frozen(np.interp(time, knots, values))


def positive_hz(frequency_hz: ArrayLike) -> Floats:
    """A frozen (n,) copy of target frequencies in Hz, finite and above 0, or UsageError."""
    values = finite("target frequency", frequency_hz, 1)
    if np.any(values <= 0.0):
        sample = int(np.argmax(values <= 0.0))
        raise UsageError(f"target frequency: {values[sample]} Hz at {sample}; must be above 0 Hz")
    return values


def _require_cover(knots: Floats, time: Floats) -> None:
    """The trajectory lies within the knots, but for the rounding of a time grid's end."""
    slack = 1e-12 * max(abs(knots[0]), abs(knots[-1]))
    if time.size and (time[0] < knots[0] - slack or time[-1] > knots[-1] + slack):
        raise UsageError(
            f"target time: {knots[0]:g} … {knots[-1]:g} s does not cover the trajectory's "
            f"{time[0]:g} … {time[-1]:g} s"
        )


def lam_from_hz(frequency_hz: ArrayLike) -> Floats:
    """λ = (2π f)² in rad²/s² of frequencies in Hz, same shape."""
    return frozen((2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)) ** 2)


def hz_from_lam(lam: ArrayLike) -> Floats:
    """f = √λ / 2π in Hz of λ in rad²/s², same shape.

    Raises:
        AccuracyError: a negative or non-finite λ. A mechanism has none, so the linear model that
            predicted it was used too far from its expansion point.
    """
    values = np.asarray(lam, dtype=np.float64)
    bad = np.argwhere(~(values >= 0.0) | ~np.isfinite(values))
    if bad.size:
        where = tuple(int(i) for i in bad[0])
        raise AccuracyError(
            f"the linear model predicts λ = {values[where]:.6g} rad²/s² at sample {list(where)}, "
            "which no mechanism has: the design is too far from the expansion point"
        )
    return frozen(np.sqrt(values) / (2.0 * np.pi))


@dataclass(frozen=True)
class LinearModel:
    """λ along the trajectory, λ = l0 + l @ (y − y0).

    ``l0`` (n_t,) in rad²/s²; ``l`` (n_t, n_y) in rad²/s² per SI unit of y.
    """

    l0: Floats
    l: Floats  # noqa: E741 - the paper's symbol

    def __call__(self, dy: Floats) -> Floats:
        """λ (n_t,) at y = y0 + dy."""
        return np.asarray(self.l0 + self.l @ dy)


@dataclass(frozen=True)
class LinearConstraint:
    """lower ≤ coefficients @ y ≤ upper, on y itself (not on y − y0); (n_y,), SI units."""

    name: str
    coefficients: Floats
    lower: float = -np.inf
    upper: float = np.inf

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """Its value at a design y (n_y,), and the slopes (n_y,)."""
        return float(self.coefficients @ y), self.coefficients
