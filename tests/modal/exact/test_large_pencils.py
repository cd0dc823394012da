"""Samples of a large pencil, by Lanczos' method: the modes of each, and none missed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chains import model_of, two_link
from large import large
from scipy import sparse
from spatial_cases import linkage
from wide_draws import tree

from eigassign.errors import MissingMassError
from eigassign.mechanism import Pencil
from eigassign.modal import modes, rounding_error, solve_large

SAMPLES = 8


def agree(pencil: Pencil, x: np.ndarray, count: int) -> None:
    """Every sample has the frequencies and shapes of the dense solver."""
    theta = pencil.theta(x)
    found = solve_large(pencil, theta, count, True)
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


@pytest.mark.parametrize("seed", range(12))
def test_random_trees_have_the_modes_of_the_dense_solver(seed: int) -> None:
    drawn = tree("planar", seed, SAMPLES)
    pencil, x = drawn.model.pencil, drawn.model.x(drawn.q, drawn.y)
    agree(pencil, x, min(4, len(pencil.elastic) - 2))


def twins(arms: int = 3) -> dict[str, Any]:
    """A driven beam with equal beams fixed to its end: modes of these alone that no joint feels."""
    names = [f"arm{k}" for k in range(arms)]
    beam = {"material": "steel", "section": "rod", "elements": 4}
    return linkage(
        {
            "base": {"length": 0.5, **beam},
            "trunk": {"length": 0.3, **beam},
            **{name: {"length": 0.4, **beam} for name in names},
        },
        {
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
        {
            "q1": {"joint": "first", "drive": "locked"},
            "q2": {"joint": "hinge", "drive": "locked"},
        },
        sections={"rod": {"shape": "circle", "diameter": 0.02}},
        materials={"steel": {"youngs_modulus": 2e11, "density": 7800.0}},
    )


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_modes_that_no_joint_feels_are_found_and_cuts_may_fall_between_equal_ones(
    count: int,
) -> None:
    model = model_of(twins())
    q = np.linspace([0.0, -1.0], [0.5, 1.0], SAMPLES)
    agree(model.pencil, model.x(q, []), count)


def test_a_mode_without_mass_is_none_for_many_samples_either() -> None:
    """Beyond its inertia-bearing modes a model has no more, however many samples it has."""
    tree = two_link((4, 4))
    model = model_of(tree)
    x = model.x(np.linspace([0.0, 0.5], [0.0, 1.5], SAMPLES), [0.1, 0.1])
    pencil = model.pencil
    kept = np.isin(pencil.rows, np.append(pencil.elastic[:2], pencil.rigid))
    kept &= pencil.rows == pencil.columns  # some diagonal entries alone
    few = replace(pencil, mass=sparse.csr_array(sparse.diags_array(1.0 * kept) @ pencil.mass))
    theta = few.theta(x)
    with pytest.raises(MissingMassError):
        solve_large(few, theta, 6, False)
