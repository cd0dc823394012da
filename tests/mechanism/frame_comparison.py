"""The pencil of a mechanism against the plain frame program: one discretisation, other unknowns.

The spectra agree to round-off. That is the machine's 1e-16 times the ratio of the stiffest entry
(EA/h, 1e9) to the lowest modes' (1e3) or so, amplified by loops near (not at) a dead point; over
1600 random poses the worst was 3e-9.
"""

import numpy as np
from spatial_cases import built
from spatial_oracle import Tree, world
from spatial_random import nodes

TOLERANCE = 3e-8


def agree(tree: Tree, poses: tuple[np.ndarray, ...]) -> None:
    model = built(tree)
    for q in poses:
        frame = world(tree, q)
        assert model.pencil.n_dof == len(frame.projected()[0])
        assert len(model.pencil.rigid) == frame.n_free
        count = min(6, model.n_elastic)
        np.testing.assert_allclose(model.lam(q, count), frame.spectrum(count), rtol=TOLERANCE)
        for link in tree["mechanism"]["links"]:
            for node in nodes(tree, link):
                here = model.poses.position(model.x(q), link, node)[0]
                np.testing.assert_allclose(here, frame.pose.node(tree, f"{link}.{node}"), atol=1e-9)
