"""Names that must agree: every reference of the file, and whether the joints make one mechanism.

Works on the plain tree, so that it speaks up even where the schema has objections elsewhere.

Planar and spatial: how many components vectors have, and which keys belong where.

Whether wanted frequencies that change in time are given for the whole motion.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from eigassign.case.reader import (
    Finding,
    KeyPath,
    Tree,
    at,
    entries,
    items,
    names,
    parameters,
    text,
    trajectories,
    trajectory_names,
)
from eigassign.case.rules.joints import (
    assembly,
    branches,
    coordinates,
    one_for_each,
    per_coordinate,
    topology,
)
from eigassign.case.rules.links import links
from eigassign.case.rules.nodes import node_problem
from eigassign.case.schema.joints import FREEDOMS, PLANAR
from eigassign.case.schema.trajectory import DURATION, TIME, TipTrajectory
from eigassign.case.suggestions import listed, shown, unknown
from eigassign.case.units import Quantity, QuantityError

# --- Names that must agree: every reference of the file, and whether the joints make one mechan

_NAME = re.compile(r"[^\W\d][\w-]{0,63}")
_UNUSABLE = (
    "not a usable name: names start with a letter and hold letters, digits, _ and - only "
    "(at most 64)"
)
_MOST_NAMED = 1000
_MOST_INSIDE = 10_000  # nodes or beams of one frame
_NAMED = (
    *(
        ("mechanism", key)
        for key in ("materials", "sections", "links", "joints", "bodies", "springs")
    ),
    ("coordinates",),
    ("design",),
    ("design", "constraints"),
)


def inconsistent(tree: Tree) -> Iterator[Finding]:
    """Everything that does not fit together."""
    yield from empty(tree)
    yield from _names(tree)
    yield from _names_of_trajectories(tree)
    yield from _titles(tree)
    yield from misfits(tree)
    yield from links(tree)
    yield from topology(tree)
    yield from _on_nodes(tree)
    yield from coordinates(tree)
    yield from assembly(tree)
    yield from per_coordinate(tree)
    yield from branches(tree)
    yield from _design(tree)
    yield from _expansion(tree)
    yield from _targets(tree)
    yield from uncovered(tree)


def too_many(tree: Tree) -> Iterator[Finding]:
    """Groups so large that the file is not a mechanism's."""
    for place in _NAMED:
        if len(items(tree, *place)) > _MOST_NAMED:
            yield place, f"more than {_MOST_NAMED} entries"
    for place in _inside_links(tree):
        if len(items(tree, *place)) > _MOST_INSIDE:
            yield place, f"more than {_MOST_INSIDE} entries: make it a superelement"


def empty(node: object, path: KeyPath = ()) -> Iterator[Finding]:
    """Keys and list entries without a value."""
    if node is None:
        comma = bool(path) and str(path[-1])[:1].isdigit()
        hint = " (decimals take a point, not a comma)" if comma else ""
        yield path, f"has no value: give one, or leave the key out{hint}"
    for key, inner in node.items() if isinstance(node, Mapping) else ():
        yield from empty(inner, (*path, key))
    for k, inner in enumerate(node) if isinstance(node, tuple) else ():
        if not isinstance(inner, (int, float)):
            yield from empty(inner, (*path, k))


def _names(tree: Tree) -> Iterator[Finding]:
    for place in (*_NAMED, *_inside_links(tree)):
        for name in names(tree, *place):
            if not _NAME.fullmatch(name):
                yield (*place, name), _UNUSABLE
    if "time" in names(tree, "coordinates"):
        yield ("coordinates", "time"), "'time' heads a column of its own: name it otherwise"
    if "ground" in names(tree, "mechanism", "links"):
        yield (
            ("mechanism", "links", "ground"),
            "'ground' is the fixed frame: name the link otherwise",
        )


def _names_of_trajectories(tree: Tree) -> Iterator[Finding]:
    """Each is the only one of its name: it names files, and some file systems ignore case."""
    seen: dict[str, str] = {}
    for path, body in trajectories(tree):
        name = text(body, "name")
        if name is None:
            continue
        if not _NAME.fullmatch(name):
            yield (*path, "name"), _UNUSABLE
        elif name.casefold() in seen:
            same = seen[name.casefold()]
            hint = "" if same == name else f": {same!r} (they name files, where case may be lost)"
            yield (*path, "name"), f"a trajectory has this name already{hint}"
        seen.setdefault(name.casefold(), name)


def _inside_links(tree: Tree) -> list[tuple[str, ...]]:
    named = names(tree, "mechanism", "links")
    return [("mechanism", "links", n, key) for n in named for key in ("nodes", "beams")]


def _titles(tree: Tree) -> Iterator[Finding]:
    for key in ("title", "reference"):
        if not (text(tree, key) or "").isprintable():
            yield (key,), "expected one line of printable text"


