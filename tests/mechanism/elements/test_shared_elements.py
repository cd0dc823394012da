"""What is built once and shared gives the same matrices as what is built one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import Tree, model_of
from spatial_cases import built

from eigassign.mechanism import local_links

TAPER = {"start": "thick", "end": "thin"}


def tapered(shape: str, shear: bool, design: Tree) -> Tree:
    """One spatial beam on a hinge, tapering from thick to thin."""
    sizes: dict[str, tuple[Any, Any]] = {
        "tube": ({"outer_diameter": 0.05, "thickness": 0.004}, {"outer_diameter": 0.03}),
        "rectangle": ({"width": 0.02, "height": 0.05}, {"height": 0.03}),
        "box": ({"width": 0.03, "height": 0.05, "thickness": 0.003}, {"height": 0.03}),
    }
    thick, change = sizes[shape]
    thick = {"shape": shape, **thick}
    beam = {"length": 0.7, "material": "m", "section": TAPER, "elements": 5, "shear": shear}
    return {
        "mechanism": {
            "space": "spatial",
            "materials": {"m": {"youngs_modulus": 7e10, "density": 2.7e3, "poissons_ratio": 0.33}},
            "sections": {"thick": thick, "thin": {**thick, **change}},
            "links": {"beam": {**beam, "roll": 0.3}},
            "joints": {"hinge": {"type": "revolute", "base": "ground", "follower": "beam.start"}},
        },
        "coordinates": {"q": {"joint": "hinge"}},
        "design": design,
    }


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("shape", ["tube", "rectangle", "box"])
def test_a_taper_of_numbers_is_the_taper_of_a_design_at_its_value(shape: str, shear: bool) -> None:
    # elements one by one, as expressions in E, against all at once, as arrays
    E = {"parameter": "materials.m.youngs_modulus", "min": 6e10, "max": 8e10}
    varying = model_of(tapered(shape, shear, {"E": E}))
    given = model_of(tapered(shape, shear, {}))
    for a, b in zip(varying.matrices([0.4], [7e10]), given.matrices([0.4], []), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-13 * np.abs(b).max())


def twins(second: Tree, bodies: Tree | None = None, design: Tree | None = None) -> Tree:
    """Two beams on two hinges in a row, alike but for what ``second`` changes."""
    beam = {"length": 0.5, "material": "m", "section": "rod", "elements": 3}
    joint = {"type": "revolute", "base": "ground", "follower": "one.start"}
    return {
        "mechanism": {
            "space": "planar",
            "materials": {"m": {"youngs_modulus": 7e10, "density": 2.7e3}},
            "sections": {name: {"shape": "circle", "diameter": 0.02} for name in ("rod", "bar")},
            "links": {"one": beam, "two": {**beam, **second}},
            "joints": {
                "a": joint,
                "b": {**joint, "base": "one.end", "follower": "two.start"},
            },
            "bodies": bodies or {},
        },
        "coordinates": {"q1": {"joint": "a"}, "q2": {"joint": "b"}},
        "design": design or {},
    }


def shared(tree: Tree) -> bool:
    model = built(tree)
    one, two = local_links(model.case, model.numbers, model.motion)[0]
    return one.stiffness is two.stiffness and one.mass is two.mass


def test_copies_of_a_beam_share_their_mesh_and_nothing_else_does() -> None:
    length = {"parameter": "links.two.length", "min": 0.4, "max": 0.6}
    assert shared(twins({}))
    assert not shared(twins({"length": 0.6}))
    assert not shared(twins({"section": "bar"}))
    assert not shared(twins({"elements": 4}))
    assert not shared(twins({}, bodies={"load": {"at": "two.end", "mass": 1.0}}))
    assert not shared(twins({}, design={"L": length}))


def test_copies_move_as_if_each_had_its_own_mesh() -> None:
    together, apart = model_of(twins({})), model_of(twins({"section": "bar"}))  # equal sections
    q = [[0.3, 0.8]]
    for a, b in zip(together.matrices(q, []), apart.matrices(q, []), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_section_shared_by_copies_may_be_a_design() -> None:
    diameter = {"parameter": "sections.rod.diameter", "min": 0.01, "max": 0.03}
    model = model_of(twins({}, design={"d": diameter}))
    thick = twins({})
    thick["mechanism"]["sections"]["rod"]["diameter"] = 0.03
    expected = model_of(thick).matrices([[0.3, 0.8]], [])
    for a, b in zip(model.matrices([[0.3, 0.8]], [[0.03]]), expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-13 * np.abs(b).max())


def test_copies_on_different_links_hang_each_on_its_own() -> None:
    # three like fingers, fixed at their own angle to two links of an arm: assembled together
    def hand(bodies: Tree) -> Tree:
        tree = twins({"section": "bar"}, bodies)
        beam = tree["mechanism"]["links"]["one"]
        for name, base, angle in (("f", "one", 0.3), ("g", "two", -0.5), ("h", "two", 0.9)):
            tree["mechanism"]["links"][name] = {**beam, "length": 0.2}
            tree["mechanism"]["joints"][name] = {
                "type": "fixed",
                "base": f"{base}.end",
                "follower": f"{name}.start",
                "angle": angle,
            }
        return tree

    apart = hand({name: {"at": f"{name}.end", "mass": 0.0} for name in ("f", "g", "h")})
    x = [0.4, 1.1]
    both = zip(model_of(hand({})).matrices(x, []), model_of(apart).matrices(x, []), strict=True)
    for together, alone in both:
        np.testing.assert_allclose(together, alone, rtol=0.0, atol=1e-14 * np.abs(alone).max())
