"""A mode has a frequency."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.assignment.requirements.requirement import (
    EdgeRows,
    Edges,
    Floats,
    Requirement,
    Solved,
    in_hz,
)
from eigassign.assignment.targets import positive_hz
from eigassign.case.schema.targets import FrequencyTarget


class AssignedFrequency(Requirement):
    """The frequency of a mode is ``hz``; the error is the distance to it, of either sign.

    Raises UsageError for a frequency that is not finite and above 0.
    """

    form = FrequencyTarget
    columns = ("target", "initial", "one shot", "predicted", "exact")

    def __post_init__(self) -> None:
        super().__post_init__()
        positive_hz(self.lower)

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

    def edge_rows(self, factor: Floats | float = 1.0) -> Iterator[EdgeRows]:
        """Yield factor · (f / f_d − 1), of either sign: to miss it violates no limit."""
        yield EdgeRows(self, "lower", self.hz, factor / self.hz)
