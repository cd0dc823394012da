"""The key `links` of a mechanism: beams, rigid bodies, frames of beams, superelements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.quantity import Frozen, FrozenDict, Part, quantity
from eigassign.case.section_parts import given
from eigassign.case.vectors import (
    LENGTH,
    Angle,
    Inertia,
    Vector,
    check_inertia,
    word_or_number,
)

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
