from __future__ import annotations

import itertools

import numpy as np
import pytest
from assignment_problems import goal

from eigassign.assignment import (
    Bounds,
    LinearConstraint,
    ListedValues,
    build_program,
    solve_catalogue,
)
from eigassign.errors import AccuracyError, InfeasibleError, UsageError


def program(l0, slope, lower, upper, constraints=(), lam=1e6):
    l0, slope = np.asarray(l0, dtype=float), np.asarray(slope, dtype=float)
    zero = np.zeros(slope.shape[1])
    box = Bounds(np.asarray(lower, dtype=float), np.asarray(upper, dtype=float))
    model = goal(l0 * lam, slope * lam, np.full(l0.size, lam))
    return build_program([model], np.ones(l0.size), zero, zero, box, constraints)


def smooth(seed, n_y, n_t=152, decay=0.7):
    """λ/λ_d − 1 along a trajectory, and its slopes: cosines in time, the faster the smaller."""
    rng = np.random.default_rng(seed)
    size = decay ** np.arange(n_y)
    waves = np.cos(np.pi * np.outer(np.linspace(0, 1, n_t), np.arange(n_y)))
    return 1 + 0.3 * waves @ (rng.normal(size=n_y) * size), waves @ (
        rng.normal(size=(n_y, n_y)) * size
    ).T


def random_case(seed, most, n_continuous=0, n_constraints=0):
    """Lists of values and of choices in several columns, with repeated rows; units over decades."""
    rng = np.random.default_rng(seed)
    catalogues, n_y, count = [], n_continuous, 1
    while True:
        width, length = int(rng.integers(1, 4)), int(rng.integers(1, 10))
        if count * length > most or n_y + width > 14:
            break
        rows = rng.uniform(-0.3, 0.3, (length, width))
        if rng.random() < 0.2:
            rows[-1] = rows[0]
        if rng.random() < 0.2:
            rows[:, 0] = rows[0, 0]
        catalogues.append(ListedValues(f"list{n_y}", tuple(range(n_y, n_y + width)), rows))
        n_y, count = n_y + width, count * length
    order, unit = rng.permutation(n_y), 10.0 ** rng.uniform(-6, 6, n_y)
    catalogues = [
        ListedValues(c.name, tuple(order[list(c.columns)]), c.rows * unit[order[list(c.columns)]])
        for c in catalogues
    ]
    l0, slope = smooth(seed, n_y, n_t=20, decay=rng.uniform(0.5, 1.0))
    constraints = []
    for k in range(n_constraints):
        row = rng.normal(size=n_y) / unit
        at = sum(row[list(c.columns)] @ c.rows[rng.integers(c.rows.shape[0])] for c in catalogues)
        width = rng.choice([0.0, 0.05, 0.3])  # often met exactly by a combination
        constraints.append(LinearConstraint(f"c{k}", row, at - width, at + 10 * width))
    box = np.full(n_y, 0.3) * unit
    return program(l0, slope / unit, -box, box, constraints), catalogues


def feasible(p, Y, slack=1e-9):
    """Of designs (any, n_y), which meet all limits."""
    far = np.maximum(np.abs(p.lower), np.abs(p.upper))
    row, size = Y @ p.C.T, slack * np.abs(p.C) @ far
    inside = (p.lower - slack * far <= Y) & (p.upper + slack * far >= Y)
    met = (row <= p.c_upper + size) & (row >= p.c_lower - size)
    return inside.all(axis=1) & met.all(axis=1)


def objectives(p, Y):
    R = np.linalg.qr(np.column_stack([p.A, p.b]))[1]  # ‖A dy + b‖ = ‖R (dy, 1)‖
    return np.sum(((Y - p.y0) @ R[:, :-1].T + R[:, -1]) ** 2, axis=1)


def least(p, Y, free):
    """min J over the free columns of designs (any, n_y), infinite where nothing is feasible.

    The optimum is the feasible minimum on some set of limits, at most as many as free columns.
    """
    n, scale = len(free), (p.upper - p.lower)[free]
    box = np.eye(p.y0.size)[free]
    rows = np.vstack([box, box, p.C, p.C])
    ends = np.concatenate([p.lower[free], p.upper[free], p.c_lower, p.c_upper])
    best = np.full(Y.shape[0], np.inf)
    for size in range(n + 1):
        for active in map(list, itertools.combinations(range(ends.size), size)):
            G = rows[active][:, free] * scale
            if size and np.linalg.svd(G / np.linalg.norm(G, axis=1)[:, np.newaxis])[1][-1] < 1e-9:
                continue
            at, basis = np.zeros((Y.shape[0], n)), np.eye(n)
            if size:
                at = np.linalg.lstsq(G, ends[active][:, np.newaxis] - rows[active] @ Y.T)[0].T
                basis = np.linalg.svd(G)[2][size:].T
            A = p.A[:, free] * scale
            residual = (Y - p.y0) @ p.A.T + p.b + at @ A.T
            Z = Y.copy()
            Z[:, free] += scale * (at - np.linalg.lstsq(A @ basis, residual.T)[0].T @ basis.T)
            best = np.minimum(best, np.where(feasible(p, Z), objectives(p, Z), np.inf))
    return best


