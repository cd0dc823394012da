"""The key `targets`: wanted frequencies, limits, bands to keep out of, gaps between modes, statics.

A target has exactly one of the keys in `TARGETS`, which say what kind it is, beside the limit of
what is static. What the rest of the
program goes through are requirements (`assignment.requirements`): one for each of a target's
`named`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_args

from pydantic import Field, field_validator, model_validator

from eigassign.case.reader import KeyPath, listed, shown, suggestion
from eigassign.case.schema.parts import (
    Direction,
    Mistakes,
    OneOrList,
    Part,
    Quantity,
    Share,
    Told,
    ValueOr,
    distinct,
    mapping,
    needs_one_of,
    quantity,
    wrong,
)
from eigassign.case.schema.trajectory import TIME, Coordinates, Times
from eigassign.case.units import DIMENSIONS, SI, handy_unit, written

FREQUENCY = quantity("frequency", above=0)
Frequency: TypeAlias = Annotated[float, FREQUENCY]
Mode: TypeAlias = Annotated[int, Field(ge=1, le=1000)]


Modes: TypeAlias = Annotated[
    tuple[Mode, ...], Field(min_length=1), distinct("mode {} is listed twice")
]

# --- Frequencies that may change in time


class FrequencyProfile(Part):
    """A frequency that changes in time, linear between the points given.

    Keys:
        time: of each point
        frequency: at each point
    """

    time: Times
    frequency: Annotated[tuple[Frequency, ...], Field(min_length=2)]

    def _mistakes(self, space: str | None) -> Mistakes:
        if len(self.time) != len(self.frequency):
            yield wrong(f"{len(self.time)} times for {len(self.frequency)} frequencies", "time")


Curve: TypeAlias = ValueOr[Frequency, FrequencyProfile]


class Harmonic(Part):
    """The band `harmonic` · `of` · (1 ± `margin`) about a multiple of a frequency.

    Keys:
        harmonic: the multiple
        of: the frequency
        margin: to either side
    """

    harmonic: Annotated[float, Quantity(above=0)]
    of: Curve
    margin: Annotated[float, Quantity(DIMENSIONS["fraction"], above=0, below=1)]


# --- Modes that are followed by their shape


class Pose(Part):
    """Where the mechanism stands.

    Keys:
        time: of a trajectory
        trajectory: its name, where there are several
        q: or one value of each coordinate
    """

    time: Annotated[float, TIME] | None = None
    trajectory: str | None = None
    q: Coordinates | None = None
    one_of = ("time", "q")

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.q is not None and self.trajectory is not None:
            yield wrong("belongs to time; q stands for itself", "trajectory")


class FollowedMode(Part):
    """The mode whose shape is that of a mode at a pose of the design in the file.

    Keys:
        like: number of the mode there
        at: the pose
    """

    like: Mode
    at: Pose

    @property
    def name(self) -> str:
        """The mode in words, and where it is named, as the file does."""
        q = " ".join(map(written, self.at.q or ()))
        where = f"q = {q}" if self.at.time is None else f"t = {written(self.at.time, 's')}"
        where += f" of {self.at.trajectory!r}" if self.at.trajectory else ""
        return f"the mode like mode {self.like} ({where})"


class Node(Part):
    """Where something may give way by so much.

    Keys:
        at: the node, `<link>.<node>`
    """

    at: str

    @property
    def name(self) -> str:
        """It in words."""
        return self.at


class PushedNode(Node):
    """Where a force acts, and along which direction it and the way that gives are.

    Keys:
        direction: in the axes of the ground
    """

    direction: Direction

    @property
    def name(self) -> str:
        """It in words."""
        return f"{self.at} along [{', '.join(f'{v:g}' for v in self.direction)}]"


class Antiresonance(PushedNode):
    """A frequency at which a force on a node leaves that node at rest along it.

    Keys:
        number: 1 is the lowest; modes that the force does not see are not counted
    """

    number: Mode = 1

    @property
    def name(self) -> str:
        """It in words."""
        return f"antiresonance {self.number} of {super().name}"


class NamedAntiresonance(Part):
    """An antiresonance beside a mode.

    Keys:
        antiresonance: which
    """

    antiresonance: Antiresonance

    @property
    def name(self) -> str:
        """It in words."""
        return self.antiresonance.name


NamedMode: TypeAlias = FollowedMode | Antiresonance  # not by the number of a mode alone
AnyMode: TypeAlias = int | NamedMode

# --- Targets


class AnyTarget(Part):
    """What every target may have: a weight, and where it holds.

    Keys:
        weight: multiplies the squares of its errors under `least_squares`, the errors under
            `worst_case`
        trajectory: name of the only trajectory on which it holds; all unless given
        during: the part of the trajectory, from one time to another
    """

    kind: ClassVar[str]
    is_goal: ClassVar[bool] = False  # its error is a distance; a limit's is a violation
    weight: Annotated[float, Quantity(above=0)] = 1.0
    trajectory: str | None = None
    during: tuple[Annotated[float, TIME], Annotated[float, TIME]] | None = None

    @property
    def frequencies(self) -> tuple[tuple[KeyPath, Curve], ...]:
        """Frequencies that the file gives, each with its keys below the target."""
        return ()

    @property
    def named(self) -> tuple[tuple[AnyMode, ...], ...]:
        """The modes of each of its requirements; none where every mode is meant, or statics."""
        return ()

    @property
    def followed(self) -> tuple[NamedMode, ...]:
        """The modes that it follows by their shapes, and antiresonances."""
        each = (mode for modes in self.named for mode in modes)
        return tuple(mode for mode in each if not isinstance(mode, int))

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of all modes that it names, of followed ones where they are named."""
        each = (m for modes in self.named for m in modes if not isinstance(m, Antiresonance))
        return tuple(mode if isinstance(mode, int) else mode.like for mode in each)

    @classmethod
    def curve_of(cls, mode: str) -> str:
        """The name of its curve: "mode 2" where a frequency is wanted, "mode 2 at least"."""
        return mode if cls.is_goal else f"{mode} {cls.kind.replace('_', ' ')}"

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.during is not None and self.during[0] >= self.during[1]:
            first, last = self.during
            got = f"[{written(first, 's')}, {written(last, 's')}]"
            yield wrong(f"the first time must be before the last, got {got}", "during")


