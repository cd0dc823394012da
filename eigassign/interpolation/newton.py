"""Newton's interpolation on lower sets of multi-indices, at Leja points: every value is a check.

On each axis the nodes v_0, v_1, … are Leja points: each maximises Π_i |v − v_i| over the
candidates, so that the basis functions

    h_k(v) = Π_{i<k} (v − v_i) / (v_k − v_i)

are at most 1 there, and so are their products h_γ(v) = Π_j h_{γ_j}(v_j). The interpolant on a lower
set is Σ_γ c_γ h_γ, and c_γ is the error of the interpolant on the members below γ at the node of γ,
a point not used before. Adding members changes no coefficient.

A positive function f is interpolated as f, f² or f⁻², whichever has the smallest estimated error.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtri

from eigassign.errors import AccuracyError
from eigassign.series.multi_index import LowerSet, lower_set
from eigassign.series.power_series import Monomials, Polynomials

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

# --- Nodes and basis

CANDIDATES = 129  # of an interval, as dense at its ends as Chebyshev points


@lru_cache(maxsize=4)
def interval(count: int = CANDIDATES) -> Floats:
    """So many places on [−1, 1], an odd number, as dense at the ends as Chebyshev points."""
    nodes = -np.cos(np.pi * np.arange(count) / (count - 1))
    nodes[count // 2] = 0.0
    nodes.setflags(write=False)
    return nodes


def roots(count: int) -> Floats:
    """The zeros of T_count on [−1, 1], ascending: Π |v − v_i| is least for them."""
    return np.asarray(-np.cos(np.pi * (np.arange(count) + 0.5) / count))


def generic(count: int) -> Floats:
    """Places all over [−1, 1], without symmetry or period: multiples of the golden ratio mod 1."""
    return np.asarray(2.0 * (np.arange(1, count + 1) * 0.5 * (np.sqrt(5.0) - 1.0) % 1.0) - 1.0)


def leja(candidates: Floats, count: int) -> Ints:
    """Places of ``count`` Leja points among distinct candidates; the most central is the first."""
    middle = 0.5 * (candidates.min() + candidates.max())
    chosen = [int(np.abs(candidates - middle).argmin())]
    product = np.ones(len(candidates))
    while len(chosen) < min(count, len(candidates)):
        product *= np.abs(candidates - candidates[chosen[-1]])
        chosen.append(int(product.argmax()))
    return np.array(chosen, dtype=np.intp)


def basis(nodes: Floats, v: Floats) -> Floats:
    """h_k(v_i) (n, K) for the nodes (K,) in their order."""
    table = np.ones((len(v), len(nodes)))
    for k in range(1, len(nodes)):
        scale = nodes[k] - nodes[:k]
        table[:, k] = np.prod((v[:, None] - nodes[:k]) / scale, axis=1)
    return table


@dataclass(frozen=True, eq=False)
class Nodes:
    """At most ``most`` Leja points among candidates v (K,), with Newton's basis.

    They are ``whole`` if they are all that will be asked for. ``checks`` are further points, which
    are never nodes and come after them where points are counted. ``domain`` is where the
    interpolant will be used, all candidates unless given.
    """

    places: Floats
    most: int
    whole: bool = False
    checks: tuple[float, ...] = ()
    domain: Floats | None = None

    @cached_property
    def chosen(self) -> Ints:
        """Which candidates, in the order of the points."""
        return leja(self.places, self.most)

    @cached_property
    def v(self) -> Floats:
        """The points."""
        return np.asarray(self.places[self.chosen])

    @cached_property
    def points(self) -> Floats:
        """All that can be asked for: the nodes, then the checks."""
        return np.concatenate([self.v, np.array(self.checks)])

    @cached_property
    def table(self) -> Floats:
        """Newton's basis at all ``points``, (n_points, n_nodes)."""
        return basis(self.v, self.points)

    @cached_property
    def all_over(self) -> Floats:
        """Newton's basis all over the ``domain``, (n_domain, n_nodes)."""
        return basis(self.v, self.places if self.domain is None else self.domain)

    @cached_property
    def inverse(self) -> Floats:
        """From values at the points to coefficients; leading blocks are those of fewer points."""
        return np.asarray(dtrtri(self.table[: len(self.v)], lower=1, unitdiag=1)[0])


def products(tables: Sequence[Floats], rows: Ints, columns: Ints) -> Floats:
    """Π_j tables[j][rows[a, j], columns[b, j]] as (n_rows, n_columns)."""
    out = np.ones((len(rows), len(columns)))
    for j, table in enumerate(tables):
        out *= table[rows[:, j, None], columns[:, j]]
    return out


@dataclass(frozen=True, eq=False)
class NewtonRows(Monomials):
    """All Π_j Π_{i<γ_j} (v_j − v_ji) of one lower set, as rows: axis by axis, then their products.

    ``nodes`` (k_j, 1) of each axis are those that its highest degree needs; ``degrees`` (n, N).
    """

    nodes: tuple[Floats, ...] = ()
    degrees: tuple[Ints, ...] = ()

    def __call__(self, x: Floats) -> Floats:
        """(N, n_points) at points x (n, n_points), one row a variable."""
        rows: Floats | None = None
        for v, nodes, degrees in zip(x, self.nodes, self.degrees, strict=True):
            table = np.empty((len(nodes) + 1, len(v)))
            table[0] = 1.0
            np.subtract(v, nodes, out=table[1:])
            np.multiply.accumulate(table, axis=0, out=table)
            chosen = table.take(degrees, axis=0)
            rows = chosen if rows is None else np.multiply(rows, chosen, out=rows)
        return np.ones((self.size, x.shape[1])) if rows is None else rows


