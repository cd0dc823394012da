"""Files that the case names, rules of the whole case, and the table of all rules.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.

A rule keeps silent about what it cannot judge since a name in it stands for nothing: that is told
already. Its name and docstring say what must hold; it yields where it does not, and why. To add
one: write it, and name it in the table at the end.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

from eigassign.case.reader import COMMA, Finding, KeyPath, Tree, entries, listed, unknown
from eigassign.case.rules import mechanism, properties
from eigassign.case.rules.properties import coordinate_lists, followed_modes, freedoms, walk
from eigassign.case.schema.design import Choices
from eigassign.case.schema.document import Document
from eigassign.case.schema.mechanism import Mechanism, RevoluteJoint
from eigassign.case.schema.study import Highest, HighestMode
from eigassign.case.schema.targets import (
    Antiresonance,
    FrequencyTarget,
    GapTarget,
    KeepOutTarget,
    ResponseTarget,
    SagTarget,
)
from eigassign.case.schema.trajectory import (
    DURATION_PATH,
    FileTrajectory,
    TipTrajectory,
    TrajectoryForm,
    named_trajectories,
)
from eigassign.case.schema.uncertain import Uncertain
from eigassign.case.units import written
from eigassign.files import CASE, MATRIX, MESH, TABLE, UPDATED, objection, printable

_SPARE = ("measurements", "sweep")
_VARIABLE = re.compile(r"(.*\.\w+):([A-Za-z]\w{0,62}(?:\.[A-Za-z]\w{0,62})?)", re.DOTALL)


class NamedFile(NamedTuple):
    """A file that the case names: its key, absolute path and largest size in bytes.

    ``spare``: of all commands that run a case only one needs it, `update` or `batch`.
    ``variable``: the matrix in it that is meant, where the case names one.
    """

    path: KeyPath
    file: str
    limit: int
    spare: bool
    variable: str = ""


def named_files(tree: Tree, folder: Path) -> list[NamedFile]:
    """Files that the case names; relative paths start in ``folder``."""
    found = []
    for path, name in walk(tree):
        if isinstance(name, str) and (limit := _limit(tree, path)):
            file, variable = os.path.abspath(folder / name), ""
            if path[-1] in ("stiffness", "mass"):
                file, variable = split_variable(file)
            if path == ("uncertain", "file") and os.path.isdir(file):
                file = os.path.join(file, UPDATED)
            found.append(NamedFile(path, file, limit, path[0] in _SPARE, variable))
    return found


def _limit(tree: Any, path: KeyPath) -> int:
    """How large a file named there may be; 0 where none is. Of tip paths a `file` is too much."""
    match path:
        case ("mechanism", "links", str(link), key, *_):
            keys = {"superelement": ("stiffness", "mass", "file", "nodes_file"), "solid": ("mesh",)}
            kind = str(entries(tree, "mechanism", "links", link).get("type"))
            return (MESH if key == "mesh" else MATRIX) * (key in keys.get(kind, ()))
        case ("trajectory", *inner, "file"):
            motion: Any = reduce(lambda node, key: node[key], inner, tree["trajectory"])
            return TABLE * ("tip" not in motion)
        case ("targets" | "measurements" | "sweep", *_, "file"):
            return TABLE
        case ("uncertain", "file"):
            return CASE
    return 0


def split_variable(name: str) -> tuple[str, str]:
    """``parts.mat:K`` as the file and the name of a matrix in it, "" where there is none."""
    found = _VARIABLE.fullmatch(name)
    return (found.group(1), found.group(2)) if found else (name, "")


def not_allowed(named: Sequence[NamedFile], folder: Path) -> Iterator[Finding]:
    """Files that do not lie below ``folder``."""
    root = os.path.realpath(folder)
    for each in named:
        if "\0" in each.file:  # no file has such a name: see `unreadable`
            continue
        place = os.path.realpath(each.file)
        if not Path(place).is_relative_to(root):
            yield (
                each.path,
                f"{printable(each.file)} lies outside the folder of the case file: put it there, "
                "or add --allow-outside to the command (in Python allow_outside=True)",
            )


def unreadable(named: Sequence[NamedFile]) -> Iterator[Finding]:
    """Files that are not there, no files, or too large."""
    for each in named:
        if (reason := objection(each.file, each.limit)) is not None:
            of = ": give the folder of an update" * (each.path[0] == "uncertain")
            yield each.path, f"no such file: {printable(each.file)} ({reason}){of}"


Span = tuple[float, float]  # first and last time, s


def names_mean_something(document: Document) -> Iterator[Finding]:
    """`ground` is no link, `time` heads every table over time, `torque` limits drives."""
    if "time" in document.coordinates:
        yield ("coordinates", "time"), "'time' heads a column of its own: name it otherwise"
    if "ground" in document.mechanism.links:
        path = ("mechanism", "links", "ground")
        yield path, "'ground' is the fixed frame: name the link otherwise"
    if "torque" in document.design.entries:
        message = "'torque' limits what drives exert, by coordinate: name the parameter otherwise"
        yield ("design", "torque"), message
    for name in document.design.torque:
        if name not in document.coordinates:
            yield ("design", "torque", name), unknown("coordinate", name, document.coordinates)


def lists_are_as_long_as_what_they_list(document: Document) -> Iterator[Finding]:
    """Points of trajectories and other poses are as long as q, `expansion.y` as the design."""
    coordinates, parameters = [*document.coordinates], [*document.design.chosen]
    rows = [(path, row, "coordinate", coordinates) for path, row in coordinate_lists(document)]
    if isinstance(document.expansion.y, tuple):
        rows.append((("expansion", "y"), document.expansion.y, "design parameter", parameters))
    for path, row, kind, known in rows:
        if len(row) != len(known):
            message = f"needs {len(known)} entries, one for each {kind} ({listed(known)}); got "
            yield path, f"{message}{len(row)}"


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
    ranged = [name for name in mechanism.joints if len(freedoms(mechanism, name)) == 1]
    moved = {body.joint for body in document.coordinates.values()}
    for place, _, motion in named_trajectories(document.trajectory):
        for joint, (low, high) in (
            motion.branch.items() if isinstance(motion, TipTrajectory) else ()
        ):
            path: KeyPath = (*place, "branch", joint)
            if joint not in ranged:
                yield path, unknown("joint with one freedom", joint, ranged)
            elif joint not in moved and moved <= {*mechanism.joints}:
                known = listed([name for name in ranged if name in moved])
                yield path, f"no coordinate moves this joint, but the loop does; use {known}"
            elif isinstance(mechanism.joints[joint], RevoluteJoint) and high - low > 2 * math.pi:
                yield path, "wider than one turn (an angle is in rad when bare; or write deg)"


def bounds_go_upwards(document: Document) -> Iterator[Finding]:
    """No minimum is above its maximum."""
    design = document.design
    limited: dict[KeyPath, object] = {("design", name): e for name, e in design.entries.items()}
    limited |= {("design", "constraints", name): c for name, c in design.constraints.items()}
    limited |= {("design", "mass"): design.mass}
    for path, part in limited.items():
        low, high = getattr(part, "min", None), getattr(part, "max", None)
        if low is not None and high is not None and low > high:
            yield (
                (*path, "min"),
                f"min {written(low, '', high)} is above max {written(high, '', low)}",
            )


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


def times_are_of_trajectories(document: Document) -> Iterator[Finding]:
    """What names a trajectory, or a time of one, means one that exists, and a time that it has."""
    motions = {name: _span(form) for _, name, form in named_trajectories(document.trajectory)}
    asked: list[tuple[KeyPath, str | None, str, float | Span | None]] = []
    for k, target in enumerate(document.targets):
        asked.append((("targets", k), target.trajectory, "during", target.during))
    for path, mode in followed_modes(document):
        if isinstance(mode, Antiresonance):
            continue
        asked.append(((*path, "at"), mode.at.trajectory, "time", mode.at.time))
    for k, each in enumerate(m if isinstance(m := document.measurements, tuple) else ()):
        asked.append((("measurements", k), each.trajectory, "time", each.time))
    objective = document.assignment.objective
    if isinstance(objective, Highest) and isinstance(objective.highest, HighestMode):
        aim = ("assignment", "objective", "highest")
        asked.append((aim, objective.highest.trajectory, "", None))
    for path, name, key, time in asked:
        if name is not None and name not in motions:
            yield (*path, "trajectory"), unknown("trajectory", name, motions)
        elif time is None:
            continue
        elif not motions:
            yield (*path, key), "there is no trajectory: give q"
        elif name is None and len(motions) > 1:
            message = f"needs the trajectory that is meant, as trajectory ({listed(motions)})"
            yield (*path, key), message
        elif (motion := motions[name or next(iter(motions))]) is not None:
            first, last = time if isinstance(time, tuple) else (time, time)
            if not (motion[0] <= last and first <= motion[1]):
                lasts = "the trajectory lasts from {:g} to {:g} s".format(*motion)
                what = "lies" if isinstance(time, tuple) else f"{written(time, 's')} is"
                yield (*path, key), f"{what} outside: {lasts}"


def _span(motion: TrajectoryForm) -> Span | None:
    """First and last time; None where the file does not say (a CSV does)."""
    if isinstance(motion, FileTrajectory):
        return None
    times = getattr(motion, "times", None) or getattr(motion, "time", None)
    if times is not None:
        return times[0], times[-1]
    return None if motion.duration is None else (0.0, motion.duration)


def what_sags_has_a_weight(document: Document) -> Iterator[Finding]:
    """Gravity is stated where a sag is limited."""
    for k, target in enumerate(document.targets):
        if isinstance(target, SagTarget) and not isinstance(document.mechanism.gravity, tuple):
            down = "[0, -9.81]" if document.mechanism.space == "planar" else "[0, 0, -9.81]"
            yield ("targets", k, "sag"), f"nothing sags without mechanism.gravity: {down}, say"


def a_mode_has_one_frequency_at_a_time(document: Document) -> Iterator[Finding]:
    """No two targets want frequencies of the same mode on the same part of a trajectory."""
    known = [name for _, name, _ in named_trajectories(document.trajectory)] or [""]
    seen = dict[tuple[int, str], list[Span]]()
    for k, target in enumerate(document.targets):
        if not isinstance(target, FrequencyTarget) or target.followed:
            continue
        first, last = target.during or (-math.inf, math.inf)
        for i, mode in enumerate(target.numbers):
            ones = [(mode, name) for name in ([target.trajectory] if target.trajectory else known)]
            both = [one for one in ones for a, b in seen.get(one, ()) if first < b and a < last]
            if both:
                which = f" along trajectory {both[0][1]!r}" if len(known) > 1 else ""
                place: KeyPath = ("mode",) if target.modes is None else ("modes", i)
                yield ("targets", k, *place), f"mode {mode} has a target already{which}"
            for each in ones:
                seen.setdefault(each, []).append((first, last))


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
    for path, mode in followed_modes(document):
        what = "an antiresonance" if isinstance(mode, Antiresonance) else "followed by its shape"
        yield path, f"is {what}: {instead}"
    if design.mass is not None:
        yield ("design", "mass"), f"limits or prices the mass: {instead}"
    if "torque" in design.model_fields_set:
        yield ("design", "torque"), f"limits torques of drives: {instead}"
    for name, entry in design.entries.items():
        key = "choices" if isinstance(entry, Choices) else "values"
        if getattr(entry, key) is not None:
            yield ("design", name, key), f"is a list: {instead}"


def objectives_have_what_they_take(document: Document) -> Iterator[Finding]:
    """What is to be light, high or wide has limits (or bands, gaps), no wanted frequencies."""
    name = document.assignment.named_objective
    one_shot = document.assignment.method == "one_shot"  # which takes none of them
    if name not in ("lightest", "highest", "widest", "fastest") or one_shot:
        return
    designed = {p for column in document.design.parameters.values() for p in column.factors}
    if name == "fastest" and DURATION_PATH not in designed:
        message = "fastest needs a design parameter {parameter: trajectory.duration, min, max}"
        yield ("assignment", "objective"), message
    for k, target in enumerate(document.targets):
        if isinstance(target, FrequencyTarget):
            message = f"objective {name} takes no wanted frequency: write at_least, at_most or both"
            yield ("targets", k, "frequency"), message
    wide = [isinstance(target, (KeepOutTarget, GapTarget)) for target in document.targets]
    if name == "widest" and not any(wide):
        yield ("assignment", "objective"), "widest needs a target with keep_out or gap"
    for place, _ in followed_modes(document) if name == "widest" else ():
        if wide[int(place[1])]:
            yield place, "is no numbered mode: widest takes these only"


def damping_is_stated_once(document: Document) -> Iterator[Finding]:
    """By ratios or by loss factors, and at all where a response is limited."""
    parts = [(("mechanism", "materials", n), m) for n, m in document.mechanism.materials.items()]
    drives = document.coordinates.items()
    lossy = [
        (*path, "loss_factor")
        for path, part in [*parts, *((("coordinates", n, "drive"), c.drive) for n, c in drives)]
        if getattr(part, "loss_factor", None) is not None
    ]
    if lossy and document.damping is not None:
        yield lossy[0], "is given beside damping, the ratios of modes: state it in one way"
    for k, target in enumerate(document.targets):
        if isinstance(target, ResponseTarget) and not lossy and document.damping is None:
            message = "needs damping: ratios (damping: 1 %, say), or loss_factor of materials"
            yield ("targets", k, "response"), message


def robust_designs_have_tolerances(document: Document) -> Iterator[Finding]:
    """Something deviates where deviations count."""
    deviates = any(entry.tolerance for entry in document.design.entries.values())
    if document.assignment.robust and not deviates and not document.uncertain:
        message = "no parameter has a tolerance, such as 2 %, and nothing is uncertain: give one"
        yield ("assignment", "robust"), message


def uncertain_values_are_possible(document: Document) -> Iterator[Finding]:
    """What is known by a deviation has a logarithm where nature forbids what is below 0."""
    own = document.uncertain or Uncertain.model_construct()
    for name, one in own.entries.items():
        column = document.design.parameters[name]
        kind = properties.known_property(document, column.parameter) or properties.ANY
        values, message = [column.min, *(other.values.get(name, 1.0) for other in own.others)], ""
        if one.min is not None and one.max is not None and not one.min <= column.min <= one.max:
            message = f"its value, {column.min:.6g}, is not between min and max"
        elif one.min is None and 0 in (kind.at_least, kind.above) and 0.0 in values:
            message = "is 0, of which no standard deviation can be: give min and max instead"
        if message:
            yield ("uncertain", name), message


# --- All rules

Rule = Callable[[Document], Iterator[Finding]]
RULES: tuple[Rule, ...] = (
    names_mean_something,
    mechanism.names_mean_parts,
    mechanism.materials_have_what_links_need,
    mechanism.tapers_run_between_like_sections,
    mechanism.frames_hang_together,
    mechanism.beams_have_no_more_elements_than_can_be_meant,
    mechanism.joints_connect_two_links,
    mechanism.riders_have_a_beam_of_their_own,
    mechanism.links_are_connected_to_the_ground,
    mechanism.coordinates_move_one_freedom_each,
    mechanism.assembly_closes_loops,
    properties.parameters_name_properties,
    properties.each_property_has_one_owner,
    properties.values_are_what_they_are_of,
    lists_are_as_long_as_what_they_list,
    trajectories_have_names_of_their_own,
    branches_are_ranges_of_driven_joints,
    constraints_are_between_design_parameters,
    times_are_of_trajectories,
    what_sags_has_a_weight,
    a_mode_has_one_frequency_at_a_time,
    one_shot_has_a_quadratic_program,
    objectives_have_what_they_take,
    damping_is_stated_once,
    robust_designs_have_tolerances,
    uncertain_values_are_possible,
)
LAST: tuple[Rule, ...] = (  # of cases in which every name and unit is right
    bounds_go_upwards,
    properties.parameters_agree_with_the_file,
)


def inconsistent(document: Document) -> Iterator[Finding]:
    """Everything that does not fit together."""
    found = False
    for rule in RULES:
        for finding in rule(document):
            found = True
            yield finding
    for rule in () if found else LAST:
        yield from rule(document)


# --- Before the form is looked at


def keys_have_values(tree: Tree) -> Iterator[Finding]:
    """No key and no entry of a list is left empty."""
    for path, node in properties.walk(tree):
        if node is None:
            hint = f" ({COMMA})" if str(path[-1])[:1].isdigit() else ""
            yield path, f"has no value: give one, or leave the key out{hint}"


_MOST = 1000  # entries of a group
_MOST_INSIDE = 10_000  # nodes or beams of one link
_GROUPS = (
    *(("mechanism", group) for group in Mechanism.model_fields),
    ("coordinates",),
    ("design",),
    ("design", "constraints"),
)


def too_many(tree: Tree) -> Iterator[Finding]:
    """Groups so large that looking for further problems could take minutes."""
    for place in _GROUPS:
        if len(entries(tree, *place)) > _MOST:
            yield place, f"more than {_MOST} entries"
    for name in entries(tree, "mechanism", "links"):
        for key in ("nodes", "beams"):
            place = ("mechanism", "links", name, key)
            if len(entries(tree, *place)) > _MOST_INSIDE:
                yield place, f"more than {_MOST_INSIDE} entries: make it a superelement"
