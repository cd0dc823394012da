"""Geometric stiffness k_σ from what acts: of beam elements, and of imported parts.

With the motion of its nodes (d, θ)_a, (d, θ)_b (θ rotation vectors), D = d_b − d_a, h its length, a
frame that follows the chord and the mean roll turns by ρ; in it the ends turn by θ̄. To second order

    ρ_z = D_y/h − D_x D_y/h² − ρ_x ρ_y/2,   ρ_y = −D_z/h + D_x D_z/h² + ρ_x ρ_z/2,
    θ̄ = θ − ρ − ρ × θ/2,   θ̄_ax + θ̄_bx = 0.

The forces N(ξ) along it, T of torsion and the moments M_a, M_b of its ends, the weight p per length
do the work of second order

    Π₂ = ½ ∫ N |w'|² dx + T (θ̄_bx − θ̄_ax)₂ + Σ_ends M · θ̄₂ − ∫ p · (ρ × w̄) dx,

w' the slopes of the deflection, w̄ the deflection from the chord; of p, what lies along the beam is
in N already. k_σ is its Hessian, in the element's dofs and axes as in `beam`: linear in all forces.

What acts on the nodes is in balance with the inertia of the part, or its weight. A part known by
its matrices alone is a strut between its nodes. Its strains are those of the displacements v
against a frame that turns by φ, the rotation that fits the motion of the nodes best (about a line
that they all lie on, their mean turn). To second order the wrenches (F, M) on its nodes at X and
its own weight, M r g on all its dofs, do the work

    Σ [F · (−φ × v + φ × (φ × X)/2) − M · (φ × θ)/2] + vᵀ M r (φ × g) + m g · (φ × (φ × c))/2,

r its translations, c its centre of mass and g = −Σ F/m. What bends between the nodes under the
forces inside is left out, or taken as that of a cubic between two nodes that turn alike, which is
shorter by its arms from the middle: −F · (θ̄ × (θ̄ × (X − X̄)))/6 with θ̄ = θ − φ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse

from eigassign.mechanism.elements.beam import (
    DEFLECTION,
    LEGENDRE,
    ElementTerm,
    Shear,
    shares,
    stretched_slopes,
)
from eigassign.mechanism.elements.mesh import LinkMesh, Term
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, some
from eigassign.series.expression import Scalar, one_atom

Numbers: TypeAlias = Any  # arrays in place of scalars, for many loads and elements
X, Y, Z = range(3)


@dataclass(frozen=True)
class ElementForces:
    """What acts on an element, in its axes.

    ``axial`` are the Legendre coefficients of N(ξ) [N], ``torque`` is T [N m], ``moments`` (2, 3)
    those on its ends a and b [N m], ``weight`` (n_legendre, 3) its own per length [N/m].
    """

    axial: Sequence[Scalar]
    torque: Scalar
    moments: Objects
    weight: Objects


def end_forces(r: Numbers, load: Numbers, h: Numbers) -> ElementForces:
    """The forces in n elements from what their ends receive in m loads, all in their axes.

    r (12, m, n), and the load per length along them (n_legendre, 3, m, n).
    """
    axial = axial_forces(r[6], load[:, X], h)
    return ElementForces(axial, 0.5 * (r[9] - r[3]), np.stack([r[3:6], r[9:]]), load)


def axial_forces(end: Scalar, load: Sequence[Scalar] | Objects, h: Scalar) -> list[Scalar]:
    """Legendre coefficients of N(ξ), N at the end b and those of the load per length along it."""
    axial = [end, *(0.0 for _ in range(len(load) + 1))]
    for degree, p in enumerate(load):  # ∫ P_l dξ from ξ to 1
        share = p * h * (0.5 / (2 * degree + 1))
        axial[degree - 1 if degree else 0] = axial[degree - 1 if degree else 0] + share
        axial[degree + 1] = axial[degree + 1] + share * -1.0
    return axial


def stress_terms(
    forces: ElementForces, h: Scalar, bent: tuple[Shear, Shear], planar: bool
) -> list[ElementTerm]:
    """Affine terms of k_σ (12, 12); h in m."""
    terms: list[ElementTerm] = []
    for degree, N in enumerate(forces.axial):
        for plane, each in zip("z" if planar else "zy", bent, strict=False):
            terms += stretched_slopes(N, each, plane, degree, h) if some(N) else []
    works = [(forces.moments[end, Z], moment_work(end, Z), 0) for end in (0, 1)]
    if not planar:
        works += [(forces.moments[end, Y], moment_work(end, Y), 0) for end in (0, 1)]
        works.append((forces.torque, moment_work(1, X) - moment_work(0, X), 0))
        for degree, p in enumerate(forces.weight):
            for axis, each in ((Y, bent[1]), (Z, bent[0])):
                works += [
                    (p[axis] * share, load_work(axis, degree, part), 2)
                    for part, share in enumerate(shares(each))
                ]
    return terms + [
        ElementTerm(value * h ** float(power - k), matrix)
        for value, matrices, power in works
        for k, matrix in enumerate(matrices)
        if some(value) and matrix.any()
    ]


@cache
def moment_work(end: int, axis: int) -> Floats:
    """Hessian of θ̄₂ of an end about an axis: what goes with 1, 1/h and 1/h², (3, 12, 12)."""
    D, turns, rho = _motions()
    mean = 0.5 * (turns[0] + turns[1])
    over_square = np.zeros((2, 3, 12, 12))  # D_x D_y and D_x D_z over h²
    over_square[:, 2] = [_product(D[X], D[i])[0] for i in (Y, Z)]
    frame = (
        -0.5 * _crossed(rho, mean, X),  # no mean roll is left
        over_square[1] + 0.5 * _product(rho[X], rho[Z]),
        -over_square[0] - 0.5 * _product(rho[X], rho[Y]),
    )
    return np.asarray(-frame[axis] - 0.5 * _crossed(rho, turns[end], axis))


@cache
def load_work(axis: int, degree: int, part: int) -> Floats:
    """Hessian of −∫ P_l (ρ × w̄)_axis dx/h²: what goes with 1, 1/h and 1/h², (3, 12, 12).

    (ρ × w̄)_y = −ρ_x w̄_z, (ρ × w̄)_z = ρ_x w̄_y; w̄_y = Σ h S θ̄_z, w̄_z = −Σ h S θ̄_y with one part of
    the shapes S of `bending_shapes`.
    """
    _, turns, rho = _motions()
    products = [np.convolve(S, LEGENDRE[degree]) for S in DEFLECTION[part][[1, 3]]]
    means = [float(p @ (1.0 / np.arange(1.0, len(p) + 1.0))) for p in products]
    local = sum(mean * (own[axis] - rho[axis]) for mean, own in zip(means, turns, strict=True))
    return np.asarray(-_product(rho[X], np.asarray(local)))


def _motions() -> tuple[Floats, Floats, Floats]:
    """D, (θ_a, θ_b) and ρ to first order; each a form (2, 12): what goes with 1 and with 1/h."""
    forms = np.zeros((12, 2, 12))
    forms[:, 0] = np.eye(12)
    D, turns = forms[6:9] - forms[:3], np.stack([forms[3:6], forms[9:]])
    rho = np.stack([0.5 * (turns[0, X] + turns[1, X]), -D[Z, ::-1], D[Y, ::-1]])
    return D, turns, rho


def _product(a: Floats, b: Floats) -> Floats:
    """Hessian of a product of forms (2, 12), by powers of 1/h, (3, 12, 12)."""
    out = np.zeros((3, 12, 12))
    for i, j in np.ndindex(2, 2):
        out[i + j] += np.outer(a[i], b[j]) + np.outer(b[j], a[i])
    return out


def _crossed(a: Floats, b: Floats, axis: int) -> Floats:
    """Hessian of (a × b)_axis, (3, 12, 12)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    return _product(a[i], b[j]) - _product(a[j], b[i])


