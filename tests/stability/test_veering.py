"""Two frequencies that veer with gaps from 1e-1 down to 1e-8: a branch point ever nearer."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of
from stress import case, judged

from eigassign.modal import Model, expand, reduce

E0 = 70e9
# Length of the stub in m and factor on its modulus that leave these relative gaps in frequency.
GAPS = {1e-1: (0.3, 0.05), 1e-2: (0.5, 1.0), 1e-3: (0.1, 1.0), 1e-5: (0.1, 1e2), 1e-8: (0.1, 1e5)}


def coupled(stub: tuple[float, float]) -> Model:
    length, factor = stub
    bar = {"section": "rod", "length": 0.5, "elements": 3}
    tree = {
        "mechanism": {
            "space": "planar",
            "materials": {
                "first": {"youngs_modulus": E0, "density": 2700.0},
                "second": {"youngs_modulus": E0, "density": 2700.0},
                "block": {"youngs_modulus": factor * E0, "density": 2700.0},
            },
            "sections": {
                "rod": {"area": 3e-4, "bending_inertia": 8e-9},
                "thick": {"area": 3e-2, "bending_inertia": 8e-6},
            },
            "links": {
                "stub": {"section": "thick", "length": length, "material": "block", "elements": 1},
                "one": {**bar, "material": "first"},
                "two": {**bar, "material": "second"},
            },
            "joints": {
                "root": {"type": "fixed", "base": "ground", "follower": "stub.start"},
                "left": {"type": "fixed", "base": "stub.end", "follower": "one.start"},
                "right": {
                    "type": "fixed",
                    "base": "stub.end",
                    "follower": "two.start",
                    "angle": 1.0,
                },
            },
        },
        "coordinates": {},
        "design": {"E": {"parameter": "materials.second.youngs_modulus", "min": 6e10, "max": 8e10}},
    }
    return model_of(tree)


@pytest.mark.parametrize("gap", GAPS)
def test_tracking_finds_the_gap(gap):
    model = coupled(GAPS[gap])
    tracked = model.tracked([], np.linspace(6e10, 8e10, 22)[:, None], (1, 2))
    found = [e for e in tracked.encounters if e.lower == 1]
    assert len(found) == 1
    assert found[0].gap == pytest.approx(gap, rel=0.6)
    assert tracked.certain.all()


@pytest.mark.parametrize("gap", GAPS)
def test_a_single_mode_admits_how_wrong_it_is_across_the_veering(gap):
    model = coupled(GAPS[gap])
    E = np.linspace(6.6e10, 7.4e10, 41)[:, None]
    expansion = expand(model.pencil, [], [6.7e10], (1,), order=8, cluster_gap=0.0)
    judged(model, expansion, [], E)


@pytest.mark.parametrize("gap", GAPS)
def test_both_modes_as_a_cluster_are_right_across_it(gap):
    model = coupled(GAPS[gap])
    E = np.linspace(6.6e10, 7.4e10, 41)[:, None]
    together = max(0.02, 3.0 * gap)
    expansion = expand(model.pencil, [], [E0], (1, 2), order=8, cluster_gap=together)
    assert [c.modes for c in expansion.clusters] == [(1, 2)]
    assert judged(model, expansion, [], E).max() < 1e-8


@pytest.mark.parametrize("gap", GAPS)
def test_the_reduced_model_is_right_across_it(gap):
    model = coupled(GAPS[gap])
    E = np.linspace(6e10, 8e10, 41)[:, None]
    reduced = reduce(model.pencil, [], [6.7e10], (1, 2), 3)
    assert judged(model, reduced, [], E).max() < 1e-8


def test_the_shipped_case_veers_by_a_tenth_of_a_percent():
    (met,) = case("veering").model().tracked([], np.linspace(6e10, 8e10, 20)[:, None]).encounters
    assert met.gap == pytest.approx(1e-3, rel=0.05)
