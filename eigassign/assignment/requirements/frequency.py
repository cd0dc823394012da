"""A mode has a frequency, or as high a one as can be."""

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
from eigassign.case.schema.targets import FrequencyTarget, HighestTarget


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


class HighestFrequency(Requirement):
    """The frequency of a mode is as far above 0 Hz as can be: its row of the objective is −f.

    As a limit, of 0 Hz, it is always met.
    """

    form = HighestTarget
    columns = ("initial", "exact")
    is_aim = True

    @staticmethod
    def asked(target: HighestTarget) -> str:
        """The words for what is asked of the mode."""
        return "as high as can be"

    @staticmethod
    def edges(target: HighestTarget, *hz: Floats) -> Edges:
        """0 Hz, and no upper edge."""
        return np.zeros(1), np.full(1, np.inf)

    def stake(self, solved: Solved, raised: float) -> float:
        """The share of its frequency that a model has raised it by at most."""
        return raised / (1.0 + raised) if np.isfinite(raised) else 1.0

    @property
    def forbidden_hz(self) -> tuple[Floats | None, Floats | None]:
        """None: every frequency is allowed."""
        return None, None
