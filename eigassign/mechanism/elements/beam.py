"""Beam elements: axial, torsion and two bendings, Euler-Bernoulli or Timoshenko, consistent mass.

An element of length h has matrices that are affine in few scalars; per plane of bending, with
Φ = 12EI/(κGA h²) (0 for Euler-Bernoulli),

    k = (EA/h) k_a + (GJ/h) k_t + EI/(1+Φ) (h⁻³ k_0 + h⁻² k_1 + h⁻¹ k_2 + Φ h⁻¹ k_3)
    m = ρA h m_a + ρI_p h m_t + ρA/(1+Φ)² Σ_{i,j} Φ^i h^{j+1} m_ij  (+ rotary inertia with shear)

(cubic Hermite bending; Przemieniecki, Theory of Matrix Structural Analysis, §5.6 and §11.7 with
shear and rotary inertia). Dofs of an element: (u_x, u_y, u_z, θ_x, θ_y, θ_z) at both nodes; a
planar mechanism keeps (u_x, u_y, θ_z).
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.sections import SectionValues, section_values
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.expression import Scalar, is_constant

Floats = NDArray[np.float64]
RealOrComplex = NDArray[Any]  # real or complex: polynomials do not mind
PLANES = ((1, 5, 1.0), (2, 4, -1.0))  # deflection, rotation: θ_z = dv/dx, θ_y = −dw/dx


class ElementTerm(NamedTuple):
    """coefficient × constant 12 × 12 matrix, or one matrix an element (n, 12, 12)."""

    coefficient: Scalar
    matrix: Floats


class BeamValues(NamedTuple):
    """Stiffnesses EA [N], EI_z, EI_y, GJ [N m²], shear κGA [N] or None; ρA, ρI_p, ρI_z, ρI_y.

    Numbers, expressions, or arrays of numbers (n,): one for each of n elements.
    """

    EA: Scalar
    EI_z: Scalar
    EI_y: Scalar
    GJ: Scalar
    shear: Scalar | None
    mass: Scalar
    polar: Scalar
    rotary_z: Scalar
    rotary_y: Scalar


def element_stiffness(beam: BeamValues, h: Scalar) -> list[ElementTerm]:
    """Affine terms of k; h in m."""
    terms = [ElementTerm(beam.EA / h, _pair(0)), ElementTerm(beam.GJ / h, _pair(3))]
    for EI, plane in ((beam.EI_z, "z"), (beam.EI_y, "y")):
        phi = _phi(beam, EI, h)
        stiff = EI if _is_zero(phi) else EI / (phi + 1.0)
        coefficients = (stiff / h**3.0, stiff / h**2.0, stiff / h, stiff * phi / h)
        terms += [
            ElementTerm(c, m) for c, m in zip(coefficients, bending_stiffness(plane), strict=True)
        ]
    return _folded(terms)


def element_mass(beam: BeamValues, h: Scalar) -> list[ElementTerm]:
    """Affine terms of the consistent m."""
    terms = [
        ElementTerm(beam.mass * h, _spread(0)),
        ElementTerm(beam.polar * h, _spread(3)),
    ]
    for EI, rotary, plane in ((beam.EI_z, beam.rotary_z, "z"), (beam.EI_y, beam.rotary_y, "y")):
        phi = _phi(beam, EI, h)
        scale = 1.0 if _is_zero(phi) else (phi + 1.0) ** -2.0
        terms += _polynomial(beam.mass * scale, phi, bending_mass(plane), (h, h**2.0, h**3.0))
        if beam.shear is not None:
            terms += _polynomial(rotary * scale, phi, rotary_mass(plane), (h**-1.0, 1.0, h))
    return _folded(terms)


def _folded(terms: list[ElementTerm]) -> list[ElementTerm]:
    """The same sum, with all constant coefficients in one matrix: most elements have no others."""
    varying: list[ElementTerm] = []
    total = np.zeros((12, 12))
    for term in terms:
        if is_constant(term.coefficient):
            total = total + np.multiply.outer(term.coefficient, term.matrix)
        else:
            varying.append(term)
    return [*varying, ElementTerm(1.0, total)] if total.any() else varying


def shear_ratios(beam: BeamValues, h: Scalar) -> tuple[Scalar, Scalar]:
    """Φ of bending in the element's x-y and x-z plane; 0 without shear."""
    return _phi(beam, beam.EI_z, h), _phi(beam, beam.EI_y, h)


def repeated(values: tuple[Scalar, ...], n: int) -> list[tuple[Scalar, ...]]:
    """Those of n elements, from values of all or arrays of each one's own."""
    if not any(isinstance(value, np.ndarray) for value in values):
        return [values] * n
    each = (np.broadcast_to(np.asarray(value), n).tolist() for value in values)
    return list(zip(*each, strict=True))


