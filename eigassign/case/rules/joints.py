"""Joints between links, the coordinates that move them, and how loops are put together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, lacks, names, text
from eigassign.case.rules.lookups import (
    freedoms,
    guessed,
    is_planar,
    links,
    moving,
    node_problem,
    number,
    type_of,
)
from eigassign.case.schema.joints import RIDING
from eigassign.case.schema.parts import PLACE
from eigassign.case.suggestions import listed, shown, suggestion, unknown

_JOINTS = ("mechanism", "joints")

# --- Joints connect links to the ground


class Edge(NamedTuple):
    """A joint between two links, or the ground and a link."""

    joint: str
    base: str
    follower: str


class Walk(NamedTuple):
    """Links that joints connect to the ground, and the joints that placed none of them."""

    placed: frozenset[str]
    loops: tuple[Edge, ...]  # both their links are placed by others
    apart: tuple[Edge, ...]  # neither of their links is placed


def walk_from_the_ground(tree: Tree) -> Walk | None:
    """Place link after link, joints in the order of the file.

    None if a joint does not join two links that exist.
    """
    known = set(names(tree, "mechanism", "links"))
    waiting = []
    for joint, body in items(tree, *_JOINTS):
        base, follower = ((text(body, key) or "").partition(".")[0] for key in ("base", "follower"))
        if base not in {*known, "ground"} or follower not in known or base == follower:
            return None
        waiting.append(Edge(joint, base, follower))
    placed = {"ground"}
    while step := next((e for e in waiting if (e.base in placed) != (e.follower in placed)), None):
        placed |= {step.base, step.follower}
        waiting.remove(step)
    loops = tuple(e for e in waiting if e.base in placed)
    return Walk(frozenset(placed), loops, tuple(e for e in waiting if e.base not in placed))


def beams_carry_one_rider(tree: Tree) -> Iterator[Finding]:
    """One carriage or nut travels along a beam: its mesh is divided where that stands."""
    riders: dict[str, str] = {}
    for joint, body in items(tree, *_JOINTS):
        base = text(body, "base")
        if text(body, "type") not in RIDING or base is None:
            continue
        if base in riders:
            message = (
                f"{riders[base]!r} travels along {base!r} already, and a beam carries one carriage "
                "or nut: make it two beams, with a fixed joint between them"
            )
            yield (*_JOINTS, joint, "base"), message
        riders.setdefault(base, joint)


def nuts_are_on_their_shaft(tree: Tree) -> Iterator[Finding]:
    """A nut turns about its shaft: beside it there is none to turn about."""
    for joint, body in items(tree, *_JOINTS):
        if text(body, "type") == "nut" and any(
            number(value, PLACE) for value in entries(body, "position")[1:]
        ):
            message = (
                "a nut stands on the axis of its shaft, so that only the first component of its "
                "position may differ from zero: place what it carries by the nodes of its follower"
            )
            yield (*_JOINTS, joint, "position"), message


def joints_connect_two_links(tree: Tree) -> Iterator[Finding]:
    """A joint's base and follower are nodes of two links; the base may be the ground, or a beam."""
    if not names(tree, "mechanism", "links"):
        return
    for joint, body in items(tree, *_JOINTS):
        path = (*_JOINTS, joint)
        base, follower = text(body, "base"), text(body, "follower")
        if base is not None and (problem := _base_problem(tree, base, text(body, "type"))):
            yield (*path, "base"), problem
        if follower is None:
            continue
        link = follower.partition(".")[0]
        if link == "ground":
            yield (*path, "follower"), "ground cannot follow: make it the base"
        elif problem := node_problem(tree, follower):
            yield (*path, "follower"), problem
        elif base is not None and base.partition(".")[0] == link:
            yield path, "base and follower are the same link: a joint connects two"


def _base_problem(tree: Tree, base: str, kind: str | None) -> str | None:
    if kind not in RIDING:
        return None if base == "ground" else node_problem(tree, base, "ground")
    known = dict(items(tree, "mechanism", "links"))
    beams = [name for name, *_ in links(tree, "beam")]
    if base in beams or (base in known and type_of(known[base]) is None):
        return None
    hint = suggestion(base.partition(".")[0], beams)
    if not beams:
        return f"rides along a link of type beam, and there is none; got {shown(base)}"
    return f"rides along a beam: expected one of {listed(beams)}, got {shown(base)}{hint}"


def links_are_connected_to_the_ground(tree: Tree) -> Iterator[Finding]:
    """Joints lead from the ground to every link; what hangs together apart is reported once."""
    walk = walk_from_the_ground(tree)
    left = [link for link in names(tree, "mechanism", "links") if walk and link not in walk.placed]
    while walk and left:
        group = {left[0]}
        while more := [e for e in walk.apart if (e.base in group) != (e.follower in group)]:
            group |= {end for edge in more for end in (edge.base, edge.follower)}
        joints = [e.joint for e in walk.apart if e.base in group]
        if joints:
            message = f"{listed(joints)} join {listed([n for n in left if n in group])}"
            yield (*_JOINTS, joints[0]), f"{message}, but no joint connects these to the ground"
        else:
            message = f"no joint holds this link: add one with follower: {left[0]}.<node>"
            yield ("mechanism", "links", left[0]), message
        left = [link for link in left if link not in group]


