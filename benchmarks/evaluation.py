"""Evaluating the reduced model and the polynomial on 10 000 samples, against exact sparse solves.

Arms of some 2 000 dof; samples uniform in a box of ±20° of every joint and ±20 % of every design
parameter. Exact solves are timed on a few of the samples and extrapolated: each costs the same.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import arms
import numpy as np
from literal_procedure import Q0, design

import eigassign as ea

SAMPLES, EXACT = 10_000, 40


def evaluate(what: str, case: ea.Case, q0: np.ndarray) -> list[common.Row]:
    """Times, their ratios and the errors on one arm."""
    model, y0 = case.model(), case.initial_design
    rng = np.random.default_rng(0)
    q = q0 + np.deg2rad(20.0) * rng.uniform(-1.0, 1.0, (SAMPLES, len(q0)))
    y = y0 * (1.0 + 0.2 * rng.uniform(-1.0, 1.0, (SAMPLES, len(y0))))
    reduced = ea.reduce(model, q0, y0, (1,), 2)
    expansions = {order: ea.expand(model, q0, y0, (1,), order) for order in (2, 4)}
    jobs = {
        "exact": lambda: model.frequencies(q[:EXACT], y[:EXACT], 1),
        f"reduced, {reduced.size} vectors": lambda: reduced.frequencies(q, y),
        "polynomial, order 2": lambda: expansions[2].frequencies(q, y),
        "polynomial, order 4": lambda: expansions[4].frequencies(q, y),
    }
    times = common.medians(jobs, 5)
    times["exact"] *= SAMPLES / EXACT
    right = jobs["exact"]()
    variables = expansions[2].space.n_variables
    rows: list[common.Row] = []
    for name, seconds in times.items():
        values = None if name == "exact" else jobs[name]()[:EXACT]
        worst = "" if values is None else float(np.nanmax(np.abs(values / right - 1.0)))
        rows.append(
            {
                "arm": f"{what}, {model.n_dof} dof, {variables} variables",
                "what": name,
                f"{SAMPLES} samples": f"{seconds:.3g} s",
                "ratio": times["exact"] / seconds,
                "worst relative error in Hz": worst,
            }
        )
    return rows


def main() -> None:
    two = arms.serial_arm(333, {name: design()[name] for name in ("m0", "m1")})
    for k in range(2, 6):
        arms.remove_link(two, k)
    rows = evaluate("two links", arms.case_of(two), Q0[:2])
    six = arms.serial_arm(111, design())
    rows += evaluate("six links", arms.case_of(six), Q0)
    common.report(
        "evaluation",
        f"Mode 1 at {SAMPLES} samples of (q, y)",
        rows,
        [
            f"exact: extrapolated from {EXACT} sparse solves",
            "wanted: reduced at least 100, polynomial at least 10 000",
            f"errors over the {EXACT} exact samples",
        ],
    )


if __name__ == "__main__":
    main()