def _on_nodes(tree: Tree) -> Iterator[Finding]:
    """Bodies, springs and the tip, which stand on nodes."""
    for name, body in items(tree, "mechanism", "bodies"):
        yield from _node(tree, text(body, "at"), ("mechanism", "bodies", name, "at"))
    for name, spring in items(tree, "mechanism", "springs"):
        yield from _spring(tree, spring, ("mechanism", "springs", name))
    for path, body in trajectories(tree):
        yield from _node(tree, text(body, "tip"), (*path, "tip"))


def _node(tree: Tree, place: str | None, path: KeyPath) -> Iterator[Finding]:
    message = node_problem(tree, place) if place is not None else None
    if message:
        yield path, message


def _spring(tree: Tree, spring: object, path: KeyPath) -> Iterator[Finding]:
    ends = entries(spring, "between")
    for k, end in enumerate(ends):
        if isinstance(end, str) and not (k == 1 and end == "ground"):
            hint = "write the ground second" if end == "ground" else node_problem(tree, end)
            if hint:
                yield (*path, "between", k), hint
    if len(ends) == 2 and ends[0] == ends[1]:
        yield (*path, "between"), "both ends are the same node"
    if isinstance(spring, Mapping) and not {"translational", "rotational"} & set(spring):
        yield path, "a spring needs translational, rotational or both"


def _design(tree: Tree) -> Iterator[Finding]:
    owner: dict[str, str] = {}
    for name, body in parameters(tree):
        path = text(body, "parameter")
        if name.lower().startswith("constraint") and path is None:
            yield ("design", name), "did you mean the reserved key 'constraints'?"
        if path is not None and path in owner:
            message = f"{path} is a design parameter already: {owner[path]!r}"
            yield ("design", name, "parameter"), message
        owner.setdefault(path or "", name)
    known = dict(parameters(tree))
    for name in names(tree, "design", "constraints"):
        for term in names(tree, "design", "constraints", name, "terms"):
            if term not in known:
                message = unknown("design parameter", term, known)
                yield ("design", "constraints", name, "terms", term), message


def _expansion(tree: Tree) -> Iterator[Finding]:
    y = [name for name, _ in parameters(tree)]
    path: KeyPath = ("expansion", "y")
    yield from one_for_each(at(tree, *path), path, "design parameter", y)  # type: ignore[arg-type]
    seen: set[int] = set()
    for k, mode in enumerate(entries(tree, "expansion", "modes")):
        if not isinstance(mode, int):
            continue
        if mode in seen:
            yield ("expansion", "modes", k), f"mode {shown(mode)} is listed twice"
        seen.add(mode)


def _targets(tree: Tree) -> Iterator[Finding]:
    expanded = entries(tree, "expansion", "modes")
    known, seen = trajectory_names(tree), set[tuple[int, str]]()
    for k, target in enumerate(entries(tree, "targets")):
        mode, where = at(target, "mode"), text(target, "trajectory")
        path: KeyPath = ("targets", k, "mode")
        if where is not None and where not in known:
            yield ("targets", k, "trajectory"), unknown("trajectory", where, known)
            continue
        if not isinstance(mode, int) or mode < 1:
            continue
        held = {(mode, name) for name in ([where] if where else known or [""])}
        if both := sorted(name for _, name in held & seen):
            along = f" along trajectory {both[0]!r}" if len(known) > 1 else ""
            yield path, f"mode {mode} has a target already{along}"
        elif expanded and mode not in expanded:
            yield path, f"mode {mode} is not among expansion.modes: add it there, or leave it auto"
        seen |= held


# --- Planar and spatial: how many components vectors have, and which keys belong where

_AXES = {"planar": "x, y", "spatial": "x, y, z"}


def misfits(tree: Tree) -> Iterator[Finding]:
    """What does not fit the mechanism's space."""
    space = text(tree, "mechanism", "space")
    if space not in _AXES:
        return
    for path, vector in _vectors(tree):
        yield from _components(vector, path, space)
    for joint, body in items(tree, "mechanism", "joints"):
        yield from _joint(body, ("mechanism", "joints", joint), space)
    for name, spring in items(tree, "mechanism", "springs"):
        place: KeyPath = ("mechanism", "springs", name)
        yield from _turning(spring, place, space)
        yield from _spring_axes(spring, place, space)
    for path, body in trajectories(tree):
        yield from _turning(body, path, space)
    for name, coordinate in items(tree, "coordinates"):
        if space == "spatial" and at(coordinate, "angle") == "absolute":
            message = "an absolute angle is for planar mechanisms: in space angles are relative"
            yield ("coordinates", name, "angle"), message
    yield from _inertias(tree, space)


def _components(vector: object, path: KeyPath, space: str) -> Iterator[Finding]:
    n = 2 if space == "planar" else 3
    if isinstance(vector, tuple) and len(vector) != n:
        yield path, f"{space}: needs {n} components ({_AXES[space]}), got {len(vector)}"


