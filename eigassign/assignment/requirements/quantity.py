"""A quantity of the design keeps within its limits: mass, loads of drives, sums of parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np

from eigassign.assignment.program import Floats, LinearConstraint
from eigassign.assignment.requirements.requirement import (
    Edges,
    Frequencies,
    Ints,
    Quantity,
    Requirement,
    Solved,
)
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy, limit_unit
from eigassign.mechanism.assembly.mode_shapes import TotalMass
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model

Path = Trajectories | None
_MASS = "design.mass"
_NO_MODES = Frequencies(np.zeros((1, 0)), np.zeros((1, 0, 0)))


class LimitedQuantity(Requirement):
    """low ≤ quantity(y) ≤ high, in SI units; no kind of target, for it belongs to no mode."""

    is_goal = False
    extreme: ClassVar[tuple[str, str]] = ("the least is", "the most is")

    @classmethod
    def of_case(cls, file: CaseFile, model: Model, path: Path) -> Iterator[LimitedQuantity]:
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
    def is_decided(self) -> bool:
        """True where no design keeps it if a search from a few starts finds none."""
        return True

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
    def unit(self) -> str:
        """The SI unit that its amounts are said in."""
        return ""

    @property
    def allowed(self) -> tuple[float, float]:
        """The limits of the amount, infinite without one."""
        return float(self.lower[0]), float(self.upper[0])

    def where(self, y: Floats) -> str:
        """The place where a design (n_y,) has its amount, in words behind it; nothing of most."""
        return ""

    @property
    def noun(self) -> str:
        """The quantity, before an amount of it."""
        return self.label

    def worst(self, y: Floats) -> tuple[int, float, Floats]:
        """The row where the quantity of a design (n_y,) is largest, its value and slopes there."""
        value, slopes = self.value(y, _NO_MODES)
        k = int(np.abs(value).argmax())
        return k, float(value[k]), slopes[k]

    def amount(self, y: Floats) -> float:
        """The quantity of a design (n_y,), SI, where it is worst."""
        return self.amount_of(self.worst(y)[1])

    def amount_of(self, value: float) -> float:
        """The amount that a value of its rows stands for."""
        return value

    def slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of the amount at a design (n_y,)."""
        return self.worst(y)[2]

    def violation(self, amount: float, reach: float, near: float = 0.0) -> float:
        """The way of an amount beyond a limit, relative to that; 0 within both.

        Of a limit of 0 relative to ``reach``, what the quantity changes over the bounds; a share
        ``near`` of the larger of both is nothing.
        """
        ways = [(s * (amount - edge), abs(edge)) for s, edge in self._edges if np.isfinite(edge)]
        far = (way / (edge or reach or 1.0) for way, edge in ways if way > near * max(edge, reach))
        return max(far, default=0.0)

    @property
    def asked_words(self) -> str:
        """``mass at most 3 kg``."""
        return f"{self.noun} {self._asked}"

    def stated(self, y: Floats, extreme: float | None) -> str:
        """``mass 5.47 kg, at most 3 kg``, and where given what the most extreme design has."""
        words = f"{self.noun} {self._said(self.amount(y))}{self.where(y)}, {self._asked}"
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
        low, high = self.allowed
        return (-1.0, low), (1.0, high)

    def _said(self, amount: float) -> str:
        return said(amount, self.unit)


def said(amount: float, unit: str) -> str:
    """An amount in SI ``unit`` to four digits."""
    name, size = limit_unit(unit, amount)
    return f"{amount / size:.4g} {name}".rstrip()


class MassLimit(LimitedQuantity):
    """The mass in kg of all links and bodies, those that never move included."""

    unit = "kg"
    noun = "mass"
    extreme = ("the lightest design has", "the heaviest design has")

    @classmethod
    def of_case(cls, file: CaseFile, model: Model, path: Path) -> Iterator[LimitedQuantity]:
        """Yield the limits of the mass, if there are any."""
        given = file.design.mass
        if given is not None and (given.min, given.max) != (None, None):
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


