"""How the joints connect the links: from the ground outwards, some of them closing loops."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from eigassign.case.freedoms import RIDING
from eigassign.case.nodes import kind_of, node_problem
from eigassign.case.suggest import listed, shown, suggestion
from eigassign.case.tree import Tree, items, names, text
from eigassign.case.yaml_reader import Finding, KeyPath


@dataclass(frozen=True)
class Edge:
    """A joint between two links, or the ground and a link."""

    joint: str
    base: str
    follower: str


@dataclass(frozen=True)
class Walk:
    """Links that joints connect to the ground, and the joints sorted."""

    placed: frozenset[str]
    loops: tuple[Edge, ...]  # both their links are placed by others
    left: tuple[Edge, ...]  # neither of their links is


def topology(tree: Tree) -> Iterator[Finding]:
    """Joint ends that do not exist, and links that no joint connects to the ground."""
    links = dict(items(tree, "mechanism", "links"))
    if not links:
        return
    for joint, body in items(tree, "mechanism", "joints"):
        yield from _ends(tree, body, ("mechanism", "joints", joint))
    walk = walked(tree)
    if walk is not None:
        yield from _loose(links, walk)


def has_loops(tree: Tree) -> bool | None:
    """Whether joints close loops; None where the joints are not sound."""
    walk = walked(tree)
    return None if walk is None else bool(walk.loops)


def edges(tree: Tree) -> list[Edge] | None:
    """All joints as edges; None if one of them does not join two that exist."""
    links = set(names(tree, "mechanism", "links"))
    bases = links | {"ground"}
    found = []
    for joint, body in items(tree, "mechanism", "joints"):
        ends = [(text(body, key) or "").partition(".")[0] for key in ("base", "follower")]
        if ends[0] not in bases or ends[1] not in links or ends[0] == ends[1]:
            return None
        found.append(Edge(joint, *ends))
    return found


def walked(tree: Tree) -> Walk | None:
    """Place link after link from the ground on, joints in the order of the file."""
    waiting = edges(tree)
    if waiting is None:
        return None
    placed = {"ground"}
    while step := next((e for e in waiting if (e.base in placed) != (e.follower in placed)), None):
        placed |= {step.base, step.follower}
        waiting.remove(step)
    loops = tuple(e for e in waiting if e.base in placed)
    return Walk(frozenset(placed), loops, tuple(e for e in waiting if e.base not in placed))


def _ends(tree: Tree, body: object, path: KeyPath) -> Iterator[Finding]:
    base, follower = text(body, "base"), text(body, "follower")
    if base is not None:
        riding = text(body, "type") in RIDING
        problem = _rail_problem(tree, base) if riding else _base_problem(tree, base)
        if problem:
            yield (*path, "base"), problem
    if follower is not None:
        problem = _follower_problem(tree, follower)
        if problem:
            yield (*path, "follower"), problem
        elif base is not None and base.partition(".")[0] == follower.partition(".")[0]:
            yield path, "base and follower are the same link: a joint connects two"


def _base_problem(tree: Tree, base: str) -> str | None:
    return None if base == "ground" else node_problem(tree, base, "ground")


def _rail_problem(tree: Tree, base: str) -> str | None:
    """A carriage or nut rides on a whole beam, not on a node of it."""
    links = dict(items(tree, "mechanism", "links"))
    beams = [name for name, link in links.items() if kind_of(link) == "beam"]
    if base in beams or (base in links and kind_of(links[base]) is None):
        return None
    hint = suggestion(base.partition(".")[0], beams)
    return f"rides along a beam: expected one of {listed(beams)}, got {shown(base)}{hint}"


def _follower_problem(tree: Tree, follower: str) -> str | None:
    if follower.partition(".")[0] == "ground":
        return "ground cannot follow: make it the base"
    return node_problem(tree, follower)


def _loose(links: Mapping[str, object], walk: Walk) -> Iterator[Finding]:
    """Links that hang together while nothing connects them to the ground: each group told once."""
    left = [link for link in links if link not in walk.placed]
    while left:
        group, joints = _together(left[0], walk.left)
        if joints:
            message = f"{listed(joints)} join {listed([n for n in left if n in group])}"
            path = ("mechanism", "joints", joints[0])
            yield path, f"{message}, but no joint connects these to the ground"
        else:
            message = f"no joint holds this link: add one with follower: {left[0]}.<node>"
            yield ("mechanism", "links", left[0]), message
        left = [link for link in left if link not in group]


def _together(link: str, joints: tuple[Edge, ...]) -> tuple[set[str], list[str]]:
    """All links that joints connect with one, and these joints."""
    group: set[str] = set()
    new = {link}
    while new:
        group |= new
        new = {end for e in joints for end in (e.base, e.follower) if _meets(e, group)} - group
    return group, [e.joint for e in joints if _meets(e, group)]


def _meets(edge: Edge, group: set[str]) -> bool:
    return edge.base in group or edge.follower in group
