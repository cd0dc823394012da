"""A link ten orders of magnitude stiffer than its neighbour is practically rigid."""

from __future__ import annotations

import numpy as np
from chains import model_of
from stress import case, judged

from eigassign.modal import expand, reduce

E = np.linspace(1e9, 4e9, 13)[:, None]
POSE = [0.2, 0.9]


def test_it_behaves_like_the_soft_link_clamped_to_the_ground():
    """To 1e-7, far above what the 1e-10 of flexibility left and round-off may do."""
    found = case("stiffness_ratio").model().frequencies(POSE, [2e9], 3)
    tree = {
        "mechanism": {
            "space": "planar",
            "materials": {"rubber": {"youngs_modulus": 2e9, "density": 1200.0}},
            "sections": {"bar": {"shape": "rectangle", "width": 0.02, "height": 0.015}},
            "links": {
                "arm": {"length": 0.5, "material": "rubber", "section": "bar", "elements": 4}
            },
            "joints": {"root": {"type": "fixed", "base": "ground", "follower": "arm.start"}},
        },
        "coordinates": {},
    }
    np.testing.assert_allclose(found, model_of(tree).frequencies([], [], 3), rtol=1e-7)


def test_expansion_and_reduced_model_know_their_errors():
    model = case("stiffness_ratio").model()
    expansion = expand(model.pencil, POSE, [2e9], (1, 2), order=6)
    reduced = reduce(model.pencil, POSE, [2e9], (1, 2), 2)
    judged(model, expansion, POSE, E)
    assert judged(model, reduced, POSE, E).max() < 1e-6
    turned = np.array(POSE) + np.column_stack([np.zeros(9), np.linspace(-1.0, 1.0, 9)])
    judged(model, reduced, turned, [2e9])
