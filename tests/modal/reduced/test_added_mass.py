"""Mass that a design adds beside the basis: traces against full matrices, and the bound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import Tree, bar, model_of, two_link
from decoupled import comb
from large import large
from scipy.linalg import eigh
from spatial_random import random_closed

from eigassign.mechanism import Pencil, factorise
from eigassign.modal import added_mass, ritz_basis

Floats = np.ndarray
YOUNG, RHO, WIDTH, HEIGHT = 70e9, 2700.0, 0.02, 0.004


def made(pencil: Pencil, x0: Floats, half_order: int = 1) -> tuple[Any, Any]:
    basis = ritz_basis(pencil, x0[None], (1,), half_order, True, None)
    return basis, added_mass(pencil, factorise(basis.K0), x0, basis.V, basis.represented)


def at(added: Any, pencil: Pencil, x: Floats, x0: Floats) -> tuple[float, float]:
    q, y0 = x[: pencil.n_q], x0[pencil.n_q :]
    heavy = np.append(q, added.heaviest(x[None, pencil.n_q :], y0))
    most = added.lifted(pencil.theta(heavy), pencil.theta(np.append(q, y0)))
    return float(added.factor(pencil.theta(x))[0]), float(most[0])


def parameters(*paths: str) -> dict[str, Tree]:
    return {f"y{k}": {"parameter": p, "min": 0, "max": 1e12} for k, p in enumerate(paths)}


@pytest.mark.parametrize("drives", [("free", "free"), ("locked", "free"), ("locked", "locked")])
@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_traces_are_those_of_full_matrices(k: int, drives: tuple[str, str]) -> None:
    masses = ("bodies.tool_mass.mass", "materials.al.density", "bodies.elbow_mass.mass")
    tree = two_link(drives=drives, design=parameters(*masses))
    pencil = model_of(tree).pencil
    x0 = np.array([0.3, 1.1, 0.1, 2500.0, 0.2])
    basis, added = made(pencil, x0)
    x = x0 + np.array([0.7, -0.4, 0.0, 0.0, 0.0])
    turned = x.copy()
    x[2 + k] *= 1.7
    M, M_turned, M0 = (pencil.matrices(pencil.theta(row))[1] for row in (x, turned, x0))
    Z = np.zeros((pencil.n_dof, len(pencil.elastic)))
    Z[pencil.elastic] = np.eye(len(pencil.elastic))
    F, E = pencil.rigid, pencil.elastic
    Z[F] = -np.linalg.solve(M0[0][np.ix_(F, F)], M0[0][np.ix_(F, E)])
    H = np.linalg.inv(basis.K0.toarray()) - basis.V @ basis.V.T
    expected = np.trace(Z.T @ (M - M_turned)[0] @ Z @ H)
    heavier, most = at(added, pencil, x, x0)
    assert heavier == 1.0
    scale = 1e-9 * np.trace(Z.T @ (M - M_turned)[0] @ Z @ np.linalg.inv(basis.K0.toarray()))
    assert most == pytest.approx(max(expected, 0.0), rel=1e-6, abs=abs(scale))


def test_a_mass_on_a_part_beside_the_basis_costs_its_flexibility() -> None:
    """δ = L³/3EI across and L/EA along, for a cantilever's tip."""
    model, length = comb(12), 0.25 / 1.06**11
    _, added = made(model.pencil, np.array([0.0]))
    inertia, area = WIDTH * HEIGHT**3 / 12.0, WIDTH * HEIGHT
    flexibility = length**3 / (3.0 * YOUNG * inertia) + length / (YOUNG * area)
    assert at(added, model.pencil, np.array([0.1]), np.array([0.0]))[1] == pytest.approx(
        0.1 * flexibility, rel=1e-9
    )
    assert at(added, model.pencil, np.array([0.0]), np.array([0.1]))[1] == 0.0


def test_a_mass_that_moves_with_a_mode_of_the_basis_costs_next_to_nothing() -> None:
    tree = bar(
        4, 0.25, YOUNG, RHO, {"shape": "rectangle", "width": WIDTH, "height": HEIGHT}, "fixed"
    )
    tree["mechanism"]["bodies"] = {"tip": {"at": "bar.end", "mass": 0.0}}
    tree["design"] = parameters("bodies.tip.mass")
    model = model_of(tree)
    _, added = made(model.pencil, np.array([0.02]), 2)
    mu = 1.0 / (2.0 * np.pi * model.frequencies([], [0.1], 1)[0, 0]) ** 2
    assert at(added, model.pencil, np.array([0.1]), np.array([0.02]))[1] < 1e-3 * mu


def test_what_one_mass_loses_does_not_pay_for_what_another_gains() -> None:
    model = comb(12, bodies=(10, 11))
    x0 = np.array([0.05, 0.05])
    _, added = made(model.pencil, x0)
    alone = at(added, model.pencil, np.array([0.05, 0.1]), x0)[1]
    assert alone > 0.0
    both = at(added, model.pencil, np.array([0.0, 0.1]), x0)[1]
    assert both == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_modes_beside_the_basis_stay_below_the_bound(seed: int) -> None:
    """μ_max of M_c beside V from full matrices; no joint, so that K is the same everywhere."""
    rng = np.random.default_rng(seed)
    model = comb(6, bodies=(2, 4, 5), densities=(1,))
    x0 = np.append(rng.uniform(0.0, 0.02, 3), RHO)
    basis, added = made(model.pencil, x0)
    complement = np.linalg.svd((basis.K0 @ basis.V).T)[2][basis.V.shape[1] :].T

    def beside(x: Floats) -> float:
        M = model.pencil.matrices(model.pencil.theta(x))[1][0]
        K, M = (complement.T @ A @ complement for A in (basis.K0.toarray(), M))
        return float(eigh(M, K, eigvals_only=True)[-1])

    for _ in range(20):
        x = np.append(rng.uniform(0.0, 0.3, 3), RHO * rng.uniform(0.5, 8.0))
        assert beside(x) <= (beside(x0) + at(added, model.pencil, x, x0)[1]) * (1.0 + 1e-9)


def test_a_mechanism_without_design_adds_none() -> None:
    tree, q = random_closed(7, "planar", 1)[:2]
    pencil = model_of(tree).pencil
    _, added = made(pencil, q)
    assert at(added, pencil, q, q) == (1.0, 0.0)


def test_parts_with_many_unknowns_are_scaled() -> None:
    """A tine of five elements has 15 unknowns, its tip three."""
    model = comb(6, bodies=(5,), densities=(1,), elements=5)
    pencil, x0 = large(model.pencil), np.array([0.01, RHO])
    _, added = made(pencil, x0)
    heavier, most = at(added, pencil, np.array([0.02, 3.0 * RHO]), x0)
    assert heavier == pytest.approx(3.0)
    assert most > 0.0
    assert at(added, pencil, np.array([0.01, 0.5 * RHO]), x0) == (1.0, 0.0)
