"""The random cases and the reference that designs are judged by, before they judge anything."""

import numpy as np
import pytest
from assignment_oracle import best_least_squares, of_case
from random_assignments import CONFIRMATION, DEVELOPMENT, FAMILIES, load_text, random_case

import eigassign as ea

QUICK = (0, 3, 6)
EACH_FAMILY = [
    pytest.param(seed, marks=() if seed in QUICK else pytest.mark.slow)
    for seed in DEVELOPMENT[: len(FAMILIES)]
]


def problem_of(seed):
    return of_case(load_text(random_case(seed)))


@pytest.mark.parametrize("seed", EACH_FAMILY)
def test_a_random_case_is_sound_and_always_the_same(seed):
    text = random_case(seed)
    assert random_case(seed) == text
    problem = of_case(load_text(text))
    assert problem.violation(problem.initial) == 0.0
    assert 60 <= len(problem.q) <= 150
    assert problem.rms(problem.initial) > 1e-3


@pytest.mark.slow
def test_random_cases_are_varied():
    """Every case loads; what the issue asks for is among them."""
    problems = [problem_of(seed) for seed in (*DEVELOPMENT, *CONFIRMATION)]
    assert all(np.isfinite(p.rms(p.initial)) for p in problems)
    sizes = {len(p.initial) for p in problems}
    assert min(sizes) == 1
    assert max(sizes) >= 10
    assert sum(len(p.C) > 0 for p in problems) >= len(problems) / 4
    neighbours = [sorted(column for _, column, *_ in p.targets) for p in problems]
    assert sum(any(np.diff(columns) == 1) for columns in neighbours) >= len(problems) / 4
    span = [np.max(p.upper[p.lower > 0] / p.lower[p.lower > 0], initial=1.0) for p in problems]
    assert max(span) > 50.0


@pytest.mark.parametrize(
    "seed",
    [0, 8, pytest.param(1, marks=pytest.mark.slow), pytest.param(14, marks=pytest.mark.slow)],
)
def test_the_reference_has_the_slopes_of_its_objective(seed):
    """Differences of J err by about (1e-5)² of the third derivative, and by round-off."""
    problem = problem_of(seed)
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
