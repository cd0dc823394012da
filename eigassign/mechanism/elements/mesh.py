"""A link as a finite-element mesh in its own frame: affine matrices, nodes, rigid motion, bodies.

The matrices are sums of (scalar coefficient) × (constant sparse matrix); equal coefficients are
merged, and what is constant becomes one matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.parts import tensor
from eigassign.mechanism.elements.beam import Shear
from eigassign.mechanism.elements.sections import Profile
from eigassign.mechanism.kinematics.joints import CROSS, DOFS, Objects, multiply, skew, vector
from eigassign.mechanism.kinematics.parameters import STILL, ModelParameters, node_position
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Expression, Scalar, atom_of, parts

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


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


def summed(terms: Sequence[tuple[Scalar, Any]], size: int) -> Objects:
    """Σ coefficient × matrix (size, size) as scalars."""
    out = np.zeros((size, size), dtype=object)
    for coefficient, matrix in terms:
        for i, j in zip(*(each.tolist() for each in matrix.nonzero()), strict=True):
            out[i, j] = out[i, j] + coefficient * float(matrix[i, j])
    return out


class Strand(NamedTuple):
    """A row of beam elements from node to node, for what lies between the nodes."""

    slots: Sequence[Ints]  # per node its six slots
    points: Sequence[Objects]  # per node its place, m
    axes: Floats | None  # rows: x, y, z of the elements in the link's axes; None where no matter
    shear: Sequence[tuple[Shear, Shear]]  # per element, of bending in its x-y and x-z plane
    profiles: Sequence[Profile] = ()  # per element its values
    lengths: Sequence[Scalar] = ()  # per element, m: equal ones to the last digit

    def turned(self, count: int) -> Floats:
        """The turn of ``count`` vectors (3 count, 3 count) from the link's axes to the elements'.

        Raises TypeError where no axes matter.
        """
        return np.asarray(np.kron(np.eye(count), self.axes), dtype=np.float64)  # type: ignore[arg-type]


def element_motion(motion: Floats, axes: Floats) -> Floats:
    """Motion (n, 12, count) of both nodes of each element of a row, in its axes.

    ``motion`` (n + 1, 6, count) is that of the nodes.
    """
    turned = np.concatenate([axes @ motion[:, :3], axes @ motion[:, 3:]], axis=1)
    return np.concatenate([turned[:-1], turned[1:]], axis=1)


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
    lost: Lost | None = None  # of solids
    # of solids: k_σ of unit loads, see `solid_stress`, in a basis (n_local, n) where given
    stressed: Callable[[Sequence[int], Floats | None], list[sparse.csr_array]] | None = None

    @property
    def whole(self) -> LinkMesh:
        """The mesh with all its dofs."""
        return self if self.reduction is None else self.reduction.mesh


class Lost(NamedTuple):
    """What a mesh of solid elements lacks, by `Enriched` of its part."""

    modulus: Scalar
    density: Scalar
    gram: Callable[[Floats], Floats]  # of motions (n_local, count)
    one_layer: Callable[[], bool]  # nothing is known of such meshes of four nodes


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
    groups: dict[int, tuple[Scalar, list[Sequence[Any]]]] = field(default_factory=dict)

    def add(self, coefficient: Scalar, rows: Ints, columns: Ints, values: Floats) -> None:
        """coefficient × values at (rows, columns); constants are folded into the values."""
        factor: Any = coefficient
        atom = -1
        if isinstance(coefficient, Expression):
            factor, atom = coefficient.single()
        self._of(atom, coefficient).append((rows, columns, values * factor))

    def add_scalars(self, scalars: Sequence[Scalar], rows: Ints, columns: Ints) -> None:
        """One scalar at each (row, column), atom by atom; none where a place is negative."""
        found: dict[int, tuple[Scalar, list[tuple[int, int, float]]]] = {}
        for scalar, row, column in zip(scalars, rows.tolist(), columns.tolist(), strict=True):
            if row >= 0 and column >= 0:
                for atom, factor in parts(scalar):
                    found.setdefault(atom, (scalar, []))[1].append((row, column, factor))
        for atom, (scalar, entries) in found.items():
            self._of(atom, scalar).append(tuple(zip(*entries, strict=True)))

    def _of(self, atom: int, scalar: Scalar) -> list[Sequence[Any]]:
        """The entries of one atom of a scalar, or of the number 1."""
        return self.groups.setdefault(atom, (atom_of(scalar, atom), []))[1]

    def terms(self) -> list[Term]:
        """The affine terms, in the order of first appearance."""
        out = []
        for coefficient, entries in self.groups.values():
            rows, columns, values = (np.concatenate(each) for each in zip(*entries, strict=True))
            matrix = sparse.csr_array((values, (rows, columns)), shape=self.size)
            out.append(Term(coefficient, matrix))
        return out


def chain_dofs(count: int, space: str) -> Ints:
    """The six slots of each of ``count`` nodes one after the other, (count, 6).

    −1 stands for those that a planar mechanism has not.
    """
    kept = list(DOFS[space])
    slots = np.full((count, 6), -1)
    slots[:, kept] = np.arange(count * len(kept)).reshape(count, -1)
    return slots


def rigid_motion(positions: Sequence[Objects], slots: Ints, n: int, space: str) -> list[Term]:
    """N (n, n_twist): node motion v + ω × X, ω per twist (v, ω) of the origin, as affine terms."""
    kept = list(DOFS[space])
    entries, own = Entries((n, len(kept))), slots[:, kept].ravel()
    entries.add(1.0, own, np.tile(np.arange(len(kept)), len(slots)), np.ones(len(own)))
    for i, j, component, sign in CROSS:  # ω × X = −[X]× ω
        if i in kept and 3 + j in kept:
            column = np.full(len(slots), kept.index(3 + j))
            entries.add_scalars([X[component] * -sign for X in positions], slots[:, i], column)
    return entries.terms()


def add_body(
    entries: Entries, slots: Ints, mass: Scalar, inertia: Sequence[Scalar], lever: Objects
) -> None:
    """Add the mass matrix of a rigid body at a node, its centre of mass being at ``lever``.

    [[m I, −m[c]×], [m[c]×, J − m[c]×[c]×]] with J (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the centre.
    """
    xx, yy, zz, xy, xz, yz = inertia
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=object)
    m, S = np.diag(np.array([mass] * 3, dtype=object)), skew(lever)
    mS = multiply(S, m)
    block = np.block([[m, mS * -1.0], [mS, J - multiply(S, mS)]])
    entries.add_scalars(block.ravel().tolist(), np.repeat(slots, 6), np.tile(slots, 6))


def add_bodies(
    case: CaseFile,
    parameters: ModelParameters,
    name: str,
    mass: Entries,
    nodes: Mapping[str, Ints],
    arms: Mapping[str, Objects] = MappingProxyType({}),
) -> None:
    """The point masses and rigid bodies fixed to a link's nodes.

    ``arms`` are the places of nodes without slots of their own, which hang on the origin rigidly.
    """
    for key, body in case.mechanism.bodies.items():
        link, _, node = body.at.partition(".")
        if link == name:
            turn = parameters.moved.get((link, node), STILL).turn
            offset = multiply(turn, parameters.vector(f"bodies.{key}.offset", body.offset))
            lever = offset + arms.get(node, 0.0)
            if isinstance(body.inertia, tuple):
                J = turn @ np.array(tensor(body.inertia)) @ turn.T
                inertia = tuple(J[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())
                body = body.model_copy(update={"inertia": inertia})
            _add(parameters, f"bodies.{key}", body, mass, nodes["@origin" if arms else node], lever)


def _add(
    parameters: ModelParameters, path: str, body: Any, mass: Entries, slots: Ints, lever: Objects
) -> None:
    """One body; an inertia that is one number is I_zz of a planar one."""
    inertia: list[Scalar] = [0.0] * 6  # Ixx, Iyy, Izz, Ixy, Ixz, Iyz
    if isinstance(body.inertia, (tuple, list)):
        inertia[: len(body.inertia)] = [float(v) for v in body.inertia]
    else:
        inertia[2] = parameters.number(f"{path}.inertia", body.inertia)
    add_body(mass, slots, parameters.number(f"{path}.mass", body.mass), inertia, lever)


def rigid_link(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """A rigid link: one node at its origin carries its mass, named nodes hang on it rigidly."""
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    width, slots = len(DOFS[space]), chain_dofs(1, space)
    nodes, mass = {"@origin": slots[0]}, Entries((width, width))
    named = ["start", *(["end"] if link.length is not None else []), *(link.nodes or {})]
    arms = {key: node_position(case, parameters, tree, (name, key)) for key in named}
    center = parameters.vector(f"links.{name}.center", link.center)
    _add(parameters, f"links.{name}", link, mass, slots[0], center)
    add_bodies(case, parameters, name, mass, nodes, arms)
    rigid = rigid_motion([vector([0.0])], slots, width, space)
    return LinkMesh(width, nodes, arms, [], mass.terms(), rigid)
