"""Where the rigid links are in the world: for drawing, and for inverse kinematics.

World rotation and origin of every link come from the same kinematics as the pencil.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.parameters import ModelParameters, link_type, node_position
from eigassign.mechanism.kinematics.topology import split
from eigassign.series.algebra import Samples
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinkFrames:
    """World frames of all links as functions of x = (q, y)."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    links: tuple[str, ...]
    drawn: tuple[tuple[tuple[str, str], ...], ...]  # per link: the node pairs of its lines

    def _compile(self, scalars: Sequence[Scalar]) -> CompiledTable:
        return compile_table(self.parameters.recorder, scalars, self.parameters.count)

    def _evaluate(self, table: CompiledTable, x: Floats) -> Floats:
        """(n_samples, n_scalars)."""
        z = self.parameters.z(np.atleast_2d(x))
        rows = table.evaluate(Samples(), z)
        return np.broadcast_to(rows, (len(rows), z.shape[1])).T

    def values(self, x: Floats, arrays: Sequence[NDArray[np.object_]]) -> list[Floats]:
        """Numbers (n_samples, *shape) of arrays of this mechanism's scalars, evaluated together."""
        table = self._compile([scalar for array in arrays for scalar in array.ravel()])
        rows = self._evaluate(table, x)
        cuts = np.cumsum([array.size for array in arrays])[:-1]
        parts = zip(np.split(rows, cuts, axis=1), arrays, strict=True)
        return [part.reshape(len(rows), *array.shape) for part, array in parts]

    @cached_property
    def _ends(self) -> CompiledTable:
        """World positions of both ends of every drawn line."""
        scalars: list[Scalar] = []
        for link, pairs in zip(self.links, self.drawn, strict=True):
            for node in (name for pair in pairs for name in pair):
                scalars += list(self.world(link, node))
        return self._compile(scalars)

    def world(self, link: str, node: str) -> NDArray[np.object_]:
        """World position of a named node, as scalars (3,)."""
        X = node_position(self.case, self.parameters, self.motion.tree, (link, node))
        return self.motion.placement(link).at(X)[1]

    def segments(self, x: Floats) -> tuple[Floats, ...]:
        """The straight lines of each link, (n, n_lines, 2 ends, 3) in m."""
        values = self._evaluate(self._ends, x)
        points = values.reshape(len(values), -1, 2, 3)
        cuts = np.cumsum([len(pairs) for pairs in self.drawn])[:-1]
        return tuple(np.split(points, cuts, axis=1))

    def lines(self, x: Floats) -> Floats:
        """Start and end of every link, (n, n_links, 2, 3) in m: the first and last point drawn."""
        pieces = self.segments(x)
        ends = [np.stack([p[:, 0, 0], p[:, -1, 1]], axis=1) for p in pieces]
        return np.stack(ends, axis=1)

    def position(self, x: Floats, link: str, node: str) -> Floats:
        """World position (n, 3) of a named node, in m."""
        return self._evaluate(self._compile(list(self.world(link, node))), x)


def build_link_frames(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> LinkFrames:
    """The world frames of a case's links."""
    links = tuple(p.link for p in motion.placements)
    drawn = tuple(_lines(case, motion, link) for link in links)
    return LinkFrames(case, parameters, motion, links, drawn)


def _lines(case: CaseFile, motion: Kinematics, link: str) -> tuple[tuple[str, str], ...]:
    """The lines drawn of a link: its axis, its beams, or spokes from its joint node."""
    data: Any = case.mechanism.links[link]
    kind = link_type(case, link)
    if kind == "beam":
        return (("start", "end"),)
    if kind == "frame":
        return tuple((b.from_node, b.to_node) for b in data.beams.values())
    root = motion.placement(link).edge.follower[1]
    names = list(getattr(data, "nodes", None) or {})
    if getattr(data, "length", None) is not None:
        names.append("end")
    others = [name for name in names if name != root]
    return tuple((root, name) for name in others) or ((root, root),)


def design_dependence(poses: LinkFrames, tip: str, oriented: bool = False) -> NDArray[np.bool_]:
    """Masks (n_y,) of the design parameters that a node's place, and its turning, depend on."""
    link, node = split(tip)
    scalars = list(poses.world(link, node))
    if oriented:
        scalars += list(poses.motion.placement(link).world_rotation.ravel())
    table = poses._compile(scalars)
    depends = np.asarray(table.program.dependence.any(axis=0))
    return depends[len(depends) - len(poses.parameters.design) :]
