"""K = Bᵀ k B and M = Bᵀ m B: the assembled pencil against the product with B written out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from spatial_cases import Built, built
from spatial_examples import arm3r, four_bar
from spatial_oracle import Tree
from spatial_random import random_closed, random_open

from eigassign.mechanism import local_links, motion_matrix, motion_scalars, total


def products(model: Built, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Σ Bᵀ k B and Σ Bᵀ m B over all links, with numbers."""
    links, nodes = local_links(model.case, model.numbers, model.motion)
    n = model.pencil.n_dof
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for link in links:
        *scalars, kappa, mu = numbers(model, link, q)
        B, factors = motion_matrix(link, scalars, nodes.count, n).toarray(), (kappa, mu)
        for matrix, terms, values in zip((K, M), (link.stiffness, link.mass), factors, strict=True):
            if terms:
                matrix += B.T @ (total(terms, values) @ B)
    return K, M


def numbers(model: Built, link: Any, q: np.ndarray) -> list[np.ndarray]:
    groups = [[t.coefficient for t in terms] for terms in (link.stiffness, link.mass)]
    arrays = [*motion_scalars(link), *(np.array(group, dtype=object) for group in groups)]
    return [values[0] for values in model.poses.values(model.x(q), arrays)]


def trees() -> list[tuple[Tree, np.ndarray]]:
    pairs = [(seed, space) for seed in range(8) for space in ("planar", "spatial")]
    drawn = [random_open(*pair) for pair in pairs] + [random_closed(*pair)[::2] for pair in pairs]
    return [(arm3r("locked"), np.array([0.3, 0.5, -0.9])), (four_bar("free"), np.zeros(1)), *drawn]


def links_alone(tree: Tree) -> bool:
    """Whether K is that of the links alone: neither springs nor drives."""
    drives = [c.get("drive", "free") for c in tree["coordinates"].values()]
    return not tree["mechanism"].get("springs") and all(isinstance(d, str) for d in drives)


@pytest.mark.parametrize(("tree", "q"), trees())
def test_stiffness_and_mass_are_the_products_of_equation_1(tree: Tree, q: np.ndarray) -> None:
    model = built(tree)
    K, M = model.pencil.matrices(model.pencil.theta(model.x(q)))
    links_K, links_M = products(model, q)
    pairs = [(M[0], links_M)] + [(K[0], links_K)] * links_alone(tree)
    for found, expected in pairs:  # k N = 0 but for round-off of k, whose entries are those of K
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
