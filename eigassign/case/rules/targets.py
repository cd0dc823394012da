"""What is asked of the frequencies, where, and by which method; and where they were measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, names, text
from eigassign.case.rules.lookups import (
    choices,
    curves,
    design_entries,
    followed_modes,
    is_spatial,
    node_problem,
    number,
    trajectories,
    trajectory_names,
)
from eigassign.case.schema.design import is_entry
from eigassign.case.schema.targets import TARGETS, StaticTarget, kinds_of
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
            yield path, f"needs the trajectory that is meant, as trajectory ({listed(known)})"
            continue
        motion = motions.get(name or (known[0] if known else ""))
        if motion is not None and not (motion[0] <= span[1] and span[0] <= motion[1]):
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield path, f"lies outside: {lasts}"


def statics_are_of_nodes(tree: Tree) -> Iterator[Finding]:
    """The node of a static target exists, and what sags has a weight."""
    kinds = [kind for kind, form in TARGETS.items() if issubclass(form, StaticTarget)]
    for k, target in enumerate(entries(tree, "targets")):
        for kind in kinds:
            node = text(target, kind, "at")
            if node is not None and (problem := node_problem(tree, node)):
                yield ("targets", k, kind, "at"), problem
        weighs = isinstance(at(tree, "mechanism", "gravity"), tuple)
        if at(target, "sag") is not None and not weighs:
            down = "[0, 0, -9.81]" if is_spatial(tree) else "[0, -9.81]"
            yield ("targets", k, "sag"), f"nothing sags without mechanism.gravity: {down}, say"


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
        message = f"needs the trajectory that is meant, as trajectory ({listed(known)})"
        yield (*path, "time"), message
    elif time is not None:
        motion = dict(zip(known, _motions(tree), strict=True))[where or known[0]] or (time, time)
        if not motion[0] <= time <= motion[1]:
            lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
            yield (*path, "time"), f"{time:g} s is outside: {lasts}"


def one_shot_has_a_quadratic_program(tree: Tree) -> Iterator[Finding]:
    """The paper's program has wanted frequencies, bounds, linear constraints, no more."""
    if text(tree, "assignment", "method") != "one_shot":
        return
    instead = "method: one_shot takes only frequency targets of numbered modes, bounds and "
    instead += "linear constraints: write method: sequential"
    if at(tree, "assignment", "objective") not in (None, "least_squares"):
        yield ("assignment", "objective"), f"is not least_squares: {instead}"
    if at(tree, "assignment", "robust") is True:
        yield ("assignment", "robust"), f"is not linear in the design: {instead}"
    for k, target in enumerate(entries(tree, "targets")):
        kinds = kinds_of(target) if isinstance(target, Mapping) else []
        if kinds and not TARGETS[kinds[0]].is_goal:
            yield ("targets", k, kinds[0]), f"is not a wanted frequency: {instead}"
    for path, _ in followed_modes(tree):
        yield path, f"is followed by its shape: {instead}"
    for key, what in (("mass", "the mass"), ("torque", "torques of drives")):
        limits = at(tree, "design", key)
        if limits is not None and not is_entry(limits):
            limited = "limits" if key == "torque" or set(names(limits)) != {"price"} else "prices"
            yield ("design", key), f"{limited} {what}: {instead}"
    for name, body in design_entries(tree):
        for key in ("values", "choices"):
            if at(body, key) is not None:
                yield ("design", name, key), f"is a list: {instead}"


# --- Objectives that are no error of wanted frequencies


def objectives_have_what_they_take(tree: Tree) -> Iterator[Finding]:
    """What is to be light, high or wide has limits beside it, no wanted frequencies.

    Bands or gaps can be wide where there are some, a mode high along a trajectory that there is.
    """
    objective, path = at(tree, "assignment", "objective"), ("assignment", "objective")
    highest, known = at(objective, "highest"), trajectory_names(tree)
    name = "highest" if highest is not None else objective
    if name not in ("lightest", "highest", "widest"):
        return
    if text(tree, "assignment", "method") == "one_shot":  # which takes none of them
        return
    kinds = [
        {key for key in TARGETS if at(own, key) is not None} for own in entries(tree, "targets")
    ]
    for k in (k for k, kind in enumerate(kinds) if "frequency" in kind):
        message = f"objective {name} takes no wanted frequency: write at_least, at_most or both"
        yield ("targets", k, "frequency"), message
    if name == "widest" and not any(kind & {"keep_out", "gap"} for kind in kinds):
        yield path, "widest needs a target with keep_out or gap"
    for place, _ in followed_modes(tree) if name == "widest" else ():
        if "keep_out" in kinds[int(place[1])] or "gap" in kinds[int(place[1])]:
            yield place, "is followed by its shape: widest takes numbered modes only"
    if (where := text(highest, "trajectory")) is not None and where not in known:
        yield (*path, "highest", "trajectory"), unknown("trajectory", where, known)


def robust_designs_have_tolerances(tree: Tree) -> Iterator[Finding]:
    """Something deviates where deviations count."""
    deviates = any(at(body, "tolerance") is not None for _, body in design_entries(tree))
    if at(tree, "assignment", "robust") is True and not deviates:
        message = "no parameter has a tolerance: give at least one, such as tolerance: 2 %"
        yield ("assignment", "robust"), message


# --- Frequencies that change in time are wanted for the whole motion

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def profiles_cover_their_trajectories(tree: Tree) -> Iterator[Finding]:
    """A profile reaches from the first to the last time of every motion that it is for."""
    motions = list(zip(trajectory_names(tree), _motions(tree), strict=True))
    at_rest = [_is_at_rest(body) for _, body in trajectories(tree)]
    for path, curve in curves(tree):
        target = entries(tree, "targets")[int(path[1])]
        for (name, _), rests in zip(motions, at_rest, strict=True):
            if rests and isinstance(curve, Mapping) and text(target, "trajectory") in (None, name):
                message = f"changes in time, and trajectory {name!r} is a pose at rest: give one "
                yield path, message + "frequency, or a trajectory with a time"
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


def _is_at_rest(trajectory: object) -> bool:
    return len(entries(trajectory, "q")) == 1


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
