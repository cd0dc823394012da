"""The `mechanism` and `coordinates` keys: bodies, springs, assembly, drives, and the whole."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from eigassign.case.schema.joints import Joint
from eigassign.case.schema.links import Link
from eigassign.case.schema.parts import (
    ByReference,
    FrozenDict,
    Named,
    OneOrList,
    OneOrMoreNamed,
    Part,
    Quantity,
    ValueOr,
    quantity,
)
from eigassign.case.schema.sections import Material, Section
from eigassign.case.schema.vectors import Angle, Inertia, Orientation, Vector

Q_VALUE = Quantity(elsewhere="angle (in rad when bare; or deg), or length, as its coordinate")
QValue: TypeAlias = Annotated[float, Q_VALUE]
Stiffness: TypeAlias = Annotated[float, quantity("stiffness", at_least=0)]
TurningStiffness: TypeAlias = Annotated[float, quantity("rotational stiffness", at_least=0)]


class Body(Part):
    """A rigid body on a node: mass in kg, inertia in kg m2 about its centre of mass.

    `offset` (m) runs from the node to the centre of mass, in the link's axes. The inertia is one
    number in a plane, [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in space: entries of the
    tensor in the link's axes, Ixy = −∫xy dm.
    """

    at: str
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Inertia = 0.0
    offset: Vector | None = None


class Spring(Part):
    """A spring between two nodes, or a node and `ground`: N/m and N m/rad, per axis or for all.

    Its axes are those of the first node's link, turned by `angle` (planar) or `orientation`
    (spatial), rad.
    """

    between: tuple[str, str]
    translational: OneOrList[Stiffness, tuple[Stiffness, ...]] = 0.0
    rotational: OneOrList[TurningStiffness, tuple[TurningStiffness, ...]] = 0.0
    angle: Angle = 0.0
    orientation: Orientation | None = None


class Assembly(Part):
    """Which way the loops are put together: guesses of passive joints, where `at` holds."""

    at: ByReference[QValue] = FrozenDict()
    guess: ByReference[OneOrList[QValue, tuple[QValue, ...]]] = FrozenDict()


class Drive(Part):
    """A joint held by a spring of the given stiffness: N m/rad, or N/m where it slides."""

    stiffness: Annotated[
        float, Quantity(above=0, elsewhere="stiffness (N m/rad, or N/m where the joint slides)")
    ]


class Coordinate(Part):
    """One rigid coordinate q: its joint, which freedom of it, and how it is held.

    `component` is needed where the joint has several freedoms. `angle: absolute` counts a planar
    joint's angle from the x axis instead of from its base.
    """

    joint: str
    component: Literal[1, 2, 3, "rotation", "translation"] | None = None
    angle: Literal["relative", "absolute"] = "relative"
    drive: ValueOr[Literal["free", "locked"], Drive] = "free"


class Mechanism(Part):
    """Materials, sections, links, joints, bodies and springs by name, in the order of the file."""

    space: Literal["planar", "spatial"]
    materials: Named[Material] = FrozenDict()
    sections: Named[Section] = FrozenDict()
    links: OneOrMoreNamed[Link]
    joints: Named[Joint]
    bodies: Named[Body] = FrozenDict()
    springs: Named[Spring] = FrozenDict()
    assembly: Assembly | None = None
