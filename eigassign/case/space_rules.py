"""Planar and spatial: how many components vectors have, and which keys belong where."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.freedoms import FREEDOMS, PLANAR
from eigassign.case.suggest import listed
from eigassign.case.tree import Tree, at, entries, items, text, trajectories
from eigassign.case.yaml_reader import Finding, KeyPath

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
