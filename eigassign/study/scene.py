"""A case ready to be studied: its model, trajectory and expansions, in one frozen object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.requirements import Tolerances
from eigassign.assignment.program import LinearConstraint
from eigassign.assignment.requirements.quantity import DriveLimit, LimitedQuantity, StaticLimit
from eigassign.assignment.requirements.sampling import design_limits
from eigassign.brief import Brief
from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError, CaseError, MissingMassError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import solve_blocks
from eigassign.modal.expansion import Expansion, NearestExpansion
from eigassign.modal.model import Model
from eigassign.study.planning import Plan

Floats = NDArray[np.float64]
OTHERS = 3  # modes shown above the highest assigned one


@dataclass(frozen=True, repr=False)
class Expansions(Brief):
    """The full and the partially linearised expansions of the same modes about the same points.

    ``order`` is that of the linearised ones, as asked for; ``full_order`` may be lower, where the
    full set would be too large. (The degree of a set may be lower still: where no coordinate
    matters, the linearised set is linear whatever its order.)
    """

    fulls: NearestExpansion
    linears: NearestExpansion
    order: int
    full_order: int

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes that both hold, in the order of their columns."""
        return self.fulls.modes

    @property
    def full(self) -> Expansion:
        """The full expansion about the first point."""
        return self.fulls.parts[0]

    @property
    def linear(self) -> Expansion:
        """The partially linearised one."""
        return self.linears.parts[0]

    def taylor_hz(self, q: Floats, y: Floats) -> Floats:
        """Full expansion at samples, (n, n_modes) in Hz; each by the nearest point."""
        return self.fulls.frequencies(q, y)

    def linearised_hz(self, q: Floats, y: Floats) -> Floats:
        """Partially linearised expansion at samples, (n, n_modes) in Hz."""
        return self.linears.frequencies(q, y)

    def linear_in_design(self, path: Trajectories) -> tuple[Floats, Floats]:
        """l_0 (n, n_modes) and l (n, n_modes, n_y) of eq. (9) along a path; all points share y0.

        Where q follows the design, l is the total derivative ∂λ/∂y + ∂λ/∂q dq/dy at (q(y0), y0).
        Raises TrajectoryError where the design y0 cannot follow the path.
        """
        q, of_design = path.at(self.full.y0)
        l0, slopes = self.linears.slopes(q, self.full.y0)
        return l0, path.in_design(slopes, of_design)

    def column(self, mode: int) -> int:
        """Column of ``mode`` in what the expansions evaluate to."""
        return self.modes.index(mode)


@dataclass(frozen=True)
class Scene:
    """The model, trajectory and expansions that all studies of one case start from. SI units."""

    file: CaseFile
    model: Model
    initial: Floats  # y as the file writes it, (n_y,)
    trajectory: Trajectories | None
    plan: Plan
    expanded: Expansions | None  # None where an answer does without
    notes: tuple[str, ...]  # what was chosen and why

    @property
    def expansions(self) -> Expansions:
        """The expansions; raises AccuracyError where there are none."""
        if self.expanded is None:
            raise AccuracyError("no expansion meets the accuracy that is asked for")
        return self.expanded

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes that are expanded, or would be: those with a target, or of the file."""
        return self.plan.modes

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
        return self.plan.q0

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of what is implausible in the case file, with its place."""
        return tuple(str(problem) for problem in self.file.warnings)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of y, each (n_y,)."""
        parameters = self.file.design.parameters.values()
        return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])

    @cached_property
    def tolerances(self) -> Tolerances:
        """How far the parameters may deviate from what they are made to be."""
        each = [column.tolerance for column in self.file.design.parameters.values()]
        share, amount = (
            np.array([one.amount if one and one.relative == of else 0.0 for one in each])
            for of in (True, False)
        )
        quantities = self.file.design_quantities
        return Tolerances(share, amount, np.array([0 in (q.at_least, q.above) for q in quantities]))

    @cached_property
    def limits(self) -> tuple[LimitedQuantity, ...]:
        """The limits of quantities of the design, at all samples of the trajectories."""
        return design_limits(self.file, self.model, self.trajectory)

    @property
    def statics(self) -> tuple[StaticLimit, ...]:
        """Those of static targets."""
        return tuple(one for one in self.limits if isinstance(one, StaticLimit))

    @property
    def followed_limits(self) -> tuple[LimitedQuantity, ...]:
        """The limits that are looked at between the samples: static targets and drives."""
        return tuple(one for one in self.limits if isinstance(one, StaticLimit | DriveLimit))

    @property
    def constraints(self) -> tuple[LinearConstraint, ...]:
        """The limits that are linear in the design."""
        return tuple(one.constraint for one in self.limits if one.constraint is not None)

    def shown_modes(self, asked: int = 1) -> int:
        """The number of modes shown along the trajectory: up to three above those ``asked`` for.

        Those are the expanded ones too; of the three, as many as have mass.
        """
        available = self.model.n_dof - self.model.n_rigid
        highest = max(*self.modes, asked)
        last = min(highest + OTHERS, available)
        try:
            self.model.frequencies(self.q0, self.initial, last)
        except MissingMassError as error:
            last = max(highest, error.most)
        return last

    def exact(
        self,
        y: Floats,
        count: int | None = None,
        progress: Callable[[int, int], None] = lambda _done, _of: None,
    ) -> Floats:
        """Exact frequencies (n_t, count or `shown_modes`) in Hz on every sample, at design y.

        They are solved in blocks: between two of them ``progress`` is called with the number of
        samples done and of all, and signals are handled.
        """
        q, count = self.path.at(y)[0], self.shown_modes() if count is None else count
        parts, done = [], 0
        for some in solve_blocks(q, self.model.n_dof):
            parts.append(self.model.frequencies(some, y, count))
            done += len(some)
            if done < len(q):
                progress(done, len(q))
        hz = np.concatenate(parts)
        hz.setflags(write=False)
        return hz
