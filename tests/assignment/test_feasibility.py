import itertools

import numpy as np
import pytest
from assignment_problems import goal, random_problem
from scipy.optimize import linprog

from eigassign.assignment import LinearConstraint, solve_assignment
from eigassign.errors import InfeasibleError


def solve(constraints, lower=(0.0, 0.0), upper=(1.0, 1.0)):
    """Two parameters that change λ by some 10 % a unit."""
    box = (np.array(lower), np.array(upper))
    model = goal([1.2e6, 1.1e6], [[-1e5, 2e4], [3e4, -1e5]], 1e6)
    return solve_assignment([model], [0.5, 0.5], [0.0, 0.0], [0.5, 0.5], box, constraints)


def row(name, coefficients, lower=-np.inf, upper=np.inf):
    return LinearConstraint(name, np.array(coefficients, dtype=float), lower, upper)


@pytest.mark.parametrize(
    ("constraints", "box", "named"),
    [
        (
            [row("a", [1, 0], lower=2), row("b", [1, 1], upper=1), row("c", [0, 1], upper=-1)],
            {},
            ("c",),
        ),
        (
            [
                row("at_least", [1, 1], lower=1.5),
                row("innocent", [1, -1], upper=0.9),
                row("at_most", [2, 2], upper=2.0),
            ],
            {},
            ("at_least", "at_most"),
        ),
        ([row("total", [1, 1], upper=0.5)], {"lower": (0.4, 0.4), "upper": (0.4, 0.4)}, ("total",)),
        ([row("empty", [0, 0], lower=1.0)], {}, ("empty",)),
        ([row("fine", [1, 0], upper=0.5), row("total", [1, 1], lower=3.0)], {}, ("total",)),
    ],
    ids=[
        "two alone: one is enough",
        "together and no third",
        "of fixed parameters",
        "without terms",
        "out of reach",
    ],
)
def test_constraints_that_contradict_the_bounds_or_each_other_are_named(constraints, box, named):
    with pytest.raises(InfeasibleError, match=f"within the bounds meets '{named[0]}'") as e:
        solve(constraints, **box)
    assert e.value.constraints == named
    assert ("together" in str(e.value)) is (named == ("at_least", "at_most"))


def test_open_ranges_reach_everything():
    result = solve([row("total", [1, -1], lower=1e3)], upper=(np.inf, np.inf))
    assert result.y[0] - result.y[1] >= 1e3 * (1 - 1e-9)


def possible(constraints):
    """Independent: the linear program over the unit box, in full."""
    sides = [(c.coefficients, c.upper) for c in constraints]
    sides += [(-c.coefficients, -c.lower) for c in constraints]
    sides = [(a, b) for a, b in sides if np.isfinite(b)]
    if not sides:
        return True
    A, b = (np.array(part) for part in zip(*sides, strict=True))
    return linprog(np.zeros(A.shape[1]), A, b, bounds=(0.0, 1.0)).status == 0


def random_rows(seed):
    """Two to six constraints on three parameters."""
    rng, rows = np.random.default_rng(seed), []
    for k in range(6):
        low = rng.normal()
        rows.append(row(f"c{k}", rng.normal(size=3), low - 0.5, low + rng.random()))
    return rows[: 2 + seed % 5]


@pytest.mark.parametrize("seed", range(40))
def test_infeasible_is_said_exactly_when_it_is_so_and_the_named_set_is_smallest(seed):
    problem, constraints = random_problem(seed, n_y=3), random_rows(seed)
    box = (np.zeros(3), np.ones(3))
    arguments = (problem.goals, problem.weights, np.zeros(3), 0.5 * np.ones(3), box, constraints)
    if possible(constraints):
        solve_assignment(*arguments)
        return
    with pytest.raises(InfeasibleError) as e:
        solve_assignment(*arguments)
    named = [c for c in constraints if c.name in e.value.constraints]
    assert not possible(named)
    if all(possible([c]) for c in named):  # else each named one is impossible on its own
        for fewer in itertools.combinations(named, len(named) - 1):
            assert possible(list(fewer))
    else:
        assert not any(possible([c]) for c in named)


def test_the_random_sets_are_of_all_kinds():
    kinds = {"possible": 0, "alone": 0, "together": 0}
    for rows in map(random_rows, range(40)):
        alone = not all(possible([c]) for c in rows)
        kinds["possible" if possible(rows) else "alone" if alone else "together"] += 1
    assert min(kinds.values()) >= 3, kinds
