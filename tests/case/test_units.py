"""Quantities: what each unit is worth, and what is refused."""

import math
import random

import pytest

from eigassign.case import (
    DIMENSIONS,
    SI,
    Dimension,
    Given,
    QuantityError,
    handy_unit,
    read_quantity,
)


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("30 mm", "length", 0.03),
        ("30mm", "length", 0.03),
        (" +3e1 mm ", "length", 0.03),
        ("2.5 cm", "length", 0.025),
        ("1.5 um", "length", 1.5e-6),
        ("1.5 µm", "length", 1.5e-6),
        ("1.5 μm", "length", 1.5e-6),
        ("0.2 km", "length", 200.0),
        ("-4", "length", -4.0),
        ("7.06 cm2", "area", 7.06e-4),
        ("7.06 cm^2", "area", 7.06e-4),
        ("7.06 cm²", "area", 7.06e-4),
        ("706 mm**2", "area", 7.06e-4),
        ("39700 mm4", "second moment of area", 3.97e-8),
        ("3.97 cm^4", "second moment of area", 3.97e-8),
        ("250 g", "mass", 0.25),
        ("0.1 t", "mass", 100.0),
        ("2690 kg/m3", "density", 2690.0),
        ("2690 kg m^-3", "density", 2690.0),
        ("2.69 g/cm3", "density", 2690.0),
        ("2.69 t/m3", "density", 2690.0),
        ("5 kg m2", "rotary inertia", 5.0),
        ("5 kg·m²", "rotary inertia", 5.0),
        ("5 g*cm^2", "rotary inertia", 5e-7),
        ("69 GPa", "pressure or modulus", 69e9),
        ("69000 N/mm2", "pressure or modulus", 69e9),
        ("1 kg/m/s2", "pressure or modulus", 1.0),
        ("104.1 deg", "angle", math.radians(104.1)),
        ("180 °", "angle", math.pi),
        ("20 mrad", "angle", 0.02),
        ("12 N m/rad", "rotational stiffness", 12.0),
        ("12 Nm/rad", "rotational stiffness", 12.0),
        ("1 N m/deg", "rotational stiffness", 180 / math.pi),
        ("3 kN m/rad", "rotational stiffness", 3000.0),
        ("1 N m/arcmin", "rotational stiffness", 60 * 180 / math.pi),
        ("2 kgf m/arcmin", "rotational stiffness", 2 * 9.80665 * 60 * 180 / math.pi),
        ("200 ms", "time", 0.2),
        ("2 min", "time", 120.0),
        ("1.5 h", "time", 5400.0),
        ("190 Hz", "frequency", 190.0),
        ("0.19 kHz", "frequency", 190.0),
        ("190 rpm", "frequency", 190 / 60),
        ("2 %", "fraction", 0.02),
        ("2%", "fraction", 0.02),
        ("." + "0" * 30 + "5e31 m", "length", 5.0),
        ("0e5000 m", "length", 0.0),
        ("1e-400 m", "length", 0.0),
    ],
)
def test_a_quantity_with_a_unit_is_converted(text: str, dimension: str, si: float) -> None:
    # one rounding at the division, one more where π is involved: 4 ulp is generous
    assert read_quantity(text, DIMENSIONS[dimension]) == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize("text", ["30 mm", "69 GPa", "250 g", "2 %", "7.06 cm2", "3.97 cm4"])
def test_a_decimal_unit_costs_no_accuracy(text: str) -> None:
    """`30 mm` must be the very float 0.03, or min, max and initial value would disagree."""
    expected = {"30 mm": 0.03, "69 GPa": 69e9, "250 g": 0.25, "2 %": 0.02}
    expected |= {"7.06 cm2": 7.06e-4, "3.97 cm4": 3.97e-8}
    assert read_quantity(text, None) == expected[text]


@pytest.mark.parametrize("value", [0.03, 3, -2.5e-7])
def test_a_bare_number_is_si_already(value: float) -> None:
    assert read_quantity(value, DIMENSIONS["length"]) == value


