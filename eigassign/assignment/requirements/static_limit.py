"""A node gives way by no more than so much: under a force along a direction, or under the weight.

The rows are those of the way w ≤ limit at every sample, and of a stiffness 1/w ≥ k those of
w ≤ 1/k. With a force that no parameter changes w = bᵀK⁻¹b is convex in K.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from eigassign.assignment.program import Floats
from eigassign.assignment.requirements.quantity import LimitedQuantity, said
from eigassign.assignment.requirements.requirement import EdgeRows
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import PushedNode, StaticTarget
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.modal.statics import Flexibility, compliances, sags

# Number and target, its rows, those of them along each trajectory, and the words for these
Placed = tuple[int, StaticTarget, slice, tuple[tuple[str, slice], ...], str]
UNITS = {"stiffness": "N/m", "compliance": "m/N", "sag": "m"}
RIGID = 1e-24  # m/N or m: what no case can ask for, and round-off of a node that cannot move


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
    by: Callable[[bool], Flexibility]
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


class StaticLimit(LimitedQuantity):
    """The limit of what a static target asks of a node; its amount is the worst of all samples."""

    extreme = ("the least found is", "the most found is")
    is_affine = False  # the inverse of K is not

    @property
    def way(self) -> Way:
        """What it limits."""
        way = self.terms[0][0]
        assert isinstance(way, Way)
        return way

    @property
    def is_decided(self) -> bool:
        """True where K is affine and the force fixed, and so the designs are a convex set."""
        way, n = self.way, self.way.path.q.shape[1]
        design = np.arange(n + len(way.model.y_names)) >= n
        fixed = way.by(False).forces.is_fixed(design) and not way.path.follows_design
        return fixed and isinstance(way.target.place, PushedNode) and way.model.pencil.is_affine

    @property
    def unit(self) -> str:
        """N/m, m/N or m."""
        return UNITS[self.way.target.kind]

    @property
    def noun(self) -> str:
        """``stiffness of arm.end along [0, 0, 1]``."""
        return _noun(self.way.target)

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits."""
        return self.label

    @property
    def allowed(self) -> tuple[float, float]:
        """The limit of the amount."""
        edge = self.way.target.edge
        return (edge, np.inf) if self.way.target.limit == "at_least" else (-np.inf, edge)

    def edge_rows(self, factor: Floats | float = 1.0) -> Iterator[EdgeRows]:
        """Yield the rows of the way; the upper edge of that is the lower one of a stiffness."""
        side = "lower" if self.way.target.limit == "at_least" else "upper"
        yield from (replace(rows, side=side) for rows in super().edge_rows(factor))

    def curve_of(self, y: Floats) -> Floats:
        """The stiffness, compliance or sag (n,) at its samples; NaN where nothing gives way."""
        return self._in_its_unit(self.way(y)[0])

    def amount_of(self, value: float) -> float:
        """The stiffness, compliance or sag of a way."""
        return float(self._in_its_unit(np.array(value)))

    def slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of the worst."""
        _, w, slopes = self.worst(y)
        return -slopes / w**2 if self.way.target.limit == "at_least" else slopes

    def where(self, y: Floats) -> str:
        """`` at sample 12 (t = 0.3 s)``."""
        return f" at {self.way.path.where(self.rows.start + self.worst(y)[0])}"

    def _in_its_unit(self, w: Floats) -> Floats:
        if self.way.target.limit == "at_most":
            return w
        return np.where(w > RIGID, 1.0 / np.where(w > RIGID, w, 1.0), np.nan)


def _noun(target: StaticTarget) -> str:
    place = target.place
    towards = [f"{v:g}" for v in place.direction] if isinstance(place, PushedNode) else []
    return f"{target.kind} of {place.at}" + (f" along [{', '.join(towards)}]" if towards else "")


def static_limits(
    file: CaseFile, model: Model, path: Trajectories, asked: Sequence[Placed]
) -> Iterator[StaticLimit]:
    """The limits of static targets, of all that are pushed from one factorisation of K a sample.

    Raises MechanismError at a target where nothing gives way, or a free joint does.
    """
    pushed = [each[1].place for each in asked if isinstance(each[1].place, PushedNode)]
    nodes = {place.at: [p.direction for p in pushed if p.at == place.at] for place in pushed}
    columns = [(node, direction) for node, own in nodes.items() for direction in own]
    together = _found(model, path, partial(compliances, model, nodes))
    for k, target, rows, along, where in asked:
        place, some, (by, found) = target.place, slice(None), together
        if isinstance(place, PushedNode):
            first = columns.index((place.at, place.direction))
            some = slice(first, first + 1)
        else:
            by, found = _found(model, path, partial(sags, model, place.at))
        way = Way(target, f"targets[{k}].{target.kind}", model, path, rows, some, by, found)
        if way(initial_design(file))[0].max() <= RIGID:
            message = f"nothing gives way at {place.at} in any pose: all is rigid and locked"
            raise MechanismError(way.place, message)
        words = f"{target.limit.replace('_', ' ')} {said(target.edge, UNITS[target.kind])}"
        most = 1.0 / target.edge if target.limit == "at_least" else target.edge
        upper = np.full(rows.stop - rows.start, most)
        yield StaticLimit(
            label=f"{_noun(target)} {words}{where}",
            place=f"targets[{k}]",
            terms=((way, 1.0),),
            rows=rows,
            lower=np.full_like(upper, -np.inf),
            upper=upper,
            along=along,
            trajectory=target.trajectory,
        )


def _found(
    model: Model, path: Trajectories, made: Callable[[bool], Flexibility]
) -> tuple[Callable[[bool], Flexibility], Callable[[bytes], tuple[Floats, Floats]]]:
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
