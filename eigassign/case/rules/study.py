"""How the mechanism moves, what may change, what is asked of the frequencies, and where."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from eigassign.case.reader import Finding, KeyPath, listed, shown, unknown
from eigassign.case.rules.lookups import (
    coordinate_lists,
    followed_modes,
    freedoms,
    moving,
    node_problem,
    places,
)
from eigassign.case.schema.design import Choices
from eigassign.case.schema.document import Document
from eigassign.case.schema.mechanism import RevoluteJoint
from eigassign.case.schema.study import Highest, HighestMode, Measurement
from eigassign.case.schema.targets import (
    FrequencyFile,
    FrequencyProfile,
    FrequencyTarget,
    GapTarget,
    KeepOutTarget,
    Pose,
    SagTarget,
    StaticTarget,
)
from eigassign.case.schema.trajectory import (
    FileTrajectory,
    SampledTrajectory,
    TipTrajectory,
    TrajectoryForm,
    named_trajectories,
)

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


Span = tuple[float, float]  # first and last time, s


def targets_are_on_trajectories(document: Document) -> Iterator[Finding]:
    """A target names a trajectory that exists, and a part of it that it has."""
    motions = _motions(document)
    for k, target in enumerate(document.targets):
        name, span = target.trajectory, target.during
        if name is not None and name not in motions:
            yield ("targets", k, "trajectory"), unknown("trajectory", name, motions)
            continue
        if span is None:
            continue
        path: KeyPath = ("targets", k, "during")
        if name is None and len(motions) > 1:
            yield path, f"needs the trajectory that is meant, as trajectory ({listed(motions)})"
            continue
        motion = motions.get(name or next(iter(motions), ""))
        if motion is not None and not (motion[0] <= span[1] and span[0] <= motion[1]):
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield path, f"lies outside: {lasts}"


def statics_are_of_nodes(document: Document) -> Iterator[Finding]:
    """The node of a static target exists, and what sags has a weight."""
    mechanism = document.mechanism
    for k, target in enumerate(document.targets):
        if not isinstance(target, StaticTarget):
            continue
        if problem := node_problem(mechanism, target.place.at):
            yield ("targets", k, target.kind, "at"), problem
        if isinstance(target, SagTarget) and not isinstance(mechanism.gravity, tuple):
            down = "[0, -9.81]" if mechanism.space == "planar" else "[0, 0, -9.81]"
            yield ("targets", k, "sag"), f"nothing sags without mechanism.gravity: {down}, say"


def a_mode_has_one_frequency_at_a_time(document: Document) -> Iterator[Finding]:
    """No two targets want frequencies of the same mode on the same part of a trajectory."""
    known, seen = list(_motions(document)), dict[tuple[int, str], list[Span | None]]()
    for k, target in enumerate(document.targets):
        if not isinstance(target, FrequencyTarget):
            continue
        span, own = target.during, list[tuple[int, str]]()
        for i, mode in enumerate(target.numbers if not target.followed else ()):
            names = [target.trajectory] if target.trajectory else known or [""]
            both = sorted(
                name
                for name in names
                for other in seen.get((mode, name), ())
                if span is None or other is None or (span[0] < other[1] and other[0] < span[1])
            )
            if both:
                which = f" along trajectory {both[0]!r}" if len(known) > 1 else ""
                place: KeyPath = ("mode",) if target.modes is None else ("modes", i)
                yield ("targets", k, *place), f"mode {mode} has a target already{which}"
            own += [(mode, name) for name in names]
        for one in own:
            seen.setdefault(one, []).append(span)


def followed_modes_are_at_a_pose(document: Document) -> Iterator[Finding]:
    """A mode named by its shape has a pose of the mechanism and a possible design."""
    entries = document.design.entries
    for path, mode in followed_modes(document):
        yield from _no_pose(document, (*path, "at"), mode.at)
        for name, value in mode.design.items():
            place, entry = (*path, "design", name), entries.get(name)
            if entry is None:
                yield place, unknown("design parameter", name, entries)
            elif isinstance(entry, Choices) and not isinstance(value, str):
                yield (
                    place,
                    f"expected one of the choices {listed(entry.choices)}, got {shown(value)}",
                )
            elif isinstance(entry, Choices) and value not in entry.choices:
                yield place, unknown("choice", str(value), entry.choices)


def measurements_are_at_poses(document: Document) -> Iterator[Finding]:
    """Measurements of a list were made at a time of a trajectory, or with a value for each q."""
    measured = document.measurements
    for k, each in enumerate(measured if isinstance(measured, tuple) else ()):
        yield from _no_pose(document, ("measurements", k), each)


def _no_pose(document: Document, path: KeyPath, pose: Pose | Measurement) -> Iterator[Finding]:
    """Mistakes that keep `time` and `trajectory` of a part from being a pose of the mechanism."""
    motions, where, time = _motions(document), pose.trajectory, pose.time
    if where is not None and where not in motions:
        yield (*path, "trajectory"), unknown("trajectory", where, motions)
    elif time is not None and not motions:
        yield (*path, "time"), "there is no trajectory: give q"
    elif time is not None and where is None and len(motions) > 1:
        message = f"needs the trajectory that is meant, as trajectory ({listed(motions)})"
        yield (*path, "time"), message
    elif time is not None:
        motion = motions[where or next(iter(motions))] or (time, time)
        if not motion[0] <= time <= motion[1]:
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield (*path, "time"), f"{time:g} s is outside: {lasts}"


def one_shot_has_a_quadratic_program(document: Document) -> Iterator[Finding]:
    """The paper's program has wanted frequencies, bounds, linear constraints, no more."""
    assignment, design = document.assignment, document.design
    if assignment.method != "one_shot":
        return
    instead = "method: one_shot takes only frequency targets of numbered modes, bounds and "
    instead += "linear constraints: write method: sequential"
    if assignment.objective != "least_squares":
        yield ("assignment", "objective"), f"is not least_squares: {instead}"
    if assignment.robust:
        yield ("assignment", "robust"), f"is not linear in the design: {instead}"
    for k, target in enumerate(document.targets):
        if not target.is_goal:
            yield ("targets", k, target.kind), f"is not a wanted frequency: {instead}"
    for path, _ in followed_modes(document):
        yield path, f"is followed by its shape: {instead}"
    if design.mass is not None:
        limited = design.mass.min is not None or design.mass.max is not None
        yield ("design", "mass"), f"{'limits' if limited else 'prices'} the mass: {instead}"
    if "torque" in design.model_fields_set:
        yield ("design", "torque"), f"limits torques of drives: {instead}"
    for name, entry in design.entries.items():
        key = "choices" if isinstance(entry, Choices) else "values"
        if getattr(entry, key) is not None:
            yield ("design", name, key), f"is a list: {instead}"


