"""The key `joints` of a mechanism: what each type needs, and what it lets move.

To add a type of joint: write its model and put it into the union `Joint`. How it moves,
`mechanism.kinematics.joints` says.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import AfterValidator, model_validator

from eigassign.case.schema.parts import KindBy, Part, kinds, wrong
from eigassign.case.schema.vectors import PLACE, Angle, Direction, Orientation, Vector, parallel


class JointBase(Part):
    """What all joints have: where they are and how they are turned.

    `base` (`ground` or `<link>.<node>`) carries `follower` (`<link>.<node>`). The joint stands at
    `position` (m) in the axes of the base; the follower's zero position is turned by `angle` (rad,
    planar) or `orientation` ([rx, ry, rz] in rad, R = Rz Ry Rx, spatial).
    """

    freedoms: ClassVar[tuple[str, ...]]  # names of its coordinates: what `component` may be
    planar: ClassVar[bool] = False  # whether planar mechanisms may have it
    travels: ClassVar[bool] = False  # whether its base is a beam along which it moves
    slides: ClassVar[bool] = False  # whether it moves along its axis
    advances: ClassVar[bool] = False  # whether a full turn moves something on

    type: str
    base: str
    follower: str
    position: Vector | None = None
    angle: Angle = 0.0
    orientation: Orientation | None = None


def _travels(lead: float) -> float:
    if lead == 0:
        raise wrong("must not be 0 m: a screw travels as it turns")
    return lead


Lead: TypeAlias = Annotated[float, PLACE, AfterValidator(_travels)]


class RevoluteJoint(JointBase):
    """Free to turn about `axis` (z unless given; always z in a plane)."""

    freedoms = ("rotation",)
    planar = True
    type: Literal["revolute"]
    axis: Direction | None = None


class PrismaticJoint(JointBase):
    """Free to slide along `axis` (x unless given)."""

    freedoms = ("translation",)
    planar = True
    slides = True
    type: Literal["prismatic"]
    axis: Direction | None = None


class CylindricalJoint(JointBase):
    """Free to slide along and turn about `axis` (z unless given)."""

    freedoms = ("translation", "rotation")
    slides = True
    type: Literal["cylindrical"]
    axis: Direction | None = None


class ScrewJoint(JointBase):
    """Turns about `axis` (z unless given) and slides along it by `lead` (m) a turn."""

    freedoms = ("rotation",)
    slides = True
    advances = True
    type: Literal["screw"]
    axis: Direction | None = None
    lead: Lead


class UniversalJoint(JointBase):
    """Turns about the first of two `axes`, then about the second, which the first carries."""

    freedoms = ("1", "2")
    type: Literal["universal"]
    axes: tuple[Direction, Direction]

    @model_validator(mode="after")
    def _axes_cross(self) -> Self:
        if parallel(*self.axes):
            raise wrong("the two axes are parallel: a universal joint's must cross", "axes")
        return self


class SphericalJoint(JointBase):
    """Free to turn in any way: successive rotations about x, y, z are its three components."""

    freedoms = ("1", "2", "3")
    type: Literal["spherical"]


class FixedJoint(JointBase):
    """Clamps `follower` to `base`."""

    freedoms = ()
    planar = True
    type: Literal["fixed"]


class CarriageJoint(JointBase):
    """Rides along a flexible beam, `base: <link>`; its coordinate is the distance from `start`."""

    freedoms = ("translation",)
    planar = True
    travels = True
    slides = True
    type: Literal["carriage"]


class NutJoint(JointBase):
    """A nut on a flexible screw shaft, `base: <link>`: turns once against it per `lead` (m).

    Its coordinate is the distance (m) from the shaft's `start`.
    """

    freedoms = ("translation",)
    travels = True
    slides = True
    advances = True
    type: Literal["nut"]
    lead: Lead


Joint: TypeAlias = Annotated[
    RevoluteJoint
    | PrismaticJoint
    | CylindricalJoint
    | ScrewJoint
    | UniversalJoint
    | SphericalJoint
    | FixedJoint
    | CarriageJoint
    | NutJoint,
    KindBy("type", "joint"),
]
JOINTS: dict[str, type[JointBase]] = kinds(Joint)  # type: ignore[assignment]
FREEDOMS = {kind: model.freedoms for kind, model in JOINTS.items()}
RIDING = tuple(kind for kind, model in JOINTS.items() if model.travels)
SLIDING = tuple(kind for kind, model in JOINTS.items() if model.slides)
ADVANCING = tuple(kind for kind, model in JOINTS.items() if model.advances)
PLANAR = tuple(kind for kind, model in JOINTS.items() if model.planar)


def freedom_of(kind: str, component: object) -> str:
    """Name of the freedom that a valid coordinate of a joint of this kind is."""
    return FREEDOMS[kind][0] if component is None else str(component)
