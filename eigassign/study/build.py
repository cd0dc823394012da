"""From a case file in which every number is given to its model and the trajectories it follows.

Nothing is chosen here: what a file leaves to ``auto`` is settled one step further, in `built_case`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.trajectory import TrajectoryForm
from eigassign.errors import (
    CaseError,
    MechanismError,
    SingularityError,
    TrajectoryError,
)
from eigassign.mechanism.assembly.build import (
    WholeLinks,
    build_pencil,
    local_links,
    whole_links,
)
from eigassign.mechanism.assembly.mode_shapes import total_mass
from eigassign.mechanism.inverse_kinematics.chain import tip_chain
from eigassign.mechanism.kinematics.forward import build_link_frames, design_dependence
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import (
    NamedTrajectory,
    Trajectories,
    Trajectory,
    build_trajectory,
)
from eigassign.modal.mesh_error import solid_links
from eigassign.modal.model import Model

Floats = NDArray[np.float64]


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
    found = Trajectories(
        tuple(
            NamedTrajectory(name, _loaded(file, model, k), keys.weight)
            for k, (_, name, keys) in enumerate(file.trajectories)
        )
    )
    with located(file):
        model.require_standing(found.q, initial_design(file), found.sample)
    return found


def _loaded(file: CaseFile, model: Model, k: int) -> Trajectory:
    """Trajectory k of the case file, its loads behind the coordinates in q."""
    path, _, keys = file.trajectories[k]
    loads = np.array([load.along[k] for load in file.loads.values()])
    found = _followed(file, model, keys, path, loads)
    if not len(loads):
        return found
    said = [f"{name} = {load.along[k]:.6g} {load.unit}" for name, load in file.loads.items()]
    return replace(found.joined(loads), notes=(*said, *found.notes))


def _followed(
    file: CaseFile, model: Model, keys: TrajectoryForm, path: str, loads: Floats
) -> Trajectory:
    """One trajectory of the coordinates, which stands at ``path`` of the case file."""
    parameters, y = model.poses.parameters, initial_design(file)
    with located(file, path):
        return build_trajectory(
            keys,
            parameters.coordinates,
            lambda tip, oriented: tip_chain(
                file, parameters, model.motion, tip, y, oriented, loads
            ),
            file.coordinate_units,
            lambda tip, oriented: bool(design_dependence(model.poses, tip, oriented).any()),
        )
