"""How the mechanism moves and what may change: trajectory, expansion point, design."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, names, text
from eigassign.case.rules.lookups import (
    choices,
    columns,
    coordinate_lists,
    design_entries,
    freedoms,
    moving,
    number,
    trajectories,
)
from eigassign.case.schema.design import is_entry
from eigassign.case.schema.parts import ANGLE
from eigassign.case.suggestions import listed, unknown

# --- Lists with one entry for each coordinate or design parameter


def lists_have_an_entry_for_each_coordinate(tree: Tree) -> Iterator[Finding]:
    """Points of trajectories and other poses are as long as q, and so is the validated box."""
    q = names(tree, "coordinates")
    for path, listed_values in coordinate_lists(tree):
        yield from _one_for_each(listed_values, path, "coordinate", q)


def expansion_point_has_an_entry_for_each_parameter(tree: Tree) -> Iterator[Finding]:
    """`expansion.y` is as long as the design."""
    y = [column.name for column in columns(tree)]
    path = ("expansion", "y")
    yield from _one_for_each(at(tree, *path), path, "design parameter", y)


def _one_for_each(
    value: object, path: KeyPath, kind: str, known: Sequence[str]
) -> Iterator[Finding]:
    if isinstance(value, tuple) and len(value) != len(known):
        message = f"needs {len(known)} entries, one for each {kind} ({listed(known)}); got "
        yield path, f"{message}{len(value)}"


# --- Trajectories


def trajectories_have_names_of_their_own(tree: Tree) -> Iterator[Finding]:
    """No two names agree but for case: they name files, and some file systems ignore it."""
    seen: dict[str, str] = {}
    for path, body in trajectories(tree):
        name = text(body, "name")
        if name is None:
            continue
        if same := seen.get(name.casefold()):
            hint = "" if same == name else f": {same!r} (some file systems ignore upper case)"
            yield (*path, "name"), f"a trajectory has this name already{hint}"
        seen.setdefault(name.casefold(), name)


def branches_are_ranges_of_driven_joints(tree: Tree) -> Iterator[Finding]:
    """A range that keeps a tip path in its branch is that of a joint which a coordinate moves."""
    ranged = [name for name in moving(tree) if len(freedoms(tree, name) or ()) == 1]
    driven = {text(body, "joint") for _, body in items(tree, "coordinates")}
    for place, body in trajectories(tree):
        for joint in names(body, "branch"):
            path: KeyPath = (*place, "branch", joint)
            if joint not in ranged:
                yield path, unknown("joint with one freedom", joint, ranged)
            elif joint not in driven:
                known = listed([name for name in ranged if name in driven])
                yield path, f"no coordinate moves this joint, but the loop does; use {known}"
            elif text(tree, "mechanism", "joints", joint, "type") == "revolute":
                ends = [number(v, ANGLE) for v in entries(body, "branch", joint)]
                low, high = ends if len(ends) == 2 else (None, None)
                if low is not None and high is not None and high - low > 2 * math.pi:
                    yield path, "wider than one turn (an angle is in rad when bare; or write deg)"


# --- Design


def parameters_vary_different_properties(tree: Tree) -> Iterator[Finding]:
    """Components of the design have properties of their own."""
    owner: dict[str, str] = {}
    for column in columns(tree):
        name, entry = column.name, str(column.place[1])
        if column.parameter is None and entry.lower().startswith("constraint"):
            yield ("design", entry), "did you mean the reserved key 'constraints'?"
        for path, place in column.properties:
            if path in owner and owner[path] != name:
                yield place, f"{path} is a design parameter already: {owner[path]!r}"
            owner.setdefault(path, name)


def limited_drives_are_of_coordinates(tree: Tree) -> Iterator[Finding]:
    """The drives under `design.torque` are named by their coordinates."""
    known, limits = names(tree, "coordinates"), at(tree, "design", "torque")
    for name in () if is_entry(limits) else names(limits):
        if name not in known:
            yield ("design", "torque", name), unknown("coordinate", name, known)


def constraints_are_between_design_parameters(tree: Tree) -> Iterator[Finding]:
    """The terms of a constraint name design parameters."""
    known = [name for name, body in design_entries(tree) if choices(body) is None]
    for name, body in items(tree, "design", "constraints"):
        for term in names(body, "terms"):
            if term in known:
                continue
            message = unknown("design parameter", term, known)
            if choices(at(tree, "design", term)) is not None:
                message = f"{term!r} is a list of choices; a constraint is between parameters"
            yield ("design", "constraints", name, "terms", term), message
