"""The methods that a chart puts side by side, in the order in which they are charted.

SciPy's eigensolver is what people use without eigassign.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from eigassign.chart.question import Bench, Points
from eigassign.modal.exact.dense import condense
from eigassign.modal.expansion import Expansion, NearestExpansion, expand
from eigassign.modal.model import Model
from eigassign.modal.reduced import ReducedModel, reduce
from eigassign.study.pictures import spread_samples

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Built:
    """A method that is set up: points → Hz (n, n_modes)."""

    evaluate: Callable[[Points], Floats]
    solves: int = 0  # exact ones of the set-up


@dataclass(frozen=True, eq=False)
class Method:
    """A way to the frequencies; ``build`` sets it up."""

    name: str
    family: str
    parameters: Mapping[str, Any]  # from which it can be set up again
    build: Callable[[], Built]
    use: str = ""  # the call that asks for it; of those by others none
    key: str = ""  # what a case file asks for it by, under `expansion`

    @property
    def ours(self) -> bool:
        """True of what eigassign offers; the others are what people do without it."""
        return bool(self.use or self.key) or self.family == "exact"


def list_methods(bench: Bench) -> Iterator[Method]:
    """The list of all methods."""
    model = bench.scene.model
    kind, solver = "dense" if model.pencil.is_dense else "sparse", Built(bench.exact)
    yield Method(f"exact {kind}", "exact", {"solver": f"{kind}, in batches"}, lambda: solver)
    # one sample at a time, and few: about 20 n³ operations each at 6e9 a second
    if few := min(40, int(3e8 * bench.effort.most_s / model.n_dof**3)):
        told = {"solver": "scipy.linalg.eigh, subset by index", "points": few}
        peer = Built(partial(by_scipy, model, bench.scene.expansions.modes))
        yield Method("exact dense, SciPy one by one", "exact by others", told, lambda: peer)
    yield from _series(bench)
    yield from _reduced_models(bench)


# --- Exact solves by others


def by_scipy(model: Model, modes: Sequence[int], points: Points) -> Floats:
    """Frequencies (n, n_modes) in Hz by scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ."""
    elastic, mu = model.pencil.elastic, np.empty((len(points), max(modes)))
    which = [len(elastic) - max(modes), len(elastic) - 1]
    for k, x in enumerate(np.hstack([points.q, points.y])):
        K, M = model.pencil.matrices(model.pencil.theta(x[None]))
        _, M_c = condense(M, elastic, model.pencil.rigid)
        K_E = K[0][np.ix_(elastic, elastic)]
        mu[k] = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=which)[::-1]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu[:, np.array(modes) - 1])))


# --- Series and reduced models: eigassign's


def _call(bench: Bench, function: str, arguments: str, **how: object) -> str:
    """The words of a call for the modes of the chart."""
    modes = bench.scene.expansions.modes
    named = how if modes == (1,) else {"modes": modes, **how}
    return f"{function}({', '.join([arguments, *(f'{k}={v!r}' for k, v in named.items())])})"


def _answering(made: Expansion | NearestExpansion | ReducedModel, solves: int) -> Built:
    return Built(lambda points: made.frequencies(points.q, points.y), solves)


def _about(bench: Bench, count: int) -> tuple[Floats, Floats, str]:
    """Points q, y to expand about, the case's own or spread along the trajectory; and how many."""
    full, path = bench.scene.expansions.full, bench.scene.path.q
    q = full.q0[None] if count == 1 else path[spread_samples(path, count)]
    return q, np.tile(full.y0, (len(q), 1)), f"{len(q)} point{'s' if len(q) > 1 else ''}"


def _series(bench: Bench) -> Iterator[Method]:
    """λ and 1/λ expanded to each order, in full and linearised; λ in full at several points too."""
    effort, full, told = bench.effort, bench.scene.expansions.full, dict[str, Any]()
    n = int(bench.scene.model.pencil.active.sum())
    wanted = sorted({*effort.orders, bench.scene.expansions.order})
    orders = [p for p in wanted if comb(n + p, p) <= effort.coefficients]
    for inverse, linear, order in product((False, True), (False, True), orders):
        kind, how = ("linearised", {"linear_in_y": True}) if linear else ("full", {})
        symbol, key = "1/λ" if inverse else "Taylor", f"order: {order}"
        use = _call(bench, "ea.expand", "model, q0, y0", order=order, **how) + ".inverse" * inverse
        use, key = (use, "") if inverse or linear else ("", key)
        told = {"order": order, "linear_in_y": linear, "q0": full.q0, "y0": full.y0}
        build = partial(_expanded, bench, told, inverse)
        yield Method(f"{symbol} {order} {kind}", f"{symbol}, {kind}", told, build, use, key)
    for count, order in product(effort.expansion_points[1:], orders[1:]):
        q, y, where = _about(bench, count)
        told = {"order": order, "q0": q, "y0": y}
        each = _call(bench, "ea.expand", "model, q, y", order=order)
        use = f"[{each} for q, y in zip(q0, y0)], at a pose the one whose q is nearest"
        build = partial(_expanded, bench, told, False)
        yield Method(f"Taylor {order} at {where}", "Taylor, several points", told, build, use)


def _expanded(bench: Bench, told: Mapping[str, Any], inverse: bool) -> Built:
    """λ about one or several points, of which the nearest answers, or 1/λ about one."""
    pencil, modes = bench.scene.model.pencil, bench.scene.expansions.modes
    how = {key: told[key] for key in ("order", "linear_in_y") if key in told}
    points = zip(np.atleast_2d(told["q0"]), np.atleast_2d(told["y0"]), strict=True)
    parts = tuple(expand(pencil, q0, y0, modes, **how) for q0, y0 in points)
    return _answering(parts[0].inverse if inverse else NearestExpansion(parts), len(parts))


def _reduced_models(bench: Bench) -> Iterator[Method]:
    """Reduced models of each half order m at one or several points."""
    for count, m in product(bench.effort.expansion_points, bench.effort.half_orders):
        q, y, where = _about(bench, count)
        use = _call(bench, "ea.reduce", "model, q0, y0", half_order=m)
        told = {"half_order": m, "q": q, "y": y}
        build = partial(_reduced, bench, told)
        yield Method(f"reduced m = {m}, {where}", f"reduced, {where}", told, build, use)


def _reduced(bench: Bench, told: Mapping[str, Any]) -> Built:
    """A reduced model about one or several points."""
    pencil, modes = bench.scene.model.pencil, bench.scene.expansions.modes
    reduced = reduce(pencil, told["q"], told["y"], modes, told["half_order"])
    # for modes, wanted vectors, and vectors of guards
    others = set(range(1, min(max(modes) + 1, len(pencil.elastic)) + 1)) - set(modes)
    return _answering(reduced, (3 if others and told["half_order"] >= 2 else 2) * len(told["q"]))
