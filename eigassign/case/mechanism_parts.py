"""The `mechanism` and `coordinates` keys: materials, sections, links, joints, bodies, drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.quantity import Frozen, FrozenDict, Part, quantity, wrong

LENGTH = quantity("length", above=0)
ANGLE = quantity("angle")
PLACE = quantity("length")
Point: TypeAlias = tuple[Annotated[float, PLACE], Annotated[float, PLACE]]


class Material(Part):
    """Linear elastic, homogeneous: Young's modulus in Pa, density in kg/m3."""

    youngs_modulus: Annotated[float, quantity("pressure or modulus", above=0)]
    density: Annotated[float, quantity("density", at_least=0)]


class BareSection(Part):
    """Area in m2 and second moment of area in m4 (about the axis normal to the plane), as given."""

    shape: Literal["bare"] = "bare"
    area: Annotated[float, quantity("area", above=0)]
    bending_inertia: Annotated[float, quantity("second moment of area", above=0)]


class CircleSection(Part):
    """Solid round bar; diameter in m."""

    shape: Literal["circle"]
    diameter: Annotated[float, LENGTH]


class TubeSection(Part):
    """Round tube; outer diameter and either inner diameter or wall thickness, in m."""

    shape: Literal["tube"]
    outer_diameter: Annotated[float, LENGTH]
    inner_diameter: Annotated[float, LENGTH] | None = None
    thickness: Annotated[float, LENGTH] | None = None

    @model_validator(mode="after")
    def _is_a_tube(self) -> TubeSection:
        if (self.inner_diameter is None) == (self.thickness is None):
            raise wrong("a tube needs either inner_diameter or thickness, and not both")
        if self.inner_diameter is not None and self.inner_diameter >= self.outer_diameter:
            raise wrong("must be smaller than outer_diameter", "inner_diameter")
        if self.thickness is not None and 2 * self.thickness > self.outer_diameter:
            raise wrong("must be at most half of outer_diameter", "thickness")
        return self


class RectangleSection(Part):
    """Solid rectangle, in m; `height` lies in the plane of motion: I = width height³ / 12."""

    shape: Literal["rectangle"]
    width: Annotated[float, LENGTH]
    height: Annotated[float, LENGTH]


SHAPES: dict[str, type[Part]] = {
    "bare": BareSection,
    "circle": CircleSection,
    "tube": TubeSection,
    "rectangle": RectangleSection,
}


def given(value: object, key: str, default: object = None) -> object:
    """``value[key]`` of a mapping as read, or the attribute of an object built in Python."""
    return value.get(key, default) if isinstance(value, Mapping) else getattr(value, key, default)


def _shape_tag(value: object) -> str | None:
    shape = given(value, "shape", "bare")
    return f"<{shape}>" if isinstance(shape, str) and shape in SHAPES else None


Section: TypeAlias = Annotated[
    Annotated[BareSection, Tag("<bare>")]
    | Annotated[CircleSection, Tag("<circle>")]
    | Annotated[TubeSection, Tag("<tube>")]
    | Annotated[RectangleSection, Tag("<rectangle>")],
    Discriminator(_shape_tag, custom_error_type="choice:shape", custom_error_message="shape"),
]


class Link(Part):
    """A straight flexible link: length in m, its material and section by name, its elements."""

    length: Annotated[float, LENGTH]
    material: str
    section: str
    elements: Annotated[int, Field(ge=1, le=100_000)]


class _JointBase(Part):
    type: Literal["revolute", "fixed"]
    base: str
    follower: str
    angle: Annotated[float, ANGLE] = 0.0
    position: Point = (0.0, 0.0)


class RevoluteJoint(_JointBase):
    """Joins `follower` (`<link>.start`) to `base` (`ground` or a link's end), free to rotate.

    `angle` (rad) is added to the coordinate's zero; `position` (m) is the joint's place on ground.
    """

    type: Literal["revolute"]


class FixedJoint(_JointBase):
    """Clamps `follower` to `base` at `angle` (rad) from the base's direction."""

    type: Literal["fixed"]


JOINTS: dict[str, type[Part]] = {"revolute": RevoluteJoint, "fixed": FixedJoint}


def _joint_tag(value: object) -> str | None:
    kind = given(value, "type")
    return f"<{kind}>" if isinstance(kind, str) and kind in JOINTS else None


Joint: TypeAlias = Annotated[
    Annotated[RevoluteJoint, Tag("<revolute>")] | Annotated[FixedJoint, Tag("<fixed>")],
    Discriminator(_joint_tag, custom_error_type="choice:type", custom_error_message="type"),
]


class Body(Part):
    """A rigid body at a link's end: mass in kg, inertia about its own axis in kg m2."""

    at: str
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Annotated[float, quantity("rotary inertia", at_least=0)] = 0.0


class Drive(Part):
    """A joint held by a spring of the given stiffness, N m/rad."""

    stiffness: Annotated[float, quantity("rotational stiffness", above=0)]


def _drive_tag(value: object) -> str:
    return "<drive>" if isinstance(value, (Mapping, Drive)) else "<word>"


class Coordinate(Part):
    """One rigid coordinate q: its joint, whether its angle is absolute, and how it is held."""

    joint: str
    angle: Literal["relative", "absolute"] = "relative"
    drive: Annotated[
        Annotated[Literal["free", "locked"], Tag("<word>")] | Annotated[Drive, Tag("<drive>")],
        Discriminator(_drive_tag),
    ] = "free"


class Mechanism(Part):
    """Materials, sections, links, joints and bodies by name, in the order of the file."""

    space: Literal["planar", "spatial"]
    materials: Annotated[Mapping[str, Material], Frozen]
    sections: Annotated[Mapping[str, Section], Frozen]
    links: Annotated[Mapping[str, Link], Field(min_length=1), Frozen]
    joints: Annotated[Mapping[str, Joint], Frozen]
    bodies: Annotated[Mapping[str, Body], Frozen] = FrozenDict()
