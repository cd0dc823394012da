"""Links of several beams: the same as one beam, and where their sections lie."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import ALLOY, STEEL, built
from spatial_oracle import Tree, world

from eigassign.errors import CaseError


def cantilever(space: str, link: Tree, follower: str = "link.start") -> Tree:
    return {
        "mechanism": {
            "space": space,
            "materials": {"m": ALLOY, "steel": STEEL},
            "sections": {
                "s": {"shape": "rectangle", "width": 0.02, "height": 0.05},
                "bar": {"shape": "tube", "outer_diameter": 0.02, "thickness": 0.002},
            },
            "links": {"link": link},
            "joints": {
                "root": {"type": "revolute", "base": "ground", "follower": follower}
            },
            "bodies": {"tip": {"at": "link.end", "mass": 0.4}},
        },
        "coordinates": {"q": {"joint": "root", "drive": {"stiffness": 2e4}}},
    }  # fmt: skip


def frame(nodes: Tree, beams: list[tuple[str, str, int]], **more: object) -> Tree:
    parts = {
        f"b{k}": {"from": a, "to": b, "elements": n, "material": "m", "section": "s", **more}
        for k, (a, b, n) in enumerate(beams)
    }
    return {"type": "frame", "nodes": nodes, "beams": parts}


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("shear", [False, True])
def test_collinear_beams_are_one_beam(space: str, shear: bool) -> None:
    pad = [0.0] * (1 if space == "planar" else 2)
    nodes = {"start": [0.0, *pad], "middle": [0.4, *pad], "end": [1.0, *pad]}
    several = frame(nodes, [("start", "middle", 2), ("middle", "end", 3)], shear=shear)
    one = {"length": 1.0, "elements": 5, "material": "m", "section": "s", "shear": shear}
    a, b = (built(cantilever(space, link)).lam([0.3], 8) for link in (several, one))
    np.testing.assert_allclose(a, b, rtol=1e-9)


@pytest.mark.parametrize("direction", [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8]])
def test_the_height_of_an_upright_beams_section_lies_where_the_manual_says(
    direction: list[float],
) -> None:
    """y is z × x, across the upright plane of the beam, and the link's y for a vertical beam."""
    tree = cantilever(
        "spatial", frame({"start": [0.0] * 3, "end": direction}, [("start", "end", 4)])
    )
    tree["mechanism"]["joints"]["root"]["type"] = "fixed"
    tree["coordinates"] = {}
    plain = built(tree).lam([], 2)
    tree["mechanism"]["springs"] = {
        "side": {"between": ["link.end", "ground"], "translational": [0.0, 1e6, 0.0]}
    }
    held = built(tree).lam([], 1)
    # height 50 mm resists sideways bending: held there, the weak mode stays the lowest
    np.testing.assert_allclose(held[0], plain[0], rtol=1e-8)
    np.testing.assert_allclose(held[0], world(tree, []).spectrum(1)[0], rtol=1e-8)


def test_a_node_that_no_beam_reaches_is_refused() -> None:
    nodes = {"start": [0.0, 0.0], "end": [1.0, 0.0], "lost": [0.5, 0.5]}
    tree = cantilever("planar", frame(nodes, [("start", "end", 2)]))
    with pytest.raises(CaseError, match="no beams connect lost"):
        built(tree)
