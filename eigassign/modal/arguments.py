"""What callers give, checked: samples of (q, y), modes, orders and gaps; and limits on sizes.

Errors name the argument. Samples are worked through in chunks that stay in the processor's cache,
and dense algebra gives way to sparse at one size for the exact solve and the expansion alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from operator import index
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats, Ints
from eigassign.errors import UsageError


def samples(q: ArrayLike, y: ArrayLike, n_q: int, n_y: int) -> Floats:
    """x = (q, y) as (n_samples, n_q + n_y); one sample may be given flat and is broadcast."""
    rows = [_rows(q, n_q, "q"), _rows(y, n_y, "y")]
    counts = {len(r) for r in rows if len(r) != 1}
    if len(counts) > 1:
        raise UsageError(f"{len(rows[0])} samples of q against {len(rows[1])} of y")
    n = counts.pop() if counts else 1
    wide = [r if len(r) == n else np.broadcast_to(r, (n, r.shape[1])) for r in rows]
    return np.concatenate(wide, axis=1)


def point(q: ArrayLike, y: ArrayLike, n_q: int, n_y: int) -> Floats:
    """One point x = (q, y) as (n_q + n_y,); raises UsageError for several."""
    x = samples(q, y, n_q, n_y)
    if len(x) != 1:
        raise UsageError(f"{len(x)} samples of q and y; one point is expected")
    return np.asarray(x[0])


def _rows(values: ArrayLike, width: int, name: str) -> Floats:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be real numbers, every sample with as many") from error
    if array.ndim > 2 or (array.ndim == 2 and array.shape[1] != width):
        raise UsageError(f"{name} has shape {array.shape}; expected (n_samples, {width})")
    if array.ndim < 2 and array.size != width:
        raise UsageError(f"{name} has {array.size} values; expected {width}")
    if not np.isfinite(array).all():
        raise UsageError(f"{name} must be finite")
    return array.reshape(-1, width) if width else np.zeros((max(1, len(np.atleast_2d(array))), 0))


# --- Modes, orders and counts


def whole(value: object, name: str) -> int:
    """An integer of Python or NumPy; raises UsageError for all else, True and 4.0 included."""
    if isinstance(value, bool | np.bool_):
        raise UsageError(f"{name} must be a whole number, not {value!r}")
    try:
        return index(value)  # type: ignore[arg-type]
    except TypeError as error:
        raise UsageError(f"{name} must be a whole number, not {value!r}") from error


def whole_within(value: object, name: str, low: int, high: int) -> int:
    """An integer of ``low`` to ``high``."""
    number = whole(value, name)
    if not low <= number <= high:
        raise UsageError(f"{name} {number} is not within {low} to {high}")
    return number


def mode_numbers(modes: Sequence[int]) -> tuple[int, ...]:
    """Modes in ascending order; raises UsageError for none, for one twice, or for one below 1."""
    try:
        given = [whole(m, "a mode") for m in modes]
    except TypeError as error:
        raise UsageError(f"modes must be a sequence of whole numbers, not {modes!r}") from error
    twice = [m for m, count in Counter(given).items() if count > 1]
    if twice:
        raise UsageError(f"mode {twice[0]} is asked for twice")
    if not given or min(given) < 1:
        raise UsageError("modes count from 1, the lowest elastic one; at least one is needed")
    return tuple(sorted(given))


# --- Chunks of samples, and few of many

NUMBERS = 30_000  # of one matrix for each sample at once: some five of them fit the cache
Array = TypeVar("Array", Floats, Ints)


def chunks(rows: Array, numbers: int) -> Iterator[Array]:
    """``rows`` in parts, fewer at once the more ``numbers`` each of them needs."""
    size = min(2048, max(16, NUMBERS // numbers))
    return (rows[i : i + size] for i in range(0, max(len(rows), 1), size))


BLOCK = 2_000_000  # numbers of a batch of matrices: a second or so of dense solves
AT_LEAST = 128  # samples of a batch: those of large models share most of their work


def solve_blocks(x: Floats, n_dof: int) -> Iterator[Floats]:
    """Rows of x that are solved exactly at once, part by part."""
    size = max(AT_LEAST, BLOCK // n_dof**2)
    return (x[i : i + size] for i in range(0, len(x), size))


def spread(x: Floats, most: int) -> Floats:
    """Rows of x, at most so many, spread evenly from the first to the last."""
    keep = np.unique(np.linspace(0, len(x) - 1, min(most, len(x))).round().astype(int))
    return np.asarray(x[keep])


# --- Sizes

MOST_TERMS = 20_000  # of one full series that is made without being asked for by order
