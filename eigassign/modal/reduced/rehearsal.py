"""Answers that a reduced model gave when it was stored, to be given again by what is read.

A stored model has no mechanism to be checked against. So it takes its answers along: frequencies,
error estimates, and uᵀK̂(x)u and uᵀM̂(x)u of one vector u without zeros, in which every entry of
every term counts, at points x from its expansion points out to 0.3 rad and 0.6 of each
design parameter. A model whose arrays were changed answers otherwise, and is refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError
from eigassign.modal.reduced.model import ReducedModel

Floats = NDArray[np.float64]
STEPS = (0.0, 0.02, 0.1, 0.3)  # from the point: rad or m, and half the share of a parameter
DRAWS = 3  # points at each step but the first
POINTS = 3  # of several expansion points: the first and last, and one between
CLOSE = 1e-9  # of answers: other processors round otherwise
ESTIMATES = (1e-9, 1e-5)  # absolute and relative: an estimate is a difference


def answers(model: ReducedModel) -> Floats:
    """One row for each point: frequencies, both forms and their sizes, estimates; NaN for none."""
    count = len(model.modes)
    rows = np.full((0, 2 * count + 4), np.nan)
    for x in _points(model):
        q, y = np.split(x, [model.n_q])
        row = np.full(rows.shape[1], np.nan)
        try:
            with np.errstate(all="ignore"):
                K, M = (A[0] for A in model.uncondensed(model.theta(x[None])))
                row[:count] = model.frequencies(q, y)[0]
                row[count : count + 4] = *_form(K), *_form(M)
                row[count + 4 :] = model.error_estimate(q, y)[0]
        except (EigassignError, np.linalg.LinAlgError):  # a loop that does not close there
            row[:] = np.nan
        rows = np.vstack([rows, row])
    return rows


def same_answers(given: Floats, stored: Floats, count: int) -> bool:
    """True where ``given`` and ``stored`` are the same for a model of ``count`` modes."""
    if given.shape != stored.shape or not np.isfinite(stored[0, : count + 4]).all():
        return False
    hz, forms, estimates = np.split(np.stack([given, stored]), [count, count + 4], axis=2)
    sizes = np.repeat(forms[1, :, 1::2], 2, axis=1)  # uᵀ|K̂|u and uᵀ|M̂|u
    least, relative = ESTIMATES
    return bool(
        np.allclose(hz[0], hz[1], rtol=CLOSE, atol=0.0, equal_nan=True)
        and np.allclose(forms[0] / sizes, forms[1] / sizes, rtol=0.0, atol=CLOSE, equal_nan=True)
        and np.allclose(estimates[0], estimates[1], rtol=relative, atol=least, equal_nan=True)
    )


def _form(A: Floats) -> tuple[float, float]:
    """uᵀAu and |u|ᵀ|A||u|."""
    u = np.cos(np.arange(1.0, len(A) + 1.0))
    return float(u @ A @ u), float(np.abs(u) @ np.abs(A) @ np.abs(u))


def _points(model: ReducedModel) -> Floats:
    """(n, n_x)."""
    rng = np.random.default_rng(20221122)
    n = model.n_q - model.n_loads
    chosen = model.points[np.unique(np.linspace(0, len(model.points) - 1, POINTS).astype(int))]
    found = []
    for x0 in chosen:
        scale = np.where(x0 != 0.0, 2.0 * np.abs(x0), 1.0)
        scale[:n] = 1.0
        for step in STEPS:
            for _ in range(DRAWS if step else 1):
                found.append(x0 + step * scale * rng.uniform(-1.0, 1.0, len(x0)))
    return np.array(found)
