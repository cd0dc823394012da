"""The mass of the mechanism keeps within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self

import numpy as np

from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.modal.model import Model

_PLACE = "design.mass"


class MassLimit(LimitedQuantity):
    """The mass in kg of all links and bodies, those that never move included."""

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield the limits of the mass, if there are any."""
        if (given := file.design.mass) is not None:
            low = -np.inf if given.min is None else given.min
            high = np.inf if given.max is None else given.max
            yield cls.between(low, model.total_mass, high, _PLACE, _PLACE)

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits."""
        return "the limit of the mass"

    def relaxed(self, side: str, share: float) -> str:
        """The words for a limit that is relaxed by a share of it."""
        edge, more = (self.upper, "more") if side == "upper" else (self.lower, "less")
        return f"{handy(share * float(edge[0]), 'kg')} {more} mass"
