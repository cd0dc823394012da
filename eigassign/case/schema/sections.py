"""The keys `materials` and `sections` of a mechanism.

To add a shape: write its model and put it into the union `Section`; say how deep it is and which
of its dimensions limit one another. What its area and moments are, `mechanism.elements.sections`
says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import model_validator

from eigassign.case.schema.parts import LENGTH, KindBy, Part, Quantity, kinds, quantity, wrong

MODULUS = quantity("pressure or modulus", above=0)
SECOND_MOMENT = quantity("second moment of area", above=0)


class Material(Part):
    """Linear elastic, homogeneous, isotropic.

    Keys:
        youngs_modulus: E
        density: ρ
        poissons_ratio: ν, for spatial beams, `shear: true` and solids
        shear_modulus: G, instead of Poisson's ratio, G = E / (2 (1 + ν))
    """

    youngs_modulus: Annotated[float, MODULUS]
    density: Annotated[float, quantity("density", at_least=0)]
    poissons_ratio: Annotated[float, Quantity(above=-1, below=0.5)] | None = None
    shear_modulus: Annotated[float, MODULUS] | None = None

    @model_validator(mode="after")
    def _has_one_shear_modulus(self) -> Self:
        if self.poissons_ratio is not None and self.shear_modulus is not None:
            raise wrong("give poissons_ratio or shear_modulus, not both", "shear_modulus")
        return self


@dataclass(frozen=True)
class DimensionLimit:
    """``factor × small < large`` between two dimensions of a section, or ≤ where they may meet."""

    small: str
    large: str
    factor: float = 1
    may_meet: bool = False
    beyond: str = "cannot exist"  # what is said of a section beyond it

    def holds(self, small: float, large: float) -> bool:
        """True where these values of the two dimensions are possible."""
        a = self.factor * small
        return a < large or (self.may_meet and a == large)

    def __str__(self) -> str:
        named = {1.0: "", 2.0: "half of "}
        share = f"{named.get(self.factor, f'{1 / self.factor:g} of ')}{self.large}"
        return f"must be {'at most' if self.may_meet else 'less than'} {share}"


class SectionBase(Part):
    """Depth and limits, which all sections have."""

    def depth(self, spatial: bool) -> float:
        """Depth in the plane of bending, m; in space the larger of the two."""
        raise NotImplementedError

    def limits(self) -> tuple[DimensionLimit, ...]:
        """Inequalities between its dimensions without which the section cannot exist."""
        return ()

    @model_validator(mode="after")
    def _exists(self) -> Self:
        for limit in self.limits():
            large = getattr(self, limit.large)
            if not limit.holds(getattr(self, limit.small), large):
                raise wrong(f"{limit}, which is {large / limit.factor:g} m", limit.small)
        return self


class BareSection(SectionBase):
    """Properties as given.

    Keys:
        area: A
        bending_inertia: second moment for bending in the plane of a planar mechanism
        inertia_y: for bending in the local x-z plane
        inertia_z: for bending in the local x-y plane; the same as `bending_inertia`
        torsion_constant: for torsion; spatial mechanisms need it
        polar_inertia: for the inertia of twisting; `inertia_y` + `inertia_z` unless given
        shear_coefficient: κ of κGA; 5/6 unless given
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
    def _bends_one_way(self) -> Self:
        if self.bending_inertia is not None and self.inertia_z is not None:
            raise wrong("is the same as bending_inertia: give one of them", "inertia_z")
        return self

    @property
    def in_plane(self) -> float:
        """Second moment of area that resists bending in the local x-y plane, m4."""
        return self.inertia_z or self.bending_inertia or 0.0

    def depth(self, spatial: bool) -> float:
        """The least that a section of this area and inertia has.

        No section of depth h has a radius of gyration above h/2 (a mean square distance from the
        centroid over an interval of length h is at most h²/4), so h ≥ 2 √(I/A).
        """
        inertia = max(self.in_plane, (self.inertia_y or 0.0) if spatial else 0.0)
        return 2 * math.sqrt(inertia / self.area)


class CircleSection(SectionBase):
    """Solid round bar.

    Keys:
        diameter: d
    """

    shape: Literal["circle"]
    diameter: Annotated[float, LENGTH]

    def depth(self, spatial: bool) -> float:
        """The diameter."""
        return self.diameter


class TubeSection(SectionBase):
    """Round tube, by its inner diameter or its wall.

    Keys:
        outer_diameter: of the tube
        inner_diameter: of the bore
        thickness: of the wall
    """

    shape: Literal["tube"]
    outer_diameter: Annotated[float, LENGTH]
    inner_diameter: Annotated[float, LENGTH] | None = None
    thickness: Annotated[float, LENGTH] | None = None

    @model_validator(mode="after")
    def _has_one_wall(self) -> Self:
        if (self.inner_diameter is None) == (self.thickness is None):
            raise wrong("a tube needs either inner_diameter or thickness, and not both")
        return self

    def depth(self, spatial: bool) -> float:
        """The outer diameter."""
        return self.outer_diameter

    def limits(self) -> tuple[DimensionLimit, ...]:
        """The wall ends at the middle, where a tube is solid; a bore needs a wall around it."""
        if self.inner_diameter is not None:
            return (DimensionLimit("inner_diameter", "outer_diameter"),)
        if self.thickness is not None:
            return (DimensionLimit("thickness", "outer_diameter", factor=2, may_meet=True),)
        return ()


class RectangleSection(SectionBase):
    """Solid rectangle; in a planar mechanism I = `width` `height`³ / 12.

    Keys:
        width: along local z
        height: along local y, which lies in the plane of a planar mechanism
    """

    shape: Literal["rectangle"]
    width: Annotated[float, LENGTH]
    height: Annotated[float, LENGTH]

    def depth(self, spatial: bool) -> float:
        """The height, or the larger side."""
        return max(self.height, self.width) if spatial else self.height


class BoxSection(RectangleSection):
    """Hollow rectangle of one wall thickness, without roundings.

    Keys:
        width: outer, along local z
        height: outer, along local y, which lies in the plane of a planar mechanism
        thickness: of the wall, at most 0.4 of the smaller side; thicker ones are a `rectangle`
    """

    shape: Literal["box"]  # type: ignore[assignment]
    thickness: Annotated[float, LENGTH]

    def limits(self) -> tuple[DimensionLimit, ...]:
        """Up to which torsion and shear are known well, see `mechanism.elements.sections`."""
        beyond = "is no box whose torsion and shear are known well"
        return tuple(
            DimensionLimit("thickness", side, factor=2.5, may_meet=True, beyond=beyond)
            for side in ("width", "height")
        )


class IProfileSection(SectionBase):
    """Two flanges and a web.

    Keys:
        height: along local y
        width: of the flanges
        flange_thickness: along local y
        web_thickness: along local z
    """

    shape: Literal["i_profile"]
    height: Annotated[float, LENGTH]
    width: Annotated[float, LENGTH]
    flange_thickness: Annotated[float, LENGTH]
    web_thickness: Annotated[float, LENGTH]

    def depth(self, spatial: bool) -> float:
        """The height, or the larger side."""
        return max(self.height, self.width) if spatial else self.height

    def limits(self) -> tuple[DimensionLimit, ...]:
        """The web stands between the flanges and is no wider than they are."""
        return (
            DimensionLimit("flange_thickness", "height", factor=2),
            DimensionLimit("web_thickness", "width", may_meet=True),
        )


Section: TypeAlias = Annotated[
    BareSection | CircleSection | TubeSection | RectangleSection | BoxSection | IProfileSection,
    KindBy("shape", "shape", default="bare"),
]
SHAPES = kinds(Section)
