"""The key `links` of a mechanism: beams, rigid bodies, frames of beams, superelements.

To add a type of link: write its model and put it into the union `Link`.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from eigassign.case.schema.parts import (
    File,
    FrozenDict,
    KindBy,
    Named,
    NumberOr,
    OneOrMoreNamed,
    Part,
    ValueOr,
    kinds,
    quantity,
)
from eigassign.case.schema.vectors import LENGTH, Angle, Inertia, Vector, only_in

Elements: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
ReduceTo: TypeAlias = Annotated[
    Annotated[float, quantity("frequency", above=0), Tag("<number>")]
    | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(lambda value: "<auto>" if value == "auto" else "<number>"),
]
Roll: TypeAlias = Annotated[
    Angle,
    only_in(
        "spatial",
        "is for spatial mechanisms: in a plane height lies in it, and width does not",
        neutral=0.0,
    ),
]
Dof: TypeAlias = Annotated[int, Field(ge=0)]


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
        elements: their number; `auto` looks for the fewest that meet `expansion.accuracy`
        shear: whether shear bends it too, as a Timoshenko beam
        roll: by which the section is turned about the beam's axis
        reduce_to: the inner nodes are replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` takes the lowest that meets a quarter of `expansion.accuracy`
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
            (Craig–Bampton); `auto` takes the lowest that meets a quarter of `expansion.accuracy`
    """

    type: Literal["frame"]
    nodes: Named[Vector]
    beams: OneOrMoreNamed[FrameBeam]
    reduce_to: ReduceTo | None = None


class SuperelementNode(Part):
    """A node at which the part is joined to others.

    Keys:
        position: its place
        dofs: its rows in the matrices, counted from 0, in the order u_x, u_y, θ_z, in space u_x,
            u_y, u_z, θ_x, θ_y, θ_z
    """

    position: Vector
    dofs: Annotated[tuple[Dof, ...], Field(min_length=3, max_length=6)]


class SuperelementLink(Part):
    """A part by its matrices, from another program.

    Keys:
        stiffness: file of the matrix, Matrix Market or NumPy, in SI units, without supports
        mass: file of the matrix, likewise
        nodes: by name
        reduce_to: the inner nodes are replaced by the link's own modes up to this frequency
            (Craig–Bampton); `auto` takes the lowest that meets a quarter of `expansion.accuracy`
    """

    type: Literal["superelement"]
    stiffness: File
    mass: File
    nodes: OneOrMoreNamed[SuperelementNode]
    reduce_to: ReduceTo | None = None


Link: TypeAlias = Annotated[
    BeamLink | RigidLink | FrameLink | SuperelementLink, KindBy("type", "link", default="beam")
]
LINKS = kinds(Link)