@dataclass(frozen=True, eq=False)
class CarriedLoad:
    """The load of one drive, in N m or N: (m,) at all instants, with slopes (m, n_y).

    ``loads`` are those of all drives at a design, as its bytes: see `DriveForces.along`.
    """

    loads: Callable[[bytes], tuple[Ints, Floats, Floats]]
    path: Trajectories
    name: str
    column: int
    unit: str
    is_affine: bool

    def samples(self, y: Floats) -> tuple[Ints, Floats, Floats]:
        """The samples (m,), and its values and slopes there, at a design y (n_y,)."""
        samples, tau, slopes = self.loads(np.asarray(y, dtype=np.float64).tobytes())
        return samples, tau[:, self.column], slopes[:, self.column]

    def __call__(self, y: Floats) -> tuple[Floats, Floats]:
        """Values and slopes alone."""
        return self.samples(y)[1:]


class DriveLimit(LimitedQuantity):
    """|τ| ≤ max of the drive of a coordinate along `path.whole.finely`; its amount: the peak."""

    extreme = ("the least found is", "the least found is")

    @classmethod
    def of_case(cls, file: CaseFile, model: Model, path: Path) -> Iterator[LimitedQuantity]:
        """Yield the limits of all drives, along all trajectories whole."""
        if path is None or not file.design.torque:
            return

        fine = path.whole.finely

        @lru_cache(maxsize=1)  # all drives ask for the same design
        def loads(y: bytes) -> tuple[Ints, Floats, Floats]:
            return model.drives.along(fine, np.frombuffer(y), slopes=True)

        affine = model.drives.is_affine and not path.follows_design
        for column, (name, unit) in enumerate(zip(file.coordinates, file.drive_units, strict=True)):
            if name in file.design.torque:
                load = CarriedLoad(loads, fine, name, column, unit, affine)
                edge = np.full(len(load(initial_design(file))[0]), file.design.torque[name].max)
                place = f"design.torque.{name}"
                yield cls(place, place, ((load, 1.0),), slice(0, len(edge)), -edge, edge)

    @property
    def load(self) -> CarriedLoad:
        """What it limits."""
        load = self.terms[0][0]
        assert isinstance(load, CarriedLoad)
        return load

    @property
    def is_affine(self) -> bool:
        """True where the load is affine in the design, at every sample."""
        return self.load.is_affine

    @property
    def is_decided(self) -> bool:
        """True where the designs that keep it are a convex set: else a search may miss some."""
        return self.is_affine

    @property
    def unit(self) -> str:
        """N m, or N."""
        return self.load.unit

    @property
    def noun(self) -> str:
        """``torque of q1``."""
        return f"{'force' if self.unit == 'N' else 'torque'} of {self.load.name}"

    @property
    def allowed(self) -> tuple[float, float]:
        """The limit of the peak."""
        return -np.inf, float(self.upper[0])

    def amount_of(self, value: float) -> float:
        """The magnitude of a load."""
        return abs(value)

    def slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of the peak."""
        _, tau, slopes = self.worst(y)
        return np.asarray(np.sign(tau) * slopes)

    def where(self, y: Floats) -> str:
        """`` at sample 12 (t = 0.3 s)``."""
        return f" at {self.load.path.where(int(self.load.samples(y)[0][self.worst(y)[0]]))}"

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits."""
        return f"the limit of the {self.noun}"

    def relaxed(self, side: str, share: float) -> str:
        """The words for a limit that is relaxed by a share of it."""
        return f"{handy(share * self.allowed[1], self.unit)} more {self.noun}"


@dataclass(frozen=True, eq=False)
class LinearLimit(LimitedQuantity):
    """low ≤ Σ c_j y_j ≤ high: linear in the design, so that each step can keep it exactly.

    Its ``unit`` is that of all its parameters, if they have one.
    """

    in_one_shot = True
    unit: str = ""

    @classmethod
    def of_case(cls, file: CaseFile, model: Model, path: Path) -> Iterator[LimitedQuantity]:
        """Yield the linear limits between design parameters."""
        for name, given in file.design.constraints.items():
            factors = np.array([given.terms.get(column, 0.0) for column in model.y_names])
            low, high = _ends(given.min, given.max)
            row = LinearConstraint(name, factors, low, high)
            units = {unit for c, unit in zip(factors, file.design_units, strict=True) if c}
            limit = cls.between(low, high, row, name, f"design.constraints.{name}")
            yield replace(limit, unit=units.pop() if len(units) == 1 else "")

    @property
    def constraint(self) -> LinearConstraint | None:
        """The same as a row of the program."""
        row = self.terms[0][0]
        return row if isinstance(row, LinearConstraint) else None


def _ends(low: float | None, high: float | None) -> tuple[float, float]:
    return -np.inf if low is None else low, np.inf if high is None else high
