"""The cases of the stress atlas, and what every answer of it has to pass."""

from itertools import product
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from eigassign import Case, load_case
from eigassign.modal import MARGIN, Expansion, Model, NearestExpansion, ReducedModel

Surrogate = Expansion | NearestExpansion | ReducedModel
ATLAS = Path(__file__).parents[2] / "cases" / "stress"


def case(name: str) -> Case:
    return load_case(ATLAS / f"{name}.yaml")


def stated_error(model: Model, answer: Surrogate, x: np.ndarray) -> np.ndarray:
    """The stated error (n_modes,) of what answers frequencies, judged at x (n, n_x)."""
    q, y = np.split(x, [len(model.q_names)], axis=1)
    exact_hz = model.frequencies(q, y, max(answer.modes))[:, np.array(answer.modes) - 1]
    off = np.abs(answer.frequencies(q, y) / exact_hz - 1.0)
    return np.asarray(MARGIN * np.where(np.isnan(off), np.inf, off).max(axis=0))


def stated(model: Model, approximation: Surrogate, q: object, y: object) -> np.ndarray:
    """What is stated (n_modes,) of the box of some samples, judged at its corners and inside."""
    x = model.x(q, y)
    moving = np.flatnonzero(np.ptp(x, axis=0) > 0.0)
    corners = np.array([*product((0.0, 1.0), repeat=len(moving))])
    u = corners.reshape(2 ** len(moving), -1)
    if len(moving):
        u = np.vstack([u, qmc.Halton(len(moving), scramble=False).random(129)[1:]])
    at = np.repeat(x[:1], len(u), axis=0)
    low, high = x[:, moving].min(axis=0), x[:, moving].max(axis=0)
    at[:, moving] = low + u * (high - low)
    return stated_error(model, approximation, at)


def judged(
    model: Model, approximation: Surrogate, q: object, y: object, round_off: float = 1e-12
) -> np.ndarray:
    """True relative errors; what is stated of their range must show them: else this fails."""
    pick = np.array(approximation.modes) - 1
    exact = model.frequencies(q, y, max(approximation.modes))[:, pick]
    error = np.abs(approximation.frequencies(q, y) / exact - 1.0)
    error = np.where(np.isnan(error), np.inf, error)
    covered = error <= 4.0 / 3.0 * stated(model, approximation, q, y) + round_off
    assert covered.all(), "a confident wrong number"
    return error
