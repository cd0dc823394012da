"""A validated case with what is built from it: model and trajectories, and what it leaves to auto.

Elements and reductions are measured at poses of the trajectory and corners of the design's box,
against finer meshes and whole links, to be within their shares of ``expansion.accuracy``
(`planning`). Order and expansion points are settled later, from the model that is built here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.requirements.sampling import requirements_of, with_instants
from eigassign.case.case_file import CaseFile, from_mapping, load
from eigassign.case.schema.trajectory import DURATION_PATH
from eigassign.case.units import handy
from eigassign.errors import (
    AccuracyError,
    CaseError,
    MechanismError,
    SingularityError,
    TrajectoryError,
    UsageError,
)
from eigassign.mechanism.assembly.build import (
    LOWEST,
    WholeLinks,
    build_pencil,
    local_links,
    whole_links,
    with_elements,
    with_reduction,
)
from eigassign.mechanism.assembly.held import require_held
from eigassign.mechanism.assembly.mode_shapes import total_mass
from eigassign.mechanism.inverse_kinematics.chain import tip_chain
from eigassign.mechanism.kinematics.forward import build_link_frames, design_dependence
from eigassign.mechanism.kinematics.parameters import initial_design, is_imported, resting_pose
from eigassign.mechanism.trajectory.trajectory import (
    NamedTrajectory,
    Trajectories,
    Trajectory,
    build_trajectory,
)
from eigassign.modal.arguments import spread
from eigassign.modal.exact.solver import rounding_error
from eigassign.modal.mesh_error import solid_links, standing_frequencies
from eigassign.modal.model import Model
from eigassign.process import one_thread
from eigassign.study.planning import (
    SERIES,
    TRUNCATION,
    asked_accuracy,
    at_corners,
    automatic_elements,
    corners,
    far_from_buckling,
    modes_that_matter,
    reduced_to,
    scattered,
    standing,
    with_middle_loads,
)


@contextmanager
def located(file: CaseFile, trajectory: str = "trajectory") -> Iterator[None]:
    """Raise a MechanismError from inside as a CaseError at its line of the case file.

    ``trajectory`` is the key of the one that errors below `trajectory` are about. Loops that cannot
    be closed are a SingularityError, which names the pose, and have the place of the joints.
    """
    try:
        yield
    except SingularityError as error:
        message = f"{error}: keep the poses away from there, or choose mechanism.assembly otherwise"
        raise CaseError((file.problem("mechanism.joints", message),)) from error
    except MechanismError as error:
        path = error.path
        if path.split(".")[0] == "trajectory":
            path = trajectory + path.removeprefix("trajectory")
        problems = [file.problem(path, error.message)]
        if isinstance(error, TrajectoryError):
            may_be = "this may be why the trajectory cannot be followed"
            problems += [
                replace(warning, message=f"{may_be}: {warning.message}")
                for warning in file.warnings
                if warning.path.startswith(("mechanism.links", "mechanism.joints", "trajectory"))
            ]
        raise CaseError(tuple(problems)) from error


def build_links(file: CaseFile) -> WholeLinks:
    """The links with all dofs of their meshes, before any is reduced; raises CaseError."""
    with located(file):
        return whole_links(file)


def build_model(file: CaseFile, links: WholeLinks | None = None) -> Model:
    """K(q, y) and M(q, y) of eq. (1) as an affine pencil, with exact frequencies.

    ``links`` are those of the same file if they are built already; they are reduced as ``file``
    says. Raises CaseError at the line of what cannot be modelled.
    """
    links = build_links(file) if links is None else links
    parameters, motion = links.parameters, links.motion
    with located(file):
        if file.responses:
            require_held(file, motion, "a response")
        local = local_links(file, parameters, motion, links.meshes)
        pencil = build_pencil(file, parameters, motion, local)
        poses = build_link_frames(file, parameters, motion)
        meshes = local[1].meshes
        solids = solid_links(parameters, local[0], meshes, pencil)
        mass = total_mass(file, parameters, links.meshes.values())
    q_names = (*parameters.coordinates, *parameters.loads)
    given = pencil, poses, motion, mass, q_names, parameters.design
    return Model(*given, meshes, solids)


def build_trajectories(file: CaseFile, model: Model) -> Trajectories:
    """q(t) of every trajectory of the case, a tip path by inverse kinematics at the initial design.

    Raises CaseError where the case has none, or one cannot be followed.
    """
    if not file.trajectories:
        raise CaseError((file.problem("trajectory", "is needed here and missing"),))
    every = enumerate(file.trajectories)
    own = (NamedTrajectory(n, _loaded(file, model, k), keys.weight) for k, (_, n, keys) in every)
    found = Trajectories(tuple(own))
    with located(file):
        model.require_standing(found.q, initial_design(file), found.sample)
    return found


def _loaded(file: CaseFile, model: Model, k: int) -> Trajectory:
    """Trajectory k of the case file, its loads behind the coordinates in q."""
    path, _, keys = file.trajectories[k]
    loads = np.array([load.along[k] for load in file.loads.values()])
    parameters, y = model.poses.parameters, initial_design(file)
    with located(file, path):
        found = build_trajectory(
            keys,
            parameters.coordinates,
            lambda tip, turns: tip_chain(file, parameters, model.motion, tip, y, turns, loads),
            file.coordinate_units,
            lambda tip, turns: bool(design_dependence(model.poses, tip, turns).any()),
        )
    designed = [column.parameter for column in file.design.parameters.values()]
    if DURATION_PATH in designed:
        stretch = designed.index(DURATION_PATH), file.value_at(DURATION_PATH)
        found = replace(found, stretch=stretch)
    if not len(loads):
        return found
    said = [f"{name} = {handy(load.along[k], load.unit, 6)}" for name, load in file.loads.items()]
    return replace(found.joined(loads), notes=(*said, *found.notes))


# Poses and designs at which reduced links are judged; each costs a solve of the whole ones, and of
# these where they are large half a second
POSES, FEW_POSES = 6, 2
ELEMENTS = tuple(2**k for k in range(1, 9))  # of a link; with more round-off, as n⁴, is larger
LOOKS = 60  # poses and designs at corners of the bounds that a mesh is chosen at; a third between
# Times the highest frequency that matters: where elements are chosen imported parts with
# `reduce_to: auto` are reduced to that, far beyond what is chosen for them then
BEYOND = 8.0


class Choice(NamedTuple):
    """A number for each link, None where it stays whole; how far that is off, about; the tries."""

    values: Mapping[str, Any]
    error: float
    reasons: tuple[str, ...]


class SettledModel(NamedTuple):
    """A model with the file it is of: ``file`` has numbers in place of ``auto`` for its links."""

    file: CaseFile
    model: Model
    mesh: Choice | None  # the elements chosen; None where all are given
    reduction: Choice | None  # the frequencies chosen, in Hz; None without ``reduce_to: auto``

    @property
    def reasons(self) -> tuple[str, ...]:
        """All that was tried for both, in words."""
        return tuple(line for one in (self.mesh, self.reduction) if one for line in one.reasons)


def settle_model(file: CaseFile) -> SettledModel:
    """Choose elements, then the frequencies that links are reduced to, and build the model.

    Raises AccuracyError where no mesh meets ``expansion.accuracy``, CaseError at the line of what
    cannot be modelled.
    """
    mesh = reduction = None
    asked, names, meshed = asked_accuracy(file), _left_to_auto(file), file
    if None in automatic_elements(file).values():
        share = 1.0 - SERIES - TRUNCATION * bool(reduced_to(file))
        mesh = first_within(share * asked, _finer_meshes(file, share * asked))
        meshed = with_elements(file, mesh.values)
    links, settled = build_links(meshed), meshed
    if names:
        reduction = first_within(TRUNCATION * asked, _less_reduced(meshed, links, names))
        settled = with_reduction(meshed, reduction.values)
    return SettledModel(settled, build_model(settled, links), mesh, reduction)


Try: TypeAlias = tuple[Mapping[str, Any], str, float]  # values, words, error


def first_within(accuracy: float, tries: Iterator[Try]) -> Choice:
    """The first of ``tries`` with an error within the accuracy; raises AccuracyError for none."""
    reasons = list[str]()
    for values, words, error in tries:
        reasons.append(words)
        if error <= accuracy:
            return Choice(values, error, tuple(reasons))
    raise AccuracyError(f"no mesh meets the accuracy {accuracy:.1e}: {reasons[-1]}")


def _finer_meshes(file: CaseFile, accuracy: float) -> Iterator[Try]:
    """Twice and twice as many elements for links left to ``auto``; raises AccuracyError."""
    elements, y = automatic_elements(file), initial_design(file)
    parts = [name for name in _left_to_auto(file) if is_imported(file, name)]

    def meshed(count: int, to_hz: float = LOWEST) -> Model:
        meshed = with_elements(file, {name: n or count for name, n in elements.items()})
        return build_model(with_reduction(meshed, dict.fromkeys(parts, to_hz)))

    trial, beyond = meshed(ELEMENTS[0]), LOWEST
    path, q0 = _path(file, trial)
    modes_at = modes_that_matter(file, _bands_hz(file, path))
    if parts:
        q = q0 if path is None else path.q[0]
        highest = max(modes_at(trial, trial.x(q, y)))
        beyond = BEYOND * float(trial.frequencies(q, y, highest).max())
    ends = corners(len(y))
    x = at_corners(file, path, q0, y, ends, max(1, LOOKS // (1 + len(ends))))
    x = standing(np.vstack([x, scattered(file, path, q0, LOOKS // 3)]), trial)
    for count in ELEMENTS:
        model = meshed(count, beyond)
        lost = rounding_error(model.pencil, x[0], max(modes_at(model, x)))
        if lost > accuracy:
            raise AccuracyError(
                f"round-off is {lost:.1e} with {count} elements, above the accuracy "
                f"{accuracy:.1e}, and a finer mesh makes it larger: ask for less"
            )
        kept, (q, y) = far_from_buckling(model, x), np.split(x, [len(q0)], axis=1)
        modes = modes_at(model, x[kept]) if kept.any() else ()
        worst = float(model.beam_error(q[kept], y[kept], modes).max()) if modes else 0.0
        said = f"about {100.0 * worst:.2g} % too high" if worst < np.inf else "not resolved"
        words = f"{count} elements: {said}, at {len(x)} poses and designs"
        yield {name: n or count for name, n in elements.items()}, words, worst


def _less_reduced(file: CaseFile, links: WholeLinks, names: Sequence[str]) -> Iterator[Try]:
    """Twice and twice as high frequencies to reduce to, judged by whole links; then these."""
    whole = build_model(with_reduction(file, dict.fromkeys(names)), links)
    upright = whole
    if whole.pencil.weight is not None:  # inside imported parts it changes little
        at_nodes = {n: LOWEST if is_imported(file, n) else None for n in names}
        upright = build_model(with_reduction(file, at_nodes), links)
    path, q0 = _path(file, upright)
    few = POSES if whole.pencil.is_dense else FEW_POSES
    x = spread(standing(at_corners(file, path, q0, initial_design(file)), upright), few)
    modes = modes_that_matter(file, _bands_hz(file, path))(whole, x)
    exact, pick = standing_frequencies(whole.pencil, x, max(modes)), np.array(modes) - 1
    for frequency in exact[0].max() / np.pi * 2.0 ** np.arange(10):
        to_hz = dict.fromkeys(names, float(frequency))
        model = build_model(with_reduction(file, to_hz), links)
        if not model.is_reduced or model.n_dof > 0.5 * whole.n_dof:
            break
        hz = standing_frequencies(model.pencil, x, max(modes))
        worst = float(np.abs(hz / exact - 1.0)[:, pick].max())
        tried = f"reduced to {frequency:.4g} Hz: {model.n_dof} of {whole.n_dof} dofs"
        yield to_hz, f"{tried}, {100 * worst:.2g} % too high", worst
    words = f"not reduced, because it saves too little: {', '.join(names)}"
    yield dict.fromkeys(names), words, 0.0


def _left_to_auto(file: CaseFile) -> list[str]:
    """The links with ``reduce_to: auto``."""
    return [name for name, frequency in reduced_to(file).items() if frequency == "auto"]


def _bands_hz(file: CaseFile, path: Trajectories | None) -> Floats:
    """The highest edges of the bands that every mode shall keep out of, (k,) in Hz."""
    wanted = () if path is None else requirements_of(file, with_instants(file, path))
    return np.array([band.upper.max() for w in wanted for band in w.bands if not band.modes])


def _path(file: CaseFile, trial: Model) -> tuple[Trajectories | None, Floats]:
    """The trajectories, and a pose q where there are none."""
    path = build_trajectories(file, trial) if file.trajectories else None
    given = file.expansion.q
    return path, with_middle_loads(file, resting_pose(file) if given == "auto" else given)


@dataclass(frozen=True)
class BuiltCase:
    """A validated case file with what is built from it; frozen."""

    file: CaseFile

    def __repr__(self) -> str:
        return repr(self.file).replace("CaseFile", type(self).__name__, 1)

    def model(self) -> Model:
        """The affine ERLS pencil of the mechanism, with exact frequencies.

        Raises CaseError for a mechanism that cannot be modelled, AccuracyError where elements are
        left to ``auto`` and no mesh meets ``expansion.accuracy``.
        """
        return self.settled.model

    @cached_property
    @one_thread
    def settled(self) -> SettledModel:
        """The model with what was chosen for links that leave it to ``auto``; raises as `model`."""
        return settle_model(self.file)

    @property
    def mesh(self) -> Choice | None:
        """The elements chosen for links that leave them to ``auto``; None where none does."""
        return self.settled.mesh

    @cached_property
    def initial_design(self) -> Floats:
        """y as the mechanism is written in the file, (n_y,) in SI units."""
        return initial_design(self.file)

    @cached_property
    @one_thread
    def trajectory(self) -> Trajectories:
        """q(t), of several trajectories all samples one after the other.

        Raises CaseError where the case has none or one cannot be followed.
        """
        return build_trajectories(self.file, self.model())

    @property
    def trajectories(self) -> tuple[NamedTrajectory, ...]:
        """The trajectories one by one: ``(name, trajectory, weight)``."""
        return self.trajectory.parts

    def located(self) -> AbstractContextManager[None]:
        """Raise a MechanismError from inside as a CaseError at its line of the case file."""
        return located(self.file)


def load_case(given: str | Path | Mapping[str, Any], allow_outside: bool = False) -> BuiltCase:
    """Read and validate a case file, or a mapping like one; CaseError with every problem found.

    ``allow_outside``: the case may name files that do not lie below its own folder, or below the
    current one where it is a mapping.
    """
    if isinstance(given, Mapping):
        return BuiltCase(from_mapping(given, allow_outside=allow_outside))
    if not isinstance(given, str | Path):
        raise UsageError(f"expected the path of a case file, or a mapping, got {given!r:.60}")
    return BuiltCase(load(given, allow_outside))
