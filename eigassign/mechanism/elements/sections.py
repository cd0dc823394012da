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
# rolled profile; they do not depend on ν. A bare section may state its own; a box: `_box_shear`.
SHEAR = {"circle": 0.9, "tube": 0.5, "rectangle": 5.0 / 6.0, "i_profile": 0.44, "bare": 5.0 / 6.0}
# What a right-angled corner of walls of thickness 1 adds to S, ∫ ψ and 2 ∫ φ of the walls beside
# it; see `_box_torsion`. Solved on grids down to 1/64, extrapolated.
CORNER = {"S": 0.558729, "psi": 0.144834, "phi": 0.405824}


class SectionValues(NamedTuple):
    """A in m²; I_z, I_y, torsion constant J and polar inertia I_p in m⁴; shear coefficient κ.

    ``shear_coefficient_y`` is that of bending in the x-z plane, None where it is the same.
    """

    area: Scalar
    inertia_z: Scalar
    inertia_y: Scalar
    torsion_constant: Scalar
    polar_inertia: Scalar
    shear_coefficient: Scalar
    shear_coefficient_y: Scalar | None = None


def section_values(section: Any, number: Lookup) -> SectionValues:
    """Properties of a section of the case; ``number(key, value)`` yields a float or an expression.

    circle: A = πd²/4, I = πd⁴/64, J = 2I; tube: differences of two circles; rectangle b × h (h
    along y): A = bh, I_z = bh³/12, I_y = hb³/12, J by Saint-Venant's series (`_rectangle_torsion`);
    box: difference of two rectangles, J by `_box_torsion`, κ by `_box_shear`; I-profile: three
    rectangles, J = Σ bt³/3.
    """
    kappa = SHEAR.get(section.shape, 0.0)
    match section.shape:
        case "circle":
            area, inertia = _circle(number("diameter", section.diameter))
            return _round(area, inertia, kappa)
        case "tube":
            return _round(*_tube(section, number), kappa)
        case "rectangle":
            return _rectangle(section, number, kappa)
        case "box":
            return _box(section, number)
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


def _box(section: Any, number: Lookup) -> SectionValues:
    b, h = number("width", section.width), number("height", section.height)
    t = number("thickness", section.thickness)
    p, q = b - t * 2.0, h - t * 2.0
    area = b * h - p * q
    I_z = (b * h**3.0 - p * q**3.0) * (1.0 / 12.0)
    I_y = (h * b**3.0 - q * p**3.0) * (1.0 / 12.0)
    return SectionValues(
        area,
        I_z,
        I_y,
        _box_torsion(p, q, t),
        I_z + I_y,
        I_z * I_z / (area * _box_shear(p, q, t)),
        I_y * I_y / (area * _box_shear(q, p, t)),
    )


def _box_torsion(p: Scalar, q: Scalar, t: Scalar) -> Scalar:
    """J = J_0 + 4 (p q + F)² / S of a box with the hole p × q and walls t.

    Prandtl's stress function is C ψ + φ: φ is that of the walls as open profiles, J_0 = 2 ∫ φ; ψ is
    harmonic, 1 at the hole and 0 outside, F = ∫ ψ, S = ∫ |∇ψ|². With l = 2 (p + q) and what a
    corner between two long walls adds (`CORNER`, t = 1),

        J_0 = l t³/3 + 4 c_φ t⁴,   F = l t/2 + 4 c_ψ t²,   S = l/t + 4 c_S .

    For thin walls that is Bredt's 4 A_m² t/u + u t³/3. Against the solution of ∇²Φ = −2 it is right
    to 1e-4 for t up to 0.1 of the smaller side, 1.2e-3 up to 0.3, 7e-3 up to 0.4, at sides of
    1:1 to 1:10, where the formula of EN 10219 with sharp corners is off by up to 6 %.
    """
    length = (p + q) * 2.0
    open_part = length * t**3.0 * (1.0 / 3.0) + t**4.0 * (4.0 * CORNER["phi"])
    flow = length * t * 0.5 + t**2.0 * (4.0 * CORNER["psi"])
    conductance = length / t + 4.0 * CORNER["S"]
    return open_part + (p * q + flow) ** 2.0 / conductance * 4.0


def _box_shear(p: Scalar, q: Scalar, t: Scalar) -> Scalar:
    """U = ∫ (τ I/V)² dA for a force V along the side of the hole q, [m⁶]; κ = I²/(A U), for ν = 0.

    With shear flows Q V/I, Q = g x to x = p/2 in a flange, g = t (q + t)/2, and from Q_b on in a
    web, where Q = Q_b + t ((q/2)² − y²)/2,

        U/4 = ∫ Q²/t ds + c_S Q_a² + 0.616 Q_a (Q_b − Q_a) + 0.459 (Q_b − Q_a)²,

    Q_a = g p/2 and Q_b = Q_a + g t at the ends of a corner. Its last two factors are fitted to
    solutions of ∇²χ = −y over sides of 1:10 to 10:1; so κ is right to 5e-3 for t up to 0.1 of the
    smaller side, 1 % up to 0.2, 4 % up to 0.4. For thin walls it is Cowper's value for ν = 0
    (Journal of Applied Mechanics 33, 1966).
    """
    g = t * (q + t) * 0.5
    start, gained, web = g * p * 0.5, g * t, q * 0.5
    end = start + gained
    flange = start * start * p / t * (1.0 / 6.0)
    corner = start * start * CORNER["S"] + start * gained * 0.616 + gained * gained * 0.459
    walls = end * end * web / t + end * web**3.0 * (2.0 / 3.0) + t * web**5.0 * (2.0 / 15.0)
    return (flange + corner + walls) * 4.0


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
