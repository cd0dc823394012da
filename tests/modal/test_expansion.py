"""The Taylor expansion: subsets of the series, evaluation, eq. (9), and refusals.

The ladder is in tests/modal/taylor.
"""

import numpy as np
import pytest
from chains import bar, model_of, two_link
from rungs import richardson

from eigassign import expand
from eigassign.errors import UsageError
from eigassign.modal import Expansion, Model, eigenvalues
from eigassign.modal import expand as expand_pencil
from eigassign.series import lower_set, total_degree

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
BOTH = ("absolute", "absolute")
RELATIVE = ("relative", "relative")


def paper(angles: tuple[str, str] = ("relative", "absolute")) -> Model:
    return model_of(two_link(angles=angles))


def agree(a: np.ndarray, b: np.ndarray, tolerance: float) -> None:
    size = np.abs(b).max(axis=-1, keepdims=True)
    np.testing.assert_allclose(a / size, b / size, rtol=tolerance, atol=tolerance)


def test_too_few_vectors_do_not_give_the_order() -> None:
    model = paper()
    short = expand(model, Q0, Y0, (1,), 4, vector_order=1)  # 2m + 1 = 3
    full = expand(model, Q0, Y0, (1,), 4)
    degree = full.indices.sum(axis=1)
    agree(short.coefficients[:, degree <= 3], full.coefficients[:, degree <= 3], 1e-10)
    assert np.abs(short.coefficients - full.coefficients)[:, degree == 4].max() > 1.0


def test_coefficients_over_absolute_angles_are_complete_and_symmetric_in_a_common_turn() -> None:
    e = expand(paper(BOTH), Q0, Y0, (1,), 4)
    assert e.indices.shape == (70, 4)
    assert e.coefficients.shape == (1, 70)
    c = dict(zip(map(tuple, e.indices.tolist()), e.coefficients[0], strict=True))
    # λ depends on q2 − q1 alone: ∂/∂q1 = −∂/∂q2
    assert c[1, 0, 0, 0] == pytest.approx(-c[0, 1, 0, 0], rel=1e-12)
    assert c[1, 1, 0, 0] == pytest.approx(-2.0 * c[2, 0, 0, 0], rel=1e-12)
    assert c[2, 2, 0, 0] == pytest.approx(6.0 * c[4, 0, 0, 0], rel=1e-12)
    assert c[1, 2, 1, 0] == pytest.approx(3.0 * -c[3, 0, 1, 0] * -1.0, rel=1e-12)


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("angles", [RELATIVE, BOTH])
def test_coefficients_over_x_are_the_polynomial_that_is_evaluated(
    angles: tuple[str, str], linear: bool
) -> None:
    e = expand(paper(angles), Q0, Y0, (1, 2), 4, linear)
    d = np.random.default_rng(0).uniform(-0.3, 0.3, (5, 4)) * [1.0, 1.0, 0.3, 0.3]
    powers = np.prod(d[:, None, :] ** e.indices[None], axis=2)
    found = e.eigenvalues(Q0 + d[:, :2], Y0 + d[:, 2:])
    np.testing.assert_allclose(powers @ e.coefficients.T, found, rtol=1e-11)
    assert (e.indices[:, 2:].sum(axis=1) <= 1).all() == linear


# Subsets


def lookup(e: Expansion) -> dict[tuple[int, ...], np.ndarray]:
    return dict(zip(map(tuple, e.indices.tolist()), e.coefficients.T, strict=True))


@pytest.mark.parametrize(
    "space",
    [
        lower_set(list(np.ndindex(1, 4, 2, 3))),
        lower_set([r for r in total_degree(4, 5).indices.tolist() if sum(r) + r[2] + r[3] <= 5]),
        lower_set([[0, 0, 0, 0], [0, 1, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1],
                   [0, 1, 0, 1], [0, 0, 1, 1]]),
        lower_set(list(np.ndindex(3, 3, 1, 1))),
    ],
    ids=["box", "weighted", "irregular", "angles only"],
)  # fmt: skip
@pytest.mark.parametrize("angles", [RELATIVE, BOTH])
def test_any_lower_set_gives_coefficients_of_the_full_expansion(
    space: object, angles: tuple[str, str]
) -> None:
    model = paper(angles)
    part = expand(model, Q0, Y0, (1, 2), space=space)  # type: ignore[arg-type]
    full = lookup(expand(model, Q0, Y0, (1, 2), part.order))
    relative = angles[0] == "relative"
    wanted = {tuple(r) for r in space.indices.tolist() if not (relative and r[0])}  # type: ignore
    assert set(lookup(part)) == wanted
    size = np.abs(np.array(list(full.values()))).max()
    for gamma, value in lookup(part).items():
        np.testing.assert_allclose(value, full[gamma], rtol=1e-9, atol=1e-11 * size)


def test_a_set_of_another_number_of_variables_is_refused() -> None:
    with pytest.raises(UsageError, match="3 variables, the model 4"):
        expand(paper(), Q0, Y0, space=total_degree(3, 2))


