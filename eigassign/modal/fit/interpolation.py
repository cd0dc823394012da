"""A polynomial through values at nested nodes, with an estimate of its error.

On each axis v ∈ [−1, 1] the nodes v_0, v_1, … are Leja points: each maximises Π_i |v − v_i| over
the candidates, so that the functions of Newton's basis

    h_k(v) = Π_{i<k} (v − v_i) / (v_k − v_i)

are at most 1 there, and further nodes change none of the first. On several axes the basis is
h_γ(v) = Π_j h_{γ_j}(v_j), γ in a lower set of multi-indices. In

    f(v)^p ≈ Σ_γ c_γ h_γ(v),   p ∈ {1, 2, −2},

c_γ is the error of the interpolant on the members below γ at the node of γ, a value it did not use.
Along axis j coefficients fall by a factor r_j a degree, so that next to the set

    |c_γ| ≈ max_k |c_{γ−k e_j}| r_j^k ,   k = 1 … 4,

for several in turn may be small by accident, and every other one by symmetry; on several axes it is
the geometric mean over all j with γ_j > 0. Batch by batch the
set grows by the members whose coefficients are predicted to be largest. The error is estimated from
those that are missing, and from values held out, which no coefficient uses.

Where two modes cross between the nodes, neither is smooth, however little of that the nodes show:
with all of them on one side of the crossing both interpolants are right there, and wrong beyond.
What stays smooth are the symmetric functions of both, their mean s and their squared distance d²:

    g_k , g_{k+1} = s ∓ ½ √(d²) ,   g = f^power .

Interpolants of d and of d² at the same nodes agree unless the modes meet; what they differ by is
what the interpolant of g_k misses, |√(d²) − d| / 2, the error of s being the same in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import islice, pairwise
from math import ceil, log10

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from eigassign.errors import AccuracyError, UsageError
from eigassign.mechanism.kinematics.loop_closure import kronecker, strides
from eigassign.series.multi_index import LowerSet, lower_set, total_degree

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
# --- Nodes and basis

# Multiples of the golden ratio mod 1, without symmetry or period: at symmetric places the values of
# an even function agree, though it is no constant. With d axes there are 15^d of them.
GENERIC = 2.0 * (np.arange(1, 16) * 0.5 * (np.sqrt(5.0) - 1.0) % 1.0) - 1.0


def leja(candidates: Floats, count: int) -> Floats:
    """Leja points among distinct candidates, ``count`` at most; the most central is the first."""
    middle = 0.5 * (candidates.min() + candidates.max())
    chosen = [int(np.abs(candidates - middle).argmin())]
    product = np.ones(len(candidates))
    while len(chosen) < min(count, len(candidates)):
        product *= np.abs(candidates - candidates[chosen[-1]])
        chosen.append(int(product.argmax()))
    return np.asarray(candidates[chosen])


def newton_basis(nodes: Floats, v: Floats) -> Floats:
    """h_k(v_i) (K, n) for the nodes (K,) in their order."""
    table = np.ones((len(nodes), len(v)))
    np.cumprod(v - nodes[:-1, None], axis=0, out=table[1:])
    below = np.tri(len(nodes), k=-1, dtype=bool)
    scale = np.where(below, nodes[:, None] - nodes, 1.0).prod(axis=1)
    return np.asarray(table / scale[:, None])


def basis_at(axes: Sequence[Nodes], members: Ints, v: Floats) -> Floats:
    """h_γ(v_i) (n, N) for members (N, d) at places v (n, d)."""
    out = np.ones((len(members), len(v)))
    for axis, degrees, places in zip(axes, members.T, v.T, strict=True):
        out *= newton_basis(axis.v[: int(degrees.max()) + 1], places)[degrees]
    return out.T


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of one axis, and places for checks that are never nodes.

    The ``domain`` is where the polynomial will be used.
    """

    v: Floats
    checks: Floats
    domain: Floats

    @property
    def whole(self) -> bool:
        """True where no value can be asked for elsewhere."""
        return not len(self.checks)

    @cached_property
    def points(self) -> Floats:
        """The places that can be asked for: the nodes, then the checks."""
        return np.concatenate([self.v, self.checks])


