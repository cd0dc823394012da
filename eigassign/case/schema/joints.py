"""The key `joints` of a mechanism: what each type needs, and what it lets move.

To add a type of joint: write its model and put it into the union `Joint`. How it moves,
`mechanism.kinematics.joints` says.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import ValidationInfo, model_validator

from eigassign.case.schema.parts import (
    IN_PLANE,
    IN_SPACE,
    PLACE,
    Angle,
    Direction,
    KindBy,
    Orientation,
    Placed,
    Vector,
    kinds,
    must,
    only_in,
    parallel,
    space_of,
    wrong,
)
from eigassign.case.suggestions import listed


class JointBase(Placed):
    """What all joints have: where they are and how they are turned.

    Keys:
        base: what carries the joint, `ground` or `<link>.<node>`; of a carriage or nut the beam,
            `<link>`, which carries only one
        follower: what it carries, `<link>.<node>`
        position: of the joint relative to the base's node, in the axes of the base; at the node
            unless given
        angle: by which the follower is turned where the coordinate is 0, in a plane
        orientation: the same in space, `[rx, ry, rz]`, R = Rz Ry Rx
        axis: in the axes of the follower where the coordinate is 0
    """

    place = "position"
    freedoms: ClassVar[tuple[str, ...]]  # names of its coordinates: what `component` may be
    planar: ClassVar[bool] = False  # whether planar mechanisms may have it
    travels: ClassVar[bool] = False  # whether its base is a beam along which it moves
    slides: ClassVar[bool] = False  # whether it moves along its axis
    advances: ClassVar[bool] = False  # whether a full turn moves something on

    type: str
    base: str
    follower: str
    position: Vector | None = None
    angle: Annotated[Angle, IN_PLANE] = 0.0
    orientation: Annotated[Orientation | None, IN_SPACE] = None

    @model_validator(mode="before")
    @classmethod
    def _belongs_to_the_space(cls, value: Any, info: ValidationInfo) -> Any:
        if space_of(info) == "planar" and not cls.planar:
            message = f"a {value['type']} joint is spatial; planar mechanisms have {listed(PLANAR)}"
            raise wrong(message, "type")
        return value


Lead: TypeAlias = Annotated[
    float, PLACE, must(bool, "must not be 0 m: a screw travels as it turns")
]


class RevoluteJoint(JointBase):
    """Turns about `axis`: z unless given, always z in a plane."""

    freedoms = ("rotation",)
    planar = True
    type: Literal["revolute"]
    axis: Annotated[
        Direction | None,
        only_in("spatial", "a planar revolute joint turns about z: leave the axis out"),
    ] = None


class PrismaticJoint(JointBase):
    """Slides along `axis`: x unless given."""

    freedoms = ("translation",)
    planar = True
    slides = True
    type: Literal["prismatic"]
    axis: Direction | None = None


class CylindricalJoint(JointBase):
    """Slides along and turns about `axis`: z unless given. Spatial only."""

    freedoms = ("translation", "rotation")
    slides = True
    type: Literal["cylindrical"]
    axis: Direction | None = None


class ScrewJoint(JointBase):
    """Turns about `axis`, z unless given, and slides along it as it turns. Spatial only.

    Keys:
        lead: how far it slides in a turn
    """

    freedoms = ("rotation",)
    slides = True
    advances = True
    type: Literal["screw"]
    axis: Direction | None = None
    lead: Lead


class UniversalJoint(JointBase):
    """Turns about one axis, then about a second, which the first carries. Spatial only.

    Keys:
        axes: the two
    """

    freedoms = ("1", "2")
    type: Literal["universal"]
    axes: tuple[Direction, Direction]

    @model_validator(mode="after")
    def _axes_cross(self) -> Self:
        if parallel(*self.axes):
            raise wrong("the two axes are parallel: a universal joint's must cross", "axes")
        return self


class SphericalJoint(JointBase):
    """Turns in any way: its freedoms are turns about x, then y, then z. Spatial only.

    R = Rx(c₁) Ry(c₂) Rz(c₃); a guess lists these angles. At c₂ = ±90 deg the first and the third
    turn alike: free coordinates cannot be told apart there.
    """

    freedoms = ("1", "2", "3")
    type: Literal["spherical"]


class FixedJoint(JointBase):
    """Clamps `follower` to `base`."""

    freedoms = ()
    planar = True
    type: Literal["fixed"]


class CarriageJoint(JointBase):
    """Travels along a flexible beam; the coordinate is the distance from its `start`."""

    freedoms = ("translation",)
    planar = True
    travels = True
    slides = True
    type: Literal["carriage"]


class NutJoint(JointBase):
    """Travels along a flexible screw shaft and turns against it once per lead. Spatial only.

    The coordinate s is the distance from the shaft's `start`. There its axes are those of the
    shaft, turned about the shaft's x axis by 2π s/`lead`, and then by `orientation`. It stands on
    the shaft's axis.

    Keys:
        lead: how far it travels in a turn
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
