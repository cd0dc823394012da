"""Where the named nodes of a link are, in the link's own frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from eigassign.case import CaseFile
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import Objects, vector
from eigassign.mechanism.tree import Node, Tree
from eigassign.series.expression import Scalar


def link_type(case: CaseFile, link: str) -> str:
    """beam, rigid, frame or superelement."""
    return str(getattr(case.mechanism.links[link], "type", "beam"))


def length(case: CaseFile, parameters: Parameters, link: str) -> Scalar:
    """Length of a link in m: a number, or a design parameter."""
    data: Any = case.mechanism.links[link]
    return parameters.number(f"links.{link}.length", data.length)


def node_position(case: CaseFile, parameters: Parameters, tree: Tree, node: Node) -> Objects:
    """Position of a named node in its link's frame, m (3,).

    A node "@joint" is the place where a carriage or nut stands: the joint's own coordinate.
    """
    link, name = node
    data = case.mechanism.links[link]
    if name.startswith("@"):
        return vector([station(parameters, tree, name[1:])])
    named = getattr(data, "nodes", None) or {}
    if name in named:
        given = named[name]
        return vector([float(c) for c in getattr(given, "position", given)])
    if name == "end":
        return vector([length(case, parameters, link)])
    return np.zeros(3, dtype=object)


def station(parameters: Parameters, tree: Tree, joint: str) -> Scalar:
    """Distance of a carriage or nut from the start of the link it rides on, m."""
    (k,) = tree.of_joint(joint)
    return parameters.freedom(k)