class SomeModes(AnyTarget):
    """A target on one mode, or on several."""

    mode: ValueOr[Mode, FollowedMode] | None = None
    modes: OneOrList[Literal["all"], Modes] | None = None
    antiresonance: Antiresonance | None = None
    one_at_most = ("mode", "modes", "antiresonance")

    @property
    def one(self) -> AnyMode | None:
        """The only one that is meant."""
        return self.mode if self.antiresonance is None else self.antiresonance


class ModeTarget(SomeModes):
    """A target on a mode, or on each of several; its frequency is in the key named as its kind.

    Keys:
        mode: number of the elastic mode, 1 is the lowest; or a mode followed by its shape
        modes: several numbers, or `all`
        antiresonance: or an antiresonance of a node
    """

    model_config = needs_one_of(("mode",), ("modes",), ("antiresonance",))

    never_all: ClassVar[str] = ""  # why `modes: all` cannot be meant

    @property
    def curve(self) -> Curve:
        """The frequency that is wanted, or the limit, in Hz."""
        curve: Curve = getattr(self, self.kind)
        return curve

    @property
    def frequencies(self) -> tuple[tuple[KeyPath, Curve], ...]:
        """Frequencies with their key."""
        return (((self.kind,), self.curve),)

    @property
    def named(self) -> tuple[tuple[AnyMode, ...], ...]:
        """One mode each; all modes are at least f if and only if mode 1 is."""
        if self.modes is None:
            return ((self.one or 1,),)
        return ((1,),) if self.modes == "all" else tuple((mode,) for mode in self.modes)

    def _mistakes(self, space: str | None) -> Mistakes:
        yield from super()._mistakes(space)
        if self.one is None and self.modes is None:
            yield wrong("required key is missing: the number of a mode (or modes: [...])", "mode")
        if self.modes == "all" and self.never_all:
            yield wrong(self.never_all, "modes")


class FrequencyTarget(ModeTarget):
    """The mode has this frequency.

    Keys:
        frequency: may change in time
    """

    kind = "frequency"
    is_goal = True
    never_all = "all modes cannot have one frequency: list those that shall"
    frequency: Curve


class AtLeastTarget(ModeTarget):
    """The mode does not fall below this frequency.

    Keys:
        at_least: may change in time
    """

    kind = "at_least"
    at_least: Curve


class AtMostTarget(ModeTarget):
    """The mode does not exceed this frequency.

    Keys:
        at_most: may change in time
    """

    kind = "at_most"
    never_all = "there is always a higher mode: list those that are meant"
    at_most: Curve


