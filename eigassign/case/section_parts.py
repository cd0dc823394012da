"""The keys `materials` and `sections` of a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Tag, model_validator

from eigassign.case.quantity import Part, Quantity, quantity, wrong
from eigassign.case.vectors import LENGTH

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