def _vectors(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Every point and direction of the file."""
    for joint, body in items(tree, "mechanism", "joints"):
        path: KeyPath = ("mechanism", "joints", joint)
        yield (*path, "position"), at(body, "position")
        yield (*path, "axis"), at(body, "axis") if at(body, "type") != "revolute" else None
        for k, axis in enumerate(entries(body, "axes")):
            yield (*path, "axes", k), axis
    for link, body in items(tree, "mechanism", "links"):
        path = ("mechanism", "links", link)
        yield (*path, "center"), at(body, "center")
        for node, place in items(body, "nodes"):
            nested = at(place, "position")
            inner = (*path, "nodes", node, *(("position",) if nested is not None else ()))
            yield inner, place if nested is None else nested
    for name, body in items(tree, "mechanism", "bodies"):
        yield ("mechanism", "bodies", name, "offset"), at(body, "offset")
    for place, body in trajectories(tree):
        for k, point in enumerate(entries(body, "waypoints")):
            yield (*place, "waypoints", k), point


def _joint(joint: object, path: KeyPath, space: str) -> Iterator[Finding]:
    kind = text(joint, "type")
    if space == "planar" and kind in FREEDOMS and kind not in PLANAR:
        message = f"a {kind} joint is spatial; planar mechanisms have {listed(PLANAR)}"
        yield (*path, "type"), message
        return
    axis = at(joint, "axis")
    if space == "planar" and kind == "revolute" and axis is not None:
        yield (*path, "axis"), "a planar revolute joint turns about z: leave the axis out"
    if space == "spatial" and kind == "revolute":
        yield from _components(axis, (*path, "axis"), space)
    yield from _turning(joint, path, space)


def _turning(part: object, path: KeyPath, space: str) -> Iterator[Finding]:
    if space == "planar" and at(part, "orientation") is not None:
        yield (*path, "orientation"), "is for spatial mechanisms: in a plane write angle"
    if space == "spatial" and at(part, "angle") is not None:
        message = "is for planar mechanisms: in space write orientation: [rx, ry, rz]"
        yield (*path, "angle"), message


def _spring_axes(spring: object, path: KeyPath, space: str) -> Iterator[Finding]:
    yield from _components(at(spring, "translational"), (*path, "translational"), space)
    rotational = at(spring, "rotational")
    if space == "spatial":
        yield from _components(rotational, (*path, "rotational"), space)
    elif isinstance(rotational, tuple):
        yield (*path, "rotational"), "planar: one number, about z, got a list"


def _inertias(tree: Tree, space: str) -> Iterator[Finding]:
    for group in ("bodies", "links"):
        for name, body in items(tree, "mechanism", group):
            given, path = at(body, "inertia"), ("mechanism", group, name, "inertia")
            if space == "planar" and isinstance(given, tuple):
                yield path, "planar: one number, about the axis out of the plane, got a list"
            if space == "spatial" and isinstance(given, (int, float, str)) and given != 0:
                message = "spatial: needs [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]"
                yield path, message


# --- Whether wanted frequencies that change in time are given for the whole motion

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def uncovered(tree: Tree) -> Iterator[Finding]:
    """Targets whose profile does not reach both ends of the trajectory."""
    for k, target in enumerate(entries(tree, "targets")):
        span = _span(at(target, "frequency"))
        for which, motion in _motions(tree, text(target, "trajectory")):
            if span is None:
                continue
            slack = _SLACK * (motion[1] - motion[0])
            if span[0] > motion[0] + slack or span[1] < motion[1] - slack:
                yield (
                    ("targets", k, "frequency", "time"),
                    f"covers {span[0]:g} … {span[1]:g} s only; "
                    f"{which} lasts from {motion[0]:g} to {motion[1]:g} s",
                )


def _motions(tree: Tree, wanted: str | None) -> Iterator[tuple[str, tuple[float, float]]]:
    """What to call each trajectory that a target holds along, and its first and last time."""
    several = len(trajectories(tree)) > 1
    for name, (_, body) in zip(trajectory_names(tree), trajectories(tree), strict=True):
        span = _span_of_motion(body)
        if span is not None and wanted in (None, name):
            yield f"trajectory {name!r}" if several else "the trajectory", span


def _span_of_motion(trajectory: object) -> tuple[float, float] | None:
    for key in ("time", "times"):
        if at(trajectory, key) is not None:
            return _span(trajectory, key)
    default = TipTrajectory.model_fields["duration"].default
    tip = at(trajectory, "tip") is not None
    duration = _number(at(trajectory, "duration") or (default if tip else None), DURATION)
    return None if duration is None else (0.0, duration)


def _span(node: object, key: str = "time") -> tuple[float, float] | None:
    times = entries(node, key)
    if not times:
        return None
    first, last = _number(times[0], TIME), _number(times[-1], TIME)
    return None if first is None or last is None or last < first else (first, last)


def _number(value: object, quantity: Quantity) -> float | None:
    try:
        return quantity.read(value)
    except QuantityError:
        return None
