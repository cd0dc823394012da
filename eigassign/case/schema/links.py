"""The keys `materials`, `sections` and `links` of a mechanism.

To add a shape: write its model and put it into the union `Section`; say how deep it is and which
of its dimensions limit one another. What its area and moments are, `mechanism.elements.sections`
says.

To add a type of link: write its model and put it into the union `Link`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from eigassign.case.schema.parts import (
    LENGTH,
    Angle,
    File,
    FrozenDict,
    Inertia,
    KindBy,
    Mistakes,
    Named,
    NumberOr,
    OneOrList,
    OneOrMoreNamed,
    Part,
    Quantity,
    ShareOrRange,
    Told,
    ValueOr,
    Vector,
    needs_one_of,
    only_in,
    quantity,
    wrong,
)
from eigassign.case.units import slip, written

MODULUS = quantity("pressure or modulus", above=0)
SECOND_MOMENT = quantity("second moment of area", above=0)
_THICK = "is no box whose torsion and shear are known well"


class Material(Part):
    """Linear elastic, homogeneous, isotropic.

    Keys:
        youngs_modulus: E
        density: ρ
        poissons_ratio: ν, for spatial beams, `shear: true` and solids
        shear_modulus: G, instead of Poisson's ratio, G = E / (2 (1 + ν))
        loss_factor: η of its complex moduli, E (1 + iη); or the least and the most, for responses
    """

    youngs_modulus: Annotated[float, MODULUS]
    density: Annotated[float, quantity("density", at_least=0)]
    poissons_ratio: Annotated[float, Quantity(above=-1, below=0.5)] | None = None
    shear_modulus: Annotated[float, MODULUS] | None = None
    loss_factor: ShareOrRange | None = None
    one_at_most = ("poissons_ratio", "shear_modulus")


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

    depths: ClassVar[tuple[str, ...]] = ()  # its dimension in the plane of bending, then the other
    bounds: ClassVar[tuple[DimensionLimit, ...]] = ()

    def depth(self, spatial: bool) -> float:
        """Depth in the plane of bending, m; in space the larger of the two."""
        both: list[float] = [getattr(self, key) for key in self.depths]
        return max(both) if spatial else both[0]

    def limits(self) -> tuple[DimensionLimit, ...]:
        """Inequalities between its dimensions without which the section cannot exist."""
        return tuple(each for each in self.bounds if getattr(self, each.small) is not None)

    def _mistakes(self, space: str | None) -> Mistakes:
        for limit in self.limits():
            small, large = getattr(self, limit.small), getattr(self, limit.large)
            if not limit.holds(small, large):
                most = written(large / limit.factor, "m", large)
                yield wrong(f"{limit}, which is {most}{slip(small, 'm')}", limit.small)


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

    one_at_most = ("bending_inertia", "inertia_z")

    def _mistakes(self, space: str | None) -> Mistakes:
        yield from super()._mistakes(space)
        spatial = space == "spatial"
        if spatial and self.bending_inertia is not None:
            message = "is for planar mechanisms: in space write inertia_z (bending in the local "
            yield wrong(message + "x-y plane) and inertia_y (x-z)", "bending_inertia")
        needed = ("inertia_y", "inertia_z", "torsion_constant") if spatial else ("bending_inertia",)
        for key in needed if spatial or (space and not self.in_plane) else ():
            if getattr(self, key) is None:
                message = "required key is missing: second moment of area (in m4 when bare; or mm4,"
                yield wrong(f"{message} cm4)", key)

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
    depths = ("diameter",)


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

    one_of = ("inner_diameter", "thickness")

    depths = ("outer_diameter",)
    bounds = (  # a bore needs a wall around it, which ends at the middle, where a tube is solid
        DimensionLimit("inner_diameter", "outer_diameter"),
        DimensionLimit("thickness", "outer_diameter", factor=2, may_meet=True),
    )


class RectangleSection(SectionBase):
    """Solid rectangle; in a planar mechanism I = `width` `height`³ / 12.

    Keys:
        width: along local z
        height: along local y, which lies in the plane of a planar mechanism
    """

    shape: Literal["rectangle"]
    width: Annotated[float, LENGTH]
    height: Annotated[float, LENGTH]
    depths = ("height", "width")


class BoxSection(RectangleSection):
    """Hollow rectangle of one wall thickness, without roundings.

    Keys:
        width: outer, along local z
        height: outer, along local y, which lies in the plane of a planar mechanism
        thickness: of the wall, at most 0.4 of the smaller side; thicker ones are a `rectangle`
    """

    shape: Literal["box"]  # type: ignore[assignment]
    thickness: Annotated[float, LENGTH]
    bounds = (  # up to which torsion and shear are known well, see `mechanism.elements.sections`
        DimensionLimit("thickness", "width", 2.5, True, _THICK),
        DimensionLimit("thickness", "height", 2.5, True, _THICK),
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
    depths = ("height", "width")
    bounds = (  # the web stands between the flanges and is no wider than they are
        DimensionLimit("flange_thickness", "height", factor=2),
        DimensionLimit("web_thickness", "width", may_meet=True),
    )


Section: TypeAlias = Annotated[
    BareSection | CircleSection | TubeSection | RectangleSection | BoxSection | IProfileSection,
    KindBy("shape", default="bare"),
]


Elements: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
ReduceTo: TypeAlias = Annotated[
    Annotated[float, quantity("frequency", above=0)] | Literal["auto"],
    Told(lambda value: value == "auto"),
]
Roll: TypeAlias = Annotated[
    Angle,
    only_in(
        "spatial",
        "is for spatial mechanisms: in a plane height lies in it, and width does not",
        neutral=0.0,
    ),
]
Dof: TypeAlias = Annotated[int, Field(ge=0, le=10**9)]


class Taper(Part):
    """Two sections of the same shape, between which all dimensions run linearly.

    Keys:
        start: name of the section at the beam's start
        end: name of the section at its end
    """

    start: str
    end: str


class BeamLink(Part):
    """A straight flexible beam along its local x, with the nodes `start` and `end`.

    Keys:
        length: from `start` to `end`
        material: its name
        section: its name; or two of a taper, stiffness and mass of which are integrated over each
            element
        elements: their number; `auto` doubles it until it meets `expansion.accuracy`
        shear: whether shear bends it too, as a Timoshenko beam
        roll: by which the section is turned about the beam's axis
        reduce_to: the inner nodes are replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` doubles it until it meets a quarter of `expansion.accuracy`
    """

    type: Literal["beam"] = "beam"
    length: Annotated[float, LENGTH]
    material: str
    section: ValueOr[str, Taper]
    elements: NumberOr[Elements, Literal["auto"]]
    shear: bool = False
    roll: Roll = 0.0
    reduce_to: ReduceTo | None = None


class RigidLink(Part):
    """A rigid body.

    Keys:
        nodes: places by name; `start` is at the origin unless given
        length: makes a node `end` at this distance along x
        mass: of the body
        inertia: as of bodies, about the centre of mass
        center: place of the centre of mass; the origin unless given
    """

    type: Literal["rigid"]
    nodes: Named[Vector] = FrozenDict()
    length: Annotated[float, LENGTH] | None = None
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Inertia = 0.0
    center: Vector | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.length is not None and "end" in self.nodes:
            message = "the node 'end' is given by length already: leave one of them out"
            yield wrong(message, "nodes", "end")


class FrameBeam(Part):
    """A beam of a frame; its local x runs from one node to the other.

    Its local y lies in the x-y plane of the link, y = z × x, and is the link's y where the beam is
    along z.

    Keys:
        from: name of the node where it begins
        to: name of the node where it ends
        material: its name
        section: its name
        elements: their number
        shear: whether shear bends it too
        roll: by which y and z are turned about x
    """

    from_node: str = Field(alias="from")
    to_node: str = Field(alias="to")
    material: str
    section: str
    elements: Elements = 1
    shear: bool = False
    roll: Roll = 0.0


class FrameLink(Part):
    """Beams joined rigidly at nodes: lattice booms, forks, portals.

    Keys:
        nodes: places by name, in the link's axes; one is called `start`
        beams: by name
        reduce_to: the inner nodes are replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` doubles it until it meets a quarter of `expansion.accuracy`
    """

    type: Literal["frame"]
    nodes: Named[Vector]
    beams: OneOrMoreNamed[FrameBeam]
    reduce_to: ReduceTo | None = None


NodeNumber: TypeAlias = Annotated[int, Field(ge=1, le=10**9)]


class SuperelementNode(Part):
    """A node at which the part is joined to others.

    Keys:
        id: its number in the other program; its rows and its place are found by it. It needs
            displacements and rotations; in a plane the freedoms 3, 4 and 5 of the node are held.
            `[101, 103]`: the rotations of 101 are the displacements of 103, a ROT NODE of CalculiX
        position: its place, where no file has it, or another one is meant
        dofs: its rows in the matrices, counted from 0, in the order u_x, u_y, θ_z, in space u_x,
            u_y, u_z, θ_x, θ_y, θ_z; of files that do not say whose their rows are
    """

    model_config = needs_one_of(("id",), ("position", "dofs"))

    id: OneOrList[NodeNumber, tuple[NodeNumber, NodeNumber]] | None = None
    position: Vector | None = None
    dofs: Annotated[tuple[Dof, ...], Field(min_length=3, max_length=6)] | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        rows = "u_x, u_y, θ_z" if space == "planar" else "u_x, u_y, u_z, θ_x, θ_y, θ_z"
        n = rows.count(",") + 1
        if self.dofs is not None and space and len(self.dofs) != n:
            yield wrong(f"needs {n} entries, the rows of {rows}; got {len(self.dofs)}", "dofs")
        for key in ("position", "dofs"):
            if self.id is None and getattr(self, key) is None:
                yield wrong(f"required key is missing: {key}, or id, the node's number", key)


class SuperelementLink(Part):
    """A part by its matrices, from another program, without supports.

    What a file is, is told by its content: Nastran (DMIG punch, OP4), Abaqus (matrix output),
    CalculiX (.sti, .mas), Ansys (Matrix Market), MATLAB, NumPy.

    Keys:
        stiffness: file of the matrix; of a file with several, `parts.mat:K` names it
        mass: file of the matrix, likewise
        file: one file that holds both, in place of these two
        units: of the matrices and of the places in files, not of what this file says
        nodes_file: file, or list of files, that say where nodes are (CSV of id, x, y, z, or the
            other program's input with *NODE or GRID) or whose the rows are (.dof, .mapping)
        nodes: by name
        reduce_to: the inner nodes are replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` doubles it until it meets a quarter of `expansion.accuracy`
    """

    model_config = needs_one_of(("stiffness", "mass"), ("file",))

    type: Literal["superelement"]
    stiffness: File | None = None
    mass: File | None = None
    file: File | None = None
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms", "in-lbf-s"] = "m-kg-s"
    nodes_file: OneOrList[File, Annotated[tuple[File, ...], Field(min_length=1)]] | None = None
    nodes: OneOrMoreNamed[SuperelementNode]
    reduce_to: ReduceTo | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        for key in ("stiffness", "mass"):
            if self.file is None and getattr(self, key) is None:
                yield wrong(f"required key is missing: {key}, or file, which holds both", key)
            if self.file is not None and getattr(self, key) is not None:
                yield wrong(f"stands beside file, which holds both: leave out {key}, or file", key)


class SolidNode(Part):
    """A node that stands for a surface of a solid.

    Keys:
        surface: its name in the mesh: a physical group, node set, surface, property or coupling
            (`RBE2 7`, the name of a `*COUPLING`, or `node 12` of its node)
        coupling: `rigid`, the surface moves with the node as one (RBE2); or `distributing`, the
            node follows the mean motion of the surface (RBE3); as the mesh couples it, else `rigid`
        position: its place; that of the coupling's node, else the centre of the surface
    """

    surface: str
    coupling: Literal["rigid", "distributing"] | None = None
    position: Vector | None = None


class SolidLink(Part):
    """A part by its mesh, of tetrahedra of 4 or 10 nodes or hexahedra of 20.

    In a plane its nodes move in the x-y plane only; the mesh stays spatial.

    Keys:
        mesh: its file, of gmsh (.msh), Abaqus, CalculiX (.inp) or Nastran (.bdf)
        units: of the file; lengths are in mm where it is `mm-t-s` or `mm-kg-ms`
        material: its name
        nodes: by name
        reduce_to: the mesh is replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` doubles it until it meets a quarter of `expansion.accuracy`
    """

    type: Literal["solid"]
    mesh: File
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms", "in-lbf-s"] = "m-kg-s"
    material: str
    nodes: OneOrMoreNamed[SolidNode]
    reduce_to: ReduceTo = "auto"


Link: TypeAlias = Annotated[
    BeamLink | RigidLink | FrameLink | SuperelementLink | SolidLink,
    KindBy("type", default="beam"),
]
IMPORTED = ("superelement", "solid")  # of which only nodes and matrices are known