def field_inertia(beam: BeamValues) -> tuple[Scalar, ...]:
    """Per unit of length what the mass matrix gives to u_x, u_y, u_z, θ_x, θ_y, θ_z.

    ρA three times [kg/m], ρI_p, ρI_y, ρI_z [kg m]; without shear the rotary ones are neglected.
    """
    rotary = (0.0, 0.0) if beam.shear is None else (beam.rotary_y, beam.rotary_z)
    return (beam.mass, beam.mass, beam.mass, beam.polar, *rotary)


def bending_shapes(xi: RealOrComplex, phi: RealOrComplex) -> RealOrComplex:
    """Deflection per (w1, h θ1, w2, h θ2) at ξ = x/h in an element with shear ratio Φ, (…, 4).

    (1+Φ) w = (1−3ξ²+2ξ³ + Φ(1−ξ)) w1 + (ξ−2ξ²+ξ³ + Φ(ξ−ξ²)/2) h θ1
            + (3ξ²−2ξ³ + Φξ) w2 + (−ξ²+ξ³ − Φ(ξ−ξ²)/2) h θ2,   θ = dw/dx less the shear angle
    (Przemieniecki, Theory of Matrix Structural Analysis, §11.7); cubic Hermite for Φ = 0. These are
    the shapes whose products integrate to the consistent mass.
    """
    bubble = 0.5 * phi * (xi - xi**2)
    second = xi**2 * (3.0 - 2.0 * xi)
    shapes = (
        1.0 - second + phi * (1.0 - xi),
        xi * (1.0 - xi) ** 2 + bubble,
        second + phi * xi,
        xi**2 * (xi - 1.0) - bubble,
    )
    return np.stack(shapes, axis=-1) / (1.0 + phi)[..., None]


def bending_slopes(xi: RealOrComplex, phi: RealOrComplex) -> RealOrComplex:
    """h × rotation of the section per (w1, h θ1, w2, h θ2) at ξ, of `bending_shapes`, (…, 4).

    (1+Φ) h θ = −6(ξ−ξ²) w1 + (1−4ξ+3ξ² + Φ(1−ξ)) h θ1
              + 6(ξ−ξ²) w2 + (−2ξ+3ξ² + Φξ) h θ2 .
    These are the shapes whose products integrate to the rotary inertia.
    """
    bow = 6.0 * xi * (1.0 - xi)
    slopes = (
        -bow,
        (1.0 - xi) * (1.0 - 3.0 * xi + phi),
        bow,
        xi * (3.0 * xi - 2.0 + phi),
    )
    return np.stack(slopes, axis=-1) / (1.0 + phi)[..., None]


def _phi(beam: BeamValues, EI: Scalar, h: Scalar) -> Scalar:
    """Φ = 12EI/(κGA h²)."""
    return 0.0 if beam.shear is None else EI * 12.0 / (beam.shear * h**2.0)


def _polynomial(
    scale: Scalar,
    phi: Scalar,
    matrices: tuple[tuple[Floats, ...], ...],
    lengths: tuple[Scalar, ...],
) -> list[ElementTerm]:
    """Σ_i Φ^i Σ_j length_j matrix_ij."""
    terms: list[ElementTerm] = []
    power: Scalar = 1.0
    for row in matrices:
        terms += [
            ElementTerm(scale * power * length, m) for length, m in zip(lengths, row, strict=True)
        ]
        power = power * phi
        if _is_zero(power):
            break
    return terms


def _is_zero(x: Scalar) -> bool:
    return isinstance(x, float | int) and x == 0.0


@cache
def _pair(dof: int) -> Floats:
    """[[1, −1], [−1, 1]] on one dof of both nodes."""
    out = np.zeros((12, 12))
    out[np.ix_([dof, dof + 6], [dof, dof + 6])] = [[1.0, -1.0], [-1.0, 1.0]]
    return out


@cache
def _spread(dof: int) -> Floats:
    """Consistent mass of a linear field: [[1/3, 1/6], [1/6, 1/3]]."""
    out = np.zeros((12, 12))
    out[np.ix_([dof, dof + 6], [dof, dof + 6])] = [[1 / 3, 1 / 6], [1 / 6, 1 / 3]]
    return out


def _embed(small: Floats, plane: str) -> Floats:
    """A 4 × 4 bending matrix (w1, slope1, w2, slope2) in the element's dofs.

    In the x-y plane θ_z = dv/dx; in the x-z plane θ_y = −dw/dx.
    """
    dofs, sign = ([1, 5, 7, 11], 1.0) if plane == "z" else ([2, 4, 8, 10], -1.0)
    turn = np.diag([1.0, sign, 1.0, sign])
    out = np.zeros((12, 12))
    out[np.ix_(dofs, dofs)] = turn @ small @ turn
    return out


def _blocks(ww: Floats, wt: Floats, tt: Floats) -> tuple[Floats, Floats, Floats]:
    """Split a bending matrix by its powers of h: deflections, mixed, slopes."""
    a, b, c = (np.zeros((4, 4)) for _ in range(3))
    a[np.ix_([0, 2], [0, 2])] = ww
    b[np.ix_([0, 2], [1, 3])] = wt
    b[np.ix_([1, 3], [0, 2])] = wt.T
    c[np.ix_([1, 3], [1, 3])] = tt
    return a, b, c


