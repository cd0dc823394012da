"""The least frequency of a mode is as high as can be."""

from __future__ import annotations

import numpy as np

from eigassign.assignment.requirements.requirement import Edges, Floats, Requirement, Solved
from eigassign.case.schema.targets import HighestTarget


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
