"""Numbers of no size that a mechanism has are refused where they stand, with what is allowed."""

from pathlib import Path

import pytest
from mistakes import told_once
from small_case import TEXT, edited

from eigassign.case import DIMENSIONS, Quantity, QuantityError, parse, read_quantity
from eigassign.errors import CaseError

LARGE, SMALL = "too large to calculate with", "too small to calculate with"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("length: 0.6", "¦length: 1e150", f"{LARGE}, got 1e+150; at most 1e+06 m"),
        ("length: 0.6", "¦length: 1e-308", f"{SMALL}, got 1e-308; at least 1e-12 m"),
        ("length: 0.6", "¦length: 1e-13", f"{SMALL}, got 1e-13; at least 1e-12 m"),
        ("length: 0.6", "¦length: 1e99999", "must be a finite number"),
        ("diameter: 30 mm", "¦diameter: 1e308", f"{LARGE}, got 1e+308; at most 1e+06 m"),
        ("diameter: 30 mm", "¦diameter: 1e308 mm", f"{LARGE}, got '1e308 mm'; at most 1e+06 m"),
        ("area: 7.0632e-4", "¦area: 5e-324", SMALL),
        ("bending_inertia: 3.97e-8", "¦bending_inertia: 1e300 mm4", f"{LARGE}, got '1e300 mm4'"),
        (
            "youngs_modulus: 69 GPa",
            "¦youngs_modulus: 1e299 GPa",
            f"{LARGE}, got '1e299 GPa'; at most 1e+24 Pa",
        ),
        ("mass: 0.1", "¦mass: 1e-40", f"{SMALL}, got 1e-40; 0 or at least 1e-30 kg"),
        ("stiffness: 100", "¦stiffness: 1e200", f"{LARGE}, got 1e+200; at most 1e+24"),
        ("[0.3, 0.1]", "[¦1e150, 0.1]", LARGE),
        ("[0.3, 0.1]", "[¦-1e7, 0.1]", LARGE),
        ("angle: 10 deg", "¦angle: 1e100 deg", f"{LARGE}, got '1e100 deg'"),
        ("angle: 10 deg", "¦angle: 5e-324", f"{SMALL}, got 5e-324; 0 or at least 1e-60 rad"),
        ("[10 deg, 170 deg]", "[10 deg, ¦1e9]", f"{LARGE}, got 1000000000.0; at most 1e+06 rad"),
        ("min: 20 mm", "¦min: 1e-200 mm", SMALL),
        ("max: 250 g", "¦max: 1e99 g", f"{LARGE}, got '1e99 g'; at most 1e+15 kg"),
        ("{m: 1}", "{¦m: 1e31}", LARGE),
        (
            "frequency: 190 Hz",
            "¦frequency: 1e15 kHz",
            f"{LARGE}, got '1e15 kHz'; at most 1e+15 Hz",
        ),
        ("max_error: 2 %", "¦max_error: 1e-35", SMALL),
    ],
)
def test_a_number_of_no_size_is_refused(old: str, new: str, says: str, tmp_path: Path) -> None:
    _, message = told_once(edited(old, new), tmp_path / "case.yaml")
    assert message.startswith(says)


@pytest.mark.parametrize("name", sorted(DIMENSIONS))
def test_limits_are_allowed_themselves_and_what_is_beyond_is_not(name: str) -> None:
    dimension = DIMENSIONS[name]
    for allowed in (dimension.largest, -dimension.largest, 0.0, 1e-17):
        assert read_quantity(allowed, dimension) == allowed
    for refused in (1.001 * dimension.largest, -1.001 * dimension.largest):
        with pytest.raises(QuantityError, match="too large to calculate with"):
            read_quantity(refused, dimension)
    positive = Quantity(dimension, above=0)
    assert positive.read(dimension.smallest) == dimension.smallest
    with pytest.raises(QuantityError, match="too small to calculate with"):
        positive.read(0.999 * dimension.smallest)
    assert dimension.smallest < 1.0 < dimension.largest
    assert read_quantity(1e30, None) == 1e30


def test_a_direction_of_no_length_is_none() -> None:
    slide = "{type: prismatic, base: ground, follower: upper.start, axis: [%s, 0]}"
    shoulder = "{type: revolute, base: ground, follower: upper.start}"
    allowed = TEXT.replace(shoulder, slide % "1e-20")
    assert parse(allowed.encode(), "c").mechanism.joints["shoulder"].type == "prismatic"
    with pytest.raises(CaseError, match="has no direction: all components are zero"):
        parse(TEXT.replace(shoulder, slide % "1e-40").encode(), "c")
