"""The graph of links and joints as it is walked: tree edges, loop edges, freedoms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from eigassign.case import CaseFile
from eigassign.mechanism.joints import COMPONENTS

Node = tuple[str, str]  # (link, node); the ground is ("ground", "")
GROUND: Node = ("ground", "")


@dataclass(frozen=True)
class Edge:
    """One joint as it is walked: ``follower`` hangs on ``base``.

    ``turned`` where the file names the two the other way round: the joint is then walked against
    its own direction, its freedoms keep their meaning.
    """

    joint: str
    base: Node
    follower: Node
    turned: bool = False

    def reversed(self) -> Edge:
        """The same joint walked the other way."""
        return Edge(self.joint, self.follower, self.base, not self.turned)

    @property
    def written(self) -> Edge:
        """The same joint as the file has it."""
        return self.reversed() if self.turned else self


@dataclass(frozen=True)
class Freedom:
    """One freedom of one joint: driven by coordinate number ``coordinate``, or passive (None)."""

    joint: str
    component: int
    coordinate: int | None


@dataclass(frozen=True)
class Tree:
    """Tree edges in an order where every base is placed first; loop edges; freedoms.

    The first ``n_elastic`` loops end in a node that deforms and carries nothing else: it follows.
    The others close between nodes that are rigid, or carried themselves.
    """

    edges: tuple[Edge, ...]
    loops: tuple[Edge, ...]
    n_elastic: int
    freedoms: tuple[Freedom, ...]  # the coordinates in their order, then the passive ones

    @property
    def passive(self) -> tuple[Freedom, ...]:
        """The freedoms without a coordinate."""
        return tuple(f for f in self.freedoms if f.coordinate is None)

    def of_joint(self, joint: str) -> list[int]:
        """Positions among the freedoms of one joint's own, by component."""
        own = [(f.component, k) for k, f in enumerate(self.freedoms) if f.joint == joint]
        return [k for _, k in sorted(own)]

    def riders(self, link: str) -> list[str]:
        """The carriages and nuts that travel along a link."""
        return self._riders.get(link, [])

    @cached_property
    def _riders(self) -> dict[str, list[str]]:
        """All of them by link: asked for once a link, of which there may be a thousand."""
        found: dict[str, list[str]] = {}
        for edge in (*self.edges, *self.loops):
            link, node = edge.written.base
            if node == f"@{edge.joint}":
                found.setdefault(link, []).append(edge.joint)
        return found


def split(node: str) -> Node:
    """ "link.node" → (link, node)."""
    link, _, name = node.partition(".")
    return link, name


def freedoms(case: CaseFile) -> tuple[Freedom, ...]:
    """The driven freedoms in the order of the coordinates, then the passive ones."""
    driven = [
        Freedom(c.joint, component_index(case, c), i)
        for i, c in enumerate(case.coordinates.values())
    ]
    taken = {(f.joint, f.component) for f in driven}
    passive = [
        Freedom(name, k, None)
        for name, joint in case.mechanism.joints.items()
        for k in range(len(COMPONENTS[joint.type]))
        if (name, k) not in taken
    ]
    return tuple(driven + passive)


def component_index(case: CaseFile, coordinate: object) -> int:
    """Which freedom of its joint a coordinate drives, from 0."""
    names = COMPONENTS[case.mechanism.joints[coordinate.joint].type]  # type: ignore[attr-defined]
    component = getattr(coordinate, "component", None)
    return 0 if component is None else names.index(str(component))
