"""A quantity of the design keeps within its limits: the mass, or a weighted sum of parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np

from eigassign.assignment.linear import LinearConstraint
from eigassign.assignment.requirements.requirement import (
    Edges,
    Floats,
    Frequencies,
    Quantity,
    Requirement,
    Solved,
)
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.mechanism.assembly.total_mass import TotalMass
from eigassign.modal.model import Model

_MASS = "design.mass"
_NO_MODES = Frequencies(np.zeros((1, 0)), np.zeros((1, 0, 0)))


class LimitedQuantity(Requirement):
    """low ≤ quantity(y) ≤ high, in SI units; no kind of target, for it belongs to no mode."""

    is_goal = False
    unit: ClassVar[str] = ""  # SI, that its amounts are said in
    extreme: ClassVar[tuple[str, str]] = ("the least is", "the most is")

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield what the case file limits, and nothing where it limits nothing."""
        raise NotImplementedError

    @classmethod
    def between(cls, low: float, high: float, quantity: Quantity, label: str, place: str) -> Self:
        """The limits, infinite without one, of a quantity that has one value for all samples."""
        lower, upper = np.array([low]), np.array([high])
        return cls(label, place, ((quantity, 1.0),), slice(0, 1), lower, upper)

    @property
    def is_affine(self) -> bool:
        """True where it is affine in the design, and so allows a convex set of designs."""
        return True

    @property
    def is_convex(self) -> bool:
        """True where it allows a convex set of designs."""
        return self.is_affine

    def range_over(self, lower: Floats, upper: Floats, lowest: Solved, highest: Solved) -> Edges:
        """Its range over designs between two (n_y,); endless where it is not affine."""
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        if half.any() and not self.is_affine:
            return np.array([-np.inf]), np.array([np.inf])
        amount, slopes = self.value(middle, _NO_MODES)
        reach = np.abs(slopes) @ half
        return amount - reach, amount + reach

    # --- Amounts in words

    @property
    def noun(self) -> str:
        """The quantity, before an amount of it."""
        return self.label

    def amount(self, y: Floats) -> float:
        """The quantity of a design (n_y,), SI."""
        value, c = self.terms[0]
        assert not isinstance(value, int)
        return float(np.asarray(c * value(y)[0]))

    def slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of the quantity at a design (n_y,)."""
        value, c = self.terms[0]
        assert not isinstance(value, int)
        return np.asarray(c * value(y)[1])

    def violation(self, amount: float, reach: float) -> float:
        """The way of an amount beyond a limit, relative to that; 0 within both.

        Relative to ``reach`` where that is larger: what the quantity changes over the bounds.
        """
        beyond = (s * (amount - edge) / (max(abs(edge), reach) or 1.0) for s, edge in self._edges)
        return max(0.0, *(one for one in beyond if np.isfinite(one)))

    @property
    def asked_words(self) -> str:
        """``mass at most 3 kg``."""
        return f"{self.noun} {self._asked}"

    def stated(self, amount: float, extreme: float | None) -> str:
        """``mass 5.47 kg, at most 3 kg``, and where given what the most extreme design has."""
        words = f"{self.noun} {self._said(amount)}, {self._asked}"
        if extreme is None:
            return words
        return f"{words}; {self.extreme[int(extreme < self._edges[0][1])]} {self._said(extreme)}"

    @property
    def _asked(self) -> str:
        limits = zip(("at least", "at most"), self._edges, strict=True)
        said = (f"{word} {self._said(edge)}" for word, (_, edge) in limits if np.isfinite(edge))
        return " and ".join(said)

    @property
    def _edges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        return (-1.0, float(self.lower[0])), (1.0, float(self.upper[0]))

    def _said(self, amount: float) -> str:
        return f"{amount:.4g} {self.unit}".rstrip()


class MassLimit(LimitedQuantity):
    """The mass in kg of all links and bodies, those that never move included."""

    unit = "kg"
    noun = "mass"
    extreme = ("the lightest design has", "the heaviest design has")

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield the limits of the mass, if there are any."""
        if (given := file.design.mass) is not None:
            yield cls.between(*_ends(given.min, given.max), model.total_mass, _MASS, _MASS)

    @property
    def is_affine(self) -> bool:
        """True where the mass is affine in the design."""
        mass = self.terms[0][0]
        return isinstance(mass, TotalMass) and mass.is_affine

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits."""
        return "the limit of the mass"

    def relaxed(self, side: str, share: float) -> str:
        """The words for a limit that is relaxed by a share of it."""
        edge, more = (self.upper, "more") if side == "upper" else (self.lower, "less")
        return f"{handy(share * float(edge[0]), 'kg')} {more} mass"


class LinearLimit(LimitedQuantity):
    """low ≤ Σ c_j y_j ≤ high: linear in the design, so that each step can keep it exactly."""

    in_one_shot = True

    @classmethod
    def of_case(cls, file: CaseFile, model: Model) -> Iterator[Self]:
        """Yield the linear limits between design parameters."""
        for name, given in file.design.constraints.items():
            factors = np.array([given.terms.get(column, 0.0) for column in model.y_names])
            low, high = _ends(given.min, given.max)
            row = LinearConstraint(name, factors, low, high)
            yield cls.between(low, high, row, name, f"design.constraints.{name}")

    @property
    def constraint(self) -> LinearConstraint | None:
        """The same as a row of the program."""
        row = self.terms[0][0]
        return row if isinstance(row, LinearConstraint) else None


def _ends(low: float | None, high: float | None) -> tuple[float, float]:
    return -np.inf if low is None else low, np.inf if high is None else high
