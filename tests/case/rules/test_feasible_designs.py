"""Bounds within which a section cannot exist are refused at the bound that goes too far."""

import pytest
from small_case import edited

from eigassign.case import parse
from eigassign.errors import CaseError

DIAMETER = "{parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}"


def refusals(text: str) -> list[tuple[str, str]]:
    try:
        parse(text.encode(), "case.yaml")
    except CaseError as error:
        return [(p.path, p.message) for p in error.problems]
    return []


@pytest.mark.parametrize(
    ("bounds", "bound"),
    [
        ("thickness, min: 1 mm, max: 21 mm", "max"),
        ("thickness, min: 1 mm, max: 20 mm", None),  # solid
        ("outer_diameter, min: 3 mm, max: 50 mm", "min"),
        ("outer_diameter, min: 4 mm, max: 50 mm", None),  # solid
        ("outer_diameter, min: 5 mm, max: 50 mm", None),
    ],
)
def test_a_tubes_wall_stays_within_its_radius_all_over_the_bounds(
    bounds: str, bound: str | None
) -> None:
    found = refusals(edited(DIAMETER, f"{{parameter: sections.pipe.{bounds}}}"))
    assert [path for path, _ in found] == ([f"design.d.{bound}"] if bound else [])
    assert all("section 'pipe' cannot exist" in message for _, message in found)


@pytest.mark.parametrize(("largest", "refused"), [("40 mm", True), ("39 mm", False)])
def test_an_inner_diameter_stays_below_the_outer_one(largest: str, refused: bool) -> None:
    hollow = edited("thickness: 2 mm", "inner_diameter: 36 mm")
    new = f"{{parameter: sections.pipe.inner_diameter, min: 1 mm, max: {largest}}}"
    found = refusals(hollow.replace(DIAMETER, new))
    assert [path for path, _ in found] == (["design.d.max"] if refused else [])


def test_two_bounds_that_meet_only_together_are_refused() -> None:
    text = edited(DIAMETER, "{parameter: sections.pipe.thickness, min: 1 mm, max: 12 mm}")
    assert refusals(text) == []
    both = text.replace(
        "\ndesign:\n",
        "\ndesign:\n  o: {parameter: sections.pipe.outer_diameter, min: 20 mm, max: 50 mm}\n",
    )
    assert both != text
    assert [path for path, _ in refusals(both)] == ["design.d.max"]


PROFILE = """\
rod: {shape: i_profile, height: 60 mm, width: 40 mm, flange_thickness: 5 mm, web_thickness: 4 mm}
"""


@pytest.mark.parametrize(
    ("key", "low", "high", "bound"),
    [
        ("flange_thickness", 0.001, 0.03, "max"),
        ("flange_thickness", 0.001, 0.029, None),
        ("height", 0.01, 0.1, "min"),
        ("height", 0.011, 0.1, None),
        ("web_thickness", 0.001, 0.041, "max"),
        ("web_thickness", 0.001, 0.04, None),
        ("width", 0.003, 0.1, "min"),
        ("width", 0.004, 0.1, None),
    ],
)
def test_an_i_profile_keeps_its_web_all_over_the_bounds(
    key: str, low: float, high: float, bound: str | None
) -> None:
    text = edited("rod: {shape: circle, diameter: 30 mm}\n", PROFILE)
    text = text.replace(DIAMETER, f"{{parameter: sections.rod.{key}, min: {low}, max: {high}}}")
    assert [path for path, _ in refusals(text)] == ([f"design.d.{bound}"] if bound else [])


BOX = "rod: {shape: box, height: 60 mm, width: 40 mm, thickness: 3 mm}\n"


@pytest.mark.parametrize(
    ("key", "low", "high", "bound"),
    [
        ("thickness", 0.001, 0.017, "max"),
        ("thickness", 0.001, 0.016, None),
        ("width", 0.007, 0.1, "min"),
        ("height", 0.008, 0.1, None),
    ],
)
def test_a_box_keeps_a_hole_all_over_the_bounds(
    key: str, low: float, high: float, bound: str | None
) -> None:
    text = edited("rod: {shape: circle, diameter: 30 mm}\n", BOX)
    text = text.replace(DIAMETER, f"{{parameter: sections.rod.{key}, min: {low}, max: {high}}}")
    found = refusals(text)
    assert [path for path, _ in found] == ([f"design.d.{bound}"] if bound else [])
    assert all("is no box whose torsion and shear are known well" in said for _, said in found)


@pytest.mark.parametrize(("wall", "refused"), [("15 mm", False), ("31 mm", True)])
def test_every_choice_by_itself_is_a_section(wall: str, refused: bool) -> None:
    """The largest wall of a list need not fit the smallest tube."""
    small = "{sections.pipe.outer_diameter: 20 mm, sections.pipe.thickness: 1 mm}"
    large = f"{{sections.pipe.outer_diameter: 60 mm, sections.pipe.thickness: {wall}}}"
    found = refusals(edited(DIAMETER, f"{{choices: {{x: {small}, y: {large}}}}}"))
    assert [path for path, _ in found] == (["design.d.choices"] if refused else [])
