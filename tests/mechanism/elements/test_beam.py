"""Beam element matrices: published values, rigid modes, exact polynomials, total mass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import bar
from frame_oracle import element
from spatial_cases import built

from eigassign.mechanism import local_links

E, A, I, RHO, L = 70e9, 3e-4, 5e-9, 2700.0, 0.8  # noqa: E741


def chain(n: int, bodies: dict[str, Any] | None = None) -> Any:
    """The matrices of one planar beam of n elements."""
    tree = bar(n, L, E, RHO, {"area": A, "bending_inertia": I})
    tree["mechanism"]["bodies"] = bodies or {}
    model = built(tree)
    return local_links(model.case, model.numbers, model.motion)[0][0]


def stiffness(n: int) -> np.ndarray:
    return sum(t.coefficient * t.matrix.toarray() for t in chain(n).stiffness)


def mass(n: int) -> np.ndarray:
    return sum(t.coefficient * t.matrix.toarray() for t in chain(n).mass)


def spread(n: int) -> np.ndarray:
    return sum(t.coefficient * t.matrix.toarray() for t in chain(n).rigid)


def test_one_element_has_the_published_hermite_matrices() -> None:
    # as in any text on structural dynamics: cubic Hermite bending, linear axial
    k, m = stiffness(1), mass(1)
    bending = E * I / L**3 * np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2]]
    )  # fmt: skip
    inertia = RHO * A * L / 420 * np.array(
        [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L**2, 13 * L, -3 * L**2],
         [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L**2, -22 * L, 4 * L**2]]
    )  # fmt: skip
    across, along = [1, 2, 4, 5], [0, 3]
    np.testing.assert_allclose(k[np.ix_(across, across)], bending, rtol=1e-14)
    np.testing.assert_allclose(m[np.ix_(across, across)], inertia, rtol=1e-14)
    np.testing.assert_allclose(k[np.ix_(along, along)], E * A / L * np.array([[1, -1], [-1, 1]]))
    np.testing.assert_allclose(
        m[np.ix_(along, along)], RHO * A * L / 6 * np.array([[2, 1], [1, 2]]), rtol=1e-14
    )
    assert not k[np.ix_(across, along)].any()
    assert not m[np.ix_(across, along)].any()


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_chain_is_its_integrated_elements_put_together(n: int) -> None:
    k, m = np.zeros((3 * n + 3, 3 * n + 3)), np.zeros((3 * n + 3, 3 * n + 3))
    for e in range(n):
        at = slice(3 * e, 3 * e + 6)
        part = element(E, A, I, RHO, L / n)
        k[at, at] += part[0]
        m[at, at] += part[1]
    np.testing.assert_allclose(stiffness(n), k, rtol=1e-12, atol=1e-12 * np.abs(k).max())
    np.testing.assert_allclose(mass(n), m, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_rigid_motion_strains_nothing(n: int) -> None:
    k = stiffness(n)
    np.testing.assert_allclose(k @ spread(n), 0.0, atol=1e-13 * np.abs(k).max())


@pytest.mark.parametrize("n", [1, 2, 7])
def test_rigid_motion_carries_the_mass_and_inertia_of_a_rod_about_its_start(n: int) -> None:
    total = RHO * A * L
    expected = np.diag([total, total, total * L**2 / 3])
    expected[1, 2] = expected[2, 1] = total * L / 2
    np.testing.assert_allclose(spread(n).T @ mass(n) @ spread(n), expected, atol=1e-14)


@pytest.mark.parametrize("n", [1, 3])
def test_cubic_deflection_and_linear_stretch_have_their_exact_energy(n: int) -> None:
    # v = 2x³ − x² + 3x: ½∫EI(12x − 2)²; u = 0.3x: ½∫EA 0.09
    x = np.linspace(0.0, L, n + 1)
    d = np.stack([0.3 * x, 2 * x**3 - x**2 + 3 * x, 6 * x**2 - 2 * x + 3], axis=1).ravel()
    bending = 0.5 * E * I * (144 * L**3 / 3 - 48 * L**2 / 2 + 4 * L)
    np.testing.assert_allclose(0.5 * d @ stiffness(n) @ d, bending + 0.5 * E * A * 0.09 * L)


@pytest.mark.parametrize("n", [1, 3])
def test_cubic_deflection_has_its_exact_kinetic_energy(n: int) -> None:
    x = np.linspace(0.0, L, n + 1)
    d = np.stack([0 * x, x**3 - 0.5 * x, 3 * x**2 - 0.5], axis=1).ravel()
    exact = 0.5 * RHO * A * (L**7 / 7 - L**5 / 5 + 0.25 * L**3 / 3)
    np.testing.assert_allclose(0.5 * d @ mass(n) @ d, exact, rtol=1e-12)


def test_a_point_mass_moves_with_both_translations_and_a_rotary_inertia_with_the_rotation() -> None:
    body = {"b": {"at": "bar.end", "mass": 5.0, "inertia": 0.25}}
    heavy = sum(t.coefficient * t.matrix.toarray() for t in chain(2, body).mass)
    added = heavy - mass(2)
    np.testing.assert_allclose(np.diag(added), [0, 0, 0, 0, 0, 0, 5.0, 5.0, 0.25], atol=1e-13)
    assert np.abs(added - np.diag(np.diag(added))).max() < 1e-15
