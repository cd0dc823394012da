"""The design that `optimize` finds, against the best of 12 SciPy searches on exact frequencies.

All shipped cases with wanted frequencies, and random ones. SciPy: ``least_squares`` within bounds,
SLSQP where there are linear constraints, feasibility checked again, with analytic slopes; from the
initial design, the middle of the bounds and ten random designs.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import json
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import references
from references import Named, oracle

import eigassign as ea

ROUND_OFF = 1e-10  # rms: errors below it are none
NEAR = 1e-3  # within this of the best of SciPy's
SHARE = 0.95  # of all cases


def row(named: Named, best: dict[str, Any]) -> dict[str, Any]:
    """One line of the table; errors in %, recomputed exactly."""
    problem = oracle.of_case(named.case)
    base = {
        "case": named.name,
        "n_dof": named.case.model().n_dof,
        "n_y": len(problem.initial),
        "limits": len(problem.C),
        "initial": 100.0 * problem.rms(problem.initial),
    }
    begun = time.process_time()
    try:
        found = ea.assign(named.case)
    except ea.EigassignError as error:
        return {**base, "ratio": np.inf, "verdict": f"{type(error).__name__}: {error}"}
    seconds = time.process_time() - begun
    y, how = np.array(list(found.design.values())), found.results.assignment
    ours = problem.rms(y)
    return {
        **base,
        "one shot": "" if how.one_shot is None else 100.0 * problem.rms(how.one_shot),
        "ours": 100.0 * ours,
        "SciPy": 100.0 * best["value"],
        "ratio": max(ours, ROUND_OFF) / max(best["value"], ROUND_OFF),
        "steps": len(how.steps),
        "exact solves": how.exact_solves,
        "s": seconds,
        "SciPy s": float(sum(best["seconds"])),
        "SciPy solves": sum(best["evaluations"]) * len(problem.q),
        "verdict": how.verdict + ("" if how.finished else f", {how.ended}"),
        "violation": problem.violation(y),
        "stationarity": how.optimality.stationarity,
        "starts": how.starts,
        "optima": len(how.local_optima),
        "worse than before": bool(ours > problem.rms(problem.initial) * (1.0 + 1e-12)),
        "y": y.tolist(),
        "best y": best["y"],
    }


SHOWN = (
    "case", "n_dof", "n_y", "limits", "initial", "one shot", "ours", "SciPy", "ratio", "steps",
    "starts", "exact solves", "s", "SciPy s", "verdict",
)  # fmt: skip


def main() -> None:
    given = references.options(__doc__ or "").parse_args()
    rows: list[dict[str, Any]] = []
    for named in references.chosen(given):
        best = references.reference(named, given.references, oracle.best_least_squares)
        if given.only_references:
            print(named.name, best["value"], flush=True)
            continue
        rows.append(row(named, best))
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    if rows:
        kind = "_confirmation" if given.confirmation else ""
        name = f"assignment_optima{kind}"
        shown = [{key: _cell(key, each.get(key, "")) for key in SHOWN} for each in rows]
        common.report(name, "Designs against the best of SciPy's", shown, remarks(rows))


def _cell(key: str, value: object) -> object:
    return f"{value:.5f}" if key == "ratio" and isinstance(value, float) else value


def remarks(rows: Sequence[dict[str, Any]]) -> list[str]:
    near = sum(r["ratio"] <= 1.0 + NEAR for r in rows)
    worse = [r["case"] for r in rows if r.get("worse than before", True)]
    broken = [r["case"] for r in rows if r.get("violation", 0.0) > oracle.FEASIBLE]
    return [
        "initial, one shot, ours, SciPy: rms of f/f_d − 1 over time and targets, in %; "
        f"those below {100 * ROUND_OFF:g} % are round-off, and count as that",
        "exact solves: poses and designs solved exactly, slopes included",
        f"within {100 * NEAR:g} % of SciPy's best: {near} of {len(rows)}, wanted {SHARE:.0%}",
        f"worse than the initial design: {', '.join(worse) or 'none'}",
        f"outside its limits: {', '.join(broken) or 'none'}",
    ]


if __name__ == "__main__":
    main()
