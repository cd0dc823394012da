"""The mesh of any link in its own frame: beam, rigid body, frame of beams, superelement, solid.

The matrices are sums of (scalar coefficient) × (constant sparse matrix); equal coefficients are
merged, and what is constant becomes one matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.parts import tensor
from eigassign.mechanism.elements.beam import (
    ElementTerm,
    Shear,
    element_mass,
    element_stiffness,
    shear,
)
from eigassign.mechanism.elements.sections import Profile, beam_profiles, beam_values, each_element
from eigassign.mechanism.kinematics.joints import (
    CROSS,
    DOFS,
    Objects,
    multiply,
    rotation,
    skew,
    vector,
)
from eigassign.mechanism.kinematics.parameters import (
    STILL,
    ModelParameters,
    length,
    link_type,
    node_position,
    station,
)
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Expression, Scalar, atom_of, is_constant, parts


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


class LinkMesh(NamedTuple):
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
    """The six slots of each of ``count`` nodes in turn, (count, 6); −1 for what a plane has not."""
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
    """The bodies fixed to a link's nodes; those at ``arms`` hang on the origin rigidly."""
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


def copies_of(
    case: CaseFile, parameters: ModelParameters, tree: Topology
) -> dict[str, tuple[object, ...]]:
    """By name of a beam without bodies or riders all that its mesh depends on, equal for copies."""
    loaded = {body.at.partition(".")[0] for body in case.mechanism.bodies.values()}
    found: dict[str, tuple[object, ...]] = {}
    for name, link in case.mechanism.links.items():
        plain = link_type(case, name) == "beam" and name not in loaded and not tree.riders[name]
        if plain and is_constant(length(case, parameters, name)):
            data = link.model_dump(exclude={"reduce_to"})
            found[name] = tuple((key, str(value)) for key, value in data.items())
    return found


# --- beams


class _Beams:
    """Elements of beams on their way to the mesh of a link with ``count`` nodes."""

    def __init__(self, count: int, space: str) -> None:
        self.slots, self.space = chain_dofs(count, space), space
        self.n_local = len(DOFS[space]) * count
        self.stiffness, self.mass = (Entries((self.n_local,) * 2) for _ in range(2))

    def add(self, profile: Profile, h: Scalar, turn: Floats, nodes: Sequence[int] | Ints) -> None:
        """Elements of one profile and length from each of the ``nodes`` to the next.

        ``turn`` (3, 3) has the section's axes as rows, in those of the link.
        """
        R, slots = np.kron(np.eye(4), turn), self.slots[nodes]
        dofs = np.hstack([slots[:-1], slots[1:]])
        for target, terms in (
            (self.stiffness, element_stiffness(profile, h)),
            (self.mass, element_mass(profile, h)),
        ):
            for coefficient, matrix in terms if len(profile) == 1 else _atom_by_atom(terms):
                turned = R.T @ matrix @ R
                size = np.abs(R).T @ np.abs(matrix) @ np.abs(R)
                turned[np.abs(turned) < 1e-14 * size] = 0.0  # round-off of the turn
                i, j = np.nonzero(turned.any(axis=0) if turned.ndim == 3 else turned)
                rows, columns = dofs[:, i], dofs[:, j]
                kept = (rows >= 0) & (columns >= 0)
                if kept.any():
                    values = np.broadcast_to(turned[..., i, j], kept.shape)
                    target.add(coefficient, rows[kept], columns[kept], values[kept])

    def mesh(
        self,
        case: CaseFile,
        parameters: ModelParameters,
        name: str,
        positions: Sequence[Objects],
        named: Mapping[str, int],
        strands: Sequence[Strand],
    ) -> LinkMesh:
        """The mesh with the bodies of the link, its nodes at ``positions``."""
        nodes = {key: self.slots[k] for key, k in named.items()}
        places = {key: positions[k] for key, k in named.items()}
        add_bodies(case, parameters, name, self.mass, nodes)
        rigid = rigid_motion(positions, self.slots, self.n_local, self.space)
        terms = self.stiffness.terms(), self.mass.terms(), rigid
        return LinkMesh(self.n_local, nodes, places, *terms, strands)


