"""Samples of (q, y) as callers give them: one or many, checked and broadcast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError

Floats = NDArray[np.float64]


def samples(q: ArrayLike, y: ArrayLike, n_q: int, n_y: int) -> Floats:
    """x = (q, y) as (n_samples, n_q + n_y); one sample may be given flat and is broadcast."""
    rows = [_rows(q, n_q, "q"), _rows(y, n_y, "y")]
    counts = {len(r) for r in rows if len(r) != 1}
    if len(counts) > 1:
        raise UsageError(f"{len(rows[0])} samples of q against {len(rows[1])} of y")
    n = counts.pop() if counts else 1
    return np.hstack([np.broadcast_to(r, (n, r.shape[1])) for r in rows])


def point(q: ArrayLike, y: ArrayLike, n_q: int, n_y: int) -> Floats:
    """One point x = (q, y) as (n_q + n_y,); raises UsageError for several."""
    a, b = _numbers(q, "q"), _numbers(y, "y")
    if a.shape == (n_q,) and b.shape == (n_y,):
        x = np.concatenate([a, b])
        if np.isfinite(x).all():
            return x
    x = samples(a, b, n_q, n_y)
    if len(x) != 1:
        raise UsageError(f"{len(x)} samples of q and y; one point is expected")
    return np.asarray(x[0])


def _numbers(values: ArrayLike, name: str) -> Floats:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be real numbers, every sample with as many") from error


def _rows(values: ArrayLike, width: int, name: str) -> Floats:
    array = _numbers(values, name)
    if array.ndim > 2 or (array.ndim == 2 and array.shape[1] != width):
        raise UsageError(f"{name} has shape {array.shape}; expected (n_samples, {width})")
    if array.ndim < 2 and array.size != width:
        raise UsageError(f"{name} has {array.size} values; expected {width}")
    if not np.isfinite(array).all():
        raise UsageError(f"{name} must be finite")
    return array.reshape(-1, width) if width else np.zeros((max(1, len(np.atleast_2d(array))), 0))
