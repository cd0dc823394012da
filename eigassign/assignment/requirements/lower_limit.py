"""A mode does not fall below a frequency."""

from __future__ import annotations

import numpy as np

from eigassign.assignment.requirements.requirement import Edges, Floats, Requirement, in_hz
from eigassign.case.schema.targets import AtLeastTarget


class LowerLimit(Requirement):
    """The frequency of a mode is at least ``hz``."""

    form = AtLeastTarget
    of_soft_model = True

    @staticmethod
    def asked(target: AtLeastTarget) -> str:
        """The words for what is asked of the mode."""
        return f"at least {in_hz(target.at_least)}"

    @staticmethod
    def edges(target: AtLeastTarget, *hz: Floats) -> Edges:
        """The limit, and no upper edge."""
        return hz[0], np.full_like(hz[0], np.inf)

    def stake(self, hz: Floats, raised: float) -> float:
        """The relative way of ``hz`` below the limit at worst; room that is left goes first."""
        return float((1.0 - hz / (1.0 + raised) / self.hz).max())