@pytest.mark.parametrize(
    ("value", "dimension", "message"),
    [
        ("190 rad/s", "frequency", "divide by 2π and write Hz"),
        ("190 1/s", "frequency", "unknown unit"),
        ("190 rpm", "angular rate", "which is frequency"),
        ("30 rev", "angle", "unknown unit 'rev'"),
        ("1 N m", "rotational stiffness", "got '1 N m', which is torque or energy"),
        ("1 Hz", "angle", "expected an angle (in rad when bare; or deg, mrad), got '1 Hz'"),
        ("1 kg m s", "mass", "which is of dimension kg^1 m^1 s^1"),
        ("1 N/m s", "stiffness", "unknown unit 'm s'"),
        ("3 Mm", "length", "did you mean 'mm'"),
        ("3 gpa", "pressure or modulus", "did you mean 'GPa'"),
        ("3 kgm2", "rotary inertia", "did you mean 'kg m'"),
        ("3 mmm", "length", "did you mean 'm mm'"),
        ("3 furlong", "length", "unknown unit 'furlong'; expected a length (in m"),
        ("3 m12", "length", "unknown unit"),
        ("3 m/", "length", "unknown unit"),
        ("3 /m", "length", "unknown unit"),
        ("3 m m^0", "area", "unknown unit"),
        ("0,6 m", "length", "decimals take a point"),
        ("mm", "length", "expected a length (in m when bare; or mm, cm, km), got text 'mm'"),
        ("", "length", "expected a length"),
        ("nan", "length", "expected a length"),
        ("1e400 m", "length", "must be a finite number"),
        (math.inf, "length", "must be a finite number, got .inf"),
        (-math.inf, "length", "must be a finite number, got -.inf"),
        (math.nan, "length", "must be a finite number, got .nan"),
        (10**500, "length", "must be a finite number, got a number of more than 60 digits"),
        (True, "length", "got true"),
        (None, "length", "got nothing"),
        ((1, 2), "length", "got a list"),
        ({"a": 1}, "length", "got a mapping"),
        ("1 " + "m " * 5000, "length", "expected a length"),
    ],
)
def test_anything_else_is_refused_and_says_what_is_allowed(
    value: object, dimension: str, message: str
) -> None:
    with pytest.raises(QuantityError) as caught:
        read_quantity(value, DIMENSIONS[dimension])
    assert message in str(caught.value)
    assert len(str(caught.value)) < 300


def test_hertz_and_radians_per_second_and_one_per_second_are_three_things() -> None:
    for name, others in (("frequency", ("rad/s", "s^-1")), ("angular rate", ("Hz", "s^-1"))):
        for unit in others:
            with pytest.raises(QuantityError):
                read_quantity(f"1 {unit}", DIMENSIONS[name])


def test_every_dimension_takes_the_units_that_its_messages_name() -> None:
    for dimension in DIMENSIONS.values():
        for unit in filter(None, (dimension.si, *dimension.examples.split(", "))):
            assert read_quantity(f"1 {unit}", dimension) > 0.0, unit
        if dimension.si:
            assert read_quantity(f"1.5 {dimension.si}", dimension) == 1.5


@pytest.mark.parametrize(
    ("unit", "prefixes"),
    [
        ("m", "n u µ μ m c k"),
        ("s", "u µ μ m"),
        ("N", "m k M"),
        ("Nm", "k"),
        ("Pa", "k M G T"),
        ("Hz", "m k M"),
        ("rad", "m"),
        ("g", "m k"),
    ],
)
def test_every_prefix_is_worth_what_its_letter_says(unit: str, prefixes: str) -> None:
    power = {"n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9, "T": 12}
    for prefix in prefixes.split():
        si = power[prefix] - 3 * (unit == "g")
        assert read_quantity(f"1 {prefix}{unit}", None) == float(f"1e{si}")
        with pytest.raises(QuantityError):
            read_quantity(f"1 {prefix}{unit}", DIMENSIONS["area"])


SYMBOLS = (("g", "kg", "t"), ("um", "mm", "cm", "in", "km"), ("ms", "min", "h"), ("deg", "mrad"))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("dimension", DIMENSIONS.values(), ids=DIMENSIONS)
def test_an_amount_in_any_unit_is_answered_in_it_and_reads_back(
    dimension: Dimension, seed: int
) -> None:
    draw, value = random.Random(seed), 2.34
    exponents = zip((*SYMBOLS, ("Hz", "rpm", "kHz")), dimension.exponents, strict=True)
    powers = [(draw.choice(symbols), n) for symbols, n in exponents if n]
    if dimension.exponents[4]:  # Hz has its own 1/s
        powers = [(symbol, n) for symbol, n in powers if symbol not in SYMBOLS[2]]
    unit = " ".join(f"{symbol}^{n}" for symbol, n in powers) or "%"
    si = read_quantity(f"{value} {unit}", dimension)
    name, size = handy_unit(SI(dimension.si, Given(si, f"{value} {unit}")), si)
    assert name == unit
    assert si / size == pytest.approx(value, rel=1e-14)
    assert read_quantity(f"{si / size!r} {name}", dimension) == pytest.approx(si, rel=1e-14)
    assert handy_unit(SI(dimension.si, Given(si, si)), si)[0] == handy_unit(dimension.si, si)[0]
