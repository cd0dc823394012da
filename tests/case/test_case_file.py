"""What a valid file becomes: SI values, defaults, frozen and equal by content."""

import copy
import hashlib
import math
import pickle
from pathlib import Path
from types import MappingProxyType

import pytest
from pydantic import ValidationError
from small_case import MOTION, TEXT, edited, read

from eigassign.case import load

CASES = Path(__file__).parents[2] / "cases"
MINIMAL = """\
title: Cantilever
mechanism:
  space: planar
  materials: {steel: {youngs_modulus: 210 GPa, density: 7850}}
  sections: {bar: {shape: rectangle, width: 20 mm, height: 4 mm}}
  links: {beam: {length: 0.5, material: steel, section: bar, elements: 8}}
  joints: {clamp: {type: fixed, base: ground, follower: beam.start}}
"""


def test_the_small_case_is_read_in_si() -> None:
    case = read(TEXT)
    mechanism = case.mechanism
    assert case.title == "Arm"
    assert case.reference is None
    assert mechanism.space == "planar"
    assert mechanism.materials["alu"].youngs_modulus == 69e9
    rod, pipe, bar = mechanism.sections.values()
    assert (rod.shape, rod.diameter) == ("circle", 0.03)
    assert (pipe.shape, pipe.outer_diameter, pipe.thickness) == ("tube", 0.04, 0.002)
    assert (bar.shape, bar.area, bar.bending_inertia) == ("bare", 7.0632e-4, 3.97e-8)
    assert pipe.inner_diameter is None
    assert list(mechanism.links) == ["upper", "fore", "hand"]
    assert mechanism.links["fore"].elements == 3
    assert [j.type for j in mechanism.joints.values()] == ["revolute", "revolute", "fixed"]
    assert mechanism.joints["wrist"].angle == math.radians(10)
    assert mechanism.joints["shoulder"].position == (0.0, 0.0)
    assert (mechanism.bodies["tool"].mass, mechanism.bodies["tool"].inertia) == (0.1, 0.0)


def test_the_studies_of_the_small_case_are_read_in_si() -> None:
    case = read(TEXT)
    assert list(case.coordinates) == ["q1", "q2"]
    assert case.coordinates["q1"].drive == "free"
    assert case.coordinates["q1"].angle == "relative"
    assert case.coordinates["q2"].drive.stiffness == 100
    assert case.trajectory.tip == "hand.end"
    assert case.trajectory.branch["elbow"] == pytest.approx((math.pi / 18, math.pi * 17 / 18))
    assert (case.trajectory.duration, case.trajectory.samples) == (1.0, 101)
    assert [(p.min, p.max) for p in case.design.parameters.values()] == [(0, 0.25), (0.02, 0.04)]
    assert case.design.constraints["budget"].terms == {"m": 1.0}
    assert case.design.constraints["budget"].max == 0.2
    assert (case.expansion.order, case.expansion.q, case.expansion.modes) == (4, "auto", (1, 2))
    assert (case.targets[0].mode, case.targets[0].frequency, case.targets[0].weight) == (1, 190, 1)
    assert case.validation.max_error == 0.02


def test_a_mechanism_alone_is_a_case_and_the_rest_has_defaults() -> None:
    case = read(MINIMAL)
    assert case.coordinates == {}
    assert case.mechanism.bodies == {}
    assert case.trajectory is None
    assert case.design.parameters == {}
    assert case.design.constraints == {}
    assert (case.expansion.order, case.expansion.y, case.expansion.modes) == (4, "auto", "auto")
    assert case.targets == ()
    assert case.validation.max_error == 0.02
    assert case.warnings == ()


def test_values_whose_unit_another_key_decides_are_put_into_si() -> None:
    text = edited("order: 4", "order: 4, q: [90 deg, 1], y: [100 g, 30 mm]")
    text = text.replace("tip: hand.end", "tip: hand.end\n  start: [90 deg, 0]")
    case = read(text)
    assert case.expansion.q == (math.pi / 2, 1.0)
    assert case.expansion.y == (0.1, 0.03)
    assert case.trajectory.start == (math.pi / 2, 0.0)


def test_joint_samples_may_come_with_times_or_a_duration_and_in_degrees() -> None:
    timed = read(edited(MOTION, "  q: [[0, 90 deg], [1, 2]]\n  time: [0, 200 ms]\n")).trajectory
    even = read(edited(MOTION, "  q: [[0, 90 deg], [1, 2]]\n  duration: 200 ms\n")).trajectory
    assert timed.q == even.q == ((0.0, math.pi / 2), (1.0, 2.0))
    assert (timed.time, timed.duration) == ((0.0, 0.2), None)
    assert (even.time, even.duration) == (None, 0.2)


