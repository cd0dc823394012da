"""What the names in a case stand for: nodes, freedoms of joints, properties of the design.

Where a name stands for nothing the answer is None or empty: the rule for that name says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from eigassign.case.reader import KeyPath, listed, shown, suggestion, unknown
from eigassign.case.schema.design import Choices, Design, column_names
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import BeamLink, FrameBeam, FrameLink, Link, RigidLink
from eigassign.case.schema.mechanism import FREEDOMS, Coordinate, Mechanism
from eigassign.case.schema.parts import ANGLE, PLACE, Quantity
from eigassign.case.schema.targets import FollowedMode, GapTarget
from eigassign.case.schema.trajectory import (
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    named_trajectories,
)

ANY = Quantity()  # dimension unknown because of an error elsewhere


# --- Links and their nodes


def beams(mechanism: Mechanism) -> Iterator[tuple[KeyPath, BeamLink | FrameBeam]]:
    """Key path and content of every beam: links that are one, and those of frames."""
    for name, link in mechanism.links.items():
        path: KeyPath = ("mechanism", "links", name)
        if isinstance(link, BeamLink):
            yield path, link
        if isinstance(link, FrameLink):
            yield from (((*path, "beams", beam), own) for beam, own in link.beams.items())


def node_names(link: Link) -> list[str]:
    """Nodes of one link."""
    if isinstance(link, BeamLink):
        return ["start", "end"]
    if not isinstance(link, RigidLink):
        return list(link.nodes)
    implied = ["start"] if link.length is None else ["start", "end"]
    return list(dict.fromkeys([*implied, *link.nodes]))


def node_problem(mechanism: Mechanism, value: str, also: str = "") -> str | None:
    """The mistake in ``value`` as `<link>.<node>`; ``also`` may stand there too."""
    link, _, node = value.partition(".")
    or_else = [also] if also else []
    if link not in mechanism.links:
        expected = f"{also}, " if also else ""
        return (
            f"{unknown('link', link, [*or_else, *mechanism.links])}; expected {expected}"
            "'<link>.start', '<link>.end' or another node"
        )
    nodes = node_names(mechanism.links[link])
    if node in nodes:
        return None
    few = [repr(f"{link}.{name}") for name in nodes]
    spelt = few if len(nodes) <= 6 else [f"'{link}.<node>' ({listed(nodes)})"]
    expected = " or ".join([*or_else, *spelt])
    return f"expected {expected}, got {shown(value)}{suggestion(node, nodes)}"


# --- Joints and coordinates


def freedoms(mechanism: Mechanism, joint: str) -> tuple[str, ...] | None:
    """Names of a joint's freedoms, in order; None if there is no such joint."""
    found = mechanism.joints.get(joint)
    return None if found is None else FREEDOMS[found.type]


def moving(mechanism: Mechanism) -> list[str]:
    """Names of the joints that are not fixed."""
    return [name for name in mechanism.joints if freedoms(mechanism, name)]


def driven(mechanism: Mechanism, coordinate: Coordinate | None) -> str | None:
    """The freedom of its joint that a coordinate is; None where that cannot be told."""
    known = (freedoms(mechanism, coordinate.joint) if coordinate else None) or ()
    if coordinate is None or coordinate.component is None:
        return known[0] if len(known) == 1 else None
    return str(coordinate.component) if str(coordinate.component) in known else None


def guessed(document: Document, joint: str, count: int) -> tuple[str, ...] | None:
    """The freedoms that a list of ``count`` guesses of a joint gives: all of them, or the passive.

    None if there is no such joint, or no list of this length can be meant.
    """
    known = freedoms(document.mechanism, joint)
    if known is None or count == len(known):
        return known
    own = [body for body in document.coordinates.values() if body.joint == joint]
    taken = {driven(document.mechanism, body) for body in own}
    passive = tuple(freedom for freedom in known if freedom not in taken)
    return passive if count == len(passive) else None


def of_freedom(freedom: str | None) -> Quantity:
    """Angle or length; anything where the freedom is unknown."""
    if freedom is None:
        return ANY
    return PLACE if freedom == "translation" else ANGLE


def coordinate_lists(document: Document) -> Iterator[tuple[KeyPath, Sequence[float]]]:
    """Key path and content of whatever has an entry for each coordinate."""
    if isinstance(document.expansion.q, tuple):
        yield ("expansion", "q"), document.expansion.q
    for path, _, motion in named_trajectories(document.trajectory):
        if isinstance(motion, SampledTrajectory):
            yield from (((*path, "q", k), row) for k, row in enumerate(motion.q))
        if isinstance(motion, PointTrajectory):
            yield from (((*path, "points", k), row) for k, row in enumerate(motion.points))
        if isinstance(motion, TipTrajectory) and motion.start is not None:
            yield (*path, "start"), motion.start
    for path, mode in followed_modes(document):
        if mode.at.q is not None:
            yield (*path, "at", "q"), mode.at.q
    if isinstance(document.measurements, tuple):
        for k, measured in enumerate(document.measurements):
            if measured.q is not None:
                yield ("measurements", k, "q"), measured.q


# --- Design parameters and targets


def places(design: Design) -> dict[str, dict[str, KeyPath]]:
    """Where the file names the properties of each component of y, by their paths."""
    found: dict[str, dict[str, KeyPath]] = {}
    for name, entry in design.entries.items():
        if isinstance(entry, Choices):
            first: KeyPath = ("design", name, "choices", next(iter(entry.choices)))
            columns = column_names(name, entry.properties)
            for column, path in zip(columns, entry.properties, strict=True):
                found[column] = {path: (*first, path)}
        elif isinstance(entry.parameter, str):
            found[name] = {entry.parameter: ("design", name, "parameter")}
        else:
            found[name] = {}
            for k, own in enumerate(entry.parameter):
                place: KeyPath = ("design", name, "parameter", k)
                found[name] |= (
                    {own: place} if isinstance(own, str) else {p: (*place, p) for p in own}
                )
    return found


def followed_modes(document: Document) -> list[tuple[KeyPath, FollowedMode]]:
    """Key path and content of every mode that is named by its shape."""
    found: list[tuple[KeyPath, object]] = []
    for k, target in enumerate(document.targets):
        found.append((("targets", k, "mode"), getattr(target, "mode", None)))
        if isinstance(target, GapTarget):
            pair = enumerate(target.gap.between)
            found += ((("targets", k, "gap", "between", i), mode) for i, mode in pair)
    return [(path, mode) for path, mode in found if isinstance(mode, FollowedMode)]
