"""From a case to its affine pencil: dofs, links, drives, and the compiled coefficient functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.assembly import Accumulator, LocalLink, add_link, pattern
from eigassign.mechanism.beam import (
    PLANAR,
    Term,
    beam_mass,
    beam_stiffness,
    node_mass,
    rigid_modes,
)
from eigassign.mechanism.kinematics import PLANAR_TWIST, Kinematics, Placement
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.pencil import Pencil
from eigassign.mechanism.sections import section_values
from eigassign.series.expression import Scalar
from eigassign.series.program import compile_program

Ints = NDArray[np.intp]
Objects = NDArray[np.object_]
NodeDofs = dict[tuple[str, str], list[list[tuple[int, Scalar]]]]


def build_pencil(case: CaseFile, parameters: Parameters, motion: Kinematics) -> Pencil:
    """Assemble K and M of eq. (1) for a tree of planar beam links."""
    stiffness, mass = Accumulator(), Accumulator()
    links, n_u = _local_links(case, parameters, motion)
    for link in links:
        add_link(stiffness, mass, link, n_u)
    _add_drives(stiffness, case, parameters, motion, n_u)
    return _compile(stiffness, mass, case, parameters, motion, n_u)


def _local_links(
    case: CaseFile, parameters: Parameters, motion: Kinematics
) -> tuple[list[LocalLink], int]:
    """Number the unknowns link by link; a link's first node is carried by its base."""
    links: list[LocalLink] = []
    nodes: NodeDofs = {}
    count = 0
    for placement in motion.placements:
        n = case.mechanism.links[placement.link].elements
        own = np.full(PLANAR * (n + 1), -1, dtype=np.intp)
        own[PLANAR:] = count + np.arange(PLANAR * n)
        count += PLANAR * n
        carried = _carry(placement, nodes)
        nodes[placement.link, "start"] = [carried[a] for a in range(PLANAR)]
        nodes[placement.link, "end"] = [[(int(g), 1.0)] for g in own[-PLANAR:]]
        links.append(_local_link(case, parameters, placement, own, carried))
    return links, count


def _carry(placement: Placement, nodes: NodeDofs) -> dict[int, list[tuple[int, Scalar]]]:
    """Motion of the follower's first node from that of the base node: u_f = Rᵀ u_b."""
    if placement.base is None:
        return {a: [] for a in range(PLANAR)}
    base = nodes[placement.base]
    R = placement.rotation
    planar = [[R[0, 0], R[1, 0], 0.0], [R[0, 1], R[1, 1], 0.0], [0.0, 0.0, 1.0]]
    return {a: _combine(planar[a], base) for a in range(PLANAR)}


def _combine(row: list[Scalar], base: list[list[tuple[int, Scalar]]]) -> list[tuple[int, Scalar]]:
    """Σ_b row_b × (combination of masters of base dof b)."""
    total: dict[int, Scalar] = {}
    for factor, masters in zip(row, base, strict=True):
        for index, carry in masters:
            product = carry * factor
            if isinstance(product, float) and product == 0.0:
                continue
            total[index] = total.get(index, 0.0) + product
    return list(total.items())


def _local_link(
    case: CaseFile,
    parameters: Parameters,
    placement: Placement,
    own: Ints,
    carried: dict[int, list[tuple[int, Scalar]]],
) -> LocalLink:
    name = placement.link
    link = case.mechanism.links[name]
    n = link.elements
    length = parameters.number(f"links.{name}.length", link.length)
    constant, per_length = rigid_modes(n)
    return LocalLink(
        stiffness=_stiffness(case, parameters, name, length),
        mass=_mass(case, parameters, name, length),
        rigid=[Term(1.0, constant), Term(length, per_length)],
        twist=placement.twist[list(PLANAR_TWIST)],
        own=own,
        carried=carried,
    )


def _area_inertia(case: CaseFile, parameters: Parameters, name: str) -> tuple[Scalar, Scalar]:
    key = case.mechanism.links[name].section

    def number(field: str, value: float) -> Scalar:
        return parameters.number(f"sections.{key}.{field}", value)

    return section_values(case.mechanism.sections[key], number)


def _stiffness(case: CaseFile, parameters: Parameters, name: str, length: Scalar) -> list[Term]:
    link = case.mechanism.links[name]
    area, inertia = _area_inertia(case, parameters, name)
    path = f"materials.{link.material}.youngs_modulus"
    modulus = parameters.number(path, case.mechanism.materials[link.material].youngs_modulus)
    return beam_stiffness(link.elements, modulus, area, inertia, length)


def _mass(case: CaseFile, parameters: Parameters, name: str, length: Scalar) -> list[Term]:
    link = case.mechanism.links[name]
    area, _ = _area_inertia(case, parameters, name)
    path = f"materials.{link.material}.density"
    density = parameters.number(path, case.mechanism.materials[link.material].density)
    terms = beam_mass(link.elements, density * area, length)
    for key, body in case.mechanism.bodies.items():
        owner, _, node = body.at.partition(".")
        if owner == name:
            mass = parameters.number(f"bodies.{key}.mass", body.mass)
            inertia = parameters.number(f"bodies.{key}.inertia", body.inertia)
            terms += node_mass(link.elements, link.elements * (node == "end"), mass, inertia)
    return terms


def _add_drives(
    target: Accumulator,
    case: CaseFile,
    parameters: Parameters,
    motion: Kinematics,
    n_u: int,
) -> None:
    """Drive stiffness k on the deflection of its joint, which is that coordinate's unknown."""
    for column, i in enumerate(motion.columns):
        name, coordinate = tuple(case.coordinates.items())[i]
        if not isinstance(coordinate.drive, str):
            path = f"coordinates.{name}.drive.stiffness"
            stiffness = parameters.number(path, coordinate.drive.stiffness)
            target.add_small(n_u + column, n_u + column, stiffness)


def _compile(
    stiffness: Accumulator,
    mass: Accumulator,
    case: CaseFile,
    parameters: Parameters,
    motion: Kinematics,
    n_u: int,
) -> Pencil:
    n_dof = n_u + len(motion.columns)
    entries = [stiffness.finish(n_u), mass.finish(n_u)]
    atoms = np.unique(np.concatenate([entry[2] for entry in entries]))
    atoms = atoms[atoms >= 0]
    theta = [(r, c, np.searchsorted(atoms, a) + (a >= 0), v) for r, c, a, v in entries]
    rows, columns, weights = pattern(theta, n_dof, len(atoms) + 1)
    n_y, n_q = len(parameters.design), len(parameters.coordinates)
    to_program = np.eye(n_q + n_y)
    to_program[:n_q, :n_q] = motion.relative
    return Pencil(
        n_dof=n_dof,
        n_u=n_u,
        rigid=_rigid(case, motion, n_u),
        rows=rows,
        columns=columns,
        stiffness=weights[0],
        mass=weights[1],
        program=compile_program(parameters.recorder, atoms.tolist(), n_q + n_y),
        to_program=to_program,
        shift=np.concatenate([motion.offset, np.zeros(n_y)]),
        n_q=n_q,
    )


def _rigid(case: CaseFile, motion: Kinematics, n_u: int) -> Ints:
    """Free coordinates among the columns of q̇; held ones are elastic."""
    drives = [c.drive for c in case.coordinates.values()]
    free = [n_u + k for k, i in enumerate(motion.columns) if drives[i] == "free"]
    return np.array(free, dtype=np.intp)