def newton_rows(space: LowerSet, nodes: Sequence[Floats]) -> NewtonRows:
    """The basis functions of a set, up to their scale."""
    degrees = tuple(np.ascontiguousarray(column) for column in space.indices.T)
    used = zip(nodes, degrees, strict=True)
    needed = tuple(v[: int(column.max()), None] for v, column in used)
    return NewtonRows(len(space), space.n_variables, (), needed, degrees)


def newton_polynomials(members: Ints, nodes: Sequence[Floats], c: Floats) -> Polynomials:
    """Σ_γ c_γ h_γ ready for many points: c (n_polynomials, N) over members (N, d); d ≥ 1."""
    heads, row = _part(members[:, :1])
    tails, column = _part(members[:, 1:])
    first, second = newton_rows(heads, nodes[:1]), newton_rows(tails, nodes[1:])
    table = np.zeros((len(c), second.size, first.size))
    table[:, column, row] = c / _scales(members, nodes)
    return Polynomials(first, second, table)


def _part(members: Ints) -> tuple[LowerSet, Ints]:
    space = lower_set(members)
    return space, space.find(members)


def _scales(members: Ints, nodes: Sequence[Floats]) -> Floats:
    """Π_j Π_{i<γ_j} (v_{jγ_j} − v_ji), (N,)."""
    out = np.ones(len(members))
    for j, v in enumerate(nodes):
        each = np.array([np.prod(v[k] - v[:k]) for k in range(int(members[:, j].max()) + 1)])
        out *= each[members[:, j]]
    return out


@lru_cache(maxsize=16)
def spread_steps(d: int) -> Floats:
    """α_i = g^-i, g the root of g^(d+1) = g + 1: (k α) mod 1 fills the unit box (Roberts 2018)."""
    g = 2.0
    for _ in range(60):
        g = (1.0 + g) ** (1.0 / (d + 1.0))
    return np.asarray(g ** -np.arange(1.0, d + 1.0))


def frozen(members: Ints) -> Ints:
    """Members read-only, as caches return them."""
    members.setflags(write=False)
    return members


def ordered(members: Ints) -> Ints:
    """Distinct rows, predecessors first."""
    rows = np.unique(members, axis=0)
    return np.asarray(rows[np.argsort(rows.sum(axis=1), kind="stable")])


def cross(d: int, degree: int) -> Ints:
    """{k e_j : k ≤ degree}: the axes alone."""
    lines = np.arange(degree + 1)[:, None, None] * np.eye(d, dtype=np.intp)
    return ordered(lines.reshape(-1, d))


# --- Interpolants of f, f² or f⁻² with their error

POWERS = (1.0, 2.0, -2.0)  # of f that are tried, the quickest to evaluate first
SAFETY = 4.0  # times the predicted sum of missing coefficients
NEAR = 2.0  # factor by which another power must be better than one that is quicker to evaluate
ROUNDS = 12  # of values, at most, to an accuracy


class Interpolant(NamedTuple):
    """f^power ≈ Σ_γ c_γ h_γ; ``error`` estimates |δf/f| over the whole box."""

    power: float
    members: Ints  # (N, d)
    coefficients: Floats  # (n_outputs, N)
    sizes: Floats  # (N,): |δf/f| that each member stands for
    rates: Floats  # (d,); 0 on an axis that nothing depends on
    error: float
    rounds: tuple[tuple[int, float], ...] = ()  # members and error after each
    asked: int = 0  # values, checks included


Asking = Generator[Ints, Floats, Interpolant]  # members wanted → values (n, n_outputs) sent


def powers_of(values: Floats) -> Floats:
    """All `POWERS` of values (n, n_outputs), (n, n_powers · n_outputs)."""
    squares = values * values
    return np.concatenate((values, squares, 1.0 / squares), axis=1)


def sizes_of(c: Floats, smallest: Floats) -> Floats:
    """|δf/f| (n_powers, N) that coefficients (N, n_powers · n_outputs) of f^p stand for.

    δ(f^p) = p f^p δf/f, where f^p is ``smallest`` (n_powers · n_outputs,).
    """
    each = len(smallest) // len(POWERS)
    sizes = np.abs(c.T)
    sizes /= (smallest * _orders(each))[:, None]
    return sizes if each == 1 else np.asarray(sizes.reshape(len(POWERS), each, -1).max(axis=1))


@lru_cache(maxsize=64)
def _orders(each: int) -> Floats:
    """|p|, each so many times."""
    return np.repeat(np.abs(POWERS), each)


def nearly_best(errors: Sequence[float]) -> int:
    """Of the powers the one with the least error; a quicker one if it is nearly as good."""
    bound = NEAR * min(errors)
    return next(k for k, error in enumerate(errors) if error <= bound)


def tail(rate: float) -> float:
    """From the first missing coefficients to the sum over all, with the safety."""
    return SAFETY / (1.0 - rate)


def refuse(reached: tuple[int, float], accuracy: float, count: int, most: int) -> NoReturn:
    """Raise AccuracyError: ``reached`` is a number of values and the error that they leave."""
    done = f"{reached[0]} values leave an estimated error of {reached[1]:.1e}, not {accuracy:.1e}"
    why = f"over {most} are not allowed" if count > most else "more do not help"
    raise AccuracyError(f"{done}, and {why}")
