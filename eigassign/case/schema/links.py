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
from eigassign.case.schema.vectors import LENGTH, Angle, Inertia, Vector

Elements: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
ReduceTo: TypeAlias = Annotated[
    Annotated[float, quantity("frequency", above=0), Tag("<number>")]
    | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(lambda value: "<auto>" if value == "auto" else "<number>"),
]
Dof: TypeAlias = Annotated[int, Field(ge=0)]


class Taper(Part):
    """Two sections of the same shape; dimensions run linearly from `start` to `end`."""

    start: str
    end: str


class BeamLink(Part):
    """A straight flexible link along its local x: length in m, material, section, elements.

    `shear`: Timoshenko beam; `roll` (rad) turns the section about the beam's axis. Nodes `start`
    (the origin of the link's frame) and `end`. `reduce_to` (Hz, or `auto`): Craig–Bampton with the
    fixed-interface modes up to that frequency.
    """

    type: Literal["beam"] = "beam"
    length: Annotated[float, LENGTH]
    material: str
    section: ValueOr[str, Taper]
    elements: NumberOr[Elements, Literal["auto"]]
    shear: bool = False
    roll: Angle = 0.0
    reduce_to: ReduceTo | None = None


class RigidLink(Part):
    """A rigid body: nodes in its frame (m), mass (kg), inertia (kg m2) about its centre of mass.

    `start` is at the origin unless given; with `length` there is a node `end` at [length, 0(, 0)].
    """

    type: Literal["rigid"]
    nodes: Named[Vector] = FrozenDict()
    length: Annotated[float, LENGTH] | None = None
    mass: Annotated[float, quantity("mass", at_least=0)] = 0.0
    inertia: Inertia = 0.0
    center: Vector | None = None


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
    nodes: Named[Vector]
    beams: OneOrMoreNamed[FrameBeam]
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
    stiffness: File
    mass: File
    nodes: OneOrMoreNamed[SuperelementNode]
    reduce_to: ReduceTo | None = None


Link: TypeAlias = Annotated[
    BeamLink | RigidLink | FrameLink | SuperelementLink, KindBy("type", "link", default="beam")
]
LINKS = kinds(Link)
