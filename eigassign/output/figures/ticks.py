"""Axis limits and tick labels that say what they mean at every magnitude.

Chosen here and not by matplotlib: the labels' lengths are known before anything is drawn, so
no layout pass is needed, and no number hides behind an offset in a corner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_SAME = 1e-6  # a relative spread below this is drawn as a level line, not as enlarged round-off
_NOTHING = -10  # the decade that a logarithmic axis of zeros ends at
_DECADES = 5  # a logarithmic axis shows no more: the rest is as good as nothing


@dataclass(frozen=True)
class Scale:
    """Limits of an axis, its ticks, and the power of ten taken out of the labels."""

    low: float
    high: float
    positions: tuple[float, ...]
    labels: tuple[str, ...]
    exponent: int = 0
    logarithmic: bool = False

    def fraction(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where values lie between ``low`` (0) and ``high`` (1); no less than 0 on a log scale."""
        if not self.logarithmic:
            return np.asarray((values - self.low) / (self.high - self.low))
        decades = np.log10(np.maximum(values, self.low) / self.low)
        return np.asarray(decades / np.log10(self.high / self.low))

    def unit(self, unit: str) -> str:
        """``unit`` with the power of ten that the labels leave out."""
        if self.exponent == 0:
            return unit
        return f"{power_of_ten(self.exponent)} {unit}".rstrip()


def power_of_ten(exponent: int) -> str:
    """``10³``."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def linear(values: Sequence[NDArray[np.float64]], *, count: int = 5, margin: float = 0.05) -> Scale:
    """A scale that holds all finite ``values`` with at most ``count`` + 1 round ticks."""
    low, high = _spread(*bounds(values))
    return between(low - margin * (high - low), high + margin * (high - low), count=count)


def between(low: float, high: float, *, count: int = 5) -> Scale:
    """The scale from ``low`` to ``high`` with round ticks inside."""
    step = _round_step((high - low) / count)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return _numbered(low, high, step, range(first, last + 1))


def levels(values: Sequence[NDArray[np.float64]], *, count: int = 6) -> Scale:
    """Round levels whose first and last enclose all finite ``values``: for contour bands."""
    low, high = _spread(*bounds(values))
    step = _round_step((high - low) / count)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return _numbered(first * step, last * step, step, range(first, last + 1))


def _numbered(low: float, high: float, step: float, numbers: range) -> Scale:
    exponent = _exponent(max(abs(low), abs(high)))
    decimals = max(0, exponent - _last_digit(step))
    labels = tuple(_plain(n * step / 10.0**exponent, decimals) for n in numbers)
    return Scale(low, high, tuple(n * step for n in numbers), labels, exponent)


def logarithmic(values: Sequence[NDArray[np.float64]]) -> Scale:
    """Whole decades that hold the largest of ``values`` >= 0 and up to 5 below it.

    What is smaller is drawn at the lowest decade, whose label then says so.
    """
    every = _finite(values)
    found = every[every > 0.0]
    top = math.ceil(math.log10(found.max()) + 0.02) if found.size else _NOTHING
    bottom = math.floor(math.log10(np.quantile(found, 0.02))) if found.size else top - 1
    bottom = max(min(bottom, top - 1), top - _DECADES)
    positions = tuple(10.0**decade for decade in range(bottom, top + 1))
    labels = [f"{10.0**d:g}" if -4 <= d <= 4 else power_of_ten(d) for d in range(bottom, top + 1)]
    if np.any(every < positions[0]):
        labels[0] = "≤" + labels[0]
    return Scale(positions[0], positions[-1], positions, tuple(labels), logarithmic=True)


def bounds(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Smallest and largest of all finite ``values``; 0 and 1 if there are none."""
    found = _finite(values)
    return (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)


def _finite(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    found = np.concatenate([np.ravel(v) for v in values] or [np.zeros(0)])
    return np.asarray(found[np.isfinite(found)])


def _spread(low: float, high: float) -> tuple[float, float]:
    size = max(abs(low), abs(high))
    if high - low > _SAME * size:
        return low, high
    middle, half = (low + high) / 2.0, 0.02 * size or 0.5
    return middle - half, middle + half


def _round_step(raw: float) -> float:
    decade = 10.0 ** math.floor(math.log10(raw))
    return next(f * decade for f in (1.0, 2.0, 2.5, 5.0, 10.0) if f * decade >= raw * (1 - 1e-9))


def _last_digit(step: float) -> int:
    """Power of ten of the last digit that multiples of ``step`` need."""
    digits = f"{step:.1e}"
    return int(digits.split("e")[1]) - (digits[2] != "0")


def _exponent(size: float) -> int:
    if 1e-2 <= size < 1e5:
        return 0
    return 3 * math.floor(math.log10(size) / 3.0)


def _plain(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text.replace("-", "\N{MINUS SIGN}")
