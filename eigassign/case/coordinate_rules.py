"""Coordinates against the joints they move, and lists that go with them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from eigassign.case.freedoms import FREEDOMS, freedoms
from eigassign.case.suggest import listed, shown, unknown
from eigassign.case.topology import has_loops
from eigassign.case.tree import Tree, at, entries, items, lacks, names, text, trajectories
from eigassign.case.units import QuantityError
from eigassign.case.vectors import ANGLE
from eigassign.case.yaml_reader import Finding, KeyPath

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
