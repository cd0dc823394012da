# ruff: noqa: E501  (a table)
"""Warnings: slips are caught, real mechanisms are left alone."""

import math

import pytest
from small_case import TEXT, edited, unmarked

from eigassign import CaseError
from eigassign.case import parse


def warnings_of(text: str) -> list[tuple[int, int, str]]:
    return [(w.line, w.column, w.message) for w in parse(text.encode(), "case.yaml").warnings]


# fmt: off
SLIPS = {
    "misprint of the paper": ("bending_inertia: 3.97e-8", "¦bending_inertia: 3.97e-4", "cannot belong"),
    "inertia in mm4": ("bending_inertia: 3.97e-8", "¦bending_inertia: 39700", "cannot belong"),
    "area in mm2": ("area: 7.0632e-4, bending", "area: 706.32, ¦bending", "cannot belong"),
    "modulus in GPa": ("youngs_modulus: 69 GPa", "¦youngs_modulus: 69", "is the unit right?"),
    "modulus times 1000": ("youngs_modulus: 69 GPa", "¦youngs_modulus: 69 TPa", "is the unit right?"),
    "density in g/mm3": ("density: 2700", "¦density: 0.0027", "is the unit right?"),
    "density times 1000": ("density: 2700", "¦density: 2.7e6", "is the unit right?"),
    "no density": ("density: 2700", "¦density: 0", "0 kg/m3 is outside"),
    "length in mm": ("length: 0.45", "¦length: 450", "length 450 is 450 m without a unit; did you mean 450 mm?"),
    "deeper than links are long": ("diameter: 30 mm", "¦diameter: 2", "diameter 2 is 2 m without a unit; did you mean 2 mm?"),
    "diameter in mm": ("rod: {shape: circle, diameter: 30 mm}", "rod: {shape: circle, ¦diameter: 30}", "30 is 30 m without a unit; did you mean 30 mm?"),
    "section in mm": ("area: 7.0632e-4, bending_inertia: 3.97e-8", "¦area: 706.32, bending_inertia: 39700", "A bare number is in m2"),
    "position in mm": ("follower: fore.start}", "follower: fore.start, ¦position: [300, 0]}", "300 is 300 m without a unit; did you mean 300 mm?"),
    "waypoints in mm": ("waypoints: [[0.3, 0.1], [0.2, 0.2]]", "¦waypoints: [[300, 100], [200, -200]]", "300 is 300 m without a unit; did you mean 300 mm?"),
    "stubby": ("length: 0.45", "¦length: 0.3", "7.5 times the depth of section 'pipe'"),
    "angle in degrees": ("angle: 10 deg", "¦angle: 30", "was it meant in deg?"),
    "point in degrees": ("order: 4", "order: 4, ¦q: [104, 304]", "304 rad is more than two turns"),
    "start in degrees": ("tip: hand.end", "tip: hand.end\n  ¦start: [0, -90]", "was it meant in deg?"),
    "start outside the bounds": ("d: {parameter: sections.rod.diameter, min: 20 mm", "¦d: {parameter: sections.rod.diameter, min: 31 mm", "initial value 30 mm of sections.rod.diameter is outside [31 mm, 40 mm]"),
    "bounds in mm": ("d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm", "¦d: {parameter: sections.rod.diameter, min: 20, max: 40", "[20, 40] m; a bare number is in m: was [20, 40] mm meant?"),
    "bounds in g": ("m: {parameter: bodies.tool.mass, min: 0, max: 250 g", "¦m: {parameter: bodies.tool.mass, min: 50, max: 250", "[50, 250] kg; a bare number is in kg: was [50, 250] g meant?"),
    "listed values in mm": ("min: 20 mm, max: 40 mm", "¦values: [25, 30]", "25 is 25 m without a unit; did you mean 25 mm?"),
    "one bound in mm": ("min: 20 mm, max: 40 mm", "min: 20 mm, ¦max: 40", "max 40 is 40 m without a unit; did you mean 40 mm?"),
    "listed values in mm, the start among them": ("d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}", "¦d: {parameter: sections.rod.diameter, values: [25, 35]}", "was [25, 35] mm meant?"),
    "listed stiffness in kN m/rad": ("  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}", "  ¦d: {parameter: coordinates.q2.drive.stiffness, values: [0.08, 0.12]}", "a bare number is in N m/rad: was [0.08, 0.12] kN m/rad meant?"),
    "choices in mm": ("{parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}", "{choices: {a: {¦sections.rod.diameter: 25}, b: {sections.rod.diameter: 30}}}", "25 is 25 m without a unit"),
}
# fmt: on


@pytest.mark.parametrize(("old", "new", "message"), SLIPS.values(), ids=SLIPS)
def test_a_slip_is_warned_of_at_its_place(old: str, new: str, message: str) -> None:
    text, (place,) = unmarked(edited(old, new))
    assert (*place, message) in [
        (line, column, message if message in text else text)
        for line, column, text in warnings_of(text)
    ]


