"""Expansions that were computed before: taken from the cache, bit for bit, or made and kept."""

from __future__ import annotations

import logging
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from eigassign.errors import UsageError
from eigassign.modal.expansion import CLUSTER_GAP, Expansion, expand
from eigassign.modal.model import Model
from eigassign.modal.storage import (
    ALGORITHM,
    expansion_arrays,
    expansion_from_arrays,
    pencil_parts,
)
from eigassign.study.approximation import Expansions
from eigassign.study.plan import Plan

if TYPE_CHECKING:
    from eigassign.output.cache import Cache

_log = logging.getLogger(__name__)
FULL_LIMIT = 5000  # coefficients up to which the full set is taken to the asked order


def expand_plan(model: Model, plan: Plan, cache: Cache | None) -> tuple[Expansions, list[str]]:
    """Both expansions of a plan, and notes on how they came about.

    The linearised one is what the optimum rests on and is always of the plan's order; the full one
    is there to compare with, and of a lower order where its set would be too large.
    """
    full_order = affordable_order(model, plan.order)
    full, full_known = _expansion(model, plan, full_order, False, cache)
    linear, linear_known = _expansion(model, plan, plan.order, True, cache)
    notes = [_size_note(full, linear), *dict.fromkeys(full.notes + linear.notes)]
    if full_order < plan.order:
        notes.append(
            f"the full expansion, only there to compare with, stops at order {full_order}: order "
            f"{plan.order} in so many variables has over {FULL_LIMIT} coefficients"
        )
    known = [name for name, hit in (("full", full_known), ("linear", linear_known)) if hit]
    if known:
        notes.append(f"coefficients taken from the cache: {' and '.join(known)}")
    return Expansions(full, linear), notes


def _size_note(full: Expansion, linear: Expansion) -> str:
    sizes = (len(full.space), len(linear.space))
    return (
        f"order {full.order}: {sizes[0]} coefficients in full, {sizes[1]} partially linearised "
        f"(order {linear.order}), in {full.space.n_variables} variables"
    )


def affordable_order(model: Model, order: int) -> int:
    """The highest order up to ``order`` whose full set has at most `FULL_LIMIT` members; ≥ 1."""
    n = int(model.pencil.active.sum())
    fitting = [p for p in range(1, order + 1) if comb(n + p, p) <= FULL_LIMIT]
    return fitting[-1] if fitting else 1


def _expansion(
    model: Model, plan: Plan, order: int, linear: bool, cache: Cache | None
) -> tuple[Expansion, bool]:
    """The expansion, and whether it was known."""
    entry = "" if cache is None else expansion_key(model, plan, order, linear)
    if cache is not None and (found := _stored(cache, entry)) is not None:
        return found, True
    fresh = expand(model.pencil, plan.q0, plan.y0, plan.modes, order, linear)
    if cache is not None:
        cache.store(entry, expansion_arrays(fresh), _meta(plan, order, linear))
    return fresh, False


def _stored(cache: Cache, entry: str) -> Expansion | None:
    arrays = cache.load(entry)
    if arrays is None:
        return None
    try:
        return expansion_from_arrays(arrays)
    except UsageError as error:
        _log.warning("cache entry %s cannot be used (%s); computed anew", entry[:12], error)
        return None


def expansion_key(model: Model, plan: Plan, order: int, linear: bool) -> str:
    """SHA-256 over all that the numbers of an expansion follow from.

    The pencil's arrays, the point, the modes, the set, and the versions of this algorithm and of
    the libraries that do its arithmetic: where any of them differs, so may the last bit.
    """
    from eigassign.output.cache import key

    parts: list[Any] = [
        pencil_parts(model.pencil),
        plan.q0,
        plan.y0,
        list(plan.modes),
        order,
        linear,
        CLUSTER_GAP,
        np.__version__,
        scipy.__version__,
    ]
    return key(parts, algorithm=ALGORITHM)


def _meta(plan: Plan, order: int, linear: bool) -> dict[str, str]:
    """For people who list the cache."""
    return {
        "what": "partially linearised expansion" if linear else "full expansion",
        "order": str(order),
        "modes": ", ".join(map(str, plan.modes)),
        "q0": ", ".join(f"{value:.6g}" for value in plan.q0),
        "y0": ", ".join(f"{value:.6g}" for value in plan.y0),
    }
