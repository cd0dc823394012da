"""Beam elements: axial, torsion and two bendings, Euler-Bernoulli or Timoshenko, consistent mass.

An element of length h has matrices that are affine in few scalars; per plane of bending, with
Φ = 12EI/(κGA h²) (0 for Euler-Bernoulli),

    k = (EA/h) k_a + (GJ/h) k_t + EI/(1+Φ) (h⁻³ k_0 + h⁻² k_1 + h⁻¹ k_2 + Φ h⁻¹ k_3)
    m = ρA h m_a + ρI_p h m_t + ρA/(1+Φ)² Σ_{i,j} Φ^i h^{j+1} m_ij  (+ rotary inertia with shear)

(cubic Hermite bending; Przemieniecki, Theory of Matrix Structural Analysis, §5.6 and §11.7 with
shear and rotary inertia). Dofs of an element: (u_x, u_y, u_z, θ_x, θ_y, θ_z) at both nodes; a
planar mechanism keeps (u_x, u_y, θ_z).

Where the section varies, the energies are integrated over the element. Each value is its mean and
further Legendre polynomials, EI(ξ) = Σ_l EI_l P_l(2ξ − 1). Strains are linear at most, so P_2 is
the last in k; areas are quadratic at most, so it is in m too, but for the rotary inertia. Stretch,
twist and shear strain are constant, so that of EA, GJ and κGA only the mean counts. The shear
strain is that of least energy, see `Shear`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.mechanism.elements.sections import Profile
from eigassign.series.expression import Scalar, is_constant

RealOrComplex = NDArray[Any]  # real or complex: polynomials do not mind
QUADRATIC = 2  # degree of an area along a taper, and of products of linear shapes
PLANES = ((1, 5, 1.0), (2, 4, -1.0))  # deflection, rotation: θ_z = dv/dx, θ_y = −dw/dx


class ElementTerm(NamedTuple):
    """coefficient × constant 12 × 12 matrix, or one matrix an element (n, 12, 12)."""

    coefficient: Scalar
    matrix: Floats


class Shear(NamedTuple):
    """Shapes of bending in one plane: Φ, and Φ r where the section varies; 0 without shear.

    Cubic deflections with a constant shear strain γ have the curvature

        h² κ = bᵀ d + (tᵀ d + 6 h γ) τ,   τ = 2ξ − 1,   d = (w1, h θ1, w2, h θ2),

    b = (0, −1, 0, 1), t = (6, 3, −6, 3). The γ of least energy ∫ EI κ² + κGA γ² is

        −6 h γ = Φ/(1+Φ) (t + r b)ᵀ d,   Φ = 12 EI_s/(κGA h²),   r = EI_1/EI_s

    with EI_s = 3 ∫ EI τ² dξ.
    """

    phi: Scalar
    skew: Scalar


def shear(profile: Profile, h: Scalar) -> tuple[Shear, Shear]:
    """The shear numbers of bending in the element's x-y and x-z plane."""
    found = []
    for key, kGA in (("EI_z", profile[0].shear_z), ("EI_y", profile[0].shear_y)):
        if kGA is None:
            return Shear(0.0, 0.0), Shear(0.0, 0.0)
        EI = _antisymmetric([getattr(beam, key) for beam in profile])
        if is_constant(EI) and not np.any(EI):  # out of the plane of a planar mechanism
            found.append(Shear(0.0, 0.0))
            continue
        phi = EI * 12.0 / (kGA * h**2.0)
        skew = getattr(profile[1], key) / EI * phi if len(profile) > 1 else 0.0
        found.append(Shear(phi, skew))
    return found[0], found[1]


def _antisymmetric(EI: Sequence[Scalar]) -> Scalar:
    """EI_s = 3 ∫ EI (2ξ − 1)² dξ."""
    return EI[0] if len(EI) == 1 else EI[0] + EI[2] * 0.4


