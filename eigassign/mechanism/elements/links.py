"""The mesh of any link in its own frame: beam, rigid body, frame of beams, superelement."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.beam import (
    PLANES,
    BeamValues,
    ElementTerm,
    beam_values,
    element_mass,
    element_stiffness,
    field_inertia,
    is_settled,
    repeated,
    shear_ratios,
    tapered_values,
)
from eigassign.mechanism.elements.bodies import add_bodies, rigid_link
from eigassign.mechanism.elements.mesh import (
    Entries,
    LinkMesh,
    Strand,
    chain_dofs,
    node_dofs,
    rigid_motion,
)
from eigassign.mechanism.elements.superelement import superelement_mesh
from eigassign.mechanism.kinematics.parameters import ModelParameters, length, link_type, station
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, rotation, vector
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Scalar, is_constant

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def link_mesh(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """The mesh of one link with all its dofs, its bodies included."""
    match link_type(case, name):
        case "rigid":
            return rigid_link(case, parameters, name)
        case "frame":
            return frame_mesh(case, parameters, name)
        case "superelement":
            return superelement_mesh(case, parameters, name)
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


def _beam(case: CaseFile, parameters: ModelParameters, tree: Topology, name: str) -> LinkMesh:
    """A straight beam along x, in two segments where a carriage or nut rides on it."""
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    total, n = length(case, parameters, name), link.elements
    riders = tree.riders(name)
    if len(riders) > 1:
        message = "carries more than one carriage or nut; one is supported"
        raise MechanismError(f"mechanism.links.{name}", message)
    pieces: list[tuple[Scalar, Scalar, int]] = [(0.0, total, n)]  # start, span, elements
    if riders:
        at, first = station(parameters, tree, riders[0]), max(1, n // 2)
        pieces = [(0.0, at, first), (at, total - at, max(1, n - first))]
    width = len(DOFS[space])
    count = sum(n for _, _, n in pieces) + 1
    stiffness, mass = Entries((width * count,) * 2), Entries((width * count,) * 2)
    positions: list[Objects] = [vector([0.0])]
    shear: list[tuple[Scalar, Scalar]] = []
    inertia: list[Sequence[Scalar]] = []
    for start, span, n in pieces:
        first = len(positions) - 1
        positions += [vector([start + span * (k / n)]) for k in range(1, n + 1)]
        beams = _segment(case, parameters, name, stiffness, mass, first, (start, span), n)
        for beam, number in beams:
            shear += [(z, y) for z, y in repeated(shear_ratios(beam, span * (1.0 / n)), number)]
            inertia += repeated(field_inertia(beam), number)
    slots = list(chain_dofs(count, space))
    nodes = {"start": slots[0], "end": slots[-1]}
    places = {"start": positions[0], "end": positions[-1]}
    for rider in riders:
        nodes[f"@{rider}"], places[f"@{rider}"] = slots[pieces[0][2]], positions[pieces[0][2]]
    add_bodies(case, parameters, name, mass, nodes)
    rigid = _chain_rigid(pieces, space)
    strand = Strand(slots, positions, _rolled(link)[:3, :3], shear, inertia)
    terms = stiffness.terms(), mass.terms(), rigid
    return LinkMesh(width * count, nodes, places, *terms, (strand,))


def _chain_rigid(pieces: Sequence[tuple[Scalar, Scalar, int]], space: str) -> list[Any]:
    """N of a straight chain, node positions start + span ξ, assembled per piece at once."""
    width, kept = len(DOFS[space]), list(DOFS[space])
    count = sum(n for _, _, n in pieces) + 1
    entries = Entries((width * count, width))
    every = np.arange(width * count)
    entries.add(1.0, every, np.tile(np.arange(width), count), np.ones(width * count))
    first = 0
    for start, span, n in pieces:
        k = np.arange(1, n + 1)
        for part, values in ((start, np.ones(n)), (span, k / n)):
            for dof, turn, sign in PLANES:  # ω × x e_x = (0, ω_z x, −ω_y x)
                if dof in kept and turn in kept and not (is_constant(part) and part == 0.0):
                    rows = width * (first + k) + kept.index(dof)
                    columns = np.full(n, kept.index(turn))
                    entries.add(part, rows, columns, sign * values)
        first += n
    return entries.terms()


def _segment(
    case: CaseFile,
    parameters: ModelParameters,
    name: str,
    stiffness: Entries,
    mass: Entries,
    first: int,
    piece: tuple[Scalar, Scalar],
    n: int,
) -> list[tuple[BeamValues, int]]:
    """n elements of equal length from node ``first`` on; their values, and how many have them.

    A taper gives each element its own section; where these are plain numbers, as arrays over all.
    """
    start, span = piece
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    h = span * (1.0 / n)
    turn = _rolled(link)

    def add(beam: BeamValues, first: int, count: int) -> tuple[BeamValues, int]:
        _tile(stiffness, element_stiffness(beam, h), turn, first, count, space)
        _tile(mass, element_mass(beam, h), turn, first, count, space)
        return beam, count

    if isinstance(link.section, str):
        return [add(beam_values(case, parameters, link, link.section), first, n)]
    shares = (np.arange(n) + 0.5) / n
    total = length(case, parameters, name)
    if is_constant(total) and span is total and is_settled(parameters, link):
        return [add(tapered_values(case, parameters, link, shares), first, n)]
    of_whole = [k if span is total else (start + span * k) / total for k in shares.tolist()]
    beams = (tapered_values(case, parameters, link, share) for share in of_whole)
    return [add(beam, first + k, 1) for k, beam in enumerate(beams)]


def _tile(
    entries: Entries, terms: Sequence[ElementTerm], turn: Floats, first: int, n: int, space: str
) -> None:
    """Like elements between n pairs of neighbouring nodes, all at once."""
    local = chain_dofs(2, space).ravel()
    shift = len(DOFS[space]) * (first + np.arange(n))[:, None]
    for coefficient, matrix in terms:
        turned = turn.T @ matrix @ turn
        i, j = np.nonzero(turned.any(axis=0) if turned.ndim == 3 else turned)
        keep = (local[i] >= 0) & (local[j] >= 0)
        i, j = i[keep], j[keep]
        if len(i):
            rows, columns = (shift + local[i]).ravel(), (shift + local[j]).ravel()
            values = np.broadcast_to(turned[..., i, j], (n, len(i))).ravel()
            entries.add(coefficient, rows, columns, values)


def _rolled(beam: Any) -> Floats:
    """(12, 12) turn of the section's axes about the beam's."""
    angle = float(getattr(beam, "roll", 0.0) or 0.0)
    R = np.asarray(rotation(np.array([1.0, 0.0, 0.0]), angle), dtype=np.float64).T
    return np.asarray(np.kron(np.eye(4), R), dtype=np.float64)


# --- frames: links of several beams


def frame_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """Nodes joined by beams, each in as many elements as asked for; nodes are rigid connections."""
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    width = len(DOFS[space])
    points = [np.array([*map(float, X), 0.0][:3]) for X in link.nodes.values()]
    at = {key: k for k, key in enumerate(link.nodes)}
    count = len(points) + sum(b.elements - 1 for b in link.beams.values())
    stiffness, mass = Entries((width * count,) * 2), Entries((width * count,) * 2)
    slots = [node_dofs(width * k, space) for k in range(count)]
    strands = []
    for beam in link.beams.values():
        a, b = at[beam.from_node], at[beam.to_node]
        inner = list(range(len(points), len(points) + beam.elements - 1))
        ends = [a, *inner, b]
        for k in range(1, beam.elements):
            points.append(points[a] + (points[b] - points[a]) * (k / beam.elements))
        turn, shear = _add_beam(case, parameters, beam, stiffness, mass, points, ends, space)
        row = [vector(points[k].tolist()) for k in ends]
        strands.append(Strand([slots[k] for k in ends], row, turn, [shear] * beam.elements))
    nodes = {key: slots[k] for key, k in at.items()}
    places = {key: vector(points[k].tolist()) for key, k in at.items()}
    add_bodies(case, parameters, name, mass, nodes)
    rigid = rigid_motion([vector(p.tolist()) for p in points], slots, width * count, space)
    terms = stiffness.terms(), mass.terms(), rigid
    return LinkMesh(width * count, nodes, places, *terms, strands)


def _add_beam(
    case: CaseFile,
    parameters: ModelParameters,
    beam: Any,
    stiffness: Entries,
    mass: Entries,
    points: list[Floats],
    ends: list[int],
    space: str,
) -> tuple[Floats, tuple[Scalar, Scalar]]:
    """Add the elements of one beam; its axes, and Φ of each element."""
    along = points[ends[-1]] - points[ends[0]]
    h = float(np.linalg.norm(along)) / (len(ends) - 1)
    values = beam_values(case, parameters, beam, beam.section)
    turn = _rolled(beam) @ np.kron(np.eye(4), axes(along))
    width = len(DOFS[space])
    for terms, target in (
        (element_stiffness(values, h), stiffness),
        (element_mass(values, h), mass),
    ):
        for coefficient, matrix in terms:
            turned = turn.T @ matrix @ turn
            turned[np.abs(turned) < 1e-14 * np.abs(turned).max()] = 0.0
            for a, b in itertools.pairwise(ends):
                dofs = np.concatenate([node_dofs(width * a, space), node_dofs(width * b, space)])
                target.add_block(coefficient, dofs, turned)
    return turn[:3, :3], shear_ratios(values, h)


def axes(along: Floats) -> Floats:
    """Rows: the beam's x, y, z in the link's axes; y in the x-y plane where that is defined.

    y = z_link × x; for a beam along z_link, y = y_link.
    """
    x = along / np.linalg.norm(along)
    y = np.cross([0.0, 0.0, 1.0], x)
    y = np.array([0.0, 1.0, 0.0]) if np.linalg.norm(y) < 1e-9 else y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
