"""Rigid links, and the point masses and rigid bodies fixed to the nodes of any link."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.parts import tensor
from eigassign.mechanism.elements.mesh import (
    Entries,
    LinkMesh,
    add_body,
    chain_dofs,
    rigid_motion,
)
from eigassign.mechanism.kinematics.parameters import STILL, ModelParameters, node_position
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, multiply, vector
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.expression import Scalar

Ints = NDArray[np.intp]


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
