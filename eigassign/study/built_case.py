"""A validated case with what is built from it, each part once and when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.loading import from_mapping, load
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import NamedTrajectory, Trajectories
from eigassign.modal.model import Model
from eigassign.study.build import build_trajectories, located
from eigassign.study.settling import MeshChoice, ReductionChoice, SettledModel, settle_model

Floats = NDArray[np.float64]


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
        return self._settled.model

    @cached_property
    def _settled(self) -> SettledModel:
        return settle_model(self.file)

    @property
    def settled(self) -> CaseFile:
        """The file with numbers in place of ``auto`` for its links; raises as `model` does."""
        return self._settled.file

    @property
    def mesh(self) -> MeshChoice | None:
        """The elements chosen for links that leave them to ``auto``; None where none does."""
        return self._settled.mesh

    @property
    def reduction(self) -> ReductionChoice | None:
        """The frequencies that links with ``reduce_to: auto`` are reduced to; None without any."""
        return self._settled.reduction

    @cached_property
    def initial_design(self) -> Floats:
        """y as the mechanism is written in the file, (n_y,) in SI units."""
        return initial_design(self.file)

    @cached_property
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
    return BuiltCase(load(given, allow_outside))
