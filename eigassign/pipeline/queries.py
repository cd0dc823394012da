"""Quick questions about a case: is it right, and what are its frequencies at one point."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.assignment.requirements.sampling import design_limits, requirements_of, with_instants
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.parts import Quantity, quantity
from eigassign.case.units import DIMENSIONS, TWO_TURNS, QuantityError, handy, is_bare, shown_point
from eigassign.errors import CaseError, EigassignError, Problem, UsageError
from eigassign.facts import Fact, Hertz, Key, Share
from eigassign.files import quoted
from eigassign.mechanism.elements.superelement import part_lines
from eigassign.mechanism.kinematics.parameters import resting_pose, written_loads
from eigassign.modal.exact.solver import rounding_error
from eigassign.output.figures import mechanism
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.reports import page as report
from eigassign.pipeline.stages import DEFAULT, Options, new_run_folder
from eigassign.study import pictures as drawing
from eigassign.study.built_case import BuiltCase, load_case
from eigassign.study.checks import GIVEN, judged_mesh, mesh_lines, study_weight, truncation_lines
from eigassign.study.design.followed import named_notes
from eigassign.study.design.judgement import far_off
from eigassign.study.meaning import levers
from eigassign.study.planning import expansion_needed, plan_expansion, reduced_to
from eigassign.study.results import LeverRow, WeightRow
from eigassign.study.scene import Scene
from eigassign.study.updating.measured import read_measurements

Where = Annotated[tuple[tuple[str, float], ...], Fact(unwritten=True)]
Words = Annotated[tuple[str, ...], Fact(unwritten=True)]
TooHigh = Annotated[list[Share] | None, Fact("at most", optional=True, may_lack=True)]


@dataclass(frozen=True)
class ModesAnswer:
    """Exact frequencies (Hz) of the lowest elastic modes; rigid-body modes are only counted."""

    rigid_modes: int
    frequencies_hz: list[Hertz]
    q: Where  # name and value, SI
    y: Where
    where: Key  # "q1 = 1.8 rad, m1 = 0.125 kg"
    round_off: Annotated[Share, Fact("at most; infinite: not known", may_lack=True)] = 0.0
    discretisation_error: TooHigh = None  # of the mesh; infinite: too coarse
    truncation_error: TooHigh = None  # of reduced links
    weight: Annotated[WeightRow | None, Fact("what gravity changes", optional=True)] = None
    levers: Annotated[tuple[LeverRow, ...], Fact("what would help each mode")] = ()
    notes: Words = ()  # of gravity
    warnings: Words = ()


@dataclass(frozen=True)
class CheckAnswer:
    """A case in figures; ``warnings`` are plausibility problems that do not stop a run."""

    title: str
    n_dof: int
    n_rigid: int
    q_names: tuple[str, ...]
    y_names: tuple[str, ...]
    samples: int  # of all trajectories, 0 without one
    duration_s: float
    trajectories: tuple[tuple[str, int, float], ...]  # of each its name, samples and duration
    targets: int
    notes: tuple[str, ...]
    next: str  # what to do with it
    warnings: tuple[Problem, ...]


def modes(
    path: str | Path,
    q: Sequence[float] | str | None = None,
    y: Sequence[float] | str | None = None,
    count: int | None = None,
    allow_outside: bool = False,
) -> ModesAnswer:
    """Exact modes of the case at q (rad) and y (SI units), given as numbers or as text with units.

    Without ``q`` at the expansion point that the case gives, else where its trajectory starts;
    without ``y`` with the design as it is written in the file. Loads that trajectories set may
    stand behind the coordinates in ``q``; without them they are as written in the file. Raises
    UsageError for wrong lengths or counts, and where there is no pose to take.
    """
    case = load_case(path, allow_outside)
    at_q, at_y = pose_and_design(case, q, y)
    case, count = _with_modes(case, count)
    with case.located():
        hz = case.model().frequencies(at_q, at_y, count)[0]
    return _answer(case, at_q, at_y, hz)


FEW = 4  # modes, where no number is asked for


def _with_modes(case: BuiltCase, count: int | None) -> tuple[BuiltCase, int]:
    """The case with links reduced so that as many modes as asked for are right; how many."""
    with case.located():
        most = len(case.model().pencil.elastic)
    if count is None or count <= most:
        return case, min(FEW, most) if count is None else count
    modes = tuple(range(1, count + 1))
    expansion = case.file.expansion.model_copy(update={"modes": modes})
    again = BuiltCase(replace(case.file, expansion=expansion))
    with again.located():
        model = again.model()
    if model.is_reduced and len(model.pencil.elastic) < count:
        many = f"{count} modes asked for, and {len(model.pencil.elastic)} are kept"
        raise UsageError(f"{many}: raise reduce_to of {', '.join(reduced_to(again.file))}")
    return again, count


def draw_modes(
    path: str | Path, options: Options, q: str | None, y: str | None, count: int | None
) -> tuple[ModesAnswer, Path]:
    """`modes`, and a folder with a figure of each, usually results/<case>_modes.

    Raises what `modes` does, and StorageError where the folder may not be replaced.
    """
    case = load_case(path, options.allow_outside)
    at_q, at_y = pose_and_design(case, q, y)
    case, count = _with_modes(case, count)
    with new_run_folder(case.file, options.out, options.force, "_modes") as folder:
        with case.located():
            pictures = drawing.draw_modes(case.file, case.model(), at_q, at_y, count)
        report.write_figures(mechanism.mode_figures(pictures), folder.hidden, options.figures)
    return _answer(case, at_q, at_y, np.array(pictures.frequencies_hz)), folder.path


def pose_and_design(
    case: BuiltCase,
    q: Sequence[float] | str | None = None,
    y: Sequence[float] | str | None = None,
) -> tuple[Floats, Floats]:
    """The q and y of modes that are asked for, in SI; see `modes`. Raises UsageError."""
    q = coordinates(case.file, q) if isinstance(q, str) else q
    y = design(case.file, y) if isinstance(y, str) else y
    with case.located():
        at_q = np.asarray(_default_q(case) if q is None else q, dtype=np.float64)
    if at_q.shape == (len(case.file.coordinates),):
        at_q = np.append(at_q, written_loads(case.file))
    at_y = np.asarray(case.initial_design if y is None else y, dtype=np.float64)
    return at_q, at_y


def _beyond_bounds(case: BuiltCase, y: Floats) -> Iterator[str]:
    columns, units = case.file.design.parameters.items(), case.file.design_units
    for (name, column), unit, value in zip(columns, units, y, strict=True):
        slack = 1e-9 * max(abs(column.min), abs(column.max))
        if not column.min - slack <= value <= column.max + slack:
            low, high = (handy(each, unit, 6) for each in (column.min, column.max))
            yield f"{name} = {handy(value, unit, 6)} is outside its bounds, {low} to {high}"


def _answer(case: BuiltCase, q: Floats, y: Floats, hz: Floats) -> ModesAnswer:
    model, file = case.model(), case.file
    named = ((model.q_names, q, file.q_units), (model.y_names, y, file.design_units))
    every = tuple(range(1, len(hz) + 1))
    lost = model.truncation_error(q, y, every)[0] if model.is_reduced else None
    coarse = model.discretisation_error(q, y, every)[0] if model.is_meshed or model.solids else None
    weight = study_weight(file, model, every, q[None], y, GIVEN)
    helped: tuple[LeverRow, ...] = ()
    with suppress(EigassignError):  # the frequencies stand without
        helped = tuple(levers(model, q[None], y, {f"mode {k}": np.array([k]) for k in every}))
    return ModesAnswer(
        model.n_rigid,
        hz.tolist(),
        tuple(zip(model.q_names, q.tolist(), strict=True)),
        tuple(zip(model.y_names, y.tolist(), strict=True)),
        ", ".join(shown_point(*point) for point in named if point[0]),
        rounding_error(model.pencil, model.x(q, y)[0], len(hz)),
        None if coarse is None else coarse.tolist(),
        None if lost is None else lost.tolist(),
        weight.row,
        helped,
        weight.notes,
        (*_beyond_bounds(case, y), *weight.warnings),
    )


def _default_q(case: BuiltCase) -> Sequence[float]:
    file = case.file
    if file.expansion.q != "auto":
        return [float(value) for value in file.expansion.q]
    if file.trajectory is not None:
        return [float(value) for value in case.trajectory.q[0]]
    if file.coordinates:
        names = ", ".join(file.coordinates)
        raise UsageError(f"q: give a value for {names}; the case has no expansion point to take")
    return []


def check(path: str | Path, allow_outside: bool = False) -> CheckAnswer:
    """Validate the file, build its model, follow its trajectory, and settle its expansion point.

    The files that it names are read, measurements as well.

    Raises CaseError with every problem found by the first of these steps that finds any.
    """
    case = load_case(path, allow_outside)
    with case.located():
        return _checked(case)


def _checked(case: BuiltCase) -> CheckAnswer:
    file, model = case.file, case.model()
    trajectory = case.trajectory if file.trajectory is not None else None
    notes = part_lines(file)
    notes += case.settled.reasons
    notes += () if trajectory is None else trajectory.notes
    parts = () if trajectory is None else trajectory.parts
    each = tuple((p.name, len(p.trajectory.q), float(np.ptp(p.trajectory.time_s))) for p in parts)
    asked: Sequence[Requirement] = ()
    if trajectory is not None:
        path = with_instants(file, trajectory)
        asked = requirements_of(file, path)
        design_limits(file, model, path)
    notes += read_measurements(case)[1]
    warnings = file.warnings
    if trajectory is not None or file.expansion.q != "auto":
        needed = expansion_needed(file)
        plan = plan_expansion(file, model, trajectory, needed=needed)
        y = case.initial_design
        scene = Scene(file, model, y, trajectory, plan, None, plan.notes)
        notes += (*scene.notes, *truncation_lines(scene))
        notes += tuple(mesh_lines(judged_mesh(scene, y, "initial"), model))
        q = plan.q0[None] if trajectory is None else trajectory.q[:1]
        weight = study_weight(file, model, plan.modes, q, y, "initial")  # quick
        notes += weight.lines
        warnings += tuple(file.problem("mechanism", each) for each in weight.warnings)
    warnings += tuple(_doubts(case, asked, None if trajectory is None else trajectory.q[:1]))
    notes += () if trajectory is None else tuple(named_notes(file, model, trajectory))
    return CheckAnswer(
        title=file.title,
        n_dof=model.n_dof,
        n_rigid=model.n_rigid,
        q_names=tuple(file.coordinates),
        y_names=model.y_names,
        samples=sum(samples for _, samples, _ in each),
        duration_s=float(sum(duration for *_, duration in each)),
        trajectories=each,
        targets=len(file.targets),
        notes=tuple(notes),
        next=next_step(file),
        warnings=warnings,
    )


def next_step(case: CaseFile) -> str:
    """The command for a case that is in order."""
    name = quoted(case.path)
    if case.measurements is not None:
        return f"eigassign update {name}"
    given = (case.trajectory, case.design.parameters, case.has_question)
    keys = ("trajectory", "design", "targets")
    missing = [key for key, value in zip(keys, given, strict=True) if not value]
    if not missing:
        return f"eigassign optimize {name}"
    needs = " and ".join(filter(None, [", ".join(missing[:-1]), missing[-1]]))
    pose = ""
    if case.trajectory is None and case.expansion.q == "auto" and case.coordinates:
        pairs = zip(resting_pose(case), case.coordinate_units, strict=True)
        pose = f' --q "{", ".join(handy(*pair) for pair in pairs)}"'
    more = "eigassign docs case-file"
    return f"eigassign modes {name}{pose} --draw (to optimize it needs {needs}: {more})"


def _doubts(case: BuiltCase, asked: Sequence[Requirement], q: Floats | None) -> Iterator[Problem]:
    """What a colleague would ask of the lowest modes at one pose."""
    file, model = case.file, case.model()
    q = some_pose(case)[None] if q is None else q
    ours = [one for one in asked if not one.is_aim and not one.followed and one.mode_terms]
    count = max((mode for one in ours for mode, _ in one.mode_terms), default=1)
    try:
        hz = model.frequencies(q, case.initial_design, count)[0]
    except UsageError as error:
        raise CaseError((file.problem("mechanism", str(error)),)) from error
    for one in ours:
        for doubt in far_off(one, hz[[mode - 1 for mode, _ in one.mode_terms]]):
            yield file.problem(f"{one.place}.{one.kind}", doubt)


# --- The mechanism alone, in a picture


def draw(path: str | Path, options: Options = DEFAULT) -> Path:
    """`picture` in a folder, usually results/<case>_check.

    Raises StorageError where the folder may not be replaced.
    """
    case = load_case(path, options.allow_outside)
    with new_run_folder(case.file, options.out, options.force, "_check") as folder:
        report.write_figures([picture(case)], folder.hidden, options.figures)
    return folder.path


def picture(case: BuiltCase) -> FigurePlan:
    """The mechanism along its trajectory, or in one pose; raises CaseError where it has none."""
    file, y = case.file, case.initial_design
    with case.located():
        model = case.model()
        if file.trajectory is None:
            poses = drawing.rest_pose(file, model, some_pose(case), y)
        else:
            poses = drawing.draw_poses(file, model, case.trajectory, y)
    return mechanism.poses(file.title, poses)


def some_pose(case: BuiltCase) -> Floats:
    """q (n_q,) of a case without a trajectory: its expansion point, else where it may rest."""
    given = case.file.expansion.q
    pose = resting_pose(case.file) if given == "auto" else given
    return np.append(np.asarray(pose, dtype=np.float64), written_loads(case.file))


# --- ``--q`` and ``--y`` of the command line: text → SI numbers of the case's dimensions


def coordinates(case: CaseFile, text: str) -> list[float]:
    """q in rad or m, one value per coordinate of the case, and none or all of its loads behind.

    Raises UsageError.
    """
    kinds = {"rad": quantity("angle"), "m": quantity("length")}
    names, quantities = list(case.coordinates), [kinds[unit] for unit in case.coordinate_units]
    if len(split(text)) > len(names):
        names, quantities = [*names, *case.loads], [*quantities, *case.load_quantities]
    return _read(text, "--q", names, quantities)


def design(case: CaseFile, text: str) -> list[float]:
    """y in SI units, one value per design parameter of the case; raises UsageError."""
    return _read(text, "--y", list(case.design.parameters), case.design_quantities)


def _read(
    text: str, option: str, names: Sequence[str], quantities: Sequence[Quantity]
) -> list[float]:
    parts = split(text)
    if len(parts) != len(names):
        wanted = f"{len(names)} values, {', '.join(names)}" if names else "no values"
        comma = "; decimals take a point" if len(parts) > len(names) and "," in text else ""
        raise UsageError(f"{option}: expected {wanted}; got {len(parts)} in {text!r}{comma}")
    values = []
    for name, part, each in zip(names, parts, quantities, strict=True):
        try:
            values.append(each.read(part))
        except QuantityError as error:
            raise UsageError(f"{option}: {name}: {error}") from None
        if each.dimension == DIMENSIONS["angle"] and abs(values[-1]) > TWO_TURNS and is_bare(part):
            raise UsageError(
                f"{option}: {name}: {part} rad is more than two turns: write {part} deg, or "
                f"{part} rad if that is meant"
            )
    return values


def split(text: str) -> list[str]:
    """``"104 deg, 5.3"`` → ``["104 deg", "5.3"]``; spaces, commas or semicolons in between.

    Brackets around all of them, as results print them, are passed over.

    A word behind a space that does not begin like a number is the unit of the number before it.
    """
    values: list[str] = []
    for part in re.split("[,;]", re.sub(r"^\s*\[(.*)\]\s*$", r"\1", text)):
        for k, word in enumerate(part.split()):
            if k and word[0] not in "+-.0123456789":
                values[-1] += f" {word}"
            else:
                values.append(word)
    return values
