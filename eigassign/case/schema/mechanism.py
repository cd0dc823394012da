"""The `mechanism` and `coordinates` keys: bodies, springs, assembly, drives, and the whole."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeAlias

from pydantic import model_validator

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
    wrong,
)
from eigassign.case.schema.sections import Material, Section
from eigassign.case.schema.vectors import Angle, Inertia, Orientation, Vector
from eigassign.case.units import DIMENSIONS

_FAR = DIMENSIONS["angle"].largest  # rad, and m where the joint slides
Q_VALUE = Quantity(
    at_least=-_FAR,
    at_most=_FAR,
    elsewhere="angle (in rad when bare; or deg), or length, as its coordinate",
)
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
    """A motor on a joint: a spring that holds it, and the inertia reflected through its gear.

    Both act on the joint's own motion, follower against base: N m/rad and kg m2, or N/m and kg
    where it slides. Without a stiffness the joint is free.
    """

    stiffness: (
        Annotated[
            float, Quantity(above=0, elsewhere="stiffness (N m/rad, or N/m where the joint slides)")
        ]
        | None
    ) = None
    inertia: (
        Annotated[
            float, Quantity(at_least=0, elsewhere="inertia (kg m2, or kg where the joint slides)")
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _acts(self) -> Self:
        if self.stiffness is None and self.inertia is None:
            raise wrong("a drive needs stiffness, inertia or both; else write free or locked")
        return self


class Coordinate(Part):
    """One rigid coordinate q: its joint, which freedom of it, and how it is held.

    `component` is needed where the joint has several freedoms. `angle: absolute` counts a planar
    joint's angle from the x axis instead of from its base.
    """

    joint: str
    component: Literal[1, 2, 3, "rotation", "translation"] | None = None
    angle: Literal["relative", "absolute"] = "relative"
    drive: ValueOr[Literal["free", "locked"], Drive] = "free"

    @property
    def moves(self) -> Literal["free", "held", "locked"]:
        """Whether it moves freely, against the drive's stiffness, or not at all."""
        if isinstance(self.drive, str):
            return self.drive
        return "free" if self.drive.stiffness is None else "held"


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