@lru_cache(maxsize=16)
def interval_nodes(most: int) -> Nodes:
    """Nodes of the whole interval, at each place of which values can be asked for.

    There are four candidates for each of the most nodes, as dense at the ends as Chebyshev points.
    """
    v = -np.cos(np.linspace(0.0, np.pi, 4 * most + 1))
    v[2 * most] = 0.0
    return Nodes(leja(v, most), GENERIC, v)


def sample_nodes(places: Floats, most: int) -> Nodes:
    """Nodes among samples, the only places where values can be asked for."""
    v = leja(places, most)
    others = np.setdiff1d(places, v)
    nearest = np.abs(others[:, None] - GENERIC).argmin(axis=0) if len(others) else []
    return Nodes(v, others[list(dict.fromkeys(nearest))], places)


# --- Interpolants

POWERS = (1.0, 2.0, -2.0)  # of f that are tried, the quickest to evaluate first
LAST = np.arange(1, 5)  # coefficients from which the next is predicted
SLOWEST, FASTEST = 0.9, 0.02  # rates of decay that are believed
UNKNOWN, TRUSTED = 0.3, 6  # a rate that so few degrees show is at least this
IDLE = 1e-13  # relative size of coefficients that vanish but for round-off
SAFETY = 5.0  # times the predicted sum of missing coefficients
MISSED = 5.0  # times the error at the points held out is what it may be elsewhere
NEAR = 2.0  # factor by which another power must be better than one that is quicker to evaluate
# Of given solves, which are not added to: of 686 fits of 4 to 24 solves over modes that meet or
# come close six had errors up to 2.6 times what the coefficients and the values held out show.
SCARCE = 3.0
WORTHLESS = 0.5  # what these show from which a fit of given solves is refused


@dataclass(frozen=True, eq=False)
class Interpolant:
    """f^power ≈ Σ_γ c_γ h_γ; ``error`` estimates |δf/f| over the whole region."""

    power: float
    members: Ints  # (N, d)
    coefficients: Floats  # (n_outputs, N)
    sizes: Floats  # (N,): |δf/f| that each member stands for
    rates: Floats  # (d,); 0 on an axis that nothing depends on
    error: float
    rounds: tuple[tuple[int, float], ...] = ()  # members and error after each batch
    asked: int = 0  # values, checks included


def interpolate(
    axes: Sequence[Nodes],
    ask: Callable[[Ints], Floats],
    modes: Sequence[int],
    accuracy: float | None,
    most: int,
) -> Interpolant:
    """The interpolant of f to a relative ``accuracy``; where that is None, from ``most`` values.

    ``ask`` gives f (n, modes[-1] + 1) of all modes up to those and of one more, at points (n, d) of
    the axes. Raises AccuracyError where ``most`` values, or the nodes, do not suffice, and where
    those given show that the error is large; UsageError for too few to tell an error.
    """
    d, own = len(axes), [mode - 1 for mode in modes]
    if accuracy is None and most < fewest(d):
        named = "axis" if d == 1 else "axes"
        raise UsageError(f"{most} solves for {d} {named}: at least {fewest(d)} are needed")
    tops = np.array([len(each.v) - 1 for each in axes])
    beyond = tops + [not each.whole for each in axes]  # degrees up to which anything is missing
    given = min(most, int(np.prod(tops + 1.0)))
    reserved = 0 if d == 1 else 2 + given // 25  # of given values those that are held out
    fresh = _start(tops, np.array([each.whole for each in axes]), accuracy, given)
    space, expected = None, np.inf
    hz = held = np.zeros((0, modes[-1] + 1))
    apart = np.zeros((0, d), dtype=np.intp)
    rounds: list[tuple[int, float]] = []

    def refuse(why: str) -> None:
        count, error = len(hz) + len(held), rounds[-1][1] if rounds else np.inf
        wanted = "" if accuracy is None else f", not {accuracy:.1e}, and {why}"
        raise AccuracyError(
            f"{count} values leave an estimated error of {error:.1e}{wanted}"
            f"{_cause(np.vstack([hz, held]), modes)}"
        )

    while True:
        count = len(hz) + len(fresh)
        checks = reserved if count + reserved == given else 0
        if accuracy is not None:
            checks = 1 if d == 1 else 5 + count // 12
        members = fresh if space is None else np.vstack([space.indices, fresh])
        new = _held_out(axes, max(checks - len(apart), 0), np.vstack([members, apart]))
        if count + len(apart) + len(new) > most:
            refuse(f"over {most} are not allowed")
        values = ask(np.vstack([fresh, new]))
        space, hz = _joined(space, fresh, np.vstack([hz, values[: len(fresh)]]))
        apart, held = np.vstack([apart, new]), np.vstack([held, values[len(fresh) :]])
        found = _best_power(axes, space, beyond, hz[:, own])
        g = basis_at(axes, space.indices, _places(axes, apart)) @ found.coefficients.T
        off = np.abs(g / held[:, own] ** found.power - 1.0).max(initial=0.0)
        missed = MISSED * float(off) / abs(found.power)
        surprise = max(1.0, float(found.sizes[space.find(fresh)].sum()) / (expected or np.inf))
        shown = max(surprise * found.error, missed)
        rounds.append((count, shown if accuracy is not None else SCARCE * shown))
        room = 2 * count
        if accuracy is None:
            left, room = 0.0, min(room, given - reserved - count)
        elif rounds[-1][1] <= accuracy:
            break
        else:
            doubt = max(surprise, missed / found.error if found.error else 1.0)
            left = 0.5 * accuracy / doubt / _tail(found.rates)
        fresh, expected = _further(space, found, tops, left, room)
        if accuracy is None and not len(fresh):
            break
        if not len(fresh):
            refuse("more do not help")
    if accuracy is None and not rounds[-1][1] < SCARCE * WORTHLESS:
        refuse("")
    between = MISSED * _missed_between(axes, space, hz, own, found.power)
    asked = len(hz) + len(held)
    if between > max(rounds[-1][1], WORTHLESS if accuracy is None else accuracy):
        raise AccuracyError(
            f"{asked} values may be off by {between:.1e} between them"
            f"{_cause(np.vstack([hz, held]), modes)}"
        )
    error = max(rounds[-1][1], between)
    return replace(found, error=error, rounds=tuple(rounds), asked=asked)