ON_A_LINE = 1e-6  # of the nodes' second moment, about an axis that they do not turn about
BENT = 1.0 / 3.0
AXES = np.eye(3)
# (a × b)_k = Σ CROSSED_kij a_i b_j
CROSSED = np.cross(AXES[:, None], AXES[None]).transpose(2, 0, 1)


def imported_terms(
    mesh: LinkMesh,
    wrenches: Sequence[tuple[str, Objects]],
    spin: Objects | None,
    space: str,
    bent: bool = False,
) -> list[Term]:
    """Affine terms of k_σ (n_local, n_local) of a mesh from what acts on its nodes.

    ``spin`` (6,) is of solids, ρ ω̃ ω̃: xx, yy, zz, xy, xz, yz.
    """
    found: dict[str, Objects] = {}
    for name, wrench in wrenches:
        found[name] = found.get(name, np.zeros(6, dtype=object)) + wrench
    if mesh.whole.stressed is None:
        return _strut_terms(mesh, found, space, bent)
    still = np.zeros(6, dtype=object)
    each = [found.get(name, still) for name in mesh.whole.nodes]
    loads = np.concatenate([*each, still if spin is None else spin])
    acting = [k for k, load in enumerate(loads) if some(load)]
    basis = None if mesh.reduction is None else mesh.reduction.basis
    matrices = mesh.whole.stressed(acting, basis) if acting else []
    return [Term(one_atom(loads[k]), A) for k, A in zip(acting, matrices, strict=True)]


