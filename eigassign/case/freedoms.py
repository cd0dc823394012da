"""What each kind of joint lets move, and what quantity a coordinate therefore is."""

from __future__ import annotations

from eigassign.case.quantity import Quantity
from eigassign.case.tree import Tree, at, items, text
from eigassign.case.vectors import ANGLE, PLACE

FREEDOMS: dict[str, tuple[str, ...]] = {
    "fixed": (),
    "revolute": ("rotation",),
    "prismatic": ("translation",),
    "carriage": ("translation",),
    "nut": ("translation",),
    "screw": ("rotation",),
    "cylindrical": ("translation", "rotation"),
    "universal": ("1", "2"),
    "spherical": ("1", "2", "3"),
}
RIDING = ("carriage", "nut")  # their base is a beam along which they travel
PLANAR = ("revolute", "prismatic", "fixed", "carriage")
ANY = Quantity()  # dimension unknown because of an error elsewhere


def freedoms(tree: Tree, joint: str) -> tuple[str, ...] | None:
    """Names of a joint's freedoms, in order; None if the joint or its type is unknown."""
    return FREEDOMS.get(text(tree, "mechanism", "joints", joint, "type") or "")


def driven(tree: Tree, coordinate: object) -> str | None:
    """Which freedom of its joint a coordinate is; None where that cannot be told."""
    known = freedoms(tree, text(coordinate, "joint") or "")
    component = at(coordinate, "component")
    if not known or isinstance(component, bool):
        return None
    if component is None:
        return known[0] if len(known) == 1 else None
    return str(component) if str(component) in known else None


def of_freedom(freedom: str | None) -> Quantity:
    """Angle or length; anything where the freedom is unknown."""
    if freedom is None:
        return ANY
    return PLACE if freedom == "translation" else ANGLE


def freedom_of(kind: str, component: object) -> str:
    """Name of the freedom that a valid coordinate of a joint of this kind is."""
    return FREEDOMS[kind][0] if component is None else str(component)


def coordinate_quantities(tree: Tree) -> list[Quantity]:
    """What each coordinate is, in the order of q."""
    return [of_freedom(driven(tree, body)) for _, body in items(tree, "coordinates")]
