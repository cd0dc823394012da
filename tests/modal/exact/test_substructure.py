"""Many samples of a large pencil together: the modes of every sample, and none without proof."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import model_of, random_chain, two_link
from large import large
from scipy import sparse
from scipy.linalg import eigh

import eigassign as ea
from eigassign.errors import MissingMassError
from eigassign.mechanism import Pencil, factorise
from eigassign.modal import (
    Inner,
    modes,
    proved,
    rounding_error,
    solve_large,
    solve_sparse,
    solve_together,
)

CASES = sorted((Path(__file__).parents[3] / "cases").glob("*.yaml"))
SAMPLES = 24


def agree(pencil: Pencil, x: np.ndarray, count: int) -> None:
    """Every sample is proved, with the frequencies and shapes of the dense solver."""
    theta = pencil.theta(x)
    together = solve_together(pencil, theta, count, True)
    assert together is not None
    found, sure = together
    assert sure.all()
    dense = modes(large(pencil, 10**6), x, count + 1)
    rounding = max(rounding_error(pencil, row, count) for row in x[:: len(x) // 4])
    hz, expected = np.sqrt(found.lam), np.sqrt(dense.lam[:, :count])
    # both hold the round-off of the matrices; what is left is second order in residuals of 1e-9
    np.testing.assert_allclose(hz, expected, rtol=max(1e-11, 20.0 * rounding))
    for k in range(len(x)):
        M = pencil.mass_matrices(theta[:, [k]])[0]
        gram = found.phi[k].T @ M @ found.phi[k]
        np.testing.assert_allclose(gram, np.eye(count), atol=max(1e-8, 1e3 * rounding))
        across = dense.phi[k].T @ M @ found.phi[k]
        lam = np.append(dense.lam[k], 2.0 * dense.lam[k, -1])
        alike = np.abs(dense.lam[k][:, None] / found.lam[k] - 1.0) < 1e-6
        apart = (np.abs(across) ** 2 * ~alike).sum(axis=0)
        if (np.diff(lam[: count + 1]) > 1e-6 * lam[:count]).all():
            assert apart.max() < max(1e-12, (1e3 * rounding) ** 2)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_shipped_cases_have_the_modes_of_the_dense_solver(path: Path) -> None:
    case = ea.load_case(path)
    if case.file.trajectory is None:
        pytest.skip("no trajectory")
    model = case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    agree(model.pencil, x, min(4, len(model.pencil.elastic) - 2))


@pytest.mark.parametrize("seed", range(12))
def test_random_chains_have_the_modes_of_the_dense_solver(seed: int) -> None:
    tree, q = random_chain(seed)
    model = model_of(tree)
    rng = np.random.default_rng(seed)
    x = model.x(q + rng.uniform(-1.0, 1.0, (SAMPLES, np.size(q))), [])
    agree(model.pencil, x, min(4, len(model.pencil.elastic) - 2))


@pytest.mark.parametrize("drives", [("free", "free"), ("locked", {"stiffness": 2e3})])
def test_a_design_parameter_may_vary_where_few_unknowns_feel_it(drives: tuple[Any, Any]) -> None:
    model = model_of(two_link((9, 7), drives=drives))
    rng = np.random.default_rng(1)
    x = model.x(rng.uniform(-2.0, 2.0, (SAMPLES, 2)), rng.uniform(0.05, 0.25, (SAMPLES, 2)))
    agree(model.pencil, x, 4)


def test_samples_that_are_all_alike_have_no_varying_unknown() -> None:
    model = model_of(two_link((9, 7), drives=("locked", "locked")))
    x = model.x(np.tile([0.3, 1.9], (SAMPLES, 1)), [0.1, 0.1])
    agree(model.pencil, x, 4)


def twins(arms: int = 3) -> dict[str, Any]:
    """A driven beam with equal beams fixed to its end: modes of these alone that no joint feels."""
    names = [f"arm{k}" for k in range(arms)]
    beam = {"material": "steel", "section": "rod", "elements": 4}
    return {
        "mechanism": {
            "space": "planar",
            "materials": {"steel": {"youngs_modulus": 2e11, "density": 7800.0}},
            "sections": {"rod": {"shape": "circle", "diameter": 0.02}},
            "links": {
                "base": {"length": 0.5, **beam},
                "trunk": {"length": 0.3, **beam},
                **{name: {"length": 0.4, **beam} for name in names},
            },
            "joints": {
                "first": {"type": "revolute", "base": "ground", "follower": "base.start"},
                "hinge": {"type": "revolute", "base": "base.end", "follower": "trunk.start"},
                **{
                    f"at_{name}": {
                        "type": "fixed",
                        "base": "trunk.end",
                        "follower": f"{name}.start",
                        "angle": 2.0 * np.pi * k / arms,
                    }
                    for k, name in enumerate(names)
                },
            },
        },
        "coordinates": {
            "q1": {"joint": "first", "drive": "locked"},
            "q2": {"joint": "hinge", "drive": "locked"},
        },
    }


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_modes_that_no_joint_feels_are_found_and_cuts_may_fall_between_equal_ones(
    count: int,
) -> None:
    model = model_of(twins())
    q = np.linspace([0.0, -1.0], [0.5, 1.0], SAMPLES)
    agree(model.pencil, model.x(q, []), count)


def test_answers_are_the_same_every_time() -> None:
    model = model_of(twins())
    theta = model.pencil.theta(model.x(np.linspace([0.0, -1.0], [0.5, 1.0], SAMPLES), []))
    first, second = (solve_large(model.pencil, theta, 3, True) for _ in range(2))
    np.testing.assert_array_equal(first.lam, second.lam)
    np.testing.assert_array_equal(first.phi, second.phi)


# --- The proof


def operators(n: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """K, M, and the eigenvalues of T = K⁻¹M, descending, with K-orthonormal vectors."""
    rng = np.random.default_rng(3)
    A, B = rng.standard_normal((2, n, n))
    K, M = A @ A.T + n * np.eye(n), B @ B.T
    mu, z = eigh(M, K)
    return K, M, mu[::-1], z[:, ::-1]


def inner_with(K: np.ndarray, M: np.ndarray, vectors: np.ndarray) -> Inner:
    stiff = sparse.csc_array(K)
    inner = Inner.empty(stiff, sparse.csc_array(M), factorise(stiff))
    inner, coordinates = inner.spanning(vectors)
    return inner.with_vectors(coordinates)


def outside(K: np.ndarray, M: np.ndarray, W: np.ndarray) -> float:
    """The largest eigenvalue of T on what is K-orthogonal to W."""
    rest = np.linalg.svd(W.T @ K)[2][W.shape[1] :].T
    return float(eigh(rest.T @ M @ rest, rest.T @ K @ rest, eigvals_only=True)[-1])


def test_a_forged_basis_that_misses_a_mode_is_caught() -> None:
    K, M, mu, z = operators()
    nu = 0.5 * (mu[4] + mu[5])
    assert inner_with(K, M, z[:, :5]).largest_outside(nu) is not None
    for missed in range(5):
        forged = np.delete(z[:, :5], missed, axis=1)
        assert inner_with(K, M, forged).largest_outside(nu) is None
        more = np.hstack([forged, z[:, 7:12]])
        assert inner_with(K, M, more).largest_outside(nu) is None


@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-3, 1e-2])
def test_what_the_basis_leaves_out_is_bounded(noise: float) -> None:
    K, M, mu, z = operators()
    rng = np.random.default_rng(5)
    W = z[:, :5] + noise * rng.standard_normal((len(K), 5)) / np.sqrt(len(K) * np.trace(K))
    bound = inner_with(K, M, W).largest_outside(0.5 * (mu[4] + mu[5]))
    assert bound is not None
    assert outside(K, M, W) <= bound * (1.0 + 1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_pairs_called_proved_are_those_of_the_lowest_modes(seed: int) -> None:
    """Against a whole symmetric matrix of which the pairs see one part."""
    rng = np.random.default_rng(seed)
    p, rest, count = 6, 8, 3
    mu = np.sort(rng.uniform(0.2, 1.0, p))[::-1]
    mu[:count] *= rng.uniform(1.0, 3.0)
    B = rng.standard_normal((rest, rest))
    D = B @ B.T
    D *= rng.uniform(0.1, 1.2) * mu[count - 1] / np.linalg.eigvalsh(D)[-1]
    size = np.where(np.arange(p) < count, 1e-8, rng.choice([1e-6, 0.1, 1.0]))
    rho = rng.standard_normal((rest, p)) * size * mu / np.sqrt(rest)
    whole = np.block([[np.diag(mu), rho.T], [rho, D]])
    nu = float(np.linalg.eigvalsh(D)[-1])
    if proved(mu[None], rho[None], np.array([count]), nu)[0]:
        exact = np.linalg.eigvalsh(whole)[::-1][:count]
        np.testing.assert_allclose(mu[:count], exact, rtol=1e-12)


def test_samples_that_are_not_proved_are_solved_alone() -> None:
    """At every third sample nine bars are alike: of six equal modes no cut lies apart."""
    names = [f"arm{k}" for k in range(9)]
    tree = twins(len(names))
    tree["mechanism"]["bodies"] = {name: {"at": f"{name}.end", "mass": 0.0} for name in names}
    tree["design"] = {
        name: {"parameter": f"bodies.{name}.mass", "min": 0.0, "max": 1.0} for name in names
    }
    model = model_of(tree)
    y = np.tile(0.05 * 1.8 ** np.arange(len(names)), (SAMPLES, 1))
    y[::3] = 0.05
    theta = model.pencil.theta(model.x(np.linspace([0.0, -1.0], [0.5, 1.0], SAMPLES), y))
    together = solve_together(model.pencil, theta, 4, True)
    assert together is not None
    alike = np.arange(SAMPLES) % 3 == 0
    np.testing.assert_array_equal(together[1], ~alike)
    alone, mixed = (solve(model.pencil, theta, 4, True) for solve in (solve_sparse, solve_large))
    np.testing.assert_array_equal(mixed.lam[alike], alone.lam[alike])
    np.testing.assert_array_equal(mixed.phi[alike], alone.phi[alike])
    x = model.x(np.linspace([0.0, -1.0], [0.5, 1.0], SAMPLES), y)
    rounding = max(rounding_error(model.pencil, row, 4) for row in x[1::3])
    # each is off by twice the round-off of frequencies, which is 1.5e-9 here
    np.testing.assert_allclose(mixed.lam, alone.lam, rtol=max(1e-9, 4.0 * rounding))


def test_a_mode_without_mass_is_none_for_many_samples_either() -> None:
    """Beyond its inertia-bearing modes a model has no more, however many samples it has."""
    tree = two_link((4, 4))
    model = model_of(tree)
    x = model.x(np.linspace([0.0, 0.5], [0.0, 1.5], SAMPLES), [0.1, 0.1])
    pencil = model.pencil
    few = Pencil(
        **{
            **{name: getattr(pencil, name) for name in pencil.__dataclass_fields__},
            "mass": _only_at(pencil, np.append(pencil.elastic[:2], pencil.rigid)),
        }
    )
    theta = few.theta(x)
    with pytest.raises(MissingMassError):
        solve_large(few, theta, 6, False)


def _only_at(pencil: Pencil, dofs: np.ndarray) -> sparse.csr_array:
    """The pencil's mass at some diagonal entries alone."""
    keep = (pencil.rows == pencil.columns) & np.isin(pencil.rows, dofs)
    return sparse.csr_array(sparse.diags_array(keep.astype(float)) @ pencil.mass)
