"""The key `trajectory`: joint samples, a CSV file of them, or a path of a link's end."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.mechanism_parts import Q_VALUE
from eigassign.case.quantity import Frozen, FrozenDict, Part, quantity, wrong
from eigassign.case.vectors import Vector

DURATION = quantity("time", above=0)
TIME = quantity("time")
Times: TypeAlias = Annotated[tuple[Annotated[float, TIME], ...], Field(min_length=2)]
Coordinates: TypeAlias = tuple[Annotated[float, Q_VALUE], ...]


def increasing(time: tuple[float, ...]) -> None:
    """Raises ValueError at the first of the times (s) that does not come after its predecessor."""
    for k, (before, after) in enumerate(pairwise(time), 1):
        if after <= before:
            raise wrong(f"time must increase: {after:g} s after {before:g} s", "time", k)


class SampledTrajectory(Part):
    """Joint samples: q (n_samples, n_q); `time` (s), or `duration` (s) for equal steps from 0."""

    q: Annotated[tuple[Coordinates, ...], Field(min_length=2)]
    time: Times | None = None
    duration: Annotated[float, DURATION] | None = None

    @model_validator(mode="after")
    def _has_one_clock(self) -> SampledTrajectory:
        if (self.time is None) == (self.duration is None):
            raise wrong("give either time (one per sample) or duration, and not both")
        if self.time is not None and len(self.time) != len(self.q):
            raise wrong(f"{len(self.time)} times for {len(self.q)} samples of q", "time")
        increasing(self.time or ())
        return self


class FileTrajectory(Part):
    """Joint samples in a CSV file: columns `time` (s) and one per coordinate (rad, or [deg])."""

    file: str


class TipTrajectory(Part):
    """A path of a link's end through waypoints (m), with timing law, duration (s) and samples.

    `branch` keeps joints within [low, high] (relative angle in rad, modulo 2π; or m); `start` is an
    optional first guess of q.
    """

    tip: str
    waypoints: Annotated[tuple[Vector, ...], Field(min_length=2)]
    path: Literal["spline", "straight"] = "spline"
    timing: Literal["quintic", "cubic", "linear"] = "quintic"
    duration: Annotated[float, DURATION] = 1.0
    samples: Annotated[int, Field(ge=2, le=100_000)] = 101
    branch: Annotated[
        Mapping[str, tuple[Annotated[float, Q_VALUE], Annotated[float, Q_VALUE]]], Frozen
    ] = FrozenDict()
    start: Coordinates | None = None

    @model_validator(mode="after")
    def _goes_somewhere(self) -> TipTrajectory:
        for k, (a, b) in enumerate(pairwise(self.waypoints), 1):
            if a == b:
                raise wrong("the same point as the one before it", "waypoints", k)
        for joint, (low, high) in self.branch.items():
            if not low < high:
                raise wrong(f"low must be below high, got [{low:g}, {high:g}]", "branch", joint)
        return self


def _trajectory_tag(value: object) -> str | None:
    keys = value if isinstance(value, Mapping) else getattr(type(value), "model_fields", {})
    tags = {"tip": "<tip>", "file": "<file>", "q": "<samples>"}
    return next((tag for key, tag in tags.items() if key in keys), None)


Trajectory: TypeAlias = Annotated[
    Annotated[TipTrajectory, Tag("<tip>")]
    | Annotated[FileTrajectory, Tag("<file>")]
    | Annotated[SampledTrajectory, Tag("<samples>")],
    Discriminator(_trajectory_tag, custom_error_type="choice:motion", custom_error_message="-"),
]
