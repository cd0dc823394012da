"""Checks of what callers give by number: modes, orders, counts, gaps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from operator import index

import numpy as np

from eigassign.errors import UsageError


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


def relative_gap(value: object) -> float:
    """A finite number of at least 0."""
    if isinstance(value, int | float | np.number) and np.isfinite(value) and value >= 0.0:
        return float(value)
    raise UsageError(f"cluster_gap must be a number of at least 0, not {value!r}")
