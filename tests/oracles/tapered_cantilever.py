"""A straight cantilever whose section varies: its equations of motion integrated from root to tip.

    w' = θ + Q/κGA,  θ' = M/EI,  M' = −Q − ρI λ θ,  Q' = −ρA λ w

from two unit loads at the root (w = θ = 0). λ = ω² is an eigenvalue where a combination of both
leaves no moment and no force at the tip. Without shear 1/κGA = ρI = 0.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

STEPS = 400  # of the Runge-Kutta method of fourth order: right to 1e-9 for the lowest three modes


class Values(NamedTuple):
    """At places (n,): EI [N m²], ρA [kg/m], compliance in shear 1/κGA [1/N], ρI [kg m]."""

    EI: np.ndarray
    mass: np.ndarray
    shear: np.ndarray
    rotary: np.ndarray


def at_the_tip(values: Values, length: float, lam: float) -> float:
    """The determinant that vanishes at eigenvalues; ``values`` at 2 × `STEPS` + 1 even places."""
    system = np.zeros((2 * STEPS + 1, 4, 4))
    system[:, 0, 1], system[:, 0, 3] = 1.0, values.shear
    system[:, 1, 2] = 1.0 / values.EI
    system[:, 2, 3], system[:, 2, 1] = -1.0, -values.rotary * lam
    system[:, 3, 0] = -values.mass * lam
    state, h = np.eye(4)[:, 2:], length / STEPS
    for k in range(STEPS):
        first, middle, last = system[2 * k : 2 * k + 3]
        a = first @ state
        b = middle @ (state + 0.5 * h * a)
        c = middle @ (state + 0.5 * h * b)
        d = last @ (state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return float(np.linalg.det(state[2:]))


def frequency_beside(at: Callable[[np.ndarray], Values], length: float, hz: float) -> float:
    """The frequency within 8 % of ``hz``; raises ValueError where there is none or two."""
    values = at(np.linspace(0.0, length, 2 * STEPS + 1))
    first, last = ((2.0 * np.pi * hz * s) ** 2 for s in (0.92, 1.08))
    lam = brentq(lambda lam: at_the_tip(values, length, lam), first, last, rtol=1e-12)
    return float(np.sqrt(lam) / (2.0 * np.pi))
