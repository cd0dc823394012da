"""A mode does not fall below a frequency."""

from __future__ import annotations

import numpy as np

from eigassign.case.schema.targets import AtLeastTarget
from eigassign.study.requirements.requirement import Edges, Floats, Requirement, in_hz


class LowerLimit(Requirement):
    """The frequency of a mode is at least ``hz``."""

    form = AtLeastTarget
    of_soft_model = True

    @staticmethod
    def asked(target: AtLeastTarget) -> str:
        """What is asked of the mode, in words."""
        return f"at least {in_hz(target.at_least)}"

    @staticmethod
    def edges(target: AtLeastTarget, *hz: Floats) -> Edges:
        """The limit, and no upper edge."""
        return hz[0], np.full_like(hz[0], np.inf)

    def stake(self, hz: Floats, raised: float) -> float:
        """How far below the limit ``hz`` may be; where it is met with room, that goes first."""
        return float((1.0 - hz / (1.0 + raised) / self.hz).max())
