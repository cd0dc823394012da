"""What the weight changes of frequencies, when it is not stated: by stress, and by sag."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eigassign as ea
from eigassign.modal import buckling, sag_of_nodes, weight_changes

STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0, "shear_modulus": 8e10}


def boom(length: float, load: float, **more: Any) -> dict[str, Any]:
    """A tube of 600 × 12 mm at 80° with a load at its tip."""
    tube = {"length": length, "elements": 8, "material": "steel", "section": "tube"}
    return {
        "title": "a boom",
        "mechanism": {
            "space": "planar",
            "materials": {"steel": dict(STEEL)},
            "sections": {"tube": {"shape": "tube", "outer_diameter": 0.6, "thickness": 0.012}},
            "links": {"boom": tube},
            "joints": {
                "foot": {"type": "revolute", "base": "ground", "follower": "boom.start"},
            },
            "bodies": {"load": {"at": "boom.end", "mass": load}},
            **more,
        },
        "coordinates": {"luff": {"joint": "foot", "drive": "locked"}},
    }


def test_a_boom_loses_as_much_as_it_loses_with_stated_gravity() -> None:
    q, weight = [np.radians(80.0)], np.array([0.0, -9.81])
    model = ea.load_case(boom(40.0, 8000.0)).model()
    stated = ea.load_case(boom(40.0, 8000.0, gravity=weight.tolist())).model()
    plain, loaded = (one.frequencies(q, [], 1)[0, 0] for one in (model, stated))
    np.testing.assert_allclose([plain, loaded], [0.1574, 0.1305], atol=5e-5)
    found = weight_changes(model, q, [], (1,))
    exact = (loaded / plain) ** 2 - 1.0
    assert found.stress[0, 0] @ weight == pytest.approx(exact, rel=0.02)
    assert abs(found.sag[0, 0] @ weight) < 1e-4  # a straight link is but shortened


def test_modes_that_are_not_near_mix_under_weight_too() -> None:
    """One rod up and one down, a spring between them: neither mode feels the weight by itself."""
    rod = {"type": "rigid", "length": 1.0, "mass": 0.0}
    ends = {"a": "q1", "b": "q2"}
    tree = {
        "title": "twins",
        "mechanism": {
            "space": "planar",
            "links": dict.fromkeys(ends, rod),
            "joints": {
                name: {"type": "revolute", "base": "ground", "follower": f"{name}.start"}
                for name in ends
            },
            "bodies": {name: {"at": f"{name}.end", "mass": 1.0} for name in ends},
            "springs": {"s": {"between": ["a.start", "b.start"], "rotational": 1.0}},
        },
        "coordinates": {
            q: {"joint": name, "drive": {"stiffness": 20.0}} for name, q in ends.items()
        },
    }
    q = [np.pi / 2, -np.pi / 2]
    model = ea.load_case(tree).model()
    found = weight_changes(model, q, [], (1, 2))
    np.testing.assert_allclose(found.stress, 0.0, atol=1e-12)
    tree["mechanism"]["gravity"] = [0.0, -9.81]
    plain, stated = (m.frequencies(q, [], 2)[0] for m in (model, ea.load_case(tree).model()))
    most = 9.81 * np.linalg.norm(found.stress_mixing[0], axis=1)
    true = np.abs((stated / plain) ** 2 - 1.0)
    assert (true <= most * (1.0 + 1e-9)).all()
    assert (most <= 1.3 * true).all()


def test_buckling_is_eulers() -> None:
    EI = 2.1e11 * np.pi / 64 * (0.6**4 - 0.576**4)
    tree = boom(40.0, 8000.0, gravity=[0.0, -9.81])
    tree["mechanism"]["materials"]["steel"]["density"] = 1e-3
    model = ea.load_case(tree).model()
    share = buckling(model, [[np.pi / 2], [-np.pi / 2]], [])
    euler = 8000.0 * 9.81 / (np.pi**2 * EI / (4 * 40.0**2))
    np.testing.assert_allclose(share, [euler, 0.0], rtol=1e-4, atol=1e-9)


def test_a_drive_that_gives_way_buckles_too() -> None:
    tree = boom(2.0, 50.0, gravity=[0.0, -9.81])
    tree["mechanism"]["links"]["boom"] = {"type": "rigid", "length": 2.0, "mass": 0.0}
    tree["coordinates"]["luff"]["drive"] = {"stiffness": 4000.0}
    model = ea.load_case(tree).model()
    share = buckling(model, [[np.pi / 2], [0.0], [-np.pi / 2]], [])
    most = 50.0 * 9.81 * 2.0 / 4000.0
    np.testing.assert_allclose(share, [most, 0.0, 0.0], rtol=1e-12, atol=1e-15)


def test_the_sag_of_a_cantilever() -> None:
    EI = 2.1e11 * np.pi / 64 * (0.6**4 - 0.576**4)
    weight = 7850.0 * np.pi / 4 * (0.6**2 - 0.576**2) * 9.81
    names, found = sag_of_nodes(ea.load_case(boom(40.0, 800.0)).model(), [0.0], [], [0.0, -9.81])
    expected = weight * 40.0**4 / (8 * EI) + 800.0 * 9.81 * 40.0**3 / (3 * EI)
    assert names == ("boom.start", "boom.end")
    turned = weight * 40.0**3 / (6 * EI) + 800.0 * 9.81 * 40.0**2 / (2 * EI)
    there = [[0.0] * 6, [0.0, -expected, 0.0, 0.0, 0.0, -turned]]
    np.testing.assert_allclose(found[0], there, atol=1e-9 * expected)
