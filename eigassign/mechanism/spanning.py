"""A spanning tree of links from the ground; the joints left over close loops.

Each loop is closed, where it can be, at a node that deforms: that node's motion then follows from
the rest. So a loop is closed at another of its joints where the first choice ends between rigid
links or at nodes that are carried already.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.joints import RIDING
from eigassign.mechanism.tree import GROUND, Edge, Node, Tree, freedoms, split


class _Walk(NamedTuple):
    """Tree edges, and the other joints sorted: ending in a free node that deforms, or not."""

    edges: list[Edge]
    elastic: list[Edge]
    rigid: list[Edge]


def build_tree(case: CaseFile) -> Tree:
    """From the ground, joints in the order of the file, each from base to follower if possible.

    Raises MechanismError for a link that no joint connects to the ground.
    """
    joints = [_edge(case, joint) for joint in case.mechanism.joints]
    rigid = {n for n, link in case.mechanism.links.items() if getattr(link, "type", "") == "rigid"}
    walk = _walk(joints, frozenset(), rigid)
    _require_connected(case, walk.edges)
    while better := _better(joints, walk, rigid):
        walk = better
    loops = (*walk.elastic, *walk.rigid)
    return Tree(tuple(walk.edges), loops, len(walk.elastic), freedoms(case))


def _edge(case: CaseFile, name: str) -> Edge:
    joint = case.mechanism.joints[name]
    base = GROUND
    if joint.type in RIDING:
        base = (joint.base, f"@{name}")
    elif joint.base != "ground":
        base = split(joint.base)
    return Edge(name, base, split(joint.follower))


def _require_connected(case: CaseFile, edges: Sequence[Edge]) -> None:
    placed = {edge.follower[0] for edge in edges}
    for link in case.mechanism.links:
        if link not in placed:
            message = "is not connected to the ground by joints"
            raise MechanismError(f"mechanism.links.{link}", message)


def _walk(joints: Sequence[Edge], closing: frozenset[str], rigid: set[str]) -> _Walk:
    """Hang link after link, keeping the joints ``closing`` for loops."""
    placed, tree = {"ground"}, list[Edge]()
    waiting = [e for e in joints if e.joint not in closing]
    while step := next(_steps(waiting, placed), None):
        tree.append(step)
        placed.add(step.follower[0])
        del waiting[next(k for k, e in enumerate(waiting) if e.joint == step.joint)]
    used = {edge.joint for edge in tree}
    return _sorted(tree, [e for e in joints if e.joint not in used], rigid)


def _steps(waiting: Sequence[Edge], placed: set[str]) -> Iterator[Edge]:
    """Joints that reach a new link: as the file has them first, then against their direction."""
    for edges in (waiting, (e.reversed() for e in waiting)):
        yield from (e for e in edges if e.base[0] in placed and e.follower[0] not in placed)


def _sorted(tree: list[Edge], loops: Sequence[Edge], rigid: set[str]) -> _Walk:
    """Loop edges towards a node of their own that deforms, and those that have none."""
    carriers = {edge.follower: edge.base for edge in tree}
    roots = {edge.follower[0]: edge.follower for edge in tree}
    walk = _Walk(tree, [], [])
    for edge in loops:
        ends = (e for e in (edge, edge.reversed()) if e.follower[0] not in {"ground", *rigid})
        closed = next((e for e in ends if _free(e, carriers, roots, rigid)), None)
        if closed is None:
            walk.rigid.append(edge)
        else:
            walk.elastic.append(closed)
            carriers[closed.follower] = closed.base
    return walk


def _free(edge: Edge, carriers: dict[Node, Node], roots: dict[str, Node], rigid: set[str]) -> bool:
    """Whether nothing carries the follower node yet, and it does not carry the base node itself."""
    node = edge.base
    while node != edge.follower:
        if node in carriers:
            node = carriers[node]
        elif node[0] in rigid:
            node = roots[node[0]]
        else:
            return edge.follower not in carriers
    return False


def _better(joints: Sequence[Edge], walk: _Walk, rigid: set[str]) -> _Walk | None:
    """The walk with one more loop closed at a node that deforms, by exchanging two joints."""
    closing = frozenset(e.joint for e in (*walk.elastic, *walk.rigid))
    for edge in walk.rigid:
        for other in _round(walk.edges, edge):
            trial = _walk(joints, closing - {edge.joint} | {other}, rigid)
            if len(trial.rigid) < len(walk.rigid):
                return trial
    return None


def _round(edges: Sequence[Edge], closing: Edge) -> list[str]:
    """The tree joints of the loop that a joint closes."""
    holder = {edge.follower[0]: edge for edge in edges}
    sides = []
    for link in (closing.base[0], closing.follower[0]):
        path = []
        while link in holder:
            path.append(holder[link].joint)
            link = holder[link].base[0]
        sides.append(path)
    return [j for j in (*sides[0], *sides[1]) if (j in sides[0]) != (j in sides[1])]
