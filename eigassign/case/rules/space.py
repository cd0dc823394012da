"""Planar and spatial: how many components vectors have, and which keys belong where.

The rules are silent where the mechanism does not say in which space it is.
"""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, text
from eigassign.case.rules.lookups import beams, is_planar, is_spatial, number, trajectories
from eigassign.case.schema.joints import FREEDOMS, PLANAR
from eigassign.case.schema.vectors import ANGLE
from eigassign.case.suggestions import listed


def vectors_have_as_many_components_as_the_space(tree: Tree) -> Iterator[Finding]:
    """Two in a plane, three in space: points, directions, and springs given axis by axis."""
    space = text(tree, "mechanism", "space")
    axes = {"planar": "x, y", "spatial": "x, y, z"}.get(space or "", "")
    n = len(axes.split())
    for path, vector in _vectors(tree) if axes else ():
        if isinstance(vector, tuple) and len(vector) != n:
            yield path, f"{space}: needs {n} components ({axes}), got {len(vector)}"


def _vectors(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Everything in the file that has a component along each axis."""
    for name, body in items(tree, "mechanism", "joints"):
        path: KeyPath = ("mechanism", "joints", name)
        yield (*path, "position"), at(body, "position")
        if not (is_planar(tree) and text(body, "type") == "revolute"):  # no axis at all is wanted
            yield (*path, "axis"), at(body, "axis")
        for k, axis in enumerate(entries(body, "axes")):
            yield (*path, "axes", k), axis
    for name, body in items(tree, "mechanism", "links"):
        path = ("mechanism", "links", name)
        yield (*path, "center"), at(body, "center")
        for node, place in items(body, "nodes"):
            position = at(place, "position")
            inner = (*path, "nodes", node)
            yield ((*inner, "position"), position) if position is not None else (inner, place)
    for name, body in items(tree, "mechanism", "bodies"):
        yield ("mechanism", "bodies", name, "offset"), at(body, "offset")
    for name, body in items(tree, "mechanism", "springs"):
        path = ("mechanism", "springs", name)
        yield (*path, "translational"), at(body, "translational")
        if is_spatial(tree):
            yield (*path, "rotational"), at(body, "rotational")
    for path, body in trajectories(tree):
        for k, point in enumerate(entries(body, "waypoints")):
            yield (*path, "waypoints", k), point


def keys_belong_to_a_planar_mechanism(tree: Tree) -> Iterator[Finding]:
    """In a plane all turn about z: one angle, one inertia, one stiffness, and no axis."""
    if not is_planar(tree):
        return
    for name, body in items(tree, "mechanism", "joints"):
        kind, path = text(body, "type"), ("mechanism", "joints", name)
        if kind in FREEDOMS and kind not in PLANAR:
            message = f"a {kind} joint is spatial; planar mechanisms have {listed(PLANAR)}"
            yield (*path, "type"), message
            continue
        if kind == "revolute" and at(body, "axis") is not None:
            yield (*path, "axis"), "a planar revolute joint turns about z: leave the axis out"
        yield from _not_to_be_given(body, path, "orientation", _ANGLE)
    for name, body in items(tree, "mechanism", "springs"):
        path = ("mechanism", "springs", name)
        yield from _not_to_be_given(body, path, "orientation", _ANGLE)
        if isinstance(at(body, "rotational"), tuple):
            yield (*path, "rotational"), "planar: one number, about z, got a list"
    for place, body in trajectories(tree):
        yield from _not_to_be_given(body, place, "orientation", _ANGLE)
    for place, inertia in _inertias(tree):
        if isinstance(inertia, tuple):
            yield place, "planar: one number, about the axis out of the plane, got a list"
    for place, beam in beams(tree):
        if number(at(beam, "roll"), ANGLE):
            message = "is for spatial mechanisms: in a plane height lies in it, and width does not"
            yield (*place, "roll"), message


def keys_belong_to_a_spatial_mechanism(tree: Tree) -> Iterator[Finding]:
    """In space a turn takes three angles, an inertia a tensor, and angles are relative."""
    if not is_spatial(tree):
        return
    for group in ("joints", "springs"):
        for name, body in items(tree, "mechanism", group):
            yield from _not_to_be_given(body, ("mechanism", group, name), "angle", _ORIENTATION)
    for path, body in trajectories(tree):
        yield from _not_to_be_given(body, path, "angle", _ORIENTATION)
    for name, coordinate in items(tree, "coordinates"):
        if at(coordinate, "angle") == "absolute":
            message = "an absolute angle is for planar mechanisms: in space angles are relative"
            yield ("coordinates", name, "angle"), message
    for path, inertia in _inertias(tree):
        if isinstance(inertia, (int, float, str)) and inertia != 0:
            yield path, "spatial: needs [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]"


_ANGLE = "is for spatial mechanisms: in a plane write angle"
_ORIENTATION = "is for planar mechanisms: in space write orientation: [rx, ry, rz]"


def _not_to_be_given(part: object, path: KeyPath, key: str, message: str) -> Iterator[Finding]:
    if at(part, key) is not None:
        yield (*path, key), message


def _inertias(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    for group in ("bodies", "links"):
        for name, body in items(tree, "mechanism", group):
            yield ("mechanism", group, name, "inertia"), at(body, "inertia")
