"""The key `links` of a mechanism: beams, rigid bodies, frames of beams, superelements.

The keys `materials` and `sections` of a mechanism.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.schema.vectors import (
    LENGTH,
    Angle,
    Inertia,
    Vector,
    check_inertia,
    word_or_number,
)
from eigassign.case.units import Frozen, FrozenDict, Part, Quantity, quantity, wrong

# --- The key `links` of a mechanism: beams, rigid bodies, frames of beams, superelements

Elements: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
ElementsOrAuto: TypeAlias = Annotated[
    Annotated[Elements, Tag("<number>")] | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(word_or_number),
]
ReduceTo: TypeAlias = Annotated[
    Annotated[float, quantity("frequency", above=0), Tag("<number>")]
    | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(lambda value: "<auto>" if value == "auto" else "<number>"),
]
Nodes: TypeAlias = Annotated[Mapping[str, Vector], Frozen]
Dof: TypeAlias = Annotated[int, Field(ge=0)]


class Taper(Part):
    """Two sections of the same shape; dimensions run linearly from `start` to `end`."""

    start: str
    end: str


def _section_tag(value: object) -> str:
    return "<taper>" if isinstance(value, (Mapping, Taper)) else "<word>"


class BeamLink(Part):
    """A straight flexible link along its local x: length in m, material, section, elements.

    `shear`: Timoshenko beam; `roll` (rad) turns the section about the beam's axis. Nodes `start`
    (the origin of the link's frame) and `end`. `reduce_to` (Hz, or `auto`): Craig–Bampton with the
    fixed-interface modes up to that frequency.
    """

    type: Literal["beam"] = "beam"
    length: Annotated[float, LENGTH]
    material: str
    section: Annotated[
        Annotated[str, Tag("<word>")] | Annotated[Taper, Tag("<taper>")],
        Discriminator(_section_tag),
    ]
    elements: ElementsOrAuto
    shear: bool = False
    roll: Angle = 0.0
    reduce_to: ReduceTo | None = None


class RigidLink(Part):
    """A rigid body: nodes in its frame (m), mass (kg), inertia (kg m2) about its centre of mass.

    `start` is at the origin unless given; with `length` there is a node `end` at [length, 0(, 0)].
    """

    type: Literal["rigid"]
    nodes: Nodes = FrozenDict()
    length: Annotated[float, LENGTH] | None = None
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Inertia = 0.0
    center: Vector | None = None

    @model_validator(mode="after")
    def _turns(self) -> RigidLink:
        check_inertia(self.inertia)
        return self


class FrameBeam(Part):
    """A beam of a frame, between two of its nodes."""

    from_node: str = Field(alias="from")
    to_node: str = Field(alias="to")
    material: str
    section: str
    elements: Elements = 1
    shear: bool = False
    roll: Angle = 0.0


class FrameLink(Part):
    """Beams rigidly joined at nodes (m, in the link's frame): lattice booms, forks, portals.

    `reduce_to` (Hz, or `auto`): Craig–Bampton; the nodes that nothing uses are interior.
    """

    type: Literal["frame"]
    nodes: Nodes
    beams: Annotated[Mapping[str, FrameBeam], Field(min_length=1), Frozen]
    reduce_to: ReduceTo | None = None


class SuperelementNode(Part):
    """An interface node: its place (m) and its rows in the matrices, counted from 0.

    `dofs` are those of u_x, u_y, θ_z in a plane; u_x, u_y, u_z, θ_x, θ_y, θ_z in space.
    """

    position: Vector
    dofs: Annotated[tuple[Dof, ...], Field(min_length=3, max_length=6)]


class SuperelementLink(Part):
    """Stiffness and mass from another program (Matrix Market or NumPy files, SI units).

    `reduce_to` (Hz, or `auto`): Craig–Bampton with the fixed-interface modes up to that frequency.
    """

    type: Literal["superelement"]
    stiffness: str
    mass: str
    nodes: Annotated[Mapping[str, SuperelementNode], Field(min_length=1), Frozen]
    reduce_to: ReduceTo | None = None


LINKS: dict[str, type[Part]] = {
    "beam": BeamLink,
    "rigid": RigidLink,
    "frame": FrameLink,
    "superelement": SuperelementLink,
}


def _link_tag(value: object) -> str | None:
    kind = given(value, "type", "beam")
    return f"<{kind}>" if isinstance(kind, str) and kind in LINKS else None


Link: TypeAlias = Annotated[
    Annotated[BeamLink, Tag("<beam>")]
    | Annotated[RigidLink, Tag("<rigid>")]
    | Annotated[FrameLink, Tag("<frame>")]
    | Annotated[SuperelementLink, Tag("<superelement>")],
    Discriminator(_link_tag, custom_error_type="choice:link", custom_error_message="type"),
]


# --- The keys `materials` and `sections` of a mechanism

MODULUS = quantity("pressure or modulus", above=0)
SECOND_MOMENT = quantity("second moment of area", above=0)
_EITHER = "give poissons_ratio or shear_modulus, not both"


class Material(Part):
    """Linear elastic, homogeneous, isotropic: moduli in Pa, density in kg/m3.

    Torsion and shear need Poisson's ratio or the shear modulus, G = E / (2 (1 + ν)).
    """

    youngs_modulus: Annotated[float, MODULUS]
    density: Annotated[float, quantity("density", at_least=0)]
    poissons_ratio: Annotated[float, Quantity(above=-1, below=0.5)] | None = None
    shear_modulus: Annotated[float, MODULUS] | None = None

    @model_validator(mode="after")
    def _has_one_shear_modulus(self) -> Material:
        if self.poissons_ratio is not None and self.shear_modulus is not None:
            raise wrong(_EITHER, "shear_modulus")
        return self


class BareSection(Part):
    """Properties as given: area in m2, second moments of area in m4.

    `bending_inertia` (or `inertia_z`) resists bending in the local x-y plane, which is the plane of
    a planar mechanism; `inertia_y` in x-z. `torsion_constant` (m4) resists torsion;
    `polar_inertia` (m4) is the inertia of twisting, inertia_y + inertia_z unless given.
    `shear_coefficient` is κ of κGA, 5/6 unless given.
    """

    shape: Literal["bare"] = "bare"
    area: Annotated[float, quantity("area", above=0)]
    bending_inertia: Annotated[float, SECOND_MOMENT] | None = None
    inertia_y: Annotated[float, SECOND_MOMENT] | None = None
    inertia_z: Annotated[float, SECOND_MOMENT] | None = None
    torsion_constant: Annotated[float, SECOND_MOMENT] | None = None
    polar_inertia: Annotated[float, SECOND_MOMENT] | None = None
    shear_coefficient: Annotated[float, Quantity(above=0)] | None = None

    @model_validator(mode="after")
    def _bends_one_way(self) -> BareSection:
        if self.bending_inertia is not None and self.inertia_z is not None:
            raise wrong("is the same as bending_inertia: give one of them", "inertia_z")
        return self

    @property
    def in_plane(self) -> float:
        """Second moment of area that resists bending in the local x-y plane, m4."""
        return self.inertia_z or self.bending_inertia or 0.0


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
    """Solid rectangle, in m; `height` lies along local y, the plane of motion of a planar
    mechanism: I_z = width height³ / 12."""

    shape: Literal["rectangle"]
    width: Annotated[float, LENGTH]
    height: Annotated[float, LENGTH]


class IProfileSection(Part):
    """Two flanges of `width` × `flange_thickness` and a web, in m; `height` along local y."""

    shape: Literal["i_profile"]
    height: Annotated[float, LENGTH]
    width: Annotated[float, LENGTH]
    flange_thickness: Annotated[float, LENGTH]
    web_thickness: Annotated[float, LENGTH]

    @model_validator(mode="after")
    def _has_a_web(self) -> IProfileSection:
        if 2 * self.flange_thickness >= self.height:
            raise wrong("must be less than half of height", "flange_thickness")
        if self.web_thickness > self.width:
            raise wrong("must be at most the width", "web_thickness")
        return self


SHAPES: dict[str, type[Part]] = {
    "bare": BareSection,
    "circle": CircleSection,
    "tube": TubeSection,
    "rectangle": RectangleSection,
    "i_profile": IProfileSection,
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
    | Annotated[RectangleSection, Tag("<rectangle>")]
    | Annotated[IProfileSection, Tag("<i_profile>")],
    Discriminator(_shape_tag, custom_error_type="choice:shape", custom_error_message="shape"),
]
