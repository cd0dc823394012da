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
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinkFrames:
    """World frames of all links as functions of x = (q, y)."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    links: tuple[str, ...]
    drawn: tuple[tuple[tuple[str, str], ...], ...]  # per link: the node pairs of its lines

    def values(self, x: Floats, arrays: Sequence[NDArray[np.object_]]) -> list[Floats]:
        """Numbers (n_samples, *shape) of arrays of this mechanism's scalars, evaluated together."""
        return self.parameters.compiled(*arrays)(self.parameters.z(np.atleast_2d(x)))

    @cached_property
    def _ends(self) -> CompiledArrays:
        """World positions (n_lines, 2, 3) of both ends of every drawn line of each link."""
        drawn = zip(self.links, self.drawn, strict=True)
        places = [[[self.world(k, node) for node in pair] for pair in pairs] for k, pairs in drawn]
        return self.parameters.compiled(*(np.array(each, dtype=object) for each in places))

    def world(self, link: str, node: str) -> NDArray[np.object_]:
        """World position of a named node, as scalars (3,)."""
        X = node_position(self.case, self.parameters, self.motion.tree, (link, node))
        return self.motion.placement(link).at(X)[1]

    def segments(self, x: Floats) -> tuple[Floats, ...]:
        """The straight lines of each link, (n, n_lines, 2 ends, 3) in m."""
        return tuple(self._ends(self.parameters.z(np.atleast_2d(x))))

    def lines(self, x: Floats) -> Floats:
        """Start and end of every link, (n, n_links, 2, 3) in m: the first and last point drawn."""
        pieces = self.segments(x)
        ends = [np.stack([p[:, 0, 0], p[:, -1, 1]], axis=1) for p in pieces]
        return np.stack(ends, axis=1)

    def position(self, x: Floats, link: str, node: str) -> Floats:
        """World position (n, 3) of a named node, in m."""
        return self.values(x, [self.world(link, node)])[0]


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
    arrays = [poses.world(link, node)]
    if oriented:
        arrays.append(poses.motion.placement(link).world_rotation)
    program = poses.parameters.compiled(*arrays).table.program
    depends = np.asarray(program.dependence.any(axis=0))
    return depends[len(depends) - len(poses.parameters.design) :]
