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


ROD, PIPE = "rod: {shape: circle, diameter: 30 mm}", "thickness: 2 mm"
TUBE = (PIPE, PIPE, "sections.pipe")
HOLLOW = (PIPE, "inner_diameter: 36 mm", "sections.pipe")
PROFILE = (
    ROD,
    "rod: {shape: i_profile, height: 60 mm, width: 40 mm, flange_thickness: 5 mm, "
    "web_thickness: 4 mm}",
    "sections.rod",
)
BOX = (ROD, "rod: {shape: box, height: 60 mm, width: 40 mm, thickness: 3 mm}", "sections.rod")
TOLD = {TUBE: "section 'pipe' cannot exist", BOX: "is no box whose torsion and shear are known"}


@pytest.mark.parametrize(
    ("section", "key", "low", "high", "bound"),
    [
        (TUBE, "thickness", 0.001, 0.021, "max"),
        (TUBE, "thickness", 0.001, 0.02, None),  # solid
        (TUBE, "outer_diameter", 0.003, 0.05, "min"),
        (TUBE, "outer_diameter", 0.004, 0.05, None),  # solid
        (TUBE, "outer_diameter", 0.005, 0.05, None),
        (HOLLOW, "inner_diameter", 0.001, 0.04, "max"),
        (HOLLOW, "inner_diameter", 0.001, 0.039, None),
        (PROFILE, "flange_thickness", 0.001, 0.03, "max"),
        (PROFILE, "flange_thickness", 0.001, 0.029, None),
        (PROFILE, "height", 0.01, 0.1, "min"),
        (PROFILE, "height", 0.011, 0.1, None),
        (PROFILE, "web_thickness", 0.001, 0.041, "max"),
        (PROFILE, "web_thickness", 0.001, 0.04, None),
        (PROFILE, "width", 0.003, 0.1, "min"),
        (PROFILE, "width", 0.004, 0.1, None),
        (BOX, "thickness", 0.001, 0.017, "max"),
        (BOX, "thickness", 0.001, 0.016, None),
        (BOX, "width", 0.007, 0.1, "min"),
        (BOX, "height", 0.008, 0.1, None),
    ],
)
def test_a_section_exists_all_over_the_bounds(
    section: tuple[str, str, str], key: str, low: float, high: float, bound: str | None
) -> None:
    """Its wall stays within its radius, a web between its flanges, a hole in its box."""
    old, new, path = section
    text = edited(old, new).replace(
        DIAMETER, f"{{parameter: {path}.{key}, min: {low}, max: {high}}}"
    )
    found = refusals(text)
    assert [path for path, _ in found] == ([f"design.d.{bound}"] if bound else [])
    assert all(TOLD.get(section, "") in message for _, message in found)


def test_two_bounds_that_meet_only_together_are_refused() -> None:
    text = edited(DIAMETER, "{parameter: sections.pipe.thickness, min: 1 mm, max: 12 mm}")
    assert refusals(text) == []
    both = text.replace(
        "\ndesign:\n",
        "\ndesign:\n  o: {parameter: sections.pipe.outer_diameter, min: 20 mm, max: 50 mm}\n",
    )
    assert both != text
    assert [path for path, _ in refusals(both)] == ["design.d.max"]


@pytest.mark.parametrize(("wall", "refused"), [("15 mm", False), ("31 mm", True)])
def test_every_choice_by_itself_is_a_section(wall: str, refused: bool) -> None:
    """The largest wall of a list need not fit the smallest tube."""
    small = "{sections.pipe.outer_diameter: 20 mm, sections.pipe.thickness: 1 mm}"
    large = f"{{sections.pipe.outer_diameter: 60 mm, sections.pipe.thickness: {wall}}}"
    found = refusals(edited(DIAMETER, f"{{choices: {{x: {small}, y: {large}}}}}"))
    assert [path for path, _ in found] == (["design.d.choices"] if refused else [])
