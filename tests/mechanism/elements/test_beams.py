"""Beams: published matrices, sections, frames of several, and what copies share."""

from types import SimpleNamespace as Shape
from typing import Any

import numpy as np
import pytest
from chains import Tree, bar, model_of
from spatial_cases import ALLOY, STEEL, built, linkage
from spatial_oracle import world

from eigassign.errors import CaseError
from eigassign.mechanism import local_links, section_values
from eigassign.modal import eigenvalues

E, A, I, RHO, L = 70e9, 3e-4, 5e-9, 2700.0, 0.8  # noqa: E741


def matrices_of(n: int, bodies: dict[str, Any] | None = None) -> Any:
    """The matrices of one planar beam of n elements."""
    tree = bar(n, L, E, RHO, {"area": A, "bending_inertia": I})
    tree["mechanism"]["bodies"] = bodies or {}
    model = built(tree)
    return local_links(model.case, model.numbers, model.motion)[0][0]


def stiffness(n: int) -> np.ndarray:
    return sum(t.coefficient * t.matrix.toarray() for t in matrices_of(n).stiffness)


def mass(n: int) -> np.ndarray:
    return sum(t.coefficient * t.matrix.toarray() for t in matrices_of(n).mass)


def test_one_element_has_the_published_hermite_matrices() -> None:
    # as in any text on structural dynamics: cubic Hermite bending, linear axial
    k, m = stiffness(1), mass(1)
    bending = E * I / L**3 * np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2]]
    )  # fmt: skip
    inertia = RHO * A * L / 420 * np.array(
        [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L**2, 13 * L, -3 * L**2],
         [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L**2, -22 * L, 4 * L**2]]
    )  # fmt: skip
    across, along = [1, 2, 4, 5], [0, 3]
    np.testing.assert_allclose(k[np.ix_(across, across)], bending, rtol=1e-14)
    np.testing.assert_allclose(m[np.ix_(across, across)], inertia, rtol=1e-14)
    np.testing.assert_allclose(k[np.ix_(along, along)], E * A / L * np.array([[1, -1], [-1, 1]]))
    np.testing.assert_allclose(
        m[np.ix_(along, along)], RHO * A * L / 6 * np.array([[2, 1], [1, 2]]), rtol=1e-14
    )
    assert not k[np.ix_(across, along)].any()
    assert not m[np.ix_(across, along)].any()


# --- Areas and inertias of sections against integrals over the cross-section


def as_written(key: str, value: float) -> float:
    return value


def ring(inner: float, outer: float) -> tuple[float, float]:
    """∫dA and ∫y²dA in polar coordinates, radii: ∫2πr dr and ∫πr³ dr."""
    return np.pi * (outer**2 - inner**2), np.pi / 4 * (outer**4 - inner**4)


CASES = [
    (Shape(shape="circle", diameter=0.03), ring(0.0, 0.015)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=0.034, thickness=None),
     ring(0.017, 0.02)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=None, thickness=0.003),
     ring(0.017, 0.02)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=None, thickness=0.02),
     ring(0.0, 0.02)),
    (Shape(shape="rectangle", width=0.02, height=0.004), (8e-5, 0.02 * 0.004**3 / 12)),
    (Shape(shape="bare", area=1.5e-4, bending_inertia=2e-9), (1.5e-4, 2e-9)),
]  # fmt: skip


@pytest.mark.parametrize(("section", "expected"), CASES)
def test_area_and_inertia_are_the_integrals(section: Shape, expected: tuple[float, float]) -> None:
    np.testing.assert_allclose(section_values(section, as_written)[:2], expected, rtol=1e-12)


def test_the_papers_rod_of_30_mm_weighs_what_the_paper_says() -> None:
    # Belotti et al. 2021, Table 1: 1.9 kg/m of aluminium, I = 3.97e-8 m⁴ (printed e-4: a misprint)
    area, inertia = section_values(Shape(shape="circle", diameter=0.03), as_written)[:2]
    np.testing.assert_allclose(inertia, 3.97e-8, rtol=2e-3)
    np.testing.assert_allclose(area * 2690.0, 1.9, rtol=2e-3)


