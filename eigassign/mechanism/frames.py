"""A link made of several beams: lattice booms, delta forearms, portals."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.beam import element_mass, element_stiffness, shear_ratios
from eigassign.mechanism.beam_values import beam_values
from eigassign.mechanism.bodies import add_bodies
from eigassign.mechanism.links import rolled
from eigassign.mechanism.mesh import DOFS, Entries, LinkMesh, Strand, node_dofs, rigid_motion
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import vector
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


def frame_mesh(case: CaseFile, parameters: Parameters, name: str) -> LinkMesh:
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
    parameters: Parameters,
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
    turn = rolled(float(getattr(beam, "roll", 0.0) or 0.0)) @ np.kron(np.eye(4), axes(along))
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
