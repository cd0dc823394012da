# ruff: noqa: E501  (a table)
"""Warnings about frames, bodies and spatial parts: slips are caught, real mechanisms left alone."""

from pathlib import Path

import pytest
from small_case import unmarked
from wide_cases import PLANAR, SPATIAL, changed, write

from eigassign.case import load

# fmt: off
SLIPS = {
    "node in mm": (PLANAR, "tip: [0.2, 0], top: [0, 200 mm]}\n      beams:\n        lower", "tip: [200, 0], top: [200, 200 mm]}\n      beams:\n        lower", "nodes 200 is 200 m without a unit; did you mean 200 mm?"),
    "length of a rigid link in mm": (PLANAR, "length: 0.2, mass: 5", "¦length: 200, mass: 5", "length 200 is 200 m without a unit"),
    "stubby taper": (PLANAR, "length: 0.5, material: steel, section: {start: bar, end: thin}, elements: 4, shear: true", "¦length: 0.09, material: steel, section: {start: thin, end: bar}, elements: 4", "9 times the depth of section 'bar'"),
    "stubby profile": (PLANAR, "length: 2, material", "¦length: 0.7, material", "8.8 times the depth of section 'profile'"),
    "inertia of another section": (SPATIAL, "inertia_y: 2 cm4", "¦inertia_y: 20000 cm4", "cannot belong to one section"),
    "shear coefficient in per cent": (SPATIAL, "shear_coefficient: 0.85", "¦shear_coefficient: 85", "outside 0.05 … 1.2"),
    "tensor of no body": (SPATIAL, "inertia: [0.01, 0.02, 0.02]", "¦inertia: [0.05, 0.02, 0.02]", "a principal moment exceeds the other two's sum"),
    "products of no body": (SPATIAL, "inertia: [1, 1, 1, 0, 0, 0.1]", "¦inertia: [1, 1, 1, 0.9, 0, 0]", "a principal moment exceeds the other two's sum"),
    "orientation in degrees": (SPATIAL, "orientation: [0, -90 deg, 0]", "¦orientation: [0, -90, 0]", "was it meant in deg?"),
    "angle among strokes in degrees": (SPATIAL, "[10 mm, 1 deg,", "[10 mm, 20,", "was it meant in deg?"),
}
# fmt: on


def warnings_of(folder: Path, text: str) -> list[tuple[int, int, str]]:
    return [(w.line, w.column, w.message) for w in load(write(folder, text)).warnings]


@pytest.mark.parametrize(("base", "old", "new", "message"), SLIPS.values(), ids=SLIPS)
def test_a_slip_is_warned_of(base: str, old: str, new: str, message: str, tmp_path: Path) -> None:
    text, places = unmarked(changed(base, old, new))
    found = [w for w in warnings_of(tmp_path, text) if message in w[2]]
    assert found
    assert not places or found[0][:2] == places[0]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("inertia: [0.01, 0.02, 0.02]", "inertia: [0, 0.02, 0.02]"),  # a thin rod
        ("inertia: [0.01, 0.02, 0.02]", "inertia: [0.04, 0.02, 0.02]"),  # a thin disc
        ("0, 100, 0.4]", "0, 1000, 0.4]"),  # a screw of many turns
        ("length: 1, material: steel, section: round", "length: 0.26, material: steel, section: round"),
    ],
)  # fmt: skip
def test_a_real_spatial_part_is_left_alone(old: str, new: str, tmp_path: Path) -> None:
    text = SPATIAL.replace(old, new)
    assert text != SPATIAL
    assert warnings_of(tmp_path, text) == []


def test_a_planar_mechanism_of_many_parts_gives_no_warning(tmp_path: Path) -> None:
    assert warnings_of(tmp_path, PLANAR) == []