# The terms of eq. (9)


def design_slopes(e: Expansion, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """l_0 (n, n_modes) and l (n, n_modes, n_y)."""
    l0, slopes = e.slopes(q, e.y0)
    return l0, slopes[:, :, len(e.q0) :]


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("angles", [RELATIVE, BOTH])
def test_slopes_at_the_point_are_those_of_the_polynomial_in_y(
    linear: bool, angles: tuple[str, str]
) -> None:
    e = expand(paper(angles), Q0, Y0, (1, 2), 4, linear)
    q = Q0 + np.array([[0.0, 0.0], [0.1, -0.1], [-0.2, 0.3]])
    l0, slopes = design_slopes(e, q)
    assert l0.shape == (3, 2)
    assert slopes.shape == (3, 2, 2)
    np.testing.assert_allclose(l0, e.eigenvalues(q, Y0), rtol=1e-13)
    for j, unit in enumerate(np.eye(2)):
        change = lambda h, u=unit: e.eigenvalues(q, Y0 + h * u) - e.eigenvalues(q, Y0 - h * u)  # noqa: E731
        expected = richardson(lambda h, c=change: c(h) / (2 * h), 0.05)
        np.testing.assert_allclose(slopes[:, :, j], expected, rtol=1e-9)
    if linear:
        y = np.array([0.2, 0.01])
        np.testing.assert_allclose(l0 + slopes @ (y - Y0), e.eigenvalues(q, y), rtol=1e-12)


def test_slopes_hold_for_clusters_and_for_parameters_that_do_not_matter() -> None:
    tree = two_link()
    tree["design"]["idle"] = {"parameter": "materials.al.youngs_modulus", "min": 1e9, "max": 1e12}
    tree["mechanism"]["materials"]["steel"] = {"youngs_modulus": 2e11, "density": 7850.0}
    for link in tree["mechanism"]["links"].values():
        link["material"] = "steel"
    model, y0 = model_of(tree), np.array([*Y0, 69e9])
    e = expand_pencil(model.pencil, Q0, y0, (1, 2), 3, cluster_gap=0.9)
    assert e.clusters[0].modes[:2] == (1, 2)
    q = Q0 + np.array([0.0, 0.15])  # off the point, where the small matrix is not diagonal
    l0, slopes = design_slopes(e, q)
    np.testing.assert_array_equal(slopes[:, :, 2], 0.0)
    at = lambda h: e.eigenvalues(q, y0 + h * np.eye(3)[0])  # noqa: E731
    np.testing.assert_allclose(l0, at(0.0), rtol=1e-12)
    expected = richardson(lambda h: (at(h) - at(-h)) / (2 * h), 0.02)
    np.testing.assert_allclose(slopes[:, :, 0], expected, rtol=1e-8)


# What drops out


def test_the_shoulder_angle_is_dropped_and_said_to_be() -> None:
    e = expand(paper(RELATIVE), Q0, Y0, (1,), 4)
    assert e.space.n_variables == 3
    assert e.indices.shape == (35, 4)
    assert not e.indices[:, 0].any()
    assert any("1 variable is left out" in note for note in e.notes)
    near, far = e.eigenvalues([0.0, 3.3], Y0), e.eigenvalues([2.5, 3.3], Y0)
    np.testing.assert_array_equal(near, far)


def test_an_expansion_without_design_parameters_is_one_over_the_angles() -> None:
    model = model_of(two_link(design={}, angles=RELATIVE))
    e = expand(model, Q0, [], (1, 2), 4)
    assert e.indices.tolist() == [[0, k] for k in range(5)]
    l0, slopes = design_slopes(e, Q0 + 0.1)
    assert slopes.shape == (1, 2, 0)
    np.testing.assert_allclose(l0, eigenvalues(model.pencil, model.x(Q0 + 0.1, []), 2), rtol=1e-4)


def test_a_structure_without_variables_has_a_constant_expansion() -> None:
    model = model_of(bar(3, 0.5, 70e9, 2700.0, {"shape": "circle", "diameter": 0.02}))
    e = expand(model, [], [], (1, 2), 4)
    np.testing.assert_allclose(e.frequencies([], []), model.frequencies([], [], 2))


# Refusals


def test_a_negative_polynomial_has_no_frequency() -> None:
    e = expand(paper(), Q0, Y0, (1,), 1)
    far = Y0 + 100.0
    assert e.eigenvalues(Q0, far)[0, 0] < 0.0
    assert np.isnan(e.frequencies(Q0, far)[0, 0])


def test_an_expansion_cannot_be_changed_and_is_the_same_every_time() -> None:
    model = paper()
    a, b = (expand(model, Q0, Y0, (1, 2), 4) for _ in range(2))
    np.testing.assert_array_equal(a.coefficients, b.coefficients)
    assert a.x0.tolist() == [*Q0, *Y0]
    for array in (a.coefficients, a.q0, a.clusters[0].vectors, a.clusters[0].coefficients):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
