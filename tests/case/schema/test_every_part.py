"""Every kind of part is read in SI, written out again, described by the schema, and immutable."""

import math
import pickle
from pathlib import Path

import pytest
from json_schema_reader import SCHEMA, accepts
from wide_cases import PLANAR, SPATIAL, changed, write

from eigassign.case import load, read_yaml


def test_planar_parts_are_read_in_si(tmp_path: Path) -> None:
    case = load(write(tmp_path, PLANAR))
    mechanism = case.mechanism
    rod, slider, bracket, plate = (
        mechanism.links[name] for name in ("rod", "slider", "bracket", "plate")
    )
    assert (rod.section.start, rod.section.end) == ("bar", "thin")
    assert rod.shear is True
    assert slider.type == "rigid"
    assert (slider.nodes["pin"], slider.center) == ((0.0, 0.01), (0.005, 0.0))
    assert bracket.type == "frame"
    assert bracket.nodes["top"] == (0.0, 0.2)
    brace = bracket.beams["brace"]
    assert (brace.from_node, brace.to_node, brace.elements) == ("tip", "top", 2)
    assert plate.type == "superelement"
    assert (plate.stiffness, plate.reduce_to) == (str(tmp_path / "K.mtx"), 2000.0)
    assert plate.nodes["right"].dofs == (9, 10, 11)
    assert mechanism.sections["profile"].shape == "i_profile"
    assert mechanism.joints["ride"].type == "carriage"
    assert mechanism.joints["hung"].position == (0.0, 0.0)
    assert mechanism.bodies["weight"].offset == (0.0, 0.05)
    stop = mechanism.springs["stop"]
    assert (stop.translational, stop.rotational) == ((1000.0, 2000.0), 5.0)
    assert stop.angle == math.radians(30)


def test_coordinates_that_slide_are_read_in_metres(tmp_path: Path) -> None:
    case = load(write(tmp_path, PLANAR))
    assert case.coordinate_units == ("rad", "m")
    assert case.mechanism.assembly.at == {"turn": math.radians(60)}
    assert case.mechanism.assembly.guess["guide"] == 0.5
    assert case.coordinates["place"].drive.stiffness == 3000.0
    assert case.coordinates["place"].drive.inertia == 0.2
    assert case.trajectory.q == ((math.radians(10), 0.3), (math.radians(20), 0.4))
    assert case.expansion.q == (math.radians(15), 0.35)
    assert [(p.min, p.max) for p in case.design.parameters.values()] == [
        (50.0, 200.0),
        (1.0, 3.0),
        (1000.0, 4000.0),
    ]


def test_spatial_parts_are_read_in_si(tmp_path: Path) -> None:
    case = load(write(tmp_path, SPATIAL))
    mechanism = case.mechanism
    section = mechanism.sections["bare"]
    assert (section.shape, section.polar_inertia) == ("bare", 3e-8)
    assert (section.in_plane, section.shear_coefficient) == (1e-8, 0.85)
    assert mechanism.links["one"].roll == math.radians(30)
    assert mechanism.links["three"].inertia == (1, 1, 1, 0, 0, 0.1)
    cross, thread, nut = (mechanism.joints[name] for name in ("cross", "thread", "nut"))
    assert cross.type == "universal"
    assert cross.axes == ((0, 1, 0), (0, 0, 1))
    assert thread.type == "screw"
    assert thread.lead == 0.005
    assert nut.type == "nut"
    assert nut.position == nut.orientation == (0.0, 0.0, 0.0)
    assert mechanism.springs["mount"].orientation == (0.0, 0.0, math.pi / 2)
    assert case.coordinate_units == ("m", *["rad"] * 7, "m")
    assert case.coordinates["u2"].component == 2
    assert case.coordinates["x"].drive.stiffness == 1e6
    assert case.mechanism.assembly.at == {"x": 0.4}
    assert case.warnings == ()