class KeepOutTarget(SomeModes):
    """No mode is in this band, or none of those named.

    Keys:
        keep_out: the band, or one about a harmonic
        mode: number of the only mode that keeps out, or one followed by its shape
        modes: several numbers; `all` unless given
        antiresonance: or an antiresonance of a node
    """

    kind = "keep_out"
    keep_out: OneOrList[Harmonic, tuple[Frequency, Frequency]]

    @property
    def frequencies(self) -> tuple[tuple[KeyPath, Curve], ...]:
        """Frequencies that the file gives, each with its keys below the target."""
        if isinstance(self.keep_out, Harmonic):
            return ((("keep_out", "of"), self.keep_out.of),)
        return tuple((("keep_out", k), edge) for k, edge in enumerate(self.keep_out))

    @property
    def named(self) -> tuple[tuple[AnyMode, ...], ...]:
        """The modes of all of them together."""
        modes: tuple[AnyMode, ...] = () if self.one is None else (self.one,)
        return (modes if self.modes is None else () if self.modes == "all" else self.modes,)

    @field_validator("keep_out", mode="before")
    @classmethod
    def _has_two_edges(cls, value: Any) -> Any:
        if isinstance(value, Mapping) and value.keys() & {"min", "max"}:
            raise wrong("a band is written with its two edges, as [40 Hz, 50 Hz]")
        if not isinstance(value, Mapping | list | tuple | Harmonic):
            forms = "[low, high] or {harmonic: ..., of: ..., margin: ...}"
            raise wrong(f"expected {forms}, got {shown(value)}")
        return value

    def _mistakes(self, space: str | None) -> Mistakes:
        yield from super()._mistakes(space)
        if isinstance(self.keep_out, tuple) and self.keep_out[0] >= self.keep_out[1]:
            both = ", ".join(written(edge, "Hz") for edge in self.keep_out)
            yield wrong(f"the band must go upwards, got [{both}]", "keep_out")


GapEnd: TypeAlias = Annotated[
    Mode | FollowedMode | NamedAntiresonance,
    Told(lambda value: 1 + ("antiresonance" in value) if isinstance(value, Mapping) else 0),
]


class Gap(Part):
    """At least so many Hz between two modes.

    Keys:
        between: their numbers, the lower first; or modes followed by their shapes, antiresonances
        at_least: how far the second is above the first
    """

    between: tuple[GapEnd, GapEnd]
    at_least: Frequency

    def _mistakes(self, space: str | None) -> Mistakes:
        low, high = self.between
        if low == high:
            name = low if isinstance(low, int) else low.name
            yield wrong(f"a gap is between two modes, got {name} twice", "between")
        if isinstance(low, int) and isinstance(high, int) and low > high:
            yield wrong(f"the lower mode comes first: [{high}, {low}]", "between")


class GapTarget(AnyTarget):
    """Two modes stay apart.

    Keys:
        gap: which, and how far
    """

    kind = "gap"
    gap: Gap

    @property
    def frequencies(self) -> tuple[tuple[KeyPath, Curve], ...]:
        """The distance."""
        return ((("gap", "at_least"), self.gap.at_least),)

    @property
    def named(self) -> tuple[tuple[AnyMode, ...], ...]:
        """The pair."""
        ends = self.gap.between
        return (tuple(e.antiresonance if isinstance(e, NamedAntiresonance) else e for e in ends),)


class HighestTarget(AnyTarget):
    """The mode whose least frequency is made as high as can be; asked for by the objective.

    Keys:
        mode: its number
    """

    kind = "highest"
    mode: Mode

    @property
    def named(self) -> tuple[tuple[int, ...], ...]:
        """The mode."""
        return ((self.mode,),)


# --- Statics


class ShakenNode(PushedNode):
    """Where a force shakes, at which frequencies.

    Keys:
        from: the lowest
        to: the highest
    """

    lowest: Frequency = Field(alias="from")
    highest: Frequency = Field(alias="to")

    @property
    def name(self) -> str:
        """It in words."""
        unit, size = handy_unit(SI("Hz", self.lowest, self.highest))
        first = f"{self.lowest / size:g} … " if self.lowest < self.highest else ""
        return f"{super().name} at {first}{self.highest / size:g} {unit}"

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.lowest > self.highest:
            got = f"{written(self.lowest, 'Hz')} to {written(self.highest, 'Hz')}"
            yield wrong(f"the lowest frequency comes first, got {got}", "to")


class StaticTarget(AnyTarget):
    """A limit of how a force moves a node at every pose: it is on no mode."""

    noun: ClassVar[str] = ""  # of its amount, unless it is that of its kind
    limit: ClassVar[str]  # the key that it has with kinds of other targets

    @property
    def place(self) -> Node:
        """The node, with the direction that it is pushed along."""
        place: Node = getattr(self, self.kind)
        return place

    @property
    def edge(self) -> float:
        """The limit, in SI units."""
        edge: float = getattr(self, self.limit)
        return edge

    @model_validator(mode="before")
    @classmethod
    def _is_limited_to_one_side(cls, value: Any) -> Any:
        other = "at_most" if cls.limit == "at_least" else "at_least"
        if isinstance(value, Mapping) and other in value:
            raise wrong(f"a {cls.kind} has the limit {cls.limit}", other)
        return value


