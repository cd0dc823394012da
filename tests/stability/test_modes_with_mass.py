"""As many modes as have mass, whichever solver is asked: no ghosts, and no stiff mode lost."""

from typing import Any

import numpy as np
import pytest
from chains import bar, model_of, two_link
from scipy.linalg import eigh
from stress import ATLAS, case

from eigassign.errors import MissingMassError
from eigassign.modal import Model, expand, lowest_modes, reduce, solve_large

POSE = [0.3, 0.9]
ELEMENTS = 3  # of a link: 9 unknowns, and one more where its root turns


def arm(
    E: float, density: float, drives: tuple[Any, Any], tool: float, elements: int = ELEMENTS
) -> Model:
    """Two links of which the second one has no mass of its own."""
    tree = two_link(masses=(0.0, tool), elements=(ELEMENTS, elements), drives=drives, design={})
    mechanism = tree["mechanism"]
    steel = mechanism["materials"]["al"]
    mechanism["materials"]["ghost"] = {"youngs_modulus": E, "density": density}
    mechanism["links"]["fore"]["material"] = "ghost"
    assert steel["density"] > 0.0
    return model_of(tree)


def dense(model: Model, count: int) -> np.ndarray:
    return model.frequencies([POSE, POSE], [], count)[0]


def single(model: Model, count: int) -> np.ndarray:
    return model.modes(POSE, [], count)[0][0]


def batch(model: Model, count: int) -> np.ndarray:
    return model.modes([POSE, POSE], [], count)[0][1]


def sparse(model: Model, count: int) -> np.ndarray:
    theta = model.pencil.theta(model.x(POSE, []))
    found = solve_large(model.pencil, theta, count, False)
    return np.sqrt(found.lam[0]) / (2.0 * np.pi)


def reduced(model: Model, count: int) -> np.ndarray:
    return reduce(model.pencil, POSE, [], tuple(range(1, count + 1))).frequencies(POSE, [])[0]


def expansion(model: Model, count: int) -> np.ndarray:
    return expand(model.pencil, POSE, [], (count,), order=1).frequencies(POSE, [])[0]


SOLVERS = (dense, single, batch, sparse, reduced, expansion)

# What moves with mass: the first link's 3 * ELEMENTS unknowns and the turning of its root, and the
# two places of the tool; less what is held or moves as a rigid body.
WITH_MASS = [
    (("locked", "locked"), 0.0, 9),
    (("free", "locked"), 0.0, 9),
    (("locked", "locked"), 0.5, 11),
    (("free", "locked"), 0.5, 11),
    (("locked", "free"), 0.5, 10),
    (("free", "free"), 0.5, 10),
]


@pytest.mark.parametrize("E", [70e9, 1e6, 1e3])
@pytest.mark.parametrize("density", [0.0, 1e-30])
@pytest.mark.parametrize(("drives", "tool", "most"), WITH_MASS)
def test_a_link_without_mass_lends_no_modes(
    E: float, density: float, drives: tuple[str, str], tool: float, most: int
) -> None:
    model = arm(E, density, drives, tool)
    expected = dense(model, most)
    for solver in SOLVERS:
        np.testing.assert_allclose(solver(model, most)[-1], expected[-1], rtol=1e-5)
        with pytest.raises(MissingMassError, match=f"only {most} modes whose mass is") as caught:
            solver(model, most + 1)
        assert caught.value.most == most
    theta = model.pencil.theta(model.x(POSE, []))
    assert lowest_modes(model.pencil, theta, 1, 100).lam.shape == (1, most)


@pytest.mark.parametrize("density", [1e-30, 1e-20])
def test_a_drive_turning_almost_nothing_has_no_ghosts(density: float) -> None:
    """The free column's own mass is as small as the link's: W is of order one all the same."""
    for E in (70e9, 1e6):
        model = arm(E, density, ("locked", "free"), 0.0)
        for solver in SOLVERS:
            with pytest.raises(MissingMassError, match="has only 9 modes"):
                solver(model, 10)


def test_modes_to_the_last_one_are_eigenvectors() -> None:
    model = arm(1e6, 0.0, ("free", "free"), 0.5)
    hz, phi = model.modes(POSE, [], 10)
    M, K = model.matrices(POSE, [])
    np.testing.assert_allclose(phi[0].T @ M @ phi[0], np.eye(10), atol=1e-8)
    lam = (2.0 * np.pi * hz[0]) ** 2
    off = (phi[0].T @ K @ phi[0]) / np.sqrt(np.outer(lam, lam)) - np.eye(10)
    assert np.abs(off).max() < 1e-8
    assert model.n_rigid == 2


def highest(model: Model, q: Any, y: Any, count: int) -> np.ndarray:
    """The highest λ from K z = λ M_c z, whose round-off is ε of the highest."""
    x = model.x(q, y)
    (K,), (M,) = model.pencil.matrices(model.pencil.theta(x))
    E, F = model.pencil.elastic, model.pencil.rigid
    M_c = M[np.ix_(E, E)] - M[np.ix_(E, F)] @ np.linalg.solve(M[np.ix_(F, F)], M[np.ix_(F, E)])
    s = 1.0 / np.sqrt(np.diag(M_c))
    n = len(E)
    scaled = (s[:, None] * A * s for A in (K[np.ix_(E, E)], M_c))
    return eigh(*scaled, eigvals_only=True, subset_by_index=[n - count, n - 1])


@pytest.mark.parametrize("name", sorted(path.stem for path in ATLAS.glob("*.yaml")))
def test_no_stiff_mode_of_a_stress_case_is_lost(name: str) -> None:
    given = case(name)
    model, y = given.model(), given.initial_design
    q = np.full(len(model.q_names), 0.4)
    n = len(model.pencil.elastic)
    if n > 400:
        pytest.skip("a minute of dense algebra; the bar of 300 elements is as fine a mesh")
    lam = (2.0 * np.pi * model.frequencies(q, y, n)[0]) ** 2
    np.testing.assert_allclose(lam[-3:], highest(model, q, y, 3), rtol=1e-6)


def test_no_stiff_mode_of_a_fine_mesh_is_lost() -> None:
    """300 elements: the stiffest mode is at μ/μ_1 = 2e-13, below the round-off of μ by bound."""
    model = model_of(bar(300, 0.5, 70e9, 2700.0, {"area": 3e-4, "bending_inertia": 8e-9}))
    lam = (2.0 * np.pi * model.frequencies([], [], 900)[0]) ** 2
    assert lam[0] / lam[-1] < 1e-11
    np.testing.assert_allclose(lam[-20:], highest(model, [], [], 20), rtol=1e-7)
    few = (2.0 * np.pi * model.frequencies([], [], 3)[0]) ** 2
    np.testing.assert_allclose(lam[:3], few, rtol=1e-6)


def test_large_models_are_refused_where_round_off_begins() -> None:
    """Dense algebra would settle it, but not for more than 4000 unknowns."""
    with pytest.raises(MissingMassError, match="has only"):
        sparse(arm(1e6, 1e-30, ("free", "free"), 0.5, 1400), 12)