def element_stiffness(profile: Profile, h: Scalar) -> list[ElementTerm]:
    """Affine terms of k; h in m.

    Where EI varies, its antisymmetric mean EI_s takes its place, and there come in addition, with
    the symbols of `Shear`,

        h⁻³ [ EI_1/(1+Φ) (b tᵀ + t bᵀ)/3 − (2 EI_2/5 + Φ r EI_1/(3 (1+Φ))) b bᵀ ] .
    """
    beam = profile[0]
    terms = [ElementTerm(beam.EA / h, _along(0)), ElementTerm(beam.GJ / h, _along(3))]
    for key, plane, (phi, skew) in zip(("EI_z", "EI_y"), "zy", shear(profile, h), strict=True):
        each = [getattr(beam, key) for beam in profile]
        EI = _antisymmetric(each)
        stiff = EI if _is_zero(phi) else EI / (phi + 1.0)
        matrices = bending_stiffness(plane)
        coefficients = (stiff / h**3.0, stiff / h**2.0, stiff / h, stiff * phi / h)
        terms += [ElementTerm(c, m) for c, m in zip(coefficients, matrices, strict=True)]
        if len(each) > 1:
            lean = each[1] if _is_zero(phi) else each[1] / (phi + 1.0)
            terms += [
                ElementTerm(c, m)
                for c, m in zip((lean / h**2.0, lean / h), leaning_stiffness(plane), strict=True)
            ]
            bent = each[2] * 0.4 + lean * skew * (1.0 / 3.0)
            terms.append(ElementTerm(bent / h * -1.0, matrices[3]))
    return _folded(terms)


def element_mass(profile: Profile, h: Scalar) -> list[ElementTerm]:
    """Affine terms of the consistent m."""
    bent = shear(profile, h)
    terms: list[ElementTerm] = []
    for degree, beam in enumerate(profile):
        if degree <= QUADRATIC:
            terms.append(ElementTerm(beam.mass * h, _along(0, degree)))
            terms.append(ElementTerm(beam.polar * h, _along(3, degree)))
        for rotary, plane, each in zip((beam.rotary_z, beam.rotary_y), "zy", bent, strict=True):
            scale = 1.0 if _is_zero(each.phi) else (each.phi + 1.0) ** -2.0
            if degree <= QUADRATIC:
                matrices, lengths = _mass("deflection", plane, degree), (h, h**2.0, h**3.0)
                terms += _polynomial(beam.mass * scale, each, matrices, lengths)
            if beam.shear_z is not None:
                matrices, lengths = _mass("rotation", plane, degree), (h**-1.0, 1.0, h)
                terms += _polynomial(rotary * scale, each, matrices, lengths)
    return _folded(terms)


def _folded(terms: list[ElementTerm]) -> list[ElementTerm]:
    """The sum with all constant coefficients in one matrix: most elements have no others."""
    varying: list[ElementTerm] = []
    total = np.zeros((12, 12))
    for term in terms:
        if is_constant(term.coefficient):
            total = total + np.multiply.outer(term.coefficient, term.matrix)
        else:
            varying.append(term)
    return [*varying, ElementTerm(1.0, total)] if total.any() else varying


def bending_shapes(
    parts: tuple[Floats, ...], xi: RealOrComplex, phi: RealOrComplex, skew: RealOrComplex
) -> RealOrComplex:
    """What bends per (w1, h θ1, w2, h θ2) at ξ = x/h in an element with `Shear` Φ, Φ r, (…, 4).

    `DEFLECTION`, whose products integrate to the consistent mass,

    (1+Φ) w = (1−3ξ²+2ξ³ + Φ(1−ξ)) w1 + (ξ−2ξ²+ξ³ + Φ(ξ−ξ²)/2) h θ1
            + (3ξ²−2ξ³ + Φξ) w2 + (−ξ²+ξ³ − Φ(ξ−ξ²)/2) h θ2
            + Φ r (ξ−3ξ²+2ξ³)/6 (h θ1 − h θ2),   θ = dw/dx less the shear angle
    (Przemieniecki, Theory of Matrix Structural Analysis, §11.7, for r = 0), cubic Hermite for
    Φ = 0; and `ROTATION` of the section, whose products integrate to the rotary inertia,

    (1+Φ) h θ = −6(ξ−ξ²) w1 + (1−4ξ+3ξ² + Φ(1−ξ)) h θ1
              + 6(ξ−ξ²) w2 + (−2ξ+3ξ² + Φξ) h θ2 − Φ r (ξ−ξ²) (h θ1 − h θ2) .
    """
    powers = np.stack([xi**k for k in range(parts[0].shape[1])], axis=-1)
    plain, sheared, skewed = (powers @ part.T for part in parts)
    whole = plain + sheared * np.asarray(phi)[..., None] + skewed * np.asarray(skew)[..., None]
    return np.asarray(whole / (1.0 + phi)[..., None])


