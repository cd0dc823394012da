"""Two modes stay apart."""

from __future__ import annotations

import numpy as np

from eigassign.assignment.requirements.requirement import Edges, Floats, Requirement, Terms
from eigassign.case.schema.targets import GapTarget


class ModeGap(Requirement):
    """The frequencies of two modes differ by at least ``hz``."""

    form = GapTarget

    @staticmethod
    def asked(target: GapTarget) -> str:
        """The words for what is asked of the modes."""
        return f"at least {target.gap.at_least:g} Hz apart"

    @staticmethod
    def edges(target: GapTarget, *hz: Floats) -> Edges:
        """The distance, and no upper edge."""
        return hz[0], np.full_like(hz[0], np.inf)

    @staticmethod
    def terms_of(modes: tuple[int, ...]) -> Terms:
        """The higher mode less the lower one."""
        low, high = modes
        return (high, 1.0), (low, -1.0)
