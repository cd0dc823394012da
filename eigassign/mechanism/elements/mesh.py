"""A link as a finite-element mesh in its own frame: affine matrices, nodes, rigid motion.

The matrices are sums of (scalar coefficient) × (constant sparse matrix); equal coefficients are
merged, and what is constant becomes one matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.elements.beam import Shear
from eigassign.mechanism.elements.profiles import Profile
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, skew, some
from eigassign.series.expression import Expression, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
_PLACES = {
    space: np.array([kept.index(dof) if dof in kept else -1 for dof in range(6)])
    for space, kept in DOFS.items()
}


class Term(NamedTuple):
    """coefficient × constant matrix; one term of an affine local matrix."""

    coefficient: Scalar
    matrix: sparse.csr_array


def total(terms: Sequence[Term], values: Floats) -> sparse.csr_array:
    """Σ value × matrix."""
    out = terms[0].matrix * float(values[0])
    for term, value in zip(terms[1:], values[1:], strict=True):
        out = out + term.matrix * float(value)
    return sparse.csr_array(out)


class Strand(NamedTuple):
    """A row of beam elements from node to node, for what lies between the nodes."""

    slots: Sequence[Ints]  # per node its six slots
    points: Sequence[Objects]  # per node its place, m
    axes: Floats | None  # rows: x, y, z of the elements in the link's axes; None where no matter
    shear: Sequence[tuple[Shear, Shear]]  # per element, of bending in its x-y and x-z plane
    profiles: Sequence[Profile] = ()  # per element its values


@dataclass(frozen=True)
class LinkMesh:
    """One link: ``nodes`` maps a name to the local dofs of that node (None: rigidly attached).

    ``rigid`` are the terms ν_b N_b of N, (n_local, n_twist): nodal motion per twist of the origin.
    ``positions`` are those of the named nodes; ``strands`` are the beams, where it consists of any.
    """

    n_local: int
    nodes: dict[str, Ints]
    positions: dict[str, Objects]
    stiffness: Sequence[Term]
    mass: Sequence[Term]
    rigid: Sequence[Term]
    strands: Sequence[Strand] = ()
    reduction: Reduction | None = None


@dataclass(frozen=True, eq=False)
class Reduction:
    """The origin of a reduced link: motion of ``mesh`` = ``basis`` × reduced local motion."""

    mesh: LinkMesh
    basis: Floats  # (mesh.n_local, n_reduced)
    interior: Ints  # local dofs of ``mesh`` that are no unknowns any more


@dataclass
class Entries:
    """Collects entries of an affine matrix by coefficient while a mesh is built."""

    size: tuple[int, int]
    groups: dict[object, tuple[Scalar, list[tuple[Ints, Ints, Floats]]]] = field(
        default_factory=dict
    )

    def add(self, coefficient: Scalar, rows: Ints, columns: Ints, values: Floats) -> None:
        """coefficient × values at (rows, columns); constants are folded into the values."""
        key: object = "constant"
        if isinstance(coefficient, Expression):
            factor, atom = coefficient.single()
            key, values = atom, values * factor
            coefficient = Expression(coefficient.recorder, 0.0, {atom: 1.0})
        else:
            coefficient, values = 1.0, values * coefficient
        self.groups.setdefault(key, (coefficient, []))[1].append((rows, columns, values))

    def add_block(self, coefficient: Scalar, dofs: Ints, block: Floats) -> None:
        """coefficient × a small dense matrix on the given dofs (negative ones are left out)."""
        i, j = np.nonzero(block)
        keep = (dofs[i] >= 0) & (dofs[j] >= 0)
        i, j = i[keep], j[keep]
        if len(i):
            self.add(coefficient, dofs[i], dofs[j], block[i, j])

    def terms(self) -> list[Term]:
        """The affine terms, in the order of first appearance."""
        out = []
        for coefficient, parts in self.groups.values():
            rows, columns, values = (np.concatenate(p) for p in zip(*parts, strict=True))
            matrix = sparse.csr_array((values, (rows, columns)), shape=self.size)
            out.append(Term(coefficient, matrix))
        return out


def node_dofs(first: int, space: str) -> Ints:
    """Six slots of a node's dofs; −1 for those a planar mechanism has not."""
    return np.where(_PLACES[space] >= 0, first + _PLACES[space], -1)


def chain_dofs(count: int, space: str) -> Ints:
    """The slots of ``count`` nodes one after the other, (count, 6)."""
    first = len(DOFS[space]) * np.arange(count)[:, None]
    return np.where(_PLACES[space] >= 0, first + _PLACES[space], -1)


def rigid_motion(
    positions: Sequence[Objects], dofs: Sequence[Ints], n: int, space: str
) -> list[Term]:
    """N: node motion v + ω × X, ω per twist (v, ω) of the origin, as affine terms."""
    kept = list(DOFS[space])
    entries = Entries((n, len(kept)))
    for X, slots in zip(positions, dofs, strict=True):
        entries.add(1.0, slots[kept], np.arange(len(kept)), np.ones(len(kept)))
        lever = skew(X) * -1.0
        for i in range(3):
            for j in range(3):
                value = lever[i, j]
                if slots[i] >= 0 and 3 + j in kept and some(value):
                    at = np.array([slots[i]]), np.array([kept.index(3 + j)])
                    entries.add(value, *at, np.ones(1))
    return entries.terms()


def body_block(mass: Scalar, inertia: Sequence[Scalar], lever: Objects) -> Objects:
    """Mass matrix (6, 6) of a rigid body at a node from its centre of mass at ``lever``.

    [[m I, −m[c]×], [m[c]×, J − m[c]×[c]×]] with J (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the centre.
    """
    S = skew(lever)
    out = np.zeros((6, 6), dtype=object)
    xx, yy, zz, xy, xz, yz = inertia
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=object)
    for i in range(3):
        out[i, i] = mass
        for j in range(3):
            out[i, 3 + j] = S[i, j] * -1.0 * mass if some(S[i, j]) else 0.0
            out[3 + i, j] = S[i, j] * mass if some(S[i, j]) else 0.0
            square: Scalar = J[i, j]
            for k in range(3):
                if some(S[i, k]) and some(S[k, j]):
                    square = square - S[i, k] * S[k, j] * mass
            out[3 + i, 3 + j] = square
    return out


def add_scalars(entries: Entries, slots: Ints, block: Objects) -> None:
    """Add a small matrix of scalars at one node."""
    for i in range(len(slots)):
        for j in range(len(slots)):
            if slots[i] >= 0 and slots[j] >= 0 and some(block[i, j]):
                at = np.array([slots[i]]), np.array([slots[j]])
                entries.add(block[i, j], *at, np.ones(1))