def shares(bent: Shear) -> list[Scalar]:
    """Factors of the parts of `DEFLECTION`: 1, Φ and Φ r over 1 + Φ, no zeros behind."""
    if _is_zero(bent.phi):
        return [1.0]
    whole = (bent.phi + 1.0) ** -1.0
    return [whole, bent.phi * whole] + ([] if _is_zero(bent.skew) else [bent.skew * whole])


def fields(xi: RealOrComplex, h: RealOrComplex, phi: RealOrComplex) -> RealOrComplex:
    """N (n, n_xi, 6, 12): displacements and rotations at ξ per dof of an element, section's axes.

    xi (n, n_xi), h (n, 1) in m, phi (n, 1, 2, 2): `Shear` of each plane. Stretch and twist are
    linear, bending is that of `bending_shapes`.
    """
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(xi, h, phi))
    for row in (0, 3):
        N[..., row, row], N[..., row, row + 6] = 1.0 - xi, xi
    one = np.ones_like(h)
    for k, (w, slope, sign) in enumerate(PLANES):
        scale = np.stack([one, sign * h, one, sign * h], axis=-1)
        bent = phi[..., k, 0], phi[..., k, 1]
        deflection = bending_shapes(DEFLECTION, xi, *bent) * scale
        rotation = bending_shapes(ROTATION, xi, *bent) * scale * (sign / h)[..., None]
        for j, dof in enumerate((w, slope, w + 6, slope + 6)):
            N[..., w, dof], N[..., slope, dof] = deflection[..., j], rotation[..., j]
    return N


def _polynomial(
    scale: Scalar,
    bent: Shear,
    matrices: tuple[tuple[Floats, ...], ...],
    lengths: tuple[Scalar, ...],
) -> list[ElementTerm]:
    """Σ over 1, Φ, Φ², s, Φ s, s² with s = Φ r, Σ_j length_j matrix_ij."""
    phi, skew = bent
    powers: list[Scalar] = [1.0]
    if not _is_zero(phi):
        powers += [phi, phi * phi]
    if not _is_zero(skew):
        powers += [skew, phi * skew, skew * skew]
    return [
        ElementTerm(scale * power * length, m)
        for power, row in zip(powers, matrices, strict=False)
        for length, m in zip(lengths, row, strict=True)
    ]


def _is_zero(x: Scalar) -> bool:
    return isinstance(x, float | int) and x == 0.0


# --- constant matrices: integrals of products of shapes

# Coefficients of 1, ξ, ξ², … of `bending_shapes`, times 1 + Φ: of 1, Φ and Φ r
DEFLECTION = (
    np.array([[1.0, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]]),
    np.array([[1.0, -1, 0, 0], [0, 0.5, -0.5, 0], [0, 1, 0, 0], [0, -0.5, 0.5, 0]]),
    np.array([[0.0, 0, 0, 0], [0, 1, -3, 2], [0, 0, 0, 0], [0, -1, 3, -2]]) / 6.0,
)
ROTATION = (
    np.array([[0.0, -6, 6], [1, -4, 3], [0, 6, -6], [0, -2, 3]]),
    np.array([[0.0, 0, 0], [1, -1, 0], [0, 0, 0], [0, 1, 0]]),
    np.array([[0.0, 0, 0], [0, -1, 1], [0, 0, 0], [0, 1, -1]]),
)
SHAPES = {  # of the mass, of the rotary inertia, and w' per ξ of what an axial force stretches
    "deflection": DEFLECTION,
    "rotation": ROTATION,
    "slope": tuple(shape[:, 1:] * np.arange(1.0, shape.shape[1]) for shape in DEFLECTION),
}
LINEAR = np.array([[1.0, -1], [0, 1]])
LEGENDRE = (  # P_l(2ξ − 1) in powers of ξ
    (1.0,),
    (-1.0, 2.0),
    (1.0, -6.0, 6.0),
    (-1.0, 12.0, -30.0, 20.0),
    (1.0, -20.0, 90.0, -140.0, 70.0),
)
MULTIPLE = 27720.0  # of 1 … 12: what is divided by it at the end is rounded only once


