"""How the mechanism moves and what may change: trajectory, expansion point, design."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.rules.lookups import coordinate_lists, freedoms, moving, places
from eigassign.case.schema.design import Choices
from eigassign.case.schema.document import Document
from eigassign.case.schema.joints import RevoluteJoint
from eigassign.case.schema.trajectory import TipTrajectory, named_trajectories
from eigassign.case.suggestions import listed, unknown

# --- Lists with one entry for each coordinate or design parameter


def lists_have_an_entry_for_each_coordinate(document: Document) -> Iterator[Finding]:
    """Points of trajectories and other poses are as long as q."""
    for path, row in coordinate_lists(document):
        yield from _one_for_each(row, path, "coordinate", document.coordinates)


def expansion_point_has_an_entry_for_each_parameter(document: Document) -> Iterator[Finding]:
    """`expansion.y` is as long as the design."""
    y, path = document.expansion.y, ("expansion", "y")
    yield from _one_for_each(y, path, "design parameter", document.design.parameters)


def _one_for_each(
    value: object, path: KeyPath, kind: str, known: Collection[str]
) -> Iterator[Finding]:
    if isinstance(value, tuple) and len(value) != len(known):
        message = f"needs {len(known)} entries, one for each {kind} ({listed(known)}); got "
        yield path, f"{message}{len(value)}"


# --- Trajectories


def trajectories_have_names_of_their_own(document: Document) -> Iterator[Finding]:
    """No two names agree but for case: they name files, and some file systems ignore it."""
    seen: dict[str, str] = {}
    for path, _, motion in named_trajectories(document.trajectory):
        if motion.name is None:
            continue
        if same := seen.get(motion.name.casefold()):
            ignored = f": {same!r} (some file systems ignore upper case)"
            hint = "" if same == motion.name else ignored
            yield (*path, "name"), f"a trajectory has this name already{hint}"
        seen.setdefault(motion.name.casefold(), motion.name)


def branches_are_ranges_of_driven_joints(document: Document) -> Iterator[Finding]:
    """A range that keeps a tip path in its branch is that of a joint which a coordinate moves."""
    mechanism = document.mechanism
    ranged = [name for name in moving(mechanism) if len(freedoms(mechanism, name) or ()) == 1]
    driven = {body.joint for body in document.coordinates.values()}
    for place, _, motion in named_trajectories(document.trajectory):
        for joint, (low, high) in (
            motion.branch.items() if isinstance(motion, TipTrajectory) else ()
        ):
            path: KeyPath = (*place, "branch", joint)
            if joint not in ranged:
                yield path, unknown("joint with one freedom", joint, ranged)
            elif joint not in driven:
                known = listed([name for name in ranged if name in driven])
                yield path, f"no coordinate moves this joint, but the loop does; use {known}"
            elif isinstance(mechanism.joints[joint], RevoluteJoint) and high - low > 2 * math.pi:
                yield path, "wider than one turn (an angle is in rad when bare; or write deg)"


# --- Design


def parameters_vary_different_properties(document: Document) -> Iterator[Finding]:
    """Components of the design have properties of their own."""
    owner: dict[str, str] = {}
    for name, own in places(document.design).items():
        for path, place in own.items():
            if path in owner:
                yield place, f"{path} is a design parameter already: {owner[path]!r}"
            owner.setdefault(path, name)


def bounds_go_upwards(document: Document) -> Iterator[Finding]:
    """No minimum is above its maximum."""
    design = document.design
    limited: dict[KeyPath, object] = {("design", name): e for name, e in design.entries.items()}
    limited |= {("design", "constraints", name): c for name, c in design.constraints.items()}
    limited |= {("design", "mass"): design.mass}
    for path, part in limited.items():
        low, high = getattr(part, "min", None), getattr(part, "max", None)
        if low is not None and high is not None and low > high:
            yield (*path, "min"), f"min {low:g} is above max {high:g} (SI units)"


def limited_drives_are_of_coordinates(document: Document) -> Iterator[Finding]:
    """The drives under `design.torque` are named by their coordinates."""
    for name in document.design.torque:
        if name not in document.coordinates:
            yield ("design", "torque", name), unknown("coordinate", name, document.coordinates)


def constraints_are_between_design_parameters(document: Document) -> Iterator[Finding]:
    """The terms of a constraint name design parameters."""
    entries = document.design.entries
    known = [name for name, entry in entries.items() if not isinstance(entry, Choices)]
    for name, constraint in document.design.constraints.items():
        for term in constraint.terms:
            if term in known:
                continue
            message = unknown("design parameter", term, known)
            if term in entries:
                message = f"{term!r} is a list of choices; a constraint is between parameters"
            yield ("design", "constraints", name, "terms", term), message