def brute_force(p, catalogues):
    """Objectives of all distinct feasible combinations, in increasing order."""
    lists = [np.unique(c.rows, axis=0) for c in catalogues]
    places = np.indices([rows.shape[0] for rows in lists]).reshape(len(lists), -1)
    Y = np.zeros((places.shape[1], p.y0.size))
    for catalogue, rows, place in zip(catalogues, lists, places, strict=True):
        Y[:, list(catalogue.columns)] = rows[place]
    free = sorted(set(range(p.y0.size)) - {j for c in catalogues for j in c.columns})
    found = least(p, Y, free) if free else np.where(feasible(p, Y), objectives(p, Y), np.inf)
    return np.sort(found[np.isfinite(found)])


def found(p, catalogues):
    """Objectives of what is found; none where it is proved that there is nothing."""
    try:
        search = solve_catalogue(p, catalogues)
    except InfeasibleError:
        return np.zeros(0)
    assert search.exhausted
    assert search.relative_gap <= 1e-9
    for one in search.best:  # the design is what the rows say
        assert feasible(p, one.y[np.newaxis])[0]
        for catalogue, row in zip(catalogues, one.rows, strict=True):
            np.testing.assert_array_equal(one.y[list(catalogue.columns)], catalogue.rows[row])
    return np.array([one.objective for one in search.best])


# The optimum of a quadratic program is certified to 1e-8 of its own units.
@pytest.mark.parametrize("seed", range(12))
def test_the_best_five_of_up_to_1e5_combinations_are_those_of_brute_force(seed):
    p, catalogues = random_case(seed, 100_000, n_constraints=seed % 3)
    want = brute_force(p, catalogues)[:5]
    np.testing.assert_allclose(found(p, catalogues), want, rtol=1e-9)


@pytest.mark.parametrize("seed", range(100, 108))
def test_so_are_they_beside_continuous_parameters(seed):
    p, catalogues = random_case(seed, 1_000, n_continuous=1 + seed % 2, n_constraints=seed % 3)
    want = brute_force(p, catalogues)[:5]
    got = found(p, catalogues)
    np.testing.assert_allclose(got, want, rtol=1e-7, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200, 500))
def test_so_are_they_on_many_cases(seed):
    n_continuous = seed % 4 % 3
    most = (100_000, 10_000, 1_000)[n_continuous]
    p, catalogues = random_case(seed, most, n_continuous, n_constraints=seed % 3)
    want = brute_force(p, catalogues)[:5]
    got = found(p, catalogues)
    np.testing.assert_allclose(got, want, rtol=1e-7, atol=1e-13)


def test_the_random_cases_are_of_all_kinds():
    kinds = {"large": 0, "impossible": 0, "few": 0}
    for seed in range(12):
        p, catalogues = random_case(seed, 100_000, n_constraints=seed % 3)
        count = brute_force(p, catalogues).size
        kinds["large"] += count > 4096
        kinds["impossible"] += count == 0
        kinds["few"] += 0 < count < 5
    assert min(kinds.values()) >= 1, kinds


def three_valued(seed, decay):
    rng = np.random.default_rng(seed)
    l0, slope = smooth(seed, 12, decay=decay)
    lists = np.sort(rng.uniform(-0.3, 0.3, (12, 3)))
    catalogues = [ListedValues(f"v{j}", (j,), lists[j][:, np.newaxis]) for j in range(12)]
    return program(l0, slope, -np.ones(12), np.ones(12)), catalogues


@pytest.mark.parametrize(
    "decay",
    [1.0, pytest.param(0.7, marks=pytest.mark.slow), pytest.param(0.4, marks=pytest.mark.slow)],
)
def test_twelve_parameters_of_three_values_need_few_nodes(decay):
    p, catalogues = three_valued(1, decay)
    search = solve_catalogue(p, catalogues)
    assert search.relative_gap <= 1e-9
    assert search.nodes < 150
    assert search.gap == pytest.approx(0.0, abs=1e-9 * search.best[0].objective)
    want = brute_force(p, catalogues)[:5]  # all 531 441
    np.testing.assert_allclose([one.objective for one in search.best], want, rtol=1e-9)


