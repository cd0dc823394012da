"""A quantity of the design keeps within its limits, of whatever kind it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self

import numpy as np

from eigassign.assignment.requirements.requirement import Quantity, Requirement
from eigassign.case.case_file import CaseFile
from eigassign.modal.model import Model


class LimitedQuantity(Requirement):
    """low ≤ quantity(y) ≤ high, in SI units; no kind of target, for it belongs to no mode."""

    is_goal = False
    is_convex = True  # the designs that it allows, where the quantity is affine

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield what the case file limits, and nothing where it limits nothing."""
        raise NotImplementedError

    @classmethod
    def between(cls, low: float, quantity: Quantity, high: float, label: str, place: str) -> Self:
        """The limits of a quantity that has one value for all samples."""
        return cls(label, place, ((quantity, 1.0),), slice(0, 1), np.array([low]), np.array([high]))
