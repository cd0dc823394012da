"""A validated case with what is built from it, each part once and when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile, TipTrajectory
from eigassign.case import Trajectory as TrajectoryKeys
from eigassign.errors import CaseError, MechanismError
from eigassign.mechanism.assembly.assembly import reduced_links
from eigassign.mechanism.assembly.build import (
    WholeLinks,
    build_pencil,
    local_links,
    whole_links,
    with_elements,
    with_reduction,
)
from eigassign.mechanism.inverse_kinematics.chain import tip_chain
from eigassign.mechanism.kinematics.link_frames import build_poses, design_dependence
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.kinematics.travel_limits import resting_pose
from eigassign.mechanism.trajectory.trajectory import (
    NamedTrajectory,
    Trajectories,
    Trajectory,
    build_trajectory,
)
from eigassign.modal.model import Model

if TYPE_CHECKING:
    from eigassign.modal.adaptive.mesh import MeshChoice
    from eigassign.modal.adaptive.reduction import ReductionChoice


Floats = NDArray[np.float64]
LARGE = 1000  # dofs above which the mesh is not doubled to judge it


@dataclass(frozen=True)
class Case:
    """A validated case file with what is built from it; frozen."""

    file: CaseFile

    def model(self) -> Model:
        """The affine ERLS pencil of the mechanism, with exact frequencies."""
        return self._model

    @cached_property
    def _model(self) -> Model:
        return self._assembled(self._reduction, self._whole)

    @cached_property
    def _whole(self) -> WholeLinks:
        """The links of the chosen mesh with all their dofs."""
        return self._unreduced(with_elements(self.file, self._elements))

    def _unreduced(self, file: CaseFile) -> WholeLinks:
        with self.located():
            return whole_links(file)

    def _meshed(
        self,
        elements: Mapping[str, int],
        reduction: Mapping[str, float | None] = MappingProxyType({}),
    ) -> Model:
        """The model with given elements for some of the links, and frequencies they reduce to."""
        return self._assembled(reduction, self._unreduced(with_elements(self.file, elements)))

    def _assembled(self, reduction: Mapping[str, float | None], whole: WholeLinks) -> Model:
        """The model of given links, reduced."""
        file, numbers, motion = whole.case, whole.parameters, whole.motion
        with self.located():
            local = local_links(with_reduction(file, reduction), numbers, motion, whole.meshes)
            pencil = build_pencil(file, numbers, motion, local)
            poses = build_poses(file, numbers, motion)
            reduced = reduced_links(numbers, local[0], pencil)
        return Model(pencil, poses, motion, numbers.coordinates, numbers.design, reduced)

    @property
    def settled(self) -> CaseFile:
        """The file with the numbers that were chosen in the place of ``auto``, for its links.

        Raises AccuracyError as `mesh` does.
        """
        return with_reduction(with_elements(self.file, self._elements), self._reduction)

    @property
    def _elements(self) -> Mapping[str, int]:
        return {} if self.mesh is None else self.mesh.elements

    @property
    def _reduction(self) -> Mapping[str, float | None]:
        return {} if self.reduction is None else self.reduction.frequencies

    @cached_property
    def mesh(self) -> MeshChoice | None:
        """The elements chosen for links that leave them to ``auto``; None where none does.

        Raises AccuracyError where no mesh meets ``expansion.accuracy``.
        """
        from eigassign.study.planning import automatic_elements, settle_mesh

        wanted = automatic_elements(self.file)
        if None not in wanted.values():
            return None
        trial = self._meshed({name: 2 for name, n in wanted.items() if n is None})
        return settle_mesh(self.file, self._meshed, self._looked_at(trial))

    @cached_property
    def reduction(self) -> ReductionChoice | None:
        """The frequencies that links with ``reduce_to: auto`` are reduced to; None without any."""
        from eigassign.study.planning import automatic_reduction, settle_reduction

        names = automatic_reduction(self.file)
        if not names:
            return None

        def build(frequency_hz: float | None) -> Model:
            return self._assembled(dict.fromkeys(names, frequency_hz), self._whole)

        return settle_reduction(self.file, names, build, self._looked_at)

    def _looked_at(self, trial: Model) -> Floats:
        """Poses and designs (n, n_x) at which choices are judged."""
        from eigassign.study.planning import at_corners

        path = self._path(trial) if self.file.trajectories else None
        given = self.file.expansion.q
        q0 = resting_pose(self.file) if given == "auto" else np.array(given, dtype=float)
        return at_corners(self.file, path, q0, self.initial_design).x

    @cached_property
    def initial_design(self) -> Floats:
        """y as the mechanism is written in the file, (n_y,) in SI units."""
        return initial_design(self.file)

    def discretisation_error(self, x: Floats, modes: Sequence[int]) -> Floats | None:
        """Estimated error (n_samples, n_modes) of the mesh, relative in Hz, from a twice finer one.

        None for a mechanism without beam links, or one so large that twice its size is too costly.
        """
        from eigassign.modal.adaptive.mesh import mesh_error
        from eigassign.study.planning import automatic_elements

        model = self.model()
        chosen = self._elements
        elements = {n: chosen.get(n) or k for n, k in automatic_elements(self.file).items()}
        if not elements or model.n_dof > LARGE:
            return None
        fixed = {name: int(n) for name, n in elements.items() if n is not None}

        def build(elements: Mapping[str, int]) -> Model:
            return model if elements == fixed else self._meshed(elements, self._reduction)

        return mesh_error(build, fixed, x, modes)

    @cached_property
    def trajectory(self) -> Trajectories:
        """q(t), of several trajectories all samples one after the other.

        Raises CaseError where the case has none or one cannot be followed.
        """
        return self._path(self.model())

    @property
    def trajectories(self) -> tuple[NamedTrajectory, ...]:
        """Each trajectory by itself: ``(name, trajectory, weight)``."""
        return self.trajectory.parts

    def _path(self, model: Model) -> Trajectories:
        given = self.file.trajectories
        if not given:
            raise CaseError((self.file.problem("trajectory", "is needed here and missing"),))
        found = Trajectories(
            tuple(
                NamedTrajectory(name, self._followed(model, keys, path), keys.weight)
                for path, name, keys in given
            )
        )
        with self.located():
            model.require_on_rails(found.q, self.initial_design, found.sample)
        return found

    def _followed(self, model: Model, keys: TrajectoryKeys, path: str) -> Trajectory:
        """One trajectory, which stands at ``path`` of the case file."""
        with self.located(path):
            self._refuse_moving_tip(model, keys)
            return build_trajectory(
                keys,
                model.q_names,
                lambda tip, oriented: tip_chain(
                    self.file,
                    model.poses.parameters,
                    model.motion,
                    tip,
                    self.initial_design,
                    oriented,
                ),
                self.file.path.parent,
                self.file.coordinate_units,
            )

    def _refuse_moving_tip(self, model: Model, keys: TrajectoryKeys) -> None:
        """A tip path moves q(t) where a design parameter moves the tip: refused by name."""
        if not isinstance(keys, TipTrajectory):
            return
        oriented = keys.angle is not None or keys.orientation is not None
        moved = design_dependence(model.poses, keys.tip, oriented)
        for name, moves in zip(model.y_names, moved, strict=True):
            if moves:
                raise MechanismError(
                    f"design.{name}.parameter",
                    "moves the tip, so the joint angles of the tip path would change with it; "
                    "give joint samples instead",
                )

    @contextmanager
    def located(self, trajectory: str = "trajectory") -> Iterator[None]:
        """Show an error of the mechanism at its line of the case file.

        ``trajectory`` is where the one stands that errors below `trajectory` are about.
        """
        try:
            yield
        except MechanismError as error:
            path = error.path
            if path.split(".")[0] == "trajectory":
                path = trajectory + path.removeprefix("trajectory")
            raise CaseError((self.file.problem(path, error.message),)) from error
