"""A mode has a frequency."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.assignment.exact.requirements import FrequencyGoal, FrequencyLimit
from eigassign.assignment.requirements.requirement import Edges, Floats, Requirement, Solved, in_hz
from eigassign.case.schema.targets import FrequencyTarget


class AssignedFrequency(Requirement):
    """The frequency of a mode is ``hz``; the error is the distance to it, of either sign."""

    form = FrequencyTarget
    of_soft_model = True
    columns = ("target", "initial", "one shot", "predicted", "exact")

    @staticmethod
    def asked(target: FrequencyTarget) -> str:
        """The words for what is asked of the mode."""
        return f"at {in_hz(target.frequency)}"

    @staticmethod
    def edges(target: FrequencyTarget, *hz: Floats) -> Edges:
        """The frequency, twice."""
        return hz[0], hz[0]

    def errors(self, solved: Solved) -> Floats:
        """The errors f / f_d − 1 (n,)."""
        return np.asarray(self.curve(solved) / self.hz - 1.0)

    def goals(self) -> Iterator[FrequencyGoal]:
        """Yield the frequency itself."""
        yield FrequencyGoal(self.terms[0][0], self.hz, self.rows, self.weight)

    def limits(self) -> Iterator[FrequencyLimit]:
        """Yield nothing: to miss it violates no limit."""
        yield from ()
