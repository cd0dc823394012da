"""Area and bending inertia of a cross-section, written once for numbers and for series."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from eigassign.series.expression import Scalar

Number = Callable[[str, float], Scalar]


class SectionValues(NamedTuple):
    """Area A in m² and second moment of area I in m⁴ about the in-plane bending axis."""

    area: Scalar
    bending_inertia: Scalar


def section_values(section: Any, number: Number) -> SectionValues:
    """A and I of a section of the case; ``number(key, value)`` yields a float or an expression.

    circle: A = πd²/4, I = πd⁴/64; tube: differences of two circles; rectangle: A = bh,
    I = bh³/12 with h in the plane of motion; bare values are taken as they are.
    """
    match section.shape:
        case "circle":
            return _circle(number("diameter", section.diameter))
        case "tube":
            return _tube(section, number)
        case "rectangle":
            width, height = number("width", section.width), number("height", section.height)
            return SectionValues(width * height, width * height**3.0 * (1.0 / 12.0))
    return SectionValues(
        number("area", section.area), number("bending_inertia", section.bending_inertia)
    )


def _circle(diameter: Scalar) -> SectionValues:
    return SectionValues(diameter**2.0 * (math.pi / 4.0), diameter**4.0 * (math.pi / 64.0))


def _tube(section: Any, number: Number) -> SectionValues:
    outer = number("outer_diameter", section.outer_diameter)
    if section.inner_diameter is not None:
        inner = number("inner_diameter", section.inner_diameter)
    else:
        inner = outer - number("thickness", section.thickness) * 2.0
    (a, i), (b, j) = _circle(outer), _circle(inner)
    return SectionValues(a - b, i - j)
