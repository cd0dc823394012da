"""Samples in parts, so that what is worked out for each of them stays in the processor's cache."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

CHUNK = 2048  # samples at once, at most
NUMBERS = 30_000  # of one matrix for each sample at once: some five of them fit the cache
LEAST = 16
Array = TypeVar("Array", NDArray[np.float64], NDArray[np.intp])


def chunks(rows: Array, numbers: int) -> Iterator[Array]:
    """``rows`` in parts, fewer at once the more ``numbers`` each of them needs."""
    size = min(CHUNK, max(LEAST, NUMBERS // numbers))
    return (rows[i : i + size] for i in range(0, max(len(rows), 1), size))