@pytest.mark.parametrize("text", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_a_resolved_mechanism_reads_back_equal_from_anywhere_and_is_as_the_schema_says(
    text: str, tmp_path: Path
) -> None:
    case = load(write(tmp_path, text))
    (tmp_path / "results").mkdir()
    resolved = tmp_path / "results" / "resolved.yaml"
    resolved.write_text(case.resolved())
    again = load(resolved, allow_outside=True)
    assert again == case
    assert again.resolved() == case.resolved()
    assert pickle.loads(pickle.dumps(case)) == case
    assert hash(case) == hash(again)
    for written in (text, case.resolved()):
        assert accepts(SCHEMA, read_yaml(written.encode(), "f").tree)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("type: rigid, nodes", "type: stiff, nodes"),
        ("elements: 4, shear: true", "elements: 4, shear: maybe"),
        ("{from: start, to: tip,", "{from_node: start, to: tip,"),
        ("dofs: [0, 1, 2]", "dofs: [0, 1]"),
        ("dofs: [0, 1, 2]", "dofs: [0, 1, -2]"),
        ("shape: i_profile", "shape: u_profile"),
        ("poissons_ratio: 0.3", "poissons_ratio: 0.5"),
        ("type: carriage", "type: cart"),
        ("[slider.pin, bracket.tip]", "[slider.pin]"),
        ("component: rotation", "component: spin"),
        ("position: [0, -1]", "position: [0]"),
        ("position: [0, -1]", "position: [0, 0, 0, 0]"),
        ("translational: 100", "translational: -100"),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(old: str, new: str) -> None:
    assert not accepts(SCHEMA, read_yaml(changed(PLANAR, old, new).encode(), "f").tree)


@pytest.mark.parametrize(
    ("path", "bounds"),
    [
        ("materials.steel.poissons_ratio", "min: 0.25, max: 0.35"),
        ("sections.profile.web_thickness", "min: 2 mm, max: 4 mm"),
        ("sections.profile.height", "min: 70 mm, max: 90 mm"),
        ("links.cart.length", "min: 10 cm, max: 30 cm"),
        ("links.cart.mass", "min: 4, max: 6"),
        ("links.slider.inertia", "min: 0, max: 1 kg m2"),
        ("bodies.weight.inertia", "min: 0, max: 1"),
        ("springs.stop.rotational", "min: 0, max: 10 N m/rad"),
    ],
)
def test_numbers_of_every_part_may_be_design_parameters(
    path: str, bounds: str, tmp_path: Path
) -> None:
    old = "{parameter: links.slider.mass, min: 1, max: 3}"
    case = load(write(tmp_path, changed(PLANAR, old, f"{{parameter: {path}, {bounds}}}")))
    assert case.design.parameters["m"].parameter == path


@pytest.mark.parametrize(
    "path",
    ["torsion_constant", "polar_inertia", "inertia_y", "inertia_z", "shear_coefficient", "area"],
)
def test_numbers_of_a_bare_section_may_be_design_parameters(path: str, tmp_path: Path) -> None:
    text = SPATIAL + f"design: {{d: {{parameter: sections.bare.{path}, min: 1e-9, max: 1}}}}\n"
    assert load(write(tmp_path, text)).design.parameters["d"].max == 1.0


def test_passive_joints_need_no_coordinates_where_there_are_loops(tmp_path: Path) -> None:
    case = load(write(tmp_path, PLANAR))
    assert set(case.mechanism.joints) > {c.joint for c in case.coordinates.values()}


def test_a_mechanism_of_rigid_links_needs_no_materials(tmp_path: Path) -> None:
    text = """\
title: Pendulum on a spring
mechanism:
  space: planar
  links: {bob: {type: rigid, length: 1, mass: 1}}
  joints: {pivot: {type: revolute, base: ground, follower: bob.start}}
  springs: {hold: {between: [bob.end, ground], translational: 10}}
coordinates: {q: {joint: pivot}}
"""
    case = load(write(tmp_path, text))
    assert case.mechanism.materials == case.mechanism.sections == {}
