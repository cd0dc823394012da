"""Values that are allowed but look like a slip: wrong exponent, forgotten unit, misprint.

Warnings only. Each limit is wide enough that real mechanisms stay inside; the reasons stand beside
the limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from eigassign.case.document import Document
from eigassign.case.freedoms import freedom_of
from eigassign.case.joined_twice import joined_twice
from eigassign.case.mechanism_parts import Coordinate, Mechanism
from eigassign.case.plausible_parts import implausible_parts, outside
from eigassign.case.study_parts import FrequencyProfile
from eigassign.case.trajectory_list import named_trajectories
from eigassign.case.trajectory_parts import (
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    Trajectory,
)
from eigassign.case.yaml_reader import Finding, KeyPath

LARGEST_ANGLE = 4 * math.pi  # rad: two turns; a bare 30 was meant in degrees
FREQUENCY = (1e-3, 1e6)  # Hz
LARGEST_ERROR = 0.5  # a tolerance of 2 was meant as 2 %


def implausible(document: Document) -> Iterator[Finding]:
    """Everything in a valid document that is probably not meant."""
    yield from implausible_parts(document)
    yield from _angles(document)
    yield from _idle_mountings(document)
    yield from joined_twice(document.mechanism.joints)
    yield from _goals(document)


def _angles(document: Document) -> Iterator[Finding]:
    for name, joint in document.mechanism.joints.items():
        yield from _turned([joint.angle], ("mechanism", "joints", name, "angle"))
        turn = joint.orientation or ()
        yield from _turned(turn, ("mechanism", "joints", name, "orientation"))
    if document.expansion.q != "auto":
        yield from _turned(_angular(document, document.expansion.q), ("expansion", "q"))
    for path, _, motion in named_trajectories(document.trajectory):
        yield from _along(document, motion, path)


def _along(document: Document, motion: Trajectory, path: KeyPath) -> Iterator[Finding]:
    if isinstance(motion, SampledTrajectory):
        samples = (v for row in motion.q for v in _angular(document, row))
        yield from _turned(samples, (*path, "q"))
    if isinstance(motion, PointTrajectory):
        points = (v for row in motion.points for v in _angular(document, row))
        yield from _turned(points, (*path, "points"))
    if isinstance(motion, TipTrajectory):
        yield from _turned(_flat(motion.angle), (*path, "angle"))
        yield from _turned(_flat(motion.orientation), (*path, "orientation"))
        if motion.start is not None:
            yield from _turned(_angular(document, motion.start), (*path, "start"))
        for name, interval in motion.branch.items():
            if document.mechanism.joints[name].type == "revolute":
                yield from _turned(interval, (*path, "branch", name))


def _idle_mountings(document: Document) -> Iterator[Finding]:
    """An absolute angle is counted from the x axis, wherever the joint's own zero is."""
    for name, coordinate in document.coordinates.items():
        if coordinate.angle == "absolute" and document.mechanism.joints[coordinate.joint].angle:
            message = f"has no effect: coordinate {name!r} is absolute, counted from the x axis"
            yield ("mechanism", "joints", coordinate.joint, "angle"), message


def _angular(document: Document, q: Sequence[float]) -> list[float]:
    """The entries of q that are angles, screws apart: those turn many times."""
    kinds = [_is_angle(document.mechanism, c) for c in document.coordinates.values()]
    return [value for value, angle in zip(q, kinds, strict=True) if angle]


def _is_angle(mechanism: Mechanism, coordinate: Coordinate) -> bool:
    kind = mechanism.joints[coordinate.joint].type
    return kind != "screw" and freedom_of(kind, coordinate.component) != "translation"


def _flat(value: object) -> Iterator[float]:
    """The numbers of a nest of tuples."""
    if isinstance(value, tuple):
        for inner in value:
            yield from _flat(inner)
    elif isinstance(value, (int, float)):
        yield value


def _turned(angles: Iterable[float], path: KeyPath) -> Iterator[Finding]:
    worst = max((abs(angle) for angle in angles), default=0.0)
    if worst > LARGEST_ANGLE:
        yield path, f"{worst:g} rad is more than two turns: was it meant in deg?"


def _goals(document: Document) -> Iterator[Finding]:
    for k, target in enumerate(document.targets):
        wanted = target.frequency
        values = wanted.frequency if isinstance(wanted, FrequencyProfile) else (wanted,)
        for value in (min(values), max(values)):
            yield from outside(value, FREQUENCY, ("targets", k, "frequency"), "Hz")
    if document.validation.max_error > LARGEST_ERROR:
        percent = 100 * document.validation.max_error
        yield ("validation", "max_error"), f"this is {percent:g} %; write the % if it was meant so"
    if document.expansion.y != "auto":
        bounds = document.design.parameters.items()
        for k, (value, (name, p)) in enumerate(zip(document.expansion.y, bounds, strict=True)):
            if not p.min <= value <= p.max:
                message = f"{value:g} is outside the bounds of {name!r}, [{p.min:g}, {p.max:g}]"
                yield ("expansion", "y", k), message
