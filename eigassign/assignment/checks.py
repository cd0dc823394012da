"""Refuse what is not a number before any solver sees it, and freeze what passed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError

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
    array = shaped(what, values, ndim)
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        where = tuple(int(i) for i in bad[0])
        raise UsageError(f"{what}: {array[where]} at index {list(where)}; must be finite")
    return array


def positive(what: str, values: ArrayLike) -> Floats:
    """A frozen copy (n,) of ``values``, at least one, all finite and above 0, or UsageError."""
    array = finite(what, values, 1)
    if not array.size or np.any(array <= 0.0):
        given = f"{array.min()}" if array.size else "none"
        raise UsageError(f"{what}: {given} given; must be above 0")
    return array


def limit(what: str, values: ArrayLike, ndim: int) -> Floats:
    """A frozen copy of ``values``: infinite means "no limit", NaN is refused."""
    array = shaped(what, values, ndim)
    if np.isnan(array).any():
        raise UsageError(f"{what}: not a number; write an infinity for no limit")
    return array


def shaped(what: str, values: ArrayLike, ndim: int) -> Floats:
    """A frozen copy of ``values`` with ``ndim`` axes, or UsageError."""
    array = frozen(values)
    if array.ndim != ndim:
        raise UsageError(f"{what}: has {array.ndim} axes, {ndim} expected")
    return array


def same_length(what: str, length: int, expected: int, of: str) -> None:
    """UsageError unless ``length == expected``, the number of ``of``."""
    if length != expected:
        raise UsageError(f"{what}: {length} given, but there are {expected} {of}")