def test_an_ordinary_arm_gives_no_warning() -> None:
    assert warnings_of(TEXT) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("youngs_modulus: 69 GPa", "youngs_modulus: 1.2 TPa"),  # diamond
        ("youngs_modulus: 69 GPa", "youngs_modulus: 1.5 MPa"),  # rubber
        ("density: 2700", "density: 22590"),  # osmium
        ("density: 2700", "density: 20"),  # foam
        ("angle: 10 deg", "angle: 720 deg"),
        ("max_error: 2 %", "max_error: 50 %"),
        ("waypoints: [[0.3, 0.1]", "waypoints: [[-90, 0.1]"),
        ("length: 0.6", "length: 70"),
        ("min: 20 mm, max: 40 mm", "min: 1 mm, max: 4 m"),
    ],
)
def test_an_unusual_but_possible_value_gives_no_warning(old: str, new: str) -> None:
    assert warnings_of(edited(old, new)) == []


def bare(area: float, inertia: float) -> list[str]:
    old = "area: 7.0632e-4, bending_inertia: 3.97e-8"
    found = warnings_of(edited(old, f"area: {area!r}, bending_inertia: {inertia!r}"))
    return [message for _, _, message in found if "cannot belong" in message]


def ring(outer: float, wall: float) -> tuple[float, float]:
    inner = outer - 2 * wall
    area = math.pi / 4 * (outer**2 - inner**2)
    return area, math.pi / 64 * (outer**4 - inner**4)


@pytest.mark.parametrize(
    ("area", "inertia"),
    [
        (7.0632e-4, 3.97e-8),  # the paper's rod, misprint mended
        ring(30e-3, 1e-3),
        ring(300e-3, 0.5e-3),  # D/t = 600
        ring(66e-3, 0.1e-3),  # a drink can
        (20e-3 * 4e-3, 20e-3 * 4e-3**3 / 12),  # flat bar, bent over its flat
        (20e-3 * 4e-3, 4e-3 * 20e-3**3 / 12),  # and on edge
        (200e-3 * 0.5e-3, 200e-3 * 0.5e-3**3 / 12),  # leaf spring
        (156e-4, 92080e-8),  # IPE 600, strong axis (EN 10365)
        (156e-4, 3387e-8),  # and weak axis
        (7.64e-4, 80.1e-8),  # IPE 80
        (1e-8, 1e-17),  # a wire of 0.1 mm
        (2.0, 0.3),  # a bridge girder
    ],
)
def test_a_real_section_is_left_alone(area: float, inertia: float) -> None:
    assert bare(area, inertia) == []


def test_the_misprint_is_explained_with_the_value_that_was_meant() -> None:
    (message,) = bare(7.0632e-4, 3.97e-4)
    assert "radius of gyration would be 0.75 m" in message
    assert "a solid round bar of that area has 3.97e-08 m4" in message


@pytest.mark.parametrize(
    ("inertia", "doubted"), [(0.99e-4, 1), (1.01e-4, 0), (99.0, 0), (101.0, 1)]
)
def test_stoutness_may_lie_between_a_thin_strip_and_a_thin_walled_tube(
    inertia: float, doubted: int
) -> None:
    assert len(bare(1.0, inertia)) == doubted


@pytest.mark.parametrize("factor", [1e-6, 1e-4, 1e4, 1e6])
@pytest.mark.parametrize("area", [1e-10, 1e-4, 10.0])
def test_any_large_slip_of_the_exponent_of_a_round_bar_is_seen_at_any_size(
    area: float, factor: float
) -> None:
    assert len(bare(area, factor * area**2 / (4 * math.pi))) == 1


def test_a_link_of_the_misprinted_section_is_seen_to_be_deeper_than_long() -> None:
    found = warnings_of(edited("bending_inertia: 3.97e-8", "bending_inertia: 3.97e-4"))
    assert any("at most 0.2 times the depth of section 'bar'" in message for *_, message in found)


def test_a_missing_unit_is_blamed_before_the_bound_that_it_breaks() -> None:
    text = edited("outer_diameter: 40 mm, thickness: 2 mm", "outer_diameter: 40, thickness: 3")
    text = text.replace("sections.rod.diameter, min: 20", "sections.pipe.outer_diameter, min: 5")
    with pytest.raises(CaseError) as caught:
        parse(text.encode(), "case.yaml")
    assert [(p.path, p.message) for p in caught.value.problems] == [
        (
            f"mechanism.sections.pipe.{key}",
            f"{key} {value} is {value} m without a unit; did you mean {value} mm?",
        )
        for key, value in (("outer_diameter", 40), ("thickness", 3))
    ]
