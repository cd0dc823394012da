"""The numbers of a mechanism: plain floats, or expressions where they are design parameters.

Lengths of links and the places of their named nodes, in the link's own frame, are read here, so
that kinematics and elements see the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.kinematics.coordinates import coordinates
from eigassign.mechanism.kinematics.rotations import Objects, vector
from eigassign.mechanism.kinematics.topology import NodeName, Topology, build_tree
from eigassign.series.expression import Expression, Recorder, Scalar

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ModelParameters:
    """Variables z = (s, y): joint coordinates s in the order of the case's q, then design y."""

    recorder: Recorder
    coordinates: tuple[str, ...]
    design: tuple[str, ...]
    relative: Floats  # A of s = A q + b
    offset: Floats
    by_path: dict[str, Expression] = field(default_factory=dict)
    passive: tuple[Scalar, ...] = ()

    def number(self, path: str, value: float) -> Scalar:
        """The value at a key path of the case: the variable if it is a design parameter."""
        return self.by_path.get(path, value)

    def freedom(self, k: int) -> Scalar:
        """Joint freedom k: a coordinate, or a passive one behind them."""
        n_q = len(self.coordinates)
        return self.recorder.variable(k) if k < n_q else self.passive[k - n_q]

    def with_passive(self, values: Sequence[Scalar]) -> ModelParameters:
        """The same with the passive freedoms known."""
        return replace(self, passive=tuple(values))

    def rerecorded(self, recorder: Recorder, n_passive: int) -> ModelParameters:
        """The same on another recorder, the passive freedoms being its last variables."""
        n = len(self.coordinates) + len(self.design)
        moved = {
            path: recorder.variable(len(self.coordinates) + k)
            for k, path in enumerate(self.by_path)
        }
        passive = tuple(recorder.variable(n + k) for k in range(n_passive))
        return replace(self, recorder=recorder, by_path=moved, passive=passive)


def parameters(case: CaseFile) -> ModelParameters:
    """The variables of a case."""
    recorder = Recorder()
    names, design = tuple(case.coordinates), tuple(case.design.parameters)
    by_path = {
        parameter.parameter: recorder.variable(len(names) + k)
        for k, parameter in enumerate(case.design.parameters.values())
    }
    maps = coordinates(case, build_tree(case))
    return ModelParameters(recorder, names, design, maps.relative, maps.offset, by_path)


def initial_design(case: CaseFile) -> Floats:
    """y as the mechanism is written in the file, (n_y,) in SI units."""
    paths = [p.parameter for p in case.design.parameters.values()]
    return np.array([_value(case, path) for path in paths], dtype=np.float64)


def _value(case: CaseFile, path: str) -> float:
    head, name, *fields = path.split(".")
    group = case.coordinates if head == "coordinates" else getattr(case.mechanism, head)
    value: Any = group[name]
    for field_name in fields:
        value = getattr(value, field_name)
    return float(value)


def link_type(case: CaseFile, link: str) -> str:
    """beam, rigid, frame or superelement."""
    return str(getattr(case.mechanism.links[link], "type", "beam"))


def length(case: CaseFile, parameters: ModelParameters, link: str) -> Scalar:
    """Length of a link in m: a number, or a design parameter."""
    data: Any = case.mechanism.links[link]
    return parameters.number(f"links.{link}.length", data.length)


def node_position(
    case: CaseFile, parameters: ModelParameters, tree: Topology, node: NodeName
) -> Objects:
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


def station(parameters: ModelParameters, tree: Topology, joint: str) -> Scalar:
    """Distance of a carriage or nut from the start of the link it rides on, m."""
    (k,) = tree.of_joint(joint)
    return parameters.freedom(k)
