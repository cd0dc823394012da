"""Joints between links, the coordinates that move them, and how loops are put together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.rules.lookups import freedoms, guessed, moving, node_problem
from eigassign.case.schema.document import Document
from eigassign.case.schema.joints import JointBase, NutJoint, RevoluteJoint
from eigassign.case.schema.links import BeamLink
from eigassign.case.schema.mechanism import Coordinate, Mechanism
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


def walk_from_the_ground(mechanism: Mechanism) -> Walk | None:
    """Place link after link, joints in the order of the file.

    None if a joint does not join two links that exist.
    """
    known = set(mechanism.links)
    waiting = []
    for joint, body in mechanism.joints.items():
        base, follower = (node.partition(".")[0] for node in (body.base, body.follower))
        if base not in {*known, "ground"} or follower not in known or base == follower:
            return None
        waiting.append(Edge(joint, base, follower))
    placed = {"ground"}
    while step := next((e for e in waiting if (e.base in placed) != (e.follower in placed)), None):
        placed |= {step.base, step.follower}
        waiting.remove(step)
    loops = tuple(e for e in waiting if e.base in placed)
    return Walk(frozenset(placed), loops, tuple(e for e in waiting if e.base not in placed))


def beams_carry_one_rider(document: Document) -> Iterator[Finding]:
    """One carriage or nut travels along a beam: its mesh is divided where that stands."""
    riders: dict[str, str] = {}
    for name, joint in document.mechanism.joints.items():
        if not joint.travels:
            continue
        if joint.base in riders:
            message = (
                f"{riders[joint.base]!r} travels along {joint.base!r} already, and a beam carries "
                "one carriage or nut: make it two beams, with a fixed joint between them"
            )
            yield (*_JOINTS, name, "base"), message
        riders.setdefault(joint.base, name)


def nuts_are_on_their_shaft(document: Document) -> Iterator[Finding]:
    """A nut turns about its shaft: beside it there is none to turn about."""
    for name, joint in document.mechanism.joints.items():
        if isinstance(joint, NutJoint) and any((joint.position or ())[1:]):
            message = (
                "a nut stands on the axis of its shaft, so that only the first component of its "
                "position may differ from zero: place what it carries by the nodes of its follower"
            )
            yield (*_JOINTS, name, "position"), message


def joints_connect_two_links(document: Document) -> Iterator[Finding]:
    """A joint's base and follower are nodes of two links; the base may be the ground, or a beam."""
    for name, joint in document.mechanism.joints.items():
        path = (*_JOINTS, name)
        if problem := _base_problem(document.mechanism, joint):
            yield (*path, "base"), problem
        link = joint.follower.partition(".")[0]
        if link == "ground":
            yield (*path, "follower"), "ground cannot follow: make it the base"
        elif problem := node_problem(document.mechanism, joint.follower):
            yield (*path, "follower"), problem
        elif joint.base.partition(".")[0] == link:
            yield path, "base and follower are the same link: a joint connects two"


def _base_problem(mechanism: Mechanism, joint: JointBase) -> str | None:
    base = joint.base
    if not joint.travels:
        return None if base == "ground" else node_problem(mechanism, base, "ground")
    beams = [name for name, link in mechanism.links.items() if isinstance(link, BeamLink)]
    if base in beams:
        return None
    hint = suggestion(base.partition(".")[0], beams)
    if not beams:
        return f"rides along a link of type beam, and there is none; got {shown(base)}"
    return f"rides along a beam: expected one of {listed(beams)}, got {shown(base)}{hint}"


def links_are_connected_to_the_ground(document: Document) -> Iterator[Finding]:
    """Joints lead from the ground to every link; what hangs together apart is reported once."""
    walk = walk_from_the_ground(document.mechanism)
    left = [link for link in document.mechanism.links if walk and link not in walk.placed]
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


