"""Beam element matrices: the published values."""

from __future__ import annotations

from typing import Any

import numpy as np
from chains import bar
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
