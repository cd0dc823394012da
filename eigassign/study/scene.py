"""A case ready to be studied: its model, trajectory and expansions, in one frozen object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.model import Model
from eigassign.study.approximation import Expansions

Floats = NDArray[np.float64]
BLOCK = 2_000_000  # numbers of a batch of matrices: a second or so of dense solves
OTHERS = 3  # modes shown above the highest assigned one


def _untold(done: int, of: int) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True)
class Scene:
    """What all studies of one case start from. SI units."""

    file: CaseFile
    model: Model
    initial: Floats  # y as the file writes it, (n_y,)
    trajectory: Trajectories | None
    expansions: Expansions
    notes: tuple[str, ...]  # what was chosen and why

    @property
    def path(self) -> Trajectories:
        """The trajectory, or several; raises CaseError where the case has none."""
        if self.trajectory is None:
            problem = self.file.problem("trajectory", "is missing, and needed here")
            raise CaseError((problem,))
        return self.trajectory

    @property
    def q0(self) -> Floats:
        """The expansion point in q, (n_q,)."""
        return self.expansions.full.q0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is implausible in the case file, with its place."""
        return tuple(str(problem) for problem in self.file.warnings)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of y, each (n_y,)."""
        parameters = self.file.design.parameters.values()
        return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])

    @property
    def shown_modes(self) -> tuple[int, ...]:
        """Every mode solved along the trajectory: from 1 to three above the expanded ones."""
        available = self.model.n_dof - self.model.n_rigid
        return tuple(range(1, min(max(self.expansions.modes) + OTHERS, available) + 1))

    def exact(self, y: Floats, tell: Callable[[int, int], None] = _untold) -> Floats:
        """Exact frequencies (n_t, n_shown_modes) in Hz on every sample of the trajectory."""
        q, count = self.path.q, len(self.shown_modes)
        block = max(1, BLOCK // self.model.n_dof**2)
        parts = []
        for start in range(0, len(q), block):  # a signal is heard, and progress told, in between
            parts.append(self.model.frequencies(q[start : start + block], y, count))
            if start + block < len(q):
                tell(start + block, len(q))
        hz = np.concatenate(parts)
        hz.setflags(write=False)
        return hz
