"""The mesh of any link in its own frame: beam, rigid body, frame of beams, superelement, solid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.elements.beam import (
    ElementTerm,
    Shear,
    element_mass,
    element_stiffness,
    shear,
)
from eigassign.mechanism.elements.mesh import (
    Entries,
    LinkMesh,
    Strand,
    add_bodies,
    chain_dofs,
    rigid_link,
    rigid_motion,
)
from eigassign.mechanism.elements.sections import (
    Profile,
    beam_profiles,
    beam_values,
    each_element,
)
from eigassign.mechanism.kinematics.joints import DOFS, Objects, rotation, vector
from eigassign.mechanism.kinematics.parameters import ModelParameters, length, link_type, station
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Scalar, atom_of, is_constant, parts

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def link_mesh(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """The mesh of one link with all its dofs, its bodies included."""
    match link_type(case, name):
        case "rigid":
            return rigid_link(case, parameters, tree, name)
        case "frame":
            return _frame(case, parameters, name)
        case "superelement":
            from eigassign.mechanism.elements.superelement import superelement_mesh

            return superelement_mesh(case, parameters, name)
        case "solid":
            from eigassign.mechanism.elements.superelement import solid_mesh

            return solid_mesh(case, parameters, name)
    return _beam(case, parameters, tree, name)


def copies_of(
    case: CaseFile, parameters: ModelParameters, tree: Topology
) -> dict[str, tuple[object, ...]]:
    """By name of a plain beam all that its mesh depends on, equal for those that are copies.

    Beams with bodies or riders, or of a length that varies, are left out: they have their own.
    """
    loaded = {body.at.partition(".")[0] for body in case.mechanism.bodies.values()}
    found: dict[str, tuple[object, ...]] = {}
    for name, link in case.mechanism.links.items():
        plain = link_type(case, name) == "beam" and name not in loaded and not tree.riders(name)
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


def _beam(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """A straight beam along x, in two segments where a carriage or nut rides on it."""
    link: Any = case.mechanism.links[name]
    total, n = length(case, parameters, name), link.elements
    riders, turn = tree.riders(name), _rolled(link)
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
    """The same sum without sums in its coefficients: those of a taper's elements are alike."""
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


def _frame(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
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
