"""The keys `mechanism` and `coordinates`: joints, bodies, springs, assembly, drives, and the whole.

To add a type of joint: write its model, put it into the union `Joint` and its name into those of
`PLANAR`, `RIDING`, `SLIDING` and `ADVANCING` that it belongs to: in none, it is spatial and turns.
How it moves, `mechanism.kinematics.joints` says.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_args

from pydantic import ValidationInfo, field_validator, model_validator

from eigassign.case.reader import listed, shown
from eigassign.case.schema.links import Link, Material, Section
from eigassign.case.schema.parts import (
    IN_PLANE,
    IN_SPACE,
    PLACE,
    Angle,
    ByReference,
    Components,
    Direction,
    FrozenDict,
    Inertia,
    KindBy,
    Mistakes,
    Named,
    OneOrList,
    OneOrMoreNamed,
    Orientation,
    Part,
    Placed,
    Quantity,
    ShareOrRange,
    ValueOr,
    Vector,
    must,
    only_in,
    parallel,
    quantity,
    space_of,
    wrong,
)
from eigassign.case.units import DIMENSIONS


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

    type: str
    base: str
    follower: str
    position: Vector | None = None
    angle: Annotated[Angle, IN_PLANE] = 0.0
    orientation: Annotated[Orientation | None, IN_SPACE] = None

    @model_validator(mode="before")
    @classmethod
    def _belongs_to_the_space(cls, value: Any, info: ValidationInfo) -> Any:
        if space_of(info) == "planar" and value["type"] not in PLANAR:
            message = f"a {value['type']} joint is spatial; planar mechanisms have {listed(PLANAR)}"
            raise wrong(message, "type")
        return value


Lead: TypeAlias = Annotated[
    float, PLACE, must(bool, "must not be 0 m: a screw travels as it turns")
]


class RevoluteJoint(JointBase):
    """Turns about `axis`: z unless given, always z in a plane."""

    freedoms = ("rotation",)
    type: Literal["revolute"]
    axis: Annotated[
        Direction | None,
        only_in("spatial", "a planar revolute joint turns about z: leave the axis out"),
    ] = None


class PrismaticJoint(JointBase):
    """Slides along `axis`: x unless given."""

    freedoms = ("translation",)
    type: Literal["prismatic"]
    axis: Direction | None = None


class CylindricalJoint(JointBase):
    """Slides along and turns about `axis`: z unless given. Spatial only."""

    freedoms = ("translation", "rotation")
    type: Literal["cylindrical"]
    axis: Direction | None = None


class ScrewJoint(JointBase):
    """Turns about `axis`, z unless given, and slides along it as it turns. Spatial only.

    Keys:
        lead: how far it slides in a turn
    """

    freedoms = ("rotation",)
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

    def _mistakes(self, space: str | None) -> Mistakes:
        if parallel(*self.axes):
            yield wrong("the two axes are parallel: a universal joint's must cross", "axes")


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
    type: Literal["fixed"]


class CarriageJoint(JointBase):
    """Travels along a flexible beam; the coordinate is the distance from its `start`."""

    freedoms = ("translation",)
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
    KindBy("type"),
]
JOINTS: dict[str, type[JointBase]] = KindBy("type").kinds(get_args(Joint)[0])  # type: ignore[assignment]
FREEDOMS = {kind: model.freedoms for kind, model in JOINTS.items()}
RIDING = ("carriage", "nut")  # their base is a beam along which they move
SLIDING = ("prismatic", "cylindrical", "screw", *RIDING)  # they move along their axis
ADVANCING = ("screw", "nut")  # a full turn moves something on
PLANAR = ("revolute", "prismatic", "fixed", "carriage")  # planar mechanisms may have them


def freedom_of(kind: str, component: object) -> str:
    """Name of the freedom that a valid coordinate of a joint of this kind is."""
    return FREEDOMS[kind][0] if component is None else str(component)


_FAR = DIMENSIONS["angle"].largest  # rad, and m where the joint slides
Q_VALUE = Quantity(
    at_least=-_FAR,
    at_most=_FAR,
    elsewhere="rad or m when bare, as its joint turns or slides",
)
QValue: TypeAlias = Annotated[float, Q_VALUE]
Stiffness: TypeAlias = Annotated[float, quantity("stiffness", at_least=0)]
TurningStiffness: TypeAlias = Annotated[float, quantity("rotational stiffness", at_least=0)]


_Acceleration: TypeAlias = Annotated[
    Components[Annotated[float, quantity("acceleration")]],
    must(any, "pulls nowhere: write none to leave gravity out"),
]
_AboutAxes: TypeAlias = Annotated[
    Components[TurningStiffness],
    only_in("spatial", "planar: one number, about z, got a list"),
]


class Body(Placed):
    """A rigid body on a node.

    Keys:
        at: the node, `<link>.<node>`
        mass: of the body
        inertia: about its centre of mass, in the link's axes; one number in a plane, `[Ixx, Iyy,
            Izz]` or `[Ixx, Iyy, Izz, Ixy, Ixz, Iyz]` in space: the entries of the tensor, Ixy =
            −∫xy dm
        offset: from the node to the centre of mass, in the link's axes; none unless given
    """

    place = "offset"
    at: str
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Inertia = 0.0
    offset: Vector | None = None


class Spring(Placed):
    """A spring between two nodes, or a node and `ground`; the pose as written is free of stress.

    Where the two nodes are apart, the spring acts at the second: what it resists is the motion of
    that node against a rigid arm from the first.

    Keys:
        between: two nodes, `<link>.<node>`, or one and `ground`; its axes turn with the link of the
            first, or stay the ground's
        translational: one number for all axes, or one for each
        rotational: one number for all axes, or one for each
        angle: by which its axes are turned from those of the first, in a plane
        orientation: the same in space, `[rx, ry, rz]`, R = Rz Ry Rx
    """

    between: tuple[str, str]
    translational: OneOrList[Stiffness, Components[Stiffness]] = 0.0
    rotational: OneOrList[TurningStiffness, _AboutAxes] = 0.0
    angle: Annotated[Angle, IN_PLANE] = 0.0
    orientation: Annotated[Orientation | None, IN_SPACE] = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.between[0] == self.between[1]:
            yield wrong("both ends are the same node", "between")
        if not {"translational", "rotational"} & self.model_fields_set:
            yield wrong("a spring needs translational, rotational or both")


class Assembly(Part):
    """On which branch the loops are closed; not needed where they close in one way only.

    Keys:
        at: the coordinates for which the guess holds
        guess: values of passive joints; of a joint with several freedoms a list with one for each,
            or for those without a coordinate
    """

    at: ByReference[QValue] = FrozenDict()
    guess: ByReference[OneOrList[QValue, tuple[QValue, ...]]] = FrozenDict()


class Drive(Part):
    """A motor on a joint: a spring that holds it, and the inertia reflected through its gear.

    Both act on the joint's own motion, follower against base: the rotor swings with the joint, as
    behind a stiff gear that a position loop or a brake holds. How a rotor swings behind a gear
    that gives is in how-to/own-arm.md.

    Keys:
        stiffness: without it the joint is free
        inertia: J = J_m N² of a rotor J_m that turns N times as fast as the joint
        motor_inertia: J_m of the motor's data sheet, instead of `inertia`
        ratio: N of the gear; 1 unless given; of a joint that slides 2π over the lead
        loss_factor: η of its complex stiffness; or the least and the most, for responses
    """

    stiffness: (
        Annotated[
            float,
            Quantity(above=0, elsewhere="N m/rad or N/m when bare, as the joint turns or slides"),
        ]
        | None
    ) = None
    inertia: (
        Annotated[
            float,
            Quantity(at_least=0, elsewhere="kg m2 or kg when bare, as the joint turns or slides"),
        ]
        | None
    ) = None
    motor_inertia: Annotated[float, quantity("rotary inertia", at_least=0)] | None = None
    ratio: (
        Annotated[float, Quantity(above=0, elsewhere="a number, or rad/m where the joint slides")]
        | None
    ) = None

    loss_factor: ShareOrRange | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.loss_factor is not None and self.stiffness is None:
            yield wrong("has no effect without a stiffness", "loss_factor")
        if self.inertia is not None and self.motor_inertia is not None:
            message = "is reflected through the gear to motor_inertia ratio²: give it or inertia"
            yield wrong(f"{message}, not both", "motor_inertia")
        if self.ratio is not None and self.motor_inertia is None:
            message = "has no effect without motor_inertia: give the motor's inertia J_m"
            yield wrong(f"{message}; inertia is J_m ratio² already", "ratio")
        if self.stiffness is None and self.inertia is None and self.motor_inertia is None:
            yield wrong("a drive needs stiffness, inertia or both; else write free or locked")


class Coordinate(Part):
    """One coordinate of q: its joint, which freedom of it, and how it is held.

    Keys:
        joint: name of the joint; without loops each freedom has exactly one coordinate
        component: which freedom of a joint with several: `translation` or `rotation` of a
            cylindrical joint, 1 or 2 of a universal, 1, 2 or 3 of a spherical joint
        angle: `relative` to the base link, or `absolute`, from the x axis (planar revolute joints;
            the `angle` of the joint then has no effect)
        drive: moves freely, not at all, or against a motor
    """

    joint: str
    component: Literal[1, 2, 3, "rotation", "translation"] | None = None
    angle: Annotated[
        Literal["relative", "absolute"],
        only_in(
            "planar",
            "an absolute angle is for planar mechanisms: in space angles are relative",
            neutral="relative",
        ),
    ] = "relative"
    drive: ValueOr[Literal["free", "locked"], Drive] = "free"

    @field_validator("component", mode="before")
    @classmethod
    def _is_no_truth(cls, value: object) -> object:
        if isinstance(value, bool):
            raise wrong(f"expected 1, 2, 3, 'rotation' or 'translation', got {shown(value)}")
        return value

    @property
    def moves(self) -> Literal["free", "held", "locked"]:
        """Its way to move: freely, against the drive's stiffness, or not at all."""
        if isinstance(self.drive, str):
            return self.drive
        return "free" if self.drive.stiffness is None else "held"


class Mechanism(Part):
    """Materials, sections, links, joints, bodies and springs by name, in the order of the file.

    Keys:
        space: `planar`: vectors are `[x, y]`, parts are turned by `angle`; `spatial`: `[x, y, z]`,
            and `orientation`
        gravity: the acceleration of a fall, in the axes of the ground; or `none`: left out on
            purpose
        materials: of beams and solids
        sections: cross-sections of beams
        links: beams, rigid bodies, frames of beams, and parts given by matrices or meshes
        joints: of links with each other and with the ground
        bodies: rigid bodies on nodes
        springs: between nodes, and to the ground
        assembly: on which branch the loops are closed
    """

    space: Literal["planar", "spatial"]
    gravity: OneOrList[Literal["none"], _Acceleration] | None = None
    materials: Named[Material] = FrozenDict()
    sections: Named[Section] = FrozenDict()
    links: OneOrMoreNamed[Link]
    joints: Named[Joint]
    bodies: Named[Body] = FrozenDict()
    springs: Named[Spring] = FrozenDict()
    assembly: Assembly | None = None
