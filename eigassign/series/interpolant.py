"""An interpolant of a positive function in Newton's basis: of f, f² or f⁻², and its error."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from functools import lru_cache
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
POWERS = (1.0, 2.0, -2.0)  # of f that are tried, the quickest to evaluate first
SAFETY = 4.0  # on the predicted rest
NEAR = 2.0  # how much better another power must be than one that is quicker to evaluate
ROUNDS = 12  # to an accuracy, at most


class Interpolant(NamedTuple):
    """f^power ≈ Σ_γ c_γ h_γ; ``error`` estimates |δf/f| over the whole box."""

    power: float
    members: Ints  # (N, d)
    coefficients: Floats  # (n_outputs, N)
    sizes: Floats  # (N,): |δf/f| that each member stands for
    rates: Floats  # (d,); 0 on an axis that nothing depends on
    error: float
    rounds: tuple[tuple[int, float], ...] = ()  # members and error after each
    asked: int = 0  # values, checks included


Asking = Generator[Ints, Floats, Interpolant]  # members wanted → values (n, n_outputs) sent


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


def refuse(reached: tuple[int, float], accuracy: float, count: int, most: int) -> NoReturn:
    """Raise AccuracyError: ``reached`` is how many values leave how large an error."""
    done = f"{reached[0]} values leave an estimated error of {reached[1]:.1e}, not {accuracy:.1e}"
    why = f"over {most} are not allowed" if count > most else "more do not help"
    raise AccuracyError(f"{done}, and {why}")
