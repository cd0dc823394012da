"""The graph of links and joints: a spanning tree from the ground, and what closes loops."""

from __future__ import annotations

from dataclasses import dataclass

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.joints import COMPONENTS, RIDING

Node = tuple[str, str]  # (link, node); the ground is ("ground", "")
GROUND: Node = ("ground", "")


@dataclass(frozen=True)
class Edge:
    """One joint between a base node and a follower node; ``link`` hangs on it if in the tree."""

    joint: str
    base: Node
    follower: Node


@dataclass(frozen=True)
class Freedom:
    """One freedom of one joint: driven by coordinate number ``coordinate``, or passive (None)."""

    joint: str
    component: int
    coordinate: int | None


@dataclass(frozen=True)
class Tree:
    """Tree edges in an order where every base is placed first; loop edges; freedoms."""

    edges: tuple[Edge, ...]
    loops: tuple[Edge, ...]
    freedoms: tuple[Freedom, ...]  # the coordinates in their order, then the passive ones

    @property
    def passive(self) -> tuple[Freedom, ...]:
        """The freedoms without a coordinate."""
        return tuple(f for f in self.freedoms if f.coordinate is None)

    def of_joint(self, joint: str) -> list[int]:
        """Positions among the freedoms of one joint's own, by component."""
        own = [(f.component, k) for k, f in enumerate(self.freedoms) if f.joint == joint]
        return [k for _, k in sorted(own)]


def build_tree(case: CaseFile) -> Tree:
    """Breadth first from the ground, joints in the order of the file.

    Raises MechanismError for a link that no joint connects to the ground.
    """
    edges, loops = _walk([_edge(case, joint) for joint in case.mechanism.joints])
    placed = {edge.follower[0] for edge in edges}
    for link in case.mechanism.links:
        if link not in placed:
            message = "is not connected to the ground by joints"
            raise MechanismError(f"mechanism.links.{link}", message)
    return Tree(tuple(edges), tuple(loops), _freedoms(case))


def _edge(case: CaseFile, name: str) -> Edge:
    joint = case.mechanism.joints[name]
    base = GROUND
    if joint.type in RIDING:
        base = (joint.base, f"@{name}")
    elif joint.base != "ground":
        base = split(joint.base)
    return Edge(name, base, split(joint.follower))


def split(node: str) -> Node:
    """ "link.node" → (link, node)."""
    link, _, name = node.partition(".")
    return link, name


def _walk(waiting: list[Edge]) -> tuple[list[Edge], list[Edge]]:
    placed, tree = {"ground"}, list[Edge]()
    while waiting:
        step = next(
            (e for e in waiting if e.base[0] in placed and e.follower[0] not in placed), None
        )
        if step is None:
            closing = [e for e in waiting if e.base[0] in placed and e.follower[0] in placed]
            backward = next(
                (e for e in waiting if e.follower[0] in placed and e not in closing), None
            )
            if backward is None:
                return tree, closing
            message = "hangs its base on its follower: swap base and follower"
            raise MechanismError(f"mechanism.joints.{backward.joint}", message)
        waiting = [e for e in waiting if e is not step]
        tree.append(step)
        placed.add(step.follower[0])
    return tree, []


def _freedoms(case: CaseFile) -> tuple[Freedom, ...]:
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