def coordinates_move_one_freedom_each(document: Document) -> Iterator[Finding]:
    """Each coordinate names a freedom that exists and that no other moves; in an open mechanism
    every freedom has one, since nothing else determines it."""
    mechanism = document.mechanism
    owner: dict[tuple[str, str], str] = {}  # coordinate by joint and freedom
    complete = True
    for name, body in document.coordinates.items():
        path: KeyPath = ("coordinates", name)
        known = freedoms(mechanism, body.joint)
        if problem := _problem(mechanism, known, body, path):
            yield problem
            complete = complete and known == ()
            continue
        freedom = str(body.component or (known or ("",))[0])
        if (body.joint, freedom) in owner:
            of = f"{freedom} of " if known and len(known) > 1 else ""
            message = f"{of}joint {body.joint!r} has a coordinate already: "
            yield (*path, "joint"), f"{message}{owner[body.joint, freedom]!r}"
        owner.setdefault((body.joint, freedom), name)
        if body.angle == "absolute" and not isinstance(mechanism.joints[body.joint], RevoluteJoint):
            yield (*path, "angle"), "only the angle of a revolute joint can be absolute"
    walk = walk_from_the_ground(mechanism)
    if complete and walk is not None and not walk.loops:
        yield from _undriven(document, owner)


def _problem(
    mechanism: Mechanism, known: tuple[str, ...] | None, body: Coordinate, path: KeyPath
) -> Finding | None:
    """The mistake in the joint, or in the component of it, if there is one."""
    joint, component = body.joint, body.component
    if known is None:
        return (*path, "joint"), unknown("joint", joint, mechanism.joints)
    if known == ():
        message = f"joint {joint!r} is fixed and has no coordinate; joints that move: "
        return (*path, "joint"), message + listed(moving(mechanism))
    message = f"joint {joint!r} is {mechanism.joints[joint].type}: "
    if component is None and len(known) > 1:
        message += "say which of its freedoms this is, component: "
        return path, message + " or ".join(known)
    if component is not None and str(component) not in known:
        message += f"expected {' or '.join(known)}, got {shown(component)}"
        return (*path, "component"), message
    return None


def _undriven(document: Document, owner: dict[tuple[str, str], str]) -> Iterator[Finding]:
    for joint in moving(document.mechanism):
        known = freedoms(document.mechanism, joint) or ()
        missing = [freedom for freedom in known if (joint, freedom) not in owner]
        if missing:
            which = f", component: {missing[0]}" if len(known) > 1 else ""
            first = f"q{len(document.coordinates) + 1}"
            message = f"no coordinate: add one under coordinates, e.g. {first}: "
            yield (*_JOINTS, joint), message + f"{{joint: {joint}{which}}}"


# --- Loops are put together


def assembly_names_coordinates_and_joints(document: Document) -> Iterator[Finding]:
    """`at` names coordinates, `guess` joints that move, with a number for each freedom."""
    assembly, path = document.mechanism.assembly, ("mechanism", "assembly")
    for name in assembly.at if assembly else ():
        if name not in document.coordinates:
            yield (*path, "at", name), unknown("coordinate", name, document.coordinates)
    for joint, value in assembly.guess.items() if assembly else ():
        if problem := _guess_problem(document, joint, value):
            yield (*path, "guess", joint), problem


def _guess_problem(document: Document, joint: str, value: object) -> str | None:
    known = freedoms(document.mechanism, joint)
    if known is None:
        return unknown("joint", joint, document.mechanism.joints)
    if known == ():
        return f"joint {joint!r} is fixed: there is nothing to guess"
    count = len(value) if isinstance(value, tuple) else 1
    if len(known) > 1 and guessed(document, joint, count) is None:
        return f"needs a list of {len(known)}: {listed(known)}; or of those without a coordinate"
    if len(known) == 1 and isinstance(value, tuple):
        return f"joint {joint!r} has one freedom: expected a number, got a list"
    return None


def assembly_is_for_loops(document: Document) -> Iterator[Finding]:
    """An open mechanism can be put together in one way only."""
    walk = walk_from_the_ground(document.mechanism)
    if document.mechanism.assembly is not None and walk is not None and not walk.loops:
        yield ("mechanism", "assembly"), "no joint closes a loop: there is nothing to choose"