def test_a_search_that_is_stopped_states_a_gap_that_holds():
    p, catalogues = three_valued(2, 0.3)
    whole = solve_catalogue(p, catalogues)
    part = solve_catalogue(p, catalogues, seconds=0.0)
    assert not part.exhausted
    assert part.gap > 0.0
    assert part.nodes == 1
    assert part.lower_bound <= whole.best[0].objective <= part.best[0].objective
    assert part.relative_gap == part.gap / part.best[0].objective


BASE = ([1.2, 1.1, 0.9], [[-0.1, 0.02], [0.03, -0.1], [0.05, 0.05]])
PAIR = [ListedValues("rod", (0,), [[0.0], [1.0]]), ListedValues("hub", (1,), [[0.0], [1.0]])]


def test_constraints_that_only_the_relaxation_meets_are_named():
    constraints = [
        LinearConstraint("fine", np.array([1.0, 0.0]), upper=2.0),
        LinearConstraint("half", np.array([1.0, 1.0]), 0.4, 0.6),
    ]
    p = program(*BASE, [0, 0], [1, 1], constraints)
    with pytest.raises(InfeasibleError, match="'rod', 'hub' meets 'half'") as e:
        solve_catalogue(p, PAIR)
    assert e.value.constraints == ("half",)


def test_two_constraints_that_contradict_each_other_on_the_rows_are_named_together():
    constraints = [
        LinearConstraint("either", np.array([1.0, 1.0]), lower=1.0, upper=1.5),
        LinearConstraint("alike", np.array([1.0, -1.0]), -0.5, 0.5),
        LinearConstraint("loose", np.array([1.0, 2.0]), upper=9.0),
    ]
    p = program(*BASE, [0, 0], [1, 1], constraints)
    with pytest.raises(InfeasibleError) as e:
        solve_catalogue(p, PAIR)
    assert e.value.constraints == ("either", "alike")


def test_rows_outside_the_bounds_do_not_count_and_a_list_without_others_is_named():
    rod = ListedValues("rod", (0,), [[-5.0], [0.5], [5.0]])
    p = program(*BASE, [0, 0], [1, 1])
    search = solve_catalogue(p, [rod, PAIR[1]])
    assert {one.rows for one in search.best} == {(1, 0), (1, 1)}
    with pytest.raises(InfeasibleError, match="'rod': no row is within the bounds"):
        solve_catalogue(p, [ListedValues("rod", (0,), [[-5.0]]), PAIR[1]])


def test_a_limit_reached_before_anything_was_found_is_said():
    rng = np.random.default_rng(0)
    rows = rng.uniform(0, 1, (12, 30))
    catalogues = [ListedValues(f"v{j}", (j,), rows[j][:, np.newaxis]) for j in range(12)]
    total = LinearConstraint("total", np.ones(12), *[rows[:, 4].sum() + s * 1e-7 for s in (-1, 1)])
    l0, slope = smooth(1, 12)
    p = program(l0, slope, np.zeros(12), np.ones(12), [total])
    with pytest.raises(AccuracyError, match="met all limits in 1 nodes"):
        solve_catalogue(p, catalogues, seconds=0.0)


@pytest.mark.parametrize(
    ("catalogues", "message"),
    [
        ([ListedValues("a", (2,), [[1.0]])], "no column 2"),
        (
            [ListedValues("a", (0,), [[1.0]]), ListedValues("b", (1, 0), [[1.0, 1.0]])],
            "both set column 0",
        ),
    ],
)
def test_columns_that_do_not_exist_or_have_two_owners_are_refused(catalogues, message):
    with pytest.raises(UsageError, match=message):
        solve_catalogue(program(*BASE, [0, 0], [1, 1]), catalogues)


@pytest.mark.parametrize(
    ("columns", "rows", "labels", "message"),
    [
        ((0,), np.zeros((0, 1)), (), "nothing to choose from"),
        ((0, 1), [[1.0]], (), "1 given, but there are 2 parameters it sets"),
        ((0,), [[np.nan]], (), "must be finite"),
        ((0,), [[1.0]], ("x", "y"), "2 given, but there are 1 rows"),
    ],
)
def test_lists_that_are_none_are_refused(columns, rows, labels, message):
    with pytest.raises(UsageError, match=f"'a'.*{message}"):
        ListedValues("a", columns, rows, labels)
