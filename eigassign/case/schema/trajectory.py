"""The key `trajectory`: joint samples, a CSV file, point to point, or a path of a link's node.

It holds one of them, or a list. To add a kind: write its model, put it into the union
`TrajectoryForm`, and name the key by which it is known in `MOTIONS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from eigassign.case.reader import KeyPath
from eigassign.case.schema.mechanism import QValue
from eigassign.case.schema.parts import (
    ByReference,
    File,
    FrozenDict,
    Name,
    OneOrList,
    Part,
    Quantity,
    quantity,
    wrong,
)
from eigassign.case.schema.vectors import Angle, Orientation, Vector

DURATION = quantity("time", above=0)
TIME = quantity("time")


def _increasing(times: tuple[float, ...]) -> tuple[float, ...]:
    for k, (before, after) in enumerate(pairwise(times), 1):
        if after <= before:
            raise wrong(f"time must increase: {after:g} s after {before:g} s", k)
    return times


Times: TypeAlias = Annotated[
    tuple[Annotated[float, TIME], ...], Field(min_length=2), AfterValidator(_increasing)
]
Coordinates: TypeAlias = tuple[QValue, ...]
PropertyValue: TypeAlias = Annotated[
    float, Quantity(elsewhere="quantity of the property's dimension (SI when bare)")
]
Samples: TypeAlias = Annotated[int, Field(ge=2, le=100_000)]


def _nested_tag(value: object) -> str:
    """Tag of one triple of angles, or a list of them."""
    nested = isinstance(value, (tuple, list)) and any(isinstance(v, (tuple, list)) for v in value)
    return "<list>" if nested else "<one>"


class AnyTrajectory(Part):
    """What every trajectory may have: a `name`, and what each of its seconds weighs beside others.

    Without a name it is called by its place: "1", "2", … `set` gives properties of the mechanism
    other values along it, by their paths.
    """

    name: Name | None = None
    weight: Annotated[float, Quantity(above=0)] = 1.0
    set: ByReference[PropertyValue] = FrozenDict()


class SampledTrajectory(AnyTrajectory):
    """Joint samples: q (n_samples, n_q); `time` (s), or `duration` (s) for equal steps from 0."""

    q: Annotated[tuple[Coordinates, ...], Field(min_length=2)]
    time: Times | None = None
    duration: Annotated[float, DURATION] | None = None

    @model_validator(mode="after")
    def _has_one_clock(self) -> Self:
        if (self.time is None) == (self.duration is None):
            raise wrong("give either time (one per sample) or duration, and not both")
        if self.time is not None and len(self.time) != len(self.q):
            raise wrong(f"{len(self.time)} times for {len(self.q)} samples of q", "time")
        return self


class FileTrajectory(AnyTrajectory):
    """Joint samples in a CSV file: columns `time` (s) and one per coordinate (rad, or [deg])."""

    file: File


class Timed(AnyTrajectory):
    """What moves by a timing law: from rest to rest, but for `linear`, in equal steps of time."""

    timing: Literal["quintic", "cubic", "trapezoidal", "linear"] = "quintic"
    acceleration_share: Annotated[float, Quantity(above=0, at_most=0.5)] = 1 / 3
    samples: Samples = 101

    @model_validator(mode="after")
    def _accelerates(self) -> Self:
        if "acceleration_share" in self.model_fields_set and self.timing != "trapezoidal":
            message = f"is for timing: trapezoidal; {self.timing} has no such share"
            raise wrong(message, "acceleration_share")
        return self


class PointTrajectory(Timed):
    """Point to point between joint coordinates (n_points, n_q), resting at each (not if linear).

    `times` (s, one a point), or `duration` (s) of the whole, shared out between the segments.
    """

    points: Annotated[tuple[Coordinates, ...], Field(min_length=2)]
    times: Times | None = None
    duration: Annotated[float, DURATION] | None = None

    @model_validator(mode="after")
    def _has_one_clock(self) -> Self:
        if (self.times is None) == (self.duration is None):
            raise wrong("give either times (one per point) or duration, and not both")
        if self.times is not None and len(self.times) != len(self.points):
            raise wrong(f"{len(self.times)} times for {len(self.points)} points", "times")
        for k, (a, b) in enumerate(pairwise(self.points), 1):
            if a == b and self.times is None:
                message = "the same point as the one before it: give times instead of duration"
                raise wrong(message + " to wait there", "points", k)
        return self


class TipTrajectory(Timed):
    """A path of a link's node through waypoints (m), with timing law, duration (s) and samples.

    `angle` (planar) or `orientation` (spatial: R = Rz Ry Rx) of the tip's link in the world (rad):
    one that is kept, or one per waypoint. `branch` keeps joints within [low, high] (relative angle
    in rad, modulo 2π; or m); `start` is an optional first guess of q.
    """

    tip: str
    waypoints: Annotated[tuple[Vector, ...], Field(min_length=2)]
    angle: OneOrList[Angle, tuple[Angle, ...]] | None = None
    orientation: (
        Annotated[
            Annotated[Orientation, Tag("<one>")]
            | Annotated[tuple[Orientation, ...], Tag("<list>")],
            Discriminator(_nested_tag),
        ]
        | None
    ) = None
    path: Literal["spline", "straight"] = "spline"
    duration: Annotated[float, DURATION] = 1.0
    branch: ByReference[tuple[QValue, QValue]] = FrozenDict()
    start: Coordinates | None = None

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        for k, (a, b) in enumerate(pairwise(self.waypoints), 1):
            if a == b:
                raise wrong("the same point as the one before it", "waypoints", k)
        for joint, (low, high) in self.branch.items():
            if not low < high:
                raise wrong(f"low must be below high, got [{low:g}, {high:g}]", "branch", joint)
        return self

    @model_validator(mode="after")
    def _turns_at_each_waypoint(self) -> Self:
        many = {"angle": self.angle} if isinstance(self.angle, tuple) else {}
        if self.orientation is not None and isinstance(self.orientation[0], tuple):
            many["orientation"] = self.orientation  # type: ignore[assignment]
        for key, values in many.items():
            if len(values) != len(self.waypoints):
                message = (
                    f"{len(values)} for {len(self.waypoints)} waypoints: give one, or one per "
                )
                raise wrong(message + "waypoint", key)
        return self


MOTIONS: dict[str, type[AnyTrajectory]] = {
    "tip": TipTrajectory,
    "file": FileTrajectory,
    "q": SampledTrajectory,
    "points": PointTrajectory,
}  # by the key that only they have


def _motion_tag(value: object) -> str | None:
    keys = value if isinstance(value, Mapping) else getattr(type(value), "model_fields", {})
    return next((f"<{key}>" for key in MOTIONS if key in keys), None)


TrajectoryForm: TypeAlias = Annotated[
    Annotated[TipTrajectory, Tag("<tip>")]
    | Annotated[FileTrajectory, Tag("<file>")]
    | Annotated[SampledTrajectory, Tag("<q>")]
    | Annotated[PointTrajectory, Tag("<points>")],
    Discriminator(_motion_tag, "no_motion", "no key names a motion"),
]

MOST = 100  # trajectories of one case

TrajectoryForms: TypeAlias = OneOrList[
    TrajectoryForm,
    Annotated[tuple[TrajectoryForm, ...], Field(min_length=1, max_length=MOST)],
]


def named_trajectories(
    given: TrajectoryForm | tuple[TrajectoryForm, ...] | None,
) -> tuple[tuple[KeyPath, str, TrajectoryForm], ...]:
    """Key path, name and content of each trajectory, in the order of the file."""
    if given is None:
        return ()
    if not isinstance(given, tuple):
        return ((("trajectory",), given.name or "1", given),)
    return tuple((("trajectory", k), t.name or str(k + 1), t) for k, t in enumerate(given))
