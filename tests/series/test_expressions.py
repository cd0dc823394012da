"""One expression on floats, on samples and on series: the same numbers."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from series_operators import PowerSeries

from eigassign.series import (
    Expression,
    Recorder,
    Samples,
    Tangents,
    Truncated,
    compile_program,
    compile_table,
    cos,
    derivative,
    exp,
    on_faces,
    sin,
    total_degree,
)

N = 3
SPACE = total_degree(N, 4)
Tree = tuple[Any, ...]

numbers = st.sampled_from([-2.0, -1.0, -0.5, 0.0, 0.25, 1.0, 1.5, 3.0])
leaves = st.one_of(
    st.tuples(st.just("variable"), st.integers(0, N - 1)), st.tuples(st.just("number"), numbers)
)


def branches(inner: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
    return st.one_of(
        st.tuples(st.sampled_from(["add", "subtract", "multiply", "divide"]), inner, inner),
        st.tuples(st.sampled_from(["sine", "cosine", "negative"]), inner),
        st.tuples(st.just("whole"), inner, st.sampled_from([1.0, 2.0, 3.0, 4.0])),
        st.tuples(st.just("root"), inner, st.sampled_from([0.5, -0.5, 1.5, -1.0, -3.0])),
    )


trees = st.recursive(leaves, branches, max_leaves=12)


def value(tree: Tree, x: list[Any], sine: Callable[..., Any], cosine: Callable[..., Any]) -> Any:
    """The tree in whatever algebra x belongs to; divisors and roots keep off zero by a square."""
    kind, *rest = tree
    if kind == "variable":
        return x[rest[0]]
    if kind == "number":
        return rest[0]
    a = value(rest[0], x, sine, cosine)
    if kind in ("sine", "cosine"):
        return (sine if kind == "sine" else cosine)(a)
    if kind == "negative":
        return -a
    if kind == "whole":
        return a ** rest[1] if isinstance(a, float | Expression) else whole(a, rest[1])
    if kind == "root":
        return (1.25 + a * a) ** rest[1]
    b = value(rest[1], x, sine, cosine)
    if kind == "divide":
        return a / (1.25 + b * b)
    return {"add": lambda: a + b, "subtract": lambda: a - b, "multiply": lambda: a * b}[kind]()


def whole(a: Any, exponent: float) -> Any:
    out = a
    for _ in range(int(exponent) - 1):
        out = out * a
    return out


def series_sine(a: Any) -> Any:
    return a.sin() if isinstance(a, PowerSeries) else math.sin(a)


def series_cosine(a: Any) -> Any:
    return a.cos() if isinstance(a, PowerSeries) else math.cos(a)


def coefficients(a: Any) -> np.ndarray:
    return a.coefficients if isinstance(a, PowerSeries) else a * np.eye(len(SPACE))[0]


AT = np.array([[0.3, -0.7, 1.1], [0.0, 0.4, -0.2]])


@given(trees)
def test_samples_agree_with_plain_floats(tree: Tree) -> None:
    recorder = Recorder()
    recorded = value(tree, [recorder.variable(i) for i in range(N)], sin, cos)
    table = compile_table(recorder, [recorded], N)
    found = np.broadcast_to(table.evaluate(Samples(), AT.T), (1, 2))[0]
    expected = [value(tree, row.tolist(), math.sin, math.cos) for row in AT]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@given(trees)
def test_series_agree_with_series_arithmetic(tree: Tree) -> None:
    recorder = Recorder()
    recorded = value(tree, [recorder.variable(i) for i in range(N)], sin, cos)
    variables = [PowerSeries.variable(SPACE, i, AT[0, i]) for i in range(N)]
    found = compile_table(recorder, [recorded], N).evaluate(
        Truncated(SPACE), np.array([v.coefficients for v in variables])
    )[0]
    expected = coefficients(value(tree, variables, series_sine, series_cosine))
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * size)


@given(trees)
def test_what_a_tree_does_not_depend_on_structurally_does_not_change_it(tree: Tree) -> None:
    recorder = Recorder()
    recorded = value(tree, [recorder.variable(i) for i in range(N)], sin, cos)
    table = compile_table(recorder, [recorded], N)
    idle = ~table.program.dependence.any(axis=0)
    moved = AT[:1] + np.where(idle, 0.9, 0.0)
    before, after = (
        np.broadcast_to(table.evaluate(Samples(), x.T), (1, 1)) for x in (AT[:1], moved)
    )
    np.testing.assert_array_equal(before, after)


@given(trees, st.lists(st.booleans(), min_size=N, max_size=N))
def test_what_is_affine_by_its_form_has_no_higher_coefficients(
    tree: Tree, chosen: list[bool]
) -> None:
    recorder = Recorder()
    recorded = value(tree, [recorder.variable(i) for i in range(N)], sin, cos)
    program = compile_table(recorder, [recorded], N).program
    variables = np.zeros((N, len(SPACE)))
    variables[:, 0] = AT[0]
    variables[:, SPACE.units] = np.eye(N)
    higher = SPACE.indices[:, np.array(chosen)].sum(axis=1) > 1
    found = program.run(Truncated(SPACE), variables)
    if program.is_affine(np.array(chosen)):
        assert not found[:, higher].any()


def test_a_form_is_affine_where_each_output_is_of_degree_one() -> None:
    recorder = Recorder()
    x, y, z = (recorder.variable(i) for i in range(3))
    forms = {"sin(x) y": sin(x) * y, "y z": y * z, "1 / y": y**-1.0, "y²": y**2.0, "exp(x)": exp(x)}

    def affine(name: str, *of: int) -> bool:
        program = compile_program(recorder, [forms[name].single()[1]], 3)
        return program.is_affine(np.isin(np.arange(3), of))

    assert affine("sin(x) y", 1)
    assert affine("y z", 1)
    assert affine("exp(x)", 1, 2)
    assert not affine("sin(x) y", 0)
    assert not affine("y z", 1, 2)
    assert not affine("1 / y", 1)
    assert not affine("y²", 1)
    assert not affine("exp(x)", 0)


@given(st.lists(trees, min_size=1, max_size=3))
def test_series_have_no_coefficients_off_the_faces(several: list[Tree]) -> None:
    recorder = Recorder()
    x = [recorder.variable(k) for k in range(N)]
    found = [value(tree, x, sin, cos) for tree in several]
    atoms = [atom for f in found if isinstance(f, Expression) for atom in f.terms]
    program = compile_program(recorder, atoms, N)
    variables = np.zeros((N, len(SPACE)))
    variables[:, 0] = 0.3, -0.7, 1.1
    variables[:, SPACE.units] = np.eye(N)
    whole = program.run(Truncated(SPACE), variables)
    inner, where = on_faces(SPACE, program.faces.tobytes())
    off = np.delete(np.arange(len(SPACE)), where)
    assert not whole[:, off].any()
    np.testing.assert_array_equal(
        program.run(Truncated(inner), variables[:, where]), whole[:, where]
    )


def test_a_sum_has_the_faces_of_its_terms_and_a_function_of_it_has_one() -> None:
    recorder = Recorder()
    x, y, z = (recorder.variable(k) for k in range(3))

    def faces(expression: Expression) -> list[list[bool]]:
        return compile_program(recorder, [*(expression * 1.0).terms], 3).faces.tolist()

    assert faces(sin(x * y + sin(z))) == [[True, True, True]]
    assert faces(x * (y + sin(z))) == [[True, True, False], [True, False, True]]
    assert faces(x * x + sin(y) + z) == [
        [True, False, False],
        [False, True, False],
        [False, False, True],
    ]


decades = st.builds(
    lambda sign, e: sign * 10.0**e, st.sampled_from([-1, 1]), st.integers(-320, 300)
)
linear = st.lists(st.one_of(st.just(0.0), decades), min_size=N + 1, max_size=N + 1)


@given(linear, linear)
def test_coefficients_are_decades_apart(first: list[float], second: list[float]) -> None:
    """One of a linear form may be zero, or nothing but round-off."""

    def composed(x: list[Any], absolute: Callable[[float], float]) -> Any:
        f, g = (
            sum(absolute(c) * a for c, a in zip(k, [*x, 1.0], strict=True)) for k in (first, second)
        )
        return f * g + g + (1.25 + f * f) ** -1.0

    a, b = (max(map(abs, k)) for k in (first, second))
    assume(max(a, b) * max(a, 1.0) < 1e299)
    recorder, x = Recorder(), AT[0].tolist()
    recorded = composed([recorder.variable(i) for i in range(N)], float)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        found = compile_table(recorder, [recorded], N).evaluate(Samples(), np.array(x)[:, None])
    size = composed([abs(each) for each in x], abs)
    assert np.broadcast_to(found, (1, 1))[0, 0] == pytest.approx(
        composed(x, float), rel=0.0, abs=1e-12 * size
    )


def test_constants_fold_away_as_they_are_written() -> None:
    recorder = Recorder()
    x = recorder.variable(0)
    assert x * 0.0 == 0.0
    assert x - x == 0.0
    assert (2.0 * x + 1.0) - x * 2.0 == 1.0
    assert sin(0.5) == math.sin(0.5)
    assert cos(0.5) == math.cos(0.5)
    assert len(recorder.nodes) == 1
    assert x + 0.0 is x
    assert x * 1.0 is x


def test_equal_subexpressions_are_recorded_once() -> None:
    recorder = Recorder()
    x, y = recorder.variable(0), recorder.variable(1)
    _ = sin(x + y) * cos(x)
    before = len(recorder.nodes)
    _ = cos(x) * sin(y + x)
    _ = 3.0 * (sin(x + y) * cos(x))
    assert len(recorder.nodes) == before
    (a, i), (b, j) = (x + 2.0 * y).single(), (-2.0 * x - 4.0 * y).single()
    assert i == j
    assert b == -2.0 * a


def test_roots_of_negative_multiples_are_roots_of_the_product() -> None:
    recorder = Recorder()
    x = recorder.variable(0)
    table = compile_table(recorder, [(-2.0 * x) ** 0.5, (-2.0 * x) ** -1.0], 1)
    found = table.evaluate(Samples(), np.array([[-8.0]]))
    np.testing.assert_allclose(found[:, 0], [4.0, 1.0 / 16.0])


def test_numpy_numbers_mix_with_expressions_from_both_sides() -> None:
    recorder = Recorder()
    x, two = recorder.variable(0), np.float64(2.0)
    table = compile_table(recorder, [two * x, x * two, two - x, x / two, two / x, two + x], 1)
    found = table.evaluate(Samples(), np.array([[4.0]]))[:, 0]
    np.testing.assert_allclose(found, [8.0, 8.0, -2.0, 2.0, 0.5, 6.0])


def test_dependence_is_structural() -> None:
    recorder = Recorder()
    x, y, z = (recorder.variable(i) for i in range(3))
    outputs = [sin(x) * y, z**0.5, (x + y) * 1.0]
    atoms = [expression.single()[1] for expression in outputs]
    program = compile_program(recorder, atoms, 4)
    expected = [[1, 1, 0, 0], [0, 0, 1, 0], [1, 1, 0, 0]]
    np.testing.assert_array_equal(program.dependence, np.array(expected, dtype=bool))


def test_only_what_the_outputs_need_is_computed() -> None:
    recorder = Recorder()
    x, y = recorder.variable(0), recorder.variable(1)
    _ = sin(y) ** 0.5
    (_, atom), _ = cos(x).single(), sin(x)
    program = compile_program(recorder, [atom], 2)
    assert program.n_atoms == 2
    np.testing.assert_array_equal(program.input_variables, [0])


def test_a_table_mixes_numbers_and_expressions_and_may_hold_numbers_only() -> None:
    recorder = Recorder()
    x = recorder.variable(0)
    points = np.array([[0.1, 0.2, 0.3]])
    mixed = compile_table(recorder, [2.0, 3.0 * x - 1.0, sin(x)], 1)
    expected = [2.0 + 0 * points[0], 3.0 * points[0] - 1.0, np.sin(points[0])]
    np.testing.assert_allclose(mixed.evaluate(Samples(), points), expected)
    plain = compile_table(recorder, [2.0, -1.0], 1).evaluate(Samples(), points)
    np.testing.assert_array_equal(np.broadcast_to(plain, (2, 3)), [[2.0] * 3, [-1.0] * 3])
    series = compile_table(recorder, [2.0, x], 1).evaluate(
        Truncated(total_degree(1, 2)), np.array([[0.5, 1.0, 0.0]])
    )
    np.testing.assert_array_equal(series, [[2.0, 0.0, 0.0], [0.5, 1.0, 0.0]])


def test_a_domain_error_shows_as_not_a_number_without_a_warning() -> None:
    recorder = Recorder()
    root = recorder.variable(0) ** 0.5
    found = compile_table(recorder, [root], 1).evaluate(Samples(), np.array([[-1.0, 4.0]]))
    assert np.isnan(found[0, 0])
    assert found[0, 1] == 2.0


def test_exponentials_in_every_algebra() -> None:
    recorder = Recorder()
    x, y = recorder.variable(0), recorder.variable(1)
    table = compile_table(recorder, [exp(x * y) * 2.0, exp(0.5)], 2)
    at = np.array([[0.3], [-0.7]])
    value = 2.0 * math.exp(-0.21)
    np.testing.assert_allclose(table.evaluate(Samples(), at)[0], value, rtol=1e-15)
    assert exp(0.5) == pytest.approx(math.exp(0.5), rel=1e-15)
    directions = np.array([[0.3, 1.0, 0.0], [-0.7, 0.0, 1.0]])
    slopes = table.evaluate(Tangents(1, 2), directions)[0]
    np.testing.assert_allclose(slopes, [value, -0.7 * value, 0.3 * value], rtol=1e-15)
    space = total_degree(2, 6)
    rows = np.zeros((2, len(space)))
    rows[:, space.units] = np.eye(2)
    found = table.evaluate(Truncated(space), rows)[0]
    for k, (i, j) in enumerate(space.indices):
        expected = 2.0 / math.factorial(i) if i == j else 0.0
        assert found[k] == pytest.approx(expected, abs=1e-15)
    slope = derivative(exp(x * y), 0)
    (found_slope,) = compile_table(recorder, [slope], 2).evaluate(Samples(), at)
    np.testing.assert_allclose(found_slope, -0.7 * math.exp(-0.21), rtol=1e-15)
