"""Geometric stiffness of imported parts: of a solid that of its stress, else that of a strut.

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

import numpy as np
from scipy import sparse

from eigassign.mechanism.elements.mesh import LinkMesh, Term
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, some
from eigassign.series.expression import Scalar, one_atom

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
