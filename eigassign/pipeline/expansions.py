"""Both expansions of a plan: from the cache, bit for bit, or computed and stored there."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from math import comb
from typing import Any

import numpy as np
import scipy

from eigassign.errors import UsageError
from eigassign.modal.arguments import MOST_TERMS
from eigassign.modal.confirmation import ExpansionRequest, unlike
from eigassign.modal.expansion import expand
from eigassign.modal.model import Model
from eigassign.modal.storage import (
    ALGORITHM,
    expansion_arrays,
    expansions_from_arrays,
    pencil_parts,
)
from eigassign.output.store.cache import Cache, key
from eigassign.study.planning import Plan
from eigassign.study.scene import Expansions

_log = logging.getLogger(__name__)


def expand_plan(model: Model, plan: Plan, cache: Cache | None) -> tuple[Expansions, list[str]]:
    """Both expansions of a plan, and notes on how they came about.

    The linearised one is what the optimum rests on and is always of the plan's order; the full one
    is there to compare with, and of a lower order where its set would be too large.
    """
    full_order = affordable_order(model, plan.order)
    expansions, known = _expansions(model, plan, full_order, cache)
    further = [replace(plan, q0=np.array(q), more_q=()) for q in plan.more_q]
    others = [_expansions(model, at, full_order, cache)[0] for at in further]
    expansions = replace(expansions, others=tuple(others))
    full, linear = expansions.full, expansions.linear
    notes = [_size_note(expansions), *dict.fromkeys(full.notes + linear.notes)]
    if full_order < plan.order:
        notes.append(
            f"the full expansion, only there to compare with, stops at order {full_order}: order "
            f"{plan.order} in so many variables has over {MOST_TERMS} coefficients"
        )
    if known:
        notes.append("the expansion coefficients come from the cache")
    return expansions, notes


def _size_note(expansions: Expansions) -> str:
    full, linear = expansions.full.space, expansions.linear.space
    return (
        f"order {expansions.order} in {full.n_variables} variables: {len(linear)} coefficients "
        f"partially linearised, {len(full)} in full"
    )


def affordable_order(model: Model, order: int) -> int:
    """The highest order up to ``order`` whose full set has at most `MOST_TERMS` members; ≥ 1."""
    n = int(model.pencil.active.sum())
    fitting = [p for p in range(1, order + 1) if comb(n + p, p) <= MOST_TERMS]
    return fitting[-1] if fitting else 1


@dataclass(frozen=True)
class ExpansionSize:
    """About what the full expansion of a plan takes; ``coefficients`` of each mode."""

    order: int
    coefficients: int
    memory_mb: float
    seconds: float


def expansion_size(model: Model, plan: Plan) -> ExpansionSize:
    """Estimated: one mode to order p in n variables takes, with the linearised one beside it, about

        t = 1.2 μs · C(2n + p, p) + 20 ns · n_θ V,    V = C(n + ⌊(p−1)/2⌋, n) C(n + ⌊p/2⌋, n)

    for the C(2n + p, p) products of two coefficients, and the n_θ terms of the pencil between V
    pairs of eigenvector coefficients. (The six-axis arm takes 0.6 to 1.4 times as long from order 6
    to 8, up to 3 times where others use the machine's memory; all of less than 50 ms takes longer.)
    Each pair and each product holds about 24 bytes at the peak.
    """
    n, p = int(model.pencil.active.sum()), affordable_order(model, plan.order)
    products = comb(2 * n + p, p)
    met = model.pencil.n_theta * comb(n + (p - 1) // 2, n) * comb(n + p // 2, n)
    seconds = 1.2e-6 * products + 20e-9 * met
    memory_mb = 24.0 * (met + products) / 1e6
    times = len(plan.modes) * (1 + len(plan.more_q))
    return ExpansionSize(p, comb(n + p, p), memory_mb, times * seconds)


def _expansions(
    model: Model, plan: Plan, full_order: int, cache: Cache | None
) -> tuple[Expansions, bool]:
    """The expansions, and True where they come from the cache."""
    if cache is None:
        return _computed(model, plan, full_order), False
    entry = expansion_key(model, plan, full_order)
    if (found := _stored(cache, entry, model, plan, full_order)) is not None:
        return found, True
    fresh = _computed(model, plan, full_order)
    cache.store(entry, expansion_arrays(fresh.full, fresh.linear), _meta(plan))
    return fresh, False


def _computed(model: Model, plan: Plan, full_order: int) -> Expansions:
    point, gap = (model.pencil, plan.q0, plan.y0, plan.modes), plan.cluster_gap
    return Expansions(
        full=expand(*point, full_order, linear_in_y=False, cluster_gap=gap),
        linear=expand(*point, plan.order, linear_in_y=True, cluster_gap=gap),
        order=plan.order,
        full_order=full_order,
    )


def _stored(
    cache: Cache, entry: str, model: Model, plan: Plan, full_order: int
) -> Expansions | None:
    arrays = cache.load(entry)
    if arrays is None:
        return None
    try:
        found = expansions_from_arrays(arrays, 2)
        full, linear = (replace(e, pencil=model.pencil) for e in found)
        x0 = np.concatenate([plan.q0, plan.y0])
        sets = ((full_order, False), (plan.order, True))
        wanted = ExpansionRequest(x0, tuple(sorted(plan.modes)), plan.cluster_gap, sets)
        if (reason := unlike(model.pencil, (full, linear), wanted)) is not None:
            raise UsageError(reason)
        return Expansions(full, linear, plan.order, full_order)
    except UsageError as error:
        _log.warning("cache entry %s cannot be used (%s); computed anew", entry[:12], error)
        return None


def expansion_key(model: Model, plan: Plan, full_order: int) -> str:
    """SHA-256 over all that the numbers of both expansions follow from.

    The pencil's arrays, the point, the modes, the sets, and the versions of this algorithm and of
    the libraries that do its arithmetic: where any of them differs, so may the last bit.
    """
    parts: list[Any] = [
        pencil_parts(model.pencil),
        plan.q0,
        plan.y0,
        list(plan.modes),
        [full_order, plan.order, plan.cluster_gap],
        [np.__version__, scipy.__version__],
    ]
    return key(parts, algorithm=ALGORITHM)


def _meta(plan: Plan) -> dict[str, str]:
    """Words for those who list the cache."""
    return {
        "what": f"expansion of order {plan.order}",
        "modes": ", ".join(map(str, plan.modes)),
        "q0": ", ".join(f"{value:.6g}" for value in plan.q0),
        "y0": ", ".join(f"{value:.6g}" for value in plan.y0),
    }
