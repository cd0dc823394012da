"""The reference that designs are judged by, before it judges anything."""

import numpy as np
import pytest
from assignment_oracle import best_least_squares, of_case
from random_assignments import load_text, random_case

import eigassign as ea


@pytest.mark.parametrize(
    "seed",
    [0, 8, pytest.param(1, marks=pytest.mark.slow), pytest.param(14, marks=pytest.mark.slow)],
)
def test_the_reference_has_the_slopes_of_its_objective(seed):
    """Differences of J err by about (1e-5)² of the third derivative, and by round-off."""
    problem = of_case(load_text(random_case(seed)))
    middle = 0.5 * (problem.lower + problem.upper)
    y = problem.initial + 0.1 * (middle - problem.initial)
    gradient, found = problem.gradient(y), []
    for j, width in enumerate(problem.width):
        step = 1e-5 * min(width, max(abs(y[j]), 1e-2 * width)) * np.eye(len(y))[j]
        rise = problem.rms(y + step) ** 2 - problem.rms(y - step) ** 2
        found.append(rise / (2.0 * step[j]))
    scale = np.abs(gradient * problem.width).max()
    assert np.abs((gradient - found) * problem.width).max() < 1e-5 * scale


@pytest.mark.parametrize(("name", "rms"), [("two_link", 1.29627e-2), ("gantry", 2.329e-4)])
def test_the_reference_finds_the_known_optimum(name, rms):
    """Found before by another program: seven starts of SciPy on exact frequencies."""
    problem = of_case(ea.load_case(f"cases/{name}.yaml"))
    best = best_least_squares(problem, 3)
    assert best.value == pytest.approx(rms, rel=2e-4)
    assert problem.violation(best.y) == 0.0
    np.testing.assert_allclose(best.ends, best.value, rtol=1e-3)
