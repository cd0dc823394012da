# ruff: noqa: E501  (a table)
"""Mistakes in parameters that are places or several properties, and in what trajectories add."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of
from small_case import edited, unmarked

from eigassign.case import parse

D = "parameter: sections.rod.diameter, min: 20 mm, max: 40 mm"
TIP = "  waypoints: [[0.3, 0.1], [0.2, 0.2]]\n"


def adds(what: str) -> str:
    return f"{TIP}  set: {what}\n"


# fmt: off
WRONG = [
    Wrong("place as a whole", D, "¦parameter: joints.elbow.position, min: 0, max: 1", "design.d.parameter", "varies by component (x, y): joints.elbow.position.0, joints.elbow.position.1"),
    Wrong("third component in a plane", D, "¦parameter: joints.elbow.position.2, min: 0, max: 1", "design.d.parameter", "varies by component (x, y)"),
    Wrong("component written otherwise", D, "¦parameter: joints.elbow.position.00, min: 0, max: 1", "design.d.parameter", "varies by component"),
    Wrong("place of no joint", D, "¦parameter: joints.elbo.position.0, min: 0, max: 1", "design.d.parameter", "did you mean 'elbow'"),
    Wrong("place in another unit", D, "parameter: joints.elbow.position.0, ¦min: 1 deg, max: 1", "design.d.min", "which is angle"),
    Wrong("angle in another unit", D, "parameter: joints.wrist.angle, ¦min: 1 mm, max: 1", "design.d.min", "which is length"),
    Wrong("angles in a plane", D, "¦parameter: joints.wrist.orientation.2, min: 0, max: 1", "design.d.parameter", "vary joints.wrist.angle"),
    Wrong("axis of a joint", D, "¦parameter: joints.wrist.axis.0, min: 0, max: 1", "design.d.parameter", ".inertia, joints.<name>.position.0 or .angle"),
    Wrong("offset of no body", D, "¦parameter: bodies.tol.offset.1, min: 0, max: 1", "design.d.parameter", "did you mean 'tool'"),
    Wrong("node of a beam", D, "¦parameter: links.hand.nodes.end.0, min: 0, max: 1", "design.d.parameter", "can where it is rigid"),
    Wrong("angle of a spring", D, "¦parameter: springs.s.angle, min: 0, max: 1", "design.d.parameter", "unknown spring 's'"),
    Wrong("factors alone", D, "¦parameter: {sections.rod.diameter: 1}, min: 20 mm, max: 40 mm", "design.d.parameter", "write a path, or several as [path, {path: factor}]"),
    Wrong("no path first", D, "parameter: [¦{sections.rod.diameter: 1}, sections.pipe.outer_diameter], min: 20 mm, max: 40 mm", "design.d.parameter[0]", "the first is a path alone"),
    Wrong("listed twice", D, "parameter: [sections.rod.diameter, ¦{sections.rod.diameter: 2}], min: 20 mm, max: 40 mm", "design.d.parameter[1]", "listed twice"),
    Wrong("factor of zero", D, "parameter: [sections.rod.diameter, {¦sections.pipe.outer_diameter: 0}], min: 20 mm, max: 40 mm", "design.d.parameter[1].sections.pipe.outer_diameter", "must not be 0"),
    Wrong("other dimension", D, "parameter: [sections.rod.diameter, {¦materials.alu.density: 2}], min: 20 mm, max: 40 mm", "design.d.parameter[1].materials.alu.density", "is a density, sections.rod.diameter a length"),
    Wrong("written otherwise", D, "parameter: [sections.rod.diameter, {¦sections.pipe.outer_diameter: 2}], min: 20 mm, max: 40 mm", "design.d.parameter[1].sections.pipe.outer_diameter", "is 0.04 m in this file, where 2 × sections.rod.diameter is 0.06 m: write that, or another factor"),
    Wrong("several with another's", D, "parameter: [links.fore.length, ¦bodies.tool.mass], min: 0.1, max: 1", "design.d.parameter[1]", "bodies.tool.mass"),
    Wrong("set of what is a parameter", TIP, adds("{¦bodies.tool.mass: 3}"), "trajectory.set.bodies.tool.mass", "which a trajectory cannot set: write {add: …}"),
    Wrong("amount in another unit", TIP, adds("{bodies.tool.mass: {¦add: 3 mm}}"), "trajectory.set.bodies.tool.mass.add", "which is length"),
    Wrong("no amount", TIP, adds("{¦bodies.tool.mass: {}}"), "trajectory.set.bodies.tool.mass.add", "missing"),
    Wrong("taken away too much", TIP, adds("{¦bodies.tool.mass: {add: -50 g}}"), "trajectory.set.bodies.tool.mass", "must be >= 0 kg, got -0.05"),
    Wrong("wall that is too thick", TIP, adds("{¦sections.pipe.thickness: {add: 20 mm}}"), "trajectory.set.sections.pipe.thickness", "section 'pipe' cannot exist"),
]
# fmt: on


@pytest.mark.parametrize("wrong", WRONG, ids=lambda w: w.name)
def test_a_wrong_place_or_amount_is_named(wrong: Wrong, tmp_path: Path) -> None:
    text, (place,) = unmarked(edited(wrong.old, wrong.new))
    found = problems_of(text, tmp_path / "case.yaml")
    assert (wrong.path, place) in [(path, (line, column)) for line, column, path, _ in found]
    assert any(wrong.message in message for *_, message in found)


def test_a_body_is_at_its_node_unless_the_file_says_otherwise() -> None:
    case = parse(
        edited(D, "parameter: bodies.tool.offset.1, min: 0, max: 1 mm").encode(), "case.yaml"
    )
    assert case.value_at("bodies.tool.offset.1") == 0.0
    moved = case.with_design([0.1, 1e-3])
    assert moved.value_at("bodies.tool.offset.1") == 1e-3


def test_dimensions_that_vary_together_break_a_section_only_together() -> None:
    """Twice the wall is a fifth of the tube's diameter at every one: nothing to refuse."""
    knob = "[sections.pipe.outer_diameter, {sections.pipe.thickness: 0.05}]"
    text = edited(D, f"parameter: {knob}, min: 2 mm, max: 400 mm")
    case = parse(text.encode(), "case.yaml")
    column = case.design.parameters["d"]
    assert (column.min, column.max) == (0.002, 0.4)
    assert case.ranges["sections.pipe.thickness"] == pytest.approx((1e-4, 0.02))
    other = case.with_design([0.1, 0.3])
    assert other.mechanism.sections["pipe"].thickness == pytest.approx(0.015)
    assert parse(other.resolved().encode(), "case.yaml") == other


def test_what_is_added_counts_where_it_is_and_the_file_s_value_where_it_is_no_parameter() -> None:
    text = edited(TIP, adds("{bodies.tool.mass: {add: 3}, links.fore.length: {add: 50 mm}}"))
    case = parse(text.encode(), "case.yaml")
    assert case.loads["bodies.tool.mass.add"].along == (3.0,)
    assert case.loads["bodies.tool.mass.add"].written == 0.0
    assert case.loads["links.fore.length"].along == (0.5,)
    assert case.ranges["bodies.tool.mass"] == (3.0, 3.25)
    assert parse(case.resolved().encode(), "case.yaml") == case
