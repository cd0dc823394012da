"""What is asked of the frequencies, where, and by which method; and where they were measured."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, names, text
from eigassign.case.rules.lookups import (
    choices,
    curves,
    design_entries,
    followed_modes,
    number,
    trajectories,
    trajectory_names,
)
from eigassign.case.schema.design import is_entry
from eigassign.case.schema.targets import TARGETS
from eigassign.case.schema.trajectory import DURATION, TIME, TipTrajectory
from eigassign.case.suggestions import listed, shown, unknown

Span = tuple[float, float]  # first and last time, s


def targets_are_on_trajectories(tree: Tree) -> Iterator[Finding]:
    """A target names a trajectory that exists, and a part of it that it has."""
    known = trajectory_names(tree)
    motions = dict(zip(known, _motions(tree), strict=True))
    for k, target in enumerate(entries(tree, "targets")):
        name, span = text(target, "trajectory"), _span(at(target, "during"))
        if name is not None and name not in known:
            yield ("targets", k, "trajectory"), unknown("trajectory", name, known)
            continue
        if span is None:
            continue
        path: KeyPath = ("targets", k, "during")
        if name is None and len(known) > 1:
            yield path, f"is a part of one trajectory: name it ({listed(known)})"
            continue
        motion = motions.get(name or (known[0] if known else ""))
        if motion is not None and not (motion[0] <= span[1] and span[0] <= motion[1]):
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield path, f"is no part of it: {lasts}"


def a_mode_has_one_frequency_at_a_time(tree: Tree) -> Iterator[Finding]:
    """No two targets want frequencies of the same mode on the same part of a trajectory."""
    known, seen = trajectory_names(tree), dict[tuple[int, str], list[Span | None]]()
    for k, target in enumerate(entries(tree, "targets")):
        if at(target, "frequency") is None:
            continue
        single, where, span = (
            at(target, "mode"),
            text(target, "trajectory"),
            _span(at(target, "during")),
        )
        places: list[tuple[KeyPath, object]] = [(("targets", k, "mode"), single)]
        each = enumerate(entries(target, "modes"))
        places += [(("targets", k, "modes", i), mode) for i, mode in each]
        own: list[tuple[int, str]] = []
        for path, mode in places:
            if not isinstance(mode, int) or isinstance(mode, bool):
                continue
            along = [(mode, name) for name in ([where] if where else known or [""])]
            both = sorted(
                name
                for mode, name in along
                for other in seen.get((mode, name), ())
                if span is None or other is None or (span[0] < other[1] and other[0] < span[1])
            )
            if both:
                which = f" along trajectory {both[0]!r}" if len(known) > 1 else ""
                yield path, f"mode {mode} has a target already{which}"
            own += along
        for place in own:
            seen.setdefault(place, []).append(span)


def followed_modes_are_at_a_pose(tree: Tree) -> Iterator[Finding]:
    """A mode named by its shape has a pose of the mechanism and a possible design."""
    lists = {name: choices(body) for name, body in design_entries(tree)}
    for path, body in followed_modes(tree):
        yield from _no_pose(tree, (*path, "at"), at(body, "at"))
        for name in names(body, "design"):
            place, value = (*path, "design", name), at(body, "design", name)
            if name not in lists:
                yield place, unknown("design parameter", name, lists)
            elif (of_choices := lists[name]) is not None:
                named = [choice for choice, _ in of_choices]
                if not isinstance(value, str):
                    yield place, f"expected one of the choices {listed(named)}, got {shown(value)}"
                elif value not in named:
                    yield place, unknown("choice", value, named)


def measurements_are_at_poses(tree: Tree) -> Iterator[Finding]:
    """Measurements of a list were made at a time of a trajectory, or with a value for each q."""
    for k, body in enumerate(entries(tree, "measurements")):
        yield from _no_pose(tree, ("measurements", k), body)


def _no_pose(tree: Tree, path: KeyPath, body: object) -> Iterator[Finding]:
    """Mistakes that keep `time` and `trajectory` of a part from being a pose of the mechanism."""
    known, where = trajectory_names(tree), text(body, "trajectory")
    time = number(at(body, "time"), TIME)
    if where is not None and where not in known:
        yield (*path, "trajectory"), unknown("trajectory", where, known)
    elif time is not None and not known:
        yield (*path, "time"), "there is no trajectory: give q"
    elif time is not None and where is None and len(known) > 1:
        message = f"is a time of one trajectory: name it as trajectory ({listed(known)})"
        yield (*path, "time"), message
    elif time is not None:
        motion = dict(zip(known, _motions(tree), strict=True))[where or known[0]] or (time, time)
        if not motion[0] <= time <= motion[1]:
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield (*path, "time"), f"{time:g} s is outside: {lasts}"


def one_shot_has_a_quadratic_program(tree: Tree) -> Iterator[Finding]:
    """The paper's program has wanted frequencies, bounds, lists, linear constraints, no more."""
    if text(tree, "assignment", "method") != "one_shot":
        return
    instead = "method: one_shot takes frequency targets of numbered modes, bounds, lists and "
    instead += "linear constraints only; take method: sequential"
    if text(tree, "assignment", "objective") == "worst_case":
        yield ("assignment", "objective"), f"is not least_squares; {instead}"
    for k, target in enumerate(entries(tree, "targets")):
        kind = next((key for key in TARGETS if at(target, key) is not None), None)
        if kind is not None and not TARGETS[kind].is_goal:
            yield ("targets", k, kind), f"is no wanted frequency; {instead}"
    for path, _ in followed_modes(tree):
        yield path, f"is followed by its shape; {instead}"
    for key, what in (("mass", "the mass"), ("torque", "torques of drives")):
        limits = at(tree, "design", key)
        if limits is not None and not is_entry(limits):
            yield ("design", key), f"limits {what}; {instead}"


