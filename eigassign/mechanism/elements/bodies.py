"""Rigid links, and the point masses and rigid bodies fixed to the nodes of any link."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.elements.mesh import (
    Entries,
    LinkMesh,
    add_scalars,
    body_block,
    node_dofs,
    rigid_motion,
)
from eigassign.mechanism.kinematics.parameters import ModelParameters, length
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, vector
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def add_bodies(
    case: CaseFile, parameters: ModelParameters, name: str, mass: Entries, nodes: dict[str, Ints]
) -> None:
    """The point masses and rigid bodies fixed to a link's nodes."""
    for key, body in case.mechanism.bodies.items():
        link, _, node = body.at.partition(".")
        if link == name:
            lever = vector(getattr(body, "offset", None) or (0.0,))
            add_scalars(mass, nodes[node], _body(case, parameters, f"bodies.{key}", body, lever))


def _body(
    case: CaseFile, parameters: ModelParameters, path: str, body: Any, lever: Objects
) -> Objects:
    """Mass matrix (6, 6) at the node; an inertia that is one number is I_zz of a planar body."""
    mass, given = parameters.number(f"{path}.mass", body.mass), body.inertia
    inertia: list[Scalar] = [0.0] * 6  # Ixx, Iyy, Izz, Ixy, Ixz, Iyz
    if isinstance(given, (tuple, list)):
        inertia[: len(given)] = [float(v) for v in given]
    else:
        inertia[2] = parameters.number(f"{path}.inertia", given)
    return body_block(mass, inertia, lever)


def rigid_link(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """A rigid link: one node at its origin carries its mass, named nodes hang on it rigidly."""
    space, link = case.mechanism.space, case.mechanism.links[name]
    width, kept = len(DOFS[space]), node_dofs(0, case.mechanism.space)
    mass = Entries((width, width))
    center = vector(getattr(link, "center", None) or (0.0,))
    add_scalars(mass, kept, _body(case, parameters, f"links.{name}", link, center))
    places = rigid_nodes(case, parameters, name)
    for key, body in case.mechanism.bodies.items():
        owner, _, node = body.at.partition(".")
        if owner == name:
            lever = places[node] + vector(getattr(body, "offset", None) or (0.0,))
            add_scalars(mass, kept, _body(case, parameters, f"bodies.{key}", body, lever))
    rigid = rigid_motion([vector([0.0])], [kept], width, space)
    return LinkMesh(width, {"@origin": kept}, places, [], mass.terms(), rigid)


def rigid_nodes(case: CaseFile, parameters: ModelParameters, name: str) -> dict[str, Objects]:
    """Named nodes of a rigid link in its frame, m."""
    link = case.mechanism.links[name]
    places = {"start": vector([0.0])}
    if getattr(link, "length", None) is not None:
        places["end"] = vector([length(case, parameters, name)])
    given = getattr(link, "nodes", None) or {}
    return places | {key: vector([float(c) for c in X]) for key, X in given.items()}
