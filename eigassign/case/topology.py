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
    """The joints sorted: those that place a link, those that close loops, and the rest."""

    placed: frozenset[str]
    loops: tuple[Edge, ...]
    left: tuple[Edge, ...]  # their base is reached from nowhere


def topology(tree: Tree) -> Iterator[Finding]:
    """Joint ends that do not exist, and links that no joint connects to the ground."""
    links = dict(items(tree, "mechanism", "links"))
    if not links:
        return
    for joint, body in items(tree, "mechanism", "joints"):
        yield from _ends(tree, body, ("mechanism", "joints", joint))
    walk = walked(tree)
    if walk is not None:
        yield from _loose(links, walk, edges(tree) or [])


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
    while step := next((e for e in waiting if e.base in placed and e.follower not in placed), None):
        placed.add(step.follower)
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


def _loose(links: Mapping[str, object], walk: Walk, joints: list[Edge]) -> Iterator[Finding]:
    """Links that the walk from the ground does not reach, each told once and at its cause."""
    for edge in walk.left:
        if edge.follower in walk.placed:
            message = "hangs its base on its follower: swap base and follower"
            yield ("mechanism", "joints", edge.joint), message
    held = {e.follower for e in joints}
    reversed_bases = {e.base for e in walk.left if e.follower in walk.placed}
    for link in links:
        if link not in walk.placed | held | reversed_bases | {"ground"}:
            message = f"no joint holds this link: add one with follower: {link}.<node>"
            yield ("mechanism", "links", link), message
    yield from _rings(links, walk)


def _rings(links: Mapping[str, object], walk: Walk) -> Iterator[Finding]:
    """Links that hold each other while nothing connects them to the ground."""
    holders: dict[str, Edge] = {}
    for edge in walk.left:
        holders.setdefault(edge.follower, edge)
    seen: set[str] = set(walk.placed)
    for link in links:
        chain: list[str] = []
        while link in holders and link not in seen:
            seen.add(link)
            chain.append(link)
            link = holders[link].base
        if link in chain:
            ring = sorted(holders[member].joint for member in chain[chain.index(link) :])
            path = ("mechanism", "joints", holders[link].joint)
            message = f"{', '.join(ring)} form a ring that no joint connects to the ground"
            yield path, message
