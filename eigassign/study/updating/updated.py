"""The case that an update leaves: values found, and how well they are known, as `uncertain`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.schema.design import Design, Tolerance
from eigassign.case.schema.parts import FrozenDict
from eigassign.case.schema.uncertain import Explanation, Uncertain, UncertainProperty
from eigassign.study.built_case import BuiltCase
from eigassign.study.updating.fit import ExplainingMinimum, UpdateResults


def updated_case(case: BuiltCase, results: UpdateResults) -> BuiltCase:
    """The case with the values found, which are `uncertain`; what is designed is yet to be added.

    Of a parameter that has no deviation its interval is a range. Where nothing is explained, only
    the values are written.
    """
    file = case.file.with_design(row.value for row in results.parameters)
    columns = file.design.parameters
    known, spread = dict[str, UncertainProperty](), dict[str, int]()
    for k, row in enumerate(results.parameters):
        name, paths = row.name.replace(".", "_"), [*columns[row.name].factors.items()]
        several = tuple(FrozenDict({path: factor}) for path, factor in paths[1:])
        more: dict[str, Any] = {"min": row.ends[0], "max": row.ends[1]}
        if row.deviation is not None:
            deviation, spread[name] = Tolerance(row.deviation, relative=False), k
            more = {"standard_deviation": deviation, "interval": (row.low, row.high)}
        elif row.ends[0] >= row.ends[1]:
            continue
        path = (paths[0][0], *several) if several else paths[0][0]
        known[name] = UncertainProperty.model_construct(parameter=path, value=row.value, **more)
    others = tuple(_explanation(one, results, spread) for one in results.minima[1:] if spread)
    correlation = _correlation(results.covariance, spread)
    own = Uncertain.model_construct(entries=known, correlation=correlation, others=others)
    explained = known and results.verdict in ("fitted", "not_identified")
    left = replace(file, design=Design.model_construct(), measurements=None, sweep=None)
    expansion = file.expansion.model_copy(update={"y": "auto"})
    return BuiltCase(replace(left, expansion=expansion, uncertain=own if explained else None))


def _explanation(
    one: ExplainingMinimum, results: UpdateResults, spread: Mapping[str, int]
) -> Explanation:
    """A further minimum as the case file has it; deviations of the best where it has none."""
    covariance, of_best = one.covariance.copy(), np.diag(results.covariance)
    for k in spread.values():
        if not 0.0 < covariance[k, k] < np.inf:
            covariance[k], covariance[:, k] = 0.0, 0.0
            covariance[k, k] = of_best[k]
    each = [*one.values.values()]
    deviations = {name: float(np.sqrt(covariance[k, k])) for name, k in spread.items()}
    return Explanation.model_construct(
        values={name: each[k] for name, k in spread.items()},
        standard_deviation={n: Tolerance(d, relative=False) for n, d in deviations.items()},
        correlation=_correlation(covariance, spread),
    )


def _correlation(covariance: Floats, spread: Mapping[str, int]) -> FrozenDict[Any]:
    """Correlations by pairs of names, as the case file has them."""
    size, names = np.sqrt(np.diag(covariance)), [*spread]
    return FrozenDict(
        {
            a: FrozenDict({b: float(covariance[i, j] / (size[i] * size[j])) for b, j in after})
            for k, (a, i) in enumerate(spread.items())
            if (after := [(b, spread[b]) for b in names[k + 1 :]])
        }
    )