# --- Frequencies that change in time are wanted for the whole motion

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def profiles_cover_their_trajectories(tree: Tree) -> Iterator[Finding]:
    """A profile reaches from the first to the last time of every motion that it is for."""
    motions = list(zip(trajectory_names(tree), _motions(tree), strict=True))
    for path, curve in curves(tree):
        target = entries(tree, "targets")[int(path[1])]
        span, where = _span(at(curve, "time")), text(target, "trajectory")
        for name, motion in motions:
            if span is None or motion is None or where not in (None, name):
                continue
            first, last = _span(at(target, "during")) or motion
            first, last = max(first, motion[0]), min(last, motion[1])
            slack = _SLACK * (motion[1] - motion[0])
            if span[0] > first + slack or span[1] < last - slack:
                which = f"trajectory {name!r}" if len(motions) > 1 else "the trajectory"
                whole = (first, last) == motion
                does = "lasts" if whole else "is wanted"
                message = f"covers {span[0]:g} … {span[1]:g} s only; {which} {does} from {first:g}"
                yield (*path, "time"), f"{message} to {last:g} s"


def _motions(tree: Tree) -> list[Span | None]:
    """First and last time of each trajectory; None where the file does not say (a CSV does)."""
    return [_duration(body) for _, body in trajectories(tree)]


def _duration(trajectory: object) -> Span | None:
    for key in ("time", "times"):
        if at(trajectory, key) is not None:
            return _span(at(trajectory, key))
    given = at(trajectory, "duration")
    if given is None and at(trajectory, "tip") is not None:
        given = TipTrajectory.model_fields["duration"].default
    duration = number(given, DURATION)
    return None if duration is None else (0.0, duration)


def _span(times: object) -> Span | None:
    if not isinstance(times, tuple) or not times:
        return None
    first, last = number(times[0], TIME), number(times[-1], TIME)
    return None if first is None or last is None or last < first else (first, last)
