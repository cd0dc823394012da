"""Implicit functions: known closed forms, the branch kept, and dead points refused."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from eigassign.errors import SingularityError
from eigassign.series import (
    Expression,
    ImplicitFunction,
    Recorder,
    Samples,
    Scalar,
    Truncated,
    compile_program,
    cos,
    derivative,
    sin,
    total_degree,
)

Equations = Callable[[list[Expression], list[Expression]], Sequence[Scalar]]


def implicit(
    equations: Equations,
    a0: Sequence[float],
    p0: Sequence[float],
    check: Equations | None = None,
) -> ImplicitFunction:
    """p(a) of F(a, p) = 0 through (a0, p0)."""
    recorder, n, m = Recorder(), len(a0), len(p0)
    z = [recorder.variable(k) for k in range(n + m)]
    F = list(equations(z[:n], z[n:]))
    rows = list(check(z[:n], z[n:])) if check else []
    J = [derivative(f, n + k) for f in F for k in range(m)]
    program = compile_program(recorder, [recorder.atom(s) for s in [*F, *rows, *J]], n + m)
    names = tuple(f"a{k}" for k in range(n))
    start = np.array(a0, float), np.array(p0, float)
    return ImplicitFunction(program, m, len(F), len(rows), *start, names, "the example")


def circle(a: list[Expression], p: list[Expression]) -> list[Scalar]:
    return [a[0] * a[0] + p[0] * p[0] - 1.0]


def two_links(a: list[Expression], p: list[Expression]) -> list[Scalar]:
    """Links of 1 and 0.8 m that reach the point a."""
    return [cos(p[0]) + cos(p[0] + p[1]) * 0.8 - a[0], sin(p[0]) + sin(p[0] + p[1]) * 0.8 - a[1]]


def elbow(a: np.ndarray) -> np.ndarray:
    """The closed form of p_1 (cosine rule), the branch with a positive elbow."""
    return np.asarray(np.arccos((a[0] ** 2 + a[1] ** 2 - 1.64) / 1.6))


A0 = (0.9, 0.7)
P0 = (
    float(np.arctan2(0.7, 0.9) - np.arctan2(0.8 * np.sin(elbow(np.array(A0))),
                                            1 + 0.8 * np.cos(elbow(np.array(A0))))),
    float(elbow(np.array(A0))),
)  # fmt: skip


def test_samples_follow_the_branch_they_started_on() -> None:
    a = np.linspace(-0.95, 0.95, 41)[None]
    for sign in (1.0, -1.0):
        p = implicit(circle, [0.2], [sign * np.sqrt(0.96)]).samples(a)
        np.testing.assert_allclose(p[0], sign * np.sqrt(1.0 - a[0] ** 2), rtol=1e-12)


def test_several_unknowns_have_their_closed_form() -> None:
    a = np.random.default_rng(0).uniform(0.5, 0.9, (2, 30))
    p = implicit(two_links, A0, P0).samples(a)
    np.testing.assert_allclose(p[1], elbow(a), rtol=1e-12)


def test_samples_are_solved_to_round_off_however_loosely_the_way_there_was() -> None:
    f = implicit(two_links, A0, P0)
    for distance in np.geomspace(1e-4, 0.1, 60):  # each by itself: where Newton stops varies
        a = np.array(A0)[:, None] - distance
        F = f.equations(a, f.samples(a))[0]
        assert np.abs(F).max() < 2e-15  # sums of terms of size 1


@pytest.mark.parametrize("order", range(1, 9))
def test_the_series_of_a_circle_is_the_binomial_one(order: int) -> None:
    space = total_degree(1, order)
    a = np.zeros((1, len(space)))
    a[0, 0], a[0, space.units[0]] = 0.0, 1.0
    p = implicit(circle, [0.1], [np.sqrt(0.99)]).series(Truncated(space), a)
    binomial = {0: 1.0, 2: -1 / 2, 4: -1 / 8, 6: -1 / 16, 8: -5 / 128}
    np.testing.assert_allclose(p[0], [binomial.get(k, 0.0) for k in range(order + 1)], atol=1e-14)


def test_the_series_leaves_no_residual_at_any_multi_index() -> None:
    space = total_degree(2, 6)
    algebra = Truncated(space)
    a = np.zeros((2, len(space)))
    a[:, 0], a[[0, 1], space.units] = A0, 1.0
    f = implicit(two_links, A0, P0)
    p = f.series(algebra, a)
    F = f.program.run(algebra, np.concatenate([a, p]))[:2]
    np.testing.assert_allclose(F, 0.0, atol=1e-12 * np.abs(p).max())


def test_the_series_has_the_derivatives_of_the_samples() -> None:
    space, h = total_degree(2, 2), 1e-4
    a = np.zeros((2, len(space)))
    a[:, 0], a[[0, 1], space.units] = A0, 1.0
    f = implicit(two_links, A0, P0)
    p = f.series(Truncated(space), a)
    steps = np.array([(0, 0), (h, 0), (-h, 0), (0, h), (0, -h)]).T
    s = f.samples(np.array(A0)[:, None] + steps)
    np.testing.assert_allclose(p[:, space.units[0]], (s[:, 1] - s[:, 2]) / (2 * h), rtol=1e-6)
    np.testing.assert_allclose(p[:, space.units[1]], (s[:, 3] - s[:, 4]) / (2 * h), rtol=1e-6)
    twice = space.find(np.array([[2, 0]]))[0]
    np.testing.assert_allclose(
        p[:, twice], (s[:, 1] - 2 * s[:, 0] + s[:, 2]) / (2 * h * h), rtol=1e-5
    )


def test_consistent_equations_may_outnumber_the_unknowns() -> None:
    def thrice(a: list[Expression], p: list[Expression]) -> list[Scalar]:
        return [*two_links(a, p), (two_links(a, p)[0]) * 2.0]

    a = np.array([[0.6, 1.0], [0.8, 0.5]])
    np.testing.assert_allclose(
        implicit(thrice, A0, P0).samples(a), implicit(two_links, A0, P0).samples(a), rtol=1e-12
    )


def test_a_singular_point_is_refused_by_name() -> None:
    f = implicit(circle, [0.2], [np.sqrt(0.96)])
    with pytest.raises(SingularityError, match=r"the example .* dead point, at a0 = 1$"):
        f.samples(np.array([[0.3, 1.0]]))


def test_beyond_the_reach_the_last_place_on_the_way_is_named() -> None:
    f = implicit(circle, [0.2], [np.sqrt(0.96)])
    with pytest.raises(SingularityError, match=r"at a0 = (0\.99|1)\S* on the way to a0 = 1.5"):
        f.samples(np.array([[1.5]]))


@pytest.mark.parametrize("far", [1e9, np.inf, 1e300])
def test_what_lies_absurdly_far_is_refused_at_once(far: float) -> None:
    with pytest.raises(SingularityError, match=r"cannot be followed as far as a0 = (1e|inf)"):
        implicit(circle, [0.2], [np.sqrt(0.96)]).samples(np.array([[0.1, far]]))


def test_crossing_branches_are_not_passed_unseen() -> None:
    # p² = a²: p = a and p = −a meet at 0, where Newton may leave on either
    f = implicit(lambda a, p: [p[0] * p[0] - a[0] * a[0]], [-1.0], [-1.0])
    with pytest.raises(SingularityError, match=r"on the way to a0 = 0\.7"):
        f.samples(np.array([[0.7]]))


def test_a_solution_that_fails_the_check_rows_is_refused() -> None:
    f = implicit(circle, [0.2], [-np.sqrt(0.96)], check=lambda a, p: [p[0] - 0.5])
    with pytest.raises(SingularityError):
        f.samples(np.array([[0.3]]))


def test_the_function_at_its_own_reference_is_the_known_solution() -> None:
    f = implicit(two_links, A0, P0)
    np.testing.assert_allclose(f.samples(np.array(A0)[:, None])[:, 0], P0, rtol=1e-13)
    F, _, J = f.equations(np.array(A0)[:, None], np.array(P0)[:, None])
    assert np.abs(F).max() < 1e-14
    assert J.shape == (1, 2, 2)


def test_expressions_of_an_implicit_function_run_on_samples_and_series() -> None:
    recorder = Recorder()
    x = recorder.variable(0)
    f = implicit(circle, [0.2], [np.sqrt(0.96)])
    (root,) = recorder.implicit(f, [sin(x)])
    program = compile_program(recorder, [recorder.atom(root * x)], 1)
    t = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_allclose(program.run(Samples(), t[None])[0], np.cos(t) * t, atol=1e-14)
    space = total_degree(1, 5)
    series = np.zeros((1, 6))
    series[0, :2] = 0.0, 1.0
    out = program.run(Truncated(space), series)[0]
    np.testing.assert_allclose(out, [0, 1, 0, -1 / 2, 0, 1 / 24], atol=1e-14)