def _strut_terms(
    mesh: LinkMesh, wrenches: Mapping[str, Objects], space: str, bent: bool
) -> list[Term]:
    moved, of_nodes = _node_motions(mesh)
    kept = [d - 3 for d in DOFS[space] if d >= 3]
    phi = _rotation([(X.astype(float), moved[name]) for name, X in mesh.positions.items()], kept)
    Mr, first, m = _momentum(mesh, space)
    middle = np.mean([X.astype(float) for X in mesh.positions.values()], axis=0)
    out: list[Term] = []

    def add(coefficient: Scalar, columns: Floats) -> None:
        if some(coefficient) and columns.any():
            matrix = sparse.csr_array(columns) @ of_nodes.T
            out.append(Term(coefficient, sparse.csr_array(matrix + matrix.T)))

    for name, wrench in wrenches.items():
        v, theta = moved[name][:3], moved[name][3:]
        X = mesh.positions[name].astype(float)
        for axis in range(3):
            lever = _turned_twice(phi, X - first / m, axis) - _mixed(axis, phi, v)
            if bent:
                lever -= BENT * _turned_twice(theta - phi, X - middle, axis)
            turned = Mr.T @ (CROSSED[:, :, axis] @ phi) / m
            add(wrench[axis], of_nodes @ lever - turned)
            add(wrench[3 + axis], of_nodes @ (-0.5 * _mixed(axis, phi, theta)))
    return out


def _mixed(axis: int, a: Floats, b: Floats) -> Floats:
    """(a × b)_axis of two rows of forms (3, n), as (n, n)."""
    return np.asarray(a.T @ CROSSED[axis] @ b)


def _turned_twice(phi: Floats, X: Floats, axis: int) -> Floats:
    """(φ × (φ × X))_axis/2 = (φ_axis X·φ − X_axis φ·φ)/2."""
    return np.asarray(0.5 * (np.outer(phi[axis], X @ phi) - X[axis] * (phi.T @ phi)))


def _node_motions(mesh: LinkMesh) -> tuple[dict[str, Floats], sparse.csr_array]:
    """The motion (6, n) of each node in the n dofs of all nodes, and these among all dofs."""
    own = np.concatenate([slots[slots >= 0] for slots in mesh.nodes.values()])
    of_nodes = sparse.csr_array(
        (np.ones(len(own)), (own, np.arange(len(own)))), (mesh.n_local, len(own))
    )
    return {name: 1.0 * (slots[:, None] == own) for name, slots in mesh.nodes.items()}, of_nodes


def _rotation(nodes: Sequence[tuple[Floats, Floats]], kept: Sequence[int]) -> Floats:
    """φ (3, n): least squares of the displacements, about a line the mean of the turns."""
    places, motions = np.array([X for X, _ in nodes]), np.array([v for _, v in nodes])
    arms = places - places.mean(axis=0)
    moment = sum((arm @ arm) * AXES - np.outer(arm, arm) for arm in arms)
    values, axes = np.linalg.eigh(np.asarray(moment)[np.ix_(kept, kept)])
    whole = AXES[kept].T @ axes
    swept = np.einsum("kij,ai,ajn->kn", CROSSED, arms, motions[:, :3])
    turns = motions[:, 3:].mean(axis=0)
    far = values > ON_A_LINE * max(values.max(initial=0.0), np.square(places).max(initial=0.0))
    each = [
        axis @ swept / value if seen else axis @ turns
        for axis, value, seen in zip(whole.T, values, far, strict=True)
    ]
    return np.asarray(whole @ np.array(each))


def _momentum(mesh: LinkMesh, space: str) -> tuple[Floats, Floats, float]:
    """(M r)ᵀ (3, n_local) of the part, its first moment m c (3,), and m, all without bodies.

    A part without mass has no weight.
    """
    whole, kept = mesh.whole, list(DOFS[space])
    N = np.zeros((whole.n_local, 6))
    N[:, kept] = sum(term.matrix.toarray() for term in whole.rigid)
    Mr = np.asarray(whole.mass[0].matrix @ N[:, :3])
    B, m = N[:, 3:].T @ Mr, float(N[:, 0] @ Mr[:, 0])  # θ · (m c × a)
    if mesh.reduction is not None:
        Mr = mesh.reduction.basis.T @ Mr
    return Mr.T, np.array([B[2, 1], -B[2, 0], -B[0, 1]]), m or 1.0
