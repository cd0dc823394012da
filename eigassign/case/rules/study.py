"""How the mechanism moves and what is asked of it: the keys behind `mechanism`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, names, text
from eigassign.case.rules.lookups import (
    freedoms,
    moving,
    number,
    parameters,
    trajectories,
    trajectory_names,
)
from eigassign.case.schema.trajectory import DURATION, TIME, TipTrajectory
from eigassign.case.schema.vectors import ANGLE
from eigassign.case.suggestions import listed, shown, unknown

# --- Lists with one entry for each coordinate or design parameter


def lists_have_an_entry_for_each_coordinate(tree: Tree) -> Iterator[Finding]:
    """Points of a trajectory, the expansion point and the validated box are as long as q."""
    q = names(tree, "coordinates")
    for path, body in trajectories(tree):
        for key in ("q", "points"):
            for k, row in enumerate(entries(body, key)):
                yield from _one_for_each(row, (*path, key, k), "coordinate", q)
        yield from _one_for_each(at(body, "start"), (*path, "start"), "coordinate", q)
    for place in (("validation", "q_span"), ("expansion", "q")):
        yield from _one_for_each(at(tree, *place), place, "coordinate", q)


def expansion_point_has_an_entry_for_each_parameter(tree: Tree) -> Iterator[Finding]:
    """`expansion.y` is as long as the design."""
    y = [name for name, _ in parameters(tree)]
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
            hint = "" if same == name else f": {same!r} (they name files, where case may be lost)"
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
                yield path, f"no coordinate moves this joint (mechanism.assembly does); use {known}"
            elif text(tree, "mechanism", "joints", joint, "type") == "revolute":
                ends = [number(v, ANGLE) for v in entries(body, "branch", joint)]
                low, high = ends if len(ends) == 2 else (None, None)
                if low is not None and high is not None and high - low > 2 * math.pi:
                    yield path, "wider than one turn (an angle is in rad when bare; or write deg)"


# --- Design, expansion and targets


def parameters_vary_different_properties(tree: Tree) -> Iterator[Finding]:
    """Each design parameter has a property of its own."""
    owner: dict[str, str] = {}
    for name, body in parameters(tree):
        path = text(body, "parameter")
        if path is None:
            if name.lower().startswith("constraint"):
                yield ("design", name), "did you mean the reserved key 'constraints'?"
        elif path in owner:
            message = f"{path} is a design parameter already: {owner[path]!r}"
            yield ("design", name, "parameter"), message
        else:
            owner[path] = name


def constraints_are_between_design_parameters(tree: Tree) -> Iterator[Finding]:
    """The terms of a constraint name design parameters."""
    known = [name for name, _ in parameters(tree)]
    for name, body in items(tree, "design", "constraints"):
        for term in names(body, "terms"):
            if term not in known:
                message = unknown("design parameter", term, known)
                yield ("design", "constraints", name, "terms", term), message


def expanded_modes_differ(tree: Tree) -> Iterator[Finding]:
    """No mode is listed twice."""
    seen: set[int] = set()
    for k, mode in enumerate(entries(tree, "expansion", "modes")):
        if isinstance(mode, int):
            if mode in seen:
                yield ("expansion", "modes", k), f"mode {shown(mode)} is listed twice"
            seen.add(mode)


def targets_are_for_expanded_modes_once_each(tree: Tree) -> Iterator[Finding]:
    """A target names a trajectory that exists and an expanded mode; a mode has one along each."""
    expanded = entries(tree, "expansion", "modes")
    known, seen = trajectory_names(tree), set[tuple[int, str]]()
    for k, target in enumerate(entries(tree, "targets")):
        mode, where = at(target, "mode"), text(target, "trajectory")
        path: KeyPath = ("targets", k, "mode")
        if where is not None and where not in known:
            yield ("targets", k, "trajectory"), unknown("trajectory", where, known)
            continue
        if not isinstance(mode, int) or mode < 1:
            continue
        along = {(mode, name) for name in ([where] if where else known or [""])}
        if both := sorted(name for _, name in along & seen):
            which = f" along trajectory {both[0]!r}" if len(known) > 1 else ""
            yield path, f"mode {mode} has a target already{which}"
        elif expanded and mode not in expanded:
            yield path, f"mode {mode} is not among expansion.modes: add it there, or leave it auto"
        seen |= along


# --- Frequencies that change in time are wanted for the whole motion

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def profiles_cover_their_trajectories(tree: Tree) -> Iterator[Finding]:
    """A profile reaches from the first to the last time of every trajectory that it is for."""
    motions = [
        (name, _duration(body))
        for name, (_, body) in zip(trajectory_names(tree), trajectories(tree), strict=True)
    ]
    for k, target in enumerate(entries(tree, "targets")):
        span, where = _span(at(target, "frequency", "time")), text(target, "trajectory")
        for name, motion in motions:
            if span is None or motion is None or where not in (None, name):
                continue
            slack = _SLACK * (motion[1] - motion[0])
            if span[0] > motion[0] + slack or span[1] < motion[1] - slack:
                which = f"trajectory {name!r}" if len(motions) > 1 else "the trajectory"
                yield (
                    ("targets", k, "frequency", "time"),
                    f"covers {span[0]:g} … {span[1]:g} s only; "
                    f"{which} lasts from {motion[0]:g} to {motion[1]:g} s",
                )


def _duration(trajectory: object) -> tuple[float, float] | None:
    """First and last time of a trajectory, s; None where the file does not say (in a CSV file)."""
    for key in ("time", "times"):
        if at(trajectory, key) is not None:
            return _span(at(trajectory, key))
    given = at(trajectory, "duration")
    if given is None and at(trajectory, "tip") is not None:
        given = TipTrajectory.model_fields["duration"].default
    duration = number(given, DURATION)
    return None if duration is None else (0.0, duration)


def _span(times: object) -> tuple[float, float] | None:
    if not isinstance(times, tuple) or not times:
        return None
    first, last = number(times[0], TIME), number(times[-1], TIME)
    return None if first is None or last is None or last < first else (first, last)