class StiffnessTarget(StaticTarget):
    """A node does not give way by more than a force over this stiffness, the drives holding.

    Keys:
        stiffness: where, and along which direction
        at_least: force over the way along it, at every sample
    """

    kind = "stiffness"
    limit = "at_least"
    stiffness: PushedNode
    at_least: Annotated[float, quantity("stiffness", above=0)]


class ComplianceTarget(StaticTarget):
    """Stiffness by its inverse.

    Keys:
        compliance: where, and along which direction
        at_most: way over the force along it, at every sample
    """

    kind = "compliance"
    limit = "at_most"
    compliance: PushedNode
    at_most: Annotated[float, quantity("compliance", above=0)]


class SagTarget(StaticTarget):
    """The weight bends the links by no more than this.

    Keys:
        sag: where
        at_most: way of the node, whatever its direction, at every sample
    """

    kind = "sag"
    limit = "at_most"
    sag: Node
    at_most: Annotated[float, quantity("length", above=0)]


class ResponseTarget(StaticTarget):
    """A shaken node does not move by more than a force over this stiffness.

    Keys:
        response: where, along which direction, and at which frequencies
        at_least: dynamic stiffness, force over the way along it, at every sample and frequency
    """

    kind = "response"
    noun = "dynamic stiffness"
    limit = "at_least"
    response: ShakenNode
    at_least: Annotated[float, quantity("stiffness", above=0)]


class MovedNode(Node):
    """Where vibration is left over.

    Keys:
        direction: along which the way counts, in the axes of the ground; its length unless given
        last: share of the motion, at its end, in which the way counts too; after the stop it always
            does
    """

    direction: OneOrList[Literal["any"], Direction] = "any"
    last: Share = 0.0

    @property
    def name(self) -> str:
        """It in words."""
        if isinstance(self.direction, str):
            return self.at
        return f"{self.at} along [{', '.join(f'{v:g}' for v in self.direction)}]"


class ResidualTarget(StaticTarget):
    """A node does not vibrate more than this after the motion.

    Keys:
        residual: where, and along which direction
        at_most: way of the node from where it rests then
    """

    kind = "residual"
    noun = "residual vibration"
    limit = "at_most"
    residual: MovedNode
    at_most: Annotated[float, quantity("length", above=0)]


class DrawnResponse(ShakenNode):
    """A response along the trajectory: the way of a node over the force that shakes one.

    Keys:
        seen: the node that is seen to move, and along which direction; the shaken one unless given
        teeth: of a cutter, for the speeds of its spindle that are free
        harmonics: of the passing of teeth, from the first on
    """

    seen: PushedNode | None = None
    teeth: Annotated[int, Field(ge=1, le=1000)] | None = None
    harmonics: Annotated[int, Field(ge=1, le=100)] = 1

    @property
    def name(self) -> str:
        """It in words."""
        return f"{self.seen.name} by {super().name}" if self.seen else super().name

    @property
    def places(self) -> tuple[PushedNode, PushedNode]:
        """Where it is shaken, and where it is seen."""
        return self, self.seen or self

    def _mistakes(self, space: str | None) -> Mistakes:
        yield from super()._mistakes(space)
        if self.teeth is None and self.harmonics > 1:
            yield wrong("is of the passing of teeth: give teeth, too", "harmonics")


ResponseForm: TypeAlias = OneOrList[
    DrawnResponse, Annotated[tuple[DrawnResponse, ...], Field(min_length=1)]
]


def _which_target(value: object) -> int:
    """By its one key that names a kind; beside a kind of statics, a limit names none."""
    given = mapping(value)
    kinds = [key for key in TARGETS if key in given]
    static = any(issubclass(TARGETS[kind], StaticTarget) for kind in kinds)
    kinds = [key for key in kinds if not (static and key in ("at_least", "at_most"))]
    if len(kinds) > 1:
        raise wrong(f"{kinds[0]} is given already: write a target of its own for each", kinds[1])
    if not kinds:
        near = [(key, hint) for key in given if (hint := suggestion(key, TARGETS))][:1]
        hint, message = near[0][1] if near else "", f"expected one of the keys {listed(TARGETS)}"
        raise wrong(f"{message}; got {listed(given)}{hint}", *(key for key, _ in near))
    return [*TARGETS].index(kinds[0])


TargetForm: TypeAlias = Annotated[
    FrequencyTarget
    | AtLeastTarget
    | AtMostTarget
    | KeepOutTarget
    | GapTarget
    | StiffnessTarget
    | ComplianceTarget
    | SagTarget
    | ResponseTarget
    | ResidualTarget,
    Told(_which_target),
]
# By the key that says the kind, which the limit of what is static does not.
TARGETS: dict[str, type[AnyTarget]] = {t.kind: t for t in get_args(get_args(TargetForm)[0])}
