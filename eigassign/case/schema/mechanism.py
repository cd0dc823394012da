"""The `mechanism` and `coordinates` keys: bodies, springs, assembly, drives, and the whole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.schema.joints import Joint
from eigassign.case.schema.links import Link, Material, Section
from eigassign.case.schema.vectors import (
    Angle,
    Inertia,
    Orientation,
    Vector,
    check_inertia,
    one_or_list,
)
from eigassign.case.units import Frozen, FrozenDict, Part, Quantity, quantity

Q_VALUE = Quantity(elsewhere="angle (in rad when bare; or deg), or length, as its coordinate")
SPRING = quantity("stiffness", at_least=0)
TURNING_SPRING = quantity("rotational stiffness", at_least=0)


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

    @model_validator(mode="after")
    def _turns(self) -> Body:
        check_inertia(self.inertia)
        return self


Translational: TypeAlias = Annotated[
    Annotated[Annotated[float, SPRING], Tag("<one>")]
    | Annotated[tuple[Annotated[float, SPRING], ...], Tag("<list>")],
    Discriminator(one_or_list),
]
Rotational: TypeAlias = Annotated[
    Annotated[Annotated[float, TURNING_SPRING], Tag("<one>")]
    | Annotated[tuple[Annotated[float, TURNING_SPRING], ...], Tag("<list>")],
    Discriminator(one_or_list),
]


class Spring(Part):
    """A spring between two nodes, or a node and `ground`: N/m and N m/rad, per axis or for all.

    Its axes are those of the first node's link, turned by `angle` (planar) or `orientation`
    (spatial), rad.
    """

    between: tuple[str, str]
    translational: Translational = 0.0
    rotational: Rotational = 0.0
    angle: Angle = 0.0
    orientation: Orientation | None = None


class Assembly(Part):
    """Which way the loops are put together: guesses of passive joints, where `at` holds."""

    at: Annotated[Mapping[str, Annotated[float, Q_VALUE]], Frozen] = FrozenDict()
    guess: Annotated[
        Mapping[
            str,
            Annotated[
                Annotated[Annotated[float, Q_VALUE], Tag("<one>")]
                | Annotated[tuple[Annotated[float, Q_VALUE], ...], Tag("<list>")],
                Discriminator(one_or_list),
            ],
        ],
        Frozen,
    ] = FrozenDict()


class Drive(Part):
    """A joint held by a spring of the given stiffness: N m/rad, or N/m where it slides."""

    stiffness: Annotated[
        float, Quantity(above=0, elsewhere="stiffness (N m/rad, or N/m where the joint slides)")
    ]


def _drive_tag(value: object) -> str:
    return "<drive>" if isinstance(value, (Mapping, Drive)) else "<word>"


class Coordinate(Part):
    """One rigid coordinate q: its joint, which freedom of it, and how it is held.

    `component` is needed where the joint has several freedoms. `angle: absolute` counts a planar
    joint's angle from the x axis instead of from its base.
    """

    joint: str
    component: Literal[1, 2, 3, "rotation", "translation"] | None = None
    angle: Literal["relative", "absolute"] = "relative"
    drive: Annotated[
        Annotated[Literal["free", "locked"], Tag("<word>")] | Annotated[Drive, Tag("<drive>")],
        Discriminator(_drive_tag),
    ] = "free"


class Mechanism(Part):
    """Materials, sections, links, joints, bodies and springs by name, in the order of the file."""

    space: Literal["planar", "spatial"]
    materials: Annotated[Mapping[str, Material], Frozen] = FrozenDict()
    sections: Annotated[Mapping[str, Section], Frozen] = FrozenDict()
    links: Annotated[Mapping[str, Link], Field(min_length=1), Frozen]
    joints: Annotated[Mapping[str, Joint], Frozen]
    bodies: Annotated[Mapping[str, Body], Frozen] = FrozenDict()
    springs: Annotated[Mapping[str, Spring], Frozen] = FrozenDict()
    assembly: Assembly | None = None