def fewest(d: int) -> int:
    """Values on ``d`` axes that an error estimate needs at least."""
    return 3 if d == 1 else 1 + 2 * d + 2


def _start(tops: Ints, whole: NDArray[np.bool_], accuracy: float | None, given: int) -> Ints:
    """The first members: those on the axes to degree 2, or to one that the accuracy will need.

    All of an axis of a dozen samples, for so few show no rate. On a single axis a given number is
    all there is to choose.
    """
    d = len(tops)
    if accuracy is None:
        reach = np.minimum(tops, given - 1 if d == 1 else 2)
        rows = np.zeros((1, d), dtype=np.intp)
    else:
        digits = ceil(-log10(accuracy))
        degree = digits + 1 if d == 1 else min(1 + digits // 2, 4)
        reach = np.where(whole & (tops < 12), tops, np.minimum(tops, degree))
        rows = total_degree(d, 2).indices
    units = np.eye(d, dtype=np.intp)
    lines = [np.arange(top + 1)[:, None] * unit for top, unit in zip(reach, units, strict=True)]
    members = np.unique(np.vstack([rows, *lines]), axis=0)
    return np.asarray(members[(members <= tops).all(axis=1)])


def _held_out(axes: Sequence[Nodes], count: int, taken: Ints) -> Ints:
    """The first ``count`` points not ``taken``: corners, then places all over that are no nodes."""
    d = len(axes)
    turns = np.arange(d) % 2
    corners = [np.full(d, 1), np.full(d, 2), 1 + turns, 2 - turns] if d > 1 else []
    first = np.array([len(each.v) if len(each.checks) else 0 for each in axes])
    rooms = np.array([len(each.points) for each in axes]) - first
    spread = first + np.floor(kronecker(len(taken) + count + 1, d)[1:] * rooms).astype(np.intp)
    tops = np.array([len(each.points) - 1 for each in axes])
    found = np.minimum(np.vstack([*corners, spread]), tops)
    known = {*map(tuple, taken.tolist())}
    new = (row for row in found.tolist() if tuple(row) not in known)
    return np.array([*islice(new, count)], dtype=np.intp).reshape(-1, d)


def _places(axes: Sequence[Nodes], points: Ints) -> Floats:
    """Places v (n, d) of points (n, d) of the axes."""
    return np.column_stack([each.points[own] for each, own in zip(axes, points.T, strict=True)])


def _joined(space: LowerSet | None, rows: Ints, values: Floats) -> tuple[LowerSet, Floats]:
    """The set with further members, and values of the old and the new ones in its own order."""
    every = rows if space is None else np.vstack([space.indices, rows])
    joined = lower_set(every)
    return joined, values[np.argsort(joined.find(every))]


# --- Coefficients, and those that are missing


def _best_power(axes: Sequence[Nodes], space: LowerSet, beyond: Ints, f: Floats) -> Interpolant:
    """Interpolant of the power of f (N, n_outputs) whose missing coefficients are the smallest."""
    n, powers = len(space), np.array(POWERS)
    g = f[:, None] ** powers[:, None]  # (N, n_powers, n_outputs)
    at_nodes = basis_at(axes, space.indices, _places(axes, space.indices))
    c = solve_triangular(at_nodes, g.reshape(n, -1), lower=True).reshape(g.shape)
    # δ(f^p) = p f^p δf/f
    sizes = (np.abs(c) / (np.abs(powers)[:, None] * g.min(axis=0))).max(axis=2).T
    rates = np.array([_rates(space, each) for each in sizes])
    rest = _predicted(space, sizes, rates, _margin(space, beyond)).sum(axis=1)
    errors = [float(each) * _tail(own) for each, own in zip(rest, rates, strict=True)]
    k = next(k for k, error in enumerate(errors) if error <= NEAR * min(errors))
    return Interpolant(POWERS[k], space.indices, c[:, k].T, sizes[k], rates[k], errors[k])


def _rates(space: LowerSet, sizes: Floats) -> list[float]:
    """`decay` along each axis of the largest coefficients of each degree."""
    return [
        decay([float(sizes[degrees == k].max()) for k in range(int(degrees.max()) + 1)])
        for degrees in space.indices.T
    ]


def decay(layers: Sequence[float]) -> float:
    """The factor by which coefficients fall from one degree to the next; 0 if all vanish."""
    first, others = layers[0], layers[1:]
    if max(others, default=0.0) <= IDLE * first:
        return 0.0
    if len(others) < 3:
        found = (max(others) / min(first, 1.0)) ** 0.5
    else:  # of pairs, for every other one may vanish
        found = (max(others[-2:]) / max(*others[:2], 1e-300)) ** (1.0 / (len(others) - 2))
    least = UNKNOWN if len(layers) <= TRUSTED else FASTEST
    return float(min(max(found, least), SLOWEST))


def _tail(rates: Floats) -> float:
    """The factor from the first missing coefficients to the sum over all, with a safety."""
    return float(SAFETY / (1.0 - rates.max()))


def _margin(space: LowerSet, tops: Ints) -> Ints:
    """Multi-indices γ ≤ tops next to the set, all predecessors of which are in it."""
    units = np.eye(len(tops), dtype=np.intp)
    first = [~space.indices[:, :j].any(axis=1) for j in range(len(tops))]  # each index but once
    rows = np.vstack([space.indices[own] + unit for own, unit in zip(first, units, strict=True)])
    rows = rows[(rows <= tops).all(axis=1) & (space.find(rows) < 0)]
    for unit in units:
        rows = rows[(rows @ unit == 0) | (space.find(rows - unit) >= 0)]
    return np.asarray(rows)


def _predicted(space: LowerSet, sizes: Floats, rates: Floats, rows: Ints) -> Floats:
    """|c_γ| (n, n_rows) of several sizes (n, N) and rates (n, d); the constant shows nothing.

    No size counts as less than those beyond it: on the axes c vanishes where f depends on several
    axes only together, as on their product.
    """
    d = space.n_variables
    steps = LAST[:, None, None] * np.eye(d, dtype=np.intp)  # (k, d, d)
    places = space.find((rows - steps[:, :, None]).reshape(-1, d)).reshape(len(LAST), d, len(rows))
    known = np.pad(sizes, ((0, 0), (0, 1)))  # the last for those that are none
    units = np.eye(d, dtype=np.intp)
    above = space.find((space.indices[:, None] + units).reshape(-1, d)).reshape(-1, d)
    for first, last in list(pairwise(space.degree_starts))[::-1]:
        own = known[:, first:last]
        np.maximum(own, known[:, above[first:last]].max(axis=2), out=own)
    known[:, 0] = 0.0
    terms = known[:, places] * rates[:, None, :, None] ** LAST[:, None, None]
    terms = np.where(rows.T > 0, terms.max(axis=1), 1.0)
    return np.asarray(terms.prod(axis=1) ** (1.0 / (rows > 0).sum(axis=1)))


def _further(
    space: LowerSet, found: Interpolant, tops: Ints, left: float, room: int
) -> tuple[Ints, float]:
    """Members to add, ``room`` at most, and the sum of their predicted coefficients.

    The largest first, until those that are missing sum up to ``left``; of what is next to the set
    half at once, for what is next to these may be larger. None where every axis is at its end.
    """
    grown, sizes, expected = space, found.sizes, 0.0
    while True:
        rows = _margin(grown, tops)
        next_ = _predicted(grown, sizes[None], found.rates[None], rows)[0]
        order = np.argsort(-next_, kind="stable")
        rest = np.cumsum(next_[order[::-1]])[::-1]
        count = int((rest > left).sum())
        if not count and grown is space:  # the error is too large for another reason
            count = int((next_ > 0.0).sum()) or len(rows)
        count = min(count, (len(rows) + 1) // 2, len(space) + room - len(grown))
        if not count:
            break
        taken = order[:count]
        expected += float(next_[taken].sum())
        grown, sizes = _joined(grown, rows[taken], np.append(sizes, next_[taken]))
    return grown.indices[space.find(grown.indices) < 0], expected


def _everywhere(axes: Sequence[Nodes], count: int = 1000) -> Floats:
    """Places v (n, d) all over the region: of one axis all there are, of several so many.

    Every other of those is moved to a face.
    """
    d = len(axes)
    if d == 1:
        return axes[0].domain[:, None]
    spread = np.arange(1, count + 1)[:, None] * strides(2 * d) % 1.0
    at, face = np.hsplit(spread, [d])
    at[::2] = np.where(face[::2] < 0.5, at[::2], np.round(at[::2]))
    sizes = np.array([len(each.domain) for each in axes])
    rows = np.minimum(at * sizes, sizes - 1.0).astype(np.intp)
    return np.column_stack([each.domain[own] for each, own in zip(axes, rows.T, strict=True)])


# --- Where modes meet between the nodes

CLOSE = 1e-2  # relative gap in Hz below which neighbouring modes are named as a cause, or
CLOSER = 0.2  # this part of the largest
FAR = 0.5  # part of the largest distance at the nodes over which modes nowhere come near


def _missed_between(
    axes: Sequence[Nodes], space: LowerSet, hz: Floats, own: Sequence[int], power: float
) -> float:
    """|δf/f| of the modes in columns ``own`` of ``hz`` (N, n), the lowest modes at the nodes.

    Zero where they come near no neighbour, as one without mass, whose f is infinite.
    """
    g = hz**power
    d = np.abs(np.diff(g, axis=1))
    near = (d.min(axis=0) < FAR * d.max(axis=0)) & np.isfinite(hz[:, 1:]).all(axis=0)
    pairs = {k for mode in own for k in (mode - 1, mode) if 0 <= k < len(near) and near[k]}
    if not pairs:
        return 0.0
    at_nodes, between = (
        basis_at(axes, space.indices, v) for v in (_places(axes, space.indices), _everywhere(axes))
    )
    missed = 0.0
    for k in pairs:
        here = g[:, [j for j in (k, k + 1) if j in own]]
        known = np.column_stack([d[:, k], d[:, k] ** 2, here])
        found = between @ solve_triangular(at_nodes, known, lower=True)
        off = np.abs(np.sqrt(np.maximum(found[:, 1], 0.0)) - found[:, 0])
        missed = max(missed, float((off[:, None] / np.abs(found[:, 2:])).max()))
    return 0.5 * missed / abs(power)


def _cause(hz: Floats, modes: Sequence[int]) -> str:
    """Neighbouring modes that come close, the usual cause of a large error, to end a message.

    ``hz`` (n, modes[-1] + 1) are all modes up to those, and one more.
    """
    gap = 1.0 - hz[:, :-1] / hz[:, 1:]
    if not len(gap):
        return ""
    close = gap.min(axis=0) < np.maximum(CLOSE, CLOSER * gap.max(axis=0))
    near = [k + 1 for k in np.flatnonzero(close) if {k + 1, k + 2} & set(modes)]
    named = ", ".join(f"{k} and {k + 1}" for k in near)
    return f"; modes {named} come close, and where they meet none is smooth" if near else ""
