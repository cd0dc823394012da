"""The algebra of truncated series: identities that hold coefficient by coefficient."""

import itertools
import math

import numpy as np
import pytest
from series_operators import PowerSeries

from eigassign.series import LowerSet, Truncated, lower_set, partially_linear, total_degree

SETS = {
    "total degree": total_degree(3, 5),
    "one variable": total_degree(1, 8),
    "box": lower_set(list(np.ndindex(4, 3, 3))),
    "partially linear": partially_linear(2, 2, 4),
    "weighted": lower_set([[i, j] for j in range(3) for i in range(6 - 2 * j)]),
    "corner": lower_set([[0, 0], [1, 0], [2, 0], [3, 0], [0, 1], [0, 2], [1, 1]]),
    "constant": total_degree(2, 0),
}
spaces = pytest.mark.parametrize("space", SETS.values(), ids=SETS.keys())


def some(space: LowerSet, seed: int, constant: float | None = None) -> PowerSeries:
    values = np.random.default_rng(seed).standard_normal(len(space))
    if constant is not None:
        values[0] = constant
    return PowerSeries(space, values)


def same(a: PowerSeries, b: PowerSeries | float, size: float = 1.0) -> None:
    """Equal to round-off of terms of the given size."""
    other = b.coefficients if isinstance(b, PowerSeries) else np.eye(len(a.space))[0] * b
    np.testing.assert_allclose(a.coefficients, other, atol=2e-13 * size, rtol=2e-13)


@spaces
def test_products_are_cauchy_products(space: LowerSet) -> None:
    a, b = some(space, 1), some(space, 2)
    members = space.indices.tolist()
    expected = np.zeros(len(space))
    for i, j in itertools.product(range(len(space)), repeat=2):
        total = [x + y for x, y in zip(members[i], members[j], strict=True)]
        if total in members:
            expected[members.index(total)] += a.coefficients[i] * b.coefficients[j]
    np.testing.assert_allclose((a * b).coefficients, expected, atol=1e-13)


@spaces
def test_products_commute_associate_and_distribute(space: LowerSet) -> None:
    a, b, c = (some(space, k) for k in range(3))
    same(a * b, b * a)
    same((a * b) * c, a * (b * c), 1e3)
    same(a * (b + c), a * b + a * c, 1e2)
    same((a + b) * (a + b), a * a + 2.0 * (a * b) + b * b, 1e2)
    same((a - b) * (a + b), a * a - b * b, 1e2)


@spaces
def test_sine_and_cosine_square_to_one_and_add_angles(space: LowerSet) -> None:
    a, b = some(space, 3), some(space, 4)
    same(a.sin() * a.sin() + a.cos() * a.cos(), 1.0, 1e3)
    same((a + b).sin(), a.sin() * b.cos() + a.cos() * b.sin(), 1e3)
    same((a + b).cos(), a.cos() * b.cos() - a.sin() * b.sin(), 1e3)
    same((-a).sin(), -a.sin(), 1e2)
    assert a.sin().coefficients[0] == pytest.approx(math.sin(a.coefficients[0]), abs=1e-16)


@spaces
def test_powers_undo_each_other(space: LowerSet) -> None:
    a = some(space, 5, 1.7)
    same(a * (1.0 / a), 1.0, 1e3)
    same(a / a, 1.0, 1e3)
    same((a**0.5) * (a**0.5), a, 1e2)
    same(a**3.0, a * a * a, 1e3)
    same(a**-2.0 * (a * a), 1.0, 1e4)
    same((a**2.5) * (a**-1.5), a, 1e4)
    same(a / 4.0, a * 0.25)
    same(2.0 - a, -(a - 2.0))
    same(a**0.0, 1.0)


@spaces
def test_a_negative_constant_term_has_whole_powers(space: LowerSet) -> None:
    a = some(space, 6, -1.3)
    same(a**3.0, a * a * a, 1e3)
    same(a * a**-1.0, 1.0, 1e3)