@pytest.mark.parametrize(
    ("width", "height", "factor"),  # of Timoshenko, Goodier, Theory of Elasticity, table in § 109
    [(1.0, 1.0, 0.1406), (1.0, 2.0, 0.229), (3.0, 1.0, 0.263), (1.0, 10.0, 0.312)],
)
def test_the_torsion_constant_of_a_rectangle_is_saint_venant_s(
    width: float, height: float, factor: float
) -> None:
    section = Shape(shape="rectangle", width=width, height=height)
    J = section_values(section, as_written).torsion_constant
    assert pytest.approx(factor * max(width, height) * min(width, height) ** 3, rel=2e-3) == J


def test_a_design_may_swap_the_sides_of_a_rectangle() -> None:
    def arm(height: float) -> Tree:
        return linkage(
            {"b": {"length": 1.0, "elements": 1, "material": "m", "section": "s"}},
            {"r": {"type": "revolute", "base": "ground", "follower": "b.start"}},
            {"q": {"joint": "r", "drive": {"stiffness": 1e5}}},
            section={"shape": "rectangle", "width": 0.02, "height": height},
            space="spatial",
        ) | {"design": {"h": {"parameter": "sections.s.height", "min": 0.005, "max": 0.08}}}

    designed = built(arm(0.03))
    for height, rel in ((0.08, 1e-12), (0.02, 1e-12), (0.01, 1e-12), (0.005, 1e-10)):
        found = eigenvalues(designed.pencil, np.array([[0.1, height]]), 6)[0]
        np.testing.assert_allclose(found, built(arm(height)).lam([0.1], 6), rtol=rel)


# --- Links of several beams: the same as one beam, and where their sections lie


def on_a_drive(space: str, link: Tree, follower: str = "link.start") -> Tree:
    return linkage(
        {"link": link},
        {"root": {"type": "revolute", "base": "ground", "follower": follower}},
        {"q": {"joint": "root", "drive": {"stiffness": 2e4}}},
        sections={
            "s": {"shape": "rectangle", "width": 0.02, "height": 0.05},
            "bar": {"shape": "tube", "outer_diameter": 0.02, "thickness": 0.002},
        },
        materials={"m": ALLOY, "steel": STEEL},
        space=space,
        bodies={"tip": {"at": "link.end", "mass": 0.4}},
    )


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
    a, b = (built(on_a_drive(space, link)).lam([0.3], 8) for link in (several, one))
    np.testing.assert_allclose(a, b, rtol=1e-9)


@pytest.mark.parametrize("direction", [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8]])
def test_the_height_of_an_upright_beams_section_lies_where_the_manual_says(
    direction: list[float],
) -> None:
    """y is z × x, across the upright plane of the beam, and the link's y for a vertical beam."""
    tree = on_a_drive(
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
    tree = on_a_drive("planar", frame(nodes, [("start", "end", 2)]))
    with pytest.raises(CaseError, match="no beams connect lost"):
        built(tree)


# --- What is built once and shared gives the same matrices as what is built one by one


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
    return linkage(
        {"beam": {**beam, "roll": 0.3}},
        {"hinge": {"type": "revolute", "base": "ground", "follower": "beam.start"}},
        {"q": {"joint": "hinge"}},
        sections={"thick": thick, "thin": {**thick, **change}},
        material={"youngs_modulus": 7e10, "density": 2.7e3, "poissons_ratio": 0.33},
        space="spatial",
    ) | {"design": design}


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
    return linkage(
        {"one": beam, "two": {**beam, **second}},
        {
            "a": joint,
            "b": {**joint, "base": "one.end", "follower": "two.start"},
        },
        {"q1": {"joint": "a"}, "q2": {"joint": "b"}},
        sections={name: {"shape": "circle", "diameter": 0.02} for name in ("rod", "bar")},
        material={"youngs_modulus": 7e10, "density": 2.7e3},
        bodies=bodies or {},
    ) | {"design": design or {}}


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
