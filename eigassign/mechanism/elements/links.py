"""The mesh of any link in its own frame: beam, rigid body, frame of beams, superelement."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.elements.beam import (
    PLANES,
    ElementTerm,
    Shear,
    element_mass,
    element_stiffness,
    shear,
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
from eigassign.mechanism.elements.profiles import (
    Profile,
    beam_profiles,
    beam_values,
    each_element,
)
from eigassign.mechanism.elements.superelement import superelement_mesh
from eigassign.mechanism.kinematics.parameters import ModelParameters, length, link_type, station
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, rotation, vector
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Expression, Scalar, is_constant

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
    pieces: list[tuple[Scalar, Scalar, int]] = [(0.0, total, n)]  # start, span, elements
    if riders:
        at, first = station(parameters, tree, riders[0]), max(1, n // 2)
        pieces = [(0.0, at, first), (at, total - at, max(1, n - first))]
    width = len(DOFS[space])
    count = sum(n for _, _, n in pieces) + 1
    stiffness, mass = Entries((width * count,) * 2), Entries((width * count,) * 2)
    positions: list[Objects] = [vector([0.0])]
    bent: list[tuple[Shear, Shear]] = []
    profiles: list[Profile] = []
    for start, span, n in pieces:
        first = len(positions) - 1
        positions += [vector([start + span * (k / n)]) for k in range(1, n + 1)]
        found = _segment(case, parameters, name, stiffness, mass, first, (start, span), n)
        bent += [shear(each, span * (1.0 / n)) for each in found]
        profiles += found
    slots = list(chain_dofs(count, space))
    nodes = {"start": slots[0], "end": slots[-1]}
    places = {"start": positions[0], "end": positions[-1]}
    for rider in riders:
        nodes[f"@{rider}"], places[f"@{rider}"] = slots[pieces[0][2]], positions[pieces[0][2]]
    add_bodies(case, parameters, name, mass, nodes)
    rigid = _chain_rigid(pieces, space)
    strand = Strand(slots, positions, _rolled(link)[:3, :3], bent, profiles)
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
) -> list[Profile]:
    """n elements of equal length from node ``first`` on; the values of each."""
    start, span = piece
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    total = length(case, parameters, name)
    shares = (0.0, 1.0) if span is total else (start / total, (start + span) / total)
    h = span * (1.0 / n)
    turn = _rolled(link)
    profiles = beam_profiles(case, parameters, link, shares, n, together=is_constant(h))
    count = n // len(profiles)
    for k, profile in enumerate(profiles):
        for target, terms in (
            (stiffness, element_stiffness(profile, h)),
            (mass, element_mass(profile, h)),
        ):
            parts = terms if len(profile) == 1 else _atom_by_atom(terms)
            _tile(target, parts, turn, first + k * count, count, space)
    return [each for profile in profiles for each in each_element(profile, count)]


def _atom_by_atom(terms: Sequence[ElementTerm]) -> list[ElementTerm]:
    """The same sum without sums in its coefficients: those of a taper's elements are alike."""
    out = []
    for coefficient, matrix in terms:
        if is_constant(coefficient):
            out.append(ElementTerm(coefficient, matrix))
            continue
        for atom, factor in coefficient.terms.items():
            one = Expression(coefficient.recorder, 0.0, {atom: factor})
            out.append(ElementTerm(one, matrix))
        if coefficient.constant:
            out.append(ElementTerm(coefficient.constant, matrix))
    return out


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
        turn, bent, profile = _add_beam(
            case, parameters, beam, stiffness, mass, points, ends, space
        )
        row = [vector(points[k].tolist()) for k in ends]
        each = [bent] * beam.elements, [profile] * beam.elements
        strands.append(Strand([slots[k] for k in ends], row, turn, *each))
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
) -> tuple[Floats, tuple[Shear, Shear], Profile]:
    """Add the elements of one beam; its axes, and shear and values of each element."""
    along = points[ends[-1]] - points[ends[0]]
    h = float(np.linalg.norm(along)) / (len(ends) - 1)
    profile = [beam_values(case, parameters, beam, beam.section)]
    turn = _rolled(beam) @ np.kron(np.eye(4), axes(along))
    width = len(DOFS[space])
    for terms, target in (
        (element_stiffness(profile, h), stiffness),
        (element_mass(profile, h), mass),
    ):
        for coefficient, matrix in terms:
            turned = turn.T @ matrix @ turn
            turned[np.abs(turned) < 1e-14 * np.abs(turned).max()] = 0.0
            for a, b in itertools.pairwise(ends):
                dofs = np.concatenate([node_dofs(width * a, space), node_dofs(width * b, space)])
                target.add_block(coefficient, dofs, turned)
    return turn[:3, :3], shear(profile, h), profile


def axes(along: Floats) -> Floats:
    """Rows: the beam's x, y, z in the link's axes; y in the x-y plane where that is defined.

    y = z_link × x; for a beam along z_link, y = y_link.
    """
    x = along / np.linalg.norm(along)
    y = np.cross([0.0, 0.0, 1.0], x)
    y = np.array([0.0, 1.0, 0.0]) if np.linalg.norm(y) < 1e-9 else y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
