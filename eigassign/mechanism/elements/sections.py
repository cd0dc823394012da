"""Properties of cross-sections, written once for numbers and for series.

Local axes: x along the beam, y in the plane of a planar mechanism, z out of it. I_z resists bending
in the x-y plane, I_y in the x-z plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eigassign.series.expression import Scalar, exp, is_constant

Lookup = Callable[[str, float], Scalar]
TORSION_TERMS = range(1, 24, 2)
ODD_FIFTH_POWERS = 31.0 / 32.0 * 1.0369277551433699  # Σ 1/n⁵ over odd n, by Riemann's ζ(5)
# Energy values of κ for a solid circle and a rectangle, the thin-walled limit for a tube, a typical
# rolled profile; they do not depend on ν. A bare section may state its own.
SHEAR = {"circle": 0.9, "tube": 0.5, "rectangle": 5.0 / 6.0, "i_profile": 0.44, "bare": 5.0 / 6.0}


class SectionValues(NamedTuple):
    """A in m²; I_z, I_y, torsion constant J and polar inertia I_p in m⁴; shear coefficient κ."""

    area: Scalar
    inertia_z: Scalar
    inertia_y: Scalar
    torsion_constant: Scalar
    polar_inertia: Scalar
    shear_coefficient: Scalar


def section_values(section: Any, number: Lookup) -> SectionValues:
    """Properties of a section of the case; ``number(key, value)`` yields a float or an expression.

    circle: A = πd²/4, I = πd⁴/64, J = 2I; tube: differences of two circles; rectangle b × h (h
    along y): A = bh, I_z = bh³/12, I_y = hb³/12, J by Saint-Venant's series (`_rectangle_torsion`);
    I-profile: three rectangles, J = Σ bt³/3.
    """
    kappa = SHEAR[section.shape]
    match section.shape:
        case "circle":
            area, inertia = _circle(number("diameter", section.diameter))
            return _round(area, inertia, kappa)
        case "tube":
            return _round(*_tube(section, number), kappa)
        case "rectangle":
            return _rectangle(section, number, kappa)
        case "i_profile":
            return _i_profile(section, number, kappa)
        case "bare":
            return _bare(section, number, kappa)
    raise NotImplementedError(f"no properties are defined for sections of shape {section.shape!r}")


def _round(area: Scalar, inertia: Scalar, kappa: float) -> SectionValues:
    return SectionValues(area, inertia, inertia, inertia * 2.0, inertia * 2.0, kappa)


def _circle(diameter: Scalar) -> tuple[Scalar, Scalar]:
    return diameter**2.0 * (math.pi / 4.0), diameter**4.0 * (math.pi / 64.0)


def _tube(section: Any, number: Lookup) -> tuple[Scalar, Scalar]:
    outer = number("outer_diameter", section.outer_diameter)
    if section.inner_diameter is not None:
        inner = number("inner_diameter", section.inner_diameter)
    else:
        inner = outer - number("thickness", section.thickness) * 2.0
    (a, i), (b, j) = _circle(outer), _circle(inner)
    return a - b, i - j


def _rectangle(section: Any, number: Lookup, kappa: float) -> SectionValues:
    b, h = number("width", section.width), number("height", section.height)
    area = b * h
    I_z, I_y = b * h**3.0 * (1.0 / 12.0), h * b**3.0 * (1.0 / 12.0)
    long, short = (h, b) if section.height >= section.width else (b, h)
    return SectionValues(area, I_z, I_y, _rectangle_torsion(long, short), I_z + I_y, kappa)


def _rectangle_torsion(a: Scalar, b: Scalar) -> Scalar:
    """J = a b³ [1/3 − 64 b/(π⁵ a) Σ tanh(n π a/2b)/n⁵], n odd (Saint-Venant 1855).

    Which side is a does not matter; the series converges the faster the longer it is. Of the tanh
    only what it is short of 1 is summed, Σ 1/n⁵ = 31 ζ(5)/32: with the sides swapped by a factor of
    ten J is right to 1e-7, by a factor of four to 1e-12.
    """
    shrinks = exp(a / b * -math.pi)
    short_of_one: Scalar = 0.0
    for n in TORSION_TERMS:
        power = shrinks ** float(n)
        short_of_one = short_of_one + power / (power + 1.0) * (2.0 / n**5)
    total = ODD_FIFTH_POWERS - short_of_one
    return a * b**3.0 * (1.0 / 3.0 - b / a * total * (64.0 / math.pi**5))


def _i_profile(section: Any, number: Lookup, kappa: float) -> SectionValues:
    h, b = number("height", section.height), number("width", section.width)
    t = number("flange_thickness", section.flange_thickness)
    w = number("web_thickness", section.web_thickness)
    web = h - t * 2.0
    area = b * t * 2.0 + web * w
    I_z = (b * h**3.0 - (b - w) * web**3.0) * (1.0 / 12.0)
    I_y = (t * b**3.0 * 2.0 + web * w**3.0) * (1.0 / 12.0)
    J = (b * t**3.0 * 2.0 + web * w**3.0) * (1.0 / 3.0)
    return SectionValues(area, I_z, I_y, J, I_z + I_y, kappa)


def _bare(section: Any, number: Lookup, kappa: float) -> SectionValues:
    def given(key: str, default: Scalar) -> Scalar:
        value = getattr(section, key, None)
        return default if value is None else number(key, value)

    I_z = given("inertia_z", 0.0)
    if is_constant(I_z) and not np.any(I_z):
        I_z = given("bending_inertia", 0.0)
    I_y = given("inertia_y", 0.0)
    J = given("torsion_constant", 0.0)
    return SectionValues(
        number("area", section.area),
        I_z,
        I_y,
        J,
        given("polar_inertia", I_z + I_y),
        given("shear_coefficient", kappa),
    )