# --- Objectives that are no error of wanted frequencies


def objectives_have_what_they_take(document: Document) -> Iterator[Finding]:
    """What is to be light, high or wide has limits beside it, no wanted frequencies.

    Bands or gaps can be wide where there are some, a mode high along a trajectory that there is.
    """
    objective, path = document.assignment.objective, ("assignment", "objective")
    name = document.assignment.named_objective
    if name not in ("lightest", "highest", "widest"):
        return
    if document.assignment.method == "one_shot":  # which takes none of them
        return
    for k, target in enumerate(document.targets):
        if isinstance(target, FrequencyTarget):
            message = f"objective {name} takes no wanted frequency: write at_least, at_most or both"
            yield ("targets", k, "frequency"), message
    wide = [isinstance(target, (KeepOutTarget, GapTarget)) for target in document.targets]
    if name == "widest" and not any(wide):
        yield path, "widest needs a target with keep_out or gap"
    for place, _ in followed_modes(document) if name == "widest" else ():
        if wide[int(place[1])]:
            yield place, "is followed by its shape: widest takes numbered modes only"
    if isinstance(objective, Highest) and isinstance(objective.highest, HighestMode):
        where, known = objective.highest.trajectory, _motions(document)
        if where is not None and where not in known:
            yield (*path, "highest", "trajectory"), unknown("trajectory", where, known)


def robust_designs_have_tolerances(document: Document) -> Iterator[Finding]:
    """Something deviates where deviations count."""
    deviates = any(entry.tolerance for entry in document.design.entries.values())
    if document.assignment.robust and not deviates:
        message = "no parameter has a tolerance: give at least one, such as tolerance: 2 %"
        yield ("assignment", "robust"), message


# --- Frequencies that change in time are wanted for the whole motion

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def profiles_cover_their_trajectories(document: Document) -> Iterator[Finding]:
    """A profile reaches from the first to the last time of every motion that it is for."""
    motions = _motions(document)
    at_rest = [
        name
        for _, name, form in named_trajectories(document.trajectory)
        if isinstance(form, SampledTrajectory) and len(form.q) == 1
    ]
    for k, target in enumerate(document.targets):
        where = [target.trajectory] if target.trajectory else list(motions)
        for keys, curve in target.frequencies:
            path = ("targets", k, *keys)
            if not isinstance(curve, (FrequencyProfile, FrequencyFile)):
                continue
            for name in (name for name in at_rest if name in where):
                message = f"changes in time, and trajectory {name!r} is a pose at rest: give one "
                yield path, message + "frequency, or a trajectory with a time"
            span = (curve.time[0], curve.time[-1]) if isinstance(curve, FrequencyProfile) else None
            for name in where:
                if span is None or (motion := motions.get(name)) is None:
                    continue
                first, last = target.during or motion
                first, last = max(first, motion[0]), min(last, motion[1])
                slack = _SLACK * (motion[1] - motion[0])
                if span[0] > first + slack or span[1] < last - slack:
                    which = f"trajectory {name!r}" if len(motions) > 1 else "the trajectory"
                    does = "lasts" if (first, last) == motion else "is wanted"
                    message = f"covers {span[0]:g} … {span[1]:g} s only; {which} {does} from "
                    yield (*path, "time"), f"{message}{first:g} to {last:g} s"


def _motions(document: Document) -> dict[str, Span | None]:
    """First and last time of each trajectory; None where the file does not say (a CSV does)."""
    return {name: _span(form) for _, name, form in named_trajectories(document.trajectory)}


def _span(motion: TrajectoryForm) -> Span | None:
    if isinstance(motion, FileTrajectory):
        return None
    times = getattr(motion, "times", None) or getattr(motion, "time", None)
    if times is not None:
        return times[0], times[-1]
    return None if motion.duration is None else (0.0, motion.duration)