def beam_mesh(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """A straight beam along x, in two segments where a carriage or nut rides on it."""
    link: Any = case.mechanism.links[name]
    total, n = length(case, parameters, name), link.elements
    riders, turn = tree.riders[name], _rolled(link)
    pieces: list[tuple[Scalar, Scalar, int]] = [(0.0, total, n)]  # start, span, elements
    if riders:
        at, first = station(parameters, tree, riders[0]), max(1, n // 2)
        pieces = [(0.0, at, first), (at, total - at, max(1, n - first))]
    beams = _Beams(sum(n for _, _, n in pieces) + 1, case.mechanism.space)
    positions: list[Objects] = [vector([0.0])]
    bent: list[tuple[Shear, Shear]] = []
    profiles: list[Profile] = []
    lengths: list[Scalar] = []
    for start, span, n in pieces:
        h, first = span * (1.0 / n), len(positions) - 1
        shares = (0.0, 1.0) if not riders else (start / total, (start + span) / total)
        found = beam_profiles(case, parameters, link, shares, n, together=is_constant(h))
        count = n // len(found)
        for k, profile in enumerate(found):
            beams.add(profile, h, turn, first + k * count + np.arange(count + 1))
            each = each_element(profile, count)
            profiles += each
            bent += [shear(own, h) for own in each]
        lengths += [h] * n
        positions += [vector([start + span * (k / n)]) for k in range(1, n + 1)]
    named = {"start": 0, "end": len(positions) - 1} | {f"@{r}": pieces[0][2] for r in riders}
    strand = Strand(list(beams.slots), positions, turn, bent, profiles, lengths)
    return beams.mesh(case, parameters, name, positions, named, (strand,))


class BentElement(NamedTuple):
    """An element from node to node of a bent link; ``turn`` as of `_Beams.add`."""

    ends: tuple[int, int]
    turn: Floats
    h: float
    profile: Profile


def bent_link(
    case: CaseFile,
    parameters: ModelParameters,
    name: str,
    places: Floats,
    named: Mapping[str, int],
    elements: Sequence[BentElement],
) -> LinkMesh:
    """A link of beams of which each element lies as it will, between nodes at ``places`` (n, 3)."""
    beams, strands = _Beams(len(places), case.mechanism.space), []
    points = [vector(place.tolist()) for place in places]
    for ends, turn, h, profile in elements:
        beams.add(profile, h, turn, list(ends))
        rows = [beams.slots[k] for k in ends], [points[k] for k in ends]
        strands.append(Strand(*rows, turn, [shear(profile, h)], [profile], [h]))
    return beams.mesh(case, parameters, name, points, named, strands)


def _atom_by_atom(terms: Sequence[ElementTerm]) -> list[ElementTerm]:
    """The sum without sums in its coefficients: those of a taper's elements are alike."""
    return [
        ElementTerm(atom_of(c, atom) * factor, matrix)
        for c, matrix in terms
        for atom, factor in parts(c)
    ]


def _rolled(beam: Any) -> Floats:
    """(3, 3) turn of the section's axes about the beam's."""
    angle = float(getattr(beam, "roll", 0.0) or 0.0)
    return np.asarray(rotation(np.array([1.0, 0.0, 0.0]), angle), dtype=np.float64).T


# --- frames: links of several beams


def frame_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """Nodes joined by beams, each in as many elements as asked for; nodes are rigid connections."""
    link: Any = case.mechanism.links[name]
    points = [np.array([*map(float, X), 0.0][:3]) for X in link.nodes.values()]
    named = {key: k for k, key in enumerate(link.nodes)}
    count = len(points) + sum(b.elements - 1 for b in link.beams.values())
    beams, strands = _Beams(count, case.mechanism.space), []
    for beam in link.beams.values():
        a, b, n = named[beam.from_node], named[beam.to_node], beam.elements
        nodes = [a, *range(len(points), len(points) + n - 1), b]
        along = points[b] - points[a]
        points += [points[a] + along * (k / n) for k in range(1, n)]
        h, turn = float(np.linalg.norm(along)) / n, _rolled(beam) @ axes(along)
        profile = [beam_values(case, parameters, beam, beam.section)]
        beams.add(profile, h, turn, nodes)
        row, bent = [vector(points[k].tolist()) for k in nodes], [shear(profile, h)] * n
        more = bent, [profile] * n, [h] * n
        strands.append(Strand(list(beams.slots[nodes]), row, turn, *more))
    positions = [vector(p.tolist()) for p in points]
    return beams.mesh(case, parameters, name, positions, named, strands)


def axes(along: Floats) -> Floats:
    """Rows: the beam's x, y, z in the link's axes; y in the x-y plane where that is defined.

    y = z_link × x; for a beam along z_link, y = y_link.
    """
    x = along / np.linalg.norm(along)
    y = np.cross([0.0, 0.0, 1.0], x)
    y = np.array([0.0, 1.0, 0.0]) if np.linalg.norm(y) < 1e-9 else y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
