"""A weighted sum of design parameters keeps within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self

import numpy as np

from eigassign.assignment.linear import LinearConstraint
from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.case.case_file import CaseFile
from eigassign.modal.model import Model


class LinearLimit(LimitedQuantity):
    """low ≤ Σ c_j y_j ≤ high: linear in the design, so that each step can keep it exactly."""

    in_one_shot = True

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield the linear limits between design parameters."""
        for name, given in file.design.constraints.items():
            factors = np.array([given.terms.get(column, 0.0) for column in model.y_names])
            low = -np.inf if given.min is None else given.min
            high = np.inf if given.max is None else given.max
            row = LinearConstraint(name, factors, low, high)
            yield cls.between(low, row, high, name, f"design.constraints.{name}")

    @property
    def constraint(self) -> LinearConstraint | None:
        """The same as a row of the program."""
        row = self.terms[0][0]
        return row if isinstance(row, LinearConstraint) else None
