"""The key `trajectory`: joint samples, a CSV file, point to point, or a path of a link's node.

It holds one of them, or a list. To add a kind: write its model, put it into the union
`TrajectoryForm`, and name the key by which it is known in `MOTIONS`.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field

from eigassign.case.reader import KeyPath, listed
from eigassign.case.schema.mechanism import QValue
from eigassign.case.schema.parts import (
    IN_PLANE,
    IN_SPACE,
    Angle,
    ByReference,
    File,
    FrozenDict,
    Mistakes,
    Name,
    OneOrList,
    Orientation,
    Part,
    Quantity,
    Told,
    ValueOr,
    Vector,
    mapping,
    quantity,
    wrong,
)
from eigassign.case.units import written

DURATION = quantity("time", above=0)
DURATION_PATH = "trajectory.duration"  # of the only trajectory, as a design parameter
TIME = quantity("time")


def _increasing(times: tuple[float, ...]) -> tuple[float, ...]:
    for k, (before, after) in enumerate(pairwise(times), 1):
        if after <= before:
            raise wrong(
                f"time must increase: {written(after, 's')} after {written(before, 's')}", k
            )
    return times


_UPWARDS = "low must be below high; a range of angles across zero is [350 deg, 370 deg]"
Times: TypeAlias = Annotated[
    tuple[Annotated[float, TIME], ...], Field(min_length=2), AfterValidator(_increasing)
]
Coordinates: TypeAlias = tuple[QValue, ...]
PropertyValue: TypeAlias = Annotated[
    float, Quantity(elsewhere="of the property's dimension, SI when bare")
]
Samples: TypeAlias = Annotated[int, Field(ge=2, le=100_000)]


Orientations: TypeAlias = Annotated[  # a triple of angles, or a list of them
    Orientation | tuple[Orientation, ...],
    Told(
        lambda value: (
            isinstance(value, (tuple, list)) and any(isinstance(v, (tuple, list)) for v in value)
        )
    ),
]


class Added(Part):
    """What a property has more along a trajectory than the file, or the design, gives it.

    Keys:
        add: the amount
    """

    add: PropertyValue


class AnyTrajectory(Part):
    """What every trajectory may have.

    Keys:
        name: of the trajectory; its place "1", "2", … unless given
        weight: what each of its seconds counts beside those of others
        set: properties of the mechanism by their paths, with the values they have along it, or
            `{add: amount}`, also to what is a design parameter
    """

    name: Name | None = None
    weight: Annotated[float, Quantity(above=0)] = 1.0
    set: ByReference[ValueOr[PropertyValue, Added]] = FrozenDict()


class SampledTrajectory(AnyTrajectory):
    """Samples of the coordinates; one alone is a pose at rest, which counts as a second.

    Keys:
        q: one value of each coordinate for each sample
        time: of each sample
        duration: instead of times: equal steps from 0
    """

    q: Annotated[tuple[Coordinates, ...], Field(min_length=1)]
    time: Times | None = None
    duration: Annotated[float, DURATION] | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if len(self.q) == 1:
            for key in {"time", "duration"} & self.model_fields_set:
                yield wrong("one sample is a pose at rest: leave the time out", key)
            return
        if (self.time is None) == (self.duration is None):
            yield wrong("give either time or duration" + ", and not both" * (self.time is not None))
        if self.time is not None and len(self.time) != len(self.q):
            yield wrong(f"{len(self.time)} times for {len(self.q)} samples of q", "time")


class FileTrajectory(AnyTrajectory):
    """Samples of the coordinates in a CSV file.

    Keys:
        file: relative to the case file; columns `time` and one for each coordinate; times of day
            count from the first one
        columns: what the header calls them, where that is something else: `{time: timestamp,
            q1: "actual_q_0 [deg]"}`
        rate: samples per second, where there is no column of time
    """

    file: File
    columns: ByReference[str] = FrozenDict()
    rate: Annotated[float, quantity("frequency", above=0)] | None = None


class Timed(AnyTrajectory):
    """What moves by a timing law: from rest to rest, but for `linear`, in equal steps of time.

    Keys:
        timing: `quintic`: no velocity and no acceleration at both ends; `cubic`: no velocity;
            `trapezoidal`: constant acceleration, constant velocity, braking, a third each;
            `linear`: constant velocity
        samples: their number
    """

    timing: Literal["quintic", "cubic", "trapezoidal", "linear"] = "quintic"
    samples: Samples = 101


class PointTrajectory(Timed):
    """Point to point between poses, with a rest at each unless `timing` is linear.

    Keys:
        points: one value of each coordinate for each point
        times: of each point
        duration: instead of times: of the whole. Each segment gets a share in proportion to its
            largest move of a coordinate, relative to that coordinate's range
    """

    points: Annotated[tuple[Coordinates, ...], Field(min_length=2)]
    times: Times | None = None
    duration: Annotated[float, DURATION] | None = None
    one_of = ("times", "duration")

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.times is not None and len(self.times) != len(self.points):
            yield wrong(f"{len(self.times)} times for {len(self.points)} points", "times")
        for k, (a, b) in enumerate(pairwise(self.points), 1):
            if a == b and self.times is None:
                message = "the same point as the one before it: give times instead of duration"
                yield wrong(message + " to wait there", "points", k)


class TipTrajectory(Timed):
    """A path of a node of any link through waypoints.

    Keys:
        tip: the node, `<link>.<node>`
        waypoints: places of the node
        angle: of the tip's link in the world, in a plane; one, or one for each waypoint
        orientation: the same in space, `[rx, ry, rz]`, R = Rz Ry Rx
        path: a smooth curve, or straight lines
        duration: of the whole
        branch: by joint, `[low, high]`: the range of relative angle, or of place, in which the
            solution must stay
        start: first guess of q
    """

    tip: str
    waypoints: Annotated[tuple[Vector, ...], Field(min_length=2)]
    angle: Annotated[OneOrList[Angle, tuple[Angle, ...]] | None, IN_PLANE] = None
    orientation: Annotated[Orientations | None, IN_SPACE] = None
    path: Literal["spline", "straight"] = "spline"
    duration: Annotated[float, DURATION] = 1.0
    branch: ByReference[tuple[QValue, QValue]] = FrozenDict()
    start: Coordinates | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        for k, (a, b) in enumerate(pairwise(self.waypoints), 1):
            if a == b:
                yield wrong("the same point as the one before it", "waypoints", k)
        for joint, (low, high) in self.branch.items():
            if low >= high:
                yield wrong(_UPWARDS, "branch", joint)
        many = {"angle": self.angle} if isinstance(self.angle, tuple) else {}
        if self.orientation is not None and isinstance(self.orientation[0], tuple):
            many["orientation"] = self.orientation  # type: ignore[assignment]
        for key, values in many.items():
            if len(values) != len(self.waypoints):
                message = (
                    f"{len(values)} for {len(self.waypoints)} waypoints: give one, or one per "
                )
                yield wrong(message + "waypoint", key)


MOTIONS = ("tip", "file", "q", "points")  # the keys that only they have


def _which_motion(value: object) -> int:
    given = mapping(value)
    for k, key in enumerate(MOTIONS):
        if key in given:
            return k
    raise wrong(
        "expected one of the keys tip (path of a link's node), points (point to point), q (joint "
        f"samples) or file (CSV); got {listed(given)}"
    )


TrajectoryForm: TypeAlias = Annotated[
    TipTrajectory | FileTrajectory | SampledTrajectory | PointTrajectory, Told(_which_motion)
]

TrajectoryForms: TypeAlias = OneOrList[
    TrajectoryForm,
    Annotated[tuple[TrajectoryForm, ...], Field(min_length=1, max_length=100)],
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