def _integrals(first: Floats, second: Floats, degree: int) -> Floats:
    """∫ P_l a_i b_j dξ of polynomials a, b, rows of coefficients, over 0 … 1."""
    out = np.empty((len(first), len(second)))
    for i, j in np.ndindex(out.shape):
        product = np.convolve(np.convolve(first[i], second[j]), LEGENDRE[degree])
        out[i, j] = product @ (MULTIPLE / np.arange(1.0, len(product) + 1.0)) / MULTIPLE
    return out


@cache
def _along(dof: int, degree: int | None = None) -> Floats:
    """[[1, −1], [−1, 1]] on one dof of both nodes; with P_l the mass: [[1/3, 1/6], …] of P_0."""
    out, stretch = np.zeros((12, 12)), np.array([[1.0, -1.0], [-1.0, 1.0]])
    small = stretch if degree is None else _integrals(LINEAR, LINEAR, degree)
    out[np.ix_([dof, dof + 6], [dof, dof + 6])] = small
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


def _by_length(bending: Floats, plane: str) -> tuple[Floats, ...]:
    """A matrix per (w1, h θ1, w2, h θ2) split by its powers of h: deflections, mixed, slopes."""
    slopes = np.array([0, 1, 0, 1])
    power = slopes[:, None] + slopes
    return tuple(_embed(np.where(power == k, bending, 0.0), plane) for k in range(3))


@cache
def bending_stiffness(plane: str) -> tuple[Floats, ...]:
    """k_0, k_1, k_2, k_3 of one plane."""
    k = [[12.0, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
    turned = np.outer([0.0, 1, 0, -1], [0, 1, 0, -1])
    return (*_by_length(np.array(k), plane), _embed(turned, plane))


@cache
def leaning_stiffness(plane: str) -> tuple[Floats, ...]:
    """(b tᵀ + t bᵀ)/3 of one plane, see `element_stiffness`: what goes with h⁻² and with h⁻¹."""
    b, t = np.array([0.0, -1, 0, 1]), np.array([6.0, 3, -6, 3])
    return _by_length((np.outer(b, t) + np.outer(t, b)) / 3.0, plane)[1:]


def stretched_slopes(
    force: Scalar, bent: Shear, plane: str, degree: int, h: Scalar
) -> list[ElementTerm]:
    """Affine terms of ∫ N w' w'ᵀ dx in one plane for the axial force N = ``force`` P_l [N].

    For Φ = 0 and constant N they are N/(30 h) [[36, 3h, −36, 3h], …] (Przemieniecki, §15.2).
    """
    scale = force if _is_zero(bent.phi) else force * (bent.phi + 1.0) ** -2.0
    return _polynomial(scale, bent, _mass("slope", plane, degree), (h**-1.0, 1.0, h))


@cache
def _mass(shapes: str, plane: str, degree: int) -> tuple[tuple[Floats, ...], ...]:
    """∫ P_l s sᵀ dξ of one plane, of what goes with 1, Φ, Φ², s, Φ s, s²; columns powers of h."""
    plain, sheared, skewed = SHAPES[shapes]
    pairs = ((plain, plain), (plain, sheared), (sheared, sheared), (plain, skewed),
             (sheared, skewed), (skewed, skewed))  # fmt: skip
    rows = []
    for a, b in pairs:
        product = _integrals(a, b, degree)
        rows.append(product if a is b else product + product.T)
    return tuple(_by_length(row, plane) for row in rows)
