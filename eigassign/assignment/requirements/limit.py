"""A mode does not fall below a frequency, or does not exceed it."""

from __future__ import annotations

import numpy as np

from eigassign.assignment.requirements.requirement import Edges, Floats, Requirement, in_hz
from eigassign.case.schema.targets import AtLeastTarget, AtMostTarget


class LowerLimit(Requirement):
    """The frequency of a mode is at least ``hz``."""

    form = AtLeastTarget

    @staticmethod
    def asked(target: AtLeastTarget) -> str:
        """The words for what is asked of the mode."""
        return f"at least {in_hz(target.at_least)}"

    @staticmethod
    def edges(target: AtLeastTarget, *hz: Floats) -> Edges:
        """The limit, and no upper edge."""
        return hz[0], np.full_like(hz[0], np.inf)


class UpperLimit(Requirement):
    """The frequency of a mode is at most ``hz``; too stiff a model is on the safe side."""

    form = AtMostTarget

    @staticmethod
    def asked(target: AtMostTarget) -> str:
        """The words for what is asked of the mode."""
        return f"at most {in_hz(target.at_most)}"

    @staticmethod
    def edges(target: AtMostTarget, *hz: Floats) -> Edges:
        """No lower edge, and the limit."""
        return np.full_like(hz[0], -np.inf), hz[0]
