"""The key `joints` of a mechanism.

What each kind of joint lets move, and what quantity a coordinate therefore is.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Tag, model_validator

from eigassign.case.reader import Tree, at, items, text
from eigassign.case.schema.links import given
from eigassign.case.schema.vectors import (
    ANGLE,
    PLACE,
    Angle,
    Direction,
    Orientation,
    Vector,
    parallel,
)
from eigassign.case.units import Part, Quantity, wrong

# --- The key `joints` of a mechanism


class JointBase(Part):
    """What all joints have: where they are and how they are turned.

    `base` (`ground` or `<link>.<node>`) carries `follower` (`<link>.<node>`). The joint stands at
    `position` (m) in the axes of the base; the follower's zero position is turned by `angle` (rad,
    planar) or `orientation` ([rx, ry, rz] in rad, R = Rz Ry Rx, spatial).
    """

    type: str
    base: str
    follower: str
    position: Vector | None = None
    angle: Angle = 0.0
    orientation: Orientation | None = None


class _AxisJoint(JointBase):
    axis: Direction | None = None

    @model_validator(mode="after")
    def _points_somewhere(self) -> _AxisJoint:
        if self.axis is not None and not any(self.axis):
            raise wrong("has no direction: all components are zero", "axis")
        return self


def _check_lead(lead: float) -> None:
    if lead == 0:
        raise wrong("must not be 0 m: a screw travels as it turns", "lead")


class RevoluteJoint(_AxisJoint):
    """Free to turn about `axis` (z unless given; always z in a plane)."""

    type: Literal["revolute"]


class PrismaticJoint(_AxisJoint):
    """Free to slide along `axis` (x unless given)."""

    type: Literal["prismatic"]


class CylindricalJoint(_AxisJoint):
    """Free to slide along and turn about `axis` (z unless given)."""

    type: Literal["cylindrical"]


class ScrewJoint(_AxisJoint):
    """Turns about `axis` (z unless given) and slides along it by `lead` (m) a turn."""

    type: Literal["screw"]
    lead: Annotated[float, PLACE]

    @model_validator(mode="after")
    def _travels(self) -> ScrewJoint:
        _check_lead(self.lead)
        return self


class UniversalJoint(JointBase):
    """Turns about the first of two `axes`, then about the second, which the first carries."""

    type: Literal["universal"]
    axes: tuple[Direction, Direction]

    @model_validator(mode="after")
    def _has_two_axes(self) -> UniversalJoint:
        for k, axis in enumerate(self.axes):
            if not any(axis):
                raise wrong("has no direction: all components are zero", "axes", k)
        if parallel(*self.axes):
            raise wrong("the two axes are parallel: a universal joint's must cross", "axes")
        return self


class SphericalJoint(JointBase):
    """Free to turn in any way: successive rotations about x, y, z are its three components."""

    type: Literal["spherical"]


class FixedJoint(JointBase):
    """Clamps `follower` to `base`."""

    type: Literal["fixed"]


class CarriageJoint(JointBase):
    """Rides along a flexible beam, `base: <link>`; its coordinate is the distance from `start`."""

    type: Literal["carriage"]


class NutJoint(JointBase):
    """A nut on a flexible screw shaft, `base: <link>`: turns once against it per `lead` (m).

    Its coordinate is the distance (m) from the shaft's `start`.
    """

    type: Literal["nut"]
    lead: Annotated[float, PLACE]

    @model_validator(mode="after")
    def _travels(self) -> NutJoint:
        _check_lead(self.lead)
        return self


JOINTS: dict[str, type[Part]] = {
    "revolute": RevoluteJoint,
    "prismatic": PrismaticJoint,
    "cylindrical": CylindricalJoint,
    "screw": ScrewJoint,
    "universal": UniversalJoint,
    "spherical": SphericalJoint,
    "fixed": FixedJoint,
    "carriage": CarriageJoint,
    "nut": NutJoint,
}


def _joint_tag(value: object) -> str | None:
    kind = given(value, "type")
    return f"<{kind}>" if isinstance(kind, str) and kind in JOINTS else None


Joint: TypeAlias = Annotated[
    Annotated[RevoluteJoint, Tag("<revolute>")]
    | Annotated[PrismaticJoint, Tag("<prismatic>")]
    | Annotated[CylindricalJoint, Tag("<cylindrical>")]
    | Annotated[ScrewJoint, Tag("<screw>")]
    | Annotated[UniversalJoint, Tag("<universal>")]
    | Annotated[SphericalJoint, Tag("<spherical>")]
    | Annotated[FixedJoint, Tag("<fixed>")]
    | Annotated[CarriageJoint, Tag("<carriage>")]
    | Annotated[NutJoint, Tag("<nut>")],
    Discriminator(_joint_tag, custom_error_type="choice:joint", custom_error_message="type"),
]


# --- What each kind of joint lets move, and what quantity a coordinate therefore is

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