# --- Coordinates move joints


def coordinates_move_one_freedom_each(tree: Tree) -> Iterator[Finding]:
    """Each coordinate names a freedom that exists and that no other moves; in an open mechanism
    every freedom has one, since nothing else determines it."""
    owner: dict[tuple[str, str], str] = {}  # coordinate by joint and freedom
    complete = True
    for name, body in items(tree, "coordinates"):
        joint, path = text(body, "joint"), ("coordinates", name)
        problems = list(_coordinate(tree, joint, body, path))
        yield from problems
        known, component = freedoms(tree, joint or ""), at(body, "component")
        if known == ():
            continue
        if joint is None or known is None or problems or component not in (None, *known, 1, 2, 3):
            complete = False  # what it moves is not known
            continue
        freedom = known[0] if component is None else str(component)
        if (joint, freedom) in owner:
            which = f"joint {joint!r}" if len(known) == 1 else f"{freedom} of joint {joint!r}"
            yield (*path, "joint"), f"{which} has a coordinate already: {owner[joint, freedom]!r}"
        owner.setdefault((joint, freedom), name)
        turns = text(tree, *_JOINTS, joint, "type") == "revolute"
        if is_planar(tree) and at(body, "angle") == "absolute" and not turns:
            yield (*path, "angle"), "only the angle of a revolute joint can be absolute"
    walk = walk_from_the_ground(tree)
    if complete and walk is not None and not walk.loops:
        yield from _undriven(tree, owner)


def _coordinate(tree: Tree, joint: str | None, body: object, path: KeyPath) -> Iterator[Finding]:
    """Mistakes in the joint, or in the component of it."""
    if joint is None:
        return
    if lacks(tree, _JOINTS, joint):
        yield (*path, "joint"), unknown("joint", joint, names(tree, *_JOINTS))
        return
    known = freedoms(tree, joint)
    if known == ():
        message = f"joint {joint!r} is fixed and has no coordinate; joints that move: "
        yield (*path, "joint"), message + listed(moving(tree))
        return
    kind, component = text(tree, *_JOINTS, joint, "type"), at(body, "component")
    if known is None or str(component) in known or (component is None and len(known) == 1):
        return
    if component is None:
        message = f"joint {joint!r} is {kind}: say which of its freedoms this is, component: "
        yield path, message + " or ".join(known)
    elif component in (1, 2, 3, "rotation", "translation"):  # otherwise the schema refuses it
        message = f"joint {joint!r} is {kind}: expected {' or '.join(known)}, got "
        yield (*path, "component"), message + shown(component)


def _undriven(tree: Tree, owner: dict[tuple[str, str], str]) -> Iterator[Finding]:
    n = len(names(tree, "coordinates"))
    for joint in moving(tree):
        known = freedoms(tree, joint) or ()
        missing = [freedom for freedom in known if (joint, freedom) not in owner]
        if missing:
            which = f", component: {missing[0]}" if len(known) > 1 else ""
            message = f"no coordinate: add one under coordinates, e.g. q{n + 1}: "
            yield (*_JOINTS, joint), message + f"{{joint: {joint}{which}}}"


# --- Loops are put together


def assembly_names_coordinates_and_joints(tree: Tree) -> Iterator[Finding]:
    """`at` names coordinates, `guess` joints that move, with a number for each freedom."""
    path = ("mechanism", "assembly")
    known = names(tree, "coordinates")
    for name in names(tree, *path, "at"):
        if name not in known:
            yield (*path, "at", name), unknown("coordinate", name, known)
    for joint, value in items(tree, *path, "guess"):
        if problem := _guess_problem(tree, joint, value):
            yield (*path, "guess", joint), problem


def _guess_problem(tree: Tree, joint: str, value: object) -> str | None:
    if lacks(tree, _JOINTS, joint):
        return unknown("joint", joint, names(tree, *_JOINTS))
    known = freedoms(tree, joint)
    if known == ():
        return f"joint {joint!r} is fixed: there is nothing to guess"
    if known and len(known) > 1:
        count = len(value) if isinstance(value, tuple) else 1
        if guessed(tree, joint, count) is None:
            return (
                f"needs a list of {len(known)}: {listed(known)}; or of those without a coordinate"
            )
    if known and len(known) == 1 and isinstance(value, tuple):
        return f"joint {joint!r} has one freedom: expected a number, got a list"
    return None


def assembly_is_for_loops(tree: Tree) -> Iterator[Finding]:
    """An open mechanism can be put together in one way only."""
    walk = walk_from_the_ground(tree)
    if at(tree, "mechanism", "assembly") is not None and walk is not None and not walk.loops:
        yield ("mechanism", "assembly"), "no joint closes a loop: there is nothing to choose"
