"""Cross-sections, and the values of beams over each of their elements, tapered or not.

Local axes: x along the beam, y in the plane of a planar mechanism, z out of it. I_z resists bending
in the x-y plane, I_y in the x-z plane.

Along a taper the dimensions of the section run linearly. Areas and moments of inertia are then
polynomials of degree 4 at most, given by five of their values, but for the torsion constant of a
rectangle, of which five values are taken in each element. Over an element each value is a sum of
Legendre polynomials, Σ_l c_l P_l(2ξ − 1), of which those up to P_4 count: see `beam`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import legendre

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.expression import Scalar, exp, is_constant, one_atom

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
    kinds = {
        **{"circle": _circle, "tube": _tube, "rectangle": _rectangle},
        **{"box": _box, "i_profile": _i_profile, "bare": _bare},
    }
    return kinds[section.shape](section, number, SHEAR.get(section.shape, 0.0))


def _circle(section: Any, number: Lookup, kappa: float) -> SectionValues:
    return _round(number("diameter", section.diameter), 0.0, kappa)


def _tube(section: Any, number: Lookup, kappa: float) -> SectionValues:
    outer = number("outer_diameter", section.outer_diameter)
    if section.inner_diameter is not None:
        inner = number("inner_diameter", section.inner_diameter)
    else:
        inner = outer - number("thickness", section.thickness) * 2.0
    return _round(outer, inner, kappa)


def _round(outer: Scalar, inner: Scalar, kappa: float) -> SectionValues:
    area, inertia = (
        outer**n * (math.pi / over) - inner**n * (math.pi / over)
        for n, over in ((2.0, 4.0), (4.0, 64.0))
    )
    return SectionValues(area, inertia, inertia, inertia * 2.0, inertia * 2.0, kappa)


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


def _box(section: Any, number: Lookup, _: float) -> SectionValues:
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


TERMS = 5  # Legendre polynomials over an element of a taper
STATIONS, SHARES = legendre.leggauss(TERMS)  # from −1 to 1: where a taper is evaluated
# by what values at the stations give P_0 … P_4, (l, g)
_PROJECTION = (SHARES[:, None] * legendre.legvander(STATIONS, TERMS - 1)).T
_PROJECTION = _PROJECTION * (np.arange(TERMS)[:, None] + 0.5)
# of which shapes what is no polynomial along a taper
NO_POLYNOMIALS = {"rectangle": ("GJ",), "box": ("GJ", "shear_z", "shear_y")}


class BeamValues(NamedTuple):
    """Stiffnesses EA [N], EI_z, EI_y, GJ [N m²], shear κGA [N] or None; ρA, ρI_p, ρI_z, ρI_y.

    Numbers, expressions, or arrays of numbers (n,): one for each of n elements. ``shear_z`` goes
    with EI_z, ``shear_y`` with EI_y.
    """

    EA: Scalar
    EI_z: Scalar
    EI_y: Scalar
    GJ: Scalar
    shear_z: Scalar | None
    shear_y: Scalar | None
    mass: Scalar
    polar: Scalar
    rotary_z: Scalar
    rotary_y: Scalar


Profile: TypeAlias = Sequence[BeamValues]  # over an element: the mean, then P_1 … P_4 if it varies


def field_inertia(beam: BeamValues) -> tuple[Scalar, ...]:
    """Per unit of length what the mass matrix gives to u_x, u_y, u_z, θ_x, θ_y, θ_z.

    ρA three times [kg/m], ρI_p, ρI_y, ρI_z [kg m]; without shear the rotary ones are neglected.
    """
    rotary = (0.0, 0.0) if beam.shear_z is None else (beam.rotary_y, beam.rotary_z)
    return (beam.mass, beam.mass, beam.mass, beam.polar, *rotary)


def beam_values(case: CaseFile, parameters: ModelParameters, beam: Any, section: str) -> BeamValues:
    """Stiffness and mass values of a beam of the case with one section."""

    def number(key: str, value: float) -> Scalar:
        return parameters.number(f"sections.{section}.{key}", value)

    return _values(case, parameters, beam, section_values(case.mechanism.sections[section], number))


def _values(
    case: CaseFile, parameters: ModelParameters, beam: Any, section: SectionValues
) -> BeamValues:
    data = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    E = parameters.number(path + "youngs_modulus", data.youngs_modulus)
    rho = parameters.number(path + "density", data.density)
    sheared = bool(getattr(beam, "shear", False))
    G = _shear_modulus(case, parameters, beam, E)
    kappa, kappa_y = section.shear_coefficient, section.shear_coefficient_y
    kGA = G * section.area * kappa if sheared else None
    return BeamValues(
        EA=E * section.area,
        EI_z=E * section.inertia_z,
        EI_y=E * section.inertia_y,
        GJ=G * section.torsion_constant,
        shear_z=kGA,
        shear_y=G * section.area * kappa_y if sheared and kappa_y is not None else kGA,
        mass=rho * section.area,
        polar=rho * section.polar_inertia,
        rotary_z=rho * section.inertia_z,
        rotary_y=rho * section.inertia_y,
    )


def _shear_modulus(case: CaseFile, parameters: ModelParameters, beam: Any, E: Scalar) -> Scalar:
    """G = E/(2(1 + ν)), or as given; not needed by planar beams without shear."""
    data: Any = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    if getattr(data, "shear_modulus", None) is not None:
        return parameters.number(path + "shear_modulus", data.shear_modulus)
    if getattr(data, "poissons_ratio", None) is not None:
        nu = parameters.number(path + "poissons_ratio", data.poissons_ratio)
        return E / ((nu + 1.0) * 2.0)
    if case.mechanism.space == "planar" and not getattr(beam, "shear", False):
        return 0.0
    message = "needs poissons_ratio or shear_modulus for torsion or shear"
    raise MechanismError(f"mechanism.materials.{beam.material}", message)


# --- tapers


def beam_profiles(
    case: CaseFile,
    parameters: ModelParameters,
    beam: Any,
    piece: tuple[Scalar, Scalar],
    n: int,
    together: bool,
) -> list[Profile]:
    """Values of n elements over a ``piece`` of a beam, from share to share of its length."""
    if isinstance(beam.section, str):
        return [[beam_values(case, parameters, beam, beam.section)]]
    start, end = piece

    def at(place: float) -> BeamValues:
        share = start + (end - start) * (0.5 * (1.0 + place))
        return _tapered_values(case, parameters, beam, share)

    # (n, 5, 5): by what a polynomial's values at `STATIONS` give its P_0 … P_4 over n elements
    to_each = legendre.legvander(_stations(n), TERMS - 1)
    weights = _PROJECTION @ (to_each @ np.linalg.inv(legendre.legvander(STATIONS, TERMS - 1)))
    table = [_combined(v, weights) for v in zip(*map(at, STATIONS.tolist()), strict=True)]
    for key in NO_POLYNOMIALS.get(case.mechanism.sections[beam.section.start].shape, ()):
        k = BeamValues._fields.index(key)
        if table[k] is not None and (key != "GJ" or case.mechanism.space == "spatial"):
            table[k] = _in_each(key, at, n)
    if together and all(each is None or isinstance(each, np.ndarray) for each in table):
        rows: Any = [[None if each is None else each.T for each in table]]
    else:
        rows = zip(*([None] * n if each is None else each for each in table), strict=True)
    return [
        [BeamValues._make(None if each is None else each[k] for each in row) for k in range(TERMS)]
        for row in rows
    ]


def _stations(n: int) -> Floats:
    """The stations of each of n elements, (n, 5), from −1 to 1 over all of them."""
    return np.asarray((2.0 * np.arange(n)[:, None] + 1.0 + STATIONS) / n - 1.0)


def _combined(values: tuple[Scalar | None, ...], weights: Floats) -> Any:
    """Σ_j weights_nlj value_j, (n, 5): an array of numbers, or rows of expressions."""
    given = [value for value in values if value is not None]
    if not given:
        return None
    if all(is_constant(value) for value in given):
        return weights @ np.array(given)
    atoms = [one_atom(value) for value in given]
    return [
        [sum((v * w for v, w in zip(atoms, row, strict=True)), 0.0) for row in rows]
        for rows in weights.tolist()
    ]


def _in_each(key: str, at: Callable[[float], BeamValues], n: int) -> Any:
    """A value over each of n elements, (n, 5) as of `_combined`, from stations in each."""
    weights = _PROJECTION[None]
    rows = [
        _combined(tuple(getattr(at(t), key) for t in row), weights)[0]
        for row in _stations(n).tolist()
    ]
    return np.array(rows) if all(isinstance(row, np.ndarray) for row in rows) else rows


def _tapered_values(
    case: CaseFile, parameters: ModelParameters, link: Any, share: Scalar
) -> BeamValues:
    """Values at a share of the length, the sections' dimensions running linearly."""
    a, b = case.mechanism.sections[link.section.start], case.mechanism.sections[link.section.end]

    def number(key: str, value: float) -> Scalar:
        low = parameters.number(f"sections.{link.section.start}.{key}", value)
        high = parameters.number(f"sections.{link.section.end}.{key}", getattr(b, key))
        return low + (high - low) * share

    return _values(case, parameters, link, section_values(a, number))


def each_element(profile: Profile, n: int) -> list[Profile]:
    """The profiles of n elements, from one of all whose values may be arrays (n,)."""

    def of(values: BeamValues, k: int) -> BeamValues:
        rows: Any = values
        return BeamValues(*(v[k] if isinstance(v, np.ndarray) else v for v in rows))

    if not any(isinstance(value, np.ndarray) for value in profile[0]):
        return [profile] * n
    return [[of(values, k) for values in profile] for k in range(n)]
