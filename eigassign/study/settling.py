"""What a case leaves to ``auto`` for its links, settled: numbers of elements, reduction, the model.

Both are chosen from estimates at poses of the trajectory and corners of the design's box, within
their shares of ``expansion.accuracy`` (`planning`). The order and the expansion points are settled
later, from the model that is built here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.sampling import requirements_of, with_instants
from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import (
    LOWEST,
    WholeLinks,
    with_elements,
    with_reduction,
)
from eigassign.mechanism.kinematics.parameters import initial_design, is_imported
from eigassign.mechanism.kinematics.travel_limits import resting_pose
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.adaptive.cheapest import cheapest
from eigassign.modal.adaptive.link_reduction import ReductionChoice, reductions
from eigassign.modal.adaptive.mesh import MeshChoice
from eigassign.modal.model import Model
from eigassign.study.build import build_links, build_model, build_trajectories
from eigassign.study.planning import (
    TRIAL,
    at_corners,
    automatic_elements,
    automatic_reduction,
    modes_that_matter,
    settle_mesh,
    standing,
    truncation_share,
    with_middle_loads,
)

Floats = NDArray[np.float64]


# Times the highest frequency that matters: where elements are chosen imported parts with
# `reduce_to: auto` are reduced to that, far beyond what is chosen for them then
BEYOND = 8.0


@dataclass(frozen=True)
class SettledModel:
    """A model with the file it is of: ``file`` has numbers in place of ``auto`` for its links."""

    file: CaseFile
    model: Model
    mesh: MeshChoice | None  # the elements chosen; None where all are given
    reduction: ReductionChoice | None  # the frequencies chosen; None without ``reduce_to: auto``


def settle_model(file: CaseFile) -> SettledModel:
    """Choose elements, then the frequencies that links are reduced to, and build the model.

    Raises AccuracyError where no mesh meets ``expansion.accuracy``, CaseError at the line of what
    cannot be modelled.
    """
    mesh = _chosen_elements(file)
    meshed = file if mesh is None else with_elements(file, mesh.elements)
    links = build_links(meshed)
    reduction = _chosen_reduction(meshed, links)
    settled = meshed if reduction is None else with_reduction(meshed, reduction.frequencies)
    return SettledModel(settled, build_model(settled, links), mesh, reduction)


def _chosen_elements(file: CaseFile) -> MeshChoice | None:
    wanted = automatic_elements(file)
    if None not in wanted.values():
        return None

    def meshed(to_hz: float, elements: Mapping[str, int]) -> Model:
        meshed = with_elements(file, elements)
        return build_model(with_reduction(meshed, dict.fromkeys(parts, to_hz)))

    parts = [name for name in automatic_reduction(file) if is_imported(file, name)]
    trial = meshed(LOWEST, {name: TRIAL for name, given in wanted.items() if given is None})
    path, q0 = _path(file, trial)
    modes_at = modes_that_matter(file, _bands_hz(file, path))
    beyond = LOWEST
    if parts:
        q, y = q0 if path is None else path.q[0], initial_design(file)
        highest = max(modes_at(trial, trial.x(q, y)))
        beyond = BEYOND * float(trial.frequencies(q, y, highest).max())
    return settle_mesh(file, partial(meshed, beyond), path, q0, modes_at)


def _chosen_reduction(file: CaseFile, links: WholeLinks) -> ReductionChoice | None:
    names = automatic_reduction(file)
    if not names:
        return None

    def reduced(frequency_hz: float) -> Model:
        return build_model(with_reduction(file, dict.fromkeys(names, frequency_hz)), links)

    whole = build_model(with_reduction(file, dict.fromkeys(names)), links)
    upright = whole
    if whole.pencil.weight is not None:  # inside imported parts it changes nothing
        at_nodes = {n: LOWEST if is_imported(file, n) else None for n in names}
        upright = build_model(with_reduction(file, at_nodes), links)
    path, q0 = _path(file, upright)
    x = standing(at_corners(file, path, q0, initial_design(file)), upright).x
    modes_at = modes_that_matter(file, _bands_hz(file, path))
    return cheapest(reductions(names, whole, reduced, x, modes_at), truncation_share(file))


def _bands_hz(file: CaseFile, path: Trajectories | None) -> Floats:
    """The highest edges of the bands that every mode shall keep out of, (k,) in Hz."""
    if path is None:
        return np.empty(0)
    bands = (
        one
        for w in requirements_of(file, with_instants(file, path))
        for one in w.bands
        if not one.modes
    )
    return np.array([band.upper.max() for band in bands])


def _path(file: CaseFile, trial: Model) -> tuple[Trajectories | None, Floats]:
    """The trajectories, and a pose q where there are none."""
    path = build_trajectories(file, trial) if file.trajectories else None
    given = file.expansion.q
    return path, with_middle_loads(file, resting_pose(file) if given == "auto" else given)
