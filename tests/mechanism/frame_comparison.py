"""The pencil of a mechanism against the plain frame program: one discretisation, other unknowns.

The spectra agree to round-off. That is the machine's 1e-16 times the ratio of the stiffest entry
(EA/h, 1e9) to the lowest modes' (1e3) or so, amplified by loops near (not at) a dead point; over
1600 random poses the worst was 3e-9.
"""

import numpy as np
from spatial_cases import Built, built
from spatial_oracle import Tree, World, world
from spatial_random import nodes

TOLERANCE = 3e-8


def agree(tree: Tree, poses: tuple[np.ndarray, ...]) -> None:
    model = built(tree)
    for q in poses:
        frame = world(tree, q)
        same_spectrum(model, frame, q)
        same_places(model, frame, tree, q)


def same_spectrum(model: Built, frame: World, q: np.ndarray) -> None:
    K, _ = frame.projected()
    assert model.pencil.n_dof == len(K)
    assert len(model.pencil.rigid) == frame.n_free
    count = min(6, model.n_elastic)
    np.testing.assert_allclose(model.lam(q, count), frame.spectrum(count), rtol=TOLERANCE)


def same_places(model: Built, frame: World, tree: Tree, q: np.ndarray) -> None:
    for link in tree["mechanism"]["links"]:
        for node in nodes(tree, link):
            here = model.poses.position(model.x(q), link, node)[0]
            np.testing.assert_allclose(here, frame.pose.node(tree, f"{link}.{node}"), atol=1e-9)