@cache
def bending_stiffness(plane: str) -> tuple[Floats, ...]:
    """k_0, k_1, k_2, k_3 of one plane."""
    a, b, c = _blocks(
        np.array([[12.0, -12.0], [-12.0, 12.0]]),
        np.array([[6.0, 6.0], [-6.0, -6.0]]),
        np.array([[4.0, 2.0], [2.0, 4.0]]),
    )
    d = np.zeros((4, 4))
    d[np.ix_([1, 3], [1, 3])] = [[1.0, -1.0], [-1.0, 1.0]]
    return tuple(_embed(m, plane) for m in (a, b, c, d))


@cache
def bending_mass(plane: str) -> tuple[tuple[Floats, ...], ...]:
    """m_ij of one plane: rows i the powers of Φ, columns j those of h."""
    rows = (
        ((13 / 35, 9 / 70), (11 / 210, -13 / 420), (1 / 105, -1 / 140)),
        ((7 / 10, 3 / 10), (11 / 120, -3 / 40), (1 / 60, -1 / 60)),
        ((1 / 3, 1 / 6), (1 / 24, -1 / 24), (1 / 120, -1 / 120)),
    )
    out = []
    for (ww, ww_across), (wt, wt_across), (tt, tt_across) in rows:  # alike from both ends
        blocks = _blocks(
            np.array([[ww, ww_across], [ww_across, ww]]),
            np.array([[wt, wt_across], [-wt_across, -wt]]),
            np.array([[tt, tt_across], [tt_across, tt]]),
        )
        out.append(tuple(_embed(m, plane) for m in blocks))
    return tuple(out)


@cache
def rotary_mass(plane: str) -> tuple[tuple[Floats, ...], ...]:
    """Rotary inertia ρI of one plane: powers of Φ by powers 1/h, 1, h."""
    rows = (
        (6 / 5, 1 / 10, 2 / 15, -1 / 30),
        (0.0, -1 / 2, 1 / 6, -1 / 6),
        (0.0, 0.0, 1 / 3, 1 / 6),
    )
    out = []
    for ww, wt, tt, cross in rows:
        blocks = _blocks(
            np.array([[ww, -ww], [-ww, ww]]),
            np.array([[wt, wt], [-wt, -wt]]),
            np.array([[tt, cross], [cross, tt]]),
        )
        out.append(tuple(_embed(m, plane) for m in blocks))
    return tuple(out)


# --- values of the beams of a case: its sections and materials put together


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
    G = _shear_modulus(case, parameters, beam, E, sheared)
    return BeamValues(
        EA=E * section.area,
        EI_z=E * section.inertia_z,
        EI_y=E * section.inertia_y,
        GJ=G * section.torsion_constant,
        shear=G * section.area * section.shear_coefficient if sheared else None,
        mass=rho * section.area,
        polar=rho * section.polar_inertia,
        rotary_z=rho * section.inertia_z,
        rotary_y=rho * section.inertia_y,
    )


def _shear_modulus(
    case: CaseFile, parameters: ModelParameters, beam: Any, E: Scalar, sheared: bool
) -> Scalar:
    """G = E/(2(1 + ν)), or as given; not needed by planar beams without shear."""
    data: Any = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    if getattr(data, "shear_modulus", None) is not None:
        return parameters.number(path + "shear_modulus", data.shear_modulus)
    if getattr(data, "poissons_ratio", None) is not None:
        nu = parameters.number(path + "poissons_ratio", data.poissons_ratio)
        return E / ((nu + 1.0) * 2.0)
    if case.mechanism.space == "planar" and not sheared:
        return 0.0
    message = "needs poissons_ratio or shear_modulus for torsion or shear"
    raise MechanismError(f"mechanism.materials.{beam.material}", message)


def tapered_values(
    case: CaseFile, parameters: ModelParameters, link: Any, share: Scalar | Floats
) -> BeamValues:
    """Values at a share of the length, the sections' dimensions running linearly.

    At many shares at once, arrays, where no design parameter is in them: see `is_settled`.
    """
    a, b = case.mechanism.sections[link.section.start], case.mechanism.sections[link.section.end]

    def number(key: str, value: float) -> Scalar:
        low = parameters.number(f"sections.{link.section.start}.{key}", value)
        high = parameters.number(f"sections.{link.section.end}.{key}", getattr(b, key))
        return low + (high - low) * share  # type: ignore[operator, return-value]

    return _values(case, parameters, link, section_values(a, number))


def is_settled(parameters: ModelParameters, link: Any) -> bool:
    """Whether no design parameter touches the sections and the material of a tapered beam."""
    owners = (
        f"sections.{link.section.start}.",
        f"sections.{link.section.end}.",
        f"materials.{link.material}.",
    )
    return not any(path.startswith(owners) for path in parameters.by_path)