def test_a_wanted_frequency_may_change_in_time() -> None:
    text = edited("frequency: 190 Hz", "frequency: {time: [0, 1 s], frequency: [0.19 kHz, 200]}")
    profile = read(text).targets[0].frequency
    assert (profile.time, profile.frequency) == ((0, 1), (190, 200))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("thickness: 2 mm", "thickness: 19 mm"),
        ("thickness: 2 mm", "thickness: 20 mm"),
        ("thickness: 2 mm", "inner_diameter: 39 mm"),
        ("max: 200 g", "min: 200 g, max: 200 g"),
        ("min: 20 mm, max: 40 mm", "min: 30 mm, max: 0.03"),
        ("min: 20 mm, max: 40 mm", "min: 0.03, max: 3 cm"),
        ("frequency: 190 Hz", "frequency: {time: [0, 1], frequency: [1, 2]}"),
        ("frequency: 190 Hz", "frequency: {time: [-1, 0, 2], frequency: [1, 2, 3]}"),
        ("elements: 4", "elements: 19996"),
        ("order: 4", "order: 20"),
        ("elbow: [10 deg, 170 deg]", "elbow: [0 deg, 360 deg]"),
    ],
)
def test_what_lies_just_within_the_rules_is_accepted(old: str, new: str) -> None:
    assert read(edited(old, new)) != read(TEXT)


def test_a_body_has_no_mass_unless_one_is_given() -> None:
    case = read(edited("bodies:\n", "bodies:\n    rotor: {at: fore.start, inertia: 1 g m2}\n"))
    assert case.mechanism.bodies["rotor"].mass == 0
    assert case.mechanism.bodies["rotor"].inertia == 1e-3


def test_a_problem_is_placed_at_the_line_of_its_key() -> None:
    case = read(TEXT)
    absolute = case.problem("mechanism.links.fore.length", "too long")
    assert str(absolute) == "case.yaml:12:12: mechanism.links.fore.length: too long"
    assert case.problem("links.fore.length", "too long") == absolute
    assert case.problem("targets[0].frequency", "").line == 34
    assert str(case.problem("nowhere.x", "?")) == "case.yaml:1:1: nowhere.x: ?"


def test_the_hash_is_that_of_the_bytes_and_equality_is_that_of_the_content(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text("# a comment\n" + TEXT)
    case = load(path)
    assert case.path == path
    assert case.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert case == read(TEXT)
    assert hash(case) == hash(read(TEXT))
    assert case.sha256 != read(TEXT).sha256
    assert case != read(edited("mass: 0.1", "mass: 0.2"))


def test_the_order_of_coordinates_is_part_of_the_content() -> None:
    swapped = edited(
        "  q1: {joint: shoulder}\n  q2: {joint: elbow, angle: absolute, drive: {stiffness: 100}}\n",
        "  q2: {joint: elbow, angle: absolute, drive: {stiffness: 100}}\n  q1: {joint: shoulder}\n",
    )
    assert read(swapped) != read(TEXT)


def test_nothing_in_a_case_can_be_changed() -> None:
    case = read(TEXT)
    with pytest.raises(AttributeError):
        case.title = "x"
    with pytest.raises(ValidationError):
        case.mechanism.links["fore"].length = 1.0
    for mapping in (case.mechanism.links, case.coordinates, case.design.parameters):
        with pytest.raises(TypeError):
            mapping["x"] = 1
        with pytest.raises(AttributeError):
            mapping.clear()
        for name in (*type(mapping).__slots__, "other"):
            with pytest.raises(TypeError):
                setattr(mapping, name, {})
        assert mapping == MappingProxyType(dict(mapping))
        assert mapping != 1


def test_a_case_survives_pickling_and_copying() -> None:
    case = read(TEXT)
    assert pickle.loads(pickle.dumps(case)) == case
    assert copy.deepcopy(case) == case


def test_the_shipped_arm_has_the_papers_mass_per_length() -> None:
    case = load(CASES / "two_link.yaml")
    section, material = case.mechanism.sections["rod"], case.mechanism.materials["aluminium"]
    # 1e-8 relative: frequencies go with its square root and are wanted to 1e-6
    assert section.area * material.density == pytest.approx(1.9, rel=1e-8)
    assert (material.youngs_modulus, section.bending_inertia) == (69e9, 3.97e-8)
    assert [link.elements for link in case.mechanism.links.values()] == [4, 3]
    assert case.expansion.q == (1.817, 5.312)
    assert case.warnings == ()
