"""A quantity of the design is within limits: mass, loads of drives, sums of parameters, ways.

The way that a node gives under a force along a direction, or under the weight, has a row w ≤ limit
at every sample, and of a stiffness 1/w ≥ k those of w ≤ 1/k. With a force that no parameter changes
w = bᵀK⁻¹b is convex in K. A dynamic stiffness is limited likewise, by |H| ≤ 1/k in each of `PARTS`
parts of the frequencies, so that two peaks in balance are two rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.assignment.program import LinearConstraint
from eigassign.assignment.requirements.requirement import (
    EdgeRows,
    Edges,
    Frequencies,
    Quantity,
    Requirement,
    Solved,
)
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import PushedNode, ShakenNode, StaticTarget
from eigassign.case.units import SI, handy
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.modal.response import Shaken
from eigassign.modal.under_load import Flexibility, compliances, sags

# Number and target, its rows, those of them along each trajectory, and the words for these
Placed = tuple[int, StaticTarget, slice, tuple[tuple[str, slice], ...], str]
UNITS = {"stiffness": "N/m", "response": "N/m", "compliance": "m/N", "sag": "m"}
PARTS = 6  # of the frequencies of a response
RIGID = 1e-24  # m/N or m: what no case can ask for, and round-off of a node that cannot move
_NO_MODES = Frequencies(np.zeros((1, 0)), np.zeros((1, 0, 0)))


@dataclass(frozen=True, repr=False, eq=False)
class LimitedQuantity(Requirement):
    """low ≤ amount(y) ≤ high, in SI units; no kind of target, for it belongs to no mode.

    Its only term is the quantity. ``noun`` stands before an amount, ``allowed`` are its limits,
    infinite without one, and ``extreme`` the words for the least and the most that there is. It
    ``is_decided`` where no design keeps it if a search from a few starts finds none: the designs
    that keep it are a convex set.
    """

    is_goal = False

    noun: str = ""
    unit: str = ""
    allowed: tuple[float, float] = (-np.inf, np.inf)
    extreme: tuple[str, str] = ("the least found is", "the most found is")
    is_affine: bool = True
    is_decided: bool = True
    is_residual: bool = False  # of vibration after a move
    row_place: Callable[[Floats, int], str] | None = None  # of a design's row, in words

    @property
    def quantity(self) -> Any:
        """What it limits."""
        return self.terms[0][0]

    @property
    def constraint(self) -> LinearConstraint | None:
        """Its row of the program, kept exactly by each step; None of most."""
        row, (low, high) = self.quantity, self.allowed
        return replace(row, lower=low, upper=high) if isinstance(row, LinearConstraint) else None

    @property
    def in_one_shot(self) -> bool:
        """True of linear limits."""
        return self.constraint is not None

    def range_over(self, lower: Floats, upper: Floats, lowest: Solved, highest: Solved) -> Edges:
        """Its range over designs between two (n_y,); endless where it is not affine."""
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        if half.any() and not self.is_affine:
            return np.array([-np.inf]), np.array([np.inf])
        amount, slopes = self.value(middle, _NO_MODES)
        reach = np.abs(slopes) @ half
        return amount - reach, amount + reach

    # --- Amounts in words

    def worst(self, y: Floats) -> tuple[int, float, Floats]:
        """The row where the quantity of a design (n_y,) is largest, its value and slopes there."""
        value, slopes = self.value(y, _NO_MODES)
        k = int(np.abs(value).argmax())
        return k, float(value[k]), slopes[k]

    def amount_of(self, value: float) -> tuple[float, float]:
        """The amount that a value of its rows stands for, and its slope in that."""
        return value, 1.0

    def amount(self, y: Floats) -> float:
        """The quantity of a design (n_y,), SI, where it is worst."""
        return self.amount_of(self.worst(y)[1])[0]

    def slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of the amount at a design (n_y,)."""
        _, value, slopes = self.worst(y)
        return np.asarray(self.amount_of(value)[1] * slopes)

    def violation(self, amount: float, reach: float, near: float = 0.0) -> float:
        """The way of an amount beyond a limit, relative to that; 0 within both.

        Of a limit of 0 relative to ``reach``, what the quantity changes over the bounds; a share
        ``near`` of the larger of both is nothing.
        """
        ways = [
            (sign * (amount - edge), abs(edge))
            for sign, edge in zip((-1.0, 1.0), self.allowed, strict=True)
            if np.isfinite(edge)
        ]
        far = (way / (edge or reach or 1.0) for way, edge in ways if way > near * max(edge, reach))
        return max(far, default=0.0)

    @property
    def asked_words(self) -> str:
        """``mass at most 3 kg``."""
        return f"{self.noun} {self._asked}"

    def stated(self, y: Floats, extreme: float | None) -> str:
        """``mass 5.47 kg, at most 3 kg``, and where given what the most extreme design has."""
        where = "" if self.row_place is None else f" at {self.row_place(y, self.worst(y)[0])}"
        words = f"{self.noun} {handy(self.amount(y), self.unit, 4)}{where}, {self._asked}"
        if extreme is None:
            return words
        most = self.extreme[int(extreme < self.allowed[0])]
        return f"{words}; {most} {handy(extreme, self.unit, 4)}"

    @property
    def _asked(self) -> str:
        limits = zip(("at least", "at most"), self.allowed, strict=True)
        words = (
            f"{word} {handy(edge, self.unit, 4)}" for word, edge in limits if np.isfinite(edge)
        )
        return " and ".join(words)

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits; of one that is named by its key, in words."""
        return f"the limit of the {self.noun}" if self.label == self.place else self.name

    def relaxed(self, side: str, share: float) -> str:
        """The words for a limit that is relaxed by a share of it."""
        if self.label != self.place:
            return super().relaxed(side, share)
        (low, high), is_less = self.allowed, side == "lower" and np.isfinite(self.allowed[0])
        edge, more = (low, "less") if is_less else (high, "more")
        return f"{handy(share * edge, self.unit)} {more} {self.noun}"


def limit_between(
    low: float | None, high: float | None, quantity: Quantity, label: str, place: str, **more: Any
) -> LimitedQuantity:
    """The limits, if any, of a quantity that has one value for all samples."""
    allowed = -np.inf if low is None else low, np.inf if high is None else high
    rows = slice(0, 1), np.array(allowed[:1]), np.array(allowed[1:])
    more = {"noun": label, "extreme": ("the least is", "the most is")} | more
    return LimitedQuantity(label, place, ((quantity, 1.0),), *rows, allowed=allowed, **more)


def quantity_limits(
    file: CaseFile, model: Model, path: Trajectories | None
) -> Iterator[LimitedQuantity]:
    """The limits of the mass of all links and bodies, of drives, and linear ones of parameters."""
    mass, key = file.design.mass, "design.mass"
    if mass is not None and (mass.min, mass.max) != (None, None):
        yield limit_between(
            *(mass.min, mass.max, model.total_mass, key, key),
            noun="mass",
            unit=file.mass_unit,
            extreme=("the lightest design has", "the heaviest design has"),
            is_affine=model.total_mass.is_affine,
        )
    if path is not None and file.design.torque:
        yield from _drive_limits(file, model, path)
    for name, given in file.design.constraints.items():
        factors = np.array([given.terms.get(column, 0.0) for column in model.y_names])
        yield limit_between(
            *(given.min, given.max, LinearConstraint(name, factors), name),
            f"design.constraints.{name}",
            unit=file.constraint_unit(name),
        )


@dataclass(frozen=True, repr=False, eq=False)
class DriveLimit(LimitedQuantity):
    """|τ| ≤ max of the drive of a coordinate along `path.whole.finely`; its amount: the peak."""

    column: int = 0  # of all drives

    def amount_of(self, value: float) -> tuple[float, float]:
        """The magnitude of a load."""
        return abs(value), float(np.sign(value))


def _drive_limits(file: CaseFile, model: Model, path: Trajectories) -> Iterator[LimitedQuantity]:
    """The limits of all drives, along all trajectories whole: loads of one evaluation a design."""
    fine = path.whole.finely

    @lru_cache(maxsize=1)
    def loads(y: bytes) -> tuple[Ints, Floats, Floats]:
        return model.drives.along(fine, np.frombuffer(y), slopes=True)

    def load(column: int, y: Floats) -> tuple[Floats, Floats]:
        _, tau, slopes = loads(np.asarray(y, dtype=np.float64).tobytes())
        return tau[:, column], slopes[:, column]

    def place(y: Floats, row: int) -> str:
        return fine.where(int(loads(np.asarray(y, dtype=np.float64).tobytes())[0][row]))

    affine = model.drives.is_affine and not path.follows_design
    for column, (name, unit) in enumerate(zip(file.coordinates, file.drive_units, strict=True)):
        if name in file.design.torque:
            most, own = file.design.torque[name].max, partial(load, column)
            edge = np.full(len(own(initial_design(file))[0]), most)
            key = f"design.torque.{name}"
            yield DriveLimit(
                *(key, key, ((own, 1.0),), slice(0, len(edge)), -edge, edge),
                noun=f"{'force' if unit == 'N' else 'torque'} of {name}",
                unit=unit,
                allowed=(-np.inf, most),
                is_affine=affine,
                is_decided=affine,
                row_place=place,
                column=column,
            )


# --- Ways that nodes give


@dataclass(frozen=True, eq=False)
class Way:
    """The way that a target's node gives at ``rows`` of a path, m/N or m: (n,), slopes (n, n_y).

    Its components are ``columns`` of what is ``found`` at a design, as its bytes; ``by`` is what
    that is evaluated by, of True by a finer mesh.
    """

    target: StaticTarget
    place: str  # its key path
    model: Model
    path: Trajectories
    rows: slice
    columns: slice
    by: Callable[[bool], Any]
    found: Callable[[bytes], tuple[Floats, Floats]]

    def __call__(self, y: Floats) -> tuple[Floats, Floats]:
        """Values and slopes at a design y (n_y,); raises MechanismError where a joint is free."""
        w, slopes = self.found(np.asarray(y, dtype=np.float64).tobytes())
        return self._length(w[self.rows, self.columns], slopes[self.rows, self.columns])

    def at(self, q: Floats, y: Floats, finer: bool = False) -> Floats:
        """The values (n,) at any poses q (n, n_q), or by a ``finer`` mesh."""
        x = self.model.x(q, y)
        w, slopes = self.by(finer).at(x, np.zeros(x.shape[1], dtype=bool))
        return self._length(w[:, self.columns], slopes[:, self.columns])[0]

    def _length(self, w: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        if not np.isfinite(w).all():
            coordinates = self.model.poses.case.coordinates.items()
            free = " and ".join(name for name, c in coordinates if c.moves == "free")
            message = f"moves freely in this direction, because nothing holds {free}: give it a"
            message = f"{self.target.place.at} {message} drive stiffness, or lock it"
            raise MechanismError(self.place, message)
        size = np.linalg.norm(w, axis=1)
        along = w / np.where(size > 0.0, size, 1.0)[:, None]
        return size, np.einsum("nm,nmy->ny", along, slopes)

    @property
    def is_convex(self) -> bool:
        """True where K is affine and the force fixed: designs that give way so far are convex."""
        n = self.path.q.shape[1]
        design = np.arange(n + len(self.model.y_names)) >= n
        fixed = self.by(False).forces.is_fixed(design) and not self.path.follows_design
        return fixed and isinstance(self.target.place, PushedNode) and self.model.pencil.is_affine


class Peaks(Way):
    """The largest |H| of a shaken node in m parts of its frequencies, (n · m,) in m/N, sample by
    sample; ``by`` are `modal.response.Shaken`.
    """

    def at(self, q: Floats, y: Floats, finer: bool = False) -> Floats:
        """The largest of all frequencies (n,) at any poses q (n, n_q), or by a ``finer`` mesh."""
        return np.asarray(super().at(q, y, finer).reshape(len(q), -1).max(axis=1))

    def _length(self, w: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        return w.ravel(), slopes.reshape(w.size, -1)

    @property
    def is_convex(self) -> bool:
        """False: of |H| nothing is known."""
        return False


@dataclass(frozen=True, repr=False, eq=False)
class StaticLimit(LimitedQuantity):
    """The limit of what a static target asks of a node; its amount is the worst of all samples."""

    each: int = 1  # rows at each sample

    @property
    def way(self) -> Way:
        """What it limits."""
        way: Way = self.quantity
        return way

    def edge_rows(self, factor: Floats | float = 1.0) -> Iterator[EdgeRows]:
        """Yield the rows of the way; the upper edge of that is the lower one of a stiffness."""
        side = "lower" if self.way.target.limit == "at_least" else "upper"
        for rows in super().edge_rows(factor):
            edge, scale = (np.repeat(each, self.each) for each in (rows.edge, rows.scale))
            yield replace(rows, side=side, edge=edge, scale=scale)

    def curve_of(self, y: Floats) -> Floats:
        """The stiffness, compliance or sag (n,) at its samples; NaN where nothing gives way."""
        worst = self.way(y)[0].reshape(-1, self.each).max(axis=1)
        return np.array([self.amount_of(float(w))[0] for w in worst])

    def amount_of(self, value: float) -> tuple[float, float]:
        """The stiffness, compliance or sag of a way, and its slope."""
        if self.way.target.limit == "at_most":
            return value, 1.0
        return (1.0 / value, -1.0 / value**2) if value > RIGID else (np.nan, np.nan)


def static_limits(
    file: CaseFile, model: Model, path: Trajectories, asked: Sequence[Placed]
) -> Iterator[StaticLimit]:
    """The limits of static targets, of all that are pushed from one factorisation of K a sample.

    Raises MechanismError at a target where nothing gives way, or a free joint does.
    """
    pushed = [place for each in asked if type(place := each[1].place) is PushedNode]
    nodes = {place.at: [p.direction for p in pushed if p.at == place.at] for place in pushed}
    columns = [(node, direction) for node, own in nodes.items() for direction in own]
    together = _found(model, path, partial(compliances, model, nodes))
    for k, target, rows, along, where in asked:
        place, some, (by, found) = target.place, slice(None), together
        if isinstance(place, ShakenNode):
            ends = 2.0 * np.pi * np.geomspace(place.lowest, place.highest, PARTS + 1)
            by, found = _found(
                model, path, partial(Shaken.of, model, place.at, place.direction, ends)
            )
        elif isinstance(place, PushedNode):
            first = columns.index((place.at, place.direction))
            some = slice(first, first + 1)
        else:
            by, found = _found(model, path, partial(sags, model, place.at))
        kind = Peaks if isinstance(place, ShakenNode) else Way
        way = kind(target, f"targets[{k}].{target.kind}", model, path, rows, some, by, found)
        first_way = way(initial_design(file))[0]
        if first_way.max() <= RIGID:
            message = f"nothing gives way at {place.at} in any pose: all is rigid and locked"
            raise MechanismError(way.place, message)
        each = len(first_way) // (rows.stop - rows.start)
        noun, edge = f"{target.noun or target.kind} of {place.name}", target.edge
        unit = SI(UNITS[target.kind], edge)
        is_least = target.limit == "at_least"
        upper = np.full(rows.stop - rows.start, 1.0 / edge if is_least else edge)
        yield StaticLimit(
            label=f"{noun} {target.limit.replace('_', ' ')} {handy(edge, unit, 4)}{where}",
            place=f"targets[{k}]",
            terms=((way, 1.0),),
            rows=rows,
            lower=np.full_like(upper, -np.inf),
            upper=upper,
            along=along,
            trajectory=target.trajectory,
            noun=noun,
            unit=unit,
            allowed=(edge, np.inf) if is_least else (-np.inf, edge),
            is_affine=False,  # the inverse of K is not
            is_decided=way.is_convex,
            row_place=partial(_sample_place, path, rows, each),
            each=each,
        )


def _sample_place(path: Trajectories, rows: slice, each: int, y: Floats, row: int) -> str:
    return path.where(rows.start + row // each)


def _found(
    model: Model, path: Trajectories, made: Callable[[bool], Flexibility | Shaken]
) -> tuple[Callable[[bool], Flexibility | Shaken], Callable[[bytes], tuple[Floats, Floats]]]:
    """What is made, once for each mesh, and with it the ways (n, m) and slopes of a design."""
    by = lru_cache(maxsize=2)(made)

    @lru_cache(maxsize=32)  # all targets ask for the same design, and searches come back to some
    def found(design: bytes) -> tuple[Floats, Floats]:
        y = np.frombuffer(design)
        q, of_design = path.at(y)
        x = model.x(q, y)
        wanted = np.arange(x.shape[1]) >= q.shape[1]
        wanted[: model.pencil.n_joints] = path.follows_design
        w, slopes = by(False).at(x, wanted)
        return w, path.in_design(slopes, of_design)

    return by, found
