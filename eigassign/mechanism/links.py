"""Each kind of link as a mesh in its own frame: beam, rigid body, frame of beams, superelement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.beam import (
    BeamValues,
    ElementTerm,
    element_mass,
    element_stiffness,
    field_inertia,
    shear_ratios,
)
from eigassign.mechanism.bodies import add_bodies, rigid_link
from eigassign.mechanism.geometry import length, link_type, station
from eigassign.mechanism.mesh import (
    DOFS,
    Entries,
    LinkMesh,
    Strand,
    node_dofs,
)
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import Objects, rotation, vector
from eigassign.mechanism.sections import SectionValues, section_values
from eigassign.mechanism.tree import Tree
from eigassign.series.expression import Scalar, is_constant

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def link_mesh(case: CaseFile, parameters: Parameters, tree: Tree, name: str) -> LinkMesh:
    """The mesh of one link with all its dofs, its bodies included."""
    match link_type(case, name):
        case "rigid":
            return rigid_link(case, parameters, name)
        case "frame":
            from eigassign.mechanism.frames import frame_mesh

            return frame_mesh(case, parameters, name)
        case "superelement":
            from eigassign.mechanism.superelement import superelement_mesh

            return superelement_mesh(case, parameters, name)
    return _beam(case, parameters, tree, name)


# --- beams ---


def _beam(case: CaseFile, parameters: Parameters, tree: Tree, name: str) -> LinkMesh:
    """A straight beam along x, in two segments where a carriage or nut rides on it."""
    space = case.mechanism.space
    link: Any = case.mechanism.links[name]
    total, n = length(case, parameters, name), link.elements
    riders = tree.riders(name)
    if len(riders) > 1:
        message = "carries more than one carriage or nut; one is supported"
        raise MechanismError(f"mechanism.links.{name}", message)
    pieces: list[tuple[Scalar, Scalar, int]] = [(0.0, total, n)]
    if riders:
        at, first = station(parameters, tree, riders[0]), max(1, n // 2)
        pieces = [(0.0, at, first), (at, total - at, max(1, n - first))]
    return _chain(case, parameters, name, space, pieces, f"@{riders[0]}" if riders else None)


def _chain(
    case: CaseFile,
    parameters: Parameters,
    name: str,
    space: str,
    pieces: Sequence[tuple[Scalar, Scalar, int]],
    rider: str | None,
) -> LinkMesh:
    width = len(DOFS[space])
    count = sum(n for _, _, n in pieces) + 1
    stiffness, mass = Entries((width * count,) * 2), Entries((width * count,) * 2)
    positions: list[Objects] = [vector([0.0])]
    shear: list[tuple[Scalar, Scalar]] = []
    inertia: list[Sequence[Scalar]] = []
    for start, span, n in pieces:
        first = len(positions) - 1
        positions += [vector([start + span * (k / n)]) for k in range(1, n + 1)]
        beams = _segment(case, parameters, name, stiffness, mass, first, (start, span), n, space)
        shear += [shear_ratios(beam, span * (1.0 / n)) for beam in beams]
        inertia += [field_inertia(beam) for beam in beams]
    slots = [node_dofs(width * k, space) for k in range(count)]
    nodes = {"start": slots[0], "end": slots[-1]}
    places = {"start": positions[0], "end": positions[-1]}
    if rider is not None:
        nodes[rider], places[rider] = slots[pieces[0][2]], positions[pieces[0][2]]
    add_bodies(case, parameters, name, mass, nodes)
    rigid = _chain_rigid(pieces, space)
    turn = rolled(_roll(case.mechanism.links[name]))[:3, :3]
    strand = Strand(slots, positions, turn, shear, inertia)
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
            for dof, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):  # ω × x e_x = (0, ω_z x, −ω_y x)
                if dof in kept and turn in kept and not (is_constant(part) and part == 0.0):
                    rows = width * (first + k) + kept.index(dof)
                    columns = np.full(n, kept.index(turn))
                    entries.add(part, rows, columns, sign * values)
        first += n
    return entries.terms()


def _segment(
    case: CaseFile,
    parameters: Parameters,
    name: str,
    stiffness: Entries,
    mass: Entries,
    first: int,
    piece: tuple[Scalar, Scalar],
    n: int,
    space: str,
) -> list[BeamValues]:
    """n equal elements from node ``first`` on, of these values; a taper gives each its section."""
    start, span = piece
    link: Any = case.mechanism.links[name]
    h = span * (1.0 / n)
    turn = rolled(_roll(link))
    if isinstance(link.section, str):
        beam = beam_values(case, parameters, link, link.section)
        _tile(stiffness, element_stiffness(beam, h), turn, first, n, space)
        _tile(mass, element_mass(beam, h), turn, first, n, space)
        return [beam] * n
    total = length(case, parameters, name)
    beams = []
    for k in range(n):
        share: Scalar = (k + 0.5) / n
        if span is not total:  # a rider splits the beam
            share = (start + span * share) / total
        beam = _tapered(case, parameters, link, share)
        _tile(stiffness, element_stiffness(beam, h), turn, first + k, 1, space)
        _tile(mass, element_mass(beam, h), turn, first + k, 1, space)
        beams.append(beam)
    return beams


def _tile(
    entries: Entries, terms: Sequence[ElementTerm], turn: Floats, first: int, n: int, space: str
) -> None:
    """The same element between n pairs of neighbouring nodes, all at once."""
    width = len(DOFS[space])
    local = np.concatenate([node_dofs(0, space), node_dofs(width, space)])
    local[6:][node_dofs(0, space) < 0] = -1
    for coefficient, matrix in terms:
        turned = turn.T @ matrix @ turn
        i, j = np.nonzero(turned)
        keep = (local[i] >= 0) & (local[j] >= 0)
        i, j = i[keep], j[keep]
        if len(i):
            shift = width * (first + np.arange(n))[:, None]
            rows, columns = (shift + local[i]).ravel(), (shift + local[j]).ravel()
            entries.add(coefficient, rows, columns, np.tile(turned[i, j], n))


def _roll(beam: Any) -> float:
    return float(getattr(beam, "roll", 0.0) or 0.0)


def rolled(angle: float) -> Floats:
    """(12, 12) turn of the section's axes about the beam's."""
    R = np.asarray(rotation(np.array([1.0, 0.0, 0.0]), angle), dtype=np.float64).T
    return np.asarray(np.kron(np.eye(4), R), dtype=np.float64)


def beam_values(case: CaseFile, parameters: Parameters, beam: Any, section: str) -> BeamValues:
    """Stiffness and mass values of a beam of the case with one section."""

    def number(key: str, value: float) -> Scalar:
        return parameters.number(f"sections.{section}.{key}", value)

    _refuse_square(case, section)
    return _values(case, parameters, beam, section_values(case.mechanism.sections[section], number))


def _refuse_square(case: CaseFile, section: str) -> None:
    """The torsion constant of a rectangle knows its longer side: a design must not swap them."""
    data = case.mechanism.sections[section]
    if data.shape != "rectangle" or case.mechanism.space == "planar":
        return
    ranges = {
        p.parameter: (p.min, p.max) for p in case.design.parameters.values() if hasattr(p, "min")
    }
    low_w, high_w = ranges.get(f"sections.{section}.width", (data.width, data.width))
    low_h, high_h = ranges.get(f"sections.{section}.height", (data.height, data.height))
    if low_w < high_h and low_h < high_w and (low_w, low_h) != (high_w, high_h):
        raise MechanismError(
            f"mechanism.sections.{section}",
            "the bounds of its design let width and height change places, which the torsion "
            "constant does not follow: keep one side the longer",
        )


def _values(
    case: CaseFile, parameters: Parameters, beam: Any, section: SectionValues
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
    case: CaseFile, parameters: Parameters, beam: Any, E: Scalar, sheared: bool
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


def _tapered(case: CaseFile, parameters: Parameters, link: Any, share: Scalar) -> BeamValues:
    """Values at a share of the length, the sections' dimensions running linearly."""
    a, b = case.mechanism.sections[link.section.start], case.mechanism.sections[link.section.end]

    def number(key: str, value: float) -> Scalar:
        low = parameters.number(f"sections.{link.section.start}.{key}", value)
        high = parameters.number(f"sections.{link.section.end}.{key}", getattr(b, key))
        return low + (high - low) * share

    return _values(case, parameters, link, section_values(a, number))