def test_eulers_four_squares_hold_in_eight_variables() -> None:
    # (a²+b²+c²+d²)(e²+f²+g²+h²) is a sum of four squares; degree 4 in 8 variables
    space = total_degree(8, 4)
    x = [PowerSeries.variable(space, i) for i in range(8)]
    a, b, c, d, e, f, g, h = x
    left = (a * a + b * b + c * c + d * d) * (e * e + f * f + g * g + h * h)
    rows = [
        a * e + b * f + c * g + d * h,
        a * f - b * e + c * h - d * g,
        a * g - b * h - c * e + d * f,
        a * h + b * g - c * f - d * e,
    ]
    right = rows[0] * rows[0] + rows[1] * rows[1] + rows[2] * rows[2] + rows[3] * rows[3]
    np.testing.assert_array_equal(left.coefficients, right.coefficients)  # small integers: exact
    assert np.count_nonzero(left.coefficients) == 16


def test_series_have_the_published_coefficients() -> None:
    space = total_degree(1, 8)
    x = PowerSeries.variable(space, 0)
    k = np.arange(9)
    sine = [0, 1, 0, -1 / 6, 0, 1 / 120, 0, -1 / 5040, 0]
    np.testing.assert_allclose(x.sin().coefficients, sine, atol=1e-16)
    np.testing.assert_allclose((1.0 / (1.0 - x)).coefficients, 1.0, rtol=1e-14)
    catalan = [math.comb(2 * i, i) / (i + 1) for i in k]  # (1 − √(1−4x)) / 2x
    root = (1.0 - 4.0 * x) ** 0.5
    np.testing.assert_allclose(-0.5 * root.coefficients[1:], catalan[:-1], rtol=1e-12)


def test_composition_is_the_derivative_over_the_factorial() -> None:
    # sin(x + 2y + xy) about (0.3, −0.2): ∂^γ/γ! by the closed form of its low derivatives
    space = total_degree(2, 2)
    x, y = PowerSeries.variable(space, 0, 0.3), PowerSeries.variable(space, 1, -0.2)
    z = 0.3 - 0.4 - 0.06
    zx, zy = 1.0 - 0.2, 2.0 + 0.3
    s, c = math.sin(z), math.cos(z)
    expected = [s, c * zx, c * zy, -s * zx**2 / 2, -s * zx * zy + c, -s * zy**2 / 2]
    np.testing.assert_allclose((x + 2.0 * y + x * y).sin().coefficients, expected, rtol=1e-14)


@pytest.mark.parametrize("name", ["total degree", "one variable"])
def test_values_converge_to_the_function_with_the_order(name: str) -> None:
    space = SETS[name]
    x = [PowerSeries.variable(space, i, 0.2) for i in range(space.n_variables)]
    f = (1.5 + sum(x[1:], x[0])).sin() * (2.0 + x[0]) ** 0.5
    direction = np.linspace(1.0, 0.5, space.n_variables)

    def error(h: float) -> float:
        at = 0.2 + h * direction
        return abs(f(h * direction) - math.sin(1.5 + at.sum()) * math.sqrt(2.0 + at[0]))

    slope = math.log(error(0.2) / error(0.1)) / math.log(2.0)
    assert slope == pytest.approx(space.order + 1, abs=0.2)


def test_one_point_and_many_points_evaluate_alike() -> None:
    a = some(total_degree(2, 3), 7)
    points = np.array([[0.1, 0.2], [0.3, -0.4]])
    np.testing.assert_allclose(a(points), [a(points[0]), a(points[1])], rtol=1e-14)
    assert np.ndim(a(points[0])) == 0


def test_stacks_are_worked_on_row_by_row_however_long_they_are() -> None:
    space = total_degree(3, 4)
    algebra, random = Truncated(space), np.random.default_rng(0)
    a, b = random.standard_normal((2, 20_000, len(space)))  # 4 million products: in two parts
    products = algebra.product(a, b)
    np.testing.assert_array_equal(algebra.product(a[9::4000], b[9::4000]), products[9::4000])
    quarters = np.array([0, 1, 0])
    for row, quarter, series in zip(algebra.wave(a[:3], quarters), quarters, a, strict=False):
        wave = PowerSeries(space, series)
        same(PowerSeries(space, row), wave.cos() if quarter else wave.sin(), 10.0)
