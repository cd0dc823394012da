"""An interpolant of a positive function in Newton's basis: of f, f² or f⁻², and its error.

On a single axis the error is told from the coefficients alone: the first that is missing is about

    |c_N| ≈ max_k |c_{N−k}| r^k ,

over the last few but the constant, for several in turn may be small by accident; r is the factor by
which they fall from one degree to the next, not trusted to be small while few have been seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.series.margin import UNKNOWN, decay

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
POWERS = (1.0, 2.0, -2.0)  # of f that are tried, the quickest to evaluate first
SAFETY = 4.0  # on the predicted rest
TRUSTED_LINE = 6  # degree from which the rate on a single axis is believed
LAST = 4  # coefficients looked at on a single axis
NEAR = 2.0  # how much better another power must be than one that is quicker to evaluate


@dataclass(frozen=True, eq=False)
class Interpolant:
    """f^power ≈ Σ_γ c_γ h_γ; ``error`` estimates |δf/f| over the whole box."""

    power: float
    members: Ints  # (N, d)
    coefficients: Floats  # (n_outputs, N)
    sizes: Floats  # (N,): |δf/f| that each member stands for
    rates: Floats  # (d,); 0 on an axis that nothing depends on
    error: float
    rounds: tuple[tuple[int, float], ...] = ()  # members and error after each
    asked: int = 0  # values, checks included


def powers_of(values: Floats) -> Floats:
    """All `POWERS` of values (n, n_outputs), (n, n_powers · n_outputs)."""
    squares = values * values
    return np.concatenate((values, squares, 1.0 / squares), axis=1)


def sizes_of(c: Floats, smallest: Floats) -> Floats:
    """|δf/f| (n_powers, N) that coefficients (N, n_powers · n_outputs) of f^p stand for.

    δ(f^p) = p f^p δf/f, where f^p is ``smallest`` (n_powers · n_outputs,).
    """
    each = len(smallest) // len(POWERS)
    sizes = np.abs(c.T)
    sizes /= (smallest * _orders(each))[:, None]
    return sizes if each == 1 else np.asarray(sizes.reshape(len(POWERS), each, -1).max(axis=1))


@lru_cache(maxsize=64)
def _orders(each: int) -> Floats:
    """|p|, each so many times."""
    return np.repeat(np.abs(POWERS), each)


def nearly_best(errors: Sequence[float]) -> int:
    """Of the powers the one with the least error; a quicker one if it is nearly as good."""
    bound = NEAR * min(errors)
    return next(k for k, error in enumerate(errors) if error <= bound)


def tail(rate: float) -> float:
    """From the first missing coefficients to the sum over all, with the safety."""
    return SAFETY / (1.0 - rate)


def on_line(members: Ints, c: Floats, smallest: Floats, ended: bool, asked: int = 0) -> Interpolant:
    """The best power on a single axis; nothing is missing where that ``ended``."""
    sizes = sizes_of(c, smallest)
    layers: list[list[float]] = sizes.tolist()
    rates = [decay(each) for each in layers]
    errors = [0.0 if ended else _rest(*pair) for pair in zip(layers, rates, strict=True)]
    k = nearly_best(errors)
    own = c.T.reshape(len(POWERS), -1, len(c))[k]
    rate = np.array(rates[k : k + 1])
    done = ((len(c), errors[k]),)
    return Interpolant(POWERS[k], members, own, sizes[k], rate, errors[k], done, asked)


def _rest(sizes: Sequence[float], rate: float) -> float:
    """Estimated Σ |c_k| over all k that are missing."""
    if 0.0 < rate < UNKNOWN and len(sizes) <= TRUSTED_LINE:
        rate = UNKNOWN
    largest, factor = 0.0, 1.0
    for size in sizes[: max(0, len(sizes) - LAST - 1) : -1]:  # the constant shows no rate
        factor *= rate
        largest = max(largest, size * factor)
    return largest * tail(rate)
