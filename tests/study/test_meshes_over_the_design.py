"""Meshes are judged where they are worst: at mixed corners of the bounds, and at the optimum."""

import itertools

import numpy as np
from chains import Tree, case_of
from spatial_cases import linkage

from eigassign.mechanism import refined
from eigassign.study import build_model

ACCURACY = 1e-2


def mixed() -> Tree:
    """A cantilever of two rods: it errs most where one is thick and the other thin."""
    rod = {"length": 0.5, "material": "m", "elements": "auto"}
    sections = {name: {"shape": "circle", "diameter": 0.02} for name in ("inner", "outer")}
    bounds = {"min": 0.004, "max": 0.04}
    return linkage(
        {name: {**rod, "section": name} for name in sections},
        {
            "root": {"type": "fixed", "base": "ground", "follower": "inner.start"},
            "weld": {"type": "fixed", "base": "inner.end", "follower": "outer.start"},
        },
        sections=sections,
        material={"youngs_modulus": 7e10, "density": 2.7e3},
    ) | {
        "design": {k: {"parameter": f"sections.{k}.diameter", **bounds} for k in sections},
        "expansion": {"q": [], "accuracy": ACCURACY, "modes": [2]},
    }


def test_the_mesh_is_good_enough_at_every_corner_of_the_design() -> None:
    case = case_of(mixed())
    fine = build_model(refined(case.settled.file, 8.0)[0])
    error = [
        case.model().frequencies([], y, 2)[0, 1] / fine.frequencies([], y, 2)[0, 1] - 1.0
        for y in itertools.product((0.004, 0.04), repeat=2)
    ]
    assert max(error) <= 0.5 * ACCURACY
    assert max(error) <= case.settled.mesh.error <= 0.5 * ACCURACY
    assert np.argmax(error) in (1, 2)
