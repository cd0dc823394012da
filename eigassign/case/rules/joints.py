"""Coordinates against the joints they move, and lists that go with them.

How the joints connect the links: from the ground outwards, some of them closing loops.

Joints that close a loop without any link in it: several on one pin, of which one is too many.

A loop has the breadth of the links in it. Where joints alone lead from a node back to it, as with
two joints between the same two nodes, or three among three links on one pin, all of them hold the
same place, and the last adds nothing as long as it allows what the others allow. Loops that are
overconstrained otherwise (hinges side by side, a planar linkage in space, a frame clamped at both
ends) hold flexible links in different places, and are none of this.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from eigassign.case.reader import (
    Finding,
    KeyPath,
    Tree,
    at,
    entries,
    items,
    lacks,
    names,
    text,
    trajectories,
)
from eigassign.case.rules.nodes import kind_of, node_problem
from eigassign.case.schema.joints import FREEDOMS, RIDING, freedoms
from eigassign.case.schema.vectors import ANGLE
from eigassign.case.suggestions import listed, shown, suggestion, unknown
from eigassign.case.units import QuantityError

# --- Coordinates against the joints they move, and lists that go with them

_JOINTS = ("mechanism", "joints")


def coordinates(tree: Tree) -> Iterator[Finding]:
    """Joints and components that do not exist or move twice, and joints that nothing moves."""
    owner: dict[tuple[str, str], str] = {}
    complete = True
    for name, body in items(tree, "coordinates"):
        known = len(owner)
        yield from _coordinate(tree, name, body, owner)
        complete = complete and len(owner) > known
    if complete and has_loops(tree) is False:
        yield from _undriven(tree, owner)


def _coordinate(
    tree: Tree, name: str, body: object, owner: dict[tuple[str, str], str]
) -> Iterator[Finding]:
    joint, path = text(body, "joint"), ("coordinates", name)
    if joint is None:
        return
    if lacks(tree, _JOINTS, joint):
        yield (*path, "joint"), unknown("joint", joint, names(tree, *_JOINTS))
        return
    known = freedoms(tree, joint)
    if known == ():
        message = f"joint {joint!r} is fixed and has no coordinate; joints that move: "
        yield (*path, "joint"), message + listed(moving(tree))
        owner[joint, name] = name
        return
    if known is None:
        return
    component = at(body, "component")
    problem = _component_problem(joint, text(tree, *_JOINTS, joint, "type") or "", component)
    if problem:
        yield (*path, *(("component",) if component is not None else ())), problem
        return
    freedom = known[0] if component is None else str(component)
    if (joint, freedom) in owner:
        which = f"joint {joint!r}" if len(known) == 1 else f"{freedom} of joint {joint!r}"
        yield (*path, "joint"), f"{which} has a coordinate already: {owner[joint, freedom]!r}"
        owner[joint, name] = name
    owner.setdefault((joint, freedom), name)
    planar = text(tree, "mechanism", "space") == "planar"
    revolute = text(tree, *_JOINTS, joint, "type") == "revolute"
    if planar and at(body, "angle") == "absolute" and not revolute:
        yield (*path, "angle"), "only the angle of a revolute joint can be absolute"


def _component_problem(joint: str, kind: str, component: object) -> str | None:
    known = FREEDOMS[kind]
    if component is None and len(known) == 1:
        return None
    if component is None:
        message = f"joint {joint!r} is {kind}: say which of its freedoms this is, component: "
        return message + " or ".join(known)
    if isinstance(component, (str, int)) and str(component) in known:
        return None
    if component not in (1, 2, 3, "rotation", "translation"):
        return None  # the schema says so
    return f"joint {joint!r} is {kind}: expected {' or '.join(known)}, got {shown(component)}"


def _undriven(tree: Tree, owner: dict[tuple[str, str], str]) -> Iterator[Finding]:
    """In an open mechanism nothing determines a freedom without a coordinate."""
    n = len(names(tree, "coordinates"))
    for joint in moving(tree):
        known = freedoms(tree, joint) or ()
        missing = [freedom for freedom in known if (joint, freedom) not in owner]
        if missing:
            which = f", component: {missing[0]}" if len(known) > 1 else ""
            message = f"no coordinate: add one under coordinates, e.g. q{n + 1}: "
            yield (*_JOINTS, joint), message + f"{{joint: {joint}{which}}}"


def moving(tree: Tree) -> list[str]:
    """Names of the joints that are not fixed."""
    return [name for name in names(tree, *_JOINTS) if freedoms(tree, name)]


def one_for_each(value: object, path: KeyPath, kind: str, known: list[str]) -> list[Finding]:
    """A finding if list ``value`` has not one entry for each of ``known``."""
    if not isinstance(value, tuple) or len(value) == len(known):
        return []
    message = f"needs {len(known)} entries, one for each {kind} ({listed(known)}); got {len(value)}"
    return [(path, message)]


def per_coordinate(tree: Tree) -> Iterator[Finding]:
    """Lists with one entry for each coordinate."""
    q = names(tree, "coordinates")
    for path, body in trajectories(tree):
        for key in ("q", "points"):
            for k, row in enumerate(entries(body, key)):
                yield from one_for_each(row, (*path, key, k), "coordinate", q)
        yield from one_for_each(at(body, "start"), (*path, "start"), "coordinate", q)
    for place in (("validation", "q_span"), ("expansion", "q")):
        yield from one_for_each(at(tree, *place), place, "coordinate", q)


def branches(tree: Tree) -> Iterator[Finding]:
    """Ranges of joints that keep a tip path in its branch."""
    ranged = [name for name in moving(tree) if len(freedoms(tree, name) or ()) == 1]
    driven = [text(body, "joint") for _, body in items(tree, "coordinates")]
    for place, body in trajectories(tree):
        for joint, limits in items(body, "branch"):
            path: KeyPath = (*place, "branch", joint)
            if joint not in ranged:
                yield path, unknown("joint with one freedom", joint, ranged)
            elif joint not in driven:
                known = listed([name for name in ranged if name in driven])
                yield path, f"no coordinate moves this joint (mechanism.assembly does); use {known}"
            elif _repeats(tree, joint) and _width(limits) > 2 * math.pi:
                yield path, "wider than one turn (an angle is in rad when bare; or write deg)"


def _repeats(tree: Tree, joint: str) -> bool:
    """Whether a full turn of the joint leads back; a screw advances meanwhile."""
    return text(tree, *_JOINTS, joint, "type") == "revolute"


def _width(limits: object) -> float:
    try:
        low, high = (ANGLE.read(limit) for limit in limits)  # type: ignore[attr-defined]
    except (QuantityError, TypeError, ValueError):
        return 0.0
    return high - low


def assembly(tree: Tree) -> Iterator[Finding]:
    """Coordinates and joints that choose how loops are put together."""
    path: KeyPath = ("mechanism", "assembly")
    known = names(tree, "coordinates")
    for name in names(tree, *path[:2], "at"):  # type: ignore[arg-type]
        if name not in known:
            yield (*path, "at", name), unknown("coordinate", name, known)
    for joint, value in items(tree, "mechanism", "assembly", "guess"):
        inner = (*path, "guess", joint)
        if lacks(tree, _JOINTS, joint):
            yield inner, unknown("joint", joint, names(tree, *_JOINTS))
        else:
            yield from _guess(tree, joint, value, inner)
    if at(tree, "mechanism", "assembly") is not None and has_loops(tree) is False:
        yield path, "no joint closes a loop: there is nothing to choose"


def _guess(tree: Tree, joint: str, value: object, path: KeyPath) -> Iterator[Finding]:
    known = freedoms(tree, joint)
    if known is None:
        return
    if not known:
        yield path, f"joint {joint!r} is fixed: there is nothing to guess"
    elif len(known) > 1 and (not isinstance(value, tuple) or len(value) != len(known)):
        yield path, f"needs a list of {len(known)}: {listed(known)}"
    elif len(known) == 1 and isinstance(value, tuple):
        yield path, f"joint {joint!r} has one freedom: expected a number, got a list"


# --- How the joints connect the links: from the ground outwards, some of them closing loops


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


# --- Joints that close a loop without any link in it: several on one pin, of which one is too m

Node = tuple[str, tuple[float, ...]]  # a node, and how far from it


def joined_twice(joints: Mapping[str, Any]) -> Iterator[Finding]:
    """A warning for each joint whose two nodes earlier joints join already."""
    led: dict[Node, dict[Node, str]] = {}
    for name, joint in joints.items():
        base, follower = _node(joint.base, joint), (joint.follower, ())
        others = _path(led, base, follower)
        if others:
            yield ("mechanism", "joints", name), _message(joint, others)
        else:
            led.setdefault(base, {})[follower] = name
            led.setdefault(follower, {})[base] = name


def _node(name: str, joint: Any) -> Node:
    """The base's node, or a place beside it."""
    position = tuple(float(x) for x in getattr(joint, "position", None) or ())
    return name, position if any(position) else ()


def _path(led: Mapping[Node, Mapping[Node, str]], start: Node, end: Node) -> list[str]:
    """The joints on the way from one node to another; none where there is no way."""
    ways: dict[Node, list[str]] = {start: []}
    queue = [start]
    for here in queue:
        for there, joint in led.get(here, {}).items():
            if there not in ways:
                ways[there] = [*ways[here], joint]
                queue.append(there)
    return ways.get(end, [])


def _message(joint: Any, others: list[str]) -> str:
    held = " and ".join(repr(name) for name in others)
    verb = "joins" if len(others) == 1 else "join"
    return (
        f"is redundant: {held} {verb} {joint.base} and {joint.follower} already, so that it holds "
        "nothing new where it allows the same motion; leave it out, or was another node meant?"
    )
