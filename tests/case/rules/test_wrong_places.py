"""Mistakes in parameters that are places or several properties, and in what trajectories add."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of, tables
from small_case import edited, unmarked

from eigassign.case import parse

D = "parameter: sections.rod.diameter, min: 20 mm, max: 40 mm"
TIP = "  waypoints: [[0.3, 0.1], [0.2, 0.2]]\n"


def adds(what: str) -> str:
    return f"{TIP}  set: {what}\n"


TABLES = tables("wrong_places")
WRONG = [Wrong(*row) for row in TABLES["wrong"]]


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
