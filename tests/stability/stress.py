"""The cases of the stress atlas, and what every answer of it has to pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eigassign import Case, load_case
from eigassign.modal import Model, Surrogate

ATLAS = Path(__file__).parents[2] / "cases" / "stress"


def case(name: str) -> Case:
    return load_case(ATLAS / f"{name}.yaml")


def judged(model: Model, approximation: Surrogate, q: object, y: object) -> np.ndarray:
    """True relative errors; every estimate that is given must cover its own: else this fails."""
    pick = np.array(approximation.modes) - 1
    exact = model.frequencies(q, y, max(approximation.modes))[:, pick]
    error = np.abs(approximation.frequencies(q, y) / exact - 1.0)
    estimate = approximation.error_estimate(q, y)
    given = np.isfinite(estimate)
    assert (estimate[given] >= error[given]).all(), "a confident wrong number"
    return np.where(given, error, np.nan)


def answered(approximation: Surrogate, q: object, y: object) -> float:
    """Share of the samples that are not refused."""
    return float(np.isfinite(approximation.error_estimate(q, y)).mean())
